//! From a drawing to the lines that are marked: what is seen of each shape, filled or outlined, with its pen.
//!
//! A shape is seen where no later shape lies over it. Areas of one pen that touch or overlap are one area, so that no
//! place is hatched twice. Areas in a colour of the page hide, and are not marked.

use std::borrow::Cow;

use rstar::primitives::{GeomWithData, Rectangle};
use rstar::{AABB, RTree};

use super::area::{Area, Polygon};
use super::choice::{Class, classes};
use super::coverage::covered_share;
use super::crossings::TooMany;
use super::cut::Keep;
use super::dot_screen::DotScreen;
use super::hatch::{Hatch, TooFine, Waiting};
use super::light::{self, HIDES};
use super::screen::LineScreen;
use super::{Artwork, ContourPass, Figure, FillMode, Grey, Marking, Rule, Shape, StrokeMode};
use crate::texture::clip::{Lines, clip, clip_contour, is_hairline, is_inside};
use crate::texture::place::NM;
use terrace_core::diag::Diag;
use terrace_core::geom::BoxMm;
use terrace_core::parallel;
use terrace_core::program::PenId;

/// Most edges of covering areas that are looked at, counted again for each shape that they may cover.
const MAX_COVERED: usize = 100_000_000;

/// The lines of a drawing that are marked.
#[derive(Debug)]
pub(in crate::texture) struct Page {
    /// Width and height, mm.
    pub(in crate::texture) size: [f64; 2],
    /// The corner that [`Artwork::corner`] says.
    pub(in crate::texture) corner: Option<[f64; 2]>,
    /// In page mm.
    pub(in crate::texture) lines: Lines,
    /// Per line, the index of its element's name.
    pub(in crate::texture) name_of: Vec<u32>,
    /// Per line, its pen; None for the pen of the texture.
    pub(in crate::texture) pen_of: Vec<Option<PenId>>,
    /// Names of elements.
    pub(in crate::texture) names: Vec<String>,
    /// The areas whose lines follow the level lines of the part.
    pub(in crate::texture) waits: Vec<Waits>,
    /// How these are laid.
    pub(in crate::texture) waiting: Waiting,
    /// How many of the lines are marked before them.
    pub(in crate::texture) before: usize,
}

/// Areas that are filled once directions are known.
#[derive(Debug)]
pub(in crate::texture) struct Waits {
    /// Index of the element's name.
    pub(in crate::texture) name: u32,
    /// None for the pen of the texture.
    pub(in crate::texture) pen: Option<PenId>,
    /// In page mm.
    pub(in crate::texture) polygons: Vec<Polygon>,
}

/// What is done with a shape.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum How {
    Line,
    Hatch,
    Rings,
    /// The contours of an area as lines.
    Outline,
    /// A picture by lines.
    Screen,
    /// The shape hides what lies below, and is not marked.
    Hide,
    /// The shape is left out, as if it was not drawn.
    Skip,
}

/// A shape with what became of it.
struct Seen<'a> {
    shape: &'a Shape,
    how: How,
    pen: Option<PenId>,
    /// The box of the polylines.
    bounds: BoxMm<2>,
}

/// Lines of one pen and name.
struct Made {
    name: u32,
    pen: Option<PenId>,
    lines: Lines,
    /// Polygons whose lines wait; the lines above are then their contours.
    waits: Vec<Polygon>,
    /// Polygons that no line fits into.
    thin: usize,
    /// What is said of how they reproduce a picture.
    note: Option<Diag>,
}

/// The lines of a drawing on a page that is turned by `page_rad`.
///
/// # Errors
/// `texture-pens`, `texture-crossings`, `texture-overlap`, `texture-large`.
pub(in crate::texture) fn marks(
    art: &Artwork,
    marking: &Marking,
    spot_mm: f64,
    page_rad: f64,
    notes: &mut Vec<Diag>,
) -> Result<Page, Box<Diag>> {
    let hatch = Hatch::of(marking, spot_mm, page_rad);
    let screen = Raster::new(marking, spot_mm, page_rad);
    let classes = classes(art, marking, Some(marking.paper))?;
    let seen: Vec<Seen<'_>> = parallel::map(art.shapes.len(), |i| Seen::new(art, i, classes[i], marking));
    let index = Index::new(&seen);
    let covered = covers(art, &index, &seen)?;
    let groups = groups(index, &seen);
    let areas = areas(art, &seen, &covered)?;
    let made = parallel::map(groups.len(), |g| {
        let members = &groups[g];
        let first = &seen[members[0]];
        let of = || match first.how {
            How::Line | How::Outline => Ok(lines(art, first, &covered[members[0]], &areas)?),
            How::Screen => screened(art, first, &screen),
            _ => filled(&seen, members, &covered, &areas, &hatch),
        };
        of().map_err(|fault: Fault| fault.diag(&art.names[first.shape.name as usize]))
    });
    let mut page = Page {
        size: art.size,
        corner: art.corner,
        lines: Lines::default(),
        name_of: Vec::new(),
        pen_of: Vec::new(),
        names: art.names.clone(),
        waits: Vec::new(),
        waiting: hatch.waiting(),
        before: 0,
    };
    let mut thin: Option<(usize, u32)> = None;
    let mut made = made.into_iter().collect::<Result<Vec<_>, _>>()?;
    if marking.contour == ContourPass::After {
        // Contours of areas whose lines wait come after these.
        made.sort_by_key(|m| !m.waits.is_empty());
    }
    for made in made {
        let Made { name, pen, lines, waits, thin: n, note } = made;
        notes.extend(note);
        lines.iter().for_each(|line| page.lines.push(line));
        page.name_of.resize(page.lines.len(), name);
        page.pen_of.resize(page.lines.len(), pen);
        if waits.is_empty() || marking.contour != ContourPass::After {
            page.before = page.lines.len();
        }
        if !waits.is_empty() {
            page.waits.push(Waits { name, pen, polygons: waits });
        }
        if n > 0 {
            thin = Some(thin.map_or((n, name), |(all, name)| (all + n, name)));
        }
    }
    let own_area = |i: usize| match areas[i].is_empty() {
        false => Some(areas[i].clone()),
        true => area(art, &art.shapes[i]).ok().filter(|a| !a.is_empty()),
    };
    notes.extend(light::warnings(art, marking, &classes, own_area));
    notes.extend(art.greys.iter().filter_map(|grey| screen.pale(grey)));
    if let Some((n, name)) = thin {
        let text = format!(
            "areas thinner than twice the inset of the hatch hold no line and are not marked ({n}, first {})",
            art.names[name as usize]
        );
        let hint = match art.dark_share {
            Some(_) => DIFFUSION_HINT,
            None => "lower inset, draw them wider, or ignore this",
        };
        notes.push(Diag::warning("texture-thin", text).hint(hint));
    }
    notes.extend(tone_lost(art, marking, &page, spot_mm));
    Ok(page)
}

/// What keeps the tone of a picture that is screened.
pub(in crate::texture) const DIFFUSION_HINT: &str =
    "use screen = \"diffusion\", which keeps the tone of a picture that is already screened, or lower pitch and inset";

/// How far the marks of a picture of two tones may miss its tone, as a share of it.
const MAX_TONE_LOST: f64 = 0.1;

/// What is said where filled areas of a picture of two tones cover less or more of the page than the picture is dark.
/// Lines farther apart than a spot are not to cover their area.
fn tone_lost(art: &Artwork, marking: &Marking, page: &Page, spot_mm: f64) -> Option<Diag> {
    let is_filled = matches!(marking.fill, FillMode::Hatch | FillMode::Rings)
        && Hatch::of(marking, spot_mm, 0.0).pitch_mm <= spot_mm
        && page.lines.len() > 0
        && page.waits.is_empty();
    let dark = art.dark_share.filter(|_| is_filled && spot_mm > 0.0)?;
    let covered = covered_share(&page.lines, art.size, spot_mm);
    ((covered - dark).abs() > MAX_TONE_LOST * dark).then(|| {
        let text = format!("the marks cover {covered:.3} of the page, where the picture has a coverage of {dark:.3}");
        Diag::warning("bitmap-coverage", text).hint(DIFFUSION_HINT)
    })
}

/// Why a shape cannot be marked.
enum Fault {
    Crossings,
    Fine,
    Screen,
}

impl From<TooMany> for Fault {
    fn from(_: TooMany) -> Self {
        Self::Crossings
    }
}

impl From<TooFine> for Fault {
    fn from(_: TooFine) -> Self {
        Self::Fine
    }
}

impl Fault {
    fn diag(self, element: &str) -> Box<Diag> {
        Box::new(match self {
            Self::Crossings => {
                let text = format!("the area of {element} has contours that cross each other too often (400000 times)");
                Diag::limit("texture-crossings", text)
                    .hint("simplify it in the drawing program, or mark lines: fill = \"outline\" for areas, stroke = \"centre\" for wide strokes")
            }
            Self::Fine => {
                let text = format!("the hatch of {element} has more than 20 million lines");
                Diag::limit("texture-large", text).hint("use a larger pitch")
            }
            Self::Screen => {
                let text = format!("the lines of {element} are more than 20 million, or follow too many pixels");
                Diag::limit("texture-large", text).hint("use a larger pitch or period, or fewer pixels")
            }
        })
    }
}

impl<'a> Seen<'a> {
    fn new(art: &'a Artwork, i: usize, class: Class, marking: &Marking) -> Self {
        let shape = &art.shapes[i];
        let (mut how, pen) = match class {
            Class::Skip => (How::Skip, None),
            Class::Page if matches!(shape.figure, Figure::Lines | Figure::Grey(_)) => (How::Skip, None),
            Class::Page if shape.opacity < HIDES => (How::Skip, None),
            Class::Page => (How::Hide, None),
            Class::Pen(pen) => (how(&shape.figure, marking), pen),
        };
        // The line of a stroke stands for the contour of its area.
        let has_line = |next: &Shape| next.name == shape.name && !matches!(next.figure, Figure::Fill(_));
        if how == How::Outline && matches!(shape.figure, Figure::Fill(_)) && art.shapes.get(i + 1).is_some_and(has_line)
        {
            how = How::Hide;
        }
        let points = shape.lines.clone().flat_map(|k| art.lines.get(k)).copied();
        let bounds = if how == How::Skip { BoxMm::EMPTY } else { BoxMm::of(points) };
        Self { shape, how, pen, bounds }
    }

    /// Whether it hides what lies below.
    fn is_area(&self) -> bool {
        self.how != How::Skip && self.shape.figure != Figure::Lines
    }

    fn is_filled(&self) -> bool {
        matches!(self.how, How::Hatch | How::Rings)
    }

    /// What filled areas have in common that are parts of one, where they touch.
    fn kind(&self) -> Option<Kind> {
        self.is_filled().then_some((self.how, self.pen))
    }
}

fn how(figure: &Figure, marking: &Marking) -> How {
    match (figure, marking.fill, marking.stroke) {
        (Figure::Lines, ..) => How::Line,
        (Figure::Grey(_), ..) => How::Screen,
        (Figure::Stroke, _, StrokeMode::Outline) | (Figure::Fill(_), FillMode::Outline, _) => How::Outline,
        (_, FillMode::Rings, _) => How::Rings,
        (Figure::Fill(_), FillMode::None, _) => How::Hide,
        _ => How::Hatch,
    }
}

type Entry = GeomWithData<Rectangle<[f64; 2]>, usize>;

/// How filled areas are marked.
type Kind = (How, Option<PenId>);

/// The areas by their boxes: filled ones by kind, so that those that are one need not be told apart in pairs, and
/// others.
struct Index(Vec<(Option<Kind>, RTree<Entry>)>);

impl Index {
    fn new(seen: &[Seen<'_>]) -> Self {
        let mut entries: Vec<(Option<Kind>, Vec<Entry>)> = Vec::new();
        for (i, s) in seen.iter().enumerate().filter(|(_, s)| s.is_area()) {
            let BoxMm { lo, hi } = s.bounds;
            let entry = Entry::new(Rectangle::from_corners(lo, hi), i);
            match entries.iter_mut().find(|(kind, _)| *kind == s.kind()) {
                Some((_, others)) => others.push(entry),
                None => entries.push((s.kind(), vec![entry])),
            }
        }
        Self(entries.into_iter().map(|(kind, entries)| (kind, RTree::bulk_load(entries))).collect())
    }

    /// The areas that are not one with `seen` and whose boxes meet its own.
    fn others(&self, seen: &Seen<'_>) -> impl Iterator<Item = usize> {
        let (kind, envelope) = (seen.kind(), envelope(seen));
        let trees = self.0.iter().filter(move |(other, _)| other.is_none() || *other != kind);
        trees.flat_map(move |(_, tree)| tree.locate_in_envelope_intersecting(&envelope)).map(|e| e.data)
    }

    /// Takes out the areas that are one with `seen` where they touch it, and whose boxes meet its own.
    fn take(&mut self, seen: &Seen<'_>) -> Vec<usize> {
        let kind = seen.kind();
        let tree = self.0.iter_mut().find(|(other, _)| kind.is_some() && *other == kind);
        tree.map_or(Vec::new(), |(_, t)| t.drain_in_envelope_intersecting(envelope(seen)).map(|e| e.data).collect())
    }
}

fn envelope(seen: &Seen<'_>) -> AABB<[f64; 2]> {
    AABB::from_corners(seen.bounds.lo, seen.bounds.hi)
}

/// For each shape the areas that may hide some of it, in the order of painting.
fn covers(art: &Artwork, index: &Index, seen: &[Seen<'_>]) -> Result<Vec<Vec<usize>>, Box<Diag>> {
    let points = |j: usize| seen[j].shape.lines.clone().map(|k| art.lines.get(k).len()).sum::<usize>();
    let mut work = 0;
    let of = |(i, s): (usize, &Seen<'_>)| {
        let mut covers = Vec::new();
        if matches!(s.how, How::Skip | How::Hide) {
            return Ok(covers);
        }
        for j in index.others(s) {
            work += 1;
            if j > i {
                covers.push(j);
                work += points(j);
            }
            if work > MAX_COVERED {
                let text = "too many shapes of the drawing lie over others";
                return Err(Box::new(
                    Diag::limit("texture-overlap", text)
                        .hint("remove what is hidden in the drawing program (Path, Difference), or split the drawing"),
                ));
            }
        }
        covers.sort_unstable();
        Ok(covers)
    };
    seen.iter().enumerate().map(of).collect()
}

/// The areas of the shapes that are filled or may hide others; empty for the rest.
fn areas(art: &Artwork, seen: &[Seen<'_>], covered: &[Vec<usize>]) -> Result<Vec<Area>, Box<Diag>> {
    let mut needed: Vec<bool> = seen.iter().map(Seen::is_filled).collect();
    covered.iter().flatten().for_each(|&j| needed[j] = true);
    let of = |i: usize| {
        let shape = seen[i].shape;
        let area = if needed[i] { area(art, shape) } else { Ok(Area::default()) };
        area.map_err(|TooMany| Fault::Crossings.diag(&art.names[shape.name as usize]))
    };
    parallel::map(seen.len(), of).into_iter().collect()
}

/// The area of a shape on the page, cut at its clip; empty for lines.
fn area(art: &Artwork, shape: &Shape) -> Result<Area, TooMany> {
    let rule = match shape.figure {
        Figure::Fill(rule) => rule,
        Figure::Stroke => Rule::NonZero,
        Figure::Lines | Figure::Grey(_) => return Ok(Area::default()),
    };
    let page = BoxMm { lo: [0.0; 2], hi: art.size };
    let on_page = |c| if is_inside(c, page) { Cow::Borrowed(c) } else { Cow::Owned(clip_contour(c, page)) };
    let contours: Vec<Cow<'_, [[f64; 2]]>> = shape.lines.clone().map(|k| on_page(art.lines.get(k))).collect();
    let area = Area::new(contours.iter().map(|c| &**c), rule)?;
    shape.clip.map_or(Ok(area.clone()), |clip| area.within(&art.clips[clip as usize]))
}

/// Shapes that are marked together, in the order of painting of their first: areas that are one, and single lines.
fn groups(mut index: Index, seen: &[Seen<'_>]) -> Vec<Vec<usize>> {
    let mut out = Vec::new();
    let mut is_taken = vec![false; seen.len()];
    for (i, s) in seen.iter().enumerate() {
        if matches!(s.how, How::Skip | How::Hide) || is_taken[i] {
            continue;
        }
        let mut group = vec![i];
        let mut done = 0;
        is_taken[i] = true;
        while let Some(&next) = group.get(done) {
            for j in index.take(&seen[next]) {
                if !std::mem::replace(&mut is_taken[j], true) {
                    group.push(j);
                }
            }
            done += 1;
        }
        group.sort_unstable();
        out.push(group);
    }
    out
}

/// What is seen of a shape's lines, or of the contours of an area that is outlined.
fn lines(art: &Artwork, seen: &Seen<'_>, above: &[usize], areas: &[Area]) -> Result<Made, TooMany> {
    let Seen { shape, how, pen, .. } = seen;
    let cutter = shape.clip.map(|clip| art.clips[clip as usize].cutter());
    let hidden = match above {
        [] => None,
        above => Some(Area::union(above.iter().map(|&j| &areas[j]))?.cutter()),
    };
    let mut made =
        Made { name: shape.name, pen: *pen, lines: Lines::default(), waits: Vec::new(), thin: 0, note: None };
    let page = BoxMm { lo: [0.0; 2], hi: art.size };
    let (mut on_page, mut clipped) = (Lines::default(), Lines::default());
    for k in shape.lines.clone() {
        let line = art.lines.get(k);
        let line = match how {
            How::Outline => Cow::Owned(ring(line)),
            _ => Cow::Borrowed(line),
        };
        if *how == How::Outline && is_hairline(&line, NM) {
            // It encloses nothing, so nothing of it is seen.
            continue;
        }
        on_page.clear();
        clip(&line, page, &mut on_page);
        clipped.clear();
        let whole = match &cutter {
            Some(cutter) => {
                on_page.iter().for_each(|piece| cutter.cut(piece, Keep::Inside, &mut clipped));
                &clipped
            }
            None => &on_page,
        };
        for piece in whole.iter() {
            match &hidden {
                Some(hidden) => hidden.cut(piece, Keep::Outside, &mut made.lines),
                None => made.lines.push(piece),
            }
        }
    }
    Ok(made)
}

/// What reproduces the grey of pictures.
enum Raster {
    Lines(LineScreen),
    Dots(DotScreen),
}

impl Raster {
    fn new(marking: &Marking, spot_mm: f64, page_rad: f64) -> Self {
        if marking.tone.is_some_and(|tone| tone.screen.is_of_dots()) {
            Self::Dots(DotScreen::new(marking, spot_mm, page_rad))
        } else {
            Self::Lines(LineScreen::new(marking, spot_mm, page_rad))
        }
    }

    fn pale(&self, grey: &Grey) -> Option<Diag> {
        match self {
            Self::Lines(screen) => screen.pale(grey),
            Self::Dots(screen) => screen.pale(grey),
        }
    }

    /// Appends the lines or dots of a picture; returns what is said of its tone.
    fn mark(&self, grey: &Grey, size: [f64; 2], out: &mut Lines) -> Result<Option<Diag>, TooFine> {
        match self {
            Self::Lines(screen) => screen.mark(grey, size, out).map(|()| None),
            Self::Dots(screen) => screen.mark(grey, size, out),
        }
    }
}

/// The lines or dots of a picture.
fn screened(art: &Artwork, seen: &Seen<'_>, screen: &Raster) -> Result<Made, Fault> {
    let mut made =
        Made { name: seen.shape.name, pen: seen.pen, lines: Lines::default(), waits: Vec::new(), thin: 0, note: None };
    if let Figure::Grey(k) = seen.shape.figure {
        made.note = screen.mark(&art.greys[k as usize], art.size, &mut made.lines).map_err(|TooFine| Fault::Screen)?;
    }
    Ok(made)
}

/// A contour that ends where it starts.
fn ring(contour: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let mut ring = contour.to_vec();
    if contour.first() != contour.last() {
        ring.extend(contour.first());
    }
    ring
}

/// The lines that fill what is seen of areas that are one.
fn filled(
    seen: &[Seen<'_>],
    group: &[usize],
    covered: &[Vec<usize>],
    areas: &[Area],
    hatch: &Hatch,
) -> Result<Made, Fault> {
    let first = &seen[group[0]];
    let mut parts = Vec::new();
    for &i in group {
        let area = match covered[i].as_slice() {
            [] => areas[i].clone(),
            above => areas[i].without(&Area::union(above.iter().map(|&j| &areas[j]))?)?,
        };
        parts.push(area);
    }
    let area = if let [one] = parts.as_slice() { one.clone() } else { Area::union(parts.iter())? };
    let mut made = Made {
        name: first.shape.name,
        pen: first.pen,
        lines: Lines::default(),
        waits: Vec::new(),
        thin: 0,
        note: None,
    };
    if first.how == How::Rings {
        hatch.rings(&area, &mut made.lines)?;
        made.thin = usize::from(made.lines.len() == 0 && !area.is_empty());
        return Ok(made);
    }
    for polygon in area.polygons() {
        if hatch.waits {
            match hatch.prepare(polygon, &mut made.lines)? {
                true => made.waits.push(polygon.clone()),
                false => made.thin += 1,
            }
            continue;
        }
        let before = made.lines.len();
        hatch.fill(polygon, &mut made.lines)?;
        made.thin += usize::from(made.lines.len() == before);
    }
    Ok(made)
}
