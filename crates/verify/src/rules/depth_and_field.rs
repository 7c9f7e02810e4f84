//! `field`, `depth` and `surface`: every mark, points between vertices included, against the field of
//! the machine and against the surface file's own facets.
//!
//! Depth: a mark lies within the block's stated interval of heights, within the largest deviation from
//! its focal plane, and the marks of a block within the depth range. Where there is a zoom optic, the plane that the
//! stage sets and the focus shift sum to the focal plane, and the optic reaches it. Heights carry the tolerance
//! [`Geometry::z_tolerance`]. On a measured part a mark and what it keeps free around it lie within that deviation.
//!
//! Units: nm, but for lengths in mm where the name says so.

use super::slopes::{BlockSlopes, Bounds};
use super::stretch::{Parallel, Parts, Stretch, confirmed, confirmed_along, note, whole};
use super::turned::{PointsInDrawing, Turned};
use super::{part_place, part_place_nm};
use crate::findings::{Findings, RuleCode};
use crate::geometry::{Geometry, Line, Piece, Scratch, Sheet, Slope};
use crate::job_facts::JobFacts;
use crate::proof::Rule;
use crate::read::program::ProgramFile;
use terrace_core::geom::{FieldPoint, P2};
use terrace_core::machine::{Carries, Machine};
use terrace_core::math;
use terrace_core::parallel;
use terrace_core::program::{Block, Stroke};
use terrace_core::progress::Task;

/// Figures of the marks of all blocks.
#[derive(Default)]
pub(crate) struct MarkFigures {
    /// Marked length of each block in mm, passes counted.
    pub(super) block_mm: Vec<f64>,
    /// Largest distance from a focal plane, nm.
    pub(super) worst_defocus: f64,
    /// How far it may be off, nm.
    pub(super) worst_tolerance: f64,
    /// Where the points of tilted blocks lie in the drawing.
    pub(crate) drawn: PointsInDrawing,
    /// The slopes under the marks of each upright block, where what lies under them gives them.
    pub(super) slopes: Vec<Option<Bounds>>,
    /// Square of the steepest slope under a mark.
    steepest2: f64,
}

impl MarkFigures {
    /// Adds those of the next block.
    fn add(&mut self, block: BlockMarks) {
        self.block_mm.push(block.mark_mm);
        if block.worst > self.worst_defocus {
            (self.worst_defocus, self.worst_tolerance) = (block.worst, block.worst_tolerance);
        }
        self.steepest2 = self.steepest2.max(block.slope2);
        self.slopes.push(block.slopes);
    }
}

/// Holds `field`: every point of every stroke.
pub(crate) fn field(file: &ProgramFile, machine: &Machine, rule: &mut Rule) {
    rule.ran = true;
    for (id, block) in file.ids.iter().zip(&file.program.blocks) {
        for stroke in file.program.strokes_of(block) {
            let points = file.program.points_of(stroke);
            rule.checked += points.len() as u64;
            if let Some(&FieldPoint { x, y }) = points.iter().find(|&&p| !machine.field_holds(p)) {
                let c = block.stop.centre;
                let place = part_place(<P2>::new(c.x + i64::from(x), c.y + i64::from(y)));
                let [x, y] = [x, y].map(|v| f64::from(v) / terrace_core::geom::NM_PER_MM);
                rule.broken(id, place, format!("field point ({x}, {y}) mm lies outside the usable field"));
            }
        }
    }
}

/// Holds `depth` and `surface`.
pub(crate) fn check(
    file: &ProgramFile,
    facts: &JobFacts,
    geometry: &Geometry,
    findings: &mut Findings,
    task: Task<'_>,
) -> MarkFigures {
    let task = task.of_steps(file.program.blocks.len());
    let [depth, surface, source] = findings.rules.several([RuleCode::Depth, RuleCode::Surface, RuleCode::Source]);
    (depth.ran, surface.ran) = (true, true);
    let figures = if file.program.blocks.iter().all(|b| b.stop.tilt.is_upright()) {
        check_upright(file, facts, geometry, [depth, surface], &task)
    } else {
        check_tilted(file, facts, geometry, [depth, surface, source], &task)
    };
    findings.worst_defocus_um = figures.worst_defocus / 1e3;
    findings.worst_incidence_deg = math::atan(figures.steepest2.sqrt()).to_degrees();
    figures
}

/// Holds both rules for a program without tilted blocks, [`AT_ONCE`] blocks to a thread.
fn check_upright(
    file: &ProgramFile,
    facts: &JobFacts,
    geometry: &Geometry,
    [depth, surface]: [&mut Rule; 2],
    task: &Task<'_>,
) -> MarkFigures {
    let blocks = &file.program.blocks;
    let parts = parallel::map(blocks.len().div_ceil(AT_ONCE), |n| {
        let mut own_depth = Rule::new(depth.code, depth.what);
        let mut own_surface = Rule::new(surface.code, surface.what);
        let mut search = DepthSearch::new(file, facts, geometry, &mut own_depth, &mut own_surface);
        let range = n * AT_ONCE..blocks.len().min((n + 1) * AT_ONCE);
        let marks: Vec<BlockMarks> = range
            .map(|i| {
                task.step();
                search.block(&file.ids[i], &blocks[i])
            })
            .collect();
        (marks, own_depth, own_surface)
    });
    let mut figures = MarkFigures::default();
    for (marks, own_depth, own_surface) in parts {
        marks.into_iter().for_each(|block| figures.add(block));
        depth.add(own_depth);
        surface.add(own_surface);
    }
    figures
}

/// Holds both rules for a program with tilted blocks, one after another, since blocks of one tilt share its geometry.
/// Finds where the points of tilted blocks lie in the drawing, which counts as a check of `source`.
fn check_tilted(
    file: &ProgramFile,
    facts: &JobFacts,
    geometry: &Geometry,
    [depth, surface, source]: [&mut Rule; 3],
    task: &Task<'_>,
) -> MarkFigures {
    let mut figures = MarkFigures::default();
    let mut search = DepthSearch::new(file, facts, geometry, depth, surface);
    let mut turned: Option<Turned> = None;
    for (id, block) in file.ids.iter().zip(&file.program.blocks) {
        let marks = if Turned::prepare(file, block, facts, geometry, &mut turned)
            && let Some(here) = &turned
        {
            here.draw(id, file, &facts.raised(block), &mut figures.drawn, source);
            search.on(&here.geometry).block(id, block)
        } else {
            search.block(id, block)
        };
        figures.add(marks);
        task.step();
    }
    figures
}

/// Blocks that a thread looks at one after another.
const AT_ONCE: usize = 16;

/// Figures of the marks of one block.
struct BlockMarks {
    /// Lowest and highest place that they reach for certain.
    lo: f64,
    hi: f64,
    /// Largest distance from the focal plane, and how far it may be off.
    worst: f64,
    worst_tolerance: f64,
    /// Square of the steepest slope.
    slope2: f64,
    mark_mm: f64,
    slopes: Option<Bounds>,
}

impl BlockMarks {
    const NONE: Self = Self {
        lo: f64::INFINITY,
        hi: f64::NEG_INFINITY,
        worst: 0.0,
        worst_tolerance: 0.0,
        slope2: 0.0,
        mark_mm: 0.0,
        slopes: None,
    };

    /// Adds a piece on a sheet that lies within the block's heights.
    fn add(&mut self, s: &Sheet, lpfl: f64, geometry: &Geometry) {
        self.slope2 = self.slope2.max(s.slope2);
        let (lo, hi) = (s.z[0].min(s.z[1]), s.z[0].max(s.z[1]));
        let worst = (hi - lpfl).max(lpfl - lo);
        if lo < self.lo || hi > self.hi || worst > self.worst {
            // The range is found from heights that are certain, the deviation from those measured.
            let tolerance = geometry.z_tolerance(s.slope2);
            self.lo = self.lo.min(lo + tolerance);
            self.hi = self.hi.max(hi - tolerance);
            if worst > self.worst {
                (self.worst, self.worst_tolerance) = (worst, tolerance);
            }
        }
    }
}

/// Follows the marks of blocks over the surface.
struct DepthSearch<'a> {
    file: &'a ProgramFile,
    facts: &'a JobFacts,
    geometry: &'a Geometry,
    depth: &'a mut Rule,
    surface: &'a mut Rule,
    scratch: Scratch,
    /// The segments of the stroke at hand.
    lines: Vec<Line>,
    /// Where it lies above or below the allowed heights.
    outside: Vec<Stretch>,
    /// Where it lies off the part or on too steep a slope.
    off_surface: Vec<Stretch>,
    /// The mark of the block that leaves least free, where that is too little.
    short: Option<Short>,
}

/// A mark that keeps too little free: its place, height and what must be kept free, nm.
struct Short {
    at: [f64; 2],
    z: f64,
    kept: f64,
}

impl Short {
    /// The shorter of two; `lpfl` is the focal plane.
    fn worse(self, other: Option<Self>, lpfl: f64) -> Option<Self> {
        let size = |short: &Self| (short.z - lpfl).abs() + short.kept;
        Some(match other {
            Some(other) if size(&other) >= size(&self) => other,
            _ => self,
        })
    }
}

/// What of a piece on a sheet keeps too little free; `limit` is the largest distance from the focal plane.
fn short(p: &Piece, line: &Line, lpfl: f64, limit: f64, geometry: &Geometry) -> Option<Short> {
    let sheet = p.sheet.as_ref().filter(|_| geometry.keeps_free())?;
    // Rounding may put the end of a mark onto a facet beside its own, which may be steeper.
    if line.len > 0.0 && p.len() <= geometry.grain() {
        return None;
    }
    let ends = p.d.into_iter().zip(sheet.z).filter_map(|(d, z)| {
        let at = line.at(d);
        let kept = geometry.kept([at[0], at[1], z], sheet.grad);
        // The deviation is found from differences, to a millionth.
        let tolerance = geometry.z_tolerance(sheet.slope2) + 1.0 + 1e-4 * kept;
        ((z - lpfl).abs() + kept > limit + tolerance).then_some(Short { at, z, kept })
    });
    ends.fold(None, |worst, end| end.worse(worst, lpfl))
}

/// The fault of the focus shift of a block, whose heights are those of the program.
fn zoom_fault(block: &Block, file: &ProgramFile, machine: &Machine) -> Option<String> {
    let mm = |nm: i64| terrace_core::geom::mm_from_nm(nm);
    let Some(zoom) = &machine.zoom else {
        let shift = block.focus_shift.0;
        return (shift != 0)
            .then(|| format!("the focus is shifted by {} mm, the machine has no zoom optic", mm(shift)));
    };
    // The optic reaches half its range to either side. 1e-9 mm are the rounding of both to f64, far below the
    // nanometre.
    let reach = zoom.range.as_mm() / 2.0;
    if block.focus_shift.mm().abs() > reach + 1e-9 {
        let text = format!("the focus is shifted by {} mm, the optic reaches {reach} mm", block.focus_shift.mm());
        return Some(text);
    }
    // The rule `travel` holds a head that is turned.
    if !block.stop.tilt.is_upright() && machine.tilt.as_ref().is_some_and(|axes| axes.carries == Carries::Head) {
        return None;
    }
    let plane = machine.stage.z.sign() * block.stage[2] - file.origin(block)[2];
    let found = plane + block.focus_shift.0;
    (found != block.stop.lpfl.0).then(|| {
        let wanted = block.stop.lpfl.mm();
        format!("stage and optic focus on {} mm, the block's focal plane is at {wanted} mm", mm(found))
    })
}

impl<'a> DepthSearch<'a> {
    fn new(
        file: &'a ProgramFile,
        facts: &'a JobFacts,
        geometry: &'a Geometry,
        depth: &'a mut Rule,
        surface: &'a mut Rule,
    ) -> Self {
        let (lines, outside, off_surface) = (Vec::new(), Vec::new(), Vec::new());
        let scratch = Scratch::default();
        Self { file, facts, geometry, depth, surface, scratch, lines, outside, off_surface, short: None }
    }

    /// The same search on another geometry.
    fn on<'b>(&'b mut self, geometry: &'b Geometry) -> DepthSearch<'b> {
        DepthSearch::new(self.file, self.facts, geometry, self.depth, self.surface)
    }

    /// Holds the marks of a block.
    fn block(&mut self, id: &str, block: &Block) -> BlockMarks {
        let zoom_fault = zoom_fault(block, self.file, &self.facts.machine);
        // Heights are compared on the surface as the file has it.
        let block = &self.facts.raised(block);
        let lpfl = block.stop.lpfl.f64();
        let limit = self.facts.defocus_limit_nm();
        let allowed = [block.z_lo.f64().max(lpfl - limit), block.z_hi.f64().min(lpfl + limit)];
        self.check_intervals(id, block);
        self.short = None;
        if let Some(fault) = zoom_fault {
            self.depth.broken(id, part_place(block.stop.centre), fault);
        }
        let mut marks = BlockMarks::NONE;
        let mut slopes = BlockSlopes::NONE;
        for stroke in self.file.program.strokes_of(block) {
            self.stroke(id, block, stroke, allowed, &mut marks, &mut slopes);
        }
        if let Some(Short { at, z, kept }) = self.short.take() {
            let text = format!(
                "a mark lies {:.4} um from the focal plane, and {:.4} um must stay free beyond it: {:.4} um are allowed",
                (z - lpfl).abs() / 1e3,
                kept / 1e3,
                limit / 1e3
            );
            self.depth.broken(id, part_place_nm(at), text);
        }
        marks.slopes = slopes.bounds().filter(|_| block.stop.tilt.is_upright());
        // Both ends have their tolerances already, see [`BlockMarks::add`].
        let range = self.facts.depth_range_nm();
        if marks.hi - marks.lo > range + 1.0 {
            let text = format!("its marks span {:.4} um, more than {:.4} um", (marks.hi - marks.lo) / 1e3, range / 1e3);
            self.depth.broken(id, part_place(block.stop.centre), text);
        }
        marks
    }

    /// Holds the interval that a block states of its marks to that of its stop, and this to the depth range.
    fn check_intervals(&mut self, id: &str, block: &Block) {
        let slack = self.geometry.z_tolerance_at_limit();
        if (block.stop.z_lo - block.z_lo).f64() > slack || (block.z_hi - block.stop.z_hi).f64() > slack {
            let text = "the stated interval of its marks is not inside the one that the stop admits";
            self.depth.broken(id, part_place(block.stop.centre), text);
        }
        if block.stop.z_hi - block.stop.z_lo > self.facts.depth_range {
            self.depth.broken(id, part_place(block.stop.centre), "its stop admits more than the depth range");
        }
    }

    /// Holds a stroke to the allowed heights and to the surface, and adds its figures to those of its block.
    fn stroke(
        &mut self,
        id: &str,
        block: &Block,
        stroke: &Stroke,
        allowed: [f64; 2],
        marks: &mut BlockMarks,
        slopes: &mut BlockSlopes,
    ) {
        let c = block.stop.centre;
        let part = |p: FieldPoint| [(c.x + i64::from(p.x)) as f64, (c.y + i64::from(p.y)) as f64];
        let points = self.file.program.points_of(stroke);
        let (lpfl, geometry) = (block.stop.lpfl.f64(), self.geometry);
        let limit = self.facts.defocus_limit_nm();
        self.lines.clear();
        self.outside.clear();
        self.off_surface.clear();
        let mut length = 0.0;
        for w in points.windows(2).filter(|w| w[0] != w[1]) {
            let line = Line::new(part(w[0]), part(w[1]));
            let segment = self.lines.len();
            let (outside, off_surface, shortest) = (&mut self.outside, &mut self.off_surface, &mut self.short);
            // Heights of what lies within the interval are measured at once. What lies outside is only noted: whether
            // it stays outside on either side of an edge is looked into below, for the few marks that need it.
            let crossings = geometry.along(&line, &mut self.scratch, |p| {
                slopes.piece(&p, geometry);
                match &p.sheet {
                    Some(s) if s.slope != Slope::Steep => {
                        let parts = beyond(&p, s, 0.0, allowed, geometry);
                        let is_within = parts.iter().all(|d| d[0] >= d[1]);
                        if is_within {
                            marks.add(s, lpfl, geometry);
                            if let Some(found) = short(&p, &line, lpfl, limit, geometry) {
                                *shortest = found.worse(shortest.take(), lpfl);
                            }
                        }
                        for d in parts.into_iter().filter(|d| d[0] < d[1]) {
                            note(outside, segment, d, line.len);
                        }
                    }
                    _ => note(off_surface, segment, p.d, line.len),
                }
            });
            slopes.line(line.len, geometry);
            self.depth.checked += crossings;
            self.surface.checked += 1;
            length += line.len;
            self.lines.push(line);
        }
        slopes.stroke(self.file, stroke, self.facts);
        if let [dot] = points {
            self.dot(id, part(*dot), allowed, lpfl, marks);
        }
        marks.mark_mm +=
            length * f64::from(self.file.program.pens[stroke.pen.index()].passes) / terrace_core::geom::NM_PER_MM;
        if !self.outside.is_empty() {
            self.report_depth(id, block, allowed, marks);
        }
        if !self.off_surface.is_empty() {
            self.report_off_surface(id);
        }
    }

    /// Judges a dot by what it may lie on.
    fn dot(&mut self, id: &str, p_part: [f64; 2], allowed: [f64; 2], lpfl: f64, marks: &mut BlockMarks) {
        let geometry = self.geometry;
        self.depth.checked += 1;
        self.surface.checked += 1;
        let around = geometry.around(p_part, &mut self.scratch);
        let sheets = || around.iter().filter_map(|p| p.sheet.filter(|s| s.slope != Slope::Steep));
        let is_within = |s: &Sheet| {
            let tolerance = geometry.z_tolerance(s.slope2);
            s.z.iter().any(|&z| allowed[0] - tolerance <= z && z <= allowed[1] + tolerance)
        };
        match (sheets().find(is_within), sheets().next()) {
            (Some(sheet), _) => {
                marks.add(&sheet, lpfl, geometry);
                let dot = Line { start: p_part, dir: [1.0, 0.0], len: 0.0 };
                let piece = Piece { d: [0.0; 2], sheet: Some(sheet), is_along_edge: false };
                let limit = self.facts.defocus_limit_nm();
                if let Some(found) = short(&piece, &dot, lpfl, limit, geometry) {
                    self.short = found.worse(self.short.take(), lpfl);
                }
            }
            (None, Some(sheet)) => {
                let [z, lo, hi] = [sheet.z[0], allowed[0], allowed[1]].map(|z| z / 1e6);
                let text = format!("a dot lies at z {z:.6} mm on the part; {lo:.6} to {hi:.6} mm is allowed");
                marks.worst = marks.worst.max((sheet.z[0] - lpfl).abs());
                self.depth.broken(id, part_place_nm(p_part), text);
            }
            (None, None) => {
                self.surface.broken(id, part_place_nm(p_part), "a dot lies off the part or beyond the incidence limit");
            }
        }
    }

    /// Reports what of a stroke is too high or too low on the line and on the parallels beside it: the place farthest
    /// from the focal plane.
    fn report_depth(&mut self, id: &str, block: &Block, allowed: [f64; 2], marks: &mut BlockMarks) {
        let (geometry, lines) = (self.geometry, &self.lines);
        let beyond_on_sheet = |p: &Piece, side: f64| {
            let sheet = p.sheet.as_ref().filter(|s| s.slope != Slope::Steep);
            sheet.map_or([[0.0; 2]; 2], |s| beyond(p, s, side, allowed, geometry))
        };
        let beside = |p: &Piece, parallel: Parallel| beyond_on_sheet(p, parallel.side);
        let runs = confirmed_along(&self.outside, geometry, &mut self.scratch, |i| lines[i], beside);
        let lpfl = block.stop.lpfl.f64();
        let mut worst: Option<([f64; 2], f64)> = None;
        // Of what is confirmed the place farthest from the focal plane is reported, found at the ends of its pieces.
        for s in runs.iter().flat_map(|r| &r.stretches) {
            let part = lines[s.segment].part(s.d, 0.0);
            geometry.along(&part, &mut self.scratch, |p| {
                let Some(sheet) = p.sheet.filter(|_| beyond_on_sheet(&p, 0.0).iter().any(|d| d[0] < d[1])) else {
                    return;
                };
                for (d, z) in p.d.into_iter().zip(sheet.z) {
                    if worst.is_none_or(|(_, w)| (z - lpfl).abs() > (w - lpfl).abs()) {
                        worst = Some((part.at(d), z));
                    }
                }
            });
        }
        let Some((p_part, z)) = worst else { return };
        if (z - lpfl).abs() > marks.worst {
            marks.worst = (z - lpfl).abs();
        }
        // The message states heights as program.txt does, on the surface that earlier passes have lowered.
        let [z, lpfl, lo, hi] =
            [z, lpfl, allowed[0], allowed[1]].map(|z| z - self.facts.passes.lowered(block.pass).f64());
        let text = format!(
            "a mark at z {:.6} mm lies {:.4} um from the focal plane at {:.6} mm; {:.6} to {:.6} mm is allowed",
            z / 1e6,
            (z - lpfl).abs() / 1e3,
            lpfl / 1e6,
            lo / 1e6,
            hi / 1e6
        );
        self.depth.broken(id, part_place_nm(p_part), text);
    }

    /// Reports what of a stroke lies off the part or on too steep a slope on the line and on the parallels beside it.
    fn report_off_surface(&mut self, id: &str) {
        let lines = &self.lines;
        let off_or_steep = |p: &Piece| whole(p, p.sheet.as_ref().is_none_or(|s| s.slope == Slope::Steep));
        let runs = confirmed(&self.off_surface, self.geometry, &mut self.scratch, |i| lines[i], off_or_steep);
        let len: f64 = runs.iter().map(|r| r.len).sum();
        if let Some(s) = runs.first().and_then(|r| r.stretches.first()) {
            let text = format!("{:.6} mm of a mark lie off the part or beyond the incidence limit", len / 1e6);
            self.surface.broken(id, part_place_nm(lines[s.segment].at(s.d[0])), text);
        }
    }
}

/// The parts of a piece that lie too low or too high, nm along its line. The height of a piece that lies `side` nm
/// beside the mark differs from that under the mark by up to `side` times its slope.
fn beyond(p: &Piece, s: &Sheet, side: f64, allowed: [f64; 2], geometry: &Geometry) -> Parts {
    let [z0, z1] = s.z;
    if z0.min(z1) >= allowed[0] && z0.max(z1) <= allowed[1] {
        return [[0.0; 2]; 2];
    }
    let tolerance = geometry.z_tolerance(s.slope2) + side.abs() * s.slope2.sqrt();
    let (lowest, highest) = (allowed[0] - tolerance, allowed[1] + tolerance);
    // Up the piece: too low as far as `from`, too high beyond `to`, as shares of it.
    let (bottom, top) = (z0.min(z1), z0.max(z1));
    let share = |z: f64| ((z - bottom) / (top - bottom).max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
    let from = if bottom < lowest { share(lowest) } else { 0.0 };
    let to = if top > highest { share(highest) } else { 1.0 };
    let part = |a: f64, b: f64| if a < b { [a, b].map(|share| p.d[0] + share * p.len()) } else { [0.0; 2] };
    if z0 <= z1 { [part(0.0, from), part(to, 1.0)] } else { [part(0.0, 1.0 - to), part(1.0 - from, 1.0)] }
}
