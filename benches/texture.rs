//! Time to read drawings and to hatch their areas, on one thread: `make bench` prints the table.
//!
//! A drawing of 340,000 points, thin lines; and 10,000 filled figures with a million lines of hatch, beside the
//! clipping of the same lines by geo's boolean operations, figure by figure.

use std::hint::black_box;
use std::path::Path;
use std::time::{Duration, Instant};
use terrace_core::math;

use geo::{BooleanOps, LineString, MultiLineString, Polygon};
use terrace_core::geom::BoxMm;
use terrace_core::program::PenId;
use terrace_input::texture::{Area, Kind, Marking, Masks, Position, Request, Size, Texture};

/// Figures in a row and in a column.
const ROW: u32 = 100;

/// Distance of figures, mm.
const PITCH: f64 = 4.0;

/// Radius of a figure, mm.
const RADIUS: f64 = 1.5;

/// Sides of a figure.
const SIDES: u32 = 32;

/// Lines of hatch in a figure.
const LINES: f64 = 100.0;

fn main() {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread");
    println!("| drawing | strokes | time, best of 5 |\n|---|---|---|");
    pool.install(|| {
        row("340 lines of 1,000 points", &lines(), Marking::default());
        let hatch = Marking { pitch_mm: Some(2.0 * RADIUS / LINES), inset_mm: Some(0.0), ..Marking::default() };
        row("10,000 figures of 32 sides, hatched", &figures(), hatch);
        let (count, time) = best(clipped_by_geo);
        println!("| the same lines clipped by geo | {count} | {time:.2?} |");
    });
}

fn row(name: &str, body: &str, marking: Marking) {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join("texture.svg");
    let text = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"400mm\" height=\"400mm\" viewBox=\"0 0 400 400\">{body}</svg>"
    );
    std::fs::write(&path, text).expect("a writable folder");
    let load = || {
        let kind = Kind::Drawing {
            path: path.clone(),
            size: Size::File,
            unit_mm: None,
            position: Position::Origin([0.0; 2]),
            turn_rad: 0.0,
            tile: false,
            marking: Box::new(marking.clone()),
        };
        let request =
            Request { kind, area: Area::Unlimited, tolerance_mm: 1e-3, pen: PenId(0), masks: Masks::default() };
        let page = BoxMm::rectangle(0.0, 0.0, 400.0, 400.0);
        Texture::load(&[request], page, 0.0, 0.03, &mut Vec::new()).expect("a drawing").len()
    };
    let (count, time) = best(load);
    println!("| {name} | {count} | {time:.2?} |");
}

fn best(work: impl Fn() -> usize) -> (usize, Duration) {
    let timed = |_| {
        let start = Instant::now();
        (black_box(work()), start.elapsed())
    };
    (0..5).map(timed).min_by_key(|(_, time)| *time).expect("five runs")
}

fn lines() -> String {
    let line = |k: u32| {
        let point =
            |i: u32| format!("{:.3},{:.3} ", f64::from(i) * 0.4, 1.0 + f64::from(k) + 0.4 * math::sin(f64::from(i)));
        let points: String = (0..1000).map(point).collect();
        format!("<polyline points=\"{points}\"/>")
    };
    format!("<g fill=\"none\" stroke=\"black\" stroke-width=\"0.02\">{}</g>", (0..340).map(line).collect::<String>())
}

fn corners(k: u32) -> Vec<[f64; 2]> {
    let middle = [f64::from(k % ROW) * PITCH + 2.0, f64::from(k / ROW) * PITCH + 2.0];
    let corner = |i: u32| {
        let (sin, cos) = math::sin_cos(f64::from(i) * std::f64::consts::TAU / f64::from(SIDES));
        [middle[0] + RADIUS * cos, middle[1] + RADIUS * sin]
    };
    (0..SIDES).map(corner).collect()
}

fn figures() -> String {
    let figure = |k| {
        let points: String = corners(k).iter().map(|p| format!("{:.6},{:.6} ", p[0], p[1])).collect();
        format!("<polygon points=\"{points}\"/>")
    };
    (0..ROW * ROW).map(figure).collect()
}

fn clipped_by_geo() -> usize {
    let clip = |k| {
        let corners = corners(k);
        let line = |i: u32| {
            let y = corners[0][1] - RADIUS + (f64::from(i) + 0.5) * 2.0 * RADIUS / LINES;
            LineString::from(vec![[corners[0][0] - 2.0 * RADIUS - 1.0, y], [corners[0][0] + 1.0, y]])
        };
        let lines = MultiLineString::new((0..LINES as u32).map(line).collect());
        let area = Polygon::new(LineString::from(corners.clone()), Vec::new());
        area.clip(&lines, false).0.len()
    };
    (0..ROW * ROW).map(clip).sum()
}
