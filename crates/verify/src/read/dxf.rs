//! Reader of the block drawings: DXF R12 text with POINT, LINE and POLYLINE entities.
//!
//! Consumes the bytes of one file; hands over each stroke in file order, in whole nanometres, with its
//! layer. A closed polyline ends on the point it starts with. The file is read whole: header, line type and layers are
//! those that stand in [`Head`], an entity has the group codes of its kind, each once, and nothing else stands in the
//! file. Marking software acts on more than coordinates: units, colours, visibility, extrusion.

use super::number::{integer, nm_from_decimal};
use super::{Fault, FileStroke, Strokes};

/// Takes layer and points of a stroke.
type Visit<'v> = dyn FnMut(&[u8], &[[i64; 2]]) + 'v;

/// Reads the drawing of a block, whose layers are `B0001_P1` and so on: block and pen from 1.
pub(super) fn strokes(bytes: &[u8], id: &str, visit: &mut Strokes<'_>) -> Result<(), Fault> {
    let mut pairs = Pairs { rest: bytes, line: 0 };
    let mut layers = Head { pairs: &mut pairs }.layers(id)?;
    entities(&mut pairs, &mut |layer, points| {
        let pen = pen(layer, id);
        if let Some(known) = layers.iter_mut().find(|known| Some(known.pen) == pen) {
            known.is_used = true;
            visit(FileStroke { pen, points, settings: &[] });
        } else {
            visit(FileStroke { pen: None, points, settings: &[] });
        }
    })?;
    match layers.iter().find(|layer| !layer.is_used) {
        Some(layer) => Err(Fault::new(0, format!("layer {id}_P{} holds nothing", layer.pen))),
        None => Ok(()),
    }
}

/// The pen that a layer of the block stands for.
fn pen(layer: &[u8], id: &str) -> Option<usize> {
    let digits = std::str::from_utf8(layer).ok()?.strip_prefix(id)?.strip_prefix("_P")?;
    // Marking software tells layers by their names: `_P01` is not `_P1`.
    digits.parse().ok().filter(|n: &usize| n.to_string() == digits)
}

/// A layer of the table.
struct TableLayer {
    pen: usize,
    is_used: bool,
}

/// The part before the entities: the version, one line type, and the layers.
struct Head<'p, 'a> {
    pairs: &'p mut Pairs<'a>,
}

impl Head<'_, '_> {
    /// Reads it, and returns the layers.
    fn layers(mut self, id: &str) -> Result<Vec<TableLayer>, Fault> {
        self.expect(&[(0, "SECTION"), (2, "HEADER"), (9, "$ACADVER"), (1, "AC1009"), (0, "ENDSEC")])?;
        self.expect(&[(0, "SECTION"), (2, "TABLES"), (0, "TABLE"), (2, "LTYPE"), (70, "1")])?;
        self.expect(&[(0, "LTYPE"), (2, "CONTINUOUS"), (70, "0"), (3, "Solid line")])?;
        self.expect(&[(72, "65"), (73, "0"), (40, "0.0"), (0, "ENDTAB"), (0, "TABLE"), (2, "LAYER")])?;
        let (code, value) = self.pairs.next()?;
        let count = integer(value).filter(|&n| code == 70 && (0..=65_535).contains(&n));
        let count = count.ok_or_else(|| self.fault("the number of layers is expected here"))?;
        let mut layers: Vec<TableLayer> = Vec::new();
        for _ in 0..count {
            self.expect(&[(0, "LAYER")])?;
            let (code, value) = self.pairs.next()?;
            let pen = pen(value, id).filter(|&pen| code == 2 && pen > layers.last().map_or(0, |last| last.pen));
            let Some(pen) = pen else {
                return Err(self.fault(&format!("a layer of {id} is expected here, in the order of the pens")));
            };
            // The colour of a layer is the number of its pen; there are 255.
            let colour = ((pen - 1) % 255 + 1).to_string();
            self.expect(&[(70, "0"), (62, &colour), (6, "CONTINUOUS")])?;
            layers.push(TableLayer { pen, is_used: false });
        }
        self.expect(&[(0, "ENDTAB"), (0, "ENDSEC"), (0, "SECTION"), (2, "ENTITIES")])?;
        Ok(layers)
    }

    fn expect(&mut self, wanted: &[(i64, &str)]) -> Result<(), Fault> {
        for &(code, value) in wanted {
            if self.pairs.next()? != (code, value.as_bytes()) {
                return Err(self.fault(&format!("{code} {value} is expected here")));
            }
        }
        Ok(())
    }

    fn fault(&self, text: &str) -> Fault {
        Fault::new(self.pairs.line, text)
    }
}

/// Reads the entities to the end of the file.
fn entities(pairs: &mut Pairs<'_>, visit: &mut Visit<'_>) -> Result<(), Fault> {
    let mut reader =
        Reader { entity: Entity::None, layer: &[], points: Vec::new(), closed: false, at: Point::default(), seen: 0 };
    loop {
        match pairs.next()? {
            (0, b"ENDSEC") => {
                reader.finish(visit).map_err(|m| Fault::new(pairs.line, m))?;
                if reader.entity != Entity::None {
                    return Err(Fault::new(pairs.line, "a POLYLINE has no SEQEND"));
                }
                break;
            }
            (code, value) => reader.pair(code, value, visit).map_err(|m| Fault::new(pairs.line, m))?,
        }
    }
    if pairs.next()? != (0, b"EOF") || !pairs.rest.is_empty() {
        return Err(Fault::new(pairs.line, "something follows the entities"));
    }
    Ok(())
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Entity {
    None,
    Dot,
    Line,
    Polyline,
    /// Before a vertex of a POLYLINE or its end.
    Vertices,
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
    /// The group codes of the entity so far, a bit each.
    seen: u128,
}

/// The group codes that an entity has, those that it must have first; what else may stand follows their number.
fn codes(entity: Entity) -> (&'static [i64], usize) {
    match entity {
        Entity::None | Entity::Vertices => (&[], 0),
        Entity::Dot | Entity::Vertex => (&[8, 10, 20, 30], 4),
        Entity::Line => (&[8, 10, 20, 30, 11, 21, 31], 7),
        Entity::Polyline => (&[8, 66, 10, 20, 30, 70], 5),
        Entity::Seqend => (&[8], 1),
    }
}

impl<'a> Reader<'a> {
    fn pair(&mut self, code: i64, value: &'a [u8], visit: &mut Visit<'_>) -> Result<(), String> {
        if code == 0 {
            self.finish(visit)?;
            return self.begin(value, visit);
        }
        if self.entity != Entity::None && !codes(self.entity).0.contains(&code) {
            return Err(format!("group code {code} is not expected in this entity"));
        }
        if self.entity == Entity::None {
            return Err("there is data before the first entity".into());
        }
        if self.seen & (1 << code) != 0 {
            return Err(format!("group code {code} stands twice in this entity"));
        }
        self.seen |= 1 << code;
        let mm =
            || nm_from_decimal(value).ok_or_else(|| "a coordinate is not a decimal of whole nanometres".to_owned());
        match (code, self.entity) {
            (8, Entity::Dot | Entity::Line | Entity::Polyline) => self.layer = value,
            (8, _) if value != self.layer => return Err("it lies on another layer than its POLYLINE".into()),
            (8, _) => {}
            (10, Entity::Dot | Entity::Line | Entity::Vertex) => self.at.xy[0] = Some(mm()?),
            (20, Entity::Dot | Entity::Line | Entity::Vertex) => self.at.xy[1] = Some(mm()?),
            (11, Entity::Line) => self.at.end[0] = Some(mm()?),
            (21, Entity::Line) => self.at.end[1] = Some(mm()?),
            (66, _) if integer(value) == Some(1) => {}
            (70, _) if integer(value) == Some(1) => self.closed = true,
            (66 | 70, _) => return Err("a flag of the POLYLINE is not 1".into()),
            _ if mm()? != 0 => return Err("a height is not 0".into()),
            _ => {}
        }
        Ok(())
    }

    /// Holds that the entity has what it must have.
    fn is_whole(&self) -> Result<(), String> {
        let (codes, must) = codes(self.entity);
        match codes[..must].iter().find(|&&code| self.seen & (1 << code) == 0) {
            Some(code) => Err(format!("an entity lacks group code {code}")),
            None => Ok(()),
        }
    }

    fn begin(&mut self, name: &[u8], visit: &mut Visit<'_>) -> Result<(), String> {
        let inside = self.entity == Entity::Vertices; // finish() has ended any VERTEX
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
        (self.at, self.seen) = (Point::default(), 0);
        Ok(())
    }

    /// Ends what is being read.
    fn finish(&mut self, visit: &mut Visit<'_>) -> Result<(), String> {
        self.is_whole()?;
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
                self.entity = Entity::Vertices;
            }
            Entity::Polyline => self.entity = Entity::Vertices,
            Entity::Seqend => self.entity = Entity::None,
            Entity::None | Entity::Vertices => {}
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
        let code = self.line()?;
        let code = integer(code).ok_or_else(|| Fault::new(self.line, "is not a group code"))?;
        Ok((code, self.line()?))
    }
    fn line(&mut self) -> Result<&'a [u8], Fault> {
        self.line += 1;
        let Some(end) = self.rest.iter().position(|&c| c == b'\n') else {
            return Err(Fault::new(self.line, "the file ends before EOF"));
        };
        let line = &self.rest[..end];
        self.rest = &self.rest[end + 1..];
        let line = line.strip_suffix(b"\r").unwrap_or(line);
        if line.iter().all(|c| matches!(c, b' '..=b'~')) {
            Ok(line)
        } else {
            Err(Fault::new(self.line, "holds bytes that are not printable ASCII"))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEAD: &str = "0\nSECTION\n2\nHEADER\n9\n$ACADVER\n1\nAC1009\n0\nENDSEC\n0\nSECTION\n2\nTABLES\n\
        0\nTABLE\n2\nLTYPE\n70\n1\n0\nLTYPE\n2\nCONTINUOUS\n70\n0\n3\nSolid line\n72\n65\n73\n0\n40\n0.0\n0\nENDTAB\n\
        0\nTABLE\n2\nLAYER\n70\n2\n0\nLAYER\n2\nB0001_P1\n70\n0\n62\n1\n6\nCONTINUOUS\n\
        0\nLAYER\n2\nB0001_P2\n70\n0\n62\n2\n6\nCONTINUOUS\n0\nENDTAB\n0\nENDSEC\n0\nSECTION\n2\nENTITIES\n";
    const LINE: &str = "0\nLINE\n8\nB0001_P1\n10\n-5.000000\n20\n1.5\n30\n0.0\n11\n5.000001\n21\n1.5\n31\n0.0\n";
    const LOOP: &str = "0\nPOLYLINE\n8\nB0001_P2\n66\n1\n10\n0.0\n20\n0.0\n30\n0.0\n70\n1\n\
        0\nVERTEX\n8\nB0001_P2\n10\n0.0\n20\n0.0\n30\n0.0\n0\nVERTEX\n8\nB0001_P2\n10\n1.0\n20\n0.0\n30\n0.0\n\
        0\nVERTEX\n8\nB0001_P2\n10\n1.0\n20\n1.0\n30\n0.0\n0\nSEQEND\n8\nB0001_P2\n";
    const TAIL: &str = "0\nENDSEC\n0\nEOF\n";

    type Drawn = (Option<usize>, Vec<[i64; 2]>);

    fn drawn(text: &str) -> Result<Vec<Drawn>, Fault> {
        let mut out = Vec::new();
        strokes(text.as_bytes(), "B0001", &mut |stroke| out.push((stroke.pen, stroke.points.to_vec())))?;
        Ok(out)
    }

    #[test]
    fn lines_and_closed_polylines_come_in_file_order() {
        let text = format!("{HEAD}{LINE}{LOOP}{LINE}{TAIL}");
        for text in [text.clone(), text.replace('\n', "\r\n")] {
            let all = drawn(&text).expect("sound");
            assert_eq!(all.len(), 3);
            assert_eq!(all[0], (Some(1), vec![[-5_000_000, 1_500_000], [5_000_001, 1_500_000]]));
            let ring = vec![[0, 0], [1_000_000, 0], [1_000_000, 1_000_000], [0, 0]];
            assert_eq!(all[1], (Some(2), ring));
        }
    }

    #[test]
    fn dxf_that_controllers_misread_is_a_fault() {
        let sound = format!("{HEAD}{LINE}{LOOP}{TAIL}");
        for end in 0..sound.len() {
            assert!(drawn(&sound[..end]).is_err(), "cut at {end}");
        }
        for (from, to) in [
            ("31\n0.0", "31\n0.5"),
            ("0\nLINE", "0\nCIRCLE"),
            ("21\n1.5\n", ""),
            ("5.000001", "5.0000011"),
            ("5.000001", "5e3"),
            ("70\n1\n0\nVERTEX", "70\n8\n0\nVERTEX"),
            ("0\nSEQEND\n", ""),
            ("8\nB0001_P2\n10\n1.0", "8\nOTHER\n10\n1.0"),
            // What is more than lines: mirrored, another pen, invisible, off, dashed, wide, in paper space, in inch.
            ("8\nB0001_P1\n", "8\nB0001_P1\n230\n-1.0\n"),
            ("8\nB0001_P1\n", "8\nB0001_P1\n62\n3\n"),
            ("8\nB0001_P1\n", "8\nB0001_P1\n60\n1\n"),
            ("8\nB0001_P1\n", "8\nB0001_P1\n67\n1\n"),
            ("8\nB0001_P1\n", "8\nB0001_P1\n6\nDASHED\n"),
            ("8\nB0001_P1\n", "8\nB0001_P1\n10\n1.0\n"),
            ("66\n1\n", "66\n1\n40\n1.0\n"),
            ("62\n2\n", "62\n-2\n"),
            ("62\n2\n", "62\n1\n"),
            ("2\nB0001_P2\n70\n0\n", "2\nB0001_P2\n70\n1\n"),
            ("2\nB0001_P2\n70\n0\n", "2\nB0001_P3\n70\n0\n"),
            ("AC1009\n", "AC1009\n9\n$INSUNITS\n70\n1\n"),
            ("0\nEOF\n", "0\nSECTION\n2\nentities\n0\nENDSEC\n0\nEOF\n"),
            ("0\nEOF\n", "0\nEOF\n0\nLINE\n"),
            ("0\nLINE", "999\nnote\n0\nLINE"),
            ("Solid line", "Solid\u{7f}line"),
        ] {
            let changed = sound.replacen(from, to, 1);
            assert!(drawn(&changed).is_err(), "{from:?} -> {to:?}");
        }
        assert!(drawn(&sound).is_ok());
    }
}
