use super::*;
use crate::on_the_fly::program::{AxisCommands, Mark, Move};
use terrace_core::machine::Origin;
use terrace_core::math;
use terrace_core::program::{Pen, PenId, PieceId, StrokeId};
use terrace_core::units::{Frequency, Power, Speed};

fn machine() -> Machine {
    Machine::built_in("xyz-galvo-40").expect("profile")
}

/// A mark of 10 mm at 100 mm/s by the scanner, and the jump back; the stage at rest.
fn program() -> Program {
    let pen = Pen {
        name: "fine".into(),
        speed: Speed::mm_s(100.0),
        power: Power::Percent(50.0),
        frequency: Frequency::khz(60.0),
        passes: 1,
        dwell: None,
    };
    let mark = Some(Mark { pen: PenId(0), source: StrokeId(0), piece: PieceId(0) });
    let moves = (1..=100i64).map(|i| Move { us: i * 1000, to: AxisCommands([0, 0, 0, 0, 0, i * 100_000, 0]), mark });
    let back = Move { us: 110_000, to: AxisCommands::default(), mark: None };
    Program {
        kind: Kind::Xyzuv,
        pens: vec![pen],
        origin: Origin::default(),
        start: AxisCommands::default(),
        moves: moves.chain([back]).collect(),
    }
}

fn codes(change: impl FnOnce(&mut Program, &mut Machine)) -> Vec<&'static str> {
    let (mut program, mut machine) = (program(), machine());
    change(&mut program, &mut machine);
    Checked::new(program, &machine, false).map_or_else(|e| e.diags().iter().map(|d| d.code).collect(), |_| Vec::new())
}

#[test]
fn valid_program_passes_with_its_figures() {
    assert_eq!(codes(|_, _| {}), Vec::<&str>::new());
    let machine = machine();
    let checked = Checked::new(program(), &machine, false).expect("sound");
    let f = checked.figures();
    assert_eq!((f.time_s, f.marks, f.shortest_us), (0.11, 1, 1000));
    assert!((f.mark_s - 0.1).abs() < 1e-12 && (f.mark_mm - 10.0).abs() < 1e-9 && (f.jump_mm - 10.0).abs() < 1e-9);
    assert!((f.laser_error_mm(1e-3) - 0.1).abs() < 1e-9 && (f.displacement_mm - 10.0).abs() < 1e-9);
    // From 100 mm/s on to 1000 mm/s back.
    assert!((f.corner_mm_s - 1100.0).abs() < 1e-6, "{f:?}");
}

#[test]
fn program_beyond_any_limit_is_refused() {
    let all = |p: &mut Program, k: usize, by: fn(i64) -> i64| p.moves.iter_mut().for_each(|m| m.to[k] = by(m.us));
    assert_eq!(codes(|p, _| all(p, 0, |_| 0)), Vec::<&str>::new());
    assert!(codes(|p, _| (p.start[1], p.moves.iter_mut().for_each(|m| m.to[1] = 300_000_000)).1).contains(&"travel"));
    assert_eq!(codes(|p, _| (p.moves[100].to[6], p.moves[100].us) = (25_000_000, 210_000)), ["fly-field"]);
    // A stage that runs at once, which U compensates for.
    let stage = |p: &mut Program, speed: i64| {
        for m in &mut p.moves {
            m.to[0] = -speed * m.us;
            m.to[5] -= speed * m.us;
        }
    };
    assert_eq!(codes(|p, _| stage(p, 205)), ["fly-field", "fly-speed", "fly-acceleration", "fly-jerk"]);
    // From rest to rest in 0.1 s: 15,791 times its size of acceleration, and of jerk 1.36 million times.
    let swing = |p: &mut Program, size: f64| {
        for m in &mut p.moves[..100] {
            let x = (size * (1.0 - math::cos(62.831_853e-6 * m.us as f64)).powi(2) * 1e6) as i64;
            m.to[0] -= x;
            m.to[5] -= x;
        }
    };
    assert_eq!(codes(|p, _| swing(p, 0.01)), Vec::<&str>::new());
    assert_eq!(codes(|p, _| swing(p, 0.02)), ["fly-jerk"]);
    assert_eq!(codes(|p, _| swing(p, 0.07)), ["fly-acceleration", "fly-jerk"]);
    assert_eq!(codes(|p, _| p.pens[0].speed = Speed::mm_s(90.0)), ["fly-mark-speed"]);
    assert_eq!(codes(|p, _| p.moves[100].us = 101_000), ["fly-speed"], "a jump of 10 m/s");
    assert_eq!(codes(|_, m| m.controller.max_line = 40), ["fly-line"]);
    assert_eq!(codes(|p, _| p.pens[0].power = Power::Absolute(terrace_core::units::Watts::w(20.0))), ["pen-power"]);
    assert_eq!(codes(|p, _| p.moves.iter_mut().for_each(|m| m.mark = None)), ["job-empty"]);
    assert_eq!(codes(|p, _| p.moves[4].to = p.moves[3].to), ["fly-invariant"]);
    assert_eq!(codes(|p, _| p.moves[4].us = p.moves[3].us), ["fly-invariant"]);
    assert_eq!(
        codes(|p, _| p.moves[4].mark = Some(Mark { pen: PenId(3), source: StrokeId(0), piece: PieceId(0) })),
        ["fly-invariant"]
    );
}

#[test]
fn turning_axes_have_limits_of_their_own() {
    let turned = |size: f64, scanner: Option<&str>| {
        let mut machine = Machine::built_in("xyzac-galvo-10").expect("profile");
        let most = scanner.and_then(|a| a.parse().ok());
        let scanner = &mut machine.scanner;
        (scanner.max_mark_speed, scanner.acceleration, scanner.jerk) = (Speed::mm_s(1e6), most, None);
        let axis = &mut machine.tilt.as_mut().expect("a table").axes[1];
        (axis.speed, axis.acceleration) = ("0.2 rad/s".parse().ok(), "20 rad/s2".parse().ok());
        axis.jerk = None;
        let mut p = program();
        p.kind = Kind::Xyzacuv;
        p.pens[0].speed = Speed::mm_s(1e4);
        for m in &mut p.moves {
            m.to[5] /= 10;
        }
        for m in &mut p.moves[..100] {
            m.to[4] = (size * (1.0 - math::cos(62.831_853e-6 * m.us as f64)).powi(2) * 1e6) as i64;
        }
        Checked::new(p, &machine, false).map_or_else(|e| e.diags().iter().map(|d| d.code).collect(), |_| Vec::new())
    };
    // 163 and 15,791 times its size of speed and acceleration: limits are 11.5 and 1146 degrees.
    assert_eq!(turned(0.06, None), Vec::<&str>::new());
    assert_eq!(turned(0.08, None), ["fly-speed", "fly-acceleration"]);
    // U moves at 10 mm/s and back at 100 mm/s at once.
    assert_eq!(turned(0.06, Some("10000 mm/s2")), ["fly-acceleration"]);
    assert_eq!(turned(0.06, Some("100000 mm/s2")), Vec::<&str>::new());
}
