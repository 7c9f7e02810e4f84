//! What goes wrong, with its place and its remedy.
//!
//! Four kinds, never mixed: a warning, your input, your machine's limit, our own bug. Each diagnostic
//! is one sentence with a stable code (listed in `docs/errors.md`), a place and a hint that says what
//! to change. Nothing here prints: the command line renders diagnostics, JSON writes them as objects.

use std::fmt;
use std::ops::Range;
use std::sync::Arc;

use annotate_snippets::{AnnotationKind, Level, Renderer, Snippet};
use serde::de::DeserializeOwned;

/// Whose matter it is, which also decides the exit code.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Worth knowing; the work goes on.
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
        /// As the user named it.
        path: String,
        /// Counted from 1.
        line: Option<usize>,
    },
    /// A stretch of a text file that is shown with a caret.
    Text {
        /// As the user named it.
        path: String,
        /// The whole text.
        source: Arc<str>,
        /// Bytes of the text.
        span: Range<usize>,
    },
    /// A facet of a surface file, counted from 0 in file order.
    Facet {
        /// As the user named it.
        path: String,
        /// Number of the facet.
        facet: usize,
    },
    /// An element of a drawing, by id or by its number.
    Element {
        /// As the user named it.
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
    /// Whose matter it is.
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
        d.hint = "this is a fault of terrace, not of your job: please report it with the job file".into();
        d
    }
    /// The same message at `place`.
    #[must_use]
    pub fn at(mut self, place: Place) -> Self {
        self.place = place;
        self
    }
    /// The same message with a remedy.
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

    /// The message as a JSON object with keys kind, code, message, place, hint.
    pub fn to_json(&self) -> serde_json::Value {
        let kind = match self.kind {
            Kind::Warning => "warning",
            Kind::Input => "input",
            Kind::Limit => "limit",
            Kind::Bug => "bug",
        };
        serde_json::json!({
            "kind": kind, "code": self.code, "message": self.message,
            "place": self.place.to_string(), "hint": self.hint,
        })
    }
}

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
    /// The same error, with the warnings that came before it told after it.
    #[must_use]
    pub fn after(mut self, warnings: Vec<Diag>) -> Self {
        self.0.extend(warnings);
        self
    }
    /// What went wrong, in the order found; warnings that came before it at the end.
    pub fn diags(&self) -> &[Diag] {
        &self.0
    }
    /// The exit code: 3 for a bug of ours, else 2 for input, else 1 for limits.
    pub fn exit_code(&self) -> u8 {
        self.0
            .iter()
            .map(|d| match d.kind {
                Kind::Bug => 3,
                Kind::Input => 2,
                Kind::Limit | Kind::Warning => 1,
            })
            .max()
            .unwrap_or(3)
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
pub fn read_file(path: &std::path::Path, limit: u64) -> Result<Vec<u8>, Error> {
    let place = Place::file(path.display().to_string());
    let unreadable = |e: std::io::Error| {
        Diag::input("file-unreadable", format!("cannot read the file: {e}"))
            .at(place.clone())
            .hint("check the path; paths in a job file are relative to the job file")
    };
    let meta = std::fs::metadata(path).map_err(unreadable)?;
    if !meta.is_file() {
        return Err(Diag::input("file-unreadable", "this is not a regular file").at(place).into());
    }
    if meta.len() > limit {
        let text = format!("the file has {} bytes, more than the limit of {limit} bytes", meta.len());
        return Err(Diag::input("file-too-large", text).at(place).into());
    }
    Ok(std::fs::read(path).map_err(unreadable)?)
}

/// Parses a TOML text into `T`; every fault points at its value.
///
/// # Errors
/// `toml` with the place of the fault: syntax, unknown or missing keys, wrong units, values out of range.
pub fn from_toml<T: DeserializeOwned>(path: &str, source: &Arc<str>) -> Result<T, Error> {
    toml::from_str(source).map_err(|e| {
        let place = match e.span() {
            Some(span) => Place::Text { path: path.into(), source: source.clone(), span },
            None => Place::file(path),
        };
        // Where a value's own message ends in a remedy, that is the hint.
        let (fault, remedy) = e.message().trim().split_once("; ").unwrap_or((
            e.message().trim(),
            "docs/job-file.md and docs/machine-file.md list every key with its values",
        ));
        let mut d = Diag::input("toml", fault).at(place).hint(remedy);
        if e.message().contains("unknown field") || e.message().contains("unknown variant") {
            d.hint = "check the spelling against the names listed".into();
        } else if e.message().contains("missing field") {
            d.hint = "`terrace init` writes a commented job file that holds every key".into();
        }
        d.into()
    })
}

/// Line and column, both from 1, of a byte offset.
pub(crate) fn line_and_column(source: &str, offset: usize) -> (usize, usize) {
    let before = source.get(..offset).unwrap_or(source);
    let line = before.bytes().filter(|&b| b == b'\n').count() + 1;
    let column = before.rsplit('\n').next().map_or(1, |l| l.chars().count() + 1);
    (line, column)
}
