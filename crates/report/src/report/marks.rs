//! The texture on `layout.svg`: every mark as a thin line in its pen's colour, or all of them as one image.
//!
//! Consumes the marks of a scene; made once, and used by all pictures that show them. As lines, a point lies within
//! half a step of where it is marked: a [`STEPS`]th of the longer side of the marks. Where lines would take more than
//! [`MOST`] bytes, the marks are an image of [`PIXELS`] points along its longer side: a point is as dark as the length
//! of the marks in it covers it, so fills are filled and lines stay lines. Sums are of integers, so threads change
//! nothing.

use svg::Node;
use svg::node::Blob;
use svg::node::element::Element;
use terrace_core::math;

use super::colour::{PENS, hex};
use super::image;
use super::sheet::{Sheet, el, layer, num};
use crate::scene::{Group, Mark, Scene};
use std::ops::Range;
use terrace_core::geom::BoxMm;
use terrace_core::parallel;
use terrace_core::program::PenId;

/// Steps along the longer side of the marks, for lines.
const STEPS: f64 = 16_000.0;
/// Bytes of lines at most.
const MOST: usize = 2_000_000;
/// Bytes of a point at least, on average.
const LEAST_BYTES: usize = 4;
/// Points of an image along its longer side.
const PIXELS: f64 = 2400.0;
/// Width of a mark in an image, in points.
const WIDTH: f64 = 1.3;
/// Marks of a task.
const CHUNK: usize = 4096;
/// Bytes of a path element, about.
const PATH: usize = 100_000;

/// Marks as they are drawn.
#[derive(Clone, Debug)]
pub struct Marks {
    /// How many there are.
    count: usize,
    /// The pens that they are marked with, rising; a pen's place gives its colour.
    pens: Vec<PenId>,
    /// Where they are, mm.
    area: BoxMm<2>,
    /// The length of the marks, mm.
    length: f64,
    body: Body,
}

#[derive(Clone, Debug)]
enum Body {
    /// Elements in steps from the upper left of the area; mm of a step.
    Lines { elements: String, step: f64 },
    /// An image, its points, and mm of a point.
    Image { address: String, size: [usize; 2], pitch: f64 },
}

/// What some marks sum up to.
struct Totals {
    /// The box around them, mm.
    area: BoxMm<2>,
    /// How many points they have.
    points: usize,
    /// Length, mm.
    length: f64,
    /// Whether there is a mark of each pen; pens beyond the list have none.
    has_pen: Vec<bool>,
}

impl Totals {
    const NONE: Self = Self { area: BoxMm::EMPTY, points: 0, length: 0.0, has_pen: Vec::new() };

    /// The sums over the marks of a chunk; the box is that of the part frame in plan.
    fn of(chunk: &Chunk<'_>) -> Self {
        let mut totals = Self::NONE;
        for mark in chunk.marks {
            totals.points += mark.len as usize;
            totals.length += mark.length_mm;
            totals.add_pen(mark.pen.index());
            for p in chunk.group.points_of(mark) {
                let [x, y, _] = chunk.group.frame.part_from_group(p.at);
                totals.area.add([x, y]);
            }
        }
        totals
    }

    fn add(&mut self, other: &Self) {
        if other.points > 0 {
            self.area.add(other.area.lo);
            self.area.add(other.area.hi);
        }
        self.points += other.points;
        self.length += other.length;
        (0..other.has_pen.len()).filter(|&k| other.has_pen[k]).for_each(|k| self.add_pen(k));
    }

    fn add_pen(&mut self, pen: usize) {
        self.has_pen.resize(self.has_pen.len().max(pen + 1), false);
        self.has_pen[pen] = true;
    }

    /// The pens that there are marks of, rising.
    fn pens(&self) -> Vec<PenId> {
        (0..self.has_pen.len()).filter(|&k| self.has_pen[k]).map(|k| PenId(k as u16)).collect()
    }
}

impl Marks {
    /// The marks of some groups of a scene.
    pub fn of(scene: &Scene, groups: Range<usize>) -> Self {
        Self::within(scene, groups, MOST)
    }

    /// The marks of some groups of a scene, as lines of at most `most` bytes or as an image.
    fn within(scene: &Scene, groups: Range<usize>, most: usize) -> Self {
        let chunks = chunks(&scene.groups[groups]);
        let mut totals = Totals::NONE;
        parallel::map(chunks.len(), |i| Totals::of(&chunks[i])).iter().for_each(|chunk| totals.add(chunk));
        let pens = totals.pens();
        let area = if totals.points == 0 { BoxMm::rectangle(0.0, 0.0, 1.0, 1.0) } else { totals.area };
        let count = chunks.iter().map(|c| c.marks.len()).sum();
        let drawing = Drawing { chunks: &chunks, pens: &pens, area };
        // Lines that cannot be short enough are not tried.
        let lines = (totals.points * LEAST_BYTES <= most).then(|| drawing.lines(most)).flatten();
        let body = lines.unwrap_or_else(|| drawing.image());
        Self { count, pens, area, length: totals.length, body }
    }

    /// The pens that are drawn.
    pub(super) fn pens(&self) -> &[PenId] {
        &self.pens
    }

    /// What is drawn, in words.
    pub(super) fn words(&self) -> String {
        let count = grouped(self.count);
        match &self.body {
            Body::Lines { .. } if self.count == 1 => "the one mark".into(),
            Body::Lines { .. } => format!("all {count} marks"),
            Body::Image { size, .. } => {
                let [w, h] = size.map(grouped);
                format!("{count} marks, as an image of {w} x {h} points")
            }
        }
    }

    /// The layer.
    pub(super) fn draw(&self, sheet: &Sheet, spot: f64) -> Element {
        let u = sheet.unit;
        let width = match &self.body {
            Body::Lines { .. } => spot.clamp(0.05 * u, 0.1 * u),
            Body::Image { pitch, .. } => WIDTH * pitch,
        };
        // The denser the marks, the more of the blocks shows through.
        let [w, h] = self.area.size().map(|v| v.max(width));
        let cover = (self.length * width / (w * h)).min(1.0);
        let opacity = num(0.9 - 0.4 * cover);
        let mut g = layer("layer-texture-marks", "Texture", &[("opacity", &opacity), ("pointer-events", "none")]);
        let [x, y] = [self.area.lo[0], -self.area.hi[1]];
        match &self.body {
            Body::Lines { elements, step } => {
                let place = format!("translate({} {}) scale({step:.9})", num(x), num(y));
                let width = num(width / step);
                let look = [("fill", "none"), ("stroke-linecap", "round"), ("stroke-linejoin", "round")];
                let mut inner = el("g", &look);
                inner.assign("stroke-width", width);
                inner.assign("transform", place);
                inner.append(Blob::new(elements.as_str()));
                g.append(inner);
            }
            Body::Image { address, size, pitch } => {
                let [w, h] = size.map(|n| num(n as f64 * pitch));
                let mut picture = el("image", &[("x", &num(x - pitch)), ("y", &num(y - pitch))]);
                picture.assign("width", w);
                picture.assign("height", h);
                picture.assign("preserveAspectRatio", "none");
                picture.assign("href", address.as_str());
                g.append(picture);
            }
        }
        g
    }
}

/// The colour of the pen at a place of [`Marks::pens`].
pub(super) fn colour(place: usize) -> [u8; 3] {
    PENS[place % PENS.len()]
}

/// A number with commas between thousands.
pub(super) fn grouped(n: usize) -> String {
    let digits = n.to_string();
    let mut out = String::new();
    for (k, digit) in digits.chars().enumerate() {
        if k > 0 && (digits.len() - k).is_multiple_of(3) {
            out.push(',');
        }
        out.push(digit);
    }
    out
}

/// Some marks of a group.
struct Chunk<'a> {
    group: &'a Group,
    marks: &'a [Mark],
}

/// The marks of groups in chunks, for threads.
fn chunks(groups: &[Group]) -> Vec<Chunk<'_>> {
    groups.iter().flat_map(|group| group.marks.chunks(CHUNK).map(move |marks| Chunk { group, marks })).collect()
}

/// Marks while they are drawn.
struct Drawing<'a> {
    chunks: &'a [Chunk<'a>],
    pens: &'a [PenId],
    area: BoxMm<2>,
}

impl Drawing<'_> {
    /// How many colours there are.
    fn colours(&self) -> usize {
        self.pens.len().clamp(1, PENS.len())
    }

    /// Number of the colour of a mark.
    fn colour_of(&self, mark: &Mark) -> usize {
        self.pens.binary_search(&mark.pen).unwrap_or(0) % PENS.len()
    }

    /// All marks as lines; None where they take too many bytes.
    fn lines(&self, most: usize) -> Option<Body> {
        let [w, h] = self.area.size();
        let step = (w.max(h) / STEPS).max(1e-6);
        let data = parallel::map(self.chunks.len(), |i| self.lines_of(&self.chunks[i], step));
        let bytes: usize = data.iter().flatten().map(String::len).sum();
        if bytes > most {
            return None;
        }
        let mut elements = String::with_capacity(bytes + 1000);
        for (k, colour) in PENS.iter().enumerate().take(self.colours()) {
            push_group(&mut elements, *colour, data.iter().map(|by_colour| by_colour[k].as_str()));
        }
        Some(Body::Lines { elements, step })
    }

    /// The path data of a chunk, by colour.
    fn lines_of(&self, chunk: &Chunk<'_>, step: f64) -> Vec<String> {
        let mut out = vec![String::new(); self.colours()];
        let mut digits = itoa::Buffer::new();
        for mark in chunk.marks {
            let d = &mut out[self.colour_of(mark)];
            let mut last: Option<[i64; 2]> = None;
            let mut has_length = false;
            for p in chunk.group.points_of(mark) {
                let [x, y, _] = chunk.group.frame.part_from_group(p.at);
                let place = [x - self.area.lo[0], self.area.hi[1] - y].map(|v| (v / step).round() as i64);
                match last {
                    None => {
                        d.push('M');
                        d.push_str(digits.format(place[0]));
                        push_next(d, &mut digits, place[1]);
                    }
                    Some(last) if last == place => continue,
                    Some(last) if has_length => {
                        push_next(d, &mut digits, place[0] - last[0]);
                        push_next(d, &mut digits, place[1] - last[1]);
                    }
                    Some(last) => {
                        d.push('l');
                        d.push_str(digits.format(place[0] - last[0]));
                        push_next(d, &mut digits, place[1] - last[1]);
                        has_length = true;
                    }
                }
                last = Some(place);
            }
            if !has_length {
                // A dot, or what is smaller than a step: its round ends are seen.
                d.push_str("h1");
            }
        }
        out
    }

    /// All marks as an image, a point wider on every side.
    fn image(&self) -> Body {
        let [w, h] = self.area.size();
        let pitch = (w.max(h) / (PIXELS - 2.0)).max(1e-6);
        // One free point before the marks, one behind them, and one into which a deposit at their end reaches.
        let size = [w, h].map(|v| (v / pitch - 1e-6).ceil().max(0.0) as usize + 3);
        let colours = self.colours();
        let planes = parallel::fold(
            self.chunks.len(),
            || vec![0u16; if self.chunks.is_empty() { 0 } else { colours * size[0] * size[1] }],
            |planes, i| self.cover(&self.chunks[i], planes, size, pitch),
            |sum, planes| sum.iter_mut().zip(planes).for_each(|(a, b)| *a = a.saturating_add(b)),
        );
        let mut palette = vec![[255, 255, 255, 0]];
        for [r, g, b] in &PENS[..colours] {
            palette.extend((1..=LEVELS).map(|level| [*r, *g, *b, (u32::from(level) * 255 / u32::from(LEVELS)) as u8]));
        }
        let pixels = pixels_of(&planes, colours, size[0] * size[1]);
        // As large as all else that a picture takes: gone before the image is packed.
        drop(planes);
        Body::Image { address: image::of_indices(size, &palette, &pixels), size, pitch }
    }

    /// Adds what the marks of a chunk cover to the plane of each colour.
    fn cover(&self, chunk: &Chunk<'_>, planes: &mut [u16], size: [usize; 2], pitch: f64) {
        let area = size[0] * size[1];
        for mark in chunk.marks {
            let k = self.colour_of(mark);
            let plane = &mut planes[k * area..(k + 1) * area];
            let places = chunk.group.points_of(mark).iter().map(|p| {
                let [x, y, _] = chunk.group.frame.part_from_group(p.at);
                [(x - self.area.lo[0]) / pitch + 1.0, (self.area.hi[1] - y) / pitch + 1.0]
            });
            Plane { cells: plane, columns: size[0] }.cover(places);
        }
    }
}

/// Appends a number of path data that follows another: a minus sign separates them as well as a space.
fn push_next(d: &mut String, digits: &mut itoa::Buffer, v: i64) {
    if v >= 0 {
        d.push(' ');
    }
    d.push_str(digits.format(v));
}

/// Appends the lines of a colour, in elements of about [`PATH`] bytes of path data.
fn push_group<'a>(elements: &mut String, colour: [u8; 3], data: impl Iterator<Item = &'a str>) {
    elements.push_str(&format!("<g stroke=\"{}\">", hex(colour)));
    // Bytes in the open element; 0 without one.
    let mut open = 0;
    for d in data.filter(|d| !d.is_empty()) {
        if open == 0 {
            elements.push_str("\n<path d=\"");
        }
        elements.push_str(d);
        open += d.len();
        if open > PATH {
            elements.push_str("\"/>");
            open = 0;
        }
    }
    elements.push_str(if open > 0 { "\"/>\n</g>\n" } else { "\n</g>\n" });
}

/// Indices into the palette for planes of `area` points, one plane a colour: the colour that covers most of a point, as
/// opaque as all of them cover it.
fn pixels_of(planes: &[u16], colours: usize, area: usize) -> Vec<u8> {
    let mut pixels = vec![0u8; area];
    for (i, pixel) in pixels.iter_mut().enumerate().take(planes.len()) {
        let covered = |k: usize| planes[k * area + i];
        let mut sum = 0;
        let mut most = 0;
        for k in 0..colours {
            sum += u32::from(covered(k));
            if covered(k) > covered(most) {
                most = k;
            }
        }
        let level = (sum.min(FULL) * u32::from(LEVELS) + FULL / 2) / FULL;
        if level > 0 {
            *pixel = most as u8 * LEVELS + level as u8;
        }
    }
    pixels
}

/// How much of each point of an image the marks of a colour cover.
struct Plane<'a> {
    /// Row by row from the upper left; [`FULL`] is a point that is covered once.
    cells: &'a mut [u16],
    columns: usize,
}

impl Plane<'_> {
    /// Adds a line through these places, in points of the image from its upper left, or a dot.
    fn cover(&mut self, mut places: impl ExactSizeIterator<Item = [f64; 2]>) {
        let is_dot = places.len() == 1;
        let Some(mut from) = places.next() else { return };
        if is_dot {
            return self.deposit(from, 1.0);
        }
        // Every SPACING along the line one deposit; what is left at its end is one too.
        let mut due = SPACING / 2.0;
        let mut left = 0.0;
        for to in places {
            let [dx, dy] = [to[0] - from[0], to[1] - from[1]];
            let length = math::hypot(dx, dy);
            let mut way = due;
            while way <= length {
                let t = way / length;
                self.deposit([from[0] + t * dx, from[1] + t * dy], SPACING * WIDTH);
                way += SPACING;
            }
            due = way - length;
            left = SPACING / 2.0 - due;
            from = to;
        }
        if left != 0.0 {
            self.deposit(from, left.max(0.0) * WIDTH);
        }
    }

    /// Adds an amount, in covered points, at a place: each of the four points whose centres lie around it gets the more
    /// the nearer it is.
    fn deposit(&mut self, [x, y]: [f64; 2], amount: f64) {
        let (x, y) = (x - 0.5, y - 0.5);
        let (column, row) = (x as usize, y as usize);
        let (fx, fy) = (x - column as f64, y - row as f64);
        let first = row * self.columns + column;
        for (i, share) in [
            (first, (1.0 - fx) * (1.0 - fy)),
            (first + 1, fx * (1.0 - fy)),
            (first + self.columns, (1.0 - fx) * fy),
            (first + self.columns + 1, fx * fy),
        ] {
            if let Some(cell) = self.cells.get_mut(i) {
                *cell = cell.saturating_add((amount * share * f64::from(FULL)) as u16);
            }
        }
    }
}

/// Steps of opacity of an image: with all colours of [`PENS`] and the ground they are indices of a byte.
const LEVELS: u8 = 15;
/// What covers a point of an image; a u16 holds 31 times that, and saturates beyond.
const FULL: u32 = 2048;
/// Distance of deposits along a mark, in points: with a half their shares of a point sum up to the same everywhere.
const SPACING: f64 = 0.5;

#[cfg(test)]
mod tests {
    use resvg::tiny_skia::{Pixmap, Transform};

    use super::*;
    use crate::scene::{Frame, Point};

    /// Lines of one group, each with its pen, in mm.
    fn scene(lines: &[(u16, Vec<[f64; 2]>)]) -> Scene {
        let mut group = Group::new(Frame::upright([100.0, -50.0, 0.0]));
        for (pen, line) in lines {
            let first = group.points.len() as u32;
            let len = line.len() as u32;
            let length_mm = line.windows(2).map(|w| math::hypot(w[1][0] - w[0][0], w[1][1] - w[0][1])).sum();
            group.marks.push(Mark { pen: PenId(*pen), length_mm, first, len });
            let at = |p: &[f64; 2]| [(p[0] * 1e6) as i32, (p[1] * 1e6) as i32, 0];
            group.points.extend(line.iter().map(|p| Point { at: at(p), ..Point::default() }));
        }
        Scene { groups: vec![group], ..Scene::default() }
    }

    /// The image of marks, a pixel for each of its points, on white.
    fn image(marks: &Marks) -> Pixmap {
        let Body::Image { address, size: [w, h], .. } = &marks.body else { panic!("lines") };
        let svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {w} {h}\"><rect width=\"{w}\" height=\"{h}\" \
             fill=\"#fff\"/>\
             <image width=\"{w}\" height=\"{h}\" image-rendering=\"optimizeSpeed\" href=\"{address}\"/></svg>"
        );
        let tree = resvg::usvg::Tree::from_str(&svg, &resvg::usvg::Options::default()).expect("a drawing");
        let mut pixels = Pixmap::new(*w as u32, *h as u32).expect("a size");
        resvg::render(&tree, Transform::default(), &mut pixels.as_mut());
        pixels
    }

    #[test]
    fn fills_are_filled_and_lines_stay_lines_in_an_image() {
        // A square hatched at half a point of the image, and a single line above it, on 24 x 12 mm.
        let pitch = 24.0 / (PIXELS - 2.0);
        let mut lines: Vec<(u16, Vec<[f64; 2]>)> = (0..1000)
            .map(|k| (0, vec![[0.0, f64::from(k) * pitch / 2.0], [4.0, f64::from(k) * pitch / 2.0]]))
            .collect();
        lines.push((0, vec![[0.0, 12.0], [24.0, 12.0]]));
        let scene = scene(&lines);
        let marks = Marks::within(&scene, 0..1, 0);
        let pixels = image(&marks);
        let dark = |x: u32, y: u32| 255 - u32::from(pixels.pixel(x, y).expect("inside").red());
        let height = pixels.height();
        assert!((20..380).all(|x| (20..480).all(|y| dark(x, height - y) > 220)), "the square is filled");
        let line: Vec<u32> = (0..6).map(|y| dark(1200, y)).collect();
        let sum: u32 = line.iter().sum();
        assert!((250..330).contains(&sum) && line[4..].iter().all(|v| *v == 0), "a line of {WIDTH} points: {line:?}");
        assert!((500..2000).all(|x| dark(x, 600) == 0), "nothing beside them");
        assert_eq!(marks.words(), format!("1,001 marks, as an image of {} x {} points", grouped(2401), grouped(1202)));
    }

    #[test]
    fn each_pen_has_its_colour_in_an_image_and_in_lines() {
        let scene =
            scene(&[(0, vec![[0.0, 0.0], [9.0, 0.0]]), (5, vec![[0.0, 3.0], [9.0, 3.0]]), (5, vec![[4.0, 5.0]])]);
        let marks = Marks::within(&scene, 0..1, 0);
        assert_eq!(marks.pens(), [PenId(0), PenId(5)]);
        let pixels = image(&marks);
        let darkest = |rows: Range<u32>| {
            let all = rows.map(|y| pixels.pixel(1200, y).expect("inside"));
            all.min_by_key(|p| p.red()).map(|p| [p.red(), p.green(), p.blue()]).expect("some")
        };
        let height = pixels.height();
        let [low, high] = [darkest(height - 8..height), darkest(height - 820..height - 780)];
        assert!(low[2].abs_diff(low[0]) < 4 && high[2] > high[0] + 60, "{low:?} {high:?}");
        let Body::Lines { elements, .. } = Marks::of(&scene, 0..1).body else { panic!("an image") };
        for k in 0..2 {
            assert_eq!(elements.matches(&format!("<g stroke=\"{}\">", hex(colour(k)))).count(), 1);
        }
        // Three marks, one of them a dot.
        assert_eq!((elements.matches('M').count(), elements.matches("h1").count()), (3, 1));
    }

    #[test]
    fn lines_lie_where_the_marks_do() {
        let line = vec![[0.0, 0.0], [16.0, 4.0], [16.0, 4.0], [3.0, 8.0]];
        let Body::Lines { elements, step } = Marks::of(&scene(&[(0, line)]), 0..1).body else { panic!("an image") };
        assert!((step - 1e-3).abs() < 1e-12, "{step}");
        assert!(elements.contains("\"M0 8000l16000-4000-13000-4000\""), "{elements}");
    }
}
