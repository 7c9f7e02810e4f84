//! Following error of axes, and its compensation by the scanner.
//!
//! Consumes commands sampled at even steps, linear in between; promises positions at the same times, exact for the
//! model at any step. Units: s, Hz, and whatever unit a position has (mm or rad).
//!
//! # Model
//! An axis answers its command as ωn² / (s² + 2 ζ ωn s + ωn²), or, where the speed of the command is fed forward, as
//! (2 ζ ωn s + ωn²) / (s² + 2 ζ ωn s + ωn²): it is then behind by the acceleration over ωn² alone. [`Scanner`] is the
//! error synthesis of Cui et al. (2021): the stage's following error is added to the scanner's command.
//!
//! # Limits
//! One mass, one spring, one damper: no dead time, no saturation of drives, no coupling of axes. The scanner is
//! given the stage's error without delay.

use terrace_core::diag::{Diag, Error};
use terrace_core::machine::{self, FeedForward, Machine};
use terrace_core::math;

/// A second-order axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Servo {
    /// ωn, rad/s.
    omega: f64,
    damping: f64,
    feed_forward: FeedForward,
}

impl Servo {
    /// An axis of a natural frequency in Hz and a damping ratio (1: critical).
    ///
    /// # Errors
    /// `fly-servo` where one is not positive and finite.
    pub fn new(natural_hz: f64, damping: f64) -> Result<Self, Error> {
        if [natural_hz, damping].iter().all(|v| *v > 0.0 && v.is_finite()) {
            return Ok(Self { omega: std::f64::consts::TAU * natural_hz, damping, feed_forward: FeedForward::None });
        }
        Err(Diag::bug("fly-servo", "a servo's natural frequency or damping is not positive".to_owned()).into())
    }

    /// The servo loop of every axis of a machine's stage: as its file states it, else of 20 Hz, well damped.
    ///
    /// # Errors
    /// `fly-servo` where frequency or damping of a servo is not positive and finite.
    pub fn of_stage(machine: &Machine) -> Result<Self, Error> {
        Self::stated(machine.stage.servo, 20.0)
    }

    /// The servo loop of a machine's scanner: as its file states it, else of 1 kHz, well damped.
    ///
    /// # Errors
    /// `fly-servo` where frequency or damping of a servo is not positive and finite.
    pub fn of_scanner(machine: &Machine) -> Result<Self, Error> {
        Self::stated(machine.scanner.servo, 1000.0)
    }

    /// The following error of a stage at top speed along x and y, mm: the share of the scanner's field reserved for
    /// compensating it.
    ///
    /// # Errors
    /// `fly-servo` where frequency or damping of a servo is not positive and finite.
    pub fn following_error(machine: &Machine) -> Result<[f64; 2], Error> {
        let servo = Self::of_stage(machine)?;
        Ok([&machine.stage.x, &machine.stage.y].map(|axis| servo.lag(axis.speed.as_mm_s())))
    }

    /// The servo loop as a machine file states it.
    ///
    /// # Errors
    /// `fly-servo` where frequency or damping of a servo is not positive and finite.
    pub fn of(servo: machine::Servo) -> Result<Self, Error> {
        let alone = Self::new(servo.frequency.as_khz() * 1000.0, servo.damping)?;
        Ok(Self { feed_forward: servo.feed_forward, ..alone })
    }

    fn stated(servo: Option<machine::Servo>, hz: f64) -> Result<Self, Error> {
        servo.map_or_else(|| Self::new(hz, 0.7), Self::of)
    }

    /// How far the position stays behind a command that moves at `speed`, once settled: 2 ζ v / ωn; 0 where the speed
    /// is fed forward.
    pub fn lag(&self, speed: f64) -> f64 {
        match self.feed_forward {
            FeedForward::None => 2.0 * self.damping * speed / self.omega,
            FeedForward::Velocity => 0.0,
        }
    }

    /// Positions at the samples of `command`, `dt` s apart, starting at rest on the first.
    pub fn follow(&self, command: &[f64], dt: f64) -> Vec<f64> {
        let Some(&first) = command.first() else { return Vec::new() };
        let mut axis = Axis::new(*self, dt, first);
        command.iter().map(|&c| axis.step(c)).collect()
    }
}

/// An axis under way.
#[derive(Clone, Copy, Debug)]
pub struct Axis {
    /// How a deviation of position and speed from the settled ramp decays over a step.
    decay: [[f64; 2]; 2],
    lag_per_speed: f64,
    dt: f64,
    command: f64,
    position: f64,
    speed: f64,
}

impl Axis {
    /// An axis at rest at `at`; steps are `dt` s apart.
    pub fn new(servo: Servo, dt: f64, at: f64) -> Self {
        let (w, z) = (servo.omega, servo.damping);
        let rest = 1.0 - z * z;
        let root = w * rest.abs().sqrt();
        // e^(-ζ ω t) cos and sin / root, or cosh and sinh / root: without overflow where damping is strong.
        let fade = math::exp(-z * w * dt);
        let (cos, sin) = if rest.abs() < 1e-10 {
            (fade, fade * dt)
        } else if rest > 0.0 {
            (fade * math::cos(root * dt), fade * math::sin(root * dt) / root)
        } else {
            let (slow, fast) = (math::exp((root - z * w) * dt), math::exp(-(root + z * w) * dt));
            (0.5 * (slow + fast), 0.5 * (slow - fast) / root)
        };
        let decay = [[cos + z * w * sin, sin], [-w * w * sin, cos - z * w * sin]];
        Self { decay, lag_per_speed: servo.lag(1.0), dt, command: at, position: at, speed: 0.0 }
    }

    /// Goes on to the next sample; the first sample after `new` should be where it stands.
    pub fn step(&mut self, command: f64) -> f64 {
        // The settled answer to a ramp is the ramp, late.
        let slope = (command - self.command) / self.dt;
        let lag = self.lag_per_speed * slope;
        let off = [self.position - (self.command - lag), self.speed - slope];
        let [p, s] = self.decay.map(|row| row[0] * off[0] + row[1] * off[1]);
        (self.position, self.speed, self.command) = (command - lag + p, slope + s, command);
        self.position
    }
}

/// How the scanner command is limited while it compensates the stage's following error.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Protection {
    /// The whole command is clipped to the field.
    #[default]
    Saturate,
    /// The source's eq. 5 as we read it: the stage's error is fed only while its accumulated sum is within
    /// `limit` (mm s). It does not keep the scanner in the field; for comparison alone.
    Accumulated {
        /// What is summed up.
        sum: Sum,
        /// Largest sum, mm s.
        limit: f64,
    },
    /// None.
    Off,
}

impl Protection {
    /// Eq. 5 as it is printed, with the sign of the error, and a limit of it (e_lim) that trips within seconds of an
    /// error of some millimetres.
    pub(crate) const ACCUMULATED: Self = Self::Accumulated { sum: Sum::Signed, limit: 0.02 };

    /// The protection with the limit that a machine states, where it has one.
    pub fn on(self, machine: &Machine) -> Self {
        match (self, machine.scanner.accumulated_error) {
            (Self::Accumulated { sum, .. }, Some(limit)) => Self::Accumulated { sum, limit: limit.as_mm_s() },
            _ => self,
        }
    }

    /// The ways that can be asked for by name.
    pub const ALL: [Self; 3] = [Self::Saturate, Self::ACCUMULATED, Self::Off];

    /// The name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Saturate => "saturate",
            Self::Accumulated { .. } => "accumulated",
            Self::Off => "off",
        }
    }
}

/// What eq. 5 sums up over time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sum {
    /// The stage's error with its sign.
    Signed,
    /// The size of the stage's error.
    Absolute,
    /// What is left of it on the part, with its sign.
    Residual,
}

/// One direction of a scanner that compensates the following error of the stage.
#[derive(Clone, Copy, Debug)]
pub struct Scanner {
    mirror: Axis,
    /// Whether and how the stage's error is fed to it.
    feed: Option<Protection>,
    sum: f64,
    residual: f64,
    behind: f64,
}

impl Scanner {
    /// A scanner at rest at `at`; `mirror` is its servo, steps are `dt` s apart.
    pub fn new(mirror: Servo, feed: Option<Protection>, dt: f64, at: f64) -> Self {
        Self { mirror: Axis::new(mirror, dt, at), feed, sum: 0.0, residual: 0.0, behind: 0.0 }
    }

    /// Goes on to the next sample: where it should be as planned, what the stage misses there, and half of the field;
    /// how far the spot is then off.
    pub fn step(&mut self, planned: f64, missed: f64, half_field: f64) -> f64 {
        let command = match self.feed {
            None => planned,
            Some(Protection::Off) => planned + missed,
            Some(Protection::Saturate) => (planned + missed).clamp(-half_field, half_field),
            Some(Protection::Accumulated { sum, limit }) => {
                let error = match sum {
                    Sum::Signed => missed,
                    Sum::Absolute => missed.abs(),
                    Sum::Residual => self.residual,
                };
                self.sum += self.mirror.dt * error;
                if self.sum.abs() <= limit { planned + missed } else { planned }
            }
        };
        let position = self.mirror.step(command);
        self.behind = command - position;
        self.residual = planned + missed - position;
        self.residual
    }

    /// How far the mirror was behind its own command at the last sample.
    pub fn following_error(&self) -> f64 {
        self.behind
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::{PI, TAU};

    fn servo(hz: f64, damping: f64) -> Servo {
        Servo::new(hz, damping).expect("positive")
    }

    #[test]
    fn following_error_of_a_ramp_matches_the_closed_form() {
        for (damping, dt) in [(0.3, 1e-3), (0.7, 0.013), (1.0, 1e-3), (2.5, 1e-3)] {
            let axis = servo(20.0, damping);
            let command: Vec<f64> = (0..(3.0 / dt) as usize).map(|i| 100.0 * dt * i as f64).collect();
            let reached = axis.follow(&command, dt);
            let behind = command[command.len() - 1] - reached[reached.len() - 1];
            let want = 2.0 * damping * 100.0 / (TAU * 20.0);
            assert!((behind - want).abs() < 1e-9, "{damping}: {behind} {want}");
        }
    }

    #[test]
    fn overshoot_of_a_step_matches_the_closed_form() {
        for damping in [0.2, 0.5, 0.7] {
            let axis = servo(10.0, damping);
            // Linear between samples: a step takes one of them.
            let command: Vec<f64> = (0..200_000).map(|i| if i == 0 { 0.0 } else { 1.0 }).collect();
            let peak = axis.follow(&command, 1e-6).into_iter().fold(0.0, f64::max);
            let want = 1.0 + math::exp(-PI * damping / (1.0 - damping * damping).sqrt());
            assert!((peak - want).abs() < 1e-6, "{damping}: {peak} {want}");
        }
    }

    #[test]
    fn response_to_a_sine_matches_the_transfer_function() {
        for (hz, damping) in [(20.0, 0.7), (20.0, 1.0), (20.0, 1.8)] {
            let (axis, f, dt) = (servo(hz, damping), 15.0, 1e-5);
            let command: Vec<f64> = (0..200_000).map(|i| math::sin(TAU * f * dt * f64::from(i))).collect();
            let reached = axis.follow(&command, dt);
            // Thirty periods minus the first ten, by correlation.
            let tail = reached.iter().enumerate().skip(100_000);
            let (mut sin, mut cos) = (0.0, 0.0);
            for (i, y) in tail {
                let phase = TAU * f * dt * i as f64;
                sin += 2e-5 * y * math::sin(phase);
                cos += 2e-5 * y * math::cos(phase);
            }
            let r = f / hz;
            let (re, im) = (1.0 - r * r, 2.0 * damping * r);
            let gain = math::hypot(re, im).recip();
            assert!((math::hypot(sin, cos) - gain).abs() < 1e-4, "{damping}");
            assert!((math::atan2(cos, sin) + math::atan2(im, re)).abs() < 1e-3, "{damping}");
        }
    }

    #[test]
    fn response_to_linear_commands_is_independent_of_the_sampling_step() {
        let axis = servo(20.0, 0.7);
        let fine: Vec<f64> = (0..=1000).map(|i| f64::from((i % 400 - 200i32).abs())).collect();
        let coarse: Vec<f64> = fine.iter().step_by(100).copied().collect();
        let (a, b) = (axis.follow(&fine, 1e-4), axis.follow(&coarse, 1e-2));
        for (i, b) in b.iter().enumerate() {
            assert!((a[100 * i] - b).abs() < 1e-9, "{i}");
        }
    }

    #[test]
    fn numbers_that_are_not_positive_are_refused() {
        assert!(Servo::new(0.0, 0.7).is_err() && Servo::new(20.0, f64::NAN).is_err());
    }

    const DT: f64 = 1e-4;

    /// What a scanner of a field of 5 mm to a side makes of a stage that swings at up to 100 mm/s under a small tremor,
    /// while it swings too: where it goes at most, how far the spot is off.
    fn swing(feed: Option<Protection>, jolt: f64) -> (f64, f64) {
        let mut stage_axis = Axis::new(servo(20.0, 0.7), DT, 0.0);
        let mut scanner = Scanner::new(servo(1000.0, 0.7), feed, DT, 0.0);
        let (mut most, mut squares) = (0.0f64, 0.0);
        for i in 0..40_000 {
            let time = DT * f64::from(i);
            let stage = 100.0 / TAU * math::sin(TAU * time);
            let planned = 2.0 * math::sin(TAU * 2.0 * time);
            let jolt = if (5000..7000).contains(&i) { jolt } else { 0.0 };
            let missed = stage - (stage_axis.step(stage) + 0.02 * math::sin(TAU * 8.0 * time) + jolt);
            let off = scanner.step(planned, missed, 5.0);
            most = most.max((planned + missed - off).abs());
            squares += if i < 10_000 { 0.0 } else { off * off };
        }
        (most, (squares / 30_000.0).sqrt())
    }

    #[test]
    fn compensation_by_the_scanner_leaves_one_percent_of_the_stage_error() {
        let (_, without) = swing(None, 0.0);
        let (_, with) = swing(Some(Protection::Saturate), 0.0);
        assert!((0.6..1.0).contains(&without), "{without}");
        assert!(with < 0.02 * without && with > 0.0, "{with}");
    }

    #[test]
    fn limit_of_eq_5_is_that_of_the_machine() {
        let mut machine = Machine::built_in("xyz-galvo-40").expect("a profile");
        assert_eq!(Protection::ACCUMULATED.on(&machine), Protection::ACCUMULATED);
        machine.scanner.accumulated_error = Some(terrace_core::units::LengthTime::mm_s(0.5));
        assert_eq!(Protection::ACCUMULATED.on(&machine), Protection::Accumulated { sum: Sum::Signed, limit: 0.5 });
        assert_eq!(Protection::Saturate.on(&machine), Protection::Saturate);
    }

    #[test]
    fn only_clipping_keeps_the_scanner_in_its_field_and_lets_it_recover() {
        let (most, rms) = swing(Some(Protection::Saturate), 5.0);
        let overshoot = 1.0 + math::exp(-PI * 0.7 / (1.0f64 - 0.49).sqrt());
        assert!(most <= 5.0 * overshoot && most > 5.0 - 1e-6, "{most}");
        assert!(rms < 0.05, "{rms}");
        assert!(swing(Some(Protection::Off), 5.0).0 > 5.5);
        let eq5 = |sum| Some(Protection::Accumulated { sum, limit: 0.02 });
        // What is left never adds up to the limit, so nothing is held back.
        assert!(swing(eq5(Sum::Residual), 5.0).0 > 5.5);
        // The sum of sizes passes the limit in the lag of the start, and stays there.
        let (_, given_up) = swing(eq5(Sum::Absolute), 5.0);
        assert!((given_up - swing(None, 5.0).1).abs() < 1e-9, "{given_up}");
    }
}
