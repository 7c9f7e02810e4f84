//! Reader of the block drawings: DXF R12 text with LINE and POLYLINE entities.
//!
//! Consumes the bytes of one file; hands over each stroke in file order, in whole nanometres, with its
//! layer. A closed polyline ends on the point it starts with. Anything else among the entities is a
//! fault: a controller would mark it or lose it, and neither is what the program says.

use super::number::{integer, nm_from_decimal};
use super::{Fault, FileStroke, Strokes};

/// Takes layer and points of a stroke.
type Visit<'v> = dyn FnMut(&[u8], &[[i64; 2]]) + 'v;

/// Reads the drawing of a block, whose layers are `B0001_P1` and so on: block and pen from 1.
pub(super) fn strokes(bytes: &[u8], id: &str, visit: &mut Strokes<'_>) -> Result<(), Fault> {
    read(bytes, &mut |layer, points| visit(FileStroke { pen: pen(layer, id), points, settings: &[] }))
}

/// The pen that a layer of the block stands for.
fn pen(layer: &[u8], id: &str) -> Option<usize> {
    let digits = std::str::from_utf8(layer).ok()?.strip_prefix(id)?.strip_prefix("_P")?;
    // Marking software tells layers by their names: `_P01` is not `_P1`.
    digits.parse().ok().filter(|n: &usize| n.to_string() == digits)
}

/// Reads a drawing.
fn read(bytes: &[u8], visit: &mut Visit<'_>) -> Result<(), Fault> {
    let mut pairs = Pairs { rest: bytes, line: 0 };
    let mut reader =
        Reader { entity: Entity::None, layer: &[], points: Vec::new(), closed: false, at: Point::default() };
    let mut section: &[u8] = b"";
    let mut named = false;
    loop {
        // Sections follow each other and hold everything; only ENTITIES is marked, so the others are passed over.
        // `named` says that the section at hand has its name already.
        let (code, value) = pairs.next()?;
        match (code, value) {
            (0, b"EOF") if section.is_empty() => return Ok(()),
            (0, b"SECTION") if section.is_empty() => named = false,
            (2, name) if section.is_empty() && !named => (section, named) = (name, true),
            (0, b"ENDSEC") if !section.is_empty() => {
                reader.finish(visit).map_err(|m| Fault::new(pairs.line, m))?;
                if reader.entity != Entity::None {
                    return Err(Fault::new(pairs.line, "a POLYLINE has no SEQEND"));
                }
                section = b"";
            }
            _ if section == b"ENTITIES" => reader.pair(code, value, visit).map_err(|m| Fault::new(pairs.line, m))?,
            (999, _) => {}
            _ if section.is_empty() => return Err(Fault::new(pairs.line, "something lies between sections")),
            _ => {}
        }
    }
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Entity {
    None,
    Dot,
    Line,
    Polyline,
    Vertex,
    Seqend,
}

/// Coordinates of the entity being read: first point and, for lines, second point.
#[derive(Clone, Copy, Default)]
struct Point {
    xy: [Option<i64>; 2],
    end: [Option<i64>; 2],
}

struct Reader<'a> {
    entity: Entity,
    layer: &'a [u8],
    points: Vec<[i64; 2]>,
    closed: bool,
    at: Point,
}

impl<'a> Reader<'a> {
    fn pair(&mut self, code: i64, value: &'a [u8], visit: &mut Visit<'_>) -> Result<(), String> {
        if code == 0 {
            self.finish(visit)?;
            return self.begin(value, visit);
        }
        let mm =
            || nm_from_decimal(value).ok_or_else(|| "a coordinate is not a decimal of whole nanometres".to_owned());
        match (code, self.entity) {
            (_, Entity::None) => return Err("there is data before the first entity".into()),
            (8, Entity::Dot | Entity::Line | Entity::Polyline) => self.layer = value,
            (8, Entity::Vertex) if value != self.layer => return Err("a VERTEX lies on another layer".into()),
            (10, Entity::Dot | Entity::Line | Entity::Vertex) => self.at.xy[0] = Some(mm()?),
            (20, Entity::Dot | Entity::Line | Entity::Vertex) => self.at.xy[1] = Some(mm()?),
            (11, Entity::Line) => self.at.end[0] = Some(mm()?),
            (21, Entity::Line) => self.at.end[1] = Some(mm()?),
            (10 | 20 | 30 | 31 | 38 | 39, _) if mm()? != 0 => return Err("a height or thickness is not 0".into()),
            (42, _) if mm()? != 0 => return Err("a bulge is not 0".into()),
            (70, Entity::Polyline) => match integer(value) {
                Some(flags @ (0 | 1)) => self.closed = flags == 1,
                _ => return Err("POLYLINE flags are neither 0 nor 1".into()),
            },
            _ => {}
        }
        Ok(())
    }

    fn begin(&mut self, name: &[u8], visit: &mut Visit<'_>) -> Result<(), String> {
        let inside = self.entity == Entity::Polyline; // finish() has ended any VERTEX
        match name {
            b"POINT" if !inside => self.entity = Entity::Dot,
            b"LINE" if !inside => self.entity = Entity::Line,
            b"POLYLINE" if !inside => {
                self.entity = Entity::Polyline;
                (self.closed, self.layer) = (false, &[]);
                self.points.clear();
            }
            b"VERTEX" if inside => self.entity = Entity::Vertex,
            b"SEQEND" if inside => {
                if self.closed
                    && let Some(&first) = self.points.first()
                {
                    self.points.push(first);
                }
                if self.points.len() < 2 {
                    return Err("a POLYLINE has fewer than two vertices".into());
                }
                visit(self.layer, &self.points);
                self.entity = Entity::Seqend;
            }
            other => return Err(format!("entity {} is not expected here", String::from_utf8_lossy(other))),
        }
        self.at = Point::default();
        Ok(())
    }

    /// Ends the LINE or VERTEX being read.
    fn finish(&mut self, visit: &mut Visit<'_>) -> Result<(), String> {
        let point = |[x, y]: [Option<i64>; 2]| Some([x?, y?]);
        match self.entity {
            Entity::Dot => {
                visit(self.layer, &[point(self.at.xy).ok_or("a POINT lacks a coordinate")?]);
                self.entity = Entity::None;
            }
            Entity::Line => {
                let (Some(a), Some(b)) = (point(self.at.xy), point(self.at.end)) else {
                    return Err("a LINE lacks a coordinate".into());
                };
                visit(self.layer, &[a, b]);
                self.entity = Entity::None;
            }
            Entity::Vertex => {
                self.points.push(point(self.at.xy).ok_or("a VERTEX lacks a coordinate")?);
                self.entity = Entity::Polyline;
            }
            Entity::Seqend => self.entity = Entity::None,
            Entity::None | Entity::Polyline => {}
        }
        Ok(())
    }
}

/// Group codes and values, two lines each.
struct Pairs<'a> {
    rest: &'a [u8],
    line: usize,
}

impl<'a> Pairs<'a> {
    fn next(&mut self) -> Result<(i64, &'a [u8]), Fault> {
        let code = self.line()?.trim_ascii();
        let code = integer(code).ok_or_else(|| Fault::new(self.line, "is not a group code"))?;
        Ok((code, self.line()?.trim_ascii()))
    }
    fn line(&mut self) -> Result<&'a [u8], Fault> {
        self.line += 1;
        let Some(end) = self.rest.iter().position(|&c| c == b'\n') else {
            return Err(Fault::new(self.line, "the file ends before EOF"));
        };
        let line = &self.rest[..end];
        self.rest = &self.rest[end + 1..];
        Ok(line)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEAD: &str = "0\nSECTION\n2\nHEADER\n9\n$ACADVER\n1\nAC1009\n0\nENDSEC\n0\nSECTION\n2\nENTITIES\n";
    const LINE: &str = "0\nLINE\n8\nB0001_P1\n10\n-5.000000\n20\n1.5\n30\n0.0\n11\n5.000001\n21\n1.5\n31\n0.0\n";
    const LOOP: &str = "0\nPOLYLINE\n8\nB0001_P2\n66\n1\n10\n0.0\n20\n0.0\n30\n0.0\n70\n1\n\
        0\nVERTEX\n8\nB0001_P2\n10\n0.0\n20\n0.0\n0\nVERTEX\n8\nB0001_P2\n10\n1.0\n20\n0.0\n\
        0\nVERTEX\n8\nB0001_P2\n10\n1.0\n20\n1.0\n0\nSEQEND\n8\nB0001_P2\n";
    const TAIL: &str = "0\nENDSEC\n0\nEOF\n";

    type Drawn = (String, Vec<[i64; 2]>);

    fn strokes(text: &str) -> Result<Vec<Drawn>, Fault> {
        let mut out = Vec::new();
        read(text.as_bytes(), &mut |layer, points| {
            out.push((String::from_utf8_lossy(layer).into_owned(), points.to_vec()));
        })?;
        Ok(out)
    }

    #[test]
    fn lines_and_closed_polylines_come_in_file_order() {
        let text = format!("{HEAD}{LINE}{LOOP}{LINE}{TAIL}");
        for text in [text.clone(), text.replace('\n', "\r\n")] {
            let all = strokes(&text).expect("sound");
            assert_eq!(all.len(), 3);
            assert_eq!(all[0], ("B0001_P1".into(), vec![[-5_000_000, 1_500_000], [5_000_001, 1_500_000]]));
            let ring = vec![[0, 0], [1_000_000, 0], [1_000_000, 1_000_000], [0, 0]];
            assert_eq!(all[1], ("B0001_P2".into(), ring));
        }
    }

    #[test]
    fn dxf_that_controllers_misread_is_a_fault() {
        let sound = format!("{HEAD}{LINE}{LOOP}{TAIL}");
        for end in 0..sound.len() {
            assert!(strokes(&sound[..end]).is_err(), "cut at {end}");
        }
        for (from, to) in [
            ("31\n0.0", "31\n0.5"),
            ("0\nLINE", "0\nCIRCLE"),
            ("21\n1.5\n", ""),
            ("5.000001", "5.0000011"),
            ("5.000001", "5e3"),
            ("70\n1", "70\n8"),
            ("0\nSEQEND\n", ""),
            ("8\nB0001_P2\n10\n1.0", "8\nOTHER\n10\n1.0"),
        ] {
            assert!(strokes(&sound.replace(from, to)).is_err(), "{from:?} -> {to:?}");
        }
    }
}
