//! Places of a part: those that can be measured, and those where something is marked.

use super::place::Place;
use super::ways::Ways;
use terrace_core::geom::{Box2, Grid, NM_PER_MM, Nm, P2};
use terrace_core::machine::Commanded;
use terrace_core::math;
use terrace_core::parallel;
use terrace_input::surface::{Cursor, Surface};
use terrace_input::texture::Texture;
use terrace_register::{Site, even_net};

/// Cells along the longer side of the texture: in each, one place that may be measured, and one that may be marked.
const CELLS: i64 = 100;

/// Most places that are looked at closely; more than that lie nearer to each other than says something new.
const MOST_PLACES: usize = 600;
const MOST_MARKED: usize = 600;

/// Strokes that are looked at to find where something is marked.
const MOST_STROKES: usize = 200_000;

/// Tangent of the steepest slope that is touched, 30 degrees, and of that to any place beside it as near as the tip and
/// the search.
const STEEPEST: f64 = 0.577;
const STEEPEST_BESIDE: f64 = 0.75;

/// Directions in which a place is looked at for edges.
const DIRECTIONS: u32 = 12;

/// What a place that is level counts beside one of the mean slope: it needs no stop for its own height, but what is kept
/// free there reaches into the levels of others. And the least, of a part that is level everywhere.
const LEVEL: f64 = 1.0;
const LEAST_WEIGHT: f64 = 0.01;

/// A place where something is marked.
pub(super) struct MarkedPlace {
    pub(super) place: Place,
    /// For how many stops it counts.
    pub(super) weight: f64,
}

/// Heights of a part, place by place.
struct Heights<'a> {
    surface: &'a Surface,
    cursor: Cursor,
    spans: Vec<terrace_input::surface::Span>,
}

impl<'a> Heights<'a> {
    fn new(surface: &'a Surface) -> Self {
        Self { surface, cursor: Cursor::default(), spans: Vec::new() }
    }

    /// The height at a place, nm; None beside the part.
    fn at(&mut self, p: P2) -> Option<f64> {
        self.surface.walk(p, P2::new(p.x + 1, p.y), &mut self.cursor, &mut self.spans);
        let span = self.spans.iter().find(|span| span.facet().is_some())?;
        Some(span.z0)
    }

    /// Heights around a place, farther away by `reach`; None where one lies beside the part.
    fn around(&mut self, p: P2, reach: f64) -> Option<Vec<f64>> {
        let direction = |i: u32| math::sin_cos(f64::from(i) * std::f64::consts::TAU / f64::from(DIRECTIONS));
        (0..DIRECTIONS)
            .map(|i| {
                let (s, c) = direction(i);
                self.at(P2::new(p.x + (c * reach) as i64, p.y + (s * reach) as i64))
            })
            .collect()
    }

    /// dz/dx and dz/dy over a distance.
    fn slope(&mut self, p: P2, over: f64) -> Option<[f64; 2]> {
        let mut between = |dx: i64, dy: i64| {
            let [a, b] = [self.at(P2::new(p.x - dx, p.y - dy))?, self.at(P2::new(p.x + dx, p.y + dy))?];
            Some((b - a) / (2 * (dx + dy)) as f64)
        };
        let d = over as i64;
        Some([between(d, 0)?, between(0, d)?])
    }
}

/// A net over an area.
fn net(area: Box2) -> Grid {
    let size = area.size();
    let pitch = (size[0].max(size[1]) / CELLS + Nm(1)).max(Nm(2));
    Grid { origin: area.lo, pitch: [pitch; 2], count: size.map(|s| (s / pitch + 1) as u32) }
}

/// The nodes of a net, at the rim of its area too.
fn node(area: Box2, grid: &Grid, i: usize) -> P2 {
    let [column, row] = [i % grid.columns(), i / grid.columns()];
    let along = |lo: i64, hi: i64, k: usize, of: u32| lo + (hi - lo) * k as i64 / i64::from(of.max(2) - 1);
    P2::new(along(area.lo.x, area.hi.x, column, grid.count[0]), along(area.lo.y, area.hi.y, row, grid.count[1]))
}

/// At most `count` of some places, evenly apart.
fn evenly(places: Vec<Place>, count: usize) -> Vec<Place> {
    if places.len() <= count {
        return places;
    }
    let site = |place: &Place| Site { at: place.at.map(|nm| nm / NM_PER_MM), slope: place.slope };
    let sites: Vec<Site> = places.iter().map(site).collect();
    even_net(&sites, Vec::new(), count).into_iter().map(|i| places[i].clone()).collect()
}

/// Places in an area that are even enough to be measured, in a fine net.
pub(super) fn even_places(surface: &Surface, area: Box2, ways: &Ways<'_>) -> Vec<Place> {
    let grid = net(area);
    let [near, far] = ways.around();
    let place = |i: usize| {
        let p = node(area, &grid, i);
        let mut heights = Heights::new(surface);
        let z = heights.at(p)?;
        let slope = heights.slope(p, near)?;
        let is_even = |slope: f64, most: f64| slope <= most;
        let steepness = math::hypot(slope[0], slope[1]);
        if !is_even(steepness, STEEPEST) {
            return None;
        }
        for reach in [near, far] {
            let around = heights.around(p, reach)?;
            if around.iter().any(|h| !is_even((h - z).abs() / reach, STEEPEST_BESIDE)) {
                return None;
            }
        }
        let at = [p.x as f64, p.y as f64, z];
        Some(Place { at, slope, stage: ways.touching(at, slope) })
    };
    parallel::map(grid.len(), place).into_iter().flatten().collect()
}

/// Some of them that the probe reaches, evenly apart.
pub(super) fn reached(even: &[Place], ways: &Ways<'_>) -> Vec<Place> {
    // Twice as many as are kept, since what the probe cannot reach is left out of them.
    let found = evenly(even.to_vec(), 2 * MOST_PLACES).into_iter().filter(|place| ways.reaches(place)).collect();
    evenly(found, MOST_PLACES)
}

/// Places where something is marked.
pub(super) fn marked(texture: &Texture, surface: &Surface, max_slope: f64) -> Vec<MarkedPlace> {
    let area = texture.bounds();
    let grid = net(area);
    let mut is_marked = vec![false; grid.len()];
    let cell = |p: P2| {
        let index = |v: i64, k: usize| (v / grid.pitch[k].0).clamp(0, i64::from(grid.count[k]) - 1) as usize;
        index(p.y - area.lo.y, 1) * grid.columns() + index(p.x - area.lo.x, 0)
    };
    let every = texture.len().div_ceil(MOST_STROKES).max(1);
    let mut points = Vec::new();
    for stroke in (0..texture.len()).step_by(every) {
        texture.stroke(stroke, &mut points);
        is_marked[cell(points[0])] = true;
        for pair in points.windows(2) {
            let [a, b] = [pair[0], pair[1]];
            let steps = (a.distance(b) / grid.pitch[0].f64()).ceil().max(1.0) as u32;
            for step in 1..=steps {
                is_marked[cell(a.lerp(b, f64::from(step) / f64::from(steps)))] = true;
            }
        }
    }
    let mut heights = Heights::new(surface);
    let over = grid.pitch[0].f64() / 2.0;
    let cells = is_marked.iter().enumerate().filter(|(_, is_marked)| **is_marked).map(|(i, _)| i);
    let found = cells.filter_map(|i| {
        let [column, row] = [i % grid.columns(), i / grid.columns()];
        let middle = |from: i64, k: usize, i: usize| from + grid.pitch[k].0 * i as i64 + grid.pitch[k].0 / 2;
        let p = P2::new(middle(area.lo.x, 0, column).min(area.hi.x), middle(area.lo.y, 1, row).min(area.hi.y));
        let z = heights.at(p)?;
        let slope = heights.slope(p, over).filter(|s| math::hypot(s[0], s[1]) <= max_slope)?;
        Some(Place { at: [p.x as f64, p.y as f64, z], slope, stage: Commanded::default() })
    });
    let places = evenly(found.collect(), MOST_MARKED);
    let slope = |place: &Place| math::hypot(place.slope[0], place.slope[1]);
    let level = LEVEL * places.iter().map(slope).sum::<f64>() / places.len().max(1) as f64 + LEAST_WEIGHT;
    let weighed = |place: Place| MarkedPlace { weight: slope(&place) + level, place };
    places.into_iter().map(weighed).collect()
}
