//! What is believed of a part before it is measured, and how many stops it costs not to know it.

use super::sites::MarkedPlace;
use super::{Asked, IN_MOST, Place};
use crate::measured::Lying;
use terrace_core::geom::{BoxMm, NM_PER_MM, Nm, SpacePoint};
use terrace_core::machine::Origin;
use terrace_core::math;
use terrace_input::job::Job;
use terrace_register::{Candidate, Prior, Site};

/// Of a range of depth that is kept free up to this share, stops grow as the rest becomes smaller; beyond they would
/// grow without bound, and are taken to grow evenly.
const MOST_KEPT: f64 = 0.8;

/// The power by which the place of a section that is known least counts most: the stops of a section keep free what its
/// worst place asks for.
const WORST: i32 = 8;

/// What is believed, and what not knowing costs.
pub(super) struct Belief {
    pub(super) prior: Prior,
    pub(super) sigmas: f64,
    origin_mm: SpacePoint,
    /// Depth range of a block, mm.
    depth: f64,
    /// The section of each marked place, and what its places weigh.
    section_of: Vec<usize>,
    sections: Vec<Weighed>,
}

/// The marked places of a section: how many they are, and what they weigh together.
#[derive(Clone, Copy, Default)]
struct Weighed {
    places: f64,
    weight: f64,
}

impl Belief {
    /// `field` is the size of a scan field; `known` what an earlier measurement has shown.
    pub(super) fn new(
        job: &Job,
        origin: Origin,
        asked: &Asked,
        (marked, field): (&[MarkedPlace], [Nm; 2]),
        known: Option<&Lying>,
    ) -> Self {
        let bounds = BoxMm::of(marked.iter().map(|m| m.place.at.map(|nm| nm / NM_PER_MM)));
        let origin_mm = origin.mm();
        let middle = [0, 1, 2].map(|k| f64::midpoint(bounds.lo[k], bounds.hi[k]) + origin_mm[k]);
        let [wide, high, _] = bounds.size();
        let extent = math::hypot(wide, high).max(1.0);
        let measured = job.placement.measured.as_ref();
        let limit = measured.and_then(|m| m.warp).map(|limit| limit.as_mm());
        let limits = of_limits(middle, extent, asked.search_mm, limit);
        let prior = match known {
            Some(lying) => of_fit(lying, marked, origin_mm, &limits.warp),
            None => limits,
        };
        let key = |m: &MarkedPlace| [0, 1].map(|k| ((m.place.at[k] / NM_PER_MM - bounds.lo[k]) / field[k].mm()) as u32);
        let mut keys: Vec<[u32; 2]> = marked.iter().map(key).collect();
        keys.sort_unstable();
        keys.dedup();
        let section_of: Vec<usize> = marked.iter().map(|m| keys.partition_point(|k| *k < key(m))).collect();
        let mut sections = vec![Weighed::default(); keys.len()];
        for (&section, m) in section_of.iter().zip(marked) {
            sections[section].places += 1.0;
            sections[section].weight += m.weight;
        }
        let all: f64 = sections.iter().map(|s| s.weight).sum();
        sections.iter_mut().for_each(|s| s.weight /= all);
        let sigmas = measured.map_or(IN_MOST, |m| m.sigmas);
        Self { prior, sigmas, origin_mm, depth: job.focus.depth.mm(), section_of, sections }
    }

    pub(super) fn site(&self, place: &Place) -> Site {
        Site { at: [0, 1, 2].map(|k| place.at[k] / NM_PER_MM + self.origin_mm[k]), slope: place.slope }
    }

    /// By how many times more stops there are than of a part that is known exactly, where the heights of the marked
    /// places have these variances, mm²: in each section so many as the depth that is left is smaller.
    pub(super) fn stops(&self, variances: &[f64]) -> f64 {
        let mut sums = vec![0.0; self.sections.len()];
        for (&section, &variance) in self.section_of.iter().zip(variances) {
            sums[section] += variance.powi(WORST);
        }
        let of_section = |(sum, section): (&f64, &Weighed)| {
            let variance = math::pow(sum / section.places, 1.0 / f64::from(WORST));
            let kept = 2.0 * self.sigmas * variance.sqrt() / self.depth;
            let slope = 1.0 / (1.0 - MOST_KEPT).powi(2);
            let left = 1.0 - kept.min(MOST_KEPT);
            section.weight * (1.0 / left + slope * (kept - MOST_KEPT).max(0.0))
        };
        sums.iter().zip(&self.sections).map(of_section).sum()
    }
}

/// Nothing has shown where the part lies and how it is warped: it lies somewhere within `search` mm of its place, in
/// every direction, and its warp is no larger than `warp` mm.
///
/// Over half its extent and more it may be warped by as much; over shorter lengths by as much less as keeps short-range
/// differences of its height alike, whatever the length: for Matern's covariance the square of the amplitude then goes
/// with the cube of the length (Zhang, Journal of the American Statistical Association 99, 2004). So do the lengths that
/// points of one part are fitted with.
fn of_limits(centre: SpacePoint, extent: f64, search: f64, warp: Option<f64>) -> Prior {
    let shift = search / IN_MOST;
    let turn = shift / (extent / 2.0);
    let lengths: Vec<f64> = terrace_register::lengths(extent).collect();
    let weight = 1.0 / lengths.len() as f64;
    let of_length = |length: f64, limit: f64| {
        let share = (2.0 * length / extent).min(1.0);
        Candidate { length, amplitude: limit / IN_MOST * share * share.sqrt(), weight }
    };
    Prior {
        centre,
        covariance: Prior::independent([turn, turn, turn, shift, shift, shift]),
        warp: warp.map_or_else(Vec::new, |limit| lengths.into_iter().map(|length| of_length(length, limit)).collect()),
    }
}

/// What a fit leaves unknown. Of a warped part its correction holds what the pose is off by in height; where its points
/// do not reach all that is marked, the warp is believed to be what it was before.
fn of_fit(lying: &Lying, marked: &[MarkedPlace], origin_mm: SpacePoint, before: &[Candidate]) -> Prior {
    let uncertainty = &lying.fit.uncertainty;
    let (covariance, warp) = match &lying.warp {
        None => (uncertainty.covariance, Vec::new()),
        Some(warp)
            if !marked.iter().all(|m| warp.reaches([0, 1].map(|k| m.place.at[k] / NM_PER_MM + origin_mm[k]))) =>
        {
            ([[0.0; 6]; 6], before.to_vec())
        }
        Some(warp) => {
            let grown = |c: Candidate| Candidate { amplitude: c.amplitude * warp.factor(), ..c };
            ([[0.0; 6]; 6], warp.candidates().into_iter().map(grown).collect())
        }
    };
    Prior { centre: uncertainty.centre, covariance, warp }
}
