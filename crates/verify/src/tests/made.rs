//! A small job made by hand, and writers of its own for every file of a folder.
//!
//! The part is a ramp z = x / 50 over x 0 to 80, y 0 to 20 mm, with a steep strip (slope 5) from x 80 to
//! 81. Nine lines along x run from -1 to 82 at y 2 to 18, and a square loop lies inside the second block.
//! Four blocks of 20 mm each hold a depth range of 0.4 mm.

use std::path::Path;
use terrace_core::math;

use serde_json::{Value, json};

use crate::findings::{Findings, RuleCode, STEPPED};
use crate::fixtures::Fixture;
use crate::geometry::{Geometry, MeshBuilder, Shape};
use crate::job_facts::JobFacts;
use crate::read::manifest::Manifest;
use crate::{Drawing, LoadedJob, Proof, check_folder, inputs::Inputs, read, rules};
use terrace_core::geom::{FieldPoint, Nm, P2, Turn};
use terrace_core::machine::{Commanded, Machine, Origin, TiltAngles};
use terrace_core::program::{
    Block, BlockId, OffAxis, PassId, Pen, PenId, Program, SectionId, SetupId, Stop, Stroke, StrokeId,
};
use terrace_core::units::Power;
use terrace_input::job::{DepthRule, Format, Level, Passes};

pub(super) const MM: i64 = 1_000_000;

/// A stroke of the program with its points in the part frame, in marking order.
#[derive(Clone, Debug)]
pub(super) struct Mark {
    pub(super) source: StrokeId,
    pub(super) segment: u32,
    pub(super) reversed: bool,
    pub(super) pen: PenId,
    pub(super) points: Vec<P2>,
}

#[derive(Clone, Debug)]
pub(super) struct MadeBlock {
    pub(super) pass: u32,
    pub(super) stop: Stop,
    pub(super) z: [Nm; 2],
    pub(super) retract: bool,
    pub(super) marks: Vec<Mark>,
}

/// The job: change it, write it, verify it.
#[derive(Clone)]
pub(super) struct Made {
    pub(super) facts: JobFacts,
    pub(super) origin: Origin,
    pub(super) strokes: Vec<(PenId, Vec<P2>)>,
    pub(super) blocks: Vec<MadeBlock>,
    pub(super) summary: Value,
    /// How many strokes are cut, and how many figures are marked whole.
    pub(super) strokes_cut: usize,
    pub(super) figures_whole: usize,
    /// Facets, corners in mm.
    pub(super) facets: Vec<[[f64; 3]; 3]>,
    /// Opposite corners of boxes that hold the part, mm.
    pub(super) fixtures: Vec<[[f64; 3]; 2]>,
    /// Mean and least cosine of the incidence under the marks of a block.
    pub(super) cosines: fn(&MadeBlock) -> [f64; 2],
}

pub(super) fn p(x: f64, y: f64) -> P2 {
    P2::from_mm(x, y).expect("a small number")
}

impl Made {
    pub(super) fn new() -> Self {
        let machine = Machine::built_in("xyz-galvo-40").expect("profile");
        let pen = |name: &str, passes| Pen {
            name: name.into(),
            speed: "1000 mm/s".parse().expect("speed"),
            power: Power::Percent(60.0),
            frequency: "60 kHz".parse().expect("rate"),
            passes,
            dwell: None,
        };
        let facts = JobFacts {
            machine,
            pdof: Nm(400_000),
            reserve: Nm(0),
            depth_range: Nm(400_000),
            level: Level::Mid,
            rule: DepthRule::Range,
            max_incidence_rad: 60f64.to_radians(),
            min_mark_nm: 0.0,
            only_slivers: false,
            overlap_nm: 0.0,
            zone_nm: 0.0,
            passes: Passes::default(),
            setups: None,
            figure_pitch: None,
            section_nm: [40e6; 2],
            weld_nm: 0.0,
            laid_deg: None,
            turn_deg: 0.0,
            origin: None,
            pens: Some(vec![pen("fill", 1), pen("edge", 3)]),
            dose: None,
            frames: Some(None),
            formats: vec![Format::Dxf, Format::Linuxcnc, Format::Gcode, Format::Ovf],
            inputs: Some(vec![("surface", "part.stl".into())]),
            power_by_speed: false,
            is_built_in: false,
        };
        let mut strokes: Vec<(PenId, Vec<P2>)> =
            (1..10).map(|i| (PenId(0), vec![p(-1.0, 2.0 * f64::from(i)), p(82.0, 2.0 * f64::from(i))])).collect();
        strokes.push((PenId(1), vec![p(25.0, 5.0), p(30.0, 5.0), p(30.0, 9.0), p(25.0, 9.0), p(25.0, 5.0)]));
        let blocks = (0..4).map(|k| block(k, &strokes)).collect();
        let mut made = Self {
            strokes_cut: 9,
            figures_whole: 1,
            facts,
            origin: Origin([-40 * MM, -10 * MM, 0]),
            strokes,
            blocks,
            summary: json!({}),
            facets: ramp(),
            fixtures: Vec::new(),
            // The ramp rises by 1 in 50 under every mark.
            cosines: |_| [1.0 / math::hypot(0.02f64, 1.0); 2],
        };
        made.renew();
        made
    }

    /// Length of marks of a block in mm, passes counted.
    fn mark_mm(&self, block: &MadeBlock) -> f64 {
        let passes = |pen: PenId| f64::from(self.facts.pens.as_ref().expect("pens")[pen.index()].passes);
        block.marks.iter().map(|m| terrace_core::geom::length_mm(&m.points) * passes(m.pen)).sum()
    }

    /// States the figures anew after a change: what is not marked is claimed to be off the part.
    pub(super) fn renew(&mut self) {
        let passes = |pen: PenId| f64::from(self.facts.pens.as_ref().expect("pens")[pen.index()].passes);
        let texture: f64 = self.strokes.iter().map(|(pen, s)| terrace_core::geom::length_mm(s) * passes(*pen)).sum();
        let mark: f64 = self.blocks.iter().map(|b| self.mark_mm(b)).sum();
        let skipped = texture - mark;
        let program = self.program();
        let time = super::times(&program, &self.facts.machine).0;
        let worst = self.blocks.iter().map(|b| (self.cosines)(b)[1]).fold(1.0, f64::min);
        let incidence_deg = math::acos(worst).to_degrees();
        self.summary = json!({
            "stops": self.blocks.len(), "blocks": self.blocks.len(), "setups": 1,
            "fragments": self.blocks.iter().map(|b| b.marks.len()).sum::<usize>(),
            "part_mm": [0.0, 0.0, 0.0], "texture_mm": texture, "mark_mm": mark, "overlap_mm": 0.0, "skipped_mm": skipped,
            "skipped_off_part_mm": skipped - 9.0, "skipped_steep_mm": 9.0,
            "skipped_small_mm": 0.0, "worst_defocus_um": 200.0,
            "loading": {"way": "run", "assumed": false, "load_s": 0.0, "load_assumed": false, "total_s": time.total}, "jump_mm": program.blocks.iter().map(|b| program.jump_mm(b)).sum::<f64>(), "time_s": time,
            "passes": 1, "strokes_cut": self.strokes_cut, "figures_whole": self.figures_whole, "figures_cut": 0,
            "dots": {"texture": 0, "marked": 0, "off_part": 0, "steep": 0}, "worst_incidence_deg": incidence_deg,
            "off_axis_mm": OffAxis::of(&program),
        });
    }

    fn stage(&self, b: &MadeBlock) -> Commanded {
        self.facts.machine.stage_from_part(b.stop.centre, b.stop.lpfl, self.origin)
    }

    pub(super) fn program(&self) -> Program {
        let mut program = Program { pens: self.facts.pens.clone().expect("pens"), ..Program::default() };
        for b in &self.blocks {
            let start = program.strokes.len();
            for m in &b.marks {
                let first = program.points.len() as u32;
                let local = |p: &P2| FieldPoint::new((p.x - b.stop.centre.x) as i32, (p.y - b.stop.centre.y) as i32);
                program.points.extend(m.points.iter().map(local));
                let Mark { source, segment, reversed, pen, .. } = *m;
                program.strokes.push(Stroke { source, segment, reversed, pen, first, len: m.points.len() as u32 });
            }
            let strokes = start..program.strokes.len();
            let block = Block {
                pass: PassId(b.pass),
                setup: SetupId(0),
                stop: b.stop.clone(),
                stage: self.stage(b),
                focus_shift: Nm(0),
                retract: b.retract,
                z_lo: b.z[0],
                z_hi: b.z[1],
                strokes,
            };
            program.blocks.push(block);
        }
        program
    }

    /// Writes all files and the manifest.
    pub(super) fn write(&self, folder: &Path) {
        std::fs::create_dir_all(folder.join("blocks")).expect("folder");
        let program = self.program();
        let put = |name: &str, bytes: &[u8]| std::fs::write(folder.join(name), bytes).expect("write");
        put("program.txt", super::writers::program(&program, self.origin).as_bytes());
        let block_s = super::times(&program, &self.facts.machine).1;
        for (name, bytes) in super::writers::files(&program, self.origin, &self.facts.machine, &block_s) {
            put(&name, &bytes);
        }
        let sheets = super::writers::Sheets {
            program: &program,
            origin: self.origin,
            machine: &self.facts.machine,
            block_s: &block_s,
            total_s: super::times(&program, &self.facts.machine).0.total,
        };
        put("runsheet.csv", sheets.csv().as_bytes());
        put("runsheet.txt", sheets.txt().as_bytes());
        put("layout.svg", b"<svg/>");
        put("../job.toml", b"the job");
        put("../part.stl", b"the part");
        self.write_manifest(folder);
    }

    /// Writes the manifest with the hashes of the files as they are.
    pub(super) fn write_manifest(&self, folder: &Path) {
        let entry = |base: &Path, name: &str| {
            let bytes = std::fs::read(base.join(name)).expect("written before");
            json!({"file": name, "bytes": bytes.len(), "blake3": blake3::hash(&bytes).to_hex().to_string()})
        };
        let program = self.program();
        let mut files: Vec<String> =
            ["program.txt", "stage.ngc", "stage_m0.nc", "job.ovf", "layout.svg", "runsheet.csv", "runsheet.txt"]
                .map(String::from)
                .into();
        files.extend((0..program.blocks.len()).map(|i| format!("blocks/{}.dxf", BlockId::new(i))));
        let block_s = super::times(&program, &self.facts.machine).1;
        let blocks: Vec<Value> = self.blocks.iter().zip(&program.blocks).enumerate().map(|(i, (m, b))| {
            let id = BlockId::new(i).to_string();
            let dose = (self.cosines)(m);
            let (incidence, stretch) = (dose.map(|cos| math::acos(cos).to_degrees()), dose.map(|cos| 1.0 / cos));
            json!({
                "id": id, "pass": b.pass.number(), "setup": b.setup.number(), "section": b.stop.section.0, "level": b.stop.level, "centre_mm": b.stop.centre.mm(),
                "tilt_deg": b.stop.tilt.deg(),
                "lpfl_mm": b.stop.lpfl.mm(), "focus_shift_mm": b.focus_shift.mm(), "stage": b.stage.mm(),
                "lift_z_mm": (b.retract || i == 0).then(|| self.facts.machine.retract_z().mm()), "z_lo_mm": b.z_lo.mm(),
                "z_hi_mm": b.z_hi.mm(), "pens": pens_of(&program, b), "files": {"dxf": format!("blocks/{id}.dxf")},
                "strokes": b.strokes.len(), "mark_mm": self.mark_mm(m), "jump_mm": program.jump_mm(b), "time_s": block_s[i],
                "incidence_deg": incidence, "stretch": stretch, "dose": dose,
            })
        }).collect();
        let job = entry(folder.parent().expect("inside"), "job.toml");
        let mut input = entry(folder.parent().expect("inside"), "part.stl");
        input["role"] = "surface".into();
        let manifest = json!({
            "schema": 4, "terrace": "0.1.0", "mode": "stepped", "job": {"file": "../job.toml", "blake3": job["blake3"]},
            "inputs": [input], "machine": self.facts.machine,
            "placement": {"origin_mm": self.origin.mm(), "turn_deg": 0.0},
            "focus": {"pdof_mm": self.facts.pdof.mm(), "reserve_mm": self.facts.reserve.mm(), "depth_range_mm": self.facts.depth_range.mm(), "level": "mid", "rule": "range"},
            "passes": [{"turn_deg": 0.0, "lowered_mm": 0.0, "sections": {"pitch_mm": [40.0, 40.0]}}], "setups": [{"origin_mm": self.origin.mm(), "registration": []}], "seams": {"zone_mm": 0.0, "overlap_mm": self.facts.overlap_nm / 1e6}, "pens": program.pens.iter().map(|p| pen_json(p, &self.facts.machine)).collect::<Vec<_>>(),
            "blocks": blocks, "files": files.iter().map(|f| entry(folder, f)).collect::<Vec<_>>(), "summary": self.summary,
        });
        std::fs::write(folder.join("manifest.json"), manifest.to_string()).expect("write");
    }

    pub(super) fn geometry(&self) -> Geometry {
        let mut builder = MeshBuilder::new(0.0, 2.0);
        self.facets.iter().for_each(|&f| builder.push(f));
        Geometry::new(Shape::Mesh(builder.finish()), self.facts.max_incidence_rad, 0.0)
    }

    /// Verifies a folder against this job.
    pub(super) fn verify(&self, folder: &Path) -> Proof {
        let manifest: Manifest = read::manifest::read(folder, &read::leaves::STEPPED).expect("a manifest");
        let mut findings = Findings::new(STEPPED);
        findings.rules[RuleCode::Fill].ran = true;
        findings.rules[RuleCode::Drawing].ran = true;
        findings.rules[RuleCode::Mask].ran = true;
        findings.rules[RuleCode::Bitmap].ran = true;
        findings.rules[RuleCode::Curves].ran = true;
        findings.rules[RuleCode::Marked].ran = true;
        findings.rules[RuleCode::Measured].ran = true;
        findings.rules[RuleCode::Draped].ran = true;
        let inputs = Inputs::locate(folder, &manifest.job.file, None);
        crate::rules::hash::check(folder, &manifest.listed(), &inputs, &mut findings.rules[RuleCode::Hash]);
        let Some(mut program) = crate::readable(crate::read::program::read(&folder.join("program.txt")), &mut findings)
        else {
            return findings.into_proof();
        };
        let drawing = Drawing {
            len: self.strokes.len(),
            stroke: Box::new(|i, out: &mut Vec<P2>| {
                out.clear();
                out.extend_from_slice(&self.strokes[i].1);
                self.strokes[i].0
            }),
            element: Box::new(|i| format!("stroke {i}")),
        };
        let stages = rules::without_inputs(folder, &manifest, &mut program, &self.facts, &mut findings);
        let (geometry, drawings) = (self.geometry(), [drawing]);
        let fixtures: Vec<Fixture> = self.fixtures.iter().map(Fixture::of_box).collect();
        let job = LoadedJob { facts: &self.facts, geometry: &geometry, fixtures: &fixtures, drawings: &drawings };
        check_folder(&stages, &manifest, &mut program, &job, &mut findings, &|_, _| {});
        findings.into_proof()
    }

    /// Writes the job into a fresh folder and verifies it.
    pub(super) fn proof(&self) -> Proof {
        let dir = tempfile::tempdir().expect("folder");
        let folder = dir.path().join("made.job");
        self.write(&folder);
        self.verify(&folder)
    }
}

/// A pen as a manifest has it.
fn pen_json(pen: &Pen, machine: &Machine) -> Value {
    json!({
        "name": pen.name, "speed_mm_s": pen.speed.as_mm_s(), "power": pen.power.to_string(),
        "power_w": pen.power.as_w(machine.laser.max_power), "frequency_khz": pen.frequency.as_khz(),
        "passes": pen.passes,
    })
}

/// Names of the pens of a block, in the order of the pens.
fn pens_of(program: &Program, block: &Block) -> Vec<String> {
    let marks = |pen: usize| program.strokes[block.strokes.clone()].iter().any(|s| s.pen.index() == pen);
    (0..program.pens.len()).filter(|&pen| marks(pen)).map(|pen| program.pens[pen].name.clone()).collect()
}

/// The ramp and its steep strip.
fn ramp() -> Vec<[[f64; 3]; 3]> {
    let z = |x: f64| x / 50.0 + 4.98 * (x - 80.0).max(0.0);
    let strips = (0..16).map(|i| (5.0 * f64::from(i), 5.0 * f64::from(i + 1))).chain([(80.0, 81.0)]);
    let facets = strips.flat_map(|(a, b)| {
        [[[a, 0.0, z(a)], [b, 0.0, z(b)], [b, 20.0, z(b)]], [[a, 20.0, z(a)], [a, 0.0, z(a)], [b, 20.0, z(b)]]]
    });
    facets.collect()
}

/// Block `k`: x from 20 k to 20 k + 20; lines alternate their direction.
fn block(k: u32, strokes: &[(PenId, Vec<P2>)]) -> MadeBlock {
    let (x0, x1) = (20.0 * f64::from(k), 20.0 * f64::from(k + 1));
    let lines = strokes[..9].iter().enumerate().map(|(i, (_, s))| {
        let y = s[0].mm()[1];
        let mut points = vec![p(x0, y), p(x1, y)];
        let reversed = i % 2 == 1;
        if reversed {
            points.reverse();
        }
        Mark { source: StrokeId(i as u32), segment: 0, reversed, pen: PenId(0), points }
    });
    let mut marks: Vec<Mark> = lines.collect();
    if k == 1 {
        marks.push(Mark {
            source: StrokeId(9),
            segment: 0,
            reversed: false,
            pen: PenId(1),
            points: strokes[9].1.clone(),
        });
    }
    let lo = Nm(400_000) * i64::from(k);
    let hi = lo + Nm(400_000);
    let section = k / 2;
    let stop = Stop {
        section: SectionId([section, 0]),
        level: k as i32,
        tilt: TiltAngles::UPRIGHT,
        centre: Turn::upright(p(20.0 + 40.0 * f64::from(section), 10.0)),
        lpfl: lo + Nm(200_000),
        z_lo: lo,
        z_hi: hi,
    };
    MadeBlock { pass: 0, stop, z: [lo, hi], retract: k == 2, marks }
}

/// A BMP of 24 bits, its greys by column and row from the top.
pub(crate) fn bmp([columns, rows]: [usize; 2], grey: impl Fn(usize, usize) -> u8) -> Vec<u8> {
    let row = (3 * columns).next_multiple_of(4);
    let mut out = b"BM".to_vec();
    out.extend((54 + (row * rows) as u32).to_le_bytes());
    out.extend([0; 4]);
    out.extend(54u32.to_le_bytes());
    for v in [40, columns as u32, rows as u32, 1 | 24 << 16, 0, 0, 0, 0, 0, 0] {
        out.extend(v.to_le_bytes());
    }
    for j in (0..rows).rev() {
        let start = out.len();
        (0..columns).for_each(|i| out.extend([grey(i, j); 3]));
        out.resize(start + row, 0);
    }
    out
}
