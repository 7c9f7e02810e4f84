//! What jobs before have marked is left out, and nothing else.
//!
//! The strokes that are left are made by the compiler's own code, which this rule does not trust. The marks of the jobs
//! before are taken back to the part as designed by this crate's own readers and geometry. Every stroke is held against
//! them: what no piece of it covers has to be marked, within 0.8 um, and no piece of it may lie on a mark within 0.4 um
//! for longer than where lines cross.

use std::collections::HashMap;
use std::ops::Range;

use super::draped::{Along, gaps};
use crate::Drawing;
use crate::proof::Rule;
use terrace_core::geom::P2;
use terrace_core::math;
use terrace_core::program::PenId;

/// How far from a stroke a mark of it may lie, nm, for what is left out; and for what is not.
const LEFT_OUT_NM: f64 = 800.0;
const NOT_LEFT_OUT_NM: f64 = 400.0;

/// Marks are one where less lies between them, nm; as much may be left out beside them.
const APART_NM: f64 = 3_000.0;

/// Where lines cross, one lies on the other for no longer than this, nm.
const CROSSING_NM: f64 = 15_000.0;

/// Marks are taken in pieces of at most this, nm, which is also the side of the cells that they are found by.
const PIECE_NM: f64 = 1e6;

/// A mark of a job before, on the part as designed, nm; one point of a dot.
#[derive(Clone)]
pub(crate) struct Mark {
    /// Its pen in this job.
    pub(crate) pen: PenId,
    pub(crate) points: Vec<[f64; 2]>,
}

/// The strokes of a texture, and what is left of each.
pub(crate) struct Strokes<'a> {
    pub(crate) whole: &'a Drawing<'a>,
    pub(crate) left: &'a Drawing<'a>,
    pub(crate) pieces: &'a dyn Fn(usize) -> Range<usize>,
}

/// Straight pieces of marks, by the cells that they touch.
struct Marks {
    pieces: Vec<(PenId, [[f64; 2]; 2])>,
    dots: Vec<(PenId, [f64; 2])>,
    cells: HashMap<[i64; 2], Vec<u32>>,
    sliver: f64,
}

/// Checks all strokes; what is left beside a mark and is not longer than `sliver_nm` may be left out.
pub(crate) fn check(strokes: &Strokes<'_>, marks: &[Mark], sliver_nm: f64, rule: &mut Rule) {
    let marks = Marks::new(marks, sliver_nm);
    let (mut whole, mut piece) = (Vec::new(), Vec::new());
    let mut next = 0;
    for i in 0..strokes.whole.len {
        let pen = (strokes.whole.stroke)(i, &mut whole);
        let range = (strokes.pieces)(i);
        let place = || (strokes.whole.element)(i);
        rule.checked += 1;
        if range.start != next && !range.is_empty() {
            rule.broken("", place(), "its pieces are not those that follow");
            return;
        }
        next = next.max(range.end);
        let mut along = Along::new(&whole);
        let mut left: Vec<[f64; 2]> = Vec::new();
        for k in range {
            if (strokes.left.stroke)(k, &mut piece) != pen {
                rule.broken("", place(), "a piece of it has another pen");
            }
            let ends = piece.iter().map(|p| along.follow([p.x as f64, p.y as f64])).collect::<Option<Vec<f64>>>();
            match ends.as_deref() {
                Some([first, .., last]) if last > first => left.push([*first, *last]),
                Some([_]) if whole.len() == 1 => left.push([0.0; 2]),
                _ => rule.broken("", place(), "a piece of it does not lie along it"),
            }
        }
        if let Err(text) = marks.judge(pen, &whole, &left) {
            rule.broken("", place(), text);
        }
    }
    rule.require("", next == strokes.left.len, "there are strokes that are no piece of the texture");
}

impl Marks {
    fn new(marks: &[Mark], sliver: f64) -> Self {
        let mut it = Self { pieces: Vec::new(), dots: Vec::new(), cells: HashMap::new(), sliver };
        for Mark { pen, points } in marks {
            if let [dot] = points[..] {
                it.dots.push((*pen, dot));
            }
            for ends in points.windows(2) {
                for ends in cut(ends[0], ends[1]) {
                    for cell in cells(ends, 0.0) {
                        it.cells.entry(cell).or_default().push(it.pieces.len() as u32);
                    }
                    it.pieces.push((*pen, ends));
                }
            }
        }
        it
    }

    /// Whether what is left of a stroke is what marks do not cover.
    fn judge(&self, pen: PenId, points: &[P2], left: &[[f64; 2]]) -> Result<(), String> {
        if let &[dot] = points {
            let at = [dot.x as f64, dot.y as f64];
            let off = self.dots.iter().filter(|(own, _)| *own == pen).map(|(_, p)| distance(at, *p));
            let off = off.fold(f64::INFINITY, f64::min);
            return match left.is_empty() {
                true if off > LEFT_OUT_NM => Err("a dot is left out that was not marked".to_owned()),
                false if off < NOT_LEFT_OUT_NM => Err("a dot would be marked again".to_owned()),
                _ => Ok(()),
            };
        }
        let whole: f64 = points.windows(2).map(|w| w[0].distance(w[1])).sum();
        let mut at = 0.0;
        let wide = self.covered(pen, points, LEFT_OUT_NM);
        for [from, to] in left.iter().copied().chain([[whole, whole]]) {
            let longest = gaps(&wide, [at, from]).into_iter().map(|[a, b]| b - a).fold(0.0, f64::max);
            if longest > self.sliver + APART_NM {
                return Err(format!("{} of it are left out that were not marked", mm(longest)));
            }
            at = to;
        }
        for [a, b] in self.covered(pen, points, NOT_LEFT_OUT_NM) {
            for [from, to] in left {
                let again = b.min(*to) - a.max(*from);
                if again > CROSSING_NM.min(whole / 2.0) {
                    return Err(format!("{} of it would be marked again", mm(again)));
                }
            }
        }
        Ok(())
    }

    /// The stretches of a stroke that marks of a pen cover within a distance, nm along it.
    fn covered(&self, pen: PenId, points: &[P2], off: f64) -> Vec<[f64; 2]> {
        let mut found = Vec::new();
        let mut start = 0.0;
        for w in points.windows(2) {
            let [a, b] = [w[0], w[1]].map(|p| [p.x as f64, p.y as f64]);
            for ends in cut(a, b) {
                let from = start + distance(a, ends[0]);
                let near = cells(ends, off).filter_map(|cell| self.cells.get(&cell)).flatten();
                let marks = near.map(|&i| self.pieces[i as usize]).filter(|(own, _)| *own == pen);
                found.extend(marks.filter_map(|(_, mark)| beside(ends, mark, off)).map(|s| s.map(|s| from + s)));
            }
            start += distance(a, b);
        }
        found.sort_by(|a: &[f64; 2], b| a[0].total_cmp(&b[0]));
        let mut joined: Vec<[f64; 2]> = Vec::new();
        for [from, to] in found {
            match joined.last_mut() {
                Some(last) if from <= last[1] + APART_NM => last[1] = last[1].max(to),
                _ => joined.push([from, to]),
            }
        }
        joined
    }
}

/// The stretch of a piece of a stroke, nm from its start, that has a mark within a distance, both straight.
fn beside([a, b]: [[f64; 2]; 2], [c, d]: [[f64; 2]; 2], off: f64) -> Option<[f64; 2]> {
    let whole = distance(a, b);
    let (sin, cos) = ((b[1] - a[1]) / whole, (b[0] - a[0]) / whole);
    // In a frame whose x runs along the stroke.
    let turned = |p: [f64; 2]| {
        let [x, y] = [p[0] - a[0], p[1] - a[1]];
        [x * cos + y * sin, y * cos - x * sin]
    };
    let (mut p, mut q) = (turned(c), turned(d));
    if p[0] > q[0] {
        (p, q) = (q, p);
    }
    // Cut to the stroke, then to the band beside it.
    let y = |x: f64| if q[0] > p[0] { p[1] + (q[1] - p[1]) * (x - p[0]) / (q[0] - p[0]) } else { p[1] };
    let along = [p[0].max(0.0), q[0].min(whole)];
    if along[0] >= along[1] {
        return None;
    }
    let ends = along.map(y);
    let [mut from, mut to] = along;
    for limit in [-off, off] {
        let is_beyond = |y: f64| (y - limit) * limit.signum() > 0.0;
        let crossing = along[0] + (along[1] - along[0]) * (limit - ends[0]) / (ends[1] - ends[0]);
        match ends.map(is_beyond) {
            [true, true] => return None,
            [true, false] => from = from.max(crossing),
            [false, true] => to = to.min(crossing),
            [false, false] => {}
        }
    }
    (from < to).then_some([from, to])
}

/// A straight line in pieces.
fn cut(a: [f64; 2], b: [f64; 2]) -> Vec<[[f64; 2]; 2]> {
    let count = (distance(a, b) / PIECE_NM).ceil().max(1.0);
    let at = |i: f64| [0, 1].map(|k| a[k] + (b[k] - a[k]) * i / count);
    (0..count as u32).map(|i| [at(f64::from(i)), at(f64::from(i + 1))]).collect()
}

/// The cells that the box of a line touches, grown by `around`.
fn cells([a, b]: [[f64; 2]; 2], around: f64) -> impl Iterator<Item = [i64; 2]> {
    let range = |k: usize| {
        let cell = |v: f64| (v / PIECE_NM).floor() as i64;
        cell(a[k].min(b[k]) - around)..=cell(a[k].max(b[k]) + around)
    };
    let columns = range(0);
    range(1).flat_map(move |row| columns.clone().map(move |column| [column, row]))
}

fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    math::hypot(b[0] - a[0], b[1] - a[1])
}

fn mm(nm: f64) -> String {
    format!("{:.4} mm", nm / 1e6)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The strokes of a drawing, in mm, all with one pen.
    fn drawing(strokes: &[&[[f64; 2]]]) -> Drawing<'static> {
        let strokes: Vec<Vec<P2>> =
            strokes.iter().map(|s| s.iter().map(|p| P2::from_mm(p[0], p[1]).expect("small")).collect()).collect();
        Drawing {
            len: strokes.len(),
            stroke: Box::new(move |i, out: &mut Vec<P2>| {
                out.clear();
                out.extend_from_slice(&strokes[i]);
                PenId(0)
            }),
            element: Box::new(|i| format!("stroke {i}")),
        }
    }

    fn mark(pen: u16, points: &[[f64; 2]]) -> Mark {
        Mark { pen: PenId(pen), points: points.iter().map(|p| p.map(|mm| mm * 1e6)).collect() }
    }

    /// What is said of the pieces that are left of one stroke, if anything.
    fn said(whole: &[[f64; 2]], left: &[&[[f64; 2]]], marks: &[Mark]) -> Option<String> {
        let mut rule = Rule::new("marked", "");
        let count = left.len();
        let strokes = Strokes { whole: &drawing(&[whole]), left: &drawing(left), pieces: &|_| 0..count };
        check(&strokes, marks, 10_000.0, &mut rule);
        rule.violations.first().map(|v| v.message.clone())
    }

    const LINE: [[f64; 2]; 2] = [[0.0, 0.0], [30.0, 0.0]];

    #[test]
    fn what_marks_cover_is_left_out_and_nothing_else() {
        let done = || vec![mark(0, &[[0.0, 2e-4], [5.0, -2e-4]]), mark(0, &[[12.0, 0.0], [5.0, 0.0]])];
        assert_eq!(said(&LINE, &[&[[12.0, 0.0], [30.0, 0.0]]], &done()), None);
        // Two micrometres at a cut are nothing.
        assert_eq!(said(&LINE, &[&[[12.002, 0.0], [30.0, 0.0]]], &done()), None);
        let told = |left: &[&[[f64; 2]]], text: &str| {
            let said = said(&LINE, left, &done());
            assert!(said.as_ref().is_some_and(|said| said.contains(text)), "{said:?}");
        };
        // Half a spot beside a mark is a sliver.
        assert_eq!(
            said(
                &LINE,
                &[&[[12.0, 0.0], [29.99, 0.0]]],
                &[done(), vec![mark(0, &[[29.999, 0.0], [30.0, 0.0]])]].concat()
            ),
            None
        );
        told(&[&[[12.02, 0.0], [30.0, 0.0]]], "0.0200 mm of it are left out that were not marked");
        told(&[&[[11.9, 0.0], [30.0, 0.0]]], "0.1000 mm of it would be marked again");
        told(&[&LINE], "12.0000 mm of it would be marked again");
        told(&[], "18.0000 mm of it are left out");
        told(&[&[[12.0, 0.0], [20.0, 0.0]]], "10.0000 mm of it are left out");
        told(&[&[[12.0, 0.1], [30.0, 0.1]]], "does not lie along it");
        told(&[&[[30.0, 0.0], [12.0, 0.0]]], "does not lie along it");
    }

    #[test]
    fn marks_of_another_pen_beside_or_across_leave_a_stroke_whole() {
        for other in [
            mark(1, &LINE),
            mark(0, &[[0.0, 0.002], [30.0, 0.002]]),
            mark(0, &[[15.0, -5.0], [15.0, 5.0]]),
            mark(0, &[[15.0, 0.0026], [15.035, -0.118]]),
            mark(0, &[[0.0, -1.0], [30.0, 1.0]]),
        ] {
            assert_eq!(said(&LINE, &[&LINE], &[other]), None);
        }
    }

    #[test]
    fn dots_are_left_out_where_they_were_marked() {
        let dot = [[3.0, 4.0]];
        assert_eq!(said(&dot, &[], &[mark(0, &dot)]), None);
        assert_eq!(said(&dot, &[&dot], &[mark(0, &[[3.0, 4.001]])]), None);
        assert!(said(&dot, &[&dot], &[mark(0, &dot)]).is_some_and(|text| text.contains("marked again")));
        assert!(said(&dot, &[], &[mark(0, &[[3.0, 4.001]])]).is_some_and(|text| text.contains("not marked")));
    }
}
