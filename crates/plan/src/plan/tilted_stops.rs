//! The stops of a machine that tilts the part or the head: sections and tilts by sample points of the marks, then what
//! each must hold by all of them.

use super::grid::Grid;
use super::stroke_chunks::Sweep;
use crate::partition::{Stops, tilted_sections};
use terrace_core::geom::{Box2, Nm, P2};
use terrace_core::machine::Machine;
use terrace_core::progress::Task;

/// Most cells in which marks are sampled, 1600 a window: some 2 GB where every one holds marks.
const MAX_CELLS: u64 = 20_000_000;

/// The stops; None where the texture's box holds too many windows.
pub(super) fn divide(sweep: Sweep<'_>, machine: &Machine, grid: &Grid, task: Task<'_>) -> Option<Stops> {
    // A tilted head stands a little beside the place, and its field makes up for it.
    let room = if machine.tilts_head() { machine.stand_room() } else { Nm(0) };
    let tilted = tilted_sections::TiltSite {
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
    let [sampling, mut rest] = task.split([1, 3]);
    let marks = sweep.marks(&samples, sampling);
    let steepest = marks.worst_slope2.sqrt().atan();
    let samples = marks.list();
    // Tilts are chosen by samples; whether the tilted beam reaches all marks is decided below, by all of them.
    let mut fields = tilted.plan(&samples);
    let tiles = sweep.surface.tiles();
    let top = |area: Box2| {
        let near = |b: &Box2| b.lo.x <= area.hi.x && area.lo.x <= b.hi.x && b.lo.y <= area.hi.y && area.lo.y <= b.hi.y;
        tiles.iter().filter(|(b, _)| near(b)).map(|t| t.1).max().map_or(f64::NEG_INFINITY, Nm::f64)
    };
    let highest = tiles.iter().map(|t| t.1).max().unwrap_or_default().f64();
    let lowest = samples.iter().map(|p| p[2]).fold(f64::INFINITY, f64::min);
    for k in 0..fields.list.len() {
        let half = fields.half;
        let field = &mut fields.list[k];
        // What could hide the lowest mark is no farther away than this.
        let [x, y, z] = field.turn.up();
        let reach = Nm::ceil((highest - lowest) * x.hypot(y) / z) + Nm(1);
        let grown = |b: Box2, Nm(x): Nm, Nm(y): Nm| Box2 {
            lo: P2::new(b.lo.x - x, b.lo.y - y),
            hi: P2::new(b.hi.x + x, b.hi.y + y),
        };
        // The window reaches beyond the area by no more than this.
        let [w, h] = field.area.size();
        let window = grown(field.area, (half[0] - w / 2).max(Nm(0)) + SPARE, (half[1] - h / 2).max(Nm(0)) + SPARE);
        let around = grown(window, reach, reach);
        field.top = top(around);
        let is_clear = sweep.surface.is_plain(around.lo, around.hi) && steepest + z.acos() <= sweep.max_slope.atan();
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
    // Ends: every round but the last sets at least one tilted field upright, and an upright one is never tilted
    // again. What a field may mark beyond its area is found in the same rounds.
    loop {
        // How many rounds there are is not known: each has half of what is left.
        let [round, left] = rest.split([1, 1]);
        rest = left;
        let held = sweep.held(&fields, grid.keep, round);
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
            return Some(tilted.stops(&fields, &held, &grid.sections));
        }
    }
}

/// By how much a window is smaller on each side than the field, nm. A cut on the border of a window is rounded
/// twice: in the plane of the drawing, by up to half the diagonal of the grid in any direction, so that it can
/// lie 0.71 nm beyond the border once it is turned; and in the field, to the nearest grid point, which is then
/// at most a nanometre beyond the border.
const ROUNDING: Nm = Nm(1);

/// Room for the curvature of the part next to a window, nm.
const SPARE: Nm = Nm(1_000_000);
