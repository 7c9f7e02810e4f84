//! What slicers say of objects beside the model: which of their volumes are the part.
//!
//! Consumes `Metadata/Slic3r_PE_model.config` (PrusaSlicer and what derives from it: volumes are ranges of the
//! triangles of an object) and `Metadata/model_settings.config` (Bambu Studio, OrcaSlicer: volumes are components of an
//! object), element by element. Promises the volumes of each object of the first model. Settings of printing are passed
//! over.

use std::collections::BTreeMap;
use std::io::BufRead;

use quick_xml::Reader;
use quick_xml::events::{BytesStart, Event};

use super::super::lines::shown;
use super::xml::{attributes, refuse_dtd_and_encoding, text_of, xml_fault};
use terrace_core::diag::Diag;

/// Most bytes of a part with settings.
pub(super) const MAX_SETTINGS: u64 = 64 << 20;

/// What a volume is for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Role {
    /// The part.
    Part,
    /// A body that is cut out of the part.
    Negative,
    /// A region with settings of its own, a support blocker, or another helper: not the part.
    Helper,
}

/// Which piece of its object a volume is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Piece {
    /// Triangles of the object, the last one included.
    Triangles(usize, usize),
    /// The component with this object.
    Component(u32),
}

/// A volume of an object.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Volume {
    pub(super) piece: Piece,
    name: String,
    /// The type as the file has it; empty for the part.
    kind: String,
}

impl Volume {
    /// Triangles of an object; `kind` is empty for the part.
    pub(super) fn triangles(first: usize, last: usize, kind: &str) -> Self {
        Self { piece: Piece::Triangles(first, last), name: String::new(), kind: kind.into() }
    }

    pub(super) fn role(&self) -> Role {
        match self.kind.as_str() {
            "" | "ModelPart" | "normal_part" => Role::Part,
            "NegativeVolume" | "negative_part" => Role::Negative,
            _ => Role::Helper,
        }
    }

    /// What it is, where it is not the part of `object`.
    pub(super) fn aside(&self, object: u32) -> Option<Aside> {
        let name = if self.name.is_empty() { String::new() } else { format!(" \"{}\"", self.name) };
        let text = format!("{}{name} of object {object}", shown(self.kind.as_bytes()));
        (self.role() != Role::Part).then(|| Aside { is_negative: self.role() == Role::Negative, text })
    }
}

/// What is not the part.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Aside {
    /// Whether it is to be cut out of the part.
    pub(super) is_negative: bool,
    /// The part in a message: its type, its name and its object.
    pub(super) text: String,
}

/// The volumes of the objects of the first model, by the ids of these.
pub(super) type Volumes = BTreeMap<u32, Vec<Volume>>;

/// Whether an archive's part has volumes.
pub(super) fn has_volumes(part: &str) -> bool {
    let part = part.to_ascii_lowercase();
    part.strip_prefix("metadata/")
        .is_some_and(|name| name == "model_settings.config" || name.ends_with("_model.config"))
}

/// Reads a part with settings; `name` is its name in the archive.
pub(super) fn read(input: &mut dyn BufRead, name: &str) -> Result<Volumes, Diag> {
    let mut reader = Reader::from_reader(input);
    reader.config_mut().expand_empty_elements = true;
    let mut parser = Parser { name, found: Volumes::new(), object: None, in_volume: false };
    let mut buffer = Vec::new();
    let mut depth = 0usize;
    loop {
        buffer.clear();
        match reader.read_event_into(&mut buffer).map_err(|e| xml_fault(name, &e))? {
            Event::Start(e) => {
                depth += 1;
                parser.start(&e)?;
            }
            Event::End(e) => {
                depth = depth.saturating_sub(1);
                parser.end(e.local_name().as_ref());
            }
            Event::Eof if depth > 0 => {
                return Err(parser.fault("3mf-xml", "an element is not closed: the part is cut short".into()));
            }
            Event::Eof => return Ok(parser.found),
            event => refuse_dtd_and_encoding(&event, name)?,
        }
    }
}

struct Parser<'a> {
    name: &'a str,
    found: Volumes,
    /// The object that is open.
    object: Option<u32>,
    /// Whether a volume of it is open.
    in_volume: bool,
}

impl Parser<'_> {
    fn fault(&self, code: &'static str, text: String) -> Diag {
        Diag::input(code, format!("{}: {text}", self.name)).hint("save the project again, or export it as STL")
    }

    fn start(&mut self, e: &BytesStart<'_>) -> Result<(), Diag> {
        let mut values = BTreeMap::new();
        attributes(e, self.name, |key, value| {
            if ["id", "firstid", "lastid", "subtype", "key", "value"].contains(&key) {
                values.insert(key.to_owned(), text_of(value, self.name)?);
            }
            Ok(())
        })?;
        match (e.local_name().as_ref(), self.object) {
            ("object", _) => self.object = Some(self.number(&values, "id")?),
            ("volume", Some(object)) => {
                let [first, last] = [self.number(&values, "firstid")?, self.number(&values, "lastid")?];
                self.begin(object, Piece::Triangles(first as usize, last as usize), String::new());
            }
            ("part", Some(object)) => {
                let piece = Piece::Component(self.number(&values, "id")?);
                self.begin(object, piece, values.remove("subtype").unwrap_or_default());
            }
            ("metadata", Some(object)) if self.in_volume => {
                let [key, value] = ["key", "value"].map(|name| values.remove(name).unwrap_or_default());
                self.metadata(object, &key, value);
            }
            _ => {}
        }
        Ok(())
    }

    fn begin(&mut self, object: u32, piece: Piece, kind: String) {
        self.in_volume = true;
        self.found.entry(object).or_default().push(Volume { piece, name: String::new(), kind });
    }

    /// A property of the volume that is open.
    fn metadata(&mut self, object: u32, key: &str, value: String) {
        let Some(volume) = self.found.get_mut(&object).and_then(|all| all.last_mut()) else { return };
        match key {
            "name" => volume.name = shown(value.as_bytes()),
            // What one of them does not name as a part is not one, whichever comes first.
            "volume_type" if volume.role() == Role::Part => volume.kind = value,
            "modifier" if value == "1" && volume.role() == Role::Part => volume.kind = "modifier".into(),
            _ => {}
        }
    }

    fn end(&mut self, element: &str) {
        match element {
            "object" => self.object = None,
            "volume" | "part" => self.in_volume = false,
            _ => {}
        }
    }

    fn number(&self, values: &BTreeMap<String, String>, key: &str) -> Result<u32, Diag> {
        let value = values.get(key).map_or("", String::as_str);
        value
            .parse()
            .map_err(|_| self.fault("3mf-volumes", format!("{key} = \"{}\" is not a number", shown(value.as_bytes()))))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn volumes(text: &str) -> Result<Volumes, Diag> {
        read(&mut text.as_bytes(), "Metadata/x_model.config")
    }

    #[test]
    fn volumes_have_their_role_whichever_slicer_wrote_them() {
        let prusa = "<?xml version=\"1.0\" encoding=\"UTF-8\"?><config><object id=\"4\" instances_count=\"1\">\
            <metadata type=\"object\" key=\"name\" value=\"whole\"/><volume firstid=\"0\" lastid=\"9\">\
            <metadata type=\"volume\" key=\"volume_type\" value=\"ModelPart\"/></volume><volume firstid=\"10\" lastid=\"11\">\
            <metadata type=\"volume\" key=\"name\" value=\"a &amp; b\"/>\
            <metadata type=\"volume\" key=\"modifier\" value=\"1\"/>\
            <metadata type=\"volume\" key=\"volume_type\" value=\"ModelPart\"/></volume></object></config>";
        let found = volumes(prusa).expect("volumes");
        let [part, modifier] = &found[&4][..] else { panic!("{found:?}") };
        assert_eq!((part.piece, part.role()), (Piece::Triangles(0, 9), Role::Part));
        assert_eq!((modifier.piece, modifier.role()), (Piece::Triangles(10, 11), Role::Helper));
        let aside = Aside { is_negative: false, text: "modifier \"a & b\" of object 4".into() };
        assert_eq!((part.aside(4), modifier.aside(4)), (None, Some(aside)));
        for (kind, role) in [
            ("normal_part", Role::Part),
            ("modifier_part", Role::Helper),
            ("support_enforcer", Role::Helper),
            ("support_blocker", Role::Helper),
            ("negative_part", Role::Negative),
        ] {
            let text =
                format!("<config><object id=\"3\"><part id=\"2\" subtype=\"{kind}\"/></object><plate/></config>");
            let found = volumes(&text).expect(kind);
            assert_eq!((found[&3][0].piece, found[&3][0].role()), (Piece::Component(2), role), "{kind}");
        }
    }

    #[test]
    fn faults_of_settings_are_named() {
        for (text, code, say) in [
            ("<config><object id=\"a\"/></config>", "3mf-volumes", "id = \"a\" is not a number"),
            ("<config><object id=\"1\"><volume firstid=\"0\"/></object></config>", "3mf-volumes", "lastid = \"\""),
            ("<config><object id=\"1\">", "3mf-xml", "cut short"),
            ("<config><object id=1/></config>", "3mf-xml", "well-formed"),
            ("<!DOCTYPE a><config/>", "3mf-xml", "DTD"),
        ] {
            let d = volumes(text).expect_err(text);
            assert!(d.code == code && d.message.contains(say) && d.message.contains("x_model.config"), "{d}");
        }
    }

    #[test]
    fn parts_with_settings_are_known_by_name() {
        for part in ["Metadata/Slic3r_PE_model.config", "metadata/Model_Settings.config"] {
            assert!(has_volumes(part), "{part}");
        }
        for part in ["Metadata/Slic3r_PE.config", "Metadata/project_settings.config", "3D/a_model.config"] {
            assert!(!has_volumes(part), "{part}");
        }
    }
}
