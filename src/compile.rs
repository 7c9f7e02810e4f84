//! The driver: the one place that knows the order of the passes, and where threads are used.
//!
//! [`plan`] reads the inputs and makes a checked program of them; `crate::folder` writes it. Work is
//! cut into chunks whose number does not depend on the number of threads, and results are joined in
//! the order of the chunks, so threads never change a byte.

mod bound;
mod build;
mod cut;
mod dose;
mod fly;
pub mod orient;
mod passes;
mod setups;
mod tilt;
mod walk;
mod warnings;

use std::path::Path;

pub use fly::{FlyPlan, fly};
pub use passes::Pass;

use build::build;
use cut::{cut, join};
use passes::Place as PassPlace;
use setups::Setups;
use walk::Walk;
use warnings::{not_carried, not_kept, short_overlaps, warn};

use crate::check::{Checked, Limits};
use crate::diag::{Diag, Error, Place, memory};
use crate::fill;
use crate::geom::{Box2, NM_PER_MM, P2, mm_from_nm};
use crate::machine::{FieldShape, Machine};
use crate::order::clearance::Clearance;
use crate::partition::bound::Certificate;
use crate::partition::{self, Fine, Lattice, Stops};
use crate::program::{Block, Pen, Program, Sections};
use crate::record::{Candidate, Slope, Summary, Times};
use crate::spec::{Job, Method, Objective};
use crate::split::Fragments;
use crate::surface::Surface;
use crate::texture::Texture;
use crate::trace::{Footprint, Keep, Samples};
use crate::units::Length;
use crate::{map, motion};

/// Stations of a compilation, in order, for progress displays.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Station {
    /// Reading surface and texture.
    Read,
    /// Where the texture touches the surface.
    Footprint,
    /// Cutting strokes.
    Split,
    /// Ordering strokes and stops.
    Order,
    /// Writing the folder.
    Write,
}

/// Told of every station as it begins.
pub type Progress<'a> = &'a (dyn Fn(Station) + Sync);

/// A job that was planned and checked, not yet written.
#[derive(Debug)]
pub struct Plan {
    /// The job.
    pub job: Job,
    /// Its machine.
    pub machine: Machine,
    /// The program.
    pub checked: Checked,
    /// The grid of sections.
    pub sections: Sections,
    /// Which block owns which place of the part.
    pub map: map::Map,
    /// The figures; its warnings are those of the plan.
    pub summary: Summary,
    /// The box of the texture, turned part frame.
    pub texture: Box2,
    /// The passes after the first, whose sections, map and texture are the ones above.
    pub more: Vec<Pass>,
    /// Direction of what is filled along contours, by section, in hundredths of a degree; empty where
    /// nothing is.
    pub directions: Vec<u16>,
    /// Time of every block: marks, jumps and delays, s.
    pub block_times: Vec<f64>,
    /// Slope under the marks of every block, against the beam.
    pub slopes: Vec<Slope>,
    /// Largest depth range of a block as used, nm.
    pub depth: i64,
    /// Why no partition of the first pass has fewer stops than its lower bound; None where none is known.
    pub bound: Option<Certificate>,
    /// What the user should know.
    pub warnings: Vec<Diag>,
}

/// What all candidates share.
struct Ground<'a> {
    job: &'a Job,
    machine: &'a Machine,
    surface: &'a Surface,
    texture: &'a Texture,
    sections: Sections,
    /// Window of a stop, at least the pitch of the sections, nm.
    window: [i64; 2],
    lattice: Lattice,
    /// Where the part's origin lies, nm; lowered with the surface in later passes.
    origin: [i64; 3],
    place: PassPlace,
    max_slope: f64,
    keep: Keep,
    footprint: Footprint,
    /// Points of marks for the lower bound.
    marks: Option<Samples>,
    clearance: Clearance,
    pens: Vec<Pen>,
}

impl<'a> Ground<'a> {
    fn walk(&self) -> Walk<'a> {
        Walk { surface: self.surface, texture: self.texture, max_slope: self.max_slope }
    }
}

/// What one method gives.
struct Made {
    method: Method,
    program: Program,
    /// Blocks number its cells until `setups::numbered`.
    setups: Setups,
    times: Times,
    block_times: Vec<f64>,
    slopes: Vec<Slope>,
    fragments: usize,
    split: Fragments,
    worst_defocus: i64,
    worst_defocus_mean: i64,
}

/// Reads the inputs of a job, divides, cuts, orders and checks.
///
/// # Errors
/// Faults of the inputs; limits of the machine that the job breaks.
pub fn plan(job: Job, progress: Progress<'_>) -> Result<Plan, Error> {
    let machine = job.machine()?;
    plan_for(job, machine, progress)
}

/// As [`plan`], for another machine than the job names.
///
/// # Errors
/// As [`plan`].
pub fn plan_for(job: Job, machine: Machine, progress: Progress<'_>) -> Result<Plan, Error> {
    let mut warnings = Vec::new();
    // What was warned of before a fault often tells its cause.
    planned(job, machine, progress, &mut warnings).map_err(|e| e.after(warnings))
}

/// Plans a job as if the field held the whole part: one block for all, or one for every band of `depth`. What
/// on-the-fly machines go by: the strokes and their order.
///
/// # Errors
/// As [`plan`].
pub fn plan_whole(job: &Job, machine: &Machine, depth: Option<Length>) -> Result<Plan, Error> {
    // Larger than any part that can be read, and still in range of block coordinates.
    const EVERYTHING: f64 = 2_000.0;
    let mut wide = machine.clone();
    wide.lens.shape = FieldShape::Rectangle;
    wide.lens.margin = Length::mm(0.0);
    wide.lens.field = [Length::mm(EVERYTHING); 2];
    wide.lens.working_distance = Length::mm(10.0 * EVERYTHING);
    wide.controller.max_strokes = 0;
    for axis in [&mut wide.stage.x, &mut wide.stage.y, &mut wide.stage.z] {
        // About the same centre, by which the part is placed.
        let centre = (axis.travel[0].as_mm() + axis.travel[1].as_mm()) / 2.0;
        axis.travel = [-EVERYTHING, EVERYTHING].map(|end| Length::mm(centre + end));
    }
    let depth = depth.unwrap_or(Length::mm(EVERYTHING));
    plan_for(job.plain(Method::ZRange, Some(depth)), wide, &|_| {})
}

fn planned(job: Job, machine: Machine, progress: Progress<'_>, warnings: &mut Vec<Diag>) -> Result<Plan, Error> {
    progress(Station::Read);
    let turn = job.file.placement.turn.as_rad();
    let path = job.resolve(job.file.surface.file.get_ref());
    let weld = job.file.surface.weld.as_mm();
    let surface = Surface::load(&path, &job.surface_options(), weld, turn, warnings)?;
    let mut texture = Texture::load(&job.texture_requests(0), surface.part_box_mm(), turn, warnings)?;

    progress(Station::Footprint);
    let first = PassPlace::first(&machine);
    let mut ground = ground(&job, &machine, &surface, &mut texture, first)?;
    most_stops(&ground)?;
    let methods = match job.file.partition.method {
        Method::Auto => {
            let may_tilt = machine.tilt.is_some() && job.file.setups.is_none();
            let tilt = may_tilt.then_some(Method::Tilt);
            [Method::Contour, Method::ZRange, Method::Window].into_iter().chain(tilt).collect()
        }
        Method::Tilt if machine.tilt.is_none() => {
            let text = "partition.method = \"tilt\" needs a machine with a tilt table";
            let place = Place::file(job.path.display().to_string());
            let hint = "describe the table under [tilt] in the machine file, or use another method";
            return Err(Diag::limit("tilt-missing", text).at(place).hint(hint).into());
        }
        one => vec![one],
    };
    let (mut tried, mut stops) = (Vec::new(), Vec::new());
    for method in methods {
        let hopeless = method == Method::Window && stops.last().is_some_and(|grid| windows_cannot_win(&ground, grid));
        if let Some(found) = (!hopeless).then(|| divide(&ground, method)).flatten() {
            tried.push(method);
            stops.push(found);
        }
    }
    if stops.is_empty() {
        let text = "the texture's box is too wide for this method and this field";
        return Err(Diag::limit("window-wide", text).hint("use partition.method = \"z-range\"").into());
    }
    progress(Station::Split);
    let parts = cut(&ground, &stops)?;
    progress(Station::Order);
    let mut candidates = Vec::new();
    let mut best: Option<Made> = None;
    for ((&method, stops), parts) in tried.iter().zip(&stops).zip(parts) {
        let made = make(&ground, method, stops, parts);
        candidates.push(Candidate {
            method: method.name().into(),
            stops: made.program.blocks.len(),
            fragments: made.fragments,
            time_s: made.times,
        });
        let measure = |m: &Made| match job.file.partition.objective {
            Objective::Time => (m.times.total, 0.0),
            Objective::Stops => (m.program.blocks.len() as f64, m.times.total),
        };
        if best.as_ref().is_none_or(|b| measure(&made) < measure(b)) {
            best = Some(made);
        }
    }
    let Some(made) = best else { return Err(Diag::bug("no-candidate", "no method was tried").into()) };
    if tried.len() == 1 {
        candidates.clear();
    }
    let map =
        map::Map::new(&made.program, &ground.sections, &machine, ground.origin, &surface, ground.texture.bounds());
    let not_kept = not_kept(&ground, made.method, &made.split);
    let (mut made, more) = passes::further(&ground, made)?;
    let origins = setups::numbered(&ground, &mut made);
    let limits = Limits {
        machine: &machine,
        origins: &origins,
        travel_hint: made.setups.hint(&job),
        depth: ground.lattice.depth,
        max_slope: made.split.worst_slope2.sqrt(),
        clearance: &ground.clearance,
    };
    let checked = Checked::new(made.program, &limits)?;
    setups::registered(&job, &machine, &origins)?;
    warn(&job, &made.split, made.worst_defocus, ground.lattice.depth, warnings)?;
    warnings.extend(not_carried(&job, checked.program()));
    warnings.extend(not_kept);
    warnings.extend(short_overlaps(&made.split));
    let marks = ground.marks.take();
    let bound = bound::certificate(&ground, marks, made.method);
    let program = checked.program();
    let split = &made.split;
    let passes = |pick: fn(&Program, &Block) -> f64| program.blocks.iter().map(|b| pick(program, b)).sum::<f64>();
    let summary = Summary {
        stops: program.blocks.len(),
        passes: job.file.passes.count(),
        setups: origins.len(),
        sub_blocks: map.sub_blocks() + more.iter().map(|p| p.map.sub_blocks()).sum::<usize>(),
        method: made.method.name().into(),
        lower_bound_stops: more
            .iter()
            .map(|p| p.bound)
            .fold(bound.as_ref().map(Certificate::stops), |sum, of_pass| Some(sum? + of_pass?)),
        texture_mm: split.texture_mm,
        mark_mm: split.mark_mm,
        overlap_mm: split.overlap_mm,
        skipped_mm: split.skipped.off_part + split.skipped.steep + split.skipped.small,
        skipped_off_part_mm: split.skipped.off_part,
        skipped_hidden_mm: 0.0,
        skipped_steep_mm: split.skipped.steep,
        skipped_small_mm: split.skipped.small,
        fragments: made.fragments,
        strokes_cut: split.strokes_cut,
        figures_whole: split.figures_whole,
        figures_cut: split.figures_cut,
        seam_mm: map.seam_mm() + more.iter().map(|p| p.map.seam_mm()).sum::<f64>(),
        jump_mm: passes(Program::jump_mm),
        worst_defocus_um: made.worst_defocus as f64 / 1000.0,
        worst_defocus_mean_um: made.worst_defocus_mean as f64 / 1000.0,
        worst_incidence_deg: split.worst_slope2.sqrt().atan().to_degrees(),
        time_s: made.times,
        candidates,
        warnings: warnings.iter().map(Diag::to_json).collect(),
    };
    Ok(Plan {
        machine: machine.clone(),
        checked,
        sections: ground.sections,
        map,
        texture: ground.texture.bounds(),
        more,
        directions: ground.texture.directions().map_or_else(Vec::new, |d| d.hundredths.clone()),
        summary,
        block_times: made.block_times,
        slopes: made.slopes,
        depth: ground.lattice.depth,
        bound,
        warnings: std::mem::take(warnings),
        job,
    })
}

/// Sections, lattice and placement, and where the texture touches the part.
fn ground<'a>(
    job: &'a Job,
    machine: &'a Machine,
    surface: &'a Surface,
    texture: &'a mut Texture,
    place: PassPlace,
) -> Result<Ground<'a>, Error> {
    let step = machine.increment_nm();
    let field = machine.usable_field();
    let wanted = job.file.partition.section;
    let section = wanted.map(|l| l.as_nm().unwrap_or(i64::MAX));
    if let (Some(wanted), Some(s)) = (wanted, section)
        && field.iter().any(|&f| s > f)
    {
        let text = format!("partition.section {wanted} is larger than the usable field");
        let place = Place::file(job.path.display().to_string());
        return Err(Diag::limit("section-large", text).at(place).hint("leave it out, or make it smaller").into());
    }
    let area = texture.bounds();
    let keep = Keep(job.file.partition.keep_whole.as_nm().unwrap_or(i64::MAX).min(field[0]).min(field[1]));
    let even = |v: i64| v / (2 * step) * (2 * step);
    let zone = job.file.partition.zone.as_nm().unwrap_or(i64::MAX);
    if field.iter().any(|&f| zone >= f / 2) {
        let text = "partition.zone is half the usable field or more";
        let place = Place::file(job.path.display().to_string());
        return Err(Diag::limit("zone-large", text).at(place).hint("make it smaller; 0.2 mm is usual").into());
    }
    let overlap = overlap(job, field, section)?;
    // Windows reach over each other by a little more than the overlap, so that rounding takes nothing of it.
    let reach = if overlap > 0 { even(overlap) + 2 * step } else { 0 };
    let mut pitch = field.map(|f| even(section.unwrap_or(f - zone - reach)));
    if pitch.contains(&0) {
        return Err(Diag::limit("section-small", "a section is smaller than the stage increment").into());
    }
    // What is to stay whole, or is cut at random, may reach beyond its section as far as the field does.
    let wide = keep.0 > 0 || zone > 0;
    let window = if wide { field.map(even) } else { [0, 1].map(|k| (pitch[k] + reach).min(even(field[k]))) };
    if keep.0 > 0 && section.is_none() {
        pitch = in_step(job, area, pitch, step);
    }
    let placed = place.origin.or(job.file.placement.origin.map(|o| o.map(|l| l.as_nm().unwrap_or(0))));
    let centre_of_travel = machine.axes().map(|(_, a)| {
        let [lo, hi] = a.travel.map(|t| t.as_nm().unwrap_or(0));
        a.sign() * ((lo + hi) / 2)
    });
    // Default: the centre of the texture at the centre of travel, shifted by less than an increment
    // so that sections that start at the texture's corner have centres where the stage can stand.
    let default_xy = |axis: usize, lo: i64, hi: i64| {
        let origin = centre_of_travel[axis] - (lo + hi) / 2;
        origin - (lo + pitch[axis] / 2 + origin).rem_euclid(step)
    };
    let mut origin = placed.unwrap_or([default_xy(0, area.lo.x, area.hi.x), default_xy(1, area.lo.y, area.hi.y), 0]);
    let [dx, dy] = job.file.passes.shift_nm(place.number, pitch, job.figure_pitch_nm().unwrap_or(1));
    let over = Box2 { lo: P2::new(area.lo.x - dx, area.lo.y - dy), hi: area.hi };
    let sections = Sections::over(over, pitch, step, [origin[0], origin[1]]);
    const MAX_SECTIONS: usize = 4_000_000;
    if sections.count.iter().map(|&c| c as usize).product::<usize>() > MAX_SECTIONS {
        let text = format!("the texture would need {} x {} sections", sections.count[0], sections.count[1]);
        return Err(Diag::limit("sections-many", text).hint("use a larger field or a smaller area").into());
    }
    // A list of heights for every section that holds marks.
    memory::ask("what lies in the sections", 200 * sections.len() as u64)?;
    let max_slope = job.file.limits.max_incidence.as_rad().tan();
    fill::along_contours(texture, surface, &sections, max_slope, job.depth_range())?;
    let texture = &*texture;
    let walk = Walk { surface, texture, max_slope };
    let sampling = bound::sampling(job, machine, texture);
    let (footprint, marks) = walk.footprint(&sections, keep, window.map(|w| w / 2), sampling);
    let Some((lo, hi)) = footprint.range() else {
        let place = Place::file(job.path.display().to_string());
        return Err(Diag::limit(
            "job-empty",
            "nothing would be marked: no texture lies on the part where it may be marked",
        )
        .at(place)
        .hint("compare the texture's area and origin with the part's box (`terrace inspect`)")
        .into());
    };
    if placed.is_none() {
        let z0 = lo.floor() as i64;
        origin[2] = centre_of_travel[2] - ((lo + hi) / 2.0) as i64;
        origin[2] -= (z0 + origin[2]).rem_euclid(step);
    }
    let depth = job.depth_range().as_nm().unwrap_or(0);
    let Some(lattice) = Lattice::new(depth, step, origin[2]) else {
        let text = format!("a depth range of {} mm is below two stage increments", mm_from_nm(depth));
        return Err(Diag::limit("depth-small", text)
            .hint("enlarge focus.pdof, or state a finer stage.increment")
            .into());
    };
    let hysteresis = job.file.partition.hysteresis.map_or_else(|| footprint.roughness(), |h| h.as_mm() * NM_PER_MM);
    // A stretch as long as the overlap, on the steepest slope that matters, lies in two levels.
    let half_climb = overlap as f64 / 2.0 * footprint.slope();
    let lattice = lattice.with_hysteresis(hysteresis.max(half_climb));
    let footprint = if overlap > 0 { footprint.widened(half_climb.min(lattice.depth as f64 / 4.0)) } else { footprint };
    let footprint = footprint.deepened(job.file.passes.level_shift_nm(place.number, lattice.depth));
    let pens = job.file.pen.iter().map(|p| Pen {
        name: p.name.clone(),
        speed: p.speed,
        power: p.power,
        frequency: p.frequency,
        passes: p.passes,
    });
    Ok(Ground {
        job,
        machine,
        surface,
        texture,
        sections,
        window,
        lattice,
        origin,
        place,
        max_slope,
        keep,
        footprint,
        marks,
        clearance: Clearance::new(&surface.tiles(), machine),
        pens: pens.collect(),
    })
}

/// By how much strokes are marked twice at seams, nm. `field` and `section` are the sizes of those.
fn overlap(job: &Job, field: [i64; 2], section: Option<i64>) -> Result<i64, Error> {
    let partition = &job.file.partition;
    let overlap = partition.overlap.as_nm().unwrap_or(i64::MAX);
    let place = || Place::file(job.path.display().to_string());
    if field.iter().any(|&f| overlap >= f / 4) {
        let text = "partition.overlap is a quarter of the usable field or more";
        return Err(Diag::limit("overlap-large", text).at(place()).hint("make it smaller; 0.05 mm is usual").into());
    }
    if let Some(s) = section
        && overlap > 0
        && field.iter().any(|&f| s + overlap > f)
    {
        let text = "partition.section and partition.overlap together are larger than the usable field";
        return Err(Diag::limit("overlap-large", text).at(place()).hint("make the sections smaller by it").into());
    }
    Ok(overlap)
}

/// The pitch of sections made a multiple of the pitch of figures that are to stay whole, so that none lies
/// across a border, where that needs no more sections.
fn in_step(job: &Job, area: Box2, pitch: [i64; 2], step: i64) -> [i64; 2] {
    let Some(own) = job.figure_pitch_nm() else { return pitch };
    let size = area.size();
    [0, 1].map(|k| {
        let stepped = pitch[k] / own * own;
        let count = |pitch: i64| (size[k] + pitch - 1) / pitch;
        let fits = stepped > 0 && stepped % (2 * step) == 0 && count(stepped) == count(pitch[k]);
        if fits { stepped } else { pitch[k] }
    })
}

/// Refuses what would need more stops than anyone marks, before they are made.
fn most_stops(ground: &Ground<'_>) -> Result<(), Error> {
    const MAX_STOPS: f64 = 1e6;
    let intervals = (0..ground.sections.len()).flat_map(|i| ground.footprint.of_section(i));
    let levels: f64 = intervals.map(|(lo, hi)| (hi - lo) / ground.lattice.depth as f64).sum();
    if levels <= MAX_STOPS {
        return Ok(());
    }
    let text = format!("the texture would need more than {:.1} million stops", levels / 1e6);
    Err(Diag::limit("stops-many", text).hint("check focus.pdof and its unit; or mark a smaller or flatter area").into())
}

/// The stops of a method; None where it cannot be used on this job.
fn divide(ground: &Ground<'_>, method: Method) -> Option<Stops> {
    let Ground { footprint, sections, window, lattice, .. } = ground;
    Some(match method {
        Method::Contour => partition::divide(partition::Method::Contour, footprint, sections, *window, lattice),
        Method::ZRange | Method::Auto => {
            partition::divide(partition::Method::ZRange, footprint, sections, *window, lattice)
        }
        Method::Tilt => tilt::divide(ground)?,
        Method::Window => {
            let (lowest, _) = footprint.range()?;
            let fine = Fine::over(sections, *window, lattice, lowest)?;
            let overlap = ground.job.file.partition.overlap.as_nm().unwrap_or(0);
            // Other passes begin in other corners.
            let flips = [1, 2, 1].map(|bit| ground.place.number & bit != 0);
            let free = partition::free(
                ground.walk().cells(&fine, ground.keep),
                &fine,
                sections,
                *window,
                lattice,
                overlap,
                flips,
            );
            // Where fields fit the texture exactly, their grid can be the better choice of windows.
            let grid = partition::divide(partition::Method::ZRange, footprint, sections, *window, lattice);
            if ground.keep.0 == 0 && grid.stops.len() < free.stops.len() { grid } else { free }
        }
    })
}

/// Whether `auto` may leave free windows out, whose search takes seconds: even with six tenths of the stops
/// of the grid, fewer than they need on any surface with a dense texture, they would lose, because nearly
/// all moves of a grid are moves of z alone.
fn windows_cannot_win(ground: &Ground<'_>, grid: &Stops) -> bool {
    if ground.job.file.partition.objective == Objective::Stops {
        return false;
    }
    let [w, h] = ground.window;
    let time = |to: [i64; 3]| {
        let moved = motion::stage_move(ground.machine, [0; 3], to, None);
        moved.travel_s + moved.settle_s
    };
    let (xy, z) = (time([w, h, 0]), time([0, 0, ground.lattice.depth]));
    let sections = (0..ground.sections.len()).filter(|&i| ground.footprint.is_used(i)).count() as f64;
    let stops = grid.stops.len() as f64;
    0.6 * stops * time([w / 2, h / 2, 0]) > sections * xy + (stops - sections) * z
}

/// One candidate, ordered and timed.
fn make(ground: &Ground<'_>, method: Method, stops: &Stops, parts: Vec<Fragments>) -> Made {
    let built = build(ground, stops, &parts);
    let fragments = parts.iter().map(|p| p.list.len()).sum();
    let split = parts.into_iter().fold(Fragments::default(), join);
    let (times, block_times) = times(ground, &built.program);
    Made {
        method,
        times,
        block_times,
        slopes: built.slopes,
        fragments,
        split,
        worst_defocus: built.worst_defocus,
        worst_defocus_mean: built.worst_defocus_mean,
        program: built.program,
        setups: built.setups,
    }
}

/// Where the stage comes from: the centre of its travel, lifted.
fn start(machine: &Machine) -> [i64; 3] {
    let centre = |axis: &crate::machine::Axis| axis.travel.iter().map(|t| t.as_nm().unwrap_or(0)).sum::<i64>() / 2;
    [centre(&machine.stage.x), centre(&machine.stage.y), machine.retract_z()]
}

/// The job's time, and that of every block.
fn times(ground: &Ground<'_>, program: &Program) -> (Times, Vec<f64>) {
    let machine = ground.machine;
    let mut t = Times::default();
    let (mut at, mut tilt) = (ground.place.from, ground.place.before.as_ref().map_or([0; 2], |(stop, _)| stop.tilt));
    let mut blocks = Vec::with_capacity(program.blocks.len());
    for block in &program.blocks {
        let retract = block.retract.then(|| machine.retract_z());
        let turning = machine.tilt_time_s(tilt, block.stop.tilt);
        let moved = motion::tilting_move(machine, at, block.stage, retract, turning);
        tilt = block.stop.tilt;
        t.stage += moved.travel_s;
        t.settle += moved.settle_s;
        at = block.stage;
        let marks = program.strokes_of(block).iter().map(|s| {
            let pen = &program.pens[usize::from(s.pen)];
            motion::Mark { points: program.points_of(s), speed: pen.speed, passes: pen.passes }
        });
        let m = motion::marking(machine, marks);
        t.mark += m.mark_s;
        t.jump += m.jump_s;
        t.delay += m.delay_s;
        blocks.push(m.total_s());
    }
    t.total = t.stage + t.settle + t.mark + t.jump + t.delay;
    (t, blocks)
}

/// Folder of a job file's outputs: `hood.toml` makes `hood.job` beside it.
pub fn default_output(job: &Path) -> std::path::PathBuf {
    job.with_extension("job")
}
