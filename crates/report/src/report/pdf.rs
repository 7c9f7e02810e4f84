//! A drawing as a page to print: one page of PDF, drawn from the tree that usvg makes of it.
//!
//! Text is outlines, so no printer needs a face, and the drawing stays lines where the SVG has lines. A drawing of ours
//! has paths, images, groups with opacity and text; gradients, masks, clip paths and filters it has none of.

use pdf_writer::{Content, Filter, Finish, Name, Pdf, Rect, Ref};
use resvg::tiny_skia::{PathSegment, Transform};
use resvg::usvg::{FillRule, Group, Image, ImageKind, LineCap, LineJoin, Node, Paint, PaintOrder, Path};

use super::raster::tree;
use terrace_core::diag::{Diag, Error};

/// Points of a millimetre.
const POINT: f32 = 72.0 / 25.4;
/// Rim of the page, mm.
const RIM: f32 = 8.0;
/// Sizes of pages, mm: A4 and A3, the shorter side first. The larger one is for a sheet that shows more than this, mm.
const PAGES: [[f32; 2]; 2] = [[210.0, 297.0], [297.0, 420.0]];
const LARGE: f32 = 600.0;
/// Numbers of blocks are printed down to this height, mm.
const NUMBER: f32 = 1.2;

/// The drawing as a PDF file: A4, or A3 where the sheet shows more than 600 mm, upright or across as it fills the page
/// better.
///
/// # Errors
/// Those of [`super::png`].
pub fn pdf(svg: &str) -> Result<Vec<u8>, Error> {
    let size = tree(svg, 0)?.size();
    let [short, long] = PAGES[usize::from(size.width().max(size.height()) > LARGE)];
    let page = if size.width() > size.height() { [long, short] } else { [short, long] };
    let room = page.map(|v| v - 2.0 * RIM);
    let scale = (room[0] / size.width()).min(room[1] / size.height());
    // 7 px of a number are NUMBER on the page.
    let tree = tree(svg, (scale * size.width() / NUMBER * 7.0) as u32)?;
    let mut writer = Writer { pdf: Pdf::new(), next: 1, names: Vec::new() };
    let [catalogue, pages, sheet, contents] = [(); 4].map(|()| writer.name());
    let mut content = Content::new();
    // From px of the drawing, y down, to points of the page, y up.
    let k = scale * POINT;
    let left = (page[0] - scale * size.width()) / 2.0 * POINT;
    let top = (page[1] + scale * size.height()) / 2.0 * POINT;
    content.transform([k, 0.0, 0.0, -k, left, top]);
    writer.group(&mut content, tree.root())?;
    let body = compressed(&content.finish());
    let [width, height] = page.map(|v| v * POINT);
    writer.pdf.catalog(catalogue).pages(pages);
    writer.pdf.pages(pages).kids([sheet]).count(1);
    writer.pdf.stream(contents, &body).filter(Filter::FlateDecode);
    let mut out = writer.pdf.page(sheet);
    out.parent(pages).media_box(Rect::new(0.0, 0.0, width, height)).contents(contents);
    resources(&writer.names, out.resources());
    out.finish();
    Ok(writer.pdf.finish())
}

fn compressed(bytes: &[u8]) -> Vec<u8> {
    use std::io::Write;
    let mut encoder = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::new(6));
    encoder.write_all(bytes).and_then(|()| encoder.finish()).expect("memory takes it")
}

/// What a page or a group names.
#[derive(Clone, Copy)]
enum Resource {
    /// A graphics state.
    State(Ref),
    /// An image, or a group drawn on its own.
    Object(Ref),
}

/// Every object is named by its number; the page and each group name all there are so far.
fn resources(names: &[Resource], mut resources: pdf_writer::writers::Resources<'_>) {
    let mut states = resources.ext_g_states();
    for resource in names {
        if let Resource::State(id) = resource {
            states.pair(Name(name(*id).as_bytes()), id);
        }
    }
    states.finish();
    let mut objects = resources.x_objects();
    for resource in names {
        if let Resource::Object(id) = resource {
            objects.pair(Name(name(*id).as_bytes()), id);
        }
    }
}

fn name(id: Ref) -> String {
    format!("n{}", id.get())
}

/// A file while it is written.
struct Writer {
    pdf: Pdf,
    next: i32,
    names: Vec<Resource>,
}

impl Writer {
    fn name(&mut self) -> Ref {
        self.next += 1;
        Ref::new(self.next - 1)
    }

    /// Sets the opacity of what follows.
    fn opacity(&mut self, content: &mut Content, opacity: f32) {
        if opacity < 1.0 {
            let id = self.name();
            self.pdf.ext_graphics(id).stroking_alpha(opacity).non_stroking_alpha(opacity);
            self.names.push(Resource::State(id));
            content.set_parameters(Name(name(id).as_bytes()));
        }
    }

    fn group(&mut self, content: &mut Content, group: &Group) -> Result<(), Error> {
        let is_plain = group.clip_path().is_none() && group.mask().is_none() && group.filters().is_empty();
        if !is_plain {
            return Err(Diag::bug("picture", "a drawing has a clip path, a mask or a filter").into());
        }
        content.save_state();
        transform(content, group.transform());
        if group.opacity().get() < 1.0 {
            // Drawn on its own, so that what overlaps in it does not show through itself.
            let mut inner = Content::new();
            self.children(&mut inner, group)?;
            let (id, body) = (self.name(), compressed(&inner.finish()));
            let b = group.layer_bounding_box();
            let mut object = self.pdf.form_xobject(id, &body);
            object.filter(Filter::FlateDecode);
            let [x0, y0, x1, y1] = [b.left(), b.top(), b.right(), b.bottom()];
            object.bbox(Rect::new(x0, y0, x1, y1));
            object.group().transparency().isolated(true).color_space().device_rgb();
            resources(&self.names, object.resources());
            object.finish();
            self.opacity(content, group.opacity().get());
            self.names.push(Resource::Object(id));
            content.x_object(Name(name(id).as_bytes()));
        } else {
            self.children(content, group)?;
        }
        content.restore_state();
        Ok(())
    }

    fn children(&mut self, content: &mut Content, group: &Group) -> Result<(), Error> {
        group.children().iter().try_for_each(|node| match node {
            Node::Group(group) => self.group(content, group),
            Node::Path(path) => self.path(content, path),
            Node::Image(image) => self.image(content, image),
            Node::Text(text) => self.group(content, text.flattened()),
        })
    }

    fn path(&mut self, content: &mut Content, path: &Path) -> Result<(), Error> {
        if !path.is_visible() {
            return Ok(());
        }
        match path.paint_order() {
            PaintOrder::FillAndStroke => {
                self.fill(content, path)?;
                self.stroke(content, path)
            }
            PaintOrder::StrokeAndFill => {
                self.stroke(content, path)?;
                self.fill(content, path)
            }
        }
    }

    fn fill(&mut self, content: &mut Content, path: &Path) -> Result<(), Error> {
        let Some(fill) = path.fill() else { return Ok(()) };
        content.save_state();
        let [r, g, b] = colour(fill.paint())?;
        content.set_fill_rgb(r, g, b);
        self.opacity(content, fill.opacity().get());
        trace(content, path);
        match fill.rule() {
            FillRule::NonZero => content.fill_nonzero(),
            FillRule::EvenOdd => content.fill_even_odd(),
        };
        content.restore_state();
        Ok(())
    }

    fn stroke(&mut self, content: &mut Content, path: &Path) -> Result<(), Error> {
        let Some(stroke) = path.stroke() else { return Ok(()) };
        content.save_state();
        let [r, g, b] = colour(stroke.paint())?;
        content.set_stroke_rgb(r, g, b);
        content.set_line_width(stroke.width().get());
        content.set_line_cap(match stroke.linecap() {
            LineCap::Butt => pdf_writer::types::LineCapStyle::ButtCap,
            LineCap::Round => pdf_writer::types::LineCapStyle::RoundCap,
            LineCap::Square => pdf_writer::types::LineCapStyle::ProjectingSquareCap,
        });
        content.set_line_join(match stroke.linejoin() {
            LineJoin::Miter | LineJoin::MiterClip => pdf_writer::types::LineJoinStyle::MiterJoin,
            LineJoin::Round => pdf_writer::types::LineJoinStyle::RoundJoin,
            LineJoin::Bevel => pdf_writer::types::LineJoinStyle::BevelJoin,
        });
        if let Some(dash) = stroke.dasharray() {
            content.set_dash_pattern(dash.iter().copied(), stroke.dashoffset());
        }
        self.opacity(content, stroke.opacity().get());
        trace(content, path);
        content.stroke();
        content.restore_state();
        Ok(())
    }

    /// An image with its opacity as a mask.
    fn image(&mut self, content: &mut Content, image: &Image) -> Result<(), Error> {
        let ImageKind::PNG(bytes) = image.kind() else {
            return Err(Diag::bug("picture", "a drawing has an image that is no PNG").into());
        };
        let ([width, height], colours, opacity) = pixels(bytes);
        let (id, mask) = (self.name(), self.name());
        let colours = compressed(&colours);
        let mut object = self.pdf.image_xobject(id, &colours);
        object.width(width).height(height).bits_per_component(8).s_mask(mask);
        object.filter(Filter::FlateDecode);
        object.color_space().device_rgb();
        object.finish();
        let opacity = compressed(&opacity);
        let mut object = self.pdf.image_xobject(mask, &opacity);
        object.width(width).height(height).bits_per_component(8);
        object.filter(Filter::FlateDecode);
        object.color_space().device_gray();
        object.finish();
        self.names.push(Resource::Object(id));
        content.save_state();
        // An image fills the unit square, its first row at the top.
        let (w, h) = (image.size().width(), image.size().height());
        content.transform([w, 0.0, 0.0, -h, 0.0, h]);
        content.x_object(Name(name(id).as_bytes()));
        content.restore_state();
        Ok(())
    }
}

/// Size, colours and opacity of a PNG file of ours.
fn pixels(bytes: &[u8]) -> ([i32; 2], Vec<u8>, Vec<u8>) {
    let mut decoder = png::Decoder::new(std::io::Cursor::new(bytes));
    decoder.set_transformations(png::Transformations::EXPAND | png::Transformations::ALPHA);
    let mut reader = decoder.read_info().expect("a PNG of ours");
    let mut data = vec![0; reader.output_buffer_size().expect("a PNG of ours is small")];
    let info = reader.next_frame(&mut data).expect("a PNG of ours");
    let samples = info.color_type.samples();
    let mut colours = Vec::new();
    let mut opacity = Vec::new();
    for pixel in data[..info.buffer_size()].chunks_exact(samples) {
        let colour = if samples == 2 { [pixel[0]; 3] } else { [pixel[0], pixel[1], pixel[2]] };
        colours.extend(colour);
        opacity.push(pixel[samples - 1]);
    }
    ([info.width as i32, info.height as i32], colours, opacity)
}

fn colour(paint: &Paint) -> Result<[f32; 3], Error> {
    match paint {
        Paint::Color(c) => Ok([c.red, c.green, c.blue].map(|v| f32::from(v) / 255.0)),
        _ => Err(Diag::bug("picture", "a drawing has a gradient or a pattern").into()),
    }
}

fn transform(content: &mut Content, t: Transform) {
    if !t.is_identity() {
        content.transform([t.sx, t.ky, t.kx, t.sy, t.tx, t.ty]);
    }
}

fn trace(content: &mut Content, path: &Path) {
    let mut last = [0.0; 2];
    for segment in path.data().segments() {
        match segment {
            PathSegment::MoveTo(p) => {
                content.move_to(p.x, p.y);
                last = [p.x, p.y];
            }
            PathSegment::LineTo(p) => {
                content.line_to(p.x, p.y);
                last = [p.x, p.y];
            }
            PathSegment::QuadTo(c, p) => {
                // The same curve as a cubic.
                let [a, b] = [last, [p.x, p.y]].map(|[x, y]| [x + (c.x - x) * 2.0 / 3.0, y + (c.y - y) * 2.0 / 3.0]);
                content.cubic_to(a[0], a[1], b[0], b[1], p.x, p.y);
                last = [p.x, p.y];
            }
            PathSegment::CubicTo(a, b, p) => {
                content.cubic_to(a.x, a.y, b.x, b.y, p.x, p.y);
                last = [p.x, p.y];
            }
            PathSegment::Close => {
                content.close_path();
            }
        }
    }
}
