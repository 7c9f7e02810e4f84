//! What instructions set until others change it: pen, coordinates, widths, line and fill types.
//!
//! `IN` sets all of it as at the start of a file, so that a file may hold several plots. `DF` keeps what belongs to the
//! sheet and the pens in it: P1 and P2 (`IP`), the pen and where it stands, and its width.

use std::collections::BTreeMap;
use terrace_core::math;

use super::{Fault, UNIT, page};
use terrace_core::geom::PlanePoint;

/// The state of the plotter.
#[derive(Debug)]
pub(super) struct PlotState {
    /// Where the pen stands, plotter units: scaling moves the coordinates under it, not the pen.
    pub(super) at: PlanePoint,
    pub(super) is_down: bool,
    /// Whether the pen was put down and has drawn no line since.
    pub(super) rests: bool,
    pub(super) is_relative: bool,
    pub(super) pen: i64,
    pub(super) is_dashed: bool,
    pub(super) is_patterned: bool,
    pub(super) widths: Widths,
    pub(super) scaling: Option<Scaling>,
    /// P1 and P2, plotter units; None for those of the device.
    pub(super) corners: Option<[f64; 4]>,
}

impl Default for PlotState {
    fn default() -> Self {
        Self {
            at: [0.0; 2],
            is_down: false,
            rests: false,
            is_relative: false,
            pen: 1,
            is_dashed: false,
            is_patterned: false,
            widths: Widths::default(),
            scaling: None,
            corners: None,
        }
    }
}

/// The coordinates that `SC` gives to P1 and P2: x of both, then y of both.
#[derive(Clone, Copy, Debug)]
pub(super) struct Scaling {
    pub(super) range: [f64; 4],
    /// Where the instruction stands.
    pub(super) at: usize,
}

/// Widths of pens (`PW`).
#[derive(Debug, Default)]
pub(super) struct Widths {
    /// Whether they are percents of the distance from P1 to P2 (`WU1`), not mm.
    is_relative: bool,
    all: Option<f64>,
    own: BTreeMap<i64, f64>,
}

impl Widths {
    /// `WU`: also forgets all widths.
    pub(super) fn set_unit(&mut self, is_relative: bool) {
        *self = Self { is_relative, ..Self::default() };
    }

    /// `PW`, for one pen or for all.
    pub(super) fn set(&mut self, width: Option<f64>, pen: Option<i64>) {
        match (width, pen) {
            (Some(width), Some(pen)) => drop(self.own.insert(pen, width)),
            _ => (self.all, self.own) = (width, BTreeMap::new()),
        }
    }
}

impl PlotState {
    /// `DF`.
    pub(super) fn set_defaults(&mut self) {
        let Self { at, pen, corners, .. } = *self;
        let widths = std::mem::take(&mut self.widths);
        *self = Self { at, pen, corners, widths, ..Self::default() };
    }

    /// `IP`: P1 and P2, or P1 alone, which P2 follows.
    pub(super) fn set_corners(&mut self, values: &[f64]) {
        self.corners = match (values, self.corners) {
            (&[a, b, c, d], _) => Some([a, b, c, d]),
            (&[x, y], Some([a, b, c, d])) => Some([x, y, c + x - a, d + y - b]),
            _ => None,
        };
    }

    /// Factor and shift from the units of the plot to plotter units, by axis.
    ///
    /// # Errors
    /// `hpgl-page` where `SC` is on and P1 and P2 are not known, or span nothing.
    pub(super) fn axes(&self) -> Result<[[f64; 2]; 2], Fault> {
        let Some(Scaling { range: [x0, x1, y0, y1], at }) = self.scaling else { return Ok([[1.0, 0.0]; 2]) };
        let Some([a, b, c, d]) = self.corners else { return Err(page("SC", at)) };
        let axis = |lo: f64, hi: f64, p: f64, q: f64| [(q - p) / (hi - lo), p - lo * (q - p) / (hi - lo)];
        let axes = [axis(x0, x1, a, c), axis(y0, y1, b, d)];
        let is_sound = axes.iter().all(|[factor, shift]| factor.is_finite() && shift.is_finite() && *factor != 0.0);
        if is_sound { Ok(axes) } else { Err(page("SC", at)) }
    }

    /// A point of the plot, plotter units.
    pub(super) fn point(&self, p: PlanePoint) -> Result<PlanePoint, Fault> {
        let axes = self.axes()?;
        Ok([0, 1].map(|k| axes[k][0] * p[k] + axes[k][1]))
    }

    /// A point so far from the pen, plotter units.
    pub(super) fn point_from_pen(&self, by: PlanePoint) -> Result<PlanePoint, Fault> {
        let axes = self.axes()?;
        Ok([0, 1].map(|k| self.at[k] + axes[k][0] * by[k]))
    }

    /// The width of the pen, mm; None where the plot does not state it.
    pub(super) fn width_mm(&self) -> Option<f64> {
        let width = self.widths.own.get(&self.pen).copied().or(self.widths.all)?;
        if !self.widths.is_relative {
            return Some(width);
        }
        let [a, b, c, d] = self.corners?;
        Some(width / 100.0 * math::hypot(c - a, d - b) * UNIT)
    }
}
