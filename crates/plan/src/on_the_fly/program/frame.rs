//! From the part to what axes are commanded: placement, pivot, and the machine's signs.
//!
//! Units: mm and rad in, nm and millionths of a degree out. The part is turned by -C about z, then by A about x
//! ([`crate::on_the_fly::axes::motion`]), about the pivot of the machine's table.

use crate::on_the_fly::axes::kinematics::{Pivot, TurnedAbout, beam_axis, turned, turned_back};
use crate::on_the_fly::axes::motion::AXES;
use crate::on_the_fly::program::{AxisCommands, Kind};
use terrace_core::diag::{Diag, Error, Place};
use terrace_core::geom::{MAX_NM, NM_PER_MM, P3Mm, Part, UnitVector, mm_from_nm};
use terrace_core::machine::{Carries, Letter, Machine, Origin, Scanner, Tilt};
use terrace_core::math;

/// How far axes may have turned, millionths of a degree: 100,000 turns.
const MOST_TURNED: f64 = 3.6e13;

/// The frame of the machine's table, in which X, Y and Z count along its axes, less their signs.
#[derive(Clone, Copy)]
pub(super) struct TableFrame;

/// A part as A and C have turned it about its own origin.
type TurnedPart = TurnedAbout<Part>;

/// Where a part lies on a machine.
pub(super) struct Frame {
    kind: Kind,
    /// Signs of X, Y, Z, A and C.
    signs: [f64; 5],
    /// The origin of the part, seen from the pivot.
    origin: P3Mm<Pivot>,
    /// The point about which A and C turn; the origin of the table where none do.
    pivot: P3Mm<TableFrame>,
    scanner: Scanner,
}

/// Where a beam meets its focal plane.
pub struct Spot {
    /// In the part frame.
    pub part: P3Mm,
    /// Against the beam.
    pub up: UnitVector,
    /// How far it is from where axes turn, mm.
    pub lever: f64,
}

impl Spot {
    /// How far the beam moves across itself to another, mm: the way that the pens' speeds are of.
    pub fn way(&self, to: &Self) -> f64 {
        let (d, UnitVector(up)) = (to.part.way_from(self.part), self.up);
        let along: f64 = (0..3).map(|k| d[k] * up[k]).sum();
        (0..3).map(|k| (d[k] - along * up[k]).powi(2)).sum::<f64>().sqrt()
    }
}

impl Frame {
    pub(super) fn new(machine: &Machine, origin: Origin, kind: Kind) -> Result<Self, Error> {
        let stage = machine.axes().map(|(_, axis)| axis.sign() as f64);
        let mut signs = [stage[0], stage[1], stage[2], 0.0, 0.0];
        let mut pivot = P3Mm::new([0.0; 3]);
        if kind == Kind::Xyzacuv {
            let is_table =
                |t: &&Tilt| t.carries == Carries::Part && t.axes.each_ref().map(|a| a.letter) == [Letter::A, Letter::C];
            let table = machine.tilt.as_ref().filter(is_table);
            let Some(table) = table else {
                let text = "a program of seven axes needs a swivel A that carries a turntable C";
                let hint = "describe them under [tilt] in the machine file, A first, or mark with five axes";
                return Err(Diag::limit("fly-axes", text).at(Place::file(&machine.name)).hint(hint).into());
            };
            pivot = P3Mm::new(table.pivot.map(|p| p.as_mm()));
            let sign = |k: usize| if table.axes[k].reversed { -1.0 } else { 1.0 };
            // A positive command turns the part right-handed; a positive C of the motion turns it the other way.
            (signs[3], signs[4]) = (sign(0), -sign(1));
        }
        let origin = P3Mm::new([0, 1, 2].map(|k| mm_from_nm(origin[k]) - pivot[k]));
        Ok(Self { kind, signs, origin, pivot, scanner: machine.scanner.clone() })
    }

    /// Whether axes turn.
    pub(super) fn turns(&self) -> bool {
        self.kind == Kind::Xyzacuv
    }

    /// Where a point of the part, as A and C turn it about its own origin, lies on the table: they turn it about the
    /// pivot.
    fn table(&self, a: f64, c: f64, q: P3Mm<TurnedPart>) -> P3Mm<TableFrame> {
        let shift = if self.turns() { turned(a, c, self.origin).mm } else { self.origin.mm };
        P3Mm::new(q.moved(shift).moved(self.pivot.mm).mm)
    }

    /// Axes of a motion with X, Y and Z in the table frame.
    pub(super) fn placed(&self, axes: &[f64; AXES]) -> [f64; AXES] {
        let [x, y, z, a, c, u, v] = *axes;
        let [x, y, z] = self.table(a, c, P3Mm::new([x, y, z])).mm;
        [x, y, z, a, c, u, v]
    }

    /// Commands of all axes at a position of the stage in the table frame, with U and V such that the beam passes
    /// through `spot`. What rounding takes from the stage the scanner adds. None beyond 4 m or [`MOST_TURNED`].
    pub(super) fn commanded(&self, axes: &[f64; AXES], spot: P3Mm) -> Option<AxisCommands> {
        let [x, y, z, a, c, ..] = *axes;
        let mut out = [0.0; AXES];
        let [mut a_held, mut c_held] = [a, c];
        if self.turns() {
            for (k, (angle, held)) in [(a, &mut a_held), (c, &mut c_held)].into_iter().enumerate() {
                let command = (self.signs[3 + k] * angle.to_degrees() * 1e6).round();
                out[3 + k] = command;
                *held = self.signs[3 + k] * (command * 1e-6).to_radians();
            }
        }
        for (k, v) in [x, y, z].into_iter().enumerate() {
            out[k] = (self.signs[k] * v * NM_PER_MM).round();
        }
        let mark = self.table(a_held, c_held, turned(a_held, c_held, spot));
        let field = [0, 1].map(|k| mark[k] - self.signs[k] * out[k] / NM_PER_MM);
        let field = field.map(|v| (v * NM_PER_MM).round());
        let s = &self.scanner;
        let [u, v] = if s.swap_xy { [field[1], field[0]] } else { field };
        out[5] = if s.mirror_x { -u } else { u };
        out[6] = if s.mirror_y { -v } else { v };
        let is_near = |(k, v): (usize, &f64)| v.abs() <= if matches!(k, 3 | 4) { MOST_TURNED } else { MAX_NM.f64() };
        out.iter().enumerate().all(is_near).then(|| AxisCommands(out.map(|v| v as i64)))
    }

    /// Where the beam of a sample meets the focal plane.
    pub(super) fn spot(&self, at: &AxisCommands) -> Spot {
        let mm = |k: usize| mm_from_nm(at[k]);
        let s = &self.scanner;
        let (u, v) = (if s.mirror_x { -mm(5) } else { mm(5) }, if s.mirror_y { -mm(6) } else { mm(6) });
        let [u, v] = if s.swap_xy { [v, u] } else { [u, v] };
        let table =
            P3Mm::<TableFrame>::new([self.signs[0] * mm(0) + u, self.signs[1] * mm(1) + v, self.signs[2] * mm(2)]);
        let from_pivot = table.way_from(self.pivot);
        let [a, c] = [3, 4].map(|k| (self.signs[k] * mm(k)).to_radians());
        let (p, up) = if self.turns() {
            (turned_back(a, c, P3Mm::<TurnedAbout<Pivot>>::new(from_pivot)), beam_axis(a, c))
        } else {
            (P3Mm::new(from_pivot), UnitVector::UP)
        };
        let [x, y, z] = from_pivot;
        Spot { part: P3Mm::new(p.way_from(self.origin)), up, lever: math::hypot(math::hypot(x, y), z) }
    }

    /// A sample with the stage where another has it; U and V compensate for X and Y.
    pub(super) fn held(&self, to: &AxisCommands, stage: &AxisCommands) -> AxisCommands {
        let mut out = *to;
        out.0[..3].copy_from_slice(&stage.0[..3]);
        let [dx, dy] = [0, 1].map(|k| self.signs[k] as i64 * (to[k] - stage[k]));
        let s = &self.scanner;
        let [du, dv] = if s.swap_xy { [dy, dx] } else { [dx, dy] };
        out[5] += if s.mirror_x { -du } else { du };
        out[6] += if s.mirror_y { -dv } else { dv };
        out
    }

    /// The field point of a sample, nm.
    pub(super) fn field(&self, at: &AxisCommands) -> [i64; 2] {
        let s = &self.scanner;
        let (u, v) = (if s.mirror_x { -at[5] } else { at[5] }, if s.mirror_y { -at[6] } else { at[6] });
        if s.swap_xy { [v, u] } else { [u, v] }
    }

    /// How far, nm, a straight move of all axes bows across the beam off the straight line in the part.
    pub(super) fn bow(&self, from: &[f64; AXES], to: &[f64; AXES], p: P3Mm, q: P3Mm) -> f64 {
        let axis = |k: usize, share: f64| from[k] + share * (to[k] - from[k]);
        let ends = [(from, p), (to, q)].map(|(axes, spot)| {
            let stage = self.table(axes[3], axes[4], P3Mm::new([axes[0], axes[1], axes[2]]));
            let mark = self.table(axes[3], axes[4], turned(axes[3], axes[4], spot));
            [mark[0], mark[1], stage[2]]
        });
        let mut worst = 0.0f64;
        for share in [0.25, 0.5, 0.75] {
            let (a, c) = (axis(3, share), axis(4, share));
            let meant = self.table(a, c, turned(a, c, p.lerp(q, share)));
            let reached = [0, 1].map(|k| ends[0][k] + share * (ends[1][k] - ends[0][k]));
            let off = math::hypot(reached[0] - meant[0], reached[1] - meant[1]);
            // At a quarter of its length an even bow has three quarters of its height.
            worst = worst.max(if share == 0.5 { off } else { off / 0.75 });
        }
        worst * NM_PER_MM
    }
}
