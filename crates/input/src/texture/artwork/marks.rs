//! From a drawing to the lines that are marked: what is seen of each shape, filled or outlined, with its pen.
//!
//! A shape is seen where no later shape lies over it. Areas of one pen that touch or overlap are one area, so that no
//! place is hatched twice. Areas in a colour of the page hide, and are not marked.

use std::borrow::Cow;

use rstar::primitives::{GeomWithData, Rectangle};
use rstar::{AABB, RTree};

use super::area::{Polygon, PolygonArea};
use super::choice::{Class, classes};
use super::coverage::covered_share;
use super::crossings::TooMany;
use super::cut::Keep;
use super::dot_screen::DotScreen;
use super::hatch::{Hatch, LevelHatch, TooFine};
use super::light::{self, HIDES};
use super::screen::LineScreen;
use super::{Artwork, ContourPass, FillMode, Grey, Marking, PaintedShape, ShapeFigure, StrokeMode, WindingRule};
use crate::texture::clip::{Polylines, clip, clip_contour, is_hairline, is_inside};
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
    pub(in crate::texture) lines: Polylines,
    /// Per line, the index of its element's name.
    pub(in crate::texture) name_of: Vec<u32>,
    /// Per line, its pen; None for the pen of the texture.
    pub(in crate::texture) pen_of: Vec<Option<PenId>>,
    /// Names of elements.
    pub(in crate::texture) names: Vec<String>,
    /// The areas whose lines follow the level lines of the part.
    pub(in crate::texture) unfilled: Vec<UnfilledAreas>,
    /// How these are filled.
    pub(in crate::texture) level_hatch: LevelHatch,
    /// How many of the lines are marked before the areas are filled.
    pub(in crate::texture) before: usize,
}

/// Areas of one element and pen that are filled once the directions of level lines are known.
#[derive(Debug)]
pub(in crate::texture) struct UnfilledAreas {
    /// Index of the element's name.
    pub(in crate::texture) name: u32,
    /// None for the pen of the texture.
    pub(in crate::texture) pen: Option<PenId>,
    /// In page mm.
    pub(in crate::texture) polygons: Vec<Polygon>,
}

/// How a shape is marked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Treatment {
    /// A line along itself.
    Line,
    /// An area by parallel lines.
    Hatch,
    /// An area by rings along its contours.
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

/// A shape, how it is marked and by which pen.
struct TreatedShape<'a> {
    shape: &'a PaintedShape,
    treatment: Treatment,
    pen: Option<PenId>,
    /// The box of the polylines.
    bounds: BoxMm<2>,
}

/// The marks of shapes that are marked together: one pen, and the name of the first of them.
struct GroupMarks {
    name: u32,
    pen: Option<PenId>,
    lines: Polylines,
    /// Polygons that are filled once directions are known; the lines above are then their contours.
    unfilled: Vec<Polygon>,
    /// How many polygons no line fits into.
    thin: usize,
    /// A message about how they reproduce a picture.
    note: Option<Diag>,
}

impl GroupMarks {
    /// No marks yet, with the name and the pen of `first`.
    fn new(first: &TreatedShape<'_>) -> Self {
        let TreatedShape { shape, pen, .. } = first;
        Self { name: shape.name, pen: *pen, lines: Polylines::default(), unfilled: Vec::new(), thin: 0, note: None }
    }
}

/// The shapes of a drawing, and what decides which parts of them are seen.
struct Visibility<'a> {
    shapes: Vec<TreatedShape<'a>>,
    /// Per shape, the areas that may hide some of it, in the order of painting.
    covers: Vec<Vec<usize>>,
    /// Per shape, its area where it is filled or may hide others; empty for the rest.
    areas: Vec<PolygonArea>,
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
    let shapes = parallel::map(art.shapes.len(), |i| TreatedShape::new(art, i, classes[i], marking));
    let index = AreaIndex::new(&shapes);
    let covers = covers(art, &index, &shapes)?;
    let groups = groups(index, &shapes);
    let areas = areas(art, &shapes, &covers)?;
    let visibility = Visibility { shapes, covers, areas };
    let groups = parallel::map(groups.len(), |g| group_marks(art, &visibility, &groups[g], &hatch, &screen));
    let groups = groups.into_iter().collect::<Result<Vec<_>, _>>()?;
    let (page, thin) = joined(art, groups, marking.contour, hatch.level_hatch(), notes);
    // The areas of filled shapes and of those that may hide others are known; the rest are made for warnings alone.
    let own_area = |i: usize| match visibility.areas[i].is_empty() {
        false => Some(visibility.areas[i].clone()),
        true => area(art, &art.shapes[i]).ok().filter(|a| !a.is_empty()),
    };
    notes.extend(light::warnings(art, marking, &classes, own_area));
    notes.extend(art.greys.iter().filter_map(|grey| screen.pale(grey)));
    notes.extend(thin.map(|thin| thin.warning(art)));
    notes.extend(tone_lost(art, marking, &page, spot_mm));
    Ok(page)
}

/// The marks of the shapes of a group, by the treatment that its shapes share.
fn group_marks(
    art: &Artwork,
    visibility: &Visibility<'_>,
    members: &[usize],
    hatch: &Hatch,
    screen: &Raster,
) -> Result<GroupMarks, Box<Diag>> {
    let first = &visibility.shapes[members[0]];
    let marks = match first.treatment {
        Treatment::Line | Treatment::Outline => visible_lines(art, visibility, members[0]).map_err(MarkFault::from),
        Treatment::Screen => screened(art, first, screen),
        _ => filled(visibility, members, hatch),
    };
    marks.map_err(|fault| fault.diag(&art.names[first.shape.name as usize]))
}

/// The polygons that no line of a hatch fits into.
struct ThinPolygons {
    count: usize,
    /// Index of the name of the first element that has some.
    first_name: u32,
}

impl ThinPolygons {
    fn warning(&self, art: &Artwork) -> Diag {
        let text = format!(
            "areas thinner than twice the inset of the hatch hold no line and are not marked ({}, first {})",
            self.count, art.names[self.first_name as usize]
        );
        let hint = match art.dark_share {
            Some(_) => DIFFUSION_HINT,
            None => "lower inset, draw them wider, or ignore this",
        };
        Diag::warning("texture-thin", text).hint(hint)
    }
}

/// Puts the marks of all groups on one page, in the order in which they are marked; notes about them go to `notes`.
fn joined(
    art: &Artwork,
    mut groups: Vec<GroupMarks>,
    contour: ContourPass,
    level_hatch: LevelHatch,
    notes: &mut Vec<Diag>,
) -> (Page, Option<ThinPolygons>) {
    if contour == ContourPass::After {
        // Lines along level lines are marked after the first `before` lines of the page, and the contours of their
        // areas after them. So the groups with such areas come last. The sort is stable: all else keeps its order of
        // painting.
        groups.sort_by_key(|group| !group.unfilled.is_empty());
    }
    let mut page = Page {
        size: art.size,
        corner: art.corner,
        lines: Polylines::default(),
        name_of: Vec::new(),
        pen_of: Vec::new(),
        names: art.names.clone(),
        unfilled: Vec::new(),
        level_hatch,
        before: 0,
    };
    let mut thin: Option<ThinPolygons> = None;
    for GroupMarks { name, pen, lines, unfilled, thin: count, note } in groups {
        notes.extend(note);
        lines.iter().for_each(|line| page.lines.push(line));
        page.name_of.resize(page.lines.len(), name);
        page.pen_of.resize(page.lines.len(), pen);
        if unfilled.is_empty() || contour != ContourPass::After {
            page.before = page.lines.len();
        }
        if !unfilled.is_empty() {
            page.unfilled.push(UnfilledAreas { name, pen, polygons: unfilled });
        }
        if count > 0 {
            thin.get_or_insert(ThinPolygons { count: 0, first_name: name }).count += count;
        }
    }
    (page, thin)
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
        && page.unfilled.is_empty();
    let dark = art.dark_share.filter(|_| is_filled && spot_mm > 0.0)?;
    let covered = covered_share(&page.lines, art.size, spot_mm);
    ((covered - dark).abs() > MAX_TONE_LOST * dark).then(|| {
        let text = format!("the marks cover {covered:.3} of the page, where the picture has a coverage of {dark:.3}");
        Diag::warning("bitmap-coverage", text).hint(DIFFUSION_HINT)
    })
}

/// Why a shape cannot be marked.
enum MarkFault {
    Crossings,
    Fine,
    Screen,
}

impl From<TooMany> for MarkFault {
    fn from(_: TooMany) -> Self {
        Self::Crossings
    }
}

impl From<TooFine> for MarkFault {
    fn from(_: TooFine) -> Self {
        Self::Fine
    }
}

impl MarkFault {
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

impl<'a> TreatedShape<'a> {
    fn new(art: &'a Artwork, i: usize, class: Class, marking: &Marking) -> Self {
        let shape = &art.shapes[i];
        let (mut treatment, pen) = match class {
            Class::Skip => (Treatment::Skip, None),
            // Lines and pictures have no area that could hide something.
            Class::Page if matches!(shape.figure, ShapeFigure::Lines | ShapeFigure::Grey(_)) => (Treatment::Skip, None),
            // What lies below shows through it.
            Class::Page if shape.opacity < HIDES => (Treatment::Skip, None),
            Class::Page => (Treatment::Hide, None),
            Class::Pen(pen) => (treatment(&shape.figure, marking), pen),
        };
        // The line of a stroke that follows the fill of its element stands for the contour of that fill.
        let is_own_line = |next: &PaintedShape| next.name == shape.name && !matches!(next.figure, ShapeFigure::Fill(_));
        if treatment == Treatment::Outline
            && matches!(shape.figure, ShapeFigure::Fill(_))
            && art.shapes.get(i + 1).is_some_and(is_own_line)
        {
            treatment = Treatment::Hide;
        }
        let points = shape.lines.clone().flat_map(|k| art.lines.get(k)).copied();
        let bounds = if treatment == Treatment::Skip { BoxMm::EMPTY } else { BoxMm::of(points) };
        Self { shape, treatment, pen, bounds }
    }

    /// Whether lines of it are marked, if any of it is seen.
    fn is_marked(&self) -> bool {
        !matches!(self.treatment, Treatment::Skip | Treatment::Hide)
    }

    /// Whether it hides what lies below.
    fn is_area(&self) -> bool {
        self.treatment != Treatment::Skip && self.shape.figure != ShapeFigure::Lines
    }

    fn is_filled(&self) -> bool {
        matches!(self.treatment, Treatment::Hatch | Treatment::Rings)
    }

    /// What areas that touch must share to be filled as one; None where it is not filled.
    fn fill_kind(&self) -> Option<FillKind> {
        self.is_filled().then_some((self.treatment, self.pen))
    }
}

fn treatment(figure: &ShapeFigure, marking: &Marking) -> Treatment {
    match (figure, marking.fill, marking.stroke) {
        (ShapeFigure::Lines, ..) => Treatment::Line,
        (ShapeFigure::Grey(_), ..) => Treatment::Screen,
        (ShapeFigure::Stroke, _, StrokeMode::Outline) | (ShapeFigure::Fill(_), FillMode::Outline, _) => {
            Treatment::Outline
        }
        (_, FillMode::Rings, _) => Treatment::Rings,
        (ShapeFigure::Fill(_), FillMode::None, _) => Treatment::Hide,
        _ => Treatment::Hatch,
    }
}

/// The box of an area, with the index of its shape.
type AreaBox = GeomWithData<Rectangle<[f64; 2]>, usize>;

/// How a filled area is marked, and by which pen.
type FillKind = (Treatment, Option<PenId>);

/// The areas by their boxes, one tree for each kind of fill and one for all that are not filled. Areas of one kind do
/// not cut each other, so those of a drawing of one pen are never compared in pairs.
struct AreaIndex(Vec<(Option<FillKind>, RTree<AreaBox>)>);

impl AreaIndex {
    fn new(shapes: &[TreatedShape<'_>]) -> Self {
        let mut boxes: Vec<(Option<FillKind>, Vec<AreaBox>)> = Vec::new();
        for (i, shape) in shapes.iter().enumerate().filter(|(_, shape)| shape.is_area()) {
            let BoxMm { lo, hi } = shape.bounds;
            let area_box = AreaBox::new(Rectangle::from_corners(lo, hi), i);
            match boxes.iter_mut().find(|(kind, _)| *kind == shape.fill_kind()) {
                Some((_, others)) => others.push(area_box),
                None => boxes.push((shape.fill_kind(), vec![area_box])),
            }
        }
        Self(boxes.into_iter().map(|(kind, boxes)| (kind, RTree::bulk_load(boxes))).collect())
    }

    /// The areas that are not filled as one with `shape` and whose boxes meet its own.
    fn others(&self, shape: &TreatedShape<'_>) -> impl Iterator<Item = usize> {
        let kind = shape.fill_kind();
        let envelope = envelope(shape);
        let trees = self.0.iter().filter(move |(other, _)| other.is_none() || *other != kind);
        trees.flat_map(move |(_, tree)| tree.locate_in_envelope_intersecting(&envelope)).map(|e| e.data)
    }

    /// Takes out the areas of the fill of `shape` whose boxes meet its own.
    fn take(&mut self, shape: &TreatedShape<'_>) -> Vec<usize> {
        let kind = shape.fill_kind();
        let tree = self.0.iter_mut().find(|(other, _)| kind.is_some() && *other == kind);
        tree.map_or(Vec::new(), |(_, t)| t.drain_in_envelope_intersecting(envelope(shape)).map(|e| e.data).collect())
    }
}

fn envelope(shape: &TreatedShape<'_>) -> AABB<[f64; 2]> {
    AABB::from_corners(shape.bounds.lo, shape.bounds.hi)
}

/// For each shape the areas that may hide some of it, in the order of painting.
fn covers(art: &Artwork, index: &AreaIndex, shapes: &[TreatedShape<'_>]) -> Result<Vec<Vec<usize>>, Box<Diag>> {
    let mut work = 0;
    (0..shapes.len()).map(|i| covers_of(art, index, shapes, i, &mut work)).collect()
}

/// The areas painted after shape `i` whose boxes meet its own; their edges are added to `work`.
fn covers_of(
    art: &Artwork,
    index: &AreaIndex,
    shapes: &[TreatedShape<'_>],
    i: usize,
    work: &mut usize,
) -> Result<Vec<usize>, Box<Diag>> {
    let mut covers = Vec::new();
    if !shapes[i].is_marked() {
        return Ok(covers);
    }
    for j in index.others(&shapes[i]) {
        *work += 1;
        if j > i {
            covers.push(j);
            *work += shapes[j].shape.lines.clone().map(|k| art.lines.get(k).len()).sum::<usize>();
        }
        if *work > MAX_COVERED {
            let text = "too many shapes of the drawing lie over others";
            return Err(Box::new(
                Diag::limit("texture-overlap", text)
                    .hint("remove what is hidden in the drawing program (Path, Difference), or split the drawing"),
            ));
        }
    }
    covers.sort_unstable();
    Ok(covers)
}

/// The areas of the shapes that are filled or may hide others; empty for the rest.
fn areas(art: &Artwork, shapes: &[TreatedShape<'_>], covers: &[Vec<usize>]) -> Result<Vec<PolygonArea>, Box<Diag>> {
    let mut is_needed: Vec<bool> = shapes.iter().map(TreatedShape::is_filled).collect();
    covers.iter().flatten().for_each(|&j| is_needed[j] = true);
    let area_if_needed = |i: usize| {
        let shape = shapes[i].shape;
        let area = if is_needed[i] { area(art, shape) } else { Ok(PolygonArea::default()) };
        area.map_err(|TooMany| MarkFault::Crossings.diag(&art.names[shape.name as usize]))
    };
    parallel::map(shapes.len(), area_if_needed).into_iter().collect()
}

/// The area of a shape on the page, cut at its clip; empty for lines.
fn area(art: &Artwork, shape: &PaintedShape) -> Result<PolygonArea, TooMany> {
    let rule = match shape.figure {
        ShapeFigure::Fill(rule) => rule,
        ShapeFigure::Stroke => WindingRule::NonZero,
        ShapeFigure::Lines | ShapeFigure::Grey(_) => return Ok(PolygonArea::default()),
    };
    let page = BoxMm { lo: [0.0; 2], hi: art.size };
    let on_page = |c| if is_inside(c, page) { Cow::Borrowed(c) } else { Cow::Owned(clip_contour(c, page)) };
    let contours: Vec<Cow<'_, [[f64; 2]]>> = shape.lines.clone().map(|k| on_page(art.lines.get(k))).collect();
    let area = PolygonArea::new(contours.iter().map(|c| &**c), rule)?;
    shape.clip.map_or(Ok(area.clone()), |clip| area.within(&art.clips[clip as usize]))
}

/// Shapes that are marked together, in the order of painting of their first: areas that are one, and single lines.
fn groups(mut index: AreaIndex, shapes: &[TreatedShape<'_>]) -> Vec<Vec<usize>> {
    let mut out = Vec::new();
    let mut is_taken = vec![false; shapes.len()];
    for (i, shape) in shapes.iter().enumerate() {
        if !shape.is_marked() || is_taken[i] {
            continue;
        }
        let mut group = vec![i];
        let mut expanded = 0;
        is_taken[i] = true;
        // The neighbours of the first `expanded` members are in the group. Every area leaves the index once, so all
        // groups together take one search per area.
        while let Some(&next) = group.get(expanded) {
            for j in index.take(&shapes[next]) {
                if !std::mem::replace(&mut is_taken[j], true) {
                    group.push(j);
                }
            }
            expanded += 1;
        }
        group.sort_unstable();
        out.push(group);
    }
    out
}

/// What is seen of the lines of shape `i`, or of the contours of its area where that is outlined: the part on the page,
/// in its clip, and outside of the areas above it, cut in this order.
fn visible_lines(art: &Artwork, visibility: &Visibility<'_>, i: usize) -> Result<GroupMarks, TooMany> {
    let TreatedShape { shape, treatment, .. } = &visibility.shapes[i];
    let clip_area = shape.clip.map(|clip| art.clips[clip as usize].cutter());
    let hidden = match visibility.covers[i].as_slice() {
        [] => None,
        above => Some(PolygonArea::union(above.iter().map(|&j| &visibility.areas[j]))?.cutter()),
    };
    let mut marks = GroupMarks::new(&visibility.shapes[i]);
    let page = BoxMm { lo: [0.0; 2], hi: art.size };
    let mut on_page = Polylines::default();
    let mut clipped = Polylines::default();
    for k in shape.lines.clone() {
        let line = art.lines.get(k);
        let line = match treatment {
            Treatment::Outline => Cow::Owned(ring(line)),
            _ => Cow::Borrowed(line),
        };
        if *treatment == Treatment::Outline && is_hairline(&line, NM) {
            // It encloses nothing, so nothing of it is seen.
            continue;
        }
        on_page.clear();
        clip(&line, page, &mut on_page);
        clipped.clear();
        let not_covered = match &clip_area {
            Some(cutter) => {
                on_page.iter().for_each(|piece| cutter.cut(piece, Keep::Inside, &mut clipped));
                &clipped
            }
            None => &on_page,
        };
        for piece in not_covered.iter() {
            match &hidden {
                Some(hidden) => hidden.cut(piece, Keep::Outside, &mut marks.lines),
                None => marks.lines.push(piece),
            }
        }
    }
    Ok(marks)
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

    /// A warning where the picture has tones that its marks cannot reach.
    fn pale(&self, grey: &Grey) -> Option<Diag> {
        match self {
            Self::Lines(screen) => screen.pale(grey),
            Self::Dots(screen) => screen.pale(grey),
        }
    }

    /// Appends the lines or dots of a picture; returns what is said of its tone.
    fn mark(&self, grey: &Grey, size: [f64; 2], out: &mut Polylines) -> Result<Option<Diag>, TooFine> {
        match self {
            Self::Lines(screen) => screen.mark(grey, size, out).map(|()| None),
            Self::Dots(screen) => screen.mark(grey, size, out),
        }
    }
}

/// The lines or dots of a picture.
fn screened(art: &Artwork, picture: &TreatedShape<'_>, screen: &Raster) -> Result<GroupMarks, MarkFault> {
    let mut marks = GroupMarks::new(picture);
    if let ShapeFigure::Grey(k) = picture.shape.figure {
        let grey = &art.greys[k as usize];
        marks.note = screen.mark(grey, art.size, &mut marks.lines).map_err(|TooFine| MarkFault::Screen)?;
    }
    Ok(marks)
}

/// A contour that ends where it starts.
fn ring(contour: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let mut ring = contour.to_vec();
    if contour.first() != contour.last() {
        ring.extend(contour.first());
    }
    ring
}

/// The lines that fill what is seen of the areas of a group.
fn filled(visibility: &Visibility<'_>, group: &[usize], hatch: &Hatch) -> Result<GroupMarks, MarkFault> {
    let first = &visibility.shapes[group[0]];
    let area = visible_area(visibility, group)?;
    let mut marks = GroupMarks::new(first);
    if first.treatment == Treatment::Rings {
        hatch.rings(&area, &mut marks.lines)?;
        marks.thin = usize::from(marks.lines.len() == 0 && !area.is_empty());
        return Ok(marks);
    }
    for polygon in area.polygons() {
        if hatch.follows_level_lines {
            match hatch.prepare(polygon, &mut marks.lines)? {
                true => marks.unfilled.push(polygon.clone()),
                false => marks.thin += 1,
            }
            continue;
        }
        let before = marks.lines.len();
        hatch.fill(polygon, &mut marks.lines)?;
        marks.thin += usize::from(marks.lines.len() == before);
    }
    Ok(marks)
}

/// The union of what the areas above leave of the areas of a group.
fn visible_area(visibility: &Visibility<'_>, group: &[usize]) -> Result<PolygonArea, TooMany> {
    let Visibility { covers, areas, .. } = visibility;
    let mut parts = Vec::new();
    for &i in group {
        let area = match covers[i].as_slice() {
            [] => areas[i].clone(),
            above => areas[i].without(&PolygonArea::union(above.iter().map(|&j| &areas[j]))?)?,
        };
        parts.push(area);
    }
    if let [single] = parts.as_slice() { Ok(single.clone()) } else { PolygonArea::union(parts.iter()) }
}
