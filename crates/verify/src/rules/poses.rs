//! `agreement` of poses: the head is where the commands of the block bring it, and turned as its axes turn it, by the
//! verifier's own kinematics.

use std::path::Path;
use terrace_core::math;

use crate::geometry::HeadPose;
use crate::proof::Rule;
use crate::read::Fault;
use crate::read::formats;
use crate::read::poses::Pose;
use crate::read::program::ProgramFile;
use terrace_core::geom::NM_PER_MM;
use terrace_core::machine::{Machine, Origin};
use terrace_core::program::Block;

/// How far the centre of a pose may be off, nm: it is rounded to the nanometre in the turned frame and again in that of
/// the part, by half the diagonal of a cube of 1 nm each time, 0.87 nm.
const NEAR_NM: f64 = 2.0;

/// How far its directions may be off, rad: each of three angles is rounded to a millionth of a degree, by 8.7e-9 rad.
const NEAR_RAD: f64 = 3e-8;

/// How far single precision may move a pose besides.
struct Precision {
    /// Share of a length.
    share: f64,
    /// Of three angles together, rad.
    rad: f64,
}

const DOUBLE: Precision = Precision { share: 0.0, rad: 0.0 };

/// Half a step of f32 is 2^-24 of a length, and 1.3e-7 rad of an angle of up to half a turn.
const SINGLE: Precision = Precision { share: 6e-8, rad: 6e-7 };

/// Holds the list of poses against the program.
pub(super) fn check(
    folder: &Path,
    name: &str,
    read: fn(&[u8]) -> Result<Vec<Pose>, Fault>,
    file: &ProgramFile,
    machine: &Machine,
    rule: &mut Rule,
) {
    let poses = match formats::bytes(folder, name).map(|bytes| read(&bytes)) {
        Ok(Ok(poses)) => poses,
        Ok(Err(fault)) => return rule.broken("", format!("{name}:{}", fault.line), fault.message),
        Err(unread) => return rule.broken("", name, unread),
    };
    if !poses.iter().map(|p| &p.block).eq(&file.ids) {
        return rule.broken("", name, "does not list the blocks of program.txt in their order");
    }
    for (pose, block) in poses.iter().zip(&file.program.blocks) {
        rule.checked += 1;
        let turns = pose.turns.map(|v| v as f64 / 1e6);
        if let Some(fault) = fault(pose.at.map(|v| v as f64), turns, block, file.origin(block), machine, &DOUBLE) {
            rule.broken(&pose.block, name, fault);
        }
    }
}

/// The fault of a pose of single precision: mm, then degrees about z, y and x.
pub(super) fn single(values: &[f32], block: &Block, origin: Origin, machine: &Machine) -> Option<String> {
    let &[x, y, z, c, b, a] = values else { return Some(format!("its pose has {} values, not six", values.len())) };
    fault([x, y, z].map(|v| f64::from(v) * NM_PER_MM), [c, b, a].map(f64::from), block, origin, machine, &SINGLE)
}

/// The fault of a pose: tool centre in nm, turns about z, y and x in degrees.
fn fault(
    stated_centre: [f64; 3],
    turns: [f64; 3],
    block: &Block,
    origin: Origin,
    machine: &Machine,
    precision: &Precision,
) -> Option<String> {
    if !stated_centre.iter().chain(&turns).all(|v| v.is_finite()) {
        return Some("the pose is not of finite numbers".into());
    }
    let HeadPose { centre, axes } = HeadPose::new(machine, block.stage, block.stop.tilt, origin);
    let mm = |p: [f64; 3]| p.map(|v| v.round() / NM_PER_MM);
    let is_off = |k: usize| (stated_centre[k] - centre[k]).abs() > NEAR_NM + precision.share * centre[k].abs();
    if (0..3).any(is_off) {
        let (stated, found) = (mm(stated_centre), mm(centre));
        return Some(format!("the pose is at {stated:?} mm, the commands bring the head to {found:?} mm"));
    }
    let [(sz, cz), (sy, cy), (sx, cx)] = turns.map(|deg| math::sin_cos(deg / 180.0 * std::f64::consts::PI));
    let columns = [
        [cz * cy, sz * cy, -sy],
        [cz * sy * sx - sz * cx, sz * sy * sx + cz * cx, cy * sx],
        [cz * sy * cx + sz * sx, sz * sy * cx - cz * sx, cy * cx],
    ];
    let off = (0..9).map(|i| (columns[i / 3][i % 3] - axes[i / 3][i % 3]).abs()).fold(0.0, f64::max);
    (off > NEAR_RAD + precision.rad)
        .then(|| format!("the pose is turned by {turns:?} deg about z, y and x, {off:.3e} rad off the head's axes"))
}
