//! Parallel lines at one distance, or in grooves of several lines each (riblets), clipped to a rectangle.
//!
//! Line k has the distance k pitch from line 0, which runs through the lower left corner. With n lines to a groove,
//! line j of groove g has the distance g pitch + j line, and k = n g + j. Lines on the border are marked, lines that
//! only touch a corner are not. Stroke `i` is line `first + i`, counted along the normal that lies left of the
//! direction, and runs along the direction.

use schemars::JsonSchema;
use serde::Deserialize;

use crate::texture::Figure;
use crate::texture::place::{NM, SLACK, Turn, steps};
use crate::texture::{MAX_STROKES, too_large};
use terrace_core::diag::{Diag, Error};
use terrace_core::geom::{Box2, BoxMm, P2, cos_sin};
use terrace_core::units::{Angle, Length, positive};

use super::bad_pitch;
use super::{Fault, Keys, needs_room};
use crate::texture::direction::Direction;
use crate::texture::kind::Kind;

/// Parallel lines.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
pub(crate) struct HatchKeys {
    /// Distance between lines.
    #[schemars(example = &"0.5 mm")]
    #[serde(deserialize_with = "positive")]
    pub pitch: Length,
    /// Direction of the lines from +x, counter-clockwise; "contour" turns them along the level lines of every section.
    #[schemars(example = &"0 deg")]
    #[serde(default)]
    pub direction: Direction,
}

impl Keys for HatchKeys {
    fn kind(&self, _: u64) -> Kind {
        let pitch_mm = self.pitch.as_mm();
        match self.direction {
            Direction::Angle(angle) => Kind::Hatch { pitch_mm, direction_rad: angle.as_rad() },
            Direction::Contour => Kind::Contour { pitch_mm, phase: 0.0 },
        }
    }
}

/// Parallel grooves of several lines each.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
pub(crate) struct RibletsKeys {
    /// Distance between grooves.
    #[schemars(example = &"0.5 mm")]
    #[serde(deserialize_with = "positive")]
    pub pitch: Length,
    /// Width of a groove.
    #[schemars(example = &"0.6 mm")]
    #[serde(deserialize_with = "positive")]
    pub cell: Length,
    /// Distance between the lines in a groove, at most `cell`.
    #[schemars(example = &"0.02 mm")]
    #[serde(deserialize_with = "positive")]
    pub line: Length,
    /// Direction of the lines from +x, counter-clockwise.
    #[serde(default)]
    pub direction: Angle,
}

impl Keys for RibletsKeys {
    fn kind(&self, _: u64) -> Kind {
        let [pitch_mm, cell_mm, line_mm] = [self.pitch, self.cell, self.line].map(Length::as_mm);
        Kind::Riblets { pitch_mm, cell_mm, line_mm, direction_rad: self.direction.as_rad() }
    }

    fn faults(&self) -> Vec<Fault> {
        needs_room(self.cell, self.pitch)
    }
}

#[derive(Debug)]
pub(in crate::texture) struct Hatch {
    area: BoxMm<2>,
    direction: [f64; 2],
    /// Distance of lines, or of grooves.
    pitch: f64,
    /// Lines of a groove; 1 for a hatch.
    lines: i64,
    /// Distance of the lines of a groove.
    line_pitch: f64,
    /// Number of the first line in the lattice.
    first: i64,
    count: i64,
    turn: Turn,
}

/// The error for grooves that are not possible.
fn bad_groove(text: String) -> Error {
    Diag::input("texture-cell", text).hint("riblets: line <= cell, and cell + 1 nm <= pitch").into()
}

impl Figure for Hatch {
    fn len(&self) -> u64 {
        self.count as u64
    }

    fn points(&self) -> u64 {
        2 * self.len()
    }

    /// The ends of lines move along the border evenly from corner to corner, so the extremes are
    /// taken by the outermost lines or by lines next to a corner.
    fn bounds(&self) -> Box2 {
        let last = self.first + self.count - 1;
        let mut bounds = Box2::EMPTY;
        if self.count == 0 {
            return bounds;
        }
        for corner in self.area.corners() {
            let k = self.below(self.height(corner));
            for k in k - 1..=k + 2 {
                self.line(k.clamp(self.first, last)).into_iter().flatten().for_each(|p| bounds.add(p));
            }
        }
        bounds
    }

    fn stroke(&self, i: u64, out: &mut Vec<P2>) {
        let line = self.line(self.first + i as i64).expect("lines between the outermost ones have a length");
        out.extend_from_slice(&line);
    }

    fn element(&self, i: u64) -> String {
        if self.lines == 1 {
            return format!("hatch line {}", i + 1);
        }
        let k = self.first + i as i64;
        let groove = k.div_euclid(self.lines) - self.first.div_euclid(self.lines);
        format!("line {} of groove {}", k.rem_euclid(self.lines) + 1, groove + 1)
    }
}

impl Hatch {
    pub(in crate::texture) fn new(area: BoxMm<2>, pitch: f64, direction: f64, turn: Turn) -> Result<Self, Error> {
        Self::grooves(area, [pitch, pitch], 1, direction, turn)
    }

    /// Grooves of `width`, `pitch` apart, each of as many lines as lie in it `line` apart.
    pub(in crate::texture) fn riblets(
        area: BoxMm<2>,
        [pitch, width, line]: [f64; 3],
        direction: f64,
        turn: Turn,
    ) -> Result<Self, Error> {
        if !(line >= NM && line.is_finite()) {
            return Err(bad_pitch("riblet line", line, NM));
        }
        if line > width * (1.0 + SLACK) {
            return Err(bad_groove(format!("lines {line} mm apart do not lie in a groove of {width} mm")));
        }
        if !(width + NM <= pitch && pitch.is_finite()) {
            return Err(bad_groove(format!(
                "grooves of {width} mm at a pitch of {pitch} mm leave nothing between them"
            )));
        }
        // Too many for any area are refused there.
        let lines = (steps(width, line) + 1.0).min(MAX_STROKES as f64) as i64;
        Self::grooves(area, [pitch, line], lines, direction, turn)
    }

    fn grooves(
        area: BoxMm<2>,
        [pitch, line_pitch]: [f64; 2],
        lines: i64,
        direction: f64,
        turn: Turn,
    ) -> Result<Self, Error> {
        if !(pitch >= NM && pitch.is_finite() && direction.is_finite()) {
            return Err(bad_pitch("hatch", pitch, NM));
        }
        let direction = cos_sin(direction);
        let mut hatch = Self { area, direction, pitch, lines, line_pitch, first: 0, count: 0, turn };
        let heights = area.corners().map(|c| hatch.height(c));
        let lowest = heights.into_iter().fold(0.0, f64::min);
        let highest = heights.into_iter().fold(0.0, f64::max);
        let most = ((highest - lowest) / pitch + 2.0) * lines as f64;
        if most >= MAX_STROKES as f64 {
            return Err(too_large(most as u64, 2 * most as u64).into());
        }
        // Of the groove that begins below the lowest corner, lines may lie above it.
        let above = steps(-lowest, pitch);
        let gap = lowest + (above + 1.0) * pitch;
        let skipped = ((gap / line_pitch * (1.0 - SLACK)).ceil() as i64).min(lines);
        hatch.first = -(above as i64 + 1) * lines + skipped;
        hatch.count = hatch.below(highest) - hatch.first + 1;
        // Lines through a corner have no length; near it the length grows with the distance, so
        // only the outermost lines can be that short.
        while hatch.count > 0 && hatch.line(hatch.first).is_none() {
            hatch.first += 1;
            hatch.count -= 1;
        }
        while hatch.count > 0 && hatch.line(hatch.first + hatch.count - 1).is_none() {
            hatch.count -= 1;
        }
        Ok(hatch)
    }

    /// Distance of a point from line 0, along the normal.
    fn height(&self, p: [f64; 2]) -> f64 {
        let [c, s] = self.direction;
        c * (p[1] - self.area.lo[1]) - s * (p[0] - self.area.lo[0])
    }

    /// The highest line that is not higher than that above line 0.
    fn below(&self, height: f64) -> i64 {
        let groove = (height / self.pitch * (1.0 + SLACK)).floor();
        let line = steps((height - groove * self.pitch).max(0.0), self.line_pitch) as i64;
        groove as i64 * self.lines + line.min(self.lines - 1)
    }

    /// The ends of line `k`; None where it has no length in the area.
    fn line(&self, k: i64) -> Option<[P2; 2]> {
        let BoxMm { lo, hi } = self.area;
        let d = self.direction;
        let groove = k.div_euclid(self.lines);
        let line = k.rem_euclid(self.lines);
        let offset = groove as f64 * self.pitch + line as f64 * self.line_pitch;
        let mut p = [lo[0] - d[1] * offset, lo[1] + d[0] * offset];
        let mut t0 = f64::NEG_INFINITY;
        let mut t1 = f64::INFINITY;
        for a in 0..2 {
            if d[a] == 0.0 {
                // The last line may miss the border by the slack of the count.
                p[a] = p[a].clamp(lo[a], hi[a]);
                continue;
            }
            let ta = (lo[a] - p[a]) / d[a];
            let tb = (hi[a] - p[a]) / d[a];
            t0 = t0.max(ta.min(tb));
            t1 = t1.min(ta.max(tb));
        }
        if t0 >= t1 {
            return None;
        }
        let end = |t: f64| self.turn.nm([0, 1].map(|a| (p[a] + t * d[a]).clamp(lo[a], hi[a])));
        let ends = [end(t0), end(t1)];
        (ends[0] != ends[1]).then_some(ends)
    }
}
