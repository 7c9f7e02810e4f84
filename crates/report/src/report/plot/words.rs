//! How wide words are, and how they are made to fit.
//!
//! Nothing here knows the face that a viewer takes. Widths are those of DejaVu Sans, the widest of the faces
//! that charts name, rounded up by class of character; in Arial the same words are a tenth narrower.

/// How much wider bold text is.
pub(crate) const BOLD: f64 = 1.12;

/// Width of a text in a size of font.
pub fn width(text: &str, font: f64) -> f64 {
    text.chars().map(em).sum::<f64>() * font
}

/// Width of a text in bold.
pub(crate) fn bold_width(text: &str, font: f64) -> f64 {
    BOLD * width(text, font)
}

/// Width of a character, in sizes of the font.
fn em(c: char) -> f64 {
    match c {
        'i' | 'j' | 'l' | 'I' | '.' | ',' | ':' | ';' | '\'' | '|' | ' ' => 0.35,
        'f' | 't' | 'r' | '(' | ')' | '[' | ']' | '/' | '\\' | '-' | '!' | 'J' | '"' => 0.47,
        'm' | 'M' | 'W' | '%' | '@' | '…' => 1.01,
        'w' | 'A'..='Z' | '^' | '+' | '=' | '<' | '>' | '~' | '&' | '#' | '×' | '±' => 0.86,
        '⁰'..='⁹' | '¹' | '²' | '³' | '⁻' | '°' => 0.53,
        ' '..='~' | 'µ' | 'μ' => 0.65,
        '\u{80}'..='\u{24ff}' => 1.1,
        // Other scripts.
        _ => 1.15,
    }
}

/// The text, cut to a width; what is cut ends in "…".
pub fn fitted(text: &str, font: f64, limit: f64) -> String {
    if width(text, font) <= limit {
        return text.to_owned();
    }
    let mut used = width("…", font);
    let mut out = String::new();
    for c in text.chars() {
        used += em(c) * font;
        if used > limit {
            break;
        }
        out.push(c);
    }
    out.truncate(out.trim_end().len());
    out + "…"
}

/// The text as lines of at most a width, broken at spaces; a longer word is cut.
pub fn lines(text: &str, font: f64, limit: f64) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split_whitespace() {
        let word = fitted(word, font, limit);
        match lines.last_mut() {
            Some(line) if width(&format!("{line} {word}"), font) <= limit => {
                line.push(' ');
                line.push_str(&word);
            }
            _ => lines.push(word),
        }
    }
    lines
}
