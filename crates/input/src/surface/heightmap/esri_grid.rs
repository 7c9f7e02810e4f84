//! ESRI ASCII grids: a header of names and numbers, then rows of elevations from the north down.
//!
//! Consumes `ncols`, `nrows`, `xllcorner` or `xllcenter`, `yllcorner` or `yllcenter`, `cellsize` (or equal `dx` and
//! `dy`) and `NODATA_value` (-9999 where it is not there), then the numbers, however they are divided into lines; `nan`
//! is a hole.
//! Elevations are f64 (8 bytes each) and stand at the centres of cells. The scale is that of the file, in the unit of
//! the job, or that of `[surface.heightmap]`. The size is checked, and held against the length of the file, before
//! anything is allocated.

use std::path::Path;

use super::super::lines::{Lines, is_nan, no_number, number, place, shown, words};
use super::super::{Content, Scale};
use super::{Grid, MAX_SAMPLES, Samples, check_size, check_square};
use terrace_core::diag::{Diag, Error, memory};

const NAMES: [&str; 10] =
    ["ncols", "nrows", "xllcorner", "xllcenter", "yllcorner", "yllcenter", "cellsize", "dx", "dy", "nodata_value"];

const AGAIN: &str = "export the grid again as ESRI ASCII grid or GeoTIFF";

/// Whether a text file begins with a name of the header.
pub(in crate::surface) fn begins(head: &[u8]) -> bool {
    words(head).next().is_some_and(|word| name(word).is_some())
}

/// The place of a name of the header among all.
fn name(word: &[u8]) -> Option<usize> {
    NAMES.iter().position(|name| word.eq_ignore_ascii_case(name.as_bytes()))
}

/// How a grid gets its heights.
pub(in crate::surface) enum By<'a> {
    /// The header's own numbers, in a unit of so many mm.
    Unit(f64),
    /// `[surface.heightmap]`.
    Scale(&'a Scale),
}

/// Reads a grid.
pub(in crate::surface) fn read(
    mut lines: Lines,
    path: &Path,
    by: &By<'_>,
    notes: &mut Vec<Diag>,
) -> Result<Content, Error> {
    let header = Header::read(&mut lines)?;
    let at = |d: Diag| d.at(place(path));
    let [columns, rows] = header.size().map_err(at)?;
    header.check_cells().map_err(at)?;
    let count = columns * rows;
    if (count as u64).saturating_mul(2) > lines.length() + 1 {
        let text = format!("{columns} x {rows} numbers cannot be in a file of {} bytes", lines.length());
        return Err(at(Diag::input("grid-values", text)).hint(AGAIN).into());
    }
    // Eight bytes and a class for each; while they turn, no more.
    memory::ask("the height map", 9 * count as u64).map_err(at)?;
    let mut values = Vec::with_capacity(count);
    // The header ended at the first line of numbers.
    let mut more = true;
    while more {
        for word in words(lines.line()) {
            if values.len() == count {
                let text = format!("there are more than {columns} x {rows} numbers");
                return Err(Diag::input("grid-values", text).at(lines.place()).hint(AGAIN).into());
            }
            values.push(match number(word) {
                Err(_) if is_nan(word) => f64::NAN,
                value => value.map_err(|why| no_number(word, why, lines.place()))?,
            });
        }
        more = lines.advance()?;
    }
    if values.len() < count {
        let text = format!("there are {} numbers, {columns} x {rows} are {count}", values.len());
        return Err(Diag::input("grid-values", text).at(lines.place()).hint(AGAIN).into());
    }
    let mut samples = Samples::Double(values);
    add_holes(&mut samples, header.of("nodata_value").unwrap_or(-9999.0));
    samples.flip(columns);
    let grid = Grid { columns, rows, samples, full: None, is_8_bit: false };
    match by {
        By::Scale(scale) => grid.scaled(scale, notes, &place(path)).map_err(|d| at(d).into()),
        By::Unit(unit_mm) => {
            let (cell, corner) = header.scale().map_err(at)?;
            let remedy = format!(
                "one unit of the file is taken as {unit_mm} mm; state [surface.heightmap] (pixel, z, values) \
                 instead of unit to give the map another scale and place"
            );
            let placed =
                grid.placed(cell * unit_mm, corner.map(|v| v * unit_mm), [0.0, *unit_mm], &remedy, notes, &place(path));
            placed.map_err(|d| at(d).into())
        }
    }
}

/// Makes samples of this value holes. Values such as -3.402823e38 are the least of a float, and programs write them
/// with more or fewer digits than in the header.
fn add_holes(samples: &mut Samples, value: f64) {
    match samples {
        Samples::Double(values) if value.abs() > 1e30 => {
            let near = |v: &f64| (v - value).abs() <= 1e-5 * value.abs();
            values.iter_mut().filter(|v| near(v)).for_each(|v| *v = f64::NAN);
        }
        samples => samples.add_hole(value),
    }
}

/// The numbers of the header, by their place among [`NAMES`].
struct Header([Option<f64>; NAMES.len()]);

impl Header {
    /// Reads up to the first line of numbers, which stays the line of the reader.
    fn read(lines: &mut Lines) -> Result<Self, Error> {
        let mut found = [None; NAMES.len()];
        while lines.advance()? {
            let mut line = words(lines.line());
            let Some(first) = line.next() else { continue };
            let Some(known) = name(first) else {
                if first.first().is_some_and(u8::is_ascii_alphabetic) && number(first).is_err() && !is_nan(first) {
                    let text = format!("\"{}\" is not known in the header of a grid", shown(first));
                    return Err(Diag::input("grid-header", text).at(lines.place()).hint(AGAIN).into());
                }
                break;
            };
            let (Some(value), None) = (line.next(), line.next()) else {
                let text = format!("{} has one number", NAMES[known]);
                return Err(Diag::input("grid-header", text).at(lines.place()).hint(AGAIN).into());
            };
            // No elevation is NaN, but files say so of holes.
            let value = match number(value) {
                Ok(v) => v,
                Err(_) if NAMES[known] == "nodata_value" && is_nan(value) => f64::NAN,
                Err(why) => return Err(no_number(value, why, lines.place()).into()),
            };
            if found[known].replace(value).is_some() {
                let text = format!("{} is there twice", NAMES[known]);
                return Err(Diag::input("grid-header", text).at(lines.place()).hint(AGAIN).into());
            }
        }
        Ok(Self(found))
    }

    fn of(&self, name: &str) -> Option<f64> {
        NAMES.iter().position(|n| *n == name).and_then(|i| self.0[i])
    }

    fn need(&self, name: &str) -> Result<f64, Diag> {
        self.of(name).ok_or_else(|| Diag::input("grid-header", format!("the header has no {name}")).hint(AGAIN))
    }

    /// Columns and rows.
    fn size(&self) -> Result<[usize; 2], Diag> {
        let [columns, rows] = [self.need("ncols")?, self.need("nrows")?];
        if let Some(v) = [columns, rows].into_iter().find(|v| *v < 0.0 || v.fract() != 0.0) {
            return Err(Diag::input("grid-header", format!("{v} is not a number of columns or rows")).hint(AGAIN));
        }
        check_size(columns as u64, rows as u64, MAX_SAMPLES)?;
        Ok([columns as usize, rows as usize])
    }

    /// Refuses cells that are not square, also where `[surface.heightmap]` gives the distance of samples.
    fn check_cells(&self) -> Result<(), Diag> {
        let [dx, dy] = ["dx", "dy"].map(|name| self.of(name).unwrap_or(f64::NAN));
        check_square([dx, dy], "dx and dy", "resample the grid to square cells")
    }

    /// The distance of samples, and the place of the lower left one, in the unit of the file.
    fn scale(&self) -> Result<(f64, [f64; 2]), Diag> {
        let cell = match (self.of("dx"), self.of("dy")) {
            (Some(dx), Some(_)) => dx,
            _ => self.need("cellsize")?,
        };
        if cell <= 0.0 {
            return Err(Diag::input("grid-header", format!("cellsize is {cell}")).hint(AGAIN));
        }
        Ok((cell, [self.lower_left("xllcorner", "xllcenter", cell)?, self.lower_left("yllcorner", "yllcenter", cell)?]))
    }

    /// The place of the lower left sample along an axis: the centre of the cell, or half a cell beside its corner.
    fn lower_left(&self, corner: &str, centre: &str, cell: f64) -> Result<f64, Diag> {
        match self.of(centre) {
            Some(v) => Ok(v),
            None => self.need(corner).map(|v| v + cell / 2.0),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::Heightmap;
    use super::*;

    fn read_text(text: &str, by: &By<'_>) -> Result<Heightmap, Error> {
        let dir = tempfile::tempdir().expect("a folder");
        let path = dir.path().join("a.asc");
        std::fs::write(&path, text).expect("written");
        match read(Lines::open(&path, "a grid")?, &path, by, &mut vec![])? {
            Content::Heightmap(map) => Ok(map),
            _ => panic!("a height map"),
        }
    }

    const HEAD: &str = "NCOLS 3\r\nnrows  2\r\nXLLCORNER 10\r\nyllcenter -5.5\r\ncellsize 2\r\nNODATA_value -1\r\n";

    #[test]
    fn rows_come_from_the_north_and_samples_stand_in_their_cells() {
        let map = read_text(&format!("{HEAD}1 2 3\n4 -1 6.25\n"), &By::Unit(10.0)).expect("read");
        assert_eq!((map.columns, map.rows, map.pixel_mm, map.origin_mm), (3, 2, 20.0, [110.0, -55.0]));
        let z: Vec<Option<f64>> = (0..6).map(|i| map.samples.value(i).map(|v| map.z_mm[0] + v * map.z_mm[1])).collect();
        assert_eq!(z, [Some(40.0), None, Some(62.5), Some(10.0), Some(20.0), Some(30.0)]);
        // Numbers may be divided into lines in any way, and the value of holes may be left out.
        let text = HEAD.replace("NODATA_value -1\r\n", "");
        let map = read_text(&format!("{text}1\n2 3 4\n\n-9999 6.25"), &By::Unit(10.0)).expect("read");
        assert_eq!((map.samples.value(1), map.samples.value(0)), (None, Some(4.0)));
        let scale = Scale {
            pixel_mm: 0.5,
            z_mm: [0.0, 2.0],
            values: Some([0.0, 100.0]),
            nodata: Some(6.25),
            origin_mm: [1.0, 2.0],
        };
        let map = read_text(&format!("{HEAD}1 2 3\n4 -1 6.25\n"), &By::Scale(&scale)).expect("read");
        assert_eq!((map.pixel_mm, map.origin_mm, map.z_mm), (0.5, [1.0, 2.0], [0.0, 0.02]));
        assert_eq!([0, 1, 2].map(|i| map.samples.value(i)), [Some(4.0), None, None]);
    }

    #[test]
    fn cells_without_a_number_are_holes() {
        let holes = |text: &str| {
            let map = read_text(text, &By::Unit(1.0)).expect(text);
            (0..6).filter(|&i| map.samples.value(i).is_none()).collect::<Vec<_>>()
        };
        let plain = HEAD.replace("NODATA_value -1\r\n", "");
        assert_eq!(holes(&format!("{HEAD}1 2 nan\n4 -1 6")), [1, 5]);
        assert_eq!(holes(&format!("{plain}NaN 2 3\n4 5 -nan(ind)")), [2, 3]);
        assert_eq!(holes(&format!("{plain}NODATA_value nan\n1 -9999 nan\n4 5 6").replace("-9999", "-999")), [5]);
        let least = format!("{plain}NODATA_value -3.40282e+38\n1 2 -3.402823466385288598e+38\n4 5 -3.402823e38");
        assert_eq!(holes(&least), [2, 5]);
    }

    #[test]
    fn cells_that_are_not_square_are_refused_with_any_scale() {
        let scale =
            Scale { pixel_mm: 0.5, z_mm: [0.0, 2.0], values: Some([0.0, 100.0]), nodata: None, origin_mm: [1.0, 2.0] };
        let text = format!("{HEAD}1 2 3\n4 5 6").replace("cellsize 2", "dx 1\ndy 1.5");
        let e = read_text(&text, &By::Scale(&scale)).expect_err("not square");
        assert!(
            e.diags()[0].code == "heightmap-cells" && e.to_string().contains("0.6667 times as wide as high"),
            "{e}"
        );
        assert!(read_text(&text.replace("1.5", "1"), &By::Scale(&scale)).is_ok());
    }

    #[test]
    fn faults_are_named() {
        let whole = format!("{HEAD}1 2 3\n4 5 6\n");
        for (text, code, say) in [
            (format!("{HEAD}1 2 3\n4 5"), "grid-values", "there are 5 numbers, 3 x 2 are 6"),
            (format!("{HEAD}1 2 3\n4 5 6 7"), "grid-values", ":8: there are more than 3 x 2"),
            (format!("{HEAD}1 2 3\n4 x 6"), "surface-number", ":8: \"x\""),
            (format!("{HEAD}1 2,5 3\n4 5 6"), "surface-number", "decimal comma"),
            (format!("{HEAD}1 2 inf\n4 5 6"), "surface-number", "finite"),
            (whole.replace("NCOLS 3", "NCOLS 3000"), "grid-values", "cannot be in a file of"),
            (whole.replace("NCOLS 3", "NCOLS 3000000"), "heightmap-size", "3000000 x 2"),
            (whole.replace("NCOLS 3", "NCOLS 1"), "heightmap-size", "1 x 2"),
            (whole.replace("NCOLS 3", "NCOLS 2.5"), "grid-header", "2.5"),
            (whole.replace("NCOLS 3", "NCOLS"), "grid-header", ":1: ncols has one number"),
            (whole.replace("NCOLS 3", ""), "grid-header", "has no ncols"),
            (whole.replace("NCOLS 3", "NROWS 2"), "grid-header", ":2: nrows is there twice"),
            (whole.replace("cellsize 2", "celsize 2"), "grid-header", ":5: \"celsize\""),
            (whole.replace("cellsize 2", "dx 2\ndy 3"), "heightmap-cells", "by dx and dy its cells are 0.6667 times"),
            (whole.replace("cellsize 2", "dx -2\ndy 3"), "grid-header", "cellsize is -2"),
            (whole.replace("cellsize 2", "cellsize 0"), "grid-header", "cellsize is 0"),
            (whole.replace("XLLCORNER", "dx"), "grid-header", "no xllcorner"),
            (whole.replace("4 5 6", "-1 -1 -1"), "", ""),
            (format!("{HEAD}-1 -1 -1 -1 -1 -1"), "heightmap-empty", "nodata"),
            (whole.replace("XLLCORNER 10", "XLLCORNER 5e6"), "surface-size", "subtract (5000001"),
            (whole.replace("cellsize 2", "cellsize 1e5"), "surface-size", "[surface.heightmap]"),
        ] {
            match read_text(&text, &By::Unit(1.0)) {
                Ok(_) => assert_eq!(code, "", "{text}"),
                Err(e) => {
                    assert_eq!(e.diags()[0].code, code, "{e}");
                    assert!(e.to_string().contains(say) && !e.diags()[0].hint.is_empty(), "{say}: {e}");
                }
            }
        }
    }
}
