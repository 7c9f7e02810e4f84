//! Areas to lines along contours, once sections are known.
//!
//! Consumes the areas of a texture that wait to be filled, the surface and the sections; promises that
//! they are filled, in every section in the direction that makes the fewest fragments, to a hundredth
//! of a degree. The lines themselves are laid by the texture, from these directions alone.
//!
//! Lines of direction t, a pitch apart, make as many fragments as there are lines, and one more at
//! every level they cross: the integral of |gradient · t| over the area / (pitch · depth range). Both are
//! summed over a raster of at most 16 x 16 places a section; gradients are taken across the raster's
//! cells, so that roughness finer than these does not turn the lines. As a function of the direction the sum
//! is concave between the level directions of the places and the axes, so one of these is the best.
//!
//! Units: nm. Cost: walks of 32 section widths, and the square of the places.

use crate::projection::Tracer;
use terrace_core::diag::Error;
use terrace_core::geom::{Box2, Nm, P2, nearest};
use terrace_core::math;
use terrace_core::parallel;
use terrace_core::program::Sections;
use terrace_core::progress::Task;
use terrace_input::surface::Surface;
use terrace_input::texture::{Contour, Directions, Texture};

/// Most places along one side of the raster.
const PLACES: f64 = 16.0;

/// The texture with its areas filled that wait for it; as it is where there is none. `max_slope` is the
/// tangent of the steepest slope that is marked, `depth` the depth range of a stop, nm.
///
/// # Errors
/// The errors of [`Texture::fill`].
pub fn along_contours(
    mut texture: Texture,
    surface: &Surface,
    sections: &Sections,
    max_slope: f64,
    depth: Nm,
    task: Task<'_>,
) -> Result<Texture, Error> {
    if texture.contours().next().is_none() {
        return Ok(texture);
    }
    let depth = depth.max(Nm(1)).f64();
    let filled = &texture;
    let task = task.of_steps(sections.len());
    let hundredths = parallel::map(sections.len(), |i| {
        let mut section = HatchSection::default();
        let mut tracer = Tracer::new(surface, max_slope);
        filled.contours().for_each(|area| section.add(area, sections.area(i), depth, &mut tracer));
        let best = section.best();
        task.step();
        best
    });
    texture.fill(Directions { grid: *sections, hundredths })?;
    Ok(texture)
}

/// What decides the direction in one section.
#[derive(Default)]
pub(super) struct HatchSection {
    /// Levels crossed by the lines of one place that run along x and along y.
    rises: Vec<[f64; 2]>,
    /// Corners of the areas, in pitches.
    outlines: Vec<Vec<[f64; 2]>>,
}

impl HatchSection {
    /// Adds what an area has in the section.
    pub(super) fn add(&mut self, area: &Contour, section: Box2, depth: f64, tracer: &mut Tracer<'_>) {
        let outline = area.outline(section);
        let Some([lo, hi]) = extremes(&outline) else { return };
        let count = [0, 1].map(|k| ((hi[k] - lo[k]) / area.pitch()).floor().clamp(1.0, PLACES));
        let step = [0, 1].map(|k| (hi[k] - lo[k]) / count[k]);
        let share = step[0] * step[1] / (area.pitch() * depth);
        for row in 0..count[1] as u32 {
            for column in 0..count[0] as u32 {
                let at = [lo[0] + (f64::from(column) + 0.5) * step[0], lo[1] + (f64::from(row) + 0.5) * step[1]];
                if !holds(&outline, at) {
                    continue;
                }
                let along_x = slope(tracer, at, [step[0] / 2.0, 0.0]);
                let along_y = slope(tracer, at, [0.0, step[1] / 2.0]);
                if let (Some((gx, mx)), Some((gy, my))) = (along_x, along_y) {
                    let weight = share * (mx + my) / 2.0;
                    self.rises.push([gx * weight, gy * weight]);
                }
            }
        }
        self.outlines.push(outline.iter().map(|p| p.map(|v| v / area.pitch())).collect());
    }

    /// Adds what another one has of the same section.
    pub(super) fn join(&mut self, other: Self) {
        self.rises.extend(other.rises);
        self.outlines.extend(other.outlines);
    }

    /// The fewest fragments in one direction.
    pub(super) fn least(&self) -> f64 {
        self.fragments(Directions::cos_sin(self.best()))
    }

    /// The direction of the fewest fragments; of several the least, along x where none is better.
    fn best(&self) -> u16 {
        let level = |g: &[f64; 2]| {
            let degrees = math::atan2(-g[0], g[1]).to_degrees().rem_euclid(180.0);
            (degrees * 100.0).round() as u16 % Directions::COUNT
        };
        let flat = |g: &&[f64; 2]| **g != [0.0, 0.0];
        let mut candidates: Vec<u16> = self.rises.iter().filter(flat).map(level).collect();
        candidates.extend([0, Directions::COUNT / 2]);
        candidates.sort_unstable();
        candidates.dedup();
        let fragments = candidates.into_iter().map(|c| (self.fragments(Directions::cos_sin(c)), c));
        let least = fragments.fold((f64::INFINITY, 0), |best, next| if next.0 < best.0 { next } else { best });
        least.1
    }

    /// Fragments of lines of direction `t`.
    pub(super) fn fragments(&self, t: [f64; 2]) -> f64 {
        let lines = self.outlines.iter().filter_map(|outline| {
            let across: Vec<[f64; 2]> = outline.iter().map(|p| [t[0] * p[1] - t[1] * p[0], 0.0]).collect();
            extremes(&across).map(|[lo, hi]| hi[0] - lo[0])
        });
        let levels = self.rises.iter().map(|g| (g[0] * t[0] + g[1] * t[1]).abs());
        lines.sum::<f64>() + levels.sum::<f64>()
    }
}

/// The mean slope of what is marked from `at` - `half` to `at` + `half`, and its share; None where nothing
/// is.
fn slope(tracer: &mut Tracer<'_>, at: [f64; 2], half: [f64; 2]) -> Option<(f64, f64)> {
    let end = |sign: f64| P2::new(nearest(at[0] + sign * half[0]), nearest(at[1] + sign * half[1]));
    let (a, b) = (end(-1.0), end(1.0));
    if a == b {
        return None;
    }
    let mut rise = 0.0;
    let mut share = 0.0;
    tracer.segment(a, b, |p| {
        if p.skip.is_none() {
            rise += p.z1 - p.z0;
            share += p.t1 - p.t0;
        }
    });
    (share > 0.0).then(|| (rise / (share * a.distance(b)), share))
}

/// Lower left and upper right corner of the box of points; None of no points.
fn extremes(points: &[[f64; 2]]) -> Option<[[f64; 2]; 2]> {
    let first = *points.first()?;
    Some(
        points.iter().fold([first, first], |[lo, hi], p| {
            [[lo[0].min(p[0]), lo[1].min(p[1])], [hi[0].max(p[0]), hi[1].max(p[1])]]
        }),
    )
}

/// Whether a point lies in a convex outline that runs counter-clockwise.
fn holds(outline: &[[f64; 2]], p: [f64; 2]) -> bool {
    let sides = outline.iter().zip(outline.iter().cycle().skip(1));
    sides.into_iter().all(|(a, b)| (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]) >= 0.0)
}
