//! What `terrace inspect` shows of surfaces, drawings, bitmaps, space curves, job files and job folders.

use std::path::Path;

use serde_json::Value;

use crate::cli::{DRAWING, done, job_folder_fixture, json, refused, run, write};
use crate::support::{JobText, fixture, said};

#[test]
fn inspect_describes_surfaces_drawings_jobs_and_folders() {
    let dir = job_folder_fixture();
    let at = dir.path();
    done(at, &["compile", "a.toml", "--json"]);
    write(at.join("a.svg"), DRAWING);
    write(at.join("unsized.svg"), DRAWING.replace("width=\"8mm\" height=\"8mm\" ", ""));
    let facet = "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 2 0 0\nvertex 0 3 1\nendloop\nendfacet\n";
    write(at.join("a.stl"), format!("solid a\n{facet}endsolid a\n"));
    write(at.join("a.png"), crate::support::image::height_map(3, &[7, 9, 256, 7, 7, 7]));
    write(at.join("a.asc"), "ncols 2\nnrows 3\nxllcenter 1\nyllcenter 2\ncellsize 60\n1 2\n3 -9999\n5 6.5\n");
    write(at.join("land.asc"), "ncols 2\nnrows 2\nxllcorner 5e5\nyllcorner 5e6\ncellsize 60\n1 2\n3 4\n");
    write(at.join("own.3mf"), std::fs::read(fixture("bad/3mf_path_traversal.3mf")).expect("a fixture"));
    let shown = |args: &[&str]| json(&done(at, &[&["inspect", "--json"], args].concat()));
    let stl = shown(&["a.stl", "--unit", "mm"]);
    assert_eq!((&stl["kind"], &stl["facets"]), (&"surface".into(), &1.into()));
    assert_eq!(stl["hi_mm"], serde_json::json!([2.0, 3.0, 1.0]));
    assert_eq!((&stl["steep_percent"], &stl["down_percent"]), (&0.0.into(), &0.0.into()));
    // Without a unit nothing is said to be mm; 3 in is a part, 3 mm is not.
    let stl = shown(&["a.stl"]);
    assert_eq!((&stl["hi"], &stl["hi_mm"]), (&serde_json::json!([2.0, 3.0, 1.0]), &Value::Null));
    assert_eq!((&stl["unit"], &stl["likely_unit"]), (&Value::Null, &"in".into()));
    assert!((shown(&["a.stl", "--unit", "in"])["hi_mm"][0].as_f64().expect("a number") - 50.8).abs() < 1e-9);
    let svg = shown(&["a.svg"]);
    let length = 12.0 + 72f64.sqrt();
    assert_eq!((&svg["kind"], &svg["strokes"], &svg["physical_size"]), (&"drawing".into(), &1.into(), &true.into()));
    assert!((svg["length_mm"].as_f64().expect("a number") - length).abs() < 1e-5, "{svg}");
    let bare = shown(&["unsized.svg"]);
    assert_eq!((&bare["physical_size"], &bare["length_mm"]), (&false.into(), &Value::Null));
    let text = said(&run(at, &["inspect", "unsized.svg"]));
    assert!(text.contains("no physical size") && !text.contains("stretched") && !text.contains("100"), "{text}");
    let png = shown(&["a.png"]);
    assert_eq!((&png["kind"], &png["columns"], &png["rows"]), (&"heightmap".into(), &3.into(), &2.into()));
    assert_eq!(png["values"], serde_json::json!([7, 256]));
    assert_eq!((&png["bitmap"]["columns"], &png["bitmap"]["dpi"]), (&3.into(), &Value::Null));
    let job = shown(&["a.toml"]);
    assert_eq!((&job["kind"], &job["pdof_mm"], &job["machine"]), (&"job".into(), &0.07.into(), &"xyz-galvo-40".into()));
    let made = shown(&["a.job"]);
    assert_eq!((&made["kind"], &made["summary"]["stops"]), (&"folder".into(), &1.into()));
    for (file, say) in [
        ("a.stl", "size  2.0000 x 3.0000 x 1.0000 (the file does not state its unit)\n"),
        ("a.stl", "  if in  50.8000 x 76.2000 x 25.4000 mm   <- most likely\n"),
        ("a.stl", "0 % of the area steeper than 30 deg, 0 % facing down\n"),
        ("a.svg", "1 stroke (1 closed)"),
        ("a.png", "3 x 2 samples, values 7 to 256"),
        ("a.asc", "2 x 3 samples, values 1 to 6.5, 1 hole\nsize  60.0000 x 120.0000 x 5.5000 (the file does not"),
        ("a.asc", "  if mm  60.0000 x 120.0000 x 5.5000 mm   <- most likely"),
        ("land.asc", "2 x 2 samples, values 1 to 4, 0 holes\nthe job file gives its scale"),
        ("own.3mf", "surface, 4 facets\nsize  10.0000 x 10.0000 x 10.0000 mm\n"),
        ("a.toml", "0.07 mm"),
        ("a.job", "stops    1\n"),
    ] {
        let text = done(at, &["inspect", file]);
        assert!(text.contains(say), "{file}: {text}");
    }
    std::fs::create_dir(at.join("empty")).expect("made");
    for file in ["absent.stl", "absent", "empty"] {
        assert_eq!(run(at, &["inspect", file]).status.code(), Some(2), "{file}");
    }
}

/// An Inkscape drawing of two layers, with text that is not read.
const LAYERS: &str = "<svg xmlns=\"http://www.w3.org/2000/svg\" xmlns:inkscape=\"http://www.inkscape.org/namespaces/inkscape\" \
    width=\"80mm\" height=\"60mm\" viewBox=\"0 0 80 60\"><g inkscape:groupmode=\"layer\" inkscape:label=\"Grain\">\
    <path id=\"rim\" class=\"fine\" d=\"M1 1h30\" stroke=\"red\" fill=\"none\"/><path d=\"M1 9h30\" stroke=\"#00f\" fill=\"none\"/>\
    </g><g inkscape:groupmode=\"layer\" inkscape:label=\"Notes\"><rect width=\"4\" height=\"5\"/><text>A</text></g></svg>";

#[test]
fn inspect_lists_what_a_texture_can_choose() {
    let dir = tempfile::tempdir().expect("a folder");
    let at = dir.path();
    write(at.join("layers.svg"), LAYERS);
    write(at.join("a.plt"), "IN;SP2;PU0,0;PD400,0;SP3;PU0,40;PD400,40;");
    let wide =
        "0\nSECTION\n2\nENTITIES\n0\nLWPOLYLINE\n8\nRim\n43\n0.5\n10\n0\n20\n0\n10\n5\n20\n0\n0\n3DFACE\n8\nRim\n";
    write(at.join("wide.dxf"), format!("{wide}0\nENDSEC\n0\nEOF\n"));
    write(
        at.join("space.dxf"),
        "0\nSECTION\n2\nENTITIES\n0\nLINE\n8\nA\n10\n0\n20\n0\n30\n1\n11\n3\n21\n0\n31\n5\n0\nENDSEC\n0\nEOF\n",
    );
    write(at.join("curves.csv"), "id,x,y,z\na,0,0,1\na,3,4,1\nb,0,0,0\nb,0,0,2\nb,2,0,2\n");
    write(at.join("cloud.xyz"), "0 0 0\n9 0 0\n0 9 0\n9 9 1\n");
    write(at.join("far.xyz"), "0 0 0\n9000 0 0\n0 9 0\n9 9 1\n");
    let shown = |args: &[&str]| json(&done(at, &[&["inspect", "--json"], args].concat()));
    let names = |found: &Value| -> Vec<(String, u64)> {
        let row = |s: &Value| (s["name"].as_str().expect("a name").to_owned(), s["shapes"].as_u64().expect("a number"));
        found["selectors"].as_array().expect("a list").iter().map(row).collect()
    };
    let svg = shown(&["layers.svg"]);
    let want = [
        ("#000000", 1),
        ("#0000ff", 1),
        ("#ff0000", 1),
        ("layer:Grain", 2),
        ("layer:Notes", 1),
        ("class:fine", 1),
        ("id:rim", 1),
    ];
    assert_eq!(names(&svg), want.map(|(name, n)| (name.to_owned(), n)));
    assert_eq!((&svg["strokes"], &svg["refused"][0]["code"]), (&3.into(), &"svg-text".into()));
    let text = said(&run(at, &["inspect", "layers.svg"]));
    assert!(text.contains("  layer:Grain  2 shapes\n") && text.contains("warning[svg-text]"), "{text}");
    assert!(text.contains("a job with it is refused"), "{text}");
    assert_eq!(
        names(&shown(&["a.plt"])),
        [("#00ff00".to_owned(), 1), ("#ff0000".to_owned(), 1), ("pen:2".to_owned(), 1), ("pen:3".to_owned(), 1)]
    );
    // A job can give each of these names.
    write(at.join("plate.obj"), "v 0 0 0\nv 80 0 0\nv 80 60 0\nv 0 60 0\nf 1 2 3 4\n");
    for (drawing, keys) in [("layers.svg", "on_unsupported = \"warn\""), ("a.plt", "origin = [\"1 mm\", \"1 mm\"]")] {
        for (name, _) in names(&shown(&[drawing])) {
            let keys = format!("file = \"{drawing}\"\nonly = [\"{name}\"]\nfill = \"outline\"\n{keys}");
            JobText::on(Path::new("plate.obj")).texture(&keys).write(at, "only.toml");
            done(at, &["check", "only.toml"]);
        }
    }
    // DXF: a wide polyline along its centre, in the unit that is given; what is refused whatever the job says is an
    // error.
    let dxf = shown(&["wide.dxf", "--unit", "cm"]);
    assert_eq!((&dxf["strokes"], &dxf["length_mm"]), (&1.into(), &50.0.into()));
    assert_eq!((&dxf["refused"][0]["code"], names(&dxf)[1].0.as_str()), (&"dxf-mesh".into(), "layer:Rim"));
    refused(&run(at, &["inspect", "wide.dxf"]), 2, "dxf-unit");
    let dxf = shown(&["space.dxf", "--unit", "mm"]);
    assert_eq!((&dxf["length_mm"], &dxf["curves"]["length_mm"]), (&3.0.into(), &5.0.into()));
    // A file of numbers may be points of a surface, curves, or both.
    let csv = shown(&["curves.csv"]);
    assert_eq!((&csv["kind"], &csv["curves"]["count"]), (&"surface".into(), &2.into()));
    assert_eq!((&csv["curves"]["length"], &csv["curves"]["length_mm"]), (&9.0.into(), &Value::Null));
    let csv = shown(&["curves.csv", "--unit", "in"]);
    assert_eq!(csv["curves"]["hi_mm"][1], 101.6);
    write(at.join("line.csv"), "x,y,z\n0,0,1\n3,4,1\n");
    let line = shown(&["line.csv"]);
    assert_eq!((&line["kind"], &line["length"], &line["length_mm"]), (&"curves".into(), &5.0.into(), &Value::Null));
    let cloud = shown(&["cloud.xyz", "--unit", "mm"]);
    assert_eq!((&cloud["kind"], &cloud["curves"]["points"]), (&"surface".into(), &4.into()));
    refused(&run(at, &["inspect", "far.xyz", "--unit", "mm"]), 2, "surface-size");
    refused(&run(at, &["inspect", "layers.svg", "--unit", "mm"]), 2, "surface-unit-stated");
}

#[test]
fn inspect_says_which_colours_are_the_page() {
    let dir = tempfile::tempdir().expect("a folder");
    let at = dir.path();
    let body: String = ["#000000", "#fefefe", "#ffffff", "#f5f5f5"]
        .map(|c| format!("<rect width=\"9\" height=\"9\" fill=\"{c}\"/>"))
        .concat();
    let head = "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"9mm\" height=\"9mm\" viewBox=\"0 0 9 9\">";
    write(at.join("a.svg"), format!("{head}{body}</svg>"));
    let text = done(at, &["inspect", "a.svg"]);
    for line in ["#000000  1 shape", "#f5f5f5  1 shape", "#fefefe  1 shape, the page", "#ffffff  1 shape, the page"] {
        assert!(text.contains(&format!("  {line}\n")), "{line}: {text}");
    }
    let found = json(&done(at, &["inspect", "--json", "a.svg"]));
    let pages = found["selectors"].as_array().expect("a list").iter().map(|s| s["page"].as_bool().expect("yes or no"));
    assert_eq!(pages.collect::<Vec<_>>(), [false, false, true, true]);
}

#[test]
fn inspect_shows_bitmaps() {
    let dir = tempfile::tempdir().expect("a folder");
    let at = dir.path();
    let data = |name: &str| std::fs::read(fixture(name)).expect("a fixture");
    write(at.join("a.png"), data("aerofoil.png"));
    let found = json(&done(at, &["inspect", "--json", "a.png"]));
    assert_eq!((&found["kind"], &found["bitmap"]["kind"]), (&"heightmap".into(), &"bitmap".into()), "{found}");
    let text = done(at, &["inspect", "a.png"]);
    assert!(text.contains("as a texture: bitmap, ") && text.contains("it states no resolution"), "{text}");
}
