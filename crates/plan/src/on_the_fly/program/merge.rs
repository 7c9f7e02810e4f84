//! Leaves out samples that the line between their neighbours passes.

use super::{AxisCommands, Move, NEAR, NEAR_TURN};
use crate::on_the_fly::axes::motion::AXES;

/// Moves with those joined that run on in one line within the tolerances. What is kept is kept as it was.
///
/// From a kept sample a cone is left open for every axis: the slopes of lines that pass all samples since. The
/// move continues as long as the line to the next sample stays within all tolerances.
///
/// Where axes start slowly, a mark may stand still for some milliseconds: such a sample is left out too if the mark
/// goes on, and the laser is off meanwhile if it ends there.
pub(super) fn merged(start: AxisCommands, moves: Vec<Move>) -> Vec<Move> {
    let mut out: Vec<Move> = Vec::with_capacity(moves.len() / 2);
    let mut from = Move { us: 0, to: start, mark: None };
    let mut cone = SlopeCone::open();
    let mut last: Option<Move> = None;
    for next in moves {
        // Invariant: the cone is that of the lines from `from`, the last move that is kept, past all samples up to
        // `last`.
        let runs_on = last.is_some_and(|l: Move| l.mark == next.mark) && cone.passes(&from, &next);
        if let Some(l) = last.filter(|_| !runs_on) {
            cone = SlopeCone::open();
            let rests = l.mark.is_some() && l.to == from.to;
            if !(rests && l.mark == next.mark) {
                from = if rests { Move { mark: None, ..l } } else { l };
                out.push(from);
            }
        }
        cone.narrow(&from, &next);
        last = Some(next);
    }
    out.extend(last.map(|l| if l.to == from.to { Move { mark: None, ..l } } else { l }));
    out
}

/// Slopes of lines, by axis.
struct SlopeCone {
    lo: [f64; AXES],
    hi: [f64; AXES],
}

impl SlopeCone {
    fn open() -> Self {
        Self { lo: [f64::NEG_INFINITY; AXES], hi: [f64::INFINITY; AXES] }
    }

    /// Whether the line from one sample to another lies in the cone.
    fn passes(&self, from: &Move, to: &Move) -> bool {
        let time = (to.us - from.us) as f64;
        let within = |k: usize| (self.lo[k]..=self.hi[k]).contains(&((to.to[k] - from.to[k]) as f64 / time));
        (0..AXES).all(within)
    }

    /// Leaves the slopes of lines from one sample that pass another near enough.
    fn narrow(&mut self, from: &Move, to: &Move) {
        let time = (to.us - from.us) as f64;
        for k in 0..AXES {
            let near = if matches!(k, 3 | 4) { NEAR_TURN } else { NEAR };
            let step = to.to[k] - from.to[k];
            self.lo[k] = self.lo[k].max((step - near) as f64 / time);
            self.hi[k] = self.hi[k].min((step + near) as f64 / time);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::on_the_fly::program::Mark;
    use terrace_core::program::{PenId, PieceId, StrokeId};

    /// X of moves in nm, with the piece that is marked.
    fn moves(list: &[(i64, i64, Option<u32>)]) -> Vec<Move> {
        let mark = |piece| Mark { pen: PenId(0), source: StrokeId(0), piece: PieceId(piece) };
        let of = |&(us, x, piece): &(i64, i64, Option<u32>)| Move {
            us,
            to: AxisCommands([x, 0, 0, 0, 0, 0, 0]),
            mark: piece.map(mark),
        };
        list.iter().map(of).collect()
    }

    #[test]
    fn laser_is_off_while_a_mark_stands_still() {
        let stands =
            [(10, 500, None), (6000, 500, Some(1)), (6010, 900, Some(1)), (9000, 900, Some(1)), (9010, 0, None)];
        let kept = [(10, 500, None), (6010, 900, Some(1)), (9000, 900, None), (9010, 0, None)];
        assert_eq!(merged(AxisCommands::default(), moves(&stands)), moves(&kept));
        // At the end of the program.
        assert_eq!(merged(AxisCommands::default(), moves(&stands[..4])), moves(&kept[..3]));
        // Where two marks meet.
        let meet = [(10, 500, Some(1)), (6000, 500, Some(1)), (6010, 900, Some(2))];
        assert_eq!(
            merged(AxisCommands::default(), moves(&meet)),
            moves(&[(10, 500, Some(1)), (6000, 500, None), (6010, 900, Some(2))])
        );
    }

    #[test]
    fn samples_on_one_line_are_joined() {
        let line: Vec<(i64, i64, Option<u32>)> = (1..=9).map(|i| (10 * i, 100 * i + i % 2 * 4, Some(0))).collect();
        assert_eq!(merged(AxisCommands::default(), moves(&line)), moves(&line[8..]));
    }
}
