//! The page of a drawing: its physical size and the map from user units to page mm.

use roxmltree::Node;
use svg_style::{Length, Map, Style, aspect, view_box, view_map};
use svgtypes::ViewBox;

use crate::texture::page::WantedSize;
use terrace_core::diag::Diag;
use terrace_core::geom::{MAX_NM, NM_PER_MM};

/// CSS pixels in a millimetre.
const PX_PER_MM: f64 = 96.0 / 25.4;

/// Size and map of the page.
pub(super) struct PageFrame {
    /// mm.
    pub(super) size: [f64; 2],
    /// From user units (y down) to page mm (y up, origin in the lower left corner).
    pub(super) map: Map,
    /// The user units that percentages refer to.
    pub(super) port: [f64; 2],
    /// Length of a CSS pixel on the page, mm.
    pub(super) pixel_mm: f64,
    /// Whether the wanted size changes the proportions.
    pub(super) is_stretched: bool,
}

impl PageFrame {
    /// The page of a root element; a wanted size wins over the file's own.
    pub(super) fn new(root: Node<'_, '_>, style: &Style, wanted: WantedSize) -> Result<Self, Box<Diag>> {
        let view = view_box(root).map_err(|e| {
            Diag::input("svg-viewbox", format!("the drawing's {e}"))
                .hint("give the viewBox a positive width and height")
        })?;
        let sides = [side(root, "width", style.width, style)?, side(root, "height", style.height, style)?];
        let viewport = viewport(sides, view).ok_or_else(|| Box::new(no_size()))?;
        let is_physical =
            sides.iter().all(|s| s.is_none_or(|(_, physical)| physical)) && sides.iter().any(Option::is_some);
        let size = wanted.size(viewport.map(|px| px / PX_PER_MM), is_physical)?.ok_or_else(no_size)?;
        if size.iter().any(|&s| !(s > 0.0 && s.is_finite())) {
            let text = format!("a page of {} mm x {} mm is not possible", size[0], size[1]);
            return Err(Diag::input("svg-size", text).hint(SIZE_HINT).into());
        }
        if size.iter().any(|&s| s * NM_PER_MM > MAX_NM.f64()) {
            let text = format!("the drawing's page measures {} mm x {} mm, more than 4 m", size[0], size[1]);
            return Err(Diag::input("texture-far", text)
                .hint("check the units of width and height, or give the texture a size")
                .into());
        }
        let stretch = [size[0] / viewport[0], size[1] / viewport[1]];
        let page = Map::scale(stretch[0], -stretch[1], [0.0, size[1]]);
        let view_map = view.map_or(Map::shift([0.0; 2]), |v| view_map(v, viewport, aspect(root)));
        Ok(Self {
            size,
            map: page.after(view_map),
            port: view.map_or(viewport, |v| [v.w, v.h]),
            pixel_mm: (stretch[0] * stretch[1]).sqrt(),
            is_stretched: (stretch[0] / stretch[1] - 1.0).abs() > 1e-3,
        })
    }
}

const SIZE_HINT: &str = "add size = [\"100 mm\", \"100 mm\"] to the texture";

fn no_size() -> Diag {
    Diag::input("svg-size", "the drawing has no physical size: its width and height are not in mm, cm, Q, in, pt or pc")
        .hint(SIZE_HINT)
}

/// A side of the root in px, and whether it is physical; None where it is left open. Some programs write `100 mm`, with
/// a blank, and mean it.
fn side(root: Node<'_, '_>, name: &str, own: Option<Length>, style: &Style) -> Result<Option<(f64, bool)>, Box<Diag>> {
    let text = root.attribute(name).unwrap_or_default().trim();
    let fault = |what: &str| {
        Box::new(Diag::input("svg-size", format!("the drawing's {name} {text:?} is {what}")).hint("write it as 100mm"))
    };
    let length = match own {
        Some(length) => length,
        None if text.is_empty() || text == "auto" => return Ok(None),
        None => {
            let joined: String = text.split_whitespace().collect();
            let stated = Length::from_attribute(&joined, style.font_size.px, style.root_font_px);
            stated.ok_or_else(|| fault("not a length"))?
        }
    };
    if length.share != 0.0 {
        return Ok(None);
    }
    if !(length.px > 0.0 && length.px.is_finite()) {
        return Err(fault("not a positive length"));
    }
    Ok(Some((length.px, length.is_physical)))
}

/// Size of the root's viewport in px; an open side follows the other in the proportions of the viewBox.
fn viewport(sides: [Option<(f64, bool)>; 2], view: Option<ViewBox>) -> Option<[f64; 2]> {
    match (sides.map(|s| s.map(|(px, _)| px)), view) {
        ([Some(w), Some(h)], _) => Some([w, h]),
        ([Some(w), None], Some(v)) => Some([w, w * v.h / v.w]),
        ([None, Some(h)], Some(v)) => Some([h * v.w / v.h, h]),
        ([None, None], Some(v)) => Some([v.w, v.h]),
        _ => None,
    }
}
