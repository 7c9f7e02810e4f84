//! A touch probe beside the lens.

use serde::{Deserialize, Serialize};

use super::Fault;
use crate::diag::Diag;
use crate::geom::{NM_PER_MM, SpacePoint};
use crate::units::{Length, Speed, non_negative, positive};

/// A touch probe that the stage carries as it carries the beam. It touches along z.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Probe {
    /// Radius of the tip, up to 20 mm.
    #[serde(deserialize_with = "positive")]
    pub radius: Length,
    /// Standard deviation of a touch, up to 1 mm: of ten at one place.
    #[serde(deserialize_with = "positive")]
    pub noise: Length,
    /// How far the tip moves on after it has touched until the controller knows.
    #[serde(default, deserialize_with = "non_negative")]
    pub pretravel: Length,
    /// Where the centre of the tip lies from the focus of the beam, along x, y and z of the table frame, within 1 m.
    pub offset: [Length; 3],
    /// From the centre of the tip up to the lower end of the body.
    #[serde(deserialize_with = "positive")]
    pub stylus: Length,
    /// Diameter of the body that carries the stylus.
    #[serde(deserialize_with = "positive")]
    pub body: Length,
    /// Speed of a touch.
    #[serde(default = "usual_feed", deserialize_with = "positive")]
    pub feed: Speed,
}

fn usual_feed() -> Speed {
    Speed::mm_s(1.0)
}

impl Probe {
    /// The centre of the tip from the focus of the beam, mm.
    pub fn offset_mm(&self) -> SpacePoint {
        self.offset.map(Length::as_mm)
    }

    /// The same in nm.
    pub fn offset_nm(&self) -> SpacePoint {
        self.offset_mm().map(|mm| mm * NM_PER_MM)
    }

    pub(super) fn faults(&self) -> Vec<Fault> {
        let mut out = Vec::new();
        let mut report = |key: &str, text: &str, hint: &str| {
            out.push((key.to_owned(), Diag::input("machine-probe", text).hint(hint)));
        };
        if self.radius.as_mm() > 20.0 {
            report("probe.radius", "probe.radius is beyond 20 mm", "check the unit");
        }
        if !(1e-6..=1.0).contains(&self.noise.as_mm()) {
            report("probe.noise", "probe.noise is not between 1 nm and 1 mm", "1 um to 5 um is usual");
        }
        if self.pretravel.as_mm() > 10.0 {
            report("probe.pretravel", "probe.pretravel is beyond 10 mm", "check the unit");
        }
        if self.offset.iter().any(|o| o.as_mm().abs() > 1000.0) {
            report("probe.offset", "probe.offset is beyond 1 m", "check the unit");
        }
        if self.stylus.as_mm() > 1000.0 || self.stylus < self.radius {
            report(
                "probe.stylus",
                "probe.stylus is shorter than probe.radius, or beyond 1 m",
                "measure it from the \
                   centre of the tip to the body",
            );
        }
        if self.body.as_mm() > 1000.0 || self.body.as_mm() < 2.0 * self.radius.as_mm() {
            report("probe.body", "probe.body is thinner than the tip, or beyond 1 m", "state the diameter of the body");
        }
        if self.feed.as_mm_s() > 1000.0 {
            report("probe.feed", "probe.feed is beyond 1 m/s", "1 mm/s is usual");
        }
        out
    }
}
