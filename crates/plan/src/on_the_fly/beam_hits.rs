//! Where the beam of every mark of a program meets the part.
//!
//! Consumes a program as it is commanded, its path and the part; promises focal offset and angle of every mark as the
//! facets under it have them, how far beside the path a leaning beam meets the part, and the stretches of strokes where
//! one of these is beyond its limit. Upright beams are followed from facet to facet, leaning ones at both ends of every
//! move and at three places between. Units: mm, rad, unless a name says otherwise.

use crate::on_the_fly::path::follow::Stretch;
use crate::on_the_fly::path::{Followed, Path};
use crate::on_the_fly::program::{AxisCommands, Kind, Program};
use crate::projection::Tracer;
use terrace_core::diag::Error;
use terrace_core::geom::{NM_PER_MM, P2, P3Mm, UnitVector};
use terrace_core::machine::Machine;
use terrace_core::math;
use terrace_input::surface::Surface;

/// A beam this far next to a border may be on either side of it, nm: what marks may stray from rounding.
const BORDER: f64 = 120.0;
/// Places of a move at which leaning beams are followed, besides its start.
const PLACES: usize = 4;
/// A beam this near to the path passes through it, mm: what marks may stray from rounding, or cut off at a corner.
const THROUGH: f64 = 2.5e-4;
/// What rounding adds to an angle, rad.
const ROUNDED: f64 = 1e-6;

/// What a mark must keep.
#[derive(Clone, Copy, Debug)]
pub struct Limits {
    /// Largest defocus, along the beam: half the depth range.
    pub half_depth: f64,
    /// Angle of the beam to the part's normal.
    pub angle: f64,
    /// In plan, from the place of the path that the beam passes through to where it meets the part.
    pub beside: f64,
}

/// A place where a mark does not keep its limits.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Miss {
    /// In plan.
    pub at: [f64; 2],
    /// Where its beam meets the part.
    pub hit: BeamHit,
}

/// A place of a mark, and where its beam meets the part.
#[derive(Clone, Copy, Debug, Default)]
struct MarkHit {
    /// In plan.
    at: [f64; 2],
    hit: BeamHit,
}

/// Focal offset and incidence of the marks of a program on the part.
#[derive(Clone, Debug, Default)]
pub(crate) struct FocusOnPart {
    /// Largest defocus.
    pub defocus: f64,
    /// Largest angle.
    pub angle: f64,
    /// The first place beyond a limit.
    pub first: Option<Miss>,
    /// Stretches of strokes beyond a limit.
    pub beyond: Vec<Stretch>,
}

/// A beam: where it meets the focal plane, and the direction against it.
#[derive(Clone, Copy)]
struct Beam {
    at: P3Mm,
    up: UnitVector,
}

/// The place of a segment that lies nearest to a beam.
struct NearestPlace {
    /// How far it is from the beam, across it.
    distance: f64,
    place: P3Mm,
}

impl Beam {
    /// The place of a segment that lies nearest to the beam.
    fn nearest(&self, a: P3Mm, b: P3Mm) -> NearestPlace {
        let to = self.across(self.at.way_from(a));
        let way = self.across(b.way_from(a));
        let length2 = dot(way, way);
        let t = if length2 > 0.0 { (dot(to, way) / length2).clamp(0.0, 1.0) } else { 0.0 };
        let off = [0, 1, 2].map(|k| to[k] - t * way[k]);
        NearestPlace { distance: dot(off, off).sqrt(), place: a.lerp(b, t) }
    }

    /// The part of a vector across the beam.
    fn across(&self, v: [f64; 3]) -> [f64; 3] {
        let UnitVector(up) = self.up;
        let along: f64 = (0..3).map(|k| v[k] * up[k]).sum();
        [0, 1, 2].map(|k| v[k] - along * up[k])
    }
}

fn dot(v: [f64; 3], w: [f64; 3]) -> f64 {
    v[0] * w[0] + v[1] * w[1] + v[2] * w[2]
}

/// Where a beam meets the part.
#[derive(Clone, Copy, Debug, Default)]
pub struct BeamHit {
    /// Distance from the focal plane along the beam; infinite where the beam misses the part.
    pub defocus: f64,
    /// Angle to the normal.
    pub angle: f64,
    /// Beside the path, in plan; 0 of upright beams, which meet the part wherever it is.
    pub beside: f64,
}

impl BeamHit {
    const MISSED: Self = Self { defocus: f64::INFINITY, angle: 0.0, beside: 0.0 };

    fn max(self, other: Self) -> Self {
        Self {
            defocus: self.defocus.max(other.defocus),
            angle: self.angle.max(other.angle),
            beside: self.beside.max(other.beside),
        }
    }
}

/// The path of one mark, and how far along it beams have come.
struct MarkPath {
    nodes: Vec<P3Mm>,
    /// The node before the last beam.
    at: usize,
}

impl MarkPath {
    /// The marks of a path, in its order.
    fn all(path: &Path) -> Vec<Self> {
        let mut out: Vec<Self> = Vec::new();
        for w in path.nodes.windows(2) {
            if w[1].pen.is_none() {
                continue;
            }
            match out.last_mut().filter(|_| w[0].pen.is_some() && w[0].stroke == w[1].stroke) {
                Some(mark) => mark.nodes.push(w[1].at),
                None => out.push(Self { nodes: vec![w[0].at, w[1].at], at: 0 }),
            }
        }
        out
    }

    /// Where a beam passes through the path: on the segment of the last beam or the next that it passes [`THROUGH`];
    /// where there is none, on the one that it passes nearest.
    fn place(&mut self, beam: &Beam) -> P3Mm {
        let mut best = NearestPlace { distance: f64::INFINITY, place: self.nodes[self.at] };
        for i in self.at..self.nodes.len() - 1 {
            let nearest = beam.nearest(self.nodes[i], self.nodes[i + 1]);
            if nearest.distance < best.distance {
                best = nearest;
                self.at = i;
            } else if best.distance < THROUGH {
                // Farther on the path may come back to the beam.
                break;
            }
        }
        best.place
    }
}

/// What follows beams to the part and judges where they meet it.
struct BeamJudge<'a> {
    tracer: Tracer<'a>,
    limits: Limits,
    /// The part's highest place.
    top: f64,
}

/// Follows the beams of all marks, whose path is `followed`. What is beyond a limit reaches `around` mm farther than it
/// was found.
///
/// # Errors
/// Those of a machine that does not have the program's axes.
pub(crate) fn focus_on_part(
    program: &Program,
    machine: &Machine,
    surface: &Surface,
    limits: Limits,
    followed: &Followed,
    around: f64,
) -> Result<FocusOnPart, Error> {
    let spot = program.spots(machine)?;
    let beam = |sample: &AxisCommands| {
        let spot = spot(sample);
        Beam { at: spot.part, up: spot.up }
    };
    let top = surface.tiles().iter().map(|t| t.1.mm()).fold(f64::NEG_INFINITY, f64::max);
    let mut judge = BeamJudge { tracer: Tracer::new(surface, f64::INFINITY), limits, top };
    let mut out = FocusOnPart::default();
    let mut pieces = followed.marked.iter();
    let mut paths = MarkPath::all(&followed.path).into_iter();
    let mut piece: Option<&Stretch> = None;
    let mut path: Option<MarkPath> = None;
    let mut mark_before = None;
    // Length of the piece's stroke up to the move.
    let mut along = 0.0;
    for (_, from, step) in program.steps() {
        // The marks of a program follow each other as the pieces do.
        if step.mark.is_some() && step.mark != mark_before {
            piece = pieces.next();
            path = paths.next();
            along = piece.map_or(0.0, |p| p.from);
        }
        mark_before = step.mark;
        if step.mark.is_none() {
            continue;
        }
        let (a, b) = (beam(from), beam(&step.to));
        let way = [b.at[0] - a.at[0], b.at[1] - a.at[1]];
        let worst = match program.kind {
            Kind::Xyzuv => judge.upright(&a, &b),
            Kind::Xyzacuv => {
                let samples = (0..=PLACES).map(|i| sample_between(from, &step.to, i as f64 / PLACES as f64));
                judge.leaning(samples.map(|sample| beam(&sample)), path.as_mut(), way)
            }
        };
        let length = math::hypot(way[0], way[1]);
        out.defocus = out.defocus.max(worst.hit.defocus);
        out.angle = out.angle.max(worst.hit.angle);
        if !judge.keeps_limits(worst.hit) {
            out.first.get_or_insert(Miss { at: worst.at, hit: worst.hit });
            if let Some(piece) = piece {
                out.add_beyond(Stretch { stroke: piece.stroke, from: along - around, to: along + length + around });
            }
        }
        along += length;
    }
    Ok(out)
}

/// The sample at a share of the way of a move.
fn sample_between(from: &AxisCommands, to: &AxisCommands, share: f64) -> AxisCommands {
    let axis = |k: usize| from[k] as f64 + share * (to[k] - from[k]) as f64;
    AxisCommands(std::array::from_fn(|k| axis(k).round() as i64))
}

impl FocusOnPart {
    /// Adds a stretch beyond a limit, to the last one where it overlaps that.
    fn add_beyond(&mut self, stretch: Stretch) {
        match self.beyond.last_mut() {
            Some(last) if last.stroke == stretch.stroke && stretch.from <= last.to => last.to = stretch.to,
            _ => self.beyond.push(stretch),
        }
    }
}

impl BeamJudge<'_> {
    fn keeps_limits(&self, BeamHit { defocus, angle, beside }: BeamHit) -> bool {
        defocus <= self.limits.half_depth && angle <= self.limits.angle + ROUNDED && beside <= self.limits.beside
    }

    /// The worse of two hits, at the place of the first that does not keep its limits; where both do, of the second.
    fn worse(&self, a: MarkHit, b: MarkHit) -> MarkHit {
        MarkHit { hit: a.hit.max(b.hit), at: if self.keeps_limits(a.hit) { b.at } else { a.at } }
    }

    /// The worst of an upright move, on the line or just next to it where it runs along a border.
    fn upright(&mut self, a: &Beam, b: &Beam) -> MarkHit {
        let [p, q] = [a, b].map(|beam| beam.at.xy().map(|v| v * NM_PER_MM));
        let way = [q[0] - p[0], q[1] - p[1]];
        let length = math::hypot(way[0], way[1]);
        let side = if length > 0.0 { [-way[1] / length, way[0] / length] } else { [1.0, 0.0] };
        let mut first = None;
        for by in [0.0, BORDER, -BORDER] {
            let shifted = |p: [f64; 2]| [0, 1].map(|k| p[k] + by * side[k]);
            let worst = self.worst_along(shifted(p), shifted(q), [a.at[2], b.at[2]]);
            if self.keeps_limits(worst.hit) {
                return worst;
            }
            first.get_or_insert(worst);
        }
        first.unwrap_or_default()
    }

    /// The worst of upright beams from one point to another, nm, whose focal planes lie at `plane_z` at both, mm.
    fn worst_along(&mut self, p: [f64; 2], q: [f64; 2], plane_z: [f64; 2]) -> MarkHit {
        let (p, q) = on_grid(p, q);
        let normals = self.tracer.normals();
        // Height and normal at both ends of every facet on the way.
        let mut ends = Vec::new();
        self.tracer.segment(p, q, |piece| {
            if piece.skip.is_none() {
                ends.push((piece.t0, piece.z0, normals.under(&piece)));
                ends.push((piece.t1, piece.z1, normals.under(&piece)));
            }
        });
        let start = MarkHit { hit: BeamHit::default(), at: p.mm() };
        ends.into_iter().fold(start, |worst, (t, z, normal)| {
            let defocus = (z / NM_PER_MM - (plane_z[0] + t * (plane_z[1] - plane_z[0]))).abs();
            let hit = BeamHit { defocus, angle: math::acos(normal[2].clamp(-1.0, 1.0)), beside: 0.0 };
            self.worse(worst, MarkHit { hit, at: p.lerp(q, t).mm() })
        })
    }

    /// The worst of leaning beams of a move that runs along `way`, of a mark with a path.
    fn leaning(
        &mut self,
        beams: impl Iterator<Item = Beam>,
        mut path: Option<&mut MarkPath>,
        way: [f64; 2],
    ) -> MarkHit {
        let mut worst = MarkHit::default();
        for beam in beams {
            let place = path.as_mut().map_or(beam.at, |path| path.place(&beam));
            let hit = self.near(&beam, place.xy(), way);
            worst = self.worse(worst, MarkHit { hit, at: beam.at.xy() });
        }
        worst
    }

    /// Where a leaning beam hits the part that should at `place`. Where it misses the part or a limit, one within
    /// [`BORDER`] that does not.
    fn near(&mut self, beam: &Beam, place: [f64; 2], way: [f64; 2]) -> BeamHit {
        let straight = self.hit(beam, place);
        if let Some(hit) = straight.filter(|&hit| self.keeps_limits(hit)) {
            return hit;
        }
        let length = math::hypot(way[0], way[1]);
        let along = if length > 0.0 { way.map(|v| v / length) } else { [1.0, 0.0] };
        let mut first = straight;
        for s in [0.0, -1.0, 1.0] {
            for t in [0.0, 0.0625, -0.0625, 0.25, -0.25, 1.0, -1.0] {
                let by = [s * along[0] - t * along[1], s * along[1] + t * along[0]].map(|v| v * BORDER / NM_PER_MM);
                let beam = Beam { at: beam.at.moved([by[0], by[1], 0.0]), up: beam.up };
                let beside = self.hit(&beam, [place[0] + by[0], place[1] + by[1]]);
                if let Some(hit) = beside.filter(|&hit| self.keeps_limits(hit)) {
                    return hit;
                }
                first = first.or(beside);
            }
        }
        first.unwrap_or(BeamHit::MISSED)
    }

    /// The highest part along a beam that should meet it at `meant`.
    fn hit(&mut self, beam: &Beam, meant: [f64; 2]) -> Option<BeamHit> {
        let UnitVector(up) = beam.up;
        if up[2] <= 0.0 {
            return None;
        }
        // From above the part down to twice the limit below the focal plane; what lies lower is missed.
        let heights = [self.top.max(beam.at[2]) + self.limits.half_depth, beam.at[2] - 2.0 * self.limits.half_depth];
        let [high, low] = heights.map(|z| [0, 1].map(|k| (beam.at[k] + up[k] / up[2] * (z - beam.at[2])) * NM_PER_MM));
        let (p, q) = on_grid(high, low);
        // A beam that is upright to the nanometre meets what lies first under it.
        let is_upright = high.iter().zip(low).all(|(a, b)| (a - b).abs() < 1.0);
        let normals = self.tracer.normals();
        let mut found = None;
        self.tracer.segment(p, q, |piece| {
            if piece.skip.is_some() || found.is_some() {
                return;
            }
            let beam_z = |t: f64| heights[0] + t * (heights[1] - heights[0]);
            let z = [piece.z0, piece.z1].map(|z| z / NM_PER_MM);
            let hit_z = if is_upright {
                z[0]
            } else {
                let over = [z[0] - beam_z(piece.t0), z[1] - beam_z(piece.t1)];
                let Some(share) = share_below(over) else { return };
                beam_z(piece.t0 + share * (piece.t1 - piece.t0))
            };
            found = Some(((hit_z - beam.at[2]) / up[2], normals.under(&piece)));
        });
        let (off, normal) = found?;
        let cos: f64 = (0..3).map(|k| normal[k] * up[k]).sum();
        let [x, y] = [0, 1].map(|k| beam.at[k] + off * up[k] - meant[k]);
        Some(BeamHit { defocus: off.abs(), angle: math::acos(cos.clamp(-1.0, 1.0)), beside: math::hypot(x, y) })
    }
}

/// Two points on the grid, nm, not the same: the tracer needs a direction.
fn on_grid(p: [f64; 2], q: [f64; 2]) -> (P2, P2) {
    let [p, mut q] = [p, q].map(|p| P2::new(p[0].round() as i64, p[1].round() as i64));
    if p == q {
        q.x += 1;
    }
    (p, q)
}

/// The share of a stretch at which a beam comes below the part, which is `over` it by so much at both ends; None where
/// it stays above.
fn share_below(over: [f64; 2]) -> Option<f64> {
    if over[0] >= 0.0 {
        Some(0.0)
    } else if over[1] >= 0.0 {
        Some(over[0] / (over[0] - over[1]))
    } else {
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A plate at z = 0 that ends at x = 1, over one at z = -0.05 that continues to x = 2.
    fn ledge() -> Surface {
        let plate = |x0: f64, x1: f64, z: f64| {
            let [a, b, c, d] = [[x0, -1.0, z], [x1, -1.0, z], [x1, 1.0, z], [x0, 1.0, z]];
            [[a, b, c], [a, c, d]]
        };
        let facets = [plate(-1.0, 1.0, 0.0), plate(1.0, 2.0, -0.05)].concat();
        Surface::from_facets(facets, &mut Vec::new()).expect("facets")
    }

    /// A beam through a point of the upper plate that leans by 30 degrees, so that it goes down towards +x.
    fn through(x: f64) -> Beam {
        Beam { at: P3Mm::new([x, 0.0, 0.0]), up: UnitVector([-0.5, 0.0, 0.75f64.sqrt()]) }
    }

    #[test]
    fn a_leaning_beam_that_passes_an_edge_meets_the_part_beside_its_path() {
        let surface = ledge();
        let limits = Limits { half_depth: 0.1, angle: 1.0, beside: 1e-3 };
        let mut judge = BeamJudge { tracer: Tracer::new(&surface, f64::INFINITY), limits, top: 0.0 };
        let hit = judge.hit(&through(0.9), [0.9, 0.0]).expect("the upper plate");
        assert!(hit.defocus < 1e-9 && hit.beside < 1e-9 && (hit.angle.to_degrees() - 30.0).abs() < 1e-6, "{hit:?}");
        assert!(judge.keeps_limits(hit));
        // Past the edge it falls on the lower one: 0.05 tan 30 deg farther on.
        let hit = judge.hit(&through(1.01), [1.01, 0.0]).expect("the lower plate");
        assert!((hit.beside - 0.05 / 3f64.sqrt()).abs() < 1e-6, "{hit:?}");
        assert!((hit.defocus - 0.05 / 0.75f64.sqrt()).abs() < 1e-6 && !judge.keeps_limits(hit), "{hit:?}");
        // Past it by less than rounding, a beam beside it counts.
        let near = judge.near(&through(1.0 + 5e-5), [1.0 + 5e-5, 0.0], [1.0, 0.0]);
        assert!(judge.keeps_limits(near), "{near:?}");
    }

    #[test]
    fn a_beam_comes_below_the_part_where_it_crosses_it() {
        assert_eq!(share_below([0.5, 2.0]), Some(0.0));
        assert_eq!(share_below([-1.0, 3.0]), Some(0.25));
        assert_eq!(share_below([-1.0, -0.5]), None);
    }

    #[test]
    fn beams_are_followed_along_the_path_of_their_mark() {
        let nodes = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1e-3, 0.0]].map(P3Mm::new).to_vec();
        let mut mark = MarkPath { nodes, at: 0 };
        // There and back: the path continues, though the first leg is as near.
        for (x, leg) in [(0.2, 0), (0.9, 0), (1.0, 0), (0.9, 1), (0.2, 1)] {
            let y = if leg == 0 { 0.0 } else { 1e-3 * (1.0 - x) };
            let up = [-0.5, 0.0, 0.75f64.sqrt()];
            let beam = Beam { at: P3Mm::new([x, y, 0.0]).moved(up), up: UnitVector(up) };
            let place = mark.place(&beam);
            assert!((place[0] - x).abs() < 1e-4 && (place[1] - y).abs() < 1e-4, "{x}: {place:?}");
        }
        assert_eq!(mark.at, 1);
    }
}
