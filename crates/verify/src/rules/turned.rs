//! Blocks of a tilted part: their own geometry, and where their marks lie in the drawing.
//!
//! The texture is fixed on the part by projection along its z axis, while a tilted block marks along its own beam. So
//! the beam is followed down to the turned part's topmost sheet, and the point found there is looked up in the drawing.
//! A mark that the part hides from the beam is found on the facet that hides it, and so off its stroke.

use super::part_place_nm;
use crate::geometry::{BoxNm, Geometry, Line, Scratch, Sheet, Turn};
use crate::job_facts::JobFacts;
use crate::proof::Rule;
use crate::read::program::ProgramFile;
use terrace_core::geom::{FieldPoint, P2, P3};
use terrace_core::machine::{Origin, TiltAngles};
use terrace_core::math;
use terrace_core::program::{Block, CHORD_NM, PassId, SetupId};

/// The geometry of one tilt under a box of the part, nm.
pub(super) struct Turned {
    tilt: TiltAngles,
    pass: PassId,
    setup: SetupId,
    area: BoxNm,
    pub(super) turn: Turn,
    pub(super) geometry: Geometry,
}

/// Room around a block that its geometry is made for, nm: blocks of the same tilt that lie within it need no other.
const SPARE: f64 = 1e6;

/// How far rounding to the grid moves a point of the plane, nm: half the diagonal of its cell.
const GRID: f64 = std::f64::consts::FRAC_1_SQRT_2;

/// Where the points of tilted blocks lie in the drawing.
#[derive(Default)]
pub(crate) struct PointsInDrawing {
    /// By point of the program; empty where nothing is tilted.
    pub(super) points: Vec<P2>,
    /// By stroke of the program: how far its points may be off, nm.
    pub(super) off: Vec<f64>,
}

impl PointsInDrawing {
    /// Whether no block is tilted.
    pub(crate) fn is_empty(&self) -> bool {
        self.points.is_empty()
    }
    fn reserve(&mut self, file: &ProgramFile) {
        self.points.resize(file.program.points.len(), P2::default());
        self.off.resize(file.program.strokes.len(), 0.0);
    }
}

/// A line of a mark on the geometry.
#[derive(Clone, Copy, Default)]
struct UnderLine {
    /// Where its ends lie in the drawing; None where it is off the part.
    ends: Option<[[f64; 2]; 2]>,
    /// The place farthest off the line between them.
    aside: Aside,
    /// Square of the steepest slope under it.
    slope2: f64,
    /// How far beside it the geometry was looked at, nm.
    side: f64,
}

/// A mark where it lies in the drawing.
#[derive(Default)]
struct MarkInDrawing {
    points: Vec<[f64; 2]>,
    /// Where it runs farther off the line between two points than it may.
    unmatched: Option<Aside>,
    /// Square of the steepest slope under it.
    slope2: f64,
    /// How far beside it the geometry was looked at, nm.
    side: f64,
}

/// Buffers that are used again from mark to mark.
#[derive(Default)]
struct Buffers {
    scratch: Scratch,
    pieces: Vec<OnSheet>,
}

/// A place in the drawing that lies off a line, and how far, nm.
#[derive(Clone, Copy, Default)]
struct Aside {
    place: [f64; 2],
    by: f64,
}

impl Turned {
    /// Makes the geometry of a tilted block ready in `last`, unless what is there serves; false where the block
    /// is not tilted.
    pub(super) fn prepare(
        file: &ProgramFile,
        block: &Block,
        facts: &JobFacts,
        flat: &Geometry,
        last: &mut Option<Self>,
    ) -> bool {
        let (tilt, Some(table)) = (block.stop.tilt, &facts.machine.tilt) else { return false };
        if tilt.is_upright() {
            return false;
        }
        // Later passes lie on a surface that has sunk along the part's own z. The geometry is that of the file, so the
        // origin is lowered in its place.
        let Origin([x, y, z]) = file.origin(block);
        let turn = Turn::new(table, tilt, Origin([x, y, z.saturating_sub(facts.passes.lowered(block.pass).0)]));
        let needed = area(file, &facts.raised(block), &turn);
        let serves = |t: &Self| (t.tilt, t.pass, t.setup) == (tilt, block.pass, block.setup) && t.area.holds(&needed);
        if !last.as_ref().is_some_and(serves) {
            let area = needed.grown(SPARE);
            let Block { pass, setup, .. } = *block;
            *last = Some(Self { tilt, pass, setup, area, turn, geometry: flat.turned(&turn, area) });
        }
        true
    }

    /// Finds where the points of a block's strokes lie in the drawing; between them a mark must run straight
    /// there as well. The block's heights are those of the surface as the file has it.
    pub(super) fn draw(
        &self,
        id: &str,
        file: &ProgramFile,
        block: &Block,
        drawn: &mut PointsInDrawing,
        source: &mut Rule,
    ) {
        drawn.reserve(file);
        let mut buffers = Buffers::default();
        let mut mark = MarkInDrawing::default();
        let strokes = file.program.strokes[block.strokes.clone()].iter().zip(block.strokes.clone());
        for (stroke, number) in strokes {
            source.checked += 1;
            // In the direction of the drawing: where a mark runs over a step, the program has its point before it.
            let mut points = file.program.points_of(stroke).to_vec();
            if stroke.reversed {
                points.reverse();
            }
            if let [dot] = points[..] {
                let p_turned = on_turned_part(block, dot);
                self.draw_dot(p_turned, block, number, stroke.first as usize, drawn, &mut buffers.scratch);
                continue;
            }
            self.draw_mark(&points, block, &mut mark, &mut buffers);
            if stroke.reversed {
                mark.points.reverse();
            }
            for (slot, p) in drawn.points[stroke.first as usize..].iter_mut().zip(&mark.points) {
                *slot = P2::new(p[0].round() as i64, p[1].round() as i64);
            }
            drawn.off[number] = self.off(mark.slope2, mark.side);
            if let Some(Aside { place, by }) = mark.unmatched {
                let text = format!("a mark on the tilted part runs {:.4} um off the line between its points", by / 1e3);
                source.broken(id, part_place_nm(place), text);
            }
        }
    }

    /// Lays a mark in the drawing. Of a mark along the top of a wall the side on which it begins must be one from which
    /// it can continue, and what lies there is at a height of the block. Where no side fits, the line itself decides.
    fn draw_mark(&self, points: &[FieldPoint], block: &Block, mark: &mut MarkInDrawing, buffers: &mut Buffers) {
        let heights = [block.z_lo.f64(), block.z_hi.f64()];
        let all = self.sides();
        for begin in 0..all.len() {
            let mut sides = all;
            sides.rotate_left(begin);
            if self.follow(points, block, sides, heights, mark, buffers) {
                return;
            }
        }
        self.follow(points, block, [0.0; 5], [f64::NEG_INFINITY, f64::INFINITY], mark, buffers);
    }

    /// Lays a mark in the drawing line by line, each on the first of the sides that fits, `within` these heights.
    /// Returns whether one fits for every line.
    fn follow(
        &self,
        points: &[FieldPoint],
        block: &Block,
        sides: [f64; 5],
        within: [f64; 2],
        mark: &mut MarkInDrawing,
        buffers: &mut Buffers,
    ) -> bool {
        mark.points.clear();
        (mark.unmatched, mark.slope2, mark.side) = (None, 0.0, 0.0);
        let mut fits = true;
        for w in points.windows(2) {
            let line = Line::new(on_turned_part(block, w[0]), on_turned_part(block, w[1]));
            let (under, is_fit) = self.under(&line, mark.points.last().copied(), sides, within, buffers);
            fits &= is_fit;
            let Some([first, last]) = under.ends else {
                // Off the part, which the rule `surface` says.
                if mark.points.is_empty() {
                    mark.points.push(self.at_focus(block, w[0]));
                }
                mark.points.push(self.at_focus(block, w[1]));
                continue;
            };
            if mark.points.is_empty() {
                mark.points.push(first);
            }
            mark.points.push(last);
            mark.slope2 = mark.slope2.max(under.slope2);
            mark.side = mark.side.max(under.side);
            if under.aside.by > self.beside(under.slope2) {
                mark.unmatched = Some(under.aside);
            }
        }
        fits
    }

    /// Where a point of the field would lie in the drawing if the part were at the focal plane there.
    fn at_focus(&self, block: &Block, p: FieldPoint) -> [f64; 2] {
        let [x, y] = on_turned_part(block, p);
        let [x, y, _] = self.turn.back(P3::new([x, y, block.stop.lpfl.f64()])).at;
        [x, y]
    }

    /// Finds where a dot lies in the drawing: at the height under it that the block has.
    fn draw_dot(
        &self,
        p_turned: [f64; 2],
        block: &Block,
        number: usize,
        point: usize,
        drawn: &mut PointsInDrawing,
        scratch: &mut Scratch,
    ) {
        let around = self.geometry.around(p_turned, scratch);
        let is_near = |s: &Sheet| {
            let known = self.geometry.z_tolerance(s.slope2);
            block.z_lo.f64() - known <= s.z[0] && s.z[0] <= block.z_hi.f64() + known
        };
        let sheets = || around.iter().filter_map(|p| p.sheet);
        let found = sheets().find(is_near).or_else(|| sheets().next());
        // Off the part, which the rule `surface` says, any height does.
        let (z, slope2) = found.map_or((block.stop.lpfl.f64(), 0.0), |s| (s.z[0], s.slope2));
        let [x, y, _] = self.turn.back(P3::new([p_turned[0], p_turned[1], z])).at;
        drawn.points[point] = P2::new(x.round() as i64, y.round() as i64);
        let is_under = around.first().and_then(|p| p.sheet).is_some_and(|s| is_near(&s));
        drawn.off[number] = self.off(slope2, if is_under { 0.0 } else { self.geometry.grain() });
    }

    /// How far a point may be off that is found in the drawing from its place in the field, nm, where the beam meets
    /// the part at the slope `slope2` and the height was taken `side` nm beside the mark. With the sine l of the tilt,
    /// the slope t against the beam and the slope s of the drawing, of angles b and a:
    ///
    /// - The point of the field was rounded: [`GRID`] sideways, and the geometry there is t times as much higher. So it
    ///   is, by t times `side`, where the height was taken.
    /// - The cut point was rounded in the drawing, but has the height of the cut: s [`GRID`] off the geometry.
    /// - The geometry itself is known to [`Geometry::z_tolerance`] at s. Along the beam both come to cos a / cos b
    ///   times as much, which with a height of c + s d is at most hypot(c, d) / cos b.
    /// - A height that is off by 1 along the beam moves the point by l in the drawing.
    /// - The point found is rounded there once more: [`GRID`].
    fn off(&self, slope2: f64, side: f64) -> f64 {
        let [level, slope] = self.geometry.z_tolerance_parts();
        let geometry = math::hypot(level, slope + GRID) * (1.0 + slope2).sqrt();
        2.0 * GRID + self.turn.lean() * ((GRID + side) * slope2.sqrt() + geometry)
    }

    /// How far a mark may run off the line between its points in the drawing, nm: [`CHORD_NM`] in the field, which the
    /// slope against the beam turns into height and the tilt into a way sideways; and ends and place as each is known.
    fn beside(&self, slope2: f64) -> f64 {
        CHORD_NM * (1.0 + self.turn.lean() * slope2.sqrt()) + 2.0 * self.off(slope2, 0.0)
    }

    /// Where the geometry is looked at for a mark, nm next to it: a little, where it lies on an edge as far as rounding
    /// and welding decide, and as far as it may run off its stroke, with a tenth more.
    fn sides(&self) -> [f64; 5] {
        let (near, far) = (5.5 + self.geometry.weld(), 1.1 * CHORD_NM + self.geometry.weld());
        [0.0, near, -near, far, -far]
    }

    /// Pieces up to this, nm, do not show on which sheet a point lies: rim and mark are each known to the grid, and the
    /// rim to welding, and the mark may cross the rim at 15 degrees.
    fn short(&self) -> f64 {
        // 1 / sin 15 deg is 3.9.
        4.0 * (2.5 + self.geometry.weld())
    }

    /// Lays a line of the turned part in the drawing. A line along the rim or the top of a wall may run next to it by
    /// as much as a mark may run off its stroke: then the part next to it gives the heights. A mark continues where it
    /// was, at `after`, and stays `within` its block's heights. Answers too whether one of the sides fits.
    fn under(
        &self,
        line: &Line,
        after: Option<[f64; 2]>,
        sides: [f64; 5],
        within: [f64; 2],
        buffers: &mut Buffers,
    ) -> (UnderLine, bool) {
        let Buffers { scratch, pieces } = buffers;
        let mut under = UnderLine::default();
        // The first side fits on which the mark lies on the part throughout, runs straight in the drawing, and
        // continues where it was. If none does, the last one says what is wrong.
        for side in sides {
            let mut widest_gap = 0.0f64;
            pieces.clear();
            let is_near = |s: &Sheet| {
                let known = self.geometry.z_tolerance(s.slope2);
                s.z.iter().any(|&z| z >= within[0] - known) && s.z.iter().any(|&z| z <= within[1] + known)
            };
            self.geometry.along(&line.part([0.0, line.len], side), scratch, |p| match p.sheet.filter(is_near) {
                Some(s) => pieces.push(OnSheet { d: p.d, z: s.z, slope2: s.slope2 }),
                None => widest_gap = widest_gap.max(p.len()),
            });
            self.leave_out_other_sheets(line, after, pieces);
            under = self.drawn_from(line, side, pieces);
            let Some([first, _]) = under.ends else { continue };
            let beside = self.beside(under.slope2);
            let continues = after.is_none_or(|a| math::hypot(a[0] - first[0], a[1] - first[1]) <= beside);
            // So far aside, a rim that the mark ends at is met as much earlier or later where it runs at 45 degrees to
            // it.
            if widest_gap <= self.short() + side.abs() && under.aside.by <= beside && continues {
                return (under, true);
            }
        }
        (under, false)
    }

    /// Keeps the pieces that the mark lies on. No mark runs over a step between sheets (the program ends it there), so
    /// a short piece beyond a step at either end is what lies next to the rim on which the mark begins or ends, and a
    /// short one in between is an edge that the line grazes. The pieces that stay at the ends are drawn out over them.
    /// Of a line that is short itself, the first piece stays if the mark comes from it, from `after`.
    fn leave_out_other_sheets(&self, line: &Line, after: Option<[f64; 2]>, pieces: &mut Vec<OnSheet>) {
        let (short, len) = (self.short(), line.len);
        // The program ends a mark at a step that would move it by more than half of [`CHORD_NM`].
        let least = CHORD_NM / 2.0 / self.turn.lean();
        let steps = |a: &OnSheet, b: &OnSheet| {
            let known = self.geometry.z_tolerance(a.slope2.max(b.slope2));
            (a.z[1] - b.z[0]).abs() > least.min(2.0 * known)
        };
        let comes_from = |a: &OnSheet| {
            let ([x, y], known) = (line.at(a.d[0]), self.beside(a.slope2));
            let [x, y, _] = self.turn.back(P3::new([x, y, a.z[0]])).at;
            len <= short && after.is_some_and(|after| math::hypot(after[0] - x, after[1] - y) <= known)
        };
        while let [a, b, ..] = pieces[..]
            && a.d[1] <= short
            && steps(&a, &b)
            && !comes_from(&a)
        {
            pieces.remove(0);
        }
        while let [.., a, b] = pieces[..]
            && len - b.d[0] <= short
            && steps(&a, &b)
        {
            pieces.pop();
        }
        let last = pieces.len().saturating_sub(1);
        let mut i = 0;
        pieces.retain(|p| {
            i += 1;
            i == 1 || i == last + 1 || p.d[1] - p.d[0] > short
        });
        if let Some(first) = pieces.first_mut()
            && first.d[0] <= short
        {
            *first = first.over([0.0, first.d[1]]);
        }
        if let Some(last) = pieces.last_mut()
            && len - last.d[1] <= short
        {
            *last = last.over([last.d[0], len]);
        }
    }

    /// The ends of the pieces in the drawing; the pieces lie `side` nm beside the line.
    fn drawn_from(&self, line: &Line, side: f64, pieces: &[OnSheet]) -> UnderLine {
        let back = |d: f64, z: f64| {
            let [x, y] = line.at(d);
            let [x, y, _] = self.turn.back(P3::new([x, y, z])).at;
            [x, y]
        };
        let ends = |p: &OnSheet| [0, 1].map(|k| back(p.d[k], p.z[k]));
        let (Some(first), Some(last)) = (pieces.first().map(ends), pieces.last().map(ends)) else {
            return UnderLine::default();
        };
        let chord = [first[0], last[1]];
        UnderLine {
            ends: Some(chord),
            aside: farthest(chord, pieces.iter().flat_map(ends)),
            slope2: pieces.iter().map(|p| p.slope2).fold(0.0, f64::max),
            side: side.abs(),
        }
    }
}

/// A piece of a line on one sheet: where, its heights, and the square of its slope.
#[derive(Clone, Copy)]
struct OnSheet {
    d: [f64; 2],
    z: [f64; 2],
    slope2: f64,
}

impl OnSheet {
    /// The same plane over another stretch of the line.
    fn over(&self, d: [f64; 2]) -> Self {
        let rise = (self.z[1] - self.z[0]) / (self.d[1] - self.d[0]).max(f64::MIN_POSITIVE);
        Self { d, z: d.map(|d| self.z[0] + (d - self.d[0]) * rise), ..*self }
    }
}

/// Which of the points lies farthest off a line, and by how much.
fn farthest([first, last]: [[f64; 2]; 2], points: impl Iterator<Item = [f64; 2]>) -> Aside {
    if first == last {
        return Aside { place: first, by: 0.0 };
    }
    let chord = Line::new(first, last);
    let aside = |[x, y]: [f64; 2]| (chord.dir[0] * (y - chord.start[1]) - chord.dir[1] * (x - chord.start[0])).abs();
    points
        .map(|place| Aside { place, by: aside(place) })
        .fold(Aside { place: first, by: 0.0 }, |worst, p| if p.by > worst.by { p } else { worst })
}

/// A point of the field of a block on the turned part, nm.
fn on_turned_part(block: &Block, p: FieldPoint) -> [f64; 2] {
    let centre = block.stop.centre;
    [(centre.x + i64::from(p.x)) as f64, (centre.y + i64::from(p.y)) as f64]
}

/// The box of the part under a block's marks.
fn area(file: &ProgramFile, block: &Block, turn: &Turn) -> BoxNm {
    let mut area = BoxNm::EMPTY;
    let points = file.program.strokes_of(block).iter().flat_map(|s| file.program.points_of(s));
    let (lo, hi) = points.fold(([i32::MAX; 2], [i32::MIN; 2]), |(lo, hi), p| {
        ([lo[0].min(p.x), lo[1].min(p.y)], [hi[0].max(p.x), hi[1].max(p.y)])
    });
    for [u, v] in [[lo[0], lo[1]], [hi[0], lo[1]], [lo[0], hi[1]], [hi[0], hi[1]]] {
        for z in [block.stop.z_lo, block.stop.z_hi] {
            let at = [block.stop.centre.x + i64::from(u), block.stop.centre.y + i64::from(v), z.0];
            let [x, y, _] = turn.back(P3::new(at.map(|v| v as f64))).at;
            area.add([x, y]);
        }
    }
    area
}
