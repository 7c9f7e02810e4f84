//! The tour of the stage: section by section in a serpentine, levels alternately up and down.
//!
//! Nearly all moves are then moves of z alone, which cost a fraction of an xy move. In every section
//! the tour starts at the end of its levels that is nearer to where the stage stands.

use crate::program::Stop;

/// The order in which stops are visited, as indices into `stops`, which are given section by section
/// and upwards in each.
pub fn serpentine(stops: &[Stop]) -> Vec<usize> {
    let mut first = 0;
    let mut sections = Vec::new();
    for s in stops.chunk_by(|a, b| a.section == b.section) {
        sections.push((first, s));
        first += s.len();
    }
    sections.sort_by_key(|(_, s)| {
        let [column, row] = s[0].section.map(i64::from);
        (row, if row % 2 == 0 { column } else { -column })
    });
    let mut order = Vec::with_capacity(stops.len());
    let mut z: Option<i64> = None;
    for (first, s) in sections {
        let down = z.is_some_and(|z| (s[s.len() - 1].focus - z).abs() < (s[0].focus - z).abs());
        if down {
            order.extend((first..first + s.len()).rev());
            z = Some(s[0].focus);
        } else {
            order.extend(first..first + s.len());
            z = Some(s[s.len() - 1].focus);
        }
    }
    order
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::P2;

    #[test]
    fn sections_run_to_and_fro_and_levels_up_and_down() {
        let mut stops = Vec::new();
        for (column, row) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
            for level in 0..3i32 {
                let z = i64::from(level) * 70_000;
                stops.push(Stop { section: [column, row], level, centre: P2::new(0, 0), focus: z, z_lo: z, z_hi: z });
            }
        }
        assert_eq!(serpentine(&stops), [0, 1, 2, 5, 4, 3, 9, 10, 11, 8, 7, 6]);
    }
}
