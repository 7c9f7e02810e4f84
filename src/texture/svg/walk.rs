//! The walk over a drawing's elements: groups, uses, nested drawings and shapes, in document order.

use std::collections::HashMap;
use std::str::FromStr;

use roxmltree::{Document, Node, NodeId};
use svgtypes::{Length, LengthUnit};

use super::outline::{Map, Outline, Stop};
use super::page::{self, view_map};
use super::path;
use super::source::MAX_DEPTH;
use super::style::{Declared, Style};
use super::style_sheet::{Sheet, Work};
use super::tally::{Issue, Tally};
use crate::diag::Diag;
use crate::geom::BoxMm;
use crate::texture::clip::Lines;

const SVG: &str = "http://www.w3.org/2000/svg";
const XLINK: &str = "http://www.w3.org/1999/xlink";

/// Most elements that are walked, uses expanded.
const MAX_VISITS: usize = 2_000_000;

const SHAPES: [&str; 7] = ["rect", "circle", "ellipse", "line", "polyline", "polygon", "path"];

/// What an element inherits.
#[derive(Clone, Copy)]
pub(super) struct State {
    /// From the element's units to page mm.
    pub(super) map: Map,
    pub(super) style: Style,
    /// Size of the nearest viewport, which percentages refer to.
    pub(super) port: [f64; 2],
    /// The frame that a nested viewport would clip at, page mm.
    pub(super) frame: Option<BoxMm<2>>,
    pub(super) depth: usize,
}

pub(super) struct Walk<'a, 'input> {
    doc: &'a Document<'input>,
    sheet: Sheet<'a>,
    ids: HashMap<&'a str, NodeId>,
    tolerance: f64,
    /// Elements that are being used right now, from the outside in.
    uses: Vec<NodeId>,
    visits: usize,
    work: Work,
    /// Number of each element among those of its tag, from 1, and its place in `names`.
    numbers: Vec<u32>,
    named: HashMap<NodeId, u32>,
    pub(super) names: Vec<String>,
    pub(super) lines: Lines,
    pub(super) name_of: Vec<u32>,
    pub(super) tally: Tally,
}

type Done = Result<(), Box<Diag>>;

impl<'a, 'input> Walk<'a, 'input> {
    pub(super) fn new(doc: &'a Document<'input>, sheet: Sheet<'a>, tolerance: f64) -> Self {
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
        let (uses, names, lines, name_of) = <_>::default();
        let (visits, work, named) = <_>::default();
        Self { doc, sheet, ids, tolerance, uses, visits, work, numbers, named, names, lines, name_of, tally }
    }

    /// Walks the children of the root.
    pub(super) fn root(&mut self, root: Node<'a, 'input>, state: State) -> Done {
        let Some(state) = self.enter(root, state)? else { return Ok(()) };
        self.children(root, state)
    }

    fn children(&mut self, node: Node<'a, 'input>, state: State) -> Done {
        node.children().filter(Node::is_element).try_for_each(|child| self.element(child, state))
    }

    fn element(&mut self, node: Node<'a, 'input>, state: State) -> Done {
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
    fn enter(&mut self, node: Node<'a, 'input>, mut state: State) -> Result<Option<State>, Box<Diag>> {
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
        let own = Declared::new(node, &self.sheet, &mut self.work)?;
        if own.is_gone() {
            self.note(Issue::Hidden, node);
            return Ok(None);
        }
        state.style = state.style.with(&own, |id| self.ids.contains_key(id));
        if own.has_any(&["clip-path", "mask", "filter"]) {
            self.note(Issue::Clip, node);
        }
        if let Some(text) = own.get("transform").filter(|t| *t != "none") {
            // On the root it would turn the page itself.
            match svgtypes::Transform::from_str(text) {
                Ok(t) if node.parent_element().is_some() => {
                    state.map = state.map.after(Map { a: t.a, b: t.b, c: t.c, d: t.d, e: t.e, f: t.f })
                }
                _ => self.note(Issue::Transform, node),
            }
            if node.has_attribute("transform-origin") {
                self.note(Issue::Transform, node);
            }
        }
        if !state.map.is_regular() {
            self.note(Issue::Transform, node);
            return Ok(None);
        }
        if SHAPES.contains(&node.tag_name().name()) {
            self.judge(node, &own, &state.style);
        }
        Ok(Some(state))
    }

    /// Notes what of a shape's looks is not marked.
    fn judge(&mut self, node: Node<'a, 'input>, own: &Declared<'_>, style: &Style) {
        if !style.is_seen() {
            return self.note(Issue::Hidden, node);
        }
        if style.is_served() {
            self.note(Issue::Paint, node);
        }
        if style.is_dashed() {
            self.note(Issue::Dash, node);
        }
        if own.has_any(&["marker", "marker-start", "marker-mid", "marker-end"]) {
            self.note(Issue::Marker, node);
        }
    }

    /// Notes an element of a kind that cannot be marked, unless it is hidden anyway.
    fn unmarked(&mut self, node: Node<'a, 'input>, state: State, issue: Issue) -> Done {
        if self.enter(node, state)?.is_some() {
            self.note(issue, node);
            let link = href(node).unwrap_or_default();
            if issue == Issue::Image && !link.starts_with("data:") && !link.starts_with('#') {
                self.note(Issue::External, node);
            }
        }
        Ok(())
    }

    fn used(&mut self, node: Node<'a, 'input>, state: State) -> Done {
        let Some(mut state) = self.enter(node, state)? else { return Ok(()) };
        let Some(id) = href(node).and_then(|h| h.strip_prefix('#')) else {
            self.note(Issue::External, node);
            return Ok(());
        };
        let target = self.ids.get(id).and_then(|&id| self.doc.get_node(id));
        let Some(target) = target.filter(|t| !self.uses.contains(&t.id()) && !node.ancestors().any(|a| a == *t)) else {
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
    fn viewport(&mut self, node: Node<'a, 'input>, size: [f64; 2], mut state: State) -> Done {
        if !(size[0] > 0.0 && size[1] > 0.0) {
            self.note(Issue::Dot, node);
            return Ok(());
        }
        if node.tag_name().name() == "svg" {
            let corner = [self.length(node, "x", 0, state), self.length(node, "y", 1, state)];
            state.map = state.map.after(Map::shift(corner));
        }
        let corners = [[0.0, 0.0], [size[0], 0.0], size, [0.0, size[1]]].map(|c| state.map.at(c));
        let clips = !matches!(node.attribute("overflow"), Some("visible" | "auto"));
        state.frame = clips.then(|| BoxMm::of(corners));
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
        self.children(node, state)
    }

    fn shape(&mut self, node: Node<'a, 'input>, tag: &str, state: State) -> Done {
        let Some(state) = self.enter(node, state)? else { return Ok(()) };
        if !state.style.is_seen() {
            return Ok(());
        }
        let first = self.lines.len();
        let mut lines = std::mem::take(&mut self.lines);
        let mut out = Outline::new(state.map, self.tolerance, &mut lines);
        let whole = self.draw(node, tag, state, &mut out);
        let ended = out.end();
        self.lines = lines;
        if !whole {
            self.note(Issue::Fault, node);
        }
        let dropped = ended.map_err(|stop| Box::new(self.stopped(stop, node)))?;
        if dropped.dots {
            self.note(Issue::Dot, node);
        }
        if dropped.hairlines {
            self.note(Issue::Hairline, node);
        }
        let overhangs = |BoxMm { lo, hi }: BoxMm<2>| {
            let t = self.tolerance;
            let out = |p: &[f64; 2]| (0..2).any(|k| p[k] < lo[k] - t || p[k] > hi[k] + t);
            (first..self.lines.len()).any(|i| self.lines.get(i).iter().any(out))
        };
        if state.frame.is_some_and(overhangs) {
            self.note(Issue::Clip, node);
        }
        let name = self.name(node);
        self.name_of.resize(self.lines.len(), name);
        Ok(())
    }

    /// Draws a shape; answers whether its description was faultless.
    fn draw(&mut self, node: Node<'a, 'input>, tag: &str, state: State, out: &mut Outline<'_>) -> bool {
        let text = |name: &str| node.attribute(name).unwrap_or_default();
        let mut get = |name: &str, axis: usize| self.length(node, name, axis, state);
        match tag {
            "path" => return path::path(text("d"), out),
            "polyline" => return path::points(text("points"), false, out),
            "polygon" => return path::points(text("points"), true, out),
            "line" => {
                out.move_to([get("x1", 0), get("y1", 1)]);
                out.line_to([get("x2", 0), get("y2", 1)]);
            }
            "rect" => {
                let (p, size) = ([get("x", 0), get("y", 1)], [get("width", 0), get("height", 1)]);
                let radii = radii(node, size, &mut get);
                rect(p, size, radii, out);
            }
            "circle" => {
                let r = get("r", 2);
                ellipse([get("cx", 0), get("cy", 1)], [r, r], out);
            }
            _ => {
                let centre = [get("cx", 0), get("cy", 1)];
                let radii = radii(node, [f64::INFINITY; 2], &mut get);
                ellipse(centre, radii, out);
            }
        }
        true
    }

    /// A length in user units; 0 where it is not given or faulty. Axis 0 is x, 1 is y, 2 neither.
    fn length(&mut self, node: Node<'a, 'input>, name: &str, axis: usize, state: State) -> f64 {
        let Some(text) = node.attribute(name) else { return 0.0 };
        let Some(length) = Length::from_str(text.trim()).ok().filter(|l| l.number.is_finite()) else {
            self.note(Issue::Fault, node);
            return 0.0;
        };
        if matches!(length.unit, LengthUnit::Em | LengthUnit::Ex) {
            self.note(Issue::Unit, node);
        }
        let [w, h] = state.port;
        let whole = [w, h, ((w * w + h * h) / 2.0).sqrt()][axis];
        page::px(length).unwrap_or(length.number / 100.0 * whole)
    }

    /// A side of a nested viewport: that of the outer one unless it says otherwise.
    fn side(&mut self, node: Node<'a, 'input>, name: &str, axis: usize, state: State) -> f64 {
        match node.attribute(name) {
            None | Some("auto") => state.port[axis],
            Some(_) => self.length(node, name, axis, state),
        }
    }

    fn stopped(&self, stop: Stop, node: Node<'a, 'input>) -> Diag {
        let name = self.called(node);
        match stop {
            Stop::Far => Diag::input("texture-far", format!("{name} reaches beyond any part"))
                .hint("check its transforms and coordinates"),
            Stop::Full => {
                let text = format!("the drawing has more than {} points at {name}", super::outline::MAX_POINTS);
                Diag::limit("texture-large", text).hint("use a larger tolerance or a simpler drawing")
            }
        }
    }

    fn note(&mut self, issue: Issue, node: Node<'a, 'input>) {
        let name = || called(node, &self.numbers);
        self.tally.add(issue, name);
    }

    fn called(&self, node: Node<'a, 'input>) -> String {
        called(node, &self.numbers)
    }

    /// The place of the element's name among the names.
    fn name(&mut self, node: Node<'a, 'input>) -> u32 {
        let next = u32::try_from(self.names.len()).expect("fewer elements than visits");
        *self.named.entry(node.id()).or_insert_with(|| {
            self.names.push(called(node, &self.numbers));
            next
        })
    }
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
fn href<'a>(node: Node<'a, '_>) -> Option<&'a str> {
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

/// Radii of a rectangle's corners or of an ellipse: one that is not given equals the other.
fn radii(node: Node<'_, '_>, size: [f64; 2], get: &mut impl FnMut(&str, usize) -> f64) -> [f64; 2] {
    let given = |name: &str| node.attribute(name).is_some_and(|t| t.trim() != "auto");
    let [rx, ry] = match [given("rx"), given("ry")] {
        [true, true] => [get("rx", 0), get("ry", 1)],
        [true, false] => [get("rx", 0); 2],
        [false, true] => [get("ry", 1); 2],
        [false, false] => [0.0; 2],
    };
    [rx.clamp(0.0, (size[0] / 2.0).max(0.0)), ry.clamp(0.0, (size[1] / 2.0).max(0.0))]
}

fn rect([x, y]: [f64; 2], [w, h]: [f64; 2], [rx, ry]: [f64; 2], out: &mut Outline<'_>) {
    if !(w > 0.0 && h > 0.0) {
        return out.dot();
    }
    out.move_to([x + rx, y]);
    let sides = [
        ([x + w - rx, y], [x + w, y + ry]),
        ([x + w, y + h - ry], [x + w - rx, y + h]),
        ([x + rx, y + h], [x, y + h - ry]),
        ([x, y + ry], [x + rx, y]),
    ];
    for (line_end, arc_end) in sides {
        if line_end != out.at() {
            out.line_to(line_end);
        }
        out.arc_to([rx, ry], 0.0, false, true, arc_end);
    }
    out.close();
}

fn ellipse(centre: [f64; 2], [rx, ry]: [f64; 2], out: &mut Outline<'_>) {
    if rx > 0.0 && ry > 0.0 { out.ellipse(centre, rx, ry) } else { out.dot() }
}
