//! Fixtures and the table: kept clear of by the head and by beams, found in every frame, shown, and proved.

use std::path::Path;

use crate::support::surfaces::{mesh, write_stl};
use crate::support::{JobText, compile, folder, machine_file, manifest, planned, said, seeds, terrace, verify};
use serde_json::{Value, json};
use terrace_core::math;
use terrace_core::random::Random;
use terrace_plan::plan::SteppedPlan;

/// A hatch every 2 mm over a dome of 60 x 40 mm that rises from z = 0.
fn job(dir: &Path, more: &str) -> JobText {
    let stl = dir.join("dome.stl");
    if !stl.exists() {
        write_stl(
            &stl,
            &mesh(20, [0.0, 0.0, 60.0, 40.0], |x, y| (x * (60.0 - x) / 900.0 + y * (40.0 - y) / 400.0) / 4.0),
        );
    }
    let mut job = JobText::on(&stl).texture("pattern = \"hatch\"\npitch = \"2 mm\"").method("contour");
    job.more = more.to_owned();
    job
}

fn clamp(corners: [[f64; 3]; 2], more: &str) -> String {
    let corner = |p: [f64; 3]| format!("[\"{} mm\", \"{} mm\", \"{} mm\"]", p[0], p[1], p[2]);
    format!("[[fixture]]\nname = \"clamp\"\nbox = [{}, {}]\n{more}\n", corner(corners[0]), corner(corners[1]))
}

/// What `check` says of a job that it refuses: for a limit (1), or for its input (2).
fn refused(dir: &Path, job: &JobText) -> String {
    let done = terrace([Path::new("check"), job.write(dir, "job.toml").as_path()]);
    assert!(matches!(done.status.code(), Some(1 | 2)), "{}", said(&done));
    said(&done)
}

/// The folder of a job that compiles and verifies.
fn accepted(dir: &Path, job: &JobText) -> Value {
    let to = dir.join("out");
    compile(&job.write(dir, "job.toml"), &to);
    verify(&to);
    manifest(&to)
}

fn numbers(v: &Value) -> Vec<f64> {
    v.as_array().expect("a list").iter().map(|v| v.as_f64().expect("a number")).collect()
}

/// Whether two boxes of manifests are the same, to a tenth of a micrometre.
fn is_same_box(entry: &Value, corners: [[f64; 3]; 2]) -> bool {
    let own: Vec<f64> = entry["box_mm"].as_array().expect("corners").iter().flat_map(numbers).collect();
    own.iter().zip(corners.iter().flatten()).all(|(a, b)| (a - b).abs() <= 1.1e-4)
}

#[test]
fn a_clamp_beside_the_part_is_shown_and_one_on_the_texture_is_refused() {
    let dir = folder();
    let beside = [[20.0, -15.0, -2.0], [30.0, -3.0, 25.0]];
    let m = accepted(dir.path(), &job(dir.path(), &clamp(beside, "")));
    assert_eq!(m["fixtures"], json!([{ "name": "clamp", "box_mm": beside }]));
    let read = |name: &str| std::fs::read_to_string(dir.path().join("out").join(name)).expect("written");
    assert!(read("layout.svg").contains("fixture clamp, z -2.0 to 25.0 mm</title>"));
    let [x, y, z] = [0, 1, 2].map(|k| numbers(&m["placement"]["origin_mm"])[k]);
    let stands = format!(
        "fixture    clamp: X{:.2} to {:.2} Y{:.2} to {:.2} Z{:.2} to {:.2} mm in the table frame",
        20.0 + x,
        30.0 + x,
        -15.0 + y,
        -3.0 + y,
        -2.0 + z,
        25.0 + z
    );
    assert!(read("runsheet.txt").contains(&stands), "{}", read("runsheet.txt"));
    let text = refused(dir.path(), &job(dir.path(), &clamp([[20.0, -15.0, -2.0], [30.0, 3.0, 25.0]], "")));
    assert!(text.contains("error[fixture-beam]") && text.contains("fixture \"clamp\" would be in the way"), "{text}");
    // The same on the fly: nothing follows the head there.
    let mut fly = job(dir.path(), &clamp(beside, ""));
    fly.more += "[emit]\nformats = [\"linuxcnc\"]\n";
    let done = terrace(
        ["check", "--mode", "on-the-fly"]
            .map(Path::new)
            .into_iter()
            .chain([fly.write(dir.path(), "fly.toml").as_path()]),
    );
    assert!(said(&done).contains("on-the-fly programs cannot do fixtures ([[fixture]])"), "{}", said(&done));
}

#[test]
fn a_fixture_lies_where_its_frame_says() {
    let dir = folder();
    let box_of = |job: &JobText| accepted(dir.path(), job)["fixtures"][0].clone();
    // Turned by 90 deg with the part: x and y of a corner become -y and x.
    let own = [[70.0, 5.0, 0.0], [80.0, 15.0, 20.0]];
    let turned = [[-15.0, 70.0, 0.0], [-5.0, 80.0, 20.0]];
    let placed = "[placement]\norigin = [\"10 mm\", \"-20 mm\", \"3 mm\"]\nturn = \"90 deg\"\n";
    let found = box_of(&job(dir.path(), &format!("{placed}{}", clamp(own, ""))));
    assert!(is_same_box(&found, turned), "{found}");
    // In the table frame the part's origin counts, and no turn.
    let on_table = turned.map(|p| [p[0] + 10.0, p[1] - 20.0, p[2] + 3.0]);
    let found = box_of(&job(dir.path(), &format!("{placed}{}", clamp(on_table, "frame = \"table\""))));
    assert!(is_same_box(&found, turned), "{found}");
    // In the frame of the surface file its datum, scale and rotation count: half as large, laid from upright.
    let stl = dir.path().join("upright.stl");
    let dome = mesh(20, [0.0, 0.0, 60.0, 40.0], |x, y| (x * (60.0 - x) / 900.0 + y * (40.0 - y) / 400.0) / 4.0);
    // What is z of the part is -y of the file, its y is z; twice as large, about (5, 6, 7).
    let to_file = |[x, y, z]: [f64; 3]| [2.0 * x + 5.0, -2.0 * z + 6.0, 2.0 * y + 7.0];
    write_stl(&stl, &dome.iter().map(|facet| facet.map(to_file)).collect::<Vec<_>>());
    let [a, b] = own.map(to_file);
    let mut laid = job(dir.path(), "");
    laid.surface = format!("file = {:?}\nunit = \"mm\"\ndatum = [5, 6, 7]\nscale = 0.5", stl.display().to_string());
    laid.more = format!(
        "[placement]\nrotate = [\"-90 deg\", \"0 deg\", \"0 deg\"]\n{}",
        clamp([a, b], "frame = \"surface-file\"")
    );
    let found = box_of(&laid);
    assert!(is_same_box(&found, own), "{found}");
    // A file of another unit, moved.
    let cube = mesh(1, [0.0, 0.0, 1.0, 1.0], |_, _| 0.0).into_iter().chain(mesh(1, [0.0, 0.0, 1.0, 1.0], |_, _| 2.0));
    write_stl(&dir.path().join("cube.stl"), &cube.collect::<Vec<_>>());
    let of_file =
        "[[fixture]]\nname = \"clamp\"\nfile = \"cube.stl\"\nunit = \"cm\"\nat = [\"70 mm\", \"5 mm\", \"0 mm\"]\n";
    let found = box_of(&job(dir.path(), of_file));
    assert!(is_same_box(&found, own), "{found}");
}

#[test]
fn the_head_lifts_over_what_stands_beside_its_way() {
    let dir = folder();
    let of = |more: &str| accepted(dir.path(), &job(dir.path(), more));
    let lifts =
        |m: &Value| m["blocks"].as_array().expect("blocks").iter().filter(|b| !b["lift_z_mm"].is_null()).count();
    let flat = of("");
    assert_eq!(lifts(&flat), 1, "the first block is reached from above");
    // 20 mm above the lower end of the head: no stop may be near it, and the ways between them are 20 mm and more
    // long. A post at each corner that no stop reaches, too high for every way.
    let high = clamp([[25.0, 80.0, 0.0], [35.0, 90.0, 160.0]], "");
    let m = of(&high);
    assert!(lifts(&m) >= 1);
    let text = refused(dir.path(), &job(dir.path(), &clamp([[25.0, 60.0, 0.0], [35.0, 70.0, 160.0]], "")));
    assert!(text.contains("error[clearance]") && text.contains("too near to fixture \"clamp\""), "{text}");
    assert!(text.contains("or move the fixture"), "{text}");
}

#[test]
fn what_cannot_be_a_fixture_is_refused_at_its_key() {
    let dir = folder();
    std::fs::write(dir.path().join("points.xyz"), "0 0 0\n1 0 0\n0 1 0\n").expect("writable");
    for (more, code, key) in [
        (
            "[[fixture]]\nname = \"a b\"\nbox = [[\"0 mm\", \"0 mm\", \"0 mm\"], [\"1 mm\", \"1 mm\", \"1 mm\"]]",
            "fixture-name",
            "name",
        ),
        ("[[fixture]]\nname = \"a\"", "fixture-shape", "[[fixture]]"),
        ("[[fixture]]\nname = \"a\"\nfile = \"points.xyz\"\nunit = \"mm\"", "fixture-shape", "points.xyz"),
        ("[[fixture]]\nname = \"a\"\nfile = \"dome.stl\"", "fixture-shape", "[[fixture]]"),
        ("[[fixture]]\nname = \"a\"\nfile = \"none.stl\"\nunit = \"mm\"", "file-unreadable", "none.stl"),
        (
            "[[fixture]]\nname = \"a\"\nbox = [[\"0 mm\", \"0 mm\", \"0 mm\"], [\"1 mm\", \"1 mm\", \"0 mm\"]]",
            "fixture-shape",
            "box",
        ),
        (&clamp([[70.0, 0.0, 0.0], [80.0, 1.0, 1.0]], "frame = \"table\""), "fixture-frame", "frame"),
        (&clamp([[70.0, 0.0, 0.0], [80.0, 1.0, 1.0]], "setups = [1]"), "fixture-setups", "setups"),
        (&clamp([[70.0, 0.0, 0.0], [80.0, 1.0, 1.0]], "colour = 1"), "unknown", "colour"),
    ] {
        let text = refused(dir.path(), &job(dir.path(), more));
        assert!(text.contains(code) && text.contains(key), "{more}: {text}");
    }
}

#[test]
fn a_fixture_of_one_set_up_is_not_in_the_way_in_another() {
    let dir = folder();
    // The stage travels 30 mm in x: two set-ups, of x = 0 to 30 and 30 to 60 mm of the part.
    let machine = machine_file("xyz-galvo-40").replacen(
        "travel = [\"-250 mm\", \"250 mm\"]",
        "travel = [\"-11 mm\", \"11 mm\"]",
        1,
    );
    std::fs::write(dir.path().join("machine.toml"), &machine).expect("writable");
    let holes = "[setups]\nregistration = [[\"20 mm\", \"1 mm\"], [\"25 mm\", \"39 mm\"], [\"35 mm\", \"1 mm\"], [\"40 mm\", \"39 mm\"]]\n";
    let with = |fixture: &str| {
        let mut job = job(dir.path(), &format!("{holes}{fixture}[emit]\nformats = [\"csv\", \"linuxcnc\"]\n"));
        job.partition = "section = \"20 mm\"".into();
        job.machine = "file = \"machine.toml\"".into();
        job
    };
    let m = accepted(dir.path(), &with(""));
    assert_eq!(m["setups"].as_array().map(Vec::len), Some(2), "{}", m["setups"]);
    // On the texture of the first.
    let first = [[0.0, 10.0, -1.0], [8.0, 20.0, 15.0]];
    let m = accepted(dir.path(), &with(&clamp(first, "setups = [2]")));
    assert_eq!(m["fixtures"][0]["setups"], json!([2]));
    let sheet = std::fs::read_to_string(dir.path().join("out/runsheet.txt")).expect("written");
    let (before, after) = sheet.split_once("SET-UP 2 OF 2").expect("two set-ups");
    assert!(!before.contains("clamp:") && after.contains("    fixture clamp: X"), "{sheet}");
    assert!(refused(dir.path(), &with(&clamp(first, "setups = [1]"))).contains("fixture-beam"));
    assert!(refused(dir.path(), &with(&clamp(first, ""))).contains("fixture-beam"));
    let text = refused(dir.path(), &with(&clamp(first, "setups = [3]")));
    assert!(text.contains("fixture-setups") && text.contains("is in set-up 3, but there are 2"), "{text}");
}

#[test]
fn a_part_rests_on_the_table_and_neither_it_nor_the_head_gets_into_it() {
    let dir = folder();
    let machine = machine_file("xyz-galvo-40");
    let with = |table: &str, more: &str| {
        std::fs::write(
            dir.path().join("machine.toml"),
            machine.replacen("clearance =", &format!("table = \"{table}\"\nclearance ="), 1),
        )
        .expect("writable");
        let mut job = job(dir.path(), more);
        job.machine = "file = \"machine.toml\"".into();
        job
    };
    let height = |m: &Value| numbers(&m["placement"]["origin_mm"])[2];
    let m = accepted(dir.path(), &with("-80 mm", ""));
    assert!((height(&m) + 80.0).abs() < 1e-4, "{}", height(&m));
    let sheet = std::fs::read_to_string(dir.path().join("out/runsheet.txt")).expect("written");
    assert!(sheet.contains("table      Z-80.0000 mm in the table frame"), "{sheet}");
    let at = |z: &str| format!("[placement]\norigin = [\"0 mm\", \"0 mm\", \"{z}\"]\n");
    accepted(dir.path(), &with("-80 mm", &at("-79 mm")));
    accepted(dir.path(), &with("-80 mm", &at("-80.05 mm")));
    let text = refused(dir.path(), &with("-80 mm", &at("-81 mm")));
    assert!(text.contains("error[table-reached]") && text.contains("would lie 1 mm deep in the table"), "{text}");
    assert!(text.contains("z = -80 mm puts it on the table"), "{text}");
    let text = refused(dir.path(), &with("5000 mm", ""));
    assert!(text.contains("machine-table"), "{text}");
}

/// A box that holds the part, and how far a point of the plane lies from it, mm.
struct Post([[f64; 3]; 2]);

impl Post {
    fn distance(&self, [x, y]: [f64; 2]) -> f64 {
        let beyond = |v: f64, k: usize| (self.0[0][k] - v).max(v - self.0[1][k]).max(0.0);
        math::hypot(beyond(x, 0), beyond(y, 1))
    }
}

/// The radius (1/e²) of a beam of 20 um, 355 nm and M² 1 at a height above its focal plane, mm.
fn beam(height: f64) -> f64 {
    let rayleigh = std::f64::consts::PI * 0.01 * 0.01 / 355e-6;
    0.01 * (1.0 + (height / rayleigh).powi(2)).sqrt()
}

/// Whether a point of a mark, mm, has so many radii of its beam to itself at every tenth of a millimetre of a box.
fn is_free(post: &Post, at: [f64; 2], plane: f64, radii: f64) -> bool {
    let (low, top) = ((post.0[0][2] - plane).max(0.0), post.0[1][2] - plane);
    (0..)
        .map(|i| (low + 0.1 * f64::from(i)).min(top))
        .take_while(|h| *h < top)
        .all(|h| post.distance(at) >= radii * beam(h))
}

/// Points of all marks of a plan, part frame, mm, each with its focal plane.
fn points(plan: &SteppedPlan) -> Vec<([f64; 2], f64)> {
    let program = plan.checked.program();
    let mut out = Vec::new();
    for block in &program.blocks {
        let [x, y] = block.stop.centre.mm();
        for stroke in program.strokes_of(block) {
            for pair in program.points_of(stroke).windows(2) {
                let [a, b] = [pair[0], pair[1]].map(|p| [f64::from(p.x) / 1e6 + x, f64::from(p.y) / 1e6 + y]);
                let steps = (math::hypot(b[0] - a[0], b[1] - a[1]) / 0.05).ceil();
                for i in 0..=steps as u32 {
                    let t = f64::from(i) / steps;
                    out.push(([0, 1].map(|k| a[k] + t * (b[k] - a[k])), block.stop.lpfl.mm()));
                }
            }
        }
    }
    out
}

/// By how much a head of 20 mm, its lower end less the clearance 20 mm above the focal plane, gets nearest to a box on
/// all moves, mm: below zero where it enters.
fn nearest(plan: &SteppedPlan, post: &Post) -> f64 {
    let program = plan.checked.program();
    let lifted = plan.machine.retract_z().mm();
    let mut stations: Vec<[f64; 3]> = Vec::new();
    for (i, block) in program.blocks.iter().enumerate() {
        let [x, y] = block.stop.centre.mm();
        let z = block.stop.lpfl.mm();
        // Over the part, heights of the stage count from the part's origin.
        let over = if i == 0 || block.retract {
            lifted - plan.checked.origin().mm()[2]
        } else {
            stations.last().expect("before")[2]
        };
        let from = stations.last().copied().unwrap_or([x, y, over]);
        stations.extend([[from[0], from[1], over], [x, y, over], [x, y, z]]);
    }
    let mut least = f64::INFINITY;
    for pair in stations.windows(2) {
        let length = (0..3).map(|k| (pair[1][k] - pair[0][k]).powi(2)).sum::<f64>().sqrt();
        let steps = (length / 0.02).ceil().max(1.0);
        for i in 0..=steps as u32 {
            let t = f64::from(i) / steps;
            let at = [0, 1, 2].map(|k| pair[0][k] + t * (pair[1][k] - pair[0][k]));
            if at[2] + 20.0 < post.0[1][2] {
                least = least.min(post.distance([at[0], at[1]]) - 10.0);
            }
        }
    }
    least
}

#[test]
#[ignore = "slow: make test-all"]
fn random_boxes_are_kept_clear_of_or_refused_for_a_cause() {
    let dir = folder();
    // A head that is small beside the part, so that it passes between posts and lifts over them.
    let machine = machine_file("xyz-galvo-40").replacen("diameter = \"110 mm\"", "diameter = \"20 mm\"", 1).replacen(
        "working_distance = \"150 mm\"",
        "working_distance = \"30 mm\"",
        1,
    );
    std::fs::write(dir.path().join("machine.toml"), &machine).expect("writable");
    let with = |more: &str| {
        let mut job = job(dir.path(), more);
        // Between both squares a post may stand over which the head lifts.
        let square =
            |x: f64| format!("{}\narea = [\"{x} mm\", \"12 mm\", \"{} mm\", \"28 mm\"]", job.textures[0], x + 10.0);
        job.textures = vec![square(4.0), square(46.0)];
        job.partition = "section = \"10 mm\"".into();
        job.machine = "file = \"machine.toml\"".into();
        job
    };
    let bare = planned(&with("").write(dir.path(), "bare.toml"));
    let marks = points(&bare);
    let mut counts = [0; 4];
    for seed in seeds(0..240) {
        let mut random = Random::case(seed);
        let mut between = |lo: f64, hi: f64| ((lo + (hi - lo) * random.unit()) * 1e3).round() / 1e3;
        let (x, y) = (between(-8.0, 66.0), between(-8.0, 46.0));
        let (w, h, top) = (between(0.5, 6.0), between(0.5, 6.0), between(3.0, 60.0));
        let post = Post([[x, y, -1.0], [x + w, y + h, top]]);
        let file = with(&clamp(post.0, "")).write(dir.path(), "job.toml");
        let done = terrace([Path::new("check"), file.as_path()]);
        let text = said(&done);
        if done.status.success() {
            let plan = planned(&file);
            let near = nearest(&plan, &post);
            assert!(near > -1e-4, "seed {seed}: the head gets {near} mm into {:?}", post.0);
            let burnt = points(&plan).into_iter().find(|(at, plane)| !is_free(&post, *at, *plane, 2.0 - 1e-3));
            assert!(burnt.is_none(), "seed {seed}: {burnt:?} {:?}", post.0);
            let to = dir.path().join("out");
            compile(&file, &to);
            verify(&to);
            let lifts = plan.checked.program().blocks.iter().filter(|b| b.retract).count();
            counts[usize::from(lifts > 0)] += 1;
        } else if text.contains("fixture-beam") {
            // As cylinders are taken, no more than four times the radius.
            assert!(marks.iter().any(|(at, plane)| !is_free(&post, *at, *plane, 4.1)), "seed {seed}: {text}");
            counts[2] += 1;
        } else {
            assert!(text.contains("error[clearance]"), "seed {seed}: {text}");
            counts[3] += 1;
        }
    }
    assert!(counts.iter().all(|&count| count >= 5), "passed, lifted over, in the beam, in the way: {counts:?}");
}
