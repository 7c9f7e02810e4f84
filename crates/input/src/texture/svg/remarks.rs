//! What of the styles of a drawing is not read: reported once for each kind, in the order in which it is met.

use svg_style::{Remark, Weight};

use crate::texture::artwork::Marking;
use terrace_core::diag::{Diag, Place};

/// Most kinds that are listed one by one.
const MAX_KINDS: usize = 12;

/// Most kinds that are told apart.
const MAX_KEPT: usize = 1000;

/// Remarks by what they are of.
#[derive(Debug, Default)]
pub(super) struct Remarks {
    kinds: Vec<RemarkKind>,
    ignored: Option<Ignored>,
    /// How many remarks are of kinds beyond [`MAX_KEPT`].
    more: usize,
}

/// Where something stands in a drawing.
#[derive(Debug)]
enum RemarkPlace {
    Line(usize),
    Element(String),
}

impl RemarkPlace {
    /// The place of a remark; `element` names the element of one without a line.
    fn of(remark: &Remark, element: impl FnOnce() -> String) -> Self {
        match remark.line {
            Some(line) => Self::Line(line as usize),
            None => Self::Element(element()),
        }
    }

    fn place(self, path: &str) -> Place {
        match self {
            Self::Line(line) => Place::line(path, line),
            Self::Element(element) => Place::Element { path: path.to_owned(), element },
        }
    }
}

/// Remarks of one kind.
#[derive(Debug)]
struct RemarkKind {
    is_external: bool,
    what: String,
    /// The text of the first.
    text: String,
    count: usize,
    /// Where the first stands.
    at: RemarkPlace,
}

/// Declarations and rules that are ignored.
#[derive(Debug)]
struct Ignored {
    count: usize,
    /// The text of the first.
    text: String,
    /// Where the first stands.
    at: RemarkPlace,
}

impl Remarks {
    /// Keeps a remark; `element` names that of a remark without a line.
    pub(super) fn add(&mut self, remark: &Remark, element: impl FnOnce() -> String) {
        let (is_external, what) = match &remark.weight {
            Weight::Ignored => {
                match &mut self.ignored {
                    Some(ignored) => ignored.count += 1,
                    none => {
                        let at = RemarkPlace::of(remark, element);
                        *none = Some(Ignored { count: 1, text: remark.text.clone(), at });
                    }
                }
                return;
            }
            Weight::Unknown(what) => (false, what),
            Weight::External => (true, &remark.text),
        };
        let kept = self.kinds.len();
        match self.kinds.iter_mut().find(|k| k.what == *what) {
            Some(kind) => kind.count += 1,
            None if kept < MAX_KEPT => {
                let what = what.clone();
                let text = remark.text.clone();
                let at = RemarkPlace::of(remark, element);
                self.kinds.push(RemarkKind { is_external, what, text, count: 1, at });
            }
            None => self.more += 1,
        }
    }

    /// How many times something was met that is refused.
    pub(super) fn refused(&self) -> usize {
        self.kinds.iter().map(|k| k.count).sum::<usize>() + self.more
    }

    /// One message per kind: errors and warnings.
    pub(super) fn messages(self, path: &str, marking: &Marking) -> Vec<Diag> {
        let mut out = Vec::new();
        let mut report = |code, text: String, at: Place, hint: &str| {
            out.push(marking.unmarkable(code, &text, "; they are left out", "", hint).at(at));
        };
        let rest = self.kinds.len().saturating_sub(MAX_KINDS) + self.more;
        for RemarkKind { is_external, what, text, count, at } in self.kinds.into_iter().take(MAX_KINDS) {
            let place = if text.is_empty() { String::new() } else { format!(" in {text:?}") };
            if is_external {
                let text = format!("style sheets are in other files, which are never opened: {what}");
                report("svg-external", text, at.place(path), "embed them in style elements");
            } else {
                let text = format!("styles are not read and may change what is seen: {what}{place} ({count})");
                report("svg-css", text, at.place(path), "write what is meant as plain values or attributes");
            }
        }
        if rest > 0 {
            let text = format!("the styles hold {rest} more things that are not read");
            report("svg-css", text, Place::file(path), "export the drawing with presentation attributes");
        }
        if let Some(Ignored { count, text, at }) = self.ignored {
            let text = format!("styles are not valid and are ignored, as browsers do ({count}, first {text:?})");
            let hint = "correct them, or ignore this where the drawing looks right in a browser";
            out.push(Diag::warning("svg-css-ignored", text).at(at.place(path)).hint(hint));
        }
        out
    }
}
