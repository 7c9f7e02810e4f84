use super::*;
use crate::on_the_fly::axes::kinematics::{Branch, Branches};
use crate::on_the_fly::axes::motion::AXES;
use crate::on_the_fly::decompose::{Method, sample, stage};
use crate::on_the_fly::path::NodeKind;
use crate::on_the_fly::stop_at_every_point::stop_at_every_point;
use terrace_core::geom::{P3Mm, UnitVector};
use terrace_core::machine::Machine;
use terrace_core::math;
use terrace_core::motion::rest_to_rest;
use terrace_core::program::{Pen, PenId, PieceId};
use terrace_core::units::{Frequency, Power, Speed};

const WIDE: Limits = Limits { half_depth: 0.2, angle: 0.3, field: 5.0 };

fn pens(speed: f64) -> Vec<Pen> {
    let (power, frequency) = (Power::Percent(50.0), Frequency::khz(60.0));
    vec![Pen { name: "a".into(), speed: Speed::mm_s(speed), power, frequency, passes: 1, dwell: None }]
}

/// The first points of the article's curve on its part, and the stage over them at sigma 13,750 um. With `every` a node
/// at every point, else at corners alone.
fn ma(count: usize, every: bool) -> UntimedAxes {
    let part = sample::Part::stored();
    let plan: Vec<[f64; 2]> = part.hilbert()[..count].to_vec();
    let sigma = part.json["sigma_points"].as_f64().expect("sigma");
    let axes = follow(&part.poses(&stage(&plan, Method::Gaussian { sigma })), Branches::Only(Branch::Positive));
    let turns = |i: usize| {
        let [a, b, c] = [i - 1, i, i + 1].map(|i| plan[i]);
        ((b[0] - a[0]) * (c[1] - b[1]) - (b[1] - a[1]) * (c[0] - b[0])).abs() > 1e-6
    };
    let kind = |i: usize| match i {
        0 => NodeKind::End,
        _ if i + 1 == count => NodeKind::End,
        _ if turns(i) => NodeKind::Corner,
        _ => NodeKind::Vertex,
    };
    let mut out = UntimedAxes {
        back_off: BackOff::new(),
        strength: Some(13.75),
        path: Path::default(),
        axes: Vec::new(),
        marks: Vec::new(),
        tools: ToolPath::Gaussian { sigma: 13.75 },
        rewinds: Vec::new(),
        limits: WIDE,
    };
    for i in (0..count).filter(|&i| every || kind(i) != NodeKind::Vertex) {
        let mark = part.pose(plan[i]);
        let pen = (i > 0).then_some(PenId(0));
        out.path.nodes.push(Node { at: P3Mm::new(mark.p.mm), pen, kind: kind(i), stroke: PieceId(0), run: None });
        out.axes.push(axes[i]);
        out.marks.push(mark);
    }
    out
}

/// What U and V have to go from node to node.
fn ways(made: &UntimedAxes, model: &KinematicModel<'_>) -> Vec<[f64; 2]> {
    let at = |i: usize, axes: &Axes| axes.seen(model.from_pivot(made.path.nodes[i].at)).uv;
    (1..made.path.len())
        .map(|i| {
            let [a, c] = [0, 1].map(|k| at(i - 1 + k, &made.axes[i - 1 + k]));
            [c[0] - a[0], c[1] - a[1]]
        })
        .collect()
}

#[test]
fn spot_rests_at_corners_while_the_stage_goes_on_within_all_limits() {
    let machine = Machine::built_in("xyzac-galvo-10").expect("a profile");
    let pens = pens(100.0);
    let model = KinematicModel::of(&machine, &pens, [0.0; 3]).expect("seven axes");
    let made = ma(1024, false).timed(&model, 1).expect("a motion");
    assert!(WIDE.hold(made.worst()), "{:?}", made.worst());
    let times = made.times();
    let total = made.total_s();
    let mut reader = made.read(&model);
    let mut at = |t: f64| {
        let Instant { axes, field: [u, v], .. } = reader.at(t.clamp(0.0, total));
        let [x, y, z] = axes.xyz.mm;
        [x, y, z, axes.a, axes.c, u, v]
    };
    // By differences over as long as the checks of programs take.
    let (h, j) = (5e-3, 1e-2);
    let mut worst = [[0.0f64; 3]; AXES];
    let mut t = -0.03;
    while t < total + 0.03 {
        let [p, q, r] = [0.0, h, 2.0 * h].map(|d| at(t + d));
        let [b, c, d] = [j, 2.0 * j, 3.0 * j].map(|d| at(t + d));
        for k in 0..AXES {
            worst[k][0] = worst[k][0].max((q[k] - p[k]).abs() / h);
            worst[k][1] = worst[k][1].max((r[k] - 2.0 * q[k] + p[k]).abs() / (h * h));
            worst[k][2] = worst[k][2].max((d[k] - 3.0 * (c[k] - b[k]) - p[k]).abs() / (j * j * j));
        }
        t += 1.3e-3;
    }
    for (k, (limit, [speed, acceleration, jerk])) in model.all_limits().iter().zip(worst).enumerate() {
        let shares = [speed / limit.speed, acceleration / limit.acceleration, jerk / limit.jerk.expect("a jerk")];
        assert!(shares.iter().all(|share| *share <= 1.001), "axis {k}: {shares:?}");
    }
    // At a corner the spot is where it should be, and rests on the part; the stage does not.
    let mut moving = 0;
    for (i, &[t, _]) in times.iter().enumerate().skip(1).take(times.len() - 2) {
        let is = at(t);
        let [_, _, _, _, _, u, v] = model.values(&made.axes[i], made.path.nodes[i].at);
        assert!((is[5] - u).abs() < 1e-7 && (is[6] - v).abs() < 1e-7, "{i}: {is:?} {u} {v}");
        let [before, after] = [at(t - 1e-4), at(t + 1e-4)];
        moving += usize::from((0..5).any(|k| (after[k] - before[k]).abs() / 2e-4 > 1e-3 * model.limits[k].speed));
    }
    assert!(moving > times.len() * 9 / 10, "{moving} of {}", times.len());
}

#[test]
fn scanner_takes_r_of_l_from_corner_to_corner_and_is_faster_with_more_jerk() {
    let mut machine = Machine::built_in("xyzac-galvo-10").expect("a profile");
    let pens = pens(100.0);
    let of = |machine: &Machine, every: bool, rests| {
        let model = KinematicModel::of(machine, &pens, [0.0; 3]).expect("seven axes");
        let made = ma(1024, every);
        let (alone, in_step) = made.in_step_s(&model, rests).expect("times");
        (alone, in_step, ways(&made, &model))
    };
    let limits = |machine: &Machine| KinematicModel::of(machine, &pens, [0.0; 3]).expect("seven axes").spot;
    let (alone, total, ways) = of(&machine, true, Rests::EveryPoint);
    let total = total.expect("it converges");
    let limit = limits(&machine).expect("limits");
    let time = |l: f64| rest_to_rest(l, limit.speed, limit.acceleration, limit.jerk);
    let settle = machine.delays.jump.as_s();
    let sum: f64 = ways.iter().map(|[u, v]| time(u.abs().max(v.abs()))).sum();
    // The stage stands half-way while the spot goes; here it has gone on from node to node.
    assert!(((alone - settle) / sum - 1.0).abs() < 0.01, "{alone} {sum}");
    assert!(total >= alone && total < 1.02 * alone, "{total} {alone}");
    let (corners, at_corners, _) = of(&machine, false, Rests::Corners);
    assert!(corners < 0.9 * alone && at_corners.is_some_and(|t| t < total), "{corners} {at_corners:?}");
    // Five times the jerk: limited by it alone, the cube root of that.
    machine.scanner.jerk = Some("5e6 mm/s3".parse().expect("a jerk"));
    let (faster, faster_total, _) = of(&machine, true, Rests::EveryPoint);
    assert!(((faster - settle) / (alone - settle) * math::cbrt(5f64) - 1.0).abs() < 0.01, "{faster} {alone}");
    assert!(faster_total.is_some_and(|t| t < 0.7 * total), "{faster_total:?}");
    // Without stated limits the scanner is always at speed, and its delays count.
    (machine.scanner.acceleration, machine.scanner.jerk) = (None, None);
    assert_eq!(limits(&machine), None);
    let (at_speed, _, _) = of(&machine, true, Rests::EveryPoint);
    let way = *ma(1024, true).path.distances().last().expect("a path");
    let delays = settle + machine.delays.mark.as_s() + 1022.0 * machine.delays.polygon.as_s();
    assert!(at_speed > way / 100.0 + delays - 1e-6 && at_speed < 1.1 * way / 100.0 + delays, "{at_speed}");
}

#[test]
#[ignore = "slow: make test-all"]
fn times_of_the_articles_part_match_the_reference() {
    let mut machine = Machine::built_in("xyzac-galvo-10").expect("a profile");
    let pens = pens(100.0);
    let (every, corners) = (ma(1 << 16, true), ma(1 << 16, false));
    let minutes = |machine: &Machine, made: &UntimedAxes, rests| {
        let model = KinematicModel::of(machine, &pens, [0.0; 3]).expect("seven axes");
        let (alone, in_step) = made.in_step_s(&model, rests).expect("times");
        let got = [alone, in_step.expect("it converges")].map(|s| s / 60.0);
        eprintln!("{rests:?}: {got:?} min");
        got
    };
    let near = |got: f64, want: f64, share: f64| assert!((got / want - 1.0).abs() < share, "{got} for {want}");
    let [alone, total] = minutes(&machine, &every, Rests::EveryPoint);
    near(alone, 18.25, 0.005);
    near(total, 18.34, 0.005);
    let [alone, in_step] = minutes(&machine, &corners, Rests::Corners);
    near(alone, 15.53, 0.005);
    near(in_step, 16.1, 0.01);
    // A stage at an even pace takes next to nothing, with its jerk limited besides.
    let even = {
        let model = KinematicModel::of(&machine, &pens, [0.0; 3]).expect("seven axes");
        corners.clone().timed(&model, 1).expect("a motion").total_s() / 60.0
    };
    assert!(even < 0.99 * in_step && even >= alone, "{even}");
    let times = sample::stored("axis_times.json");
    let nodes: Vec<[f64; 2]> = {
        let model = KinematicModel::of(&machine, &pens, [0.0; 3]).expect("seven axes");
        every.axes.iter().zip(&every.path.nodes).map(|(a, n)| model.values(a, n.at)).map(|v| [v[5], v[6]]).collect()
    };
    let limit = KinematicModel::of(&machine, &pens, [0.0; 3]).expect("seven axes").spot.expect("limits");
    let want = times["jerk x 1000"]["galvo_only_min"].as_f64().expect("minutes");
    near(stop_at_every_point(&nodes, &[limit; 2]).total_s / 60.0, want, 1e-6);
    machine.scanner.jerk = Some("5e6 mm/s3".parse().expect("a jerk"));
    near(minutes(&machine, &every, Rests::EveryPoint)[0], 10.7, 0.01);
}

#[test]
fn marks_with_skywriting_run_at_the_speed_of_their_pen_from_end_to_end() {
    let machine = Machine::built_in("xyzac-galvo-10").expect("a profile");
    let pens = pens(100.0);
    let model = KinematicModel::of(&machine, &pens, [0.0; 3]).expect("seven axes");
    // Two lines there and back and a square, under a stage that rests.
    let mut path = Path::default();
    let mut stroke = |number: u32, points: &[[f64; 2]]| {
        for (i, [x, y]) in points.iter().enumerate() {
            let kind = if i == 0 || i + 1 == points.len() { NodeKind::End } else { NodeKind::Corner };
            let pen = (i > 0).then_some(PenId(0));
            path.nodes.push(Node { at: P3Mm::new([*x, *y, 0.0]), pen, kind, stroke: PieceId(number), run: None });
        }
    };
    stroke(0, &[[-2.0, 0.0], [2.0, 0.0]]);
    stroke(1, &[[2.0, 1.0], [-2.0, 1.0]]);
    stroke(2, &[[-1.0, -1.0], [1.0, -1.0], [1.0, -2.0]]);
    let made = |skywriting: bool| {
        let path = model.with_run_ups(&path, &[skywriting]);
        let marks = path.nodes.iter().map(|node| Pose { p: model.from_pivot(node.at), n: UnitVector::UP }).collect();
        let axes = vec![Axes { xyz: P3Mm::new([0.0; 3]), a: 0.0, c: 0.0 }; path.len()];
        let tools = ToolPath::Gaussian { sigma: 1.0 };
        let (back_off, rewinds) = (BackOff::new(), Vec::new());
        let all = UntimedAxes { back_off, strength: None, path, axes, marks, tools, rewinds, limits: WIDE };
        all.timed(&model, 1).expect("a motion")
    };
    // Speeds of the first and of the last tenth of a mm of every mark.
    let speeds = |made: &TimedAxes| {
        let mut reader = made.read(&model);
        let mut out = Vec::new();
        let lit = |i: usize| made.path.pen_at(i).is_some();
        for (i, [comes, leaves]) in made.times().into_iter().enumerate() {
            let end = if lit(i + 1) { leaves } else { comes };
            if lit(i) != lit(i + 1) {
                let to = end + if lit(i) { -1e-3 } else { 1e-3 };
                let [a, b] = [end.min(to), end.max(to)].map(|t| reader.at(t).field);
                out.push(math::hypot(b[0] - a[0], b[1] - a[1]) / 1e-3);
            }
        }
        out
    };
    let [plain, skywriting] = [false, true].map(made);
    assert!(speeds(&plain).iter().all(|v| *v < 20.0), "{:?}", speeds(&plain));
    assert_eq!(speeds(&skywriting).len(), 6);
    assert!(speeds(&skywriting).iter().all(|v| (v - 100.0).abs() < 0.5), "{:?}", speeds(&skywriting));
    // What is marked is the same.
    let lit = |made: &TimedAxes| {
        made.path.nodes.iter().filter(|node| node.pen.is_some()).map(|node| node.at).collect::<Vec<_>>()
    };
    assert_eq!(lit(&plain), lit(&skywriting));
    assert!(made(true).path.len() > path.len() && model.with_run_ups(&path, &[false]).nodes == path.nodes);
}

#[test]
fn cells_are_cut_into_four_parts_at_most_for_the_jerk() {
    assert_eq!([0.0, FINE, 1.01 * FINE, 3.5 * FINE, 100.0 * FINE].map(parts_of_cell), [1, 1, 2, 4, 4]);
}
