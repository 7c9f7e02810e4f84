//! `[partition]`: how the surface is divided into stops.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::faults::Faults;
use terrace_core::diag::Diag;
use terrace_core::geom::Nm;
use terrace_core::units::{Length, non_negative, non_negative_option, positive_option};

/// `[partition]`.
#[derive(Clone, Debug, Default, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct PartitionKeys {
    /// How stops are chosen, see below.
    #[serde(default)]
    pub method: Method,
    /// Pitch of the grid of sections and size of windows, at most the usable field.
    #[schemars(example = &"39 mm", extend("x-default" = "the usable field"))]
    #[serde(default, deserialize_with = "positive_option")]
    pub section: Option<Length>,
    /// Pieces shorter than this in plan are not marked; see below.
    #[schemars(example = &"5 um", extend("x-default" = "slivers below half the spot"))]
    #[serde(default, deserialize_with = "non_negative_option")]
    pub min_mark: Option<Length>,
    /// What "auto" minimises: the estimated job time with the loading of its blocks (`operator` of the machine file),
    /// or the number of stops. `--objective` on the command line overrides it.
    #[serde(default)]
    pub objective: Objective,
    /// Closed figures and strokes up to this size along x and y are not cut where a stop can contain them.
    #[schemars(example = &"2 mm")]
    #[serde(default, deserialize_with = "non_negative")]
    pub keep_whole: Length,
    /// Strokes are cut at random places within this length before a border, where both stops admit it, so that cuts do
    /// not line up.
    #[schemars(example = &"0.2 mm", extend("x-value" = "length below half the field"))]
    #[serde(default, deserialize_with = "non_negative")]
    pub zone: Length,
    /// Length that both stops mark where a stroke is cut, as far as both admit it; not together with `zone`.
    #[schemars(example = &"0.05 mm", extend("x-value" = "length below a quarter of the field"))]
    #[serde(default, deserialize_with = "non_negative")]
    pub overlap: Length,
    /// Overlap of levels up and down, at most a quarter of the depth range, which it is taken from: a rough surface
    /// then does not change the stop at every ripple.
    #[schemars(example = &"5 um", extend("x-default" = "from the surface"))]
    #[serde(default, deserialize_with = "non_negative_option")]
    pub hysteresis: Option<Length>,
}

/// Ways to divide.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// A grid of sections, evenly spaced levels of the whole part (the article).
    Contour,
    /// A grid of sections, in each the fewest levels that cover the texture's depths.
    ZRange,
    /// Windows of the field and levels placed freely, as few as can be found.
    Window,
    /// Sections each at a tilt of its own, levels along the tilted beam; for machines with tilt axes.
    Tilt,
    /// Every method that the machine can run; the one with the least job time is kept.
    #[default]
    Auto,
}

impl Method {
    /// The name in files and on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Contour => "contour",
            Self::ZRange => "z-range",
            Self::Window => "window",
            Self::Tilt => "tilt",
            Self::Auto => "auto",
        }
    }
}

/// What `auto` minimises.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Objective {
    /// Estimated job time.
    #[default]
    Time,
    /// Stops; of equal numbers the least time.
    Stops,
}

impl Objective {
    /// The name in files and on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Time => "time",
            Self::Stops => "stops",
        }
    }
}

/// How the surface is divided.
#[derive(Clone, Copy, Debug, Default)]
pub struct Partition {
    /// The method.
    pub method: Method,
    /// What `auto` minimises.
    pub objective: Objective,
    /// Pitch of the sections; None: from the usable field.
    pub section: Option<Nm>,
    /// Fragments shorter than this are skipped and counted; None: slivers below half the spot, next to a mark.
    pub min_mark: Option<Nm>,
    /// Closed figures and strokes no larger than this along x and y stay whole where a stop can hold them.
    pub keep_whole: Nm,
    /// Strokes are cut at a random place within this length before a border; 0: on it.
    pub zone: Nm,
    /// Strokes that are cut are marked by both stops over this length.
    pub overlap: Nm,
    /// How far levels reach over each other; None: from the surface's roughness.
    pub hysteresis: Option<Nm>,
}

pub(super) fn resolve(keys: &PartitionKeys, f: &mut Faults<'_>) -> Partition {
    if keys.zone.as_mm() > 0.0 && keys.overlap.as_mm() > 0.0 {
        f.push(
            "partition.overlap",
            Diag::input("seam-both", "partition has both zone and overlap")
                .hint("keep one of them: seams are either spread or marked twice"),
        );
    }
    Partition {
        method: keys.method,
        objective: keys.objective,
        section: f.nm_option("partition.section", keys.section),
        min_mark: f.nm_option("partition.min_mark", keys.min_mark),
        keep_whole: f.nm("partition.keep_whole", keys.keep_whole),
        zone: f.nm("partition.zone", keys.zone),
        overlap: f.nm("partition.overlap", keys.overlap),
        hysteresis: f.nm_option("partition.hysteresis", keys.hysteresis),
    }
}

/// The keys that do not have their default, with the name of their table.
pub(super) fn changed(keys: &PartitionKeys) -> Vec<String> {
    let [given, usual] =
        [keys, &PartitionKeys::default()].map(|keys| serde_json::to_value(keys).expect("plain values"));
    let given = given.as_object().into_iter().flatten();
    given.filter(|(key, value)| usual[key.as_str()] != **value).map(|(key, _)| format!("partition.{key}")).collect()
}
