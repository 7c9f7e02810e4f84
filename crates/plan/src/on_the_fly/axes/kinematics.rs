//! Seven axes: a stage of X, Y, Z that carries a swivel A and a turntable C, under a scanner of U and V.
//!
//! Consumes points and normals of the part; promises axis values, and the part point and beam that axis values
//! stand for. Units: mm, rad. Part coordinates turn by -C about z, then by A about x, and lie then in the frame
//! of the machine, whose z is the beam's axis:
//!
//! Q = Rx(A) Rz(-C) p
//!
//! The stage stands at X, Y, Z = Q of the tool point, whose normal that turn brings upright; a mark at P is
//! then seen at U, V and off the focal plane by what Q of P differs from X, Y, Z.
//!
//! # Sources
//! Ma et al. (2025), eq. 11 to 13, whose signs were lost in print. The angles are printed there as A = arccos k and
//! C = arctan of i and j: with A ≥ 0 that turns every normal with j < 0 to the wrong side, by twice its tilt. Here
//! C = atan2(-i, j).
//!
//! # Limits
//! Signs are consistent in themselves; a machine may count A or C the other way. Beams are vertical over the
//! field (telecentric lens).

use std::f64::consts::{PI, TAU};
use std::marker::PhantomData;
use terrace_core::math;

use terrace_core::geom::{P3Mm, UnitVector};

/// The frame of the part with its origin moved to the pivot, the point about which A and C turn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pivot;

/// A frame of the part as A and C have turned it about its origin; z is the beam's axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TurnedAbout<F>(PhantomData<F>);

/// A point of the part and a direction there: a mark with its normal, or a tool point with its axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose<F> {
    /// Point.
    pub p: P3Mm<F>,
    /// Out of the part.
    pub n: UnitVector,
}

impl<F> Pose<F> {
    /// On a surface given as z, ∂z/∂x and ∂z/∂y of x and y.
    pub fn on_surface([x, y]: [f64; 2], surface: impl Fn(f64, f64) -> (f64, f64, f64)) -> Self {
        let (z, zx, zy) = surface(x, y);
        let norm = (1.0 + zx * zx + zy * zy).sqrt();
        Self { p: P3Mm::new([x, y, z]), n: UnitVector([-zx / norm, -zy / norm, 1.0 / norm]) }
    }
}

/// Stage axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Axes {
    /// X, Y, Z.
    pub xyz: P3Mm<TurnedAbout<Pivot>>,
    /// Swivel.
    pub a: f64,
    /// Turntable.
    pub c: f64,
}

/// Which of the two turns that bring a normal upright.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Branch {
    /// A ≥ 0.
    Positive,
    /// A ≤ 0.
    Negative,
}

/// A normal nearer to the axis of C than this has no C of its own. Rounding of a unit vector is 1e-16; from
/// here on it turns C by less than 1e-4.
const UPRIGHT: f64 = 1e-12;

/// The A and C of a branch that turn a normal upright; C is `held` where the normal is upright without it.
pub(crate) fn turn_for(n: UnitVector, branch: Branch, held: f64) -> (f64, f64) {
    let UnitVector([i, j, k]) = n;
    let tilt = math::hypot(i, j);
    // acos k, without its loss of digits near k = 1.
    let a = math::atan2(tilt, k);
    if tilt < UPRIGHT {
        return (if branch == Branch::Positive { a } else { -a }, held);
    }
    // C turns the normal until it leans to +y, from where a positive A turns it up, or to -y for a negative A.
    match branch {
        Branch::Positive => (a, math::atan2(-i, j)),
        Branch::Negative => (-a, math::atan2(i, -j)),
    }
}

/// A point of the part as A and C turn it about the origin of its frame.
pub(crate) fn turned<F>(a: f64, c: f64, p: P3Mm<F>) -> P3Mm<TurnedAbout<F>> {
    P3Mm::new(turned_vector(a, c, p.mm))
}

/// The inverse of [`turned`].
pub(crate) fn turned_back<F>(a: f64, c: f64, q: P3Mm<TurnedAbout<F>>) -> P3Mm<F> {
    P3Mm::new(vector_turned_back(a, c, q.mm))
}

/// The direction in the part that A and C turn upright: that against the beam.
pub(crate) fn beam_axis(a: f64, c: f64) -> UnitVector {
    UnitVector(vector_turned_back(a, c, [0.0, 0.0, 1.0]))
}

/// Rx(A) Rz(-C) applied to a vector.
pub(crate) fn turned_vector(a: f64, c: f64, [x, y, z]: [f64; 3]) -> [f64; 3] {
    let ((sa, ca), (sc, cc)) = (math::sin_cos(a), math::sin_cos(c));
    let (right, back) = (x * cc + y * sc, y * cc - x * sc);
    [right, back * ca - z * sa, back * sa + z * ca]
}

/// The inverse of [`turned_vector`].
fn vector_turned_back(a: f64, c: f64, [x, y, z]: [f64; 3]) -> [f64; 3] {
    let ((sa, ca), (sc, cc)) = (math::sin_cos(a), math::sin_cos(c));
    let (back, up) = (y * ca + z * sa, z * ca - y * sa);
    [x * cc - back * sc, x * sc + back * cc, up]
}

/// A point as the scanner sees it: U, V and the height over the focal plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FieldPosition {
    /// U and V, mm.
    pub uv: [f64; 2],
    /// Above the focal plane, mm.
    pub height: f64,
}

impl Axes {
    /// The axes with the tool at a pose; C is `held` where the tool's axis is upright.
    pub fn at(tool: &Pose<Pivot>, branch: Branch, held: f64) -> Self {
        let (a, c) = turn_for(tool.n, branch, held);
        Self { xyz: turned(a, c, tool.p), a, c }
    }

    /// The tool's point and axis.
    pub fn tool(&self) -> Pose<Pivot> {
        Pose { p: turned_back(self.a, self.c, self.xyz), n: beam_axis(self.a, self.c) }
    }

    /// How the scanner sees a point of the part.
    pub fn seen(&self, p: P3Mm<Pivot>) -> FieldPosition {
        let [u, v, height] = turned(self.a, self.c, p).way_from(self.xyz);
        FieldPosition { uv: [u, v], height }
    }

    /// Where the beam of U, V meets the focal plane, and the direction back along it.
    pub fn spot(&self, u: f64, v: f64) -> Pose<Pivot> {
        let q = self.xyz.moved([u, v, 0.0]);
        Pose { p: turned_back(self.a, self.c, q), n: beam_axis(self.a, self.c) }
    }
}

/// How far a mark lies from what its tool would like best.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Deviation {
    /// Out of focus along the beam (FOD), mm, without sign.
    pub defocus: f64,
    /// Angle of the beam to the normal (BIA), rad.
    pub angle: f64,
    /// Across the beam, mm.
    pub lateral: f64,
}

impl Deviation {
    /// The deviation of a mark from a tool.
    pub fn of<F: Copy>(mark: &Pose<F>, tool: &Pose<F>) -> Self {
        let d = mark.p.way_from(tool.p);
        let (UnitVector(m), UnitVector(t)) = (mark.n, tool.n);
        let along = dot(d, t);
        let across = [0, 1, 2].map(|i| d[i] - along * t[i]);
        let cross = [m[1] * t[2] - m[2] * t[1], m[2] * t[0] - m[0] * t[2], m[0] * t[1] - m[1] * t[0]];
        Self { defocus: along.abs(), angle: math::atan2(norm(cross), dot(m, t)), lateral: norm(across) }
    }

    /// Each part the larger of two.
    pub fn max(self, other: Self) -> Self {
        Self {
            defocus: self.defocus.max(other.defocus),
            angle: self.angle.max(other.angle),
            lateral: self.lateral.max(other.lateral),
        }
    }

    /// Largest of each part over a path.
    pub fn worst<F: Copy>(marks: &[Pose<F>], tools: impl IntoIterator<Item = Pose<F>>) -> Self {
        marks.iter().zip(tools).fold(Self::default(), |worst, (mark, tool)| worst.max(Self::of(mark, &tool)))
    }
}

/// Which branches a path may take.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Branches {
    /// One all along.
    Only(Branch),
    /// Both, changing where that makes the time of the slower of A and C least, at these speeds, rad/s.
    Quickest {
        /// Largest speed of A.
        a: f64,
        /// Largest speed of C.
        c: f64,
    },
}

/// Axes along a path of tools. C continues by the nearest turn and rests where the tool is upright; before the
/// first tool that leans it stands as that one needs it.
pub fn follow(tools: &[Pose<Pivot>], branches: Branches) -> Vec<Axes> {
    let taken: Vec<Branch> = match branches {
        Branches::Only(branch) => vec![branch; tools.len()],
        Branches::Quickest { a, c } => quickest(tools, a, c),
    };
    let mut held = match (tools.iter().find(|tool| leans(tool.n)), taken.first()) {
        (Some(first), Some(&branch)) => turn_for(first.n, branch, 0.0).1,
        _ => 0.0,
    };
    let mut out = Vec::with_capacity(tools.len());
    for (tool, &branch) in tools.iter().zip(&taken) {
        let (a, c) = turn_for(tool.n, branch, held);
        held += nearest_turn(c - held);
        out.push(Axes { xyz: turned(a, held, tool.p), a, c: held });
    }
    out
}

/// Whether a direction has a C of its own.
fn leans(UnitVector([x, y, _]): UnitVector) -> bool {
    math::hypot(x, y) >= UPRIGHT
}

/// An angle less the whole turns that bring it nearest to 0.
fn nearest_turn(angle: f64) -> f64 {
    angle - TAU * (angle / TAU).round()
}

/// The quickest way to one branch of a tool.
#[derive(Clone, Copy)]
struct BranchState {
    a: f64,
    c: f64,
    /// Summed times of the slower axis, s.
    time: f64,
    /// The branch of the tool before.
    from: u8,
}

/// Branch of every tool, by dynamic programming over the two of them: a path through both kinds of states whose
/// summed times of the slower axis are least.
fn quickest(tools: &[Pose<Pivot>], speed_a: f64, speed_c: f64) -> Vec<Branch> {
    const BOTH: [Branch; 2] = [Branch::Positive, Branch::Negative];
    let Some(first) = tools.iter().find(|tool| leans(tool.n)) else {
        return vec![Branch::Positive; tools.len()];
    };
    // Invariant: for either branch of the last tool the quickest way there, with its A and C and its time.
    let mut states = BOTH.map(|b| BranchState { a: 0.0, c: turn_for(first.n, b, 0.0).1, time: 0.0, from: 0 });
    // From which branch each state came, per tool.
    let mut from: Vec<[u8; 2]> = Vec::with_capacity(tools.len());
    for (i, tool) in tools.iter().enumerate() {
        let mut next = states.map(|state| BranchState { time: f64::INFINITY, from: 0, ..state });
        for (to, branch) in BOTH.into_iter().enumerate() {
            // What does not change is looked at first, so that it wins a tie.
            for s in [to, 1 - to] {
                let state = states[s];
                let (a, c) = turn_for(tool.n, branch, state.c);
                let step = ((a - state.a).abs() / speed_a).max(nearest_turn(c - state.c).abs() / speed_c);
                // To the first tool the axes need not go.
                let time = state.time + if i == 0 { 0.0 } else { step };
                if time < next[to].time {
                    next[to] = BranchState { a, c, time, from: s as u8 };
                }
            }
        }
        states = next;
        from.push(states.map(|state| state.from));
    }
    // Where neither is quicker but for rounding, A ≥ 0.
    const ROUNDING: f64 = 1e-9;
    let mut state = usize::from(states[1].time < states[0].time * (1.0 - ROUNDING));
    let mut out = vec![Branch::Positive; tools.len()];
    for i in (0..tools.len()).rev() {
        out[i] = BOTH[state];
        if i > 0 {
            state = usize::from(from[i][state]);
        }
    }
    out
}

/// The same angle as C, or that of the other branch, half a turn on, whichever is nearest to `near`.
pub(crate) fn nearest_half_turn(c: f64, near: f64) -> f64 {
    c + PI * ((near - c) / PI).round()
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn norm(a: [f64; 3]) -> f64 {
    dot(a, a).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::on_the_fly::decompose::sample;
    use terrace_core::random::Random;

    #[test]
    fn inverse_kinematics_round_trips_on_both_branches() {
        let mut random = Random::new(1);
        let mut next = || random.unit();
        for _ in 0..20_000 {
            let (tilt, round) = (1.5 * next(), TAU * next());
            let n =
                UnitVector([math::sin(tilt) * math::cos(round), math::sin(tilt) * math::sin(round), math::cos(tilt)]);
            let pose = Pose { p: P3Mm::new([0.0; 3].map(|_| 100.0 * next() - 50.0)), n };
            for (branch, sign) in [(Branch::Positive, 1.0), (Branch::Negative, -1.0)] {
                let axes = Axes::at(&pose, branch, 0.0);
                assert!(axes.a * sign >= 0.0);
                let upright = turned_vector(axes.a, axes.c, n.0);
                let back = axes.tool();
                for i in 0..3 {
                    assert!((upright[i] - [0.0, 0.0, 1.0][i]).abs() < 1e-9, "{upright:?}");
                    assert!((back.p[i] - pose.p[i]).abs() < 1e-9 && (back.n.0[i] - n.0[i]).abs() < 1e-9, "{back:?}");
                }
                let mark = P3Mm::new([0.0; 3].map(|_| 10.0 * next()));
                let FieldPosition { uv: [u, v], height: off } = axes.seen(mark);
                let spot = axes.spot(u, v);
                let hit = Deviation::of(&Pose { p: mark, n }, &pose);
                assert!((hit.defocus - off.abs()).abs() < 1e-9 && (hit.lateral - math::hypot(u, v)).abs() < 1e-9);
                for i in 0..3 {
                    assert!((spot.p[i] + off * n.0[i] - mark[i]).abs() < 1e-9);
                }
            }
        }
    }

    #[test]
    fn printed_arctan_formula_is_wrong_for_half_of_all_directions() {
        let mut random = Random::new(1);
        let mut next = || random.unit();
        let (mut wrong, count) = (0, 10_000);
        for _ in 0..count {
            let (tilt, round) = (0.4 * next(), TAU * next());
            let n = [math::sin(tilt) * math::cos(round), math::sin(tilt) * math::sin(round), math::cos(tilt)];
            let up = turned_vector(math::acos(n[2]), math::atan(-n[0] / n[1]), n);
            let off = math::acos(up[2].clamp(-1.0, 1.0));
            if off > 1e-6 {
                wrong += 1;
                assert!((off - 2.0 * tilt).abs() < 1e-6 && n[1] < 0.0);
            }
        }
        assert!((wrong - count / 2i32).abs() < count / 20, "{wrong}");
    }

    #[test]
    fn c_is_constant_at_the_pole_and_unwrapped_elsewhere() {
        // Round the pole three times, then straight across it.
        let up = |x: f64, y: f64| UnitVector([x, y, (1.0 - x * x - y * y).sqrt()]);
        let lean = |x: f64, y: f64| Pose { p: P3Mm::new([x, y, 0.0]), n: up(x, y) };
        let round: Vec<Pose<Pivot>> = (0..=300)
            .map(|i| TAU * f64::from(i) / 100.0)
            .map(|w| lean(0.3 * math::cos(w), 0.3 * math::sin(w)))
            .chain((1..=60).map(|i| lean(0.3 - 0.01 * f64::from(i), 0.0)))
            .collect();
        let axes = follow(&round, Branches::Only(Branch::Positive));
        assert!((axes[300].c - axes[0].c - 3.0 * TAU).abs() < 1e-9);
        assert_eq!(axes[330].c, axes[329].c, "upright");
        assert!(axes.windows(2).all(|w| (w[1].c - w[0].c).abs() <= PI + 1e-9));
        // With both branches A runs through 0 and C rests.
        let both = follow(&round, Branches::Quickest { a: 1.0, c: 1.0 });
        assert!((both[360].c - both[300].c).abs() < 1e-9 && both[300].a * both[360].a < 0.0);
        assert!(both.iter().zip(&round).all(|(a, t)| Deviation::of(t, &a.tool()).angle < 1e-9));
    }

    #[test]
    fn kinematics_match_the_reference_points_of_the_seven_axis_part() {
        let part = sample::Part::stored();
        let samples = part.json["samples"].as_array().expect("samples");
        assert_eq!(samples.len(), 10);
        let plan = part.hilbert();
        let sigma = part.json["sigma_points"].as_f64().expect("sigma");
        let smooth =
            crate::on_the_fly::decompose::stage(&plan, crate::on_the_fly::decompose::Method::Gaussian { sigma });
        let near = |a: f64, b: &serde_json::Value| (a - b.as_f64().expect("number")).abs() < 1e-9;
        for s in samples {
            let i = s["i"].as_u64().expect("index") as usize;
            let (mark, tool) = (part.pose(plan[i]), part.pose(smooth[i]));
            let axes = Axes::at(&tool, Branch::Positive, 0.0);
            for k in 0..3 {
                assert!(near(mark.p[k], &s["P"][k]) && near(mark.n.0[k], &s["n"][k]), "{i}");
                assert!(near(tool.p[k], &s["Pf"][k]) && near(tool.n.0[k], &s["nf"][k]), "{i}");
                assert!(near(axes.xyz[k], &s["XYZ"][k]), "{i}");
            }
            assert!(near(axes.a, &s["A"]) && near(axes.c, &s["C_wrapped"]), "{i}");
            let FieldPosition { uv: [u, v], height: off } = axes.seen(mark.p);
            assert!(near(u, &s["U"]) && near(v, &s["V"]) && near(off, &s["FOD"]), "{i}");
            let hit = Deviation::of(&mark, &tool);
            assert!(near(hit.angle.to_degrees(), &s["BIA_deg"]), "{i}");
        }
    }
}
