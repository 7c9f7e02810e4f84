//! How the part looks: its silhouette, a relief shaded over the blocks, and its outline.

use svg::Node;
use svg::node::element::Element;

use super::Picture;
use super::colour::{OUTLINE, PART};
use super::image;
use super::outline::{self, Half, Outlines, PaddedMap};
use super::sheet::{Sheet, el, layer, num, push_command, sheet_box};
use crate::scene::Relief;
use terrace_core::geom::{Box2, Nm, P2};

/// Cells of a relief along its longer side.
pub const RELIEF_CELLS: i64 = 400;

/// A part at most this many times as large as its texture is shown whole; of a larger one what lies around the texture.
const WHOLE: i64 = 3;
/// How much is shown around it, as a share of its size: one of so many.
const AROUND: i64 = 10;

/// Which part of `part` a picture shows whose texture has the box `texture`.
pub fn relief_area(part: Box2, texture: Box2) -> Box2 {
    let whole = part.size();
    let size = texture.size();
    let most = size[0].max(size[1]);
    if texture.is_empty() || whole.iter().all(|&w| w <= most * WHOLE) {
        return part;
    }
    let Nm(rim) = most / AROUND;
    let shown = Box2 {
        lo: P2::new((texture.lo.x - rim).max(part.lo.x), (texture.lo.y - rim).max(part.lo.y)),
        hi: P2::new((texture.hi.x + rim).min(part.hi.x), (texture.hi.y + rim).min(part.hi.y)),
    };
    // A texture that lies beside the part.
    if shown.lo.x >= shown.hi.x || shown.lo.y >= shown.hi.y { part } else { shown }
}

/// How the part looks.
pub(super) struct Looks {
    pub silhouette: Silhouette,
    pub shading: Shading,
}

impl Looks {
    pub(super) fn of(job: &Picture<'_>) -> Self {
        Self { silhouette: Silhouette::of(job), shading: Shading::of(job.relief) }
    }
}

/// The silhouette of the part.
pub(super) struct Silhouette {
    outlines: Outlines,
    /// Coordinates, in half cells, of the sides where the relief ends before the part does: lower and upper, x and y.
    cut: [[Option<i32>; 2]; 2],
}

impl Silhouette {
    pub(super) fn of(job: &Picture<'_>) -> Self {
        let grid = job.relief.grid;
        let part = job.part;
        let [columns, rows] = [grid.columns(), grid.rows()];
        let cells = PaddedMap::padded([columns, rows], |i| u32::from(!job.relief.z_mm[i].is_nan()));
        let shown = grid.bounds();
        let side = |before: bool, at: usize| before.then_some(2 * at as i32);
        let cut = [
            [side(part.lo.x < shown.lo.x, 1), side(part.hi.x > shown.hi.x, columns + 1)],
            [side(part.lo.y < shown.lo.y, 1), side(part.hi.y > shown.hi.y, rows + 1)],
        ];
        Self { outlines: outline::trace(&cells), cut }
    }

    /// Whether the part continues beyond the relief.
    pub(super) fn is_cut(&self) -> bool {
        self.cut.iter().flatten().any(Option::is_some)
    }

    /// The rings with few points, each one closed.
    fn rings(&self) -> impl Iterator<Item = Vec<Half>> {
        self.outlines.rings.iter().map(|ring| {
            let mut points = Vec::new();
            outline::simplify(self.outlines.corners_of(ring), 0.5, &mut points);
            points
        })
    }

    /// Whether the line from `a` to `b` is not a rim of the part.
    fn is_along_cut(&self, a: Half, b: Half) -> bool {
        (0..2).any(|k| a[k] == b[k] && self.cut[k].contains(&Some(a[k])))
    }
}

/// The silhouette, filled.
pub(super) fn ground(job: &Picture<'_>, sheet: &Sheet, silhouette: &Silhouette) -> Element {
    let grid = job.relief.grid;
    let mut d = String::new();
    for ring in silhouette.rings() {
        outline::push_ring(&mut d, sheet, grid.origin, grid.pitch[0], &ring);
    }
    let mut g = layer("layer-part", "Part", &[("fill", PART), ("fill-rule", "evenodd"), ("pointer-events", "none")]);
    g.append(el("path", &[("d", &d)]));
    g
}

/// The rim of the part as a line; none where the relief ends before the part does.
pub(super) fn rim(job: &Picture<'_>, sheet: &Sheet, silhouette: &Silhouette) -> Element {
    let grid = job.relief.grid;
    let at = |p: Half| outline::place(sheet, grid.origin, grid.pitch[0], p);
    let mut d = String::new();
    for ring in silhouette.rings() {
        let mut end = None;
        for (&a, &b) in ring.iter().zip(ring.iter().cycle().skip(1)) {
            if silhouette.is_along_cut(a, b) {
                end = None;
                continue;
            }
            let (from, to) = (at(a), at(b));
            if end != Some(from) {
                push_command(&mut d, 'M', &from, sheet.decimals);
            }
            push_command(&mut d, 'l', &[to[0] - from[0], to[1] - from[1]], sheet.decimals);
            end = Some(to);
        }
    }
    let width = num(0.16 * sheet.unit);
    let mut g = layer("layer-outline", "Outline of the part", &[("pointer-events", "none")]);
    g.append(el(
        "path",
        &[
            ("id", "part-outline"),
            ("fill", "none"),
            ("stroke", OUTLINE),
            ("stroke-width", &width),
            ("stroke-linejoin", "round"),
            ("stroke-linecap", "round"),
            ("d", &d),
        ],
    ));
    g
}

/// The relief, lit from the upper left, as shadow and light over what lies under it; heights are multiplied by
/// `factor`.
pub(super) struct Shading {
    pub factor: f64,
    address: String,
}

/// Steps of the light.
const STEPS: f64 = 128.0;

impl Shading {
    pub(super) fn of(relief: &Relief) -> Self {
        let (columns, rows) = (relief.grid.columns(), relief.grid.rows());
        let pitch = relief.grid.pitch[0].mm();
        let z = |x: usize, y: usize| f64::from(relief.z_mm[y * columns + x]);
        let slopes: Vec<Option<[f64; 2]>> = (0..columns * rows)
            .map(|i| {
                let (x, y) = (i % columns, i / columns);
                let is_part = !z(x, y).is_nan();
                is_part.then(|| [slope(|k| z(k, y), x, columns, pitch), slope(|k| z(x, k), y, rows, pitch)])
            })
            .collect();
        let factor = exaggeration(&slopes);
        // Towards the light: from the upper left, 45 degrees high.
        let light = [-0.5, 0.5, std::f64::consts::FRAC_1_SQRT_2];
        let mut pairs = Vec::with_capacity(2 * columns * rows);
        for y in (0..rows).rev() {
            for slope in &slopes[y * columns..(y + 1) * columns] {
                let [x, y] = slope.map_or([0.0; 2], |s| s.map(|v| v * factor));
                let lit = (light[2] - light[0] * x - light[1] * y) / (1.0 + x * x + y * y).sqrt();
                // Level ground is left as it is: black over what is darker, white over what is lighter.
                let over = ((lit - light[2]) * STEPS).round() / STEPS;
                let opacity = if over < 0.0 { -over * 0.7 } else { over * 0.9 };
                pairs.extend([if over < 0.0 { 0 } else { 255 }, (opacity.min(0.45) * 255.0) as u8]);
            }
        }
        Self { factor, address: image::of_shades([columns, rows], &pairs) }
    }

    pub(super) fn draw(&self, job: &Picture<'_>) -> Element {
        let [x0, y0, x1, y1] = sheet_box(job.relief.grid.bounds());
        let mut g = layer("layer-relief", "Relief", &[("pointer-events", "none")]);
        let [x, y, w, h] = [x0, y0, x1 - x0, y1 - y0].map(num);
        let place = [("x", x.as_str()), ("y", y.as_str()), ("width", w.as_str()), ("height", h.as_str())];
        let mut picture = el("image", &place);
        picture.assign("preserveAspectRatio", "none");
        picture.assign("href", self.address.as_str());
        g.append(picture);
        g
    }
}

/// Slope at cell `i` of a row of `count` heights, between those of its neighbours that are on the part; 0 where none
/// is.
fn slope(z: impl Fn(usize) -> f64, i: usize, count: usize, pitch: f64) -> f64 {
    let (before, after) = (i.saturating_sub(1), (i + 1).min(count - 1));
    let (a, b) = if z(before).is_nan() {
        (i, after)
    } else if z(after).is_nan() {
        (before, i)
    } else {
        (before, after)
    };
    let slope = (z(b) - z(a)) / (pitch * (b - a).max(1) as f64);
    if slope.is_nan() { 0.0 } else { slope }
}

/// By how much heights are multiplied so that the root of the mean square of the slopes, each of at most 1, reaches a
/// quarter; at most 10.
fn exaggeration(slopes: &[Option<[f64; 2]>]) -> f64 {
    let mut sum = 0.0;
    let mut count = 0u32;
    for [x, y] in slopes.iter().flatten() {
        sum += (x * x + y * y).min(1.0);
        count += 1;
    }
    let usual = (sum / f64::from(count.max(1))).sqrt();
    [1.0, 2.0, 5.0, 10.0].into_iter().find(|f| f * usual >= 0.25).unwrap_or(10.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slope_uses_the_neighbours_on_the_part() {
        let z = [0.0, 1.0, 3.0, f64::NAN];
        assert_eq!([0, 1, 2].map(|i| slope(|k| z[k], i, 4, 0.5)), [2.0, 3.0, 4.0]);
        assert_eq!(slope(|_| 7.0, 0, 1, 0.5), 0.0);
    }

    #[test]
    fn flat_reliefs_are_exaggerated() {
        assert_eq!(exaggeration(&[Some([0.2, 0.0]), None]), 2.0);
        assert_eq!(exaggeration(&[Some([3.0, 0.0])]), 1.0);
        assert_eq!(exaggeration(&[]), 10.0);
    }
}
