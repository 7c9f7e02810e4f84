//! Lines of programs in G-code: within the length that the controller takes, in its characters.

use terrace_core::machine::Machine;

/// Longest line with GRBL, whose buffer holds 80 characters at most, 70 on small boards.
pub(crate) const MOST_OF_GRBL: usize = 70;

/// An axis, and where it is sent to, nm or millionths of a degree.
pub(crate) type Word = (char, i64);

/// The zero of positions, in the heads of the two dialects.
pub(crate) const LINUXCNC_ZERO: &str =
    "positions are machine positions: any offset of G54, G92 or rotation ends the program";
pub(crate) const M0_ZERO: &str = "positions are from the zero of G54, which must be the zero of the table frame";

/// Parameters of LinuxCNC that are 0 where no offset is active, and what it is: G92; G54 by axis; its rotation.
pub(crate) const OFFSETS: [(u32, &str); 5] = [
    (5210, "G92 is active"),
    (5221, "G54 has an offset in X"),
    (5222, "G54 has an offset in Y"),
    (5223, "G54 has an offset in Z"),
    (5230, "G54 is rotated"),
];

/// The parameter of the first rotary axis, A; those of B and C follow.
const FIRST_ROTARY: u32 = 5224;

/// A program as it grows.
pub(crate) struct Lines {
    /// What is written.
    pub(crate) out: Vec<u8>,
    /// Longest line, in characters.
    longest: usize,
}

impl Lines {
    pub(crate) fn new(longest: usize) -> Self {
        Self { out: Vec::new(), longest }
    }

    pub(crate) fn line(&mut self, text: &str) {
        debug_assert!(text.len() <= self.longest, "{text:?} is longer than {}", self.longest);
        self.out.extend_from_slice(text.as_bytes());
        self.out.push(b'\n');
    }

    /// A comment, on as many lines as it needs; each begins with a word of ours.
    pub(crate) fn comment(&mut self, text: &str) {
        let clean = super::plain(text);
        let mut rest = clean.trim();
        let mut begin = "";
        while !rest.is_empty() {
            let room = self.longest - "()".len() - begin.len();
            let cut = if rest.len() <= room { rest.len() } else { rest[..room].rfind(' ').unwrap_or(room) };
            let (now, later) = rest.split_at(cut);
            self.line(&format!("({begin}{})", now.trim_end()));
            (rest, begin) = (later.trim_start(), super::FURTHER);
        }
    }

    /// A line of a word of G and words of axes.
    pub(crate) fn go(&mut self, code: &str, words: &[Word], more: &str) {
        self.out.extend_from_slice(code.as_bytes());
        self.words(words);
        self.out.extend_from_slice(more.as_bytes());
        self.out.push(b'\n');
    }

    pub(crate) fn words(&mut self, words: &[Word]) {
        for &(axis, nm) in words {
            self.out.extend_from_slice(&[b' ', axis as u8]);
            super::push_mm(&mut self.out, nm);
        }
    }

    /// What ends a program of LinuxCNC where an offset is active: G54 takes the place of other work offsets and G49 of a
    /// tool length, so that G54 itself and G92 are left to test. o-numbers, which are unique in a program, from `first`.
    pub(crate) fn offsets_end(&mut self, machine: &Machine, first: usize) {
        // A, B and C follow each other in the alphabet and in the parameters.
        let rotary = letters(machine).into_iter().flatten().map(|letter| {
            let parameter = FIRST_ROTARY + (u32::from(letter) - u32::from('A'));
            (parameter, format!("G54 has an offset in {letter}"))
        });
        let offsets = OFFSETS.iter().map(|&(parameter, what)| (parameter, what.to_owned())).chain(rotary);
        for (number, (parameter, what)) in (first..).zip(offsets) {
            self.line(&format!("o{number} if [#{parameter} NE 0]"));
            self.line(&format!("(MSG, {what})"));
            self.line("M2");
            self.line(&format!("o{number} endif"));
        }
    }
}

/// Letters of the tilt axes; None where there are none.
pub(crate) fn letters(machine: &Machine) -> Option<[char; 2]> {
    machine.tilt.as_ref().map(|tilt| tilt.axes.each_ref().map(|axis| axis.letter.char()))
}
