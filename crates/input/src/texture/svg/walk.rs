//! The walk over a drawing's elements: groups, uses, nested drawings and shapes, in document order.

use std::collections::HashMap;
use std::sync::Arc;

use roxmltree::{Document, Node, NodeId};
use svg_style::{
    Cascade, Display, Excess, Length, Link, Map, Reference, ReferenceBox, Remark, Style, TransformBox, Weight, aspect,
    chosen, holds_conditions, href, is_svg, local, view_box, view_map,
};

use super::page::PageFrame;
use super::remarks::Remarks;
use super::state::ElementState;
use super::style::{Coat, is_gone};
use super::tally::{Issue, Tally};
use crate::texture::artwork::{Artwork, Labels, MAX_POINTS, Marking, PolygonArea, Stop, TooMany, WindingRule};
use crate::texture::place::Site;
use crate::texture::xml::MAX_DEPTH;
use terrace_core::diag::Diag;
use terrace_core::geom::BoxMm;

const INKSCAPE: &str = "http://www.inkscape.org/namespaces/inkscape";

/// Most elements that are walked, uses expanded.
const MAX_VISITS: usize = 2_000_000;

/// Tags of shapes.
pub(super) const SHAPES: [&str; 7] = ["rect", "circle", "ellipse", "line", "polyline", "polygon", "path"];

/// Tags of elements that change others over time.
const ANIMATIONS: [&str; 5] = ["animate", "set", "animateTransform", "animateMotion", "animateColor"];

/// What shapes are drawn for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Purpose {
    /// To be marked.
    Mark,
    /// Parts of a clip path: their areas.
    Clip,
    /// Parts of a mask: all that they paint, lines as areas too.
    Mask,
    /// To find how far they reach.
    Bounds,
}

/// What elements are cut at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Cut {
    ClipPath,
    Mask,
}

/// A walk over the elements of a drawing, and what it has drawn so far.
pub(super) struct Walk<'a, 'input> {
    pub(super) doc: &'a Document<'input>,
    cascade: Cascade,
    ids: HashMap<&'a str, NodeId>,
    pub(super) tolerance: f64,
    pub(super) marking: &'a Marking,
    /// Width up to which a stroke is a line, mm.
    pub(super) widest_line: f64,
    /// Length of a CSS pixel on the page, mm.
    pub(super) pixel_mm: f64,
    /// The page, mm.
    pub(super) page: BoxMm<2>,
    pub(super) purpose: Purpose,
    /// The element whose own transform does not count while its box is looked for.
    pub(super) boxed: Option<NodeId>,
    /// Elements that are being used right now, from the outside in.
    pub(super) uses: Vec<NodeId>,
    visits: usize,
    /// Edges of the areas that elements were cut at.
    pub(super) cut_edges: usize,
    /// Whether notes are dropped, where an element is drawn again.
    pub(super) is_quiet: bool,
    /// Number of each element among those of its tag, from 1, and its place in the names.
    numbers: Vec<u32>,
    named: HashMap<NodeId, u32>,
    labelled: HashMap<(u32, NodeId), u32>,
    pub(super) art: Artwork,
    pub(super) tally: Tally,
    pub(super) remarks: Remarks,
}

/// Whether a step of the walk could be done.
pub(super) type WalkResult = Result<(), Box<Diag>>;

impl<'a, 'input> Walk<'a, 'input> {
    pub(super) fn new(
        doc: &'a Document<'input>,
        cascade: Cascade,
        site: &Site,
        frame: &PageFrame,
        marking: &'a Marking,
    ) -> Self {
        let tolerance = site.tolerance;
        let widest_line = marking.widest_line_mm(site.spot_mm);
        let mut ids = HashMap::new();
        let mut counts: HashMap<&str, u32> = HashMap::new();
        let mut numbers = Vec::new();
        for node in doc.descendants() {
            let n = counts.entry(node.tag_name().name()).or_default();
            *n += 1;
            numbers.push(*n);
            if let Some(id) = node.attribute("id") {
                ids.entry(id).or_insert(node.id());
            }
        }
        let mut remarks = Remarks::default();
        cascade.remarks().iter().for_each(|remark| remarks.add(remark, String::new));
        let art = Artwork { labels: vec![Labels::default()], ..Artwork::default() };
        let (uses, visits, cut_edges, named, labelled, tally, boxed) = <_>::default();
        Self {
            doc,
            cascade,
            ids,
            tolerance,
            marking,
            widest_line,
            pixel_mm: frame.pixel_mm,
            page: BoxMm { lo: [0.0; 2], hi: frame.size },
            purpose: Purpose::Mark,
            boxed,
            uses,
            visits,
            cut_edges,
            is_quiet: false,
            numbers,
            named,
            labelled,
            art,
            tally,
            remarks,
        }
    }

    /// What the children of the root draw, on a page of this frame.
    pub(super) fn drawn(
        mut self,
        root: Node<'a, 'input>,
        frame: &PageFrame,
    ) -> Result<(Artwork, Tally, Remarks), Box<Diag>> {
        let initial = Arc::new(Style::initial());
        let state = ElementState {
            map: frame.map,
            style: initial.clone(),
            parent: initial,
            opacity: 1.0,
            port: frame.port,
            clip: None,
            labels: 0,
            stretch: 1.0,
            depth: 0,
            copied: None,
            context: None,
        };
        if let Some(state) = self.enter(root, &state)? {
            self.backdrop(root, &state);
            self.children(root, &state)?;
        }
        Ok((self.art, self.tally, self.remarks))
    }

    /// Notes what lies behind the whole drawing and is not paper.
    fn backdrop(&mut self, root: Node<'a, 'input>, state: &ElementState) {
        let is_paper = match &state.style.background {
            svg_style::Background::None => true,
            svg_style::Background::Colour(colour) => {
                let rgba = colour.resolved(state.style.current());
                rgba.alpha == 0.0 || rgba.rgb == [255; 3]
            }
            svg_style::Background::Other => false,
        };
        if !is_paper {
            self.note(Issue::Background, root);
        }
    }

    pub(super) fn children(&mut self, node: Node<'a, 'input>, state: &ElementState) -> WalkResult {
        node.children().filter(Node::is_element).try_for_each(|child| self.element(child, state))
    }

    pub(super) fn element(&mut self, node: Node<'a, 'input>, state: &ElementState) -> WalkResult {
        if !is_svg(node) {
            return Ok(());
        }
        match node.tag_name().name() {
            "g" | "a" => match self.enter(node, state)? {
                Some(state) => self.children(node, &state),
                None => Ok(()),
            },
            "svg" => match self.enter(node, state)? {
                Some(inner) => {
                    let sides = [self.side(node, "width", 0, &inner), self.side(node, "height", 1, &inner)];
                    self.viewport(node, sides, inner)
                }
                None => Ok(()),
            },
            "use" => self.used(node, state),
            "switch" => match (self.enter(node, state)?, chosen(node)) {
                (Some(state), Some(child)) => self.element(child, &state),
                _ => Ok(()),
            },
            "text" | "foreignObject" => self.unmarked(node, state, Issue::Text),
            "flowRoot" => self.unmarked(node, state, Issue::FlowText),
            "image" => self.unmarked(node, state, Issue::Image),
            tag if SHAPES.contains(&tag) => self.shape(node, tag, state),
            _ => Ok(()),
        }
    }

    /// The state inside an element; None where nothing of it is drawn.
    pub(super) fn enter(
        &mut self,
        node: Node<'a, 'input>,
        outer: &ElementState,
    ) -> Result<Option<ElementState>, Box<Diag>> {
        let Some(mut state) = self.begin(node, outer)? else { return Ok(None) };
        if state.style.display == Display::Contents {
            if !matches!(node.tag_name().name(), "g" | "a") {
                self.note(Issue::Effect, node);
                return Ok(None);
            }
            // What it holds is drawn as if the group was not there (CSS Display 3, B).
            return Ok(Some(state));
        }
        if !self.moved(node, &mut state)? || !self.shows_through(node, &mut state)? {
            return Ok(None);
        }
        if SHAPES.contains(&node.tag_name().name()) && self.purpose != Purpose::Bounds {
            if !self.judge(node, &state) {
                return Ok(None);
            }
            if state.style.non_scaling_stroke && !self.unscaled(node, &mut state) {
                return Ok(None);
            }
        }
        Ok(Some(state))
    }

    /// The state of an element before its transform; None where it is not drawn.
    pub(super) fn begin(
        &mut self,
        node: Node<'a, 'input>,
        outer: &ElementState,
    ) -> Result<Option<ElementState>, Box<Diag>> {
        self.visits += 1;
        let mut state = ElementState { depth: outer.depth + 1, parent: outer.style.clone(), ..outer.clone() };
        if self.visits > MAX_VISITS {
            let text = format!("the drawing has more than {MAX_VISITS} elements once its uses are expanded");
            return Err(Diag::input("svg-large", text)
                .hint("replace use by fewer elements, or tile a smaller drawing")
                .into());
        }
        if state.depth > MAX_DEPTH {
            let text = format!("the drawing nests elements deeper than {MAX_DEPTH} once its uses are expanded");
            return Err(Diag::input("svg-deep", text).hint("ungroup the drawing").into());
        }
        state.labels = self.labels(node, state.labels);
        if self.purpose == Purpose::Mark && self.is_left_out(node, state.labels) {
            return Ok(None);
        }
        let (style, remarks) = self.cascade.style(node, &outer.style, outer.copied).map_err(excess)?;
        self.keep(node, &remarks);
        if remarks.iter().any(is_faulty_transform) {
            return Ok(None);
        }
        let is_shape = SHAPES.contains(&node.tag_name().name());
        let is_gone = is_gone(&style) || (is_shape && style.display == Display::Contents);
        // Of a group that has no box its own properties do not count.
        let is_open = style.display == Display::Contents;
        // Neither boxes nor clip paths ask for the opacity.
        let has_opacity = matches!(self.purpose, Purpose::Mark | Purpose::Mask);
        if is_gone || !holds_conditions(node) || (has_opacity && !is_open && style.opacity <= 0.0) {
            self.note(Issue::Hidden, node);
            return Ok(None);
        }
        if node.children().any(|c| ANIMATIONS.contains(&c.tag_name().name())) {
            self.note(Issue::Animation, node);
        }
        if has_opacity && !is_open {
            state.opacity *= style.opacity;
        }
        if style.needs_font() {
            self.note(Issue::Unit, node);
        }
        state.style = style;
        Ok(Some(state))
    }

    /// The style of an element that inherits from another.
    pub(super) fn style(
        &mut self,
        node: Node<'a, 'input>,
        parent: &Arc<Style>,
        copied: Option<NodeId>,
    ) -> Result<Arc<Style>, Box<Diag>> {
        let (style, remarks) = self.cascade.style(node, parent, copied).map_err(excess)?;
        self.keep(node, &remarks);
        Ok(style)
    }

    /// Keeps what is remarked of the style of an element.
    fn keep(&mut self, node: Node<'a, 'input>, remarks: &[Remark]) {
        for remark in remarks {
            match remark.property.as_str() {
                // A page has its own words for its size.
                "width" | "height" if node.parent_element().is_none() => {}
                _ if is_faulty_transform(remark) => self.note(Issue::Transform, node),
                name if GEOMETRY.contains(&name) && remark.weight == Weight::Ignored => {
                    self.note(Issue::Fault, node);
                }
                _ if self.is_quiet => {}
                _ => self.remarks.add(remark, || called(node, &self.numbers)),
            }
        }
    }

    /// Applies the transform of an element; returns whether anything is left of it.
    pub(super) fn moved(&mut self, node: Node<'a, 'input>, state: &mut ElementState) -> Result<bool, Box<Diag>> {
        if self.boxed == Some(node.id()) || !state.style.has_transform() {
            return Ok(true);
        }
        let reference = match state.style.transform_box {
            _ if !state.style.transform_needs_box() => ReferenceBox { corner: [0.0; 2], size: [0.0; 2] },
            TransformBox::View => ReferenceBox { corner: [0.0; 2], size: state.port },
            TransformBox::Fill => {
                let bounds = self.bounds(node, state)?;
                let is_empty = bounds.lo[0] > bounds.hi[0];
                let corner = if is_empty { [0.0; 2] } else { bounds.lo };
                ReferenceBox { corner, size: bounds.size().map(|side| side.max(0.0)) }
            }
            TransformBox::Stroke => {
                self.note(Issue::Transform, node);
                return Ok(false);
            }
        };
        if node.parent_element().is_none() {
            // It would turn the page itself.
            self.note(Issue::Transform, node);
            return Ok(false);
        }
        state.map = state.map.after(state.style.matrix(reference));
        if !state.map.is_regular() {
            self.note(Issue::Flat, node);
            return Ok(false);
        }
        Ok(true)
    }

    /// Whether units are pixels of the page, from its upper left corner.
    fn is_in_pixels(&self, map: Map) -> bool {
        let [x, y] = map.at([0.0; 2]);
        let tiny = 1e-6 * self.pixel_mm;
        (map.enlarges() - self.pixel_mm).abs() <= tiny && x.abs() <= tiny && (y - self.page.hi[1]).abs() <= tiny
    }

    /// Cuts an element at its clip path and mask; returns whether something of it may be drawn.
    /// Nothing is drawn, and that is noted, where an effect cannot be reproduced.
    pub(super) fn shows_through(
        &mut self,
        node: Node<'a, 'input>,
        state: &mut ElementState,
    ) -> Result<bool, Box<Diag>> {
        // The box of an element is that of its geometry, whatever is cut off.
        if self.purpose == Purpose::Bounds {
            return Ok(true);
        }
        let style = state.style.clone();
        let is_cut = style.clip_path != Reference::None || style.mask != Reference::None;
        if is_cut && node.parent_element().is_none() && !self.is_in_pixels(state.map) {
            // Its units are pixels of the window (CSS Masking 1, 5.1), not those of the drawing.
            self.note(Issue::Effect, node);
            return Ok(false);
        }
        // Effects and masks of the parts of a clip path do not count.
        let is_clip_part = self.purpose == Purpose::Clip;
        if !is_clip_part && (style.filter != Reference::None || style.is_blended) {
            self.note(Issue::Effect, node);
            return Ok(false);
        }
        if style.clip_path != Reference::None && !self.cut(node, &style.clip_path, Cut::ClipPath, state)? {
            return Ok(false);
        }
        Ok(is_clip_part || style.mask == Reference::None || self.cut(node, &style.mask, Cut::Mask, state)?)
    }

    /// Whether no style sheet may move things.
    pub(super) fn has_no_sheet(&self) -> bool {
        self.cascade.is_empty()
    }

    /// The style of an element without a parent in the tree of what is drawn: that of its place in the document.
    pub(super) fn style_of(&mut self, node: Node<'a, 'input>) -> Result<Arc<Style>, Box<Diag>> {
        let mut chain: Vec<_> = node.ancestors().filter(Node::is_element).collect();
        chain.reverse();
        // What is remarked of them is remarked where they are drawn.
        let quiet = std::mem::replace(&mut self.is_quiet, true);
        let style =
            chain.into_iter().try_fold(Arc::new(Style::initial()), |style, node| self.style(node, &style, None));
        self.is_quiet = quiet;
        style
    }

    /// The element of an id, unless it is being used right now.
    pub(super) fn target(&self, id: &str) -> Option<Node<'a, 'input>> {
        let node = self.ids.get(id).and_then(|&id| self.doc.get_node(id))?;
        (!self.uses.contains(&node.id())).then_some(node)
    }

    /// The element of a link, unless it is being used right now.
    pub(super) fn linked(&self, link: &Link) -> Option<Node<'a, 'input>> {
        if let Link::Local(id) = link { self.target(id) } else { None }
    }

    /// Whether an element has this id.
    pub(super) fn has_id(&self, id: &str) -> bool {
        self.ids.contains_key(id)
    }

    /// Whether the job leaves out an element by its labels.
    fn is_left_out(&self, node: Node<'a, 'input>, labels: u32) -> bool {
        let tag = node.tag_name().name();
        let is_leaf = SHAPES.contains(&tag) || matches!(tag, "text" | "foreignObject" | "image");
        match (self.marking.chooses(), is_leaf) {
            (false, _) => false,
            (true, true) => self.marking.leaves_out(self.art.labels(labels)),
            (true, false) => self.marking.excepts(self.art.labels(labels)),
        }
    }

    /// The labels of an element, which has those of what holds it too.
    fn labels(&mut self, node: Node<'a, 'input>, parent: u32) -> u32 {
        if !self.marking.chooses() && !self.marking.lists_labels {
            return parent;
        }
        let mut own = Vec::new();
        if node.attribute((INKSCAPE, "groupmode")) == Some("layer") {
            own.extend(node.attribute((INKSCAPE, "label")).or(node.attribute("id")).map(|l| format!("layer:{l}")));
        }
        own.extend(node.attribute("id").map(|id| format!("id:{id}")));
        own.extend(node.attribute("class").unwrap_or_default().split_whitespace().map(|c| format!("class:{c}")));
        if own.is_empty() {
            return parent;
        }
        let labels = &mut self.art.labels;
        *self.labelled.entry((parent, node.id())).or_insert_with(|| {
            labels.push(Labels { parent: Some(parent), own });
            u32::try_from(labels.len() - 1).expect("fewer elements than visits")
        })
    }

    /// Notes what of a shape's looks is not marked; returns whether the rest can be.
    fn judge(&mut self, node: Node<'a, 'input>, state: &ElementState) -> bool {
        let style = &state.style;
        if self.purpose == Purpose::Clip {
            return true;
        }
        if style.visible && self.has_markers(node, style) {
            self.note(Issue::Marker, node);
            return false;
        }
        if !state.is_seen() {
            self.note(Issue::Hidden, node);
        }
        true
    }

    /// Whether markers are drawn on a shape.
    fn has_markers(&self, node: Node<'a, 'input>, style: &Style) -> bool {
        let has_vertices = matches!(node.tag_name().name(), "path" | "line" | "polyline" | "polygon");
        let references = [&style.marker_start, &style.marker_mid, &style.marker_end];
        has_vertices && references.into_iter().any(|reference| self.draws_marker(reference))
    }

    /// Whether a marker property refers to a marker that holds something.
    fn draws_marker(&self, reference: &Reference) -> bool {
        match reference {
            Reference::None => false,
            Reference::Other => true,
            Reference::Link(link) => {
                let marker = self.linked(link).filter(|t| t.tag_name().name() == "marker");
                marker.is_some_and(|m| m.children().any(|c| c.is_element()))
            }
        }
    }

    /// Gives strokes the width that they have on the screen whatever the transforms; returns whether that can be drawn.
    fn unscaled(&mut self, node: Node<'a, 'input>, state: &mut ElementState) -> bool {
        if !state.map.is_similar() {
            self.note(Issue::Effect, node);
            return false;
        }
        state.stretch = self.pixel_mm / state.map.enlarges();
        if !state.style.is_hairline() && state.stroke() != Coat::None {
            self.note(Issue::NonScaling, node);
        }
        true
    }

    /// Notes an element of a kind that cannot be marked, unless nothing is seen of it.
    fn unmarked(&mut self, node: Node<'a, 'input>, state: &ElementState, issue: Issue) -> WalkResult {
        let Some(inner) = self.enter(node, state)? else { return Ok(()) };
        if !self.is_seen(node, &inner)? {
            return Ok(());
        }
        self.note(issue, node);
        let link = href(node).unwrap_or_default();
        if issue == Issue::Image && !link.starts_with("data:") && !link.starts_with('#') {
            self.note(Issue::External, node);
        }
        Ok(())
    }

    /// Draws what a `use` refers to.
    fn used(&mut self, node: Node<'a, 'input>, state: &ElementState) -> WalkResult {
        let Some(mut state) = self.enter(node, state)? else { return Ok(()) };
        let link = href(node).unwrap_or_default();
        let Some(id) = local(link) else {
            self.note(if link.is_empty() { Issue::Use } else { Issue::External }, node);
            return Ok(());
        };
        let Some(target) = self.target(&id).filter(|t| !node.ancestors().any(|a| a == *t)) else {
            self.note(Issue::Use, node);
            return Ok(());
        };
        let tag = target.tag_name().name();
        // A clip path holds copies of shapes and text alone (SVG 2, 14.3.2).
        if self.purpose == Purpose::Clip && !(SHAPES.contains(&tag) || tag == "text") {
            return Ok(());
        }
        // As of nested drawings, browsers take attributes alone.
        let has_sides = ["width", "height"].map(|name| node.has_attribute(name));
        if matches!(tag, "symbol" | "svg") && !["width", "height"].iter().all(|name| self.is_side(node, name, &state)) {
            // Browsers show nothing of it.
            self.note(Issue::Fault, node);
            return Ok(());
        }
        let use_sides = [self.side(node, "width", 0, &state), self.side(node, "height", 1, &state)];
        let port = state.port;
        let corner = [state.style.x.of(port[0]), state.style.y.of(port[1])];
        state.map = state.map.after(Map::shift(corner));
        state.copied = Some(target.id());
        state.context = Some(Arc::new(state.context()));
        self.uses.push(target.id());
        let result = match tag {
            "symbol" | "svg" if is_svg(target) => match self.enter(target, &state)? {
                Some(inner) => {
                    let target_sides = [self.side(target, "width", 0, &inner), self.side(target, "height", 1, &inner)];
                    let sides = [0, 1].map(|k| if has_sides[k] { use_sides[k] } else { target_sides[k] });
                    self.viewport(target, sides, inner)
                }
                None => Ok(()),
            },
            _ => self.element(target, &state),
        };
        self.uses.pop();
        result
    }

    /// Draws the children of a nested drawing or a symbol.
    fn viewport(&mut self, node: Node<'a, 'input>, size: [f64; 2], mut state: ElementState) -> WalkResult {
        if !(size[0] > 0.0 && size[1] > 0.0) {
            self.note(Issue::Dot, node);
            return Ok(());
        }
        // Its attributes count alone: of the properties of geometry browsers take none, other viewers do.
        let corner = [self.length(node, "x", 0, &state), self.length(node, "y", 1, &state)];
        let stated =
            [state.style.x, state.style.y].map(Some).into_iter().chain([state.style.width, state.style.height]);
        let font = state.style.font_size.px;
        let root = state.style.root_font_px;
        let names = ["x", "y", "width", "height"];
        let differs = names.into_iter().zip(stated).any(|(name, stated)| {
            let own = node.attribute(name).and_then(|t| Length::from_attribute(t, font, root));
            stated.is_some_and(|s| s != own.unwrap_or_default() && s != Length::default())
        });
        if differs {
            self.note(Issue::Transform, node);
            return Ok(());
        }
        state.map = state.map.after(Map::shift(corner));
        let overflows = state.style.overflows == Some(true);
        let frame_map = state.map;
        state.port = size;
        match view_box(node) {
            Ok(Some(view)) => {
                state.map = state.map.after(view_map(view, size, aspect(node)));
                state.port = [view.w, view.h];
            }
            Ok(None) => {}
            // Browsers continue as if it was not there.
            Err(_) => self.note(Issue::Fault, node),
        }
        let first = self.art.shapes.len();
        self.children(node, &state)?;
        if overflows { Ok(()) } else { self.cut_at_frame(frame_map, size, first, node) }
    }

    /// Cuts the shapes from index `first` on at the frame of `node`: a rectangle from the origin in the units of `map`.
    fn cut_at_frame(&mut self, map: Map, size: [f64; 2], first: usize, node: Node<'a, 'input>) -> WalkResult {
        let corners = [[0.0, 0.0], [size[0], 0.0], size, [0.0, size[1]]].map(|c| map.at(c));
        let back = map.inverse();
        // The tolerance in the units of the frame.
        let slack = self.tolerance / map.enlarges();
        let is_in_frame = |p: [f64; 2]| back.at(p).iter().zip(size).all(|(&v, side)| v >= -slack && v <= side + slack);
        // The area of the frame within each clip that shapes have.
        let mut clips: HashMap<Option<u32>, u32> = HashMap::new();
        for i in first..self.art.shapes.len() {
            let shape = &self.art.shapes[i];
            let mut lines = shape.lines.clone().map(|k| self.art.lines.get(k));
            // A shape within the frame loses nothing, and needs no clip.
            if lines.all(|line| line.iter().all(|&p| is_in_frame(p))) {
                continue;
            }
            let outer = shape.clip;
            let clip = match clips.get(&outer) {
                Some(&clip) => clip,
                None => {
                    let area =
                        PolygonArea::new([corners.as_slice()].into_iter(), WindingRule::NonZero).expect("four edges");
                    let clip = self.clip(outer, area, node)?;
                    clips.insert(outer, clip);
                    clip
                }
            };
            self.art.shapes[i].clip = Some(clip);
        }
        Ok(())
    }

    /// Notes an area that shapes are cut at, within an outer one; returns its index.
    pub(super) fn clip(
        &mut self,
        outer: Option<u32>,
        area: PolygonArea,
        node: Node<'a, 'input>,
    ) -> Result<u32, Box<Diag>> {
        let area = match outer {
            None => Ok(area),
            Some(outer) => area.within(&self.art.clips[outer as usize]),
        };
        self.art.clips.push(area.map_err(|TooMany| self.tangled(node))?);
        Ok(u32::try_from(self.art.clips.len() - 1).expect("fewer clips than visits"))
    }

    pub(super) fn tangled(&self, node: Node<'a, 'input>) -> Box<Diag> {
        let text = format!("the area of {} has contours that cross each other too often", self.called(node));
        Diag::limit("texture-crossings", text).hint("simplify it in the drawing program").into()
    }

    /// A length in user units; 0 where it is not given or faulty. Axis 0 is x, 1 is y, 2 neither.
    pub(super) fn length(&mut self, node: Node<'a, 'input>, name: &str, axis: usize, state: &ElementState) -> f64 {
        let Some(text) = node.attribute(name) else { return 0.0 };
        let Some(length) = Length::from_attribute(text, state.style.font_size.px, state.style.root_font_px) else {
            self.note(Issue::Fault, node);
            return 0.0;
        };
        if length.needs_font {
            self.note(Issue::Unit, node);
        }
        length.of(whole(state.port, axis))
    }

    /// A side of a nested drawing or symbol: that of the outer viewport unless it says otherwise.
    fn side(&mut self, node: Node<'a, 'input>, name: &str, axis: usize, state: &ElementState) -> f64 {
        match node.attribute(name) {
            Some(text) if text.trim() != "auto" && self.is_side(node, name, state) => {
                self.length(node, name, axis, state)
            }
            None | Some("auto") => state.port[axis],
            Some(_) => {
                self.note(Issue::Fault, node);
                state.port[axis]
            }
        }
    }

    /// Whether an attribute, if there is one, states a length that is not negative.
    fn is_side(&self, node: Node<'a, 'input>, name: &str, state: &ElementState) -> bool {
        let style = &state.style;
        let length =
            node.attribute(name).map(|text| Length::from_attribute(text, style.font_size.px, style.root_font_px));
        length.is_none_or(|l| l.is_some_and(|l| l.px >= 0.0 && l.share >= 0.0))
    }

    pub(super) fn stopped(&self, stop: Stop, node: Node<'a, 'input>) -> Diag {
        let name = self.called(node);
        match stop {
            Stop::Far => Diag::input("texture-far", format!("{name} reaches beyond any part"))
                .hint("check its transforms and coordinates"),
            Stop::Full => {
                let text = format!("the drawing has more than {} points at {name}", MAX_POINTS);
                Diag::limit("texture-large", text).hint("use a larger tolerance or a simpler drawing")
            }
        }
    }

    pub(super) fn note(&mut self, issue: Issue, node: Node<'a, 'input>) {
        if !self.is_quiet {
            self.tally.add(issue, || called(node, &self.numbers));
        }
    }

    pub(super) fn called(&self, node: Node<'a, 'input>) -> String {
        called(node, &self.numbers)
    }

    /// The place of the element's name among the names.
    pub(super) fn name(&mut self, node: Node<'a, 'input>) -> u32 {
        let names = &mut self.art.names;
        *self.named.entry(node.id()).or_insert_with(|| {
            names.push(called(node, &self.numbers));
            u32::try_from(names.len() - 1).expect("fewer elements than visits")
        })
    }
}

/// Whether an attribute states a transform that cannot be read.
fn is_faulty_transform(remark: &Remark) -> bool {
    remark.is_attribute && remark.property == "transform" && remark.weight == Weight::Ignored
}

/// Properties of geometry; a faulty one of an attribute is a fault of the shape.
const GEOMETRY: [&str; 9] = ["x", "y", "width", "height", "cx", "cy", "r", "rx", "ry"];

/// What percentages along an axis refer to (SVG 2, 8.9).
pub(super) fn whole([w, h]: [f64; 2], axis: usize) -> f64 {
    [w, h, ((w * w + h * h) / 2.0).sqrt()][axis]
}

pub(super) fn excess(excess: Excess) -> Box<Diag> {
    let hint = "save the drawing with presentation attributes instead of a style sheet, or with fewer rules";
    Diag::input("svg-css", excess.to_string()).hint(hint).into()
}

/// The id of an element, or its tag and number, from 1, among all of its tag.
fn called(node: Node<'_, '_>, numbers: &[u32]) -> String {
    match node.attribute("id") {
        Some(id) => id.to_owned(),
        None => format!("{} {}", node.tag_name().name(), numbers[node.id().get_usize()]),
    }
}
