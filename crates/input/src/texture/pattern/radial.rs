//! Curves about a centre, cut at the area: concentric circles, or an Archimedean spiral.
//!
//! Circle m, from 1, has the radius m pitch. The spiral is r = pitch t / 2π, t from +x counter-clockwise; its turn m is
//! where t lies about between 2π m and 2π (m + 1). Both run counter-clockwise; a circle that is not cut starts at its
//! rightmost point. Vertices lie on the curve, chords within the tolerance, or half the pitch where that is less, so
//! that neighbours never touch.
//!
//! How many pieces the area leaves of a turn changes only near some radii: those of corners, of the feet of the
//! perpendiculars on sides, and of the place where the ray on which turns begin meets the border. Turns next to such a
//! radius are looked at one by one when the pattern is placed; between them a run of turns has as many pieces as its
//! first. So stroke `i` is found from a short table. The spiral from its centre to the border is one stroke.

use std::f64::consts::{FRAC_PI_2, TAU};
use terrace_core::math;

use schemars::JsonSchema;
use serde::Deserialize;

use super::{Keys, MAX_STROKE_POINTS, bad_pitch, long_stroke};
use crate::texture::Figure;
use crate::texture::kind::Kind;
use crate::texture::place::{LEAST, NM, Turn, far, is_near, push};
use crate::texture::{MAX_STROKES, too_large};
use terrace_core::diag::Error;
use terrace_core::geom::{Box2, BoxMm, P2};
use terrace_core::units::{Length, positive};

/// Circles about one centre.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
pub(crate) struct ConcentricKeys {
    /// Distance between circles.
    #[schemars(example = &"0.5 mm")]
    #[serde(deserialize_with = "positive")]
    pub pitch: Length,
    /// Part-frame position of the centre, in the area or beside it.
    #[schemars(example = ["0 mm", "0 mm"], extend("x-default" = "middle of the area"))]
    #[serde(default)]
    pub centre: Option<[Length; 2]>,
}

impl Keys for ConcentricKeys {
    fn kind(&self, _: u64) -> Kind {
        Kind::Concentric { pitch_mm: self.pitch.as_mm(), centre_mm: self.centre.map(|c| c.map(Length::as_mm)) }
    }
}

/// An Archimedean spiral.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
pub(crate) struct SpiralKeys {
    /// Distance between turns.
    #[schemars(example = &"0.5 mm")]
    #[serde(deserialize_with = "positive")]
    pub pitch: Length,
    /// Part-frame position of the centre, in the area or beside it.
    #[schemars(example = ["0 mm", "0 mm"], extend("x-default" = "middle of the area"))]
    #[serde(default)]
    pub centre: Option<[Length; 2]>,
}

impl Keys for SpiralKeys {
    fn kind(&self, _: u64) -> Kind {
        Kind::Spiral { pitch_mm: self.pitch.as_mm(), centre_mm: self.centre.map(|c| c.map(Length::as_mm)) }
    }
}

/// The least pitch.
const LEAST_PITCH: f64 = 5.0 * LEAST;

/// Fewest segments of a turn.
const LEAST_SEGMENTS: f64 = 8.0;

/// Pieces belong to the turn in which they start, and turns begin on this ray: pieces start on it at single radii only,
/// while on rays along the axes all pieces do where the centre lies on the border.
const RAY: f64 = -0.4;

/// A point may miss the border by this much, mm, and is moved onto it: the noise of f64 cuts no circle that touches the
/// border.
const BORDER: f64 = 0.5 * NM;

/// Turns on either side of a radius near which the number of pieces may change.
const MARGIN: u64 = 3;

/// Parts of a run whose points are counted together.
const PARTS: u64 = 32;

/// Which curve.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::texture) enum Curve {
    /// Circles.
    Concentric,
    /// One spiral.
    Spiral,
}

/// A piece of a turn, or of several turns of the spiral.
#[derive(Clone, Copy, Debug)]
struct TurnPiece {
    turn: u64,
    /// Where it starts, angle from the beginning of `turn` on.
    from: f64,
    end: u64,
    /// Where it ends, angle from the beginning of turn `end` on.
    to: f64,
}

impl TurnPiece {
    fn span(&self) -> f64 {
        (self.end - self.turn) as f64 * TAU + self.to - self.from
    }
}

/// A place on the curve: an angle from the beginning of a turn on.
#[derive(Clone, Copy, Debug)]
struct TurnAngle {
    turn: u64,
    angle: f64,
}

/// A side of the area.
#[derive(Clone, Copy, Debug)]
struct Side {
    /// Direction of the outward normal.
    normal: f64,
    /// Distance from the centre along it; negative where the centre lies outside.
    distance: f64,
}

/// Turns with equally many pieces.
#[derive(Clone, Copy, Debug)]
struct TurnRun {
    /// The first turn of the run, and the one after its last.
    turns: [u64; 2],
    /// Pieces of each.
    pieces: u64,
    /// Index of its first stroke.
    start: u64,
}

#[derive(Debug)]
pub(in crate::texture) struct Radial {
    curve: Curve,
    area: BoxMm<2>,
    centre: [f64; 2],
    pitch: f64,
    tolerance: f64,
    runs: Vec<TurnRun>,
    /// Where the spiral first leaves the area; None where it starts outside.
    first_exit: Option<TurnAngle>,
    len: u64,
    points: u64,
    turn: Turn,
}

impl Figure for Radial {
    fn len(&self) -> u64 {
        self.len
    }

    fn points(&self) -> u64 {
        self.points
    }

    /// Along the axes of the turned frame turns reach further and further until they meet the border, by a pitch each,
    /// and ends of pieces move along a side one way: extremes are taken at the ends of runs.
    fn bounds(&self) -> Box2 {
        let mut bounds = Box2::EMPTY;
        let mut out = Vec::new();
        for run in &self.runs {
            for turn in [run.turns[0], run.turns[1] - 1] {
                for mut piece in self.pieces(turn) {
                    // Of the piece from the centre the last turns reach furthest.
                    if piece.end > piece.turn + 2 {
                        piece = TurnPiece { turn: piece.end - 2, from: 0.0, ..piece };
                    }
                    out.clear();
                    self.draw(piece, &mut out);
                    out.iter().for_each(|&p| bounds.add(p));
                }
            }
        }
        bounds
    }

    fn stroke(&self, i: u64, out: &mut Vec<P2>) {
        let (turn, k) = self.place_of(i);
        self.draw(self.pieces(turn)[k], out);
    }

    fn element(&self, i: u64) -> String {
        let (turn, k) = self.place_of(i);
        match self.curve {
            Curve::Concentric => format!("circle {turn}, piece {}", k + 1),
            Curve::Spiral => format!("turn {} of the spiral, piece {}", turn + 1, k + 1),
        }
    }
}

impl Radial {
    /// About `centre`, part frame, mm.
    ///
    /// # Errors
    /// `texture-pitch`, `texture-far`, `texture-large`.
    pub(in crate::texture) fn new(
        curve: Curve,
        area: BoxMm<2>,
        centre: [f64; 2],
        pitch: f64,
        tolerance: f64,
        turn: Turn,
    ) -> Result<Self, Error> {
        if !(pitch >= LEAST_PITCH && pitch.is_finite()) {
            return Err(bad_pitch("circle or spiral", pitch, LEAST_PITCH));
        }
        if !is_near(turn.turned(centre)) {
            return Err(far().into());
        }
        let tolerance = tolerance.min(pitch / 2.0);
        let mut radial =
            Self { curve, area, centre, pitch, tolerance, runs: Vec::new(), first_exit: None, len: 0, points: 0, turn };
        let radii = radial.radii();
        let last = (radial.farthest() / pitch).floor();
        if last >= MAX_STROKES as f64 {
            return Err(too_large(last as u64, 8 * last as u64).into());
        }
        let first = u64::from(curve == Curve::Concentric);
        // A turn of the spiral may begin on the ray before it, and the last piece with it.
        let end = last as u64 + 2;
        if curve == Curve::Spiral {
            radial.first_exit = radial.find_first_exit(end);
            if let Some(TurnAngle { turn: last, .. }) = radial.first_exit {
                let mut points = 0;
                for turn in 0..=last {
                    points += radial.segments(turn);
                    if points > MAX_STROKE_POINTS {
                        return Err(long_stroke("the spiral up to the border"));
                    }
                }
            }
        }
        let mut ends = vec![first, end];
        for radius in radii {
            let at = (radius / pitch) as u64;
            ends.extend((at.saturating_sub(MARGIN)..=at + MARGIN + 1).filter(|t| (first..end).contains(t)));
        }
        ends.sort_unstable();
        ends.dedup();
        for turns in ends.windows(2).map(|w| [w[0], w[1]]) {
            let pieces = radial.pieces(turns[0]).len() as u64;
            radial.runs.push(TurnRun { turns, pieces, start: radial.len });
            radial.len += pieces * (turns[1] - turns[0]);
            radial.points += radial.points_of_run(turns);
        }
        Ok(radial)
    }

    fn sides(&self) -> [Side; 4] {
        let [x, y] = self.centre;
        let BoxMm { lo, hi } = self.area;
        let distances = [hi[0] - x, hi[1] - y, x - lo[0], y - lo[1]];
        [0, 1, 2, 3].map(|k| Side { normal: k as f64 * FRAC_PI_2, distance: distances[k] + BORDER })
    }

    /// Distance from the centre.
    fn away(&self, p: [f64; 2]) -> f64 {
        math::hypot(p[0] - self.centre[0], p[1] - self.centre[1])
    }

    /// Distance of the farthest corner of the area from the centre.
    fn farthest(&self) -> f64 {
        self.area.corners().into_iter().map(|c| self.away(c)).fold(0.0, f64::max)
    }

    /// The radii near which the pieces of a turn or what bounds them may change.
    fn radii(&self) -> Vec<f64> {
        let mut radii = vec![0.0];
        radii.extend(self.area.corners().map(|c| self.away(c)));
        radii.extend(self.sides().map(|side| side.distance.abs()));
        let (sin, cos) = math::sin_cos(RAY);
        let [u, v] = self.turn.axes();
        // Where rays from the centre enter and leave the area: along the axes of the turned frame, on which circles
        // touch their box, and along the ray on which turns begin.
        for d in [u, v, u.map(|c| -c), v.map(|c| -c), [cos, sin]] {
            let mut t0 = 0.0_f64;
            let mut t1 = f64::INFINITY;
            for (a, along) in d.into_iter().enumerate() {
                let lo = self.area.lo[a] - self.centre[a];
                let hi = self.area.hi[a] - self.centre[a];
                if along != 0.0 {
                    let ta = lo / along;
                    let tb = hi / along;
                    t0 = t0.max(ta.min(tb));
                    t1 = t1.min(ta.max(tb));
                }
            }
            radii.extend([t0, t1]);
        }
        let farthest = self.farthest();
        radii.retain(|r| *r <= farthest);
        radii
    }

    /// The radius at an angle from the beginning of a turn, mm.
    fn radius(&self, turn: u64, angle: f64) -> f64 {
        match self.curve {
            Curve::Concentric => turn as f64 * self.pitch,
            Curve::Spiral => (turn as f64 + angle / TAU) * self.pitch,
        }
    }

    /// The point of the curve at an angle from the beginning of a turn, mm.
    fn at(&self, turn: u64, angle: f64) -> [f64; 2] {
        let (sin, cos) = math::sin_cos(angle);
        let r = self.radius(turn, angle);
        [self.centre[0] + r * cos, self.centre[1] + r * sin]
    }

    /// Whether the area holds that point.
    fn holds(&self, turn: u64, angle: f64) -> bool {
        let p = self.at(turn, angle);
        let BoxMm { lo, hi } = self.area;
        (0..2).all(|a| lo[a] - BORDER <= p[a] && p[a] <= hi[a] + BORDER)
    }

    /// Segments of a turn.
    fn segments(&self, turn: u64) -> u64 {
        // The sagitta of a chord of length l is at most l² k / 8 with the curvature k. On the spiral r = a t it is
        // a (2 + t²) / sqrt(1 + t²) / 8 times the square of the angle, and grows with t.
        let r = match self.curve {
            Curve::Concentric => self.radius(turn, 0.0),
            Curve::Spiral => {
                let t = (turn + 1) as f64 * TAU;
                self.pitch / TAU * (2.0 + t * t) / (1.0 + t * t).sqrt()
            }
        };
        let wanted = TAU * (r / (8.0 * self.tolerance)).sqrt();
        // Chords shorter than two nanometres would only repeat points.
        let n = wanted.min(TAU * r / LEAST).max(LEAST_SEGMENTS);
        (n / 4.0).ceil() as u64 * 4
    }

    /// Where a turn, the one before it and two behind it meet the lines of the sides: angles from its beginning on.
    fn crossings(&self, turn: u64) -> Vec<f64> {
        let mut angles = Vec::with_capacity(48);
        for Side { normal, distance } in self.sides() {
            // Of a side that lies behind the centre, what is about the opposite direction lies within.
            let is_behind = distance < 0.0;
            let about = if is_behind { normal + 2.0 * FRAC_PI_2 } else { normal };
            let distance = if is_behind { -distance } else { distance };
            for k in -2..=3 {
                angles.extend(self.meets(turn, about + f64::from(k) * TAU, distance).into_iter().flatten());
            }
        }
        angles.retain(|&t| (RAY - TAU..=RAY + 3.0 * TAU).contains(&t) && self.radius(turn, t) > BORDER);
        angles.sort_unstable_by(f64::total_cmp);
        angles
    }

    /// Whether the middle of two angles lies in the area.
    fn is_inside(&self, turn: u64, from: f64, to: f64) -> bool {
        self.holds(turn, (from + to) / 2.0)
    }

    /// Where r cos(t - about) = d, before and behind `about`; d is not negative.
    fn meets(&self, turn: u64, about: f64, d: f64) -> Option<[f64; 2]> {
        if self.curve == Curve::Concentric {
            let q = d / self.radius(turn, 0.0);
            return (q < 1.0).then(|| [about - math::acos(q), about + math::acos(q)]);
        }
        let height = SideHeight { radial: self, turn, about, distance: d, growth: self.pitch / TAU };
        let begin = -(turn as f64) * TAU;
        let top = height.top();
        if top <= begin || height.at(top) <= 0.0 {
            return None;
        }
        Some([height.root((about - FRAC_PI_2).max(begin), top), height.root(about + FRAC_PI_2, top)])
    }

    /// The pieces of the curve in the area that start in a turn, in their order.
    fn pieces(&self, turn: u64) -> Vec<TurnPiece> {
        let angles = self.crossings(turn);
        let mut pieces = Vec::with_capacity(4);
        let Some(&first) = angles.first() else {
            // No quarter of a turn, where a circle may touch the border.
            if self.curve == Curve::Concentric && self.holds(turn, 1.0) {
                pieces.push(TurnPiece { turn, from: 0.0, end: turn, to: TAU });
            }
            return self.with_first(turn, pieces);
        };
        let mut pieces = self.with_first(turn, pieces);
        let begin = if self.curve == Curve::Spiral { -(turn as f64) * TAU } else { f64::NEG_INFINITY };
        let mut was_inside = self.is_inside(turn, begin.max(RAY - TAU), first);
        let mut start = None;
        for (k, &angle) in angles.iter().enumerate() {
            let inside = angles.get(k + 1).is_some_and(|&next| self.is_inside(turn, angle, next));
            if inside && !was_inside && (RAY..RAY + TAU).contains(&angle) {
                start = Some(angle);
            }
            if !inside && let Some(from) = start.take() {
                pieces.push(TurnPiece { turn, from, end: turn, to: angle });
            }
            was_inside = inside;
        }
        pieces.retain(|p| self.radius(p.end, p.to) * p.span() >= 2.0 * LEAST);
        pieces
    }

    /// Where a turn is the first of a spiral that starts in the area, its piece from the centre too.
    fn with_first(&self, turn: u64, mut pieces: Vec<TurnPiece>) -> Vec<TurnPiece> {
        if let (0, Some(exit)) = (turn, self.first_exit) {
            pieces.push(TurnPiece { turn, from: 0.0, end: exit.turn, to: exit.angle });
        }
        pieces
    }

    /// Where a spiral that starts in the area first leaves it, in the turns before `end`.
    fn find_first_exit(&self, end: u64) -> Option<TurnAngle> {
        let nearest = self.sides().into_iter().map(|side| side.distance).fold(f64::INFINITY, f64::min);
        if nearest < 0.0 {
            return None;
        }
        for turn in ((nearest / self.pitch) as u64).saturating_sub(2)..=end {
            let angles = self.crossings(turn);
            if turn == 0 && angles.first().is_some_and(|&first| !self.is_inside(0, 0.0, first)) {
                return None;
            }
            if let Some(w) = angles.windows(2).find(|w| !self.is_inside(turn, w[0], w[1])) {
                // The turn itself, of those around it that were looked at.
                let ahead = (w[0] / TAU).floor();
                let turn = turn.saturating_add_signed(ahead as i64);
                return Some(TurnAngle { turn, angle: w[0] - ahead * TAU });
            }
        }
        None
    }

    /// The points of a run, at most. Within a run the ends of pieces move one way from turn to turn, so that of each
    /// part of it the first and the last turn bound the others.
    fn points_of_run(&self, [first, end]: [u64; 2]) -> u64 {
        let part = (end - first).div_ceil(PARTS);
        let mut points = 0;
        let mut turn = first;
        while turn < end {
            let last = (turn + part).min(end) - 1;
            for (a, b) in self.pieces(turn).into_iter().zip(self.pieces(last)) {
                let most = if a.end > a.turn {
                    (a.turn..=a.end).map(|turn| self.segments(turn)).sum()
                } else {
                    let span = (a.to.max(b.to) - a.from.min(b.from)) / TAU;
                    (span * self.segments(last + 1) as f64) as u64 + 1
                };
                // Both ends, and one more where it runs on into the next turn of the spiral.
                points += (last + 1 - turn) * (most + 3);
            }
            turn = last + 1;
        }
        points
    }

    /// The turn and the number in it of stroke `i`.
    fn place_of(&self, i: u64) -> (u64, usize) {
        let run = &self.runs[self.runs.partition_point(|run| run.start <= i) - 1];
        let i = i - run.start;
        (run.turns[0] + i / run.pieces, (i % run.pieces) as usize)
    }

    /// Appends a point of the curve.
    fn push(&self, turn: u64, angle: f64, out: &mut Vec<P2>) {
        let BoxMm { lo, hi } = self.area;
        let p = self.at(turn, angle);
        push(out, self.turn.nm([0, 1].map(|a| p[a].clamp(lo[a], hi[a]))));
    }

    /// Appends the points of a piece: its ends, and the vertices of its turns between them.
    fn draw(&self, piece: TurnPiece, out: &mut Vec<P2>) {
        self.push(piece.turn, piece.from, out);
        let ends = (piece.end - piece.turn) as f64 * TAU + piece.to;
        let mut ahead = (piece.from / TAU).floor();
        while ahead * TAU < ends {
            // Circles are the same whole turns ahead.
            let turn = match self.curve {
                Curve::Concentric => piece.turn,
                Curve::Spiral => piece.turn.saturating_add_signed(ahead as i64),
            };
            let n = self.segments(turn);
            let step = TAU / n as f64;
            let [from, to] = [piece.from, ends].map(|t| (t - ahead * TAU) / step);
            for k in from.max(0.0) as u64..(to.max(0.0) as u64 + 1).min(n) {
                if from < k as f64 && (k as f64) < to {
                    self.push(turn, k as f64 * step, out);
                }
            }
            ahead += 1.0;
        }
        if piece.end == piece.turn && piece.from == 0.0 && piece.to == TAU {
            let first = out[0];
            push(out, first);
        } else {
            self.push(piece.end, piece.to, out);
        }
    }
}

/// How far a turn of the spiral lies beyond a side: h(t) = r(t) cos(t - about) - distance, of the angle t.
struct SideHeight<'a> {
    radial: &'a Radial,
    turn: u64,
    /// Direction of the side's normal.
    about: f64,
    distance: f64,
    /// By how much the radius grows with the angle, mm per rad.
    growth: f64,
}

impl SideHeight<'_> {
    fn at(&self, t: f64) -> f64 {
        self.radial.radius(self.turn, t) * math::cos(t - self.about) - self.distance
    }

    fn slope(&self, t: f64) -> f64 {
        self.growth * math::cos(t - self.about) - self.radial.radius(self.turn, t) * math::sin(t - self.about)
    }

    /// Where it is largest: a little behind `about`, where tan(t - about) = growth / r(t).
    fn top(&self) -> f64 {
        let mut top = self.about;
        for _ in 0..8 {
            top = self.about + math::atan(self.growth / self.radial.radius(self.turn, top).max(f64::MIN_POSITIVE));
        }
        top
    }

    /// Where it is 0, between an angle at which it is at most 0 and one at which it is above.
    fn root(&self, mut below: f64, mut above: f64) -> f64 {
        let mut t = (below + above) / 2.0;
        // The root stays between the two. Newton's steps where these do too, else halves.
        for _ in 0..80 {
            let h = self.at(t);
            *(if h <= 0.0 { &mut below } else { &mut above }) = t;
            let step = t - h / self.slope(t);
            let is_between = (below.min(above)..=below.max(above)).contains(&step);
            let next = if is_between { step } else { (below + above) / 2.0 };
            if (next - t).abs() <= f64::EPSILON * t.abs().max(1.0) {
                break;
            }
            t = next;
        }
        t
    }
}
