//! `runsheet.txt` and `runsheet.csv`: what the operator needs at the machine.

use std::fmt::Write;

use crate::report::sheet::num;
use crate::report::table::csv_cell;
use terrace_core::diag;
use terrace_core::format::Format;
use terrace_core::geom::Nm;
use terrace_core::machine::{FieldShape, Machine, Origin};
use terrace_core::math;
use terrace_core::program::{Block, BlockFigures, PassId, Pen, Program, SetupId};
use terrace_core::units::{Angle, Length};
use terrace_plan::budget::Budget;
use terrace_plan::check::Checked;
use terrace_plan::emit::{self, Files, Target};
use terrace_plan::manifest::{
    Facts, FixtureEntry, MeasuredPlacement, Registered, Subset, Summary, lift_mm, portable, registration,
};

/// What run sheets are written from.
pub struct Sheet<'a> {
    /// Path from the job folder to the job file.
    pub job_file: &'a str,
    /// The surface file.
    pub surface: String,
    /// The machine.
    pub machine: &'a Machine,
    /// By how much the part is turned about z.
    pub turn_deg: f64,
    /// Rotations of the surface file about x, y and z before that, if it is rotated.
    pub laid_deg: Option<[f64; 3]>,
    /// How a measured part lies beside its zero and turn.
    pub measured: Option<MeasuredPlacement>,
    /// What holds the part.
    pub fixtures: Vec<FixtureEntry>,
    /// By how much the focus is lowered, mm, and the texture turned, degrees, from pass to pass.
    pub per_pass: [f64; 2],
    /// The formats of the job.
    pub formats: Vec<Format>,
    /// Registration points by set-up; None where the job asks for no set-ups.
    pub registration: Option<Vec<Vec<Registered>>>,
    /// The program, or the subset of it that the folder holds.
    pub checked: &'a Checked,
    /// Largest depth range of a block, as used.
    pub depth_mm: f64,
    /// The figures of every block.
    pub figures: Vec<BlockFigures>,
    /// The figures of the whole job.
    pub summary: &'a Summary,
    /// Name of the pen of the frames, where the folder has them.
    pub frames: Option<String>,
    /// The blocks of the subset, where the folder does not hold the whole job.
    pub subset: Option<&'a Subset>,
}

impl<'a> Sheet<'a> {
    /// Of a whole job.
    pub fn new(facts: &Facts<'a>) -> Self {
        let Facts { job, machine, checked, .. } = *facts;
        let points = |&origin: &_| registration(job, machine, origin);
        Self {
            job_file: facts.job_file,
            surface: job.surface.file.display().to_string(),
            machine,
            laid_deg: job.placement.laid_deg(),
            turn_deg: job.placement.turn.as_deg(),
            measured: facts.measured.map(MeasuredPlacement::new),
            fixtures: facts.fixtures.iter().map(FixtureEntry::new).collect(),
            per_pass: [job.passes.lower.mm(), job.passes.rotate.as_deg()],
            formats: job.formats.clone(),
            registration: job.setups.as_ref().map(|_| checked.origins().iter().map(points).collect()),
            checked,
            depth_mm: facts.depth_mm,
            figures: facts.figures.to_vec(),
            summary: facts.summary,
            frames: job.frames.map(|pen| job.pens[pen.index()].name.clone()),
            subset: None,
        }
    }
    /// The targets whose files are used by the way in which the blocks are loaded.
    fn used(&self) -> impl Iterator<Item = &'static Target> {
        let way = self.summary.loading.way;
        self.formats.iter().map(|&format| Target::of(format)).filter(move |target| target.ways.contains(&way))
    }
    /// The file of block `index`, where blocks have files of their own.
    fn block_file(&self, index: usize) -> Option<String> {
        let id = self.checked.program().id(index);
        emit::block_file(&self.formats).map(|ending| Program::block_file(id, ending))
    }
}

/// The blocks as a table for spreadsheets: comma separated, point as decimal mark.
pub fn csv(sheet: &Sheet<'_>) -> Vec<u8> {
    let program = sheet.checked.program();
    let mut out = String::from(
        "block,column,row,level,stage_x_mm,stage_y_mm,stage_z_mm,lpfl_mm,file,strokes,mark_mm,jump_mm,time_s,pens,pass,setup,lift_z_mm,focus_shift_mm\n",
    );
    for (i, block) in program.blocks.iter().enumerate() {
        let [column, row] = block.stop.section.0;
        let [x, y, z] = block.stage.mm();
        let cells = [
            program.id(i).to_string(),
            column.to_string(),
            row.to_string(),
            block.stop.level.to_string(),
            format!("{x:.6}"),
            format!("{y:.6}"),
            format!("{z:.6}"),
            format!("{:.6}", block.stop.lpfl.mm()),
            sheet.block_file(i).unwrap_or_default(),
            block.strokes.len().to_string(),
            format!("{:.3}", program.mark_mm(block)),
            format!("{:.3}", program.jump_mm(block)),
            format!("{:.3}", sheet.figures[i].time_s),
            csv_cell(&program.pen_names(block).join("; ")),
            block.pass.number().to_string(),
            block.setup.number().to_string(),
            lift_mm(sheet.machine, sheet.checked, i).map_or_else(String::new, |z| format!("{z:.6}")),
            format!("{:.6}", block.focus_shift.mm()),
        ];
        out += &cells.join(",");
        out.push('\n');
    }
    out.into_bytes()
}

/// The sheet for the operator, plain text of fixed width.
pub fn txt(sheet: &Sheet<'_>) -> Vec<u8> {
    let mut out = String::new();
    // Writing to a String cannot fail.
    let _ = head(&mut out, sheet)
        .and_then(|()| pens(&mut out, &sheet.checked.program().pens, sheet.machine, settings_note(sheet)))
        .and_then(|()| steps(&mut out, sheet))
        .and_then(|()| setups(&mut out, sheet))
        .and_then(|()| blocks(&mut out, sheet));
    diag::escaped(&out).into_owned().into_bytes()
}

/// The field, and what of it is used where that is less.
pub(super) fn field(machine: &Machine) -> String {
    let [w, h] = machine.lens.field.map(|f| f.as_mm());
    let [u, v] = machine.usable_field().map(Nm::mm);
    let whole = match machine.lens.shape {
        FieldShape::Rectangle if [u, v] == [w, h] => return format!("{w} x {h} mm"),
        FieldShape::Rectangle => format!("{w} x {h} mm"),
        FieldShape::Circle => format!("circle of {} mm", w.min(h)),
    };
    // Rounded down, so that no one takes more than there is.
    let [u, v] = [u, v].map(|s| (s * 1e3).floor() / 1e3);
    format!("{whole}, of which {u} x {v} mm are used")
}

fn head(out: &mut String, sheet: &Sheet<'_>) -> std::fmt::Result {
    let s = sheet.summary;
    let t = &s.time_s;
    let [x, y, z] = sheet.checked.origin().mm();
    writeln!(out, "RUN SHEET")?;
    writeln!(out)?;
    writeln!(out, "job        {}", portable(sheet.job_file))?;
    writeln!(out, "part       {}", portable(&sheet.surface))?;
    let [w, d, h] = s.part_mm;
    writeln!(out, "size       {w:.3} x {d:.3} x {h:.3} mm as it is laid")?;
    writeln!(out, "machine    {}", sheet.machine.name)?;
    writeln!(out, "field      {}", field(sheet.machine))?;
    match sheet.checked.origins().len() {
        1 => writeln!(out, "part zero  X{x:.4} Y{y:.4} Z{z:.4} mm in the table frame")?,
        n => writeln!(out, "part zero  {n} set-ups, each with its own: see SET-UPS")?,
    }
    writeln!(out, "zero       {}", zero(&sheet.formats))?;
    if let Some([x, y, z]) = sheet.laid_deg {
        writeln!(out, "part laid  rotated {x} deg about x, {y} deg about y, {z} deg about z of its file")?;
    }
    writeln!(out, "part turn  {} deg about z", sheet.turn_deg)?;
    if let Some(measured) = &sheet.measured {
        let MeasuredPlacement { points, worst_residual_um: worst, lean_deg: lean, .. } = measured;
        let [[x, ..], [y, ..], _] = measured.rows;
        let turn = math::atan2(y, x).to_degrees();
        let how = format!("leaning {lean:.4} deg, turned {turn:.4} deg about z in addition to the part turn");
        writeln!(out, "measured   {points} points, worst residual {worst:.1} um, {how}")?;
    }
    if let Some(table) = sheet.machine.table() {
        writeln!(out, "table      Z{:.4} mm in the table frame", table.mm())?;
    }
    if let [origin] = sheet.checked.origins() {
        fixtures(out, sheet, (SetupId(0), *origin), "fixture    ")?;
    }
    if let Some(subset) = sheet.subset {
        let program = sheet.checked.program();
        let [first, last] = [0, program.blocks.len() - 1].map(|i| program.id(i));
        writeln!(out, "left       {} of the {} blocks of the job, {first} to {last}", program.blocks.len(), s.blocks)?;
        writeln!(out, "           {:.1} mm of marks, {}", subset.mark_mm, clock(subset.time_s))?;
    }
    match &sheet.machine.zoom {
        None => writeln!(out, "blocks     {} ({})", s.blocks, s.method)?,
        Some(_) => writeln!(out, "blocks     {} at {} stops of the stage ({})", s.blocks, s.stops, s.method)?,
    }
    if s.passes > 1 {
        let [lower, turn] = sheet.per_pass;
        writeln!(
            out,
            "passes     {} (focus lowered {} and hatch rotated {} per pass)",
            s.passes,
            Length::mm(lower),
            Angle::deg(turn)
        )?;
    }
    writeln!(out, "marks      {:.1} mm", s.mark_mm)?;
    if s.dots.texture > 0 {
        writeln!(out, "dots       {} of {}", s.dots.marked, s.dots.texture)?;
    }
    writeln!(out, "not marked {:.1} mm", s.skipped_mm)?;
    writeln!(
        out,
        "defocus    {:.1} um at most (depth range of a block {:.1} um)",
        s.worst_defocus_um,
        sheet.depth_mm * 1e3
    )?;
    writeln!(out, "off axis   {:.1} mm at most, 95 % to {:.1} mm", s.off_axis_mm.largest, s.off_axis_mm.p95)?;
    budget(out, &s.budget)?;
    writeln!(
        out,
        "time       {} (stage {}, settling {},{} marks {}, jumps {}, delays {}), estimated",
        clock(t.total),
        clock(t.stage),
        clock(t.settle),
        sheet.machine.zoom.as_ref().map_or_else(String::new, |_| format!(" zoom {},", clock(t.zoom))),
        clock(t.mark),
        clock(t.jump),
        clock(t.delay)
    )?;
    let blocks = sheet.subset.map_or(s.blocks, |subset| subset.blocks.len());
    let total_s = sheet.subset.map_or(s.loading.total_s, |subset| subset.total_s);
    let least = if s.loading.is_least() { " at least" } else { "" };
    writeln!(out, "loading    {}", s.loading.sentence(blocks))?;
    writeln!(out, "in all     {}{least}; a person attends all of it", clock(total_s))?;
    for warning in &s.warnings {
        writeln!(out, "WARNING    {}", warning.message)?;
    }
    Ok(())
}

/// Where the stage's positions count from, and which zero of the control that is in its programs.
fn zero(formats: &[Format]) -> String {
    let mut text = String::from("X Y Z of the stage are from the zero of the table frame");
    let zeros = [
        (Format::Linuxcnc, "; in stage.ngc that is the machine's zero"),
        (Format::Gcode, "; in stage_m0.nc it is the zero of G54"),
    ];
    zeros.iter().filter(|(format, _)| formats.contains(format)).for_each(|(_, zero)| text += zero);
    text
}

/// How far marks may lie from where they should: bounds, summed.
pub(super) fn budget(out: &mut String, budget: &Budget) -> std::fmt::Result {
    let [lateral, depth, not_stated] = budget.lines();
    let [pdof, reserve] = [budget.pdof_mm, budget.reserve_mm].map(|mm| mm * 1e3);
    writeln!(out, "PDOF       {pdof:.1} um, of which {reserve:.1} um are kept for errors")?;
    writeln!(out, "errors     lateral {lateral}, depth {depth}")?;
    if !not_stated.is_empty() {
        writeln!(out, "           not stated: {not_stated}")?;
    }
    Ok(())
}

/// The settings of the laser, with a note of where they are to be set.
pub(super) fn pens(out: &mut String, pens: &[Pen], machine: &Machine, note: &str) -> std::fmt::Result {
    writeln!(out, "\nPENS ({note})")?;
    writeln!(out, "  no  speed mm/s  power               frequency kHz  passes  name")?;
    for (i, pen) in pens.iter().enumerate() {
        let watts = pen.power.as_w(machine.laser.max_power);
        writeln!(
            out,
            "  {:>2}  {:>10}  {:<18}  {:>13}  {:>6}  {}",
            i + 1,
            pen.speed.as_mm_s(),
            format!("{} = {} W", pen.power, (watts * 1e6).round() / 1e6),
            pen.frequency.as_khz(),
            pen.passes,
            pen.name
        )?;
    }
    for (i, pen) in pens.iter().enumerate() {
        if let Some(dwell) = pen.dwell {
            writeln!(out, "  dots of pen {}: dwell {} us", i + 1, num(dwell.as_us()))?;
        }
    }
    Ok(())
}

/// Where the settings of the pens are to be set.
fn settings_note(sheet: &Sheet<'_>) -> &'static str {
    if has_drawings(sheet) {
        "DXF and CSV do not carry these values: set them in the marking software"
    } else if sheet.used().any(|t| t.carries_settings) {
        "the files of the job carry these values"
    } else {
        "set them in the marking software"
    }
}

/// Whether there are drawings for marking software, which leave the settings of pens to it.
fn has_drawings(sheet: &Sheet<'_>) -> bool {
    sheet.used().any(|t| t.carries_pens && !t.carries_settings)
}

/// What to do, in order; only what the files of this folder need.
fn steps(out: &mut String, sheet: &Sheet<'_>) -> std::fmt::Result {
    writeln!(out, "\nBEFORE THE FIRST BLOCK")?;
    check_scale(out, sheet)?;
    place_part(out, sheet)?;
    set_up_lightburn(out, sheet)?;
    move_stage(out, sheet)?;
    set_zoom(out, sheet)?;
    writeln!(
        out,
        "  - terrace is not a safety system. Enclosure, interlock, eye protection and emergency stop are your own."
    )?;
    writeln!(out, "\nHOW THE FILES GO TOGETHER")?;
    use_files(out, sheet)
}

/// How to make sure that lengths come out as they are.
fn check_scale(out: &mut String, sheet: &Sheet<'_>) -> std::fmt::Result {
    if !has_drawings(sheet) {
        return writeln!(out, "  - Mark a line of 10 mm on scrap and measure it.");
    }
    writeln!(
        out,
        "  - All lengths are mm, at scale 1. Drawings of this kind carry no unit: choose mm on import, mark"
    )?;
    writeln!(out, "    a line of 10 mm on scrap and measure it.")?;
    writeln!(
        out,
        "  - The zero of every drawing is the optical axis. Import it there: no centring, no fit to the field."
    )
}

/// How to place the part and to find the focus.
fn place_part(out: &mut String, sheet: &Sheet<'_>) -> std::fmt::Result {
    let place = match sheet.measured {
        None => "Place the part so that its zero and turn are as this sheet says.",
        Some(_) => "The part was measured: it must lie as it lay then.",
    };
    writeln!(out, "  - {place} Show the first and the last block")?;
    writeln!(out, "    with the pilot laser and compare them with layout.svg.")?;
    if let Some(pen) = &sheet.frames {
        writeln!(
            out,
            "  - frames holds the rectangle around the marks of each block, drawn with pen {pen}, and programs that go to"
        )?;
        writeln!(
            out,
            "    the registration points and to the outermost blocks. That pen must leave no mark: try it on scrap."
        )?;
    }
    let place = if sheet.machine.zoom.is_some() { "at its Z and SHIFT below" } else { "its Z below is where" };
    writeln!(out, "  - Find the focus on the part at the first block: {place} the spot must be smallest.")
}

/// The working area that LightBurn must have, where its files are used.
fn set_up_lightburn(out: &mut String, sheet: &Sheet<'_>) -> std::fmt::Result {
    if !sheet.used().any(|t| t.format == Format::Lightburn) {
        return Ok(());
    }
    let [w, h] = sheet.machine.lens.field.map(|f| f.as_mm());
    writeln!(
        out,
        "  - LightBurn: the working area of the device must be {w} x {h} mm (Edit, Device Settings), or every block lies"
    )?;
    writeln!(
        out,
        "    off its place: its shapes lie about the point {} {} mm of that area. terrace cannot read the device.",
        w / 2.0,
        h / 2.0
    )
}

/// How to move the stage, by a program and by hand.
fn move_stage(out: &mut String, sheet: &Sheet<'_>) -> std::fmt::Result {
    if sheet.used().any(|t| t.moves_stage) {
        writeln!(
            out,
            "  - Run the stage program once with the laser source off; with stage.ngc the scan card must answer with BUSY."
        )?;
    }
    let lift = sheet.machine.retract_z().mm();
    writeln!(
        out,
        "  - If you move the stage by hand: laser off, then X Y, then Z. Where a line below says LIFT, go to Z{lift:.4}"
    )?;
    writeln!(out, "    before X Y, or the lens may touch the part. Lift after the last block too.")
}

/// How the zoom optic is set, where the machine has one.
fn set_zoom(out: &mut String, sheet: &Sheet<'_>) -> std::fmt::Result {
    let Some(zoom) = &sheet.machine.zoom else { return Ok(()) };
    writeln!(
        out,
        "  - SHIFT is what the zoom optic adds to the focal plane that the stage sets, up is positive, within {} of 0.",
        Length::mm(zoom.range.as_mm() / 2.0)
    )?;
    let who = if sheet.used().any(|t| t.carries_focus_shift) {
        "The files of this way set it."
    } else {
        "Set it before each block."
    };
    writeln!(out, "    At 0 the focal plane is the working distance below the lens. {who}")
}

/// What each format is for, and which are not used.
fn use_files(out: &mut String, sheet: &Sheet<'_>) -> std::fmt::Result {
    for target in sheet.used() {
        for (i, line) in target.sheet.iter().enumerate() {
            writeln!(out, "  {} {line}", if i == 0 { '-' } else { ' ' })?;
        }
    }
    let way = sheet.summary.loading.way;
    let unused = sheet.formats.iter().map(|&f| Target::of(f)).filter(|t| !t.ways.contains(&way));
    let unused: Vec<String> = unused.filter_map(|t| t.stepped).map(Files::shown).collect();
    if !unused.is_empty() {
        writeln!(out, "  - Not used by operator.way = {:?}: {}.", way.name(), unused.join(", "))?;
    }
    Ok(())
}

/// Where the part lies in each set-up, and how to find that.
fn setups(out: &mut String, sheet: &Sheet<'_>) -> std::fmt::Result {
    let origins = sheet.checked.origins();
    if sheet.registration.is_none() {
        return Ok(());
    }
    writeln!(
        out,
        "\nSET-UPS (part zero: in the table frame; stage X Y: commanded position with the point under the beam; mm)"
    )?;
    if origins.len() > 1 {
        writeln!(
            out,
            "  - The stage programs stop before each (M0), lifted and with the output off. Move the part so that its"
        )?;
        writeln!(
            out,
            "    zero is as below. With the pilot laser find each point at its stage X Y; they must all agree."
        )?;
        writeln!(
            out,
            "  - Clamp the part at the same height and turn every time, and check the focus at the first block."
        )?;
    }
    for (i, &origin) in origins.iter().enumerate() {
        let [x, y, z] = origin.mm();
        let blocks = runs(sheet.checked.program(), SetupId(i as u32));
        writeln!(out, "  SET-UP {} OF {}  part zero X{x:.4} Y{y:.4} Z{z:.4}  blocks {blocks}", i + 1, origins.len())?;
        for found in sheet.registration.iter().flatten().nth(i).into_iter().flatten() {
            let ([px, py], [x, y]) = (found.point_mm, found.at.map(Nm::mm));
            writeln!(out, "    point {px:>9.4} {py:>9.4} of the part: stage X{x:.4} Y{y:.4}")?;
        }
        if origins.len() > 1 {
            fixtures(out, sheet, (SetupId(i as u32), origin), "    fixture ")?;
        }
    }
    Ok(())
}

/// Where the fixtures of a set-up stand on the table, one line each.
fn fixtures(out: &mut String, sheet: &Sheet<'_>, (setup, origin): (SetupId, Origin), begin: &str) -> std::fmt::Result {
    for fixture in sheet.fixtures.iter().filter(|fixture| fixture.is_in(setup)) {
        let [lo, hi] = fixture.box_mm.map(|p| [0, 1, 2].map(|k| p[k] + origin.mm()[k]));
        let along = |k: usize| format!("{}{:.2} to {:.2}", ["X", "Y", "Z"][k], lo[k], hi[k]);
        writeln!(out, "{begin}{}: {} {} {} mm in the table frame", fixture.name, along(0), along(1), along(2))?;
    }
    Ok(())
}

/// The blocks of a set-up, as runs.
fn runs(program: &Program, setup: SetupId) -> String {
    let mine: Vec<usize> = (0..program.blocks.len()).filter(|&i| program.blocks[i].setup == setup).collect();
    let run = |run: &[usize]| format!("{} to {}", program.id(run[0]), program.id(run[run.len() - 1]));
    mine.chunk_by(|a, b| a + 1 == *b).map(run).collect::<Vec<_>>().join(", ")
}

fn blocks(out: &mut String, sheet: &Sheet<'_>) -> std::fmt::Result {
    let program = sheet.checked.program();
    writeln!(
        out,
        "\nBLOCKS (X Y Z: commanded stage position, mm; LPFL: focal plane on the part, mm; time without the move)"
    )?;
    let shift = sheet.machine.zoom.as_ref().map_or_else(String::new, |_| format!(" {:>11}", "SHIFT"));
    writeln!(
        out,
        "    {:<7} {:>9} {:>6} {:>11} {:>11} {:>11} {:>11}{shift} {:>8} {:>11} {:>9}  pens  file",
        "block", "section", "level", "X", "Y", "Z", "LPFL", "strokes", "marks mm", "time s"
    )?;
    let mut pass = PassId(0);
    let mut setup = None;
    for (i, block) in program.blocks.iter().enumerate() {
        if block.pass != pass {
            pass = block.pass;
            writeln!(out, "  PASS {}", pass.number())?;
        }
        if sheet.checked.origins().len() > 1 && setup != Some(block.setup) {
            setup = Some(block.setup);
            writeln!(out, "  SET-UP {}", block.setup.number())?;
        }
        if let Some(z) = lift_mm(sheet.machine, sheet.checked, i) {
            writeln!(out, "  LIFT to Z{z:.4}, then go to {}", program.id(i))?;
        }
        block_line(out, sheet, i, block)?;
    }
    Ok(())
}

fn block_line(out: &mut String, sheet: &Sheet<'_>, i: usize, block: &Block) -> std::fmt::Result {
    let program = sheet.checked.program();
    let pens: Vec<String> = program.pens_of(block).into_iter().map(|pen| pen.number().to_string()).collect();
    let [column, row] = block.stop.section.0;
    let [x, y, z] = block.stage.mm();
    let shift = block.focus_shift.mm();
    let shift = sheet.machine.zoom.as_ref().map_or_else(String::new, |_| format!(" {shift:>11.4}"));
    writeln!(
        out,
        "[ ] {:<7} {:>9} {:>6} {x:>11.4} {y:>11.4} {z:>11.4} {:>11.4}{shift} {:>8} {:>11.1} {:>9.1}  {:<4}  {}",
        program.id(i).to_string(),
        format!("{column},{row}"),
        block.stop.level,
        block.stop.lpfl.mm(),
        block.strokes.len(),
        program.mark_mm(block),
        sheet.figures[i].time_s,
        pens.join(" "),
        sheet.block_file(i).unwrap_or_default(),
    )
}

/// Seconds as h:mm:ss.
pub(super) fn clock(s: f64) -> String {
    let whole = s.round() as u64;
    format!("{}:{:02}:{:02}", whole / 3600, whole / 60 % 60, whole % 60)
}

#[cfg(test)]
mod tests;
