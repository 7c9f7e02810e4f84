//! The instructions of a plot: two letters, then numbers, a label or an encoded polyline.

const ETX: u8 = 3;
const ESC: u8 = 27;

/// A mnemonic of two letters, what follows it, and where it stands.
pub(super) struct Instruction {
    pub(super) name: String,
    pub(super) values: Vec<f64>,
    /// The place of the instruction's first byte, from 0.
    pub(super) at: usize,
    /// The bytes of an encoded polyline.
    pub(super) code: Vec<u8>,
}

/// Reads the bytes of a plot instruction by instruction.
pub(super) struct Instructions<'a> {
    bytes: &'a [u8],
    pos: usize,
    /// What ends a label (`DT`).
    end_of_label: u8,
}

impl<'a> Instructions<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, pos: 0, end_of_label: ETX }
    }

    fn byte(&mut self) -> Option<u8> {
        let byte = *self.bytes.get(self.pos)?;
        self.pos += 1;
        Some(byte)
    }

    fn peek(&self) -> Option<u8> {
        self.bytes.get(self.pos).copied()
    }

    /// Leaves a device control out: `ESC . letter numbers :`, or `ESC` up to a capital.
    fn escape(&mut self) {
        if self.peek() == Some(b'.') {
            self.pos += 2;
            while self.peek().is_some_and(|b| b.is_ascii_digit() || b == b';') {
                self.pos += 1;
            }
            self.pos += usize::from(self.peek() == Some(b':'));
            return;
        }
        while self.byte().is_some_and(|b| !b.is_ascii_uppercase()) {}
    }

    /// Reads what follows the name of an instruction.
    fn values(&mut self, instruction: &mut Instruction) {
        let is_end = |b: u8| b == b';' || b == ESC;
        match instruction.name.as_str() {
            "LB" | "BL" => while self.byte().is_some_and(|b| b != self.end_of_label) {},
            "DT" => self.end_of_label = self.byte().filter(|&b| b != b';').unwrap_or(ETX),
            "CO" | "SM" | "UC" => while self.byte().is_some_and(|b| !is_end(b)) {},
            "PE" => {
                while let Some(b) = self.byte().filter(|&b| !is_end(b)) {
                    instruction.code.push(b);
                }
            }
            _ => {
                while let Some(b) = self.peek().filter(|b| !b.is_ascii_alphabetic() && !is_end(*b)) {
                    if !(b.is_ascii_digit() || b"+-.".contains(&b)) {
                        self.pos += 1;
                        continue;
                    }
                    let rest = &self.bytes[self.pos..];
                    let is_number =
                        |(i, b): (usize, &u8)| b.is_ascii_digit() || *b == b'.' || (i == 0 && b"+-".contains(b));
                    let len = rest.iter().enumerate().position(|ib| !is_number(ib)).unwrap_or(rest.len());
                    self.pos += len.max(1);
                    let text = std::str::from_utf8(&rest[..len]).unwrap_or_default();
                    // What is not a number stays one that every use refuses.
                    instruction.values.push(text.parse().unwrap_or(f64::NAN));
                }
            }
        }
        if matches!(instruction.name.as_str(), "IN" | "DF") {
            self.end_of_label = ETX;
        }
    }
}

impl Iterator for Instructions<'_> {
    type Item = Instruction;

    /// The next instruction; bytes that belong to none are left out.
    fn next(&mut self) -> Option<Instruction> {
        loop {
            let at = self.pos;
            match self.byte()? {
                ESC => self.escape(),
                a if a.is_ascii_alphabetic() => {
                    let Some(b) = self.peek().filter(u8::is_ascii_alphabetic) else { continue };
                    self.pos += 1;
                    let name: String = [a, b].map(|c| char::from(c.to_ascii_uppercase())).iter().collect();
                    let mut instruction = Instruction { name, values: Vec::new(), at, code: Vec::new() };
                    self.values(&mut instruction);
                    return Some(instruction);
                }
                _ => {}
            }
        }
    }
}
