//! `fill`: what is filled along contours. The manifest says the grid of sections and the direction of the lines in
//! each; the grid must be the job's, and lines laid so must be parallel, a pitch apart, reach from border to border of
//! their section and leave no room for another. From this it follows that they cover the area once, at its pitch; that
//! is checked against the area of every section too. Whether the directions are those of level lines is not asked: any
//! others are a sound hatch.
//!
//! Units: nm.

use super::part_place_nm;
use crate::job_facts::JobFacts;
use crate::proof::Rule;
use crate::read::manifest::Manifest;
use terrace_core::geom::{Box2, Nm, P2};
use terrace_core::math;
use terrace_core::program::{PassId, Sections};
use terrace_input::texture::{Contour, ContourAreas, Directions, Figure, Texture};

const PLACE: &str = "manifest.json";

/// A point rounded to the grid lies this near to its place (0.71 nm, half the diagonal of the grid); the distance of
/// two lines changes by up to twice as much.
const ROUNDED: f64 = 1.0;

/// In corners, lines are left out whose ends are nearer than this in x or in y, nm.
const SHORT: f64 = 2.0;

/// An area that is filled along contours.
struct FilledArea {
    corners: [[f64; 2]; 4],
    pitch: f64,
}

/// Lays the lines that the manifest speaks of and holds the rule; returns whether they could be laid.
pub(crate) fn check(
    manifest: &Manifest,
    facts: &JobFacts,
    pass: PassId,
    texture: &mut Texture,
    rule: &mut Rule,
) -> bool {
    rule.ran = true;
    if texture.contours().next().is_none() {
        return true;
    }
    rule.checked += 1;
    // The directions are data of the folder: they are checked against the job's grid, the lines are laid by the
    // texture's own code from them, and then each line is followed to see that pitch and sections are kept.
    let directions = match directions(manifest, facts, pass, texture.bounds()) {
        Ok(directions) => directions,
        Err(fault) => {
            rule.broken("", PLACE, fault);
            return false;
        }
    };
    if let Err(e) = texture.fill(directions.clone()) {
        rule.broken("", PLACE, e.diags().first().map_or("its lines cannot be placed", |d| &d.message));
        return false;
    }
    for contour in texture.whole_contours() {
        follow(contour, &directions, rule);
    }
    texture.contour_areas().for_each(|areas| check_areas_of_drawing(areas, &directions, rule));
    true
}

/// Follows all lines of an area; returns the places of the first lines of its sections, see [`LineFollower::finish`].
fn follow(contour: &Contour, directions: &Directions, rule: &mut Rule) -> Vec<Option<f64>> {
    let area = FilledArea { corners: contour.corners(), pitch: contour.pitch() };
    let mut lines = LineFollower::new(&area, directions, rule);
    let mut points = Vec::new();
    for i in 0..contour.line_count() {
        contour.line_ends(i, &mut points);
        lines.add(&points);
    }
    lines.finish()
}

/// The lines over the box of all areas of a drawing in one direction of hatch, from which lines of areas are cut.
struct Lattice {
    directions: Directions,
    pitch: f64,
    /// Where the first line of each section lies, across, seen from the centre of the section.
    firsts: Vec<Option<f64>>,
}

/// Holds the lines that areas of a drawing are cut from to the same, and each piece to lie on one of them.
fn check_areas_of_drawing(areas: &ContourAreas, directions: &Directions, rule: &mut Rule) {
    let mut lattices = Vec::new();
    for (k, contour) in areas.lattices().iter().enumerate() {
        let directions = directions.turned(k);
        let firsts = follow(contour, &directions, rule);
        lattices.push(Lattice { directions, pitch: contour.pitch(), firsts });
    }
    let mut points = Vec::new();
    for i in areas.own() {
        points.clear();
        areas.stroke(i, &mut points);
        rule.checked += 1;
        let &[a, b] = points.as_slice() else {
            rule.broken("", areas.element(i), "a line of an area has more than two points");
            continue;
        };
        // A line may lie on any of the lattices; where it lies on none the last says why.
        let mut faults: Vec<_> = lattices.iter().map(|lattice| lattice.fault(a, b, areas.is_between(i))).collect();
        if let Some(fault) = faults.pop().flatten().filter(|_| faults.iter().all(Option::is_some)) {
            rule.broken("", areas.element(i), fault);
        }
    }
}

impl Lattice {
    /// Why a line from `a` to `b` is not a piece of a line of the lattice. One that lies `between` these is a line of
    /// its own in an area that none of them meets: it keeps direction and section alone.
    fn fault(&self, a: P2, b: P2, between: bool) -> Option<&'static str> {
        let grid = self.directions.grid;
        let section = section(&grid, a, b);
        let centre = grid.centre(section);
        let direction = Directions::cos_sin(self.directions.hundredths[section]);
        let [oa, ob] = [a, b].map(|p| across(direction, [p.x as f64, p.y as f64], centre));
        let lines = self.firsts[section].map(|first| ((oa + ob) / 2.0 - first) / self.pitch);
        if (oa - ob).abs() > 2.0 * ROUNDED {
            Some("a line of an area does not run in the direction of its section")
        } else if !(grid.area(section).holds(a) && grid.area(section).holds(b)) {
            Some("a line of an area leaves its section")
        // The first line and both ends of this one are rounded.
        } else if !between && lines.is_none_or(|n| (n - n.round()).abs() * self.pitch > 3.0 * ROUNDED) {
            Some("a line of an area is not a whole number of pitches from the others of its section")
        } else {
            None
        }
    }
}

/// The section of a line by its middle, rounded towards where it comes from.
fn section(grid: &Sections, a: P2, b: P2) -> usize {
    let along = |axis: usize, sum: i64, d: i64| {
        let middle = if d < 0 { (sum + 1).div_euclid(2) } else { sum.div_euclid(2) };
        grid.along(axis, middle, d)
    };
    let [column, row] = [along(0, a.x + b.x, b.x - a.x), along(1, a.y + b.y, b.y - a.y)];
    (row * i64::from(grid.count[0]) + column) as usize
}

/// Place of a point across lines, seen from `centre`.
fn across(direction: [f64; 2], p: [f64; 2], centre: P2) -> f64 {
    direction[0] * (p[1] - centre.y as f64) - direction[1] * (p[0] - centre.x as f64)
}

/// The directions that the manifest states, for the grid of sections that the job has.
fn directions(manifest: &Manifest, facts: &JobFacts, pass: PassId, bounds: Box2) -> Result<Directions, &'static str> {
    let stated = manifest.passes.get(pass.index()).map(|p| &p.sections);
    let stated = stated.ok_or("it does not state the sections of a pass")?;
    let step = facts.machine.increment_nm();
    let [x, y] = stated.pitch_mm.map(|v| Nm::from_mm(v).unwrap_or_default());
    let is_pitch = |v: Nm, most: f64| v > Nm(0) && v.f64() <= most && v % (step * 2) == Nm(0);
    if !is_pitch(x, facts.section_nm[0]) || !is_pitch(y, facts.section_nm[1]) {
        return Err("its pitch of sections differs from the job file");
    }
    let [Some(ox), Some(oy), _] = manifest.placement.origin_mm.map(Nm::from_mm) else {
        return Err("its placement is beyond 4 m");
    };
    // Later passes have a grid that lies lower by their shift, so it reaches over as much more of the texture.
    let [dx, dy] = facts.shift(pass, [x, y]);
    let bounds = Box2 { lo: P2::new(bounds.lo.x - dx.0, bounds.lo.y - dy.0), hi: bounds.hi };
    let grid = Sections::over(bounds, [x, y], step, [ox, oy]);
    let origin = stated.origin_mm.map(Nm::from_mm);
    if origin != [Some(Nm(grid.origin.x)), Some(Nm(grid.origin.y))] || [stated.columns, stated.rows] != grid.count {
        return Err("its sections do not match the job's texture");
    }
    if stated.direction_deg.len() != grid.len() {
        return Err("it does not state one direction for every section");
    }
    // Decimals of a degree are exact to the hundredth, which is what the program lays lines by.
    let hundredths = stated.direction_deg.iter().map(|deg| {
        let h = (deg * 100.0).round();
        let is_one = (0.0..f64::from(Directions::COUNT)).contains(&h) && (deg * 100.0 - h).abs() < 1e-6;
        if is_one { Ok(h as u16) } else { Err("a direction is not a whole hundredth of a degree from 0 to 179.99") }
    });
    Ok(Directions { grid, hundredths: hundredths.collect::<Result<_, _>>()? })
}

/// Follows the lines of an area, section by section.
struct LineFollower<'a> {
    area: &'a FilledArea,
    grid: Sections,
    hundredths: &'a [u16],
    rule: &'a mut Rule,
    /// The sections that have begun.
    begun: Vec<bool>,
    firsts: Vec<Option<f64>>,
    /// The lines of the section at hand.
    lines: Option<SectionLines>,
}

/// The lines of one section.
struct SectionLines {
    section: usize,
    /// The part of the area that lies in the section.
    outline: Vec<[f64; 2]>,
    direction: [f64; 2],
    /// Length of the shortest line that is not left out.
    short: f64,
    /// Distances of the first and the last line so far from the section's centre, across.
    first: f64,
    last: f64,
    count: usize,
    length: f64,
}

impl<'a> LineFollower<'a> {
    fn new(area: &'a FilledArea, directions: &'a Directions, rule: &'a mut Rule) -> Self {
        let Directions { grid, ref hundredths } = *directions;
        let (begun, firsts) = (vec![false; grid.len()], vec![None; grid.len()]);
        Self { area, grid, hundredths, rule, begun, firsts, lines: None }
    }

    /// Takes the next line.
    fn add(&mut self, points: &[P2]) {
        self.rule.checked += 1;
        let &[a, b] = points else { return self.rule.broken("", "texture", "a line has more than two points") };
        let section = section(&self.grid, a, b);
        if self.lines.as_ref().is_none_or(|lines| lines.section != section) {
            self.end_section();
            if std::mem::replace(&mut self.begun[section], true) {
                self.fault(a, "the lines of a section are not consecutive");
            }
            self.lines = Some(SectionLines::new(self.area, &self.grid, section, self.hundredths[section]));
        }
        let Some(lines) = &mut self.lines else { return };
        if let Some(fault) = lines.add(a, b, self.grid.centre(section), self.area.pitch) {
            self.fault(a, fault);
        }
    }

    fn fault(&mut self, p: P2, fault: &str) {
        self.rule.broken("", part_place_nm([p.x as f64, p.y as f64]), fault);
    }

    fn end_section(&mut self) {
        let Some(lines) = self.lines.take() else { return };
        self.firsts[lines.section] = Some(lines.first);
        if let Some(fault) = lines.end(self.grid.centre(lines.section), self.area.pitch) {
            self.fault(self.grid.centre(lines.section), fault);
        }
    }

    /// Ends the last section, and looks into those without a line; returns the places of the first lines of
    /// sections, across, seen from their centres.
    fn finish(mut self) -> Vec<Option<f64>> {
        self.end_section();
        for section in 0..self.grid.len() {
            if self.begun[section] {
                continue;
            }
            let lines = SectionLines::new(self.area, &self.grid, section, self.hundredths[section]);
            // Where there is less room than a pitch, a line may lie on either side of it.
            if lines.reach(self.grid.centre(section)).is_some_and(|[lo, hi]| hi - lo > self.area.pitch + 2.0 * ROUNDED)
            {
                self.fault(self.grid.centre(section), "a section of the area holds no line");
            }
        }
        self.firsts
    }
}

impl SectionLines {
    fn new(area: &FilledArea, grid: &Sections, section: usize, hundredths: u16) -> Self {
        let outline = outline(&area.corners, grid.area(section));
        let direction = Directions::cos_sin(hundredths);
        let short = SHORT / direction.map(f64::abs).into_iter().filter(|&v| v > 0.0).fold(1.0, f64::min);
        Self { section, outline, direction, short, first: 0.0, last: 0.0, count: 0, length: 0.0 }
    }

    /// Place of a point across the lines, seen from `centre`.
    fn across(&self, p: [f64; 2], centre: P2) -> f64 {
        across(self.direction, p, centre)
    }

    /// Takes the next line of the section; returns what is wrong with it.
    fn add(&mut self, a: P2, b: P2, centre: P2, pitch: f64) -> Option<&'static str> {
        let [pa, pb] = [a, b].map(|p| [p.x as f64, p.y as f64]);
        let (oa, ob) = (self.across(pa, centre), self.across(pb, centre));
        let middle = (oa + ob) / 2.0;
        let step = middle - self.last;
        self.first = if self.count == 0 { middle } else { self.first };
        self.last = middle;
        self.count += 1;
        self.length += a.distance(b);
        let on_border = |p: [f64; 2]| depth(&self.outline, p).abs() <= ROUNDED;
        if (oa - ob).abs() > 2.0 * ROUNDED {
            Some("a line does not run in the direction of its section")
        } else if self.count > 1 && (step - pitch).abs() > 2.0 * ROUNDED {
            Some("two lines are not a pitch apart")
        } else if !on_border(pa) || !on_border(pb) {
            Some("a line does not end on the border of its section")
        } else {
            None
        }
    }

    /// The fault of all lines of the section together.
    fn end(&self, centre: P2, pitch: f64) -> Option<&'static str> {
        let Some([lo, hi]) = self.reach(centre) else { return Some("lines lie outside the area") };
        if self.first - lo > pitch + 2.0 * ROUNDED || hi - self.last > pitch + 2.0 * ROUNDED {
            return Some("a section of the area has room for another line");
        }
        // Chords of a convex outline rise to one highest and fall: sums of them at a distance of one pitch
        // differ from the area by one pitch times the longest at most, and by what is left out in corners.
        let longest = self.reach_along();
        let slack = pitch * (longest + 2.0 * self.short + 2.0 * ROUNDED * self.count as f64);
        let off = (self.length * pitch - area(&self.outline)).abs();
        (off > slack).then_some("the lines times the pitch do not add up to the section's area")
    }

    /// Between which places across the lines a line of the section is long enough.
    fn reach(&self, centre: P2) -> Option<[f64; 2]> {
        let short = self.short;
        let mut places: Vec<f64> = self.outline.iter().map(|&p| self.across(p, centre)).collect();
        places.sort_unstable_by(f64::total_cmp);
        let chords: Vec<(f64, f64)> = places.iter().map(|&o| (o, self.chord(o, centre))).collect();
        // Where the chord between two corners passes the shortest line.
        let passing = |w: &[(f64, f64)]| {
            let ((o0, c0), (o1, c1)) = (w[0], w[1]);
            ((c0 < short) != (c1 < short)).then(|| o0 + (o1 - o0) * (short - c0) / (c1 - c0))
        };
        let long = chords.iter().filter(|c| c.1 >= short).map(|c| c.0);
        let ends = long.chain(chords.windows(2).filter_map(passing));
        ends.fold(None, |r: Option<[f64; 2]>, o| Some(r.map_or([o, o], |[lo, hi]| [lo.min(o), hi.max(o)])))
    }

    /// Length of the line at `offset` across.
    fn chord(&self, offset: f64, centre: P2) -> f64 {
        let along = |p: [f64; 2]| self.direction[0] * p[0] + self.direction[1] * p[1];
        let (mut lo, mut hi) = (f64::INFINITY, f64::NEG_INFINITY);
        for (a, b) in sides(&self.outline) {
            let (oa, ob) = (self.across(a, centre) - offset, self.across(b, centre) - offset);
            let mut meet = |along: f64| (lo, hi) = (lo.min(along), hi.max(along));
            // Corners at this place belong to the line: f64 holds 4 m to 5e-7 nm.
            let is_at = |o: f64| o.abs() < 1e-3;
            if is_at(oa) {
                meet(along(a));
            }
            if is_at(ob) {
                meet(along(b));
            }
            if oa * ob < 0.0 {
                let t = oa / (oa - ob);
                meet(along(a) + t * (along(b) - along(a)));
            }
        }
        (hi - lo).max(0.0)
    }

    /// Extent of the section along its lines.
    fn reach_along(&self) -> f64 {
        let along = self.outline.iter().map(|p| self.direction[0] * p[0] + self.direction[1] * p[1]);
        let (lo, hi) = along.fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), v| (lo.min(v), hi.max(v)));
        (hi - lo).max(0.0)
    }
}

/// The sides of an outline.
fn sides(outline: &[[f64; 2]]) -> impl Iterator<Item = ([f64; 2], [f64; 2])> {
    outline.iter().copied().zip(outline.iter().copied().cycle().skip(1))
}

/// The part of a convex area, counter-clockwise, that lies in a cell: cut at one side of the cell after the other.
fn outline(corners: &[[f64; 2]], cell: Box2) -> Vec<[f64; 2]> {
    let Box2 { lo, hi } = cell;
    // Half-planes: normal and offset.
    let limits = [([1.0, 0.0], lo.x), ([-1.0, 0.0], -hi.x), ([0.0, 1.0], lo.y), ([0.0, -1.0], -hi.y)];
    let mut points = corners.to_vec();
    for (n, limit) in limits {
        let inside = |p: [f64; 2]| n[0] * p[0] + n[1] * p[1] - limit as f64;
        let mut kept = Vec::new();
        for (a, b) in sides(&points) {
            let (ia, ib) = (inside(a), inside(b));
            if ia >= 0.0 {
                kept.push(a);
            }
            if (ia < 0.0) != (ib < 0.0) {
                let t = ia / (ia - ib);
                kept.push([a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])]);
            }
        }
        points = kept;
    }
    points
}

/// How far a point lies inside a convex outline, counter-clockwise; negative outside.
fn depth(outline: &[[f64; 2]], p: [f64; 2]) -> f64 {
    let depths = sides(outline).filter_map(|(a, b)| {
        let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
        let length = math::hypot(dx, dy);
        // Corners that are cut twice are there twice.
        (length > ROUNDED).then(|| (dx * (p[1] - a[1]) - dy * (p[0] - a[0])) / length)
    });
    depths.fold(f64::INFINITY, f64::min)
}

/// Area of an outline, counter-clockwise.
fn area(outline: &[[f64; 2]]) -> f64 {
    let Some(&o) = outline.first() else { return 0.0 };
    let cross = |a: [f64; 2], b: [f64; 2]| (a[0] - o[0]) * (b[1] - o[1]) - (a[1] - o[1]) * (b[0] - o[0]);
    sides(outline).map(|(a, b)| cross(a, b)).sum::<f64>() / 2.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use terrace_core::geom::BoxMm;
    use terrace_core::program::PenId;
    use terrace_input::texture::{self, Kind, Masks, Request};

    const MM: i64 = 1_000_000;

    /// Verdicts on the lines of 50 x 40 mm in sections of 20 mm, after a change to the list of lines.
    fn faults(hundredths: [u16; 6], change: impl FnOnce(&mut Vec<[P2; 2]>)) -> Vec<String> {
        let kind = Kind::Contour { pitch_mm: 1.0, phase: 0.0 };
        let area = texture::Area::Rectangle(BoxMm::rectangle(0.0, 0.0, 50.0, 40.0));
        let request = Request { kind, area, tolerance_mm: 0.001, pen: PenId(0), masks: Masks::default() };
        let mut texture =
            Texture::load(&[request], BoxMm::of([[0.0; 2]]), 0.2, 0.05, &mut Vec::new()).expect("an area");
        let grid = Sections::over(texture.bounds(), [Nm(20 * MM), Nm(30 * MM)], Nm(100), [Nm(0); 2]);
        assert_eq!(grid.count, [3, 2]);
        let directions = Directions { grid, hundredths: hundredths.to_vec() };
        texture.fill(directions.clone()).expect("lines");
        let mut points = Vec::new();
        let lines = (0..texture.len()).map(|i| {
            texture.stroke(i, &mut points);
            [points[0], points[1]]
        });
        let mut lines: Vec<[P2; 2]> = lines.collect();
        change(&mut lines);
        let contour = texture.contours().next().expect("one");
        let area = FilledArea { corners: contour.corners(), pitch: contour.pitch() };
        let mut rule = Rule::new("fill", "");
        let mut found = LineFollower::new(&area, &directions, &mut rule);
        lines.iter().for_each(|l| found.add(l));
        found.finish();
        rule.violations.into_iter().map(|v| v.message).collect()
    }

    #[test]
    fn damaged_lines_are_found() {
        let any = [1234, 9000, 0, 4500, 17_999, 6001];
        assert_eq!(faults(any, |_| ()), Vec::<String>::new());
        let one = |part: &str, change: fn(&mut Vec<[P2; 2]>)| {
            let found = faults(any, change);
            assert!(found.iter().any(|f| f.contains(part)), "{part}: {found:?}");
        };
        one("not a pitch apart", |l| _ = l.remove(8));
        one("not a pitch apart", |l| l.insert(8, l[8]));
        one("not a pitch apart", |l| l[8].iter_mut().for_each(|p| (p.x, p.y) = (p.x - 3, p.y + 14)));
        one("room for another", |l| _ = l.drain(..2));
        one("end on the border", |l| l[8][1] = l[8][0].lerp(l[8][1], 0.9));
        one("end on the border", |l| l[8][1] = l[8][0].lerp(l[8][1], 1.1));
        one("in the direction", |l| l[8][1].y += 5);
        one("holds no line", |l| l.truncate(l.len() / 2));
        one("are not consecutive", |l| {
            let first = l[8];
            l.push(first);
        });
    }

    #[test]
    fn shares_of_the_area_are_measured() {
        let square = [[0.0, 0.0], [10.0, 0.0], [10.0, 10.0], [0.0, 10.0]];
        let cell = Box2 { lo: P2::new(5, -5), hi: P2::new(20, 4) };
        let cut = outline(&square, cell);
        assert_eq!(area(&cut), 20.0);
        assert_eq!(depth(&cut, [7.0, 1.0]), 1.0);
        assert!(depth(&cut, [4.0, 1.0]) < 0.0);
        assert!(outline(&square, Box2 { lo: P2::new(11, 0), hi: P2::new(20, 4) }).is_empty());
    }
}
