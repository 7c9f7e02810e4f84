//! What is marked of a drawing is what resvg, an independent renderer, shows of it.

use std::path::{Path, PathBuf};

use resvg::tiny_skia::{Color, LineCap, LineJoin, Paint, PathBuilder, Pixmap, Stroke, Transform};
use resvg::usvg;

use crate::support::{fixture, shared};
use terrace::diag::Error;
use terrace::geom::BoxMm;
use terrace::program::PenId;
use terrace::texture::{Area, Kind, Marking, Masks, Position, Request, Size, Texture};

/// Pixels of a millimetre.
const SCALE: f32 = 20.0;

/// Diameter of the spot, mm.
const SPOT: f64 = 0.1;

/// Side of the page, mm.
const SIDE: f64 = 40.0;

fn load(path: &Path, marking: Marking) -> Result<Texture, Error> {
    let kind = Kind::Drawing {
        path: path.to_owned(),
        size: Size::Mm([SIDE; 2]),
        unit_mm: None,
        position: Position::Origin([0.0; 2]),
        turn_rad: 0.0,
        tile: false,
        marking: Box::new(marking),
    };
    let request = Request { kind, area: Area::Unlimited, tolerance_mm: 1e-3, pen: PenId(0), masks: Masks::default() };
    Texture::load(&[request], BoxMm::rectangle(0.0, 0.0, SIDE, SIDE), 0.0, SPOT, &mut Vec::new())
}

fn pixels() -> u32 {
    (SIDE as f32 * SCALE) as u32
}

/// The pixels that a spot passes over, row by row from the top.
fn burnt(texture: &Texture) -> Vec<bool> {
    let mut path = PathBuilder::new();
    let mut points = Vec::new();
    for i in 0..texture.len() {
        texture.stroke(i, &mut points);
        for (k, p) in points.iter().map(|p| p.mm()).enumerate() {
            let (x, y) = (p[0] as f32 * SCALE, (SIDE - p[1]) as f32 * SCALE);
            if k == 0 { path.move_to(x, y) } else { path.line_to(x, y) }
        }
    }
    let mut picture = Pixmap::new(pixels(), pixels()).expect("a picture");
    let pen = Stroke {
        width: SPOT as f32 * SCALE,
        line_cap: LineCap::Round,
        line_join: LineJoin::Round,
        ..Stroke::default()
    };
    let mut paint = Paint::default();
    paint.set_color(Color::BLACK);
    if let Some(path) = path.finish() {
        picture.stroke_path(&path, &paint, &pen, Transform::identity(), None);
    }
    picture.pixels().iter().map(|p| p.alpha() > 127).collect()
}

/// The pixels that are neither blank nor white.
fn shown(path: &Path) -> Vec<bool> {
    let tree = usvg::Tree::from_data(&std::fs::read(path).expect("readable"), &usvg::Options::default()).expect("SVG");
    let mut picture = Pixmap::new(pixels(), pixels()).expect("a picture");
    let size = tree.size();
    let side = SIDE as f32 * SCALE;
    resvg::render(&tree, Transform::from_scale(side / size.width(), side / size.height()), &mut picture.as_mut());
    let is_ink = |p: resvg::tiny_skia::ColorU8| p.alpha() > 127 && p.red().min(p.green()).min(p.blue()) < 250;
    picture.pixels().iter().map(|p| is_ink(p.demultiply())).collect()
}

/// Share of pixels that differ and lie farther than a pixel from any edge of what is shown.
fn differ(burnt: &[bool], shown: &[bool], name: &str) -> f64 {
    let n = pixels() as usize;
    let is_flat = |i: usize| {
        let (x, y) = (i % n, i / n);
        let near = |k: usize| k.saturating_sub(1)..(k + 2).min(n);
        near(y).all(|y| near(x).all(|x| shown[y * n + x] == shown[i]))
    };
    let wrong: Vec<usize> = (0..n * n).filter(|&i| burnt[i] != shown[i] && is_flat(i)).collect();
    if let Ok(folder) = std::env::var("SEEN_PICTURES") {
        let mut picture = Pixmap::new(n as u32, n as u32).expect("a picture");
        picture.fill(Color::WHITE);
        let mut data = picture.take();
        for i in 0..n * n {
            let colour = match (burnt[i], shown[i]) {
                (true, true) => [0, 0, 0, 255],
                (true, false) => [255, 0, 0, 255],
                (false, true) => [0, 0, 255, 255],
                (false, false) => [255, 255, 255, 255],
            };
            data[4 * i..4 * i + 4].copy_from_slice(&colour);
        }
        let picture = Pixmap::from_vec(data, resvg::tiny_skia::IntSize::from_wh(n as u32, n as u32).expect("a size"));
        picture.expect("a picture").save_png(Path::new(&folder).join(format!("{name}.png"))).expect("written");
    }
    wrong.len() as f64 / (n * n) as f64
}

/// Drawings with what they differ by, beyond what is allowed.
fn differences(paths: &[PathBuf]) -> Vec<String> {
    let one = |path: &PathBuf| {
        let name = path.file_stem().expect("a name").to_string_lossy();
        let texture = match load(path, Marking::default()) {
            Ok(texture) => texture,
            Err(e) => return Some(format!("{name}: {e}")),
        };
        let share = differ(&burnt(&texture), &shown(path), &name);
        (share > 0.005).then(|| format!("{name}: {:.2} % of pixels differ", share * 100.0))
    };
    paths.iter().filter_map(one).collect()
}

fn drawings(folder: &Path, begin: &str) -> Vec<PathBuf> {
    let files = std::fs::read_dir(folder).expect("a folder").map(|entry| entry.expect("a file").path());
    let is_meant = |path: &PathBuf| {
        let name = path.file_name().expect("a name").to_string_lossy();
        name.starts_with(begin) && name.ends_with(".svg")
    };
    let mut paths: Vec<PathBuf> = files.filter(is_meant).collect();
    paths.sort();
    paths
}

#[test]
fn marks_are_what_a_renderer_shows() {
    let paths = drawings(&fixture("seen"), "");
    assert!(paths.len() >= 40, "{} drawings", paths.len());
    let wrong = differences(&paths);
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
#[ignore = "needs ../shared"]
fn marks_of_foreign_cases_are_what_a_renderer_shows() {
    let paths = drawings(&shared().join("textures"), "resvg_");
    assert_eq!(paths.len(), 15);
    let refused = [("pattern_nested", "svg-paint"), ("text_textPath", "svg-text"), ("text_text", "svg-text")];
    let mut drawn = Vec::new();
    for path in paths {
        match refused.iter().find(|(part, _)| path.display().to_string().contains(part)) {
            Some((_, code)) => assert_eq!(load(&path, Marking::default()).expect_err("refused").diags()[0].code, *code),
            None => drawn.push(path),
        }
    }
    let wrong = differences(&drawn);
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}
