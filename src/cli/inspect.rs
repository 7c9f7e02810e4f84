//! What a file or folder holds, for the first look: boxes in mm, counts, warnings.

use std::path::Path;

use serde_json::json;

use crate::diag::{Diag, Error};
use crate::geom::mm_from_nm;
use crate::job::{FileUnit, Job, Overrides};
use crate::record::{self, AnySummary, duration};
use crate::surface::{self, Content};
use crate::texture::{Area, Kind, Request, Texture};

/// What was found.
pub struct Shown {
    pub text: String,
    pub json: serde_json::Value,
    pub warnings: Vec<Diag>,
}

/// Looks at `path`; `unit` is taken for surface files that carry none (default mm).
///
/// # Errors
/// Faults of the file.
pub fn inspect(path: &Path, unit: Option<FileUnit>) -> Result<Shown, Error> {
    if path.is_dir() {
        return folder(path);
    }
    let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
    match extension.as_str() {
        "toml" => job(path),
        "svg" | "svgz" => drawing(path),
        _ => surface_file(path, unit.unwrap_or(FileUnit::Millimetre)),
    }
}

fn surface_file(path: &Path, unit: FileUnit) -> Result<Shown, Error> {
    let mut warnings = Vec::new();
    let scale = surface::Scale { pixel_mm: 1.0, z_mm: [0.0, 1.0], values: None, nodata: None, origin_mm: [0.0; 2] };
    let options = surface::Options { unit_mm: Some(unit.in_mm()), heightmap: Some(scale), max_edge_mm: None };
    let (mut lo, mut hi) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
    let content = surface::read(path, &options, &mut warnings, &mut |facet| {
        for p in facet {
            for i in 0..3 {
                lo[i] = lo[i].min(p[i]);
                hi[i] = hi[i].max(p[i]);
            }
        }
    })?;
    Ok(match content {
        Content::Facets(n) => {
            let size = [0, 1, 2].map(|i| hi[i] - lo[i]);
            let mm = |v: [f64; 3]| format!("{:.4} x {:.4} x {:.4} mm", v[0], v[1], v[2]);
            let at = |v: [f64; 3]| format!("({:.4}, {:.4}, {:.4}) mm", v[0], v[1], v[2]);
            Shown {
                text: format!("surface, {n} facets\nsize  {}\nfrom  {}\nto    {}\n", mm(size), at(lo), at(hi)),
                json: json!({"kind": "surface", "facets": n, "lo_mm": lo, "hi_mm": hi}),
                warnings,
            }
        }
        Content::Heightmap(map) => {
            let (min, max) = map.samples.iter().fold((u16::MAX, 0), |(a, b), &v| (a.min(v), b.max(v)));
            Shown {
                text: format!(
                    "height map, {} x {} samples, values {min} to {max}\n\
                     its scale stands in the job file: [surface.heightmap] pixel, z, values, nodata\n",
                    map.columns, map.rows
                ),
                json: json!({"kind": "heightmap", "columns": map.columns, "rows": map.rows, "values": [min, max]}),
                warnings,
            }
        }
    })
}

fn drawing(path: &Path) -> Result<Shown, Error> {
    let mut warnings = Vec::new();
    let request = |size_mm| Request {
        kind: Kind::Drawing { path: path.to_owned(), size_mm, origin_mm: Some([0.0, 0.0]), turn_rad: 0.0, tile: false },
        area: Area::Unlimited,
        tolerance_mm: 1e-3,
        pen: 0,
    };
    // Without a physical size the drawing is shown as if its page were 100 mm wide and high.
    let (texture, sized) = match Texture::load(&[request(None)], [0.0; 4], 0.0, &mut warnings) {
        Ok(t) => (t, true),
        Err(e) if e.diags().iter().any(|d| d.code == "svg-size") => {
            warnings.clear();
            (Texture::load(&[request(Some([100.0; 2]))], [0.0; 4], 0.0, &mut warnings)?, false)
        }
        Err(e) => return Err(e),
    };
    let mut points = Vec::new();
    let (mut length, mut count, mut closed) = (0.0, 0, 0);
    for i in 0..texture.len() {
        texture.stroke(i, &mut points);
        length += crate::geom::length_mm(&points);
        count += points.len();
        closed += usize::from(points.first() == points.last());
    }
    let b = texture.bounds();
    let (lo, hi) = (b.lo.mm(), b.hi.mm());
    let note = if sized { "" } else { "no physical size in the file: figures are for a page of 100 x 100 mm\n" };
    Ok(Shown {
        text: format!(
            "drawing, {} strokes ({closed} closed), {count} points, {length:.3} mm\n\
             from ({:.4}, {:.4}) to ({:.4}, {:.4}) mm\n{note}",
            texture.len(),
            lo[0],
            lo[1],
            hi[0],
            hi[1]
        ),
        json: json!({"kind": "drawing", "strokes": texture.len(), "closed": closed, "points": count,
            "length_mm": length, "lo_mm": lo, "hi_mm": hi, "physical_size": sized}),
        warnings,
    })
}

fn job(path: &Path) -> Result<Shown, Error> {
    let job = Job::load(path, &Overrides::default())?;
    let machine = job.machine()?;
    let surface = job.surface_path();
    let pdof_mm = mm_from_nm(job.focus.pdof);
    let text = format!(
        "job file\nmode      {}\nsurface   {}\ntextures  {}\npdof      {pdof_mm} mm\nmachine   {}\nmethod    {}\n",
        job.mode.name(),
        surface.display(),
        job.textures.len(),
        machine.name,
        job.partition.method.name()
    );
    let json = json!({"kind": "job", "mode": job.mode.name(), "surface": surface.display().to_string(),
        "textures": job.textures.len(), "pdof_mm": pdof_mm, "machine": machine.name,
        "method": job.partition.method.name()});
    Ok(Shown { text, json, warnings: Vec::new() })
}

fn folder(path: &Path) -> Result<Shown, Error> {
    let found = record::read(path)?;
    let (figures, time_s, mark_mm) = match &found.summary {
        AnySummary::Stepped(s) => (format!("stops    {}", s.stops), s.time_s.total, s.mark_mm),
        AnySummary::OnTheFly(s) => (format!("moves    {}", s.moves), s.time_s, s.mark_mm),
    };
    let text = format!(
        "job folder made by terrace {}\nmode     {}\nmachine  {}\n{figures}\nmarks    {mark_mm:.3} mm\ntime     {}\nfiles    {}\n",
        found.head.terrace,
        found.head.mode.name(),
        found.machine,
        duration(time_s),
        found.head.files.len()
    );
    let json = json!({"kind": "folder", "mode": found.head.mode.name(), "summary": found.summary.to_json(),
        "machine": found.machine});
    Ok(Shown { text, json, warnings: Vec::new() })
}
