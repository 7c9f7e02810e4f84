//! Who loads the blocks: stated once, in the machine file, and shown alike on every page of a job folder.

use std::path::{Path, PathBuf};
use terrace_core::math;

use serde_json::Value;

use crate::support::surfaces::{dome, mesh, write_stl};
use crate::support::{JobText, compile, folder, machine_file, manifest, number, said, summary_of, terrace, verify};

/// A built-in machine as a file, with this `[operator]` table instead of its own, and these lines at its end.
fn machine(dir: &Path, profile: &str, operator: &str, more: &str) -> String {
    let text = machine_file(profile);
    let kept = text.lines().filter(|line| !line.starts_with("way = ") && *line != "[operator]");
    let text = kept.collect::<Vec<_>>().join("\n") + &format!("\n[operator]\n{operator}\n{more}");
    let name = format!("machine-{}.toml", std::fs::read_dir(dir).expect("a folder").count());
    std::fs::write(dir.join(&name), text).expect("a writable folder");
    format!("file = {name:?}")
}

/// A wave that free windows cover with fewer stops than sections do.
fn wave(dir: &Path) -> JobText {
    let stl = dir.join("wave.stl");
    write_stl(&stl, &mesh(40, [0.0, 0.0, 130.0, 90.0], |x, y| 0.4 * math::sin(x / 19.0) * math::cos(y / 17.0)));
    JobText::on(&stl).texture("pattern = \"hatch\"\npitch = \"1 mm\"").method("auto")
}

const ALL_FORMATS: &str = "[emit]\nformats = [\"dxf\", \"linuxcnc\", \"gcode\", \"ovf\"]\n";

/// Ten jobs, alike in nothing but that their files serve every way.
fn ten_jobs(dir: &Path, machine: &str) -> Vec<PathBuf> {
    type Height = fn(f64, f64) -> f64;
    let forms: [(&str, Height); 2] = [
        ("wave", |x, y| 0.3 * math::sin(x / 9.0) * math::cos(y / 11.0)),
        ("hill", |x, y| 1.5 - 0.002 * ((x - 25.0).powi(2) + (y - 20.0).powi(2))),
    ];
    let parts = [
        ("contour", "", ""),
        ("z-range", "keep_whole = \"3 mm\"", ""),
        ("window", "overlap = \"0.1 mm\"", ""),
        ("auto", "objective = \"stops\"", ""),
        ("z-range", "", "[passes]\ncount = 2\n"),
    ];
    let mut jobs = Vec::new();
    for (form, z) in forms {
        let stl = dir.join(format!("{form}.stl"));
        write_stl(&stl, &mesh(20, [0.0, 0.0, 50.0, 40.0], z));
        for (k, (method, partition, more)) in parts.into_iter().enumerate() {
            let text = JobText {
                machine: machine.into(),
                more: format!("{ALL_FORMATS}{more}"),
                ..JobText::on(&stl)
                    .texture("pattern = \"circles\"\npitch = \"3 mm\"\ncell = \"2 mm\"")
                    .method(method)
                    .partition(partition)
            };
            jobs.push(text.write(dir, &format!("{form}-{k}.toml")));
        }
    }
    jobs
}

/// What a statement in the machine file comes to: the way, the time for a block, and what is assumed of each.
struct Stated {
    operator: &'static str,
    way: &'static str,
    load_s: f64,
    assumed: [bool; 2],
    /// How the words begin after the number of blocks, and the programs that are not used.
    words: [&'static str; 2],
    unused: &'static str,
}

const STATEMENTS: [Stated; 7] = [
    Stated {
        operator: "",
        way: "person",
        load_s: 15.0,
        assumed: [true, true],
        words: [
            "a person loads and starts ",
            ", 15 s each (assumed: state operator.way and operator.load in the machine file)",
        ],
        unused: "\"person\": stage.ngc, job.ovf.",
    },
    Stated {
        operator: "way = \"person\"",
        way: "person",
        load_s: 15.0,
        assumed: [false, true],
        words: [
            "a person loads and starts ",
            ", 15 s each (the time is assumed: state operator.load in the machine file)",
        ],
        unused: "\"person\": stage.ngc, job.ovf.",
    },
    Stated {
        operator: "way = \"person\"\nload = \"40 s\"",
        way: "person",
        load_s: 40.0,
        assumed: [false, false],
        words: ["a person loads and starts ", ", 40 s each"],
        unused: "\"person\": stage.ngc, job.ovf.",
    },
    Stated {
        operator: "way = \"run\"",
        way: "run",
        load_s: 0.0,
        assumed: [false, false],
        words: ["terrace run loads and starts ", ", which comes on top"],
        unused: "\"run\": stage.ngc, stage_m0.nc, job.ovf.",
    },
    Stated {
        operator: "way = \"run\"\nload = \"2 s\"",
        way: "run",
        load_s: 2.0,
        assumed: [false, false],
        words: ["terrace run loads and starts ", ", 2 s each"],
        unused: "\"run\": stage.ngc, stage_m0.nc, job.ovf.",
    },
    Stated {
        operator: "way = \"card\"",
        way: "card",
        load_s: 0.0,
        assumed: [false, false],
        words: ["the scan card has ", " stored, the handshake of stage.ngc starts each"],
        unused: "\"card\": stage_m0.nc, job.ovf.",
    },
    Stated {
        operator: "way = \"ovf\"",
        way: "ovf",
        load_s: 0.0,
        assumed: [false, false],
        words: ["a controller reads job.ovf and marks ", " of it"],
        unused: "\"ovf\": blocks/*.dxf, stage.ngc, stage_m0.nc.",
    },
];

/// A time as run sheets have it.
fn clock(s: f64) -> String {
    let whole = s.round() as u64;
    format!("{}:{:02}:{:02}", whole / 3600, whole / 60 % 60, whole % 60)
}

/// Holds every page of a job folder to the statement; answers with the time in all.
fn pages_follow(out: &Path, stated: &Stated) -> f64 {
    let summary = manifest(out)["summary"].clone();
    let (loading, blocks) = (&summary["loading"], number(&summary, "blocks"));
    assert_eq!(loading["way"], stated.way, "{loading}");
    assert_eq!((loading["assumed"] == true, loading["load_assumed"] == true), stated.assumed.into(), "{loading}");
    assert_eq!(number(loading, "load_s"), stated.load_s);
    let total_s = number(&summary["time_s"], "total") + stated.load_s * blocks;
    assert!((number(loading, "total_s") - total_s).abs() < 1e-6, "{loading} {total_s}");

    let count = if blocks == 1.0 { "1 block".into() } else { format!("{blocks} blocks") };
    let words = format!("{}{count}{}", stated.words[0], stated.words[1]);
    let least = if stated.words[1].contains("on top") { " at least" } else { "" };
    let sheet = std::fs::read_to_string(out.join("runsheet.txt")).expect("a run sheet");
    for line in [
        format!("loading    {words}"),
        format!("in all     {}{least}; a person attends all of it", clock(total_s)),
        format!("  - Not used by operator.way = {}", stated.unused),
    ] {
        assert_eq!(sheet.lines().filter(|l| *l == line).count(), 1, "{line}\n{sheet}");
    }
    let report = std::fs::read_to_string(out.join("report.html")).expect("a report");
    let duration = terrace_core::duration::duration(total_s);
    let least = if least.is_empty() { "" } else { "at least " };
    let attends = format!("<li>A person attends {least}{duration}: {words}.</li>");
    assert!(report.contains(&attends), "{attends}\n{report}");
    assert_eq!(report.matches("A person attends").count(), 1);
    assert!(report.contains(&format!("{words}</td><td>")), "{words}");
    let view = std::fs::read_to_string(out.join("view.html")).expect("a view");
    assert!(view.contains(&words), "{words}");
    for page in [&sheet, &report, &view] {
        let page = page.to_lowercase();
        for wrong in ["nobody has to", "time by hand", "unattended", "of the machine alone"] {
            assert!(!page.contains(wrong), "{wrong}: {}", out.display());
        }
    }
    total_s
}

#[test]
#[ignore = "slow: make test-all"]
fn ten_jobs_by_each_way_have_time_cost_and_verdict_of_the_statement_on_every_page() {
    for stated in &STATEMENTS {
        let dir = folder();
        let rates = "[cost]\nmachine = \"80 EUR/h\"\noperator = \"45 EUR/h\"\n";
        let machine = machine(dir.path(), "xyz-galvo-40", stated.operator, rates);
        let jobs = ten_jobs(dir.path(), &machine);
        let out = dir.path().join("out");
        let args = ["batch", "--json", "--verify", "-o"].map(Path::new);
        let done = terrace(args.into_iter().chain([out.as_path()]).chain(jobs.iter().map(PathBuf::as_path)));
        assert!(done.status.success(), "{}", said(&done));
        let batch: Value = serde_json::from_slice(&done.stdout).expect("JSON");
        let listed = batch["jobs"].as_array().expect("jobs");
        assert_eq!(listed.len(), jobs.len());
        let mut sum_s = 0.0;
        for job in listed {
            let total_s = pages_follow(Path::new(job["folder"].as_str().expect("a folder")), stated);
            assert_eq!((number(job, "total_s"), &job["way"]), (total_s, &stated.way.into()), "{job}");
            sum_s += total_s;
        }
        assert!((number(&batch, "total_s") - sum_s).abs() < 1e-6);
        // What a comparison says of the job's own method is what its folder says.
        let job = &jobs[0];
        let summary = summary_of(job);
        let compared =
            terrace([Path::new("compare"), job, Path::new("--systems"), Path::new("contour"), Path::new("--json")]);
        assert!(compared.status.success(), "{}", said(&compared));
        let found: Value = serde_json::from_slice(&compared.stdout).expect("JSON");
        assert_eq!(
            (&found["loading"]["way"], &found["loading"]["assumed"]),
            (&stated.way.into(), &stated.assumed[0].into())
        );
        let (row, total_s) = (&found["systems"][0], number(&summary["loading"], "total_s"));
        assert!((number(row, "with_loading_s") - total_s).abs() < 1e-6, "{row} {summary}");
        assert!((number(row, "cost_eur") - total_s * 125.0 / 3600.0).abs() < 0.005, "{row}");
        assert!((number(&found["verdict"]["systems"][0], "time_s") - total_s).abs() < 1e-6, "{found:#}");
    }
}

#[test]
fn a_built_in_machine_assumes_terrace_run_and_every_page_says_so() {
    let dir = folder();
    let stl = dir.path().join("plane.stl");
    write_stl(&stl, &mesh(4, [0.0, 0.0, 60.0, 20.0], |_, _| 0.0));
    let job = JobText::on(&stl).texture("pattern = \"hatch\"\npitch = \"4 mm\"").write(dir.path(), "plane.toml");
    let out = dir.path().join("plane.job");
    compile(&job, &out);
    verify(&out);
    let assumed = Stated {
        operator: "",
        way: "run",
        load_s: 0.0,
        assumed: [true, false],
        words: [
            "terrace run loads and starts ",
            ", which comes on top (assumed: state operator.way in the machine file)",
        ],
        unused: "\"run\": stage.ngc, job.ovf.",
    };
    pages_follow(&out, &assumed);
    let printed = said(&terrace([Path::new("check"), &job]));
    assert!(printed.contains("(assumed: state operator.way in the machine file)\nin all "), "{printed}");
}

#[test]
#[ignore = "slow: make test-all"]
fn auto_counts_the_loading_of_blocks_by_the_way_that_is_stated() {
    let dir = folder();
    let mut methods = Vec::new();
    for operator in ["way = \"run\"", "way = \"person\"\nload = \"60 s\"", "way = \"ovf\"\nload = \"60 s\""] {
        let mut text = wave(dir.path());
        text.machine = machine(dir.path(), "xyz-galvo-40", operator, "");
        text.more = ALL_FORMATS.into();
        let summary = summary_of(&text.write(dir.path(), "wave.toml"));
        let candidates = summary["candidates"].as_array().expect("candidates");
        let best = candidates.iter().min_by(|a, b| number(a, "total_s").total_cmp(&number(b, "total_s")));
        assert_eq!(best.expect("several")["method"], summary["method"], "{operator}: {summary}");
        for c in candidates {
            let load_s = if operator.contains("person") { 60.0 * number(c, "stops") } else { 0.0 };
            assert!((number(c, "total_s") - number(&c["time_s"], "total") - load_s).abs() < 1e-6, "{operator}: {c}");
        }
        methods.push((summary["method"].clone(), number(&summary, "stops")));
    }
    assert!(methods[1].1 < methods[0].1, "a person's minutes are worth longer moves: {methods:?}");
    assert_eq!(methods[0], methods[2], "nobody loads what one file holds");
}

#[test]
#[ignore = "slow: make test-all"]
fn a_way_that_formats_or_machine_do_not_serve_is_refused_at_its_line_before_planning() {
    let dir = folder();
    let cases = [
        ("way = \"ovf\"", "\"dxf\", \"linuxcnc\"", Some("job.ovf")),
        ("way = \"card\"", "\"dxf\", \"gcode\"", Some("no stage program starts the scan card")),
        ("way = \"person\"", "\"linuxcnc\", \"ovf\"", Some("no file of a single block")),
        ("way = \"run\"", "\"linuxcnc\"", None),
        ("way = \"card\"", "\"linuxcnc\"", None),
        ("way = \"person\"", "\"csv\"", None),
        ("way = \"ovf\"", "\"ovf\"", None),
    ];
    for (operator, formats, fault) in cases {
        let mut text = wave(dir.path());
        text.machine = machine(dir.path(), "xyz-galvo-40", operator, "");
        text.more = format!("[emit]\nformats = [{formats}]\n");
        // What is refused early is refused before the surface is opened.
        if fault.is_some() {
            text.surface = "file = \"absent.stl\"\nunit = \"mm\"".into();
        }
        let done = terrace([Path::new("check"), &text.write(dir.path(), "wave.toml")]);
        let printed = said(&done);
        match fault {
            None => assert!(done.status.success(), "{operator} {formats}: {printed}"),
            Some(fault) => {
                assert_eq!(done.status.code(), Some(2), "{printed}");
                let place = printed.contains("error[operator-way]")
                    && printed.contains("machine-")
                    && printed.contains("| way = ");
                assert!(place && printed.contains(fault), "{operator} {formats}: {printed}");
            }
        }
    }
    for (dialect, operator, more, code) in [
        ("grbl", "way = \"card\"", "", "operator-way"),
        ("mach", "way = \"card\"", "", "operator-way"),
        ("grbl", "way = \"run\"", "tilt", "machine-dialect"),
    ] {
        let profile = if more.is_empty() { "xyz-galvo-40" } else { "xyz-tilt-galvo-40" };
        let mut text = wave(dir.path());
        text.machine = machine(dir.path(), profile, operator, &format!("[controller]\ndialect = {dialect:?}\n"));
        let done = terrace([Path::new("check"), &text.write(dir.path(), "wave.toml")]);
        let printed = said(&done);
        assert!(
            printed.contains(&format!("error[{code}]")) && printed.contains(":") && !done.status.success(),
            "{printed}"
        );
    }
}

#[test]
fn blocks_with_a_focus_shift_are_refused_where_the_handshake_would_start_them_out_of_focus() {
    let dir = folder();
    let stl = dir.path().join("dome.stl");
    write_stl(&stl, &mesh(20, [150.0, 150.0, 200.0, 200.0], dome));
    let rtc = "[rtc]\nboard = \"rtc5\"\nbits_per_mm = 5000\nfocus_bits_per_mm = 5000\n";
    let cases = [
        ("", "\"dxf\", \"linuxcnc\", \"ovf\"", "error"),
        ("", "\"dxf\", \"gcode\"", "warning"),
        ("", "\"ovf\"", ""),
        ("way = \"card\"", "\"dxf\", \"linuxcnc\", \"ovf\"", "error"),
        ("way = \"card\"", "\"rtc\", \"linuxcnc\"", ""),
        ("way = \"run\"", "\"dxf\", \"linuxcnc\", \"ovf\"", "warning"),
        ("way = \"run\"", "\"rtc\"", ""),
        ("way = \"person\"", "\"dxf\", \"linuxcnc\", \"ovf\"", "warning"),
        ("way = \"ovf\"", "\"dxf\", \"linuxcnc\", \"ovf\"", ""),
    ];
    for (operator, formats, kind) in cases {
        let text = JobText {
            machine: machine(dir.path(), "xyz-zoom-40", operator, rtc),
            more: format!("[emit]\nformats = [{formats}]\n"),
            ..JobText::on(&stl).texture("pattern = \"hatch\"\npitch = \"2 mm\"")
        };
        let done = terrace([Path::new("check"), &text.write(dir.path(), "dome.toml")]);
        let printed = said(&done);
        assert_eq!(done.status.success(), kind != "error", "{operator} {formats}: {printed}");
        for word in ["error", "warning"] {
            let is_warned = printed.contains(&format!("{word}[focus-shift-lost]"));
            assert_eq!(is_warned, word == kind, "{operator} {formats}: {printed}");
        }
    }
}

#[test]
fn the_run_sheet_states_the_field_that_the_device_of_lightburn_must_have() {
    let dir = folder();
    let stl = dir.path().join("plane.stl");
    write_stl(&stl, &mesh(4, [0.0, 0.0, 20.0, 20.0], |_, _| 0.0));
    let profile =
        machine_file("xyz-galvo-40").replacen("field = [\"40 mm\", \"40 mm\"]", "field = [\"70 mm\", \"50 mm\"]", 1);
    std::fs::write(dir.path().join("wide.toml"), profile).expect("a writable folder");
    for (formats, is_warned) in [("\"lightburn\", \"linuxcnc\"", true), ("\"dxf\", \"linuxcnc\"", false)] {
        let text = JobText {
            machine: "file = \"wide.toml\"".into(),
            more: format!("[emit]\nformats = [{formats}]\n"),
            ..JobText::on(&stl).texture("pattern = \"hatch\"\npitch = \"4 mm\"")
        };
        let out = dir.path().join("plane.job");
        compile(&text.write(dir.path(), "plane.toml"), &out);
        let sheet = std::fs::read_to_string(out.join("runsheet.txt")).expect("a run sheet");
        let line = "LightBurn: the working area of the device must be 70 x 50 mm";
        assert_eq!(sheet.contains(line) && sheet.contains("about the point 35 25 mm"), is_warned, "{sheet}");
        if is_warned {
            let block = std::fs::read_to_string(out.join("blocks/B0001.lbrn2")).expect("a project");
            assert!(block.contains("1 0 0 1 35.000000 25.000000"), "{block}");
        }
    }
}

/// The words of `stage_m0.nc` by the control that reads it.
#[test]
fn the_stage_program_with_stops_has_the_words_of_its_control() {
    let dir = folder();
    let stl = dir.path().join("plane.stl");
    write_stl(&stl, &mesh(4, [0.0, 0.0, 50.0, 20.0], |_, _| 0.0));
    let program = |dialect: &str, profile: &str| {
        let controller = format!("[controller]\n{dialect}\n");
        let text = JobText {
            machine: machine(dir.path(), profile, "way = \"person\"", &controller),
            more: "[emit]\nformats = [\"dxf\", \"gcode\"]\n".into(),
            ..JobText::on(&stl).texture("pattern = \"hatch\"\npitch = \"4 mm\"")
        };
        let out = dir.path().join("plane.job");
        compile(&text.write(dir.path(), "plane.toml"), &out);
        verify(&out);
        std::fs::read_to_string(out.join("stage_m0.nc")).expect("a program")
    };
    let plain = program("", "xyz-galvo-40");
    assert!(!plain.contains("G69"));
    for dialect in ["linuxcnc", "grbl"] {
        assert_eq!(program(&format!("dialect = {dialect:?}"), "xyz-galvo-40"), plain, "{dialect}");
    }
    assert_eq!(program("dialect = \"mach\"", "xyz-galvo-40"), plain.replacen("G92.1\n", "G92.1\nG69\n", 1));
    let tilted = program("dialect = \"mach\"", "xyz-tilt-galvo-40");
    assert!(tilted.contains("\nG69\n") && tilted.contains(" A0.000000 B0.000000"), "{tilted}");
}
