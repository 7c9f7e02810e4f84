//! The direction of a hatch: an angle, or along contours.

use std::borrow::Cow;
use std::str::FromStr;

use schemars::JsonSchema;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use terrace_core::units::{Angle, quantity_from_text};

/// Direction of a hatch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Direction {
    /// From +x, counter-clockwise.
    Angle(Angle),
    /// `"contour"`: in every section that of the level lines.
    Contour,
}

impl Default for Direction {
    fn default() -> Self {
        Self::Angle(Angle::default())
    }
}

impl Direction {
    const CONTOUR: &str = "contour";
}

impl FromStr for Direction {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        if text == Self::CONTOUR {
            return Ok(Self::Contour);
        }
        text.parse().map(Self::Angle).map_err(|e| format!("{e}; or write \"contour\""))
    }
}

impl Serialize for Direction {
    fn serialize<S: Serializer>(&self, s: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Angle(angle) => angle.serialize(s),
            Self::Contour => s.serialize_str(Self::CONTOUR),
        }
    }
}

impl<'de> Deserialize<'de> for Direction {
    fn deserialize<D: Deserializer<'de>>(d: D) -> Result<Self, D::Error> {
        quantity_from_text(d, "direction", "30 deg")
    }
}

impl JsonSchema for Direction {
    fn schema_name() -> Cow<'static, str> {
        "Direction".into()
    }
    fn json_schema(_: &mut schemars::SchemaGenerator) -> schemars::Schema {
        schemars::json_schema!({
            "type": "string",
            "description": "An angle with its unit, for example \"30 deg\", or \"contour\".",
            "examples": ["30 deg", "contour"],
            "x-value": "angle, or \"contour\"",
        })
    }
}
