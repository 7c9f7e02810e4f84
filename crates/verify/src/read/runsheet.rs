//! Readers of the run sheets: the table of blocks of `runsheet.csv` and `runsheet.txt` by the names of its columns, and
//! what the sheet says above it of the part's place and the pens.
//!
//! In the tables every line is known. Around them the sheet says what to do, in sentences that are not read.

use super::Fault;

/// A table: names of its columns, and its rows, each with its line from 1.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Table {
    pub(crate) columns: Vec<String>,
    pub(crate) rows: Vec<(usize, Vec<String>)>,
}

impl Table {
    /// Where a column stands.
    pub(crate) fn column(&self, name: &str) -> Option<usize> {
        self.columns.iter().position(|c| c == name)
    }
}

/// Words that begin a part of the sheet.
const HEADINGS: [&str; 7] = ["PENS", "SET-UPS", "BLOCKS", "BEFORE", "HOW", "PEAKS", "FILES"];

/// Notes that stand behind some of these.
const NOTES: [(&str, &[&str]); 3] = [
    (
        "PENS",
        &[
            " (set them in the marking software)",
            " (the files of the job carry these values)",
            " (DXF and CSV do not carry these values: set them in the marking software)",
            " (the program sets speed and power: set the frequency at the laser)",
        ],
    ),
    ("SET-UPS", &[" (part zero: in the table frame; stage X Y: commanded position with the point under the beam; mm)"]),
    ("BLOCKS", &[" (X Y Z: commanded stage position, mm; LPFL: focal plane on the part, mm; time without the move)"]),
];

/// The columns of pens, word by word.
const PEN_COLUMNS: &[&str] = &["no", "speed", "mm/s", "power", "frequency", "kHz", "passes", "name"];

/// A set-up of the sheet: its part zero, and of each registration point its place on the part and on the stage.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct SheetSetup {
    pub(crate) number: usize,
    pub(crate) count: usize,
    pub(crate) zero: Vec<f64>,
    /// The blocks of the set-up as runs, such as `B0001 to B0004, B0009 to B0009`.
    pub(crate) blocks: String,
    pub(crate) points: Vec<[Vec<f64>; 2]>,
}

/// The contents of `runsheet.txt`.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct RunSheet {
    /// Part zero where there is one set-up, mm.
    pub(crate) zero: Option<Vec<f64>>,
    /// The sides of the part, mm, the name of the machine, and how the part is laid, degrees.
    pub(crate) size: Option<[f64; 3]>,
    pub(crate) machine: Option<String>,
    pub(crate) laid: Option<[f64; 3]>,
    /// How many set-ups its head says that there are, where it is more than one.
    pub(crate) setups_stated: Option<usize>,
    /// Which zero the positions of the stage are from.
    pub(crate) stage_zero: String,
    /// The turn of the part, degrees.
    pub(crate) turn: Option<f64>,
    /// Of a measured part the number of points, the worst residual, um, the lean and the turn about z, degrees.
    pub(crate) measured: Option<[f64; 4]>,
    /// Who loads the blocks, in the words of the sheet, and the time of the job with it.
    pub(crate) loading: Option<String>,
    pub(crate) in_all: Option<String>,
    /// Cells of each pen: number, speed, power, frequency, passes, name.
    pub(crate) pens: Vec<Vec<String>>,
    /// Of pens that mark dots their number and the dwell, us.
    pub(crate) dwells: Vec<(usize, f64)>,
    pub(crate) setups: Vec<SheetSetup>,
    /// The table of blocks.
    pub(crate) blocks: Table,
    /// By row of the table, the pass and the set-up under whose heading it stands, from 1.
    pub(crate) under: Vec<(u32, Option<u32>)>,
    /// By row of the table, the z in mm that a line before it says to lift to, and the block that it is on the way to.
    pub(crate) lifts: Vec<Option<(f64, String)>>,
}

/// Reads `runsheet.csv`: cells apart by commas, in quotes where they hold one.
pub(crate) fn csv(bytes: &[u8]) -> Result<Table, Fault> {
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
pub(crate) fn txt(bytes: &[u8]) -> Result<RunSheet, Fault> {
    let mut reader = SheetReader { pass: 1, ..SheetReader::default() };
    for (number, line) in (1..).zip(text(bytes)?.lines()) {
        reader.line(number, line).map_err(|what| Fault::new(number, what))?;
    }
    Ok(reader.sheet)
}

/// Reads `runsheet.txt` line by line.
#[derive(Default)]
struct SheetReader<'a> {
    sheet: RunSheet,
    /// The heading under which the line at hand stands; empty in the head.
    part: &'a str,
    /// The headings so far.
    headings: Vec<&'a str>,
    /// The line before.
    before: &'a str,
    /// Whether the columns of pens have come.
    has_pens: bool,
    /// Pass and set-up under whose headings the next row of the table stands, and the lift that a line before it
    /// states.
    pass: u32,
    setup: Option<u32>,
    lift: Option<(f64, String)>,
}

impl<'a> SheetReader<'a> {
    /// Reads a line, numbered from 1; returns what is wrong with it.
    fn line(&mut self, number: usize, line: &'a str) -> Result<(), String> {
        // Two inputs may be warned of in the same words.
        if !line.is_empty() && line == std::mem::replace(&mut self.before, line) && !line.starts_with("WARNING ") {
            return Err("stands there twice".into());
        }
        // Headings in capitals divide the sheet; what a part does not know is text for people.
        if let Some(head) = HEADINGS.into_iter().find(|h| line.starts_with(h)) {
            return self.heading(head, &line[head.len()..]);
        }
        // A box to tick stands before each block.
        let line = line.strip_prefix("[ ]").unwrap_or(line);
        let words: Vec<&str> = line.split_whitespace().collect();
        match self.part {
            "" => self.head(line, &words),
            "PENS" => self.pens(line, &words),
            "SET-UPS" => self.setups(&words),
            "BLOCKS" => self.blocks(number, line, &words),
            _ => Ok(()),
        }
    }

    /// Begins a part of the sheet by its heading, after which a note stands.
    fn heading(&mut self, head: &'a str, note: &str) -> Result<(), String> {
        if let Some((_, notes)) = NOTES.iter().find(|(heading, notes)| *heading == head && !notes.contains(&note)) {
            return Err(format!("is not the heading {head}{}", notes[0]));
        }
        if self.headings.contains(&head) {
            return Err("is a heading that was before".into());
        }
        self.headings.push(head);
        self.part = head;
        Ok(())
    }

    /// A line of the head, in which each key stands once.
    fn head(&mut self, line: &str, words: &[&str]) -> Result<(), String> {
        let sheet = &mut self.sheet;
        match words {
            ["size", w, "x", d, "x", h, "mm", "as", "it", "is", "laid"] => {
                set_once(&mut sheet.size, numbers([w, d, h]))
            }
            ["machine", _, ..] => {
                let name = line.trim_start().strip_prefix("machine").map(|name| name.trim().to_owned());
                set_once(&mut sheet.machine, name)
            }
            ["part", "laid", "rotated", x, "deg", "about", "x,", y, "deg", "about", "y,", z, rest @ ..]
                if *rest == ["deg", "about", "z", "of", "its", "file"] =>
            {
                set_once(&mut sheet.laid, numbers([x, y, z]))
            }
            ["part", "zero", zero @ .., "mm", "in", "the", "table", "frame"] => set_once(&mut sheet.zero, axes(zero)),
            ["part", "zero", count, "set-ups,", "each", "with", "its", "own:", "see", "SET-UPS"] => {
                set_once(&mut sheet.setups_stated, count.parse().ok())
            }
            ["zero", stage_zero @ ..] => {
                if !sheet.stage_zero.is_empty() {
                    return Err(TWICE.into());
                }
                sheet.stage_zero = stage_zero.join(" ");
                Ok(())
            }
            ["part", "turn", turn, "deg", "about", "z"] => set_once(&mut sheet.turn, turn.parse().ok()),
            ["loading", words @ ..] => set_once(&mut sheet.loading, Some(words.join(" "))),
            ["in", "all", time, ..] => set_once(&mut sheet.in_all, Some(time.trim_end_matches(';').to_owned())),
            // A line of the head that is read is known to the last word.
            ["measured", points, "points,", "worst", "residual", worst, "um,", "leaning", lean, "deg,", rest @ ..]
                if matches!(
                    rest,
                    ["turned", _, "deg", "about", "z", "in", "addition", "to", "the", "part", "turn"]
                ) =>
            {
                let known = numbers([points, worst, lean]).zip(rest[1].parse().ok());
                set_once(&mut sheet.measured, known.map(|([points, worst, lean], turn)| [points, worst, lean, turn]))
            }
            ["size" | "machine" | "measured", ..] | ["part", "zero" | "laid" | "turn", ..] => {
                Err("cannot be read".into())
            }
            _ => Ok(()),
        }
    }

    /// A line of the table of pens, known to the last word: whoever marks sets the laser by it.
    fn pens(&mut self, line: &str, words: &[&str]) -> Result<(), String> {
        match words {
            [] => {}
            PEN_COLUMNS if !self.has_pens => self.has_pens = true,
            ["dots", "of", "pen", number, "dwell", us, "us"] => {
                let dwell = number.trim_end_matches(':').parse().ok().zip(us.parse().ok());
                self.sheet.dwells.push(dwell.ok_or("the dwell of a pen is not a number")?);
            }
            [number, ..] if self.has_pens && number.parse::<u32>().is_ok() => self.sheet.pens.push(cells(line, 6)),
            _ => return Err(NOT_OF_TABLE.into()),
        }
        Ok(())
    }

    /// A line about set-ups.
    fn setups(&mut self, words: &[&str]) -> Result<(), String> {
        match words {
            ["SET-UP", number, "OF", count, "part", "zero", x, y, z, "blocks", blocks @ ..] => {
                let zero = axes(&[x, y, z]).filter(|zero| zero.len() == 3);
                let numbers = number.parse().ok().zip(count.parse().ok());
                let (zero, (number, count)) = zero.zip(numbers).ok_or("a set-up cannot be read")?;
                let blocks = blocks.join(" ");
                self.sheet.setups.push(SheetSetup { number, count, zero, blocks, points: Vec::new() });
            }
            ["SET-UP" | "point", ..] if !is_point(words) => return Err("cannot be read".into()),
            ["point", x, y, "of", "the", "part:", "stage", stage @ ..] => {
                let point: Option<Vec<f64>> = [x, y].into_iter().map(|v| v.parse().ok()).collect();
                let found = point.zip(axes(stage)).zip(self.sheet.setups.last_mut());
                let ((point, stage), setup) = found.ok_or("a registration point cannot be read")?;
                setup.points.push([point, stage]);
            }
            _ => {}
        }
        Ok(())
    }

    /// A line of the table of blocks, known to the last word: whoever moves the stage by hand goes by it.
    fn blocks(&mut self, number: usize, line: &str, words: &[&str]) -> Result<(), String> {
        let sheet = &mut self.sheet;
        match words {
            [] => {}
            ["block", ..] if sheet.blocks.columns.is_empty() => sheet.blocks.columns = cells(line, usize::MAX),
            ["PASS", number] => self.pass = number.parse().map_err(|_| "the pass has no number")?,
            ["LIFT", "to", z, "then", "go", "to", id] => {
                let z = z.strip_prefix('Z').and_then(|z| z.strip_suffix(',')).and_then(|z| z.parse().ok());
                self.lift = Some((z.ok_or("the z of a lift cannot be read")?, (*id).to_owned()));
            }
            ["SET-UP", number] => self.setup = Some(number.parse().map_err(|_| "the set-up has no number")?),
            [id, ..] if id.starts_with('B') => {
                let row = row(&sheet.blocks.columns, words).ok_or("a block has too few cells")?;
                sheet.blocks.rows.push((number, row));
                sheet.under.push((self.pass, self.setup));
                sheet.lifts.push(self.lift.take());
            }
            _ => return Err(NOT_OF_TABLE.into()),
        }
        Ok(())
    }
}

const TWICE: &str = "is said twice";
const NOT_OF_TABLE: &str = "is not a line of this table";

/// Fills a field of the head that is still empty.
fn set_once<T>(field: &mut Option<T>, value: Option<T>) -> Result<(), String> {
    if field.is_some() {
        return Err(TWICE.into());
    }
    *field = value;
    Ok(())
}

/// The text of a sheet, which ends with a line.
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

/// Whether these are the words of a registration point.
fn is_point(words: &[&str]) -> bool {
    matches!(words, ["point", _, _, "of", "the", "part:", "stage", _, _])
}

/// Three numbers.
fn numbers(words: [&&str; 3]) -> Option<[f64; 3]> {
    let [Ok(a), Ok(b), Ok(c)] = words.map(|word| word.parse()) else { return None };
    Some([a, b, c])
}

/// The numbers of words such as X1.5000 and Y-2.0000, in the order X, Y, Z, two or three and nothing else.
fn axes(words: &[&str]) -> Option<Vec<f64>> {
    let value = |(letter, word): (&&str, &&str)| word.strip_prefix(letter)?.parse().ok();
    (2..=3).contains(&words.len()).then(|| ["X", "Y", "Z"].iter().zip(words).map(value).collect())?
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
                    loads\nin all     0:10:00; a person attends all of it\n\nPENS (set them \
                    in the marking software)\n  no  speed mm/s  power  frequency kHz  passes  name\n   1  1000  60 % = 9 \
                    W   60  1  fine, long  name\n\nBLOCKS (X Y Z: commanded stage position, mm; LPFL: focal plane on \
                    the part, mm; time without the move)\n  block    section  \
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
