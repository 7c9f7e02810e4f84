//! What an element of a drawing has of those that hold it.

use std::sync::Arc;

use roxmltree::NodeId;
use svg_style::{Link, Map, Paint, Style};

use super::style::{Coat, painted};

/// What an element inherits.
#[derive(Clone)]
pub(super) struct ElementState {
    /// From the element's units to page mm.
    pub(super) map: Map,
    pub(super) style: Arc<Style>,
    /// The style that the element inherits from.
    pub(super) parent: Arc<Style>,
    /// Opacity of the element and all that hold it, 0 to 1.
    pub(super) opacity: f64,
    /// Size of the nearest viewport, which percentages refer to.
    pub(super) port: [f64; 2],
    /// Index of the area that it is cut at.
    pub(super) clip: Option<u32>,
    /// Index of its set of labels.
    pub(super) labels: u32,
    /// Factor of widths and dashes of strokes.
    pub(super) stretch: f64,
    pub(super) depth: usize,
    /// What the innermost use around it refers to.
    pub(super) copied: Option<NodeId>,
    /// How that use is painted: areas and lines.
    pub(super) context: Option<Arc<[Coat; 2]>>,
}

/// What of a shape is painted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum PaintedPart {
    Fill,
    Stroke,
}

impl ElementState {
    /// How areas are painted.
    pub(super) fn fill(&self) -> Coat {
        self.coat(PaintedPart::Fill)
    }

    /// How lines are painted, their width aside.
    pub(super) fn stroke(&self) -> Coat {
        self.coat(PaintedPart::Stroke)
    }

    /// The opacity of the fill or the stroke itself.
    pub(super) fn own_opacity(&self, part: PaintedPart) -> f64 {
        match part {
            PaintedPart::Fill => self.style.fill_opacity,
            PaintedPart::Stroke => self.style.stroke_opacity,
        }
    }

    fn paint(&self, part: PaintedPart) -> &Paint {
        match part {
            PaintedPart::Fill => &self.style.fill,
            PaintedPart::Stroke => &self.style.stroke,
        }
    }

    /// Whether a shape can be seen.
    pub(super) fn is_seen(&self) -> bool {
        self.fill() != Coat::None || self.stroke() != Coat::None
    }

    /// What `context-fill` and `context-stroke` mean in what a use shows: its own paint without opacities.
    pub(super) fn context(&self) -> [Coat; 2] {
        [&self.style.fill, &self.style.stroke].map(|paint| self.seen_through(paint, 1.0))
    }

    /// How the fill or the stroke is painted.
    pub(super) fn coat(&self, part: PaintedPart) -> Coat {
        let opacity = (self.opacity * self.own_opacity(part)) as f32;
        if !self.style.visible || opacity <= 0.0 { Coat::None } else { self.seen_through(self.paint(part), opacity) }
    }

    fn seen_through(&self, paint: &Paint, opacity: f32) -> Coat {
        match paint {
            Paint::None => Coat::None,
            Paint::Colour(colour) => painted(colour.resolved(self.style.current()), opacity),
            Paint::ContextFill => self.context_coat(PaintedPart::Fill, opacity),
            Paint::ContextStroke => self.context_coat(PaintedPart::Stroke, opacity),
            Paint::Server(Link::Local(id), _) => Coat::Server(id.clone()),
            Paint::Server(Link::External, _) => Coat::External,
        }
    }

    /// How the fill or the stroke of the use around it is painted, at an opacity.
    fn context_coat(&self, part: PaintedPart, opacity: f32) -> Coat {
        match self.context.as_ref().map(|context| &context[part as usize]) {
            // Without a use nothing is painted (SVG 2, 13.2).
            None | Some(Coat::None) => Coat::None,
            Some(Coat::Colour(colour, alpha)) => Coat::Colour(*colour, alpha * opacity),
            Some(_) => Coat::Context,
        }
    }

    /// What stands in for a paint server that is not there.
    pub(super) fn fallback(&self, part: PaintedPart) -> Coat {
        match self.paint(part) {
            Paint::Server(_, Some(colour)) => {
                let opacity = (self.opacity * self.own_opacity(part)) as f32;
                painted(colour.resolved(self.style.current()), opacity)
            }
            _ => Coat::None,
        }
    }
}
