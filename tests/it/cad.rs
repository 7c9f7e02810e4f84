//! STEP and IGES files through the real converter, against the exact surfaces, and through converters that fail.
//!
//! `tests/python/setup.sh` installs Open CASCADE (`make test` runs it). Without it these tests fail.

use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value;

use crate::support::{JobText, fixture, folder, said, shared};
use terrace_input::surface::{Content, Options, read};

/// The Python that has Open CASCADE.
fn python() -> PathBuf {
    let python = Path::new(env!("CARGO_MANIFEST_DIR")).join(".venv/bin/python");
    assert!(python.exists(), "Open CASCADE is not installed for the tests: run tests/python/setup.sh");
    python
}

/// The program with this converter, and a cache of its own.
fn with(python: impl AsRef<Path>, cache: &Path) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_terrace"));
    command.env("TERRACE_PYTHON", python.as_ref()).env("XDG_CACHE_HOME", cache).arg("--no-sync");
    command
}

fn json(out: &Output) -> Value {
    assert!(out.status.success(), "{}", said(out));
    serde_json::from_slice(&out.stdout).expect("JSON")
}

/// Converts a file into `out.ply` of a folder, and answers with what was said of it.
pub fn convert(file: &Path, dir: &Path, tolerance: &str) -> Value {
    let mut command = with(python(), dir);
    command.args(["import", "--json", "--tolerance", tolerance]).arg(file).arg("-o").arg(dir.join("out.ply"));
    json(&command.output().expect("starts"))
}

/// Converts a file, and answers with what was said of it and its facets.
fn import(file: &Path, dir: &Path, tolerance: &str) -> (Value, Vec<[[f64; 3]; 3]>) {
    let said = convert(file, dir, tolerance);
    (said, facets(&dir.join("out.ply")))
}

fn facets(ply: &Path) -> Vec<[[f64; 3]; 3]> {
    let mut all = Vec::new();
    let options = Options { unit_mm: Some(1.0), ..Options::default() };
    let found = read(ply, &options, &mut Vec::new(), &mut |facet| all.push(facet));
    assert!(matches!(found, Ok(Content::Facets(n)) if n == all.len()), "{}", ply.display());
    all
}

/// Largest distance, mm, of points of the exact surfaces from the facets over or under them, along the normal. Points
/// with no facet over or under them are within the tolerance of a border: at most 1 in 100.
fn worst_distance(file: &Path, facets: &[[[f64; 3]; 3]], per_side: usize) -> f64 {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/python/cad_samples.py");
    let out = Command::new(python()).arg(script).arg(file).arg(per_side.to_string()).output().expect("python starts");
    let text = String::from_utf8(out.stdout).expect("text");
    let points: Vec<[f64; 4]> = text
        .lines()
        .map(|line| {
            let mut words = line.split(' ').map(|word| word.parse().expect("a number"));
            std::array::from_fn(|_| words.next().expect("four numbers"))
        })
        .collect();
    assert!(
        points.len() * 3 > per_side * per_side,
        "{} points: {}",
        points.len(),
        String::from_utf8_lossy(&out.stderr)
    );
    let (mut worst, mut alone) = (0.0f64, 0);
    let cells = Cells::new(facets);
    for &[x, y, z, normal] in &points {
        match cells.heights(facets, [x, y]).map(|found| (found - z).abs()).min_by(f64::total_cmp) {
            Some(dz) => worst = worst.max(dz * normal),
            None => alone += 1,
        }
    }
    assert!(alone * 100 <= points.len(), "{alone} of {} points have no facet", points.len());
    worst
}

/// Facets by the cells of a grid that their boxes touch.
struct Cells {
    lo: [f64; 2],
    size: [f64; 2],
    lists: Vec<Vec<usize>>,
}

impl Cells {
    const SIDE: usize = 200;

    fn new(facets: &[[[f64; 3]; 3]]) -> Self {
        let range = |k: usize, of: fn(f64, f64) -> f64| facets.iter().flatten().map(|p| p[k]).reduce(of).expect("some");
        let lo = [0, 1].map(|k| range(k, f64::min));
        let size = [0, 1].map(|k| (range(k, f64::max) - lo[k]) / Self::SIDE as f64);
        let mut cells = Self { lo, size, lists: vec![Vec::new(); Self::SIDE * Self::SIDE] };
        for (i, facet) in facets.iter().enumerate() {
            let corner = |of: fn(f64, f64) -> f64| {
                cells.cell([0, 1].map(|k| facet.iter().map(|p| p[k]).reduce(of).expect("three")))
            };
            let (from, to) = (corner(f64::min), corner(f64::max));
            for y in from[1]..=to[1] {
                (from[0]..=to[0]).for_each(|x| cells.lists[y * Self::SIDE + x].push(i));
            }
        }
        cells
    }

    fn cell(&self, p: [f64; 2]) -> [usize; 2] {
        [0, 1].map(|k| (((p[k] - self.lo[k]) / self.size[k]) as usize).min(Self::SIDE - 1))
    }

    /// Heights of all facets over a point.
    fn heights<'a>(&'a self, facets: &'a [[[f64; 3]; 3]], p: [f64; 2]) -> impl Iterator<Item = f64> + 'a {
        let [x, y] = self.cell(p);
        self.lists[y * Self::SIDE + x].iter().filter_map(move |&i| height(&facets[i], p))
    }
}

/// The height of a facet over a point, if the point lies in it.
fn height(facet: &[[f64; 3]; 3], [x, y]: [f64; 2]) -> Option<f64> {
    let [a, b, c] = *facet;
    let cross = |p: [f64; 3], q: [f64; 3]| (q[0] - p[0]) * (y - p[1]) - (q[1] - p[1]) * (x - p[0]);
    let parts = [cross(b, c), cross(c, a), cross(a, b)];
    let whole: f64 = parts.iter().sum();
    let inside = whole != 0.0 && parts.iter().all(|part| part / whole >= -1e-9);
    inside.then(|| (parts[0] * a[2] + parts[1] * b[2] + parts[2] * c[2]) / whole)
}

/// Asserts a box to a thousandth of its size.
fn assert_box(said: &Value, size: [f64; 3], lo: [f64; 3], name: &str) {
    let longest = size.into_iter().fold(0.0, f64::max);
    for k in 0..3 {
        let found = [&said["lo_mm"][k], &said["hi_mm"][k]].map(|v| v.as_f64().expect("a number"));
        assert!((found[1] - found[0] - size[k]).abs() <= 1e-3 * longest, "{name}: {found:?} for a size of {}", size[k]);
        assert!((found[0] - lo[k]).abs() <= 1e-3 * longest, "{name}: {} for {}", found[0], lo[k]);
    }
}

const HOOD: ([f64; 3], [f64; 3]) = ([1279.54, 1493.02, 349.48], [0.45, -746.51, -154.703]);

#[test]
#[ignore = "slow: make test-all"]
fn step_in_inch_and_iges_lie_within_their_chord_tolerance_of_the_exact_surface() {
    let dir = folder();
    for (name, unit, tolerance, most) in
        [("hood_ap203_inch.step", "inch", "0.1 mm", 0.1), ("hood_128.igs", "mm", "50 um", 0.05)]
    {
        let file = fixture("cad").join(name);
        let (said, facets) = import(&file, dir.path(), tolerance);
        assert_eq!((&said["unit"], &said["faces"], &said["free_edges"]), (&unit.into(), &1.into(), &4.into()));
        assert_box(&said, HOOD.0, HOOD.1, name);
        assert!(said["worst_mm"].as_f64().is_some_and(|w| (most / 2.0..=most).contains(&w)), "{said}");
        let worst = worst_distance(&file, &facets, 60);
        assert!((most / 10.0..=most).contains(&worst), "{name}: {worst} mm off, tolerance {most} mm");
        // Its normals point up.
        let up = facets.iter().filter(|[a, b, c]| (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]) > 0.0);
        assert_eq!(up.count(), facets.len(), "{name}");
    }
}

#[test]
#[ignore = "slow: make test-all"]
fn parts_of_nested_assemblies_are_placed_and_a_lost_face_is_said() {
    let dir = folder();
    let file = fixture("cad/assembly.step");
    let (said, facets) = import(&file, dir.path(), "0.05 mm");
    assert_eq!((&said["faces"], &said["bodies"], &said["free_edges"]), (&20.into(), &4.into(), &0.into()));
    // A half cylinder of radius 20 and length 30 along y, and one turned onto -x at (100, 0, 5); both again, turned by
    // 180 deg, at (0, -200, 10).
    assert_box(&said, [200.0, 260.0, 55.0], [-100.0, -230.0, -20.0], "assembly");
    // Closed bodies that face outwards hold the volume of four half cylinders, less what chords cut off.
    let parts = facets.iter().map(|[a, b, c]| {
        let cross = [b[1] * c[2] - b[2] * c[1], b[2] * c[0] - b[0] * c[2], b[0] * c[1] - b[1] * c[0]];
        (a[0] * cross[0] + a[1] * cross[1] + a[2] * cross[2]) / 6.0
    });
    let volume = parts.sum::<f64>() / (4.0 * std::f64::consts::PI * 200.0 * 30.0);
    assert!((0.99..1.0).contains(&volume), "{volume}");
    let text = std::fs::read_to_string(&file).expect("readable");
    let broken = dir.path().join("broken.STP");
    std::fs::write(&broken, text.replace("ADVANCED_FACE('',(#67),#82,.T.)", "ADVANCED_FACE('',(#67),#24,.T.)"))
        .expect("written");
    let out = with(python(), dir.path()).arg("inspect").arg(&broken).output().expect("starts");
    let text = self::said(&out);
    assert!(out.status.success() && text.contains("16 faces"), "{text}");
    assert!(text.contains("warning[cad-left-out]") && text.contains("illegal type"), "{text}");
}

#[test]
#[ignore = "slow: make test-all"]
fn a_job_names_the_step_file_and_is_verified_from_the_cache() {
    let dir = folder();
    let job = |keys: &str| {
        let mut job = JobText::on(Path::new("hood.step"))
            .texture("pattern = \"hatch\"\npitch = \"2 mm\"\narea = [\"600 mm\", \"0 mm\", \"640 mm\", \"40 mm\"]");
        job.surface = format!("file = \"part.StEp\"\n{keys}");
        job.focus = "pdof = \"0.8 mm\"".into();
        job.write(dir.path(), "job.toml")
    };
    std::fs::copy(fixture("cad/hood_ap203_inch.step"), dir.path().join("part.StEp")).expect("copied");
    let run = |python: &Path, args: &[&Path]| with(python, dir.path()).args(args).output().expect("starts");
    let (out, absent) = (dir.path().join("out.job"), dir.path().join("no-python"));
    let compile = [Path::new("compile"), &job(""), Path::new("-o"), &out];
    let made = run(&python(), &compile);
    assert!(made.status.success(), "{}", said(&made));
    // From here on nothing can convert.
    let proof = run(&absent, &[Path::new("verify"), &out]);
    assert!(proof.status.success() && said(&proof).contains("verified"), "{}", said(&proof));
    // A kept answer that is damaged is made anew.
    let cache = dir.path().join("terrace/cad");
    let kept: Vec<PathBuf> = std::fs::read_dir(&cache).expect("a cache").map(|e| e.expect("readable").path()).collect();
    assert_eq!(kept.len(), 1, "{kept:?}");
    let whole = std::fs::read(&kept[0]).expect("readable");
    let mut bytes = whole.clone();
    bytes[whole.len() / 2] ^= 1;
    for damaged in [&bytes[..], &whole[..whole.len() / 2], b""] {
        std::fs::write(&kept[0], damaged).expect("written");
        let e = run(&absent, &[Path::new("verify"), &out]);
        assert!(!e.status.success() && said(&e).contains("cad-converter"), "{}", said(&e));
    }
    let proof = run(&python(), &[Path::new("verify"), &out]);
    assert!(proof.status.success(), "{}", said(&proof));
    assert_eq!(std::fs::read(&kept[0]).expect("kept"), whole, "the same file, the same facets");
    // Another tolerance is another answer; and a unit is not to be stated.
    let refused = run(&absent, &[Path::new("check"), &job("unit = \"in\"")]);
    assert!(said(&refused).contains("error[surface-unit-stated]"), "{}", said(&refused));
    let refused =
        run(&absent, &[Path::new("inspect"), Path::new("--unit"), Path::new("mm"), &dir.path().join("part.StEp")]);
    assert!(said(&refused).contains("error[surface-unit-stated]"), "{}", said(&refused));
    let refused = run(&absent, &[Path::new("inspect"), &dir.path().join("part.StEp")]);
    assert!(said(&refused).contains("error[cad-converter]"), "{}", said(&refused));
}

#[test]
#[ignore = "slow: make test-all"]
#[cfg(unix)]
fn the_converter_is_found_in_the_user_s_folder_then_on_the_path_else_the_line_that_installs_it_is_given() {
    use std::os::unix::fs::PermissionsExt;
    let dir = folder();
    let script = |path: &Path| {
        std::fs::create_dir_all(path.parent().expect("a folder")).expect("made");
        std::fs::write(path, format!("#!/bin/sh\nexec '{}' \"$@\"\n", python().display())).expect("written");
        std::fs::set_permissions(path, std::fs::Permissions::from_mode(0o755)).expect("executable");
    };
    let (own, on_path) = (dir.path().join("data/terrace/python/bin/python"), dir.path().join("bin/python"));
    let inspect = |cache: &str| {
        let mut command = with("", &dir.path().join(cache));
        command.env("XDG_DATA_HOME", dir.path().join("data")).env("PATH", dir.path().join("bin"));
        command.arg("inspect").arg(fixture("cad/assembly.step")).output().expect("starts")
    };
    let refused = inspect("a");
    let text = said(&refused);
    assert!(text.contains("error[cad-converter]"), "{text}");
    let line = format!(
        "python3 -m venv {0} && {0}/bin/pip install cadquery-ocp",
        dir.path().join("data/terrace/python").display()
    );
    assert!(text.contains(&line), "{text}");
    script(&own);
    assert!(inspect("b").status.success(), "{}", said(&inspect("b")));
    std::fs::remove_file(&own).expect("removed");
    script(&on_path);
    assert!(inspect("c").status.success(), "{}", said(&inspect("c")));
}

/// A converter that is a shell script.
#[cfg(unix)]
fn fake(dir: &Path, body: &str) -> PathBuf {
    use std::os::unix::fs::PermissionsExt;
    let path = dir.join("fake");
    std::fs::write(&path, format!("#!/bin/sh\n{body}\n")).expect("written");
    std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o755)).expect("executable");
    path
}

#[test]
#[cfg(unix)]
fn converters_that_crash_hang_lie_or_are_absent_are_clear_errors() {
    const HELLO: &str = "echo '{\"terrace\": 1, \"occt\": \"8\"}'; ";
    let dir = folder();
    let counts = "\"unit\": \"mm\", \"faces\": 1, \"bodies\": 1, \"free_edges\": 0, \"without_triangles\": 0, \
                  \"worst_mm\": 0, \"failed_count\": 0, \"failed\": [], \"remarks_count\": 0, \"remarks\": []";
    let mesh = |v: &str, t: &str| format!("{HELLO} echo '{{{counts}, \"vertices\": {v}, \"triangles\": {t}}}'; ");
    for (body, code, say) in [
        (format!("{HELLO} kill -SEGV $$"), "cad-crashed", "signal: 11"),
        (format!("{HELLO} echo 'it broke' >&2; exit 7"), "cad-crashed", "exit status: 7), saying \"it broke\""),
        (
            format!("{HELLO} head -c 30000000 /dev/zero >&2; echo >&2; echo end >&2; exit 1"),
            "cad-crashed",
            "saying \"end\"",
        ),
        (format!("{HELLO} echo $$ >pid; exec sleep 100"), "cad-timeout", "after 1 s"),
        (format!("{HELLO} exec >&-; echo $$ >pid; exec sleep 100"), "cad-timeout", "after 1 s"),
        // Its limit of processor time, as the operating system tells it.
        (format!("{HELLO} echo $$ >pid; kill -XCPU $$"), "cad-timeout", "limit of processor time (1 s,"),
        ("cat >/dev/null; echo nonsense".into(), "cad-answer", "it begins with \"nonsense\""),
        ("head -c 3000000 /dev/zero".into(), "cad-answer", "it begins with"),
        (format!("{HELLO} echo '{{}}'"), "cad-answer", "header cannot be read"),
        (mesh("3", "1"), "cad-answer", "0 of 84 bytes follow"),
        (mesh("0", "0") + "echo more", "cad-answer", "more follows"),
        (mesh("18446744073709551615", "1"), "cad-answer", "beyond all memory"),
        (
            mesh("3", "1") + "head -c 72 /dev/zero; printf '\\1\\1\\1\\1\\1\\1\\1\\1\\1\\1\\1\\1'",
            "cad-answer",
            "not there",
        ),
        (mesh("0", "0"), "surface-empty", "none of the 1 faces"),
        (format!("{HELLO} echo '{{\"error\": \"memory\", \"text\": \"\"}}'"), "cad-memory", "TERRACE_CONVERTER_MB"),
        (format!("{HELLO} echo '{{\"error\": \"unit\", \"text\": \"\"}}'"), "cad-unit", "length unit"),
        (
            format!("{HELLO} echo '{{\"error\": \"failed\", \"text\": \"Standard_Failure\"}}'"),
            "cad-read",
            "Standard_Failure",
        ),
        ("echo '{\"absent\": \"ImportError: libGL\"}'".into(), "cad-converter", "ImportError: libGL"),
        ("exit 3".into(), "cad-converter", "ended with exit status: 3"),
    ] {
        let python = fake(dir.path(), &body);
        let begun = Instant::now();
        let mut command = with(python, dir.path());
        command.env("TERRACE_CONVERTER_SECONDS", "1").current_dir(dir.path());
        let text = said(&command.arg("inspect").arg(fixture("cad/assembly.step")).output().expect("starts"));
        assert!(text.contains(&format!("error[{code}]")) && text.contains(say), "{body}: {text}");
        assert!(begun.elapsed() < Duration::from_secs(5), "{body}: {:?}", begun.elapsed());
        if code == "cad-timeout" {
            let pid = std::fs::read_to_string(dir.path().join("pid")).expect("a number");
            assert!(!Path::new("/proc").join(pid.trim()).exists(), "{body}: still there");
        }
    }
    let mut command = with(fake(dir.path(), ""), dir.path());
    command.env("TERRACE_CONVERTER_MB", "x").arg("inspect").arg(fixture("cad/assembly.step"));
    let text = said(&command.output().expect("starts"));
    assert!(text.contains("error[cad-converter]") && text.contains("TERRACE_CONVERTER_MB"), "{text}");
}

#[test]
#[cfg(target_os = "linux")]
fn little_memory_for_the_real_converter_is_said() {
    let dir = folder();
    let mut command = with(python(), dir.path());
    command.env("TERRACE_CONVERTER_MB", "300").arg("inspect").arg(fixture("cad/assembly.step"));
    let text = said(&command.output().expect("starts"));
    assert!(text.contains("error[cad-memory]"), "{text}");
}

/// Writes the files of `cad_boxes.py`.
fn make_boxes(dir: &Path) {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/python/cad_boxes.py");
    let made = Command::new(python()).arg(script).arg(dir).output().expect("python starts");
    assert!(made.status.success(), "{}", said(&made));
}

/// What `inspect` says of a file: whether it is read, and its text.
fn inspected(file: &Path, dir: &Path) -> (bool, String) {
    let out = with(python(), dir).arg("inspect").arg(file).output().expect("starts");
    (out.status.success(), said(&out))
}

/// A copy of a file, each text replaced by another, which is there.
fn changed(file: &Path, dir: &Path, name: &str, changes: &[(&str, &str)]) -> PathBuf {
    let mut text = std::fs::read_to_string(file).expect("readable");
    for (from, to) in changes {
        assert!(text.contains(from), "{from}");
        text = text.replace(from, to);
    }
    let path = dir.join(name);
    std::fs::write(&path, text).expect("written");
    path
}

#[test]
#[ignore = "slow: make test-all"]
fn what_a_step_file_hides_is_left_out_and_named() {
    let dir = folder();
    make_boxes(dir.path());
    for (name, faces, bodies, hidden, say) in [
        ("bodies.step", 6, 1, "2 shapes", "\"body 2\" from (40.000, 0.000, 0.000) to (50.000, 10.000, 15.000) mm"),
        ("layer.step", 6, 1, "1 shape", "\"body 1\" from (20.000, 0.000, 0.000)"),
        ("part.step", 24, 4, "2 shapes", "\"cover\" from (0.000, 30.000, 25.000)"),
        ("instance.step", 24, 4, "2 shapes", "\"part\" from (20.000, 30.000, 30.000)"),
        ("higher.step", 30, 5, "1 shape", "\"part\" from (20.000, 30.000, 30.000)"),
    ] {
        let (is_read, text) = inspected(&dir.path().join(name), dir.path());
        assert!(
            is_read
                && text.contains(&format!("{faces} faces in {bodies} bod{}", if bodies == 1 { "y" } else { "ies" })),
            "{name}: {text}"
        );
        let warning = format!("warning[cad-hidden]: left out, since the file hides them ({hidden}): ");
        assert!(text.contains(&warning) && text.contains(say), "{name}: {text}");
        // From the cache it is the same.
        assert_eq!(inspected(&dir.path().join(name), dir.path()), (is_read, text), "{name}");
    }
    let (is_read, text) = inspected(&dir.path().join("all.step"), dir.path());
    assert!(
        !is_read && text.contains("error[cad-hidden]: the file hides all of its shapes: \"body 0\" from"),
        "{text}"
    );
    // Wider than 4 m: the unit is that of the file.
    let mut job = JobText::on(Path::new("large.step")).texture("pattern = \"hatch\"\npitch = \"2 mm\"");
    job.surface = "file = \"large.step\"".into();
    let out = with(python(), dir.path()).arg("check").arg(job.write(dir.path(), "job.toml")).output().expect("starts");
    let text = said(&out);
    assert!(text.contains("error[surface-large]") && !text.contains("surface.unit"), "{text}");
}

#[test]
#[ignore = "slow: make test-all"]
fn entities_that_a_step_file_hides_are_found_whatever_names_them() {
    let (dir, assembly) = (folder(), fixture("cad/assembly.step"));
    let style = "#9001=STYLED_ITEM('',(#9002),#ITEM);#9002=PRESENTATION_STYLE_ASSIGNMENT((NULL_STYLE(.NULL.)));";
    let layer = "#9001=PRESENTATION_LAYER_ASSIGNMENT('a','',(#ITEM));";
    let hidden = |names: &str, item: &str| {
        let entities = format!("#9000=INVISIBILITY((#9001));{}ENDSEC;\nEND-ISO", names.replace("#ITEM", item));
        inspected(&changed(&assembly, dir.path(), "a.step", &[("ENDSEC;\nEND-ISO", &entities)]), dir.path())
    };
    for names in [style, layer] {
        // The one solid, which is there four times; one of its five faces.
        let (is_read, text) = hidden(names, "#64");
        assert!(!is_read && text.contains("hides all of its shapes: \"SOLID\""), "{text}");
        let (is_read, text) = hidden(names, "#66");
        assert!(is_read && text.contains("16 faces") && text.contains("hides them (4 shapes)"), "{text}");
    }
    // A point of an axis has no faces.
    let (is_read, text) = hidden(style, "#12");
    assert!(is_read && text.contains("20 faces") && !text.contains("warning"), "{text}");
    let unknown =
        changed(&assembly, dir.path(), "a.step", &[("ENDSEC;\nEND-ISO", "#9000=INVISIBILITY((#63));ENDSEC;\nEND-ISO")]);
    let (is_read, text) = inspected(&unknown, dir.path());
    assert!(is_read && text.contains("warning[cad-hidden]: the file hides 1 entities of kinds"), "{text}");
}

#[test]
#[ignore = "slow: make test-all"]
fn step_units_that_are_read_wrongly_are_refused_and_a_utf_8_mark_is_not() {
    let (dir, assembly) = (folder(), fixture("cad/assembly.step"));
    let metre = "( LENGTH_UNIT() NAMED_UNIT(*) SI_UNIT(.MILLI.,.METRE.) );";
    let factor = |number: u32, name: &str, factor: &str, of: u32, by: u32| {
        format!(
            "#{number}=LENGTH_MEASURE_WITH_UNIT(LENGTH_MEASURE({factor}),#{of});\n\
             #{by}=(CONVERSION_BASED_UNIT('{name}',#{number})LENGTH_UNIT()NAMED_UNIT(#9003));\n"
        )
    };
    let base = format!("#9000={metre}\n#9003=DIMENSIONAL_EXPONENTS(1.,0.,0.,0.,0.,0.,0.);\n");
    for unit in ["#24", "#46", "#319"] {
        let from = format!("{unit} = {metre}");
        let number = unit[1..].parse().expect("a number");
        let thou = base.clone() + &factor(9001, "THOU", "0.0254", 9000, number);
        let all: Vec<_> = [(from.as_str(), thou.as_str())].into();
        let (is_read, text) = inspected(&changed(&assembly, dir.path(), "a.step", &all), dir.path());
        assert!(is_read && !text.contains("warning"), "{text}");
        let two =
            base.clone() + &factor(9001, "THOU", "0.0254", 9000, 9002) + &factor(9004, "TWOTHOU", "2.", 9002, number);
        let (is_read, text) = inspected(&changed(&assembly, dir.path(), "a.step", &[(&from, &two)]), dir.path());
        assert!(!is_read && text.contains("error[cad-unit]: the length unit TWOTHOU"), "{text}");
    }
    let marked =
        changed(&assembly, dir.path(), "a.step", &[("ISO-10303-21;\nHEADER", "\u{feff}ISO-10303-21;\nHEADER")]);
    let same = |(is_read, text): (bool, String)| (is_read, text.replace("a.step", "assembly.step"));
    assert_eq!(same(inspected(&marked, dir.path())), same(inspected(&assembly, dir.path())));
    let metres = changed(&assembly, dir.path(), "a.step", &[(".MILLI.", "$")]);
    let (is_read, text) = inspected(&metres, dir.path());
    assert!(!is_read && text.contains("error[surface-size]") && !text.contains("surface.unit"), "{text}");
}

/// An IGES file with a text of its global section replaced.
fn with_head(iges: &str, from: &str, to: &str) -> String {
    let (mut head, mut other) = (String::new(), Vec::new());
    for line in iges.lines() {
        match line.get(72..73) {
            Some("G") => head += &line[..72],
            _ => other.push(line),
        }
    }
    assert!(head.contains(from), "{from}: {head}");
    let head = head.replace(from, to);
    let records: Vec<&[u8]> = head.trim_end().as_bytes().chunks(72).collect();
    let globals =
        records.iter().enumerate().map(|(i, data)| format!("{:<72}G{:>7}", String::from_utf8_lossy(data), i + 1));
    let end = other.iter().position(|line| line.get(72..73) == Some("D")).expect("entities");
    let mut lines: Vec<String> = other[..end].iter().map(|line| (*line).to_owned()).collect();
    lines.extend(globals);
    lines.extend(other[end..].iter().map(|line| (*line).to_owned()));
    let last = lines.last_mut().expect("a last record");
    last.replace_range(8..16, &format!("G{:>7}", records.len()));
    lines.join("\n") + "\n"
}

#[test]
#[ignore = "slow: make test-all"]
fn the_head_of_an_iges_file_says_its_size_or_it_is_refused() {
    let dir = folder();
    make_boxes(dir.path());
    let plate = std::fs::read_to_string(dir.path().join("plate.igs")).expect("readable");
    let unit = ",1.,2,2HMM,1,";
    let date = plate.split("15H").nth(1).map(|text| format!("15H{}", &text[..15])).expect("a date");
    for (from, to, outcome) in [
        (unit, ",1.,2,2HMM,1,", "size    40.0000 x 30.0000 x 5.0000 mm"),
        (unit, ",2.,2,2HMM,1,", "error[iges-scale]: the file has a model space scale of 2. (global parameter 13)"),
        (unit, ",0.5,2,2HMM,1,", "error[iges-scale]"),
        (unit, ",1.,1,2HMM,1,", "error[iges-unit]: the unit is INCH (25.4 mm) by its flag and MM (1 mm) by its name"),
        (unit, ",1.,2,2HIN,1,", "error[iges-unit]: the unit is MM (1 mm) by its flag and INCH (25.4 mm) by its name"),
        (unit, ",1.,3,2Hin,1,", "error[iges-unit]: the unit is not one of IGES (flag \"3\", name \"in\")"),
        (unit, ",1.,3,2HIN,1,", "size    1016.0000 x 762.0000 x 127.0000 mm"),
        (unit, ",1.,2,8HFURLONGS,1,", "warning[iges-unit]: the name of the unit is not one of IGES"),
        (unit, ",1.,0,2HMM,1,", "warning[iges-unit]: the flag of the unit is not one of IGES"),
        (unit, ",1.,1,,1,", "size    1016.0000 x 762.0000 x 127.0000 mm"),
        (unit, ",1.,3,,1,", "error[cad-unit]"),
        (unit, ",1.,,,1,", "error[cad-unit]"),
        (&date, "10H2026-11-21", "size    40.0000 x 30.0000 x 5.0000 mm"),
        (&date, "", "size    40.0000 x 30.0000 x 5.0000 mm"),
    ] {
        let file = dir.path().join("a.igs");
        std::fs::write(&file, with_head(&plate, from, to)).expect("written");
        let (is_read, text) = inspected(&file, dir.path());
        assert!(text.contains(outcome) && is_read != outcome.starts_with("error"), "{to}: {text}");
        assert_eq!(text.contains("warning["), outcome.starts_with("warning"), "{to}: {text}");
        // From the cache it is the same.
        assert_eq!(inspected(&file, dir.path()), (is_read, text), "{to}");
    }
    // All entities blanked: the first two digits of their status.
    let blank = |line: &str| match line.get(64..73) {
        Some(status) if status.ends_with('D') && status[..8].bytes().all(|b| b.is_ascii_digit()) => {
            format!("{}01{}\n", &line[..64], &line[66..])
        }
        _ => format!("{line}\n"),
    };
    let blanked: String = plate.lines().map(blank).collect();
    assert_ne!(blanked, plate);
    std::fs::write(dir.path().join("b.igs"), blanked).expect("written");
    let (is_read, text) = inspected(&dir.path().join("b.igs"), dir.path());
    assert!(!is_read && text.contains("error[surface-empty]"), "{text}");
}

/// Files of other sources: unit, faces, size and lower corner as measured by another program.
type Row = (&'static str, &'static str, u64, [f64; 3], [f64; 3]);
const FILES: &[Row] = &[
    ("blade_upper.iges", "mm", 1, [70.113, 103.13, 93.369], [-24.539, -55.9989, -124.64]),
    ("propeller_and_shaft.iges", "mm", 22, [1483.7, 244.7, 245.37], [-1350.0, -124.966, -124.66]),
    ("nacelle.stp", "millimetre", 6, [2599.7, 1159.6, 1237.8], [-35.7359, -579.978, -644.952]),
    ("featuretype.STEP", "inch", 96, [127.0, 63.5, 34.925], [-63.5, -31.75, 0.0]),
    ("base_interface_AP203.STEP", "inch", 30, [599.39, 638.67, 4.7625], [-299.706, -319.336, -2.38125]),
    ("hood_ap214_mm.step", "millimetre", 1, HOOD.0, HOOD.1),
    ("hood_ap203_inch.step", "inch", 1, HOOD.0, HOOD.1),
    ("hood_ap242_m.step", "metre", 1, HOOD.0, HOOD.1),
    ("hood_rational_ap214.step", "millimetre", 1, HOOD.0, HOOD.1),
    ("hood_2patch_trimmed_gap.step", "millimetre", 2, [1279.6, 1492.3, 349.49], [0.442907, -746.126, -154.703]),
    ("hood_2patch_trimmed_gap.igs", "mm", 2, [1279.6, 1492.3, 349.49], [0.442907, -746.126, -154.703]),
    ("hood_128.igs", "mm", 1, HOOD.0, HOOD.1),
    ("mouse_shell_pole_nurbs.step", "millimetre", 1, [122.38, 59.166, 38.97], [-60.8941, -29.5615, 0.0]),
    ("mirror_freeform.step", "millimetre", 1, [320.0, 180.0, 39.475], [-160.0, 40.0, 1.18981]),
];

#[test]
#[ignore = "slow, needs ../shared: make test-all"]
fn files_of_other_sources_have_their_units_and_boxes_and_single_sheets_lie_within_tolerance() {
    let (dir, data) = (folder(), shared().join("surfaces"));
    for &(name, unit, faces, size, lo) in FILES {
        let file = data.join(name);
        let begun = Instant::now();
        let is_sheet = name.starts_with("hood") || name.starts_with("mirror");
        let (said, facets) = import(&file, dir.path(), if is_sheet { "0.02 mm" } else { "0.1 mm" });
        let took = begun.elapsed().as_secs_f64();
        assert_eq!((&said["unit"], &said["faces"]), (&unit.into(), &faces.into()), "{name}");
        assert_box(&said, size, lo, name);
        let worst = if is_sheet { worst_distance(&file, &facets, 150) } else { 0.0 };
        eprintln!(
            "{name}: {} facets, {:?} mm by itself, {worst:.5} mm off, {took:.1} s",
            facets.len(),
            said["worst_mm"]
        );
        assert!(worst <= 0.02, "{name}: {worst} mm off");
    }
    let text =
        said(&with(python(), dir.path()).arg("inspect").arg(data.join("d150_wing.igs")).output().expect("starts"));
    assert!(text.contains("error[surface-size]"), "{text}");
    assert!(text.contains("from (12743.7") && text.contains("to (22136."), "{text}");
}

const BAD: &[(&str, &str, &str)] = &[
    ("iges_bad_column73.igs", "iges-syntax", ".igs:10"),
    ("iges_truncated.igs", "iges-syntax", ".igs:164"),
    ("step_1e999999.step", "surface-number", ".step:24"),
    ("step_bad_knot_mult.step", "surface-empty", ".step"),
    ("step_cyclic_refs.step", "surface-empty", ".step"),
    ("step_dangling_ref.step", "step-reference", ".step:81"),
    ("step_deep_parens.step", "step-syntax", ".step:1"),
    ("step_degree_huge.step", "surface-empty", ".step"),
    ("step_degree_zero.step", "surface-empty", ".step"),
    ("step_neg_weights.step", "surface-empty", ".step"),
    ("step_no_end_marker.step", "step-syntax", ".step:817"),
    ("step_no_geometry.step", "surface-empty", ".step"),
    ("step_truncated.step", "step-syntax", ".step:425"),
    ("step_unterminated_string.step", "step-syntax", ".step:3"),
    ("step_zero_weights.step", "surface-empty", ".step"),
];

#[test]
#[cfg(target_os = "linux")]
#[ignore = "slow, needs ../shared: make test-all"]
fn a_limit_of_processor_time_of_the_system_is_said() {
    let dir = folder();
    let mut command = Command::new("sh");
    command.args(["-c", "ulimit -t 3; exec \"$0\" \"$@\"", env!("CARGO_BIN_EXE_terrace")]);
    command.env("TERRACE_PYTHON", python()).env("XDG_CACHE_HOME", dir.path());
    command.args(["import", "--tolerance", "0.0001 mm"]).arg(shared().join("surfaces/propeller_and_shaft.iges"));
    let text = said(&command.arg("-o").arg(dir.path().join("out.ply")).output().expect("starts"));
    assert!(text.contains("error[cad-timeout]") && text.contains("the system's own"), "{text}");
}

#[test]
#[ignore = "slow, needs ../shared: make test-all"]
fn every_bad_file_is_refused_in_5_s_and_512_mb() {
    let (dir, data) = (folder(), shared().join("bad"));
    for (name, code, place) in BAD {
        let begun = Instant::now();
        let mut command = with(python(), dir.path());
        command.arg("inspect").arg(data.join(name)).stdout(Stdio::null()).stderr(Stdio::piped());
        let mut child = command.spawn().expect("starts");
        let mut most_kb = 0;
        while child.try_wait().expect("waited for").is_none() {
            let status = std::fs::read_to_string(format!("/proc/{}/status", child.id())).unwrap_or_default();
            let peak =
                status.lines().find_map(|line| line.strip_prefix("VmHWM:")?.trim().strip_suffix(" kB")?.parse().ok());
            most_kb = most_kb.max(peak.unwrap_or(0));
            std::thread::sleep(Duration::from_millis(1));
        }
        let took = begun.elapsed();
        let out = child.wait_with_output().expect("ended");
        let text = said(&out);
        assert_eq!(out.status.code(), Some(2), "{name}: {text}");
        assert!(text.contains(&format!("error[{code}]")) && text.contains(&format!("{place}\n")), "{name}: {text}");
        assert!(took < Duration::from_secs(5) && most_kb < 512 << 10, "{name}: {took:?}, {most_kb} kB");
        eprintln!("{name}: {code}, {:.2} s, {most_kb} kB", took.as_secs_f64());
    }
}
