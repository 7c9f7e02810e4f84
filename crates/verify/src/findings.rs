//! The rules and figures of a proof while they are being found.

use std::ops::{Index, IndexMut};

use super::proof::{Input, Lengths, NotProved, Proof, Rule};

/// A rule. What each asks depends on the kind of job, see [`STEPPED`] and [`ON_THE_FLY`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum RuleCode {
    Hash,
    Agreement,
    Depth,
    Field,
    Travel,
    Clearance,
    Limits,
    Laser,
    Position,
    Focus,
    Surface,
    Dose,
    Fill,
    Drawing,
    Bitmap,
    Mask,
    Curves,
    Marked,
    Measured,
    Draped,
    Source,
    Once,
    Coverage,
    Summary,
}

/// The rules of one kind of job in the order in which its proof lists them: each with its name and what it asks.
type RuleTable = [(RuleCode, &'static str, &'static str)];

/// The demand of the rule `curves`, of stepped and of on-the-fly jobs.
const CURVES: &str = "space curves are those of their file and lie on the surface";

/// The rules of a stepped job.
pub(super) const STEPPED: &RuleTable = &[
    (RuleCode::Hash, "hash", "every file is as listed, none is unlisted, and the inputs are unchanged"),
    (RuleCode::Agreement, "agreement", "all files that describe the program agree"),
    (RuleCode::Depth, "depth", "every mark lies within the depth of focus of its block"),
    (RuleCode::Field, "field", "every mark lies in the usable scan field"),
    (RuleCode::Travel, "travel", "every stage position is that of its block, within travel and on the increment"),
    (RuleCode::Clearance, "clearance", "the head keeps clear of the part in every move"),
    (
        RuleCode::Laser,
        "laser",
        "the laser output is off during every stage move, and the stage settles before the next mark",
    ),
    (RuleCode::Surface, "surface", "no mark lies off the part or on a slope beyond the limit"),
    (RuleCode::Dose, "dose", "pens compensate for the slope under their marks as the job specifies"),
    (RuleCode::Fill, "fill", "lines along contours keep their pitch and fill the job's sections"),
    (
        RuleCode::Drawing,
        "drawing",
        "SVG drawings are marked where they show something, with the pen of its colour or label",
    ),
    (RuleCode::Bitmap, "bitmap", "bitmaps are marked where they are dark, and as densely"),
    (RuleCode::Mask, "mask", "what inside and outside leave of a texture is marked, and nothing else"),
    (RuleCode::Curves, "curves", CURVES),
    (RuleCode::Marked, "marked", "what jobs before have marked is left out, and nothing else"),
    (RuleCode::Measured, "measured", "the part lies where its measured points have it"),
    (RuleCode::Draped, "draped", "on a measured part every stroke lies where the part takes it"),
    (RuleCode::Source, "source", "every mark is the piece of texture that it claims to be"),
    (RuleCode::Once, "once", "nothing is marked twice in a pass except declared overlaps"),
    (RuleCode::Coverage, "coverage", "all texture is marked where the part can be marked"),
    (RuleCode::Summary, "summary", "lengths, counts, times and slopes are as stated"),
];

/// The rules of a job on the fly.
pub(super) const ON_THE_FLY: &RuleTable = &[
    (RuleCode::Hash, "hash", "every file is as listed, none is unlisted, and the inputs are unchanged"),
    (RuleCode::Agreement, "agreement", "the programs agree with each other, with the manifest and with the job"),
    (RuleCode::Limits, "limits", "all axes and marks keep their limits at every sample"),
    (RuleCode::Laser, "laser", "the laser is off outside marks, and is switched off immediately at the end"),
    (RuleCode::Position, "position", "every mark lies on the stroke that it claims to be, within 1 um"),
    (RuleCode::Focus, "focus", "every mark is in focus and within the incidence limit"),
    (RuleCode::Surface, "surface", "no beam of a mark misses the part"),
    (RuleCode::Once, "once", "nothing is marked twice except declared overlaps"),
    (RuleCode::Coverage, "coverage", "all texture is marked where the part can be marked"),
    (RuleCode::Curves, "curves", CURVES),
    (RuleCode::Summary, "summary", "counts, times and lengths are as stated"),
];

/// Rules and figures of one job.
pub(super) struct Findings {
    pub(super) rules: Rules,
    pub(super) stops: usize,
    /// Fragments of a stepped job, marks of one on the fly.
    pub(super) fragments: usize,
    pub(super) lengths: Lengths,
    /// How far lengths of what is not marked may be off where corners of facets are welded; on the fly.
    pub(super) doubt_mm: f64,
    pub(super) worst_defocus_um: f64,
    pub(super) worst_incidence_deg: f64,
    /// On the fly.
    pub(super) worst_position_um: Option<f64>,
    pub(super) against: Vec<Input>,
    pub(super) not_proved: Vec<NotProved>,
}

impl Findings {
    pub(super) fn new(rules: &RuleTable) -> Self {
        Self {
            rules: Rules(rules.iter().map(|&(code, name, what)| (code, Rule::new(name, what))).collect()),
            stops: 0,
            fragments: 0,
            lengths: Lengths::default(),
            doubt_mm: 0.0,
            worst_defocus_um: 0.0,
            worst_incidence_deg: 0.0,
            worst_position_um: None,
            against: Vec::new(),
            not_proved: Vec::new(),
        }
    }

    pub(super) fn into_proof(self) -> Proof {
        let rules: Vec<Rule> = self.rules.0.into_iter().map(|(_, rule)| rule).collect();
        Proof {
            ok: rules.iter().all(|r| r.ran && r.violated == 0),
            rules,
            stops: self.stops,
            fragments: self.fragments,
            lengths: self.lengths,
            worst_defocus_um: self.worst_defocus_um,
            worst_incidence_deg: self.worst_incidence_deg,
            against: self.against,
            not_proved: self.not_proved,
            worst_position_um: self.worst_position_um,
        }
    }
}

/// The rules of one job, by their code.
pub(super) struct Rules(Vec<(RuleCode, Rule)>);

impl Rules {
    /// Several rules at once, each named once.
    pub(super) fn several<const N: usize>(&mut self, codes: [RuleCode; N]) -> [&mut Rule; N] {
        let places = codes.map(|code| self.place(code));
        self.0.get_disjoint_mut(places).expect("each rule once").map(|(_, rule)| rule)
    }

    fn place(&self, code: RuleCode) -> usize {
        self.0.iter().position(|(own, _)| *own == code).expect("a rule of this kind of job")
    }
}

impl Index<RuleCode> for Rules {
    type Output = Rule;

    fn index(&self, code: RuleCode) -> &Rule {
        &self.0[self.place(code)].1
    }
}

impl IndexMut<RuleCode> for Rules {
    fn index_mut(&mut self, code: RuleCode) -> &mut Rule {
        let place = self.place(code);
        &mut self.0[place].1
    }
}
