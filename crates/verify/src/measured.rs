//! A measured part: its pose is proved first, then each pass of its texture.

use std::sync::Arc;

use super::findings::{Findings, RuleCode};
use super::geometry::{Geometry, HeightDoubt, Pose};
use super::job_facts::JobFacts;
use super::proof::NotProved;
use super::read::manifest::Manifest;
use super::rules::draped::{LyingPart, Strokes};
use super::{Drawing, rules};
use terrace_core::diag::Error;
use terrace_core::geom::Turn;
use terrace_input::job::{Job, Unsure};
use terrace_input::measured::read_table;
use terrace_input::surface::Joining;
use terrace_input::texture::{Draping, Texture};

/// Where the part of a job lies.
pub(super) enum Lying {
    /// It was not measured: as designed, where the job places it.
    AsDesigned,
    /// As it was measured.
    Measured(Box<Measured>),
}

/// A measured part.
pub(super) struct Measured {
    geometry: Geometry,
    /// Without its correction; None where it has none.
    rigid: Option<Geometry>,
    pose: Pose,
    draping: Arc<Draping>,
}

/// Where the part of a job lies; None where its manifest does not say that, which is noted.
///
/// # Errors
/// Faults of the table, and of the surface file.
pub(super) fn lying(
    job: &Job,
    manifest: &Manifest,
    facts: &JobFacts,
    designed: &Geometry,
    findings: &mut Findings,
) -> Result<Option<Lying>, Error> {
    let [measured, draped] = findings.rules.several([RuleCode::Measured, RuleCode::Draped]);
    let Some(input) = &job.placement.measured else {
        (measured.ran, draped.ran) = (true, true);
        if manifest.placement.measured.is_some() {
            let text = "it says how a measured part lies, but the job has not measured one";
            measured.broken("", "manifest.json", text);
        }
        return Ok(Some(Lying::AsDesigned));
    };
    let points = read_table(&job.relative(&input.file))?;
    let Some(proved) = rules::measured::check(manifest, &points, input, facts, designed, measured) else {
        return Ok(None);
    };
    let joining = Joining {
        weld_mm: job.surface.weld.mm(),
        narrow_mm: facts.machine.lens.spot.as_mm(),
        non_manifold: job.surface.non_manifold,
    };
    let rules::measured::ProvedPose { beside: pose, centre, covariance, correction } = proved;
    // Strokes are moved by the rigid motion alone: a correction raises all that lies over a place alike.
    let rigid = correction.is_some().then(|| designed.moved(&pose));
    let most = match input.unsure {
        Unsure::Refuse => f64::INFINITY,
        Unsure::Warn => facts.depth_range_nm() / 4.0,
    };
    if input.unsure == Unsure::Warn {
        let what =
            "focus where deviations of the height are more than a quarter of the depth range: no more is kept free";
        findings.not_proved.push(NotProved { file: "program.txt".to_owned(), what: what.to_owned() });
    }
    let taken = format!(
        "of {} that points are on the part as named, and radius, pretravel and offset of the probe",
        input.file.display()
    );
    findings.not_proved.push(NotProved { file: "manifest.json".to_owned(), what: taken });
    if let Some(off) = manifest.placement.measured.as_ref().map(|m| m.off_part).filter(|off| *off > 0) {
        let what = format!("that the part is as designed where {off} touches do not lie on it");
        findings.not_proved.push(NotProved { file: "manifest.json".to_owned(), what });
    }
    let doubt = HeightDoubt { centre, covariance, sigmas: input.sigmas, most, correction };
    let motion = Turn::rigid(pose.rows, pose.shift);
    let turn = job.placement.turn.as_rad();
    let draping =
        Draping::load(&job.surface_path(), &job.surface.options, joining, turn, motion, job.limits.max_slope())?;
    let measured = Measured { geometry: designed.measured(&pose, doubt), rigid, pose, draping: Arc::new(draping) };
    Ok(Some(Lying::Measured(Box::new(measured))))
}

impl Lying {
    /// The part as it lies; None where it was not measured.
    pub(super) fn geometry(&self) -> Option<&Geometry> {
        match self {
            Self::AsDesigned => None,
            Self::Measured(part) => Some(&part.geometry),
        }
    }

    /// The motion of a measured part beside its placement.
    pub(super) fn pose(&self) -> Option<&Pose> {
        match self {
            Self::AsDesigned => None,
            Self::Measured(part) => Some(&part.pose),
        }
    }

    /// The texture of a pass on the part as it lies; of a measured one its strokes are proved.
    ///
    /// # Errors
    /// Those of [`Texture::draped`].
    pub(super) fn texture(
        &self,
        texture: Texture,
        designed: &Geometry,
        findings: &mut Findings,
    ) -> Result<Texture, Error> {
        let Self::Measured(part) = self else { return Ok(texture) };
        let draped = texture.draped(&part.draping)?;
        let lying = LyingPart { designed, lying: part.rigid.as_ref().unwrap_or(&part.geometry), pose: part.pose };
        {
            let strokes = Strokes {
                designed: &Drawing::from_texture(&texture),
                lying: &Drawing::from_texture(&draped.texture),
                pieces: &|i| draped.pieces(i),
            };
            rules::draped::check(&lying, &strokes, &mut findings.rules[RuleCode::Draped]);
        }
        Ok(draped.texture)
    }
}
