//! Sweeps over all strokes of the texture, for what is found out before any is cut.
//!
//! Strokes are taken in chunks whose number does not depend on the number of threads; what the chunks give
//! must be the same in whatever order it is joined.

use crate::partition::Fine;
use crate::projection::{
    Cells, Footprint, GridTracer, HeightReserve, Keep, Marks, MarksByField, Samples, Sampling, TiltedFields, Tracer,
};
use terrace_core::geom::{Nm, P2};
use terrace_core::parallel;
use terrace_core::program::Sections;
use terrace_core::progress::Task;
use terrace_input::surface::Surface;
use terrace_input::texture::Texture;

/// Chunks that a texture is cut into at least, and the most strokes of one.
const CHUNKS: usize = 256;
const CHUNK: usize = 1 << 16;

/// The chunks of a texture: ranges of stroke indices, their number independent of threads.
pub(super) fn chunks(texture: &Texture) -> Vec<std::ops::Range<usize>> {
    let size = texture.len().div_ceil(CHUNKS).clamp(1, CHUNK);
    (0..texture.len()).step_by(size).map(|i| i..(i + size).min(texture.len())).collect()
}

/// What is swept over.
#[derive(Clone, Copy)]
pub(super) struct Sweep<'a> {
    pub(super) surface: &'a Surface,
    pub(super) texture: &'a Texture,
    /// Tangent of the steepest slope that is marked.
    pub(super) max_slope: f64,
    /// What is kept free for the height of a measured part.
    pub(super) reserve: Option<&'a HeightReserve>,
}

impl<'a> Sweep<'a> {
    /// Traces strokes over the surface.
    pub(super) fn tracer(&self) -> Tracer<'a> {
        Tracer::new(self.surface, self.max_slope).with_reserve(self.reserve)
    }

    /// Traces all strokes over `grid`: `add` puts the stroke with that number to what a chunk found, which is
    /// `none` at first, and `merge` joins what two chunks found.
    pub(super) fn gather<T: Send>(
        self,
        grid: &Sections,
        task: Task<'_>,
        none: impl Fn() -> T + Sync + Send,
        add: impl Fn(&mut T, usize, &[P2], &mut GridTracer<'_>) + Sync + Send,
        merge: impl Fn(&mut T, T) + Sync + Send,
    ) -> T {
        let chunks = chunks(self.texture);
        let task = task.of_steps(chunks.len());
        // What is found must not depend on how chunks are grouped: sets, extremes and sums of integers do not.
        parallel::fold(
            chunks.len(),
            none,
            |found, k| {
                self.trace_chunk(chunks[k].clone(), grid, |i, points, tracer| add(found, i, points, tracer));
                task.step();
            },
            merge,
        )
    }

    /// Hands on each stroke of a chunk: its number, its points, and what traces it over `grid`.
    fn trace_chunk(
        self,
        chunk: std::ops::Range<usize>,
        grid: &Sections,
        mut visit: impl FnMut(usize, &[P2], &mut GridTracer<'_>),
    ) {
        let mut tracer = GridTracer::new(self.tracer(), grid);
        let mut points = Vec::new();
        for i in chunk {
            self.texture.stroke(i, &mut points);
            visit(i, &points, &mut tracer);
        }
    }

    /// The heights of the marks in every section, and points of marks for the lower bound.
    pub(super) fn footprint(
        self,
        sections: &Sections,
        keep: Keep,
        half: [Nm; 2],
        sampling: Option<Sampling>,
        task: Task<'_>,
    ) -> (Footprint, Option<Samples>) {
        let (footprint, samples) = self.gather(
            sections,
            task,
            || (Footprint::default(), sampling.map(Samples::new)),
            |(footprint, samples), i, points, tracer| {
                samples.iter_mut().for_each(|m| m.begin(i));
                footprint.add(points, tracer, keep, half, samples.as_mut());
            },
            |(footprint, samples), (other_footprint, other_samples)| {
                footprint.merge(other_footprint);
                samples.iter_mut().zip(other_samples).for_each(|(samples, other)| samples.merge(other));
            },
        );
        (footprint.joined(), samples)
    }

    /// The texture in the cells of a fine grid.
    pub(super) fn cells(self, fine: &Fine, keep: Keep, task: Task<'_>) -> Cells {
        let add = |cells: &mut Cells, _, points: &[P2], tracer: &mut GridTracer<'_>| {
            cells.add(points, tracer, &fine.slabs, keep);
        };
        self.gather(&fine.grid, task, Cells::default, add, Cells::merge)
    }

    /// In every cell of a grid the lowest and the highest mark.
    pub(super) fn marks(self, grid: &Sections, task: Task<'_>) -> Marks {
        self.gather(grid, task, Marks::default, |marks, _, points, tracer| marks.add(points, tracer), Marks::merge)
    }

    /// What every field of tilted stops must hold.
    pub(super) fn held(self, fields: &TiltedFields, keep: Keep, task: Task<'_>) -> MarksByField {
        let none = || MarksByField::new(fields.list.len());
        let add = |held: &mut MarksByField, _, points: &[P2], tracer: &mut GridTracer<'_>| {
            held.add(points, tracer, fields, keep);
        };
        self.gather(&fields.grid, task, none, add, MarksByField::merge).joined()
    }
}
