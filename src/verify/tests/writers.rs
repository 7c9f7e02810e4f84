//! Writers of the files of a job folder for tests: short, apart from the ones of the product.

use std::fmt::Write;

use crate::geom::{FieldPoint, mm_from_nm};
use crate::machine::{Machine, Origin};
use crate::program::{Block, BlockId, Program};

pub(super) fn program(program: &Program, o: Origin) -> String {
    let mut t = format!("terrace program 1\norigin {} {} {}\npens {}\n", o[0], o[1], o[2], program.pens.len());
    for p in &program.pens {
        writeln!(t, "pen {} | {} | {} | {} | {}", p.name, p.speed, p.power, p.frequency, p.passes).expect("text");
    }
    writeln!(t, "blocks {}", program.blocks.len()).expect("text");
    for (i, b) in program.blocks.iter().enumerate() {
        let s = &b.stop;
        let numbers = [
            i64::from(s.section.0[0]),
            i64::from(s.section.0[1]),
            i64::from(s.level),
            s.tilt[0],
            s.tilt[1],
            s.centre.x,
            s.centre.y,
            s.focus.0,
            s.z_lo.0,
            s.z_hi.0,
            b.stage[0],
            b.stage[1],
            b.stage[2],
            i64::from(b.retract),
            b.z_lo.0,
            b.z_hi.0,
            b.strokes.len() as i64,
        ];
        let numbers: Vec<String> = numbers.iter().map(ToString::to_string).collect();
        writeln!(t, "block {} {}", BlockId::new(i), numbers.join(" ")).expect("text");
        for stroke in program.strokes_of(b) {
            let sign = if stroke.reversed { '-' } else { '+' };
            write!(t, "{} {} {} {sign}", stroke.pen.0, stroke.source.0, stroke.segment).expect("text");
            for FieldPoint { x, y } in program.points_of(stroke) {
                write!(t, " {x} {y}").expect("text");
            }
            t.push('\n');
        }
    }
    t + "end\n"
}

pub(super) fn dxf(program: &Program, block: &Block, id: &str, machine: &Machine) -> String {
    let mut t = String::from("0\nSECTION\n2\nENTITIES\n");
    for stroke in program.strokes_of(block) {
        let layer = format!("{id}_P{}", stroke.pen.number());
        let mut points: Vec<[String; 2]> = program
            .points_of(stroke)
            .iter()
            .map(|&p| machine.scanner.controller_from_field(p))
            .map(|p| [p.x, p.y].map(|v| format!("{:.6}", mm_from_nm(i64::from(v)))))
            .collect();
        if let [[x0, y0], [x1, y1]] = points.as_slice() {
            write!(t, "0\nLINE\n8\n{layer}\n10\n{x0}\n20\n{y0}\n30\n0.0\n11\n{x1}\n21\n{y1}\n31\n0.0\n").expect("text");
            continue;
        }
        let closed = points.first() == points.last();
        points.truncate(points.len() - usize::from(closed));
        write!(t, "0\nPOLYLINE\n8\n{layer}\n66\n1\n70\n{}\n", u8::from(closed)).expect("text");
        for [x, y] in points {
            write!(t, "0\nVERTEX\n8\n{layer}\n10\n{x}\n20\n{y}\n30\n0.0\n").expect("text");
        }
        write!(t, "0\nSEQEND\n8\n{layer}\n").expect("text");
    }
    (t + "0\nENDSEC\n0\nEOF\n").replace('\n', "\r\n")
}

pub(super) fn stage(program: &Program, handshake: bool) -> String {
    let off = if handshake { "M65 P0" } else { "M5" };
    let mut t = format!("(made)\nG21 G90 G94\n{off}\n");
    for (i, b) in program.blocks.iter().enumerate() {
        let [x, y, z] = b.stage.mm();
        let id = BlockId::new(i).to_string();
        writeln!(t, "(BLOCK {id} FILE blocks/{id}.dxf)\n{off}").expect("text");
        t.push_str(if b.retract || i == 0 { "G0 Z200\n" } else { "(ENTRY LIFT Z200)\n" });
        writeln!(t, "G0 X{x:.6} Y{y:.6}\nG0 Z{z:.6}\nG4 P0.1").expect("text");
        if !handshake {
            writeln!(t, "M0 (mark {id})").expect("text");
            continue;
        }
        let test = |n: usize| format!("o{n} if [#5399 LT 0]\n(MSG, timeout)\nM65 P0\nM2\no{n} endif\n");
        let [idle, begun, ended, stays] = [1, 2, 3, 4].map(|k| test(4 * i + k));
        write!(t, "M66 P0 L4 Q2\n{idle}M64 P0\nM66 P0 L3 Q5\n{begun}M65 P0\nM66 P0 L4 Q12\n{ended}").expect("text");
        write!(t, "G4 P0.05\nM66 P0 L4 Q12\n{stays}").expect("text");
    }
    t + off + "\nG0 Z200\n" + off + "\nM2\n"
}

fn varint(out: &mut Vec<u8>, mut v: u64) {
    while v >= 0x80 {
        out.push(v as u8 | 0x80);
        v >>= 7;
    }
    out.push(v as u8);
}

/// Field `tag` with bytes.
fn bytes(out: &mut Vec<u8>, tag: u64, value: &[u8]) {
    varint(out, tag << 3 | 2);
    varint(out, value.len() as u64);
    out.extend_from_slice(value);
}

fn float(out: &mut Vec<u8>, tag: u64, value: f64) {
    if value == 0.0 {
        return;
    }
    varint(out, tag << 3 | 5);
    out.extend_from_slice(&(value as f32).to_le_bytes());
}

/// Zero is the default and not written.
fn int(out: &mut Vec<u8>, tag: u64, value: u64) {
    if value == 0 {
        return;
    }
    varint(out, tag << 3);
    varint(out, value);
}

/// Appends a delimited message and answers with its offset.
fn append(out: &mut Vec<u8>, message: &[u8]) -> u64 {
    let at = out.len() as u64;
    varint(out, message.len() as u64);
    out.extend_from_slice(message);
    at
}

fn table(shell: u64, parts: &[u64]) -> Vec<u8> {
    let (mut out, mut packed) = (Vec::new(), Vec::new());
    parts.iter().for_each(|&p| varint(&mut packed, p));
    int(&mut out, 1, shell);
    bytes(&mut out, 2, &packed);
    out
}

pub(super) fn ovf(program: &Program, machine: &Machine) -> Vec<u8> {
    let mut out = b"LVF!\0\0\0\0\0\0\0\0".to_vec();
    let mut planes = Vec::new();
    for (i, block) in program.blocks.iter().enumerate() {
        let start = out.len();
        planes.push(start as u64);
        out.extend_from_slice(&[0; 8]);
        let mut parts = Vec::new();
        for stroke in program.strokes_of(block) {
            let mut floats = Vec::new();
            for &p in program.points_of(stroke) {
                let at = machine.scanner.controller_from_field(p);
                for v in [at.x, at.y] {
                    floats.extend_from_slice(&(mm_from_nm(i64::from(v)) as f32).to_le_bytes());
                }
            }
            let (mut points, mut vectors) = (Vec::new(), Vec::new());
            bytes(&mut points, 1, &floats);
            bytes(&mut vectors, if stroke.len == 2 { 2 } else { 1 }, &points);
            int(&mut vectors, 50, u64::from(stroke.pen.0) + 1);
            int(&mut vectors, 54, u64::from(program.pens[stroke.pen.index()].passes) - 1);
            parts.push(append(&mut out, &vectors));
        }
        let mut shell = Vec::new();
        block.stage.0.iter().zip(2..).for_each(|(&v, tag)| float(&mut shell, tag, mm_from_nm(v)));
        int(&mut shell, 8, parts.len() as u64);
        int(&mut shell, 10, i as u64);
        bytes(&mut shell, 11, b"terrace/xyz-galvo2d/x-part/y-part/z-head");
        let shell = append(&mut out, &shell);
        let at = append(&mut out, &table(shell, &parts));
        out[start..start + 8].copy_from_slice(&at.to_le_bytes());
    }
    let mut job = Vec::new();
    for (pen, key) in program.pens.iter().zip(1..) {
        let (mut params, mut entry) = (Vec::new(), Vec::new());
        float(&mut params, 1, pen.power.as_w(machine.laser.max_power));
        float(&mut params, 2, pen.speed.as_mm_s());
        float(&mut params, 5, machine.scanner.jump_speed.as_mm_s());
        int(&mut params, 7, (pen.frequency.as_khz() * 1e3) as u64);
        let d = &machine.delays;
        [d.jump, d.laser_off, d.laser_on, d.mark, d.polygon]
            .iter()
            .zip(11..)
            .for_each(|(t, tag)| float(&mut params, tag, t.as_us()));
        bytes(&mut params, 26, pen.name.as_bytes());
        int(&mut entry, 1, key);
        bytes(&mut entry, 2, &params);
        bytes(&mut job, 3, &entry);
    }
    int(&mut job, 6, planes.len() as u64);
    let shell = append(&mut out, &job);
    let at = append(&mut out, &table(shell, &planes));
    out[4..12].copy_from_slice(&at.to_le_bytes());
    out
}

/// What the run sheets are written from.
pub(super) struct Sheets<'a> {
    pub(super) program: &'a Program,
    pub(super) origin: Origin,
    pub(super) machine: &'a Machine,
    pub(super) block_s: &'a [f64],
}

impl Sheets<'_> {
    fn rows(&self) -> impl Iterator<Item = (String, &Block, [f64; 3], f64, f64, Vec<usize>)> {
        self.program.blocks.iter().zip(self.block_s).enumerate().map(|(i, (b, &time))| {
            let mut pens: Vec<usize> = self.program.strokes_of(b).iter().map(|s| s.pen.index()).collect();
            pens.sort_unstable();
            pens.dedup();
            (BlockId::new(i).to_string(), b, b.stage.mm(), self.program.mark_mm(b), time, pens)
        })
    }

    pub(super) fn csv(&self) -> String {
        let mut t =
            "setup,block,stage_z_mm,stage_y_mm,stage_x_mm,lpfl_mm,file,strokes,mark_mm,time_s,pens\n".to_owned();
        for (id, b, [x, y, z], mm, time, pens) in self.rows() {
            let names: Vec<&str> = pens.iter().map(|&p| self.program.pens[p].name.as_str()).collect();
            let (focus, strokes) = (b.stop.focus.mm(), b.strokes.len());
            let file = format!("blocks/{id}.dxf,{strokes},{mm:.3},{time:.3},\"{}\"", names.join("; "));
            writeln!(t, "{},{id},{z:.6},{y:.6},{x:.6},{focus:.6},{file}", b.setup.number()).expect("text");
        }
        t
    }

    pub(super) fn txt(&self) -> String {
        let [x, y, z] = self.origin.mm();
        let mut t = format!("part zero  X{x:.4} Y{y:.4} Z{z:.4} mm\n");
        t += "zero  X Y Z of the stage are from the zero of the table frame; in stage.ngc that is the machine's zero; in ";
        t += "stage_m0.nc it is the zero of G54\n";
        t += "part turn  0 deg\n\nPENS\n";
        for (i, p) in self.program.pens.iter().enumerate() {
            let watts = p.power.as_w(self.machine.laser.max_power);
            let (speed, rate) = (p.speed.as_mm_s(), p.frequency.as_khz());
            writeln!(t, "{}  {speed}  {} = {watts} W  {rate}  {}  {}", i + 1, p.power, p.passes, p.name).expect("text");
        }
        t += "\nBLOCKS\nblock  X  Y  Z  LPFL  strokes  marks mm  time s  pens  file\n";
        for (id, b, [x, y, z], mm, time, pens) in self.rows() {
            let pens: Vec<String> = pens.iter().map(|p| (p + 1).to_string()).collect();
            let (focus, strokes, pens) = (b.stop.focus.mm(), b.strokes.len(), pens.join(" "));
            if b.retract || id == "B0001" {
                writeln!(t, "LIFT to Z200, then go to {id}").expect("text");
            }
            writeln!(
                t,
                "{id}  {x:.4}  {y:.4}  {z:.4}  {focus:.4}  {strokes}  {mm:.1}  {time:.1}  {pens}  blocks/{id}.dxf"
            )
            .expect("text");
        }
        t
    }
}
