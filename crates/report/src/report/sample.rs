//! Jobs for the tests: surfaces by formula, blocks by section and level.

use std::collections::BTreeMap;
use terrace_core::math;

use super::{BlockMap, Layout, Marks};
use crate::scene::{Frame, Group, Mark, Point, Relief, Scene};
use terrace_core::diag::{Message, Severity};
use terrace_core::geom::{Box2, FieldPoint, Grid, Nm, P2};
use terrace_core::machine::{LoadingWay, Machine, Origin, TiltAngles};
use terrace_core::program::{
    Block, BlockFigures, OffAxis, PassId, Pen, PenId, Program, SectionId, Sections, SetupId, Stop, Stroke, StrokeId,
    stroke_mm,
};
use terrace_core::units::{Frequency, Power, Speed};
use terrace_input::surface::Surface;
use terrace_plan::check::Checked;
use terrace_plan::manifest::{Candidate, Loading, Summary, Times};

pub(super) struct Sample {
    pub name: String,
    pub checked: Checked,
    pub machine: Machine,
    pub sections: Sections,
    pub map: BlockMap,
    pub texture: Box2,
    pub scene: Scene,
    pub relief: Relief,
    pub marks: Marks,
    pub turn_rad: f64,
    pub figures: Vec<BlockFigures>,
    pub summary: Summary,
}

impl Sample {
    pub(super) fn layout(&self) -> Layout<'_> {
        Layout {
            job: &self.name,
            checked: &self.checked,
            blocks: 0..self.checked.program().blocks.len(),
            passes: 1,
            machine: &self.machine,
            sections: self.sections,
            map: &self.map,
            texture: self.texture,
            part: self.texture,
            scene: &self.scene,
            relief: &self.relief,
            marks: &self.marks,
            turn_rad: self.turn_rad,
            figures: &self.figures,
            drawn: self.checked.program().blocks.clone(),
            shade: super::Shade::Height,
            measured: None,
            fixtures: &[],
            summary: &self.summary,
        }
    }

    /// The `contour` partition of the surface `z` (mm of mm) over a box centred at 0: sections of
    /// `field` mm, levels of `depth` mm, a map of `cell` nm.
    pub(super) fn of(name: &str, size: [f64; 2], depth: f64, cell: Nm, z: impl Fn(f64, f64) -> f64) -> Self {
        let machine = Machine::built_in("xyz-galvo-40").expect("profile");
        let half = P2::from_mm(size[0] / 2.0, size[1] / 2.0).expect("a length");
        let texture = Box2 { lo: P2::new(-half.x, -half.y), hi: half };
        let pitch = machine.usable_field();
        let count = [0, 1].map(|k| (texture.size()[k].0.max(1) as u64).div_ceil(pitch[k].0 as u64) as u32);
        let sections = Sections { origin: texture.lo, pitch, count };
        let mut map = BlockMap::blank(Box2 { lo: texture.lo, hi: P2::new(half.x - 1, half.y - 1) }, cell);
        let [columns, rows] = map.size();
        let place = |i: usize| {
            let p = map.centre(i as u32 % columns, i as u32 / columns);
            let section = [Nm(p.x - texture.lo.x) / pitch[0], Nm(p.y - texture.lo.y) / pitch[1]].map(|v| v as u32);
            let height = z(p.mm()[0], p.mm()[1]);
            (p, section, (height / depth).floor() as i32, height)
        };
        let cells = (columns * rows) as usize;
        let mut stops: BTreeMap<([u32; 2], i32), [f64; 2]> = BTreeMap::new();
        for i in 0..cells {
            let (_, s, level, h) = place(i);
            let row = s[1];
            let column = if row % 2 == 0 { s[0] } else { count[0] - 1 - s[0] };
            let up = (column + row * count[0]).is_multiple_of(2);
            let range = stops.entry(([row, column], if up { level } else { -level })).or_insert([h, h]);
            *range = [range[0].min(h), range[1].max(h)];
        }
        let index: BTreeMap<_, _> = stops.keys().enumerate().map(|(i, k)| (*k, i as u32 + 1)).collect();
        let labels: Vec<u32> = (0..cells)
            .map(|i| {
                let (_, s, level, _) = place(i);
                let column = if s[1] % 2 == 0 { s[0] } else { count[0] - 1 - s[0] };
                let up = (column + s[1] * count[0]).is_multiple_of(2);
                index[&([s[1], column], if up { level } else { -level })]
            })
            .collect();
        map.labels_mut().copy_from_slice(&labels);
        let mut program = Program { pens: vec![pen()], ..Program::default() };
        for (&([row, column], signed), range) in &stops {
            let section = [if row % 2 == 0 { column } else { count[0] - 1 - column }, row];
            let up = (column + row * count[0]).is_multiple_of(2);
            let level = if up { signed } else { -signed };
            let [lo, hi] = range.map(|mm| Nm::round(mm * 1e6));
            push_block(&mut program, sections, SectionId(section), level, [lo, (lo + hi) / 2, hi], &machine);
        }
        let figures = (0..program.blocks.len()).map(|i| timed(1.5 + (i % 7) as f64 * 0.21)).collect();
        let summary = summary(&program);
        Self {
            name: name.into(),
            checked: Checked::unchecked(program, Origin::default()),
            machine,
            sections,
            map,
            texture,
            scene: Scene::default(),
            relief: relief(texture, z),
            marks: Marks::of(&Scene::default(), 0..0),
            turn_rad: 0.0,
            figures,
            summary,
        }
        .with_scene()
    }

    /// The sample with the scene of its program.
    pub(super) fn with_scene(mut self) -> Self {
        let program = self.checked.program();
        let mut scene = Scene::default();
        for block in &program.blocks {
            let [x, y] = block.stop.centre.mm();
            let mut group = Group::new(Frame::upright([x, y, block.stop.lpfl.mm()]));
            for stroke in program.strokes_of(block) {
                let points = program.points_of(stroke);
                let from = group.points.len() as u32;
                let length_mm = stroke_mm(points);
                group.marks.push(Mark { pen: stroke.pen, length_mm, first: from, len: stroke.len });
                group.points.extend(points.iter().map(|p| Point { at: [p.x, p.y, 0], ..Point::default() }));
            }
            scene.groups.push(group);
        }
        self.marks = Marks::of(&scene, 0..scene.groups.len());
        self.scene = scene;
        self
    }

    /// The surface under a 1 mm hatch, covered by windows that lie freely: each begins at the highest
    /// mark left and is the best of nine around it; lines stay in a window as long as they can.
    pub(super) fn windows(name: &str, size: [f64; 2], depth: f64, z: impl Fn(f64, f64) -> f64) -> Self {
        let mut sample = Self::of(name, size, depth, Nm(4_000_000), &z);
        let half = [size[0] / 2.0, size[1] / 2.0];
        let field = sample.machine.half_usable_field_mm();
        // Marks every 0.5 mm along lines 1 mm apart.
        let count = [size[0] as usize * 2, size[1] as usize];
        let place = |i: usize| [(i % count[0]) as f64 * 0.5 + 0.25 - half[0], (i / count[0]) as f64 + 0.5 - half[1]];
        let heights: Vec<f64> = (0..count[0] * count[1]).map(|i| z(place(i)[0], place(i)[1])).collect();
        let holds = |w: &[f64; 3], i: usize| {
            let [x, y] = place(i);
            (x - w[0]).abs() <= field[0] && (y - w[1]).abs() <= field[1] && (w[2]..=w[2] + depth).contains(&heights[i])
        };
        let inside = |w: [f64; 3]| {
            let of = |k: usize, step: f64| {
                let at = |v: f64| ((v + half[k]) / step).clamp(0.0, count[k] as f64) as usize;
                at(w[k] - field[k])..(at(w[k] + field[k]) + 1).min(count[k])
            };
            let columns = of(0, 0.5);
            of(1, 1.0).flat_map(move |y| columns.clone().map(move |x| y * count[0] + x)).filter(move |&i| holds(&w, i))
        };
        let mut order: Vec<usize> = (0..heights.len()).collect();
        order.sort_by(|&a, &b| heights[b].total_cmp(&heights[a]).then(a.cmp(&b)));
        let mut windows = Vec::new();
        let mut covered = vec![false; heights.len()];
        let mut of_mark: Vec<Vec<u32>> = vec![Vec::new(); heights.len()];
        for &top in &order {
            if covered[top] {
                continue;
            }
            let around = (0..9).map(|k| {
                let [x, y] = place(top);
                let off = |k: i32, f: f64| f64::from(k - 1) * f * 0.999;
                [x + off(k % 3, field[0]), y + off(k / 3, field[1]), heights[top] - 0.9999 * depth]
            });
            let best = around.max_by_key(|&w| inside(w).filter(|&i| !covered[i]).count()).expect("nine");
            for i in inside(best) {
                covered[i] = true;
                of_mark[i].push(windows.len() as u32);
            }
            windows.push(best);
        }
        sample.set_windows(&windows, depth, &of_mark, count, &place);
        let mesh = mesh(size, &z);
        let upright = vec![None; sample.checked.program().blocks.len()];
        sample.map = BlockMap::new(
            sample.checked.program(),
            &sample.sections,
            &upright,
            sample.machine.usable_field(),
            &mesh,
            sample.texture,
        );
        sample.with_scene()
    }

    /// Replaces the program: windows in a tour from neighbour to neighbour, marks in runs.
    fn set_windows(
        &mut self,
        windows: &[[f64; 3]],
        depth: f64,
        of_mark: &[Vec<u32>],
        count: [usize; 2],
        place: &impl Fn(usize) -> [f64; 2],
    ) {
        let mut runs: Vec<Vec<[usize; 2]>> = vec![Vec::new(); windows.len()];
        for line in 0..count[1] {
            let (mut i, end) = (line * count[0], (line + 1) * count[0]);
            while i < end {
                let last = |w: u32| (i..end).take_while(|&k| of_mark[k].contains(&w)).count();
                let (length, w) = of_mark[i].iter().map(|&w| (last(w), w)).max().expect("covered");
                runs[w as usize].push([i, (i + length).min(end - 1)]);
                i += length;
            }
        }
        let mut left: Vec<usize> = (0..windows.len()).filter(|&w| !runs[w].is_empty()).collect();
        let mut program = Program { pens: vec![pen()], ..Program::default() };
        let mut at = [-1e4; 2];
        while !left.is_empty() {
            let away = |w: usize| math::hypot(windows[w][0] - at[0], windows[w][1] - at[1]);
            let k = (0..left.len()).min_by(|&a, &b| away(left[a]).total_cmp(&away(left[b]))).expect("some left");
            let w = left.swap_remove(k);
            let [x, y, z] = windows[w];
            at = [x, y];
            let nm = |mm: f64| (mm * 1e6).round() as i64;
            let centre = P2::new(nm(x), nm(y));
            let z_lo = nm(z);
            let z_hi = nm(z + depth);
            let start = program.strokes.len();
            for run in runs[w].iter().filter(|r| r[1] > r[0]) {
                let first = program.points.len() as u32;
                for p in run.map(&place) {
                    program.points.push(FieldPoint::new((nm(p[0]) - centre.x) as i32, (nm(p[1]) - centre.y) as i32));
                }
                program.strokes.push(Stroke {
                    source: StrokeId(0),
                    segment: 0,
                    reversed: false,
                    pen: PenId(0),
                    first,
                    len: 2,
                });
            }
            let z_lo = Nm(z_lo);
            let z_hi = Nm(z_hi);
            let lpfl = (z_lo + z_hi) / 2;
            program.blocks.push(Block {
                pass: PassId(0),
                setup: SetupId(0),
                stop: Stop {
                    section: SectionId([0; 2]),
                    level: 0,
                    tilt: TiltAngles::UPRIGHT,
                    centre,
                    lpfl,
                    z_lo,
                    z_hi,
                },
                stage: self.machine.stage_from_part(centre, lpfl, Origin::default()),
                focus_shift: Nm(0),
                retract: false,
                z_lo,
                z_hi,
                strokes: start..program.strokes.len(),
            });
        }
        self.figures = vec![timed(1.7); program.blocks.len()];
        self.summary = Summary { method: "window".into(), ..summary(&program) };
        self.checked = Checked::unchecked(program, Origin::default());
    }

    /// The dome of a radome: z = a (1 - (u² + v²) / 2), about 3,500 blocks.
    pub(super) fn dome() -> Self {
        Self::of("radome dome 450", [450.0, 450.0], 0.07, Nm(250_000), dome)
    }

    /// The dome with windows that lie freely.
    pub(super) fn dome_of_windows() -> Self {
        Self::windows("radome dome 450, free windows", [450.0, 450.0], 0.07, dome)
    }

    /// A rippled plate with few blocks, some in several pieces.
    pub(super) fn ripple() -> Self {
        Self::of("ripple", [58.0, 36.0], 0.1, Nm(100_000), |x, y| 0.08 * math::sin(x / 7.0) + 0.07 * math::cos(y / 9.0))
    }

    /// One flat block smaller than the field.
    pub(super) fn flat() -> Self {
        Self::of("coin", [30.0, 20.0], 0.07, Nm(250_000), |_, _| 0.02)
    }

    /// Adds a block that owns no cell of the map, as a sliver would.
    pub(super) fn with_sliver(mut self) -> Self {
        let mut program = self.checked.program().clone();
        push_block(&mut program, self.sections, SectionId([0, 0]), 99, [Nm(6_000_000); 3], &self.machine);
        self.figures.push(timed(0.5));
        self.checked = Checked::unchecked(program, Origin::default());
        self.with_scene()
    }
}

/// Heights of the surface `z` over a box.
fn relief(area: Box2, z: impl Fn(f64, f64) -> f64) -> Relief {
    let pitch = area.size()[0].max(area.size()[1]) / 100 + Nm(1);
    let grid = Grid { origin: area.lo, pitch: [pitch; 2], count: area.size().map(|s| (s / pitch + 1) as u32) };
    let z_mm = (0..grid.len()).map(|i| grid.centre(i).mm()).map(|[x, y]| z(x, y) as f32).collect();
    Relief { grid, z_mm }
}

/// The figures of a block of that time on level ground.
fn timed(time_s: f64) -> BlockFigures {
    BlockFigures { time_s, ..BlockFigures::default() }
}

fn dome(x: f64, y: f64) -> f64 {
    10.043_874 * (1.0 - ((x / 225.0).powi(2) + (y / 225.0).powi(2)) / 2.0)
}

/// The surface `z` as a mesh over a box centred at 0.
fn mesh(size: [f64; 2], z: &impl Fn(f64, f64) -> f64) -> Surface {
    let n = 100;
    let node = |i: usize, j: usize| {
        let [x, y] = [size[0] * (i as f64 / n as f64 - 0.5), size[1] * (j as f64 / n as f64 - 0.5)];
        [x, y, z(x, y)]
    };
    let facets = (0..n * n).flat_map(|k| {
        let (i, j) = (k % n, k / n);
        let [a, b, c, d] = [node(i, j), node(i + 1, j), node(i + 1, j + 1), node(i, j + 1)];
        [[a, b, c], [a, c, d]]
    });
    Surface::from_facets(facets, &mut Vec::new()).expect("facets")
}

fn pen() -> Pen {
    Pen {
        name: "fill <fine>".into(),
        speed: Speed::mm_s(1000.0),
        power: Power::Percent(60.0),
        frequency: Frequency::khz(60.0),
        passes: 1,
        dwell: None,
    }
}

fn push_block(program: &mut Program, grid: Sections, section: SectionId, level: i32, z: [Nm; 3], machine: &Machine) {
    let centre = |o: i64, k: usize| o + (grid.pitch[k] * i64::from(section.0[k]) + grid.pitch[k] / 2).0;
    let centre = P2::new(centre(grid.origin.x, 0), centre(grid.origin.y, 1));
    let first = program.strokes.len();
    for k in 0..3 {
        let point = program.points.len() as u32;
        program.points.extend([[k * 100_000, 0], [k * 100_000, 1_000_000 + k]].map(FieldPoint::from));
        program.strokes.push(Stroke {
            source: StrokeId(0),
            segment: 0,
            reversed: false,
            pen: PenId(0),
            first: point,
            len: 2,
        });
    }
    program.blocks.push(Block {
        pass: PassId(0),
        setup: SetupId(0),
        stop: Stop { section, level, tilt: TiltAngles::UPRIGHT, centre, lpfl: z[1], z_lo: z[0], z_hi: z[2] },
        stage: machine.stage_from_part(centre, z[1], Origin::default()),
        focus_shift: Nm(0),
        retract: false,
        z_lo: z[0],
        z_hi: z[2],
        strokes: first..program.strokes.len(),
    });
}

fn summary(program: &Program) -> Summary {
    let stops = program.blocks.len();
    let time_s =
        Times { stage: 900.0, settle: 357.0, zoom: 0.0, mark: 2030.0, jump: 240.0, delay: 180.0, total: 3707.0 };
    Summary {
        stops,
        blocks: stops,
        sub_blocks: stops + 3,
        method: "contour".into(),
        lower_bound_stops: Some(stops / 2),
        texture_mm: 2_025_000.0,
        mark_mm: 2_024_000.0,
        skipped_mm: 1000.0,
        skipped_off_part_mm: 1000.0,
        fragments: 3 * stops,
        jump_mm: 51_000.0,
        worst_defocus_um: 35.0,
        worst_defocus_mean_um: 48.2,
        worst_incidence_deg: 3.6,
        off_axis_mm: OffAxis { largest: 28.1, p95: 22.4 },
        time_s,
        loading: Loading { way: LoadingWay::Run, assumed: true, load_s: 0.0, load_assumed: false, total_s: 3707.0 },
        candidates: vec![Candidate { method: "contour".into(), stops, fragments: 3 * stops, time_s, total_s: 3707.0 }],
        warnings: vec![Message {
            code: "texture-off-part".into(),
            severity: Severity::Warning,
            file: None,
            line: None,
            column: None,
            place: Some("texture 1".into()),
            message: "1 m of 2025 m lies off the part & is skipped".into(),
            help: Some("move it, or accept <this>".into()),
        }],
        ..Summary::default()
    }
}
