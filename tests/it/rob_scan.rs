//! A head that tilts (rob-scan): the marks of a table that tilts the part, the stops of the dome, and jobs for every
//! kind of head, all verified.

use std::path::Path;
use terrace_core::math;

use terrace_core::machine::Machine;
use terrace_core::program::{Block, Program, Stroke};
use terrace_plan::plan::SteppedPlan;

use crate::support::surfaces::{dome, mesh, write_stl};
use crate::support::{JobText, compile, folder, machine_file, manifest, number, planned, said, terrace, verify};

const PROFILE: &str = "xyz-headtilt-galvo-40";

type V3 = [f64; 3];

/// A built-in machine with another `[tilt]`: what it carries, its pivot in mm, and letter and direction of its axes.
fn with_tilt(profile: &str, carries: &str, pivot: V3, axes: [(&str, bool); 2]) -> String {
    let text = machine_file(profile);
    let (head, _) = text.split_once("[tilt]").expect("tilt axes");
    let [x, y, z] = pivot;
    let mut text = format!("{head}[tilt]\ncarries = {carries:?}\npivot = [\"{x} mm\", \"{y} mm\", \"{z} mm\"]\n");
    for (letter, reversed) in axes {
        text += &format!(
            "[[tilt.axes]]\nletter = {letter:?}\nreversed = {reversed}\ntravel = [\"-180 deg\", \"180 deg\"]\n\
             move_time = \"1 s\"\n"
        );
    }
    text
}

/// A job by method `tilt` for the machine with this text.
fn job(dir: &Path, part: &Path, machine: &str, name: &str) -> JobText {
    std::fs::write(dir.join(name), machine).expect("a writable folder");
    let mut job = JobText::on(part).texture("pattern = \"hatch\"\npitch = \"4 mm\"\ndirection = \"20 deg\"");
    job.machine = format!("file = {name:?}");
    job.method("tilt")
}

/// A turn about x, y or z.
fn about(letter: &str, deg: f64, [x, y, z]: V3) -> V3 {
    let (s, c) = math::sin_cos(deg.to_radians());
    match letter {
        "A" => [x, c * y - s * z, s * y + c * z],
        "B" => [c * x + s * z, y, c * z - s * x],
        _ => [c * x - s * y, s * x + c * y, z],
    }
}

/// Where a point of the field in the focal plane lies on the part, and the beam's direction there, nm: from what is
/// commanded alone. Both stages that are used here have all signs of `xyz-headtilt-galvo-40` or of `xyz-tilt-galvo-40`.
fn on_the_part(machine: &Machine, block: &Block, origin: V3, field: [f64; 2]) -> [V3; 2] {
    let stage = [0, 1, 2].map(|k| machine.axes()[k].1.sign() as f64 * block.stage[k] as f64);
    let axes = machine.tilt.as_ref().expect("tilt axes");
    let turns: Vec<(String, f64)> = axes
        .axes
        .iter()
        .zip(block.stop.tilt.deg())
        .map(|(axis, deg)| (axis.letter.char().to_string(), if axis.reversed { -deg } else { deg }))
        .collect();
    let pivot = axes.pivot.map(|p| p.as_mm() * 1e6);
    let [(outer, u), (inner, v)] = &turns[..] else { panic!("two axes") };
    if machine.tilts_head() {
        // Turned about the pivot that the stage carries, by the inner axis first.
        let turned = |p: V3| about(outer, *u, about(inner, *v, p));
        let p = turned([field[0] - pivot[0], field[1] - pivot[1], -pivot[2]]);
        return [[0, 1, 2].map(|k| stage[k] + pivot[k] + p[k] - origin[k]), turned([0.0, 0.0, 1.0])];
    }
    // The part is turned about the pivot: back to where it was, by the outer axis first.
    let back = |p: V3| about(inner, -v, about(outer, -u, p));
    let p = back([stage[0] + field[0] - pivot[0], stage[1] + field[1] - pivot[1], stage[2] - pivot[2]]);
    [[0, 1, 2].map(|k| p[k] + pivot[k] - origin[k]), back([0.0, 0.0, 1.0])]
}

/// The distance of two beams that are parallel to better than 1e-9 rad, nm.
fn apart([p, up]: [V3; 2], [q, up2]: [V3; 2]) -> f64 {
    assert!((0..3).all(|k| (up[k] - up2[k]).abs() < 1e-9), "{up:?} {up2:?}");
    let d = [0, 1, 2].map(|k| p[k] - q[k]);
    let along: f64 = (0..3).map(|k| d[k] * up[k]).sum();
    (0..3).map(|k| (d[k] - along * up[k]).powi(2)).sum::<f64>().sqrt()
}

/// The blocks by tilt and level, each with its strokes in the order of the texture.
fn ordered(program: &Program) -> Vec<(&Block, Vec<&Stroke>)> {
    let mut blocks: Vec<&Block> = program.blocks.iter().collect();
    blocks.sort_by_key(|b| {
        (b.stop.section.0, b.stop.level, b.stop.tilt.0, b.stop.centre.x / 1000, b.stop.centre.y / 1000)
    });
    let strokes = |b: &Block| {
        let mut all: Vec<&Stroke> = program.strokes_of(b).iter().collect();
        all.sort_by_key(|s| (s.source, s.segment, s.len));
        all
    };
    blocks.into_iter().map(|b| (b, strokes(b))).collect()
}

/// How many points of marks two plans have, and how far their places on the part lie apart at most, nm.
fn compared(a: &SteppedPlan, b: &SteppedPlan) -> (usize, f64) {
    let (pa, pb) = (a.checked.program(), b.checked.program());
    let origins = [a, b].map(|plan| plan.checked.origin().0.map(|v| v as f64));
    let (blocks, others) = (ordered(pa), ordered(pb));
    assert_eq!(blocks.len(), others.len(), "as many stops");
    let (mut count, mut worst) = (0, 0.0f64);
    for ((block, strokes), (other, theirs)) in blocks.iter().zip(&others) {
        assert_eq!(strokes.len(), theirs.len(), "as many strokes");
        for (s, t) in strokes.iter().zip(theirs) {
            assert_eq!((s.source, s.segment, s.len), (t.source, t.segment, t.len));
            let (p, mut q) = (pa.points_of(s).to_vec(), pb.points_of(t).to_vec());
            if s.reversed != t.reversed {
                q.reverse();
            }
            for (p, q) in p.iter().zip(&q) {
                let here = on_the_part(&a.machine, block, origins[0], [f64::from(p.x), f64::from(p.y)]);
                let there = on_the_part(&b.machine, other, origins[1], [f64::from(q.x), f64::from(q.y)]);
                (count, worst) = (count + 1, worst.max(apart(here, there)));
            }
        }
    }
    (count, worst)
}

/// A head that is turned as a table turns the part the other way round marks the same. Both stages take nanometres, so
/// that sections and levels begin at the same places; the field and the depth of the head are larger by what it gives up
/// for the increments of a stage.
#[test]
#[ignore = "slow: make test-all"]
fn a_tilted_head_marks_what_a_tilted_part_gets_to_a_nanometre() {
    let dir = folder();
    let part = dir.path().join("dome.stl");
    write_stl(&part, &mesh(24, [0.0, 0.0, 110.0, 90.0], |x, y| dome(3.0 * x, 3.0 * y)));
    let table = with_tilt("xyz-tilt-galvo-40", "part", [0.0; 3], [("A", false), ("B", false)]);
    let head = with_tilt(PROFILE, "head", [1.5, -2.0, 250.0], [("B", true), ("A", true)]);
    let [table, head] = [(table, "table.txt", "40.00002 mm"), (head, "head.txt", "40.000024 mm")];
    let [table, head] = [table, head].map(|(text, name, field)| {
        let text = text.replacen("field = [\"40 mm\", \"40 mm\"]", &format!("field = [{field:?}, {field:?}]"), 1);
        let text = text.replacen("increment = \"0.0001 mm\"", "increment = \"0.000001 mm\"", 1);
        let mut job = job(dir.path(), &part, &text, name);
        job.focus = format!("pdof = \"{} mm\"", if name == "head.txt" { 0.07 } else { 0.069996 });
        job.more = "[placement]\norigin = [\"-55 mm\", \"-45 mm\", \"3.2 mm\"]\n".into();
        planned(&job.write(dir.path(), &format!("{name}.toml")))
    });
    let tilted = head.checked.program().blocks.iter().filter(|b| !b.stop.tilt.is_upright()).count();
    assert!(tilted > 5, "{tilted}");
    let (count, worst) = compared(&table, &head);
    eprintln!("{count} points at {tilted} tilted stops, {worst:.3} nm apart at most");
    assert!(count > 100 && worst <= 1.0, "{worst} nm");
}

/// A program of a wrong kinematic would be found by the comparison above.
#[test]
fn a_pivot_moved_by_a_micrometre_moves_the_marks() {
    let dir = folder();
    let part = dir.path().join("dome.stl");
    write_stl(&part, &mesh(24, [0.0, 0.0, 110.0, 90.0], |x, y| dome(3.0 * x, 3.0 * y)));
    let plan = planned(&job(dir.path(), &part, &machine_file(PROFILE), "head.txt").write(dir.path(), "job.toml"));
    let block = plan.checked.program().blocks.iter().max_by_key(|b| b.stop.tilt[0].abs()).expect("a block");
    let sine = math::sin(block.stop.tilt.deg()[0].to_radians()).abs();
    let origin = plan.checked.origin().0.map(|v| v as f64);
    let mut moved = plan.machine.clone();
    moved.tilt.as_mut().expect("axes").pivot[2] = terrace_core::units::Length::mm(250.001);
    let by = apart(on_the_part(&plan.machine, block, origin, [0.0; 2]), on_the_part(&moved, block, origin, [0.0; 2]));
    assert!(by > 900.0 * sine && sine > 0.02, "{by} nm at a sine of {sine}");
}

/// The dome of `closed_forms` as half a million facets under lines of 1 mm pitch, as in `docs/explanation/compare.md`.
#[test]
#[ignore = "slow: make test-all"]
fn rob_scan_of_the_dome_takes_144_stops_and_verifies() {
    let dir = folder();
    let part = dir.path().join("dome.stl");
    write_stl(&part, &mesh(500, [0.0, 0.0, 450.0, 450.0], dome));
    let mut job = JobText::on(&part).texture("pattern = \"hatch\"\npitch = \"1 mm\"").method("tilt");
    job.machine = format!("profile = {PROFILE:?}");
    job.more = "[emit]\nformats = [\"linuxcnc\", \"ovf\", \"poses\"]\n".into();
    let out = dir.path().join("dome.job");
    let summary = compile(&job.write(dir.path(), "job.toml"), &out);
    assert_eq!(number(&summary, "stops"), 144.0);
    assert!(summary["warnings"].as_array().is_none_or(Vec::is_empty), "{summary}");
    let proof = verify(&out);
    assert_eq!(number(&proof, "stops"), 144.0);
    let poses = std::fs::read_to_string(out.join("poses.csv")).expect("poses");
    assert_eq!(poses.lines().count(), 145);
}

#[test]
#[ignore = "slow: make test-all"]
fn jobs_for_every_kind_of_head_verify() {
    let dir = folder();
    let part = dir.path().join("dome.stl");
    write_stl(&part, &mesh(50, [0.0, 0.0, 140.0, 120.0], |x, y| dome(3.0 * x, 3.0 * y)));
    for (k, axes) in
        [[("B", true), ("A", false)], [("C", false), ("A", true)], [("C", true), ("B", false)]].into_iter().enumerate()
    {
        let mut text = with_tilt(PROFILE, "head", [3.0, -4.0, 180.0], axes);
        if k == 1 {
            // The stage carries the part under a head that tilts.
            for line in [
                "carries = \"head\"                  # assumption: a gantry over a part that stays",
                "carries = \"head\"                  # assumption: as x",
            ] {
                assert!(text.contains(line));
                text = text.replacen(line, "carries = \"part\"", 1);
            }
        }
        let mut job = job(dir.path(), &part, &text, "head.txt");
        job.more = "[emit]\nformats = [\"dxf\", \"linuxcnc\", \"gcode\", \"ovf\", \"poses\"]\n\n\
                    [passes]\ncount = 2\nlower = \"10 um\"\nrotate = \"30 deg\"\n"
            .into();
        let out = dir.path().join("head.job");
        let summary = compile(&job.write(dir.path(), "job.toml"), &out);
        assert!(
            manifest(&out)["blocks"].as_array().expect("blocks").iter().any(|b| b["tilt_deg"][0] != 0.0),
            "{summary}"
        );
        verify(&out);
    }
}

#[test]
fn swivels_that_cannot_lean_the_head_are_refused() {
    let dir = folder();
    let part = dir.path().join("flat.stl");
    write_stl(&part, &mesh(2, [0.0, 0.0, 10.0, 10.0], |_, _| 0.0));
    let text = with_tilt(PROFILE, "head", [0.0; 3], [("A", false), ("C", false)]);
    let job = job(dir.path(), &part, &text, "head.txt").write(dir.path(), "job.toml");
    let out = terrace(["compile".as_ref(), job.as_os_str()]);
    assert!(!out.status.success() && said(&out).contains("machine-tilt"), "{}", said(&out));
}
