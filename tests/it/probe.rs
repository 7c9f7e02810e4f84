//! Where to measure a part: the points, the program of a touch probe on interpreters and simulators of controllers with a
//! part under it that terrace has never seen, and what its log says of where that part lies.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use serde_json::Value;
use terrace_core::geom::SpacePoint;
use terrace_core::machine::{Machine, Origin};
use terrace_core::math;
use terrace_input::job::{Job, Overrides};
use terrace_verify::ProbeProof;

use crate::offsets::{run_interpreter, send};
use crate::run_grbl::Simulator;
use crate::run_linuxcnc::Simulation;
use crate::support::surfaces::{mesh, write_stl};
use crate::support::{JobText, compile, folder, said, terrace, verify};

/// Radius and pretravel of the tip, mm, and where its centre lies from the focus.
const RADIUS: f64 = 2.0;
const PRETRAVEL: f64 = 0.004;
const OFFSET: SpacePoint = [60.0, -12.5, 4.25];

/// Where the job says that the part lies, and where it does.
const ORIGIN: SpacePoint = [-40.0, -30.0, -5.0];
const SHIFT: SpacePoint = [-39.3, -30.45, -4.2];
const TURN: f64 = 0.005;
const LEAN: f64 = 0.004;

/// Waves whose slopes reach 30 degrees.
fn form(x: f64, y: f64) -> f64 {
    6.0 * math::sin(x / 15.0) + 4.0 * math::cos(y / 11.0) + 0.001 * x * y
}

/// A point of the part on the table.
fn lies([x, y, z]: SpacePoint) -> SpacePoint {
    let (s, c) = math::sin_cos(LEAN);
    let [x, z] = [c * x + s * z, c * z - s * x];
    let (s, c) = math::sin_cos(TURN);
    [c * x - s * y + SHIFT[0], s * x + c * y + SHIFT[1], z + SHIFT[2]]
}

/// A part that terrace has never seen, warped by so much, mm.
#[derive(Clone, Copy)]
struct TruePart {
    warp: f64,
}

impl TruePart {
    /// Its height on the table over a place of it.
    fn height(self, [x, y]: [f64; 2]) -> f64 {
        let (mut u, mut v) = (x - SHIFT[0], y - SHIFT[1]);
        for _ in 0..30 {
            let [px, py, _] = lies([u, v, form(u, v)]);
            (u, v) = (u + x - px, v + y - py);
        }
        // A dent and a twist.
        let away = math::hypot(x - 12.0, y + 6.0) / 16.0;
        lies([u, v, form(u, v)])[2] + self.warp * (math::exp(-away * away) - x * y / 2000.0)
    }

    /// Where the centre of the tip stands that comes down over a place of the table and touches.
    fn tip_over(self, [x, y]: [f64; 2]) -> f64 {
        let over = |dx: f64, dy: f64| {
            let within = (RADIUS * RADIUS - dx * dx - dy * dy).max(0.0);
            self.height([x + dx, y + dy]) + within.sqrt()
        };
        let (mut at, mut step, mut best) = ([0.0; 2], 1.0, over(0.0, 0.0));
        while step > 1e-6 {
            let around = [[step, 0.0], [-step, 0.0], [0.0, step], [0.0, -step]];
            let found = around
                .map(|d| [at[0] + d[0], at[1] + d[1]])
                .into_iter()
                .filter(|p| math::hypot(p[0], p[1]) < RADIUS)
                .map(|p| (over(p[0], p[1]), p))
                .max_by(|a, b| a.0.total_cmp(&b.0));
            match found {
                Some((z, p)) if z > best => (best, at) = (z, p),
                _ => step /= 2.0,
            }
        }
        best
    }

    /// z of the axes at which the control knows of a touch, the axes standing at x and y.
    fn trip(self, [x, y]: [f64; 2]) -> f64 {
        self.tip_over([SIGNS[0] * x + OFFSET[0], SIGNS[1] * y + OFFSET[1]]) - OFFSET[2] - PRETRAVEL
    }

    /// Rows of x, y and z at which the probe trips, by the points of a folder.
    fn trips(self, found: &Value) -> Vec<SpacePoint> {
        let points = found["points"].as_array().expect("points").iter();
        let of = |point: &Value| {
            let [x, y, _]: [f64; 3] = serde_json::from_value(point["stage_mm"].clone()).expect("mm");
            [x, y, self.trip([x, y])]
        };
        points.map(of).collect()
    }
}

/// As it was designed.
const RIGID: TruePart = TruePart { warp: 0.0 };

/// The signs of the built-in machine: its stage carries the part, its z the head.
const SIGNS: SpacePoint = [-1.0, -1.0, 1.0];

/// A job on the part, with a machine that has a probe.
fn job(dir: &Path, dialect: &str, more: &str, cells: usize) -> PathBuf {
    write_stl(&dir.join("part.stl"), &mesh(cells, [0.0, 0.0, 80.0, 60.0], form));
    let made = terrace([Path::new("machines"), Path::new("xyz-galvo-40"), Path::new("-o"), &dir.join("m.toml")]);
    assert!(made.status.success(), "{}", said(&made));
    let machine = std::fs::read_to_string(dir.join("m.toml")).expect("a machine");
    let [x, y, z] = OFFSET;
    let probe = format!(
        "\n[probe]\nradius = \"{RADIUS} mm\"\nnoise = \"1 um\"\npretravel = \"{PRETRAVEL} mm\"\n\
         offset = [\"{x} mm\", \"{y} mm\", \"{z} mm\"]\nstylus = \"50 mm\"\nbody = \"24 mm\"\nfeed = \"2 mm/s\"\n"
    );
    let machine = machine.replace("[controller]", &format!("[controller]\ndialect = \"{dialect}\""));
    let machine = if machine.contains("dialect =") {
        machine
    } else {
        format!("{machine}\n[controller]\ndialect = \"{dialect}\"\n")
    };
    std::fs::write(dir.join("m.toml"), machine + &probe).expect("written");
    let path =
        JobText::on(&dir.join("part.stl")).texture("pattern = \"hatch\"\npitch = \"2 mm\"").write(dir, "job.toml");
    let text = std::fs::read_to_string(&path).expect("a job");
    let text = text.replace("profile = \"xyz-galvo-40\"", "file = \"m.toml\"");
    let [x, y, z] = ORIGIN;
    let text = format!(
        "{text}\n[placement]\norigin = [\"{x} mm\", \"{y} mm\", \"{z} mm\"]\n[placement.measured]\nfile = \"points.csv\"\n{more}"
    );
    std::fs::write(&path, text).expect("written");
    path
}

/// Chooses points; answers with what is said of them.
fn chosen(job: &Path, options: &[&str]) -> Value {
    let mut words = vec!["probe", job.to_str().expect("UTF-8"), "--json"];
    words.extend(options);
    let out = terrace(words);
    assert!(out.status.success(), "{}", said(&out));
    serde_json::from_slice(&out.stdout).expect("JSON")
}

fn table(rows: &[SpacePoint]) -> String {
    rows.iter().fold(String::new(), |mut text, [x, y, z]| {
        let _ = writeln!(text, "{x:.6} {y:.6} {z:.6}");
        text
    })
}

/// The log that LinuxCNC writes.
fn log_of(rows: &[SpacePoint]) -> String {
    rows.iter().fold(String::new(), |mut text, [x, y, z]| {
        let _ = writeln!(text, "{x:.6} {y:.6} {z:.6} 0.0 0.0 0.0 0.0 0.0 0.0");
        text
    })
}

/// Registers the log, compiles and verifies; the part is found where it lies, to this much, mm.
fn registers(dir: &Path, job: &Path, log: &Path, tolerance: f64) {
    let out = terrace([Path::new("register"), job, log, Path::new("--json")]);
    assert!(out.status.success(), "{}", said(&out));
    let found: Value = serde_json::from_slice(&out.stdout).expect("JSON");
    let rows: [[f64; 3]; 3] = serde_json::from_value(found["rows"].clone()).expect("rows");
    let origin: SpacePoint = serde_json::from_value(found["origin_mm"].clone()).expect("mm");
    for p in [[5.0, 5.0], [75.0, 6.0], [74.0, 55.0], [6.0, 54.0], [40.0, 30.0]] {
        let p = [p[0], p[1], form(p[0], p[1])];
        let [x, y, z] = [0, 1, 2].map(|k| (0..3).map(|m| rows[k][m] * p[m]).sum::<f64>() + origin[k]);
        // What counts is how far it is off along the normal: the surface as found against the surface as it lies.
        let off = z - RIGID.height([x, y]);
        assert!(off.abs() < tolerance, "{p:?}: {off} mm");
    }
    let target = dir.join("job.job");
    compile(job, &target);
    assert_eq!(verify(&target)["ok"], true);
}

/// What the interpreter of LinuxCNC makes of a program: places of touches, and how often it moves.
fn interpreted(program: &Path) -> (Vec<SpacePoint>, usize) {
    let text = std::fs::read_to_string(program).expect("a program");
    // The interpreter alone has no file to log to.
    let text = text.replace("(PROBEOPEN probe.log)\n", "").replace("(PROBECLOSE)\n", "");
    let out = (0..20).map(|_| run_interpreter("", &text)).find(|out| out.status.code().is_some()).expect("it ends");
    assert!(out.status.success(), "{}", said(&out));
    let text = String::from_utf8_lossy(&out.stdout).into_owned();
    let touch = |line: &str| {
        let numbers = line.split_once("STRAIGHT_PROBE(")?.1.split(',').map(|v| v.trim().parse::<f64>());
        let numbers: Vec<f64> = numbers.map_while(Result::ok).collect();
        Some([numbers[0], numbers[1], numbers[2]])
    };
    (text.lines().filter_map(touch).collect(), text.matches("STRAIGHT_TRAVERSE").count())
}

#[test]
#[ignore = "slow: make test-all"]
fn touches_of_a_part_that_lies_elsewhere_say_where_and_the_next_points_follow_from_them() {
    // Facets as long as this lie so far beside the waves.
    touches_say_where(60, 8e-3);
}

#[test]
#[ignore = "slow: make test-all"]
fn touches_of_slopes_up_to_30_degrees_have_no_bias_of_the_tip() {
    touches_say_where(200, 1e-3);
}

/// Touches of a part of so many cells along a side are registered, to this much, mm.
fn touches_say_where(cells: usize, tolerance: f64) {
    let dir = folder();
    let job = job(dir.path(), "linuxcnc", "sigmas = 2\n", cells);
    let found = chosen(&job, &["--points", "24"]);
    assert_eq!(found["points"].as_array().expect("points").len(), 24);
    assert_eq!(found["loose"].as_array().map(Vec::len), Some(0), "{found}");
    let rows = RIGID.trips(&found);
    let (touches, moves) = interpreted(&dir.path().join("job.probe/probe.ngc"));
    assert!(moves > 3 * 24, "{moves}");
    for (touch, row) in touches.iter().zip(&rows) {
        // Down past where the part is met, by no more than twice the search.
        let is_met = touch[2] < row[2] && row[2] < touch[2] + 4.5;
        assert!(is_met && (0..2).all(|k| (touch[k] - row[k]).abs() < 1e-4), "{touch:?} {row:?}");
    }
    assert_eq!(touches.len(), rows.len());
    let path = dir.path().join("probe.log");
    std::fs::write(&path, log_of(&rows)).expect("written");
    registers(dir.path(), &job, &path, tolerance);
    // What is measured tells where the next points count, and they are added.
    let sheet = std::fs::read_to_string(dir.path().join("job.probe/runsheet.txt")).expect("a run sheet");
    assert!(sheet.contains("terrace register") && sheet.contains("proved"), "{sheet}");
    let again = chosen(&job, &["--points", "5", "-o", dir.path().join("more").to_str().expect("UTF-8")]);
    assert!(again["before"]["worst_um"].as_f64() < Some(5.0), "{again}");
    let exists = terrace([Path::new("register"), &job, &path]);
    assert!(said(&exists).contains("[register-exists]"), "{}", said(&exists));
    let twice = terrace([Path::new("register"), &job, &path, Path::new("--add")]);
    assert!(said(&twice).contains("has all touches of this log already"), "{}", said(&twice));
    // A log that goes on: what is in the table already, to the last digit, is the same touch.
    let more = RIGID.trips(&again);
    std::fs::write(&path, log_of(&rows) + &log_of(&more)).expect("written");
    let new = more.iter().filter(|row| !rows.contains(row)).count();
    let added = terrace([Path::new("register"), &job, &path, Path::new("--add"), Path::new("--json")]);
    let added: Value = serde_json::from_slice(&added.stdout).expect("JSON");
    assert_eq!((added["points"].as_array().map(Vec::len), new > 0), (Some(24 + new), true));
}

#[test]
#[ignore = "slow: make test-all"]
fn program_in_the_controller_of_linuxcnc_leaves_a_log_that_makes_a_job_that_verifies() {
    let dir = folder();
    let job = job(dir.path(), "linuxcnc", "", 200);
    let found = chosen(&job, &["--points", "16"]);
    let mut control = Simulation::new();
    let rows = dir.path().join("trips.txt");
    std::fs::write(&rows, table(&RIGID.trips(&found))).expect("written");
    control.tell(&format!("trips {}", rows.display()));
    control.start(&dir.path().join("job.probe/probe.ngc"));
    control.until_idle();
    // The control sees a touch a period of its servo later, and the axis stands 2 um lower by then.
    registers(dir.path(), &job, &control.dir.path().join("probe.log"), 0.006);
}

#[test]
#[ignore = "slow: make test-all"]
fn program_in_grbl_leaves_answers_that_make_a_job_that_verifies_whatever_g54_is() {
    let dir = folder();
    let job = job(dir.path(), "grbl", "", 200);
    let found = chosen(&job, &["--points", "16"]);
    let rows = dir.path().join("trips.txt");
    std::fs::write(&rows, table(&RIGID.trips(&found))).expect("written");
    let program = std::fs::read_to_string(dir.path().join("job.probe/probe.nc")).expect("a program");
    assert!(program.lines().all(|line| line.len() <= 70));
    let options = format!("--trips={}", rows.display());
    let simulator = Simulator::with(&dir.path().join("grbl.log"), &[&options]);
    let said_of = send(Path::new(&simulator.port), std::iter::once("$#").chain(program.lines()));
    simulator.end();
    let log = dir.path().join("probe.log");
    std::fs::write(&log, &said_of).expect("written");
    registers(dir.path(), &job, &log, 0.004);
    // Touches are told from the zero of the machine: without that of G54 they would lie elsewhere.
    let without: String =
        said_of.lines().filter(|line| !line.contains("[G54")).map(|line| line.to_owned() + "\n").collect();
    std::fs::write(&log, without).expect("written");
    let refused = terrace([Path::new("register"), &job, &log, Path::new("--force")]);
    assert!(said(&refused).contains("[probe-zero]"), "{}", said(&refused));
    let zero =
        ["register", job.to_str().expect("UTF-8"), log.to_str().expect("UTF-8"), "--force", "--zero", "-300,-300,-300"];
    assert!(terrace(zero).status.success());
}

/// A picture of the documents is what the product makes; `DOCS=write` makes it anew.
fn shown(made: &Path, page: &str) {
    let made = std::fs::read_to_string(made).expect("a picture");
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/how-to").join(page);
    if std::env::var_os("DOCS").is_some_and(|v| v == "write") {
        std::fs::write(&path, &made).expect("written");
    }
    let kept = std::fs::read_to_string(&path).expect("a picture of the documents");
    assert!(kept == made, "{page} is not what the product makes: DOCS=write");
}

/// Features on a warped part, found with the pilot laser.
fn features(part: TruePart) -> String {
    let head = "kind,stage_x,stage_y,stage_z,sigma_um,sigma_z_um,tip_mm,part_x,part_y,part_z,name\n";
    let places = [[4.0, 4.0], [76.0, 5.0], [75.0, 56.0], [5.0, 55.0]];
    places.into_iter().zip(1..).fold(head.to_owned(), |mut text, ([x, y], number)| {
        let p = [x, y, form(x, y)];
        let [a, b, _] = lies(p);
        let z = part.height([a, b]);
        let [sx, sy, sz] = [SIGNS[0] * a, SIGNS[1] * b, SIGNS[2] * z];
        let [px, py, pz] = p;
        let _ = writeln!(text, "optical,{sx:.6},{sy:.6},{sz:.6},10,20,,{px},{py},{pz:.6},hole {number}");
        text
    })
}

#[test]
#[ignore = "slow: make test-all"]
fn a_warped_part_is_known_where_it_is_marked_and_the_pictures_of_the_page_are_made_so() {
    let dir = folder();
    let job = job(dir.path(), "linuxcnc", "warp = \"0.3 mm\"\n", 200);
    let text = std::fs::read_to_string(&job).expect("a job").replace("pdof = \"0.07 mm\"", "pdof = \"0.15 mm\"");
    std::fs::write(&job, text).expect("written");
    let part = TruePart { warp: 0.15 };
    let found = chosen(&job, &["--points", "40"]);
    shown(&dir.path().join("job.probe/points.svg"), "measured-part-points.svg");
    std::fs::write(dir.path().join("points.csv"), features(part)).expect("written");
    let log = dir.path().join("probe.log");
    std::fs::write(&log, log_of(&part.trips(&found))).expect("written");
    let register = || {
        let out = terrace([Path::new("register"), &job, &log, Path::new("--add"), Path::new("--json")]);
        assert!(out.status.success(), "{}", said(&out));
        serde_json::from_slice::<Value>(&out.stdout).expect("JSON")
    };
    let first = register();
    // Points where they are missing, and once more.
    let more = dir.path().join("more");
    let again = chosen(&job, &["--points", "15", "-o", more.to_str().expect("UTF-8")]);
    std::fs::write(&log, log_of(&part.trips(&again))).expect("written");
    let second = register();
    let worst = |of: &Value| of["warp"]["sigma_um"][1].as_f64().expect("um");
    assert!(worst(&second) < worst(&first), "{} {}", worst(&second), worst(&first));
    let target = dir.path().join("job.job");
    compile(&job, &target);
    assert_eq!(verify(&target)["ok"], true);
    shown(&target.join("measured.svg"), "measured-part-measured.svg");
}

/// What is found of a program of a job.
fn proved(job: &Path, program: &str) -> ProbeProof {
    let job = Job::load(job, &Overrides::default()).expect("a job");
    let machine: Machine = job.machine().expect("a machine");
    let probe = machine.probe.expect("a probe");
    let origin = Origin(ORIGIN.map(|mm| (mm * 1e6) as i64));
    terrace_verify::probe(program.as_bytes(), &job, &machine, (&probe, origin), 2.0).expect("a proof")
}

#[test]
#[ignore = "slow: make test-all"]
fn a_damaged_program_of_a_probe_or_a_clamp_in_its_way_breaks_its_proof() {
    let dir = folder();
    let job = job(dir.path(), "linuxcnc", "", 50);
    chosen(&job, &["--points", "12"]);
    let program = std::fs::read_to_string(dir.path().join("job.probe/probe.ngc")).expect("a program");
    assert_eq!(proved(&job, &program).broken, Vec::<String>::new());
    assert_eq!(proved(&job, &program).touches, 12);
    let lines: Vec<&str> = program.lines().collect();
    let touch = lines.iter().position(|line| line.starts_with("G38.2")).expect("a touch");
    let without = |skipped: usize| {
        let kept = lines.iter().enumerate().filter(|(i, _)| *i != skipped).map(|(_, line)| *line);
        kept.collect::<Vec<_>>().join("\n") + "\n"
    };
    let with = |at: usize, line: &str| {
        let mut lines = lines.clone();
        lines[at] = line;
        lines.join("\n") + "\n"
    };
    let first_z = lines.iter().position(|line| line.starts_with("G0 Z200")).expect("a lift");
    let broken = |program: &str, text: &str| {
        let found = proved(&job, program).broken;
        assert!(found.iter().any(|message| message.contains(text)), "{text}: {found:?}");
    };
    broken(&without(touch + 1), "does not go back up");
    broken(&without(first_z), "does not lift z");
    broken(&with(touch, "G38.3 Z-20 F60"), "no word of a probe program");
    broken(&with(touch, "G38.2 Z-20 F6000"), "faster than probe.feed");
    broken(&with(touch, "G1 Z-20 F60"), "no word of a probe program");
    broken(&with(touch, "G38.2 Z-90 F60"), "the body of the probe may meet the part");
    broken(&with(touch, "G38.2 Z-399.9 F60"), "z leaves its travel");
    broken(&with(touch, "G0 Z-20"), "the tip may meet the part");
    broken(&with(touch + 1, "G0 Z100 X3"), "x or y moves together with z");
    broken(&program.replace("G0 Z200.000000\n(PROBECLOSE)", "(PROBECLOSE)"), "does not lift at its end");
    broken(&program.replace("(PROBECLOSE)", "M2\nG0 Z1"), "goes on after its end");
    broken(&program.replace("(PROBECLOSE)", "(LOGOPEN,x)"), "no word of a probe program");
    // A clamp over a corner of the part, as high as the way between two points.
    let clamped =
        |x: f64, y: f64| if (30.0..50.0).contains(&x) && (20.0..40.0).contains(&y) { 60.0 } else { form(x, y) };
    write_stl(&dir.path().join("part.stl"), &mesh(50, [0.0, 0.0, 80.0, 60.0], clamped));
    broken(&program, "the tip may meet the part");
}

#[test]
#[ignore = "slow: make test-all"]
fn a_probe_keeps_off_fixtures_and_the_table() {
    let (dir, other) = (folder(), folder());
    chosen(&job(other.path(), "linuxcnc", "", 50), &["--points", "12"]);
    let program = std::fs::read_to_string(other.path().join("job.probe/probe.ngc")).expect("a program");
    // Over the corner of the part that every choice of points takes, and far higher than the part.
    let clamp = "\n[[fixture]]\nname = \"clamp\"\nbox = [[\"-10 mm\", \"-10 mm\", \"0 mm\"], [\"20 mm\", \"15 mm\", \"40 mm\"]]\n";
    let clamped = job(dir.path(), "linuxcnc", clamp, 50);
    let found = proved(&clamped, &program).broken;
    assert!(found.iter().any(|message| message.contains("the tip may meet fixture \"clamp\"")), "{found:?}");
    // A tower that is higher than the tip gets: the first move could come from behind it.
    let tower = clamp
        .replace("-10 mm\", \"-10 mm", "300 mm\", \"-10 mm")
        .replace("[\"20 mm", "[\"320 mm")
        .replace("40 mm", "500 mm");
    let third = folder();
    let towered = job(third.path(), "linuxcnc", &tower, 50);
    let found = proved(&towered, &program).broken;
    assert!(found.iter().any(|message| message.contains("may meet fixture \"clamp\"")), "{found:?}");
    let out = terrace([Path::new("probe"), &towered]);
    assert!(!out.status.success() && said(&out).contains("[probe-reach]"), "{}", said(&out));
    // With the clamp points lie beside it, farther than tip and search, and the program is proved.
    let told = chosen(&clamped, &["--points", "12"]);
    let program = std::fs::read_to_string(dir.path().join("job.probe/probe.ngc")).expect("a program");
    assert_eq!(proved(&clamped, &program).broken, Vec::<String>::new());
    let list = std::fs::read_to_string(dir.path().join("job.probe/points.csv")).expect("a list");
    let column = |row: &str, name: &str| {
        let names: Vec<&str> = list.lines().find(|line| line.contains("stage_x")).expect("names").split(',').collect();
        let k = names.iter().position(|own| *own == name).expect("a column");
        row.split(',').nth(k).expect("a cell").parse::<f64>().expect("a number")
    };
    let rows: Vec<&str> = list.lines().skip_while(|line| !line.contains("stage_x")).skip(1).collect();
    assert_eq!(rows.len(), 12, "{told}");
    for row in rows {
        let at = [("stage_x", 0), ("stage_y", 1)].map(|(name, k)| SIGNS[k] * column(row, name) - ORIGIN[k] + OFFSET[k]);
        assert!(at[0] > 20.0 + RADIUS + 2.0 || at[1] > 15.0 + RADIUS + 2.0, "{row}: {at:?}");
    }
    // The body of the probe reaches 50 mm above the tip: no lower than a table that is as high as that.
    let machine = std::fs::read_to_string(dir.path().join("m.toml")).expect("a machine");
    let table = |mm: f64| {
        let text = machine.replacen("clearance =", &format!("table = \"{mm} mm\"\nclearance ="), 1);
        std::fs::write(dir.path().join("m.toml"), text).expect("written");
        terrace([
            "probe",
            clamped.to_str().expect("UTF-8"),
            "--points",
            "12",
            "--json",
            "-o",
            dir.path().join("t.probe").to_str().expect("UTF-8"),
        ])
    };
    let high = table(ORIGIN[2] + 60.0);
    assert!(!high.status.success() && said(&high).contains("probe-none"), "{}", said(&high));
    let found = proved(&clamped, &program).broken;
    assert!(found.iter().any(|message| message.contains("the body of the probe may meet the table")), "{found:?}");
    let low = table(ORIGIN[2] - 5.0);
    assert!(low.status.success(), "{}", said(&low));
    assert_eq!(proved(&clamped, &program).broken, Vec::<String>::new());
}

#[test]
fn what_a_probe_needs_is_asked_for() {
    let dir = folder();
    let job = job(dir.path(), "linuxcnc", "", 40);
    let text = std::fs::read_to_string(&job).expect("a job");
    let refused = |job: &Path, options: &[&str], code: &str| {
        let mut words = vec!["probe", job.to_str().expect("UTF-8")];
        words.extend(options);
        let out = terrace(words);
        assert!(!out.status.success() && said(&out).contains(&format!("[{code}]")), "{code}: {}", said(&out));
    };
    let other = |name: &str, text: &str| {
        let path = dir.path().join(name);
        std::fs::write(&path, text).expect("written");
        path
    };
    let nowhere = text.lines().filter(|line| !line.starts_with("origin")).collect::<Vec<_>>().join("\n");
    refused(&other("nowhere.toml", &nowhere), &[], "probe-start");
    refused(
        &other("built-in.toml", &text.replace("file = \"m.toml\"", "profile = \"xyz-galvo-40\"")),
        &[],
        "probe-none-stated",
    );
    refused(&job, &["--search", "40 mm"], "probe-none");
    let list = chosen(&other("sensor.toml", &text), &["--sensor", "3 um", "--sigma", "4 um"]);
    assert!(list["after"]["worst_um"].as_f64() <= Some(4.0) && list["proved_moves"].is_null(), "{list}");
    refused(&other("sensor.toml", &text), &[], "output-exists");
    let points = std::fs::read_to_string(dir.path().join("sensor.probe/points.csv")).expect("a list");
    std::fs::write(dir.path().join("points.csv"), points).expect("written");
    // A list of places is no table of measured ones until their z is there.
    let out = terrace([Path::new("register"), &job]);
    assert!(!out.status.success() && said(&out).contains("stage_z"), "{}", said(&out));
    let list = std::fs::read_to_string(dir.path().join("points.csv")).expect("a list");
    let at = |row: &str| {
        let cells: Vec<&str> = row.split(',').collect();
        let [x, y] = [2, 3].map(|k| cells[k].parse::<f64>().expect("a number"));
        let table = [0, 1].map(|k| SIGNS[k] * [x, y][k]);
        let z = SIGNS[2] * RIGID.height(table);
        format!("{},{},{x},{y},{z:.6},{}\n", cells[0], cells[1], cells[5])
    };
    let rows = list.lines().map(|row| if row.starts_with('P') { at(row) } else { format!("{row}\n") });
    std::fs::write(dir.path().join("points.csv"), rows.collect::<String>()).expect("written");
    let out = terrace([Path::new("register"), &other("sensor.toml", &text)]);
    assert!(out.status.success(), "{}", said(&out));
}
