//! Implausible jobs: refused before anything is written, each limit once and with a value that works.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use terrace_core::math;

use crate::support::surfaces::{mesh, write_stl};
use crate::support::{JobText, folder, machine_file, said, terrace};

/// A panel of 60 x 50 mm under a hatch of 0.5 mm, at the origin of its file.
fn panel(dir: &Path) -> JobText {
    let stl = dir.join("panel.stl");
    if !stl.exists() {
        write_stl(&stl, &mesh(20, [0.0, 0.0, 60.0, 50.0], |x, y| math::sin(x / 20.0) * math::cos(y / 17.0)));
    }
    JobText::on(&stl).texture("pattern = \"hatch\"\npitch = \"0.5 mm\"")
}

fn check(job: &Path) -> Output {
    terrace([Path::new("check"), job])
}

/// Holds that a job is refused by limits with exactly these codes, and answers with what is said.
fn refused(job: &Path, codes: &[&str]) -> String {
    let done = check(job);
    let text = said(&done);
    assert_eq!(done.status.code(), Some(1), "{text}");
    let found: Vec<&str> = text.lines().filter_map(|l| l.strip_prefix("error[")?.split(']').next()).collect();
    assert_eq!(found, codes, "{text}");
    text
}

fn accepted(job: &Path) -> String {
    let done = check(job);
    assert_eq!(done.status.code(), Some(0), "{}", said(&done));
    said(&done)
}

#[test]
fn a_slip_of_units_in_pdof_or_pitch_is_refused_unless_the_job_allows_it() {
    let dir = folder();
    let mut job = panel(dir.path());
    job.focus = "pdof = \"70 mm\"".into();
    job.textures = vec!["pattern = \"hatch\"\npitch = \"4 um\"".into()];
    let text = refused(&job.write(dir.path(), "slip.toml"), &["pdof-large", "pitch-small"]);
    assert!(text.contains("39.6 times the depth of focus of the optics (2 z_R = 1.770 mm"), "{text}");
    assert!(text.contains("lines 0.004 mm apart under a spot of 0.02 mm mark every place 5 times"), "{text}");
    assert!(text.contains("pdof = \"70 mm\"") && text.contains("pitch = \"4 um\""), "the lines are shown: {text}");
    job.more = "[limits]\nimplausible = \"allow\"\n".into();
    let text = accepted(&job.write(dir.path(), "meant.toml"));
    assert!(text.contains("warning[pdof-large]") && text.contains("warning[pitch-small]"), "{text}");
}

#[test]
fn beam_quality_lowers_the_depth_of_focus_of_the_optics() {
    let dir = folder();
    let profile = terrace(["machines", "xyz-galvo-40"]);
    let text = String::from_utf8(profile.stdout).expect("text");
    let mut job = panel(dir.path());
    // 2 z_R is 1.77 mm with M2 = 1, so twice that is 3.54 mm, and 1.77 mm with M2 = 2.
    job.focus = "pdof = \"2 mm\"".into();
    job.machine = "file = \"ours.toml\"".into();
    let job = job.write(dir.path(), "job.toml");
    let with = |m2: &str| {
        let text = text.replace("wavelength = \"355 nm\"", &format!("wavelength = \"355 nm\"\n{m2}"));
        std::fs::write(dir.path().join("ours.toml"), text).expect("writable");
    };
    with("");
    accepted(&job);
    with("m2 = 2.0");
    refused(&job, &["pdof-large"]);
    with("m2 = 0.9");
    let done = check(&job);
    assert!(done.status.code() == Some(2) && said(&done).contains("error[machine-m2]"), "{}", said(&done));
}

#[test]
fn texture_that_the_job_places_off_the_part_is_refused_with_its_share() {
    let dir = folder();
    let area = |x1: f64, more: &str| {
        let mut job = panel(dir.path());
        job.textures[0] += &format!("\narea = [\"0 mm\", \"0 mm\", \"{x1} mm\", \"50 mm\"]");
        job.more = more.into();
        job.write(dir.path(), "job.toml")
    };
    // Lines along x: their share off the part is that of the length.
    let text = refused(&area(150.0, ""), &["off-part"]);
    assert!(text.contains("(60.0 %) lie off the part") && text.contains("allows 1 %"), "{text}");
    let text = accepted(&area(150.0, "[limits]\nmax_off_part = \"60.1 %\"\n"));
    assert!(text.contains("warning[off-part]") && text.contains("(60.0 % of it)"), "{text}");
    accepted(&area(60.6, ""));
    refused(&area(60.7, ""), &["off-part"]);
    refused(&area(66.0, "[limits]\nmax_off_part = \"9 %\"\n"), &["off-part"]);
}

#[test]
fn patterns_over_the_part_are_not_held_to_the_limit_off_it_and_drawings_are_each() {
    let dir = folder();
    let stl = dir.path().join("triangle.stl");
    write_stl(&stl, &[[[0.0, 0.0, 0.0], [60.0, 0.0, 0.0], [0.0, 60.0, 0.0]]]);
    let drawing = "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"10mm\" height=\"10mm\" viewBox=\"0 0 10 10\">\
                   <path d=\"M0 5h10\" stroke=\"#000\" stroke-width=\".01\" fill=\"none\"/></svg>";
    std::fs::write(dir.path().join("line.svg"), drawing).expect("writable");
    let with = |textures: &[&str]| {
        let mut job = JobText::on(&stl);
        job.textures = textures.iter().map(|&t| t.to_owned()).collect();
        job.write(dir.path(), "job.toml")
    };
    let hatch = "pattern = \"hatch\"\npitch = \"0.5 mm\"";
    let text = accepted(&with(&[hatch]));
    assert!(text.contains("warning[off-part]"), "half of it is off the part: {text}");
    accepted(&with(&["file = \"line.svg\"\ntile = true\narea = \"part\""]));
    accepted(&with(&[hatch, "file = \"line.svg\"\norigin = [\"10 mm\", \"10 mm\"]"]));
    // A fifth of the line lies beyond the hypotenuse, which is little of the whole texture.
    let job = with(&[hatch, "file = \"line.svg\"\norigin = [\"47 mm\", \"0 mm\"]"]);
    let text = refused(&job, &["off-part"]);
    assert!(text.contains("texture 2: 2.000 mm of it (20.0 %)") && text.contains("terrace preview"), "{text}");
    // The picture is made all the same, with what lies off the part in red.
    let done = terrace([Path::new("preview"), &job]);
    assert!(done.status.code() == Some(1) && said(&done).contains("error[off-part]"), "{}", said(&done));
    let picture = std::fs::read_to_string(job.with_extension("layout.svg")).expect("a picture");
    let path = picture.split('<').find(|element| element.contains("id=\"unmarked-off-part-2\"")).expect("a red line");
    let (_, d) = path.split_once(" d=\"M").expect("a path");
    let x = d.split(['-', ' ']).next().and_then(|v| v.parse::<f64>().ok());
    assert!(x.is_some_and(|x| (x - 55.0).abs() < 0.2), "red begins at the hypotenuse: {x:?}");
    let folder = terrace([Path::new("compile"), &job]);
    assert!(folder.status.code() == Some(1) && !job.with_extension("job").exists());
}

/// The codes of errors and warnings, and what is said.
fn printed(job: &Path) -> (Vec<String>, String) {
    let text = said(&check(job));
    let codes = text.lines().filter_map(|l| {
        let (kind, rest) = l.split_once('[')?;
        (kind == "error" || kind == "warning").then(|| rest.split(']').next().unwrap_or_default().to_owned())
    });
    (codes.collect(), text)
}

#[test]
#[ignore = "slow: make test-all"]
fn drawings_and_curves_of_a_size_that_does_not_go_with_the_part_are_reported_once_with_the_key_to_set() {
    let dir = folder();
    let square = "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"40mm\" height=\"40mm\" viewBox=\"0 0 40 40\">\
                  <path d=\"M1 1H39V39H1Z\" stroke=\"#000\" stroke-width=\".01\" fill=\"none\"/></svg>";
    let line = |[x0, y0, x1, y1]: [f64; 4]| format!("0\nLINE\n8\n0\n10\n{x0}\n20\n{y0}\n11\n{x1}\n21\n{y1}\n");
    let lines = [[10.0, 5.0, 50.0, 5.0], [50.0, 5.0, 50.0, 45.0], [50.0, 45.0, 10.0, 5.0]].map(line).concat();
    let files = [
        ("square.svg", square.to_owned()),
        ("lines.dxf", format!("0\nSECTION\n2\nENTITIES\n{lines}0\nENDSEC\n0\nEOF\n")),
        ("curves.csv", "id,x,y,z\n1,20,20,0\n1,40,40,0\n".to_owned()),
    ];
    files.into_iter().for_each(|(name, text)| std::fs::write(dir.path().join(name), text).expect("writable"));
    let whole = "area = \"part\"";
    for (texture, code, says) in [
        ("file = \"square.svg\"".to_owned(), "", ""),
        ("file = \"square.svg\"\nscale = 15".to_owned(), "job-empty", "25.4: set scale = 0.590551"),
        ("file = \"square.svg\"\nscale = 25.4".to_owned(), "job-empty", "16.0909 times the part (60 mm x 50 mm)"),
        (
            format!("file = \"square.svg\"\nscale = 25.4\norigin = [\"-8 mm\", \"-9 mm\"]\n{whole}"),
            "texture-scale",
            "set scale = 1,",
        ),
        (
            format!("file = \"square.svg\"\nsize = [\"1016 mm\", \"1016 mm\"]\norigin = [\"9 mm\", \"9 mm\"]\n{whole}"),
            "texture-scale",
            "set size = [\"40 mm\", \"40 mm\"]",
        ),
        ("file = \"square.svg\"\nscale = 0.001".to_owned(), "texture-scale", "1/1578.95 of the part"),
        (
            "file = \"square.svg\"\nscale = 0.01\ntile = true\narea = [\"1 mm\", \"1 mm\", \"3 mm\", \"3 mm\"]"
                .to_owned(),
            "",
            "",
        ),
        ("file = \"lines.dxf\"\nunit = \"mm\"".to_owned(), "", ""),
        ("file = \"lines.dxf\"\nunit = \"in\"".to_owned(), "job-empty", "set unit = \"mm\""),
        ("file = \"lines.dxf\"\nunit = \"m\"".to_owned(), "texture-far", "a factor of 1000: set unit = \"mm\""),
        ("file = \"lines.dxf\"\nunit = \"um\"".to_owned(), "texture-scale", "a factor of 1/1000: set unit = \"mm\""),
        ("curves = \"curves.csv\"\nunit = \"in\"".to_owned(), "job-empty", "a factor of 25.4: set unit = \"mm\""),
        ("curves = \"curves.csv\"\nunit = \"m\"".to_owned(), "texture-far", "a factor of 1000: set unit = \"mm\""),
    ] {
        let mut job = panel(dir.path());
        job.focus = "pdof = \"3 mm\"".into();
        job.textures = vec![texture.clone()];
        let (codes, text) = printed(&job.write(dir.path(), "job.toml"));
        let wanted: Vec<&str> = Some(code).filter(|c| !c.is_empty()).into_iter().collect();
        assert!(codes == wanted && text.contains(says), "{texture}: {codes:?}, not {wanted:?} and {says:?}: {text}");
    }
    // Most of it lies off the part: the refusal says why.
    let mut job = panel(dir.path());
    job.textures = vec!["file = \"square.svg\"\nscale = 10\norigin = [\"10 mm\", \"10 mm\"]".into()];
    let (codes, text) = printed(&job.write(dir.path(), "job.toml"));
    assert!(codes == ["off-part"] && text.contains("a factor of 25.4: set scale = 0.393701"), "{codes:?}: {text}");
}

#[test]
#[ignore = "slow: make test-all"]
fn months_of_work_and_marks_on_marks_are_reported_with_their_texture() {
    let dir = folder();
    let lines = |step: f64| (0..1000).map(|i| format!("M{} 1v.2", 1.0 + f64::from(i) * step)).collect::<String>();
    let drawing = |lines: &str| {
        let text = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"9mm\" height=\"9mm\" viewBox=\"0 0 9 9\">\
             <path d=\"{lines}\" stroke=\"#000\" stroke-width=\".01\" fill=\"none\"/></svg>"
        );
        std::fs::write(dir.path().join("lines.svg"), text).expect("writable");
    };
    let said_of = |pitch: &str, speed: &str, passes: u32| {
        let mut job = panel(dir.path());
        job.textures = vec![format!("pattern = \"hatch\"\npitch = \"{pitch}\""), "file = \"lines.svg\"".to_owned()];
        let path = job.write(dir.path(), "job.toml");
        let text = std::fs::read_to_string(&path).expect("readable");
        let changed = text.replace("1000 mm/s", speed);
        assert!(changed != text || speed == "1000 mm/s");
        std::fs::write(&path, changed + &format!("[passes]\ncount = {passes}\n")).expect("writable");
        printed(&path)
    };
    // 200 mm under a spot of 0.02 mm on a box of 0.12 x 0.22 mm: 152 times.
    drawing(&lines(1e-4));
    let (codes, text) = said_of("1 mm", "1000 mm/s", 1);
    assert!(codes == ["marks-many"] && text.contains("texture 2 marks every place 15"), "{codes:?}: {text}");
    // Passes are stated by the job, so they are not counted.
    drawing(&lines(2e-4));
    assert_eq!(said_of("1 mm", "1000 mm/s", 1).0, [""; 0]);
    assert_eq!(said_of("1 mm", "1000 mm/s", 3).0, [""; 0]);
    // 3.06 m at 13 um/s, near the least speed of pens: 2.7 days, and 33 in twelve passes.
    drawing("M1 1h1");
    assert_eq!(said_of("1 mm", "0.013 mm/s", 1).0, [""; 0]);
    let (codes, text) = said_of("1 mm", "0.013 mm/s", 12);
    assert!(
        codes == ["job-long"] && text.contains("most of it is texture 1, 3060.000 mm (100 %)"),
        "{codes:?}: {text}"
    );
}

#[test]
fn texture_off_the_part_is_refused_with_both_boxes() {
    let dir = folder();
    let mut job = panel(dir.path());
    job.textures[0] += "\narea = [\"80 mm\", \"10 mm\", \"90 mm\", \"20 mm\"]";
    let text = refused(&job.write(dir.path(), "job.toml"), &["job-empty"]);
    let boxes = "the texture lies at x 80.000 to 90.000 mm and y 10.000 to 20.000 mm, off the part at x 0.000 to \
                 60.000 mm and y 0.000 to 50.000 mm";
    assert!(text.contains(boxes), "{text}");
    // Turned by 90 deg the part lies at x -50 to 0 mm, and the texture with it.
    job.more = "[placement]\nturn = \"90 deg\"\n".into();
    let text = refused(&job.write(dir.path(), "job.toml"), &["job-empty"]);
    assert!(text.contains("off the part at x -50.000 to 0.000 mm"), "{text}");
}

/// The number that stands in a text between two others.
fn figure(text: &str, before: &str, after: &str) -> f64 {
    let (_, rest) = text.split_once(before).unwrap_or_else(|| panic!("no {before:?}: {text}"));
    let (number, _) = rest.split_once(after).unwrap_or_else(|| panic!("no {after:?}: {text}"));
    number.parse().unwrap_or_else(|e| panic!("{number}: {e}: {text}"))
}

/// Holds that the origins of a travel error compile, and those a field beside them do not.
fn assert_origins(job: &JobText, dir: &Path, axis: usize) {
    let at = |v: f64| -> PathBuf {
        let mut origin = [0.0; 3];
        origin[axis] = v;
        let mut job = JobText { textures: job.textures.clone(), surface: job.surface.clone(), ..JobText::on(dir) };
        let [x, y, z] = origin;
        job.more = format!("[placement]\norigin = [\"{x} mm\", \"{y} mm\", \"{z} mm\"]\n");
        job.write(dir, "job.toml")
    };
    let name = ["x", "y", "z"][axis];
    let text = refused(&at(300.0), &["travel"]);
    assert!(text.contains(&format!("{name} beyond travel by ")) && text.contains(" stops: needed are "), "{text}");
    let lo = figure(&text, &format!("placement.origin with {name} between "), " and ");
    let hi = figure(&text, &format!("between {lo} and "), " mm fits");
    assert!(lo < hi, "{text}");
    for v in [lo, hi] {
        accepted(&at(v));
    }
    // Stops that slide inside their fields may save a little more than that.
    for v in [lo - 40.001, hi + 40.001] {
        refused(&at(v), &["travel"]);
    }
}

#[test]
fn travel_error_suggests_an_origin_that_compiles() {
    let dir = folder();
    for axis in 0..3 {
        assert_origins(&panel(dir.path()), dir.path(), axis);
    }
}

#[test]
fn travel_error_on_the_fly_suggests_an_origin_that_compiles() {
    let dir = folder();
    let stl = dir.path().join("small.stl");
    write_stl(&stl, &mesh(4, [0.0, 0.0, 6.0, 4.0], |x, y| math::sin(x / 20.0) * math::cos(y / 17.0)));
    let mut job = JobText::on(&stl).texture("pattern = \"hatch\"\npitch = \"2 mm\"").method("z-range");
    job.focus = "pdof = \"1 mm\"".into();
    let mut at = |x: f64| {
        job.more = format!("[placement]\norigin = [\"{x} mm\", \"0 mm\", \"0 mm\"]\n");
        let job = job.write(dir.path(), "job.toml");
        let args = ["check", "--mode", "on-the-fly"].map(Path::new);
        terrace(args.into_iter().chain([job.as_path()]))
    };
    let text = said(&at(300.0));
    assert_eq!(text.matches("error[travel]").count(), 1, "{text}");
    assert!(text.contains("X beyond travel by ") && text.contains(" positions: needed are "), "{text}");
    let lo = figure(&text, "placement.origin with x between ", " and ");
    let hi = figure(&text, &format!("between {lo} and "), " mm fits");
    for x in [lo, hi] {
        let done = at(x);
        assert_eq!(done.status.code(), Some(0), "{x}: {}", said(&done));
    }
    assert!(said(&at(hi + 1.0)).contains(&format!("between {lo} and {hi} mm")), "{text}");
}

#[test]
fn clearance_error_suggests_a_working_distance_that_compiles() {
    let dir = folder();
    let stl = dir.path().join("mast.stl");
    // A mast of 150 mm beside a plate.
    let wall = [[[5.0, 5.0, 150.0], [6.0, 5.0, 150.0], [5.0, 6.0, 150.0]]];
    write_stl(&stl, &[mesh(4, [0.0, 0.0, 60.0, 50.0], |_, _| 0.0), wall.to_vec()].concat());
    let machine = machine_file("xyz-galvo-40");
    let (_, rest) = machine.split_once("working_distance = ").expect("the key");
    let own = rest.split('\n').next().expect("a value").split(" #").next().expect("a value").trim();
    let mut job = JobText::on(&stl)
        .texture("pattern = \"hatch\"\npitch = \"5 mm\"\narea = [\"0 mm\", \"20 mm\", \"60 mm\", \"50 mm\"]");
    job.machine = "file = \"ours.toml\"".into();
    let with = |value: &str| {
        let text = machine.replace(&format!("working_distance = {own}"), &format!("working_distance = {value}"));
        std::fs::write(dir.path().join("ours.toml"), text).expect("writable");
        job.write(dir.path(), "job.toml")
    };
    let text = refused(&with(own), &["clearance"]);
    let enough = figure(&text, "a lens.working_distance of ", " mm");
    accepted(&with(&format!("\"{enough} mm\"")));
    refused(&with(&format!("\"{} mm\"", enough - 0.01)), &["clearance"]);
}

#[test]
fn strokes_error_suggests_a_section_that_compiles() {
    let dir = folder();
    let machine = machine_file("xyz-galvo-40");
    assert!(!machine.contains("[controller]"), "{machine}");
    let text = format!("{machine}\n[controller]\nmax_strokes = 12\n");
    std::fs::write(dir.path().join("ours.toml"), text).expect("writable");
    let mut job = panel(dir.path());
    job.machine = "file = \"ours.toml\"".into();
    let text = refused(&job.write(dir.path(), "job.toml"), &["strokes"]);
    let section = figure(&text, "a partition.section of ", " mm");
    job.partition = format!("section = \"{section} mm\"");
    accepted(&job.write(dir.path(), "job.toml"));
}

#[test]
#[ignore = "slow: make test-all"]
fn part_longer_than_travel_gets_hints_about_unit_and_set_ups() {
    let dir = folder();
    let mut job = panel(dir.path());
    job.textures = vec!["pattern = \"hatch\"\npitch = \"20 mm\"".into()];
    job.focus = "pdof = \"1 mm\"".into();
    job.surface = job.surface.replace("unit = \"mm\"", "unit = \"in\"");
    let text = refused(&job.write(dir.path(), "job.toml"), &["travel", "travel"]);
    assert_eq!(text.matches("check the unit of the part").count(), 2, "{text}");
    assert!(text.contains("use [setups] with columns = 4 and rows = 3"), "{text}");
}

#[test]
#[ignore = "slow: make test-all"]
#[cfg(target_os = "linux")]
fn strokes_beyond_the_limit_of_memory_are_refused_with_the_figure() {
    let dir = folder();
    let mut job = panel(dir.path());
    job.textures = vec!["pattern = \"hatch\"\npitch = \"5 um\"".into()];
    job.focus = "pdof = \"0.02 mm\"".into();
    let job = job.write(dir.path(), "job.toml");
    let within = |limit: u32| {
        let script = format!("ulimit -v {limit} && exec \"$0\" check \"$1\" -j1");
        let mut shell = Command::new("sh");
        // Else every thread reserves 64 MB of addresses that it does not use.
        shell.env("MALLOC_ARENA_MAX", "1").args(["-c", &script, env!("CARGO_BIN_EXE_terrace")]).arg(&job);
        shell.output().expect("sh starts")
    };
    let done = within(120_000);
    let text = said(&done);
    assert_eq!(done.status.code(), Some(1), "{text}");
    assert!(text.contains("error[memory]: the program needs about "), "{text}");
    assert!(within(4_000_000).status.success(), "{}", said(&within(4_000_000)));
}

#[test]
fn a_missing_file_and_an_impossible_pen_point_at_their_keys() {
    let dir = folder();
    let mut job = panel(dir.path());
    job.textures.push("file = \"absent.svg\"".into());
    let path = job.write(dir.path(), "job.toml");
    let text = said(&check(&path));
    assert!(text.contains("cannot read the file") && text.contains("file = \"absent.svg\""), "{text}");
    job.textures.pop();
    let path = job.write(dir.path(), "job.toml");
    let fast = std::fs::read_to_string(&path).expect("readable").replace("1000 mm/s", "9 m/s");
    std::fs::write(&path, fast).expect("writable");
    assert!(refused(&path, &["pen-speed"]).contains("speed = \"9 m/s\""));
}

#[test]
fn what_a_card_would_clip_and_what_is_no_number_is_refused_before_anything_is_written() {
    let dir = folder();
    let out = dir.path().join("out.job");
    let machine = machine_file("xyz-galvo-40");
    let refused = |cards: &str, format: &str, job: &dyn Fn(&mut JobText), exit: i32, code: &str| {
        std::fs::write(dir.path().join("ours.toml"), format!("{machine}\n{cards}")).expect("writable");
        let mut text = panel(dir.path());
        text.machine = "file = \"ours.toml\"".into();
        text.more = format!("[emit]\nformats = [{format:?}]\n");
        job(&mut text);
        let path = text.write(dir.path(), "job.toml");
        let done = terrace([Path::new("compile"), &path, Path::new("-o"), &out]);
        let shown = said(&done);
        assert_eq!(done.status.code(), Some(exit), "{cards}: {shown}");
        assert!(shown.contains(&format!("error[{code}]")), "{cards}: {shown}");
        let left = std::fs::read_dir(dir.path()).expect("readable").map(|e| e.expect("readable").file_name());
        assert!(left.into_iter().all(|name| !name.to_string_lossy().contains("out.job")), "{cards}");
    };
    let lmc = |scale: &str| format!("[lmc]\nunits_per_mm = {scale}\n");
    let rtc = |scale: &str| format!("[rtc]\nboard = \"rtc5\"\nbits_per_mm = {scale}\n");
    let as_is = |_: &mut JobText| {};
    // 40 mm of field: 16 bits are 1638 units per mm, 20 bits 26214.
    refused(&lmc("3000"), "lmc", &as_is, 1, "lmc-field");
    refused(&rtc("40000"), "rtc", &as_is, 1, "rtc-field");
    for scale in ["nan", "-nan", "inf", "0"] {
        refused(&lmc(scale), "lmc", &as_is, 2, "machine-scale");
        refused(&rtc(scale), "rtc", &as_is, 2, "machine-scale");
    }
    for number in ["nan", "inf", "1e999"] {
        let pitch = |job: &mut JobText| job.textures[0] = format!("pattern = \"hatch\"\npitch = \"{number} mm\"");
        refused("", "dxf", &pitch, 2, "toml");
        let focus =
            |job: &mut JobText| job.focus = format!("dof = \"0.07 mm\"\nfactor = {}", number.replace("1e999", "nan"));
        refused("", "lightburn", &focus, 2, "focus-factor");
    }
}

#[test]
fn the_same_texture_twice_and_lines_that_a_drawing_repeats_are_reported_with_their_length() {
    let dir = folder();
    let path = |lines: &str| {
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"10mm\" height=\"10mm\" viewBox=\"0 0 10 10\">\
             <path d=\"{lines}\" stroke=\"#000\" stroke-width=\".01\" fill=\"none\"/></svg>"
        )
    };
    std::fs::write(dir.path().join("once.svg"), path("M0 0h8v6z M1 9h8")).expect("writable");
    // The same line there, back, and as a side of another figure.
    std::fs::write(dir.path().join("again.svg"), path("M0 0h8v6z M8 0h-8 M8 6v-6l1 1")).expect("writable");
    let with = |textures: &[&str]| {
        let mut job = panel(dir.path());
        job.textures = textures.iter().map(|&t| t.to_owned()).collect();
        job.more = "[[pen]]\nname = \"other\"\nspeed = \"900 mm/s\"\npower = \"9 %\"\nfrequency = \"60 kHz\"\n\n\
                    [[pen]]\nname = \"dark\"\nspeed = \"900 mm/s\"\npower = \"0 %\"\nfrequency = \"60 kHz\"\n"
            .into();
        accepted(&job.write(dir.path(), "job.toml"))
    };
    let printed = |text: &str, code: &str| text.matches(&format!("warning[{code}]")).count();
    let (hatch, once) = ("pattern = \"hatch\"\npitch = \"0.5 mm\"", "file = \"once.svg\"");
    let crossed = "pattern = \"hatch\"\npitch = \"0.5 mm\"\ndirection = \"90 deg\"";
    let text = with(&[hatch, once, crossed, "file = \"once.svg\"\norigin = [\"20 mm\", \"0 mm\"]"]);
    assert_eq!(
        [printed(&text, "texture-twice"), printed(&text, "lines-twice"), printed(&text, "pen-no-power")],
        [0; 3],
        "{text}"
    );
    let text = with(&[hatch, once, hatch]);
    assert!(printed(&text, "texture-twice") == 1 && text.contains("textures 1 and 3 have the same lines"), "{text}");
    // 24 mm around the triangle and the line of 8 mm; another pen does not matter.
    let text = with(&[once, "file = \"once.svg\"\npen = \"other\"", once]);
    assert!(text.contains("textures 1 and 2 have the same lines or dots: 32.000 mm are marked by both"), "{text}");
    assert!(text.contains("textures 1 and 3 have") && printed(&text, "texture-twice") == 2, "{text}");
    let text = with(&["file = \"again.svg\""]);
    assert!(text.contains("texture 1 has lines or dots more than once: 14.000 mm are marked again"), "{text}");
    let text = with(&[hatch, "file = \"once.svg\"\npen = \"dark\""]);
    let wanted = "texture 2 is marked with pen \"dark\", which has no power";
    assert!(printed(&text, "pen-no-power") == 1 && text.contains(wanted), "{text}");
}
