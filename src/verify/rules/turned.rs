//! Blocks of a tilted part: their own ground, and where their marks lie in the drawing.
//!
//! The texture is fixed on the part by projection along its z axis, while a tilted block marks along its
//! own beam. So the beam is followed down to the turned part's topmost sheet, and the point found there is
//! looked up in the drawing. A mark that the part hides from the beam comes out on what hides it, and so
//! beside its stroke.

use super::part_place_nm;
use crate::geom::P2;
use crate::program::{Block, CHORD};
use crate::verify::depth::{Ground, Line, Scratch, Turn};
use crate::verify::facts::Facts;
use crate::verify::proof::Rule;
use crate::verify::read::program::ProgramFile;

/// The ground of one tilt under a box of the part, nm.
pub(super) struct Turned {
    tilt: [i64; 2],
    pass: u32,
    area: [f64; 4],
    pub(super) turn: Turn,
    pub(super) ground: Ground,
}

/// Room around a block that its ground is made for, nm: blocks of the same tilt need no other.
const SPARE: f64 = 1e6;

/// What rounding of the field and the heights moves a mark by, nm.
const ROUNDING: f64 = 5.0;

/// How far a mark may run beside the line between its points, nm.
const BESIDE: f64 = 1.1 * CHORD + ROUNDING;

/// Where the ground is looked at for a mark, nm beside it: a little, where it lies on an edge to the nanometre, and
/// as far as it may run beside its stroke.
const SIDES: [f64; 5] = [0.0, 5.0, -5.0, CHORD, -CHORD];

/// Pieces up to this, nm, do not tell on which side of a wall a point lies.
const SHORT: f64 = 10.0;

impl Turned {
    /// The ground of a tilted block, by `last` where that serves; None where the block is not tilted.
    pub(super) fn of(file: &ProgramFile, block: &Block, facts: &Facts, flat: &Ground, last: &mut Option<Self>) -> bool {
        let (tilt, Some(table)) = (block.stop.tilt, &facts.machine.tilt) else { return false };
        if tilt == [0; 2] {
            return false;
        }
        // Later passes lie on a surface that has sunk along the part's own z.
        let [x, y, z] = file.origin(block);
        let turn = Turn::of(table, tilt, [x, y, z.saturating_sub(facts.passes.lowered_nm(block.pass))]);
        let block = &facts.raised(block);
        let [x0, y0, x1, y1] = area(file, block, &turn);
        let serves = |t: &Self| {
            (t.tilt, t.pass) == (tilt, block.pass)
                && t.area[0] <= x0
                && t.area[1] <= y0
                && x1 <= t.area[2]
                && y1 <= t.area[3]
        };
        if !last.as_ref().is_some_and(serves) {
            let area = [x0 - SPARE, y0 - SPARE, x1 + SPARE, y1 + SPARE];
            *last = Some(Self { tilt, pass: block.pass, area, turn, ground: flat.turned(&turn, area) });
        }
        true
    }

    /// Finds where the points of a block's strokes lie in the drawing; between them a mark must run straight
    /// there as well.
    pub(super) fn draw(&self, id: &str, file: &ProgramFile, block: &Block, drawn: &mut [P2], source: &mut Rule) {
        let mut scratch = Scratch::default();
        let (mut found, mut ends) = (Vec::new(), Vec::new());
        for stroke in file.program.strokes_of(block) {
            let points = file.program.points_of(stroke);
            let field = |p: [i32; 2]| {
                [(block.stop.centre.x + i64::from(p[0])) as f64, (block.stop.centre.y + i64::from(p[1])) as f64]
            };
            let mut astray: Option<([f64; 2], f64)> = None;
            // A mark along the top of a wall: the side on which it begins must be one from which it can go on. Where
            // no side fits, the line itself tells.
            for begin in 0..=SIDES.len() {
                let mut sides = SIDES;
                if begin < SIDES.len() {
                    sides.rotate_left(begin)
                } else {
                    sides = [0.0; 5]
                }
                found.clear();
                astray = None;
                let mut fits = true;
                for w in points.windows(2) {
                    let line = Line::new(field(w[0]), field(w[1]));
                    let after = found.last().copied();
                    let (aside, is_fit) = self.ends(&line, after, sides, &mut scratch, &mut ends);
                    fits &= is_fit;
                    let (Some(&first), Some(&last)) = (ends.first(), ends.last()) else {
                        // Off the part, which the rule `ground` says.
                        let [x, y] = field(w[0]);
                        let [x, y, _] = self.turn.back([x, y, block.stop.focus as f64]);
                        found.push([x, y]);
                        continue;
                    };
                    if found.is_empty() {
                        found.push(first);
                    }
                    found.push(last);
                    if aside.1 > astray.map_or(BESIDE, |a| a.1) {
                        astray = Some(aside);
                    }
                }
                if fits {
                    break;
                }
            }
            for (slot, p) in drawn[stroke.first as usize..].iter_mut().zip(&found) {
                *slot = P2::new(p[0].round() as i64, p[1].round() as i64);
            }
            source.checked += 1;
            if let Some((at, aside)) = astray {
                let text =
                    format!("a mark on the tilted part runs {:.4} um beside the line between its points", aside / 1e3);
                source.broken(id, part_place_nm(at), text);
            }
        }
    }
}

impl Turned {
    /// The ends of the pieces under a line of the turned part, in the drawing, and which of them lies farthest
    /// beside the line between the first and the last, by how much. A line along the rim or the top of a wall
    /// may run beside it by as much as a mark may run beside its stroke: then the part next to it tells the heights.
    /// A mark goes on where it was, at `after`. Answers too whether one of the sides fits.
    fn ends(
        &self,
        line: &Line,
        after: Option<[f64; 2]>,
        sides: [f64; 5],
        scratch: &mut Scratch,
        ends: &mut Vec<[f64; 2]>,
    ) -> (([f64; 2], f64), bool) {
        let mut aside = ([0.0; 2], 0.0);
        for side in sides {
            let mut covered = 0.0;
            ends.clear();
            self.ground.along(&line.part([0.0, line.len], 1.1 * side), scratch, |p| {
                let (Some(sheet), long) = (p.sheet, p.len() > SHORT) else { return };
                covered += p.len();
                if long || ends.is_empty() {
                    for (d, z) in p.d.into_iter().zip(sheet.z) {
                        let [x, y] = line.at(d);
                        let [x, y, _] = self.turn.back([x, y, z]);
                        ends.push([x, y]);
                    }
                }
            });
            aside = farthest(ends);
            let goes_on = after.zip(ends.first()).is_none_or(|(a, b)| (a[0] - b[0]).hypot(a[1] - b[1]) <= BESIDE);
            if covered >= line.len - SHORT && aside.1 <= BESIDE && goes_on {
                return (aside, true);
            }
        }
        (aside, false)
    }
}

/// Which point lies farthest beside the line from the first to the last, and by how much.
fn farthest(points: &[[f64; 2]]) -> ([f64; 2], f64) {
    let (Some(&first), Some(&last)) = (points.first(), points.last()) else { return ([0.0; 2], 0.0) };
    let chord = Line::new(first, last);
    let aside = |&[x, y]: &[f64; 2]| (chord.dir[0] * (y - chord.start[1]) - chord.dir[1] * (x - chord.start[0])).abs();
    points.iter().map(|p| (*p, aside(p))).fold((first, 0.0), |worst, p| if p.1 > worst.1 { p } else { worst })
}

/// The box of the part under a block's marks, as x0, y0, x1, y1 in nm.
fn area(file: &ProgramFile, block: &Block, turn: &Turn) -> [f64; 4] {
    let mut area = [f64::INFINITY, f64::INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY];
    let points = file.program.strokes_of(block).iter().flat_map(|s| file.program.points_of(s));
    let (lo, hi) = points.fold(([i32::MAX; 2], [i32::MIN; 2]), |(lo, hi), p| {
        ([lo[0].min(p[0]), lo[1].min(p[1])], [hi[0].max(p[0]), hi[1].max(p[1])])
    });
    for [u, v] in [[lo[0], lo[1]], [hi[0], lo[1]], [lo[0], hi[1]], [hi[0], hi[1]]] {
        for z in [block.stop.z_lo, block.stop.z_hi] {
            let at = [block.stop.centre.x + i64::from(u), block.stop.centre.y + i64::from(v), z];
            let [x, y, _] = turn.back(at.map(|v| v as f64));
            area = [area[0].min(x), area[1].min(y), area[2].max(x), area[3].max(y)];
        }
    }
    area
}
