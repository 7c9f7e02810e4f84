//! Units on a real fleet: Dask's scheduler and workers on this machine (`support/fleet.rs`), started as
//! docs/how-to/fleet.md starts them. `tests/python/setup.sh` installs Dask; without it these tests fail.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::time::Duration;
use terrace_core::math;

use serde_json::Value;
use tempfile::TempDir;

use crate::batch::{assert_whole, drawing, hidden, in_state, small_jobs, twenty};
use crate::support::fleet::{Fleet, until};
use crate::support::slurm::Slurm;
use crate::support::surfaces::{mesh, write_stl};
use crate::support::{JobText, files, folder, said, terrace};

fn path(path: &Path) -> &str {
    path.to_str().expect("UTF-8")
}

/// The report of a command that prints one.
fn report(out: &Output) -> Value {
    serde_json::from_slice(&out.stdout).unwrap_or_else(|e| panic!("{e}: {}", said(out)))
}

/// A batch on a fleet.
fn carried(fleet: &Fleet, jobs: &Path, out: &Path, more: &[&str]) -> Output {
    let args = ["batch", path(jobs), "-o", path(out), "--json"];
    fleet.terrace(args.iter().chain(more)).output().expect("it runs")
}

fn local(jobs: &Path, out: &Path) -> Output {
    terrace(["batch", path(jobs), "-o", path(out), "--json", "-j2"])
}

/// Folders of small jobs, of what a batch on this machine makes of them, and for what a fleet makes.
fn compiled_here(count: usize) -> (TempDir, [PathBuf; 3]) {
    let dir = folder();
    let all = ["jobs", "one", "two"].map(|name| dir.path().join(name));
    small_jobs(&all[0], count);
    local(&all[0], &all[1]);
    (dir, all)
}

/// A report without what names its output folder.
fn without_folders(report: &Value) -> Value {
    let mut report = report.clone();
    for job in report["jobs"].as_array_mut().expect("a list") {
        job.as_object_mut().expect("an object").remove("folder");
    }
    report
}

fn assert_same(one: &Path, two: &Path) {
    let (one, two) = (files(one), files(two));
    let names = |all: &[(String, Vec<u8>)]| all.iter().map(|f| f.0.clone()).collect::<Vec<_>>();
    assert_eq!(names(&one), names(&two));
    one.iter().zip(&two).for_each(|(a, b)| assert!(a == b, "{} differs", a.0));
}

/// How many units a run gave to the engine.
fn given(out: &Output) -> usize {
    let text = String::from_utf8_lossy(&out.stderr).into_owned();
    let line = text.lines().find(|line| line.contains(" groups for "));
    line.map_or(0, |line| line.split(' ').next().and_then(|n| n.parse().ok()).expect("a number"))
}

#[test]
#[ignore = "slow: make test-all"]
fn a_fleet_gives_the_bytes_and_the_report_of_a_local_batch_and_runs_what_has_changed() {
    let dir = folder();
    let [jobs, one, two] = ["jobs", "one", "two"].map(|name| dir.path().join(name));
    std::fs::create_dir(&jobs).expect("made");
    twenty(&jobs);
    let fleet = Fleet::of(2);
    let here = local(&jobs, &one);
    let there = carried(&fleet, &jobs, &two, &[]);
    assert_eq!((here.status.code(), there.status.code()), (Some(2), Some(2)), "{}", said(&there));
    assert_eq!(without_folders(&report(&here)), without_folders(&report(&there)));
    assert_eq!((given(&there), hidden(&two)), (20, Vec::<PathBuf>::new()), "{}", said(&there));
    // Job files are named relative to their folders, so folders of the same depth hold the same bytes.
    assert_same(&one, &two);
    // Nothing has changed: the engine is given the three that failed.
    let again = carried(&fleet, &jobs, &two, &[]);
    assert_eq!((given(&again), in_state(&report(&again), "unchanged").len()), (3, 17), "{}", said(&again));
    drawing(&jobs.join("a.svg"), 7);
    let changed = carried(&fleet, &jobs, &two, &[]);
    assert_eq!(in_state(&report(&changed), "compiled"), ["b08", "b13", "b14"]);
    assert_eq!(given(&changed), 6, "{}", said(&changed));
    // Every folder is verified, by the workers.
    let verified = carried(&fleet, &jobs, &two, &["--verify"]);
    let report = report(&verified);
    assert_eq!(report["jobs"].as_array().expect("jobs").iter().filter(|j| j["verified"] == true).count(), 17);

    // Two fleets on the same output at once, and a batch on this machine.
    let three = dir.path().join("three");
    let start = |fleet: &Fleet| fleet.terrace(["batch", path(&jobs), "-o", path(&three), "--json"]).spawn();
    let running = [start(&fleet).expect("it runs"), start(&fleet).expect("it runs")];
    local(&jobs, &three);
    for child in running {
        let out = child.wait_with_output().expect("ended");
        assert_eq!(out.status.code(), Some(2), "{}", said(&out));
    }
    local(&jobs, &one);
    assert_same(&one, &three);
    assert_eq!(hidden(&three), Vec::<PathBuf>::new());
}

/// Holds a job's folder as a batch at work does: whoever wants to compile it waits.
struct Held(PathBuf, std::fs::File);

impl Held {
    fn new(out: &Path, name: &str) -> Self {
        std::fs::create_dir_all(out).expect("made");
        let path = out.join(format!(".{name}.job.claim"));
        let file = std::fs::File::create(&path).expect("created");
        file.lock().expect("locked");
        Self(path, file)
    }
}

impl Drop for Held {
    fn drop(&mut self) {
        std::fs::remove_file(&self.0).expect("still there");
        let _ = self.1.unlock();
    }
}

#[test]
#[ignore = "slow: make test-all"]
fn a_killed_worker_and_a_killed_scheduler_cost_no_unit() {
    let (_dir, [jobs, one, two]) = compiled_here(6);
    let mut fleet = Fleet::of(2);
    // Both workers are at work on a unit that does not end.
    let held = ["s0", "s1"].map(|name| Held::new(&two, name));
    let run = fleet.terrace(["batch", path(&jobs), "-o", path(&two), "--json"]).spawn().expect("it runs");
    until("the workers are at work", Duration::from_secs(60), || fleet.is_busy(0) && fleet.is_busy(1));
    fleet.kill_worker(0);
    until("the worker is back at work", Duration::from_secs(60), || fleet.is_busy(0));
    fleet.kill_scheduler();
    fleet.start_scheduler();
    drop(held);
    let out = run.wait_with_output().expect("ended");
    assert_eq!(out.status.code(), Some(0), "{}\n{}", said(&out), fleet.said());
    assert!(said(&out).contains("the scheduler is back"), "{}", said(&out));
    assert_same(&one, &two);
    assert_eq!(hidden(&two), Vec::<PathBuf>::new());
}

#[test]
#[ignore = "slow: make test-all"]
fn a_stopped_run_names_the_missing_units_and_the_next_one_does_them() {
    let (_dir, [jobs, one, two]) = compiled_here(4);
    let fleet = Fleet::of(1);
    let held = Held::new(&two, "s1");
    let run = fleet.terrace(["batch", path(&jobs), "-o", path(&two), "--json"]).spawn().expect("it runs");
    let at_second = || two.join("s0.job").exists() && fleet.is_busy(0);
    until("the second unit is at work", Duration::from_secs(60), at_second);
    // Ctrl-C at this program: the engine is asked to begin nothing more.
    assert!(Command::new("kill").args(["-INT", &run.id().to_string()]).status().expect("kill starts").success());
    let out = run.wait_with_output().expect("ended");
    let first = report(&out);
    let missing = in_state(&first, "missing");
    assert!(
        out.status.code() == Some(1) && missing.ends_with(&["s1", "s2", "s3"].map(str::to_owned)),
        "{}",
        said(&out)
    );
    let error = &first["jobs"][3]["errors"][0];
    assert!(error["code"] == "unit-missing" && error["message"].to_string().contains("stopped"), "{error}");
    drop(held);
    // What a killed run has left goes too.
    std::fs::create_dir(two.join(".fleet-other-1")).expect("made");
    std::fs::write(two.join(".fleet-other-1/lock"), "").expect("written");
    let second = carried(&fleet, &jobs, &two, &[]);
    assert_eq!(second.status.code(), Some(0), "{}", said(&second));
    assert!(given(&second) <= 3, "what is there is not done again: {}", said(&second));
    assert_same(&one, &two);
    assert_eq!(hidden(&two), Vec::<PathBuf>::new());
}

#[test]
#[ignore = "slow: make test-all"]
fn a_scheduler_that_is_not_there_is_reported_with_the_command_that_starts_it() {
    let dir = folder();
    let jobs = dir.path().join("jobs");
    small_jobs(&jobs, 1);
    let fleet = Fleet::without_workers();
    let out = carried(&fleet, &jobs, &dir.path().join("out"), &[]);
    let text = said(&out);
    assert!(out.status.code() == Some(1) && text.contains("error[engine-workers]"), "{text}");
    assert!(text.contains(&format!("dask worker {}", fleet.address())), "{text}");
    let address = fleet.address();
    drop(fleet);
    let run = |python: &str| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_terrace"));
        command.args(["batch", path(&jobs), "--engine", "dask", "--scheduler", &address]).env("TERRACE_PYTHON", python);
        command.output().expect("it runs")
    };
    let out = run(path(&crate::support::fleet::python()));
    let text = said(&out);
    assert!(out.status.code() == Some(2) && text.contains("error[engine-unreachable]"), "{text}");
    assert!(text.contains("dask scheduler") && text.contains("dask worker"), "{text}");
    let out = run("/nowhere/python3");
    let text = said(&out);
    assert!(out.status.code() == Some(2) && text.contains("error[engine-absent]") && text.contains("pip"), "{text}");
}

#[test]
#[ignore = "slow: make test-all"]
fn a_sweep_on_a_fleet_is_the_sweep_on_this_machine() {
    let dir = folder();
    let stl = dir.path().join("wave.stl");
    write_stl(&stl, &mesh(12, [0.0, 0.0, 60.0, 40.0], |x, y| 0.4 * math::sin(x / 19.0) * math::cos(y / 17.0)));
    let job = JobText::on(&stl).texture("pattern = \"hatch\"\npitch = \"3 mm\"").write(dir.path(), "wave.toml");
    let settings = ["--set", "focus.pdof=0.05..0.15mm/3", "--set", "partition.method=contour,z-range,no-method"];
    let fleet = Fleet::of(2);
    let args = ["sweep", path(&job), "--json", "-o"];
    let [one, two] = ["one.csv", "two.csv"].map(|name| dir.path().join(name));
    let here = terrace(args.iter().copied().chain([path(&one)]).chain(settings));
    let there = fleet.terrace(args.iter().copied().chain([path(&two)]).chain(settings)).output().expect("it runs");
    assert!(here.status.success() && there.status.success(), "{}{}", said(&here), said(&there));
    assert_eq!(String::from_utf8_lossy(&here.stdout), String::from_utf8_lossy(&there.stdout));
    assert_eq!(std::fs::read(&one).expect("a table"), std::fs::read(&two).expect("a table"));
    assert_eq!(report(&here)["sweep"].as_array().map(Vec::len), Some(9));
    // Where no combination can be planned both say the same.
    let none = ["--set", "focus.pdof=9mm,8mm"];
    let here = terrace(["sweep", path(&job)].into_iter().chain(none));
    let there = fleet.terrace(["sweep", path(&job), "-q"].into_iter().chain(none)).output().expect("it runs");
    assert_eq!((here.status.code(), &here.stderr), (there.status.code(), &there.stderr), "{}", said(&there));
}

// --- Units without an engine

/// A file of the units of small jobs.
fn planned(dir: &Path, count: usize, more: &[&str]) -> (PathBuf, PathBuf) {
    let [jobs, out, units] = ["jobs", "out", "units.jsonl"].map(|name| dir.join(name));
    small_jobs(&jobs, count);
    let args = ["batch", path(&jobs), "-o", path(&out), "--plan", path(&units)];
    let made = terrace(args.iter().chain(more));
    assert!(made.status.success() && !out.exists(), "{}", said(&made));
    (units, out)
}

fn unit(units: &Path, which: &str, more: &[&str]) -> Output {
    terrace(["batch", "--units", path(units), "--unit", which].iter().chain(more))
}

fn collected(units: &Path) -> (Output, Value) {
    let out = terrace(["batch", "--collect", path(units), "--json"]);
    let value = report(&out);
    (out, value)
}

#[test]
#[ignore = "slow: make test-all"]
fn units_are_worked_on_in_any_order_and_collected() {
    let dir = folder();
    let (units, out) = planned(dir.path(), 5, &[]);
    let lines: Vec<Value> = std::fs::read_to_string(&units)
        .expect("the units")
        .lines()
        .map(|line| serde_json::from_str(line).expect("JSON"))
        .collect();
    assert_eq!(lines.len(), 5);
    assert!(
        lines
            .iter()
            .enumerate()
            .all(|(i, u)| u["id"] == i && u["name"] == format!("s{i}") && u["cost_s"].as_f64() > Some(0.0))
    );
    let (first, report) = collected(&units);
    assert_eq!((first.status.code(), &report["missing"]), (Some(1), &5.into()));
    for which in ["3", "2/2", "1/2"] {
        assert!(unit(&units, which, &[]).status.success());
    }
    let (all, report) = collected(&units);
    assert_eq!((all.status.code(), report["jobs"].as_array().map(Vec::len)), (Some(0), Some(5)), "{report}");
    // Unit 3 was done twice.
    assert_eq!((in_state(&report, "unchanged"), &report["compiled"]), (vec!["s3".to_owned()], &4.into()));
    let one = dir.path().join("one");
    local(&dir.path().join("jobs"), &one);
    assert_same(&one, &out);
    assert_eq!(hidden(&out), Vec::<PathBuf>::new());

    // A report is of the inputs that were planned, and of a folder that is here.
    let job = dir.path().join("jobs/s1.toml");
    let text = std::fs::read_to_string(&job).expect("the job");
    std::fs::write(&job, format!("{text}# changed\n")).expect("written");
    assert!(unit(&units, "1", &[]).status.success());
    std::fs::remove_dir_all(out.join("s2.job")).expect("removed");
    let (_, report) = collected(&units);
    let message = |i: usize| report["jobs"][i]["errors"][0]["message"].to_string();
    assert_eq!(in_state(&report, "missing"), ["s1", "s2"]);
    assert!(message(1).contains("has changed since") && message(2).contains("is not here"), "{report}");
    // The text and the page name them too.
    let index = dir.path().join("index.html");
    let shown = terrace(["batch", "--collect", path(&units), "--index", path(&index)]);
    assert!(said(&shown).contains("2 unchanged") || said(&shown).contains("1 unchanged"), "{}", said(&shown));
    assert!(said(&shown).contains("2 missing") && said(&shown).contains("error[unit-missing]"), "{}", said(&shown));
    assert!(std::fs::read_to_string(index).expect("the page").contains("<b>missing</b>"));

    let wrong = unit(&units, "5", &[]);
    assert!(wrong.status.code() == Some(2) && said(&wrong).contains("unit-unknown"), "{}", said(&wrong));
    std::fs::write(&units, "{\"id\": 0}\n").expect("written");
    let wrong = unit(&units, "0", &[]);
    assert!(said(&wrong).contains("error[units-file]") && said(&wrong).contains("units.jsonl:1"), "{}", said(&wrong));
    let line = lines[0].to_string().replace("\"terrace\":\"", "\"terrace\":\"0.0.0-");
    std::fs::write(&units, line).expect("written");
    assert!(said(&unit(&units, "0", &[])).contains("error[units-version]"));
}

/// A surface whose mesh takes far more memory than the small jobs.
fn large_job(jobs: &Path, name: &str) {
    write_stl(&jobs.join("large.stl"), &mesh(800, [0.0, 0.0, 60.0, 60.0], |x, y| 0.1 * x + 0.05 * y));
    JobText::on(Path::new("large.stl")).texture("pattern = \"hatch\"\npitch = \"5 mm\"").write(jobs, name);
}

#[test]
#[ignore = "slow: make test-all"]
fn a_unit_that_exceeds_its_memory_fails_alone_and_leaves_nothing() {
    let dir = folder();
    let jobs = dir.path().join("jobs");
    small_jobs(&jobs, 3);
    large_job(&jobs, "s1a.toml");
    let [out, units] = ["out", "units.jsonl"].map(|name| dir.path().join(name));
    assert!(terrace(["batch", path(&jobs), "-o", path(&out), "--plan", path(&units)]).status.success());
    let run = unit(&units, "0-3", &["--memory", "90MB", "-j1"]);
    assert_eq!(run.status.code(), Some(1), "{}", said(&run));
    let (_, report) = collected(&units);
    assert_eq!(in_state(&report, "failed"), ["s1a"], "{report}");
    assert_eq!(report["compiled"], 3, "{report}");
    let failed = report["jobs"].as_array().expect("jobs").iter().find(|j| j["state"] == "failed").expect("one");
    let error = &failed["errors"][0];
    assert!(error["code"] == "memory" || error["code"] == "unit-memory", "{error}");
    assert!(error["message"].to_string().contains("memory"), "{error}");
    assert_eq!(hidden(&out), Vec::<PathBuf>::new());
    // With enough memory it is the only one that is done.
    let run = unit(&units, "0-3", &["--memory", "2GB", "-j1"]);
    assert!(run.status.success(), "{}", said(&run));
    let (_, report) = collected(&units);
    assert_eq!((in_state(&report, "compiled"), &report["unchanged"]), (vec!["s1a".to_owned()], &3.into()));
}

#[test]
fn a_limit_of_memory_without_units_of_its_own_is_refused() {
    let dir = folder();
    let jobs = dir.path().join("jobs");
    small_jobs(&jobs, 1);
    for command in ["batch", "sweep"] {
        let job = jobs.join("s0.toml");
        let done = terrace([command, path(&job), "--memory", "20MB"]);
        let text = said(&done);
        assert_eq!(done.status.code(), Some(2), "{command}: {text}");
        assert!(text.contains("--engine"), "{command}: {text}");
    }
}

#[test]
fn a_process_that_is_killed_in_the_middle_of_a_unit_fails_that_unit_only() {
    let dir = folder();
    let (units, out) = planned(dir.path(), 4, &[]);
    // The second job takes seconds: it is found at work on a busy machine too.
    let job = dir.path().join("jobs/s1.toml");
    let text = std::fs::read_to_string(&job).expect("readable").replace("\"5 mm\"", "\"0.01 mm\"");
    std::fs::write(&job, text).expect("written");
    let args = ["batch", path(&dir.path().join("jobs")), "-o", path(&out), "--plan", path(&units)].map(str::to_owned);
    assert!(terrace(&args).status.success());
    let mut command = Command::new(env!("CARGO_BIN_EXE_terrace"));
    command.args(["batch", "--units", path(&units), "--unit", "0-3", "--memory", "0", "--no-sync"]);
    let run = command.stdout(std::process::Stdio::piped()).spawn().expect("it runs");
    until("the second unit is at work", Duration::from_secs(60), || out.join(".s1.job.claim").exists());
    let child = Command::new("pgrep").args(["-P", &run.id().to_string()]).output().expect("pgrep starts");
    let child = String::from_utf8_lossy(&child.stdout).trim().to_owned();
    assert!(Command::new("kill").args(["-KILL", &child]).status().expect("kill starts").success());
    assert_eq!(run.wait_with_output().expect("ended").status.code(), Some(1));
    assert_eq!(hidden(&out), Vec::<PathBuf>::new());
    let (_, report) = collected(&units);
    assert_eq!(in_state(&report, "failed"), ["s1"], "{report}");
    let error = &report["jobs"][1]["errors"][0];
    assert!(error["code"] == "unit-ended" && error["message"].to_string().contains("signal: 9"), "{error}");
    assert_eq!(report["compiled"], 3);
}

// --- Slow: make test-all

/// Two hundred jobs whose cost differs by a factor of a hundred, six of them broken.
fn two_hundred(jobs: &Path) {
    small_jobs(jobs, 1);
    std::fs::remove_file(jobs.join("s0.toml")).expect("removed");
    for i in 0..200 {
        // Marks, and with them the cost, are inversely proportional to the pitch.
        let pitch = 12.0 / f64::from(1 + (i * 37) % 100);
        let keys = format!("pattern = \"hatch\"\npitch = \"{pitch:.4} mm\"\ndirection = \"{} deg\"", i % 180);
        JobText::on(Path::new("slope.stl")).texture(&keys).write(jobs, &format!("t{i:03}.toml"));
    }
    for i in [7, 33, 71, 120, 163, 199] {
        std::fs::write(jobs.join(format!("t{i:03}.toml")), "[surface]\nfile = 7\n").expect("written");
    }
}

#[test]
#[ignore = "slow: make test-all"]
fn two_hundred_jobs_on_a_fleet_are_those_of_a_batch_whatever_is_killed() {
    let dir = folder();
    let [jobs, one, two] = ["jobs", "one", "two"].map(|name| dir.path().join(name));
    two_hundred(&jobs);
    let here = local(&jobs, &one);
    let mut fleet = Fleet::of(2);
    let run = fleet.terrace(["batch", path(&jobs), "-o", path(&two), "--json"]).spawn().expect("it runs");
    let done = || {
        std::fs::read_dir(&two)
            .map_or(0, |all| all.flatten().filter(|f| !f.file_name().to_string_lossy().starts_with('.')).count())
    };
    until("a tenth is done", Duration::from_secs(600), || done() > 20);
    fleet.kill_worker(0);
    until("a quarter is done", Duration::from_secs(600), || done() > 50);
    fleet.kill_scheduler();
    std::thread::sleep(Duration::from_secs(3));
    fleet.start_scheduler();
    let there = run.wait_with_output().expect("ended");
    assert_eq!((here.status.code(), there.status.code()), (Some(2), Some(2)), "{}\n{}", said(&there), fleet.said());
    let mut two_report = without_folders(&report(&there));
    // A unit whose first report was lost with the scheduler is found unchanged when it is given again.
    for job in two_report["jobs"].as_array_mut().expect("jobs").iter_mut().filter(|j| j["state"] == "unchanged") {
        job["state"] = "compiled".into();
    }
    (two_report["compiled"], two_report["unchanged"]) = (194.into(), 0.into());
    assert_eq!(without_folders(&report(&here)), two_report);
    assert_same(&one, &two);
    assert_eq!(hidden(&two), Vec::<PathBuf>::new());

    // Nothing changed but six that cannot be compiled; then three changed.
    let again = carried(&fleet, &jobs, &two, &[]);
    assert_eq!((given(&again), in_state(&report(&again), "unchanged").len()), (6, 194), "{}", said(&again));
    for i in [3, 90, 150] {
        let job = jobs.join(format!("t{i:03}.toml"));
        let text = std::fs::read_to_string(&job).expect("readable");
        std::fs::write(&job, text + "# changed\n").expect("written");
    }
    let changed = carried(&fleet, &jobs, &two, &[]);
    assert_eq!(in_state(&report(&changed), "compiled"), ["t003", "t090", "t150"], "{}", said(&changed));
}

#[test]
#[ignore = "slow: make test-all"]
fn two_thousand_small_units_are_grouped() {
    let dir = folder();
    let [jobs, out] = ["jobs", "out"].map(|name| dir.path().join(name));
    small_jobs(&jobs, 2000);
    let fleet = Fleet::of(2);
    let done = carried(&fleet, &jobs, &out, &[]);
    assert_eq!(done.status.code(), Some(0), "{}", said(&done));
    assert_eq!(report(&done)["compiled"], 2000);
    let text = said(&done);
    let line = text.lines().find(|line| line.starts_with("2000 units in ")).expect("a line with the groups");
    let groups: usize = line.split(' ').nth(3).and_then(|n| n.parse().ok()).expect("a number");
    assert!((16..=200).contains(&groups), "{line}");
    (0..2000).step_by(97).for_each(|i| assert_whole(&out.join(format!("s{i}.job"))));
}

/// A worker for which `out` is a disk of its own, filled to the last `free` KB.
fn worker_with_own_disk(fleet: &mut Fleet, out: &Path, kb: usize, is_full: bool) {
    std::fs::create_dir_all(out).expect("made");
    let fill = if is_full {
        format!("dd if=/dev/zero of='{0}/.fill' bs=1k count={kb} 2>/dev/null || true; ", out.display())
    } else {
        String::new()
    };
    let mount = format!(
        "mount -t tmpfs -o size={kb}k own '{}' || {{ echo 'cannot mount: this test needs root'; exit 1; }}; {fill}exec \"$@\"",
        out.display()
    );
    fleet.worker(&["unshare", "-m", "sh", "-c", &mount, "sh"]);
}

/// A worker that sees something else than the others: `set_up` is a script of its own mounts.
fn worker_after(fleet: &mut Fleet, set_up: &str) {
    let script = format!("{{ {set_up}; }} || {{ echo 'cannot mount: this test needs root'; exit 1; }}; exec \"$@\"");
    fleet.worker(&["unshare", "-m", "sh", "-c", &script, "sh"]);
}

#[test]
#[ignore = "slow: make test-all"]
fn a_worker_that_cannot_work_is_named_once_and_the_others_do_its_units() {
    let (_dir, [jobs, one, two]) = compiled_here(60);
    let program = env!("CARGO_BIN_EXE_terrace");
    let fakes = folder();
    let fake = |name: &str, version: &str| {
        let path = fakes.path().join(name);
        let script = format!(
            "#!/bin/sh\ncase $1 in --version) echo terrace {version};; *) echo 'error[broken]: no arm' >&2; exit 7;; esac\n"
        );
        std::fs::write(&path, script).expect("written");
        assert!(Command::new("chmod").arg("+x").arg(&path).status().expect("chmod starts").success());
        format!("mount --bind '{}' '{program}'", path.display())
    };
    let unshared = format!("mkdir -p '{0}' && mount -t tmpfs own '{0}'", two.display());
    let kinds = [
        // No share; the folder is there.
        (unshared, "is the folder shared?", &[][..]),
        (fake("old", "0.0.1"), "is terrace 0.0.1, this is terrace", &[][..]),
        // It passes the first look, and ends every group without a report.
        (fake("broken", env!("CARGO_PKG_VERSION")), "error[broken]: no arm", &[][..]),
        ("ulimit -v 1500000".into(), "its limit of memory (ulimit -v) is 1464 MB, below", &["--memory", "2GB"][..]),
    ];
    for (set_up, why, more) in kinds {
        let mut fleet = Fleet::of(2);
        worker_after(&mut fleet, &set_up);
        fleet.wait(3);
        let done = carried(&fleet, &jobs, &two, more);
        let text = said(&done);
        assert_eq!(done.status.code(), Some(0), "{set_up}: {text}\n{}", fleet.said());
        let named: Vec<&str> = text.lines().filter(|line| line.contains("is set aside")).collect();
        assert!(named.len() == 1 && named[0].starts_with("worker worker2 (tcp://"), "{set_up}: {text}");
        assert!(named[0].contains(why), "{set_up}: {text}");
        assert_same(&one, &two);
        std::fs::remove_dir_all(&two).expect("removed");
    }
}

#[test]
#[ignore = "slow: make test-all"]
fn a_fleet_without_a_worker_that_can_work_says_why_and_does_nothing() {
    let (_dir, [jobs, _, two]) = compiled_here(2);
    let mut fleet = Fleet::without_workers();
    worker_after(&mut fleet, &format!("mkdir -p '{0}' && mount -t tmpfs own '{0}'", two.display()));
    fleet.wait(1);
    let done = carried(&fleet, &jobs, &two, &[]);
    let text = said(&done);
    assert!(done.status.code() == Some(1) && text.contains("error[engine-workers]"), "{text}");
    assert!(text.contains("worker0 (tcp://") && text.contains("is the folder shared?"), "{text}");
}

#[test]
#[ignore = "slow: make test-all"]
fn a_lower_limit_of_memory_of_a_worker_costs_no_unit_that_fits() {
    let (_dir, [jobs, one, two]) = compiled_here(6);
    let mut fleet = Fleet::without_workers();
    fleet.worker(&["sh", "-c", "ulimit -v 1500000; exec \"$@\"", "sh"]);
    fleet.wait(1);
    let done = carried(&fleet, &jobs, &two, &[]);
    assert_eq!(done.status.code(), Some(0), "{}\n{}", said(&done), fleet.said());
    assert_same(&one, &two);
}

#[test]
#[ignore = "slow: make test-all"]
fn a_frozen_worker_is_named_and_its_units_go_to_the_others_one_of_which_is_started_again() {
    let (_dir, [jobs, one, two]) = compiled_here(60);
    let fleet = Fleet::of(3);
    // All wait for folders; then one is frozen, as a computer that sleeps, and one is killed and started again.
    let held: Vec<Held> = (0..60).map(|i| Held::new(&two, &format!("s{i}"))).collect();
    let running = fleet.terrace(["batch", path(&jobs), "-o", path(&two), "--json"]).spawn().expect("it runs");
    until("all workers are at work", Duration::from_secs(60), || (0..3).all(|worker| fleet.is_busy(worker)));
    let begin = std::time::Instant::now();
    fleet.freeze_worker(0);
    fleet.kill_worker(1);
    drop(held);
    let done = running.wait_with_output().expect("ended");
    fleet.thaw_worker(0);
    let text = said(&done);
    assert_eq!(done.status.code(), Some(0), "{text}\n{}", fleet.said());
    assert!(text.contains("worker worker0 (tcp://") && text.contains("nothing has been heard of it"), "{text}");
    assert!(begin.elapsed() < Duration::from_secs(150), "{:?}", begin.elapsed());
    assert_same(&one, &two);
}

#[test]
#[ignore = "slow: make test-all"]
fn a_full_disk_of_one_worker_costs_no_unit_and_folders_that_are_elsewhere_are_missing() {
    let probe = Command::new("unshare").args(["-m", "true"]).status().expect("unshare of util-linux is installed");
    assert!(probe.success(), "a disk of its own for one worker needs root (unshare -m, mount)");
    let dir = folder();
    let [jobs, one, two, three, units] =
        ["jobs", "one", "two", "three", "units.jsonl"].map(|name| dir.path().join(name));
    small_jobs(&jobs, 12);
    local(&jobs, &one);

    // Only the worker with the full disk: every unit has failed, and the report says why.
    let mut fleet = Fleet::without_workers();
    worker_with_own_disk(&mut fleet, &two, 64, true);
    fleet.wait(1);
    let keep = ["--plan", path(&units)];
    let full = carried(&fleet, &jobs, &two, &keep);
    let found = report(&full);
    assert_eq!((full.status.code(), &found["failed"]), (Some(2), &12.into()), "{}\n{}", said(&full), fleet.said());
    let error = &found["jobs"][0]["errors"][0];
    assert!(error["code"] == "output-unwritable" && error["message"].to_string().contains("No space"), "{error}");
    assert_eq!(files(&two), Vec::new(), "nothing of it is on the shared disk");
    // Another worker beside it: every unit is done, by that one, and the first is named.
    fleet.worker(&[]);
    fleet.wait(2);
    let both = carried(&fleet, &jobs, &two, &keep);
    assert_eq!(both.status.code(), Some(0), "{}", said(&both));
    let named = said(&both).matches("could not be written on worker0 (tcp://").count();
    assert_eq!(named, 1, "{}", said(&both));
    assert_same(&one, &two);
    assert_eq!(hidden(&two), Vec::<PathBuf>::new());
    drop(fleet);

    // A disk of its own with room: the folders are not here, and the report names the machine.
    let mut fleet = Fleet::without_workers();
    worker_with_own_disk(&mut fleet, &three, 100_000, false);
    fleet.wait(1);
    let away = carried(&fleet, &jobs, &three, &keep);
    let found = report(&away);
    assert_eq!((away.status.code(), &found["missing"]), (Some(1), &12.into()), "{}", said(&away));
    assert!(found["jobs"][0]["errors"][0]["message"].to_string().contains("is not here"), "{found}");
}

#[test]
#[ignore = "slow: make test-all"]
fn a_unit_that_exceeds_its_memory_on_a_fleet_is_named_and_all_others_finish() {
    let dir = folder();
    let [jobs, out] = ["jobs", "out"].map(|name| dir.path().join(name));
    small_jobs(&jobs, 8);
    large_job(&jobs, "s1a.toml");
    let mut fleet = Fleet::of(2);
    let done = carried(&fleet, &jobs, &out, &["--memory", "90MB"]);
    let found = report(&done);
    assert_eq!((done.status.code(), in_state(&found, "failed")), (Some(1), vec!["s1a".to_owned()]), "{}", said(&done));
    assert_eq!(found["compiled"], 8);
    assert_eq!(hidden(&out), Vec::<PathBuf>::new());
    let more = carried(&fleet, &jobs, &out, &["--memory", "2GB"]);
    assert_eq!((more.status.code(), given(&more)), (Some(0), 1), "{}", said(&more));
    // More than any worker has.
    let most = carried(&fleet, &jobs, &dir.path().join("most"), &["--memory", "9000GB"]);
    assert!(most.status.code() == Some(1) && said(&most).contains("error[engine-workers]"), "{}", said(&most));
    fleet.end_worker(0);
}

#[test]
#[ignore = "slow: make test-all"]
fn the_script_for_slurm_in_the_documents_gives_the_bytes_of_a_local_batch() {
    let page = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/docs/how-to/fleet.md")).expect("the page");
    let script = page.split("```sh slurm\n").nth(1).and_then(|rest| rest.split("```").next()).expect("the script");
    assert!(script.lines().count() <= 10, "ten lines of shell");
    let dir = folder();
    let [jobs, out, one] = ["jobs", "out", "one"].map(|name| dir.path().join(name));
    std::fs::create_dir(&jobs).expect("made");
    twenty(&jobs);
    // Warnings name files as they were typed.
    let mut here = Command::new(env!("CARGO_BIN_EXE_terrace"));
    here.args(["batch", "jobs", "-o", "one", "--no-sync"]).current_dir(dir.path());
    assert_eq!(here.output().expect("it runs").status.code(), Some(2));
    let slurm = Slurm::start();
    let program = Path::new(env!("CARGO_BIN_EXE_terrace")).parent().expect("a folder");
    let path = format!("{}:{}", program.display(), std::env::var("PATH").unwrap_or_default());
    let run = || {
        let mut command = slurm.command("sh");
        command.args(["-c", script]).current_dir(dir.path()).env("PATH", &path).output().expect("sh starts")
    };
    let first = run();
    assert_eq!(first.status.code(), Some(2), "{}", said(&first));
    assert!(said(&first).contains("17 compiled, 0 unchanged, 3 failed"), "{}", said(&first));
    assert_same(&one, &without_results(&out));
    // Again: only what failed, and what has changed since, is done.
    std::fs::remove_dir_all(out.join("b05.job")).expect("removed");
    let second = run();
    assert!(said(&second).contains("1 compiled, 16 unchanged, 3 failed"), "{}", said(&second));
    assert_same(&one, &without_results(&out));
    assert_eq!(hidden(&out), Vec::<PathBuf>::new());
}

/// The output folder without the report and the page that the script writes into it.
fn without_results(out: &Path) -> PathBuf {
    ["batch.json", "index.html"].iter().for_each(|name| std::fs::remove_file(out.join(name)).expect("written"));
    out.to_owned()
}
