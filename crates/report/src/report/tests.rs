//! Properties of the drawing and of the report, on made-up jobs.

use std::collections::{BTreeMap, BTreeSet};
use terrace_core::math;

use super::blocks::TIERS;
use super::layout::{LIMIT, SharedShapes, within};
use super::outline::{PaddedMap, area2, simplify, trace};
use super::sample::Sample;
use super::{EnergyMap, NOT_VERIFIED, layout_svg, report_html};
use terrace_core::geom::{Box2, FieldPoint, Nm, P2};
use terrace_core::machine::{LoadingWay, Origin};
use terrace_core::random::Random;
use terrace_plan::block_map::BlockMap;
use terrace_plan::manifest::Loading;

fn report(sample: &Sample) -> String {
    let layout = sample.layout();
    report_html(&layout, &EnergyMap::of(&layout))
}

fn map(columns: u32, labels: &[u32]) -> BlockMap {
    let rows = labels.len() as u32 / columns;
    let hi = P2::new(i64::from(columns) * 1000 - 1, i64::from(rows) * 1000 - 1);
    let mut map = BlockMap::blank(Box2 { lo: P2::new(0, 0), hi }, Nm(1000));
    assert_eq!(map.size(), [columns, rows]);
    map.labels_mut().copy_from_slice(labels);
    map
}

/// Every ring closed and rectilinear, areas of each block's rings equal to its cells.
fn check_outlines(map: &BlockMap, blocks: usize) {
    let outlines = trace(&PaddedMap::of(map, blocks));
    let mut area: BTreeMap<u32, i64> = BTreeMap::new();
    for ring in &outlines.rings {
        let corners = outlines.corners_of(ring);
        assert!(corners.len() >= 4, "{corners:?}");
        for (a, b) in corners.iter().zip(corners.iter().cycle().skip(1)) {
            assert!((a.at[0] == b.at[0]) != (a.at[1] == b.at[1]), "{a:?} {b:?}");
        }
        *area.entry(ring.block).or_default() += area2(corners.iter().map(|c| c.at));
    }
    let mut cells: BTreeMap<u32, i64> = BTreeMap::new();
    for &label in map.labels().iter().filter(|&&l| l != 0 && l as usize <= blocks) {
        *cells.entry(label - 1).or_default() += 2;
    }
    assert_eq!(area, cells);
}

#[test]
fn traced_area_is_the_area_of_the_cells() {
    for seed in 0..200 {
        // Shown where the check fails.
        eprintln!("seed {seed}");
        let mut noise = Random::case(seed);
        let columns = noise.between(1, 11) as u32;
        let labels: Vec<u32> = (0..noise.between(12, 119)).map(|_| noise.below(5) as u32).collect();
        let whole = labels.len() / columns as usize * columns as usize;
        check_outlines(&map(columns, &labels[..whole]), 3);
    }
}

/// What two neighbours draw along their border is the same: each edge inside the map is drawn
/// once forth and once back. Blocks are the cells nearest to random sites.
#[test]
fn neighbours_share_the_simplified_border() {
    let mut tried = 0;
    for seed in 0..250 {
        let mut noise = Random::case(seed);
        let sites: Vec<(i32, i32)> =
            (0..noise.between(3, 13)).map(|_| (noise.below(64) as i32, noise.below(64) as i32)).collect();
        let tolerance = noise.range(0.3, 1.0);
        let nearest = |x: i32, y: i32| {
            let site = (0..sites.len()).min_by_key(|&k| (sites[k].0 - x).pow(2) + (sites[k].1 - y).pow(2));
            site.expect("a site") as u32 + 1
        };
        let labels: Vec<u32> = (0..64 * 64).map(|i| nearest(i % 64, i / 64)).collect();
        let outlines = trace(&PaddedMap::of(&map(64, &labels), sites.len()));
        let mut edges: BTreeMap<([i32; 2], [i32; 2]), i32> = BTreeMap::new();
        let mut points = Vec::new();
        let mut has_sliver = false;
        for ring in &outlines.rings {
            let corners = outlines.corners_of(ring);
            simplify(corners, tolerance, &mut points);
            has_sliver |= points.iter().copied().eq(corners.iter().map(|c| c.at.map(|v| 2 * v)));
            for (a, b) in points.iter().zip(points.iter().cycle().skip(1)) {
                *edges.entry((*a.min(b), *a.max(b))).or_default() += if a < b { 1 } else { -1 };
            }
        }
        // A sliver that keeps its corners has a border of its own.
        if has_sliver {
            continue;
        }
        tried += 1;
        // The rim of the map has a block on one side only; in half cells it is at 2 and 130, and a
        // border may cut its corners by a cell.
        let on_rim = |a: &[i32; 2], b: &[i32; 2]| (0..2).any(|k| a[k].max(b[k]) <= 4 || a[k].min(b[k]) >= 128);
        for ((a, b), n) in &edges {
            assert!(*n == 0 || on_rim(a, b), "seed {seed}: the edge from {a:?} to {b:?} is drawn by one side only");
        }
    }
    assert!(tried >= 200, "{tried} maps without slivers");
}

#[test]
fn holes_single_cells_and_corner_contacts() {
    check_outlines(&map(1, &[1]), 1);
    check_outlines(&map(5, &[1, 1, 1, 1, 1, 1, 0, 2, 0, 1, 1, 2, 1, 2, 1, 1, 0, 2, 0, 1, 1, 1, 1, 1, 1]), 2);
    let outlines = trace(&PaddedMap::of(&map(3, &[1, 1, 1, 1, 0, 1, 1, 1, 1]), 1));
    let areas: Vec<_> = outlines.rings.iter().map(|r| area2(outlines.corners_of(r).iter().map(|c| c.at))).collect();
    assert_eq!(areas, [18, -2], "the hole runs the other way");
}

#[test]
fn a_rectangle_keeps_its_corners_and_a_disc_few_points_within_half_a_cell() {
    let rectangle = trace(&PaddedMap::of(&map(40, &[1; 1200]), 1));
    let mut points = Vec::new();
    simplify(rectangle.corners_of(&rectangle.rings[0]), 0.5, &mut points);
    assert_eq!(points.iter().collect::<BTreeSet<_>>(), BTreeSet::from([&[2, 2], &[82, 2], &[82, 62], &[2, 62]]));

    let (n, r) = (200i32, 90.3);
    let distance = |x: f64, y: f64| math::hypot(x - 100.0, y - 100.0);
    let labels: Vec<u32> =
        (0..n * n).map(|i| u32::from(distance(f64::from(i % n) + 0.5, f64::from(i / n) + 0.5) < r)).collect();
    let disc = trace(&PaddedMap::of(&map(200, &labels), 1));
    simplify(disc.corners_of(&disc.rings[0]), 0.5, &mut points);
    assert!(points.len() < 50, "{} points", points.len());
    for (a, b) in points.iter().zip(points.iter().cycle().skip(1)) {
        for t in [0.0, 0.25, 0.5, 0.75] {
            let at = |k: usize| (f64::from(a[k]) + t * f64::from(b[k] - a[k])) / 2.0 - 1.0;
            let off = (distance(at(0), at(1)) - r).abs();
            assert!(off <= 1.0, "{off} cells off the circle");
        }
    }
}

/// The ids of all elements; fails on XML that is not well-formed and on an id used twice.
fn ids(svg: &str) -> BTreeSet<String> {
    let document = roxmltree::Document::parse(svg).expect("well-formed");
    let mut ids = BTreeSet::new();
    for id in document.descendants().filter_map(|n| n.attribute("id")) {
        assert!(ids.insert(id.to_owned()), "id {id} twice");
    }
    ids
}

/// Area that a block's path encloses, mm², from the text of the file.
fn path_area(d: &str) -> f64 {
    let (mut sum, mut at, mut start) = (0.0, [0.0; 2], [0.0; 2]);
    let number = |s: &str| s.parse::<f64>().expect("a number");
    for part in d.split_inclusive(|c: char| c.is_ascii_alphabetic()).collect::<Vec<_>>().windows(2) {
        let command = part[0].chars().last().expect("a command");
        let body = part[1].trim_end_matches(|c: char| c.is_ascii_alphabetic());
        let cut = body.char_indices().skip(1).find(|(_, c)| matches!(c, '-' | ' ')).map_or(body.len(), |(i, _)| i);
        let pair = |s: &str| [number(&s[..cut]), number(s[cut..].trim())];
        let to = match command {
            'M' => {
                start = pair(body);
                at = start;
                start
            }
            'l' => [at[0] + pair(body)[0], at[1] + pair(body)[1]],
            'h' => [at[0] + number(body), at[1]],
            'v' => [at[0], at[1] + number(body)],
            'z' => continue,
            other => panic!("command {other}"),
        };
        sum += (at[0] - start[0]) * (to[1] - start[1]) - (to[0] - start[0]) * (at[1] - start[1]);
        at = to;
    }
    // y points down in the file, so a counter-clockwise ring comes out negative.
    -sum / 2.0
}

#[test]
#[ignore = "slow: make test-all"]
fn the_dome_of_3500_blocks_fits_the_budget_and_shows_every_block() {
    let sample = Sample::dome().with_sliver();
    let blocks = sample.checked.program().blocks.len();
    assert!((3_400..3_700).contains(&blocks), "{blocks} blocks");
    let svg = layout_svg(&sample.layout());
    assert!(svg.len() < LIMIT.min(900 * blocks), "{} bytes", svg.len());
    let ids = ids(&svg);
    assert!((0..blocks).all(|i| ids.contains(&format!("block-B{:04}", i + 1))));

    let document = roxmltree::Document::parse(&svg).expect("well-formed");
    let blocks_layer = document.descendants().find(|n| n.attribute("id") == Some("layer-blocks")).expect("layer");
    let area: f64 = blocks_layer.children().filter_map(|n| n.attribute("d")).map(path_area).sum();
    assert!((area - 450.0 * 450.0).abs() < 0.5, "the blocks tile the part: {area} mm2");
    assert_eq!(blocks_layer.children().filter(|n| n.attribute("class") == Some("sliver")).count(), 1);
    // Every number is in the class of its size, and none is too small for a sheet of 4,000 px.
    let width = view_box(&document)[2];
    let mut counts = [0; TIERS.len()];
    for (k, (class, least, px)) in TIERS.into_iter().enumerate() {
        let tier = document.descendants().find(|n| n.attribute("class") == Some(class)).expect("a class");
        let sizes = tier.children().filter_map(|n| n.attribute("font-size")?.parse::<f64>().ok());
        let most = if k == 0 { f64::INFINITY } else { TIERS[k - 1].1 };
        for size in sizes.map(|size| 100.0 * size / width) {
            assert!((least - 1e-3..most + 1e-3).contains(&size), "{class}: {size}");
            assert!(size / 100.0 * f64::from(px) > 6.9, "{class} at {px} px");
            counts[k] += 1;
        }
    }
    assert!(counts[1..].iter().sum::<i32>() > 2 * counts[0], "most of 3,500 numbers need a large sheet: {counts:?}");

    let html = report(&sample);
    assert!(html.len() < 3_000_000, "{} bytes", html.len());
    assert_eq!(html.matches("<tr><td>B").count(), blocks);
}

#[test]
fn drawing_is_to_scale() {
    let sample = Sample::flat();
    let svg = layout_svg(&sample.layout());
    let document = roxmltree::Document::parse(&svg).expect("well-formed");
    let root = document.root_element();
    // It fills any window: a shape, and no size.
    assert!(view_box(&document)[2] > 30.0 && root.attribute("width").is_none() && root.attribute("height").is_none());
    let block = document.descendants().find(|n| n.attribute("id") == Some("block-B0001")).expect("block");
    let d = block.attribute("d").expect("path");
    assert_eq!(path_area(d), 600.0);
    assert_eq!(d, "M15 10v-20h-30v20z");
    let title = block.children().find(|n| n.has_tag_name(("http://www.w3.org/2000/svg", "title"))).expect("tooltip");
    let words = title.text().expect("text");
    for needed in ["B0001", "section 0,0", "level 0", "LPFL", "stage x", "strokes", "mark ", "jump "] {
        assert!(words.contains(needed), "{needed} in {words}");
    }
}

fn view_box(document: &roxmltree::Document<'_>) -> [f64; 4] {
    let words = document.root_element().attribute("viewBox").expect("viewBox").split(' ');
    let all: Vec<f64> = words.map(|v| v.parse().expect("a number")).collect();
    [all[0], all[1], all[2], all[3]]
}

#[test]
fn the_legend_stays_off_the_part_and_on_the_sheet() {
    let strip = |size: [f64; 2]| Sample::of("strip", size, 0.07, Nm(1_000_000), |x, _| x * 1e-4);
    for mut sample in [Sample::flat(), Sample::ripple(), strip([900.0, 60.0]), strip([60.0, 700.0])] {
        sample.name = "a name of a job that is much too long for any of the columns of a legend".into();
        let svg = layout_svg(&sample.layout());
        let document = roxmltree::Document::parse(&svg).expect("well-formed");
        let view = view_box(&document);
        let tree = super::raster::tree(&svg, 480).expect("a drawing");
        let legend = tree.node_by_id("layer-legend").expect("a legend");
        // The tree begins at 0, the drawing at the corner of its view.
        let [x1, y1] = sample.texture.hi.mm();
        let right = x1 - view[0];
        let foot = y1 - view[1];
        let mut open = vec![legend];
        let mut seen = 0;
        while let Some(node) = open.pop() {
            if let resvg::usvg::Node::Group(group) = node {
                open.extend(group.children());
            }
            if let resvg::usvg::Node::Text(text) = node {
                let b = text.abs_bounding_box();
                let [l, t, r, low] = [b.left(), b.top(), b.right(), b.bottom()].map(f64::from);
                assert!(l > right || t > foot, "{:?} on the part", text.chunks()[0].text());
                assert!(l >= 0.0 && t >= 0.0 && r <= view[2] && low <= view[3], "{:?}", text.chunks()[0].text());
                seen += 1;
            }
        }
        assert!(seen > 20, "{seen} texts");
    }
}

#[test]
fn equal_input_gives_equal_bytes_and_no_job_name_breaks_the_files() {
    let mut sample = Sample::ripple();
    assert_eq!(layout_svg(&sample.layout()), layout_svg(&sample.layout()));
    sample.name = "</title><script>alert(1)</script> & \"quoted\" \u{1} ".repeat(20);
    let svg = layout_svg(&sample.layout());
    let html = report(&sample);
    ids(&svg);
    assert!(!html.contains("<script") && !svg.contains("<script"));
    assert!(!html.contains('\u{1}'));
}

#[test]
fn empty_program_and_random_map_are_drawn() {
    let mut sample = Sample::flat();
    sample.checked = terrace_plan::check::Checked::unchecked(Default::default(), Origin([0; 3]));
    sample = sample.with_scene();
    ids(&layout_svg(&sample.layout()));
    report(&sample);
    sample = Sample::flat();
    sample.map.labels_mut().fill(u32::MAX);
    sample.map = BlockMap::blank(Box2::EMPTY, Nm(0));
    sample.texture = Box2::EMPTY;
    let svg = layout_svg(&sample.layout());
    assert!(svg.contains("sliver"));
    ids(&svg);
}

#[test]
#[ignore = "slow: make test-all"]
fn a_drawing_too_large_is_simplified_until_it_fits() {
    let sample = Sample::of("dome", [180.0, 180.0], 0.07, Nm(250_000), |x, y| -(x * x + y * y) / 10_000.0);
    let whole = layout_svg(&sample.layout()).len();
    let mut last = whole;
    for limit in [whole - 1, whole * 7 / 10] {
        let svg = within(&sample.layout(), &SharedShapes::of(&sample.layout()), limit);
        ids(&svg);
        assert!(svg.len() <= limit && svg.len() < last, "{} bytes of {limit}", svg.len());
        assert_eq!(svg.matches("id=\"block-").count(), sample.checked.program().blocks.len());
        last = svg.len();
    }
    assert!(
        within(&sample.layout(), &SharedShapes::of(&sample.layout()), 0).len() <= last,
        "the coarsest where none fits"
    );
}

/// A map of nothing but specks, as no partition makes it: the drawing stays small, every block is there.
#[test]
#[ignore = "slow: make test-all"]
fn size_of_the_drawing_is_bounded_for_single_cell_blocks() {
    let mut sample = Sample::of("specks", [100.0, 100.0], 0.07, Nm(250_000), |x, y| x * 0.04 + y * 0.03);
    let blocks = sample.checked.program().blocks.len() as u32;
    let mut random = Random::new(1);
    for label in sample.map.labels_mut() {
        *label = random.below(blocks as usize) as u32 + 1;
    }
    let whole = within(&sample.layout(), &SharedShapes::of(&sample.layout()), usize::MAX).len();
    let svg = within(&sample.layout(), &SharedShapes::of(&sample.layout()), whole / 4);
    assert!(svg.len() <= whole / 4, "{} bytes of {whole}", svg.len());
    assert_eq!(svg.matches("id=\"block-").count(), blocks as usize);
}

#[test]
#[ignore = "slow: make test-all"]
fn windows_that_lie_freely_fit_the_budget_and_show_every_block() {
    let sample = Sample::dome_of_windows();
    let program = sample.checked.program();
    let blocks = program.blocks.len();
    assert!((3_000..4_000).contains(&blocks), "{blocks} blocks");
    let svg = layout_svg(&sample.layout());
    assert!(svg.len() < LIMIT, "{} bytes", svg.len());
    let found = ids(&svg);
    assert!((0..blocks).all(|i| found.contains(&format!("block-B{:04}", i + 1))));
    assert!(!found.contains("layer-sections") && found.contains("window"));

    let document = roxmltree::Document::parse(&svg).expect("well-formed");
    let by_id = |id: &str| document.descendants().find(|n| n.attribute("id") == Some(id)).expect("an element");
    // Every block has its window, around its centre; nothing of the layer is seen without a pointer.
    let windows = by_id("layer-windows");
    assert_eq!(windows.attribute("visibility"), Some("hidden"));
    let groups: Vec<_> = windows.children().filter(|n| n.tag_name().name() == "g").collect();
    assert_eq!(groups.len(), blocks);
    for (i, (g, block)) in groups.iter().zip(&program.blocks).enumerate() {
        let uses: Vec<_> = g.children().filter(|n| n.tag_name().name() == "use").collect();
        assert_eq!(uses[0].attribute("href"), Some(format!("#block-B{:04}", i + 1).as_str()));
        assert_eq!(uses[1].attribute("href"), Some("#window"));
        let at = |k: &str| uses[1].attribute(k).and_then(|v| v.parse::<f64>().ok()).expect("a place");
        let [x, y] = block.stop.centre.mm();
        assert!((at("x") - x).abs() <= 5e-4 && (at("y") + y).abs() <= 5e-4);
        let title = g.children().find(|n| n.tag_name().name() == "title").and_then(|n| n.text()).expect("a tooltip");
        assert!(title.starts_with(&format!("B{:04}: window at x ", i + 1)), "{title}");
    }
    // The path goes through the centres, thin enough to see what lies under it.
    let line = by_id("stage-line");
    assert_eq!(line.attribute("d").expect("a path").matches(['M', 'l']).count(), blocks);
    let width: f64 = line.attribute("stroke-width").and_then(|w| w.parse().ok()).expect("a width");
    assert!(width < 0.5, "{width} mm");
    assert!(!found.contains("stage-stops"));
    let html = report(&sample);
    assert!(html.contains("<th>window x</th>") && html.contains("windows lie freely"));
    assert_eq!(html.matches("<tr><td>B").count(), blocks);
}

#[test]
fn stops_on_the_grid_show_sections_and_no_windows() {
    let sample = Sample::ripple();
    let svg = layout_svg(&sample.layout());
    let found = ids(&svg);
    assert!(found.contains("layer-sections") && !found.contains("layer-windows"));
    assert!(report(&sample).contains("<th>section</th>"));
}

#[test]
fn the_report_begins_with_what_needs_attention_and_a_picture() {
    let mut sample = Sample::flat();
    let s = &mut sample.summary;
    (s.texture_mm, s.mark_mm) = (2000.0, 1890.0);
    (s.skipped_mm, s.skipped_off_part_mm, s.skipped_steep_mm, s.skipped_small_mm) = (110.0, 100.0, 0.0, 10.0);
    s.loading = Loading { way: LoadingWay::Person, assumed: true, load_s: 15.0, load_assumed: true, total_s: 725.2 };
    let html = report(&sample);
    let count =
        if sample.summary.blocks == 1 { "1 block".to_owned() } else { format!("{} blocks", sample.summary.blocks) };
    for said in [
        "<li>Not marked of 2000.0 mm: off the part 100.0 mm (5.0 %), too small 10.0 mm (0.5 %).</li>".to_owned(),
        format!(
            "<li>A person attends 12 min 5 s: a person loads and starts {count}, 15 s each (assumed: state \
             operator.way and operator.load in the machine file).</li>"
        ),
        "<a href=\"view.html\"><img src=\"layout.svg\" alt=\"Blocks over the part".to_owned(),
    ] {
        assert!(html.contains(&said), "{said}\n{}", &html[..4000.min(html.len())]);
    }
    // Before all else, and every table in a box that scrolls.
    let at = |what: &str| html.find(what).expect("there");
    assert!(at("</h1>") < at("<img ") && at("<img ") < at("class=\"verdict\"") && at("class=\"verdict\"") < at("<h2>"));
    assert!(html.contains(&format!("<li>{NOT_VERIFIED}</li>")));
    assert_eq!(html.matches("<div class=\"wide\"><table").count(), html.matches("<table").count());
    assert_eq!(html.matches("</table></div>").count(), html.matches("<table").count());
    sample.summary.warnings.clear();
    (sample.summary.skipped_off_part_mm, sample.summary.skipped_small_mm) = (0.0, 0.0);
    sample.summary.loading.way = LoadingWay::Ovf;
    sample.summary.loading.load_assumed = false;
    let html = report(&sample);
    for said in [
        "<li>No warnings.</li>",
        "<li>All of the texture is marked: 2000.0 mm.</li>",
        "<li>A person attends 12 min 5 s: a controller reads job.ovf and marks ",
    ] {
        assert!(html.contains(said), "{said}");
    }
}

/// On a turned part the frame is turned with it, around the marks.
#[test]
fn the_frame_of_a_turned_part_is_turned() {
    let mut sample = Sample::windows("slope", [60.0, 40.0], 0.1, |x, y| 0.01 * x + 0.004 * y);
    let frame = |sample: &Sample| -> Vec<[f64; 2]> {
        let svg = layout_svg(&sample.layout());
        let document = roxmltree::Document::parse(&svg).expect("well-formed");
        let path = document.descendants().find(|n| n.attribute("id") == Some("texture-box")).expect("a frame");
        let d = path.attribute("d").expect("a path").trim_matches(['M', 'z']);
        let number = |v: &str| v.parse::<f64>().expect("a number");
        d.split('L').map(|p| p.split_once(' ').expect("two")).map(|(x, y)| [number(x), number(y)]).collect()
    };
    assert_eq!(frame(&sample), [[-30.0, 20.0], [30.0, 20.0], [30.0, -20.0], [-30.0, -20.0]]);
    // The marks reach from -29.75 to 29.75 and from -19.5 to 19.5; turned by 30 degrees about the origin.
    let (sin, cos) = math::sin_cos(30f64.to_radians());
    let mut program = sample.checked.program().clone();
    for block in &mut program.blocks {
        let [x, y] = block.stop.centre.mm();
        let turned = |x: f64, y: f64| P2::from_mm(x * cos - y * sin, x * sin + y * cos).expect("a length");
        block.stop.centre = turned(x, y);
        for stroke in &program.strokes[block.strokes.clone()] {
            for p in &mut program.points[stroke.first as usize..(stroke.first + stroke.len) as usize] {
                let at = turned(f64::from(p.x) / 1e6, f64::from(p.y) / 1e6);
                *p = FieldPoint::new(at.x as i32, at.y as i32);
            }
        }
    }
    sample.checked = terrace_plan::check::Checked::unchecked(program, Origin([0; 3]));
    sample.turn_rad = 30f64.to_radians();
    let sample = sample.with_scene();
    let want = [[-29.75, -19.5], [29.75, -19.5], [29.75, 19.5], [-29.75, 19.5]];
    for ([x, y], [u, v]) in frame(&sample).into_iter().zip(want) {
        let (u, v) = (u * cos - v * sin, -(u * sin + v * cos));
        assert!((x - u).abs() < 2e-3 && (y - v).abs() < 2e-3, "{x} {y}, {u} {v}");
    }
    let svg = layout_svg(&sample.layout());
    for words in ["marks, turned", "59.5 x 39.0 mm", "30 deg"] {
        assert!(svg.contains(&format!(">{words}<")), "{words}");
    }
}

#[test]
fn a_page_and_pixels_are_the_same_each_time_and_as_large_as_asked() {
    let svg = layout_svg(&Sample::ripple().layout());
    let page = super::pdf(&svg).expect("a page");
    assert!(page.starts_with(b"%PDF-") && page == super::pdf(&svg).expect("a page"));
    // A4, across.
    let text = String::from_utf8_lossy(&page);
    let size = text.split_once("/MediaBox [0 0 ").and_then(|(_, rest)| rest.split_once(']')).expect("a size").0;
    let size: Vec<f64> = size.split(' ').map(|v| v.parse::<f64>().expect("points") * 25.4 / 72.0).collect();
    assert!((size[0] - 297.0).abs() < 0.01 && (size[1] - 210.0).abs() < 0.01, "{size:?} mm");
    let pixels = super::png(&svg, 333).expect("pixels");
    assert_eq!(pixels, super::png(&svg, 333).expect("pixels"));
    let reader = png::Decoder::new(std::io::Cursor::new(&pixels)).read_info().expect("a PNG");
    let view = view_box(&roxmltree::Document::parse(&svg).expect("well-formed"));
    let height = (333.0 * view[3] / view[2]).round() as u32;
    assert_eq!((reader.info().width, reader.info().height), (333, height));
    for width in [0, 20_001] {
        assert_eq!(super::png(&svg, width).expect_err("no such picture").diags()[0].code, "picture-size");
    }
}

#[test]
fn numbers_of_a_larger_picture_are_more() {
    let svg =
        layout_svg(&Sample::of("dome", [180.0, 180.0], 0.07, Nm(250_000), |x, y| -(x * x + y * y) / 1e4).layout());
    let count = |width: u32| {
        let tree = super::raster::tree(&svg, width).expect("a drawing");
        let Some(resvg::usvg::Node::Group(layer)) = tree.node_by_id("layer-numbers") else { return 0 };
        let of = |node: &resvg::usvg::Node| if let resvg::usvg::Node::Group(g) = node { g.children().len() } else { 1 };
        layer.children().iter().map(of).sum()
    };
    let counts = [480, 1200, 4000].map(count);
    assert!(counts[0] > 0 && counts[0] < counts[1] && counts[1] < counts[2], "{counts:?}");
}
