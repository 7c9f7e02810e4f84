//! What files of surfaces hold.

use std::path::Path;
use terrace_core::math;

use serde_json::{Value, json};

use super::{Inspection, plural, triple};
use terrace_core::diag::{Diag, Error, Kind as DiagKind, Place};
use terrace_core::geom::BoxMm;
use terrace_input::job::FileUnit;
use terrace_input::surface::bodies::{self, Bodies, Body, MAX_TOLD};
use terrace_input::surface::{self, Content, Fault, FaultKind, MeshCheck};

/// What the facets of a surface come to, in the units of its file.
#[derive(Default)]
struct Facets {
    lo: [f64; 3],
    hi: [f64; 3],
    /// Area of all facets; of those that face down, by their winding; of those that are steeper than [`STEEP`],
    /// whichever way they face; of those that are steeper than [`UPRIGHT`].
    area: f64,
    down: f64,
    steep: f64,
    upright: f64,
    /// The areas as vectors: which way an open sheet faces.
    sum: [f64; 3],
}

/// Slope from which a tilted fixture may save time, deg.
const STEEP: f64 = 30.0;

/// Slope from which nothing is marked unless the job says otherwise, deg.
const UPRIGHT: f64 = 60.0;

impl Facets {
    fn add(&mut self, facet: [[f64; 3]; 3]) {
        for p in facet {
            self.lo = std::array::from_fn(|i| self.lo[i].min(p[i]));
            self.hi = std::array::from_fn(|i| self.hi[i].max(p[i]));
        }
        let [u, v] = [1, 2].map(|k| [0, 1, 2].map(|i| facet[k][i] - facet[0][i]));
        let normal = [0, 1, 2].map(|i| u[(i + 1) % 3] * v[(i + 2) % 3] - u[(i + 2) % 3] * v[(i + 1) % 3]);
        let area = normal.iter().map(|n| n * n).sum::<f64>().sqrt() / 2.0;
        self.area += area;
        let steeper = |deg: f64| normal[2].abs() < 2.0 * area * math::cos(deg.to_radians());
        self.down += if normal[2] < 0.0 { area } else { 0.0 };
        self.steep += if steeper(STEEP) { area } else { 0.0 };
        self.upright += if steeper(UPRIGHT) { area } else { 0.0 };
        self.sum = std::array::from_fn(|i| self.sum[i] + normal[i] / 2.0);
    }

    /// How the part lies, if that is not as it is marked.
    fn lies(&self) -> Option<&'static str> {
        let whole = self.sum.iter().map(|v| v * v).sum::<f64>().sqrt();
        // The areas of a closed body add up to nothing.
        let is_open = whole > 0.2 * self.area;
        match () {
            () if is_open && self.sum[2] < -0.5 * whole => Some("lies on its back"),
            () if self.upright > 0.8 * self.area => Some("stands upright"),
            () if is_open && self.sum[2] < 0.5 * whole => Some("stands upright"),
            () => None,
        }
    }

    fn size(&self) -> [f64; 3] {
        [0, 1, 2].map(|i| self.hi[i] - self.lo[i])
    }

    /// Share of an area in percent.
    fn percent(&self, area: f64) -> f64 {
        if self.area > 0.0 { area / self.area * 100.0 } else { 0.0 }
    }

    fn text(&self) -> String {
        let [steep, down] = [self.steep, self.down].map(|a| self.percent(a));
        let hint = match self.lies() {
            Some(how) => format!("\nlies    the part {how}; `terrace orient JOB --apply` lays it under the lens"),
            None if steep > 20.0 => "; `terrace orient JOB` shows whether tilting the part saves time".into(),
            None => String::new(),
        };
        format!("facets  {steep:.0} % of the area steeper than {STEEP} deg, {down:.0} % facing down{hint}\n")
    }
}

/// A file of facets, points or heights.
pub(super) fn surface_file(path: &Path, unit: Option<FileUnit>) -> Result<Inspection, Error> {
    let SurfaceReading { content, facets, mesh, bodies, is_unit_known, is_scaled, mut warnings } =
        read_surface(path, unit)?;
    let shown = |json: Value| if is_unit_known { in_mm(&facets, json) } else { in_units(&facets, json) };
    Ok(match content {
        Content::Facets(n) | Content::Tessellated(n, _) => {
            let json = json!({"kind": "surface", "facets": n,
                "steep_percent": facets.percent(facets.steep), "down_percent": facets.percent(facets.down),
                "lies": facets.lies()});
            let (text, mut json) = shown(json);
            let narrow = if is_unit_known { 1.0 } else { 1.0 / likely_unit(&facets).map_or(1.0, FileUnit::in_mm) };
            let faults = match mesh.finish(path, NARROW_MM * narrow) {
                Ok(faults) => faults,
                Err(e) => {
                    // Nothing would be marked: reported, since the file itself can be read.
                    warnings.extend(e.diags().iter().map(|d| Diag { kind: DiagKind::Warning, ..d.clone() }));
                    Vec::new()
                }
            };
            json["faults"] = faults.iter().map(fault_json).collect();
            let unit = if is_unit_known { "mm" } else { "units" };
            let lines = faults.iter().map(|f| format!("fault   {}\n", f.text(unit)));
            let bodies = bodies.finish();
            warnings.extend(bodies::warnings(&bodies, &Place::file(path.display().to_string())));
            json["bodies"] = bodies.iter().map(body_json).collect();
            let listed = bodies_text(&bodies, unit);
            let text = format!("surface, {n} facets\n{text}{}{listed}{}", facets.text(), lines.collect::<String>());
            Inspection { text, json, warnings }
        }
        Content::Heightmap(map) => {
            let values = map.samples.range().unwrap_or_default();
            let holes = (0..map.samples.len()).filter(|&i| map.samples.value(i).is_none()).count();
            let [columns, rows] = [map.columns, map.rows];
            // As the file has them: whole numbers without a fraction.
            let ends = values.map(|v| if v.fract() == 0.0 && v.abs() < 1e15 { json!(v as i64) } else { json!(v) });
            let json = json!({"kind": "heightmap", "columns": columns, "rows": rows, "values": ends, "holes": holes});
            let head = format!(
                "height map, {columns} x {rows} samples, values {} to {}, {holes} hole{}\n",
                values[0],
                values[1],
                plural(holes)
            );
            let (text, json) = if is_scaled {
                shown(json)
            } else {
                // They speak of heights that the job states.
                warnings.retain(|w| !["surface-tiny", "heightmap-flat", "heightmap-8-bit"].contains(&w.code));
                ("the job file gives its scale: [surface.heightmap] pixel, z, values, nodata\n".into(), json)
            };
            Inspection { text: format!("{head}{text}"), json, warnings }
        }
    })
}

/// The bodies of a file, where there is more than one or one has holes.
fn bodies_text(bodies: &[Body], unit: &str) -> String {
    let is_worth = bodies.len() > 1 || bodies.iter().any(|b| b.is_solid && b.open_edges.0 > 0);
    let mut text = String::new();
    for (i, body) in bodies.iter().take(MAX_TOLD).enumerate().filter(|_| is_worth) {
        let kind = match (body.is_solid, body.open_edges.0) {
            (true, 0) => "closed".to_owned(),
            (true, n) => format!("closed but for {n} open edge{}", plural(n)),
            (false, _) => "open sheet".to_owned(),
        };
        let BoxMm { lo, hi } = body.bounds;
        let [lo, hi] = [lo, hi].map(|p| triple(p, ", "));
        text += &format!("body {:<3}{} facets, {kind}, from ({lo}) to ({hi}) {unit}\n", i + 1, body.facets);
    }
    if is_worth && bodies.len() > MAX_TOLD {
        text += &format!("        and {} smaller bodies\n", bodies.len() - MAX_TOLD);
    }
    text
}

fn body_json(body: &Body) -> Value {
    json!({"facets": body.facets, "lo": body.bounds.lo, "hi": body.bounds.hi, "is_solid": body.is_solid,
        "open_edges": body.open_edges.0})
}

/// A surface file as it was read.
struct SurfaceReading {
    content: Content,
    facets: Facets,
    mesh: MeshCheck,
    bodies: Bodies,
    /// The file states its unit, or it was given.
    is_unit_known: bool,
    /// Heights and places of a height map are those of its file.
    is_scaled: bool,
    warnings: Vec<Diag>,
}

/// How the heights of a map are taken that its file does not scale.
#[derive(Clone, Copy)]
enum MapValues {
    /// From the least to the greatest number that the file can hold.
    FullRange,
    /// All numbers: of floats the range is not known before they are read, and any will do.
    Any,
}

/// How a file is read.
#[derive(Clone, Copy)]
struct Attempt {
    /// mm in one unit of the file; None where the file is to state it.
    unit_mm: Option<f64>,
    /// None where the file is to state the scale of a height map.
    map_values: Option<MapValues>,
}

impl Attempt {
    fn options(self) -> surface::Options {
        let scale = self.map_values.map(|values| surface::Scale {
            pixel_mm: 0.1,
            z_mm: [0.0, 1.0],
            values: match values {
                MapValues::FullRange => None,
                MapValues::Any => Some([-1e300, 1e300]),
            },
            nodata: None,
            origin_mm: [0.0; 2],
        });
        surface::Options { unit_mm: self.unit_mm, heightmap: scale, ..Default::default() }
    }

    /// Reads a file so; `is_unit_given` says whether the unit was given with the command.
    fn read(self, path: &Path, is_unit_given: bool) -> Result<SurfaceReading, Error> {
        let mut facets = Facets { lo: [f64::INFINITY; 3], hi: [f64::NEG_INFINITY; 3], ..Facets::default() };
        let mut warnings = Vec::new();
        let mut mesh = MeshCheck::default();
        let mut bodies = Bodies::default();
        let content = surface::read(path, &self.options(), &mut warnings, &mut |facet| {
            facets.add(facet);
            mesh.facet(facet);
            bodies.facet(facet);
        })?;
        if let Content::Heightmap(map) = &content {
            let z = map.samples.range().unwrap_or_default().map(|v| map.z_mm[0] + v * map.z_mm[1]);
            let end = |k: usize, n: usize| map.origin_mm[k] + (n - 1) as f64 * map.pixel_mm;
            facets.lo = [map.origin_mm[0], map.origin_mm[1], z[0]];
            facets.hi = [end(0, map.columns), end(1, map.rows), z[1]];
        }
        let is_unit_known = self.unit_mm.is_none() || is_unit_given;
        let is_scaled = self.map_values.is_none();
        Ok(SurfaceReading { content, facets, mesh, bodies, is_unit_known, is_scaled, warnings })
    }
}

/// Reads a surface in its own unit, in the one given, or as mm where neither is there; a height map without a scale in
/// any that shows its samples.
fn read_surface(path: &Path, unit: Option<FileUnit>) -> Result<SurfaceReading, Error> {
    let attempt = |unit_mm, map_values| Attempt { unit_mm, map_values }.read(path, unit.is_some());
    let mut reading = attempt(unit.map(FileUnit::in_mm), None);
    if unit.is_none() && has_fault(&reading, "surface-unit") {
        reading = attempt(Some(1.0), None);
        if has_fault(&reading, "surface-size") {
            // A map of land, whose place and size are not those of a part.
            reading = attempt(None, Some(MapValues::Any)).or(reading);
        }
    }
    for values in [MapValues::FullRange, MapValues::Any] {
        if has_fault(&reading, "heightmap-scale") {
            reading = attempt(None, Some(values));
        }
    }
    reading
}

/// Whether reading a file failed with a fault of this code.
fn has_fault(reading: &Result<SurfaceReading, Error>, code: &str) -> bool {
    reading.as_ref().is_err_and(|e| e.diags().iter().any(|d| d.code == code))
}

/// A STEP or IGES file, with facets coarse enough to be made at once.
pub(super) fn cad(path: &Path) -> Result<Inspection, Error> {
    let mut warnings = Vec::new();
    let fine = surface::Tessellation::within(0.1);
    let mesh = surface::load_cad(path, fine, &mut warnings)?;
    let (text, json) = crate::cli::import::shown(&mesh, fine);
    Ok(Inspection { text, json, warnings })
}

/// The box of a surface whose unit is known.
fn in_mm(facets: &Facets, mut json: Value) -> (String, Value) {
    let Facets { lo, hi, .. } = *facets;
    let corners = [lo, hi].map(|p| triple(p, ", "));
    let text =
        format!("size  {} mm\nfrom  ({}) mm\nto    ({}) mm\n", triple(facets.size(), " x "), corners[0], corners[1]);
    json["lo_mm"] = json!(lo);
    json["hi_mm"] = json!(hi);
    (text, json)
}

/// Width up to which a gap is looked at as a crack, mm: a spot is not known here.
const NARROW_MM: f64 = 0.05;

fn fault_json(fault: &Fault) -> Value {
    let mut json = json!({"kind": fault.kind.name(), "count": fault.count, "at": fault.at_mm});
    if let FaultKind::Crack { widest_mm, weldable: (corners, weld_mm) } = fault.kind {
        json["widest"] = json!(widest_mm);
        json["weldable"] = json!(corners);
        json["weld"] = json!(weld_mm);
    }
    json
}

/// Whether a surface in this unit is as large as parts that are marked in steps: larger than a field, smaller than a
/// machine.
fn is_likely(facets: &Facets, unit: FileUnit) -> bool {
    const LIKELY_MM: std::ops::RangeInclusive<f64> = 50.0..=2500.0;
    LIKELY_MM.contains(&(facets.size()[0].max(facets.size()[1]) * unit.in_mm()))
}

/// The unit of a file that does not state it, by its size.
fn likely_unit(facets: &Facets) -> Option<FileUnit> {
    UNITS.iter().map(|(_, unit)| *unit).find(|unit| is_likely(facets, *unit))
}

/// Units that a file without one may have, the likeliest first.
const UNITS: [(&str, FileUnit); 3] = [("mm", FileUnit::Millimetre), ("in", FileUnit::Inch), ("m", FileUnit::Metre)];

/// The box of a surface whose unit is not: in its own units, and in mm for each unit that it may be.
fn in_units(facets: &Facets, mut json: Value) -> (String, Value) {
    let Facets { lo, hi, .. } = *facets;
    let corners = [lo, hi].map(|p| triple(p, ", "));
    let mut text = format!(
        "size  {} (the file does not state its unit)\nfrom  ({})\nto    ({})\n",
        triple(facets.size(), " x "),
        corners[0],
        corners[1]
    );
    let likely = likely_unit(facets).and_then(|likely| UNITS.iter().find(|(_, unit)| *unit == likely)).map(|(n, _)| *n);
    for (name, unit) in UNITS {
        // 60 units are a small part in mm and a large one in inches: neither can be told from the size.
        let note = match is_likely(facets, unit) {
            true if likely == Some(name) => "   <- most likely",
            true => "   <- as likely by its size",
            false => "",
        };
        text += &format!("  if {name:<3} {} mm{note}\n", triple(facets.size().map(|s| s * unit.in_mm()), " x "));
    }
    text += "state it in the job, as unit = \"mm\" under [surface], and here with --unit\n";
    json["lo"] = json!(lo);
    json["hi"] = json!(hi);
    json["unit"] = Value::Null;
    json["likely_unit"] = json!(likely);
    (text, json)
}
