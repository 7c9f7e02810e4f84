use super::*;
use terrace_core::math;

/// A quarter of a cylinder of radius 10 mm about y, in two spans of u; the second is straight.
fn bent() -> Surface {
    let r = std::f64::consts::FRAC_1_SQRT_2;
    let profile = [([-10.0, 0.0], 1.0), ([-10.0, 10.0], r), ([0.0, 10.0], 1.0), ([4.0, 10.0], 1.0), ([8.0, 10.0], 1.0)];
    let points: Vec<Vec<[f64; 3]>> =
        profile.iter().map(|([x, z], _)| [0.0, 5.0, 20.0].map(|y| [*x, y, *z]).to_vec()).collect();
    let weights: Vec<Vec<f64>> = profile.iter().map(|(_, w)| vec![*w; 3]).collect();
    let u = vec![0.0, 0.0, 0.0, 1.0, 1.0, 2.0, 2.0, 2.0];
    Surface::new([2, 2], [u, vec![0.0, 0.0, 0.0, 3.0, 3.0, 3.0]], &points, Some(&weights)).expect("a surface")
}

#[test]
fn rational_arc_lies_on_its_circle_and_tangents_are_square_to_the_radius() {
    let surface = bent();
    for i in 0..=10 {
        let d = surface.derivatives::<f64, 1>([0.1 * f64::from(i), 1.2]);
        assert!((math::hypot(d[0][0], d[0][2]) - 10.0).abs() < 1e-13, "{d:?}");
        assert!((d[1][0] * d[0][0] + d[1][2] * d[0][2]).abs() < 1e-12, "{d:?}");
    }
    assert_eq!(surface.point([2.0, 3.0]), [8.0, 20.0, 10.0]);
    assert_eq!(surface.point([0.0, 0.0]), [-10.0, 0.0, 0.0]);
}

#[test]
fn derivatives_agree_with_differences() {
    let surface = bent();
    const H: f64 = 1e-4;
    for (u, v) in [(0.3, 0.7), (0.9, 2.9), (1.4, 1.5), (0.05, 0.05)] {
        let d = surface.derivatives::<f64, 2>([u, v]);
        let at = |du: f64, dv: f64| surface.point([u + du * H, v + dv * H]);
        let second = |c: usize, [a, b]: [f64; 2]| (at(a, b)[c] - 2.0 * d[0][c] + at(-a, -b)[c]) / (H * H);
        #[expect(clippy::needless_range_loop, reason = "the same coordinate of six vectors")]
        for c in 0..3 {
            let wanted = [
                (at(1.0, 0.0)[c] - at(-1.0, 0.0)[c]) / (2.0 * H),
                (at(0.0, 1.0)[c] - at(0.0, -1.0)[c]) / (2.0 * H),
                second(c, [1.0, 0.0]),
                (at(1.0, 1.0)[c] - at(1.0, -1.0)[c] - at(-1.0, 1.0)[c] + at(-1.0, -1.0)[c]) / (4.0 * H * H),
                second(c, [0.0, 1.0]),
            ];
            for (k, wanted) in wanted.into_iter().enumerate() {
                assert!((d[k + 1][c] - wanted).abs() < 2e-5, "{u} {v}: {k} {c}: {} {wanted}", d[k + 1][c]);
            }
        }
    }
}

#[test]
fn heights_of_a_cylinder_are_those_of_its_circle_and_none_is_found_beside_it() {
    let surface = bent();
    // Full Newton steps go astray from afar.
    for (method, astray) in [(Method::GaussNewton, &[][..]), (Method::Newton, &[-9.5, -7.0])] {
        let mut inversion = Inversion::new(&surface, method);
        let mut lost = Vec::new();
        for x in [-9.5, -7.0, -2.0, -0.5] {
            let Ok(found) = inversion.next([x, 8.0]) else {
                lost.push(x);
                continue;
            };
            assert!((found.at[2] - (100.0f64 - x * x).sqrt()).abs() < 1e-8, "{method:?} {x}: {found:?}");
        }
        assert_eq!(lost, astray, "{method:?}");
        for beside in [[-10.5, 8.0], [8.001, 8.0], [0.0, -0.1], [1.0, 25.0], [f64::NAN, 1.0]] {
            assert!(inversion.cold(beside).is_err(), "{method:?} {beside:?}");
            assert!(inversion.next(beside).is_err(), "{method:?} {beside:?}");
        }
        // The last good point is still where the next begins.
        assert_eq!(inversion.next([-0.5, 8.0]).map(|found| found.steps), Ok(0));
    }
}

#[test]
fn surfaces_that_do_not_fit_are_refused() {
    let square = || vec![vec![[0.0, 0.0, 0.0], [0.0, 1.0, 0.0]], vec![[1.0, 0.0, 0.0], [1.0, 1.0, 0.0]]];
    let flat = vec![0.0, 0.0, 1.0, 1.0];
    let new = |degree, u: &[f64], points: &[Vec<[f64; 3]>], weights: Option<Vec<Vec<f64>>>| {
        Surface::new([degree, 1], [u.to_vec(), flat.clone()], points, weights.as_deref())
    };
    assert!(new(1, &flat, &square(), None).is_ok());
    let mut ragged = square();
    ragged[1].pop();
    let mut far = square();
    far[0][1][2] = f64::NAN;
    for (made, said) in [
        (new(0, &flat, &square(), None), "degree 0 along u"),
        (new(2, &flat, &square(), None), "2 control points along u are too few for degree 2"),
        (new(1, &flat[..3], &square(), None), "3 knots along u, but 2 points of degree 1 take 4"),
        (new(1, &[0.0, 1.0, 0.5, 1.0], &square(), None), "knots along u do not ascend"),
        (new(1, &[0.0, f64::NAN, 1.0, 1.0], &square(), None), "knots along u do not ascend"),
        (new(1, &[0.0; 4], &square(), None), "no range"),
        (new(1, &[0.0, 0.5, 0.5, 0.5], &square(), None), "no range"),
        (new(1, &flat, &ragged, None), "row 1 of points"),
        (new(1, &flat, &far, None), "point 0, 1 is not within 10 m"),
        (new(1, &flat, &square(), Some(vec![vec![1.0; 2]])), "weights are not as many"),
        (new(1, &flat, &square(), Some(vec![vec![1.0, 0.0], vec![1.0; 2]])), "weight 0, 1 is not positive"),
        (new(1, &flat, &square(), Some(vec![vec![1.0, 1e7], vec![1.0; 2]])), "weight 0, 0 is 1, the largest 10000000"),
        (new(1, &flat, &[], None), "0 control points"),
        (new(1, &[1e7, 1e7, 1e7 + 1.0, 1e7 + 1.0], &square(), None), "beyond 1e6 times the range"),
        (new(1, &[-1e308, -1e308, 1e308, 1e308], &square(), None), "beyond 1e6 times the range"),
        (new(1, &[-1e-12, 0.0, 1.0, 1.0], &square(), None), "differ by less than 1e-9"),
    ] {
        let e = made.expect_err(said);
        assert!(e.diags()[0].code == "nurbs-surface" && e.to_string().contains(said), "{said}: {e}");
    }
}

#[test]
fn weights_count_by_their_ratios_alone() {
    let weights = |by: f64| [vec![1.0, 0.5], vec![2.0, 1.0]].map(|row| row.iter().map(|w| w * by).collect()).to_vec();
    let points = [[[0.0; 3], [0.0, 1.0, 2.0]].to_vec(), [[1.0, 0.0, 5.0], [1.0, 1.0, 0.0]].to_vec()];
    let flat = || vec![0.0, 0.0, 1.0, 1.0];
    let of = |by: f64| Surface::new([1, 1], [flat(), flat()], &points, Some(&weights(by))).expect("a surface");
    let near = of(1.0).point([0.3, 0.6]);
    for by in [1e-300, 1e-6, 1e300] {
        let far = of(by).point([0.3, 0.6]);
        assert!((0..3).all(|k| (near[k] - far[k]).abs() < 1e-14), "{by}: {near:?} {far:?}");
    }
}

#[test]
fn end_of_range_belongs_to_the_last_span_that_has_a_width() {
    // Not clamped: the range ends inside the knots, at a double knot.
    let points: Vec<Vec<[f64; 3]>> =
        (0..4).map(|i| (0..2).map(|j| [f64::from(i), f64::from(j), f64::from(i * i)]).collect()).collect();
    let knots = [vec![0.0, 1.0, 2.0, 3.0, 3.0, 4.0, 5.0], vec![0.0, 0.0, 1.0, 1.0]];
    let surface = Surface::new([2, 1], knots, &points, None).expect("a surface");
    assert_eq!(surface.range()[0], [2.0, 3.0]);
    for u in [2.0, 2.5, 3.0] {
        let d = surface.derivatives::<f64, 2>([u, 1.0]);
        assert!(d.iter().flatten().all(|v| v.is_finite()), "{u}: {d:?}");
    }
    let [near, end] = [3.0 - 1e-9, 3.0].map(|u| surface.point([u, 0.5]));
    assert!((near[2] - end[2]).abs() < 1e-7, "{near:?} {end:?}");
}
