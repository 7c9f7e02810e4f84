//! Reader of the list of poses: one block a line.
//!
//! Consumes the bytes of the file; promises for each line the name of the block, the tool centre in nm and the turns
//! about z, y and x in millionths of a degree.

use super::Fault;
use super::number::nm_from_decimal;

/// One line.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Pose {
    pub(crate) block: String,
    pub(crate) at: [i64; 3],
    pub(crate) turns: [i64; 3],
}

/// Reads the list.
pub(crate) fn read(bytes: &[u8]) -> Result<Vec<Pose>, Fault> {
    let text = std::str::from_utf8(bytes).map_err(|_| Fault::new(1, "is not text"))?;
    // Some readers end a line at either character.
    let breaks = |c: char| text.matches(c).count();
    if !text.ends_with("\r\n") || breaks('\r') != text.matches("\r\n").count() || breaks('\r') != breaks('\n') {
        return Err(Fault::new(1, "has a line that does not end with CR LF"));
    }
    let mut lines = (1..).zip(text.lines());
    if lines.next().map(|(_, head)| head) != Some("block,x_mm,y_mm,z_mm,rz_deg,ry_deg,rx_deg") {
        return Err(Fault::new(1, "is not the header block,x_mm,y_mm,z_mm,rz_deg,ry_deg,rx_deg"));
    }
    lines.map(|(number, line)| pose(number, line)).collect()
}

/// Reads one line, numbered from 1.
fn pose(number: usize, line: &str) -> Result<Pose, Fault> {
    let fields: Vec<&str> = line.split(',').collect();
    let [block, values @ ..] = &fields[..] else { return Err(Fault::new(number, "is empty")) };
    let values: Option<Vec<i64>> = values.iter().map(|v| nm_from_decimal(v.as_bytes())).collect();
    match values.as_deref() {
        Some(&[x, y, z, c, b, a]) => Ok(Pose { block: (*block).to_owned(), at: [x, y, z], turns: [c, b, a] }),
        _ => Err(Fault::new(number, "is not a block and six decimals")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "block,x_mm,y_mm,z_mm,rz_deg,ry_deg,rx_deg\r\n\
        B0001,1.000001,-2.5,3,0.1,-0.000002,20\r\nB0002,0,0,0,0,0,0\r\n";

    #[test]
    fn poses_are_read_to_the_nanometre_and_the_millionth_of_a_degree() {
        let poses = read(TEXT.as_bytes()).expect("poses");
        let first =
            Pose { block: "B0001".into(), at: [1_000_001, -2_500_000, 3_000_000], turns: [100_000, -2, 20_000_000] };
        assert_eq!((poses.len(), &poses[0]), (2, &first));
    }

    #[test]
    fn lines_that_are_malformed_are_faults() {
        for (from, to) in
            [("rx_deg", "rx"), ("3,0.1", "0.1"), ("-2.5", "-2.5e0"), ("20\r\n", "20\r\n\r\n"), ("20", "20.0000001")]
        {
            assert!(TEXT.contains(from) && read(TEXT.replacen(from, to, 1).as_bytes()).is_err(), "{from:?} -> {to:?}");
        }
    }
}
