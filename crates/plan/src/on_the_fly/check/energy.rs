//! Line energy of the marks of an on-the-fly program: what the laser gives to each length of a line.
//!
//! Consumes, move by move, the way of the spot across its beam, its time, and the pen; promises the mean over the
//! marks, how much of them runs at the speed of their pens, and where a line gets most. The power of a pen is constant,
//! so where the spot slows down E(s) = P / v(s) rises. On the part it is spread over the spot: the energy at a place is
//! that of the line over the length of a spot, P times the longest time for such a way; marks shorter than a spot count
//! as they are. Where the power follows the speed, every length gets P / v of the pen. Units: mm, s, W, J/m.

use terrace_core::machine::Machine;
use terrace_core::program::Pen;

/// How near the pen's speed a move is at it, as a share: samples are rounded.
pub const AT_SPEED: f64 = 0.01;

/// Line energy of the marks of a program.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LineEnergy {
    /// Mean over the length of the marks, J/m.
    pub mean_j_per_m: f64,
    /// Share of the length that is marked within `AT_SPEED` of the speed of its pen.
    pub at_speed: f64,
    /// Time with the laser on at less than half the speed of the pen, s.
    pub slow_s: f64,
    /// The most that a line gets over the length of a spot, as a multiple of P / v of its pen.
    pub worst_share: f64,
    /// Where that is, part frame.
    pub worst_at: [f64; 2],
}

/// The end of a move of a piece, or its begin.
#[derive(Clone, Copy)]
struct PiecePoint {
    /// Way since the piece began, mm.
    way: f64,
    /// How long the pen's own power would have taken since then, s.
    full_s: f64,
    /// Where it is, part frame.
    at: [f64; 2],
}

/// The marks as they are gone through, one piece after the other.
pub(super) struct Marks<'a> {
    machine: &'a Machine,
    /// Size of the spot, mm.
    spot: f64,
    /// The piece so far, from its begin.
    piece: Vec<PiecePoint>,
    pen: Option<&'a Pen>,
    /// Whether the power follows the speed.
    by_speed: bool,
    /// Energy of all marks, J.
    joule: f64,
    /// Length of all marks, mm.
    length: f64,
    /// Length that is marked at the speed of its pen, mm.
    at_speed: f64,
    out: LineEnergy,
}

impl<'a> Marks<'a> {
    pub(super) fn new(machine: &'a Machine, by_speed: bool) -> Self {
        Self {
            machine,
            spot: machine.lens.spot.as_mm(),
            piece: Vec::new(),
            pen: None,
            by_speed,
            joule: 0.0,
            length: 0.0,
            at_speed: 0.0,
            out: LineEnergy::default(),
        }
    }

    /// A piece begins at `at` with this pen.
    pub(super) fn begin(&mut self, pen: &'a Pen, at: [f64; 2]) {
        self.end();
        self.pen = Some(pen);
        self.piece.push(PiecePoint { way: 0.0, full_s: 0.0, at });
    }

    /// The piece continues by `way` to `at` in `s`.
    pub(super) fn go(&mut self, way: f64, s: f64, at: [f64; 2]) {
        let (Some(pen), Some(&last)) = (self.pen, self.piece.last()) else { return };
        let speed = pen.speed.as_mm_s();
        // How long the pen's own power would take for as much energy.
        let full_s = if self.by_speed { way / speed } else { s };
        self.joule += pen.power.as_w(self.machine.laser.max_power) * full_s;
        self.length += way;
        if way >= (1.0 - AT_SPEED) * speed * s {
            self.at_speed += way;
        }
        if 2.0 * way < speed * s {
            self.out.slow_s += s;
        }
        self.piece.push(PiecePoint { way: last.way + way, full_s: last.full_s + full_s, at });
    }

    /// The piece ends.
    fn end(&mut self) {
        let piece = std::mem::take(&mut self.piece);
        let (Some(pen), Some(&last)) = (self.pen.take(), piece.last()) else { return };
        let length = last.way;
        let window = self.spot.min(length);
        if window <= 0.0 {
            return;
        }
        let speed = pen.speed.as_mm_s();
        if window >= length {
            self.raise_worst(speed * last.full_s / window, piece[piece.len() / 2].at);
            return;
        }
        // The time for a window is largest where it begins or ends with a move: it is linear in between.
        let (mut ahead, mut behind) = (0, 0);
        for &PiecePoint { way, full_s, at } in &piece {
            if way + window <= length {
                let seconds = time_at(&piece, way + window, &mut ahead) - full_s;
                self.raise_worst(speed * seconds / window, at);
            }
            if way >= window {
                let seconds = full_s - time_at(&piece, way - window, &mut behind);
                self.raise_worst(speed * seconds / window, at);
            }
        }
    }

    /// Notes what a line gets over the length of a spot, as a multiple of P / v of its pen, where it is the most.
    fn raise_worst(&mut self, share: f64, at: [f64; 2]) {
        if share > self.out.worst_share {
            self.out.worst_share = share;
            self.out.worst_at = at;
        }
    }

    /// The line energy of all pieces.
    pub(super) fn energy(mut self) -> LineEnergy {
        self.end();
        if self.length > 0.0 {
            self.out.mean_j_per_m = 1e3 * self.joule / self.length;
            self.out.at_speed = self.at_speed / self.length;
        }
        self.out
    }
}

/// The time at which a piece has gone so far; `hint` is a move at or before it, and moves on.
fn time_at(piece: &[PiecePoint], way: f64, hint: &mut usize) -> f64 {
    while *hint + 2 < piece.len() && piece[*hint + 1].way < way {
        *hint += 1;
    }
    let (from, to) = (piece[*hint], piece[*hint + 1]);
    let share = if to.way > from.way { ((way - from.way) / (to.way - from.way)).clamp(0.0, 1.0) } else { 1.0 };
    from.full_s + share * (to.full_s - from.full_s)
}

#[cfg(test)]
mod tests {
    use super::*;
    use terrace_core::units::{Frequency, Length, Power, Speed};

    fn found(spot_mm: f64, moves: &[[f64; 2]]) -> LineEnergy {
        found_by(false, spot_mm, moves)
    }

    fn found_by(by_speed: bool, spot_mm: f64, moves: &[[f64; 2]]) -> LineEnergy {
        let mut machine = Machine::built_in("xyz-galvo-40").expect("a profile");
        machine.lens.spot = Length::mm(spot_mm);
        let pen = Pen {
            name: "fill".into(),
            speed: Speed::mm_s(100.0),
            power: Power::Percent(50.0),
            frequency: Frequency::khz(60.0),
            passes: 1,
            dwell: None,
        };
        let mut marks = Marks::new(&machine, by_speed);
        marks.begin(&pen, [0.0; 2]);
        let mut x = 0.0;
        for &[way, s] in moves {
            x += way;
            marks.go(way, s, [x, 0.0]);
        }
        marks.energy()
    }

    #[test]
    fn a_mark_at_the_speed_of_its_pen_gets_its_energy_everywhere() {
        let e = found(0.1, &[[5.0, 0.05], [3.0, 0.03]]);
        // 7 W at 100 mm/s.
        assert!((e.mean_j_per_m - 70.0).abs() < 1e-9 && (e.worst_share - 1.0).abs() < 1e-9, "{e:?}");
        assert_eq!((e.at_speed, e.slow_s), (1.0, 0.0));
    }

    #[test]
    fn a_spot_that_slows_down_gives_most_where_a_spot_takes_longest() {
        // 0.05 mm at a tenth of the speed in the middle of 10 mm: half a spot of 0.1 mm.
        let e = found(0.1, &[[5.0, 0.05], [0.05, 0.005], [4.95, 0.0495]]);
        assert!((e.worst_share - (0.5 * 10.0 + 0.5)).abs() < 1e-9, "{e:?}");
        assert!((e.worst_at[0] - 5.0).abs() < 0.06 && (e.slow_s - 0.005).abs() < 1e-12, "{e:?}");
        assert!((e.at_speed - 9.95 / 10.0).abs() < 1e-12, "{e:?}");
        // However finely the moves are cut.
        let fine: Vec<[f64; 2]> =
            (0..1000).map(|_| [0.005, 0.000_05]).chain((0..10).map(|_| [0.005, 0.0005])).collect();
        let e = found(0.1, &fine);
        assert!((e.worst_share - 5.5).abs() < 1e-6, "{e:?}");
    }

    #[test]
    fn power_that_follows_the_speed_gives_every_length_the_same() {
        let moves = [[5.0, 0.05], [0.05, 0.005], [4.95, 0.0495]];
        let e = found_by(true, 0.1, &moves);
        assert!((e.worst_share - 1.0).abs() < 1e-9 && (e.mean_j_per_m - 70.0).abs() < 1e-9, "{e:?}");
        assert_eq!([e.at_speed, e.slow_s], [found(0.1, &moves).at_speed, 0.005]);
    }

    #[test]
    fn a_mark_shorter_than_a_spot_counts_as_it_is() {
        let e = found(0.1, &[[0.02, 0.001], [0.02, 0.001]]);
        assert!((e.worst_share - 100.0 * 0.002 / 0.04).abs() < 1e-9, "{e:?}");
        assert_eq!(found(0.1, &[]), LineEnergy::default());
    }
}
