//! Pens that compensate for the slope: where the beam meets the surface at an angle, its energy spreads over an
//! area larger by one over the cosine.
//!
//! Every fragment is marked with a pen of its own factor: the mean cosine over its length, or one over it,
//! rounded to the job's step and held within its cap. A factor of 1 is the job's own pen. The others come
//! after the job's pens, by pen and factor, and are named `fill x0.97`.

use std::collections::BTreeSet;

use super::parts::Parts;
use terrace_core::program::{Pen, PenId};
use terrace_core::units::{Power, Speed, Time, Watts};
use terrace_input::job::{Compensate, Dose};

/// The pens of a program.
pub(super) struct Pens {
    dose: Option<Dose>,
    /// The job's and those made of them.
    pub(super) list: Vec<Pen>,
    own: usize,
    /// Pen and number of steps of each that was made.
    made: Vec<(PenId, u32)>,
}

impl Pens {
    /// The pens that the fragments need.
    pub(super) fn new(dose: Option<Dose>, pens: &[Pen], parts: &Parts) -> Self {
        let mut it = Self { dose, list: pens.to_vec(), own: pens.len(), made: Vec::new() };
        let Some(dose) = dose else { return it };
        let needed: BTreeSet<(PenId, u32)> =
            parts.fragments().filter_map(|(f, measure)| Some((f.pen, steps(&dose, measure.cos())?))).collect();
        it.list.extend(needed.iter().map(|&(pen, k)| made_of(&pens[pen.index()], &dose, factor(&dose, k))));
        it.made = needed.into_iter().collect();
        it
    }

    /// Gives every fragment its pen.
    pub(super) fn assign(&self, parts: &mut Parts) {
        let Some(dose) = self.dose else { return };
        for (f, measure) in parts.fragments_mut() {
            let steps = steps(&dose, measure.cos());
            let made = steps.and_then(|k| self.made.binary_search(&(f.pen, k)).ok());
            f.pen = made.map_or(f.pen, |i| PenId((self.own + i) as u16));
        }
    }

    /// By how much the pen for a mean cosine of the slope raises the dose.
    pub(super) fn gain(&self, cos: f64) -> f64 {
        let Some(dose) = self.dose else { return 1.0 };
        let Some(k) = steps(&dose, cos) else { return 1.0 };
        match dose.compensate {
            Compensate::Speed => 1.0 / factor(&dose, k),
            Compensate::Power => factor(&dose, k),
        }
    }
}

/// How many steps the factor for a slope is; None for the pen as it is.
fn steps(dose: &Dose, cos: f64) -> Option<u32> {
    let (wanted, is_within): (f64, fn(f64, f64) -> bool) = match dose.compensate {
        Compensate::Speed => (cos.max(1.0 / dose.cap), |factor, cap| factor >= 1.0 / cap),
        Compensate::Power => ((1.0 / cos).min(dose.cap), |factor, cap| factor <= cap),
    };
    let mut k = (wanted / dose.step).round() as u32;
    // Rounding must not go beyond the cap.
    if !is_within(factor(dose, k) * (1.0 + if dose.compensate == Compensate::Speed { 1e-9 } else { -1e-9 }), dose.cap) {
        k = if dose.compensate == Compensate::Speed { k + 1 } else { k - 1 };
    }
    let is_own = (factor(dose, k) - 1.0).abs() < 0.5 * dose.step;
    let is_wrong_way = match dose.compensate {
        Compensate::Speed => factor(dose, k) > 1.0,
        Compensate::Power => factor(dose, k) < 1.0,
    };
    (!is_own && !is_wrong_way).then_some(k)
}

/// So many steps as a factor of at most six decimals, as its pen's name has it.
fn factor(dose: &Dose, steps: u32) -> f64 {
    (f64::from(steps) * dose.step * 1e6).round() / 1e6
}

fn made_of(pen: &Pen, dose: &Dose, factor: f64) -> Pen {
    let mut made = Pen { name: format!("{} x{factor}", pen.name), ..pen.clone() };
    match dose.compensate {
        Compensate::Speed => {
            made.speed = Speed::mm_s(pen.speed.as_mm_s() * factor);
            made.dwell = pen.dwell.map(|dwell| Time::s(dwell.as_s() / factor));
        }
        Compensate::Power => {
            made.power = match pen.power {
                Power::Percent(p) => Power::Percent(p * factor),
                Power::Absolute(w) => Power::Absolute(Watts::w(w.as_w() * factor)),
            }
        }
    }
    made
}

#[cfg(test)]
mod tests {
    use super::*;
    use terrace_core::math;

    fn dose(compensate: Compensate) -> Dose {
        Dose { compensate, cap: 1.5, step: 0.01 }
    }

    #[test]
    fn factors_follow_the_cosine_up_to_the_cap() {
        let at = |compensate, deg: f64| {
            let dose = dose(compensate);
            steps(&dose, math::cos(deg.to_radians())).map(|k| factor(&dose, k))
        };
        assert_eq!(at(Compensate::Speed, 0.0), None);
        assert_eq!(at(Compensate::Speed, 5.0), None, "cos 0.9962");
        assert_eq!(at(Compensate::Speed, 30.0), Some(0.87));
        assert_eq!(at(Compensate::Speed, 80.0), Some(0.67), "two thirds, rounded to the safe side");
        assert_eq!(at(Compensate::Power, 30.0), Some(1.15));
        assert_eq!(at(Compensate::Power, 80.0), Some(1.5));
        for compensate in [Compensate::Speed, Compensate::Power] {
            for tenths in 0..850 {
                let cos = math::cos((f64::from(tenths) / 10.0).to_radians());
                let ideal = if compensate == Compensate::Speed { cos.max(1.0 / 1.5) } else { (1.0 / cos).min(1.5) };
                let got = steps(&dose(compensate), cos).map_or(1.0, |k| factor(&dose(compensate), k));
                assert!((got - ideal).abs() <= 0.01, "{tenths}: {got} for {ideal}");
            }
        }
    }
}
