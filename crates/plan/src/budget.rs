//! The error budget: how far marks may lie from where they should, seen along the beam (*lateral*) and along it
//! (*depth*), of every block and of the job; i is the incidence of the beam.
//!
//! Consumes what machine and job state of their errors, and of each block its defocus and its steepest incidence.
//! Promises a list of terms in a fixed order, each known or not; a term that nobody states is None and is never taken
//! to be zero. Errors are um, angles rad.
//!
//! # Terms
//! - projection, p (1/cos s - 1): textures lie in plan, so a spacing of p is p / cos s long on a slope of s against the
//!   part's z (Cao and Zhu 2013, step 5: orthographic projection). Where the part is tilted by t, s is at most i + t;
//! - stage, sqrt 2 a: x and y each within the positioning accuracy a;
//! - telecentricity, d tan e: a beam that leans by e is beside its place where the part is d out of focus; stated by
//!   distance from the optical axis, e is that at the block's farthest mark or nearer, as is the field residual;
//! - tessellation, f / cos i: facets f from the surface along its normal;
//! - slope, l tan i: what the lateral errors l but the projection climb on a slope of i.
//!
//! # Composition
//! Every term is a bound, not a standard deviation, and nothing is known of how they are distributed or depend on each
//! other. So the sum alone is a bound, and it decides about warnings. The root of the sum of squares is stated beside
//! it: what is to be expected where the terms are independent of each other.
//!
//! # Limits
//! No field curvature, no heat, no error of angles of tilt axes, on the fly no following error.

use serde::ser::SerializeMap;
use serde::{Deserialize, Serialize, Serializer};
use terrace_core::math;

use crate::measured::Lying;
use crate::projection::HeightReserve;
use terrace_core::diag::Diag;
use terrace_core::geom::{Box2, NM_PER_MM, Nm, Turn};
use terrace_core::machine::{Machine, Origin};
use terrace_core::program::{Block, BlockFigures, Program};
use terrace_core::units::{Angle, Length};
use terrace_input::job::{DepthRule, Job, MeasuredInput, Unsure};

/// Without a reserve, what errors may take beyond PDOF before a warning says so, as a share of half the range: PDOF is
/// not measured more closely.
pub const TOLERATED: f64 = 0.1;

/// Deviations of a fit that count as a bound.
const SIGMAS: f64 = 3.0;

/// What an error comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Cause {
    /// Spacings are longer on a slope than in plan.
    Projection,
    /// Stage positions along x and y.
    Stage,
    /// The beam leans.
    Telecentricity,
    /// What the field correction leaves.
    FieldResidual,
    /// Where the part lies in x and y.
    Registration,
    /// Angles of tilt axes.
    Tilt,
    /// Facets, samples or points beside the part.
    Tessellation,
    /// Stage positions along z.
    StageZ,
    /// The focal plane as the zoom optic sets it.
    Zoom,
    /// Where the part lies in z.
    RegistrationZ,
    /// Lateral errors on a slope.
    Slope,
    /// The smooth height field that axes follow in place of the part. It is a part of the defocus.
    Relief,
}

impl Cause {
    /// The name in files and for people.
    pub fn name(self) -> &'static str {
        match self {
            Self::Projection => "projection",
            Self::Stage => "stage",
            Self::Telecentricity => "telecentricity",
            Self::FieldResidual => "field residual",
            Self::Registration => "registration",
            Self::Tilt => "tilt axes",
            Self::Tessellation => "tessellation",
            Self::StageZ => "stage z",
            Self::Zoom => "zoom optic",
            Self::RegistrationZ => "registration z",
            Self::Slope => "slope",
            Self::Relief => "relief",
        }
    }

    /// The key that states it; None where it follows from others or is not modelled.
    pub fn key(self) -> Option<&'static str> {
        Some(match self {
            Self::Projection => "texture.pitch",
            Self::Stage => "stage.accuracy",
            Self::Telecentricity => "lens.telecentricity",
            Self::FieldResidual => "lens.field_residual",
            Self::Registration => "placement.residual",
            Self::Tessellation => "surface.tessellation",
            Self::StageZ => "stage.z_accuracy",
            Self::Zoom => "zoom.accuracy",
            Self::RegistrationZ => "placement.residual_z",
            Self::Tilt | Self::Slope | Self::Relief => return None,
        })
    }
}

/// One term of a budget.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Term {
    /// What the error comes from.
    pub cause: Cause,
    /// How large it is at most, um; None where that is not stated.
    pub um: Option<f64>,
}

/// The terms of a budget, and what they come to.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Terms {
    /// The block that they are those of; None of an on-the-fly job, where they are those of its worst marks.
    pub block: Option<String>,
    /// The terms.
    pub terms: Vec<Term>,
    /// The sum of the terms, um.
    pub sum_um: f64,
    /// The root of the sum of their squares, um.
    pub rss_um: f64,
}

impl Terms {
    fn new(terms: Vec<Term>) -> Self {
        // The relief is a part of the defocus already.
        let known = || terms.iter().filter(|t| t.cause != Cause::Relief).filter_map(|t| t.um);
        let (sum_um, rss_um) = (known().sum(), known().map(|um| um * um).sum::<f64>().sqrt());
        Self { block: None, terms, sum_um, rss_um }
    }

    /// The terms that are known, for reading: `stage 7.1, telecentricity 0.3`.
    pub fn known(&self) -> String {
        let shown = |t: &Term| {
            let within = if t.cause == Cause::Relief { " within the defocus" } else { "" };
            t.um.map(|um| format!("{} {um:.1}{within}", t.cause.name()))
        };
        self.terms.iter().filter_map(shown).collect::<Vec<_>>().join(", ")
    }
}

/// The worst of a job.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Budget {
    /// Processing depth of focus, mm.
    pub pdof_mm: f64,
    /// What of it the job keeps for errors, mm.
    pub reserve_mm: f64,
    /// Where marks are: the block with the largest sum.
    pub lateral: Terms,
    /// How far from focus: the block whose sum is largest against what is left.
    pub depth: Terms,
    /// What the defocus of that block leaves of PDOF to either side, um; 0 where it leaves nothing.
    pub depth_left_um: f64,
}

impl Budget {
    /// What is not stated, for reading: keys, and `tilt axes` where the job tilts.
    pub fn not_stated(&self) -> Vec<&'static str> {
        let mut out: Vec<&str> = Vec::new();
        for term in self.lateral.terms.iter().chain(&self.depth.terms).filter(|t| t.um.is_none()) {
            let name = match term.cause {
                Cause::Slope => continue,
                Cause::Tilt => "tilt axes (not modelled)",
                Cause::Projection => "projection (no bound)",
                cause => cause.key().unwrap_or(cause.name()),
            };
            if !out.contains(&name) {
                out.push(name);
            }
        }
        out
    }

    /// The budget in three lines, for reading: lateral, depth, and what is not stated, empty where everything is.
    pub fn lines(&self) -> [String; 3] {
        let in_block = |t: &Terms| t.block.as_ref().map_or(String::new(), |block| format!(" in {block}"));
        let known = |t: &Terms| {
            let text = t.known();
            if text.is_empty() { String::from("nothing stated") } else { text }
        };
        let lateral = &self.lateral;
        let depth = &self.depth;
        [
            format!("{:.1} um{} ({})", lateral.sum_um, in_block(lateral), known(lateral)),
            format!(
                "{:.1} um{}, {:.1} um left of PDOF ({})",
                depth.sum_um,
                in_block(depth),
                self.depth_left_um,
                known(depth)
            ),
            self.not_stated().join(", "),
        ]
    }

    /// A depth budget that is larger than what is left of PDOF. Focal planes are rounded to the stage increment, which
    /// may take that much of a reserve.
    pub fn warning(&self, job: &Job, machine: &Machine) -> Option<Diag> {
        let half_um = job.focus.rule.range(job.focus.pdof).f64() / 2e3;
        let increment_um = machine.increment_nm().f64() / 1e3;
        let tolerated = if self.reserve_mm > 0.0 { increment_um } else { TOLERATED * half_um };
        let Self { depth, depth_left_um: left, .. } = self;
        // What a measured part is off by in height stays free at each mark already.
        let is_kept_free = |m: &MeasuredInput| m.sigmas >= SIGMAS && m.unsure == Unsure::Refuse;
        let is_kept =
            |t: &&Term| t.cause == Cause::RegistrationZ && job.placement.measured.as_ref().is_some_and(is_kept_free);
        let kept = depth.terms.iter().filter(is_kept).filter_map(|t| t.um).sum::<f64>();
        let (sum, left) = (depth.sum_um - kept, (left - kept).max(0.0));
        if sum <= left + tolerated {
            return None;
        }
        let place = depth.block.as_ref().map_or(String::new(), |block| format!(" of {block}"));
        let text = format!(
            "errors may take marks{place} {sum:.1} um out of focus beyond their defocus, which leaves {left:.1} um of PDOF: \
             {}{}",
            depth.known(),
            if kept > 0.0 { "; registration z stays free at each mark beside that" } else { "" }
        );
        let twice = if job.focus.rule == DepthRule::Range { 2.0 } else { 1.0 };
        let reserve_um = (twice * sum).ceil();
        let hint = if reserve_um < job.focus.pdof.f64() / 1e3 {
            format!("focus.reserve = \"{reserve_um:.0} um\" keeps room for them")
        } else {
            "no focus.reserve can keep room for them: it takes a larger PDOF or smaller errors".into()
        };
        let key = if self.reserve_mm > 0.0 { "focus.reserve" } else { "focus" };
        Some(Diag::warning("depth-budget", text).at(job.place_of(key)).hint(hint))
    }
}

/// What machine, job and surface state of their errors, um and rad.
pub struct StatedErrors<'a> {
    job: &'a Job,
    machine: &'a Machine,
    spacing: Option<f64>,
    tessellation: Option<f64>,
    /// Of a measured part.
    lying: Option<(&'a Lying, &'a HeightReserve)>,
}

/// The smooth height field that rotary axes follow, at the marks of a job.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Relief {
    /// Largest distance from the part along z, um.
    pub off_um: f64,
    /// The largest slope, rad.
    pub slope_rad: f64,
}

/// What the terms of a block follow from.
struct ErrorSources {
    /// Largest distance from the focal plane, um.
    defocus: f64,
    /// Cosine of the largest angle between beam and normal.
    cos: f64,
    /// Cosine of the largest slope against the part's z.
    cos_in_plan: f64,
    is_tilted: bool,
    relief: Option<f64>,
    /// How far from the optical axis marks lie at most, mm.
    off_axis: f64,
    /// How far the part may lie aside, and in z, um.
    registration: [Option<f64>; 2],
}

/// The errors of one block.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Errors {
    /// Where marks are.
    pub lateral: Terms,
    /// How far from focus.
    pub depth: Terms,
    /// What the defocus leaves of PDOF to either side, um.
    pub left_um: f64,
}

fn um(length: Option<Length>) -> Option<f64> {
    length.map(|l| l.as_mm() * 1e3)
}

impl<'a> StatedErrors<'a> {
    /// For a surface whose facets lie so far from exact ones, where its reader knows that.
    pub fn new(job: &'a Job, machine: &'a Machine, tessellation_mm: Option<f64>) -> Self {
        let spacings = job.textures.iter().filter_map(|t| t.kind.spacing_mm());
        Self {
            job,
            machine,
            spacing: spacings.reduce(f64::max).map(|mm| mm * 1e3),
            tessellation: tessellation_mm.map(|mm| mm * 1e3).or(um(job.surface.tessellation)),
            lying: None,
        }
    }

    /// The same for a part that was measured: where it lies is known as surely as its fit says.
    #[must_use]
    pub fn with_lying(self, lying: Option<(&'a Lying, &'a HeightReserve)>) -> Self {
        Self { lying, ..self }
    }

    /// How far a block may lie beside its place on the part, and above or below it, um: what the job states, or of a
    /// measured part [`SIGMAS`] deviations where the fit is least sure in its field; that of the height is on the slope,
    /// and holds what lateral errors of the fit climb.
    fn registration(&self, block: &Block) -> [Option<f64>; 2] {
        let Some((lying, reserve)) = self.lying else { return self.job.placement.residual.map(um) };
        let [half_x, half_y] = self.machine.half_usable_field_mm();
        let stop = &block.stop;
        let centre = stop.centre.mm();
        let origin = lying.origin.mm();
        let corners = [(-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0)];
        let sigmas = corners.map(|(x, y)| {
            let at =
                [centre[0] + x * half_x + origin[0], centre[1] + y * half_y + origin[1], stop.lpfl.mm() + origin[2]];
            let [x, y, _] = lying.fit.uncertainty.place(at);
            math::hypot(x, y)
        });
        let lateral = sigmas.into_iter().fold(0.0, f64::max) * SIGMAS * 1e3;
        let [x, y] = [half_x, half_y].map(|half| Nm::round(half * NM_PER_MM));
        let window = Box2::around(Turn::drawn(stop.centre), [x, y]);
        [Some(lateral), Some(reserve.deviation(window) * SIGMAS / 1e3)]
    }

    /// The errors of a block.
    pub fn of_block(&self, block: &Block, figures: &BlockFigures) -> Errors {
        let lpfl = block.stop.lpfl;
        let cos = figures.slope.cos()[1];
        let is_tilted = !block.stop.tilt.is_upright();
        let tilt = || math::asin(self.machine.turn(block.stop.tilt, Origin::default()).lean());
        self.errors(&ErrorSources {
            defocus: (block.z_hi - lpfl).max(lpfl - block.z_lo).f64() / 1e3,
            cos,
            cos_in_plan: if is_tilted { math::cos(math::acos(cos) + tilt()).max(0.0) } else { cos },
            is_tilted,
            relief: None,
            off_axis: figures.off_axis_mm,
            registration: self.registration(block),
        })
    }

    /// The worst of a stepped job; `figures` are those of the blocks of the program.
    pub fn of_program(&self, program: &Program, figures: &[BlockFigures]) -> Budget {
        let mut worst = self.budget(Errors::default());
        for (i, (block, figures)) in program.blocks.iter().zip(figures).enumerate() {
            let Errors { lateral, depth, left_um } = self.of_block(block, figures);
            let named = |terms: Terms| Terms { block: Some(program.id(i).to_string()), ..terms };
            if i == 0 || lateral.sum_um > worst.lateral.sum_um {
                worst.lateral = named(lateral);
            }
            if i == 0 || depth.sum_um - left_um > worst.depth.sum_um - worst.depth_left_um {
                (worst.depth, worst.depth_left_um) = (named(depth), left_um);
            }
        }
        worst
    }

    /// The budget of an on-the-fly job whose marks are at most so far out of focus, um, and whose incidence is at most
    /// this, rad.
    pub fn on_the_fly(&self, defocus_um: f64, incidence_rad: f64, relief: Option<Relief>) -> Budget {
        let cos = math::cos(incidence_rad);
        self.budget(self.errors(&ErrorSources {
            defocus: defocus_um,
            cos,
            cos_in_plan: relief.map_or(cos, |r| math::cos(r.slope_rad)),
            is_tilted: relief.is_some(),
            relief: relief.map(|r| r.off_um),
            off_axis: self.machine.farthest_in_field(),
            registration: self.job.placement.residual.map(um),
        }))
    }

    fn budget(&self, Errors { lateral, depth, left_um }: Errors) -> Budget {
        let focus = &self.job.focus;
        let pdof_mm = focus.pdof.mm();
        let reserve_mm = focus.reserve.mm();
        Budget { pdof_mm, reserve_mm, lateral, depth, depth_left_um: left_um }
    }

    /// The errors that follow from these sources.
    fn errors(&self, sources: &ErrorSources) -> Errors {
        let Self { job, machine, .. } = *self;
        let cos = sources.cos;
        let tan = (1.0 - cos * cos).max(0.0).sqrt() / cos;
        // Nothing bounds what goes with 1 / cos at a right angle.
        let term = |cause, um: Option<f64>| Term { cause, um: um.filter(|um| um.is_finite()) };
        let [residual, residual_z] = sources.registration;
        let lens = &machine.lens;
        let lean = lens.telecentricity.as_ref().map(|e| Angle::deg(e.largest_within(sources.off_axis)));
        let field_residual = lens.field_residual.as_ref().map(|r| Length::mm(r.largest_within(sources.off_axis)));
        // The stage may be off along x and y at once.
        let moved = [
            term(Cause::Stage, um(machine.stage.accuracy).map(|a| std::f64::consts::SQRT_2 * a)),
            term(Cause::Telecentricity, lean.map(|e| sources.defocus * math::tan(e.as_rad()))),
            term(Cause::FieldResidual, um(field_residual)),
            term(Cause::Registration, residual),
        ];
        // On a slope a mark that lies aside lies at another height.
        let climbing = moved.iter().filter(|t| self.lying.is_none() || t.cause != Cause::Registration);
        let climbed = climbing.filter_map(|t| t.um).reduce(|a, b| a + b).map(|l| l * tan);
        let mut lateral = vec![term(Cause::Projection, self.spacing.map(|p| p * (1.0 / sources.cos_in_plan - 1.0)))];
        lateral.extend(moved);
        let mut depth = vec![
            term(Cause::Tessellation, self.tessellation.map(|t| t / cos)),
            term(Cause::StageZ, um(machine.stage.z_accuracy)),
        ];
        depth.extend(machine.zoom.as_ref().map(|zoom| term(Cause::Zoom, um(zoom.accuracy))));
        depth.extend([term(Cause::RegistrationZ, residual_z), term(Cause::Slope, climbed)]);
        if sources.is_tilted {
            lateral.push(term(Cause::Tilt, None));
            depth.push(term(Cause::Tilt, None));
        }
        depth.extend(sources.relief.map(|relief| term(Cause::Relief, Some(relief))));
        let half_um = job.focus.rule.range(job.focus.pdof).f64() / 2e3;
        let left_um = (half_um - sources.defocus).max(0.0);
        Errors { lateral: Terms::new(lateral), depth: Terms::new(depth), left_um }
    }
}

/// The terms of a block that are known, by name, and what they come to: `errors_um` of a block in the manifest.
impl Serialize for Errors {
    fn serialize<S: Serializer>(&self, s: S) -> Result<S::Ok, S::Error> {
        let mut map = s.serialize_map(None)?;
        // Both budgets in one map: the only cause in both is the tilt, which is never known.
        for (side, terms) in [("lateral", &self.lateral), ("depth", &self.depth)] {
            for Term { cause, um } in &terms.terms {
                if let Some(um) = um {
                    map.serialize_entry(cause, um)?;
                }
            }
            map.serialize_entry(&format!("{side}_sum"), &terms.sum_um)?;
            map.serialize_entry(&format!("{side}_rss"), &terms.rss_um)?;
        }
        map.serialize_entry("depth_left", &self.left_um)?;
        map.end()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;
    use terrace_input::job::Overrides;

    #[test]
    fn a_slope_that_may_be_upright_leaves_terms_unknown_and_sums_finite() {
        let text = "surface.file = \"a.stl\"\nsurface.unit = \"mm\"\nfocus.pdof = \"0.07 mm\"\n\
                    machine.profile = \"xyz-galvo-40\"\n[[texture]]\npattern = \"hatch\"\npitch = \"1 mm\"\n\
                    [[pen]]\nname = \"a\"\nspeed = \"1 m/s\"\npower = \"50 %\"\nfrequency = \"60 kHz\"\n";
        let job = Job::parse(Path::new("a.toml"), text, &Overrides::default()).expect("a job");
        let machine = Machine::built_in("xyz-galvo-40").expect("a profile");
        let stated = StatedErrors::new(&job, &machine, Some(0.001));
        let at = |cos_in_plan| {
            let sources = ErrorSources {
                defocus: 20.0,
                cos: 0.5,
                cos_in_plan,
                is_tilted: true,
                relief: None,
                off_axis: 0.0,
                registration: [None; 2],
            };
            stated.errors(&sources)
        };
        let projection = |errors: &Errors| errors.lateral.terms.iter().find(|t| t.cause == Cause::Projection).copied();
        assert_eq!(projection(&at(0.5)).and_then(|t| t.um), Some(1000.0));
        let upright = at(0.0);
        assert_eq!(projection(&upright).map(|t| t.um), Some(None));
        assert!(upright.lateral.sum_um.is_finite() && upright.depth.sum_um.is_finite());
    }
}
