//! The transform properties of an element together, as one map.

use super::map::Map;
use super::property::Style;
use super::transform::{Reference, Step, TransformBox};

impl Style {
    /// Whether the element has a transform.
    pub fn has_transform(&self) -> bool {
        [&self.translate, &self.rotate, &self.scale, &self.transform].iter().any(|t| !t.0.is_empty())
    }

    /// Whether the transform depends on the reference box, which need not be known otherwise.
    pub fn transform_needs_box(&self) -> bool {
        let transforms = [&self.translate, &self.rotate, &self.scale, &self.transform];
        let mut steps = transforms.iter().flat_map(|t| t.0.iter());
        let has_share = steps.any(|s| matches!(s, Step::Translate(by) if by.iter().any(|l| l.share != 0.0)));
        let is_moved = self.transform_box != TransformBox::View;
        self.has_transform() && (has_share || is_moved || self.transform_origin.iter().any(|l| l.share != 0.0))
    }

    /// The map of its transform properties together (CSS Transforms 2, 6).
    pub fn matrix(&self, reference: Reference) -> Map {
        let origin = [0, 1].map(|k| reference.corner[k] + self.transform_origin[k].of(reference.size[k]));
        let mut map = Map::shift(origin);
        for part in [&self.translate, &self.rotate, &self.scale, &self.transform] {
            for step in part.0.iter() {
                let step = match step {
                    Step::Matrix(m) => *m,
                    Step::Translate(by) => Map::shift([0, 1].map(|k| by[k].of(reference.size[k]))),
                };
                map = map.after(step);
            }
        }
        map.after(Map::shift(origin.map(|v| -v)))
    }
}
