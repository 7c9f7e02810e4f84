//! Figures of a plan that no user is likely to have meant: more days than a job takes, the same places marked over and
//! over, the same lines twice.
//!
//! All are warnings: such a plan may be run. Lengths are sums of whole nanometres, so threads change nothing.

use super::doubled;
use super::off_part::length;
use terrace_core::diag::{Diag, Error};
use terrace_core::geom::{BoxMm, Nm};
use terrace_core::machine::Machine;
use terrace_core::parallel;
use terrace_core::program::Stroke;
use terrace_input::job::Job;
use terrace_input::texture::{Slip, Texture};

/// Most days of a job. Large moulds take weeks, around the clock; a month is beyond what runs without service, and most
/// often a slip in pitch, speed or scale.
const MOST_DAYS: f64 = 30.0;

/// Least width of a part in plan, in spots: at 0.04 mm it is 2 mm.
const LEAST_SPOTS: f64 = 50.0;

/// Largest side of a part, in travels of the axis along it: what is larger does not lie on the machine.
const MOST_TRAVELS: f64 = 10.0;

/// How often every place in the box of a texture may be marked, on the average. A hatch marks it twice at the usual
/// pitch, four times at the least one, eight times crossed: this is what ten such hatches on each other come to, and a
/// drawing that was made too small.
const MOST_TIMES: f64 = 100.0;

/// The marks of a texture in the first pass, each stroke counted once whatever the passes of its pen.
#[derive(Clone, Copy, Debug, Default)]
struct TextureMarks {
    length: Nm,
    dots: u64,
    /// Area of the box of its strokes that lies over the part's, each grown by half a spot, mm2.
    area: f64,
}

impl TextureMarks {
    /// What its marks cover, mm2, places that are marked twice counted twice.
    fn covered(&self, spot: f64) -> f64 {
        self.length.mm() * spot + self.dots as f64 * std::f64::consts::PI / 4.0 * spot * spot
    }
}

/// Hands on the strokes of a group, each with its length, mm.
type StrokesOf<'a> = dyn Fn(usize, &mut dyn FnMut(&Stroke, f64)) + Sync + 'a;

/// The figures of each texture, in the order of the job.
#[derive(Clone, Debug, Default)]
pub(super) struct Shares {
    marks: Vec<TextureMarks>,
    /// What is marked twice or without power.
    doubled: Vec<Diag>,
}

impl Shares {
    /// The figures of the strokes of the first pass, which `strokes_of` hands on in so many groups; `part` is the box
    /// of the part as it is turned, mm.
    pub(super) fn new(
        job: &Job,
        texture: &Texture,
        groups: usize,
        strokes_of: &StrokesOf<'_>,
        part: BoxMm<2>,
        machine: &Machine,
    ) -> Self {
        let spot = machine.lens.spot.as_mm();
        let mut marks = Self::sums(job, texture, groups, strokes_of);
        for (k, marks) in marks.iter_mut().enumerate() {
            let bounds = texture.bounds_of(k);
            let (lo, hi) = (bounds.lo.mm(), bounds.hi.mm());
            let side = |axis: usize| hi[axis].min(part.hi[axis]) - lo[axis].max(part.lo[axis]);
            marks.area = (0..2).map(|axis| side(axis).max(0.0) + spot).product();
        }
        let mut doubled = doubled::warnings(job, texture);
        doubled.extend(doubled::without_power(job, texture, machine));
        Self { marks, doubled }
    }

    /// Length and dots of every texture, without its area.
    fn sums(job: &Job, texture: &Texture, groups: usize, strokes_of: &StrokesOf<'_>) -> Vec<TextureMarks> {
        // Strokes are numbered texture by texture.
        let ends: Vec<usize> = (0..job.textures.len()).map(|k| texture.strokes_of(k).end).collect();
        parallel::fold(
            groups,
            || vec![TextureMarks::default(); ends.len()],
            |sums, i| {
                strokes_of(i, &mut |stroke, length_mm| {
                    let marks = &mut sums[ends.partition_point(|&end| end <= stroke.source.index())];
                    marks.dots += u64::from(stroke.is_dot());
                    marks.length += Nm::from_mm(length_mm).unwrap_or_default();
                });
            },
            |sums, others| {
                for (marks, other) in sums.iter_mut().zip(others) {
                    marks.length += other.length;
                    marks.dots += other.dots;
                }
            },
        )
    }

    /// The warning about a plan that takes so long.
    pub(super) fn warnings(&self, job: &Job, time_s: f64, machine: &Machine) -> Vec<Diag> {
        let odd = self.long(job, time_s).into_iter().chain(self.many(job, machine.lens.spot.as_mm()));
        odd.chain(self.doubled.iter().cloned()).collect()
    }

    /// A job that takes more days than any job does.
    fn long(&self, job: &Job, time_s: f64) -> Option<Diag> {
        let days = time_s / 86_400.0;
        if days <= MOST_DAYS {
            return None;
        }
        // Dots have no length: of a job of dots their number decides.
        let whole: Nm = self.marks.iter().fold(Nm(0), |sum, m| sum + m.length);
        let dots: u64 = self.marks.iter().map(|m| m.dots).sum();
        let share = |m: &TextureMarks| match whole {
            Nm(0) => m.dots as f64 / dots.max(1) as f64,
            whole => m.length.f64() / whole.f64(),
        };
        let (k, most) = (0..self.marks.len()).map(|k| (k, share(&self.marks[k]))).max_by(|a, b| a.1.total_cmp(&b.1))?;
        let TextureMarks { length: mark_length, dots, .. } = self.marks[k];
        let what = if whole == Nm(0) { format!("{dots} dots") } else { length(mark_length.mm()) };
        let text = format!(
            "the job takes {days:.0} days: most of it is texture {}, {what} ({:.0} %) of each pass",
            k + 1,
            100.0 * most
        );
        let place = job.place_of(&format!("texture.{k}"));
        Some(
            Diag::warning("job-long", text)
                .at(place)
                .hint("check its pitch or scale, the speed of its pen and the passes"),
        )
    }

    /// Textures that mark every place far more often than any texture does.
    fn many(&self, job: &Job, spot: f64) -> impl Iterator<Item = Diag> {
        (1..).zip(&self.marks).filter_map(move |(number, marked)| {
            let times = marked.covered(spot) / marked.area;
            (times > MOST_TIMES).then(|| {
                let what = match marked.length {
                    Nm(0) => format!("{} dots", marked.dots),
                    marked => length(marked.mm()),
                };
                let text = format!(
                    "texture {number} marks every place {times:.0} times on the average in a single pass: {what} under a spot \
                     of {spot} mm lie on {:.6} mm2",
                    marked.area
                );
                Diag::warning("marks-many", text)
                    .at(job.place_of(&format!("texture.{}", number - 1)))
                    .hint("check its scale and pitch, and whether the drawing holds the same lines many times")
            })
        })
    }
}

/// A part that is far too large or far too small for the machine; `size` are its sides along x, y and z, mm.
pub(super) fn odd_part(job: &Job, size: [f64; 3], machine: &Machine) -> Option<Diag> {
    let [x, y, z] = size;
    let text = format!("the part is {x:.3} x {y:.3} x {z:.3} mm");
    let travels = machine.axes().map(|(name, axis)| {
        let [lo, hi] = axis.travel_nm();
        (name, (hi - lo).mm())
    });
    let width = size[0].max(size[1]) / machine.lens.spot.as_mm();
    let size_of_part =
        if let Some((name, travel)) = (0..3).find(|&k| size[k] > MOST_TRAVELS * travels[k].1).map(|k| travels[k]) {
            format!("{text}, more than {MOST_TRAVELS} times the travel of {name}, {travel} mm")
        } else if width < LEAST_SPOTS {
            format!("{text}, in plan {width:.0} spots wide")
        } else {
            return None;
        };
    let hint = "check the unit of the file: surface.unit, or that of the CAD program";
    Some(Diag::warning("part-size", size_of_part).at(job.place_of("surface.file")).hint(hint))
}

/// An error in which the size of a drawing explains that nothing lies on the part.
pub(super) fn explained(e: &Error, texture: &Texture) -> Error {
    let Some((_, slip)) = texture.slips().next() else { return e.clone() };
    let with_cause = |d: &Diag| if d.code == "job-empty" { d.clone().hint(slip.cause()) } else { d.clone() };
    Error::many(e.diags().iter().map(with_cause).collect())
}

/// The sizes of drawings and curves that do not go with the part, where the job is not refused for where they lie.
pub(super) fn odd_sizes(job: &Job, slips: &[(usize, Slip)]) -> impl Iterator<Item = Diag> {
    slips.iter().filter(|(_, slip)| slip.is_warned_of()).map(|(k, slip)| {
        let text = format!("texture {} {}", k + 1, slip.text);
        Diag::warning("texture-scale", text).at(job.place_of(&format!("texture.{k}"))).hint(slip.hint.clone())
    })
}
