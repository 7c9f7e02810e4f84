//! The kinds of texture: what a `[[texture]]` asks to be drawn.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use super::artwork::Marking;
use super::curves::OnDistance;
use super::page::{Position, Size};
use terrace_core::geom::{Nm, Pose};

/// What is drawn.
#[derive(Clone, Debug, PartialEq)]
pub enum Kind {
    /// Parallel lines.
    Hatch {
        /// Distance of lines.
        pitch_mm: f64,
        /// Direction of lines from +x, counter-clockwise.
        direction_rad: f64,
    },
    /// Parallel lines along the level lines of the part, their direction set later.
    Contour {
        /// Distance of lines.
        pitch_mm: f64,
        /// By which part of their distance all lines are moved, 0 to 1.
        phase: f64,
    },
    /// One Hilbert curve of 4^order points.
    Hilbert {
        /// 4^order points.
        order: u32,
    },
    /// Closed loops on a lattice.
    Cells {
        /// What a cell shows.
        shape: Shape,
        /// Side, diameter, width across flats, or width from tip to tip.
        cell_mm: f64,
        /// Distance of centres.
        pitch_mm: f64,
        /// How the centres lie.
        lattice: Lattice,
    },
    /// Dots on a lattice.
    Dots {
        /// Distance of sites.
        pitch_mm: f64,
        /// How the sites lie.
        lattice: Lattice,
        /// How far a dot may lie from its site, in half pitches, 0 to 1.
        jitter: f64,
        /// What the places of moved dots follow from.
        seed: u64,
    },
    /// Dots at random (Poisson-disc).
    Poisson {
        /// Least distance of two dots.
        pitch_mm: f64,
        /// What their places follow from.
        seed: u64,
    },
    /// The walls of a hexagonal tiling.
    Honeycomb {
        /// Distance of the centres of tiles.
        pitch_mm: f64,
    },
    /// Grooves of several lines each.
    Riblets {
        /// Distance of grooves.
        pitch_mm: f64,
        /// Width of a groove.
        cell_mm: f64,
        /// Distance of the lines in a groove.
        line_mm: f64,
        /// Direction of lines from +x, counter-clockwise.
        direction_rad: f64,
    },
    /// Circles about one centre.
    Concentric {
        /// Distance of circles.
        pitch_mm: f64,
        /// Their centre, part frame; None for the middle of the area.
        centre_mm: Option<[f64; 2]>,
    },
    /// An Archimedean spiral.
    Spiral {
        /// Distance of turns.
        pitch_mm: f64,
        /// Its centre, part frame; None for the middle of the area.
        centre_mm: Option<[f64; 2]>,
    },
    /// A drawing (SVG, DXF or HPGL) or a bitmap.
    Drawing {
        /// The file.
        path: PathBuf,
        /// Of the whole page.
        size: Size,
        /// A drawing unit where the file may not say so; None for that of the file.
        unit_mm: Option<f64>,
        /// Of the page.
        position: Position,
        /// Turn of the page about its lower left corner, counter-clockwise.
        turn_rad: f64,
        /// Whether the page is repeated over the area.
        tile: bool,
        /// How its lines and areas are marked.
        marking: Box<Marking>,
    },
    /// Space curves (CSV or DXF), in the frame of the surface file.
    Curves {
        /// The file.
        path: PathBuf,
        /// A unit of the file where it may not say so; None for that of the file.
        unit_mm: Option<f64>,
        /// Which of its curves are marked, and their pens.
        marking: Box<Marking>,
        /// How the surface file, and the curves with it, are rotated.
        pose: Option<Pose>,
        /// How far from the surface a curve may lie.
        max_distance: Nm,
        /// What is done with curves beyond that.
        on_distance: OnDistance,
    },
}

/// What a cell shows; lengths in mm. Its size is that of [`Kind::Cells`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Shape {
    /// A point.
    Dot,
    /// A square of that side.
    Square,
    /// A circle of that diameter.
    Circle,
    /// A regular hexagon of that width across its flats, which lie left and right.
    Hexagon,
    /// A cross, from tip to tip.
    Cross {
        /// Width of its arms.
        width_mm: f64,
    },
    /// A Jerusalem cross: a cross with a bar across the end of every arm, from outer side to outer side of bars.
    Jerusalem {
        /// Width of arms and bars.
        width_mm: f64,
        /// Length of the bars.
        bar_mm: f64,
    },
    /// Two circles about one centre; that is the diameter of the outer one.
    Ring {
        /// Diameter of the inner one.
        inner_mm: f64,
    },
}

/// How the centres of cells lie.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Deserialize, Serialize, schemars::JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Lattice {
    /// In columns and rows.
    #[default]
    Square,
    /// Every second row half a pitch further, so that all six neighbours are a pitch away.
    Hex,
}
