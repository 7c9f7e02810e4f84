//! `drawing`: what is marked of an SVG drawing lies where the drawing shows something that the texture chooses, and has
//! the pen of its colour, layer, class or id.
//!
//! The drawing is read by the verifier's own readers (`read::picture`, `read::labels`) and placed by its own arithmetic
//! ([`Page`]). Lines are sampled at three places each, at most [`MAX_LINES`] lines of a drawing, evenly; that what the
//! drawing shows is marked is held by [`shown`].

mod shown;

use shown::FillCheck;

use super::drawing_files::{Content, Files};
use super::page::{Page, Site};
use super::paper::{Hides, hides, is_page};
use crate::Drawing;
use crate::proof::Rule;
use crate::read::labels::{LabelledElements, Truth};
use crate::read::picture::{Ink, Picture};
use terrace_core::geom::{NM_PER_MM, P2};
use terrace_core::program::PenId;
use terrace_input::job::Job;
use terrace_input::texture::{FillMode, Kind, Marking, Paper, Selector, Texture};

/// Most lines of one drawing that are looked at, as docs/explanation/verify.md states.
const MAX_LINES: usize = 30_000;

/// Coordinates of the reader are f32, which holds 24 bits: a share of the drawing's size, some 16 steps of the last
/// bit.
pub(super) const F32: f64 = 1e-6;

/// Reach of a search for contours from a point and from eight about it, in units of their distance along x and y: above
/// the square root of 2, so that what lies between them is found.
const DIAGONAL: f64 = 1.5;

/// CSS pixels in a mm: 96 to the inch.
const PX_PER_MM: f64 = 96.0 / 25.4;

impl Picture {
    /// The sides of its page, mm.
    pub(super) fn sides_mm(&self) -> [f64; 2] {
        self.size.map(|px| px / PX_PER_MM)
    }
}

/// The textures of a pass, placed again from the job, and their strokes.
pub(crate) struct PlacedTextures<'a> {
    pub(crate) job: &'a Job,
    pub(crate) texture: &'a Texture,
    pub(crate) drawing: &'a Drawing<'a>,
    pub(crate) site: Site,
}

/// Holds the rule for the textures of a pass.
pub(crate) fn check(placed: &PlacedTextures<'_>, spot_mm: f64, files: &mut Files, rule: &mut Rule) {
    rule.ran = true;
    for (number, request) in placed.job.textures.iter().enumerate() {
        let Kind::Drawing { path, .. } = &request.kind else { continue };
        match files.get(path) {
            // See `bitmap`.
            Ok(Content::Bitmap(_)) => {}
            Ok(Content::Picture(picture)) if picture.unread.is_empty() => {
                check_texture(placed, number, picture, spot_mm, rule);
            }
            // What viewers show is not what is read.
            Ok(Content::Picture(picture)) => picture.unread.iter().for_each(|why| rule.leaves_out(path, number, why)),
            Err(why) => rule.leaves_out(path, number, why),
        }
    }
}

/// Holds the rule for one texture, counted from 0.
fn check_texture(placed: &PlacedTextures<'_>, number: usize, picture: &Picture, spot_mm: f64, rule: &mut Rule) {
    let PlacedTextures { job, texture, drawing, site } = placed;
    let request = &job.textures[number];
    let Kind::Drawing { marking, .. } = &request.kind else { return };
    let Some(page) = Page::new(&request.kind, &request.area, site, picture.sides_mm()) else { return };
    let choice = InkChoice::new(marking, request.pen, picture);
    let scale = [0, 1].map(|k| picture.size[k] / page.size[k]);
    // Contours and centre lines may lie on a border, curves off it by the tolerance.
    let slack_mm =
        2.0 * request.tolerance_mm + page.size[0].max(page.size[1]) * F32 + picture.slack / scale[0].min(scale[1]);
    let is_outline = marking.fill == FillMode::Outline;
    let on_page = DrawingOnPage { picture, page: &page, choice: &choice, scale, slack_mm, is_outline };
    let strokes = texture.strokes_of(number);
    let stride = strokes.len().div_ceil(MAX_LINES).max(1);
    let mut points = Vec::new();
    for i in strokes.clone().step_by(stride) {
        let pen = (drawing.stroke)(i, &mut points);
        for p in samples(&points) {
            rule.checked += 1;
            if let Some(fault) = on_page.fault(p, pen) {
                rule.broken("", (drawing.element)(i), fault);
            }
        }
    }
    let fills = FillCheck { picture, page: &page, choice: &choice, site, spot_mm, slack_mm };
    fills.check(request, drawing, strokes, number, rule);
}

/// A drawing where a texture places it, and what the texture chooses of it.
struct DrawingOnPage<'a> {
    picture: &'a Picture,
    page: &'a Page,
    choice: &'a InkChoice<'a>,
    /// Px of the drawing in a mm of its page.
    scale: [f64; 2],
    /// How far marks may lie from what the drawing shows, mm.
    slack_mm: f64,
    is_outline: bool,
}

impl DrawingOnPage<'_> {
    /// The fault of a mark that passes a point of the part, nm, with this pen.
    fn fault(&self, p: [f64; 2], pen: PenId) -> Option<String> {
        // Nearly all marks are right, and where they are the point itself decides.
        if self.inks_at(self.px(p)).any(|ink| self.choice.may_have(ink, pen)) {
            return None;
        }
        // Of tiles, what lies beside a point near a border lies on the next one. A line or a narrow area may lie
        // between the points.
        let beside = || around(p, self.slack_mm * NM_PER_MM).map(|q| self.px(q));
        let reach = self.slack_mm * self.scale[0].max(self.scale[1]);
        let on_edges = self.picture.points_near(self.px(p), reach);
        let shown: Vec<Ink> = beside().chain(on_edges).flat_map(|px| self.inks_at(px)).collect();
        let is_marked = |ink| self.choice.exists(ink) != Truth::No && self.choice.is_marked(ink);
        let is_contour =
            || self.is_outline && beside().any(|q| self.picture.has_bare_contour(q, DIAGONAL * reach, &is_marked));
        if shown.is_empty() && !is_contour() {
            let [x, y] = self.page.at(p);
            return Some(format!("it is marked where the drawing shows nothing, at {x:.4}, {y:.4} mm of the page"));
        }
        // With `fill = "outline"` pens are not told apart, as docs/explanation/verify.md states.
        let has_own_pen = self.is_outline || shown.iter().any(|&ink| self.choice.may_have(ink, pen));
        (!has_own_pen).then(|| "its pen is not that of its colour or label".to_owned())
    }

    /// Where a point of the part, nm, lies in the drawing, px.
    fn px(&self, p: [f64; 2]) -> [f64; 2] {
        let [x, y] = self.page.at(p);
        [x * self.scale[0], (self.page.size[1] - y) * self.scale[1]]
    }

    /// The inks that may be topmost at a point of the drawing and are marked.
    fn inks_at(&self, px: [f64; 2]) -> impl Iterator<Item = Ink> {
        let inks = self.picture.inks_at(px, &|ink| self.choice.exists(ink)).into_iter();
        inks.filter(|&ink| self.choice.is_marked(ink))
    }
}

/// The inks of a drawing that a texture marks, and their pens.
struct InkChoice<'a> {
    pens: Vec<(InkSelector<'a>, PenId)>,
    only: Vec<InkSelector<'a>>,
    except: Vec<InkSelector<'a>>,
    paper: Paper,
    pen: PenId,
}

/// A selector of a texture: a colour, or the elements that have a label.
enum InkSelector<'a> {
    Colour(&'a [u8; 3]),
    Label(LabelledElements),
}

impl<'a> InkSelector<'a> {
    fn new(selector: &'a Selector, picture: &Picture) -> Self {
        match selector {
            Selector::Colour(colour) => Self::Colour(colour),
            Selector::Label(label) => Self::Label(picture.labels.having(|l| l == label)),
        }
    }

    /// Whether it chooses what shows an ink.
    fn chooses(&self, ink: Ink) -> Truth {
        match self {
            Self::Colour(colour) if **colour == ink.colour => Truth::Yes,
            Self::Colour(_) => Truth::No,
            Self::Label(having) => having.has(ink.element),
        }
    }
}

/// Whether one of them chooses it.
fn any(all: &[InkSelector<'_>], ink: Ink) -> Truth {
    any_of(all.iter(), ink)
}

fn any_of<'a>(all: impl Iterator<Item = &'a InkSelector<'a>>, ink: Ink) -> Truth {
    let either = |a, b| match (a, b) {
        (Truth::Yes, _) | (_, Truth::Yes) => Truth::Yes,
        (Truth::No, Truth::No) => Truth::No,
        _ => Truth::Maybe,
    };
    all.map(|c| c.chooses(ink)).fold(Truth::No, either)
}

fn both(a: Truth, b: Truth) -> Truth {
    match (a, b) {
        (Truth::No, _) | (_, Truth::No) => Truth::No,
        (Truth::Yes, Truth::Yes) => Truth::Yes,
        _ => Truth::Maybe,
    }
}

fn not(known: Truth) -> Truth {
    match known {
        Truth::Yes => Truth::No,
        Truth::No => Truth::Yes,
        Truth::Maybe => Truth::Maybe,
    }
}

impl<'a> InkChoice<'a> {
    fn new(marking: &'a Marking, pen: PenId, picture: &Picture) -> Self {
        let selectors = |list: &'a [Selector]| list.iter().map(|s| InkSelector::new(s, picture)).collect();
        Self {
            pens: marking.pens.iter().map(|(s, pen)| (InkSelector::new(s, picture), *pen)).collect(),
            only: selectors(&marking.only),
            except: selectors(&marking.except),
            paper: marking.paper,
            pen,
        }
    }

    /// Whether what `only` and `except` leave holds it.
    fn is_chosen(&self, ink: Ink) -> Truth {
        let only = if self.only.is_empty() { Truth::Yes } else { any(&self.only, ink) };
        both(only, not(any(&self.except, ink)))
    }

    /// Whether it is there, marked or not: of what is left out by its colour, what has a colour of the page still
    /// hides; and what has one and is translucent may hide nothing.
    fn exists(&self, ink: Ink) -> Truth {
        let marked = self.marked(ink);
        if marked == Truth::Yes || !is_page(self.paper, ink.colour) {
            return self.is_chosen(ink);
        }
        let shown = match hides(ink.opacity) {
            Hides::All => Truth::Yes,
            Hides::Either => Truth::Maybe,
            // Where a label may give it a pen it may be there.
            Hides::Nothing => marked,
        };
        both(self.is_read(ink), shown)
    }

    /// Whether no label leaves it out.
    fn is_read(&self, ink: Ink) -> Truth {
        let is_label = |c: &&InkSelector<'_>| matches!(c, InkSelector::Label(_));
        let except = any_of(self.except.iter().filter(is_label), ink);
        let only = match self.only.iter().all(|c| is_label(&c)) && !self.only.is_empty() {
            true => any(&self.only, ink),
            false => Truth::Yes,
        };
        both(only, not(except))
    }

    /// Whether it is chosen and not the page: of the colours of the page those that `only` or `pens` name, and those
    /// that have a pen by their label.
    fn marked(&self, ink: Ink) -> Truth {
        let by_name = self.only.iter().any(|c| matches!(c, InkSelector::Colour(colour) if **colour == ink.colour));
        let shown = match is_page(self.paper, ink.colour) && !by_name {
            true => any_of(self.pens.iter().map(|(c, _)| c), ink),
            false => Truth::Yes,
        };
        both(self.is_chosen(ink), shown)
    }

    fn is_marked(&self, ink: Ink) -> bool {
        self.marked(ink) != Truth::No
    }

    /// Whether it may be marked with a pen.
    fn may_have(&self, ink: Ink, pen: PenId) -> bool {
        let is_named = self.pens.iter().any(|(c, _)| c.chooses(ink) == Truth::Yes);
        let may = |k: Truth| k == Truth::Yes || (k == Truth::Maybe && !is_named);
        (!is_named && pen == self.pen) || self.pens.iter().any(|(c, own)| *own == pen && may(c.chooses(ink)))
    }
}

/// Points of a line, not at its ends; of a dot its point.
pub(super) fn samples(points: &[P2]) -> impl Iterator<Item = [f64; 2]> + '_ {
    let sides = points.len().saturating_sub(1);
    let dot = points.first().filter(|_| sides == 0).map(|p| [p.x as f64, p.y as f64]);
    let places = [(0, 0.25), (sides / 2, 0.5), (sides.saturating_sub(1), 0.75)];
    let on_line = places.into_iter().filter(move |_| sides > 0).map(move |(k, t)| {
        let (a, b) = (points[k], points[k + 1]);
        [a.x as f64 + t * (b.x - a.x) as f64, a.y as f64 + t * (b.y - a.y) as f64]
    });
    dot.into_iter().chain(on_line)
}

/// A point and eight about it.
pub(super) fn around(p: [f64; 2], by: f64) -> impl Iterator<Item = [f64; 2]> {
    let steps = [0.0, -by, by];
    steps.into_iter().flat_map(move |x| steps.map(|y| [p[0] + x, p[1] + y]))
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use terrace_core::geom::BoxMm;
    use terrace_input::job::Overrides;

    const PENS: [&str; 6] = ["a", "b", "c", "d", "e", "f"];
    const COLOURS: [&str; 6] = ["#000000", "#ff0000", "#00ff00", "#0000ff", "#ff00ff", "#808080"];

    /// A job of one drawing with a pen for each of six colours, or with other keys.
    fn job(folder: &Path, more: &str) -> Job {
        let pens: Vec<String> = COLOURS.iter().zip(PENS).map(|(c, pen)| format!("{c:?} = {pen:?}")).collect();
        let more =
            if more.contains("pens =") { more.into() } else { format!("pens = {{ {} }}\n{more}", pens.join(", ")) };
        let made = |name: &&str| {
            format!("[[pen]]\nname = {name:?}\nspeed = \"100 mm/s\"\npower = \"5 %\"\nfrequency = \"60 kHz\"\n")
        };
        let text = format!(
            "surface = {{ file = \"x.stl\", unit = \"mm\" }}\nfocus = {{ pdof = \"0.1 mm\" }}\n\
             machine = {{ profile = \"xyz-galvo-40\" }}\n[[texture]]\nfile = \"d.svg\"\nturn = \"20 deg\"\n\
             {more}\n{}",
            PENS.iter().map(made).collect::<String>()
        );
        Job::parse(&folder.join("job.toml"), &text, &Overrides::default()).expect("a job")
    }

    /// Six layers, each of one colour: a square with a line across it.
    fn layers(colours: [&str; 6]) -> String {
        let layer = |(k, colour): (usize, &&str)| {
            let x = 3 * k + 1;
            format!(
                "<g id=\"l{k}\" inkscape:groupmode=\"layer\" inkscape:label=\"L{k}\" class=\"c{}\" fill=\"{colour}\" stroke=\"{colour}\" stroke-width=\"0.01\">\
                 <rect x=\"{x}\" y=\"1\" width=\"2\" height=\"2\"/><path d=\"M{x} 6h2\" fill=\"none\"/></g>",
                k % 2
            )
        };
        let body: String = colours.iter().enumerate().map(layer).collect();
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" \
             xmlns:inkscape=\"http://www.inkscape.org/namespaces/inkscape\" width=\"20mm\" height=\"10mm\" viewBox=\"0 0 20 10\">{body}</svg>"
        )
    }

    /// What the rule finds if the drawing changes after it has been placed.
    fn found(more: &str, before: &str, after: &str) -> Rule {
        let folder = tempfile::tempdir().expect("a folder");
        let drawing = folder.path().join("d.svg");
        std::fs::write(&drawing, before).expect("written");
        let job = job(folder.path(), more);
        let area = BoxMm::rectangle(0.0, 0.0, 100.0, 100.0);
        let texture = Texture::load(&job.textures, area, 0.3, 0.03, &mut Vec::new()).expect("a texture");
        std::fs::write(&drawing, after).expect("written");
        let mut rule = Rule::new("drawing", "");
        let site = Site { part_box: area, turn_rad: 0.3 };
        let placed = PlacedTextures { job: &job, texture: &texture, drawing: &Drawing::from_texture(&texture), site };
        check(&placed, 0.03, &mut Files::default(), &mut rule);
        rule
    }

    #[test]
    fn six_colours_have_their_pens() {
        let drawn = layers(COLOURS);
        for more in ["", "mirror = \"x\"", "tile = true\narea = \"part\"", "fill = \"outline\"", "fill = \"rings\""] {
            let rule = found(&format!("{more}\npitch = \"0.1 mm\""), &drawn, &drawn);
            assert!(rule.checked >= 36 && rule.violated == 0, "{more}: {:?}", rule.violations);
        }
    }

    #[test]
    fn what_is_fully_transparent_hides_nothing() {
        let glass = "<path d=\"M0 0h20v10h-20z\" fill=\"white\" fill-opacity=\"0\" stroke=\"white\" stroke-width=\"9\" \
                     stroke-opacity=\"0\"/></svg>";
        let drawn = layers(COLOURS).replace("</svg>", glass);
        let rule = found("pitch = \"0.1 mm\"", &drawn, &drawn);
        assert!(rule.checked >= 36 && rule.violated == 0, "{:?}", rule.violations);
    }

    #[test]
    fn a_pen_of_another_colour_and_a_mark_beside_its_figure_are_found() {
        let drawn = layers(COLOURS);
        let [a, b, c, d, e, f] = COLOURS;
        for other in [
            layers([b, a, c, d, e, f]),
            drawn.replacen("width=\"2\"", "width=\"1\"", 1),
            drawn.replacen("M1 6", "M1 7", 1),
        ] {
            let rule = found("pitch = \"0.1 mm\"", &drawn, &other);
            assert!(rule.violated > 0, "{other}");
        }
    }

    /// Pens of the layers in this order, and more keys.
    fn layer_pens(layers: [usize; 6], more: &str) -> String {
        let pens: Vec<String> = layers.iter().zip(PENS).map(|(k, pen)| format!("\"layer:L{k}\" = {pen:?}")).collect();
        format!("pens = {{ {} }}\npitch = \"0.1 mm\"\n{more}", pens.join(", "))
    }

    #[test]
    fn layers_ids_and_classes_have_their_pens() {
        // White is the page unless it has a pen, and a layer may give it one.
        for colours in [COLOURS, ["#ff0000"; 6], ["white", "#ff0000", "#ff0000", "white", "white", "black"]] {
            let drawn = layers(colours);
            for more in ["", "only = [\"class:c1\", \"id:l2\"]", "except = [\"layer:L0\"]", "mirror = \"y\""] {
                let rule = found(&layer_pens([0, 1, 2, 3, 4, 5], more), &drawn, &drawn);
                assert!(rule.checked >= 24 && rule.violated == 0, "{more}: {:?}", rule.violations);
            }
        }
        // A use has the labels of what it copies and of what holds it.
        let copied = "<g inkscape:groupmode=\"layer\" inkscape:label=\"L7\"><use href=\"#l1\" y=\"5\"/></g></svg>";
        let drawn = layers(COLOURS).replace("</svg>", copied);
        let rule = found("pens = { \"layer:L7\" = \"b\", \"id:l3\" = \"d\" }\npitch = \"0.1 mm\"", &drawn, &drawn);
        assert!(rule.checked >= 36 && rule.violated == 0, "{:?}", rule.violations);
    }

    #[test]
    fn exchanged_layers_and_figures_that_are_left_out_are_found() {
        let red = layers(["#ff0000"; 6]);
        let exchanged = red.replace("\"L1\"", "\"L9\"").replace("\"L2\"", "\"L1\"").replace("\"L9\"", "\"L2\"");
        let kept = layer_pens([0, 1, 2, 3, 4, 5], "");
        let rule = found(&kept, &red, &exchanged);
        assert!(rule.violated > 0 && rule.violations[0].message.contains("pen"), "{:?}", rule.violations);
        for (keys, before, after) in [
            ("except = [\"layer:L1\"]", "\"L2\"", "\"L1\""),
            ("except = [\"id:l1\"]", "\"l2\"", "\"l1\""),
            ("only = [\"class:c0\"]", "class=\"c0\"", "class=\"c2\""),
        ] {
            let other = red.replacen(before, after, 1).replacen(after, before, usize::from(after == "\"L1\""));
            let rule = found(&format!("pens = {{}}\npitch = \"0.1 mm\"\n{keys}"), &red, &other);
            assert!(rule.violated > 0, "{keys}: {}", rule.checked);
            assert!(rule.violations[0].message.contains("shows nothing"), "{:?}", rule.violations);
        }
    }

    /// A black square of 16 mm with a square of 8 mm in it.
    fn on_black(inner: &str) -> String {
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"20mm\" height=\"20mm\" viewBox=\"0 0 20 20\">\
             <rect x=\"2\" y=\"2\" width=\"16\" height=\"16\"/>\
             <rect x=\"6\" y=\"6\" width=\"8\" height=\"8\" {inner}/></svg>"
        )
    }

    #[test]
    fn near_white_is_the_page_and_grey_is_not() {
        const NOTHING: &str = "shows nothing";
        const UNMARKED: &str = "nothing is marked";
        let drawn = |inner: &str| on_black(&format!("fill=\"{inner}\""));
        for (keys, before, after, found_by) in [
            ("", "#fefefe", "#fefefe", None),
            ("", "#fafafa", "#fffffe", None),
            ("", "#f5f5f5", "#e0e0e0", None),
            ("", "#fefefe", "#f5f5f5", Some(UNMARKED)),
            ("", "#ffffff", "#ffffe0", Some(UNMARKED)),
            ("", "#f5f5f5", "#fefefe", Some(NOTHING)),
            ("", "black", "white", Some(NOTHING)),
            ("paper = \"#f5f5f5\"", "#f5f5f5", "#f8f8f8", None),
            ("paper = \"#f5f5f5\"", "#f5f5f5", "#f4f4f4", Some(UNMARKED)),
            ("paper = 90", "#e3e3e3", "#e2e2e2", Some(UNMARKED)),
            ("paper = \"white\"", "#fefefe", "white", Some(NOTHING)),
            // Left out by its colour the page still hides; what has another colour does not.
            ("only = [\"black\"]", "#fefefe", "#ffffff", None),
            ("only = [\"black\"]", "#fefefe", "#f5f5f5", Some(UNMARKED)),
            ("except = [\"#fefefe\"]", "#fefefe", "#fefefe", None),
            ("except = [\"#f5f5f5\"]", "#f5f5f5", "#fefefe", Some(NOTHING)),
            ("only = [\"#fefefe\"]", "#fefefe", "#fefefe", None),
        ] {
            let keys = format!("pens = {{}}\npitch = \"0.1 mm\"\n{keys}");
            let rule = found(&keys, &drawn(before), &drawn(after));
            assert!(rule.checked > 200, "{}", rule.checked);
            let messages: Vec<&str> = rule.violations.iter().map(|v| v.message.as_str()).collect();
            assert_eq!(rule.violated > 0, found_by.is_some(), "{keys} {before} {after}: {messages:?}");
            assert!(
                messages.iter().all(|m| m.contains(found_by.unwrap_or_default())),
                "{keys} {before} {after}: {messages:?}"
            );
        }
    }

    #[test]
    fn translucent_page_hides_from_half_opacity_on() {
        // PlacedTextures where the square is opaque, or is not there; then the drawing changes.
        let (opaque, absent) = (on_black("fill=\"white\""), on_black("fill=\"none\""));
        for (inner, hides) in [
            ("fill=\"white\" fill-opacity=\"0.6\"", true),
            ("fill=\"#fefefe\" opacity=\"0.4\"", false),
            ("fill=\"white\" opacity=\"0.7\" fill-opacity=\"0.7\"", false),
            ("fill=\"#ffffff66\"", false),
            ("fill=\"#ffffffcc\"", true),
        ] {
            let after = on_black(inner);
            for (before, is_hidden) in [(&opaque, true), (&absent, false)] {
                let rule = found("pens = {}\npitch = \"0.1 mm\"", before, &after);
                assert_eq!(rule.violated > 0, hides != is_hidden, "{inner} {is_hidden}: {:?}", rule.violations);
            }
        }
        // At half opacity both are accepted.
        let after = on_black("fill=\"white\" opacity=\"0.5\"");
        for before in [&opaque, &absent] {
            assert_eq!(found("pens = {}\npitch = \"0.1 mm\"", before, &after).violated, 0);
        }
        // The groups around a shape count.
        let group = absent.replace(
            "</svg>",
            "<g opacity=\"0.6\"><g opacity=\"0.6\"><path d=\"M6 6h8v8h-8z\" fill=\"white\"/></g></g></svg>",
        );
        assert_eq!(found("pens = {}\npitch = \"0.1 mm\"", &absent, &group).violated, 0);
        assert!(found("pens = {}\npitch = \"0.1 mm\"", &opaque, &group).violated > 0);
    }

    #[test]
    fn drawings_that_usvg_does_not_read_are_left_out() {
        let drawn = on_black("fill=\"white\"");
        let other = on_black("style=\"fill:white;fill:oklch(0 0 0)\"");
        let rule = found("pens = {}\npitch = \"0.1 mm\"", &drawn, &other);
        assert_eq!((rule.checked, rule.violated), (0, 0));
        assert!(
            rule.left_out[0].contains("texture 1, d.svg: usvg does not read some functions"),
            "{:?}",
            rule.left_out
        );
    }

    #[test]
    fn a_piece_that_is_not_marked_is_found_in_every_filled_drawing() {
        let [drawn, other] = ["M4 4h2v2h-2z", ""].map(|hole| {
            format!(
                "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"20mm\" height=\"20mm\" viewBox=\"0 0 20 20\">\
                 <path fill-rule=\"evenodd\" d=\"M2 2h8v8h-8z{hole}\"/><path d=\"M2 15h12\" stroke=\"black\" stroke-width=\"3\"/></svg>"
            )
        });
        for more in [
            "",
            "mirror = \"x\"",
            "fill = \"rings\"",
            "cross = true",
            "size = [\"40 mm\", \"30 mm\"]",
            "stroke = \"hatch\"",
        ] {
            let keys = format!("pens = {{}}\npitch = \"0.05 mm\"\n{more}");
            let rule = found(&keys, &drawn, &drawn);
            assert!(rule.checked > 300 && rule.violated == 0, "{more}: {} {:?}", rule.checked, rule.violations);
            assert!(found(&keys, &drawn, &other).violated > 0, "{more}");
        }
    }

    #[test]
    fn thin_lines_of_small_pages_and_marks_on_borders_of_tiles_are_on_ink() {
        let of = |body: &str| format!("<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 100 100\">{body}</svg>");
        // On a page of 0.4 mm the tolerance is many times the width of the line.
        let bent = of("<path d=\"M5 40Q50 90 95 41T5 39\" fill=\"none\" stroke=\"black\" stroke-width=\"0.001\"/>");
        let size = "pens = {}\nsize = [\"0.4 mm\", \"0.4 mm\"]";
        let rule = found(size, &bent, &bent);
        assert!(rule.checked >= 3 && rule.violated == 0, "{} {:?}", rule.checked, rule.violations);
        assert!(found(size, &bent, &bent.replacen("M5 40", "M5 60", 1)).violated > 0);
        // Its outline runs along the lower border of every tile, where the next one shows nothing.
        let cut = of("<path d=\"M30 80h20v30h-20z\"/>");
        let tiles = "pens = {}\nsize = [\"37.3 mm\", \"37.3 mm\"]\ntile = true\narea = \"part\"\nfill = \"outline\"";
        let rule = found(tiles, &cut, &cut);
        assert!(rule.checked >= 9 && rule.violated == 0, "{} {:?}", rule.checked, rule.violations);
    }

    #[test]
    fn contours_on_each_other_are_outlines() {
        // The upper side of the square is that of its hole: no area lies on either side of it.
        let drawn = "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"20mm\" height=\"20mm\" viewBox=\"0 0 20 20\">\
                     <path fill-rule=\"evenodd\" d=\"M2 3h16v12h-16zM4 3h12v3h-12z\"/></svg>";
        let outline = "pens = {}\nfill = \"outline\"";
        let rule = found(outline, drawn, drawn);
        assert!(rule.checked > 0 && rule.violated == 0, "{:?}", rule.violations);
        // Of tiles also on their borders.
        let up = drawn.replace("M2 3h", "M2 0h").replace("M4 3h", "M4 0h");
        let tiled = format!("{outline}\ntile = true\narea = \"part\"");
        let rule = found(&tiled, &up, &up);
        assert!(rule.checked > 50 && rule.violated == 0, "{:?}", rule.violations);
        for (from, to) in [("M4 3h", "M4 3.5h"), ("/></svg>", "/><path fill=\"white\" d=\"M0 1h20v4h-20z\"/></svg>")] {
            assert!(found(outline, drawn, &drawn.replacen(from, to, 1)).violated > 0, "{to}");
        }
    }

    #[test]
    fn thin_lines_along_large_arcs_are_on_ink() {
        // The cubics of usvg lie 10 um off this circle.
        let drawn = "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"100mm\" height=\"100mm\" viewBox=\"0 0 100 100\">\
                     <circle cx=\"50\" cy=\"50\" r=\"49\" fill=\"none\" stroke=\"black\" stroke-width=\"0.01\"/>\
                     <path d=\"M0 0Q50 90 100 0\" fill=\"none\" stroke=\"black\" stroke-width=\"0.005\"/></svg>";
        let rule = found("pens = {}", drawn, drawn);
        assert!(rule.checked == 6 && rule.violated == 0, "{:?}", rule.violations);
        let other = drawn.replacen("r=\"49\"", "r=\"48.9\"", 1);
        assert!(found("pens = {}", drawn, &other).violated > 0);
    }
}
