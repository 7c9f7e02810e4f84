//! SVG drawings: what is seen of each element, as lines and areas on a page of known size in mm.
//!
//! Consumes an SVG 1.1 / 2 file (also svgz). Promises an [`Artwork`] whose lower left corner is the origin, y up:
//! lines, polylines, polygons, rectangles, circles, ellipses and paths, with groups, uses, symbols, nested drawings,
//! transforms, viewBox and styles (`svg_style`) resolved, in the order of painting. A fill is an area by its rule. A
//! stroke is the line along its centre, or, where it is wide or the job asks for it, the area that it covers with its
//! caps and joins; dashes are cut out. Clip paths, masks of opaque black and white shapes, and patterns are applied.
//! What cannot be reproduced (text, images, gradients of several colours, filters, blend modes, markers, animations,
//! and styles that are not understood) is refused by name, or left out with a warning where the job asks for that.
//! Faulty data is drawn up to its fault, as viewers do.
//!
//! A closed subpath thinner than the tolerance is left out, with a count. No other file is ever opened and no network
//! reached; time and memory are bounded: 64 MB unpacked, 1 MB of expanded entities, 256 levels, 2 million elements once
//! uses are expanded, 20 million points, 1 million copies of a pattern's shapes, and the bounds of `svg_style`.
//!
//! Everything is f64 from the text of the number to the page, and arcs are flattened as arcs: a reader
//! in f32 that first makes Bézier curves of them misses a circle of 40 mm radius by up to 11 µm, and loses
//! drawings whose coordinates lie far from their origin.

mod outline;
mod page;
mod path;
mod remarks;
mod servers;
mod shape;
mod state;
mod stroke;
mod style;
mod tally;
mod unseen;
mod walk;

use std::path::Path;
use std::sync::Arc;

use roxmltree::{Document, ParsingOptions};

use super::artwork::{Artwork, Marking};
use super::clip::is_inside;
use super::page::WantedSize;
use super::place::Site;
use page::PageFrame;
use svg_style::Cascade;
use tally::{Issue, Tally};
use terrace_core::diag::{Diag, Error, Place, memory};
use terrace_core::geom::BoxMm;
use terrace_core::parallel;
use walk::{Walk, excess};

/// Most nodes of the XML tree.
const MAX_NODES: u32 = 4_000_000;
/// Stack for the levels of a drawing, bytes: several times of what an unoptimised build takes.
const STACK: usize = 16 << 20;

/// Reads the text of a drawing; the size that is `wanted` wins over the file's own size.
///
/// # Errors
/// `svg-…`, `texture-empty`, `texture-far`, `texture-large`.
pub(super) fn load(
    text: &str,
    path: &Path,
    wanted: WantedSize,
    site: &Site,
    marking: &Marking,
    notes: &mut Vec<Diag>,
) -> Result<Artwork, Error> {
    let name = &path.display().to_string();
    let here = |d: Box<Diag>| {
        let place = if d.place == Place::Nowhere { Place::file(name) } else { d.place.clone() };
        Error::from(d.at(place))
    };
    let doc = document(name, text, notes).map_err(here)?;
    let root = doc.root_element();
    let mut cascade = Cascade::new(&doc).map_err(|e| here(excess(e)))?;
    let (style, _) = cascade.style(root, &Arc::new(svg_style::Style::initial()), None).map_err(|e| here(excess(e)))?;
    let frame = PageFrame::new(root, &style, wanted).map_err(here)?;
    if frame.is_stretched {
        let text = format!("the drawing is stretched to a page of {} mm x {} mm", frame.size[0], frame.size[1]);
        notes.push(
            Diag::warning("svg-stretched", text)
                .at(Place::file(name))
                .hint("give the texture a size in the drawing's proportions"),
        );
    }
    let walk = Walk::new(&doc, cascade, site, &frame, marking);
    let drawn = parallel::on_stack(STACK, || walk.drawn(root, &frame)).map_err(|e| {
        let text = format!("the drawing needs a stack of {} MB to be read in: {e}", STACK >> 20);
        here(Diag::limit("memory", text).hint("raise the limit of memory or of threads").into())
    })?;
    let (mut art, mut tally, remarks) = drawn.map_err(here)?;
    art.size = frame.size;
    overhangs(&art, site.tolerance, &mut tally);
    let unseen = tally.count(Issue::Hidden);
    let faults = tally.refused() + remarks.refused();
    marking.tell(tally.messages(name, marking).into_iter().chain(remarks.messages(name, marking)), notes)?;
    if art.shapes.is_empty() && !marking.chooses() {
        let hint = match (faults, unseen) {
            (1.., _) => "all that it holds is left out, as on_unsupported = \"warn\" asks for",
            (_, 1..) => "give the shapes a fill or a stroke and show them",
            _ => "draw lines or shapes on the page",
        };
        return Err(here(Diag::input("texture-empty", "the drawing holds nothing to mark").hint(hint).into()));
    }
    Ok(art)
}

/// The tree of a drawing.
fn document<'a>(name: &str, text: &'a str, notes: &mut Vec<Diag>) -> Result<Document<'a>, Box<Diag>> {
    // A node of the tree for every tag and the text after it; of the text, three copies at most as numbers.
    let need = 3 * text.len() + 200 * text.bytes().filter(|&b| b == b'<').count();
    memory::ask("the drawing", need as u64)?;
    // What its entities expand to has been bounded (`xml`).
    let options = ParsingOptions { allow_dtd: true, nodes_limit: MAX_NODES, ..Default::default() };
    let doc = Document::parse_with_options(text, options).map_err(|e| xml_fault(name, &e))?;
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
    Ok(doc)
}

/// Notes the elements that reach beyond the page, where a viewer shows nothing of them.
fn overhangs(art: &Artwork, tolerance: f64, tally: &mut Tally) {
    let page = BoxMm { lo: [-tolerance; 2], hi: art.size.map(|side| side + tolerance) };
    // The name of the last element that was counted: its fill and its stroke are one.
    let mut counted = u32::MAX;
    for shape in &art.shapes {
        let mut lines = shape.lines.clone().map(|k| art.lines.get(k));
        if shape.name != counted && shape.clip.is_none() && !lines.all(|line| is_inside(line, page)) {
            tally.add(Issue::Overhang, || art.names[shape.name as usize].clone());
            counted = shape.name;
        }
    }
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
