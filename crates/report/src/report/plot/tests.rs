//! Properties of charts: no text over other text or over the rim, what is drawn lies where it should.

use super::words;
use super::*;
use crate::report::page::{Item, page_html};
use crate::report::table::{Column, Table};
use terrace_core::math;
use terrace_core::random::Random;

/// A text of a chart: its words and the place they take.
#[derive(Clone, Debug)]
struct Word {
    words: String,
    place: [f64; 4],
}

fn number(node: roxmltree::Node<'_, '_>, key: &str) -> f64 {
    node.attribute(key).unwrap_or_else(|| panic!("{key} of {node:?}")).parse().expect("a number")
}

/// All texts of a chart, and its height.
fn texts(plot: &Plot) -> (Vec<Word>, f64) {
    let file = plot.file();
    let document = roxmltree::Document::parse(&file).expect("well-formed");
    let root = document.root_element();
    let view: Vec<f64> = root.attribute("viewBox").expect("a view").split(' ').map(|v| v.parse().expect("v")).collect();
    assert_eq!(view[..3], [0.0, 0.0, WIDTH]);
    let word = |node: roxmltree::Node<'_, '_>| {
        let words: String =
            node.children().filter(|n| n.is_text()).filter_map(|n| n.text()).collect::<String>().trim().to_owned();
        let font = number(node, "font-size");
        let is_bold = node.attribute("font-weight").is_some();
        let wide = if is_bold { words::bold_width(&words, font) } else { words::width(&words, font) };
        let [x, y] = [number(node, "x"), number(node, "y")];
        let left = match node.attribute("text-anchor") {
            Some("end") => x - wide,
            Some("middle") => x - wide / 2.0,
            _ => x,
        };
        // What reaches below the line is lower case; digits and capitals stand on it.
        Word { words, place: [left, y - 0.76 * font, left + wide, y + 0.2 * font] }
    };
    (root.descendants().filter(|n| n.has_tag_name("text")).map(word).collect(), view[3])
}

/// Checks that no text of a chart is cut or covered by another.
fn check(plot: &Plot) -> Vec<Word> {
    let (all, height) = texts(plot);
    for (k, a) in all.iter().enumerate() {
        let [x0, y0, x1, y1] = a.place;
        assert!(x0 >= 0.0 && y0 >= 0.0 && x1 <= WIDTH && y1 <= height, "{a:?} leaves the chart\n{}", plot.file());
        for b in &all[k + 1..] {
            let apart = x1 <= b.place[0] || b.place[2] <= x0 || y1 <= b.place[1] || b.place[3] <= y0;
            assert!(apart, "{a:?} meets {b:?}\n{}", plot.file());
        }
    }
    let file = plot.file();
    let document = roxmltree::Document::parse(&file).expect("well-formed");
    for attribute in document.descendants().flat_map(|n| n.attributes()) {
        assert!(!["NaN", "inf"].iter().any(|bad| attribute.value().contains(bad)), "{attribute:?}");
        assert!(!["href", "id", "class"].contains(&attribute.name()), "{attribute:?}");
    }
    all
}

fn has(words: &[Word], what: &str) -> bool {
    words.iter().any(|w| w.words == what)
}

fn back_off() -> Plot {
    let sigma: Vec<f64> = (1..26).map(|k| 500.0 * f64::from(k) + 703.8).collect();
    let of = |f: &dyn Fn(f64) -> f64| sigma.iter().map(|&s| [s, f(s)]).collect::<Vec<_>>();
    let panel = |name: &str, unit: &str, f: &dyn Fn(f64) -> f64, limit: f64| Panel {
        y: Axis::new(name, unit),
        series: vec![Series::new("Gaussian", of(f)).marked()],
        limits: vec![Limit::new("limit", limit)],
    };
    LineChart {
        title: "How far the filter may go: worst values against the width of the Gaussian".into(),
        x: Axis::new("sigma", "samples"),
        panels: vec![
            panel("FOD", "um", &|s| 100.0 * (s / 13_203.8).powi(2), 100.0),
            panel("BIA", "deg", &|s| 4.0 + s / 3000.0, 10.0),
            panel("displacement", "mm", &|s| s / 7500.0, 5.0),
        ],
        limits: vec![Limit::new("search stops at", 13_203.8)],
    }
    .draw()
}

fn motions() -> Plot {
    let names = [("X", "mm"), ("Y", "mm"), ("Z", "mm"), ("A", "deg"), ("C", "deg"), ("U", "mm"), ("V", "mm")];
    let panels = names
        .iter()
        .enumerate()
        .map(|(k, &(name, unit))| {
            let f = |t: f64, lag: f64| math::sin(t * (1.0 + k as f64) * 0.7 - lag) * 10f64.powi(2 - k as i32);
            let path = |lag: f64| (0..2000).map(|i| f64::from(i) * 0.004).map(|t| [t, f(t, lag)]).collect();
            Panel {
                y: Axis::new(name, unit),
                series: vec![Series::new("commanded", path(0.0)), Series::new("followed", path(0.2))],
                limits: vec![],
            }
        })
        .collect();
    LineChart { title: "Axes over the first 2,000 points".into(), x: Axis::new("time", "s"), panels, limits: vec![] }
        .draw()
}

fn along() -> Plot {
    let wave = |k: usize, a: f64| {
        let t = k as f64 / 150_000.0;
        a * (math::sin(t * 40.0).abs() + 0.2 * math::sin(t * 9000.0).abs() + 0.01)
    };
    let names = [
        "flat field tiling",
        "stepped",
        "zoom",
        "tilted",
        "moving average",
        "seven axes",
        "five axes",
        "optimal",
        "low-pass",
    ];
    let series = names
        .iter()
        .enumerate()
        .map(|(n, name)| {
            let scale = 300.0 / f64::powi(2.0, n as i32);
            Series::new(name, (0..150_000).map(|k| [k as f64 * 0.1, wave(k, scale)]).collect())
        })
        .collect();
    let limits = vec![
        Limit::new("half the depth of focus", 35.0),
        Limit::new("depth of focus", 38.0),
        Limit::new("lens", 400.0),
    ];
    LineChart {
        title: "Distance of the marks from the focus along the path".into(),
        x: Axis::new("path", "mm"),
        panels: vec![Panel { y: Axis::new("FOD", "um").log(), series, limits }],
        limits: vec![],
    }
    .draw()
}

fn bars() -> Plot {
    let row = |name: &str, parts: &[f64]| Bar { name: name.to_owned(), parts: parts.to_vec(), is_hatched: false };
    let hatched = |row: Bar| Bar { is_hatched: true, ..row };
    Bars {
        title: "Where the time goes".into(),
        value: Axis::new("time", "s"),
        parts: ["mark", "jump", "delay", "stage", "settle", "rest", "turning"].map(str::to_owned).to_vec(),
        rows: vec![
            hatched(row("flat field tiling", &[1200.0, 300.0, 80.0, 400.0, 120.0])),
            row("stepped, window", &[1200.0, 500.0, 120.0, 4100.0, 2400.0]),
            row("7-axis on the fly, Gaussian, sigma by bisection", &[1900.0, 0.0, 0.0, 0.0, 0.0, 30.0, 300.0]),
            row("5-axis linkage", &[]),
        ],
    }
    .draw()
}

fn paths() -> Plot {
    let hatch: Vec<[f64; 2]> = (0..120_000)
        .map(|k| {
            let (row, t) = (k / 2000, f64::from(k % 2000) / 2000.0);
            [if row % 2 == 0 { 80.0 * t } else { 80.0 * (1.0 - t) }, f64::from(row)]
        })
        .collect();
    let ring = |r: f64| {
        (0..=900).map(|k| f64::from(k) / 143.2).map(|a| [40.0 + r * math::cos(a), 30.0 + r * math::sin(a)]).collect()
    };
    Paths {
        title: "Path of the marks, and what the stage does of it".into(),
        x: "x".into(),
        y: "y".into(),
        unit: "mm".into(),
        series: vec![
            Series::new("marks", hatch),
            Series::new("stage", ring(22.0)),
            Series::new("first stop", vec![[40.0, 30.0]]).marked(),
        ],
    }
    .draw()
}

fn samples() -> Vec<(&'static str, Plot)> {
    vec![("back_off", back_off()), ("motions", motions()), ("along", along()), ("bars", bars()), ("paths", paths())]
}

#[test]
fn text_is_inside_the_chart_and_does_not_overlap() {
    for (_, plot) in samples() {
        assert!(check(&plot).len() > 5);
    }
}

#[test]
fn the_same_chart_has_the_same_bytes_and_long_series_stay_small() {
    for ((name, a), (_, b)) in samples().into_iter().zip(samples()) {
        assert_eq!(a, b, "{name}");
        assert!(a.file().len() < 400_000, "{name}: {}", a.file().len());
    }
}

#[test]
fn limits_ticks_units_and_names_are_on_the_chart() {
    let words = check(&back_off());
    for what in [
        "FOD, um",
        "BIA, deg",
        "sigma, samples",
        "limit 100 um",
        "limit 10 deg",
        "search stops at 13203.8 samples",
        "Gaussian",
        "2000",
    ] {
        assert!(has(&words, what), "{what}: {words:?}");
    }
}

/// Coordinates of the lines of a colour, in their order.
fn line(plot: &Plot, colour: &str) -> Vec<[f64; 2]> {
    let file = plot.file();
    let document = roxmltree::Document::parse(&file).expect("well-formed");
    let paths = document.descendants().filter(|n| n.has_tag_name("path") && n.attribute("stroke") == Some(colour));
    let d: String = paths.filter_map(|n| n.attribute("d")).collect();
    let at = |pair: &str| {
        let (x, y) = pair.split_once(' ').expect("a pair");
        [x.parse().expect("x"), y.parse().expect("y")]
    };
    d.split(['M', 'L']).filter(|p| !p.is_empty()).map(at).collect()
}

#[test]
fn points_lie_where_the_axes_say() {
    let chart = |x: Axis, points: Vec<[f64; 2]>| {
        let series = vec![Series::new("", points)];
        LineChart {
            title: String::new(),
            x,
            panels: vec![Panel { y: Axis::new("y", ""), series, limits: vec![] }],
            limits: vec![],
        }
    };
    let plot = chart(Axis::new("x", ""), vec![[0.0, 0.0], [5.0, 10.0], [10.0, 5.0]]).draw();
    let line_of = |plot: &Plot| line(plot, &style(0).hex());
    let [a, b, c] = line_of(&plot)[..] else { panic!("three points: {}", plot.file()) };
    assert!((b[0] - a[0] - (c[0] - b[0])).abs() < 0.11, "{a:?} {b:?} {c:?}");
    assert!((a[1] - c[1] - (c[1] - b[1])).abs() < 0.11 && a[1] > b[1], "{a:?} {b:?} {c:?}");
    let plot =
        chart(Axis::new("x", "").log(), vec![[1.0, 1.0], [-1.0, 3.0], [10.0, 2.0], [1000.0, f64::NAN], [100.0, 1.0]])
            .draw();
    // The gaps leave single points, which are discs.
    let discs = plot.file().matches("<circle").count();
    assert_eq!(discs, 3, "{}", plot.file());
}

#[test]
fn extremes_of_a_long_series_are_drawn() {
    let mut points: Vec<[f64; 2]> = (0..300_000).map(|k| [f64::from(k), math::sin(f64::from(k) * 0.01)]).collect();
    points[123_456][1] = 50.0;
    points[123_457][1] = -50.0;
    let panel = Panel { y: Axis::new("y", ""), series: vec![Series::new("a", points)], limits: vec![] };
    let plot = LineChart { title: "t".into(), x: Axis::new("x", ""), panels: vec![panel], limits: vec![] }.draw();
    let mut drawn = line(&plot, &style(0).hex());
    // The first two are the swatch of the legend.
    drawn.drain(..2);
    assert!(drawn.len() < 2 * WIDTH as usize, "{}", drawn.len());
    let [low, high] = [f64::max, f64::min].map(|f| drawn.iter().map(|p| p[1]).reduce(f).expect("points"));
    // 100 of 120 or fewer units of the axis.
    assert!(low - high >= 380.0 * 100.0 / 120.0 - 0.2, "{low} {high}");
    check(&plot);
}

#[test]
fn bars_are_as_long_as_their_parts_and_end_with_their_sum() {
    let words = check(&bars());
    for what in ["35 min 0 s", "2 h 18 min", "37 min 10 s", "-", "flat field tiling", "time, min", "1 h 8 min"] {
        assert!(has(&words, what), "{what}: {words:?}");
    }
    let file = bars().file();
    let document = roxmltree::Document::parse(&file).expect("well-formed");
    let bar = |title: &str| {
        let node = document.descendants().find(|n| n.has_tag_name("title") && n.text() == Some(title));
        number(node.and_then(|n| n.parent()).unwrap_or_else(|| panic!("{title}\n{file}")), "width")
    };
    let [stage, settle] = [bar("stage: 1 h 8 min"), bar("settle: 40 min 0 s")];
    assert!((stage / settle - 4100.0 / 2400.0).abs() < 1e-4, "{stage} {settle}");
}

#[test]
fn a_hatched_bar_is_grey_with_lines_across_it_and_no_colours_of_its_parts() {
    let bar = |name: &str, is_hatched| Bar { name: name.into(), parts: vec![30.0, 20.0], is_hatched };
    let drawn = |rows| {
        let parts = vec!["mark".into(), "jump".into()];
        Bars { title: "t".into(), value: Axis::new("time", "s"), parts, rows }.draw()
    };
    let usual = drawn(vec![bar("a", false)]);
    let hatched = drawn(vec![bar("a", true)]);
    let count = |plot: &Plot, what: &str| plot.file().matches(what).count();
    let grey = hex(crate::report::colour::SPARE);
    assert_eq!([count(&usual, &grey), count(&hatched, &grey)], [0, 2]);
    assert_eq!(count(&hatched, "stroke-width=\"1.5\""), 1);
    // The values in the parts would stand under the lines; the sum stays.
    assert!(has(&check(&usual), "30.0 s") && !has(&check(&hatched), "30.0 s") && has(&check(&hatched), "50.0 s"));
    // Every line of the hatch lies in the bar.
    let file = hatched.file();
    let document = roxmltree::Document::parse(&file).expect("well-formed");
    let parts = document.descendants().filter(|n| n.has_tag_name("rect") && n.attribute("fill") == Some(&grey));
    let parts: Vec<[f64; 4]> =
        parts.map(|n| [number(n, "x"), number(n, "y"), number(n, "width"), number(n, "height")]).collect();
    let [left, top, high] = [parts[0][0], parts[0][1], parts[0][3]];
    let right = parts[1][0] + parts[1][2];
    let hatch = document.descendants().find(|n| n.attribute("stroke-width") == Some("1.5")).expect("a hatch");
    let d = hatch.attribute("d").expect("lines").replace(['M', 'L'], " ");
    let at: Vec<f64> = d.split_whitespace().map(|v| v.parse().expect("a number")).collect();
    assert!(at.len() > 40);
    for p in at.chunks_exact(2) {
        assert!(p[0] >= left - 0.1 && p[0] <= right + 0.1 && p[1] >= top - 0.1 && p[1] <= top + high + 0.1, "{p:?}");
    }
}

#[test]
fn a_path_has_equal_scales() {
    let square = vec![[0.0, 0.0], [3.0, 0.0], [3.0, 1.0], [0.0, 1.0], [0.0, 0.0]];
    for far in [0.0, 50.0, 0.0001] {
        let dot = Series::new("", vec![[far, 0.0], [0.0, far]]).marked();
        let series = vec![Series::new("", square.clone()), dot];
        let plot = Paths { title: "t".into(), x: "x".into(), y: "y".into(), unit: "mm".into(), series }.draw();
        check(&plot);
        let p = line(&plot, &style(0).hex());
        let [wide, high] = [p[1][0] - p[0][0], p[1][1] - p[2][1]];
        assert!((wide - 3.0 * high).abs() < 0.6, "{far}: {wide} {high}");
    }
}

#[test]
fn colours_differ_in_grey() {
    let lightness = |c: [u8; 3]| {
        let [r, g, b] = c.map(|v| math::pow(f64::from(v) / 255.0, 2.2));
        116.0 * math::cbrt(0.2126 * r + 0.7152 * g + 0.0722 * b) - 16.0
    };
    for a in 0..16 {
        for b in 0..a {
            let [s, t] = [style(a), style(b)];
            let far = (lightness(s.colour) - lightness(t.colour)).abs();
            assert!(s.dash != t.dash || far >= 10.0, "{b} and {a}: {far}");
            assert!(s.colour != t.colour || s.dash != t.dash);
        }
        assert!(lightness(style(a).colour) < 68.0, "{a} is read on white");
    }
}

#[test]
fn charts_without_values_say_so() {
    let panel = || Panel {
        y: Axis::new("y", "um").log(),
        series: vec![Series::new("a", vec![[f64::NAN, 1.0], [1.0, -2.0]])],
        limits: vec![],
    };
    let plot =
        LineChart { title: "t".into(), x: Axis::new("x", ""), panels: vec![panel(), panel()], limits: vec![] }.draw();
    assert_eq!(check(&plot).iter().filter(|w| w.words == "no values").count(), 2);
    let none = Paths { title: String::new(), x: "x".into(), y: "y".into(), unit: String::new(), series: vec![] };
    assert!(has(&check(&none.draw()), "no values"));
    let bars = Bars { title: "t".into(), value: Axis::new("n", "um"), parts: vec![], rows: vec![] };
    check(&bars.draw());
}

/// Whatever the numbers and the names.
#[test]
fn charts_of_random_data_are_well_formed() {
    for seed in 0..120 {
        // Shown where a check fails.
        eprintln!("seed {seed}");
        let mut noise = Random::case(seed);
        let title = noise.text(160);
        let names: Vec<String> = (0..noise.between(1, 11)).map(|_| noise.words(90, "µ±°<&\"")).collect();
        let limits: Vec<(f64, String)> =
            (0..noise.below(9)).map(|_| (noise.float(), noise.words(40, "<&\""))).collect();
        let points: Vec<[f64; 2]> = (0..noise.below(40)).map(|_| [noise.float(), noise.float()]).collect();
        let by = 10f64.powi(noise.between(-12, 11) as i32);
        let logs = [noise.chance(50), noise.chance(50)];
        let axis = |name: &str, is_log| if is_log { Axis::new(name, "mm").log() } else { Axis::new(name, "mm") };
        let place = |k: usize, [x, y]: [f64; 2]| [x * by, math::atan(y) * by + k as f64];
        let series: Vec<Series> = names
            .iter()
            .enumerate()
            .map(|(k, n)| Series::new(n, points.iter().map(|p| place(k, *p)).collect()).marked())
            .collect();
        let limits: Vec<Limit> = limits.iter().map(|l| Limit::new(&l.1, math::atan(l.0) * by)).collect();
        let panel =
            |k: usize| Panel { y: axis(&names[0], logs[0]), series: series[k..].to_vec(), limits: limits.clone() };
        let x = axis(&title, logs[1]);
        let panels = vec![panel(0), panel(1)];
        check(&LineChart { title: title.clone(), x: x.clone(), panels, limits }.draw());
        let parts: Vec<f64> = points.iter().map(|p| math::atan(p[0]) * by).collect();
        let bar =
            |(k, name): (usize, &String)| Bar { name: name.clone(), parts: parts.clone(), is_hatched: k % 2 == 1 };
        let rows = names.iter().enumerate().map(bar).collect();
        check(&Bars { title: title.clone(), value: x, parts: names, rows }.draw());
        check(&Paths { title: title.clone(), x: title.clone(), y: title, unit: "mm".into(), series }.draw());
    }
}

#[test]
fn page_is_self_contained() {
    let mut table = Table::new(
        "Systems & times",
        vec![Column::text("system"), Column::time("time"), Column::number("FOD", "um", 1)],
    );
    table.row(["<stepped>".into(), 4.24.into(), None::<f64>.into()]);
    let plots = samples();
    let mut items =
        vec![Item::Heading("A < B"), Item::Text("Words & more"), Item::Warning("not <proved>"), Item::Table(&table)];
    items.extend(plots.iter().map(|(_, p)| Item::Plot(p)));
    let page = page_html("Step or follow?", &items);
    let body = page.strip_prefix("<!DOCTYPE html>\n").expect("HTML");
    let document = roxmltree::Document::parse(body).expect("well-formed, so any reader shows it alike");
    assert_eq!(
        document.descendants().filter(|n| n.has_tag_name(("http://www.w3.org/2000/svg", "svg"))).count(),
        plots.len()
    );
    let cells: Vec<&str> = document.descendants().filter(|n| n.has_tag_name("td")).filter_map(|n| n.text()).collect();
    assert_eq!(cells, ["<stepped>", "4.2 s", "-"]);
    for outside in ["src=", "href=", "<script", "@import", "url(", " id="] {
        assert!(!page.contains(outside), "{outside}");
    }
    assert!(page.contains("<caption>Systems &amp; times</caption>") && page.contains("name=\"viewport\""));
}
