//! `terrace batch`: lines as jobs end, the files that it writes beside job folders, and Ctrl-C.

use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use super::args::{Args, Batch};
use super::{durability, overrides, print, refuse_input, show, unwritable, write_file};
use crate::batch::{self, Outcome, Settings};
use crate::diag::{Diag, Error, Place};
use crate::job_folder::Durability;
use crate::verify;

pub fn run(args: &Args, asked: &Batch) -> Result<u8, Error> {
    let list = batch::jobs(&asked.jobs, asked.output.as_deref(), &overrides(args, &asked.choice))?;
    let inputs: Vec<PathBuf> = list.iter().flat_map(batch::Entry::inputs).chain(asked.jobs.iter().cloned()).collect();
    // What cannot be written at the end of a night is found before it begins.
    for file in [&asked.report, &asked.log, &asked.index].into_iter().flatten() {
        refuse_input(file, &inputs)?;
        std::fs::create_dir_all(folder_of(file))
            .map_err(|e| unwritable("make the folder", Place::file(folder_of(file).display().to_string()), &e))?;
    }
    let mut log = asked.log.as_deref().map(|path| Log::open(path, durability(args))).transpose()?;
    let view = show::Progress::new(args.quiet, list.len(), "jobs");
    let stop = stop_on_ctrl_c(&view);
    let settings = Settings { durability: durability(args), verify: asked.verify.then_some(&verified), stop: &stop };
    let mut ended = 0;
    let found = batch::run(&list, &settings, &mut |outcome| {
        ended += 1;
        view.job(outcome, [ended, list.len()]);
        log.iter_mut().for_each(|log| log.add(outcome));
    });
    view.finish();
    let json = show::json(&found.to_json());
    let write = |file: &Option<PathBuf>, text: &dyn Fn(&Path) -> Result<String, Error>| match file {
        Some(path) => write_file(args, path, text(folder_of(path))?.as_bytes(), &inputs),
        None => Ok(()),
    };
    // Before the result is printed: where a file cannot be written, its error is the only JSON object.
    let written = [
        write(&asked.report, &|_| Ok(json.clone())),
        write(&asked.index, &|folder| batch::index_html(&found, folder)),
        log.map_or(Ok(()), Log::close),
    ];
    written.into_iter().collect::<Result<(), Error>>()?;
    print(&if args.json { json } else { found.to_string() })?;
    Ok(found.exit_code())
}

/// The folder in which a file lies.
fn folder_of(file: &Path) -> &Path {
    file.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// Verifies the folder of a job.
fn verified(folder: &Path) -> Result<(), Error> {
    let proof = verify::verify(folder, None)?;
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
    let hint = format!("terrace verify {0} tells where; remove the folder to compile the job again", folder.display());
    Err(d.at(Place::file(folder.display().to_string())).hint(hint).into())
}

/// Set by the first Ctrl-C; the second ends the program.
fn stop_on_ctrl_c(view: &show::Progress) -> Arc<AtomicBool> {
    let stop = Arc::new(AtomicBool::new(false));
    let (stopped, view) = (stop.clone(), view.clone());
    // Where the system takes no handler, Ctrl-C ends the program at once. Folders are whole either way.
    let _ = ctrlc::set_handler(move || {
        if stopped.swap(true, Ordering::Relaxed) {
            std::process::exit(1);
        }
        view.say("stopping: running jobs are completed, no others are started; press Ctrl-C again to quit at once");
    });
    stop
}

/// A file of JSON lines, one for each job that has ended.
struct Log {
    path: PathBuf,
    file: File,
    durability: Durability,
    /// What the first failure to write was. The batch goes on: job folders matter more.
    failed: Option<std::io::Error>,
}

impl Log {
    fn open(path: &Path, durability: Durability) -> Result<Self, Error> {
        let file = File::options().create(true).append(true).open(path);
        let file = file.map_err(|e| unwritable("write the file", Place::file(path.display().to_string()), &e))?;
        Ok(Self { path: path.to_owned(), file, durability, failed: None })
    }

    fn add(&mut self, outcome: &Outcome) {
        let line = format!("{}\n", outcome.to_json());
        let flush = || match self.durability {
            Durability::Synced => self.file.sync_data(),
            Durability::Unsynced => Ok(()),
        };
        let written = (&self.file).write_all(line.as_bytes()).and_then(|()| flush());
        self.failed = self.failed.take().or(written.err());
    }

    fn close(self) -> Result<(), Error> {
        let place = Place::file(self.path.display().to_string());
        self.failed.map_or(Ok(()), |e| Err(unwritable("write the file", place, &e)))
    }
}
