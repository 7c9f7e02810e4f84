//! All strokes cut between the stops of every candidate, in one sweep, in chunks.

use std::ops::Range;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

use super::parts::Parts;
use super::stroke_chunks::{Sweep, chunks};
use crate::partition::Stops;
use crate::projection::Keep;
use crate::split::{Fragment, Fragments, Least, Measure, Seam, Splitter};
use terrace_core::diag::{Diag, Error, memory};
use terrace_core::geom::{NM_PER_MM, Nm, length_mm};
use terrace_core::machine::Machine;
use terrace_core::parallel;
use terrace_core::program::{Pen, Sections, Stroke, StrokeId};
use terrace_core::progress::Task;
use terrace_input::job::Job;
use terrace_input::texture::Texture;

/// Most fragments and most points of all candidates, which are held in memory whole: some 6 GB.
pub(super) const MAX_FRAGMENTS: usize = 50_000_000;

pub(super) const MAX_POINTS: usize = 500_000_000;

/// How strokes are cut.
#[derive(Clone, Copy, Default)]
pub(super) struct CutRules {
    /// Shorter fragments are skipped.
    pub(super) least: Least,
    pub(super) keep: Keep,
    pub(super) seam: Seam,
}

impl CutRules {
    pub(super) fn new(job: &Job, machine: &Machine, keep: Keep) -> Self {
        let [zone, overlap] = [job.partition.zone, job.partition.overlap].map(Nm::f64);
        // The spot on the mark beside a sliver covers all of it.
        let half_spot = || Least { mark: 0.0, sliver: machine.lens.spot.as_mm() * NM_PER_MM / 2.0 };
        let least = job.partition.min_mark.map_or_else(half_spot, |Nm(v)| Least { mark: v as f64, sliver: 0.0 });
        Self { least, keep, seam: Seam { zone, overlap, seed: job.seed } }
    }

    /// Whether fragments can be given to other stops as they are: where blocks overlap, where cuts are spread over a
    /// zone, and where marks are left out by their length, what is a fragment depends on all stops around it.
    pub(super) fn may_regroup(&self) -> bool {
        self.least.mark == 0.0 && self.seam.zone == 0.0 && self.seam.overlap == 0.0
    }
}

/// What all candidates together will hold, about.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Estimate {
    fragments: f64,
    points: f64,
}

impl Estimate {
    /// Strokes whose mean length is `length` over sections with a pitch of `pitch`, nm, that are cut between these
    /// numbers of stops over so many sections. On its way across a section a stroke crosses one border and each of
    /// the section's levels once; it may cross fewer, or on a curved part some twice.
    fn new(strokes: f64, points: f64, length: f64, pitch: f64, stops_by_section: &[f64]) -> Self {
        // One border of sections per pitch, and at each section its levels.
        let cuts: Vec<f64> = stops_by_section.iter().map(|levels| strokes * length / pitch * (1.0 + levels)).collect();
        Self {
            fragments: cuts.iter().map(|cuts| strokes + cuts).sum(),
            // A cut adds a point to both of its sides.
            points: cuts.iter().map(|cuts| points + 2.0 * cuts).sum(),
        }
    }

    /// For the strokes of a texture, their mean length that of some of them.
    fn of_texture(texture: &Texture, candidates: &[&Stops], sections: &Sections) -> Self {
        const SAMPLES: usize = 1000;
        let mut points = Vec::new();
        let mut length = 0.0;
        let mut samples = 0.0;
        for i in (0..texture.len()).step_by((texture.len() / SAMPLES).max(1)) {
            texture.stroke(i, &mut points);
            length += length_mm(&points) * NM_PER_MM;
            samples += 1.0;
        }
        let pitch = sections.pitch[0].min(sections.pitch[1]).f64();
        let levels: Vec<f64> = candidates.iter().map(|c| c.stops.len() as f64 / sections.len() as f64).collect();
        Self::new(
            texture.len() as f64,
            texture.points_estimate() as f64,
            length / f64::max(samples, 1.0),
            pitch,
            &levels,
        )
    }

    /// What they take, with the room that lists keep to grow, the program that is laid out from them, and a place for
    /// the bound.
    fn bytes(self) -> u64 {
        const FRAGMENT: usize =
            3 * (size_of::<Fragment>() + size_of::<Measure>()) / 2 + size_of::<Stroke>() + size_of::<[i32; 3]>();
        const POINT: usize = 5 * size_of::<[i32; 2]>() / 2;
        (self.fragments * FRAGMENT as f64 + self.points * POINT as f64) as u64
    }

    /// # Errors
    /// `program-large` where the program is sure to be; `memory` where it is known not to fit.
    fn hold(self, texture: &Texture) -> Result<(), Diag> {
        // The estimate may be too high by this much; what is nearer to the bounds is counted while it grows.
        const SPARE: f64 = 2.0;
        if self.fragments > SPARE * MAX_FRAGMENTS as f64 || self.points > SPARE * MAX_POINTS as f64 {
            return Err(too_large(texture));
        }
        memory::ask("the program", self.bytes())
    }
}

/// How much all candidates hold so far, counted while it grows by all threads.
#[derive(Default)]
struct Growth {
    fragments: AtomicUsize,
    points: AtomicUsize,
}

impl Growth {
    fn add(&self, parts: &[Fragments]) {
        self.fragments.fetch_add(parts.iter().map(|p| p.list.len() + p.slivers.len()).sum(), Relaxed);
        self.points.fetch_add(parts.iter().map(|p| p.points.len()).sum(), Relaxed);
    }

    fn is_too_large(&self) -> bool {
        self.fragments.load(Relaxed) > MAX_FRAGMENTS || self.points.load(Relaxed) > MAX_POINTS
    }
}

/// Cuts all strokes between the stops of every candidate, in one sweep; by candidate, in chunks.
///
/// # Errors
/// `program-large`; `memory`.
pub(super) fn split(
    sweep: Sweep<'_>,
    candidates: &[&Stops],
    sections: &Sections,
    pens: &[Pen],
    rules: CutRules,
    task: Task<'_>,
) -> Result<Vec<Parts>, Error> {
    let texture = sweep.texture;
    Estimate::of_texture(texture, candidates, sections).hold(texture)?;
    let growth = Growth::default();
    let chunks = chunks(texture);
    let task = task.of_steps(chunks.len());
    let cut_chunk = |_, chunk: Range<usize>| {
        // What is too large must be refused before it fills the memory.
        if growth.is_too_large() {
            return Err(too_large(texture));
        }
        let parts = fragments_of_chunk(sweep, chunk, candidates, pens, rules);
        growth.add(&parts);
        task.step();
        if growth.is_too_large() { Err(too_large(texture)) } else { Ok(parts) }
    };
    let mut by_candidate = Ok(candidates.iter().map(|_| Parts::default()).collect::<Vec<_>>());
    parallel::in_order(chunks, cut_chunk, |chunk| match (&mut by_candidate, chunk) {
        (Ok(lists), Ok(chunk)) => lists.iter_mut().zip(chunk).for_each(|(parts, part)| parts.push(part)),
        (_, Err(too_large)) => by_candidate = Err(too_large),
        (Err(_), Ok(_)) => {}
    });
    Ok(by_candidate?)
}

/// The strokes of a chunk cut between the stops of every candidate, by candidate.
fn fragments_of_chunk(
    sweep: Sweep<'_>,
    chunk: Range<usize>,
    candidates: &[&Stops],
    pens: &[Pen],
    rules: CutRules,
) -> Vec<Fragments> {
    let mut splitter = Splitter::new(sweep.tracer(), candidates, rules.least, rules.keep, rules.seam);
    let mut points = Vec::new();
    for i in chunk {
        let pen = sweep.texture.stroke(i, &mut points);
        splitter.stroke(StrokeId(i as u32), pen, pens[pen.index()].passes, &points);
    }
    splitter.finish().collect()
}

/// The program would not fit: said without a count, which would depend on the threads.
pub(super) fn too_large(texture: &Texture) -> Diag {
    let text = format!(
        "the texture's {} strokes become more than {MAX_FRAGMENTS} fragments or {MAX_POINTS} points",
        texture.len()
    );
    Diag::limit("program-large", text).hint("use a larger pitch or a smaller area, or mark the part in several jobs")
}

/// The figures of two runs of strokes together; fragments and points are let go.
pub(super) fn join(mut a: Fragments, b: Fragments) -> Fragments {
    a.texture_mm += b.texture_mm;
    a.mark_mm += b.mark_mm;
    a.overlap_mm += b.overlap_mm;
    a.cuts += b.cuts;
    a.short += b.short;
    a.dots += b.dots;
    a.skipped.off_part += b.skipped.off_part;
    a.skipped.steep += b.skipped.steep;
    a.skipped.small += b.skipped.small;
    a.slivers.extend(b.slivers);
    a.strokes_cut += b.strokes_cut;
    a.figures_whole += b.figures_whole;
    a.figures_cut += b.figures_cut;
    a.not_kept += b.not_kept;
    a.steep_at = a.steep_at.or(b.steep_at);
    a.worst_slope2 = a.worst_slope2.max(b.worst_slope2);
    a
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_estimate_of_fragments_is_that_of_a_hatch_over_sections_and_levels() {
        // 1000 lines of 60 mm over sections of 40 mm with 7 levels: 1.5 borders and 10.5 levels each.
        let one = Estimate::new(1000.0, 2000.0, 60e6, 40e6, &[7.0]);
        assert_eq!(one, Estimate { fragments: 13_000.0, points: 26_000.0 });
        // Two candidates are held at a time.
        let two = Estimate::new(1000.0, 2000.0, 60e6, 40e6, &[7.0, 3.0]);
        assert_eq!(two.fragments, 13_000.0 + 7_000.0);
        assert!(one.bytes() > 13_000 * size_of::<Fragment>() as u64 && one.bytes() < 13_000 * 500);
    }
}
