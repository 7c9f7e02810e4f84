//! Closed solids as CAD programs export them: what is marked, against a ray cast beside every line of the hatch.
//!
//! The parts are made by `tests/python/make_solids.py`, the ray cast is `tests/python/check_solids.py`.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use terrace_core::math;

use serde_json::Value;

use crate::support::surfaces::{Random, write_stl};
use crate::support::{JobText, ONE_FILE, folder, number, said, summary_of};

type Facet = [[f64; 3]; 3];
type Ring = Vec<[f64; 3]>;

fn rectangle(z: f64, [x0, y0, x1, y1]: [f64; 4]) -> Ring {
    vec![[x0, y0, z], [x1, y0, z], [x1, y1, z], [x0, y1, z]]
}

/// The walls between rings of equal length.
fn walls(rings: &[Ring]) -> Vec<Facet> {
    let mut out = Vec::new();
    for pair in rings.windows(2) {
        let n = pair[0].len();
        for i in 0..n {
            let [a, b, c, d] = [pair[0][i], pair[0][(i + 1) % n], pair[1][(i + 1) % n], pair[1][i]];
            out.extend([[a, b, c], [a, c, d]]);
        }
    }
    out
}

/// A face with this border, which is convex.
fn cap(ring: &[[f64; 3]]) -> impl Iterator<Item = Facet> + '_ {
    (1..ring.len() - 1).map(|i| [ring[0], ring[i], ring[i + 1]])
}

/// The solid between rings.
fn loft(rings: &[Ring]) -> Vec<Facet> {
    let mut out = walls(rings);
    out.extend(cap(&rings[0]).chain(cap(&rings[rings.len() - 1])));
    out
}

const FOOT: [f64; 4] = [0.0, 0.0, 40.0, 30.0];
const TOP: [f64; 4] = [4.0, 4.0, 36.0, 26.0];

fn drafted_block() -> Vec<Facet> {
    loft(&[rectangle(0.0, FOOT), rectangle(10.0, TOP)])
}

fn parting_line() -> Vec<Facet> {
    loft(&[rectangle(0.0, [2.0, 2.0, 38.0, 28.0]), rectangle(6.0, FOOT), rectangle(15.0, [3.0, 3.0, 37.0, 27.0])])
}

/// Radius 10, along x, of chords of 15 deg.
fn half_cylinder() -> Vec<Facet> {
    let ring = |x: f64| {
        let at = |i: i32| math::sin_cos(f64::from(15 * i).to_radians());
        (0..=12).map(|i| [x, 10.0 * at(i).1, 10.0 * at(i).0]).collect()
    };
    loft(&[ring(0.0), ring(30.0)])
}

fn core_in_a_pocket() -> Vec<Facet> {
    loft(&[
        rectangle(0.0, FOOT),
        rectangle(12.0, FOOT),
        rectangle(12.0, [8.0, 8.0, 32.0, 22.0]),
        rectangle(4.0, [10.0, 10.0, 30.0, 20.0]),
        rectangle(4.0, [14.0, 13.0, 26.0, 17.0]),
        rectangle(10.0, [15.0, 14.0, 25.0, 16.0]),
    ])
}

/// The underside rises to a point inside.
fn hollow_underside() -> Vec<Facet> {
    let (foot, top) = (rectangle(0.0, FOOT), rectangle(10.0, TOP));
    let mut out: Vec<Facet> = (0..4).map(|i| [foot[i], foot[(i + 1) % 4], [20.0, 15.0, 5.0]]).collect();
    out.extend(cap(&top));
    out.extend(walls(&[foot, top]));
    out
}

fn block_on_a_drafted_base() -> Vec<Facet> {
    let block = loft(&[rectangle(10.0, [10.0, 8.0, 30.0, 22.0]), rectangle(16.0, [11.0, 9.0, 29.0, 21.0])]);
    [drafted_block(), block].concat()
}

/// The facets in another order, with other windings and first corners.
fn shuffled(facets: &[Facet], order: u64, winding: u64) -> Vec<Facet> {
    let mut noise = Random::case(order * 4 + winding);
    let mut out = facets.to_vec();
    noise.shuffle(&mut out);
    for f in &mut out {
        f.rotate_left((noise.bits() % 3) as usize);
        let is_turned = match winding {
            0 => false,
            1 => true,
            _ => noise.bits().is_multiple_of(2),
        };
        if is_turned {
            f.swap(0, 1);
        }
    }
    out
}

#[test]
#[ignore = "slow: make test-all"]
fn one_length_is_marked_of_a_solid_in_whatever_order_and_winding_its_facets_are() {
    let dir = folder();
    let stl = dir.path().join("part.stl");
    let job = JobText::on(&stl).texture("pattern = \"hatch\"\npitch = \"1 mm\"").write(dir.path(), "job.toml");
    // Lines along x, at every whole y: how many, and how much of each.
    for (name, solid, lines) in [
        ("drafted block", drafted_block(), vec![(23, 32)]),
        ("parting line", parting_line(), vec![(25, 34)]),
        // Chords up to 52.5 deg, that is up to 8.66 mm from the middle.
        ("half cylinder", half_cylinder(), vec![(17, 30)]),
        // Beside the pocket; along its walls; floor; floor, core and floor.
        ("core in a pocket", core_in_a_pocket(), vec![(18, 40), (2, 16), (8, 16 + 20), (3, 16 + 8 + 10)]),
        ("hollow underside", hollow_underside(), vec![(23, 32)]),
        // Beside the block; over it.
        ("block on a drafted base", block_on_a_drafted_base(), vec![(10, 32), (13, 12 + 18)]),
    ] {
        let want: i32 = lines.iter().map(|(count, length)| count * length).sum();
        for (order, winding) in (0..14).flat_map(|order| (0..4).map(move |winding| (order, winding))) {
            write_stl(&stl, &shuffled(&solid, order, winding));
            let found = number(&summary_of(&job), "mark_mm");
            assert!((found - f64::from(want)).abs() < 1e-6, "{name}, {order}, {winding}: {found} mm for {want}");
        }
    }
}

#[test]
#[ignore = "slow: make test-all"]
fn check_tells_that_it_did_not_look_at_the_facets_of_a_large_file() {
    let dir = folder();
    let stl = dir.path().join("part.stl");
    let squares = |n: u32| (0..n * n).map(move |k| [f64::from(k % n) / 10.0, f64::from(k / n) / 10.0]);
    let facets = |n: u32| -> Vec<Facet> {
        let corner = |[x, y]: [f64; 2], u: f64, v: f64| [x + u / 10.0, y + v / 10.0, 0.0];
        let halves = |p| {
            [[(0., 0.), (1., 0.), (1., 1.)], [(0., 0.), (1., 1.), (0., 1.)]].map(|f| f.map(|(u, v)| corner(p, u, v)))
        };
        squares(n).flat_map(halves).collect()
    };
    let job = JobText::on(&stl).texture("pattern = \"hatch\"\npitch = \"5 mm\"").write(dir.path(), "job.toml");
    for (n, is_warned) in [(500, false), (501, true)] {
        write_stl(&stl, &facets(n));
        let out = crate::support::terrace(["check", job.to_str().expect("text"), "--json"]);
        assert!(out.status.success(), "{}", said(&out));
        assert_eq!(String::from_utf8_lossy(&out.stdout).contains("surface-not-looked-at"), is_warned, "{n}");
    }
}

#[test]
fn a_hole_that_shows_the_underside_is_reported_by_check() {
    let dir = folder();
    let stl = dir.path().join("part.stl");
    let job = JobText::on(&stl).texture("pattern = \"hatch\"\npitch = \"1 mm\"").write(dir.path(), "job.toml");
    let codes = |facets: &[Facet]| {
        write_stl(&stl, facets);
        let out = crate::support::terrace(["check", job.to_str().expect("text"), "--json"]);
        assert!(out.status.success(), "{}", said(&out));
        let summary: Value = serde_json::from_slice(&out.stdout).expect("JSON");
        let printed: Vec<&str> =
            summary["warnings"].as_array().expect("a list").iter().flat_map(|w| w["code"].as_str()).collect();
        let text = String::from_utf8_lossy(&out.stderr).into_owned();
        ["surface-hole", "surface-away", "surface-upside-down"].map(|code| {
            assert_eq!(printed.contains(&code), text.contains(code), "{code}");
            printed.contains(&code)
        })
    };
    // Seen from outside every facet runs counter-clockwise, as CAD programs write them.
    let outwards = |facets: Vec<Facet>| -> Vec<Facet> {
        let middle = [20.0, 15.0, 5.0];
        let turned = |mut f: Facet| {
            let [u, v, w] = [1, 2, 0].map(|k| [0, 1, 2].map(|i| f[k][i] - if k == 0 { middle[i] } else { f[0][i] }));
            let n = [0, 1, 2].map(|i| u[(i + 1) % 3] * v[(i + 2) % 3] - u[(i + 2) % 3] * v[(i + 1) % 3]);
            if (0..3).map(|i| n[i] * w[i]).sum::<f64>() < 0.0 {
                f.swap(0, 1);
            }
            f
        };
        facets.into_iter().map(turned).collect()
    };
    let whole = outwards(drafted_block());
    assert_eq!(codes(&whole), [false; 3]);
    let is_top = |f: &Facet| f.iter().all(|p| p[2] == 10.0);
    let gone = whole.iter().position(is_top).expect("a top");
    let holed: Vec<Facet> = whole.iter().enumerate().filter(|(i, _)| *i != gone).map(|(_, f)| *f).collect();
    assert_eq!(codes(&holed), [true, true, false]);
    let inside_out: Vec<Facet> = whole.iter().map(|&[a, b, c]| [a, c, b]).collect();
    assert_eq!(codes(&inside_out), [false, true, false]);
}

fn python() -> PathBuf {
    let python = Path::new(env!("CARGO_MANIFEST_DIR")).join(".venv/bin/python");
    assert!(python.exists(), "Open CASCADE is not installed for the tests: run tests/python/setup.sh");
    python
}

fn script(name: &str) -> Command {
    let mut command = Command::new(python());
    command.arg(Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/python").join(name));
    command
}

fn text(out: &Output) -> String {
    assert!(out.status.success(), "{}", said(out));
    String::from_utf8(out.stdout.clone()).expect("text")
}

/// A part that the script made.
struct Part {
    name: String,
    is_stl: bool,
    is_flat: bool,
}

/// Makes all parts in a folder.
fn parts(dir: &Path) -> Vec<Part> {
    let out = script("make_solids.py").arg(dir).output().expect("python starts");
    let parse = |line: &str| {
        let words: Vec<&str> = line.split(' ').collect();
        Part { name: words[0].into(), is_stl: words.contains(&"stl"), is_flat: words.contains(&"flat") }
    };
    let parts: Vec<Part> = text(&out).lines().map(parse).collect();
    assert!(parts.len() >= 30);
    parts
}

/// The program with the converter of the tests and a cache of its own.
fn terrace(dir: &Path) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_terrace"));
    command.env("TERRACE_PYTHON", python()).env("XDG_CACHE_HOME", dir).args(["--no-sync", "-q"]);
    command
}

const PDOF_MM: f64 = 0.1;

/// Share of the length by which marks on curved faces may differ from those on finer facets.
const NEAR: f64 = 0.03;

/// Compiles a hatch over a part and verifies it.
fn compiled(dir: &Path, file: &str, direction: &str) -> PathBuf {
    let texture = format!("pattern = \"hatch\"\npitch = \"1 mm\"\ndirection = \"{direction} deg\"");
    let mut job = JobText::on(Path::new(file)).texture(&texture);
    if file.ends_with("step") {
        job.surface = format!("file = \"{file}\"");
    }
    job.focus = format!("pdof = \"{PDOF_MM} mm\"");
    job.more = ONE_FILE.into();
    let job = job.write(dir, "job.toml");
    let out = dir.join(format!("{file}-{direction}.job"));
    let made = terrace(dir).args(["compile", "--verify"]).arg(&job).arg("-o").arg(&out).output().expect("starts");
    assert!(made.status.success(), "{file}, {direction} deg: {}", said(&made));
    out
}

/// What the ray cast over facets finds of a job.
fn cast(facets: &Path, job: &Path, direction: &str) -> Value {
    let out = script("check_solids.py").args(["60", "1"]).args([facets, job]).arg(direction).output();
    serde_json::from_str(&text(&out.expect("python starts"))).expect("JSON")
}

/// Asserts that the marks are those of the ray cast to 0.1 % and 0.05 mm: in sum, in place, in height, and once.
fn assert_as_cast(found: &Value, what: &str) {
    let most = 0.05 + 1e-3 * number(found, "cast_mm");
    let off = (number(found, "mark_mm") - number(found, "cast_mm")).abs();
    assert!(off <= most, "{what}: {found}");
    for key in ["extra_mm", "missing_mm", "depth_mm", "twice_mm"] {
        assert!(number(found, key) <= most, "{what}: {key} in {found}");
    }
    eprintln!("{what}: {:.3} mm, ray cast {:.3} mm", number(found, "mark_mm"), number(found, "cast_mm"));
}

#[test]
#[ignore = "slow: make test-all"]
fn marks_of_stl_solids_are_those_of_a_ray_cast_beside_every_line() {
    let dir = folder();
    for part in parts(dir.path()).iter().filter(|part| part.is_stl) {
        let file = format!("{}.stl", part.name);
        for direction in ["0", "90"] {
            let job = compiled(dir.path(), &file, direction);
            assert_as_cast(&cast(&dir.path().join(&file), &job, direction), &format!("{file}, {direction} deg"));
        }
    }
}

/// The round boss whose rim a line of the hatch meets at one degree, 30 nm from its tip: where the mark below ends is
/// rounding by some 100 nm.
#[test]
#[ignore = "slow: make test-all"]
fn a_boss_whose_rim_a_line_meets_at_one_degree_verifies() {
    let dir = folder();
    parts(dir.path());
    let bytes = std::fs::read(dir.path().join("boss_across_slope.fine")).expect("made");
    let numbers: Vec<f64> = bytes.chunks_exact(8).map(|b| f64::from_ne_bytes(b.try_into().expect("eight"))).collect();
    let (s, c) = math::sin_cos(0.0001f64.to_radians());
    let mut text = "solid boss\n".to_owned();
    for facet in numbers.chunks_exact(9) {
        text += "facet normal 0 0 0\nouter loop\n";
        for p in facet.chunks_exact(3) {
            text += &format!("vertex {:.9} {:.9} {:.9}\n", c * p[0] - s * p[1], s * p[0] + c * p[1], p[2]);
        }
        text += "endloop\nendfacet\n";
    }
    std::fs::write(dir.path().join("boss.stl"), text + "endsolid boss\n").expect("a writable folder");
    let texture = "pattern = \"hatch\"\npitch = \"1 mm\"";
    let mut job = JobText::on(Path::new("boss.stl")).texture(texture);
    job.focus = "pdof = \"0.3 mm\"".into();
    let job = job.write(dir.path(), "job.toml");
    let out = terrace(dir.path()).args(["compile", "--verify"]).arg(job).output().expect("starts");
    assert!(out.status.success(), "{}", said(&out));
}

/// The facets that the product makes of a STEP file at the tolerance of these jobs.
fn imported(dir: &Path, name: &str) -> PathBuf {
    let (file, ply) = (dir.join(format!("{name}.step")), dir.join(format!("{name}.ply")));
    let tolerance = format!("{} mm", PDOF_MM / 10.0);
    let made = terrace(dir).args(["import", "--tolerance", &tolerance]).arg(file).arg("-o").arg(&ply).output();
    let made = made.expect("starts");
    assert!(made.status.success(), "{name}: {}", said(&made));
    ply
}

#[test]
#[ignore = "slow: make test-all"]
fn marks_of_step_solids_are_those_of_a_ray_cast_and_near_those_of_finer_facets() {
    let dir = folder();
    for part in parts(dir.path()) {
        let (file, fine) = (format!("{}.step", part.name), dir.path().join(format!("{}.fine", part.name)));
        let facets = imported(dir.path(), &part.name);
        for direction in ["0", "90"] {
            let what = format!("{file}, {direction} deg");
            let job = compiled(dir.path(), &file, direction);
            assert_as_cast(&cast(&facets, &job, direction), &what);
            let finer = cast(&fine, &job, direction);
            if part.is_flat {
                assert_as_cast(&finer, &format!("{what}, other facets"));
            } else {
                assert_near(&finer, &format!("{what}, finer facets"));
            }
        }
    }
}

/// Asserts that the marks are those of a ray cast over finer facets, but for the ends: where a curved face reaches the
/// limit of slope, a facet is marked as a whole or is not.
fn assert_near(found: &Value, what: &str) {
    let (mark, cast) = (number(found, "mark_mm"), number(found, "cast_mm"));
    assert!((mark - cast).abs() <= NEAR * cast, "{what}: {found}");
    eprintln!("{what}: {mark:.3} mm, ray cast {cast:.3} mm, {:+.2} %", 100.0 * (mark / cast - 1.0));
}
