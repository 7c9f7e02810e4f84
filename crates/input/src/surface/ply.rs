//! PLY polygons: ASCII, and binary in either byte order.
//!
//! Consumes the header, then one element after the other through one buffer; holds all vertices (24 bytes each), faces
//! are passed on at once, so they stand after the vertices that they name. Of a vertex x, y and z are read, whatever
//! their type, of a face the list of its vertices, of a strip of triangles the same with -1 between strips. Polygons
//! become triangles as in OBJ files. All other elements and properties are passed over, whatever their values; a
//! warning names elements. Numbers of elements in the header are held against the length of the file before memory is
//! asked for.

use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;

use super::Content;
use super::facets::{Facets, Unit};
use super::lines::{self, MAX_LINE, NoNumber, no_number, number, place, shown, words};
use super::polygon::{MAX_CORNERS, triangulate};
use super::stated_unit::StatedUnit;
use terrace_core::diag::{Diag, Error, Place, memory, unreadable};

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
    let mut input = Input::new(path, BufReader::with_capacity(1 << 20, file))?;
    let mut stated = StatedUnit::new(unit);
    let (encoding, elements) = input.header(&mut stated, notes)?;
    notes.extend(stated.note);
    check_counts(&elements, encoding, length).map_err(|d| d.at(place(path)))?;
    let mut reader = Reader { input, encoding, words: Vec::new() };
    let mut facets = Facets::new(path, unit, sink);
    let mut vertices: Vec<[f64; 3]> = Vec::new();
    let mut others: Vec<String> = Vec::new();
    let mut odd = OddFaces::default();
    for element in &elements {
        match element.name.as_slice() {
            b"vertex" => reader.vertices(element, &mut vertices)?,
            b"face" => reader.faces(element, &vertices, &mut facets, &mut odd)?,
            b"tristrips" => reader.strips(element, &vertices, &mut facets)?,
            name => {
                others.push(format!("{} ({})", shown(name), element.count));
                (0..element.count).try_for_each(|i| reader.element(element, i, &[], &mut |_, _| Ok(())))?;
            }
        }
    }
    if !others.is_empty() {
        let text = format!("elements that are not read: {}", others.join(", "));
        let d = Diag::warning("ply-elements", text).at(place(path));
        notes.push(d.hint("only vertices, faces and strips of triangles are the surface"));
    }
    notes.extend(odd.notes().map(|d| d.at(place(path))));
    if facets.count() == 0 {
        let text = format!("the file holds {} vertices but no faces", vertices.len());
        let d = Diag::input("surface-empty", text).at(place(path));
        return Err(d.hint("export the surface with faces; a cloud of points can be read as .xyz").into());
    }
    facets.finish(notes)
}

/// Faces that are reported: the first that crosses itself; the first with fewer than three corners, and how many there
/// are.
#[derive(Default)]
struct OddFaces {
    crossed: Option<u64>,
    few: Option<u64>,
    few_count: u64,
}

impl OddFaces {
    fn notes(&self) -> impl Iterator<Item = Diag> {
        let crossed = self.crossed.map(|face| {
            let text = format!("face {face} (counted from 0) is not simple: its outline crosses or touches itself");
            let d = Diag::warning("ply-crossed", text);
            d.hint("its triangles may not cover it: export the surface as triangles")
        });
        let few = self.few.map(|face| {
            let count = self.few_count;
            let text =
                format!("{count} faces have fewer than three corners, first face {face} (counted from 0); left out");
            Diag::warning("ply-face", text).hint("they have no area: nothing is lost, unless they should have had more")
        });
        few.into_iter().chain(crossed)
    }
}

/// Holds what the header promises against the length of the file, and asks for memory.
fn check_counts(elements: &[Element], encoding: Encoding, length: u64) -> Result<(), Diag> {
    let index_of = |name: &[u8]| elements.iter().position(|e| e.name == name);
    let vertex = index_of(b"vertex");
    let face = index_of(b"face");
    let strips = index_of(b"tristrips");
    if vertex.is_some_and(|vertex| face.into_iter().chain(strips).any(|face| vertex > face)) {
        return Err(Diag::input("ply-header", "faces stand before the vertices that they name").hint(AGAIN));
    }
    let mut need = 0u64;
    for element in elements {
        let size = element.properties.iter().map(|p| least_bytes(p, encoding)).sum::<u64>().max(1);
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
    // A corner of a strip makes a facet; how many there are, only the length says.
    let item = |i: usize| elements[i].properties.iter().map(|p| p.of.size()).min().unwrap_or(1) as u64;
    let in_strips =
        strips.map_or(0, |i| length.saturating_sub(need) / if encoding == Encoding::Ascii { 2 } else { item(i) });
    let facets = count(face).saturating_add(in_strips);
    let bytes = count(vertex).saturating_mul(24).saturating_add(super::FACET_BYTES.saturating_mul(facets));
    memory::ask("the mesh", bytes)
}

/// Bytes that a property takes at least: a list of no items has its count alone; of text a digit and a space.
fn least_bytes(property: &Property, encoding: Encoding) -> u64 {
    match encoding {
        Encoding::Ascii => 2,
        Encoding::Little | Encoding::Big => property.list.unwrap_or(property.of).size() as u64,
    }
}

/// The file, of which lines and bytes are taken.
struct Input<'a> {
    path: &'a Path,
    input: BufReader<File>,
    line: Vec<u8>,
    number: usize,
    /// The byte that ends a line: that of the first one.
    end: u8,
}

impl<'a> Input<'a> {
    fn new(path: &'a Path, mut input: BufReader<File>) -> Result<Self, Error> {
        let head = input.fill_buf().map_err(|e| unreadable(path, &e))?;
        let first = head.iter().position(|b| matches!(b, b'\r' | b'\n'));
        let end = match first.map(|i| (head[i], head.get(i + 1))) {
            Some((b'\r', next)) if next != Some(&b'\n') => b'\r',
            _ => b'\n',
        };
        if head.starts_with(b"\xef\xbb\xbf") {
            input.consume(3);
        }
        Ok(Self { path, input, line: Vec::new(), number: 0, end })
    }

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
        let read = self.input.by_ref().take(most).read_until(self.end, &mut self.line);
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

    /// Reads the header: how values are written, and which elements follow. Lines that do not belong to a header are
    /// reported, where they cannot be meant to declare something.
    fn header(&mut self, stated: &mut StatedUnit, notes: &mut Vec<Diag>) -> Result<(Encoding, Vec<Element>), Error> {
        let mut strays: Option<(Place, String, usize)> = None;
        // Some programs begin with an empty line.
        while self.next_line()? && self.line.trim_ascii().is_empty() && self.number < MAX_HEADER {}
        if self.line.trim_ascii() != b"ply" {
            let d = Diag::input("surface-format", "the file does not begin with the line \"ply\"").at(place(self.path));
            return Err(d.hint("give the file the extension of its format, or export it as PLY").into());
        }
        let mut encoding = None;
        let mut elements = Vec::<Element>::new();
        while self.number < MAX_HEADER && self.next_line()? {
            let line = std::mem::take(&mut self.line);
            let found: Vec<&[u8]> = words(&line).collect();
            match found.as_slice() {
                [] => {}
                [b"comment" | b"obj_info", ..] => stated.look(&line, || self.place()),
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
                            self.fault(Diag::input("ply-header", format!("\"{}\" is not a property", shown(&line))))
                        );
                    };
                    element.properties.push(property);
                }
                [b"end_header"] => {
                    let encoding =
                        encoding.ok_or_else(|| self.fault(Diag::input("ply-header", "the header names no format")))?;
                    notes.extend(strays.map(|(place, text, count)| {
                        let text = format!("{count} lines of the header are not known, first \"{text}\"; passed over");
                        Diag::warning("ply-lines", text).at(place).hint("check the surface: nothing is read from them")
                    }));
                    return Ok((encoding, elements));
                }
                _ if declares(&found) => {
                    return Err(
                        self.fault(Diag::input("ply-header", format!("\"{}\" is not known in a header", shown(&line))))
                    );
                }
                _ => strays.get_or_insert_with(|| (self.place(), shown(&line), 0)).2 += 1,
            }
            self.line = line;
        }
        let stray = strays.map_or(String::new(), |(_, text, _)| format!("; \"{text}\" is not known in it"));
        let text = format!("the header does not end with \"end_header\"{stray}");
        Err(self.fault(Diag::input("ply-header", text)))
    }
}

/// Whether a line that is not understood may declare something: it has a word of declarations.
fn declares(words: &[&[u8]]) -> bool {
    const WORDS: [&[u8]; 6] = [b"format", b"element", b"property", b"list", b"vertex_indices", b"vertex_index"];
    words.iter().any(|word| WORDS.contains(word) || Scalar::named(word).is_some())
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
type ValueSink<'a> = dyn FnMut(usize, f64) -> Result<(), Diag> + 'a;

/// What is done with a value.
#[derive(Clone, Copy, PartialEq)]
enum Handling {
    Read,
    /// It is passed over; in a line of text it need not be a number.
    Skip,
}

/// Reads elements as they are written.
struct Reader<'a> {
    input: Input<'a>,
    encoding: Encoding,
    /// Where the words of a line of text lie in it.
    words: Vec<std::ops::Range<usize>>,
}

impl Reader<'_> {
    /// Where element `i` of a kind stands, as far as it can be said.
    fn place(&self) -> Place {
        match self.encoding {
            Encoding::Ascii => self.input.place(),
            _ => place(self.input.path),
        }
    }

    /// Reads element `i` of a kind, and hands on the values of these properties; a list as its items. What the others
    /// hold is not looked at.
    fn element(&mut self, element: &Element, i: u64, wanted: &[usize], take: &mut ValueSink<'_>) -> Result<(), Error> {
        let name = || format!("{} {i} (counted from 0)", shown(&element.name));
        let mut at = 0;
        if self.encoding == Encoding::Ascii {
            self.line(&name)?;
        }
        for (k, property) in element.properties.iter().enumerate() {
            let items = match property.list {
                None => 1.0,
                Some(count) => self.value(count, &mut at, Handling::Read, &name)?,
            };
            if !(0.0..=1e9).contains(&items) || items.fract() != 0.0 {
                let d = Diag::input("ply-count", format!("{} has a list of {items} items", name()));
                return Err(d.at(self.place()).hint(AGAIN).into());
            }
            let handling = if wanted.contains(&k) { Handling::Read } else { Handling::Skip };
            for _ in 0..items as u64 {
                let value = self.value(property.of, &mut at, handling, &name)?;
                if handling == Handling::Skip {
                    continue;
                }
                take(k, value).map_err(|d| {
                    let text = format!("{}: {}", name(), d.message);
                    Diag { message: text, ..d }.at(self.place())
                })?;
            }
        }
        Ok(())
    }

    /// Reads the next line that is not empty.
    fn line(&mut self, name: &dyn Fn() -> String) -> Result<(), Error> {
        self.words.clear();
        while self.words.is_empty() {
            if !self.input.next_line()? {
                return Err(self.input.fault(Diag::input("ply-truncated", format!("the file ends before {}", name()))));
            }
            let line = &self.input.line;
            let from = |word: &[u8]| word.as_ptr() as usize - line.as_ptr() as usize;
            self.words.extend(words(line).map(|word| from(word)..from(word) + word.len()));
        }
        Ok(())
    }

    /// The next value; `at` counts those of a line of text.
    fn value(
        &mut self,
        of: Scalar,
        at: &mut usize,
        handling: Handling,
        name: &dyn Fn() -> String,
    ) -> Result<f64, Error> {
        if self.encoding == Encoding::Ascii {
            let word = self.words.get(*at).map(|range| &self.input.line[range.clone()]);
            *at += 1;
            return match word {
                Some(_) if handling == Handling::Skip => Ok(0.0),
                Some(word) => match number(word) {
                    Err(NoNumber::NotFinite) => Ok(f64::NAN),
                    value => value.map_err(|why| no_number(word, why, self.input.place()).into()),
                },
                None => {
                    let text = format!("{} has too few numbers", name());
                    Err(self.input.fault(Diag::input("ply-truncated", text)))
                }
            };
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
            self.element(element, i, &[x, y, z], &mut |k, value| {
                [x, y, z].iter().zip(&mut p).filter(|(at, _)| **at == k).for_each(|(_, v)| *v = value);
                Ok(())
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
        odd: &mut OddFaces,
    ) -> Result<(), Error> {
        let corners = self.corners(element, "faces")?;
        let mut polygon: Vec<[f64; 3]> = Vec::new();
        for i in 0..element.count {
            polygon.clear();
            self.element(element, i, &[corners], &mut |_, value| {
                let vertex = vertex(vertices, value)?;
                if polygon.len() == MAX_CORNERS {
                    let text = format!("it has more than {MAX_CORNERS} corners");
                    return Err(Diag::input("ply-index", text).hint("export the surface as triangles"));
                }
                polygon.push(vertex);
                Ok(())
            })?;
            if polygon.len() < 3 {
                odd.few.get_or_insert(i);
                odd.few_count += 1;
            } else if !triangulate(&polygon, facets) {
                odd.crossed.get_or_insert(i);
            }
        }
        Ok(())
    }

    /// Strips of triangles: each corner makes one with the two before it, which turns by turn lies the other way round.
    /// -1 ends a strip. Triangles with a corner twice lead from one strip to the next and are left out.
    fn strips(&mut self, element: &Element, vertices: &[[f64; 3]], facets: &mut Facets<'_>) -> Result<(), Error> {
        let corners = self.corners(element, "strips")?;
        for i in 0..element.count {
            let mut strip: Vec<(f64, [f64; 3])> = Vec::with_capacity(3);
            let mut is_turned = false;
            self.element(element, i, &[corners], &mut |_, index| {
                if index == -1.0 {
                    strip.clear();
                    return Ok(());
                }
                strip.push((index, vertex(vertices, index)?));
                let &[(a, p), (b, q), (c, r)] = strip.as_slice() else {
                    is_turned = false;
                    return Ok(());
                };
                if a != b && b != c && c != a {
                    facets.push(if is_turned { [q, p, r] } else { [p, q, r] });
                }
                is_turned = !is_turned;
                strip.remove(0);
                Ok(())
            })?;
        }
        Ok(())
    }

    /// The list of vertices of faces or strips.
    fn corners(&self, element: &Element, of: &str) -> Result<usize, Error> {
        let is_corners = |p: &Property| [&b"vertex_indices"[..], b"vertex_index"].contains(&p.name.as_slice());
        element.properties.iter().position(|p| is_corners(p) && p.list.is_some()).ok_or_else(|| {
            let d = Diag::input("ply-header", format!("{of} have no list vertex_indices")).at(place(self.input.path));
            d.hint(AGAIN).into()
        })
    }
}

/// The vertex of this number, counted from 0.
fn vertex(vertices: &[[f64; 3]], index: f64) -> Result<[f64; 3], Diag> {
    let place = (index >= 0.0 && index.fract() == 0.0).then_some(index as usize);
    let Some(&p) = place.and_then(|i| vertices.get(i)) else {
        let text = format!("it refers to vertex {index}, the vertices are 0 to {}", vertices.len() as i64 - 1);
        return Err(Diag::input("ply-index", text).hint(AGAIN));
    };
    if p.iter().all(|v| v.is_finite()) {
        return Ok(p);
    }
    let text = format!("its vertex {index} has a coordinate that is not a finite number");
    Err(Diag::input("surface-number", text).hint("repair the surface: a facet without a place cannot be marked"))
}

#[cfg(test)]
mod tests {
    use super::*;

    type Outcome = (Result<Content, Error>, Vec<[[f64; 3]; 3]>, Vec<Diag>);

    fn read_bytes(bytes: &[u8]) -> Outcome {
        let dir = tempfile::tempdir().expect("a folder");
        let path = dir.path().join("a.ply");
        std::fs::write(&path, bytes).expect("written");
        let mut got = vec![];
        let mut notes = vec![];
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
            (usual("2 0 1"), "surface-empty", "no faces"),
            (usual("3 0 1 nan"), "ply-index", "vertex NaN"),
            (usual("nan 0 1 2"), "ply-count", "a list of NaN items"),
            (
                usual("3 0 1 2").replace("1 0 0", "1 0 nan"),
                "surface-number",
                ":13: face 0 (counted from 0): its vertex 1 has",
            ),
            (usual("3 0 1"), "ply-truncated", "face 0 (counted from 0) has too few numbers"),
            (usual("-1 0 1"), "ply-count", "a list of -1 items"),
            (usual(""), "ply-truncated", "the file ends before face 0"),
            (file("ascii", "uchar int", "0 0 0\n1 x 0\n"), "surface-number", "\"x\""),
            (file("ascii", "uchar int", "0 0 0\n1 0,5 0\n"), "surface-number", "decimal comma"),
            (file("ascii_2", "uchar int", body), "ply-header", ":2: \"format ascii_2 1.0\" is not known"),
            (file("ascii", "float int", body), "ply-header", "is not a property"),
            (
                file("ascii", "uchar int", body).replace("end_header", "end_head"),
                "ply-header",
                "\"end_head\" is not known",
            ),
            (
                file("ascii", "uchar int", body).replace("property float z", "propertyfloat z"),
                "ply-header",
                "no x, y and z",
            ),
            (
                file("ascii", "uchar int", body).replace("property float z", "propert float z"),
                "ply-header",
                "\"propert float z\"",
            ),
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

    /// A file of four vertices and this rest, which the header describes.
    fn square(head: &str, rest: &str) -> String {
        format!(
            "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n{head}\
             end_header\n0 0 0\n9 0 0\n0 9 0\n9 9 0\n{rest}"
        )
    }

    const FACES: &str = "element face 2\nproperty list uchar int vertex_indices\n";

    #[test]
    fn what_is_not_used_may_be_anything() {
        let plain = square(FACES, "3 0 1 2\n3 2 1 3\n");
        let want = read_bytes(plain.as_bytes()).1;
        assert_eq!(want.len(), 2);
        let normals = plain
            .replace("property float z\n", "property float z\nproperty float nx\n")
            .replace("0 0 0\n", "0 0 0 nan\n");
        let normals = normals
            .replace("9 0 0\n", "9 0 0 -1.#IND\n")
            .replace("\n0 9 0\n", "\n0 9 0 inf\n")
            .replace("9 9 0\n", "9 9 0 0xff\n");
        let more = plain.replace("vertex 4", "vertex 5").replace("9 9 0\n", "9 9 0\nnan 0 1e999\n");
        let quality = plain.replace("vertex_indices\n", "vertex_indices\nproperty float quality\n");
        let quality = quality.replace("3 0 1 2\n", "3 0 1 2 nan\n").replace("3 2 1 3\n", "3 2 1 3 -nan(ind)\n");
        for text in [normals, more, quality] {
            let (result, got, notes) = read_bytes(text.as_bytes());
            assert!(result.is_ok() && notes.is_empty() && got == want, "{text}: {:?}", result.err());
        }
    }

    #[test]
    fn odd_headers_are_read() {
        let plain = square(FACES, "3 0 1 2\n3 2 1 3\n");
        let want = read_bytes(plain.as_bytes()).1;
        for (text, code) in [
            (plain.replacen("ply", "ply ", 1), None),
            (format!("\n{plain}"), None),
            (format!("\u{feff}{plain}"), None),
            (plain.replace('\n', "\r"), None),
            (plain.replace('\n', "\r\n"), None),
            (
                plain.replacen("element", "Created by Blender3D 247 - www.blender.org\nand others\nelement", 1),
                Some("ply-lines"),
            ),
            (plain.replacen("element", "comment units: in\nelement", 1), Some("surface-unit-named")),
            (plain.replace("face 2", "face 4").replace("3 2 1 3\n", "2 0 1\n3 2 1 3\n0\n"), Some("ply-face")),
        ] {
            let (result, got, notes) = read_bytes(text.as_bytes());
            assert!(result.is_ok() && got == want, "{text}: {:?}", result.err());
            assert_eq!(notes.iter().map(|d| d.code).collect::<Vec<_>>(), Vec::from_iter(code), "{text}");
        }
    }

    #[test]
    fn strips_of_triangles_turn_by_turn_lie_the_other_way_round() {
        let head = "element tristrips 2\nproperty list int int vertex_indices\n";
        let [a, b, c, d] = [[0.0, 0.0, 0.0], [9.0, 0.0, 0.0], [0.0, 9.0, 0.0], [9.0, 9.0, 0.0]];
        let (result, got, notes) = read_bytes(square(head, "9 0 1 2 3 -1 0 1 -1 2\n6 0 1 2 2 3 1\n").as_bytes());
        assert!(result.is_ok() && notes.is_empty(), "{:?}", result.err());
        assert_eq!(got, [[a, b, c], [c, b, d], [a, b, c], [d, c, b]]);
        for (rest, code) in
            [("3 0 1 2\n3 0 1 4\n", "ply-index"), ("3 0 1 2\n3 0 1 -2\n", "ply-index"), ("3 0 1 2\n", "ply-truncated")]
        {
            assert_eq!(read_bytes(square(head, rest).as_bytes()).0.err().expect(rest).diags()[0].code, code);
        }
    }
}
