//! What job and machine file alone do not allow is refused at its line, before any other file is read: the surfaces and
//! drawings of these jobs are not there.

use std::path::Path;

use terrace_core::diag::Diag;
use terrace_core::machine::PROFILES;
use terrace_input::job::{Job, Mode, Overrides, SAMPLE_JOB};
use terrace_plan::plan::{self, Inputs};

use crate::support::{folder, said, terrace};

/// The sample job on a machine file of its own, with texts of both replaced.
fn write(dir: &Path, profile: &str, job: &[(&str, &str)], machine: &[(&str, &str)]) {
    let replaced = |text: &str, changes: &[(&str, &str)]| {
        changes.iter().fold(text.to_owned(), |text, (from, to)| {
            assert!(text.contains(from), "{from}");
            text.replacen(from, to, 1)
        })
    };
    let text = SAMPLE_JOB.replacen("profile = \"xyz-galvo-40\"", "file = \"machine.toml\"", 1);
    std::fs::write(dir.join("job.toml"), replaced(&text, job)).expect("written");
    let (_, text) = PROFILES.iter().find(|(name, _)| *name == profile).expect("a profile");
    std::fs::write(dir.join("machine.toml"), replaced(text, machine)).expect("written");
}

/// What a job in the folder is refused for.
fn refused(dir: &Path, mode: Mode) -> Vec<Diag> {
    let overrides = Overrides { mode: Some(mode), ..Overrides::default() };
    let job = Job::load(&dir.join("job.toml"), &overrides).unwrap_or_else(|e| panic!("{e}"));
    plan::plan(job, &|_, _| {}).expect_err("it is refused").diags().to_vec()
}

const FORMATS: &str = "formats = [\"dxf\", \"linuxcnc\", \"ovf\"]";
const HATCH: &str = "pattern = \"hatch\"";
const ANGLE: &str = "direction = \"0 deg\"";
const PITCH: &str = "pitch = \"0.5 mm\"";
const KHZ: &str = "frequency = \"60 kHz\"";
const DWELL: &str = "frequency = \"60 kHz\"\ndwell = \"100 us\"";
const LMC: (&str, &str) = ("[lens]", "[lmc]\nunits_per_mm = 500\n\n[lens]");
const RTC: (&str, &str) = ("[lens]", "[rtc]\nboard = \"rtc5\"\nbits_per_mm = 20000\n\n[lens]");

#[test]
fn what_both_files_do_not_allow_is_refused_at_its_line_before_the_surface_is_read() {
    let lmc = (FORMATS, "formats = [\"dxf\", \"lmc\"]");
    let rtc = (FORMATS, "formats = [\"rtc\"]");
    let lightburn = (FORMATS, "formats = [\"csv\", \"lightburn\"]");
    let dots = [(HATCH, "pattern = \"dots\""), (ANGLE, ""), (KHZ, DWELL)];
    let poisson = [(HATCH, "pattern = \"poisson\""), (ANGLE, ""), (KHZ, DWELL)];
    let halftone = [(HATCH, "file = \"gravel.png\"\ndpi = 300\nscreen = \"halftone\""), (KHZ, DWELL)];
    let pens: String = (1..31)
        .map(|i| format!("[[pen]]\nname = \"p{i}\"\nspeed = \"1 m/s\"\npower = \"1 %\"\nfrequency = \"60 kHz\"\n\n"))
        .collect();
    let many = format!("{pens}[[pen]]\n");
    let pilot =
        "frames = \"pilot\"\n\n[[pen]]\nname = \"pilot\"\nspeed = \"1 m/s\"\npower = \"60 %\"\nfrequency = \"60 kHz\"";
    let section = |to| ("# section = \"39 mm\"", to);
    type Case<'a> = (Vec<(&'a str, &'a str)>, Vec<(&'a str, &'a str)>, &'a str, &'a str);
    let with = |one: (&'static str, &'static str), more: &[(&'static str, &'static str)]| [&[one], more].concat();
    let cases: Vec<Case<'_>> = vec![
        (vec![lmc], vec![], "emit-lmc", "job.toml \"lmc\""),
        (vec![rtc], vec![], "emit-rtc", "job.toml \"rtc\""),
        (with(lightburn, &dots), vec![], "lightburn-dots", "job.toml \"lightburn\""),
        (with(lightburn, &poisson), vec![], "lightburn-dots", "job.toml \"lightburn\""),
        (with(lightburn, &halftone), vec![], "lightburn-dots", "job.toml \"lightburn\""),
        (vec![lightburn, ("[[pen]]\n", &many)], vec![], "lightburn-layers", "job.toml \"lightburn\""),
        (vec![lmc, ("speed = \"1000 mm/s\"", "speed = \"1 mm/s\"")], vec![LMC], "lmc-speed", "job.toml \"1 mm/s\""),
        (vec![lmc, (KHZ, "frequency = \"0.1 kHz\"")], vec![LMC], "lmc-frequency", "job.toml \"0.1 kHz\""),
        (vec![lmc, (KHZ, "frequency = \"60 kHz\"\ndwell = \"14 us\"")], vec![LMC], "lmc-dwell", "job.toml \"14 us\""),
        (
            vec![rtc, ("speed = \"1000 mm/s\"", "speed = \"0.05 mm/s\"")],
            vec![RTC],
            "rtc-speed",
            "job.toml \"0.05 mm/s\"",
        ),
        (vec![rtc, (KHZ, "frequency = \"60 kHz\"\ndwell = \"14 us\"")], vec![RTC], "rtc-dwell", "job.toml \"14 us\""),
        (with((FORMATS, FORMATS), &[(HATCH, "pattern = \"dots\""), (ANGLE, "")]), vec![], "pen-dwell", "job.toml"),
        (vec![("# frames = \"pilot\"", pilot)], vec![], "frames-power", "job.toml \"pilot\""),
        (vec![section("section = \"41 mm\"")], vec![], "section-large", "job.toml \"41 mm\""),
        (vec![section("section = \"0.1 um\"")], vec![], "section-small", "job.toml \"0.1 um\""),
        (vec![section("zone = \"20 mm\"")], vec![], "zone-large", "job.toml \"20 mm\""),
        (vec![section("overlap = \"10 mm\"")], vec![], "overlap-large", "job.toml \"10 mm\""),
        (vec![], vec![("increment = \"0.0001 mm\"", "increment = \"0.1 mm\"")], "depth-small", "job.toml"),
        (vec![("method = \"auto\"", "method = \"tilt\"")], vec![], "tilt-missing", "job.toml \"tilt\""),
        (vec![("speed = \"1000 mm/s\"", "speed = \"9000 mm/s\"")], vec![], "pen-speed", "job.toml \"9000 mm/s\""),
    ];
    for (job, machine, code, at) in cases {
        let dir = folder();
        write(dir.path(), "xyz-galvo-40", &job, &machine);
        let found = refused(dir.path(), Mode::Stepped);
        let codes: Vec<&str> = found.iter().map(|d| d.code).collect();
        assert_eq!(codes, [code], "{found:?}");
        // The caret stands below the value.
        let shown = found[0].render(false);
        let (file, value) = at.split_once(' ').unwrap_or((at, ""));
        assert!(shown.contains(file) && shown.contains('^') && shown.contains(value), "{code}: {shown}");
        if !value.is_empty() {
            let caret = shown.lines().find(|l| l.contains('^')).expect("a caret");
            let line = shown.lines().zip(shown.lines().skip(1)).find(|(_, next)| *next == caret).expect("a line").0;
            let under: String = line.chars().skip(caret.find('^').expect("a caret")).collect();
            assert!(under.starts_with(value), "{code}: {shown}");
        }
    }
}

#[test]
fn values_of_the_machine_file_are_refused_at_their_line_of_that_file() {
    let dir = folder();
    let slow = ("jump_speed = \"5000 mm/s\"", "jump_speed = \"0.5 mm/s\"");
    write(dir.path(), "xyz-galvo-40", &[(FORMATS, "formats = [\"lmc\"]")], &[LMC, slow]);
    let found = refused(dir.path(), Mode::Stepped);
    assert!(matches!(&found[..], [d] if d.code == "lmc-speed"), "{found:?}");
    let shown = found[0].render(false);
    assert!(shown.contains("machine.toml:") && shown.contains("\"0.5 mm/s\"") && shown.contains('^'), "{shown}");
    let long = ("[delays]", "[delays]\npolygon = \"70 ms\"\n");
    let text = std::fs::read_to_string(dir.path().join("machine.toml")).expect("a file");
    let line = text.lines().find(|l| l.starts_with("polygon")).expect("a delay").to_owned();
    write(dir.path(), "xyz-galvo-40", &[(FORMATS, "formats = [\"lmc\"]")], &[LMC, (&line, ""), long]);
    let found = refused(dir.path(), Mode::Stepped);
    assert!(matches!(&found[..], [d] if d.code == "lmc-delay"), "{found:?}");
    assert!(found[0].render(false).contains("machine.toml:"), "{}", found[0].render(false));
}

#[test]
fn all_of_them_are_reported_together() {
    let dir = folder();
    let formats = (FORMATS, "formats = [\"lmc\", \"rtc\"]");
    let section = ("# section = \"39 mm\"", "section = \"41 mm\"");
    write(dir.path(), "xyz-galvo-40", &[formats, section, ("speed = \"1000 mm/s\"", "speed = \"9 m/s\"")], &[]);
    let codes: Vec<&str> = refused(dir.path(), Mode::Stepped).iter().map(|d| d.code).collect();
    assert_eq!(codes, ["pen-speed", "emit-lmc", "emit-rtc", "section-large"]);
}

#[test]
fn on_the_fly_jobs_are_refused_as_early() {
    let dir = folder();
    let dots = [(HATCH, "pattern = \"dots\""), (ANGLE, ""), (KHZ, DWELL), (FORMATS, "formats = [\"pmac\"]")];
    write(dir.path(), "xyz-galvo-40", &dots, &[]);
    let found = refused(dir.path(), Mode::OnTheFly);
    assert!(matches!(&found[..], [d] if d.code == "fly-job"), "{found:?}");
    assert!(found[0].render(false).contains("[[texture]]"), "{}", found[0].render(false));
    write(dir.path(), "xyzac-galvo-10", &[(FORMATS, "formats = [\"linuxcnc\"]")], &[]);
    let found = refused(dir.path(), Mode::OnTheFly);
    assert!(matches!(&found[..], [d] if d.code == "emit-mode"), "{found:?}");
}

#[test]
fn points_of_a_drawing_are_dots_that_are_refused_before_the_plan() {
    let dir = folder();
    let job = [
        (HATCH, "file = \"points.dxf\"\nunit = \"mm\""),
        (PITCH, ""),
        (ANGLE, ""),
        (KHZ, DWELL),
        (FORMATS, "formats = [\"lightburn\"]"),
    ];
    write(dir.path(), "xyz-galvo-40", &job, &[]);
    std::fs::write(dir.path().join("sample.stl"), terrace_input::job::sample_surface()).expect("written");
    let points = "0\nSECTION\n2\nENTITIES\n0\nPOINT\n8\n0\n10\n1.0\n20\n1.0\n0\nENDSEC\n0\nEOF\n";
    std::fs::write(dir.path().join("points.dxf"), points).expect("written");
    let job = Job::load(&dir.path().join("job.toml"), &Overrides::default()).unwrap_or_else(|e| panic!("{e}"));
    // Reading alone finds it: nothing was planned.
    let e = Inputs::load_each(&job, &mut |_| {}, terrace_core::progress::Task::silent()).expect_err("refused");
    assert_eq!(e.diags()[0].code, "lightburn-dots", "{e}");
    assert!(e.diags()[0].render(false).contains("formats = [\"lightburn\"]"), "{e}");
}

#[test]
fn what_is_measured_and_not_written_is_not_held_to_formats() {
    let dir = folder();
    write(dir.path(), "xyz-galvo-40", &[(FORMATS, "formats = [\"lmc\"]")], &[]);
    std::fs::write(dir.path().join("sample.stl"), terrace_input::job::sample_surface()).expect("written");
    let job = Job::load(&dir.path().join("job.toml"), &Overrides::default()).unwrap_or_else(|e| panic!("{e}"));
    assert!(Inputs::load(&job).is_ok());
    let out = terrace([Path::new("orient"), &dir.path().join("job.toml")]);
    assert!(out.status.success(), "{}", said(&out));
    let out = terrace([Path::new("check"), &dir.path().join("job.toml")]);
    assert_eq!(out.status.code(), Some(2), "{}", said(&out));
}
