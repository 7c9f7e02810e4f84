//! How the facets of a mesh hang together: the twins that the walk follows, and what is wrong with the mesh.
//!
//! Consumes welded facets that have an area, counter-clockwise seen from the lens, each with what its file had of it
//! ([`TURNED`], [`UPRIGHT`]). Promises: of several facets with the same corners one stays; upright facets, which
//! carry no texture, go only after edges were counted on the whole mesh; every fault is counted, with a vertex at which
//! one of its kind is.

use super::faults::{FaultKind, NonManifold};
use super::narrow_gaps::{Gaps, narrow_gaps};
use super::vertex::{NONE, Vertex};
use terrace_core::geom::{Buckets, NM_PER_MM};

/// The facet ran clockwise in its file.
pub(super) const TURNED: u8 = 1;
/// The facet stands upright.
pub(super) const UPRIGHT: u8 = 2;
/// The facet has the corners of one before it.
const DUPLICATE: u8 = 4;

/// Height, nm, up to which a facet is a needle: three corners on a line that f32 rounded, within 4 m. A weld distance
/// above it takes its place.
const NEEDLE_NM: f64 = 500.0;

/// How facets are joined to a mesh.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Joining {
    /// Vertices nearer to each other than this become one, mm.
    pub weld_mm: f64,
    /// Rims that face each other across a gap up to this are cracks, mm: the spot.
    pub narrow_mm: f64,
    /// What is done about edges on which a sheet hangs.
    pub non_manifold: NonManifold,
}

/// A fault of a mesh.
pub(super) struct MeshFault {
    pub kind: FaultKind,
    /// How often it occurs.
    pub count: usize,
    /// A vertex at which it occurs.
    pub vertex: u32,
}

/// How often something occurs, and at which vertex first.
#[derive(Clone, Copy, Default)]
struct Occurrences {
    count: usize,
    first: u32,
}

impl Occurrences {
    fn add(&mut self, vertex: u32) {
        if self.count == 0 {
            self.first = vertex;
        }
        self.count += 1;
    }

    /// The fault that they are, if there are any.
    fn fault(self, kind: FaultKind) -> Option<MeshFault> {
        (self.count > 0).then_some(MeshFault { kind, count: self.count, vertex: self.first })
    }
}

/// A half-edge of a vertex that is the lower end of its edge. Those of one edge are next to each other when they are
/// sorted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
struct EdgeSide {
    /// The upper end of the edge.
    upper: u32,
    half_edge: u32,
}

impl EdgeSide {
    /// The facet of the half-edge.
    fn facet(self) -> u32 {
        self.half_edge / 3
    }
}

/// The twins of a mesh, and what is wrong with it.
pub(super) struct Survey {
    /// The twin of every half-edge of the facets that stay.
    pub twins: Vec<u32>,
    /// Upright facets: not seen by the lens, but the head must keep clear of them.
    pub upright: Vec<[u32; 3]>,
    /// What is wrong.
    pub faults: Vec<MeshFault>,
}

/// Finds the twins of the facets that stay, and what is wrong. Duplicates and upright facets are taken out; `states`
/// has an entry for each facet as given.
pub(super) fn survey(
    vertices: &[Vertex],
    facets: &mut Vec<[u32; 3]>,
    mut states: Vec<u8>,
    joining: &Joining,
) -> Survey {
    let [narrow_nm, weld_nm] = [joining.narrow_mm, joining.weld_mm].map(|mm| mm * NM_PER_MM);
    let mut faults = Vec::new();
    let mut edges = edges(vertices.len(), facets);
    let mut pass = Pass {
        vertices,
        facets,
        states: &mut states,
        needle_nm: NEEDLE_NM.max(weld_nm),
        twins: vec![NONE; facets.len() * 3],
        rims: Vec::new(),
        against: Occurrences::default(),
        needles: Occurrences::default(),
        many: [Occurrences::default(); 2],
    };
    for list in edges.each_mut() {
        list.sort_unstable();
        list.chunk_by_mut(|x, y| x.upper == y.upper).for_each(|sides| pass.edge(sides));
    }
    let Pass { twins, mut rims, against, needles, many: [touching, odd], .. } = pass;
    let mut duplicates = Occurrences::default();
    for f in (0..facets.len()).filter(|&f| states[f] & DUPLICATE != 0) {
        duplicates.add(facets[f][0]);
    }
    // Edges say that there are such facets, but not which of the two facets is turned.
    let wound = if against.count > 0 { wound_against(&edges, facets, &states) } else { Occurrences::default() };
    faults.extend(duplicates.fault(FaultKind::Duplicate));
    faults.extend(wound.fault(FaultKind::Winding));
    faults.extend(needles.fault(FaultKind::Needle));
    faults.extend(touching.fault(FaultKind::Touching));
    faults.extend(odd.fault(FaultKind::NonManifold));
    drop(edges);
    rims.retain(|&he| states[he as usize / 3] & UPRIGHT == 0);
    faults.extend(narrow_gaps(vertices, facets, rims, narrow_nm).map(crack));
    let upright = (0..facets.len()).filter(|&f| states[f] & UPRIGHT != 0).map(|f| facets[f]).collect();
    Survey { twins: compact(facets, &states, twins), upright, faults }
}

/// The fault of narrow gaps.
fn crack(gaps: Gaps) -> MeshFault {
    let Gaps { count, at, widest_nm, weldable: (corners, weld_nm) } = gaps;
    let [widest_mm, weld_mm] = [widest_nm, weld_nm].map(|nm| nm / NM_PER_MM);
    MeshFault { kind: FaultKind::Crack { widest_mm, weldable: (corners, weld_mm) }, count, vertex: at }
}

/// The half-edges of every vertex that is the lower end of their edge.
fn edges(vertex_count: usize, facets: &[[u32; 3]]) -> Buckets<EdgeSide> {
    Buckets::new(
        vertex_count,
        (0..facets.len() * 3).map(|he| {
            let (a, b) = ends(facets, he as u32);
            (a.min(b) as usize, EdgeSide { upper: a.max(b), half_edge: he as u32 })
        }),
    )
}

/// Where a half-edge begins and ends.
fn ends(facets: &[[u32; 3]], he: u32) -> (u32, u32) {
    let f = &facets[he as usize / 3];
    (f[he as usize % 3], f[(he as usize % 3 + 1) % 3])
}

/// The corner opposite of a half-edge.
fn opposite(facets: &[[u32; 3]], he: u32) -> u32 {
    facets[he as usize / 3][(he as usize % 3 + 2) % 3]
}

/// One pass over all edges.
struct Pass<'a> {
    vertices: &'a [Vertex],
    facets: &'a [[u32; 3]],
    states: &'a mut [u8],
    /// Height up to which a facet is a needle.
    needle_nm: f64,
    twins: Vec<u32>,
    /// Half-edges whose edge has no other facet.
    rims: Vec<u32>,
    /// Edges whose two facets wind against each other.
    against: Occurrences,
    /// Edges that have more than two facets by needles alone.
    needles: Occurrences,
    /// Other edges of more than two facets: of an even number, of an odd one.
    many: [Occurrences; 2],
}

impl Pass<'_> {
    /// Takes all half-edges of one edge.
    fn edge(&mut self, sides: &mut [EdgeSide]) {
        let facets = self.facets;
        let (sides, opposed) = self.without_duplicates(sides);
        match *sides {
            [] => {}
            [side] => self.rims.push(side.half_edge),
            [one, other] => {
                if is_against(facets, self.states, one.half_edge, other.half_edge) {
                    self.against.add(ends(facets, one.half_edge).0);
                }
            }
            [first, ..] => {
                let is_needle = |side: &&EdgeSide| height(self.vertices, facets, side.facet()) <= self.needle_nm;
                let left = sides.len() - sides.iter().filter(is_needle).count();
                // Bodies that touch along an edge have an even number of facets there; where it is odd a sheet hangs on
                // it.
                let kind = if left <= 2 { &mut self.needles } else { &mut self.many[(left + opposed) % 2] };
                kind.add(ends(facets, first.half_edge).0);
            }
        }
        // Proper for the walk: exactly two that do not stand upright, on opposite sides.
        let states = &self.states;
        let mut seen = sides.iter().filter(|side| states[side.facet() as usize] & UPRIGHT == 0);
        if let (Some(one), Some(other), None) = (seen.next(), seen.next(), seen.next())
            && ends(facets, one.half_edge).0 != ends(facets, other.half_edge).0
        {
            self.twins[one.half_edge as usize] = other.half_edge;
            self.twins[other.half_edge as usize] = one.half_edge;
        }
    }

    /// Puts the half-edges of duplicates last, marks their facets and leaves them out. Returns also how many of them
    /// wind against the facet that they repeat: such a pair is a body without thickness, and both of its facets belong
    /// to the edge.
    fn without_duplicates<'b>(&mut self, sides: &'b mut [EdgeSide]) -> (&'b [EdgeSide], usize) {
        let facets = self.facets;
        let opposite = |side: &EdgeSide| opposite(facets, side.half_edge);
        if sides.len() < 2 || sides.len() == 2 && opposite(&sides[0]) != opposite(&sides[1]) {
            return (sides, 0);
        }
        sides.sort_unstable_by_key(|side| (opposite(side), side.half_edge));
        // Those before number `kept` are of different facets.
        let mut kept = 1;
        let mut opposed = 0;
        for i in 1..sides.len() {
            let last = sides[kept - 1];
            if opposite(&sides[i]) == opposite(&last) {
                opposed += usize::from(!is_against(facets, self.states, sides[i].half_edge, last.half_edge));
                self.states[sides[i].facet() as usize] |= DUPLICATE;
            } else {
                sides.swap(kept, i);
                kept += 1;
            }
        }
        (&sides[..kept], opposed)
    }
}

/// The smallest height of a facet, nm.
fn height(vertices: &[Vertex], facets: &[[u32; 3]], f: u32) -> f64 {
    let c = facets[f as usize].map(|v| {
        let Vertex { x, y, z } = vertices[v as usize];
        [f64::from(x), f64::from(y), z]
    });
    let [u, v, w] = [(0, 1), (1, 2), (2, 0)].map(|(i, j)| [0, 1, 2].map(|k| c[j][k] - c[i][k]));
    let length = |v: [f64; 3]| v.iter().map(|v| v * v).sum::<f64>().sqrt();
    let double_area = length([0, 1, 2].map(|k| u[(k + 1) % 3] * v[(k + 2) % 3] - u[(k + 2) % 3] * v[(k + 1) % 3]));
    double_area / length(u).max(length(v)).max(length(w))
}

/// Whether two facets, one on each side of an edge, wound against each other in their file: they run along it in one
/// direction.
fn is_against(facets: &[[u32; 3]], states: &[u8], e: u32, f: u32) -> bool {
    start_in_file(facets, states, e) == start_in_file(facets, states, f)
}

/// Where a half-edge began in the file.
fn start_in_file(facets: &[[u32; 3]], states: &[u8], he: u32) -> u32 {
    let (a, b) = ends(facets, he);
    if states[he as usize / 3] & TURNED == 0 { a } else { b }
}

/// The facets that wind against the larger part of those that they hang together with over edges of two facets.
fn wound_against(edges: &Buckets<EdgeSide>, facets: &[[u32; 3]], states: &[u8]) -> Occurrences {
    let mut sheets = Sheets { parent: (0..facets.len() as u32).collect(), is_against: vec![false; facets.len()] };
    // Half-edges of one edge are next to each other, since every bucket is sorted by the other end.
    for list in (0..edges.len()).map(|b| edges.of(b)) {
        for sides in list.chunk_by(|x, y| x.upper == y.upper) {
            let mut kept = sides.iter().filter(|side| states[side.facet() as usize] & DUPLICATE == 0);
            if let (Some(one), Some(other), None) = (kept.next(), kept.next(), kept.next()) {
                let is_against = is_against(facets, states, one.half_edge, other.half_edge);
                sheets.join(one.facet(), other.facet(), is_against);
            }
        }
    }
    let kept = || (0..facets.len()).filter(|&f| states[f] & DUPLICATE == 0);
    // By root: how many facets wind as it does, and how many against it.
    let mut counts = vec![[0u32; 2]; facets.len()];
    for f in kept() {
        let (root, is_against) = sheets.root(f as u32);
        counts[root as usize][usize::from(is_against)] += 1;
    }
    let mut wound = Occurrences::default();
    for f in kept() {
        let (root, is_against) = sheets.root(f as u32);
        let [along, against] = counts[root as usize];
        // Of equal parts the second one.
        if is_against == (against <= along) && along.min(against) > 0 {
            wound.add(facets[f][0]);
        }
    }
    wound
}

/// Facets that hang together, and which of them wind against the root of their sheet (union-find).
struct Sheets {
    parent: Vec<u32>,
    /// Against the parent.
    is_against: Vec<bool>,
}

impl Sheets {
    /// The root of a facet, and whether the facet winds against it.
    fn root(&mut self, f: u32) -> (u32, bool) {
        let (mut at, mut against) = (f as usize, false);
        while self.parent[at] as usize != at {
            // Halve the path; a root is never against itself.
            let up = self.parent[at] as usize;
            self.is_against[at] ^= self.is_against[up];
            self.parent[at] = self.parent[up];
            against ^= self.is_against[at];
            at = self.parent[at] as usize;
        }
        (at as u32, against)
    }

    /// Joins the sheets of two facets, given whether these wind against each other.
    fn join(&mut self, e: u32, f: u32, is_against: bool) {
        let (e_root, e_against) = self.root(e);
        let (f_root, f_against) = self.root(f);
        if e_root != f_root {
            let (low, high) = (e_root.min(f_root), e_root.max(f_root));
            self.parent[high as usize] = low;
            self.is_against[high as usize] = is_against ^ e_against ^ f_against;
        }
    }
}

/// Drops duplicates and upright facets; returns the twins of the others.
fn compact(facets: &mut Vec<[u32; 3]>, states: &[u8], twins: Vec<u32>) -> Vec<u32> {
    let is_kept = |f: usize| states[f] & (UPRIGHT | DUPLICATE) == 0;
    if (0..facets.len()).all(is_kept) {
        return twins;
    }
    let mut number = vec![NONE; facets.len()];
    let mut next = 0;
    for f in (0..facets.len()).filter(|&f| is_kept(f)) {
        number[f] = next;
        facets[next as usize] = facets[f];
        next += 1;
    }
    let moved = |twin: u32| if twin == NONE { NONE } else { number[twin as usize / 3] * 3 + twin % 3 };
    let kept = (0..facets.len()).filter(|&f| is_kept(f)).flat_map(|f| &twins[3 * f..3 * f + 3]);
    let twins = kept.map(|&twin| moved(twin)).collect();
    facets.truncate(next as usize);
    twins
}

#[cfg(test)]
mod tests {
    use super::super::{Surface, mesh::Welder};
    use super::*;
    use terrace_core::diag::{Kind, Place};
    use terrace_core::progress::Task;

    type Facet = [[f64; 3]; 3];

    /// A sheet of 4 x 4 mm on a slope, 32 facets.
    fn sheet() -> Vec<Facet> {
        let p = |i: usize, j: usize| [i as f64, j as f64, 0.1 * i as f64 + 0.05 * (j * j) as f64];
        let cell = |k: usize| {
            let (i, j) = (k % 4, k / 4);
            let [a, b, c, d] = [p(i, j), p(i + 1, j), p(i + 1, j + 1), p(i, j + 1)];
            [[a, b, c], [a, c, d]]
        };
        (0..16).flat_map(cell).collect()
    }

    const JOINING: Joining = Joining { weld_mm: 0.0, narrow_mm: 0.02, non_manifold: NonManifold::Refuse };

    fn faults(facets: &[Facet], joining: Joining) -> Vec<(&'static str, usize, [f64; 3])> {
        let turn = terrace_core::geom::cos_sin(0.7);
        let mut welder = Welder::new(turn, joining);
        facets.iter().for_each(|&f| welder.facet(f));
        let (mesh, faults) = welder.finish("a mesh", &mut Vec::new()).expect("a mesh");
        for (he, &twin) in mesh.twins.iter().enumerate().filter(|(_, twin)| **twin != NONE) {
            assert_eq!(mesh.twins[twin as usize], he as u32);
            let (a, b) = ends(&mesh.facets, he as u32);
            assert_eq!(ends(&mesh.facets, twin), (b, a));
        }
        faults.iter().map(|f| (f.kind.name(), f.count, f.at_mm)).collect()
    }

    fn counts(facets: &[Facet]) -> Vec<(&'static str, usize)> {
        faults(facets, JOINING).into_iter().map(|(name, count, _)| (name, count)).collect()
    }

    /// A sheet with facets added.
    fn with(more: impl IntoIterator<Item = Facet>) -> Vec<Facet> {
        sheet().into_iter().chain(more).collect()
    }

    fn reversed([a, b, c]: Facet) -> Facet {
        [a, c, b]
    }

    #[test]
    fn a_clean_sheet_and_a_closed_solid_have_no_faults() {
        assert_eq!(counts(&sheet()), []);
        assert_eq!(counts(&sheet().into_iter().map(reversed).collect::<Vec<_>>()), []);
        assert_eq!(counts(&block([0.0, 0.0])), []);
    }

    /// A closed box of 1 x 1 x 1 mm.
    fn block([x, y]: [f64; 2]) -> Vec<Facet> {
        let p = |k: usize, z: f64| [x + [0.0, 1.0, 1.0, 0.0][k % 4], y + [0.0, 0.0, 1.0, 1.0][k % 4], z];
        let lid = |z: f64| [[p(0, z), p(1, z), p(2, z)], [p(0, z), p(2, z), p(3, z)]];
        let wall = |k: usize| [[p(k, 0.0), p(k + 1, 0.0), p(k + 1, 1.0)], [p(k, 0.0), p(k + 1, 1.0), p(k, 1.0)]];
        lid(1.0).into_iter().chain(lid(0.0).map(reversed)).chain((0..4).flat_map(wall)).collect()
    }

    #[test]
    fn each_fault_is_counted_by_its_own_kind() {
        let s = sheet();
        let [a, b, c] = s[10];
        let middle = [0, 1, 2].map(|k| (a[k] + b[k]) / 2.0);
        let fin = [a, b, [a[0], a[1] + 0.5, a[2] + 2.0]];
        let twisted: Vec<Facet> =
            s.iter().enumerate().map(|(i, &f)| if i % 5 == 0 { reversed(f) } else { f }).collect();
        for (what, facets, want) in [
            ("a point and a line", with([[a, a, b], [a, middle, b]]), vec![("degenerate", 1), ("needles", 1)]),
            // The middle is off the line by less than f32 rounds.
            ("a needle", with([[a, b, [1.5, 1.0 + 1e-5, middle[2]]]]), vec![("needles", 1)]),
            ("twice the same", with([s[3], s[10], s[10]]), vec![("duplicate", 3)]),
            ("the same from below", with([reversed(s[3])]), vec![("duplicate", 1)]),
            ("flipped ones", twisted, vec![("winding", 7)]),
            ("a fin", with([fin]), vec![("non-manifold", 1)]),
            ("a fin, upright", with([[a, b, [a[0], a[1], a[2] + 2.0]]]), vec![("non-manifold", 1)]),
            ("two fins on one edge", with([fin, [a, b, [c[0], c[1], 9.0]]]), vec![("touching", 1)]),
            ("blocks that touch along an edge", [block([0.0; 2]), block([1.0; 2])].concat(), vec![("touching", 1)]),
        ] {
            assert_eq!(counts(&facets), want, "{what}");
        }
    }

    #[test]
    fn the_place_of_a_fault_is_that_of_the_file_before_the_turn() {
        let s = sheet();
        let fin = [s[10][0], s[10][1], [2.0, 1.5, 3.0]];
        let found = faults(&with([fin]), JOINING);
        let [(_, 1, at)] = found[..] else { panic!("{found:?}") };
        let near = |p: [f64; 3]| (0..3).all(|k| (p[k] - at[k]).abs() < 2e-6);
        assert!(near(s[10][0]) || near(s[10][1]), "{at:?}");
    }

    /// The sheet with its right half moved by this along x, mm.
    fn cracked(by: f64) -> Vec<Facet> {
        let moved = |f: Facet| if f.iter().all(|p| p[0] >= 2.0) { f.map(|[x, y, z]| [x + by, y, z]) } else { f };
        sheet().into_iter().map(moved).collect()
    }

    #[test]
    fn cracks_up_to_the_spot_are_counted_and_closed_by_the_weld_that_is_named() {
        // Corners of both sides: five each.
        for (by, want) in [(1e-3, 10), (0.0199, 10), (0.021, 0), (2e-6, 0)] {
            let found: usize =
                counts(&cracked(by)).iter().map(|(name, n)| if *name == "cracks" { *n } else { 99 }).sum();
            assert_eq!(found, want, "{by} mm");
        }
        // An overlap hides nothing and opens nothing.
        assert_eq!(counts(&cracked(-1e-3)), []);
        let mut notes = Vec::new();
        let mut welder = Welder::new([1.0, 0.0], JOINING);
        cracked(4e-3).into_iter().for_each(|f| welder.facet(f));
        Surface::from_welder(welder, "a mesh", &mut notes, Task::silent()).expect("a surface");
        assert_eq!((notes[0].code, notes[0].hint.as_str()), ("surface-cracks", "surface.weld = \"4 um\" closes them"));
        assert!(notes[0].message.contains("up to 0.00400 mm"), "{}", notes[0]);
        assert_eq!(faults(&cracked(4e-3), Joining { weld_mm: 4.1e-3, ..JOINING }), []);
    }

    #[test]
    fn a_crack_without_corners_opposite_is_not_said_to_be_closed_by_a_weld() {
        // One side has its corners between those of the other.
        let strip = |x: f64, y: f64| [[x, y, 0.0], [x + 1.0, y, 0.0], [x, y + 1.0, 0.0]];
        let left = [[0.0, 0.3, 0.0], [0.0, 0.8, 0.0], [-1.0, 0.5, 0.0]];
        let mut welder = Welder::new([1.0, 0.0], JOINING);
        [strip(5e-3, 0.0), left].into_iter().for_each(|f| welder.facet(f));
        let (_, found) = welder.finish("a mesh", &mut Vec::new()).expect("a mesh");
        assert_eq!(found.len(), 1);
        assert!(matches!(found[0].kind, FaultKind::Crack { weldable: (0, _), .. }), "{found:?}");
        assert!(found[0].diag(Place::Nowhere, NonManifold::Refuse).hint.contains("too far"));
    }

    #[test]
    fn holes_slots_and_borders_are_no_cracks() {
        let without = |hole: &[usize]| -> Vec<Facet> {
            sheet().into_iter().enumerate().filter(|(i, _)| !hole.contains(i)).map(|(_, f)| f).collect()
        };
        assert_eq!(counts(&without(&[10, 11])), []);
        assert_eq!(counts(&without(&[10])), []);
        // Corners between those of the other rim meet it, whatever lies on the other side of its facet.
        let thin = [[0.0, 0.0, 0.0], [4e-3, -5e-3, 0.0], [8e-3, 0.0, 0.0]];
        let [p, q] = [[2e-3, 0.0, 0.0], [2e-3, 9e-3, 0.0]];
        assert_eq!(counts(&[thin, [thin[0], p, q], [p, thin[2], q]]), []);
        // A fine border: its own corners lie within the width of each other.
        let fine: Vec<Facet> = sheet().into_iter().map(|f| f.map(|p| p.map(|v| v * 2e-3))).collect();
        assert_eq!(counts(&fine), []);
    }

    #[test]
    fn a_sheet_that_hangs_on_an_edge_is_refused_unless_declared() {
        let s = sheet();
        let facets = with([[s[10][0], s[10][1], [2.0, 1.5, 3.0]]]);
        let load = |non_manifold| {
            let mut notes = Vec::new();
            let mut welder = Welder::new([1.0, 0.0], Joining { non_manifold, ..JOINING });
            facets.iter().for_each(|&f| welder.facet(f));
            (Surface::from_welder(welder, "a mesh", &mut notes, Task::silent()).map(|s| s.facet_count()), notes)
        };
        let (refused, _) = load(NonManifold::Refuse);
        let e = refused.expect_err("a fin");
        assert_eq!((e.diags()[0].code, e.diags()[0].kind), ("surface-non-manifold", Kind::Input));
        assert!(e.diags()[0].hint.contains("surface.non_manifold = \"topmost\""));
        let (taken, notes) = load(NonManifold::Topmost);
        assert_eq!(taken.expect("a surface"), 33);
        assert_eq!((notes[0].code, notes[0].kind, notes.len()), ("surface-non-manifold", Kind::Warning, 1));
    }
}
