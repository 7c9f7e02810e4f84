//! All strokes cut between the stops of every candidate, in one sweep, in chunks.

use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

use rayon::prelude::*;

use super::sweep::{Sweep, chunks};
use crate::diag::{Diag, Error};
use crate::job::Partition;
use crate::partition::Stops;
use crate::program::{Pen, PenId, StrokeId};
use crate::projection::{Keep, Tracer};
use crate::split::{Fragments, Seam, Splitter};
use crate::texture::Texture;

/// Most fragments and most points of all candidates, which are held in memory whole: some 8 GB.
pub(super) const MAX_FRAGMENTS: usize = 50_000_000;

pub(super) const MAX_POINTS: usize = 500_000_000;

/// How strokes are cut.
#[derive(Clone, Copy)]
pub(super) struct Cuts {
    /// Shorter fragments are skipped, nm.
    pub(super) min_mark: i64,
    pub(super) keep: Keep,
    pub(super) seam: Seam,
}

impl Cuts {
    pub(super) fn new(partition: &Partition, keep: Keep, seed: u64) -> Self {
        let [zone, overlap] = [partition.zone, partition.overlap].map(|nm| nm as f64);
        Self { min_mark: partition.min_mark, keep, seam: Seam { zone, overlap, seed } }
    }
}

/// Cuts all strokes between the stops of every candidate, in one sweep; by candidate, in chunks.
///
/// # Errors
/// `program-large`.
pub(super) fn split(
    sweep: Sweep<'_>,
    candidates: &[&Stops],
    pens: &[Pen],
    cuts: Cuts,
) -> Result<Vec<Vec<Fragments>>, Error> {
    let Sweep { surface, texture, max_slope } = sweep;
    let (fragment_count, point_count) = (AtomicUsize::new(0), AtomicUsize::new(0));
    let chunks = chunks(texture)
        .into_par_iter()
        .map(|chunk| {
            let tracer = Tracer::new(surface, max_slope);
            let mut splitter = Splitter::new(tracer, candidates, cuts.min_mark as f64, cuts.keep, cuts.seam);
            let mut points = Vec::new();
            for i in chunk {
                let pen = PenId(texture.stroke(i, &mut points));
                splitter.stroke(StrokeId(i as u32), pen, pens[pen.index()].passes, &points);
            }
            let parts: Vec<Fragments> = splitter.finish().collect();
            // Counted while it grows: what is too large must be refused before it fills the memory.
            let grown = |count: &AtomicUsize, of: fn(&Fragments) -> usize| {
                let by = parts.iter().map(of).sum();
                count.fetch_add(by, Relaxed) + by
            };
            let fits = grown(&fragment_count, |p| p.list.len()) <= MAX_FRAGMENTS
                && grown(&point_count, |p| p.points.len()) <= MAX_POINTS;
            if fits { Ok(parts) } else { Err(too_large(texture)) }
        })
        .collect::<Result<Vec<_>, _>>()?;
    // Collected in the order of the chunks, whatever thread made them.
    let mut by_candidate: Vec<Vec<Fragments>> = candidates.iter().map(|_| Vec::with_capacity(chunks.len())).collect();
    for chunk in chunks {
        chunk.into_iter().zip(&mut by_candidate).for_each(|(part, parts)| parts.push(part));
    }
    Ok(by_candidate)
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
