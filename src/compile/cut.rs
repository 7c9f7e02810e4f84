//! All strokes cut between the stops of every candidate, over one walk, in chunks.

use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

use rayon::prelude::*;

use super::Ground;
use super::walk::chunks;
use crate::diag::{Diag, Error};
use crate::geom::NM_PER_MM;
use crate::partition::Stops;
use crate::split::{Fragments, Seam, Splitter};
use crate::trace::Tracer;

/// Most fragments and most points of all candidates, which are held in memory whole: some 8 GB.
pub(super) const MAX_FRAGMENTS: usize = 50_000_000;

pub(super) const MAX_POINTS: usize = 500_000_000;

/// Cuts all strokes between the stops of every candidate, in one walk; by candidate, in chunks.
pub(super) fn cut(ground: &Ground<'_>, candidates: &[Stops]) -> Result<Vec<Vec<Fragments>>, Error> {
    let min_mark = ground.job.file.partition.min_mark.as_mm() * NM_PER_MM;
    let partition = &ground.job.file.partition;
    let [zone, overlap] = [partition.zone, partition.overlap].map(|l| l.as_mm() * NM_PER_MM);
    let seam = Seam { zone, overlap, seed: ground.job.seed };
    let (fragment_count, point_count) = (AtomicUsize::new(0), AtomicUsize::new(0));
    let chunks = chunks(ground.texture)
        .into_par_iter()
        .map(|chunk| {
            let tracer = Tracer::new(ground.surface, ground.max_slope);
            let mut splitter = Splitter::new(tracer, candidates, min_mark, ground.keep, seam);
            let mut points = Vec::new();
            for i in chunk {
                let pen = ground.texture.stroke(i, &mut points);
                splitter.stroke(i as u32, pen, ground.pens[usize::from(pen)].passes, &points);
            }
            let parts: Vec<Fragments> = splitter.finish().collect();
            // Counted while it grows: what is too large must be refused before it fills the memory.
            let grown = |count: &AtomicUsize, of: fn(&Fragments) -> usize| {
                let by = parts.iter().map(of).sum();
                count.fetch_add(by, Relaxed) + by
            };
            let fits = grown(&fragment_count, |p| p.list.len()) <= MAX_FRAGMENTS
                && grown(&point_count, |p| p.points.len()) <= MAX_POINTS;
            if fits { Ok(parts) } else { Err(too_large(ground)) }
        })
        .collect::<Result<Vec<_>, _>>()?;
    let mut by_candidate: Vec<Vec<Fragments>> = candidates.iter().map(|_| Vec::with_capacity(chunks.len())).collect();
    for chunk in chunks {
        chunk.into_iter().zip(&mut by_candidate).for_each(|(part, parts)| parts.push(part));
    }
    Ok(by_candidate)
}

/// The program would not fit: said without a count, which would depend on the threads.
pub(super) fn too_large(ground: &Ground<'_>) -> Diag {
    let text = format!(
        "the texture's {} strokes become more than {MAX_FRAGMENTS} fragments or {MAX_POINTS} points",
        ground.texture.len()
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
    a.skipped.off_part += b.skipped.off_part;
    a.skipped.steep += b.skipped.steep;
    a.skipped.small += b.skipped.small;
    a.strokes_cut += b.strokes_cut;
    a.figures_whole += b.figures_whole;
    a.figures_cut += b.figures_cut;
    a.not_kept += b.not_kept;
    a.steep_at = a.steep_at.or(b.steep_at);
    a.worst_slope2 = a.worst_slope2.max(b.worst_slope2);
    a
}
