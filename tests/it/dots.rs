//! Dots through the product: patterns, screens and points of drawings on curved parts, by every method; what is refused.

use std::path::Path;
use terrace_core::math;

use crate::support::image::grey16;
use crate::support::surfaces::{mesh, write_stl};
use crate::support::{JobText, compile, folder, machine_file, manifest, number, said, shared, terrace, verify};

/// A pen for dots.
const PEN: &str =
    "[[pen]]\nname = \"dot\"\nspeed = \"500 mm/s\"\npower = \"40 %\"\nfrequency = \"50 kHz\"\ndwell = \"200 us\"\n";

/// A job with one texture of dots.
fn job(stl: &Path, texture: &str) -> JobText {
    let mut job = JobText::on(stl).texture(&format!("{texture}\npen = \"dot\""));
    job.more = format!("{PEN}\n[emit]\nformats = [\"dxf\", \"csv\", \"linuxcnc\", \"ovf\"]\n");
    job
}

/// Compiles and verifies; answers with the summary.
fn sound(job: &JobText, dir: &Path) -> serde_json::Value {
    let out = dir.join("out.job");
    let summary = compile(&job.write(dir, "job.toml"), &out);
    verify(&out);
    let dots = &summary["dots"];
    let of = |key: &str| dots[key].as_u64().expect("a count");
    assert_eq!(of("marked") + of("off_part") + of("steep"), of("texture"), "{dots}");
    summary
}

/// The codes that the product refuses a job with.
fn refused(job: &JobText, dir: &Path) -> String {
    let out = terrace([Path::new("compile"), &job.write(dir, "job.toml"), Path::new("-o"), &dir.join("out.job")]);
    assert!(!out.status.success());
    said(&out)
}

#[test]
#[ignore = "slow: make test-all"]
fn dots_of_every_source_are_marked_by_every_method() {
    let dir = folder();
    let stl = dir.path().join("dome.stl");
    write_stl(&stl, &mesh(40, [-30.0, -30.0, 30.0, 30.0], |x, y| -(x * x + y * y) / 1500.0));
    let samples: Vec<u16> = (0..64).map(|i| i % 16 * 4369).collect();
    std::fs::write(dir.path().join("grey.png"), grey16(16, &samples, false, usize::MAX)).expect("a writable folder");
    let points = (0..50).map(|i| format!("0\nPOINT\n8\nholes\n10\n{}\n20\n{}\n30\n0\n", i % 10, i / 10));
    let dxf = format!("0\nSECTION\n2\nENTITIES\n{}0\nENDSEC\n0\nEOF\n", points.collect::<String>());
    std::fs::write(dir.path().join("points.dxf"), dxf).expect("a writable folder");
    let area = "area = [\"-20 mm\", \"-20 mm\", \"20 mm\", \"20 mm\"]";
    let bitmap = |screen: &str| {
        format!("file = \"grey.png\"\nsize = [\"24 mm\", \"6 mm\"]\npitch = \"0.2 mm\"\nscreen = {screen:?}")
    };
    let textures = [
        (format!("pattern = \"dots\"\npitch = \"0.8 mm\"\njitter = \"100 %\"\n{area}"), 2500),
        (format!("pattern = \"dots\"\npitch = \"0.8 mm\"\nlattice = \"hex\"\n{area}"), 2822),
        (format!("pattern = \"poisson\"\npitch = \"0.8 mm\"\nseed = 3\n{area}"), 0),
        (bitmap("halftone"), 0),
        (bitmap("diffusion"), 0),
        (bitmap("noise"), 0),
        ("file = \"points.dxf\"\nunit = \"mm\"\ntile = true\narea = \"part\"".to_owned(), 0),
    ];
    for (k, (texture, count)) in textures.iter().enumerate() {
        let method = ["z-range", "window", "contour", "tilt"][k % 4];
        let mut job = job(&stl, texture).method(method);
        if method == "tilt" {
            job.machine = "profile = \"xyz-tilt-galvo-40\"".into();
        }
        let summary = sound(&job, dir.path());
        let marked = summary["dots"]["marked"].as_u64().expect("a count");
        assert!(marked > 200 && (*count == 0 || marked == *count), "{texture}: {marked}");
        assert_eq!((number(&summary, "texture_mm"), number(&summary, "mark_mm")), (0.0, 0.0), "no lines");
        assert!(number(&summary, "worst_defocus_um") <= 35.1);
        let beam_on = number(&summary["time_s"], "mark");
        assert!((beam_on - 200e-6 * marked as f64).abs() < 1e-9, "{beam_on} s for {marked} dots");
    }
}

#[test]
fn lines_and_dots_share_blocks_and_repeat_with_their_pens() {
    let dir = folder();
    let stl = dir.path().join("bump.stl");
    write_stl(&stl, &mesh(30, [0.0, 0.0, 30.0, 30.0], |x, y| 0.1 * math::sin(x / 5.0) * math::cos(y / 4.0)));
    let mut job = job(&stl, "pattern = \"dots\"\npitch = \"1 mm\"").texture("pattern = \"hatch\"\npitch = \"2 mm\"");
    job.more = job.more.replace("dwell = \"200 us\"", "pulses = 25\npasses = 3")
        + "[dose]\ncompensate = \"speed\"\n[limits]\nmax_incidence = \"1 deg\"\n";
    let summary = sound(&job, dir.path());
    let dots = &summary["dots"];
    assert_eq!(dots["texture"], 900);
    assert!(dots["steep"].as_u64() > Some(50), "{dots}");
    let pens = manifest(&dir.path().join("out.job"))["pens"].clone();
    let dot = pens.as_array().and_then(|all| all.iter().find(|p| p["name"] == "dot")).expect("the pen").clone();
    assert_eq!((number(&dot, "dwell_us"), number(&dot, "passes")), (500.0, 3.0));
}

#[test]
fn longer_dwells_on_slopes_are_verified_as_the_run_sheet_rounds_them() {
    let dir = folder();
    let stl = dir.path().join("dome.stl");
    write_stl(&stl, &mesh(20, [-15.0, -15.0, 15.0, 15.0], |x, y| -(x * x + y * y) / 80.0));
    let mut job = job(&stl, "pattern = \"dots\"\npitch = \"1.5 mm\"").method("z-range");
    job.more += "[dose]\ncompensate = \"speed\"\n";
    sound(&job, dir.path());
    let sheet = std::fs::read_to_string(dir.path().join("out.job/runsheet.txt")).expect("a run sheet");
    assert!(sheet.contains("dwell 222.222 us"), "{sheet}");
}

#[test]
fn jobs_that_dots_cannot_be_marked_with_are_refused() {
    let dir = folder();
    let stl = dir.path().join("plate.stl");
    write_stl(&stl, &mesh(2, [0.0, 0.0, 20.0, 20.0], |_, _| 0.0));
    let dots = "pattern = \"dots\"\npitch = \"1 mm\"";
    let with = |from: &str, to: &str| {
        let mut job = job(&stl, dots);
        assert!(job.more.contains(from));
        job.more = job.more.replacen(from, to, 1);
        refused(&job, dir.path())
    };
    for (from, to, code) in [
        ("dwell = \"200 us\"\n", "", "error[pen-dwell]"),
        ("dwell = \"200 us\"", "dwell = \"200 us\"\npulses = 3", "error[pen-dwell]"),
        ("dwell = \"200 us\"", "dwell = \"1 min\"", "error[pen-dwell]"),
        ("dwell = \"200 us\"", "pulses = 0", "error[pen-dwell]"),
        ("\"csv\"", "\"lightburn\"", "error[lightburn-dots]"),
    ] {
        let said = with(from, to);
        assert!(said.contains(code), "{from} -> {to}: {said}");
    }
    let mut fly = job(&stl, dots);
    fly.more = fly.more.replace("\"dxf\", \"csv\", \"linuxcnc\", \"ovf\"", "\"linuxcnc\"");
    let path = fly.write(dir.path(), "fly.toml");
    let out = terrace([Path::new("compile"), &path, Path::new("--mode"), Path::new("on-the-fly")]);
    assert!(!out.status.success() && said(&out).contains("error[fly-job]"), "{}", said(&out));
    let mut cards = job(&stl, dots);
    let machine =
        machine_file("xyz-galvo-40") + "\n[lmc]\nunits_per_mm = 1500\n[rtc]\nboard = \"rtc5\"\nbits_per_mm = 20000\n";
    std::fs::write(dir.path().join("machine.toml"), machine).expect("a writable folder");
    cards.machine = "file = \"machine.toml\"".into();
    cards.more = cards.more.replace("\"csv\"", "\"lmc\", \"rtc\"").replace("200 us", "214 us");
    sound(&cards, dir.path());
    cards.more = cards.more.replace("214 us", "14 us");
    let said = refused(&cards, dir.path());
    assert!(said.contains("error[lmc-dwell]") && said.contains("error[rtc-dwell]"), "{said}");
    for keys in ["jitter = \"101 %\"", "jitter = \"-1 %\"", "pitch = \"1 nm\"", "cell = \"1 mm\""] {
        let texture =
            if keys.starts_with("pitch") { dots.replace("pitch = \"1 mm\"", keys) } else { format!("{dots}\n{keys}") };
        let said = refused(&job(&stl, &texture), dir.path());
        assert!(said.contains("error[texture-"), "{keys}: {said}");
    }
}

#[test]
#[ignore = "needs ../shared"]
fn dots_on_hood_and_helens_are_marked_by_every_method() {
    let surfaces = shared().join("surfaces");
    let dir = folder();
    for (file, texture, more) in [
        (
            "hood_mm_bin.stl",
            "pattern = \"poisson\"\npitch = \"0.5 mm\"\narea = [\"20 mm\", \"-20 mm\", \"80 mm\", \"20 mm\"]",
            "",
        ),
        (
            "helens_relief_small.stl",
            "pattern = \"dots\"\npitch = \"0.9 mm\"\njitter = \"70 %\"",
            "[limits]\nmax_incidence = \"35 deg\"\n[dose]\ncompensate = \"power\"\n",
        ),
    ] {
        for method in ["z-range", "window", "tilt"] {
            let mut job = job(&surfaces.join(file), texture).method(method);
            job.more += more;
            if method == "tilt" {
                job.machine = "profile = \"xyz-tilt-galvo-40\"".into();
            }
            let summary = sound(&job, dir.path());
            assert!(summary["dots"]["marked"].as_u64() > Some(5000), "{file} {method}: {summary}");
        }
    }
}
