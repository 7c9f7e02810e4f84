//! The picture of a job: text that can be read, marks that show what is marked, red where nothing is.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use terrace_core::math;

use resvg::tiny_skia::{Pixmap, Transform};
use resvg::usvg::{Group, Node, Options, Tree, fontdb};

use crate::support::surfaces::{mesh, write_stl};
use crate::support::{JobText, fixture, folder, said, terrace};

/// The picture of a job.
fn picture(job: &Path, mode: &[&str]) -> String {
    let args = [&["preview", job.to_str().expect("UTF-8"), "-o", "-", "--quiet"], mode].concat();
    let out = terrace(args);
    assert!(out.status.success(), "{}", said(&out));
    String::from_utf8(out.stdout).expect("UTF-8")
}

fn tree(svg: &str) -> Tree {
    let mut fonts = fontdb::Database::new();
    for face in [dejavu::sans::regular(), dejavu::sans::bold()] {
        fonts.load_font_source(fontdb::Source::Binary(Arc::new(face)));
    }
    Tree::from_str(svg, &Options { fontdb: Arc::new(fonts), ..Options::default() }).expect("a drawing")
}

/// A text of a picture.
struct Text {
    words: String,
    is_number: bool,
    /// In units of the drawing from its upper left corner.
    area: [f64; 4],
    size: f64,
}

fn texts(group: &Group, in_numbers: bool, out: &mut Vec<Text>) {
    for node in group.children() {
        match node {
            Node::Group(inner) => texts(inner, in_numbers || inner.id() == "layer-numbers", out),
            Node::Text(text) => {
                // That of its glyphs, not of its line.
                let b = text.flattened().abs_bounding_box();
                let spans = text.chunks().iter().flat_map(|chunk| chunk.spans());
                let size = spans.map(|span| f64::from(span.font_size().get())).fold(f64::INFINITY, f64::min);
                let words = text.chunks().iter().map(|chunk| chunk.text()).collect();
                let area = [b.left(), b.top(), b.right(), b.bottom()].map(f64::from);
                out.push(Text { words, is_number: in_numbers, area, size });
            }
            _ => {}
        }
    }
}

/// What of the text must hold on every picture, at 480 and at 1600 px.
fn check_texts(name: &str, svg: &str) {
    let tree = tree(svg);
    let [width, height] = [tree.size().width(), tree.size().height()].map(f64::from);
    let mut all = Vec::new();
    texts(tree.root(), false, &mut all);
    assert!(all.iter().filter(|t| !t.is_number).count() > 20, "{name}: the legend is there");
    for px in [480.0, 1600.0] {
        for t in &all {
            let Text { words, area, size, .. } = t;
            assert!(size * px / width >= 7.0, "{name}: {words:?} is {} px high", size * px / width);
            let inside = area[0] >= 0.0 && area[1] >= 0.0 && area[2] <= width && area[3] <= height;
            assert!(inside, "{name}: {words:?} at {area:?} of {width} x {height}");
        }
    }
    let (numbers, labels): (Vec<&Text>, Vec<&Text>) = all.iter().partition(|t| t.is_number);
    let apart = |a: &Text, b: &Text| (0..2).any(|k| a.area[k] >= b.area[k + 2] || b.area[k] >= a.area[k + 2]);
    for (i, number) in numbers.iter().enumerate() {
        for label in labels.iter().chain(&numbers[..i]).filter(|_| !number.words.is_empty()) {
            // Boxes of turned numbers are larger than the numbers: only level ones are held against each other.
            let both_level = |t: &Text| t.area[3] - t.area[1] < 0.85 * t.size;
            let counts = !label.is_number || (both_level(number) && both_level(label));
            assert!(!counts || apart(number, label), "{name}: {:?} lies over {:?}", number.words, label.words);
        }
    }
}

/// The picture, so many px wide.
fn rendered(svg: &str, px: u32) -> Pixmap {
    let tree = tree(svg);
    let scale = px as f32 / tree.size().width();
    let mut pixels = Pixmap::new(px, (tree.size().height() * scale).ceil() as u32).expect("a size");
    resvg::render(&tree, Transform::from_scale(scale, scale), &mut pixels.as_mut());
    pixels
}

/// The picture with one of its layers alone.
fn layer(svg: &str, id: &str) -> String {
    let document = roxmltree::Document::parse(svg).expect("well-formed");
    let ids = document.root_element().children().filter_map(|n| n.attribute("id"));
    let others: Vec<String> = ids.filter(|other| *other != id).map(|other| format!("#{other}")).collect();
    assert!(!others.is_empty() && svg.contains(&format!("id=\"{id}\"")), "{id}");
    svg.replacen("<style>", &format!("<style>{}{{display:none}}", others.join(",")), 1)
}

/// The pixels of a layer that are inked.
fn inked(svg: &str, id: &str, px: u32) -> BTreeSet<usize> {
    let pixels = rendered(&layer(svg, id), px);
    pixels.pixels().iter().enumerate().filter(|(_, p)| p.alpha() > 40).map(|(i, _)| i).collect()
}

/// A gentle dome of a size, mm.
fn dome(dir: &Path, [w, h]: [f64; 2], rise: f64) -> PathBuf {
    let path = dir.join("dome.stl");
    let z = move |x: f64, y: f64| rise * (1.0 - (2.0 * x / w - 1.0).powi(2) - (2.0 * y / h - 1.0).powi(2));
    write_stl(&path, &mesh(40, [0.0, 0.0, w, h], z));
    path
}

#[test]
#[ignore = "slow: make test-all"]
fn text_of_five_jobs_can_be_read_at_480_px_and_at_1600() {
    let dir = folder();
    let init = terrace(["init", dir.path().join("try").to_str().expect("UTF-8")]);
    assert!(init.status.success(), "{}", said(&init));
    let sample = dir.path().join("try/job.toml");
    let job = |size: [f64; 2], rise: f64, keys: &str, more: &str, name: &str| {
        let mut job = JobText::on(&dome(dir.path(), size, rise)).texture(keys).method("z-range");
        job.more = more.into();
        if size[0] > 500.0 {
            job.machine = "profile = \"xyz-galvo-100\"".into();
        }
        job.focus = format!("pdof = \"{} mm\"", rise / 12.0);
        job.write(dir.path(), name)
    };
    // As the hood: a patch with many blocks in free windows.
    let patch = job([250.0, 250.0], 9.0, "pattern = \"hatch\"\npitch = \"5 mm\"", "", "patch.toml");
    let patch = (picture(&patch, &[]), "a patch of 250 mm");
    let panel = job([560.0, 300.0], 9.0, "pattern = \"circles\"\ncell = \"4 mm\"\npitch = \"12 mm\"", "", "panel.toml");
    let panel = (picture(&panel, &[]), "a panel of 560 mm");
    let points: Vec<String> =
        (0..14).map(|k| format!("[\"{} mm\", \"{} mm\"]", 20 + 97 * k, 20 + k % 2 * 300)).collect();
    let setups = format!("[setups]\nregistration = [{}]\n", points.join(", "));
    let long = job([1300.0, 400.0], 6.0, "pattern = \"hatch\"\npitch = \"20 mm\"", &setups, "long.toml");
    let long = (picture(&long, &[]), "1.3 m in set-ups");
    assert!(long.0.contains(">set-up 2<"), "each set-up has its name");
    let tilted = std::fs::read_to_string(fixture("method.toml")).expect("a job").replace("\"contour\"", "\"tilt\"");
    let tilted = tilted.replace("hood.stl", fixture("hood.stl").to_str().expect("UTF-8"));
    std::fs::write(dir.path().join("tilt.toml"), tilted).expect("written");
    let tilt = (picture(&dir.path().join("tilt.toml"), &[]), "tilted stops");
    let fly = (picture(&sample, &["--mode", "on-the-fly"]), "on the fly");
    for (svg, name) in [(picture(&sample, &[]), "the sample"), patch, panel, long, tilt, fly] {
        check_texts(name, &svg);
        assert!(svg.len() < 5_000_000 && !svg.contains(" width=\"100%\""), "{name}");
    }
}

/// The letter F in a square of 40 mm.
const LETTER: &str = "<path d=\"M10 5H32V11H17V18H28V24H17V35H10Z\"";

#[test]
fn a_mirrored_and_an_outlined_texture_are_told_from_the_right_one() {
    let dir = folder();
    let surface = dome(dir.path(), [40.0, 40.0], 1.0);
    let made = |name: &str, path: &str, keys: &str| {
        let svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"40mm\" height=\"40mm\" viewBox=\"0 0 40 40\">{path}/></svg>"
        );
        std::fs::write(dir.path().join(format!("{name}.svg")), svg).expect("written");
        let keys = format!("file = \"{name}.svg\"\norigin = [\"0 mm\", \"0 mm\"]\n{keys}");
        picture(&JobText::on(&surface).texture(&keys).write(dir.path(), &format!("{name}.toml")), &[])
    };
    let filled = "fill = \"hatch\"\npitch = \"0.2 mm\"";
    let right = made("right", LETTER, filled);
    let mirrored = made("mirrored", &format!("{LETTER} transform=\"matrix(-1 0 0 1 40 0)\""), filled);
    let outlined = made("outlined", LETTER, "fill = \"outline\"");
    for px in [480, 1600] {
        let of = |svg: &str| inked(svg, "layer-texture-marks", px);
        let want = of(&right);
        assert_eq!(want, of(&made("again", LETTER, filled)), "the same texture looks the same");
        for (name, other) in [("mirrored", of(&mirrored)), ("outlined", of(&outlined))] {
            let differ = want.symmetric_difference(&other).count() as f64 / want.union(&other).count() as f64;
            assert!(differ > 0.2, "{name} at {px} px: {:.0} % of the inked pixels differ", 100.0 * differ);
        }
    }
}

/// 100 x 70 mm: a hole of 24 mm around 30, 35, and a flank of 68 degrees from x = 70 to 80; a hatch reaches 10 mm over
/// the lower edge.
fn held(dir: &Path) -> PathBuf {
    let z = |x: f64, y: f64| (2.5 * (x - 70.0)).clamp(0.0, 25.0) + 0.01 * y;
    let (nx, ny) = (100, 70);
    let mut facets = Vec::new();
    for j in 0..ny {
        for i in 0..nx {
            let at = |i: i32, j: i32| [f64::from(i), f64::from(j), z(f64::from(i), f64::from(j))];
            let (x, y) = (f64::from(i) + 0.5, f64::from(j) + 0.5);
            if math::hypot(x - 30.0, y - 35.0) >= 12.0 {
                let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
                facets.extend([[a, b, c], [a, c, d]]);
            }
        }
    }
    let path = dir.join("held.stl");
    write_stl(&path, &facets);
    let keys = "pattern = \"hatch\"\npitch = \"1 mm\"\narea = [\"10 mm\", \"-10 mm\", \"95 mm\", \"60 mm\"]";
    let mut job = JobText::on(&path).texture(keys);
    job.focus = "pdof = \"0.5 mm\"".into();
    job.more = "[limits]\nmax_incidence = \"45 deg\"\nmax_off_part = \"50 %\"\n".into();
    job.write(dir, "held.toml")
}

#[test]
fn what_is_not_marked_is_red_with_its_share_and_its_place() {
    assert_unmarked_is_red("stepped", 3);
}

#[test]
#[ignore = "slow"]
fn what_is_not_marked_on_the_fly_is_red_with_its_share_and_its_place() {
    assert_unmarked_is_red("on-the-fly", 3);
}

/// The picture of a part with a hole, a flank and texture over its edge, in one of the modes.
fn assert_unmarked_is_red(mode: &str, reasons: usize) {
    let dir = folder();
    let job = held(dir.path());
    let svg = picture(&job, &["--mode", mode]);
    let tree = tree(&svg);
    let mut all = Vec::new();
    texts(tree.root(), false, &mut all);
    let words: Vec<&str> = all.iter().map(|t| t.words.as_str()).collect();
    let printed = words.join(" | ");
    // 6,035 mm of texture: 71 lines of 85 mm.
    for (reason, share, x) in
        [("off the part", 14.0, "x 10 to 95"), ("over a hole", 7.4, "x 18 to 42"), ("too steep", 10.1, "x 70 to 80")]
    {
        let at = words.iter().position(|w| *w == reason).unwrap_or_else(|| panic!("{mode}: {reason} in {printed}"));
        let of: String = words[at + 1..(at + 4).min(words.len())].join(" ");
        let stated = of.split('%').next().and_then(|w| w.trim().rsplit(' ').next()?.parse::<f64>().ok());
        assert!(stated.is_some_and(|v| (v - share).abs() < 0.5), "{mode}, {reason}: {of}");
        assert!(of.contains(x), "{mode}, {reason}: {of}");
    }
    let ids = ["unmarked-off-part-1", "unmarked-hole-1", "unmarked-steep-1"];
    assert_eq!(ids.iter().filter(|id| tree.node_by_id(id).is_some()).count(), reasons, "{mode}");
    let view: Vec<f64> = svg
        .split("viewBox=\"")
        .nth(1)
        .and_then(|v| v.split('"').next())
        .expect("a view")
        .split(' ')
        .map(|v| v.parse().expect("a number"))
        .collect();
    for px in [480, 1600] {
        let pixels = rendered(&svg, px);
        let scale = f64::from(px) / view[2];
        let red = |x: [f64; 2], y: [f64; 2]| {
            let [x0, x1] = x.map(|x| ((x - view[0]) * scale) as u32);
            let [y1, y0] = y.map(|y| ((-y - view[1]) * scale) as u32);
            let all = (y0..y1).flat_map(|y| (x0..x1).map(move |x| (x, y)));
            // The stage path is redder in blue, the frame of the field in green.
            let is_red = |(x, y): (u32, u32)| {
                let p = pixels.pixel(x, y).map_or([255; 3], |p| [p.red(), p.green(), p.blue()]);
                p[0] > p[1].saturating_add(100) && p[1].abs_diff(p[2]) < 30
            };
            let count = all.clone().count();
            all.filter(|&at| is_red(at)).count() as f64 / count as f64
        };
        let marked = red([84.0, 92.0], [5.0, 12.0]);
        assert!(marked < 0.02, "{mode}, {px} px: {marked} of what is marked is red");
        for (name, x, y) in [
            ("hole", [24.0, 36.0], [28.0, 34.0]),
            ("flank", [71.0, 79.0], [2.0, 12.0]),
            ("edge", [20.0, 60.0], [-9.0, -1.0]),
        ] {
            assert!(red(x, y) > 0.1, "{mode}, {px} px: {name} is red: {}", red(x, y));
        }
    }
}

#[test]
#[ignore = "slow: make test-all"]
fn a_preview_is_written_as_its_name_says_and_is_the_same_each_time() {
    let dir = folder();
    let surface = dome(dir.path(), [3.0, 2.0], 0.05);
    let mut job = JobText::on(&surface).texture("pattern = \"hatch\"\npitch = \"1 mm\"");
    job.focus = "pdof = \"1 mm\"".into();
    let job = job.write(dir.path(), "job.toml");
    let run = |name: &str, more: &[&str]| {
        let file = dir.path().join(name);
        let args = [&["preview", job.to_str().expect("UTF-8"), "-o", file.to_str().expect("UTF-8")], more].concat();
        (terrace(args), file)
    };
    for (name, begin) in
        [("a.svg", &b"<?xml"[..]), ("a.PNG", b"\x89PNG\r\n"), ("a.pdf", b"%PDF-"), ("a.html", b"<!doctype html>")]
    {
        for mode in ["stepped", "on-the-fly"] {
            let (out, file) = run(name, &["--mode", mode]);
            assert!(out.status.success(), "{}", said(&out));
            let bytes = std::fs::read(&file).expect("written");
            assert!(bytes.starts_with(begin), "{name}");
            let (out, file) = run(name, &["--mode", mode, "-j", "1"]);
            assert!(out.status.success() && std::fs::read(&file).expect("written") == bytes, "{name}, {mode}");
        }
    }
    let (out, file) = run("w.png", &["--width", "640"]);
    assert!(out.status.success(), "{}", said(&out));
    let bytes = std::fs::read(file).expect("written");
    assert_eq!(bytes[16..20], 640u32.to_be_bytes(), "the width of the PNG's head");
    for (name, more) in [("x.jpg", &[][..]), ("x.dxf", &[]), ("x", &[]), ("x.svg", &["--width", "640"])] {
        let (out, file) = run(name, more);
        assert!(out.status.code() == Some(2) && said(&out).contains("preview-format"), "{name}: {}", said(&out));
        assert!(!file.exists(), "{name}");
    }
    let (out, _) = run("y.png", &["--width", "40000"]);
    assert!(out.status.code() == Some(2) && said(&out).contains("picture-size"), "{}", said(&out));
}
