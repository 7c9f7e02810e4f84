//! From the file as written to a job that cannot be wrong: every fault is found here, without opening any
//! other file.

use std::collections::BTreeSet;
use std::path::Path;
use std::sync::Arc;

use super::faults::Faults;
use super::file::{
    FocusKeys, HeightmapKeys, JobFile, Level, LimitsKeys, MachineKeys, MarkPower, Mode, NonManifold, Parts, PassesKeys,
    PenKeys, PlacementKeys, SetupsKeys, StopOrder, SurfaceKeys,
};
use super::fixtures;
use super::marked;
use super::partition::{self, Method};
use super::passes::Passes;
use super::resolved::{
    Attitude, Focus, Job, Limits, MachineInput, MeasuredInput, Order, Overrides, Placement, Setups, SurfaceInput,
};
use super::texture::Texture;
use super::texture::keys::TextureKeys;
use super::unused;
use crate::surface;
use terrace_core::diag::{Diag, Error};
use terrace_core::format::{Format, names};
use terrace_core::geom::{MAX_NM, Nm, P2};
use terrace_core::machine::Origin;
use terrace_core::program::{Pen, PenId};
use terrace_core::units::{Length, Time};

/// Most pens of a job: no controller holds more, and marks count them in 16 bits.
const MAX_PENS: usize = 1000;

/// Most passes of a job.
const MAX_PASSES: u32 = 100;

/// Most columns and most rows of set-ups.
pub const MAX_SETUPS: u32 = 100;

/// The formats of a job that names none.
const fn default_formats(mode: Mode) -> &'static [Format] {
    match mode {
        Mode::Stepped => &Format::OF_STEPPED,
        Mode::OnTheFly => &Format::OF_ON_THE_FLY,
    }
}

/// Whether a format can hold jobs of this mode.
fn holds(format: Format, mode: Mode) -> bool {
    match mode {
        Mode::Stepped => format.is_stepped(),
        Mode::OnTheFly => format.is_on_the_fly(),
    }
}

/// Resolves a job file; `texture_faults` are those of the keys of its textures.
///
/// # Errors
/// Every fault of the file, each with its place, in the order of the file's sections.
pub(super) fn resolve(
    path: &Path,
    source: Arc<str>,
    file: &JobFile,
    overrides: &Overrides,
    texture_faults: Vec<Diag>,
) -> Result<Job, Error> {
    let mut faults = Faults::new(path, &source);
    faults.list = texture_faults;
    let f = &mut faults;
    let mode = overrides.mode.unwrap_or(file.mode);
    let mut surface = surface_input(&file.surface, f);
    let origin = file.placement.origin.map(|o| Origin(o.map(|length| f.nm("placement.origin", length).0)));
    let focus = focus(&file.focus, f);
    check_stated_errors(file, f);
    // Only CAD files are tessellated, to a chord tolerance that follows from PDOF.
    let is_cad = surface::is_cad(&surface.file);
    surface.options.tessellation = is_cad.then(|| surface::Tessellation::of_pdof(focus.pdof.mm()));
    let pens = pens(&file.pen, f);
    if file.texture.is_empty() {
        f.push("texture", Diag::input("texture-none", "the job has no [[texture]]"));
    }
    let folder = path.parent().unwrap_or(Path::new(""));
    let laid = laid(&file.placement, f);
    let pose = laid.and_then(|laid| laid.pose());
    surface.options.pose = pose;
    let textures = file.texture.iter().enumerate();
    let textures =
        textures.map(|(i, keys)| Texture { i, keys, folder, pens: &pens, pdof: focus.pdof, pose }.resolve(f)).collect();
    let mut partition = partition::resolve(&file.partition, f);
    if let Some(objective) = overrides.objective {
        partition.objective = objective;
    }
    let machine = machine(&file.machine, f);
    let limits = limits(&file.limits, f);
    let passes = passes(&file.passes, focus.depth, f);
    let setups = file.setups.as_ref().map(|setups| set_ups(setups, file, f));
    let marked = marked::resolve(&file.marked, file.passes.count, f);
    let beside = fixtures::Beside {
        has_setups: file.setups.is_some(),
        is_placed: file.placement.origin.is_some() || file.placement.measured.is_some(),
    };
    let fixtures = fixtures::resolve(&file.fixture, beside, f);
    dose(file, f);
    measured(file, f);
    let formats = formats(file, mode, f);
    let frames = frames(file, f);
    match mode {
        Mode::OnTheFly => on_the_fly(file, f),
        Mode::Stepped => stepped(file, f),
    }
    unused::warn(file, mode, f);
    let Faults { list, warnings, .. } = faults;
    // A job without a machine has a fault already.
    let (Some(machine), true) = (machine, list.is_empty()) else { return Err(Error::many(list)) };
    Ok(Job {
        path: path.to_owned(),
        seed: overrides.seed,
        mode,
        mode_of_file: file.mode,
        surface,
        placement: Placement {
            origin,
            laid,
            turn: file.placement.turn,
            residual: [file.placement.residual, file.placement.residual_z],
            measured: file.placement.measured.as_ref().map(|keys| MeasuredInput {
                file: keys.file.clone(),
                sigmas: keys.sigmas,
                warp: keys.warp,
                unsure: keys.unsure,
            }),
        },
        fixtures,
        marked,
        textures,
        drawings: file.texture.iter().flat_map(TextureKeys::files).collect(),
        focus,
        partition,
        order: Order { stops: file.order.stops, strokes: file.order.strokes },
        passes,
        setups,
        limits,
        dose: file.dose,
        machine,
        pens,
        skywriting: file.pen.iter().map(|pen| pen.skywriting).collect(),
        formats,
        names_formats: file.emit.formats.is_some(),
        frames,
        power_by_speed: file.emit.power == MarkPower::Speed && mode == Mode::OnTheFly,
        warnings,
        source,
    })
}

/// The surface file, and how it is to be read.
fn surface_input(keys: &SurfaceKeys, f: &mut Faults<'_>) -> SurfaceInput {
    check_surface_keys(keys, f);
    SurfaceInput {
        file: keys.file.clone(),
        options: surface::Options {
            unit_mm: keys.unit.map(|u| u.in_mm()),
            datum: keys.datum,
            scale: keys.scale,
            heightmap: keys.heightmap.as_ref().map(heightmap_scale),
            max_edge_mm: keys.max_edge.map(Length::as_mm),
            tessellation: None,
            pose: None,
        },
        weld: f.nm("surface.weld", keys.weld),
        non_manifold: match keys.non_manifold {
            NonManifold::Refuse => surface::NonManifold::Refuse,
            NonManifold::Topmost => surface::NonManifold::Topmost,
        },
        tessellation: keys.tessellation,
    }
}

/// The scale of a height map.
fn heightmap_scale(keys: &HeightmapKeys) -> surface::Scale {
    surface::Scale {
        pixel_mm: keys.pixel.as_mm(),
        z_mm: keys.z.map(Length::as_mm),
        values: keys.values,
        nodata: keys.nodata,
        origin_mm: keys.origin.map(Length::as_mm),
    }
}

/// Keys of the surface that do not go with its file, or have no possible value.
fn check_surface_keys(keys: &SurfaceKeys, f: &mut Faults<'_>) {
    if keys.unit.is_some() && surface::is_cad(&keys.file) {
        let fault =
            Diag::input("surface-unit-stated", "surface.unit is stated, but STEP and IGES files state their own unit");
        f.push(
            "surface.unit",
            fault.hint("leave out surface.unit; correct the unit in the CAD program if it is wrong"),
        );
    }
    if keys.tessellation.is_some() && surface::is_cad(&keys.file) {
        let fault = Diag::input(
            "surface-tessellation",
            "surface.tessellation is stated, but the chord tolerance of STEP and IGES files follows from focus.pdof",
        );
        f.push("surface.tessellation", fault.hint("leave out surface.tessellation"));
    }
    if keys.scale.is_some_and(|scale| !(scale > 0.0 && scale.is_finite())) {
        let fault = Diag::input("surface-datum", "surface.scale must be above zero");
        f.push("surface.scale", fault.hint("a map at 1 : 25000 has scale = 4e-5"));
    }
    if keys.datum.is_some_and(|datum| datum.iter().any(|v| !v.is_finite())) {
        let fault = Diag::input("surface-datum", "surface.datum is not finite");
        f.push("surface.datum", fault.hint("give the place of the part's origin in the numbers of the file"));
    }
}

/// How the part is laid, if the file says so.
fn laid(keys: &PlacementKeys, f: &mut Faults<'_>) -> Option<Attitude> {
    let ways = [
        ("rotate", keys.rotate.map(Attitude::Rotated)),
        ("up", keys.up.map(Attitude::Up)),
        ("level", keys.level.map(Attitude::Level)),
    ];
    let mut stated = ways.into_iter().filter_map(|(key, way)| Some((key, way?)));
    let (key, way) = stated.next()?;
    if let Some((other, _)) = stated.next() {
        let fault = Diag::input("placement-laid", format!("placement has both {key} and {other}"));
        f.push(&format!("placement.{other}"), fault.hint("keep the one that says how the part is laid"));
    }
    let is_finite = match way {
        Attitude::Rotated(_) => true,
        Attitude::Up(direction) => direction.iter().all(|v| v.is_finite()),
        Attitude::Level(points) => points.iter().flatten().all(|v| v.is_finite()),
    };
    if !is_finite || way.pose().is_none() {
        let (text, hint) = match way {
            Attitude::Level(_) => {
                ("the points of placement.level lie on one line", "give three points that span a plane")
            }
            _ => ("placement.up has no direction", "give x, y and z of the direction that is to look at the lens"),
        };
        f.push(&format!("placement.{key}"), Diag::input("placement-laid", text).hint(hint));
    }
    Some(way)
}

/// Errors that the file states for the budget: as far as those of a machine go.
fn check_stated_errors(file: &JobFile, f: &mut Faults<'_>) {
    let stated = [
        ("surface.tessellation", file.surface.tessellation),
        ("placement.residual", file.placement.residual),
        ("placement.residual_z", file.placement.residual_z),
    ];
    for (key, error) in stated {
        if let Some(error) = error.filter(|error| error.as_mm() > 10.0) {
            let text = format!("{key} is {error}, more than 10 mm");
            f.push(
                key,
                Diag::input("error-range", text).hint("state how far the part may be off, or leave the key out"),
            );
        }
    }
}

/// The PDOF that the file states, as such or as a factor of DOF, and the key that it comes from; where the file states
/// none, one to check the other keys with.
fn stated_pdof(keys: &FocusKeys, f: &mut Faults<'_>) -> (&'static str, Length) {
    match (keys.pdof, keys.dof) {
        (Some(pdof), dof) => {
            if dof.is_some() {
                let fault = Diag::input("focus-both", "focus has both pdof and dof");
                f.push("focus.dof", fault.hint("keep one of them"));
            }
            ("focus.pdof", pdof)
        }
        (None, Some(dof)) => ("focus.dof", Length::mm(dof.as_mm() * keys.factor.unwrap_or(1.0))),
        (None, None) => {
            f.push(
                "focus",
                Diag::input("focus-missing", "focus has neither pdof nor dof")
                    .hint("add pdof = \"0.07 mm\", measured on your process; it is never derived from the optics"),
            );
            // As deep as a job may be, so that no other key is at fault against a depth that nobody has stated.
            ("focus", Length::mm(*DEPTHS_MM.end()))
        }
    }
}

/// Depth of focus, reserve and focal planes.
fn focus(keys: &FocusKeys, f: &mut Faults<'_>) -> Focus {
    let (key, pdof) = stated_pdof(keys, f);
    let mut is_sound = true;
    if keys.factor.is_some_and(|factor| !factor.is_finite() || factor <= 0.0) {
        f.push("focus.factor", Diag::input("focus-factor", "focus.factor must be above zero"));
        is_sound = false;
    } else if !DEPTHS_MM.contains(&pdof.as_mm()) {
        f.push(
            key,
            Diag::input("focus-range", format!("the depth of focus comes to {pdof}"))
                .hint("it must lie between 0.1 um and 1000 mm"),
        );
        is_sound = false;
    }
    factor_warnings(keys, f);
    // A PDOF beyond all lengths has a fault already; such a reserve gets one below.
    let pdof = pdof.as_nm().unwrap_or(MAX_NM);
    let reserve = keys.reserve.as_nm().unwrap_or(MAX_NM);
    // A depth that is at fault itself says nothing of the reserve.
    if is_sound && reserve >= pdof {
        let text = format!("focus.reserve {} leaves nothing of the PDOF of {} mm", keys.reserve, pdof.mm());
        let hint = "the reserve is what errors may use up of PDOF: make it smaller, or make the errors smaller";
        f.push("focus.reserve", Diag::input("focus-reserve", text).hint(hint));
    }
    Focus { pdof, reserve, depth: keys.rule.range(pdof - reserve), rule: keys.rule, level: keys.level, is_kept: false }
}

/// Depths of focus that a job may have, mm: from the tenth of a micrometre to a metre, as the hint says.
const DEPTHS_MM: std::ops::RangeInclusive<f64> = 1e-4..=1000.0;

/// Range of `focus.factor` in Cao and Zhu (2013), step 1: PDOF = 0.8 to 1.2 DOF.
const FACTORS: std::ops::RangeInclusive<f64> = 0.8..=1.2;

/// A factor that has no effect, or is not one that the article knows.
fn factor_warnings(keys: &FocusKeys, f: &mut Faults<'_>) {
    let Some(factor) = keys.factor.filter(|factor| factor.is_finite() && *factor > 0.0) else { return };
    if keys.pdof.is_some() {
        let d =
            Diag::warning("key-unused", "focus.factor has no effect beside focus.pdof, which is the depth of focus");
        f.warn("focus.factor", d.hint("leave it out, or give focus.dof instead of focus.pdof"));
    } else if keys.dof.is_some() && !FACTORS.contains(&factor) {
        let text = format!(
            "focus.factor {factor} is not between 0.8 and 1.2, the PDOF that Cao and Zhu give as a share of DOF"
        );
        let hint = "state what was measured as focus.pdof";
        f.warn("focus.factor", Diag::warning("focus-factor", text).hint(hint));
    }
}

/// The pens.
fn pens(keys: &[PenKeys], f: &mut Faults<'_>) -> Vec<Pen> {
    if keys.is_empty() {
        f.push("pen", Diag::input("pen-none", "the job has no [[pen]]"));
    }
    if keys.len() > MAX_PENS {
        let text = format!("the job has {} pens, more than {MAX_PENS}", keys.len());
        f.push("pen", Diag::input("pen-many", text));
    }
    // Each name is compared with all before it: of too many pens the rest is not looked at.
    for (i, pen) in keys.iter().take(MAX_PENS).enumerate() {
        check_pen_name(i, keys, f);
        if !(1..=1000).contains(&pen.passes) {
            let text = format!("pen {:?} has {} passes", pen.name, pen.passes);
            f.push(&format!("pen.{i}.passes"), Diag::input("pen-passes", text).hint("1 to 1000 are possible"));
        }
    }
    for (i, pen) in keys.iter().enumerate() {
        check_dwell(i, pen, f);
    }
    keys.iter().map(pen).collect()
}

/// One pen; dots that are stated in pulses take as long as these.
fn pen(keys: &PenKeys) -> Pen {
    Pen {
        name: keys.name.clone(),
        speed: keys.speed,
        power: keys.power,
        frequency: keys.frequency,
        passes: keys.passes,
        dwell: keys.dwell.or(keys.pulses.map(|n| Time::s(f64::from(n) / (keys.frequency.as_khz() * 1e3)))),
    }
}

/// What is wrong with the name of pen `i`.
fn check_pen_name(i: usize, pens: &[PenKeys], f: &mut Faults<'_>) {
    let name = &pens[i].name;
    let key = format!("pen.{i}.name");
    if pens[..i].iter().any(|other| other.name == *name) {
        f.push(&key, Diag::input("pen-twice", format!("two pens are named {name:?}")));
    }
    if name.starts_with('-') {
        let text = format!("pen name {name:?} begins with -, which spreadsheets take for a formula");
        f.push(&key, Diag::input("pen-name", text).hint("begin it with a letter or a digit"));
    }
    if !name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_' || c == '-') || name.is_empty() {
        let text = format!("pen name {name:?} holds something other than letters, digits, - and _");
        f.push(&key, Diag::input("pen-name", text));
    }
}

/// Longest dwell of a dot, s: a metre of dots would take days.
const LONGEST_DWELL: f64 = 10.0;

/// What is wrong with how long a pen marks a dot.
fn check_dwell(i: usize, pen: &PenKeys, f: &mut Faults<'_>) {
    if pen.dwell.is_some() && pen.pulses.is_some() {
        let text = format!("pen {:?} has both dwell and pulses", pen.name);
        f.push(&format!("pen.{i}.pulses"), Diag::input("pen-dwell", text).hint("keep one of them"));
    }
    let s = pen.pulses.map(|n| f64::from(n) / (pen.frequency.as_khz() * 1e3)).or(pen.dwell.map(Time::as_s));
    if s.is_some_and(|s| !(1e-9..=LONGEST_DWELL).contains(&s)) {
        let key = if pen.dwell.is_some() { "dwell" } else { "pulses" };
        let text = format!("a dot of pen {:?} takes {} s", pen.name, s.unwrap_or_default());
        let fault = Diag::input("pen-dwell", text).hint(format!("1 ns to {LONGEST_DWELL} s are possible"));
        f.push(&format!("pen.{i}.{key}"), fault);
    }
}

/// Where the machine is described.
fn machine(keys: &MachineKeys, f: &mut Faults<'_>) -> Option<MachineInput> {
    match (&keys.profile, &keys.file) {
        (Some(_), Some(_)) => {
            let fault = Diag::input("machine-both", "machine has both profile and file");
            f.push("machine.profile", fault.hint("keep one"));
            None
        }
        (None, None) => {
            f.push(
                "machine",
                Diag::input("machine-missing", "machine has neither profile nor file")
                    .hint("add profile = \"xyz-galvo-40\"; `terrace machines` lists them"),
            );
            None
        }
        (Some(profile), None) => Some(MachineInput::Profile(profile.clone())),
        (None, Some(file)) => Some(MachineInput::File(file.clone())),
    }
}

/// What is skipped, and what causes a warning.
fn limits(keys: &LimitsKeys, f: &mut Faults<'_>) -> Limits {
    let max_deg = keys.max_incidence.as_deg();
    if !(0.0..90.0).contains(&max_deg) {
        let text = format!("limits.max_incidence is {max_deg} deg: it must be at least 0 and below 90 deg");
        f.push("limits.max_incidence", Diag::input("limits-incidence", text));
    }
    if !(0.0..=100.0).contains(&keys.max_off_part.as_percent()) {
        let text = "limits.max_off_part is not between 0 % and 100 %";
        f.push("limits.max_off_part", Diag::input("limits-share", text));
    }
    Limits {
        warn_incidence: keys.warn_incidence,
        max_incidence: keys.max_incidence,
        steep: keys.steep,
        max_off_part: keys.max_off_part,
        implausible: keys.implausible,
    }
}

/// The passes; `depth` is the depth range of a block.
fn passes(keys: &PassesKeys, depth: Nm, f: &mut Faults<'_>) -> Passes {
    if !(1..=MAX_PASSES).contains(&keys.count) {
        f.push(
            "passes.count",
            Diag::input("passes-count", format!("the job has {} passes", keys.count))
                .hint(format!("1 to {MAX_PASSES} are possible; pen.passes repeats strokes within a block")),
        );
    }
    let lower = f.nm("passes.lower", keys.lower);
    // A depth that is at fault itself says nothing of this one.
    if lower > depth && depth > Nm(0) {
        let text = format!("passes.lower {} is more than the depth range {} mm", keys.lower, depth.mm());
        f.push(
            "passes.lower",
            Diag::input("passes-lower", text).hint("it is what one pass removes, such as \"8 um\"; check its unit"),
        );
    }
    Passes { count: keys.count, rotate: keys.rotate, lower, shift: f.nm_option("passes.shift", keys.shift) }
}

/// The points of `setups.registration`, nm.
fn registration(keys: &SetupsKeys, f: &mut Faults<'_>) -> Vec<P2> {
    // Lengths that are too far have a fault already and all become 0: points of these may be the same by that alone.
    let is_far = keys.registration.iter().flatten().any(|length| length.as_nm().is_none());
    let points: Vec<P2> = keys
        .registration
        .iter()
        .map(|point| point.map(|length| f.nm("setups.registration", length).0))
        .map(|[x, y]| P2::new(x, y))
        .collect();
    let fault = if points.len() < 2 {
        Some("setups.registration has fewer than two points")
    } else if !is_far && points.iter().collect::<BTreeSet<_>>().len() < points.len() {
        Some("two points of setups.registration are the same")
    } else {
        None
    };
    if let Some(text) = fault {
        let hint = "name tooling holes or corners, x and y in the part's own frame; every set-up must reach two";
        f.push("setups.registration", Diag::input("setups-registration", text).hint(hint));
    }
    points
}

/// The set-ups.
fn set_ups(keys: &SetupsKeys, file: &JobFile, f: &mut Faults<'_>) -> Setups {
    let count = [("columns", keys.columns), ("rows", keys.rows)].map(|(name, parts)| match parts {
        Parts::Named(_) => None,
        Parts::Number(n) => {
            if !(1..=MAX_SETUPS).contains(&n) {
                let text = format!("setups.{name} is not between 1 and {MAX_SETUPS}");
                let fault = Diag::input("setups-count", text).hint("\"auto\" takes the fewest");
                f.push(&format!("setups.{name}"), fault);
            }
            Some(n)
        }
    });
    let registration = registration(keys, f);
    if file.placement.origin.is_some() {
        f.push(
            "placement.origin",
            Diag::input("setups-origin", "the job has both setups and placement.origin")
                .hint("leave the origin out: each set-up has its own, in the run sheet"),
        );
    }
    if file.partition.method == Method::Tilt {
        f.push(
            "partition.method",
            Diag::input("setups-tilt", "a job with [setups] cannot tilt the part")
                .hint("use another partition.method, or leave [setups] out"),
        );
    }
    Setups { count, registration }
}

/// What does not go with a part that was measured.
fn measured(file: &JobFile, f: &mut Faults<'_>) {
    let Some(keys) = &file.placement.measured else { return };
    if keys.file.as_os_str().is_empty() {
        f.push("placement.measured.file", Diag::input("measured-table", "placement.measured.file is empty"));
    }
    if !(0.0..=10.0).contains(&keys.sigmas) {
        let text = format!("placement.measured.sigmas is {}, not between 0 and 10", keys.sigmas);
        let hint = "3 keeps 99.7 % of all heights in focus; 0 keeps nothing free";
        f.push("placement.measured.sigmas", Diag::input("measured-sigmas", text).hint(hint));
    }
    if keys.warp.is_some_and(|warp| !(0.001..=20.0).contains(&warp.as_mm())) {
        let fault = Diag::input("measured-warp", "placement.measured.warp is not between 1 um and 20 mm");
        f.push("placement.measured.warp", fault.hint("state by how much the part may be warped, or leave it out"));
    }
    if file.setups.is_some() {
        let fault = Diag::input("measured-setups", "the job has both [setups] and [placement.measured]");
        f.push(
            "placement.measured",
            fault.hint("measure each set-up in a job of its own, and leave out what others have marked: [[marked]]"),
        );
    }
    if file.partition.method == Method::Tilt {
        let fault = Diag::input("measured-tilt", "a measured part cannot be tilted yet");
        f.push("placement.measured", fault.hint("use another partition.method"));
    }
    // Where a mark is drawn out beyond a cut, what it must keep free there is not what it keeps.
    if file.partition.overlap.as_mm() > 0.0 && keys.sigmas > 0.0 {
        let fault = Diag::input("measured-overlap", "marks of a measured part cannot overlap at cuts yet");
        let hint = "leave partition.overlap out, or set placement.measured.sigmas to 0";
        f.push("partition.overlap", fault.hint(hint));
    }
    for (key, stated) in [("residual", file.placement.residual), ("residual_z", file.placement.residual_z)] {
        if stated.is_some() {
            let text = format!("placement.{key} has no effect beside placement.measured, whose fit says it");
            f.warn(&format!("placement.{key}"), Diag::warning("key-unused", text).hint("leave it out"));
        }
    }
    if let Some(i) = file.texture.iter().position(TextureKeys::runs_along_contours) {
        let fault =
            Diag::input("measured-contour", "areas filled along contours are not marked on a measured part yet");
        f.push(&format!("texture.{i}.direction"), fault.hint("give the direction of the lines as an angle"));
    }
}

/// Checks the keys of dose compensation.
fn dose(file: &JobFile, f: &mut Faults<'_>) {
    let Some(dose) = &file.dose else { return };
    if !(1.01..=10.0).contains(&dose.cap) {
        f.push("dose.cap", Diag::input("dose-cap", "dose.cap is not between 1.01 and 10"));
    }
    if !(0.001..=0.2).contains(&dose.step) {
        f.push("dose.step", Diag::input("dose-step", "dose.step is not between 0.001 and 0.2"));
    }
}

/// The formats that are written, each once.
fn formats(file: &JobFile, mode: Mode, f: &mut Faults<'_>) -> Vec<Format> {
    let Some(formats) = &file.emit.formats else {
        let allows_setups = |format: &&Format| file.setups.is_none() || format.allows_setups();
        return default_formats(mode).iter().filter(allows_setups).copied().collect();
    };
    if formats.is_empty() {
        f.push(
            FORMATS_KEY,
            Diag::input("emit-none", "emit.formats is empty").hint("name at least one format, such as \"dxf\""),
        );
    }
    let mut formats = formats.clone();
    formats.sort_unstable();
    formats.dedup();
    if mode != file.mode {
        formats = formats_of_other_mode(&formats, mode, f);
    }
    for &format in &formats {
        check_format(format, mode, file.setups.is_some(), f);
    }
    formats
}

/// The key that names formats.
const FORMATS_KEY: &str = "emit.formats";

/// The formats of a job file of the other mode: keys that only that mode has are not faults. Those that this mode
/// cannot write are left out; where none is left they are the usual ones.
fn formats_of_other_mode(formats: &[Format], mode: Mode, f: &mut Faults<'_>) -> Vec<Format> {
    let (kept, left_out): (Vec<Format>, Vec<Format>) = formats.iter().partition(|&&format| holds(format, mode));
    let formats = if kept.is_empty() { default_formats(mode).to_vec() } else { kept };
    if !left_out.is_empty() {
        let text = format!("emit.formats {} cannot be written for {} jobs", names(left_out), mode.name());
        let hint = format!("formats of this job: {}", names(formats.iter().copied()));
        f.warn(FORMATS_KEY, Diag::warning("emit-mode", text).hint(hint));
    }
    formats
}

/// What is wrong with a format for jobs of this mode, with or without set-ups.
fn check_format(format: Format, mode: Mode, has_setups: bool, f: &mut Faults<'_>) {
    let of_mode = Format::all().filter(|&format| holds(format, mode));
    if !holds(format, mode) {
        let text = format!("{:?} cannot be written for {} jobs", format.name(), mode.name());
        let hint = format!("leave it out; formats for this mode: {}", names(of_mode));
        f.push(FORMATS_KEY, Diag::input("emit-mode", text).hint(hint));
    } else if has_setups && !format.allows_setups() {
        let text = format!("{:?} has no stop between set-ups, at which the part could be moved", format.name());
        let stopping = names(of_mode.filter(|format| format.allows_setups()));
        let hint = format!("leave it out; formats that stop between set-ups: {stopping}");
        f.push(FORMATS_KEY, Diag::input("setups-format", text).hint(hint));
    }
}

/// The pen of frames: one that marks nothing.
fn frames(file: &JobFile, f: &mut Faults<'_>) -> Option<PenId> {
    let key = "emit.frames";
    let name = file.emit.frames.as_ref()?;
    let Some(pen) = file.pen.iter().position(|pen| pen.name == *name) else {
        let known: Vec<String> = file.pen.iter().map(|pen| format!("{:?}", pen.name)).collect();
        let hint = format!("the pens of the job: {}", known.join(", "));
        f.push(key, Diag::input("frames-pen", format!("there is no pen {name:?}")).hint(hint));
        return None;
    };
    let marks =
        |t: &TextureKeys| t.common.pen.as_ref().map_or(pen == 0, |used| used == name) || t.pens().any(|p| p == name);
    if let Some(i) = file.texture.iter().position(marks) {
        let text = format!("pen {name:?} of the frames marks texture {}", i + 1);
        let hint = "add a [[pen]] for the frames alone, of a power that leaves no mark; it cannot be the first where a \
                    texture names none";
        f.push(key, Diag::input("frames-pen", text).hint(hint));
    }
    Some(PenId(pen as u16))
}

/// What stepped programs cannot do.
fn stepped(file: &JobFile, f: &mut Faults<'_>) {
    // A file for on-the-fly jobs may be compiled stepped by --mode: then its emit.power is no fault.
    if file.mode == Mode::Stepped && file.emit.power == MarkPower::Speed {
        let fault = Diag::input("emit-power", "emit.power = \"speed\" is for jobs that are marked on the fly");
        f.push("emit.power", fault.hint("leave it out: no file of a stepped job changes the power within a line"));
    }
}

/// What on-the-fly programs cannot do.
fn on_the_fly(file: &JobFile, f: &mut Faults<'_>) {
    let along_contours = file.texture.iter().position(TextureKeys::runs_along_contours);
    let along_contours = along_contours.map(|i| format!("texture.{i}.direction"));
    let repeated = file.pen.iter().position(|p| p.passes > 1).map(|i| format!("pen.{i}.passes"));
    let impossible = [
        ((file.passes.count > 1).then(|| "passes.count".to_owned()), "several passes (passes.count)"),
        (file.setups.is_some().then(|| "setups".to_owned()), "set-ups ([setups])"),
        (file.dose.is_some().then(|| "dose".to_owned()), "dose compensation ([dose])"),
        (
            file.placement.measured.is_some().then(|| "placement.measured".to_owned()),
            "parts as they lie ([placement.measured])",
        ),
        ((!file.fixture.is_empty()).then(|| "fixture".to_owned()), "fixtures ([[fixture]])"),
        ((!file.marked.is_empty()).then(|| "marked".to_owned()), "what is left of other jobs ([[marked]])"),
        (file.emit.frames.is_some().then(|| "emit.frames".to_owned()), "frames of blocks (emit.frames)"),
        (repeated, "pens of several passes (pen.passes)"),
        (along_contours, "areas filled along contours (direction = \"contour\")"),
    ];
    let unused =
        [("order.stops", file.order.stops != StopOrder::Time), ("focus.level", file.focus.level != Level::Mid)];
    let others = unused.into_iter().filter(|(_, is_given)| *is_given).map(|(key, _)| key.to_owned());
    let unused: Vec<String> = partition::changed(&file.partition).into_iter().chain(others).collect();
    if let Some(first) = unused.first() {
        let text = format!("on-the-fly jobs have no stops, so these keys have no effect: {}", unused.join(", "));
        f.warn(first, Diag::warning("fly-unused", text).hint("leave them out, or compile a stepped job"));
    }
    for (key, what) in impossible {
        if let Some(key) = key {
            f.push(
                &key,
                Diag::limit("fly-job", format!("on-the-fly programs cannot do {what}"))
                    .hint("leave it out, or compile a stepped job"),
            );
        }
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::job::SAMPLE_JOB;

    /// Codes and messages of the sample job with one text replaced.
    fn faults(from: &str, to: &str) -> Vec<(&'static str, String)> {
        assert!(SAMPLE_JOB.contains(from), "{from}");
        match Job::parse(Path::new("job.toml"), &SAMPLE_JOB.replacen(from, to, 1), &Overrides::default()) {
            Ok(_) => Vec::new(),
            Err(e) => e.diags().iter().map(|d| (d.code, d.message.clone())).collect(),
        }
    }

    #[test]
    fn foreign_and_missing_pattern_keys_are_rejected() {
        let pitch = "pitch = \"0.5 mm\"";
        let of = |to: &str| faults(pitch, to).into_iter().map(|f| f.1).collect::<Vec<_>>();
        assert_eq!(of(pitch), Vec::<String>::new());
        assert_eq!(of(""), ["hatch needs pitch"]);
        let more = "pitch = \"0.5 mm\"\ncell = \"1 mm\"\norder = 3\ntile = true";
        let nothing = |key: &str| format!("{key} does not apply to hatch");
        assert_eq!(of(more), [nothing("cell"), nothing("order"), nothing("tile")]);
        // A default is a key that is given too.
        for (key, value) in
            [("turn", "\"0 deg\""), ("tile", "false"), ("invert", "false"), ("pens", "{}"), ("only", "[]")]
        {
            assert_eq!(of(&format!("{pitch}\n{key} = {value}")), [nothing(key)]);
        }
        let direction = faults("pattern = \"hatch\"", "pattern = \"squares\"\ncell = \"0.6 mm\"");
        assert_eq!(direction[0].1, "direction does not apply to squares");
        assert_eq!(direction[1].0, "texture-cell");
        let riblets = "pattern = \"riblets\"\nline = \"0.1 mm\"\ncell = \"0.2 mm\"\nwidth = \"1 mm\"";
        assert_eq!(faults("pattern = \"hatch\"", riblets)[0].1, "width does not apply to riblets");
        let contour = SAMPLE_JOB.replacen("direction = \"0 deg\"", "direction = \"contour\"", 1);
        let contour = contour.replacen("pattern = \"hatch\"", &riblets.replace("width = \"1 mm\"", ""), 1);
        let refused = Job::parse(Path::new("job.toml"), &contour, &Overrides::default()).expect_err("refused");
        assert_eq!(refused.diags()[0].message, "\"contour\" is not an angle");
    }

    #[test]
    fn a_drawing_that_is_not_read_is_refused_before_its_keys_are_looked_at() {
        for (file, what) in
            [("panel.dwg", "a DWG drawing"), ("a/logo.EPS", "a PostScript drawing"), ("x.pdf", "a PDF document")]
        {
            let found = faults("pattern = \"hatch\"", &format!("file = \"{file}\""));
            let wanted =
                format!("this is {what}, which is not read yet: textures are SVG, DXF and HPGL drawings and bitmaps");
            assert_eq!(found, [("svg-format", wanted)], "{file}");
        }
        // Patterns have no other keys to blame.
        assert_eq!(faults("pattern = \"hatch\"", "pattern = \"hatch\"\nfile = \"x.svg\"")[0].0, "texture-both");
    }

    #[test]
    fn a_placement_that_no_stage_reaches_is_refused() {
        let origin = |x: &str| faults("turn = \"0 deg\"", &format!("origin = [\"{x}\", \"0 mm\", \"0 mm\"]"));
        assert_eq!(origin("4 m"), []);
        assert_eq!(origin("4.1 m")[0].0, "length-far");
    }

    #[test]
    fn pens_are_counted() {
        let pen = |i: usize| {
            format!("[[pen]]\nname = \"p{i}\"\nspeed = \"1 mm/s\"\npower = \"1 %\"\nfrequency = \"1 kHz\"\n")
        };
        let with = |n: usize| faults("[[pen]]", &((1..n).map(pen).collect::<String>() + "[[pen]]"));
        assert_eq!(with(MAX_PENS), []);
        assert_eq!(with(MAX_PENS + 1)[0].0, "pen-many");
    }
}
