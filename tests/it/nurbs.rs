//! NURBS surfaces: the three algorithms of Brecher et al. against reference figures, which were computed independently
//! (`fixtures/anchors/nurbs.json`); `terrace inspect --nurbs`; heights of tessellated surfaces against the exact ones.

use std::path::Path;
use terrace_core::math;

use serde_json::{Value, json};
use terrace_compare::nurbs::{Counted, Decoupled, HeightGrid, Inversion, Method, Scalar, Surface, counted};
use terrace_core::geom::P2;
use terrace_input::job::{Job, Overrides};
use terrace_plan::plan::Inputs;
use terrace_plan::projection::Tracer;

use crate::support::nurbs::{HALF, chord_error, dish, height, knots, net, patch, ply, surface, tessellated};
use crate::support::surfaces::write_stl;
use crate::support::{JobText, fixture, folder, number, said, terrace};

/// The weights and samples of the reference surface: degree 3, distorted, weights from 0.7 to 1.3.
fn reference() -> (Vec<Vec<f64>>, Vec<Value>) {
    let text = std::fs::read_to_string(fixture("anchors/nurbs.json")).expect("the anchors");
    let mut anchors: Value = serde_json::from_str(&text).expect("JSON");
    let weights = serde_json::from_value(anchors["weights"].take()).expect("weights");
    (weights, anchors["samples"].as_array().expect("samples").clone())
}

/// The six reference surfaces: degrees 2 and 3; undistorted, half distorted, wholly with weights.
fn cases() -> Vec<(String, Surface)> {
    let (weights, _) = reference();
    let of = |degree: usize| {
        [(0.0, None), (0.5, None), (1.0, Some(weights.as_slice()))].map(|(strength, weights)| {
            (format!("degree {degree}, warp {strength}"), surface(degree, strength, weights))
        })
    };
    [2, 3].into_iter().flat_map(of).collect()
}

/// Parameters of 25 x 24 samples, over the whole range.
fn parameters() -> impl Iterator<Item = [f64; 2]> {
    (0..600).map(|n| [(f64::from(n % 25) + 0.5) / 25.0, (f64::from(n / 25) + 0.5) / 24.0])
}

#[test]
fn reference_samples_lie_on_the_surface() {
    let (weights, samples) = reference();
    let made = surface(3, 1.0, Some(&weights));
    assert!(samples.len() >= 5);
    for sample in samples {
        let uv = ["u", "v"].map(|k| sample[k].as_f64().expect("a number"));
        for (k, c) in made.point(uv).into_iter().enumerate() {
            // The weights are stored with 12 decimals.
            assert!((c - sample["S"][k].as_f64().expect("a number")).abs() < 1e-9, "{sample}: {c}");
        }
    }
}

#[test]
fn operations_are_as_many_as_in_the_article() {
    for (degree, point) in [(2, 141), (3, 247)] {
        let made = surface(degree, 0.0, None);
        let operations = counted(|| made.point([Counted::of(0.3), Counted::of(0.7)])).1;
        assert_eq!(operations, point, "degree {degree}");
    }
    let made = surface(2, 0.0, None);
    let decoupled = Decoupled::of(&made).expect("decoupled");
    let two = counted(|| decoupled.point([Counted::of(1.0), Counted::of(2.0)])).1;
    assert!((134..=164).contains(&two), "II: {two}, 149 expected");
    // One step more is one step's worth.
    let warped = surface(2, 0.5, None);
    let cost = |method| {
        let inversion = Inversion::new(&warped, method);
        let [x, y, _] = warped.point([0.413, 0.377]);
        let (found, all) = counted(|| inversion.cold([Counted::of(x), Counted::of(y)]).expect("a point"));
        all as f64 / (found.steps as f64 + 1.0)
    };
    let (gauss_newton, newton) = (cost(Method::GaussNewton), cost(Method::Newton));
    assert!((newton / 561.0 - 1.0).abs() < 0.1 && (gauss_newton / 339.0 - 1.0).abs() < 0.1, "{newton} {gauss_newton}");
}

#[test]
fn decoupled_heights_are_exact() {
    for degree in [2, 3] {
        let made = surface(degree, 0.0, None);
        let decoupled = Decoupled::of(&made).expect("decoupled");
        let (mut place, mut off): (f64, f64) = (0.0, 0.0);
        for uv in parameters() {
            let [x, y, z] = made.point(uv);
            let at = decoupled.point([x, y]);
            place = place.max((at[0] - x).abs()).max((at[1] - y).abs());
            off = off.max((at[2] - z).abs());
        }
        assert!(place < 1e-12 && off < 1e-12, "degree {degree}: {place} {off}");
        assert_eq!(decoupled.height([HALF + 1e-6, 0.0]), None);
        assert!((decoupled.height([HALF, -HALF]).expect("a corner") - height([HALF, -HALF])).abs() < 1e-12);
    }
}

#[test]
fn nets_that_are_not_decoupled_are_refused_by_algorithm_ii() {
    let even = |degree: usize| {
        let mut points = net(degree, 30, HALF, &|p| p, &height);
        for (i, row) in points.iter_mut().enumerate() {
            for (j, point) in row.iter_mut().enumerate() {
                [point[0], point[1]] = [i, j].map(|n| HALF * (n as f64 / 14.5 - 1.0));
            }
        }
        Surface::new([degree; 2], [knots(degree, 30), knots(degree, 30)], &points, None).expect("a surface")
    };
    // So far an even net is off where it is taken for a decoupled one.
    for (degree, off) in [(2, 0.801_273), (3, 1.514_932)] {
        let made = even(degree);
        let ends = made.range()[0];
        let worst = (0..=20_000).map(|i| {
            let u = ends[0] + (ends[1] - ends[0]) * f64::from(i) / 20_000.0;
            (made.point([u, 0.5])[0] - HALF * (2.0 * u - 1.0)).abs()
        });
        let worst = worst.fold(0.0, f64::max);
        assert!((worst / off - 1.0).abs() < 0.01, "degree {degree}: {worst}");
    }
    let (weights, _) = reference();
    for (made, said) in [
        (even(2), "x of point"),
        (surface(3, 0.5, None), "from where x is linear in u"),
        (surface(3, 0.0, Some(&weights)), "weights differ"),
    ] {
        let e = Decoupled::of(&made).expect_err(said);
        assert!(e.diags()[0].code == "nurbs-decoupled" && e.to_string().contains(said), "{e}");
    }
}

#[test]
fn gauss_newton_converges_in_five_steps_on_all_reference_surfaces_and_newton_does_not() {
    for (name, made) in cases() {
        let inversion = Inversion::new(&made, Method::GaussNewton);
        let newton = Inversion::new(&made, Method::Newton);
        let mut failed = 0;
        for uv in parameters() {
            let [x, y, z] = made.point(uv);
            let found = inversion.cold([x, y]).unwrap_or_else(|e| panic!("{name} at {uv:?}: {e:?}"));
            assert!(found.steps <= 5 && (found.at[2] - z).abs() < 1e-8, "{name} at {uv:?}: {found:?}");
            match newton.cold([x, y]) {
                Ok(found) => assert!((found.at[2] - z).abs() < 1e-8, "{name} at {uv:?}: {found:?}"),
                Err(e) => failed += usize::from(e.off > 1e-9),
            }
        }
        // 81 and 87 % converged in the reference, on random places.
        let is_strong = name.ends_with("warp 1");
        assert_eq!(failed > 0, is_strong, "{name}: full Newton failed on {failed} of 600");
        assert!(failed < 200, "{name}: {failed}");
    }
}

#[test]
fn warm_starts_along_a_spiral_take_two_to_three_steps() {
    for (name, made) in cases().into_iter().filter(|(name, _)| !name.ends_with("warp 0")) {
        let mut inversion = Inversion::new(&made, Method::GaussNewton);
        let mut steps = Vec::new();
        for n in 0..600 {
            let (angle, radius) = (0.02 * f64::from(n), 20.0 * f64::from(n) / 600.0);
            let found = inversion.next([radius * math::cos(angle), radius * math::sin(angle)]);
            steps.push(found.unwrap_or_else(|e| panic!("{name}: {e:?}")).steps);
        }
        let (mean, most) = (steps.iter().sum::<usize>() as f64 / 600.0, *steps[1..].iter().max().expect("some"));
        assert!((1.5..=3.0).contains(&mean) && most <= 4, "{name}: {mean} {most}");
    }
}

#[test]
#[ignore = "slow: make test-all"]
fn weighted_grid_is_off_by_as_much_as_the_reference_and_by_what_its_kernel_smooths() {
    // Of the reference, with the better of its kernels: h, k over h, and the largest error in um, at random places.
    for (h, kernel, worst) in [(0.5, 0.85, 1.436), (0.25, 0.85, 0.392), (0.1, 1.0, 0.0778), (0.05, 1.0, 0.0201)] {
        let found = 1000.0 * grid_error(h, kernel * h);
        assert!((found / worst - 1.0).abs() < 0.1, "h {h}: {found} um, {worst} expected");
        // A kernel as wide as the grid smooths by a quarter of its square times the Laplacian, here at most 0.0340 / mm.
        assert!(kernel < 1.0 || (found / (250.0 * h * h * 0.034) - 1.0).abs() < 0.02, "h {h}: {found} um");
    }
}

/// The largest error of algorithm I, mm, in the inner 40 x 40 mm of the undistorted surface of degree 3, whose heights
/// are known by algorithm II.
fn grid_error(h: f64, kernel: f64) -> f64 {
    const INNER: f64 = 20.0;
    let made = surface(3, 0.0, None);
    let decoupled = Decoupled::of(&made).expect("decoupled");
    let error = |[lo, hi]: [[f64; 2]; 2], step: f64| {
        let area = [lo.map(|v| v - 4.0 * step), hi.map(|v| v + 4.0 * step)];
        let kernel = Some(kernel * (step / h));
        let grid = HeightGrid::of(area, step, kernel, |xy| decoupled.height(xy).expect("a height"));
        let grid = grid.expect("a grid");
        const SIDE: u32 = 211;
        let at = |n: u32, k: usize| lo[k] + (hi[k] - lo[k]) * (f64::from(n) + 0.5) / f64::from(SIDE);
        let all = (0..SIDE * SIDE).map(|n| {
            let xy = [at(n % SIDE, 0), at(n / SIDE, 1)];
            let heights = [grid.height(xy), decoupled.height(xy)].map(|z| z.expect("a height"));
            ((heights[0] - heights[1]).abs(), xy)
        });
        all.max_by(|a, b| a.0.total_cmp(&b.0)).expect("some places")
    };
    let (coarse, at) = error([[-INNER; 2], [INNER; 2]], h.max(0.25));
    if h >= 0.25 {
        return coarse;
    }
    // A fine grid errs most where a coarse one does: the Laplacian is largest there.
    let near = |by: f64| at.map(|v| (v + by).clamp(-INNER, INNER));
    error([near(-1.5), near(1.5)], h).0
}

#[test]
fn weighted_grid_answers_nothing_at_the_rim_and_beside_the_surface() {
    let made = surface(2, 1.0, None);
    let grid = HeightGrid::over(&made, 0.5, None).expect("a grid");
    assert!((grid.kernel() - 0.45).abs() < 1e-15);
    assert!(grid.height([0.3, 0.4]).is_some());
    for beside in [[24.0, 0.0], [-24.5, 3.0], [0.0, 40.0], [f64::NAN, 0.0]] {
        assert_eq!(grid.height(beside), None, "{beside:?}");
    }
    for (step, kernel) in [(0.0, None), (f64::NAN, None), (0.5, Some(-1.0)), (20.0, None), (1e-6, None)] {
        let e = HeightGrid::over(&made, step, kernel).expect_err("no grid");
        assert_eq!(e.diags()[0].code, "nurbs-grid");
    }
}

#[test]
fn fixture_files_are_what_their_formulae_give() {
    let at = |name: &str| fixture("sources/brecher").join(name);
    let write = std::env::var("FIXTURES").is_ok_and(|v| v == "write");
    let same = |name: &str, wanted: Vec<u8>| {
        if write {
            std::fs::write(at(name), &wanted).expect("a writable file");
        }
        assert!(std::fs::read(at(name)).expect("a fixture") == wanted, "{name}: FIXTURES=write makes it again");
    };
    same("dish.nurbs.json", dish().into_bytes());
    same("patch.nurbs.json", patch().into_bytes());
    same("dish.ply", ply(&tessellated(&loaded("dish.nurbs.json"), 64)));
}

/// A surface of the fixture.
fn loaded(name: &str) -> Surface {
    Surface::load(&fixture("sources/brecher").join(name)).unwrap_or_else(|e| panic!("{e}"))
}

#[test]
#[ignore = "slow: make test-all"]
fn heights_of_a_tessellated_surface_lie_within_its_chord_error_of_the_exact_ones() {
    let dir = folder();
    for exact in [loaded("dish.nurbs.json"), loaded("patch.nurbs.json"), surface(3, 0.5, None)] {
        let [coarse, fine] = [8, 32].map(|steps| {
            let file = dir.path().join("part.stl");
            let (corners, facets) = tessellated(&exact, steps);
            let facets: Vec<[[f64; 3]; 3]> = facets.iter().map(|f| f.map(|i| corners[i as usize])).collect();
            write_stl(&file, &facets);
            let allowed = chord_error(&exact, steps);
            let (worst, count) = worst_height(&file, &exact);
            // Single precision and whole nanometres are off by some nanometres more.
            assert!(count > 1000 && worst <= allowed + 5e-6, "{steps}: {worst} of {allowed} mm at {count} places");
            worst
        });
        // A quarter of the step takes a sixteenth of the error.
        assert!((8.0..20.0).contains(&(coarse / fine)), "{coarse} {fine}");
    }
}

/// The largest difference of the heights that the product finds on a mesh from the exact ones, mm, and at how many
/// places.
fn worst_height(mesh: &Path, exact: &Surface) -> (f64, usize) {
    let job = JobText::on(mesh)
        .texture("pattern = \"hatch\"\npitch = \"10 mm\"")
        .write(mesh.parent().expect("a folder"), "part.toml");
    let job = Job::load(&job, &Overrides::default()).unwrap_or_else(|e| panic!("{e}"));
    let inputs = Inputs::load(&job).unwrap_or_else(|e| panic!("{e}"));
    let mut tracer = Tracer::new(&inputs.surface, f64::INFINITY);
    let mut inversion = Inversion::new(exact, Method::GaussNewton);
    let [lo, hi] = exact.hull();
    let nm = |v: f64| (v * 1e6).round() as i64;
    let (mut worst, mut count) = (0.0f64, 0);
    for row in 0..60 {
        let y = lo[1] + (hi[1] - lo[1]) * (f64::from(row) + 0.37) / 60.0;
        let (a, b) = (P2::new(nm(lo[0]), nm(y)), P2::new(nm(hi[0]), nm(y)));
        tracer.segment(a, b, |piece| {
            for t in [piece.t0, 0.5 * (piece.t0 + piece.t1), piece.t1] {
                let xy = [0, 1].map(|k| [a.mm(), b.mm()].map(|p| p[k])).map(|[from, to]| from + t * (to - from));
                if let (None, Ok(found)) = (piece.skip, inversion.next(xy)) {
                    worst = worst.max((piece.z(t) / 1e6 - found.at[2]).abs());
                    count += 1;
                }
            }
        });
    }
    (worst, count)
}

fn inspected(args: &[&str]) -> Value {
    let out = terrace([&["inspect", "--nurbs", "--json"], args].concat());
    assert!(out.status.success(), "{}", said(&out));
    serde_json::from_slice(&out.stdout).expect("JSON")
}

#[test]
#[ignore = "slow: make test-all"]
fn inspect_shows_degrees_convergence_errors_and_operations_of_a_nurbs_surface() {
    let path = |name: &str| fixture("sources/brecher").join(name).display().to_string();
    let found = inspected(&[&path("patch.nurbs.json"), "--grid", "0.2 mm", "--kernel", "0.17 mm"]);
    assert_eq!((&found["degree"], &found["control_points"]), (&json!([2, 2]), &json!([10, 10])));
    assert_eq!(
        (&found["rational"], &found["height_map"], &found["decoupled"]),
        (&json!(true), &json!(true), &json!(false))
    );
    let operations = |key: &str| number(&found["operations"], key);
    assert_eq!(operations("point"), 141.0);
    assert!(
        (operations("algorithm_ii") / 149.0 - 1.0).abs() < 0.1 && (operations("newton_step") / 561.0 - 1.0).abs() < 0.1
    );
    let cold = &found["algorithm_iii"]["cold"];
    assert!(
        number(cold, "converged") == 1600.0 && number(cold, "most_steps") <= 5.0 && number(cold, "worst_um") < 1e-4
    );
    assert_eq!((number(&found["algorithm_i"], "grid_mm"), number(&found["algorithm_i"], "kernel_mm")), (0.2, 0.17));
    // On a grid half as wide errors are a quarter.
    let finer = inspected(&[&path("patch.nurbs.json"), "--grid", "0.1 mm", "--kernel", "0.085 mm"]);
    let error = |found: &Value| number(&found["algorithm_i"], "worst_um");
    assert!((error(&found) / error(&finer) - 4.0).abs() < 1.0, "{} {}", error(&found), error(&finer));
    let dish = inspected(&[&path("dish.nurbs.json")]);
    assert!(dish["decoupled"] == true && number(&dish["algorithm_ii"], "worst_um") < 1e-9, "{dish}");
    for rates in [&found["set_points_per_s"], &dish["set_points_per_s"]] {
        assert!(
            rates["algorithm_i"].as_f64() > Some(0.0) && rates["algorithm_iii_cold"].as_f64() > Some(0.0),
            "{rates}"
        );
    }
    let out = terrace(["inspect", "--nurbs", &path("dish.nurbs.json")]);
    for line in
        ["degrees     3 x 3\n", "decoupled   yes\n", "1600 of 1600 converge, in at most 0 steps", "point 247, I "]
    {
        assert!(said(&out).contains(line), "{line}: {}", said(&out));
    }
}

#[test]
fn nurbs_files_that_cannot_be_read_are_refused_with_their_place() {
    let dir = folder();
    let file = dir.path().join("a.nurbs.json");
    let text = patch();
    for (bad, code, says) in [
        ("{".into(), "nurbs-file", "a.nurbs.json:1"),
        (text.replace("\"mm\"", "\"parsec\""), "nurbs-file", "parsec"),
        (text.replace("\"unit\": \"mm\",", ""), "nurbs-file", "missing field `unit`"),
        (text.replace("\"knots\"", "\"knotes\""), "nurbs-file", "knotes"),
        (text.replace("[2, 2]", "[2, 3]"), "nurbs-surface", "knots along v"),
        (text.replace("[2, 2]", "[-2, 2]"), "nurbs-file", "-2"),
        (text.replacen("0.85", "-0.85", 1), "nurbs-surface", "is not positive"),
    ] {
        std::fs::write(&file, bad).expect("a writable file");
        let out = terrace([Path::new("inspect"), Path::new("--nurbs"), &file]);
        assert!(
            out.status.code() == Some(2) && said(&out).contains(code) && said(&out).contains(says),
            "{says}: {}",
            said(&out)
        );
    }
    std::fs::write(&file, text).expect("a writable file");
    let out = terrace([Path::new("inspect"), Path::new("--nurbs"), &file, Path::new("--grid"), Path::new("1 nm")]);
    assert!(out.status.code() == Some(2) && said(&out).contains("nurbs-grid"), "{}", said(&out));
}
