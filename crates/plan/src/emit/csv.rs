//! One CSV file per block, for controllers and scripts that read plain points.
//!
//! A header line, then one line per point in marking order: number of the stroke and of its pen, both from 1, and x
//! and y in mm in controller coordinates, origin on the optical axis. The beam is on between two lines of the same
//! stroke. A closed figure ends on the point it starts with. A stroke of one line is a dot: the beam is on there for the
//! dwell of its pen.

use crate::check::Checked;
use terrace_core::geom::ControllerPoint;
use terrace_core::machine::Machine;

/// The names of the columns.
const HEADER: &[u8] = b"stroke,pen,x_mm,y_mm\r\n";

/// The points of block `index`.
///
/// # Panics
/// If there is no such block.
pub fn block(checked: &Checked, machine: &Machine, index: usize) -> Vec<u8> {
    let program = checked.program();
    let strokes = program.strokes_of(&program.blocks[index]);
    let points: usize = strokes.iter().map(|s| s.len as usize).sum();
    let mut out = Vec::with_capacity(HEADER.len() + points * 32);
    out.extend_from_slice(HEADER);
    let mut digits = itoa::Buffer::new();
    for (number, stroke) in (1..).zip(strokes) {
        for &point in program.points_of(stroke) {
            let ControllerPoint { x, y } = machine.scanner.controller_from_field(point);
            for whole in [number, stroke.pen.index() + 1] {
                out.extend_from_slice(digits.format(whole).as_bytes());
                out.push(b',');
            }
            super::push_mm(&mut out, i64::from(x));
            out.push(b',');
            super::push_mm(&mut out, i64::from(y));
            out.extend_from_slice(b"\r\n");
        }
    }
    out
}
