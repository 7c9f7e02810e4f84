//! `limits`: axes and marks keep their limits at every sample.
//!
//! Travel and field hold between samples too, since moves are straight. Speeds are those of moves; accelerations and
//! jerks of all axes are taken from samples at least 5 and 10 ms apart, as a polynomial through three or four of them
//! has them: any motion through these has as much somewhere. What the rounding of samples to whole nanometres may have
//! put there is subtracted first, and the rounding of sums is allowed; a move that is too short by a microsecond is
//! too fast. Where X and Y do not turn the part and the machine states the acceleration of its scanner, the spot rests
//! wherever it turns sharply, and takes its time from each such place to the next (`rests`).

use super::chain::Chain;
use super::rests;
use crate::proof::Rule;
use crate::read::on_the_fly::{Commands, FlyProgram, FlyStep};
use terrace_core::machine::{FieldShape, Machine};
use terrace_core::math;
use terrace_core::program::Pen;

/// Sums of ways and times are rounded: so much more than a limit is allowed, as docs/explanation/verify.md states.
const OVER: f64 = 1.0 + 1e-6;
/// Length that the rounding of both ends of a move to whole nanometres may add to its way, nm: up to 0.71 nm each in
/// the plane, 0.87 nm in space.
const ROUNDED: f64 = 2.0;
/// Least distance of the samples that accelerations and jerks are taken from, us, as docs/explanation/verify.md states:
/// of nearer ones rounding to whole nanometres is the larger part.
const APART_US: [i64; 2] = [5_000, 10_000];

/// The limits of one axis, in mm or degrees.
struct AxisLimit {
    name: char,
    axis: usize,
    travel: [f64; 2],
    speed: f64,
    acceleration: f64,
    jerk: f64,
}

/// The limits of each axis: with five axes (X, Y, Z, U, V) those of the stage, with seven all.
fn axis_limits(machine: &Machine, leans: bool) -> Vec<AxisLimit> {
    let linear = [(0, 'X', &machine.stage.x), (1, 'Y', &machine.stage.y), (2, 'Z', &machine.stage.z)];
    let mut out: Vec<AxisLimit> = linear
        .into_iter()
        .map(|(axis, name, a)| AxisLimit {
            name,
            axis,
            travel: a.travel.map(|t| t.as_mm()),
            speed: a.speed.as_mm_s(),
            acceleration: a.acceleration.as_mm_s2(),
            jerk: a.jerk.map_or(f64::INFINITY, |j| j.as_mm_s3()),
        })
        .collect();
    for (k, axis) in machine.tilt.iter().filter(|_| leans).flat_map(|t| &t.axes).enumerate() {
        out.push(AxisLimit {
            name: axis.letter.char(),
            axis: 3 + k,
            travel: axis.travel.ends().map_or([f64::NEG_INFINITY, f64::INFINITY], |ends| ends.map(|t| t.as_deg())),
            speed: axis.speed.map_or(f64::INFINITY, |v| v.as_rad_s().to_degrees()),
            acceleration: axis.acceleration.map_or(f64::INFINITY, |v| v.as_rad_s2().to_degrees()),
            jerk: axis.jerk.map_or(f64::INFINITY, |v| v.as_rad_s3().to_degrees()),
        });
    }
    // Where U and V may go is the field's to say, and how fast is looked at below, by marks and jumps.
    let scanner = &machine.scanner;
    // With five axes the spot keeps its limits between corners, which `rests` looks at.
    let mirrors = [(5, 'U'), (6, 'V')].into_iter().filter(|_| leans);
    out.extend(mirrors.map(|(axis, name)| AxisLimit {
        name,
        axis,
        travel: [f64::NEG_INFINITY, f64::INFINITY],
        speed: f64::INFINITY,
        acceleration: scanner.acceleration.map_or(f64::INFINITY, |a| a.as_mm_s2()),
        jerk: scanner.jerk.map_or(f64::INFINITY, |j| j.as_mm_s3()),
    }));
    out
}

/// Holds the rule.
pub(super) fn check(program: &FlyProgram, name: &str, chain: &Chain, machine: &Machine, pens: &[Pen], rule: &mut Rule) {
    let limits = axis_limits(machine, chain.leans());
    for (line, to) in &program.rapids {
        for limit in &limits {
            rule.checked += 1;
            if to[limit.axis].is_some_and(|v| !within(v, limit)) {
                rule.broken("", format!("{name}:{line}"), format!("{} leaves its travel", limit.name));
            }
        }
    }
    let checker = MoveChecker { name, chain, machine, pens, limits: &limits };
    for (us, from, step) in program.moves() {
        rule.checked += 1;
        let commanded = CommandedMove { from, step, seconds: (step.us - us) as f64 * 1e-6 };
        checker.axes(&commanded, rule);
        checker.scanner(&commanded, rule);
        checker.pen(&commanded, rule);
    }
    for limit in &limits {
        check_derivatives(program, name, limit, rule);
    }
    if !chain.leans() {
        rests::check(program, name, chain, machine, pens, rule);
    }
}

/// One move of a program.
struct CommandedMove<'a> {
    from: &'a Commands,
    step: &'a FlyStep,
    seconds: f64,
}

/// Holds each move of a program by itself.
struct MoveChecker<'a> {
    name: &'a str,
    chain: &'a Chain,
    machine: &'a Machine,
    pens: &'a [Pen],
    limits: &'a [AxisLimit],
}

impl MoveChecker<'_> {
    fn broken(&self, step: &FlyStep, text: String, rule: &mut Rule) {
        rule.broken("", format!("{}:{}", self.name, step.line), text);
    }

    /// Travel and speed of every axis.
    fn axes(&self, &CommandedMove { from, step, seconds }: &CommandedMove<'_>, rule: &mut Rule) {
        for limit in self.limits {
            if !within(step.to[limit.axis], limit) {
                self.broken(step, format!("{} leaves its travel", limit.name), rule);
            }
            let way = ((step.to[limit.axis] - from[limit.axis]).abs() as f64 - ROUNDED) * 1e-6;
            if way > limit.speed * OVER * seconds {
                let (name, most) = (limit.name, limit.speed);
                let unit = if matches!(limit.axis, 3 | 4) { "deg/s" } else { "mm/s" };
                let text = format!("{name} runs at {:.4} {unit}, above its limit of {most} {unit}", way / seconds);
                self.broken(step, text, rule);
            }
        }
    }

    /// Field and speed of the scanner.
    fn scanner(&self, &CommandedMove { from, step, seconds }: &CommandedMove<'_>, rule: &mut Rule) {
        let field = self.chain.field(&step.to.float());
        if !self.is_in_field(field) {
            let text = format!("the scanner leaves its field: ({:.6}, {:.6}) mm", field[0] / 1e6, field[1] / 1e6);
            self.broken(step, text, rule);
        }
        let from_field = self.chain.field(&from.float());
        let way = (math::hypot(field[0] - from_field[0], field[1] - from_field[1]) - ROUNDED) * 1e-6;
        let scanner = &self.machine.scanner;
        let limit = if step.mark.is_some() { scanner.max_mark_speed } else { scanner.jump_speed };
        let limit = limit.as_mm_s();
        if way > limit * OVER * seconds {
            let text = format!("the scanner runs at {:.4} mm/s, above its limit of {limit} mm/s", way / seconds);
            self.broken(step, text, rule);
        }
    }

    /// Whether a place of the scanner, nm, lies in the usable field; commands are whole nanometres, so that one may lie
    /// a nanometre outside.
    fn is_in_field(&self, field: [f64; 2]) -> bool {
        let lens = &self.machine.lens;
        // Of a circle the usable square lies inside.
        if lens.shape == FieldShape::Circle {
            let radius = lens.field.map(|f| f.as_mm()).into_iter().fold(f64::INFINITY, f64::min) / 2.0;
            return math::hypot(field[0], field[1]) <= (radius - lens.margin.as_mm()) * 1e6 + 1.0;
        }
        let half = self.machine.usable_field().map(|f| f.f64() / 2.0 + 1.0);
        (0..2).all(|k| field[k].abs() <= half[k])
    }

    /// Speed of a mark across the beam: that is what a pen's speed is of.
    fn pen(&self, &CommandedMove { from, step, seconds }: &CommandedMove<'_>, rule: &mut Rule) {
        let Some(pen) = step.mark.and_then(|m| self.pens.get(m.pen.index())) else { return };
        let (a, b) = (self.chain.beam(&from.float()), self.chain.beam(&step.to.float()));
        let way = (a.way(&b) - ROUNDED) * 1e-6;
        let limit = pen.speed.as_mm_s();
        if way > limit * OVER * seconds {
            let text = format!("a mark runs at {:.4} mm/s, faster than its pen of {limit} mm/s", way / seconds);
            self.broken(step, text, rule);
        }
    }
}

/// Whether a command lies in the travel of its axis, or outside by no more than its rounding, a nanometre or a
/// millionth of a degree.
fn within(v: i64, limit: &AxisLimit) -> bool {
    (limit.travel[0] - 1e-6..=limit.travel[1] + 1e-6).contains(&(v as f64 / 1e6))
}

/// Acceleration and jerk of an axis.
fn check_derivatives(program: &FlyProgram, name: &str, limit: &AxisLimit, rule: &mut Rule) {
    for (order, apart, most) in [(2, APART_US[0], limit.acceleration), (3, APART_US[1], limit.jerk)] {
        if most.is_infinite() {
            continue;
        }
        // The program begins and ends at rest: as many samples before and after it stand still.
        let rest = |k: i64| (-(k * apart) as f64 / 1e6, program.start[limit.axis] as f64 / 1e6);
        let mut taken: Vec<(f64, f64)> = (0..=order as i64).rev().map(rest).collect();
        let end = program.steps.last().map(|s| (s.us, s.to[limit.axis], s.line));
        let after = end.into_iter().flat_map(|(us, to, line)| (1..=3).map(move |k| (us + k * apart, to, line)));
        let mut last = 0;
        let mut worst = (most * OVER, 0);
        for (us, to, line) in program.steps.iter().map(|s| (s.us, s.to[limit.axis], s.line)).chain(after) {
            if us - last < apart {
                continue;
            }
            last = us;
            taken.push((us as f64 / 1e6, to as f64 / 1e6));
            taken.remove(0);
            rule.checked += 1;
            let size = newton(&taken);
            if size > worst.0 {
                worst = (size, line);
            }
        }
        if worst.1 > 0 {
            let what = if order == 2 { "an acceleration" } else { "a jerk" };
            let length = if matches!(limit.axis, 3 | 4) { "deg" } else { "mm" };
            let unit = format!("{length}/s{order}");
            let text = format!("{} has {what} of {:.4} {unit}, above its limit of {most} {unit}", limit.name, worst.0);
            rule.broken("", format!("{name}:{}", worst.1), text);
        }
    }
}

/// The highest derivative of the polynomial through points (t, x), without sign, less what 1e-6 on every x may
/// have put there.
fn newton(points: &[(f64, f64)]) -> f64 {
    let mut row: Vec<f64> = points.iter().map(|p| p.1).collect();
    let mut slack: Vec<f64> = vec![1e-6; points.len()];
    let mut factorial = 1.0;
    for k in 1..points.len() {
        factorial *= k as f64;
        for i in 0..points.len() - k {
            let time = points[i + k].0 - points[i].0;
            row[i] = (row[i + 1] - row[i]) / time;
            slack[i] = (slack[i + 1] + slack[i]) / time;
        }
    }
    factorial * (row[0].abs() - slack[0])
}
