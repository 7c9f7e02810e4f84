//! Marks a stepped job: the stage goes to each block and stands still, then the laser marks it.
//!
//! Consumes a job folder that verifies and a run file, which names the machine's two drivers; writes a journal. A
//! driver is one file under [`stage`] or [`laser`] behind one trait. Nothing is fired unless the user asks for it.
//!
//! The journal is on the disk before a block is begun and after it has ended, so whatever ends the run, at most one
//! block is in doubt, and it is named. Going on begins with a lift, as every run does, and never marks a block again
//! that has ended.
//!
//! Positions are commanded axis values: nm, and millionths of a degree for tilt axes.

mod drivers;
mod elsewhere;
mod folder;
pub mod journal;
pub mod laser;
mod locks;
mod log;
mod moves;
pub mod settings;
pub mod stage;

use std::fs::{File, TryLockError};
use std::io::{Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::rc::Rc;
use std::sync::Arc;
use std::sync::atomic::{AtomicU8, Ordering};
use std::time::{Duration, Instant};

use serde::Serialize;

use folder::{Block, Folder};
use journal::{Journal, JournalChoice};
use laser::{Beam, Laser, Work};
use log::Log;
use moves::Moves;
use settings::RunFile;
use stage::{Move, Stage};
use terrace_core::diag::{Diag, Error, Message, Place};
use terrace_core::program::BlockId;
use terrace_input::job::Mode;
use terrace_plan::manifest::Head;

/// The blocks of a job folder that runs have marked on the part that was last at work, from it or from another folder of
/// the job, each with the journal that says so.
///
/// # Errors
/// `manifest` where the folder has none that can be read.
pub fn marked(folder: &Path) -> Result<Vec<(PathBuf, Vec<String>)>, Error> {
    if Head::read(folder)?.mode != Mode::Stepped {
        return Ok(Vec::new());
    }
    let marks = elsewhere::marked(&Folder::read(folder)?);
    Ok(marks.into_iter().map(|marks| (marks.journal, marks.blocks)).collect())
}

/// The folder in which journals of runs are noted, where it can be written.
///
/// # Errors
/// Why it cannot.
pub fn notes_writable() -> Result<PathBuf, String> {
    elsewhere::writable()
}

/// Shortest wait after a move, whatever the machine file says, as in the stage programs.
const LEAST_SETTLE: Duration = Duration::from_millis(50);

/// The longest time until an abort is seen.
const SLICE: Duration = Duration::from_millis(20);

/// What the user has asked of a run that is going on, by Ctrl-C; clones are one.
#[derive(Clone, Debug, Default)]
pub struct Interrupt(Arc<AtomicU8>);

impl Interrupt {
    /// One more request: the first ends the run after the block at work, the second at once.
    pub fn request(&self) {
        let _ = self.0.fetch_update(Ordering::SeqCst, Ordering::SeqCst, |n| (n < 2).then_some(n + 1));
    }
    /// Whether the run is to end after the block at work.
    pub fn is_requested(&self) -> bool {
        self.0.load(Ordering::SeqCst) >= 1
    }
    /// Whether the run is to end at once; drivers look at it while they wait.
    pub fn is_abort(&self) -> bool {
        self.0.load(Ordering::SeqCst) >= 2
    }
    /// Waits so long, or until the run is aborted.
    ///
    /// # Errors
    /// `run-aborted` then.
    pub fn wait(&self, time: Duration) -> Result<(), Diag> {
        let end = Instant::now() + time;
        loop {
            self.check()?;
            let left = end.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return Ok(());
            }
            std::thread::sleep(left.min(SLICE));
        }
    }
    /// Does what nothing can end in a thread of its own, and waits for it, or until the run is aborted: then it is left
    /// to itself.
    ///
    /// # Errors
    /// `run-aborted` then.
    pub(crate) fn wait_for<T: Send + 'static>(&self, work: impl FnOnce() -> T + Send + 'static) -> Result<T, Diag> {
        let thread = std::thread::spawn(work);
        while !thread.is_finished() {
            self.check()?;
            std::thread::sleep(SLICE / 4);
        }
        Ok(thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)))
    }
    /// Goes on unless the run is aborted.
    ///
    /// # Errors
    /// `run-aborted` then.
    pub fn check(&self) -> Result<(), Diag> {
        if self.is_abort() {
            return Err(Diag::limit("run-aborted", "the run was aborted by a second Ctrl-C"));
        }
        Ok(())
    }
}

/// The person at the machine, and what shows them how the run goes.
pub trait Console {
    /// What the run is doing before the first block.
    fn phase(&self, text: &'static str);
    /// A block is begun.
    fn block(&self, progress: &Progress<'_>);
    /// Asks the person to do something, and returns when they say that it is done. What is done `meanwhile` is done at
    /// least once, and again until they answer.
    ///
    /// # Errors
    /// Where they refuse, nobody answers, or the run is aborted; those of `meanwhile`.
    fn ask_while(
        &self,
        what: &str,
        interrupt: &Interrupt,
        meanwhile: &mut dyn FnMut() -> Result<(), Diag>,
    ) -> Result<(), Diag>;
    /// Asks the person to do something, and returns when they say that it is done.
    ///
    /// # Errors
    /// Where they refuse, nobody answers, or the run is aborted.
    fn ask(&self, what: &str, interrupt: &Interrupt) -> Result<(), Diag> {
        self.ask_while(what, interrupt, &mut || Ok(()))
    }
}

/// How far a run is.
#[derive(Clone, Copy, Debug)]
pub struct Progress<'a> {
    /// Blocks that need nothing more, those of earlier runs included.
    pub done: usize,
    /// Blocks of the job.
    pub blocks: usize,
    /// The block that is begun.
    pub block: &'a str,
    /// The drawing or list, as a path inside the folder; None where the job has none.
    pub file: Option<&'a str>,
    /// Estimated time for it and all that follow.
    pub left: Duration,
}

/// What is to be run, and how.
#[derive(Clone, Copy, Debug)]
pub struct Order<'a> {
    /// The job folder.
    pub folder: &'a Path,
    /// The run file.
    pub run_file: &'a Path,
    /// Where the job file and its inputs are, where they have moved.
    pub inputs: Option<&'a Path>,
    /// The journal; None for its usual place beside the folder.
    pub journal: Option<&'a Path>,
    /// A file that JSON lines on the run are appended to.
    pub log: Option<&'a Path>,
    /// What the blocks are marked with; only a run that fires has a journal.
    pub beam: Beam,
    /// Frames to be shown in place of the blocks: of blocks in these ranges, or of the outline where there are none.
    pub frames: Option<&'a [[BlockId; 2]]>,
    /// What the user says of blocks that a journal holds.
    pub journal_choice: JournalChoice<'a>,
}

impl Order<'_> {
    /// The command line for the same job, machine and files, with these words at its end; a shell takes it as it
    /// stands.
    pub fn command(&self, words: &str) -> String {
        let files = [("--inputs", self.inputs), ("--journal", self.journal), ("--log", self.log)];
        let files = files.iter().filter_map(|(name, path)| Some(format!(" {name} {}", shell_word((*path)?))));
        let [folder, run_file] = [self.folder, self.run_file].map(shell_word);
        format!("terrace run {folder} --with {run_file}{} {words}", files.collect::<String>())
    }
}

/// A path as one word of a shell.
fn shell_word(path: &Path) -> String {
    let text = path.display().to_string();
    let is_plain = |c: char| c.is_alphanumeric() || "/._-+:,@%".contains(c) || cfg!(windows) && c == '\\';
    if !text.is_empty() && text.chars().all(is_plain) {
        text
    } else if cfg!(windows) {
        // No name of a file holds a double quote there.
        format!("\"{text}\"")
    } else {
        format!("'{}'", text.replace('\'', "'\\''"))
    }
}

/// What has become of a run.
#[derive(Clone, Debug, Serialize)]
pub struct Outcome {
    /// Whether the laser was to fire.
    pub armed: bool,
    /// Whether frames were shown, and no blocks marked.
    pub frames: bool,
    /// Blocks of the job, or frames.
    pub blocks: usize,
    /// Blocks that this run marked, or showed where it was not armed.
    pub marked: usize,
    /// Blocks that need nothing more, those of earlier runs included; 0 where the run was not armed.
    pub finished: usize,
    /// Which part of a series this is, from 1; 0 where the run was not armed.
    pub part: u32,
    /// The block that was begun and has not ended: whether it is marked is not certain.
    pub in_work: Option<String>,
    /// What stopped the run; empty where it came to its end.
    pub errors: Vec<Message>,
    /// What stopped the run, for the terminal.
    #[serde(skip)]
    pub stop: Option<Error>,
}

/// Runs a job.
///
/// # Errors
/// What keeps it from being begun. A run that was begun and then stopped is an outcome that says so.
pub fn run(order: &Order<'_>, console: &Rc<dyn Console>, interrupt: &Interrupt) -> Result<Outcome, Error> {
    let keys = RunFile::read(order.run_file)?;
    let _run_file = lock_run_file(order.run_file)?;
    let thread_keys = keys.clone();
    let locks = locks::take(&interrupt.wait_for(move || drivers::identities(&thread_keys))?)?;
    let mut folder = Folder::read(order.folder)?;
    check_machine(order, &folder, &keys)?;
    let mut stage = drivers::stage(&keys.stage, console)?;
    let mut laser = drivers::laser(&keys, &folder, console)?;
    folder.choose_files(laser.format())?;
    if let Some(ranges) = order.frames {
        folder.choose_frames(ranges)?;
        may_fire_frames(order, &*laser)?;
    }
    console.phase("verifying the job folder");
    check(order, &folder, interrupt)?;
    let mut log = Log::open(order.log)?;
    let (mut journal, left) = open_journal(order, &folder)?;
    // The first lock is that of the machine: a command of the laser that outlives this program keeps it.
    laser.hold(locks[0].try_clone().map_err(|e| Diag::input("run-locked", format!("cannot hold the lock: {e}")))?);
    console.phase("connecting to stage and laser");
    let says = laser.open(interrupt)?;
    log.write("laser", &says)?;
    // From here on both are switched off at the end, whatever happens.
    let mut run = Run {
        folder: &folder,
        console: &**console,
        interrupt,
        log: &mut log,
        journal: journal.as_mut(),
        stage: &mut *stage,
        laser: &mut *laser,
        beam: order.beam,
        is_frames: order.frames.is_some(),
        moves: Moves::new(&folder),
        marked: 0,
        in_work: None,
        last: None,
    };
    let result = run.open_stage().and_then(|()| run.blocks(&left));
    let faults = run.end(result);
    let marked = run.marked;
    let in_work = run.in_work.take();
    let finished = journal.as_ref().map_or(0, |_| folder.blocks.len() - left.len() + marked);
    let mut outcome = Outcome {
        armed: order.beam == Beam::Fire,
        frames: order.frames.is_some(),
        blocks: folder.blocks.len(),
        marked,
        finished,
        part: journal.as_ref().map_or(0, Journal::part),
        in_work,
        errors: Vec::new(),
        stop: None,
    };
    if !faults.is_empty() {
        outcome.add_faults(faults, order);
    }
    log.write("outcome", &outcome)?;
    Ok(outcome)
}

impl Outcome {
    /// Says what stopped the run, and of an armed one which blocks are certain.
    fn add_faults(&mut self, mut faults: Vec<Diag>, order: &Order<'_>) {
        if self.armed && !self.frames {
            faults.push(certain(self, order));
        }
        self.errors = faults.iter().map(Message::from).collect();
        self.stop = Some(Error::many(faults));
    }
}

/// Refuses a job for another machine than that of the run file.
fn check_machine(order: &Order<'_>, folder: &Folder, keys: &RunFile) -> Result<(), Diag> {
    if folder.machine.name == keys.machine {
        return Ok(());
    }
    let text = format!("the job is for machine {:?}, the run file for {:?}", folder.machine.name, keys.machine);
    Err(Diag::limit("run-machine", text)
        .at(Place::file(order.run_file.display().to_string()))
        .hint("compile the job for this machine, or use the run file of the other"))
}

/// The journal of a run that marks blocks, and the numbers of the blocks that are left; of other runs all are.
fn open_journal(order: &Order<'_>, folder: &Folder) -> Result<(Option<Journal>, Vec<usize>), Error> {
    if order.beam != Beam::Fire || order.frames.is_some() {
        return Ok((None, (0..folder.blocks.len()).collect()));
    }
    let path = elsewhere::choose(order, &folder.manifest)?;
    elsewhere::refuse_marked(order, &path, folder)?;
    let (journal, left) = Journal::open(path.clone(), order, folder)?;
    elsewhere::note(&path, &folder.manifest)?;
    folder.program().map_or(Ok(()), |program| elsewhere::note(&path, program))?;
    Ok((Some(journal), left))
}

/// One run at a time with a run file, on whichever computer, where its file system has locks; the lock lasts as long as
/// the handle.
fn lock_run_file(run_file: &Path) -> Result<File, Diag> {
    let place = || Place::file(run_file.display().to_string());
    let opened = File::open(run_file).and_then(|mut file| file.seek(SeekFrom::End(0)).map(|_| file));
    let file = opened.map_err(|e| Diag::input("file-unreadable", format!("cannot read the file: {e}")).at(place()))?;
    if matches!(file.try_lock(), Err(TryLockError::WouldBlock)) {
        let text =
            "another run with this run file is in progress, or the laser's command of a killed one is still marking";
        return Err(Diag::input("run-locked", text).at(place()).hint("wait for its end"));
    }
    Ok(file)
}

/// Frames are fired by drivers alone that load the file of each: whatever else is loaded would be marked.
fn may_fire_frames(order: &Order<'_>, laser: &dyn Laser) -> Result<(), Diag> {
    if order.beam == Beam::Pilot || laser.format().is_some() {
        return Ok(());
    }
    let text = "this laser driver loads no files: it would mark what is loaded, not the frame";
    Err(Diag::limit("run-frames", text).hint("leave --arm out, and show the frames with the pilot laser"))
}

/// Refuses a folder that does not verify.
fn check(order: &Order<'_>, folder: &Folder, interrupt: &Interrupt) -> Result<(), Error> {
    let path = order.folder.to_owned();
    let inputs = order.inputs.map(Path::to_owned);
    let proof = interrupt.wait_for(move || terrace_verify::verify(&path, inputs.as_deref()))??;
    folder.is_unchanged()?;
    if proof.ok {
        return Ok(());
    }
    let broken = proof.rules.iter().find(|rule| !rule.ran || rule.violated > 0);
    let rule = broken.map_or(String::new(), |rule| format!(": rule {} ({})", rule.code, rule.what));
    Err(Diag::limit("run-unverified", format!("the job folder does not verify{rule}"))
        .at(Place::file(order.folder.display().to_string()))
        .hint(format!("see `terrace verify {}`; compile the job again", order.folder.display()))
        .into())
}

/// What is certain of an armed run that has stopped, and what is not.
fn certain(outcome: &Outcome, order: &Order<'_>) -> Diag {
    let Outcome { finished, blocks, in_work, .. } = outcome;
    let progress = format!("{finished} of {blocks} blocks are done");
    match in_work {
        Some(block) => Diag::limit(
            "run-stopped",
            format!("{progress}; block {block} was begun, and may be marked not at all, in part or completely"),
        )
        .hint(in_doubt(order, block)),
        None => {
            let words = if *finished > 0 { "--arm --go-on" } else { "--arm" };
            let hint = format!("remove the cause, then continue: {}", order.command(words));
            Diag::limit("run-stopped", format!("{progress}; no other block was begun")).hint(hint)
        }
    }
}

/// What to do with a block in doubt.
fn in_doubt(order: &Order<'_>, block: &str) -> String {
    let command = order.command(&format!("--arm --go-on --redo {block}"));
    format!(
        "look at it; to mark it again: {command}; to count it as marked: the same with --skip {block} in place of --redo {block}"
    )
}

/// The stop of a run by the user's request.
fn interrupted(before: &Block) -> Diag {
    Diag::limit("run-interrupted", format!("the run was ended before block {}", before.id))
}

/// A run that is going on.
struct Run<'a> {
    folder: &'a Folder,
    console: &'a dyn Console,
    interrupt: &'a Interrupt,
    log: &'a mut Log,
    journal: Option<&'a mut Journal>,
    stage: &'a mut dyn Stage,
    laser: &'a mut dyn Laser,
    beam: Beam,
    is_frames: bool,
    moves: Moves<'a>,
    /// Blocks that are marked, or frames that are shown.
    marked: usize,
    /// The block that is begun and has not ended.
    in_work: Option<String>,
    /// The block of this run that ended last.
    last: Option<String>,
}

impl Run<'_> {
    /// Connects to the stage, and makes sure that nothing is being marked.
    fn open_stage(&mut self) -> Result<(), Diag> {
        let says = self.stage.open(self.interrupt)?;
        self.log.write("stage", &says)?;
        self.laser.is_idle(self.stage, self.interrupt)
    }

    /// All blocks that are left, by their numbers, and the lift after the last.
    fn blocks(&mut self, left: &[usize]) -> Result<(), Diag> {
        let folder = self.folder;
        let mut setup = None;
        for (n, &index) in left.iter().enumerate() {
            let block = &folder.blocks[index];
            if self.interrupt.is_requested() {
                self.lift()?;
                return Err(interrupted(block));
            }
            self.console.block(&Progress {
                done: folder.blocks.len() - left.len() + n,
                blocks: folder.blocks.len(),
                block: &block.id,
                file: block.file.as_deref(),
                left: left[n..].iter().map(|&i| folder.time(i)).sum(),
            });
            if setup != Some(block.setup) {
                if folder.origins.len() > 1 {
                    self.set_up(block)?;
                }
                if self.is_frames {
                    self.registration(block.setup)?;
                }
                setup = Some(block.setup);
                if self.interrupt.is_requested() {
                    return Err(interrupted(block));
                }
            }
            let result = if self.is_frames { self.frame(block) } else { self.block(block) };
            result.map_err(|d| if d.place == Place::Nowhere { d.at(Place::Block(block.id.clone())) } else { d })?;
        }
        self.lift()
    }

    /// Makes sure that nothing is being marked. Where something is, the block that ended last is in doubt again.
    fn is_free(&mut self) -> Result<(), Diag> {
        if self.laser.is_free(self.interrupt)? {
            return Ok(());
        }
        if let (Some(journal), Some(last)) = (&mut self.journal, self.last.take()) {
            journal.doubt(&last)?;
            self.marked -= 1;
            self.in_work = Some(last);
        }
        let text = "the laser is marking where the stage is to move or a block is to begin";
        Err(Diag::limit("run-laser-busy", text).hint("wait for its end; nothing else may start it during a run"))
    }

    /// Goes to a block, once nothing is being marked; returns what is to be marked there.
    fn approach(&mut self, block: &Block) -> Result<Work, Diag> {
        self.is_free()?;
        self.stage.heads_for(&block.id);
        for to in self.moves.to(block) {
            self.go(&to)?;
        }
        self.interrupt.wait(LEAST_SETTLE.max(Duration::from_secs_f64(self.folder.machine.stage.settle.longest())))?;
        self.is_free()?;
        Ok(Work {
            block: block.id.clone(),
            file: self.folder.file(block)?,
            focus_shift: block.focus_shift,
            estimate: block.estimate,
        })
    }

    /// Goes to a block and shows its frame until the person has seen it.
    fn frame(&mut self, block: &Block) -> Result<(), Diag> {
        let work = self.approach(block)?;
        self.log.write("frame", &block.id)?;
        let is_driven = self.laser.format().is_some() && (self.beam == Beam::Fire || self.laser.has_pilot());
        let file = block.file.as_ref().map_or(String::new(), |file| format!(" ({file})"));
        let what = match self.beam {
            Beam::Fire => "was fired",
            Beam::Pilot if is_driven => "is shown",
            Beam::Pilot => "lies here: show it",
        };
        let text = format!("the frame of block {}{file} {what}; compare it with layout.svg", block.id);
        let Self { laser, stage, interrupt, beam, .. } = self;
        // The pilot laser shows it again and again, the other fires once.
        let mut is_due = is_driven;
        self.console.ask_while(&text, interrupt, &mut || {
            if !is_due {
                return Ok(());
            }
            is_due = *beam != Beam::Fire;
            laser.mark(&work, *beam, &mut **stage, interrupt)
        })?;
        // As at a registration point.
        self.moves.forget();
        self.marked += 1;
        Ok(())
    }

    /// Goes to the registration points of a set-up, lifted, and waits at each.
    fn registration(&mut self, setup: u32) -> Result<(), Diag> {
        let folder = self.folder;
        self.is_free()?;
        self.stage.heads_for("");
        for (point, number) in folder.registration[setup as usize - 1].iter().zip(1..) {
            for to in self.moves.over(point.at.map(|nm| nm.0)) {
                self.go(&to)?;
            }
            let [x, y] = point.point_mm;
            let text =
                format!("registration point {number} (X {x} Y {y} mm of the part) must lie under the pilot laser");
            self.console.ask(&text, self.interrupt)?;
            // Whoever looks for it may have moved the axes.
            self.moves.forget();
        }
        Ok(())
    }

    /// Goes to a block and marks it.
    fn block(&mut self, block: &Block) -> Result<(), Diag> {
        let work = self.approach(block)?;
        self.log.write("begin", &block.id)?;
        if let Some(journal) = &mut self.journal {
            journal.begin(&block.id)?;
            self.in_work = Some(block.id.clone());
        }
        if self.beam == Beam::Fire || self.laser.has_pilot() {
            self.laser.mark(&work, self.beam, self.stage, self.interrupt)?;
        }
        if let Some(journal) = &mut self.journal {
            journal.end(&block.id)?;
            self.last = self.in_work.take();
        }
        self.marked += 1;
        self.log.write("end", &block.id)
    }

    /// Lifts, switches the laser off, and asks for the part to be placed.
    fn set_up(&mut self, block: &Block) -> Result<(), Diag> {
        self.laser.off()?;
        self.lift()?;
        let [x, y, z] = self.folder.origins[block.setup as usize - 1];
        let count = self.folder.origins.len();
        let text = format!(
            "set-up {} of {count}: place the part with its zero at X {x} Y {y} Z {z} mm of the table (run sheet)",
            block.setup
        );
        self.console.ask(&text, self.interrupt)?;
        // Whoever places the part may have moved the axes.
        self.moves.forget();
        Ok(())
    }

    /// Lifts, once nothing is being marked.
    fn lift(&mut self) -> Result<(), Diag> {
        self.is_free()?;
        self.stage.heads_for("");
        self.moves.lift().map_or(Ok(()), |to| self.go(&to))
    }

    /// Makes one move.
    fn go(&mut self, to: &Move) -> Result<(), Diag> {
        self.interrupt.check()?;
        self.log.write("move", &to.to_string())?;
        self.stage.go(to, self.interrupt)
    }

    /// Switches laser and stage off; returns all that went wrong.
    fn end(&mut self, result: Result<(), Diag>) -> Vec<Diag> {
        let ends = [result, self.laser.off(), self.stage.halt()];
        let mut faults: Vec<Diag> = ends.into_iter().filter_map(Result::err).collect();
        faults.dedup_by(|a, b| a.message == b.message);
        let note = faults.first().map_or("end", |d| d.code);
        if let Some(journal) = &mut self.journal
            && let Err(d) = journal.stop(note)
        {
            faults.push(d);
        }
        faults
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[cfg(unix)]
    #[test]
    fn commands_can_be_pasted() {
        let order = Order {
            folder: Path::new("out/it's a hood.job"),
            run_file: Path::new("run.toml"),
            inputs: Some(Path::new("$HOME/a")),
            journal: None,
            log: None,
            beam: Beam::Fire,
            frames: None,
            journal_choice: JournalChoice::default(),
        };
        let command = order.command("--arm --go-on --redo B0133");
        let wanted =
            r"terrace run 'out/it'\''s a hood.job' --with run.toml --inputs '$HOME/a' --arm --go-on --redo B0133";
        assert_eq!(command, wanted);
        // A shell reads the same words.
        let words = format!("set -- {}; printf '%s\\n' \"$@\"", command.replacen("terrace ", "", 1));
        let out = std::process::Command::new("sh").args(["-c", &words]).output().expect("a shell");
        let text = String::from_utf8(out.stdout).expect("UTF-8");
        let wanted = [
            "run",
            "out/it's a hood.job",
            "--with",
            "run.toml",
            "--inputs",
            "$HOME/a",
            "--arm",
            "--go-on",
            "--redo",
            "B0133",
        ];
        assert_eq!(text.lines().collect::<Vec<_>>(), wanted);
    }

    #[test]
    fn an_abort_ends_the_wait_for_what_does_not_end() {
        let interrupt = Interrupt::default();
        assert_eq!(interrupt.wait_for(|| 7), Ok(7));
        interrupt.request();
        assert_eq!(interrupt.wait_for(|| 7), Ok(7), "the first request lets what is under way end");
        interrupt.clone().request();
        let e = interrupt.wait_for(std::thread::park).expect_err("it never ends");
        assert_eq!(e.code, "run-aborted");
    }
}
