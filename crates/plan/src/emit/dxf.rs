//! One DXF R12 drawing per block, for marking software that imports drawings.
//!
//! mm in controller coordinates, origin on the optical axis, z = 0: the stage sets the focus. A
//! stroke of two points is a LINE, a longer one a POLYLINE, a dot a POINT, in marking order. A stroke of four or more
//! points that ends where it starts is a closed POLYLINE that does not repeat its first point. One layer
//! per pen, `B0001_P1`, in the colour with the pen's number. R12 has no unit: the run sheet says mm.

use crate::check::Checked;
use terrace_core::geom::ControllerPoint;
use terrace_core::machine::Machine;
use terrace_core::program::{BlockId, PenId};

/// The drawing of block `index`.
///
/// # Panics
/// If there is no such block.
pub fn block(checked: &Checked, machine: &Machine, index: usize) -> Vec<u8> {
    let program = checked.program();
    let block = &program.blocks[index];
    let strokes = program.strokes_of(block);
    let points: usize = strokes.iter().map(|s| s.len as usize).sum();
    let id = program.id(index);
    let pens = program.pens_of(block);

    let mut out = Vec::with_capacity(1024 + strokes.len() * 70 + points * 60);
    head(&mut out, id, &pens);
    // Everything of an entity that does not depend on the stroke, made once per pen.
    let all = (0..program.pens.len() as u16).map(PenId);
    let layers: Vec<Option<Layer>> = all.map(|pen| pens.contains(&pen).then(|| Layer::new(id, pen))).collect();
    for stroke in strokes {
        let layer = layers[stroke.pen.index()].as_ref().expect("the pens of all strokes were listed");
        let points = program.points_of(stroke).iter().map(|&p| machine.scanner.controller_from_field(p));
        layer.stroke(&mut out, points);
    }
    out.extend_from_slice(b"0\r\nENDSEC\r\n0\r\nEOF\r\n");
    out
}

/// Header, line type and layers, up to the first entity.
fn head(out: &mut Vec<u8>, id: BlockId, pens: &[PenId]) {
    let mut line = |code: u8, value: &str| out.extend_from_slice(format!("{code}\r\n{value}\r\n").as_bytes());
    line(0, "SECTION");
    line(2, "HEADER");
    line(9, "$ACADVER");
    line(1, "AC1009");
    line(0, "ENDSEC");
    line(0, "SECTION");
    line(2, "TABLES");
    line(0, "TABLE");
    line(2, "LTYPE");
    line(70, "1");
    line(0, "LTYPE");
    line(2, "CONTINUOUS");
    line(70, "0");
    line(3, "Solid line");
    line(72, "65");
    line(73, "0");
    line(40, "0.0");
    line(0, "ENDTAB");
    line(0, "TABLE");
    line(2, "LAYER");
    line(70, &pens.len().to_string());
    for &pen in pens {
        line(0, "LAYER");
        line(2, &layer_name(id, pen));
        line(70, "0");
        line(62, &colour(pen).to_string());
        line(6, "CONTINUOUS");
    }
    line(0, "ENDTAB");
    line(0, "ENDSEC");
    line(0, "SECTION");
    line(2, "ENTITIES");
}

fn layer_name(id: BlockId, pen: PenId) -> String {
    format!("{id}_P{}", pen.number())
}

/// Colour of a layer: the pen's number; there are 255.
fn colour(pen: PenId) -> usize {
    pen.index() % 255 + 1
}

/// The constant text of the entities on one layer.
struct Layer {
    dot: Vec<u8>,
    line: Vec<u8>,
    polyline: Vec<u8>,
    vertex: Vec<u8>,
    end: Vec<u8>,
}

impl Layer {
    fn new(id: BlockId, pen: PenId) -> Self {
        let layer = layer_name(id, pen);
        let entity = |kind: &str, rest: &str| format!("0\r\n{kind}\r\n8\r\n{layer}\r\n{rest}").into_bytes();
        Self {
            dot: entity("POINT", "10\r\n"),
            line: entity("LINE", "10\r\n"),
            polyline: entity("POLYLINE", "66\r\n1\r\n10\r\n0.0\r\n20\r\n0.0\r\n30\r\n0.0\r\n"),
            vertex: entity("VERTEX", "10\r\n"),
            end: entity("SEQEND", ""),
        }
    }

    fn stroke(&self, out: &mut Vec<u8>, mut points: impl ExactSizeIterator<Item = ControllerPoint> + Clone) {
        let count = points.len();
        if count == 1 {
            out.extend_from_slice(&self.dot);
            let point = points.next().expect("one point");
            return coordinates(out, point, b"\r\n20\r\n", b"\r\n30\r\n0.0\r\n");
        }
        if count == 2 {
            let mut next = || points.next().expect("two points");
            out.extend_from_slice(&self.line);
            coordinates(out, next(), b"\r\n20\r\n", b"\r\n30\r\n0.0\r\n11\r\n");
            coordinates(out, next(), b"\r\n21\r\n", b"\r\n31\r\n0.0\r\n");
            return;
        }
        let closed = count >= 4 && points.clone().next() == points.clone().last();
        out.extend_from_slice(&self.polyline);
        if closed {
            out.extend_from_slice(b"70\r\n1\r\n");
        }
        for point in points.take(count - usize::from(closed)) {
            out.extend_from_slice(&self.vertex);
            coordinates(out, point, b"\r\n20\r\n", b"\r\n30\r\n0.0\r\n");
        }
        out.extend_from_slice(&self.end);
    }
}

fn coordinates(out: &mut Vec<u8>, ControllerPoint { x, y }: ControllerPoint, between: &[u8], after: &[u8]) {
    super::push_mm(out, i64::from(x));
    out.extend_from_slice(between);
    super::push_mm(out, i64::from(y));
    out.extend_from_slice(after);
}

#[cfg(test)]
mod tests {
    use super::*;
    use terrace_core::program::sample;

    fn sample_block(index: usize, swap: bool) -> String {
        let (program, origin) = sample::program();
        let mut machine = Machine::built_in("xyz-galvo-40").expect("profile");
        machine.scanner.swap_xy = swap;
        machine.scanner.mirror_x = swap;
        let bytes = block(&Checked::unchecked(program, origin), &machine, index);
        String::from_utf8(bytes).expect("ASCII")
    }

    /// Group codes and values of the entities.
    fn entities(text: &str) -> Vec<(u32, &str)> {
        let start = text.find("ENTITIES\r\n").expect("section") + "ENTITIES\r\n".len();
        let lines: Vec<&str> = text[start..].split_terminator("\r\n").collect();
        lines.chunks(2).map(|pair| (pair[0].parse().expect("code"), pair[1])).collect()
    }

    #[test]
    fn hatches_are_lines_in_marking_order() {
        let text = sample_block(0, false);
        let (x, y) = (10, 20);
        assert_eq!(
            entities(&text)[..9],
            [
                (0, "LINE"),
                (8, "B0001_P1"),
                (x, "-5.000000"),
                (y, "0.000001"),
                (30, "0.0"),
                (11, "5.000001"),
                (21, "0.000001"),
                (31, "0.0"),
                (0, "LINE"),
            ]
        );
        assert!(text.ends_with("0\r\nENDSEC\r\n0\r\nEOF\r\n"));
        assert!(text.contains("62\r\n1\r\n") && !text.contains("_P2"), "only layers in use");
        assert_eq!(text.matches('\n').count(), text.matches("\r\n").count());
    }

    #[test]
    fn a_loop_is_closed_and_does_not_repeat_its_start() {
        let text = sample_block(2, false);
        let all = entities(&text);
        assert_eq!(all[2..7], [(66, "1"), (10, "0.0"), (20, "0.0"), (30, "0.0"), (70, "1")]);
        assert_eq!(all.iter().filter(|e| e.1 == "VERTEX").count(), 4);
        let open = sample_block(1, false);
        assert_eq!(entities(&open).iter().filter(|e| e.1 == "VERTEX").count(), 3);
        assert!(!entities(&open).contains(&(70, "1")));
    }

    #[test]
    fn points_are_those_of_the_controller() {
        let text = sample_block(0, true);
        // (-5, 0.000001) swapped is (0.000001, -5), then x mirrored.
        assert_eq!(entities(&text)[2..4], [(10, "-0.000001"), (20, "-5.000000")]);
        assert!(!sample_block(1, true).contains("-0.000000"), "a mirrored zero has no sign");
    }
}
