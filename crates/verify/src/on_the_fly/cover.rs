//! `once`, `coverage`: what marks share of a stroke, and what they leave.

use std::collections::BTreeMap;

use super::track::{Stroke, Trace};
use crate::geometry::{Geometry, Line, Piece, Scratch, Slope};
use crate::job_facts::JobFacts;
use crate::proof::{Lengths, Rule};

/// Length that marks may share or leave at a cut, nm: each end may stray by what samples are rounded and merged, as
/// docs/explanation/verify.md states for ends of pieces.
const CUT: f64 = 200.0;

/// A stretch of a stroke that a mark covers.
#[derive(Clone, Copy, Debug)]
pub(super) struct CoveredStretch {
    pub(super) stroke: u32,
    pub(super) from: f64,
    pub(super) to: f64,
    /// How far both may lie from there where corners of facets are welded, nm.
    pub(super) loose: f64,
}

/// The stretches that a mark covers: of a closed stroke two, where the mark runs over its seam.
pub(super) fn of_trace(stroke: u32, line: &Stroke, trace: &Trace, loose: f64) -> Vec<CoveredStretch> {
    let mut out = between(stroke, line, trace.from.min(trace.to), trace.from.max(trace.to));
    out.iter_mut().for_each(|cover| cover.loose = loose);
    out
}

/// The stretches between two places on a stroke: of a closed one two, where its seam lies between them.
pub(super) fn between(stroke: u32, line: &Stroke, from: f64, to: f64) -> Vec<CoveredStretch> {
    let length = line.len();
    if !line.is_closed() {
        return vec![CoveredStretch { stroke, from: from.max(0.0) + 0.0, to: to.min(length), loose: 0.0 }];
    }
    let (first, last) = ((from / length).floor() as i64, (to / length).ceil() as i64);
    let turns = (first..last).map(|turn| turn as f64 * length);
    turns
        .map(|shift| CoveredStretch {
            stroke,
            from: (from - shift).max(0.0) + 0.0,
            to: (to - shift).min(length),
            loose: 0.0,
        })
        .filter(|cover| cover.to > cover.from)
        .collect()
}

/// The stretches that marks cover. Where a stroke runs back over itself a mark may lie in more than one place. Those
/// that have but one are placed first, then the others, the longest first, each where least is covered already or
/// stated as left out. Marks are cut at the same places of the plan wherever the stroke passes them, but for what is
/// left out, so of two marks over one place the shorter lies within the longer: a place that a mark takes from a longer
/// one would have been free for the longer one, and between marks of one length it does not matter which lies where.
#[derive(Default)]
pub(super) struct Covers {
    sure: Vec<CoveredStretch>,
    /// Of each mark its places, of each place its pieces.
    open: Vec<Vec<Vec<CoveredStretch>>>,
}

impl Covers {
    /// Adds a mark by the places where it may lie.
    pub(super) fn add(&mut self, mut places: Vec<Vec<CoveredStretch>>) {
        match places.len() {
            0 => {}
            1 => self.sure.append(&mut places[0]),
            _ => self.open.push(places),
        }
    }

    /// All, by strokes and places, where the program says that it leaves out some stretches.
    pub(super) fn sorted(self, left_out: &[CoveredStretch]) -> Vec<CoveredStretch> {
        // By where they begin; places are not negative (nor -0), and so their bits are in the order of their values.
        let key = |c: &CoveredStretch| (c.stroke, c.from.to_bits(), c.to.to_bits());
        let sure = self.sure.iter().chain(left_out);
        let mut taken: BTreeMap<(u32, u64, u64), CoveredStretch> = sure.map(|c| (key(c), *c)).collect();
        let mut out = self.sure;
        let length = |places: &Vec<Vec<CoveredStretch>>| places[0].iter().map(|c| c.to - c.from).sum::<f64>();
        let mut open = self.open;
        open.sort_by(|a, b| length(b).total_cmp(&length(a)));
        // Greedy, the longest first: the order is right for the reason given at the type. `taken` is ordered by
        // beginnings, so what overlaps a place is found going backwards from its end.
        for places in open {
            let shared = |c: &CoveredStretch, taken: &BTreeMap<(u32, u64, u64), CoveredStretch>| {
                let before = taken.range((c.stroke, 0, 0)..(c.stroke, c.to.to_bits(), 0)).rev();
                let beside = before.map(|(_, t)| t).take_while(|t| t.to > c.from);
                beside.map(|t| t.to.min(c.to) - t.from.max(c.from)).sum::<f64>()
            };
            let cost = |place: &Vec<CoveredStretch>| place.iter().map(|c| shared(c, &taken)).sum::<f64>();
            let Some(best) = places.into_iter().map(|p| (cost(&p), p)).min_by(|a, b| a.0.total_cmp(&b.0)) else {
                continue;
            };
            taken.extend(best.1.iter().map(|c| (key(c), *c)));
            out.extend(best.1);
        }
        out.sort_by_key(key);
        out
    }
}

/// Holds what covers one stroke, in the order of its places.
pub(super) struct CoverageChecker<'a> {
    pub(super) geometry: &'a Geometry,
    pub(super) facts: &'a JobFacts,
    pub(super) scratch: Scratch,
    pub(super) lengths: Lengths,
    /// How far lengths of what is not marked may be off where corners of facets are welded.
    pub(super) doubt_mm: f64,
}

impl CoverageChecker<'_> {
    /// One stroke: what marks cover of it and what the program says it leaves out, both in order.
    pub(super) fn stroke(
        &mut self,
        line: &Stroke,
        covers: &[CoveredStretch],
        left_out: &[CoveredStretch],
        name: &str,
        rules: [&mut Rule; 2],
    ) {
        let [once, coverage] = rules;
        self.lengths.texture_mm += line.len() / 1e6;
        once.checked += covers.len() as u64;
        // How far marks reach, and how loosely that is known.
        let (mut reached, mut loose) = (0.0f64, 0.0);
        for cover in covers {
            self.doubt_mm += 2.0 * cover.loose / 1e6;
            self.lengths.mark_mm += (cover.to - cover.from) / 1e6;
            let shared = reached.min(cover.to) - cover.from;
            if shared > 0.0 {
                self.lengths.overlap_mm += shared / 1e6;
            }
            if shared > CUT + self.facts.overlap_nm + loose + cover.loose {
                let text = format!("{:.6} mm of {name} are marked twice", shared / 1e6);
                once.broken("", place(line.at(cover.from)), text);
            }
            self.gaps(line, [reached, cover.from], loose + cover.loose, left_out, name, coverage);
            if cover.to > reached {
                (reached, loose) = (cover.to, cover.loose);
            }
        }
        self.gaps(line, [reached, line.len()], loose, left_out, name, coverage);
        for out in left_out {
            let shared =
                covers.iter().map(|c| c.to.min(out.to) - c.from.max(out.from) - 2.0 * c.loose).fold(0.0, f64::max);
            if shared > 2.0 * CUT {
                let text = format!("{:.6} mm of {name} are marked although listed in `left_out`", shared / 1e6);
                coverage.broken("", place(line.at(out.from)), text);
            }
        }
    }

    /// A stretch that nobody marks, apart from what of it is stated as left out; none where two marks overlap.
    fn gaps(
        &mut self,
        line: &Stroke,
        [from, to]: [f64; 2],
        loose: f64,
        left_out: &[CoveredStretch],
        name: &str,
        coverage: &mut Rule,
    ) {
        if to <= from {
            return;
        }
        let mut at = from;
        for out in left_out.iter().filter(|o| o.to + 2.0 * CUT > from && o.from - 2.0 * CUT < to) {
            let [begin, end] = [out.from - 2.0 * CUT, out.to + 2.0 * CUT].map(|v| v.clamp(at, to));
            self.gap(line, [at, begin], loose, name, coverage);
            if end > begin {
                self.open(line, begin, end);
            }
            at = end;
        }
        self.gap(line, [at, to], loose, name, coverage);
    }

    /// A stretch that nobody marks: it must be off the part, too steep or too short.
    fn gap(&mut self, line: &Stroke, [from, to]: [f64; 2], loose: f64, name: &str, coverage: &mut Rule) {
        if to <= from {
            return;
        }
        coverage.checked += 1;
        let side = self.geometry.reach();
        let open = self.open(line, from, to);
        let allowed = self.allowed() + loose;
        if open.len <= allowed {
            return;
        }
        // On an edge either side may be right.
        let beside = [side, -side].map(|s| self.open_beside(line, from, to, s).len);
        if beside.iter().all(|&len| len > allowed) {
            let text = format!("{:.6} mm of {name} are not marked", open.len / 1e6);
            coverage.broken("", place(open.begins), text);
        }
    }

    /// How long a stretch may be that could be marked and is not, nm: both its ends may stray, and what is shorter than
    /// twice `min_mark` may be left out, as docs/explanation/verify.md states.
    fn allowed(&self) -> f64 {
        (2.0 * CUT + self.geometry.grain()).max(2.0 * self.facts.min_mark_nm)
    }

    /// The longest stretch between two places that could be marked; all of it counts for the lengths of what is
    /// skipped.
    fn open(&mut self, line: &Stroke, from: f64, to: f64) -> OpenStretch {
        let Self { geometry, scratch, lengths, .. } = self;
        longest_open(geometry, scratch, line, [from, to], 0.0, |piece| {
            let mm = piece.len() / 1e6;
            lengths.skipped_mm += mm;
            match piece.sheet.map(|s| s.slope) {
                None => lengths.skipped_off_part_mm += mm,
                Some(Slope::Steep | Slope::Doubtful) => lengths.skipped_steep_mm += mm,
                Some(Slope::Gentle) => lengths.skipped_small_mm += mm,
            }
        })
    }

    /// The longest stretch that could be marked if the stroke lay `side` nm aside.
    fn open_beside(&mut self, line: &Stroke, from: f64, to: f64, side: f64) -> OpenStretch {
        longest_open(self.geometry, &mut self.scratch, line, [from, to], side, |_| {})
    }
}

/// A stretch of a stroke that could be marked: its length, nm, and where it begins.
struct OpenStretch {
    len: f64,
    begins: [f64; 2],
}

/// The longest stretch between two places that could be marked on the line `side` nm beside the stroke; visits all
/// pieces of that line.
fn longest_open(
    geometry: &Geometry,
    scratch: &mut Scratch,
    line: &Stroke,
    [from, to]: [f64; 2],
    side: f64,
    mut visit: impl FnMut(&Piece),
) -> OpenStretch {
    let (mut run, mut begins) = (0.0, line.at(from));
    let mut longest = OpenStretch { len: 0.0, begins };
    for (a, b) in line.between(from, to) {
        if a == b {
            continue;
        }
        // Runs continue over corners of the stroke; a stretch that may not be marked ends one only if rounding cannot
        // have made it.
        let segment = Line::new(a, b);
        geometry.along(&segment.part([0.0, segment.len], side), scratch, |piece| {
            visit(&piece);
            if piece.sheet.is_some_and(|s| s.slope == Slope::Gentle) {
                if run == 0.0 {
                    begins = segment.at(piece.d[0]);
                }
                run += piece.len();
                if run > longest.len {
                    longest = OpenStretch { len: run, begins };
                }
            } else if piece.len() > geometry.grain() {
                run = 0.0;
            }
        });
    }
    longest
}

fn place([x, y]: [f64; 2]) -> String {
    format!("part at ({:.6}, {:.6}) mm", x / 1e6, y / 1e6)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mark_over_two_legs_is_placed_where_nothing_is_left_out() {
        let cover = |from: f64, to: f64| CoveredStretch { stroke: 0, from, to, loose: 0.0 };
        // A stroke of 1000 there and back, which leaves 300 to 400 out on its way, and 50 less on the way back.
        let mut covers = Covers::default();
        covers.add(vec![vec![cover(400.0, 1600.0)]]);
        covers.add(vec![vec![cover(0.0, 300.0)], vec![cover(1700.0, 2000.0)]]);
        covers.add(vec![vec![cover(0.0, 350.0)], vec![cover(1650.0, 2000.0)]]);
        let left_out = [cover(300.0, 400.0), cover(1600.0, 1650.0)];
        let placed: Vec<[f64; 2]> = covers.sorted(&left_out).iter().map(|c| [c.from, c.to]).collect();
        assert_eq!(placed, [[0.0, 300.0], [400.0, 1600.0], [1650.0, 2000.0]]);
    }
}
