//! The walls of a hexagonal tiling, each marked once, cut at the area.
//!
//! Tiles are those of a hexagonal lattice of [`super::loops`]: width pitch, corners at the top and at the bottom, side
//! s = pitch / √3, the first in the lower left corner. Level j, 3/2 s high, begins at y0 + 3/2 s j: a zig-zag line
//! between y0 + 3/2 s j and s/2 above, a corner every half pitch, and on its upper corners the upright walls, s long.
//! Even levels have them at x0 + i pitch, odd ones half a pitch further right.
//!
//! The strokes of a level are its zig-zag line, to the right, and its uprights, back to the left, up and down in turn.
//! Three walls meet at a corner, so at least half as many strokes as corners are needed, which is one for a tile: there
//! are no more, but for the zig-zag lines. The uppermost level may be cut, and its zig-zag line then in pieces.

use schemars::JsonSchema;
use serde::Deserialize;

use super::{Keys, MAX_STROKE_POINTS, bad_pitch, long_stroke};
use crate::texture::Figure;
use crate::texture::kind::Kind;
use crate::texture::place::{LEAST, Turn, push, steps};
use crate::texture::{MAX_STROKES, too_large};
use terrace_core::diag::Error;
use terrace_core::geom::{Box2, BoxMm, P2};
use terrace_core::units::{Length, positive};

/// The walls of a hexagonal tiling.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
pub(crate) struct HoneycombKeys {
    /// Distance between the centres of tiles.
    #[schemars(example = &"0.5 mm")]
    #[serde(deserialize_with = "positive")]
    pub pitch: Length,
}

impl Keys for HoneycombKeys {
    fn kind(&self, _: u64) -> Kind {
        Kind::Honeycomb { pitch_mm: self.pitch.as_mm() }
    }
}

/// The least pitch: its walls are 3 nm long.
const LEAST_PITCH: f64 = 3.0 * LEAST;

#[derive(Debug)]
pub(in crate::texture) struct Honeycomb {
    area: BoxMm<2>,
    pitch: f64,
    side: f64,
    /// Levels that are not cut.
    whole: u64,
    /// Uprights of even and of odd levels.
    uprights: [u64; 2],
    /// What there is of the level above.
    top: CutLevel,
    turn: Turn,
}

/// The strokes of the level that the upper border cuts.
#[derive(Clone, Copy, Debug)]
struct CutLevel {
    /// Whether its zig-zag line is whole; else it is in pieces, each about a lower corner.
    is_whole: bool,
    /// Pieces of its zig-zag line.
    pieces: u64,
    /// Uprights that are left.
    uprights: u64,
}

/// How many strokes a level has.
#[derive(Clone, Copy, Debug)]
struct LevelStrokes {
    /// Pieces of its zig-zag line.
    pieces: u64,
    uprights: u64,
}

impl Figure for Honeycomb {
    fn len(&self) -> u64 {
        self.strokes_below(self.whole) + self.top.pieces + self.top.uprights
    }

    fn points(&self) -> u64 {
        let zigzags = self.whole + u64::from(self.top.is_whole);
        let others = self.len() - zigzags;
        zigzags * (self.corners() + 2) + 3 * others
    }

    /// What levels of one kind have alike is a rectangle of points: extremes are taken by the first and last of each
    /// kind, and by the level that is cut.
    fn bounds(&self) -> Box2 {
        let mut bounds = Box2::EMPTY;
        let mut out = Vec::new();
        let levels = [0, 1, self.whole.saturating_sub(2), self.whole.saturating_sub(1), self.whole];
        for level in levels.into_iter().filter(|&level| level <= self.whole) {
            let LevelStrokes { pieces, uprights } = self.counts(level);
            let n = pieces + uprights;
            for k in [0, 1, pieces.saturating_sub(2), pieces.saturating_sub(1), pieces, n.saturating_sub(1)] {
                if k < n {
                    out.clear();
                    self.draw(level, k, &mut out);
                    out.iter().for_each(|&p| bounds.add(p));
                }
            }
        }
        bounds
    }

    fn stroke(&self, i: u64, out: &mut Vec<P2>) {
        let (level, k) = self.place_of(i);
        self.draw(level, k, out);
    }

    fn element(&self, i: u64) -> String {
        let (level, k) = self.place_of(i);
        let LevelStrokes { pieces, uprights } = self.counts(level);
        match k.checked_sub(pieces) {
            None if pieces > 1 => format!("zig-zag line {}, piece {}", level + 1, k + 1),
            None => format!("zig-zag line {}", level + 1),
            Some(back) => format!("upright wall {} of row {}", uprights - back, level + 1),
        }
    }
}

impl Honeycomb {
    /// # Errors
    /// `texture-pitch`, `texture-large`.
    pub(in crate::texture) fn new(area: BoxMm<2>, pitch: f64, turn: Turn) -> Result<Self, Error> {
        if !(pitch >= LEAST_PITCH && pitch.is_finite()) {
            return Err(bad_pitch("honeycomb", pitch, LEAST_PITCH));
        }
        let side = pitch / 3f64.sqrt();
        let [width, height] = area.size();
        let whole = steps(height, 1.5 * side);
        let columns = steps(width, pitch) + 1.0;
        if (whole + 1.0) * (columns + 1.0) >= MAX_STROKES as f64 {
            let n = (whole + 1.0) * (columns + 1.0);
            return Err(too_large(n as u64, (4.0 * n) as u64).into());
        }
        if 2.0 * columns > MAX_STROKE_POINTS as f64 {
            return Err(long_stroke("a zig-zag line"));
        }
        let odd = if width >= pitch / 2.0 { steps(width - pitch / 2.0, pitch) + 1.0 } else { 0.0 };
        let mut comb = Self {
            area,
            pitch,
            side,
            whole: whole as u64,
            uprights: [columns as u64, odd as u64],
            top: CutLevel { is_whole: false, pieces: 0, uprights: 0 },
            turn,
        };
        comb.top = comb.cut();
        Ok(comb)
    }

    /// What the upper border leaves of the level above the whole ones.
    fn cut(&self) -> CutLevel {
        let height = self.room();
        let half = self.side / 2.0;
        let is_whole = height > half - LEAST;
        let pieces = if is_whole {
            1
        } else if height < LEAST {
            0
        } else {
            // Pieces reach `spread` to both sides of lower corners, the first of which lies on the left border or half
            // a pitch off it.
            let spread = height / half * self.pitch / 2.0;
            let room = self.width() + spread - LEAST - self.low(self.whole);
            if spread < LEAST || room < 0.0 { 0 } else { (room / self.pitch).floor() as u64 + 1 }
        };
        let uprights = if height - half < LEAST { 0 } else { self.uprights[(self.whole % 2) as usize] };
        CutLevel { is_whole, pieces, uprights }
    }

    fn width(&self) -> f64 {
        self.area.hi[0] - self.area.lo[0]
    }

    /// Height of the area above the whole levels; not below 0 but for noise.
    fn room(&self) -> f64 {
        self.area.hi[1] - self.foot(self.whole)
    }

    /// Where a level begins.
    fn foot(&self, level: u64) -> f64 {
        self.area.lo[1] + 1.5 * self.side * level as f64
    }

    /// Distance of the first lower corner of a level from the left border.
    fn low(&self, level: u64) -> f64 {
        if level.is_multiple_of(2) { self.pitch / 2.0 } else { 0.0 }
    }

    /// Corners of a zig-zag line that is whole.
    fn corners(&self) -> u64 {
        steps(self.width(), self.pitch / 2.0) as u64 + 1
    }

    /// Strokes of the levels below one.
    fn strokes_below(&self, level: u64) -> u64 {
        level + level.div_ceil(2) * self.uprights[0] + level / 2 * self.uprights[1]
    }

    fn counts(&self, level: u64) -> LevelStrokes {
        if level < self.whole {
            LevelStrokes { pieces: 1, uprights: self.uprights[(level % 2) as usize] }
        } else {
            LevelStrokes { pieces: self.top.pieces, uprights: self.top.uprights }
        }
    }

    /// The level of stroke `i`, and which of its strokes it is.
    fn place_of(&self, i: u64) -> (u64, u64) {
        let below = self.strokes_below(self.whole);
        if i >= below {
            return (self.whole, i - below);
        }
        let [even, odd] = self.uprights;
        // Two levels have a zig-zag line each, and the uprights of both kinds.
        let pair = i / (2 + even + odd);
        let k = i % (2 + even + odd);
        if k <= even { (2 * pair, k) } else { (2 * pair + 1, k - even - 1) }
    }

    /// Appends stroke `k` of a level.
    fn draw(&self, level: u64, k: u64, out: &mut Vec<P2>) {
        let LevelStrokes { pieces, uprights } = self.counts(level);
        if let Some(back) = k.checked_sub(pieces) {
            // From right to left, up and down in turn.
            let [foot, top] = self.upright(level, uprights - 1 - back);
            let ends = if back % 2 == 1 { [top, foot] } else { [foot, top] };
            ends.into_iter().for_each(|[x, y]| self.add(x, y, out));
        } else if level == self.whole && !self.top.is_whole {
            self.piece(k, out);
        } else {
            self.zigzag(level, out);
        }
    }

    /// Appends a point of the area, from its lower left corner along x.
    fn add(&self, x: f64, y: f64, out: &mut Vec<P2>) {
        let [x1, y1] = self.area.hi;
        push(out, self.turn.nm([(self.area.lo[0] + x).min(x1), y.min(y1)]));
    }

    /// Appends the zig-zag line of a level, which is whole.
    fn zigzag(&self, level: u64, out: &mut Vec<P2>) {
        let foot = self.foot(level);
        let half = self.pitch / 2.0;
        let width = self.width();
        let rise = self.side / 2.0;
        // Corners of even levels begin above, those of odd ones below.
        let height = |corner: u64| if (corner + level).is_multiple_of(2) { rise } else { 0.0 };
        let n = self.corners();
        for corner in 0..n {
            self.add(corner as f64 * half, foot + height(corner), out);
        }
        let rest = width - (n - 1) as f64 * half;
        if rest >= LEAST || n == 1 {
            let [a, b] = [height(n - 1), height(n)];
            self.add(width, foot + a + (b - a) * (rest / half), out);
        }
    }

    /// Appends what the upper border leaves of a zig-zag line about lower corner `k`.
    fn piece(&self, k: u64, out: &mut Vec<P2>) {
        let foot = self.foot(self.whole);
        let width = self.width();
        let top = self.area.hi[1];
        let spread = self.room() / self.side * self.pitch;
        let slope = self.side / self.pitch;
        let corner = self.low(self.whole) + k as f64 * self.pitch;
        let [left, right] = [(corner - spread).max(0.0), (corner + spread).min(width)];
        let y = |x: f64| (foot + (x - corner).abs() * slope).min(top);
        self.add(left, y(left), out);
        if left < corner && corner < right {
            self.add(corner, foot, out);
        }
        self.add(right, y(right), out);
    }

    /// The lower and the upper end of upright `k` of a level: x from the left border, y.
    fn upright(&self, level: u64, k: u64) -> [[f64; 2]; 2] {
        let x = k as f64 * self.pitch + if level.is_multiple_of(2) { 0.0 } else { self.pitch / 2.0 };
        [[x, self.foot(level) + self.side / 2.0], [x, self.foot(level + 1)]]
    }
}
