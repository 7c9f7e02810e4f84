//! Jobs made up for the tests: surfaces by formula, blocks by section and level.

use std::collections::BTreeMap;

use super::{Layout, Map};
use crate::check::Checked;
use crate::geom::{Box2, P2};
use crate::machine::Machine;
use crate::program::Sections;
use crate::program::{Block, Pen, Program, Stop, Stroke};
use crate::record::{Candidate, Summary, Times};
use crate::units::{Frequency, Power, Speed};

pub(super) struct Sample {
    pub name: String,
    pub checked: Checked,
    pub machine: Machine,
    pub sections: Sections,
    pub map: Map,
    pub texture: Box2,
    pub block_s: Vec<f64>,
    pub summary: Summary,
}

impl Sample {
    pub(super) fn layout(&self) -> Layout<'_> {
        Layout {
            job: &self.name,
            checked: &self.checked,
            machine: &self.machine,
            sections: self.sections,
            map: &self.map,
            texture: self.texture,
            block_s: &self.block_s,
            summary: &self.summary,
        }
    }

    /// The `contour` partition of the surface `z` (mm of mm) over a box centred at 0: sections of
    /// `field` mm, levels of `depth` mm, a map of `cell` nm.
    pub(super) fn of(name: &str, size: [f64; 2], depth: f64, cell: i64, z: impl Fn(f64, f64) -> f64) -> Self {
        let machine = Machine::built_in("xyz-galvo-40").expect("profile");
        let half = P2::from_mm(size[0] / 2.0, size[1] / 2.0).expect("a length");
        let texture = Box2 { lo: P2::new(-half.x, -half.y), hi: half };
        let pitch = machine.usable_field();
        let count = [0, 1].map(|k| (texture.size()[k].max(1) as u64).div_ceil(pitch[k] as u64) as u32);
        let sections = Sections { origin: texture.lo, pitch, count };
        let mut map = Map::blank(Box2 { lo: texture.lo, hi: P2::new(half.x - 1, half.y - 1) }, cell);
        let [columns, rows] = map.size();
        let place = |i: usize| {
            let p = map.centre(i as u32 % columns, i as u32 / columns);
            let section = [(p.x - texture.lo.x) / pitch[0], (p.y - texture.lo.y) / pitch[1]].map(|v| v as u32);
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
            let nm = |mm: f64| (mm * 1e6).round() as i64;
            let [lo, hi] = range.map(nm);
            push_block(&mut program, sections, section, level, [lo, (lo + hi) / 2, hi], &machine);
        }
        let block_s = (0..program.blocks.len()).map(|i| 1.5 + (i % 7) as f64 * 0.21).collect();
        let summary = summary(&program);
        Self {
            name: name.into(),
            checked: Checked::unchecked(program, [0; 3]),
            machine,
            sections,
            map,
            texture,
            block_s,
            summary,
        }
    }

    /// The dome of a radome: z = a (1 - (u² + v²) / 2), about 3,500 blocks.
    pub(super) fn dome() -> Self {
        let z = |x: f64, y: f64| 10.043_874 * (1.0 - ((x / 225.0).powi(2) + (y / 225.0).powi(2)) / 2.0);
        Self::of("radome dome 450", [450.0, 450.0], 0.07, 250_000, z)
    }

    /// A rippled plate with few blocks, some in several pieces.
    pub(super) fn ripple() -> Self {
        Self::of("ripple", [58.0, 36.0], 0.1, 100_000, |x, y| 0.08 * (x / 7.0).sin() + 0.07 * (y / 9.0).cos())
    }

    /// One flat block smaller than the field.
    pub(super) fn flat() -> Self {
        Self::of("coin", [30.0, 20.0], 0.07, 250_000, |_, _| 0.02)
    }

    /// Adds a block that owns no cell of the map, as a sliver would.
    pub(super) fn with_sliver(mut self) -> Self {
        let mut program = self.checked.program().clone();
        push_block(&mut program, self.sections, [0, 0], 99, [6_000_000; 3], &self.machine);
        self.block_s.push(0.5);
        self.checked = Checked::unchecked(program, [0; 3]);
        self
    }
}

fn pen() -> Pen {
    Pen {
        name: "fill <fine>".into(),
        speed: Speed::mm_s(1000.0),
        power: Power::Percent(60.0),
        frequency: Frequency::khz(60.0),
        passes: 1,
    }
}

fn push_block(program: &mut Program, grid: Sections, section: [u32; 2], level: i32, z: [i64; 3], machine: &Machine) {
    let centre = |o: i64, k: usize| o + grid.pitch[k] * i64::from(section[k]) + grid.pitch[k] / 2;
    let centre = P2::new(centre(grid.origin.x, 0), centre(grid.origin.y, 1));
    let first = program.strokes.len();
    for k in 0..3 {
        let point = program.points.len() as u32;
        program.points.extend([[k * 100_000, 0], [k * 100_000, 1_000_000 + k]]);
        program.strokes.push(Stroke { source: 0, segment: 0, reversed: false, pen: 0, first: point, len: 2 });
    }
    program.blocks.push(Block {
        stop: Stop { section, level, centre, focus: z[1], z_lo: z[0], z_hi: z[2] },
        stage: machine.stage_from_part([centre.x, centre.y, z[1]], [0; 3]),
        retract: false,
        z_lo: z[0],
        z_hi: z[2],
        strokes: first..program.strokes.len(),
    });
}

fn summary(program: &Program) -> Summary {
    let stops = program.blocks.len();
    let time_s = Times { stage: 900.0, settle: 357.0, mark: 2030.0, jump: 240.0, delay: 180.0, total: 3707.0 };
    Summary {
        stops,
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
        time_s,
        candidates: vec![Candidate { method: "contour".into(), stops, fragments: 3 * stops, time_s }],
        warnings: vec![serde_json::json!({
            "kind": "warning", "code": "texture-off-part", "message": "1 m of 2025 m lies off the part & is skipped",
            "place": "texture 1", "hint": "move it, or accept <this>"
        })],
        ..Summary::default()
    }
}
