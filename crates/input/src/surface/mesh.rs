//! One indexed triangle mesh, as the lens sees it.
//!
//! Consumes facets (mm), promises: vertices are on the nanometre grid in x and y, equal ones are one;
//! facets have a projected area above zero and run counter-clockwise seen from the lens, whatever
//! their winding in the file; facets are numbered along a Morton curve, so that neighbours on the
//! part are neighbours in memory. Coordinates are local: part frame less [`Mesh::origin`].
//!
//! A half-edge `3 f + k` runs from corner k to corner k + 1 of facet f. It has a twin where exactly
//! one other facet lies on its other side; everything else (border, fold, more than two facets) has
//! none and counts as a rim for the walk.

use std::sync::mpsc;

use rustc_hash::FxHashMap;

use super::faults::{Fault, FaultKind};
use super::topology::{Joining, MeshFault, Survey, TURNED, UPRIGHT, survey};
pub(crate) use super::vertex::{NONE, Vertex};
use terrace_core::diag::{Diag, Error, Place};
use terrace_core::geom::{BoxMm, MAX_NM, NM_PER_MM, P2, counting_sort, nearest, orient};
use terrace_core::parallel;

/// The mesh; see the module for what it promises.
#[derive(Debug)]
pub struct Mesh {
    pub(crate) origin: P2,
    pub(crate) vertices: Vec<Vertex>,
    pub(crate) facets: Vec<[u32; 3]>,
    pub(crate) twins: Vec<u32>,
    /// Facets that stand upright: the lens does not see them, but the head must keep clear of them.
    pub(crate) upright: Vec<[u32; 3]>,
}

/// Corners welded in one go.
const BATCH: usize = 3 * 64;

/// Corners that are handed to another thread at a time, and how many such lists may wait there.
const HANDED: usize = 64 * BATCH;
const QUEUED: usize = 4;

/// A corner of a facet: where it lies on the turned part, nm, and the hash of that.
#[derive(Clone, Copy)]
struct Corner {
    p: P2,
    z: f64,
    hash: u64,
}

/// Turns facets into corners.
struct Corners {
    /// Cosine and sine of the part's turn.
    turn: [f64; 2],
    /// Box of all corners before the turn, mm.
    part_box_mm: BoxMm<2>,
    /// The corners that are not welded yet, three a facet.
    waiting: Vec<Corner>,
}

/// A point of the turned part: x and y on the nanometre grid, z in nm.
#[derive(Clone, Copy)]
struct GridPoint {
    p: P2,
    z: f64,
}

/// Makes one point of equal corners.
struct Points {
    /// Corners as near as this, nm, are one; 0 where they must be equal.
    weld_nm: i64,
    list: Vec<GridPoint>,
    /// Numbers of the corners of every facet.
    facets: Vec<[u32; 3]>,
    /// Open addressing, linear probing: index of a point or NONE.
    table: Vec<u32>,
    /// Only with a weld distance: points by cell of that size.
    cells: FxHashMap<[i64; 3], Vec<u32>>,
    /// Facets of which two corners are one, and a corner of the first.
    degenerate: usize,
    degenerate_at: Option<GridPoint>,
    /// Scratch: the slots of a batch.
    touched: Vec<u32>,
}

/// Gathers facets and welds their corners.
pub(crate) struct Welder {
    pub(super) joining: Joining,
    corners: Corners,
    points: Points,
}

/// Share of the area in plan that faces away from the lens, from which a part shows its back: of a closed body it is
/// half.
const AWAY: f64 = 0.75;

/// Share of the area in plan of facets that were turned to face up.
fn share_away(vertices: &[Vertex], facets: &[[u32; 3]], states: &[u8]) -> f64 {
    let [mut away, mut all] = [0.0; 2];
    for (facet, state) in facets.iter().zip(states) {
        let [a, b, c] = facet.map(|v| vertices[v as usize].p2());
        let area = orient(a, b, c).abs();
        all += area;
        away += if state & TURNED != 0 { area } else { 0.0 };
    }
    if all > 0.0 { away / all } else { 0.0 }
}

impl Corners {
    /// Takes one facet, corners in mm.
    fn add(&mut self, facet: [[f64; 3]; 3]) {
        let [c, s] = self.turn;
        for [x, y, z] in facet {
            self.part_box_mm.add([x, y]);
            let (tx, ty) = (c * x - s * y, s * x + c * y);
            let p = P2::new(nearest(tx * NM_PER_MM), nearest(ty * NM_PER_MM));
            let z = z * NM_PER_MM;
            self.waiting.push(Corner { p, z, hash: hash(p, nearest(z)) });
        }
    }
}

impl Points {
    /// Welds the corners of some facets. In a file without order every look-up misses the cache; touching a
    /// batch of slots first, then their points, lets the misses overlap (2.5 times faster measured).
    fn weld(&mut self, corners: &[Corner]) {
        for batch in corners.chunks(BATCH) {
            let mask = self.table.len() - 1;
            let mut touched = 0;
            self.touched.clear();
            self.touched.extend(batch.iter().map(|corner| self.table[corner.hash as usize & mask]));
            for &id in self.touched.iter().filter(|&&id| id != NONE) {
                touched ^= self.list[id as usize].p.x;
            }
            std::hint::black_box(touched);
            batch.chunks_exact(3).for_each(|facet| self.facet(facet));
        }
    }

    /// Takes a facet of three corners; one of which two are one point is only counted.
    fn facet(&mut self, corners: &[Corner]) {
        let mut ids = [0; 3];
        for (id, corner) in ids.iter_mut().zip(corners) {
            *id = self.vertex(corner);
        }
        if ids[0] == ids[1] || ids[1] == ids[2] || ids[2] == ids[0] {
            self.degenerate_at.get_or_insert(GridPoint { p: corners[0].p, z: corners[0].z });
            self.degenerate += 1;
        } else {
            self.facets.push(ids);
        }
    }

    /// Number of the point of a corner, which is added if it is new.
    fn vertex(&mut self, &Corner { p, z, hash }: &Corner) -> u32 {
        if self.weld_nm > 0 {
            return self.vertex_near(p, z);
        }
        let zn = nearest(z);
        let mask = self.table.len() - 1;
        let mut slot = hash as usize & mask;
        loop {
            match self.table[slot] {
                NONE => break,
                id => {
                    let known = self.list[id as usize];
                    if known.p == p && nearest(known.z) == zn {
                        return id;
                    }
                }
            }
            slot = (slot + 1) & mask;
        }
        let id = self.list.len() as u32;
        self.list.push(GridPoint { p, z });
        self.table[slot] = id;
        // At most half of the slots are taken, so that look-ups stay short and meet an empty slot.
        if self.list.len() * 2 > self.table.len() {
            self.grow();
        }
        id
    }

    /// Doubles the table.
    fn grow(&mut self) {
        let mask = self.table.len() * 2 - 1;
        self.table.clear();
        self.table.resize(mask + 1, NONE);
        for (id, &GridPoint { p, z }) in self.list.iter().enumerate() {
            let mut slot = hash(p, nearest(z)) as usize & mask;
            while self.table[slot] != NONE {
                slot = (slot + 1) & mask;
            }
            self.table[slot] = id as u32;
        }
    }

    /// The first vertex within the weld distance, or a new one.
    fn vertex_near(&mut self, p: P2, z: f64) -> u32 {
        let w = self.weld_nm;
        let zn = nearest(z);
        // Cells are as wide as the weld distance: what is within it lies in this cell or next to it.
        let cell = [p.x.div_euclid(w), p.y.div_euclid(w), zn.div_euclid(w)];
        let mut best: Option<u32> = None;
        for dx in -1..=1 {
            for dy in -1..=1 {
                for dz in -1..=1 {
                    for &id in self.cells.get(&[cell[0] + dx, cell[1] + dy, cell[2] + dz]).into_iter().flatten() {
                        let GridPoint { p: q, z: qz } = self.list[id as usize];
                        let d2 = ((q.x - p.x) as f64).powi(2) + ((q.y - p.y) as f64).powi(2) + (qz - z).powi(2);
                        if d2 <= (w as f64).powi(2) && best.is_none_or(|b| id < b) {
                            best = Some(id);
                        }
                    }
                }
            }
        }
        best.unwrap_or_else(|| {
            let id = self.list.len() as u32;
            self.list.push(GridPoint { p, z });
            self.cells.entry(cell).or_default().push(id);
            id
        })
    }
}

impl Welder {
    /// `turn` is the cosine and sine of the part's turn.
    pub fn new(turn: [f64; 2], joining: Joining) -> Self {
        Self {
            joining,
            corners: Corners { turn, part_box_mm: BoxMm::EMPTY, waiting: Vec::with_capacity(BATCH) },
            points: Points {
                weld_nm: (joining.weld_mm * NM_PER_MM).round() as i64,
                list: Vec::new(),
                facets: Vec::new(),
                table: vec![NONE; 1 << 12],
                cells: FxHashMap::default(),
                degenerate: 0,
                degenerate_at: None,
                touched: Vec::with_capacity(BATCH),
            },
        }
    }

    /// Takes one facet, corners in mm. Readers have refused what is not finite or beyond 4 m.
    pub fn facet(&mut self, corners: [[f64; 3]; 3]) {
        self.corners.add(corners);
        if self.corners.waiting.len() >= BATCH {
            self.flush();
        }
    }

    /// Takes the facets that `read` hands to its sink, and returns what `read` answers. Corners are welded on a
    /// thread of their own where there are several: reading a file and welding take about as long.
    pub(crate) fn fed_by<T>(self, read: impl FnOnce(&mut dyn FnMut([[f64; 3]; 3])) -> T) -> (Self, T) {
        if parallel::threads() == 1 {
            let mut welder = self;
            let out = read(&mut |facet| welder.facet(facet));
            return (welder, out);
        }
        let Self { joining, mut corners, mut points } = self;
        std::thread::scope(|scope| {
            let (hand, handed) = mpsc::sync_channel::<Vec<Corner>>(QUEUED);
            let (give_back, emptied) = mpsc::channel::<Vec<Corner>>();
            let welding = scope.spawn(move || {
                for mut list in handed {
                    points.weld(&list);
                    list.clear();
                    // Nobody takes it once all is read.
                    let _ = give_back.send(list);
                }
                points
            });
            let out = read(&mut |facet| {
                corners.add(facet);
                if corners.waiting.len() >= HANDED {
                    let empty = emptied.try_recv().unwrap_or_else(|_| Vec::with_capacity(HANDED));
                    // Where it cannot be handed over the other thread has panicked, which is seen below.
                    let _ = hand.send(std::mem::replace(&mut corners.waiting, empty));
                }
            });
            drop(hand);
            let points = welding.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
            (Self { joining, corners, points }, out)
        })
    }

    /// Box of all corners before the turn, mm.
    pub fn part_box_mm(&self) -> BoxMm<2> {
        self.corners.part_box_mm
    }

    /// Welds the waiting corners.
    fn flush(&mut self) {
        self.points.weld(&self.corners.waiting);
        self.corners.waiting.clear();
    }

    /// The finished mesh, and what was wrong with it, each kind once. `path` names the file in messages.
    ///
    /// # Errors
    /// `surface-zero-area` where all facets are points or lines, `surface-edge-on` where all stand
    /// upright, `surface-large` beyond 4 m.
    pub fn finish(mut self, path: &str, notes: &mut Vec<Diag>) -> Result<(Mesh, Vec<Fault>), Error> {
        self.flush();
        let place = Place::file(path);
        let Self { joining, corners: Corners { turn, .. }, points } = self;
        let Points { list: points, mut facets, table, degenerate, degenerate_at, .. } = points;
        drop(table);
        if facets.is_empty() {
            return Err(no_area(degenerate, place).into());
        }
        let Some(origin) = centre_of_part(&points) else { return Err(too_large(place).into()) };
        let frame = LocalFrame { turn, origin };
        let mut vertices = local_vertices(&points, origin);
        drop(points);
        renumber(&mut vertices, &mut facets);
        let Oriented { states, flat, flat_at } = make_counter_clockwise(&vertices, &mut facets);
        let upright = states.iter().filter(|&s| s & UPRIGHT != 0).count();
        if upright == facets.len() {
            // Both are 0 where no facet has an area, so that is the fault where some have none.
            let fault = if flat == 0 { edge_on(upright, place) } else { no_area(degenerate + flat, place) };
            return Err(fault.into());
        }
        let away = share_away(&vertices, &facets, &states);
        if away > AWAY {
            notes.push(upside_down(away, place));
        }
        let Survey { twins, upright, faults: mesh_faults } = survey(&vertices, &mut facets, states, &joining);
        let mut faults = Vec::new();
        if degenerate + flat > 0 {
            let at_mm = degenerate_at.map_or_else(|| frame.file_mm(vertices[flat_at as usize]), |p| unturned(turn, p));
            faults.push(Fault { kind: FaultKind::Degenerate, count: degenerate + flat, at_mm });
        }
        faults.extend(mesh_faults.into_iter().map(|MeshFault { kind, count, vertex }| Fault {
            kind,
            count,
            at_mm: frame.file_mm(vertices[vertex as usize]),
        }));
        Ok((Mesh { origin, vertices, facets, twins, upright }, faults))
    }
}

/// The frame of a mesh's vertices against that of its file.
struct LocalFrame {
    /// Cosine and sine of the part's turn.
    turn: [f64; 2],
    /// The origin of the vertices on the turned part.
    origin: P2,
}

impl LocalFrame {
    /// Where a vertex lies in the file's frame, mm.
    fn file_mm(&self, Vertex { x, y, z }: Vertex) -> [f64; 3] {
        let p = P2::new(self.origin.x + i64::from(x), self.origin.y + i64::from(y));
        unturned(self.turn, GridPoint { p, z })
    }
}

/// Where a point lay before the turn, mm.
fn unturned([c, s]: [f64; 2], GridPoint { p, z }: GridPoint) -> [f64; 3] {
    let [x, y] = p.mm();
    [c * x + s * y, c * y - s * x, z / NM_PER_MM]
}

/// The centre of the box of all points; None where it is larger than 4 m.
fn centre_of_part(points: &[GridPoint]) -> Option<P2> {
    let mut extent = terrace_core::geom::Box2::EMPTY;
    points.iter().for_each(|point| extent.add(point.p));
    let fits = extent.size().iter().all(|&side| side <= MAX_NM);
    fits.then(|| P2::new((extent.lo.x + extent.hi.x) / 2, (extent.lo.y + extent.hi.y) / 2))
}

/// The points as vertices around the centre of their box, which is at most 4 m wide: 2 m are below 2^31 nm.
fn local_vertices(points: &[GridPoint], origin: P2) -> Vec<Vertex> {
    let mut vertices = Vec::with_capacity(points.len());
    for &GridPoint { p, z } in points {
        let (Ok(x), Ok(y)) = (i32::try_from(p.x - origin.x), i32::try_from(p.y - origin.y)) else {
            unreachable!("the box is at most 4 m wide around its centre")
        };
        vertices.push(Vertex { x, y, z });
    }
    vertices
}

/// The fault of a part whose `count` facets are all points or lines.
fn no_area(count: usize, place: Place) -> Diag {
    let text = format!("all {count} facets have zero area");
    Diag::input("surface-zero-area", text).at(place).hint("export the surface again")
}

/// The fault of a part that is larger than what a job holds.
fn too_large(place: Place) -> Diag {
    Diag::input("surface-large", "the part is larger than 4 m").at(place).hint("check the unit of the part")
}

/// The fault of a part whose `count` facets all stand upright.
fn edge_on(count: usize, place: Place) -> Diag {
    let text = format!("all {count} facets stand upright: nothing is visible from +z");
    let hint = "turn the part in the file so that the textured side faces +z";
    Diag::input("surface-edge-on", text).at(place).hint(hint)
}

/// The warning that the share `away` of a part, seen from the lens, faces away from it.
fn upside_down(away: f64, place: Place) -> Diag {
    let text = format!(
        "{:.0} % of the part, seen from the lens, faces away from it: the part shows its back, or its normals are \
         reversed",
        away * 100.0
    );
    let hint = "lay it with `terrace orient JOB --apply`, or by placement.up; if its normals are reversed, all is well";
    Diag::warning("surface-upside-down", text).at(place).hint(hint)
}

/// A 64-bit mix of the three coordinates.
fn hash(p: P2, z: i64) -> u64 {
    let mut h = (p.x as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    h = (h ^ (h >> 32) ^ p.y as u64).wrapping_mul(0xD6E8_FEB8_6659_FD93);
    h = (h ^ (h >> 32) ^ z as u64).wrapping_mul(0xD6E8_FEB8_6659_FD93);
    h ^ (h >> 32)
}

/// Facets that run counter-clockwise.
struct Oriented {
    /// Of each facet, how it was.
    states: Vec<u8>,
    /// Facets that had no area, and a corner of the first.
    flat: usize,
    flat_at: u32,
}

/// Drops facets without area and turns the others counter-clockwise, seen from the lens; upright ones stay as they
/// are.
fn make_counter_clockwise(vertices: &[Vertex], facets: &mut Vec<[u32; 3]>) -> Oriented {
    let mut states = Vec::with_capacity(facets.len());
    let mut flat = 0;
    let mut flat_at = 0;
    facets.retain_mut(|f| {
        let [a, b, c] = f.map(|v| vertices[v as usize]);
        let area = orient(a.p2(), b.p2(), c.p2());
        if area == 0.0 && is_line(a, b, c) {
            if flat == 0 {
                flat_at = f[0];
            }
            flat += 1;
            return false;
        }
        if area < 0.0 {
            f.swap(1, 2);
        }
        states.push(if area < 0.0 {
            TURNED
        } else if area == 0.0 {
            UPRIGHT
        } else {
            0
        });
        true
    });
    Oriented { states, flat, flat_at }
}

/// Whether three points that lie on one line in plan lie on one line in space too.
fn is_line(a: Vertex, b: Vertex, c: Vertex) -> bool {
    // Corners may lie 4 m apart, beyond the range of i32.
    let from_a = |p: Vertex| [f64::from(p.x) - f64::from(a.x), f64::from(p.y) - f64::from(a.y)];
    let (u, v) = (from_a(b), from_a(c));
    let (uz, vz) = (b.z - a.z, c.z - a.z);
    [u[1] * vz - uz * v[1], uz * v[0] - u[0] * vz] == [0.0, 0.0]
}

/// Renumbers vertices along a Morton curve of their places, and facets by their first vertex. Comes
/// before anything else that looks from facets to vertices: files without order miss the cache here
/// once, and never again.
fn renumber(vertices: &mut Vec<Vertex>, facets: &mut Vec<[u32; 3]>) {
    let mut lo = [i32::MAX; 2];
    let mut hi = [i32::MIN; 2];
    for v in vertices.iter() {
        lo = [lo[0].min(v.x), lo[1].min(v.y)];
        hi = [hi[0].max(v.x), hi[1].max(v.y)];
    }
    let span = (0..2).map(|i| (i64::from(hi[i]) - i64::from(lo[i])).max(1)).max().unwrap_or(1) as f64;
    // 16 bits an axis: a place along the curve has 32.
    let scale = 65535.0 / span;
    let step = |v: i32, lo: i32| ((i64::from(v) - i64::from(lo)) as f64 * scale) as u32;
    let along_curve = |v: &Vertex| spread_bits(step(v.x, lo[0])) | spread_bits(step(v.y, lo[1])) << 1;
    let mut keys: Vec<(u32, u32)> = vertices.iter().enumerate().map(|(i, v)| (along_curve(v), i as u32)).collect();
    radix_sort(&mut keys);
    let mut number = vec![0; vertices.len()];
    keys.iter().enumerate().for_each(|(new, &(_, old))| number[old as usize] = new as u32);
    *vertices = keys.iter().map(|&(_, old)| vertices[old as usize]).collect();
    keys.clear();
    for (i, f) in facets.iter_mut().enumerate() {
        *f = f.map(|v| number[v as usize]);
        keys.push((f[0].min(f[1]).min(f[2]), i as u32));
    }
    radix_sort(&mut keys);
    *facets = keys.iter().map(|&(_, i)| facets[i as usize]).collect();
}

/// Puts a zero bit before each of the lower 16 bits of a number.
fn spread_bits(mut x: u32) -> u32 {
    for (shift, mask) in [(8, 0x00FF_00FF), (4, 0x0F0F_0F0F), (2, 0x3333_3333), (1, 0x5555_5555)] {
        x = (x | (x << shift)) & mask;
    }
    x
}

/// Stable sort by key, 11 bits a pass: three passes for 32 bits.
fn radix_sort(keys: &mut Vec<(u32, u32)>) {
    let mut starts = Vec::new();
    let mut sorted = Vec::new();
    for shift in [0, 11, 22] {
        let digit = |k: u32| (k >> shift) as usize & 0x7FF;
        counting_sort(0x800, keys.iter().map(|&k| (digit(k.0), k)), &mut starts, &mut sorted);
        std::mem::swap(keys, &mut sorted);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spread_bits_puts_a_zero_before_each_bit() {
        for (x, spread) in [(0, 0), (1, 1), (0b11, 0b101), (0b1001, 0b100_0001), (0xFFFF, 0x5555_5555)] {
            assert_eq!(spread_bits(x), spread);
        }
    }

    #[test]
    fn is_line_sees_the_third_direction() {
        let [a, b] = [Vertex { x: 0, y: 0, z: 0.0 }, Vertex { x: 10, y: 10, z: 5.0 }];
        assert!(is_line(a, b, Vertex { x: 20, y: 20, z: 10.0 }));
        assert!(!is_line(a, b, Vertex { x: 20, y: 20, z: 0.0 }));
    }
}
