//! `position`, `focus`, `surface`: where the beam of every mark meets the part.
//!
//! A beam hits the part at the highest place of the surface file's own facets along it. Hit points are compared with
//! the stroke of the texture that the mark names, in the drawing's plane: at both ends of every move, at places between
//! them no farther apart than [`APART`], and at the stroke's corners between these. Upright beams are held along the
//! whole line of a move, facet by facet; leaning ones at the same places.

use super::chain::{Beam, Chain};
use super::track::{Stroke, Trace};
use crate::geometry::{Geometry, Line, Scratch, Sheet};
use crate::proof::Rule;
use crate::read::on_the_fly::{Commands, FlyStep};
use terrace_core::math;

/// Largest distance of places that are looked at, nm, as docs/explanation/verify.md states.
const APART: f64 = 50_000.0;
/// Largest distance of a mark from the texture, nm: 1 um, and the nanometre of every axis that takes part.
pub(super) const STRAY: f64 = 1_002.0;
/// A beam this far next to an edge may be on either side of it, nm: what marks may stray from rounding. Where corners
/// are welded, that much more.
const EDGE: f64 = 150.0;
/// Focal offset that the merging and rounding of samples may add, nm.
const FOCUS: f64 = 100.0;
/// The same of an angle, rad.
const LEAN: f64 = 1e-3;

/// Limits of the job for focus and angle.
#[derive(Clone, Copy)]
pub(super) struct FocusLimits {
    /// Largest distance from the focal plane along the beam, nm.
    pub(super) defocus: f64,
    /// Largest angle between beam and normal, rad.
    pub(super) lean: f64,
}

impl FocusLimits {
    /// Whether a hit keeps focus and angle.
    fn holds(&self, hit: &BeamHit) -> bool {
        self.holds_focus(hit) && self.holds_lean(hit)
    }

    fn holds_focus(&self, hit: &BeamHit) -> bool {
        hit.off.abs() <= self.defocus + FOCUS + hit.doubt.off
    }

    fn holds_lean(&self, hit: &BeamHit) -> bool {
        hit.lean <= self.lean + LEAN + hit.doubt.lean
    }
}

/// The rules that look at marks.
pub(super) struct MarkRules<'a> {
    pub(super) position: &'a mut Rule,
    pub(super) focus: &'a mut Rule,
    pub(super) surface: &'a mut Rule,
}

/// The worst of all marks.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct WorstFigures {
    pub(super) stray: f64,
    pub(super) defocus: f64,
    pub(super) lean: f64,
}

/// Where a beam meets the part.
#[derive(Clone, Copy, Debug)]
struct BeamHit {
    xy: [f64; 2],
    off: f64,
    lean: f64,
    /// Whether the beam comes to the part from the side, at a step or at the border, below the sheet that begins there.
    aside: bool,
    doubt: Doubt,
    /// How far beside it a beam meets the sheet that passes by it at a distance of 1.
    runs: f64,
}

impl BeamHit {
    /// Whether it lies as near to the hit of another beam as the beams do to each other: no farther than twice their
    /// distance, and what a mark may stray.
    fn is_near(&self, beam: &Beam, there: &Self, other: &Beam) -> bool {
        let doubt = self.doubt.xy + there.doubt.xy;
        math::hypot(self.xy[0] - there.xy[0], self.xy[1] - there.xy[1]) <= STRAY + doubt + 2.0 * beam.distance(other)
    }
}

/// How far focal offset (nm), angle (rad) and place (nm) of a hit may be off where corners of facets are welded.
#[derive(Clone, Copy, Debug, Default)]
struct Doubt {
    off: f64,
    lean: f64,
    xy: f64,
}

impl Doubt {
    fn new(sheet: &Sheet, geometry: &Geometry) -> Self {
        if geometry.weld() == 0.0 {
            return Self::default();
        }
        let slope = sheet.slope2.sqrt();
        Self {
            off: geometry.z_tolerance(sheet.slope2),
            lean: math::atan(slope + geometry.slope_doubt(sheet)) - math::atan(slope),
            xy: 0.0,
        }
    }
}

/// Where a mark lies on its stroke.
pub(super) struct MarkTraces {
    /// All places on the stroke that it may be, the best first.
    pub(super) traces: Vec<Trace>,
    /// How far it may lie from there where corners of facets are welded, nm: as far as leaning beams meet another
    /// height beside it.
    pub(super) loose: f64,
}

/// A mark while its leaning beam is followed from sample to sample.
struct LeaningBeam {
    /// The last beam that met the part, and where.
    last: Option<(Beam, BeamHit)>,
    /// See [`MarkTraces`].
    loose: f64,
    /// Whether a beam of the mark has missed the part.
    is_off_part: bool,
}

/// Looks at marks.
pub(super) struct MarkChecker<'a> {
    chain: &'a Chain,
    geometry: &'a Geometry,
    heights: [f64; 2],
    limits: FocusLimits,
    /// [`EDGE`] of this part.
    edge: f64,
    scratch: Scratch,
    hit_points: Vec<[f64; 2]>,
    pub(super) worst: WorstFigures,
}

impl<'a> MarkChecker<'a> {
    pub(super) fn new(chain: &'a Chain, geometry: &'a Geometry, limits: FocusLimits) -> Self {
        let heights = geometry.heights();
        let scratch = Scratch::default();
        let edge = EDGE + geometry.weld();
        Self { chain, geometry, heights, limits, edge, scratch, hit_points: Vec::new(), worst: WorstFigures::default() }
    }

    /// Looks at one mark: its moves, each with where it begins, and the stroke that it claims.
    pub(super) fn mark(
        &mut self,
        place: &str,
        moves: &[(Commands, FlyStep)],
        stroke: &Stroke,
        rules: &mut MarkRules<'_>,
    ) -> MarkTraces {
        self.hit_points.clear();
        let mut following = LeaningBeam { last: None, loose: 0.0, is_off_part: false };
        for (i, (from, step)) in moves.iter().enumerate() {
            let ends = [from, &step.to].map(|to| to.float());
            let place = || format!("{place}:{}", step.line);
            // The first sample of a later move is the last one of the move before.
            let first = usize::from(i > 0);
            if self.chain.leans() {
                self.leaning(&ends, first, &mut following, &place, rules);
            } else {
                let [start, end] = [&ends[0], &ends[1]].map(|to| self.chain.beam(to));
                let count = (start.distance(&end) / APART) as usize + 2;
                for k in first..=count {
                    let beam = self.chain.beam(&ends[0].between(&ends[1], k as f64 / count as f64));
                    self.hit_points.push([beam.at[0], beam.at[1]]);
                }
                self.upright(&start, &end, &place, rules);
            }
        }
        let loose = following.loose;
        // Position: the hit points on the part against the stroke as it is drawn.
        let most = STRAY + loose;
        let traces = stroke.follow(&self.hit_points, most, loose);
        let Some(trace) = traces.first() else { return MarkTraces { traces, loose } };
        rules.position.checked += self.hit_points.len() as u64;
        self.worst.stray = self.worst.stray.max(trace.worst);
        let first = moves.first().map_or(0, |l| l.1.line);
        if trace.worst > most || trace.worst.is_nan() {
            let [x, y] = trace.at.map(|v| v / 1e6);
            let text = format!("a mark is {:.4} um off its stroke at ({x:.6}, {y:.6}) mm", trace.worst / 1e3);
            rules.position.broken("", format!("{place}:{first}"), text);
        }
        MarkTraces { traces, loose }
    }

    /// A move of a leaning beam, at samples from number `first` on: closer than the facets bend, four steps at least.
    fn leaning(
        &mut self,
        ends: &[Commands<f64>; 2],
        first: usize,
        following: &mut LeaningBeam,
        place: &dyn Fn() -> String,
        rules: &mut MarkRules<'_>,
    ) {
        let [start, end] = [&ends[0], &ends[1]].map(|to| self.chain.beam(to));
        let count = ((start.distance(&end) / APART) as usize + 1).max(4);
        let way = [0, 1].map(|k| end.at[k] - start.at[k]);
        let chain = self.chain;
        let sample = |k: usize| chain.beam(&ends[0].between(&ends[1], k as f64 / count as f64));
        for k in first..=count {
            let beam = sample(k);
            rules.surface.checked += 1;
            // The first sample is held to the next one.
            let beside = following.last.or_else(|| {
                let next = sample(k + 1);
                self.hit(&next, way, None).map(|hit| (next, hit))
            });
            match self.hit(&beam, way, beside) {
                Some(hit) => {
                    following.last = Some((beam, hit));
                    self.hit_points.push(hit.xy);
                    following.loose = following.loose.max(hit.doubt.xy);
                    self.hold(&hit, place, rules.focus);
                }
                // Of a mark one miss is reported.
                None if !following.is_off_part => {
                    following.is_off_part = true;
                    rules.surface.broken("", place(), format!("the beam misses the part, near {}", shown(&beam)));
                }
                None => {}
            }
        }
    }

    /// Checks focal offset and angle at a hit point.
    fn hold(&mut self, hit: &BeamHit, place: &dyn Fn() -> String, rule: &mut Rule) {
        rule.checked += 1;
        self.worst.defocus = self.worst.defocus.max(hit.off.abs());
        self.worst.lean = self.worst.lean.max(hit.lean);
        if !self.limits.holds_focus(hit) {
            let (off, most) = (hit.off.abs() / 1e3, self.limits.defocus / 1e3);
            rule.broken("", place(), format!("a mark is {off:.4} um out of focus ({most:.4} um allowed)"));
        }
        if !self.limits.holds_lean(hit) {
            let (is, most) = (hit.lean.to_degrees(), self.limits.lean.to_degrees());
            rule.broken("", place(), format!("the beam is at {is:.4} deg to the surface normal ({most} deg allowed)"));
        }
    }

    /// A move of an upright beam, facet by facet.
    fn upright(&mut self, start: &Beam, end: &Beam, place: &dyn Fn() -> String, rules: &mut MarkRules<'_>) {
        let ends = [start, end].map(|b| [b.at[0], b.at[1]]);
        let still = math::hypot(ends[1][0] - ends[0][0], ends[1][1] - ends[0][1]) < 1.0;
        let line = if still { point(ends[0]) } else { Line::new(ends[0], ends[1]) };
        rules.surface.checked += 1;
        let mut best: Option<(f64, BeamHit)> = None;
        // A mark along an edge: either side of it will do.
        for side in [0.0, self.edge, -self.edge] {
            let doubt = Doubt::default();
            let mut bare = 0.0;
            let mut worst = BeamHit { xy: ends[0], off: 0.0, lean: 0.0, aside: false, doubt, runs: 0.0 };
            let edge = self.edge;
            let shifted = line.part([0.0, line.len], side);
            self.geometry.along(&shifted, &mut self.scratch, |piece| {
                let Some(sheet) = piece.sheet else {
                    // A crack this narrow may be the rounding or the welding of an edge.
                    bare += if piece.len() > 2.0 * edge { piece.len() } else { 0.0 };
                    return;
                };
                // Beside the line a stretch may lie on a facet of which the mark touches a corner: any place within
                // EDGE along and across the mark counts, to one side at its ends and to both between them.
                let is_end = piece.d[0] < 1.0 || piece.d[1] > line.len - 1.0;
                let least = match side {
                    0.0 => line.len.min(1.0),
                    _ if is_end => edge.min(line.len / 2.0),
                    _ => (2.0 * edge).min(line.len / 2.0),
                };
                if piece.len() < least {
                    return;
                }
                for (d, z) in piece.d.into_iter().zip(sheet.z) {
                    let plane = start.at[2] + d / line.len * (end.at[2] - start.at[2]);
                    if (z - plane).abs() > worst.off.abs() {
                        worst.off = z - plane;
                    }
                }
                worst.lean = worst.lean.max(math::atan(sheet.slope2.sqrt()));
                let doubt = Doubt::new(&sheet, self.geometry);
                worst.doubt.off = worst.doubt.off.max(doubt.off);
                worst.doubt.lean = worst.doubt.lean.max(doubt.lean);
            });
            let over = |f: &BeamHit| !self.limits.holds(f);
            let is_better = best.as_ref().is_none_or(|(b, f)| bare < *b || (bare == *b && over(f) && !over(&worst)));
            if is_better {
                best = Some((bare, worst));
            }
            if best.as_ref().is_some_and(|(b, f)| *b == 0.0 && !over(f)) {
                break;
            }
        }
        let Some((bare, worst)) = best else { return };
        if bare > 0.0 {
            let text =
                format!("the beam misses the part over {:.6} mm of this move, near {}", bare / 1e6, shown(start));
            rules.surface.broken("", place(), text);
        }
        self.hold(&worst, place, rules.focus);
    }

    /// Where a leaning beam of a mark that runs along `way` meets the part. Where it misses the part, or meets it
    /// beyond the limits, from the side or far from a beam beside it, as a beam does that passes a border by the
    /// rounding of its axes, any place within [`EDGE`] along and across the mark counts: at a corner of the part both
    /// are needed, and across it less where the corner is sharp.
    fn hit(&mut self, beam: &Beam, way: [f64; 2], beside: Option<(Beam, BeamHit)>) -> Option<BeamHit> {
        let limits = self.limits;
        let is_near = |hit: &BeamHit| beside.is_none_or(|(other, there)| hit.is_near(beam, &there, &other));
        let is_sure = |hit: &BeamHit| !hit.aside && limits.holds(hit) && is_near(hit);
        let straight = self.met(beam);
        if straight.as_ref().is_some_and(is_sure) {
            return straight;
        }
        let length = math::hypot(way[0], way[1]);
        let [x, y] = if length > 0.0 { way.map(|v| v / length) } else { [1.0, 0.0] };
        let mut first = straight;
        let edge = self.edge;
        // Nearer places across the mark come first, for sharp corners.
        let across = [0.0, 0.0625, -0.0625, 0.25, -0.25, 1.0, -1.0];
        for (s, t) in [0.0, -edge, edge].into_iter().flat_map(|s| across.map(|t| (s, t * edge))) {
            let shift = [s * x - t * y, s * y + t * x];
            let at = [beam.at[0] + shift[0], beam.at[1] + shift[1], beam.at[2]];
            let Some(met) = self.met(&Beam { at, up: beam.up }) else { continue };
            let mut hit = BeamHit { xy: [met.xy[0] - shift[0], met.xy[1] - shift[1]], ..met };
            if self.geometry.weld() > 0.0 {
                hit.doubt.xy += met.runs * math::hypot(s, t);
            }
            if is_sure(&hit) {
                return Some(hit);
            }
            // One that keeps the limits is better than one that does not.
            first = first.filter(|first| self.limits.holds(first) || !self.limits.holds(&hit)).or(Some(hit));
        }
        first
    }

    /// Where a beam meets the part, seen from above: it is followed along its line in plan, from over the highest place
    /// of the part to under the lowest.
    fn met(&mut self, beam: &Beam) -> Option<BeamHit> {
        let [lo, hi] = self.heights;
        let up = beam.up;
        if up[2] <= 0.0 || lo > hi {
            return None;
        }
        let over = |z: f64| [0, 1].map(|k| beam.at[k] + up[k] / up[2] * (z - beam.at[2]));
        // 1 um beyond both, so that the beam begins above the part and ends below it.
        let (top, bottom) = (hi + 1e3, lo - 1e3);
        let (a, b) = (over(top), over(bottom));
        // A beam that moves by less than a nanometre in the plane is as good as upright.
        let across = math::hypot(b[0] - a[0], b[1] - a[1]);
        let line = if across < 1.0 { point(over(0.5 * (top + bottom))) } else { Line::new(a, b) };
        // How high the beam is at the beginning of the line, and how it falls along it.
        let fall = if across < 1.0 { 0.0 } else { (top - bottom) / line.len };
        let height = |d: f64| if across < 1.0 { bottom } else { top - d * fall };
        let mut found: Option<([f64; 3], Sheet, bool)> = None;
        self.geometry.along(&line, &mut self.scratch, |piece| {
            let Some(sheet) = piece.sheet.filter(|_| found.is_none()) else { return };
            let over = [0, 1].map(|k| sheet.z[k] - height(piece.d[k]));
            let share = if over[0] >= 0.0 {
                0.0
            } else if over[1] >= 0.0 {
                over[0] / (over[0] - over[1])
            } else {
                return;
            };
            let d = piece.d[0] + share * piece.len();
            let [x, y] = line.at(d);
            let z = if across < 1.0 { sheet.z[0] } else { height(d) };
            found = Some(([x, y, z], sheet, across >= 1.0 && over[0] > self.edge));
        });
        let (p, sheet, aside) = found?;
        let (grad, mut doubt) = (sheet.grad, Doubt::new(&sheet, self.geometry));
        let off = (0..3).map(|k| (p[k] - beam.at[k]) * up[k]).sum();
        let size = (1.0 + grad[0] * grad[0] + grad[1] * grad[1]).sqrt();
        let normal = [-grad[0] / size, -grad[1] / size, 1.0 / size];
        let cross = [
            normal[1] * up[2] - normal[2] * up[1],
            normal[2] * up[0] - normal[0] * up[2],
            normal[0] * up[1] - normal[1] * up[0],
        ];
        let sin = cross.iter().map(|v| v * v).sum::<f64>().sqrt();
        let cos: f64 = (0..3).map(|k| normal[k] * up[k]).sum();
        // A sheet that is higher by some height is met that much earlier along the beam.
        let lean = math::atan2(sin, cos);
        let slope = sheet.slope2.sqrt() + if doubt.off > 0.0 { self.geometry.slope_doubt(&sheet) } else { 0.0 };
        // A beam that grazes the sheet meets it anywhere: the divisor is kept from 0.
        let by_height = normal[2] / math::cos(lean + doubt.lean).max(0.1) * math::hypot(up[0], up[1]);
        doubt.xy = if doubt.off > 0.0 { self.geometry.z_tolerance(slope * slope) * by_height } else { 0.0 };
        Some(BeamHit { xy: [p[0], p[1]], off, lean, aside, doubt, runs: slope * by_height })
    }
}

/// A line that is as good as a point.
fn point(start: [f64; 2]) -> Line {
    Line { start, dir: [1.0, 0.0], len: 1.0 }
}

fn shown(beam: &Beam) -> String {
    format!("({:.6}, {:.6}) mm", beam.at[0] / 1e6, beam.at[1] / 1e6)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{MeshBuilder, Shape};
    use terrace_core::machine::{Machine, Origin};

    fn geometry(facets: &[[[f64; 3]; 3]]) -> Geometry {
        let mut builder = MeshBuilder::new(0.0, 2.0);
        facets.iter().for_each(|&f| builder.push(f));
        Geometry::new(Shape::Mesh(builder.finish()), 60f64.to_radians(), 0.0)
    }

    fn checker<'a>(chain: &'a Chain, geometry: &'a Geometry) -> MarkChecker<'a> {
        MarkChecker::new(chain, geometry, FocusLimits { defocus: 250e3, lean: 60f64.to_radians() })
    }

    fn chain() -> Chain {
        let machine = Machine::built_in("xyz-galvo-40").expect("a built-in machine");
        Chain::new(&machine, Origin::default(), "XYZUV").expect("five axes")
    }

    #[test]
    fn a_beam_that_passes_the_border_by_rounding_does_not_meet_the_part_from_the_side() {
        // A plate that ends at x = 1, and a beam that goes down towards it from beyond.
        let chain = chain();
        let geometry = geometry(&[[[0.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, -0.4]]]);
        let mut checker = checker(&chain, &geometry);
        let up = [0.5, 0.0, 0.75f64.sqrt()];
        let through = |x: f64| Beam { at: [x, -0.8e6, 0.0], up };
        let inside = checker.hit(&through(0.999e6), [0.0, 1.0], None).expect("a hit");
        assert!(inside.off < -30e3 && (inside.xy[0] - inside.off * 0.5 - 0.999e6).abs() < 1.0, "{inside:?}");
        // Past the edge of the plate it would be met at its border, far below.
        let beyond = through(1e6 + 0.5 * 40e3 / 0.75f64.sqrt() + 120.0);
        let met = checker.met(&beyond).expect("from the side");
        assert!(met.aside, "{met:?}");
        let hit = checker.hit(&beyond, [0.0, 1.0], None).expect("beside it");
        assert!(!hit.aside, "{hit:?}");
        // Farther out that is where it meets the part.
        let hit = checker.hit(&through(1.03e6), [0.0, 1.0], None).expect("from the side");
        assert!(hit.aside, "{hit:?}");
    }

    #[test]
    fn a_move_along_the_border_passes_the_corner_of_a_steep_facet() {
        // Level above the x axis but for a steep facet, which touches the axis with a corner of `width` mm.
        let passes = |width: f64| {
            let [a, b, c, d] = [[0.0, 0.0, 0.0], [0.5, 0.0, 0.0], [0.5 + width, 0.0, 5.0 * width], [1.0, 0.0, 0.0]];
            let [l, t, u, r] = [[0.0, 1.0, 0.0], [0.4, 1.0, 0.0], [0.6, 1.0, 0.5], [1.0, 1.0, 0.0]];
            let steep = if width == 0.0 { vec![[b, t, u]] } else { vec![[b, t, u], [b, c, u]] };
            let facets = [vec![[a, b, t], [a, t, l], [c, d, r], [c, r, u]], steep].concat();
            let (chain, geometry) = (chain(), geometry(&facets));
            let mut checker = checker(&chain, &geometry);
            let [start, end] = [0.2e6, 0.8e6].map(|x| Beam { at: [x, -2.0, 0.0], up: [0.0, 0.0, 1.0] });
            let [mut position, mut focus, mut surface] =
                ["position", "focus", "surface"].map(|code| Rule::new(code, ""));
            let mut rules = MarkRules { position: &mut position, focus: &mut focus, surface: &mut surface };
            checker.upright(&start, &end, &|| String::new(), &mut rules);
            (focus.violated, surface.violated)
        };
        assert_eq!(passes(0.0), (0, 0));
        assert_eq!(passes(2e-3), (1, 0));
    }
}
