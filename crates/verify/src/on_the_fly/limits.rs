//! `limits`: axes and marks keep their limits at every sample.
//!
//! Travel and field hold between samples too, since moves are straight. Speeds are those of moves; accelerations
//! and jerks of all axes are taken from samples at least 5 and 10 ms apart, as a polynomial through three or four
//! of them has them: any motion through these has as much somewhere. What the rounding of samples to whole
//! nanometres may have put there is taken off before, and the rounding of sums is let pass; a move that is too
//! short by a microsecond is too fast. Where X and Y do not turn the part and the machine states the acceleration of
//! its scanner, the spot rests wherever it turns sharply, and takes its time from each such place to the next (`rests`).

use super::chain::Chain;
use super::rests;
use crate::proof::Rule;
use crate::read::on_the_fly::FlyProgram;
use terrace_core::machine::Machine;
use terrace_core::program::Pen;

/// Sums of ways and times are rounded: so much more than a limit is let pass.
const OVER: f64 = 1.0 + 1e-6;
/// Least distance of the samples that accelerations and jerks are taken from, us: of nearer ones rounding to whole
/// nanometres is the larger part.
const APART_US: [i64; 2] = [5_000, 10_000];

/// What one axis must keep, in mm or degrees.
struct Limit {
    name: char,
    axis: usize,
    travel: [f64; 2],
    speed: f64,
    acceleration: f64,
    jerk: f64,
}

fn all(machine: &Machine, leans: bool) -> Vec<Limit> {
    let linear = [(0, 'X', &machine.stage.x), (1, 'Y', &machine.stage.y), (2, 'Z', &machine.stage.z)];
    let mut out: Vec<Limit> = linear
        .into_iter()
        .map(|(axis, name, a)| Limit {
            name,
            axis,
            travel: a.travel.map(|t| t.as_mm()),
            speed: a.speed.as_mm_s(),
            acceleration: a.acceleration.as_mm_s2(),
            jerk: a.jerk.map_or(f64::INFINITY, |j| j.as_mm_s3()),
        })
        .collect();
    for (k, axis) in machine.tilt.iter().filter(|_| leans).flat_map(|t| &t.axes).enumerate() {
        out.push(Limit {
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
    out.extend(mirrors.map(|(axis, name)| Limit {
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
    let limits = all(machine, chain.leans());
    for (line, to) in &program.rapids {
        for limit in &limits {
            rule.checked += 1;
            if to[limit.axis].is_some_and(|v| !within(v, limit)) {
                rule.broken("", format!("{name}:{line}"), format!("{} leaves its travel", limit.name));
            }
        }
    }
    let [jump, mark] = [machine.scanner.jump_speed, machine.scanner.max_mark_speed].map(|v| v.as_mm_s());
    let half = machine.usable_field().map(|f| f.f64() / 2.0 + 1.0);
    for (us, from, step) in program.moves() {
        rule.checked += 1;
        let s = (step.us - us) as f64 * 1e-6;
        let mut broken = |text: String| rule.broken("", format!("{name}:{}", step.line), text);
        for limit in &limits {
            if !within(step.to[limit.axis], limit) {
                broken(format!("{} leaves its travel", limit.name));
            }
            let way = ((step.to[limit.axis] - from[limit.axis]).abs() as f64 - 2.0) * 1e-6;
            if way > limit.speed * OVER * s {
                let (name, unit) = (limit.name, if matches!(limit.axis, 3 | 4) { "deg/s" } else { "mm/s" });
                broken(format!("{name} runs at {:.4} {unit}, above its limit of {} {unit}", way / s, limit.speed));
            }
        }
        let field = chain.field(&step.to.float());
        let circle = machine.lens.shape == terrace_core::machine::FieldShape::Circle;
        // Of a circle the usable square lies inside.
        let radius = machine.lens.field.map(|f| f.as_mm()).into_iter().fold(f64::INFINITY, f64::min) / 2.0;
        let inside = if circle {
            field[0].hypot(field[1]) <= (radius - machine.lens.margin.as_mm()) * 1e6 + 1.0
        } else {
            (0..2).all(|k| field[k].abs() <= half[k])
        };
        if !inside {
            broken(format!("the scanner leaves its field: ({:.6}, {:.6}) mm", field[0] / 1e6, field[1] / 1e6));
        }
        let before = chain.field(&from.float());
        let way = ((field[0] - before[0]).hypot(field[1] - before[1]) - 2.0) * 1e-6;
        let limit = if step.mark.is_some() { mark } else { jump };
        if way > limit * OVER * s {
            broken(format!("the scanner runs at {:.4} mm/s, above its limit of {limit} mm/s", way / s));
        }
        let pen = step.mark.and_then(|m| pens.get(m.pen.index()));
        if let Some(pen) = pen {
            // Across the beam: that is what a pen's speed is of.
            let (a, b) = (chain.beam(&from.float()), chain.beam(&step.to.float()));
            let way = (a.way(&b) - 2.0) * 1e-6;
            if way > pen.speed.as_mm_s() * OVER * s {
                broken(format!(
                    "a mark runs at {:.4} mm/s, faster than its pen of {} mm/s",
                    way / s,
                    pen.speed.as_mm_s()
                ));
            }
        }
    }
    for limit in &limits {
        curved(program, name, limit, rule);
    }
    if !chain.leans() {
        rests::check(program, name, chain, machine, pens, rule);
    }
}

fn within(v: i64, limit: &Limit) -> bool {
    (limit.travel[0] - 1e-6..=limit.travel[1] + 1e-6).contains(&(v as f64 / 1e6))
}

/// Acceleration and jerk of an axis.
fn curved(program: &FlyProgram, name: &str, limit: &Limit, rule: &mut Rule) {
    for (order, apart, most) in [(2, APART_US[0], limit.acceleration), (3, APART_US[1], limit.jerk)] {
        if most.is_infinite() {
            continue;
        }
        // The program begins and ends at rest.
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
