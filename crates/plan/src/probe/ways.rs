//! The shape of the probe and its head, and the moves that keep them off the part.
//!
//! Everything is upright cylinders that reach up without end: the tip, the body of the probe, the lens. Each is taken
//! wider and lower by how far the part may lie from where the job says, so that it keeps clear wherever within that it
//! lies. The tip touches on the way down alone. Between points the stage rises just as far as it has to.

use super::place::Place;
use super::plan::{Move, Tool};
use crate::plan::Inputs;
use terrace_core::clearance::{Facets, Intrusion, Way};
use terrace_core::diag::{Diag, Error};
use terrace_core::geom::{NM_PER_MM, Nm, SpacePoint, Turn};
use terrace_core::machine::{Commanded, Machine, Origin};
use terrace_core::program::SetupId;

/// An upright cylinder that reaches up without end, from the centre of the tip, nm.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Cylinder {
    axis: [f64; 2],
    radius: f64,
    /// Its lower end.
    lower: f64,
}

/// What could touch the part.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Shape {
    /// The tip; None of a sensor.
    tip: Option<Cylinder>,
    body: Option<Cylinder>,
    head: Cylinder,
    /// Radius of the tip, and how far the part may lie from where the job says, nm.
    radius: f64,
    search: f64,
    /// The centre of the tip, or the point that a sensor sees, from the focus, nm.
    offset: SpacePoint,
}

impl Shape {
    /// The shape of what measures on a machine; the part may lie `search_mm` from where the job says.
    pub(super) fn new(machine: &Machine, tool: &Tool, search_mm: f64) -> Self {
        let search = search_mm * NM_PER_MM;
        let nm = |length: terrace_core::units::Length| length.as_mm() * NM_PER_MM;
        let grown =
            |axis: [f64; 2], radius: f64, lower: f64| Cylinder { axis, radius: radius + search, lower: lower - search };
        let offset = match tool {
            Tool::Touch(probe) => probe.offset_nm(),
            Tool::Sensor(_) => [0.0; 3],
        };
        let gap = nm(machine.lens.working_distance) - nm(machine.stage.clearance);
        let head = grown([-offset[0], -offset[1]], nm(machine.lens.diameter) / 2.0, gap - offset[2]);
        let (tip, body, radius) = match tool {
            Tool::Touch(probe) => {
                let radius = nm(probe.radius);
                let tip = grown([0.0; 2], radius, -radius);
                (Some(tip), Some(grown([0.0; 2], nm(probe.body) / 2.0, nm(probe.stylus))), radius)
            }
            Tool::Sensor(_) => (None, None, 0.0),
        };
        Self { tip, body, head, radius, search, offset }
    }
}

/// By how much facets enter some cylinders on the way of the tip, nm.
fn entered(facets: &Facets, cylinders: &[Option<Cylinder>], ends: [SpacePoint; 2]) -> f64 {
    let of = |cylinder: &Cylinder| {
        let ends = ends.map(|[x, y, z]| [x + cylinder.axis[0], y + cylinder.axis[1], z + cylinder.lower]);
        let way = Way { turn: Turn::none(), ends, radius: cylinder.radius };
        facets.entered(&way).map_or(0.0, |Intrusion { by, .. }| by)
    };
    cylinders.iter().flatten().map(of).fold(0.0, f64::max)
}

/// Ways side by side over the travel are no wider, nm: they reach half of that beyond it.
const WIDEST_WAY: f64 = 10.0 * NM_PER_MM;

/// Finds the ways of a probe over a part and between its fixtures.
pub(super) struct Ways<'a> {
    /// Of the part and the fixtures.
    facets: Facets,
    /// Of the fixtures, which nothing touches.
    fixtures: Facets,
    machine: &'a Machine,
    origin: Origin,
    shape: Shape,
}

impl<'a> Ways<'a> {
    /// Over the part of a job as designed, in its first set-up.
    pub(super) fn new(inputs: &'a Inputs, origin: Origin, shape: Shape) -> Self {
        let first = inputs.fixtures.iter().filter(|fixture| fixture.is_in(SetupId(0)));
        let of_fixtures = |sink: &mut dyn FnMut([SpacePoint; 3])| {
            first.clone().flat_map(|fixture| &fixture.facets).for_each(|facet| sink(*facet));
        };
        let of_all = |sink: &mut dyn FnMut([SpacePoint; 3])| {
            inputs.surface.each_facet(sink);
            of_fixtures(sink);
        };
        let [facets, fixtures] =
            [Facets::above(f64::NEG_INFINITY, &of_all), Facets::above(f64::NEG_INFINITY, &of_fixtures)];
        Self { facets, fixtures, machine: &inputs.machine, origin, shape }
    }

    /// How far from a place its surroundings have to be even, nm: as near as the tip touches, and as far as it may touch.
    pub(super) fn around(&self) -> [f64; 2] {
        let near = self.shape.radius.max(0.5 * NM_PER_MM);
        [near, near + self.shape.search]
    }

    /// The centre of the tip as it touches a place that is as steep as this.
    fn tip_at(&self, [x, y, z]: SpacePoint, slope: [f64; 2]) -> SpacePoint {
        // A tip that comes down over a slope touches beside the place.
        [x, y, z + self.shape.radius * (1.0 + slope[0] * slope[0] + slope[1] * slope[1]).sqrt()]
    }

    /// Where the axes stand with the tip's centre at a point of the part.
    fn commanded(&self, tip: SpacePoint) -> Commanded {
        let step = self.machine.increment_nm().0;
        let mut out = Commanded::default();
        for (k, (_, axis)) in self.machine.axes().into_iter().enumerate() {
            let at = (tip[k] - self.shape.offset[k]) / step as f64;
            // z up, towards the lens.
            let steps = if k == 2 { at.ceil() } else { at.round() };
            out[k] = axis.sign() * (steps as i64 * step + self.origin[k]);
        }
        out
    }

    /// The centre of the tip in the part frame, the axes commanded so.
    fn tip_of(&self, at: Commanded) -> SpacePoint {
        let axes = self.machine.axes();
        [0, 1, 2].map(|k| (axes[k].1.sign() * at[k] - self.origin[k]) as f64 + self.shape.offset[k])
    }

    /// Where the axes stand as a place is touched.
    pub(super) fn touching(&self, at: SpacePoint, slope: [f64; 2]) -> Commanded {
        self.commanded(self.tip_at(at, slope))
    }

    /// What of the part or a fixture enters some cylinders on the way of the tip.
    fn entered(&self, cylinders: &[Option<Cylinder>], ends: [SpacePoint; 2]) -> f64 {
        entered(&self.facets, cylinders, ends)
    }

    /// Whether body and head keep off the table with the tip at a point of the part.
    fn is_over_table(&self, tip: SpacePoint) -> bool {
        let over = |cylinder: &Cylinder| {
            let end = Nm::floor(tip[2] + cylinder.lower + self.shape.search) + Nm(self.origin[2]);
            self.machine.table().is_none_or(|table| end >= table)
        };
        [self.shape.body, Some(self.shape.head)].iter().flatten().all(over)
    }

    /// By how much the part or a fixture stands higher than probe and head with z at its end, wherever x and y are before
    /// the program begins: under ways along the travel of x that lie side by side.
    fn entered_from_anywhere(&self, top: i64) -> f64 {
        let [x, y, _] = self.machine.axes().map(|(_, axis)| axis.travel_nm().map(|end| end.0));
        let at = |x: i64, y: i64| self.tip_of(Commanded([x, y, top]));
        let [a, b] = [at(x[0], y[0]), at(x[1], y[1])];
        let ways = ((b[1] - a[1]).abs() / WIDEST_WAY).ceil().max(1.0);
        let step = (b[1] - a[1]) / ways;
        let wide = |cylinder: Cylinder| Cylinder { radius: cylinder.radius + step.abs() / 2.0, ..cylinder };
        let all = [self.shape.tip, self.shape.body, Some(self.shape.head)].map(|cylinder| cylinder.map(wide));
        let of_way = |i: i32| {
            let y = a[1] + (f64::from(i) + 0.5) * step;
            self.entered(&all, [[a[0], y, a[2]], [b[0], y, b[2]]])
        };
        (0..ways as i32).map(of_way).fold(0.0, f64::max)
    }

    /// From where the tip goes down to a place: nothing touches there yet.
    fn above(&self, place: &Place) -> Commanded {
        let all = [self.shape.tip, self.shape.body, Some(self.shape.head)];
        let [x, y, z] = self.tip_of(place.stage);
        let low = [x, y, z];
        self.commanded([x, y, z + self.entered(&all, [low; 2])])
    }

    /// To where the tip goes down.
    fn below(&self, place: &Place) -> Commanded {
        let [x, y, z] = self.tip_of(place.stage);
        self.commanded([x, y, z - self.shape.search])
    }

    fn is_in_travel(&self, at: Commanded) -> bool {
        let axes = self.machine.axes().into_iter().enumerate();
        axes.into_iter().all(|(k, (_, axis))| (axis.travel_nm()[0].0..=axis.travel_nm()[1].0).contains(&at[k]))
    }

    /// Whether the axes get there, body and head keep off the part and the table as low as the tip goes, and no fixture
    /// is under the tip.
    pub(super) fn reaches(&self, place: &Place) -> bool {
        if self.shape.tip.is_none() {
            let low = self.tip_of(place.stage);
            let is_clear = self.entered(&[Some(self.shape.head)], [low; 2]) <= 0.0 && self.is_over_table(low);
            return self.is_in_travel(place.stage) && is_clear;
        }
        let below = self.below(place);
        let low = self.tip_of(below);
        self.is_in_travel(self.above(place))
            && self.is_in_travel(below)
            && self.entered(&[self.shape.body, Some(self.shape.head)], [low; 2]) <= 0.0
            && entered(&self.fixtures, &[self.shape.tip], [low; 2]) <= 0.0
            && self.is_over_table(low)
    }

    /// The moves to all places in their order, from and to the end of travel.
    ///
    /// # Errors
    /// `probe-reach` where the stage cannot rise far enough between two of them.
    pub(super) fn moves(&self, places: &[&Place]) -> Result<Vec<Move>, Error> {
        let Nm(top) = self.machine.retract_z();
        let sign = self.machine.stage.z.sign();
        let all = [self.shape.tip, self.shape.body, Some(self.shape.head)];
        let at_z = |at: Commanded, z: i64| Commanded([at[0], at[1], z]);
        let mut moves = Vec::new();
        let mut before: Option<Commanded> = None;
        if self.entered_from_anywhere(top) > 0.0 {
            let text = "the stage cannot rise far enough for the first move: from some places of its travel the probe or \
                        the head would meet the part or a fixture";
            let hint = "give the z axis more travel upwards, a shorter stylus, a smaller --search, or a lower fixture";
            return Err(Diag::limit("probe-reach", text).hint(hint).into());
        }
        for place in places {
            let [above, below] = [self.above(place), self.below(place)];
            let level = match before {
                None => top,
                Some(from) => {
                    // The higher one of both, then as much as the way between them needs.
                    let z = if sign * from[2] > sign * above[2] { from[2] } else { above[2] };
                    let ends = [self.tip_of(at_z(from, z)), self.tip_of(at_z(above, z))];
                    let [x, y, tip] = ends[0];
                    self.commanded([x, y, tip + self.entered(&all, ends)])[2]
                }
            };
            if sign * level > sign * top {
                let hint = "give the z axis more travel upwards, a shorter stylus, or a smaller --search";
                let text = "the stage cannot rise far enough to keep the probe off the part between two points";
                return Err(Diag::limit("probe-reach", text).hint(hint).into());
            }
            if let Some(from) = before {
                moves.push(Move::Rapid(at_z(from, level)));
            }
            moves.extend([Move::Rapid(at_z(above, level)), Move::Rapid(above), Move::Touch(below)]);
            // Back to where nothing touches.
            moves.push(Move::Rapid(above));
            before = Some(above);
        }
        if let Some(from) = before {
            moves.push(Move::Rapid(at_z(from, top)));
        }
        moves.dedup();
        Ok(moves)
    }
}
