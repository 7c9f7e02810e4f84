//! Random numbers for tests, the same in every run.

/// Xorshift with 64 bits (Marsaglia, Xorshift RNGs, 2003).
pub struct Random(u64);

impl Random {
    /// The numbers of a seed.
    pub fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(2) | 1)
    }

    /// For a test of many cases: neighbouring seeds give unrelated numbers, the first ones too.
    pub fn case(seed: u64) -> Self {
        Self::new((seed + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15))
    }

    /// All 64 bits.
    pub fn bits(&mut self) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0
    }

    /// A number from 0 to `n`, which is left out; 0 where `n` is 0.
    pub fn below(&mut self, n: usize) -> usize {
        ((self.bits() >> 11) % n.max(1) as u64) as usize
    }

    /// A number from `lo` to `hi`, both included.
    pub fn between(&mut self, lo: i64, hi: i64) -> i64 {
        lo + self.below((hi - lo + 1) as usize) as i64
    }

    /// Whether a chance of so many in a hundred comes true.
    pub fn chance(&mut self, percent: usize) -> bool {
        self.below(100) < percent
    }

    /// Uniform in [-0.5, 0.5).
    pub fn half(&mut self) -> f64 {
        self.unit() - 0.5
    }

    /// Uniform in [0, 1).
    pub fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Uniform in [lo, hi).
    pub fn range(&mut self, lo: f64, hi: f64) -> f64 {
        lo + self.unit() * (hi - lo)
    }

    /// Any number: of all magnitudes, and often a special one.
    pub fn float(&mut self) -> f64 {
        let subnormal = f64::from_bits(self.bits() >> 12);
        let finite = [0.0, 1.0, subnormal, f64::MIN_POSITIVE, f64::MAX];
        match self.below(20) {
            0 => f64::NAN,
            1 => f64::INFINITY,
            2 => f64::NEG_INFINITY,
            3..6 => finite[self.below(finite.len())],
            6..9 => -finite[self.below(finite.len())],
            _ => f64::from_bits(self.bits()),
        }
    }

    /// A character from the space to the tilde.
    fn ascii(&mut self) -> char {
        char::from(b' ' + self.below(95) as u8)
    }

    /// Up to `most` characters, each of printable ASCII or, often, of `more`.
    pub fn words(&mut self, most: usize, more: &str) -> String {
        let more: Vec<char> = more.chars().collect();
        let count = self.below(most + 1);
        (0..count).map(|_| if self.chance(30) { more[self.below(more.len())] } else { self.ascii() }).collect()
    }

    /// Up to `most` characters of any kind but the line feed.
    pub fn text(&mut self, most: usize) -> String {
        // Markup; controls; spaces; letters; a combining one; some without width; noncharacters.
        let special: Vec<char> = "<>&\"'\\|\0\t\r\u{b}\u{1b}\u{7f}\u{85}\u{a0}\u{2028}µȺѨ漢🕴\
                                  \u{301}\u{200d}\u{202e}\u{feff}\u{fffd}\u{fffe}\u{ffff}\u{10ffff}"
            .chars()
            .collect();
        let count = self.below(most + 1);
        (0..count).map(|_| self.any_char(&special)).collect()
    }

    /// One of some special characters, any that Unicode has but the line feed, or one of printable ASCII.
    fn any_char(&mut self, special: &[char]) -> char {
        match self.below(4) {
            0 => special[self.below(special.len())],
            1 => {
                let code = self.below(0x11_0000) >> self.below(16);
                char::from_u32(code as u32).filter(|c| *c != '\n').unwrap_or(' ')
            }
            _ => self.ascii(),
        }
    }

    /// Puts a list into another order.
    pub fn shuffle<T>(&mut self, list: &mut [T]) {
        for i in (1..list.len()).rev() {
            list.swap(i, (self.bits() % (i as u64 + 1)) as usize);
        }
    }
}
