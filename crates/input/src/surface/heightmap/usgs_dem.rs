//! USGS DEM: profiles of elevations in records of 1024 characters.
//!
//! Consumes the header record (A) and the profiles (B), which run from the south up and may begin and end anywhere on
//! the lattice; where they do not reach, up to the corners of the header, are holes. Elevations are f64, in the unit of the file. The scale comes from
//! `[surface.heightmap]`: a map of this kind is kilometres wide.
//!
//! Source: USGS, Standards for Digital Elevation Models, part 2, appendix A (columns of the records).

use std::io::{BufReader, Read};
use std::path::Path;

use super::super::lines::{self, place};
use super::super::{Content, Scale};
use super::{Grid, MAX_SAMPLES, Samples, check_size};
use terrace_core::diag::{Diag, Error, memory, unreadable};

/// Characters of a record.
const RECORD: usize = 1024;
/// Elevations in the first record of a profile, and in those after it.
const FIRST: usize = 146;
const NEXT: usize = 170;
/// Elevations from this value down are holes.
const VOID: f64 = -32_766.0;

/// Reads a height map.
pub(in crate::surface) fn read(path: &Path, scale: &Scale, notes: &mut Vec<Diag>) -> Result<Content, Error> {
    let (file, length) = lines::open(path)?;
    let at = |d: Diag| d.at(place(path));
    if length == 0 {
        return Err(at(Diag::input("surface-empty", "the file is empty")).hint("export it again").into());
    }
    let mut records = Records { input: BufReader::with_capacity(1 << 18, file), path, record: [0; RECORD], number: 0 };
    let header = Header::of(&mut records)?;
    // A profile takes a record and more; an elevation six characters, and some 8 bytes twice.
    memory::ask("the height map", 3 * length).map_err(at)?;
    let mut profiles = Vec::new();
    for _ in 0..header.profiles {
        profiles.push(Profile::read(&mut records, &header)?);
    }
    let grid = header.grid(&profiles).map_err(at)?;
    grid.scaled(scale, notes, &place(path)).map_err(|d| at(d).into())
}

fn fault(text: String) -> Diag {
    Diag::input("dem-record", text)
        .hint("convert the map to GeoTIFF or an ESRI ASCII grid, with gdal_translate or QGIS")
}

/// The records of a file, one after the other.
struct Records<'a> {
    input: BufReader<std::fs::File>,
    path: &'a Path,
    record: [u8; RECORD],
    /// That of the record, from 1.
    number: usize,
}

impl Records<'_> {
    fn advance(&mut self) -> Result<(), Error> {
        self.number += 1;
        self.input.read_exact(&mut self.record).map_err(|e| match e.kind() {
            std::io::ErrorKind::UnexpectedEof => self.fault("the file ends in it"),
            _ => unreadable(self.path, &e).into(),
        })
    }

    fn fault(&self, text: &str) -> Error {
        fault(format!("record {}: {text}", self.number)).at(place(self.path)).into()
    }

    /// The number in columns `from` (counted from 1) and following, with an exponent of E or D.
    fn number(&self, from: usize, width: usize) -> Result<f64, Error> {
        let text = String::from_utf8_lossy(&self.record[from - 1..from - 1 + width]);
        let text = text.trim();
        let v: Option<f64> = text.replace(['D', 'd'], "E").parse().ok().filter(|v: &f64| v.is_finite());
        v.ok_or_else(|| self.fault(&format!("\"{}\" in column {from} is no number", text.escape_debug())))
    }
}

/// What is used of the header.
struct Header {
    /// Distance of samples along x and y, and the step of elevations.
    step: [f64; 3],
    profiles: usize,
    /// The least and the greatest y of the corners.
    reach: [f64; 2],
}

impl Header {
    fn of(records: &mut Records<'_>) -> Result<Self, Error> {
        records.advance()?;
        let step = [records.number(817, 12)?, records.number(829, 12)?, records.number(841, 12)?];
        let [rows, profiles] = [records.number(853, 6)?, records.number(859, 6)?];
        if step.iter().any(|v| *v <= 0.0) || rows != 1.0 || profiles < 1.0 || profiles.fract() != 0.0 {
            let text = format!("it has {rows} x {profiles} profiles at steps of {step:?}");
            return Err(records.fault(&text));
        }
        if step[0] != step[1] {
            let text = format!("samples are {} x {} apart; a height map has square cells", step[0], step[1]);
            return Err(records.fault(&text));
        }
        check_size(profiles as u64, 2, MAX_SAMPLES).map_err(|d| d.at(place(records.path)))?;
        let mut reach = [f64::INFINITY, f64::NEG_INFINITY];
        for corner in 0..4 {
            let y = records.number(571 + 48 * corner, 24)?;
            reach = [reach[0].min(y), reach[1].max(y)];
        }
        Ok(Self { step, profiles: profiles as usize, reach })
    }

    /// Joins the profiles to a grid.
    fn grid(&self, profiles: &[Profile]) -> Result<Grid, Diag> {
        let least = |k: usize| profiles.iter().fold(f64::INFINITY, |v, p| v.min(p.at[k]));
        let mut corner = [least(0), least(1)];
        // Whole steps that keep the lattice, out to the corners and no farther than a step beyond.
        let below = ((corner[1] - self.reach[0]) / self.step[1]).ceil().max(0.0);
        corner[1] -= below * self.step[1];
        // The place of a profile on the lattice, and those of its ends along y.
        let place = |p: &Profile, k: usize| {
            let steps = (p.at[k] - corner[k]) / self.step[k];
            let whole = (steps - steps.round()).abs() < 1e-3 && steps < 1e6;
            whole.then_some(steps.round() as usize).ok_or_else(|| {
                fault(format!("the profile at ({}, {}) is not on the lattice of the others", p.at[0], p.at[1]))
            })
        };
        let above = ((self.reach[1] - corner[1]) / self.step[1]).ceil().clamp(0.0, 1e6);
        let (mut columns, mut rows) = (0, above as usize + 1);
        for p in profiles {
            columns = columns.max(place(p, 0)? + 1);
            rows = rows.max(place(p, 1)? + p.heights.len());
        }
        check_size(columns as u64, rows as u64, MAX_SAMPLES)?;
        memory::ask("the height map", 9 * (columns * rows) as u64)?;
        let mut samples = vec![f64::NAN; columns * rows];
        for p in profiles {
            let (column, row) = (place(p, 0)?, place(p, 1)?);
            for (k, &z) in p.heights.iter().enumerate() {
                samples[(row + k) * columns + column] = z;
            }
        }
        Ok(Grid { columns, rows, samples: Samples::Double(samples), full: None, is_8_bit: false })
    }
}

/// Elevations from one point up; NaN for holes.
struct Profile {
    at: [f64; 2],
    heights: Vec<f64>,
}

impl Profile {
    fn read(records: &mut Records<'_>, header: &Header) -> Result<Self, Error> {
        records.advance()?;
        let [count, columns] = [records.number(13, 6)?, records.number(19, 6)?];
        if !(0.0..=1e6).contains(&count) || count.fract() != 0.0 || columns != 1.0 {
            return Err(records.fault(&format!("a profile has {count} x {columns} elevations")));
        }
        let at = [records.number(25, 24)?, records.number(49, 24)?];
        let datum = records.number(73, 24)?;
        let (mut heights, mut first, mut most) = (Vec::new(), 145, FIRST);
        loop {
            let here = most.min(count as usize - heights.len());
            for i in 0..here {
                let v = records.number(first + 6 * i, 6)?;
                heights.push(if v <= VOID { f64::NAN } else { datum + v * header.step[2] });
            }
            if heights.len() == count as usize {
                return Ok(Self { at, heights });
            }
            records.advance()?;
            (first, most) = (1, NEXT);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::Heightmap;
    use super::*;

    /// A record of these texts at these columns, counted from 1.
    fn record(fields: &[(usize, String)]) -> Vec<u8> {
        let mut out = vec![b' '; RECORD];
        for (at, text) in fields {
            out[at - 1..at - 1 + text.len()].copy_from_slice(text.as_bytes());
        }
        out
    }

    fn header(profiles: usize) -> Vec<u8> {
        let y = |y: f64| format!("{y:24.15E}");
        let corners = [(571, y(-1.0)), (619, y(60.0)), (667, y(60.0)), (715, y(-1.0))];
        let rest = [(817, "0.300000E+020.300000E+020.500000E+00".into()), (853, format!("     1{profiles:6}"))];
        record(&[&corners[..], &rest].concat())
    }

    fn profile(column: usize, south: f64, heights: &[i32]) -> Vec<u8> {
        let x = 557_000.0 + 30.0 * column as f64;
        let head = format!("     1{column:6}{:6}     1{x:24.15E}{south:24.15E}{:24.15E}", heights.len(), 100.0);
        let text = |part: &[i32]| part.iter().map(|z| format!("{z:6}")).collect::<String>();
        let (first, rest) = heights.split_at(heights.len().min(FIRST));
        let mut out = record(&[(1, head.replace('E', "D")), (145, text(first))]);
        rest.chunks(NEXT).for_each(|part| out.extend(record(&[(1, text(part))])));
        out
    }

    const SCALE: Scale =
        Scale { pixel_mm: 1.0, z_mm: [0.0, 100.0], values: Some([0.0, 1000.0]), nodata: None, origin_mm: [0.0; 2] };

    fn read_bytes(bytes: &[u8]) -> Result<Heightmap, Error> {
        let dir = tempfile::tempdir().expect("a folder");
        let path = dir.path().join("a.dem");
        std::fs::write(&path, bytes).expect("written");
        match read(&path, &SCALE, &mut vec![])? {
            Content::Heightmap(map) => Ok(map),
            _ => panic!("a height map"),
        }
    }

    #[test]
    fn profiles_are_joined_on_their_lattice() {
        let long: Vec<i32> = (0..400).collect();
        let file = [header(3), profile(1, 60.0, &[10, -32767, 12]), profile(2, 0.0, &long), profile(3, 30.0, &[7])];
        let map = read_bytes(&file.concat()).expect("read");
        // One row of holes below: the corners reach 1 m farther than the profiles.
        assert_eq!((map.columns, map.rows), (3, 401));
        let z = |column: usize, row: usize| map.samples.value((row + 1) * 3 + column);
        assert_eq!([z(0, 1), z(0, 2), z(0, 3), z(0, 4), z(0, 5)], [None, Some(105.0), None, Some(106.0), None]);
        assert_eq!([z(1, 0), z(1, 146), z(1, 399), z(2, 1)], [Some(100.0), Some(173.0), Some(299.5), Some(103.5)]);
    }

    #[test]
    fn faults_are_named() {
        let whole = [header(2), profile(1, 0.0, &[1, 2]), profile(2, 0.0, &[3, 4])].concat();
        assert!(read_bytes(&whole).is_ok());
        let with = |at: usize, text: &str| {
            let mut bytes = whole.clone();
            bytes[at - 1..at - 1 + text.len()].copy_from_slice(text.as_bytes());
            bytes
        };
        for (bytes, code, say) in [
            (whole[..3000].to_vec(), "dem-record", "record 3: the file ends"),
            (with(817, "0.100000E+02"), "dem-record", "10 x 30 apart"),
            (with(841, "0.000000E+00"), "dem-record", "steps of"),
            (with(859, "  abcd"), "dem-record", "\"abcd\" in column 859"),
            (with(859, "999999"), "heightmap-size", "999999 x 2"),
            (with(1024 + 13, "   -1 "), "dem-record", "-1 x 1"),
            (with(1024 + 25, "   0.557040E+06         "), "dem-record", "not on the lattice"),
            (vec![], "surface-empty", "empty"),
            (vec![b'x'; 2000], "dem-record", "record 1"),
        ] {
            let e = read_bytes(&bytes).expect_err(say);
            assert_eq!(e.diags()[0].code, code, "{e}");
            assert!(e.to_string().contains(say) && !e.diags()[0].hint.is_empty(), "{say}: {e}");
        }
    }
}
