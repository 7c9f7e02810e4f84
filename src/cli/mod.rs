//! The command line: what was typed, what it means, running it.
//!
//! Results go to stdout, messages to stderr, progress to a terminal only. Exit codes: 0 done, 1
//! refused by checks or verification, 2 bad use or input, 3 internal.

mod args;
mod inspect;
mod show;

use std::io::{IsTerminal, Read, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::{CommandFactory, Parser};

use crate::batch;
use crate::compile::{self, Plan, Station};
use crate::diag::{Diag, Error, Place};
use crate::folder;
use crate::machine::PROFILES;
use crate::preview;
use crate::spec::{self, Job};
use crate::verify;
use args::{Args, Command};

/// Parses the command line, runs it, and answers with the exit code.
pub fn main() -> ExitCode {
    let args = match Args::try_parse() {
        Ok(args) => args,
        Err(e) => {
            // Help and version are no faults.
            let code = if e.use_stderr() { 2 } else { 0 };
            let _ = e.print();
            return ExitCode::from(code);
        }
    };
    let pool = match rayon::ThreadPoolBuilder::new().num_threads(args.threads.unwrap_or(0)).build() {
        Ok(pool) => pool,
        Err(e) => return fail(&Diag::input("threads", format!("cannot start {:?} threads: {e}", args.threads)).into()),
    };
    let done = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| pool.install(|| run(&args))));
    match done {
        Ok(Ok(code)) => ExitCode::from(code),
        Ok(Err(e)) => fail(&e),
        Err(_) => fail(&Diag::bug("panic", "an invariant of the program broke (see above)").into()),
    }
}

fn fail(e: &Error) -> ExitCode {
    let color = std::io::stderr().is_terminal();
    for d in e.diags() {
        eprintln_all(&d.render(color));
    }
    ExitCode::from(e.exit_code())
}

/// Writes a line to stderr; a closed stderr is no reason to stop.
fn eprintln_all(text: &str) {
    let _ = writeln!(std::io::stderr(), "{text}");
}

/// Writes to stdout; a reader that closed the pipe has had enough.
fn print(text: &str) {
    let mut out = std::io::stdout().lock();
    let _ = out.write_all(text.as_bytes()).and_then(|()| out.flush());
}

fn run(args: &Args) -> Result<u8, Error> {
    match &args.command {
        Command::Init { folder, schema } => init(folder, *schema),
        Command::Check { job } => {
            let plan = planned(args, job)?;
            report(args, &plan, None);
            Ok(0)
        }
        Command::Compile { job, output } => {
            let target = match output {
                Some(o) => o.clone(),
                None if job == Path::new("-") => PathBuf::from("stdin.job"),
                None => compile::default_output(job),
            };
            let spinner = show::Spinner::new(args.quiet);
            let plan = compile::plan(load(job)?, &|s| spinner.station(s))?;
            spinner.station(Station::Write);
            folder::write(&plan, &target, args.seed)?;
            spinner.done();
            warn(args, &plan.warnings);
            report(args, &plan, Some(&target));
            Ok(0)
        }
        Command::Verify { folder, inputs } => {
            let spinner = show::Spinner::new(args.quiet);
            spinner.text("verifying");
            let proof = verify::verify(folder, inputs.as_deref())?;
            spinner.done();
            print(&if args.json { show::json(&proof.to_json()) } else { proof.to_text() });
            Ok(u8::from(!proof.ok))
        }
        Command::Preview { job, output } => {
            let plan = planned(args, job)?;
            let name = job.file_name().map_or_else(String::new, |n| n.to_string_lossy().into_owned());
            let svg = preview::layout_svg(&folder::layout(&plan, &name));
            match output.as_deref() {
                Some(o) if o == Path::new("-") => print(&svg),
                given => {
                    let path = given.map_or_else(|| job.with_extension("svg"), Path::to_owned);
                    write_file(&path, svg.as_bytes())?;
                    print(&format!("{}\n", path.display()));
                }
            }
            Ok(0)
        }
        Command::Batch { jobs, output, report } => {
            let list = batch::jobs(jobs, output.as_deref())?;
            let view = show::BatchView::new(args.quiet, list.len());
            let outcome = batch::run(&list, args.seed, &|done| view.done(done));
            view.finish();
            let text = if args.json { show::json(&outcome.to_json()) } else { outcome.to_string() };
            if let Some(path) = report {
                write_file(path, show::json(&outcome.to_json()).as_bytes())?;
            }
            print(&text);
            Ok(outcome.exit_code())
        }
        Command::Inspect { file, unit } => {
            let shown = inspect::inspect(file, *unit)?;
            warn(args, &shown.warnings);
            print(&if args.json { show::json(&shown.json) } else { shown.text });
            Ok(0)
        }
        Command::Machines { name } => machines(args, name.as_deref()),
        Command::Completions { shell } => {
            let mut out = Vec::new();
            clap_complete::generate(*shell, &mut Args::command(), "terrace", &mut out);
            print(&String::from_utf8_lossy(&out));
            Ok(0)
        }
    }
}

/// Reads a job file, or standard input for `-`.
fn load(job: &Path) -> Result<Job, Error> {
    if job != Path::new("-") {
        return Job::load(job);
    }
    let mut text = String::new();
    let unreadable = |e: std::io::Error| Diag::input("file-unreadable", format!("cannot read standard input: {e}"));
    std::io::stdin().lock().take(4 << 20).read_to_string(&mut text).map_err(unreadable)?;
    Job::parse(Path::new("stdin.toml"), &text)
}

fn planned(args: &Args, job: &Path) -> Result<Plan, Error> {
    let spinner = show::Spinner::new(args.quiet);
    let plan = compile::plan(load(job)?, &|s| spinner.station(s))?;
    spinner.done();
    warn(args, &plan.warnings);
    Ok(plan)
}

fn warn(args: &Args, warnings: &[Diag]) {
    if args.quiet {
        return;
    }
    let color = std::io::stderr().is_terminal();
    for w in warnings {
        eprintln_all(&w.render(color));
    }
}

fn report(args: &Args, plan: &Plan, folder: Option<&Path>) {
    if args.json {
        let value = serde_json::to_value(&plan.summary).unwrap_or_default();
        print(&show::json(&value));
    } else {
        print(&show::summary(&plan.summary, folder));
    }
}

fn write_file(path: &Path, bytes: &[u8]) -> Result<(), Error> {
    std::fs::write(path, bytes).map_err(|e| {
        Diag::input("output-unwritable", format!("cannot write the file: {e}"))
            .at(Place::file(path.display().to_string()))
            .into()
    })
}

fn init(folder: &Path, schema: bool) -> Result<u8, Error> {
    if schema {
        print(&format!("{}\n", spec::json_schema()));
        return Ok(0);
    }
    let files =
        [("job.toml", spec::SAMPLE_JOB.as_bytes().to_vec()), (spec::SAMPLE_SURFACE_NAME, spec::sample_surface())];
    for (name, _) in &files {
        let path = folder.join(name);
        if path.exists() {
            let d = Diag::input("init-exists", "the file exists already").at(Place::file(path.display().to_string()));
            return Err(d.hint("name an empty folder: terrace init FOLDER").into());
        }
    }
    std::fs::create_dir_all(folder).map_err(|e| {
        Diag::input("output-unwritable", format!("cannot make the folder: {e}"))
            .at(Place::file(folder.display().to_string()))
    })?;
    for (name, bytes) in &files {
        let path = folder.join(name);
        write_file(&path, bytes)?;
        print(&format!("{}\n", path.display()));
    }
    print(&format!("next: terrace compile {}\n", folder.join("job.toml").display()));
    Ok(0)
}

fn machines(args: &Args, name: Option<&str>) -> Result<u8, Error> {
    if let Some(name) = name {
        let machine = crate::machine::Machine::built_in(name)?;
        let text = PROFILES.iter().find(|(n, _)| *n == name).map_or("", |(_, t)| t);
        let value = serde_json::to_value(&machine).unwrap_or_default();
        print(&if args.json { show::json(&value) } else { text.to_owned() });
        return Ok(0);
    }
    if args.json {
        let names: Vec<&str> = PROFILES.iter().map(|(n, _)| *n).collect();
        print(&show::json(&serde_json::json!(names)));
        return Ok(0);
    }
    for (name, _) in PROFILES {
        let m = crate::machine::Machine::built_in(name)?;
        let [x, y] = m.lens.field.map(|f| f.as_mm());
        let travel = m.axes().map(|(_, a)| format!("{}", a.travel[1].as_mm() - a.travel[0].as_mm())).join(" x ");
        print(&format!("{name:<18} field {x} x {y} mm, travel {travel} mm; {}\n", m.source));
    }
    Ok(0)
}
