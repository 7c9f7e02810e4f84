//! Stops: boxes that together contain all texture.
//!
//! A stop admits a point of the part that lies in its window, the plane rectangle around its centre,
//! and in its interval of height; borders belong to it. A method chooses the stops; that is the whole
//! interface, methods differ in nothing else. Levels lie on the lattice of the stage increment and D is
//! a whole even number of increments, so that the middle of every level is a place where the stage can
//! stand.

pub mod bound;
pub mod box_index;
mod contour;
pub mod tilted_sections;
pub mod window;
mod zrange;

use crate::projection::{Cells, Footprint, HeightRange, HeightReserve, Slabs, join_ranges};
use terrace_core::geom::{Box2, Buckets, Grid, Nm, P2, P3, Turn, Turned};
use terrace_core::machine::TiltAngles;
use terrace_core::program::{SectionId, Sections, Stop, StopId};

/// The lattice on which focal planes lie.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Lattice {
    /// Depth range of a level; a whole even number of steps.
    pub depth: Nm,
    /// Stage increment along z.
    pub step: Nm,
    /// Part heights z with (z + offset) a multiple of the step lie on the lattice.
    pub offset: Nm,
    /// By how much levels reach over each other at most on each side; a whole number of steps.
    pub hysteresis: Nm,
}

impl Lattice {
    /// `depth` is rounded down to the lattice; None where nothing is left of it.
    pub fn new(depth: Nm, step: Nm, offset: Nm) -> Option<Self> {
        let depth = step * 2 * (depth / (step * 2));
        (depth > Nm(0)).then_some(Self { depth, step, offset, hysteresis: Nm(0) })
    }

    /// With levels that overlap, so that a height that swings about a border need not change the stop
    /// each time. Rounded to the lattice; at most a quarter of the depth range.
    #[must_use]
    pub(crate) fn with_hysteresis(mut self, nm: f64) -> Self {
        let most = self.depth / 4 / self.step;
        self.hysteresis = self.step * ((nm / self.step.f64()).round() as i64).min(most);
        self
    }

    /// The lattice of what is left of each level where so much is kept free above and below, nm; where nothing would be
    /// left, two steps.
    #[must_use]
    fn core(self, reserve: f64) -> Self {
        let kept = Nm::ceil(reserve / self.step.f64()) * self.step.0;
        let depth = (self.depth - kept * 2).max(self.step * 2);
        Self { depth, hysteresis: self.hysteresis.min(self.step * (depth / 4 / self.step)), ..self }
    }

    /// Whether one level on the lattice holds a range of heights.
    pub fn holds(&self, heights: HeightRange) -> bool {
        (self.floor(heights.lo) + self.depth).f64() >= heights.hi
    }

    /// The highest lattice point not above `z`.
    pub fn floor(&self, z: f64) -> Nm {
        let z = Nm::floor(z);
        z - (z + self.offset).rem_euclid(self.step)
    }
}

/// How the part lies at a stop of a machine that tilts it.
#[derive(Clone, Copy, Debug)]
pub struct StopTilt {
    /// The turn of the part: window and interval of the stop are those of the part so turned.
    pub turn: Turn,
    /// What the stop is kept to of the plane of the drawing, if it is.
    pub area: Option<Box2>,
}

/// A stop of a method.
#[derive(Clone, Debug)]
pub struct PlacedStop {
    /// Stage position and what it admits.
    pub stop: Stop,
    /// None where the machine does not tilt the part: of all stops of a method or of none.
    tilted: Option<StopTilt>,
}

impl PlacedStop {
    /// The box of the part that it may admit; `half` of its window.
    fn area(&self, half: [Nm; 2]) -> Box2 {
        let flat = Box2::around(Turn::drawn(self.stop.centre), half);
        self.tilted.map_or(flat, |tilted| footprint(&self.stop, &tilted.turn, half))
    }
}

/// The stops of a method, all with windows of one size and intervals of one height.
#[derive(Clone, Debug)]
pub struct Stops {
    /// In the order in which the method gave them.
    pub stops: Vec<PlacedStop>,
    /// Half the window along x and y.
    half: [Nm; 2],
    /// Height of the intervals.
    depth: Nm,
    /// Cells of the size of a window.
    grid: Grid,
    /// The stops whose windows touch a cell, by `z_lo`.
    by_cell: Buckets<(Nm, u32)>,
}

impl Stops {
    /// `window` is even, as is the pitch of the sections.
    pub fn new(stops: Vec<Stop>, window: [Nm; 2], depth: Nm) -> Self {
        Self::placed(stops.into_iter().map(|stop| PlacedStop { stop, tilted: None }).collect(), window, depth)
    }

    /// The stops of a machine that tilts the part.
    pub fn tilted(stops: Vec<(Stop, StopTilt)>, window: [Nm; 2], depth: Nm) -> Self {
        let placed = |(stop, tilted)| PlacedStop { stop, tilted: Some(tilted) };
        Self::placed(stops.into_iter().map(placed).collect(), window, depth)
    }

    fn placed(stops: Vec<PlacedStop>, window: [Nm; 2], depth: Nm) -> Self {
        let half = window.map(|w| w / 2);
        let all = stops.iter().map(|s| s.area(half)).reduce(Box2::union);
        let all = all.unwrap_or(Box2 { lo: P2::new(0, 0), hi: P2::new(0, 0) });
        // Borders of cells run through centres of stops: the windows of a grid of sections touch four cells then,
        // not nine.
        let origin = P2::new(all.lo.x - half[0].0, all.lo.y - half[1].0);
        let count = [0, 1].map(|axis| (all.size()[axis] / window[axis] + 2) as u32);
        let grid = Grid { origin, pitch: window, count };
        let touched = stops.iter().zip(0..).flat_map(|(s, i)| {
            let entry = (s.stop.z_lo, i);
            grid.touched(s.area(half)).map(move |cell| (cell, entry))
        });
        let mut by_cell = Buckets::new(grid.len(), touched);
        by_cell.each_mut().for_each(<[_]>::sort_unstable);
        Self { stops, half, depth, grid, by_cell }
    }

    /// The stops that may admit a point near (x, y, z), nm: their intervals, widened by `slack`, hold z.
    pub fn near(&self, p: P3, slack: f64) -> impl Iterator<Item = StopId> {
        let [x, y, z] = p.at;
        let Grid { origin, pitch, count } = self.grid;
        let cell = |v: f64, lo: i64, size: Nm| ((v - lo as f64) / size.f64()).floor() as i64;
        let (column, row) = (cell(x, origin.x, pitch[0]), cell(y, origin.y, pitch[1]));
        let inside = (0..i64::from(count[0])).contains(&column) && (0..i64::from(count[1])).contains(&row);
        let list = if inside { self.by_cell.of(row as usize * self.grid.columns() + column as usize) } else { &[] };
        // Heights of the turned part say nothing of those of the part.
        let (lowest, highest) =
            if self.is_tilted() { (f64::NEG_INFINITY, f64::INFINITY) } else { (z - slack, z + slack) };
        let from = list.partition_point(|&(z_lo, _)| (z_lo + self.depth).f64() < lowest);
        list[from..].iter().take_while(move |&&(z_lo, _)| z_lo.f64() <= highest).map(|&(_, i)| StopId(i))
    }

    /// The stops in order.
    pub fn ids(&self) -> impl Iterator<Item = StopId> + use<> {
        (0..self.stops.len() as u32).map(StopId)
    }

    /// Whether the machine tilts the part.
    #[inline]
    pub(crate) fn is_tilted(&self) -> bool {
        self.stops.first().is_some_and(|s| s.tilted.is_some())
    }

    /// What of the drawing stop `i` is kept to, if it is.
    #[inline]
    pub fn area(&self, StopId(i): StopId) -> Option<Box2> {
        self.stops[i as usize].tilted.and_then(|tilted| tilted.area)
    }

    /// How the part is turned at stop `i`; None where nothing is tilted.
    #[inline]
    pub fn turn(&self, StopId(i): StopId) -> Option<&Turn> {
        self.stops[i as usize].tilted.as_ref().map(|tilted| &tilted.turn)
    }

    /// Half the window along x and y, nm.
    #[inline]
    pub fn half(&self) -> [Nm; 2] {
        self.half
    }

    /// Size of the boxes along x, y and z.
    pub fn size(&self) -> [Nm; 3] {
        [self.half[0] * 2, self.half[1] * 2, self.depth]
    }

    /// Lower and upper corner of the window of stop `i`, nm.
    #[inline]
    pub fn window(&self, StopId(i): StopId) -> [[f64; 2]; 2] {
        let c = self.stops[i as usize].stop.centre;
        let [Nm(hx), Nm(hy)] = self.half;
        [[(c.x - hx) as f64, (c.y - hy) as f64], [(c.x + hx) as f64, (c.y + hy) as f64]]
    }
}

/// The box of the part that a turned stop may admit.
fn footprint(stop: &Stop, turn: &Turn, half: [Nm; 2]) -> Box2 {
    let mut area = Box2::EMPTY;
    for corner in 0..8 {
        let side = |bit: usize, c: i64, Nm(half): Nm| (if corner >> bit & 1 == 0 { c - half } else { c + half }) as f64;
        let z = if corner & 4 == 0 { stop.z_lo } else { stop.z_hi }.f64();
        let corner = P3::new([side(0, stop.centre.x, half[0]), side(1, stop.centre.y, half[1]), z]);
        let [x, y, _] = turn.back(corner).at;
        area.add(P2::new(x.floor() as i64, y.floor() as i64));
        area.add(P2::new(x.ceil() as i64, y.ceil() as i64));
    }
    area
}

/// How many depths of levels there may be in a job whose part was measured, from none kept free to all.
const RESERVE_CLASSES: f64 = 32.0;

/// Stops on a grid of sections at evenly spaced levels of the whole part (the PPGS article, step 3). `window` is at
/// least the pitch of the sections.
pub fn contour(footprint: &Footprint, sections: &Sections, window: [Nm; 2], lattice: &Lattice) -> Stops {
    let z0 = lattice.floor(footprint.range().map_or(0.0, |range| range.lo));
    // Neighbouring sections have the same levels, so that stops of both can become one: what they keep free is rounded
    // up to one of a few.
    let class = lattice.depth.f64() / (2.0 * RESERVE_CLASSES);
    let kept = |i: usize| (footprint.reserve_of(i) / class).ceil() * class;
    on_sections(footprint, sections, window, lattice, kept, |i, core| {
        // Levels that lie fast cut figures as they cut everything else.
        let heights = with_figures(footprint.of_section(i), footprint.figures_of(i));
        contour::levels(&heights, z0, core)
    })
}

/// Stops on a grid of sections, in each the fewest levels that cover the texture's heights. `window` is at least the
/// pitch of the sections.
pub fn z_range(footprint: &Footprint, sections: &Sections, window: [Nm; 2], lattice: &Lattice) -> Stops {
    on_sections(
        footprint,
        sections,
        window,
        lattice,
        |i| footprint.reserve_of(i),
        |i, core| {
            // What no level can hold is cut. What is kept free around a figure counts in its own range.
            let kept = ((lattice.depth - core.depth) / 2).f64();
            let (whole, deep): (Vec<_>, Vec<_>) =
                footprint.figures_of(i).iter().partition(|&&figure| lattice.holds(figure));
            let within = |f: HeightRange| HeightRange { lo: f.lo + kept, hi: (f.hi - kept).max(f.lo + kept) };
            let whole: Vec<HeightRange> = whole.into_iter().map(within).collect();
            zrange::levels(&with_figures(footprint.of_section(i), &deep), &whole, core)
        },
    )
}

/// A level of one section.
#[derive(Clone, Copy, Debug, PartialEq)]
struct SectionLevel {
    number: i32,
    /// Its lower end.
    z_lo: Nm,
}

/// A stop at every level that `levels` gives for a section, by the lattice of what may be used there of the depth.
fn on_sections(
    footprint: &Footprint,
    sections: &Sections,
    window: [Nm; 2],
    lattice: &Lattice,
    kept: impl Fn(usize) -> f64,
    levels: impl Fn(usize, &Lattice) -> Vec<SectionLevel>,
) -> Stops {
    let mut stops = Vec::new();
    for i in (0..sections.len()).filter(|&i| footprint.is_used(i)) {
        let centre = Turn::upright(sections.centre(i));
        let core = lattice.core(kept(i));
        let kept = (lattice.depth - core.depth) / 2;
        stops.extend(levels(i, &core).into_iter().map(|SectionLevel { number: level, z_lo }| {
            let z_lo = z_lo - kept;
            Stop {
                section: SectionId(sections.cell(i)),
                level,
                tilt: TiltAngles::UPRIGHT,
                centre,
                lpfl: z_lo + lattice.depth / 2,
                z_lo,
                z_hi: z_lo + lattice.depth,
            }
        }));
    }
    Stops::new(stops, window, lattice.depth)
}

/// The heights of what may be cut in a section, with those of figures that are cut as well.
fn with_figures(heights: &[HeightRange], figures: &[HeightRange]) -> Vec<HeightRange> {
    let mut all = [figures, heights].concat();
    join_ranges(&mut all);
    all
}

/// The fine grid and the slabs in which windows see the texture.
#[derive(Clone, Copy, Debug)]
pub struct Fine {
    /// Cells of a width of which a window measures a whole number; corners where windows may begin.
    pub grid: Sections,
    /// Heights.
    pub slabs: Slabs,
}

impl Fine {
    /// Cells along a window, unless the texture's box would need too many.
    const ALONG: i64 = 80;
    /// The fewest cells along a window: it holds whole cells, so with fewer much of it could not be used.
    const FEWEST: i64 = 10;
    /// Most cells of the texture's box, which take memory whether they hold marks or not.
    const MOST: i64 = 1 << 22;
    /// Windows are placed with 32-bit coordinates.
    const WIDEST: Nm = Nm(1 << 31);

    /// For a texture within the sections, its lowest mark at `lowest`; None where the box is too wide for
    /// windows of this size.
    pub fn over(sections: &Sections, window: [Nm; 2], lattice: &Lattice, lowest: f64) -> Option<Self> {
        let size = [0, 1].map(|k| sections.pitch[k] * i64::from(sections.count[k]));
        let mut along = Self::ALONG;
        let width = |along: i64| window.map(|p| lattice.step * (p / along / lattice.step).max(1));
        let cells = |along: i64| (size[0] / width(along)[0]).saturating_mul(size[1] / width(along)[1]);
        while along > Self::FEWEST && cells(along) > Self::MOST {
            along /= 2;
        }
        let pitch = width(along);
        let count = [0, 1].map(|k| size[k] / pitch[k] + 1);
        let fits = count.iter().all(|&c| c <= Cells::MOST) && cells(along) <= Self::MOST;
        (fits && size.iter().all(|&s| s < Self::WIDEST)).then(|| Self {
            grid: Sections { origin: sections.origin, pitch, count: count.map(|c| c as u32) },
            slabs: Slabs {
                z0: lattice.floor(lowest),
                depth: lattice.depth,
                hysteresis: lattice.hysteresis,
                step: lattice.step,
            },
        })
    }
}

/// The frame in which windows are searched: counted from the middle of all boxes, so that coordinates reach less far,
/// some axes reversed.
struct SearchFrame {
    middle: [i64; 3],
    flips: [bool; 3],
}

impl SearchFrame {
    /// The box from `lo` to `hi` in this frame.
    fn item(&self, lo: [i64; 3], hi: [i64; 3]) -> box_index::Item {
        let from_middle = |v: [i64; 3]| [0, 1, 2].map(|k| (v[k] - self.middle[k]) as i32);
        let (mut lo, mut hi) = (from_middle(lo), from_middle(hi));
        for k in (0..3).filter(|&k| self.flips[k]) {
            (lo[k], hi[k]) = (-hi[k], -lo[k]);
        }
        box_index::Item { lo, hi }
    }

    /// The lower corner of a box of `size` that has its lower corner at `corner` in this frame.
    fn corner(&self, corner: [i32; 3], size: [i32; 3]) -> [i64; 3] {
        [0, 1, 2].map(|k| {
            let lower = if self.flips[k] { -corner[k] - size[k] } else { corner[k] };
            i64::from(lower) + self.middle[k]
        })
    }
}

/// What windows that are placed freely are searched by.
#[derive(Clone, Copy)]
pub struct FreeSearch<'a> {
    /// Size of a window.
    pub window: [Nm; 2],
    /// A stop that holds a cell also admits what lies up to so far around it.
    pub overlap: Nm,
    /// Axes along which the search begins at the other end: the borders of windows lie elsewhere then.
    pub flips: [bool; 3],
    /// What is kept free for the height of a measured part.
    pub reserve: Option<&'a HeightReserve>,
}

/// Windows and levels placed freely. A stop that holds a cell also admits what lies up to `overlap` nm around it. With
/// other `flips` the search begins in another corner, and the borders of windows lie elsewhere.
pub fn free(mut cells: Cells, fine: &Fine, sections: &Sections, lattice: &Lattice, search: &FreeSearch<'_>) -> Stops {
    let Fine { grid, slabs } = fine;
    let &FreeSearch { window, overlap: Nm(overlap), flips, reserve } = search;
    // What is kept free around the marks of a cell, in whole steps: of a piece that begins or ends in it, which is as long
    // as a cell of the reserve, the most on all of it counts.
    let kept = |[column, row]: [i64; 2]| {
        let Some(reserve) = reserve else { return 0 };
        let [Nm(beyond), _] = reserve.cell();
        let [x, y] = [grid.origin.x + column * grid.pitch[0].0, grid.origin.y + row * grid.pitch[1].0];
        let lo = P2::new(x - beyond, y - beyond);
        let hi = P2::new(x + grid.pitch[0].0 + beyond, y + grid.pitch[1].0 + beyond);
        let nm = reserve.kept(Box2 { lo, hi });
        Nm::ceil(nm / lattice.step.f64()).0 * lattice.step.0
    };
    let pitch = grid.pitch.map(|Nm(pitch)| pitch);
    let figures = cells.take_figures();
    let list = cells.list();
    // Coordinates are counted from the lower corner of the grid and its lowest slab.
    let border = |slab: i64| (slabs.border(slab) - slabs.z0).0;
    let highest = list.clone().map(|[.., slab]| border(slab + 1)).chain(figures.iter().map(|f| f[1][2] - slabs.z0.0));
    let top = highest.max().unwrap_or(0);
    let [middle_x, middle_y] = [0, 1].map(|k| i64::from(grid.count[k]) / 2 * pitch[k]);
    // Whole steps, so that levels lie on the lattice as `z0` does.
    let middle_z = top / 2 / lattice.step.0 * lattice.step.0;
    let frame = SearchFrame { middle: [middle_x, middle_y, middle_z], flips };
    let origin = [grid.origin.x, grid.origin.y, slabs.z0.0];
    let from_origin = |v: [i64; 3]| [0, 1, 2].map(|k| v[k] - origin[k]);
    let items: Vec<box_index::Item> = list
        .map(|[column, row, slab]| {
            let [x, y] = [column * pitch[0], row * pitch[1]];
            let beyond = slabs.hysteresis.0 + kept([column, row]);
            let (from, to) = (border(slab) - beyond, border(slab + 1) + beyond);
            // Where more is kept free than there is, the job is refused; until then no window is asked for more.
            let to = to.min(from + lattice.depth.0);
            let hi = [x + pitch[0] + overlap, y + pitch[1] + overlap, to];
            frame.item([x - overlap, y - overlap, from], hi)
        })
        // Figures are not cut, so nothing around them is marked twice.
        .chain(figures.iter().map(|&[lo, hi]| frame.item(from_origin(lo), from_origin(hi))))
        .collect();
    let [w, h] = window.map(|Nm(w)| w);
    let size = [w, h, lattice.depth.0].map(|v| v as i32);
    let stop = |corner: [i32; 3]| {
        let [x, y, z] = frame.corner(corner, size);
        let centre = P2::new(grid.origin.x + x + w / 2, grid.origin.y + y + h / 2);
        free_stop(centre, slabs.z0 + Nm(z), sections, lattice)
    };
    let corners = window::cover(&items, size, [lattice.step.0 as i32; 3]);
    let stops = numbered_by_section(corners.into_iter().map(stop).collect());
    Stops::new(stops, window, lattice.depth)
}

/// The stop of a window around `centre` and a level from `z_lo` on. It belongs to the section that holds its centre.
fn free_stop(centre: P2<Turned>, z_lo: Nm, sections: &Sections, lattice: &Lattice) -> Stop {
    let section = [(0, centre.x), (1, centre.y)].map(|(axis, v)| sections.along(axis, v, 0) as u32);
    Stop {
        section: SectionId(section),
        level: 0,
        tilt: TiltAngles::UPRIGHT,
        centre,
        lpfl: z_lo + lattice.depth / 2,
        z_lo,
        z_hi: z_lo + lattice.depth,
    }
}

/// Stops section by section, in each upwards and with levels that count from 0.
fn numbered_by_section(mut stops: Vec<Stop>) -> Vec<Stop> {
    stops.sort_by_key(|s| ([s.section.0[1], s.section.0[0]], s.z_lo, s.centre.y, s.centre.x));
    for i in 1..stops.len() {
        stops[i].level = if stops[i].section == stops[i - 1].section { stops[i - 1].level + 1 } else { 0 };
    }
    stops
}

#[cfg(test)]
mod tests {
    use super::*;

    const LATTICE: Lattice = Lattice { depth: Nm(70_000), step: Nm(100), offset: Nm(0), hysteresis: Nm(0) };

    fn ranges(list: &[[f64; 2]]) -> Vec<HeightRange> {
        list.iter().map(|&[lo, hi]| HeightRange { lo, hi }).collect()
    }

    fn numbered(levels: Vec<SectionLevel>) -> Vec<(i32, Nm)> {
        levels.into_iter().map(|level| (level.number, level.z_lo)).collect()
    }

    #[test]
    fn a_box_returns_from_the_frame_of_the_search_to_where_it_was() {
        for bits in 0..8 {
            let frame = SearchFrame { middle: [50, -70, 3], flips: [1, 2, 4].map(|bit| bits & bit != 0) };
            let item = frame.item([10, 20, 30], [14, 26, 31]);
            assert_eq!(frame.corner(item.lo, [4, 6, 1]), [10, 20, 30]);
        }
    }

    #[test]
    fn contour_uses_every_level_that_a_mark_touches() {
        let l = |heights: &[[f64; 2]]| numbered(contour::levels(&ranges(heights), Nm(0), &LATTICE));
        assert_eq!(l(&[[0.0, 70_000.0]]), [(0, Nm(0))], "the topmost level is closed");
        assert_eq!(l(&[[69_999.0, 70_001.0]]), [(0, Nm(0)), (1, Nm(70_000))]);
        assert_eq!(
            l(&[[0.0, 10.0], [200_000.0, 280_001.0]]),
            [(0, Nm(0)), (2, Nm(140_000)), (3, Nm(210_000)), (4, Nm(280_000))]
        );
    }

    #[test]
    fn z_range_uses_the_fewest_levels() {
        let count = |heights: &[[f64; 2]]| zrange::levels(&ranges(heights), &[], &LATTICE).len();
        assert_eq!(count(&[[35_000.0, 104_900.0]]), 1);
        assert_eq!(count(&[[35_000.0, 105_100.0]]), 2);
        assert_eq!(count(&[[0.0, 10_000.0], [500_000.0, 540_000.0]]), 2, "no level where nothing is");
        assert_eq!(count(&[[0.0, 10_000.0], [60_000.0, 69_000.0]]), 1);
    }

    #[test]
    fn a_figure_lies_in_one_level_and_the_levels_are_fewest() {
        let levels = |heights: &[[f64; 2]], figures: &[[f64; 2]], h: f64| {
            numbered(zrange::levels(&ranges(heights), &ranges(figures), &LATTICE.with_hysteresis(h)))
        };
        // Two figures that overlap and do not fit one level; a third fits the second's.
        let figures = [[0.0, 60_000.0], [30_000.0, 95_000.0], [40_000.0, 96_000.0]];
        assert_eq!(levels(&[], &figures, 0.0), [(0, Nm(0)), (1, Nm(30_000))]);
        // Heights fill what is between.
        assert_eq!(levels(&[[0.0, 150_000.0]], &figures, 0.0), [(0, Nm(0)), (1, Nm(30_000)), (2, Nm(100_000))]);
        // Random figures: every one is held, and no point set of lower ends could be smaller (each level
        // begins at the lowest end of a figure that no level below holds).
        let mut numbers = terrace_core::random::Random::new(9);
        let mut random = |n: usize| numbers.below(n) as f64;
        let mut figures: Vec<[f64; 2]> = (0..500)
            .map(|_| {
                let lo = random(2_000_000);
                [lo, lo + random(69_900)]
            })
            .collect();
        figures.sort_by(|a, b| a[0].total_cmp(&b[0]));
        let out = levels(&[], &figures, 0.0);
        let holds = |l: &(i32, Nm), f: &[f64; 2]| l.1.f64() <= f[0] && f[1] <= (l.1 + LATTICE.depth).f64();
        assert!(figures.iter().all(|f| out.iter().any(|l| holds(l, f))));
        for (i, level) in out.iter().enumerate() {
            assert!(figures.iter().any(|f| LATTICE.floor(f[0]) == level.1 && !out[..i].iter().any(|l| holds(l, f))));
        }
        // Hysteresis: neighbours reach over each other by twice as much.
        assert_eq!(levels(&[[0.0, 150_000.0]], &[], 5000.0), [(0, Nm(0)), (1, Nm(60_000)), (2, Nm(120_000))]);
    }

    #[test]
    fn depth_shrinks_to_the_lattice_and_never_grows() {
        assert_eq!(Lattice::new(Nm(70_000), Nm(100), Nm(0)).map(|l| l.depth), Some(Nm(70_000)));
        assert_eq!(Lattice::new(Nm(70_500), Nm(1000), Nm(0)).map(|l| l.depth), Some(Nm(70_000)));
        assert_eq!(Lattice::new(Nm(1_500), Nm(1000), Nm(0)), None);
        let hysteresis = |depth| Lattice::new(Nm(depth), Nm(1000), Nm(0)).map(|l| l.with_hysteresis(1e9).hysteresis.0);
        assert_eq!([2_000, 4_000, 70_000].map(hysteresis), [Some(0), Some(1_000), Some(17_000)], "at most a quarter");
    }
}
