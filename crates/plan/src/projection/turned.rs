//! The heights of the texture on a part that is turned for each place by itself.
//!
//! Heights are those of the turned part. What a turned beam does not reach is found here as well: where the
//! part is one plain sheet within reach, nothing can stand in the beam's way; elsewhere the beam is followed
//! from points of the marks close to each other.

use super::footprint::{HeightRange, Heights};
use super::{GridTracer, Keep, Piece, segments};
use terrace_core::geom::{Box2, Nm, P2, P3, Turn, Turned};
use terrace_core::machine::TiltAngles;
use terrace_core::math;
use terrace_core::program::Sections;

/// A place that is marked at one turn of the part.
#[derive(Clone, Debug)]
pub struct TiltedField {
    /// Commands of the tilt axes, millionths of a degree.
    pub tilt: TiltAngles,
    /// What they make of the part.
    pub turn: Turn,
    /// The point of the turned part under the optical axis, where the stage can stand.
    pub centre: P2<Turned>,
    /// What of the plane it is made for.
    pub area: Box2,
    /// The part's highest place that could stand in the way of the beam, nm.
    pub top: f64,
    /// Whether its stops may mark their windows beyond the area: nothing there is hidden from them.
    pub is_wide: bool,
}

/// Which place of the plane is marked at which turn.
#[derive(Clone, Debug)]
pub struct TiltedFields {
    /// The places are made of cells of this grid.
    pub grid: Sections,
    /// What is known of every cell.
    pub cells: Vec<TiltedCell>,
    /// All fields.
    pub list: Vec<TiltedField>,
    /// Half the window of a stop.
    pub half: [Nm; 2],
}

/// One cell of the grid of [`TiltedFields`].
#[derive(Clone, Debug, Default)]
pub struct TiltedCell {
    /// Index of its field.
    pub field: u32,
    /// The fields of other cells whose windows reach here and may find something hidden.
    pub doubtful: Vec<u32>,
}

/// What one field must hold of all marks.
#[derive(Clone, Debug, Default)]
pub struct FieldMarks {
    heights: Heights,
    /// The heights of every stroke that is to stay whole.
    pub figures: Vec<HeightRange>,
    /// Whether the part hides a mark from the turned beam, or the beam meets one beyond the limit.
    pub is_hidden: bool,
    /// Whether that is so of a mark that lies in the window beyond the area.
    pub is_occluded: bool,
    /// Whether a mark lies outside the window.
    pub is_outside_window: bool,
    /// Whether a stroke that is to stay whole reaches beyond the area, where stops must not be kept to it.
    pub is_over: bool,
}

impl FieldMarks {
    /// The intervals of height, upwards, of what may be cut.
    pub fn heights(&self) -> &[HeightRange] {
        self.heights.intervals()
    }
}

impl TiltedFields {
    /// The index of a cell by column and row.
    fn index(&self, [column, row]: [i64; 2]) -> usize {
        (row * i64::from(self.grid.count[0]) + column) as usize
    }

    /// The field that faces a cell, by its index.
    fn field_of(&self, cell: [i64; 2]) -> usize {
        self.cells[self.index(cell)].field as usize
    }
}

/// What all fields must hold.
#[derive(Clone, Debug)]
pub struct MarksByField(pub Vec<FieldMarks>);

/// Distance of the points of a mark from which the beam is followed, nm.
const SPACING: f64 = 50_000.0;

/// The ends of a mark, which may lie at the foot of a wall, are looked at this far inside, nm: as far as possible, so
/// that walls of some 100 nm, as folds of a mesh have, do not keep a section upright, and within the 10 nm of a mark
/// that `terrace verify` lets another sheet hide, less the 0.7 nm of either rounding.
const INSIDE: f64 = 8.0;

/// A beam counts as hidden if the part rises above it by more than this, nm.
const GRAZE: f64 = 20.0;

impl MarksByField {
    /// Nothing in any of `count` fields.
    pub fn new(count: usize) -> Self {
        Self(vec![FieldMarks::default(); count])
    }

    /// Adds one stroke, traced over the grid of the fields.
    pub fn add(&mut self, points: &[P2], tracer: &mut GridTracer<'_>, fields: &TiltedFields, keep: Keep) {
        if let Some(bounds) = keep.bounds(points)
            && self.add_figure(points, &bounds, tracer, fields)
        {
            return;
        }
        for (a, b) in segments(points) {
            self.add_segment(&[a, b], tracer, fields);
        }
    }

    /// Adds a stroke that is to stay whole to the field of its middle, if that can take all of it; `bounds` is its box.
    fn add_figure(&mut self, points: &[P2], bounds: &Box2, tracer: &mut GridTracer<'_>, fields: &TiltedFields) -> bool {
        let middle = [(0, bounds.lo.x + bounds.hi.x), (1, bounds.lo.y + bounds.hi.y)];
        let i = fields.field_of(middle.map(|(axis, sum)| fields.grid.along(axis, sum / 2, 0)));
        let field = &fields.list[i];
        let mut z = [f64::INFINITY, f64::NEG_INFINITY];
        let mut is_beside = false;
        let mut is_hidden = false;
        tracer.gap = false;
        for (a, b) in segments(points) {
            let w = &[a, b];
            let pieces = tracer.take_pieces(w);
            for (p, cell) in &pieces {
                self.occlude(p, w, tracer, fields, fields.index(*cell));
                let ends = Ends::of(p, w, field);
                z = [z[0].min(ends.lo()), z[1].max(ends.hi())];
                is_beside |= ends.is_outside_window(field, fields.half);
                // Following the beam is dear, and one hidden place is enough.
                is_hidden = is_hidden || self.0[i].is_hidden || tracer.tracer.hides(p, w, field);
            }
            tracer.small = pieces;
        }
        // Stops that are kept to their area do not mark what of the stroke lies beyond it.
        let is_within = field.area.holds(bounds.lo) && field.area.holds(bounds.hi);
        let is_whole = !tracer.gap && !is_beside && (field.is_wide || is_within);
        if is_whole {
            let here = &mut self.0[i];
            here.is_hidden |= is_hidden;
            here.is_over |= !is_within;
            here.figures.push(HeightRange { lo: z[0], hi: z[1] });
        }
        is_whole
    }

    /// Adds what lies under a segment to the fields of its places.
    fn add_segment(&mut self, w: &[P2], tracer: &mut GridTracer<'_>, fields: &TiltedFields) {
        let pieces = tracer.take_pieces(w);
        // As in the footprint: pieces of one field that follow each other make one interval.
        let mut run: Option<FieldRun> = None;
        for (p, cell) in &pieces {
            self.occlude(p, w, tracer, fields, fields.index(*cell));
            let i = fields.field_of(*cell);
            let field = &fields.list[i];
            let ends = Ends::of(p, w, field);
            let here = &mut self.0[i];
            here.is_outside_window |= ends.is_outside_window(field, fields.half);
            here.is_hidden = here.is_hidden || tracer.tracer.hides(p, w, field);
            match &mut run {
                Some(run) if run.field == i && ends.lo() <= run.hi && ends.hi() >= run.lo => {
                    run.lo = run.lo.min(ends.lo());
                    run.hi = run.hi.max(ends.hi());
                }
                _ => self.end_run(run.replace(FieldRun { field: i, lo: ends.lo(), hi: ends.hi() })),
            }
        }
        self.end_run(run);
        tracer.small = pieces;
    }

    /// Gives the heights of a run to its field.
    fn end_run(&mut self, run: Option<FieldRun>) {
        if let Some(FieldRun { field, lo, hi }) = run {
            self.0[field].heights.add(lo, hi);
        }
    }

    /// Notes the fields of other places that would find a piece hidden in their windows.
    fn occlude(&mut self, p: &Piece, w: &[P2], tracer: &mut GridTracer<'_>, fields: &TiltedFields, cell: usize) {
        let cell = &fields.cells[cell];
        for &k in &cell.doubtful {
            let field = &fields.list[k as usize];
            let here = &mut self.0[k as usize];
            if cell.field != k && !here.is_occluded && field.is_wide {
                here.is_occluded =
                    !Ends::of(p, w, field).is_beyond(field, fields.half) && tracer.tracer.hides(p, w, field);
            }
        }
    }

    /// Joins what another part of the texture found.
    pub fn merge(&mut self, other: Self) {
        for (mine, mut theirs) in self.0.iter_mut().zip(other.0) {
            mine.heights.append(&mut theirs.heights);
            mine.figures.append(&mut theirs.figures);
            mine.is_hidden |= theirs.is_hidden;
            mine.is_occluded |= theirs.is_occluded;
            mine.is_outside_window |= theirs.is_outside_window;
            mine.is_over |= theirs.is_over;
        }
    }

    /// What all fields must hold with its intervals joined and sorted, as [`FieldMarks::heights`] needs them.
    #[must_use]
    pub fn joined(mut self) -> Self {
        for f in &mut self.0 {
            f.heights.join();
            f.figures.sort_unstable_by(HeightRange::total_cmp);
        }
        self
    }
}

/// The heights of pieces that follow each other in one field, by its index, on the turned part.
struct FieldRun {
    field: usize,
    lo: f64,
    hi: f64,
}

impl GridTracer<'_> {
    /// The marked pieces of the segment `w` with their cells, in the tracer's own list: whoever takes it gives it back.
    fn take_pieces(&mut self, w: &[P2]) -> Vec<(Piece, [i64; 2])> {
        let mut list = std::mem::take(&mut self.small);
        list.clear();
        self.segment(w[0], w[1], |p, cell| list.push((p, cell)));
        list
    }
}

/// Both ends of a piece on the turned part.
struct Ends([P3<Turned>; 2]);

impl Ends {
    fn of(p: &Piece, w: &[P2], field: &TiltedField) -> Self {
        Self([(p.t0, p.z0), (p.t1, p.z1)].map(|(t, z)| field.turn.apply(at(w, t, z))))
    }
    fn lo(&self) -> f64 {
        self.0[0][2].min(self.0[1][2])
    }
    fn hi(&self) -> f64 {
        self.0[0][2].max(self.0[1][2])
    }
    /// Whether both lie outside the window on one side.
    fn is_beyond(&self, field: &TiltedField, half: [Nm; 2]) -> bool {
        let c = [field.centre.x, field.centre.y];
        let off = |k: usize, end: usize| self.0[end][k] - c[k] as f64;
        (0..2).any(|k| off(k, 0).min(off(k, 1)) > half[k].f64() || off(k, 0).max(off(k, 1)) < -half[k].f64())
    }
    /// Whether an end lies outside the window.
    fn is_outside_window(&self, field: &TiltedField, half: [Nm; 2]) -> bool {
        let c = [field.centre.x, field.centre.y];
        self.0.iter().any(|p| (0..2).any(|k| (p[k] - c[k] as f64).abs() > half[k].f64()))
    }
}

/// A point of the segment `w`.
fn at(w: &[P2], t: f64, z: f64) -> P3 {
    let [a, b] = [w[0], w[1]];
    P3::new([a.x as f64 + t * (b.x - a.x) as f64, a.y as f64 + t * (b.y - a.y) as f64, z])
}

impl super::Tracer<'_> {
    /// Whether the part hides some of a piece of the segment `w` from the turned beam, or the beam meets it at
    /// too large an angle.
    fn hides(&mut self, p: &Piece, w: &[P2], field: &TiltedField) -> bool {
        if field.turn.slope2(self.surface.normal(p.facet)) > self.trail.max_slope2() {
            return true;
        }
        let [x, y, z] = field.turn.up();
        let lean = [x / z, y / z];
        // The beam goes aside by this for every nanometre that it rises: above `top` nothing stands in its way, so what
        // does lies within `reach` of the mark.
        let aside = math::hypot(lean[0], lean[1]);
        let lowest = p.z0.min(p.z1);
        let reach = (field.top - lowest).max(0.0) * aside;
        // What is so near is not seen at the ends of a mark either.
        if reach < INSIDE {
            return false;
        }
        let (a, b) = (w[0].lerp(w[1], p.t0), w[0].lerp(w[1], p.t1));
        // The ends are rounded, and so are those of the beam.
        let r = reach.ceil() as i64 + 2;
        let lo = P2::new(a.x.min(b.x) - r, a.y.min(b.y) - r);
        if self.surface.is_plain(lo, P2::new(a.x.max(b.x) + r, a.y.max(b.y) + r)) {
            return false;
        }
        let length = a.distance(b);
        // The share of the piece by which its ends are looked at further inside.
        let inset = if length > 0.0 { (INSIDE / length).min(0.5) } else { 0.0 };
        // At least both ends and the middle.
        let count = (length / SPACING).ceil().max(2.0) as i64;
        (0..=count).any(|i| {
            let t = p.t0 + (p.t1 - p.t0) * (inset + (1.0 - 2.0 * inset) * i as f64 / count as f64);
            self.is_hidden(at(w, t, p.z(t)), lean, field.top)
        })
    }

    /// Whether the part rises above the beam that comes to `p` from where it leans, below the height `top`.
    fn is_hidden(&mut self, p: P3, lean: [f64; 2], top: f64) -> bool {
        let [x, y, z] = p.at;
        let from = P2::new(x.round() as i64, y.round() as i64);
        let [dx, dy] = lean.map(|l| (l * (top - z + GRAZE)).round() as i64);
        let to = P2::new(from.x + dx, from.y + dy);
        if to == from {
            return false;
        }
        let rise = top - z + GRAZE;
        self.surface.walk(from, to, &mut self.beam, &mut self.beam_spans);
        self.beam_spans.iter().filter(|s| s.facet().is_some()).any(|s| {
            // The rounding of the start is worth as much as the surface rises over a nanometre.
            let is_above_beam = |height: f64, t: f64| height > z + t * rise + GRAZE;
            is_above_beam(s.z0, s.t0) || is_above_beam(s.z1, s.t1)
        })
    }
}
