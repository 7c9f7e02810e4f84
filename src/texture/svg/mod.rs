//! SVG drawings: the outline of every visible shape as polylines on a page of known size in mm.
//!
//! Consumes an SVG 1.1 / 2 file (also svgz). Promises a [`Page`] whose lower left corner is the origin, y up: lines,
//! polylines, polygons, rectangles, circles, ellipses and paths, with groups, uses, symbols, nested drawings,
//! transforms, viewBox, style sheets and the style attribute resolved, in document order, each subpath its own
//! polyline, closed ones ending on their start. Fill and stroke are alike: the outline is marked. What is not marked,
//! or not as it looks, is counted and reported by a warning: text, images, hidden elements, paint servers, clip paths,
//! masks, filters, markers, dashes, what overhangs the page (and is cut at it), faulty data (drawn up to the fault).
//!
//! A closed subpath thinner than the tolerance would be one line marked twice; it is left out, with a
//! count. No other file is ever opened, no network reached, no entity expanded; time and memory are
//! bounded: 64 MB unpacked, 256 levels, 2 million elements once uses are expanded, 20 million points,
//! 40 million comparisons with selectors of style sheets.
//!
//! Everything is f64 from the text of the number to the page, and arcs are flattened as arcs: a reader
//! in f32 that first makes Bézier curves of them misses a circle of 40 mm radius by up to 11 µm, and loses
//! drawings whose coordinates lie far from their origin.

mod outline;
mod page;
mod path;
mod source;
mod style;
mod style_sheet;
mod tally;
mod walk;

use std::path::{Path, PathBuf};

use roxmltree::{Document, ParsingOptions};

use super::clip::{Lines, clip, is_inside, snap};
use crate::diag::{Diag, Error, Place, memory};
use crate::geom::BoxMm;
use page::Frame;
pub(super) use source::foreign_name;
use style::Style;
use style_sheet::{Sheet, without_comments};
use tally::{Issue, Tally};
use walk::{State, Walk, style_text};

/// Most nodes of the XML tree.
const MAX_NODES: u32 = 4_000_000;

/// The polylines of a drawing on its page.
#[derive(Debug)]
pub(super) struct Page {
    /// Width and height, mm.
    pub(super) size: [f64; 2],
    /// In page mm, all on the page.
    pub(super) lines: Lines,
    /// Per line, the place of its element among the names.
    pub(super) name_of: Vec<u32>,
    /// Elements: their id, or tag and number.
    pub(super) names: Vec<String>,
}

/// The texts of drawings, each file read once.
#[derive(Default)]
pub(super) struct Sources(Vec<(PathBuf, String)>);

impl Sources {
    /// The text of a file.
    ///
    /// # Errors
    /// `file-…`, `svg-…` where it cannot be read or is not text.
    pub(super) fn read(&mut self, path: &Path) -> Result<&str, Error> {
        let known = self.0.iter().position(|(p, _)| p == path);
        let i = match known {
            Some(i) => i,
            None => {
                self.0.push((path.to_owned(), source::read(path)?));
                self.0.len() - 1
            }
        };
        Ok(&self.0[i].1)
    }
}

/// Reads the text of a drawing; `size_mm` wins over the file's own size.
///
/// # Errors
/// `svg-…`, `texture-empty`, `texture-far`, `texture-large`.
pub(super) fn load(
    text: &str,
    path: &Path,
    size_mm: Option<[f64; 2]>,
    tolerance: f64,
    notes: &mut Vec<Diag>,
) -> Result<Page, Error> {
    let name = path.display().to_string();
    // A node of the tree for every tag and the text after it; of the text, three copies at most as numbers.
    let need = 3 * text.len() + 200 * text.bytes().filter(|&b| b == b'<').count();
    memory::ask("the drawing", need as u64).map_err(|d| d.at(Place::file(&name)))?;
    parse(&name, text, size_mm, tolerance, notes).map_err(|d| {
        let place = if d.place == Place::Nowhere { Place::file(&name) } else { d.place.clone() };
        d.at(place).into()
    })
}

fn parse(
    name: &str,
    text: &str,
    size_mm: Option<[f64; 2]>,
    tolerance: f64,
    notes: &mut Vec<Diag>,
) -> Result<Page, Box<Diag>> {
    // A document type without entities is harmless and common.
    let options =
        ParsingOptions { allow_dtd: !source::has_entities(text), nodes_limit: MAX_NODES, ..Default::default() };
    let doc = Document::parse_with_options(text, options).map_err(|e| Box::new(xml_fault(name, &e)))?;
    let root = doc.root_element();
    match (root.tag_name().name(), root.tag_name().namespace()) {
        ("svg", Some("http://www.w3.org/2000/svg")) => {}
        ("svg", None) => notes.push(
            Diag::warning("svg-namespace", "the drawing does not say that it is SVG")
                .at(Place::file(name))
                .hint("add xmlns=\"http://www.w3.org/2000/svg\" to its first element"),
        ),
        (tag, _) => {
            let text = format!("this is not an SVG drawing: its first element is {tag:?}");
            return Err(Diag::input("svg-root", text).hint("save it as plain SVG").into());
        }
    }
    let frame = Frame::new(root, size_mm)?;
    if frame.is_stretched {
        let text = format!("the drawing is stretched to a page of {} mm x {} mm", frame.size[0], frame.size[1]);
        notes.push(
            Diag::warning("svg-stretched", text)
                .at(Place::file(name))
                .hint("give the texture a size in the drawing's proportions"),
        );
    }
    let texts: Vec<String> = doc.descendants().filter_map(style_text).map(without_comments).collect();
    let mut walk = Walk::new(&doc, Sheet::new(&texts)?, tolerance);
    let state = State { map: frame.map, style: Style::INITIAL, port: frame.port, frame: None, depth: 0 };
    let walked = walk.root(root, state);
    let Walk { lines, name_of, names, tally, .. } = walk;
    let page = walked.map(|()| on_page(lines, name_of, names, frame.size, tally));
    let (page, tally) = page?;
    let (unseen, texts) = (tally.count(Issue::Hidden), tally.count(Issue::Text));
    notes.extend(tally.warnings(name));
    if page.lines.len() == 0 {
        let hint = match (texts, unseen) {
            (1.., _) => "convert text to paths in the drawing program",
            (_, 1..) => "give the shapes a fill or a stroke and show them",
            _ => "draw lines or shapes on the page",
        };
        return Err(Diag::input("texture-empty", "the drawing holds nothing to mark").hint(hint).into());
    }
    Ok(page)
}

/// Cuts the lines at the border of the page, which is what a viewer shows.
fn on_page(mut lines: Lines, name_of: Vec<u32>, names: Vec<String>, size: [f64; 2], mut tally: Tally) -> (Page, Tally) {
    let rect = BoxMm { lo: [0.0; 2], hi: size };
    if is_inside(&lines.points, rect) {
        snap(&mut lines.points, rect);
        return (Page { size, lines, name_of, names }, tally);
    }
    let mut page = Page { size, lines: Lines::default(), name_of: Vec::new(), names };
    let mut cut = u32::MAX;
    for (line, &name) in lines.iter().zip(&name_of) {
        if !is_inside(line, rect) && cut != name {
            tally.add(Issue::Overhang, || page.names[name as usize].clone());
            cut = name;
        }
        clip(line, rect, &mut page.lines);
        page.name_of.resize(page.lines.len(), name);
    }
    (page, tally)
}

fn xml_fault(name: &str, e: &roxmltree::Error) -> Diag {
    let place = Place::line(name, e.pos().row as usize);
    match e {
        roxmltree::Error::NodesLimitReached => {
            Diag::input("svg-large", format!("the drawing has more than {MAX_NODES} nodes"))
                .at(Place::file(name))
                .hint("split it into several drawings")
        }
        e => Diag::input("svg-xml", format!("the drawing is not well-formed XML: {e}"))
            .at(place)
            .hint("save it again as plain SVG"),
    }
}
