//! A table of named columns, to be read on a terminal, in a browser, in a spreadsheet or by a program.
//!
//! Consumes columns with unit and kind, and rows of cells that may be missing. Promises the same table as
//! aligned text, Markdown, CSV and JSON. Text and Markdown are rounded to the digits of the column and show
//! what is missing as "-"; CSV and JSON carry values as they are, missing ones empty or null, under keys in
//! snake case with the unit behind: "worst FOD" in um is `worst_fod_um`. Times are s, shares percent.
//!
//! Limits: a character counts as one place of text, so wide scripts do not align.

use std::borrow::Cow;

use serde::ser::{Serialize, SerializeMap, SerializeSeq, Serializer};

use terrace_core::diag;
use terrace_core::duration::duration;

/// Columns of a terminal that a table should not exceed.
pub const TERMINAL: usize = 120;

/// What a column holds, and how it is shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Words, to the left.
    Text,
    /// Whole numbers.
    Count,
    /// Numbers, shown with this many digits after the point.
    Number(u8),
    /// Seconds, shown as people say them.
    Duration,
    /// Percent with one digit. Only what is exactly 0 or 100 is shown as such.
    Share,
}

/// A column.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Column {
    name: String,
    unit: String,
    kind: Kind,
}

impl Column {
    /// Words.
    pub fn text(name: &str) -> Self {
        Self { name: plain_line(name), unit: String::new(), kind: Kind::Text }
    }
    /// Whole numbers.
    pub fn count(name: &str) -> Self {
        Self { kind: Kind::Count, ..Self::text(name) }
    }
    /// Numbers in a unit, which may be empty.
    pub fn number(name: &str, unit: &str, digits: u8) -> Self {
        Self { kind: Kind::Number(digits), unit: plain_line(unit), ..Self::text(name) }
    }
    /// Seconds.
    pub fn time(name: &str) -> Self {
        Self { kind: Kind::Duration, ..Self::text(name) }
    }
    /// Percent.
    pub fn share(name: &str) -> Self {
        Self { kind: Kind::Share, ..Self::text(name) }
    }

    /// The name of the column, one line.
    pub fn name(&self) -> &str {
        &self.name
    }
    /// The unit as the head of the column shows it; empty where the cells say it themselves.
    pub fn unit(&self) -> &str {
        &self.unit
    }
    /// What it holds.
    pub fn kind(&self) -> Kind {
        self.kind
    }
    /// Whether its cells end at the right.
    pub fn is_right(&self) -> bool {
        self.kind != Kind::Text
    }

    /// The key of the column: words and unit in snake case.
    fn key(&self) -> String {
        let unit = match self.kind {
            Kind::Duration => "s",
            Kind::Share => "percent",
            _ => &self.unit,
        };
        let mut out = String::new();
        for c in self.name.chars().chain([' ']).chain(unit.chars()) {
            match c {
                'µ' | 'μ' => out.push('u'),
                '²' => out.push('2'),
                '³' => out.push('3'),
                '°' => out.push_str("deg"),
                '%' => out.push_str("percent"),
                _ if c.is_alphanumeric() => out.extend(c.to_lowercase()),
                _ if !out.is_empty() && !out.ends_with('_') => out.push('_'),
                _ => {}
            }
        }
        out.trim_end_matches('_').to_owned()
    }
}

/// A value of a table, or that there is none.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Cell {
    /// There is no value.
    #[default]
    Missing,
    /// Words.
    Text(String),
    /// A whole number.
    Count(u64),
    /// A finite number.
    Number(f64),
}

impl From<&str> for Cell {
    fn from(v: &str) -> Self {
        Self::Text(v.to_owned())
    }
}
impl From<String> for Cell {
    fn from(v: String) -> Self {
        Self::Text(v)
    }
}
impl From<u64> for Cell {
    fn from(v: u64) -> Self {
        Self::Count(v)
    }
}
impl From<usize> for Cell {
    fn from(v: usize) -> Self {
        Self::Count(v as u64)
    }
}
impl From<f64> for Cell {
    /// What is not finite is missing.
    fn from(v: f64) -> Self {
        if v.is_finite() { Self::Number(v) } else { Self::Missing }
    }
}
impl<T: Into<Cell>> From<Option<T>> for Cell {
    fn from(v: Option<T>) -> Self {
        v.map_or(Self::Missing, Into::into)
    }
}

impl Serialize for Cell {
    fn serialize<S: Serializer>(&self, s: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Missing => s.serialize_none(),
            Self::Text(v) => s.serialize_str(v),
            Self::Count(v) => s.serialize_u64(*v),
            Self::Number(v) => s.serialize_f64(*v),
        }
    }
}

/// A table. Every row has a cell for every column, of the column's kind or missing.
#[derive(Clone, Debug, PartialEq)]
pub struct Table {
    title: String,
    columns: Vec<Column>,
    keys: Vec<String>,
    rows: Vec<Vec<Cell>>,
    /// Of each row whether it is struck out.
    struck: Vec<bool>,
}

impl Table {
    /// An empty table. Where two columns would have the same key, the later one gets a number.
    pub fn new(title: &str, columns: Vec<Column>) -> Self {
        let mut keys: Vec<String> = Vec::with_capacity(columns.len());
        for column in &columns {
            let key = column.key();
            let mut free = key.clone();
            let mut n = 1;
            while keys.contains(&free) {
                n += 1;
                free = format!("{key}_{n}");
            }
            keys.push(free);
        }
        Self { title: plain_line(title), columns, keys, rows: Vec::new(), struck: Vec::new() }
    }

    /// Adds a row.
    ///
    /// # Panics
    /// Where the row does not have one cell for every column, or a cell that its column cannot hold.
    pub fn row<const N: usize>(&mut self, cells: [Cell; N]) {
        self.push(cells.into());
    }

    /// Adds a row whose length is not known when the program is written.
    ///
    /// # Panics
    /// As [`Table::row`].
    pub fn push(&mut self, cells: Vec<Cell>) {
        assert_eq!(cells.len(), self.columns.len(), "a row has a cell for every column");
        for (cell, column) in cells.iter().zip(&self.columns) {
            let fits = match cell {
                Cell::Missing => true,
                Cell::Text(_) => column.kind == Kind::Text,
                Cell::Count(_) => column.kind != Kind::Text,
                Cell::Number(v) => v.is_finite() && !matches!(column.kind, Kind::Text | Kind::Count),
            };
            assert!(fits, "{} cannot hold {cell:?}", column.name);
        }
        self.rows.push(cells);
        self.struck.push(false);
    }

    /// Adds a row that must not be used, struck out in Markdown and HTML but for its last cell, which says why.
    ///
    /// # Panics
    /// As [`Table::row`].
    pub fn push_struck(&mut self, cells: Vec<Cell>) {
        self.push(cells);
        self.struck.pop();
        self.struck.push(true);
    }

    /// Whether a cell is struck out.
    pub fn is_struck(&self, row: usize, column: usize) -> bool {
        self.struck[row] && column + 1 < self.columns.len()
    }

    /// The title of the table, one line.
    pub fn title(&self) -> &str {
        &self.title
    }
    /// The columns of the table.
    pub fn columns(&self) -> &[Column] {
        &self.columns
    }
    /// Keys of the columns in JSON and CSV.
    pub fn keys(&self) -> &[String] {
        &self.keys
    }
    /// The rows of the table.
    pub fn rows(&self) -> &[Vec<Cell>] {
        &self.rows
    }

    /// A cell as it is read by people.
    pub fn shown(&self, row: usize, column: usize) -> Cow<'_, str> {
        shown(&self.rows[row][column], self.columns[column].kind)
    }

    /// Aligned text, at most `width` characters wide where a column next to the first allows it: what does not fit
    /// follows below with the first column repeated. Names and words that are long are wrapped, and more narrowly where
    /// all columns fit side by side then.
    pub fn text(&self, width: usize) -> String {
        let fits = |words: &usize| blocks(&self.wrapped(*words).widths, width).len() == 1;
        let words = WORDS.into_iter().find(fits).unwrap_or(WORDS[0]);
        let Wrapped { cells, heads, widths } = self.wrapped(words);
        let mut out = if self.title.is_empty() { String::new() } else { format!("{}\n\n", self.title) };
        for (k, block) in blocks(&widths, width).iter().enumerate() {
            if k > 0 {
                out.push('\n');
            }
            self.line(&mut out, block, &widths, &heads, CellAlign::Foot);
            let rule: Vec<String> = block.iter().map(|&c| "-".repeat(widths[c])).collect();
            out += &rule.join(GAP);
            out.push('\n');
            cells.iter().for_each(|row| self.line(&mut out, block, &widths, row, CellAlign::Top));
        }
        out
    }

    /// All cells and heads in lines, those of words no wider than `words`.
    fn wrapped(&self, words: usize) -> Wrapped {
        let cells: Vec<Vec<Vec<String>>> = (0..self.rows.len())
            .map(|r| (0..self.columns.len()).map(|c| wrap(&self.shown(r, c), words)).collect())
            .collect();
        let heads: Vec<Vec<String>> =
            (0..self.columns.len()).map(|c| self.head(c, cells.iter().map(|row| &row[c]))).collect();
        let widths: Vec<usize> = (0..self.columns.len())
            .map(|c| widest(heads[c].iter().chain(cells.iter().flat_map(|row| &row[c]))))
            .collect();
        Wrapped { cells, heads, widths }
    }

    /// The head of a column: its name as narrow as the cells allow, and below it the unit.
    fn head<'a>(&'a self, c: usize, cells: impl Iterator<Item = &'a Vec<String>>) -> Vec<String> {
        let column = &self.columns[c];
        let narrow = cells.flatten().chain([&column.unit]).map(|l| length(l)).max().unwrap_or(0);
        let longest = column.name.split(' ').map(length).max().unwrap_or(0).min(WORDS[0]);
        let mut lines = wrap(&column.name, narrow.max(longest).max(1));
        if !column.unit.is_empty() {
            lines.push(column.unit.clone());
        }
        lines
    }

    /// A row of wrapped cells.
    fn line(&self, out: &mut String, block: &[usize], widths: &[usize], cells: &[Vec<String>], align: CellAlign) {
        let high = block.iter().map(|&c| cells[c].len()).max().unwrap_or(0);
        for k in 0..high {
            let parts: Vec<String> = block
                .iter()
                .map(|&c| {
                    let above = match align {
                        CellAlign::Top => 0,
                        CellAlign::Foot => high - cells[c].len(),
                    };
                    let part = k.checked_sub(above).and_then(|k| cells[c].get(k)).map_or("", String::as_str);
                    let air = " ".repeat(widths[c] - length(part));
                    if self.columns[c].is_right() { air + part } else { part.to_owned() + &air }
                })
                .collect();
            out.push_str(parts.join(GAP).trim_end());
            out.push('\n');
        }
    }

    /// A table of GitHub's Markdown, title first.
    pub fn markdown(&self) -> String {
        let mut out = if self.title.is_empty() { String::new() } else { format!("**{}**\n\n", escaped(&self.title)) };
        let names = self.columns.iter().map(|c| match c.unit.as_str() {
            "" => escaped(&c.name),
            unit => escaped(&format!("{}, {unit}", c.name)),
        });
        out += &markdown_line(names);
        out += &markdown_line(self.columns.iter().map(|c| if c.is_right() { "---:" } else { "---" }.into()));
        for r in 0..self.rows.len() {
            out += &markdown_line((0..self.columns.len()).map(|c| self.markdown_cell(r, c)));
        }
        out
    }

    /// A cell of Markdown.
    fn markdown_cell(&self, r: usize, c: usize) -> String {
        let text = escaped(&self.shown(r, c));
        if self.is_struck(r, c) && !text.is_empty() { format!("~~{text}~~") } else { text }
    }

    /// Comma separated, point as decimal mark, keys in the first line, quoted as RFC 4180 says.
    pub fn csv(&self) -> String {
        let keys: Vec<String> = self.keys.iter().map(|k| csv_cell(k)).collect();
        let mut out = keys.join(",") + "\n";
        for row in &self.rows {
            out += &row.iter().map(csv_value).collect::<Vec<_>>().join(",");
            out.push('\n');
        }
        out
    }

    /// An array of objects with a line feed at the end.
    pub fn json(&self) -> String {
        serde_json::to_string_pretty(self).expect("keys are text and numbers are finite") + "\n"
    }
}

impl Serialize for Table {
    fn serialize<S: Serializer>(&self, s: S) -> Result<S::Ok, S::Error> {
        let mut list = s.serialize_seq(Some(self.rows.len()))?;
        for row in &self.rows {
            list.serialize_element(&Row { keys: &self.keys, cells: row })?;
        }
        list.end()
    }
}

/// A row under its keys.
struct Row<'a> {
    keys: &'a [String],
    cells: &'a [Cell],
}

impl Serialize for Row<'_> {
    fn serialize<S: Serializer>(&self, s: S) -> Result<S::Ok, S::Error> {
        let mut map = s.serialize_map(Some(self.keys.len()))?;
        for (key, cell) in self.keys.iter().zip(self.cells) {
            map.serialize_entry(key, cell)?;
        }
        map.end()
    }
}

/// Between two columns of text.
const GAP: &str = "  ";
/// Widths to which words of a cell are wrapped, the usual one first.
const WORDS: [usize; 3] = [40, 32, 24];

/// A table in lines: cells by row and column, heads and widths by column.
struct Wrapped {
    cells: Vec<Vec<Vec<String>>>,
    heads: Vec<Vec<String>>,
    widths: Vec<usize>,
}

fn shown(cell: &Cell, kind: Kind) -> Cow<'_, str> {
    let value = match cell {
        Cell::Missing => return "-".into(),
        Cell::Text(v) => return plain_line(v).into(),
        Cell::Count(v) if matches!(kind, Kind::Count | Kind::Text) => return v.to_string().into(),
        Cell::Count(v) => *v as f64,
        Cell::Number(v) => *v,
    };
    match kind {
        Kind::Duration => duration(value),
        Kind::Share => share(value),
        // So long a number says nothing.
        Kind::Number(digits) if value.abs() >= 1e15 => format!("{value:.0$e}", usize::from(digits)),
        Kind::Number(digits) => plain(value, usize::from(digits)),
        Kind::Text | Kind::Count => value.to_string(),
    }
    .into()
}

/// A share that is nearly all is not all.
pub(super) fn share(percent: f64) -> String {
    match plain(percent, 1) {
        text if text == "100.0" && percent < 100.0 => "> 99.9 %".into(),
        text if text == "0.0" && percent > 0.0 => "< 0.1 %".into(),
        text => format!("{text} %"),
    }
}

/// A number in text, `decimals` digits, without a negative zero.
pub fn plain(v: f64, decimals: usize) -> String {
    let text = format!("{v:.decimals$}");
    let zero = text.bytes().all(|b| matches!(b, b'-' | b'0' | b'.'));
    if zero { text.trim_start_matches('-').to_owned() } else { text }
}

/// Where cells stand that have fewer lines than others of their row.
#[derive(Clone, Copy)]
enum CellAlign {
    /// As cells do.
    Top,
    /// As heads do, next to the cells below them.
    Foot,
}

/// A line of Markdown.
fn markdown_line(cells: impl Iterator<Item = String>) -> String {
    format!("| {} |\n", cells.collect::<Vec<_>>().join(" | "))
}

/// A cell of CSV: numbers as they are, texts quoted where they must be.
fn csv_value(cell: &Cell) -> String {
    match cell {
        Cell::Missing => String::new(),
        Cell::Text(v) => csv_cell(v),
        Cell::Count(v) => v.to_string(),
        Cell::Number(v) => v.to_string(),
    }
}

/// A cell of CSV whose text may hold what separates cells, or begin with what a spreadsheet takes for a formula: such a
/// text gets an apostrophe in front. Numbers stay as they are.
pub(super) fn csv_cell(text: &str) -> String {
    let is_formula = text.starts_with(['=', '+', '-', '@', '\t', '\r']) && text.parse::<f64>().is_err();
    let text = if is_formula { &format!("'{text}") } else { text };
    if text.contains(['"', ',', '\n', '\r']) { format!("\"{}\"", text.replace('"', "\"\"")) } else { text.into() }
}

/// Text in one line: what controls a terminal or turns the order of others, tabs and line feeds included, becomes a
/// space.
fn plain_line(text: &str) -> String {
    text.chars()
        .map(|c| if c.is_control() || diag::is_active(c) { ' ' } else { c })
        .collect::<String>()
        .trim()
        .to_owned()
}

/// Text that Markdown shows as it is.
fn escaped(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        if matches!(c, '\\' | '|' | '`' | '*' | '_' | '<' | '[' | '&' | '~') {
            out.push('\\');
        }
        out.push(c);
    }
    out
}

fn length(text: &str) -> usize {
    text.chars().count()
}

fn widest<'a>(lines: impl Iterator<Item = &'a String>) -> usize {
    lines.map(|l| length(l)).max().unwrap_or(0)
}

/// Lines of at most `width` characters, broken at spaces, or inside words that are longer; at least one.
fn wrap(text: &str, width: usize) -> Vec<String> {
    let mut lines = vec![String::new()];
    for word in text.split(' ').filter(|w| !w.is_empty()) {
        let mut rest: Vec<char> = word.chars().collect();
        loop {
            let line = lines.last_mut().expect("there is always a line");
            let used = length(line);
            let gap = usize::from(used > 0);
            if used + gap + rest.len() <= width {
                line.extend([' '].iter().take(gap).chain(&rest));
                break;
            }
            if used > 0 {
                lines.push(String::new());
            } else {
                line.extend(rest.drain(..width));
            }
        }
    }
    lines
}

/// Columns side by side that fit the width, the first in every block.
fn blocks(widths: &[usize], width: usize) -> Vec<Vec<usize>> {
    let mut out: Vec<Vec<usize>> = Vec::new();
    let mut used = 0;
    for (c, wide) in widths.iter().enumerate() {
        let more = GAP.len() + wide;
        match out.last_mut() {
            Some(block) if used + more <= width || block.len() < 2 => {
                block.push(c);
                used += more;
            }
            Some(_) => {
                out.push(vec![0, c]);
                used = widths[0] + more;
            }
            None => {
                out.push(vec![c]);
                used = *wide;
            }
        }
    }
    out
}

#[cfg(test)]
mod tests;
