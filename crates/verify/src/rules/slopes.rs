//! How the surface file's own facets lie under the marks of a block: bounds of the mean and of the least cosine of
//! the angle between beam and surface, and of the dose.
//!
//! A mark that runs along an edge may have been planned on either facet next to it: ends of marks and vertices of the
//! mesh are each rounded to the grid. So every stretch of a mark has the lowest and the highest cosine of all that lies
//! within the reach of the geometry next to it, and the mean of the block lies between the integrals of both. A stretch
//! away from edges has one cosine, known to the rounding of its facet's vertices.

use super::dose;
use crate::geometry::{Geometry, Line, Piece, Scratch, Slope};
use crate::job_facts::JobFacts;
use crate::read::program::ProgramFile;
use terrace_core::geom::FieldPoint;
use terrace_core::math;
use terrace_core::program::{Block, Stroke};
use terrace_input::job::Compensate;

/// Both ends of a line are rounded in the plane, each by half the diagonal of the grid (0.71 nm), so lengths by which
/// means are weighed are off by at most this, nm.
const ROUNDED: f64 = 1.5;

/// Parallels on each side of a mark that stand for all within its reach.
const STEPS: u32 = 2;

/// Lowest and highest that a figure may be.
type Range = [f64; 2];

/// Mean and least, each as a range.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bounds {
    /// Cosine of the angle between beam and surface.
    pub(super) cos: [Range; 2],
    /// Dose, 1 as on a level surface with the job's own pen.
    pub(super) dose: [Range; 2],
}

/// A stretch of a line, nm along it, and the cosines that it may have.
#[derive(Clone, Copy, Debug, PartialEq)]
struct CosStretch {
    d: [f64; 2],
    cos: Range,
}

/// The slopes under one mark; lengths in nm.
#[derive(Clone, Copy)]
struct MarkSlopes {
    length: f64,
    /// By how much the length may be off.
    off: f64,
    /// Integral of the cosine over the length.
    sum: Range,
    least: Range,
    /// Lowest and highest cosine.
    extent: Range,
    /// Cosines of the stretch before.
    before: Option<Range>,
}

impl MarkSlopes {
    const NONE: Self = Self {
        length: 0.0,
        off: 0.0,
        sum: [0.0; 2],
        least: [1.0, f64::INFINITY],
        extent: [f64::INFINITY, f64::NEG_INFINITY],
        before: None,
    };

    /// Adds the next stretch of a line.
    fn add_stretch(&mut self, cos: Range, len: f64, geometry: &Geometry) {
        let grain = geometry.grain();
        // Where the mark goes from one facet to the next is known to the grain, and a facet met for less than that
        // may be met or not: so much of either facet may be the other's.
        for k in 0..2 {
            let step = self.before.map_or(0.0, |b| (b[k] - cos[k]).abs() * grain);
            self.sum[k] += cos[k] * len + if k == 0 { -step } else { step };
        }
        self.before = Some(cos);
        // A mark on a tilted part runs off its line by at most `beside`, there and back: it is longer by that.
        self.off += math::hypot(len, 2.0 * geometry.beside()) - len;
        self.extent = [self.extent[0].min(cos[0]), self.extent[1].max(cos[1])];
        self.least[0] = self.least[0].min(cos[0]);
        // A facet that is met for less than the grain may not have counted where the job was planned.
        if len > grain {
            self.least[1] = self.least[1].min(cos[1]);
        }
    }

    /// Ends a line of this length.
    fn end_line(&mut self, len: f64) {
        self.length += len;
        self.off += ROUNDED;
    }
}

/// The slopes under the marks of a block, stroke by stroke. Pairs are of cosine and dose.
struct SlopeSums {
    length: f64,
    /// By how much the length may be off.
    off: f64,
    dots: f64,
    /// Integrals over the lines, and sums over the dots.
    lines: [Range; 2],
    of_dots: [Range; 2],
    least: [Range; 2],
    /// Lowest and highest of all marks.
    extent: [Range; 2],
}

impl SlopeSums {
    const NONE: Self = Self {
        length: 0.0,
        off: 0.0,
        dots: 0.0,
        lines: [[0.0; 2]; 2],
        of_dots: [[0.0; 2]; 2],
        least: [[f64::INFINITY; 2]; 2],
        extent: [[f64::INFINITY, f64::NEG_INFINITY]; 2],
    };

    /// Adds a stroke whose pen raises the dose by `gain`.
    fn add(&mut self, mark: &MarkSlopes, gain: f64) {
        let least = [mark.least[0], mark.least[1].min(1.0)];
        self.length += mark.length;
        self.off += mark.off;
        for (k, by) in [1.0, gain].into_iter().enumerate() {
            for (end, least) in least.into_iter().enumerate() {
                self.lines[k][end] += mark.sum[end] * by;
                self.least[k][end] = self.least[k][end].min(least * by);
            }
            self.extent[k] = [self.extent[k][0].min(mark.extent[0] * by), self.extent[k][1].max(mark.extent[1] * by)];
        }
    }

    /// Adds a dot, whose cosine lies in this range.
    fn add_dot(&mut self, cos: Range, gain: f64) {
        self.dots += 1.0;
        for (sum, by) in self.of_dots.iter_mut().zip([1.0, gain]) {
            *sum = [sum[0] + cos[0] * by, sum[1] + cos[1] * by];
        }
        self.add(&MarkSlopes { least: cos, extent: cos, ..MarkSlopes::NONE }, gain);
    }

    /// None where there are no marks.
    fn bounds(self) -> Option<Bounds> {
        let Self { length, off, dots, lines, of_dots, least, extent } = self;
        // A mean is a sum of shares: where shares of all in all `off` go from one place to another it changes by at
        // most that much of what these differ by.
        let mean = |[lo, hi]: Range, [lowest, highest]: Range| {
            let by = off / length * (highest - lowest);
            [lo / length - by, hi / length + by]
        };
        // Dots count where there are no lines.
        let mean_of_dots = |[lo, hi]: Range| [lo / dots, hi / dots];
        let means = match (length > 0.0, dots > 0.0) {
            (true, _) => [mean(lines[0], extent[0]), mean(lines[1], extent[1])],
            (false, true) => of_dots.map(mean_of_dots),
            (false, false) => return None,
        };
        Some(Bounds { cos: [means[0], least[0]], dose: [means[1], least[1]] })
    }
}

/// Sums up the slopes under the marks of an upright block while their depth is measured, so that marks are followed
/// once.
pub(super) struct BlockSlopes {
    sums: SlopeSums,
    stroke: MarkSlopes,
    /// The last stretch of the line at hand: it ends with its piece, or with the line where no piece follows.
    open: Option<FacetStretch>,
    /// Whether a stretch has no facet under it that may be marked: what lies beside it is not looked at here.
    is_unknown: bool,
}

impl BlockSlopes {
    pub(super) const NONE: Self =
        Self { sums: SlopeSums::NONE, stroke: MarkSlopes::NONE, open: None, is_unknown: false };

    /// Adds the next piece of a line.
    pub(super) fn piece(&mut self, p: &Piece, geometry: &Geometry) {
        let from = self.open.map_or(0.0, |open| open.d[1]);
        if p.d[1] > from {
            self.close(geometry);
            self.open = Some(FacetStretch { d: [from, p.d[1]], cos: cosines(p, geometry) });
        }
    }

    /// Ends a line of this length.
    pub(super) fn line(&mut self, len: f64, geometry: &Geometry) {
        match &mut self.open {
            Some(open) => open.d[1] = len,
            none => *none = Some(FacetStretch { d: [0.0, len], cos: None }),
        }
        self.close(geometry);
        self.stroke.end_line(len);
    }

    fn close(&mut self, geometry: &Geometry) {
        let Some(FacetStretch { d, cos }) = self.open.take() else { return };
        match cos {
            Some(cos) => self.stroke.add_stretch(cos, d[1] - d[0], geometry),
            None => self.is_unknown = true,
        }
    }

    /// Ends a stroke.
    pub(super) fn stroke(&mut self, file: &ProgramFile, stroke: &Stroke, facts: &JobFacts) {
        let gain = gain(file, stroke, facts);
        self.sums.add(&std::mem::replace(&mut self.stroke, MarkSlopes::NONE), gain);
        // What a dot lies on is looked at with all that lies around it.
        self.is_unknown |= stroke.len == 1;
    }

    /// None where there are no marks, or more than what lies under them has to be looked at.
    pub(super) fn bounds(self) -> Option<Bounds> {
        if self.is_unknown { None } else { self.sums.bounds() }
    }
}

/// Whether a mark or a curve along an edge counts on the facet that lies under it, or on either of those beside it as
/// well: rounding decides between them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Sides {
    Ignored,
    Followed,
}

/// Bounds for the marks of a block; None where it has no marks.
pub(super) fn bounds_of_block(
    file: &ProgramFile,
    block: &Block,
    facts: &JobFacts,
    geometry: &Geometry,
    sides: Sides,
    scratch: &mut Scratch,
) -> Option<Bounds> {
    let mut sums = SlopeSums::NONE;
    for stroke in file.program.strokes_of(block) {
        let gain = gain(file, stroke, facts);
        // As much of a mark as rounding moves its ends may lie on the facet beyond.
        let touched = match sides {
            Sides::Followed => least_touched(file, block, stroke, geometry, scratch),
            Sides::Ignored => 1.0,
        };
        if let [dot] = file.program.points_of(stroke) {
            let c = block.stop.centre;
            let p_part = [c.x as f64 + f64::from(dot.x), c.y as f64 + f64::from(dot.y)];
            sums.add_dot(under_dot(p_part, sides, geometry, scratch), gain);
            continue;
        }
        let mut mark = under_mark(file, block, stroke, sides, geometry, scratch);
        mark.least[0] = mark.least[0].min(touched);
        mark.extent[0] = mark.extent[0].min(touched);
        sums.add(&mark, gain);
    }
    sums.bounds()
}

/// Lowest and highest cosine of what a dot may lie on; where sides are followed, of all within reach.
fn under_dot(p_part: [f64; 2], sides: Sides, geometry: &Geometry, scratch: &mut Scratch) -> Range {
    let around = geometry.around(p_part, scratch);
    let mut found = around.iter().filter_map(|p| cosines(p, geometry));
    // `surface` reports a dot with nothing under it.
    let Some(first) = found.next() else { return [geometry.least_cos(), 1.0] };
    match sides {
        Sides::Ignored => first,
        Sides::Followed => found.fold(first, |extent, cos| [extent[0].min(cos[0]), extent[1].max(cos[1])]),
    }
}

/// By how much its pen raises the dose of a mark.
fn gain(file: &ProgramFile, stroke: &Stroke, facts: &JobFacts) -> f64 {
    let factor = dose::origin(&file.program.pens, stroke.pen.index(), facts).map_or(1.0, |(_, factor)| factor);
    match facts.dose.map(|d| d.compensate) {
        Some(Compensate::Speed) => 1.0 / factor,
        Some(Compensate::Power) => factor,
        None => 1.0,
    }
}

/// The lines of a mark on the part.
fn lines<'a>(file: &'a ProgramFile, block: &'a Block, stroke: &Stroke) -> impl Iterator<Item = Line> + 'a {
    let c = block.stop.centre;
    let part = move |p: FieldPoint| [c.x as f64 + f64::from(p.x), c.y as f64 + f64::from(p.y)];
    let pairs = file.program.points_of(stroke).windows(2).filter(|w| w[0] != w[1]);
    pairs.map(move |w| Line::new(part(w[0]), part(w[1])))
}

/// The least cosine of what a mark may touch: rounding decides whether a mark that ends on an edge has the facet beyond
/// under its end.
fn least_touched(
    file: &ProgramFile,
    block: &Block,
    stroke: &Stroke,
    geometry: &Geometry,
    scratch: &mut Scratch,
) -> f64 {
    let reach = geometry.reach();
    let mut least = 1.0f64;
    for line in lines(file, block, stroke) {
        for side in [0.0, reach, -reach] {
            geometry.along(&line.part([-reach, line.len + reach], side), scratch, |p| {
                least = least.min(cosines(&p, geometry).map_or(1.0, |c| c[0]));
            });
        }
    }
    least
}

/// The slopes under a mark.
fn under_mark(
    file: &ProgramFile,
    block: &Block,
    stroke: &Stroke,
    sides: Sides,
    geometry: &Geometry,
    scratch: &mut Scratch,
) -> MarkSlopes {
    let mut mark = MarkSlopes::NONE;
    for line in lines(file, block, stroke) {
        for stretch in stretches(&line, sides, geometry, scratch) {
            mark.add_stretch(stretch.cos, stretch.d[1] - stretch.d[0], geometry);
        }
        mark.end_line(line.len);
    }
    mark
}

/// The stretches of a line, in order and without gaps. Its sides are looked at where `sides` says so, and where part of
/// the line has no facet under it that may be marked: that stretch was marked on what lies next to it.
fn stretches(line: &Line, sides: Sides, geometry: &Geometry, scratch: &mut Scratch) -> Vec<CosStretch> {
    let mut found = beside(line, 0.0, geometry, scratch);
    if sides == Sides::Followed || found.iter().any(|p| p.cos.is_none()) {
        for step in 1..=STEPS {
            let side = geometry.reach() * f64::from(step) / f64::from(STEPS);
            for side in [side, -side] {
                found = either(&found, &beside(line, side, geometry, scratch));
            }
        }
    }
    // What is still unknown is narrower than the grain, or `surface` has reported it.
    let unknown = [geometry.least_cos(), 1.0];
    found.into_iter().map(|p| CosStretch { d: p.d, cos: p.cos.unwrap_or(unknown) }).collect()
}

/// A stretch of a line over one facet and its cosines, if the facet may be marked.
#[derive(Clone, Copy, Debug, PartialEq)]
struct FacetStretch {
    d: [f64; 2],
    cos: Option<Range>,
}

/// The stretches of a line moved sideways by `side`, in order and without gaps.
fn beside(line: &Line, side: f64, geometry: &Geometry, scratch: &mut Scratch) -> Vec<FacetStretch> {
    let mut out: Vec<FacetStretch> = Vec::new();
    geometry.along(&line.part([0.0, line.len], side), scratch, |p| {
        let from = out.last().map_or(0.0, |last| last.d[1]);
        if p.d[1] > from {
            out.push(FacetStretch { d: [from, p.d[1]], cos: cosines(&p, geometry) });
        }
    });
    match out.last_mut() {
        Some(last) => last.d[1] = line.len,
        None => out.push(FacetStretch { d: [0.0, line.len], cos: None }),
    }
    out
}

/// The cosines of a piece; None off the part and on what is too steep to be marked. Facets know their slope to the
/// rounding of their vertices.
fn cosines(p: &Piece, geometry: &Geometry) -> Option<Range> {
    let s = p.sheet.filter(|s| s.slope != Slope::Steep)?;
    let (slope, doubt) = (s.slope2.sqrt(), geometry.slope_doubt(&s));
    Some([slope + doubt, (slope - doubt).max(0.0)].map(|t| 1.0 / math::hypot(t, 1.0)))
}

/// Two divisions of the same line as one, each of whose stretches may have the cosines of either.
fn either(a: &[FacetStretch], b: &[FacetStretch]) -> Vec<FacetStretch> {
    let mut out: Vec<FacetStretch> = Vec::with_capacity(a.len() + b.len());
    let (mut i, mut k, mut at) = (0, 0, 0.0);
    // Both cover the line from `at` on with the stretches i and k: the shorter one ends first.
    while let (Some(x), Some(y)) = (a.get(i), b.get(k)) {
        let end = x.d[1].min(y.d[1]);
        let cos = match (x.cos, y.cos) {
            (Some(x), Some(y)) => Some([x[0].min(y[0]), x[1].max(y[1])]),
            (x, y) => x.or(y),
        };
        match out.last_mut() {
            Some(last) if last.cos == cos => last.d[1] = end,
            _ if end > at => out.push(FacetStretch { d: [at, end], cos }),
            _ => {}
        }
        (i, k, at) = (i + usize::from(x.d[1] <= end), k + usize::from(y.d[1] <= end), end);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn known(list: &[(f64, Option<f64>)]) -> Vec<FacetStretch> {
        let mut at = 0.0;
        let all = list.iter().map(|&(to, cos)| {
            let d = [at, to];
            at = to;
            FacetStretch { d, cos: cos.map(|c| [c, c]) }
        });
        all.collect()
    }

    #[test]
    fn stretches_of_both_sides_have_the_cosines_of_either() {
        let a = known(&[(4.0, Some(0.9)), (10.0, None)]);
        let b = known(&[(6.0, Some(0.5)), (8.0, None), (10.0, Some(0.7))]);
        let wanted = [(4.0, Some([0.5, 0.9])), (6.0, Some([0.5, 0.5])), (8.0, None), (10.0, Some([0.7, 0.7]))];
        let found: Vec<_> = either(&a, &b).iter().map(|k| (k.d[1], k.cos)).collect();
        assert_eq!(found, wanted);
        assert_eq!(either(&a, &a), a);
    }
}
