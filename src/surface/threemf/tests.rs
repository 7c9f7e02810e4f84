use std::io::Write;

use super::*;

const CORE: &str = "http://schemas.microsoft.com/3dmanufacturing/core/2015/02";
const TYPE: &str = "http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel";

type Outcome = (Result<Content, Error>, Vec<[[f64; 3]; 3]>, Vec<Diag>);

/// An archive of these parts.
fn archive(parts: &[(&str, String)]) -> Vec<u8> {
    let mut out = std::io::Cursor::new(Vec::new());
    let mut writer = zip::ZipWriter::new(&mut out);
    let options = zip::write::SimpleFileOptions::default().compression_method(zip::CompressionMethod::Deflated);
    for (name, text) in parts {
        writer.start_file(*name, options).expect("a part");
        writer.write_all(text.as_bytes()).expect("written");
    }
    writer.finish().expect("an archive");
    out.into_inner()
}

fn relationships(targets: &[&str]) -> String {
    let one = |target: &&str| format!("<Relationship Target=\"{target}\" Id=\"a\" Type=\"{TYPE}\"/>");
    format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?><Relationships xmlns=\"http://schemas.openxmlformats.org/package/2006/relationships\">{}</Relationships>",
        targets.iter().map(one).collect::<String>()
    )
}

fn read_bytes(bytes: &[u8], stated_mm: Option<f64>) -> Outcome {
    let dir = tempfile::tempdir().expect("a folder");
    let path = dir.path().join("a.3mf");
    std::fs::write(&path, bytes).expect("written");
    let (mut got, mut notes) = (vec![], vec![]);
    let result = read(&path, stated_mm, &crate::surface::Options::default(), &mut notes, &mut |f| got.push(f));
    (result, got, notes)
}

/// Reads a file of one model.
fn read_model(text: &str) -> Outcome {
    let parts = [("_rels/.rels", relationships(&["/3D/a.model"])), ("3D/a.model", text.to_owned())];
    read_bytes(&archive(&parts), None)
}

const MESH: &str = "<mesh><vertices><vertex x=\"0\" y=\"0\" z=\"0\"/><vertex x=\"9\" y=\"0\" z=\" 1e0 \"/>\
                    <vertex x=\"0\" y=\"8\" z=\"0.1\"/></vertices><triangles><triangle v1=\"0\" v2=\"1\" v3=\"2\"/>\
                    </triangles></mesh>";

/// A model with these objects (id, kind, content) and build items.
fn model(objects: &[(u32, &str, &str)], items: &str) -> String {
    let one = |(id, kind, text): &(u32, &str, &str)| format!("<object id=\"{id}\" type=\"{kind}\">{text}</object>");
    format!(
        "<?xml version=\"1.0\"?><model unit=\"centimeter\" xmlns=\"{CORE}\" xmlns:p=\"http://schemas.microsoft.com/\
         3dmanufacturing/production/2015/06\" xmlns:b=\"http://example.org/lattice\" requiredextensions=\"p\">\
         <metadata name=\"Title\">a &amp; b</metadata><resources>{}</resources><build>{items}</build></model>",
        objects.iter().map(one).collect::<String>()
    )
}

fn plain() -> String {
    model(&[(1, "model", MESH)], "<item objectid=\"1\"/>")
}

const FACET: [[f64; 3]; 3] = [[0.0; 3], [90.0, 0.0, 10.0], [0.0, 80.0, 1.0]];

#[test]
fn the_unit_is_that_of_the_file() {
    for (unit, mm) in
        [("micron", 1e-3), ("millimeter", 1.0), ("centimeter", 10.0), ("inch", 25.4), ("foot", 304.8), ("meter", 1e3)]
    {
        let (result, got, notes) = read_model(&plain().replace("centimeter", unit));
        if mm > 400.0 {
            // 9 m: beyond reach.
            let e = result.err().expect(unit);
            assert!(e.diags()[0].code == "surface-size" && e.to_string().contains("the file is in meter"), "{e}");
            continue;
        }
        assert!(matches!(result, Ok(Content::Facets(1))), "{unit}");
        assert_eq!(got, [FACET.map(|p| p.map(|v| v / 10.0 * mm))], "{unit}");
        assert_eq!(notes.len(), usize::from(mm < 0.1), "{notes:?}");
    }
    let (result, got, _) = read_model(&plain().replace(" unit=\"centimeter\"", ""));
    assert!(result.is_ok() && got[0][1][0] == 9.0, "millimetres where none is stated");
    let bytes = archive(&[("_rels/.rels", relationships(&["3D/a.model"])), ("3D/a.model", plain())]);
    assert!(read_bytes(&bytes, Some(10.0)).0.is_ok());
    let e = read_bytes(&bytes, Some(1.0)).0.err().expect("another unit");
    assert!(e.diags()[0].code == "surface-unit" && e.to_string().contains("centimeter"), "{e}");
}

#[test]
fn components_are_placed_from_the_inside_out_and_mirrors_keep_the_winding() {
    let shifted = "transform=\"1 0 0 0 1 0 0 0 1 1 2 3\"";
    let mirrored = "transform=\"-1 0 0 0 1 0 0 0 1 0 0 0\"";
    let component = |id: u32, transform: &str| format!("<component objectid=\"{id}\" {transform}/>");
    let inner = format!("<components>{}{}</components>", component(1, shifted), component(1, ""));
    let outer = format!("<components>{}</components>", component(2, mirrored));
    let objects = [(1, "model", MESH), (2, "model", &inner), (3, "surface", &outer)];
    let (result, got, notes) = read_model(&model(&objects, &format!("<item objectid=\"3\" {shifted}/>")));
    assert!(matches!(result, Ok(Content::Facets(2))), "{:?}", result.err());
    assert!(notes.is_empty(), "{notes:?}");
    // Shifted by (1, 2, 3) cm, mirrored in x, shifted again; corners two and three change places.
    let [a, b, c] = FACET.map(|[x, y, z]| [-(x + 10.0) + 10.0, y + 40.0, z + 60.0]);
    assert_eq!(got[0], [a, c, b]);
    let [a, b, c] = FACET.map(|[x, y, z]| [-x + 10.0, y + 20.0, z + 30.0]);
    assert_eq!(got[1], [a, c, b]);
}

#[test]
fn other_models_of_the_archive_are_found_by_their_path() {
    let item = "<item objectid=\"7\" p:path=\"/3D/Parts/B.model\"/>";
    let other = model(&[(7, "model", MESH)], "<item objectid=\"99\"/>");
    let parts = |item: &str, other: &str| {
        archive(&[
            ("_rels/.rels", relationships(&["/3D/a.model"])),
            ("3D/_rels/a.model.rels", relationships(&["Parts/B.model"])),
            ("3D/a.model", model(&[(7, "model", "<mesh/>")], item)),
            // Names differ by more than their case.
            ("3D/parts/b.model", other.to_owned()),
        ])
    };
    let (result, got, _) = read_bytes(&parts(item, &other), None);
    assert!(result.is_ok(), "{:?}", result.err());
    assert_eq!(got, [FACET]);
    for (bytes, code, say) in [
        (parts(&item.replace("B.model", "C.model"), &other), "3mf-part", "\"/3D/Parts/C.model\" is no part"),
        (parts(item, &other.replace("centimeter", "inch")), "surface-unit", "3D/Parts/B.model in inch"),
        (
            parts(
                item,
                &other.replace(MESH, "<components><component objectid=\"1\" p:path=\"/3D/a.model\"/></components>"),
            ),
            "3mf-part",
            "another model",
        ),
    ] {
        let e = read_bytes(&bytes, None).0.err().expect(say);
        assert_eq!(e.diags()[0].code, code, "{e}");
        assert!(e.to_string().contains(say), "{e}");
    }
}

#[test]
fn metadata_of_slicers_in_common_use_is_passed_over() {
    let names =
        ["BambuStudio:3mfVersion", "slic3rpe:Version3mf", "DesignerUserId", "Origin", "Thumbnail_Small", "License"];
    let metadata: String = names.iter().map(|name| format!("<metadata name=\"{name}\">1</metadata>")).collect();
    let text = plain().replace("<resources>", &format!("{metadata}<resources>"));
    let (result, _, notes) = read_model(&text);
    assert!(result.is_ok() && notes.is_empty(), "{:?} {notes:?}", result.err());
}

#[test]
fn supports_and_foreign_elements_are_noted() {
    let lattice = format!("{}<b:beamlattice><b:beams/></b:beamlattice></mesh>", MESH.trim_end_matches("</mesh>"));
    let items = "<item objectid=\"1\"/><item objectid=\"2\"/><item objectid=\"2\"/>";
    let (result, got, notes) = read_model(&model(&[(1, "model", &lattice), (2, "solidsupport", MESH)], items));
    assert!(result.is_ok() && got.len() == 1, "{:?}", result.err());
    let said: Vec<_> = notes.iter().map(|d| (d.code, d.message.as_str())).collect();
    assert_eq!(
        said,
        [
            ("3mf-support", "support objects that are not read: 2 instances"),
            ("3mf-elements", "elements of objects that are not read: beamlattice (1)")
        ]
    );
}

#[test]
fn faults_of_models_are_named() {
    let item = "<item objectid=\"1\"/>";
    let with = |from: &str, to: &str| {
        assert!(plain().contains(from), "{from}");
        plain().replacen(from, to, 1)
    };
    let chain = |n: u32| {
        let one = |id: u32| {
            format!("<object id=\"{id}\"><components><component objectid=\"{}\"/></components></object>", id - 1)
        };
        with("</resources>", &format!("{}</resources>", (2..=n).map(one).collect::<String>()))
            .replace("objectid=\"1\"/></build>", &format!("objectid=\"{n}\"/></build>"))
    };
    for (text, code, say) in [
        (
            with("v3=\"2\"", "v3=\"3\""),
            "3mf-index",
            "object 1: triangle 0: v3 = \"3\", but the vertices before it are 0 to 2",
        ),
        (with("v3=\"2\"", "v3=\"-1\""), "3mf-index", "v3 = \"-1\""),
        (with(" v3=\"2\"", ""), "3mf-index", "triangle 0 has no v1, v2 and v3"),
        (with("x=\"9\"", "x=\"9,5\""), "surface-number", "object 1: vertex 1: x = \"9,5\""),
        (with("x=\"9\"", "x=\"inf\""), "surface-number", "vertex 1"),
        (with(" x=\"9\"", ""), "surface-number", "vertex 1 has no x, y and z"),
        (with("object id=\"1\"", "object id=\"0\""), "3mf-object", "no id above 0"),
        (with("</resources>", "<object id=\"1\"/></resources>"), "3mf-object", "two objects have the id 1"),
        (
            with("</resources>", "<object id=\"2\"/></resources>").replace(item, "<item objectid=\"2\"/>"),
            "3mf-object",
            "neither",
        ),
        (with(item, "<item objectid=\"5\"/>"), "3mf-object", "object 5, which is not there"),
        (with(item, "<item/>"), "3mf-object", "no objectid"),
        (with(item, ""), "3mf-object", "no build items"),
        (with("type=\"model\"", "type=\"other\""), "3mf-object", "not to be built"),
        (with(MESH, "<mesh/>"), "surface-empty", "no triangles"),
        (with("unit=\"centimeter\"", "unit=\"cm\""), "surface-unit", "\"cm\""),
        (with("requiredextensions=\"p\"", "requiredextensions=\"b\""), "3mf-extension", "http://example.org/lattice"),
        (with("requiredextensions=\"p\"", "requiredextensions=\"q\""), "3mf-xml", "prefix q"),
        (with("<item objectid=\"1\"/>", "<item objectid=\"1\" transform=\"1 0 0\"/>"), "3mf-transform", "has 3"),
        (with("name=\"Title\"", "name=\"Titel\""), "3mf-metadata", "\"Titel\""),
        (with("<resources>", "<metadata name=\"Title\"/><resources>"), "3mf-metadata", "twice"),
        (with("<vertices>", "<vertices n=\"3\">"), "3mf-xml", "an attribute"),
        (with("<vertices>", "<vertices><q:x/>"), "3mf-xml", "prefix q"),
        (with("<build>", "<build xml:space=\"preserve\">"), "3mf-xml", "xml:space"),
        (with("</build>", "</build"), "3mf-xml", "well-formed"),
        (with("</build></model>", ""), "3mf-xml", "not closed"),
        (with(CORE, "http://example.org/core"), "3mf-xml", "no model of the core"),
        (with("<?xml version=\"1.0\"?>", "<?xml version=\"1.0\" encoding=\"UTF-16\"?>"), "3mf-xml", "UTF-16"),
        (with("<?xml version=\"1.0\"?>", "<!DOCTYPE model>"), "3mf-xml", "DTD"),
        (with("</resources>", &"<x>".repeat(400)), "3mf-xml", "deeper than 256"),
        (chain(120), "3mf-components", "more than 100 deep"),
        (chain(3).replace("objectid=\"1\"/></c", "objectid=\"3\"/></c"), "3mf-components", "component of itself"),
    ] {
        let (result, got, _) = read_model(&text);
        let e = result.err().unwrap_or_else(|| panic!("{say}"));
        assert_eq!(e.diags()[0].code, code, "{e}");
        assert!(e.to_string().contains(say) && !e.diags()[0].hint.is_empty(), "{say}: {e}");
        assert!(got.is_empty(), "{say}");
    }
    assert!(matches!(read_model(&chain(90)).0, Ok(Content::Facets(1))));
}

#[test]
fn faults_of_the_archive_are_named() {
    let rels = |text: String| archive(&[("_rels/.rels", text), ("3D/a.model", plain())]);
    let whole = rels(relationships(&["/3D/a.model"]));
    assert!(read_bytes(&whole, None).0.is_ok());
    let mut ends = vec![(vec![], "surface-empty", "empty"), (b"solid".to_vec(), "surface-format", "ZIP")];
    ends.extend([60, whole.len() / 2, whole.len() - 1].map(|n| (whole[..n].to_vec(), "3mf-archive", "damaged")));
    let mut turned = whole.clone();
    let at = whole.windows(10).position(|w| w == b"3D/a.model").expect("the part") + 30;
    turned[at] ^= 16;
    let external = relationships(&["/3D/a.model"]).replace("Id=", "TargetMode=\"External\" Id=");
    for (bytes, code, say) in ends.into_iter().chain([
        (turned, "3mf-archive", "3D/a.model is damaged"),
        (rels(relationships(&[])), "3mf-part", "no relationship"),
        (rels(relationships(&["/3D/a.model"; 2])), "3mf-part", "2 3D models"),
        (rels(relationships(&["/3D/b.model"])), "3mf-part", "\"/3D/b.model\", which is not in"),
        (rels(relationships(&["/../a"])), "3mf-part", "outside"),
        (rels(external), "3mf-part", "outside"),
        (rels(relationships(&["/3D/a.model"]).replace(" Type=", " Kind=")), "3mf-part", "no Type"),
        (archive(&[("a.txt", "a".into())]), "3mf-part", "no relationship"),
        (
            archive(&[("_rels/.rels", relationships(&["/a.model"])), ("a.model", " ".repeat(1 << 22))]),
            "3mf-archive",
            "500 to 1",
        ),
    ]) {
        let e = read_bytes(&bytes, None).0.err().unwrap_or_else(|| panic!("{say}"));
        assert_eq!(e.diags()[0].code, code, "{e}");
        assert!(e.to_string().contains(say) && !e.diags()[0].hint.is_empty(), "{say}: {e}");
    }
}

#[test]
fn a_small_file_cannot_stand_for_a_huge_part() {
    let ten = |id: u32| "<component objectid=\"1\"/>".replace('1', &id.to_string()).repeat(10);
    let level = |id: u32| format!("<object id=\"{id}\"><components>{}</components></object>", ten(id - 1));
    let text = |levels: u32| {
        plain()
            .replace("</resources>", &format!("{}</resources>", (2..=levels).map(level).collect::<String>()))
            .replace("<item objectid=\"1\"/>", &format!("<item objectid=\"{levels}\"/>"))
    };
    assert!(matches!(read_model(&text(4)).0, Ok(Content::Facets(1000))));
    for levels in [8, 90] {
        let e = read_model(&text(levels)).0.err().expect("too many");
        assert_eq!(e.diags()[0].code, "3mf-components", "{e}");
    }
}
