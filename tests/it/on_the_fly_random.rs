//! Random on-the-fly jobs on parts with steps, walls, rims and sheets, under strokes that run back over themselves:
//! each is refused with a limit of the machine or gives a folder that verifies.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};

use rayon::prelude::*;

use crate::support::surfaces::{Random, mesh, write_stl};
use crate::support::{folder, seeds};
use terrace_core::diag::Kind;
use terrace_input::job::{Job, Overrides};
use terrace_plan::plan;
use terrace_report::job_folder;

/// From lo to hi.
fn between(noise: &mut Random, lo: f64, hi: f64) -> f64 {
    lo + (noise.half() + 0.5) * (hi - lo)
}

fn pick<T: Copy>(noise: &mut Random, list: &[T]) -> T {
    list[(noise.bits() >> 5) as usize % list.len()]
}

/// A base sheet, gentle or terraced, blocks with upright walls on it, and sheets over or through it.
fn part(noise: &mut Random, [w, h]: [f64; 2]) -> Vec<[[f64; 3]; 3]> {
    let (lean, bow) = (between(noise, -0.1, 0.1), between(noise, 0.0, 0.002));
    let (levels, riser) = (pick(noise, &[0.0, 0.0, 3.0, 5.0]), between(noise, 0.02, 2.0));
    let z = |x: f64, y: f64| lean * y - bow * (x * x + y * y) + (x / w * levels).floor() * riser;
    let n = pick(noise, &[4, 12, 30]);
    let mut out = mesh(n, [0.0, 0.0, w, h], z);
    for _ in 0..pick(noise, &[0, 1, 2]) {
        let [x, y] = [between(noise, 0.1, 0.6) * w, between(noise, 0.1, 0.6) * h];
        let [x1, y1] = [x + between(noise, 0.1, 0.5) * w, y + between(noise, 0.1, 0.5) * h];
        let top = between(noise, 0.05, 3.0) + lean.abs() * h;
        out.extend(mesh(1, [x, y, x1, y1], |_, _| top));
        for [[ax, ay], [bx, by]] in [[[x, y], [x1, y]], [[x1, y], [x1, y1]], [[x1, y1], [x, y1]], [[x, y1], [x, y]]] {
            out.push([[ax, ay, -1.0], [bx, by, -1.0], [bx, by, top]]);
            out.push([[ax, ay, -1.0], [bx, by, top], [ax, ay, top]]);
        }
    }
    // A sheet that overhangs the others, or passes through them.
    for _ in 0..pick(noise, &[0, 0, 1]) {
        let [x, y] = [between(noise, -0.1, 0.6) * w, between(noise, -0.1, 0.6) * h];
        let (level, slope) = (between(noise, -0.5, 2.0), between(noise, -0.2, 0.2));
        out.extend(mesh(3, [x, y, x + 0.4 * w, y + 0.5 * h], |x, _| level + slope * x));
    }
    out
}

/// Lines, loops, or polylines that turn and run back over themselves.
fn texture(noise: &mut Random, dir: &Path, [w, h]: [f64; 2]) -> String {
    match pick(noise, &[0, 1, 2, 3]) {
        0 => {
            let (pitch, direction) = (h / between(noise, 2.0, 6.0), pick(noise, &["0 deg", "90 deg", "31 deg"]));
            format!("pattern = \"hatch\"\npitch = \"{pitch:.4} mm\"\ndirection = {direction:?}\n")
        }
        1 => format!("pattern = \"circles\"\npitch = \"{:.4} mm\"\ncell = \"{:.4} mm\"\n", h / 2.0, h / 3.0),
        _ => {
            let y = between(noise, 0.1, 0.9) * h;
            let xs: Vec<f64> = (0..4).map(|_| between(noise, -0.1, 1.1) * w).collect();
            let back: String = xs.iter().map(|x| format!("{x:.3},{y:.3} ")).collect();
            let bend: String =
                (0..4).map(|_| format!("{:.3},{:.3} ", between(noise, 0.0, w), between(noise, 0.0, h))).collect();
            let svg = format!(
                "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{w}mm\" height=\"{h}mm\" viewBox=\"0 0 {w} {h}\">\
                 <g fill=\"none\" stroke=\"black\" stroke-width=\"0.001\"><polyline points=\"{back}\"/><polyline points=\"{bend}\"/></g></svg>"
            );
            std::fs::write(dir.join("lines.svg"), svg).expect("a file");
            "file = \"lines.svg\"\n".into()
        }
    }
}

/// What became of the job of a seed.
enum Outcome {
    Marked,
    /// With a limit of the machine or the job.
    Refused,
    /// What is wrong.
    Fault(String),
}

/// Facets that do not meet: each is moved by up to half a micrometre, which `surface.weld` closes.
fn cracked(noise: &mut Random, facets: Vec<[[f64; 3]; 3]>) -> Vec<[[f64; 3]; 3]> {
    let moved = |facet: [[f64; 3]; 3]| {
        let by = [0, 1, 2].map(|_| between(noise, -5e-4, 5e-4));
        facet.map(|corner| [0, 1, 2].map(|k| corner[k] + by[k]))
    };
    facets.into_iter().map(moved).collect()
}

/// The job file of a seed, with its surface and drawing next to it.
fn write_job(seed: u64, is_cracked: bool, dir: &Path) -> PathBuf {
    let noise = &mut Random::new(seed);
    let seven = seed.is_multiple_of(3);
    let size =
        if seven { [between(noise, 4.0, 9.0), between(noise, 3.0, 6.0)] } else { [between(noise, 10.0, 50.0), 20.0] };
    let facets = part(noise, size);
    let (facets, weld) = if is_cracked { (cracked(noise, facets), ", weld = \"4 um\"") } else { (facets, "") };
    write_stl(&dir.join("part.stl"), &facets);
    let texture = texture(noise, dir, size);
    let profile = if seven { "xyzac-galvo-10" } else { pick(noise, &["xyz-galvo-40", "xyz-galvo-100"]) };
    let origin =
        if seven { format!(", origin = [\"{:.3} mm\", \"-2 mm\", \"0 mm\"]", -size[0] / 2.0) } else { String::new() };
    let text = format!(
        "mode = \"on-the-fly\"\nsurface = {{ file = \"part.stl\", unit = \"mm\"{weld} }}\nfocus = {{ pdof = \"{} mm\" }}\n\
         placement = {{ turn = \"{} deg\"{origin} }}\nmachine = {{ profile = {profile:?} }}\n[[texture]]\n{texture}\
         [[pen]]\nname = \"a\"\nspeed = \"{} mm/s\"\npower = \"40 %\"\nfrequency = \"60 kHz\"\n",
        pick(noise, &[0.07, 0.2, 0.5]),
        pick(noise, &[0.0, 0.0, 17.3, -90.0]),
        pick(noise, &[50, 400, 2000]),
    );
    let job = dir.join("job.toml");
    std::fs::write(&job, text).expect("a file");
    job
}

/// Compiles and verifies the job of a seed.
fn outcome(seed: u64, is_cracked: bool) -> Outcome {
    let dir = folder();
    let job = write_job(seed, is_cracked, dir.path());
    let fault = |what: String| Outcome::Fault(format!("seed {seed}: {what}"));
    let planned = Job::load(&job, &Overrides::default()).and_then(|job| plan::plan(job, &|_, _| {}));
    let plan = match planned {
        Ok(plan) => plan,
        Err(e) => {
            let kind = |kind| e.diags().iter().any(|d| d.kind == kind);
            let is_limit = kind(Kind::Limit) && !kind(Kind::Bug) && !kind(Kind::Input);
            return if is_limit { Outcome::Refused } else { fault(e.to_string()) };
        }
    };
    let out = dir.path().join("made.job");
    if let Err(e) = job_folder::write(&plan, &out) {
        return fault(e.to_string());
    }
    match terrace_verify::verify(&out, None) {
        Ok(proof) if proof.ok => Outcome::Marked,
        Ok(proof) => fault(proof.to_text()),
        Err(e) => fault(e.to_string()),
    }
}

/// No job is at fault, and most are marked.
fn check(seeds: impl IntoIterator<Item = u64>) {
    check_parts(seeds, false);
}

/// The same on parts that are sound or cracked.
fn check_parts(seeds: impl IntoIterator<Item = u64>, is_cracked: bool) {
    let one = |seed| {
        catch_unwind(AssertUnwindSafe(|| outcome(seed, is_cracked)))
            .unwrap_or_else(|_| Outcome::Fault(format!("seed {seed}: panic")))
    };
    let seeds: Vec<u64> = seeds.into_iter().collect();
    let found: Vec<Outcome> = seeds.into_par_iter().map(one).collect();
    let faults = found.iter().filter_map(|o| if let Outcome::Fault(text) = o { Some(text.as_str()) } else { None });
    let faults: Vec<&str> = faults.collect();
    let marked = found.iter().filter(|o| matches!(o, Outcome::Marked)).count();
    let refused = found.iter().filter(|o| matches!(o, Outcome::Refused)).count();
    eprintln!("{marked} marked, {refused} refused");
    assert!(faults.is_empty(), "{} of {}:\n{}", faults.len(), found.len(), faults.join("\n"));
    assert!(2 * marked > found.len(), "{marked} of {} are marked", found.len());
}

#[test]
#[ignore = "slow: make test-all"]
fn marks_that_overlap_by_rounding_beside_a_piece_left_out_verify() {
    check([1281]);
}

#[test]
#[ignore = "slow: make test-all"]
fn random_on_the_fly_jobs_verify_or_name_a_limit() {
    // Of 1013 a mark of a stroke that runs back over itself ends where the stroke turns. Of 3027 beams lean by 60 degrees
    // over facets that are not flat, of 3090 the last beam of a mark passes by the edge at which it ends. Of 3111 and 3222
    // axes start so slowly that a mark stands still at first; of 3222 two marks over one line differ in what is left out
    // beside them.
    check([1013, 3027, 3090, 3111, 3222]);
}

#[test]
#[ignore = "slow: make test-all"]
fn more_random_on_the_fly_jobs_verify_or_name_a_limit() {
    // Of 3030 a mark begins less than a nanometre before a vertex, of 3153 a border of facets lies as near to one. Of 3118
    // a mark along the border of the part begins at the corner of a facet that is too steep. Of 3054 and 3075 beams lean
    // as of 3027 and 3090.
    check([3030, 3054, 3075, 3118, 3153]);
}

#[test]
#[ignore = "slow: make test-all"]
fn random_on_the_fly_jobs_on_cracked_parts_that_are_welded_verify_or_name_a_limit() {
    check_parts(seeds(0..200), true);
}

#[test]
#[ignore = "slow: make test-all"]
fn five_hundred_random_on_the_fly_jobs_verify_or_name_a_limit() {
    check(seeds(0..500));
}
