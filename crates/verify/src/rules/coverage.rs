//! `source`, `once` and `coverage`: the marks as pieces of the texture's strokes.
//!
//! Each texture stroke is placed again from the job; the marks that claim to be its pieces are laid on it by their
//! own points (a claim is only a hint: inner vertices must be the stroke's, bit for bit, and both ends
//! lie on it to the nanometre; a whole closed figure may begin at any of its vertices). What two pieces share is marked
//! twice, which is allowed at a cut between two blocks over the length that the job declares; what none covers must lie
//! where nothing can be marked. Every pass is a job of its own. Memory: four bytes per mark, and one texture stroke at
//! a time.

mod accepted;
mod gaps;

use super::stretch::StretchRun;
use super::texture_stroke::TextureStroke;
use super::turned::{PointsInDrawing, Turned};
use super::{part_place, part_place_nm};
use crate::findings::{Findings, RuleCode};
use crate::geometry::{Geometry, Piece, Scratch, Slope};
use crate::job_facts::JobFacts;
use crate::proof::{Lengths, Rule};
use crate::read::manifest::Manifest;
use crate::read::program::ProgramFile;
use crate::{Drawing, LoadedJob};
use terrace_core::geom::{NM_PER_MM, P2};
use terrace_core::math;
use terrace_core::program::{PassId, PenId, Stroke};
use terrace_core::progress::Task;

/// Shares and gaps up to this, nm, are noise of the lengths along a stroke. Both sides of a cut use the same point, so
/// at a sound cut nothing else is left.
const NOISE: f64 = 0.5;

/// By how much an overlap may be longer than declared, nm: each of its ends is a cut point, rounded by up to 0.71 nm.
const ROUNDED: f64 = 2.0;

/// Most unmatched marks that are looked for: the search is slow, and one is enough to refuse.
const UNMATCHED: usize = 1000;

/// Strokes that are counted as one step.
const COUNTED: usize = 64;

/// Numbers of dots, each counted once.
#[derive(Clone, Copy, Default)]
pub(super) struct DotCounts {
    pub(super) texture: u64,
    pub(super) marked: u64,
    pub(super) off_part: u64,
    pub(super) steep: u64,
    /// Of the last two, those that may be the other.
    pub(super) doubtful: u64,
}

/// Figures of the marks as pieces of the texture.
#[derive(Default)]
pub(crate) struct PieceFigures {
    pub(super) lengths: Lengths,
    pub(super) dots: DotCounts,
    /// Strokes of which more than one piece is marked.
    pub(super) strokes_cut: usize,
    /// Closed strokes that are marked in one piece, and the others.
    pub(super) figures_whole: usize,
    pub(super) figures_cut: usize,
    /// The closed figures of the first kind that may be of the second, since less is left out than can be seen.
    pub(super) doubtful_figures: usize,
    /// How far the division of what is skipped may be off, mm: ends of gaps, facets at the limit.
    pub(super) doubt_mm: f64,
    /// By how much marks are longer than the texture under them, since cut points lie on the grid beside
    /// it, and what gaps may have lost to it.
    pub(super) rounding_mm: f64,
    /// By how much the lengths of marks on tilted parts may be off, mm.
    pub(super) turned_mm: f64,
}

/// Holds the three rules.
pub(crate) fn check(
    manifest: &Manifest,
    file: &ProgramFile,
    job: &LoadedJob<'_>,
    drawn: &PointsInDrawing,
    findings: &mut Findings,
    task: Task<'_>,
) -> PieceFigures {
    let LoadedJob { facts, geometry, drawings, .. } = *job;
    let depth_holds = findings.rules[RuleCode::Depth].violated == 0;
    let windows = (0..drawings.len()).map(|pass| window_of_pass(manifest, facts, pass)).collect();
    let [source, once, coverage] = findings.rules.several([RuleCode::Source, RuleCode::Once, RuleCode::Coverage]);
    (source.ran, once.ran, coverage.ran) = (true, true, true);
    let Some(first) = drawings.first() else { return PieceFigures::default() };
    let mut checker = PieceChecker {
        file,
        facts,
        pass: PassId(0),
        drawing: first,
        geometry,
        depth_holds,
        windows,
        drawn,
        turned: None,
        off: None,
        source,
        once,
        coverage,
        scratch: Scratch::default(),
        stroke: TextureStroke::default(),
        spans: Vec::new(),
        mark: Vec::new(),
        unmatched: Vec::new(),
        missing: Vec::new(),
        figures: PieceFigures::default(),
    };
    let task = task.of_steps(drawings.iter().map(|drawing| drawing.len / COUNTED).sum());
    for (pass, drawing) in (0..).map(PassId).zip(drawings) {
        (checker.pass, checker.drawing) = (pass, drawing);
        checker.check_pass(&strokes_of(file, |p| p == pass), &task);
    }
    for i in strokes_of(file, |p| p.index() >= drawings.len()) {
        checker.report_unmatched(i, "the job has no such pass");
    }
    let figures = checker.figures;
    findings.lengths = figures.lengths;
    figures
}

/// The window that a block of a pass accepts at least along x and y, nm: the pitch of its sections, and no more than
/// the job allows.
fn window_of_pass(manifest: &Manifest, facts: &JobFacts, pass: usize) -> [f64; 2] {
    let pitch = manifest.passes.get(pass).map_or([0.0; 2], |p| p.sections.pitch_mm.map(|mm| mm * NM_PER_MM));
    [0, 1].map(|axis| pitch[axis].min(facts.section_nm[axis]))
}

/// The marks of some passes by the stroke that they claim.
fn strokes_of(file: &ProgramFile, wanted: impl Fn(PassId) -> bool) -> Vec<u32> {
    let blocks = file.program.blocks.iter().filter(|b| wanted(b.pass));
    let mut order: Vec<u32> = blocks.flat_map(|b| b.strokes.clone()).map(|i| i as u32).collect();
    order.sort_unstable_by_key(|&i| (file.program.strokes[i as usize].source, i));
    order
}

/// Where a mark lies on its texture stroke: nm along it.
#[derive(Clone, Copy)]
struct MarkSpan {
    from: f64,
    to: f64,
    /// How far its ends may be off, nm: on a tilted part they are found by their height.
    off: f64,
    mark: u32,
}

/// How far a gap or a share between two ends of marks may be off, nm, where an end of the stroke does not count as one.
fn noise(a: Option<&MarkSpan>, b: Option<&MarkSpan>) -> f64 {
    let off = |span: Option<&MarkSpan>| span.map_or(0.0, |s| s.off);
    NOISE + off(a) + off(b)
}

/// Lays the marks of a program on the strokes of the texture, stroke by stroke.
struct PieceChecker<'a> {
    file: &'a ProgramFile,
    facts: &'a JobFacts,
    /// The pass at hand and what it marks.
    pass: PassId,
    drawing: &'a Drawing<'a>,
    geometry: &'a Geometry,
    depth_holds: bool,
    /// The window that a block accepts at least along x and y, by pass, nm: its section.
    windows: Vec<[f64; 2]>,
    /// Points of tilted blocks in the drawing; empty where nothing is tilted.
    drawn: &'a PointsInDrawing,
    /// The geometry of the tilted block that was looked at last.
    turned: Option<Turned>,
    /// How far the points of the mark at hand may be off, nm, if it is one of these.
    off: Option<f64>,
    source: &'a mut Rule,
    once: &'a mut Rule,
    coverage: &'a mut Rule,
    scratch: Scratch,
    /// The texture stroke at hand.
    stroke: TextureStroke,
    spans: Vec<MarkSpan>,
    /// The mark at hand in drawing direction, part frame.
    mark: Vec<P2>,
    /// Ends of marks that lie on no stroke that they claim.
    unmatched: Vec<[P2; 2]>,
    /// Unmarked stretches; they are reported once all unmatched marks are known.
    missing: Vec<MissingStretch>,
    figures: PieceFigures,
}

/// An unmarked stretch: its ends, and what to say of it.
struct MissingStretch {
    ends: [[f64; 2]; 2],
    block: Option<usize>,
    place: String,
    text: String,
}

impl PieceChecker<'_> {
    /// The marks of one pass, by the stroke that they claim.
    fn check_pass(&mut self, order: &[u32], task: &Task<'_>) {
        let file = self.file;
        let source = |i: u32| file.program.strokes[i as usize].source.index();
        let beyond = order.partition_point(|&i| source(i) < self.drawing.len);
        for &i in &order[beyond..] {
            self.report_unmatched(i, "the texture has no such stroke");
        }
        let mut rest = &order[..beyond];
        for wanted in 0..self.drawing.len {
            let count = rest.iter().take_while(|&&i| source(i) == wanted).count();
            self.check_stroke(wanted, &rest[..count]);
            rest = &rest[count..];
            if wanted % COUNTED == COUNTED - 1 {
                task.step();
            }
        }
        self.report_missing();
        self.unmatched.clear();
    }

    /// Holds the marks that claim a stroke.
    fn check_stroke(&mut self, number: usize, marks: &[u32]) {
        let Some(pen) = self.stroke.place(self.drawing, number) else {
            return marks.iter().for_each(|&i| self.report_unmatched(i, "the texture has no points there"));
        };
        if let Some(dot) = self.stroke.dot() {
            return self.check_dot(number, dot, pen, marks);
        }
        let passes = self.file.program.pens.get(pen.index()).map_or(1.0, |p| f64::from(p.passes));
        self.figures.lengths.texture_mm += self.stroke.len() * passes / NM_PER_MM;
        self.spans.clear();
        for &i in marks {
            self.place(i, number, pen, passes);
        }
        self.spans.sort_unstable_by(|a, b| a.from.total_cmp(&b.from).then(a.mark.cmp(&b.mark)));
        let spans = std::mem::take(&mut self.spans);
        self.sweep(number, &spans, passes);
        self.coverage.checked += 1;
        self.figures.strokes_cut += usize::from(spans.len() > 1);
        if self.stroke.is_closed() {
            self.count_figure(&spans);
        }
        self.spans = spans;
    }

    /// Sweeps along a stroke over the spans of its marks, in order: what lies between two of them is a gap, what lies
    /// behind both is marked twice.
    fn sweep(&mut self, number: usize, spans: &[MarkSpan], passes: f64) {
        // `covered` reaches farthest of all marks so far, and `before` is how far all but that mark reach: an overlap
        // is declared only where no third mark lies.
        let mut covered: Option<MarkSpan> = None;
        let mut before = 0.0f64;
        for span in spans {
            let to = covered.map_or(0.0, |c| c.to);
            let noise = self.joint(span.from - to, passes, [covered.as_ref(), Some(span)]);
            self.once.checked += 1;
            if span.from > to + noise {
                self.gap(number, [to, span.from], passes, [covered, Some(*span)]);
            } else if span.from < to - noise {
                let declared = covered.is_some_and(|last| before <= span.from && self.is_overlap(&last, span));
                self.twice(*span, span.to.min(to) - span.from, passes, declared);
            }
            before = before.max(span.to.min(to));
            if span.to > to {
                covered = Some(*span);
            }
        }
        let (to, sum) = (covered.map_or(0.0, |c| c.to), self.stroke.len());
        if sum > to + self.joint(sum - to, passes, [covered.as_ref(), None]) {
            self.gap(number, [to, sum], passes, [covered, None]);
        }
    }

    /// Counts a closed stroke as a figure that is marked whole, or cut.
    fn count_figure(&mut self, spans: &[MarkSpan]) {
        let left: f64 = spans.iter().fold(self.stroke.len(), |left, span| left - (span.to - span.from));
        // Both ends of the one mark.
        let noise = 2.0 * noise(spans.first(), spans.first());
        let is_whole = spans.len() == 1 && left <= noise;
        self.figures.figures_whole += usize::from(is_whole);
        self.figures.figures_cut += usize::from(!is_whole);
        // More than the rounding of sums in f64 is left, 1e-3 nm: the program may have left it out.
        self.figures.doubtful_figures += usize::from(is_whole && left > 1e-3);
    }

    /// A dot: marked once, with its pen and where it is drawn, or where nothing can be marked.
    fn check_dot(&mut self, number: usize, dot: P2, pen: PenId, marks: &[u32]) {
        self.figures.dots.texture += 1;
        self.coverage.checked += 1;
        for (nth, &i) in marks.iter().enumerate() {
            self.source.checked += 1;
            self.once.checked += 1;
            self.figures.dots.marked += 1;
            let stroke = self.file.program.strokes[i as usize];
            let block = self.load(i, &stroke);
            let off = self.off.unwrap_or(0.0);
            let fault = match self.mark[..] {
                [p] if p.distance(dot) > off => Some("it is not where the dot is drawn"),
                [_] if stroke.segment != 0 || stroke.reversed => Some("a dot has no segments and no direction"),
                [_] if !self.is_own(&stroke, pen) => Some("it is marked with another pen than it is drawn with"),
                [_] => None,
                _ => Some("it is a line, and the stroke a dot"),
            };
            if let Some(fault) = fault {
                let text = format!("mark of {}: {fault}", (self.drawing.element)(number));
                self.source.broken(&self.file.ids[block], part_place(dot), text);
            }
            if nth > 0 {
                self.once.broken(&self.file.ids[block], part_place(dot), "this dot is marked twice in the same pass");
            }
        }
        if marks.is_empty() {
            self.skipped_dot(number, dot);
        }
    }

    /// Judges a dot that is not marked.
    fn skipped_dot(&mut self, number: usize, dot: P2) {
        let around = self.geometry.around([dot.x as f64, dot.y as f64], &mut self.scratch);
        let is_off = |p: &Piece| p.sheet.is_none();
        let is_steep = |p: &Piece| p.sheet.is_some_and(|s| s.slope != Slope::Gentle);
        let dots = &mut self.figures.dots;
        match around.first() {
            Some(p) if is_steep(p) => dots.steep += 1,
            _ => dots.off_part += 1,
        }
        dots.doubtful += u64::from(around.iter().any(is_off) && around.iter().any(is_steep));
        if !around.is_empty() && !around.iter().any(|p| is_off(p) || is_steep(p)) {
            let text = format!("the dot {} is not marked", (self.drawing.element)(number));
            self.coverage.broken("", part_place(dot), text);
        }
    }

    /// Whether a mark has the pen that its stroke is drawn with, or one made of it.
    fn is_own(&self, stroke: &Stroke, pen: PenId) -> bool {
        stroke.pen == pen || {
            let made = super::dose::origin(&self.file.program.pens, stroke.pen.index(), self.facts);
            made.is_some_and(|(own, _)| own == pen.index())
        }
    }

    /// Returns how far the gap (or, below 0, the share) between two marks may be off, nm. On a tilted part that may
    /// be counted as skipped or as an overlap although it is too small to be found here, and the other way round.
    fn joint(&mut self, gap: f64, passes: f64, beside: [Option<&MarkSpan>; 2]) -> f64 {
        let noise = noise(beside[0], beside[1]);
        if noise > NOISE {
            let hidden = if gap.abs() <= noise { gap.abs() } else { 0.0 };
            self.figures.rounding_mm += (noise + hidden) * passes / NM_PER_MM;
        }
        noise
    }

    /// Lays a mark on the stroke that it claims.
    fn place(&mut self, i: u32, number: usize, pen: PenId, passes: f64) {
        self.source.checked += 1;
        let stroke = self.file.program.strokes[i as usize];
        let block = self.load(i, &stroke);
        let length: f64 = self.mark.windows(2).map(|w| w[0].distance(w[1])).sum();
        let segment = stroke.segment as usize;
        let fit = match self.off {
            Some(off) => self.stroke.fit_turned(&self.mark, segment, off),
            None => self.stroke.fit(&self.mark, segment),
        };
        // On a tilted part lengths are those along the stroke.
        let length = fit.ok().filter(|_| self.off.is_some()).map_or(length, |[from, to]| to - from);
        self.figures.lengths.mark_mm += length * passes / NM_PER_MM;
        let off = self.off.unwrap_or(0.0);
        self.figures.turned_mm += 2.0 * off * passes / NM_PER_MM;
        let fault = match fit {
            Ok([from, to]) => {
                self.spans.push(MarkSpan { from, to, off, mark: i });
                self.figures.rounding_mm += (length - (to - from)).abs() * passes / NM_PER_MM;
                (!self.is_own(&stroke, pen)).then(|| "it is marked with another pen than it is drawn with".to_owned())
            }
            Err(why) => {
                if let Some([from, to]) = self.search() {
                    self.spans.push(MarkSpan { from, to, off, mark: i });
                } else if self.unmatched.len() < UNMATCHED {
                    self.unmatched.extend(self.ends());
                }
                Some(why.to_owned())
            }
        };
        if let Some(fault) = fault {
            let text = format!("mark of {}, segment {segment}: {fault}", (self.drawing.element)(number));
            let place = self.mark.first().map_or(String::new(), |&p| part_place(p));
            self.source.broken(&self.file.ids[block], place, text);
        }
    }

    /// Notes a mark that claims a stroke that is not there.
    fn report_unmatched(&mut self, i: u32, why: &str) {
        self.source.checked += 1;
        let stroke = self.file.program.strokes[i as usize];
        let block = self.load(i, &stroke);
        let passes = f64::from(self.file.program.pens[stroke.pen.index()].passes);
        let length: f64 = self.mark.windows(2).map(|w| w[0].distance(w[1])).sum();
        self.figures.lengths.mark_mm += length * passes / NM_PER_MM;
        if self.unmatched.len() < UNMATCHED {
            self.unmatched.extend(self.ends());
        }
        let place = self.mark.first().map_or(String::new(), |&p| part_place(p));
        self.source.broken(&self.file.ids[block], place, format!("mark of stroke {}: {why}", stroke.source.0));
    }

    /// Fills [`PieceChecker::mark`] and returns the mark's block.
    fn load(&mut self, i: u32, stroke: &Stroke) -> usize {
        let program = &self.file.program;
        let block = program.blocks.partition_point(|b| b.strokes.end <= i as usize);
        let stop = &program.blocks[block].stop;
        let c = stop.centre;
        self.off = (!stop.tilt.is_upright() && !self.drawn.is_empty()).then(|| self.drawn.off[i as usize]);
        let points = program.points_of(stroke).iter().map(|p| P2::new(c.x + i64::from(p.x), c.y + i64::from(p.y)));
        self.mark.clear();
        if self.off.is_some() {
            self.mark
                .extend_from_slice(&self.drawn.points[stroke.first as usize..(stroke.first + stroke.len) as usize]);
        } else {
            self.mark.extend(points);
        }
        if stroke.reversed {
            self.mark.reverse();
        }
        block
    }

    /// The ends of the mark at hand.
    fn ends(&self) -> Option<[P2; 2]> {
        Some([*self.mark.first()?, *self.mark.last()?])
    }

    /// Where on the stroke a mark lies that is not what it claims.
    fn search(&self) -> Option<[f64; 2]> {
        let is_slow = self.unmatched.len() >= UNMATCHED || self.source.violated >= UNMATCHED as u64;
        if is_slow { None } else { self.stroke.nearest(&self.mark) }
    }

    /// Whether what two marks share is an overlap as the job declares it, the end of one block's mark and the beginning
    /// of another's.
    fn is_overlap(&self, last: &MarkSpan, next: &MarkSpan) -> bool {
        is_overlap(last, next, self.facts.overlap_nm) && self.block_of(last.mark) != self.block_of(next.mark)
    }

    /// Counts what a mark shares with the one that reaches farthest before it, and reports it unless the job declares
    /// it.
    fn twice(&mut self, span: MarkSpan, shared: f64, passes: f64, declared: bool) {
        if shared <= noise(Some(&span), None) {
            return;
        }
        self.figures.lengths.overlap_mm += shared * passes / NM_PER_MM;
        // Both ends lie up to 0.71 nm off the stroke. Of one segment that makes what is shared longer by hypot(shared,
        // 1.41)
        // - shared, which is less than 1.41² / 2 over what is shared.
        let is_straight = self.stroke.locate(span.from).0 == self.stroke.locate(span.from + shared).0;
        let longer = if is_straight { (1.0 / shared).min(NOISE) } else { NOISE };
        self.figures.rounding_mm += longer * passes / NM_PER_MM;
        if declared {
            return;
        }
        let text = format!("{:.6} mm of this mark are marked by another mark of the same pass", shared / NM_PER_MM);
        let block = self.block_of(span.mark);
        let place = part_place_nm(self.stroke.at(span.from));
        self.once.broken(&self.file.ids[block], place, text);
    }

    /// The number of the block that makes a mark.
    fn block_of(&self, mark: u32) -> usize {
        self.file.program.blocks.partition_point(|b| b.strokes.end <= mark as usize)
    }

    /// Keeps an unmarked run for [`PieceChecker::report_missing`].
    fn note_missing(&mut self, number: usize, run: &StretchRun, beside: [Option<MarkSpan>; 2]) {
        let (Some(s), Some(e)) = (run.stretches.first(), run.stretches.last()) else { return };
        let ends = [self.stroke.line(s.segment).at(s.d[0]), self.stroke.line(e.segment).at(e.d[1])];
        let missing = MissingStretch {
            ends,
            block: beside.into_iter().flatten().next().map(|s| self.block_of(s.mark)),
            place: part_place_nm(ends[0]),
            text: format!("{:.6} mm of {} are not marked", run.len / NM_PER_MM, (self.drawing.element)(number)),
        };
        if self.missing.len() < UNMATCHED {
            self.missing.push(missing);
        } else {
            self.report(&missing);
        }
    }

    fn report(&mut self, missing: &MissingStretch) {
        let id = missing.block.map_or("", |b| self.file.ids[b].as_str());
        self.coverage.broken(id, &missing.place, &missing.text);
    }

    /// Reports what is not marked, but for what a mark covers that claims another stroke: `source` has
    /// said so already.
    fn report_missing(&mut self) {
        let grain = self.geometry.grain();
        for missing in std::mem::take(&mut self.missing) {
            let is_end =
                |p: &P2| missing.ends.iter().any(|e| math::hypot(p.x as f64 - e[0], p.y as f64 - e[1]) <= grain);
            if !self.unmatched.iter().any(|ends| ends.iter().all(is_end)) {
                self.report(&missing);
            }
        }
    }
}

/// Whether the end of one mark and the beginning of the next share no more than `declared`, nm, and no more than the
/// first keeps for itself, and neither lies within the other.
fn is_overlap(last: &MarkSpan, next: &MarkSpan, declared: f64) -> bool {
    // How far the distance between an end of one and an end of the other may be off; 0 where nothing is tilted.
    let known = noise(Some(last), Some(next)) - NOISE;
    let (own, shared) = (next.from - last.from, last.to - next.from);
    // On a tilted part what each has of its own may be less than is known of its ends: the mark that follows may end
    // right after the cut.
    let follows = last.from + NOISE < next.from + known && last.to + NOISE < next.to + known;
    // Both ends of the mark before are in the difference once, the beginning of the other twice.
    let keeps = shared <= own + 2.0 * (ROUNDED + known);
    follows && keeps && declared > 0.0 && shared <= declared + ROUNDED + known
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn overlaps_are_short_and_neither_mark_lies_within_the_other() {
        let is = |off: f64, last: [f64; 2], next: [f64; 2]| {
            let span = |[from, to]: [f64; 2]| MarkSpan { from, to, off, mark: 0 };
            is_overlap(&span(last), &span(next), 50_000.0)
        };
        for off in [0.0, 3.0] {
            assert!(is(off, [0.0, 200_000.0], [150_000.0, 300_000.0]));
            // Longer than declared, than what the first keeps, within it, and the first within the second.
            assert!(!is(off, [0.0, 200_000.0], [149_980.0, 300_000.0]));
            assert!(!is(off, [0.0, 60_000.0], [29_980.0, 300_000.0]));
            assert!(!is(off, [0.0, 200_000.0], [150_000.0, 199_990.0]));
            assert!(!is(off, [0.0, 40_000.0], [0.0, 300_000.0]));
        }
        // The second ends a nanometre after the first, and is found to end before it.
        assert!(is(3.0, [0.0, 200_000.0], [150_000.0, 199_998.0]));
        assert!(!is(0.0, [0.0, 200_000.0], [150_000.0, 200_000.0]));
    }
}
