//! Many jobs through the program: faults stay where they are, what is unchanged is skipped, and a run
//! that was killed leaves nothing half done.

use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};
use terrace_core::math;

use crate::support::image::height_map;
use crate::support::surfaces::{Random, mesh, write_stl};
use crate::support::{JobText, files, folder, machine_file, number, said, terrace, verify};
use serde_json::Value;

fn write(path: &Path, bytes: impl AsRef<[u8]>) {
    std::fs::write(path, bytes).expect("a writable folder");
}

/// A height map of 40 x 30 samples.
fn heightmap(path: &Path) {
    let samples: Vec<u16> = (0..1200u32).map(|i| (i % 40 * 900 + i / 40 * 500) as u16).collect();
    write(path, height_map(40, &samples));
}

pub(crate) fn drawing(path: &Path, radius: u32) {
    write(
        path,
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"30mm\" height=\"20mm\" viewBox=\"0 0 30 20\">\
             <circle cx=\"15\" cy=\"10\" r=\"{radius}\"/><path d=\"M1 1 L29 19 M2 18 C10 0 20 0 28 18\"/></svg>"
        ),
    );
}

const HATCH: &str = "pattern = \"hatch\"\npitch = \"3 mm\"";
const DRAWING: &str = "file = \"a.svg\"\norigin = [\"5 mm\", \"5 mm\"]";
/// The jobs that fail, with the code of their error.
const BROKEN: [(&str, &str); 3] = [("b07", "toml"), ("b11", "file-unreadable"), ("b15", "travel")];

/// Twenty jobs in `dir`, three of them broken.
pub(crate) fn twenty(dir: &Path) {
    let path = |name: &str| dir.join(name);
    write_stl(&path("panel.stl"), &mesh(20, [0.0, 0.0, 60.0, 50.0], |x, y| 0.01 * x + 0.2 * math::sin(y / 9.0)));
    write(&path("plate.obj"), "v 0 0 0\nv 70 0 0\nv 70 60 0\nv 0 60 0\nf 1 2 3 4\n");
    write(&path("long.obj"), "v 0 0 0\nv 900 0 0\nv 900 9 0\nv 0 9 0\nf 1 2 3 4\n");
    heightmap(&path("map.png"));
    drawing(&path("a.svg"), 6);
    drawing(&path("b.svg"), 4);
    write(&path("ours.toml"), terrace(["machines", "xyz-galvo-100"]).stdout);
    let panel = || JobText::on(Path::new("panel.stl"));
    let plate = || JobText::on(Path::new("plate.obj"));
    let map = || {
        let mut job = JobText::on(Path::new("map.png"));
        job.surface = "file = \"map.png\"\n[surface.heightmap]\npixel = \"1.5 mm\"\nz = [\"0 mm\", \"1 mm\"]".into();
        job
    };
    let with = |mut job: JobText, focus: &str, machine: &str, more: &str| {
        if !focus.is_empty() {
            job.focus = focus.into();
        }
        if !machine.is_empty() {
            job.machine = machine.into();
        }
        job.more = more.into();
        job
    };
    let fine = "[[pen]]\nname = \"fine\"\nspeed = \"300 mm/s\"\npower = \"8 W\"\nfrequency = \"80 kHz\"\npasses = 2\n";
    let jobs = [
        panel().texture(HATCH),
        panel().texture(&format!("{HATCH}\ndirection = \"30 deg\"")).method("z-range"),
        panel().texture(&format!("{HATCH}\ndirection = \"90 deg\"")).method("auto"),
        panel().texture("pattern = \"squares\"\npitch = \"3 mm\"\ncell = \"2 mm\""),
        panel().texture("pattern = \"circles\"\npitch = \"4 mm\"\ncell = \"3 mm\""),
        panel().texture("pattern = \"hilbert\"\norder = 5"),
        panel().texture(HATCH), // b07, to be broken
        plate().texture(DRAWING),
        plate().texture("file = \"b.svg\"\narea = \"part\"\ntile = true"),
        panel().texture("file = \"b.svg\"\norigin = [\"10 mm\", \"10 mm\"]\nsize = [\"40 mm\", \"30 mm\"]"),
        JobText::on(Path::new("absent.stl")).texture(HATCH), // b11
        map().texture(HATCH),
        map().texture(DRAWING).method("z-range"),
        with(panel().texture(HATCH).texture(&format!("{DRAWING}\npen = \"fine\"")), "", "", fine),
        JobText::on(Path::new("long.obj")).texture(HATCH), // b15
        with(panel().texture(HATCH), "", "", "[placement]\nturn = \"33 deg\"\n"),
        with(panel().texture(HATCH), "", "", "[emit]\nformats = [\"dxf\", \"linuxcnc\", \"gcode\", \"ovf\"]\n"),
        with(panel().texture(HATCH), "pdof = \"0.1 mm\"\nrule = \"half\"", "", "[emit]\nformats = [\"ovf\"]\n"),
        with(panel().texture(HATCH), "dof = \"0.06 mm\"\nfactor = 1.2\nlevel = \"mean\"", "", ""),
        with(panel().texture(HATCH), "", "file = \"ours.toml\"", ""),
    ];
    for (i, job) in jobs.iter().enumerate() {
        job.write(dir, &format!("b{:02}.toml", i + 1));
    }
    write(&path("b07.toml"), "[surface]\nfile = \"panel.stl\"\nunit = mm\n");
}

fn batch(jobs: &Path, out: &Path, more: &[&str]) -> Output {
    let mut args = vec!["batch".into(), jobs.to_owned(), "-o".into(), out.to_owned()];
    args.extend(more.iter().map(PathBuf::from));
    terrace(args)
}

/// The jobs of a report in the given state, without their extension.
pub(crate) fn in_state(report: &Value, state: &str) -> Vec<String> {
    let jobs = report["jobs"].as_array().expect("a list");
    let stem =
        |j: &Value| Path::new(j["job"].as_str().expect("text")).file_stem().expect("a name").display().to_string();
    jobs.iter().filter(|j| j["state"] == state).map(stem).collect()
}

/// Runs a batch with a report, which must say the same as `--json`.
fn report(jobs: &Path, out: &Path) -> (Output, Value) {
    let file = out.with_extension("json");
    let done = batch(jobs, out, &["--json", "--report", file.to_str().expect("text")]);
    let value: Value = serde_json::from_slice(&done.stdout).expect("one JSON object");
    assert_eq!(value, serde_json::from_slice::<Value>(&std::fs::read(file).expect("the report")).expect("JSON"));
    (done, value)
}

/// Hidden names in a folder.
pub(crate) fn hidden(dir: &Path) -> Vec<PathBuf> {
    let all = std::fs::read_dir(dir).into_iter().flatten().map(|e| e.expect("readable").path());
    all.filter(|p| p.file_name().is_some_and(|n| n.to_string_lossy().starts_with('.'))).collect()
}

/// Panics where the folder lacks anything that its manifest lists.
pub(crate) fn assert_whole(folder: &Path) {
    let bytes = std::fs::read(folder.join("manifest.json")).unwrap_or_else(|e| panic!("{}: {e}", folder.display()));
    let manifest: Value = serde_json::from_slice(&bytes).expect("a whole manifest");
    for f in manifest["files"].as_array().expect("a list") {
        let path = folder.join(f["file"].as_str().expect("text"));
        let bytes = std::fs::read(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
        assert_eq!(blake3::hash(&bytes).to_hex().as_str(), f["blake3"], "{}", path.display());
    }
}

#[test]
#[ignore = "slow: make test-all"]
fn batch_of_twenty_reports_its_three_broken_jobs() {
    let dir = folder();
    let (jobs, out) = (dir.path().join("jobs"), dir.path().join("out"));
    std::fs::create_dir(&jobs).expect("made");
    twenty(&jobs);
    let (done, first) = report(&jobs, &out);
    assert_eq!(done.status.code(), Some(2), "{}", said(&done));
    assert_eq!((&first["compiled"], &first["failed"], &first["exit_code"]), (&17.into(), &3.into(), &2.into()));
    assert_eq!(first["jobs"].as_array().map(Vec::len), Some(20), "the machine file beside the jobs is none of them");
    assert_eq!(in_state(&first, "failed"), BROKEN.map(|(name, _)| name));
    for (name, code) in BROKEN {
        let file = jobs.join(name).with_extension("toml").display().to_string();
        let job = first["jobs"].as_array().expect("a list").iter().find(|j| j["job"] == *file).expect("listed");
        let error = &job["errors"][0];
        assert_eq!(error["code"], code, "{error}");
        assert!(error["help"].is_string() && error["message"].is_string(), "{error}");
        assert!(code == "travel" || error["file"].is_string(), "{error}");
        assert_eq!(job["exit_code"], if code == "travel" { 1 } else { 2 });
        assert!(!out.join(name).with_extension("job").exists());
    }
    let made = in_state(&first, "compiled");
    let job_folder = |name: &str| out.join(name).with_extension("job");
    made.iter().for_each(|name| _ = verify(&job_folder(name)));
    assert_eq!(std::fs::read_dir(&out).expect("readable").count(), 17, "{:?}", hidden(&out));

    // As text: a line as each job ends; then the failed ones with their errors, and the sums.
    let text = batch(&jobs, &out, &[]);
    let [shown, lines] = [&text.stdout, &text.stderr].map(|bytes| String::from_utf8_lossy(bytes).into_owned());
    assert_eq!(text.status.code(), Some(2));
    assert_eq!(lines.lines().count(), 20, "{lines}");
    let counted = lines.lines().enumerate().all(|(i, line)| line.contains(&format!(" ({} of 20 after ", i + 1)));
    assert!(counted && lines.contains("b08.toml  1 stop, "), "{lines}");
    assert!(shown.contains("\n0 compiled, 17 unchanged, 3 failed\nmachine time "), "{shown}");
    for (name, code) in BROKEN {
        assert!(shown.contains(&format!("{name}.toml\n           error[{code}]")), "{shown}");
    }

    // A report of a run that is taken up again differs in the states only.
    let (_, mut again) = report(&jobs, &out);
    assert_eq!(in_state(&again, "unchanged").len(), 17);
    let total: f64 = again["jobs"].as_array().expect("a list").iter().filter_map(|j| j["time_s"].as_f64()).sum();
    assert!(total > 0.0 && (again["time_s"].as_f64().expect("a number") - total).abs() < 1e-9 * total);
    for job in again["jobs"].as_array_mut().expect("a list").iter_mut().filter(|j| j["state"] == "unchanged") {
        job["state"] = "compiled".into();
    }
    (again["compiled"], again["unchanged"]) = (17.into(), 0.into());
    assert_eq!(again, first);

    // Only what has changed is compiled again: a drawing, a job, a folder that lost a file.
    let before = files(&out);
    drawing(&jobs.join("a.svg"), 7);
    let job = jobs.join("b06.toml");
    let text = std::fs::read_to_string(&job).expect("readable").replace("order = 5", "order = 4");
    write(&job, text);
    std::fs::remove_file(job_folder("b05").join("blocks/B0001.dxf")).expect("removed");
    let (_, second) = report(&jobs, &out);
    assert_eq!(in_state(&second, "compiled"), ["b05", "b06", "b08", "b13", "b14"]);
    assert_eq!(in_state(&second, "unchanged").len(), 12);
    made.iter().for_each(|name| _ = verify(&job_folder(name)));
    let same = |a: &[(String, Vec<u8>)], b: &[(String, Vec<u8>)], name: &str| {
        let of =
            |all: &[(String, Vec<u8>)]| all.iter().filter(|(f, _)| f.starts_with(name)).cloned().collect::<Vec<_>>();
        of(a) == of(b)
    };
    let after = files(&out);
    for name in &made {
        let changed = ["b06", "b08", "b13", "b14"].contains(&name.as_str());
        assert_eq!(same(&before, &after, name), !changed, "{name}");
    }
    // Another seed is another input, and so is another place of the folder.
    let seeded = batch(&jobs, &out, &["--seed", "5"]);
    assert!(said(&seeded).contains("17 compiled, 0 unchanged"), "{}", said(&seeded));
    let deeper = dir.path().join("deeper/out");
    std::fs::create_dir(dir.path().join("deeper")).expect("made");
    std::fs::rename(&out, &deeper).expect("moved");
    let moved = batch(&jobs, &deeper, &["--seed", "5"]);
    assert!(said(&moved).contains("17 compiled, 0 unchanged"), "{}", said(&moved));
}

#[test]
#[ignore = "slow: make test-all"]
fn batch_bytes_do_not_depend_on_threads() {
    let dir = folder();
    let jobs = dir.path().join("jobs");
    std::fs::create_dir(&jobs).expect("made");
    twenty(&jobs);
    let run = |threads: &str| {
        let out = dir.path().join(threads);
        let done = batch(&jobs, &out, &[&format!("-j{threads}")]);
        assert!(said(&done).contains("17 compiled, 0 unchanged, 3 failed"), "{}", said(&done));
        files(&out)
    };
    let (one, two) = (run("1"), run("2"));
    assert_eq!(one.len(), two.len());
    one.iter().zip(&two).for_each(|(a, b)| assert!(a == b, "{} differs", a.0));
}

#[test]
fn a_list_file_names_jobs_one_a_line() {
    let dir = folder();
    let jobs = dir.path().join("jobs");
    std::fs::create_dir(&jobs).expect("made");
    twenty(&jobs);
    let list = dir.path().join("list.txt");
    write(&list, "# today\n\njobs/b01.toml  # the first\r\n  jobs/b08.toml\njobs/b99.toml\n");
    let done = terrace([Path::new("batch"), &list]);
    let text = said(&done);
    assert_eq!(done.status.code(), Some(2), "{text}");
    assert!(text.contains("2 compiled, 0 unchanged, 1 failed") && text.contains("b99.toml"), "{text}");
    // Without -o a folder lies next to its job.
    verify(&jobs.join("b01.job"));
    verify(&jobs.join("b08.job"));
    for (text, code) in [("# none\n", "batch-empty"), ("a/x.toml\nb/x.toml\n", "batch-clash")] {
        write(&list, text);
        let done = batch(&list, &dir.path().join("out"), &[]);
        assert_eq!(done.status.code(), Some(2));
        assert!(said(&done).contains(code), "{}", said(&done));
    }
    let absent = terrace([Path::new("batch"), &dir.path().join("absent")]);
    assert!(absent.status.code() == Some(2) && said(&absent).contains("file-unreadable"), "{}", said(&absent));
    // A report never overwrites a job.
    let job = jobs.join("b01.toml");
    let before = std::fs::read(&job).expect("readable");
    let over = batch(&jobs, &dir.path().join("out"), &["--report", job.to_str().expect("text")]);
    assert!(over.status.code() == Some(2) && said(&over).contains("output-is-input"), "{}", said(&over));
    assert_eq!(std::fs::read(&job).expect("readable"), before);
}

#[test]
fn several_arguments_are_one_batch_and_a_job_named_twice_is_one_job() {
    let dir = folder();
    let jobs = dir.path().join("jobs");
    std::fs::create_dir(&jobs).expect("made");
    twenty(&jobs);
    let list = dir.path().join("list.txt");
    write(&list, "jobs/b01.toml\njobs/b01.toml\n");
    let [one, two] = ["b01.toml", "b08.toml"].map(|name| jobs.join(name));
    let done = terrace([Path::new("batch"), &list, &two, &one, Path::new("--json")]);
    let report: Value = serde_json::from_slice(&done.stdout).unwrap_or_else(|e| panic!("{e}: {}", said(&done)));
    assert_eq!(in_state(&report, "compiled"), ["b01", "b08"], "{}", said(&done));
    assert_eq!(report["jobs"].as_array().map(Vec::len), Some(2));
    // Two jobs of one name from two arguments.
    let other = dir.path().join("b01.toml");
    std::fs::copy(&one, &other).expect("copied");
    let out = dir.path().join("out");
    let clash = terrace([Path::new("batch"), &one, &other, Path::new("-o"), &out]);
    assert!(clash.status.code() == Some(2) && said(&clash).contains("batch-clash"), "{}", said(&clash));
    assert!(!out.exists(), "nothing is written");
}

/// Jobs of many small files, so that most of a run's time is the writing of folders.
pub(crate) fn small_jobs(jobs: &Path, count: usize) {
    std::fs::create_dir(jobs).expect("made");
    write_stl(&jobs.join("slope.stl"), &mesh(10, [0.0, 0.0, 60.0, 60.0], |x, y| 0.1 * x + 0.05 * y));
    for i in 0..count {
        let keys = format!("pattern = \"hatch\"\npitch = \"5 mm\"\ndirection = \"{} deg\"", 20 * i);
        JobText::on(Path::new("slope.stl")).texture(&keys).write(jobs, &format!("s{i}.toml"));
    }
}

/// The report of a batch of files that are given one by one.
fn report_of(args: &[&Path]) -> (Output, Value) {
    let done = terrace([Path::new("batch"), Path::new("--json")].iter().chain(args));
    let report = serde_json::from_slice(&done.stdout).unwrap_or_else(|e| panic!("{e}: {}", said(&done)));
    (done, report)
}

#[test]
fn a_folder_without_pictures_verifies_and_is_made_again_when_they_are_wanted() {
    let dir = folder();
    let (jobs, out) = (dir.path().join("jobs"), dir.path().join("out"));
    small_jobs(&jobs, 1);
    let job = jobs.join("s0.toml");
    let run = |more: &[&str]| {
        let more: Vec<&Path> = more.iter().map(Path::new).collect();
        let (done, report) = report_of(&[&[job.as_path(), Path::new("-o"), &out], &more[..]].concat());
        assert_eq!(done.status.code(), Some(0), "{}", said(&done));
        report["jobs"][0]["state"].as_str().expect("a state").to_owned()
    };
    let drawn = || {
        let names = files(&out.join("s0.job")).into_iter().map(|(name, _)| name);
        names.filter(|name| name.ends_with(".svg") || name.ends_with(".html")).count()
    };
    assert_eq!((run(&["--no-pictures", "--verify"]), drawn()), ("compiled".to_owned(), 0));
    assert_eq!(run(&["--no-pictures"]), "unchanged");
    assert_eq!((run(&[]), drawn() > 3), ("compiled".to_owned(), true));
    assert_eq!(run(&["--no-pictures"]), "unchanged");
}

#[test]
fn a_folder_that_does_not_verify_is_a_failed_job() {
    let dir = folder();
    let (jobs, out) = (dir.path().join("jobs"), dir.path().join("out"));
    small_jobs(&jobs, 2);
    let [one, two] = ["s0.toml", "s1.toml"].map(|name| jobs.join(name));
    let run = || report_of(&[&one, &two, Path::new("-o"), &out, Path::new("--verify")]);
    let (done, report) = run();
    assert_eq!(done.status.code(), Some(0), "{}", said(&done));
    assert!(report["jobs"].as_array().expect("a list").iter().all(|j| j["verified"] == true), "{report}");
    // Damage that keeps the length: without --verify the folder counts as unchanged.
    let drawing = out.join("s1.job/blocks/B0001.dxf");
    let mut bytes = std::fs::read(&drawing).expect("readable");
    bytes[100] ^= 1;
    write(&drawing, bytes);
    let (unverified, report) = report_of(&[&two, Path::new("-o"), &out]);
    assert_eq!((unverified.status.code(), in_state(&report, "unchanged")), (Some(0), vec!["s1".to_owned()]));
    assert_eq!(report["jobs"][0]["verified"], Value::Null);
    let (done, report) = run();
    assert_eq!(done.status.code(), Some(1), "{}", said(&done));
    let [first, second] = [0, 1].map(|i| report["jobs"][i].clone());
    assert_eq!((&first["state"], &second["state"]), (&"unchanged".into(), &"failed".into()));
    let error = &second["errors"][0];
    assert!(error["code"] == "batch-verify" && error["message"].to_string().contains("hash: 1"), "{error}");
    assert_eq!(report["time_s"], first["time_s"], "a folder that does not hold adds nothing");
}

#[test]
fn log_has_a_line_as_each_job_ends_and_the_index_links_pictures() {
    let dir = folder();
    let (jobs, out) = (dir.path().join("jobs"), dir.path().join("out"));
    small_jobs(&jobs, 2);
    let odd = jobs.join("s & <i>#1.toml");
    std::fs::rename(jobs.join("s0.toml"), &odd).expect("renamed");
    // A machine file that does not state who loads the blocks.
    let machine = machine_file("xyz-galvo-40").replacen("\nway = \"run\"", "\n#", 1);
    std::fs::write(dir.path().join("ours.toml"), machine).expect("written");
    let loaded = std::fs::read_to_string(jobs.join("s1.toml")).expect("readable");
    write(&jobs.join("s1.toml"), loaded.replacen("profile = \"xyz-galvo-40\"", "file = \"../ours.toml\"", 1));
    write(&jobs.join("bad.toml"), "[surface]\nfile = \"<u>\"\nunit = mm\n");
    let [log, index] = ["pages/batch.jsonl", "pages/index.html"].map(|name| dir.path().join(name));
    let args = ["--log", log.to_str().expect("text"), "--index", index.to_str().expect("text"), "--json"];
    let done = batch(&jobs, &out, &args);
    let report: Value = serde_json::from_slice(&done.stdout).unwrap_or_else(|e| panic!("{e}: {}", said(&done)));
    let text = std::fs::read_to_string(&log).expect("a log");
    let mut lines: Vec<Value> = text.lines().map(|l| serde_json::from_str(l).expect("JSON in one line")).collect();
    let name = |v: &Value| v["job"].as_str().expect("text").to_owned();
    lines.sort_by_key(name);
    assert_eq!(&lines, report["jobs"].as_array().expect("a list"));
    // A person loads the blocks of one job.
    let by_person: Vec<&Value> = lines.iter().filter(|j| j["way"] == "person").collect();
    let loading = |v: &Value| number(v, "total_s") - number(v, "time_s");
    assert!(by_person.len() == 1 && loading(by_person[0]) >= 15.0, "{lines:?}");
    assert!((loading(by_person[0]) - loading(&report)).abs() < 1e-6, "{report}");
    // A second run adds its lines.
    assert!(batch(&jobs, &out, &[&args[..], &["-q"]].concat()).stderr.is_empty(), "quiet");
    assert_eq!(std::fs::read_to_string(&log).expect("a log").lines().count(), 2 * lines.len());

    let page = std::fs::read_to_string(&index).expect("the page");
    // What terrace run takes to load the blocks is not known.
    let least = lines.iter().filter(|j| j["way"] == "run").count();
    assert_eq!((least > 0, page.matches(", at least</td>").count()), (true, least), "{page}");
    let parsed = roxmltree::Document::parse_with_options(
        &page,
        roxmltree::ParsingOptions { allow_dtd: true, ..Default::default() },
    );
    let parsed = parsed.expect("well-formed");
    let rows = parsed.descendants().filter(|n| n.has_tag_name("tr")).skip(1);
    let rows: Vec<(bool, String)> = rows
        .map(|row| {
            let words: String = row.descendants().filter_map(|n| n.text()).collect::<Vec<_>>().join(" ");
            (row.descendants().any(|n| n.has_tag_name("img")), words)
        })
        .collect();
    let order: Vec<String> = report["jobs"].as_array().expect("a list").iter().map(name).collect();
    assert_eq!(rows.len(), order.len());
    assert!(rows.iter().zip(&order).all(|(row, job)| row.1.contains(job)), "{rows:?}");
    assert_eq!(rows.iter().filter(|row| !row.0).count(), 1, "all but the job that failed have a picture");
    let links: Vec<&str> = parsed.descendants().filter_map(|n| n.attribute("src").or(n.attribute("href"))).collect();
    assert!(links.contains(&"../out/s%20%26%20%3Ci%3E%231.job/report.html"), "{links:?}");
    for link in links {
        let path = link.replace("%20", " ").replace("%26", "&").replace("%3C", "<").replace("%3E", ">");
        // A picture is the part of a layout.
        let file = path.strip_suffix("#part").unwrap_or(&path).replace("%23", "#");
        let file = dir.path().join("pages").join(file);
        assert!(file.is_file(), "{link}");
        let text = std::fs::read_to_string(&file).unwrap_or_default();
        assert!(!path.ends_with("#part") || text.contains("<view id=\"part\""), "{link}");
    }
}

/// Lines of a child's stderr as they come.
#[cfg(target_os = "linux")]
fn lines_of(child: &mut std::process::Child) -> impl Iterator<Item = String> + use<> {
    use std::io::BufRead;
    let stderr = child.stderr.take().expect("piped");
    std::io::BufReader::new(stderr).lines().map(|line| line.expect("text"))
}

/// Ctrl-C, as a terminal sends it.
#[cfg(target_os = "linux")]
fn interrupt(child: &std::process::Child) {
    signal(child, "INT");
}

#[cfg(target_os = "linux")]
fn signal(child: &std::process::Child, name: &str) {
    let sent = Command::new("kill").arg(format!("-{name}")).arg(child.id().to_string()).status().expect("kill starts");
    assert!(sent.success());
}

/// Waits until a process has this file open.
#[cfg(target_os = "linux")]
fn await_open(child: &std::process::Child, file: &Path) {
    let files = PathBuf::from(format!("/proc/{}/fd", child.id()));
    let is_open = || {
        let mut links = std::fs::read_dir(&files).expect("it runs").flatten().map(|fd| std::fs::read_link(fd.path()));
        links.any(|link| link.is_ok_and(|link| link == file))
    };
    let start = Instant::now();
    while !is_open() {
        assert!(start.elapsed() < Duration::from_mins(1), "{} is not opened", file.display());
        std::thread::sleep(Duration::from_millis(5));
    }
}

#[test]
#[cfg(target_os = "linux")]
fn ctrl_c_lets_the_running_job_end_and_the_next_run_goes_on() {
    let dir = folder();
    let (jobs, out) = (dir.path().join("jobs"), dir.path().join("out"));
    small_jobs(&jobs, 4);
    let start = || {
        let mut command = command(&jobs, &out, 1);
        command.args(["-j1", "--no-sync"]).stdout(Stdio::piped()).stderr(Stdio::piped());
        command.spawn().expect("it starts")
    };
    // The second job runs until the lock of its folder is free.
    let lock_path = out.join(".s1.job.lock");
    let hold = || {
        std::fs::create_dir_all(&out).expect("made");
        let lock = std::fs::File::create(&lock_path).expect("writable");
        lock.lock().expect("a system with locks");
        lock
    };
    let held = hold();
    let mut child = start();
    let mut lines = lines_of(&mut child);
    assert!(lines.next().expect("a line").contains("s0.toml"));
    await_open(&child, &lock_path);
    interrupt(&child);
    assert!(lines.next().expect("a line").contains("Ctrl-C again"));
    drop(held);
    assert!(lines.next().expect("a line").contains("s1.toml"));
    let done = child.wait_with_output().expect("ended");
    let shown = said(&done);
    assert_eq!(done.status.code(), Some(1), "{shown}");
    assert!(shown.contains("2 of 4 jobs not started: run the same command again"), "{shown}");
    let (_, report) = report_of(&[&jobs, Path::new("-o"), &out, Path::new("--seed"), Path::new("1")]);
    assert_eq!((in_state(&report, "unchanged").len(), in_state(&report, "compiled").len()), (2, 2), "{report}");

    // The second one ends it at once.
    std::fs::remove_dir_all(&out).expect("removed");
    let _held = hold();
    let mut child = start();
    let mut lines = lines_of(&mut child);
    lines.next();
    await_open(&child, &lock_path);
    interrupt(&child);
    lines.next();
    interrupt(&child);
    assert_eq!(lines.next(), None, "the job that runs does not end");
    assert_eq!(child.wait().expect("ended").code(), Some(1));
    assert!(out.join("s0.job").exists() && !out.join("s1.job").exists());
}

/// `nohup` and `disown` start programs so; the terminal's end is then none of theirs.
#[test]
#[cfg(target_os = "linux")]
fn a_batch_under_nohup_outlives_its_terminal_and_another_ends_after_the_running_job() {
    // The tests themselves may run under `nohup`.
    for (how, code) in [("--ignore-signal=HUP", 0), ("--default-signal=HUP", 1)] {
        let dir = folder();
        let (jobs, out) = (dir.path().join("jobs"), dir.path().join("out"));
        small_jobs(&jobs, 3);
        std::fs::create_dir_all(&out).expect("made");
        // The second job runs until the lock of its folder is free.
        let lock_path = out.join(".s1.job.lock");
        let held = std::fs::File::create(&lock_path).expect("writable");
        held.lock().expect("a system with locks");
        let mut started = Command::new("env");
        started.args([how, env!("CARGO_BIN_EXE_terrace"), "batch"]).arg(&jobs).arg("-o").arg(&out);
        started.args(["-j1", "--no-sync"]).stdout(Stdio::piped()).stderr(Stdio::piped());
        let child = started.spawn().expect("it starts");
        await_open(&child, &lock_path);
        signal(&child, "HUP");
        // The program has time to act on it.
        std::thread::sleep(Duration::from_millis(300));
        drop(held);
        let done = child.wait_with_output().expect("ended");
        assert_eq!(done.status.code(), Some(code), "{how}: {}", said(&done));
        assert_eq!(out.join("s2.job").exists(), code == 0, "{how}: {}", said(&done));
        assert!(out.join("s1.job").exists(), "{how}: the running job is completed");
    }
}

fn command(jobs: &Path, out: &Path, seed: u64) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_terrace"));
    command.arg("batch").arg(jobs).arg("-o").arg(out).args(["--seed", &seed.to_string()]);
    command.stdout(Stdio::null()).stderr(Stdio::null());
    command
}

#[test]
#[ignore = "slow: make test-all"]
fn killed_batch_leaves_whole_folders_and_reruns_to_the_same_bytes() {
    let dir = folder();
    let (jobs, out) = (dir.path().join("jobs"), dir.path().join("out"));
    small_jobs(&jobs, 5);
    // Another seed makes every job a changed one, so every round replaces all folders of the last.
    let mut longest = Duration::ZERO;
    let undisturbed = [1, 2].map(|seed| {
        let calm = dir.path().join(format!("calm{seed}"));
        let start = Instant::now();
        assert!(command(&jobs, &calm, seed).arg("-j2").status().expect("it runs").success());
        longest = longest.max(start.elapsed());
        files(&calm)
    });
    assert!(undisturbed[0].len() > 300, "{} files", undisturbed[0].len());
    let (mut noise, mut interrupted) = (Random::new(20), 0);
    for round in 0..8 {
        let seed = round % 2 + 1;
        let mut child = command(&jobs, &out, seed).arg("-j2").spawn().expect("it starts");
        std::thread::sleep(longest.mul_f64((noise.half() + 0.5) * 0.95));
        interrupted += usize::from(child.try_wait().expect("asked").is_none());
        // SIGKILL: nothing of the program runs after it.
        child.kill().expect("killed, or ended already");
        child.wait().expect("ended");
        for i in 0..5 {
            let target = out.join(format!("s{i}.job"));
            if target.exists() {
                assert_whole(&target);
            }
        }
        assert!(command(&jobs, &out, seed).arg("-j2").status().expect("it runs").success());
        assert_eq!(hidden(&out), Vec::<PathBuf>::new(), "round {round}");
        let now = files(&out);
        assert!(now == undisturbed[seed as usize - 1], "round {round} ends with other bytes");
    }
    assert!(interrupted >= 2, "only {interrupted} of 8 runs were still at work when they were killed");
}

#[test]
#[ignore = "slow: make test-all"]
fn two_concurrent_batches_give_valid_folders() {
    let dir = folder();
    let (jobs, out) = (dir.path().join("jobs"), dir.path().join("out"));
    small_jobs(&jobs, 5);
    for seed in 1..=2 {
        let mut pair = [0, 1].map(|_| command(&jobs, &out, seed).arg("-j2").spawn().expect("it starts"));
        for child in &mut pair {
            assert!(child.wait().expect("ended").success(), "seed {seed}");
        }
        assert_eq!(hidden(&out), Vec::<PathBuf>::new());
        (0..5).for_each(|i| assert_whole(&out.join(format!("s{i}.job"))));
    }
}
