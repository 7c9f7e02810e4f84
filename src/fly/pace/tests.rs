use super::*;
use crate::motion::rest_to_rest;

const STAGE: Limit = Limit { speed: 35.0, acceleration: 100.0, jerk: Some(10_000.0) };

fn line(n: usize, length: f64) -> (Vec<f64>, Vec<f64>, Vec<f64>) {
    let s: Vec<f64> = (0..=n).map(|i| length * i as f64 / n as f64).collect();
    (s.clone(), s, vec![1e9; n])
}

#[test]
fn closed_form_equals_rest_to_rest_and_its_motion_keeps_the_limits() {
    for limit in [
        STAGE,
        Limit { jerk: None, ..STAGE },
        Limit { speed: 1e9, ..STAGE },
        Limit { speed: 2.0, acceleration: 1e3, jerk: Some(1e4) },
    ] {
        for length in [0.001, 0.157, 3.0, 40.0] {
            let (q, s, caps) = line(3, length);
            let path = Path { positions: &q, s: &s, caps: &caps, stops: &[] };
            let timed = time_optimal(&path, &[limit], &Options::default()).expect("a path");
            assert_eq!(timed.report().straight, 1);
            let want = rest_to_rest(length, limit.speed, limit.acceleration, limit.jerk);
            assert!((timed.total_s() - want).abs() < 1e-12 * want.max(1.0), "{length}: {} {want}", timed.total_s());
        }
    }
}

/// The same straight run with its fast path hidden.
fn solved(n: usize, length: f64, limit: Limit, options: &Options) -> Report {
    let (q, s, caps) = line(n, length);
    let path = Path { positions: &q, s: &s, caps: &caps, stops: &[] };
    let bends = vec![0.0; n];
    let course = Course::lay(&path, &[limit], options, 0, n, &bends);
    let mut b = reach::greatest(&course);
    let rounds = if limit.jerk.is_some() { jerk::smooth(&course, &mut b, options) } else { 0 };
    let total_s = *course.times(&b).last().expect("cells");
    Report { total_s, rounds, cells: course.cells(), ratio: course.ratio(&b), ..Report::default() }
}

#[test]
fn straight_runs_converge_to_rest_to_rest() {
    for length in [0.157, 3.0, 40.0] {
        for limit in [STAGE, Limit { jerk: None, ..STAGE }] {
            let want = rest_to_rest(length, limit.speed, limit.acceleration, limit.jerk);
            for (n, refine) in [(1, 1), (1, 2), (1, 4), (10, 1), (10, 2), (100, 1), (400, 1)] {
                let r = solved(n, length, limit, &Options { refine, ..Options::default() });
                eprintln!(
                    "{length} n {n} x{refine} jerk {:?}: {:.6} want {want:.6} rel {:+.4} rounds {} cells {} {:?}",
                    limit.jerk,
                    r.total_s,
                    r.total_s / want - 1.0,
                    r.rounds,
                    r.cells,
                    r.ratio
                );
            }
        }
    }
}
