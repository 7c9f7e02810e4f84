//! One LightBurn project (`.lbrn2`) per block, for LightBurn with a galvo: the strokes, and the settings of their pens.
//!
//! XML. A `CutSetting` (layer) for every pen of the block, with the number of the pen from 0; `Shape`s of type `Path` in
//! marking order, each with strokes of one pen that follow each other. mm in controller coordinates; the origin of a
//! LightBurn workspace is a corner of the field, so `XForm` moves the optical axis into its middle. Numbers are plain
//! decimals.

use super::known::{JobPens, Key, KnownFault};
use crate::check::Checked;
use terrace_core::diag::Diag;
use terrace_core::geom::{ControllerPoint, NM_PER_MM, Nm};
use terrace_core::machine::Machine;
use terrace_core::program::{BlockId, Pen, Program, Stroke};

/// Layers that a LightBurn project has.
const MOST_LAYERS: usize = 30;

/// Most vertices of one shape, so that LightBurn need not draw a block as one path.
const MOST_VERTICES: usize = 50_000;

/// The project of block `index`.
///
/// # Panics
/// If there is no such block.
pub fn block(checked: &Checked, machine: &Machine, index: usize) -> Vec<u8> {
    let program = checked.program();
    let block = &program.blocks[index];
    let strokes = program.strokes_of(block);
    let points: usize = strokes.iter().map(|s| s.len as usize).sum();
    let mut out = Vec::with_capacity(1024 + points * 50);
    out.extend_from_slice(
        b"<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<LightBurnProject AppVersion=\"1.4.00\" FormatVersion=\"1\" \
          MaterialHeight=\"0\" MirrorX=\"False\" MirrorY=\"False\">\n",
    );
    for pen in program.pens_of(block) {
        cut_setting(&mut out, index, pen.index(), &program.pens[pen.index()], machine);
    }
    let mut rest = strokes;
    while !rest.is_empty() {
        let (now, later) = rest.split_at(run_length(rest));
        shape(&mut out, program, machine, now);
        rest = later;
    }
    out.extend_from_slice(b"</LightBurnProject>\n");
    out
}

/// What of a job LightBurn cannot hold.
pub(super) fn known_faults(job: &JobPens<'_>) -> Vec<KnownFault> {
    let JobPens { last_pen, has_dots, .. } = *job;
    let mut faults = Vec::new();
    if last_pen > MOST_LAYERS {
        let text = format!("the job marks with pen {last_pen}, but a LightBurn project has {MOST_LAYERS} layers");
        let hint = "use fewer pens, or a larger dose.step where the dose makes pens; or leave \"lightburn\" out";
        faults.push((Key::Format, Diag::limit("lightburn-layers", text).hint(hint)));
    }
    if has_dots {
        let text = "the job has dots, and a path of a LightBurn project cannot be a point with a dwell";
        let hint = "leave \"lightburn\" out of emit.formats";
        faults.push((Key::Format, Diag::limit("lightburn-dots", text).hint(hint)));
    }
    faults
}

/// How many of the strokes, from the first on, go into one shape.
fn run_length(strokes: &[Stroke]) -> usize {
    let mut vertices = 0;
    for (i, stroke) in strokes.iter().enumerate() {
        vertices += stroke.len as usize;
        if stroke.pen != strokes[0].pen || vertices > MOST_VERTICES {
            // One stroke cannot be divided, however long it is.
            return i.max(1);
        }
    }
    strokes.len()
}

fn cut_setting(out: &mut Vec<u8>, block: usize, layer: usize, pen: &Pen, machine: &Machine) {
    let percent = 100.0 * pen.power.share(machine.laser.max_power);
    let name = format!("{}_P{}", BlockId::new(block), layer + 1);
    let text = format!(
        "<CutSetting type=\"Cut\">\n<index Value=\"{layer}\"/>\n<name Value=\"{name}\"/>\n\
         <maxPower Value=\"{power}\"/>\n<maxPower2 Value=\"{power}\"/>\n<speed Value=\"{speed}\"/>\n\
         <frequency Value=\"{rate}\"/>\n<numPasses Value=\"{passes}\"/>\n<priority Value=\"{layer}\"/>\n</CutSetting>\n",
        power = millionths(percent),
        speed = millionths(pen.speed.as_mm_s()),
        rate = (pen.frequency.as_khz() * 1e3).round() as u64,
        passes = pen.passes,
    );
    out.extend_from_slice(text.as_bytes());
}

/// A number with six decimals, of which zeros at the end are left out.
fn millionths(value: f64) -> String {
    let mut text = Vec::new();
    super::push_mm(&mut text, (value * 1e6).round() as i64);
    let text = String::from_utf8(text).expect("digits");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

fn shape(out: &mut Vec<u8>, program: &Program, machine: &Machine, strokes: &[Stroke]) {
    let [mut width, mut height] = machine.lens.field.map(|size| size.as_mm());
    if machine.scanner.swap_xy {
        std::mem::swap(&mut width, &mut height);
    }
    out.extend_from_slice(
        format!("<Shape Type=\"Path\" CutIndex=\"{}\">\n<XForm>1 0 0 1", strokes[0].pen.0).as_bytes(),
    );
    for size in [width, height] {
        out.push(b' ');
        super::push_mm(out, Nm::round(size / 2.0 * NM_PER_MM).0);
    }
    out.extend_from_slice(b"</XForm>\n<VertList>");
    for &point in strokes.iter().flat_map(|s| program.points_of(s)) {
        let ControllerPoint { x, y } = machine.scanner.controller_from_field(point);
        out.push(b'V');
        super::push_mm(out, i64::from(x));
        out.push(b' ');
        super::push_mm(out, i64::from(y));
        // Straight on both sides: no handles.
        out.extend_from_slice(b"c0x1c1x1");
    }
    out.extend_from_slice(b"</VertList>\n<PrimList>");
    let mut digits = itoa::Buffer::new();
    let mut first = 0u32;
    for stroke in strokes {
        for i in first..first + stroke.len - 1 {
            for (before, vertex) in [(b'L', i), (b' ', i + 1)] {
                out.push(before);
                out.extend_from_slice(digits.format(vertex).as_bytes());
            }
        }
        first += stroke.len;
    }
    out.extend_from_slice(b"</PrimList>\n</Shape>\n");
}

#[cfg(test)]
mod tests {
    use super::*;
    use terrace_core::program::sample;

    fn sample() -> (Checked, Machine) {
        let (program, origin) = sample::program();
        (Checked::unchecked(program, origin), Machine::built_in("xyz-galvo-40").expect("profile"))
    }

    #[test]
    fn project_holds_the_settings_of_its_pens_and_its_strokes_in_order() {
        let (checked, machine) = sample();
        let text = String::from_utf8(block(&checked, &machine, 2)).expect("text");
        let settings = "<index Value=\"1\"/>\n<name Value=\"B0003_P2\"/>\n<maxPower Value=\"25\"/>\n\
                        <maxPower2 Value=\"25\"/>\n<speed Value=\"400\"/>\n<frequency Value=\"80000\"/>\n\
                        <numPasses Value=\"3\"/>";
        assert!(text.contains(settings), "{text}");
        let square = "<Shape Type=\"Path\" CutIndex=\"1\">\n<XForm>1 0 0 1 20.000000 20.000000</XForm>\n<VertList>\
                      V-0.000001 -0.000001c0x1c1x1V19.999999 -0.000001c0x1c1x1V19.999999 20.000000c0x1c1x1\
                      V-0.000001 20.000000c0x1c1x1V-0.000001 -0.000001c0x1c1x1</VertList>\n\
                      <PrimList>L0 1L1 2L2 3L3 4</PrimList>\n</Shape>\n<Shape Type=\"Path\" CutIndex=\"0\">";
        assert!(text.contains(square), "{text}");
    }

    #[test]
    fn strokes_of_one_pen_share_a_shape_up_to_its_limit() {
        let (checked, _) = sample();
        let strokes = checked.program().strokes_of(&checked.program().blocks[0]);
        assert_eq!(run_length(strokes), 2);
        let many = vec![strokes[0]; MOST_VERTICES];
        assert_eq!(run_length(&many), MOST_VERTICES / 2);
        let long = [Stroke { len: MOST_VERTICES as u32 + 1, ..strokes[0] }, strokes[0]];
        assert_eq!(run_length(&long), 1);
    }

    #[test]
    fn more_pens_than_layers_are_refused() {
        let (checked, machine) = sample();
        let mut program = checked.program().clone();
        let faults = |program: &Program| known_faults(&JobPens::of_program(program, &machine));
        assert!(faults(&program).is_empty());
        program.pens.resize(31, program.pens[0].clone());
        assert!(faults(&program).is_empty(), "pens that mark nothing need no layer");
        program.strokes[0].pen = terrace_core::program::PenId(30);
        assert_eq!(faults(&program)[0].1.code, "lightburn-layers");
    }

    #[test]
    fn dots_are_refused() {
        let (checked, machine) = sample();
        let mut program = checked.program().clone();
        program.strokes[0].len = 1;
        let faults = known_faults(&JobPens::of_program(&program, &machine));
        assert!(matches!(&faults[..], [(Key::Format, fault)] if fault.code == "lightburn-dots"), "{faults:?}");
    }

    #[test]
    fn numbers_are_plain_decimals() {
        for (value, text) in [(25.0, "25"), (0.1, "0.1"), (1e-7, "0"), (33.333_333_33, "33.333333"), (3000.0, "3000")] {
            assert_eq!(millionths(value), text);
        }
    }
}
