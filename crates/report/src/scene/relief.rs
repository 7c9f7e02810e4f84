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
    /// Of a box with about `cells` cells along its longer side.
    pub fn under(surface: &Surface, area: Box2, cells: i64) -> Self {
        let size = area.size();
        let pitch = (size[0].max(size[1]) / cells.max(1) + Nm(1)).max(Nm(2));
        let grid = Grid { origin: area.lo, pitch: [pitch; 2], count: size.map(|s| (s / pitch + 1) as u32) };
        let columns = grid.columns();
        let mut z_mm = vec![f32::NAN; grid.len()];
        parallel::map_items(z_mm.chunks_mut(columns).collect(), |row, heights: &mut [f32]| {
            let mut cursor = Cursor::default();
            let mut spans = Vec::new();
            let Nm(half) = pitch / 2;
            let y = grid.origin.y + pitch.0 * row as i64 + half;
            let (a, b) = (P2::new(grid.origin.x, y), P2::new(grid.origin.x + pitch.0 * columns as i64, y));
            surface.walk(a, b, &mut cursor, &mut spans);
            let mut span = 0;
            for (column, height) in heights.iter_mut().enumerate() {
                let t = (column as f64 + 0.5) / columns as f64;
                // Spans tile 0 to 1 and columns come in order, so both are gone through once.
                while spans[span].t1 < t {
                    span += 1;
                }
                let s = &spans[span];
                if s.facet().is_some() {
                    let z = s.z0 + (s.z1 - s.z0) * ((t - s.t0) / (s.t1 - s.t0));
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
