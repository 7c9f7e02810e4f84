//! What of the texture is not marked: where, how much, and why. In the first pass; the others have the same texture,
//! turned or shifted.
//!
//! Lengths are of all of it. Of the lines at most [`MOST`] in every chunk of strokes are kept for pictures; how many
//! are not is stated.

use std::collections::BTreeMap;
use std::ops::Range;

use super::relief::Relief;
use terrace_core::geom::{Box2, Grid, NM_PER_MM, P2, length_mm};
use terrace_core::parallel;
use terrace_input::job::Job;
use terrace_input::surface::Surface;
use terrace_input::texture::Texture;
use terrace_plan::manifest::LeftOut;
use terrace_plan::plan::{OnTheFlyPlan, SteppedPlan};
use terrace_plan::projection::{Piece, Skip, Tracer, segments};

/// Strokes of a chunk.
const CHUNK: usize = 4096;
/// Lines that are kept of each chunk.
const MOST: usize = 1000;
/// Lines that are kept of pieces too short to be marked, which are not found by chunks.
const MOST_SMALL: usize = 20 * MOST;

/// Why texture is not marked.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Reason {
    /// The job places it, and it lies off the part.
    OffPart,
    /// The line lies over a hole of the part.
    Hole,
    /// The surface is steeper than the limit.
    Steep,
    /// A piece too short to be marked.
    Small,
    /// On the fly: the axes cannot keep it in focus.
    Focus,
    /// A pattern over the part's box, beyond the part: it is limited to the part by its meaning.
    Beyond,
}

impl Reason {
    /// The reason's name in data.
    pub fn name(self) -> &'static str {
        match self {
            Self::OffPart => "off-part",
            Self::Hole => "hole",
            Self::Steep => "steep",
            Self::Small => "small",
            Self::Focus => "focus",
            Self::Beyond => "beyond",
        }
    }

    /// In words.
    pub fn text(self) -> &'static str {
        match self {
            Self::OffPart => "off the part",
            Self::Hole => "over a hole",
            Self::Steep => "too steep",
            Self::Small => "too small",
            Self::Focus => "out of focus next to a step",
            Self::Beyond => "pattern beyond the part",
        }
    }

    /// Whether it is drawn in red: what the user may take for marked.
    pub(crate) fn is_fault(self) -> bool {
        self != Self::Beyond
    }
}

/// The texture that is not marked.
#[derive(Clone, Debug, Default)]
pub struct Unmarked {
    /// By reason and texture.
    pub rows: Vec<UnmarkedRow>,
    /// Where it lies.
    pub lines: Vec<UnmarkedLine>,
    /// Lines that are counted in the rows and are not among these.
    pub lines_left_out: usize,
}

/// How much of a texture is not marked for a reason.
#[derive(Clone, Debug, PartialEq)]
pub struct UnmarkedRow {
    /// Why.
    pub reason: Reason,
    /// Number of the texture in the job, from 1.
    pub texture: usize,
    /// Length, mm, once.
    pub length_mm: f64,
    /// Dots.
    pub dots: u64,
    /// The share of the texture's length, or of its dots, percent.
    pub share_percent: f64,
    /// The box around it.
    pub area: Box2,
}

/// A line that is not marked, or a dot.
#[derive(Clone, Debug, PartialEq)]
pub struct UnmarkedLine {
    /// Index of its row.
    pub row: usize,
    /// The points of the line, mm; off the part at the height of the part next to it.
    pub points: Vec<[f64; 3]>,
}

/// How much texture is not marked for one reason.
#[derive(Clone, Copy)]
struct UnmarkedSum {
    /// Length, nm: whole numbers, so that the order of adding changes nothing.
    length: i64,
    dots: u64,
    area: Box2,
}

impl Default for UnmarkedSum {
    fn default() -> Self {
        Self { length: 0, dots: 0, area: Box2::EMPTY }
    }
}

/// The points of a line, mm.
type Line = Vec<[f64; 3]>;

/// Lines, each with the index of its texture.
type Lines = Vec<(usize, Line)>;

/// What is not marked of a chunk of strokes.
#[derive(Default)]
struct ChunkUnmarked {
    /// Length of the whole chunk, nm.
    length: i64,
    /// Dots of the whole chunk.
    dots: u64,
    sums: BTreeMap<Reason, UnmarkedSum>,
    lines: Vec<(Reason, Line)>,
    /// Lines that are not kept.
    left_out: usize,
}

/// What is not marked of a stepped job.
pub(super) fn of_stepped(plan: &SteppedPlan, relief: &Relief) -> Unmarked {
    let s = &plan.summary;
    let mut out = Unmarked::default();
    if s.skipped_off_part_mm > 0.0 || s.skipped_steep_mm > 0.0 || s.dots.texture > s.dots.marked {
        out = traced(&plan.job, &plan.passes[0].strokes, &plan.inputs.surface, relief);
    }
    let mut sums: BTreeMap<usize, UnmarkedSum> = BTreeMap::new();
    let mut lines = Vec::new();
    for sliver in &plan.slivers {
        let ends = sliver.ends;
        let k = plan.passes[0].strokes.part_of(sliver.source.index());
        let sum = sums.entry(k).or_default();
        let flat = ends.map(|[x, y, _]| P2::new(x.round() as i64, y.round() as i64));
        sum.length += flat[0].distance(flat[1]).round() as i64;
        flat.iter().for_each(|&p| sum.area.add(p));
        if lines.len() < MOST_SMALL {
            lines.push((k, ends.map(|p| p.map(|v| v / NM_PER_MM)).to_vec()));
        } else {
            out.lines_left_out += 1;
        }
    }
    out.add_rows(Reason::Small, &sums, lines, |k| lengths(&plan.passes[0].strokes, k));
    out.sort();
    out
}

/// What is not marked of an on-the-fly job.
pub(super) fn of_on_the_fly(plan: &OnTheFlyPlan, relief: &Relief) -> Unmarked {
    let s = &plan.summary.lengths;
    let texture = &plan.texture;
    let mut out = Unmarked::default();
    if s.skipped_off_part_mm > 0.0 || s.skipped_steep_mm > 0.0 {
        out = traced(&plan.job, texture, &plan.inputs.surface, relief);
    }
    let mut sums: BTreeMap<usize, UnmarkedSum> = BTreeMap::new();
    let mut lines = Vec::new();
    let mut drawn = Vec::new();
    let mut tracer = Tracer::new(&plan.inputs.surface, f64::INFINITY);
    for left in &plan.left_out {
        texture.stroke(left.stroke as usize, &mut drawn);
        let points = stretch(&drawn, left);
        let k = texture.part_of(left.stroke as usize);
        let sum = sums.entry(k).or_default();
        sum.length += ((left.to_mm - left.from_mm) * NM_PER_MM).round() as i64;
        points.iter().for_each(|&p| sum.area.add(p));
        lines.push((k, line_on_part(&mut tracer, &points)));
    }
    out.add_rows(Reason::Focus, &sums, lines, |k| lengths(texture, k));
    out.sort();
    out
}

/// The line of some points as it lies on the part.
fn line_on_part(tracer: &mut Tracer<'_>, points: &[P2]) -> Line {
    let mut line = Vec::new();
    for (a, b) in segments(points) {
        tracer.segment(a, b, |piece| {
            line.extend([(piece.t0, piece.z0), (piece.t1, piece.z1)].map(|(t, z)| {
                let [x, y] = a.lerp(b, t).mm();
                [x, y, z / NM_PER_MM]
            }));
        });
    }
    line.dedup();
    line
}

/// The stretch of a stroke that is left out; of a closed one it may run on over the end.
fn stretch(drawn: &[P2], left: &LeftOut) -> Vec<P2> {
    let whole = length_mm(drawn);
    let mut out = Vec::new();
    // Way along the stroke to the segment that is looked at, mm; the second round continues it.
    let mut way = 0.0;
    for round in 0..2 {
        for w in drawn.windows(2) {
            let length = w[0].distance(w[1]) / NM_PER_MM;
            let (from, to) = (left.from_mm.max(way), left.to_mm.min(way + length));
            if from < to && length > 0.0 {
                out.extend([from, to].map(|v| w[0].lerp(w[1], ((v - way) / length).clamp(0.0, 1.0))));
            }
            way += length;
        }
        if left.to_mm <= whole || round == 1 || drawn.first() != drawn.last() {
            break;
        }
    }
    out.dedup();
    out
}

/// Length, nm, and dots of a texture.
fn lengths(texture: &Texture, k: usize) -> [f64; 2] {
    let strokes = texture.strokes_of(k);
    let sums = parallel::map(strokes.len().div_ceil(CHUNK), |i| {
        let mut points = Vec::new();
        let mut sum = [0.0; 2];
        for stroke in chunk(&strokes, i) {
            texture.stroke(stroke, &mut points);
            sum[0] += length_mm(&points) * NM_PER_MM;
            sum[1] += f64::from(u8::from(points.len() == 1));
        }
        sum
    });
    sums.into_iter().fold([0.0; 2], |a, b| [a[0] + b[0], a[1] + b[1]])
}

/// The strokes of chunk `i`.
fn chunk(strokes: &Range<usize>, i: usize) -> Range<usize> {
    (strokes.start + i * CHUNK)..(strokes.start + (i + 1) * CHUNK).min(strokes.end)
}

/// Traces all textures over the part.
fn traced(job: &Job, texture: &Texture, surface: &Surface, relief: &Relief) -> Unmarked {
    let outside = Outside::of(relief);
    let level = relief.range_mm().map_or(0.0, |[lo, hi]| f64::from(lo + hi) / 2.0);
    let mut out = Unmarked::default();
    for (k, request) in job.textures.iter().enumerate() {
        let strokes = texture.strokes_of(k);
        let rules = SkipRules { is_placed: request.is_placed(), outside: &outside, level };
        let chunks = parallel::map(strokes.len().div_ceil(CHUNK), |i| {
            let mut unmarked = ChunkUnmarked::default();
            let mut tracer = Tracer::new(surface, job.limits.max_slope());
            let mut points = Vec::new();
            for stroke in chunk(&strokes, i) {
                texture.stroke(stroke, &mut points);
                unmarked.add_stroke(&mut tracer, &points, &rules);
            }
            unmarked
        });
        let whole = chunks.iter().fold([0.0; 2], |a, c| [a[0] + c.length as f64, a[1] + c.dots as f64]);
        let ChunkUnmarked { sums, lines, left_out, .. } = joined(chunks);
        out.lines_left_out += left_out;
        let mut by_reason: BTreeMap<Reason, Lines> = BTreeMap::new();
        lines.into_iter().for_each(|(reason, line)| by_reason.entry(reason).or_default().push((k, line)));
        for (reason, sum) in sums {
            let lines = by_reason.remove(&reason).unwrap_or_default();
            out.add_rows(reason, &BTreeMap::from([(k, sum)]), lines, |_| whole);
        }
    }
    out
}

/// What is not marked of all chunks.
fn joined(chunks: Vec<ChunkUnmarked>) -> ChunkUnmarked {
    let mut whole = ChunkUnmarked::default();
    for chunk in chunks {
        whole.length += chunk.length;
        whole.dots += chunk.dots;
        for (reason, sum) in chunk.sums {
            let into = whole.sums.entry(reason).or_default();
            into.length += sum.length;
            into.dots += sum.dots;
            into.area = into.area.union(sum.area);
        }
        whole.lines.extend(chunk.lines);
        whole.left_out += chunk.left_out;
    }
    whole
}

impl Unmarked {
    /// Appends rows of one reason, by texture, and their lines; `whole` is the length, nm, and the dots of a texture.
    fn add_rows(
        &mut self,
        reason: Reason,
        sums: &BTreeMap<usize, UnmarkedSum>,
        lines: Lines,
        whole: impl Fn(usize) -> [f64; 2],
    ) {
        let first = self.rows.len();
        let keys: Vec<usize> = sums.keys().copied().collect();
        for (&k, sum) in sums {
            let [length, dots] = whole(k);
            let share = (sum.length as f64 / length.max(1.0)).max(sum.dots as f64 / dots.max(1.0));
            self.rows.push(UnmarkedRow {
                reason,
                texture: k + 1,
                length_mm: sum.length as f64 / NM_PER_MM,
                dots: sum.dots,
                share_percent: 100.0 * share,
                area: sum.area,
            });
        }
        let row = |k: usize| keys.binary_search(&k).map(|i| first + i);
        let lines = lines.into_iter().filter_map(|(k, points)| Some(UnmarkedLine { row: row(k).ok()?, points }));
        self.lines.extend(lines);
    }

    /// Rows by reason, faults first.
    fn sort(&mut self) {
        let mut order: Vec<usize> = (0..self.rows.len()).collect();
        order.sort_by_key(|&i| (self.rows[i].reason, self.rows[i].texture));
        let place: BTreeMap<usize, usize> = order.iter().enumerate().map(|(to, &from)| (from, to)).collect();
        self.rows = order.iter().map(|&i| self.rows[i].clone()).collect();
        self.lines.iter_mut().for_each(|line| line.row = place[&line.row]);
        self.lines.sort_by_key(|line| line.row);
    }
}

/// What decides for which reason a piece is not marked.
struct SkipRules<'a> {
    /// Whether the job places the texture, so that what lies off the part is a fault.
    is_placed: bool,
    outside: &'a Outside,
    /// Height of what has no part near it, mm.
    level: f64,
}

impl SkipRules<'_> {
    /// The reason for a piece around `middle`.
    fn reason(&self, skip: Skip, middle: P2) -> Reason {
        match skip {
            Skip::Steep => Reason::Steep,
            Skip::OffPart if !self.outside.holds(middle) => Reason::Hole,
            Skip::OffPart if self.is_placed => Reason::OffPart,
            Skip::OffPart => Reason::Beyond,
        }
    }
}

impl ChunkUnmarked {
    /// Adds what is not marked of a stroke.
    fn add_stroke(&mut self, tracer: &mut Tracer<'_>, points: &[P2], rules: &SkipRules<'_>) {
        let is_dot = points.len() == 1;
        self.dots += u64::from(is_dot);
        let mut length = 0f64;
        let mut stroke = StrokeUnmarked::new(is_dot);
        for (a, b) in segments(points) {
            length += a.distance(b);
            tracer.segment(a, b, |piece| stroke.add(a, b, &piece, rules, &mut self.sums));
        }
        stroke.end_line();
        self.length += length.round() as i64;
        for (reason, length) in stroke.lengths {
            self.sums.entry(reason).or_default().length += length.round() as i64;
        }
        for (reason, mut line) in stroke.lines {
            if self.lines.len() == MOST {
                self.left_out += 1;
                continue;
            }
            // A line that begins off the part lies at the height of the part where the stroke was last over it.
            let height = stroke.height_mm.unwrap_or(rules.level);
            line.iter_mut().filter(|p| p[2].is_nan()).for_each(|p| p[2] = height);
            self.lines.push((reason, line));
        }
    }
}

/// What is not marked of one stroke, while it is traced.
struct StrokeUnmarked {
    is_dot: bool,
    /// Height of the part where the stroke was last over it, mm.
    height_mm: Option<f64>,
    /// Length by reason, nm.
    lengths: BTreeMap<Reason, f64>,
    /// The line to whose end the stroke is traced.
    open: Option<(Reason, Line)>,
    /// The lines before it.
    lines: Vec<(Reason, Line)>,
}

impl StrokeUnmarked {
    fn new(is_dot: bool) -> Self {
        Self { is_dot, height_mm: None, lengths: BTreeMap::new(), open: None, lines: Vec::new() }
    }

    /// Adds a piece of the segment from `a` to `b`, and what it adds to a chunk to `sums`.
    fn add(&mut self, a: P2, b: P2, piece: &Piece, rules: &SkipRules<'_>, sums: &mut BTreeMap<Reason, UnmarkedSum>) {
        if piece.skip != Some(Skip::OffPart) {
            self.height_mm = Some(piece.z1 / NM_PER_MM);
        }
        let Some(skip) = piece.skip else { return self.end_line() };
        let reason = rules.reason(skip, a.lerp(b, (piece.t0 + piece.t1) / 2.0));
        let sum = sums.entry(reason).or_default();
        sum.dots += u64::from(self.is_dot);
        *self.lengths.entry(reason).or_default() += a.distance(b) * (piece.t1 - piece.t0);
        let ends = [(piece.t0, piece.z0), (piece.t1, piece.z1)].map(|(t, z)| {
            let p = a.lerp(b, t);
            sum.area.add(p);
            let [x, y] = p.mm();
            // Off the part a piece has no height: it lies at that of the part before it, if there is one.
            [x, y, if skip == Skip::Steep { z / NM_PER_MM } else { self.height_mm.unwrap_or(f64::NAN) }]
        });
        match &mut self.open {
            Some((last, line)) if *last == reason => line.push(ends[1]),
            _ => {
                self.end_line();
                let line = if self.is_dot { vec![ends[0]] } else { ends.to_vec() };
                self.open = Some((reason, line));
            }
        }
    }

    /// Ends the open line, if there is one.
    fn end_line(&mut self) {
        self.lines.extend(self.open.take());
    }
}

/// Which cells without part are connected with the rim of the grid.
struct Outside {
    grid: Grid,
    cells: Vec<bool>,
}

impl Outside {
    /// Floods the cells without part of a relief from its rim.
    fn of(relief: &Relief) -> Self {
        let (columns, rows) = (relief.grid.columns(), relief.grid.rows());
        let mut cells = vec![false; relief.z_mm.len()];
        let rim = (0..cells.len()).filter(|i| {
            let (x, y) = (i % columns, i / columns);
            x == 0 || y == 0 || x + 1 == columns || y + 1 == rows
        });
        let mut open: Vec<usize> = rim.filter(|&i| relief.z_mm[i].is_nan()).collect();
        open.iter().for_each(|&i| cells[i] = true);
        while let Some(i) = open.pop() {
            for next in relief.grid.around(i) {
                if relief.z_mm[next].is_nan() && !cells[next] {
                    cells[next] = true;
                    open.push(next);
                }
            }
        }
        Self { grid: relief.grid, cells }
    }

    /// Whether a point off the part lies outside it, not over a hole.
    fn holds(&self, p: P2) -> bool {
        if !self.grid.bounds().holds(p) {
            return true;
        }
        let [x, y] = [(0, p.x), (1, p.y)].map(|(axis, v)| self.grid.along(axis, v, 0) as usize);
        let i = y * self.grid.columns() + x;
        // A point at the very rim may share its cell with the part: the cells around it decide.
        self.cells[i] || self.grid.around(i).any(|near| self.cells[near])
    }
}
