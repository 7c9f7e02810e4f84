//! Readers of the run sheets: the table of blocks of `runsheet.csv` and `runsheet.txt` by the names of its columns, and
//! what the sheet says above it of the part's place and the pens.
//!
//! Columns that verification does not know are read and left alone, so that a sheet may say more.

use super::Fault;

/// A table: names of its columns, and its rows, each with its line from 1.
#[derive(Clone, Debug, Default, PartialEq)]
pub(in crate::verify) struct Table {
    pub(in crate::verify) columns: Vec<String>,
    pub(in crate::verify) rows: Vec<(usize, Vec<String>)>,
}

impl Table {
    /// Where a column stands.
    pub(in crate::verify) fn column(&self, name: &str) -> Option<usize> {
        self.columns.iter().position(|c| c == name)
    }
}

/// A set-up of the sheet: its part zero, and of each registration point its place on the part and on the stage.
#[derive(Clone, Debug, Default, PartialEq)]
pub(in crate::verify) struct SheetSetup {
    pub(in crate::verify) zero: Vec<f64>,
    pub(in crate::verify) points: Vec<[Vec<f64>; 2]>,
}

/// What `runsheet.txt` says.
#[derive(Clone, Debug, Default, PartialEq)]
pub(in crate::verify) struct Sheet {
    /// Part zero where there is one set-up, mm.
    pub(in crate::verify) zero: Option<Vec<f64>>,
    /// The turn of the part, degrees.
    pub(in crate::verify) turn: Option<f64>,
    /// Who loads the blocks, in the words of the sheet, and the time of the job with it.
    pub(in crate::verify) loading: Option<String>,
    pub(in crate::verify) in_all: Option<String>,
    /// Cells of each pen: number, speed, power, frequency, passes, name.
    pub(in crate::verify) pens: Vec<Vec<String>>,
    /// Of pens that mark dots their number and the dwell, us.
    pub(in crate::verify) dwells: Vec<(usize, f64)>,
    pub(in crate::verify) setups: Vec<SheetSetup>,
    /// The table of blocks.
    pub(in crate::verify) blocks: Table,
    /// By row of the table, the pass and the set-up under whose heading it stands, from 1.
    pub(in crate::verify) under: Vec<(u32, Option<u32>)>,
    /// By row of the table, the z in mm that a line before it says to lift to, and the block that it is on the way to.
    pub(in crate::verify) lifts: Vec<Option<(f64, String)>>,
}

/// Reads `runsheet.csv`: cells apart by commas, in quotes where they hold one.
pub(in crate::verify) fn csv(bytes: &[u8]) -> Result<Table, Fault> {
    let text = text(bytes)?;
    let mut rows = Vec::new();
    let (mut row, mut cell, mut line, mut begun) = (Vec::new(), String::new(), 1, 1);
    let mut chars = text.chars().peekable();
    let mut quoted = false;
    while let Some(c) = chars.next() {
        // RFC 4180: within quotes a comma and a line feed are text, and two quotes are one.
        line += usize::from(c == '\n');
        match c {
            '"' if quoted && chars.peek() == Some(&'"') => cell.push(chars.next().unwrap_or_default()),
            '"' => quoted = !quoted,
            ',' if !quoted => row.push(std::mem::take(&mut cell)),
            '\n' if !quoted => {
                row.push(std::mem::take(&mut cell));
                rows.push((begun, std::mem::take(&mut row)));
                begun = line;
            }
            c => cell.push(c),
        }
    }
    if quoted || !row.is_empty() || !cell.is_empty() {
        return Err(Fault::new(line, "ends in the middle of a row"));
    }
    if rows.is_empty() {
        return Err(Fault::new(1, "has no names of columns"));
    }
    let (_, columns) = rows.remove(0);
    match rows.iter().find(|(_, row)| row.len() != columns.len()) {
        Some((line, row)) => {
            Err(Fault::new(*line, format!("has {} cells, the table has {} columns", row.len(), columns.len())))
        }
        None => Ok(Table { columns, rows }),
    }
}

/// Reads `runsheet.txt`.
pub(in crate::verify) fn txt(bytes: &[u8]) -> Result<Sheet, Fault> {
    let mut out = Sheet::default();
    let mut part = "";
    let (mut pass, mut setup, mut lift) = (1, None, None);
    for (i, line) in text(bytes)?.lines().enumerate() {
        let fault = |what: &str| Fault::new(i + 1, what);
        // Headings in capitals part the sheet; what a part does not know is text for people.
        if let Some(head) = ["PENS", "SET-UPS", "BLOCKS", "BEFORE", "HOW"].into_iter().find(|h| line.starts_with(h)) {
            part = head;
            continue;
        }
        // A box to tick stands before each block.
        let line = line.strip_prefix("[ ]").unwrap_or(line);
        let words: Vec<&str> = line.split_whitespace().collect();
        match (part, words.as_slice()) {
            ("", ["part", "zero", zero @ ..]) => out.zero = axes(zero),
            ("", ["part", "turn", turn, ..]) => out.turn = turn.parse().ok(),
            ("", ["loading", words @ ..]) => out.loading = Some(words.join(" ")),
            ("", ["in", "all", time, ..]) => out.in_all = Some(time.trim_end_matches(';').to_owned()),
            ("PENS", ["dots", "of", "pen", number, "dwell", us, "us"]) => {
                let found = number.trim_end_matches(':').parse().ok().zip(us.parse().ok());
                out.dwells.push(found.ok_or_else(|| fault("the dwell of a pen is not a number"))?);
            }
            ("PENS", [number, ..]) if number.parse::<u32>().is_ok() => out.pens.push(cells(line, 6)),
            ("SET-UPS", ["SET-UP", _, "OF", _, "part", "zero", zero @ ..]) => {
                let zero = axes(zero).ok_or_else(|| fault("the part zero of a set-up cannot be read"))?;
                out.setups.push(SheetSetup { zero, points: Vec::new() });
            }
            ("SET-UPS", ["point", x, y, "of", "the", "part:", "stage", at @ ..]) => {
                let point: Option<Vec<f64>> = [x, y].into_iter().map(|v| v.parse().ok()).collect();
                let found = point.zip(axes(at)).zip(out.setups.last_mut());
                let ((point, at), setup) = found.ok_or_else(|| fault("a registration point cannot be read"))?;
                setup.points.push([point, at]);
            }
            ("BLOCKS", ["block", ..]) => out.blocks.columns = cells(line, usize::MAX),
            ("BLOCKS", ["PASS", number]) => pass = number.parse().map_err(|_| fault("the pass has no number"))?,
            ("BLOCKS", ["LIFT", "to", z, "then", "go", "to", id]) => {
                let z = z.strip_prefix('Z').and_then(|z| z.strip_suffix(',')).and_then(|z| z.parse().ok());
                lift = Some((z.ok_or_else(|| fault("the z of a lift cannot be read"))?, (*id).to_owned()));
            }
            ("BLOCKS", ["SET-UP", number]) => {
                setup = Some(number.parse().map_err(|_| fault("the set-up has no number"))?);
            }
            ("BLOCKS", [id, ..]) if id.starts_with('B') => {
                let row = row(&out.blocks.columns, &words).ok_or_else(|| fault("a block has too few cells"))?;
                out.blocks.rows.push((i + 1, row));
                out.under.push((pass, setup));
                out.lifts.push(lift.take());
            }
            _ => {}
        }
    }
    Ok(out)
}

fn text(bytes: &[u8]) -> Result<&str, Fault> {
    let text = std::str::from_utf8(bytes).map_err(|_| Fault::new(0, "the file is not text"))?;
    if text.ends_with('\n') { Ok(text) } else { Err(Fault::new(text.lines().count(), "ends in the middle of a line")) }
}

/// Cells that two spaces or more keep apart, the last of at most `most` with all that follows.
fn cells(line: &str, most: usize) -> Vec<String> {
    let mut out: Vec<String> = Vec::new();
    let mut rest = line.trim();
    while !rest.is_empty() {
        let end = if out.len() + 1 < most { rest.find("  ").unwrap_or(rest.len()) } else { rest.len() };
        out.push(rest[..end].to_owned());
        rest = rest[end..].trim_start();
    }
    out
}

/// The cells of a block's row by column. Every column holds one word but `pens`, which holds one or more numbers, and
/// what stands after it, which may be left empty.
fn row(columns: &[String], words: &[&str]) -> Option<Vec<String>> {
    let pens = columns.iter().position(|c| c == "pens")?;
    let (before, rest) = words.split_at_checked(pens)?;
    let numbers = rest.iter().take_while(|w| w.bytes().all(|c| c.is_ascii_digit())).count();
    let (numbers, after) = rest.split_at(numbers);
    let mut row: Vec<String> = before.iter().map(|w| (*w).to_owned()).collect();
    row.push(numbers.join(" "));
    row.extend(after.iter().map(|w| (*w).to_owned()));
    row.resize(columns.len().max(row.len()), String::new());
    (row.len() == columns.len()).then_some(row)
}

/// The numbers of words such as X1.5000 and Y-2.0000, in the order X, Y, Z.
fn axes(words: &[&str]) -> Option<Vec<f64>> {
    let value = |letter: &str, word: &&str| word.strip_prefix(letter)?.parse().ok();
    let found: Vec<f64> = ["X", "Y", "Z"].iter().zip(words).map_while(|(l, w)| value(l, w)).collect();
    (found.len() >= 2).then_some(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn csv_cells_may_hold_commas_quotes_and_line_feeds() {
        let table = csv(b"block,pens\nB0001,\"a, \"\"b\"\"\nc\"\nB0002,\n").expect("a table");
        assert_eq!(table.rows[0], (2, vec!["B0001".into(), "a, \"b\"\nc".into()]));
        assert_eq!(table.rows[1], (4, vec!["B0002".into(), String::new()]));
        assert_eq!(csv(b"a,b\n1\n").expect_err("a short row").line, 2);
        assert!(csv(b"a,b\n1,\"2\n").is_err() && csv(b"").is_err() && csv(b"a,b\n1,2").is_err());
    }

    #[test]
    fn run_sheet_columns_are_found_by_name() {
        let text = "part zero  X1.0000 Y-2.0000 Z0.5000 mm in the table frame\npart turn  12.5 deg about z\nloading    a person \
                    loads\nin all     0:10:00; a person attends all of it\n\nPENS (x)\n  \
                    no  speed mm/s  name\n   1  1000  60 % = 9 W   60  1  fine, long  name\n\nBLOCKS (x)\n  block    section  \
                    level  marks mm  lift  pens  file\n  PASS 2\n  B0001  0,0  -1  5.0  yes  1 2  blocks/B0001.dxf\n  \
                    B0002  0,0  -1  5.0  no  3\n";
        let sheet = txt(text.as_bytes()).expect("a sheet");
        assert_eq!((sheet.zero, sheet.turn), (Some(vec![1.0, -2.0, 0.5]), Some(12.5)));
        assert_eq!((sheet.loading.as_deref(), sheet.in_all.as_deref()), (Some("a person loads"), Some("0:10:00")));
        assert_eq!(sheet.pens[0][5], "fine, long  name");
        let blocks = sheet.blocks;
        let cell = |row: usize, name: &str| blocks.rows[row].1[blocks.column(name).expect(name)].as_str();
        assert_eq!((cell(0, "marks mm"), cell(0, "lift"), cell(0, "pens")), ("5.0", "yes", "1 2"));
        assert_eq!((cell(0, "file"), cell(1, "file"), cell(1, "pens")), ("blocks/B0001.dxf", "", "3"));
        assert_eq!(sheet.under, [(2, None), (2, None)]);
        assert!(txt(b"BLOCKS\nblock level pens\n B0001 1").is_err(), "a cut line");
    }
}
