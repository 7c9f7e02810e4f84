//! Space curves as their file has them, by a reader of the verifier's own.
//!
//! Consumes a CSV, or a DXF of lines, 3D polylines and level light polylines; returns the curves in the order of
//! the file, mm. A DXF with anything else that could be drawn, such as arcs, blocks or hidden layers, is not read.

use std::path::Path;

use terrace_core::diag;

/// Largest file that is read.
const MAX_FILE: u64 = 1 << 30;

/// The points of a curve, mm.
pub(crate) type Curve = Vec<[f64; 3]>;

/// The curves of a file; None where it is not read here. `unit_mm` is what the job says a unit is.
pub(crate) fn read(path: &Path, unit_mm: Option<f64>) -> Option<Vec<Curve>> {
    let bytes = diag::read_file(path, MAX_FILE).ok()?;
    let text = String::from_utf8_lossy(&bytes);
    let is_dxf = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("dxf"));
    if is_dxf { Drawing::read(&text, unit_mm) } else { rows(text.trim_start_matches('\u{feff}'), unit_mm?) }
}

/// Rows of x, y, z or id, x, y, z.
fn rows(text: &str, unit_mm: f64) -> Option<Vec<Curve>> {
    // Which fields are x, y, z and the id.
    let mut fields: Option<([usize; 3], Option<usize>)> = None;
    let mut curves: Vec<Curve> = Vec::new();
    let (mut last, mut is_new) = (String::new(), true);
    for line in text.split('\n') {
        let words = words(line);
        if words.is_empty() {
            is_new |= line.trim().is_empty();
            continue;
        }
        let at = match fields {
            Some(at) => at,
            None => {
                let numbers = words.iter().rev().take_while(|w| w.parse::<f64>().is_ok()).count();
                if numbers >= 3 && words.len() <= 4 {
                    let first = words.len() - 3;
                    *fields.insert(([first, first + 1, first + 2], (first == 1).then_some(0)))
                } else {
                    let named = |name: &str| words.iter().position(|w| w.to_lowercase() == name);
                    fields = Some(([named("x")?, named("y")?, named("z")?], named("id")));
                    continue;
                }
            }
        };
        let id = at.1.map_or("", |i| words.get(i).copied().unwrap_or_default());
        if is_new || id != last {
            curves.push(Curve::new());
            (last, is_new) = (id.to_owned(), false);
        }
        let mut point = [0.0; 3];
        for (value, i) in point.iter_mut().zip(at.0) {
            *value = words.get(i)?.parse::<f64>().ok()? * unit_mm;
        }
        curves.last_mut()?.push(point);
    }
    Some(curves)
}

/// The fields of a row without its comment, which a # begins that is the first character or follows white space. They
/// are divided by the first of semicolon, comma and tab that the row has, else by white space.
fn words(line: &str) -> Vec<&str> {
    let mut end = line.len();
    let mut before = ' ';
    for (at, c) in line.char_indices() {
        if c == '#' && before.is_whitespace() {
            end = at;
            break;
        }
        before = c;
    }
    let line = line[..end].trim();
    if line.is_empty() {
        return Vec::new();
    }
    let between = if line.contains(';') {
        ";"
    } else if line.contains(',') {
        ","
    } else if line.contains('\t') {
        "\t"
    } else {
        return line.split_whitespace().collect();
    };
    line.split(between).map(|w| w.trim().trim_matches('"')).collect()
}

/// A DXF while it is read.
#[derive(Default)]
struct Drawing {
    /// By $INSUNITS.
    unit_mm: Option<f64>,
    curves: Vec<Curve>,
    /// The polyline whose vertices follow, and whether it is closed.
    open: Option<(Curve, bool)>,
}

/// A record: what begins with a group code 0.
struct Record<'a> {
    kind: &'a str,
    tags: Vec<(i32, &'a str)>,
}

impl Record<'_> {
    fn all(&self, code: i32) -> impl Iterator<Item = &str> {
        self.tags.iter().filter(move |t| t.0 == code).map(|t| t.1)
    }

    /// The number of a group code, 0 where there is none; None where it is not a number.
    fn number(&self, code: i32) -> Option<f64> {
        self.all(code).next().map_or(Some(0.0), |v| v.parse().ok())
    }

    fn flags(&self) -> Option<i64> {
        self.all(70).next().map_or(Some(0), |v| v.parse().ok())
    }

    fn point(&self, code: i32) -> Option<[f64; 3]> {
        Some([self.number(code)?, self.number(code + 10)?, self.number(code + 20)?])
    }
}

impl Drawing {
    fn read(text: &str, unit_mm: Option<f64>) -> Option<Vec<Curve>> {
        let mut lines = text.lines();
        let mut records: Vec<Record<'_>> = Vec::new();
        while let (Some(code), Some(value)) = (lines.next(), lines.next()) {
            let (code, value) = (code.trim().parse::<i32>().ok()?, value.trim());
            match records.last_mut() {
                _ if code == 0 => records.push(Record { kind: value, tags: Vec::new() }),
                Some(record) => record.tags.push((code, value)),
                None => {}
            }
        }
        let mut drawing = Self::default();
        let mut section = "";
        for record in &records {
            match (record.kind, section) {
                ("SECTION", _) => {
                    section = record.all(2).next()?;
                    if section == "HEADER" {
                        drawing.header(record)?;
                    }
                }
                ("ENDSEC", _) => section = "",
                ("LAYER", "TABLES") => {
                    let is_plain = record.all(6).all(|t| t.eq_ignore_ascii_case("CONTINUOUS"));
                    if record.flags()? & 1 != 0 || record.number(62)? < 0.0 || !is_plain {
                        return None;
                    }
                }
                (_, "ENTITIES") => drawing.entity(record)?,
                _ => {}
            }
        }
        let unit = drawing.unit_mm.or(unit_mm)?;
        drawing.curves.iter_mut().flatten().flatten().for_each(|v| *v *= unit);
        Some(drawing.curves)
    }

    fn header(&mut self, record: &Record<'_>) -> Option<()> {
        let at = record.tags.iter().position(|&(code, v)| code == 9 && v == "$INSUNITS");
        let Some((_, value)) = at.and_then(|at| record.tags.get(at + 1)) else { return Some(()) };
        self.unit_mm = match value.parse::<i64>().ok()? {
            0 => None,
            1 => Some(25.4),
            4 => Some(1.0),
            5 => Some(10.0),
            6 => Some(1000.0),
            13 => Some(1e-3),
            _ => return None,
        };
        Some(())
    }

    fn entity(&mut self, r: &Record<'_>) -> Option<()> {
        // Line types, invisible entities and paper space.
        if [6, 60, 67].iter().any(|&code| r.all(code).next().is_some()) {
            return None;
        }
        match r.kind {
            "LINE" => self.curves.push(vec![r.point(10)?, r.point(11)?]),
            "POLYLINE" => {
                const CLOSED: i64 = 1;
                const SPATIAL: i64 = 8;
                let flags = r.flags()?;
                if flags & !CLOSED != SPATIAL {
                    return None;
                }
                self.open = Some((Curve::new(), flags & CLOSED != 0));
            }
            "VERTEX" => {
                if r.flags()? & 16 != 0 {
                    return None;
                }
                self.open.as_mut()?.0.push(r.point(10)?);
            }
            "SEQEND" => {
                let (points, is_closed) = self.open.take()?;
                self.finish(points, is_closed);
            }
            "LWPOLYLINE" => {
                let is_level =
                    r.number(210)? == 0.0 && r.number(220)? == 0.0 && r.all(230).all(|z| z.parse() == Ok(1.0));
                let is_plain = [40, 41, 42, 43].iter().all(|&code| r.all(code).all(|v| v.parse() == Ok(0.0)));
                if !(is_level && is_plain) {
                    return None;
                }
                let z = r.number(38)?;
                let points = r.all(10).zip(r.all(20)).map(|(x, y)| Some([x.parse().ok()?, y.parse().ok()?, z]));
                let points = points.collect::<Option<Curve>>()?;
                self.finish(points, r.flags()? & 1 != 0);
            }
            _ => return None,
        }
        Some(())
    }

    fn finish(&mut self, mut points: Curve, is_closed: bool) {
        if is_closed && points.len() > 1 {
            points.extend(points.first().copied());
        }
        self.curves.push(points);
    }
}
