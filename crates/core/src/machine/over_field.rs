//! An error of the lens over its field: one value for all of it, or one by the distance from the optical axis.

use std::marker::PhantomData;

use serde::de::value::{SeqAccessDeserializer, StrDeserializer};
use serde::{Deserialize, Serialize};

use crate::units::{Length, Quantity};

/// A value over the field.
#[derive(Clone, Debug, PartialEq, Serialize, schemars::JsonSchema)]
#[serde(untagged)]
pub enum OverField<Q> {
    /// The largest over the whole field.
    Whole(Q),
    /// Distances from the optical axis, growing from 0, and the largest value there; in straight lines between them.
    ByDistance(Vec<(Length, Q)>),
}

impl<Q: Quantity> OverField<Q> {
    /// The largest value no farther from the optical axis than this, mm, in the base unit of the quantity.
    pub fn largest_within(&self, mm: f64) -> f64 {
        let list = match self {
            Self::Whole(value) => return value.base(),
            Self::ByDistance(list) => list,
        };
        let mut largest = 0.0f64;
        let mut before: Option<(f64, f64)> = None;
        for (at, value) in list.iter().map(|(at, value)| (at.as_mm(), value.base())) {
            if at > mm {
                if let Some((from, low)) = before {
                    largest = largest.max(low + (value - low) * (mm - from) / (at - from));
                }
                break;
            }
            largest = largest.max(value);
            before = Some((at, value));
        }
        largest
    }

    /// All values.
    pub fn values(&self) -> Vec<Q> {
        match self {
            Self::Whole(value) => vec![*value],
            Self::ByDistance(list) => list.iter().map(|(_, value)| *value).collect(),
        }
    }

    /// What is wrong with its distances, for a field whose farthest place lies so far from the axis, mm.
    pub fn fault(&self, farthest: f64) -> Option<String> {
        let Self::ByDistance(list) = self else { return None };
        let mm: Vec<f64> = list.iter().map(|(at, _)| at.as_mm()).collect();
        if mm.first() != Some(&0.0) || mm.windows(2).any(|w| w[0] >= w[1]) {
            return Some("its distances do not grow from \"0 mm\"".into());
        }
        let last = mm.last().copied().unwrap_or_default();
        // Tables are printed with few digits.
        let is_short = last < farthest - 0.01;
        is_short
            .then(|| format!("its last distance is {last} mm, but the field reaches {farthest:.3} mm from the axis"))
    }
}

impl<'de, Q: Quantity + Deserialize<'de>> Deserialize<'de> for OverField<Q> {
    fn deserialize<D: serde::Deserializer<'de>>(d: D) -> Result<Self, D::Error> {
        struct Visitor<Q>(PhantomData<Q>);
        impl<'de, Q: Quantity + Deserialize<'de>> serde::de::Visitor<'de> for Visitor<Q> {
            type Value = OverField<Q>;

            fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                let value = Q::EXAMPLE;
                write!(
                    f,
                    "a value such as {value:?}, or a list such as [[\"0 mm\", {value:?}], [\"30 mm\", {value:?}]]"
                )
            }
            fn visit_str<E: serde::de::Error>(self, text: &str) -> Result<OverField<Q>, E> {
                not_negative(Q::deserialize(StrDeserializer::new(text))?).map(OverField::Whole)
            }
            fn visit_seq<A: serde::de::SeqAccess<'de>>(self, seq: A) -> Result<OverField<Q>, A::Error> {
                let list: Vec<(Length, Q)> = Deserialize::deserialize(SeqAccessDeserializer::new(seq))?;
                list.iter().try_for_each(|(_, value)| not_negative(*value).map(drop))?;
                Ok(OverField::ByDistance(list))
            }
        }
        d.deserialize_any(Visitor(PhantomData))
    }
}

fn not_negative<Q: Quantity, E: serde::de::Error>(value: Q) -> Result<Q, E> {
    if value.base() >= 0.0 { Ok(value) } else { Err(E::custom("must not be negative")) }
}

/// Reads a key that may be absent or, in JSON, null.
pub(super) fn option<'de, D, Q>(d: D) -> Result<Option<OverField<Q>>, D::Error>
where
    D: serde::Deserializer<'de>,
    Q: Quantity + Deserialize<'de>,
{
    Option::deserialize(d)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Deserialize, Serialize)]
    struct Lens {
        residual: OverField<Length>,
    }

    fn read(text: &str) -> Result<OverField<Length>, String> {
        toml::from_str::<Lens>(text).map(|lens| lens.residual).map_err(|e| e.message().to_owned())
    }

    #[test]
    fn the_largest_value_within_a_distance_is_that_of_the_lines_between_the_points() {
        let whole = read("residual = \"5 um\"").expect("a length");
        assert_eq!(whole.largest_within(3.0), 0.005);
        let list = read(
            "residual = [[\"0 mm\", \"2 um\"], [\"10 mm\", \"8 um\"], [\"20 mm\", \"4 um\"], [\"30 mm\", \"20 um\"]]",
        );
        let list = list.expect("a list");
        for (mm, um) in [(0.0, 2.0), (5.0, 5.0), (10.0, 8.0), (15.0, 8.0), (25.0, 12.0), (30.0, 20.0), (31.0, 20.0)] {
            assert!((list.largest_within(mm) - um / 1e3).abs() < 1e-12, "{mm}");
        }
        for value in [whole, list] {
            let text = toml::to_string(&Lens { residual: value.clone() }).expect("TOML");
            assert_eq!(read(&text), Ok(value), "{text}");
        }
    }

    #[test]
    fn lists_that_do_not_cover_the_field_are_faults() {
        let fault = |text: &str| read(text).expect("a list").fault(28.28);
        assert_eq!(fault("residual = \"5 um\""), None);
        assert_eq!(fault("residual = [[\"0 mm\", \"2 um\"], [\"28.3 mm\", \"8 um\"]]"), None);
        for (text, why) in [
            ("residual = [[\"0 mm\", \"2 um\"], [\"20 mm\", \"8 um\"]]", "28.28"),
            ("residual = [[\"1 mm\", \"2 um\"], [\"30 mm\", \"8 um\"]]", "grow"),
            ("residual = [[\"0 mm\", \"2 um\"], [\"0 mm\", \"8 um\"]]", "grow"),
            ("residual = []", "grow"),
        ] {
            assert!(fault(text).is_some_and(|t| t.contains(why)), "{text}");
        }
        for (text, why) in [
            ("residual = 5", "a value such as"),
            ("residual = \"-1 um\"", "negative"),
            ("residual = [[\"0 mm\", \"-2 um\"]]", "negative"),
            ("residual = [[\"0 mm\"]]", "invalid length"),
        ] {
            let found = read(text).expect_err(text);
            assert!(found.contains(why), "{text}: {found}");
        }
    }
}
