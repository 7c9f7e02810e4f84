use super::*;
use terrace_core::motion::rest_to_rest;

const STAGE: Limit = Limit { speed: 35.0, acceleration: 100.0, jerk: Some(10_000.0) };
const FINE: Options = Options { refine: 4, least_cells: 16, gain: 1e-3 };

/// A path of its own.
struct Owned {
    positions: Vec<f64>,
    s: Vec<f64>,
    caps: Vec<f64>,
    stops: Vec<usize>,
}

impl Owned {
    fn new(nodes: usize, step: f64, axes: impl Fn(f64) -> Vec<f64>) -> Self {
        let s: Vec<f64> = (0..nodes).map(|i| step * i as f64).collect();
        let positions = s.iter().flat_map(|&s| axes(s)).collect();
        Self { positions, s, caps: vec![1e9; nodes - 1], stops: Vec::new() }
    }

    fn line(segments: usize, length: f64) -> Self {
        Self::new(segments + 1, length / segments as f64, |s| vec![s])
    }

    /// Two slow axes along a wavy line, and a fast one that swings.
    fn wave(nodes: usize) -> Self {
        Self::new(nodes, 0.1, |s| vec![0.9 * s, 4.0 * math::sin(s / 5.0), 0.4 * math::cos(s / 0.9)])
    }

    fn path(&self) -> Path<'_> {
        Path { positions: &self.positions, s: &self.s, caps: &self.caps, stops: &self.stops }
    }

    fn timed(&self, limits: &[Limit], options: &Options) -> TimedPath {
        time_optimal(&self.path(), limits, options).expect("a sound path")
    }
}

fn three() -> [Limit; 3] {
    [STAGE, STAGE, Limit { speed: 500.0, acceleration: 2000.0, jerk: Some(2e5) }]
}

fn close(a: f64, b: f64, share: f64) -> bool {
    (a - b).abs() <= share * b.abs()
}

#[test]
fn straight_runs_take_the_time_of_rest_to_rest_exactly() {
    for limit in [
        STAGE,
        Limit { jerk: None, ..STAGE },
        Limit { speed: 1e9, ..STAGE },
        Limit { speed: 2.0, acceleration: 1e3, jerk: Some(1e4) },
    ] {
        for length in [0.001, 0.157, 3.0, 40.0] {
            let timed = Owned::line(3, length).timed(&[limit], &Options::default());
            assert_eq!(timed.report().straight, 1);
            let want = rest_to_rest(length, limit.speed, limit.acceleration, limit.jerk);
            assert!(close(timed.total_s(), want, 1e-12), "{length}: {} {want}", timed.total_s());
            // At a third of the way the closed form is there when its motion says so.
            let t = timed.node_times().nth(1).expect("a node");
            let mut state = State::default();
            timed.at(t, &mut 0, &mut state);
            assert!((state.s - length / 3.0).abs() < 1e-9 * length);
        }
    }
}

/// A straight run by the general way.
fn solved(segments: usize, length: f64, limit: Limit, options: &Options) -> Report {
    let line = Owned::line(segments, length);
    general(&line.path(), &[limit], options, 0, segments, &vec![0.0; segments]).report
}

#[test]
fn discretised_time_converges_to_the_closed_form() {
    for limit in [STAGE, Limit { jerk: None, ..STAGE }] {
        for length in [0.157, 3.0, 40.0] {
            let want = rest_to_rest(length, limit.speed, limit.acceleration, limit.jerk);
            let off = |segments, refine| {
                let r = solved(segments, length, limit, &Options { refine, ..Options::default() });
                assert!(r.ratio.jerk <= 1.0 + 1e-6 && r.ratio.acceleration <= 1.0 + 1e-6, "{r:?}");
                (r.total_s / want - 1.0).abs()
            };
            for segments in [1, 2, 10, 100] {
                assert!(off(segments, 1) < 0.015, "{length} mm, {segments}: {}", off(segments, 1));
                assert!(off(segments, 2) < 0.01, "{length} mm, {segments} x2: {}", off(segments, 2));
            }
            assert!(off(1, 8) < 2e-3, "{length} mm x8: {}", off(1, 8));
        }
    }
}

#[test]
fn motion_keeps_every_limit_when_it_is_sampled() {
    let limits = three();
    let timed = Owned::wave(400).timed(&limits, &Options::default());
    let r = *timed.report();
    assert!(r.ratio.speed.max(r.ratio.acceleration).max(r.ratio.jerk) <= 1.0 + TOLERANCE, "{r:?}");
    assert!(r.total_s > r.without_jerk_s, "{r:?}");
    let (dt, mut hint, mut state) = (1e-4, 0, State::default());
    let mut last: Option<State> = None;
    for i in 0..=(r.total_s / dt) as usize {
        timed.at(dt * i as f64, &mut hint, &mut state);
        for (a, l) in limits.iter().enumerate() {
            assert!(state.velocity[a].abs() <= l.speed * 1.001, "axis {a} at {}", state.s);
            assert!(state.acceleration[a].abs() <= l.acceleration * 1.002, "axis {a} at {}", state.s);
        }
        if let Some(l) = &last {
            assert!(state.s >= l.s);
            for (a, limit) in limits.iter().enumerate() {
                // Positions and velocities belong together.
                let moved = (state.position[a] - l.position[a]) / dt;
                let mean = 0.5 * (state.velocity[a] + l.velocity[a]);
                assert!((moved - mean).abs() < 0.1 * dt * limit.acceleration, "axis {a} at {}", state.s);
            }
        }
        last = Some(state.clone());
    }
}

#[test]
fn coarse_cells_keep_accelerations_between_their_borders_and_middles() {
    // Wavy axes with few nodes a period: over a cell the acceleration of an axis goes from limit to limit.
    for jerk in [None, Some(10_000.0)] {
        let limits = [Limit { jerk, ..STAGE }; 3];
        for step in [0.4, 0.8, 1.2] {
            let wave = Owned::new(60, step, |s| vec![0.9 * s, 4.0 * math::sin(s / 5.0), 0.4 * math::cos(s / 0.9)]);
            let report = *wave.timed(&limits, &Options::default()).report();
            assert_eq!(report.stretch, 1.0, "no run is slowed down as a whole: {report:?}");
            assert!(report.ratio.acceleration <= 1.0 + TOLERANCE, "{report:?}");
        }
    }
}

#[test]
fn nodes_are_passed_at_their_times() {
    let mut wave = Owned::wave(300);
    wave.stops = vec![100, 101, 150];
    let timed = wave.timed(&three(), &Options::default());
    let (mut hint, mut state, mut before) = (0, State::default(), -1.0);
    assert_eq!(timed.node_times().len(), 300);
    for (i, (t, rate)) in timed.node_times().zip(timed.node_rates()).enumerate() {
        assert!(t > before, "node {i}");
        before = t;
        timed.at(t, &mut hint, &mut state);
        assert!((0..3).all(|a| (state.position[a] - wave.positions[3 * i + a]).abs() < 1e-9), "node {i}");
        assert_eq!(rate == 0.0, [0, 100, 101, 150, 299].contains(&i), "node {i}: {rate}");
    }
    assert_eq!(timed.report().runs, 4);
}

#[test]
fn a_path_driven_backwards_takes_as_long() {
    let there = Owned::wave(400);
    let end = there.s[399];
    let back = Owned::new(400, 0.1, |s| {
        let s = end - s;
        vec![0.9 * s, 4.0 * math::sin(s / 5.0), 0.4 * math::cos(s / 0.9)]
    });
    let (a, b) = (there.timed(&three(), &Options::default()), back.timed(&three(), &Options::default()));
    assert!(close(a.total_s(), b.total_s(), 2e-3), "{} {}", a.total_s(), b.total_s());
}

#[test]
#[ignore = "slow: make test-all"]
fn finer_cells_change_the_time_less_and_less() {
    let wave = Owned::wave(200);
    let time = |refine| wave.timed(&three(), &Options { refine, ..FINE }).total_s();
    let [x1, x4, x8] = [1, 4, 8].map(time);
    assert!(close(x4, x8, 5e-3) && close(x1, x8, 0.03), "{x1} {x4} {x8}");
}

#[test]
fn caps_hold_on_their_segments() {
    let mut wave = Owned::wave(300);
    wave.caps[120..140].fill(3.0);
    let timed = wave.timed(&three(), &Options::default());
    let rates: Vec<f64> = timed.node_rates().collect();
    assert!(rates[120..=140].iter().all(|&r| r <= 3.0 + 1e-9) && rates[60] > 3.0 && rates[200] > 3.0, "{rates:?}");
}

#[test]
#[ignore = "slow: make test-all"]
fn node_rates_do_not_depend_on_the_number_of_windows() {
    // One window against several: what lies ahead by more than a stop's way changes nothing.
    let rates = |nodes| -> Vec<f64> { Owned::wave(nodes).timed(&three(), &Options::default()).node_rates().collect() };
    let (one, several) = (rates(1400), rates(4000));
    for (i, (several, one)) in several.iter().zip(&one).take(1300).enumerate() {
        assert!(close(*several, *one, 0.02), "node {i}: {several} {one}");
    }
}

#[test]
fn result_is_bit_identical_for_any_number_of_threads() {
    let mut wave = Owned::wave(1500);
    wave.stops = vec![1200, 1210, 1300];
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        let timed = pool.install(|| wave.timed(&three(), &Options::default()));
        [&timed.time, &timed.s, &timed.rate].map(|list| list.iter().map(|v| v.to_bits()).collect::<Vec<_>>())
    };
    assert!(run(1) == run(3));
}

#[test]
fn inconsistent_paths_are_refused() {
    let line = Owned::line(3, 1.0);
    let refused = |path: Path, limits: &[Limit]| time_optimal(&path, limits, &Options::default()).is_err();
    assert!(!refused(line.path(), &[STAGE]));
    assert!(refused(line.path(), &[STAGE, STAGE]));
    assert!(refused(line.path(), &[Limit { jerk: Some(0.0), ..STAGE }]));
    assert!(refused(Path { s: &[0.0, 1.0, 1.0, 2.0], ..line.path() }, &[STAGE]));
    assert!(refused(Path { caps: &[1.0, 0.0, 1.0], ..line.path() }, &[STAGE]));
    assert!(refused(Path { stops: &[2, 1], ..line.path() }, &[STAGE]));
    assert!(refused(Path { positions: &[0.0, 1.0, f64::NAN, 2.0], ..line.path() }, &[STAGE]));
}

/// A Hilbert curve's point by index, on a grid of unit pitch.
fn hilbert(order: u32, index: u32) -> [f64; 2] {
    let (mut x, mut y, mut rest) = (0, 0, index);
    for level in 0..order {
        let (rx, side) = (1 & (rest / 2), 1 << level);
        let ry = 1 & (rest ^ rx);
        if ry == 0 {
            if rx == 1 {
                (x, y) = (side - 1 - x, side - 1 - y);
            }
            (x, y) = (y, x);
        }
        (x, y) = (x + side * rx, y + side * ry);
        rest /= 4;
    }
    [f64::from(x), f64::from(y)]
}

#[test]
#[ignore = "slow: make test-all"]
fn time_of_a_planar_hilbert_curve_matches_the_reference() {
    // Order 8 over 40 mm, one run, no jerk, sixteen cells a segment: 55.29 min.
    let pitch = 40.0 / 255.0;
    let path = Owned::new(65_536, pitch, |s| hilbert(8, (s / pitch).round() as u32).map(|v| v * pitch).to_vec());
    let stage = Limit { jerk: None, ..STAGE };
    let timed = path.timed(&[stage; 2], &Options { refine: 16, ..Options::default() });
    let minutes = timed.total_s() / 60.0;
    assert!(close(minutes, 55.2895, 0.03), "{minutes} {:?}", timed.report());
}
