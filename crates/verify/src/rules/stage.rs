//! The stage programs as read, and the part of `agreement` that concerns them: blocks in the order of the program, each
//! with its drawing and its target, reached by a lift where the program asks for one and where the stage position is
//! unknown; and comments that name their block.

use std::path::Path;

use super::stage_text;
use crate::job_facts::JobFacts;
use crate::proof::Rule;
use crate::read::formats::{self, Stepped};
use crate::read::gcode::{AxisWords, StageProgram, StageStep, Statement};
use crate::read::manifest::Manifest;
use crate::read::number::nm_from_mm;
use crate::read::program::ProgramFile;
use terrace_core::geom::{Nm, mm_from_nm};
use terrace_core::machine::{Axis, Dialect, Machine};
use terrace_core::program::{Block, PassId, SetupId};

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

/// The places that a stage program goes to.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Targets {
    Blocks,
    Frames,
}

/// Reads the stage programs that the job asks for or the manifest lists: those of the blocks or those of the frames.
/// What cannot be read breaks the rule.
pub(super) fn read(
    folder: &Path,
    manifest: &Manifest,
    facts: &JobFacts,
    targets: Targets,
    rule: &mut Rule,
) -> Vec<StageFile> {
    let is_frames = targets == Targets::Frames;
    let mut out = Vec::new();
    let drawings = formats::of_drawings(&facts.formats, &manifest.files, &manifest.blocks).map(|(_, ending)| ending);
    for (_, stepped) in formats::expected(&facts.formats, &manifest.files, &manifest.blocks) {
        let Stepped::Stage { file, handshake, read: parse } = stepped else { continue };
        let name = if is_frames { formats::of_frames(file) } else { file.to_owned() };
        match formats::bytes(folder, &name).map(|bytes| parse(&bytes)) {
            Ok(Ok(StageProgram { statements, names, numbers })) => {
                out.push(StageFile { name, handshake, is_frames, statements, drawings, names, numbers });
            }
            Ok(Err(fault)) => rule.broken("", format!("{name}:{}", fault.line), fault.message),
            Err(unread) => rule.broken("", name, unread),
        }
    }
    out
}

/// One commanded move.
pub(super) struct StageMove<'a> {
    /// Name of the block that it belongs to; empty before the first.
    pub(super) block: &'a str,
    pub(super) line: usize,
    pub(super) to: AxisWords,
    /// Whether the stage position is unknown: at the start, and after a stop at which the part or an axis may be moved.
    pub(super) is_anew: bool,
    /// The set-up that has begun last, from 1; None where the program names none.
    pub(super) setup: Option<u32>,
}

/// Walks over the moves of a stage program.
pub(super) struct Moves<'a> {
    statements: std::slice::Iter<'a, Statement>,
    block: &'a str,
    /// Whether a set-up or a registration point has begun, at whose stop the axes may be moved by hand.
    in_setup: bool,
    is_anew: bool,
    is_frames: bool,
    setup: Option<u32>,
}

impl<'a> Moves<'a> {
    pub(super) fn new(stage: &'a StageFile) -> Self {
        let (statements, is_frames) = (stage.statements.iter(), stage.is_frames);
        Self { statements, block: "", in_setup: false, is_anew: true, is_frames, setup: None }
    }
}

impl<'a> Iterator for Moves<'a> {
    type Item = StageMove<'a>;

    fn next(&mut self) -> Option<StageMove<'a>> {
        for s in self.statements.by_ref() {
            match &s.step {
                StageStep::Block(id, _) => (self.block, self.in_setup) = (id, false),
                StageStep::Setup(number) => (self.in_setup, self.setup) = (true, Some(*number)),
                StageStep::Registration(_) => self.in_setup = true,
                StageStep::Pause if self.in_setup || self.is_frames => self.is_anew = true,
                StageStep::Move(to) => {
                    let is_anew = std::mem::take(&mut self.is_anew);
                    return Some(StageMove { block: self.block, line: s.line, to: *to, is_anew, setup: self.setup });
                }
                _ => {}
            }
        }
        None
    }
}

/// Which of the axes of [`AxisWords`] turn the part or the head of a machine, the outer one first.
fn turning_axes(machine: &Machine) -> impl Iterator<Item = usize> {
    machine.tilt.iter().flat_map(|t| &t.axes).map(|axis| 3 + axis.letter as usize)
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
            StageStep::Modal(codes) => {
                metric = (metric || codes.contains(&210)) && !codes.contains(&200);
                absolute = (absolute || codes.contains(&900)) && !codes.contains(&910);
            }
            StageStep::Move(_) if !(metric && absolute) => {
                return rule.broken("", stage.place(s.line), "a move without G21 and G90 is not in absolute mm");
            }
            _ => {}
        }
    }
}

/// Coordinates are machine positions only where no offset is active: before the first move both dialects select G54 and
/// no tool length, the one for LinuxCNC ends where a parameter says that there is an offset, the other switches G92
/// off.
fn offsets(stage: &StageFile, machine: &Machine, rule: &mut Rule) {
    rule.checked += 1;
    let (mut modes, mut tested): (Vec<u32>, Vec<u32>) = (Vec::new(), Vec::new());
    for s in &stage.statements {
        match &s.step {
            StageStep::Modal(codes) => modes.extend(codes),
            StageStep::IfOffset(_, parameter) => tested.push(*parameter),
            StageStep::Move(_) => break,
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
    // The parameters of LinuxCNC: 5210 is not 0 while G92 is active, from 5221 on stand the offsets of G54 in X, Y, Z,
    // A, B and C, in 5230 its rotation.
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
            StageStep::Move([.., a, b, c])
                if dialect == Dialect::Grbl && [a, b, c].iter().any(|axis| axis.is_some()) =>
            {
                "GRBL has the axes X, Y and Z alone"
            }
            StageStep::Modal(codes) if dialect != Dialect::Mach && codes.contains(&690) => {
                "G69 is a word of Mach alone"
            }
            _ => continue,
        };
        return rule.broken("", stage.place(s.line), fault);
    }
}

/// Only axes that the machine has are moved: a control stops at the word of another, in the middle of the job.
fn axes(stage: &StageFile, machine: &Machine, rule: &mut Rule) {
    let turning: Vec<usize> = turning_axes(machine).collect();
    for moved in Moves::new(stage) {
        rule.checked += 1;
        let other = (3..6).find(|axis| moved.to[*axis].is_some() && !turning.contains(axis));
        if let Some(axis) = other {
            let text = format!("the machine has no axis {}", ['A', 'B', 'C'][axis - 3]);
            return rule.broken(moved.block, stage.place(moved.line), text);
        }
    }
}

/// Where the stage position is unknown, it lifts first, to the end of z.
fn first_lifts(stage: &StageFile, machine: &Machine, rule: &mut Rule) {
    let sign = machine.stage.z.sign();
    for moved in Moves::new(stage).filter(|m| m.is_anew) {
        // Beyond the end is a fault of `travel`.
        if !matches!(moved.to, [None, None, Some(z), None, None, None] if sign * z >= sign * machine.retract_z().0) {
            let text =
                "the stage position is unknown here, but the first move does not lift z alone to its end of travel";
            rule.broken(moved.block, stage.place(moved.line), text);
        }
    }
}

/// Holds that every comment in a block that names a block names this one, and that the stop at which it is marked does.
fn names(stage: &StageFile, rule: &mut Rule) {
    // The block at hand, and the line of its title.
    let mut block: Option<(&str, usize)> = None;
    let mut names = stage.names.iter().peekable();
    for s in &stage.statements {
        while let Some((line, id)) = names.next_if(|(line, _)| *line < s.line) {
            misnamed(stage, block, *line, id, rule);
        }
        match &s.step {
            StageStep::Block(id, _) => block = Some((id, s.line)),
            StageStep::Setup(_) | StageStep::Registration(_) => block = None,
            StageStep::Pause => {
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
        if let StageStep::Block(id, _) = &s.step {
            title = Some(id);
        } else if !s.step.is_before_moves() {
            title = None;
        }
        let is_off = matches!(s.step, StageStep::OutputOff | StageStep::SpindleOff);
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
    // Where the axes stand, and the registration point whose stop is still to come.
    let (mut axes, mut open) = ([None; 6], None);
    for s in &stage.statements {
        match &s.step {
            StageStep::Move(to) => apply(&mut axes, *to),
            StageStep::Registration(number) => open = Some(*number),
            StageStep::Pause => {
                let Some(number) = open.take() else { continue };
                rule.checked += 1;
                let is_upright = turning_axes(machine).all(|axis| axes[axis] == Some(0));
                // At the stop the axes may be moved by hand.
                let here = std::mem::take(&mut axes);
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

/// A block as a stage program has it.
struct StageBlock<'a> {
    id: &'a str,
    /// The line of its title.
    line: usize,
    /// The statements between the title and the moves.
    heading: Vec<&'a StageStep>,
    /// The first group of moves after the title.
    moves: Vec<AxisWords>,
    /// Where the axes stand before these moves, and after them: at the target of the block.
    from: AxisWords,
    to: AxisWords,
}

/// Where a stage program is while it is followed from block to block.
struct BlockWalk<'a> {
    stage: &'a StageFile,
    machine: &'a Machine,
    /// Where the axes stand; None of those of which it is not known.
    axes: AxisWords,
    /// The axes that were sent since the operator may have moved them.
    sent: [bool; 6],
    /// Whether the next stop is one at which part or axes are moved by hand.
    by_hand: bool,
    /// The set-up that begins before the next block, and the one that was marked last; the same of the pass.
    setup_begins: Option<u32>,
    setup: Option<SetupId>,
    pass_begins: Option<u32>,
    pass: PassId,
}

impl<'a> BlockWalk<'a> {
    fn new(stage: &'a StageFile, machine: &'a Machine) -> Self {
        Self {
            stage,
            machine,
            axes: [None; 6],
            sent: [false; 6],
            by_hand: false,
            setup_begins: None,
            setup: None,
            pass_begins: None,
            pass: PassId(0),
        }
    }

    /// Takes a statement that does not belong to the lines of a block.
    fn between_blocks(&mut self, statement: &Statement, rule: &mut Rule) {
        match &statement.step {
            StageStep::Move(to) => apply(&mut self.axes, *to),
            StageStep::Setup(number) => (self.setup_begins, self.by_hand) = (Some(*number), true),
            StageStep::Registration(_) => self.by_hand = true,
            StageStep::Pass(number) => self.pass_begins = Some(*number),
            StageStep::Pause if self.by_hand => {
                if self.axes[2] != Some(self.machine.retract_z().0) {
                    rule.broken(
                        "",
                        self.stage.place(statement.line),
                        "the stage is not lifted where the part or the axes are moved by hand",
                    );
                }
                // Whoever moves the part may move the axes too.
                self.axes = [None; 6];
            }
            StageStep::Pause if self.stage.is_frames => self.axes = [None; 6],
            StageStep::Pause => self.sent = [false; 6],
            _ => {}
        }
    }

    /// Takes the lines of the block whose title was the last statement.
    fn block(
        &mut self,
        id: &'a str,
        line: usize,
        rest: &mut std::iter::Peekable<std::slice::Iter<'a, Statement>>,
    ) -> StageBlock<'a> {
        let heading = std::iter::from_fn(|| rest.next_if(|n| n.step.is_before_moves())).map(|n| &n.step).collect();
        let from = self.axes;
        let mut moves = Vec::new();
        while let Some(Statement { step: StageStep::Move(to), .. }) = rest.peek().copied() {
            moves.push(*to);
            apply(&mut self.axes, *to);
            self.sent.iter_mut().zip(to).for_each(|(sent, word)| *sent |= word.is_some());
            rest.next();
        }
        StageBlock { id, line, heading, moves, from, to: self.axes }
    }

    /// Holds that set-ups and passes begin before the same blocks as in the program.
    fn setup_and_pass(&mut self, id: &str, line: usize, block: &Block, file: &ProgramFile, rule: &mut Rule) {
        let is_next = file.origins.len() > 1 && self.setup != Some(block.setup);
        self.setup = Some(block.setup);
        if self.setup_begins.take() != is_next.then_some(block.setup.number()) {
            rule.broken(id, self.stage.place(line), "it does not begin a set-up here as in program.txt");
        }
        let is_next = std::mem::replace(&mut self.pass, block.pass) != block.pass;
        if self.pass_begins.take() != is_next.then_some(block.pass.number()) {
            rule.broken(id, self.stage.place(line), "it does not begin a pass here as in program.txt");
        }
    }
}

/// The target of a block is where the first group of moves after its title ends.
fn targets(stage: &StageFile, file: &ProgramFile, machine: &Machine, rule: &mut Rule) {
    let mut walk = BlockWalk::new(stage, machine);
    let mut blocks = file.ids.iter().zip(&file.program.blocks);
    let mut rest = stage.statements.iter().peekable();
    while let Some(s) = rest.next() {
        let StageStep::Block(id, drawing) = &s.step else {
            walk.between_blocks(s, rule);
            continue;
        };
        rule.checked += 1;
        walk.by_hand = false;
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
        walk.setup_and_pass(id, s.line, block, file, rule);
        let lines = walk.block(id, s.line, &mut rest);
        // An operator may move any axis at a stop: all are sent before the next.
        if !stage.handshake && !(0..3).chain(turning_axes(machine)).all(|axis| walk.sent[axis]) {
            rule.broken(id, stage.place(s.line), "an axis that may have been moved at the stop before is not sent");
        }
        let focus_shift = lines.heading.iter().filter_map(|step| step.focus_shift()).next_back();
        if focus_shift != machine.zoom.as_ref().map(|_| block.focus_shift) {
            rule.broken(id, stage.place(s.line), "the focus shift that it states is not the block's");
        }
        entry(stage, &lines, block, machine, rule);
        together(stage, &lines, block, machine, rule);
        arrival(stage, &lines, block, machine, rule);
        let first = lines.moves.first().copied();
        if block.retract && !lifts(first, lines.from[2], block.stage[2], &machine.stage.z) {
            rule.broken(id, stage.place(s.line), "the program has a lift before this block, but none is commanded");
        }
    }
    if let Some((id, _)) = blocks.next() {
        rule.broken(id, &stage.name, "this block is missing");
    }
    let sign = machine.stage.z.sign();
    if walk.axes[2].is_none_or(|z| sign * z < sign * machine.retract_z().0) {
        rule.broken("", &stage.name, "the stage is not lifted at the end");
    }
}

/// Where the moves of a block end is its place, and its tilt.
fn arrival(stage: &StageFile, lines: &StageBlock<'_>, block: &Block, machine: &Machine, rule: &mut Rule) {
    let [x, y, z, rotary @ ..] = lines.to;
    for (axis, command) in machine.tilt.iter().flat_map(|t| &t.axes).zip(block.stop.tilt.0) {
        if rotary[axis.letter as usize] != Some(command) {
            let text = format!("axis {} is not commanded to the tilt of the block", axis.letter.char());
            rule.broken(lines.id, stage.place(lines.line), text);
        }
    }
    if [x, y, z] != block.stage.0.map(Some) {
        let found = [x, y, z].map(|v| v.map_or("unknown".to_owned(), |v| mm_from_nm(v).to_string())).join(", ");
        let text = format!("the stage is commanded to ({found}) mm, but the program has {}", stage_text(block.stage));
        rule.broken(lines.id, stage.place(lines.line), text);
    }
}

/// Where the program is begun at a block, wherever the stage stands, what its comments say and its own moves bring the
/// stage to its place: it lifts z alone to the end first, and x, y and the axes that turn have their place before z has
/// its own. Without the comments nothing is missing of a block that says nothing.
fn entry(stage: &StageFile, lines: &StageBlock<'_>, block: &Block, machine: &Machine, rule: &mut Rule) {
    let (sign, Nm(top)) = (machine.stage.z.sign(), machine.retract_z());
    let stated_words = |step: &&StageStep| match step {
        StageStep::EntryLift(z) => Some([None, None, Some(*z), None, None, None]),
        StageStep::EntryGo(to) => Some(*to),
        _ => None,
    };
    let stated: Vec<AxisWords> = lines.heading.iter().filter_map(stated_words).collect();
    let is_lift = |to: &AxisWords| {
        // Beyond the end is a fault of `travel`.
        matches!(to, [None, None, Some(z), None, None, None] if sign * z >= sign * top)
    };
    let mut axes = [None; 6];
    let mut is_safe = stated.iter().chain(&lines.moves).next().is_some_and(is_lift);
    is_safe &= stated.first().is_none_or(|to| to[2] == Some(top) || !is_lift(to));
    let mut wanted = [Some(block.stage[0]), Some(block.stage[1]), Some(block.stage[2]), None, None, None];
    turning_axes(machine).zip(block.stop.tilt.0).for_each(|(axis, command)| wanted[axis] = Some(command));
    for to in stated.iter().chain(&lines.moves) {
        // z goes down where x and y are those of the block already.
        is_safe &= is_lift(to) || to[2].is_none() || axes[..2] == wanted[..2];
        apply(&mut axes, *to);
    }
    if !is_safe || axes != wanted {
        let text = "it does not state all that brings the stage to it where the program is begun at this block";
        rule.broken(lines.id, stage.place(lines.line), text);
    }
}

/// x and y move without z, but on a machine that moves diagonally: there all that has to move does so at once, unless
/// the block has a lift.
fn together(stage: &StageFile, lines: &StageBlock<'_>, block: &Block, machine: &Machine, rule: &mut Rule) {
    let is_both = |to: &AxisWords| to[2].is_some() && [0, 1, 3, 4, 5].iter().any(|&axis| to[axis].is_some());
    let is_lifted = block.retract || lines.from[2].is_none_or(|z| z == machine.retract_z().0);
    let fault = if !machine.stage.diagonal || is_lifted {
        lines.moves.iter().any(is_both).then_some("z moves together with other axes")
    } else {
        (lines.moves.len() > 1).then_some("its axes do not move together")
    };
    if let Some(text) = fault {
        rule.broken(lines.id, stage.place(lines.line), text);
    }
}

/// Moves the axes that are named.
fn apply(axes: &mut AxisWords, to: AxisWords) {
    for k in 0..6 {
        axes[k] = to[k].or(axes[k]);
    }
}

/// Whether the first move of a group is of z alone and not below where it comes from or goes to; where the stage is at
/// the far end of z already, there is nothing to lift.
fn lifts(first: Option<AxisWords>, from: Option<i64>, to: i64, z: &Axis) -> bool {
    let (sign, ends) = (z.sign(), z.travel.map(|t| t.as_nm().map(|Nm(end)| end)));
    if let Some([None, None, Some(z), None, None, None]) = first {
        return sign * z >= sign * to && from.is_none_or(|from| sign * z >= sign * from);
    }
    from.is_some() && from == (if sign > 0 { ends[1] } else { ends[0] })
}
