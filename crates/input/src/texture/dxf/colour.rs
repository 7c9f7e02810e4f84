//! Colours of the AutoCAD Color Index (ACI) on white paper.

use crate::texture::artwork::Colour;

/// What the colour of an entity or layer is said to be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum EntityPaint {
    /// The colour of the layer.
    Layer,
    /// The colour of the insert of the block.
    Block,
    Colour(Colour),
}

/// The colour of index 7, which is white on a black screen and black on paper.
pub(super) const BLACK: Colour = [0; 3];

impl EntityPaint {
    /// From the number of group 62.
    pub(super) fn of_index(index: i64) -> Self {
        match index {
            0 => Self::Block,
            1..=255 => Self::Colour(of_index(index as usize)),
            _ => Self::Layer,
        }
    }

    /// From the number of group 420.
    pub(super) fn of_rgb(rgb: i64) -> Self {
        Self::Colour([16, 8, 0].map(|shift| (rgb >> shift & 255) as u8))
    }
}

/// 10 to 249 are 24 hues in ten shades each: five values, full or half saturated.
fn of_index(index: usize) -> Colour {
    const BASIC: [Colour; 9] =
        [[255, 0, 0], [255, 255, 0], [0, 255, 0], [0, 255, 255], [0, 0, 255], [255, 0, 255], BLACK, [128; 3], [192; 3]];
    const GREY: [u8; 6] = [51, 91, 132, 173, 214, 255];
    match index {
        1..=9 => return BASIC[index - 1],
        250.. => return [GREY[index.min(255) - 250]; 3],
        _ => {}
    }
    let hue = (index - 10) / 10;
    let shade = (index - 10) % 10;
    let high = 255.0 * [1.0, 0.65, 0.5, 0.3, 0.15][shade / 2];
    let low = if shade.is_multiple_of(2) { 0.0 } else { high / 2.0 };
    let step = (high - low) * (hue % 4) as f64 / 4.0;
    let up = low + step;
    let down = high - step;
    let rgb = match hue / 4 {
        0 => [high, up, low],
        1 => [down, high, low],
        2 => [low, high, up],
        3 => [low, down, high],
        4 => [up, low, high],
        _ => [high, low, down],
    };
    rgb.map(|v| v as u8)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn indices_have_the_colours_of_the_palette() {
        let table: [(i64, u32); 12] = [
            (1, 0xff_0000),
            (7, 0),
            (8, 0x80_8080),
            (11, 0xff_7f7f),
            (23, 0xa5_6752),
            (30, 0xff_7f00),
            (42, 0xa5_7c00),
            (62, 0x7c_a500),
            (103, 0x52_a567),
            (142, 0x00_7ca5),
            (249, 0x26_1317),
            (255, 0xff_ffff),
        ];
        for (index, rgb) in table {
            assert_eq!(EntityPaint::of_index(index), EntityPaint::of_rgb(rgb.into()), "{index}");
        }
        assert_eq!([0, 256, 257, -3].map(EntityPaint::of_index)[..2], [EntityPaint::Block, EntityPaint::Layer]);
    }
}
