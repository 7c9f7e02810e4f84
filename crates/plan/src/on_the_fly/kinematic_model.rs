//! The machine of seven axes under a part: what its axes can do, and from where their angles are seen.
//!
//! Consumes a machine, the job's pens and where the part lies; promises the limits of all axes in the units and signs
//! of their motion, and axis values over points of the part. Units: mm, s, rad.

use crate::on_the_fly::axes::following_error::Servo;
use crate::on_the_fly::axes::kinematics::{Axes, Branches, FieldPosition, Pivot, Pose};
use crate::on_the_fly::axes::motion::{AXES, STAGE};
use crate::on_the_fly::path::Path;
use crate::on_the_fly::topp::Limit;
use terrace_core::diag::Error;
use terrace_core::geom::{P3Mm, Part};
use terrace_core::machine::{Carries, Letter, Machine};
use terrace_core::math;
use terrace_core::motion::GalvoModel;
use terrace_core::program::Pen;

/// A machine of seven axes under a part.
#[derive(Clone, Debug)]
pub struct KinematicModel<'a> {
    /// The machine.
    pub machine: &'a Machine,
    /// The job's pens.
    pub pens: &'a [Pen],
    /// What X, Y, Z, A and C can do.
    pub limits: [Limit; STAGE],
    /// What U and V can do; None where the machine does not state it, and they are always at speed.
    pub spot: Option<Limit>,
    /// Travel of C as the motion counts it.
    pub c_travel: [f64; 2],
    /// The point of the part about which A and C turn: how far marks lie from it decides how X, Y and Z must go along.
    pub pivot: P3Mm<Part>,
}

/// A rotary axis that a motion turns beyond its travel; angles in deg.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BeyondTravel {
    /// The axis.
    pub letter: Letter,
    /// The lowest and the highest command of the axis.
    pub needed: [f64; 2],
    /// The travel of the axis.
    pub travel: [f64; 2],
}

impl<'a> KinematicModel<'a> {
    /// The model of a part whose origin lies at `origin` in the machine, mm; None where the machine does not turn the
    /// part by a swivel A with a turntable C on it, or does not state speed and acceleration of both.
    pub fn of(machine: &'a Machine, pens: &'a [Pen], origin: [f64; 3]) -> Option<Self> {
        let linear = machine.axes().map(|(_, axis)| Limit {
            speed: axis.speed.as_mm_s(),
            acceleration: axis.acceleration.as_mm_s2(),
            jerk: axis.jerk.map(|j| j.as_mm_s3()),
        });
        let table = machine.tilt.as_ref().filter(|table| table.carries == Carries::Part)?;
        if table.axes.each_ref().map(|axis| axis.letter) != [Letter::A, Letter::C] {
            return None;
        }
        let [a, c] = table.axes.each_ref().map(|axis| {
            let (speed, acceleration) = (axis.speed?.as_rad_s(), axis.acceleration?.as_rad_s2());
            Some(Limit { speed, acceleration, jerk: axis.jerk.map(|j| j.as_rad_s3()) })
        });
        let jump_speed = machine.scanner.jump_speed.as_mm_s();
        let spot = match GalvoModel::of(machine) {
            GalvoModel::AtSpeed => None,
            GalvoModel::RestToRest { acceleration, jerk } => Some(Limit { speed: jump_speed, acceleration, jerk }),
        };
        let [x, y, z] = linear;
        let pivot = P3Mm::new([0, 1, 2].map(|k| table.pivot[k].as_mm() - origin[k]));
        // A positive command turns the part right-handed, or the other way where the axis is reversed; a positive C of
        // the motion always turns it the other way.
        let turntable = &table.axes[1];
        let endless = [f64::NEG_INFINITY, f64::INFINITY];
        let [lo, hi] = turntable.travel.ends().map_or(endless, |ends| ends.map(|end| end.as_rad()));
        let c_travel = if turntable.reversed { [lo, hi] } else { [-hi, -lo] };
        Some(Self { machine, pens, limits: [x, y, z, a?, c?], spot, c_travel, pivot })
    }

    /// How far the spot may be from the optical axis: the field in any direction, less the following error of X and Y
    /// when both run at top speed, but half of it at least.
    ///
    /// # Errors
    /// `fly-servo` where frequency or damping of a servo is not positive and finite.
    pub fn scanner_margin(&self) -> Result<f64, Error> {
        let (reach, [x, y]) = (self.machine.field_reach(), Servo::following_error(self.machine)?);
        Ok(reach - math::hypot(x, y).min(reach / 2.0))
    }

    /// A point of the part seen from the pivot.
    pub fn from_pivot(&self, p: P3Mm<Part>) -> P3Mm<Pivot> {
        P3Mm::new(p.way_from(self.pivot))
    }

    /// Poses of the part seen from the pivot.
    pub(crate) fn all_from_pivot(&self, poses: &[Pose<Part>]) -> Vec<Pose<Pivot>> {
        poses.iter().map(|pose| Pose { p: self.from_pivot(pose.p), n: pose.n }).collect()
    }

    /// The branches that a path may take: the quickest.
    pub(crate) fn branches(&self) -> Branches {
        Branches::Quickest { a: self.limits[3].speed, c: self.limits[4].speed }
    }

    /// What X, Y, Z, A, C, U and V can do.
    pub fn all_limits(&self) -> [Limit; AXES] {
        let [x, y, z, a, c] = self.limits;
        let speed = self.machine.scanner.jump_speed.as_mm_s();
        let spot = self.spot.unwrap_or(Limit { speed, acceleration: f64::INFINITY, jerk: None });
        [x, y, z, a, c, spot, spot]
    }

    /// The rotary axes that a motion turns beyond their travel.
    pub fn beyond_travel(&self, axes: &[Axes]) -> Vec<BeyondTravel> {
        /// What rounding may add to a command, deg: programs count in millionths.
        const ROUNDED: f64 = 1e-6;
        // A positive C of the motion turns the part the other way than a positive command.
        let angles: [fn(&Axes) -> f64; 2] = [|axes| axes.a, |axes| -axes.c];
        let table = self.machine.tilt.iter().flat_map(|table| &table.axes);
        let beyond = table.zip(angles).filter_map(|(axis, angle)| {
            let travel = axis.travel.ends()?.map(|end| end.as_deg());
            let sign = if axis.reversed { -1.0 } else { 1.0 };
            let commands = axes.iter().map(|axes| (sign * angle(axes)).to_degrees());
            let needed = commands.fold([f64::INFINITY, f64::NEG_INFINITY], |[lo, hi], v| [lo.min(v), hi.max(v)]);
            let is_within = needed[0] >= travel[0] - ROUNDED && needed[1] <= travel[1] + ROUNDED;
            (!is_within).then_some(BeyondTravel { letter: axis.letter, needed, travel })
        });
        beyond.collect()
    }

    /// Axis values at a node of the path: X, Y, Z, A, C, U, V.
    pub fn values(&self, axes: &Axes, p: P3Mm<Part>) -> [f64; AXES] {
        let FieldPosition { uv: [u, v], .. } = axes.seen(self.from_pivot(p));
        let [x, y, z] = axes.xyz.mm;
        [x, y, z, axes.a, axes.c, u, v]
    }

    /// The path with run-ups before and after the marks of pens that ask for skywriting, where the spot needs any.
    pub fn with_run_ups(&self, path: &Path, skywriting: &[bool]) -> Path {
        /// How many times longer than the way to the pen's speed: the stage takes a share of the scanner's limits.
        const LONGER: f64 = 1.5;
        let galvo = GalvoModel::of(self.machine);
        let way = |(pen, asks): (&Pen, &bool)| if *asks { LONGER * galvo.run_up_mm(pen.speed.as_mm_s()) } else { 0.0 };
        path.with_run_ups(&self.pens.iter().zip(skywriting).map(way).collect::<Vec<_>>())
    }

    /// The largest speed along the path, seen from the lens, on the stretch that ends at a node. The beam stands nearly
    /// upright on the part: a pen's speed is one along the part.
    pub fn cap(&self, path: &Path, way: &[f64], i: usize) -> f64 {
        let node = &path.nodes[i];
        let Some(pen) = node.pen.or(node.run) else { return self.machine.scanner.jump_speed.as_mm_s() };
        let (plan, rise) = (way[i] - way[i - 1], path.nodes[i].at[2] - path.nodes[i - 1].at[2]);
        self.pens[pen.index()].speed.as_mm_s() * plan / math::hypot(plan, rise)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use terrace_core::machine::AxisTravel;
    use terrace_core::units::Angle;

    #[test]
    fn travel_is_exceeded_by_an_end_as_by_the_width_and_counts_commands() {
        let mut machine = Machine::built_in("xyzac-galvo-10").expect("a profile");
        let travel = |lo: f64, hi: f64| AxisTravel::Ends([lo, hi].map(Angle::deg));
        let table = machine.tilt.as_mut().expect("a table");
        (table.axes[0].travel, table.axes[1].travel) = (travel(0.0, 30.0), travel(-20.0, 90.0));
        let axes = |a: f64, c: f64| Axes { xyz: P3Mm::new([0.0; 3]), a: a.to_radians(), c: c.to_radians() };
        let beyond = |axes: &[Axes]| {
            let model = KinematicModel::of(&machine, &[], [0.0; 3]).expect("seven axes");
            model.beyond_travel(axes).into_iter().map(|b| (b.letter, b.needed.map(f64::round))).collect::<Vec<_>>()
        };
        assert_eq!(beyond(&[axes(0.0, 20.0), axes(30.0, -90.0)]), []);
        // 20 deg wide, but from below the lower end; C turns against its command.
        assert_eq!(
            beyond(&[axes(-10.0, 0.0), axes(10.0, 60.0)]),
            [(Letter::A, [-10.0, 10.0]), (Letter::C, [-60.0, 0.0])]
        );
    }
}
