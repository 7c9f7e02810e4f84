//! `terrace run`: Ctrl-C, the bar, the person's answers, the outcome.

use std::io::{BufRead, IsTerminal};
use std::rc::Rc;
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::sync::{Mutex, OnceLock};
use std::time::Duration;

use super::args::{Args, RunArgs};
use super::{eprintln_all, named, print, print_diag, show};
use crate::run::journal::JournalChoice;
use crate::run::laser::Beam;
use crate::run::{self, Console, Interrupt, Order, Outcome, Progress};
use terrace_core::diag::{Diag, Error};

/// Runs a job and says what has become of it.
pub(super) fn run(args: &Args, asked: &RunArgs) -> Result<u8, Error> {
    named::job_folder(asked.folder())?;
    let interrupt = Interrupt::default();
    let interrupted = interrupt.clone();
    let heard = super::stop::on_request(move || {
        interrupted.request();
        let text = if interrupted.is_abort() {
            "aborting"
        } else {
            "ending after this block; press Ctrl-C again to abort at once"
        };
        eprintln_all(text);
    });
    if let Err(e) = heard {
        return Err(Diag::bug("run-interrupt", format!("cannot watch for Ctrl-C: {e}")).into());
    }
    let console = Terminal::new(args.quiet);
    let shared: Rc<dyn Console> = Rc::clone(&console) as Rc<dyn Console>;
    let order = order(asked);
    let outcome = run::run(&order, &shared, &interrupt);
    console.bar.finish();
    let outcome = outcome?;
    print(&if args.json { show::json(&serde_json::json!(outcome)) } else { text(&outcome, &order) })?;
    let Some(stop) = &outcome.stop else { return Ok(0) };
    stop.diags().iter().for_each(|d| print_diag(args, d));
    Ok(1)
}

fn order(asked: &RunArgs) -> Order<'_> {
    Order {
        folder: asked.folder(),
        run_file: asked.with(),
        inputs: asked.inputs.as_deref(),
        journal: asked.journal.as_deref(),
        log: asked.log.as_deref(),
        frames: asked.frames.as_deref(),
        beam: if asked.arm { Beam::Fire } else { Beam::Pilot },
        journal_choice: JournalChoice {
            go_on: asked.go_on,
            redo: asked.redo.as_deref(),
            skip: asked.skip.as_deref(),
            again: asked.again,
        },
    }
}

fn text(outcome: &Outcome, order: &Order<'_>) -> String {
    let Outcome { armed, frames, blocks, marked, finished, part, .. } = outcome;
    match armed {
        _ if *frames => format!("frames         {marked} of {blocks} shown\n"),
        true if *part > 1 => format!("marked         {}, {finished} of {blocks} done, part {part}\n", counted(*marked)),
        true => format!("marked         {}, {finished} of {blocks} done\n", counted(*marked)),
        false if outcome.stop.is_some() => format!("dry run        {marked} of {blocks} blocks, nothing marked\n"),
        false => format!(
            "dry run        {marked} of {blocks} blocks, nothing marked\nto mark        {}\n",
            order.command("--arm")
        ),
    }
}

/// The bar on stderr, and lines of stdin.
struct Terminal {
    bar: show::Blocks,
    lines: OnceLock<Mutex<Receiver<String>>>,
}

impl Terminal {
    fn new(quiet: bool) -> Rc<Self> {
        Rc::new(Self { bar: show::Blocks::new(quiet), lines: OnceLock::new() })
    }

    /// Lines of stdin from now on; read by a thread, so that a wait for one can be ended.
    fn lines(&self) -> &Mutex<Receiver<String>> {
        self.lines.get_or_init(|| {
            let (sender, lines) = channel();
            std::thread::spawn(move || {
                for line in std::io::stdin().lock().lines() {
                    let Ok(line) = line else { return };
                    if sender.send(line).is_err() {
                        return;
                    }
                }
            });
            Mutex::new(lines)
        })
    }
}

impl Console for Terminal {
    fn phase(&self, text: &'static str) {
        self.bar.phase(text);
    }

    fn block(&self, progress: &Progress<'_>) {
        self.bar.block(progress);
    }

    fn ask_while(
        &self,
        what: &str,
        interrupt: &Interrupt,
        meanwhile: &mut dyn FnMut() -> Result<(), Diag>,
    ) -> Result<(), Diag> {
        const EVERY: Duration = Duration::from_millis(20);
        let lines = self.lines().lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        // What was typed before the question is no answer to it.
        while std::io::stdin().is_terminal() && lines.try_recv().is_ok() {}
        self.bar.say(&format!("[ready?] {what}. Press Enter when done, or type stop to end the run"));
        let refused = |text: &str| Err(Diag::limit("run-person", format!("{text}: {what}")));
        loop {
            interrupt.check()?;
            meanwhile()?;
            match lines.recv_timeout(EVERY) {
                Ok(line) if ["", "ready", "y", "yes", "done"].contains(&line.trim().to_lowercase().as_str()) => {
                    return Ok(());
                }
                Ok(line) if ["stop", "n", "no"].contains(&line.trim().to_lowercase().as_str()) => {
                    return refused("stopped at the question");
                }
                Ok(_) => self.bar.say("press Enter when done, or type stop to end the run"),
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return refused("no answer (end of standard input)"),
            }
        }
    }
}

fn counted(blocks: usize) -> String {
    if blocks == 1 { "1 block".into() } else { format!("{blocks} blocks") }
}
