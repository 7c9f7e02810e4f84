//! Faults of a mesh: their kinds, what is said of each, and the rule by which it is mended, reported or refused.
//!
//! Consumes what `topology` counts, with the place of one of each kind. Promises one message per kind.
//! `docs/reference/job-file.md` has the table of the rules.

use terrace_core::diag::{Diag, Place};
use terrace_core::math;

/// What can be wrong with a mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FaultKind {
    /// A facet without area.
    Degenerate,
    /// A facet with the corners of another.
    Duplicate,
    /// A facet that winds against its neighbours.
    Winding,
    /// An edge of three facets or more, but of no more than two without the needles.
    Needle,
    /// An edge of four, six or more facets: bodies that touch along it.
    Touching,
    /// An edge of three, five or more facets: a sheet that hangs on another.
    NonManifold,
    /// A corner on a rim that faces another rim, across a gap no wider than the spot.
    Crack {
        /// The widest one, mm.
        widest_mm: f64,
        /// How many have a corner opposite, and the weld that closes these, mm.
        weldable: (usize, f64),
    },
}

/// Faults of one kind.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fault {
    /// What is wrong.
    pub kind: FaultKind,
    /// How often; of very many cracks at least so often.
    pub count: usize,
    /// Where one of them is: part frame as the file has it, before any turn, mm.
    pub at_mm: [f64; 3],
}

/// What is done about an edge on which a sheet hangs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum NonManifold {
    /// The surface is refused.
    #[default]
    Refuse,
    /// The topmost sheet is marked.
    Topmost,
}

impl FaultKind {
    /// The name in JSON, and the end of the code.
    pub fn name(self) -> &'static str {
        match self {
            Self::Degenerate => "degenerate",
            Self::Duplicate => "duplicate",
            Self::Winding => "winding",
            Self::Needle => "needles",
            Self::Touching => "touching",
            Self::NonManifold => "non-manifold",
            Self::Crack { .. } => "cracks",
        }
    }
}

impl Fault {
    /// What is wrong, with its count and place; `unit` is that of the places, "mm" if it is known.
    pub fn text(&self, unit: &str) -> String {
        let n = self.count;
        let words = |one: &'static str, many: &'static str| if n == 1 { one } else { many };
        let what = match self.kind {
            FaultKind::Degenerate => format!("{n} {} without area", words("facet", "facets")),
            FaultKind::Duplicate => format!("{n} {} the corners of another", words("facet has", "facets have")),
            FaultKind::Winding => format!("{n} {} against the neighbours", words("facet winds", "facets wind")),
            FaultKind::Needle => {
                format!(
                    "{n} {} facets thinner than 0.5 um or the weld",
                    words("edge joins surplus", "edges join surplus")
                )
            }
            FaultKind::Touching => format!("{n} {} four facets or more", words("edge joins", "edges join")),
            FaultKind::NonManifold => {
                let joins = words("edge joins", "edges join");
                format!("{n} {joins} three facets, or another odd number: a sheet hangs there")
            }
            FaultKind::Crack { widest_mm, .. } => format!(
                "{n} {} another rim across a crack up to {} {unit} wide",
                words("corner on a rim faces", "corners on rims face"),
                three_digits(widest_mm)
            ),
        };
        let [x, y, z] = self.at_mm;
        format!("{what}; {} at ({x:.3}, {y:.3}, {z:.3}) {unit}", words("it is", "one is"))
    }

    /// What the compiler says of it: its rule.
    pub(super) fn diag(&self, place: Place, rule: NonManifold) -> Diag {
        let text = self.text("mm");
        let said = |done: &str| format!("{text}; {done}");
        const TOPMOST: &str = "the topmost sheet is marked";
        const REPAIR: &str = "repair the mesh in the program that made it";
        let d = match self.kind {
            FaultKind::Degenerate => {
                Diag::warning("surface-degenerate", said("left out")).hint("they cannot carry texture")
            }
            FaultKind::Duplicate => {
                Diag::warning("surface-duplicate", said("left out")).hint("the lens sees no difference")
            }
            FaultKind::Winding => Diag::warning("surface-winding", said("the topmost sheet is marked all the same"))
                .hint("nothing changes, but the file may be damaged in other ways"),
            FaultKind::Needle => Diag::warning("surface-needles", said(TOPMOST)).hint("they hide next to nothing"),
            FaultKind::Touching => {
                Diag::warning("surface-touching", said(TOPMOST)).hint("fine where bodies touch along an edge")
            }
            FaultKind::NonManifold if rule == NonManifold::Refuse => Diag::input("surface-non-manifold", text)
                .hint(format!("{REPAIR}; surface.non_manifold = \"topmost\" marks the topmost sheet")),
            FaultKind::NonManifold => {
                Diag::warning("surface-non-manifold", said(TOPMOST)).hint("check what the hanging sheet hides")
            }
            FaultKind::Crack { weldable: (corners, weld_mm), .. } => {
                let weld = format!("surface.weld = \"{} um\" closes", microns(weld_mm));
                let hint = if corners == self.count {
                    format!("{weld} them")
                } else if corners > 0 {
                    format!("{weld} {corners} of them; the others face no corner: {REPAIR}")
                } else {
                    format!("the corners are too far from each other to be welded: {REPAIR}")
                };
                Diag::warning("surface-cracks", said("marks end on one side and begin on the other")).hint(hint)
            }
        };
        d.at(place)
    }
}

/// A length with three digits.
fn three_digits(v: f64) -> String {
    let behind = (2.0 - math::log10(v).floor()).clamp(0.0, 12.0) as usize;
    format!("{v:.behind$}")
}

/// A length in um, rounded up to one digit behind the point.
fn microns(mm: f64) -> f64 {
    (mm * 1e4).ceil() / 10.0
}
