//! The part's surface as the lens sees it.
//!
//! A file is read facet by facet ([`read`]); a mesh is welded, a height map stays a grid. Of several
//! sheets under the lens the topmost counts, whatever a facet's winding.
//!
//! Units: file readers hand over f64 mm in the part frame; the walk works in nm (x and y integers).

mod along_edges;
mod bins;
pub mod bodies;
#[cfg(test)]
mod brute;
mod cad;
mod corrected;
mod decimate;
mod facets;
mod facing;
mod faults;
pub mod format;
mod heightmap;
mod implicit_mesh;
mod lines;
mod mesh;
#[cfg(test)]
mod mutants;
mod narrow_gaps;
mod obj;
mod ply;
mod points;
mod polygon;
mod rim;
mod stated_unit;
mod stl;
mod threemf;
mod topmost;
mod topology;
mod trail;
mod vertex;
mod walk;

use std::ops::RangeInclusive;
use std::path::Path;

use bins::{Bins, Class};
pub use cad::{About, CadMesh, PACKAGE as CAD_PACKAGE, Tessellation, load as load_cad};
pub use decimate::Decimated;
pub use facing::Facing;
pub use faults::{Fault, FaultKind, NonManifold};
use format::{SurfaceFile, SurfaceKind};
pub use heightmap::Samples;
use implicit_mesh::ImplicitMesh;
use lines::Lines;
use mesh::{Mesh, Welder};
pub use topmost::Span;
pub use topology::Joining;
pub use trail::Trail;
pub use walk::Cursor;

use terrace_core::diag::{Diag, Error, Place};
use terrace_core::geom::{Box2, BoxMm, Correction, MAX_NM, NM_PER_MM, Nm, P2, P3, Pose, SpacePoint, Turn};
use terrace_core::progress::Task;

/// How a surface file is to be read.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Options {
    /// mm in one unit of the file; None where the job states none (height maps and files that state theirs need none).
    pub unit_mm: Option<f64>,
    /// Where the part's origin lies in the file, in its unit; None: at its origin.
    pub datum: Option<[f64; 3]>,
    /// Factor on all coordinates, such as that of a map; None: 1.
    pub scale: Option<f64>,
    /// Scale of a height map.
    pub heightmap: Option<Scale>,
    /// Longest triangle edge for point clouds, mm.
    pub max_edge_mm: Option<f64>,
    /// How finely STEP and IGES become facets; default: within 10 um.
    pub tessellation: Option<Tessellation>,
    /// How the part is laid: a rotation of what the file holds, in mm, about its origin.
    pub pose: Option<Pose>,
}

/// Scale of a height map, mm.
#[derive(Clone, Debug, PartialEq)]
pub struct Scale {
    /// Distance of neighbouring samples.
    pub pixel_mm: f64,
    /// Heights of the two values.
    pub z_mm: [f64; 2],
    /// The two values; None for the full range of the file's depth, where its samples are whole numbers.
    pub values: Option<[f64; 2]>,
    /// Value of samples that are holes, beside those that the file states.
    pub nodata: Option<f64>,
    /// Part-frame position of the lower left sample.
    pub origin_mm: [f64; 2],
}

/// A height map: samples are nodes of a grid; row 0 of `samples` is the lowest y (an image's last row).
#[derive(Clone, Debug)]
pub struct Heightmap {
    /// Samples along x.
    pub columns: usize,
    /// Samples along y.
    pub rows: usize,
    /// Values, row by row from the lowest y.
    pub samples: Samples,
    /// Position of sample (0, 0), mm.
    pub origin_mm: [f64; 2],
    /// Distance of samples, mm.
    pub pixel_mm: f64,
    /// z in mm of value v is `z_mm[0] + v * z_mm[1]`.
    pub z_mm: [f64; 2],
}

/// What a surface file held.
pub enum Content {
    /// Facets; they went to the sink, this many.
    Facets(usize),
    /// Facets of exact surfaces, this many, and how far they lie from these, mm: the chord tolerance, or what the
    /// converter measured where that is more.
    Tessellated(usize, f64),
    /// A height map.
    Heightmap(Heightmap),
}

/// Memory of a mesh that is ready to be walked, bytes a facet: 64 as measured, with two facets a vertex.
const FACET_BYTES: u64 = 64;

/// Facets that are counted as one step of reading.
const COUNTED: usize = 1 << 14;

/// How many facets a surface file holds if it is binary STL, and about that where it is in another format; for progress
/// alone.
fn facets_expected(path: &Path) -> usize {
    const BYTES: u64 = 50;
    std::fs::metadata(path).map_or(0, |file| file.len() / BYTES) as usize
}

/// Memory of a triangulated cloud, bytes a point.
const POINT_BYTES: u64 = 200;

/// Reads a surface file. Facets of meshes and of triangulated point clouds go to `sink` in file
/// order, corners in mm in the part frame, as the file has them: not welded, degenerate ones included.
/// A height map that is rotated becomes facets.
///
/// # Errors
/// Every fault of the file, with its place and remedy.
pub fn read(
    path: &Path,
    options: &Options,
    notes: &mut Vec<Diag>,
    sink: &mut dyn FnMut([[f64; 3]; 3]),
) -> Result<Content, Error> {
    // Points are rotated before they are triangulated.
    let Some(pose) = options.pose.filter(|_| !is_cloud(path)) else { return read_file(path, options, notes, sink) };
    let mut lay = |facet: [[f64; 3]; 3]| sink(facet.map(|p| pose.apply(p)));
    Ok(match read_file(path, options, notes, &mut lay)? {
        Content::Heightmap(map) => {
            let mut count = 0;
            map.facets(&mut |facet| {
                count += 1;
                lay(facet);
            });
            Content::Facets(count)
        }
        content => content,
    })
}

/// Whether a file holds points that are triangulated, by its name and how it begins.
pub fn is_cloud(path: &Path) -> bool {
    format::of(path).is_some_and(|format| format.holds == SurfaceKind::Points)
        && Lines::open(path, "a point cloud").is_ok_and(|lines| !heightmap::esri_grid::begins(lines.head()))
}

/// Whether a path names a file of exact surfaces, by its extension; such files state their unit.
pub fn is_cad(path: &Path) -> bool {
    format::of(path).is_some_and(|format| format.holds == SurfaceKind::ExactSurfaces)
}

/// Whether a path names a file of facets or exact surfaces, by its extension.
pub fn holds_facets(path: &Path) -> bool {
    let kinds = [SurfaceKind::Facets, SurfaceKind::ExactSurfaces];
    format::of(path).is_some_and(|format| kinds.contains(&format.holds))
}

/// Whether the job has to state the unit of a file of facets or exact surfaces.
pub fn needs_unit(path: &Path) -> bool {
    !is_cad(path) && !format::of(path).is_some_and(|format| format.extensions.contains(&"3mf"))
}

/// Reads a surface file; points alone are laid as the options say.
fn read_file(
    path: &Path,
    options: &Options,
    notes: &mut Vec<Diag>,
    sink: &mut dyn FnMut([[f64; 3]; 3]),
) -> Result<Content, Error> {
    let Some(format) = format::of(path) else { return Err(format::unread(path).into()) };
    (format.read)(SurfaceFile { path, name: format.name, options, notes, sink })
}

/// Looks for what is wrong with facets as they come.
pub struct MeshCheck(Welder);

impl Default for MeshCheck {
    fn default() -> Self {
        Self(Welder::new([1.0, 0.0], Joining::default()))
    }
}

impl MeshCheck {
    /// Takes a facet, corners in mm.
    pub fn facet(&mut self, corners: [[f64; 3]; 3]) {
        self.0.facet(corners);
    }

    /// What was wrong, each kind once; `narrow_mm` is the width up to which a gap is a crack.
    ///
    /// # Errors
    /// The faults of [`Surface::load`] by which nothing would be marked.
    pub fn finish(mut self, path: &Path, narrow_mm: f64) -> Result<Vec<Fault>, Error> {
        self.0.joining.narrow_mm = narrow_mm;
        Ok(self.0.finish(&path.display().to_string(), &mut Vec::new())?.1)
    }
}

/// The surface as the lens sees it, ready to be walked.
#[derive(Debug)]
pub struct Surface {
    kind: Kind,
    part_box_mm: BoxMm<2>,
    facets: usize,
    tessellation_mm: Option<f64>,
}

#[derive(Debug)]
enum Kind {
    Mesh(Mesh, Bins),
    /// Classes of the bins: the cells with one ring of bins around them.
    Implicit(ImplicitMesh, Vec<Class>),
}

impl Surface {
    /// Reads a surface file and prepares it. `turn_rad` turns the part about its z axis; a turned
    /// height map becomes a mesh, an unturned one stays a grid. `each` is called with each facet of a mesh, mm, as the
    /// file has it.
    ///
    /// # Errors
    /// Faults of the file; `surface-zero-area`, `surface-edge-on`, `surface-large`, `surface-non-manifold`.
    pub fn load(
        path: &Path,
        options: &Options,
        joining: Joining,
        turn_rad: f64,
        notes: &mut Vec<Diag>,
        each: &mut dyn FnMut([[f64; 3]; 3]),
        task: Task<'_>,
    ) -> Result<Self, Error> {
        let [reading, joined] = task.split([1, 1]);
        let shown = path.display().to_string();
        let turn = terrace_core::geom::cos_sin(turn_rad);
        let mut count = 0usize;
        let reading = reading.of_steps(facets_expected(path).div_ceil(COUNTED));
        let (mut welder, content) = Welder::new(turn, joining).fed_by(|weld| {
            read(path, options, notes, &mut |facet| {
                weld(facet);
                each(facet);
                count += 1;
                if count.is_multiple_of(COUNTED) {
                    reading.step();
                }
            })
        });
        drop(reading);
        let map = match content? {
            Content::Facets(_) => return Self::from_welder(welder, &shown, notes, joined),
            Content::Tessellated(_, off) => {
                let surface = Self::from_welder(welder, &shown, notes, joined)?;
                return Ok(Self { tessellation_mm: Some(off), ..surface });
            }
            Content::Heightmap(map) => map,
        };
        if [map.columns, map.rows].iter().any(|&n| n as f64 * map.pixel_mm * NM_PER_MM > f64::from(i32::MAX)) {
            let d = Diag::input("surface-large", "the height map is larger than 2.1 m").at(Place::file(&shown));
            return Err(d.hint("check surface.heightmap.pixel").into());
        }
        if turn != [1.0, 0.0] {
            map.facets(&mut |facet| welder.facet(facet));
            return Self::from_welder(welder, &shown, notes, joined);
        }
        let empty = || Diag::input("heightmap-empty", "every sample is nodata").at(Place::file(&shown)).into();
        Self::from_heightmap(map).ok_or_else(empty)
    }

    /// An unturned height map; None where every sample is a hole.
    fn from_heightmap(map: Heightmap) -> Option<Self> {
        let origin = map.origin_mm;
        let pixel = map.pixel_mm;
        let grid = ImplicitMesh::new(map);
        let [i0, j0, i1, j1] = grid.node_box()?;
        let at = |o: f64, i: usize| o + i as f64 * pixel;
        let corner = |[i, j]: [usize; 2]| [at(origin[0], i), at(origin[1], j)];
        let part_box_mm = BoxMm { lo: corner([i0, j0]), hi: corner([i1, j1]) };
        let facets = 2 * grid.cells()[0] * grid.cells()[1];
        let class = grid.classes();
        Some(Self { kind: Kind::Implicit(grid, class), part_box_mm, facets, tessellation_mm: None })
    }

    /// The surface of a file in millimetres, read as a job reads it that states nothing else: for tests and benches.
    ///
    /// # Errors
    /// Those of [`Surface::load`].
    pub fn load_mm(path: &Path) -> Result<Self, Error> {
        let options = Options { unit_mm: Some(1.0), ..Options::default() };
        Self::load(path, &options, Joining::default(), 0.0, &mut Vec::new(), &mut |_| {}, Task::silent())
    }

    /// A surface of the given facets (mm), for tests and benches.
    ///
    /// # Errors
    /// Those of [`Surface::load`].
    pub fn from_facets(facets: impl IntoIterator<Item = [[f64; 3]; 3]>, notes: &mut Vec<Diag>) -> Result<Self, Error> {
        let joining = Joining { non_manifold: NonManifold::Topmost, ..Joining::default() };
        let mut welder = Welder::new([1.0, 0.0], joining);
        facets.into_iter().for_each(|f| welder.facet(f));
        Self::from_welder(welder, "facets", notes, Task::silent())
    }

    fn from_welder(welder: Welder, shown: &str, notes: &mut Vec<Diag>, task: Task<'_>) -> Result<Self, Error> {
        let part_box_mm = welder.part_box_mm();
        if part_box_mm.lo.iter().chain(&part_box_mm.hi).any(|v| v.abs() * NM_PER_MM > MAX_NM.f64()) {
            let d = Diag::input("surface-large", "the part lies beyond 4 m of its origin").at(Place::file(shown));
            return Err(d.hint("check the unit of the part, or move the part to its origin").into());
        }
        let rule = welder.joining.non_manifold;
        let [joining, _binning] = task.split([2, 1]);
        let (mesh, faults) = welder.finish(shown, notes)?;
        drop(joining);
        let (wrong, warnings): (Vec<_>, Vec<_>) = faults
            .iter()
            .map(|fault| fault.diag(Place::file(shown), rule))
            .partition(|d| d.kind != terrace_core::diag::Kind::Warning);
        notes.extend(warnings);
        if !wrong.is_empty() {
            return Err(Error::many(wrong));
        }
        let facets = mesh.facets.len();
        let bins = Bins::new(&mesh);
        Ok(Self { kind: Kind::Mesh(mesh, bins), part_box_mm, facets, tessellation_mm: None })
    }

    /// The surface as a rigid motion takes it, raised by a correction, with its box as it lies then. Walls that stood
    /// upright may lean.
    ///
    /// # Errors
    /// Those of [`Surface::load`].
    pub fn moved(&self, motion: &Turn, correction: Option<&Correction>, joining: Joining) -> Result<Self, Error> {
        let mut welder = Welder::new([1.0, 0.0], joining);
        let mut add = |facet: [SpacePoint; 3]| welder.facet(facet.map(|at| at.map(|nm| nm / NM_PER_MM)));
        self.each_facet(&mut |facet| {
            let facet = facet.map(|at| motion.apply(P3::new(at)).at);
            match correction {
                Some(correction) => corrected::each_piece(facet, correction, &mut add),
                None => add(facet),
            }
        });
        let surface = Self::from_welder(welder, "the part as it lies", &mut Vec::new(), Task::silent())?;
        Ok(Self { tessellation_mm: self.tessellation_mm, ..surface })
    }

    /// The box of the part as its file has it, mm, before any turn.
    pub fn part_box_mm(&self) -> BoxMm<2> {
        self.part_box_mm
    }

    /// Sides of its box along x, y and z, mm, before any turn.
    pub fn size_mm(&self) -> [f64; 3] {
        let [lowest, highest] = match &self.kind {
            Kind::Mesh(mesh, _) => range_of(mesh.vertices.iter().map(|v| v.z)),
            Kind::Implicit(grid, _) => range_of(grid.heights()),
        };
        let [x, y] = self.part_box_mm.size();
        [x, y, (highest - lowest) / NM_PER_MM]
    }

    /// Share of the area of its facets that is steeper than a slope (tangent), 0 to 1.
    pub fn share_steeper(&self, slope: f64) -> f64 {
        let facets = (0..u32::try_from(self.facets).unwrap_or(u32::MAX)).filter(|&f| self.exists(f));
        let [steep, all] = facets.fold([0.0; 2], |[steep, all], f| {
            let [a, b, c] = [0, 1, 2].map(|k| self.corner(f, k).vertex.p2());
            let slope2 = self.slope2(f);
            let area = terrace_core::geom::orient(a, b, c) * (1.0 + slope2).sqrt();
            [steep + if slope2 > slope * slope { area } else { 0.0 }, all + area]
        });
        if all > 0.0 { steep / all } else { 0.0 }
    }

    /// Whether facet `f` is there: in a height map those with a hole at a corner are not.
    fn exists(&self, f: u32) -> bool {
        match &self.kind {
            Kind::Mesh(..) => true,
            Kind::Implicit(grid, _) => grid.exists(f),
        }
    }

    /// How many facets the lens may see.
    pub fn facet_count(&self) -> usize {
        self.facets
    }

    /// How far its facets lie from the exact surfaces that they were made of, mm; None where it was read as facets.
    pub fn tessellation_mm(&self) -> Option<f64> {
        self.tessellation_mm
    }

    /// Where the origin of its local coordinates lies on the turned part.
    fn origin(&self) -> P2 {
        match &self.kind {
            Kind::Mesh(m, _) => m.origin,
            Kind::Implicit(g, _) => g.origin,
        }
    }

    /// Columns (axis 0) or rows (axis 1) of bins; a height map has one more at each border.
    fn bin_count(&self, axis: usize) -> i64 {
        match &self.kind {
            Kind::Mesh(_, b) => i64::from(b.grid.count[axis]),
            Kind::Implicit(g, _) => g.cells()[axis] as i64 + 2,
        }
    }

    /// Local coordinate of the lower border of bin `i` along an axis, nm.
    fn bin_line(&self, axis: usize, i: i64) -> i64 {
        match &self.kind {
            Kind::Mesh(_, b) => b.grid.line(axis, i),
            Kind::Implicit(g, _) => g.line(i - 1),
        }
    }

    /// The bin of a local coordinate along an axis, clamped to the grid.
    fn bin_of(&self, axis: usize, v: i64) -> i64 {
        match &self.kind {
            Kind::Mesh(_, b) => b.grid.along(axis, v, 0),
            Kind::Implicit(g, _) => (g.cell_of(v) + 1).clamp(0, self.bin_count(axis) - 1),
        }
    }

    /// What a bin holds.
    fn class(&self, bin: usize) -> Class {
        match &self.kind {
            Kind::Mesh(_, b) => b.class[bin],
            Kind::Implicit(_, class) => class[bin],
        }
    }

    /// Appends the facets of bin `bin`, its border included, that may lie under the line between two
    /// points.
    fn bin_facets(&self, bin: usize, [from, to]: [P2; 2], out: &mut Vec<u32>) {
        match &self.kind {
            Kind::Mesh(_, b) => b.facets_under(bin, from, to, out),
            Kind::Implicit(g, _) => {
                let columns = self.bin_count(0) as usize;
                let (i, j) = ((bin % columns) as i64 - 1, (bin / columns) as i64 - 1);
                // Facets of the neighbouring cells share the border of this one.
                for y in j - 1..=j + 1 {
                    for x in i - 1..=i + 1 {
                        out.extend((0..2).filter_map(|half| g.facet(x, y, half)));
                    }
                }
            }
        }
    }

    /// Whether the part is one plain sheet everywhere in a box (nm, turned part frame): no rim, no second sheet.
    pub fn is_plain(&self, lo: P2, hi: P2) -> bool {
        let o = self.origin();
        let xs = self.bins_within(0, lo.x - o.x, hi.x - o.x);
        let ys = self.bins_within(1, lo.y - o.y, hi.y - o.y);
        let Some((xs, ys)) = xs.zip(ys) else { return false };
        let columns = self.bin_count(0);
        ys.into_iter().all(|y| xs.clone().all(|x| self.class((y * columns + x) as usize) == Class::Simple))
    }

    /// The columns (axis 0) or rows (axis 1) of bins between two local coordinates; None where they reach beyond the
    /// grid.
    fn bins_within(&self, axis: usize, lo: i64, hi: i64) -> Option<RangeInclusive<i64>> {
        let (first, end) = (self.bin_line(axis, 0), self.bin_line(axis, self.bin_count(axis)));
        (first <= lo && hi < end).then(|| self.bin_of(axis, lo)..=self.bin_of(axis, hi))
    }

    /// Boxes over the part (nm, turned part frame) with the height of the highest point in each, nm,
    /// rounded up: coarse, never too low.
    pub fn tiles(&self) -> Vec<(Box2, Nm)> {
        const TILES: i64 = 64;
        let (nx, ny) = (self.bin_count(0), self.bin_count(1));
        let o = self.origin();
        let size = [nx, ny].map(|n| (n as u64).div_ceil(TILES as u64).max(1) as i64);
        let count = [(nx - 1) / size[0] + 1, (ny - 1) / size[1] + 1];
        let mut tops = vec![f64::NEG_INFINITY; (count[0] * count[1]) as usize];
        self.for_each_facet(|corners| {
            let z = corners.iter().fold(f64::NEG_INFINITY, |z, v| z.max(v.z));
            let columns = self.tile_range(0, size[0], corners.map(|v| v.x));
            for y in self.tile_range(1, size[1], corners.map(|v| v.y)) {
                for x in columns.clone() {
                    let top = &mut tops[(y * count[0] + x) as usize];
                    *top = top.max(z);
                }
            }
        });
        let corner = |x: i64, y: i64| P2::new(self.bin_line(0, x.min(nx)) + o.x, self.bin_line(1, y.min(ny)) + o.y);
        let cells = (0..count[1]).flat_map(|y| (0..count[0]).map(move |x| (x, y)));
        cells
            .zip(tops)
            .filter(|(_, z)| z.is_finite())
            .map(|((x, y), z)| {
                let lo = corner(x * size[0], y * size[1]);
                (Box2 { lo, hi: corner((x + 1) * size[0], (y + 1) * size[1]) }, Nm::ceil(z))
            })
            .collect()
    }

    /// The columns (axis 0) or rows (axis 1) of tiles of so many bins that a facet touches, given its corners along the
    /// axis; a facet that ends on a border of bins touches those on both sides.
    fn tile_range(&self, axis: usize, bins: i64, [a, b, c]: [i32; 3]) -> RangeInclusive<i64> {
        let (lo, hi) = (i64::from(a.min(b).min(c)), i64::from(a.max(b).max(c)));
        self.bin_of(axis, lo - 1) / bins..=self.bin_of(axis, hi + 1) / bins
    }

    /// Calls `sink` with the corners, nm, turned part frame, of every facet, upright ones included.
    pub fn each_facet(&self, sink: &mut dyn FnMut([[f64; 3]; 3])) {
        let o = self.origin();
        let at = |v: mesh::Vertex| [(i64::from(v.x) + o.x) as f64, (i64::from(v.y) + o.y) as f64, v.z];
        self.for_each_facet(|corners| sink(corners.map(at)));
    }

    /// Calls `f` with the corners (local coordinates) of every facet, upright ones included.
    fn for_each_facet(&self, mut f: impl FnMut([mesh::Vertex; 3])) {
        match &self.kind {
            Kind::Mesh(m, _) => {
                m.facets.iter().chain(&m.upright).for_each(|c| f(c.map(|v| m.vertices[v as usize])));
            }
            Kind::Implicit(g, _) => {
                let all = 0..self.facets as u32;
                all.filter(|&i| g.exists(i)).for_each(|i| f([0, 1, 2].map(|k| g.corner(i, k).vertex)));
            }
        }
    }
}

/// The least and the greatest of some heights.
fn range_of(heights: impl Iterator<Item = f64>) -> [f64; 2] {
    heights.fold([f64::INFINITY, f64::NEG_INFINITY], |[lo, hi], z| [lo.min(z), hi.max(z)])
}
