//! Units of `batch` and `sweep`: planned to a file, and worked on by number.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use super::args::Args;
use super::{durability, print, show};
use crate::batch::fragment::Fragment;
use crate::batch::isolated::{self, Isolation};
use crate::batch::units::{self, UnitSelection};
use crate::batch::work::{End, WorkResult};
use crate::batch::{Settings, Unit, work as work_on};
use terrace_core::diag::{Diag, Error, Place};
use terrace_report::job_folder::Durability;

/// How units are worked on in this process.
pub(super) fn settings<'a>(args: &Args, stop: &'a AtomicBool) -> Settings<'a> {
    Settings { durability: durability(args), verify: &verified, stop }
}

/// Verifies the folder of a job.
fn verified(folder: &Path) -> Result<(), Error> {
    let proof = terrace_verify::verify(folder, None)?;
    if proof.ok {
        return Ok(());
    }
    let faults: Vec<String> = proof
        .rules
        .iter()
        .filter(|rule| rule.violated > 0 || !rule.ran)
        .map(|rule| {
            if rule.violated > 0 {
                format!("{}: {}", rule.code, rule.violated)
            } else {
                format!("{}: not checked", rule.code)
            }
        })
        .collect();
    let d = Diag::limit("batch-verify", format!("the folder does not verify ({})", faults.join(", ")));
    let hint = format!("terrace verify {0} says where; remove the folder to compile the job again", folder.display());
    Err(d.at(Place::file(folder.display().to_string())).hint(hint).into())
}

/// Set by the first Ctrl-C; the second ends the program.
pub(super) fn stop_on_ctrl_c(view: &show::Progress, is_fleet: bool) -> Arc<AtomicBool> {
    let stop = Arc::new(AtomicBool::new(false));
    let stopped = stop.clone();
    let view = view.clone();
    // Where the system takes no handler, Ctrl-C ends the program at once. Folders are whole either way.
    let _ = super::stop::on_request(move || {
        if stopped.swap(true, Ordering::Relaxed) {
            std::process::exit(1);
        }
        view.say(if is_fleet {
            "stopping: what has not begun is cancelled; workers complete what they have begun"
        } else {
            "stopping: running jobs are completed, no others are started; press Ctrl-C again to quit at once"
        });
    });
    stop
}

/// `batch --plan`: writes the file and says what it holds.
pub(super) fn plan(args: &Args, list: &[Unit], file: &Path) -> Result<u8, Error> {
    units::write(list, file, durability(args))?;
    let cost_s: f64 = list.iter().map(|unit| unit.cost_s).sum();
    let text = format!("{} units in {}, expected cost {cost_s:.0} s of one core\n", list.len(), file.display());
    let json = serde_json::json!({"units": list.len(), "file": file.display().to_string(), "cost_s": cost_s});
    print(&if args.json { show::json(&json) } else { text })?;
    Ok(0)
}

/// `batch --unit`: works on units one after another; a line for each as it ends.
pub(super) fn work(args: &Args, file: &Path, chosen: &UnitSelection, memory: Option<u64>) -> Result<u8, Error> {
    let all = units::read(file)?;
    let list = chosen.of(&all, file)?;
    let reports = units::reports(file);
    let durability = durability(args);
    let mut printer = FragmentPrinter { is_json: args.json, exit_code: 0 };
    if let Some(memory) = memory {
        let command = |ids: &[usize]| again(args, file, ids);
        let mut failed = Ok(());
        let isolation = Isolation { command: &command, memory, reports: &reports, durability };
        isolated::run(&list, &isolation, &mut |fragment| failed = failed.clone().and(printer.print(fragment)))?;
        failed?;
    } else {
        let stop = AtomicBool::new(false);
        for unit in list {
            let begin = Instant::now();
            let result = work_on(unit, &settings(args, &stop));
            printer.print(&reported(unit, result, begin, &reports, durability))?;
        }
    }
    Ok(printer.exit_code)
}

/// Prints a line for every unit as it ends.
struct FragmentPrinter {
    is_json: bool,
    /// The highest of all units.
    exit_code: u8,
}

impl FragmentPrinter {
    fn print(&mut self, fragment: &Fragment) -> Result<(), Error> {
        self.exit_code = self.exit_code.max(fragment.end.exit_code());
        print(&if self.is_json { line(fragment) } else { shown(fragment) })
    }
}

/// Writes the report of a unit; one that cannot be written says why in place of what became of the unit.
fn reported(unit: &Unit, result: WorkResult, begin: Instant, reports: &Path, durability: Durability) -> Fragment {
    let fragment = Fragment::new(unit, result, begin.elapsed().as_secs_f64());
    match fragment.write(reports, durability) {
        Ok(()) => fragment,
        Err(e) => Fragment { end: End::failed(unit, &(&e).into()), ..fragment },
    }
}

/// The command line that works on these units in another process, which sets no limit of memory itself.
fn again(args: &Args, file: &Path, ids: &[usize]) -> Command {
    let program = std::env::current_exe().unwrap_or_else(|_| PathBuf::from("terrace"));
    let mut command = Command::new(program);
    let ids: Vec<String> = ids.iter().map(ToString::to_string).collect();
    command.args(["batch", "--json", "--units"]).arg(file).args(["--unit", &ids.join(",")]);
    command.args(args.threads.map(|n| format!("-j{n}"))).args(args.no_sync.then_some("--no-sync"));
    command
}

fn line(fragment: &Fragment) -> String {
    format!("{}\n", serde_json::json!(fragment))
}

fn shown(fragment: &Fragment) -> String {
    match &fragment.end {
        End::Job(outcome) => format!("{outcome}\n"),
        End::Rows(rows) => format!("unit {}: {} combinations\n", fragment.unit, rows.len()),
    }
}
