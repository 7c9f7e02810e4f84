//! Blocks of a tilted part: their own geometry, and where their marks lie in the drawing.
//!
//! The texture is fixed on the part by projection along its z axis, while a tilted block marks along its own beam. So
//! the beam is followed down to the turned part's topmost sheet, and the point found there is looked up in the drawing.
//! A mark that the part hides from the beam comes out on what hides it, and so off its stroke.

use super::part_place_nm;
use crate::geometry::{BoxNm, Geometry, Line, Scratch, Sheet, Turn};
use crate::job_facts::JobFacts;
use crate::proof::Rule;
use crate::read::program::ProgramFile;
use terrace_core::geom::{FieldPoint, P2, P3};
use terrace_core::machine::{Origin, TiltAngles};
use terrace_core::program::{Block, CHORD_NM, PassId};

/// The geometry of one tilt under a box of the part, nm.
pub(super) struct Turned {
    tilt: TiltAngles,
    pass: PassId,
    area: BoxNm,
    pub(super) turn: Turn,
    pub(super) geometry: Geometry,
}

/// Room around a block that its geometry is made for, nm: blocks of the same tilt need no other.
const SPARE: f64 = 1e6;

/// How far rounding to the grid moves a point of the plane, nm: half the diagonal of its cell.
const GRID: f64 = std::f64::consts::FRAC_1_SQRT_2;

/// Where the points of tilted blocks lie in the drawing.
#[derive(Default)]
pub(crate) struct Drawn {
    /// By point of the program; empty where nothing is tilted.
    pub(super) points: Vec<P2>,
    /// By stroke of the program: how far its points may be off, nm.
    pub(super) off: Vec<f64>,
}

impl Drawn {
    /// Whether no block is tilted.
    pub(crate) fn is_empty(&self) -> bool {
        self.points.is_empty()
    }
    fn reserve(&mut self, file: &ProgramFile) {
        self.points.resize(file.program.points.len(), P2::default());
        self.off.resize(file.program.strokes.len(), 0.0);
    }
}

/// What the geometry shows under one line of a mark.
#[derive(Clone, Copy, Default)]
struct Under {
    /// Where its ends lie in the drawing; None where it is off the part.
    ends: Option<[[f64; 2]; 2]>,
    /// The place farthest off the line between them, and by how much, nm.
    aside: ([f64; 2], f64),
    /// Square of the steepest slope under it.
    slope2: f64,
    /// How far beside it the geometry was looked at, nm.
    side: f64,
}

impl Turned {
    /// Makes the geometry of a tilted block ready in `last`, unless what is there serves; false where the block
    /// is not tilted.
    pub(super) fn of(
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
        // Later passes lie on a surface that has sunk along the part's own z.
        let Origin([x, y, z]) = file.origin(block);
        let turn = Turn::of(table, tilt, Origin([x, y, z.saturating_sub(facts.passes.lowered(block.pass).0)]));
        let block = &facts.raised(block);
        let needed = area(file, block, &turn);
        let serves = |t: &Self| (t.tilt, t.pass) == (tilt, block.pass) && t.area.holds(&needed);
        if !last.as_ref().is_some_and(serves) {
            let area = needed.grown(SPARE);
            *last = Some(Self { tilt, pass: block.pass, area, turn, geometry: flat.turned(&turn, area) });
        }
        true
    }

    /// Finds where the points of a block's strokes lie in the drawing; between them a mark must run straight
    /// there as well. The block's heights are those of the surface as the file has it.
    pub(super) fn draw(&self, id: &str, file: &ProgramFile, block: &Block, drawn: &mut Drawn, source: &mut Rule) {
        drawn.reserve(file);
        let heights = [block.z_lo.f64(), block.z_hi.f64()];
        let mut scratch = Scratch::default();
        let (mut found, mut pieces) = (Vec::new(), Vec::new());
        let strokes = file.program.strokes[block.strokes.clone()].iter().zip(block.strokes.clone());
        for (stroke, number) in strokes {
            // In the direction of the drawing: where a mark runs over a step, the program has its point before it.
            let mut points = file.program.points_of(stroke).to_vec();
            if stroke.reversed {
                points.reverse();
            }
            let field = |p: FieldPoint| {
                [(block.stop.centre.x + i64::from(p.x)) as f64, (block.stop.centre.y + i64::from(p.y)) as f64]
            };
            if let [dot] = points[..] {
                self.draw_dot(field(dot), block, number, stroke.first as usize, drawn, &mut scratch);
                source.checked += 1;
                continue;
            }
            let (mut unmatched, mut slope2, mut side) = (None, 0.0, 0.0);
            // A mark along the top of a wall: the side on which it begins must be one from which it can continue, and
            // what lies there is at a height of the block. Where no side fits, the line itself decides.
            let all = self.sides();
            for begin in 0..=all.len() {
                let (mut sides, mut within) = (all, heights);
                if begin < all.len() {
                    sides.rotate_left(begin)
                } else {
                    (sides, within) = ([0.0; 5], [f64::NEG_INFINITY, f64::INFINITY])
                }
                found.clear();
                (unmatched, slope2, side) = (None, 0.0f64, 0.0f64);
                let mut fits = true;
                for w in points.windows(2) {
                    let line = Line::new(field(w[0]), field(w[1]));
                    let from = found.last().copied();
                    let (under, is_fit) = self.under(&line, from, sides, within, &mut scratch, &mut pieces);
                    fits &= is_fit;
                    let Some([first, last]) = under.ends else {
                        // Off the part, which the rule `surface` says.
                        let at = |p: FieldPoint| {
                            let [x, y] = field(p);
                            let [x, y, _] = self.turn.back(P3::new([x, y, block.stop.focus.f64()])).at;
                            [x, y]
                        };
                        if found.is_empty() {
                            found.push(at(w[0]));
                        }
                        found.push(at(w[1]));
                        continue;
                    };
                    if found.is_empty() {
                        found.push(first);
                    }
                    found.push(last);
                    (slope2, side) = (slope2.max(under.slope2), side.max(under.side));
                    if under.aside.1 > self.beside(under.slope2) {
                        unmatched = Some(under.aside);
                    }
                }
                if fits {
                    break;
                }
            }
            if stroke.reversed {
                found.reverse();
            }
            for (slot, p) in drawn.points[stroke.first as usize..].iter_mut().zip(&found) {
                *slot = P2::new(p[0].round() as i64, p[1].round() as i64);
            }
            drawn.off[number] = self.off(slope2, side);
            source.checked += 1;
            if let Some((at, aside)) = unmatched {
                let text =
                    format!("a mark on the tilted part runs {:.4} um off the line between its points", aside / 1e3);
                source.broken(id, part_place_nm(at), text);
            }
        }
    }

    /// Finds where a dot lies in the drawing: at the height under it that the block has.
    fn draw_dot(
        &self,
        at: [f64; 2],
        block: &Block,
        number: usize,
        point: usize,
        drawn: &mut Drawn,
        scratch: &mut Scratch,
    ) {
        let around = self.geometry.around(at, scratch);
        let is_near = |s: &Sheet| {
            let known = self.geometry.z_tolerance(s.slope2);
            block.z_lo.f64() - known <= s.z[0] && s.z[0] <= block.z_hi.f64() + known
        };
        let sheets = || around.iter().filter_map(|p| p.sheet);
        let found = sheets().find(is_near).or_else(|| sheets().next());
        // Off the part, which the rule `surface` says, any height does.
        let (z, slope2) = found.map_or((block.stop.focus.f64(), 0.0), |s| (s.z[0], s.slope2));
        let [x, y, _] = self.turn.back(P3::new([at[0], at[1], z])).at;
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
        let geometry = level.hypot(slope + GRID) * (1.0 + slope2).sqrt();
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
        4.0 * (2.5 + self.geometry.weld())
    }

    /// What lies under a line of the turned part. A line along the rim or the top of a wall may run next to it by as
    /// much as a mark may run off its stroke: then the part next to it gives the heights. A mark continues where it
    /// was, at `after`, and stays `within` its block's heights. Answers too whether one of the sides fits.
    fn under(
        &self,
        line: &Line,
        after: Option<[f64; 2]>,
        sides: [f64; 5],
        within: [f64; 2],
        scratch: &mut Scratch,
        pieces: &mut Vec<OnSheet>,
    ) -> (Under, bool) {
        let mut under = Under::default();
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
            let goes_on = after.is_none_or(|a| (a[0] - first[0]).hypot(a[1] - first[1]) <= beside);
            // So far aside, a rim that the mark ends at is met as much earlier or later where it runs at 45 degrees to
            // it.
            if widest_gap <= self.short() + side.abs() && under.aside.1 <= beside && goes_on {
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
            len <= short && after.is_some_and(|after| (after[0] - x).hypot(after[1] - y) <= known)
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
    fn drawn_from(&self, line: &Line, side: f64, pieces: &[OnSheet]) -> Under {
        let back = |d: f64, z: f64| {
            let [x, y] = line.at(d);
            let [x, y, _] = self.turn.back(P3::new([x, y, z])).at;
            [x, y]
        };
        let ends = |p: &OnSheet| [0, 1].map(|k| back(p.d[k], p.z[k]));
        let (Some(first), Some(last)) = (pieces.first().map(ends), pieces.last().map(ends)) else {
            return Under::default();
        };
        let chord = [first[0], last[1]];
        Under {
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
fn farthest([first, last]: [[f64; 2]; 2], points: impl Iterator<Item = [f64; 2]>) -> ([f64; 2], f64) {
    if first == last {
        return (first, 0.0);
    }
    let chord = Line::new(first, last);
    let aside = |[x, y]: [f64; 2]| (chord.dir[0] * (y - chord.start[1]) - chord.dir[1] * (x - chord.start[0])).abs();
    points.map(|p| (p, aside(p))).fold((first, 0.0), |worst, p| if p.1 > worst.1 { p } else { worst })
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
