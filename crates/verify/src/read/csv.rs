//! Reader of the CSV files of blocks: one point a line.
//!
//! Consumes the bytes of one file; hands over each stroke in file order, in whole nanometres, with its pen. Strokes
//! are numbered 1, 2, 3 ... without a gap: a line that is missing, repeated or out of place is a fault.

use super::number::{integer, nm_from_decimal};
use super::{Fault, FileStroke, Strokes};

/// Reads the file of a block.
pub(super) fn strokes(bytes: &[u8], visit: &mut Strokes<'_>) -> Result<(), Fault> {
    let mut lines = (1..).zip(bytes.split(|&c| c == b'\n'));
    let (_, head) = lines.next().expect("a split has a first part");
    if head.strip_suffix(b"\r").unwrap_or(head) != b"stroke,pen,x_mm,y_mm" {
        return Err(Fault::new(1, "is not the header stroke,pen,x_mm,y_mm"));
    }
    let (mut stroke, mut pen, mut points) = (0, 0, Vec::new());
    for (number, line) in lines {
        let line = line.strip_suffix(b"\r").unwrap_or(line);
        if line.is_empty() {
            // Only the end of the last line leaves nothing behind it.
            let ends = number == 1 + bytes.iter().filter(|&&c| c == b'\n').count();
            if ends {
                break;
            }
            return Err(Fault::new(number, "is empty"));
        }
        let fields: Vec<&[u8]> = line.split(|&c| c == b',').collect();
        let [of, with, x, y] = fields[..] else { return Err(Fault::new(number, "does not have four fields")) };
        let whole = |field, name| {
            integer(field)
                .filter(|&v| v > 0)
                .ok_or_else(|| Fault::new(number, format!("{name} is not a number from 1")))
        };
        let mm = |field, name| {
            nm_from_decimal(field).ok_or_else(|| Fault::new(number, format!("{name} is not a decimal in mm")))
        };
        let (of, with, at) = (whole(of, "stroke")?, whole(with, "pen")?, [mm(x, "x_mm")?, mm(y, "y_mm")?]);
        if of == stroke + 1 {
            finish(pen, &mut points, visit);
            (stroke, pen) = (of, with);
        } else if of != stroke || with != pen {
            return Err(Fault::new(number, format!("neither continues stroke {stroke} nor begins the next")));
        }
        points.push(at);
    }
    finish(pen, &mut points, visit);
    Ok(())
}

/// Hands over a stroke whose last point was read.
fn finish(pen: i64, points: &mut Vec<[i64; 2]>, visit: &mut Strokes<'_>) {
    if !points.is_empty() {
        visit(FileStroke { pen: usize::try_from(pen).ok(), points, settings: &[] });
    }
    points.clear();
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str =
        "stroke,pen,x_mm,y_mm\r\n1,2,0.000000,-1.5\r\n1,2,0.000001,2\r\n2,1,3,4\r\n2,1,5,6\r\n2,1,3,4\r\n";

    type Drawn = (Option<usize>, Vec<[i64; 2]>);

    fn read(text: &str) -> Result<Vec<Drawn>, Fault> {
        let mut out = Vec::new();
        strokes(text.as_bytes(), &mut |s| out.push((s.pen, s.points.to_vec())))?;
        Ok(out)
    }

    #[test]
    fn strokes_come_in_file_order_with_their_pens() {
        let want: Vec<Drawn> = vec![
            (Some(2), vec![[0, -1_500_000], [1, 2_000_000]]),
            (Some(1), vec![[3_000_000, 4_000_000], [5_000_000, 6_000_000], [3_000_000, 4_000_000]]),
        ];
        assert_eq!(read(TEXT), Ok(want.clone()));
        assert_eq!(read(&TEXT.replace('\r', "")), Ok(want));
        assert_eq!(read("stroke,pen,x_mm,y_mm\r\n"), Ok(Vec::new()));
    }

    #[test]
    fn lines_that_are_missing_repeated_or_malformed_are_faults() {
        for (from, to) in [
            ("stroke,pen,x_mm,y_mm", "x_mm,y_mm,stroke,pen"),
            ("2,1,3,4\r\n2,1,5,6", "3,1,3,4\r\n3,1,5,6"),
            ("1,2,0.000001,2", "1,1,0.000001,2"),
            ("1,2,0.000001,2", "1,2,0.0000011,2"),
            ("1,2,0.000001,2", "1,2,1e3,2"),
            ("1,2,0.000001,2", "1,2,2"),
            ("1,2,0.000001,2", "0,2,1,2"),
            ("1,2,0.000001,2\r\n", "1,2,0.000001,2\r\n\r\n"),
        ] {
            assert!(TEXT.contains(from) && read(&TEXT.replace(from, to)).is_err(), "{from:?} -> {to:?}");
        }
    }
}
