//! What a drawing holds that is not marked, or not as drawn: counted by type, one message per issue.

use std::collections::BTreeMap;

use crate::texture::artwork::Marking;
use crate::texture::artwork::Weight::{self, Refused, Warned};
use terrace_core::diag::{Diag, Place};

/// Something that is reported.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Issue {
    Text,
    Dimension,
    Image,
    Mesh,
    Infinite,
    Mline,
    Unread,
    Gradient,
    Dots,
    Width,
    Dash,
    Block,
    Clip,
    Fault,
    Bulge,
    Hidden,
    NoPlot,
    Paper,
    Dot,
    Ignored,
    Outside,
    Area,
    LineType,
}

/// What is said of an issue.
struct IssueRow {
    issue: Issue,
    weight: Weight,
    code: &'static str,
    /// The sentence after "entities".
    sentence: &'static str,
    hint: &'static str,
}

const fn row(issue: Issue, weight: Weight, code: &'static str, sentence: &'static str, hint: &'static str) -> IssueRow {
    IssueRow { issue, weight, code, sentence, hint }
}

const ISSUES: [IssueRow; 23] = [
    row(Issue::Text, Refused, "dxf-text", "of text have no outlines", "explode text to lines in the drawing program"),
    row(
        Issue::Dimension,
        Refused,
        "dxf-dimension",
        "are dimensions or leaders",
        "explode them in the drawing program, or hide their layer",
    ),
    row(
        Issue::Image,
        Refused,
        "dxf-image",
        "are images, wipeouts or embedded documents",
        "trace images in the drawing program; trim what a wipeout covers",
    ),
    row(
        Issue::Mesh,
        Refused,
        "dxf-mesh",
        "are faces, meshes, regions or solids",
        "draw their edges as lines, or use them as the surface",
    ),
    row(Issue::Infinite, Refused, "dxf-infinite", "are endless lines", "draw lines that end"),
    row(Issue::Mline, Refused, "dxf-mline", "are multilines", "explode them in the drawing program"),
    row(Issue::Unread, Refused, "dxf-unread", "are of types that are not read", "explode them in the drawing program"),
    row(Issue::Gradient, Refused, "dxf-gradient", "are filled by a gradient", "fill them with one colour or a pattern"),
    row(Issue::Dots, Refused, "dxf-pattern-dots", "have a hatch pattern with dots", "use a pattern of lines"),
    row(
        Issue::Width,
        Warned,
        "dxf-width",
        "are wide polylines with corners that are sharp, between different widths or narrower than the width: there the area may differ",
        "round these corners, or draw the outline",
    ),
    row(
        Issue::Dash,
        Refused,
        "dxf-dash",
        "have a dashed line type",
        "use the line type Continuous, or draw the dashes",
    ),
    row(
        Issue::Block,
        Warned,
        "dxf-block",
        "insert a block that is missing or in another file, and are not marked",
        "bind external references, or remove the inserts",
    ),
    row(
        Issue::Clip,
        Refused,
        "dxf-clip",
        "are clips of inserted blocks, which are not applied",
        "explode and trim the blocks in the drawing program",
    ),
    row(
        Issue::Fault,
        Warned,
        "dxf-fault",
        "have a faulty description, such as a radius of 0 or too few knots, and are not marked",
        "repair them in the drawing program",
    ),
    row(
        Issue::Bulge,
        Warned,
        "dxf-bulge",
        "have arcs of a radius beyond 1000 km; these are marked as straight lines",
        "repair them in the drawing program",
    ),
    row(
        Issue::Hidden,
        Warned,
        "dxf-hidden",
        "are invisible or on layers that are frozen or off, and are not marked",
        "show them, or ignore this",
    ),
    row(
        Issue::NoPlot,
        Warned,
        "dxf-noplot",
        "are on layers that are shown but not plotted; they are marked",
        "turn these layers off, or ignore this",
    ),
    row(
        Issue::Paper,
        Warned,
        "dxf-paper",
        "lie in paper space and are not marked",
        "move them to model space, or ignore this",
    ),
    row(
        Issue::Dot,
        Warned,
        "dxf-dot",
        "have parts without extent, which are not marked",
        "draw them with an extent, or ignore this",
    ),
    row(Issue::Ignored, Warned, "dxf-ignored", "that show nothing are left out", "ignore this"),
    row(
        Issue::Outside,
        Warned,
        "dxf-outside",
        "stand outside of the sections of the file and are not read",
        "save the drawing again as DXF",
    ),
    row(
        Issue::Area,
        Refused,
        "dxf-area",
        "are areas, and space curves have none",
        "draw their borders as lines, or give the drawing as file",
    ),
    row(
        Issue::LineType,
        Warned,
        "dxf-linetype",
        "have a line type that the file does not define, and are marked as solid lines",
        "load the line type in the drawing program, or use Continuous",
    ),
];

/// Types of entities and what is said of them; all others are [`Issue::Unread`].
const TYPES: [(Issue, &[&str]); 7] = [
    (Issue::Text, &["TEXT", "MTEXT", "ATTRIB", "ATTDEF", "RTEXT", "ARCALIGNEDTEXT"]),
    (
        Issue::Dimension,
        &["DIMENSION", "ARC_DIMENSION", "LARGE_RADIAL_DIMENSION", "LEADER", "MULTILEADER", "MLEADER", "TOLERANCE"],
    ),
    (
        Issue::Image,
        &["IMAGE", "WIPEOUT", "OLEFRAME", "OLE2FRAME", "PDFUNDERLAY", "DWFUNDERLAY", "DGNUNDERLAY", "POINTCLOUD"],
    ),
    (
        Issue::Mesh,
        &[
            "3DFACE",
            "3DSOLID",
            "BODY",
            "REGION",
            "MESH",
            "SURFACE",
            "PLANESURFACE",
            "EXTRUDEDSURFACE",
            "LOFTEDSURFACE",
            "REVOLVEDSURFACE",
            "SWEPTSURFACE",
        ],
    ),
    (Issue::Infinite, &["RAY", "XLINE"]),
    (Issue::Mline, &["MLINE"]),
    (Issue::Ignored, &["VIEWPORT", "LIGHT", "CAMERA", "SUN", "SEQEND", "LAYOUTPRINTCONFIG"]),
];

impl Issue {
    /// What is said of entities of a type that is not read.
    pub(super) fn of_kind(kind: &[u8]) -> Self {
        let row = TYPES.iter().find(|(_, types)| types.iter().any(|t| t.as_bytes() == kind));
        row.map_or(Self::Unread, |(issue, _)| *issue)
    }
}

/// The entities of a type.
#[derive(Debug)]
struct Affected {
    count: u64,
    /// The name of the first.
    first: String,
}

/// Most types of one issue that are told apart; only files made to have more do.
const MAX_TYPES: usize = 40;

/// Counts per issue and type.
#[derive(Debug, Default)]
pub(super) struct Tally([BTreeMap<String, Affected>; ISSUES.len()]);

impl Tally {
    /// Counts one more of a type; `name` is asked for the entity's name only the first time.
    pub(super) fn add(&mut self, issue: Issue, what: &str, name: impl FnOnce() -> String) {
        let types = &mut self.0[issue as usize];
        let what = if types.len() < MAX_TYPES || types.contains_key(what) { what } else { "others" };
        match types.get_mut(what) {
            Some(affected) => affected.count += 1,
            None => drop(types.insert(what.to_owned(), Affected { count: 1, first: name() })),
        }
    }

    /// Issue, type, count and first entity of everything.
    #[cfg(test)]
    pub(super) fn rows(&self) -> impl Iterator<Item = (&'static str, &str, u64, &str)> {
        let rows = self.0.iter().zip(ISSUES);
        rows.flat_map(|(types, row)| types.iter().map(move |(what, a)| (row.code, &**what, a.count, &*a.first)))
    }

    /// One message per issue that was met: errors into `errors`, warnings into `notes`.
    pub(super) fn messages(&self, path: &str, marking: &Marking, errors: &mut Vec<Diag>, notes: &mut Vec<Diag>) {
        for IssueRow { issue, weight, code, sentence, hint } in ISSUES {
            let types = &self.0[issue as usize];
            let Some((_, first_type)) = types.first_key_value() else { continue };
            let list: Vec<String> = types
                .iter()
                .map(|(what, Affected { count, first })| format!("{count} {what} (first: {first})"))
                .collect();
            let what = format!("entities {sentence}");
            let list = format!(": {}", list.join(", "));
            let place = Place::Element { path: path.to_owned(), element: first_type.first.clone() };
            match weight {
                Refused => {
                    let way = if marking.is_lenient { "" } else { ", or leave out their layer by except" };
                    let d = marking.unmarkable(code, &what, ", and are not marked", &list, &format!("{hint}{way}"));
                    if marking.is_lenient { &mut *notes } else { &mut *errors }.push(d.at(place));
                }
                Warned => notes.push(Diag::warning(code, what + &list).at(place).hint(hint)),
            }
        }
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

    #[test]
    fn types_are_listed_with_count_and_first_entity_and_are_bounded() {
        let mut tally = Tally::default();
        for (what, name) in [("TEXT", "TEXT 1F"), ("MTEXT", "MTEXT 20"), ("TEXT", "TEXT 21")] {
            tally.add(Issue::of_kind(what.as_bytes()), what, || name.to_owned());
        }
        (0..1000).for_each(|i| tally.add(Issue::of_kind(b"NEW"), &format!("NEW{i}"), String::new));
        let (mut errors, mut warnings) = (Vec::new(), Vec::new());
        let lenient = Marking { is_lenient: true, ..Marking::default() };
        tally.messages("a.dxf", &lenient, &mut errors, &mut warnings);
        tally.messages("a.dxf", &Marking::default(), &mut errors, &mut Vec::new());
        assert_eq!(errors.len(), 2);
        assert_eq!(warnings.len(), 2);
        assert_eq!(
            warnings[0].message,
            "entities of text have no outlines, and are not marked: 1 MTEXT (first: MTEXT 20), 2 TEXT (first: TEXT 1F)"
        );
        assert_eq!(tally.rows().filter(|r| r.0 == "dxf-unread").count(), MAX_TYPES + 1);
        assert_eq!(tally.rows().map(|r| r.2).sum::<u64>(), 1003);
    }
}
