//! What a drawing holds that is not marked, or not marked as drawn: counted, one warning per issue.

use crate::diag::{Diag, Place};

/// Something that causes a warning.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Issue {
    Hidden,
    Text,
    Image,
    External,
    Use,
    Paint,
    Clip,
    Marker,
    Dash,
    Fault,
    Transform,
    Unit,
    Dot,
    Hairline,
    Overhang,
}

/// Issue, code, sentence after "elements", hint.
const ISSUES: [(Issue, &str, &str, &str); 15] = [
    (
        Issue::Hidden,
        "svg-hidden",
        "hidden, or with neither fill nor stroke, are not marked",
        "show them, or ignore this",
    ),
    (Issue::Text, "svg-text", "of text are not marked", "convert text to paths in the drawing program"),
    (Issue::Image, "svg-image", "that are images are not marked", "trace images to paths in the drawing program"),
    (Issue::External, "svg-external", "refer to other files, which are never opened", "embed what they refer to"),
    (
        Issue::Use,
        "svg-use",
        "refer (use) to something missing or to themselves, and are not marked",
        "repair the references",
    ),
    (
        Issue::Paint,
        "svg-pattern",
        "are painted by a pattern or a gradient: only their outlines are marked",
        "draw the pattern as paths, or tile it with tile = true",
    ),
    (
        Issue::Clip,
        "svg-clip",
        "have a clip path, a mask, a filter or a clipping frame, which is not applied",
        "apply it in the drawing program",
    ),
    (
        Issue::Marker,
        "svg-marker",
        "have markers, which are not marked",
        "convert markers to paths in the drawing program",
    ),
    (
        Issue::Dash,
        "svg-dash",
        "are dashed and are marked as full lines",
        "convert dashes to paths in the drawing program",
    ),
    (
        Issue::Fault,
        "svg-path",
        "have faulty path data, points or lengths; each is marked up to its fault",
        "repair them in the drawing program",
    ),
    (
        Issue::Transform,
        "svg-transform",
        "have a transform that is faulty, flattens them or sits on the drawing itself, or a transform-origin: it is not applied",
        "apply the transform in the drawing program",
    ),
    (Issue::Unit, "svg-unit", "have lengths in em or ex, taken as 16 px and 8 px", "use mm or user units"),
    (
        Issue::Dot,
        "svg-dot",
        "have parts without extent, which are not marked",
        "draw them with an extent, or ignore this",
    ),
    (
        Issue::Hairline,
        "svg-hairline",
        "have closed parts thinner than the tolerance, which are not marked",
        "draw a thin line as an open path, or lower the tolerance",
    ),
    (Issue::Overhang, "svg-overhang", "reach beyond the page and are cut at its border", "enlarge the page"),
];

/// Counts per issue, each with the first element.
#[derive(Debug, Default)]
pub(super) struct Tally([Option<(usize, String)>; ISSUES.len()]);

impl Tally {
    /// Counts one more; `element` is asked for its name only the first time.
    pub(super) fn add(&mut self, issue: Issue, element: impl FnOnce() -> String) {
        match &mut self.0[issue as usize] {
            Some((n, _)) => *n += 1,
            none => *none = Some((1, element())),
        }
    }

    pub(super) fn count(&self, issue: Issue) -> usize {
        self.0[issue as usize].as_ref().map_or(0, |(n, _)| *n)
    }

    /// One warning per issue that was met.
    pub(super) fn warnings(self, path: &str) -> impl Iterator<Item = Diag> {
        self.0.into_iter().zip(ISSUES).filter_map(move |(met, (_, code, says, hint))| {
            let (n, element) = met?;
            let place = Place::Element { path: path.to_owned(), element };
            Some(Diag::warning(code, format!("elements {says} ({n})")).at(place).hint(hint))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn warning_table_follows_enum_order() {
        for (i, row) in ISSUES.iter().enumerate() {
            assert_eq!(row.0 as usize, i);
        }
    }
}
