//! What an SVG drawing shows at a point, by a reader of the verifier's own (usvg): the topmost element that covers it.
//!
//! Consumes the text of a drawing. Points are in its own px, x to the right, y down. Coordinates of usvg are f32, and
//! it approximates arcs ([`Picture::slack`]). Each element is known by its labels (`labels`). Text is not drawn; what
//! is painted by a gradient and groups with a filter count as not being there.

use std::collections::HashMap;
use terrace_core::math;

use roxmltree::{Document, Node as XmlNode, ParsingOptions};
use rstar::primitives::{GeomWithData, Rectangle};
use rstar::{AABB, RTree};
use usvg::tiny_skia_path::{Path, PathSegment, PathStroker, Point, StrokeDash, Transform};
use usvg::{FillRule, Group, MaskType, Node, PaintOrder, Tree};

use super::labels::{Labels, Truth, UNKNOWN};
use super::sides::{Contours, Sides};
use super::unread::unread;

/// Most nodes of a drawing.
const MAX_NODES: u32 = 2_000_000;

// The next three bound the time and memory that usvg takes; docs/explanation/verify.md states them.

/// Most elements of a drawing once what they refer to is expanded.
const MAX_ELEMENTS: u32 = 300_000;

/// Most bytes of style sheets.
const MAX_SHEET: usize = 20_000;

/// Most bytes of style sheets, counted again for each element.
const MAX_CSS: usize = 30_000_000;

/// Most references within each other.
const MAX_OPEN: usize = 32;

/// The least width of a line, px: usvg leaves out what is shorter than 1/4096.
const LEAST_WIDTH: f32 = 0.02;

/// Largest number of a drawing, as docs/explanation/verify.md states: beyond it f32 has steps of 1/16 and more.
const LARGEST: f64 = 1e6;

/// How much finer than for pixels of a px outlines of strokes are.
const FINE: f32 = 2000.0;

/// Most steps in which a curve is followed.
const MAX_STEPS: f64 = 4096.0;

/// How far a step may lie off its curve: a share of the drawing's size.
const CURVE: f64 = 2.5e-7;

/// How far usvg's cubics lie off an arc: a share of the extent of its path. Each spans a right angle at most, which
/// takes it 0.00027 radii off, and has a chord of 1.41 radii then.
const ARC: f64 = 2e-4;

/// How far beside a border a point is offered: a share of the reach.
const BESIDE: f64 = 0.02;

type Entry = GeomWithData<Rectangle<[f64; 2]>, usize>;

/// A drawing that can be asked for its colours.
pub(crate) struct Picture {
    /// Width and height, px.
    pub(crate) size: [f64; 2],
    /// The labels of its elements.
    pub(crate) labels: Labels,
    /// How far outlines may lie off those of the drawing, px.
    pub(crate) slack: f64,
    /// The features of it that usvg does not read, for the proof.
    pub(crate) unread: Vec<&'static str>,
    root: Layer,
}

/// The paint that is seen at a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Ink {
    pub(crate) colour: [u8; 3],
    /// Of its paint and of all groups around it: above 0, to 1.
    pub(crate) opacity: f32,
    /// The element of the ink among the labels.
    pub(crate) element: u32,
    /// Whether it is the area of a fill, and neither a mask nor a pattern shows a part of it.
    pub(crate) is_plain_fill: bool,
}

/// Reads groups and their paths.
struct Reader<'a> {
    labels: &'a Labels,
    /// How far steps may lie off their curves, px.
    fine: f64,
    slack: f64,
    /// Of the groups that are open, together.
    opacity: f32,
}

/// The elements of a group in the order of painting.
struct Layer {
    items: Vec<Item>,
    index: RTree<Entry>,
}

enum Item {
    Area {
        contours: Sides,
        band: Option<Band>,
        is_evenodd: bool,
        paint: Paint,
        opacity: f32,
        element: u32,
        kind: AreaKind,
    },
    Group {
        layer: Layer,
        clip: Option<Box<Clip>>,
        mask: Option<Box<Mask>>,
    },
}

/// The kinds of areas.
enum AreaKind {
    Fill,
    /// The stroke of a path that has a fill.
    Border,
    /// The stroke of one that has none, and its own lines.
    Line {
        centre: Contours,
        is_dashed: bool,
    },
}

/// The lines of a stroke and half its width, px. What lies beside its lines is of its area whatever the outline is:
/// that of a stroke much thinner than its curves bend may lie off them.
struct Band {
    lines: Sides,
    half: f64,
}

/// A shape, for its area.
pub(super) struct PictureShape<'a> {
    pub(super) element: u32,
    pub(super) outline: ShapeOutline<'a>,
    /// Whether a mask holds a part of it back, or a pattern shows a part of it.
    pub(super) is_masked: bool,
}

pub(super) enum ShapeOutline<'a> {
    Fill { contours: &'a Contours, is_evenodd: bool },
    Line { centre: &'a Contours, is_dashed: bool },
}

enum Paint {
    Colour([u8; 3]),
    /// From the drawing to the pattern, and one of its tiles.
    Pattern {
        to: Transform,
        rect: [f64; 4],
        tile: Box<Layer>,
    },
}

/// The area of a clip path, in the coordinates of the drawing.
pub(super) struct Clip {
    layer: Layer,
    inner: Option<Box<Clip>>,
}

struct Mask {
    layer: Layer,
    /// From the drawing to where the rectangle lies.
    to: Transform,
    rect: [f64; 4],
    is_alpha: bool,
    inner: Option<Box<Mask>>,
}

impl Picture {
    /// Reads the text of a drawing; None where usvg cannot, or could take any time and memory.
    pub(crate) fn read(text: &str) -> Option<Self> {
        let options =
            ParsingOptions { allow_dtd: !text.contains("<!ENTITY"), nodes_limit: MAX_NODES, ..Default::default() };
        let doc = Document::parse_with_options(text, options).ok()?;
        if !is_plain(&doc) {
            return None;
        }
        let (labels, tagged) = Labels::tagged(&doc);
        let tree = Tree::from_str(&tagged, &usvg::Options::default()).ok()?;
        let size = [f64::from(tree.size().width()), f64::from(tree.size().height())];
        let mut reader = Reader { labels: &labels, fine: CURVE * size[0].max(size[1]), slack: 0.0, opacity: 1.0 };
        let root = reader.layer(tree.root(), Transform::identity(), false, UNKNOWN);
        let slack = reader.slack;
        Some(Self { size, labels, slack, unread: unread(&doc), root })
    }

    /// The inks that may be topmost at a point, of the elements that exist, the upper ones first: some of which it is
    /// not known, and the first that does.
    pub(crate) fn inks_at(&self, p: [f64; 2], exists: &dyn Fn(Ink) -> Truth) -> Vec<Ink> {
        let mut found = Vec::new();
        self.root.find(p, &mut |ink| {
            let known = exists(ink);
            if known != Truth::No {
                found.push(ink);
            }
            known == Truth::Yes
        });
        found
    }

    /// The points of lines and of borders of areas that are nearest to one and not farther than `reach`, of each
    /// element one, and of borders a little to both sides. What patterns show is left out.
    pub(crate) fn points_near(&self, p: [f64; 2], reach: f64) -> Vec<[f64; 2]> {
        let mut found = Vec::new();
        self.root.points_near(p, reach, &mut found);
        found
    }

    /// Whether the contour of an area that `exists` passes not farther than `reach` from a point where nothing is
    /// shown: two contours may lie on each other there, with nothing between them.
    pub(crate) fn has_bare_contour(&self, p: [f64; 2], reach: f64, exists: &dyn Fn(Ink) -> bool) -> bool {
        !self.root.find(p, &mut |_| true) && self.root.has_contour(p, reach, exists)
    }

    /// Offers every shape with the clip paths that cut it.
    pub(super) fn pieces<'a>(&'a self, take: &mut dyn FnMut(PictureShape<'a>, &[&'a Clip])) {
        self.root.pieces(&mut Vec::new(), false, take);
    }
}

/// Whether usvg reads a drawing in bounded time and memory: no selectors with combinators in its style sheets, no
/// markers, not too many elements once uses and patterns are expanded, and not too long a style sheet for them.
fn is_plain(doc: &Document<'_>) -> bool {
    let text = doc.input_text();
    let styles = doc.descendants().filter(|n| n.tag_name().name() == "style");
    if !doc.descendants().flat_map(|n| n.attributes()).all(|a| is_near(a.name(), a.value())) {
        return false;
    }
    if text.contains("marker") || !styles.clone().all(|n| n.text().is_none_or(has_simple_selectors)) {
        return false;
    }
    let ids: HashMap<&str, XmlNode<'_, '_>> = doc.descendants().filter_map(|n| Some((n.attribute("id")?, n))).collect();
    let mut count = 0;
    let is_small = elements(doc.root_element(), &ids, &mut Vec::new(), &mut count).is_some();
    // Each rule is tried on each element, and copies its declarations.
    let css: usize = styles.filter_map(|n| n.text()).map(str::len).sum();
    is_small && css <= MAX_SHEET && css.saturating_mul(count as usize) <= MAX_CSS
}

/// Whether the selectors of a style sheet are single words: nothing is combined, and there are no pseudo-classes,
/// at-rules or comments.
fn has_simple_selectors(css: &str) -> bool {
    let selectors = css.split('}').filter_map(|rule| rule.split('{').next());
    selectors
        .flat_map(|s| s.split(','))
        .all(|s| !s.trim().contains([' ', '\t', '\n', '\r', '>', '+', '~', '@', ':', '/', '[', '(', '|', '*', '\\']))
}

/// Whether an attribute holds no number that f32 has too few digits for.
fn is_near(name: &str, value: &str) -> bool {
    let is_part = |c: char| c.is_ascii_digit() || matches!(c, '.' | 'e' | 'E' | '+' | '-');
    let mut numbers = value.split(|c| !is_part(c)).filter_map(|word| word.parse::<f64>().ok());
    matches!(name, "id" | "class" | "href" | "fill" | "stroke" | "style") || numbers.all(|v| v.abs() <= LARGEST)
}

/// Counts the elements below one with what they refer to; None where there are too many.
fn elements<'a, 'i>(
    node: XmlNode<'a, 'i>,
    ids: &HashMap<&str, XmlNode<'a, 'i>>,
    open: &mut Vec<XmlNode<'a, 'i>>,
    count: &mut u32,
) -> Option<()> {
    *count += 1;
    if *count > MAX_ELEMENTS || open.len() > MAX_OPEN {
        return None;
    }
    for attribute in node.attributes() {
        // Links and url(#id), in attributes and in styles.
        for part in attribute.value().split('#').skip(1) {
            let id = part.split([')', '"', '\'', ' ', ';']).next().unwrap_or_default();
            if let Some(&target) = ids.get(id).filter(|t| !open.contains(t)) {
                open.push(target);
                elements(target, ids, open, count)?;
                open.pop();
            }
        }
    }
    node.children().filter(XmlNode::is_element).try_for_each(|child| elements(child, ids, open, count))
}

impl Reader<'_> {
    /// The contents of a group; `to` takes its coordinates to those of the drawing, `copied` is the use that shows it.
    /// Of clip paths all areas count.
    fn layer(&mut self, group: &Group, to: Transform, is_clip: bool, copied: u32) -> Layer {
        let mut layer = Layer { items: Vec::new(), index: RTree::new() };
        let mut boxes = Vec::new();
        for node in group.children() {
            let before = layer.items.len();
            match node {
                Node::Group(g) => layer.items.extend(self.group(g, to, is_clip, copied)),
                Node::Path(path) if path.is_visible() => layer.items.append(&mut self.path(path, to, is_clip, copied)),
                _ => {}
            }
            boxes.extend((before..layer.items.len()).filter_map(|i| Some((layer.items[i].bounds()?, i))));
        }
        let entry = |([lo, hi], i): ([[f64; 2]; 2], usize)| Entry::new(Rectangle::from_corners(lo, hi), i);
        layer.index = RTree::bulk_load(boxes.into_iter().map(entry).collect());
        layer
    }

    fn group(&mut self, group: &Group, to: Transform, is_clip: bool, copied: u32) -> Option<Item> {
        if !group.filters().is_empty() || group.opacity().get() == 0.0 {
            return None;
        }
        let here = to.pre_concat(group.abs_transform());
        // What a use shows has no ids.
        let copied = if group.id().is_empty() { copied } else { self.labels.element(group.id()) };
        let around = self.opacity;
        self.opacity *= group.opacity().get();
        let layer = self.layer(group, to, is_clip, copied);
        self.opacity = around;
        let clip = group.clip_path().map(|clip| Box::new(self.clip(clip, here)));
        let mask = group.mask().map(|mask| Box::new(self.mask(mask, here)));
        Some(Item::Group { layer, clip, mask })
    }

    fn path(&mut self, path: &usvg::Path, to: Transform, is_clip: bool, copied: u32) -> Vec<Item> {
        let here = to.pre_concat(path.abs_transform());
        let element = if path.id().is_empty() { copied } else { self.labels.element(path.id()) };
        if self.labels.has_arcs(element) {
            let r = path.data().bounds().transform(here).unwrap_or(path.data().bounds());
            self.slack = self.slack.max(ARC * f64::from(r.width().max(r.height())));
        }
        let mut items = Vec::new();
        // What is fully transparent hides nothing; clip paths have no opacity.
        let is_seen = |opacity: usvg::Opacity| is_clip || opacity.get() > 0.0;
        if let Some(fill) = path.fill().filter(|fill| is_seen(fill.opacity())) {
            let is_evenodd = fill.rule() == FillRule::EvenOdd;
            if let Some(paint) = self.paint(fill.paint(), here) {
                let contours = Sides::new(contours(path.data(), here, self.fine));
                let opacity = self.opacity * fill.opacity().get();
                items.push(Item::Area {
                    contours,
                    band: None,
                    is_evenodd,
                    paint,
                    opacity,
                    element,
                    kind: AreaKind::Fill,
                });
            }
        }
        let stroke = path.stroke().filter(|stroke| !is_clip && is_seen(stroke.opacity()));
        if let Some((stroke, paint)) = stroke.and_then(|s| Some((s, self.paint(s.paint(), here)?))) {
            let mut style = stroke.to_tiny_skia();
            style.dash = None;
            let least = LEAST_WIDTH / PathStroker::compute_resolution_scale(&here);
            style.width = style.width.max(least);
            let dashed = stroke.dasharray().and_then(|d| StrokeDash::new(d.to_vec(), stroke.dashoffset()));
            // Outlines are approximated for a picture of this many pixels a px.
            let scale = FINE * PathStroker::compute_resolution_scale(&here);
            let is_dashed = dashed.is_some();
            let kind = match items.is_empty() {
                true => AreaKind::Line { centre: contours(path.data(), here, self.fine), is_dashed },
                false => AreaKind::Border,
            };
            let line = match dashed {
                Some(dash) => path.data().dash(&dash, scale),
                None => Some(path.data().clone()),
            };
            if let Some((outline, line)) = line.and_then(|line| Some((line.stroke(&style, scale)?, line))) {
                let half = f64::from(style.width) / 2.0 * least_scale(&here);
                let band = Some(Band { lines: Sides::new(contours(&line, here, self.fine)), half });
                let contours = Sides::new(contours(&outline, here, self.fine));
                let opacity = self.opacity * stroke.opacity().get();
                items.push(Item::Area { contours, band, is_evenodd: false, paint, opacity, element, kind });
            }
        }
        if path.paint_order() == PaintOrder::StrokeAndFill {
            items.reverse();
        }
        items
    }

    fn paint(&mut self, paint: &usvg::Paint, here: Transform) -> Option<Paint> {
        match paint {
            usvg::Paint::Color(c) => Some(Paint::Colour([c.red, c.green, c.blue])),
            usvg::Paint::Pattern(pattern) => {
                let to = here.pre_concat(pattern.transform()).invert()?;
                let r = pattern.rect();
                let rect = [r.x(), r.y(), r.width(), r.height()].map(f64::from);
                let around = std::mem::replace(&mut self.opacity, 1.0);
                let tile = Box::new(self.layer(pattern.root(), Transform::identity(), false, UNKNOWN));
                self.opacity = around;
                Some(Paint::Pattern { to, rect, tile })
            }
            usvg::Paint::LinearGradient(_) | usvg::Paint::RadialGradient(_) => None,
        }
    }

    fn clip(&mut self, clip: &usvg::ClipPath, here: Transform) -> Clip {
        let inner = clip.clip_path().map(|c| Box::new(self.clip(c, here)));
        Clip { layer: self.layer(clip.root(), here.pre_concat(clip.transform()), true, UNKNOWN), inner }
    }

    fn mask(&mut self, mask: &usvg::Mask, here: Transform) -> Mask {
        let r = mask.rect();
        Mask {
            layer: self.layer(mask.root(), here, false, UNKNOWN),
            to: here.invert().unwrap_or_default(),
            rect: [r.x(), r.y(), r.width(), r.height()].map(f64::from),
            is_alpha: mask.kind() == MaskType::Alpha,
            inner: mask.mask().map(|m| Box::new(self.mask(m, here))),
        }
    }
}

impl Layer {
    fn pieces<'a>(
        &'a self,
        clips: &mut Vec<&'a Clip>,
        is_masked: bool,
        take: &mut dyn FnMut(PictureShape<'a>, &[&'a Clip]),
    ) {
        for item in &self.items {
            match item {
                Item::Area { contours, is_evenodd, element, kind, paint, .. } => {
                    let outline = match kind {
                        AreaKind::Fill => ShapeOutline::Fill { contours: contours.lines(), is_evenodd: *is_evenodd },
                        AreaKind::Border => continue,
                        AreaKind::Line { centre, is_dashed } => ShapeOutline::Line { centre, is_dashed: *is_dashed },
                    };
                    let is_masked = is_masked || matches!(paint, Paint::Pattern { .. });
                    take(PictureShape { element: *element, outline, is_masked }, clips);
                }
                Item::Group { layer, clip, mask } => {
                    clips.extend(clip.as_deref());
                    layer.pieces(clips, is_masked || mask.is_some(), take);
                    clips.truncate(clips.len() - usize::from(clip.is_some()));
                }
            }
        }
    }

    /// Offers what is painted at a point to `take`, the upper ones first, until it takes one.
    fn find(&self, p: [f64; 2], take: &mut dyn FnMut(Ink) -> bool) -> bool {
        let at = AABB::from_point(p);
        let mut near: Vec<usize> = self.index.locate_in_envelope_intersecting(&at).map(|e| e.data).collect();
        near.sort_unstable_by(|a, b| b.cmp(a));
        near.into_iter().any(|i| self.items[i].find(p, take))
    }

    fn points_near(&self, p: [f64; 2], reach: f64, found: &mut Vec<[f64; 2]>) {
        let about = AABB::from_corners([p[0] - reach, p[1] - reach], [p[0] + reach, p[1] + reach]);
        let mut near: Vec<usize> = self.index.locate_in_envelope_intersecting(&about).map(|e| e.data).collect();
        near.sort_unstable();
        for i in near {
            match &self.items[i] {
                Item::Area { contours, band, .. } => {
                    found.extend(band.iter().filter_map(|band| Some(band.lines.nearest(p, reach)?.0)));
                    if let Some(([x, y], [dx, dy])) = contours.nearest(p, reach) {
                        let beside = reach * BESIDE;
                        found.extend([[x - dy * beside, y + dx * beside], [x + dy * beside, y - dx * beside]]);
                    }
                }
                Item::Group { layer, .. } => layer.points_near(p, reach, found),
            }
        }
    }

    fn has_contour(&self, p: [f64; 2], reach: f64, exists: &dyn Fn(Ink) -> bool) -> bool {
        let about = AABB::from_corners([p[0] - reach, p[1] - reach], [p[0] + reach, p[1] + reach]);
        self.index.locate_in_envelope_intersecting(&about).any(|e| match &self.items[e.data] {
            Item::Area { contours, paint, opacity, element, kind, .. } => contours
                .nearest(p, reach)
                .is_some_and(|(q, _)| paint.find(q, &mut |own| exists(own.within(*opacity, *element, kind)))),
            Item::Group { layer, clip, mask } => {
                let shows = clip.as_ref().is_none_or(|c| c.holds(p)) && mask.as_ref().is_none_or(|m| m.shows(p));
                shows && layer.has_contour(p, reach, exists)
            }
        })
    }

    fn colour_at(&self, p: [f64; 2]) -> Option<[u8; 3]> {
        let mut colour = None;
        self.find(p, &mut |ink| {
            colour = Some(ink.colour);
            true
        });
        colour
    }
}

impl Item {
    fn bounds(&self) -> Option<[[f64; 2]; 2]> {
        let grow = |a: Option<[[f64; 2]; 2]>, p: [f64; 2]| {
            Some(a.map_or([p, p], |[lo, hi]| [[lo[0].min(p[0]), lo[1].min(p[1])], [hi[0].max(p[0]), hi[1].max(p[1])]]))
        };
        match self {
            Self::Area { contours, band, .. } => {
                let lines = band.iter().flat_map(|band| band.lines.lines());
                contours.lines().iter().chain(lines).flatten().copied().fold(None, grow)
            }
            Self::Group { layer, .. } => layer.items.iter().filter_map(Self::bounds).flatten().fold(None, grow),
        }
    }

    fn find(&self, p: [f64; 2], take: &mut dyn FnMut(Ink) -> bool) -> bool {
        match self {
            Self::Area { contours, band, is_evenodd, paint, opacity, element, kind } => {
                let turns = contours.turns(p);
                let is_inside = if *is_evenodd { turns % 2 != 0 } else { turns != 0 }
                    || band.as_ref().is_some_and(|band| band.lines.holds_beside(p, band.half));
                is_inside && paint.find(p, &mut |own| take(own.within(*opacity, *element, kind)))
            }
            Self::Group { layer, clip, mask } => {
                let shows = clip.as_ref().is_none_or(|c| c.holds(p)) && mask.as_ref().is_none_or(|m| m.shows(p));
                let is_plain = mask.is_none();
                shows && layer.find(p, &mut |ink| take(Ink { is_plain_fill: is_plain && ink.is_plain_fill, ..ink }))
            }
        }
    }
}

impl Ink {
    /// The ink as the paint of an area of an element, of this opacity.
    fn within(self, opacity: f32, element: u32, kind: &AreaKind) -> Self {
        let is_plain_fill = self.is_plain_fill && matches!(kind, AreaKind::Fill);
        Self { opacity: self.opacity * opacity, element, is_plain_fill, ..self }
    }
}

impl Paint {
    /// Offers what is painted at a point to `take`, the upper ones first, until it takes one.
    fn find(&self, p: [f64; 2], take: &mut dyn FnMut(Ink) -> bool) -> bool {
        match self {
            Self::Colour(colour) => take(Ink { colour: *colour, opacity: 1.0, element: UNKNOWN, is_plain_fill: true }),
            Self::Pattern { to, rect: [x, y, w, h], tile } => {
                let [u, v] = mapped(to, p);
                // The contents of a tile have their origin in its corner.
                let at = [(u - x).rem_euclid(*w), (v - y).rem_euclid(*h)];
                tile.find(at, &mut |ink| take(Ink { is_plain_fill: false, ..ink }))
            }
        }
    }
}

impl Clip {
    /// Offers the contours of all its areas, and of the clip paths that cut it.
    pub(super) fn contours(&self, take: &mut dyn FnMut(&Contours)) {
        self.layer.pieces(&mut Vec::new(), false, &mut |shape, clips| {
            if let ShapeOutline::Fill { contours, .. } = shape.outline {
                take(contours);
            }
            clips.iter().for_each(|clip| clip.contours(take));
        });
        self.inner.iter().for_each(|inner| inner.contours(take));
    }

    pub(super) fn holds(&self, p: [f64; 2]) -> bool {
        self.layer.colour_at(p).is_some() && self.inner.as_ref().is_none_or(|c| c.holds(p))
    }
}

impl Mask {
    fn shows(&self, p: [f64; 2]) -> bool {
        let [u, v] = mapped(&self.to, p);
        let [x, y, w, h] = self.rect;
        let in_frame = (x..=x + w).contains(&u) && (y..=y + h).contains(&v);
        let is_lit = |c: [u8; 3]| self.is_alpha || c.iter().map(|&v| u32::from(v)).sum::<u32>() > 3 * 127;
        in_frame && self.layer.colour_at(p).is_some_and(is_lit) && self.inner.as_ref().is_none_or(|m| m.shows(p))
    }
}

fn mapped(map: &Transform, [x, y]: [f64; 2]) -> [f64; 2] {
    let [sx, ky, kx, sy, tx, ty] = [map.sx, map.ky, map.kx, map.sy, map.tx, map.ty].map(f64::from);
    [sx * x + kx * y + tx, ky * x + sy * y + ty]
}

/// By how much a map makes the lengths shorter that it makes shortest.
fn least_scale(map: &Transform) -> f64 {
    let [a, b, c, d] = [map.sx, map.ky, map.kx, map.sy].map(f64::from);
    let greatest = math::hypot(a + d, b - c) / 2.0 + math::hypot(a - d, b + c) / 2.0;
    if greatest > 0.0 { (a * d - b * c).abs() / greatest } else { 0.0 }
}

/// The contours of a path as polylines, each closed by its last side.
fn contours(path: &Path, map: Transform, fine: f64) -> Contours {
    let mapped_point = |p: Point| mapped(&map, [f64::from(p.x), f64::from(p.y)]);
    let mut out: Contours = Vec::new();
    // Where the segment at hand begins.
    let mut last = [0.0; 2];
    for segment in path.segments() {
        match segment {
            PathSegment::MoveTo(p) => {
                last = mapped_point(p);
                out.push(vec![last]);
            }
            PathSegment::LineTo(p) => {
                last = mapped_point(p);
                open_contour(&mut out).push(last);
            }
            PathSegment::QuadTo(c, p) => {
                let controls = [c, p].map(mapped_point);
                follow(open_contour(&mut out), last, &controls, fine);
                last = controls[1];
            }
            PathSegment::CubicTo(c, d, p) => {
                let controls = [c, d, p].map(mapped_point);
                follow(open_contour(&mut out), last, &controls, fine);
                last = controls[2];
            }
            PathSegment::Close => {
                let contour = open_contour(&mut out);
                last = contour[0];
                contour.push(last);
            }
        }
    }
    out
}

/// The contour at hand, which has a point.
fn open_contour(contours: &mut Contours) -> &mut Vec<[f64; 2]> {
    contours.last_mut().expect("paths begin with a move")
}

/// Appends a Bézier curve from a point to a contour, in steps that lie no farther than `fine` off the curve.
fn follow(contour: &mut Vec<[f64; 2]>, from: [f64; 2], controls: &[[f64; 2]], fine: f64) {
    let steps = steps(from, controls, fine);
    for k in 1..=steps {
        let t = f64::from(k) / f64::from(steps);
        // De Casteljau.
        let mut points = [from].iter().chain(controls).copied().collect::<Vec<_>>();
        while points.len() > 1 {
            points = points.windows(2).map(|w| [0, 1].map(|i| w[0][i] + t * (w[1][i] - w[0][i]))).collect();
        }
        contour.push(points[0]);
    }
}

/// In how many steps a curve from a point is followed: each lies an eighth of its square times the second derivative
/// off the curve at most.
fn steps(from: [f64; 2], controls: &[[f64; 2]], fine: f64) -> u32 {
    let points: Vec<[f64; 2]> = [from].iter().chain(controls).copied().collect();
    let bend = |w: &[[f64; 2]]| math::hypot(w[0][0] - 2.0 * w[1][0] + w[2][0], w[0][1] - 2.0 * w[1][1] + w[2][1]);
    let degree = controls.len() as f64;
    let second = degree * (degree - 1.0) * points.windows(3).map(bend).fold(0.0, f64::max);
    (second / 8.0 / fine).sqrt().ceil().clamp(1.0, MAX_STEPS) as u32
}
