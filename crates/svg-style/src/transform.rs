//! Transforms: the attribute of SVG, and the properties of CSS Transforms 1 and 2 in the plane.

use std::str::FromStr;
use std::sync::Arc;

use cssparser::Parser;

use super::map::Map;
use super::value::{
    Fault, Length, Quantity, Reading, Source, angle, is_next, keyword, length, number, number_or_share, quantity,
};

/// A box in the units of an element: its corner and size.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reference {
    /// Its upper left corner, x and y.
    pub corner: [f64; 2],
    /// Width and height.
    pub size: [f64; 2],
}

const IDENTITY: Map = Map::shift([0.0; 2]);

/// One step of a transform.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Step {
    Matrix(Map),
    Translate([Length; 2]),
}

/// A transform: its functions, the outermost first.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Transform(pub(crate) Arc<[Step]>);

/// Which box of an element percentages and origins of transforms refer to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TransformBox {
    /// The nearest viewport.
    View,
    /// The box of the element without its strokes.
    Fill,
    /// The box of the element with its strokes.
    Stroke,
}

impl Transform {
    pub(crate) fn compute(&mut self, font_px: f64, root_px: f64) {
        if self.0.iter().any(|s| matches!(s, Step::Translate(_))) {
            for step in Arc::make_mut(&mut self.0) {
                if let Step::Translate(by) = step {
                    by.iter_mut().for_each(|l| l.compute(font_px, root_px));
                }
            }
        }
    }

    fn one(step: Step) -> Self {
        Self(Arc::from([step]))
    }
}

/// The value of `transform`.
pub(crate) fn transform(reading: &Reading, css: &mut Parser<'_>) -> Result<Transform, Fault> {
    if reading.source == Source::Attribute {
        return attribute(css);
    }
    if is_next(css, "none") {
        return Ok(Transform::default());
    }
    let mut steps = Vec::new();
    while !css.is_exhausted() {
        let name = css.expect_function()?.to_ascii_lowercase();
        steps.push(css.parse_nested_block(|css| {
            let step = function(reading, &name, css)?;
            css.expect_exhausted()?;
            Ok::<_, Fault>(step)
        })?);
    }
    if steps.is_empty() { Err(Fault::unexpected_token()) } else { Ok(Transform(steps.into())) }
}

/// The attribute has a grammar of its own (SVG 2, 8.5; CSS Transforms 1, 8).
fn attribute(css: &mut Parser<'_>) -> Result<Transform, Fault> {
    let start = css.position();
    while css.next_including_whitespace().is_ok() {}
    let text = css.slice_from(start).trim();
    if text.is_empty() || text.eq_ignore_ascii_case("none") {
        return Ok(Transform::default());
    }
    let t = svgtypes::Transform::from_str(text).map_err(|_| Fault::unexpected_token())?;
    Ok(Transform::one(Step::Matrix(Map { a: t.a, b: t.b, c: t.c, d: t.d, e: t.e, f: t.f })))
}

/// A function without its depth: elements of a drawing lie in its plane.
fn function(reading: &Reading, name: &str, css: &mut Parser<'_>) -> Result<Step, Fault> {
    let degrees = |css: &mut Parser<'_>| angle(reading, css);
    let skew =
        |x: f64, y: f64| Step::Matrix(Map { b: libm::tan(y.to_radians()), c: libm::tan(x.to_radians()), ..IDENTITY });
    let is_next_comma = |css: &mut Parser<'_>| css.try_parse(Parser::expect_comma).is_ok();
    let zoom = |x: f64, y: f64| Step::Matrix(Map::scale(x, y, [0.0; 2]));
    let zero = Length::px(0.0);
    Ok(match name {
        "matrix" => {
            let mut m = [0.0; 6];
            for (k, v) in m.iter_mut().enumerate() {
                if k > 0 {
                    css.expect_comma()?;
                }
                *v = number(reading, css)?;
            }
            Step::Matrix(Map { a: m[0], b: m[1], c: m[2], d: m[3], e: m[4], f: m[5] })
        }
        "translate" => {
            let x = length(reading, css)?;
            Step::Translate([x, if is_next_comma(css) { length(reading, css)? } else { zero }])
        }
        "translatex" => Step::Translate([length(reading, css)?, zero]),
        "translatey" => Step::Translate([zero, length(reading, css)?]),
        "translatez" => {
            length(reading, css)?;
            Step::Matrix(IDENTITY)
        }
        "translate3d" => {
            let x = length(reading, css)?;
            css.expect_comma()?;
            let y = length(reading, css)?;
            css.expect_comma()?;
            length(reading, css)?;
            Step::Translate([x, y])
        }
        "scale" => {
            let x = number_or_share(reading, css)?;
            zoom(x, if is_next_comma(css) { number_or_share(reading, css)? } else { x })
        }
        "scalex" => zoom(number_or_share(reading, css)?, 1.0),
        "scaley" => zoom(1.0, number_or_share(reading, css)?),
        "scalez" => number_or_share(reading, css).map(|_| Step::Matrix(IDENTITY))?,
        "scale3d" => {
            let x = number_or_share(reading, css)?;
            css.expect_comma()?;
            let y = number_or_share(reading, css)?;
            css.expect_comma()?;
            number_or_share(reading, css)?;
            zoom(x, y)
        }
        "rotate" | "rotatez" => Step::Matrix(Map::turn(degrees(css)?)),
        "skew" => {
            let x = degrees(css)?;
            skew(x, if is_next_comma(css) { degrees(css)? } else { 0.0 })
        }
        "skewx" => skew(degrees(css)?, 0.0),
        "skewy" => skew(0.0, degrees(css)?),
        "rotatex" | "rotatey" | "rotate3d" | "matrix3d" | "perspective" => {
            return Err(reading.unknown(format!("{name}()")));
        }
        _ => return Err(Fault::unexpected_token()),
    })
}

/// The value of `translate`.
pub(crate) fn translate(reading: &Reading, css: &mut Parser<'_>) -> Result<Transform, Fault> {
    if is_next(css, "none") {
        return Ok(Transform::default());
    }
    let x = length(reading, css)?;
    let y = css.try_parse(|css| length(reading, css)).unwrap_or(Length::px(0.0));
    // The depth of an element in its plane does not show.
    let _ = css.try_parse(|css| length(reading, css));
    Ok(Transform::one(Step::Translate([x, y])))
}

/// The value of `rotate`.
pub(crate) fn rotate(reading: &Reading, css: &mut Parser<'_>) -> Result<Transform, Fault> {
    if is_next(css, "none") {
        return Ok(Transform::default());
    }
    let mut degrees = css.try_parse(|css| degrees_alone(reading, css)).ok();
    let axis =
        css.try_parse(|css| keyword(css, &[("x", [1.0, 0.0, 0.0]), ("y", [0.0, 1.0, 0.0]), ("z", [0.0, 0.0, 1.0])]));
    let axis = axis.or_else(|_| {
        css.try_parse(|css| {
            let mut axis = [0.0; 3];
            for v in &mut axis {
                *v = number(reading, css)?;
            }
            Ok::<_, Fault>(axis)
        })
    });
    if degrees.is_none() {
        degrees = Some(angle(reading, css)?);
    }
    let degrees = degrees.unwrap_or_default();
    match axis {
        Err(_) => Ok(Transform::one(Step::Matrix(Map::turn(degrees)))),
        Ok([0.0, 0.0, z]) if z != 0.0 => Ok(Transform::one(Step::Matrix(Map::turn(degrees * z.signum())))),
        Ok(_) => Err(reading.unknown("rotate about an axis in the plane")),
    }
}

/// An angle that is written as one: 0 may begin an axis.
fn degrees_alone(reading: &Reading, css: &mut Parser<'_>) -> Result<f64, Fault> {
    match quantity(reading, css)? {
        Quantity::Angle(degrees) => Ok(degrees),
        _ => Err(Fault::unexpected_token()),
    }
}

/// The value of `scale`.
pub(crate) fn scale(reading: &Reading, css: &mut Parser<'_>) -> Result<Transform, Fault> {
    if is_next(css, "none") {
        return Ok(Transform::default());
    }
    let x = number_or_share(reading, css)?;
    let y = css.try_parse(|css| number_or_share(reading, css)).unwrap_or(x);
    let _ = css.try_parse(|css| number_or_share(reading, css));
    Ok(Transform::one(Step::Matrix(Map::scale(x, y, [0.0; 2]))))
}

/// The value of `transform-origin`: a place along x and along y, and a depth that does not show.
pub(crate) fn origin(reading: &Reading, css: &mut Parser<'_>) -> Result<[Length; 2], Fault> {
    let first = origin_part(reading, css)?;
    let second = css.try_parse(|css| origin_part(reading, css)).ok();
    let depth = css.try_parse(|css| length(reading, css)).ok();
    if depth.is_some_and(|d| d.share != 0.0) {
        return Err(Fault::unexpected_token());
    }
    let OriginPart { length: a, axis: a_axis } = first;
    let Some(OriginPart { length: b, axis: b_axis }) = second else {
        // The other one is the middle.
        return Ok(if a_axis == Some(Axis::Y) { [Length::share(0.5), a] } else { [a, Length::share(0.5)] });
    };
    match (a_axis, b_axis) {
        // Words may stand in either order; a length in the first place is along x.
        (Some(Axis::Y), Some(Axis::X) | None) if b.px == 0.0 || b.share != 0.0 => Ok([b, a]),
        (None, Some(Axis::X)) if a.share == 0.5 => Ok([b, a]),
        (Some(Axis::X) | None, Some(Axis::Y) | None) => Ok([a, b]),
        _ => Err(Fault::unexpected_token()),
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Axis {
    X,
    Y,
}

/// A word or a length of `transform-origin`.
struct OriginPart {
    /// Its place along the axis.
    length: Length,
    /// The axis that the word names; None for `center` and for lengths.
    axis: Option<Axis>,
}

fn origin_part(reading: &Reading, css: &mut Parser<'_>) -> Result<OriginPart, Fault> {
    let words = [
        ("left", (0.0, Some(Axis::X))),
        ("right", (1.0, Some(Axis::X))),
        ("top", (0.0, Some(Axis::Y))),
        ("bottom", (1.0, Some(Axis::Y))),
        ("center", (0.5, None)),
    ];
    match css.try_parse(|css| keyword(css, &words)) {
        Ok((share, axis)) => Ok(OriginPart { length: Length::share(share), axis }),
        Err(_) => length(reading, css).map(|length| OriginPart { length, axis: None }),
    }
}

/// The value of `transform-box`.
pub(crate) fn reference_box(_: &Reading, css: &mut Parser<'_>) -> Result<TransformBox, Fault> {
    let words = [
        ("view-box", TransformBox::View),
        ("fill-box", TransformBox::Fill),
        ("content-box", TransformBox::Fill),
        ("stroke-box", TransformBox::Stroke),
        ("border-box", TransformBox::Stroke),
    ];
    keyword(css, &words)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::property::Style;

    fn parsed(text: &str) -> Option<[f64; 6]> {
        let mut style = Style::initial();
        let reading = Reading::new(Source::Css);
        style.transform = Parser::new(text).parse_entirely(|css| transform(&reading, css)).ok()?;
        let Map { a, b, c, d, e, f } = style.matrix(Reference { corner: [0.0; 2], size: [200.0, 100.0] });
        Some([a, b, c, d, e, f])
    }

    #[test]
    fn functions_give_their_matrices() {
        for (text, want) in [
            ("translate(10px, 20%)", Some([1.0, 0.0, 0.0, 1.0, 10.0, 20.0])),
            ("translate3d(1px, 2px, 3px)", Some([1.0, 0.0, 0.0, 1.0, 1.0, 2.0])),
            ("scale(2) translateX(5px)", Some([2.0, 0.0, 0.0, 2.0, 10.0, 0.0])),
            ("rotate(0.25turn)", Some([0.0, 1.0, -1.0, 0.0, 0.0, 0.0])),
            ("matrix(1, 2, 3, 4, 5, 6)", Some([1.0, 2.0, 3.0, 4.0, 5.0, 6.0])),
            ("translate(10)", None),
            ("rotate(45)", None),
            ("rotateX(45deg)", None),
            ("", None),
        ] {
            assert_eq!(parsed(text), want, "{text}");
        }
    }

    #[test]
    fn origins_are_read_in_both_orders() {
        let of = |text: &str| {
            let reading = Reading::new(Source::Css);
            let origin = Parser::new(text).parse_entirely(|css| origin(&reading, css)).ok()?;
            Some(origin.map(|l| l.of(100.0)))
        };
        for (text, want) in [
            ("left", Some([0.0, 50.0])),
            ("bottom", Some([50.0, 100.0])),
            ("top right", Some([100.0, 0.0])),
            ("right top 3px", Some([100.0, 0.0])),
            ("center left", Some([0.0, 50.0])),
            ("10px 20px", Some([10.0, 20.0])),
            ("10px top", Some([10.0, 0.0])),
            ("top 10px", None),
            ("left right", None),
        ] {
            assert_eq!(of(text), want, "{text}");
        }
    }
}
