//! `agreement` of the run sheets, which for a job of drawings alone are the program: their rows are the blocks in
//! order, each with its place, drawing, pens, lengths and time, and lifts where a sheet states them; above the rows
//! stand the part's place and the pens. Numbers agree to the decimals that they are written with. One violation per
//! block.

use std::path::Path;

use super::times;
use crate::job_facts::JobFacts;
use crate::proof::Rule;
use crate::read::formats;
use crate::read::manifest::{Manifest, RegistrationEntry};
use crate::read::program::ProgramFile;
use crate::read::runsheet::{self, RunSheet, Table};
use crate::read::{Fault, number};
use terrace_core::diag;
use terrace_core::geom::{NM_PER_MM, Nm};
use terrace_core::machine::Machine;
use terrace_core::math;
use terrace_core::program::{Block, Pen};
use terrace_core::units::Power;

/// Largest run sheet that is read.
const MAX_FILE: u64 = 1 << 30;

/// Decimals of stage positions in mm in `runsheet.txt` and in `runsheet.csv`.
const DECIMALS: [i32; 2] = [4, 6];

/// How far a position in mm with four decimals may lie from that in nm: half of the last, and 1 nm more.
const POSITION_NM: f64 = 51.0;

/// How far a side of the part in mm with three decimals may lie from the manifest's: half of the last, and 1 nm more.
const SIDE_MM: f64 = 0.000_501;

/// Holds the run sheets that are there against the program.
pub(super) fn check(folder: &Path, manifest: &Manifest, file: &ProgramFile, facts: &JobFacts, rule: &mut Rule) {
    let mut sheets = SheetChecker { manifest, file, facts, rule };
    if let Some(table) = sheets.read(folder, "runsheet.csv", runsheet::csv) {
        let columns = TableColumns {
            names: CSV,
            decimals: [DECIMALS[1], 3, 3],
            pens: |file, block| {
                pens_of(file, block).map(|p| file.program.pens[p].name.clone()).collect::<Vec<_>>().join("; ")
            },
        };
        sheets.columns("runsheet.csv", &table, &CSV_COLUMNS, &[]);
        sheets.table("runsheet.csv", &table, &columns);
    }
    if let Some(sheet) = sheets.read(folder, "runsheet.txt", runsheet::txt) {
        let columns = TableColumns {
            names: TXT,
            decimals: [DECIMALS[0], 1, 1],
            pens: |file, block| pens_of(file, block).map(|p| (p + 1).to_string()).collect::<Vec<_>>().join(" "),
        };
        sheets.head(&sheet);
        sheets.headings(&sheet);
        sheets.lifts(&sheet);
        let shift = if facts.machine.zoom.is_some() { &["SHIFT"][..] } else { &[] };
        sheets.columns("runsheet.txt", &sheet.blocks, &TXT_COLUMNS, shift);
        sheets.table("runsheet.txt", &sheet.blocks, &columns);
    }
}

/// Names of columns: block, x, y, z, focal plane, drawing, strokes, mark length, time, pens.
type Names = [&'static str; 10];
const CSV: Names =
    ["block", "stage_x_mm", "stage_y_mm", "stage_z_mm", "lpfl_mm", "file", "strokes", "mark_mm", "time_s", "pens"];
const TXT: Names = ["block", "X", "Y", "Z", "LPFL", "file", "strokes", "marks mm", "time s", "pens"];

/// All columns of the sheets in order, that of the zoom optic apart, which stands before the strokes.
const CSV_COLUMNS: [&str; 18] = [
    "block",
    "column",
    "row",
    "level",
    "stage_x_mm",
    "stage_y_mm",
    "stage_z_mm",
    "lpfl_mm",
    "file",
    "strokes",
    "mark_mm",
    "jump_mm",
    "time_s",
    "pens",
    "pass",
    "setup",
    "lift_z_mm",
    "focus_shift_mm",
];
const TXT_COLUMNS: [&str; 12] =
    ["block", "section", "level", "X", "Y", "Z", "LPFL", "strokes", "marks mm", "time s", "pens", "file"];

/// How a sheet writes its table.
struct TableColumns {
    names: Names,
    /// Decimals of positions, mark lengths and times.
    decimals: [i32; 3],
    pens: fn(&ProgramFile, &Block) -> String,
}

/// Indices of the pens of a block, rising.
fn pens_of(file: &ProgramFile, block: &Block) -> impl Iterator<Item = usize> {
    let mut pens: Vec<usize> = file.program.strokes_of(block).iter().map(|s| s.pen.index()).collect();
    pens.sort_unstable();
    pens.dedup();
    pens.into_iter()
}

struct SheetChecker<'a> {
    manifest: &'a Manifest,
    file: &'a ProgramFile,
    facts: &'a JobFacts,
    rule: &'a mut Rule,
}

impl SheetChecker<'_> {
    /// Reads a sheet that the manifest lists.
    fn read<T>(&mut self, folder: &Path, name: &str, read: fn(&[u8]) -> Result<T, Fault>) -> Option<T> {
        if !self.manifest.files.iter().any(|f| f.file == name) {
            self.rule.broken("", name, "the run sheet is missing");
            return None;
        }
        match diag::read_file(&folder.join(name), MAX_FILE) {
            Err(e) => self.rule.broken("", name, e.diags().first().map_or("cannot be read", |d| &d.message)),
            Ok(bytes) => match read(&bytes) {
                Ok(sheet) => return Some(sheet),
                Err(fault) => self.rule.broken("", format!("{name}:{}", fault.line), fault.message),
            },
        }
        None
    }

    /// Holds that a table has its columns and no other, `more` of them before the strokes.
    fn columns(&mut self, name: &str, table: &Table, known: &[&str], more: &[&str]) {
        let strokes = known.iter().position(|c| *c == "strokes").unwrap_or(0);
        let wanted = known[..strokes].iter().chain(more).chain(&known[strokes..]);
        if !table.columns.iter().map(String::as_str).eq(wanted.copied()) {
            self.rule.broken("", name, "its columns are not those of a run sheet, in their order");
        }
    }

    /// Holds the rows of a table against the blocks.
    fn table(&mut self, name: &str, table: &Table, columns: &TableColumns) {
        let mut at = [0; 10];
        for (slot, column) in at.iter_mut().zip(columns.names) {
            match table.column(column) {
                Some(found) => *slot = found,
                None => return self.rule.broken("", name, format!("has no column {column:?}")),
            }
        }
        let blocks = self.file.ids.iter().zip(&self.file.program.blocks);
        for ((id, block), (line, row)) in blocks.zip(&table.rows) {
            self.rule.checked += 1;
            let cells = at.map(|i| row[i].as_str());
            let is_first = self.file.ids.first() == Some(id);
            let lift = (is_first || block.retract).then(|| self.facts.machine.retract_z());
            let differs = self.differs(id, block, cells, columns).or_else(|| self.more(table, row, block));
            if let Some(what) = differs.or_else(|| lift_differs(table, row, lift)) {
                self.rule.broken(id, format!("{name}:{line}"), format!("its {what} differs from program.txt"));
            }
        }
        if table.rows.len() != self.file.ids.len() {
            let text = format!("lists {} blocks, program.txt has {}", table.rows.len(), self.file.ids.len());
            self.rule.broken("", name, text);
        }
    }

    /// Which cell of a row is not the block's.
    fn differs(&self, id: &str, block: &Block, cells: [&str; 10], columns: &TableColumns) -> Option<&'static str> {
        let [name, x, y, z, lpfl, drawing, strokes, marks, time, pens] = cells;
        let [place, length, seconds] = columns.decimals;
        let is_at = |cell: &str, nm: i64| {
            number::nm_from_decimal(cell.as_bytes())
                .is_some_and(|found| 2 * (found - nm).abs() <= 10i64.pow((6 - place) as u32))
        };
        // Of the block's own files that which the stage programs name; none where it has none.
        let drawings = formats::of_drawings(&self.facts.formats, &self.manifest.files, &self.manifest.blocks);
        let own = drawings.map_or_else(String::new, |(_, ending)| formats::of_block(id, ending));
        let program = &self.file.program;
        let mm: f64 = program.strokes_of(block).iter().map(|s| times::marked_mm(program, s)).sum();
        let marking = times::marking(program, block, &self.facts.machine);
        [
            ("name", name == id),
            ("stage target", is_at(x, block.stage[0]) && is_at(y, block.stage[1]) && is_at(z, block.stage[2])),
            ("focus (lpfl)", is_at(lpfl, block.stop.lpfl.0)),
            ("drawing", drawing == own),
            ("number of strokes", strokes.parse() == Ok(block.strokes.len())),
            ("mark length", is_written(marks, mm, length)),
            ("time", is_written(time, marking.total(), seconds)),
            ("list of pens", pens == (columns.pens)(self.file, block)),
        ]
        .into_iter()
        .find_map(|(what, same)| (!same).then_some(what))
    }

    /// The same of columns that not every sheet has.
    fn more(&self, table: &Table, row: &[String], block: &Block) -> Option<&'static str> {
        let cell = |name: &str| table.column(name).map(|i| row[i].as_str());
        let is_cell = |name: &str, value: i64| cell(name).is_none_or(|c| number::integer(c.as_bytes()) == Some(value));
        let [column, line] = block.stop.section.0.map(i64::from);
        let jump = times::jump_mm(&self.file.program, block);
        let (shift, shift_decimals) = match cell("focus_shift_mm") {
            Some(cell) => (Some(cell), 6),
            None => (cell("SHIFT"), 4),
        };
        [
            ("section", is_cell("column", column) && is_cell("row", line)),
            ("section", cell("section").is_none_or(|c| c == format!("{column},{line}"))),
            ("level", is_cell("level", block.stop.level.into())),
            ("pass", is_cell("pass", i64::from(block.pass.0) + 1)),
            ("set-up", is_cell("setup", i64::from(block.setup.0) + 1)),
            (
                "focus shift",
                shift.map_or(self.facts.machine.zoom.is_none(), |c| {
                    is_written(c, block.focus_shift.mm(), shift_decimals)
                }),
            ),
            ("jump length", cell("jump_mm").is_none_or(|c| is_written(c, jump, 3))),
        ]
        .into_iter()
        .find_map(|(what, same)| (!same).then_some(what))
    }

    /// Checks the head of the sheet: the position of the part, and the pens.
    fn head(&mut self, sheet: &RunSheet) {
        let name = "runsheet.txt";
        let origins = &self.file.origins;
        let rule = &mut *self.rule;
        rule.require(
            name,
            origins.len() > 1 || sheet.zero.as_ref().is_some_and(|z| is_position(z, &origins[0].0)),
            "its part zero differs from program.txt",
        );
        rule.require(
            name,
            sheet.setups_stated.unwrap_or(1) == origins.len(),
            "its number of set-ups differs from program.txt",
        );
        rule.require(
            name,
            sheet.stage_zero == stage_zero(self.manifest),
            "it names another zero than the stage programs have",
        );
        let turn = self.manifest.placement.turn_deg;
        rule.require(
            name,
            sheet.turn.is_some_and(|t| (t - turn).abs() <= 1e-9),
            "its part turn differs from the manifest",
        );
        let measured = self.manifest.placement.measured.as_ref();
        let is_measured = match (sheet.measured, measured) {
            (Some([points, worst, lean, turn]), Some(stated)) => {
                let [[x, ..], [y, ..], _] = stated.rows;
                points == stated.points as f64
                    && (worst - stated.worst_residual_um).abs() <= 0.051
                    && (lean - stated.lean_deg).abs() <= 0.000_051
                    && (turn - math::atan2(y, x).to_degrees()).abs() <= 0.000_051
            }
            (found, stated) => found.is_none() && stated.is_none(),
        };
        rule.require(name, is_measured, "what it says of the measured part differs from the manifest");
        let laid = self.facts.laid_deg;
        let is_laid = match (&sheet.laid, laid) {
            (Some(found), Some(laid)) => found.iter().zip(laid).all(|(f, l)| (f - l).abs() <= 1e-9),
            (found, laid) => found.is_none() && laid.is_none(),
        };
        rule.require(name, is_laid || self.facts.pens.is_none(), "how its part is laid differs from the job file");
        let size = self.manifest.summary.part_mm;
        let is_size = sheet.size.iter().flatten().zip(size).filter(|(f, mm)| (**f - mm).abs() <= SIDE_MM).count() == 3;
        rule.require(name, is_size, "the size of its part differs from the manifest");
        let is_own = sheet.machine.as_deref() == Some(self.facts.machine.name.as_str().trim());
        rule.require(name, is_own, "its machine is another one");
        rule.require(
            name,
            are_pens(sheet, &self.file.program.pens, &self.facts.machine),
            "its pens differ from those of program.txt",
        );
        let (loads, total) = loading(self.manifest);
        rule.require(
            name,
            sheet.loading.as_ref().is_some_and(|words| words.starts_with(&loads)),
            "who loads the blocks differs from the manifest",
        );
        rule.require(name, sheet.in_all.as_ref() == Some(&total), "its time in all differs from the manifest");
        if sheet.setups.is_empty() && origins.len() == 1 {
            return;
        }
        let are_stated = are_setups(sheet, self.file, self.manifest);
        rule.require(name, are_stated, "its set-ups differ from those of program.txt");
    }

    /// Holds the lines that say where to lift to before a block.
    fn lifts(&mut self, sheet: &RunSheet) {
        let z = self.facts.machine.retract_z();
        let blocks = self.file.ids.iter().zip(&self.file.program.blocks).enumerate();
        for (((i, (id, block)), found), (line, _)) in blocks.zip(&sheet.lifts).zip(&sheet.blocks.rows) {
            let same = match found {
                None => i > 0 && !block.retract,
                Some((to, of)) => (i == 0 || block.retract) && of == id && is_written(&to.to_string(), z.mm(), 4),
            };
            if !same {
                let text = "the lift before it differs from program.txt";
                return self.rule.broken(id, format!("runsheet.txt:{line}"), text);
            }
        }
    }

    /// Holds the headings over the rows: the pass, and where there are several the set-up.
    fn headings(&mut self, sheet: &RunSheet) {
        let several = self.file.origins.len() > 1;
        let blocks = self.file.ids.iter().zip(&self.file.program.blocks);
        for (((id, block), under), (line, _)) in blocks.zip(&sheet.under).zip(&sheet.blocks.rows) {
            if *under != (block.pass.number(), several.then_some(block.setup.number())) {
                let text = "it is listed under another pass or set-up than in program.txt";
                return self.rule.broken(id, format!("runsheet.txt:{line}"), text);
            }
        }
    }
}

/// Whether a sheet states the set-ups of the program, each with its blocks, its zero and its registration points.
fn are_setups(sheet: &RunSheet, file: &ProgramFile, manifest: &Manifest) -> bool {
    let origins = &file.origins;
    let mut setups = sheet.setups.iter().zip(origins).zip(&manifest.setups).enumerate();
    sheet.setups.len() == origins.len()
        && setups.all(|(k, ((setup, origin), stated))| {
            (setup.number, setup.count) == (k + 1, origins.len())
                && setup.blocks == runs(file, k)
                && is_position(&setup.zero, &origin.0)
                && are_registration_points(&setup.points, &stated.registration)
        })
}

/// Whether a sheet states these registration points: of each the place on the part and that of the stage.
fn are_registration_points(points: &[[Vec<f64>; 2]], stated: &[RegistrationEntry]) -> bool {
    let nm = |v: [f64; 2]| v.map(|mm| (mm * NM_PER_MM).round() as i64);
    let is_same = |[point, stage]: &[Vec<f64>; 2], wanted: &RegistrationEntry| {
        is_position(point, &nm(wanted.point_mm)) && is_position(stage, &nm(wanted.stage))
    };
    points.len() == stated.len() && points.iter().zip(stated).all(|(point, wanted)| is_same(point, wanted))
}

/// Whether a position in mm, with four decimals, is this one in nm.
fn is_position(found_mm: &[f64], nm: &[i64]) -> bool {
    found_mm.len() == nm.len()
        && found_mm.iter().zip(nm).all(|(mm, &nm)| (mm * NM_PER_MM - nm as f64).abs() <= POSITION_NM)
}

/// Half a unit of the third decimal of a dwell in us, and rounding.
const DWELL_US: f64 = 0.000_500_001;

/// Whether the pens of a sheet are these, in their order.
pub(crate) fn are_pens(sheet: &RunSheet, pens: &[Pen], machine: &Machine) -> bool {
    let dwells: Vec<(usize, f64)> = (1..).zip(pens).filter_map(|(i, pen)| Some((i, pen.dwell?.as_us()))).collect();
    let is_dwell =
        |(found, wanted): (&(usize, f64), &(usize, f64))| found.0 == wanted.0 && (found.1 - wanted.1).abs() <= DWELL_US;
    sheet.pens.len() == pens.len()
        && sheet.pens.iter().zip(pens).zip(1..).all(|((cells, pen), number)| is_pen(cells, pen, number, machine))
        && sheet.dwells.len() == dwells.len()
        && sheet.dwells.iter().zip(&dwells).all(is_dwell)
}

/// Whether the cells of a row are those of a pen, numbered from 1.
fn is_pen(cells: &[String], pen: &Pen, number: u32, machine: &Machine) -> bool {
    let figure = |k: usize| cells.get(k).and_then(|c| c.parse::<f64>().ok()).unwrap_or(f64::NAN);
    let power = cells.get(2).and_then(|c| {
        let (power, watts) = c.rsplit_once(" = ")?;
        Some((power.parse::<Power>().ok()?, watts.strip_suffix(" W")?.parse::<f64>().ok()?))
    });
    figure(0) == f64::from(number)
        && figure(1) == pen.speed.as_mm_s()
        && power
            .is_some_and(|(power, w)| power == pen.power && (w - pen.power.as_w(machine.laser.max_power)).abs() <= 1e-6)
        && figure(3) == pen.frequency.as_khz()
        && figure(4) == f64::from(pen.passes)
        && cells.get(5).is_some_and(|name| *name == pen.name.trim())
}

/// The blocks of a set-up, counted from 0, as runs.
fn runs(file: &ProgramFile, setup: usize) -> String {
    let mut out: Vec<[&str; 2]> = Vec::new();
    let mut last = None;
    for (i, (id, block)) in file.ids.iter().zip(&file.program.blocks).enumerate() {
        if block.setup.index() != setup {
            continue;
        }
        match out.last_mut() {
            Some(run) if last == i.checked_sub(1) => run[1] = id,
            _ => out.push([id, id]),
        }
        last = Some(i);
    }
    out.iter().map(|[from, to]| format!("{from} to {to}")).collect::<Vec<_>>().join(", ")
}

/// The zero of the stage as an operator sets it: with LinuxCNC no offset is left, so it is the machine's; the other
/// dialect runs in G54.
fn stage_zero(manifest: &Manifest) -> String {
    let zeros = [
        ("stage.ngc", "; in stage.ngc that is the machine's zero"),
        ("stage_m0.nc", "; in stage_m0.nc it is the zero of G54"),
    ];
    let held: String = zeros
        .iter()
        .filter(|(name, _)| manifest.files.iter().any(|f| f.file == *name))
        .map(|(_, zero)| *zero)
        .collect();
    format!("X Y Z of the stage are from the zero of the table frame{held}")
}

/// How the sheet begins the sentence on who loads the blocks, and its time in all.
fn loading(manifest: &Manifest) -> (String, String) {
    let loading = &manifest.summary.loading;
    let (blocks, total_s) = match &manifest.subset {
        Some(subset) => (subset.blocks.len(), subset.total_s),
        None => (manifest.summary.blocks, loading.total_s),
    };
    let blocks = if blocks == 1 { "1 block".to_owned() } else { format!("{blocks} blocks") };
    let words = match loading.way.as_str() {
        "person" => format!("a person loads and starts {blocks}, {} s each", loading.load_s),
        "run" => format!("terrace run loads and starts {blocks}"),
        "card" => format!("the scan card has {blocks} stored"),
        _ => format!("a controller reads job.ovf and marks {blocks} of it"),
    };
    let whole = total_s.round() as u64;
    (words, format!("{}:{:02}:{:02}", whole / 3600, whole / 60 % 60, whole % 60))
}

/// The lift of a row of `runsheet.csv`; the other sheet has lines for it.
fn lift_differs(table: &Table, row: &[String], lift: Option<Nm>) -> Option<&'static str> {
    let cell = row[table.column("lift_z_mm")?].as_str();
    let found = number::nm_from_decimal(cell.as_bytes());
    let same = lift.map_or(cell.is_empty(), |Nm(z)| found == Some(z));
    (!same).then_some("lift")
}

/// Whether a cell is a number rounded to this many decimals.
fn is_written(cell: &str, value: f64, decimals: i32) -> bool {
    let half = 0.5 * 10f64.powi(-decimals);
    cell.parse::<f64>().is_ok_and(|v| (v - value).abs() <= half * (1.0 + 1e-6) + 1e-9 * value.abs())
}
