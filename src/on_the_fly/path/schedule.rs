//! When the beam is where on its path, at the speeds of its pens: what scanner and stage divide between them.
//!
//! Marks run at their pen's speed, jumps at the scanner's; the beam waits at ends and corners as the machine's
//! delays say. As in [`crate::motion::marking`] the scanner is taken as always at speed: what it loses at
//! starts, ends and corners is what the delays stand for. A jump that is longer than half of the field is the
//! stage's to carry: it runs no faster than the quickest pen, or the stage. Units: mm, s.

use crate::geom::mm_from_nm;
use crate::machine::Machine;
use crate::on_the_fly::path::{Node, Path};
use crate::program::Pen;

/// Times at the nodes of a path, and what they are made of.
#[derive(Clone, Debug, Default)]
pub struct Schedule {
    /// When the beam comes to each node, s.
    pub arrive: Vec<f64>,
    /// When it goes on.
    pub leave: Vec<f64>,
    /// Time of marks, s.
    pub mark_s: f64,
    /// Time of jumps, s.
    pub jump_s: f64,
    /// Time of waiting, s.
    pub delay_s: f64,
}

/// The path at even steps of time.
#[derive(Clone, Debug, Default)]
pub struct Samples {
    /// Where the beam is.
    pub at: Vec<[f64; 3]>,
    /// Whether it marks.
    pub on: Vec<bool>,
    /// Time between samples, s.
    pub step_s: f64,
}

/// Whether the stretch that ends at each node belongs to a jump that is longer than half of the field.
fn carried(path: &Path, machine: &Machine) -> Vec<bool> {
    let half = machine.usable_field().map(|f| mm_from_nm(f) / 2.0);
    let mut out = vec![false; path.len()];
    let mut i = 1;
    while i < path.len() {
        let end = (i..path.len()).find(|&j| path.pen[j].is_some() || path.run[j].is_some()).unwrap_or(path.len());
        if end > i {
            let (a, b) = (path.at[i - 1], path.at[end - 1]);
            out[i..end].fill((0..2).any(|k| (b[k] - a[k]).abs() > half[k]));
        }
        i = end + 1;
    }
    out
}

impl Schedule {
    /// The times of a path on which the beam waits at every end for `wait_s` at least.
    pub fn of(path: &Path, machine: &Machine, pens: &[Pen], wait_s: f64) -> Self {
        let mut out = Self::default();
        let delays = &machine.delays;
        let [jump, mark, corner] = [delays.jump, delays.mark, delays.polygon].map(|t| t.as_s());
        let jump_speed = machine.scanner.jump_speed.as_mm_s();
        let carried = carried(path, machine);
        let fastest = pens.iter().map(|p| p.speed.as_mm_s()).fold(0.0, f64::max);
        let stage = machine.stage.x.speed.as_mm_s().min(machine.stage.y.speed.as_mm_s());
        let carry_speed = fastest.max(stage).min(jump_speed);
        let mut now = 0.0;
        for (i, carried) in carried.into_iter().enumerate() {
            let here = path.pen[i];
            if i > 0 {
                let (a, b) = (path.at[i - 1], path.at[i]);
                let length = (b[0] - a[0]).hypot(b[1] - a[1]);
                let (speed, sum) = match here {
                    Some(pen) => (pens[usize::from(pen)].speed.as_mm_s(), &mut out.mark_s),
                    None => {
                        let run = path.run[i].map(|pen| pens[usize::from(pen)].speed.as_mm_s());
                        let jump = if carried { carry_speed } else { jump_speed };
                        (run.unwrap_or(jump), &mut out.jump_s)
                    }
                };
                *sum += length / speed;
                now += length / speed;
            }
            out.arrive.push(now);
            let next = path.pen.get(i + 1).copied().flatten();
            let wait = match path.node[i] {
                Node::Between => 0.0,
                Node::Vertex | Node::Corner => corner,
                // The end of a mark, the begin of one, or both.
                Node::End => (here.map_or(0.0, |_| mark) + next.map_or(0.0, |_| jump)).max(wait_s),
            };
            out.delay_s += wait;
            now += wait;
            out.leave.push(now);
        }
        out
    }

    /// Steps of a quarter of a millisecond, or what keeps a long path at `most` samples.
    pub fn step_s(&self, most: usize) -> f64 {
        const FINEST: f64 = 2.5e-4;
        (self.total_s() / most as f64).max(FINEST)
    }

    /// Time of the whole path, s.
    pub fn total_s(&self) -> f64 {
        self.leave.last().copied().unwrap_or_default()
    }

    /// The path at even steps of `step_s` or a little less, both ends included.
    pub fn samples(&self, path: &Path, step_s: f64) -> Samples {
        let count = ((self.total_s() / step_s).ceil() as usize).max(1);
        let step_s = self.total_s() / count as f64;
        let mut out = Samples { step_s, ..Samples::default() };
        let mut i = 0;
        for k in 0..=count {
            let now = k as f64 * step_s;
            while i + 1 < path.len() && self.arrive[i + 1] <= now {
                i += 1;
            }
            let moving = i + 1 < path.len() && now > self.leave[i];
            let t = if moving { (now - self.leave[i]) / (self.arrive[i + 1] - self.leave[i]) } else { 0.0 };
            let (a, b) = (path.at[i], path.at[(i + 1).min(path.len() - 1)]);
            out.at.push([0, 1, 2].map(|c| a[c] + t * (b[c] - a[c])));
            let waits = path.node[i] == Node::End;
            out.on.push(if moving { path.pen[i + 1].is_some() } else { !waits && path.pen[i].is_some() });
        }
        out
    }
}
