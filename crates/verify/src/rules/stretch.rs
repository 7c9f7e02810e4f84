//! Stretches of a polyline on which something is wrong, and whether it stays wrong when the line is
//! moved sideways by as much as rounding can have moved an edge.
//!
//! A mark may lie on a border or along the top of a wall to the last nanometre, which then decides what
//! lies under it. A stretch counts only if it is wrong on the line itself and on both sides, over more
//! than the grain of the geometry; or if an edge lies on the line exactly, and what is topmost on either
//! side of it says so.

use crate::geometry::{Geometry, Line, Piece, Scratch};

/// A part of one segment of a polyline.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stretch {
    pub(super) segment: usize,
    /// nm along the segment.
    pub(super) d: [f64; 2],
    /// Whether it reaches the segment's end.
    pub(super) to_end: bool,
}

impl Stretch {
    pub(super) fn len(&self) -> f64 {
        self.d[1] - self.d[0]
    }
}

/// Stretches that follow each other without a gap.
#[derive(Debug)]
pub(super) struct StretchRun {
    pub(super) stretches: Vec<Stretch>,
    pub(super) len: f64,
}

/// Gaps between stretches up to this, nm, are noise of f64.
const TOUCH: f64 = 1e-2;

/// Adds a stretch of segment `segment`, which is `whole` nm long, to the list.
pub(super) fn note(list: &mut Vec<Stretch>, segment: usize, d: [f64; 2], whole: f64) {
    let to_end = d[1] >= whole - TOUCH;
    match list.last_mut() {
        Some(last) if last.segment == segment && d[0] <= last.d[1] + TOUCH => {
            last.d[1] = last.d[1].max(d[1]);
            last.to_end = to_end;
        }
        _ => list.push(Stretch { segment, d, to_end }),
    }
}

/// Parallels on each side of a line that stand for all within its reach: one alone, at the full reach,
/// would step over the strip between the line and the tip of a notch.
const STEPS: u32 = 4;

/// The parts of a piece on which something is wrong, in order, nm along its line; empty ones say nothing.
pub(super) type Parts = [[f64; 2]; 2];

/// All of a piece or nothing of it.
pub(super) fn whole(p: &Piece, is_wrong: bool) -> Parts {
    [if is_wrong { p.d } else { [0.0; 2] }, [0.0; 2]]
}

/// The runs, longer than the grain, that are `bad` on the line and on all parallels within its reach.
pub(super) fn confirmed(
    list: &[Stretch],
    geometry: &Geometry,
    scratch: &mut Scratch,
    line: impl Fn(usize) -> Line,
    bad: impl Fn(&Piece) -> Parts,
) -> Vec<StretchRun> {
    confirmed_along(list, geometry, scratch, line, |p, _| bad(p))
}

/// A line that is judged in place of a part of a segment.
#[derive(Clone, Copy)]
pub(super) struct Parallel {
    pub(super) segment: usize,
    /// How far along the segment it begins, nm.
    pub(super) from: f64,
    /// How far beside the segment it lies, nm.
    pub(super) side: f64,
}

/// The stretches of [`confirmed`], where what is wrong depends on the place.
pub(super) fn confirmed_along(
    list: &[Stretch],
    geometry: &Geometry,
    scratch: &mut Scratch,
    line: impl Fn(usize) -> Line,
    bad: impl Fn(&Piece, Parallel) -> Parts,
) -> Vec<StretchRun> {
    let grain = geometry.grain();
    let mut kept = Vec::new();
    for run in runs(list).into_iter().filter(|r| r.len > grain) {
        // `left` is what of the stretch is bad on all parallels so far: a place that is good on any of them is allowed.
        for s in run.stretches {
            let line = line(s.segment);
            let mut left = vec![s.d];
            let steps = (1..=STEPS).map(|i| geometry.reach() * f64::from(i) / f64::from(STEPS));
            for side in steps.flat_map(|d| [d, -d]) {
                if left.is_empty() {
                    break;
                }
                let mut moved: Vec<Stretch> = Vec::new();
                let parallel = Parallel { segment: s.segment, from: s.d[0], side };
                geometry.along(&line.part(s.d, side), scratch, |p| {
                    for d in bad(&p, parallel).into_iter().filter(|d| d[0] < d[1]) {
                        note(&mut moved, 0, d.map(|d| d + s.d[0]), line.len);
                    }
                });
                left = common(&left, &moved);
            }
            left.extend(along_edges(&s, &line, geometry, scratch, &bad));
            left.sort_by(|a, b| a[0].total_cmp(&b[0]));
            left.into_iter().for_each(|d| note(&mut kept, s.segment, d, line.len));
        }
    }
    runs(&kept).into_iter().filter(|r| r.len > grain).collect()
}

/// The parts of a stretch that are bad along an edge that lies on the line as exactly as f64 holds: both its sides have
/// been compared, and no rounding is left that could show another facet.
fn along_edges(
    s: &Stretch,
    line: &Line,
    geometry: &Geometry,
    scratch: &mut Scratch,
    bad: &impl Fn(&Piece, Parallel) -> Parts,
) -> Vec<[f64; 2]> {
    let mut found = Vec::new();
    if geometry.is_exact() {
        geometry.along(&line.part(s.d, 0.0), scratch, |p| {
            if p.is_along_edge {
                let parallel = Parallel { segment: s.segment, from: s.d[0], side: 0.0 };
                let parts = bad(&p, parallel).into_iter().filter(|d| d[0] < d[1]);
                found.extend(parts.map(|d| d.map(|d| d + s.d[0])));
            }
        });
    }
    found
}

impl StretchRun {
    /// Its beginning, of this length at most.
    pub(super) fn begin(&self, most: f64) -> Option<Self> {
        let mut begin = Self { stretches: Vec::new(), len: 0.0 };
        for &s in &self.stretches {
            let len = s.len().min(most - begin.len);
            begin.stretches.push(Stretch { d: [s.d[0], s.d[0] + len], to_end: s.to_end && len == s.len(), ..s });
            begin.len += len;
            if begin.len >= most {
                break;
            }
        }
        (begin.len > 0.0).then_some(begin)
    }

    /// Whether the other run lies within this one.
    pub(super) fn holds(&self, other: &Self) -> bool {
        let place = |s: &Stretch, k: usize| (s.segment, s.d[k]);
        let ends = |run: &Self| Some((place(run.stretches.first()?, 0), place(run.stretches.last()?, 1)));
        ends(self).zip(ends(other)).is_some_and(|(a, b)| a.0 <= b.0 && b.1 <= a.1)
    }
}

/// Joins stretches that follow each other.
pub(super) fn runs(list: &[Stretch]) -> Vec<StretchRun> {
    let mut out: Vec<StretchRun> = Vec::new();
    for &s in list {
        if let Some(run) = out.last_mut()
            && let Some(last) = run.stretches.last()
            && last.to_end
            && s.segment == last.segment + 1
            && s.d[0] <= TOUCH
        {
            run.len += s.len();
            run.stretches.push(s);
        } else {
            out.push(StretchRun { stretches: vec![s], len: s.len() });
        }
    }
    out
}

fn common(a: &[[f64; 2]], b: &[Stretch]) -> Vec<[f64; 2]> {
    let mut out = Vec::new();
    for x in a {
        for y in b {
            let d = [x[0].max(y.d[0]), x[1].min(y.d[1])];
            if d[0] < d[1] {
                out.push(d);
            }
        }
    }
    out
}
