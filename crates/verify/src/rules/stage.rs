//! The stage programs as read, and the part of `agreement` that concerns them: blocks in the order of the program, each
//! with its drawing and its target, reached by a lift where the program asks for one and where the stage position is
//! unknown; and comments that name their block.

use std::path::Path;

use super::stage_text;
use crate::job_facts::JobFacts;
use crate::proof::Rule;
use crate::read::formats::{self, Stepped};
use crate::read::gcode::{Program, Statement, Step};
use crate::read::manifest::Manifest;
use crate::read::number::nm_from_mm;
use crate::read::program::ProgramFile;
use terrace_core::geom::{Nm, mm_from_nm};
use terrace_core::machine::{Axis, Dialect, Machine};
use terrace_core::program::{Block, PassId};

/// A stage program that could be read.
pub(crate) struct StageFile {
    pub(super) name: String,
    /// Whether it fires by a handshake with the scan card; otherwise an operator does.
    pub(super) handshake: bool,
    /// Whether it shows frames: it then never fires, and goes to registration points too.
    pub(super) is_frames: bool,
    pub(super) statements: Vec<Statement>,
    /// The ending of the drawings that it names; None where there are none.
    drawings: Option<&'static str>,
    /// Blocks that comments name in addition to those that begin a block, each with its line.
    names: Vec<(usize, String)>,
    /// Numbers of lines.
    numbers: Vec<(usize, u64)>,
}

impl StageFile {
    pub(super) fn place(&self, line: usize) -> String {
        format!("{}:{line}", self.name)
    }
}

/// Reads the stage programs that the job asks for or the manifest lists, of the blocks or of their frames.
pub(super) fn read(
    folder: &Path,
    manifest: &Manifest,
    facts: &JobFacts,
    is_frames: bool,
    rule: &mut Rule,
) -> Vec<StageFile> {
    let mut out = Vec::new();
    let drawings = formats::of_drawings(&facts.formats, &manifest.files, &manifest.blocks).map(|(_, ending)| ending);
    for (_, files) in formats::expected(&facts.formats, &manifest.files, &manifest.blocks) {
        let Stepped::Stage { file, handshake, read } = files else { continue };
        let name = if is_frames { formats::of_frames(file) } else { file.to_owned() };
        match formats::bytes(folder, &name).map(|bytes| read(&bytes)) {
            Ok(Ok(Program { statements, names, numbers })) => {
                out.push(StageFile { name, handshake, is_frames, statements, drawings, names, numbers });
            }
            Ok(Err(fault)) => rule.broken("", format!("{name}:{}", fault.line), fault.message),
            Err(unread) => rule.broken("", name, unread),
        }
    }
    out
}

/// One commanded move.
pub(super) struct Moved<'a> {
    /// Name of the block that it belongs to; empty before the first.
    pub(super) block: &'a str,
    pub(super) line: usize,
    /// x, y, z, a, b, c.
    pub(super) to: [Option<i64>; 6],
    /// Whether the stage position is unknown: at the start, and after a stop at which the part or an axis may be moved.
    pub(super) is_anew: bool,
    /// The set-up that has begun last, from 1; None where the program names none.
    pub(super) setup: Option<u32>,
}

/// Walks over the moves of a stage program.
pub(super) struct Positions<'a> {
    statements: std::slice::Iter<'a, Statement>,
    block: &'a str,
    /// Whether a set-up or a registration point has begun, at whose stop the axes may be moved by hand.
    in_setup: bool,
    is_anew: bool,
    is_frames: bool,
    setup: Option<u32>,
}

impl<'a> Positions<'a> {
    pub(super) fn of(stage: &'a StageFile) -> Self {
        let (statements, is_frames) = (stage.statements.iter(), stage.is_frames);
        Self { statements, block: "", in_setup: false, is_anew: true, is_frames, setup: None }
    }
}

impl<'a> Iterator for Positions<'a> {
    type Item = Moved<'a>;
    fn next(&mut self) -> Option<Moved<'a>> {
        for s in self.statements.by_ref() {
            match &s.step {
                Step::Block(id, _) => (self.block, self.in_setup) = (id, false),
                Step::Setup(number) => (self.in_setup, self.setup) = (true, Some(*number)),
                Step::Registration(_) => self.in_setup = true,
                Step::Pause if self.in_setup || self.is_frames => self.is_anew = true,
                Step::Move(to) => {
                    let is_anew = std::mem::take(&mut self.is_anew);
                    return Some(Moved { block: self.block, line: s.line, to: *to, is_anew, setup: self.setup });
                }
                _ => {}
            }
        }
        None
    }
}

/// Compares the stage programs with the program.
pub(super) fn agreement(
    stages: &[StageFile],
    manifest: &Manifest,
    file: &ProgramFile,
    machine: &Machine,
    rule: &mut Rule,
) {
    for stage in stages {
        registration(stage, manifest, file, machine, rule);
        units(stage, rule);
        offsets(stage, machine, rule);
        dialect(stage, machine, rule);
        axes(stage, machine, rule);
        first_lifts(stage, machine, rule);
        names(stage, rule);
        numbers(stage, rule);
        targets(stage, file, machine, rule);
    }
}

/// Coordinates mean absolute mm only after G21 and G90.
fn units(stage: &StageFile, rule: &mut Rule) {
    let (mut metric, mut absolute) = (false, false);
    for s in &stage.statements {
        match &s.step {
            Step::Modal(codes) => {
                metric = (metric || codes.contains(&210)) && !codes.contains(&200);
                absolute = (absolute || codes.contains(&900)) && !codes.contains(&910);
            }
            Step::Move(_) if !(metric && absolute) => {
                return rule.broken("", stage.place(s.line), "a move without G21 and G90 is not in absolute mm");
            }
            _ => {}
        }
    }
}

/// Coordinates are machine positions only where no offset is active: before the first move both dialects select G54 and
/// no tool length, the one for LinuxCNC ends where a parameter says that there is an offset, the other switches G92 off.
fn offsets(stage: &StageFile, machine: &Machine, rule: &mut Rule) {
    rule.checked += 1;
    let (mut modes, mut tested): (Vec<u32>, Vec<u32>) = (Vec::new(), Vec::new());
    for s in &stage.statements {
        match &s.step {
            Step::Modal(codes) => modes.extend(codes),
            Step::IfOffset(_, parameter) => tested.push(*parameter),
            Step::Move(_) => break,
            _ => {}
        }
    }
    // The last, G54 and what follows it, have messages of their own.
    let wanted: &[u32] = if stage.handshake {
        &[210, 900, 940, 170, 400, 490, 800, 611, 540]
    } else {
        &[210, 900, 940, 170, 400, 800, 540, 490, 921]
    };
    let is_mach = !stage.handshake && machine.controller.dialect == Dialect::Mach;
    if !modes.iter().eq(wanted.iter().chain(is_mach.then_some(&690))) {
        let missing = wanted.iter().find(|code| !modes.contains(code));
        let text = missing.map_or_else(
            || "its modes are not those of its dialect, each once".to_owned(),
            |code| format!("it moves the stage without G{}", f64::from(*code) / 10.0),
        );
        rule.broken("", &stage.name, text);
    }
    let mut broken = |what: &str| rule.broken("", &stage.name, format!("the stage moves before {what}"));
    if !modes.contains(&540) || !modes.contains(&490) {
        broken("G54 is selected and the tool length is off (G49)");
    }
    if !stage.handshake {
        if !modes.contains(&921) {
            broken("G92 is off (G92.1)");
        }
        // Mach may turn its coordinates by G68.
        if machine.controller.dialect == Dialect::Mach && !modes.contains(&690) {
            broken("turned coordinates are off (G69)");
        }
        return;
    }
    // G92; X, Y and Z of G54; its rotation; A, B and C where they tilt.
    let letters = machine.tilt.iter().flat_map(|t| &t.axes).map(|axis| 5224 + axis.letter as u32);
    for parameter in [5210, 5221, 5222, 5223, 5230].into_iter().chain(letters) {
        if !tested.contains(&parameter) {
            broken(&format!("#{parameter} is tested: an offset could be active"));
        }
    }
}

/// The words of `stage_m0.nc` are those of the control that reads it: GRBL has no axes but X, Y and Z, and Mach alone
/// has G69.
fn dialect(stage: &StageFile, machine: &Machine, rule: &mut Rule) {
    let dialect = machine.controller.dialect;
    if stage.handshake {
        return;
    }
    rule.checked += 1;
    for s in &stage.statements {
        let fault = match &s.step {
            Step::Move([.., a, b, c]) if dialect == Dialect::Grbl && [a, b, c].iter().any(|axis| axis.is_some()) => {
                "GRBL has the axes X, Y and Z alone"
            }
            Step::Modal(codes) if dialect != Dialect::Mach && codes.contains(&690) => "G69 is a word of Mach alone",
            _ => continue,
        };
        return rule.broken("", stage.place(s.line), fault);
    }
}

/// Only axes that the machine has are moved: a control stops at the word of another, in the middle of the job.
fn axes(stage: &StageFile, machine: &Machine, rule: &mut Rule) {
    let letters: Vec<usize> = machine.tilt.iter().flat_map(|t| &t.axes).map(|axis| 3 + axis.letter as usize).collect();
    for moved in Positions::of(stage) {
        rule.checked += 1;
        let other = (3..6).find(|axis| moved.to[*axis].is_some() && !letters.contains(axis));
        if let Some(axis) = other {
            let text = format!("the machine has no axis {}", ['A', 'B', 'C'][axis - 3]);
            return rule.broken(moved.block, stage.place(moved.line), text);
        }
    }
}

/// Where the stage position is unknown, it lifts first, to the end of z.
fn first_lifts(stage: &StageFile, machine: &Machine, rule: &mut Rule) {
    let sign = machine.stage.z.sign();
    for moved in Positions::of(stage).filter(|m| m.is_anew) {
        // Beyond the end is a fault of `travel`.
        if !matches!(moved.to, [None, None, Some(z), None, None, None] if sign * z >= sign * machine.retract_z().0) {
            let text =
                "the stage position is unknown here, but the first move does not lift z alone to its end of travel";
            rule.broken(moved.block, stage.place(moved.line), text);
        }
    }
}

/// What a comment in a block names is that block, and the stop at which the operator marks it names it.
fn names(stage: &StageFile, rule: &mut Rule) {
    // The block at hand, and the line of its title.
    let mut block: Option<(&str, usize)> = None;
    let mut names = stage.names.iter().peekable();
    for s in &stage.statements {
        while let Some((line, id)) = names.next_if(|(line, _)| *line < s.line) {
            misnamed(stage, block, *line, id, rule);
        }
        match &s.step {
            Step::Block(id, _) => block = Some((id, s.line)),
            Step::Setup(_) | Step::Registration(_) => block = None,
            Step::Pause => {
                let Some((here, title)) = block else { continue };
                let from = stage.names.partition_point(|(line, _)| *line < title);
                if stage.names.get(from).is_none_or(|(line, _)| *line > s.line) {
                    rule.broken(here, stage.place(s.line), "the stop does not name the block that is marked there");
                }
            }
            _ => {}
        }
    }
    names.for_each(|(line, id)| misnamed(stage, block, *line, id, rule));
}

/// Whoever begins the program at the number of a block begins that block: it is that of the line which switches the
/// output off between title and moves.
fn numbers(stage: &StageFile, rule: &mut Rule) {
    let mut numbers = stage.numbers.iter().peekable();
    let mut title: Option<&str> = None;
    for s in &stage.statements {
        if let Step::Block(id, _) = &s.step {
            title = Some(id);
        } else if !s.step.is_before_moves() {
            title = None;
        }
        let is_off = matches!(s.step, Step::OutputOff | Step::SpindleOff);
        while let Some(&(line, number)) = numbers.next_if(|(line, _)| *line <= s.line) {
            let is_its = |id: &str| id.trim_start_matches(['B', '0']) == number.to_string();
            if line != s.line || !is_off || !title.take().is_some_and(is_its) {
                let text = format!("N{number} does not stand where the block of that number begins");
                rule.broken("", stage.place(line), text);
            }
        }
    }
    for &(line, number) in numbers {
        rule.broken("", stage.place(line), format!("N{number} stands after the end"));
    }
}

/// Programs of frames stop at every registration point of each of their set-ups, and no others do.
fn registration(stage: &StageFile, manifest: &Manifest, file: &ProgramFile, machine: &Machine, rule: &mut Rule) {
    let mut setups: Vec<usize> = file.program.blocks.iter().map(|b| b.setup.index()).collect();
    setups.dedup();
    let points = |setup: usize| manifest.setups.get(setup).map_or(&[][..], |s| &s.registration);
    let all = setups.iter().flat_map(|&setup| points(setup).iter().zip(1..));
    let mut wanted = all.filter(|_| stage.is_frames).map(|(r, number)| (number, r.stage.map(nm_from_mm)));
    let (mut at, mut open) = ([None; 6], None);
    for s in &stage.statements {
        match &s.step {
            Step::Move(to) => apply(&mut at, *to),
            Step::Registration(number) => open = Some(*number),
            Step::Pause => {
                let Some(number) = open.take() else { continue };
                rule.checked += 1;
                let letters = machine.tilt.iter().flat_map(|t| &t.axes).map(|axis| axis.letter as usize);
                let is_upright = letters.into_iter().all(|letter| at[3 + letter] == Some(0));
                let here = std::mem::take(&mut at);
                if wanted.next() != Some((number, [here[0], here[1]])) || !is_upright {
                    let text = format!("the stop at registration point {number} is not that of the manifest");
                    rule.broken("", stage.place(s.line), text);
                }
            }
            _ => {}
        }
    }
    if wanted.next().is_some() || open.is_some() {
        rule.broken("", &stage.name, "the stop at a registration point is missing");
    }
}

/// Reports a comment that names a block other than the current one.
fn misnamed(stage: &StageFile, block: Option<(&str, usize)>, line: usize, id: &str, rule: &mut Rule) {
    if let Some((here, _)) = block.filter(|(here, _)| *here != id) {
        rule.broken(here, stage.place(line), format!("a comment in block {here} names block {id}"));
    }
}

/// The target of a block is where the first group of moves after its comment ends.
fn targets(stage: &StageFile, file: &ProgramFile, machine: &Machine, rule: &mut Rule) {
    let mut at: [Option<i64>; 6] = [None; 6];
    // The axes that were sent since the operator may have moved them.
    let mut sent = [false; 6];
    let mut blocks = file.ids.iter().zip(&file.program.blocks);
    // The set-up that begins before the next block, and the one that was marked last; the same of the pass.
    let (mut begins, mut setup, mut by_hand) = (None, None, false);
    let (mut pass_begins, mut pass) = (None, PassId(0));
    let mut rest = stage.statements.iter().peekable();
    while let Some(s) = rest.next() {
        let (id, drawing) = match &s.step {
            Step::Block(id, drawing) => (id, drawing),
            Step::Move(to) => {
                apply(&mut at, *to);
                continue;
            }
            Step::Setup(number) => {
                (begins, by_hand) = (Some(*number), true);
                continue;
            }
            Step::Registration(_) => {
                by_hand = true;
                continue;
            }
            Step::Pass(number) => {
                pass_begins = Some(*number);
                continue;
            }
            Step::Pause if by_hand => {
                if at[2] != Some(machine.retract_z().0) {
                    rule.broken(
                        "",
                        stage.place(s.line),
                        "the stage is not lifted where the part or the axes are moved by hand",
                    );
                }
                // Whoever moves the part may move the axes too.
                at = [None; 6];
                continue;
            }
            Step::Pause if stage.is_frames => {
                at = [None; 6];
                continue;
            }
            Step::Pause => {
                sent = [false; 6];
                continue;
            }
            _ => continue,
        };
        rule.checked += 1;
        by_hand = false;
        let Some((wanted, block)) = blocks.next() else {
            return rule.broken(id, stage.place(s.line), "the program has no further block");
        };
        if id != wanted {
            return rule.broken(
                wanted,
                stage.place(s.line),
                format!("block {id} is here, but the program has {wanted}"),
            );
        }
        let named = if stage.is_frames { formats::of_frame } else { formats::of_block };
        if *drawing != stage.drawings.map(|ending| named(id, ending)) {
            rule.broken(id, stage.place(s.line), "it does not name the drawing of its block");
        }
        let is_next = file.origins.len() > 1 && setup != Some(block.setup);
        setup = Some(block.setup);
        if begins.take() != is_next.then_some(block.setup.number()) {
            rule.broken(id, stage.place(s.line), "it does not begin a set-up here as in program.txt");
        }
        let is_next = std::mem::replace(&mut pass, block.pass) != block.pass;
        if pass_begins.take() != is_next.then_some(block.pass.number()) {
            rule.broken(id, stage.place(s.line), "it does not begin a pass here as in program.txt");
        }
        let heading: Vec<&Step> =
            std::iter::from_fn(|| rest.next_if(|n| n.step.is_before_moves())).map(|n| &n.step).collect();
        let from = at;
        let mut moves = Vec::new();
        while let Some(Statement { step: Step::Move(to), .. }) = rest.peek().copied() {
            moves.push(*to);
            apply(&mut at, *to);
            sent.iter_mut().zip(to).for_each(|(sent, word)| *sent |= word.is_some());
            rest.next();
        }
        let letters = machine.tilt.iter().flat_map(|t| &t.axes).map(|axis| 3 + axis.letter as usize);
        if !stage.handshake && !(0..3).chain(letters).all(|axis| sent[axis]) {
            rule.broken(id, stage.place(s.line), "an axis that may have been moved at the stop before is not sent");
        }
        let (first, line) = (moves.first().copied(), s.line);
        let focus_shift = heading.iter().filter_map(|step| step.focus_shift()).next_back();
        if focus_shift != machine.zoom.as_ref().map(|_| block.focus_shift) {
            rule.broken(id, stage.place(line), "the focus shift that it states is not the block's");
        }
        entry(stage, (id, line), &heading, &moves, block, machine, rule);
        together(stage, (id, line), &moves, from, block, machine, rule);
        arrival(stage, (id, line), at, block, machine, rule);
        if block.retract && !lifts(first, from[2], block.stage[2], &machine.stage.z) {
            rule.broken(id, stage.place(line), "the program has a lift before this block, but none is commanded");
        }
    }
    if let Some((id, _)) = blocks.next() {
        rule.broken(id, &stage.name, "this block is missing");
    }
    let sign = machine.stage.z.sign();
    if at[2].is_none_or(|z| sign * z < sign * machine.retract_z().0) {
        rule.broken("", &stage.name, "the stage is not lifted at the end");
    }
}

/// Where the moves of a block end is its place, and its tilt.
fn arrival(
    stage: &StageFile,
    (id, line): (&str, usize),
    at: [Option<i64>; 6],
    block: &Block,
    machine: &Machine,
    rule: &mut Rule,
) {
    let [x, y, z, rotary @ ..] = at;
    for (axis, command) in machine.tilt.iter().flat_map(|t| &t.axes).zip(block.stop.tilt.0) {
        if rotary[axis.letter as usize] != Some(command) {
            let text = format!("axis {} is not commanded to the tilt of the block", axis.letter.char());
            rule.broken(id, stage.place(line), text);
        }
    }
    if [x, y, z] != block.stage.0.map(Some) {
        let found = [x, y, z].map(|v| v.map_or("unknown".to_owned(), |v| mm_from_nm(v).to_string())).join(", ");
        let text = format!("the stage is commanded to ({found}) mm, but the program has {}", stage_text(block.stage));
        rule.broken(id, stage.place(line), text);
    }
}

/// Where the program is begun at a block, wherever the stage stands, what its comments say and its own moves bring the
/// stage to its place: it lifts z alone to the end first, and x, y and the axes that turn have their place before z has
/// its own. Without the comments nothing is missing of a block that says nothing.
fn entry(
    stage: &StageFile,
    (id, line): (&str, usize),
    heading: &[&Step],
    moves: &[[Option<i64>; 6]],
    block: &Block,
    machine: &Machine,
    rule: &mut Rule,
) {
    let (sign, Nm(top)) = (machine.stage.z.sign(), machine.retract_z());
    let of_comment = |step: &&Step| match step {
        Step::EntryLift(z) => Some([None, None, Some(*z), None, None, None]),
        Step::EntryGo(to) => Some(*to),
        _ => None,
    };
    let stated: Vec<[Option<i64>; 6]> = heading.iter().filter_map(of_comment).collect();
    let is_lift = |to: &[Option<i64>; 6]| {
        // Beyond the end is a fault of `travel`.
        matches!(to, [None, None, Some(z), None, None, None] if sign * z >= sign * top)
    };
    let mut at = [None; 6];
    let mut is_safe = stated.iter().chain(moves).next().is_some_and(is_lift);
    is_safe &= stated.first().is_none_or(|to| to[2] == Some(top) || !is_lift(to));
    let letters: Vec<usize> = machine.tilt.iter().flat_map(|t| &t.axes).map(|axis| 3 + axis.letter as usize).collect();
    let mut wanted = [Some(block.stage[0]), Some(block.stage[1]), Some(block.stage[2]), None, None, None];
    letters.iter().zip(block.stop.tilt.0).for_each(|(&axis, command)| wanted[axis] = Some(command));
    for to in stated.iter().chain(moves) {
        // z goes down where x and y are those of the block already.
        is_safe &= is_lift(to) || to[2].is_none() || at[..2] == wanted[..2];
        apply(&mut at, *to);
    }
    if !is_safe || at != wanted {
        let text = "it does not state all that brings the stage to it where the program is begun at this block";
        rule.broken(id, stage.place(line), text);
    }
}

/// x and y move without z, but on a machine that moves diagonally: there all that has to move does so at once, unless the
/// block has a lift.
fn together(
    stage: &StageFile,
    (id, line): (&str, usize),
    moves: &[[Option<i64>; 6]],
    from: [Option<i64>; 6],
    block: &Block,
    machine: &Machine,
    rule: &mut Rule,
) {
    let is_both = |to: &[Option<i64>; 6]| to[2].is_some() && [0, 1, 3, 4, 5].iter().any(|&axis| to[axis].is_some());
    let lifts = block.retract || from[2].is_none_or(|z| z == machine.retract_z().0);
    let fault = if !machine.stage.diagonal || lifts {
        moves.iter().any(is_both).then_some("z moves together with other axes")
    } else {
        (moves.len() > 1).then_some("its axes do not move together")
    };
    if let Some(text) = fault {
        rule.broken(id, stage.place(line), text);
    }
}

fn apply(at: &mut [Option<i64>; 6], to: [Option<i64>; 6]) {
    for k in 0..6 {
        at[k] = to[k].or(at[k]);
    }
}

/// Whether the first move of a group is of z alone and not below where it comes from or goes to; where the stage is at
/// the far end of z already, there is nothing to lift.
fn lifts(first: Option<[Option<i64>; 6]>, from: Option<i64>, to: i64, z: &Axis) -> bool {
    let (sign, ends) = (z.sign(), z.travel.map(|t| t.as_nm().map(|Nm(end)| end)));
    if let Some([None, None, Some(z), None, None, None]) = first {
        return sign * z >= sign * to && from.is_none_or(|from| sign * z >= sign * from);
    }
    from.is_some() && from == (if sign > 0 { ends[1] } else { ends[0] })
}
