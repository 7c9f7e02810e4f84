//! `direction = "contour"`: hatch along the level lines in each section.

use std::collections::HashMap;
use terrace_core::math;

use crate::support::surfaces::{FIVE, Random, mesh, write_stl};
use crate::support::{JobText, ONE_FILE, assert_balance, compile, folder, number, verify};
use terrace_core::geom::{BoxMm, Nm, P2, length_mm};
use terrace_core::program::{PenId, Sections};
use terrace_input::texture::{Area, Directions, Kind, Masks, Request, Texture};

fn hatch(direction: &str, pitch: &str) -> String {
    format!("pattern = \"hatch\"\npitch = \"{pitch}\"\ndirection = \"{direction}\"")
}

#[test]
#[ignore = "slow: make test-all"]
fn contour_hatch_cuts_fragments_to_a_quarter_at_equal_length() {
    contour_hatch_cuts_fragments_to_a_quarter_at_equal_length_at(100, "2 mm");
}

#[test]
#[ignore = "slow: make test-all"]
fn fine_contour_hatch_cuts_fragments_to_a_quarter_at_equal_length() {
    contour_hatch_cuts_fragments_to_a_quarter_at_equal_length_at(500, "0.5 mm");
}

fn contour_hatch_cuts_fragments_to_a_quarter_at_equal_length_at(cells: usize, pitch: &str) {
    for (name, shape) in FIVE {
        let dir = folder();
        let stl = dir.path().join("part.stl");
        write_stl(&stl, &mesh(cells, [0.0, 0.0, 450.0, 450.0], shape));
        let run = |direction: &str| {
            // Slivers are fragments here, too.
            let mut job = JobText::on(&stl).texture(&hatch(direction, pitch)).partition("min_mark = \"0 mm\"");
            job.more = ONE_FILE.into();
            let out = dir.path().join("out.job");
            let summary = compile(&job.write(dir.path(), "job.toml"), &out);
            assert_balance(&summary, &verify(&out));
            assert_eq!(number(&summary, "skipped_mm"), 0.0, "{name}");
            summary
        };
        let (along_x, contour) = (run("0 deg"), run("contour"));
        let ratio = |key: &str| number(&contour, key) / number(&along_x, key);
        let most = match name {
            // Level lines turn within a section.
            "wave" => 0.5,
            _ => 0.25,
        };
        assert!(ratio("fragments") <= most, "{name}: {}", ratio("fragments"));
        assert!((ratio("mark_mm") - 1.0).abs() <= 0.01, "{name}: {}", ratio("mark_mm"));
    }
}

/// Strokes of an area that is filled in sections of `side_mm`, and the sections.
fn filled(
    area: BoxMm<2>,
    pitch_mm: f64,
    turn_deg: f64,
    side_mm: i64,
    mut direction: impl FnMut() -> u16,
) -> (Vec<[P2; 2]>, Sections) {
    let kind = Kind::Contour { pitch_mm, phase: 0.0 };
    let request =
        Request { kind, area: Area::Rectangle(area), tolerance_mm: 1e-3, pen: PenId(0), masks: Masks::default() };
    let mut texture = Texture::load(&[request], area, turn_deg.to_radians(), 0.05, &mut Vec::new()).expect("an area");
    assert_eq!(texture.len(), 0, "an area holds no line until it is filled");
    let side = Nm(side_mm * 1_000_000);
    let grid = Sections::over(texture.bounds(), [side, side], Nm(100), [Nm(0); 2]);
    let hundredths = (0..grid.len()).map(|_| direction()).collect();
    texture.fill(Directions { grid, hundredths }).expect("lines");
    let bounds = texture.bounds();
    let mut points = Vec::new();
    let strokes = (0..texture.len()).map(|i| {
        texture.stroke(i, &mut points);
        assert!(points.len() == 2 && points.iter().all(|&p| bounds.holds(p)), "{points:?}");
        [points[0], points[1]]
    });
    (strokes.collect(), grid)
}

/// Distance of a point from a segment, mm.
fn distance(p: [f64; 2], [a, b]: [[f64; 2]; 2]) -> f64 {
    let (d, r) = ([b[0] - a[0], b[1] - a[1]], [p[0] - a[0], p[1] - a[1]]);
    let t = ((r[0] * d[0] + r[1] * d[1]) / (d[0] * d[0] + d[1] * d[1])).clamp(0.0, 1.0);
    math::hypot(r[0] - t * d[0], r[1] - t * d[1])
}

#[test]
fn hatch_lines_at_section_borders_are_marked_exactly_once() {
    let mut noise = Random::new(11);
    for round in 0..6 {
        let area = BoxMm::rectangle(-3.5, 12.25, 56.5, 63.0);
        let pitch = [0.5, 0.7, 0.31][round % 3];
        // Every direction; the axes, along which lines may lie on borders, more often.
        let mut directions = Vec::new();
        let (strokes, grid) = filled(area, pitch, 0.0, 15, || {
            let any = (noise.bits() % 18_000) as u16;
            directions.push(if any.is_multiple_of(4) { 9000 * (any / 4 % 2) } else { any });
            directions[directions.len() - 1]
        });
        let mut by_section = vec![Vec::new(); grid.len()];
        for &[a, b] in &strokes {
            let i = (0..grid.len()).filter(|&i| grid.area(i).holds(a) && grid.area(i).holds(b)).collect::<Vec<_>>();
            // On a border it is the upper section's.
            let &i = i.last().expect("no line leaves its section");
            by_section[i].push([a.mm(), b.mm()]);
        }
        // Places all over the area and as many next to borders: no mark is farther than a pitch.
        for _ in 0..20_000 {
            let mut p = [0, 1].map(|k| area.lo[k] + (noise.half() + 0.5) * (area.hi[k] - area.lo[k]));
            if noise.bits().is_multiple_of(2) {
                let border = [grid.line(0, 1), grid.line(0, 2), grid.line(0, 3)][(noise.bits() % 3) as usize];
                p[0] = border as f64 / 1e6 + noise.half() * pitch;
            }
            let nm = <P2>::from_mm(p[0], p[1]).expect("near");
            let i = (grid.along(1, nm.y, 0) * i64::from(grid.count[0]) + grid.along(0, nm.x, 0)) as usize;
            let nearest = by_section[i].iter().map(|&s| distance(p, s)).fold(f64::INFINITY, f64::min);
            assert!(nearest <= pitch + 1e-5, "{p:?} in section {i} is {nearest} mm from the next mark");
        }
        // In a section lines are a pitch apart, and come to its area.
        for (i, lines) in by_section.iter().enumerate() {
            let [c, s] = Directions::cos_sin(directions[i]);
            let mut across: Vec<f64> = lines.iter().map(|[a, _]| c * a[1] - s * a[0]).collect();
            across.sort_by(f64::total_cmp);
            assert!(across.windows(2).all(|w| (w[1] - w[0] - pitch).abs() < 4e-6), "section {i}");
        }
        let length: f64 = strokes.iter().map(|s| length_mm(s)).sum();
        let [width, height] = area.size();
        let plain = width * height / pitch;
        assert!((length / plain - 1.0).abs() < 0.01, "{length} {plain}");
    }
}

#[test]
fn neighbouring_sections_of_one_direction_share_hatch_lines() {
    for (hundredths, turn) in [(0, 0.0), (9000, 0.0), (3712, 0.0), (12_999, 0.0), (3712, 33.0), (9000, 90.0)] {
        // 10 mm are 12.5 pitches: lines along an axis lie on every other border.
        let area = BoxMm::rectangle(0.0, 0.0, 50.0, 40.0);
        let (strokes, grid) = filled(area, 0.8, turn, 10, || hundredths);
        let (whole, _) = filled(area, 0.8, turn, 100, || hundredths);
        let length = |strokes: &[[P2; 2]]| strokes.iter().map(|s| length_mm(s)).sum::<f64>();
        let (a, b) = (length(&strokes), length(&whole));
        assert!((a - b).abs() < 0.1, "{hundredths} {turn}: {a} in sections, {b} as a whole");
        // Every end is the begin of the next line, or that of a whole line.
        let mut ends: HashMap<P2, i32> = HashMap::new();
        for &[a, b] in &strokes {
            *ends.entry(a).or_default() += 1;
            *ends.entry(b).or_default() -= 1;
        }
        for &[a, b] in &whole {
            *ends.entry(a).or_default() -= 1;
            *ends.entry(b).or_default() += 1;
        }
        let open = ends.iter().filter(|e| *e.1 != 0).map(|e| e.0);
        // Beside crossings of borders lines may be too short to be marked.
        let crossing = |p: &P2| {
            let off = |axis: usize, v: i64| {
                let from = Nm(v - grid.line(axis, 0)).rem_euclid(grid.pitch[axis]);
                from.min(grid.pitch[axis] - from) < Nm(10)
            };
            off(0, p.x) && off(1, p.y)
        };
        assert_eq!(open.filter(|p| !crossing(p)).count(), 0, "{hundredths} {turn}");
    }
}

/// A part that falls from a ridge, 90 x 70 mm.
fn ridge(x: f64, y: f64) -> f64 {
    0.03 * (x - 40.0).abs() + 0.02 * y + 0.2 * math::sin(y / 11.0)
}

#[test]
#[ignore = "slow: make test-all"]
fn every_method_and_placement_marks_the_same_lines() {
    let dir = folder();
    let stl = dir.path().join("ridge.stl");
    write_stl(&stl, &mesh(90, [0.0, 0.0, 90.0, 70.0], ridge));
    let area = "area = [\"11 mm\", \"-7 mm\", \"64.3 mm\", \"33 mm\"]";
    for (turn, method) in [(0, "contour"), (90, "z-range"), (33, "window"), (-12, "auto")] {
        let mut job = JobText::on(&stl)
            .texture(&hatch("contour", "0.7 mm"))
            .texture(&format!("{}\n{area}", hatch("contour", "1.1 mm")))
            .texture("pattern = \"squares\"\npitch = \"5 mm\"\ncell = \"3 mm\"")
            .method(method);
        job.more = format!("[placement]\nturn = \"{turn} deg\"\n\n[limits]\nmax_off_part = \"20 %\"\n");
        let job = job.write(dir.path(), "job.toml");
        let out = dir.path().join("out.job");
        let summary = compile(&job, &out);
        let proof = verify(&out);
        assert_balance(&summary, &proof);
        let checked = proof["rules"].as_array().expect("rules").iter().find(|r| r["code"] == "fill");
        assert!(checked.expect("fill")["checked"].as_u64() > Some(100));
        let want = 90.0 * 70.0 / 0.7 + 53.3 * 40.0 / 1.1 + 18.0 * 14.0 * 12.0;
        assert!((number(&summary, "texture_mm") / want - 1.0).abs() < 0.01, "{turn}: {}", summary["texture_mm"]);
        assert!(number(&summary, "skipped_off_part_mm") > 300.0, "the second area reaches beyond the part");
    }
}

#[test]
#[ignore = "slow: make test-all"]
fn areas_of_drawings_follow_the_level_lines_with_every_method() {
    let dir = folder();
    let stl = dir.path().join("ridge.stl");
    write_stl(&stl, &mesh(90, [0.0, 0.0, 90.0, 70.0], ridge));
    let drawing = r#"<svg xmlns="http://www.w3.org/2000/svg" width="60mm" height="50mm" viewBox="0 0 60 50">
        <path fill-rule="evenodd" fill="red" d="M5 5h40v40h-40zM15 15h20v20h-20z"/>
        <path d="M48 5C70 20 40 30 52 45" stroke="blue" stroke-width="4" fill="none"/>
        <path d="M1 1h58" stroke="black" stroke-width="0.01"/></svg>"#;
    std::fs::write(dir.path().join("areas.svg"), drawing).expect("written");
    let deep = "[[pen]]\nname = \"deep\"\nspeed = \"100 mm/s\"\npower = \"9 %\"\nfrequency = \"60 kHz\"\n";
    for (turn, method, keys) in [
        (0, "contour", ""),
        (90, "z-range", "cross = true"),
        (33, "window", "contour = \"after\"\nmirror = \"x\""),
        (-12, "auto", "turn = \"20 deg\"\none_way = true"),
    ] {
        let texture = |keys: &str| {
            format!(
                "file = \"areas.svg\"\npitch = \"0.5 mm\"\norigin = [\"20 mm\", \"5 mm\"]\npens = {{ red = \"deep\" }}\n{keys}"
            )
        };
        let compiled = |keys: &str| {
            let mut job = JobText::on(&stl).texture(&texture(keys)).method(method).partition("min_mark = \"0 mm\"");
            job.more = format!("[placement]\nturn = \"{turn} deg\"\n[passes]\ncount = 2\nlower = \"0.01 mm\"\n{deep}");
            let out = dir.path().join("out.job");
            let summary = compile(&job.write(dir.path(), "job.toml"), &out);
            let proof = verify(&out);
            assert_balance(&summary, &proof);
            let rules = proof["rules"].as_array().expect("rules");
            let checked = |code: &str| rules.iter().find(|r| r["code"] == code).expect("a rule")["checked"].as_u64();
            assert!(checked("drawing") > Some(200));
            (summary, checked("fill"))
        };
        let ((plain, none), (contour, lines)) = (compiled(keys), compiled(&format!("{keys}\ndirection = \"contour\"")));
        assert!(none == Some(0) && lines > Some(200), "{none:?} {lines:?}");
        let ratio = |key: &str| number(&contour, key) / number(&plain, key);
        assert!((ratio("texture_mm") - 1.0).abs() < 0.03, "{method}: {}", ratio("texture_mm"));
        assert!(ratio("fragments") < 1.3, "{method}: {}", ratio("fragments"));
    }
}

/// The directions that a job on a surface comes to, degrees.
fn directions(shape: impl Fn(f64, f64) -> f64, turn: u32) -> Vec<f64> {
    let dir = folder();
    let stl = dir.path().join("part.stl");
    write_stl(&stl, &mesh(40, [0.0, 0.0, 80.0, 80.0], shape));
    let mut job = JobText::on(&stl).texture(&hatch("contour", "1 mm"));
    job.more = format!("[placement]\nturn = \"{turn} deg\"\n");
    let out = dir.path().join("out.job");
    compile(&job.write(dir.path(), "job.toml"), &out);
    let text = std::fs::read(out.join("manifest.json")).expect("a manifest");
    let manifest: serde_json::Value = serde_json::from_slice(&text).expect("JSON");
    let list = manifest["passes"][0]["sections"]["direction_deg"].as_array().expect("directions").clone();
    list.iter().map(|v| v.as_f64().expect("a number")).collect()
}

#[test]
#[ignore = "slow: make test-all"]
fn lines_run_along_level_lines() {
    // Planes: level lines are straight, and turn with the part.
    for (slope, want) in [([0.0, 0.0], 0.0), ([0.05, 0.0], 90.0), ([0.0, 0.05], 0.0), ([0.03, 0.03], 135.0)] {
        let found = directions(|x, y| slope[0] * x + slope[1] * y, 0);
        assert_eq!(found.len(), 4);
        assert!(found.iter().all(|d| (d - want).abs() <= 0.01), "{slope:?}: {found:?}");
    }
    let turned = directions(|x, y| 0.05 * x + 0.0 * y, 33);
    assert!(turned.iter().all(|d| (d - 123.0).abs() <= 0.01), "{turned:?}");
    // A cone about the corner of four sections: level lines lie across its rays.
    let cone = directions(|x, y| 0.1 * math::hypot(x - 40.0, y - 40.0), 0);
    for (d, want) in cone.iter().zip([135.0, 45.0, 45.0, 135.0]) {
        assert!((d - want).abs() < 3.0, "{cone:?}");
    }
    // What is too low to reach a level does not turn the lines.
    assert_eq!(directions(|x, y| 1e-5 * (x + 2.0 * y), 0), [0.0; 4]);
}
