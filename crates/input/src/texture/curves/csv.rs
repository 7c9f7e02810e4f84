//! Space curves as text: rows of x, y and z, or of id, x, y and z.
//!
//! Columns are separated by commas, semicolons, tabs or blanks, one kind per file. One row of names may come first;
//! it may name x, y, z and id in any order, and columns of other names are left out. A curve ends at an empty row or
//! where the id changes. A `#` at the start of a row or after a blank begins a comment. Cost: the points, and a name
//! for each curve.

use std::collections::HashMap;
use std::ops::Range;
use std::path::Path;

use crate::texture::artwork::{Artwork, Labels, MAX_MM, MAX_POINTS, PaintedShape, ShapeFigure};
use crate::texture::clip::{Polylines, extent};
use crate::texture::place::LEAST;
use terrace_core::diag::{self, Diag, Place, memory};

/// Memory for each byte of a file: curves of two rows of 8 bytes with ids of their own take some 400, here and once
/// placed.
const MEMORY: u64 = 24;

/// Reads curves in mm; a unit of the file measures `unit_mm`.
///
/// # Errors
/// `curve-format`, `curve-columns`, `curve-number`, `texture-far`, `texture-large`, `memory`.
pub(super) fn read(bytes: &[u8], path: &Path, unit_mm: f64, notes: &mut Vec<Diag>) -> Result<Artwork, Box<Diag>> {
    memory::ask("the curves", MEMORY * bytes.len() as u64)?;
    let file = path.display().to_string();
    let text = match std::str::from_utf8(bytes) {
        Ok(text) => text,
        Err(_) => {
            let described = diag::utf8(bytes.to_vec()).map_or_else(|e| e.to_string(), |_| String::new());
            let d = Diag::input("curve-format", format!("the file is {described}")).at(Place::file(file));
            return Err(d.hint("write the curves as CSV with columns x, y, z in UTF-8, or as DXF").into());
        }
    };
    let mut reader =
        CsvReader { file, unit_mm, art: Artwork::default(), labels: HashMap::new(), id: None, first_row: 0 };
    reader.art.lines = Polylines::in_space();
    let mut columns: Option<CsvColumns> = None;
    let mut extentless = ExtentlessCurves::default();
    for (number, row) in (1..).zip(text.strip_prefix('\u{feff}').unwrap_or(text).lines()) {
        let content = without_comment(row).trim();
        if content.is_empty() {
            // A row that holds a comment alone ends nothing.
            if row.trim().is_empty() {
                reader.end(&mut extentless);
            }
            continue;
        }
        match &columns {
            Some(columns) => reader.row(content, number, columns, &mut extentless)?,
            None => {
                let first = reader.columns(content, number, notes)?;
                if !first.is_named {
                    reader.row(content, number, &first, &mut extentless)?;
                }
                columns = Some(first);
            }
        }
    }
    reader.end(&mut extentless);
    notes.extend(extentless.message(&reader.file));
    Ok(reader.art)
}

/// A row up to its comment.
fn without_comment(row: &str) -> &str {
    // Behind anything but a blank it is part of a field.
    let begins_comment = |&(at, _): &(usize, &str)| row[..at].chars().next_back().is_none_or(char::is_whitespace);
    row.match_indices('#').find(begins_comment).map_or(row, |(at, _)| &row[..at])
}

/// A field without blanks and quotes around it.
fn unquoted(field: &str) -> &str {
    let text = field.trim();
    text.strip_prefix('"').and_then(|t| t.strip_suffix('"')).unwrap_or(text)
}

/// A field as far as a message shows it.
fn shortened(field: &str) -> String {
    field.chars().take(40).collect()
}

/// What the columns of a file hold.
struct CsvColumns {
    separator: Separator,
    count: usize,
    /// Indices of x, y and z.
    xyz: [usize; 3],
    id: Option<usize>,
    /// Whether the row that named them was one of names.
    is_named: bool,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Separator {
    Char(char),
    Blanks,
}

impl Separator {
    /// The separator of a row.
    fn of(row: &str) -> Self {
        [';', ',', '\t'].into_iter().find(|&c| row.contains(c)).map_or(Self::Blanks, Self::Char)
    }

    /// Calls `f` with the index and the text of each field; returns their number.
    fn fields<'a>(self, row: &'a str, mut f: impl FnMut(usize, &'a str)) -> usize {
        let mut count = 0;
        let mut next = |field: &'a str| {
            f(count, unquoted(field));
            count += 1;
        };
        match self {
            Self::Char(c) => row.split(c).for_each(&mut next),
            Self::Blanks => row.split_whitespace().for_each(&mut next),
        }
        count
    }
}

/// Curves without extent in plan.
#[derive(Default)]
struct ExtentlessCurves {
    count: usize,
    first: String,
}

impl ExtentlessCurves {
    fn message(self, file: &str) -> Option<Diag> {
        (self.count > 0).then(|| {
            let text = format!(
                "curves without extent as seen from the lens are not marked ({}, first {})",
                self.count, self.first
            );
            let hint = "rows of a curve follow each other without an empty row or another id between them";
            Diag::warning("curve-dot", text).at(Place::file(file)).hint(hint)
        })
    }
}

struct CsvReader {
    file: String,
    unit_mm: f64,
    art: Artwork,
    /// Sets of labels by id.
    labels: HashMap<String, u32>,
    /// The id of the curve at hand.
    id: Option<String>,
    /// The number of its first row.
    first_row: usize,
}

type RowResult = Result<(), Box<Diag>>;

impl CsvReader {
    /// What the first row says of the columns.
    fn columns(&self, row: &str, number: usize, notes: &mut Vec<Diag>) -> Result<CsvColumns, Box<Diag>> {
        let separator = Separator::of(row);
        let mut fields = Vec::new();
        let count = separator.fields(row, |i, field| {
            if i < Self::COLUMNS {
                fields.push(field);
            }
        });
        let is_number = |i: usize| fields.get(i).is_some_and(|f| f.parse::<f64>().is_ok());
        for first in [0, 1] {
            if count == first + 3 && (first..count).all(is_number) {
                let xyz = [first, first + 1, first + 2];
                return Ok(CsvColumns { separator, count, xyz, id: (first == 1).then_some(0), is_named: false });
            }
        }
        let named = |name: &str| fields.iter().position(|f| f.eq_ignore_ascii_case(name));
        let (Some(x), Some(y), Some(z)) = (named("x"), named("y"), named("z")) else {
            let text = "the first row is neither x, y, z nor id, x, y, z, nor names these columns";
            let d = Diag::input("curve-columns", text).hint("write a first row such as id,x,y,z");
            return Err(self.at(d, number));
        };
        let id = named("id");
        let used = [Some(x), Some(y), Some(z), id];
        let others = (0..fields.len()).filter(|i| !used.contains(&Some(*i)));
        let others: Vec<String> = others.map(|i| shortened(fields[i])).take(Self::LISTED).collect();
        if !others.is_empty() {
            let text = format!("columns other than id, x, y and z are not used: {}", others.join(", "));
            notes.push(Diag::warning("curve-columns", text).at(Place::line(&self.file, number)).hint("leave them out"));
        }
        Ok(CsvColumns { separator, count, xyz: [x, y, z], id, is_named: true })
    }

    /// Most columns that are looked at, and most that a message lists.
    const COLUMNS: usize = 1000;
    const LISTED: usize = 12;

    /// Takes a row of numbers, the `number`-th of the file: another point of the curve, or the first of the next.
    fn row(&mut self, row: &str, number: usize, columns: &CsvColumns, extentless: &mut ExtentlessCurves) -> RowResult {
        let mut xyz = [""; 3];
        let mut id = None;
        let count = columns.separator.fields(row, |i, field| {
            if let Some(k) = columns.xyz.iter().position(|&c| c == i) {
                xyz[k] = field;
            } else if columns.id == Some(i) {
                id = Some(field);
            }
        });
        if count != columns.count {
            let text = format!("the row has {count} columns, those before have {}", columns.count);
            let d = Diag::input("curve-columns", text).hint("give every row the same columns");
            return Err(self.at(d, number));
        }
        let mut point = [0.0; 3];
        for (value, field) in point.iter_mut().zip(xyz) {
            *value = self.coordinate(field, number)?;
        }
        if self.art.lines.points.len() >= MAX_POINTS {
            let text = format!("the file has more than {MAX_POINTS} points");
            return Err(self.at(Diag::limit("texture-large", text).hint("split it into several textures"), number));
        }
        if id != self.id.as_deref() {
            self.end(extentless);
            self.id = id.map(str::to_owned);
        }
        // The curve at hand has no point yet.
        if self.art.lines.points.len() == self.art.lines.tail() {
            self.first_row = number;
        }
        self.art.lines.put(point);
        Ok(())
    }

    /// A field of row `number` as a coordinate, mm.
    fn coordinate(&self, field: &str, number: usize) -> Result<f64, Box<Diag>> {
        let value = field.parse::<f64>().ok().filter(|v| v.is_finite()).ok_or_else(|| {
            let d = Diag::input("curve-number", format!("{:?} is not a number", shortened(field)));
            self.at(d.hint("write numbers such as 12.5, with a point"), number)
        })?;
        let mm = value * self.unit_mm;
        if mm.abs() <= MAX_MM {
            return Ok(mm);
        }
        let d = Diag::input("texture-far", format!("{value} reaches beyond any part"));
        Err(self.at(d.hint("check the unit of the curves"), number))
    }

    /// Ends the curve at hand, if it has begun: it becomes a shape, or is only counted where it has no extent in plan.
    fn end(&mut self, extentless: &mut ExtentlessCurves) {
        let id = self.id.take();
        let lines = &mut self.art.lines;
        let first_row = self.first_row;
        let begun: Range<usize> = lines.tail()..lines.points.len();
        if begun.is_empty() {
            return;
        }
        let name = match id.as_ref().filter(|id| !id.is_empty()) {
            Some(id) => format!("curve {id} (line {first_row})"),
            None => format!("curve of line {first_row}"),
        };
        let [w, h] = extent(&lines.points[begun]);
        if w.max(h) < LEAST {
            // Takes back the points that no finished line has.
            lines.truncate(lines.len());
            if extentless.count == 0 {
                extentless.first = name;
            }
            extentless.count += 1;
            return;
        }
        lines.finish();
        let line = lines.len() - 1;
        // A curve without an id has no label: its id counts as empty.
        let labels = self.labels(id.unwrap_or_default());
        let names = &mut self.art.names;
        names.push(name);
        self.art.shapes.push(PaintedShape {
            name: u32::try_from(names.len() - 1).expect("fewer curves than points"),
            labels,
            colour: [0; 3],
            opacity: 1.0,
            figure: ShapeFigure::Lines,
            lines: line..line + 1,
            clip: None,
        });
    }

    /// The set of labels of an id.
    fn labels(&mut self, id: String) -> u32 {
        let sets = &mut self.art.labels;
        *self.labels.entry(id).or_insert_with_key(|id| {
            let own = if id.is_empty() { Vec::new() } else { vec![format!("id:{id}")] };
            sets.push(Labels { parent: None, own });
            u32::try_from(sets.len() - 1).expect("fewer ids than points")
        })
    }

    /// A fault at row `number`.
    fn at(&self, d: Diag, number: usize) -> Box<Diag> {
        Box::new(d.at(Place::line(&self.file, number)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    type Curve = (String, Vec<[f64; 3]>);

    fn read_text(text: &str) -> Result<(Vec<Curve>, Vec<Diag>), Box<Diag>> {
        let mut notes = Vec::new();
        let art = read(text.as_bytes(), Path::new("c.csv"), 1.0, &mut notes)?;
        let curve = |s: &PaintedShape| {
            let i = s.lines.start;
            let points = art.lines.get(i).iter().zip(art.lines.heights(i)).map(|(&[x, y], &z)| [x, y, z]);
            (art.names[s.name as usize].clone(), points.collect())
        };
        Ok((art.shapes.iter().map(curve).collect(), notes))
    }

    const A: [[f64; 3]; 2] = [[0.0, 0.0, 1.0], [1.5, 0.0, -2.0]];
    const B: [[f64; 3]; 2] = [[3.0, 4.0, 5.0], [6.0, 7.0, 8.0]];

    #[test]
    fn forms_of_rows_give_the_same_curves() {
        for text in [
            "0,0,1\n1.5,0,-2\n\n3,4,5\n6,7,8\n",
            "x,y,z\r\n0,0,1\r\n1.5,0,-2\r\n\r\n\r\n3,4,5\r\n6,7,8",
            "\u{feff}Z;X;Y\n1;0;0\n-2;1.5;0\n;;\n".replace(";;\n", "\n5;3;4\n8;6;7\n").as_str(),
            "# made by hand\n0 0 1\n# the same curve\n  1.5\t0 -2\n\n3 4 5 # a corner\n6 7 8\n",
            "0\t0\t1\n1.50e0\t0\t-2\n \n3\t4\t5\n6\t7\t8\n",
        ] {
            let (curves, notes) = read_text(text).unwrap_or_else(|d| panic!("{text:?}: {d}"));
            let points: Vec<_> = curves.iter().map(|c| c.1.as_slice()).collect();
            assert_eq!((points, notes), (vec![&A[..], &B[..]], Vec::new()), "{text:?}");
        }
    }

    #[test]
    fn curves_end_where_the_id_changes_and_are_named_by_it() {
        for text in ["a,0,0,1\na,1.5,0,-2\nb,3,4,5\nb,6,7,8\n", "x,y,z,ID\n0,0,1,a\n1.5,0,-2,a\n3,4,5,\"b\"\n6,7,8,b\n"]
        {
            let (curves, _) = read_text(text).unwrap_or_else(|d| panic!("{text:?}: {d}"));
            let first = if text.starts_with('x') { 2 } else { 1 };
            let names = [format!("curve a (line {first})"), format!("curve b (line {})", first + 2)];
            assert_eq!(curves, [(names[0].clone(), A.to_vec()), (names[1].clone(), B.to_vec())]);
        }
        let (curves, _) = read_text("FSS#1,0,0,1\nFSS#1,1.5,0,-2 # its end\n").expect("read");
        assert_eq!(curves, [("curve FSS#1 (line 1)".to_owned(), A.to_vec())]);
        // An empty row divides what has one id.
        let (curves, _) = read_text("a,0,0,1\na,1.5,0,-2\n\na,3,4,5\na,6,7,8\n").expect("read");
        assert_eq!(curves[1], ("curve a (line 4)".to_owned(), B.to_vec()));
    }

    #[test]
    fn what_is_not_a_curve_is_reported_and_other_columns_too() {
        let (curves, notes) = read_text("id,x,y,z,nx\na,1,2,3,0\nb,0,0,1,0\nb,1.5,0,-2,0\nc,1,1,1,0\nc,1,1,2,0\n")
            .unwrap_or_else(|d| panic!("{d}"));
        assert_eq!(curves.len(), 1);
        let described: Vec<_> = notes.iter().map(|d| (d.code, d.message.as_str())).collect();
        assert_eq!(described[0], ("curve-columns", "columns other than id, x, y and z are not used: nx"));
        assert_eq!(described[1].0, "curve-dot");
        assert!(described[1].1.ends_with("(2, first curve a (line 2))"), "{}", described[1].1);
    }

    #[test]
    fn faults_have_their_code_and_line() {
        for (text, code, line) in [
            ("1,2\n", "curve-columns", 1),
            ("# c\n\na,b,c\n", "curve-columns", 3),
            ("1,2,3,4,5\n", "curve-columns", 1),
            ("1,2,3\n1,2\n", "curve-columns", 2),
            ("1,2,3\n1 2 3\n", "curve-columns", 2),
            ("1;2;3\n1,5;2;3\n", "curve-number", 2),
            ("x,y,z\n1,2,nan\n", "curve-number", 2),
            ("x,y,z\n1,2,1e999\n", "curve-number", 2),
            ("x,y,z\n1,2,\n", "curve-number", 2),
            ("1,2,3\n1,2,3e9\n", "texture-far", 2),
        ] {
            let d = read_text(text).expect_err(text);
            assert_eq!((d.code, d.place), (code, Place::line("c.csv", line)), "{text:?}");
        }
        let d = read(b"\xff\xfe1,2,3", Path::new("c.csv"), 1.0, &mut Vec::new()).expect_err("not text");
        assert_eq!(d.code, "curve-format");
    }
}
