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
use super::topology::{Joining, Survey, TURNED, UPRIGHT, survey};
pub(crate) use super::vertex::{NONE, Vertex};
use terrace_core::diag::{Diag, Error};
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

/// Makes one point of equal corners.
struct Points {
    weld_nm: i64,
    list: Vec<(P2, f64)>,
    facets: Vec<[u32; 3]>,
    /// Open addressing, linear probing: index of a point or NONE.
    table: Vec<u32>,
    /// Only with a weld distance: points by cell of that size.
    cells: FxHashMap<[i64; 3], Vec<u32>>,
    /// Facets of which two corners are one, and a corner of the first.
    degenerate: usize,
    degenerate_at: Option<(P2, f64)>,
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
                touched ^= self.list[id as usize].0.x;
            }
            std::hint::black_box(touched);
            batch.chunks_exact(3).for_each(|facet| self.facet(facet));
        }
    }

    fn facet(&mut self, corners: &[Corner]) {
        let mut ids = [0; 3];
        for (id, corner) in ids.iter_mut().zip(corners) {
            *id = self.vertex(corner);
        }
        if ids[0] == ids[1] || ids[1] == ids[2] || ids[2] == ids[0] {
            self.degenerate_at.get_or_insert((corners[0].p, corners[0].z));
            self.degenerate += 1;
        } else {
            self.facets.push(ids);
        }
    }

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
                    let (q, qz) = self.list[id as usize];
                    if q == p && nearest(qz) == zn {
                        return id;
                    }
                }
            }
            slot = (slot + 1) & mask;
        }
        let id = self.list.len() as u32;
        self.list.push((p, z));
        self.table[slot] = id;
        if self.list.len() * 2 > self.table.len() {
            self.grow();
        }
        id
    }

    fn grow(&mut self) {
        let mask = self.table.len() * 2 - 1;
        self.table.clear();
        self.table.resize(mask + 1, NONE);
        for (id, &(p, z)) in self.list.iter().enumerate() {
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
        let cell = [p.x.div_euclid(w), p.y.div_euclid(w), zn.div_euclid(w)];
        let mut best: Option<u32> = None;
        for dx in -1..=1 {
            for dy in -1..=1 {
                for dz in -1..=1 {
                    for &id in self.cells.get(&[cell[0] + dx, cell[1] + dy, cell[2] + dz]).into_iter().flatten() {
                        let (q, qz) = self.list[id as usize];
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
            self.list.push((p, z));
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
        let place = || terrace_core::diag::Place::file(path);
        let Self { joining, corners: Corners { turn, .. }, points } = self;
        let Points { list: points, mut facets, table, mut degenerate, degenerate_at, .. } = points;
        let mut degenerate_at = degenerate_at.map_or([0.0; 3], |corner| unturned(turn, &corner));
        drop(table);
        let mut all = terrace_core::geom::Box2::EMPTY;
        points.iter().for_each(|&(p, _)| all.add(p));
        let no_area = |n: usize| {
            let text = format!("all {n} facets have zero area");
            Diag::input("surface-zero-area", text).at(place()).hint("export the surface again")
        };
        if facets.is_empty() {
            return Err(no_area(degenerate).into());
        }
        if all.size().iter().any(|&s| s > MAX_NM) {
            return Err(Diag::input("surface-large", "the part is larger than 4 m")
                .at(place())
                .hint("check the unit of the part")
                .into());
        }
        let origin = P2::new((all.lo.x + all.hi.x) / 2, (all.lo.y + all.hi.y) / 2);
        let local = |p: P2| (i32::try_from(p.x - origin.x), i32::try_from(p.y - origin.y));
        let mut vertices = Vec::with_capacity(points.len());
        for &(p, z) in &points {
            let (Ok(x), Ok(y)) = local(p) else { unreachable!("the box is at most 4 m wide around its centre") };
            vertices.push(Vertex { x, y, z });
        }
        drop(points);
        renumber(&mut vertices, &mut facets);
        let Oriented { states, flat, flat_at } = make_counter_clockwise(&vertices, &mut facets);
        let at_mm = |v: u32| {
            let Vertex { x, y, z } = vertices[v as usize];
            unturned(turn, &(P2::new(origin.x + i64::from(x), origin.y + i64::from(y)), z))
        };
        if flat > 0 && degenerate == 0 {
            degenerate_at = at_mm(flat_at);
        }
        degenerate += flat;
        let upright = states.iter().filter(|&s| s & UPRIGHT != 0).count();
        if upright == facets.len() {
            let text = format!("all {upright} facets stand upright: nothing is visible from +z");
            let edge_on = Diag::input("surface-edge-on", text).at(place());
            let hint = "turn the part in the file so that the textured side faces +z";
            return Err(if flat == 0 { edge_on.hint(hint) } else { no_area(degenerate) }.into());
        }
        let away = share_away(&vertices, &facets, &states);
        if away > AWAY {
            let text = format!(
                "{:.0} % of the part, seen from the lens, faces away from it: the part shows its back, or its normals are \
                 reversed",
                away * 100.0
            );
            let hint = "lay it with `terrace orient JOB --apply`, or by placement.up; if its normals are reversed, all is well";
            notes.push(Diag::warning("surface-upside-down", text).at(place()).hint(hint));
        }
        let Survey { twins, upright, faults: placed } = survey(&vertices, &mut facets, states, &joining);
        let mut faults = Vec::new();
        if degenerate > 0 {
            faults.push(Fault { kind: FaultKind::Degenerate, count: degenerate, at_mm: degenerate_at });
        }
        faults.extend(placed.into_iter().map(|(kind, count, at)| Fault { kind, count, at_mm: at_mm(at) }));
        Ok((Mesh { origin, vertices, facets, twins, upright }, faults))
    }
}

/// Where a corner lay before the turn, mm.
fn unturned([c, s]: [f64; 2], &(p, z): &(P2, f64)) -> [f64; 3] {
    let [x, y] = p.mm();
    [c * x + s * y, c * y - s * x, z / NM_PER_MM]
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
    let (mut states, mut flat, mut flat_at) = (Vec::with_capacity(facets.len()), 0, 0);
    facets.retain_mut(|f| {
        let [a, b, c] = f.map(|v| vertices[v as usize]);
        let area = orient(a.p2(), b.p2(), c.p2());
        if area == 0.0 {
            // Corners may lie 4 m apart, beyond the range of i32.
            let from_a = |p: Vertex| [f64::from(p.x) - f64::from(a.x), f64::from(p.y) - f64::from(a.y)];
            let (u, v) = (from_a(b), from_a(c));
            let (uz, vz) = (b.z - a.z, c.z - a.z);
            if [u[1] * vz - uz * v[1], uz * v[0] - u[0] * vz] == [0.0, 0.0] {
                if flat == 0 {
                    flat_at = f[0];
                }
                flat += 1;
                return false;
            }
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

/// Renumbers vertices along a Morton curve of their places, and facets by their first vertex. Comes
/// before anything else that looks from facets to vertices: files without order miss the cache here
/// once, and never again.
fn renumber(vertices: &mut Vec<Vertex>, facets: &mut Vec<[u32; 3]>) {
    let (mut lo, mut hi) = ([i32::MAX; 2], [i32::MIN; 2]);
    for v in vertices.iter() {
        lo = [lo[0].min(v.x), lo[1].min(v.y)];
        hi = [hi[0].max(v.x), hi[1].max(v.y)];
    }
    let span = (0..2).map(|i| (i64::from(hi[i]) - i64::from(lo[i])).max(1)).max().unwrap_or(1) as f64;
    let scale = 65535.0 / span;
    let spread = |v: i32, lo: i32| {
        let mut x = ((i64::from(v) - i64::from(lo)) as f64 * scale) as u32;
        for (shift, mask) in [(8, 0x00FF_00FF), (4, 0x0F0F_0F0F), (2, 0x3333_3333), (1, 0x5555_5555)] {
            x = (x | (x << shift)) & mask;
        }
        x
    };
    let places = vertices.iter().enumerate();
    let mut keys: Vec<(u32, u32)> =
        places.map(|(i, v)| (spread(v.x, lo[0]) | spread(v.y, lo[1]) << 1, i as u32)).collect();
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

/// Stable sort by key, 11 bits a pass.
fn radix_sort(keys: &mut Vec<(u32, u32)>) {
    let (mut starts, mut sorted) = (Vec::new(), Vec::new());
    for shift in [0, 11, 22] {
        let digit = |k: u32| (k >> shift) as usize & 0x7FF;
        counting_sort(0x800, keys.iter().map(|&k| (digit(k.0), k)), &mut starts, &mut sorted);
        std::mem::swap(keys, &mut sorted);
    }
}
