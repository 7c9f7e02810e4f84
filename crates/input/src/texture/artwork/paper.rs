//! Which colours are the page.
//!
//! A colour that the eye cannot tell from white paper is the page, as white is: drawing programs write paper as
//! `#FEFEFE` (CorelDRAW) or as what a colour profile makes of white. Colours are judged as CIE L*a*b* of sRGB
//! (IEC 61966-2-1) under D65, with the white of sRGB as reference: L* is the lightness, 0 to 100, and sqrt(a*² + b*²)
//! the chroma, 0 for greys.

use super::{Colour, WHITE};
use terrace_core::math;

/// L* from which on a colour is the page unless the job says otherwise. Of greys that is `#FAFAFA` (98.3) and lighter.
const LIGHTNESS: f64 = 98.0;

/// How far from the neutral axis a colour of the page may lie, in the plane of a* and b*.
///
/// With [`LIGHTNESS`] no such colour is farther than 2.3 from white (sqrt(2² + 1.1²) = 2.28), the difference that is
/// just noticeable (Mahy, Van Eycken, Oosterlinck 1994). The bound is narrower than that of lightness because tints are
/// seen sooner beside white than greys: CIEDE2000 divides differences of lightness by 1.7 there and multiplies those of
/// red and green by 1.5. `#FFFFE0`, with L* 99.3, has a chroma of 15.7 and is visibly yellow.
const CHROMA: f64 = 1.1;

/// L* of colours that are reported when they are marked, and the largest chroma that makes them pale: a saturated
/// yellow (L* 97, chroma 97) or cyan (91, 50) is not taken for paper, a grey of `#E3E3E3` or beige may be meant as
/// paper.
const LIGHT: f64 = 90.0;
const PALE: f64 = 20.0;

/// The lightest colours, which are the page.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Paper {
    /// Greys from this L* on, and what differs from them by a chroma of up to 1.1.
    Lightness(f64),
    /// This colour, and what is at least as light and no farther than 1.1 from the colours between it and the greys.
    Colour([u8; 3]),
}

impl Default for Paper {
    fn default() -> Self {
        Self::Lightness(LIGHTNESS)
    }
}

impl Paper {
    /// Whether a colour is the page.
    pub fn holds(self, colour: [u8; 3]) -> bool {
        if colour == WHITE {
            return true;
        }
        let own = Lab::of(colour);
        match self {
            Self::Lightness(least) => own.lightness >= least && own.away_from_tint([0.0; 2]) <= CHROMA,
            Self::Colour(paper) => {
                let paper = Lab::of(paper);
                own.lightness >= paper.lightness && own.away_from_tint(paper.tint) <= CHROMA
            }
        }
    }
}

/// L* of a colour.
pub(crate) fn lightness(colour: Colour) -> f64 {
    Lab::of(colour).lightness
}

/// Whether a colour is so light that it may be meant as the page.
pub(super) fn is_light(colour: Colour) -> bool {
    let own = Lab::of(colour);
    own.lightness >= LIGHT && own.away_from_tint([0.0; 2]) <= PALE
}

/// A colour in CIE L*a*b*.
struct Lab {
    lightness: f64,
    /// a* and b*.
    tint: [f64; 2],
}

impl Lab {
    fn of(colour: Colour) -> Self {
        // IEC 61966-2-1: from samples to light, and from light to X, Y and Z.
        let light = colour.map(|v| {
            let v = f64::from(v) / 255.0;
            if v <= 0.04045 { v / 12.92 } else { math::pow((v + 0.055) / 1.055, 2.4) }
        });
        const XYZ: [[f64; 3]; 3] = [[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]];
        // CIE 15: relative to the reference white, whose X, Y and Z are the sums of the rows.
        let [x, y, z] = XYZ.map(|row| {
            let sum: f64 = row.iter().zip(light).map(|(m, v)| m * v).sum();
            let t = sum / row.iter().sum::<f64>();
            let bend = 6.0 / 29.0;
            if t > bend * bend * bend { math::cbrt(t) } else { t / (3.0 * bend * bend) + 4.0 / 29.0 }
        });
        Self { lightness: 116.0 * y - 16.0, tint: [500.0 * (x - y), 200.0 * (y - z)] }
    }

    /// How far its a* and b* lie from the straight line between those of greys and of a tint.
    fn away_from_tint(&self, [a, b]: [f64; 2]) -> f64 {
        let [own_a, own_b] = self.tint;
        let square = a * a + b * b;
        let share = if square > 0.0 { ((own_a * a + own_b * b) / square).clamp(0.0, 1.0) } else { 0.0 };
        math::hypot(own_a - share * a, own_b - share * b)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn colour(hex: u32) -> Colour {
        [hex >> 16, hex >> 8, hex].map(|v| (v & 255) as u8)
    }

    #[test]
    fn lab_of_known_colours() {
        // Lindbloom's calculator, D65, sRGB.
        for (hex, lab) in [
            (0xff_ffff, [100.0, 0.0, 0.0]),
            (0x00_0000, [0.0, 0.0, 0.0]),
            (0xff_0000, [53.24, 80.09, 67.20]),
            (0x80_8080, [53.59, 0.0, 0.0]),
            (0xff_ffe0, [99.29, -5.10, 14.84]),
            (0xfe_fefe, [99.65, 0.0, 0.0]),
        ] {
            let own = Lab::of(colour(hex));
            let all = [own.lightness, own.tint[0], own.tint[1]];
            assert!(all.iter().zip(lab).all(|(a, b)| (a - b).abs() < 0.05), "{hex:06x}: {all:?}");
        }
    }

    #[test]
    fn page_is_what_the_eye_cannot_tell_from_white() {
        let page = Paper::default();
        for hex in [0xff_ffff, 0xfe_fefe, 0xfd_fdfd, 0xfc_fcfc, 0xfa_fafa, 0xff_fffe, 0xff_fffd, 0xfe_ffff, 0xfb_fcfd] {
            assert!(page.holds(colour(hex)), "{hex:06x}");
        }
        // Snow, ivory, light yellow and others with a name or a visible grey.
        for hex in [0xf9_f9f9, 0xf5_f5f5, 0xff_fafa, 0xff_fff0, 0xff_ffe0, 0xf8_f8ff, 0xf0_ffff, 0xff_ff00, 0] {
            assert!(!page.holds(colour(hex)), "{hex:06x}");
        }
    }

    #[test]
    fn no_colour_of_the_page_is_farther_from_white_than_just_noticeable() {
        let mut held = 0;
        for hex in 0..1 << 12 {
            let c = [hex >> 8, hex >> 4, hex].map(|v: u32| 240 + (v & 15) as u8);
            let own = Lab::of(c);
            let away = math::hypot(100.0 - own.lightness, math::hypot(own.tint[0], own.tint[1]));
            held += u32::from(Paper::default().holds(c));
            assert!(!Paper::default().holds(c) || away < 2.3, "{c:?}: {away}");
        }
        assert!(held > 20, "{held}");
    }

    #[test]
    fn a_stated_paper_holds_itself_and_what_lies_between_it_and_white() {
        let exact = Paper::Colour([255; 3]);
        assert!(exact.holds([255; 3]) && !exact.holds([254; 3]));
        let corel = Paper::Colour([254; 3]);
        assert!(corel.holds([254; 3]) && corel.holds([255; 3]) && !corel.holds([253; 3]));
        let grey = Paper::Lightness(90.0);
        assert!(grey.holds(colour(0xe3_e3e3)) && !grey.holds(colour(0xe2_e2e2)) && !grey.holds(colour(0xff_ffe0)));
        // Cream, and half of its tint; not a light blue, nor a deeper yellow of the same lightness.
        let cream = Paper::Colour(colour(0xff_f8e7));
        for (hex, is_page) in
            [(0xff_f8e7, true), (0xff_fcf3, true), (0xff_ffff, true), (0xf8_fbff, false), (0xff_ffc0, false)]
        {
            assert_eq!(cream.holds(colour(hex)), is_page, "{hex:06x}");
        }
        assert!(Paper::Lightness(100.0).holds([255; 3]) && !Paper::Lightness(100.0).holds([254; 3]));
    }

    #[test]
    fn light_colours_are_pale() {
        for (hex, light) in [
            (0xf5_f5f5, true),
            (0xe3_e3e3, true),
            (0xe2_e2e2, false),
            (0xf5_f5dc, true),
            (0xff_ff00, false),
            (0x00_ffff, false),
        ] {
            assert_eq!(is_light(colour(hex)), light, "{hex:06x}");
        }
    }
}
