//! Plots from bytes to shapes.

use super::*;
use crate::texture::artwork::{ShapeFigure, StrokeMode, WindingRule};
use crate::texture::clip::extent;
use terrace_core::geom::PlanePoint;
use terrace_core::math;

/// The spot that the widest line is taken from, mm.
const SPOT: f64 = 0.1;

fn loaded(text: &[u8]) -> (Result<Artwork, Error>, Vec<&'static str>) {
    marked(text, StrokeMode::Shown)
}

fn marked(text: &[u8], stroke: StrokeMode) -> (Result<Artwork, Error>, Vec<&'static str>) {
    let mut notes = Vec::new();
    let marking = Marking { is_lenient: true, stroke, ..Marking::default() };
    let widest_line = marking.widest_line_mm(SPOT);
    let options = PlotOptions { path: Path::new("a.plt"), tolerance: 1e-3, widest_line, marking: &marking };
    let art = load(text, &options, &mut notes);
    (art, notes.iter().map(|n| n.code).collect())
}

fn lines(text: &str) -> Vec<Vec<PlanePoint>> {
    let (art, notes) = loaded(text.as_bytes());
    assert!(notes.is_empty(), "{text}: {notes:?}");
    let art = art.expect("read");
    let corner = art.corner.expect("a corner");
    let round = |v: f64| (v * 1e9).round() / 1e9;
    let line = |l: &[PlanePoint]| l.iter().map(|p| [0, 1].map(|k| round(p[k] + corner[k]))).collect();
    art.lines.iter().map(line).collect()
}

#[test]
fn strokes_are_those_of_the_pen() {
    let square = vec![vec![[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]]];
    for text in [
        "IN;SP1;PU0,0;PD40,0,40,40;PU;",
        "\x1b%0BINSP1PU0 0PD40 0PD40 40PU",
        // Numbers outside of an instruction belong to none.
        "IN;SP1;PA0,0;PD;PR40,0;0,40;PR0,40;PU",
        "in sp1 pa pd40,0;pd40,40;",
        "\x1b.@;0:SP1;IP0,0,400,400;SC0,10,0,10;PU0,0;PD1,0,1,1;",
        // Base 32: 40 is 80 = 16 + 2 * 32.
        "SP1;PU0,0;PE7Oa__Oa;",
        "SP1;PE7<=Oa_<=__Oa__Oa;",
    ] {
        assert_eq!(lines(text), square, "{text:?}");
    }
}

#[test]
fn curves_keep_the_tolerance_and_close() {
    let found = lines("SP2;PA400,0;CI400;");
    let circle = &found[0];
    assert_eq!(circle.first(), circle.last());
    assert!(circle.iter().all(|p| (math::hypot(p[0] - 10.0, p[1]) - 10.0).abs() < 1e-8));
    let sag = |w: &[PlanePoint]| 10.0 - math::hypot((w[0][0] + w[1][0]) / 2.0 - 10.0, (w[0][1] + w[1][1]) / 2.0);
    assert!(circle.windows(2).map(sag).fold(0.0, f64::max) <= 1e-3);
    let arc = &lines("SP1;PA40,0;PD;AA0,0,90;PU")[0];
    assert!((arc[0], arc[arc.len() - 1]) == ([1.0, 0.0], [0.0, 1.0]), "{arc:?}");
}

#[test]
fn pens_fills_and_faults_are_reported() {
    let (art, notes) =
        loaded(b"SP2;PA0,0;PM0;PA40,0,40,40;PM1;PA10,0,10,10,20,10;PM2;FP;SP9;EA80,80;LBtext\x03XX1;LT2;PD9,9");
    let art = art.expect("read");
    let shown: Vec<_> =
        art.shapes.iter().map(|s| (s.figure, s.colour, art.labels[s.labels as usize].own[0].as_str())).collect();
    let fill = ShapeFigure::Fill(WindingRule::EvenOdd);
    assert_eq!(shown[..2], [(fill, [255, 0, 0], "pen:2"), (ShapeFigure::Lines, [255, 0, 0], "pen:9")]);
    assert_eq!(art.shapes[0].lines.len(), 2);
    assert_eq!(notes, ["hpgl-text", "hpgl-dash", "hpgl-unread"]);
    for (text, code) in [
        ("SP1;PD1.2.3,4", "hpgl-syntax"),
        ("SP1;PD1,2,3", "hpgl-syntax"),
        ("SP1;RO90;PD1,2", "hpgl-page"),
        ("SP1;SC0,1,0,1;PD1,2", "hpgl-page"),
        ("SP1;PD1,99999999999999999999999", "texture-far"),
        ("SP1;PD;CI99999999999;", "texture-far"),
        ("<svg>not a plot</svg>", "hpgl-syntax"),
        ("", "hpgl-syntax"),
    ] {
        let e = loaded(text.as_bytes()).0.err().unwrap_or_else(|| panic!("{text} is read"));
        assert_eq!(e.diags()[0].code, code, "{text}: {e}");
    }
}

/// Length of all lines, mm, and the number of dots.
fn length_and_dots(text: &str) -> (f64, usize) {
    let found = lines(text);
    let length =
        |l: &Vec<PlanePoint>| l.windows(2).map(|w| math::hypot(w[1][0] - w[0][0], w[1][1] - w[0][1])).sum::<f64>();
    let sum: f64 = found.iter().map(length).sum();
    ((sum * 1e6).round() / 1e6, found.iter().filter(|l| l.len() == 1).count())
}

#[test]
fn in_and_df_set_what_a_second_plot_begins_with() {
    for (text, want) in [
        // 100 units of 10 plotter units, then 1200 plotter units.
        ("IN;IP0,0,1000,1000;SC0,100,0,100;SP1;PU0,0;PD100,0;PU;IN;SP1;PU200,200;PD1400,200;PU;", 25.0 + 30.0),
        ("IN;IP0,0,1000,1000;SC0,100,0,100;SP1;PU0,0;PD100,0;PU;DF;PU200,200;PD1400,200;PU;", 25.0 + 30.0),
        ("IN;SP1;PU200,200;PR;PD100,0;PU;IN;SP1;PU400,400;PD800,400;PU;", 2.5 + 10.0),
        ("IN;SP1;PU200,200;PR;PD100,0;PU;DF;PU400,400;PD800,400;PU;", 2.5 + 10.0),
        // The pen is up, and stands at the origin after IN and where it was after DF.
        ("SP1;PU0,0;PD400,0;IN;PA400,400;PD;PA800,400;PU", 10.0 + 10.0),
        ("SP1;PU0,0;PD400,0;IN;PD0,400;PU", 10.0 + 10.0),
        ("SP1;PU0,0;PD400,0;DF;PA400,400;PD;PA800,400;PU", 10.0 + 10.0),
        ("SP1;PU0,0;PD400,0;DF;PD400,400;PU", 10.0 + 10.0),
        // P1 and P2 stay with DF, and become those of the device with IN.
        ("IP0,0,1000,1000;DF;SC0,100,0,100;SP1;PU0,0;PD100,0;PU", 25.0),
        // Line and fill types.
        ("SP1;LT2;IN;PU0,0;PD400,0;PU", 10.0),
        ("SP1;LT2;DF;PU0,0;PD400,0;PU", 10.0),
        ("SP1;FT3;IN;PU0,0;RA400,400", 40.0),
        ("SP1;FT3;DF;PU0,0;RA400,400", 40.0),
        // The polygon is forgotten.
        ("SP1;PU0,0;PD400,0;PU;EA800,400;IN;EP", 10.0 + 40.0),
        ("SP1;PU0,0;PD400,0;PU;PM0;PD800,0,0,800;DF;EP", 10.0),
        // What ends a label.
        ("DT*;IN;SP1;PU0,0;PD400,0;PU", 10.0),
        // Pages.
        ("IN;SP1;PU0,0;PD400,0;PU;PG;IN;SP1;PU0,400;PD400,400;PU;PG;", 10.0 + 10.0),
    ] {
        assert_eq!(length_and_dots(text), (want, 0), "{text}");
    }
    let text = b"DT*;IN;SP1;LBA*PD9,9\x03PU0,0;PD400,0;PU;";
    assert_eq!(loaded(text).0.expect("read").lines.len(), 1, "the label ends with ETX again");
    for text in ["IP0,0,1000,1000;IN;SC0,100,0,100;SP1;PU0,0", "SC0,1,0,1;IN;SC0,1,0,1;SP1;PD1,1"] {
        assert_eq!(loaded(text.as_bytes()).0.expect_err("P1 and P2 are not known").diags()[0].code, "hpgl-page");
    }
    // IN takes pen 1, DF keeps the pen.
    for (text, want) in [("SP3;IN;PD400,0;PU", "pen:1"), ("SP3;DF;PD400,0;PU", "pen:3")] {
        assert_eq!(loaded(text.as_bytes()).0.expect("read").labels[0].own, [want]);
    }
}

#[test]
fn sc_maps_to_the_points_of_the_last_ip() {
    for (text, want) in [
        ("IN;IP0,0,1000,1000;SC0,100,0,100;IP0,0,4000,4000;SP1;PU0,0;PD100,0;PU;", 100.0),
        ("IN;SC0,100,0,100;IP0,0,4000,4000;SP1;PU0,0;PD100,0;PU;", 100.0),
        // P2 follows P1.
        ("IN;IP0,0,1000,1000;SC0,100,0,100;IP1000,1000;SP1;PU0,0;PD100,0;PU;", 25.0),
        // Off, the pen stays where it is: from 1000 to 100 plotter units.
        ("IN;IP0,0,1000,1000;SC0,100,0,100;SP1;PU100,0;SC;PD100,0;PU;", 22.5),
        // The pen stays where it is while the units move under it: from 1000 to 4000 plotter units.
        ("IN;IP0,0,1000,1000;SC0,100,0,100;SP1;PU100,0;IP0,0,4000,4000;PD100,0;PU;", 75.0),
        // Relative moves and radii are in units of the plot.
        ("IN;IP500,500,1500,1500;SC0,100,0,100;SP1;PU10,10;PR;PD10,0;PU;", 2.5),
        ("IN;IP0,0,1000,1000;SC0,100,100,0;SP1;PU0,0;PD0,100;PU;", 25.0),
    ] {
        assert_eq!(length_and_dots(text), (want, 0), "{text}");
    }
    // A circle in units that are twice as long along x is an ellipse.
    let circle = &lines("IP0,0,2000,1000;SC0,100,0,100;SP1;PU50,50;CI20")[0];
    let [w, h] = extent(circle);
    assert!((w - 20.0).abs() < 2e-3 && (h - 10.0).abs() < 2e-3, "{w} {h}");
}

#[test]
fn edges_of_polygons_are_those_that_the_pen_draws() {
    for (text, want) in [
        ("IN;SP1;PU0,0;PM0;PD1000,0,1000,1000;PU0,1000;PD0,0;PM2;EP;", 75.0),
        // Closed by an edge where the pen is down at its end.
        ("IN;SP1;PU0,0;PM0;PD1000,0,1000,1000,0,1000;PM2;EP;", 100.0),
        ("IN;SP1;PU0,0;PM0;PD1000,0,1000,1000,0,1000;PU;PM2;EP;", 75.0),
        ("IN;SP1;PU0,0;PM0;PD1000,0,1000,1000,0,1000;PM1;PU400,400;PD500,400,500,500;PM2;EP;", 108.535534),
        // A circle is a ring of its own; the pen is back where the polygon began, as it was.
        ("IN;SP1;PU400,0;PM0;PD800,0,800,400;PM2;PD400,400;PU;", 10.0),
        ("IN;SP1;PU0,0;PD400,0;PM0;PD800,0;PM2;PA400,400;PU", 20.0),
        // The buffer keeps the last rectangle.
        ("IN;SP1;PU0,0;RA400,400;EP;", 80.0),
    ] {
        assert_eq!(length_and_dots(text), (want, 0), "{text}");
    }
    assert_eq!(lines("IN;SP1;PU0,0;PM0;PD40,0,40,40;PU0,40;PD0,0;PM2;EP;")[0].len(), 4, "joined at the first point");
    let art = loaded(b"SP1;PU0,0;PM0;PU40,0,40,40;PM1;CI40;PM2;FP1;").0.expect("read");
    assert_eq!((art.shapes[0].figure, art.shapes[0].lines.len()), (ShapeFigure::Fill(WindingRule::NonZero), 2));
}

#[test]
fn a_pen_put_down_without_a_move_is_a_point() {
    for (text, want) in [
        ("IN;SP1;PU200,200;PD;PU;PU400,400;PD400,400;PU;PU800,800;PD1200,800;PU;", (10.0, 2)),
        ("IN;SP1;PU200,200;PD;PU400,400;PD;PU800,800;PD;PU;", (0.0, 3)),
        ("IN;SP1;PU200,200;PD", (0.0, 1)),
        ("SP1;PU0,0;PD;SP2;PU9,9;PD400,9;PU", (9.775, 1)),
        // Where the pen has drawn, it leaves no point; nor without a pen, nor where a polygon begins.
        ("SP1;PU0,0;PD400,0;PD;PU", (10.0, 0)),
        ("SP1;PU0,0;PD400,0,400,0;PU", (10.0, 0)),
        ("SP1;PU0,0;PD;PA400,0;PU;SP0;PU0,0;PD;PU", (10.0, 0)),
        ("SP1;PU0,0;PD;PM0;PD400,0;PU;PM2;EP;PU", (10.0, 0)),
        ("SP1;PU0,0;PD;EA400,400;PU", (40.0, 0)),
        ("SP1;PE7Oa__Oa;PU400,400;PE7__;", (2.0, 1)),
    ] {
        assert_eq!(length_and_dots(text), want, "{text}");
    }
    // A circle is drawn with the pen down; the pen comes back to its centre.
    assert_eq!(lines("SP1;PU400,0;PD;CI400;PU").iter().filter(|l| l.len() == 1).count(), 1);
}

#[test]
fn a_point_of_a_wide_pen_is_a_disc() {
    let disc = |text: &str, stroke| {
        let art = marked(text.as_bytes(), stroke).0.expect("read");
        (art.shapes[0].figure == ShapeFigure::Stroke).then(|| (extent(art.lines.get(0))[0] * 1e3).round() / 1e3)
    };
    for (text, want) in [
        ("PW2;SP1;PU0,0;PD;PU", Some(2.0)),
        ("PW2,1;PW0.1,2;SP1;PU0,0;PD;PU", Some(2.0)),
        ("PW2,2;SP1;PU0,0;PD;PU", None),
        ("PW2,1;PW0.1;SP1;PU0,0;PD;PU", None),
        ("PW0.15;SP1;PU0,0;PD;PU", None),
        ("PW0.16;SP1;PU0,0;PD;PU", Some(0.16)),
        // One percent of 5000 plotter units.
        ("WU1;PW1;IP0,0,3000,4000;SP1;PU0,0;PD;PU", Some(1.25)),
        ("WU1;PW1;SP1;PU0,0;PD;PU", None),
        ("PW2;WU;SP1;PU0,0;PD;PU", None),
        ("PW2;IN;SP1;PU0,0;PD;PU", None),
        ("PW2;DF;SP1;PU0,0;PD;PU", Some(2.0)),
    ] {
        assert_eq!(disc(text, StrokeMode::Shown), want, "{text}");
    }
    assert_eq!(disc("PW2;SP1;PU0,0;PD;PU", StrokeMode::Centre), None);
    assert_eq!(disc("PW0.1;SP1;PU0,0;PD;PU", StrokeMode::Hatch), Some(0.1));
}

#[test]
fn lines_drawn_there_and_back_are_one() {
    for (text, want) in [
        ("SP1;PU0,0;PD400,0,0,0;PU", 10.0),
        ("SP1;PU0,0;PD400,0,400,400,400,0,0,0;PU", 20.0),
        ("SP1;PU0,0;EA400,0", 10.0),
        ("SP1;PU0,0;PM0;PD400,0;PM2;EP", 10.0),
    ] {
        assert_eq!(length_and_dots(text), (want, 0), "{text}");
    }
    let there_and_back = lines("SP1;PU400,0;PD;AA0,0,90;AA0,0,-90;PU");
    let length: f64 = there_and_back[0].windows(2).map(|w| math::hypot(w[1][0] - w[0][0], w[1][1] - w[0][1])).sum();
    assert!((length - 5.0 * std::f64::consts::PI).abs() < 2e-3, "{length}");
}
