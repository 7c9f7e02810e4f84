//! The grid of a pass: sections in the plane, the lattice of focal planes along z, and where the part lies.
//!
//! Consumes partition, placement and passes of the job, the machine, and the texture's box. [`Layout`] is
//! what follows from these alone; [`PassGrid`] is what heights of the marks complete it to.

use super::nothing;
use crate::partition::Lattice;
use crate::projection::{Footprint, HeightRange, Keep};
use terrace_core::diag::{Diag, Error, memory};
use terrace_core::geom::{Box2, Nm, P2};
use terrace_core::machine::{Machine, Origin};
use terrace_core::program::{PassId, Sections};
use terrace_input::job::{Job, Partition};
use terrace_input::surface::Surface;

/// Sections of a pass and what stops over them admit in the plane.
pub(super) struct Layout {
    pub(super) sections: Sections,
    /// Window of a stop, at least the pitch of the sections.
    pub(super) window: [Nm; 2],
    /// What is to stay whole.
    pub(super) keep: Keep,
    /// Where the part's origin lies along x and y, and its height where that is stated: else the heights of the
    /// marks decide.
    origin: [Nm; 2],
    height: Option<Nm>,
}

/// Where stops may stand.
#[derive(Clone)]
pub(super) struct PassGrid {
    pub(super) sections: Sections,
    /// Window of a stop, at least the pitch of the sections.
    pub(super) window: [Nm; 2],
    /// Heights of focal planes.
    pub(super) lattice: Lattice,
    /// Where the part's origin lies in the table frame; lowered with the surface in later passes.
    pub(super) origin: Origin,
    /// What is to stay whole.
    pub(super) keep: Keep,
}

impl Layout {
    /// The layout of a pass over a texture in `area`; `stated` is the part's origin where the job
    /// states it, or as an earlier pass has laid it.
    ///
    /// # Errors
    /// `section-large`, `section-small`, `zone-large`, `overlap-large`, `sections-many`.
    pub(super) fn new(
        job: &Job,
        machine: &Machine,
        area: Box2,
        pass: PassId,
        stated: Option<Origin>,
    ) -> Result<Self, Error> {
        /// 2000 x 2000 fields: beyond any part, and lists by section take memory whether a section holds marks or not.
        const MAX_SECTIONS: usize = 4_000_000;
        let step = machine.increment_nm();
        let field = machine.usable_field();
        let partition = &job.partition;
        check(job, machine)?;
        let keep = Keep(partition.keep_whole.min(field[0]).min(field[1]));
        let even = |v: Nm| step * 2 * (v / (step * 2));
        // Windows reach over each other by a little more than the overlap, so that rounding takes nothing of it.
        let reach = if partition.overlap > Nm(0) { even(partition.overlap) + step * 2 } else { Nm(0) };
        let mut pitch = field.map(|f| even(partition.section.unwrap_or(f - partition.zone - reach)));
        if pitch.contains(&Nm(0)) {
            return Err(Diag::limit("section-small", "a section is smaller than the stage increment").into());
        }
        // What is to stay whole, or is cut at random, may reach beyond its section as far as the field does.
        let wide = keep.0 > Nm(0) || partition.zone > Nm(0);
        let window = if wide { field.map(even) } else { [0, 1].map(|k| (pitch[k] + reach).min(even(field[k]))) };
        if keep.0 > Nm(0) && partition.section.is_none() {
            pitch = in_step(job, area, pitch, step);
        }
        let origin = stated.map_or_else(|| default_origin(machine, area, pitch), |Origin([x, y, _])| [Nm(x), Nm(y)]);
        let [dx, dy] = job.passes.grid_shift(pass, pitch, job.figure_pitch().unwrap_or(Nm(1)));
        let over = Box2 { lo: P2::new(area.lo.x - dx.0, area.lo.y - dy.0), hi: area.hi };
        let sections = Sections::over(over, pitch, step, origin);
        if sections.count.iter().map(|&c| c as usize).product::<usize>() > MAX_SECTIONS {
            let text = format!("the texture would need {} x {} sections", sections.count[0], sections.count[1]);
            return Err(Diag::limit("sections-many", text).hint("use a larger field or a smaller area").into());
        }
        // A list of heights for every section that holds marks (50 bytes) in a table of 81 bytes an entry, which is half
        // empty after it has grown, is there twice while it grows, and is joined with another one.
        memory::ask("what lies in the sections", 600 * sections.len() as u64)?;
        Ok(Self { sections, window, keep, origin, height: stated.map(|Origin([.., z])| Nm(z)) })
    }

    /// The grid for marks of these heights, and the heights that its levels must hold: widened so that overlaps
    /// lie in two levels, moved so that the levels of later passes lie elsewhere.
    ///
    /// # Errors
    /// `job-empty`, `depth-small`.
    pub(super) fn levels(
        self,
        job: &Job,
        machine: &Machine,
        surface: &Surface,
        footprint: Footprint,
        pass: PassId,
    ) -> Result<(PassGrid, Footprint), Error> {
        let Self { sections, window, keep, origin: [x, y], height } = self;
        let Some(heights) = footprint.range() else { return Err(nothing::marked(job, surface).into()) };
        let height = height.unwrap_or_else(|| match machine.table() {
            Some(table) => on_table(machine, surface, table, heights),
            None => default_height(machine, heights),
        });
        let origin = Origin([x.0, y.0, height.0]);
        let Some(lattice) = Lattice::new(job.focus.depth, machine.increment_nm(), height) else {
            return Err(shallow(job).hint(SHALLOW).into());
        };
        if let Some((kept, section)) = footprint.most_reserve()
            && kept * 2.0 > lattice.depth.f64() - 2.0 * lattice.step.f64()
        {
            return Err(unsure(job, kept, sections.centre(section)).into());
        }
        let Partition { overlap, hysteresis, .. } = job.partition;
        let hysteresis = hysteresis.map_or_else(|| footprint.roughness(), Nm::f64);
        // A stretch as long as the overlap, on the steepest slope that matters, lies in two levels.
        let half_climb = overlap.f64() / 2.0 * footprint.slope();
        let lattice = lattice.with_hysteresis(hysteresis.max(half_climb));
        let footprint =
            if overlap > Nm(0) { footprint.widened(half_climb.min(lattice.depth.f64() / 4.0)) } else { footprint };
        let footprint = footprint.deepened(job.passes.level_shift_nm(pass, lattice.depth));
        Ok((PassGrid { sections, window, lattice, origin, keep }, footprint))
    }
}

impl PassGrid {
    /// Refuses what would need more stops than anyone marks, before they are made.
    ///
    /// # Errors
    /// `stops-many`.
    pub(super) fn most_stops(&self, footprint: &Footprint) -> Result<(), Error> {
        /// At a second a move, twelve days of moves alone.
        const MAX_STOPS: f64 = 1e6;
        let intervals = (0..self.sections.len()).flat_map(|i| footprint.of_section(i));
        let levels: f64 = intervals.map(|range| (range.hi - range.lo) / self.lattice.depth.f64()).sum();
        if levels <= MAX_STOPS {
            // Every method has its own stops, with what is remembered of each while strokes are cut and ordered.
            return Ok(memory::ask("the list of stops", 1000 * levels as u64)?);
        }
        let text = format!("the texture would need more than {:.1} million stops", levels / 1e6);
        Err(Diag::limit("stops-many", text)
            .hint("check focus.pdof and its unit; or mark a smaller or flatter area")
            .into())
    }
}

/// What is said of a part that lies less surely than marks may be out of focus.
fn unsure(job: &Job, kept: f64, section: P2) -> Diag {
    let [x, y] = section.mm();
    let text = format!(
        "the height of the part is not known closely enough: to keep {} of its deviations free takes {:.1} um above and \
         below every focal plane, of a depth range of {:.1} um, in the section around x {:.1}, y {:.1} mm",
        job.placement.measured.as_ref().map_or(0.0, |measured| measured.sigmas),
        kept / 1e3,
        job.focus.depth.f64() / 1e3,
        x,
        y
    );
    let hint = "measure more points, at the rim too, or more closely (`terrace probe` says where), and features where the \
                part is steep, which hold it aside; placement.measured.unsure = \"warn\" marks it as it is";
    Diag::limit("measured-unsure", text).at(job.place_of("placement.measured")).hint(hint)
}

/// What helps where blocks would be too shallow.
const SHALLOW: &str = "enlarge focus.pdof, or state a finer stage.increment";

/// What is said of a depth range that the stage cannot tell from none.
fn shallow(job: &Job) -> Diag {
    Diag::limit("depth-small", format!("a depth range of {} mm is below two stage increments", job.focus.depth.mm()))
}

/// Holds the lengths of `[partition]` to the field, and the depth range to the increment of the stage.
///
/// # Errors
/// `section-large`, `section-small`, `zone-large`, `overlap-large`, `depth-small`.
pub(super) fn check(job: &Job, machine: &Machine) -> Result<(), Error> {
    let field = machine.usable_field();
    let step = machine.increment_nm();
    let Partition { section, zone, overlap, .. } = job.partition;
    let refuse = |fault: Diag, key: &str, hint: &str| Err(fault.at(job.place_of(key)).hint(hint).into());
    if let Some(section) = section
        && field.iter().any(|&f| section > f)
    {
        let text = format!("partition.section {} mm is larger than the usable field", section.mm());
        let fault = Diag::limit("section-large", text);
        return refuse(fault, "partition.section", "leave it out, or make it smaller");
    }
    if section.is_some_and(|section| section < step * 2) {
        let fault = Diag::limit("section-small", "a section is smaller than two stage increments");
        return refuse(fault, "partition.section", "leave it out, or make it larger");
    }
    if job.focus.depth < step * 2 {
        return refuse(shallow(job), "focus", SHALLOW);
    }
    if field.iter().any(|&f| zone >= f / 2) {
        let fault = Diag::limit("zone-large", "partition.zone is half the usable field or more");
        return refuse(fault, "partition.zone", "make it smaller; 0.2 mm is usual");
    }
    if field.iter().any(|&f| overlap >= f / 4) {
        let fault = Diag::limit("overlap-large", "partition.overlap is a quarter of the usable field or more");
        return refuse(fault, "partition.overlap", "make it smaller; 0.05 mm is usual");
    }
    if let Some(section) = section
        && overlap > Nm(0)
        && field.iter().any(|&f| section + overlap > f)
    {
        let text = "partition.section and partition.overlap together are larger than the usable field";
        return refuse(
            Diag::limit("overlap-large", text),
            "partition.overlap",
            "reduce partition.section by the overlap",
        );
    }
    Ok(())
}

/// The centre of the texture at the centre of travel, shifted by less than an increment so that sections that
/// start at the texture's corner have centres where the stage can stand.
pub(super) fn default_origin(machine: &Machine, area: Box2, pitch: [Nm; 2]) -> [Nm; 2] {
    let step = machine.increment_nm();
    let centre = machine.centre_of_travel();
    let along = |axis: usize, lo: i64, hi: i64| {
        let origin = centre[axis] - Nm((lo + hi) / 2);
        origin - (Nm(lo) + pitch[axis] / 2 + origin).rem_euclid(step)
    };
    [along(0, area.lo.x, area.hi.x), along(1, area.lo.y, area.hi.y)]
}

/// The middle of heights, nm, at the centre of travel, the lowest of them where the stage can stand.
pub(super) fn default_height(machine: &Machine, HeightRange { lo, hi }: HeightRange) -> Nm {
    let z = machine.centre_of_travel()[2] - Nm(((lo + hi) / 2.0) as i64);
    z - (Nm::floor(lo) + z).rem_euclid(machine.increment_nm())
}

/// The height at which a part rests on a table, or less than an increment above it, so that the lowest of some heights,
/// nm, lies where the stage can stand.
fn on_table(machine: &Machine, surface: &Surface, table: Nm, HeightRange { lo, .. }: HeightRange) -> Nm {
    let mut lowest = f64::INFINITY;
    surface.each_facet(&mut |corners| lowest = corners.iter().map(|p| p[2]).fold(lowest, f64::min));
    let z = table - Nm::floor(lowest.min(lo));
    z + (-(Nm::floor(lo) + z)).rem_euclid(machine.increment_nm())
}

/// The pitch of sections made a multiple of the pitch of figures that are to stay whole, so that none lies
/// across a border, where that needs no more sections.
fn in_step(job: &Job, area: Box2, pitch: [Nm; 2], step: Nm) -> [Nm; 2] {
    let Some(own) = job.figure_pitch() else { return pitch };
    let size = area.size();
    [0, 1].map(|k| {
        let stepped = own * (pitch[k] / own);
        let count = |pitch: Nm| (size[k] + pitch - Nm(1)) / pitch;
        let is_even = stepped % (step * 2) == Nm(0);
        let needs_no_more = stepped > Nm(0) && is_even && count(stepped) == count(pitch[k]);
        if needs_no_more { stepped } else { pitch[k] }
    })
}
