//! The closed outlines of one cell of a lattice (FSS elements), about its centre, mm.
//!
//! Outlines run counter-clockwise and end on their first point. Polygons start at the lower left of what is lowest,
//! hexagons at their lowest corner, circles at their rightmost point; the vertices of a circle lie on it, its chords
//! within the tolerance.

use crate::texture::kind::Shape;
use std::f64::consts::TAU;
use terrace_core::math;

use crate::texture::place::LEAST;
use terrace_core::diag::{Diag, Error};

/// Fewest segments of a circle.
const LEAST_SEGMENTS: f64 = 8.0;

impl Shape {
    /// The outlines of a cell of a size, in the order in which they are marked.
    ///
    /// # Errors
    /// `texture-cell`.
    pub(super) fn outlines(self, size: f64, tolerance: f64) -> Result<Vec<Vec<[f64; 2]>>, Error> {
        if self == Self::Dot {
            return Ok(vec![vec![[0.0; 2]]]);
        }
        // Eight chords of a circle of 6 nm are longer than two nanometres.
        if !(size >= 3.0 * LEAST && size.is_finite()) {
            return Err(Diag::input("texture-cell", format!("a cell of {size} mm is too small to mark")).into());
        }
        let r = size / 2.0;
        Ok(match self {
            Self::Dot => unreachable!("it has no size"),
            Self::Square => vec![four_times(&[[-r, -r]])],
            Self::Circle => vec![circle(r, tolerance)],
            Self::Hexagon => {
                let side = size / 3f64.sqrt();
                let half = side / 2.0;
                let corners = [[0.0, -side], [r, -half], [r, half], [0.0, side], [-r, half], [-r, -half]];
                vec![[&corners[..], &corners[..1]].concat()]
            }
            Self::Cross { width_mm: width } => {
                at_least("width", width)?;
                at_least("what is left of the arms beside width", size - width)?;
                let w = width / 2.0;
                vec![four_times(&[[-w, -r], [w, -r], [w, -w]])]
            }
            Self::Jerusalem { width_mm: width, bar_mm: bar } => {
                at_least("width", width)?;
                at_least("what bar has more than width", (bar - width) / 2.0)?;
                at_least("what is left between the ends of bars", size - 2.0 * width - bar)?;
                let (w, b, h) = (width / 2.0, bar / 2.0, r - width);
                vec![four_times(&[[-b, -r], [b, -r], [b, -h], [w, -h], [w, -w], [h, -w], [h, -b]])]
            }
            Self::Ring { inner_mm: inner } => {
                at_least("inner", inner / 3.0)?;
                at_least("what cell has more than inner", size - inner)?;
                vec![circle(r, tolerance), circle(inner / 2.0, tolerance)]
            }
        })
    }
}

/// Refuses a measure below what can be marked.
fn at_least(what: &str, mm: f64) -> Result<(), Error> {
    if mm >= LEAST && mm.is_finite() {
        return Ok(());
    }
    let text = format!("the cell is not possible: {what} is {mm} mm");
    Err(Diag::input("texture-cell", text)
        .hint("crosses: width < cell; jerusalem: width < bar < cell - 2 width; rings: inner < cell")
        .into())
}

/// A quarter of an outline and its three quarter turns, closed.
fn four_times(quarter: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let mut points = quarter.to_vec();
    for _ in 0..3 {
        let last = points[points.len() - quarter.len()..].to_vec();
        points.extend(last.iter().map(|[x, y]| [-y, *x]));
    }
    points.push(points[0]);
    points
}

fn circle(r: f64, tolerance: f64) -> Vec<[f64; 2]> {
    // The sagitta of a chord over the angle a is r (1 - cos(a / 2)), at most r a² / 8.
    let wanted = (TAU * (r / (8.0 * tolerance)).sqrt()).ceil().max(LEAST_SEGMENTS);
    // Chords shorter than two nanometres would only repeat points.
    let n = wanted.min((TAU * r / LEAST).floor()).max(LEAST_SEGMENTS) as u32;
    let mut vertices: Vec<_> = (0..n)
        .map(|k| {
            let (sin, cos) = math::sin_cos(TAU * f64::from(k) / f64::from(n));
            [r * cos, r * sin]
        })
        .collect();
    vertices.push(vertices[0]);
    vertices
}
