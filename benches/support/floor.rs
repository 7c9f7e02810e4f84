//! What the job of a large hatch takes of a plain program on one thread: load, weld, find neighbours, walk, order,
//! write. It knows no rule and checks nothing; the figures of the benchmarks are told as multiples of it, so that they
//! can be compared from machine to machine.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::Path;

/// Depth of a level and width of a section, mm.
const LEVEL: f64 = 0.07;
const SECTION: f64 = 40.0;

/// No facet.
const NONE: u32 = u32::MAX;

/// Facets by their corners, and the corners.
struct Mesh {
    corners: Vec<[f32; 3]>,
    facets: Vec<[u32; 3]>,
    /// Of each facet the one beyond each side.
    beyond: Vec<[u32; 3]>,
}

/// A piece of a line: its level and section, and its ends, mm.
type Piece = ([i32; 3], [f64; 4]);

/// Does the job and answers with how many pieces there are.
pub fn job(stl: &Path, pitch: f64) -> usize {
    let mesh = Mesh::read(stl);
    let mut by_stop: BTreeMap<[i32; 3], Vec<[f64; 4]>> = BTreeMap::new();
    let mut count = 0;
    mesh.walk(pitch, &mut |(stop, ends)| {
        count += 1;
        by_stop.entry(stop).or_default().push(ends);
    });
    let mut text = String::new();
    for pieces in by_stop.into_values() {
        for [x0, y0, x1, y1] in ordered(pieces) {
            writeln!(text, "{x0:.4} {y0:.4} {x1:.4} {y1:.4}").expect("text");
        }
    }
    std::fs::write(stl.with_extension("floor.txt"), text).expect("a writable folder");
    count
}

impl Mesh {
    fn read(stl: &Path) -> Self {
        let bytes = std::fs::read(stl).expect("a mesh");
        let count = u32::from_le_bytes(bytes[80..84].try_into().expect("four bytes")) as usize;
        let mut mask = 1usize;
        while mask < count * 2 {
            mask <<= 1;
        }
        mask -= 1;
        let mut table = vec![NONE; mask + 1];
        let (mut corners, mut facets) = (Vec::<[f32; 3]>::new(), Vec::with_capacity(count));
        for facet in bytes[84..].chunks_exact(50) {
            let number = |at: usize| f32::from_le_bytes(facet[at..at + 4].try_into().expect("four bytes"));
            facets.push([12, 24, 36].map(|at| {
                let corner = [number(at), number(at + 4), number(at + 8)];
                let mut hash = corner.iter().fold(0u64, |h, v| {
                    (h ^ u64::from(v.to_bits())).wrapping_mul(0x9E37_79B9_7F4A_7C15).rotate_left(29)
                });
                hash ^= hash >> 32;
                let mut at = hash as usize & mask;
                while table[at] != NONE && corners[table[at] as usize] != corner {
                    at = (at + 1) & mask;
                }
                if table[at] == NONE {
                    table[at] = corners.len() as u32;
                    corners.push(corner);
                }
                table[at]
            }));
        }
        let beyond = beyond(&facets, corners.len());
        Self { corners, facets, beyond }
    }

    /// Walks lines along x through the mesh and cuts them at levels and sections.
    fn walk(&self, pitch: f64, each: &mut dyn FnMut(Piece)) {
        let at = |i: u32| self.corners[i as usize].map(f64::from);
        let height = self.corners.iter().fold(0.0f64, |y, c| y.max(f64::from(c[1])));
        // The sides of the left border, by their lower end.
        let mut border: Vec<(f64, f64, u32, usize)> = Vec::new();
        for (facet, beyond) in self.beyond.iter().enumerate() {
            for side in (0..3).filter(|&side| beyond[side] == NONE) {
                let [a, b] = [0, 1].map(|k| at(self.facets[facet][(side + k) % 3]));
                if a[0] == 0.0 && b[0] == 0.0 {
                    border.push((a[1].min(b[1]), a[1].max(b[1]), facet as u32, side));
                }
            }
        }
        border.sort_by(|a, b| a.0.total_cmp(&b.0));
        for line in 0..(height / pitch) as usize {
            let y = (line as f64 + 0.5) * pitch;
            let first = border.partition_point(|side| side.0 <= y) - 1;
            let (_, _, mut facet, mut side) = border[first];
            let crossing = |facet: u32, side: usize| {
                let [a, b] = [0, 1].map(|k| at(self.facets[facet as usize][(side + k) % 3]));
                let share = (y - a[1]) / (b[1] - a[1]);
                ((a[1] <= y) != (b[1] <= y)).then(|| [a[0] + share * (b[0] - a[0]), a[2] + share * (b[2] - a[2])])
            };
            let Some([mut x, mut z]) = crossing(facet, side) else { continue };
            let place = |x: f64, z: f64| [(z / LEVEL).floor() as i32, (x / SECTION) as i32, (y / SECTION) as i32];
            let (mut stop, mut from) = (place(x, z), x);
            loop {
                let out = (1..3).map(|k| (side + k) % 3).find_map(|side| Some((side, crossing(facet, side)?)));
                let Some((leaves, [to_x, to_z])) = out else { break };
                let next = place(to_x, to_z);
                while stop[0] != next[0] {
                    let up = next[0] > stop[0];
                    let border = f64::from(stop[0] + i32::from(up)) * LEVEL;
                    let cut = x + (to_x - x) * ((border - z) / (to_z - z));
                    each((stop, [from, y, cut, y]));
                    (from, stop[0]) = (cut, stop[0] + if up { 1 } else { -1 });
                }
                if stop[1] != next[1] {
                    let cut = f64::from(next[1]) * SECTION;
                    each((stop, [from, y, cut, y]));
                    (from, stop[1]) = (cut, next[1]);
                }
                (x, z) = (to_x, to_z);
                let other = self.beyond[facet as usize][leaves];
                if other == NONE {
                    each((stop, [from, y, x, y]));
                    break;
                }
                side = self.beyond[other as usize].iter().position(|&f| f == facet).expect("neighbours");
                facet = other;
            }
        }
    }
}

/// The facets beyond the sides of each: sides wait in a list at their lower corner until the other comes.
fn beyond(facets: &[[u32; 3]], corners: usize) -> Vec<[u32; 3]> {
    let mut beyond = vec![[NONE; 3]; facets.len()];
    let (mut head, mut next) = (vec![NONE; corners], vec![NONE; 3 * facets.len()]);
    for facet in 0..facets.len() {
        for side in 0..3 {
            let ends = |facet: usize, side: usize| {
                let [a, b] = [facets[facet][side], facets[facet][(side + 1) % 3]];
                (a.min(b), a.max(b))
            };
            let (low, high) = ends(facet, side);
            let (mut before, mut at) = (NONE, head[low as usize]);
            while at != NONE && ends(at as usize / 3, at as usize % 3).1 != high {
                (before, at) = (at, next[at as usize]);
            }
            if at == NONE {
                let own = (3 * facet + side) as u32;
                (next[own as usize], head[low as usize]) = (head[low as usize], own);
                continue;
            }
            beyond[at as usize / 3][at as usize % 3] = facet as u32;
            beyond[facet][side] = at / 3;
            if before == NONE {
                head[low as usize] = next[at as usize];
            } else {
                next[before as usize] = next[at as usize];
            }
        }
    }
    beyond
}

/// Each piece after the one whose end is nearest to its own.
fn ordered(mut left: Vec<[f64; 4]>) -> Vec<[f64; 4]> {
    let (mut out, mut at) = (Vec::with_capacity(left.len()), [0.0; 2]);
    while !left.is_empty() {
        let far = |x: f64, y: f64| (x - at[0]).powi(2) + (y - at[1]).powi(2);
        let mut best = (f64::INFINITY, 0, false);
        for (i, p) in left.iter().enumerate() {
            let [begin, end] = [far(p[0], p[1]), far(p[2], p[3])];
            if begin.min(end) < best.0 {
                best = (begin.min(end), i, end < begin);
            }
        }
        let [x0, y0, x1, y1] = left.swap_remove(best.1);
        let piece = if best.2 { [x1, y1, x0, y0] } else { [x0, y0, x1, y1] };
        at = [piece[2], piece[3]];
        out.push(piece);
    }
    out
}
