//! `once`, `coverage`: what marks share of a stroke, and what they leave.

use super::track::{Stroke, Trace};
use crate::verify::depth::{Ground, Line, Scratch, Slope};
use crate::verify::facts::Facts;
use crate::verify::proof::{Lengths, Rule};

/// What marks may share or leave at a cut, nm: each end may stray by what samples are rounded and merged.
const CUT: f64 = 200.0;

/// What marks cover of one stroke.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cover {
    pub(super) stroke: u32,
    pub(super) from: f64,
    pub(super) to: f64,
}

/// Adds what a mark covers, of a closed stroke in two pieces where it runs over its seam.
pub(super) fn add(stroke: u32, line: &Stroke, trace: &Trace, out: &mut Vec<Cover>) {
    let (from, to) = (trace.from.min(trace.to), trace.from.max(trace.to));
    let length = line.len();
    if !line.is_closed() {
        out.push(Cover { stroke, from: from.max(0.0), to: to.min(length) });
        return;
    }
    let (first, last) = ((from / length).floor() as i64, (to / length).ceil() as i64);
    for turn in first..last {
        let shift = turn as f64 * length;
        let (from, to) = ((from - shift).max(0.0), (to - shift).min(length));
        if to > from {
            out.push(Cover { stroke, from, to });
        }
    }
}

/// Holds what covers one stroke, in the order of its places.
pub(super) struct Holder<'a> {
    pub(super) ground: &'a Ground,
    pub(super) facts: &'a Facts,
    pub(super) scratch: Scratch,
    pub(super) lengths: Lengths,
}

impl Holder<'_> {
    pub(super) fn stroke(&mut self, line: &Stroke, covers: &[Cover], name: &str, once: &mut Rule, coverage: &mut Rule) {
        self.lengths.texture_mm += line.len() / 1e6;
        once.checked += covers.len() as u64;
        let mut reached = 0.0f64;
        for cover in covers {
            self.lengths.mark_mm += (cover.to - cover.from) / 1e6;
            let shared = reached.min(cover.to) - cover.from;
            if shared > 0.0 {
                self.lengths.overlap_mm += shared / 1e6;
            }
            if shared > CUT + self.facts.overlap_nm {
                let text = format!("{:.6} mm of {name} are marked twice", shared / 1e6);
                once.broken("", place(line.at(cover.from)), text);
            }
            self.gap(line, reached, cover.from, name, coverage);
            reached = cover.to.max(reached);
        }
        self.gap(line, reached, line.len(), name, coverage);
    }

    /// A stretch that nobody marks: it must be off the part, too steep or too short.
    fn gap(&mut self, line: &Stroke, from: f64, to: f64, name: &str, coverage: &mut Rule) {
        if to <= from {
            return;
        }
        coverage.checked += 1;
        let side = self.ground.reach();
        let run = self.open(line, from, to, 0.0, true);
        if run.0 <= self.allowed() {
            return;
        }
        // On an edge either side may be right.
        let other = [side, -side].map(|s| self.open(line, from, to, s, false).0);
        if other.iter().all(|&r| r > self.allowed()) {
            let text = format!("{:.6} mm of {name} are not marked", run.0 / 1e6);
            coverage.broken("", place(run.1), text);
        }
    }

    fn allowed(&self) -> f64 {
        (2.0 * CUT + self.ground.grain()).max(2.0 * self.facts.min_mark_nm)
    }

    /// The longest stretch of a gap that could be marked, and where it begins; `count` says whether it counts
    /// for the lengths.
    fn open(&mut self, line: &Stroke, from: f64, to: f64, side: f64, count: bool) -> (f64, [f64; 2]) {
        let (mut run, mut begins) = (0.0, line.at(from));
        let mut longest = (0.0, begins);
        let Self { ground, scratch, lengths, .. } = self;
        for (a, b) in line.between(from, to) {
            if a == b {
                continue;
            }
            let segment = Line::new(a, b);
            ground.along(&segment.part([0.0, segment.len], side), scratch, |piece| {
                let mm = if count { piece.len() / 1e6 } else { 0.0 };
                lengths.skipped_mm += mm;
                match piece.sheet.map(|s| s.slope) {
                    None => lengths.skipped_off_part_mm += mm,
                    Some(Slope::Steep | Slope::Doubtful) => lengths.skipped_steep_mm += mm,
                    Some(Slope::Gentle) => lengths.skipped_small_mm += mm,
                }
                if piece.sheet.is_some_and(|s| s.slope == Slope::Gentle) {
                    if run == 0.0 {
                        begins = segment.at(piece.d[0]);
                    }
                    run += piece.len();
                    if run > longest.0 {
                        longest = (run, begins);
                    }
                } else if piece.len() > ground.grain() {
                    run = 0.0;
                }
            });
        }
        longest
    }
}

fn place([x, y]: [f64; 2]) -> String {
    format!("part at ({:.6}, {:.6}) mm", x / 1e6, y / 1e6)
}
