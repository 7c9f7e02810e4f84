//! Which stop continues where a stroke leaves its own, and the fragments that follow from it.

mod bend;
mod seam;

pub use seam::Seam;

use bend::Bend;
use terrace_core::math;

use std::cmp::Ordering;

use super::{Fragment, Fragments, Least, Measure, Run, Segment, Skipped, Sliver};
use crate::partition::Stops;
use crate::projection::{Keep, Normals, Piece, Skip};
use terrace_core::geom::{Box2, FieldPoint, NM_PER_MM, Nm, P2, P3, Turn, Turned, nearest};
use terrace_core::program::{CHORD_NM, PenId, StopId, StrokeId};

/// Heights and places so near to a border, nm, count as inside: what rounding in f64 may do.
const EPS: f64 = 1e-3;

/// Bridges of a nanometre that may follow each other: rounding needs one or two.
const BRIDGES: u32 = 100;

/// How far beyond its window the end of a mark is moved back onto the border, nm: a bridge of one, rounded.
const BEYOND: i64 = 2;

/// A place on a stroke.
#[derive(Clone, Copy)]
struct StrokePlace {
    /// Index of the piece in its run.
    piece: usize,
    /// Share of the segment of that piece.
    t: f64,
}

impl StrokePlace {
    /// Which of two places of a run comes first.
    fn order(&self, other: &Self) -> Ordering {
        self.piece.cmp(&other.piece).then(self.t.total_cmp(&other.t))
    }
}

/// The fragment being built.
struct OpenFragment {
    stop: StopId,
    segment: u32,
    first: usize,
    z: [f64; 2],
    /// The same with what is kept free above and below each place, nm.
    held: [f64; 2],
    z_length: f64,
    cos_length: f64,
    slope2: f64,
    /// The exact length in the field that `z_length` was summed over: that of the rounded points would not do,
    /// because every nanometre counts with the whole height.
    length: f64,
    /// The exact length in the plane of the drawing.
    drawn_exact: f64,
    /// The last of its points in the drawing, and the length of the line through all of them, nm.
    last: P2,
    drawn: f64,
    /// On a turned part: the line since its last point.
    bend: Bend,
    /// How much of it the fragment before has marked too, nm.
    shared: f64,
    /// What became of the fragment that it continues from.
    from: Before,
}

impl OpenFragment {
    /// The fragment of `stop` that begins at `last` of a segment, with point `first` of the list.
    fn new(stop: StopId, segment: u32, first: usize, last: P2, bend: Bend, from: Before) -> Self {
        Self {
            stop,
            segment,
            first,
            z: [f64::INFINITY, f64::NEG_INFINITY],
            held: [f64::INFINITY, f64::NEG_INFINITY],
            z_length: 0.0,
            cos_length: 0.0,
            slope2: 0.0,
            length: 0.0,
            drawn_exact: 0.0,
            last,
            drawn: 0.0,
            bend,
            shared: 0.0,
            from,
        }
    }

    /// Begins again on another segment, where the fragment is no more than a point yet: what was summed up there goes.
    /// Its lengths `drawn` and `shared` stay, since those of all fragments must sum to the length of the stroke.
    fn restart(&mut self, segment: u32) {
        self.segment = segment;
        self.z = [f64::INFINITY, f64::NEG_INFINITY];
        self.held = self.z;
        self.z_length = 0.0;
        self.cos_length = 0.0;
        self.slope2 = 0.0;
        self.length = 0.0;
        self.drawn_exact = 0.0;
    }
}

/// What lies under a mark.
struct UnderMark {
    /// Lowest and highest height, nm.
    z: [f64; 2],
    /// The same with what is kept free above and below, nm.
    held: [f64; 2],
    mean_z: f64,
    /// Length of the mark in the field, nm; 0 of a dot.
    length: f64,
    /// Mean cosine of the slope.
    cos: f64,
    /// Largest squared slope.
    slope2: f64,
}

/// What became of the fragment that ended where another begins.
#[derive(Clone, Copy, Default, PartialEq)]
enum Before {
    /// There is none, or a gap between them.
    #[default]
    None,
    /// The piece before is marked; `spare` if it is a sliver that no mark before it adjoins, and how long it is, nm.
    Marked { spare: Option<f64> },
    /// The piece before was too short to be marked.
    Skipped,
}

/// Where the open fragment is to be cut.
#[derive(Clone, Copy)]
struct PlannedCut {
    at: StrokePlace,
    /// The stop that continues.
    next: StopId,
}

/// A coordinate of a piece of a stroke, which goes straight from one value to another, and its limits.
struct LinearCoordinate {
    from: f64,
    to: f64,
    lo: f64,
    hi: f64,
}

impl LinearCoordinate {
    /// Whether it lies within its limits at a share of the piece.
    fn is_inside(&self, share: f64) -> bool {
        let now = self.from + (self.to - self.from) * share;
        self.lo - EPS <= now && now <= self.hi + EPS
    }

    /// The share of the piece at which it leaves its limits; None where it ends within them.
    fn leaves(&self) -> Option<f64> {
        let is_left = self.to.clamp(self.lo - EPS, self.hi + EPS) != self.to;
        is_left.then(|| (self.to.clamp(self.lo, self.hi) - self.from) / (self.to - self.from))
    }
}

/// The share of the way from `a` to `b` at which a coordinate that begins within its limits reaches one of them, beyond
/// 1 if only later; infinite where it never does.
#[inline]
fn leaves_at([a, b]: [i64; 2], [lo, hi]: [f64; 2]) -> f64 {
    match b - a {
        0 => f64::INFINITY,
        d @ 1.. => (hi - a as f64) / d as f64,
        d => (lo - a as f64) / d as f64,
    }
}

/// Cuts strokes between the stops of one candidate.
pub(super) struct Cutter<'a> {
    normals: Normals<'a>,
    stops: &'a Stops,
    least: Least,
    keep: Keep,
    out: Fragments,
    open: Option<OpenFragment>,
    /// What became of the fragment that ended last, if the stroke continues from there.
    last: Before,
    /// Height of the surface at the end of the last stretch that was marked.
    z: f64,
    /// Why the stroke is not marked here, and since where on the segment.
    unmarked: Option<(Skip, P2)>,
    source: StrokeId,
    pen: PenId,
    passes: f64,
    /// How many fragments there were before the stroke.
    fragments_before: usize,
    /// What was skipped before the stroke.
    skipped_before: Skipped,
    /// Stops that admit a point; scratch space.
    admitting: Vec<StopId>,
    seam: Seam,
    /// Where the open fragment is to be cut although its stop would continue.
    cut: Option<PlannedCut>,
    /// Largest squared slope under a mark as its stop sees it.
    worst_turned2: f64,
}

impl<'a> Cutter<'a> {
    pub(super) fn new(normals: Normals<'a>, stops: &'a Stops, least: Least, keep: Keep, seam: Seam) -> Self {
        let out = Fragments::default();
        Self {
            normals,
            stops,
            least,
            keep,
            skipped_before: out.skipped,
            fragments_before: 0,
            out,
            open: None,
            last: Before::None,
            z: 0.0,
            unmarked: None,
            source: StrokeId(0),
            pen: PenId(0),
            passes: 1.0,
            admitting: Vec::new(),
            seam,
            cut: None,
            worst_turned2: 0.0,
        }
    }

    /// What became of all strokes given so far; `worst_slope2` is the largest squared slope under marks upright.
    pub(super) fn finish(self, worst_slope2: f64) -> Fragments {
        // On a turned part the beam meets the surface at other angles than the drawing does.
        let worst_slope2 = if self.stops.is_tilted() { self.worst_turned2 } else { worst_slope2 };
        Fragments { worst_slope2, ..self.out }
    }

    /// Begins a stroke.
    pub(super) fn begin(&mut self, source: StrokeId, pen: PenId, passes: u32) {
        (self.source, self.pen, self.passes) = (source, pen, f64::from(passes));
        self.fragments_before = self.out.list.len();
        self.skipped_before = self.out.skipped;
        self.last = Before::None;
    }

    /// Takes a dot: a run of one segment without length, and its piece.
    pub(super) fn dot(&mut self, run: &Run) {
        let s = &run.segments[0];
        let p = &run.pieces[0];
        self.out.dots.texture += 1;
        match p.skip {
            Some(Skip::OffPart) => return self.out.dots.off_part += 1,
            Some(Skip::Steep) => {
                self.out.dots.steep += 1;
                self.out.steep_at.get_or_insert(s.a);
                return;
            }
            None => {}
        }
        let (stop, _) = self.choose(run, 0, StrokePlace { piece: 0, t: 0.0 });
        let (z, slope2) = match self.stops.turn(stop) {
            Some(turn) => (turn.apply(s.at(0.0, p.z0))[2], turn.slope2(self.normals.under(p))),
            None => (p.z0, p.slope2),
        };
        let first = self.out.points.len() as u32;
        self.out.points.push(self.local(stop, s.a, p.z0));
        self.out.list.push(Fragment { stop, source: self.source, pen: self.pen, first, len: 1, ..Fragment::default() });
        let cos = 1.0 / (1.0 + slope2).sqrt();
        let measure = self.measure(
            stop,
            UnderMark { z: [z; 2], held: [z - p.reserve, z + p.reserve], mean_z: z, length: 0.0, cos, slope2 },
        );
        self.out.measures.push(measure);
    }

    /// Ends a stroke that is no dot, and counts what became of it.
    pub(super) fn end(&mut self, points: &[P2]) {
        self.close(points[points.len() - 1]);
        let out = &mut self.out;
        let parts = out.list.len() - self.fragments_before;
        out.strokes_cut += usize::from(parts > 1);
        if parts > 1 && self.keep.bounds(points).is_some() {
            out.not_kept += 1;
        }
        if points[0] == points[points.len() - 1] {
            if parts == 1 && out.skipped == self.skipped_before {
                out.figures_whole += 1;
                // A figure may begin at any vertex as long as its points are those of the texture: rounding drops
                // some that fall together, a turned part adds some.
                let last = out.list.last_mut();
                last.into_iter().for_each(|f| f.is_figure = f.len as usize == points.len());
            } else {
                out.figures_cut += 1;
            }
        }
    }

    /// Cuts one run of traced segments: marks every piece in the stop that continues, and changes stops where one ends, at
    /// a planned cut, or after a place that is not marked.
    pub(super) fn cut_run(&mut self, run: &Run) {
        // A planned cut names a piece of its run.
        self.cut = None;
        for (k, s) in run.segments.iter().enumerate() {
            // The stop of the open fragment, and where on the segment its window ends.
            let mut carried = self.open.as_ref().map(|o| (o.stop, self.window_end(o.stop, s)));
            let mut bridges = 0;
            for i in s.first..s.end {
                let p = &run.pieces[i];
                if let Some(skip) = p.skip {
                    self.skip(skip, s, p.t0);
                    carried = None;
                    continue;
                }
                if self.unmarked.is_some() {
                    self.end_unmarked(s.a.lerp(s.b, p.t0), [s.a, s.b]);
                }
                // Invariant: what lies before t is marked or counted. `carried` is the stop that continues, and where
                // its window ends on this segment; None where one must be chosen. Each iteration moves t on, or finds
                // that the stop of the piece before does not admit this one and leaves the choice to the next.
                let mut t = p.t0;
                while t < p.t1 {
                    let is_chosen = carried.is_none();
                    let (stop, end) =
                        carried.take().unwrap_or_else(|| self.next_stop(run, k, StrokePlace { piece: i, t }));
                    let mut exit = self.exit(stop, end, s, p, t);
                    if let Some(cut) = self.cut.filter(|cut| cut.at.piece == i) {
                        exit = exit.min(cut.at.t.max(t));
                    }
                    if is_chosen && exit <= t {
                        // Not even the stop that was just chosen goes beyond t: rounding left a gap between two stops,
                        // which is bridged by a nanometre. A gap that continues is a fault of the method: the mark
                        // stays in this stop, and the check of the program reports it.
                        bridges += 1;
                        exit = if bridges > BRIDGES { p.t1 } else { (t + 1.0 / s.a.distance(s.b)).min(p.t1) };
                    } else {
                        bridges = 0;
                    }
                    if exit > t {
                        if self.seam.overlap > 0.0 && self.open.as_ref().is_some_and(|o| o.stop != stop) {
                            self.share(stop, run, StrokePlace { piece: i, t });
                        }
                        self.mark(stop, s, [t, exit], p);
                        t = exit;
                    }
                    // A stop that reached the end of the piece is carried over: it was chosen as the one that the
                    // stroke leaves last.
                    if exit >= p.t1 {
                        carried = Some((stop, end));
                    }
                }
            }
            self.vertex(s.index, s.a, s.b);
        }
    }

    /// Where on a segment that begins in the window of `stop` it leaves it; on a turned part every piece
    /// tells for itself.
    #[inline]
    fn window_end(&self, stop: StopId, s: &Segment) -> f64 {
        if self.stops.turn(stop).is_some() {
            return f64::INFINITY;
        }
        let [lo, hi] = self.stops.window(stop);
        leaves_at([s.a.x, s.b.x], [lo[0], hi[0]]).min(leaves_at([s.a.y, s.b.y], [lo[1], hi[1]]))
    }

    /// Where a piece leaves `stop`, from t on; its end or beyond if it stays.
    #[inline]
    fn exit(&self, stop: StopId, window_end: f64, s: &Segment, p: &Piece, t: f64) -> f64 {
        if let Some(turn) = self.stops.turn(stop) {
            return self.turned_exit(stop, turn, s, p, t);
        }
        let stop = &self.stops.stops[stop.index()].stop;
        let (lo, hi) = (stop.z_lo.f64() + p.reserve, stop.z_hi.f64() - p.reserve);
        // At the edge of a sheet the height jumps from one piece to the next; and of stops that reach the height of a
        // place not all keep enough free there.
        if (t == p.t0 || p.reserve > 0.0) && (p.z(t) > hi + EPS || p.z(t) < lo - EPS) {
            return t;
        }
        // The height is linear along the piece: the stop is left where it reaches the limit that its far end lies
        // beyond.
        let limit = if p.z1 > hi + EPS {
            hi
        } else if p.z1 < lo - EPS {
            lo
        } else {
            return window_end.min(p.t1).max(t);
        };
        let z_end = if p.z0 == p.z1 { t } else { p.t0 + (p.t1 - p.t0) * ((limit - p.z0) / (p.z1 - p.z0)) };
        window_end.min(z_end).clamp(t, p.t1)
    }

    /// The exit of [`Cutter::exit`] for a turned part, on which a piece is straight in space.
    fn turned_exit(&self, stop: StopId, turn: &Turn, s: &Segment, p: &Piece, t: f64) -> f64 {
        // Every coordinate of the turned part is linear along the piece, and so are those of the drawing: each says
        // whether it is inside at t and where it leaves; the first to leave counts.
        let share = (t - p.t0) / (p.t1 - p.t0);
        let ends = [(p.t0, p.z0), (p.t1, p.z1)].map(|(t, z)| s.at(t, z));
        let turned_ends = ends.map(|end| turn.apply(end));
        let in_box = {
            let ([a, b], [lo, hi]) = (turned_ends, self.bounds(stop));
            (0..3).map(move |k| LinearCoordinate { from: a[k], to: b[k], lo: lo[k], hi: hi[k] })
        };
        // The area that the stop may be kept to is one of the drawing.
        let in_area = self.stops.area(stop).into_iter().flat_map(|area| {
            let ([a, b], [lo, hi]) = (ends, [area.lo, area.hi].map(|corner| [corner.x as f64, corner.y as f64]));
            (0..2).map(move |k| LinearCoordinate { from: a[k], to: b[k], lo: lo[k], hi: hi[k] })
        });
        let mut exit = p.t1;
        for coordinate in in_box.chain(in_area) {
            if !coordinate.is_inside(share) {
                return t;
            }
            if let Some(leaves) = coordinate.leaves() {
                exit = exit.min(p.t0 + (p.t1 - p.t0) * leaves);
            }
        }
        exit.clamp(t, p.t1)
    }

    /// Lower and upper corner of what `stop` admits, on the turned part where there is a turn.
    fn bounds(&self, stop: StopId) -> [[f64; 3]; 2] {
        let ([lo, hi], at) = (self.stops.window(stop), &self.stops.stops[stop.index()].stop);
        [[lo[0], lo[1], at.z_lo.f64()], [hi[0], hi[1], at.z_hi.f64()]]
    }

    /// A point as `stop` sees it.
    fn seen(&self, stop: StopId, p: P3) -> P3<Turned> {
        self.stops.turn(stop).map_or_else(|| Turn::upright_in_space(p), |turn| turn.apply(p))
    }

    /// A point of the drawing, over which the surface is `z` high, in the field frame of a stop. Sections are
    /// smaller than 2.1 m, so it fits.
    fn local(&self, stop: StopId, p: P2, z: f64) -> FieldPoint {
        let c = self.stops.stops[stop.index()].stop.centre;
        let Some(turn) = self.stops.turn(stop) else {
            // A bridge ends beyond the window, and the window may be the whole field.
            let within = |v: i64, Nm(half): Nm| if v.abs() <= half + BEYOND { v.clamp(-half, half) } else { v };
            let [w, h] = self.stops.half();
            return FieldPoint::new(within(p.x - c.x, w) as i32, within(p.y - c.y, h) as i32);
        };
        let [x, y, _] = turn.apply(P3::new([p.x as f64, p.y as f64, z])).at;
        FieldPoint::new(nearest(x - c.x as f64) as i32, nearest(y - c.y as f64) as i32)
    }

    /// The stop that continues after a place on segment `k`, and where on the segment its window ends: that of the cut
    /// planned for here, or else one that is chosen. Plans the next cut where cuts lie at random in a zone.
    fn next_stop(&mut self, run: &Run, k: usize, at: StrokePlace) -> (StopId, f64) {
        let s = &run.segments[k];
        let p = &run.pieces[at.piece];
        // A cut that was planned for another place is dropped: the stroke leaves the stop here.
        let is_here = |cut: &PlannedCut| cut.at.piece == at.piece && cut.at.t <= at.t;
        let planned = self.cut.take().filter(is_here).map(|cut| (cut.next, self.window_end(cut.next, s)));
        let (stop, end) = planned
            .filter(|&(next, end)| self.exit(next, end, s, p, at.t) > at.t)
            .unwrap_or_else(|| self.choose(run, k, at));
        if self.seam.zone > 0.0 {
            self.cut = self.plan(stop, run, k, at);
        }
        (stop, end)
    }

    /// Of the stops that admit what follows after a place on segment `k`, the one that the stroke leaves last; and
    /// where on the segment its window ends.
    fn choose(&mut self, run: &Run, k: usize, at: StrokePlace) -> (StopId, f64) {
        let s = &run.segments[k];
        let p = &run.pieces[at.piece];
        let point = s.at(at.t, p.z(at.t));
        let mut admitting = std::mem::take(&mut self.admitting);
        admitting.clear();
        admitting.extend(self.stops.near(point, EPS).filter(|&stop| {
            let ([lo, hi], seen) = (self.bounds(stop), self.seen(stop, point));
            let is_in_window = (0..2).all(|axis| lo[axis] - EPS <= seen[axis] && seen[axis] <= hi[axis] + EPS);
            is_in_window && self.exit(stop, self.window_end(stop, s), s, p, at.t) > at.t
        }));
        if self.seam.overlap > 0.0 && admitting.len() > 1 {
            self.overlapping(&mut admitting, run, at);
        }
        let best = match admitting[..] {
            [] => self.nearest(point),
            [only] => only,
            // Farthest first is optimal for cuts along one stroke: any cover of the stretch by intervals can be
            // exchanged for this one, interval by interval, without a cut more.
            _ => admitting
                .iter()
                .map(|&stop| (self.left(stop, run, k, at), stop))
                .max_by(|(a, a_stop), (b, b_stop)| a.order(b).then(a_stop.cmp(b_stop)))
                .map_or(admitting[0], |(_, stop)| stop),
        };
        self.admitting = admitting;
        (best, self.window_end(best, s))
    }

    /// Where the stroke leaves a stop that admits it at a place on segment `k`.
    fn left(&self, stop: StopId, run: &Run, k: usize, at: StrokePlace) -> StrokePlace {
        let mut t = at.t;
        for s in &run.segments[k..] {
            let end = self.window_end(stop, s);
            for (j, p) in run.pieces[..s.end].iter().enumerate().skip(at.piece.max(s.first)) {
                let t = std::mem::replace(&mut t, 0.0).max(p.t0);
                let exit = self.exit(stop, end, s, p, t);
                if p.skip.is_some() || exit < p.t1 {
                    return StrokePlace { piece: j, t: if p.skip.is_some() { p.t0 } else { exit } };
                }
            }
        }
        // Stops that admit all that was looked ahead over count as equal; the last of the list continues.
        StrokePlace { piece: run.pieces.len(), t: 0.0 }
    }

    /// The stop that comes nearest to admitting a point: methods cover all that was traced, up to rounding.
    fn nearest(&self, at: P3) -> StopId {
        let beyond = |&stop: &StopId| {
            let ([lo, hi], at) = (self.bounds(stop), self.seen(stop, at));
            (0..3).map(|k| (lo[k] - at[k]).max(at[k] - hi[k])).fold(0.0, f64::max)
        };
        let near = self.stops.near(at, 2.0).min_by(|a, b| beyond(a).total_cmp(&beyond(b)).then(a.cmp(b)));
        near.unwrap_or(StopId(0))
    }

    /// The stroke is not marked from `t` of a segment on.
    fn skip(&mut self, skip: Skip, s: &Segment, t: f64) {
        if self.unmarked.is_none_or(|(why, _)| why != skip) {
            let from = s.a.lerp(s.b, t);
            self.close(from);
            self.last = Before::None;
            self.end_unmarked(from, [s.a, s.b]);
            self.unmarked = Some((skip, from));
        }
    }

    /// Counts the stretch without marks that ends at `to` as a whole, not facet by facet: facets can be smaller than the
    /// nanometre grid to which their borders would be rounded.
    fn end_unmarked(&mut self, to: P2, [a, b]: [P2; 2]) {
        let Some((skip, from)) = self.unmarked.take() else { return };
        // Measured along the segment, not between the rounded ends, so that many short stretches sum to its length.
        let along = (b.x - a.x) as f64 * (to.x - from.x) as f64 + (b.y - a.y) as f64 * (to.y - from.y) as f64;
        let length_mm = self.passes * along.max(0.0) / a.distance(b) / NM_PER_MM;
        match skip {
            Skip::OffPart => self.out.skipped.off_part += length_mm,
            Skip::Steep => {
                self.out.skipped.steep += length_mm;
                if length_mm > 0.0 {
                    self.out.steep_at.get_or_insert(from);
                }
            }
        }
    }

    /// Goes on in `stop` over a stretch of a piece.
    fn mark(&mut self, stop: StopId, s: &Segment, t: [f64; 2], p: &Piece) {
        // On a turned part the two sides of a wall lie apart in the field.
        let jump = (p.z(t[0]) - self.z).abs();
        let jumps = self.stops.turn(stop).is_some_and(|turn| jump * turn.lean() > CHORD_NM / 2.0);
        if self.open.as_ref().is_some_and(|o| o.stop != stop || jumps) {
            self.close(s.a.lerp(s.b, t[0]));
            if jumps {
                self.last = Before::None;
            }
        }
        let z = [p.z(t[0]), p.z(t[1])];
        let ends = self.stops.turn(stop).map(|turn| [0, 1].map(|k| turn.apply(s.at(t[k], z[k]))));
        if self.open.is_none() {
            let first = self.out.points.len();
            let begin = s.a.lerp(s.b, t[0]);
            self.out.points.push(self.local(stop, begin, z[0]));
            let bend = ends.map_or_else(Bend::default, |e| Bend::start([e[0][0], e[0][1]]));
            self.open = Some(OpenFragment::new(stop, s.index, first, begin, bend, self.last));
        }
        self.z = z[1];
        let normal = || self.normals.under(p);
        let slope2 = self.stops.turn(stop).map_or(p.slope2, |turn| turn.slope2(normal()));
        let (centre, Some(open)) = (self.stops.stops[stop.index()].stop.centre, &mut self.open) else { return };
        let z = ends.map_or(z, |e| e.map(|e| e[2]));
        if let Some([x, y]) = ends.and_then(|e| open.bend.go([e[1][0], e[1][1]])) {
            let p = FieldPoint::new(nearest(x - centre.x as f64) as i32, nearest(y - centre.y as f64) as i32);
            if self.out.points[self.out.points.len() - 1] != p {
                self.out.points.push(p);
            }
        }
        let drawn = (t[1] - t[0]) * s.a.distance(s.b);
        let length = ends.map_or(drawn, |[a, b]| math::hypot(b[0] - a[0], b[1] - a[1]));
        open.z = [open.z[0].min(z[0]).min(z[1]), open.z[1].max(z[0]).max(z[1])];
        let kept = p.reserve;
        open.held = [open.held[0].min(z[0].min(z[1]) - kept), open.held[1].max(z[0].max(z[1]) + kept)];
        open.cos_length += length / (1.0 + slope2).sqrt();
        // A piece no longer than the grid is only rounding of a cut: the mark touches that facet but does not lie on
        // it.
        if length > 1.0 {
            open.slope2 = open.slope2.max(slope2);
        }
        // The mean of the ends times the length is the integral: the height is linear.
        open.z_length += (z[0] + z[1]) / 2.0 * length;
        open.length += length;
        open.drawn_exact += drawn;
    }

    /// The end b of `segment` from a: a vertex of the open fragment.
    fn vertex(&mut self, segment: u32, a: P2, b: P2) {
        self.out.texture_mm += self.passes * a.distance(b) / NM_PER_MM;
        self.end_unmarked(b, [a, b]);
        self.corner(segment, b);
    }

    /// The open fragment turns at the end b of `segment`.
    fn corner(&mut self, segment: u32, b: P2) {
        let Some(p) = self.open.as_ref().map(|open| self.local(open.stop, b, self.z)) else { return };
        if let Some(open) = &mut self.open {
            open.drawn += open.last.distance(b);
            open.last = b;
            open.bend = self.stops.turn(open.stop).map_or_else(Bend::default, |turn| {
                let [x, y, _] = turn.apply(P3::new([b.x as f64, b.y as f64, self.z])).at;
                Bend::start([x, y])
            });
            if self.out.points[self.out.points.len() - 1] != p {
                self.out.points.push(p);
            } else if self.out.points.len() == open.first + 1 {
                // All there is of the fragment is this vertex: it begins on the next segment.
                open.restart(segment + 1);
            }
        }
    }

    /// Ends the open fragment at `end`; returns whether it is long enough to be marked.
    fn close(&mut self, end: P2) -> bool {
        let Some(open) = self.open.take() else { return false };
        let p = self.local(open.stop, end, self.z);
        if self.out.points[self.out.points.len() - 1] != p {
            self.out.points.push(p);
        }
        let count = self.out.points.len() - open.first;
        let length = open.drawn + open.last.distance(end);
        // Either way `length` is accounted for, so that mark - overlap + skipped = texture; what the fragment
        // before has marked of it was counted there.
        let is_sliver = length < self.least.sliver;
        let adjoins = matches!(open.from, Before::Marked { .. });
        // What it has for itself is less than the grid, as where a stroke ends where the stop before admits it no more:
        // all of it would be marked twice.
        let is_shared = open.shared > 0.0 && length - open.shared < 1.0;
        if count < 2 || length < self.least.mark || is_sliver && adjoins || is_shared {
            self.leave_out(open.stop, open.first, open.held, length - open.shared);
            self.last = Before::Skipped;
            return false;
        }
        self.out.mark_mm += self.passes * length / NM_PER_MM;
        self.out.overlap_mm += self.passes * open.shared / NM_PER_MM;
        let mut first = open.first;
        let mut goes_on = adjoins;
        if let Before::Marked { spare: Some(before) } = open.from {
            first = self.drop_before(first, before, open.shared);
            goes_on = false;
        }
        self.out.list.push(Fragment {
            stop: open.stop,
            source: self.source,
            segment: open.segment,
            first: first as u32,
            len: count as u32,
            pen: self.pen,
            is_figure: false,
            goes_on,
        });
        let [mean_z, cos] = if open.length > 0.0 {
            [open.z_length / open.length, open.cos_length / open.length]
        } else {
            [self.z, 1.0 / (1.0 + open.slope2).sqrt()]
        };
        let under = UnderMark { z: open.z, held: open.held, mean_z, length: open.length, cos, slope2: open.slope2 };
        let measure = self.measure(open.stop, under);
        self.out.measures.push(measure);
        self.last = Before::Marked { spare: is_sliver.then_some(length) };
        true
    }

    /// Leaves out the sliver before the fragment that begins at point `first` and shares `shared` with it; `length` is
    /// that of the sliver. Returns where the fragment begins then.
    fn drop_before(&mut self, first: usize, length: f64, shared: f64) -> usize {
        let (Some(sliver), Some(measure)) = (self.out.list.pop(), self.out.measures.pop()) else { return first };
        self.out.mark_mm -= self.passes * length / NM_PER_MM;
        self.out.overlap_mm -= self.passes * shared / NM_PER_MM;
        let follows = self.out.points.split_off(first);
        let first = sliver.first as usize;
        let z_lo = self.stops.stops[sliver.stop.index()].stop.z_lo;
        self.leave_out(sliver.stop, first, measure.held(z_lo.f64()), length - shared);
        self.out.points.extend(follows);
        first
    }

    /// What is kept of what lies under a mark of `stop`: heights over the lower end of what the stop admits.
    fn measure(&mut self, stop: StopId, under: UnderMark) -> Measure {
        self.worst_turned2 = self.worst_turned2.max(under.slope2);
        let z_lo = self.stops.stops[stop.index()].stop.z_lo.f64();
        // Where something is kept free its ends are no whole numbers: a nanometre more than the stop admits would be too
        // much.
        let held = |z: f64, held: f64, inwards: fn(f64) -> f64| {
            let over = held - z_lo;
            (if held == z { over.round() } else { inwards(over) }) as i32
        };
        Measure {
            z: under.z.map(|z| (z - z_lo).round() as i32),
            held: [held(under.z[0], under.held[0], f64::ceil), held(under.z[1], under.held[1], f64::floor)],
            mean_z: (under.mean_z - z_lo) as f32,
            length: under.length as f32,
            versine: (1.0 - under.cos) as f32,
            slope2: under.slope2 as f32,
        }
    }

    /// Takes back the points from `first` on: they would be too short a mark of `stop` between heights `z`, which has
    /// `length` for itself, nm.
    fn leave_out(&mut self, stop: StopId, first: usize, z: [f64; 2], length: f64) {
        let length_mm = self.passes * length / NM_PER_MM;
        self.out.skipped.small += length_mm;
        let c = self.stops.stops[stop.index()].stop.centre;
        let mut area = Box2::<Turned>::EMPTY;
        let place = |p: FieldPoint| P2::<Turned>::new(c.x + i64::from(p.x), c.y + i64::from(p.y));
        let points: Vec<P2<Turned>> = self.out.points.drain(first..).map(place).collect();
        points.iter().for_each(|&p| area.add(p));
        // What is no longer than a point on a vertex has no height yet.
        let z = if z[0] <= z[1] { z } else { [self.z; 2] };
        let middle = (z[0] + z[1]) / 2.0;
        let in_part = |p: P2<Turned>| {
            let at = [p.x as f64, p.y as f64, middle];
            self.stops.turn(stop).map_or(at, |turn| turn.back(P3::new(at)).at)
        };
        let (Some(&from), Some(&to)) = (points.first(), points.last()) else { return };
        let ends = [from, to].map(in_part);
        let [lo, hi] = [z[0].floor(), z[1].ceil()].map(|z| z as i64);
        let (lo, hi) = ([area.lo.x, area.lo.y, lo], [area.hi.x, area.hi.y, hi]);
        let after = self.out.list.len() as u32;
        self.out.slivers.push(Sliver { stop, lo, hi, source: self.source, ends, length_mm, after });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_coordinate_leaves_where_it_crosses_the_limit_that_its_end_lies_beyond() {
        let coordinate = |from, to| LinearCoordinate { from, to, lo: 0.0, hi: 10.0 };
        assert_eq!(coordinate(5.0, 15.0).leaves(), Some(0.5));
        assert_eq!(coordinate(5.0, -15.0).leaves(), Some(0.25));
        assert_eq!(coordinate(5.0, 10.0).leaves(), None, "the limit belongs to what is admitted");
        assert_eq!(coordinate(5.0, 10.0 + EPS / 2.0).leaves(), None, "and so does what rounding may do");
        assert!(coordinate(5.0, 15.0).is_inside(0.5) && !coordinate(5.0, 15.0).is_inside(0.6));
        assert!(!coordinate(-5.0, 5.0).is_inside(0.0) && coordinate(-5.0, 5.0).is_inside(0.5));
    }

    #[test]
    fn of_two_places_the_one_on_the_later_piece_comes_later() {
        let place = |piece, t| StrokePlace { piece, t };
        assert_eq!(place(1, 0.9).order(&place(2, 0.1)), Ordering::Less);
        assert_eq!(place(2, 0.2).order(&place(2, 0.1)), Ordering::Greater);
        assert_eq!(place(2, 0.1).order(&place(2, 0.1)), Ordering::Equal);
    }
}
