//! What goes wrong, with its place and its remedy.
//!
//! Each diagnostic is one of: warning, input error, machine limit, internal bug. It is one sentence with a stable code
//! (listed in `docs/reference/errors.md`), a place and a hint that says what to change. Nothing here prints: the
//! command line renders diagnostics, JSON writes them as objects.

mod did_you_mean;
mod exit_code;
pub mod memory;
mod message;
mod shape;
pub mod stand_in;
mod syntax;
mod text;

use std::fmt;
use std::ops::Range;
use std::path::Path;
use std::sync::Arc;

pub use did_you_mean::edits;
use did_you_mean::meant;
pub use message::{Failure, Fault, Message, Severity};
#[cfg(any(test, feature = "test-support"))]
pub use shape::lists_all_of;
pub use shape::{TableKey, has_keys, table_faults};
pub use text::{NotUtf8, shell_word, utf8};

use annotate_snippets::{AnnotationKind, Level, Renderer, Snippet};
use serde::de::DeserializeOwned;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// Severity, which also decides the exit code.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Worth knowing; the command continues.
    Warning,
    /// The input is at fault (exit code 2).
    Input,
    /// The machine or a rule cannot hold what is asked (exit code 1).
    Limit,
    /// An invariant of this program broke (exit code 3).
    Bug,
}

/// Where something is wrong.
#[derive(Clone, Debug, PartialEq, Default)]
pub enum Place {
    /// Nowhere in particular.
    #[default]
    Nowhere,
    /// A file as a whole, or one of its lines (counted from 1).
    File {
        /// The path as the user typed it.
        path: String,
        /// Counted from 1.
        line: Option<usize>,
    },
    /// A stretch of a text file that is shown with a caret.
    Text {
        /// The path as the user typed it.
        path: String,
        /// The whole text.
        source: Arc<str>,
        /// Bytes of the text.
        span: Range<usize>,
    },
    /// A facet of a surface file, counted from 0 in file order.
    Facet {
        /// The path as the user typed it.
        path: String,
        /// Number of the facet.
        facet: usize,
    },
    /// An element of a drawing, by id or by its number.
    Element {
        /// The path as the user typed it.
        path: String,
        /// Id or number of the element.
        element: String,
    },
    /// A point on the part, in mm in the part frame.
    Part {
        /// x, mm.
        x_mm: f64,
        /// y, mm.
        y_mm: f64,
    },
    /// A block of the program, by id.
    Block(String),
}

impl Place {
    /// The file at `path` as a whole.
    pub fn file(path: impl Into<String>) -> Self {
        Self::File { path: path.into(), line: None }
    }

    /// Line `line` (from 1) of the file at `path`.
    pub fn line(path: impl Into<String>, line: usize) -> Self {
        Self::File { path: path.into(), line: Some(line) }
    }
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Nowhere => Ok(()),
            Self::File { path, line: None } => write!(f, "{path}"),
            Self::File { path, line: Some(line) } => write!(f, "{path}:{line}"),
            Self::Text { path, source, span } => {
                let (line, column) = line_and_column(source, span.start);
                write!(f, "{path}:{line}:{column}")
            }
            Self::Facet { path, facet } => write!(f, "{path}, facet {facet}"),
            Self::Element { path, element } => write!(f, "{path}, element {element}"),
            Self::Part { x_mm, y_mm } => write!(f, "part at ({x_mm:.3}, {y_mm:.3}) mm"),
            Self::Block(id) => write!(f, "block {id}"),
        }
    }
}

/// One message: code, sentence, place, remedy.
#[derive(Clone, Debug, PartialEq)]
pub struct Diag {
    /// Severity.
    pub kind: Kind,
    /// Stable short name, such as `stl-truncated`.
    pub code: &'static str,
    /// One sentence, numbers with units.
    pub message: String,
    /// Where.
    pub place: Place,
    /// What to change; empty where nothing can be said.
    pub hint: String,
}

impl Diag {
    fn new(kind: Kind, code: &'static str, message: impl Into<String>) -> Self {
        Self { kind, code, message: message.into(), place: Place::Nowhere, hint: String::new() }
    }
    /// Something worth knowing.
    pub fn warning(code: &'static str, message: impl Into<String>) -> Self {
        Self::new(Kind::Warning, code, message)
    }
    /// A fault of the input.
    pub fn input(code: &'static str, message: impl Into<String>) -> Self {
        Self::new(Kind::Input, code, message)
    }
    /// A limit of the machine or a rule that the job breaks.
    pub fn limit(code: &'static str, message: impl Into<String>) -> Self {
        Self::new(Kind::Limit, code, message)
    }
    /// A broken invariant of this program.
    pub fn bug(code: &'static str, message: impl Into<String>) -> Self {
        let mut d = Self::new(Kind::Bug, code, message);
        d.hint = "this is a bug in terrace, not in your job: please report it with the job file".into();
        d
    }
    /// Sets the place that the message speaks of.
    #[must_use]
    pub fn at(mut self, place: Place) -> Self {
        self.place = place;
        self
    }
    /// Adds a remedy.
    #[must_use]
    pub fn hint(mut self, hint: impl Into<String>) -> Self {
        self.hint = hint.into();
        self
    }

    /// The message as the command line shows it; text places are drawn with line and caret.
    pub fn render(&self, color: bool) -> String {
        let level = match self.kind {
            Kind::Warning => Level::WARNING,
            Kind::Bug => Level::ERROR.with_name("internal error"),
            Kind::Input | Kind::Limit => Level::ERROR,
        };
        let mut group = level
            .primary_title(self.message.as_str())
            .id(self.code)
            .elements(Vec::<Snippet<'_, annotate_snippets::Annotation<'_>>>::new());
        match &self.place {
            Place::Text { path, source, span } => {
                let end = span.end.min(source.len()).max(span.start.min(source.len()));
                let start = span.start.min(end);
                group = group.element(
                    Snippet::source(&**source).path(path.as_str()).annotation(AnnotationKind::Primary.span(start..end)),
                );
            }
            Place::Nowhere => {}
            other => group = group.element(annotate_snippets::Origin::path(other.to_string())),
        }
        if !self.hint.is_empty() {
            group = group.element(Level::HELP.message(self.hint.as_str()));
        }
        let renderer = if color { Renderer::styled() } else { Renderer::plain() };
        renderer.render(&[group])
    }
}

/// On one line, without severity and code: `place: message (hint)`.
impl fmt::Display for Diag {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.place != Place::Nowhere {
            write!(f, "{}: ", self.place)?;
        }
        write!(f, "{}", self.message)?;
        if !self.hint.is_empty() {
            write!(f, " ({})", self.hint)?;
        }
        Ok(())
    }
}

/// Whether a terminal acts on a character, or it turns the order of others. Line ends and tabs are not among these.
pub fn is_active(c: char) -> bool {
    let is_break = matches!(c, '\n' | '\t');
    let turns = matches!(c, '\u{61c}' | '\u{200e}' | '\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}');
    c.is_control() && !is_break || turns
}

/// A text without characters on which terminals act, or that turn the order of others: these are written `\u001b`,
/// which JSON reads as the same.
pub fn escaped(text: &str) -> std::borrow::Cow<'_, str> {
    if !text.contains(is_active) {
        return text.into();
    }
    let mut out = String::with_capacity(text.len() + 16);
    for c in text.chars() {
        if is_active(c) {
            out += &format!("\\u{:04x}", u32::from(c));
        } else {
            out.push(c);
        }
    }
    out.into()
}

/// One or more diagnostics that stop the work.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{}", .0.iter().map(ToString::to_string).collect::<Vec<_>>().join("; "))]
pub struct Error(Vec<Diag>);

impl Error {
    /// An error of several diagnostics. Panics on an empty list: nothing went wrong then.
    pub fn many(diags: Vec<Diag>) -> Self {
        assert!(!diags.is_empty(), "an error says at least one thing");
        Self(diags)
    }
    /// Adds the warnings that came before the error; they are reported after it.
    #[must_use]
    pub fn after(mut self, warnings: Vec<Diag>) -> Self {
        self.0.extend(warnings);
        self
    }
    /// What went wrong, in the order found; warnings that came before it at the end.
    pub fn diags(&self) -> &[Diag] {
        &self.0
    }
}

impl From<Diag> for Error {
    fn from(d: Diag) -> Self {
        Self(vec![d])
    }
}

/// Reads the whole of a file as bytes.
///
/// # Errors
/// `file-unreadable` with the system's reason; `file-too-large` beyond `limit` bytes, before reading.
pub fn read_file(path: &Path, limit: u64) -> Result<Vec<u8>, Error> {
    let place = Place::file(path.display().to_string());
    let meta = std::fs::metadata(path).map_err(|e| unreadable(path, &e))?;
    if !meta.is_file() {
        return Err(Diag::input("file-unreadable", "this is not a regular file").at(place).into());
    }
    if meta.len() > limit {
        let text = format!("the file has {} bytes, more than the limit of {limit} bytes", meta.len());
        return Err(Diag::input("file-too-large", text).at(place).into());
    }
    Ok(std::fs::read(path).map_err(|e| unreadable(path, &e))?)
}

/// The diagnostic for a file that the system does not give: where it was looked for, and what lies there instead.
pub fn unreadable(path: &Path, e: &std::io::Error) -> Diag {
    let whole = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
    let mut hint = "check the path".to_owned();
    if e.kind() == std::io::ErrorKind::NotFound {
        hint = match (near_names(&whole).as_slice(), whole.parent().filter(|p| !p.is_dir())) {
            (_, Some(folder)) => format!("there is no folder {}", folder.display()),
            ([], None) => format!("it was looked for as {}", whole.display()),
            (near, None) => format!("it was looked for as {}; did you mean {}?", whole.display(), near.join(" or ")),
        };
    }
    Diag::input("file-unreadable", format!("cannot read the file {}: {e}", path.display()))
        .at(Place::file(path.display().to_string()))
        .hint(hint)
}

/// Files next to a path whose names differ from its own by case, by extension or by one or two characters; at most
/// three, the nearest first.
fn near_names(path: &Path) -> Vec<String> {
    // Folders may be huge; this is only for a hint.
    const MOST: usize = 10_000;
    let lower = |name: &std::ffi::OsStr| name.to_string_lossy().to_lowercase();
    let (Some(folder), Some(name)) = (path.parent(), path.file_name().map(lower)) else { return Vec::new() };
    let mut near: Vec<(usize, String)> = std::fs::read_dir(folder)
        .into_iter()
        .flatten()
        .take(MOST)
        .flatten()
        .filter(|entry| entry.path().is_file())
        .filter_map(|entry| {
            let other = lower(&entry.file_name());
            let is_sibling = Path::new(&other).file_stem() == Path::new(&name).file_stem();
            let distance = if is_sibling { 1 } else { edits(&name, &other) };
            (distance <= 2 && distance < name.len() / 2).then(|| (distance, entry.file_name().to_string_lossy().into()))
        })
        .collect();
    near.sort();
    near.into_iter().take(3).map(|(_, name)| name).collect()
}

/// Parses a TOML text into `T`; every fault points at its value. `keys` says where all keys are listed.
///
/// # Errors
/// `toml` with the place of the fault: syntax, unknown or missing keys, wrong units, values out of range.
pub(crate) fn from_toml<T: DeserializeOwned>(path: &str, source: &Arc<str>, keys: &str) -> Result<T, Error> {
    from_table(path, source, parse_toml(path, source, keys)?, keys)
}

/// Parses a TOML text into tables, whose values know their places.
///
/// # Errors
/// `toml` where it is no TOML.
pub fn parse_toml<'a>(path: &str, source: &'a Arc<str>, keys: &str) -> Result<Spanned<DeTable<'a>>, Error> {
    DeTable::parse(source).map_err(|e| {
        let line = e.span().and_then(|span| line_of(source, span.start)).unwrap_or_default();
        let place = |span| Place::Text { path: path.into(), source: source.clone(), span };
        match (syntax::slip(line, e.message()), e.span()) {
            (Some(slip), Some(span)) if typographic(source, e.span()).is_none() => {
                Diag::input("toml", slip.fault).at(place(span)).hint(slip.remedy).into()
            }
            _ => toml_fault(&e, path, source, keys),
        }
    })
}

/// The line that holds a byte of a text; of the byte behind a line's end, that line.
fn line_of(source: &str, at: usize) -> Option<&str> {
    let (before, after) = source.split_at_checked(at)?;
    let start = before.rfind('\n').map_or(0, |end| end + 1);
    let end = after.find('\n').map_or(source.len(), |end| at + end);
    source.get(start..end)
}

/// What [`parse_toml`] made of `source`, or what was made of that, as `T`.
///
/// # Errors
/// `toml` with the place of the fault: unknown or missing keys, wrong units, values out of range.
pub fn from_table<T: DeserializeOwned>(
    path: &str,
    source: &Arc<str>,
    table: Spanned<DeTable<'_>>,
    keys: &str,
) -> Result<T, Error> {
    T::deserialize(toml::Deserializer::from(table)).map_err(|e| toml_fault(&e, path, source, keys))
}

/// Makes `grbl = { port = "x" }` of the table `driver = "grbl", port = "x"` with the tag `driver`: as an enum is read
/// without losing the places of its values. Leaves what is not a table as it is.
///
/// # Errors
/// `toml` where the tag is missing, or is not text; its place is that of the tag, or else up to the caller.
pub fn by_tag(value: &mut DeValue<'_>, tag: &str) -> Result<(), (Diag, Option<Range<usize>>)> {
    let DeValue::Table(table) = value else { return Ok(()) };
    let Some(word) = table.remove(tag) else {
        return Err((Diag::input("toml", format!("missing field `{tag}`")), None));
    };
    let (at, word) = (word.span(), word.into_inner());
    let DeValue::String(word) = word else {
        return Err((Diag::input("toml", format!("{tag} is not a text")).hint("write it in quotes"), Some(at)));
    };
    let rest = Spanned::new(at.clone(), DeValue::Table(std::mem::take(table)));
    *value = DeValue::Table(std::iter::once((Spanned::new(at, word), rest)).collect());
    Ok(())
}

/// The fault of a key that is not among the known ones.
pub fn unknown_key(key: &str, known: &[&str]) -> Diag {
    let names: Vec<String> = known.iter().map(|name| format!("`{name}`")).collect();
    let text = format!("unknown field `{key}`, expected one of {}", names.join(", "));
    let hint = spelled(&text);
    Diag::input("toml", text).hint(hint)
}

/// What to do about a name that is not known: take one of those that the message lists.
fn spelled(message: &str) -> String {
    match meant(message).as_slice() {
        [] => "check the spelling against the names listed".into(),
        names => format!("did you mean {}?", names.join(" or ")),
    }
}

/// An error of the parser, or of a type that was read.
fn toml_fault(e: &toml::de::Error, path: &str, source: &Arc<str>, keys: &str) -> Error {
    let place = match e.span() {
        Some(span) => Place::Text { path: path.into(), source: source.clone(), span },
        None => Place::file(path),
    };
    if let Some(quoted) = typographic(source, e.span()) {
        let fault = format!("these are typographic quotes: {quoted}");
        return Diag::input("toml", fault).at(place).hint("write straight quotes: \"...\"").into();
    }
    // Where a value's own message ends in a remedy, that is the hint.
    let (fault, remedy) = e.message().trim().split_once("; ").unwrap_or((e.message().trim(), keys));
    let mut d = Diag::input("toml", in_words(fault)).at(place).hint(remedy);
    // The table that misses a key is the whole file: no line of it is at fault.
    if e.message().starts_with("missing field") && e.span().is_some_and(|span| span.start == 0) {
        d.place = Place::file(path);
    }
    if e.message().contains("unknown field") || e.message().contains("unknown variant") {
        d.hint = spelled(e.message());
    } else if e.message().contains("missing field") {
        d.hint = keys.into();
    } else if has_backslash(source, e.span()) {
        d.hint = "in double quotes a backslash begins an escape: write the path with /".into();
    }
    d.into()
}

/// A fault of a type in the words of a TOML file, where serde has those of Rust.
fn in_words(fault: &str) -> String {
    const WORDS: [(&str, &str); 9] = [
        ("expected a sequence", "expected a list in brackets, such as [\"a\", \"b\"]"),
        ("invalid type: sequence", "this is a list"),
        ("invalid type: map", "this is a table"),
        ("invalid type: string", "this is the text"),
        ("invalid type: integer", "this is the number"),
        ("invalid type: floating point", "this is the number"),
        ("invalid type: boolean", "this is"),
        ("expected a string", "expected a text in quotes"),
        ("expected an array of length", "expected a list of this length:"),
    ];
    let plain = WORDS.iter().fold(fault.to_owned(), |text, (rust, words)| text.replace(rust, words));
    match plain.rsplit_once("expected ") {
        Some((before, "u8" | "u16" | "u32" | "u64" | "usize")) => format!("{before}expected a whole number, 0 or more"),
        Some((before, "i32" | "i64")) => format!("{before}expected a whole number"),
        Some((before, "f64")) => format!("{before}expected a number"),
        _ => plain,
    }
}

/// The rest of the line from a fault on, where it begins with a quote that a text processor has curled.
fn typographic(source: &str, span: Option<Range<usize>>) -> Option<&str> {
    const QUOTES: [char; 8] =
        ['\u{201c}', '\u{201d}', '\u{201e}', '\u{201f}', '\u{2018}', '\u{2019}', '\u{201a}', '\u{201b}'];
    let from_fault = source.get(span?.start..)?;
    let line = from_fault.split('\n').next()?.trim();
    let end = line.char_indices().skip(1).find(|(_, c)| QUOTES.contains(c)).map(|(at, c)| at + c.len_utf8());
    line.starts_with(QUOTES).then(|| &line[..end.unwrap_or(line.len())])
}

/// Whether the lines of a fault hold a double quote with a backslash after it, as a Windows path would.
fn has_backslash(source: &str, span: Option<Range<usize>>) -> bool {
    let Some((before, after)) = span.and_then(|s| source.split_at_checked(s.start)) else { return false };
    let line = [before.rsplit('\n').next(), after.split('\n').next()].map(Option::unwrap_or_default).concat();
    line.split_once('"').is_some_and(|(_, text)| text.contains('\\'))
}

/// The place of a key's value in a TOML text that can be read, such as `stage.x.speed` or `tilt.axes.0.travel`; of the
/// innermost table that is there where the key is not.
pub fn place_of(path: &str, source: &Arc<str>, key: &str) -> Place {
    let Ok(document) = DeTable::parse(source) else { return Place::file(path) };
    let mut keys = key.split('.');
    let Some(mut value) = keys.next().and_then(|k| document.get_ref().get(k)) else { return Place::file(path) };
    for key in keys {
        let next = match key.parse::<usize>() {
            Ok(i) => value.get_ref().get(i),
            Err(_) => value.get_ref().get(key),
        };
        let Some(next) = next else { break };
        value = next;
    }
    Place::Text { path: path.into(), source: source.clone(), span: value.span() }
}

/// Line and column, both from 1, of a byte offset.
pub fn line_and_column(source: &str, offset: usize) -> (usize, usize) {
    let before = source.get(..offset).unwrap_or(source);
    let line = before.bytes().filter(|&b| b == b'\n').count() + 1;
    let column = before.rsplit('\n').next().map_or(1, |l| l.chars().count() + 1);
    (line, column)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn windows_path_in_double_quotes_has_a_hint() {
        for text in ["a = \"C:\\parts\\door.stl\"", "a = \"C:\\Users\\me\"", "a = \"\\\\server\\x\"\n"] {
            let e = from_toml::<toml::Table>("j.toml", &text.into(), "keys").expect_err("a wrong escape");
            assert!(e.diags()[0].hint.contains("write the path with /"), "{text}: {e}");
        }
        for text in ["a = 'C:\\parts'\nb = ", "a = \"x", "a = \"C:\\\\x\"\nb ="] {
            let e = from_toml::<toml::Table>("j.toml", &text.into(), "keys").expect_err("no value");
            assert!(!e.diags()[0].hint.contains("path with /"), "{text}: {e}");
        }
    }

    #[test]
    fn typographic_quotes_are_named() {
        for text in [
            "a = \u{201c}hatch\u{201d}",
            "a = [\u{201c}x\u{201d}]\n",
            "a = \u{201e}x\u{201c} # b",
            "a = \u{2018}x\u{2019}",
            "\u{201c}a\u{201d} = 1",
        ] {
            let e = from_toml::<toml::Table>("j.toml", &text.into(), "keys").expect_err("curly quotes");
            assert!(e.diags()[0].message.starts_with("these are typographic quotes: "), "{text}: {e}");
            assert!(e.diags()[0].hint.contains("straight quotes"), "{text}: {e}");
        }
        // Within straight quotes and comments they are text.
        assert!(from_toml::<toml::Table>("j.toml", &"a = \"\u{201c}x\u{201d}\" # \u{201c}".into(), "keys").is_ok());
        let e = from_toml::<toml::Table>("j.toml", &"a = # \u{201c}x\u{201d}".into(), "keys").expect_err("no value");
        assert!(!e.to_string().contains("typographic"), "{e}");
    }

    #[test]
    fn missing_file_error_suggests_similar_names() {
        let dir = tempfile::tempdir().expect("a folder");
        for name in ["sample.stl", "Door.STL", "other.obj"] {
            std::fs::write(dir.path().join(name), "").expect("written");
        }
        let hint = |name: &str| match read_file(&dir.path().join(name), 1) {
            Err(e) => e.diags()[0].hint.clone(),
            Ok(_) => panic!("{name} is not there"),
        };
        for (name, near) in [("sampel.stl", "sample.stl"), ("sample.obj", "sample.stl"), ("door.stl", "Door.STL")] {
            if !dir.path().join(name).exists() {
                assert!(hint(name).ends_with(&format!("did you mean {near}?")), "{}", hint(name));
            }
        }
        assert!(!hint("x.stl").contains("mean") && hint("x.stl").contains(&dir.path().display().to_string()));
        assert!(hint("sub/x.stl").starts_with("there is no folder "));
    }
}
