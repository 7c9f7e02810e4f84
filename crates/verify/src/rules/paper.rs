//! Which colours of a drawing are the page, by the definition of docs/reference/job-file.md, computed by the verifier
//! itself.

use terrace_core::math;
use terrace_input::texture::Paper;

/// Largest chroma of the page, beyond that of a stated colour, by the definition of docs/reference/job-file.md.
const CHROMA: f64 = 1.1;

/// An opacity that lies this near to one half may hide or not: it is a product of f32 numbers, in any order.
const HALF: f32 = 1e-4;

/// Whether a colour is the page.
pub(super) fn is_page(paper: Paper, colour: [u8; 3]) -> bool {
    let [l, a, b] = lab(colour);
    // White is the page in any case.
    let (least, [pa, pb]) = match paper {
        Paper::Lightness(least) => (least, [0.0; 2]),
        Paper::Colour(c) => {
            let [l, a, b] = lab(c);
            (l, [a, b])
        }
    };
    // From grey to the stated colour in the plane of a* and b*: the distance to the nearer end, or across.
    let length = math::hypot(pa, pb);
    let (along, across) = match length > 0.0 {
        true => ((a * pa + b * pb) / length, (a * pb - b * pa) / length),
        false => (math::hypot(a, b), 0.0),
    };
    let beyond = (along - length).max(-along).max(0.0);
    colour == [255; 3] || (l >= least && math::hypot(beyond, across) <= CHROMA)
}

/// Whether a shape in the colour of the page hides the shapes below it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Hides {
    All,
    Nothing,
    /// Too near to half opacity to tell.
    Either,
}

/// By its opacity.
pub(super) fn hides(opacity: f32) -> Hides {
    match opacity - 0.5 {
        more if more.abs() <= HALF => Hides::Either,
        more if more > 0.0 => Hides::All,
        _ => Hides::Nothing,
    }
}

/// CIE L*, a*, b* of an sRGB colour under D65.
fn lab([r, g, b]: [u8; 3]) -> [f64; 3] {
    let [r, g, b] = [r, g, b].map(|v| {
        let share = f64::from(v) / 255.0;
        // The transfer curve of sRGB (IEC 61966-2-1) is linear up to 0.04045, which is 10.3 of 255.
        if v > 10 { math::pow((share + 0.055) / 1.055, 2.4) } else { share / 12.92 }
    });
    // Its primaries, each row divided by what it has for white.
    let x = (0.4124 * r + 0.3576 * g + 0.1805 * b) / (0.4124 + 0.3576 + 0.1805);
    let y = (0.2126 * r + 0.7152 * g + 0.0722 * b) / (0.2126 + 0.7152 + 0.0722);
    let z = (0.0193 * r + 0.1192 * g + 0.9505 * b) / (0.0193 + 0.1192 + 0.9505);
    // The two branches of CIE 15, the linear one as kappa t + 16 over 116.
    let [x, y, z] = [x, y, z].map(|t: f64| {
        let kappa = 24_389.0 / 27.0;
        if t > 216.0 / 24_389.0 { math::cbrt(t) } else { (kappa * t + 16.0) / 116.0 }
    });
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[ignore = "slow: make test-all"]
    fn both_definitions_of_the_page_agree_on_one_colour_in_seven() {
        agree_on_every(7);
    }

    #[test]
    #[ignore = "slow: make test-all"]
    fn both_definitions_of_the_page_agree() {
        agree_on_every(1);
    }

    /// Holds one in `step` of the light colours against both definitions.
    fn agree_on_every(step: usize) {
        let papers = [
            Paper::default(),
            Paper::Lightness(90.0),
            Paper::Lightness(100.0),
            Paper::Colour([255; 3]),
            Paper::Colour([254; 3]),
            Paper::Colour([255, 248, 231]),
            Paper::Colour([230, 230, 250]),
            Paper::Colour([200, 180, 140]),
        ];
        for paper in papers {
            let mut pages = 0;
            for n in (0..64 * 64 * 64).step_by(step) {
                let colour = [n / 4096, n / 64 % 64, n % 64].map(|v: u32| 192 + v as u8);
                assert_eq!(is_page(paper, colour), paper.holds(colour), "{paper:?} {colour:?}");
                pages += u32::from(is_page(paper, colour));
            }
            assert!(pages > 0 && pages < 100_000, "{paper:?}: {pages}");
            assert!(!is_page(paper, [0; 3]) && !is_page(paper, [255, 0, 0]) && !is_page(paper, [128; 3]));
        }
    }

    #[test]
    fn half_opacity_hides_either() {
        let all = [0.0, 0.49, 0.49995, 0.5, 0.500_05, 0.51, 1.0].map(hides);
        use Hides::{All, Either, Nothing};
        assert_eq!(all, [Nothing, Nothing, Either, Either, Either, All, All]);
    }
}
