//! OBJ polygons.
//!
//! Consumes `v` and `f` lines; holds all vertices (24 bytes each). Faces are passed on at once; from the first one that
//! names a vertex further down, they are held to the end of the file (8 bytes, and 4 a corner). Polygons become
//! triangles by ear cutting on the plane of their Newell normal: every corner stays a corner. Materials, groups,
//! normals and texture coordinates are passed over and no other file is opened; free-form surfaces are not read and a
//! warning says so.
//!
//! A backslash at the end of a line continues it only where the statement has numbers: comments, names and paths may
//! end in one.

use std::path::Path;

use super::Content;
use super::facets::{Facets, Unit};
use super::lines::{Lines, MAX_LINE, NoNumber, no_number, number, place, shown, words};
use super::polygon::{MAX_CORNERS, triangulate};
use super::stated_unit::StatedUnit;
use terrace_core::diag::{Diag, Error, Place, memory};

/// Keywords that say nothing about where the surface is.
const PASSED_OVER: &[&[u8]] = &[b"vt", b"vn", b"g", b"o", b"s", b"l", b"p", b"usemtl", b"mtllib"];

/// Keywords of surfaces that are not read.
const SURFACES: &[&[u8]] = &[b"surf", b"call", b"bsp", b"bzp", b"cdp", b"res"];

/// Keywords that numbers follow, so that their lines may be continued.
const CONTINUED: &[&[u8]] = &[
    b"v", b"vt", b"vn", b"vp", b"f", b"fo", b"l", b"p", b"deg", b"bmat", b"step", b"curv", b"curv2", b"surf", b"parm",
    b"trim", b"hole", b"scrv", b"sp", b"con", b"bsp", b"bzp", b"cdc", b"cdp", b"res",
];

/// Reads an OBJ file; `unit` is what its numbers are.
pub(crate) fn read(
    path: &Path,
    unit: Unit,
    notes: &mut Vec<Diag>,
    sink: &mut dyn FnMut([[f64; 3]; 3]),
) -> Result<Content, Error> {
    let mut lines = Lines::open(path, "an OBJ file")?;
    // Half a line of a vertex and a line of a facet, some 40 bytes.
    memory::ask("the mesh", super::FACET_BYTES * (lines.length() / 40)).map_err(|d| d.at(place(path)))?;
    let mut reader = Reader::new(path, Facets::new(path, unit, sink));
    let mut stated = StatedUnit::new(unit);
    let mut unknown = Words::default();
    let mut surfaces = Words::default();
    let mut statement = Vec::new();
    while let Some(at) = next_statement(&mut lines, &mut statement)? {
        let here = |d: Diag| d.at(Place::line(path.display().to_string(), at));
        let mut rest = words(&statement).take_while(|word| !word.starts_with(b"#"));
        match rest.next() {
            Some(b"v") => reader.vertex(rest, at).map_err(here)?,
            Some(b"f" | b"fo") => reader.face(rest, at)?,
            Some(word) if SURFACES.contains(&word) => surfaces.add(word, at),
            Some(word) if !PASSED_OVER.contains(&word) => unknown.add(word, at),
            Some(_) => {}
            None => stated.look(&statement, || Place::line(path.display().to_string(), at)),
        }
    }
    notes.extend(stated.note);
    notes.extend(surfaces.note(
        |n, words| {
            let text =
                format!("{n} statements of surfaces that are not read: {words}; that part of the surface is missing");
            Diag::warning("obj-left-out", text).hint("export free-form surfaces as polygons, and all into one file")
        },
        path,
    ));
    notes.extend(unknown.note(
        |n, words| {
            let text = format!("{n} lines have keywords that are not read: {words}");
            Diag::warning("obj-keywords", text).hint("polygons are those of f lines, their vertices those of v lines")
        },
        path,
    ));
    reader.finish(notes)
}

/// Reads a line, and those on which it continues where its statement may, into `statement`; its first line's number.
fn next_statement(lines: &mut Lines, statement: &mut Vec<u8>) -> Result<Option<usize>, Error> {
    statement.clear();
    let mut first = None;
    while lines.advance()? {
        let line = lines.line();
        first.get_or_insert(lines.number());
        if statement.len() + line.len() > MAX_LINE {
            let text = format!("continued lines have more than {MAX_LINE} bytes together");
            return Err(Diag::input("line-too-long", text).at(lines.place()).hint("export the surface again").into());
        }
        let before = match line.trim_ascii_end().strip_suffix(b"\\") {
            // Before its first line is looked at, a statement is empty.
            Some(before) if (!statement.is_empty() || has_numbers(before)) && !has_comment(before) => before,
            _ => {
                statement.extend_from_slice(line);
                break;
            }
        };
        statement.extend_from_slice(before);
        statement.push(b' ');
    }
    Ok(first)
}

/// Whether numbers follow the keyword of a statement.
fn has_numbers(line: &[u8]) -> bool {
    words(line).next().is_some_and(|word| CONTINUED.contains(&word))
}

/// Whether a comment ends a line.
fn has_comment(line: &[u8]) -> bool {
    words(line).any(|word| word.starts_with(b"#"))
}

/// What makes a vertex one that no face may name.
#[derive(Clone, Copy)]
enum Fault {
    NotFinite,
    Weight(f64),
}

/// A vertex that is not where its numbers say.
#[derive(Clone, Copy)]
struct FaultyVertex {
    /// Its number, from 0.
    vertex: usize,
    /// The line that has it.
    line: usize,
    fault: Fault,
}

/// A face that waits for the end of the file.
struct WaitingFace {
    line: usize,
    /// How many of the waiting corners are its own.
    corners: u32,
}

/// Vertices and faces so far.
struct Reader<'a> {
    path: &'a Path,
    facets: Facets<'a>,
    vertices: Vec<[f64; 3]>,
    /// By rising number.
    faulty: Vec<FaultyVertex>,
    polygon: Vec<usize>,
    corners: Vec<[f64; 3]>,
    waiting: Vec<WaitingFace>,
    /// The corners of all faces that wait.
    waiting_corners: Vec<u32>,
    crossed: Option<usize>,
}

impl<'a> Reader<'a> {
    fn new(path: &'a Path, facets: Facets<'a>) -> Self {
        Self {
            path,
            facets,
            vertices: Vec::new(),
            faulty: Vec::new(),
            polygon: Vec::new(),
            corners: Vec::new(),
            waiting: Vec::new(),
            waiting_corners: Vec::new(),
            crossed: None,
        }
    }

    fn place(&self, line: usize) -> Place {
        Place::line(self.path.display().to_string(), line)
    }

    /// Adds a vertex in file units; a weight or a colour may follow.
    fn vertex<'w>(&mut self, mut rest: impl Iterator<Item = &'w [u8]>, line: usize) -> Result<(), Diag> {
        let mut p = [0.0; 3];
        let mut fault = None;
        for (k, v) in p.iter_mut().enumerate() {
            let word = rest.next().ok_or_else(|| {
                Diag::input("obj-vertex", format!("a vertex has three numbers, this one has {k}"))
                    .hint("export the surface again; the file may be cut short")
            })?;
            *v = match number(word) {
                Ok(v) => v,
                Err(NoNumber::NotFinite) => {
                    fault = Some(Fault::NotFinite);
                    f64::NAN
                }
                Err(why) => return Err(no_number(word, why, Place::Nowhere)),
            };
        }
        // A fourth number alone is the weight; more are a colour.
        if let (Some(word), None) = (rest.next(), rest.next()) {
            match number(word) {
                Ok(1.0) => {}
                Ok(w) => fault = fault.or(Some(Fault::Weight(w))),
                Err(NoNumber::NotFinite) => fault = fault.or(Some(Fault::Weight(f64::NAN))),
                Err(why) => return Err(no_number(word, why, Place::Nowhere)),
            }
        }
        self.faulty.extend(fault.map(|fault| FaultyVertex { vertex: self.vertices.len(), line, fault }));
        self.vertices.push(p);
        Ok(())
    }

    /// Adds a face.
    fn face<'w>(&mut self, rest: impl Iterator<Item = &'w [u8]>, line: usize) -> Result<(), Error> {
        let here =
            |d: Diag, hint: &str| Error::from(d.at(Place::line(self.path.display().to_string(), line)).hint(hint));
        self.polygon.clear();
        for word in rest {
            if self.polygon.len() == MAX_CORNERS {
                let text = format!("a face has more than {MAX_CORNERS} corners");
                return Err(here(Diag::input("obj-face", text), "export the surface as triangles"));
            }
            let corner = corner(word, self.vertices.len());
            self.polygon.push(corner.map_err(|text| here(Diag::input("obj-index", text), COUNTED))?);
        }
        if self.polygon.len() < 3 {
            let text = format!("a face has {} corners, it needs three or more", self.polygon.len());
            return Err(here(Diag::input("obj-face", text), "export the surface again"));
        }
        let is_ahead = self.polygon.iter().any(|&i| i >= self.vertices.len());
        if is_ahead || !self.waiting.is_empty() {
            self.waiting.push(WaitingFace { line, corners: self.polygon.len() as u32 });
            self.waiting_corners.extend(self.polygon.iter().map(|&i| u32::try_from(i).unwrap_or(u32::MAX)));
            return Ok(());
        }
        self.hand_on(line)
    }

    /// Hands on the triangles of the polygon.
    fn hand_on(&mut self, line: usize) -> Result<(), Error> {
        self.corners.clear();
        for &i in &self.polygon {
            let Some(&p) = self.vertices.get(i) else {
                let text =
                    format!("a face refers to vertex {}, but the file has {}", i as u64 + 1, self.vertices.len());
                return Err(Diag::input("obj-index", text).at(self.place(line)).hint(COUNTED).into());
            };
            if let Ok(k) = self.faulty.binary_search_by_key(&i, |faulty| faulty.vertex) {
                return Err(self.unusable(self.faulty[k], line));
            }
            self.corners.push(p);
        }
        if !triangulate(&self.corners, &mut self.facets) {
            self.crossed.get_or_insert(line);
        }
        Ok(())
    }

    /// The fault of a face, in a line of that number, that names a vertex that is nowhere.
    fn unusable(&self, FaultyVertex { vertex, line, fault }: FaultyVertex, face_line: usize) -> Error {
        let named = format!("vertex {}, which the face in line {face_line} names,", vertex + 1);
        let d = match fault {
            Fault::NotFinite => {
                Diag::input("surface-number", format!("{named} has a coordinate that is not a finite number"))
                    .hint("repair the surface: a facet without a place cannot be marked")
            }
            Fault::Weight(w) => Diag::input("obj-weight", format!("{named} has the weight {w}")).hint(
                "some programs divide x, y and z by a fourth number, others do not: export without it, or with 1",
            ),
        };
        d.at(self.place(line)).into()
    }

    /// Hands on the faces that wait, and ends the file.
    fn finish(mut self, notes: &mut Vec<Diag>) -> Result<Content, Error> {
        let waiting = std::mem::take(&mut self.waiting);
        let corners = std::mem::take(&mut self.waiting_corners);
        let mut rest = corners.as_slice();
        for WaitingFace { line, corners } in waiting {
            let (polygon, others) = rest.split_at(corners as usize);
            rest = others;
            self.polygon.clear();
            self.polygon.extend(polygon.iter().map(|&i| i as usize));
            self.hand_on(line)?;
        }
        if self.facets.count() == 0 {
            let text = format!("the file holds {} vertices but no faces", self.vertices.len());
            let d = Diag::input("surface-empty", text).at(place(self.path));
            return Err(d.hint("export the surface with faces; a cloud of points can be read as .xyz").into());
        }
        let crossed = self.crossed.map(|line| self.place(line));
        notes.extend(crossed.map(|place| {
            Diag::warning("obj-crossed", "a polygon is not simple: its outline crosses or touches itself in its plane")
                .at(place)
                .hint("its triangles may not cover it: export the surface as triangles")
        }));
        self.facets.finish(notes)
    }
}

/// The remedy for a face that names a vertex that is not there.
const COUNTED: &str = "vertices count from 1, or back from the face: -1 is the last one before it";

/// The vertex, counted from 0, that `v`, `v/vt`, `v//vn` or `v/vt/vn` names: from 1, or from the last vertex backwards.
fn corner(word: &[u8], count: usize) -> Result<usize, String> {
    let digits = word.split(|&b| b == b'/').next().unwrap_or_default();
    let index: Option<i64> = std::str::from_utf8(digits).ok().and_then(|t| t.parse().ok());
    let index = index.ok_or_else(|| format!("\"{}\" is not the number of a vertex", shown(word)))?;
    let position = match index {
        1.. => usize::try_from(index - 1).ok(),
        0 => None,
        _ => usize::try_from(index.unsigned_abs()).ok().and_then(|back| count.checked_sub(back)),
    };
    position.ok_or_else(|| format!("a face refers to vertex {index}, but {count} stand before it"))
}

/// Keywords: how many lines have them, where first, a few of them.
#[derive(Default)]
struct Words {
    lines: usize,
    first: usize,
    words: Vec<String>,
}

impl Words {
    fn add(&mut self, word: &[u8], line: usize) {
        if self.lines == 0 {
            self.first = line;
        }
        self.lines += 1;
        if self.words.len() < 5 {
            let word = shown(word);
            if !self.words.contains(&word) {
                self.words.push(word);
            }
        }
    }

    fn note(&self, note: impl Fn(usize, String) -> Diag, path: &Path) -> Option<Diag> {
        let at = || Place::line(path.display().to_string(), self.first);
        (self.lines > 0).then(|| note(self.lines, self.words.join(", ")).at(at()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    type Outcome = (Result<Content, Error>, Vec<[[f64; 3]; 3]>, Vec<Diag>);

    fn read_text(text: &str) -> Outcome {
        let dir = tempfile::tempdir().expect("a folder");
        let path = dir.path().join("a.obj");
        std::fs::write(&path, text).expect("written");
        let mut got = vec![];
        let mut notes = vec![];
        let result = read(&path, Unit::mm(1.0), &mut notes, &mut |f| got.push(f));
        (result, got, notes)
    }

    fn area_xy(facets: &[[[f64; 3]; 3]]) -> f64 {
        let twice = |[a, b, c]: &[[f64; 3]; 3]| (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
        facets.iter().map(twice).sum::<f64>() / 2.0
    }

    #[test]
    fn every_form_of_index_names_the_same_corner() {
        let (result, got, notes) = read_text(
            "# c\r\no a b\nmtllib ../x\nv 0 0 0 1.0\nv 10 0 0 0.5 0.5 0.5\nv 0 10 2\nvt 0 0\nvn 0 0 1\ns 1\n\
             f 1 2 3\nf 1/1 2/1 3/1\nf 1//1 2//1 3//1\nf -3/1/1 \\\n -2/1/1 -1/1/1\nl 1 2",
        );
        assert!(matches!(result, Ok(Content::Facets(4))) && notes.is_empty(), "{notes:?}");
        assert!(got.iter().all(|f| *f == [[0.0, 0.0, 0.0], [10.0, 0.0, 0.0], [0.0, 10.0, 2.0]]));
    }

    #[test]
    fn polygons_are_covered_once_whatever_their_plane_winding_or_hollows() {
        // A comb whose first corner sees little of it; area 10 x 10 less three slots of 1 x 8.
        let mut comb = vec![[0.0, 0.0], [10.0, 0.0], [10.0, 10.0]];
        for x in [8.0, 5.0, 2.0] {
            comb.extend([[x, 10.0], [x, 2.0], [x - 1.0, 2.0], [x - 1.0, 10.0]]);
        }
        comb.push([0.0, 10.0]);
        for (name, turn) in [("xy", [0, 1, 2]), ("yz", [2, 0, 1]), ("zx", [1, 2, 0])] {
            for reversed in [false, true] {
                let mut text = String::new();
                for p in &comb {
                    let p = [p[0] + 1000.0, p[1], 0.25 * p[0]];
                    text += &format!("v {} {} {}\n", p[turn[0]], p[turn[1]], p[turn[2]]);
                }
                let mut face: Vec<String> = (1..=comb.len()).map(|i| i.to_string()).collect();
                if reversed {
                    face.reverse();
                }
                let (result, got, notes) = read_text(&format!("{text}f {}\n", face.join(" ")));
                assert!(matches!(result, Ok(Content::Facets(n)) if n == comb.len() - 2), "{name}");
                assert!(notes.is_empty(), "{notes:?}");
                let back: Vec<[[f64; 3]; 3]> = got
                    .iter()
                    .map(|f| {
                        f.map(|p| {
                            let mut q = [0.0; 3];
                            (0..3).for_each(|k| q[turn[k]] = p[k]);
                            q
                        })
                    })
                    .collect();
                let want = if reversed { -76.0 } else { 76.0 };
                assert!((area_xy(&back) - want).abs() < 1e-9, "{name} {reversed} {}", area_xy(&back));
            }
        }
    }

    #[test]
    fn polygons_without_area_go_on_and_crossed_ones_are_noted() {
        let (result, _, notes) = read_text("v 0 0 0\nv 1 0 0\nv 2 0 0\nv 3 0 0\nf 1 2 3 4\n");
        assert!(matches!(result, Ok(Content::Facets(2))));
        assert!(notes.is_empty(), "{notes:?}");
        let (result, _, notes) = read_text("v 0 0 0\nv 4 4 0\nv 4 0 0\nv 0 2 0\nf 1 2 3 4\n");
        assert!(result.is_ok());
        assert_eq!(notes[0].code, "obj-crossed");
        assert!(notes[0].place.to_string().ends_with(":5"));
    }

    #[test]
    fn faults_are_named_by_line() {
        let v = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
        for (text, code, say) in [
            ("f 0 1 2", "obj-index", ":4: a face refers to vertex 0"),
            ("f 1 2 9", "obj-index", ":4: a face refers to vertex 9, but the file has 3"),
            ("f 1 2 9\nf 1 2 3\nv 1 1 1", "obj-index", ":4: a face refers to vertex 9, but the file has 4"),
            ("f 1 2 4294967297\nv 1 1 1", "obj-index", "vertex 4294967296"),
            ("f 1 2 -4\nv 1 1 1", "obj-index", ":4: a face refers to vertex -4, but 3 stand before it"),
            ("f -1 -2 -4", "obj-index", "vertex -4"),
            ("f 1 2 9223372036854775808", "obj-index", "is not the number of a vertex"),
            ("f 1 2 -9223372036854775808", "obj-index", "vertex -9223372036854775808"),
            ("f 1 2 /3", "obj-index", "\"/3\" is not the number"),
            ("f 1 2", "obj-face", ":4: a face has 2 corners"),
            (
                "v 1e400 0 0\nf 1 2 4",
                "surface-number",
                ":4: vertex 4, which the face in line 5 names, has a coordinate",
            ),
            ("f 1 2 4\nv 1 0 nan", "surface-number", ":5: vertex 4, which the face in line 4 names"),
            ("v 2 0 0 2\nf 1 2 4", "obj-weight", ":4: vertex 4, which the face in line 5 names, has the weight 2"),
            ("v 2 0 0 0\nf 1 2 4", "obj-weight", "weight 0"),
            ("v 2 0 0 x", "surface-number", "\"x\" is not a number"),
            ("v 1 2 # 3", "obj-vertex", "this one has 2"),
            ("f 1 2 # 3", "obj-face", "has 2 corners"),
            ("f 1 2 3 \\\nf 1 2 3", "obj-index", "\"f\" is not the number"),
            ("v 0,5 0,5 0", "surface-number", ":4: coordinate \"0,5\" has a decimal comma"),
            ("\n\nv 1 2\n", "obj-vertex", ":6: a vertex has three numbers, this one has 2"),
            ("", "surface-empty", "3 vertices but no faces"),
        ] {
            let e = read_text(&format!("{v}{text}")).0.err().expect(text);
            assert_eq!(e.diags()[0].code, code, "{e}");
            assert!(e.to_string().contains(say) && !e.diags()[0].hint.is_empty(), "{e}");
        }
        let many = vec!["1"; MAX_CORNERS + 1].join(" ");
        assert_eq!(read_text(&format!("{v}f {many}")).0.err().expect("many").diags()[0].code, "obj-face");
    }

    #[test]
    fn a_backslash_continues_numbers_and_nothing_else() {
        let v = "v 0 0 0\nv 9 0 0\nv 0 9 0\n";
        for line in [
            "# C:\\parts\\",
            "#C:\\parts\\",
            "# \\\\server\\share\\\\",
            "# C:\\a\\ ",
            "  # C:\\a\\",
            "g C:\\parts\\",
            "o body\\",
            "s off\\",
            "usemtl mats\\steel\\",
            "mtllib C:\\mats\\",
            "f 1 2 3 # C:\\parts\\",
            "# a\\\r",
        ] {
            let faces = 1 + usize::from(line.starts_with('f'));
            for text in [format!("{v}{line}\nf 1 2 3\n"), format!("{line}\n{v}f 1 2 3\n")] {
                let (result, _, notes) = read_text(&text);
                assert!(matches!(result, Ok(Content::Facets(n)) if n == faces), "{text}: {:?}", result.err());
                assert!(notes.is_empty(), "{notes:?}");
            }
        }
        for text in
            ["v \\\n0 0 0\nv 9 0 0\nv 0 9\\\r\n 0\nf 1 \\ \n2 3\n", "v\\\n0 0 0\nv 9 0 0\nv 0 9 0\nf\\\n1 2\\\n\\\n3"]
        {
            let (result, got, notes) = read_text(text);
            assert!(result.is_ok() && notes.is_empty(), "{text}: {:?}", result.err());
            assert_eq!(got, [[[0.0, 0.0, 0.0], [9.0, 0.0, 0.0], [0.0, 9.0, 0.0]]]);
        }
    }

    #[test]
    fn faces_may_stand_before_their_vertices_and_have_comments() {
        let (result, got, notes) = read_text(
            "\u{feff}v 0 0 0\nv 9 0 0\nv 0 9 0\nf 1 2 3 # first\nf 4 2 1 #\nf -3 -2 -1\nfo 1 2 3\nv 9 9 0 # last\nf -1 -2 -3",
        );
        assert!(matches!(result, Ok(Content::Facets(5))) && notes.is_empty(), "{:?}", result.err());
        let [a, b, c, d] = [[0.0, 0.0, 0.0], [9.0, 0.0, 0.0], [0.0, 9.0, 0.0], [9.0, 9.0, 0.0]];
        assert_eq!(got, [[a, b, c], [d, b, a], [a, b, c], [a, b, c], [d, c, b]]);
    }

    #[test]
    fn vertices_that_no_face_names_may_be_anything() {
        let (result, _, notes) =
            read_text("v 0 0 0 1\nv nan nan nan\nv 9 0 0 1.0\nv -1.#IND 0 0\nv 0 9 0\nv 0 0 0 0.5\nf 1 3 5\n");
        assert!(matches!(result, Ok(Content::Facets(1))) && notes.is_empty(), "{:?}", result.err());
    }

    #[test]
    fn a_unit_in_a_comment_is_held_against_that_of_the_job() {
        let notes = read_text("# File units = centimeters\n# units: in\nv 0 0 0\nv 9 0 0\nv 0 9 0\nf 1 2 3\n").2;
        assert_eq!((notes.len(), notes[0].code), (1, "surface-unit-named"));
        assert!(notes[0].hint.contains("\"cm\"") && notes[0].place.to_string().ends_with(":1"), "{}", notes[0]);
    }

    #[test]
    fn unknown_keywords_are_counted_and_named_once() {
        let (result, _, notes) =
            read_text("v 0 0 0\nv 9 0 0\nv 0 9 0\ncstype bezier\nsurf 0 1\nsurf 0 1\ncurv 1\nf 1 2 3\n");
        assert!(result.is_ok() && notes.len() == 2);
        assert!(
            notes[0].code == "obj-left-out"
                && notes[0].message.starts_with("2 statements of surfaces that are not read: surf;")
        );
        assert!(notes[0].place.to_string().ends_with(":5"));
        assert_eq!(notes[1].message, "2 lines have keywords that are not read: cstype, curv");
        assert!(notes[1].place.to_string().ends_with(":4"));
    }
}
