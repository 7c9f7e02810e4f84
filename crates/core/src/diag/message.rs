//! Diagnostics as data: the one shape that `--json`, manifests and batch reports give them.

use serde::{Deserialize, Serialize};

use super::{Diag, Error, Kind, Place, line_and_column};

/// How serious a message is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Severity {
    /// The command continues.
    Warning,
    /// The input is at fault, or the machine cannot do what is asked.
    Error,
    /// A bug in terrace.
    Bug,
}

/// A diagnostic as data. Keys that do not apply are null.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Message {
    /// The code of the message, such as `stl-truncated`.
    pub code: String,
    /// How serious it is.
    pub severity: Severity,
    /// The file that it speaks of, as the user named it.
    pub file: Option<String>,
    /// Line of the file, from 1.
    pub line: Option<usize>,
    /// Column in the line, in characters, from 1.
    pub column: Option<usize>,
    /// Where in the file or in the job, if that is not a line: a facet, an element, a point of the part, a block.
    pub place: Option<String>,
    /// One sentence.
    pub message: String,
    /// What to change.
    pub help: Option<String>,
}

impl From<&Diag> for Message {
    fn from(d: &Diag) -> Self {
        let (mut line, mut column, mut place) = (None, None, None);
        let file = match &d.place {
            Place::Nowhere => None,
            Place::File { path, line: at } => {
                line = *at;
                Some(path)
            }
            Place::Text { path, source, span } => {
                (line, column) = Some(line_and_column(source, span.start)).unzip();
                Some(path)
            }
            Place::Facet { path, facet } => {
                place = Some(format!("facet {facet}"));
                Some(path)
            }
            Place::Element { path, element } => {
                place = Some(format!("element {element}"));
                Some(path)
            }
            Place::Part { .. } | Place::Block(_) => {
                place = Some(d.place.to_string());
                None
            }
        };
        let severity = match d.kind {
            Kind::Warning => Severity::Warning,
            Kind::Input | Kind::Limit => Severity::Error,
            Kind::Bug => Severity::Bug,
        };
        Self {
            code: d.code.into(),
            severity,
            file: file.cloned(),
            line,
            column,
            place,
            message: d.message.clone(),
            help: (!d.hint.is_empty()).then(|| d.hint.clone()),
        }
    }
}

/// What stopped the work, as `--json` prints it in place of the result.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Failure {
    /// The exit code.
    pub exit_code: u8,
    /// Errors in the order found, then the warnings that came before them.
    pub errors: Vec<Message>,
}

impl From<&Error> for Failure {
    fn from(e: &Error) -> Self {
        let (warnings, faults): (Vec<&Diag>, _) = e.diags().iter().partition(|d| d.kind == Kind::Warning);
        Self { exit_code: e.exit_code(), errors: faults.into_iter().chain(warnings).map(Message::from).collect() }
    }
}

/// What stopped the work, kept when its place is no longer at hand: as data, and as the command line shows it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Fault {
    /// Exit code and messages.
    #[serde(flatten)]
    pub failure: Failure,
    /// All messages with their places, rendered without colour.
    pub text: String,
}

impl Fault {
    /// The sentence that says first of all what is wrong.
    pub fn message(&self) -> &str {
        self.failure.errors.first().map_or("unknown", |m| m.message.as_str())
    }
}

impl From<&Error> for Fault {
    fn from(e: &Error) -> Self {
        let text = e.diags().iter().map(|d| d.render(false)).collect::<Vec<_>>().join("\n");
        Self { failure: e.into(), text }
    }
}

impl From<Diag> for Fault {
    fn from(d: Diag) -> Self {
        Self::from(&Error::from(d))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_place_becomes_file_line_column_and_place() {
        let of = |place: Place| {
            let m = Message::from(&Diag::input("a-code", "a sentence").at(place).hint("do that"));
            assert_eq!((m.code.as_str(), m.severity, m.message.as_str()), ("a-code", Severity::Error, "a sentence"));
            assert_eq!(m.help.as_deref(), Some("do that"));
            (m.file, m.line, m.column, m.place)
        };
        let file = || Some("f".to_owned());
        let text = Place::Text { path: "f".into(), source: "ab\nµcd".into(), span: 6..7 };
        assert_eq!(of(Place::Nowhere), (None, None, None, None));
        assert_eq!(of(Place::file("f")), (file(), None, None, None));
        assert_eq!(of(Place::line("f", 7)), (file(), Some(7), None, None));
        assert_eq!(of(text), (file(), Some(2), Some(3), None));
        assert_eq!(of(Place::Facet { path: "f".into(), facet: 3 }), (file(), None, None, Some("facet 3".into())));
        let element = Place::Element { path: "f".into(), element: "path9".into() };
        assert_eq!(of(element), (file(), None, None, Some("element path9".into())));
        assert_eq!(of(Place::Block("B0001".into())), (None, None, None, Some("block B0001".into())));
        let part = Place::Part { x_mm: 1.0, y_mm: -2.0 };
        assert_eq!(of(part), (None, None, None, Some("part at (1.000, -2.000) mm".into())));
    }

    #[test]
    fn a_failure_lists_errors_before_warnings_and_has_the_exit_code() {
        let warned = Error::from(Diag::limit("travel", "too far")).after(vec![Diag::warning("steep", "steep")]);
        let bug = Error::many(vec![Diag::warning("w", "w"), Diag::bug("b", "b")]);
        let codes = |e: &Error| {
            let f = Failure::from(e);
            (f.exit_code, f.errors.into_iter().map(|m| (m.code, m.severity)).collect::<Vec<_>>())
        };
        let message = |code: &str, severity| (code.to_owned(), severity);
        assert_eq!(codes(&warned), (1, vec![message("travel", Severity::Error), message("steep", Severity::Warning)]));
        assert_eq!(codes(&bug), (3, vec![message("b", Severity::Bug), message("w", Severity::Warning)]));
    }
}
