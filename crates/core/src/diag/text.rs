//! Text that must be UTF-8, and what else it looks like.

use std::fmt;

use super::{Diag, Place};

/// Bytes that are not text in UTF-8.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NotUtf8 {
    looks_like: Encoding,
    /// The line, from 1, that shows it first; None where every line does.
    line: Option<usize>,
}

/// What text is written in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Encoding {
    Utf16,
    Utf32,
    /// Text in one of the encodings of a byte a character, with the first character beyond ASCII as Latin-1 has it.
    Latin1(char),
    Binary,
}

/// The text of UTF-8 bytes. A byte order mark stays.
///
/// # Errors
/// What the bytes look like.
pub fn utf8(bytes: Vec<u8>) -> Result<String, NotUtf8> {
    if let Some(encoding) = by_zeros(&bytes) {
        return Err(NotUtf8 { looks_like: encoding, line: None });
    }
    String::from_utf8(bytes).map_err(|e| {
        let (at, bytes) = (e.utf8_error().valid_up_to(), e.as_bytes());
        // Windows and Latin-1 differ in 0x80 to 0x9f alone, which are rare characters in the one and none in the other.
        let is_text = |b: &u8| !b.is_ascii_control() || b.is_ascii_whitespace();
        if !bytes.iter().all(is_text) {
            return NotUtf8 { looks_like: Encoding::Binary, line: None };
        }
        let line = bytes[..at].iter().filter(|&&b| b == b'\n').count() + 1;
        NotUtf8 { looks_like: Encoding::Latin1(char::from(bytes[at])), line: Some(line) }
    })
}

/// What bytes are by their byte order mark, or by the zeros that text has none of.
fn by_zeros(bytes: &[u8]) -> Option<Encoding> {
    if bytes.starts_with(&[0xff, 0xfe, 0, 0]) || bytes.starts_with(&[0, 0, 0xfe, 0xff]) {
        return Some(Encoding::Utf32);
    }
    if bytes.starts_with(&[0xff, 0xfe]) || bytes.starts_with(&[0xfe, 0xff]) {
        return Some(Encoding::Utf16);
    }
    if !bytes.contains(&0) {
        return None;
    }
    // In UTF-16 text of Latin letters every other byte is zero.
    let zeros = |first: usize| bytes.iter().skip(first).step_by(2).filter(|&&b| b == 0).count();
    let [even, odd] = [zeros(0), zeros(1)];
    let is_utf16 = even.min(odd) == 0 && 4 * even.max(odd) > bytes.len();
    Some(if is_utf16 { Encoding::Utf16 } else { Encoding::Binary })
}

impl fmt::Display for NotUtf8 {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.looks_like {
            Encoding::Utf16 => f.write_str("not UTF-8 text: it is UTF-16"),
            Encoding::Utf32 => f.write_str("not UTF-8 text: it is UTF-32"),
            Encoding::Latin1(c) => {
                write!(f, "not UTF-8 text: it looks like Latin-1 (Windows-1252), where byte 0x{:02x}", u32::from(c))?;
                // What is a control character in Latin-1 is not shown.
                if c.is_control() { f.write_str(" is a sign") } else { write!(f, " is {c:?}") }
            }
            Encoding::Binary => f.write_str("not text"),
        }
    }
}

impl NotUtf8 {
    /// A message about it, at its line of the file at `path`, with how the file is saved as UTF-8.
    pub fn at(&self, d: Diag, path: impl Into<String>) -> Diag {
        let hint = match self.looks_like {
            Encoding::Utf16 => {
                "save it as UTF-8; Windows PowerShell writes UTF-16 with `>`: let terrace write the file with -o FILE, or \
                 pipe to `Out-File -Encoding utf8`"
            }
            Encoding::Utf32 => "save it as UTF-8 in your editor",
            Encoding::Latin1(_) => {
                "save it as UTF-8 in your editor, or convert it: iconv -f WINDOWS-1252 -t UTF-8 OLD > NEW"
            }
            Encoding::Binary => "check that it is the file you mean",
        };
        d.at(Place::File { path: path.into(), line: self.line }).hint(hint)
    }
}

/// A word of a command as a shell reads it: quoted where it holds anything that a shell acts on.
pub fn shell_word(text: &str) -> String {
    let is_plain = |c: char| c.is_alphanumeric() || matches!(c, '_' | '-' | '.' | '/' | ':' | '+' | ',' | '@' | '%');
    if cfg!(windows) {
        // Names hold no quotes there, and a backslash is plain.
        let is_plain = |c: char| is_plain(c) || matches!(c, '\\' | '~');
        return if !text.is_empty() && text.chars().all(is_plain) { text.into() } else { format!("\"{text}\"") };
    }
    if !text.is_empty() && text.chars().all(is_plain) {
        return text.into();
    }
    // Within single quotes a POSIX shell acts on nothing; the quote itself stands outside of them.
    format!("'{}'", text.replace('\'', "'\\''"))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What is said of bytes, and its line.
    fn refusal(bytes: &[u8]) -> (String, Option<usize>) {
        let e = utf8(bytes.to_vec()).expect_err("not UTF-8");
        (e.to_string(), e.line)
    }

    #[test]
    fn utf8_is_taken_with_and_without_a_byte_order_mark() {
        for text in ["", "a = 1\n", "\u{feff}a = 1", "spot = \"20 \u{b5}m\" # \u{20ac}\n"] {
            assert_eq!(utf8(text.as_bytes().to_vec()).as_deref(), Ok(text));
        }
    }

    #[test]
    fn utf16_and_utf32_are_recognised_by_mark_or_zeros() {
        let text = "[surface]\nfile = \"a.stl\"\n";
        let [little, big]: [Vec<u8>; 2] = [
            text.encode_utf16().flat_map(u16::to_le_bytes).collect(),
            text.encode_utf16().flat_map(u16::to_be_bytes).collect(),
        ];
        for bytes in [[&[0xff, 0xfe], &little[..]].concat(), little, [&[0xfe, 0xff], &big[..]].concat(), big] {
            assert_eq!(refusal(&bytes), ("not UTF-8 text: it is UTF-16".into(), None));
        }
        let wide: Vec<u8> =
            std::iter::once('\u{feff}').chain(text.chars()).flat_map(|c| u32::from(c).to_le_bytes()).collect();
        assert_eq!(refusal(&wide).0, "not UTF-8 text: it is UTF-32");
    }

    #[test]
    fn latin1_is_reported_with_its_line_and_character() {
        let (text, line) = refusal(b"a = 1\nspot = \"20 \xb5m\"\nb = \"\xe4\"\n");
        assert_eq!(line, Some(2));
        assert!(text.ends_with("where byte 0xb5 is '\u{b5}'"), "{text}");
        // The quotes of Windows-1252.
        assert!(refusal(b"a = \x93x\x94").0.ends_with("where byte 0x93 is a sign"));
    }

    #[test]
    fn binary_files_are_not_called_text() {
        for bytes in [
            &b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR\0\0\x04\0"[..],
            b"solid\0\0\0\0\0\x01\xff\x80",
            b"\xff\xd8\xff\xe0\x10JFIF",
        ] {
            assert_eq!(refusal(bytes).0, "not text", "{bytes:?}");
        }
    }

    #[cfg(unix)]
    #[test]
    fn a_shell_reads_its_word_as_it_was() {
        for text in ["hood.job", "/home/o'brien/a b", "$HOME `id` \"x\" \\ ;&|", "", "\u{e4}rger", "a\nb", "''"] {
            let line = format!("printf %s {}", shell_word(text));
            let out = std::process::Command::new("sh").args(["-c", &line]).output().expect("a shell");
            assert_eq!(String::from_utf8_lossy(&out.stdout), text, "{line}");
        }
        assert_eq!(shell_word("try/hood.job"), "try/hood.job");
    }
}
