use std::io::Write;

use super::*;

const CORE: &str = "http://schemas.microsoft.com/3dmanufacturing/core/2015/02";
const TYPE: &str = "http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel";

type Outcome = (Result<Content, Error>, Vec<[[f64; 3]; 3]>, Vec<Diag>);

/// An archive of these parts.
fn archive<T: AsRef<[u8]>>(parts: &[(&str, T)]) -> Vec<u8> {
    let mut out = std::io::Cursor::new(Vec::new());
    let mut writer = zip::ZipWriter::new(&mut out);
    let options = zip::write::SimpleFileOptions::default().compression_method(zip::CompressionMethod::Deflated);
    for (name, content) in parts {
        writer.start_file(*name, options).expect("a part");
        writer.write_all(content.as_ref()).expect("written");
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
    let mut got = vec![];
    let mut notes = vec![];
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
        (parts(&item.replace("B.model", "C.model"), &other), "3mf-part", "\"/3D/Parts/C.model\" is not a part"),
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
fn metadata_never_refuses_a_file() {
    let with = |names: &[&str]| {
        let all: String = names.iter().map(|name| format!("<metadata name=\"{name}\">1</metadata>")).collect();
        read_model(&plain().replace("<resources>", &format!("{all}<resources>")))
    };
    let known =
        ["BambuStudio:3mfVersion", "slic3rpe:Version3mf", "DesignerUserId", "Origin", "License", "MakerLab", "Region"];
    let (result, _, notes) = with(&known);
    assert!(result.is_ok() && notes.is_empty(), "{:?} {notes:?}", result.err());
    let (result, got, notes) = with(&["Title", "Tietl", "a &lt; b", ""]);
    assert!(result.is_ok() && got == [FACET], "{:?}", result.err());
    assert_eq!((notes.len(), notes[0].code), (1, "3mf-metadata"));
    assert!(notes[0].message.ends_with("twice: , Tietl, Title, a < b"), "{}", notes[0]);
}

/// A project of a slicer: the model and the part with the volumes.
fn project(text: &str, settings: &str, volumes: &str) -> Outcome {
    let parts = [
        ("_rels/.rels", relationships(&["/3D/a.model"])),
        ("3D/a.model", text.to_owned()),
        (settings, format!("<?xml version=\"1.0\"?><config>{volumes}</config>")),
    ];
    read_bytes(&archive(&parts), None)
}

const PRUSA: &str = "Metadata/Slic3r_PE_model.config";
const BAMBU: &str = "Metadata/model_settings.config";

/// A mesh of three triangles, told apart by their first corner.
fn three() -> String {
    let triangles = (0..3).map(|i| format!("<triangle v1=\"{i}\" v2=\"{}\" v3=\"{}\"/>", (i + 1) % 3, (i + 2) % 3));
    let (head, _) = MESH.split_once("<triangle ").expect("a triangle");
    format!("{head}{}</triangles></mesh>", triangles.collect::<String>())
}

/// Volumes of PrusaSlicer: ranges and their metadata.
fn ranges(object: u32, volumes: &[(usize, usize, &str)]) -> String {
    let one = |(first, last, properties): &(usize, usize, &str)| {
        format!("<volume firstid=\"{first}\" lastid=\"{last}\">{properties}</volume>")
    };
    format!("<object id=\"{object}\">{}</object>", volumes.iter().map(one).collect::<String>())
}

fn property(key: &str, value: &str) -> String {
    format!("<metadata type=\"volume\" key=\"{key}\" value=\"{value}\"/>")
}

/// What was left out, and with which first corners triangles are there.
fn assert_left_out((result, got, notes): Outcome, corners: &[usize], say: &str) {
    assert!(matches!(result, Ok(Content::Facets(n)) if n == corners.len()), "{say}: {:?}", result.err());
    assert_eq!(got.iter().map(|f| f[0]).collect::<Vec<_>>(), corners.iter().map(|&i| FACET[i]).collect::<Vec<_>>());
    let said: Vec<_> = notes.iter().map(|d| (d.code, d.message.as_str())).collect();
    let want = format!("left out, since the file says that they are not the part: {say}");
    assert_eq!(said, [("3mf-left-out", want.as_str())]);
}

fn assert_refused((result, got, _): Outcome, code: &str, say: &str) {
    let e = result.err().unwrap_or_else(|| panic!("{say}: accepted"));
    assert!(e.diags()[0].code == code && e.to_string().contains(say), "{say}: {e}");
    assert!(!e.diags()[0].hint.is_empty() && got.is_empty(), "{say}: {e}");
}

#[test]
fn ranges_of_triangles_that_are_not_the_part_are_left_out() {
    let text = model(&[(1, "model", &three())], "<item objectid=\"1\"/>");
    let part = property("volume_type", "ModelPart");
    let name = property("name", "cut");
    for (kind, say) in [
        (property("volume_type", "ParameterModifier"), "ParameterModifier"),
        (property("volume_type", "SupportBlocker"), "SupportBlocker"),
        (property("volume_type", "SupportEnforcer"), "SupportEnforcer"),
        (property("modifier", "1"), "modifier"),
        (property("modifier", "1") + &part, "modifier"),
        (property("volume_type", "SomethingNew"), "SomethingNew"),
    ] {
        let kind = name.clone() + &kind;
        let say = format!("{say} \"cut\" of object 1");
        // At the end, in the middle, at the begin.
        assert_left_out(project(&text, PRUSA, &ranges(1, &[(0, 1, &part), (2, 2, &kind)])), &[0, 1], &say);
        assert_left_out(
            project(&text, PRUSA, &ranges(1, &[(2, 2, &part), (1, 1, &kind), (0, 0, &part)])),
            &[0, 2],
            &say,
        );
        assert_left_out(project(&text, PRUSA, &ranges(1, &[(0, 1, &kind), (2, 2, "")])), &[2], &say);
    }
    let negative = property("volume_type", "NegativeVolume");
    assert_refused(
        project(&text, PRUSA, &ranges(1, &[(0, 1, ""), (2, 2, &negative)])),
        "3mf-negative",
        "NegativeVolume",
    );
    let modifier = property("modifier", "1");
    let all = ranges(1, &[(0, 2, &modifier)]);
    let parts = ranges(1, &[(0, 1, &part), (2, 2, &part)]);
    assert_refused(project(&text, PRUSA, &all), "surface-empty", "nothing is the part: modifier of object 1");
    let (result, got, notes) = project(&text, PRUSA, &parts);
    assert!(result.is_ok() && got.len() == 3 && notes.is_empty(), "all of it is the part");
    // The mesh was changed after the project was saved.
    for volumes in
        [&[(0, 1, part.as_str()), (2, 3, &modifier)][..], &[(0, 0, &part), (2, 2, &modifier)], &[(1, 2, &modifier)]]
    {
        assert_refused(project(&text, PRUSA, &ranges(1, volumes)), "3mf-volumes", "do not divide its 3 triangles");
    }
    let (result, got, _) = project(&text, PRUSA, &ranges(7, &[(0, 0, &negative)]));
    assert!(result.is_ok() && got.len() == 3, "an object that is not there");
    assert_refused(project(&text, PRUSA, "<object>"), "3mf-volumes", "id = \"\" is not a number");
    assert_refused(project(&text, PRUSA, "<object id=\"1\">"), "3mf-xml", "well-formed");
}

#[test]
fn components_that_are_not_the_part_are_left_out() {
    let parts = |ids: &[(u32, &str)]| {
        let one = |(id, kind): &(u32, &str)| format!("<part id=\"{id}\" subtype=\"{kind}\"/>");
        format!("<object id=\"3\">{}</object>", ids.iter().map(one).collect::<String>())
    };
    let components = |ids: &[u32]| {
        let one = |id: &u32| format!("<component objectid=\"{id}\"/>");
        format!("<components>{}</components>", ids.iter().map(one).collect::<String>())
    };
    let text = |kind: &str, ids: &[u32], item: &str| {
        model(
            &[(1, "model", MESH), (2, kind, MESH), (3, "model", &components(ids)), (4, "model", &components(&[3]))],
            item,
        )
    };
    let item = "<item objectid=\"3\"/>";
    // Bambu Studio gives all that is not the part the type \"other\".
    for kind in ["model", "other"] {
        for helper in ["modifier_part", "support_blocker", "support_enforcer"] {
            let volumes = parts(&[(1, "normal_part"), (2, helper)]);
            let say = format!("{helper} of object 3");
            assert_left_out(project(&text(kind, &[1, 2], item), BAMBU, &volumes), &[0], &say);
            let placed = item.replace('3', "4");
            assert_left_out(project(&text(kind, &[2, 1], &placed), BAMBU, &volumes), &[0], &say);
        }
        let volumes = parts(&[(1, "normal_part"), (2, "negative_part")]);
        assert_refused(
            project(&text(kind, &[1, 2], item), BAMBU, &volumes),
            "3mf-negative",
            "negative_part of object 3",
        );
    }
    // Volumes that share a mesh.
    let shared = parts(&[(1, "normal_part"), (1, "modifier_part")]);
    assert_left_out(project(&text("model", &[1, 1], item), BAMBU, &shared), &[0], "modifier_part of object 3");
    let lost = parts(&[(1, "normal_part"), (9, "modifier_part")]);
    assert_refused(project(&text("model", &[1], item), BAMBU, &lost), "3mf-volumes", "not one of the components");
    // The object itself.
    let alone = "<object id=\"2\"><part id=\"2\" subtype=\"modifier_part\"/></object>";
    let items = "<item objectid=\"1\"/><item objectid=\"2\"/>";
    assert_left_out(project(&text("model", &[1], items), BAMBU, alone), &[0], "modifier_part of object 2");
    // Of the type \"other\" without a word why: at any depth.
    for placed in [item, "<item objectid=\"4\"/>", "<item objectid=\"2\"/>"] {
        let outcome = project(&text("other", &[1, 2], placed), BAMBU, "");
        assert_refused(outcome, "3mf-object", "object 2, whose type is not to be built");
    }
}

#[test]
fn helpers_of_cura_and_slic3r_and_items_that_are_not_printable_are_left_out() {
    let cura = |name: &str, value: &str| {
        format!("<metadatagroup><metadata name=\"cura:{name}\" preserve=\"1\">{value}</metadata></metadatagroup>{MESH}")
    };
    let items = "<item objectid=\"1\"/><item objectid=\"2\"/>";
    for (name, say) in [
        ("infill_mesh", "modifier, object 2"),
        ("cutting_mesh", "modifier, object 2"),
        ("support_mesh", "support, object 2"),
        ("anti_overhang_mesh", "support blocker, object 2"),
    ] {
        let text = |value: &str| model(&[(1, "model", MESH), (2, "model", &cura(name, value))], items);
        assert_left_out(read_model(&text("True")), &[0], say);
        let (result, got, notes) = read_model(&text("False"));
        assert!(result.is_ok() && got.len() == 2 && notes.is_empty(), "{name}: {notes:?}");
    }
    let old = "<settings xmlns=\"http://software.ultimaker.com/xml/cura/3mf/2015/10\"><setting key=\"infill_mesh\">True\
               </setting></settings>";
    let text = model(&[(1, "model", MESH), (2, "model", &format!("{old}{MESH}"))], items);
    assert_left_out(read_model(&text), &[0], "modifier, object 2");
    let volumes = "<s:volumes xmlns:s=\"http://schemas.slic3r.org/3mf/2017/06\"><s:volume ts=\"0\" te=\"0\" modifier=\"0\"/>\
                   <s:volume ts=\"1\" te=\"2\" modifier=\"1\"/></s:volumes></mesh>";
    let text = model(&[(1, "model", &three().replace("</mesh>", volumes))], "<item objectid=\"1\"/>");
    assert_left_out(read_model(&text), &[0], "modifier of object 1");
    assert_refused(read_model(&text.replace("te=\"2\"", "te=\"7\"")), "3mf-volumes", "do not divide");
    // The placement of what is left out counts for nothing, even where it lies far away.
    let far = "transform=\"1 0 0 0 1 0 0 0 1 9e6 0 0\"";
    let text = |flag: &str| {
        let items = format!("<item objectid=\"1\" printable=\"1\"/><item objectid=\"2\" {far} printable=\"{flag}\"/>");
        model(&[(1, "model", MESH), (2, "other", MESH)], &items)
    };
    assert_left_out(read_model(&text("0")), &[0], "item 2 (object 2), which is not printable");
    assert_refused(read_model(&text("1")), "3mf-object", "not to be built");
    let none = model(&[(1, "model", MESH)], "<item objectid=\"1\" printable=\"0\"/>");
    assert_refused(read_model(&none), "surface-empty", "nothing is the part: item 1");
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
        (with("<vertices>", "<vertices n=\"3\">"), "3mf-xml", "an attribute"),
        (with("<vertices>", "<vertices><q:x/>"), "3mf-xml", "prefix q"),
        (with("<build>", "<build xml:space=\"preserve\">"), "3mf-xml", "xml:space"),
        (with("</build>", "</build"), "3mf-xml", "well-formed"),
        (with("</build></model>", ""), "3mf-xml", "not closed"),
        (with(CORE, "http://example.org/core"), "3mf-xml", "not a model of the core"),
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
        (archive(&[("a.txt", "a")]), "3mf-part", "no relationship"),
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

/// A model that has what slicers write, and the parts with its volumes.
fn busy_project() -> [String; 3] {
    let cura = "<metadatagroup><metadata name=\"cura:infill_mesh\">True</metadata></metadatagroup>";
    let volumes = "<s:volumes xmlns:s=\"http://schemas.slic3r.org/3mf/2017/06\"><s:volume ts=\"0\" te=\"1\" modifier=\"0\"/>\
                   <s:volume ts=\"2\" te=\"2\" modifier=\"1\"/></s:volumes></mesh>";
    let components = "<components><component objectid=\"1\" transform=\"-1 0 0 0 1 0 0 0 1 1 2 3\"/>\
                      <component objectid=\"2\"/><component objectid=\"3\"/></components>";
    let objects = [
        (1, "model", three()),
        (2, "other", MESH.to_owned()),
        (3, "model", three().replace("</mesh>", volumes)),
        (4, "model", format!("{cura}{MESH}")),
        (5, "model", components.to_owned()),
    ];
    let objects: Vec<_> = objects.iter().map(|(id, kind, text)| (*id, *kind, text.as_str())).collect();
    let items =
        "<item objectid=\"5\"/><item objectid=\"4\"/><item objectid=\"1\"/><item objectid=\"2\" printable=\"0\"/>";
    let modifier = property("volume_type", "ParameterModifier") + &property("name", "a &lt; b");
    let prusa = format!("<config>{}</config>", ranges(1, &[(0, 0, &modifier), (1, 2, "")]));
    let parts = "<part id=\"1\" subtype=\"normal_part\"/><part id=\"2\" subtype=\"support_blocker\"/>";
    [model(&objects, items), prusa, format!("<config><object id=\"5\">{parts}</object></config>")]
}

#[test]
fn damaged_projects_never_panic() {
    const WORDS: &[&str] = &[
        "<item objectid=\"5\"/>",
        "<component objectid=\"5\"/>",
        "</",
        "/>",
        "<",
        ">",
        "\"",
        "&lt;",
        "&#x10ffff;",
        "&",
        "<!--",
        "-->",
        "<![CDATA[",
        "]]>",
        "<?xml?>",
        "firstid=\"1\"",
        "lastid=\"9\"",
        "<part id=\"3\"/>",
        "modifier_part",
        "ModelPart",
        "<object id=\"1\">",
        "</object>",
        "<metadata key=\"modifier\" value=\"1\"/>",
        "printable=\"0\"",
        "type=\"other\"",
    ];
    let whole = busy_project();
    let rels = relationships(&["/3D/a.model"]);
    let outcome = |parts: [&[u8]; 4]| {
        let [rels, model, prusa, bambu] = parts;
        read_bytes(&archive(&[("_rels/.rels", rels), ("3D/a.model", model), (PRUSA, prusa), (BAMBU, bambu)]), None)
    };
    let good = [rels.as_bytes(), whole[0].as_bytes(), whole[1].as_bytes(), whole[2].as_bytes()];
    let (result, _, notes) = outcome(good);
    assert!(matches!(result, Ok(Content::Facets(6))) && notes.len() == 1, "{:?} {notes:?}", result.err());
    let mut accepted = 0;
    let mut refused = 0;
    for i in 0..good.len() {
        crate::surface::mutants::each(&[good[i].to_vec()], WORDS, |bytes| {
            let mut parts = good;
            parts[i] = bytes;
            let (result, got, _) = outcome(parts);
            match result {
                Ok(_) => {
                    accepted += 1;
                    assert!(got.iter().flatten().flatten().all(|v| v.abs() <= 4000.0));
                }
                Err(e) => {
                    refused += 1;
                    assert!(e.diags().iter().all(|d| !d.message.is_empty() && !d.hint.is_empty()), "{e}");
                }
            }
        });
    }
    assert!(accepted > 50 && refused > 500, "{accepted} accepted, {refused} refused");
}
