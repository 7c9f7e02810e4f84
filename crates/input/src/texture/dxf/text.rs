//! Whether a text shows anything.

use super::record::Record;
use super::tags::Tag;

/// Whether nothing is seen of a text: it is empty, or of blanks and of codes that show nothing.
pub(super) fn is_blank(r: &Record<'_, '_>) -> bool {
    let text = |codes: &[i32]| r.tags.iter().filter(|t| codes.contains(&t.code)).map(Tag::text).collect::<String>();
    match r.kind {
        b"TEXT" | b"ATTRIB" => text(&[1]).trim().is_empty(),
        b"MTEXT" => is_blank_mtext(&text(&[3, 1])),
        _ => false,
    }
}

/// Codes of MTEXT begin with a backslash. Those of lines over, under and through the text may show, and so does what is
/// not known.
fn is_blank_mtext(text: &str) -> bool {
    let mut rest = text.chars();
    while let Some(c) = rest.next() {
        match c {
            '{' | '}' => {}
            '\\' => match rest.next() {
                // Ends of paragraphs and columns, and a blank that joins words.
                Some('P' | 'N' | '~') => {}
                // Alignment, colour, font, height, paragraph, slant, spacing and width, up to a semicolon.
                Some('A' | 'C' | 'c' | 'F' | 'f' | 'H' | 'p' | 'Q' | 'T' | 'W') => {
                    rest.by_ref().find(|&c| c == ';');
                }
                _ => return false,
            },
            c if c.is_whitespace() => {}
            _ => return false,
        }
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_without_letters_are_blank() {
        for text in ["", " ", "\\P", "{\\fArial|b0|i0;\\H2.5; \\~}", "\\A1;\\pxqc;", "\u{a0}\t"] {
            assert!(is_blank_mtext(text), "{text:?}");
        }
        for text in [".", "\\A1;x", "\\S1/2;", "\\L \\l", "\\\\", "\\{", "\\U+00B0", "{\\fArial;a}", "%%d"] {
            assert!(!is_blank_mtext(text), "{text:?}");
        }
    }
}
