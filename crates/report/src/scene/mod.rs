//! What the pictures of a job are made of, the same for stepped and on-the-fly jobs: every mark where it lies on the
//! part, what is not marked and why, and how the part looks from the lens.
//!
//! Consumes a plan. Promises lines within [`Thinned::within_um`] of the marks: a line of the program is straight in the
//! plane of the lens, on the part it is bent where the surface bends. Equal input gives equal values, whatever the
//! threads.
//!
//! Marks lie in groups: a block of a stepped job, or a run of marks on the fly. Points of a group are integers of nm in
//! a frame of its own. In that of a block x and y are those of the field and z is the height over the focal plane along
//! the beam, so z is the defocus. Everything else is in the part frame as it is placed, mm.

mod beam;
mod histogram;
mod on_the_fly;
mod relief;
mod stepped;
mod thin;
mod unmarked;

pub use histogram::Histogram;
pub use on_the_fly::{Motion, MotionSample, of_on_the_fly};
pub use relief::Relief;
pub use stepped::of_stepped;
pub(crate) use stepped::turn_at;
pub use unmarked::{Reason, Unmarked, UnmarkedLine, UnmarkedRow};

use std::ops::Range;

use terrace_core::geom::{NM_PER_MM, P3, Turn, Turned};
use terrace_core::program::PenId;

/// All that is drawn of a job besides its surface.
#[derive(Clone, Debug, Default)]
pub struct Scene {
    /// The groups in machining order: the blocks of a stepped job.
    pub groups: Vec<Group>,
    /// The texture that is not marked, in the first pass.
    pub unmarked: Unmarked,
    /// How lines were made simpler.
    pub thinned: Thinned,
    /// How stage and scanner move on the fly.
    pub motion: Option<Motion>,
}

/// Marks that share a frame. Each group has lists of its own: they fit the gaps that planning leaves in memory, where
/// one list of all points would not.
#[derive(Clone, Debug)]
pub struct Group {
    /// From its frame to the part frame.
    pub frame: Frame,
    /// The marks of the group in marking order.
    pub marks: Vec<Mark>,
    /// The points of the marks, mark by mark.
    pub points: Vec<Point>,
    /// When the beam is at each point, microseconds from the program's start; empty for stepped jobs.
    pub times_us: Vec<i64>,
    /// When the stage begins to move here, when the first mark begins, when the last one ends, s.
    pub clock_s: [f64; 3],
}

/// One line or dot.
#[derive(Clone, Copy, Debug)]
pub struct Mark {
    /// Index of its pen in the program.
    pub pen: PenId,
    /// Length in the field, once, mm; 0 of a dot.
    pub length_mm: f64,
    /// First point in [`Group::points`].
    pub first: u32,
    /// How many points; 1 of a dot.
    pub len: u32,
}

/// A point of a mark.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Point {
    /// In the frame of its group, nm.
    pub at: [i32; 3],
    /// Height of the part over the focal plane along the beam, um.
    pub defocus_um: f32,
    /// Angle between the beam and the surface's normal, deg.
    pub incidence_deg: f32,
}

/// How lines were made simpler.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Thinned {
    /// No mark lies farther from its line, um.
    pub within_um: f64,
    /// Points of the program that are left out.
    pub points: usize,
}

/// The frame of a group.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// Where its origin lies in the part, mm.
    pub origin: [f64; 3],
    /// The directions of its axes in the part: columns x, y, z.
    pub axes: [[f64; 3]; 3],
}

impl Frame {
    /// Axes as those of the part.
    pub fn upright(origin: [f64; 3]) -> Self {
        Self { origin, axes: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]] }
    }

    /// The frame of a field whose centre lies at `centre`, nm, of a part that is turned.
    fn turned(turn: &Turn, centre: [f64; 3]) -> Self {
        let back = |p: [f64; 3]| turn.back(P3::<Turned>::new(p)).at;
        let origin = back(centre);
        let axes = [0, 1, 2].map(|k| {
            // A metre away, so that rounding is far below that of a point.
            let mut p = centre;
            p[k] += 1e9;
            let q = back(p);
            [0, 1, 2].map(|i| (q[i] - origin[i]) / 1e9)
        });
        Self { origin: origin.map(|v| v / NM_PER_MM), axes }
    }

    /// Whether its axes are those of the part.
    pub fn is_upright(&self) -> bool {
        self.axes == Self::upright(self.origin).axes
    }

    /// A point of the frame in the part, mm.
    pub(crate) fn part_from_group(&self, at: [i32; 3]) -> [f64; 3] {
        let p = at.map(|v| f64::from(v) / NM_PER_MM);
        [0, 1, 2].map(|i| self.origin[i] + (0..3).map(|k| self.axes[k][i] * p[k]).sum::<f64>())
    }

    /// x and y of a point of the frame in the part, mm.
    pub(crate) fn seen_along_z(&self, at: [i32; 3]) -> [f64; 2] {
        let p = at.map(|v| f64::from(v) / NM_PER_MM);
        [0, 1].map(|i| self.origin[i] + (0..3).map(|k| self.axes[k][i] * p[k]).sum::<f64>())
    }
}

impl Scene {
    /// How many marks there are.
    pub(crate) fn mark_count(&self) -> usize {
        self.groups.iter().map(|g| g.marks.len()).sum()
    }

    /// All points, group by group.
    pub fn points(&self) -> impl Iterator<Item = &Point> + Clone {
        self.groups.iter().flat_map(|g| &g.points)
    }
}

impl Group {
    /// Without marks yet.
    pub fn new(frame: Frame) -> Self {
        Self { frame, marks: Vec::new(), points: Vec::new(), times_us: Vec::new(), clock_s: [0.0; 3] }
    }

    /// The points of a mark.
    pub fn points_of(&self, mark: &Mark) -> &[Point] {
        &self.points[mark.points()]
    }
}

impl Mark {
    /// The points of the mark, as a range of [`Group::points`].
    pub fn points(&self) -> Range<usize> {
        self.first as usize..(self.first + self.len) as usize
    }
}
