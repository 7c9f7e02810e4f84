//! How the rows of a file are laid out.

use super::super::lines::{NoNumber, no_number, number};
use super::columns::{Separator, fields, unquoted};
use super::names;
use terrace_core::diag::{Diag, Place};

/// How the rows of a file are laid out, as its first row shows.
pub(super) struct Layout {
    separator: Separator,
    pub(super) columns: usize,
    /// The last column of the first row is empty: a separator behind the last one.
    may_lack_last: bool,
    /// Columns of x, y and z.
    pub(super) xyz: [usize; 3],
}

impl Layout {
    /// The layout that the first row of numbers has.
    pub(super) fn of(line: &[u8], stated: Option<Separator>) -> Result<Self, Diag> {
        let separator = stated.unwrap_or_else(|| Separator::of(line));
        let columns = fields(line, separator).count();
        let may_lack_last = fields(line, separator).last().is_some_and(<[u8]>::is_empty);
        if columns < 3 {
            let text = format!("a point has three numbers, this row has {columns} columns");
            return Err(Diag::input("points-columns", text).hint("export the cloud as rows of x y z"));
        }
        Ok(Self { separator, columns, may_lack_last, xyz: [0, 1, 2] })
    }

    /// The columns that a row of names gives.
    pub(super) fn named_by_row(&self, line: &[u8]) -> Result<names::NamedColumns, Diag> {
        let mut named = names::of_row(line, self.separator, self.columns)?;
        if named.is_none() && self.may_lack_last {
            named = names::of_row(line, self.separator, self.columns - 1)?;
        }
        named.ok_or_else(|| {
            let count = fields(line, Separator::of(line)).count();
            let text = format!("this row has {} columns, the first one has {count}", self.columns);
            Diag::input("points-columns", text).hint(SAME_COLUMNS)
        })
    }

    /// The columns that a comment gives.
    pub(super) fn named_by_comment(&self, line: &[u8]) -> Result<Option<names::NamedColumns>, Diag> {
        names::of_comment(line, self.separator, self.columns)
    }

    /// The point of a row in file units; what is not finite becomes NaN.
    pub(super) fn row(&self, line: &[u8]) -> Result<[f64; 3], Diag> {
        let mut p = [0.0; 3];
        let mut columns = 0;
        let mut is_last_empty = false;
        for field in fields(line, self.separator) {
            if let Some(k) = self.xyz.iter().position(|&c| c == columns) {
                p[k] = match number(unquoted(field)) {
                    Ok(v) => v,
                    Err(NoNumber::NotFinite) => f64::NAN,
                    Err(why) => return Err(self.no_number(field, why)),
                };
            }
            columns += 1;
            is_last_empty = field.is_empty();
        }
        let has_one_more = columns == self.columns + 1 && is_last_empty;
        let has_one_less = columns + 1 == self.columns && self.may_lack_last;
        if columns == self.columns || has_one_more || has_one_less {
            return Ok(p);
        }
        let text = format!("this row has {columns} columns, the first one has {}", self.columns);
        Err(Diag::input("points-columns", text).hint(SAME_COLUMNS))
    }

    /// The first columns of a row, those of x, y and z and one before them.
    pub(super) fn first<'a>(&self, line: &'a [u8]) -> impl Iterator<Item = &'a [u8]> {
        fields(line, self.separator).take(4)
    }

    /// Decimal commas between blanks, "0,5 1,0", leave "5 1" between two commas.
    fn no_number(&self, field: &[u8], why: NoNumber) -> Diag {
        let is_twice = self.separator == Separator::Byte(b',') && field.iter().any(u8::is_ascii_whitespace);
        no_number(field, if is_twice { NoNumber::Comma } else { why }, Place::Nowhere)
    }
}

/// The remedy for rows of another number of columns.
const SAME_COLUMNS: &str = "every row needs the same columns; the file may be cut short";

/// Whether a row before the points is one of names: the first three columns are, or three are and none is a number.
pub(super) fn is_names(line: &[u8], stated: Option<Separator>) -> bool {
    let is_name = |w: &&[u8]| number(unquoted(w)) == Err(NoNumber::Text) && w.iter().any(u8::is_ascii_alphabetic);
    let fields: Vec<&[u8]> = fields(line, stated.unwrap_or_else(|| Separator::of(line))).collect();
    let has_number = || fields.iter().any(|w| !w.is_empty() && number(unquoted(w)) != Err(NoNumber::Text));
    let names = fields.iter().filter(|w| is_name(w)).count();
    names >= 3 && (fields.iter().take(3).all(is_name) || !has_number())
}
