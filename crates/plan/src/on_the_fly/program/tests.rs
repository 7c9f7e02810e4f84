use super::*;
use terrace_core::geom::{P3, Part};
use terrace_core::machine::{Carries, Machine, Origin, TiltAngles};
use terrace_core::math;
use terrace_core::program::{Stroke, sample};
use terrace_core::units::Length;

fn strokes() -> OrderedStrokes {
    let mut strokes = OrderedStrokes::of_program(&sample::program().0);
    strokes.strokes.truncate(1);
    strokes.strokes[0] = Stroke { source: StrokeId(7), segment: 0, reversed: false, pen: PenId(1), first: 0, len: 2 };
    strokes
}

fn motion(nodes: impl Iterator<Item = (f64, [f64; AXES])>) -> Motion {
    let of = |(i, (time, axes)): (usize, _)| Waypoint {
        time,
        axes,
        pen: (i % 8 > 2).then_some(PenId(1)),
        stroke: PieceId(0),
    };
    Motion { waypoints: nodes.enumerate().map(of).collect() }
}

/// Seven axes that all turn and move.
fn turning(step: f64) -> Motion {
    motion((0..400).map(|i| {
        let t = f64::from(i) * step;
        let (x, y, z) = (20.0 * math::sin(t), 15.0 * math::cos(1.3 * t), 2.0 * math::sin(t));
        (t, [x, y, z, 0.3 * math::sin(0.7 * t), t, math::sin(9.0 * t), math::cos(8.0 * t)])
    }))
}

/// Where a sample marks, by arithmetic of the test: the table turned back about its pivot, then the origin.
fn marked(machine: &Machine, origin: Origin, at: &AxisCommands) -> [f64; 3] {
    let mm = |k: usize| at[k] as f64 / 1e6;
    let table = machine.tilt.as_ref().expect("a table");
    let sign = |k: usize| machine.axes()[k].1.sign() as f64;
    let mirror = |m: bool| if m { -1.0 } else { 1.0 };
    let (mut u, mut v) = (mm(5) * mirror(machine.scanner.mirror_x), mm(6) * mirror(machine.scanner.mirror_y));
    if machine.scanner.swap_xy {
        (u, v) = (v, u);
    }
    let p = [sign(0) * mm(0) + u, sign(1) * mm(1) + v, sign(2) * mm(2)];
    let turn = table.turn(TiltAngles([at[3], at[4]]), origin);
    let back = turn.back(P3::new([0, 1, 2].map(|k| p[k] * 1e6 - origin[k] as f64))).at;
    back.map(|v| v / 1e6)
}

#[test]
fn program_reproduces_motion_for_any_axis_signs() {
    let origin = Origin([3_000_001, -4_000_000, 25_000_000]);
    for variant in 0..16u32 {
        let bit = |k: u32| variant >> k & 1 == 1;
        let mut machine = Machine::built_in("xyzac-galvo-10").expect("profile");
        machine.stage.x.carries = if bit(0) { Carries::Head } else { Carries::Part };
        machine.stage.z.reversed = bit(1);
        machine.scanner.swap_xy = bit(2);
        machine.scanner.mirror_x = bit(3);
        let table = machine.tilt.as_mut().expect("a table");
        table.pivot = [Length::mm(1.0), Length::mm(-2.0), Length::mm(-30.0)];
        table.axes[0].reversed = bit(1);
        table.axes[1].reversed = bit(2);
        let motion = turning(0.00137);
        let (program, _) = Program::of(&motion, &strokes(), &machine, origin, Kind::Xyzacuv).expect("a program");
        // At every time of the program the mark is within what the module says of the motion's line.
        let mut node = 0;
        for (us, from, to) in program.steps() {
            for share in [0.0, 0.25, 0.5, 0.75, 1.0] {
                let at = std::array::from_fn(|k| from[k] + (share * (to.to[k] - from[k]) as f64).round() as i64);
                let at = AxisCommands(at);
                let is = marked(&machine, origin, &at);
                let t = (us as f64 + share * (to.us - us) as f64) * 1e-6;
                while node + 2 < motion.waypoints.len() && motion.waypoints[node + 1].time < t {
                    node += 1;
                }
                let spots = [node, node + 1].map(|i| {
                    let [x, y, z, a, c, u, v] = motion.waypoints[i].axes;
                    turned_back::<Part>(a, c, P3Mm::new([x + u, y + v, z]))
                });
                let way = [0, 1, 2].map(|k| spots[1][k] - spots[0][k]);
                let off = [0, 1, 2].map(|k| is[k] - spots[0][k]);
                let length2: f64 = way.iter().map(|v| v * v).sum();
                let along = (0..3).map(|k| way[k] * off[k]).sum::<f64>() / length2;
                let beside = (0..3).map(|k| (off[k] - along.clamp(0.0, 1.0) * way[k]).powi(2)).sum::<f64>().sqrt();
                if to.mark.is_some() {
                    assert!(beside * 1e6 < 60.0, "{variant} {t}: {} nm", beside * 1e6);
                }
                node = node.saturating_sub(1);
            }
        }
    }
}

#[test]
fn wide_steps_are_cut_where_they_bow_and_straight_runs_are_joined() {
    let machine = Machine::built_in("xyzac-galvo-10").expect("profile");
    let (wide, _) =
        Program::of(&turning(0.02), &strokes(), &machine, Origin::default(), Kind::Xyzacuv).expect("a program");
    assert!(wide.moves.len() > 1000, "{}", wide.moves.len());
    let straight = motion((0..400).map(|i| {
        let t = f64::from(i) * 1e-3;
        (t, [30.0 * t, 0.0, 1.0, 0.0, 0.0, 70.0 * t, 0.0])
    }));
    let machine = Machine::built_in("xyz-galvo-40").expect("profile");
    let (program, _) = Program::of(&straight, &strokes(), &machine, Origin::default(), Kind::Xyzuv).expect("a program");
    // One move for each change of the pen.
    assert_eq!(program.moves.len(), 2 * 399usize.div_ceil(8), "{:?}", program.moves.len());
    let mark = program.moves[1].mark.expect("a mark");
    assert_eq!((mark.pen, mark.source, mark.piece), (PenId(1), StrokeId(7), PieceId(0)));
    assert_eq!(program.total_s(), 0.399);
}

#[test]
fn times_do_not_drift_and_the_stage_is_where_it_is_at_the_rounded_time() {
    let machine = Machine::built_in("xyz-galvo-40").expect("profile");
    // 0.4 us apart where they are closest.
    let motion = motion((0..500).map(|i| {
        let t = 1.0 + f64::from(i) * if i < 100 { 0.4e-6 } else { 33.3e-6 };
        (t, [100.0 * (t - 1.0), math::sin(90.0 * t), 0.0, 0.0, 0.0, 50.0 * (t - 1.0), 0.1 * math::cos(900.0 * t)])
    }));
    let (program, _) = Program::of(&motion, &strokes(), &machine, Origin::default(), Kind::Xyzuv).expect("a program");
    assert!(program.steps().all(|(us, _, to)| to.us > us));
    let total = motion.total_s() - 1.0;
    assert!((program.total_s() - total).abs() <= 0.5e-6, "{} {total}", program.total_s());
    let (last, moves) = program.moves.split_last().expect("moves");
    assert!((last.to[0] + (100e6 * total) as i64).abs() <= 1, "{last:?}");
    for m in moves {
        // The table carries the part: it runs the other way.
        assert!((m.to[0] + 100 * m.us).abs() <= 1, "{m:?}");
    }
}

#[test]
fn invalid_motions_are_refused() {
    let machine = Machine::built_in("xyz-galvo-40").expect("profile");
    let sound = || motion((0..20).map(|i| (f64::from(i), [f64::from(i); AXES])));
    let refused = |change: fn(&mut Motion), kind| {
        let mut motion = sound();
        motion.waypoints.iter_mut().for_each(|w| (w.axes[3], w.axes[4]) = (0.0, 0.0));
        change(&mut motion);
        Program::of(&motion, &strokes(), &machine, Origin::default(), kind).map_err(|e| e.diags()[0].code).err()
    };
    assert_eq!(refused(|_| {}, Kind::Xyzuv), None);
    assert_eq!(refused(|_| {}, Kind::Xyzacuv), Some("fly-axes"));
    let changes: [fn(&mut Motion); 6] = [
        |m| m.waypoints[3].time = 1.0,
        |m| m.waypoints[3].time = f64::NAN,
        |m| m.waypoints[3].axes[0] = f64::INFINITY,
        |m| m.waypoints[3].axes[0] = 4001.0,
        |m| m.waypoints[3].axes[4] = 0.1,
        |m| m.waypoints[4].stroke = PieceId(1),
    ];
    for change in changes {
        assert_eq!(refused(change, Kind::Xyzuv), Some("fly-motion"));
    }
}

#[test]
fn stage_below_its_least_speed_stands_still_and_the_scanner_compensates() {
    let mut machine = Machine::built_in("xyz-galvo-40").expect("profile");
    machine.scanner.swap_xy = true;
    machine.scanner.mirror_y = true;
    // 1 um/s, and the scanner to and fro.
    let motion = motion((0..2000).map(|i| {
        let t = f64::from(i) * 1e-3;
        (t, [1e-3 * t, -5e-4 * t, 0.0, 0.0, 0.0, math::sin(90.0 * t), math::cos(70.0 * t)])
    }));
    let (program, _) = Program::of(&motion, &strokes(), &machine, Origin::default(), Kind::Xyzuv).expect("a program");
    let spot = program.spots(&machine).expect("axes");
    for (us, from, to) in program.steps() {
        let way: f64 = (0..3).map(|k| ((to.to[k] - from[k]) as f64).powi(2)).sum::<f64>().sqrt();
        assert!(way == 0.0 || way >= CREEP * (to.us - us) as f64, "{to:?}");
        let t = to.us as f64 * 1e-6;
        let meant = [1e-3 * t + math::sin(90.0 * t), -5e-4 * t + math::cos(70.0 * t)];
        let is = spot(&to.to).part;
        assert!((0..2).all(|k| (is[k] - meant[k]).abs() < 2e-6), "{is:?} {meant:?}");
    }
    assert!(program.steps().any(|(_, from, to)| from[0] != to.to[0]));
}

#[test]
fn short_moves_keep_the_pens_speed_to_the_microsecond_and_the_spot_is_not_late() {
    let machine = Machine::built_in("xyz-galvo-40").expect("profile");
    // Circles of 360 chords of 5.3 us each at the pen's own speed, while the stage runs on.
    let (radius, speed) = (0.1214, 400.0);
    let chord = 2.0 * radius * math::sin(0.5f64.to_radians());
    let circles = |slower: f64| {
        let of = |i: u32| {
            let (angle, time) = (f64::from(i).to_radians(), f64::from(i) * slower * chord / speed);
            let (x, y) = (radius * math::cos(angle), radius * math::sin(angle));
            let axes = [50.0 * time, 0.0, 0.0, 0.0, 0.0, x - 50.0 * time, y];
            Waypoint { time, axes, pen: (i > 0).then_some(PenId(1)), stroke: PieceId(0) }
        };
        Motion { waypoints: (0..3600).map(of).collect() }
    };
    let mut slower = 1.0;
    for _ in 0..8 {
        let motion = circles(slower);
        let (program, late) =
            Program::of(&motion, &strokes(), &machine, Origin::default(), Kind::Xyzuv).expect("a program");
        let spot = program.spots(&machine).expect("axes");
        for (us, from, to) in program.steps() {
            let way = spot(from).way(&spot(&to.to));
            assert!(way - ROUNDING <= speed * (to.us - us) as f64 * 1e-6 * (1.0 + 1e-9), "{to:?}");
        }
        if late <= 1.0 {
            let total = motion.total_s();
            assert!((program.total_s() - total).abs() <= (LATE + 1.0) * 1e-6, "{} {total}", program.total_s());
            assert!(slower > 1.0 && slower < 1.2, "{slower}");
            return;
        }
        slower *= 1.0 + 1.05 * (late - 1.0) + 1e-6;
    }
    panic!("the spot stays late");
}

#[test]
fn a_corner_is_cut_by_what_the_spot_lies_off_its_other_leg() {
    let [before, corner, after] = [[-1.0, 0.0, 0.0], [0.0; 3], [0.0, 2.0, 0.0]].map(P3Mm::new);
    assert_eq!(corner_cut(before, corner, after, P3Mm::new([0.0, 0.5, 0.0])), 0.5);
    assert_eq!(corner_cut(before, corner, after, corner), 0.0);
    assert_eq!(corner_cut(before, corner, P3Mm::new([3.0, 0.0, 0.0]), P3Mm::new([0.5, 0.0, 0.0])), 0.0, "no corner");
    assert!(corner_cut(before, corner, corner, corner).is_nan(), "a spot at rest");
}
