//! What of the textures that the job places lies off the part.
//!
//! A pattern over the part's box is limited to the part by its own meaning, so what of it lies off the part is nobody's
//! mistake; of all other textures (`Request::is_placed`) it may be one. Strokes of the latter are traced once more.
//! Lengths are sums of whole nanometres, so threads change nothing. Pictures show where it is (`scene::Unmarked`).

use super::stroke_chunks::Sweep;
use crate::projection::{Skip, Tracer, segments};
use terrace_core::diag::Diag;
use terrace_core::geom::{Nm, P2};
use terrace_core::math;
use terrace_core::parallel;
use terrace_core::units::Share;
use terrace_input::job::Job;
use terrace_input::texture::Slip;

/// Strokes that are traced as one task.
const CHUNK: usize = 4096;

/// What lies off the part.
#[derive(Clone, Debug, Default)]
pub struct OffPart {
    /// The textures that the job places: each by its number from 1, with what of it lies off the part.
    textures: Vec<(usize, TextureLengths)>,
    /// The textures whose size does not go with the part, by their index.
    slips: Vec<(usize, Slip)>,
}

/// Lengths and dots of a texture, all and those off the part.
#[derive(Clone, Copy, Debug, Default)]
struct TextureLengths {
    all: i64,
    off: i64,
    dots: u64,
    dots_off: u64,
}

impl TextureLengths {
    /// The share that lies off the part, of the lines or of the dots, %.
    fn off_percent(&self) -> f64 {
        let lines = self.off as f64 / self.all.max(1) as f64;
        100.0 * lines.max(self.dots_off as f64 / self.dots.max(1) as f64)
    }

    fn trace(&mut self, tracer: &mut Tracer<'_>, points: &[P2]) {
        let mut all = 0.0;
        let mut off = 0.0;
        let is_dot = points.len() == 1;
        self.dots += u64::from(is_dot);
        for (a, b) in segments(points) {
            let length = math::hypot((b.x - a.x) as f64, (b.y - a.y) as f64);
            all += length;
            tracer.segment(a, b, |piece| {
                if piece.skip == Some(Skip::OffPart) {
                    self.dots_off += u64::from(is_dot);
                    off += length * (piece.t1 - piece.t0);
                }
            });
        }
        self.all += Nm::round(all).0;
        self.off += Nm::round(off).0;
    }

    fn merge(&mut self, other: Self) {
        self.all += other.all;
        self.off += other.off;
        self.dots += other.dots;
        self.dots_off += other.dots_off;
    }
}

impl OffPart {
    /// Traces the textures that the job places.
    pub(super) fn of(job: &Job, sweep: Sweep<'_>) -> Self {
        let mut textures = Vec::new();
        for (k, _) in job.textures.iter().enumerate().filter(|(_, request)| request.is_placed()) {
            let strokes = sweep.texture.strokes_of(k);
            let chunk = |i: usize| (strokes.start + i * CHUNK)..(strokes.start + (i + 1) * CHUNK).min(strokes.end);
            let found = parallel::fold(
                strokes.len().div_ceil(CHUNK),
                TextureLengths::default,
                |found, i| {
                    let mut tracer = Tracer::new(sweep.surface, sweep.max_slope);
                    let mut points = Vec::new();
                    for stroke in chunk(i) {
                        sweep.texture.stroke(stroke, &mut points);
                        found.trace(&mut tracer, &points);
                    }
                },
                TextureLengths::merge,
            );
            textures.push((k + 1, found));
        }
        let slips = sweep.texture.slips().map(|(k, slip)| (k, slip.clone())).collect();
        Self { textures, slips }
    }

    /// The fault where more than a share of a texture lies off the part; where its size explains it, the hint says so.
    pub fn fault(&self, most: Share) -> Option<Diag> {
        let (number, found) = self.textures.iter().find(|(_, found)| found.off_percent() > most.as_percent())?;
        let text = format!(
            "texture {number}: {} of it ({:.1} %) lie off the part or over a hole",
            lengths_and_dots(Nm(found.off).mm(), found.dots_off),
            found.off_percent()
        );
        let hint = format!(
            "limits.max_off_part allows {} %: `terrace preview` draws it in red; move the texture with its area or \
             origin, or raise the limit",
            most.as_percent()
        );
        let slip = self.slips.iter().find(|(k, _)| k + 1 == *number).map(|(_, slip)| slip.cause());
        Some(Diag::limit("off-part", text).hint(slip.unwrap_or(hint)))
    }
}

/// What is not marked: a length, dots, or both.
pub(super) fn lengths_and_dots(mm: f64, dots: u64) -> String {
    match (mm > 0.0, dots) {
        (_, 0) => length(mm),
        (false, dots) => format!("{dots} dots"),
        (true, dots) => format!("{} and {dots} dots", length(mm)),
    }
}

/// A length, mm, for messages.
pub(super) fn length(mm: f64) -> String {
    if mm < 0.001 { format!("{:.3} um", mm * 1000.0) } else { format!("{mm:.3} mm") }
}
