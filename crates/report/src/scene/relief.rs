//! The part as the lens sees it: heights on a grid.

use terrace_core::geom::{Box2, Grid, NM_PER_MM, Nm, P2};
use terrace_core::parallel;
use terrace_input::surface::{Cursor, Surface};

/// Heights of the topmost surface at the centres of square cells.
#[derive(Clone, Debug)]
pub struct Relief {
    /// The cells; row 0 has the lowest y.
    pub grid: Grid,
    /// Height, mm; NaN where there is no part.
    pub z_mm: Vec<f32>,
}

impl Relief {
    /// The surface in a box, with square cells, at most `cells` along the longer side of the box.
    pub fn under(surface: &Surface, area: Box2, cells: i64) -> Self {
        let size = area.size();
        // More than the quotient, so that the cells stay within what was asked for; from 2 nm, so that half is not 0.
        let pitch = (size[0].max(size[1]) / cells.max(1) + Nm(1)).max(Nm(2));
        let grid = Grid { origin: area.lo, pitch: [pitch; 2], count: size.map(|s| (s / pitch + 1) as u32) };
        let columns = grid.columns();
        let mut z_mm = vec![f32::NAN; grid.len()];
        parallel::map_items(z_mm.chunks_mut(columns).collect(), |row, heights: &mut [f32]| {
            let mut cursor = Cursor::default();
            let mut spans = Vec::new();
            let Nm(half) = pitch / 2;
            let y = grid.origin.y + pitch.0 * row as i64 + half;
            // Along the centres of the cells of a row, from the left border of the grid to its right one.
            let (left, right) = (grid.origin.x, grid.origin.x + pitch.0 * columns as i64);
            surface.walk(P2::new(left, y), P2::new(right, y), &mut cursor, &mut spans);
            let mut i = 0;
            for (column, height) in heights.iter_mut().enumerate() {
                let t = (column as f64 + 0.5) / columns as f64;
                // Spans leave nothing out from 0 to 1 and columns come in order, so both are gone through once.
                while spans[i].t1 < t {
                    i += 1;
                }
                let span = &spans[i];
                if span.facet().is_some() {
                    let z = span.z0 + (span.z1 - span.z0) * ((t - span.t0) / (span.t1 - span.t0));
                    *height = (z / NM_PER_MM) as f32;
                }
            }
        });
        Self { grid, z_mm }
    }

    /// Lowest and highest, mm; None without part.
    pub(crate) fn range_mm(&self) -> Option<[f32; 2]> {
        let on = || self.z_mm.iter().copied().filter(|z| !z.is_nan());
        on().reduce(f32::min).zip(on().reduce(f32::max)).map(|(lo, hi)| [lo, hi])
    }
}
