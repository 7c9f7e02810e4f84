//! OpenVectorFormat: the whole job in one file whose model is ours. A work plane is a block: the axes
//! move, stand still, and its vector blocks are marked.
//!
//! Positions of a work plane are the commanded axis values (mm); points are mm in controller coordinates
//! from the optical axis. Both are single precision, as the format has it: 3.8 nm at 50 mm. Strokes keep
//! their marking order: consecutive strokes of two points and one pen share a vector block of hatches,
//! consecutive dots of one pen a point sequence; a longer stroke is a line sequence of its own. Pens are marking
//! parameters with keys from 1; where a zoom optic shifts the focus, there is a set of them for every pen and shift.
//!
//! The format fixes no sign for what an axis moves, so `machine_type` says it: `x-part` is an axis that
//! carries the part, `x-head` one that carries the head, `-reversed` one that counts against the frame. Where tilt axes
//! carry the head it names them too (`a-head`), and `additional_axis_positions` holds the pose of the head as
//! `poses.csv` has it: x, y, z in mm, then the turns about z, y and x in degrees.

mod message;

use std::collections::BTreeMap;

use prost::Message;

use self::message::{
    Bounds, Empty, Job, JobLut, JobMetaData, MarkingParams, Part, Patch, Points, VectorBlock, VectorBlockMetaData,
    WorkPlane, WorkPlaneLut, WorkPlaneMetaData,
};
use super::poses::Pose;
use crate::check::Checked;
use terrace_core::geom::{Box2, Controller, FieldPoint, Nm, mm_from_nm};
use terrace_core::machine::{Carries, Machine};
use terrace_core::program::{PenId, Program, Stroke};

/// Most points in one vector block; readers load a vector block as a whole.
const MOST_POINTS: usize = 1_000_000;

/// Key of the only part in the map of parts.
const PART_KEY: i32 = 1;

/// The file. `job_name` and `source_name` name the job and the surface it is for.
///
/// # Panics
/// If there are 2^31 blocks or more, which no program has.
pub fn write(checked: &Checked, machine: &Machine, job_name: &str, source_name: &str) -> Vec<u8> {
    let program = checked.program();
    let mut file = File { bytes: Vec::with_capacity(1000 + room(program)) };
    file.bytes.extend_from_slice(b"LVF!");
    let lut_place = file.reserve_offset();
    let machine_type = machine_type(machine);
    let settings = Settings::of(program);
    let mut planes = Vec::with_capacity(program.blocks.len());
    let mut bounds = Box2::EMPTY;
    for index in 0..program.blocks.len() {
        planes.push(file.end());
        bounds = bounds.union(work_plane(&mut file, checked, machine, index, &settings, &machine_type));
    }
    let shell = file.end();
    file.message(&Job {
        meta_data: Some(JobMetaData {
            job_name: job_name.into(),
            author: concat!("terrace ", env!("CARGO_PKG_VERSION")).into(),
            description: "mm; positions are axis commands, points lie around the optical axis".into(),
            bounds: bounds_mm(&bounds),
        }),
        marking_params: (1..)
            .zip(settings.list.iter().map(|&(pen, shift)| marking_params(program, pen, shift, machine)))
            .collect(),
        parts: [(PART_KEY, Part { name: source_name.into() })].into(),
        num_work_planes: i32::try_from(planes.len()).expect("fewer than 2^31 blocks"),
    });
    let lut = file.end();
    file.message(&JobLut { shell, work_planes: planes });
    file.fill_offset(lut_place, lut);
    file.bytes
}

/// Bytes that the work planes take, or some more.
fn room(program: &Program) -> usize {
    let Program { points, strokes, blocks, .. } = program;
    8 * points.len() + 90 * strokes.iter().filter(|s| s.len != 2).count() + 500 * blocks.len()
}

/// Appends one work plane with its vector blocks and its table; returns the extent of its points.
fn work_plane(
    file: &mut File,
    checked: &Checked,
    machine: &Machine,
    index: usize,
    settings: &Settings,
    machine_type: &str,
) -> Box2<Controller> {
    let program = checked.program();
    let block = &program.blocks[index];
    let lut_place = file.reserve_offset();
    let mut extent = Box2::EMPTY;
    let mut starts = Vec::new();
    let mut strokes = program.strokes_of(block);
    let mut beam = Beam { at: FieldPoint::AXIS, mark_mm: 0.0, jump_mm: 0.0 };
    while let [first, ..] = strokes {
        let (alike, later) = strokes.split_at(run_length(strokes));
        let key = settings.key(first.pen, block.focus_shift);
        let (vectors, bounds) = vector_block(program, machine, key, alike, &mut beam);
        starts.push(file.end());
        file.message(&vectors);
        extent = extent.union(bounds);
        strokes = later;
    }
    let shell = file.end();
    file.message(&work_plane_shell(checked, machine, index, starts.len(), machine_type, &beam, &extent));
    let lut = file.end();
    file.message(&WorkPlaneLut { shell, vector_blocks: starts });
    file.fill_offset(lut_place, lut);
    extent
}

/// What a work plane says of itself: where the stage stands, and the figures of its vector blocks.
fn work_plane_shell(
    checked: &Checked,
    machine: &Machine,
    index: usize,
    vector_blocks: usize,
    machine_type: &str,
    beam: &Beam,
    extent: &Box2<Controller>,
) -> WorkPlane {
    let block = &checked.program().blocks[index];
    let [x_pos_mm, y_pos_mm, z_pos_mm] = block.stage.0.map(single_mm);
    let mut rotation = [0.0; 3];
    for (axis, command) in machine.tilt.iter().flat_map(|t| &t.axes).zip(block.stop.tilt.0) {
        rotation[axis.letter as usize] = (command as f64 / 1e6) as f32;
    }
    let [x_rot_deg, y_rot_deg, z_rot_deg] = rotation;
    let additional_axis_positions = if machine.tilts_head() {
        Pose::of(machine, block, checked.origins()[block.setup.index()]).values().map(|v| v as f32).to_vec()
    } else {
        Vec::new()
    };
    let centre = Patch { u_mm: single_mm(block.stop.centre.x), v_mm: single_mm(block.stop.centre.y) };
    WorkPlane {
        x_pos_mm,
        y_pos_mm,
        z_pos_mm,
        x_rot_deg,
        y_rot_deg,
        z_rot_deg,
        num_blocks: i32::try_from(vector_blocks).expect("fewer than 2^31 strokes in a block"),
        work_plane_number: i32::try_from(index).expect("fewer than 2^31 blocks"),
        machine_type: machine_type.into(),
        additional_axis_positions,
        meta_data: Some(WorkPlaneMetaData {
            scan_distance_mm: beam.mark_mm,
            jump_distance_mm: beam.jump_mm,
            patches: [(0, centre)].into(),
            bounds: bounds_mm(extent),
        }),
    }
}

/// The sets of marking parameters: pens with focus shifts, the first of which has the key 1.
struct Settings {
    list: Vec<(PenId, Nm)>,
    keys: BTreeMap<(PenId, Nm), i32>,
}

impl Settings {
    /// All pens without a shift, and then what else the blocks use, in their order.
    fn of(program: &Program) -> Self {
        let mut list: Vec<_> = (0..program.pens.len() as u16).map(|pen| (PenId(pen), Nm(0))).collect();
        let mut keys: BTreeMap<_, _> = list.iter().copied().zip(1..).collect();
        for block in program.blocks.iter().filter(|b| b.focus_shift != Nm(0)) {
            for setting in program.pens_of(block).into_iter().map(|pen| (pen, block.focus_shift)) {
                keys.entry(setting).or_insert_with(|| {
                    list.push(setting);
                    i32::try_from(list.len()).expect("fewer than 2^31 settings")
                });
            }
        }
        Self { list, keys }
    }

    fn key(&self, pen: PenId, shift: Nm) -> i32 {
        self.keys[&(pen, shift)]
    }
}

/// How many of the strokes, from the first on, go into one vector block.
fn run_length(strokes: &[Stroke]) -> usize {
    let first = &strokes[0];
    if first.len > 2 {
        return 1;
    }
    let alike = strokes.iter().take(MOST_POINTS / 2).take_while(|s| s.pen == first.pen && s.len == first.len);
    alike.count()
}

/// The beam on its way through a work plane.
struct Beam {
    at: FieldPoint,
    /// Lengths of the marks and jumps so far, mm: over the whole block [`Program::mark_mm`] and [`Program::jump_mm`].
    mark_mm: f64,
    jump_mm: f64,
}

/// One vector block. Its own distances are those of one repeat.
fn vector_block(
    program: &Program,
    machine: &Machine,
    key: i32,
    strokes: &[Stroke],
    beam: &mut Beam,
) -> (VectorBlock, Box2<Controller>) {
    let first = &strokes[0];
    let passes = program.pens[first.pen.index()].passes;
    let mut extent = Box2::EMPTY;
    let mut xy_mm = Vec::with_capacity(8 * strokes.iter().map(|s| s.len as usize).sum::<usize>());
    let mut scan = 0.0;
    let mut jump = 0.0;
    for stroke in strokes {
        let points = program.points_of(stroke);
        let to_mm = terrace_core::program::stroke_mm(&[beam.at, points[0]]);
        let mark_mm = terrace_core::program::stroke_mm(points);
        (jump, scan) = (jump + to_mm, scan + mark_mm);
        beam.jump_mm += to_mm;
        beam.mark_mm += mark_mm * f64::from(passes);
        beam.at = points[points.len() - 1];
        for &point in points {
            let point = machine.scanner.controller_from_field(point);
            extent.add(point.p2());
            let [x, y] = [point.x, point.y].map(|nm| u64::from(single_mm(i64::from(nm)).to_bits()));
            xy_mm.extend_from_slice(&(x | y << 32).to_le_bytes());
        }
    }
    let points = Some(Points { xy_mm });
    let (line_sequence, hatches, point_sequence) = match first.len {
        1 => (None, None, points),
        2 => (None, points, None),
        _ => (points, None, None),
    };
    let meta_data = VectorBlockMetaData {
        scan_distance_mm: scan,
        jump_distance_mm: jump,
        part_key: PART_KEY,
        bounds: bounds_mm(&extent),
    };
    let block = VectorBlock {
        line_sequence,
        hatches,
        point_sequence,
        marking_params_key: key,
        repeats: u64::from(passes.saturating_sub(1)),
        meta_data: Some(meta_data),
        micro_structuring: Some(Empty {}),
    };
    (block, extent)
}

/// The marking parameters of a pen with a focus shift.
fn marking_params(program: &Program, pen: PenId, shift: Nm, machine: &Machine) -> MarkingParams {
    let pen = &program.pens[pen.index()];
    let delays = &machine.delays;
    MarkingParams {
        laser_power_w: pen.power.as_w(machine.laser.max_power) as f32,
        mark_speed_mm_s: pen.speed.as_mm_s() as f32,
        focus_shift_mm: single_mm(shift.0),
        point_exposure_time_us: pen.dwell.map_or(0.0, |dwell| dwell.as_us() as f32),
        jump_speed_mm_s: machine.scanner.jump_speed.as_mm_s() as f32,
        repetition_rate_hz: (pen.frequency.as_khz() * 1e3).round() as u64,
        jump_delay_us: delays.jump.as_us() as f32,
        laser_off_delay_us: delays.laser_off.as_us() as f32,
        laser_on_delay_us: delays.laser_on.as_us() as f32,
        mark_delay_us: delays.mark.as_us() as f32,
        polygon_delay_us: delays.polygon.as_us() as f32,
        name: pen.name.clone(),
    }
}

/// What each axis moves, and which way, so that a controller for another machine can refuse the file: such as
/// `terrace/xyz-galvo2d/x-part/y-part/z-head-reversed`. Tilt axes are named only where they carry the head.
fn machine_type(machine: &Machine) -> String {
    let scanner = if machine.zoom.is_some() { "galvo3d" } else { "galvo2d" };
    let sense = |is_reversed: bool| if is_reversed { "-reversed" } else { "" };
    let mut text = format!("terrace/xyz-{scanner}");
    for (name, axis) in machine.axes() {
        let carries = match axis.carries {
            Carries::Part => "part",
            Carries::Head => "head",
        };
        text += &format!("/{name}-{carries}{}", sense(axis.reversed));
    }
    for axis in machine.tilt.iter().filter(|_| machine.tilts_head()).flat_map(|tilt| &tilt.axes) {
        let letter = axis.letter.char().to_ascii_lowercase();
        text += &format!("/{letter}-head{}", sense(axis.reversed));
    }
    text
}

/// Nanometres as mm in single precision, as the format has them.
fn single_mm(nm: i64) -> f32 {
    mm_from_nm(nm) as f32
}

/// The file as it grows.
struct File {
    bytes: Vec<u8>,
}

impl File {
    fn end(&self) -> i64 {
        self.bytes.len() as i64
    }
    /// Leaves room for an offset that is known later.
    fn reserve_offset(&mut self) -> usize {
        let place = self.bytes.len();
        self.bytes.extend_from_slice(&[0; 8]);
        place
    }
    fn fill_offset(&mut self, place: usize, offset: i64) {
        self.bytes[place..place + 8].copy_from_slice(&offset.to_le_bytes());
    }
    /// Appends a message after its length.
    fn message(&mut self, message: &impl Message) {
        message.encode_length_delimited(&mut self.bytes).expect("a Vec grows as needed");
    }
}

/// A box as the file has it; None of one that holds nothing.
fn bounds_mm(area: &Box2<Controller>) -> Option<Bounds> {
    let [x_min, y_min, x_max, y_max] = [area.lo.x, area.lo.y, area.hi.x, area.hi.y].map(single_mm);
    (!area.is_empty()).then_some(Bounds { x_min, y_min, x_max, y_max })
}

#[cfg(test)]
mod tests;
