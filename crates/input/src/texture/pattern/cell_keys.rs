//! The keys of patterns of cells: closed loops on a lattice, such as FSS elements.

use schemars::JsonSchema;
use serde::Deserialize;

use super::{Fault, Keys, needs_room};
use crate::texture::kind::{Kind, Lattice, Shape};
use terrace_core::units::{Length, positive};

/// Square loops on a lattice (FSS cells).
#[derive(Clone, Debug, Deserialize, JsonSchema)]
pub(crate) struct SquaresKeys {
    /// Distance between centres.
    #[schemars(example = &"0.5 mm")]
    #[serde(deserialize_with = "positive")]
    pub pitch: Length,
    /// Side.
    #[schemars(example = &"0.6 mm")]
    #[serde(deserialize_with = "positive")]
    pub cell: Length,
    /// How the centres lie.
    #[serde(default)]
    pub lattice: Lattice,
}

impl Keys for SquaresKeys {
    fn kind(&self, _: u64) -> Kind {
        cells(Shape::Square, [self.cell, self.pitch], self.lattice)
    }

    fn faults(&self) -> Vec<Fault> {
        needs_room(self.cell, self.pitch)
    }
}

/// Circles on a lattice (FSS cells).
#[derive(Clone, Debug, Deserialize, JsonSchema)]
pub(crate) struct CirclesKeys {
    /// Distance between centres.
    #[schemars(example = &"0.5 mm")]
    #[serde(deserialize_with = "positive")]
    pub pitch: Length,
    /// Diameter.
    #[schemars(example = &"0.6 mm")]
    #[serde(deserialize_with = "positive")]
    pub cell: Length,
    /// How the centres lie.
    #[serde(default)]
    pub lattice: Lattice,
}

impl Keys for CirclesKeys {
    fn kind(&self, _: u64) -> Kind {
        cells(Shape::Circle, [self.cell, self.pitch], self.lattice)
    }

    fn faults(&self) -> Vec<Fault> {
        needs_room(self.cell, self.pitch)
    }
}

/// Hexagonal loops on a lattice (FSS cells).
#[derive(Clone, Debug, Deserialize, JsonSchema)]
pub(crate) struct HexagonsKeys {
    /// Distance between centres.
    #[schemars(example = &"0.5 mm")]
    #[serde(deserialize_with = "positive")]
    pub pitch: Length,
    /// Width across flats.
    #[schemars(example = &"0.6 mm")]
    #[serde(deserialize_with = "positive")]
    pub cell: Length,
    /// How the centres lie.
    #[serde(default = "hexagonal")]
    pub lattice: Lattice,
}

impl Keys for HexagonsKeys {
    fn kind(&self, _: u64) -> Kind {
        cells(Shape::Hexagon, [self.cell, self.pitch], self.lattice)
    }

    fn faults(&self) -> Vec<Fault> {
        needs_room(self.cell, self.pitch)
    }
}

/// Outlines of crosses on a lattice (FSS cells).
#[derive(Clone, Debug, Deserialize, JsonSchema)]
pub(crate) struct CrossesKeys {
    /// Distance between centres.
    #[schemars(example = &"0.5 mm")]
    #[serde(deserialize_with = "positive")]
    pub pitch: Length,
    /// Width from tip to tip.
    #[schemars(example = &"0.6 mm")]
    #[serde(deserialize_with = "positive")]
    pub cell: Length,
    /// Width of the arms.
    #[schemars(example = &"0.1 mm")]
    #[serde(deserialize_with = "positive")]
    pub width: Length,
    /// How the centres lie.
    #[serde(default)]
    pub lattice: Lattice,
}

impl Keys for CrossesKeys {
    fn kind(&self, _: u64) -> Kind {
        cells(Shape::Cross { width_mm: self.width.as_mm() }, [self.cell, self.pitch], self.lattice)
    }

    fn faults(&self) -> Vec<Fault> {
        needs_room(self.cell, self.pitch)
    }
}

/// Outlines of Jerusalem crosses on a lattice (FSS cells).
#[derive(Clone, Debug, Deserialize, JsonSchema)]
pub(crate) struct JerusalemKeys {
    /// Distance between centres.
    #[schemars(example = &"0.5 mm")]
    #[serde(deserialize_with = "positive")]
    pub pitch: Length,
    /// Width from tip to tip.
    #[schemars(example = &"0.6 mm")]
    #[serde(deserialize_with = "positive")]
    pub cell: Length,
    /// Width of the arms, and of the bars.
    #[schemars(example = &"0.1 mm")]
    #[serde(deserialize_with = "positive")]
    pub width: Length,
    /// Length of the bars across the ends of the arms.
    #[schemars(example = &"0.3 mm")]
    #[serde(deserialize_with = "positive")]
    pub bar: Length,
    /// How the centres lie.
    #[serde(default)]
    pub lattice: Lattice,
}

impl Keys for JerusalemKeys {
    fn kind(&self, _: u64) -> Kind {
        cells(
            Shape::Jerusalem { width_mm: self.width.as_mm(), bar_mm: self.bar.as_mm() },
            [self.cell, self.pitch],
            self.lattice,
        )
    }

    fn faults(&self) -> Vec<Fault> {
        needs_room(self.cell, self.pitch)
    }
}

/// Pairs of circles about one centre on a lattice (FSS cells).
#[derive(Clone, Debug, Deserialize, JsonSchema)]
pub(crate) struct RingsKeys {
    /// Distance between centres.
    #[schemars(example = &"0.5 mm")]
    #[serde(deserialize_with = "positive")]
    pub pitch: Length,
    /// Outer diameter.
    #[schemars(example = &"0.6 mm")]
    #[serde(deserialize_with = "positive")]
    pub cell: Length,
    /// Inner diameter.
    #[schemars(example = &"0.4 mm")]
    #[serde(deserialize_with = "positive")]
    pub inner: Length,
    /// How the centres lie.
    #[serde(default)]
    pub lattice: Lattice,
}

impl Keys for RingsKeys {
    fn kind(&self, _: u64) -> Kind {
        cells(Shape::Ring { inner_mm: self.inner.as_mm() }, [self.cell, self.pitch], self.lattice)
    }

    fn faults(&self) -> Vec<Fault> {
        needs_room(self.cell, self.pitch)
    }
}

/// Cells of a shape.
fn cells(shape: Shape, [cell, pitch]: [Length; 2], lattice: Lattice) -> Kind {
    Kind::Cells { shape, cell_mm: cell.as_mm(), pitch_mm: pitch.as_mm(), lattice }
}

fn hexagonal() -> Lattice {
    Lattice::Hex
}
