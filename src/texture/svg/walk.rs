//! The walk over a drawing's elements: groups, uses, nested drawings and shapes, in document order.

use std::collections::HashMap;
use std::str::FromStr;

use roxmltree::{Document, Node, NodeId};
use svgtypes::{Length, LengthUnit};

use super::outline::Map;
use super::page::{self, view_map};
use super::source::MAX_DEPTH;
use super::style::{Declared, Style};
use super::style_sheet::{Sheet, Work};
use super::tally::{Issue, Tally};
use crate::diag::Diag;
use crate::texture::artwork::{Area, Artwork, Labels, MAX_POINTS, Marking, Rule, Stop, TooMany};
use crate::texture::place::Site;

const SVG: &str = "http://www.w3.org/2000/svg";
const XLINK: &str = "http://www.w3.org/1999/xlink";
const INKSCAPE: &str = "http://www.inkscape.org/namespaces/inkscape";

/// Most elements that are walked, uses expanded.
const MAX_VISITS: usize = 2_000_000;

/// Tags of shapes.
pub(super) const SHAPES: [&str; 7] = ["rect", "circle", "ellipse", "line", "polyline", "polygon", "path"];

/// What an element inherits.
#[derive(Clone, Copy)]
pub(super) struct State<'a> {
    /// From the element's units to page mm.
    pub(super) map: Map,
    pub(super) style: Style<'a>,
    /// Size of the nearest viewport, which percentages refer to.
    pub(super) port: [f64; 2],
    /// Index of the area that it is cut at.
    pub(super) clip: Option<u32>,
    /// Index of its set of labels.
    pub(super) labels: u32,
    /// Factor of widths and dashes of strokes.
    pub(super) stretch: f64,
    pub(super) depth: usize,
}

/// What shapes are drawn for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Purpose {
    /// To be marked.
    Mark,
    /// As parts of a clip path: their areas.
    Clip,
    /// As parts of a mask: all that they paint, lines as areas too.
    Mask,
    /// To find how far they reach.
    Bounds,
}

pub(super) struct Walk<'a, 'input> {
    pub(super) doc: &'a Document<'input>,
    sheet: Sheet<'a>,
    ids: HashMap<&'a str, NodeId>,
    pub(super) tolerance: f64,
    pub(super) marking: &'a Marking,
    /// Width up to which a stroke is a line, mm.
    pub(super) widest_line: f64,
    /// Enlargement of the drawing's own units.
    pub(super) scale: f64,
    pub(super) purpose: Purpose,
    /// Elements that are being used right now, from the outside in.
    pub(super) uses: Vec<NodeId>,
    visits: usize,
    /// Edges of the areas that elements were cut at.
    pub(super) cut_edges: usize,
    work: Work,
    /// Whether notes are dropped, where an element is drawn again.
    pub(super) is_quiet: bool,
    /// Number of each element among those of its tag, from 1, and its place in the names.
    numbers: Vec<u32>,
    named: HashMap<NodeId, u32>,
    labelled: HashMap<(u32, NodeId), u32>,
    pub(super) art: Artwork,
    pub(super) tally: Tally,
}

pub(super) type Done = Result<(), Box<Diag>>;

impl<'a, 'input> Walk<'a, 'input> {
    pub(super) fn new(
        doc: &'a Document<'input>,
        sheet: Sheet<'a>,
        site: &Site,
        scale: f64,
        marking: &'a Marking,
    ) -> Self {
        let (tolerance, widest_line) = (site.tolerance, marking.widest_line_mm(site.spot_mm));
        let mut ids = HashMap::new();
        let mut counts: HashMap<&str, u32> = HashMap::new();
        let mut numbers = Vec::new();
        let mut tally = Tally::default();
        for node in doc.descendants() {
            let n = counts.entry(node.tag_name().name()).or_default();
            *n += 1;
            numbers.push(*n);
            if let Some(id) = node.attribute("id") {
                ids.entry(id).or_insert(node.id());
            }
            if style_text(node).is_some_and(|text| text.contains("@import")) {
                tally.add(Issue::External, || format!("style {n}"));
            }
        }
        let art = Artwork { labels: vec![Labels::default()], ..Artwork::default() };
        let (uses, visits, cut_edges, work, named, labelled) = <_>::default();
        let (purpose, is_quiet) = (Purpose::Mark, false);
        Self {
            doc,
            sheet,
            ids,
            tolerance,
            marking,
            widest_line,
            scale,
            purpose,
            uses,
            visits,
            cut_edges,
            work,
            is_quiet,
            numbers,
            named,
            labelled,
            art,
            tally,
        }
    }

    /// What the children of the root draw.
    pub(super) fn drawn(mut self, root: Node<'a, 'input>, state: State<'a>) -> Result<(Artwork, Tally), Box<Diag>> {
        if let Some(state) = self.enter(root, state)? {
            self.children(root, state)?;
        }
        Ok((self.art, self.tally))
    }

    pub(super) fn children(&mut self, node: Node<'a, 'input>, state: State<'a>) -> Done {
        node.children().filter(Node::is_element).try_for_each(|child| self.element(child, state))
    }

    pub(super) fn element(&mut self, node: Node<'a, 'input>, state: State<'a>) -> Done {
        if !is_svg(node) {
            return Ok(());
        }
        match node.tag_name().name() {
            "g" | "a" => match self.enter(node, state)? {
                Some(state) => self.children(node, state),
                None => Ok(()),
            },
            "svg" => match self.enter(node, state)? {
                Some(inner) => {
                    let sides = [self.side(node, "width", 0, state), self.side(node, "height", 1, state)];
                    self.viewport(node, sides, inner)
                }
                None => Ok(()),
            },
            "use" => self.used(node, state),
            "switch" => match (self.enter(node, state)?, chosen(node)) {
                (Some(state), Some(child)) => self.element(child, state),
                _ => Ok(()),
            },
            "text" | "foreignObject" => self.unmarked(node, state, Issue::Text),
            "image" => self.unmarked(node, state, Issue::Image),
            tag if SHAPES.contains(&tag) => self.shape(node, tag, state),
            _ => Ok(()),
        }
    }

    /// The state inside an element; None where nothing of it is drawn.
    pub(super) fn enter(
        &mut self,
        node: Node<'a, 'input>,
        mut state: State<'a>,
    ) -> Result<Option<State<'a>>, Box<Diag>> {
        self.visits += 1;
        state.depth += 1;
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
        if self.is_left_out(node, state.labels) {
            return Ok(None);
        }
        let own = Declared::new(node, &self.sheet, &mut self.work)?;
        if own.is_gone() {
            self.note(Issue::Hidden, node);
            return Ok(None);
        }
        state.style = state.style.with(&own, |id| self.ids.contains_key(id));
        match transform(node, &own) {
            Some(map) => state.map = state.map.after(map),
            None => {
                self.note(Issue::Transform, node);
                return Ok(None);
            }
        }
        if !state.map.is_regular() {
            self.note(Issue::Flat, node);
            return Ok(None);
        }
        let is_effect = own.has_any(&["filter"]) || own.get("mix-blend-mode").is_some_and(|v| v != "normal");
        if is_effect && self.purpose != Purpose::Bounds {
            self.note(Issue::Effect, node);
            return Ok(None);
        }
        for (name, is_mask) in [("clip-path", false), ("mask", true)] {
            let Some(value) = own.get(name).filter(|v| !matches!(*v, "" | "none")) else { continue };
            if self.purpose != Purpose::Bounds && !self.cut(node, value, is_mask, &mut state)? {
                return Ok(None);
            }
        }
        if SHAPES.contains(&node.tag_name().name()) && self.purpose != Purpose::Bounds {
            if !self.judge(node, &own, &state.style) {
                return Ok(None);
            }
            if own.get("vector-effect") == Some("non-scaling-stroke") {
                state = self.unscaled(node, state);
            }
        }
        Ok(Some(state))
    }

    /// What an element without a parent in the tree of what is drawn inherits: the style of its ancestors.
    pub(super) fn style_of(&mut self, node: Node<'a, 'input>) -> Result<Style<'a>, Box<Diag>> {
        let mut chain: Vec<_> = node.ancestors().filter(Node::is_element).collect();
        chain.reverse();
        let mut style = Style::INITIAL;
        for node in chain {
            style = style.with(&self.declared(node)?, |id| self.ids.contains_key(id));
        }
        Ok(style)
    }

    pub(super) fn declared(&mut self, node: Node<'a, 'input>) -> Result<Declared<'a>, Box<Diag>> {
        Declared::new(node, &self.sheet, &mut self.work)
    }

    /// The element of an id, unless it is being used right now.
    pub(super) fn target(&self, id: &str) -> Option<Node<'a, 'input>> {
        let node = self.ids.get(id).and_then(|&id| self.doc.get_node(id))?;
        (!self.uses.contains(&node.id())).then_some(node)
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

    /// Notes what of a shape's looks is not marked; answers whether the rest can be.
    fn judge(&mut self, node: Node<'a, 'input>, own: &Declared<'_>, style: &Style<'a>) -> bool {
        if !style.is_seen() {
            self.note(Issue::Hidden, node);
        } else if own.has_any(&["marker", "marker-start", "marker-mid", "marker-end"]) {
            self.note(Issue::Marker, node);
            return false;
        } else if style.is_translucent {
            self.note(Issue::Translucent, node);
        }
        true
    }

    /// The state in which strokes have the width that they would have without the element's transforms.
    fn unscaled(&mut self, node: Node<'a, 'input>, mut state: State<'a>) -> State<'a> {
        if state.map.is_similar() {
            state.stretch = self.scale / state.map.enlarges();
        } else {
            self.note(Issue::Effect, node);
        }
        state
    }

    /// Notes an element of a kind that cannot be marked, unless it is hidden anyway.
    fn unmarked(&mut self, node: Node<'a, 'input>, state: State<'a>, issue: Issue) -> Done {
        if self.enter(node, state)?.is_some() {
            self.note(issue, node);
            let link = href(node).unwrap_or_default();
            if issue == Issue::Image && !link.starts_with("data:") && !link.starts_with('#') {
                self.note(Issue::External, node);
            }
        }
        Ok(())
    }

    fn used(&mut self, node: Node<'a, 'input>, state: State<'a>) -> Done {
        let Some(mut state) = self.enter(node, state)? else { return Ok(()) };
        let Some(id) = href(node).and_then(|h| h.strip_prefix('#')) else {
            self.note(Issue::External, node);
            return Ok(());
        };
        let Some(target) = self.target(id).filter(|t| !node.ancestors().any(|a| a == *t)) else {
            self.note(Issue::Use, node);
            return Ok(());
        };
        let corner = [self.length(node, "x", 0, state), self.length(node, "y", 1, state)];
        state.map = state.map.after(Map::shift(corner));
        self.uses.push(target.id());
        let done = match target.tag_name().name() {
            "symbol" | "svg" if is_svg(target) => {
                let sides = [0, 1].map(|k| {
                    let name = ["width", "height"][k];
                    let of = if node.has_attribute(name) { node } else { target };
                    self.side(of, name, k, state)
                });
                match self.enter(target, state)? {
                    Some(state) => self.viewport(target, sides, state),
                    None => Ok(()),
                }
            }
            _ => self.element(target, state),
        };
        self.uses.pop();
        done
    }

    /// Draws the children of a nested drawing or a symbol.
    fn viewport(&mut self, node: Node<'a, 'input>, size: [f64; 2], mut state: State<'a>) -> Done {
        if !(size[0] > 0.0 && size[1] > 0.0) {
            self.note(Issue::Dot, node);
            return Ok(());
        }
        if node.tag_name().name() == "svg" {
            let corner = [self.length(node, "x", 0, state), self.length(node, "y", 1, state)];
            state.map = state.map.after(Map::shift(corner));
        }
        let overflow = self.declared(node)?.get("overflow");
        let corners = [[0.0, 0.0], [size[0], 0.0], size, [0.0, size[1]]].map(|c| state.map.at(c));
        state.port = size;
        match page::view_box(node) {
            Ok(Some(view)) => {
                state.map = state.map.after(view_map(view, size, page::aspect(node)));
                state.port = [view.w, view.h];
            }
            Ok(None) => {}
            Err(_) => {
                self.note(Issue::Fault, node);
                return Ok(());
            }
        }
        let first = self.art.shapes.len();
        self.children(node, state)?;
        if matches!(overflow, Some("visible" | "auto")) { Ok(()) } else { self.frame(corners, first, node) }
    }

    /// Cuts the shapes from `first` on at a frame with these corners, page mm.
    fn frame(&mut self, corners: [[f64; 2]; 4], first: usize, node: Node<'a, 'input>) -> Done {
        let mut made: HashMap<Option<u32>, u32> = HashMap::new();
        let quadrangle = Quadrangle::new(corners);
        for i in first..self.art.shapes.len() {
            let shape = &self.art.shapes[i];
            let mut lines = shape.lines.clone().map(|k| self.art.lines.get(k));
            if lines.all(|line| line.iter().all(|&p| quadrangle.holds(p, self.tolerance))) {
                continue;
            }
            let outer = shape.clip;
            let clip = match made.get(&outer) {
                Some(&clip) => clip,
                None => self.clip(outer, quadrangle.area(), node)?,
            };
            made.insert(outer, clip);
            self.art.shapes[i].clip = Some(clip);
        }
        Ok(())
    }

    /// Notes an area that shapes are cut at, within an outer one; answers with its index.
    pub(super) fn clip(&mut self, outer: Option<u32>, area: Area, node: Node<'a, 'input>) -> Result<u32, Box<Diag>> {
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
    pub(super) fn length(&mut self, node: Node<'a, 'input>, name: &str, axis: usize, state: State<'a>) -> f64 {
        node.attribute(name).and_then(|text| self.parsed(node, text, axis, state)).unwrap_or(0.0)
    }

    /// As [`Walk::length`], of a text; None where it is faulty.
    pub(super) fn parsed(&mut self, node: Node<'a, 'input>, text: &str, axis: usize, state: State<'a>) -> Option<f64> {
        match Length::from_str(text.trim()).ok().filter(|l| l.number.is_finite()) {
            Some(length) => Some(self.resolved(node, length, axis, state)),
            None => {
                self.note(Issue::Fault, node);
                None
            }
        }
    }

    pub(super) fn resolved(&mut self, node: Node<'a, 'input>, length: Length, axis: usize, state: State<'a>) -> f64 {
        if matches!(length.unit, LengthUnit::Em | LengthUnit::Ex) {
            self.note(Issue::Unit, node);
        }
        let [w, h] = state.port;
        let whole = [w, h, ((w * w + h * h) / 2.0).sqrt()][axis];
        page::px(length).unwrap_or(length.number / 100.0 * whole)
    }

    /// A side of a nested viewport: that of the outer one unless it says otherwise.
    fn side(&mut self, node: Node<'a, 'input>, name: &str, axis: usize, state: State<'a>) -> f64 {
        match node.attribute(name) {
            None | Some("auto") => state.port[axis],
            Some(_) => self.length(node, name, axis, state),
        }
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

/// The transform of an element; None where it is faulty, or of a kind that is not read.
pub(super) fn transform(node: Node<'_, '_>, own: &Declared<'_>) -> Option<Map> {
    let Some(text) = own.get("transform").filter(|t| *t != "none") else { return Some(Map::shift([0.0; 2])) };
    // On the root it would turn the page itself.
    let is_plain = node.parent_element().is_some() && own.get("transform-origin").is_none();
    let t = svgtypes::Transform::from_str(text).ok().filter(|_| is_plain)?;
    Some(Map { a: t.a, b: t.b, c: t.c, d: t.d, e: t.e, f: t.f })
}

/// The id of an element, or its tag and number, from 1, among all of its tag.
fn called(node: Node<'_, '_>, numbers: &[u32]) -> String {
    match node.attribute("id") {
        Some(id) => id.to_owned(),
        None => format!("{} {}", node.tag_name().name(), numbers[node.id().get_usize()]),
    }
}

fn is_svg(node: Node<'_, '_>) -> bool {
    matches!(node.tag_name().namespace(), None | Some(SVG))
}

/// The style sheet that an element holds, if it is one.
pub(super) fn style_text<'a>(node: Node<'a, '_>) -> Option<&'a str> {
    let is_css = matches!(node.attribute("type"), None | Some("text/css"));
    (is_svg(node) && node.tag_name().name() == "style" && is_css).then(|| node.text().unwrap_or_default())
}

/// What an element refers to; `href` wins over `xlink:href`.
pub(super) fn href<'a>(node: Node<'a, '_>) -> Option<&'a str> {
    let named = |ns: Option<&str>| node.attributes().find(|a| a.name() == "href" && a.namespace() == ns);
    named(None).or_else(|| named(Some(XLINK))).map(|a| a.value().trim())
}

/// The child of a switch that is drawn: the first that asks for nothing special.
fn chosen<'a, 'input>(switch: Node<'a, 'input>) -> Option<Node<'a, 'input>> {
    switch.children().filter(Node::is_element).find(|n| {
        let speaks = n.attribute("systemLanguage").is_none_or(|l| l.split(',').any(|l| l.trim().starts_with("en")));
        is_svg(*n)
            && speaks
            && n.attribute("requiredExtensions").is_none_or(str::is_empty)
            && n.tag_name().name() != "foreignObject"
    })
}

/// A convex figure of four sides, page mm.
struct Quadrangle([[f64; 2]; 4]);

impl Quadrangle {
    fn new(corners: [[f64; 2]; 4]) -> Self {
        Self(corners)
    }

    /// Whether a point lies in it, or at most `by` outside.
    fn holds(&self, p: [f64; 2], by: f64) -> bool {
        let side = |k: usize| {
            let (a, b) = (self.0[k], self.0[(k + 1) % 4]);
            let d = [b[0] - a[0], b[1] - a[1]];
            (d[0] * (p[1] - a[1]) - d[1] * (p[0] - a[0])) / d[0].hypot(d[1])
        };
        let sides = [0, 1, 2, 3].map(side);
        sides.iter().all(|&s| s >= -by) || sides.iter().all(|&s| s <= by)
    }

    fn area(&self) -> Area {
        Area::new([self.0.as_slice()].into_iter(), Rule::NonZero).expect("four edges")
    }
}
