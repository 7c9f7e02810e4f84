//! Quantities as people write them: `"0.07 mm"`, `"1000 mm/s"`, `"60 %"`.
//!
//! Every quantity is held in one base unit (mm, deg, s, mm/s, mm/s², mm/s³, deg/s and so on, kHz) and is built and
//! read by unit, so that no number changes meaning between the job file and a kernel. Text always
//! carries a unit; a bare number is refused, because units are the commonest import fault of all.

use std::borrow::Cow;
use std::fmt;
use std::str::FromStr;

use crate::geom::Nm;
use serde::de::{self, Deserializer, Visitor};
use serde::{Deserialize, Serialize, Serializer};

/// What every quantity can do; the generic checks of the job file are written against it.
pub trait Quantity: Copy + FromStr<Err = String> {
    /// The value in the base unit of the quantity.
    fn base(self) -> f64;
    /// A unit that a message may propose.
    const EXAMPLE: &'static str;
}

macro_rules! quantity {
    ($(#[$doc:meta])* $name:ident, $what:literal, $base:literal, $example:literal,
     [$($unit:literal => $factor:expr),+ $(,)?]) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq, PartialOrd, Default)]
        pub struct $name(f64);

        impl Quantity for $name {
            fn base(self) -> f64 { self.0 }
            const EXAMPLE: &'static str = $example;
        }

        impl FromStr for $name {
            type Err = String;
            fn from_str(text: &str) -> Result<Self, String> {
                let (number, unit) = number_and_unit(text, $what, $example)?;
                match unit {
                    $($unit => Ok(Self(in_base(number, $factor))),)+
                    "" => Err(format!(
                        "{} {text:?} has no unit; write it as {:?}", $what, $example)),
                    other => Err(unknown_unit(other, &article($what), &[$($unit),+])),
                }
            }
        }

        impl fmt::Display for $name {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                write!(f, "{} {}", self.0, $base)
            }
        }

        impl Serialize for $name {
            fn serialize<S: Serializer>(&self, s: S) -> Result<S::Ok, S::Error> {
                s.collect_str(self)
            }
        }

        impl<'de> Deserialize<'de> for $name {
            fn deserialize<D: Deserializer<'de>>(d: D) -> Result<Self, D::Error> {
                quantity_from_text(d, $what, $example)
            }
        }

        impl schemars::JsonSchema for $name {
            fn schema_name() -> Cow<'static, str> { stringify!($name).into() }
            fn json_schema(_: &mut schemars::SchemaGenerator) -> schemars::Schema {
                schemars::json_schema!({
                    "type": "string",
                    "description": format!("Text: {} with its unit, for example {:?}.", article($what), $example),
                    "pattern": pattern(&[$($unit),+]),
                    "examples": [$example],
                    "x-value": $what,
                })
            }
        }
    };
}

quantity!(
    /// A length; base unit mm.
    Length, "length", "mm", "0.07 mm",
    ["nm" => 1e-6, "um" => 1e-3, "µm" => 1e-3, "μm" => 1e-3, "mm" => 1.0, "cm" => 10.0, "m" => 1e3,
     "in" => 25.4, "inch" => 25.4]);
quantity!(
    /// An angle; base unit deg, so that what is written in degrees is shown as written.
    Angle, "angle", "deg", "10 deg",
    ["deg" => 1.0, "°" => 1.0, "rad" => 180.0 / std::f64::consts::PI]);
quantity!(
    /// A duration; base unit s.
    Time, "time", "s", "0.1 s",
    ["us" => 1e-6, "µs" => 1e-6, "μs" => 1e-6, "ms" => 1e-3, "s" => 1.0, "min" => 60.0]);
quantity!(
    /// A speed; base unit mm/s.
    Speed, "speed", "mm/s", "1000 mm/s",
    ["mm/s" => 1.0, "m/s" => 1e3, "mm/min" => 1.0 / 60.0, "m/min" => 1e3 / 60.0]);
quantity!(
    /// An acceleration; base unit mm/s².
    Acceleration, "acceleration", "mm/s2", "2000 mm/s2",
    ["mm/s2" => 1.0, "mm/s²" => 1.0, "m/s2" => 1e3, "m/s²" => 1e3]);
quantity!(
    /// A jerk; base unit mm/s³.
    Jerk, "jerk", "mm/s3", "20000 mm/s3",
    ["mm/s3" => 1.0, "mm/s³" => 1.0, "m/s3" => 1e3, "m/s³" => 1e3]);
quantity!(
    /// An angular speed; base unit deg/s.
    AngularSpeed, "angular speed", "deg/s", "20 deg/s",
    ["deg/s" => 1.0, "°/s" => 1.0, "rad/s" => 180.0 / std::f64::consts::PI, "1/min" => 6.0, "rpm" => 6.0]);
quantity!(
    /// An angular acceleration; base unit deg/s².
    AngularAcceleration, "angular acceleration", "deg/s2", "100 deg/s2",
    ["deg/s2" => 1.0, "deg/s²" => 1.0, "rad/s2" => 180.0 / std::f64::consts::PI,
     "rad/s²" => 180.0 / std::f64::consts::PI]);
quantity!(
    /// An angular jerk; base unit deg/s³.
    AngularJerk, "angular jerk", "deg/s3", "1000 deg/s3",
    ["deg/s3" => 1.0, "deg/s³" => 1.0, "rad/s3" => 180.0 / std::f64::consts::PI,
     "rad/s³" => 180.0 / std::f64::consts::PI]);
quantity!(
    /// A repetition rate; base unit kHz.
    Frequency, "frequency", "kHz", "60 kHz",
    ["Hz" => 1e-3, "kHz" => 1.0, "MHz" => 1e3]);
quantity!(
    /// An absolute laser power; base unit W. What a pen asks for is a [`Power`].
    Watts, "power", "W", "14 W",
    ["mW" => 1e-3, "W" => 1.0, "kW" => 1e3]);
quantity!(
    /// A voltage; base unit V.
    Voltage, "voltage", "V", "50 V",
    ["mV" => 1e-3, "V" => 1.0, "kV" => 1e3]);
quantity!(
    /// An inductance; base unit mH.
    Inductance, "inductance", "mH", "14 mH",
    ["uH" => 1e-3, "µH" => 1e-3, "mH" => 1.0, "H" => 1e3]);
quantity!(
    /// A force constant of a motor; base unit N/A.
    ForceConstant, "force constant", "N/A", "60 N/A",
    ["N/A" => 1.0]);
quantity!(
    /// A mass; base unit kg.
    Mass, "mass", "kg", "1.6 kg",
    ["g" => 1e-3, "kg" => 1.0]);

quantity!(
    /// A length summed up over time; base unit mm s.
    LengthTime, "sum of a length over time", "mm s", "0.02 mm s",
    ["um s" => 1e-3, "mm s" => 1.0]);

impl LengthTime {
    /// A sum of `v` mm s.
    pub const fn mm_s(v: f64) -> Self {
        Self(v)
    }
    /// The sum in mm s.
    pub const fn as_mm_s(self) -> f64 {
        self.0
    }
}

quantity!(
    /// A share of a whole; base unit %.
    Share, "share", "%", "50 %",
    ["%" => 1.0]);

impl Share {
    /// A share of `v` percent.
    pub const fn percent(v: f64) -> Self {
        Self(v)
    }
    /// The share in percent.
    pub const fn as_percent(self) -> f64 {
        self.0
    }
}

/// Units as they are written out or abbreviated elsewhere.
const WRITTEN_OUT: [(&str, &str); 22] = [
    ("millimetre", "mm"),
    ("millimeter", "mm"),
    ("micrometre", "um"),
    ("micrometer", "um"),
    ("micron", "um"),
    ("centimetre", "cm"),
    ("centimeter", "cm"),
    ("metre", "m"),
    ("meter", "m"),
    ("inche", "inch"),
    ("\"", "inch"),
    ("degree", "deg"),
    ("second", "s"),
    ("sec", "s"),
    ("millisecond", "ms"),
    ("msec", "ms"),
    ("microsecond", "us"),
    ("minute", "min"),
    ("percent", "%"),
    ("pct", "%"),
    ("watt", "W"),
    ("hertz", "Hz"),
];

/// What is said of a unit that is not among the known ones.
fn unknown_unit(unit: &str, article: &str, known: &[&str]) -> String {
    let meant = meant(unit, known).map(|meant| format!("did you mean {meant}? ")).unwrap_or_default();
    format!("unknown unit {unit:?} for {article}; {meant}known units: {}", known.join(", "))
}

/// The unit that is written with other case, or written out.
pub(crate) fn meant<'a>(unit: &str, known: &[&'a str]) -> Option<&'a str> {
    let short = |part: &str| {
        let word = part.trim().to_lowercase();
        let singular = word.strip_suffix('s').filter(|rest| rest.len() > 2).unwrap_or(&word).to_owned();
        let found = WRITTEN_OUT.iter().find(|(long, _)| *long == word || *long == singular);
        found.map_or(word, |(_, short)| short.to_lowercase())
    };
    let plain = unit.replace(" per ", "/").split('/').map(short).collect::<Vec<_>>().join("/");
    let mut equal = known.iter().filter(|one| one.to_lowercase() == plain);
    // Where case tells units apart, none is meant.
    let first = equal.next().copied();
    if equal.next().is_some() { None } else { first }
}

/// A number of units, each `factor` base units. Parts of the base unit divide, so that 200 us are 0.0002 s to the last
/// digit.
fn in_base(number: f64, factor: f64) -> f64 {
    let parts = (1.0 / factor).round();
    if factor < 1.0 && (parts * factor - 1.0).abs() < 1e-12 { number / parts } else { number * factor }
}

impl Length {
    /// A length of `v` mm.
    pub const fn mm(v: f64) -> Self {
        Self(v)
    }
    /// A length of `v` µm.
    pub const fn um(v: f64) -> Self {
        Self(v / 1e3)
    }
    /// The length in mm.
    pub const fn as_mm(self) -> f64 {
        self.0
    }
    /// The length in nm, rounded to the nearest; None beyond ±4 m, where no part of ours lies.
    pub fn as_nm(self) -> Option<Nm> {
        Nm::from_mm(self.0)
    }
}

impl Angle {
    /// An angle of `v` degrees.
    pub const fn deg(v: f64) -> Self {
        Self(v)
    }
    /// The angle in rad.
    pub const fn as_rad(self) -> f64 {
        self.0.to_radians()
    }
    /// The angle in degrees.
    pub const fn as_deg(self) -> f64 {
        self.0
    }
}

impl Time {
    /// A duration of `v` s.
    pub const fn s(v: f64) -> Self {
        Self(v)
    }
    /// A duration of `v` µs.
    pub const fn us(v: f64) -> Self {
        Self(v / 1e6)
    }
    /// The duration in s.
    pub const fn as_s(self) -> f64 {
        self.0
    }
    /// The duration in µs.
    pub fn as_us(self) -> f64 {
        self.0 * 1e6
    }
}

impl Speed {
    /// A speed of `v` mm/s.
    pub const fn mm_s(v: f64) -> Self {
        Self(v)
    }
    /// The speed in mm/s.
    pub const fn as_mm_s(self) -> f64 {
        self.0
    }
}

impl Acceleration {
    /// The acceleration in mm/s².
    pub const fn as_mm_s2(self) -> f64 {
        self.0
    }
}

impl Jerk {
    /// The jerk in mm/s³.
    pub const fn as_mm_s3(self) -> f64 {
        self.0
    }
}

impl AngularSpeed {
    /// The speed in rad/s.
    pub const fn as_rad_s(self) -> f64 {
        self.0.to_radians()
    }
}

impl AngularAcceleration {
    /// The acceleration in rad/s².
    pub const fn as_rad_s2(self) -> f64 {
        self.0.to_radians()
    }
}

impl AngularJerk {
    /// The jerk in rad/s³.
    pub const fn as_rad_s3(self) -> f64 {
        self.0.to_radians()
    }
}

impl Frequency {
    /// A rate of `v` kHz.
    pub const fn khz(v: f64) -> Self {
        Self(v)
    }
    /// The rate in kHz.
    pub const fn as_khz(self) -> f64 {
        self.0
    }
}

impl Voltage {
    /// The voltage in V.
    pub(crate) const fn as_v(self) -> f64 {
        self.0
    }
}

impl Inductance {
    /// The inductance in H.
    pub(crate) const fn as_h(self) -> f64 {
        self.0 * 1e-3
    }
}

impl ForceConstant {
    /// The force constant in N/A.
    pub(crate) const fn as_n_a(self) -> f64 {
        self.0
    }
}

impl Mass {
    /// The mass in kg.
    pub(crate) const fn as_kg(self) -> f64 {
        self.0
    }
}

impl Watts {
    /// A power of `v` W.
    pub const fn w(v: f64) -> Self {
        Self(v)
    }
    /// The power in W.
    pub const fn as_w(self) -> f64 {
        self.0
    }
}

/// Laser power: percent of the machine's `max_power`, or W.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Power {
    /// Percent of the machine's `laser.max_power`, 0 to 100.
    Percent(f64),
    /// Absolute power.
    Absolute(Watts),
}

impl Power {
    /// The power in W, given the machine's full power in W.
    pub fn as_w(self, max_power: Watts) -> f64 {
        match self {
            Self::Percent(p) => max_power.as_w() * p / 100.0,
            Self::Absolute(w) => w.as_w(),
        }
    }
    /// The share of the machine's full power, 0 to 1.
    pub fn share(self, max_power: Watts) -> f64 {
        self.as_w(max_power) / max_power.as_w()
    }
}

impl FromStr for Power {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        let (number, unit) = number_and_unit(text, "power", "60 %")?;
        match unit {
            "%" if (0.0..=100.0).contains(&number) => Ok(Self::Percent(number)),
            "%" => Err(format!("power {text:?} is not between 0 % and 100 %")),
            _ if number < 0.0 => Err(format!("power {text:?} is negative")),
            "mW" | "W" | "kW" => text.parse().map(Self::Absolute),
            "" => Err(format!("power {text:?} has no unit; write it as \"60 %\" or \"14 W\"")),
            other => Err(unknown_unit(other, "a power", &["%", "mW", "W", "kW"])),
        }
    }
}

impl fmt::Display for Power {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Percent(p) => write!(f, "{p} %"),
            Self::Absolute(w) => w.fmt(f),
        }
    }
}

impl Serialize for Power {
    fn serialize<S: Serializer>(&self, s: S) -> Result<S::Ok, S::Error> {
        s.collect_str(self)
    }
}

impl<'de> Deserialize<'de> for Power {
    fn deserialize<D: Deserializer<'de>>(d: D) -> Result<Self, D::Error> {
        quantity_from_text(d, "power", "60 %")
    }
}

impl schemars::JsonSchema for Power {
    fn schema_name() -> Cow<'static, str> {
        "Power".into()
    }
    fn json_schema(_: &mut schemars::SchemaGenerator) -> schemars::Schema {
        schemars::json_schema!({
            "type": "string",
            "description": "A power in percent of the machine's max_power or in W, for example \"60 %\" or \"8.4 W\".",
            "pattern": pattern(&["%", "mW", "W", "kW"]),
            "examples": ["60 %", "8.4 W"],
            "x-value": "power",
        })
    }
}

/// The regular expression of a number with one of these units, for JSON schemas.
fn pattern(units: &[&str]) -> String {
    format!("^\\s*[-+]?([0-9]+[.]?[0-9]*|[.][0-9]+)([eE][-+]?[0-9]+)?\\s*({})\\s*$", units.join("|"))
}

/// What a quantity is, after its article.
fn article(what: &str) -> String {
    let article = if what.starts_with(['a', 'e', 'i', 'o', 'u']) { "an" } else { "a" };
    format!("{article} {what}")
}

/// Splits "12.5 mm" into its number and its unit. Refuses what is not finite, and decimal commas.
pub(crate) fn number_and_unit<'a>(text: &'a str, what: &str, example: &str) -> Result<(f64, &'a str), String> {
    let text = text.trim();
    let end = text
        .char_indices()
        .find(|&(i, c)| {
            let exponent = matches!(c, 'e' | 'E')
                && text[i + 1..].starts_with(|d: char| d.is_ascii_digit() || d == '-' || d == '+');
            !(c.is_ascii_digit() || matches!(c, '+' | '-' | '.') || exponent)
        })
        .map_or(text.len(), |(i, _)| i);
    let (number, unit) = text.split_at(end);
    if unit.starts_with(',') {
        return Err(format!("{text:?} has a decimal comma; write a point, as in {example:?}"));
    }
    let value: f64 =
        number.parse().map_err(|_| format!("{text:?} is not {}; write it as {example:?}", article(what)))?;
    if !value.is_finite() {
        return Err(format!("{text:?} is not a finite {what}"));
    }
    Ok((value, unit.trim()))
}

/// Reads a quantity, or what else can be read from text.
pub fn quantity_from_text<'de, D, T>(d: D, what: &'static str, example: &'static str) -> Result<T, D::Error>
where
    D: Deserializer<'de>,
    T: FromStr<Err = String>,
{
    struct Text<T>(&'static str, &'static str, std::marker::PhantomData<T>);
    impl<T: FromStr<Err = String>> Visitor<'_> for Text<T> {
        type Value = T;
        fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            write!(f, "{} as text with its unit, such as {:?}", article(self.0), self.1)
        }
        fn visit_str<E: de::Error>(self, text: &str) -> Result<T, E> {
            text.parse().map_err(E::custom)
        }
        fn visit_i64<E: de::Error>(self, v: i64) -> Result<T, E> {
            Err(E::custom(format!("{} {v} has no unit; write it as text, such as {:?}", self.0, self.1)))
        }
        fn visit_f64<E: de::Error>(self, v: f64) -> Result<T, E> {
            Err(E::custom(format!("{} {v} has no unit; write it as text, such as {:?}", self.0, self.1)))
        }
    }
    d.deserialize_any(Text(what, example, std::marker::PhantomData))
}

/// For `#[serde(deserialize_with)]`: a quantity that must be greater than zero.
pub fn positive<'de, D: Deserializer<'de>, Q: Quantity + Deserialize<'de>>(d: D) -> Result<Q, D::Error> {
    above_zero(Q::deserialize(d)?)
}

fn above_zero<E: de::Error, Q: Quantity>(q: Q) -> Result<Q, E> {
    if q.base() > 0.0 { Ok(q) } else { Err(E::custom(format!("must be greater than zero, such as {:?}", Q::EXAMPLE))) }
}

/// Reads a positive quantity from a field that may be absent.
pub fn positive_option<'de, D: Deserializer<'de>, Q: Quantity + Deserialize<'de>>(d: D) -> Result<Option<Q>, D::Error> {
    // JSON writes what is absent as null.
    Option::<Q>::deserialize(d)?.map(above_zero).transpose()
}

/// For `#[serde(deserialize_with)]`: a quantity that must not be negative.
pub fn non_negative<'de, D: Deserializer<'de>, Q: Quantity + Deserialize<'de>>(d: D) -> Result<Q, D::Error> {
    let q = Q::deserialize(d)?;
    if q.base() >= 0.0 { Ok(q) } else { Err(de::Error::custom("must not be negative")) }
}

/// Reads a quantity that is not negative from a field that may be absent.
pub fn non_negative_option<'de, D: Deserializer<'de>, Q: Quantity + Deserialize<'de>>(
    d: D,
) -> Result<Option<Q>, D::Error> {
    let q = Option::<Q>::deserialize(d)?;
    if q.is_none_or(|q| q.base() >= 0.0) { Ok(q) } else { Err(de::Error::custom("must not be negative")) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_scale_to_the_base_unit() {
        for (text, mm) in [("0.07mm", 0.07), ("70 um", 0.07), ("2in", 50.8), ("1e-3 m", 1.0), ("-5 mm", -5.0)] {
            let l: Length = text.parse().expect(text);
            assert!((l.as_mm() - mm).abs() < 1e-12, "{text}");
        }
        for (text, seconds) in [("200 us", "0.0002 s"), ("3 ms", "0.003 s"), ("0.3 us", "0.0000003 s")] {
            assert_eq!(text.parse::<Time>().expect(text).to_string(), seconds);
        }
        assert_eq!("6100 mm/min".parse::<Speed>().expect("mm/min").to_string(), format!("{} mm/s", 6100.0 / 60.0));
        assert!(("90 deg".parse::<Angle>().expect("deg").as_rad() - std::f64::consts::FRAC_PI_2).abs() < 1e-15);
        let thirty: Angle = "30 deg".parse().expect("deg");
        assert_eq!((thirty.as_deg(), thirty.to_string()), (30.0, "30 deg".to_owned()));
        assert_eq!("60 %".parse(), Ok(Power::Percent(60.0)));
        assert_eq!("8 W".parse(), Ok(Power::Absolute(Watts::w(8.0))));
    }

    #[test]
    fn text_without_a_usable_number_or_unit_is_refused() {
        for (text, say) in [
            ("0.07", "no unit"),
            ("0,07 mm", "decimal comma"),
            ("7 parsec", "unknown unit \"parsec\" for a length; known units: nm"),
            ("7 MM", "; did you mean mm? known units: nm"),
            ("7 millimetres", "; did you mean mm? known"),
            ("7 microns", "; did you mean um? known"),
            ("mm", "is not a length"),
            ("1e999 mm", "not a finite"),
            ("", "is not a length"),
        ] {
            let err = text.parse::<Length>().expect_err(text);
            assert!(err.contains(say), "{text}: {err}");
        }
        assert!("7 mm/sec".parse::<Speed>().is_err_and(|e| e.contains("did you mean mm/s?")));
        assert!("7 mm per second".parse::<Speed>().is_err_and(|e| e.contains("did you mean mm/s?")));
        assert!("60 percent".parse::<Power>().is_err_and(|e| e.contains("did you mean %? known units: %, mW")));
        assert!("60".parse::<Power>().is_err_and(|e| e.contains("write it as \"60 %\" or")));
        assert!("140 %".parse::<Power>().is_err());
        assert!("deg".parse::<Angle>().is_err_and(|e| e.contains("is not an angle")));
    }
}
