//! Strokes on the part in the order in which they are marked, without stops: what an on-the-fly machine follows.
//!
//! Points are turned part frame, integer nm. A machine that steps has blocks of them, each in the frame of its field
//! (`terrace_core::program`).

use std::ops::Range;

use terrace_core::geom::{FieldPoint, Nm, P2, length_mm};
use terrace_core::program::{Pen, Program, Stroke};

/// Strokes in marking order.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct OrderedStrokes {
    /// Laser settings.
    pub pens: Vec<Pen>,
    /// The strokes; their points are those of this list.
    pub strokes: Vec<Stroke>,
    /// All points, turned part frame, nm.
    pub points: Vec<P2>,
}

/// Strokes that lie within a range of heights, which one focal plane keeps in focus.
#[derive(Clone, Debug, PartialEq)]
pub struct Band {
    /// Height of the focal plane.
    pub lpfl: Nm,
    /// Lowest and highest height that it admits.
    pub z: [Nm; 2],
    /// The strokes of the band, as a range of [`OrderedStrokes::strokes`].
    pub strokes: Range<usize>,
}

impl OrderedStrokes {
    /// The strokes of a program whose stops are upright, under the same indices.
    pub fn of_program(program: &Program) -> Self {
        Self::placed(program, |i, p| {
            let centre = program.blocks[i].stop.centre;
            P2::new(centre.x + i64::from(p.x), centre.y + i64::from(p.y))
        })
    }

    /// The strokes of a program, under the same indices; `place` says where a point of the block with an index lies.
    pub fn placed(program: &Program, place: impl Fn(usize, FieldPoint) -> P2) -> Self {
        let mut points = vec![P2::default(); program.points.len()];
        for (i, block) in program.blocks.iter().enumerate() {
            for stroke in program.strokes_of(block) {
                let placed = points[range(stroke)].iter_mut();
                placed.zip(program.points_of(stroke)).for_each(|(to, p)| *to = place(i, *p));
            }
        }
        Self { pens: program.pens.clone(), strokes: program.strokes.clone(), points }
    }

    /// The points of a stroke in marking order.
    pub fn points_of(&self, stroke: &Stroke) -> &[P2] {
        &self.points[range(stroke)]
    }

    /// Length of some of the strokes, mm, every pass of their pens counted.
    pub fn mark_mm(&self, strokes: Range<usize>) -> f64 {
        let passes = |stroke: &Stroke| f64::from(self.pens[stroke.pen.index()].passes);
        self.strokes[strokes].iter().map(|s| length_mm(self.points_of(s)) * passes(s)).sum()
    }

    /// These strokes, each as often in the list as its pen has passes: what marks on the fly marks a stroke
    /// again before it continues, as a controller does at a stop. `bands` go with their strokes.
    #[must_use]
    pub fn repeated(mut self, bands: &mut [Band]) -> Self {
        let once = |pen: &mut Pen| std::mem::replace(&mut pen.passes, 1) as usize;
        let passes: Vec<usize> = self.pens.iter_mut().map(once).collect();
        let mut strokes = Vec::with_capacity(self.strokes.len());
        // Where each stroke's repetitions begin, and where the last ones end.
        let mut begins = Vec::with_capacity(self.strokes.len() + 1);
        for stroke in &self.strokes {
            begins.push(strokes.len());
            strokes.extend(std::iter::repeat_n(*stroke, passes[stroke.pen.index()]));
        }
        begins.push(strokes.len());
        for band in bands {
            band.strokes = begins[band.strokes.start]..begins[band.strokes.end];
        }
        Self { strokes, ..self }
    }
}

/// Where the points of a stroke are in the list of points.
fn range(stroke: &Stroke) -> Range<usize> {
    stroke.first as usize..(stroke.first + stroke.len) as usize
}

#[cfg(test)]
mod tests {
    use super::*;
    use terrace_core::program::sample;

    #[test]
    fn strokes_of_a_program_lie_where_its_blocks_mark_them() {
        let (program, _) = sample::program();
        let ordered = OrderedStrokes::of_program(&program);
        assert_eq!(ordered.strokes, program.strokes);
        for block in &program.blocks {
            let length = ordered.mark_mm(block.strokes.clone());
            assert!((length - program.mark_mm(block)).abs() < 1e-9);
            for stroke in program.strokes_of(block) {
                let (placed, in_field) = (ordered.points_of(stroke), program.points_of(stroke));
                let centre = block.stop.centre;
                let offsets = placed.iter().map(|p| [p.x - centre.x, p.y - centre.y]);
                assert!(offsets.eq(in_field.iter().map(|p| [p.x, p.y].map(i64::from))));
            }
        }
    }

    #[test]
    fn repeated_strokes_have_the_same_length_with_pens_of_one_pass() {
        let (mut program, _) = sample::program();
        (program.pens[0].passes, program.pens[1].passes) = (2, 3);
        let once = OrderedStrokes::of_program(&program);
        let band = |strokes: &Range<usize>| Band { lpfl: Nm(0), z: [Nm(0); 2], strokes: strokes.clone() };
        let mut bands: Vec<Band> = program.blocks.iter().map(|block| band(&block.strokes)).collect();
        let repeats = once.clone().repeated(&mut bands);
        assert!(repeats.pens.iter().all(|pen| pen.passes == 1));
        assert_eq!(repeats.clone().repeated(&mut bands.clone()), repeats, "once is enough");
        // Each stroke follows itself, in the band that it belongs to.
        for (block, band) in program.blocks.iter().zip(&bands) {
            let of = |s: &Stroke| program.pens[s.pen.index()].passes as usize;
            let want: Vec<_> = program.strokes_of(block).iter().flat_map(|s| std::iter::repeat_n(*s, of(s))).collect();
            assert_eq!(repeats.strokes[band.strokes.clone()], want);
            let [before, after] = [once.mark_mm(block.strokes.clone()), repeats.mark_mm(band.strokes.clone())];
            assert!((before - after).abs() < 1e-9 && before > 0.0);
        }
    }
}
