//! Encoded polylines (`PE`): numbers in base 64, or 32 after `7`, low digits first.
//!
//! `<` lifts the pen for one move, `=` makes one absolute, `:` names a pen, `>` the number of binary digits after the
//! point. Moves are relative otherwise, whatever `PA` and `PR` say.

/// What a part of an encoded polyline says.
pub(super) enum EncodedStep {
    Pen(i64),
    Move { by: [f64; 2], is_up: bool, is_absolute: bool },
}

/// Reads the bytes of one; an error says what is wrong with it.
pub(super) struct EncodedSteps<'a> {
    code: &'a [u8],
    at: usize,
    /// Of a digit.
    bits: u32,
    /// Binary digits after the point.
    places: i32,
}

impl<'a> EncodedSteps<'a> {
    pub(super) fn new(code: &'a [u8]) -> Self {
        Self { code, at: 0, bits: 6, places: 0 }
    }

    /// The next step; None at the end.
    pub(super) fn step(&mut self) -> Result<Option<EncodedStep>, &'static str> {
        let mut is_up = false;
        let mut is_absolute = false;
        while let Some(&byte) = self.code.get(self.at) {
            match byte {
                b'7' => self.bits = 5,
                b'<' => is_up = true,
                b'=' => is_absolute = true,
                b'>' => {
                    self.at += 1;
                    self.places = self.number()?.clamp(-26.0, 26.0) as i32;
                    continue;
                }
                b':' => {
                    self.at += 1;
                    return Ok(Some(EncodedStep::Pen(self.number()? as i64)));
                }
                63.. => {
                    let factor = 2f64.powi(-self.places);
                    let by = [self.number()? * factor, self.number()? * factor];
                    return Ok(Some(EncodedStep::Move { by, is_up, is_absolute }));
                }
                _ => {}
            }
            self.at += 1;
        }
        Ok(None)
    }

    /// The next number.
    fn number(&mut self) -> Result<f64, &'static str> {
        let mut value = 0u64;
        let mut shift = 0u32;
        let base = 1u64 << self.bits;
        while let Some(&b) = self.code.get(self.at) {
            self.at += 1;
            // Terminal digits begin at 191 (base 64) or 95 (base 32), others at 63.
            let (digit, is_last) = match (self.bits, b) {
                (6, 191..=254) => (u64::from(b - 191), true),
                (6, 63..=126) | (5, 63..=94) => (u64::from(b - 63), false),
                (5, 95..=126) => (u64::from(b - 95), true),
                _ => continue,
            };
            // Nine digits of 6 bits, one of these the sign, are the 53 bits that f64 holds.
            if shift > 48 {
                return Err("has a number that is too long");
            }
            value += digit * base.pow(shift / self.bits);
            shift += self.bits;
            if is_last {
                // The lowest bit is the sign.
                let half = (value >> 1) as f64;
                return Ok(if value & 1 == 1 { -half } else { half });
            }
        }
        Err("ends within a number")
    }
}
