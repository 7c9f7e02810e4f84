//! The formats of surface files: which extensions they have, what they hold and how they are read.
//!
//! A format is a reader next to this file and a row of [`FORMATS`].

use std::path::Path;

use super::cad::{self, Tessellation};
use super::facets::Unit;
use super::heightmap::esri_grid::{self, By};
use super::heightmap::{png_image, tiff_image};
use super::lines::{self, Lines};
use super::{Content, Options, Scale, obj, ply, points, stl, threemf};
use terrace_core::diag::{Diag, Error};

/// What a surface file holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SurfaceKind {
    /// Facets.
    Facets,
    /// Exact surfaces, which become facets.
    ExactSurfaces,
    /// Heights, row by row.
    HeightMap,
    /// Points, which are triangulated; or an ESRI grid of heights.
    Points,
}

/// A format of surface files.
pub struct SurfaceFormat {
    /// In messages.
    pub name: &'static str,
    /// Of file names, in small letters.
    pub extensions: &'static [&'static str],
    /// What such a file holds.
    pub holds: SurfaceKind,
    pub(super) read: fn(SurfaceFile<'_>) -> Result<Content, Error>,
}

/// All formats.
pub static FORMATS: [SurfaceFormat; 9] = [
    SurfaceFormat {
        name: "an STL file",
        extensions: &["stl"],
        holds: SurfaceKind::Facets,
        read: |f| stl::read(f.path, f.unit()?, f.notes, f.sink),
    },
    SurfaceFormat {
        name: "an OBJ file",
        extensions: &["obj"],
        holds: SurfaceKind::Facets,
        read: |f| obj::read(f.path, f.unit()?, f.notes, f.sink),
    },
    SurfaceFormat {
        name: "a PLY file",
        extensions: &["ply"],
        holds: SurfaceKind::Facets,
        read: |f| ply::read(f.path, f.unit()?, f.notes, f.sink),
    },
    SurfaceFormat {
        name: "a 3MF file",
        extensions: &["3mf"],
        holds: SurfaceKind::Facets,
        read: |f| threemf::read(f.path, f.stated_unit_mm()?, f.options, f.notes, f.sink),
    },
    SurfaceFormat {
        name: "a STEP file",
        extensions: &["step", "stp"],
        holds: SurfaceKind::ExactSurfaces,
        read: exact_surfaces,
    },
    SurfaceFormat {
        name: "an IGES file",
        extensions: &["iges", "igs"],
        holds: SurfaceKind::ExactSurfaces,
        read: exact_surfaces,
    },
    SurfaceFormat {
        name: "a PNG image",
        extensions: &["png"],
        holds: SurfaceKind::HeightMap,
        read: |f| png_image::read(f.path, f.scale()?, f.notes),
    },
    SurfaceFormat {
        name: "a TIFF image",
        extensions: &["tif", "tiff"],
        holds: SurfaceKind::HeightMap,
        read: |f| tiff_image::read(f.path, f.scale()?, f.notes),
    },
    SurfaceFormat {
        name: "a point cloud",
        extensions: &["xyz", "csv", "txt", "asc", "pts", "ptx"],
        holds: SurfaceKind::Points,
        read: points_or_grid,
    },
];

/// The format of a file, by its extension.
pub fn of(path: &Path) -> Option<&'static SurfaceFormat> {
    let extension = extension(path);
    FORMATS.iter().find(|format| format.extensions.contains(&extension.as_str()))
}

/// The extensions of files that hold such surfaces.
fn extensions(holds: &[SurfaceKind]) -> String {
    let formats = FORMATS.iter().filter(|format| holds.contains(&format.holds));
    formats.flat_map(|f| f.extensions).map(|e| format!(".{e}")).collect::<Vec<_>>().join(", ")
}

/// The extension of a file, in lower case.
fn extension(path: &Path) -> String {
    path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase()
}

/// The fault of a file of another format, and how its surface comes to be read.
pub(super) fn unread(path: &Path) -> Diag {
    let extension = extension(path);
    let what = if extension.is_empty() { "no extension".into() } else { format!("the extension .{extension}") };
    let hint = match extension.as_str() {
        "x_t" | "x_b" | "sldprt" | "ipt" | "catpart" | "prt" | "3dm" | "fcstd" => {
            "export it from the CAD program as STEP".into()
        }
        "svg" | "svgz" | "dxf" | "plt" | "hpgl" => "a drawing is a texture: name it as file of a [[texture]]".into(),
        "amf" | "off" | "glb" | "gltf" | "fbx" | "dae" => {
            "open it in MeshLab or Blender and export it as binary STL".into()
        }
        "dem" | "grd" | "flt" | "bil" | "hgt" | "adf" | "img" | "vrt" => {
            "convert it to GeoTIFF or an ESRI ASCII grid (.asc), with gdal_translate or QGIS".into()
        }
        _ => {
            format!(
                "surfaces are read from {}, {} (height maps), and {} (points, or an ESRI grid)",
                extensions(&[SurfaceKind::Facets, SurfaceKind::ExactSurfaces]),
                extensions(&[SurfaceKind::HeightMap]),
                extensions(&[SurfaceKind::Points])
            )
        }
    };
    let text = format!("a surface file with {what} is not read");
    Diag::input("surface-format", text).at(lines::place(path)).hint(hint)
}

/// A surface file that is to be read.
pub(super) struct SurfaceFile<'a> {
    pub(super) path: &'a Path,
    /// The name of the format in messages.
    pub(super) name: &'static str,
    pub(super) options: &'a Options,
    pub(super) notes: &'a mut Vec<Diag>,
    /// Takes facets, corners in mm in the part frame.
    pub(super) sink: &'a mut dyn FnMut([[f64; 3]; 3]),
}

impl<'a> SurfaceFile<'a> {
    /// A fault of the file.
    fn refuse(&self, code: &'static str, text: String) -> Diag {
        Diag::input(code, text).at(lines::place(self.path))
    }

    /// The unit that the job states, mm.
    fn stated_unit_mm(&self) -> Result<Option<f64>, Diag> {
        match self.options.unit_mm {
            Some(unit) if !(unit > 0.0 && unit.is_finite()) => Err(self
                .refuse("surface-unit", format!("{}: {unit} mm is not a unit", self.name))
                .hint("correct unit in [surface]")),
            unit => Ok(unit),
        }
    }

    /// The unit of a file that states none.
    fn unit(&self) -> Result<Unit, Diag> {
        let scale = self.options.scale.unwrap_or(1.0);
        let Some(unit_mm) = self.stated_unit_mm()? else {
            let fault = self.refuse("surface-unit", format!("{} carries no unit", self.name));
            return Err(fault.hint("add unit = \"mm\" to [surface]"));
        };
        let mm = unit_mm * scale;
        Ok(Unit { mm, scale, datum: self.options.datum.unwrap_or_default() })
    }

    /// Refuses `surface.datum` and `surface.scale`, which do not place such a file; `way` does.
    fn is_not_placed(&self, what: &str, way: &str) -> Result<(), Diag> {
        if self.options.datum.is_none() && self.options.scale.is_none() {
            return Ok(());
        }
        let text = format!("surface.datum and surface.scale do not place {what}");
        Err(self.refuse("surface-datum", text).hint(way))
    }

    /// The scale of a height map.
    fn scale(&self) -> Result<&'a Scale, Diag> {
        self.is_not_placed(self.name, WAY_OF_MAPS)?;
        self.options.heightmap.as_ref().ok_or_else(|| {
            self.refuse("heightmap-scale", format!("{} carries no scale", self.name))
                .hint("add [surface.heightmap] with pixel (sample spacing) and z (heights of two values)")
        })
    }
}

/// What places a height map.
const WAY_OF_MAPS: &str = "use pixel, z and origin of [surface.heightmap]";

/// Reads a STEP or IGES file.
fn exact_surfaces(file: SurfaceFile<'_>) -> Result<Content, Error> {
    file.is_not_placed("STEP and IGES files", "move and scale the part in the CAD program")?;
    cad::read(file.path, file.options.tessellation.unwrap_or(Tessellation::within(0.01)), file.notes, file.sink)
}

/// Reads points, or an ESRI grid, which begins otherwise.
fn points_or_grid(file: SurfaceFile<'_>) -> Result<Content, Error> {
    // A grid may have its scale from either.
    if file.options.heightmap.is_none() {
        file.unit()?;
    }
    let lines = Lines::open(file.path, file.name)?;
    if !esri_grid::begins(lines.head()) {
        return points::read(lines, file.path, file.unit()?, file.options, file.notes, file.sink);
    }
    let file = SurfaceFile { name: "a grid", ..file };
    file.is_not_placed(file.name, WAY_OF_MAPS)?;
    let by = match (&file.options.heightmap, file.stated_unit_mm()?) {
        (Some(scale), None) => By::Scale(scale),
        (None, Some(unit_mm)) => By::Unit(unit_mm),
        _ => {
            let text = "unit and [surface.heightmap] both give the grid a scale".into();
            let hint = "keep unit to use the numbers of its header, or [surface.heightmap]";
            return Err(file.refuse("heightmap-scale", text).hint(hint).into());
        }
    };
    esri_grid::read(lines, file.path, &by, file.notes)
}
