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
    kinds: Vec<Kind>,
    /// How many ignored declarations and rules there are, and the first.
    ignored: Option<(usize, String, At)>,
    more: usize,
}

/// Where something was met.
#[derive(Debug)]
enum At {
    Line(usize),
    Element(String),
}

impl At {
    fn place(self, path: &str) -> Place {
        match self {
            Self::Line(line) => Place::line(path, line),
            Self::Element(element) => Place::Element { path: path.to_owned(), element },
        }
    }
}

#[derive(Debug)]
struct Kind {
    is_external: bool,
    what: String,
    text: String,
    count: usize,
    at: At,
}

impl Remarks {
    /// Keeps a remark; `element` names that of a remark without a line.
    pub(super) fn add(&mut self, remark: &Remark, element: impl FnOnce() -> String) {
        let at = || match remark.line {
            Some(line) => At::Line(line as usize),
            None => At::Element(element()),
        };
        let (is_external, what) = match &remark.weight {
            Weight::Ignored => {
                match &mut self.ignored {
                    Some((count, ..)) => *count += 1,
                    none => *none = Some((1, remark.text.clone(), at())),
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
                let (what, text) = (what.clone(), remark.text.clone());
                self.kinds.push(Kind { is_external, what, text, count: 1, at: at() });
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
        for Kind { is_external, what, text, count, at } in self.kinds.into_iter().take(MAX_KINDS) {
            let of = if text.is_empty() { String::new() } else { format!(" in {text:?}") };
            if is_external {
                let text = format!("style sheets are in other files, which are never opened: {what}");
                report("svg-external", text, at.place(path), "embed them in style elements");
            } else {
                let text = format!("styles are not read and may change what is seen: {what}{of} ({count})");
                report("svg-css", text, at.place(path), "write what is meant as plain values or attributes");
            }
        }
        if rest > 0 {
            let text = format!("the styles hold {rest} more things that are not read");
            report("svg-css", text, Place::file(path), "export the drawing with presentation attributes");
        }
        if let Some((count, text, at)) = self.ignored {
            let text = format!("styles are not valid and are ignored, as browsers do ({count}, first {text:?})");
            let hint = "correct them, or ignore this where the drawing looks right in a browser";
            out.push(Diag::warning("svg-css-ignored", text).at(at.place(path)).hint(hint));
        }
        out
    }
}
