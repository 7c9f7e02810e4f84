//! Strokes are traced and cut where they leave their block.
//!
//! Consumes texture strokes, a [`Tracer`] and the stops; promises fragments that, with what was
//! skipped, tile every stroke: a cut point is computed once, rounded once to the nanometre grid and
//! used by both sides, so mark + skipped = texture. A point on the border of two levels belongs to the
//! upper one, a point on the border of two sections to the side the stroke goes to; a stroke along a
//! border is marked once. A fragment whose points all round to one is none.

use crate::geom::{NM_PER_MM, P2};
use crate::partition::Stops;
use crate::trace::{Piece, Skip, Tracer};

/// A piece of one stroke that is marked in one block.
#[derive(Clone, Copy, Debug)]
pub struct Fragment {
    /// Index of its stop.
    pub stop: u32,
    /// Stroke of the texture.
    pub source: u32,
    /// Segment of that stroke on which it begins.
    pub segment: u32,
    /// Pen.
    pub pen: u16,
    /// First point in [`Fragments::points`].
    pub first: u32,
    /// How many points.
    pub len: u32,
    /// Whether it is the whole of a closed stroke, which may be marked from any of its vertices.
    pub is_figure: bool,
    /// Lowest and highest height, nm.
    pub z: [f64; 2],
    /// Integral of height over length, nm · nm.
    pub z_length: f64,
    /// Length along the stroke before its ends were rounded, nm.
    pub length: f64,
}

/// Lengths that were not marked, mm, every pass counted.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Skipped {
    /// Off the part.
    pub off_part: f64,
    /// Steeper than the limit.
    pub steep: f64,
    /// Fragments below the shortest mark.
    pub small: f64,
}

/// What became of a run of strokes.
#[derive(Clone, Debug, Default)]
pub struct Fragments {
    /// In the order of the texture.
    pub list: Vec<Fragment>,
    /// Points of all fragments, field frame of their stops, nm.
    pub points: Vec<[i32; 2]>,
    /// Length of the strokes, mm, every pass counted.
    pub texture_mm: f64,
    /// What was not marked.
    pub skipped: Skipped,
    /// Strokes in more than one fragment.
    pub strokes_cut: usize,
    /// Closed strokes marked as one fragment.
    pub figures_whole: usize,
    /// Closed strokes that were cut or partly skipped.
    pub figures_cut: usize,
    /// A place that was too steep, if any was.
    pub steep_at: Option<P2>,
    /// Largest squared slope of the marks.
    pub worst_slope2: f64,
}

/// The fragment being built.
struct Open {
    stop: usize,
    segment: u32,
    first: usize,
    z: [f64; 2],
    z_length: f64,
    /// The exact length that `z_length` was summed over: that of the rounded points would not do, because
    /// every nanometre counts with the whole height.
    length: f64,
}

/// Cuts strokes between the stops of several candidates, over one walk.
pub struct Splitter<'a> {
    tracer: Tracer<'a>,
    cutters: Vec<Cutter<'a>>,
}

impl<'a> Splitter<'a> {
    /// Fragments shorter than `min_mark_nm` are skipped and counted.
    pub fn new(tracer: Tracer<'a>, candidates: &'a [Stops], min_mark_nm: f64) -> Self {
        Self { tracer, cutters: candidates.iter().map(|stops| Cutter::new(stops, min_mark_nm)).collect() }
    }

    /// What became of all strokes given so far, by candidate.
    pub fn finish(self) -> impl Iterator<Item = Fragments> {
        let worst_slope2 = self.tracer.worst_slope2;
        self.cutters.into_iter().map(move |c| Fragments { worst_slope2, ..c.out })
    }

    /// Cuts one stroke of the texture, which its pen marks `passes` times.
    pub fn stroke(&mut self, source: u32, pen: u16, passes: u32, points: &[P2]) {
        let Self { tracer, cutters } = self;
        cutters.iter_mut().for_each(|c| c.begin(source, pen, passes));
        for (i, w) in points.windows(2).enumerate() {
            let [a, b] = [w[0], w[1]];
            tracer.segment(a, b, |piece| cutters.iter_mut().for_each(|c| c.piece(i as u32, a, b, piece)));
            cutters.iter_mut().for_each(|c| c.vertex(i as u32, a, b));
        }
        cutters.iter_mut().for_each(|c| c.end(points));
    }
}

/// Cuts strokes between the stops of one candidate.
struct Cutter<'a> {
    stops: &'a Stops,
    min_mark: f64,
    out: Fragments,
    open: Option<Open>,
    /// Why the stroke is not marked here, and since where on the segment.
    unmarked: Option<(Skip, P2)>,
    source: u32,
    pen: u16,
    passes: f64,
    /// Fragments and skipped lengths before the stroke.
    before: (usize, Skipped),
}

impl<'a> Cutter<'a> {
    fn new(stops: &'a Stops, min_mark: f64) -> Self {
        let out = Fragments::default();
        let before = (0, out.skipped);
        Self { stops, min_mark, out, open: None, unmarked: None, source: 0, pen: 0, passes: 1.0, before }
    }

    fn begin(&mut self, source: u32, pen: u16, passes: u32) {
        (self.source, self.pen, self.passes) = (source, pen, f64::from(passes));
        self.before = (self.out.list.len(), self.out.skipped);
    }

    fn end(&mut self, points: &[P2]) {
        self.close(points[points.len() - 1]);
        let out = &mut self.out;
        let parts = out.list.len() - self.before.0;
        out.strokes_cut += usize::from(parts > 1);
        if points[0] == points[points.len() - 1] {
            if parts == 1 && out.skipped == self.before.1 {
                out.figures_whole += 1;
                let last = out.list.last_mut();
                last.into_iter().for_each(|f| f.is_figure = f.len as usize == points.len());
            } else {
                out.figures_cut += 1;
            }
        }
    }

    fn piece(&mut self, segment: u32, a: P2, b: P2, p: Piece) {
        let section = match p.on {
            Ok(section) => section,
            Err(skip) => {
                if self.unmarked.is_none_or(|(why, _)| why != skip) {
                    let from = a.lerp(b, p.t0);
                    self.close(from);
                    self.end_unmarked(from, [a, b]);
                    self.unmarked = Some((skip, from));
                }
                return;
            }
        };
        if self.unmarked.is_some() {
            self.end_unmarked(a.lerp(b, p.t0), [a, b]);
        }
        let range = self.stops.of_section(section);
        let list = &self.stops.stops;
        let length = a.distance(b);
        let rises = p.z1 >= p.z0;
        // Most pieces go on where the last one ended.
        let accepts = |stop: usize| {
            (stop == range.start || list[stop].z_lo as f64 <= p.z0)
                && (stop + 1 == range.end || p.z0 < list[stop + 1].z_lo as f64)
        };
        let same = self.open.as_ref().map(|o| o.stop).filter(|&stop| range.contains(&stop) && accepts(stop));
        let Some(mut stop) = same.or_else(|| self.stops.at(section, p.z0)) else { return };
        if !rises && stop > range.start && p.z0 <= list[stop].z_lo as f64 {
            stop -= 1;
        }
        let (mut t, mut z) = (p.t0, p.z0);
        loop {
            // The height at which the piece leaves this stop, if it does.
            let limit = if rises {
                (stop + 1 < range.end).then(|| list[stop + 1].z_lo as f64).filter(|&l| p.z1 > l)
            } else {
                (stop > range.start).then(|| list[stop].z_lo as f64).filter(|&l| p.z1 < l)
            };
            let (t_end, z_end) = match limit {
                Some(l) => (p.t0 + (p.t1 - p.t0) * ((l - p.z0) / (p.z1 - p.z0)), l),
                None => (p.t1, p.z1),
            };
            self.mark(stop, segment, a.lerp(b, t), [z, z_end], (t_end - t).max(0.0) * length);
            if limit.is_none() {
                return;
            }
            (t, z) = (t_end, z_end);
            stop = if rises { stop + 1 } else { stop - 1 };
            self.close(a.lerp(b, t));
        }
    }

    /// Counts what was not marked up to `to`, as one stretch along the segment: its facets may be smaller
    /// than the grid to which their borders would be rounded.
    fn end_unmarked(&mut self, to: P2, [a, b]: [P2; 2]) {
        let Some((skip, from)) = self.unmarked.take() else { return };
        let dot = (b.x - a.x) as f64 * (to.x - from.x) as f64 + (b.y - a.y) as f64 * (to.y - from.y) as f64;
        let length = self.passes * dot.max(0.0) / a.distance(b) / NM_PER_MM;
        match skip {
            Skip::OffPart => self.out.skipped.off_part += length,
            Skip::Steep => {
                self.out.skipped.steep += length;
                if length > 0.0 {
                    self.out.steep_at.get_or_insert(from);
                }
            }
        }
    }

    /// Goes on in `stop` from `from`, over heights `z` and a stretch of `length` nm.
    fn mark(&mut self, stop: usize, segment: u32, from: P2, z: [f64; 2], length: f64) {
        if self.open.as_ref().is_some_and(|o| o.stop != stop) {
            self.close(from);
        }
        let open = self.open.get_or_insert_with(|| {
            let first = self.out.points.len();
            self.out.points.push(local(self.stops, stop, from));
            Open { stop, segment, first, z: [f64::INFINITY, f64::NEG_INFINITY], z_length: 0.0, length: 0.0 }
        });
        open.z = [open.z[0].min(z[0]).min(z[1]), open.z[1].max(z[0]).max(z[1])];
        open.z_length += (z[0] + z[1]) / 2.0 * length;
        open.length += length;
    }

    /// The end b of `segment` from a: a vertex of the open fragment.
    fn vertex(&mut self, segment: u32, a: P2, b: P2) {
        self.out.texture_mm += self.passes * a.distance(b) / NM_PER_MM;
        self.end_unmarked(b, [a, b]);
        if let Some(open) = &mut self.open {
            let p = local(self.stops, open.stop, b);
            if self.out.points[self.out.points.len() - 1] != p {
                self.out.points.push(p);
            } else if self.out.points.len() == open.first + 1 {
                // All there is of the fragment is this vertex: it begins on the next segment.
                open.segment = segment + 1;
                open.z = [f64::INFINITY, f64::NEG_INFINITY];
                open.z_length = 0.0;
                open.length = 0.0;
            }
        }
    }

    /// Ends the open fragment at `end`.
    fn close(&mut self, end: P2) {
        let Some(open) = self.open.take() else { return };
        let p = local(self.stops, open.stop, end);
        if self.out.points[self.out.points.len() - 1] != p {
            self.out.points.push(p);
        }
        let points = &self.out.points[open.first..];
        let length = crate::program::stroke_mm(points) * NM_PER_MM;
        if points.len() < 2 || length < self.min_mark {
            self.out.skipped.small += self.passes * length / NM_PER_MM;
            self.out.points.truncate(open.first);
            return;
        }
        self.out.list.push(Fragment {
            stop: open.stop as u32,
            source: self.source,
            segment: open.segment,
            pen: self.pen,
            first: open.first as u32,
            len: points.len() as u32,
            is_figure: false,
            z: open.z,
            z_length: open.z_length,
            length: open.length,
        });
    }
}

/// A part point in the field frame of a stop. Sections are smaller than 2.1 m, so it fits.
fn local(stops: &Stops, stop: usize, p: P2) -> [i32; 2] {
    let c = stops.stops[stop].centre;
    [(p.x - c.x) as i32, (p.y - c.y) as i32]
}
