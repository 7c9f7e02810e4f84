//! `clearance`: the head keeps `stage.clearance` from the part wherever the stage goes.
//!
//! The head is a cylinder of the machine file: of `lens.diameter` around the optical axis, with its lower end
//! `lens.working_distance` above the focal plane. Nothing of the surface file under what it sweeps along a move may
//! rise above the lowest focal plane of the move + `working_distance` - `clearance`. Facets are cut at that height, and
//! what is left of them must lie outside of the sweep: exact, not bounded. Each pass is checked against the surface
//! before it was lowered. Fixtures are held like the part, each by its own facets, and a table by its height.
//!
//! Moves are those of the stage programs, and those of `program.txt` as run sheets, OVF and `terrace run` give them: a
//! lift where the block asks for one, x, y and the tilt axes together, then z alone. From an unknown position (at the
//! start, after a stop at which the part is moved) a move is checked at its end point.
//!
//! While tilt axes turn, each in its own time, the part may be at any pair of angles between the two ends. Over a range
//! of angles no place comes higher than it does in the middle of the range plus its distance from the pivot times half
//! the range. Where this bound leaves doubt the middle is looked at exactly and the range is halved, [`HALVINGS`]
//! times. What is then still in doubt is nearer to the limit than the bound resolves, and passes.
//!
//! A head that is turned itself moves through the part as it sees it, in any direction. While its axes turn it must
//! stay above the highest place of the part.

use super::Around;
use super::stage::{Moves, StageFile};
use super::sweep::Sweep;
use crate::findings::{Findings, RuleCode};
use crate::fixtures::Fixture;
use crate::geometry::{BoxNm, Geometry, HeadPose, Turn};
use crate::job_facts::JobFacts;
use crate::proof::Rule;
use crate::read::gcode::AxisWords;
use crate::read::program::ProgramFile;
use terrace_core::geom::{NM_PER_MM, Nm, P3};
use terrace_core::machine::{Carries, Commanded, Machine, Origin, Tilt, TiltAngles};
use terrace_core::program::{Block, SetupId};

/// Most columns and rows of tiles.
const TILES: f64 = 128.0;

/// How often a range of angles is halved: one axis alone is then left in 1/1024 of its range, two in 1/32 each, as
/// docs/explanation/verify.md states.
const HALVINGS: u32 = 10;

/// Rounding of vertices, commands and f64 moves a place of the part by at most this, nm.
const ROUNDING: f64 = 3.0;

/// Holds the rule.
pub(crate) fn check(
    stages: &[StageFile],
    file: &ProgramFile,
    facts: &JobFacts,
    around: &Around<'_>,
    findings: &mut Findings,
) {
    let rule = &mut findings.rules[RuleCode::Clearance];
    rule.ran = true;
    let part = std::iter::once((around.part, None));
    for (geometry, fixture) in part.chain(around.fixtures.iter().map(|fixture| (&fixture.geometry, Some(fixture)))) {
        let tiles = Tiles::new(geometry, &facts.machine);
        let mut checker = HeadChecker { geometry, fixture, tiles, machine: &facts.machine, file, rule };
        checker.program();
        stages.iter().for_each(|stage| checker.stage_program(stage));
    }
    if let Some(table) = facts.machine.stage.table {
        let mut lowest = f64::INFINITY;
        around.part.each_facet(&mut |corners| lowest = corners.iter().map(|p| p[2]).fold(lowest, f64::min));
        let depth = facts.depth_range_nm();
        on_table(table.as_mm() * NM_PER_MM, file, &facts.machine, lowest + depth, rule);
    }
}

/// Holds the part above the table, which is level, but for a depth range; and the head, which is nowhere lower than at
/// the stops.
fn on_table(table: f64, file: &ProgramFile, machine: &Machine, lowest: f64, rule: &mut Rule) {
    for (i, origin) in file.origins.iter().enumerate() {
        rule.checked += 1;
        if (origin[2] as f64) + lowest + ROUNDING < table {
            rule.broken("", format!("set-up {}", i + 1), "the part lies in the table".to_owned());
        }
    }
    let gap = (machine.lens.working_distance.as_mm() - machine.stage.clearance.as_mm()) * NM_PER_MM;
    for (id, block) in file.ids.iter().zip(&file.program.blocks) {
        rule.checked += 1;
        let end = machine.stage.z.sign() as f64 * block.stage[2] as f64 + gap;
        if end + ROUNDING < table {
            let near = (table - end) / NM_PER_MM;
            let text =
                format!("at this block the head comes {near:.6} mm nearer to the table than stage.clearance allows");
            rule.broken(id, "program.txt", text);
        }
    }
}

/// Commands of x, y, z in nm and of the tilt axes in millionths of a degree.
#[derive(Clone, Copy, PartialEq)]
struct CommandedPose {
    at: Commanded,
    tilt: TiltAngles,
}

/// A head that its own axes turn, on one move.
struct LeaningHead<'a> {
    axes: &'a Tilt,
    /// Half its width, and how far its lower end less the clearance stands from the focal plane, nm.
    reach: f64,
    gap: f64,
    /// How far rounding and welding may move a height, nm.
    slack: f64,
    /// The lowest height of the focal plane on the move if the head were not turned, part frame, nm.
    stands: f64,
}

/// Follows the head through the moves of a job.
struct HeadChecker<'a> {
    geometry: &'a Geometry,
    /// The fixture that it keeps clear of; None: the part.
    fixture: Option<&'a Fixture>,
    tiles: Tiles,
    machine: &'a Machine,
    file: &'a ProgramFile,
    rule: &'a mut Rule,
}

impl HeadChecker<'_> {
    /// The moves of `program.txt`.
    fn program(&mut self) {
        let Nm(top) = self.machine.retract_z();
        let mut before: Option<(CommandedPose, SetupId)> = None;
        for (i, block) in self.file.program.blocks.iter().enumerate() {
            let to = CommandedPose { at: block.stage, tilt: block.stop.tilt };
            // In another set-up the part lies elsewhere: it is moved with the head lifted, from an unknown position.
            let from = before.filter(|b| b.1 == block.setup).map_or(to, |b| b.0);
            let lifted = block.retract || before.is_none_or(|b| b.1 != block.setup);
            let z = if lifted { top } else { from.at[2] };
            if self.machine.stage.diagonal && !lifted && from.at[2] != top {
                self.check_move(i, from, to, "program.txt");
                before = Some((to, block.setup));
                continue;
            }
            let over = CommandedPose { at: Commanded([to.at[0], to.at[1], z]), ..to };
            let start = CommandedPose { at: Commanded([from.at[0], from.at[1], z]), ..from };
            self.check_move(i, start, over, "program.txt");
            self.check_move(i, over, to, "program.txt");
            before = Some((to, block.setup));
        }
    }

    /// The moves of a stage program as written.
    fn stage_program(&mut self, stage: &StageFile) {
        let mut axes: AxisWords = [None; 6];
        // Whatever else is moved by hand at a stop, the tilt axes stand as they were.
        let mut tilted: Option<TiltAngles> = None;
        let mut block = 0;
        for moved in Moves::new(stage) {
            if moved.is_anew {
                axes = [None; 6];
            }
            let from = axes;
            for (now, to) in axes.iter_mut().zip(moved.to) {
                *now = to.or(*now);
            }
            if let Some(found) = self.file.ids.iter().skip(block).position(|id| id == moved.block) {
                block += found;
            }
            // A move on the way to the first block of a set-up belongs to that block.
            let is_of_setup = |b: &&Block| moved.setup.is_none_or(|setup| b.setup.number() == setup);
            if self.file.program.blocks.get(block).filter(is_of_setup).is_none() {
                let found = self.file.program.blocks[block..].iter().position(|b| is_of_setup(&b));
                block += found.unwrap_or_default();
            }
            if let Some(to) = self.pose(&axes) {
                let anew = CommandedPose { tilt: tilted.unwrap_or(to.tilt), ..to };
                self.check_move(block, self.pose(&from).unwrap_or(anew), to, &stage.place(moved.line));
                tilted = Some(to.tilt);
            }
        }
    }

    /// The pose of known axes; None where that of one is not known.
    fn pose(&self, axes: &AxisWords) -> Option<CommandedPose> {
        let tilt = match &self.machine.tilt {
            Some(tilt) => tilt.axes.each_ref().map(|axis| axes[3 + axis.letter as usize]),
            None => [Some(0); 2],
        };
        Some(CommandedPose { at: Commanded([axes[0]?, axes[1]?, axes[2]?]), tilt: TiltAngles([tilt[0]?, tilt[1]?]) })
    }

    /// Holds one move on the way to block `i`.
    fn check_move(&mut self, i: usize, from: CommandedPose, to: CommandedPose, place: &str) {
        self.rule.checked += 1;
        let Some(block) = self.file.program.blocks.get(i) else { return };
        if self.fixture.is_some_and(|fixture| !fixture.is_in(block.setup)) {
            return;
        }
        let origin = self.file.origin(block);
        let axes = self.machine.axes();
        let part = |at: Commanded| [0, 1, 2].map(|k| (axes[k].1.sign() * at[k] - origin[k]) as f64);
        let (a, b) = (part(from.at), part(to.at));
        let nm = |l: terrace_core::units::Length| l.as_mm() * NM_PER_MM;
        // The head moves over the part with its lower end `gap` above the focal plane, whose height is the z of the
        // pose: what rises above the lower one of both ends and `gap` is too near. Most moves pass above all of the
        // part.
        let gap = nm(self.machine.lens.working_distance) - nm(self.machine.stage.clearance);
        let limit = a[2].min(b[2]) + gap + ROUNDING + 2.0 * self.geometry.weld();
        let level = from.tilt.is_upright() && to.tilt.is_upright();
        if self.tiles.highest <= limit && level {
            return;
        }
        // The head is smaller by what rounding moves.
        let reach = nm(self.machine.lens.diameter) / 2.0 - ROUNDING - self.geometry.weld();
        if let Some(axes) = self.machine.tilt.as_ref().filter(|axes| axes.carries == Carries::Head && !level) {
            let slack = ROUNDING + 2.0 * self.geometry.weld();
            let head = LeaningHead { axes, reach, gap, slack, stands: a[2].min(b[2]) };
            let near = if from.tilt == to.tilt {
                self.through(&head, block, [from, to])
            } else {
                self.swings(&head, [0, 1].map(|k| [from.tilt[k] as f64, to.tilt[k] as f64]), HALVINGS)
            };
            if let Some(near) = near {
                self.too_near(i, place, near);
            }
            return;
        }
        let sweep = Sweep::new([a, b].map(|[x, y, _]| [x, y, limit]), reach);
        let range = [0, 1].map(|k| [from.tilt[k].min(to.tilt[k]) as f64, from.tilt[k].max(to.tilt[k]) as f64]);
        if let Some(near) = self.swing(block, range, &sweep, limit, HALVINGS) {
            self.too_near(i, place, near);
        }
    }

    /// Reports that the head comes `near` nm too near to the part on the way to block `i`.
    fn too_near(&mut self, i: usize, place: &str, near: f64) {
        let near = near / NM_PER_MM;
        let what = self.fixture.map_or_else(|| "the part".to_owned(), |f| format!("fixture {:?}", f.name));
        let text = format!(
            "on the way to this block the head comes {near:.6} mm nearer to {what} than stage.clearance allows"
        );
        self.rule.broken(&self.file.ids[i], place, text);
    }

    /// How much too near a head comes that moves straight, turned as it is; None where it keeps clear.
    fn through(&self, head: &LeaningHead<'_>, block: &Block, [from, to]: [CommandedPose; 2]) -> Option<f64> {
        let origin = self.file.origin(block);
        let turn = Turn::new(head.axes, from.tilt, origin);
        let ends = [from, to].map(|p| turn.apply(P3::new(HeadPose::new(self.machine, p.at, p.tilt, origin).centre)).at);
        let sweep = Sweep::new(ends.map(|[x, y, z]| [x, y, z + head.gap + head.slack]), head.reach);
        let mut worst = 0.0f64;
        for tile in &self.tiles.boxes {
            let (mut around, mut top) = (BoxNm::EMPTY, f64::NEG_INFINITY);
            for p in corners(tile) {
                let [x, y, z] = turn.apply(P3::new(p)).at;
                around.add([x, y]);
                top = top.max(z);
            }
            if sweep.may_meet(&around, top) {
                self.geometry.facets_in(in_plane(tile), &mut |corners| {
                    let seen = corners.map(|p| turn.apply(P3::new(p)).at);
                    worst = sweep.rise(&seen, worst).unwrap_or(worst);
                });
            }
        }
        (worst > 0.0).then_some(worst)
    }

    /// How much too near a head comes to the highest place of the part while its axes turn, each within a range of
    /// commands: the corners of its lower end go round the pivot. Branch and bound, as below.
    fn swings(&self, head: &LeaningHead<'_>, range: [[f64; 2]; 2], halvings: u32) -> Option<f64> {
        let q = head.axes.pivot.map(|v| v.as_mm() * NM_PER_MM);
        let r = head.reach;
        let corners = [[-r, -r], [r, -r], [-r, r], [r, r]].map(|[x, y]| [x - q[0], y - q[1], head.gap - q[2]]);
        let middle = TiltAngles(range.map(|[a, b]| f64::midpoint(a, b).round() as i64));
        let turn = Turn::new(head.axes, middle, Origin::default());
        let lowest = corners.iter().map(|&d| turn.back(P3::new(d)).at[2]).fold(f64::INFINITY, f64::min);
        let lower_end = head.stands + q[2] + lowest + head.slack;
        if lower_end < self.tiles.highest {
            return Some(self.tiles.highest - lower_end);
        }
        let half = range.map(|[a, b]| ((b - a).abs() / 2.0 / 1e6).to_radians());
        let far = corners.iter().map(|d| d.iter().map(|v| v * v).sum::<f64>().sqrt()).fold(0.0, f64::max);
        if halvings == 0 || lower_end - far * (half[0] + half[1]) >= self.tiles.highest {
            return None;
        }
        let k = usize::from(half[1] > half[0]);
        let (mut low, mut high) = (range, range);
        let cut = f64::midpoint(range[k][0], range[k][1]);
        (low[k][1], high[k][0]) = (cut, cut);
        [low, high].into_iter().find_map(|part| self.swings(head, part, halvings - 1))
    }

    /// By how much the part rises above `limit` in the sweep at some pair of angles of a range, if one is found.
    fn swing(&self, block: &Block, range: [[f64; 2]; 2], sweep: &Sweep, limit: f64, halvings: u32) -> Option<f64> {
        let middle = range.map(|[lo, hi]| (lo + hi) / 2.0);
        let half = range.map(|[lo, hi]| ((hi - lo) / 2.0 / 1e6).to_radians());
        let turn = match &self.machine.tilt {
            Some(table) if middle != [0.0; 2] => {
                Some(Turn::new(table, TiltAngles(middle.map(|v| v.round() as i64)), self.file.origin(block)))
            }
            _ => None,
        };
        let spread = half[0] + half[1];
        // Branch and bound: within the range no place goes farther from where the middle angles bring it than its
        // distance from the pivot times the half ranges. Tiles that stay below the limit even so need no look at their
        // facets.
        let doubtful = self.tiles.doubtful(turn.as_ref(), spread, &self.pivot(block), sweep, limit);
        if doubtful.is_empty() {
            return None;
        }
        let mut worst = 0.0;
        for area in &doubtful {
            self.geometry.facets_in(*area, &mut |corners| {
                let corners = turn.as_ref().map_or(corners, |turn| corners.map(|p| turn.apply(P3::new(p)).at));
                worst = sweep.rise(&corners, worst).unwrap_or(worst);
            });
        }
        // A facet that is too high at the middle angles is a fault. If none is, the halves of the larger range decide,
        // until the doubt is smaller than what is left of the halvings.
        if worst > 0.0 {
            return Some(worst);
        }
        if spread == 0.0 || halvings == 0 {
            return None;
        }
        let k = usize::from(half[1] > half[0]);
        let (mut low, mut high) = (range, range);
        (low[k][1], high[k][0]) = (middle[k], middle[k]);
        [low, high].into_iter().find_map(|half| self.swing(block, half, sweep, limit, halvings - 1))
    }

    /// The pivot of the table in the part frame, nm.
    fn pivot(&self, block: &Block) -> [f64; 3] {
        let origin = self.file.origin(block);
        let pivot = self.machine.tilt.as_ref().map_or([0.0; 3], |t| t.pivot.map(|v| v.as_mm() * NM_PER_MM));
        [0, 1, 2].map(|k| pivot[k] - origin[k] as f64)
    }
}

/// The part by tiles: what lies in each, as boxes of the part, nm.
struct Tiles {
    /// x0, y0, z0, x1, y1, z1; tiles without a facet are left out.
    boxes: Vec<[f64; 6]>,
    lo: [f64; 2],
    size: f64,
    columns: usize,
    /// By tile, its box; `u32::MAX` where there is none.
    of_tile: Vec<u32>,
    highest: f64,
}

impl Tiles {
    /// Tiles of an eighth of the head's diameter, or larger where these were too many.
    fn new(geometry: &Geometry, machine: &Machine) -> Self {
        let (mut lo, mut hi) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        let mut highest = f64::NEG_INFINITY;
        geometry.each_facet(&mut |corners| {
            for c in corners {
                for k in 0..2 {
                    (lo[k], hi[k]) = (lo[k].min(c[k]), hi[k].max(c[k]));
                }
                highest = highest.max(c[2]);
            }
        });
        let extent = (hi[0] - lo[0]).max(hi[1] - lo[1]).max(1.0);
        let size = (machine.lens.diameter.as_mm() * NM_PER_MM / 8.0).max(extent / TILES);
        let count = [0, 1].map(|k| ((hi[k] - lo[k]).max(0.0) / size) as usize + 1);
        let none =
            [f64::INFINITY, f64::INFINITY, f64::INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY];
        let mut boxes = vec![none; count[0] * count[1]];
        let index = |k: usize, v: f64| (((v - lo[k]) / size) as usize).min(count[k] - 1);
        geometry.each_facet(&mut |corners| {
            let range = |k: usize| {
                let v = corners.map(|c| c[k]);
                [v[0].min(v[1]).min(v[2]), v[0].max(v[1]).max(v[2])]
            };
            let [x, y, z] = [range(0), range(1), range(2)];
            for row in index(1, y[0])..=index(1, y[1]) {
                for column in index(0, x[0])..=index(0, x[1]) {
                    let b = &mut boxes[row * count[0] + column];
                    (b[2], b[5]) = (b[2].min(z[0]), b[5].max(z[1]));
                }
            }
        });
        // Tiles without a facet are dropped; the others are found by their place.
        let mut of_tile = vec![u32::MAX; boxes.len()];
        let mut kept = Vec::new();
        for (i, b) in boxes.iter().enumerate().filter(|(_, b)| b[5] > f64::NEG_INFINITY) {
            of_tile[i] = kept.len() as u32;
            let [x, y] = [(0, i % count[0]), (1, i / count[0])].map(|(k, n)| lo[k] + n as f64 * size);
            kept.push([x, y, b[2], x + size, y + size, b[5]]);
        }
        Self { boxes: kept, lo, size, columns: count[0], of_tile, highest }
    }

    /// Boxes in the plane of the tiles that may rise above `limit` in the sweep, while every place goes no farther
    /// than its distance from the pivot times `spread` from where `turn` brings it.
    fn doubtful(&self, turn: Option<&Turn>, spread: f64, pivot: &[f64; 3], sweep: &Sweep, limit: f64) -> Vec<BoxNm> {
        match turn {
            Some(turn) => self.swung(|p| turn.apply(P3::new(p)).at, spread, pivot, sweep, limit),
            None if spread > 0.0 => self.swung(|p| p, spread, pivot, sweep, limit),
            None => self.under(sweep).filter(|b| b[5] > limit).map(in_plane).collect(),
        }
    }

    /// The tiles under the bounds of a sweep.
    fn under(&self, sweep: &Sweep) -> impl Iterator<Item = &[f64; 6]> {
        let ([x0, y0], [x1, y1]) = (sweep.bounds.lo, sweep.bounds.hi);
        let range = |k: usize, from: f64, to: f64, count: usize| {
            let tile = |v: f64| ((v - self.lo[k]) / self.size).floor().clamp(-1.0, count as f64) as i64;
            tile(from).max(0)..(tile(to) + 1).min(count as i64)
        };
        let (rows, columns) = (self.of_tile.len() / self.columns, range(0, x0, x1, self.columns));
        let cells = range(1, y0, y1, rows).flat_map(move |row| columns.clone().map(move |column| [row, column]));
        let tiles = cells.map(|[row, column]| self.of_tile[row as usize * self.columns + column as usize]);
        tiles.filter(|&t| t != u32::MAX).map(|t| &self.boxes[t as usize])
    }

    /// The boxes of [`Tiles::doubtful`] on a part that is turned, or turns.
    fn swung(
        &self,
        turn: impl Fn([f64; 3]) -> [f64; 3],
        spread: f64,
        pivot: &[f64; 3],
        sweep: &Sweep,
        limit: f64,
    ) -> Vec<BoxNm> {
        let mut doubtful = Vec::new();
        for tile in &self.boxes {
            // A box turned about the pivot lies within the box of its turned corners, and that widened by the farthest
            // way.
            let (mut around, mut highest, mut far) = (BoxNm::EMPTY, f64::NEG_INFINITY, 0.0f64);
            for p in corners(tile) {
                far = far.max((0..3).map(|k| (p[k] - pivot[k]).powi(2)).sum::<f64>().sqrt());
                let [x, y, z] = turn(p);
                around.add([x, y]);
                highest = highest.max(z);
            }
            let way = far * spread;
            if highest + way > limit && around.grown(way).touches(&sweep.bounds) {
                doubtful.push(in_plane(tile));
            }
        }
        doubtful
    }
}

/// The corners of a box of [`Tiles`].
fn corners(tile: &[f64; 6]) -> impl Iterator<Item = [f64; 3]> {
    (0..8).map(|i| [0, 1, 2].map(|k| tile[if i >> k & 1 == 0 { k } else { k + 3 }]))
}

/// A tile's box in the plane.
fn in_plane(&[x0, y0, _, x1, y1, _]: &[f64; 6]) -> BoxNm {
    BoxNm { lo: [x0, y0], hi: [x1, y1] }
}
