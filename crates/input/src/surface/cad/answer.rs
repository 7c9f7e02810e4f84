//! The converter's answer: two lines of JSON, the vertices and the triangles.
//!
//! Everything is checked before it is used: the counts against the bytes that follow, coordinates for being finite,
//! indices for being those of vertices. `convert.py` says what the lines hold.

use std::path::Path;

use rustc_hash::FxHashMap;
use serde::Deserialize;

use super::{AGAIN, Tessellation};
use crate::surface::lines::place;
use terrace_core::diag::Diag;

/// Longest line of an answer, bytes.
pub(super) const MAX_LINE: usize = 1 << 20;

/// Bytes of a vertex, and of a triangle.
const VERTEX: u64 = 24;
const TRIANGLE: u64 = 12;

/// The first line: which version answers, or why none can.
#[derive(Debug, Deserialize)]
pub(super) struct Greeting {
    terrace: Option<u32>,
    occt: Option<String>,
    /// Why the interpreter cannot convert.
    pub(super) absent: Option<String>,
}

/// What the converter says of a file.
#[derive(Clone, Debug, Deserialize, PartialEq)]
pub struct About {
    /// The version of Open CASCADE that read it.
    #[serde(default)]
    pub occt: String,
    /// The length unit that the file states.
    pub unit: String,
    /// Faces, the bodies (solids, sheets) that they belong to, and edges with a face on one side only.
    pub faces: usize,
    /// Solids, shells of no solid, faces of no shell.
    pub bodies: usize,
    /// Edges that belong to one face alone.
    pub free_edges: usize,
    /// Faces for which no triangles could be made.
    pub without_triangles: usize,
    /// Largest distance of facets from the surface, measured on every edge and at every centre, mm.
    pub worst_mm: f64,
    /// Shapes that the file hides, which are left out.
    #[serde(default)]
    pub hidden_count: usize,
    #[serde(default)]
    hidden: Vec<String>,
    /// Entities that the file hides and whose kind is not known, so that nothing is left out for them.
    #[serde(default)]
    hidden_unknown: usize,
    failed_count: usize,
    failed: Vec<String>,
    remarks_count: usize,
    remarks: Vec<String>,
    vertices: u64,
    triangles: u64,
}

impl About {
    /// Bytes that follow the header.
    pub(super) fn body(&self) -> Option<u64> {
        self.vertices.checked_mul(VERTEX)?.checked_add(self.triangles.checked_mul(TRIANGLE)?)
    }

    /// Adds what the user should know of the file to `notes`; `fine` is how finely the converter was to divide it.
    pub(super) fn notes(&self, path: &Path, fine: Tessellation, notes: &mut Vec<Diag>) {
        let at = || place(path);
        if self.without_triangles > 0 || self.failed_count > 0 {
            let mut parts = Vec::new();
            if self.without_triangles > 0 {
                parts.push(format!("{} of {} faces have no triangles", self.without_triangles, self.faces));
            }
            if self.failed_count > 0 {
                parts.push(listed("what could not be read", &self.failed, self.failed_count));
            }
            let text = format!("parts of the file are missing in the surface: {}", parts.join("; "));
            notes.push(
                Diag::warning("cad-left-out", text)
                    .at(at())
                    .hint("nothing is marked there: look at the picture of the job"),
            );
        }
        if self.hidden_count > 0 {
            let shapes =
                if self.hidden_count == 1 { "1 shape".into() } else { format!("{} shapes", self.hidden_count) };
            let text = format!("left out, since the file hides them ({shapes})");
            let d = Diag::warning("cad-hidden", listed(&text, &self.hidden, self.hidden_count)).at(at());
            notes.push(d.hint("show them in the CAD program and export the part again if they belong to it"));
        }
        if self.hidden_unknown > 0 {
            let text = format!("the file hides {} entities of kinds that are not read", self.hidden_unknown);
            let d = Diag::warning("cad-hidden", text).at(at());
            notes.push(d.hint("look at the picture of the job: hidden bodies may be in it"));
        }
        if self.remarks_count > 0 {
            let text = listed("remarks of the reader", &self.remarks, self.remarks_count);
            notes.push(
                Diag::warning("cad-remarks", text)
                    .at(at())
                    .hint("compare size and faces with the part in the CAD program"),
            );
        }
        // `convert.py` divides facets until they keep the tolerance, but no edges on borders of faces, which neighbours
        // share: only these can lie farther off.
        if self.worst_mm > 1.01 * fine.chord_mm {
            let text = format!(
                "facets lie up to {:.4} mm off the surface, more than the chord tolerance of {} mm",
                self.worst_mm, fine.chord_mm
            );
            notes.push(
                Diag::warning("cad-chord", text)
                    .at(at())
                    .hint("borders of faces do not lie on them: heal the part in CAD"),
            );
        }
    }
}

/// The first messages, and how many there are.
fn listed(what: &str, messages: &[String], count: usize) -> String {
    let shown: Vec<&str> = messages.iter().take(3).map(String::as_str).collect();
    let more = if count > shown.len() { format!(" and {} more", count - shown.len()) } else { String::new() };
    format!("{what}: {}{more}", shown.join("; "))
}

/// What the second line is.
#[derive(Debug, Deserialize)]
#[serde(untagged)]
pub(super) enum Header {
    /// The file could not be converted: of which kind, and in the converter's words.
    Error {
        /// One of the kinds of `convert.py`.
        error: String,
        /// In its own words.
        text: String,
    },
    /// A mesh follows.
    Mesh(About),
}

/// The facets of a file.
#[derive(Clone, Debug)]
pub struct CadMesh {
    /// What the converter says of the file.
    pub about: About,
    vertices: Vec<[f64; 3]>,
    triangles: Vec<[u32; 3]>,
}

impl CadMesh {
    /// Reads a whole answer; the error says what is wrong with it.
    pub(super) fn read(bytes: &[u8]) -> Result<Self, String> {
        let mut parts = bytes.splitn(3, |&b| b == b'\n');
        let mut next = || parts.next().ok_or("it ends within its header".to_owned());
        let first = next()?;
        let second = next()?;
        let body = next()?;
        let version = greeting(first)?.occt.unwrap_or_default();
        let mut about = match header(second)? {
            Header::Mesh(about) => about,
            Header::Error { error, .. } => return Err(format!("it is the error {error:?}")),
        };
        about.occt = version;
        if about.body() != Some(body.len() as u64) {
            let text = format!("{} vertices and {} triangles do not take", about.vertices, about.triangles);
            return Err(format!("{text} {} bytes", body.len()));
        }
        // The counts fit the bytes that are there.
        let (vertices, triangles) = body.split_at(about.vertices as usize * VERTEX as usize);
        let (vertices, _) = vertices.as_chunks::<8>();
        let (triangles, _) = triangles.as_chunks::<4>();
        let vertices: Vec<f64> = vertices.iter().map(|b| f64::from_le_bytes(*b)).collect();
        let triangles: Vec<u32> = triangles.iter().map(|b| u32::from_le_bytes(*b)).collect();
        if !vertices.iter().all(|v| v.is_finite()) || !about.worst_mm.is_finite() {
            return Err("a coordinate is not finite".into());
        }
        if triangles.iter().any(|&i| u64::from(i) >= about.vertices) {
            return Err("a triangle names a vertex that is not there".into());
        }
        Ok(Self { about, vertices: vertices.as_chunks().0.to_vec(), triangles: triangles.as_chunks().0.to_vec() })
    }

    /// How many facets there are.
    pub fn facet_count(&self) -> usize {
        self.triangles.len()
    }

    /// The facets, corners in mm; they face as the faces of the file do.
    pub fn facets(&self) -> impl Iterator<Item = [[f64; 3]; 3]> + '_ {
        self.triangles.iter().map(|corners| corners.map(|i| self.vertices[i as usize]))
    }

    /// The mesh as a binary PLY file, lowest byte first, coordinates in mm as doubles; `comments` are lines of its
    /// header. Vertices that are equal become one.
    pub fn to_ply(&self, comments: &[String]) -> Vec<u8> {
        let mut at: FxHashMap<[u64; 3], u32> = FxHashMap::default();
        let mut vertices = Vec::new();
        let mut faces = Vec::with_capacity(13 * self.triangles.len());
        // -0 and 0 are one place.
        let bits = |p: [f64; 3]| p.map(|v| (v + 0.0).to_bits());
        for corners in &self.triangles {
            faces.push(3);
            for &i in corners {
                let p = bits(self.vertices[i as usize]);
                let new = at.len() as u32;
                let number = *at.entry(p).or_insert_with(|| {
                    vertices.extend(p.iter().flat_map(|v| v.to_le_bytes()));
                    new
                });
                faces.extend(number.to_le_bytes());
            }
        }
        let comments: String = comments.iter().map(|line| format!("comment {line}\n")).collect();
        let mut out = format!(
            "ply\nformat binary_little_endian 1.0\n{comments}element vertex {}\nproperty double x\nproperty double y\n\
             property double z\nelement face {}\nproperty list uchar uint vertex_indices\nend_header\n",
            at.len(),
            self.triangles.len()
        )
        .into_bytes();
        out.append(&mut vertices);
        out.append(&mut faces);
        out
    }
}

/// Reads the first line.
pub(super) fn greeting(line: &[u8]) -> Result<Greeting, String> {
    let found: Result<Greeting, _> = serde_json::from_slice(line);
    match found {
        Ok(found) if found.terrace == Some(1) || found.absent.is_some() => Ok(found),
        _ => Err(format!("it begins with {:?}", String::from_utf8_lossy(&line[..line.len().min(40)]))),
    }
}

/// Reads the second line.
pub(super) fn header(line: &[u8]) -> Result<Header, String> {
    serde_json::from_slice(line).map_err(|e| format!("its header cannot be read: {e}"))
}

/// The diagnostic for a file without a unit.
pub(super) fn no_unit() -> Diag {
    Diag::input("cad-unit", "the file does not state its length unit")
        .hint("export it again with a unit; a mesh without one can be read as STL with `unit` in the job")
}

/// The diagnostic for a file that the converter refused.
pub(super) fn refused(path: &Path, error: &str, text: &str) -> Diag {
    let said = if text.is_empty() { String::new() } else { format!(": {text}") };
    let d = match error {
        "empty" => Diag::input("surface-empty", format!("the file holds no faces that can be read{said}")).hint(AGAIN),
        "unit" => no_unit(),
        "unit-of-unit" => {
            let text =
                format!("the length unit {text} of the file is defined by another unit that is no SI unit itself");
            Diag::input("cad-unit", text).hint("export it again in mm or inch: Open CASCADE reads such a unit wrongly")
        }
        "hidden" => Diag::input("cad-hidden", format!("the file hides all of its shapes{said}"))
            .hint("show the part in the CAD program and export it again"),
        "hidden-unclear" => {
            Diag::input("cad-hidden", format!("the file hides shapes in assemblies that were not found{said}"))
                .hint("remove hidden parts from the assembly and export it again")
        }
        "memory" => Diag::limit("cad-memory", "the converter needs more memory than it may take")
            .hint("use a larger chord tolerance, or allow more with TERRACE_CONVERTER_MB (default 4096)"),
        "size" => Diag::input("surface-size", format!("the surface reaches beyond 4000 mm from the origin{said}"))
            .hint("check the unit that the file states; parts lie near their origin"),
        _ => Diag::input("cad-read", format!("Open CASCADE cannot read the file{said}")).hint(AGAIN),
    };
    d.at(place(path))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An answer with these counts, coordinates and indices.
    fn answer(counts: [u64; 2], vertices: &[f64], triangles: &[u32]) -> Vec<u8> {
        let [v, t] = counts;
        let mut out = format!(
            "{{\"terrace\": 1, \"occt\": \"8\"}}\n{{\"unit\": \"mm\", \"faces\": 1, \"bodies\": 1, \"free_edges\": 3, \
             \"without_triangles\": 0, \"worst_mm\": 0.001, \"failed_count\": 0, \"failed\": [], \"remarks_count\": 0, \
             \"remarks\": [], \"vertices\": {v}, \"triangles\": {t}}}\n"
        )
        .into_bytes();
        out.extend(vertices.iter().flat_map(|v| v.to_le_bytes()));
        out.extend(triangles.iter().flat_map(|v| v.to_le_bytes()));
        out
    }

    #[test]
    fn an_answer_is_read_only_if_its_counts_coordinates_and_indices_hold() {
        let nine = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 10.0];
        let mesh = CadMesh::read(&answer([3, 1], &nine, &[0, 1, 2])).expect("whole");
        assert_eq!(mesh.facets().collect::<Vec<_>>(), [[[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 10.0]]]);
        assert_eq!((mesh.about.occt.as_str(), mesh.about.unit.as_str()), ("8", "mm"));
        for (bytes, say) in [
            (answer([3, 2], &nine, &[0, 1, 2]), "do not take"),
            (answer([4, 1], &nine, &[0, 1, 2]), "do not take"),
            (answer([u64::MAX, 1], &nine, &[0, 1, 2]), "do not take"),
            (answer([u64::MAX / 24, u64::MAX / 12], &nine, &[0, 1, 2]), "do not take"),
            (answer([3, 1], &nine, &[0, 1, 3]), "a vertex that is not there"),
            (answer([3, 1], &[f64::NAN; 9], &[0, 1, 2]), "not finite"),
            (b"solid\n".to_vec(), "ends within its header"),
            (b"a\nb\nc".to_vec(), "begins with"),
            (b"{\"terrace\": 1}\n{\"error\": \"unit\", \"text\": \"\"}\n".to_vec(), "the error"),
            (b"{\"terrace\": 1}\n{\"unit\": 1}\n".to_vec(), "header cannot be read"),
        ] {
            let why = CadMesh::read(&bytes).expect_err(say);
            assert!(why.contains(say), "{why}");
        }
    }

    #[test]
    fn equal_vertices_become_one_in_ply() {
        let vertices = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, -0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, -1.0, 0.0];
        let mesh = CadMesh::read(&answer([6, 2], &vertices, &[0, 1, 2, 3, 5, 4])).expect("whole");
        let ply = mesh.to_ply(&["made here".into()]);
        let head = String::from_utf8_lossy(&ply[..ply.len() - 4 * 24 - 2 * 13]).into_owned();
        assert!(head.contains("comment made here\nelement vertex 4\n") && head.contains("element face 2\n"), "{head}");
        assert!(head.ends_with("end_header\n"), "{head}");
        assert_eq!(ply[ply.len() - 13..], [3, 0, 0, 0, 0, 3, 0, 0, 0, 1, 0, 0, 0]);
    }

    #[test]
    fn damaged_answers_never_panic() {
        const WORDS: &[&str] = &["\n", "{", "}", "\"", ",", "null", "-1", "\"error\": \"hidden\"", "1e999", "[]"];
        let whole = answer([3, 1], &[0.0, 0.0, 1.0, 9.0, 0.0, 1.0, 0.0, 9.0, 1.0], &[0, 1, 2]);
        assert!(CadMesh::read(&whole).is_ok());
        crate::surface::mutants::each(&[whole], WORDS, |bytes| {
            if let Ok(mesh) = CadMesh::read(bytes) {
                assert!(mesh.facets().flatten().flatten().all(f64::is_finite));
                mesh.about.notes(Path::new("a.step"), Tessellation::within(0.1), &mut Vec::new());
            }
        });
    }
}
