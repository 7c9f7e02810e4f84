//! The columns of a row, and what separates them.

/// What parts the columns.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Separator {
    Blanks,
    Byte(u8),
}

impl Separator {
    pub(super) fn of(line: &[u8]) -> Self {
        // Tabs part columns only where every column is filled; else they are blanks like others.
        let by_tabs = || line.split(|&b| b == b'\t').map(<[u8]>::trim_ascii);
        if line.contains(&b';') {
            Self::Byte(b';')
        } else if by_tabs().count() > 2 && by_tabs().all(|f| !f.is_empty()) {
            Self::Byte(b'\t')
        } else if line.contains(&b',') {
            Self::Byte(b',')
        } else {
            Self::Blanks
        }
    }

    /// The separator that a row `sep=;` states for spreadsheets.
    pub(super) fn stated(line: &[u8]) -> Option<Self> {
        let line = unquoted(line);
        let (name, rest) = line.split_at_checked(4)?;
        match rest {
            [b' ' | b'\t'] | [] if name.eq_ignore_ascii_case(b"sep=") => Some(Self::Blanks),
            [separator] if name.eq_ignore_ascii_case(b"sep=") => Some(Self::Byte(*separator)),
            _ => None,
        }
    }
}

/// The columns of a row.
pub(super) fn fields(line: &[u8], separator: Separator) -> impl Iterator<Item = &[u8]> {
    line.split(move |&b| match separator {
        Separator::Blanks => b.is_ascii_whitespace(),
        Separator::Byte(s) => b == s,
    })
    .map(<[u8]>::trim_ascii)
    .filter(move |f| separator != Separator::Blanks || !f.is_empty())
}

/// A field without its quotes.
pub(super) fn unquoted(word: &[u8]) -> &[u8] {
    word.strip_prefix(b"\"").and_then(|w| w.strip_suffix(b"\"")).unwrap_or(word)
}
