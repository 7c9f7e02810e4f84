//! The rows of a file: what stands before the points, and what each row is.
//!
//! Before the points may stand comments, a row of names, the separator of a spreadsheet (`sep=;`), the number of points
//! (PTS, CloudCompare), or the head of a PTX scan: columns, rows, the place of the scanner in four rows of three
//! numbers, and a matrix of four rows of four that every point goes through.

use std::path::Path;

use super::super::facets::Unit;
use super::super::lines::{Lines, number, shown};
use super::super::stated_unit::StatedUnit;
use super::cloud::Cloud;
use super::columns::{Separator, fields, unquoted};
use super::layout::{Layout, is_names};
use super::{MAX_POINTS, Point};
use terrace_core::diag::{Diag, Error, Place};
use terrace_core::geom::Pose;

/// Comments that are looked at for names.
const MAX_COMMENTS: usize = 100;

/// Reads the rows of a file.
pub(super) struct Rows<'a> {
    path: &'a Path,
    cloud: Cloud,
    stated: StatedUnit,
    separator: Option<Separator>,
    comments: Vec<(Vec<u8>, Place)>,
    names: Option<(Vec<u8>, Place)>,
    layout: Option<Layout>,
    count: Count,
    scan: Option<Scan>,
    ids: Option<Ids>,
}

impl<'a> Rows<'a> {
    pub(super) fn new(path: &'a Path, unit: Unit, pose: Option<Pose>) -> Self {
        Self {
            path,
            cloud: Cloud::new(unit, pose),
            stated: StatedUnit::new(unit),
            separator: None,
            comments: Vec::new(),
            names: None,
            layout: None,
            count: Count::default(),
            scan: None,
            ids: None,
        }
    }

    /// Takes a line.
    pub(super) fn line(&mut self, lines: &Lines, notes: &mut Vec<Diag>) -> Result<(), Error> {
        let line = lines.line().trim_ascii();
        if line.is_empty() {
            return Ok(());
        }
        if is_comment(line) || self.layout.is_none() && is_semicolon_comment(line) {
            self.comment(line, lines);
            return Ok(());
        }
        let here = |d: Diag| d.at(lines.place());
        if let Some(n) = whole(line).filter(|_| self.may_count()) {
            return self.counted(n, lines).map_err(|d| here(d).into());
        }
        if let Some(scan) = self.scan.as_mut().filter(|scan| scan.head < Scan::HEAD) {
            return scan.head(line).map_err(|d| here(d).into());
        }
        if self.layout.is_none() {
            if let Some(separator) = Separator::stated(line) {
                self.separator = Some(separator);
                return Ok(());
            }
            if self.names.is_none() && self.scan.is_none() && is_names(line, self.separator) {
                self.names = Some((line.to_vec(), lines.place()));
                return Ok(());
            }
            self.begin(line, lines, notes)?;
        }
        self.point(line, lines)
    }

    /// Whether a row of one whole number states how many rows follow: the first, and one behind those that were stated.
    fn may_count(&self) -> bool {
        match &self.scan {
            Some(scan) => scan.head >= Scan::HEAD && scan.left == 0,
            None => self.layout.is_none() || self.count.is_complete(),
        }
    }

    fn counted(&mut self, n: u64, lines: &Lines) -> Result<(), Diag> {
        if let Some(scan) = &mut self.scan {
            // The next scan of the file.
            *scan = Scan { columns: Some(n), ..Scan::default() };
        } else if self.layout.is_none() && self.count.first.is_some() && self.names.is_none() {
            let columns = self.count.stated;
            self.count = Count::default();
            self.scan = Some(Scan::default().with(columns, n)?);
        } else {
            self.count.add(n, lines.place());
        }
        Ok(())
    }

    fn comment(&mut self, line: &[u8], lines: &Lines) {
        self.stated.look(line, || lines.place());
        if self.layout.is_none() && self.comments.len() < MAX_COMMENTS {
            self.comments.push((line[..line.len().min(1000)].to_vec(), lines.place()));
        }
    }

    /// Finds the layout by the first row of numbers and the names before it.
    fn begin(&mut self, line: &[u8], lines: &Lines, notes: &mut Vec<Diag>) -> Result<(), Error> {
        let mut layout = Layout::of(line, self.separator).map_err(|d| d.at(lines.place()))?;
        let mut named = None;
        if let Some((names, place)) = &self.names {
            let found = layout.named_by_row(names).map_err(|d| match d.code {
                "points-columns" => d.at(lines.place()),
                _ => d.at(place.clone()),
            })?;
            named = Some((found, names, place));
        }
        for (comment, place) in self.comments.iter().rev() {
            if named.is_none() {
                let found = layout.named_by_comment(comment).map_err(|d| d.at(place.clone()))?;
                named = found.map(|found| (found, comment, place));
            }
        }
        self.ids = (named.is_none() && self.scan.is_none() && layout.columns > 3).then(Ids::default);
        if let Some((found, text, place)) = named {
            layout.xyz = found.xyz;
            if let Some(mm) = found.unit_mm {
                self.stated.is(mm, text, place.clone());
            }
            notes.extend(found.note.map(|d| d.at(place.clone())));
        }
        self.layout = Some(layout);
        Ok(())
    }

    fn point(&mut self, line: &[u8], lines: &Lines) -> Result<(), Error> {
        let Some(layout) = &self.layout else { return Ok(()) };
        let row = layout.row(line).map_err(|d| d.at(lines.place()))?;
        if self.ids.as_mut().is_some_and(|ids| !ids.goes_on(layout.first(line))) {
            self.ids = None;
        }
        self.count.rows += 1;
        let is_no_data = self.scan.is_some() && row == [0.0; 3];
        let row = self.scan.as_mut().map_or(row, |scan| scan.placed(row));
        if is_no_data || self.scan.is_none() && row == [0.0; 3] {
            self.cloud.zero(|| lines.place());
        } else {
            self.cloud.add(row, || lines.place());
        }
        if self.cloud.len() > MAX_POINTS {
            let d = Diag::input("points-too-many", format!("the file has more than {MAX_POINTS} points"));
            return Err(d.at(lines.place()).hint("thin the cloud, or use a part of it").into());
        }
        Ok(())
    }

    /// The points of the file, in its order; those that are not finite are left out with a warning.
    pub(super) fn finish(self, notes: &mut Vec<Diag>) -> Result<Vec<Point>, Error> {
        if let Some(first) = self.ids.filter(Ids::is_sure).and_then(|ids| ids.first) {
            let text = format!(
                "the first of {} columns counts the points ({first}, ...), and nothing says which columns are x, y and z",
                self.layout.map_or(0, |layout| layout.columns)
            );
            let d = Diag::input("points-id", text).at(super::super::lines::place(self.path));
            return Err(d
                .hint("name the columns in a first row, such as \"id x y z\"; or remove the first one")
                .into());
        }
        notes.extend(self.stated.note);
        notes.extend(self.count.note());
        let is_scan = self.scan.is_some();
        if let Some(scan) = self.scan.filter(|scan| scan.left > 0 || scan.head < Scan::HEAD) {
            let text = format!("the last scan of the file lacks {} of its points", scan.left);
            let d = Diag::warning("points-count", text).at(super::super::lines::place(self.path));
            notes.push(d.hint("the file may be cut short: export or copy it again"));
        }
        self.cloud.finish(self.path, is_scan, notes)
    }
}

/// Whether a line is a comment wherever it stands.
fn is_comment(line: &[u8]) -> bool {
    line.starts_with(b"#") || line.starts_with(b"//") || line.starts_with(b"%") || line.starts_with(b"!")
}

/// Whether a semicolon begins a comment, as it does before the points where it separates no columns.
fn is_semicolon_comment(line: &[u8]) -> bool {
    let Some(rest) = line.strip_prefix(b";") else { return false };
    !rest.contains(&b';') && fields(rest, Separator::Blanks).all(|w| number(w).is_err())
}

/// The number of a row that has nothing but a whole one.
fn whole(line: &[u8]) -> Option<u64> {
    let line = unquoted(line);
    line.iter().all(u8::is_ascii_digit).then(|| std::str::from_utf8(line).ok()?.parse().ok())?
}

/// The number of points that the file states, and how many there are.
#[derive(Default)]
struct Count {
    stated: u64,
    first: Option<Place>,
    rows: u64,
}

impl Count {
    fn add(&mut self, n: u64, place: Place) {
        self.stated = self.stated.saturating_add(n);
        self.first.get_or_insert(place);
    }

    fn is_complete(&self) -> bool {
        self.first.is_some() && self.stated == self.rows
    }

    fn note(&self) -> Option<Diag> {
        let place = self.first.clone().filter(|_| !self.is_complete())?;
        let text = format!("the file states {} points and has {}", self.stated, self.rows);
        Some(Diag::warning("points-count", text).at(place).hint("the file may be cut short: export or copy it again"))
    }
}

/// A scan of a PTX file.
#[derive(Default)]
struct Scan {
    columns: Option<u64>,
    /// Rows of the head that have been read, the two counts included.
    head: usize,
    matrix: [[f64; 4]; 4],
    /// Points that follow.
    left: u64,
}

impl Scan {
    const HEAD: usize = 10;

    /// Takes the two counts.
    fn with(mut self, columns: u64, rows: u64) -> Result<Self, Diag> {
        self.left = columns.saturating_mul(rows);
        self.columns = Some(columns);
        self.head = 2;
        Ok(self)
    }

    /// Takes the next row of the head.
    fn head(&mut self, line: &[u8]) -> Result<(), Diag> {
        if let (0, Some(columns), Some(rows)) = (self.head, self.columns, whole(line)) {
            *self = Self::default().with(columns, rows)?;
            return Ok(());
        }
        let wanted = if self.head < 6 { 3 } else { 4 };
        let values: Vec<f64> = fields(line, Separator::Blanks).map_while(|w| number(w).ok()).collect();
        if self.head < 2 || values.len() != wanted || fields(line, Separator::Blanks).count() != wanted {
            let text = format!(
                "two rows of one number begin a PTX scan, whose row {} has {wanted} numbers; found \"{}\"",
                self.head + 1,
                shown(line)
            );
            return Err(Diag::input("points-columns", text).hint("export the cloud as rows of x y z"));
        }
        if self.head >= 6 {
            self.matrix[self.head - 6].copy_from_slice(&values);
        }
        self.head += 1;
        Ok(())
    }

    /// The place of a point by the matrix: rows are the axes of the scanner and its place.
    fn placed(&mut self, p: [f64; 3]) -> [f64; 3] {
        self.left = self.left.saturating_sub(1);
        let m = &self.matrix;
        [0, 1, 2].map(|k| p[0] * m[0][k] + p[1] * m[1][k] + p[2] * m[2][k] + m[3][k])
    }
}

/// Looks whether the first column of four or more counts the points, where no names say what it is.
#[derive(Default)]
struct Ids {
    first: Option<u64>,
    last: u64,
    rows: u64,
    is_by_one: bool,
    has_fractions: bool,
}

impl Ids {
    /// Takes the first columns of a row; false where its first does not keep counting.
    fn goes_on<'a>(&mut self, mut columns: impl Iterator<Item = &'a [u8]>) -> bool {
        let Some(id) = columns.next().and_then(whole) else { return false };
        let is_first = self.first.is_none();
        if !is_first && id <= self.last {
            return false;
        }
        self.is_by_one = is_first || self.is_by_one && id - self.last == 1;
        self.has_fractions |= columns.any(|w| w.contains(&b'.'));
        self.first.get_or_insert(id);
        self.last = id;
        self.rows += 1;
        true
    }

    /// Whether this cannot well be a coordinate: it continues by one to the end, or alone of the columns has whole
    /// numbers.
    fn is_sure(&self) -> bool {
        self.rows >= 5 && (self.is_by_one || self.has_fractions)
    }
}
