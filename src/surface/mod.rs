//! The part's surface as the lens sees it.
//!
//! A file is read facet by facet ([`read`]); a mesh is welded, a height map stays a grid. Of several
//! sheets under the lens the topmost counts, whatever a facet's winding.
//!
//! Units: file readers hand over f64 mm in the part frame; the walk works in nm (x and y integers).

mod facets;
mod heightmap;
mod lines;
mod obj;
mod points;
mod stl;

use std::path::Path;

use crate::diag::{Diag, Error};

/// How a surface file is to be read.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// mm in one unit of the file; None where the job states none (height maps need none).
    pub unit_mm: Option<f64>,
    /// Scale of a height map.
    pub heightmap: Option<Scale>,
    /// Longest triangle edge for point clouds, mm.
    pub max_edge_mm: Option<f64>,
}

/// Scale of a height map, mm.
#[derive(Clone, Debug)]
pub struct Scale {
    /// Distance of neighbouring samples.
    pub pixel_mm: f64,
    /// Heights of the two values.
    pub z_mm: [f64; 2],
    /// The two values; None for the full range of the file's depth.
    pub values: Option<[u32; 2]>,
    /// Value of samples that are holes.
    pub nodata: Option<u32>,
    /// Part-frame position of the lower left sample.
    pub origin_mm: [f64; 2],
}

/// A height map: samples are nodes of a grid; row 0 of `samples` is the lowest y (the file's last row).
#[derive(Clone, Debug)]
pub struct Heightmap {
    /// Samples along x.
    pub columns: usize,
    /// Samples along y.
    pub rows: usize,
    /// Values, row by row from the lowest y.
    pub samples: Vec<u16>,
    /// Value of holes.
    pub nodata: Option<u16>,
    /// Position of sample (0, 0), mm.
    pub origin_mm: [f64; 2],
    /// Distance of samples, mm.
    pub pixel_mm: f64,
    /// z in mm of value v is `z_mm[0] + v * z_mm[1]`.
    pub z_mm: [f64; 2],
}

/// What a surface file held.
pub enum Content {
    /// Facets; they went to the sink, this many.
    Facets(usize),
    /// A height map.
    Heightmap(Heightmap),
}

/// Reads a surface file. Facets of meshes and of triangulated point clouds go to `sink` in file
/// order, corners in mm in the part frame, as the file has them: not welded, degenerate ones included.
///
/// # Errors
/// Every fault of the file, with its place and remedy.
pub fn read(
    path: &Path,
    options: &Options,
    notes: &mut Vec<Diag>,
    sink: &mut dyn FnMut([[f64; 3]; 3]),
) -> Result<Content, Error> {
    let refuse = |code, text: String| Diag::input(code, text).at(lines::place(path));
    let unit = |kind: &str| match options.unit_mm {
        Some(unit) if unit > 0.0 && unit.is_finite() => Ok(unit),
        Some(unit) => Err(refuse("surface-unit", format!("a unit of {unit} mm is no unit"))),
        None => Err(refuse("surface-unit", format!("{kind} carries no unit")).hint("add unit = \"mm\" to [surface]")),
    };
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
    match extension.as_str() {
        "stl" => stl::read(path, unit("an STL file")?, notes, sink),
        "obj" => obj::read(path, unit("an OBJ file")?, notes, sink),
        "png" => match &options.heightmap {
            Some(scale) => heightmap::read(path, scale, notes),
            None => Err(refuse("heightmap-scale", "a PNG image carries no scale".into())
                .hint("add [surface.heightmap] with pixel (distance of samples) and z (heights of two values)")
                .into()),
        },
        "xyz" | "csv" | "txt" | "asc" => points::read(path, unit("a point cloud")?, options.max_edge_mm, notes, sink),
        other => {
            let what = if other.is_empty() { "no extension".into() } else { format!("the extension .{other}") };
            Err(refuse("surface-format", format!("a surface file with {what} is not read"))
                .hint("surfaces are read from .stl, .obj, .png (height map), and .xyz, .csv, .txt or .asc (points)")
                .into())
        }
    }
}
