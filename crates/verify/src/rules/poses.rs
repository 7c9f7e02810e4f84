//! `agreement` of poses: the head is where the commands of the block bring it, and turned as its axes turn it, by the
//! verifier's own kinematics.

use std::path::Path;

use crate::geometry::HeadPose;
use crate::proof::Rule;
use crate::read::Fault;
use crate::read::formats;
use crate::read::poses::Pose;
use crate::read::program::ProgramFile;
use terrace_core::geom::NM_PER_MM;
use terrace_core::machine::{Machine, Origin};
use terrace_core::program::Block;

/// How far a pose may be off, nm and rad: its centre is rounded to the nanometre in the turned frame and again in that
/// of the part, and each of three angles to a millionth of a degree.
const NEAR: [f64; 2] = [2.0, 3e-8];

/// What single precision may take away besides: of a length this share, and of three angles of up to half a turn.
const SINGLE: [f64; 2] = [6e-8, 6e-7];

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
        if let Some(fault) = fault(pose.at.map(|v| v as f64), turns, block, file.origin(block), machine, [0.0; 2]) {
            rule.broken(&pose.block, name, fault);
        }
    }
}

/// What is wrong with a pose of single precision: mm, then degrees about z, y and x.
pub(super) fn single(values: &[f32], block: &Block, origin: Origin, machine: &Machine) -> Option<String> {
    let &[x, y, z, c, b, a] = values else { return Some(format!("its pose has {} values, not six", values.len())) };
    fault([x, y, z].map(|v| f64::from(v) * NM_PER_MM), [c, b, a].map(f64::from), block, origin, machine, SINGLE)
}

fn fault(
    at: [f64; 3],
    turns: [f64; 3],
    block: &Block,
    origin: Origin,
    machine: &Machine,
    [share, wide]: [f64; 2],
) -> Option<String> {
    if !at.iter().chain(&turns).all(|v| v.is_finite()) {
        return Some("the pose is not of finite numbers".into());
    }
    let HeadPose { centre, axes } = HeadPose::of(machine, block.stage, block.stop.tilt, origin);
    let mm = |p: [f64; 3]| p.map(|v| v.round() / NM_PER_MM);
    if (0..3).any(|k| (at[k] - centre[k]).abs() > NEAR[0] + share * centre[k].abs()) {
        return Some(format!("the pose is at {:?} mm, the commands bring the head to {:?} mm", mm(at), mm(centre)));
    }
    let [(sz, cz), (sy, cy), (sx, cx)] = turns.map(|deg| (deg / 180.0 * std::f64::consts::PI).sin_cos());
    let columns = [
        [cz * cy, sz * cy, -sy],
        [cz * sy * sx - sz * cx, sz * sy * sx + cz * cx, cy * sx],
        [cz * sy * cx + sz * sx, sz * sy * cx - cz * sx, cy * cx],
    ];
    let off = (0..9).map(|i| (columns[i / 3][i % 3] - axes[i / 3][i % 3]).abs()).fold(0.0, f64::max);
    (off > NEAR[1] + wide)
        .then(|| format!("the pose is turned by {turns:?} deg about z, y and x, {off:.3e} rad off the head's axes"))
}
