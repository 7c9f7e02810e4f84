//! How long the stage settles after a move, by the axes that have moved.

use serde::de::value::{MapAccessDeserializer, StrDeserializer};
use serde::{Deserialize, Serialize};

use crate::units::{Time, non_negative};

/// Waiting times after a move.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, schemars::JsonSchema)]
#[serde(untagged)]
pub enum Settling {
    /// The same after every move.
    Every(Time),
    /// By the axes that have moved.
    ByAxis(AxisSettling),
}

/// Waiting times by axis.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct AxisSettling {
    /// After a move of x or y.
    #[serde(deserialize_with = "non_negative")]
    pub xy: Time,
    /// After a move of z.
    #[serde(deserialize_with = "non_negative")]
    pub z: Time,
}

impl Settling {
    /// The settling time of x and y, and that of z.
    pub fn by_axis(self) -> [Time; 2] {
        match self {
            Self::Every(time) => [time; 2],
            Self::ByAxis(AxisSettling { xy, z }) => [xy, z],
        }
    }

    /// After a move of x or y, of z, or of both, s: they settle together.
    pub fn after(self, moves_xy: bool, moves_z: bool) -> f64 {
        let [xy, z] = self.by_axis().map(Time::as_s);
        (if moves_xy { xy } else { 0.0 }).max(if moves_z { z } else { 0.0 })
    }

    /// After a move of all axes, s.
    pub fn longest(self) -> f64 {
        self.after(true, true)
    }
}

impl Default for Settling {
    fn default() -> Self {
        Self::Every(Time::default())
    }
}

impl<'de> Deserialize<'de> for Settling {
    fn deserialize<D: serde::Deserializer<'de>>(d: D) -> Result<Self, D::Error> {
        struct Visitor;
        impl<'de> serde::de::Visitor<'de> for Visitor {
            type Value = Settling;

            fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str("a time such as \"100 ms\", or { xy = \"100 ms\", z = \"40 ms\" }")
            }
            fn visit_str<E: serde::de::Error>(self, text: &str) -> Result<Settling, E> {
                non_negative(StrDeserializer::new(text)).map(Settling::Every)
            }
            fn visit_map<A: serde::de::MapAccess<'de>>(self, map: A) -> Result<Settling, A::Error> {
                AxisSettling::deserialize(MapAccessDeserializer::new(map)).map(Settling::ByAxis)
            }
        }
        d.deserialize_any(Visitor)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Deserialize, Serialize)]
    struct Stage {
        settle: Settling,
    }

    fn read(text: &str) -> Result<Settling, String> {
        toml::from_str::<Stage>(text).map(|stage| stage.settle).map_err(|e| e.message().to_owned())
    }

    #[test]
    fn one_time_is_that_of_every_move_and_two_are_those_of_the_axes() {
        let one = read("settle = \"0.1 s\"").expect("a time");
        assert_eq!((one.after(true, false), one.after(false, true), one.longest()), (0.1, 0.1, 0.1));
        let two = read("settle = { xy = \"0.1 s\", z = \"40 ms\" }").expect("two times");
        assert_eq!((two.after(true, false), two.after(false, true), two.longest()), (0.1, 0.04, 0.1));
        assert_eq!(two.after(false, false), 0.0);
        for settling in [one, two] {
            let text = toml::to_string(&Stage { settle: settling }).expect("a table");
            assert_eq!(read(&text), Ok(settling), "{text}");
        }
    }

    #[test]
    fn other_settling_times_are_refused() {
        for (text, why) in [
            ("settle = \"-1 s\"", "negative"),
            ("settle = { xy = \"1 s\", z = \"-1 s\" }", "negative"),
            ("settle = { xy = \"1 s\" }", "missing field `z`"),
            ("settle = { xy = \"1 s\", z = \"1 s\", x = \"1 s\" }", "unknown field `x`"),
            ("settle = 1", "a time such as"),
        ] {
            let fault = read(text).expect_err(text);
            assert!(fault.contains(why), "{text}: {fault}");
        }
    }
}
