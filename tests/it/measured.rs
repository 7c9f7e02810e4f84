//! Parts that are marked where they lie: points in, marks where they were designed on the part.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use serde_json::Value;
use terrace_core::geom::SpacePoint;
use terrace_core::math;
use terrace_core::random::Random;

use crate::support::surfaces::{mesh, write_stl};
use crate::support::{JobText, compile, folder, manifest, number, said, terrace, verify};

/// Where a part lies: rotated about x, y and z, rad, in this order, then shifted, mm.
#[derive(Clone, Copy)]
struct Lies {
    turns: SpacePoint,
    shift: SpacePoint,
}

impl Lies {
    fn of(&self, p: SpacePoint) -> SpacePoint {
        let [mut x, mut y, mut z] = p;
        let (s, c) = math::sin_cos(self.turns[0]);
        (y, z) = (c * y - s * z, s * y + c * z);
        let (s, c) = math::sin_cos(self.turns[1]);
        (z, x) = (c * z - s * x, s * z + c * x);
        let (s, c) = math::sin_cos(self.turns[2]);
        (x, y) = (c * x - s * y, s * x + c * y);
        [x + self.shift[0], y + self.shift[1], z + self.shift[2]]
    }
}

const LIES: Lies = Lies { turns: [0.004, -0.003, 0.002], shift: [-40.123_456, -30.765_432, -3.25] };

fn form(x: f64, y: f64) -> f64 {
    3.0 * math::sin(x / 15.0) + 2.0 * math::cos(y / 11.0)
}

/// A normal deviate.
fn gauss(random: &mut Random) -> f64 {
    (-2.0 * math::ln(1.0 - random.unit())).sqrt() * math::cos(std::f64::consts::TAU * random.unit())
}

/// Axis positions of the built-in machine over a place of the table frame: its stage carries the part, its z the head.
fn stage([x, y, z]: SpacePoint) -> SpacePoint {
    [-x, -y, z]
}

/// The row of a feature.
fn optical(part: SpacePoint, lies: &Lies, sigma_um: f64) -> String {
    let [x, y, z] = stage(lies.of(part));
    let [px, py, pz] = part;
    format!("optical,{x:.9},{y:.9},{z:.9},{sigma_um},{px},{py},{pz}\n")
}

const HEAD: &str = "kind,stage_x,stage_y,stage_z,sigma_um,part_x,part_y,part_z\n";

const FEATURES: [SpacePoint; 5] =
    [[2.0, 3.0, 1.0], [77.0, 4.0, -2.0], [75.0, 58.0, 3.0], [4.0, 55.0, 0.5], [41.0, 28.0, 2.0]];

fn table(lies: &Lies) -> String {
    FEATURES.iter().fold(HEAD.to_owned(), |text, &part| text + &optical(part, lies, 5.0))
}

/// A part of 80 x 60 mm with waves, and a job on it whose points say that it lies so.
fn job(dir: &Path, table: &str, more: &str, texture: &str) -> PathBuf {
    write_stl(&dir.join("part.stl"), &mesh(40, [0.0, 0.0, 80.0, 60.0], form));
    std::fs::write(dir.join("m.csv"), table).expect("written");
    let path = JobText::on(&dir.join("part.stl")).texture(texture).write(dir, "job.toml");
    let text = std::fs::read_to_string(&path).expect("a job");
    let text = format!("{text}\n[placement]\n{more}\n[placement.measured]\nfile = \"m.csv\"\nsigmas = 0\n");
    std::fs::write(&path, text).expect("written");
    path
}

const HATCH: &str = "pattern = \"hatch\"\npitch = \"1 mm\"\ndirection = \"30 deg\"";

fn measured(folder: &Path) -> Value {
    manifest(folder)["placement"]["measured"].clone()
}

fn refused(job: &Path, code: &str) -> String {
    let out = terrace([Path::new("check"), job]);
    assert!(!out.status.success(), "{code}");
    let text = said(&out);
    assert!(text.contains(&format!("[{code}]")), "{code}: {text}");
    text
}

#[test]
fn exact_features_give_the_pose_and_marks_lie_where_they_were_designed() {
    let dir = folder();
    let job = job(dir.path(), &table(&LIES), "", HATCH);
    let out = dir.path().join("a.job");
    let summary = compile(&job, &out);
    let found = measured(&out);
    let rows: Vec<Vec<f64>> = serde_json::from_value(found["rows"].clone()).expect("rows");
    let origin: Vec<f64> = serde_json::from_value(manifest(&out)["placement"]["origin_mm"].clone()).expect("origin");
    let rest: Vec<f64> = serde_json::from_value(found["rest_nm"].clone()).expect("rest");
    for p in FEATURES {
        let wanted = LIES.of(p);
        for k in 0..3 {
            let lies = (0..3).map(|j| rows[k][j] * p[j]).sum::<f64>() + origin[k] + rest[k] / 1e6;
            assert!((lies - wanted[k]).abs() < 2e-9, "{p:?} {k}: {lies} {}", wanted[k]);
        }
    }
    let proof = verify(&out);
    assert_eq!(proof["ok"], true, "{proof}");
    // A hatch over all of the part: a leaning part shows a little less of its length.
    let (texture, marked) = (number(&summary, "texture_mm"), number(&summary, "mark_mm"));
    assert!(texture > 4780.0 && (texture - marked).abs() < 1.0, "{texture} {marked}");
    // The part upright is another job.
    let flat = dir.path().join("flat.toml");
    let text = std::fs::read_to_string(&job)
        .expect("a job")
        .replace("[placement.measured]\nfile = \"m.csv\"\nsigmas = 0\n", "");
    std::fs::write(&flat, text).expect("written");
    let upright = compile(&flat, &dir.path().join("flat.job"));
    assert!((number(&upright, "texture_mm") - texture).abs() > 1e-3);
}

#[test]
fn a_place_of_the_part_is_told_as_positions_of_the_axes() {
    let dir = folder();
    let path = job(dir.path(), &table(&LIES), "", HATCH);
    let part = [33.0, 17.0, form(33.0, 17.0)];
    let at = format!("{},{},{}", part[0], part[1], part[2]);
    let found = terrace(["register", path.to_str().expect("UTF-8"), "--at", &at, "--json"]);
    let found: Value = serde_json::from_slice(&found.stdout).expect("JSON");
    let told: SpacePoint = serde_json::from_value(found["at"]["stage_mm"].clone()).expect("a place");
    let wanted = stage(LIES.of(part));
    assert!((0..3).all(|k| (told[k] - wanted[k]).abs() < 1e-6), "{told:?} {wanted:?}");
    let text = said(&terrace(["register", path.to_str().expect("UTF-8"), "--at", &at]));
    assert!(text.contains(&format!("stage_x {:.4}", wanted[0])), "{text}");
}

#[test]
fn a_part_that_lies_as_designed_is_marked_as_if_it_had_not_been_measured() {
    let dir = folder();
    let as_designed = Lies { turns: [0.0; 3], shift: [-40.0, -30.0, -2.0] };
    let measured_job = job(dir.path(), &table(&as_designed), "", HATCH);
    compile(&measured_job, &dir.path().join("a.job"));
    let text = std::fs::read_to_string(&measured_job).expect("a job");
    let stated = text.replace("[placement.measured]\nfile = \"m.csv\"\nsigmas = 0\n", "");
    let stated = stated.replace("[placement]\n", "[placement]\norigin = [\"-40 mm\", \"-30 mm\", \"-2 mm\"]\n");
    let path = dir.path().join("stated.toml");
    std::fs::write(&path, stated).expect("written");
    compile(&path, &dir.path().join("b.job"));
    let stops = |name: &str| manifest(&dir.path().join(name))["summary"]["stops"].clone();
    let marks = |name: &str| number(&manifest(&dir.path().join(name))["summary"], "mark_mm");
    assert_eq!(stops("a.job"), stops("b.job"));
    assert!((marks("a.job") - marks("b.job")).abs() < 1e-3, "{} {}", marks("a.job"), marks("b.job"));
}

#[test]
#[ignore = "slow: make test-all"]
fn what_is_known_less_surely_leaves_less_depth_and_the_proof_asks_for_it() {
    let dir = folder();
    let rows: String = FEATURES.iter().map(|&p| optical(p, &LIES, 2.0)).collect();
    let table = HEAD.to_owned() + &rows;
    let stops = |sigmas: &str| {
        let job = job(dir.path(), &table, "", HATCH);
        let text = std::fs::read_to_string(&job).expect("a job");
        std::fs::write(&job, text.replace("sigmas = 0", &format!("sigmas = {sigmas}"))).expect("written");
        let folder = dir.path().join(format!("{sigmas}.job"));
        let summary = compile(&job, &folder);
        assert_eq!(verify(&folder)["ok"], true);
        (number(&summary, "stops"), folder)
    };
    let (none, folder) = stops("0");
    let (one, _) = stops("1");
    let (three, _) = stops("3");
    assert!(none < one && one < three, "{none} {one} {three}");
    // A program that keeps nothing free breaks the rule of depth alone, where the job asks for it.
    let path = dir.path().join("job.toml");
    let manifest = folder.join("manifest.json");
    let mut json: Value = serde_json::from_slice(&std::fs::read(&manifest).expect("read")).expect("JSON");
    let hash = blake3_of(&path);
    json["job"]["blake3"] = hash.into();
    std::fs::write(&manifest, serde_json::to_string_pretty(&json).expect("JSON")).expect("written");
    let said = terrace([Path::new("verify"), &folder, Path::new("--json")]);
    let proof: Value = serde_json::from_slice(&said.stdout).expect("JSON");
    let rules = proof["rules"].as_array().expect("rules").clone();
    let broken: Vec<&str> = rules.iter().filter(|r| r["violated"] != 0).filter_map(|r| r["code"].as_str()).collect();
    assert_eq!(broken, ["depth"], "{proof}");
}

/// The hash of a file as a manifest has it.
fn blake3_of(path: &Path) -> String {
    let bytes = std::fs::read(path).expect("read");
    blake3::hash(&bytes).to_hex().to_string()
}

#[test]
fn a_wrong_feature_exchanged_ones_a_mirror_and_a_line_are_named() {
    let dir = folder();
    let of = |rows: &[String]| rows.iter().fold(HEAD.to_owned(), |text, row| text + row);
    let rows: Vec<String> = FEATURES.iter().map(|&p| optical(p, &LIES, 5.0)).collect();
    let mut wrong = rows.clone();
    wrong[3] = optical([4.0, 55.6, 0.5], &LIES, 5.0).replace("55.6", "55");
    let text = refused(&job(dir.path(), &of(&wrong), "", HATCH), "measured-apart");
    assert!(text.contains("m.csv:5") && text.contains("does not go with the other points"), "{text}");
    let mut exchanged = rows.clone();
    let tail = |row: &str| row.split(',').skip(5).collect::<Vec<_>>().join(",");
    let front = |row: &str| row.split(',').take(5).collect::<Vec<_>>().join(",");
    exchanged[1] = format!("{},{}", front(&rows[2]), tail(&rows[1]));
    exchanged[2] = format!("{},{}", front(&rows[1]), tail(&rows[2]));
    let text = refused(&job(dir.path(), &of(&exchanged), "", HATCH), "measured-apart");
    assert!(text.contains("are exchanged"), "{text}");
    let mirrored: Vec<String> = FEATURES
        .iter()
        .map(|&[x, y, z]| {
            let [a, b, c] = stage(LIES.of([x, y, z]));
            format!("optical,{:.6},{b:.6},{c:.6},5,{x},{y},{z}\n", -a)
        })
        .collect();
    let text = refused(&job(dir.path(), &of(&mirrored), "", HATCH), "measured-apart");
    assert!(text.contains("mirror"), "{text}");
    let on_line: Vec<String> = (0..4).map(|k| optical([20.0 * f64::from(k), 10.0, 1.0], &LIES, 5.0)).collect();
    let text = refused(&job(dir.path(), &of(&on_line), "", HATCH), "measured-free");
    assert!(text.contains("a turn about x"), "{text}");
}

/// Where the stage stands when a tip touches 200 facets of the part that lies so, with 2 um of noise; one touch in forty
/// stands on a clamp.
fn touches(lies: &Lies, radius: f64) -> Vec<SpacePoint> {
    let mut random = Random::case(5);
    let facets = mesh(40, [0.0, 0.0, 80.0, 60.0], form);
    let mut touch = |k: usize| {
        let [a, b, c] = facets[random.below(facets.len())];
        let minus = |p: SpacePoint, q: SpacePoint| [0, 1, 2].map(|k| p[k] - q[k]);
        let (u, v) = (minus(b, a), minus(c, a));
        let n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
        let size = n.iter().map(|v| v * v).sum::<f64>().sqrt() * n[2].signum();
        // Well inside of the facet.
        let shares = [0; 3].map(|_| random.range(1.0, 2.0));
        let all: f64 = shares.iter().sum();
        let clamp = if k.is_multiple_of(40) { 4.0 } else { 0.0 };
        let off = radius + 0.002 * gauss(&mut random) + clamp;
        let on = |m: usize| (a[m] * shares[0] + b[m] * shares[1] + c[m] * shares[2]) / all;
        stage(lies.of([0, 1, 2].map(|m| on(m) + n[m] / size * off)))
    };
    (0..200).map(&mut touch).collect()
}

/// A job of the touches of a tip, each changed.
fn touched_job(dir: &Path, more: &str, change: impl Fn(usize, SpacePoint) -> SpacePoint) -> PathBuf {
    let all = touches(&LIES, 1.0).into_iter().enumerate();
    // None stands on a clamp.
    let free = all.filter(|(k, _)| !k.is_multiple_of(40));
    let rows = free.map(|(k, at)| {
        let [x, y, z] = change(k, at);
        format!("touch,{x:.6},{y:.6},{z:.6},3,1,,,\n")
    });
    let table =
        rows.fold("kind,stage_x,stage_y,stage_z,sigma_um,tip_mm,part_x,part_y,part_z\n".to_owned(), |a, b| a + &b);
    job(dir, &table, more, HATCH)
}

const START: &str = "origin = [\"-40 mm\", \"-30 mm\", \"-3 mm\"]";

#[test]
fn touches_that_do_not_lie_on_the_part_are_named_and_neighbours_that_do_not_are_refused() {
    let dir = folder();
    let lift = |by: f64| move |[x, y, z]: SpacePoint| [x, y, z + by];
    let path = touched_job(dir.path(), START, |k, at| if k == 7 { lift(0.5)(at) } else { at });
    let out = terrace([Path::new("check"), &path]);
    assert!(out.status.success(), "{}", said(&out));
    assert!(
        said(&out).contains("[measured-left-out]") && said(&out).contains("does not lie on the part"),
        "{}",
        said(&out)
    );
    // A corner that is another than the drawing's.
    let corner = |at: SpacePoint| {
        let [x, y, _] = stage(at);
        x > LIES.shift[0] + 62.0 && y > LIES.shift[1] + 44.0
    };
    let path = touched_job(dir.path(), START, |_, at| if corner(at) { lift(0.3)(at) } else { at });
    assert!(refused(&path, "measured-off").contains("lie off it together"));
    // Where it may be warped by less, too.
    let text = std::fs::read_to_string(&path).expect("a job").replace("sigmas = 0", "warp = \"0.2 mm\"");
    std::fs::write(&path, text).expect("written");
    assert!(refused(&path, "measured-off").contains("lie off it together"));
    // The same place twice, the second time without the dirt.
    let path = touched_job(dir.path(), START, |_, at| at);
    let table = std::fs::read_to_string(dir.path().join("m.csv")).expect("a table");
    let row: Vec<&str> = table.lines().nth(5).expect("a row").split(',').collect();
    let higher = format!("touch,{},{},{},3,1,,,\n", row[1], row[2], row[3].parse::<f64>().expect("a number") + 0.4);
    std::fs::write(dir.path().join("m.csv"), format!("{table}{higher}")).expect("written");
    refused(&path, "measured-twice");
}

#[test]
fn a_part_that_is_found_far_from_where_it_was_placed_is_refused_or_told() {
    let dir = folder();
    let path = touched_job(dir.path(), &START.replace("-40 mm", "-28.5 mm"), |_, at| at);
    assert!(refused(&path, "measured-far").contains("-11.6"), "{}", refused(&path, "measured-far"));
    let turned = Lies { turns: [0.0, 0.0, 0.3], ..LIES };
    let out = terrace([Path::new("check"), &job(dir.path(), &table(&turned), "", HATCH)]);
    assert!(out.status.success() && said(&out).contains("[measured-turned]"), "{}", said(&out));
}

/// What `check` says of features whose heights are known so closely, over touches that are all 0.4 mm too high.
fn said_of_high_touches(measured: &str, sigma_z_um: f64) -> String {
    let dir = folder();
    let path = touched_job(dir.path(), START, |_, [x, y, z]| [x, y, z + 0.4]);
    // The table of the measurement is the last one.
    std::fs::write(&path, std::fs::read_to_string(&path).expect("a job") + measured).expect("written");
    let file = dir.path().join("m.csv");
    let rows = FEATURES.map(|[px, py, _]| {
        let part = [px, py, form(px, py)];
        let [x, y, z] = stage(LIES.of(part));
        format!("optical,{x:.6},{y:.6},{z:.6},5,,{px},{py},{},{sigma_z_um}\n", part[2])
    });
    let touched = std::fs::read_to_string(&file).expect("a table");
    let touched = touched
        .lines()
        .enumerate()
        .map(|(i, line)| if i == 0 { format!("{line},sigma_z_um\n") } else { format!("{line},\n") });
    std::fs::write(&file, touched.collect::<String>() + &rows.concat()).expect("written");
    said(&terrace([Path::new("check"), &path]))
}

#[test]
fn features_that_all_lie_above_or_below_the_touches_are_told() {
    let close = said_of_high_touches("", 100.0);
    assert!(close.contains("[measured-heights]"), "{close}");
    let loose = said_of_high_touches("", 1000.0);
    assert!(!loose.contains("[measured-heights]"), "{loose}");
}

#[test]
#[ignore = "slow: make test-all"]
fn a_warp_does_not_take_up_what_all_touches_are_off_by() {
    let warp = "warp = \"0.9 mm\"\n";
    let close = said_of_high_touches(warp, 20.0);
    assert!(close.contains("[measured-heights]"), "{close}");
    let loose = said_of_high_touches(warp, 1000.0);
    assert!(!loose.contains("[measured-heights]"), "{loose}");
}

#[test]
fn the_log_of_linuxcnc_becomes_a_verified_job_in_three_commands() {
    assert_log_becomes_a_job(false);
}

#[test]
#[ignore = "slow: make test-all"]
fn the_log_of_grbl_becomes_a_verified_job_in_three_commands() {
    assert_log_becomes_a_job(true);
}

fn assert_log_becomes_a_job(is_grbl: bool) {
    let radius = 1.0;
    let lies = Lies { turns: [0.01, -0.008, 0.02], shift: [-41.0, -29.0, -3.0] };
    let dir = folder();
    let more = "origin = [\"-40 mm\", \"-30 mm\", \"-2 mm\"]";
    let job = job(dir.path(), "", more, "pattern = \"squares\"\npitch = \"4 mm\"\ncell = \"2 mm\"");
    std::fs::remove_file(dir.path().join("m.csv")).expect("no table yet");
    // GRBL counts touches from the zero of the machine, where that of G54 lies too here.
    let mut log = if is_grbl { "[G54:0.000,0.000,0.000]\n".to_owned() } else { String::new() };
    for [x, y, z] in touches(&lies, radius) {
        let _ = if is_grbl {
            writeln!(log, "[PRB:{x:.6},{y:.6},{z:.6}:1]\nok")
        } else {
            writeln!(log, "{x:.6} {y:.6} {z:.6} 0 0 0 0 0 0")
        };
    }
    let file = dir.path().join("probe.log");
    std::fs::write(&file, log).expect("written");
    let [job, file] = [&job, &file].map(|p| p.to_str().expect("text"));
    let out = terrace(["register", job, file, "--radius", "1 mm", "--noise", "3 um"]);
    assert!(out.status.success(), "{}", said(&out));
    assert!(said(&out).contains("of which 195 lie on the part"), "{}", said(&out));
    let again = terrace(["register", job, file, "--radius", "1 mm", "--noise", "3 um"]);
    assert!(said(&again).contains("[register-exists]"), "{}", said(&again));
    let folder = dir.path().join("a.job");
    compile(Path::new(job), &folder);
    let proof = verify(&folder);
    assert_eq!(proof["ok"], true, "{proof}");
    let out = terrace(["register", job, "--json"]);
    let json: Value = serde_json::from_slice(&out.stdout).expect("JSON");
    let origin: Vec<f64> = serde_json::from_value(json["origin_mm"].clone()).expect("a pose");
    let wanted = lies.of([0.0; 3]);
    let off = (0..3).map(|k| (origin[k] - wanted[k]).abs()).fold(0.0, f64::max);
    assert!(off < 0.01, "{origin:?} {wanted:?}");
}

#[test]
fn damage_to_the_pose_breaks_one_rule() {
    let dir = folder();
    let job = job(dir.path(), &table(&LIES), "", HATCH);
    let out = dir.path().join("a.job");
    compile(&job, &out);
    let path = out.join("manifest.json");
    let text = std::fs::read_to_string(&path).expect("a manifest");
    let broken = |change: &dyn Fn(&mut Value)| {
        let mut json: Value = serde_json::from_str(&text).expect("JSON");
        change(&mut json["placement"]["measured"]);
        std::fs::write(&path, serde_json::to_string_pretty(&json).expect("JSON")).expect("written");
        let said = terrace([Path::new("verify"), &out, Path::new("--json")]);
        let proof: Value = serde_json::from_slice(&said.stdout).expect("JSON");
        let rules = proof["rules"].as_array().expect("rules").clone();
        let broken = rules.iter().filter(|r| r["violated"] != 0).map(|r| r["code"].as_str().expect("text").to_owned());
        broken.collect::<Vec<_>>()
    };
    assert_eq!(broken(&|_| ()), Vec::<String>::new());
    assert!(broken(&|m| m["points"] = 6.into()).contains(&"measured".to_owned()));
    assert!(
        broken(&|m| m["rest_nm"][2] = (m["rest_nm"][2].as_f64().expect("nm") + 20.0).into())
            .contains(&"measured".to_owned())
    );
}

/// By how much a part is warped at a place of the table frame, mm.
fn warp([x, y]: [f64; 2]) -> f64 {
    0.12 * math::sin(x / 22.0) * math::cos(y / 26.0)
}

/// Features, and a sensor's points in a net over the part, warped by so many times [`warp`].
fn warped_table(times: f64) -> String {
    let mut random = Random::case(9);
    let mut text = HEAD.to_owned();
    for part in FEATURES {
        let [x, y, z] = LIES.of(part);
        let [sx, sy, sz] = stage([x, y, z + times * warp([x, y])]);
        let [px, py, pz] = part;
        let _ = writeln!(text, "optical,{sx:.6},{sy:.6},{sz:.6},5,{px},{py},{pz}");
    }
    // Corners of facets: between them the part lies below its waves.
    let columns = [1, 6, 11, 15, 20, 25, 29, 34, 39].map(|i| 2.0 * f64::from(i));
    let rows = [1, 7, 13, 20, 27, 33, 39].map(|k| 1.5 * f64::from(k));
    for (x, y) in columns.into_iter().flat_map(|x| rows.map(|y| (x, y))) {
        let [x, y, z] = LIES.of([x, y, form(x, y)]);
        let [sx, sy, sz] = stage([x, y, z + times * warp([x, y]) + 0.002 * gauss(&mut random)]);
        let _ = writeln!(text, "distance,{sx:.6},{sy:.6},{sz:.6},2,,,");
    }
    text
}

/// A job on a part that its points show to be warped.
fn warped_job(dir: &Path, times: f64) -> PathBuf {
    let more = "origin = [\"-40 mm\", \"-30 mm\", \"-3 mm\"]";
    let path = job(dir, &warped_table(times), more, HATCH);
    let text = std::fs::read_to_string(&path).expect("a job").replace("sigmas = 0", "warp = \"0.4 mm\"");
    std::fs::write(&path, text.replace("pdof = \"0.07 mm\"", "pdof = \"0.1 mm\"")).expect("written");
    path
}

#[test]
#[ignore = "slow: make test-all"]
fn a_warped_part_is_marked_in_focus_where_its_points_show_it() {
    let dir = folder();
    let job = warped_job(dir.path(), 1.0);
    let folder = dir.path().join("a.job");
    compile(&job, &folder);
    assert_eq!(verify(&folder)["ok"], true);
    let stated = manifest(&folder);
    let pdof = number(&stated["focus"], "pdof_mm") * 1e6;
    let heights = &stated["placement"]["measured"]["warp"]["height_um"];
    assert!(heights[0].as_f64() < Some(-50.0) && heights[1].as_f64() > Some(50.0), "{heights}");
    // The true part at the ends of every mark.
    let program = std::fs::read_to_string(folder.join("program.txt")).expect("a program");
    let facets = mesh(40, [0.0, 0.0, 80.0, 60.0], form);
    let lying: Vec<[SpacePoint; 3]> = facets.into_iter().map(|facet| facet.map(|p| LIES.of(p))).collect();
    let (mut origin, mut stop, mut inside, mut all) = ([0.0; 3], [0.0; 3], 0, 0);
    for line in program.lines() {
        let words: Vec<&str> = line.split(' ').collect();
        let numbers = |of: &[&str]| of.iter().map(|word| word.parse::<f64>().expect("a number")).collect::<Vec<_>>();
        match words[0] {
            "origin" => origin = numbers(&words[1..4]).try_into().expect("three"),
            "block" => stop = numbers(&words[7..10]).try_into().expect("three"),
            _ if words.len() > 5 && matches!(words[3], "+" | "-") => {
                for end in numbers(&words[4..]).chunks(2) {
                    let at = [0, 1].map(|k| (stop[k] + end[k] + origin[k]) / 1e6);
                    // At a rim the pose may be some um beside the part.
                    let Some(height) = true_height(&lying, at) else { continue };
                    let height = height * 1e6 - origin[2];
                    all += 1;
                    inside += usize::from((height - stop[2]).abs() <= pdof / 2.0);
                }
            }
            _ => {}
        }
    }
    assert!(all > 300 && inside * 1000 >= all * 995, "{inside} of {all}");
    assert!(std::fs::read_to_string(folder.join("measured.svg")).expect("a map").contains("Correction of the height"));
    let shown = measured_in_view(&folder);
    let points = shown["points"].as_array().expect("points");
    let left = |key: &str| points.iter().filter_map(|p| p[key].as_f64()).fold(0.0, |most: f64, v| most.max(v.abs()));
    let [before, after] = ["before_um", "after_um"].map(left);
    assert!(shown["is_warped"] == true && shown["most_um"].as_f64() >= Some(before), "{shown}");
    assert!(points.len() > 20 && before > 20.0 && after < before / 2.0, "{before} {after}");
}

#[test]
#[ignore = "slow: make test-all"]
fn every_method_holds_a_warped_part_of_which_places_are_known_unlike_closely() {
    let dir = folder();
    let path = warped_job(dir.path(), 1.0);
    let text = std::fs::read_to_string(&path).expect("a job");
    // Fewer points on one half: what stays free is not the same everywhere.
    let table = std::fs::read_to_string(dir.path().join("m.csv")).expect("a table");
    let is_there = |(i, line): &(usize, &str)| {
        let x = line.split(',').nth(1).and_then(|x| x.parse::<f64>().ok());
        !line.starts_with("distance") || x > Some(0.0) || i % 2 == 0
    };
    let fewer: Vec<&str> = table.lines().enumerate().filter(is_there).map(|(_, line)| line).collect();
    std::fs::write(dir.path().join("m.csv"), fewer.join("\n") + "\n").expect("written");
    for (method, direction, pdof) in
        ["window", "z-range", "contour"].into_iter().flat_map(|m| [(m, 0, "0.1"), (m, 30, "0.11"), (m, 75, "0.13")])
    {
        let text = text
            .replace("30 deg", &format!("{direction} deg"))
            .replace("pdof = \"0.1 mm\"", &format!("pdof = \"{pdof} mm\""));
        let with = text.replace("method = \"contour\"", &format!("method = \"{method}\""));
        assert!(with.contains(&format!("method = \"{method}\"")), "{with}");
        std::fs::write(&path, with).expect("written");
        let target = dir.path().join("a.job");
        compile(&path, &target);
        let proof = verify(&target);
        assert_eq!(proof["ok"], true, "{method} {direction} {pdof}: {proof}");
    }
}

/// What the head of the view says of the measured part.
fn measured_in_view(folder: &Path) -> Value {
    let page = std::fs::read_to_string(folder.join("view.html")).expect("a page");
    let head = page.split("<script id=\"head\" type=\"application/json\">").nth(1).expect("a head");
    let head: Value = serde_json::from_str(head.split("</script>").next().expect("its end")).expect("JSON");
    assert!(page.contains("data-measured"));
    head["measured"].clone()
}

/// The height of the warped part over a place of the table frame, mm; None beside it.
fn true_height(lying: &[[SpacePoint; 3]], at: [f64; 2]) -> Option<f64> {
    let found = lying.iter().find_map(|&[a, b, c]| {
        let area =
            |p: SpacePoint, q: SpacePoint, r: SpacePoint| (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0]);
        let p = [at[0], at[1], 0.0];
        let shares = [area(p, b, c), area(a, p, c), area(a, b, p)].map(|share| share / area(a, b, c));
        let height = shares[0] * a[2] + shares[1] * b[2] + shares[2] * c[2];
        shares.iter().all(|share| *share >= -1e-6).then_some(height)
    });
    Some(found? + warp(at))
}

#[test]
#[ignore = "slow: make test-all"]
fn a_correction_applied_twice_or_upside_down_breaks_the_depth() {
    let dir = folder();
    let right = dir.path().join("right.job");
    compile(&warped_job(dir.path(), 1.0), &right);
    let table = std::fs::read_to_string(dir.path().join("m.csv")).expect("a table");
    let right = manifest(&right);
    for times in [2.0, -1.0, 0.0] {
        let folder = dir.path().join(format!("{times}.job"));
        compile(&warped_job(dir.path(), times), &folder);
        // The table and what the manifest says of it are those of the right correction; the program is not.
        std::fs::write(dir.path().join("m.csv"), &table).expect("written");
        let mut stated = manifest(&folder);
        stated["placement"] = right["placement"].clone();
        stated["inputs"] = right["inputs"].clone();
        std::fs::write(folder.join("manifest.json"), serde_json::to_string_pretty(&stated).expect("JSON"))
            .expect("written");
        let said = terrace([Path::new("verify"), &folder, Path::new("--json")]);
        let proof: Value = serde_json::from_slice(&said.stdout).expect("JSON");
        let rules = proof["rules"].as_array().expect("rules").clone();
        let broken: Vec<&str> =
            rules.iter().filter(|r| r["violated"] != 0).filter_map(|r| r["code"].as_str()).collect();
        assert!(broken.contains(&"depth"), "{times}: {broken:?} {proof}");
        println!("{times}: {broken:?}");
    }
}

#[test]
#[ignore = "slow: make test-all"]
fn damage_to_the_warp_breaks_its_rule() {
    let dir = folder();
    let out = dir.path().join("a.job");
    compile(&warped_job(dir.path(), 1.0), &out);
    let path = out.join("manifest.json");
    let text = std::fs::read_to_string(&path).expect("a manifest");
    let change = |key: &str, to: Value| {
        let mut json: Value = serde_json::from_str(&text).expect("JSON");
        json["placement"]["measured"]["warp"][key] = to;
        std::fs::write(&path, serde_json::to_string_pretty(&json).expect("JSON")).expect("written");
        let said = terrace([Path::new("verify"), &out, Path::new("--json")]);
        let proof: Value = serde_json::from_slice(&said.stdout).expect("JSON");
        let rule = proof["rules"].as_array().expect("rules").iter().find(|r| r["code"] == "measured").cloned();
        assert!(rule.expect("a rule")["violated"] != 0, "{key}: {proof}");
        proof.to_string()
    };
    let warp: Value = serde_json::from_str::<Value>(&text).expect("JSON")["placement"]["measured"]["warp"].clone();
    let scaled = |key: &str, by: f64| {
        Value::from(
            warp[key]
                .as_array()
                .expect("numbers")
                .iter()
                .map(|v| v.as_f64().expect("a number") * by)
                .collect::<Vec<_>>(),
        )
    };
    change("factor", (warp["factor"].as_f64().expect("a number") * 1.1).into());
    change("amplitudes_um", scaled("amplitudes_um", 2f64.sqrt()));
    // The next smaller one of any length is contradicted by no point, but it is not the largest.
    let amplitudes: Vec<f64> = serde_json::from_value(warp["amplitudes_um"].clone()).expect("numbers");
    for i in 0..amplitudes.len() {
        let mut smaller = amplitudes.clone();
        smaller[i] *= 0.5f64.sqrt();
        let said = change("amplitudes_um", smaller.into());
        assert!(said.contains("is not the largest that the points do not contradict"), "{i}: {said}");
    }
    change("lengths_mm", scaled("lengths_mm", 1.01));
    change("height_um", scaled("height_um", -1.0));
    change("points", 5.into());
    change("grid_pitch_nm", (20 * warp["grid_pitch_nm"].as_i64().expect("a number")).into());
}

#[test]
fn what_does_not_go_with_a_measured_part_is_refused() {
    let dir = folder();
    let contour = HATCH.replace("30 deg", "contour");
    refused(&job(dir.path(), &table(&LIES), "", &contour), "measured-contour");
    let path = job(dir.path(), &table(&LIES), "", HATCH);
    let text = std::fs::read_to_string(&path).expect("a job");
    std::fs::write(&path, format!("mode = \"on-the-fly\"\n{text}")).expect("written");
    refused(&path, "fly-job");
    let touch = "kind,stage_x,stage_y,stage_z,sigma_um,tip_mm\ntouch,1,2,3,5,1\n";
    refused(&job(dir.path(), touch, "", HATCH), "measured-start");
    refused(&job(dir.path(), touch, "origin = [\"0 mm\", \"0 mm\", \"0 mm\"]", HATCH), "measured-free");
    refused(&job(dir.path(), "kind\n", "", HATCH), "measured-table");
}

#[test]
fn what_is_not_known_closely_enough_is_refused_or_marked_with_a_warning_as_the_job_says() {
    let dir = folder();
    // Features in one corner say little of the other one.
    let near: Vec<SpacePoint> = FEATURES.iter().map(|p| p.map(|v| v / 8.0)).collect();
    let table = near.iter().fold(HEAD.to_owned(), |text, &part| text + &optical(part, &LIES, 2.0));
    let path = job(dir.path(), &table, "", HATCH);
    let text = std::fs::read_to_string(&path).expect("a job").replace("sigmas = 0\n", "");
    std::fs::write(&path, &text).expect("written");
    assert!(refused(&path, "measured-unsure").contains("unsure = \"warn\""));
    std::fs::write(&path, text + "unsure = \"warn\"\n").expect("written");
    let target = dir.path().join("a.job");
    let out = terrace([Path::new("compile"), &path, Path::new("-o"), &target]);
    let said = said(&out);
    assert!(out.status.success() && said.contains("warning[measured-unsure]"), "{said}");
    let share: f64 =
        said.split("on ").nth(1).and_then(|t| t.split(' ').next()).and_then(|t| t.parse().ok()).expect("%");
    assert!(share > 20.0 && share < 100.0, "{said}");
    let proof = verify(&target);
    assert_eq!(proof["ok"], true, "{proof}");
    let not_proved = proof["not_proved"].as_array().expect("a list");
    assert!(not_proved.iter().any(|n| n["what"].as_str().is_some_and(|t| t.contains("a quarter of the depth range"))));
    // Near the features nothing is left out of what is kept: a job that is sure of its height needs fewer stops there.
    let map = std::fs::read_to_string(target.join("measured.svg")).expect("a picture");
    assert!(map.contains("red: less than that"));
    let shown = measured_in_view(&target);
    assert!(
        shown["is_warped"] == false && shown["points"].as_array().is_some_and(|p| p.len() == near.len()),
        "{shown}"
    );
}
