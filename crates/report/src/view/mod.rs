//! `view.html`: the job in three dimensions, to be looked at in a browser before the part is risked.
//!
//! Consumes a plan and its [`Scene`]; promises one file that loads nothing from elsewhere, and equal bytes for equal
//! input. The page is in `page/`: it draws with WebGL 2 what is packed here. What it is given: a head as JSON, the part
//! in fewer triangles (the distance that this costs is measured and stated), the map of the blocks, the marks in
//! chunks and as a map of their density, the texture that is not marked and, on the fly, how the head moves. Marks are exact to
//! [`Scene::thinned`] and to the step of a chunk's coordinates, which is the 32,767th part of the field's half.
//!
//! Size: some 8 bytes a mark, and 1 MB for part, maps and page.

mod blocks;
mod fixtures;
mod head;
mod marks;
mod measured;
mod pack;
#[cfg(test)]
mod tests;
mod tone;

use std::ops::Range;

use crate::report::page::escape;
use crate::scene::{Motion, MotionSample, Scene};
use blocks::Columns;
use head::{Head, LinesHead, ListHead, MapHead, MotionHead, PartHead, Ranges};
use pack::Data;
use terrace_core::duration::duration;
use terrace_core::geom::{Box2, BoxMm, NM_PER_MM};
use terrace_core::machine::{Machine, Origin};
use terrace_core::parallel;
use terrace_core::program::{Pen, Slope};
use terrace_input::job::Mode;
use terrace_input::surface::{Decimated, Surface};
use terrace_plan::block_map::BlockMap;
use terrace_plan::fixtures::Fixture;
use terrace_plan::manifest::{OnTheFlySummary, Summary};
use terrace_plan::measured::MeasuredPart;
use terrace_plan::plan::{OnTheFlyPlan, SteppedPlan};

/// The page, its style and its scripts in the order in which they are read.
const PAGE: &str = include_str!("page/page.html");
const CSS: &str = include_str!("page/page.css");
const SIDE_BY_SIDE: &str = include_str!("page/side_by_side.html");
const SCRIPTS: [&str; 14] = [
    include_str!("page/data.js"),
    include_str!("page/colour.js"),
    include_str!("page/camera.js"),
    include_str!("page/gl.js"),
    include_str!("page/shaders.js"),
    include_str!("page/scene.js"),
    include_str!("page/probe.js"),
    include_str!("page/timeline.js"),
    include_str!("page/histogram.js"),
    include_str!("page/overlay.js"),
    include_str!("page/section.js"),
    include_str!("page/panel.js"),
    include_str!("page/controls.js"),
    include_str!("page/main.js"),
];

/// Triangles of the part.
const TRIANGLES: usize = 60_000;
/// Cells of a map along its longer side.
const MAP_CELLS: usize = 1500;
/// Version of the data that the page reads.
const SCHEMA: u32 = 1;

/// The page of a stepped job; `job` is the name that it shows.
pub fn of_stepped(plan: &SteppedPlan, scene: &Scene, job: &str) -> String {
    let program = plan.checked.program();
    let s = &plan.summary;
    let lpfls = || program.blocks.iter().map(|b| b.stop.lpfl.mm());
    let dose = || plan.figures.iter().map(|f| f.slope).flat_map(|s: Slope| s.dose());
    let maps: Vec<PassMap<'_>> = plan
        .passes
        .iter()
        .zip(1..)
        .map(|(pass, number)| PassMap { number, first: pass.blocks.start, map: &pass.map })
        .collect();
    let subject = Subject {
        job,
        mode: Mode::Stepped,
        machine: &plan.machine,
        surface: &plan.inputs.surface,
        fixtures: &plan.inputs.fixtures,
        measured: plan.inputs.measured.as_ref().map(|part| (part, plan.passes[0].texture)),
        pens: &program.pens,
        origins: plan.checked.origins(),
        time_s: s.time_s.total,
        mark_mm: s.mark_mm,
        passes: plan.passes.iter().map(|pass| pass.blocks.clone()).collect(),
        maps,
        half_depth_mm: plan.job.focus.half_depth_mm(),
        heights: range(lpfls()),
        dose: range(dose()),
        warnings: &s.warnings,
        figures: stepped_figures(s),
        blocks: Columns::stepped(plan, scene).text(),
    };
    subject.page(scene)
}

/// The page of an on-the-fly job; `job` is the name that it shows.
pub fn of_on_the_fly(plan: &OnTheFlyPlan, scene: &Scene, job: &str) -> String {
    let program = plan.checked.program();
    let s = &plan.summary;
    let z = scene.groups.iter().flat_map(|g| g.points.iter().map(|p| g.frame.part_from_group(p.at)[2]));
    let subject = Subject {
        job,
        mode: Mode::OnTheFly,
        machine: &plan.machine,
        surface: &plan.inputs.surface,
        fixtures: &[],
        measured: None,
        pens: &program.pens,
        origins: &[program.origin],
        time_s: s.time_s,
        mark_mm: s.mark_mm,
        passes: std::iter::once(0..scene.groups.len()).collect(),
        maps: Vec::new(),
        half_depth_mm: plan.job.focus.half_depth_mm(),
        heights: range(z),
        dose: [1.0; 2],
        warnings: &s.warnings,
        figures: fly_figures(s),
        blocks: Columns::on_the_fly(scene).text(),
    };
    subject.page(scene)
}

/// A page that shows the views of two jobs beside each other, with one camera; `views` are their addresses.
pub fn side_by_side(names: &[String; 2], views: &[String; 2]) -> String {
    let values = [&names[0], &names[1], &views[0], &views[1]].map(|text| escape(text));
    let keys = ["{{before}}", "{{after}}", "{{view-before}}", "{{view-after}}"];
    let pairs: Vec<(&str, &str)> = keys.into_iter().zip(values.iter().map(String::as_str)).collect();
    filled(SIDE_BY_SIDE, &pairs)
}

/// Least and greatest value; zeros of none.
fn range(values: impl Iterator<Item = f64>) -> [f64; 2] {
    let all = values.fold([f64::INFINITY, f64::NEG_INFINITY], |[lo, hi], v| [lo.min(v), hi.max(v)]);
    if all[0] <= all[1] { all } else { [0.0; 2] }
}

fn stepped_figures(s: &Summary) -> Vec<(&'static str, String)> {
    let mut rows = vec![
        ("stops", s.stops.to_string()),
        ("method", s.method.clone()),
        ("time", duration(s.time_s.total)),
        ("marked", format!("{:.3} mm", s.mark_mm)),
        ("not marked", format!("{:.3} mm", s.skipped_mm)),
        ("worst defocus", format!("{:.1} um", s.worst_defocus_um)),
        ("worst incidence", format!("{:.2} deg", s.worst_incidence_deg)),
        ("off axis", format!("{:.1} mm, 95 % to {:.1} mm", s.off_axis_mm.largest, s.off_axis_mm.p95)),
    ];
    let least = if s.loading.is_least() { " at least" } else { "" };
    rows.insert(3, ("with loading", duration(s.loading.total_s) + least));
    rows.insert(4, ("loading", s.loading.sentence(s.blocks)));
    if s.dots.texture > 0 {
        rows.push(("dots", format!("{} of {}", s.dots.marked, s.dots.texture)));
    }
    rows
}

fn fly_figures(s: &OnTheFlySummary) -> Vec<(&'static str, String)> {
    vec![
        ("marks", s.marks.to_string()),
        ("time", duration(s.time_s)),
        ("laser on", duration(s.mark_s)),
        ("marked", format!("{:.3} mm", s.mark_mm)),
        ("not marked", format!("{:.3} mm", s.lengths.skipped_mm)),
        ("worst defocus", format!("{:.1} um", s.deviations.worst_fod_um)),
        ("worst incidence", format!("{:.2} deg", s.deviations.worst_bia_deg)),
    ]
}

/// What the page is made of, beside the scene.
struct Subject<'a> {
    job: &'a str,
    mode: Mode,
    machine: &'a Machine,
    surface: &'a Surface,
    fixtures: &'a [Fixture],
    /// Where it lies, if it was measured, and the box of its texture.
    measured: Option<(&'a MeasuredPart, Box2)>,
    pens: &'a [Pen],
    /// Positions of the part's origin, by set-up.
    origins: &'a [Origin],
    time_s: f64,
    mark_mm: f64,
    /// The groups of each pass.
    passes: Vec<Range<usize>>,
    maps: Vec<PassMap<'a>>,
    half_depth_mm: f64,
    heights: [f64; 2],
    dose: [f64; 2],
    warnings: &'a [terrace_core::diag::Message],
    figures: Vec<(&'static str, String)>,
    blocks: String,
}

/// Which block lies where in a pass.
struct PassMap<'a> {
    /// Of the pass, from 1.
    number: u32,
    /// Index of its first block in the program.
    first: usize,
    map: &'a BlockMap,
}

impl Subject<'_> {
    fn page(&self, scene: &Scene) -> String {
        let defocus = scene.points().map(|p| f64::from(p.defocus_um));
        let most = defocus.clone().fold(0.0, |most, d| f64::max(most, d.abs()));
        // No finer than a nanometre, to which the scene has it.
        let defocus_step = (most / f64::from(i16::MAX)).max(1e-3);
        let fly_step = (self.mode == Mode::OnTheFly).then_some(defocus_step);
        let ranges_of_groups = marks::chunks(scene);
        let spot_mm = self.machine.lens.spot.as_mm();
        let ((part, (tones, tone_elements)), packed) = parallel::both(
            || {
                parallel::both(
                    || self.surface.decimated(TRIANGLES),
                    || tone::tones(scene, &self.passes, self.pens.len(), spot_mm),
                )
            },
            || parallel::map(ranges_of_groups.len(), |i| marks::chunk(scene, i, ranges_of_groups[i].clone(), fly_step)),
        );
        let (chunks, elements): (Vec<_>, Vec<_>) = packed.into_iter().unzip();
        let mut part_box = BoxMm::of(part.vertices.iter().copied());
        if part.vertices.is_empty() {
            part_box = BoxMm { lo: [0.0; 3], hi: [0.0; 3] };
        }
        let mut bounds = part_box;
        chunks.iter().filter(|c| c.bounds[0][0] <= c.bounds[1][0]).flat_map(|c| c.bounds).for_each(|p| bounds.add(p));
        scene.unmarked.lines.iter().flat_map(|l| &l.points).for_each(|&p| bounds.add(p));
        let corners = self.fixtures.iter().flat_map(|fixture| &fixture.facets).flatten();
        corners.for_each(|p| bounds.add(p.map(|nm| nm / NM_PER_MM)));
        let mut data = vec![Data::text(&self.blocks).element("blocks"), mesh(&part, &part_box)];
        data.extend(elements);
        data.extend(tone_elements);
        let (maps, more): (Vec<_>, Vec<_>) =
            parallel::map(self.maps.len(), |k| map(k, &self.maps[k])).into_iter().unzip();
        data.extend(more);
        let (fixtures, corners) = fixtures::packed(self.fixtures);
        data.extend(corners);
        let measured = self.measured.map(|(part, texture)| {
            let (head, element) = measured::packed(part, texture);
            data.push(element);
            head
        });
        let skipped_lines = (!scene.unmarked.lines.is_empty()).then(|| {
            let (head, element) = skipped(scene);
            data.push(element);
            head
        });
        let motion = scene.motion.as_ref().map(|motion| {
            data.push(self.motion(motion));
            MotionHead { name: "motion", samples: motion.samples.len() }
        });
        let incidence = scene.points().map(|p| f64::from(p.incidence_deg));
        let head = Head {
            schema: SCHEMA,
            terrace: env!("CARGO_PKG_VERSION"),
            job: self.job,
            machine: &self.machine.name,
            mode: self.mode.name(),
            time_s: self.time_s,
            bounds: [bounds.lo, bounds.hi],
            part: PartHead::new(&part, [part_box.lo, part_box.hi]),
            field: head::field(self.machine),
            lens: head::lens(self.machine),
            pivot: self.origins.first().and_then(|&origin| head::pivot(self.machine, origin)),
            head_tilts: self.machine.tilts_head(),
            travel: self.origins.iter().map(|&origin| head::travel(self.machine, origin)).collect(),
            pens: head::pens(self.pens),
            scanner: head::scanner(self.machine),
            passes: self.passes.len(),
            setups: self.origins.len(),
            maps,
            tones,
            spot_mm,
            half_depth_mm: self.half_depth_mm,
            blocks: ListHead { name: "blocks", count: scene.groups.len() },
            chunks,
            incidence_deg_per_step: marks::INCIDENCE_STEP,
            defocus_um_per_step: defocus_step,
            skipped: head::skipped(scene),
            skipped_lines,
            fixtures,
            measured,
            motion,
            ranges: Ranges {
                height_mm: self.heights,
                defocus_um: range(defocus),
                incidence_deg: range(incidence),
                dose: self.dose,
            },
            histograms: head::histograms(scene, self.pens),
            thinned: head::thinned(scene),
            marks: scene.mark_count(),
            mark_mm: self.mark_mm,
            warnings: self.warnings,
            figures: &self.figures,
        };
        // Nothing in it can end the element that holds it.
        let head = serde_json::to_string(&head).expect("plain JSON").replace('<', "\\u003c");
        filled(
            PAGE,
            &[
                ("{{title}}", &escape(&format!("{}: view", self.job))),
                ("{{css}}", CSS),
                ("{{head}}", &head),
                ("{{data}}", &data.concat()),
                ("{{js}}", &format!("(() => {{\n\"use strict\";\n{}}})();\n", SCRIPTS.concat())),
            ],
        )
    }

    /// Arrays one after another: time, centre of the field, direction to the lens, spot; then whether the laser is on.
    fn motion(&self, motion: &Motion) -> String {
        let all = &motion.samples;
        let mut data = Data::default();
        data.f32(all.iter().map(|s| s.time_s as f32));
        let picks: [fn(&MotionSample) -> [f64; 3]; 3] = [|s| s.centre, |s| s.up, |s| s.spot];
        for pick in picks {
            for k in 0..3 {
                data.f32(all.iter().map(|s| pick(s)[k] as f32));
            }
        }
        data.u8(all.iter().map(|s| u8::from(s.is_on)));
        data.element("motion")
    }
}

/// A page with its places filled; what is put in is not looked at again.
fn filled(page: &str, values: &[(&str, &str)]) -> String {
    let mut out = String::with_capacity(page.len() + values.iter().map(|(_, v)| v.len()).sum::<usize>());
    let mut rest = page;
    while let Some((at, &(key, value))) =
        values.iter().filter_map(|kv| Some((rest.find(kv.0)?, kv))).min_by_key(|(at, _)| *at)
    {
        out += &rest[..at];
        out += value;
        rest = &rest[at + key.len()..];
    }
    out + rest
}

/// The surface: positions in its box, normals, triangles.
fn mesh(part: &Decimated, bounds: &BoxMm<3>) -> String {
    let size = bounds.size();
    let mut data = Data::default();
    data.u32(part.vertices.len() as u32);
    data.u32(part.triangles.len() as u32);
    for k in 0..3 {
        let scale = if size[k] > 0.0 { f64::from(u16::MAX) / size[k] } else { 0.0 };
        data.u16_delta(part.vertices.iter().map(|v| ((v[k] - bounds.lo[k]) * scale).round() as u16));
    }
    for k in 0..3 {
        data.u8(part.normals.iter().map(|n| (n[k] * 127.0).round() as i8 as u8));
    }
    data.u32_delta(part.triangles.iter().flatten().copied());
    data.element("mesh")
}

/// The map of a pass, coarser where it has more cells than a picture needs.
fn map(k: usize, &PassMap { number: pass, first, map }: &PassMap<'_>) -> (MapHead, String) {
    let [columns, rows] = map.size().map(|n| n as usize);
    let every = columns.max(rows).div_ceil(MAP_CELLS).max(1);
    let (wide, high) = (columns.div_ceil(every), rows.div_ceil(every));
    let middle = |i: usize, count: usize| (i * every + every / 2).min(count - 1);
    let labels = map.labels();
    let mut cells = Vec::with_capacity(wide * high);
    for row in 0..high {
        let from = middle(row, rows) * columns;
        cells.extend((0..wide).map(|column| match labels[from + middle(column, columns)] {
            0 => 0,
            label => label + first as u32,
        }));
    }
    let name = format!("map-{k}");
    let mut data = Data::default();
    data.u32_planes(cells.iter().copied());
    let element = data.element(&name);
    let cell = map.cell().mm() * every as f64;
    (MapHead { name, pass, origin: map.bounds().lo.mm(), cell, columns: wide, rows: high }, element)
}

/// The texture that is not marked.
fn skipped(scene: &Scene) -> (LinesHead, String) {
    let lines = &scene.unmarked.lines;
    let points = || lines.iter().flat_map(|l| &l.points);
    let mut data = Data::default();
    data.u8(lines.iter().map(|l| l.row as u8));
    data.u16_planes(lines.iter().map(|l| l.points.len() as u16));
    for k in 0..3 {
        data.f32(points().map(|p| p[k] as f32));
    }
    let left_out = scene.unmarked.lines_left_out;
    (LinesHead { name: "skipped", lines: lines.len(), points: points().count(), left_out }, data.element("skipped"))
}
