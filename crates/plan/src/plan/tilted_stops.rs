//! The stops of a machine that tilts the part or the head: sections and tilts by sample points of the marks, then what
//! each must hold by all of them.

use super::grid::PassGrid;
use super::stroke_chunks::Sweep;
use crate::partition::Stops;
use crate::partition::tilted_sections::TiltSite;
use crate::projection::{MarksByField, TiltedFields};
use terrace_core::geom::{Box2, Nm, P2};
use terrace_core::machine::Machine;
use terrace_core::math;
use terrace_core::progress::Task;

/// Most cells in which marks are sampled, 1600 a window: some 2 GB where every one holds marks.
const MAX_CELLS: u64 = 20_000_000;

/// The stops; None where the texture's box holds too many windows.
pub(super) fn divide(sweep: Sweep<'_>, machine: &Machine, grid: &PassGrid, task: Task<'_>) -> Option<Stops> {
    // A tilted head stands a little beside the place, and its field makes up for it.
    let room = if machine.tilts_head() { machine.stand_room() } else { Nm(0) };
    let tilted = TiltSite {
        machine,
        origin: grid.origin,
        // Sections of later passes begin elsewhere.
        area: Box2 { lo: grid.sections.origin, hi: sweep.texture.bounds().hi },
        window: grid.window.map(|w| (w / 2 * 2 - (ROUNDING + room) * 2).max(Nm(2))),
        room,
        lattice: grid.lattice,
    };
    let samples = tilted.samples();
    if samples.count.map(u64::from).iter().product::<u64>() > MAX_CELLS {
        return None;
    }
    let [sampling, holding] = task.split([1, 3]);
    let marks = sweep.marks(&samples, sampling);
    let steepest = math::atan(marks.worst_slope2.sqrt());
    let samples = marks.list();
    // Tilts are chosen by samples; whether the tilted beam reaches all marks is decided by all of them.
    let mut fields = tilted.plan(&samples);
    let lowest = samples.iter().map(|p| p[2]).fold(f64::INFINITY, f64::min);
    note_what_may_hide_marks(&mut fields, sweep, lowest, steepest);
    let held = hold_all_marks(&tilted, &mut fields, sweep, grid, holding);
    Some(tilted.stops(&fields, &held, &grid.sections))
}

/// Sets the height up to which the part rises around each tilted field, and notes fields in whose cells the beam may
/// be hidden. `lowest` is the height of the lowest mark, nm, `steepest` the steepest slope under a mark, rad.
fn note_what_may_hide_marks(fields: &mut TiltedFields, sweep: Sweep<'_>, lowest: f64, steepest: f64) {
    let tiles = sweep.surface.tiles();
    let highest = tiles.iter().map(|t| t.1).max().unwrap_or_default().f64();
    let half = fields.half;
    for k in 0..fields.list.len() {
        let field = &mut fields.list[k];
        // What could hide the lowest mark is no farther away than this.
        let [x, y, z] = field.turn.up();
        let reach = Nm::ceil((highest - lowest) * math::hypot(x, y) / z) + Nm(1);
        // The window reaches beyond the area by no more than this.
        let [w, h] = field.area.size();
        let window = grown(field.area, [(half[0] - w / 2).max(Nm(0)) + SPARE, (half[1] - h / 2).max(Nm(0)) + SPARE]);
        let around = grown(window, [reach; 2]);
        field.top = highest_in(&tiles, around);
        let is_clear =
            sweep.surface.is_plain(around.lo, around.hi) && steepest + math::acos(z) <= math::atan(sweep.max_slope);
        if is_clear || field.tilt.is_upright() {
            continue;
        }
        let cell = |axis: usize, p: P2| fields.grid.along(axis, if axis == 0 { p.x } else { p.y }, 0);
        for row in cell(1, window.lo)..=cell(1, window.hi) {
            for column in cell(0, window.lo)..=cell(0, window.hi) {
                let cell = row as usize * fields.grid.columns() + column as usize;
                fields.cells[cell].doubtful.push(k as u32);
            }
        }
    }
}

/// What each field holds of all marks. Fields whose beam does not reach their marks are set upright, and fields that
/// were to hold figures whole beyond their area are kept to it where they cannot.
fn hold_all_marks(
    tilted: &TiltSite<'_>,
    fields: &mut TiltedFields,
    sweep: Sweep<'_>,
    grid: &PassGrid,
    mut task: Task<'_>,
) -> MarksByField {
    // Ends: every round but the last sets at least one tilted field upright, or keeps one to its area; neither is ever
    // undone.
    loop {
        // How many rounds there are is not known: each has half of what is left.
        let [round, left] = task.split([1, 1]);
        task = left;
        let held = sweep.held(fields, grid.keep, round);
        let mut is_sound = true;
        for (field, held) in fields.list.iter_mut().zip(&held.0) {
            if field.is_wide && held.is_occluded {
                field.is_wide = false;
                // What it holds whole beyond its area must be held by others now.
                is_sound &= !held.is_over;
            }
            if (held.is_hidden || held.is_outside_window) && !field.tilt.is_upright() {
                tilted.set_upright(field);
                is_sound = false;
            }
        }
        if is_sound {
            return held;
        }
    }
}

/// A box with this much more on each side along x and along y.
fn grown(b: Box2, [x, y]: [Nm; 2]) -> Box2 {
    Box2 { lo: P2::new(b.lo.x - x.0, b.lo.y - y.0), hi: P2::new(b.hi.x + x.0, b.hi.y + y.0) }
}

/// The highest place of the part in a box, nm.
fn highest_in(tiles: &[(Box2, Nm)], area: Box2) -> f64 {
    let meets = |b: &Box2| b.lo.x <= area.hi.x && area.lo.x <= b.hi.x && b.lo.y <= area.hi.y && area.lo.y <= b.hi.y;
    tiles.iter().filter(|(b, _)| meets(b)).map(|t| t.1).max().map_or(f64::NEG_INFINITY, Nm::f64)
}

/// By how much a window is smaller on each side than the field, nm. A cut on the border of a window is rounded
/// twice: in the plane of the drawing, by up to half the diagonal of the grid in any direction, so that it can
/// lie 0.71 nm beyond the border once it is turned; and in the field, to the nearest grid point, which is then
/// at most a nanometre beyond the border.
const ROUNDING: Nm = Nm(1);

/// Room for the curvature of the part next to a window, nm.
const SPARE: Nm = Nm(1_000_000);
