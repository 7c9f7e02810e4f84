//! The surface in fewer triangles, for pictures.
//!
//! A mesh is divided into cubes, and the vertices of each cube become one, at their mean (Rossignac and Borrel 1993);
//! of a height map every n-th row and column is kept. How far the vertices of the whole surface lie from the triangles
//! that are left is measured, not estimated. Where the surface has few facets it stays as it is.

use rustc_hash::{FxHashMap, FxHashSet};

use super::implicit_mesh::ImplicitMesh;
use super::mesh::{Mesh, Vertex};
use super::{Kind, Surface};
use terrace_core::geom::NM_PER_MM;
use terrace_core::parallel;

/// A surface in fewer triangles, part frame.
#[derive(Clone, Debug, Default)]
pub struct Decimated {
    /// mm.
    pub vertices: Vec<[f64; 3]>,
    /// Of length 1, upwards.
    pub normals: Vec<[f64; 3]>,
    /// Counter-clockwise as the lens sees them.
    pub triangles: Vec<[u32; 3]>,
    /// How many triangles the surface has.
    pub of: usize,
    /// Largest distance of a vertex of the surface from these triangles, mm.
    pub within_mm: f64,
}

/// Vertices whose distance is measured as one task.
const CHUNK: usize = 4096;
/// Height maps of more samples are measured at every n-th row and column.
const MEASURED: usize = 1_000_000;

impl Surface {
    /// The surface in about so many triangles.
    pub fn decimated(&self, triangles: usize) -> Decimated {
        match &self.kind {
            Kind::Mesh(mesh, _) => of_mesh(mesh, triangles),
            Kind::Implicit(map, _) => of_height_map(map, triangles, self.facets),
        }
    }
}

fn minus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// The normal of a triangle, as long as twice its area.
fn weighted_normal(t: [[f64; 3]; 3]) -> [f64; 3] {
    let (u, v) = (minus(t[1], t[0]), minus(t[2], t[0]));
    [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]]
}

fn unit(v: [f64; 3]) -> [f64; 3] {
    let length = dot(v, v).sqrt();
    if length > 0.0 { v.map(|c| c / length) } else { [0.0, 0.0, 1.0] }
}

/// The vertices of a mesh, mm. They are computed where they are needed: a list of them would be as large as the mesh.
#[derive(Clone, Copy)]
struct Vertices<'a>(&'a Mesh);

impl Vertices<'_> {
    fn count(self) -> usize {
        self.0.vertices.len()
    }

    fn at(self, index: usize) -> [f64; 3] {
        let (Vertex { x, y, z }, origin) = (self.0.vertices[index], self.0.origin);
        [origin.x as f64 + f64::from(x), origin.y as f64 + f64::from(y), z].map(|nm| nm / NM_PER_MM)
    }

    fn all(self) -> impl Iterator<Item = [f64; 3]> {
        (0..self.count()).map(move |i| self.at(i))
    }
}

fn of_mesh(mesh: &Mesh, wanted: usize) -> Decimated {
    let points = Vertices(mesh);
    let of = |f: &[u32; 3]| f.map(|v| points.at(v as usize));
    let all = mesh.facets.len() + mesh.upright.len();
    // Of cubes as wide as this a plane of the part's area takes the triangles that are wanted; none fewer than there
    // are.
    let size = if all <= wanted {
        0.0
    } else {
        let area = |f: &[u32; 3]| {
            let normal = weighted_normal(of(f));
            dot(normal, normal).sqrt() / 2.0
        };
        let whole: f64 = mesh.facets.iter().chain(&mesh.upright).map(area).sum();
        (2.0 * whole / wanted as f64).sqrt()
    };
    let Clusters { of_vertex, mut vertices, mut normals } = Clusters::new(points, size);
    let mut triangles = Vec::new();
    let mut seen = FxHashSet::default();
    for (k, facet) in mesh.facets.iter().chain(&mesh.upright).enumerate() {
        let t = facet.map(|v| of_vertex[v as usize]);
        if k < mesh.facets.len() {
            let a = weighted_normal(of(facet));
            for &v in &t {
                let n = &mut normals[v as usize];
                *n = [n[0] + a[0], n[1] + a[1], n[2] + a[2]];
            }
        }
        if t[0] == t[1] || t[1] == t[2] || t[2] == t[0] {
            continue;
        }
        let mut key = t;
        key.sort_unstable();
        if size == 0.0 || seen.insert(key) {
            triangles.push(t);
        }
    }
    normals.iter_mut().for_each(|n| *n = unit(*n));
    // Clusters of facets too small to leave a triangle are not drawn.
    let within_mm = if size == 0.0 { 0.0 } else { farthest(points, &of_vertex, &vertices, &triangles) };
    compact(&mut vertices, &mut normals, &mut triangles);
    Decimated { vertices, normals, triangles, of: all, within_mm }
}

/// Vertices by cube.
struct Clusters {
    of_vertex: Vec<u32>,
    vertices: Vec<[f64; 3]>,
    normals: Vec<[f64; 3]>,
}

impl Clusters {
    /// Cubes of a size, mm; 0 for every vertex by itself.
    fn new(points: Vertices<'_>, size: f64) -> Self {
        if size == 0.0 {
            let of_vertex = (0..points.count() as u32).collect();
            return Self { of_vertex, vertices: points.all().collect(), normals: vec![[0.0; 3]; points.count()] };
        }
        let mut known: FxHashMap<[i32; 3], u32> = FxHashMap::default();
        let (mut sums, mut counts): (Vec<[f64; 3]>, Vec<f64>) = (Vec::new(), Vec::new());
        let of_vertex = points
            .all()
            .map(|p| {
                let cube = p.map(|c| (c / size).floor() as i32);
                let i = *known.entry(cube).or_insert_with(|| {
                    sums.push([0.0; 3]);
                    counts.push(0.0);
                    counts.len() as u32 - 1
                });
                let sum = &mut sums[i as usize];
                *sum = [sum[0] + p[0], sum[1] + p[1], sum[2] + p[2]];
                counts[i as usize] += 1.0;
                i
            })
            .collect();
        let vertices: Vec<[f64; 3]> = sums.iter().zip(&counts).map(|(s, n)| s.map(|c| c / n)).collect();
        let normals = vec![[0.0; 3]; vertices.len()];
        Self { of_vertex, vertices, normals }
    }
}

/// The largest distance of a point from the triangles that meet in its cluster, or from that where none does.
fn farthest(points: Vertices<'_>, of_vertex: &[u32], vertices: &[[f64; 3]], triangles: &[[u32; 3]]) -> f64 {
    let corners = || triangles.iter().enumerate().flat_map(|(t, c)| c.map(|v| (v as usize, t as u32)));
    let around = terrace_core::geom::Buckets::new(vertices.len(), corners());
    let chunks = parallel::map(points.count().div_ceil(CHUNK), |k| {
        let range = k * CHUNK..((k + 1) * CHUNK).min(points.count());
        let far = range.map(|i| {
            let point = points.at(i);
            let cluster = of_vertex[i] as usize;
            let near = around
                .of(cluster)
                .iter()
                .map(|&t| distance2(point, triangles[t as usize].map(|v| vertices[v as usize])));
            let d = minus(point, vertices[cluster]);
            near.fold(dot(d, d), f64::min)
        });
        far.fold(0.0, f64::max)
    });
    chunks.into_iter().fold(0.0, f64::max).sqrt()
}

/// Square of the distance of a point from a triangle.
fn distance2(p: [f64; 3], [a, b, c]: [[f64; 3]; 3]) -> f64 {
    let n = weighted_normal([a, b, c]);
    let nn = dot(n, n);
    if nn > 0.0 {
        // The foot of the perpendicular, if it lies within.
        let ap = minus(p, a);
        let (u, v) = (minus(b, a), minus(c, a));
        let cross = |x: [f64; 3], y: [f64; 3]| {
            [x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0]]
        };
        let (s, t) = (dot(cross(ap, v), n) / nn, dot(cross(u, ap), n) / nn);
        if s >= 0.0 && t >= 0.0 && s + t <= 1.0 {
            let off = dot(ap, n);
            return off * off / nn;
        }
    }
    [[a, b], [b, c], [c, a]]
        .into_iter()
        .map(|[a, b]| {
            let (ab, ap) = (minus(b, a), minus(p, a));
            let length2 = dot(ab, ab);
            let t = if length2 > 0.0 { (dot(ap, ab) / length2).clamp(0.0, 1.0) } else { 0.0 };
            let off = minus(ap, ab.map(|c| c * t));
            dot(off, off)
        })
        .fold(f64::INFINITY, f64::min)
}

/// Drops the vertices that no triangle has.
fn compact(vertices: &mut Vec<[f64; 3]>, normals: &mut Vec<[f64; 3]>, triangles: &mut [[u32; 3]]) {
    let mut place = vec![u32::MAX; vertices.len()];
    let mut kept = Vec::new();
    let mut looks = Vec::new();
    for v in triangles.iter_mut().flatten() {
        let i = *v as usize;
        if place[i] == u32::MAX {
            place[i] = kept.len() as u32;
            kept.push(vertices[i]);
            looks.push(normals[i]);
        }
        *v = place[i];
    }
    (*vertices, *normals) = (kept, looks);
}

/// A height map with fewer lines of samples, about `wanted` of its `of` triangles.
fn of_height_map(map: &ImplicitMesh, wanted: usize, of: usize) -> Decimated {
    let step = (of as f64 / wanted.max(1) as f64).sqrt().ceil().max(1.0) as usize;
    let xs = kept_lines(map.columns, step);
    let ys = kept_lines(map.rows, step);
    let mut vertices = Vec::with_capacity(xs.len() * ys.len());
    for &j in &ys {
        vertices.extend(xs.iter().map(|&i| node_mm(map, i, j)));
    }
    let mut triangles = grid_triangles(&vertices, [xs.len(), ys.len()]);
    let mut normals = vertex_normals(&vertices, &triangles);
    let within_mm = if step == 1 { 0.0 } else { farthest_sample(map, [&xs, &ys], &vertices) };
    compact(&mut vertices, &mut normals, &mut triangles);
    Decimated { vertices, normals, triangles, of, within_mm }
}

/// Every line whose number is a multiple of `step`, and the last.
fn kept_lines(count: usize, step: usize) -> Vec<usize> {
    let mut lines: Vec<usize> = (0..count).step_by(step).collect();
    if lines.last() != Some(&(count - 1)) {
        lines.push(count - 1);
    }
    lines
}

/// Node (i, j) of a map, part frame, mm; z is NaN where it is a hole.
fn node_mm(map: &ImplicitMesh, i: usize, j: usize) -> [f64; 3] {
    let v = map.node(i, j);
    let nm = [map.origin.x as f64 + f64::from(v.x), map.origin.y as f64 + f64::from(v.y), v.z];
    nm.map(|c| c / NM_PER_MM)
}

/// The triangles of a grid of so many columns and rows of vertices; none at a hole.
fn grid_triangles(vertices: &[[f64; 3]], [columns, rows]: [usize; 2]) -> Vec<[u32; 3]> {
    let is_there = |v: u32| !vertices[v as usize][2].is_nan();
    let mut triangles = Vec::new();
    for j in 0..rows - 1 {
        for i in 0..columns - 1 {
            let [a, b] = [j * columns + i, (j + 1) * columns + i].map(|v| v as u32);
            let both = [[a, a + 1, b + 1], [a, b + 1, b]];
            triangles.extend(both.into_iter().filter(|t| t.iter().all(|&v| is_there(v))));
        }
    }
    triangles
}

/// The normals of vertices, of length 1: those of their triangles, weighted by area; upwards where no triangle is.
fn vertex_normals(vertices: &[[f64; 3]], triangles: &[[u32; 3]]) -> Vec<[f64; 3]> {
    let mut normals = vec![[0.0; 3]; vertices.len()];
    for t in triangles {
        let weighted = weighted_normal(t.map(|v| vertices[v as usize]));
        for &v in t {
            let sum = &mut normals[v as usize];
            *sum = [sum[0] + weighted[0], sum[1] + weighted[1], sum[2] + weighted[2]];
        }
    }
    normals.iter_mut().for_each(|n| *n = unit(*n));
    normals
}

/// The largest distance along z of a sample from the triangles over the kept lines; next to a hole there are none.
fn farthest_sample(map: &ImplicitMesh, [xs, ys]: [&[usize]; 2], vertices: &[[f64; 3]]) -> f64 {
    let every = (((map.columns * map.rows) as f64 / MEASURED as f64).sqrt().ceil() as usize).max(1);
    let rows: Vec<usize> = (0..map.rows).step_by(every).collect();
    let of_row = parallel::map(rows.len(), |r| {
        let j = rows[r];
        let row = (ys.partition_point(|&y| y <= j) - 1).min(ys.len() - 2);
        let mut worst = 0f64;
        for i in (0..map.columns).step_by(every) {
            let column = (xs.partition_point(|&x| x <= i) - 1).min(xs.len() - 2);
            let z = node_mm(map, i, j)[2];
            let (s, t) = (
                (i - xs[column]) as f64 / (xs[column + 1] - xs[column]) as f64,
                (j - ys[row]) as f64 / (ys[row + 1] - ys[row]) as f64,
            );
            let z_of = |c: usize, r: usize| vertices[(row + r) * xs.len() + column + c][2];
            let flat = if s >= t {
                z_of(0, 0) + s * (z_of(1, 0) - z_of(0, 0)) + t * (z_of(1, 1) - z_of(1, 0))
            } else {
                z_of(0, 0) + t * (z_of(0, 1) - z_of(0, 0)) + s * (z_of(1, 1) - z_of(0, 1))
            };
            let off = (z - flat).abs();
            // NaN at and next to holes is not a distance.
            worst = if off > worst { off } else { worst };
        }
        worst
    });
    of_row.into_iter().fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A sphere of radius 50 over a square of 60 x 60 mm, n x n cells.
    fn dome(n: usize) -> Surface {
        let at = |i: usize, j: usize| {
            let [x, y] = [i, j].map(|k| 60.0 * k as f64 / n as f64 - 30.0);
            [x, y, (2500.0 - x * x - y * y).sqrt()]
        };
        let facets = (0..n * n).flat_map(|c| {
            let (i, j) = (c % n, c / n);
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            [[a, b, c], [a, c, d]]
        });
        Surface::from_facets(facets, &mut Vec::new()).expect("facets")
    }

    #[test]
    fn a_decimated_dome_has_the_triangles_asked_for_and_lies_within_what_it_states() {
        let surface = dome(120);
        let whole = surface.decimated(1_000_000);
        assert_eq!((whole.triangles.len(), whole.of, whole.within_mm), (28_800, 28_800, 0.0));
        let few = surface.decimated(3_000);
        assert!((1_500..6_000).contains(&few.triangles.len()), "{}", few.triangles.len());
        assert!(few.within_mm > 0.001 && few.within_mm < 1.5, "{}", few.within_mm);
        // Normals of a sphere are its radii.
        for (v, n) in few.vertices.iter().zip(&few.normals) {
            let r = unit(*v);
            assert!(dot(r, *n) > 0.98, "{v:?} {n:?}");
        }
        // All points of the triangles lie inside the sphere and no deeper than is stated, and a chord of two cubes.
        for t in &few.triangles {
            let middle = [0, 1, 2].map(|k| t.iter().map(|&v| few.vertices[v as usize][k]).sum::<f64>() / 3.0);
            let off = dot(middle, middle).sqrt() - 50.0;
            assert!(off < 1e-9 && off > -few.within_mm - 0.1, "{off} {}", few.within_mm);
        }
    }

    #[test]
    fn the_last_line_is_kept_once() {
        assert_eq!(kept_lines(7, 3), [0, 3, 6]);
        assert_eq!(kept_lines(8, 3), [0, 3, 6, 7]);
        assert_eq!(kept_lines(2, 5), [0, 1]);
    }

    #[test]
    fn distance_from_a_triangle_is_that_of_its_inside_edge_or_corner() {
        let t = [[0.0; 3], [2.0, 0.0, 0.0], [0.0, 2.0, 0.0]];
        for (p, d) in [([0.5, 0.5, 3.0], 3.0), ([1.0, -2.0, 0.0], 2.0), ([-3.0, 0.0, 4.0], 5.0)] {
            assert!((distance2(p, t) - d * d).abs() < 1e-12, "{p:?}");
        }
    }
}
