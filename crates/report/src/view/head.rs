//! What the page reads first, as JSON: everything but marks, surface and blocks.

use serde::Serialize;

use super::fixtures::FixtureHead;
use super::marks::ChunkHead;
use super::measured::MeasuredHead;
use super::tone::Tones;
use crate::scene::{Histogram, Scene, UnmarkedRow};
use terrace_core::diag::Message;
use terrace_core::geom::NM_PER_MM;
use terrace_core::machine::{FieldShape, Machine, Origin};
use terrace_core::motion::GalvoModel;
use terrace_core::program::Pen;
use terrace_core::units::Time;
use terrace_input::surface::Decimated;

/// The head of the page. Lengths mm, angles deg, times s, unless the key says otherwise.
#[derive(Serialize)]
pub(super) struct Head<'a> {
    pub schema: u32,
    pub terrace: &'static str,
    pub job: &'a str,
    pub machine: &'a str,
    pub mode: &'static str,
    pub time_s: f64,
    #[serde(rename = "box")]
    pub bounds: [[f64; 3]; 2],
    pub part: PartHead,
    pub field: FieldHead,
    pub lens: LensHead,
    pub pivot: Option<[f64; 3]>,
    /// Whether the head tilts and the part stays.
    pub head_tilts: bool,
    pub travel: Vec<[[f64; 3]; 2]>,
    pub pens: Vec<PenHead<'a>>,
    pub scanner: ScannerHead,
    pub passes: usize,
    pub setups: usize,
    pub maps: Vec<MapHead>,
    pub tones: Tones,
    pub spot_mm: f64,
    /// How far marks may lie from their focal plane.
    pub half_depth_mm: f64,
    pub blocks: ListHead,
    pub chunks: Vec<ChunkHead>,
    pub incidence_deg_per_step: f64,
    pub defocus_um_per_step: f64,
    pub skipped: Vec<SkippedHead>,
    pub skipped_lines: Option<LinesHead>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub fixtures: Vec<FixtureHead<'a>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub measured: Option<MeasuredHead<'a>>,
    pub motion: Option<MotionHead>,
    pub ranges: Ranges,
    pub histograms: Histograms,
    pub thinned: ThinnedHead,
    pub marks: usize,
    pub mark_mm: f64,
    pub warnings: &'a [Message],
    pub figures: &'a [(&'static str, String)],
}

/// A list that the page decodes from the element of a name.
#[derive(Serialize)]
pub(super) struct ListHead {
    pub name: &'static str,
    pub count: usize,
}

/// The surface of the part as the page has it.
#[derive(Serialize)]
pub(super) struct PartHead {
    triangles: usize,
    of: usize,
    within_mm: f64,
    vertices: usize,
    #[serde(rename = "box")]
    pub bounds: [[f64; 3]; 2],
}

impl PartHead {
    pub(super) fn new(part: &Decimated, bounds: [[f64; 3]; 2]) -> Self {
        let triangles = part.triangles.len();
        let vertices = part.vertices.len();
        Self { triangles, of: part.of, within_mm: part.within_mm, vertices, bounds }
    }
}

/// The usable field.
#[derive(Serialize)]
pub(super) struct FieldHead {
    size: [f64; 2],
    shape: &'static str,
}

/// The lens.
#[derive(Serialize)]
pub(super) struct LensHead {
    working_distance_mm: f64,
    diameter_mm: f64,
}

/// A pen.
#[derive(Serialize)]
pub(super) struct PenHead<'a> {
    name: &'a str,
    speed_mm_s: f64,
    power: String,
    frequency_khz: f64,
    passes: u32,
    dwell_us: Option<f64>,
}

impl<'a> PenHead<'a> {
    fn new(pen: &'a Pen) -> Self {
        Self {
            name: &pen.name,
            speed_mm_s: pen.speed.as_mm_s(),
            power: pen.power.to_string(),
            frequency_khz: pen.frequency.as_khz(),
            passes: pen.passes,
            dwell_us: pen.dwell.map(|dwell| dwell.as_us()),
        }
    }
}

/// The scanner.
#[derive(Serialize)]
pub(super) struct ScannerHead {
    jump_speed_mm_s: f64,
    jump_delay_us: f64,
    mark_delay_us: f64,
    polygon_delay_us: f64,
}

/// The map of a pass.
#[derive(Serialize)]
pub(super) struct MapHead {
    pub name: String,
    pub pass: u32,
    pub origin: [f64; 2],
    pub cell: f64,
    pub columns: usize,
    pub rows: usize,
}

/// Texture that is not marked, for one reason.
#[derive(Serialize)]
pub(super) struct SkippedHead {
    reason: &'static str,
    text: &'static str,
    texture: usize,
    length_mm: f64,
    share_percent: f64,
    dots: u64,
    #[serde(rename = "box")]
    bounds: [f64; 4],
}

impl SkippedHead {
    fn new(row: &UnmarkedRow) -> Self {
        let ([x0, y0], [x1, y1]) = (row.area.lo.mm(), row.area.hi.mm());
        Self {
            reason: row.reason.name(),
            text: row.reason.text(),
            texture: row.texture,
            length_mm: row.length_mm,
            share_percent: row.share_percent,
            dots: row.dots,
            bounds: [x0, y0, x1, y1],
        }
    }
}

/// The lines that are not marked.
#[derive(Serialize)]
pub(super) struct LinesHead {
    pub name: &'static str,
    pub lines: usize,
    pub points: usize,
    pub left_out: usize,
}

/// The motion of an on-the-fly job.
#[derive(Serialize)]
pub(super) struct MotionHead {
    pub name: &'static str,
    pub samples: usize,
}

/// Least and greatest values, for the colours.
#[derive(Serialize)]
pub(super) struct Ranges {
    pub height_mm: [f64; 2],
    pub defocus_um: [f64; 2],
    pub incidence_deg: [f64; 2],
    pub dose: [f64; 2],
}

/// Marked length by value.
#[derive(Serialize)]
pub(super) struct Histograms {
    defocus_um: HistogramHead,
    incidence_deg: HistogramHead,
}

/// One histogram.
#[derive(Serialize)]
struct HistogramHead {
    edges: Vec<f64>,
    length_mm: Vec<f64>,
    /// Whether the bars count dots, of a job without lines.
    of_dots: bool,
}

/// How lines were made simpler.
#[derive(Serialize)]
pub(super) struct ThinnedHead {
    within_um: f64,
    points_left_out: usize,
}

pub(super) fn field(machine: &Machine) -> FieldHead {
    let shape = match machine.lens.shape {
        FieldShape::Rectangle => "rectangle",
        FieldShape::Circle => "circle",
    };
    let size = match machine.lens.shape {
        FieldShape::Rectangle => machine.usable_field().map(|s| s.mm()),
        // The usable field is the square within; the picture has the circle.
        FieldShape::Circle => {
            let [x, y] = machine.lens.field.map(|f| f.as_mm() - 2.0 * machine.lens.margin.as_mm());
            [x.min(y); 2]
        }
    };
    FieldHead { size, shape }
}

pub(super) fn lens(machine: &Machine) -> LensHead {
    let lens = &machine.lens;
    LensHead { working_distance_mm: lens.working_distance.as_mm(), diameter_mm: lens.diameter.as_mm() }
}

/// Where the centre of the field can go over a part whose origin lies at `origin`.
pub(super) fn travel(machine: &Machine, origin: Origin) -> [[f64; 3]; 2] {
    let ends = machine.axes().map(|(_, axis)| axis.travel_nm().map(|end| axis.sign() * end.0));
    let side = |k: usize, pick: fn(i64, i64) -> i64| (pick(ends[k][0], ends[k][1]) - origin[k]) as f64 / NM_PER_MM;
    [[0, 1, 2].map(|k| side(k, i64::min)), [0, 1, 2].map(|k| side(k, i64::max))]
}

/// Where the axes of a table turn the part, part frame.
pub(super) fn pivot(machine: &Machine, origin: Origin) -> Option<[f64; 3]> {
    let table = machine.tilt.as_ref().filter(|_| !machine.tilts_head())?;
    Some([0, 1, 2].map(|k| table.pivot[k].as_mm() - origin[k] as f64 / NM_PER_MM))
}

pub(super) fn pens(pens: &[Pen]) -> Vec<PenHead<'_>> {
    pens.iter().map(PenHead::new).collect()
}

pub(super) fn scanner(machine: &Machine) -> ScannerHead {
    let delays = &machine.delays;
    // From rest to rest the stop at ends and corners is in the time of the block.
    let is_at_speed = GalvoModel::of(machine) == GalvoModel::AtSpeed;
    let at_speed = |delay: Time| if is_at_speed { delay.as_us() } else { 0.0 };
    ScannerHead {
        jump_speed_mm_s: machine.scanner.jump_speed.as_mm_s(),
        jump_delay_us: delays.jump.as_us(),
        mark_delay_us: at_speed(delays.mark),
        polygon_delay_us: at_speed(delays.polygon),
    }
}

pub(super) fn skipped(scene: &Scene) -> Vec<SkippedHead> {
    scene.unmarked.rows.iter().map(SkippedHead::new).collect()
}

pub(super) fn histograms(scene: &Scene, pens: &[Pen]) -> Histograms {
    let passes: Vec<u32> = pens.iter().map(|pen| pen.passes).collect();
    let of_dots = scene.groups.iter().flat_map(|g| &g.marks).all(|mark| mark.len == 1);
    let head = |h: Histogram| HistogramHead { edges: h.edges(), length_mm: h.bins, of_dots };
    Histograms {
        defocus_um: head(Histogram::of_defocus(scene, &passes)),
        incidence_deg: head(Histogram::of_incidence(scene, &passes)),
    }
}

pub(super) fn thinned(scene: &Scene) -> ThinnedHead {
    ThinnedHead { within_um: scene.thinned.within_um, points_left_out: scene.thinned.points }
}
