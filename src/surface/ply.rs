//! PLY polygons: ASCII, and binary in either byte order.
//!
//! Consumes the header, then one element after the other through one buffer; holds all vertices (24 bytes each), faces
//! go on at once, so they stand after the vertices that they name. Of a vertex x, y and z are read, whatever their type,
//! of a face the list of its vertices. Polygons become triangles as in OBJ files. All other elements and properties are
//! passed over; a warning names elements. Numbers of elements in the header are held against the length of the file
//! before memory is asked for.

use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;

use super::Content;
use super::facets::{Facets, Unit};
use super::lines::{self, MAX_LINE, no_number, number, place, shown, words};
use super::polygon::{MAX_CORNERS, triangulate};
use crate::diag::{Diag, Error, Place, memory, unreadable};

/// Most lines of a header; names of textures and notes of scanners take some hundreds.
const MAX_HEADER: usize = 10_000;

const AGAIN: &str = "export the surface again as PLY or STL";

/// How the values are written.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Encoding {
    Ascii,
    Little,
    Big,
}

/// A type of values: its size in bytes, and whether it is a float, or an integer with a sign.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Scalar {
    Unsigned(usize),
    Signed(usize),
    Float(usize),
}

impl Scalar {
    fn named(name: &[u8]) -> Option<Self> {
        Some(match name {
            b"char" | b"int8" => Self::Signed(1),
            b"uchar" | b"uint8" => Self::Unsigned(1),
            b"short" | b"int16" => Self::Signed(2),
            b"ushort" | b"uint16" => Self::Unsigned(2),
            b"int" | b"int32" => Self::Signed(4),
            b"uint" | b"uint32" => Self::Unsigned(4),
            b"float" | b"float32" => Self::Float(4),
            b"double" | b"float64" => Self::Float(8),
            _ => return None,
        })
    }

    const fn size(self) -> usize {
        match self {
            Self::Unsigned(size) | Self::Signed(size) | Self::Float(size) => size,
        }
    }

    /// The value of bytes with the lowest first.
    fn value(self, bytes: &[u8]) -> f64 {
        let mut all = [0; 8];
        all[..bytes.len()].copy_from_slice(bytes);
        let bits = u64::from_le_bytes(all);
        match self {
            Self::Float(4) => f64::from(f32::from_bits(bits as u32)),
            Self::Float(_) => f64::from_bits(bits),
            Self::Unsigned(_) => bits as f64,
            Self::Signed(size) => {
                let shift = 64 - 8 * size;
                ((bits << shift) as i64 >> shift) as f64
            }
        }
    }
}

/// A property: its name, its type, and the type of the count where it is a list.
#[derive(Clone, Debug)]
struct Property {
    name: Vec<u8>,
    of: Scalar,
    list: Option<Scalar>,
}

/// A kind of elements, of which the file holds so many.
#[derive(Clone, Debug)]
struct Element {
    name: Vec<u8>,
    count: u64,
    properties: Vec<Property>,
}

/// Reads a PLY file; `unit` is what its numbers are.
pub(crate) fn read(
    path: &Path,
    unit: Unit,
    notes: &mut Vec<Diag>,
    sink: &mut dyn FnMut([[f64; 3]; 3]),
) -> Result<Content, Error> {
    let (file, length) = lines::open(path)?;
    let mut input = Input { path, input: BufReader::with_capacity(1 << 20, file), line: Vec::new(), number: 0 };
    let (encoding, elements) = input.header()?;
    check_counts(&elements, encoding, length).map_err(|d| d.at(place(path)))?;
    let mut reader = Reader { input, encoding, words: Vec::new() };
    let mut facets = Facets::new(path, unit, sink);
    let mut vertices: Vec<[f64; 3]> = Vec::new();
    let mut others: Vec<String> = Vec::new();
    let mut crossed = None;
    for element in &elements {
        match element.name.as_slice() {
            b"vertex" => reader.vertices(element, &mut vertices)?,
            b"face" => reader.faces(element, &vertices, &mut facets, &mut crossed)?,
            name => {
                others.push(format!("{} ({})", shown(name), element.count));
                (0..element.count).try_for_each(|i| reader.element(element, i, &mut |_, _| Ok(())))?;
            }
        }
    }
    if facets.count() == 0 {
        let text = format!("the file holds {} vertices but no faces", vertices.len());
        let d = Diag::input("surface-empty", text).at(place(path));
        return Err(d.hint("export the surface with faces; a cloud of points can be read as .xyz").into());
    }
    if !others.is_empty() {
        let text = format!("elements that are not read: {}", others.join(", "));
        notes.push(Diag::warning("ply-elements", text).at(place(path)).hint("only vertices and faces are the surface"));
    }
    notes.extend(crossed.map(|face| {
        let text = format!("face {face} (counted from 0) is not simple: its outline crosses or touches itself");
        Diag::warning("ply-crossed", text)
            .at(place(path))
            .hint("its triangles may not cover it: export the surface as triangles")
    }));
    facets.finish(notes)
}

/// Holds what the header promises against the length of the file, and asks for memory.
fn check_counts(elements: &[Element], encoding: Encoding, length: u64) -> Result<(), Diag> {
    let named = |name: &[u8]| elements.iter().position(|e| e.name == name);
    let (vertex, face) = (named(b"vertex"), named(b"face"));
    if vertex.zip(face).is_some_and(|(vertex, face)| vertex > face) {
        return Err(Diag::input("ply-header", "faces stand before the vertices that they name").hint(AGAIN));
    }
    if let Some(strips) = elements.iter().find(|e| e.name == b"tristrips" && e.count > 0) {
        let text = format!("the surface is written as {} strips of triangles, which are not read", strips.count);
        return Err(Diag::input("ply-header", text).hint("export it as triangles"));
    }
    // A list of no items has its count alone; of text a digit and a space.
    let least = |p: &Property| match encoding {
        Encoding::Ascii => 2,
        _ => p.list.unwrap_or(p.of).size() as u64,
    };
    let mut need = 0u64;
    for element in elements {
        let size = element.properties.iter().map(least).sum::<u64>().max(1);
        need = need.saturating_add(element.count.saturating_mul(size));
    }
    // The last line may lack its end.
    if need > length + 1 {
        let text = format!("the header promises elements of {need} bytes at least, the file has {length} bytes");
        return Err(
            Diag::input("ply-truncated", text).hint("the file is cut short or damaged: export or copy it again")
        );
    }
    let count = |i: Option<usize>| i.map_or(0, |i| elements[i].count);
    let bytes = count(vertex).saturating_mul(24).saturating_add(super::FACET_BYTES.saturating_mul(count(face)));
    memory::ask("the mesh", bytes)
}

/// The file, of which lines and bytes are taken.
struct Input<'a> {
    path: &'a Path,
    input: BufReader<File>,
    line: Vec<u8>,
    number: usize,
}

impl Input<'_> {
    fn place(&self) -> Place {
        Place::line(self.path.display().to_string(), self.number)
    }

    fn fault(&self, d: Diag) -> Error {
        d.at(self.place()).hint(AGAIN).into()
    }

    /// Reads a line without its end into `line`; false at the end of the file.
    fn next_line(&mut self) -> Result<bool, Error> {
        self.line.clear();
        let most = MAX_LINE as u64 + 2;
        let read = self.input.by_ref().take(most).read_until(b'\n', &mut self.line);
        let read = read.map_err(|e| unreadable(self.path, &e))?;
        self.number += usize::from(read > 0);
        if self.line.len() > MAX_LINE {
            return Err(self.fault(Diag::input("line-too-long", format!("a line has more than {MAX_LINE} bytes"))));
        }
        while matches!(self.line.last(), Some(b'\n' | b'\r')) {
            self.line.pop();
        }
        Ok(read > 0)
    }

    /// Reads the header: how values are written, and which elements follow.
    fn header(&mut self) -> Result<(Encoding, Vec<Element>), Error> {
        if !self.next_line()? || self.line != b"ply" {
            let d = Diag::input("surface-format", "the file does not begin with the line \"ply\"").at(place(self.path));
            return Err(d.hint("give the file the extension of its format, or export it as PLY").into());
        }
        let (mut encoding, mut elements) = (None, Vec::<Element>::new());
        while self.number < MAX_HEADER && self.next_line()? {
            let line = std::mem::take(&mut self.line);
            let found: Vec<&[u8]> = words(&line).collect();
            match found.as_slice() {
                [] | [b"comment" | b"obj_info", ..] => {}
                [b"format", b"ascii", b"1.0"] => encoding = Some(Encoding::Ascii),
                [b"format", b"binary_little_endian", b"1.0"] => encoding = Some(Encoding::Little),
                [b"format", b"binary_big_endian", b"1.0"] => encoding = Some(Encoding::Big),
                [b"element", name, count] => {
                    let count = std::str::from_utf8(count).ok().and_then(|n| n.parse().ok());
                    let count =
                        count.ok_or_else(|| self.fault(Diag::input("ply-header", "an element has no number")))?;
                    elements.push(Element { name: name.to_vec(), count, properties: Vec::new() });
                }
                [b"property", of @ .., name] if !of.is_empty() => {
                    let property = property(of, name);
                    let (Some(property), Some(element)) = (property, elements.last_mut()) else {
                        return Err(
                            self.fault(Diag::input("ply-header", format!("\"{}\" is no property", shown(&line))))
                        );
                    };
                    element.properties.push(property);
                }
                [b"end_header"] => {
                    let encoding =
                        encoding.ok_or_else(|| self.fault(Diag::input("ply-header", "the header names no format")))?;
                    return Ok((encoding, elements));
                }
                _ => {
                    return Err(
                        self.fault(Diag::input("ply-header", format!("\"{}\" is not known in a header", shown(&line))))
                    );
                }
            }
            self.line = line;
        }
        Err(self.fault(Diag::input("ply-header", "the header does not end with \"end_header\"")))
    }
}

/// The property of these words: its type, or `list`, the type of the count, and the type of the items.
fn property(of: &[&[u8]], name: &[u8]) -> Option<Property> {
    let (of, list) = match of {
        [of] => (Scalar::named(of)?, None),
        [b"list", count, of] => match Scalar::named(count)? {
            Scalar::Float(_) => return None,
            count => (Scalar::named(of)?, Some(count)),
        },
        _ => return None,
    };
    Some(Property { name: name.to_vec(), of, list })
}

/// What is done with the values of an element: the number of their property, and the value.
type Take<'a> = dyn FnMut(usize, f64) -> Result<(), Diag> + 'a;

/// Reads elements as they are written.
struct Reader<'a> {
    input: Input<'a>,
    encoding: Encoding,
    /// The values of a line of text.
    words: Vec<f64>,
}

impl Reader<'_> {
    /// Where element `i` of a kind stands, as far as it can be said.
    fn place(&self) -> Place {
        match self.encoding {
            Encoding::Ascii => self.input.place(),
            _ => place(self.input.path),
        }
    }

    /// Reads element `i` of a kind, and hands on its values; a list as its items.
    fn element(&mut self, element: &Element, i: u64, take: &mut Take<'_>) -> Result<(), Error> {
        let name = || format!("{} {i} (counted from 0)", shown(&element.name));
        let mut at = 0;
        if self.encoding == Encoding::Ascii {
            self.line(&name)?;
        }
        for (k, property) in element.properties.iter().enumerate() {
            let items = match property.list {
                None => 1.0,
                Some(count) => self.value(count, &mut at, &name)?,
            };
            if !(0.0..=1e9).contains(&items) || items.fract() != 0.0 {
                let d = Diag::input("ply-count", format!("{} has a list of {items} items", name()));
                return Err(d.at(self.place()).hint(AGAIN).into());
            }
            for _ in 0..items as u64 {
                let value = self.value(property.of, &mut at, &name)?;
                take(k, value).map_err(|d| {
                    let text = format!("{}: {}", name(), d.message);
                    Diag { message: text, ..d }.at(self.place())
                })?;
            }
        }
        Ok(())
    }

    /// Reads the numbers of the next line that is not empty.
    fn line(&mut self, name: &dyn Fn() -> String) -> Result<(), Error> {
        self.words.clear();
        while self.words.is_empty() {
            if !self.input.next_line()? {
                return Err(self.input.fault(Diag::input("ply-truncated", format!("the file ends before {}", name()))));
            }
            for word in words(&self.input.line) {
                let value = number(word).map_err(|why| no_number(word, why, self.input.place()))?;
                self.words.push(value);
            }
        }
        Ok(())
    }

    /// The next value; `at` counts those of a line of text.
    fn value(&mut self, of: Scalar, at: &mut usize, name: &dyn Fn() -> String) -> Result<f64, Error> {
        if self.encoding == Encoding::Ascii {
            let value = self.words.get(*at).copied();
            *at += 1;
            return value.ok_or_else(|| {
                self.input.fault(Diag::input("ply-truncated", format!("{} has too few numbers", name())))
            });
        }
        let mut bytes = [0; 8];
        let bytes = &mut bytes[..of.size()];
        self.input.input.read_exact(bytes).map_err(|e| match e.kind() {
            std::io::ErrorKind::UnexpectedEof => {
                let d =
                    Diag::input("ply-truncated", format!("the file ends inside {}", name())).at(place(self.input.path));
                Error::from(d.hint("the file is cut short: export or copy it again"))
            }
            _ => unreadable(self.input.path, &e).into(),
        })?;
        if self.encoding == Encoding::Big {
            bytes.reverse();
        }
        Ok(of.value(bytes))
    }

    fn vertices(&mut self, element: &Element, out: &mut Vec<[f64; 3]>) -> Result<(), Error> {
        let of = |name: &[u8]| element.properties.iter().position(|p| p.name == name && p.list.is_none());
        let (Some(x), Some(y), Some(z)) = (of(b"x"), of(b"y"), of(b"z")) else {
            let d = Diag::input("ply-header", "vertices have no x, y and z").at(place(self.input.path));
            return Err(d.hint(AGAIN).into());
        };
        for i in 0..element.count {
            let mut p = [0.0; 3];
            self.element(element, i, &mut |k, value| {
                let Some(axis) = [x, y, z].iter().position(|&at| at == k) else { return Ok(()) };
                p[axis] = value;
                if value.is_finite() {
                    return Ok(());
                }
                let d = Diag::input("surface-number", format!("a coordinate is {value}"));
                Err(d.hint("repair the surface: a facet without a place cannot be marked"))
            })?;
            out.push(p);
        }
        Ok(())
    }

    fn faces(
        &mut self,
        element: &Element,
        vertices: &[[f64; 3]],
        facets: &mut Facets<'_>,
        crossed: &mut Option<u64>,
    ) -> Result<(), Error> {
        let is_corners = |p: &Property| [&b"vertex_indices"[..], b"vertex_index"].contains(&p.name.as_slice());
        let Some(corners) = element.properties.iter().position(|p| is_corners(p) && p.list.is_some()) else {
            let d = Diag::input("ply-header", "faces have no list vertex_indices").at(place(self.input.path));
            return Err(d.hint(AGAIN).into());
        };
        let mut polygon: Vec<[f64; 3]> = Vec::new();
        for i in 0..element.count {
            polygon.clear();
            self.element(element, i, &mut |k, value| {
                if k != corners {
                    return Ok(());
                }
                let index = if value >= 0.0 && value.fract() == 0.0 { value as usize } else { usize::MAX };
                let Some(&vertex) = vertices.get(index) else {
                    let text =
                        format!("it refers to vertex {value}, the vertices are 0 to {}", vertices.len() as i64 - 1);
                    return Err(Diag::input("ply-index", text).hint(AGAIN));
                };
                if polygon.len() == MAX_CORNERS {
                    let text = format!("it has more than {MAX_CORNERS} corners");
                    return Err(Diag::input("ply-index", text).hint("export the surface as triangles"));
                }
                polygon.push(vertex);
                Ok(())
            })?;
            if polygon.len() < 3 {
                let text = format!("face {i} (counted from 0) has {} corners, it needs three or more", polygon.len());
                return Err(Diag::input("ply-index", text).at(self.place()).hint(AGAIN).into());
            }
            if !triangulate(&polygon, facets) {
                crossed.get_or_insert(i);
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    type Outcome = (Result<Content, Error>, Vec<[[f64; 3]; 3]>, Vec<Diag>);

    fn read_bytes(bytes: &[u8]) -> Outcome {
        let dir = tempfile::tempdir().expect("a folder");
        let path = dir.path().join("a.ply");
        std::fs::write(&path, bytes).expect("written");
        let (mut got, mut notes) = (vec![], vec![]);
        let result = read(&path, Unit::mm(1.0), &mut notes, &mut |f| got.push(f));
        (result, got, notes)
    }

    const HEAD: &str = "element vertex 4\nproperty float x\nproperty uchar red\nproperty double y\nproperty short z\n\
                        element edge 1\nproperty int a\nelement face 1\nproperty list uchar int vertex_indices\n\
                        property ushort part\nend_header\n";

    #[test]
    fn text_and_both_byte_orders_give_the_same_facets() {
        let corners = [(0.5f32, 0.25f64, -3i16), (8.0, 0.0, 4), (8.0, 9.5, 4), (0.0, 9.0, -300)];
        let mut text = format!("ply\r\nformat ascii 1.0\r\ncomment made\r\n{HEAD}").into_bytes();
        for (x, y, z) in corners {
            text.extend_from_slice(format!("{x} 7 {y} {z}\n").as_bytes());
        }
        text.extend_from_slice(b"1\n\n4 0 1 2 3 65535");
        let binary = |is_big: bool| {
            let format = if is_big { "big" } else { "little" };
            let mut out = format!("ply\nformat binary_{format}_endian 1.0\n{HEAD}").into_bytes();
            let put = |out: &mut Vec<u8>, bytes: &[u8]| {
                let turned: Vec<u8> = if is_big { bytes.iter().rev().copied().collect() } else { bytes.to_vec() };
                out.extend(turned);
            };
            for (x, y, z) in corners {
                put(&mut out, &x.to_le_bytes());
                out.push(7);
                put(&mut out, &y.to_le_bytes());
                put(&mut out, &z.to_le_bytes());
            }
            put(&mut out, &1i32.to_le_bytes());
            out.push(4);
            (0..4i32).for_each(|i| put(&mut out, &i.to_le_bytes()));
            put(&mut out, &u16::MAX.to_le_bytes());
            out
        };
        let wanted = read_bytes(&text);
        assert!(matches!(wanted.0, Ok(Content::Facets(2))), "{:?}", wanted.0.err());
        let all: Vec<[f64; 3]> = wanted.1.iter().flatten().copied().collect();
        assert!(all.contains(&[0.5, 0.25, -3.0]) && all.contains(&[0.0, 9.0, -300.0]));
        for is_big in [false, true] {
            let (result, got, notes) = read_bytes(&binary(is_big));
            assert!(matches!(result, Ok(Content::Facets(2))), "{:?}", result.err());
            assert_eq!(got, wanted.1);
            assert_eq!(notes[0].message, "elements that are not read: edge (1)");
        }
        // Cut anywhere after the header it is refused.
        let whole = binary(false);
        for length in whole.len() - 30..whole.len() {
            let e = read_bytes(&whole[..length]).0.err().expect("cut short");
            assert_eq!(e.diags()[0].code, "ply-truncated", "{e}");
        }
    }

    #[test]
    fn faults_are_named() {
        let body = "0 0 0\n1 0 0\n0 1 0\n";
        let file = |format: &str, list: &str, rest: &str| {
            format!(
                "ply\nformat {format} 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
                 element face 1\nproperty list {list} vertex_indices\nend_header\n{rest}"
            )
        };
        let usual = |rest: &str| file("ascii", "uchar int", &format!("{body}{rest}"));
        for (text, code, say) in [
            (usual("3 0 1 2"), "", ""),
            (
                usual("3 0 1 3"),
                "ply-index",
                ":13: face 0 (counted from 0): it refers to vertex 3, the vertices are 0 to 2",
            ),
            (usual("3 0 1 -1"), "ply-index", "vertex -1"),
            (usual("2 0 1"), "ply-index", "has 2 corners"),
            (usual("3 0 1"), "ply-truncated", "face 0 (counted from 0) has too few numbers"),
            (usual("-1 0 1"), "ply-count", "a list of -1 items"),
            (usual(""), "ply-truncated", "the file ends before face 0"),
            (file("ascii", "uchar int", "0 0 0\n1 x 0\n"), "surface-number", "\"x\""),
            (file("ascii", "uchar int", "0 0 0\n1 0,5 0\n"), "surface-number", "decimal comma"),
            (file("ascii_2", "uchar int", body), "ply-header", ":2: \"format ascii_2 1.0\" is not known"),
            (file("ascii", "float int", body), "ply-header", "is no property"),
            (file("ascii", "uchar int", body).replace("end_header", "end_head"), "ply-header", "\"end_head\""),
            (file("ascii", "uchar int", body).replace(" z\n", " w\n"), "ply-header", "no x, y and z"),
            (file("ascii", "uchar int", body).replace("vertex_indices", "corners"), "ply-header", "no list"),
            (file("ascii", "uchar int", body).replace("vertex 3", "vertex 4000000000"), "ply-truncated", "promises"),
            ("solid a".into(), "surface-format", "does not begin"),
        ] {
            let (result, ..) = read_bytes(text.as_bytes());
            if code.is_empty() {
                assert!(result.is_ok(), "{:?}", result.err());
                continue;
            }
            let e = result.err().expect(say);
            assert_eq!(e.diags()[0].code, code, "{e}");
            assert!(e.to_string().contains(say) && !e.diags()[0].hint.is_empty(), "{say}: {e}");
        }
    }
}
