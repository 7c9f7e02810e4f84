//! Rules on compiled jobs: real programs, damaged in all formats alike by the real emitters, lengths
//! and hashes renewed, that one rule and no other reports.

mod cards;
mod diagonal;
mod dots;
mod drawings;
mod every;
mod frames;
mod head_tilt;
mod passes;
mod right;
mod screens;
mod setups;
mod sheets;
mod tilted;
mod zoom;

use std::cell::OnceCell;
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, LazyLock, Mutex, OnceLock};
use terrace_core::math;

use super::{alter_manifest, assert_only, broken, renew_hash};
use crate::{Proof, verify};
use terrace_core::geom::{FieldPoint, Nm};
use terrace_core::machine::Origin;
use terrace_core::program::{Block, BlockFigures, PenId, Program, Stroke};
use terrace_input::job::{Job, Overrides};
use terrace_plan::check::Checked;
use terrace_plan::manifest::MANIFEST;
use terrace_plan::plan::{self, Plan, SteppedPlan};
use terrace_report::job_folder;

/// A compiled job in a folder of its own: a wavy sheet with a hole, hatched along contours beyond its border, and
/// squares with a pen of two passes.
struct Bench {
    dir: tempfile::TempDir,
    plan: Box<SteppedPlan>,
    /// The folder of the plan as it is, written where a test needs it.
    sound: OnceCell<PathBuf>,
}

/// What a plan of a bench follows from: the text of the job, how steep its sheet is, and the other files.
type BenchInput = (String, u64, Vec<(String, Vec<u8>)>);

/// The plans of the benches so far: many tests damage the same one.
static PLANS: LazyLock<Mutex<HashMap<BenchInput, Arc<OnceLock<SteppedPlan>>>>> = LazyLock::new(Mutex::default);

impl Bench {
    fn new() -> Self {
        Self::with("", "")
    }

    /// The same with more keys of `[partition]`, and more tables.
    fn with(keys: &str, tables: &str) -> Self {
        Self::of("contour", keys, tables, 1.0)
    }

    /// The same on a sheet that is `steep` times as high.
    fn of(direction: &str, keys: &str, tables: &str, steep: f64) -> Self {
        Self::written(direction, keys, tables, steep, "[\"dxf\", \"csv\", \"linuxcnc\", \"gcode\", \"ovf\"]")
    }

    /// The same with other formats.
    fn written(direction: &str, keys: &str, tables: &str, steep: f64, formats: &str) -> Self {
        let keys = if keys.is_empty() { String::new() } else { format!(", {keys}") };
        let bench = Self::edited(steep, |text| {
            let text = text.replacen("\"z-range\"", &format!("\"z-range\"{keys}"), 1);
            let text = text.replacen("\"contour\"", &format!("{direction:?}"), 1);
            let text = text.replacen("[\"dxf\", \"csv\", \"linuxcnc\", \"gcode\", \"ovf\"]", formats, 1);
            text.replacen("machine =", &format!("{tables}\n            machine ="), 1)
        });
        assert!(bench.plan.summary.stops > 20, "{:?}", bench.plan.summary);
        bench
    }

    /// The same on a machine with a tilt table, by the method that uses it.
    fn tilted(tables: &str) -> Self {
        let bench = Self::edited(1.0, |text| {
            let text = text.replacen("\"z-range\"", "\"tilt\"", 1).replacen("xyz-galvo-40", "xyz-tilt-galvo-40", 1);
            text.replacen("machine =", &format!("{tables}\n            machine ="), 1)
        });
        let tilts = bench.plan.checked.program().blocks.iter().filter(|b| !b.stop.tilt.is_upright()).count();
        assert!(tilts > 3, "{:?}", bench.plan.summary);
        bench
    }

    /// Hatches on both sides of a ridge that the head, near as it is, must lift over.
    fn near() -> Self {
        Self::near_with("[\"dxf\", \"csv\", \"linuxcnc\", \"gcode\", \"ovf\"]")
    }

    /// The same with other formats.
    fn near_with(formats: &str) -> Self {
        Self::near_on(head("xyz-galvo-40", "12 mm", "10 mm"), formats)
    }

    /// The same on another machine.
    fn near_on(machine: Vec<u8>, formats: &str) -> Self {
        let ridge = |x: f64, _: f64| 0.01 * x + 5.0 * math::exp(-((x - 40.0) / 2.0).powi(2));
        let part = stl(&right::sheet([0.0; 2], [80, 30], [1.0; 2], ridge));
        let files = [("part.stl", part), ("machine.toml", machine)];
        let bench = Self::edited_beside(1.0, &files, |text| {
            let text = text.replacen("profile = \"xyz-galvo-40\"", "file = \"machine.toml\"", 1);
            let text = text.replacen("direction = \"contour\"", "", 1).replacen("\"63 mm\"", "\"16 mm\"", 1);
            let other = "pattern = \"hatch\"\n            area = [\"64 mm\", \"-2 mm\", \"83 mm\", \"32 mm\"]";
            let text = text.replacen("pattern = \"squares\"", other, 1).replacen("cell = \"2 mm\"", "", 1);
            text.replacen("[\"dxf\", \"csv\", \"linuxcnc\", \"gcode\", \"ovf\"]", formats, 1)
        });
        assert!(bench.plan.checked.program().blocks.iter().skip(1).any(|b| b.retract), "{:?}", bench.plan.summary);
        bench
    }

    /// The wavy sheet on a tilt table under a head that must lift before the table tilts.
    fn tilted_near() -> Self {
        let files = [("machine.toml", head("xyz-tilt-galvo-40", "10.4 mm", "20 mm"))];
        let bench = Self::edited_beside(1.0, &files, |text| {
            let text = text.replacen("profile = \"xyz-galvo-40\"", "file = \"machine.toml\"", 1);
            text.replacen("\"z-range\"", "\"tilt\"", 1)
        });
        assert!(bench.plan.checked.program().blocks.iter().skip(1).any(|b| b.retract), "{:?}", bench.plan.summary);
        bench
    }

    /// The job with its text edited.
    fn edited(steep: f64, edit: impl FnOnce(&str) -> String) -> Self {
        Self::edited_beside(steep, &[], edit)
    }

    /// The same with more files next to it.
    fn edited_beside(steep: f64, files: &[(&str, Vec<u8>)], edit: impl FnOnce(&str) -> String) -> Self {
        let dir = tempfile::tempdir().expect("a writable temporary folder");
        std::fs::write(dir.path().join("part.stl"), part(steep)).expect("a writable folder");
        for (name, bytes) in files {
            std::fs::write(dir.path().join(name), bytes).expect("a writable folder");
        }
        let text = r#"
            surface = { file = "part.stl", unit = "mm" }
            focus = { pdof = "0.07 mm" }
            partition = { method = "z-range" }
            limits = { max_off_part = "50 %" }
            machine = { profile = "xyz-galvo-40" }
            emit = { formats = ["dxf", "csv", "linuxcnc", "gcode", "ovf"] }
            [[texture]]
            pattern = "hatch"
            pitch = "0.9 mm"
            direction = "contour"
            area = ["-3 mm", "-2 mm", "63 mm", "44 mm"]
            [[texture]]
            pattern = "squares"
            pitch = "3 mm"
            cell = "2 mm"
            pen = "deep"
            [[pen]]
            name = "fine"
            speed = "1000 mm/s"
            power = "60 %"
            frequency = "60 kHz"
            [[pen]]
            name = "deep"
            speed = "500 mm/s"
            power = "8 W"
            frequency = "40 kHz"
            passes = 2
        "#;
        let path = dir.path().join("job.toml");
        let text = edit(text);
        std::fs::write(&path, &text).expect("a writable folder");
        let job = load(&path);
        let files = files.iter().map(|(name, bytes)| ((*name).to_owned(), bytes.clone())).collect();
        let plan = PLANS.lock().expect("no test holds it").entry((text, steep.to_bits(), files)).or_default().clone();
        let plan = plan.get_or_init(|| match plan::plan(job.clone(), &|_, _| {}).unwrap_or_else(|e| panic!("{e}")) {
            Plan::Stepped(plan) => *plan,
            Plan::OnTheFly(_) => panic!("a stepped job"),
        });
        assert!(plan.summary.skipped_off_part_mm > 10.0, "{:?}", plan.summary);
        Self { dir, plan: Box::new(SteppedPlan { job, ..plan.clone() }), sound: OnceCell::new() }
    }

    /// The same with lines along x, and more tables.
    fn hatched(tables: &str) -> Self {
        Self::of("0 deg", "", tables, 1.0)
    }

    /// Changes the program, renews what follows from it, writes every format, and verifies.
    fn mutant(mut self, change: impl FnOnce(&mut Program, &SteppedPlan)) -> Proof {
        let mut program = self.plan.checked.program().clone();
        change(&mut program, &self.plan);
        assert_ne!(&program, self.plan.checked.program(), "the mutant is one");
        let s = &mut self.plan.summary;
        (s.stops, s.blocks) = (program.stops(), program.blocks.len());
        s.fragments = program.strokes.len();
        if program.blocks.iter().all(|b| b.stop.tilt.is_upright()) {
            s.mark_mm = program.blocks.iter().map(|b| program.mark_mm(b)).sum();
        }
        s.jump_mm = program.blocks.iter().map(|b| program.jump_mm(b)).sum();
        let off = |b: &Block| (b.z_hi - b.stop.lpfl).max(b.stop.lpfl - b.z_lo);
        s.worst_defocus_um = program.blocks.iter().map(off).max().unwrap_or_default().f64() / 1000.0;
        let (time_s, block_times) = super::times(&program, &self.plan.machine);
        s.time_s = time_s;
        s.loading = s.loading.of_blocks(program.blocks.len(), time_s.total);
        s.candidates.clear();
        self.plan.figures.resize(program.blocks.len(), BlockFigures::default());
        self.plan.figures.iter_mut().zip(block_times).for_each(|(f, time_s)| f.time_s = time_s);
        let origins = self.plan.checked.origins().to_vec();
        self.plan.checked = Checked::unchecked_setups(program, origins);
        verified(&self.write())
    }

    /// The folder, without pictures.
    fn write(&self) -> PathBuf {
        self.write_as("job.job", false)
    }

    fn write_as(&self, name: &str, pictures: bool) -> PathBuf {
        let target = self.dir.path().join(name);
        job_folder::write_stepped(&self.plan, &target, pictures).unwrap_or_else(|e| panic!("{e}"));
        target
    }

    /// Changes a file of the sound folder, renews its hash, verifies, and takes the change back.
    fn damaged(&self, name: &str, change: impl FnOnce(&mut Vec<u8>)) -> Proof {
        let folder = self.sound.get_or_init(|| self.write_as("sound.job", false));
        let files = [folder.join(name), folder.join(MANIFEST)];
        let before = files.each_ref().map(|path| std::fs::read(path).expect("a file of the folder"));
        alter(folder, name, change);
        renew_hash(folder, name);
        let proof = verified(folder);
        files.iter().zip(before).for_each(|(path, bytes)| std::fs::write(path, bytes).expect("a writable folder"));
        proof
    }
}

fn load(path: &Path) -> Job {
    Job::load(path, &Overrides::default()).unwrap_or_else(|e| panic!("{e}"))
}

fn verified(folder: &Path) -> Proof {
    verify(folder, None).unwrap_or_else(|e| panic!("{e}"))
}

fn alter(folder: &Path, name: &str, change: impl FnOnce(&mut Vec<u8>)) {
    let path = folder.join(name);
    let mut bytes = std::fs::read(&path).expect("a file of the folder");
    let before = bytes.clone();
    change(&mut bytes);
    assert_ne!(before, bytes, "the damage is one");
    std::fs::write(&path, bytes).expect("a writable folder");
}

/// Replaces the first occurrence after `from`.
fn replace(bytes: &mut Vec<u8>, from: &str, old: &str, new: &str) {
    let text = String::from_utf8(std::mem::take(bytes)).expect("text");
    let start = text.find(from).unwrap_or_else(|| panic!("{from:?} is there"));
    let (head, tail) = text.split_at(start);
    *bytes = (head.to_owned() + &tail.replacen(old, new, 1)).into_bytes();
}

/// A wavy sheet of 60 x 42 mm with a hole, as binary STL.
fn part(steep: f64) -> Vec<u8> {
    let z = |x: f64, y: f64| steep * (0.3 * math::sin(x / 11.0) + 0.25 * math::cos(y / 8.0) + 0.004 * x);
    let (nx, ny) = (60u32, 42u32);
    let mut facets = Vec::new();
    for j in 0..ny {
        for i in 0..nx {
            if (20..24).contains(&i) && (17..20).contains(&j) {
                continue;
            }
            let p = |i: u32, j: u32| [f64::from(i), f64::from(j), z(f64::from(i), f64::from(j))];
            let (a, b, c, d) = (p(i, j), p(i + 1, j), p(i + 1, j + 1), p(i, j + 1));
            facets.extend([[a, b, c], [a, c, d]]);
        }
    }
    stl(&facets)
}

/// Facets as a binary STL.
fn stl(facets: &[[[f64; 3]; 3]]) -> Vec<u8> {
    let mut out = vec![0; 80];
    out.extend((facets.len() as u32).to_le_bytes());
    for f in facets {
        out.extend([0; 12]);
        f.iter().flatten().for_each(|&v| out.extend((v as f32).to_le_bytes()));
        out.extend([0; 2]);
    }
    out
}

/// A built-in machine with another working distance and another width of its head.
fn head(profile: &str, working_distance: &str, diameter: &str) -> Vec<u8> {
    let text = terrace_core::machine::PROFILES.iter().find(|(name, _)| *name == profile).expect("a profile").1;
    let lines = text.lines().map(|line| match line.split_once(" = ") {
        Some(("working_distance", _)) => format!("working_distance = \"{working_distance}\"\n"),
        Some(("diameter", _)) => format!("diameter = \"{diameter}\"\n"),
        _ => format!("{line}\n"),
    });
    lines.collect::<String>().into_bytes()
}

/// Moves a block's stop and brings its commanded position along.
fn place(block: &mut Block, plan: &SteppedPlan) {
    let c = block.stop.centre;
    block.stage = plan.machine.stage_from_part(c, block.stop.lpfl, plan.checked.origins()[block.setup.index()]);
}

/// Takes stroke `i` out of the program; its points stay behind, unused.
fn remove(program: &mut Program, i: usize) {
    program.strokes.remove(i);
    for b in &mut program.blocks {
        let shift = |at: usize| if at > i { at - 1 } else { at };
        b.strokes = shift(b.strokes.start)..shift(b.strokes.end);
    }
}

/// Marks stroke `i` twice, of the same points.
fn double(program: &mut Program, i: usize) {
    program.strokes.insert(i, program.strokes[i]);
    for b in &mut program.blocks {
        let shift = |at: usize| if at > i { at + 1 } else { at };
        b.strokes = shift(b.strokes.start)..shift(b.strokes.end);
    }
}

/// A stroke with a long first segment in a block with many.
fn long_stroke(program: &Program) -> usize {
    long_stroke_of(program, |_| true)
}

/// The same of those that `is_meant`.
fn long_stroke_of(program: &Program, is_meant: impl Fn(&Stroke) -> bool) -> usize {
    let long = |s: &Stroke| {
        let points = program.points_of(s);
        is_meant(s) && points.first() != points.last() && terrace_core::program::stroke_mm(&points[..2]) > 1.0
    };
    let block = program.blocks.iter().find(|b| b.strokes.len() > 5 && program.strokes_of(b).iter().any(long));
    let block = block.expect("a block with a long stroke");
    block.strokes.clone().find(|&i| long(&program.strokes[i])).expect("a long stroke")
}

#[test]
fn dose_reports_a_pen_of_another_slope() {
    let bench = || Bench::of("contour", "", "dose = { compensate = \"speed\", step = 0.002 }", 6.0);
    let sound = bench();
    assert!(sound.plan.checked.program().pens.len() > 4, "{:?}", sound.plan.checked.program().pens);
    let proof = verified(&sound.write());
    assert!(proof.ok, "{proof:?}");
    let made = |program: &Program| {
        let of = |pen: u16| program.pens[usize::from(pen)].name.starts_with("fine x0.99");
        (0..program.strokes.len()).find(|&i| of(program.strokes[i].pen.0)).expect("a gentle slope")
    };
    let steep = |program: &Program| {
        let slowest =
            |&a: &usize, &b: &usize| program.pens[a].speed.as_mm_s().total_cmp(&program.pens[b].speed.as_mm_s());
        (2..program.pens.len()).filter(|&p| program.pens[p].name.starts_with("fine x")).min_by(slowest).expect("a pen")
            as u16
    };
    let proof = bench().mutant(|program, _| {
        let (i, pen) = (made(program), steep(program));
        program.strokes[i].pen = PenId(pen);
    });
    assert_only("dose", &proof);
    // The job's own pen where the slope asks for another.
    let proof = bench().mutant(|program, _| {
        let pen = steep(program);
        let i = (0..program.strokes.len()).find(|&i| program.strokes[i].pen == PenId(pen)).expect("one");
        program.strokes[i].pen = PenId(0);
    });
    assert_only("dose", &proof);
    // A pen that says one factor and has another.
    let proof = bench().mutant(|program, _| program.pens[2].speed = terrace_core::units::Speed::mm_s(123.0));
    assert_only("agreement", &proof);
    // A pen of another pen of the job.
    let proof = bench().mutant(|program, _| {
        let i = made(program);
        let name = program.pens[program.strokes[i].pen.index()].name.replace("fine", "deep");
        let other = program.pens.iter().position(|p| p.name == name);
        let deep = program.pens.iter().position(|p| p.name.starts_with("deep x")).expect("a pen");
        program.strokes[i].pen = PenId(other.unwrap_or(deep) as u16);
    });
    assert!(!proof.ok && proof.rules.iter().any(|r| r.code == "source" && r.violated > 0), "{proof:?}");
}

#[test]
fn compiled_job_verifies() {
    let bench = Bench::new();
    let proof = verified(&bench.write_as("job.job", true));
    assert!(proof.ok, "{}", proof.to_text());
    // No texture of it is a drawing.
    assert!(
        proof.rules.iter().all(|r| r.ran
            && (r.checked > 0
                || ["drawing", "bitmap", "mask", "curves", "marked", "measured", "draped"].contains(&r.code))),
        "{}",
        proof.to_text()
    );
}

#[test]
fn depth_reports_a_focal_plane_that_is_too_high() {
    let proof = Bench::new().mutant(|program, plan| {
        program.blocks[7].stop.lpfl += Nm(30_000);
        place(&mut program.blocks[7], plan);
    });
    assert_only("depth", &proof);
}

#[test]
fn depth_reports_strokes_in_the_level_above() {
    // The strokes of one block move to the next block of the same section.
    let proof = Bench::new().mutant(|program, _| {
        let pairs = program.blocks.windows(2).enumerate();
        let (i, _) = pairs.into_iter().find(|(_, w)| w[0].stop.section == w[1].stop.section).expect("levels");
        let last = program.blocks[i].strokes.end - 1;
        program.blocks[i].strokes.end = last;
        program.blocks[i + 1].strokes.start = last;
    });
    assert_only("depth", &proof);
}

#[test]
fn field_reports_marks_beyond_the_field() {
    let proof = Bench::new().mutant(|program, plan| {
        let block = &mut program.blocks[3];
        block.stop.centre.x += 35_000_000;
        place(block, plan);
        let strokes = block.strokes.clone();
        for s in &program.strokes[strokes] {
            for p in &mut program.points[s.first as usize..(s.first + s.len) as usize] {
                p.x -= 35_000_000;
            }
        }
    });
    assert_only("field", &proof);
}

#[test]
fn once_reports_a_doubled_stroke() {
    assert_only("once", &Bench::new().mutant(|program, _| double(program, long_stroke(program))));
}

#[test]
fn once_reports_overlaps_other_than_declared() {
    // Moves the inner end of a cut stroke by `by` nm along its segment, outwards.
    fn stretched(by: f64) -> impl Fn(&mut Program, &SteppedPlan) {
        move |program, _| {
            let is_long = |s: &terrace_core::program::Stroke| {
                s.len == 2 && terrace_core::program::stroke_mm(program.points_of(s)) > 1.0
            };
            let mut ends = std::collections::BTreeMap::<u32, Vec<usize>>::new();
            let long = program.strokes.iter().enumerate().filter(|(_, s)| is_long(s));
            long.for_each(|(i, s)| ends.entry(s.source.0).or_default().push(i));
            // The second of two pieces along the drawing reaches further back.
            let pair = ends.values().find(|v| v.len() > 1).expect("a cut line");
            let from = |&i: &usize| {
                let (s, b) = (&program.strokes[i], program.blocks.partition_point(|b| b.strokes.end <= i));
                let c = program.blocks[b].stop.centre;
                let at = |p: FieldPoint| (c.x + i64::from(p.x), c.y + i64::from(p.y));
                let points = program.points_of(s);
                at(if s.reversed { points[points.len() - 1] } else { points[0] })
            };
            let first = pair.iter().copied().min_by_key(|i| from(i)).expect("two");
            let second = pair.iter().copied().filter(|&i| i != first).min_by_key(|i| from(i)).expect("two");
            let s = program.strokes[second];
            let (head, tail) = if s.reversed { (s.first + s.len - 1, s.first) } else { (s.first, s.first + s.len - 1) };
            let (a, b) = (program.points[head as usize], program.points[tail as usize]);
            let length = terrace_core::program::stroke_mm(&[a, b]) * 1e6;
            program.points[head as usize].x -= (f64::from(b.x - a.x) / length * by).round() as i32;
            program.points[head as usize].y -= (f64::from(b.y - a.y) / length * by).round() as i32;
        }
    }
    let bench = Bench::with("overlap = \"0.05 mm\"", "");
    assert!(bench.plan.summary.overlap_mm > 1.0, "{:?}", bench.plan.summary);
    let proof = verified(&bench.write());
    assert!(proof.ok, "{}", proof.to_text());
    let broken = |proof: &Proof| super::broken(proof).contains(&"once");
    let proof = bench.mutant(stretched(1_000.0));
    assert!(broken(&proof), "{}", proof.to_text());
    // Without a declared overlap none is allowed.
    let mut bench = Bench::with("overlap = \"0.05 mm\"", "");
    bench.plan.job.partition.overlap = Nm(0);
    let path = bench.dir.path().join("job.toml");
    alter(bench.dir.path(), "job.toml", |b| replace(b, "overlap", "0.05", "0.00"));
    bench.plan.job = load(&path);
    let proof = verified(&bench.write());
    assert!(broken(&proof), "{}", proof.to_text());
}

#[test]
fn coverage_reports_a_missing_stroke() {
    let proof = Bench::new().mutant(|program, _| remove(program, long_stroke(program)));
    assert_only("coverage", &proof);
}

#[test]
fn coverage_reports_a_shortened_stroke() {
    let proof = Bench::new().mutant(|program, _| {
        let s = program.strokes[long_stroke(program)];
        let (a, b) = (program.points[s.first as usize], program.points[s.first as usize + 1]);
        // The first point moves along its own segment, so that it still lies on the texture.
        let at = |a: i32, b: i32| a + (f64::from(b - a) * 0.3).round() as i32;
        program.points[s.first as usize] = FieldPoint::new(at(a.x, b.x), at(a.y, b.y));
    });
    assert_only("coverage", &proof);
}

#[test]
fn source_reports_a_stroke_beside_the_texture() {
    let proof = Bench::new().mutant(|program, _| {
        // An inner corner of a square moves by 0.1 um.
        let s = *program.strokes.iter().find(|s| s.len == 5).expect("a whole square");
        program.points[s.first as usize + 2].y += 100;
    });
    assert_only("source", &proof);
}

#[test]
fn source_reports_a_figure_that_begins_elsewhere() {
    let proof = Bench::new().mutant(|program, _| {
        // The squares of a block begin where the beam comes from, not where they were drawn from.
        let turned = program.strokes.iter_mut().find(|s| s.len == 5 && s.segment > 0 && !s.reversed);
        turned.expect("a whole square").segment -= 1;
    });
    assert_only("source", &proof);
}

#[test]
fn travel_reports_a_part_beyond_the_stage() {
    let mut bench = Bench::new();
    let far = 400_000_000;
    let mut program = bench.plan.checked.program().clone();
    let origin = bench.plan.checked.origin();
    let moved = Origin([origin[0] + far, origin[1], origin[2]]);
    for b in &mut program.blocks {
        let c = b.stop.centre;
        b.stage = bench.plan.machine.stage_from_part(c, b.stop.lpfl, moved);
    }
    bench.plan.checked = Checked::unchecked(program, moved);
    assert_only("travel", &verified(&bench.write()));
}

#[test]
fn travel_reports_a_stop_off_the_increment() {
    let proof = Bench::new().mutant(|program, plan| {
        let block = &mut program.blocks[5];
        block.stop.lpfl += Nm(30);
        place(block, plan);
    });
    assert_only("travel", &proof);
}

#[test]
fn laser_reports_every_way_to_leave_it_on() {
    // Without the lines that end with a word, their numbers included.
    let without = |text: &str, word: &str| -> String {
        text.lines().filter(|l| !l.ends_with(word)).map(|l| format!("{l}\n")).collect()
    };
    let bench = Bench::new();
    let ways: [(&str, &str, &str, &str); 5] = [
        ("stage.ngc", "(BLOCK B0004", "G4 P", "(G4) (P"),
        ("stage.ngc", "(BLOCK B0004", "M66 P0 L4", "(M66 P0 L4)"),
        ("stage.ngc", "(BLOCK B0004", "M66 P0 L3", "(M66 P0 L3)"),
        ("stage.ngc", "G21", "G61.1", "G64"),
        ("stage_m0.nc", "BLOCK B0004", "M0", "(M0)"),
    ];
    for (name, from, old, new) in ways {
        let proof = bench.damaged(name, |bytes| {
            replace(bytes, from, old, new);
            let text = String::from_utf8(std::mem::take(bytes)).expect("text");
            // A comment opened over the rest of its line is closed there.
            let close = |l: &str| {
                if l.matches('(').count() > l.matches(')').count() { format!("{l})\n") } else { format!("{l}\n") }
            };
            *bytes = text.lines().map(close).collect::<String>().into_bytes();
        });
        // A mode is also one of those that every program begins with.
        let expected: &[&str] = if new == "G64" { &["agreement", "laser"] } else { &["laser"] };
        assert_eq!(broken(&proof), expected, "{}", proof.to_text());
    }
    // Every switch-off between the marks of one block and the move to the next.
    let proof = bench.damaged("stage.ngc", |bytes| {
        let text = String::from_utf8(std::mem::take(bytes)).expect("text");
        let start = text.find("(BLOCK B0004").expect("block 4");
        let end = text.find("(BLOCK B0006").expect("block 6");
        *bytes = (text[..start].to_owned() + &without(&text[start..end], "M65 P0") + &text[end..]).into_bytes();
    });
    assert_only("laser", &proof);
    let proof = bench.damaged("stage_m0.nc", |bytes| {
        let text = String::from_utf8(std::mem::take(bytes)).expect("text");
        *bytes = without(&text, "M5").into_bytes();
    });
    assert_only("laser", &proof);
}

#[test]
fn agreement_reports_one_format_that_differs() {
    let bench = Bench::new();
    // One digit of one coordinate of a drawing: 1 nm.
    let proof = bench.damaged("blocks/B0005.dxf", |bytes| {
        let text = String::from_utf8(std::mem::take(bytes)).expect("text");
        let at = text.find("ENTITIES").expect("entities");
        let digit = at + text[at..].find("\r\n 10\r\n").or_else(|| text[at..].find("\r\n10\r\n")).expect("an x") + 8;
        let end = digit + text[digit..].find("\r\n").expect("a line") - 1;
        let last = text.as_bytes()[end];
        *bytes = text.into_bytes();
        bytes[end] = if last == b'5' { b'6' } else { b'5' };
    });
    assert_only("agreement", &proof);
    // The same of a list of points; a point less; another pen.
    let changes: [fn(&str) -> String; 3] = [
        |line| format!("{}{}", &line[..line.len() - 1], if line.ends_with('5') { '6' } else { '5' }),
        |_| String::new(),
        |line| line.replacen(",1,", ",2,", 1),
    ];
    for change in changes {
        let proof = bench.damaged("blocks/B0005.csv", |bytes| {
            let text = String::from_utf8(std::mem::take(bytes)).expect("text");
            let line = text.lines().rfind(|l| l.contains(",1,")).expect("a point of the first pen");
            let ends = if change(line).is_empty() { "\r\n" } else { "" };
            *bytes = text.replacen(&format!("{line}{ends}"), &change(line), 1).into_bytes();
        });
        assert_only("agreement", &proof);
    }
    // A target of the stage program.
    let proof = bench.damaged("stage.ngc", |bytes| {
        let text = String::from_utf8(std::mem::take(bytes)).expect("text");
        let at = text.find("(BLOCK B0007").expect("block 7");
        let z = at + text[at..].find("G0 Z").expect("a z move") + 4;
        let end = z + text[z..].find('\n').expect("a line") - 3;
        *bytes = text.into_bytes();
        bytes[end] = if bytes[end] == b'5' { b'6' } else { b'5' };
    });
    assert_only("agreement", &proof);
    // A point of the OVF, by a few steps of its float.
    let program = bench.plan.checked.program();
    let p = program.points_of(&program.strokes[long_stroke(program)])[0];
    let p = [p.x, p.y].map(|v| (f64::from(v) / 1e6) as f32);
    let have = [p[0].to_le_bytes(), p[1].to_le_bytes()].concat();
    let proof = bench.damaged("job.ovf", |bytes| {
        let at = bytes.windows(8).position(|w| w == have).expect("the point is there");
        bytes[at] ^= 0x04;
    });
    assert_only("agreement", &proof);
}

#[test]
fn hash_reports_a_changed_a_missing_and_an_added_file() {
    let bench = Bench::new();
    let target = bench.write_as("job.job", true);
    alter(&target, "layout.svg", |b| b.push(b' '));
    assert_only("hash", &verified(&target));
    let target = bench.write_as("job.job", true);
    std::fs::write(target.join("extra.txt"), "x").expect("a writable folder");
    assert_only("hash", &verified(&target));
    let target = bench.write_as("job.job", true);
    std::fs::remove_file(target.join("report.html")).expect("a file of ours");
    assert_only("hash", &verified(&target));
}

#[test]
fn summary_reports_a_wrong_length() {
    let bench = Bench::new();
    for key in ["mark_mm", "texture_mm", "skipped_mm", "worst_defocus_um"] {
        let target = bench.write();
        alter_manifest(&target, |m| {
            let v = m["summary"][key].as_f64().expect("a number");
            m["summary"][key] = (v + 0.01).into();
        });
        assert_only("summary", &verified(&target));
    }
    for side in 0..3 {
        let target = bench.write();
        alter_manifest(&target, |m| {
            let v = m["summary"]["part_mm"][side].as_f64().expect("a number");
            m["summary"]["part_mm"][side] = (v + 0.001).into();
        });
        // The run sheet says it too.
        assert_eq!(super::broken(&verified(&target)), ["agreement", "summary"]);
    }
}

/// Changes what the manifest says of its sections, and verifies.
fn refilled(change: impl FnOnce(&mut serde_json::Value)) -> Proof {
    let bench = Bench::new();
    let target = bench.write();
    alter_manifest(&target, |m| change(&mut m["passes"][0]["sections"]));
    verified(&target)
}

#[test]
fn fill_reports_sections_and_directions_that_differ() {
    assert_only("fill", &refilled(|s| s["columns"] = 7.into()));
    assert_only("fill", &refilled(|s| s["origin_mm"][0] = 0.5.into()));
    assert_only("fill", &refilled(|s| s["pitch_mm"][1] = 21.0.into()));
    assert_only("fill", &refilled(|s| s["pitch_mm"][0] = 10.0.into()));
    assert_only("fill", &refilled(|s| s["pitch_mm"] = serde_json::json!([0.0, -1.0])));
    assert_only("fill", &refilled(|s| _ = s["direction_deg"].as_array_mut().expect("directions").pop()));
    assert_only("fill", &refilled(|s| _ = s.as_object_mut().expect("sections").remove("direction_deg")));
    for wrong in [180.0, -1.0, 12.345, 1e300] {
        assert_only("fill", &refilled(|s| s["direction_deg"][1] = wrong.into()));
    }
    // A sound hatch, but not the one that is marked.
    let proof = refilled(|s| {
        let deg = s["direction_deg"][1].as_f64().expect("a direction");
        s["direction_deg"][1] = ((deg * 100.0 + 1.0).round() % 18_000.0 / 100.0).into();
    });
    let broken = super::broken(&proof);
    assert!(broken.contains(&"source") && !broken.contains(&"fill"), "{}", proof.to_text());
}
