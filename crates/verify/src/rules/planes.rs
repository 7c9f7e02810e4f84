//! `agreement` of the OVF: one work plane per block, each mark to one step of f32; settings as the pens and the machine
//! file state them, and who carries what on each axis, which decides the signs of all positions.

use crate::proof::Rule;
use crate::read::ovf::{Bounds, MarkingParams, OvfFile, OvfMark, Patch, WorkPlane};
use crate::read::program::ProgramFile;
use terrace_core::geom::{ControllerPoint, Nm, mm_from_nm};
use terrace_core::machine::{Axis, Carries, Machine};
use terrace_core::program::{Block, Pen};

/// Compares the OVF with the program.
pub(super) fn check(ovf: &OvfFile<'_>, name: &str, file: &ProgramFile, machine: &Machine, rule: &mut Rule) {
    let program = &file.program;
    if ovf.len() != program.blocks.len() {
        rule.broken(
            "",
            name,
            format!("holds {} work planes, program.txt has {} blocks", ovf.len(), program.blocks.len()),
        );
    }
    // The settings of a pen without a shift of the focus have its number, from 1, as key.
    for (i, pen) in program.pens.iter().enumerate() {
        let found = i32::try_from(i + 1).ok().and_then(|key| ovf.params.get(&key));
        let same = found.is_some_and(|p| same_settings(p, pen, Nm(0), machine));
        if !same {
            let text = format!("the settings of pen {:?} differ from program.txt or the machine", pen.name);
            rule.broken("", name, text);
        }
    }
    let mut bounds = None;
    for (i, (id, block)) in file.ids.iter().zip(&file.program.blocks).enumerate().take(ovf.len()) {
        match plane(ovf, i, file, block, machine, rule) {
            Ok(own) => bounds = Bounds::union(bounds, own),
            Err(fault) => rule.broken(id, name, fault),
        }
    }
    if rule.violated == 0 && ovf.about.bounds != bounds {
        rule.broken("", name, "the bounds of the job are not those of its points");
    }
    // No setting that nothing is marked with: a reader may show or use any of them.
    let sets = ovf.params.len();
    let of_pens = file.program.pens.len();
    let shifted = file.program.blocks.iter().filter(|b| b.focus_shift.0 != 0);
    let mut used: Vec<(usize, i64)> = shifted
        .flat_map(|b| file.program.strokes_of(b).iter().map(|stroke| (stroke.pen.index(), b.focus_shift.0)))
        .collect();
    used.sort_unstable();
    used.dedup();
    if sets != of_pens + used.len() {
        rule.broken("", name, format!("holds {sets} settings, the program uses {}", of_pens + used.len()));
    }
    let words = ["mm; positions are axis commands, points lie around the optical axis", "terrace "];
    let is_ours = ovf.about.description == words[0] && ovf.about.author.starts_with(words[1]);
    let is_name = |name: &str| !name.is_empty() && !name.chars().any(char::is_control);
    if !is_ours || !is_name(&ovf.about.job) || !is_name(&ovf.part) || !is_name(&ovf.about.author) {
        rule.broken("", name, "what it says of itself is not what a job says");
    }
}

/// Whether settings are those of a pen with the focus shifted.
fn same_settings(p: &MarkingParams, pen: &Pen, shift: Nm, machine: &Machine) -> bool {
    let delays = &machine.delays;
    let waits = [
        (p.jump_delay_us, delays.jump),
        (p.laser_off_delay_us, delays.laser_off),
        (p.laser_on_delay_us, delays.laser_on),
        (p.mark_delay_us, delays.mark),
        (p.polygon_delay_us, delays.polygon),
    ];
    step(p.power_w, pen.power.as_w(machine.laser.max_power))
        && step(p.speed_mm_s, pen.speed.as_mm_s())
        && step(p.exposure_us, pen.dwell.map_or(0.0, |dwell| dwell.as_us()))
        && p.rate_hz == (pen.frequency.as_khz() * 1e3).round() as u64
        && step(p.focus_shift_mm, shift.mm())
        && p.name == pen.name
        && step(p.jump_speed_mm_s, machine.scanner.jump_speed.as_mm_s())
        && waits.iter().all(|(found, wanted)| step(*found, wanted.as_us()))
}

/// Compares the marks of work plane `i` with a block; returns the bounds that it states, or the first difference.
fn plane(
    ovf: &OvfFile<'_>,
    i: usize,
    file: &ProgramFile,
    block: &Block,
    machine: &Machine,
    rule: &mut Rule,
) -> Result<Option<Bounds>, String> {
    let program = &file.program;
    let strokes = program.strokes_of(block);
    let (mut count, mut first) = (0, None);
    let mut repeats = Vec::new();
    let plane = ovf.plane(i, |mark| {
        if let Some(stroke) = strokes.get(count) {
            let points = program.points_of(stroke).iter().map(|&p| machine.scanner.controller_from_field(p));
            let is_pen = |p| same_settings(p, &program.pens[stroke.pen.index()], block.focus_shift, machine);
            if !ovf.params.get(&mark.params).is_some_and(is_pen) {
                first.get_or_insert((count, "has other pen settings"));
            } else if !same_points(&mark, points) {
                first.get_or_insert((count, "has other points"));
            }
            if repeats.last() != Some(&(stroke.pen, mark.repeats)) {
                repeats.push((stroke.pen, mark.repeats));
            }
        }
        count += 1;
    })?;
    rule.checked += count as u64;
    if let Some((stroke, what)) = first {
        return Err(format!("stroke {} {what} than in program.txt", stroke + 1));
    }
    if count != strokes.len() {
        return Err(format!("holds {count} strokes, program.txt has {}", strokes.len()));
    }
    // A plane is repeated as a whole and each of its blocks again: the product is how often a stroke is marked.
    let passes = |repeats: u64| (u64::from(plane.repeats) + 1).checked_mul(repeats.checked_add(1)?);
    for (pen, repeats) in repeats {
        if passes(repeats) != Some(u64::from(program.pens[pen.index()].passes)) {
            return Err(format!("the passes of pen {} differ from program.txt", pen.number()));
        }
    }
    shell(&plane, i, block, machine)?;
    let bounds = plane.about.as_ref().and_then(|about| about.bounds);
    if machine.tilt.as_ref().is_some_and(|axes| axes.carries == Carries::Head) {
        return super::poses::single(&plane.more_axes, block, file.origin(block), machine).map_or(Ok(bounds), Err);
    }
    if plane.more_axes.is_empty() {
        Ok(bounds)
    } else {
        Err("the work plane has a pose, the head does not tilt".into())
    }
}

/// Compares what a work plane states of itself with its block.
fn shell(plane: &WorkPlane, i: usize, block: &Block, machine: &Machine) -> Result<(), String> {
    let stage = [plane.x_mm, plane.y_mm, plane.z_mm];
    if !stage.iter().zip(block.stage.0).all(|(&mm, nm)| step(mm, mm_from_nm(nm))) {
        return Err(format!(
            "the work plane is at {stage:?} mm, but program.txt has {}",
            super::stage_text(block.stage)
        ));
    }
    let patches = plane.about.as_ref().map(|about| &about.patches);
    let is_centre = |patch: &Patch| {
        step(patch.u_mm, mm_from_nm(block.stop.centre.x)) && step(patch.v_mm, mm_from_nm(block.stop.centre.y))
    };
    if !patches.is_some_and(|all| all.len() == 1 && all.get(&0).is_some_and(is_centre)) {
        return Err("the centre of the work plane on the part differs from program.txt".into());
    }
    let mut tilt = [0.0; 3];
    for (axis, command) in machine.tilt.iter().flat_map(|t| &t.axes).zip(block.stop.tilt.0) {
        tilt[axis.letter as usize] = command as f64 / 1e6;
    }
    let turned = [plane.x_deg, plane.y_deg, plane.z_deg];
    if !turned.iter().zip(tilt).all(|(&found, wanted)| step(found, wanted) || found == wanted as f32) {
        return Err(format!("the work plane is turned by {turned:?} deg, but program.txt has {tilt:?}"));
    }
    let wanted = machine_type(machine);
    if plane.machine_type != wanted {
        return Err(format!("the work plane is for machine {:?}, but the job has {wanted:?}", plane.machine_type));
    }
    if usize::try_from(plane.number) != Ok(i) {
        return Err(format!("work plane {i} is numbered {}", plane.number));
    }
    Ok(())
}

/// The machine type of a work plane: what each axis carries, and whether it runs against the frame.
fn machine_type(machine: &Machine) -> String {
    let axis = |(name, axis): (&str, &Axis)| {
        let carries = if axis.carries == Carries::Head { "head" } else { "part" };
        format!("/{name}-{carries}{}", if axis.reversed { "-reversed" } else { "" })
    };
    let head = if machine.zoom.is_some() { "galvo3d" } else { "galvo2d" };
    let tilt = machine.tilt.iter().filter(|t| t.carries == Carries::Head).flat_map(|t| &t.axes);
    let tilt: String = tilt
        .map(|a| {
            let letter = a.letter.char().to_ascii_lowercase();
            format!("/{letter}-head{}", if a.reversed { "-reversed" } else { "" })
        })
        .collect();
    format!("terrace/xyz-{head}{}{tilt}", machine.axes().map(axis).concat())
}

/// Whether a mark has these points, to one step of f32.
fn same_points(mark: &OvfMark<'_>, points: impl ExactSizeIterator<Item = ControllerPoint>) -> bool {
    let nm = |v: i32| mm_from_nm(i64::from(v));
    mark.xy.len() == 2 * points.len()
        && mark
            .xy
            .chunks_exact(2)
            .zip(points)
            .all(|(found, ControllerPoint { x, y })| step(found[0], nm(x)) && step(found[1], nm(y)))
}

/// Whether `found` is `mm` to one step of f32.
fn step(found: f32, mm: f64) -> bool {
    let wanted = mm as f32;
    found >= wanted.next_down() && found <= wanted.next_up()
}
