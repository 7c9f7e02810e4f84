//! The lower bound of the stops: its certificate re-checked with arithmetic of its own, against the marks of
//! the program and the stops of every method.

use std::path::Path;
use terrace_core::math;

use crate::support::surfaces::{FIVE, dome, mesh, saddle, wave, write_stl};
use crate::support::{JobText, fixture, folder, planned, shared};
use terrace_core::geom::{FieldPoint, Nm};
use terrace_plan::partition::bound::Certificate;
use terrace_plan::plan::SteppedPlan;

const MM: f64 = 1e6;

fn plan(dir: &Path, job: &JobText) -> Box<SteppedPlan> {
    let path = job.write(dir, "job.toml");
    planned(&path)
}

/// The most weight in any closed box of `size`. A box can be pushed up along every axis until a lower end of
/// a piece that it holds stops it.
fn heaviest(certificate: &Certificate, size: [i64; 3]) -> u64 {
    let pieces: Vec<([i64; 3], [i64; 3], u64)> =
        certificate.pieces.iter().map(|(i, w)| (i.lo.map(i64::from), i.hi.map(i64::from), u64::from(*w))).collect();
    let mut most = 0;
    for (lowest, _, _) in &pieces {
        let z = lowest[2];
        let near: Vec<_> = pieces
            .iter()
            .filter(|(lo, hi, _)| lo[2] >= z && hi[2] <= z + size[2])
            .filter(|(lo, hi, _)| (0..2).all(|k| (hi[k] - lowest[k]).max(lowest[k] - lo[k]) <= size[k]))
            .collect();
        for x in near.iter().map(|n| n.0[0]).filter(|&x| x <= lowest[0]) {
            for y in near.iter().map(|n| n.0[1]).filter(|&y| y <= lowest[1]) {
                let corner = [x, y];
                let inside = near
                    .iter()
                    .filter(|(lo, hi, _)| (0..2).all(|k| lo[k] >= corner[k] && hi[k] <= corner[k] + size[k]));
                most = most.max(inside.map(|n| n.2).sum());
            }
        }
    }
    most
}

/// Checks the certificate of a plan: no box of the field by the depth range holds more than a whole, and every
/// piece is a mark, or a whole figure, of the program.
fn assert_sound(name: &str, plan: &SteppedPlan) -> Certificate {
    let certificate = plan.passes[0].bound.clone().unwrap_or_else(|| panic!("{name}: no bound"));
    let [w, h] = plan.machine.usable_field();
    let box_of_a_stop = [w, h, plan.job.focus.depth].map(|Nm(size)| size);
    assert!((0..3).all(|k| i64::from(certificate.size[k]) >= box_of_a_stop[k]), "{name}");
    let whole = u64::from(certificate.whole);
    assert!(heaviest(&certificate, box_of_a_stop) <= whole, "{name}: a box holds more than a whole");
    let sum: u64 = certificate.pieces.iter().map(|p| u64::from(p.1)).sum();
    assert_eq!(certificate.stops() as u64, sum.div_ceil(whole), "{name}");
    assert_eq!(plan.summary.lower_bound_stops, Some(certificate.stops()), "{name}");
    let stops = plan.summary.stops;
    eprintln!("{name}: {} stops, at least {}", stops, certificate.stops());
    assert!(certificate.stops() <= stops, "{name}: {} of {stops}", certificate.stops());
    for c in &plan.summary.candidates {
        assert!(certificate.stops() <= c.stops, "{name}, {}: {} of {}", c.method, certificate.stops(), c.stops);
    }
    assert_marks(name, plan, &certificate);
    certificate
}

/// Every piece lies on a stroke of a block that holds its height.
fn assert_marks(name: &str, plan: &SteppedPlan, certificate: &Certificate) {
    let program = plan.checked.program();
    let middle = [
        (plan.passes[0].texture.lo.x + plan.passes[0].texture.hi.x) / 2,
        (plan.passes[0].texture.lo.y + plan.passes[0].texture.hi.y) / 2,
    ];
    for (piece, _) in &certificate.pieces {
        let lo = [i64::from(piece.lo[0]) + middle[0], i64::from(piece.lo[1]) + middle[1]];
        let hi = [i64::from(piece.hi[0]) + middle[0], i64::from(piece.hi[1]) + middle[1]];
        let [z_lo, z_hi] = [piece.lo[2], piece.hi[2]].map(|z| Nm(z.into()));
        let found = program.blocks.iter().any(|b| {
            let c = [b.stop.centre.x, b.stop.centre.y];
            let reach = plan.machine.usable_field().map(|Nm(f)| f / 2 + 2);
            if b.z_lo > z_lo + Nm(2) || b.z_hi < z_hi - Nm(2) || (0..2).any(|k| (lo[k] - c[k]).abs() > reach[k]) {
                return false;
            }
            program.strokes_of(b).iter().any(|s| {
                let points = program.points_of(s);
                let at = |p: &FieldPoint| [(i64::from(p.x) + c[0]) as f64, (i64::from(p.y) + c[1]) as f64];
                if lo == hi {
                    return points.windows(2).any(|w| {
                        let (a, b, p) = (at(&w[0]), at(&w[1]), lo.map(|v| v as f64));
                        let d = [b[0] - a[0], b[1] - a[1]];
                        let v = [p[0] - a[0], p[1] - a[1]];
                        let t = ((v[0] * d[0] + v[1] * d[1]) / (d[0] * d[0] + d[1] * d[1])).clamp(0.0, 1.0);
                        math::hypot(v[0] - t * d[0], v[1] - t * d[1]) <= 3.0
                    });
                }
                let ends = |k: usize, pick: fn(f64, f64) -> f64| points.iter().map(|p| at(p)[k]).reduce(pick);
                (0..2).all(|k| ends(k, f64::min) == Some(lo[k] as f64) && ends(k, f64::max) == Some(hi[k] as f64))
            })
        });
        assert!(found, "{name}: {lo:?} {hi:?} at {z_lo:?} to {z_hi:?} is not a mark");
    }
}

#[test]
#[ignore = "slow: make test-all"]
fn certificates_of_made_surfaces_hold() {
    let dir = folder();
    let stl = dir.path().join("part.stl");
    for (name, z) in FIVE {
        write_stl(&stl, &mesh(100, [0.0, 0.0, 450.0, 450.0], z));
        // The cylinder's hatch runs along its rulings, at one height each.
        let turned = if name == "cyl" { "direction = \"90 deg\"\n" } else { "" };
        let hatch = format!(
            "pattern = \"hatch\"\npitch = \"2 mm\"\n{turned}area = [\"40 mm\", \"60 mm\", \"130 mm\", \"140 mm\"]"
        );
        let job = JobText::on(&stl).texture(&hatch).method("auto").partition("objective = \"stops\"");
        let plan = plan(dir.path(), &job);
        assert_eq!(plan.summary.candidates.len(), 3, "{name}");
        let certificate = assert_sound(name, &plan);
        let ratio = plan.summary.stops as f64 / certificate.stops() as f64;
        assert!(ratio < 1.35, "{name}: {ratio}");
        for (piece, _) in &certificate.pieces {
            let [x, y] = [piece.lo[0], piece.lo[1]].map(|v| f64::from(v) / MM);
            let off = f64::from(piece.lo[2]) - z(x + 85.0, y + 100.0) * MM;
            assert!(off.abs() < 20e3, "{name}: {piece:?} is {off} nm off the surface");
        }
        // A box that is a little larger than the one for which the points were set holds two of them.
        let [w, h, d] = certificate.size.map(i64::from);
        assert!(heaviest(&certificate, [w + w / 10, h + h / 10, d + d / 10]) > u64::from(certificate.whole));
    }
}

#[test]
#[ignore = "slow: make test-all"]
fn figures_that_stay_whole_count_as_one_piece() {
    let dir = folder();
    let stl = dir.path().join("part.stl");
    for (name, z) in [("dome", dome as fn(f64, f64) -> f64), ("saddle", saddle), ("wave", wave)] {
        write_stl(&stl, &mesh(100, [0.0, 0.0, 450.0, 450.0], z));
        let squares = "pattern = \"squares\"\npitch = \"1.5 mm\"\ncell = \"1 mm\"\n\
                       area = [\"20 mm\", \"20 mm\", \"65 mm\", \"55 mm\"]";
        let bound = |method, keep: &str| {
            let plan = plan(dir.path(), &JobText::on(&stl).texture(squares).method(method).partition(keep));
            assert_sound(&format!("{name}, {method}, {keep}"), &plan).stops()
        };
        let cut = bound("window", "");
        let whole = bound("window", "keep_whole = \"1 mm\"");
        assert!(whole > cut, "{name}: {whole} {cut}");
        assert_eq!(bound("z-range", "keep_whole = \"1 mm\""), whole);
        assert_eq!(bound("contour", "keep_whole = \"1 mm\""), cut, "levels of the whole part cut figures");
    }
}

#[test]
fn certificate_of_a_hood_holds() {
    assert_sound_under_hatch(&fixture("hood.stl"), [500, -75, 650, 75]);
}

#[test]
#[ignore = "needs ../shared: make test-all"]
fn certificates_of_a_mirror_and_of_terrain_hold() {
    let surfaces = shared().join("surfaces");
    assert_sound_under_hatch(&surfaces.join("mirror_freeform.stl"), [-100, 60, 100, 180]);
    assert_sound_under_hatch(&surfaces.join("helens_relief_small.stl"), [40, -160, 140, -40]);
}

fn assert_sound_under_hatch(stl: &Path, [x0, y0, x1, y1]: [i32; 4]) {
    let dir = folder();
    let hatch =
        format!("pattern = \"hatch\"\npitch = \"1 mm\"\narea = [\"{x0} mm\", \"{y0} mm\", \"{x1} mm\", \"{y1} mm\"]");
    let mut job = JobText::on(stl).texture(&hatch).method("z-range");
    job.focus = "pdof = \"0.2 mm\"".into();
    job.more = "[limits]\nmax_incidence = \"60 deg\"\nsteep = \"skip\"".into();
    assert_sound(&stl.display().to_string(), &plan(dir.path(), &job));
}

#[test]
fn bound_of_a_flat_plate_is_one_stop_per_field() {
    let dir = folder();
    let stl = dir.path().join("plate.stl");
    for z in [0.0, 3.1] {
        write_stl(&stl, &mesh(7, [0.0, 0.0, 230.0, 230.0], |_, _| z));
        let plan = plan(dir.path(), &JobText::on(&stl).texture("pattern = \"hatch\"\npitch = \"0.5 mm\""));
        assert_eq!(assert_sound("plate", &plan).stops(), 36);
        assert_eq!(plan.summary.stops, 36);
    }
}

#[test]
fn the_bound_does_not_speak_of_what_is_too_short_to_be_marked() {
    let dir = folder();
    let stl = dir.path().join("part.stl");
    write_stl(
        &stl,
        &mesh(60, [0.0, 0.0, 60.0, 50.0], |x, y| 0.03 * x + 0.9 * math::sin(x / 11.0) * math::cos(y / 14.0)),
    );
    let hatch = "pattern = \"hatch\"\npitch = \"1 mm\"\ndirection = \"20 deg\"";
    let bound = |min_mark: &str| {
        let partition = format!("min_mark = \"{min_mark}\"");
        let plan = plan(dir.path(), &JobText::on(&stl).texture(hatch).method("z-range").partition(&partition));
        (assert_sound(min_mark, &plan).stops(), plan.summary.skipped_small_mm)
    };
    let (all, none) = bound("0 mm");
    let (marked, small) = bound("0.3 mm");
    assert!(none == 0.0 && small > 1.0 && marked <= all && marked * 10 > all * 9, "{all} {marked} {small}");
}
