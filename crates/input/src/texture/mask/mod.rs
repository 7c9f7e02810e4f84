//! Where a texture is marked: strokes of any kind, cut at the border of a drawing's area.
//!
//! Consumes what the job says of `inside` and `outside`, areas that [`outline`] finds in drawings, and strokes on the
//! nanometre grid. Promises the pieces of every stroke on the side that is kept, in its direction and in the order of
//! the strokes, computed on request: a cut is found in f64 and rounded once. With a soft border ([`soft`]) pieces end
//! at random distances from it.
//!
//! Limits: 16 million strokes that a border cuts; strokes that it does not touch take no memory.

mod border;
mod masked;
mod outline;
mod soft;

use std::sync::Arc;

use super::artwork::{Artwork, PolygonArea};
use super::drawing::PagePlacement;
use super::page::Position;
use super::place::Site;
use super::source::Sources;
use super::{Area, Kind, Request};
pub(super) use border::Border;
pub(super) use masked::Masked;
use terrace_core::diag::{Diag, Error, Place};
use terrace_core::program::PenId;

/// Where a texture is marked, beside its area.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Masks {
    /// Inside this area alone; None for everywhere.
    pub inside: Option<Mask>,
    /// Outside this area alone.
    pub outside: Option<Mask>,
    /// Width inside the border of these areas over which marks fade, mm; 0 for a sharp border.
    pub soft_mm: f64,
    /// Another seed makes strokes end at other places in it.
    pub seed: u64,
}

/// An area from a drawing.
#[derive(Clone, Debug, PartialEq)]
pub struct Mask {
    /// The drawing: its file, size and place.
    pub drawing: Kind,
    /// The area in which it is placed.
    pub area: Area,
    /// Id, layer, class or block of the shapes that make the area, or all where it is None.
    pub name: Option<String>,
}

impl Masks {
    /// Both, each with the key that names it.
    pub fn list(&self) -> impl Iterator<Item = (&'static str, &Mask)> {
        [("inside", &self.inside), ("outside", &self.outside)].into_iter().filter_map(|(k, m)| Some((k, m.as_ref()?)))
    }

    /// The border at which the strokes of a texture at `site` are cut, in the turned part frame; None where none is.
    ///
    /// # Errors
    /// Faults of the drawings; `mask-…`, `texture-crossings`.
    pub(super) fn border(
        &self,
        site: &Site,
        sources: &mut Sources,
        notes: &mut Vec<Diag>,
    ) -> Result<Option<Arc<Border>>, Error> {
        let mut shape = |mask: &Mask| mask.shape(site, sources, notes);
        let inside = self.inside.as_ref().map(&mut shape).transpose()?;
        let outside = self.outside.as_ref().map(&mut shape).transpose()?;
        let border = match (inside, outside) {
            (None, None) => return Ok(None),
            (Some(inside), None) => Border::inside(&inside),
            (None, Some(outside)) => Border::outside(&outside),
            (Some(inside), Some(outside)) => Border::inside(&inside.without(&outside).map_err(|_| crossings())?),
        };
        Ok(Some(Arc::new(border.softened(self.soft_mm, self.seed))))
    }
}

impl Mask {
    /// The area of the mask in the turned part frame, mm, where the texture lies at `site`.
    fn shape(&self, site: &Site, sources: &mut Sources, notes: &mut Vec<Diag>) -> Result<PolygonArea, Error> {
        let drawing = Request {
            kind: self.drawing.clone(),
            area: self.area.clone(),
            tolerance_mm: site.tolerance,
            pen: PenId(0),
            masks: Masks::default(),
        };
        let Kind::Drawing { path, position, turn_rad, .. } = &self.drawing else { unreachable!("a mask is a drawing") };
        let site = Site::new(&drawing, site.part_box, site.turn, site.spot_mm)?;
        let art = sources.artwork(&drawing, &site, notes)?;
        let here = |d: Box<Diag>| Error::from(d.at(Place::file(path.display().to_string())));
        let shape = outline::outline(&art, self.name.as_deref(), site.tolerance).map_err(here)?;
        let placed = self.placed(&art, *position, *turn_rad, &site);
        Ok(shape.mapped(|p| site.turn.turned(placed.part(p))))
    }

    /// Where the page of the mask lies on the part.
    fn placed(&self, art: &Artwork, position: Position, turn_rad: f64, site: &Site) -> PagePlacement {
        let limit = (self.area != Area::Unlimited).then_some(site.area);
        let position = position.of_page(art.corner, limit.is_some());
        PagePlacement::new(art.size, position, turn_rad, limit, site.part_box, site.turn)
    }
}

fn crossings() -> Diag {
    let text = "the areas of inside and outside cross each other too often (400000 times)";
    Diag::limit("texture-crossings", text).hint("simplify them in the drawing program")
}
