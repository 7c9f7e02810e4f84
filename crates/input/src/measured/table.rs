//! The table of measured points.

use std::fmt::Write as _;
use std::path::Path;

use super::{MAX_BYTES, MAX_POINTS, Measure, MeasuredPoint};
use terrace_core::diag::{self, Diag, Error, Place};
use terrace_core::geom::SpacePoint;

/// The columns of a table; the first four and a noise are needed.
pub const COLUMNS: [&str; 11] =
    ["kind", "stage_x", "stage_y", "stage_z", "sigma_um", "sigma_z_um", "tip_mm", "part_x", "part_y", "part_z", "name"];

/// Largest coordinate, mm.
const MAX_MM: f64 = 4000.0;

/// Largest and smallest noise, mm.
const NOISE_MM: std::ops::RangeInclusive<f64> = 1e-6..=10.0;

/// Most faults that are told of one table.
const MAX_FAULTS: usize = 20;

/// Reads the table of measured points at `path`.
///
/// # Errors
/// `file-unreadable`; `measured-table` with each row that is at fault.
pub fn read_table(path: &Path) -> Result<Vec<MeasuredPoint>, Error> {
    let shown = path.display().to_string();
    let text = text_of(path)?;
    let mut table = Table { shown: &shown, columns: None, points: Vec::new(), faults: Vec::new() };
    for (line, row) in (1..).zip(text.lines()) {
        let content = row.trim();
        if !content.is_empty() && !content.starts_with('#') {
            table.row(content, line);
        }
        if table.faults.len() >= MAX_FAULTS {
            break;
        }
    }
    if table.points.is_empty() && table.faults.is_empty() {
        table.fault("the table holds no point", 1);
    }
    if table.faults.is_empty() { Ok(table.points) } else { Err(Error::many(table.faults)) }
}

/// The text of a file that is not too large.
pub(super) fn text_of(path: &Path) -> Result<String, Error> {
    let shown = path.display().to_string();
    let unreadable = |e: &std::io::Error| Error::from(diag::unreadable(path, e));
    let size = std::fs::metadata(path).map_err(|e| unreadable(&e))?.len();
    if size > MAX_BYTES {
        let text = format!("the file has {} MB, more than {}", size >> 20, MAX_BYTES >> 20);
        return Err(Diag::limit("measured-table", text).at(Place::file(shown)).hint(HINT).into());
    }
    let bytes = std::fs::read(path).map_err(|e| unreadable(&e))?;
    match diag::utf8(bytes) {
        Ok(text) => Ok(text.strip_prefix('\u{feff}').map_or(text.clone(), str::to_owned)),
        Err(what) => {
            let d = Diag::input("measured-table", format!("the file is {what}")).at(Place::file(shown));
            Err(d.hint("write it as text in UTF-8").into())
        }
    }
}

const HINT: &str = "the first row names the columns: kind, stage_x, stage_y, stage_z, sigma_um, and for features part_x, \
                    part_y, part_z, for a probe tip_mm";

struct Table<'a> {
    shown: &'a str,
    columns: Option<Columns>,
    points: Vec<MeasuredPoint>,
    faults: Vec<Diag>,
}

/// What stands where in a row.
struct Columns {
    separator: char,
    /// The field of each of [`COLUMNS`].
    fields: [Option<usize>; COLUMNS.len()],
    count: usize,
}

/// Fields of a row by the columns' names.
struct Row<'a> {
    columns: &'a Columns,
    fields: Vec<&'a str>,
}

impl Row<'_> {
    fn get(&self, name: &str) -> Option<&str> {
        let k = COLUMNS.iter().position(|c| *c == name)?;
        self.fields.get(self.columns.fields[k]?).copied().filter(|text| !text.is_empty())
    }

    /// A number of the row; None where the field is empty.
    fn number(&self, name: &str) -> Result<Option<f64>, String> {
        let Some(text) = self.get(name) else { return Ok(None) };
        match text.parse::<f64>() {
            Ok(v) if v.is_finite() => Ok(Some(v)),
            _ => Err(format!("{name} is {text:?}, which is no number")),
        }
    }

    fn needed(&self, name: &str) -> Result<f64, String> {
        self.number(name)?.ok_or_else(|| format!("{name} is missing"))
    }

    fn point(&self, prefix: &str) -> Result<SpacePoint, String> {
        let mut at = [0.0; 3];
        for (v, axis) in at.iter_mut().zip(["x", "y", "z"]) {
            let name = format!("{prefix}_{axis}");
            *v = self.needed(&name)?;
            if v.abs() > MAX_MM {
                return Err(format!("{name} is {v} mm, beyond 4 m"));
            }
        }
        Ok(at)
    }

    fn noise(&self, name: &str) -> Result<Option<f64>, String> {
        let Some(um) = self.number(name)? else { return Ok(None) };
        let mm = um / 1e3;
        if NOISE_MM.contains(&mm) {
            Ok(Some(mm))
        } else {
            Err(format!("{name} is {um}: it lies between 0.001 and 10000 um"))
        }
    }

    fn measured(&self, shown: &str, line: usize) -> Result<MeasuredPoint, String> {
        let is_given = |name: &str| self.get(name).is_some();
        let measure = match self.get("kind") {
            Some("optical") => Measure::Optical { part: self.point("part")? },
            Some("touch") => {
                let tip_mm = self.needed("tip_mm")?;
                if !(0.0..=50.0).contains(&tip_mm) {
                    return Err(format!("tip_mm is {tip_mm}: the radius of a tip lies between 0 and 50 mm"));
                }
                Measure::Touch { tip_mm }
            }
            Some("distance") => Measure::Distance,
            Some(other) => return Err(format!("kind is {other:?}: it is optical, touch or distance")),
            None => return Err("kind is missing: optical, touch or distance".to_owned()),
        };
        let foreign: &[&str] = match measure {
            Measure::Optical { .. } => &["tip_mm"],
            Measure::Touch { .. } => &["part_x", "part_y", "part_z", "sigma_z_um"],
            Measure::Distance => &["part_x", "part_y", "part_z", "sigma_z_um", "tip_mm"],
        };
        if let Some(name) = foreign.iter().find(|name| is_given(name)) {
            return Err(format!("{name} does not go with kind {}", self.get("kind").unwrap_or_default()));
        }
        let sigma = self.noise("sigma_um")?.ok_or("sigma_um is missing: the standard deviation of the position")?;
        let name = self.get("name").map_or_else(|| format!("row {line}"), str::to_owned);
        let sigma_mm = [sigma, self.noise("sigma_z_um")?.unwrap_or(sigma)];
        Ok(MeasuredPoint { name, place: Place::line(shown, line), measure, stage: self.point("stage")?, sigma_mm })
    }
}

/// The fields of a row, without blanks and quotes around them.
fn fields(row: &str, separator: char) -> Vec<&str> {
    row.split(separator).map(unquoted).collect()
}

/// A field without blanks and quotes around it.
fn unquoted(field: &str) -> &str {
    let text = field.trim();
    text.strip_prefix('"').and_then(|t| t.strip_suffix('"')).unwrap_or(text).trim()
}

impl Table<'_> {
    fn fault(&mut self, text: impl Into<String>, line: usize) {
        let d = Diag::input("measured-table", text).at(Place::line(self.shown, line));
        // Told once: the faults of further rows are of the same file.
        let d = if self.faults.is_empty() { d.hint(HINT) } else { d };
        self.faults.push(d);
    }

    fn row(&mut self, content: &str, line: usize) {
        let Some(columns) = &self.columns else {
            match Columns::of(content) {
                Ok(columns) => self.columns = Some(columns),
                Err(text) => {
                    self.fault(text, line);
                    // Without columns no row says anything.
                    self.columns = Some(Columns { separator: ',', fields: [None; COLUMNS.len()], count: 0 });
                }
            }
            return;
        };
        if columns.count == 0 {
            return;
        }
        let fields = fields(content, columns.separator);
        if fields.len() != columns.count {
            let text = format!("the row has {} fields, the first row names {}", fields.len(), columns.count);
            return self.fault(text, line);
        }
        if self.points.len() == MAX_POINTS {
            let text = format!("the table has more than {MAX_POINTS} points");
            self.faults.push(Diag::limit("measured-table", text).at(Place::line(self.shown, line)));
            self.columns = Some(Columns { separator: ',', fields: [None; COLUMNS.len()], count: 0 });
            return;
        }
        match (Row { columns, fields }).measured(self.shown, line) {
            Ok(point) => self.points.push(point),
            Err(text) => self.fault(text, line),
        }
    }
}

impl Columns {
    fn of(row: &str) -> Result<Self, String> {
        let separator = [';', '\t'].into_iter().find(|&c| row.contains(c)).unwrap_or(',');
        let names = fields(row, separator);
        let mut columns = Self { separator, fields: [None; COLUMNS.len()], count: names.len() };
        for (i, name) in names.iter().enumerate() {
            let Some(k) = COLUMNS.iter().position(|c| c.eq_ignore_ascii_case(name)) else {
                let shown: String = name.chars().take(40).collect();
                return Err(format!("there is no column {shown:?}; the columns are {}", COLUMNS.join(", ")));
            };
            if columns.fields[k].replace(i).is_some() {
                return Err(format!("the column {} is there twice", COLUMNS[k]));
            }
        }
        for (k, name) in COLUMNS.iter().take(5).enumerate() {
            if columns.fields[k].is_none() {
                return Err(format!("the column {name} is missing"));
            }
        }
        Ok(columns)
    }
}

/// The table of some points, as [`read_table`] reads it.
pub fn written(points: &[MeasuredPoint]) -> String {
    let mut text = COLUMNS.join(",") + "\n";
    for point in points {
        let [x, y, z] = point.stage;
        let um = point.sigma_mm.map(|mm| mm * 1e3);
        let (kind, tip, part) = match point.measure {
            Measure::Optical { part } => ("optical", String::new(), part.map(|v| v.to_string())),
            Measure::Touch { tip_mm } => ("touch", tip_mm.to_string(), Default::default()),
            Measure::Distance => ("distance", String::new(), Default::default()),
        };
        let sigma_z = if kind == "optical" { um[1].to_string() } else { String::new() };
        let name = point.name.replace([',', '"', '\n'], " ");
        let _ = writeln!(text, "{kind},{x},{y},{z},{},{sigma_z},{tip},{},{name}", um[0], part.join(","));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Vec<MeasuredPoint>, Vec<String>> {
        let file = tempfile::NamedTempFile::new().expect("a file");
        std::fs::write(file.path(), text).expect("written");
        read_table(file.path()).map_err(|e| e.diags().iter().map(|d| d.message.clone()).collect())
    }

    #[test]
    fn a_table_of_each_kind_is_read_and_written_again() {
        let text = "# made by hand\nkind;stage_x;stage_y;stage_z;sigma_um;part_x;part_y;part_z;tip_mm;name\n\
                    optical;1;2;3;5;10;20;30;;\"hole A\"\ntouch;1.5;2;3;2;;;;1;\n\ndistance;0;0;-3;1;;;;;\n";
        let points = read(text).expect("a table");
        assert_eq!(points.len(), 3);
        assert_eq!(points[0].name, "hole A");
        assert_eq!(points[0].measure, Measure::Optical { part: [10.0, 20.0, 30.0] });
        assert_eq!((points[1].measure, points[1].name.as_str()), (Measure::Touch { tip_mm: 1.0 }, "row 4"));
        assert_eq!(points[2].stage, [0.0, 0.0, -3.0]);
        let again = read(&written(&points)).expect("its own table");
        let bare = |p: &MeasuredPoint| MeasuredPoint { place: Place::Nowhere, ..p.clone() };
        assert!(points.iter().map(bare).eq(again.iter().map(bare)), "{again:?}");
    }

    #[test]
    fn faults_of_rows_are_told_with_their_lines() {
        let head = "kind,stage_x,stage_y,stage_z,sigma_um,tip_mm\n";
        let faults = |rows: &str| read(&format!("{head}{rows}")).expect_err("refused");
        assert_eq!(faults("touch,1,2,3,5\n"), ["the row has 5 fields, the first row names 6"]);
        assert_eq!(faults("touch,1,2,3,5,\n"), ["tip_mm is missing"]);
        assert_eq!(faults("laser,1,2,3,5,\n"), ["kind is \"laser\": it is optical, touch or distance"]);
        assert_eq!(faults("distance,1,2,x,5,\n"), ["stage_z is \"x\", which is no number"]);
        assert_eq!(faults("distance,1,2,nan,5,\n"), ["stage_z is \"nan\", which is no number"]);
        assert_eq!(faults("distance,1,2,3,5,1\n"), ["tip_mm does not go with kind distance"]);
        assert_eq!(faults("distance,1,2,3,0,\n"), ["sigma_um is 0: it lies between 0.001 and 10000 um"]);
        assert_eq!(faults(""), ["the table holds no point"]);
        assert_eq!(read("kind,x\n").expect_err("refused").len(), 1);
        assert_eq!(read("kind,stage_x,stage_y,stage_z\n").expect_err("refused"), ["the column sigma_um is missing"]);
    }
}
