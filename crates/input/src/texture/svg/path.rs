//! Path data and lists of points, drawn into a [`Sink`].

use svgtypes::{NumberListParser, PathParser, PathSegment};

use super::outline::Sink;

/// The last control point of the segment before, which the short forms of curves mirror (SVG 2, 9.3.6 and 9.3.7).
enum LastControl {
    /// The segment was no curve of either kind.
    None,
    Cubic([f64; 2]),
    Quad([f64; 2]),
}

/// Draws path data up to its end or its first fault; returns whether it was faultless.
pub(super) fn path(data: &str, out: &mut impl Sink) -> bool {
    let mut last = LastControl::None;
    for segment in PathParser::from(data) {
        let Ok(segment) = segment else { return false };
        if !is_finite(&segment) {
            return false;
        }
        last = draw(segment, last, out);
    }
    true
}

fn draw(segment: PathSegment, last: LastControl, out: &mut impl Sink) -> LastControl {
    let [x0, y0] = out.at();
    let place = |abs: bool, x: f64, y: f64| if abs { [x, y] } else { [x0 + x, y0 + y] };
    let mirrored = |c: [f64; 2]| [2.0 * x0 - c[0], 2.0 * y0 - c[1]];
    match segment {
        PathSegment::MoveTo { abs, x, y } => out.move_to(place(abs, x, y)),
        PathSegment::LineTo { abs, x, y } => out.line_to(place(abs, x, y)),
        PathSegment::HorizontalLineTo { abs, x } => out.line_to([if abs { x } else { x0 + x }, y0]),
        PathSegment::VerticalLineTo { abs, y } => out.line_to([x0, if abs { y } else { y0 + y }]),
        PathSegment::CurveTo { abs, x1, y1, x2, y2, x, y } => {
            let d = place(abs, x2, y2);
            out.cubic_to(place(abs, x1, y1), d, place(abs, x, y));
            return LastControl::Cubic(d);
        }
        PathSegment::SmoothCurveTo { abs, x2, y2, x, y } => {
            let c = if let LastControl::Cubic(c) = last { mirrored(c) } else { [x0, y0] };
            let d = place(abs, x2, y2);
            out.cubic_to(c, d, place(abs, x, y));
            return LastControl::Cubic(d);
        }
        PathSegment::Quadratic { abs, x1, y1, x, y } => {
            let c = place(abs, x1, y1);
            out.quad_to(c, place(abs, x, y));
            return LastControl::Quad(c);
        }
        PathSegment::SmoothQuadratic { abs, x, y } => {
            let c = if let LastControl::Quad(c) = last { mirrored(c) } else { [x0, y0] };
            out.quad_to(c, place(abs, x, y));
            return LastControl::Quad(c);
        }
        PathSegment::EllipticalArc { abs, rx, ry, x_axis_rotation, large_arc, sweep, x, y } => {
            out.arc_to([rx, ry], x_axis_rotation, large_arc, sweep, place(abs, x, y));
        }
        PathSegment::ClosePath { .. } => out.close(),
    }
    LastControl::None
}

fn is_finite(segment: &PathSegment) -> bool {
    let are_finite = |values: &[f64]| values.iter().all(|v| v.is_finite());
    match *segment {
        PathSegment::MoveTo { x, y, .. }
        | PathSegment::LineTo { x, y, .. }
        | PathSegment::SmoothQuadratic { x, y, .. } => are_finite(&[x, y]),
        PathSegment::HorizontalLineTo { x, .. } => x.is_finite(),
        PathSegment::VerticalLineTo { y, .. } => y.is_finite(),
        PathSegment::CurveTo { x1, y1, x2, y2, x, y, .. } => are_finite(&[x1, y1, x2, y2, x, y]),
        PathSegment::SmoothCurveTo { x2, y2, x, y, .. } => are_finite(&[x2, y2, x, y]),
        PathSegment::Quadratic { x1, y1, x, y, .. } => are_finite(&[x1, y1, x, y]),
        PathSegment::EllipticalArc { rx, ry, x_axis_rotation, x, y, .. } => {
            are_finite(&[rx, ry, x_axis_rotation, x, y])
        }
        PathSegment::ClosePath { .. } => true,
    }
}

/// Draws the points of a polyline up to the first fault; returns whether they were faultless.
pub(super) fn polyline(list: &str, out: &mut impl Sink) -> bool {
    let mut numbers = NumberListParser::from(list);
    let mut is_first = true;
    while let Some(x) = numbers.next() {
        let (Ok(x), Some(Ok(y))) = (x, numbers.next()) else { return false };
        if !(x.is_finite() && y.is_finite()) {
            return false;
        }
        if std::mem::take(&mut is_first) { out.move_to([x, y]) } else { out.line_to([x, y]) }
    }
    true
}

/// Draws the points of a polygon up to the first fault, closed; returns whether they were faultless.
pub(super) fn polygon(list: &str, out: &mut impl Sink) -> bool {
    let is_faultless = polyline(list, out);
    out.close();
    is_faultless
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::texture::clip::Polylines;
    use crate::texture::svg::outline::{Outline, OutlineUse};
    use svg_style::Map;

    fn drawn(data: &str) -> (Vec<Vec<[f64; 2]>>, bool) {
        let mut lines = Polylines::default();
        let mut out = Outline::new(Map::shift([0.0; 2]), 0.01, OutlineUse::Area, &mut lines);
        let whole = path(data, &mut out);
        out.end().expect("drawn");
        (lines.iter().map(<[_]>::to_vec).collect(), whole)
    }

    #[test]
    fn relative_and_short_forms_equal_the_long_ones() {
        for (short, long) in [
            ("m1 1 2 0 0 2z", "M1 1L3 1L3 3Z"),
            ("M1 1h2v2h-2z", "M1 1L3 1L3 3L1 3Z"),
            ("M0 0C1 0 2 1 2 2s1 3 3 2", "M0 0C1 0 2 1 2 2C2 3 3 5 5 4"),
            ("M0 0S1 3 3 2", "M0 0C0 0 1 3 3 2"),
            ("M0 0Q1 0 2 2t3 0", "M0 0Q1 0 2 2Q3 4 5 2"),
            ("M0 0L1 1T3 0", "M0 0L1 1Q1 1 3 0"),
            ("M0 0a2 2 0 014 0", "M0 0A2 2 0 0 1 4 0"),
            ("M5 5l1 0 0 1zl2 2", "M5 5L6 5L6 6ZM5 5L7 7"),
        ] {
            assert_eq!(drawn(short), drawn(long), "{short}");
        }
    }

    #[test]
    fn faulty_data_is_drawn_up_to_the_fault() {
        for (data, kept) in [
            ("M 10 10 L 20 20 X 5 5 L nan inf Z", 1),
            ("L 5 5", 0),
            ("M 1", 0),
            ("M0 0 C 1 1 2 2", 0),
            ("M0 0L1 1L1e999 0", 1),
        ] {
            let (lines, whole) = drawn(data);
            assert_eq!((lines.len(), whole), (kept, false), "{data}");
        }
    }
}
