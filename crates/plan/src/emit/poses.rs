//! The pose of the head at every block, for a robot or a gantry that carries it.
//!
//! One CSV file for the job: a header line, then one line per block in marking order with the place of the tool centre
//! and three turns. The tool centre is the centre of the field in the focal plane that the stage sets. The frame is that
//! of the part (of the surface file, turned as `placement` says), whichever of part and head the axes carry. The tool's
//! x and y are those of the field, its z points along the beam to the lens. With the turns rz, ry and rx (right-handed,
//! about z, then about the turned y, then about the twice turned x: ZYX Euler angles) the tool's axes are the columns of
//! Rz Ry Rx.

use super::Stepped;
use terrace_core::geom::{NM_PER_MM, P3};
use terrace_core::machine::{Machine, Origin};
use terrace_core::math;
use terrace_core::program::Block;

/// The names of the columns.
const HEADER: &[u8] = b"block,x_mm,y_mm,z_mm,rz_deg,ry_deg,rx_deg\r\n";

/// Where the head is, and how it is turned, on the part.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Pose {
    /// The tool centre, nm.
    pub(super) at: [i64; 3],
    /// Turns about z, y and x, millionths of a degree.
    pub(super) turns: [i64; 3],
}

impl Pose {
    /// At a block of a part whose origin lies at `origin`.
    pub(super) fn of(machine: &Machine, block: &Block, origin: Origin) -> Self {
        let turn = machine.turn(block.stop.tilt, origin);
        let centre = block.stop.centre;
        let at = turn.back(P3::new([centre.x, centre.y, block.stage_plane().0].map(|v| v as f64))).at;
        let [x, y, z] = turn.rows();
        let turns = [math::atan2(x[1], x[0]), math::atan2(-x[2], math::hypot(x[0], x[1])), math::atan2(y[2], z[2])];
        Self { at: at.map(|v| v.round() as i64), turns: turns.map(|v| (v.to_degrees() * 1e6).round() as i64) }
    }

    /// All six, mm and degrees.
    pub(super) fn values(self) -> [f64; 6] {
        let ([x, y, z], [c, b, a]) = (self.at, self.turns);
        [x, y, z, c, b, a].map(|v| v as f64 / NM_PER_MM)
    }
}

/// The poses of a job.
pub fn write(job: &Stepped<'_>) -> Vec<u8> {
    let program = job.checked.program();
    let mut out = HEADER.to_vec();
    for (i, block) in program.blocks.iter().enumerate() {
        let Pose { at, turns } = Pose::of(job.machine, block, job.checked.origins()[block.setup.index()]);
        out.extend_from_slice(program.id(i).to_string().as_bytes());
        for v in at.into_iter().chain(turns) {
            out.push(b',');
            // Millionths of a degree have as many decimals as nanometres in mm.
            super::push_mm(&mut out, v);
        }
        out.extend_from_slice(b"\r\n");
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use terrace_core::machine::TiltAngles;

    #[test]
    fn turns_about_z_then_y_then_x_give_the_axes_of_the_tool() {
        let machine = Machine::built_in("xyz-headtilt-galvo-40").expect("a profile");
        let (program, _) = terrace_core::program::sample::program();
        let mut block = program.blocks[0].clone();
        // B first, A nearer to the head: its z is (sin b cos a, -sin a, cos b cos a).
        for (a, b) in [(0.0, 0.0), (10.0, 0.0), (0.0, -7.0), (12.0, 5.0), (-20.0, 20.0)] {
            block.stop.tilt = TiltAngles([b, a].map(|v: f64| (v * 1e6) as i64));
            let pose = Pose::of(&machine, &block, Origin([1_000_000, 2_000_000, 3_000_000]));
            let [_, _, _, rz, ry, rx] = pose.values().map(f64::to_radians);
            let column = [
                math::cos(rz) * math::sin(ry) * math::cos(rx) + math::sin(rz) * math::sin(rx),
                math::sin(rz) * math::sin(ry) * math::cos(rx) - math::cos(rz) * math::sin(rx),
                math::cos(ry) * math::cos(rx),
            ];
            let ((sa, ca), (sb, cb)) = (math::sin_cos(f64::to_radians(a)), math::sin_cos(f64::to_radians(b)));
            let wanted = [sb * ca, -sa, cb * ca];
            let off = (0..3).map(|k| (column[k] - wanted[k]).abs()).fold(0.0, f64::max);
            assert!(off < 3e-8, "{a} {b}: {column:?} {wanted:?}");
        }
    }
}
