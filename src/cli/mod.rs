//! The command line: what was typed, what it means, running it.
//!
//! Results go to stdout, messages to stderr, progress to a terminal only. Exit codes: 0 done, 1
//! refused by checks or verification, 2 bad use or input, 3 internal.

mod args;
mod batch;
#[cfg(feature = "fleet")]
mod carrier;
#[cfg(feature = "compare")]
mod compare;
mod diff;
mod doctor;
mod examples;
mod explain;
mod fleet;
mod import;
mod inspect;
mod manual;
mod named;
mod orient;
mod preview;
mod probe;
mod progress;
mod register;
mod resume;
#[cfg(feature = "run")]
mod run;
mod show;
mod stop;
mod sweep;

use std::cell::Cell;
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::{Mutex, PoisonError};

use clap::error::{ContextKind, ContextValue};

#[cfg(feature = "run")]
use args::RunArgs;
use args::{Args, Choice, Command};
use progress::Steps;
#[cfg(feature = "compare")]
use terrace_compare::nurbs::{GridSteps, Surface};
use terrace_core::diag::{self, Diag, Error, Failure, Kind, Place, stand_in};
use terrace_core::machine::{Machine, PROFILES};
use terrace_core::parallel;
#[cfg(feature = "compare")]
use terrace_core::units::Length;
#[cfg(feature = "compare")]
use terrace_input::job::Mode;
use terrace_input::job::{self, Job, Overrides};
use terrace_plan::manifest::AnySummary;
use terrace_plan::plan::lay::Side;
use terrace_plan::plan::part::{self, Facets};
use terrace_plan::plan::{self, HatchSaving, Inputs, Phase, Plan};
use terrace_report::job_folder::{self, Durability, Writing};

/// Stack of a thread, bytes: as that of a program's first one.
const STACK: usize = 8 << 20;

/// Bash writes a space behind what it completed; a key of `--set` is followed by its value.
const BASH_SETTINGS: &str = r#"
_terrace_with_settings() {
    _terrace "$@"
    case "${COMPREPLY[0]-}" in
        *=) compopt -o nospace 2>/dev/null || true ;;
    esac
}
complete -F _terrace_with_settings -o bashdefault -o default terrace
"#;

/// Parses the command line, runs it, and returns the exit code.
pub fn main() -> ExitCode {
    let args = match Args::of(wild::args_os()) {
        Ok(args) => args,
        Err(mut e) => {
            // An option that a command does not have is not a file name: no hint to pass it as one.
            e.remove(ContextKind::Suggested);
            if let Some(tip) = second_job(&e) {
                e.insert(ContextKind::Suggested, ContextValue::StyledStrs(vec![tip.into()]));
            }
            let _ = e.print();
            // Help and version are not errors.
            if !e.use_stderr() {
                return ExitCode::SUCCESS;
            }
            if std::env::args_os().any(|arg| arg == "--json") {
                print_failure(&usage(&e).into());
            }
            return ExitCode::from(2);
        }
    };
    // Without -j the number of threads is left to the system, and to RAYON_NUM_THREADS.
    let pool = rayon::ThreadPoolBuilder::new().num_threads(args.threads.unwrap_or(0)).stack_size(STACK);
    if let Err(e) = pool.build_global() {
        let d = Diag::input("threads", format!("cannot start the threads: {e}")).hint("ask for fewer with -j");
        return fail(&args, &d.into());
    }
    let ran = || if is_one_job(&args.command) { parallel::on_pool(|| run(&args)) } else { run(&args) };
    match std::panic::catch_unwind(ran) {
        Ok(Ok(code)) => ExitCode::from(code),
        Ok(Err(e)) => fail(&args, &e),
        Err(_) => fail(&args, &Diag::bug("panic", "an invariant of the program broke (see above)").into()),
    }
}

/// What to do about a second job file where one is taken.
fn second_job(e: &clap::Error) -> Option<&'static str> {
    let Some(ContextValue::String(word)) = e.get(ContextKind::InvalidArg) else { return None };
    let is_job = e.kind() == clap::error::ErrorKind::UnknownArgument && word.ends_with(".toml");
    is_job.then_some("this command takes one job; for several: terrace batch JOB JOB ...")
}

/// Whether a command computes one job and waits for nothing.
fn is_one_job(command: &Command) -> bool {
    matches!(
        command,
        Command::Check { .. } | Command::Compile { .. } | Command::Verify { .. } | Command::Preview { .. }
    )
}

/// What is wrong with a command line, in clap's words: its first paragraph says what, the others what would work.
fn usage(e: &clap::Error) -> Diag {
    let text = e.to_string();
    let (what, rest) = text.split_once("\n\n").unwrap_or((&text, ""));
    let one_line = |text: &str| text.split_whitespace().collect::<Vec<_>>().join(" ");
    Diag::input("usage", one_line(what.trim_start_matches("error: "))).hint(one_line(rest))
}

/// The failure as JSON in place of the result. Where even that cannot be written, the exit code alone says so.
fn print_failure(e: &Error) {
    let _ = print(&show::json(&serde_json::json!(Failure::from(e))));
}

fn fail(args: &Args, e: &Error) -> ExitCode {
    if args.json {
        print_failure(e);
    }
    let (warnings, faults): (Vec<Diag>, Vec<Diag>) = e.diags().iter().cloned().partition(|d| d.kind == Kind::Warning);
    faults.iter().for_each(|d| print_diag(args, d));
    warn(args, &warnings);
    ExitCode::from(e.exit_code())
}

/// Writes a line to stderr, without what a terminal acts on; a closed stderr is not a reason to stop.
fn eprintln_all(text: &str) {
    let _ = writeln!(std::io::stderr(), "{}", diag::escaped(text));
}

/// Writes a message to stderr, with colours where they are wanted.
fn print_diag(args: &Args, d: &Diag) {
    let color = args.color.on_stderr();
    let text = d.render(color);
    // Names in it were made harmless when it was rendered; colours must stay.
    let _ = writeln!(std::io::stderr(), "{}", if color { text.into() } else { diag::escaped(&text) });
}

/// Writes to stdout; a reader that closed the pipe has had enough. Names come from files: what a terminal acts on is
/// written as JSON writes it.
fn print(text: &str) -> Result<(), Error> {
    let mut out = std::io::stdout().lock();
    let text = diag::escaped(text);
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(e) if e.kind() != ErrorKind::BrokenPipe => Err(unwritable("write to standard output", Place::Nowhere, &e)),
        _ => Ok(()),
    }
}

fn unwritable(what: &str, place: Place, e: &std::io::Error) -> Error {
    let d = Diag::input("output-unwritable", format!("cannot {what}: {e}"));
    d.at(place).hint("check path, space and permissions").into()
}

fn run(args: &Args) -> Result<u8, Error> {
    match &args.command {
        Command::Init { schema: true, output, .. } => schema_text(args, job::json_schema(), output.as_deref())?,
        Command::Init { folder, tutorial: false, .. } => init(args, folder, sample_job(), "compile")?,
        Command::Init { folder, .. } => init(args, folder, tutorial(), "check")?,
        Command::Check { job, choice } => {
            let mut facets = Facets::default();
            let plan = planned(args, load(args, job, choice)?, &mut |facet| facets.take(facet))?;
            let found = part::look_at(&plan, &facets);
            warn(args, &found);
            report(args, &plan, plan.summary().warned(plan.job(), &found), None)?;
            if let (Some(plan), false) = (plan.stepped(), args.json) {
                print(&show::hatch(&HatchSaving::of(plan), plan.summary.time_s.total))?;
            }
        }
        Command::Compile { job, output, verify, no_pictures, choice } => {
            let writing = Writing { durability: durability(args), pictures: !no_pictures };
            compile(args, job, output.as_deref(), writing, *verify, choice)?;
        }
        Command::Verify { folder, inputs } => {
            named::job_folder(folder)?;
            let steps = Steps::new(args.quiet);
            let progress = steps.numbered(&terrace_verify::Phase::ALL, show::proving);
            let proof = terrace_verify::verify_with_progress(folder, inputs.as_deref(), &progress)?;
            steps.done();
            print(&if args.json { show::json(&proof.to_json()) } else { proof.to_text() })?;
            return Ok(u8::from(!proof.ok));
        }
        #[cfg(feature = "run")]
        Command::Run(RunArgs { schema: true, .. }) => schema_text(args, crate::run::settings::json_schema(), None)?,
        #[cfg(feature = "run")]
        Command::Run(asked) => return run::run(args, asked),
        Command::Preview { job, output, width, choice } => {
            preview::preview(args, job, output.as_deref(), *width, choice)?;
        }
        Command::Orient { job, up, lie_on, apply } => {
            let side = match (up, lie_on) {
                (Some(up), _) => Side::Up(*up),
                (None, Some(point)) => Side::LieOn(*point),
                (None, None) => Side::Found,
            };
            orient::orient(args, job, side, *apply)?;
        }
        Command::Probe { job, output, points } => probe::probe(args, job, output.as_deref(), points)?,
        Command::Register { job, log, at, probe } => register::register(args, job, (log.as_deref(), *at), probe)?,
        #[cfg(feature = "compare")]
        Command::Compare { job, systems, protection, nurbs: exact, output } => {
            if let Some(folder) = output {
                compare::may_be_replaced(folder)?;
            }
            let steps = Steps::new(args.quiet);
            let job = load(args, job, &Choice { mode: Some(Mode::Stepped), ..Choice::default() })?;
            let asked = if systems.is_empty() { &terrace_compare::compare::SYSTEMS[..] } else { systems };
            let progress = terrace_compare::compare::Progress {
                begins: &|name| steps.rename(format!("comparing {} systems, now {name}", asked.len())),
                percent: &|percent| steps.percent(percent),
            };
            let exact = exact.as_deref().map(Surface::load).transpose()?;
            let found = terrace_compare::compare::compare(&job, asked, *protection, exact.as_ref(), progress)?;
            steps.done();
            warn(args, &found.warnings);
            if let Some(folder) = output {
                compare::write(&found, folder, durability(args))?;
            }
            print(&if args.json { show::json(&compare::json(&found)) } else { compare::text(&found) })?;
        }
        Command::Sweep { job, set, output, plot, fleet, choice } => {
            sweep::run(args, job, choice, set, fleet, [output, plot].map(Option::as_deref))?;
        }
        Command::Resume { folder, left, again, output } => resume::run(args, folder, left, *again, output)?,
        Command::Batch(asked) => return batch::run(args, asked),
        Command::Diff { before, after, output } => diff::run(args, [before, after], output.as_deref())?,
        Command::Doctor => doctor::run(args)?,
        #[cfg(feature = "compare")]
        Command::Inspect { file, nurbs: true, grid, kernel, .. } => {
            let [step, kernel] = [grid, kernel].map(|length| length.map(Length::as_mm));
            inspect(args, file, || inspect::nurbs(file, GridSteps { step, kernel }))?;
        }
        Command::Inspect { file, unit, .. } => inspect(args, file, || inspect::inspect(file, *unit))?,
        Command::Import { file, output, tolerance, angle } => {
            import::run(args, file, output.as_deref(), *tolerance, *angle)?;
        }
        Command::Machines { schema: true, output, .. } => {
            schema_text(args, terrace_core::machine::json_schema(), output.as_deref())?;
        }
        Command::Machines { name, output, .. } => machines(args, name.as_deref(), output.as_deref())?,
        Command::Completions { shell } => {
            let mut out = Vec::new();
            clap_complete::generate(*shell, &mut Args::described(), "terrace", &mut out);
            let of_bash = if *shell == clap_complete::Shell::Bash { BASH_SETTINGS } else { "" };
            print(&(String::from_utf8_lossy(&out) + of_bash))?;
        }
        Command::Explain { code } => {
            let found = explain::find(code)?;
            print(&if args.json { show::json(&found.json()) } else { found.text() })?;
        }
        Command::Man { output: Some(folder), .. } => manual::write(args, folder)?,
        Command::Man { command, .. } => print(&manual::page(command.as_deref())?)?,
    }
    Ok(0)
}

/// Looks at a file and says what it holds.
fn inspect(args: &Args, file: &Path, look: impl FnOnce() -> Result<inspect::Inspection, Error>) -> Result<(), Error> {
    let steps = Steps::new(args.quiet);
    steps.begin(format!("reading {}", file.display()));
    let shown = look().map_err(stand_in::explained)?;
    steps.done();
    warn(args, &shown.warnings);
    print(&if args.json { show::json(&shown.json) } else { shown.text })
}

/// Whether results must be on the disk before the program ends.
fn durability(args: &Args) -> Durability {
    if args.no_sync { Durability::Unsynced } else { Durability::Synced }
}

/// What the command line sets, over the job file's keys.
fn overrides(args: &Args, choice: &Choice) -> Overrides {
    Overrides { mode: choice.mode, objective: choice.objective, seed: args.seed }
}

/// Reads a job file, or standard input for `-`.
fn load(args: &Args, path: &Path, choice: &Choice) -> Result<Job, Error> {
    let overrides = overrides(args, choice);
    if path != Path::new("-") {
        return Job::load(path, &overrides);
    }
    Job::parse(Path::new(STDIN), &job_from_stdin()?, &overrides)
}

/// The name that a job from standard input has.
const STDIN: &str = "stdin.toml";

fn job_from_stdin() -> Result<String, Error> {
    job::read_text(Path::new("standard input"), &mut std::io::stdin().lock())
}

/// What was proved of a folder.
#[derive(Clone, Copy)]
struct ProofCounts {
    rules: usize,
    checks: u64,
}

impl ProofCounts {
    /// In words, for a report.
    fn text(self) -> String {
        let Self { rules, checks } = self;
        format!(
            "Verified: its files were read back and hold all {rules} rules, with {checks} checks of marks, stage and files."
        )
    }
}

/// Verifies a folder.
///
/// # Errors
/// `not-verified` where it does not hold; what keeps it from being verified.
fn proved(folder: &Path) -> Result<ProofCounts, Error> {
    let proof = terrace_verify::verify(folder, None)?;
    if !proof.ok {
        let text = format!("the folder that was made does not verify:\n{}", proof.to_text());
        return Err(Diag::bug("not-verified", text).into());
    }
    Ok(ProofCounts { rules: proof.rules.len(), checks: proof.rules.iter().map(|rule| rule.checked).sum() })
}

fn compile(
    args: &Args,
    path: &Path,
    output: Option<&Path>,
    writing: Writing,
    is_proved: bool,
    choice: &Choice,
) -> Result<(), Error> {
    let job = load(args, path, choice)?;
    let target = output.map_or_else(|| job_folder::default_output(&job.path, job.mode), Path::to_owned);
    job_folder::prepare(&target, job.mode)?;
    let steps = Steps::new(args.quiet);
    let mut phases = [plan::phases(&job), plan::phases_of_writing(&job)].concat();
    phases.retain(|phase| writing.pictures || *phase != Phase::Draw);
    let progress = steps.numbered(&phases, show::phase);
    let plan = plan_with_progress(args, job, &steps, &mut |_| {}, &progress)?;
    let proof = Cell::new(None);
    let prove = |folder: &Path| {
        proof.set(if is_proved { Some(proved(folder)?) } else { None });
        Ok(proof.get().map(ProofCounts::text))
    };
    job_folder::write_proved(&plan, &target, writing, &progress, &prove)?;
    steps.done();
    warn(args, plan.warnings());
    if path == Path::new("-") {
        let d = Diag::warning("job-from-stdin", "the job came from standard input, and verify reads it again");
        warn(args, &[d.hint(format!("keep it as {} in this folder", plan.job().path.display()))]);
    }
    report(args, &plan, plan.summary(), Some((&target, proof.get())))
}

fn planned(args: &Args, job: Job, each: &mut dyn FnMut([[f64; 3]; 3])) -> Result<Plan, Error> {
    let steps = Steps::new(args.quiet);
    let phases = plan::phases(&job);
    let plan = plan_with_progress(args, job, &steps, each, &steps.numbered(&phases, show::phase))?;
    steps.done();
    warn(args, plan.warnings());
    Ok(plan)
}

/// Plans a job; warnings of its inputs are printed first.
fn plan_with_progress(
    args: &Args,
    job: Job,
    steps: &Steps,
    each: &mut dyn FnMut([[f64; 3]; 3]),
    progress: plan::Progress<'_>,
) -> Result<Plan, Error> {
    let inputs = Inputs::load_each(&job, each, Phase::Read.task(progress))?;
    steps.suspend(|| warn(args, &inputs.warnings));
    plan::of_inputs(job, inputs, progress)
}

/// Writes warnings to stderr, each once.
fn warn(args: &Args, warnings: &[Diag]) {
    static PRINTED: Mutex<Vec<Diag>> = Mutex::new(Vec::new());
    if args.quiet {
        return;
    }
    let mut printed = PRINTED.lock().unwrap_or_else(PoisonError::into_inner);
    for w in warnings {
        if !printed.contains(w) {
            print_diag(args, w);
            printed.push(w.clone());
        }
    }
}

/// Prints the figures of a plan; of a job that was written also its folder, and what was proved of that.
fn report(
    args: &Args,
    plan: &Plan,
    summary: AnySummary,
    written: Option<(&Path, Option<ProofCounts>)>,
) -> Result<(), Error> {
    let machine = plan.machine();
    let focus = &plan.job().focus;
    if !args.json {
        return print(&(show::summary(&summary) + &show::optics(machine, focus) + &show::written(&summary, written)));
    }
    let mut json = summary.to_json();
    if let Some((_, Some(ProofCounts { rules, checks }))) = written {
        json["verified"] = serde_json::json!({"rules": rules, "checks": checks});
    }
    print(&show::json(&json))
}

/// Writes a result that is one file, never over one of the `inputs`.
fn write_file(args: &Args, path: &Path, bytes: &[u8], inputs: &[PathBuf]) -> Result<(), Error> {
    refuse_input(path, inputs)?;
    job_folder::write_file(path, bytes, durability(args))
}

/// Refuses one of the `inputs` as the file of a result.
fn refuse_input(path: &Path, inputs: &[PathBuf]) -> Result<(), Error> {
    let real = |p: &Path| std::fs::canonicalize(p).ok();
    if real(path).is_some_and(|to| inputs.iter().any(|i| real(i).as_ref() == Some(&to))) {
        let d = Diag::input("output-is-input", "the output would overwrite an input");
        return Err(d.at(Place::file(path.display().to_string())).hint("name another file").into());
    }
    Ok(())
}

/// Says which files were written.
fn wrote(args: &Args, files: &[PathBuf]) -> Result<(), Error> {
    let names: Vec<String> = files.iter().map(|f| f.display().to_string()).collect();
    print(&if args.json { show::json(&serde_json::json!({"files": names})) } else { names.join("\n") + "\n" })
}

/// Prints a schema, or writes it to a file.
fn schema_text(args: &Args, schema: String, file: Option<&Path>) -> Result<(), Error> {
    print_or_write(args, &(schema + "\n"), file)
}

/// Prints a result that is one text, or writes it to a file: in UTF-8, whatever the shell does with what is printed.
fn print_or_write(args: &Args, text: &str, file: Option<&Path>) -> Result<(), Error> {
    let Some(file) = file else { return print(text) };
    if std::fs::symlink_metadata(file).is_ok() {
        let d = Diag::input("output-exists", "the file exists already").at(Place::file(file.display().to_string()));
        return Err(d.hint("name another file, or delete this one first").into());
    }
    write_file(args, file, text.as_bytes(), &[])?;
    wrote(args, &[file.to_owned()])
}

/// A file to write: its name and its bytes.
type NamedFile = (&'static str, Vec<u8>);

/// The job to start from, and what it names.
fn sample_job() -> Vec<NamedFile> {
    vec![
        ("job.toml", job::SAMPLE_JOB.into()),
        (job::SAMPLE_SURFACE_NAME, job::sample_surface()),
        (job::SAMPLE_DRAWING_NAME, job::SAMPLE_DRAWING.into()),
        (job::SCHEMA_NAME, format!("{}\n", job::json_schema()).into_bytes()),
    ]
}

/// What docs/tutorial works with.
fn tutorial() -> Vec<NamedFile> {
    macro_rules! files {
        ($($name:literal),*) => {
            vec![$(($name, include_bytes!(concat!("../../docs/tutorial/files/", $name)).into())),*]
        };
    }
    files!["job.toml", "insert.step", "grain.svg", "mill.toml", "ladder.toml", "ladder.obj", "run.toml"]
}

/// Writes files into a folder, none over another; says what to do next with the first, a job.
fn init(args: &Args, folder: &Path, files: Vec<NamedFile>, next: &str) -> Result<(), Error> {
    let paths: Vec<PathBuf> = files.iter().map(|(name, _)| folder.join(name)).collect();
    for path in &paths {
        if std::fs::symlink_metadata(path).is_ok() {
            let d = Diag::input("init-exists", "the file exists already").at(Place::file(path.display().to_string()));
            return Err(d.hint("name an empty folder: terrace init FOLDER").into());
        }
    }
    std::fs::create_dir_all(folder)
        .map_err(|e| unwritable("make the folder", Place::file(folder.display().to_string()), &e))?;
    for (path, (_, bytes)) in paths.iter().zip(&files) {
        write_file(args, path, bytes, &[])?;
    }
    wrote(args, &paths)?;
    if !args.quiet {
        eprintln_all(&format!("next: terrace {next} {}", show::shown(&paths[0])));
    }
    Ok(())
}

fn machines(args: &Args, name: Option<&str>, output: Option<&Path>) -> Result<(), Error> {
    if let Some(name) = name {
        let machine = Machine::built_in(name)?;
        let text = PROFILES.iter().find(|(n, _)| *n == name).map_or("", |(_, t)| t);
        let value = serde_json::to_value(&machine).unwrap_or_default();
        if output.is_some() {
            return print_or_write(args, text, output);
        }
        return print(&if args.json { show::json(&value) } else { text.to_owned() });
    }
    if output.is_some() {
        let d = Diag::input("usage", "--output needs the name of a machine, or --schema");
        return Err(d.hint("terrace machines xyz-galvo-40 -o our-machine.toml").into());
    }
    if args.json {
        let names: Vec<&str> = PROFILES.iter().map(|(n, _)| *n).collect();
        return print(&show::json(&serde_json::json!(names)));
    }
    let wide = PROFILES.iter().map(|(name, _)| name.len()).max().unwrap_or(0);
    for (name, _) in PROFILES {
        let m = Machine::built_in(name)?;
        let field = m.lens.field.map(|f| f.as_mm().to_string()).join(" x ");
        let travel = m.axes().map(|(_, a)| format!("{}", a.travel[1].as_mm() - a.travel[0].as_mm())).join(" x ");
        let depth = m.depth_of_focus_mm();
        print(&format!(
            "{name:<wide$}  field {field:<9} mm, depth of focus {depth:.3} mm, travel {travel:<15} mm; {}\n",
            m.source
        ))?;
    }
    Ok(())
}
