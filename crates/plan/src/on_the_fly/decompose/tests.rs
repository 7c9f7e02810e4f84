use super::sample::{self, Part};
use super::*;
use crate::on_the_fly::axes::kinematics::{Axes, Branch, Branches, Deviation, Pivot, Pose, follow};
use crate::on_the_fly::topp::{self, Limit, Options, time_optimal};
use crate::on_the_fly::xyzuv::Peaks;
use terrace_core::machine::Machine;
use terrace_core::math;

/// A bent path with corners, 2 coordinates.
fn wandering() -> Vec<[f64; 2]> {
    (0..3000)
        .map(|i| f64::from(i) * 0.1)
        .map(|s| [s + 3.0 * math::sin(s / 7.0), 400.0 - ((s % 40.0) - 20.0).abs()])
        .collect()
}

const METHODS: [Method<2>; 3] = [
    Method::MovingAverage { samples: 201 },
    Method::Gaussian { sigma: 60.0 },
    Method::LeastAcceleration { half: [2.0, 5.0] },
];

#[test]
fn stage_and_scanner_sum_to_the_path() {
    let path = wandering();
    for method in METHODS {
        let parts = decompose(&path, method);
        assert_eq!(parts.stage.len(), path.len());
        for ((x, s), g) in path.iter().zip(&parts.stage).zip(&parts.scanner) {
            assert!((0..2).all(|k| (s[k] + g[k] - x[k]).abs() < 1e-12), "{method:?}");
        }
        assert!(rms_acceleration(&parts.stage, 1e-3) < 0.5 * rms_acceleration(&path, 1e-3), "{method:?}");
    }
}

#[test]
fn every_method_reverses_with_the_path_and_leaves_a_line_alone_inside() {
    let path = wandering();
    let back: Vec<[f64; 2]> = path.iter().rev().copied().collect();
    let line: Vec<[f64; 2]> = (0..3000).map(|i| [0.1 * f64::from(i), 7.0 - 0.02 * f64::from(i)]).collect();
    for method in METHODS {
        let there = stage(&path, method);
        let again = stage(&back, method);
        let near = if matches!(method, Method::LeastAcceleration { .. }) { 1e-4 } else { 1e-9 };
        for (a, b) in there.iter().zip(again.iter().rev()) {
            assert!((0..2).all(|k| (a[k] - b[k]).abs() < near), "{method:?}: {a:?} {b:?}");
        }
        for (a, b) in stage(&line, method).iter().zip(&line).skip(400).take(2200) {
            assert!((0..2).all(|k| (a[k] - b[k]).abs() < 1e-9), "{method:?}: {a:?} {b:?}");
        }
    }
}

#[test]
fn short_paths_and_no_strength_change_nothing() {
    for n in 0..6usize {
        let path: Vec<[f64; 1]> = (0..n).map(|i| [(i * i) as f64]).collect();
        for method in [
            Method::MovingAverage { samples: 1 },
            Method::MovingAverage { samples: 0 },
            Method::Gaussian { sigma: 0.0 },
            Method::Gaussian { sigma: f64::NAN },
        ] {
            let got = stage(&path, method);
            assert!(got.len() == n && got.iter().zip(&path).all(|(a, b)| (a[0] - b[0]).abs() < 1e-12), "{method:?}");
        }
        assert_eq!(stage(&path, Method::MovingAverage { samples: 99 }).len(), n);
    }
}

// --- Moving average

/// One corner in the middle: velocity jumps by `jump` along x.
fn corner(jump: f64, step_s: f64) -> Vec<[f64; 1]> {
    (-1000..=1000).map(|i| [0.5 * jump * step_s * f64::from(i).abs()]).collect()
}

#[test]
fn a_velocity_jump_becomes_the_acceleration_and_the_reach_of_the_closed_forms() {
    let step = 1e-3;
    for jump in [200.0, 189.736_659_610_102_75, 3.0] {
        for p in [3usize, 11, 39, 201, 801] {
            let parts = decompose(&corner(jump, step), Method::MovingAverage { samples: p });
            let inner = 600..1401;
            let acceleration = inner
                .clone()
                .map(|i| {
                    (parts.stage[i - 1][0] - 2.0 * parts.stage[i][0] + parts.stage[i + 1][0]).abs() / (step * step)
                })
                .fold(0.0, f64::max);
            let want = jump / (p as f64 * step);
            assert!((acceleration - want).abs() < 1e-6 * want, "{jump} {p}: {acceleration} for {want}");
            let reach = peak(&parts.scanner[inner])[0];
            let want = jump * ((p * p - 1) as f64) * step / (8.0 * p as f64);
            assert!((reach - want).abs() < 1e-9, "{jump} {p}: {reach} for {want}");
        }
    }
}

#[test]
fn number_of_samples_follows_from_the_velocity_jump() {
    for (jump, most, want) in
        [(200.0, 1000.0, 201), (200.0, 5000.0, 41), (189.74, 1000.0, 191), (189.74, 5000.0, 39), (0.0, 1000.0, 1)]
    {
        assert_eq!(samples_for_jump(jump, 1e-3, most), want);
    }
}

/// 21 lines of 100 mm in turns, 1 mm apart, at 0.1 mm.
fn raster() -> Vec<[f64; 2]> {
    let line = |k: u32, s: f64| {
        let along = s.min(100.0);
        [if k.is_multiple_of(2) { along } else { 100.0 - along }, f64::from(k) + (s - 100.0).max(0.0)]
    };
    (0..21).flat_map(|k| (0..1010).map(move |i| line(k, 0.1 * f64::from(i)))).collect()
}

/// A triangle wave of ±15 mm and 20 mm period along 200 mm, at 0.1 mm of its length.
fn triangle() -> Vec<[f64; 2]> {
    (0..6325)
        .map(|i| {
            let x = 0.1 * f64::from(i) / 10f64.sqrt();
            let round = (x / 20.0).fract();
            [x, 15.0 * if round < 0.5 { 4.0 * round - 1.0 } else { 3.0 - 4.0 * round }]
        })
        .collect()
}

#[test]
fn moving_average_matches_the_reference_signals() {
    let stored = sample::stored("sync.json");
    let number = |v: &serde_json::Value| v.as_f64().expect("number");
    for (name, path) in [("raster", raster()), ("triangle", triangle())] {
        let cases = stored["cases"].as_array().expect("cases");
        let case = cases.iter().find(|c| c["name"] == name).expect("case");
        assert_eq!(case["N"], path.len());
        for row in case["table"].as_array().expect("table") {
            let samples = row["p"].as_u64().expect("p") as usize;
            let parts = decompose(&path, Method::MovingAverage { samples });
            let (x, y) = (peak(&parts.scanner), number(&row["scan"]));
            assert!((x[0].max(x[1]) - y).abs() < 1e-8, "{name} {samples}: {x:?} for {y}");
        }
        for row in case["select"].as_array().expect("select") {
            let (most, field) = (number(&row["amax"]), number(&row["fov"]));
            let got = choose_average(&path, 1e-3, most, [field; 2]);
            assert_eq!(got.is_ok(), row["feasible"] == true, "{name} {most} {field}");
            let average = match got {
                Ok(average) => average,
                Err(Infeasible { average, axis, half_field, speed_share }) => {
                    assert!(average.reach[axis] > half_field && half_field == field);
                    assert!((speed_share - (field / average.reach[axis]).sqrt()).abs() < 1e-12);
                    average
                }
            };
            assert_eq!(average.samples as u64, row["p_min"].as_u64().expect("p"), "{name} {most}");
            assert!((average.acceleration - number(&row["a"])).abs() < 1e-4, "{name} {most}");
            assert!((average.reach[0].max(average.reach[1]) - number(&row["scan"])).abs() < 1e-8, "{name} {most}");
        }
    }
}

#[test]
fn corner_fits_the_field_at_the_suggested_speed() {
    let (field, most) = ([2.0], 1000.0);
    let Err(Infeasible { speed_share, .. }) = choose_average(&corner(200.0, 1e-3), 1e-3, most, field) else {
        panic!("5 mm do not fit 2 mm");
    };
    let slower = corner(200.0 * 0.99 * speed_share, 1e-3);
    assert!(choose_average(&slower, 1e-3, most, field).is_ok());
    // Any acceleration can be met, if the field is wide.
    let even = choose_average(&raster(), 1e-3, 1e-3, [1e3; 2]).expect("the mean over all moves evenly");
    assert!(even.acceleration <= 1e-3 && even.samples > raster().len());
}

#[test]
fn running_mean_does_not_accumulate_rounding() {
    let path: Vec<[f64; 1]> = (0..200_000).map(|i| [400.0 + 30.0 * math::sin(0.37 * f64::from(i))]).collect();
    let got = stage(&path, Method::MovingAverage { samples: 501 });
    for i in [250, 100_000, 199_700] {
        let mean = path[i - 250..=i + 250].iter().map(|x| x[0]).sum::<f64>() / 501.0;
        assert!((got[i][0] - mean).abs() < 1e-12, "{i}");
    }
}

// --- Other filters

#[test]
fn filters_damp_a_wave_by_their_transfer_functions() {
    let wave = |length: f64| -> Vec<[f64; 1]> {
        (0..20_001).map(|i| [math::cos(std::f64::consts::TAU * (f64::from(i) - 10_000.0) / length)]).collect()
    };
    // The middle sample of a cosine is its amplitude.
    let left = |length: f64, method: Method<1>| stage(&wave(length), method)[10_000][0];
    for length in [100.0, 317.0, 1000.0] {
        let w = std::f64::consts::TAU / length;
        let gauss = math::exp(-0.5 * (50.0 * w).powi(2));
        assert!((left(length, Method::Gaussian { sigma: 50.0 }) - gauss).abs() < 2e-4);
        let mean = math::sin(50.5 * w) / (101.0 * math::sin(0.5 * w));
        assert!((left(length, Method::MovingAverage { samples: 101 }) - mean).abs() < 1e-12);
    }
}

#[test]
#[ignore = "slow: make test-all"]
fn least_acceleration_stays_in_the_corridor_and_beats_every_filter() {
    let path = wandering();
    let half = [2.0, 5.0];
    let step = 1e-3;
    let holds = |method: Method<2>| {
        let parts = decompose(&path, method);
        let reach = peak(&parts.scanner);
        (rms_acceleration(&parts.stage, step), (0..2).all(|k| reach[k] <= half[k]))
    };
    let (best, held) = holds(Method::LeastAcceleration { half });
    assert!(held);
    for family in FAMILIES {
        let found = largest(1500.0, 0.95, 3.0, 0.5, |strength| holds(family.at(strength))).expect("some strength");
        assert!(best < found.found, "{family:?}: {best} against {}", found.found);
    }
}

const FAMILIES: [Family; 2] = [Family::MovingAverage, Family::Gaussian];

// --- Strength, on the seven-axis part

const ARTICLE: Limits = Limits { half_depth: 0.1, angle: 10.0 * std::f64::consts::PI / 180.0, field: 5.0 };

#[test]
#[ignore = "slow: make test-all"]
fn smoothing_strengths_match_the_reference_of_the_seven_axis_part() {
    let part = Part::stored();
    let plan = part.hilbert();
    let marks = part.poses(&plan);
    let at = |sigma_um: f64| {
        let smooth = stage(&plan, Family::Gaussian.at(sigma_um / 1000.0 / part.pitch()));
        let worst = Deviation::worst(&marks, part.poses(&smooth));
        (worst, ARTICLE.hold(worst))
    };
    let trials = back_off(30_000.0, 0.95, 1.0, at);
    // Strength in µm of arc, and the worst offset of focus, incidence and displacement.
    let stored = part.json["back_off"].as_array().expect("trials");
    assert_eq!(trials.len(), stored.len());
    for (trial, want) in trials.iter().zip(stored) {
        let near = |got: f64, k: usize| (got - want[k].as_f64().expect("number")).abs() < 1e-9 * got.max(1.0);
        let d = trial.found;
        assert!(near(trial.strength, 0), "{trial:?}");
        assert!(near(d.defocus, 1) && near(d.angle.to_degrees(), 2) && near(d.lateral, 3), "{trial:?} {want}");
    }
    let last = trials.last().expect("trials");
    assert!(last.holds && (last.strength - 13_203.8).abs() < 0.05);
    let failed = trials[trials.len() - 2].strength;
    let edge = refine(last.strength, failed, 0.1, at).expect("holds nearer to the boundary");
    assert!((edge.found.defocus - 0.1).abs() < 1e-5, "{edge:?}");
    let above = edge.strength / last.strength - 1.0;
    assert!((above - 0.041).abs() < 0.003, "{above}");
    let (d, _) = at(13_750.0);
    assert!((d.lateral / 1.837 - 1.0).abs() < 0.08, "{d:?}");
}

#[test]
#[ignore = "slow: make test-all"]
fn seven_axis_least_acceleration_keeps_limits_and_beats_every_filter() {
    let part = Part::stored();
    let plan = part.hilbert();
    let marks = part.poses(&plan);
    let step = 1e-3;
    let rms = |axes: &[Axes]| rms_acceleration(&axes.iter().map(|x| x.xyz.mm).collect::<Vec<_>>(), step);
    let turns = |axes: &[Axes]| rms_acceleration(&axes.iter().map(|x| [x.a, x.c]).collect::<Vec<_>>(), step);
    let on_part = |axes: &[Axes]| rms_acceleration(&axes.iter().map(|x| x.tool().p.mm).collect::<Vec<_>>(), step);
    let (mut best, mut best_on_part, mut quickest) = (f64::INFINITY, f64::INFINITY, f64::INFINITY);
    for family in FAMILIES {
        let attempt = |mm: f64| {
            let tools = part.poses(&stage(&plan, family.at(mm / part.pitch())));
            let held = ARTICLE.hold(Deviation::worst(&marks, tools.iter().copied()));
            (tools, held)
        };
        let found = largest(100.0, 0.95, 1.0, 0.05, attempt).expect("some strength holds");
        for branches in [Branches::Only(Branch::Positive), Branches::Quickest { a: 0.36, c: 3.0 }] {
            let axes = follow(&found.found, branches);
            let (stage, part) = (rms(&axes), on_part(&axes));
            let (mm, time) = (found.strength, least_time(&plan, &marks, &axes));
            eprintln!(
                "{family:?} {mm:.2} mm {branches:?}: X Y Z {stage:.1}, on the part {part:.1}, A C {:.2}; {time:.1} s",
                turns(&axes)
            );
            quickest = quickest.min(time);
            best = best.min(stage);
            best_on_part = best_on_part.min(part);
        }
    }
    let axes = seven_axes(&marks, &[], ARTICLE);
    let worst = Deviation::worst(&marks, axes.iter().map(Axes::tool));
    let (stage, part) = (rms(&axes), on_part(&axes));
    eprintln!("least: X Y Z {stage:.1}, on the part {part:.1}, A C {:.2}; {worst:?}", turns(&axes));
    let time = least_time(&plan, &marks, &axes);
    eprintln!("ratios {:.4} and {:.4}; {time:.1} s, filters {quickest:.1} s", stage / best, part / best_on_part);
    assert!(ARTICLE.hold(worst), "{worst:?}");
    assert!(stage <= 0.8 * best, "{stage} of {best}");
    // Nor is it the turntable alone that whirls less.
    assert!(part <= 0.8 * best_on_part, "{part} of {best_on_part}");
    // And all seven axes need no more time.
    assert!(time <= quickest, "{time} s, {quickest} s");
}

/// The least time of all seven axes under the article's limits, jerks read as per millisecond; they stop at corners.
fn least_time(plan: &[[f64; 2]], marks: &[Pose<Pivot>], axes: &[Axes]) -> f64 {
    let limit = |speed, acceleration, jerk| Limit { speed, acceleration, jerk: Some(jerk) };
    let [xy, z] = [limit(35.0, 100.0, 1e4), limit(24.0, 83.0, 8e3)];
    let [a, c, uv] = [limit(0.36, 1.99, 200.0), limit(3.0, 3.74, 370.0), limit(3e3, 2e4, 1e6)];
    let positions: Vec<f64> = axes
        .iter()
        .zip(marks)
        .flat_map(|(x, m)| {
            let [u, v] = x.seen(m.p).uv;
            [x.xyz[0], x.xyz[1], x.xyz[2], x.a, x.c, u, v]
        })
        .collect();
    let step = math::hypot(plan[1][0] - plan[0][0], plan[1][1] - plan[0][1]);
    let s: Vec<f64> = (0..plan.len()).map(|i| step * i as f64).collect();
    let turns = |w: &[[f64; 2]]| (0..2).any(|k| (w[2][k] - 2.0 * w[1][k] + w[0][k]).abs() > 1e-9);
    let stops: Vec<usize> = plan.windows(3).enumerate().filter(|(_, w)| turns(w)).map(|(i, _)| i + 1).collect();
    let path = topp::Path { positions: &positions, s: &s, caps: &vec![1e9; s.len() - 1], stops: &stops };
    time_optimal(&path, &[xy, xy, z, a, c, uv, uv], &Options::default()).expect("a sound path").total_s()
}

#[test]
fn flat_part_needs_no_rotation_and_zero_limits_follow_the_path() {
    let plan: Vec<[f64; 2]> = wandering();
    let flat = on_surface(&plan, |_, _| (3.0, 0.0, 0.0));
    let axes = seven_axes(&flat, &[], ARTICLE);
    assert!(axes.iter().all(|x| x.a.abs() < 0.18 && x.c == axes[0].c));
    assert!(ARTICLE.hold(Deviation::worst(&flat, axes.iter().map(Axes::tool))));
    let tight = Limits { half_depth: 0.0, angle: 0.0, field: 0.0 };
    let bent = on_surface(&plan, |x, y| (0.001 * x * y, 0.001 * y, 0.001 * x));
    let worst = Deviation::worst(&bent, seven_axes(&bent, &[], tight).iter().map(Axes::tool));
    assert!(worst.defocus < 1e-9 && worst.angle < 1e-7 && worst.lateral < 1e-9, "{worst:?}");
    assert!(seven_axes(&[], &[], ARTICLE).is_empty() && seven_axes(&bent[..1], &[], ARTICLE).len() == 1);
}

#[test]
#[ignore = "slow: make test-all"]
fn least_acceleration_beats_every_filter_on_a_hatched_dome() {
    // 24 lines of 450 mm in turns, 1 mm apart, over the top of a dome of 10 mm, at 100 mm/s; 40 mm of field, 0.07 mm
    // of depth.
    let half = [20.0, 20.0, 0.035];
    let dome = |x: f64, y: f64| 10.0 * (1.0 - (x * x + y * y) / (2.0 * 225.0 * 225.0));
    let (step_mm, step) = (0.25, 2.5e-3);
    let path: Vec<[f64; 3]> = (0..24)
        .flat_map(|k| (0..1804).map(move |i| (k, step_mm * f64::from(i))))
        .map(|(k, s)| {
            let x = (s.min(450.0) - 225.0) * if k % 2 == 0 { 1.0 } else { -1.0 };
            let y = f64::from(k) - 12.0 + (s - 450.0).max(0.0);
            [x, y, dome(x, y)]
        })
        .collect();
    let parts = decompose(&path, Method::LeastAcceleration { half });
    let reach = peak(&parts.scanner);
    assert!((0..3).all(|k| reach[k] <= half[k]), "{reach:?}");
    // What the axes can do, and so the same time for all that keep to it: that of the beam.
    let limits = Peaks::limits(&Machine::built_in("xyz-galvo-40").expect("a profile"));
    let follows =
        |of: &[[f64; 1]], k: usize| Peaks::of(of, 0, step).slowed(&Peaks { jerk: f64::INFINITY, ..limits[k] }) <= 1.0;
    // Filters may smooth each axis as strongly as that axis bears; where it bears nothing the stage does it all.
    let (mut best, mut least) = ([0.0; 3], [0.0; 3]);
    for k in 0..3 {
        let one: Vec<[f64; 1]> = path.iter().map(|x| [x[k]]).collect();
        best[k] = rms_acceleration(&one, step);
        for family in FAMILIES {
            let attempt = |strength: f64| {
                let parts = decompose(&one, family.at(strength));
                let slow = follows(&parts.stage, k);
                ((rms_acceleration(&parts.stage, step), slow), peak(&parts.scanner)[0] <= half[k])
            };
            if let Some(found) = largest(1500.0, 0.9, 3.0, 0.5, attempt) {
                let (rms, follows) = found.found;
                eprintln!("dome, {k}, {family:?} {:.1} samples: {rms:.1} mm/s2, follows: {follows}", found.strength);
                best[k] = f64::min(best[k], rms);
            }
        }
        let one: Vec<[f64; 1]> = parts.stage.iter().map(|x| [x[k]]).collect();
        least[k] = rms_acceleration(&one, step);
        eprintln!("dome, axis {k}: {:.1} against {:.1} mm/s2", least[k], best[k]);
        assert!(least[k] <= best[k]);
        assert!(follows(&one, k), "axis {k} must be slowed down");
    }
    let whole = |x: [f64; 3]| x.iter().map(|a| a * a).sum::<f64>().sqrt();
    eprintln!("dome, ratio {:.4}, time {:.1} s", whole(least) / whole(best), path.len() as f64 * step);
    assert!(whole(least) <= 0.8 * whole(best), "{least:?} of {best:?}");
}

#[test]
#[ignore = "slow: make test-all"]
fn speed_limited_corridor_equals_plain_corridor_if_limits_are_inactive() {
    let path: Vec<f64> = raster().iter().map(|x| x[0]).collect();
    let ends: Vec<[f64; 2]> = path.iter().map(|x| [x - 5.0, x + 5.0]).collect();
    let average: Vec<[f64; 1]> =
        stage(&path.iter().map(|x| [*x]).collect::<Vec<_>>(), Method::MovingAverage { samples: 195 });
    let start: Vec<f64> = average.iter().map(|x| x[0]).collect();
    let peaks = |x: &[f64]| Peaks::of(&x.iter().map(|x| [*x]).collect::<Vec<_>>(), 0, 1.0);
    let rms = |x: &[f64]| rms_acceleration(&x.iter().map(|x| [*x]).collect::<Vec<_>>(), 1.0);
    let most = [peaks(&start).speed, peaks(&start).acceleration].map(|p| 1.001 * p);
    let paced = paced(&start, &ends, most);
    let free = within(path.clone(), &[], &ends);
    let found = peaks(&paced);
    assert!(found.speed <= most[0] && found.acceleration <= most[1], "{found:?} {most:?}");
    assert!(paced.iter().zip(&ends).all(|(x, [lo, hi])| (*lo..=*hi).contains(x)));
    assert!(peaks(&free).speed > most[0], "the free one runs faster than the beam");
    assert!(
        rms(&paced) < 0.97 * rms(&start) && rms(&free) < rms(&paced),
        "{} {} {}",
        rms(&start),
        rms(&paced),
        rms(&free)
    );
    let open = super::paced(&start, &ends, [f64::INFINITY; 2]);
    assert!((rms(&open) / rms(&free) - 1.0).abs() < 1e-3, "{} {}", rms(&open), rms(&free));
}

#[test]
fn the_bend_of_a_parabola_is_the_same_on_uneven_nodes() {
    let s: Vec<f64> = (0..400).map(|i| f64::from(i) * 0.1 + 0.03 * f64::from(i % 3)).collect();
    let steps: Vec<f64> = s.windows(2).map(|w| w[1] - w[0]).collect();
    let at: Vec<[f64; 2]> = s.iter().map(|s| [1.5 * s * s, 7.0 - 2.0 * s * s]).collect();
    assert!((rms_bend(&at, &steps) - 5.0).abs() < 1e-6, "{}", rms_bend(&at, &steps));
}
