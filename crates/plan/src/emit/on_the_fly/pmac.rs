//! `fly.pmc`: a motion program for Power PMAC, five axes or seven.
//!
//! Moves are LINEAR, absolute, with TM in ms, three decimals. TS is 0. With TA > 0 the controller blends one move
//! into the next over TA, in a parabola that leaves the corner by a step of velocity times TA / 8; and a synchronous
//! assignment comes TA / 2 before the corner. TA is therefore the most whole microseconds that keep the worst
//! corner of a mark within 0.2 um and no move shorter than TA, and 0 where not even one does: corners are then met
//! exactly, and what the motors cannot follow is their following error.
//!
//! # Assumptions
//! M1 is mapped to the laser's gate and M2 to its power in percent; `==` assigns with the motion, `=` at once.
//! A DWELL waits for the motion before it. The coordinate system has its axes defined in mm and degrees, and no
//! look-ahead or limit that stretches times.

use super::{AxisWords, BLEND_MM, Pieces, Powers, approach, clean, head, percent, push_time, settle, word};
use crate::on_the_fly::check::{Checked, Figures};
use terrace_core::machine::Machine;

/// The usual servo period of a Power PMAC, s (that of Ma et al. 2025).
pub const SERVO_S: f64 = 50e-6;

/// Time over which moves are blended into each other, us.
pub fn blend_us(figures: &Figures) -> i64 {
    let most = 8.0 * BLEND_MM / figures.corner_mm_s.max(1e-9) * 1e6;
    (most.floor().min(1e6) as i64).min(figures.shortest_us)
}

/// The program for Power PMAC.
pub fn pmac(checked: &Checked, machine: &Machine) -> Vec<u8> {
    let program = checked.program();
    let mut out = Vec::with_capacity(60 * program.moves.len() + 1024);
    let line = |out: &mut Vec<u8>, text: &str| {
        out.extend_from_slice(text.as_bytes());
        out.push(b'\n');
    };
    let comment = |out: &mut Vec<u8>, text: &str| {
        line(out, &format!("// {}", clean(text, machine.controller.max_line - 3)));
    };
    let axes = program.kind.letters();
    let blend = blend_us(checked.figures());
    let rounded = blend as f64 * checked.figures().corner_mm_s / 8.0 * 1e-6;
    comment(&mut out, &format!("terrace: on-the-fly program for Power PMAC, axes {axes}, absolute, mm and degrees"));
    head(checked, machine, SERVO_S).iter().for_each(|text| comment(&mut out, text));
    comment(&mut out, "M1 is the laser, M2 its power in percent");
    comment(&mut out, &format!("blending rounds corners of marks by {rounded:.6} mm at most"));
    line(&mut out, "open prog 1");
    line(&mut out, "M1=0");
    line(&mut out, "abs");
    approach(&mut out, checked, machine, "rapid");
    line(&mut out, &dwell(settle(machine)));
    let mut modes = b"linear TA".to_vec();
    push_time(&mut modes, blend, 1000);
    modes.extend_from_slice(b" TS0\n");
    out.extend_from_slice(&modes);
    let mut axis_words = AxisWords::start(program, machine);
    let (mut laser, mut pieces, mut powers) = (false, Pieces::default(), Powers::new(checked, machine));
    for (us, from, to) in program.steps() {
        let begun = pieces.begin(to.mark);
        if let Some((text, pen)) = &begun {
            comment(&mut out, text);
            if let Some(pen) = pen.filter(|_| !checked.power_by_speed()) {
                line(&mut out, &format!("M2=={}", percent(checked, machine, pen)));
            }
        }
        if let Some(power) = powers.before(from, to, (to.us - us) as f64 * 1e-6, begun.is_some()) {
            line(&mut out, &format!("M2=={power}"));
        }
        if laser != to.mark.is_some() {
            laser = to.mark.is_some();
            line(&mut out, if laser { "M1==1" } else { "M1==0" });
        }
        if *from == to.to {
            line(&mut out, &dwell(to.us - us));
            continue;
        }
        out.extend_from_slice(b"TM");
        push_time(&mut out, to.us - us, 1000);
        axis_words.append(&mut out, &to.to);
        out.push(b'\n');
    }
    for text in ["M1==0", "dwell0", "M1=0", "M2=0"] {
        line(&mut out, text);
    }
    out.extend_from_slice(b"rapid");
    word(&mut out, 2, machine.retract_z().0);
    line(&mut out, "\nM1=0\nclose");
    out
}

fn dwell(us: i64) -> String {
    let mut text = b"dwell".to_vec();
    push_time(&mut text, us, 1000);
    String::from_utf8(text).expect("digits")
}
