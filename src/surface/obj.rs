//! OBJ polygons.
//!
//! Consumes `v` and `f` lines; holds all vertices (24 bytes each), faces go on at once, so a face
//! stands after the vertices it names. Polygons become triangles by ear cutting on the plane of their
//! Newell normal: every corner stays a corner. Materials, groups, normals and texture coordinates are
//! passed over and no other file is opened; free-form surfaces are not read and a warning says so.

use std::path::Path;

use super::Content;
use super::facets::{Facets, Unit};
use super::lines::{Lines, MAX_LINE, no_number, number, place, shown, words};
use super::polygon::{MAX_CORNERS, triangulate};
use crate::diag::{Diag, Error, Place, memory};

/// Keywords that say nothing about where the surface is.
const PASSED_OVER: &[&[u8]] = &[b"vt", b"vn", b"g", b"o", b"s", b"l", b"p", b"usemtl", b"mtllib"];

/// Reads an OBJ file; `unit` is what its numbers are.
pub(crate) fn read(
    path: &Path,
    unit: Unit,
    notes: &mut Vec<Diag>,
    sink: &mut dyn FnMut([[f64; 3]; 3]),
) -> Result<Content, Error> {
    let mut facets = Facets::new(path, unit, sink);
    let mut lines = Lines::open(path, "an OBJ file")?;
    // Half a line of a vertex and a line of a facet, some 40 bytes.
    memory::ask("the mesh", super::FACET_BYTES * (lines.length() / 40)).map_err(|d| d.at(place(path)))?;
    let mut vertices: Vec<[f64; 3]> = Vec::new();
    let mut polygon: Vec<[f64; 3]> = Vec::new();
    let mut unknown = Unknown::default();
    let mut crossed: Option<Place> = None;
    let mut statement = Vec::new();
    while let Some(at) = next_statement(&mut lines, &mut statement)? {
        let here = |d: Diag| d.at(Place::line(path.display().to_string(), at));
        let mut rest = words(&statement);
        match rest.next() {
            Some(b"v") => vertices.push(vertex(rest).map_err(here)?),
            Some(b"f") => {
                polygon.clear();
                for word in rest {
                    if polygon.len() == MAX_CORNERS {
                        let text = format!("a face has more than {MAX_CORNERS} corners");
                        return Err(here(Diag::input("obj-face", text).hint("export the surface as triangles")).into());
                    }
                    polygon.push(corner(word, &vertices).map_err(here)?);
                }
                if polygon.len() < 3 {
                    let text = format!("a face has {} corners, it needs three or more", polygon.len());
                    return Err(here(Diag::input("obj-face", text).hint("export the surface again")).into());
                }
                if !triangulate(&polygon, &mut facets) {
                    crossed.get_or_insert(Place::line(path.display().to_string(), at));
                }
            }
            Some(word) if !word.starts_with(b"#") && !PASSED_OVER.contains(&word) => unknown.add(word, at),
            _ => {}
        }
    }
    if facets.count() == 0 {
        let text = format!("the file holds {} vertices but no faces", vertices.len());
        let d = Diag::input("surface-empty", text).at(place(path));
        return Err(d.hint("export the surface with faces; a cloud of points can be read as .xyz").into());
    }
    notes.extend(unknown.note(path));
    notes.extend(crossed.map(|place| {
        Diag::warning("obj-crossed", "a polygon is not simple: its outline crosses or touches itself in its plane")
            .at(place)
            .hint("its triangles may not cover it: export the surface as triangles")
    }));
    facets.finish(notes)
}

/// Reads a line and those it continues on (`\` at the end) into `statement`; its first line's number.
fn next_statement(lines: &mut Lines, statement: &mut Vec<u8>) -> Result<Option<usize>, Error> {
    statement.clear();
    let mut first = None;
    while lines.advance()? {
        let line = lines.line();
        let length = statement.len() + line.len();
        let (text, goes_on) = match line.strip_suffix(b"\\") {
            Some(text) => (text, true),
            None => (line, false),
        };
        if length > MAX_LINE {
            let text = format!("continued lines have more than {MAX_LINE} bytes together");
            return Err(Diag::input("line-too-long", text).at(lines.place()).hint("export the surface again").into());
        }
        statement.extend_from_slice(text);
        first.get_or_insert(lines.number());
        if !goes_on {
            break;
        }
        statement.push(b' ');
    }
    Ok(first)
}

/// A vertex in file units; a weight or a colour may follow.
fn vertex<'a>(mut rest: impl Iterator<Item = &'a [u8]>) -> Result<[f64; 3], Diag> {
    let mut p = [0.0; 3];
    for (k, v) in p.iter_mut().enumerate() {
        let word = rest.next().ok_or_else(|| {
            Diag::input("obj-vertex", format!("a vertex has three numbers, this one has {k}"))
                .hint("export the surface again; the file may be cut short")
        })?;
        *v = number(word).map_err(|why| no_number(word, why, Place::Nowhere))?;
    }
    Ok(p)
}

/// The corner that `v`, `v/vt`, `v//vn` or `v/vt/vn` names: from 1, or from the last vertex backwards.
fn corner(word: &[u8], vertices: &[[f64; 3]]) -> Result<[f64; 3], Diag> {
    let bad = |text: String| {
        Diag::input("obj-index", text)
            .hint("a face may only refer to vertices defined before it: 1, 2, ... or, counted back, -1, -2, ...")
    };
    let digits = word.split(|&b| b == b'/').next().unwrap_or_default();
    let index: i64 = std::str::from_utf8(digits)
        .ok()
        .and_then(|t| t.parse().ok())
        .ok_or_else(|| bad(format!("\"{}\" is not the number of a vertex", shown(word))))?;
    let position = match index {
        1.. => usize::try_from(index - 1).ok(),
        _ => usize::try_from(index.unsigned_abs()).ok().and_then(|back| vertices.len().checked_sub(back)),
    };
    position.and_then(|i| vertices.get(i)).copied().ok_or_else(|| {
        let count = vertices.len();
        bad(format!("a face refers to vertex {index}, but the vertices before it are 1 to {count}"))
    })
}

/// Keywords that mean nothing here: how many lines, where first, a few of them.
#[derive(Default)]
struct Unknown {
    lines: usize,
    first: usize,
    words: Vec<String>,
}

impl Unknown {
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

    fn note(&self, path: &Path) -> Option<Diag> {
        (self.lines > 0).then(|| {
            let text = format!("{} lines have keywords that are not read: {}", self.lines, self.words.join(", "));
            Diag::warning("obj-keywords", text)
                .at(Place::line(path.display().to_string(), self.first))
                .hint("export free-form surfaces as polygons; other keywords do no harm")
        })
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
        let (mut got, mut notes) = (vec![], vec![]);
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
            ("f 1 2 9", "obj-index", ":4: a face refers to vertex 9, but the vertices before it are 1 to 3"),
            ("f -1 -2 -4", "obj-index", "vertex -4"),
            ("f 1 2 9223372036854775808", "obj-index", "is not the number of a vertex"),
            ("f 1 2 -9223372036854775808", "obj-index", "vertex -9223372036854775808"),
            ("f 1 2 /3", "obj-index", "\"/3\" is not the number"),
            ("f 1 2", "obj-face", ":4: a face has 2 corners"),
            ("v 1e400 0 0", "surface-number", ":4: coordinate \"1e400\""),
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
    fn unknown_keywords_are_counted_and_named_once() {
        let (result, _, notes) =
            read_text("v 0 0 0\nv 9 0 0\nv 0 9 0\ncstype bezier\nsurf 0 1\nsurf 0 1\ncurv 1\nf 1 2 3\n");
        assert!(result.is_ok() && notes.len() == 1);
        assert_eq!(notes[0].message, "4 lines have keywords that are not read: cstype, surf, curv");
        assert!(notes[0].place.to_string().ends_with(":4"));
    }
}
