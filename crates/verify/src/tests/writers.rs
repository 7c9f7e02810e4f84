//! Writers of the files of a job folder for tests: `program.txt` and the run sheets short, apart from the ones of the
//! product.

use std::fmt::Write;

use terrace_core::geom::FieldPoint;
use terrace_core::machine::{Machine, Origin};
use terrace_core::program::{Block, BlockFigures, BlockId, Program};
use terrace_input::job::Format;
use terrace_plan::check::Checked;
use terrace_plan::emit::{Files, Stepped, Target};

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
            s.lpfl.0,
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

/// The files of a stepped job that machines get, by the product's own writers: its readers take nothing else.
pub(super) fn files(program: &Program, origin: Origin, machine: &Machine, block_s: &[f64]) -> Vec<(String, Vec<u8>)> {
    let checked = Checked::as_written(program.clone(), vec![origin]);
    let figures: Vec<BlockFigures> =
        block_s.iter().map(|&time_s| BlockFigures { time_s, ..BlockFigures::default() }).collect();
    let job = Stepped {
        checked: &checked,
        machine,
        figures: &figures,
        job: "job.toml",
        part: "part.stl",
        block_file: Some("dxf"),
        frames: None,
    };
    let formats = [Format::Dxf, Format::Linuxcnc, Format::Gcode, Format::Ovf];
    let of = |format: Format| match Target::of(format).stepped {
        Some(Files::Whole(name, write)) => vec![(name.to_owned(), write(&job))],
        Some(Files::Blocks(ending, write)) => {
            let file = |i: usize| (Program::block_file(BlockId::new(i), ending), write(&job, i));
            (0..program.blocks.len()).map(file).collect()
        }
        None => Vec::new(),
    };
    formats.into_iter().flat_map(of).collect()
}

/// What the run sheets are written from.
pub(super) struct Sheets<'a> {
    pub(super) program: &'a Program,
    pub(super) origin: Origin,
    pub(super) machine: &'a Machine,
    pub(super) block_s: &'a [f64],
    pub(super) total_s: f64,
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
        let mut t = "block,column,row,level,stage_x_mm,stage_y_mm,stage_z_mm,lpfl_mm,file,strokes,mark_mm,jump_mm,\
             time_s,pens,pass,setup,lift_z_mm,focus_shift_mm\n"
            .to_owned();
        for (id, b, [x, y, z], mm, time, pens) in self.rows() {
            let names: Vec<&str> = pens.iter().map(|&p| self.program.pens[p].name.as_str()).collect();
            let (lpfl, strokes) = (b.stop.lpfl.mm(), b.strokes.len());
            let [column, row] = b.stop.section.0;
            let jump = self.program.jump_mm(b);
            let file = format!("blocks/{id}.dxf,{strokes},{mm:.3},{jump:.3},{time:.3},\"{}\"", names.join("; "));
            let lift = if b.retract || id == "B0001" { "200.000000" } else { "" };
            let place = format!("{id},{column},{row},{},{x:.6},{y:.6},{z:.6},{lpfl:.6}", b.stop.level);
            writeln!(t, "{place},{file},{},{},{lift},0.000000", b.pass.number(), b.setup.number()).expect("text");
        }
        t
    }

    pub(super) fn txt(&self) -> String {
        let [x, y, z] = self.origin.mm();
        let whole = self.total_s.round() as u64;
        let mut t = format!(
            "size       0 x 0 x 0 mm as it is laid\nmachine    {}\npart zero  X{x:.4} Y{y:.4} Z{z:.4} mm in the table \
             frame\nzero  X Y Z of the stage are from the zero of the table frame; in stage.ngc that is the machine's zero; \
             in stage_m0.nc it is the zero of G54\nloading    terrace run loads and starts {} blocks\nin all     {}:{:02}:{:02}\npart turn  0 deg about z\n\nPENS (the files of the job carry these values)\n  no  speed mm/s  power               frequency kHz  passes  name\n",
            self.machine.name,
            self.program.blocks.len(),
            whole / 3600,
            whole / 60 % 60,
            whole % 60
        );
        for (i, p) in self.program.pens.iter().enumerate() {
            let watts = p.power.as_w(self.machine.laser.max_power);
            let (speed, rate) = (p.speed.as_mm_s(), p.frequency.as_khz());
            writeln!(t, "{}  {speed}  {} = {watts} W  {rate}  {}  {}", i + 1, p.power, p.passes, p.name).expect("text");
        }
        t += "\nBLOCKS (X Y Z: commanded stage position, mm; LPFL: focal plane on the part, mm; time without the move)\n\
              block  section  level  X  Y  Z  LPFL  strokes  marks mm  time s  pens  file\n";
        for (id, b, [x, y, z], mm, time, pens) in self.rows() {
            let pens: Vec<String> = pens.iter().map(|p| (p + 1).to_string()).collect();
            let (lpfl, strokes, pens) = (b.stop.lpfl.mm(), b.strokes.len(), pens.join(" "));
            if b.retract || id == "B0001" {
                writeln!(t, "LIFT to Z200, then go to {id}").expect("text");
            }
            writeln!(
                t,
                "{id}  {},{}  {}  {x:.4}  {y:.4}  {z:.4}  {lpfl:.4}  {strokes}  {mm:.1}  {time:.1}  {pens}  blocks/{id}.dxf",
                b.stop.section.0[0],
                b.stop.section.0[1],
                b.stop.level,
            )
            .expect("text");
        }
        t
    }
}
