//! What elements refer to for their looks: clip paths, masks of plain shapes, and patterns.

use std::collections::HashSet;

use roxmltree::Node;
use svg_style::{Map, Reference, ReferenceBox, aspect, href, local, view_box, view_map};

use super::state::{ElementState, PaintedPart};
use super::style::{Coat, Ink, is_gone, painted, rule};
use super::tally::Issue;
use super::walk::{Cut, Purpose, SHAPES, Walk, WalkResult};
use crate::texture::artwork::{MAX_POINTS, PaintedShape, PolygonArea, ShapeFigure, TooMany, WindingRule, lightness};
use crate::texture::clip::Polylines;
use terrace_core::diag::Diag;
use terrace_core::geom::BoxMm;

/// Most copies of the shapes of a pattern.
const MAX_COPIES: f64 = 1e6;

/// Most edges of clip paths and masks, counted again for each element that is cut at them.
const MAX_CUT_EDGES: usize = 1_000_000;

/// Most references from pattern to pattern.
const MAX_LINKS: usize = 32;

/// Lightness (CIE L*) from which and down to which parts of a mask show all or nothing: no eye tells them from white
/// and black.
const LIGHT: f64 = 98.0;
const DARK: f64 = 2.0;

const BLACK: [u8; 3] = [0; 3];

/// How something is painted, its links followed.
pub(super) enum ResolvedPaint<'a, 'input> {
    None,
    Ink(Ink),
    Pattern(Node<'a, 'input>),
}

/// An attribute that says whether something is measured in user units or in the box of the element that refers to it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum UnitsAttribute {
    ClipPath,
    Mask,
    MaskContent,
}

impl UnitsAttribute {
    fn name(self) -> &'static str {
        match self {
            Self::ClipPath => "clipPathUnits",
            Self::Mask => "maskUnits",
            Self::MaskContent => "maskContentUnits",
        }
    }

    /// Whether the box is the unit. Where nothing is said it is that of the frame of a mask alone (CSS Masking 1).
    fn is_box(self, server: Node<'_, '_>) -> bool {
        match server.attribute(self.name()) {
            Some("objectBoundingBox") => true,
            Some("userSpaceOnUse") => false,
            _ => self == Self::Mask,
        }
    }
}

/// What a gradient comes to.
enum Gradient {
    /// All of its stops are painted so.
    Plain(Coat),
    /// The stops of the gradient differ.
    Mixed,
    /// The gradient is stretched to the box of a shape without a size: it is as if there was no gradient (SVG 2, 8.11).
    OfBoxWithoutSize,
}

impl<'a, 'input> Walk<'a, 'input> {
    /// How the area or the stroke of a shape is painted; what cannot be is noted.
    pub(super) fn paint(
        &mut self,
        node: Node<'a, 'input>,
        state: &ElementState,
        part: PaintedPart,
    ) -> Result<ResolvedPaint<'a, 'input>, Box<Diag>> {
        let id = match state.coat(part) {
            Coat::None => return Ok(ResolvedPaint::None),
            Coat::Colour(colour, opacity) => return Ok(ResolvedPaint::Ink(Ink { colour, opacity })),
            Coat::Context => {
                self.note(Issue::Paint, node);
                return Ok(ResolvedPaint::None);
            }
            Coat::External => {
                self.note(Issue::External, node);
                return Ok(ResolvedPaint::None);
            }
            Coat::Server(id) => id,
        };
        let server = self.target(&id);
        match server.map(|s| s.tag_name().name()) {
            Some("pattern" | "linearGradient" | "radialGradient") if self.is_switched_off(server)? => {
                // Browsers paint nothing, other viewers do.
                self.note(Issue::Paint, node);
                return Ok(ResolvedPaint::None);
            }
            Some("pattern") if self.is_empty_pattern(server) => {}
            Some("pattern") => return Ok(server.map_or(ResolvedPaint::None, ResolvedPaint::Pattern)),
            Some("linearGradient" | "radialGradient") => {
                let opacity = state.opacity * state.own_opacity(part);
                let Some(server) = server else { return Ok(ResolvedPaint::None) };
                match self.only_colour(server, node, state)? {
                    Gradient::OfBoxWithoutSize => {}
                    Gradient::Plain(Coat::Colour(colour, alpha)) => {
                        return Ok(ResolvedPaint::Ink(Ink { colour, opacity: alpha * opacity as f32 }));
                    }
                    Gradient::Plain(_) => return Ok(ResolvedPaint::None),
                    Gradient::Mixed => {
                        self.note(Issue::Paint, node);
                        return Ok(ResolvedPaint::None);
                    }
                }
            }
            // Browsers do not know these, other programs do.
            Some("hatch" | "mesh" | "meshgradient" | "meshGradient" | "solidcolor" | "solidColor") => {
                self.note(Issue::Paint, node);
                return Ok(ResolvedPaint::None);
            }
            // A pattern that is painted with itself.
            None if self.has_id(&id) => {
                self.note(Issue::Paint, node);
                return Ok(ResolvedPaint::None);
            }
            _ => {}
        }
        Ok(match state.fallback(part) {
            Coat::Colour(colour, opacity) => ResolvedPaint::Ink(Ink { colour, opacity }),
            _ => ResolvedPaint::None,
        })
    }

    /// Whether a paint server is not displayed itself.
    fn is_switched_off(&mut self, server: Option<Node<'a, 'input>>) -> Result<bool, Box<Diag>> {
        server.map_or(Ok(false), |s| Ok(is_gone(&*self.style_of(s)?)))
    }

    /// Whether neither a pattern nor those that it refers to hold anything.
    fn is_empty_pattern(&self, pattern: Option<Node<'a, 'input>>) -> bool {
        let chain = pattern.and_then(|p| self.chain(p, |n| n.tag_name().name() == "pattern"));
        chain.is_some_and(|chain| !chain.iter().any(|p| p.children().any(|c| c.is_element())))
    }

    /// What a gradient comes to on an element.
    fn only_colour(
        &mut self,
        gradient: Node<'a, 'input>,
        node: Node<'a, 'input>,
        state: &ElementState,
    ) -> Result<Gradient, Box<Diag>> {
        let is_gradient = |n: &Node<'_, '_>| matches!(n.tag_name().name(), "linearGradient" | "radialGradient");
        let Some(chain) = self.chain(gradient, is_gradient) else { return Ok(Gradient::Mixed) };
        let is_stop = |n: &Node<'_, '_>| n.is_element() && n.tag_name().name() == "stop";
        let Some(holder) = chain.iter().find(|g| g.children().any(|n| is_stop(&n))) else {
            return Ok(Gradient::Plain(Coat::None));
        };
        let units = chain.iter().find_map(|g| g.attribute("gradientUnits"));
        let bounds = self.bounds(node, state)?.size();
        if units != Some("userSpaceOnUse") && !(bounds[0] > 0.0 && bounds[1] > 0.0) {
            return Ok(Gradient::OfBoxWithoutSize);
        }
        let outer = self.style_of(*holder)?;
        let mut only = None;
        for stop in holder.children().filter(is_stop) {
            let style = self.style(stop, &outer, None)?;
            let coat = painted(style.stop_color.resolved(style.current()), style.stop_opacity as f32);
            if *only.get_or_insert_with(|| coat.clone()) != coat {
                return Ok(Gradient::Mixed);
            }
        }
        Ok(Gradient::Plain(only.unwrap_or(Coat::None)))
    }

    /// A server and those that it takes what it does not say from; None where one is missing or there are too many.
    fn chain(
        &self,
        server: Node<'a, 'input>,
        is_meant: impl Fn(&Node<'a, 'input>) -> bool,
    ) -> Option<Vec<Node<'a, 'input>>> {
        let mut chain = vec![server];
        while let Some(link) = chain.last().and_then(|p| href(*p)).filter(|link| !link.is_empty()) {
            let next = self.target(&local(link)?).filter(|n| is_meant(n) && !chain.contains(n))?;
            chain.push(next);
            if chain.len() > MAX_LINKS {
                return None;
            }
        }
        Some(chain)
    }

    /// Cuts what `state` holds at a clip path or mask; returns whether something of the element may be drawn.
    pub(super) fn cut(
        &mut self,
        node: Node<'a, 'input>,
        link: &Reference,
        cut: Cut,
        state: &mut ElementState,
    ) -> Result<bool, Box<Diag>> {
        let tag = match cut {
            Cut::ClipPath => "clipPath",
            Cut::Mask => "mask",
        };
        let target = match link {
            Reference::Link(link) => self.linked(link).filter(|t| t.tag_name().name() == tag),
            _ => None,
        };
        let Some(target) = target else {
            // Programs disagree on what a missing clip path hides.
            self.note(Issue::Effect, node);
            return Ok(false);
        };
        self.uses.push(target.id());
        let area = match cut {
            Cut::ClipPath => self.clip_path(node, target, state),
            Cut::Mask => self.mask(node, target, state),
        };
        self.uses.pop();
        let Some(area) = area? else {
            self.note(Issue::Effect, node);
            return Ok(false);
        };
        self.cut_edges += area.edge_count() + 1;
        if self.cut_edges > MAX_CUT_EDGES {
            let text = format!("the clip paths and masks of the drawing have more than {MAX_CUT_EDGES} edges");
            return Err(Diag::input("svg-large", format!("{text} once their uses are expanded"))
                .hint("apply clip paths and masks in the drawing program")
                .into());
        }
        state.clip = Some(self.clip(state.clip, area, node)?);
        Ok(true)
    }

    /// The state in which a clip path or mask draws what it holds: its style is that of its place in the document.
    fn inside(&mut self, server: Node<'a, 'input>, outer: &ElementState) -> Result<Option<ElementState>, Box<Diag>> {
        let parent = match server.parent_element() {
            Some(parent) => self.style_of(parent)?,
            None => self.style_of(server)?,
        };
        self.begin(
            server,
            &ElementState { clip: None, opacity: 1.0, copied: None, context: None, style: parent, ..outer.clone() },
        )
    }

    /// The area of a clip path on an element; None where it cannot be reproduced.
    fn clip_path(
        &mut self,
        node: Node<'a, 'input>,
        clip: Node<'a, 'input>,
        outer: &ElementState,
    ) -> Result<Option<PolygonArea>, Box<Diag>> {
        let purpose = std::mem::replace(&mut self.purpose, Purpose::Clip);
        let inside = self.inside(clip, outer);
        self.purpose = purpose;
        let Some(mut state) = inside? else { return Ok(None) };
        if state.style.mask != Reference::None {
            return Ok(None);
        }
        // Its transform is of the element's units, and the units of the box come within (SVG 2, 14.3.4).
        if !self.moved(clip, &mut state)? {
            return Ok(None);
        }
        if !self.scaled_to_box(clip, UnitsAttribute::ClipPath, node, outer, &mut state)? {
            return Ok(Some(PolygonArea::default()));
        }
        if !self.shows_through(clip, &mut state)? {
            return Ok(None);
        }
        if !clip.children().filter(Node::is_element).all(is_plain_part) {
            return Ok(None);
        }
        let art = self.aside(Purpose::Clip, |walk| walk.children(clip, &state))?;
        let areas: Result<Vec<PolygonArea>, TooMany> = art.shapes.iter().map(|s| self.area_of(&art, s)).collect();
        let union = areas.and_then(|areas| PolygonArea::union(areas.iter()));
        let area = match (union, state.clip) {
            (Ok(area), Some(own)) => area.within(&self.art.clips[own as usize]),
            (union, _) => union,
        };
        area.map(Some).map_err(|TooMany| self.tangled(clip))
    }

    /// What a mask of opaque black and white shapes shows of an element; None where it has others.
    fn mask(
        &mut self,
        node: Node<'a, 'input>,
        mask: Node<'a, 'input>,
        outer: &ElementState,
    ) -> Result<Option<PolygonArea>, Box<Diag>> {
        let Some(mut state) = self.inside(mask, outer)? else { return Ok(None) };
        if state.style.mask != Reference::None || state.style.clip_path != Reference::None {
            // Browsers ignore them, other viewers do not.
            return Ok(None);
        }
        let is_alpha = state.style.is_alpha_mask;
        // In units of its own: those of the frame at which the mask ends may differ from those of its contents.
        let mut frame = state.clone();
        if !self.scaled_to_box(mask, UnitsAttribute::Mask, node, outer, &mut frame)? {
            return Ok(Some(PolygonArea::default()));
        }
        // A tenth beyond the box on each side unless it says otherwise (CSS Masking 1).
        let corner = [self.mask_side(mask, "x", 0, -0.1, &state), self.mask_side(mask, "y", 1, -0.1, &state)];
        let size = [self.mask_side(mask, "width", 0, 1.2, &state), self.mask_side(mask, "height", 1, 1.2, &state)];
        let corners = corners(corner, size).map(|c| frame.map.at(c));
        if !self.scaled_to_box(mask, UnitsAttribute::MaskContent, node, outer, &mut state)? {
            return Ok(Some(PolygonArea::default()));
        }
        if !self.shows_through(mask, &mut state)? {
            return Ok(None);
        }
        let refused = self.refused();
        let art = self.aside(Purpose::Mask, |walk| walk.children(mask, &state))?;
        if self.refused() > refused {
            return Ok(None);
        }
        let mut shown = PolygonArea::default();
        for shape in &art.shapes {
            let area = self.area_of(&art, shape).map_err(|TooMany| self.tangled(mask))?;
            if shape.opacity < 1.0 {
                return Ok(None);
            }
            let light = lightness(shape.colour);
            shown = match () {
                () if is_alpha || light >= LIGHT => PolygonArea::union([&shown, &area].into_iter()),
                () if light <= DARK => shown.without(&area),
                () => return Ok(None),
            }
            .map_err(|TooMany| self.tangled(mask))?;
        }
        let frame = PolygonArea::new([corners.as_slice()].into_iter(), WindingRule::NonZero).expect("four edges");
        let mut shown = shown.within(&frame);
        if let (Ok(area), Some(own)) = (&shown, state.clip) {
            shown = area.within(&self.art.clips[own as usize]);
        }
        shown.map(Some).map_err(|TooMany| self.tangled(mask))
    }

    /// A length of the frame of a mask, in the units of the frame; `default` is a share of the box or of the viewport.
    fn mask_side(
        &mut self,
        mask: Node<'a, 'input>,
        name: &str,
        axis: usize,
        default: f64,
        state: &ElementState,
    ) -> f64 {
        match mask.attribute(name) {
            _ if UnitsAttribute::Mask.is_box(mask) => share(mask, name).unwrap_or(default),
            Some(_) => self.length(mask, name, axis, state),
            None => default * state.port[axis],
        }
    }

    /// How many times something was met that is refused.
    fn refused(&self) -> usize {
        self.tally.refused() + self.remarks.refused()
    }

    /// Fills a shape with a pattern.
    pub(super) fn painted(
        &mut self,
        node: Node<'a, 'input>,
        tag: &str,
        state: &ElementState,
        pattern: Node<'a, 'input>,
    ) -> WalkResult {
        let shape = self.aside(self.purpose, |walk| {
            let whole = ElementState { clip: None, ..state.clone() };
            walk.subpaths(node, tag, &whole, Ink::plain(BLACK), ShapeFigure::Fill(rule(state.style.fill_rule)))
                .map(|_| ())
        })?;
        let Some(area) = shape.shapes.first().map(|s| self.area_of(&shape, s)) else { return Ok(()) };
        let area = area.map_err(|TooMany| self.tangled(node))?;
        let Some(tile) = self.tile(node, pattern, state)? else {
            self.note(Issue::Paint, node);
            return Ok(());
        };
        if area.is_empty() {
            return Ok(());
        }
        let ranges = tile.ranges(&area);
        let copies: f64 = ranges.iter().map(|[from, to]| to - from).product();
        let points = copies * tile.art.lines.points.len() as f64 + self.art.lines.points.len() as f64;
        if !(copies * tile.art.shapes.len().max(1) as f64 <= MAX_COPIES && points <= MAX_POINTS as f64) {
            let text = format!("the pattern of {} has too many tiles ({copies:.0})", self.called(node));
            return Err(Diag::input("svg-large", text)
                .hint("draw the pattern on a page of its own and repeat it with tile = true")
                .into());
        }
        let clip = Some(self.clip(state.clip, area, node)?);
        let name = self.name(node);
        for j in ranges[1][0] as i64..ranges[1][1] as i64 {
            for i in ranges[0][0] as i64..ranges[0][1] as i64 {
                let by = tile.shift(i, j);
                for shape in &tile.art.shapes {
                    let first = self.art.lines.len();
                    for k in shape.lines.clone() {
                        let moved = tile.art.lines.get(k).iter().map(|p| [p[0] + by[0], p[1] + by[1]]);
                        self.art.lines.points.extend(moved);
                        self.art.lines.finish();
                    }
                    let lines = first..self.art.lines.len();
                    self.art.shapes.push(PaintedShape { name, labels: state.labels, lines, clip, ..shape.clone() });
                }
            }
        }
        Ok(())
    }

    /// One tile of a pattern, cut at its border; None where it cannot be drawn.
    fn tile(
        &mut self,
        node: Node<'a, 'input>,
        pattern: Node<'a, 'input>,
        outer: &ElementState,
    ) -> Result<Option<PatternTile>, Box<Diag>> {
        // A pattern takes what it does not say from the one that it refers to.
        let Some(chain) = self.chain(pattern, |n| n.tag_name().name() == "pattern") else { return Ok(None) };
        let holder_of = |name: &str| chain.iter().copied().find(|p| p.has_attribute(name));
        let content = chain.iter().copied().find(|p| p.children().any(|c| c.is_element())).unwrap_or(pattern);
        let style = self.style_of(content)?;
        let mut state = ElementState { clip: None, opacity: 1.0, copied: None, context: None, style, ..outer.clone() };
        match self.pattern_map(&chain, &state)? {
            Some(map) => state.map = map,
            None => return Ok(None),
        }
        let own = ElementState { style: self.style_of(pattern)?, ..outer.clone() };
        let is_box = holder_of("patternUnits").and_then(|p| p.attribute("patternUnits")) != Some("userSpaceOnUse");
        let is_box_content = holder_of("patternContentUnits").and_then(|p| p.attribute("patternContentUnits"))
            == Some("objectBoundingBox");
        let bounds =
            if is_box || is_box_content { self.bounds(node, outer)? } else { BoxMm { lo: [0.0; 2], hi: [1.0; 2] } };
        let [w, h] = bounds.size();
        let [x, y, width, height] =
            [("x", 0), ("y", 1), ("width", 0), ("height", 1)].map(|(name, axis)| match holder_of(name) {
                None => 0.0,
                Some(p) if is_box => share(p, name).unwrap_or(0.0) * [w, h][axis],
                Some(p) => self.length(p, name, axis, &own),
            });
        let mut at = [x, y];
        let size = [width, height];
        if is_box {
            at = [at[0] + bounds.lo[0], at[1] + bounds.lo[1]];
        }
        if !(size[0] > 0.0 && size[1] > 0.0 && w > 0.0 && h > 0.0 && state.map.is_regular()) {
            return Ok(None);
        }
        let map = state.map;
        let corners = corners(at, size).map(|c| map.at(c));
        match holder_of("viewBox").map(view_box) {
            Some(Ok(Some(view))) => {
                let aspect = aspect(holder_of("preserveAspectRatio").unwrap_or(pattern));
                state.map = map.after(Map::shift(at)).after(view_map(view, size, aspect));
                state.port = [view.w, view.h];
            }
            Some(_) => return Ok(None),
            None if is_box_content => state.map = map.after(Map::shift(at)).after(Map::scale(w, h, [0.0; 2])),
            None => state.map = map.after(Map::shift(at)),
        }
        let refused = self.refused();
        self.uses.extend(chain.iter().map(|n| n.id()));
        let art = self.aside(Purpose::Mark, |walk| walk.children(content, &state));
        self.uses.truncate(self.uses.len() - chain.len());
        let art = art?;
        if self.refused() > refused {
            return Ok(None);
        }
        let frame = PolygonArea::new([corners.as_slice()].into_iter(), WindingRule::NonZero).expect("four edges");
        let art = self.cut_out(&art, &frame).map_err(|TooMany| self.tangled(pattern))?;
        Ok(Some(PatternTile { art, map, at, size }))
    }

    /// The map of a pattern's units to the page: that of `state`, with the transform of the first in `chain` that has
    /// one. The chain is the pattern and those that it refers to. None where the transform cannot be drawn.
    fn pattern_map(&mut self, chain: &[Node<'a, 'input>], state: &ElementState) -> Result<Option<Map>, Box<Diag>> {
        for &pattern in chain {
            let mut own = ElementState { style: self.style_of(pattern)?, ..state.clone() };
            if own.style.has_transform() {
                return Ok(self.moved(pattern, &mut own)?.then_some(own.map));
            }
        }
        Ok(Some(state.map))
    }

    /// Draws into shapes of their own, which refer to the clips, names and labels of the drawing.
    fn aside(
        &mut self,
        purpose: Purpose,
        walk: impl FnOnce(&mut Self) -> WalkResult,
    ) -> Result<DetachedShapes, Box<Diag>> {
        let shapes = std::mem::take(&mut self.art.shapes);
        let lines = std::mem::take(&mut self.art.lines);
        let before = std::mem::replace(&mut self.purpose, purpose);
        let result = walk(self);
        self.purpose = before;
        let shapes = std::mem::replace(&mut self.art.shapes, shapes);
        let lines = std::mem::replace(&mut self.art.lines, lines);
        result.map(|()| DetachedShapes { shapes, lines })
    }

    /// The box of an element without its strokes, in its own units.
    pub(super) fn bounds(&mut self, node: Node<'a, 'input>, state: &ElementState) -> Result<BoxMm<2>, Box<Diag>> {
        let map = Map::shift([0.0; 2]);
        let inner = ElementState { map, clip: None, style: state.parent.clone(), depth: state.depth, ..state.clone() };
        let tolerance = self.tolerance;
        self.tolerance = tolerance / state.map.enlarges();
        let quiet = std::mem::replace(&mut self.is_quiet, true);
        let boxed = self.boxed.replace(node.id());
        let aside = self.aside(Purpose::Bounds, |walk| walk.element(node, &inner));
        (self.is_quiet, self.tolerance, self.boxed) = (quiet, tolerance, boxed);
        Ok(BoxMm::of(aside?.lines.points.iter().copied()))
    }

    /// The traits of an element, what it holds and what that uses.
    fn content_traits(&mut self, node: Node<'a, 'input>, state: &ElementState) -> Result<ContentTraits, Box<Diag>> {
        let mut traits = ContentTraits { is_turned: false, is_stroked: state.style.stroke != svg_style::Paint::None };
        let mut used_nodes = HashSet::new();
        let mut left = vec![node];
        let quiet = std::mem::replace(&mut self.is_quiet, true);
        while let Some(top) = left.pop() {
            for inner in top.descendants().filter(Node::is_element) {
                let style = self.style(inner, &state.parent, state.copied)?;
                traits.is_stroked |= style.stroke != svg_style::Paint::None;
                // A box that transforms refer to is not known here.
                let size = ReferenceBox { corner: [0.0; 2], size: state.port };
                let is_turned = style.has_transform() && !style.matrix(size).is_aligned();
                traits.is_turned |= inner != node && is_turned;
                let link = href(inner).filter(|_| inner.tag_name().name() == "use").and_then(local);
                if let Some(target) = link.and_then(|id| self.target(&id)).filter(|t| used_nodes.insert(t.id())) {
                    left.push(target);
                }
            }
        }
        self.is_quiet = quiet;
        Ok(traits)
    }

    /// The area of a shape, cut at its clip.
    fn area_of(&self, aside: &DetachedShapes, shape: &PaintedShape) -> Result<PolygonArea, TooMany> {
        let rule = if let ShapeFigure::Fill(rule) = shape.figure { rule } else { WindingRule::NonZero };
        let area = PolygonArea::new(shape.lines.clone().map(|k| aside.lines.get(k)), rule)?;
        shape.clip.map_or(Ok(area.clone()), |clip| area.within(&self.art.clips[clip as usize]))
    }

    /// The same with every shape cut at its clip, and at a frame.
    fn cut_out(&self, aside: &DetachedShapes, frame: &PolygonArea) -> Result<DetachedShapes, TooMany> {
        let mut out = DetachedShapes { shapes: Vec::new(), lines: Polylines::default() };
        for shape in &aside.shapes {
            let first = out.lines.len();
            let clip = match shape.clip.map(|c| &self.art.clips[c as usize]) {
                Some(clip) => clip.within(frame)?,
                None => frame.clone(),
            };
            let lines = shape.lines.clone().map(|k| aside.lines.get(k));
            let mut figure = shape.figure;
            if figure == ShapeFigure::Lines {
                clip.cut(lines, &mut out.lines);
            } else {
                let rule = if let ShapeFigure::Fill(rule) = figure { rule } else { WindingRule::NonZero };
                for contour in PolygonArea::new(lines, rule)?.within(&clip)?.contours() {
                    out.lines.points.extend(contour.iter().chain(contour.first()));
                    out.lines.finish();
                }
                if let ShapeFigure::Fill(rule) = &mut figure {
                    *rule = WindingRule::NonZero;
                }
            }
            let lines = first..out.lines.len();
            out.shapes.push(PaintedShape { figure, lines, clip: None, ..shape.clone() });
        }
        Ok(out)
    }

    /// Scales the state to the box of an element where an attribute says so; returns whether that has a size.
    fn scaled_to_box(
        &mut self,
        server: Node<'a, 'input>,
        units: UnitsAttribute,
        node: Node<'a, 'input>,
        outer: &ElementState,
        state: &mut ElementState,
    ) -> Result<bool, Box<Diag>> {
        if units.is_box(server) {
            // SVG 2, 8.10 has the tightest box; some programs turn the box of each shape and get a larger one. The
            // frame of a mask reaches a tenth beyond either, unless it says otherwise: it could cut strokes alone.
            let traits = self.content_traits(node, outer)?;
            let sides = ["x", "y", "width", "height"];
            let is_roomy = units == UnitsAttribute::Mask && !sides.iter().any(|name| server.has_attribute(*name));
            if traits.is_turned && (traits.is_stroked || !is_roomy) {
                self.note(Issue::Box, node);
                return Ok(false);
            }
            let bounds = self.bounds(node, outer)?;
            let [w, h] = bounds.size();
            if !(w > 0.0 && h > 0.0) {
                return Ok(false);
            }
            state.map = state.map.after(Map::scale(w, h, bounds.lo));
            state.port = [1.0, 1.0];
        }
        Ok(true)
    }
}

/// What decides on which box of an element programs agree.
struct ContentTraits {
    /// An element in it is turned or skewed against what it lies in.
    is_turned: bool,
    /// It or an element in it has a stroke.
    is_stroked: bool,
}

/// Shapes that are not part of the drawing.
struct DetachedShapes {
    shapes: Vec<PaintedShape>,
    lines: Polylines,
}

/// A tile of a pattern.
struct PatternTile {
    /// What it shows, page mm, where the pattern's own origin puts it.
    art: DetachedShapes,
    /// From the pattern's units to page mm.
    map: Map,
    /// Corner and size of the tile in the pattern's units.
    at: [f64; 2],
    size: [f64; 2],
}

impl PatternTile {
    /// The numbers of the columns and the rows of tiles that an area meets, each up to the second.
    fn ranges(&self, area: &PolygonArea) -> [[f64; 2]; 2] {
        let back = self.map.inverse();
        let BoxMm { lo, hi } = BoxMm::of(area.contours().flatten().map(|&p| back.at(p)));
        [0, 1].map(|k| {
            let index = |v: f64| (v - self.at[k]) / self.size[k];
            // Noise must not add a row of tiles that only touches the area.
            [(index(lo[k]) + 1e-9).floor(), (index(hi[k]) - 1e-9).ceil()]
        })
    }

    /// By what tile (i, j) is shifted on the page.
    fn shift(&self, i: i64, j: i64) -> [f64; 2] {
        let [x, y] = [i as f64 * self.size[0], j as f64 * self.size[1]];
        [self.map.a * x + self.map.c * y, self.map.b * x + self.map.d * y]
    }
}

/// Whether an element may be part of a clip path.
fn is_plain_part(node: Node<'_, '_>) -> bool {
    let tag = node.tag_name().name();
    SHAPES.contains(&tag) || matches!(tag, "use" | "title" | "desc" | "metadata")
}

/// An attribute that is a share, 0.25 or 25%.
fn share(node: Node<'_, '_>, name: &str) -> Option<f64> {
    let text = node.attribute(name)?.trim();
    let value = match text.strip_suffix('%') {
        Some(percent) => percent.parse::<f64>().ok()? / 100.0,
        None => text.parse().ok()?,
    };
    value.is_finite().then_some(value)
}

fn corners([x, y]: [f64; 2], [w, h]: [f64; 2]) -> [[f64; 2]; 4] {
    [[x, y], [x + w, y], [x + w, y + h], [x, y + h]]
}
