//! A drawing of six layers with six pens, its areas hatched: damaged lines and exchanged pens.

use super::super::{assert_only, broken};
use super::{Bench, double, long_stroke_of, remove, verified};
use terrace_core::math;
use terrace_core::program::{PenId, Program};

/// Names and colours of the layers; the pen of layer k is pen k + 1.
const LAYERS: [(&str, &str); 6] = [
    ("Grain", "#ff0000"),
    ("Logo", "#00aa00"),
    ("Rim", "#0000ff"),
    ("Mesh", "#ff00ff"),
    ("Text", "#808000"),
    ("Marks", "#000000"),
];

/// Beside the hatch of the sheet a drawing with an Inkscape layer of each colour: a square with a hole and a line.
fn layered(keys: &str) -> Bench {
    layered_by(keys, false)
}

/// The same with the pens by colour, or by layer in a drawing of one colour.
fn layered_by(keys: &str, by_layer: bool) -> Bench {
    let layer = |(k, (name, colour)): (usize, &(&str, &str))| {
        let (x, y) = (3 + 19 * (k % 3), 3 + 20 * (k / 3));
        let colour = if by_layer { &"#ff0000" } else { colour };
        format!(
            "<g inkscape:groupmode=\"layer\" inkscape:label=\"{name}\" fill=\"{colour}\" stroke=\"{colour}\">\
             <path stroke=\"none\" fill-rule=\"evenodd\" d=\"M{x} {y}h14v14h-14zm5 5v4h4v-4z\"/>\
             <path fill=\"none\" stroke-width=\"0.01\" d=\"M{x} {}h14\"/></g>",
            y + 15
        )
    };
    let body: String = LAYERS.iter().enumerate().map(layer).collect();
    let drawing = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" xmlns:inkscape=\"http://www.inkscape.org/namespaces/inkscape\" \
         width=\"60mm\" height=\"42mm\" viewBox=\"0 0 60 42\">{body}</svg>"
    );
    let names = ["deep", "c", "d", "e", "f", "g"];
    let selector =
        |(name, colour): &(&str, &str)| if by_layer { format!("layer:{name}") } else { (*colour).to_owned() };
    let pens: Vec<String> = LAYERS.iter().zip(names).map(|(l, pen)| format!("{:?} = {pen:?}", selector(l))).collect();
    let texture = format!(
        "file = \"layers.svg\"\norigin = [\"0 mm\", \"0 mm\"]\npitch = \"0.8 mm\"\npens = {{ {} }}\n{keys}",
        pens.join(", ")
    );
    let more: String = names[1..]
        .iter()
        .map(|n| format!("[[pen]]\nname = {n:?}\nspeed = \"300 mm/s\"\npower = \"7 W\"\nfrequency = \"40 kHz\"\n"))
        .collect();
    Bench::edited_beside(1.0, &[("layers.svg", drawing.into_bytes())], |text| {
        let start = text.find("pattern = \"squares\"").expect("squares");
        let end = start + text[start..].find("[[pen]]").expect("pens");
        format!("{}{texture}\n{}{more}", &text[..start], &text[end..])
    })
}

/// A long line of the drawing that no stop cuts.
fn line(program: &Program) -> usize {
    let pieces = |source| program.strokes.iter().filter(|s| s.source == source).count();
    long_stroke_of(program, |s| s.len == 2 && s.pen != PenId(0) && pieces(s.source) == 1)
}

#[test]
fn every_layer_has_the_pen_of_its_colour() {
    for keys in ["", "direction = \"contour\"", "mirror = \"y\"\nfill = \"rings\""] {
        let bench = layered(keys);
        let program = bench.plan.checked.program();
        let used: std::collections::BTreeSet<u16> = program.strokes.iter().map(|s| s.pen.0).collect();
        assert_eq!(used, (0..7).collect(), "{keys}");
        // Where a stroke lies says which layer it is of.
        for block in &program.blocks {
            for s in program.strokes_of(block).iter().filter(|s| s.pen != PenId(0)) {
                let p = program.points_of(s)[0];
                let at = [block.stop.centre.x + i64::from(p.x), block.stop.centre.y + i64::from(p.y)];
                let [column, row] = [at[0] as f64 / 19e6, at[1] as f64 / 21e6].map(|v| v as u16);
                let row = if keys.contains("mirror") { row } else { 1 - row };
                assert_eq!(s.pen.0, 1 + column + 3 * row, "{keys}: {at:?}");
            }
        }
        let target = bench.write();
        let proof = verified(&target);
        assert!(proof.ok, "{}", proof.to_text());
        assert!(proof.rules.iter().find(|r| r.code == "drawing").is_some_and(|r| r.checked > 100));
        // In the DXF of every block each pen has its layer and colour.
        for (i, block) in program.blocks.iter().enumerate() {
            let find = |folder: &std::path::Path| -> Option<std::path::PathBuf> {
                let name = format!("{}.dxf", terrace_core::program::BlockId(i as u32));
                let mut folders = vec![folder.to_owned()];
                while let Some(folder) = folders.pop() {
                    for entry in std::fs::read_dir(folder).expect("a folder") {
                        let path = entry.expect("an entry").path();
                        match path.is_dir() {
                            true => folders.push(path),
                            false if path.file_name().is_some_and(|n| *n == *name) => return Some(path),
                            false => {}
                        }
                    }
                }
                None
            };
            let text = std::fs::read_to_string(find(&target).expect("a DXF file")).expect("readable");
            for pen in 0..7 {
                let layer = format!("_P{}", pen + 1);
                let is_used = program.strokes_of(block).iter().any(|s| s.pen == PenId(pen));
                assert_eq!(text.lines().any(|l| l.ends_with(&layer)), is_used, "block {i}, pen {pen}");
            }
        }
    }
}

#[test]
fn damaged_hatch_lines_are_reported_by_their_rules() {
    /// Moves an end of a line along it (0) or across it (1), nm.
    fn shifted(program: &mut Program, ends: &[usize], axis: usize, by: f64) {
        let s = program.strokes[line(program)];
        let [a, b] = [program.points[s.first as usize], program.points[s.first as usize + 1]];
        let d = [f64::from(b.x - a.x), f64::from(b.y - a.y)];
        let length = math::hypot(d[0], d[1]);
        let step = if axis == 0 { d } else { [-d[1], d[0]] }.map(|v| (v / length * by).round() as i32);
        for &end in ends {
            let p = &mut program.points[s.first as usize + end];
            (p.x, p.y) = (p.x + step[0], p.y + step[1]);
        }
    }
    for keys in ["", "direction = \"contour\"", "cross = true\ncontour = \"after\""] {
        // A mark that is not what it claims to be covers nothing either.
        for (ends, axis) in [(&[1][..], 0), (&[0, 1], 1)] {
            let proof = layered(keys).mutant(|program, _| shifted(program, ends, axis, 60_000.0));
            assert_eq!(broken(&proof), ["source", "coverage"], "{}", proof.to_text());
        }
        assert_only("coverage", &layered(keys).mutant(|program, _| remove(program, line(program))));
        assert_only("once", &layered(keys).mutant(|program, _| double(program, line(program))));
    }
}

#[test]
fn exchanged_pens_are_reported() {
    // In all files alike.
    for by_layer in [false, true] {
        let proof = layered_by("", by_layer).mutant(|program, _| {
            for s in &mut program.strokes {
                s.pen = match s.pen {
                    PenId(2) => PenId(3),
                    PenId(3) => PenId(2),
                    pen => pen,
                };
            }
        });
        assert_only("source", &proof);
        assert!(proof.rule("drawing").is_some_and(|r| r.checked > 100 && r.left_out.is_empty()), "{}", proof.to_text());
    }
}

/// Squares and a hatch in the area of a drawing.
fn masked(keys: &str) -> Bench {
    let mask = b"<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"50mm\" height=\"36mm\" viewBox=\"0 0 50 36\">\
        <ellipse id=\"rim\" cx=\"25\" cy=\"18\" rx=\"24\" ry=\"17\"/></svg>";
    Bench::edited_beside(1.0, &[("mask.svg", mask.to_vec())], |text| {
        let mask = format!("inside = {{ file = \"mask.svg#rim\", align = \"centre\" }}\n{keys}");
        let text = text.replacen("area = [\"-3 mm\"", &format!("{mask}\narea = [\"-3 mm\""), 1);
        text.replacen("cell = \"2 mm\"", "cell = \"2 mm\"\noutside = \"mask.svg\"", 1)
    })
}

#[test]
#[ignore = "slow: make test-all"]
fn damaged_strokes_in_a_mask_are_reported_by_their_rules() {
    for keys in ["", "soft = \"3 mm\""] {
        let proof = verified(&masked(keys).write());
        assert!(proof.ok, "{}", proof.to_text());
        assert!(proof.rule("mask").is_some_and(|r| r.checked > 1000 && r.left_out.is_empty()), "{}", proof.to_text());
        assert_only("coverage", &masked(keys).mutant(|program, _| remove(program, long_stroke_of(program, |_| true))));
        // Longer than the border leaves it: it claims a piece that ends before.
        let proof = masked(keys).mutant(|program, _| {
            let pieces = |source| program.strokes.iter().filter(|s| s.source == source).count();
            let s = program.strokes[long_stroke_of(program, |s| pieces(s.source) == 1)];
            let last = (s.first + s.len - 1) as usize;
            let [a, b] = [program.points[last - 1], program.points[last]];
            let length = math::hypot(f64::from(b.x - a.x), f64::from(b.y - a.y));
            let end = &mut program.points[last];
            let by = |d: i32| (f64::from(d) / length * 5_000.0).round() as i32;
            (end.x, end.y) = (end.x + by(b.x - a.x), end.y + by(b.y - a.y));
        });
        assert_only("source", &proof);
    }
}
