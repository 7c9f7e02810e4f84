use super::*;
use crate::on_the_fly::program::{Mark, Move, Program};
use terrace_core::machine::Origin;
use terrace_core::program::{Pen, PenId, PieceId, StrokeId};
use terrace_core::units::{Frequency, Power, Speed, Time};

fn sample(kind: Kind) -> (Checked, Machine) {
    let profile = if kind == Kind::Xyzuv { "xyz-galvo-40" } else { "xyzac-galvo-10" };
    let machine = Machine::built_in(profile).expect("profile");
    let pen = |name: &str, power| Pen {
        name: name.into(),
        speed: Speed::mm_s(100.0),
        power,
        frequency: Frequency::khz(60.0),
        passes: 1,
        dwell: None,
    };
    let mark = |pen, piece| Some(Mark { pen: PenId(pen), source: StrokeId(4 + piece), piece: PieceId(piece) });
    let turn = i64::from(kind == Kind::Xyzacuv);
    let at = |x, u, v| AxisCommands([x, 0, -5_000_000, -1_500_000 * turn, 250_000 * turn, u, v]);
    let move_to = |us, to, mark| Move { us, to, mark };
    let program = Program {
        kind,
        pens: vec![pen("fill (a)", Power::Percent(60.0)), pen("edge", Power::Percent(12.5))],
        origin: Origin::default(),
        start: at(0, 0, 0),
        moves: vec![
            move_to(10_000, at(-500_000, 1, 0), None),
            move_to(20_000, at(-500_000, 1_000_001, 0), mark(0, 0)),
            move_to(20_333, at(-500_000, 1_000_001, 33_000), mark(0, 1)),
            move_to(30_000, at(-500_000, 1_000_001, 33_000), None),
            move_to(31_001, at(0, 1_000_001, 133_000), mark(1, 2)),
        ],
    };
    (Checked::unchecked(program, &machine), machine)
}

fn text(bytes: Vec<u8>) -> String {
    String::from_utf8(bytes).expect("ASCII")
}

#[test]
fn the_program_for_linuxcnc_is_as_written_down() {
    let (checked, machine) = sample(Kind::Xyzuv);
    let text = text(linuxcnc(&checked, &machine));
    let body = text.split_once("G21").expect("modes").1;
    let wanted = " G90 G94 G17 G40 G49 G80\nG64 P0.0002 Q0\nM65 P0\nG0 Z200.000000\n\
                  G0 X0.000000 Y0.000000 U0.000000 V0.000000\nG0 Z-5.000000\nG4 P0.1\nG93\n\
                  G1 X-0.500000 U0.000001 F6000\n(MARK 4 PEN 1)\nM67 E0 Q60.000\nM62 P0\n\
                  G1 U1.000001 F6000\n(MARK 5 PEN 1)\nG1 V0.033000 F180180.18018\nM65 P0\nG4 P0.009667\n\
                  (MARK 6 PEN 2)\nM67 E0 Q12.500\nM62 P0\nG1 X0.000000 V0.133000 F59940.0599401\n\
                  M65 P0\nM68 E0 Q0\nG94\nG0 Z200.000000\nM65 P0\nM2\n";
    assert_eq!(body, wanted);
    assert!(text.contains("(pen 1: \"fill _a_\", 100 mm/s, 60 percent at 60 kHz)\n"), "{text}");
    assert!(text.contains("(LASER ERROR 0.50"), "500 mm/s for 1 ms: {text}");
}

#[test]
fn laser_error_is_that_of_the_controllers_own_servo_period() {
    let (checked, mut machine) = sample(Kind::Xyzuv);
    let stated = |program: Vec<u8>| {
        let text = text(program);
        let error = text.split_once("LASER ERROR ").expect("an error").1;
        error.split_once(' ').expect("a unit").0.parse::<f64>().expect("a number")
    };
    let errors = |machine: &Machine| [stated(linuxcnc(&checked, machine)), stated(pmac(&checked, machine))];
    let fastest = checked.figures().mark_speed;
    let near = |found: [f64; 2], periods: [f64; 2]| (0..2).all(|k| (found[k] - fastest * periods[k]).abs() < 1e-6);
    // 1 ms of LinuxCNC, 50 us of PMAC.
    assert!(near(errors(&machine), [1e-3, 50e-6]), "{:?}", errors(&machine));
    machine.controller.servo_period = Some(Time::us(440.0));
    assert!(near(errors(&machine), [440e-6; 2]), "{:?}", errors(&machine));
}

#[test]
fn names_stand_in_quotes_and_begin_no_comment() {
    for word in crate::emit::HOSTILE {
        let name = format!("{word},x(y)\n%;\"{word} MARK 1 PEN 1 {}", "z".repeat(300));
        for kind in [Kind::Xyzuv, Kind::Xyzacuv] {
            let (mut checked, mut machine) = sample(kind);
            machine.name = name.clone();
            let mut program = checked.program().clone();
            program.pens.iter_mut().for_each(|pen| pen.name = name.clone());
            checked = Checked::unchecked(program, &machine);
            let bytes = if kind == Kind::Xyzuv { linuxcnc(&checked, &machine) } else { pmac(&checked, &machine) };
            let text = text(bytes);
            let shown = format!("\"{word},x_y____'{word} MARK");
            for line in text.lines().filter(|l| l.contains(word)) {
                let line = line.trim_start_matches(['(', '/', ' ']);
                assert!(line.starts_with("machine: \"") || line.starts_with("pen "), "{line}");
                assert!(line.contains(&shown) && line.contains("...\"") && !line.contains(&"z".repeat(60)), "{line}");
            }
            assert_eq!(text.matches(&shown).count(), 3, "{text}");
        }
    }
}

#[test]
fn the_program_for_pmac_is_as_written_down() {
    let (checked, machine) = sample(Kind::Xyzacuv);
    let text = text(pmac(&checked, &machine));
    let body = text.split_once("open prog 1\n").expect("a program").1;
    let wanted = "M1=0\nabs\nrapid Z200.000000\n\
                  rapid X0.000000 Y0.000000 A-1.500000 C0.250000 U0.000000 V0.000000\nrapid Z-5.000000\ndwell100\n\
                  linear TA0.002 TS0\nTM10 X-0.500000 U0.000001\n// MARK 4 PEN 1\nM2==60.000\nM1==1\n\
                  TM10 U1.000001\n// MARK 5 PEN 1\nTM0.333 V0.033000\nM1==0\ndwell9.667\n\
                  // MARK 6 PEN 2\nM2==12.500\nM1==1\nTM1.001 X0.000000 V0.133000\n\
                  M1==0\ndwell0\nM1=0\nM2=0\nrapid Z200.000000\nM1=0\nclose\n";
    assert_eq!(body, wanted);
}

#[test]
fn blending_keeps_corners_within_its_bound() {
    let (checked, _) = sample(Kind::Xyzuv);
    let mut figures = *checked.figures();
    for (corner, shortest, us) in [(1000.0, 1000, 1), (1700.0, 1000, 0), (10.0, 1000, 160), (0.0, 77, 77)] {
        (figures.corner_mm_s, figures.shortest_us) = (corner, shortest);
        let blend = blend_us(&figures);
        assert_eq!(blend, us, "{corner}");
        assert!(blend as f64 * 1e-6 * corner / 8.0 <= BLEND_MM);
    }
}
