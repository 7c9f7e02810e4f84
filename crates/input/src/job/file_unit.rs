//! The unit of a file that states none.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Unit of a surface file or a drawing that carries none.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize, JsonSchema)]
pub enum FileUnit {
    /// Millimetre.
    #[serde(rename = "mm")]
    Millimetre,
    /// Centimetre.
    #[serde(rename = "cm")]
    Centimetre,
    /// Metre.
    #[serde(rename = "m")]
    Metre,
    /// Inch.
    #[serde(rename = "in")]
    Inch,
    /// Micrometre.
    #[serde(rename = "um")]
    Micrometre,
}

impl FileUnit {
    /// All of them.
    pub const ALL: [Self; 5] = [Self::Millimetre, Self::Centimetre, Self::Metre, Self::Inch, Self::Micrometre];

    /// The name in files and on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Millimetre => "mm",
            Self::Centimetre => "cm",
            Self::Metre => "m",
            Self::Inch => "in",
            Self::Micrometre => "um",
        }
    }
    /// Millimetres in one unit.
    pub fn in_mm(self) -> f64 {
        match self {
            Self::Millimetre => 1.0,
            Self::Centimetre => 10.0,
            Self::Metre => 1000.0,
            Self::Inch => 25.4,
            Self::Micrometre => 1e-3,
        }
    }
}
