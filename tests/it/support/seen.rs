//! What is marked of a drawing against a picture of it.

use std::collections::BTreeSet;
use std::path::Path;
use terrace_core::math;

use resvg::tiny_skia::{Color, IntSize, LineCap, LineJoin, Paint, PathBuilder, Pixmap, Stroke, Transform};
use resvg::usvg;

use super::chromium::Ink;
use terrace_core::diag::{Diag, Error};
use terrace_core::geom::{BoxMm, P2};
use terrace_core::program::PenId;
use terrace_input::texture::{Area, Kind, Marking, Masks, Position, Request, Size, Texture};

/// Pixels of a millimetre.
pub const PER_MM: f64 = 20.0;

/// Diameter of the spot, mm.
pub const SPOT: f64 = 0.1;

/// Longer side of a page that has no size of its own, mm.
pub const SIDE: f64 = 40.0;

/// Share of the page's pixels that may differ.
pub const LIMIT: f64 = 0.005;

/// The same as a share of the pixels that are shown: a lost dot is less than [`LIMIT`] of a page.
pub const INK_LIMIT: f64 = 0.05;

/// What is marked of a drawing with its page's lower left corner at the origin, and the warnings.
pub fn load(path: &Path, size: Size, spot: f64, marking: Marking) -> Result<(Texture, Vec<Diag>), Error> {
    let kind = Kind::Drawing {
        path: path.to_owned(),
        size,
        unit_mm: None,
        position: Position::Origin([0.0; 2]),
        turn_rad: 0.0,
        tile: false,
        marking: Box::new(marking),
    };
    let request = Request { kind, area: Area::Unlimited, tolerance_mm: 1e-3, pen: PenId(0), masks: Masks::default() };
    let mut notes = Vec::new();
    let plate = BoxMm::rectangle(-1000.0, -1000.0, 1000.0, 1000.0);
    Texture::load(&[request], plate, 0.0, spot, &mut notes).map(|texture| (texture, notes))
}

/// What resvg shows of a drawing, stretched to a page of this size in mm.
pub fn by_resvg(path: &Path, page_mm: [f64; 2]) -> Ink {
    let tree = usvg::Tree::from_data(&std::fs::read(path).expect("readable"), &usvg::Options::default()).expect("SVG");
    let [width, height] = page_mm.map(|mm| (mm * PER_MM).round() as u32);
    let mut picture = Pixmap::new(width, height).expect("a picture");
    let scale = [width as f32 / tree.size().width(), height as f32 / tree.size().height()];
    resvg::render(&tree, Transform::from_scale(scale[0], scale[1]), &mut picture.as_mut());
    Ink::new(&picture, [width as usize, height as usize])
}

/// The codes of messages, each once.
pub fn codes(diags: &[Diag]) -> BTreeSet<String> {
    diags.iter().map(|d| d.code.to_string()).collect()
}

/// Length of all marks, mm.
pub fn length(texture: &Texture) -> f64 {
    let mut points: Vec<P2> = Vec::new();
    let mut sum = 0.0;
    for i in 0..texture.len() {
        texture.stroke(i, &mut points);
        for (a, b) in points.iter().zip(points.iter().skip(1)) {
            let (a, b) = (a.mm(), b.mm());
            sum += math::hypot(b[0] - a[0], b[1] - a[1]);
        }
    }
    sum
}

/// The pixels of a page that a spot passes over, row by row from the top.
pub fn burnt(texture: &Texture, [width, height]: [usize; 2], height_mm: f64) -> Vec<bool> {
    let mut path = PathBuilder::new();
    let mut points = Vec::new();
    for i in 0..texture.len() {
        texture.stroke(i, &mut points);
        let mut last = None;
        for (k, p) in points.iter().map(|p| p.mm()).enumerate() {
            let (x, y) = ((p[0] * PER_MM) as f32, ((height_mm - p[1]) * PER_MM) as f32);
            if k == 0 {
                path.move_to(x, y)
            } else {
                path.line_to(x, y)
            }
            last = Some((x, y));
        }
        // A dot: a line without extent is not drawn.
        if let (Some((x, y)), 1) = (last, points.len()) {
            path.line_to(x + 1e-3, y);
        }
    }
    let mut picture = Pixmap::new(width as u32, height as u32).expect("a picture");
    let pen = Stroke {
        width: (SPOT * PER_MM) as f32,
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

/// Shares of the page's pixels that are marked and not shown, and shown and not marked, and lie farther than a pixel
/// from any edge of what is shown. `SEEN_PICTURES` in the environment names a folder for pictures of the difference:
/// black is right, red is marked and not shown, blue is shown and not marked.
pub fn differ(burnt: &[bool], shown: &Ink, name: &str) -> [f64; 2] {
    let (w, h, is_ink) = (shown.width, shown.height, &shown.is_ink);
    let wrong: Vec<usize> = (0..w * h).filter(|&i| burnt[i] != is_ink[i] && shown.is_flat[i]).collect();
    if let Ok(folder) = std::env::var("SEEN_PICTURES") {
        let colour = |(&burnt, &shown): (&bool, &bool)| match (burnt, shown) {
            (true, true) => [0, 0, 0, 255],
            (true, false) => [255, 0, 0, 255],
            (false, true) => [0, 0, 255, 255],
            (false, false) => [255, 255, 255, 255],
        };
        let data: Vec<u8> = burnt.iter().zip(is_ink).flat_map(colour).collect();
        let size = IntSize::from_wh(w as u32, h as u32).expect("a size");
        let picture = Pixmap::from_vec(data, size).expect("a picture");
        let file = format!("{}.png", name.replace(['/', ' '], "_"));
        picture.save_png(Path::new(&folder).join(file)).expect("written");
    }
    let extra = wrong.iter().filter(|&&i| burnt[i]).count();
    [extra, wrong.len() - extra].map(|n| n as f64 / (w * h) as f64)
}

/// What becomes of a drawing.
#[derive(Debug)]
pub enum Verdict {
    /// Its marks are what is shown, with these warnings.
    Right(BTreeSet<String>),
    /// They are not.
    Wrong {
        extra: f64,
        missing: f64,
        warnings: BTreeSet<String>,
    },
    Refused(BTreeSet<String>),
}

impl std::fmt::Display for Verdict {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let list = |codes: &BTreeSet<String>| codes.iter().map(String::as_str).collect::<Vec<_>>().join(" ");
        match self {
            Self::Right(warnings) => write!(f, "right ({})", list(warnings)),
            Self::Wrong { extra, missing, warnings } => {
                let [extra, missing] = [extra, missing].map(|v| v * 100.0);
                write!(f, "{extra:.2} % marked that is not shown, {missing:.2} % not marked ({})", list(warnings))
            }
            Self::Refused(codes) => write!(f, "refused: {}", list(codes)),
        }
    }
}

/// Holds the marks of a drawing against what is shown of it, on a page of this height in mm.
pub fn judge(path: &Path, size: Size, height_mm: f64, shown: &Ink, name: &str) -> Verdict {
    match load(path, size, SPOT, Marking::default()) {
        Err(e) => Verdict::Refused(codes(e.diags())),
        Ok((texture, notes)) => {
            let [extra, missing] = differ(&burnt(&texture, [shown.width, shown.height], height_mm), shown, name);
            let warnings = codes(&notes);
            let ink = shown.is_ink.iter().filter(|&&is_ink| is_ink).count() as f64 / shown.is_ink.len() as f64;
            if extra + missing > LIMIT.min(INK_LIMIT * ink) {
                Verdict::Wrong { extra, missing, warnings }
            } else {
                Verdict::Right(warnings)
            }
        }
    }
}
