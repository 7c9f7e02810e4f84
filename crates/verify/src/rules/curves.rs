//! `curves`: space curves are those of their file, and the surface lies as near to them as the job asks.
//!
//! The file is read by the verifier's own reader (`read::curves`), and each stroke of the texture is held against one
//! of its curves, in the order of the file, to a nanometre in plan. A DXF with entities that this reader does not know
//! has its curves from the texture. Between its points a curve is straight; it is compared with the file's own facets
//! along z, piece by piece, where they may be marked. Stretches along the beam are not compared.

use crate::geometry::{Geometry, Line, Piece, Scratch, Sheet, Slope};
use crate::proof::Rule;
use crate::read::curves::{self, Curve};
use crate::read::manifest::Curves as Stated;
use crate::rotation::Rotation;
use terrace_core::geom::{NM_PER_MM, P2, cos_sin};
use terrace_core::math;
use terrace_input::job::Job;
use terrace_input::texture::{Kind, OnDistance, SpacePoint, Texture};

use super::part_place_nm;
use super::slopes::Sides;
use super::stretch::{Parallel, Parts, Stretch, confirmed_along, note};

/// Points of a stroke lie this near to those of its curve in x and y, nm: both are rounded.
const SAME: i64 = 1;

/// Lengths and distances agree to this share, as docs/explanation/verify.md states.
const SHARE: f64 = 1e-9;

/// A curve that is no wider than this in x and y, nm, may be left out.
const DOT: i64 = 3;

/// Holds the rule `curves` for the textures of a pass, and what the manifest states of their curves by the rule
/// `summary`.
pub(crate) fn check(
    job: &Job,
    texture: &Texture,
    geometry: &Geometry,
    stated: Option<&Stated>,
    [rule, summary]: [&mut Rule; 2],
) {
    rule.ran = true;
    let mut found = search(job, texture, geometry, Sides::Ignored, rule);
    // A curve that broke the rule may have other figures than are stated; its fault is reported already.
    if rule.violated > 0 {
        return;
    }
    if found.is_some() {
        // The figures that `faults` compares.
        summary.checked += 4;
    }
    if !faults(stated, found.as_ref()).is_empty() {
        // Which facet counts along an edge may explain them. The rule `curves` was held above: here it is dropped.
        found = search(job, texture, geometry, Sides::Followed, &mut Rule::new("", ""));
    }
    for fault in faults(stated, found.as_ref()) {
        summary.broken("", "manifest.json", fault);
    }
}

/// Holds all curves to their files and to the surface; returns their figures, if there are any.
fn search(job: &Job, texture: &Texture, geometry: &Geometry, sides: Sides, rule: &mut Rule) -> Option<CurveFigures> {
    let mut found: Option<CurveFigures> = None;
    for (k, of_texture) in texture.curves() {
        let Kind::Curves { path, unit_mm, marking, max_distance, on_distance, .. } = &job.textures[k].kind else {
            continue;
        };
        // None where the verifier's reader does not read the file: the curves are then those of the texture.
        let of_file = curves::read(path, *unit_mm).map(|list| placed(&list, job));
        // `only` and `except` leave curves of the file out; else all are marked.
        let may_skip = !(marking.only.is_empty() && marking.except.is_empty());
        // Invariant: the curves of the file that come after that of the last stroke.
        let mut rest = of_file.as_deref().unwrap_or_default();
        let allowed = (*on_distance == OnDistance::Error).then_some(max_distance.f64());
        let mut curve_search = CurveSearch {
            geometry,
            sides,
            allowed: allowed.unwrap_or(f64::INFINITY),
            found: found.get_or_insert_default(),
            scratch: Scratch::default(),
            lines: Vec::new(),
        };
        let mut points = Vec::new();
        for (i, stroke) in texture.strokes_of(k).enumerate() {
            texture.stroke(stroke, &mut points);
            let element = texture.element(stroke);
            rule.checked += 1;
            let curve: &[SpacePoint] = match &of_file {
                None => of_texture.points(i),
                Some(_) => match rest.iter().position(|curve| is_same(curve, &points)) {
                    Some(place) => {
                        let (skipped, next) = rest.split_at(place);
                        if !may_skip && skipped.iter().any(|curve| has_extent(curve)) {
                            rule.broken("", &element, "a curve of the file before it is not marked");
                        }
                        rest = &next[1..];
                        &next[0]
                    }
                    None => {
                        // Those after it could be found among what is left, or not: one fault is reported.
                        rule.broken("", &element, "it is not a curve of its file");
                        break;
                    }
                },
            };
            curve_search.curve(curve, &element, rule);
        }
        if !may_skip && rule.violated == 0 && rest.iter().any(|curve| has_extent(curve)) {
            rule.broken("", path.display().to_string(), "a curve at the end of the file is not marked");
        }
    }
    found
}

/// The faults of the figures that the manifest states.
fn faults(stated: Option<&Stated>, found: Option<&CurveFigures>) -> Vec<String> {
    let (stated, found) = match (stated, found) {
        (Some(stated), Some(found)) => (stated, found),
        (None, None) => return Vec::new(),
        _ => return vec!["it states space curves that the job does not have, or leaves them out".into()],
    };
    let mm = |nm: f64| nm / NM_PER_MM;
    let um = |nm: f64| nm / 1e3;
    let doubt_in_plan = mm(found.doubt);
    // A length in plan is longer on the surface, by the steepest ratio at most.
    let doubt_on_surface = doubt_in_plan * found.steepest + mm(found.rounding);
    let distance_tolerance = um(found.tolerance) + SHARE * um(found.farthest);
    let (plan, surface) = (mm(found.plan), mm(found.surface));
    let distances = [um(found.surely), um(found.farthest)];
    [
        figure_fault("count", stated.count as f64, [found.count as f64; 2], 0.0),
        figure_fault("plan_mm", stated.plan_mm, [plan; 2], doubt_in_plan + SHARE * plan),
        figure_fault("surface_mm", stated.surface_mm, [surface; 2], doubt_on_surface + SHARE * surface),
        figure_fault("worst_distance_um", stated.worst_distance_um, distances, distance_tolerance),
    ]
    .into_iter()
    .flatten()
    .collect()
}

/// The fault of a stated figure that should lie between two values, to a tolerance; a NaN is one.
fn figure_fault(name: &str, stated: f64, [lo, hi]: [f64; 2], tolerance: f64) -> Option<String> {
    let is_near = lo - tolerance <= stated && stated <= hi + tolerance; // never of a NaN
    (!is_near).then(|| format!("curves.{name} is given as {stated}, but is {lo} to {hi}"))
}

/// Curves in the turned part frame.
fn placed(list: &[Curve], job: &Job) -> Vec<Vec<SpacePoint>> {
    let [c, s] = cos_sin(job.placement.turn.as_rad());
    let rotation = job.placement.laid.map(|laid| Rotation::new(&laid));
    let nm = |mm: f64| (mm * NM_PER_MM).round() as i64;
    let point = |p: &[f64; 3]| {
        let [x, y, z] = rotation.as_ref().map_or(*p, |rotation| rotation.point(*p));
        SpacePoint { at: P2::new(nm(c * x - s * y), nm(s * x + c * y)), z: z * NM_PER_MM }
    };
    list.iter().map(|curve| curve.iter().map(point).collect()).collect()
}

/// Whether a curve is wide enough in plan to be a stroke.
fn has_extent(curve: &[SpacePoint]) -> bool {
    let first = curve.first().map_or(P2::new(0, 0), |p| p.at);
    curve.iter().any(|p| (p.at.x - first.x).abs() > DOT || (p.at.y - first.y).abs() > DOT)
}

/// Whether a stroke has the points of a curve, those above each other and repeated ones once.
fn is_same(curve: &[SpacePoint], stroke: &[P2]) -> bool {
    let is_near = |a: P2, b: P2| (a.x - b.x).abs() <= SAME && (a.y - b.y).abs() <= SAME;
    // The points of the stroke before `next` are those of the curve so far.
    let mut next = 0;
    for (i, p) in curve.iter().enumerate() {
        if i > 0 && curve[i - 1].at == p.at {
            continue;
        }
        // Of neighbours a nanometre apart rounding may leave one.
        match stroke.get(next) {
            Some(&q) if is_near(p.at, q) => next += 1,
            _ if next > 0 && is_near(p.at, stroke[next - 1]) => {}
            _ => return false,
        }
    }
    next == stroke.len()
}

/// Figures of all curves, nm.
#[derive(Default)]
struct CurveFigures {
    count: usize,
    plan: f64,
    surface: f64,
    /// How far `plan` may be off: borders of the part and of what is too steep.
    doubt: f64,
    /// How far heights off by rounding may change `surface`.
    rounding: f64,
    /// Largest length on the surface for one in plan.
    steepest: f64,
    /// Largest distance that was met, and the largest that rounding does not explain.
    farthest: f64,
    surely: f64,
    /// How far these may be off.
    tolerance: f64,
}

/// Follows curves over the surface.
struct CurveSearch<'a> {
    geometry: &'a Geometry,
    sides: Sides,
    /// Largest distance that the job allows.
    allowed: f64,
    found: &'a mut CurveFigures,
    scratch: Scratch,
    /// The segments of the curve at hand.
    lines: Vec<Line>,
}

/// The heights of a segment of a curve: at its start, and how much it rises for 1 along it.
#[derive(Clone, Copy)]
struct SlantedLine {
    z: f64,
    rise: f64,
}

impl SlantedLine {
    /// Distances above the sheet at both ends of a piece of a line that begins `from` along the segment.
    fn above(&self, p: &Piece, sheet: &Sheet, from: f64) -> [f64; 2] {
        [0, 1].map(|k| self.z + self.rise * (from + p.d[k]) - sheet.z[k])
    }
}

impl CurveSearch<'_> {
    /// Follows a curve, and reports where it lies too far from the surface.
    fn curve(&mut self, curve: &[SpacePoint], element: &str, rule: &mut Rule) {
        self.found.count += 1;
        self.lines.clear();
        let mut heights: Vec<SlantedLine> = Vec::new();
        let mut far: Vec<Stretch> = Vec::new();
        for w in curve.windows(2).filter(|w| w[0].at != w[1].at) {
            let line = Line::new(nm(w[0].at), nm(w[1].at));
            let slanted = SlantedLine { z: w[0].z, rise: (w[1].z - w[0].z) / line.len };
            self.segment(&line, slanted, &mut far);
            self.lines.push(line);
            heights.push(slanted);
        }
        if far.is_empty() {
            return;
        }
        let (geometry, lines, allowed) = (self.geometry, &self.lines, self.allowed);
        let too_far = |p: &Piece, parallel: Parallel| match &p.sheet {
            Some(s) if s.slope == Slope::Gentle => {
                let above = heights[parallel.segment].above(p, s, parallel.from);
                beyond(p.d, above, allowed + geometry.z_tolerance(s.slope2))
            }
            _ => [[0.0; 2]; 2],
        };
        let runs = confirmed_along(&far, geometry, &mut self.scratch, |i| lines[i], too_far);
        if let Some(s) = runs.first().and_then(|r| r.stretches.first()) {
            let length: f64 = runs.iter().map(|r| r.len).sum();
            let text = format!(
                "{:.6} mm of {element} lie farther than {:.6} mm from the surface",
                length / NM_PER_MM,
                allowed / NM_PER_MM
            );
            rule.broken("", part_place_nm(lines[s.segment].at(s.d[0])), text);
        }
    }

    /// Follows one segment, and notes in `far`, as segment number `lines.len()`, where it is too far from the surface.
    fn segment(&mut self, line: &Line, slanted: SlantedLine, far: &mut Vec<Stretch>) {
        let (geometry, allowed, number) = (self.geometry, self.allowed, self.lines.len());
        let grain = geometry.grain();
        let found = &mut *self.found;
        let mut worst: Option<([f64; 2], f64)> = None;
        let (mut off, mut doubtful) = (0, 0.0);
        geometry.along(line, &mut self.scratch, |p| {
            let Some(sheet) = p.sheet.filter(|s| s.slope != Slope::Steep) else {
                off += 1;
                return;
            };
            let stretched = math::hypot(p.len(), sheet.z[1] - sheet.z[0]);
            found.plan += p.len();
            found.surface += stretched;
            let tolerance = geometry.z_tolerance(sheet.slope2);
            // The length on the surface changes with the rise by rise over length, and both ends of the piece may be
            // higher or lower by the tolerance.
            found.rounding += 2.0 * tolerance * (sheet.z[1] - sheet.z[0]).abs() / stretched.max(1.0);
            found.steepest = found.steepest.max((1.0 + sheet.slope2).sqrt());
            if sheet.slope == Slope::Doubtful {
                doubtful += p.len();
                return;
            }
            let above = slanted.above(&p, &sheet, 0.0);
            let distance = above[0].abs().max(above[1].abs());
            found.tolerance = found.tolerance.max(tolerance);
            found.farthest = found.farthest.max(distance);
            if distance > found.surely && p.len() > grain && worst.is_none_or(|w| distance > w.1) {
                worst = Some((p.d, distance));
            }
            for d in beyond(p.d, above, allowed + tolerance).into_iter().filter(|d| d[0] < d[1]) {
                note(far, number, d, line.len);
            }
        });
        if let Some((d, distance)) = worst {
            let sure = self.surely(line, d, slanted).min(distance);
            self.found.surely = self.found.surely.max(sure);
        }
        // Both ends of each stretch that is left out are known to the grain.
        self.found.doubt += 2.0 * grain * f64::from(off);
        if self.sides == Sides::Followed {
            let reach = self.geometry.reach();
            let [here, left, right] = [0.0, reach, -reach].map(|side| self.beside(line, side, slanted));
            self.found.doubt += (left - here).abs().max((right - here).abs());
        }
        // Near the limit of slopes rounding decides.
        self.found.doubt += doubtful;
    }

    /// How much of a line at a distance from its own may be marked, nm; what lies there is met.
    fn beside(&mut self, line: &Line, side: f64, slanted: SlantedLine) -> f64 {
        let (mut sum, mut farthest) = (0.0, 0.0f64);
        self.geometry.along(&line.part([0.0, line.len], side), &mut self.scratch, |p| {
            let Some(sheet) = p.sheet.filter(|s| s.slope != Slope::Steep) else { return };
            sum += p.len();
            let above = slanted.above(&p, &sheet, 0.0);
            farthest = farthest.max(above[0].abs()).max(above[1].abs());
        });
        self.found.farthest = self.found.farthest.max(farthest);
        sum
    }

    /// The least of the largest distances on a stretch and on parallels on both sides.
    fn surely(&mut self, line: &Line, d: [f64; 2], slanted: SlantedLine) -> f64 {
        let reach = self.geometry.reach();
        let mut least = f64::INFINITY;
        for side in [reach, -reach] {
            let mut largest = 0.0f64;
            self.geometry.along(&line.part(d, side), &mut self.scratch, |p| {
                if let Some(s) = &p.sheet {
                    let above = slanted.above(&p, s, d[0]);
                    largest = largest.max(above[0].abs()).max(above[1].abs());
                }
            });
            least = least.min(largest);
        }
        least
    }
}

fn nm(p: P2) -> [f64; 2] {
    [p.x as f64, p.y as f64]
}

/// Where a piece over `d` on which the distance runs evenly from one value to the other is farther than `limit`.
fn beyond(d: [f64; 2], above: [f64; 2], limit: f64) -> Parts {
    if above[0].abs() <= limit && above[1].abs() <= limit {
        return [[0.0; 2]; 2];
    }
    let place_of = |value: f64| {
        let share = (value - above[0]) / (above[1] - above[0]);
        if share.is_finite() { d[0] + share.clamp(0.0, 1.0) * (d[1] - d[0]) } else { d[0] }
    };
    if above[0] == above[1] {
        return [d, [0.0; 2]];
    }
    // Within the limit between the places where the distance is -limit and limit.
    let (first, last) =
        if above[0] < above[1] { (place_of(-limit), place_of(limit)) } else { (place_of(limit), place_of(-limit)) };
    [[d[0], first], [last, d[1]]]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::job_facts;
    use terrace_input::job::Overrides;

    const PLANE: &str = "v 0 0 0\nv 20 0 2\nv 20 20 2\nv 0 20 0\nf 1 2 3\nf 1 3 4\n";
    /// On the plane, and 30 um above it.
    const CURVES: &str = "id,x,y,z\na,2,3,0.2\na,12,3,1.2\na,12,5,1.2\nb,4,9,0.43\nb,9,9,0.93\n";

    /// What the rules `curves` and `summary` find where the file of the curves changes after they were placed.
    fn found(after: &str, keys: &str, stated: Option<&Stated>) -> [Rule; 2] {
        found_in("c.csv", CURVES, after, keys, stated)
    }

    fn found_in(name: &str, before: &str, after: &str, keys: &str, stated: Option<&Stated>) -> [Rule; 2] {
        let folder = tempfile::tempdir().expect("a folder");
        let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).expect("written");
        write("plane.obj", PLANE);
        write(name, before);
        let text = format!(
            "surface = {{ file = \"plane.obj\", unit = \"mm\" }}\nfocus = {{ pdof = \"0.1 mm\" }}\n\
             placement = {{ turn = \"90 deg\" }}\nmachine = {{ profile = \"xyz-galvo-40\" }}\n\
             [[texture]]\ncurves = \"{name}\"\nunit = \"mm\"\n{keys}\n\
             [[pen]]\nname = \"p\"\nspeed = \"100 mm/s\"\npower = \"5 %\"\nfrequency = \"60 kHz\"\n"
        );
        let job = Job::parse(&folder.path().join("job.toml"), &text, &Overrides::default()).expect("a job");
        let (shape, area) = job_facts::shape(&job).expect("a surface");
        let geometry = Geometry::new(shape, 1.0, 1.0);
        let turn = job.placement.turn.as_rad();
        let texture = Texture::load(&job.textures, area, turn, 0.03, &mut Vec::new()).expect("a texture");
        write(name, after);
        let mut rules = [Rule::new("curves", ""), Rule::new("summary", "")];
        let [curves, summary] = &mut rules;
        check(&job, &texture, &geometry, stated, [curves, summary]);
        rules
    }

    fn stated() -> Stated {
        let plan_mm = 17.0;
        Stated { count: 2, plan_mm, surface_mm: 15.0 * 1.01f64.sqrt() + 2.0, worst_distance_um: 30.0 }
    }

    #[test]
    fn curves_of_a_file_verify_with_their_figures() {
        let [curves, summary] = found(CURVES, "", Some(&stated()));
        assert_eq!((curves.checked, curves.violated), (2, 0), "{:?}", curves.violations);
        assert_eq!((summary.checked, summary.violated), (4, 0), "{:?}", summary.violations);
        let crlf = CURVES.replace(',', ";").replace('\n', "\r\n# a comment\r\n");
        assert_eq!(found(&crlf, "", Some(&stated()))[0].violated, 0);
        let [curves, _] = found(CURVES, "except = [\"id:a\"]", None);
        assert_eq!((curves.checked, curves.violated), (1, 0));
    }

    #[test]
    fn curves_that_differ_from_their_file_or_lie_off_the_surface_are_found() {
        for (after, keys, says) in [
            (CURVES.replace("a,12,3,1.2", "a,12,3.000003,1.2"), "", "not a curve of its file"),
            (CURVES.replace("b,9,9,0.93\n", ""), "", "not a curve of its file"),
            (CURVES.to_owned() + "c,4,9,0.4\nc,5,9,0.5\n", "", "at the end of the file is not marked"),
            (CURVES.replace("b,4", "c,1,1,0.1\nc,2,1,0.2\nb,4"), "", "before it is not marked"),
            (CURVES.replace("0.93", "0.96"), "", " of texture 1, curve b (line 5) lie farther"),
            (CURVES.replace("a,12,5,1.2", "a,12,5,1.1499"), "", "farther than 0.05"),
            (CURVES.to_owned(), "max_distance = \"29 um\"", "5.000000 mm of texture 1, curve b (line 5)"),
            ("nothing\n".to_owned() + CURVES, "", ""),
        ] {
            let [rule, _] = found(&after, keys, None);
            let all: Vec<&str> = rule.violations.iter().map(|v| v.message.as_str()).collect();
            assert!(says.is_empty() || all.iter().any(|m| m.contains(says)), "{after}: {all:?}");
        }
        // What the job allows by a warning is not a violation.
        let lifted = CURVES.replace("0.93", "0.99");
        assert_eq!(found(&lifted, "on_distance = \"warn\"", None)[0].violated, 0);
    }

    #[test]
    fn figures_that_are_not_those_of_the_curves_are_found() {
        let one = stated();
        for wrong in [
            Stated { count: 3, ..one.clone() },
            Stated { plan_mm: one.plan_mm + 1e-4, ..one.clone() },
            Stated { surface_mm: one.plan_mm, ..one.clone() },
            Stated { worst_distance_um: 29.98, ..one.clone() },
            Stated { worst_distance_um: 30.02, ..one },
        ] {
            assert_eq!(found(CURVES, "", Some(&wrong))[1].violated, 1, "{wrong:?}");
        }
        assert_eq!(found(CURVES, "", None)[1].violated, 1, "none are stated");
    }

    #[test]
    fn lines_and_polylines_of_a_dxf_are_read_and_other_entities_come_from_the_texture() {
        let file = |tags: &str| {
            let body: String = tags.split_whitespace().map(|t| format!("{t}\n")).collect();
            format!("0\nSECTION\n2\nENTITIES\n{body}0\nENDSEC\n0\nEOF\n")
        };
        let line = "0 LINE 8 L 10 2 20 3 30 0.2 11 12 21 3 31 1.2";
        let closed = "0 POLYLINE 8 L 66 1 70 9 0 VERTEX 8 L 10 2 20 5 30 0.2 0 VERTEX 8 L 10 4 20 5 30 0.4 \
                      0 VERTEX 8 L 10 4 20 7 30 0.4 0 SEQEND";
        let level = "0 LWPOLYLINE 8 L 90 2 70 0 38 0.5 10 5 20 1 10 5 20 9";
        let all = file(&format!("{line} {closed} {level}"));
        let of = |after: &str| found_in("c.dxf", &all, after, "", None).into_iter().next().expect("a rule");
        let rule = of(&all);
        assert_eq!((rule.checked, rule.violated), (3, 0), "{:?}", rule.violations);
        for (from, to) in [("11\n12\n", "11\n12.00001\n"), ("30\n0.4\n", "30\n0.5\n"), ("38\n0.5\n", "38\n0.56\n")] {
            assert!(all.contains(from) && of(&all.replacen(from, to, 1)).violated > 0, "{from:?}");
        }
        // A circle is not read here: what was placed is compared with the surface all the same.
        let circle = all.replace("0\nENDSEC", "0\nCIRCLE\n8\nL\n10\n5\n20\n15\n30\n0.5\n40\n0.3\n0\nENDSEC");
        let rule = found_in("c.dxf", &circle, &circle, "", None).into_iter().next().expect("a rule");
        assert_eq!((rule.checked, rule.violated), (4, 0), "{:?}", rule.violations);
    }
}
