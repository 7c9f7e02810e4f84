//! HPGL and HP-GL/2 plots (PLT): the pen strokes and filled polygons of a plot, in mm.
//!
//! Consumes instructions for plotters; a plotter unit is 0.025 mm unless `SC` scales it. Promises an [`Artwork`] whose
//! page is the box of all that is drawn: moves with the pen down, circles, arcs, rectangles, wedges and polygons, with
//! the label `pen:N` and the colour of pen N (1 black, 2 red, 3 green, 4 yellow, 5 blue, 6 magenta, 7 cyan, then round
//! again). Curves are flattened within the tolerance, whatever chord the plot asks for. Labels, line types, fill
//! patterns, symbols and what is not known are reported by one warning each; what rotates or scales the page in a way
//! that is not read is an error. Time and memory are bounded by the file and by 20 million points.

use std::collections::BTreeMap;
use std::f64::consts::TAU;
use std::path::Path;

use super::artwork::{Artwork, Colour, Figure, Labels, MAX_MM, MAX_POINTS, Marking, Rule, Shape, steps};
use super::clip::extent;
use super::place::LEAST;
use crate::diag::{Diag, Error, Place};

/// A plotter unit, mm.
const UNIT: f64 = 0.025;

const ETX: u8 = 3;
const ESC: u8 = 27;

/// Instructions that change nothing that is marked.
const QUIET: [&str; 34] = [
    "IN", "DF", "VS", "VN", "FS", "AS", "AP", "PW", "NP", "PT", "WU", "TR", "SV", "PS", "BP", "PG", "AF", "AH", "NR",
    "OE", "OS", "OP", "LA", "CT", "CR", "MC", "PC", "MG", "DI", "DR", "SI", "SR", "RF", "IM",
];

type Point = [f64; 2];
type Fault = Box<Diag>;

/// Reads a plot.
///
/// # Errors
/// `hpgl-syntax`, `hpgl-page`, `texture-far`, `texture-large`.
pub(super) fn load(
    bytes: &[u8],
    path: &Path,
    tolerance_mm: f64,
    marking: &Marking,
    notes: &mut Vec<Diag>,
) -> Result<Artwork, Error> {
    let name = path.display().to_string();
    let mut plotter = Plotter::new(bytes, tolerance_mm);
    while let Some(instruction) = plotter.instruction() {
        plotter.obey(&instruction).map_err(|d| d.at(Place::file(&name)))?;
    }
    plotter.lift();
    if !plotter.is_plot {
        let text = "this is not an HPGL plot: it holds no pen movement";
        let d = Diag::input("hpgl-syntax", text).hint("write the plot again as HPGL (PLT)");
        return Err(d.at(Place::file(&name)).into());
    }
    let messages = plotter.messages(&name, marking);
    if !marking.is_lenient && !messages.is_empty() {
        return Err(Error::many(messages));
    }
    notes.extend(messages);
    let mut art = plotter.art;
    art.fit_page();
    Ok(art)
}

/// A mnemonic of two letters, what follows it, and where it stands.
struct Instruction {
    name: String,
    values: Vec<f64>,
    /// Its first byte, from 0.
    at: usize,
    /// The bytes of an encoded polyline.
    code: Vec<u8>,
}

struct Plotter<'a> {
    bytes: &'a [u8],
    pos: usize,
    /// What ends a label.
    end_of_label: u8,
    tolerance: f64,
    is_plot: bool,
    at: Point,
    is_down: bool,
    is_relative: bool,
    pen: i64,
    /// From the units of the plot to plotter units, by axis: factor and shift.
    scale: [[f64; 2]; 2],
    corners: Option<[f64; 4]>,
    /// The stroke that is being drawn, mm.
    stroke: Vec<Point>,
    /// The polygon that is being defined or was last, mm, and whether it is being defined.
    polygon: Vec<Vec<Point>>,
    is_polygon: bool,
    is_dashed: bool,
    is_patterned: bool,
    unread: BTreeMap<String, (usize, usize)>,
    issues: BTreeMap<Issue, (usize, usize)>,
    art: Artwork,
}

#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Issue {
    Label,
    Dash,
    Fill,
}

impl<'a> Plotter<'a> {
    fn new(bytes: &'a [u8], tolerance: f64) -> Self {
        Self {
            bytes,
            pos: 0,
            end_of_label: ETX,
            tolerance,
            is_plot: false,
            at: [0.0; 2],
            is_down: false,
            is_relative: false,
            pen: 1,
            scale: [[1.0, 0.0]; 2],
            corners: None,
            stroke: Vec::new(),
            polygon: Vec::new(),
            is_polygon: false,
            is_dashed: false,
            is_patterned: false,
            unread: BTreeMap::new(),
            issues: BTreeMap::new(),
            art: Artwork::default(),
        }
    }

    fn next(&mut self) -> Option<u8> {
        let byte = *self.bytes.get(self.pos)?;
        self.pos += 1;
        Some(byte)
    }

    fn peek(&self) -> Option<u8> {
        self.bytes.get(self.pos).copied()
    }

    /// The next instruction; bytes that belong to none are left out.
    fn instruction(&mut self) -> Option<Instruction> {
        loop {
            let at = self.pos;
            match self.next()? {
                ESC => self.escape(),
                a if a.is_ascii_alphabetic() => {
                    let Some(b) = self.peek().filter(u8::is_ascii_alphabetic) else { continue };
                    self.pos += 1;
                    let name: String = [a, b].map(|c| char::from(c.to_ascii_uppercase())).iter().collect();
                    let mut found = Instruction { name, values: Vec::new(), at, code: Vec::new() };
                    self.values(&mut found);
                    return Some(found);
                }
                _ => {}
            }
        }
    }

    /// Leaves a device control out: `ESC . letter numbers :`, or `ESC` up to a capital.
    fn escape(&mut self) {
        if self.peek() == Some(b'.') {
            self.pos += 2;
            while self.peek().is_some_and(|b| b.is_ascii_digit() || b == b';') {
                self.pos += 1;
            }
            self.pos += usize::from(self.peek() == Some(b':'));
            return;
        }
        while self.next().is_some_and(|b| !b.is_ascii_uppercase()) {}
    }

    fn values(&mut self, found: &mut Instruction) {
        let ends = |b: u8| b == b';' || b == ESC;
        match found.name.as_str() {
            "LB" | "BL" => while self.next().is_some_and(|b| b != self.end_of_label) {},
            "DT" => self.end_of_label = self.next().filter(|&b| b != b';').unwrap_or(ETX),
            "CO" | "SM" | "UC" => while self.next().is_some_and(|b| !ends(b)) {},
            "PE" => {
                while let Some(b) = self.next().filter(|&b| !ends(b)) {
                    found.code.push(b);
                }
            }
            _ => {
                while let Some(b) = self.peek().filter(|b| !b.is_ascii_alphabetic() && !ends(*b)) {
                    if !(b.is_ascii_digit() || b"+-.".contains(&b)) {
                        self.pos += 1;
                        continue;
                    }
                    let rest = &self.bytes[self.pos..];
                    let is_number =
                        |(i, b): (usize, &u8)| b.is_ascii_digit() || *b == b'.' || (i == 0 && b"+-".contains(b));
                    let len = rest.iter().enumerate().position(|ib| !is_number(ib)).unwrap_or(rest.len());
                    self.pos += len.max(1);
                    let text = std::str::from_utf8(&rest[..len]).unwrap_or_default();
                    // What is no number stays one that every use refuses.
                    found.values.push(text.parse().unwrap_or(f64::NAN));
                }
            }
        }
    }

    fn obey(&mut self, i: &Instruction) -> Result<(), Fault> {
        if i.values.iter().any(|v| !v.is_finite()) {
            return Err(fault(i, "has a value that is no number"));
        }
        let v = i.values.as_slice();
        match (i.name.as_str(), v) {
            ("PA", _) => (self.is_relative, self.is_plot) = (false, true),
            ("PR", _) => (self.is_relative, self.is_plot) = (true, true),
            ("PU", _) => self.lift(),
            ("PD", _) => (self.is_down, self.is_plot) = (true, true),
            ("SP", _) => {
                self.lift();
                self.pen = v.first().map_or(0, |p| *p as i64);
            }
            ("LT", _) => self.is_dashed = !v.is_empty() && v[0].abs() != 7.0,
            ("FT", _) => self.is_patterned = v.first().is_some_and(|t| *t > 2.0),
            ("IP", &[a, b, c, d]) => self.corners = Some([a, b, c, d]),
            ("IP" | "SC" | "IW" | "RO", []) => self.reset(&i.name),
            ("RO", &[0.0]) => {}
            ("SC", &[x0, x1, y0, y1] | &[x0, x1, y0, y1, 0.0]) => self.scale_to(i, [x0, x1, y0, y1])?,
            ("SC" | "IP" | "RO" | "IW", _) => return Err(page(i)),
            ("CI", &[r, ..]) => self.circle(r)?,
            ("AA", &[x, y, angle, ..]) => self.arc([x, y], angle)?,
            ("AR", &[x, y, angle, ..]) => self.arc([self.at[0] + x, self.at[1] + y], angle)?,
            ("EA" | "RA", &[x, y]) => self.rectangle([x, y], i.name == "RA")?,
            ("ER" | "RR", &[x, y]) => self.rectangle([self.at[0] + x, self.at[1] + y], i.name == "RR")?,
            ("PM", _) => self.polygon_mode(v.first().copied().unwrap_or(0.0)),
            ("EP", _) => self.edge(),
            ("FP", _) => self.fill(),
            ("PE", _) => self.encoded(i)?,
            ("LB" | "BL" | "SM" | "UC", _) => self.note(Issue::Label, i.at),
            (name, _) if QUIET.contains(&name) || ["CO", "DT"].contains(&name) => {}
            (name, _) => self.unread.entry(name.to_owned()).or_insert((0, i.at)).0 += 1,
        }
        if ["PA", "PR", "PU", "PD"].contains(&i.name.as_str()) {
            self.is_plot = true;
            if v.len() % 2 == 1 {
                return Err(fault(i, "has an odd number of coordinates"));
            }
            for p in v.chunks_exact(2) {
                let to = if self.is_relative { [self.at[0] + p[0], self.at[1] + p[1]] } else { [p[0], p[1]] };
                self.go(to)?;
            }
        }
        Ok(())
    }

    fn reset(&mut self, name: &str) {
        match name {
            "SC" => self.scale = [[1.0, 0.0]; 2],
            "IP" => self.corners = None,
            _ => {}
        }
    }

    fn scale_to(&mut self, i: &Instruction, [x0, x1, y0, y1]: [f64; 4]) -> Result<(), Fault> {
        let Some([a, b, c, d]) = self.corners else { return Err(page(i)) };
        let here = self.plotter_units(self.at);
        let axis = |lo: f64, hi: f64, p: f64, q: f64| [(q - p) / (hi - lo), p - lo * (q - p) / (hi - lo)];
        let scale = [axis(x0, x1, a, c), axis(y0, y1, b, d)];
        if scale.iter().any(|s| !(s[0].is_finite() && s[1].is_finite() && s[0] != 0.0)) {
            return Err(page(i));
        }
        self.scale = scale;
        self.at = [0, 1].map(|k| (here[k] - scale[k][1]) / scale[k][0]);
        Ok(())
    }

    fn plotter_units(&self, p: Point) -> Point {
        [0, 1].map(|k| self.scale[k][0] * p[k] + self.scale[k][1])
    }

    fn mm(&self, p: Point) -> Result<Point, Fault> {
        let p = self.plotter_units(p).map(|v| v * UNIT);
        if p.iter().all(|v| v.abs() <= MAX_MM) {
            return Ok(p);
        }
        Err(Diag::input("texture-far", "the plot reaches beyond any part").hint("check its coordinates").into())
    }

    /// Moves the pen, with a mark where it is down.
    fn go(&mut self, to: Point) -> Result<(), Fault> {
        let (from, end) = (self.mm(self.at)?, self.mm(to)?);
        self.at = to;
        if self.is_polygon {
            if let Some(ring) = self.polygon.last_mut() {
                ring.push(end);
            }
        } else if self.is_down {
            if self.stroke.is_empty() {
                self.stroke.push(from);
            }
            self.stroke.push(end);
        }
        self.count()
    }

    fn count(&self) -> Result<(), Fault> {
        let polygon: usize = if self.is_polygon { self.polygon.iter().map(Vec::len).sum() } else { 0 };
        if self.art.lines.points.len() + self.stroke.len() + polygon <= MAX_POINTS {
            return Ok(());
        }
        let text = format!("the plot has more than {MAX_POINTS} points");
        Err(Diag::limit("texture-large", text).hint("use a larger tolerance or a simpler plot").into())
    }

    /// Lifts the pen: what was drawn is a stroke.
    fn lift(&mut self) {
        self.end_stroke();
        self.is_down = false;
    }

    fn end_stroke(&mut self) {
        let mut stroke = std::mem::take(&mut self.stroke);
        stroke.dedup();
        self.shape(&[stroke], Figure::Lines);
    }

    fn shape(&mut self, lines: &[Vec<Point>], figure: Figure) {
        let first = self.art.lines.len();
        for line in lines {
            let [w, h] = extent(line);
            if line.len() > 1 && w.max(h) >= LEAST && self.pen > 0 {
                self.art.lines.push(line);
            }
        }
        if self.art.lines.len() == first {
            return;
        }
        if self.is_dashed && figure == Figure::Lines {
            self.note(Issue::Dash, self.pos);
            return self.forget(first);
        }
        if self.is_patterned && figure != Figure::Lines {
            self.note(Issue::Fill, self.pos);
            return self.forget(first);
        }
        let label = format!("pen:{}", self.pen);
        let known = self.art.labels.iter().position(|l| l.own[0] == label);
        let labels = known.unwrap_or_else(|| {
            self.art.labels.push(Labels { parent: None, own: vec![label] });
            self.art.labels.len() - 1
        });
        let number = self.art.shapes.len() + 1;
        self.art.names.push(format!("stroke {number}"));
        self.art.shapes.push(Shape {
            name: u32::try_from(number - 1).expect("fewer strokes than points"),
            labels: u32::try_from(labels).expect("fewer pens than strokes"),
            colour: colour(self.pen),
            opacity: 1.0,
            figure,
            lines: first..self.art.lines.len(),
            clip: None,
        });
    }

    /// Appends an arc round `centre` from `from`, in units of the plot, over an angle in rad.
    fn sweep(&mut self, centre: Point, from: Point, by: f64) -> Result<(), Fault> {
        let d = [from[0] - centre[0], from[1] - centre[1]];
        let radius = d[0].hypot(d[1]) * self.scale[0][0].abs().max(self.scale[1][0].abs()) * UNIT;
        let steps = steps(by * by * radius, self.tolerance, (by.abs() * 2.0).ceil().max(1.0));
        if steps > MAX_POINTS as f64 || steps.is_nan() {
            return Err(Diag::limit("texture-large", format!("an arc of the plot has more than {MAX_POINTS} points"))
                .hint("use a larger tolerance")
                .into());
        }
        for k in 1..=steps as usize {
            let (sin, cos) = (by * k as f64 / steps).sin_cos();
            self.go([centre[0] + cos * d[0] - sin * d[1], centre[1] + sin * d[0] + cos * d[1]])?;
        }
        Ok(())
    }

    fn arc(&mut self, centre: Point, degrees: f64) -> Result<(), Fault> {
        self.is_plot = true;
        // More than one turn marks nothing new.
        self.sweep(centre, self.at, degrees.clamp(-360.0, 360.0).to_radians())
    }

    fn circle(&mut self, r: f64) -> Result<(), Fault> {
        self.is_plot = true;
        let (centre, was_down) = (self.at, self.is_down);
        self.end_stroke();
        self.is_down = true;
        self.at = [centre[0] + r, centre[1]];
        if self.is_polygon {
            let start = self.mm(self.at)?;
            self.polygon.push(vec![start]);
        }
        self.sweep(centre, self.at, TAU)?;
        // Ends where it started, exactly.
        let list = if self.is_polygon { self.polygon.last_mut() } else { Some(&mut self.stroke) };
        if let Some([first, .., last]) = list.map(Vec::as_mut_slice) {
            *last = *first;
        }
        self.end_stroke();
        (self.at, self.is_down) = (centre, was_down);
        Ok(())
    }

    fn rectangle(&mut self, to: Point, is_filled: bool) -> Result<(), Fault> {
        self.is_plot = true;
        self.end_stroke();
        let [a, b] = [self.at, to];
        let mut ring = Vec::new();
        for p in [a, [b[0], a[1]], b, [a[0], b[1]], a] {
            ring.push(self.mm(p)?);
        }
        self.shape(&[ring], if is_filled { Figure::Fill(Rule::EvenOdd) } else { Figure::Lines });
        Ok(())
    }

    fn polygon_mode(&mut self, mode: f64) {
        self.end_stroke();
        self.is_plot = true;
        match mode {
            0.0 => {
                let start = self.mm(self.at).unwrap_or_default();
                (self.polygon, self.is_polygon) = (vec![vec![start]], true);
            }
            1.0 => self.polygon.push(Vec::new()),
            _ => self.is_polygon = false,
        }
    }

    fn closed(&self) -> Vec<Vec<Point>> {
        let mut rings = self.polygon.clone();
        for ring in &mut rings {
            ring.dedup();
            if ring.first() != ring.last() {
                ring.extend(ring.first().copied());
            }
        }
        rings
    }

    fn edge(&mut self) {
        let rings = self.closed();
        self.shape(&rings, Figure::Lines);
    }

    fn fill(&mut self) {
        let rings = self.closed();
        self.shape(&rings, Figure::Fill(Rule::EvenOdd));
    }

    /// An encoded polyline: numbers in base 64, or 32 after `7`, low digits first; `<` lifts the pen for one move, `=`
    /// makes one absolute, `:` names a pen, `>` the number of binary digits after the point.
    fn encoded(&mut self, i: &Instruction) -> Result<(), Fault> {
        self.is_plot = true;
        self.lift();
        let (mut bits, mut places, mut is_up, mut is_absolute) = (6u32, 0i32, false, false);
        let mut at = 0;
        let number = |at: &mut usize, bits: u32| -> Result<f64, Fault> {
            let (mut value, mut shift, base) = (0u64, 0u32, 1u64 << bits);
            while let Some(&b) = i.code.get(*at) {
                *at += 1;
                // Terminal digits begin at 191 (base 64) or 95 (base 32), others at 63.
                let (digit, is_last) = match (bits, b) {
                    (6, 191..=254) => (u64::from(b - 191), true),
                    (6, 63..=126) | (5, 63..=94) => (u64::from(b - 63), false),
                    (5, 95..=126) => (u64::from(b - 95), true),
                    _ => continue,
                };
                if shift > 48 {
                    return Err(fault(i, "has a number that is too long"));
                }
                value += digit * base.pow(shift / bits);
                shift += bits;
                if is_last {
                    let half = (value >> 1) as f64;
                    return Ok(if value & 1 == 1 { -half } else { half });
                }
            }
            Err(fault(i, "ends within a number"))
        };
        while at < i.code.len() {
            match i.code[at] {
                b'7' => bits = 5,
                b'<' => is_up = true,
                b'=' => is_absolute = true,
                b'>' => {
                    at += 1;
                    places = number(&mut at, bits)?.clamp(-26.0, 26.0) as i32;
                    continue;
                }
                b':' => {
                    at += 1;
                    let pen = number(&mut at, bits)? as i64;
                    self.end_stroke();
                    self.pen = pen;
                    continue;
                }
                63.. => {
                    let factor = 2f64.powi(-places);
                    let p = [number(&mut at, bits)? * factor, number(&mut at, bits)? * factor];
                    let to = if is_absolute { p } else { [self.at[0] + p[0], self.at[1] + p[1]] };
                    if is_up {
                        self.lift();
                    }
                    self.is_down = !is_up;
                    self.go(to)?;
                    (is_up, is_absolute) = (false, false);
                    continue;
                }
                _ => {}
            }
            at += 1;
        }
        Ok(())
    }

    fn note(&mut self, issue: Issue, at: usize) {
        self.issues.entry(issue).or_insert((0, at)).0 += 1;
    }

    /// Takes back the lines from `first` on.
    fn forget(&mut self, first: usize) {
        self.art.lines.truncate(first);
    }

    /// What is not read: errors, or warnings where the job leaves it out.
    fn messages(&self, path: &str, marking: &Marking) -> Vec<Diag> {
        let place = |at: usize| Place::Element { path: path.to_owned(), element: format!("at byte {at}") };
        let mut out: Vec<Diag> = Vec::new();
        let mut add = |d: [Diag; 2], at: usize, hint: &str| {
            let [error, warning] = d;
            out.push(match marking.is_lenient {
                true => warning.at(place(at)).hint(hint),
                false => error.at(place(at)).hint(format!("{hint}, or leave it out with on_unsupported = \"warn\"")),
            });
        };
        for (issue, &(n, at)) in &self.issues {
            match issue {
                Issue::Label => {
                    let text = format!("the plot has labels or symbols ({n})");
                    let hint = "convert text to lines in the drawing program";
                    add([Diag::input("hpgl-text", &text), Diag::warning("hpgl-text", &text)], at, hint);
                }
                Issue::Dash => {
                    let text = format!("the plot has dashed lines ({n})");
                    add([Diag::input("hpgl-dash", &text), Diag::warning("hpgl-dash", &text)], at, "draw solid lines");
                }
                Issue::Fill => {
                    let text = format!("the plot has areas filled by a pattern ({n})");
                    let hint = "fill them solid and hatch them by the job";
                    add([Diag::input("hpgl-fill", &text), Diag::warning("hpgl-fill", &text)], at, hint);
                }
            }
        }
        if let Some((_, &(_, at))) = self.unread.first_key_value() {
            let list: Vec<String> =
                self.unread.iter().take(40).map(|(name, (n, at))| format!("{n} {name} (first at byte {at})")).collect();
            let text = format!("instructions are not read: {}", list.join(", "));
            let hint = "write the plot with lines alone (PU, PD, PA, PR)";
            add([Diag::input("hpgl-unread", &text), Diag::warning("hpgl-unread", &text)], at, hint);
        }
        out
    }
}

fn colour(pen: i64) -> Colour {
    const PENS: [Colour; 7] =
        [[0; 3], [255, 0, 0], [0, 255, 0], [255, 255, 0], [0, 0, 255], [255, 0, 255], [0, 255, 255]];
    PENS[(pen - 1).rem_euclid(7) as usize]
}

fn fault(i: &Instruction, what: &str) -> Fault {
    let text = format!("{} at byte {} {what}", i.name, i.at);
    Diag::input("hpgl-syntax", text).hint("write the plot again as HPGL (PLT)").into()
}

fn page(i: &Instruction) -> Fault {
    let text = format!("{} at byte {} turns or scales the page in a way that is not read", i.name, i.at);
    Diag::input("hpgl-page", text).hint("write the plot in plotter units, without SC, IP, IW and RO").into()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn loaded(text: &[u8]) -> (Result<Artwork, Error>, Vec<&'static str>) {
        let mut notes = Vec::new();
        let lenient = Marking { is_lenient: true, ..Marking::default() };
        let art = load(text, Path::new("a.plt"), 1e-3, &lenient, &mut notes);
        (art, notes.iter().map(|n| n.code).collect())
    }

    fn lines(text: &str) -> Vec<Vec<Point>> {
        let (art, notes) = loaded(text.as_bytes());
        assert!(notes.is_empty(), "{text}: {notes:?}");
        let art = art.expect("read");
        let corner = art.corner.expect("a corner");
        let round = |v: f64| (v * 1e9).round() / 1e9;
        let line = |l: &[Point]| l.iter().map(|p| [0, 1].map(|k| round(p[k] + corner[k]))).collect();
        art.lines.iter().map(line).collect()
    }

    #[test]
    fn strokes_are_those_of_the_pen() {
        let square = vec![vec![[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]]];
        for text in [
            "IN;SP1;PU0,0;PD40,0,40,40;PU;",
            "\x1b%0BINSP1PU0 0PD40 0PD40 40PU",
            // Numbers outside of an instruction belong to none.
            "IN;SP1;PA0,0;PD;PR40,0;0,40;PR0,40;PU",
            "in sp1 pa pd40,0;pd40,40;",
            "\x1b.@;0:SP1;IP0,0,400,400;SC0,10,0,10;PU0,0;PD1,0,1,1;",
            // Base 32: 40 is 80 = 16 + 2 * 32.
            "SP1;PU0,0;PE7Oa__Oa;",
            "SP1;PE7<=Oa_<=__Oa__Oa;",
        ] {
            assert_eq!(lines(text), square, "{text:?}");
        }
    }

    #[test]
    fn curves_keep_the_tolerance_and_close() {
        let found = lines("SP2;PA400,0;CI400;");
        let circle = &found[0];
        assert_eq!(circle.first(), circle.last());
        assert!(circle.iter().all(|p| ((p[0] - 10.0).hypot(p[1]) - 10.0).abs() < 1e-8));
        let sag = |w: &[Point]| 10.0 - ((w[0][0] + w[1][0]) / 2.0 - 10.0).hypot((w[0][1] + w[1][1]) / 2.0);
        assert!(circle.windows(2).map(sag).fold(0.0, f64::max) <= 1e-3);
        let arc = &lines("SP1;PA40,0;PD;AA0,0,90;PU")[0];
        assert!((arc[0], arc[arc.len() - 1]) == ([1.0, 0.0], [0.0, 1.0]), "{arc:?}");
    }

    #[test]
    fn pens_fills_and_faults_are_told() {
        let (art, notes) =
            loaded(b"SP2;PA0,0;PM0;PA40,0,40,40;PM1;PA10,0,10,10,20,10;PM2;FP;SP9;EA80,80;LBtext\x03XX1;LT2;PD9,9");
        let art = art.expect("read");
        let shown: Vec<_> =
            art.shapes.iter().map(|s| (s.figure, s.colour, art.labels[s.labels as usize].own[0].as_str())).collect();
        let fill = Figure::Fill(Rule::EvenOdd);
        assert_eq!(shown[..2], [(fill, [255, 0, 0], "pen:2"), (Figure::Lines, [255, 0, 0], "pen:9")]);
        assert_eq!(art.shapes[0].lines.len(), 2);
        assert_eq!(notes, ["hpgl-text", "hpgl-dash", "hpgl-unread"]);
        for (text, code) in [
            ("SP1;PD1.2.3,4", "hpgl-syntax"),
            ("SP1;PD1,2,3", "hpgl-syntax"),
            ("SP1;RO90;PD1,2", "hpgl-page"),
            ("SP1;SC0,1,0,1;PD1,2", "hpgl-page"),
            ("SP1;PD1,99999999999999999999999", "texture-far"),
            ("SP1;PD;CI99999999999;", "texture-far"),
            ("<svg>not a plot</svg>", "hpgl-syntax"),
            ("", "hpgl-syntax"),
        ] {
            let e = loaded(text.as_bytes()).0.err().unwrap_or_else(|| panic!("{text} is read"));
            assert_eq!(e.diags()[0].code, code, "{text}: {e}");
        }
    }
}
