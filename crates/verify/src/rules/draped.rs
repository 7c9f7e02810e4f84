//! Strokes on a measured part: each lies where the part takes it, and what is left out cannot be marked.
//!
//! The strokes as they lie are made by the compiler's own code, which this rule does not trust: every place of theirs is
//! taken back to the part as designed, by the file's own facets and the pose that `measured` has proved, and must lie on
//! the designed stroke. What of that stroke no piece covers must be off the part, hidden, or beside it.

use crate::Drawing;
use crate::geometry::{Geometry, Line, Pose, Scratch, Sheet};
use crate::proof::Rule;
use std::ops::Range;
use terrace_core::geom::P2;
use terrace_core::math;

/// How far a place may lie from its stroke, nm: strokes are simplified to 200 nm, and rounded.
const OFF_NM: f64 = 400.0;

/// A place is hidden or beside its sheet where heights differ by so much, nm.
const OTHER_SHEET_NM: f64 = 4_000.0;

/// What a piece may leave of a stroke at a step or a rim, nm, along it.
const LEFT_NM: f64 = 5_000.0;

/// A measured part.
pub(crate) struct LyingPart<'a> {
    /// The part as designed, turned as the job says.
    pub(crate) designed: &'a Geometry,
    /// As it lies.
    pub(crate) lying: &'a Geometry,
    /// From one to the other.
    pub(crate) pose: Pose,
}

/// The strokes of a pass as designed and as they lie.
pub(crate) struct Strokes<'a> {
    pub(crate) designed: &'a Drawing<'a>,
    pub(crate) lying: &'a Drawing<'a>,
    /// The strokes that are left of one.
    pub(crate) pieces: &'a dyn Fn(usize) -> Range<usize>,
}

/// Checks all strokes of a pass.
pub(crate) fn check(part: &LyingPart<'_>, strokes: &Strokes<'_>, rule: &mut Rule) {
    rule.ran = true;
    let mut checker = Checker { part, scratch: Scratch::default(), lying_scratch: Scratch::default() };
    let (mut designed, mut piece) = (Vec::new(), Vec::new());
    let mut next = 0;
    for i in 0..strokes.designed.len {
        let pen = (strokes.designed.stroke)(i, &mut designed);
        let range = (strokes.pieces)(i);
        let place = || (strokes.designed.element)(i);
        if range.start != next && !range.is_empty() {
            rule.broken("", place(), "its pieces are not those that follow");
            return;
        }
        next = next.max(range.end);
        let mut along = Along::new(&designed);
        let mut covered = Vec::new();
        for k in range {
            let own = (strokes.lying.stroke)(k, &mut piece);
            if own != pen {
                rule.broken("", place(), "a piece of it has another pen");
            }
            match checker.piece(&piece, &mut along) {
                Ok(stretch) => covered.push(stretch),
                Err(text) => rule.broken("", place(), text),
            }
            rule.checked += 1;
        }
        if let Err(text) = checker.left(&designed, &covered) {
            rule.broken("", place(), text);
        }
    }
    rule.require("", next == strokes.lying.len, "there are strokes that are no piece of the texture");
}

struct Checker<'a> {
    part: &'a LyingPart<'a>,
    scratch: Scratch,
    lying_scratch: Scratch,
}

fn xy(p: P2) -> [f64; 2] {
    [p.x as f64, p.y as f64]
}

impl Checker<'_> {
    /// The stretch of the designed stroke that a piece covers, nm along it.
    fn piece(&mut self, points: &[P2], along: &mut Along<'_>) -> Result<[f64; 2], String> {
        if let &[dot] = points {
            let sheet = self.top(xy(dot)).ok_or("a dot of it lies off the part")?;
            let back = self.part.pose.back([dot.x as f64, dot.y as f64, sheet.z[0]]);
            let s = along.follow([back[0], back[1]]).ok_or_else(|| far(along.off([back[0], back[1]])))?;
            return Ok([s, s]);
        }
        let mut covered: Option<[f64; 2]> = None;
        for ends in points.windows(2) {
            let line = Line::new(xy(ends[0]), xy(ends[1]));
            for place in self.places(&line) {
                let back = self.part.pose.back(place);
                let at = [back[0], back[1]];
                // Beside a step the sheet that is met first may be another: what lies beside it decides.
                let Some(s) = along.follow(at) else {
                    if self.is_at_step([place[0], place[1]]) {
                        continue;
                    }
                    return Err(far(along.off(at)));
                };
                covered = Some(covered.map_or([s, s], |[from, to]| [from.min(s), to.max(s)]));
            }
        }
        covered.ok_or_else(|| {
            let [x, y] = points[0].mm();
            format!("a piece of it at x {x:.4}, y {y:.4} mm lies off the part")
        })
    }

    /// The places of the part as it lies under a line: at the ends of what lies on one facet. Of a line along a rim, which
    /// may lie beside it by as much as strokes are simplified, those next to it.
    fn places(&mut self, line: &Line) -> Vec<[f64; 3]> {
        let aside = [-line.dir[1], line.dir[0]];
        let mut places = Vec::new();
        for off in [0.0, OFF_NM / 2.0, -OFF_NM / 2.0] {
            let start = [0, 1].map(|k| line.start[k] + off * aside[k]);
            let beside = Line { start, ..*line };
            self.part.lying.along(&beside, &mut self.lying_scratch, |piece| {
                if let Some(sheet) = piece.sheet {
                    for (d, z) in piece.d.into_iter().zip(sheet.z) {
                        let [x, y] = line.at(d);
                        places.push([x, y, z]);
                    }
                }
            });
            if !places.is_empty() {
                break;
            }
        }
        places
    }

    /// The sheet under a point of the part as it lies.
    fn top(&mut self, at: [f64; 2]) -> Option<Sheet> {
        self.part.lying.around(at, &mut self.lying_scratch).into_iter().find_map(|piece| piece.sheet)
    }

    /// Whether heights around a point differ by more than slopes explain: rounding decides there which sheet is met.
    fn is_at_step(&mut self, at: [f64; 2]) -> bool {
        let reach = self.part.lying.grain() + OFF_NM;
        let (mut lo, mut hi, mut gap) = (f64::INFINITY, f64::NEG_INFINITY, false);
        for dir in [[1.0, 0.0], [0.0, 1.0]] {
            let line = Line { start: [at[0] - dir[0] * reach, at[1] - dir[1] * reach], dir, len: 2.0 * reach };
            self.part.lying.along(&line, &mut self.lying_scratch, |piece| match piece.sheet {
                None => gap = true,
                Some(sheet) => {
                    lo = lo.min(sheet.z[0]).min(sheet.z[1]);
                    hi = hi.max(sheet.z[0]).max(sheet.z[1]);
                }
            });
        }
        gap || hi - lo > 2.0 * OTHER_SHEET_NM
    }

    /// Whether what of a stroke is not covered cannot be marked.
    fn left(&mut self, points: &[P2], covered: &[[f64; 2]]) -> Result<(), String> {
        if let &[dot] = points {
            let at = xy(dot);
            return if covered.is_empty() && self.can_be_marked(at) { Err(missing(at)) } else { Ok(()) };
        }
        let mut start = 0.0;
        for ends in points.windows(2) {
            let line = Line::new(xy(ends[0]), xy(ends[1]));
            for [from, to] in gaps(covered, [start, start + line.len]) {
                // Places of the gap but for its ends, where steps and rims lie.
                let inside = [from - start + LEFT_NM, to - start - LEFT_NM];
                if inside[0] >= inside[1] {
                    continue;
                }
                let count = (((inside[1] - inside[0]) / 1e5) as usize).clamp(1, 64);
                for k in 0..=count {
                    let at = line.at(inside[0] + (inside[1] - inside[0]) * k as f64 / count as f64);
                    if self.can_be_marked(at) {
                        return Err(missing(at));
                    }
                }
            }
            start += line.len;
        }
        Ok(())
    }

    /// Whether a place of the part as designed is seen as it lies.
    fn can_be_marked(&mut self, at: [f64; 2]) -> bool {
        let found = self.part.designed.around(at, &mut self.scratch);
        let sheets: Vec<Option<Sheet>> = found.iter().map(|piece| piece.sheet).collect();
        // On a rim, and at a step, rounding decides.
        if sheets.iter().any(Option::is_none) {
            return false;
        }
        let heights = sheets.iter().flatten().flat_map(|sheet| sheet.z);
        let (lo, hi) = heights.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), z| (l.min(z), h.max(z)));
        if hi - lo > OTHER_SHEET_NM {
            return false;
        }
        let Some(Some(sheet)) = sheets.first() else { return false };
        let [x, y, z] = self.part.pose.apply([at[0], at[1], sheet.z[0]]);
        let seen = self.part.lying.around([x, y], &mut self.lying_scratch);
        let mut tops = seen.iter().map(|piece| piece.sheet);
        tops.all(|top| {
            top.is_some_and(|top| {
                let slack = OTHER_SHEET_NM + OFF_NM * top.slope2.sqrt();
                (top.z[0] - z).abs() <= slack && (top.z[1] - z).abs() <= slack + 1e3
            })
        })
    }
}

fn far(off: f64) -> String {
    format!("a place of it lies {:.3} um from its stroke on the part", off / 1e3)
}

fn missing([x, y]: [f64; 2]) -> String {
    format!("it is left out at x {:.4}, y {:.4} mm, where the part shows it", x / 1e6, y / 1e6)
}

/// What stretches leave of a range.
pub(super) fn gaps(covered: &[[f64; 2]], [from, to]: [f64; 2]) -> Vec<[f64; 2]> {
    let mut stretches: Vec<[f64; 2]> = covered.iter().copied().filter(|s| s[1] > from && s[0] < to).collect();
    stretches.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let (mut out, mut at) = (Vec::new(), from);
    for [start, end] in stretches {
        if start > at {
            out.push([at, start]);
        }
        at = at.max(end);
    }
    if at < to {
        out.push([at, to]);
    }
    out
}

/// A stroke that is followed from its start.
pub(super) struct Along<'a> {
    points: &'a [P2],
    /// The segment at hand, where it begins along the stroke, and where the last place lies along it.
    segment: usize,
    start: f64,
    last: f64,
}

impl<'a> Along<'a> {
    pub(super) fn new(points: &'a [P2]) -> Self {
        Self { points, segment: 0, start: 0.0, last: 0.0 }
    }

    /// How far along the stroke a place lies, no nearer to its start than the last one; None where it lies off it.
    pub(super) fn follow(&mut self, at: [f64; 2]) -> Option<f64> {
        if self.points.len() == 1 {
            return (distance(at, xy(self.points[0])) <= OFF_NM).then_some(0.0);
        }
        let (mut k, mut start) = (self.segment, self.start);
        // A place lies on the segment at hand, or on the first after it that it is near to.
        while k + 1 < self.points.len() {
            let (a, b) = (xy(self.points[k]), xy(self.points[k + 1]));
            let (t, off) = on_segment(at, a, b);
            let length = distance(a, b);
            let s = start + t * length;
            if off <= OFF_NM && s >= self.last - 2.0 * OFF_NM {
                // Where the corner is near too, the segment stays at hand.
                (self.segment, self.start, self.last) = (k, start, s.max(self.last));
                return Some(s);
            }
            start += length;
            k += 1;
        }
        None
    }

    /// How far a place lies off the stroke.
    fn off(&self, at: [f64; 2]) -> f64 {
        match self.points {
            [dot] => distance(at, xy(*dot)),
            points => {
                let off = |w: &[P2]| on_segment(at, xy(w[0]), xy(w[1])).1;
                points.windows(2).map(off).fold(f64::INFINITY, f64::min)
            }
        }
    }
}

fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    math::hypot(a[0] - b[0], a[1] - b[1])
}

/// Where on a segment a place is nearest, 0 to 1, and how far off it lies.
fn on_segment(at: [f64; 2], a: [f64; 2], b: [f64; 2]) -> (f64, f64) {
    let d = [b[0] - a[0], b[1] - a[1]];
    let t = ((at[0] - a[0]) * d[0] + (at[1] - a[1]) * d[1]) / (d[0] * d[0] + d[1] * d[1]).max(f64::MIN_POSITIVE);
    let t = t.clamp(0.0, 1.0);
    (t, distance(at, [a[0] + t * d[0], a[1] + t * d[1]]))
}
