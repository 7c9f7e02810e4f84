//! The attributes `viewBox` and `preserveAspectRatio`.

use std::str::FromStr;

use roxmltree::Node;
use svgtypes::{Align, AspectRatio, NumberListParser, ViewBox, ViewBoxError};

use super::Map;

/// The viewBox of an element, if it has one.
///
/// # Errors
/// It is not four finite numbers of which the last two are positive.
pub fn view_box(node: Node<'_, '_>) -> Result<Option<ViewBox>, ViewBoxError> {
    let Some(text) = node.attribute("viewBox") else { return Ok(None) };
    if NumberListParser::from(text).take(5).count() != 4 {
        return Err(ViewBoxError::InvalidNumber);
    }
    let view = ViewBox::from_str(text)?;
    let all_finite = [view.x, view.y, view.w, view.h].iter().all(|v| v.is_finite());
    if all_finite { Ok(Some(view)) } else { Err(ViewBoxError::InvalidNumber) }
}

/// How an element fits its viewBox into its viewport.
pub fn aspect(node: Node<'_, '_>) -> AspectRatio {
    let text = node.attribute("preserveAspectRatio").unwrap_or_default();
    // An old word that no viewer knows any more, or one too many, and all of it is as if it was not there.
    let is_known = !text.contains("defer") && text.split_whitespace().count() <= 2;
    AspectRatio::from_str(if is_known { text } else { "" }).unwrap_or(AspectRatio {
        defer: false,
        align: Align::XMidYMid,
        slice: false,
    })
}

/// From the units of a viewBox to a viewport of the given size with its origin in the corner.
pub fn view_map(view: ViewBox, size: [f64; 2], aspect: AspectRatio) -> Map {
    let mut scale = [size[0] / view.w, size[1] / view.h];
    let [x, y] = match aspect.align {
        Align::None => [0.0, 0.0],
        Align::XMinYMin => [0.0, 0.0],
        Align::XMidYMin => [0.5, 0.0],
        Align::XMaxYMin => [1.0, 0.0],
        Align::XMinYMid => [0.0, 0.5],
        Align::XMidYMid => [0.5, 0.5],
        Align::XMaxYMid => [1.0, 0.5],
        Align::XMinYMax => [0.0, 1.0],
        Align::XMidYMax => [0.5, 1.0],
        Align::XMaxYMax => [1.0, 1.0],
    };
    if aspect.align != Align::None {
        let s = if aspect.slice { scale[0].max(scale[1]) } else { scale[0].min(scale[1]) };
        scale = [s, s];
    }
    let rest = [size[0] - view.w * scale[0], size[1] - view.h * scale[1]];
    Map::scale(scale[0], scale[1], [x * rest[0] - view.x * scale[0], y * rest[1] - view.y * scale[1]])
}
