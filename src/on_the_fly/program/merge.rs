//! Leaves out samples that the line between their neighbours passes.

use super::{AxisCommands, Move, NEAR, NEAR_TURN};
use crate::on_the_fly::axes::motion::AXES;

/// The same moves, those joined that run on in one line within the tolerances. What is kept is kept as it was.
///
/// From a kept sample a cone is left open for every axis: the slopes of lines that pass all samples since. The
/// move goes on as long as the line to the next sample stays within all tolerances.
pub(super) fn merged(start: AxisCommands, moves: Vec<Move>) -> Vec<Move> {
    let mut out: Vec<Move> = Vec::with_capacity(moves.len() / 2);
    let mut from = Move { us: 0, to: start, mark: None };
    let mut cone = SlopeCone::open();
    let mut last: Option<Move> = None;
    for next in moves {
        let goes_on = last.is_some_and(|l: Move| l.mark == next.mark) && cone.passes(&from, &next);
        if let Some(l) = last.filter(|_| !goes_on) {
            out.push(l);
            (from, cone) = (l, SlopeCone::open());
        }
        cone.narrow(&from, &next);
        last = Some(next);
    }
    out.extend(last);
    out
}

struct SlopeCone {
    lo: [f64; AXES],
    hi: [f64; AXES],
}

impl SlopeCone {
    fn open() -> Self {
        Self { lo: [f64::NEG_INFINITY; AXES], hi: [f64::INFINITY; AXES] }
    }

    fn passes(&self, from: &Move, to: &Move) -> bool {
        let time = (to.us - from.us) as f64;
        let within = |k: usize| (self.lo[k]..=self.hi[k]).contains(&((to.to[k] - from.to[k]) as f64 / time));
        (0..AXES).all(within)
    }

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
