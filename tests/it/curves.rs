//! Space curves as textures: forms of files, the distance from the surface, ids, and the article's case.

use std::fmt::Write;
use std::path::{Path, PathBuf};
use terrace_core::math;

use serde_json::Value;

use crate::support::surfaces::{mesh, write_stl};
use crate::support::{JobText, compile, folder, number, said, shared, terrace, verify};
use terrace_core::geom::P2;
use terrace_input::surface::{Cursor, Surface};

type Curve = Vec<[f64; 3]>;

/// A dome of 120 mm, 4 mm high.
fn dome(x: f64, y: f64) -> f64 {
    let (u, v) = ((x - 60.0) / 60.0, (y - 60.0) / 60.0);
    4.0 * (1.0 - (u * u + v * v) / 2.0)
}

/// A plane that rises along x and falls along y.
fn plane(x: f64, y: f64) -> f64 {
    0.3 * x - 0.1 * y + 2.0
}

fn part(dir: &Path, side: f64, z: impl Fn(f64, f64) -> f64) -> PathBuf {
    let path = dir.join("part.stl");
    write_stl(&path, &mesh(60, [0.0, 0.0, side, side], z));
    path
}

/// A DXF of 3D polylines on layer Cells; closed where they end on their first point.
fn dxf(curves: &[Curve]) -> String {
    let mut out = "0\nSECTION\n2\nHEADER\n9\n$INSUNITS\n70\n4\n0\nENDSEC\n0\nSECTION\n2\nENTITIES\n".to_owned();
    for (k, curve) in curves.iter().enumerate() {
        let is_closed = curve.first() == curve.last();
        let vertices = &curve[..curve.len() - usize::from(is_closed)];
        let flags = 8 + u32::from(is_closed);
        write!(out, "0\nPOLYLINE\n5\n{:X}\n8\nCells\n66\n1\n70\n{flags}\n", k + 256).expect("text grows");
        for [x, y, z] in vertices {
            write!(out, "0\nVERTEX\n8\nCells\n10\n{x:.6}\n20\n{y:.6}\n30\n{z:.9}\n70\n32\n").expect("text grows");
        }
        out += "0\nSEQEND\n8\nCells\n";
    }
    out + "0\nENDSEC\n0\nEOF\n"
}

/// A CSV with ids, in units of `unit` mm.
fn csv(curves: &[Curve], unit: f64) -> String {
    let mut out = "id,x,y,z\n".to_owned();
    for (k, curve) in curves.iter().enumerate() {
        for p in curve {
            let [x, y, z] = p.map(|v| v / unit);
            writeln!(out, "cell-{k},{x:.12},{y:.12},{z:.12}").expect("text grows");
        }
    }
    out
}

/// A DXF of these entities: tags separated by blanks.
fn entities(tags: &str) -> String {
    let body: String = tags.split_whitespace().map(|t| format!("{t}\n")).collect();
    format!("0\nSECTION\n2\nENTITIES\n{body}0\nENDSEC\n0\nEOF\n")
}

/// A job with curves on a part; other lines of the texture follow.
fn job(dir: &Path, part: &Path, file: &str, text: &str, keys: &str) -> PathBuf {
    std::fs::write(dir.join(file), text).expect("a writable folder");
    let job = JobText::on(part).texture(&format!("curves = \"{file}\"\n{keys}"));
    job.method("z-range").write(dir, "job.toml")
}

/// Exit code, error codes and first message of a check.
fn outcome(job: &Path) -> (i32, Vec<String>, Value) {
    let out = terrace([Path::new("check"), job, Path::new("--json")]);
    let json: Value = serde_json::from_slice(&out.stdout).unwrap_or_else(|e| panic!("{e}: {}", said(&out)));
    let list = if out.status.success() { &json["warnings"] } else { &json["errors"] };
    let codes = list.as_array().into_iter().flatten().map(|d| d["code"].as_str().expect("a code").to_owned());
    (out.status.code().expect("it ends"), codes.collect(), json.clone())
}

// --- The article's case

/// The outline of a cross about the origin, counter-clockwise from the lower left of its lowest arm.
fn cross(tip: f64, width: f64) -> Vec<[f64; 2]> {
    let (r, w) = (tip / 2.0, width / 2.0);
    let quarter = [[-w, -r], [w, -r], [w, -w]];
    turned_four_times(&quarter)
}

/// The same of a Jerusalem cross.
fn jerusalem(tip: f64, width: f64, bar: f64) -> Vec<[f64; 2]> {
    let (r, w, b) = (tip / 2.0, width / 2.0, bar / 2.0);
    let h = r - width;
    turned_four_times(&[[-b, -r], [b, -r], [b, -h], [w, -h], [w, -w], [h, -w], [h, -b]])
}

fn turned_four_times(quarter: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let mut out: Vec<[f64; 2]> = Vec::new();
    for k in 0..4 {
        out.extend(quarter.iter().map(|&[x, y]| match k {
            0 => [x, y],
            1 => [-y, x],
            2 => [-x, -y],
            _ => [y, -x],
        }));
    }
    out.push(out[0]);
    out
}

/// Cells in columns and rows over the dome, each point at the dome's height.
fn cells(outline: &[[f64; 2]], pitch: f64, count: usize) -> Vec<Curve> {
    let centre = |i: usize| (i as f64 + 0.5) * pitch;
    let cell = |k: usize| {
        let (x, y) = (centre(k % count), centre(k / count));
        outline.iter().map(|p| [x + p[0], y + p[1], dome(x + p[0], y + p[1])]).collect()
    };
    (0..count * count).map(cell).collect()
}

#[test]
#[ignore = "slow: make test-all"]
fn fss_cells_in_space_need_the_stops_and_have_the_defocus_of_the_projected_cells() {
    let dir = folder();
    let part = part(dir.path(), 120.0, dome);
    let patterns = [
        ("crosses", cross(4.0, 1.0), "cell = \"4 mm\"\nwidth = \"1 mm\""),
        ("jerusalem", jerusalem(4.0, 0.5, 1.5), "cell = \"4 mm\"\nwidth = \"0.5 mm\"\nbar = \"1.5 mm\""),
    ];
    for (pattern, outline, keys) in patterns {
        let flat = JobText::on(&part)
            .texture(&format!("pattern = \"{pattern}\"\npitch = \"6 mm\"\n{keys}"))
            .method("z-range")
            .write(dir.path(), "flat.toml");
        let flat = compile(&flat, &dir.path().join("flat"));
        let curves = cells(&outline, 6.0, 20);
        for (file, text, keys) in [("cells.dxf", dxf(&curves), ""), ("cells.csv", csv(&curves, 25.4), "unit = \"in\"")]
        {
            let job = job(dir.path(), &part, file, &text, keys);
            let space = compile(&job, &dir.path().join("space"));
            for key in ["stops", "worst_defocus_um", "sub_blocks", "fragments", "strokes_cut", "figures_whole"] {
                assert_eq!(space[key], flat[key], "{pattern} by {file}: {key}");
            }
            assert!((number(&space, "mark_mm") - number(&flat, "mark_mm")).abs() < 1e-6);
            assert_eq!(space["warnings"], Value::Array(Vec::new()), "{pattern} by {file}");
            let c = &space["curves"];
            assert_eq!(c["count"], 400, "{c}");
            // Facets of 2 mm miss the dome by a few um.
            assert!(number(c, "worst_distance_um") > 0.1 && number(c, "worst_distance_um") < 5.0, "{c}");
            assert!((number(c, "plan_mm") - number(&flat, "texture_mm")).abs() < 1e-6, "{c}");
            assert!(flat["curves"].is_null());
            let proof = verify(&dir.path().join("space"));
            assert_eq!(proof["stops"], space["stops"]);
            let rules = proof["rules"].as_array().expect("a list");
            let rule = rules.iter().find(|r| r["code"] == "curves").expect("the rule");
            assert_eq!((&rule["ran"], &rule["checked"]), (&true.into(), &400.into()));
        }
    }
}

// --- Distance from the surface

#[test]
fn curves_are_refused_beyond_their_distance_and_not_at_it() {
    let dir = folder();
    let part = part(dir.path(), 20.0, |_, _| 0.0);
    let lifted = |z: f64| {
        let curves = [vec![[2.0, 3.0, 0.0], [8.0, 3.0, 0.0]], vec![[2.0, 5.0, 0.0], [8.0, 5.0, z]]];
        csv(&curves, 1.0)
    };
    // Half of 0.07 mm unless the texture says otherwise; a picometre is beyond.
    for (z, keys, is_held) in [
        (0.035, "", true),
        (-0.035, "", true),
        (0.035_000_001, "", false),
        (-0.035_000_001, "", false),
        (0.01, "max_distance = \"10 um\"", true),
        (0.010_000_001, "max_distance = \"10 um\"", false),
        (5.0, "max_distance = \"5 mm\"", true),
    ] {
        let job = job(dir.path(), &part, "c.csv", &lifted(z), &format!("unit = \"mm\"\n{keys}"));
        let (code, codes, json) = outcome(&job);
        if is_held {
            assert_eq!((code, codes), (0, vec![]), "{z} {keys}");
            let found = number(&json["curves"], "worst_distance_um");
            assert!((found - 1e3 * z.abs()).abs() < 1e-6, "{z}: {found}");
        } else {
            assert_eq!((code, codes), (1, vec!["curve-distance".to_owned()]), "{z} {keys}");
        }
    }
}

#[test]
fn messages_name_curve_place_and_number() {
    let dir = folder();
    let part = part(dir.path(), 20.0, |_, _| 0.0);
    let curves = [
        vec![[2.0, 3.0, 0.0], [8.0, 3.0, 0.0]],
        vec![[2.0, 5.0, 0.0], [8.0, 5.0, 0.04]],
        vec![[2.0, 7.0, 0.0], [8.0, 7.25, -0.0512], [9.0, 8.0, 0.0]],
    ];
    let at = "is 0.051200 mm below it at x 8.0000, y 7.2500 mm";
    for (file, text, keys, name) in [
        ("c.csv", csv(&curves, 1.0), "unit = \"mm\"", "curve cell-2 (line 6)"),
        ("c.dxf", dxf(&curves), "", "POLYLINE 102 (layer:Cells)"),
    ] {
        for warn in ["", "\non_distance = \"warn\""] {
            let job = job(dir.path(), &part, file, &text, &format!("{keys}{warn}"));
            let (code, codes, json) = outcome(&job);
            let list = if code == 0 { &json["warnings"] } else { &json["errors"] };
            assert_eq!((code, codes), (i32::from(warn.is_empty()), vec!["curve-distance".to_owned()]), "{json}");
            let message = format!("2 of 3 curves lie farther than 0.035 mm from the surface: {name} {at}");
            assert_eq!(list[0]["message"], message.as_str(), "{file}");
        }
    }
    // The place is that of the file where the part is turned.
    let job = job(dir.path(), &part, "c.csv", &csv(&curves, 1.0), "unit = \"mm\"");
    let text = std::fs::read_to_string(&job).expect("the job") + "\n[placement]\nturn = \"33 deg\"\n";
    std::fs::write(&job, text).expect("a writable folder");
    let (_, _, json) = outcome(&job);
    assert!(json["errors"][0]["message"].as_str().expect("a message").ends_with(at), "{json}");
}

#[test]
fn a_chord_over_the_dome_is_refused_at_its_middle() {
    let dir = folder();
    let part = part(dir.path(), 120.0, dome);
    let [a, b] = [[40.0, 60.0], [80.0, 60.0]].map(|[x, y]| [x, y, dome(x, y)]);
    let job_of = |curve: Curve| job(dir.path(), &part, "c.csv", &csv(&[curve], 1.0), "unit = \"mm\"");
    let (code, _, json) = outcome(&job_of(vec![a, b]));
    let message = json["errors"][0]["message"].as_str().expect("a message");
    // Its ends lie on the dome; the sagitta of 40 mm is 4 / 2 / 60² · 20² mm.
    assert!(code == 1 && message.contains(" is 0.22") && message.contains(" mm below it"), "{message}");
    let x: f64 = message.split("at x ").nth(1).and_then(|t| t.split(',').next()?.parse().ok()).expect("x");
    assert!((x - 60.0).abs() < 1.5, "{message}");
    let fine = (0..=40).map(|k| [40.0 + f64::from(k), 60.0, dome(40.0 + f64::from(k), 60.0)]).collect();
    assert_eq!(outcome(&job_of(fine)).0, 0);
}

#[test]
fn a_curve_down_a_wall_lies_on_it_and_not_beyond_it() {
    let dir = folder();
    // A step of 1 mm at x = 10: two plates and the wall between them.
    let quad = |a: [f64; 3], b: [f64; 3], c: [f64; 3], d: [f64; 3]| [[a, b, c], [a, c, d]];
    let facets = [
        quad([0.0, 0.0, 1.0], [10.0, 0.0, 1.0], [10.0, 20.0, 1.0], [0.0, 20.0, 1.0]),
        quad([10.0, 0.0, 1.0], [10.0, 0.0, 0.0], [10.0, 20.0, 0.0], [10.0, 20.0, 1.0]),
        quad([10.0, 0.0, 0.0], [20.0, 0.0, 0.0], [20.0, 20.0, 0.0], [10.0, 20.0, 0.0]),
    ];
    let path = dir.path().join("step.stl");
    write_stl(&path, &facets.concat());
    for (deepest, code) in [(0.0, 0), (-0.03, 0), (-0.04, 1)] {
        let curve = vec![[5.0, 5.0, 1.0], [10.0, 6.0, 1.0], [10.0, 6.0, deepest], [10.0, 6.0, 0.0], [15.0, 9.0, 0.0]];
        let along = vec![[10.0, 1.0, 1.0], [10.0, 19.0, 1.0]];
        let job = job(dir.path(), &path, "c.csv", &csv(&[curve, along], 1.0), "unit = \"mm\"");
        assert_eq!(outcome(&job).0, code, "{deepest}");
    }
}

// --- Files

/// Entities that lie on [`plane`]; the plane's own axes give the extrusion.
fn on_plane() -> String {
    let normal = "210 -0.3 220 0.1 230 1";
    // The arbitrary axis algorithm: x of the plane is z × n, y is n × x.
    let n = 1.1f64.sqrt();
    let unit = [-0.3 / n, 0.1 / n, 1.0 / n];
    let ax = [-unit[1], unit[0], 0.0];
    let l = math::hypot(ax[0], ax[1]);
    let ax = ax.map(|v| v / l);
    let ay = [unit[1] * ax[2] - unit[2] * ax[1], unit[2] * ax[0] - unit[0] * ax[2], unit[0] * ax[1] - unit[1] * ax[0]];
    let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let at = |x: f64, y: f64| [x, y, plane(x, y)];
    // A point of the plane in the coordinates of an entity with that extrusion.
    let ocs = |x: f64, y: f64| [ax, ay, unit].map(|axis| dot(at(x, y), axis));
    let wcs = |x: f64, y: f64, code: u32| {
        let [x, y, z] = at(x, y);
        format!("{code} {x} {} {y} {} {z}", code + 10, code + 20)
    };
    let [cx, cy, cz] = ocs(5.0, 5.0);
    let [px, py, pz] = ocs(10.0, 5.0);
    let [ex, ey] = [3.0, 0.9];
    [
        format!("0 LINE 5 A1 8 L {} {}", wcs(1.0, 1.0, 10), wcs(3.0, 2.0, 11)),
        format!("0 CIRCLE 5 A2 8 L 10 {cx} 20 {cy} 30 {cz} 40 2 {normal}"),
        format!("0 ARC 5 A3 8 L 10 {px} 20 {py} 30 {pz} 40 1.5 50 20 51 200 {normal}"),
        format!(
            "0 LWPOLYLINE 5 A4 8 L 90 3 70 1 38 {pz} 10 {px} 20 {} 42 0.5 10 {} 20 {} 10 {} 20 {} {normal}",
            py + 4.0,
            px + 2.0,
            py + 4.0,
            px + 1.0,
            py + 6.0
        ),
        format!(
            "0 ELLIPSE 5 A5 8 L {} 11 {ex} 21 0 31 {ey} 40 0.5 41 0 42 6.283185307179586 {normal}",
            wcs(14.0, 14.0, 10)
        ),
        format!(
            "0 SPLINE 5 A6 8 L 70 8 71 3 72 8 73 4 40 0 40 0 40 0 40 0 40 1 40 1 40 1 40 1 {} {} {} {}",
            wcs(2.0, 12.0, 10),
            wcs(4.0, 16.0, 10),
            wcs(7.0, 8.0, 10),
            wcs(9.0, 14.0, 10)
        ),
        format!(
            "0 POLYLINE 5 A7 8 L 66 1 70 9 0 VERTEX 8 L {} 70 32 0 VERTEX 8 L {} 70 32 0 VERTEX 8 L {} 70 32 0 SEQEND",
            wcs(15.0, 2.0, 10),
            wcs(18.0, 2.0, 10),
            wcs(17.0, 5.0, 10)
        ),
    ]
    .join(" ")
}

#[test]
fn every_entity_of_a_dxf_lies_on_the_surface_in_any_plane() {
    let dir = folder();
    let part = part(dir.path(), 20.0, plane);
    let keys = "unit = \"mm\"\nmax_distance = \"1.1 um\"";
    let job_file = job(dir.path(), &part, "c.dxf", &entities(&on_plane()), keys);
    let summary = compile(&job_file, &dir.path().join("out"));
    let c = &summary["curves"];
    assert_eq!(c["count"], 7, "{c}");
    // The closed ones: circle, light polyline, ellipse, polyline.
    assert_eq!(number(&summary, "figures_whole") + number(&summary, "figures_cut"), 4.0, "{summary}");
    assert!(number(c, "surface_mm") > 1.01 * number(c, "plan_mm"), "{c}");
    verify(&dir.path().join("out"));
    // Inserted in a block that is turned in space, they are where its extrusion puts them: here below the plane.
    let lowered = on_plane().replace("0 LINE", "0 LINE 999 moved");
    let text = format!("0\nSECTION\n2\nBLOCKS\n{}0\nENDSEC\n", {
        let tags = format!("0 BLOCK 2 B 10 0 20 0 30 0 {lowered} 0 ENDBLK");
        tags.split_whitespace().map(|t| format!("{t}\n")).collect::<String>()
    }) + &entities("0 INSERT 5 B0 8 L 2 B 10 0 20 0 30 -0.5");
    let inserted = job(dir.path(), &part, "b.dxf", &text, "unit = \"mm\"");
    let (code, _, json) = outcome(&inserted);
    let message = json["errors"][0]["message"].as_str().expect("a message");
    assert!(code == 1 && message.starts_with("7 of 7 curves") && message.contains("layer:L, block:B"), "{message}");
    assert!(message.contains("is 0.5"), "{message}");
}

#[test]
fn what_is_not_a_curve_or_not_read_is_refused_by_name() {
    let dir = folder();
    let part = part(dir.path(), 20.0, |_, _| 0.0);
    let line = "0 LINE 5 1 8 L 10 1 20 1 30 0 11 5 21 1 31 0";
    let tags = |more: &str| entities(&format!("{line} {more}"));
    let mm = "unit = \"mm\"";
    for (file, text, keys, exit, code) in [
        ("a.dxf", tags("0 SOLID 5 2 8 L 10 1 20 1 11 2 21 1 12 1 22 2 13 2 23 2"), mm, 2, "dxf-area"),
        ("a.dxf", tags("0 LWPOLYLINE 5 2 8 L 90 2 70 0 43 0.5 10 1 20 1 10 4 20 4"), mm, 2, "dxf-area"),
        ("a.dxf", tags("0 3DFACE 5 2 8 L 10 1 20 1 11 2 21 1 12 1 22 2"), mm, 2, "dxf-mesh"),
        ("a.dxf", tags("0 POINT 5 2 8 L 10 1 20 1 30 0"), mm, 2, "pen-dwell"),
        ("a.dxf", tags(""), "", 2, "dxf-unit"),
        ("a.dxf", entities(""), mm, 2, "texture-empty"),
        ("a.dxf", "0,0,0\n1,1,1\n".to_owned(), mm, 2, "dxf-syntax"),
        ("a.csv", "0,0,0\n1,1,0\n".to_owned(), "", 2, "curve-unit"),
        ("a.csv", "0,0,0\n1,1\n".to_owned(), mm, 2, "curve-columns"),
        ("a.csv", "0,0,0\n1,1,a\n".to_owned(), mm, 2, "curve-number"),
        ("a.csv", "\n# nothing\n\n".to_owned(), mm, 2, "texture-empty"),
        ("a.csv", "0,0,0\n1e5,0,0\n".to_owned(), mm, 2, "texture-far"),
        ("a.csv", "0,0,0\n5,0,5000\n".to_owned(), mm, 2, "texture-far"),
        ("a.csv", "100,0,0\n105,0,0\n".to_owned(), mm, 1, "job-empty"),
        ("a.svg", "<svg/>".to_owned(), mm, 2, "curve-format"),
        ("a.csv", "0,0,0\n5,5,0\n".to_owned(), "unit = \"mm\"\narea = \"part\"", 2, "texture-key"),
        ("a.csv", "0,0,0\n5,5,0\n".to_owned(), "unit = \"mm\"\nsize = [\"1 mm\", \"1 mm\"]", 2, "texture-key"),
        ("a.csv", "0,0,0\n5,5,0\n".to_owned(), "unit = \"mm\"\nonly = [\"id:b\"]", 2, "texture-pens"),
        ("a.csv", "0,0,0\n5,5,0\n".to_owned(), "unit = \"mm\"\npattern = \"hatch\"", 2, "texture-both"),
    ] {
        let job = job(dir.path(), &part, file, &text, keys);
        let (found, codes, json) = outcome(&job);
        assert!(found == exit && codes.iter().any(|c| c == code), "{file} {text:?} {keys}: {found} {codes:?} {json}");
    }
    // With a pattern the keys of curves say nothing.
    let keys = "pattern = \"hatch\"\npitch = \"1 mm\"\nmax_distance = \"1 mm\"\non_distance = \"warn\"";
    let job = JobText::on(&part).texture(keys).write(dir.path(), "hatch.toml");
    assert_eq!(outcome(&job).1, ["texture-key", "texture-key"]);
}

#[test]
fn a_drawing_that_is_not_flat_is_reported_and_a_flat_one_as_curves_is_too() {
    let dir = folder();
    let part = part(dir.path(), 20.0, |_, _| 3.0);
    let curves = [vec![[2.0, 3.0, 0.0], [8.0, 3.0, 0.0]], vec![[2.0, 5.0, 0.0], [8.0, 5.0, 0.04]]];
    std::fs::write(dir.path().join("c.dxf"), dxf(&curves)).expect("a writable folder");
    let flat = JobText::on(&part).texture("file = \"c.dxf\"").write(dir.path(), "flat.toml");
    let (code, codes, json) = outcome(&flat);
    assert_eq!((code, codes), (0, vec!["dxf-space".to_owned()]), "{json}");
    let (code, _, json) = outcome(&job(dir.path(), &part, "f.dxf", &dxf(&curves[..1]), ""));
    let hint = json["errors"][0]["help"].as_str().expect("a hint");
    assert!(code == 1 && hint.contains("the curves are flat"), "{json}");
}

#[test]
fn ids_and_layers_choose_curves_and_pens() {
    let dir = folder();
    let part = part(dir.path(), 20.0, |_, _| 0.0);
    let curves = [
        vec![[2.0, 3.0, 0.0], [8.0, 3.0, 0.0]],
        vec![[2.0, 5.0, 0.0], [8.0, 5.0, 9.0]],
        vec![[2.0, 7.0, 0.0], [7.0, 7.0, 0.0]],
    ];
    let keys = "unit = \"mm\"\nexcept = [\"id:cell-1\"]\npens = { \"id:cell-2\" = \"fine\" }";
    let job = job(dir.path(), &part, "c.csv", &csv(&curves, 1.0), keys);
    let pen = "\n[[pen]]\nname = \"fine\"\nspeed = \"500 mm/s\"\npower = \"60 %\"\nfrequency = \"60 kHz\"\n";
    let text = std::fs::read_to_string(&job).expect("the job") + pen;
    std::fs::write(&job, text).expect("a writable folder");
    let out = dir.path().join("out");
    let summary = compile(&job, &out);
    assert_eq!(summary["curves"]["count"], 2);
    assert!((number(&summary, "mark_mm") - 11.0).abs() < 1e-9, "{summary}");
    let block = &crate::support::manifest(&out)["blocks"][0];
    assert_eq!(block["pens"], serde_json::json!(["fill", "fine"]));
    verify(&out);
}

// --- The rest of the job

#[test]
fn curves_turn_with_the_part_and_are_marked_in_every_pass() {
    let dir = folder();
    let part = part(dir.path(), 20.0, plane);
    let job = job(dir.path(), &part, "c.dxf", &entities(&on_plane()), "unit = \"mm\"\nmax_distance = \"1.1 um\"");
    let text = std::fs::read_to_string(&job).expect("the job");
    std::fs::write(&job, text + "\n[placement]\nturn = \"30 deg\"\n\n[passes]\ncount = 2\nlower = \"5 um\"\n")
        .expect("a writable folder");
    let summary = compile(&job, &dir.path().join("out"));
    let c = &summary["curves"];
    assert!((2.0 * number(c, "plan_mm") - number(&summary, "texture_mm")).abs() < 1e-6, "{summary}");
    verify(&dir.path().join("out"));
}

#[test]
#[ignore = "slow: make test-all"]
fn curves_are_marked_on_the_fly() {
    let dir = folder();
    let part = part(dir.path(), 20.0, plane);
    let job_file = job(dir.path(), &part, "c.dxf", &entities(&on_plane()), "unit = \"mm\"\nmax_distance = \"1.1 um\"");
    let text = std::fs::read_to_string(&job_file).expect("the job");
    let fly = "[machine]\nprofile = \"xyz-galvo-100\"";
    let text = format!("mode = \"on-the-fly\"\n{}", text.replace("[machine]\nprofile = \"xyz-galvo-40\"", fly));
    std::fs::write(&job_file, text).expect("a writable folder");
    let summary = compile(&job_file, &dir.path().join("out"));
    assert_eq!(summary["curves"]["count"], 7, "{summary}");
    verify(&dir.path().join("out"));
}

#[test]
fn verify_reports_figures_of_curves_that_are_not_theirs() {
    let dir = folder();
    let part = part(dir.path(), 20.0, plane);
    let job = job(dir.path(), &part, "c.dxf", &entities(&on_plane()), "unit = \"mm\"\nmax_distance = \"1.1 um\"");
    let out = dir.path().join("out");
    compile(&job, &out);
    let path = out.join("manifest.json");
    let whole = std::fs::read_to_string(&path).expect("the manifest");
    for key in ["count", "plan_mm", "surface_mm", "worst_distance_um"] {
        let mut manifest: Value = serde_json::from_str(&whole).expect("JSON");
        let value = &mut manifest["summary"]["curves"][key];
        *value = if key == "count" { 8.into() } else { (value.as_f64().expect("a number") + 0.01).into() };
        std::fs::write(&path, manifest.to_string()).expect("a writable folder");
        let found = terrace([Path::new("verify"), &out, Path::new("--json")]);
        let proof: Value = serde_json::from_slice(&found.stdout).expect("a proof");
        let rules = proof["rules"].as_array().expect("a list");
        let broken: Vec<&Value> = rules.iter().filter(|r| r["violated"] != 0).map(|r| &r["code"]).collect();
        assert_eq!(broken, [&Value::from("summary")], "{key}");
    }
}

/// Closed squares over an area, each laid on the surface: with a point at every facet edge below its sides.
fn squares_on(surface: &Surface, [x0, y0, x1, y1]: [f64; 4], pitch: f64) -> Vec<Curve> {
    let mut curves = Vec::new();
    let (mut cursor, mut spans) = (Cursor::default(), Vec::new());
    let mut y = y0 + pitch / 2.0;
    while y < y1 {
        let mut x = x0 + pitch / 2.0;
        while x < x1 {
            let side = pitch / 2.0;
            let corners = [[x, y], [x + side, y], [x + side, y + side], [x, y + side], [x, y]];
            let mut curve = Curve::new();
            let mut is_whole = true;
            for w in corners.windows(2) {
                let [a, b] = [w[0], w[1]].map(|p| P2::new((p[0] * 1e6).round() as i64, (p[1] * 1e6).round() as i64));
                surface.walk(a, b, &mut cursor, &mut spans);
                is_whole &= spans.iter().all(|s| s.facet().is_some());
                let at = |t: f64, z: f64| [0, 1].map(|k| w[0][k] + t * (w[1][k] - w[0][k])).map(|v| (v, z));
                curve.extend(spans.iter().map(|s| at(s.t0, s.z0)).map(|[(x, z), (y, _)]| [x, y, z / 1e6]));
            }
            curve.extend(curve.first().copied());
            if is_whole {
                curves.push(curve);
            }
            x += pitch;
        }
        y += pitch;
    }
    curves
}

#[test]
#[ignore = "needs ../shared: make test-all"]
fn curves_on_hood_and_helens_are_marked_by_every_method_and_verify() {
    let dir = folder();
    for (file, area) in
        [("hood_mm_bin.stl", [500.0, -150.0, 800.0, 150.0]), ("helens_relief_small.stl", [20.0, -200.0, 160.0, -60.0])]
    {
        let part = shared().join("surfaces").join(file);
        let surface = Surface::load_mm(&part).expect("a surface");
        let curves = squares_on(&surface, area, 10.0);
        assert!(curves.len() > 150, "{file}: {}", curves.len());
        for method in ["z-range", "window", "tilt"] {
            std::fs::write(dir.path().join("c.csv"), csv(&curves, 1.0)).expect("a writable folder");
            let mut job = JobText::on(&part).texture("curves = \"c.csv\"\nunit = \"mm\"").method(method);
            job.machine = "profile = \"xyz-tilt-galvo-40\"".into();
            job.focus = "pdof = \"0.5 mm\"".into();
            let job = job.write(dir.path(), "job.toml");
            let summary = compile(&job, &dir.path().join("out"));
            let c = &summary["curves"];
            eprintln!("{file} by {method}: {} stops, {c}", summary["stops"]);
            assert_eq!(c["count"], curves.len() as u64);
            // Points on facet edges are rounded to a nanometre in plan.
            assert!(number(c, "worst_distance_um") < 0.02, "{c}");
            verify(&dir.path().join("out"));
        }
        // Lifted by more than a half of pdof they are refused.
        let lifted: Vec<Curve> =
            curves.iter().map(|c| c.iter().map(|&[x, y, z]| [x, y, z + 0.251]).collect()).collect();
        std::fs::write(dir.path().join("c.csv"), csv(&lifted, 1.0)).expect("a writable folder");
        let (code, codes, json) = outcome(&dir.path().join("job.toml"));
        assert_eq!((code, codes), (1, vec!["curve-distance".to_owned()]), "{json}");
    }
}
