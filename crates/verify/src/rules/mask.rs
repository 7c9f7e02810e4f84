//! `mask`: what `inside` and `outside` leave of a texture is marked, and nothing else.
//!
//! The drawing of the area is read by the verifier's own readers (`read::picture`, `read::outline`) and placed by its
//! own arithmetic ([`Page`]). The strokes before they are cut are the texture's. Of these and of the pieces at most
//! [`MAX_STROKES`] are looked at, evenly: at three places of each piece, which must not lie beyond the border, and at
//! [`PLACES`] or more of each whole stroke, which must be marked where they lie within it.
//!
//! With a soft border strokes may be left out up to its width. How many are is compared with c(d) = min(d / w, 1), by
//! one random place of each stroke, as strokes are left out independently: the sum of marked - c(d) over all places has
//! the variance c (1 - c) of each, and must not be more than [`SIGMAS`] deviations off.

use super::drawing::{F32, PlacedTextures, samples};
use super::drawing_files::{Content, Files};
use super::page::{Page, Site};
use crate::Drawing;
use crate::proof::Rule;
use crate::read::labels::Truth;
use crate::read::outline::Outline;
use terrace_core::geom::{P2, PlanePoint};
use terrace_core::math;
use terrace_input::texture::{Kind, Mask, Request, Uncut};

/// Most strokes of a texture that are looked at, as docs/explanation/verify.md states.
const MAX_STROKES: u64 = 30_000;

/// Places of a whole stroke at least, and of all strokes together.
const PLACES: u64 = 8;
const ALL_PLACES: u64 = 6_000;

/// Most sides that are gone through for the places of a stroke.
const MAX_SIDES: u64 = 5_000_000;

/// A place is marked where a piece is this near, nm: its ends are rounded to the grid.
const ON_PIECE: f64 = 2.0;

/// How far from its mean the number of marked places in a soft border may be, in standard deviations: of a normal
/// distribution one in 5 x 10^8 lies farther off.
const SIGMAS: f64 = 6.0;

/// The fewest places in a soft border whose number is compared, as docs/explanation/verify.md states.
const FEWEST: usize = 200;

/// Holds the rule for the textures of a pass.
pub(crate) fn check(placed: &PlacedTextures<'_>, files: &mut Files, rule: &mut Rule) {
    let PlacedTextures { job, texture, drawing, site } = placed;
    rule.ran = true;
    for (number, request) in job.textures.iter().enumerate() {
        let Some(uncut) = texture.uncut(number) else {
            if request.masks.list().next().is_some() {
                rule.checked += 1;
                rule.broken("", format!("texture {}", number + 1), "inside or outside do not cut it");
            }
            continue;
        };
        let mut borders = Vec::new();
        for (key, mask) in request.masks.list() {
            let Kind::Drawing { path, .. } = &mask.drawing else { continue };
            match files.get(path) {
                Ok(Content::Bitmap(_)) => rule.leaves_out(path, number, "only drawings are masks"),
                Ok(Content::Picture(picture)) if !picture.unread.is_empty() => {
                    picture.unread.iter().for_each(|why| rule.leaves_out(path, number, why));
                }
                Ok(Content::Picture(_)) => borders.push((path, key == "inside", mask)),
                Err(why) => rule.leaves_out(path, number, why),
            }
        }
        let known = borders.iter().filter_map(|&(path, keeps_inside, mask)| {
            let picture = files.picture(path)?;
            match MaskBorder::new(picture, mask, keeps_inside, request.tolerance_mm, site) {
                Ok(border) => Some(border),
                Err(why) => {
                    rule.leaves_out(path, number, why);
                    None
                }
            }
        });
        let borders: Vec<MaskBorder<'_>> = known.collect();
        // Where one of two is not known, nothing has to be marked, and what lies beyond the other must not be.
        let is_whole = borders.len() == request.masks.list().count();
        let limits = MaskBorders { borders, soft: request.masks.soft_mm };
        limits.pieces(drawing, texture.strokes_of(number), rule);
        if is_whole {
            limits.strokes(drawing, uncut, number, request, rule);
        }
    }
}

/// The border of `inside` or `outside`.
struct MaskBorder<'a> {
    outline: Outline<'a>,
    page: Page,
    keeps_inside: bool,
    /// How near to it nothing is decided, mm.
    slack: f64,
}

/// On which side of the border a point lies.
#[derive(Clone, Copy, Debug, PartialEq)]
enum MaskSide {
    /// Within what is kept, this far from the border or farther, mm.
    Kept(f64),
    /// Too near to tell.
    Border,
    Lost,
}

impl<'a> MaskBorder<'a> {
    fn new(
        picture: &'a crate::read::picture::Picture,
        mask: &Mask,
        keeps_inside: bool,
        tolerance: f64,
        site: &Site,
    ) -> Result<Self, &'static str> {
        let page = Page::new(&mask.drawing, &mask.area, site, picture.sides_mm()).ok_or("it is not a drawing")?;
        let scale = [0, 1].map(|k| page.size[k] / picture.size[k]);
        let name = mask.name.as_deref();
        let is_meant = |l: &str| Some(l) == name || l.split_once(':').is_some_and(|(_, own)| Some(own) == name);
        let having = picture.labels.having(is_meant);
        let counts = |element: u32| match (name, having.has(element)) {
            (None, _) | (_, Truth::Yes) => Some(true),
            (_, Truth::No) => Some(false),
            (_, Truth::Maybe) => None,
        };
        let slack = 2.0 * tolerance + page.size[0].max(page.size[1]) * F32 + picture.slack * scale[0].max(scale[1]);
        let outline = Outline::new(picture, &counts, scale, slack)?;
        Ok(Self { outline, page, keeps_inside, slack })
    }

    /// The side of a point, nm.
    fn side(&self, p: PlanePoint) -> MaskSide {
        let at = self.on_page(p);
        let away = self.distance(at);
        if away <= self.slack {
            MaskSide::Border
        } else if self.outline.holds(at) == self.keeps_inside {
            MaskSide::Kept(away)
        } else {
            MaskSide::Lost
        }
    }

    fn distance(&self, at: PlanePoint) -> f64 {
        let edge = self.outline.nearest_edge(at);
        edge.map_or(f64::INFINITY, |e| math::hypot(e[0] - at[0], e[1] - at[1]))
    }

    /// Where a point lies on the page, y down.
    fn on_page(&self, p: PlanePoint) -> PlanePoint {
        let [x, y] = self.page.at(p);
        [x, self.page.size[1] - y]
    }

    /// Whether the edge nearest to a point is the border there, and not one within the area.
    fn is_at_border(&self, p: PlanePoint) -> bool {
        let at = self.on_page(p);
        let Some(edge) = self.outline.nearest_edge(at) else { return false };
        let away = self.distance(at);
        let beyond = [0, 1].map(|k| edge[k] + (edge[k] - at[k]) / away * 2.0 * self.slack);
        self.outline.holds(beyond) != self.keeps_inside
    }
}

/// All borders of a texture.
struct MaskBorders<'a> {
    borders: Vec<MaskBorder<'a>>,
    /// Width over which marks fade, mm.
    soft: f64,
}

impl MaskBorders<'_> {
    fn side(&self, p: PlanePoint) -> MaskSide {
        self.borders.iter().map(|b| b.side(p)).fold(MaskSide::Kept(f64::INFINITY), |all, side| match (all, side) {
            (MaskSide::Lost, _) | (_, MaskSide::Lost) => MaskSide::Lost,
            (MaskSide::Border, _) | (_, MaskSide::Border) => MaskSide::Border,
            (MaskSide::Kept(a), MaskSide::Kept(b)) => MaskSide::Kept(a.min(b)),
        })
    }

    /// Holds that nothing is marked beyond the border.
    fn pieces(&self, drawing: &Drawing<'_>, strokes: std::ops::Range<usize>, rule: &mut Rule) {
        let stride = strokes.len().div_ceil(MAX_STROKES as usize).max(1);
        let mut points = Vec::new();
        for i in strokes.step_by(stride) {
            (drawing.stroke)(i, &mut points);
            for p in samples(&points) {
                rule.checked += 1;
                if self.side(p) == MaskSide::Lost {
                    let text = "it is marked beyond the border of inside or outside";
                    rule.broken("", format!("{}, {}", (drawing.element)(i), super::part_place_nm(p)), text);
                }
            }
        }
    }

    /// Holds that strokes are marked within the border.
    fn strokes(&self, drawing: &Drawing<'_>, uncut: Uncut<'_>, number: usize, request: &Request, rule: &mut Rule) {
        let stride = uncut.len().div_ceil(MAX_STROKES).max(1);
        let mut fade = Fade::default();
        let (mut points, mut pieces) = (Vec::new(), Vec::new());
        for i in (0..uncut.len()).step_by(stride as usize) {
            uncut.stroke(i, &mut points);
            pieces.clear();
            let mut piece = Vec::new();
            for k in uncut.pieces(i) {
                (drawing.stroke)(k, &mut piece);
                pieces.push(std::mem::take(&mut piece));
            }
            let is_marked = |p: PlanePoint| pieces.iter().any(|piece| is_on(piece, p));
            // Each place is looked for on all sides of the pieces: of a stroke of many sides fewer places are.
            let sides: u64 = pieces.iter().map(|p| p.len() as u64).sum::<u64>() + 1;
            let most = (MAX_SIDES / sides).clamp(1, ALL_PLACES);
            let count = (ALL_PLACES / uncut.len()).clamp(PLACES, most.max(PLACES));
            for p in places(&points, count as usize) {
                rule.checked += 1;
                // In a soft border the stroke may be left out.
                let has_to = matches!(self.side(p), MaskSide::Kept(d) if d > self.soft + self.slack());
                if has_to && !is_marked(p) {
                    let text = "the texture is not marked within the border of inside or outside";
                    rule.broken("", format!("texture {}, {}", number + 1, super::part_place_nm(p)), text);
                }
            }
            if self.soft > 0.0 {
                fade.add(self, &points, request.masks.seed ^ i, is_marked);
            }
        }
        if let Some(fault) = fade.fault() {
            rule.broken("", format!("texture {}", number + 1), fault);
        }
    }

    fn slack(&self) -> f64 {
        self.borders.iter().map(|b| b.slack).fold(0.0, f64::max)
    }
}

/// Places in a soft border.
#[derive(Default)]
struct Fade {
    count: usize,
    /// Sum of marked - c, and of c (1 - c).
    off: f64,
    variance: f64,
}

impl Fade {
    /// Looks at one place of a stroke in the soft border, if it has one.
    fn add(&mut self, limits: &MaskBorders<'_>, points: &[P2], number: u64, is_marked: impl Fn(PlanePoint) -> bool) {
        let depth = |p: PlanePoint| match limits.side(p) {
            MaskSide::Kept(d) if d < limits.soft => Some(d),
            _ => None,
        };
        let near: Vec<(PlanePoint, f64)> = places(points, 64).filter_map(|p| Some((p, depth(p)?))).collect();
        if near.is_empty() {
            return;
        }
        // Any choice that does not look at what is marked: hashing by 2^64 over the golden ratio spreads the numbers.
        let (p, d) = near[(number.wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 33) as usize % near.len()];
        // An edge within the area may be nearer than its border: there the distance to it is not the depth.
        if !limits.borders.iter().all(|b| b.distance(b.on_page(p)) > d || b.is_at_border(p)) {
            return;
        }
        let share = d / limits.soft;
        self.count += 1;
        self.off += f64::from(u8::from(is_marked(p))) - share;
        self.variance += share * (1.0 - share);
    }

    fn fault(&self) -> Option<String> {
        let is_off = self.count >= FEWEST && self.off.abs() > SIGMAS * self.variance.sqrt();
        is_off.then(|| {
            let Self { count, off, variance } = self;
            let most = SIGMAS * variance.sqrt();
            format!("of {count} places in the soft border {off:+.0} more are marked than expected, which is more than {most:.0} off")
        })
    }
}

/// Places of a stroke, evenly along it; of a dot its point.
fn places(points: &[P2], count: usize) -> impl Iterator<Item = PlanePoint> + '_ {
    let point = |p: P2| [p.x as f64, p.y as f64];
    let total: f64 = points.windows(2).map(|w| w[0].distance(w[1])).sum();
    let (mut k, mut before) = (0, 0.0);
    let dot = points.first().filter(|_| points.len() == 1).map(|&p| point(p));
    let along = (0..if total > 0.0 { count } else { 0 }).map(move |i| {
        let s = (i as f64 + 0.5) / count as f64 * total;
        while k + 2 < points.len() && before + points[k].distance(points[k + 1]) < s {
            before += points[k].distance(points[k + 1]);
            k += 1;
        }
        let (a, b) = (point(points[k]), point(points[k + 1]));
        let t = (s - before) / points[k].distance(points[k + 1]);
        [a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])]
    });
    dot.into_iter().chain(along)
}

/// Whether a point lies on a polyline.
fn is_on(line: &[P2], [x, y]: PlanePoint) -> bool {
    let from_point = |p: P2| [p.x as f64 - x, p.y as f64 - y];
    if let [dot] = line {
        let [dx, dy] = from_point(*dot);
        return math::hypot(dx, dy) <= ON_PIECE;
    }
    line.windows(2).any(|w| {
        let (a, b) = (from_point(w[0]), from_point(w[1]));
        let d = [b[0] - a[0], b[1] - a[1]];
        let t = -(a[0] * d[0] + a[1] * d[1]) / (d[0] * d[0] + d[1] * d[1]);
        let t = t.clamp(0.0, 1.0);
        math::hypot(a[0] + t * d[0], a[1] + t * d[1]) <= ON_PIECE
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use terrace_core::geom::{BoxMm, NM_PER_MM};
    use terrace_input::job::{Job, Overrides};
    use terrace_input::texture::Texture;

    const MASK: &str = "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"40mm\" height=\"30mm\" viewBox=\"0 0 40 30\">\
        <g id=\"area\"><circle cx=\"15\" cy=\"14\" r=\"11\"/><path fill=\"none\" stroke=\"#000\" \
        d=\"M24 4h12v20h-12zM26 8v6h6V8z\"/></g><rect id=\"hole\" fill=\"white\" x=\"12\" y=\"12\" width=\"5\" height=\"5\"/>\
        <rect id=\"off\" x=\"1\" y=\"1\" width=\"2\" height=\"2\"/></svg>";

    /// What the rule finds of a texture with masks, whose strokes and files are changed after it was placed.
    fn found(keys: &str, other: &str, change: impl Fn(&Texture, usize, &mut Vec<P2>)) -> Rule {
        let folder = tempfile::tempdir().expect("a folder");
        let mask = folder.path().join("m.svg");
        std::fs::write(&mask, MASK).expect("written");
        let text = format!(
            "surface = {{ file = \"x.stl\", unit = \"mm\" }}\nfocus = {{ pdof = \"0.1 mm\" }}\n\
             machine = {{ profile = \"xyz-galvo-40\" }}\n[[texture]]\n{keys}\n\
             [[pen]]\nname = \"a\"\nspeed = \"100 mm/s\"\npower = \"5 %\"\nfrequency = \"60 kHz\"\ndwell = \"1 ms\"\n"
        );
        let job = Job::parse(&folder.path().join("job.toml"), &text, &Overrides::default()).expect("a job");
        let part_box = BoxMm::rectangle(0.0, 0.0, 50.0, 40.0);
        let site = Site { part_box, turn_rad: 0.3 };
        let texture = Texture::load(&job.textures, part_box, 0.3, 0.03, &mut Vec::new()).expect("a texture");
        std::fs::write(&mask, other).expect("written");
        let drawing = Drawing {
            stroke: Box::new(|i, out| {
                let pen = texture.stroke(i, out);
                change(&texture, i, out);
                pen
            }),
            ..Drawing::from_texture(&texture)
        };
        let mut rule = Rule::new("mask", "");
        let placed = PlacedTextures { job: &job, texture: &texture, drawing: &drawing, site };
        check(&placed, &mut Files::default(), &mut rule);
        rule
    }

    const HATCH: &str = "pattern = \"hatch\"\npitch = \"0.5 mm\"\ndirection = \"30 deg\"\n";

    fn kinds() -> Vec<String> {
        let squares = "pattern = \"squares\"\npitch = \"1 mm\"\ncell = \"0.7 mm\"\n";
        let dots = "pattern = \"poisson\"\npitch = \"0.8 mm\"\n";
        let placed = "inside = { file = \"m.svg#area\", fit = \"contain\", align = \"right top\", turn = \"10 deg\", mirror = \"x\" }";
        let origin =
            "outside = { file = \"m.svg#id:area\", origin = [\"3 mm\", \"5 mm\"], scale = 0.8, turn = \"-20 deg\" }";
        let both = "inside = \"m.svg#area\"\noutside = \"m.svg#hole\"\n";
        let soft = "soft = \"2 mm\"\nseed = 5";
        let mut all: Vec<String> = Vec::new();
        for pattern in [HATCH, squares, dots] {
            all.extend([placed, origin, both].map(|mask| format!("{pattern}{mask}")));
        }
        all.extend([both, placed].map(|mask| format!("{HATCH}{mask}\n{soft}")));
        all.push(format!("{dots}{both}{soft}"));
        all.push("pattern = \"hilbert\"\norder = 4\ninside = \"m.svg#area\"".into());
        all
    }

    #[test]
    fn a_mask_holds_and_does_not_once_its_circle_is_smaller() {
        let keys = &kinds()[2];
        let rule = found(keys, MASK, |_, _, _| {});
        assert!(rule.violated == 0 && rule.left_out.is_empty() && rule.checked > 200, "{keys}: {rule:?}");
        assert!(found(keys, &MASK.replacen("r=\"11\"", "r=\"10.8\"", 1), |_, _, _| {}).violated > 0, "{keys}");
    }

    #[test]
    #[ignore = "slow: make test-all"]
    fn sound_masks_hold() {
        for keys in kinds() {
            let rule = found(&keys, MASK, |_, _, _| {});
            assert!(
                rule.violated == 0 && rule.left_out.is_empty(),
                "{keys}: {:?} {:?}",
                rule.violations,
                rule.left_out
            );
            assert!(rule.checked > 200, "{keys}: {}", rule.checked);
        }
    }

    #[test]
    #[ignore = "slow: make test-all"]
    fn a_mask_that_lies_or_looks_otherwise_is_found() {
        // Where a soft border lies is seen by numbers alone, and not by few strokes.
        for keys in kinds().into_iter().filter(|keys| !keys.contains("soft")) {
            for (from, to) in [("r=\"11\"", "r=\"10.8\""), ("viewBox=\"0 0", "viewBox=\"0.2 0")] {
                let rule = found(&keys, &MASK.replacen(from, to, 1), |_, _, _| {});
                assert!(rule.violated > 0, "{keys} {to}");
            }
        }
        let keys = format!("{HATCH}inside = \"m.svg#area\"");
        for (from, to) in [("cx=\"15\"", "cx=\"15.2\""), ("V8z", "v0z"), ("M26 8v6", "M26 8.3v5.7")] {
            assert!(found(&keys, &MASK.replacen(from, to, 1), |_, _, _| {}).violated > 0, "{to}");
        }
    }

    #[test]
    #[ignore = "slow: make test-all"]
    fn a_stroke_beyond_the_border_and_one_that_is_missing_are_found() {
        let mm = |by: f64| (by * NM_PER_MM) as i64;
        for keys in kinds() {
            let strokes = std::cell::Cell::new(0);
            found(&keys, MASK, |texture, _, _| strokes.set(texture.len()));
            let middle = strokes.get() / 2;
            // Moved or added beyond the border: here beside all of the part's box.
            let moved = |_: &Texture, i: usize, out: &mut Vec<P2>| {
                if i == middle {
                    out.iter_mut().for_each(|p| p.x += if keys.contains("outside = {") { mm(-10.0) } else { mm(60.0) });
                }
            };
            let rule = found(&keys, MASK, moved);
            let is_beyond = |v: &crate::Violation| v.message.contains("beyond the border");
            assert!(keys.contains("outside = {") || rule.violations.iter().any(is_beyond), "{keys}: {rule:?}");
            assert!(rule.violated > 0, "{keys}");
            if !keys.contains("soft") {
                let dropped = |_: &Texture, i: usize, out: &mut Vec<P2>| {
                    if i == middle {
                        out.truncate(1);
                        out[0].x += mm(0.3);
                    }
                };
                assert!(found(&keys, MASK, dropped).violated > 0, "{keys}");
            }
        }
    }

    #[test]
    #[ignore = "slow: make test-all"]
    fn a_sharp_border_is_no_soft_one() {
        let soft = format!("{}inside = \"m.svg#area\"\nsoft = \"2 mm\"", HATCH.replace("0.5", "0.1"));
        let other = |texture: &Texture, i: usize, out: &mut Vec<P2>| {
            // Lines continue to where they were before they were cut.
            let uncut = texture.uncut(0).expect("a mask");
            let whole = (0..uncut.len()).find(|&k| uncut.pieces(k).contains(&i)).expect("a stroke");
            uncut.stroke(whole, out);
        };
        let rule = found(&soft, MASK, other);
        assert!(rule.violations.iter().any(|v| v.message.contains("soft border")) || rule.violated > 100, "{rule:?}");
    }
}
