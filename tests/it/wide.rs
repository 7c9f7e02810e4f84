//! The wide matrix: every surface and every drawing that lies next to the repository, compiled and verified; and inputs
//! that would be slow if anything were quadratic.

use std::fmt::Write;
use std::path::Path;
use std::time::Instant;
use terrace_core::math;

use crate::support::surfaces::write_stl;
use crate::support::{JobText, assert_balance, compile, folder, shared, verify};

/// A machine with a square field of `field` mm, and room for every part.
fn machine(dir: &Path, field: f64) -> String {
    let profile = include_str!("../../crates/core/src/machine/profiles/xyz-galvo-40.toml");
    let text = profile
        .replace("[\"40 mm\", \"40 mm\"]", &format!("[\"{field} mm\", \"{field} mm\"]"))
        .replace("\"-250 mm\", \"250 mm\"", "\"-3000 mm\", \"3000 mm\"")
        .replace("\"-200 mm\", \"200 mm\"", "\"-3000 mm\", \"3000 mm\"")
        .replace("working_distance = \"150 mm\"", "working_distance = \"1900 mm\"");
    let path = dir.join("machine.toml");
    std::fs::write(&path, text).expect("a writable folder");
    format!("file = {:?}", path.display().to_string())
}

/// Compiles and verifies; no job here may take long.
fn run(name: &str, job: &JobText, dir: &Path) {
    let begin = Instant::now();
    let out = dir.join("wide.job");
    let summary = compile(&job.write(dir, "wide.toml"), &out);
    assert_balance(&summary, &verify(&out));
    let took = begin.elapsed().as_secs_f64();
    eprintln!("{name}: {} stops, {} fragments, {took:.1} s", summary["stops"], summary["fragments"]);
    assert!(took < 60.0, "{name} took {took} s");
}

#[test]
#[ignore = "slow, needs ../shared: make test-all"]
fn every_surface_compiles_and_verifies() {
    let data = shared();
    // Name, unit, largest extent and height in mm, more keys.
    let map = |pixel: f64, top: f64, more: &str| {
        format!("\n[surface.heightmap]\npixel = \"{pixel} mm\"\nz = [\"0 mm\", \"{top} mm\"]\n{more}")
    };
    let list: [(&str, &str, f64, f64, String); 29] = [
        ("fuji_ascii.stl", "mm", 201.0, 8.0, String::new()),
        ("helens_relief_small.stl", "mm", 274.0, 37.0, String::new()),
        ("helmet_outer_open.stl", "mm", 260.0, 197.0, String::new()),
        ("helmet_shell_undercut.stl", "mm", 260.0, 197.0, String::new()),
        ("hood_ascii_crlf.stl", "mm", 1493.0, 350.0, String::new()),
        ("hood_mm_bin.stl", "mm", 1493.0, 350.0, String::new()),
        ("hood_inches_bin.stl", "in", 1493.0, 350.0, String::new()),
        ("hood_metres_bin.stl", "m", 1493.0, 350.0, String::new()),
        ("hood_tilted_carcoords.stl", "mm", 1173.0, 1436.0, String::new()),
        ("hood_quads_uv.obj", "mm", 1493.0, 350.0, String::new()),
        ("mirror_freeform.stl", "mm", 320.0, 40.0, String::new()),
        ("mould_core_draft3.stl", "mm", 200.0, 70.0, String::new()),
        ("mouse_shell_undercut.stl", "mm", 124.0, 40.0, String::new()),
        ("propeller_and_shaft.stl", "mm", 1484.0, 246.0, String::new()),
        ("busted.STL", "mm", 11.4, 9.6, String::new()),
        ("torus.STL", "mm", 3.0, 1.0, String::new()),
        ("groups.obj", "mm", 9.4, 4.0, String::new()),
        ("fuze.obj", "m", 73.0, 215.0, String::new()),
        ("panel_negidx_ngon.obj", "mm", 190.0, 4.0, String::new()),
        ("quadknot.obj", "mm", 171.0, 182.0, String::new()),
        ("mirror_cloud_shuffled.xyz", "mm", 320.0, 27.0, String::new()),
        ("helens_dem_u16_decimetre.png", "", 234.0, 26.0, map(0.5, 26.0, "values = [0, 25430]\nnodata = 0")),
        ("hood_u16_2mm.png", "", 1560.0, 350.0, map(2.0, 350.0, "nodata = 0")),
        ("hood_inch.3mf", "", 1493.0, 350.0, String::new()),
        ("mould_core_pair_mm.3mf", "", 460.0, 70.0, String::new()),
        ("hood_bin_be_double.ply", "mm", 1493.0, 350.0, String::new()),
        ("hood_f32_nan_2mm.tif", "", 1560.0, 350.0, map(2.0, 100.0, "values = [0, 100]")),
        ("jacksboro_dem_i16.tif", "", 202.0, 8.4, map(0.5, 8.4, "values = [236, 1076]")),
        ("jacksboro_dem_u16_m.png", "", 202.0, 8.4, map(0.5, 8.4, "values = [236, 1076]")),
    ];
    for (name, unit, extent, tall, more) in list {
        let dir = folder();
        let leather = data.join("textures/made_voronoi_leather_tile.svg");
        let mut job = JobText::on(&data.join("surfaces").join(name)).method("auto");
        let unit = if unit.is_empty() { String::new() } else { format!("unit = {unit:?}\n") };
        job.surface = job.surface.replace("unit = \"mm\"", &unit) + &more;
        for direction in [0, 37] {
            let pitch = (extent / 300.0).max(0.02);
            job = job.texture(&format!("pattern = \"hatch\"\npitch = \"{pitch} mm\"\ndirection = \"{direction} deg\""));
        }
        job = job.texture(&format!(
            "file = {:?}\nsize = [\"{size} mm\", \"{size} mm\"]\ntile = true\narea = \"part\"\nfill = \"outline\"\nstroke = \"centre\"",
            leather.display().to_string(),
            size = extent / 3.0
        ));
        job.focus = format!("pdof = \"{} mm\"", (tall / 40.0).clamp(0.0715, 20.0));
        job.machine = machine(dir.path(), (extent / 8.0).clamp(2.0, 150.0).round());
        job.more = "[limits]\nmax_incidence = \"75 deg\"\nmax_off_part = \"100 %\"\nimplausible = \"allow\"\n".into();
        run(name, &job, dir.path());
    }
}

#[test]
#[ignore = "slow, needs ../shared: make test-all"]
fn every_drawing_compiles_and_verifies_on_a_curved_surface() {
    let data = shared();
    let dir = folder();
    let stl = dir.path().join("bump.stl");
    let z = |x: f64, y: f64| 3.0 * math::sin(x / 18.0) * math::cos(y / 21.0);
    write_stl(&stl, &crate::support::surfaces::mesh(60, [0.0, 0.0, 100.0, 100.0], z));
    let mut names: Vec<_> = std::fs::read_dir(data.join("textures"))
        .expect("a readable folder")
        .map(|e| e.expect("a readable folder").path())
        .filter(|p| p.extension().is_some_and(|e| e == "svg"))
        .collect();
    names.sort();
    for path in names {
        for (tile, size) in [(false, 98.0), (true, 37.3)] {
            let mut job = JobText::on(&stl).texture(&format!(
                "file = {:?}\nsize = [\"{size} mm\", \"{size} mm\"]\ntile = {tile}\narea = \"part\"\nfill = \"outline\"\nstroke = \"centre\"\n\
                 on_unsupported = \"warn\"",
                path.display().to_string()
            ));
            job.focus = "pdof = \"0.3 mm\"".into();
            // Of the pen: dashes of no length with round caps are dots.
            job.more = "dwell = \"100 us\"\n".into();
            run(&path.display().to_string(), &job, dir.path());
        }
    }
}

type Facets = Vec<[[f64; 3]; 3]>;

fn plate(size: f64, rise: f64) -> Facets {
    let [a, b, c, d] = [[0.0, 0.0, 0.0], [size, 0.0, 0.0], [size, size, rise], [0.0, size, rise]];
    vec![[a, b, c], [a, c, d]]
}

/// Compiles and verifies a made surface with a pattern, or a drawing of 40 x 40 mm.
fn trap(name: &str, facets: &Facets, texture: &str, path: Option<String>) {
    let dir = folder();
    let stl = dir.path().join("trap.stl");
    write_stl(&stl, facets);
    let mut texture = texture.to_owned();
    if let Some(path) = path {
        let svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"40mm\" height=\"40mm\" viewBox=\"0 0 40 40\"><path \
             fill=\"none\" stroke=\"black\" stroke-width=\"0.001\" d=\"{path}\"/></svg>"
        );
        std::fs::write(dir.path().join("trap.svg"), svg).expect("a writable folder");
        texture = "file = \"trap.svg\"".into();
    }
    let mut job = JobText::on(&stl).method("auto").texture(&texture);
    job.more = "[limits]\nmax_off_part = \"100 %\"\n".into();
    run(name, &job, dir.path());
}

const HATCH: &str = "pattern = \"hatch\"\npitch = \"0.1 mm\"";

#[test]
#[ignore = "slow: make test-all"]
fn parts_with_many_facets_in_one_place_compile_and_verify() {
    crowded([1_000, 30, 5_000, 50], 8_000);
}

#[test]
#[ignore = "slow: make test-all"]
fn time_is_not_quadratic_in_the_facets_of_one_place() {
    crowded([10_000, 150, 50_000, 200], 40_000);
}

/// Parts with so many facets: in each of two fans, in tiny rows, in a strip, and in rows of facets that do not touch;
/// and plates under so many strokes.
fn crowded([fans, tiny_rows, strip, rows]: [usize; 4], strokes: u32) {
    // Two fans of many facets, one over the other.
    let fan = |n: usize, z: f64| -> Facets {
        let at = |i: usize| {
            let a = i as f64 / n as f64 * std::f64::consts::TAU;
            [20.0 * math::cos(a), 20.0 * math::sin(a), z]
        };
        (0..n).map(|i| [[0.0, 0.0, z], at(i), at(i + 1)]).collect()
    };
    trap("fans", &[fan(fans, 0.0), fan(fans, 5.0)].concat(), "pattern = \"hatch\"\npitch = \"1 mm\"", None);
    // Tiny facets on a huge one.
    let mut tiny = plate(400.0, 0.0);
    for f in
        crate::support::surfaces::mesh(tiny_rows, [200.0, 200.0, 201.0, 201.0], |x, _| 0.01 + 1e-3 * math::sin(x * 9.0))
    {
        tiny.push(f);
    }
    let there = "area = [\"199.5 mm\", \"199.5 mm\", \"201.5 mm\", \"201.5 mm\"]";
    trap("tiny", &tiny, &format!("pattern = \"hatch\"\npitch = \"0.005 mm\"\n{there}"), None);
    // A strip of facets along a diagonal.
    let strip: Facets = (0..strip)
        .map(|i| (i as f64 * 25.0 / strip as f64, (i + 1) as f64 * 25.0 / strip as f64))
        .flat_map(|(x, y)| {
            [[[x, x, 0.0], [y, y, 0.0], [y, y + 0.1, 0.0]], [[x, x, 0.0], [y, y + 0.1, 0.0], [x, x + 0.1, 0.0]]]
        })
        .collect();
    trap("strip", &strip, HATCH, None);
    // Nothing but borders.
    let apart: Facets = (0..rows * rows)
        .map(|i| ((i % rows) as f64 * 0.1, (i / rows) as f64 * 0.1))
        .map(|(x, y)| [[x, y, 0.0], [x + 0.08, y, 0.0], [x, y + 0.08, 0.0]])
        .collect();
    trap("apart", &apart, HATCH, None);
    // The same stroke again and again; a star; dashes at as many heights.
    trap("stack", &plate(40.0, 0.0), "", Some("M3 3L20 25".repeat(strokes as usize)));
    let mut star = String::new();
    let mut dashes = String::new();
    for i in 0..strokes {
        let a = f64::from(i) * 40.0 / f64::from(strokes);
        write!(star, "M20 20L{:.4} {:.4}", 20.0 + 19.0 * math::cos(a), 20.0 + 19.0 * math::sin(a)).expect("text");
        let [x, y] = [i.wrapping_mul(2_654_435_761), i.wrapping_mul(40_503_551)].map(|v| f64::from(v) / 4.3e9 * 39.0);
        write!(dashes, "M{x:.4} {y:.4}h.02").expect("text");
    }
    trap("star", &plate(40.0, 0.0), "", Some(star));
    trap("dashes", &plate(40.0, 0.3), "", Some(dashes));
}

#[test]
fn plateaus_exactly_on_the_borders_of_levels_are_marked_once() {
    // Steps of exactly one depth range, upright walls between them, strokes along and across.
    let (mut facets, depth, tread) = (Facets::new(), 0.07, 0.7);
    for k in 0..30 {
        let (x0, x1, z) = (f64::from(k) * tread, f64::from(k + 1) * tread, f64::from(k) * depth);
        facets.extend(plate(1.0, 0.0).into_iter().map(|f| f.map(|[x, y, _]| [x0 + x * (x1 - x0), y * 20.0, z])));
        let wall = [[x1, 0.0, z], [x1, 20.0, z], [x1, 20.0, z + depth], [x1, 0.0, z + depth]];
        facets.extend([[wall[0], wall[1], wall[2]], [wall[0], wall[2], wall[3]]]);
    }
    trap("across", &facets, HATCH, None);
    trap("along", &facets, "pattern = \"hatch\"\npitch = \"0.35 mm\"\ndirection = \"90 deg\"", None);
}
