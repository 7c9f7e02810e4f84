//! What a drawing holds that is not marked, or not as drawn: counted, one message per issue.

use crate::texture::artwork::Marking;
use crate::texture::artwork::Weight::{self, Refused, Warned};
use terrace_core::diag::{Diag, Place};

/// Something that is reported.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Issue {
    Hidden,
    Text,
    Image,
    External,
    Use,
    Paint,
    Effect,
    Box,
    Marker,
    Transform,
    Fault,
    Flat,
    Unit,
    Translucent,
    FlowText,
    Animation,
    Background,
    NonScaling,
    PathLength,
    Dot,
    Hairline,
    Overhang,
}

/// What is said of an issue.
struct IssueRow {
    issue: Issue,
    weight: Weight,
    code: &'static str,
    /// The sentence after "elements".
    sentence: &'static str,
    hint: &'static str,
}

const fn row(issue: Issue, weight: Weight, code: &'static str, sentence: &'static str, hint: &'static str) -> IssueRow {
    IssueRow { issue, weight, code, sentence, hint }
}

const ISSUES: [IssueRow; 22] = [
    row(
        Issue::Hidden,
        Warned,
        "svg-hidden",
        "hidden, or with neither fill nor stroke, are not marked",
        "show them, or ignore this",
    ),
    row(Issue::Text, Refused, "svg-text", "of text have no outlines", "convert text to paths in the drawing program"),
    row(Issue::Image, Refused, "svg-image", "are images", "trace images to paths in the drawing program"),
    row(
        Issue::External,
        Refused,
        "svg-external",
        "refer to other files, which are never opened",
        "embed what they refer to",
    ),
    row(
        Issue::Use,
        Warned,
        "svg-use",
        "refer (use) to something missing or to themselves, and are not marked",
        "repair the references",
    ),
    row(
        Issue::Paint,
        Refused,
        "svg-paint",
        "are painted by a gradient of several colours, by a pattern that cannot be drawn, or have a stroke painted by either",
        "paint them in one colour, or draw the pattern as paths",
    ),
    row(
        Issue::Effect,
        Refused,
        "svg-effect",
        "have a filter, a blend mode, a clip path or mask that is missing or not of plain shapes, a join of kind arcs or \
         miter-clip, or a stroke that does not scale under a transform that distorts it",
        "apply it in the drawing program",
    ),
    row(
        Issue::Box,
        Refused,
        "svg-box",
        "have a clip path or mask in units of their box (objectBoundingBox) and hold turned or skewed elements, whose \
         box is not the same in all programs",
        "give the clip path or mask in user units (userSpaceOnUse)",
    ),
    row(Issue::Marker, Refused, "svg-marker", "have markers", "convert markers to paths in the drawing program"),
    row(
        Issue::Transform,
        Refused,
        "svg-transform",
        "have a transform that is faulty, sits on the drawing itself, or refers to the box of a stroke",
        "apply the transform in the drawing program",
    ),
    row(
        Issue::Fault,
        Warned,
        "svg-path",
        "have faulty path data, points or lengths; each is drawn up to its fault, as viewers do",
        "repair them in the drawing program",
    ),
    row(
        Issue::Flat,
        Warned,
        "svg-flat",
        "have a transform that flattens them to a line, and are not marked",
        "remove them, or repair the transform",
    ),
    row(
        Issue::Unit,
        Warned,
        "svg-unit",
        "have lengths in units that depend on the face of a font (ex, ch, ic), taken as half or all of its size",
        "use mm or user units",
    ),
    row(
        Issue::Translucent,
        Warned,
        "svg-opacity",
        "are partly transparent and are marked like opaque ones",
        "give them a colour and a pen of their own, or ignore this",
    ),
    row(
        Issue::FlowText,
        Warned,
        "svg-flow-text",
        "of flowed text (flowRoot), which Inkscape shows and browsers do not, are not marked",
        "convert them to text and then to paths in Inkscape, or remove them",
    ),
    row(
        Issue::Animation,
        Refused,
        "svg-animation",
        "change over time (animate, set)",
        "remove the animation, and draw what is meant",
    ),
    row(
        Issue::Background,
        Refused,
        "svg-background",
        "have a background of CSS that is not white",
        "draw the background as a rectangle, or remove it",
    ),
    row(
        Issue::NonScaling,
        Warned,
        "svg-non-scaling",
        "have a stroke that does not scale (vector-effect); its width is that at the size of the page, with 96 pixels \
         to the inch",
        "give the stroke a width in the units of the drawing, or mark strokes along their centre (stroke = \"centre\")",
    ),
    row(
        Issue::PathLength,
        Warned,
        "svg-path-length",
        "have dashes in units of pathLength, drawn as browsers do; other programs ignore it",
        "give dashes in the units of the drawing, and remove pathLength",
    ),
    row(
        Issue::Dot,
        Warned,
        "svg-dot",
        "have parts without extent, which are not marked",
        "draw them with an extent, or ignore this",
    ),
    row(
        Issue::Hairline,
        Warned,
        "svg-hairline",
        "have closed parts thinner than the tolerance, which are not marked",
        "draw a thin line as an open path, or lower the tolerance",
    ),
    row(Issue::Overhang, Warned, "svg-overhang", "reach beyond the page and are cut at its border", "enlarge the page"),
];

/// The elements of an issue.
#[derive(Debug)]
struct Affected {
    count: usize,
    /// The name of the first.
    first: String,
}

/// The elements of each issue, by its number.
#[derive(Debug, Default)]
pub(super) struct Tally([Option<Affected>; ISSUES.len()]);

impl Tally {
    /// Counts one more; `element` is asked for its name only the first time.
    pub(super) fn add(&mut self, issue: Issue, element: impl FnOnce() -> String) {
        match &mut self.0[issue as usize] {
            Some(affected) => affected.count += 1,
            none => *none = Some(Affected { count: 1, first: element() }),
        }
    }

    pub(super) fn count(&self, issue: Issue) -> usize {
        self.0[issue as usize].as_ref().map_or(0, |affected| affected.count)
    }

    /// How many times something was met that is refused.
    pub(super) fn refused(&self) -> usize {
        ISSUES.iter().filter(|row| row.weight == Refused).map(|row| self.count(row.issue)).sum()
    }

    /// One message per issue that was met: errors and warnings.
    pub(super) fn messages(self, path: &str, marking: &Marking) -> Vec<Diag> {
        let issues = ISSUES.into_iter().zip(self.0);
        issues.filter_map(|(row, affected)| Some(row.message(affected?, path, marking))).collect()
    }
}

impl IssueRow {
    fn message(&self, affected: Affected, path: &str, marking: &Marking) -> Diag {
        let what = format!("elements {}", self.sentence);
        let count = format!(" ({})", affected.count);
        // What was done instead, where the job leaves them out.
        let done = match self.issue {
            Issue::Animation => ", and are marked as if they did not",
            Issue::Background => ", which is not marked",
            _ => ", and are not marked",
        };
        let message = match self.weight {
            Refused => marking.unmarkable(self.code, &what, done, &count, self.hint),
            Warned => Diag::warning(self.code, what + &count).hint(self.hint),
        };
        message.at(Place::Element { path: path.to_owned(), element: affected.first })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn warning_table_follows_enum_order() {
        for (i, row) in ISSUES.iter().enumerate() {
            assert_eq!(row.issue as usize, i);
        }
    }
}
