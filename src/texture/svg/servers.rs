//! What elements refer to for their looks: clip paths, masks of plain shapes, and patterns.

use std::collections::HashSet;
use std::str::FromStr;

use roxmltree::Node;

use super::outline::Map;
use super::page::{self, view_map};
use super::tally::Issue;
use super::walk::{Done, Purpose, SHAPES, State, Walk, href, transform};
use crate::diag::Diag;
use crate::geom::BoxMm;
use crate::texture::artwork::{Area, Figure, MAX_POINTS, Rule, Shape, TooMany, WHITE};
use crate::texture::clip::Lines;

/// Most copies of the shapes of a pattern.
const MAX_COPIES: f64 = 1e6;

/// Most edges of clip paths and masks, counted again for each element that is cut at them.
const MAX_CUT_EDGES: usize = 1_000_000;

/// Most references from pattern to pattern.
const MAX_LINKS: usize = 32;

const BLACK: [u8; 3] = [0; 3];

impl<'a, 'input> Walk<'a, 'input> {
    /// Cuts what `state` holds at a clip path or mask; answers whether something of the element may be drawn.
    pub(super) fn cut(
        &mut self,
        node: Node<'a, 'input>,
        value: &str,
        is_mask: bool,
        state: &mut State<'a>,
    ) -> Result<bool, Box<Diag>> {
        let Some(id) = value.strip_prefix("url(").and_then(|v| v.strip_suffix(')')) else {
            self.note(Issue::Effect, node);
            return Ok(false);
        };
        let id = id.trim_matches(|c: char| c.is_whitespace() || c == '"' || c == '\'');
        let tag = if is_mask { "mask" } else { "clipPath" };
        let target = id.strip_prefix('#').and_then(|id| self.target(id)).filter(|t| t.tag_name().name() == tag);
        let Some(target) = target else {
            // Programs disagree on what a missing clip path hides.
            self.note(Issue::Effect, node);
            return Ok(false);
        };
        self.uses.push(target.id());
        let area = if is_mask { self.mask(node, target, *state) } else { self.clip_path(node, target, *state) };
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

    /// The area of a clip path on an element; None where it cannot be reproduced.
    fn clip_path(
        &mut self,
        node: Node<'a, 'input>,
        clip: Node<'a, 'input>,
        outer: State<'a>,
    ) -> Result<Option<Area>, Box<Diag>> {
        let mut state = State { clip: None, style: self.style_of(clip)?, ..outer };
        if !self.scaled_to_box(clip, "clipPathUnits", false, node, &mut state)? {
            return Ok(Some(Area::default()));
        }
        // Its own transform, clip path and the like.
        let Some(state) = self.enter(clip, state)? else { return Ok(None) };
        let plain = |n: &Node<'_, '_>| {
            let tag = n.tag_name().name();
            SHAPES.contains(&tag) || matches!(tag, "use" | "title" | "desc" | "metadata")
        };
        if !clip.children().filter(Node::is_element).all(|n| plain(&n)) {
            return Ok(None);
        }
        let art = self.aside(Purpose::Clip, |walk| walk.children(clip, state))?;
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
        outer: State<'a>,
    ) -> Result<Option<Area>, Box<Diag>> {
        let mut state = State { clip: None, style: self.style_of(mask)?, ..outer };
        let is_alpha = self.declared(mask)?.get("mask-type") == Some("alpha");
        // Where the mask itself ends.
        let mut frame = state;
        if !self.scaled_to_box(mask, "maskUnits", true, node, &mut frame)? {
            return Ok(Some(Area::default()));
        }
        let is_box = mask.attribute("maskUnits") != Some("userSpaceOnUse");
        let side = |walk: &mut Self, name: &str, axis: usize, default: f64| match mask.attribute(name) {
            _ if is_box => share(mask, name).unwrap_or(default),
            Some(_) => walk.length(mask, name, axis, state),
            None => default * state.port[axis],
        };
        let at = [side(self, "x", 0, -0.1), side(self, "y", 1, -0.1)];
        let size = [side(self, "width", 0, 1.2), side(self, "height", 1, 1.2)];
        let corners = corners(at, size).map(|c| frame.map.at(c));
        if !self.scaled_to_box(mask, "maskContentUnits", false, node, &mut state)? {
            return Ok(Some(Area::default()));
        }
        let Some(state) = self.enter(mask, state)? else { return Ok(None) };
        let refused = self.tally.refused();
        let art = self.aside(Purpose::Mask, |walk| walk.children(mask, state))?;
        if self.tally.refused() > refused {
            return Ok(None);
        }
        let mut shown = Area::default();
        for shape in &art.shapes {
            let area = self.area_of(&art, shape).map_err(|TooMany| self.tangled(mask))?;
            shown = match shape.colour {
                _ if is_alpha => Area::union([&shown, &area].into_iter()),
                WHITE => Area::union([&shown, &area].into_iter()),
                BLACK => shown.without(&area),
                _ => return Ok(None),
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

    /// Fills a shape with a pattern.
    pub(super) fn painted(&mut self, node: Node<'a, 'input>, tag: &str, state: State<'a>, id: &str) -> Done {
        let target = self.target(id).filter(|t| t.tag_name().name() == "pattern");
        let Some(pattern) = target else {
            self.note(Issue::Paint, node);
            return Ok(());
        };
        let shape = self.aside(self.purpose, |walk| {
            walk.subpaths(node, tag, State { clip: None, ..state }, BLACK, Figure::Fill(state.style.rule))
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
        outer: State<'a>,
    ) -> Result<Option<Tile>, Box<Diag>> {
        // A pattern takes what it does not say from the one that it refers to.
        let mut chain = vec![pattern];
        while let Some(next) = chain.last().and_then(|p| href(*p)).and_then(|h| h.strip_prefix('#')) {
            let Some(next) = self.target(next).filter(|n| n.tag_name().name() == "pattern" && !chain.contains(n))
            else {
                return Ok(None);
            };
            chain.push(next);
            if chain.len() > MAX_LINKS {
                return Ok(None);
            }
        }
        let with = |name: &str| chain.iter().copied().find(|p| p.has_attribute(name));
        let content = chain.iter().copied().find(|p| p.children().any(|c| c.is_element())).unwrap_or(pattern);
        let mut state = State { clip: None, style: self.style_of(content)?, ..outer };
        if let Some(text) = with("patternTransform").and_then(|p| p.attribute("patternTransform")) {
            let Ok(t) = svgtypes::Transform::from_str(text) else { return Ok(None) };
            state.map = state.map.after(Map { a: t.a, b: t.b, c: t.c, d: t.d, e: t.e, f: t.f });
        }
        let is_box = with("patternUnits").and_then(|p| p.attribute("patternUnits")) != Some("userSpaceOnUse");
        let is_box_content =
            with("patternContentUnits").and_then(|p| p.attribute("patternContentUnits")) == Some("objectBoundingBox");
        let bounds =
            if is_box || is_box_content { self.bounds(node, outer)? } else { BoxMm { lo: [0.0; 2], hi: [1.0; 2] } };
        let [w, h] = bounds.size();
        let side = |walk: &mut Self, name: &str, axis: usize| match with(name) {
            None => 0.0,
            Some(p) if is_box => share(p, name).unwrap_or(0.0) * [w, h][axis],
            Some(p) => walk.length(p, name, axis, outer),
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
        match with("viewBox").map(page::view_box) {
            Some(Ok(Some(view))) => {
                let aspect = page::aspect(with("preserveAspectRatio").unwrap_or(pattern));
                state.map = map.after(Map::shift(at)).after(view_map(view, size, aspect));
                state.port = [view.w, view.h];
            }
            Some(_) => return Ok(None),
            None if is_box_content => state.map = map.after(Map::shift(at)).after(Map::scale(w, h, [0.0; 2])),
            None => state.map = map.after(Map::shift(at)),
        }
        let refused = self.tally.refused();
        self.uses.extend(chain.iter().map(|n| n.id()));
        let art = self.aside(Purpose::Mark, |walk| walk.children(content, state));
        self.uses.truncate(self.uses.len() - chain.len());
        let art = art?;
        if self.tally.refused() > refused {
            return Ok(None);
        }
        let overflow = self.declared(content)?.get("overflow");
        let frame = Area::new([corners.as_slice()].into_iter(), Rule::NonZero).expect("four edges");
        let frame = (!matches!(overflow, Some("visible" | "auto"))).then_some(&frame);
        let art = self.cut_out(&art, frame).map_err(|TooMany| self.tangled(pattern))?;
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
    fn bounds(&mut self, node: Node<'a, 'input>, state: State<'a>) -> Result<BoxMm<2>, Box<Diag>> {
        let own = self.declared(node)?;
        // The element's own transform, which it applies once more, does not count.
        let Some(own) = transform(node, &own).filter(|t| t.is_regular()) else { return Ok(BoxMm::EMPTY) };
        let inner = State { map: own.inverse(), clip: None, ..state };
        let tolerance = self.tolerance;
        self.tolerance = tolerance / state.map.enlarges();
        let quiet = std::mem::replace(&mut self.is_quiet, true);
        let aside = self.aside(Purpose::Bounds, |walk| walk.element(node, inner));
        (self.is_quiet, self.tolerance) = (quiet, tolerance);
        Ok(BoxMm::of(aside?.lines.points.iter().copied()))
    }

    /// What an element holds and uses is like.
    fn look_into(&mut self, node: Node<'a, 'input>, is_stroked: bool) -> Result<Inside, Box<Diag>> {
        let mut inside = Inside { is_turned: false, is_stroked };
        let (mut seen, mut left) = (HashSet::new(), vec![node]);
        while let Some(node) = left.pop() {
            for inner in node.descendants().filter(Node::is_element) {
                let own = self.declared(inner)?;
                inside.is_stroked |= own.get("stroke").is_some_and(|stroke| stroke != "none");
                inside.is_turned |= inner != node && transform(inner, &own).is_some_and(|t| !t.is_aligned());
                let used = href(inner).filter(|_| inner.tag_name().name() == "use").and_then(|h| h.strip_prefix('#'));
                if let Some(target) = used.and_then(|id| self.target(id)).filter(|t| seen.insert(t.id())) {
                    let own = self.declared(target)?;
                    inside.is_turned |= transform(target, &own).is_some_and(|t| !t.is_aligned());
                    left.push(target);
                }
            }
        }
        Ok(inside)
    }

    /// The area of a shape, cut at its clip.
    fn area_of(&self, aside: &Aside, shape: &Shape) -> Result<Area, TooMany> {
        let rule = if let Figure::Fill(rule) = shape.figure { rule } else { Rule::NonZero };
        let area = Area::new(shape.lines.clone().map(|k| aside.lines.get(k)), rule)?;
        shape.clip.map_or(Ok(area.clone()), |clip| area.within(&self.art.clips[clip as usize]))
    }

    /// The same with every shape cut at its clip, and at a frame.
    fn cut_out(&self, aside: &Aside, frame: Option<&Area>) -> Result<Aside, TooMany> {
        let mut out = Aside { shapes: Vec::new(), lines: Lines::default() };
        for shape in &aside.shapes {
            let first = out.lines.len();
            let clip = match (shape.clip.map(|c| &self.art.clips[c as usize]), frame) {
                (Some(clip), Some(frame)) => Some(clip.within(frame)?),
                (one, other) => one.or(other).cloned(),
            };
            let lines = shape.lines.clone().map(|k| aside.lines.get(k));
            let mut figure = shape.figure;
            match clip {
                None => lines.for_each(|line| out.lines.push(line)),
                Some(clip) if figure == Figure::Lines => clip.cut(lines, &mut out.lines),
                Some(clip) => {
                    let rule = if let Figure::Fill(rule) = figure { rule } else { Rule::NonZero };
                    for contour in Area::new(lines, rule)?.within(&clip)?.contours() {
                        out.lines.points.extend(contour.iter().chain(contour.first()));
                        out.lines.finish();
                    }
                    if let Figure::Fill(rule) = &mut figure {
                        *rule = Rule::NonZero;
                    }
                }
            }
            let lines = first..out.lines.len();
            out.shapes.push(Shape { figure, lines, clip: None, ..shape.clone() });
        }
        Ok(out)
    }

    /// Scales the state to the box of an element where an attribute says so; answers whether that has a size.
    fn scaled_to_box(
        &mut self,
        server: Node<'a, 'input>,
        attribute: &str,
        is_box: bool,
        node: Node<'a, 'input>,
        state: &mut State<'a>,
    ) -> Result<bool, Box<Diag>> {
        let wants_box = match server.attribute(attribute) {
            Some("objectBoundingBox") => true,
            Some("userSpaceOnUse") => false,
            _ => is_box,
        };
        if wants_box {
            // SVG 2, 8.10 has the tightest box; some programs turn the box of each shape and get a larger one. The
            // frame of a mask reaches a tenth beyond either, unless it says otherwise: it could cut strokes alone.
            let inside = self.look_into(node, state.style.has_stroke())?;
            let sides = ["x", "y", "width", "height"];
            let is_roomy = attribute == "maskUnits" && !sides.iter().any(|name| server.has_attribute(*name));
            if inside.is_turned && (inside.is_stroked || !is_roomy) {
                self.note(Issue::Box, node);
                return Ok(false);
            }
            let bounds = self.bounds(node, *state)?;
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
    /// Its corner and size in the pattern's units.
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
