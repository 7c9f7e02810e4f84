//! A height map, walked as an implicit triangulation.
//!
//! Samples are nodes; node positions are rounded to the nanometre grid once. Every cell is cut by the
//! diagonal from its lower left to its upper right node into facet 0 (below it) and facet 1 (above
//! it). A facet exists where its three nodes do. Nothing but the samples and one class byte per cell
//! is held in memory.

use super::bins::Class;
use super::mesh::{NONE, Vertex};
use super::vertex::FacetCorner;
use super::{Heightmap, Samples};
use terrace_core::geom::{NM_PER_MM, P2};

/// A height map on the nanometre grid, local coordinates: part frame less [`ImplicitMesh::origin`].
#[derive(Debug)]
pub(crate) struct ImplicitMesh {
    pub(crate) origin: P2,
    pub(crate) columns: usize,
    pub(crate) rows: usize,
    samples: Samples,
    pitch_nm: f64,
    z_nm: [f64; 2],
}

impl ImplicitMesh {
    pub(crate) fn new(map: Heightmap) -> Self {
        let origin = map.origin_mm.map(|o| (o * NM_PER_MM).round() as i64);
        Self {
            origin: P2::new(origin[0], origin[1]),
            columns: map.columns,
            rows: map.rows,
            samples: map.samples,
            pitch_nm: map.pixel_mm * NM_PER_MM,
            z_nm: map.z_mm.map(|z| z * NM_PER_MM),
        }
    }

    /// Local position of grid line `i`, nm.
    pub(crate) fn line(&self, i: i64) -> i64 {
        (i as f64 * self.pitch_nm).round() as i64
    }

    /// The cell that holds the local coordinate `x`: line(i) <= x < line(i + 1), unbounded either way.
    pub(crate) fn cell_of(&self, x: i64) -> i64 {
        let mut i = (x as f64 / self.pitch_nm).floor() as i64;
        while self.line(i) > x {
            i -= 1;
        }
        while self.line(i + 1) <= x {
            i += 1;
        }
        i
    }

    fn has(&self, i: usize, j: usize) -> bool {
        self.samples.value(j * self.columns + i).is_some()
    }

    /// Heights of all nodes that are not holes, nm.
    pub(crate) fn heights(&self) -> impl Iterator<Item = f64> + '_ {
        (0..self.samples.len()).filter_map(|i| self.samples.value(i)).map(|v| self.z_nm[0] + v * self.z_nm[1])
    }

    /// Node (i, j), which is not a hole.
    pub(crate) fn node(&self, i: usize, j: usize) -> Vertex {
        let v = self.samples.value(j * self.columns + i).unwrap_or(f64::NAN);
        Vertex { x: self.line(i as i64) as i32, y: self.line(j as i64) as i32, z: self.z_nm[0] + v * self.z_nm[1] }
    }

    /// Cells along x and y.
    pub(crate) fn cells(&self) -> [usize; 2] {
        [self.columns - 1, self.rows - 1]
    }

    /// The nodes (i, j) of facet f.
    fn nodes(&self, f: u32) -> [(usize, usize); 3] {
        let cell = f as usize / 2;
        let (i, j) = (cell % (self.columns - 1), cell / (self.columns - 1));
        if f.is_multiple_of(2) { [(i, j), (i + 1, j), (i + 1, j + 1)] } else { [(i, j), (i + 1, j + 1), (i, j + 1)] }
    }

    /// Corner k of facet f.
    pub(crate) fn corner(&self, f: u32, k: usize) -> FacetCorner {
        let (i, j) = self.nodes(f)[k];
        FacetCorner { vertex: self.node(i, j), number: (j * self.columns + i) as u32 }
    }

    /// Whether the three nodes of facet f exist.
    pub(crate) fn exists(&self, f: u32) -> bool {
        self.nodes(f).iter().all(|&(i, j)| self.has(i, j))
    }

    /// Facet `half` of cell (i, j) if the cell and the facet exist.
    pub(crate) fn facet(&self, i: i64, j: i64, half: u32) -> Option<u32> {
        let [nx, ny] = self.cells();
        let inside = (0..nx as i64).contains(&i) && (0..ny as i64).contains(&j);
        let f = inside.then(|| ((j as usize * nx + i as usize) * 2) as u32 + half)?;
        self.exists(f).then_some(f)
    }

    /// The half-edge on the other side of half-edge `he`, or NONE at a rim.
    pub(crate) fn twin(&self, he: u32) -> u32 {
        let (f, k) = (he / 3, he % 3);
        let cell = f as usize / 2;
        let [nx, _] = self.cells();
        let (i, j) = ((cell % nx) as i64, (cell / nx) as i64);
        let (i, j, half, edge) = match (f % 2, k) {
            (0, 0) => (i, j - 1, 1, 1),
            (0, 1) => (i + 1, j, 1, 2),
            (0, _) => (i, j, 1, 0),
            (_, 0) => (i, j, 0, 2),
            (_, 1) => (i, j + 1, 0, 0),
            (_, _) => (i - 1, j, 0, 1),
        };
        self.facet(i, j, half).map_or(NONE, |g| 3 * g + edge)
    }

    /// Column and row of the first and of the last node that exists; None where there is none.
    pub(crate) fn node_box(&self) -> Option<[usize; 4]> {
        let mut b: Option<[usize; 4]> = None;
        for j in 0..self.rows {
            for i in 0..self.columns {
                if self.has(i, j) {
                    let [i0, j0, i1, j1] = b.unwrap_or([i, j, i, j]);
                    b = Some([i0.min(i), j0.min(j), i1.max(i), j1.max(j)]);
                }
            }
        }
        b
    }

    /// The class of every bin: one per cell and a ring around them. Cells whose eight neighbours are
    /// whole are simple; others near the part are complex.
    pub(crate) fn classes(&self) -> Vec<Class> {
        let [nx, ny] = self.cells();
        let (columns, rows) = (nx as i64 + 2, ny as i64 + 2);
        let facets_in = |i: i64, j: i64| (0..2).filter(|&half| self.facet(i, j, half).is_some()).count();
        // Facets of every bin; those of the ring have none.
        let mut counts = Vec::with_capacity((columns * rows) as usize);
        for j in 0..rows {
            counts.extend((0..columns).map(|i| facets_in(i - 1, j - 1) as u8));
        }
        let mut classes = Vec::with_capacity(counts.len());
        for j in 0..rows {
            for i in 0..columns {
                classes.push(match sum_around(&counts, columns, i, j) {
                    0 => Class::Empty,
                    // Nine cells of two facets each: no rim touches the one in the middle.
                    18 => Class::Simple,
                    _ => Class::Complex,
                });
            }
        }
        classes
    }
}

/// The sum of a grid's values, row by row of `columns`, in cell (i, j) and its eight neighbours; outside it is 0.
fn sum_around(values: &[u8], columns: i64, i: i64, j: i64) -> u8 {
    let rows = values.len() as i64 / columns;
    let mut sum = 0;
    for row in (j - 1).max(0)..(j + 2).min(rows) {
        for column in (i - 1).max(0)..(i + 2).min(columns) {
            sum += values[(row * columns + column) as usize];
        }
    }
    sum
}

impl Heightmap {
    /// Hands the facets of the implicit triangulation to `sink`, corners in mm.
    pub fn facets(&self, sink: &mut dyn FnMut([[f64; 3]; 3])) {
        for j in 0..self.rows.saturating_sub(1) {
            for i in 0..self.columns.saturating_sub(1) {
                let lower_left = self.node_mm(i, j);
                let lower_right = self.node_mm(i + 1, j);
                let upper_right = self.node_mm(i + 1, j + 1);
                let upper_left = self.node_mm(i, j + 1);
                for corners in [[lower_left, lower_right, upper_right], [lower_left, upper_right, upper_left]] {
                    if let [Some(a), Some(b), Some(c)] = corners {
                        sink([a, b, c]);
                    }
                }
            }
        }
    }

    /// The place of sample (i, j), mm; None where it is a hole.
    fn node_mm(&self, i: usize, j: usize) -> Option<[f64; 3]> {
        let along = |axis: usize, n: usize| self.origin_mm[axis] + n as f64 * self.pixel_mm;
        let value = self.samples.value(j * self.columns + i)?;
        Some([along(0, i), along(1, j), self.z_mm[0] + value * self.z_mm[1]])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sum_around_counts_neighbours_within_the_grid_only() {
        let values = [1, 2, 4, 8, 16, 32];
        assert_eq!(sum_around(&values, 3, 1, 0), 63);
        assert_eq!(sum_around(&values, 3, 0, 0), 1 + 2 + 8 + 16);
        assert_eq!(sum_around(&values, 3, 2, 1), 2 + 4 + 16 + 32);
    }
}
