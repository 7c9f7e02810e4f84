//! NURBS surfaces: the three algorithms of Brecher et al. against reference figures, which were computed independently
//! (`fixtures/anchors/nurbs.json`); `terrace inspect --nurbs`; heights of tessellated surfaces against the exact ones.

use serde_json::Value;
use terrace::nurbs::{Counted, Decoupled, HeightGrid, Inversion, Method, Scalar, Surface, counted};

use crate::support::fixture;
use crate::support::nurbs::{HALF, height, knots, net, surface};

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
        [(0.0, None), (0.5, None), (1.0, Some(weights.as_slice()))]
            .map(|(strength, weights)| (format!("degree {degree}, warp {strength}"), surface(degree, strength, weights)))
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
            let found = inversion.next([radius * angle.cos(), radius * angle.sin()]);
            steps.push(found.unwrap_or_else(|e| panic!("{name}: {e:?}")).steps);
        }
        let (mean, most) = (steps.iter().sum::<usize>() as f64 / 600.0, *steps[1..].iter().max().expect("some"));
        assert!((1.5..=3.0).contains(&mean) && most <= 4, "{name}: {mean} {most}");
    }
}

#[test]
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
