//! Cracks: rims of a mesh that face each other across a gap narrower than the spot.
//!
//! Consumes the rims of a welded mesh; promises how many corners on them face another rim, both looking away from their
//! facets into the gap, with the distance in space at most the one given. A gap that the grid of the program cannot
//! hold is none; nor is a step along z without a gap in plan, which the lens does not see.
//!
//! Limit: of rims or comparisons beyond [`MAX_RIMS`] and [`MAX_COMPARED`] the rest is not looked at.

use super::vertex::{ON_RIM, Vertex};
use terrace_core::geom::{Box2, Buckets, Grid, Nm, P2};
use terrace_core::math;

/// Rims that are looked at: some 100 MB.
const MAX_RIMS: usize = 1_000_000;
/// Pairs of a corner and a rim that are compared: some seconds.
const MAX_COMPARED: usize = 100_000_000;
/// References per rim beyond which cells are made larger.
const MAX_REFS: usize = 4;
/// Cosine beyond which two rims do not face each other.
const FACING: f64 = -0.7;

/// Cosine of the direction across a gap against that out of either rim, at least.
const ACROSS: f64 = 0.5;

/// The narrow gaps of a mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Gaps {
    /// Corners on rims that face another rim.
    pub count: usize,
    /// One of them.
    pub at: u32,
    /// The widest gap, nm.
    pub widest_nm: f64,
    /// How many of them have a corner of the other rim as near, and how far the farthest of these is, nm.
    pub weldable: (usize, f64),
}

/// A rim from corner to corner, its facet on the left.
#[derive(Clone, Copy)]
struct Rim {
    ends: [u32; 2],
    from: [f64; 3],
    to: [f64; 3],
    /// The direction away from the facet, in plan, of length 1.
    out: [f64; 2],
}

impl Rim {
    fn new(vertices: &[Vertex], facets: &[[u32; 3]], he: u32) -> Option<Self> {
        let f = &facets[he as usize / 3];
        let ends = [f[he as usize % 3], f[(he as usize % 3 + 1) % 3]];
        let [from, to] = ends.map(|v| place(vertices[v as usize]));
        let [dx, dy] = [to[0] - from[0], to[1] - from[1]];
        let length = math::hypot(dx, dy);
        (length > 0.0).then(|| Self { ends, from, to, out: [dy / length, -dx / length] })
    }

    /// The place on the rim that is nearest to a point.
    fn nearest(&self, p: [f64; 3]) -> [f64; 3] {
        let along = |q: [f64; 3]| (0..3).map(|k| (q[k] - self.from[k]) * (self.to[k] - self.from[k])).sum::<f64>();
        let t = (along(p) / along(self.to)).clamp(0.0, 1.0);
        [0, 1, 2].map(|k| self.from[k] + t * (self.to[k] - self.from[k]))
    }
}

fn place(v: Vertex) -> [f64; 3] {
    [f64::from(v.x), f64::from(v.y), v.z]
}

fn distance(p: [f64; 3], q: [f64; 3]) -> f64 {
    (0..3).map(|k| (p[k] - q[k]).powi(2)).sum::<f64>().sqrt()
}

fn dot(u: [f64; 2], v: [f64; 2]) -> f64 {
    u[0] * v[0] + u[1] * v[1]
}

/// The gaps up to `narrow_nm` wide between `rims`, the half-edges of facets that do not stand upright.
pub(super) fn narrow_gaps(
    vertices: &[Vertex],
    facets: &[[u32; 3]],
    mut rims: Vec<u32>,
    narrow_nm: f64,
) -> Option<Gaps> {
    if narrow_nm <= 0.0 {
        return None;
    }
    rims.truncate(MAX_RIMS);
    let rims: Vec<Rim> = rims.iter().filter_map(|&he| Rim::new(vertices, facets, he)).collect();
    if rims.is_empty() {
        return None;
    }
    let rim_cells = RimCells::new(vertices, rims, narrow_nm);
    let rims = &rim_cells.rims;
    // Ends of rims, those at one vertex next to each other.
    let mut corners: Vec<(u32, u32)> =
        rims.iter().enumerate().flat_map(|(i, rim)| rim.ends.map(|v| (v, i as u32))).collect();
    corners.sort_unstable();
    let mut gaps: Option<Gaps> = None;
    let mut compared = 0;
    for at_corner in corners.chunk_by(|x, y| x.0 == y.0) {
        let corner = at_corner[0].0;
        let own = || at_corner.iter().map(move |&(_, i)| rims[i as usize].out);
        if let Some([wide, beside]) = rim_cells.gap_at(corner, own, &mut compared) {
            let gaps = gaps.get_or_insert(Gaps { count: 0, at: corner, widest_nm: 0.0, weldable: (0, 0.0) });
            gaps.count += 1;
            gaps.widest_nm = gaps.widest_nm.max(wide);
            if beside <= narrow_nm {
                gaps.weldable = (gaps.weldable.0 + 1, gaps.weldable.1.max(beside));
            }
        }
        if compared > MAX_COMPARED {
            break;
        }
    }
    gaps
}

/// Rims by cells of a grid.
struct RimCells<'a> {
    vertices: &'a [Vertex],
    rims: Vec<Rim>,
    grid: Grid,
    /// The rims in each cell.
    cells: Buckets<u32>,
    narrow_nm: f64,
}

impl<'a> RimCells<'a> {
    fn new(vertices: &'a [Vertex], rims: Vec<Rim>, narrow_nm: f64) -> Self {
        let (grid, cells) = in_cells(vertices, &rims, narrow_nm);
        Self { vertices, rims, grid, cells, narrow_nm }
    }

    /// The narrowest gap between a corner, whose own rims look out by `own`, and other rims, and the distance of the
    /// nearest corner on the other side, nm; None where there is no gap. Adds the rims that it compares to `compared`.
    fn gap_at<I: Iterator<Item = [f64; 2]>>(
        &self,
        corner: u32,
        own: impl Fn() -> I,
        compared: &mut usize,
    ) -> Option<[f64; 2]> {
        let v = self.vertices[corner as usize];
        let grid = &self.grid;
        let cell = grid.along(1, v.y.into(), 0) as usize * grid.columns() + grid.along(0, v.x.into(), 0) as usize;
        let mut gap = [f64::INFINITY; 2];
        for &other in grid.around(cell).flat_map(|cell| self.cells.of(cell)) {
            *compared += 1;
            let other = &self.rims[other as usize];
            match between(corner, place(v), own(), other, self.narrow_nm) {
                Between::Nothing => {}
                Between::Closed => return None,
                Between::Gap(wide) => {
                    let beside = other.ends.map(|e| distance(place(v), place(self.vertices[e as usize])));
                    gap = [gap[0].min(wide), gap[1].min(beside[0]).min(beside[1])];
                }
            }
        }
        gap[0].is_finite().then_some(gap)
    }
}

/// What lies between a corner and another rim.
enum Between {
    /// They do not face each other.
    Nothing,
    /// They meet: whatever lies behind is not faced across a gap.
    Closed,
    /// A gap of this width, nm.
    Gap(f64),
}

/// What lies between a corner, whose own rims look out by `own`, and another rim.
fn between(corner: u32, at: [f64; 3], mut own: impl Iterator<Item = [f64; 2]>, other: &Rim, narrow_nm: f64) -> Between {
    if other.ends.contains(&corner) {
        return Between::Nothing;
    }
    let near = other.nearest(at);
    let wide = distance(at, near);
    if wide > narrow_nm {
        return Between::Nothing;
    }
    let across = [near[0] - at[0], near[1] - at[1]];
    let length = math::hypot(across[0], across[1]);
    let is_closed = length <= 2.0 * ON_RIM;
    // Along the rims lies the next corner, not the other side.
    let looks = |out: [f64; 2]| is_closed || dot(out, across) > ACROSS * length;
    if own.any(|out| looks(out) && looks(other.out.map(|v| -v)) && dot(out, other.out) < FACING) {
        if is_closed { Between::Closed } else { Between::Gap(wide) }
    } else {
        Between::Nothing
    }
}

/// A grid over the rims whose cells are at least as wide as a narrow gap, and the rims in each.
fn in_cells(vertices: &[Vertex], rims: &[Rim], narrow_nm: f64) -> (Grid, Buckets<u32>) {
    let mut extent = <Box2>::EMPTY;
    let ends = |rim: &Rim| rim.ends.map(|v| vertices[v as usize].p2());
    rims.iter().flat_map(ends).for_each(|p| extent.add(p));
    let lo = P2::new(extent.lo.x - 4, extent.lo.y - 4);
    let w = extent.hi.x - extent.lo.x + 9;
    let h = extent.hi.y - extent.lo.y + 9;
    let about = (w as f64 * h as f64 / rims.len() as f64).sqrt();
    let mut size = (about.ceil() as i64).max(narrow_nm.ceil() as i64).max(w.max(h) / 65_000).max(1000);
    loop {
        let grid = Grid { origin: lo, pitch: [Nm(size); 2], count: [(w / size + 1) as u32, (h / size + 1) as u32] };
        let most = if grid.len() == 1 { usize::MAX } else { rims.len() * MAX_REFS + 64 };
        let mut listed = Vec::new();
        for (i, rim) in rims.iter().enumerate() {
            let [a, b] = ends(rim);
            grid.under(a, b, |cell| {
                if listed.len() <= most {
                    listed.push((cell as u32, i as u32));
                }
            });
            if listed.len() > most {
                break;
            }
        }
        if listed.len() <= most {
            return (grid, Buckets::new(grid.len(), listed.iter().map(|&(cell, i)| (cell as usize, i))));
        }
        size *= 2;
    }
}
