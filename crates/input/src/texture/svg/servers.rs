//! What elements refer to for their looks: clip paths, masks of plain shapes, and patterns.

use std::collections::HashSet;

use roxmltree::Node;
use svg_style::{Map, Reference, ReferenceBox, aspect, href, local, view_box, view_map};

use super::state::State;
use super::style::{Coat, Ink, is_gone, painted, rule};
use super::tally::Issue;
use super::walk::{Done, Purpose, SHAPES, Walk};
use crate::texture::artwork::{Area, Figure, MAX_POINTS, Rule, Shape, TooMany, lightness};
use crate::texture::clip::Lines;
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
pub(super) enum Paint<'a, 'input> {
    None,
    Ink(Ink),
    Pattern(Node<'a, 'input>),
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
        state: &State,
        is_fill: bool,
    ) -> Result<Paint<'a, 'input>, Box<Diag>> {
        let coat = if is_fill { state.fill() } else { state.stroke() };
        let id = match coat {
            Coat::None => return Ok(Paint::None),
            Coat::Colour(colour, opacity) => return Ok(Paint::Ink(Ink { colour, opacity })),
            Coat::Context => {
                self.note(Issue::Paint, node);
                return Ok(Paint::None);
            }
            Coat::External => {
                self.note(Issue::External, node);
                return Ok(Paint::None);
            }
            Coat::Server(id) => id,
        };
        let server = self.target(&id);
        match server.map(|s| s.tag_name().name()) {
            Some("pattern" | "linearGradient" | "radialGradient") if self.is_switched_off(server)? => {
                // Browsers paint nothing, other viewers do.
                self.note(Issue::Paint, node);
                return Ok(Paint::None);
            }
            Some("pattern") if self.is_empty_pattern(server) => {}
            Some("pattern") => return Ok(server.map_or(Paint::None, Paint::Pattern)),
            Some("linearGradient" | "radialGradient") => {
                let opacity =
                    state.opacity * if is_fill { state.style.fill_opacity } else { state.style.stroke_opacity };
                let Some(server) = server else { return Ok(Paint::None) };
                match self.only_colour(server, node, state)? {
                    Gradient::OfBoxWithoutSize => {}
                    Gradient::Plain(Coat::Colour(colour, alpha)) => {
                        return Ok(Paint::Ink(Ink { colour, opacity: alpha * opacity as f32 }));
                    }
                    Gradient::Plain(_) => return Ok(Paint::None),
                    Gradient::Mixed => {
                        self.note(Issue::Paint, node);
                        return Ok(Paint::None);
                    }
                }
            }
            // Browsers do not know these, other programs do.
            Some("hatch" | "mesh" | "meshgradient" | "meshGradient" | "solidcolor" | "solidColor") => {
                self.note(Issue::Paint, node);
                return Ok(Paint::None);
            }
            // A pattern that is painted with itself.
            None if self.has_id(&id) => {
                self.note(Issue::Paint, node);
                return Ok(Paint::None);
            }
            _ => {}
        }
        Ok(match state.fallback(is_fill) {
            Coat::Colour(colour, opacity) => Paint::Ink(Ink { colour, opacity }),
            _ => Paint::None,
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
        state: &State,
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
        is_mask: bool,
        state: &mut State,
    ) -> Result<bool, Box<Diag>> {
        let tag = if is_mask { "mask" } else { "clipPath" };
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
        let area = if is_mask { self.mask(node, target, state) } else { self.clip_path(node, target, state) };
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
    fn inside(&mut self, server: Node<'a, 'input>, outer: &State) -> Result<Option<State>, Box<Diag>> {
        let parent = match server.parent_element() {
            Some(parent) => self.style_of(parent)?,
            None => self.style_of(server)?,
        };
        self.begin(
            server,
            &State { clip: None, opacity: 1.0, copied: None, context: None, style: parent, ..outer.clone() },
        )
    }

    /// The area of a clip path on an element; None where it cannot be reproduced.
    fn clip_path(
        &mut self,
        node: Node<'a, 'input>,
        clip: Node<'a, 'input>,
        outer: &State,
    ) -> Result<Option<Area>, Box<Diag>> {
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
        if !self.scaled_to_box(clip, "clipPathUnits", false, node, outer, &mut state)? {
            return Ok(Some(Area::default()));
        }
        if !self.shows_through(clip, &mut state)? {
            return Ok(None);
        }
        let plain = |n: &Node<'_, '_>| {
            let tag = n.tag_name().name();
            SHAPES.contains(&tag) || matches!(tag, "use" | "title" | "desc" | "metadata")
        };
        if !clip.children().filter(Node::is_element).all(|n| plain(&n)) {
            return Ok(None);
        }
        let art = self.aside(Purpose::Clip, |walk| walk.children(clip, &state))?;
        let areas: Result<Vec<Area>, TooMany> = art.shapes.iter().map(|s| self.area_of(&art, s)).collect();
        let union = areas.and_then(|areas| Area::union(areas.iter()));
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
        outer: &State,
    ) -> Result<Option<Area>, Box<Diag>> {
        let Some(mut state) = self.inside(mask, outer)? else { return Ok(None) };
        if state.style.mask != Reference::None || state.style.clip_path != Reference::None {
            // Browsers ignore them, other viewers do not.
            return Ok(None);
        }
        let is_alpha = state.style.is_alpha_mask;
        // Where the mask itself ends.
        let mut frame = state.clone();
        if !self.scaled_to_box(mask, "maskUnits", true, node, outer, &mut frame)? {
            return Ok(Some(Area::default()));
        }
        let is_box = mask.attribute("maskUnits") != Some("userSpaceOnUse");
        let side = |walk: &mut Self, name: &str, axis: usize, default: f64| match mask.attribute(name) {
            _ if is_box => share(mask, name).unwrap_or(default),
            Some(_) => walk.length(mask, name, axis, &state),
            None => default * state.port[axis],
        };
        let at = [side(self, "x", 0, -0.1), side(self, "y", 1, -0.1)];
        let size = [side(self, "width", 0, 1.2), side(self, "height", 1, 1.2)];
        let corners = corners(at, size).map(|c| frame.map.at(c));
        if !self.scaled_to_box(mask, "maskContentUnits", false, node, outer, &mut state)? {
            return Ok(Some(Area::default()));
        }
        if !self.shows_through(mask, &mut state)? {
            return Ok(None);
        }
        let refused = self.refused();
        let art = self.aside(Purpose::Mask, |walk| walk.children(mask, &state))?;
        if self.refused() > refused {
            return Ok(None);
        }
        let mut shown = Area::default();
        for shape in &art.shapes {
            let area = self.area_of(&art, shape).map_err(|TooMany| self.tangled(mask))?;
            if shape.opacity < 1.0 {
                return Ok(None);
            }
            let light = lightness(shape.colour);
            shown = match () {
                () if is_alpha || light >= LIGHT => Area::union([&shown, &area].into_iter()),
                () if light <= DARK => shown.without(&area),
                () => return Ok(None),
            }
            .map_err(|TooMany| self.tangled(mask))?;
        }
        let frame = Area::new([corners.as_slice()].into_iter(), Rule::NonZero).expect("four edges");
        let mut shown = shown.within(&frame);
        if let (Ok(area), Some(own)) = (&shown, state.clip) {
            shown = area.within(&self.art.clips[own as usize]);
        }
        shown.map(Some).map_err(|TooMany| self.tangled(mask))
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
        state: &State,
        pattern: Node<'a, 'input>,
    ) -> Done {
        let shape = self.aside(self.purpose, |walk| {
            let whole = State { clip: None, ..state.clone() };
            walk.subpaths(node, tag, &whole, Ink::plain(BLACK), Figure::Fill(rule(state.style.fill_rule))).map(|_| ())
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
        let back = tile.map.inverse();
        let BoxMm { lo, hi } = BoxMm::of(area.contours().flatten().map(|&p| back.at(p)));
        let range = |k: usize| {
            let index = |v: f64| (v - tile.at[k]) / tile.size[k];
            [(index(lo[k]) + 1e-9).floor(), (index(hi[k]) - 1e-9).ceil()]
        };
        let ranges = [range(0), range(1)];
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
                let [x, y] = [i as f64 * tile.size[0], j as f64 * tile.size[1]];
                // A shift in the pattern's units, on the page.
                let by = [tile.map.a * x + tile.map.c * y, tile.map.b * x + tile.map.d * y];
                for shape in &tile.art.shapes {
                    let first = self.art.lines.len();
                    for k in shape.lines.clone() {
                        let moved = tile.art.lines.get(k).iter().map(|p| [p[0] + by[0], p[1] + by[1]]);
                        self.art.lines.points.extend(moved);
                        self.art.lines.finish();
                    }
                    let lines = first..self.art.lines.len();
                    self.art.shapes.push(Shape { name, labels: state.labels, lines, clip, ..shape.clone() });
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
        outer: &State,
    ) -> Result<Option<Tile>, Box<Diag>> {
        // A pattern takes what it does not say from the one that it refers to.
        let Some(chain) = self.chain(pattern, |n| n.tag_name().name() == "pattern") else { return Ok(None) };
        let with = |name: &str| chain.iter().copied().find(|p| p.has_attribute(name));
        let content = chain.iter().copied().find(|p| p.children().any(|c| c.is_element())).unwrap_or(pattern);
        let style = self.style_of(content)?;
        let mut state = State { clip: None, opacity: 1.0, copied: None, context: None, style, ..outer.clone() };
        for &own in &chain {
            // The transform of the first that has one.
            let moving = State { style: self.style_of(own)?, ..state.clone() };
            if moving.style.has_transform() {
                let mut moved = moving;
                if !self.moved(own, &mut moved)? {
                    return Ok(None);
                }
                state.map = moved.map;
                break;
            }
        }
        let own = State { style: self.style_of(pattern)?, ..outer.clone() };
        let is_box = with("patternUnits").and_then(|p| p.attribute("patternUnits")) != Some("userSpaceOnUse");
        let is_box_content =
            with("patternContentUnits").and_then(|p| p.attribute("patternContentUnits")) == Some("objectBoundingBox");
        let bounds =
            if is_box || is_box_content { self.bounds(node, outer)? } else { BoxMm { lo: [0.0; 2], hi: [1.0; 2] } };
        let [w, h] = bounds.size();
        let side = |walk: &mut Self, name: &str, axis: usize| match with(name) {
            None => 0.0,
            Some(p) if is_box => share(p, name).unwrap_or(0.0) * [w, h][axis],
            Some(p) => walk.length(p, name, axis, &own),
        };
        let mut at = [side(self, "x", 0), side(self, "y", 1)];
        let size = [side(self, "width", 0), side(self, "height", 1)];
        if is_box {
            at = [at[0] + bounds.lo[0], at[1] + bounds.lo[1]];
        }
        if !(size[0] > 0.0 && size[1] > 0.0 && w > 0.0 && h > 0.0 && state.map.is_regular()) {
            return Ok(None);
        }
        let map = state.map;
        let corners = corners(at, size).map(|c| map.at(c));
        match with("viewBox").map(view_box) {
            Some(Ok(Some(view))) => {
                let aspect = aspect(with("preserveAspectRatio").unwrap_or(pattern));
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
        let frame = Area::new([corners.as_slice()].into_iter(), Rule::NonZero).expect("four edges");
        let art = self.cut_out(&art, &frame).map_err(|TooMany| self.tangled(pattern))?;
        Ok(Some(Tile { art, map, at, size }))
    }

    /// Walks aside: what is drawn goes into a drawing of its own, whose shapes refer to the clips, names and labels of
    /// the drawing.
    fn aside(&mut self, purpose: Purpose, walk: impl FnOnce(&mut Self) -> Done) -> Result<Aside, Box<Diag>> {
        let shapes = std::mem::take(&mut self.art.shapes);
        let lines = std::mem::take(&mut self.art.lines);
        let before = std::mem::replace(&mut self.purpose, purpose);
        let done = walk(self);
        self.purpose = before;
        let shapes = std::mem::replace(&mut self.art.shapes, shapes);
        let lines = std::mem::replace(&mut self.art.lines, lines);
        done.map(|()| Aside { shapes, lines })
    }

    /// The box of an element without its strokes, in its own units.
    pub(super) fn bounds(&mut self, node: Node<'a, 'input>, state: &State) -> Result<BoxMm<2>, Box<Diag>> {
        let map = Map::shift([0.0; 2]);
        let inner = State { map, clip: None, style: state.parent.clone(), depth: state.depth, ..state.clone() };
        let tolerance = self.tolerance;
        self.tolerance = tolerance / state.map.enlarges();
        let quiet = std::mem::replace(&mut self.is_quiet, true);
        let boxed = self.boxed.replace(node.id());
        let aside = self.aside(Purpose::Bounds, |walk| walk.element(node, &inner));
        (self.is_quiet, self.tolerance, self.boxed) = (quiet, tolerance, boxed);
        Ok(BoxMm::of(aside?.lines.points.iter().copied()))
    }

    /// What an element holds and uses is like.
    fn look_into(&mut self, node: Node<'a, 'input>, state: &State) -> Result<Inside, Box<Diag>> {
        let mut inside = Inside { is_turned: false, is_stroked: state.style.stroke != svg_style::Paint::None };
        let (mut seen, mut left) = (HashSet::new(), vec![node]);
        let quiet = std::mem::replace(&mut self.is_quiet, true);
        while let Some(top) = left.pop() {
            for inner in top.descendants().filter(Node::is_element) {
                let style = self.style(inner, &state.parent, state.copied)?;
                inside.is_stroked |= style.stroke != svg_style::Paint::None;
                // A box that transforms refer to is not known here.
                let size = ReferenceBox { corner: [0.0; 2], size: state.port };
                let is_turned = style.has_transform() && !style.matrix(size).is_aligned();
                inside.is_turned |= inner != node && is_turned;
                let used = href(inner).filter(|_| inner.tag_name().name() == "use").and_then(local);
                if let Some(target) = used.and_then(|id| self.target(&id)).filter(|t| seen.insert(t.id())) {
                    left.push(target);
                }
            }
        }
        self.is_quiet = quiet;
        Ok(inside)
    }

    /// The area of a shape, cut at its clip.
    fn area_of(&self, aside: &Aside, shape: &Shape) -> Result<Area, TooMany> {
        let rule = if let Figure::Fill(rule) = shape.figure { rule } else { Rule::NonZero };
        let area = Area::new(shape.lines.clone().map(|k| aside.lines.get(k)), rule)?;
        shape.clip.map_or(Ok(area.clone()), |clip| area.within(&self.art.clips[clip as usize]))
    }

    /// The same with every shape cut at its clip, and at a frame.
    fn cut_out(&self, aside: &Aside, frame: &Area) -> Result<Aside, TooMany> {
        let mut out = Aside { shapes: Vec::new(), lines: Lines::default() };
        for shape in &aside.shapes {
            let first = out.lines.len();
            let clip = match shape.clip.map(|c| &self.art.clips[c as usize]) {
                Some(clip) => clip.within(frame)?,
                None => frame.clone(),
            };
            let lines = shape.lines.clone().map(|k| aside.lines.get(k));
            let mut figure = shape.figure;
            if figure == Figure::Lines {
                clip.cut(lines, &mut out.lines);
            } else {
                let rule = if let Figure::Fill(rule) = figure { rule } else { Rule::NonZero };
                for contour in Area::new(lines, rule)?.within(&clip)?.contours() {
                    out.lines.points.extend(contour.iter().chain(contour.first()));
                    out.lines.finish();
                }
                if let Figure::Fill(rule) = &mut figure {
                    *rule = Rule::NonZero;
                }
            }
            let lines = first..out.lines.len();
            out.shapes.push(Shape { figure, lines, clip: None, ..shape.clone() });
        }
        Ok(out)
    }

    /// Scales the state to the box of an element where an attribute says so; returns whether that has a size.
    fn scaled_to_box(
        &mut self,
        server: Node<'a, 'input>,
        attribute: &str,
        is_box: bool,
        node: Node<'a, 'input>,
        outer: &State,
        state: &mut State,
    ) -> Result<bool, Box<Diag>> {
        let wants_box = match server.attribute(attribute) {
            Some("objectBoundingBox") => true,
            Some("userSpaceOnUse") => false,
            _ => is_box,
        };
        if wants_box {
            // SVG 2, 8.10 has the tightest box; some programs turn the box of each shape and get a larger one. The
            // frame of a mask reaches a tenth beyond either, unless it says otherwise: it could cut strokes alone.
            let inside = self.look_into(node, outer)?;
            let sides = ["x", "y", "width", "height"];
            let is_roomy = attribute == "maskUnits" && !sides.iter().any(|name| server.has_attribute(*name));
            if inside.is_turned && (inside.is_stroked || !is_roomy) {
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

/// What elements inside of another are like.
struct Inside {
    /// One of them is turned or skewed against what it lies in.
    is_turned: bool,
    is_stroked: bool,
}

/// Shapes that are drawn aside.
struct Aside {
    shapes: Vec<Shape>,
    lines: Lines,
}

/// A tile of a pattern.
struct Tile {
    /// What it shows, page mm, where the pattern's own origin puts it.
    art: Aside,
    /// From the pattern's units to page mm.
    map: Map,
    /// Corner and size of the tile in the pattern's units.
    at: [f64; 2],
    size: [f64; 2],
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
