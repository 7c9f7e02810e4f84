//! On-the-fly jobs by the program itself: compiled, read back, proved.

use std::path::Path;
use std::process::Command;
use terrace_core::math;

use crate::support::surfaces::{dome, mesh, write_stl};
use crate::support::{fixture, folder, number, said, shared};

fn terrace(arguments: &[&str]) -> std::process::Output {
    Command::new(env!("CARGO_BIN_EXE_terrace")).args(arguments).arg("--no-sync").output().expect("terrace runs")
}

fn job(dir: &Path, profile: &str, pdof: &str, speed: &str, pitch: &str, more: &str) -> String {
    let text = format!(
        "surface = {{ file = \"part.stl\", unit = \"mm\" }}\nfocus = {{ pdof = {pdof:?} }}\n{more}\
         partition = {{ method = \"z-range\" }}\nmachine = {{ profile = {profile:?} }}\n\
         [[texture]]\npattern = \"hatch\"\npitch = {pitch:?}\ndirection = \"10 deg\"\n\
         [[pen]]\nname = \"fine\"\nspeed = {speed:?}\npower = \"60 %\"\nfrequency = \"60 kHz\"\n"
    );
    let path = dir.join("job.toml");
    std::fs::write(&path, text).expect("write");
    path.display().to_string()
}

/// Compiles and proves a job; its summary and its proof.
fn proved(dir: &Path, job: &str) -> [serde_json::Value; 2] {
    let out = dir.join("made.job").display().to_string();
    let made = terrace(&["compile", "--mode", "on-the-fly", "--json", job, "-o", &out]);
    assert!(made.status.success(), "{}", said(&made));
    let proof = terrace(&["verify", "--json", &out]);
    assert!(proof.status.success(), "{}", said(&terrace(&["verify", &out])));
    let json = |o: &std::process::Output| serde_json::from_slice(&o.stdout).expect("JSON");
    let found: [serde_json::Value; 2] = [json(&made), json(&proof)];
    eprintln!("{}", found[0]);
    eprintln!("{} um, {} um", found[1]["worst_position_um"], found[1]["worst_defocus_um"]);
    found
}

#[test]
#[ignore = "slow: make test-all"]
fn five_axis_job_compiles_and_verifies() {
    let dir = folder();
    let dome = |x: f64, y: f64| -((x - 40.0).powi(2) + (y - 30.0).powi(2)) / 500.0;
    write_stl(&dir.path().join("part.stl"), &mesh(80, [0.0, 0.0, 80.0, 60.0], dome));
    let job = job(dir.path(), "xyz-galvo-40", "0.5 mm", "100 mm/s", "2 mm", "");
    let [summary, proof] = proved(dir.path(), &job);
    assert!(proof["worst_position_um"].as_f64().is_some_and(|p| p < 0.2), "{proof}");
    // 100 mm/s; LinuxCNC switches once a millisecond, PMAC every 50 us.
    let early: Vec<f64> =
        summary["laser"].as_array().expect("programs").iter().map(|l| number(l, "laser_error_mm")).collect();
    assert!((early[0] - 0.1).abs() < 0.01 && (early[0] / early[1] - 20.0).abs() < 1e-9, "{summary}");
    let kept = std::fs::read_to_string(dir.path().join("made.job/manifest.json")).expect("a manifest");
    assert!(kept.contains("\"on-the-fly\""));
    // The same job on any number of threads.
    let bytes = || {
        ["fly.ngc", "fly.pmc", "manifest.json"]
            .map(|f| std::fs::read(dir.path().join("made.job").join(f)).expect("bytes"))
    };
    let first = bytes();
    let out = dir.path().join("made.job").display().to_string();
    assert!(terrace(&["compile", "-j", "1", "--mode", "on-the-fly", &job, "-o", &out]).status.success());
    assert!(first == bytes());
}

#[test]
fn seven_axis_job_compiles_and_verifies() {
    let dir = folder();
    let bowl = |x: f64, y: f64| -0.25 * y - (x * x + y * y) / 200.0;
    write_stl(&dir.path().join("part.stl"), &mesh(60, [-8.0, -4.0, 8.0, 4.0], bowl));
    let job =
        job(dir.path(), "xyzac-galvo-10", "0.25 mm", "100 mm/s", "1 mm", "limits = { max_incidence = \"30 deg\" }\n");
    let [summary, proof] = proved(dir.path(), &job);
    assert!(proof["worst_position_um"].as_f64().is_some_and(|p| p < 1.0), "{proof}");
    // The table's own limits, to a millionth.
    for (axis, limit) in [("A", 1.99f64), ("C", 3.74)] {
        let most = summary["peaks"][axis]["acceleration"].as_f64().expect("a number");
        assert!(most <= limit.to_degrees() * (1.0 + 1e-6), "{axis}: {most}");
    }
}

#[test]
#[ignore = "slow: make test-all"]
fn reversed_axes_and_mirrored_or_swapped_fields_verify() {
    let dir = folder();
    let slope = |x: f64, y: f64| 0.05 * x - 0.03 * y - x * x / 900.0;
    write_stl(&dir.path().join("part.stl"), &mesh(40, [0.0, 0.0, 60.0, 30.0], slope));
    let job = job(dir.path(), "xyz-galvo-40", "0.2 mm", "100 mm/s", "5 mm", "");
    let machine = said(&terrace(&["machines", "xyz-galvo-40"]));
    let part = "carries = \"part\"";
    let changed = [
        machine.replace("mirror_y = false", "mirror_y = true"),
        machine.replace("swap_xy = false", "swap_xy = true").replace("mirror_x = false", "mirror_x = true"),
        machine.replacen(part, "carries = \"head\"", 1),
        machine.replace(part, "carries = \"head\"").replace("mirror_x = false", "mirror_x = true"),
        machine.replace("carries = \"head\"", part),
    ];
    let text = std::fs::read_to_string(&job).expect("a job");
    for changed in changed {
        assert_ne!(machine, changed);
        std::fs::write(dir.path().join("machine.toml"), &changed).expect("a file");
        std::fs::write(&job, text.replace("profile = \"xyz-galvo-40\"", "file = \"machine.toml\"")).expect("a file");
        let [_, proof] = proved(dir.path(), &job);
        assert!(proof["worst_position_um"].as_f64().is_some_and(|p| p < 0.2), "{proof}");
    }
}

/// A job's text on a surface with one pen of 1000 mm/s.
fn real(surface: &Path, texture: &str, profile: &str, origin: &str) -> String {
    format!(
        "surface = {{ file = {:?}, unit = \"mm\" }}\nfocus = {{ pdof = \"0.07 mm\" }}\n{origin}\
         machine = {{ profile = {profile:?} }}\n[[texture]]\n{texture}\n\
         [[pen]]\nname = \"fine\"\nspeed = \"1000 mm/s\"\npower = \"60 %\"\nfrequency = \"60 kHz\"\n",
        surface.display().to_string()
    )
}

/// Every mark of a job is proved to lie within a micrometre and 2 nm of its place, and in focus.
fn is_true(dir: &Path, text: &str) {
    let job = dir.join("job.toml");
    std::fs::write(&job, text).expect("a file");
    let [summary, proof] = proved(dir, &job.display().to_string());
    let um = |key: &str| proof[key].as_f64().expect("a number");
    assert!(um("worst_position_um") < 1.002 && um("worst_defocus_um") <= 35.002, "{proof}");
    assert!(number(&summary["laser"][0], "laser_error_mm") > 0.0, "{summary}");
}

#[test]
#[ignore = "slow: make test-all"]
fn dome_verifies_with_five_axes_and_its_top_with_seven() {
    let dir = folder();
    let stl = dir.path().join("part.stl");
    write_stl(&stl, &mesh(40, [205.0, 210.0, 245.0, 250.0], dome));
    is_true(dir.path(), &real(&stl, "pattern = \"hatch\"\npitch = \"10 mm\"", "xyz-galvo-40", ""));
    let top = "pattern = \"hatch\"\npitch = \"2 mm\"\narea = [\"215 mm\", \"220 mm\", \"235 mm\", \"235 mm\"]";
    let origin = "placement = { origin = [\"-225 mm\", \"-225 mm\", \"0 mm\"] }\n";
    is_true(dir.path(), &real(&stl, top, "xyzac-galvo-10", origin));
}

#[test]
#[ignore = "slow: make test-all"]
fn dome_of_450_mm_verifies_with_five_axes() {
    let dir = folder();
    let stl = dir.path().join("part.stl");
    write_stl(&stl, &mesh(200, [0.0, 0.0, 450.0, 450.0], dome));
    is_true(dir.path(), &real(&stl, "pattern = \"hatch\"\npitch = \"5 mm\"", "xyz-galvo-40", ""));
}

/// A drawing on a patch of the hood, whose lower corner is at (600, -50) mm.
fn hood(drawing: &Path, size: f64, profile: &str, origin: &str) {
    let drawing = format!(
        "file = {:?}\nsize = [\"100 mm\", \"100 mm\"]\norigin = [\"600 mm\", \"-50 mm\"]\nfill = \"outline\"\nstroke = \"centre\"\n\
         area = [\"600 mm\", \"-50 mm\", \"{} mm\", \"{} mm\"]",
        drawing.display().to_string(),
        600.0 + size,
        size - 50.0
    );
    is_true(folder().path(), &real(&fixture("hood.stl"), &drawing, profile, origin));
}

/// Where the patch lies on the turntable.
const ON_THE_TURNTABLE: &str = "placement = { origin = [\"-650 mm\", \"0 mm\", \"-100 mm\"] }\n";

#[test]
#[ignore = "slow: make test-all"]
fn drawing_on_a_hood_verifies_with_five_axes() {
    hood(&fixture("leather.svg"), 8.0, "xyz-galvo-40", "");
}

#[test]
#[ignore = "slow, needs ../shared: make test-all"]
fn drawing_on_100_mm_of_a_hood_verifies_with_five_and_seven_axes() {
    let drawing = shared().join("textures/hero_topography.svg");
    hood(&drawing, 100.0, "xyz-galvo-40", "");
    hood(&drawing, 100.0, "xyzac-galvo-10", ON_THE_TURNTABLE);
}

#[test]
fn pole_far_from_the_file_origin_verifies() {
    let dir = folder();
    // The top of a dome in the middle of the marks, 360 mm from the file's origin: C turns by half a turn there.
    let dome = |x: f64, y: f64| -((x - 300.0).powi(2) + (y - 200.0).powi(2)) / 500.0;
    write_stl(&dir.path().join("part.stl"), &mesh(60, [292.0, 196.0, 308.0, 204.0], dome));
    let job = job(dir.path(), "xyzac-galvo-10", "0.1 mm", "100 mm/s", "2 mm", "");
    let [_, proof] = proved(dir.path(), &job);
    assert!(proof["worst_position_um"].as_f64().is_some_and(|p| p < 1.0), "{proof}");
}

#[test]
#[ignore = "slow: make test-all"]
fn c_rewinds_during_jumps_within_its_travel() {
    // Jumps of a millimetre and of a twentieth; travel that lies to one side, whichever way the axis counts.
    rings(1.0, ["-360 deg", "360 deg"], false);
    rings(0.05, ["-350 deg", "90 deg"], false);
    rings(0.05, ["-90 deg", "350 deg"], true);
}

fn rings(pitch: f64, travel: [&str; 2], reversed: bool) {
    let dir = folder();
    // Five rings about the pole, all the same way round: more turns than the travel of C holds.
    let dome = |x: f64, y: f64| -(x * x + y * y) / 400.0;
    write_stl(&dir.path().join("part.stl"), &mesh(80, [-20.0, -20.0, 20.0, 20.0], dome));
    let rings: String =
        (0..5).map(|i| format!("<circle cx=\"18\" cy=\"18\" r=\"{}\"/>", 13.0 + pitch * f64::from(i))).collect();
    let svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"36mm\" height=\"36mm\" viewBox=\"0 0 36 36\">\
         <g fill=\"none\" stroke=\"black\" stroke-width=\"0.001\">{rings}</g></svg>"
    );
    std::fs::write(dir.path().join("rings.svg"), svg).expect("a file");
    let text = "surface = { file = \"part.stl\", unit = \"mm\" }\nfocus = { pdof = \"0.1 mm\" }\n\
                machine = { file = \"machine.toml\" }\n[[texture]]\nfile = \"rings.svg\"\n\
                origin = [\"-18 mm\", \"-18 mm\"]\n\
                [[pen]]\nname = \"fine\"\nspeed = \"100 mm/s\"\npower = \"60 %\"\nfrequency = \"60 kHz\"\n";
    let machine = said(&terrace(&["machines", "xyzac-galvo-10"]));
    let own = format!("travel = [{:?}, {:?}]\nreversed = {reversed}", travel[0], travel[1]);
    let machine = machine.replace("travel = \"continuous\"", &own);
    assert!(machine.contains(&own), "{machine}");
    std::fs::write(dir.path().join("machine.toml"), machine).expect("a file");
    let job = dir.path().join("job.toml");
    std::fs::write(&job, text).expect("a file");
    let [_, proof] = proved(dir.path(), &job.display().to_string());
    assert!(proof["worst_position_um"].as_f64().is_some_and(|p| p < 1.0), "{proof}");
    let program = std::fs::read_to_string(dir.path().join("made.job/fly.pmc")).expect("a program");
    let c: Vec<f64> = program.split_whitespace().filter_map(|w| w.strip_prefix('C')?.parse().ok()).collect();
    let [lo, hi] = c.iter().fold([0.0f64, 0.0f64], |[lo, hi], &c| [lo.min(c), hi.max(c)]);
    // Five rings and four turns back.
    let way: f64 = c.windows(2).map(|w| (w[1] - w[0]).abs()).sum();
    let [from, to] = travel.map(|t| t.trim_end_matches(" deg").parse::<f64>().expect("degrees"));
    assert!(lo >= from && hi <= to && way > 8.5 * 360.0, "{lo} {hi} {way}");
}

/// One line that goes three times round the top of a dome, marked on a turntable with this in its machine file.
fn spiral(dir: &Path, turntable: &str) -> String {
    let dome = |x: f64, y: f64| -(x * x + y * y) / 200.0;
    write_stl(&dir.join("part.stl"), &mesh(40, [-6.0, -6.0, 6.0, 6.0], dome));
    let points: String = (0..=216)
        .map(|i| (f64::from(i) * 5f64.to_radians(), 4.0 + 0.005 * f64::from(i)))
        .map(|(angle, r)| format!("{:.4},{:.4} ", 6.0 + r * math::cos(angle), 6.0 + r * math::sin(angle)))
        .collect();
    let svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"12mm\" height=\"12mm\" viewBox=\"0 0 12 12\">\
         <g fill=\"none\" stroke=\"black\" stroke-width=\"0.001\"><polyline points=\"{points}\"/></g></svg>"
    );
    std::fs::write(dir.join("spiral.svg"), svg).expect("a file");
    let machine = said(&terrace(&["machines", "xyzac-galvo-10"]));
    let continuous = "travel = \"continuous\"";
    assert!(machine.contains(continuous), "{machine}");
    std::fs::write(dir.join("machine.toml"), machine.replace(continuous, turntable)).expect("a file");
    let text = "surface = { file = \"part.stl\", unit = \"mm\" }\nfocus = { pdof = \"0.02 mm\" }\n\
                machine = { file = \"machine.toml\" }\nlimits = { warn_incidence = \"1 deg\" }\n\
                [[texture]]\nfile = \"spiral.svg\"\norigin = [\"-6 mm\", \"-6 mm\"]\n\
                [[pen]]\nname = \"fine\"\nspeed = \"50 mm/s\"\npower = \"60 %\"\nfrequency = \"60 kHz\"\n";
    let job = dir.join("job.toml");
    std::fs::write(&job, text).expect("a file");
    job.display().to_string()
}

#[test]
#[ignore = "slow: make test-all"]
fn continuous_turntable_goes_round_as_often_as_a_stroke_does() {
    let dir = folder();
    let mut made = Vec::new();
    for commands in ["absolute", "modulo"] {
        let job = spiral(dir.path(), &format!("travel = \"continuous\"\ncommands = {commands:?}"));
        let [summary, proof] = proved(dir.path(), &job);
        assert!(proof["worst_position_um"].as_f64().is_some_and(|p| p < 1.0), "{proof}");
        let program = std::fs::read_to_string(dir.path().join("made.job/fly.pmc")).expect("a program");
        let c: Vec<f64> = program.split_whitespace().filter_map(|w| w.strip_prefix('C')?.parse().ok()).collect();
        made.push((summary["time_s"].clone(), c));
    }
    let [(time, absolute), (same, modulo)] = &made[..] else { panic!("two programs") };
    assert_eq!((time, absolute.len()), (same, modulo.len()));
    let ends = absolute.iter().fold([0.0f64; 2], |[lo, hi], &c| [lo.min(c), hi.max(c)]);
    assert!(ends[1] - ends[0] > 900.0, "{ends:?}");
    for (a, m) in absolute.iter().zip(modulo) {
        assert!((0.0..360.0).contains(m) && (a - m).rem_euclid(360.0).min((m - a).rem_euclid(360.0)) < 1e-6, "{a} {m}");
    }
    // Such a controller does not take an angle beyond a turn.
    let path = dir.path().join("made.job/fly.pmc");
    let text = std::fs::read_to_string(&path).expect("a program");
    let beyond = text.rfind(" C").map(|at| format!("{}{}", &text[..at], text[at..].replacen(" C", " C3", 1)));
    std::fs::write(&path, beyond.expect("an angle")).expect("a file");
    let proof = terrace(&["verify", &dir.path().join("made.job").display().to_string()]);
    assert!(proof.status.code() == Some(1) && said(&proof).contains("agreement  BROKEN"), "{}", said(&proof));
}

#[test]
#[ignore = "slow: make test-all"]
fn turns_beyond_the_travel_of_c_are_refused_with_what_they_need() {
    let dir = folder();
    let job = spiral(dir.path(), "travel = [\"-360 deg\", \"360 deg\"]");
    let out = terrace(&["compile", "--mode", "on-the-fly", &job]);
    assert_eq!(out.status.code(), Some(1), "{}", said(&out));
    let text = said(&out);
    assert!(text.contains("error[travel]: C would have to turn from") && text.contains("continuous"), "{text}");
    assert!(text.contains("its travel is -360 to 360 deg"), "{text}");
    // Twice as much holds it.
    let job = spiral(dir.path(), "travel = [\"-1100 deg\", \"1100 deg\"]");
    assert!(proved(dir.path(), &job)[1]["ok"] == true);
}

#[test]
fn keys_without_on_the_fly_support_are_refused() {
    let dir = folder();
    write_stl(&dir.path().join("part.stl"), &mesh(4, [0.0, 0.0, 8.0, 6.0], |_, _| 0.0));
    let job = job(dir.path(), "xyz-galvo-40", "0.5 mm", "100 mm/s", "2 mm", "passes = { count = 2 }\n");
    let out = terrace(&["compile", "--mode", "on-the-fly", &job]);
    assert_eq!(out.status.code(), Some(1), "{}", said(&out));
    assert!(said(&out).contains("fly-job"), "{}", said(&out));
    assert!(!dir.path().join("job.job").exists());
}

/// A plate with a block on it whose walls are upright.
fn block(size: [f64; 2], [x0, y0, x1, y1]: [f64; 4], top: f64) -> Vec<[[f64; 3]; 3]> {
    let mut out = mesh(6, [0.0, 0.0, size[0], size[1]], |_, _| 0.0);
    out.extend(mesh(1, [x0, y0, x1, y1], |_, _| top));
    for [[ax, ay], [bx, by]] in [[[x0, y0], [x1, y0]], [[x1, y0], [x1, y1]], [[x1, y1], [x0, y1]], [[x0, y1], [x0, y0]]]
    {
        out.push([[ax, ay, 0.0], [bx, by, 0.0], [bx, by, top]]);
        out.push([[ax, ay, 0.0], [bx, by, top], [ax, ay, top]]);
    }
    out
}

#[test]
fn five_axes_cut_their_marks_at_walls_and_mark_up_to_them() {
    let dir = folder();
    write_stl(&dir.path().join("part.stl"), &block([30.0, 20.0], [9.3, 4.1, 20.7, 15.9], 3.0));
    let job = job(dir.path(), "xyz-galvo-40", "0.3 mm", "200 mm/s", "5 mm", "");
    let [summary, proof] = proved(dir.path(), &job);
    let mm = |key: &str| summary[key].as_f64().expect("a length");
    // Two cuts of a tenth of a micrometre in every line over the block.
    assert!(mm("skipped_focus_mm") < 2e-3 && mm("worst_fod_um") <= 150.1, "{summary}");
    assert!(proof["worst_defocus_um"].as_f64().is_some_and(|d| d <= 150.1), "{proof}");
}

#[test]
#[ignore = "slow: make test-all"]
fn seven_axes_leave_out_what_their_height_field_cannot_follow_at_walls_and_say_so() {
    let dir = folder();
    write_stl(&dir.path().join("part.stl"), &block([12.0, 8.0], [4.3, 2.1, 8.7, 5.9], 1.0));
    let job = job(dir.path(), "xyzac-galvo-10", "0.2 mm", "100 mm/s", "2 mm", "");
    let [summary, _] = proved(dir.path(), &job);
    let skipped = summary["skipped_focus_mm"].as_f64().expect("a length");
    assert!(skipped > 0.1 && skipped < 20.0, "{summary}");
    assert!(summary["warnings"].as_array().expect("a list").iter().any(|w| w["code"] == "fly-skipped"), "{summary}");
    // What is left out is known by its place: stated elsewhere it is not.
    let path = dir.path().join("made.job/manifest.json");
    let text = std::fs::read_to_string(&path).expect("a manifest");
    let mut manifest: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    let first = &mut manifest["left_out"][0];
    for key in ["from_mm", "to_mm"] {
        first[key] = (first[key].as_f64().expect("a length") + 0.05).into();
    }
    std::fs::write(&path, serde_json::to_vec_pretty(&manifest).expect("JSON")).expect("a file");
    let proof = terrace(&["verify", &dir.path().join("made.job").display().to_string()]);
    assert!(proof.status.code() == Some(1) && said(&proof).contains("coverage   BROKEN"), "{}", said(&proof));
}

#[test]
fn marks_end_at_the_corner_of_a_part_with_seven_axes() {
    let dir = folder();
    // Lines along both borders of a plate that bends, to its very corner.
    let bend = |x: f64, y: f64| 0.02 * x * x / 8.0 + 0.05 * y;
    write_stl(&dir.path().join("part.stl"), &mesh(4, [0.0, 0.0, 8.0, 8.0], bend));
    let job = job(dir.path(), "xyzac-galvo-10", "0.2 mm", "500 mm/s", "2 mm", "");
    let text = std::fs::read_to_string(&job).expect("a job").replace("10 deg", "0 deg");
    std::fs::write(&job, text).expect("a file");
    let [_, proof] = proved(dir.path(), &job);
    assert!(proof["skipped_mm"].as_f64().is_some_and(|mm| mm < 1e-4), "{proof}");
}

#[test]
fn strokes_that_run_back_over_themselves_are_marked_as_often_as_they_are_drawn() {
    for turn in ["0 deg", "17.3 deg"] {
        let dir = folder();
        write_stl(&dir.path().join("part.stl"), &mesh(4, [0.0, 0.0, 20.0, 20.0], |x, _| 0.01 * x));
        let svg = "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"12mm\" height=\"9mm\" viewBox=\"0 0 12 9\">\
                   <g fill=\"none\" stroke=\"black\" stroke-width=\"0.001\"><polyline points=\"1,8 9,8 3,8 6,8\"/></g></svg>";
        std::fs::write(dir.path().join("back.svg"), svg).expect("a file");
        let job = job(dir.path(), "xyz-galvo-40", "0.1 mm", "200 mm/s", "2 mm", "");
        let text = std::fs::read_to_string(&job).expect("a job");
        let hatch = "pattern = \"hatch\"\npitch = \"2 mm\"\ndirection = \"10 deg\"\n";
        assert!(text.contains(hatch));
        let text = text.replace(hatch, "file = \"back.svg\"\norigin = [\"4 mm\", \"4 mm\"]\n");
        std::fs::write(&job, format!("placement = {{ turn = {turn:?} }}\n{text}")).expect("a file");
        let [_, proof] = proved(dir.path(), &job);
        assert_eq!(proof["ok"], true, "{proof}");
    }
}

#[test]
#[ignore = "slow: make test-all"]
fn marks_at_the_scanners_own_speeds_and_short_moves_keep_their_limits() {
    let dir = folder();
    // Circles of short chords at the top speed of the scanner, with long jumps between them.
    write_stl(&dir.path().join("part.stl"), &mesh(20, [0.0, 0.0, 60.0, 40.0], |x, y| 0.0005 * x * y));
    let job = job(dir.path(), "xyz-galvo-40", "0.2 mm", "3000 mm/s", "4 mm", "");
    let text = std::fs::read_to_string(&job).expect("a job");
    let circles = "[[texture]]\npattern = \"circles\"\npitch = \"20 mm\"\ncell = \"0.3 mm\"\n[[pen]]";
    std::fs::write(&job, text.replacen("[[pen]]", circles, 1)).expect("a file");
    proved(dir.path(), &job);
}

/// The spot slows down at corners with the laser on: the figures say so, and verify finds them again.
#[test]
#[ignore = "slow: make test-all"]
fn marks_that_slow_down_are_reported_with_their_energy_and_verify_holds_the_figures() {
    let dir = folder();
    write_stl(&dir.path().join("part.stl"), &mesh(4, [-6.0, -6.0, 6.0, 6.0], |_, _| 0.0));
    let path = job(dir.path(), "xyzac-galvo-10", "0.5 mm", "3000 mm/s", "2 mm", "");
    let text = std::fs::read_to_string(&path).expect("a job");
    let text = text
        .replace("pattern = \"hatch\"\npitch = \"2 mm\"\ndirection = \"10 deg\"", "pattern = \"hilbert\"\norder = 4");
    std::fs::write(&path, text).expect("write");
    let [summary, _] = proved(dir.path(), &path);
    let energy = &summary["line_energy"];
    // 60 % of the laser's power at less than the speed of the pen: never less than P / v.
    let nominal = number(energy, "mean_j_per_m") * number(&summary, "mark_mm") / 1e3 / number(&summary, "mark_s");
    assert!(nominal > 0.0 && number(energy, "worst_share") > 2.0, "{energy}");
    assert!(number(energy, "length_at_speed_percent") < 100.0 && number(energy, "slow_s") > 0.0, "{energy}");
    let warned = summary["warnings"].as_array().expect("a list").iter().find(|w| w["code"] == "fly-energy");
    assert!(warned.is_some(), "{summary}");
    let out = dir.path().join("made.job");
    let picture = std::fs::read_to_string(out.join("energy.svg")).expect("a picture");
    assert!(picture.contains("J/cm2 seen along z"), "{}", &picture[picture.len() - 400..]);
    let report = std::fs::read_to_string(out.join("report.html")).expect("a report");
    assert!(report.contains("Most energy of a line over a spot") && report.contains("href=\"energy.svg\""));
    // A figure that is not that of the program is found.
    for (key, factor) in
        [("worst_share", 0.5), ("mean_j_per_m", 1.01), ("length_at_speed_percent", 1.5), ("slow_s", 0.9)]
    {
        let file = out.join("manifest.json");
        let kept = std::fs::read_to_string(&file).expect("a manifest");
        let mut manifest: serde_json::Value = serde_json::from_str(&kept).expect("JSON");
        let value = number(&manifest["summary"]["line_energy"], key);
        manifest["summary"]["line_energy"][key] = (value * factor + 1e-3).into();
        std::fs::write(&file, manifest.to_string()).expect("written");
        let printed = said(&terrace(&["verify", out.to_str().expect("text")]));
        assert!(printed.contains(&format!("line_energy.{key} is given as")), "{key}: {printed}");
        std::fs::write(&file, kept).expect("written");
    }
}

/// With power that follows the speed of the spot every length of a line gets as much, in both programs; a power that
/// does not follow is found.
#[test]
fn power_that_follows_the_speed_is_written_for_both_controllers_and_held_by_verify() {
    let dir = folder();
    write_stl(
        &dir.path().join("part.stl"),
        &mesh(20, [0.0, 0.0, 20.0, 15.0], |x, y| 0.2 * math::sin(x / 2.0) * math::cos(y / 3.0)),
    );
    let path = job(dir.path(), "xyz-galvo-40", "0.5 mm", "1000 mm/s", "1 mm", "emit = { power = \"speed\" }\n");
    let [summary, _] = proved(dir.path(), &path);
    assert!((number(&summary["line_energy"], "worst_share") - 1.0).abs() < 1e-9, "{summary}");
    let out = dir.path().join("made.job");
    let read = |name: &str| std::fs::read_to_string(out.join(name)).expect("a program");
    let powers = |text: &str, word: &str| -> Vec<f64> {
        text.lines().filter_map(|l| l.strip_prefix(word)).map(|v| v.parse().expect("percent")).collect()
    };
    let (cnc, pmac) = (read("fly.ngc"), read("fly.pmc"));
    let written = powers(&cnc, "M67 E0 Q");
    assert_eq!(written, powers(&pmac, "M2=="));
    assert!(written.iter().all(|p| (0.0..=60.0).contains(p)), "{written:?}");
    let sheet = read("runsheet.txt");
    assert!(sheet.contains("power      follows the speed of the spot"), "{sheet}");
    // One power of both programs that does not follow.
    let line = cnc.lines().find(|l| l.starts_with("M67 E0 Q")).expect("a power");
    let other = line.replace("M67 E0 Q", "M2==");
    let wrong = written[0] * 0.97;
    for (name, text, from, to) in [
        ("fly.ngc", &cnc, line.to_owned(), format!("M67 E0 Q{wrong:.3}")),
        ("fly.pmc", &pmac, other, format!("M2=={wrong:.3}")),
    ] {
        std::fs::write(out.join(name), text.replacen(&from, &to, 1)).expect("written");
    }
    let printed = said(&terrace(&["verify", out.to_str().expect("text")]));
    assert!(printed.contains("a mark does not have the power that its speed asks for"), "{printed}");
    // A power that is set at once would change a mark that is not finished; a rapid before abs goes by so much.
    for (name, text, from, to, why) in [
        ("fly.ngc", &cnc, line.to_owned(), line.replacen("M67", "M68", 1), "is not known"),
        ("fly.ngc", &cnc, "M68 E0 Q0\n".into(), "M62 P0\nM68 E0 Q0\n".into(), "laser not known to be off"),
        ("fly.pmc", &pmac, "M2==".into(), "M2=".into(), "is not known"),
        ("fly.pmc", &pmac, "M2=0\n".into(), "M1==1\nM2=0\n".into(), "laser not known to be off"),
        ("fly.pmc", &pmac, "abs\n".into(), String::new(), "a move before abs"),
    ] {
        for (name, text) in [("fly.ngc", &cnc), ("fly.pmc", &pmac)] {
            std::fs::write(out.join(name), text).expect("written");
        }
        assert!(text.contains(&from), "{name} without {from:?}");
        std::fs::write(out.join(name), text.replacen(&from, &to, 1)).expect("written");
        let printed = said(&terrace(&["verify", out.to_str().expect("text")]));
        assert!(printed.contains(why), "{from:?} to {to:?}: {printed}");
    }
    // A stepped job has no such thing.
    let stepped = terrace(&["check", &path]);
    assert!(said(&stepped).contains("error[emit-power]"), "{}", said(&stepped));
}
