//! Height as colour: dark blue is low, light yellow is high.
//!
//! The anchors are evenly spaced in OKLCH lightness (0.40 to 0.92) and hue (295 to 100 degrees), so
//! equal steps of height look equally large, and height can still be read in grey or with any
//! colour-vision deficiency, because lightness alone carries it.

/// Red, green, blue.
pub(super) type Colour = [u8; 3];

/// Colour of the stage path: far from every colour of the ramp, in hue and against its lightness.
pub(super) const PATH: &str = "#d5186b";

/// Colour of the field frame.
pub(super) const FIELD: &str = "#c2410c";

/// Colour of texture that is not marked though it may be taken for marked.
pub(super) const FAULT: &str = "#d40000";

/// Colour of a pattern beyond the part.
pub(super) const BEYOND: &str = "#a8a8a8";

/// Colour of borders between blocks.
pub(super) const BORDER: &str = "#7b8794";

/// Colour of the part where it has no block, and of its outline.
pub(super) const PART: &str = "#e9e9e7";
pub(super) const OUTLINE: &str = "#3f3f3f";

/// Colour of fixtures.
pub(super) const FIXTURE: &str = "#4a4a4a";

/// Colour of the limits of travel.
pub(super) const TRAVEL: &str = "#5b2a86";

/// Colours of pens, dark on every colour of the ramp made light, and none of them red.
pub(super) const PENS: [Colour; 8] = [
    [26, 26, 26],
    [23, 62, 168],
    [133, 29, 140],
    [130, 72, 8],
    [8, 98, 66],
    [12, 106, 128],
    [92, 76, 150],
    [104, 110, 30],
];

const ANCHORS: [Colour; 9] = [
    [80, 46, 142],
    [59, 79, 172],
    [0, 112, 182],
    [0, 141, 173],
    [2, 167, 170],
    [9, 194, 158],
    [110, 213, 131],
    [186, 224, 108],
    [252, 231, 101],
];

/// The colour of `height` within `range`, in any one unit; the middle of the ramp where that is empty.
pub(super) fn of_height(height: i64, range: [i64; 2]) -> Colour {
    let span = range[1] - range[0];
    let last = ANCHORS.len() as i64 - 1;
    if span <= 0 {
        return ANCHORS[ANCHORS.len() / 2];
    }
    let along = (height - range[0]).clamp(0, span) * last;
    let below = (along / span).min(last - 1);
    let part = along - below * span;
    let (a, b) = (ANCHORS[below as usize], ANCHORS[below as usize + 1]);
    std::array::from_fn(|i| ((i64::from(a[i]) * (span - part) + i64::from(b[i]) * part + span / 2) / span) as u8)
}

/// A shade darker, which tells a level from the next one up where the ramp alone hardly could.
pub(super) fn shaded(colour: Colour) -> Colour {
    colour.map(|c| (u16::from(c) * 9 / 10) as u8)
}

/// The colour made as light as marks and numbers need that lie on it.
pub(super) fn light(colour: Colour) -> Colour {
    colour.map(|c| (255 - (255 - u16::from(c)) * 11 / 20) as u8)
}

/// Whether text on this colour has to be white to be read.
pub(super) fn is_dark(c: Colour) -> bool {
    2 * u32::from(c[0]) + 5 * u32::from(c[1]) + u32::from(c[2]) < 8 * 101
}

/// `#rrggbb`.
pub(super) fn hex([r, g, b]: Colour) -> String {
    format!("#{r:02x}{g:02x}{b:02x}")
}

/// Series of a chart. Within each four, lightness steps by 10 of 100 or more, so grey tells them apart.
pub(super) const SERIES: [Colour; 8] = [
    [29, 78, 137],
    [224, 130, 20],
    [213, 24, 107],
    [17, 17, 17],
    [63, 160, 216],
    [72, 28, 110],
    [18, 128, 96],
    [122, 74, 30],
];

/// Parts of a bar, apart in hue and lightness from their neighbours; the first five are those of the job time.
pub(super) const FILLS: [Colour; 8] = [
    [29, 78, 137],
    [127, 178, 214],
    [201, 201, 201],
    [213, 24, 107],
    [242, 163, 194],
    [224, 130, 20],
    [18, 128, 96],
    [91, 42, 134],
];

/// Of what has no colour of its own.
pub(super) const SPARE: Colour = [120, 120, 120];
