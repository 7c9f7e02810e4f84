//! A model part of a 3MF file: its unit, objects and build items.
//!
//! Consumes XML as a stream, element by element; holds vertices (24 bytes each) and triangles (12). What is not
//! geometry (materials, colours, textures, tickets) is passed over; foreign elements in objects and meshes are counted.
//! Numbers are read as f64. Refused: document types, encodings other than UTF-8, prefixes without a namespace,
//! `xml:space`, required extensions that are not known, indices of vertices that do not stand before.

use std::collections::{BTreeMap, BTreeSet};
use std::io::BufRead;

use quick_xml::NsReader;
use quick_xml::events::{BytesStart, Event};
use quick_xml::name::{Namespace, ResolveResult};

use super::super::lines::{number, shown};
use super::slicer::{Aside, Volume};
use super::transform::Transform;
use super::xml::{attributes, refuse_dtd_and_encoding, text_of, xml_fault};
use terrace_core::diag::Diag;

/// Deepest nesting of elements; models have eight.
const MAX_DEPTH: usize = 256;

const CORE: &str = "http://schemas.microsoft.com/3dmanufacturing/core/2015/02";

/// What the namespaces of slicers begin with whose elements are read.
const CURA: &str = "http://software.ultimaker.com/xml/cura/";
const SLIC3R: &str = "http://schemas.slic3r.org/3mf/";

/// Extensions that change no geometry, or that are read.
const EXTENSIONS: [&str; 4] = [
    CORE,
    "http://schemas.microsoft.com/3dmanufacturing/material/2015/02",
    "http://schemas.microsoft.com/3dmanufacturing/production/2015/06",
    "http://schemas.3mf.io/3dmanufacturing/trianglesets/2021/07",
];

/// Names of metadata that need no namespace.
const METADATA: [&str; 9] = [
    "Title",
    "Designer",
    "Description",
    "Copyright",
    "LicenseTerms",
    "Rating",
    "CreationDate",
    "ModificationDate",
    "Application",
];

/// Names without a namespace that slicers in common use write all the same (Bambu Studio and what derives from it); the
/// core specification (3.4.1) forbids them, but they say nothing of the geometry.
const METADATA_OF_SLICERS: [&str; 16] = [
    "CopyRight",
    "DesignerCover",
    "DesignerUserId",
    "DesignModelId",
    "DesignProfileId",
    "DesignRegion",
    "License",
    "MakerLab",
    "MakerLabVersion",
    "Origin",
    "ProfileCover",
    "ProfileDescription",
    "ProfileTitle",
    "Region",
    "Thumbnail_Middle",
    "Thumbnail_Small",
];

/// Settings by which Cura makes an object a helper, without their prefix, and what such an object is called.
const HELPERS_OF_CURA: [(&str, &str); 4] = [
    ("infill_mesh", "modifier"),
    ("cutting_mesh", "modifier"),
    ("support_mesh", "support"),
    ("anti_overhang_mesh", "support blocker"),
];

const AGAIN: &str = "export the surface again as 3MF or STL";

/// A model part.
#[derive(Debug, Default)]
pub(super) struct Model {
    /// The name of the unit and its length in mm.
    pub(super) unit: (&'static str, f64),
    pub(super) objects: Vec<Object>,
    /// Places of the objects by their ids.
    pub(super) by_id: BTreeMap<u32, usize>,
    pub(super) items: Vec<Instance>,
    /// Elements in objects and meshes that are not read, with their numbers.
    pub(super) foreign: BTreeMap<String, usize>,
    /// Names of metadata that 3MF does not know, or that are there twice.
    pub(super) odd_metadata: BTreeSet<String>,
}

/// What an object is for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Kind {
    /// The part, or a surface of it.
    Part,
    /// Supports, which are not the part.
    Support,
    /// Anything that is not built.
    Other,
}

/// An object: a mesh, or components, or neither where an extension has its shape.
#[derive(Debug)]
pub(super) struct Object {
    pub(super) id: u32,
    pub(super) kind: Kind,
    pub(super) vertices: Vec<[f64; 3]>,
    pub(super) triangles: Vec<[u32; 3]>,
    pub(super) components: Vec<Instance>,
    /// What it is where a slicer says that it is not the part.
    pub(super) aside: Option<Aside>,
    /// Volumes that slicers divide its triangles into.
    pub(super) volumes: Vec<Volume>,
    has_shape: bool,
}

impl Object {
    /// Whether it has a mesh or components.
    pub(super) fn has_shape(&self) -> bool {
        self.has_shape
    }
}

/// An object that is placed: by a build item or by a component.
#[derive(Clone, Debug)]
pub(super) struct Instance {
    pub(super) object: u32,
    /// The model part, where it is not that of the instance.
    pub(super) path: Option<String>,
    pub(super) transform: Transform,
    /// Whether it is to be made; slicers keep items on the plate that are not.
    pub(super) is_printable: bool,
    /// What it is where a slicer says that it is not the part.
    pub(super) aside: Option<Aside>,
}

/// Elements that are read.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Tag {
    Model,
    Resources,
    Object,
    Mesh,
    Vertices,
    Vertex,
    Triangles,
    Triangle,
    Components,
    Component,
    Build,
    Item,
    Metadata,
    Settings,
    Setting,
    Volumes,
    Volume,
    Other,
}

/// The element of this name within another.
fn tag(parent: Option<Tag>, name: &str) -> Tag {
    match (parent, name) {
        (None, "model") => Tag::Model,
        (Some(Tag::Model), "resources") => Tag::Resources,
        (Some(Tag::Model), "build") => Tag::Build,
        (Some(Tag::Model), "metadata") => Tag::Metadata,
        (Some(Tag::Resources), "object") => Tag::Object,
        (Some(Tag::Object), "mesh") => Tag::Mesh,
        (Some(Tag::Object), "components") => Tag::Components,
        (Some(Tag::Mesh), "vertices") => Tag::Vertices,
        (Some(Tag::Mesh), "triangles") => Tag::Triangles,
        (Some(Tag::Vertices), "vertex") => Tag::Vertex,
        (Some(Tag::Triangles), "triangle") => Tag::Triangle,
        (Some(Tag::Components), "component") => Tag::Component,
        (Some(Tag::Build), "item") => Tag::Item,
        (Some(Tag::Object), "metadatagroup") => Tag::Settings,
        (Some(Tag::Settings), "metadata") => Tag::Setting,
        _ => Tag::Other,
    }
}

/// The element of a slicer's namespace within another.
fn foreign_tag(space: &str, parent: Option<Tag>, name: &str) -> Tag {
    let is_cura = space.starts_with(CURA);
    let is_slic3r = space.starts_with(SLIC3R);
    match (parent, name) {
        (Some(Tag::Object), "settings") if is_cura => Tag::Settings,
        (Some(Tag::Settings), "setting") if is_cura => Tag::Setting,
        (Some(Tag::Mesh), "volumes") if is_slic3r => Tag::Volumes,
        (Some(Tag::Volumes), "volume") if is_slic3r => Tag::Volume,
        _ => Tag::Other,
    }
}

/// Reads a model part; `name` is its name in the archive.
pub(super) fn read(input: &mut dyn BufRead, name: &str) -> Result<Model, Diag> {
    let mut reader = NsReader::from_reader(input);
    reader.config_mut().expand_empty_elements = true;
    let mut parser =
        Parser { name, model: Model::default(), stack: Vec::new(), metadata: BTreeSet::new(), setting: None };
    let mut buffer = Vec::new();
    let mut has_model = false;
    loop {
        buffer.clear();
        match reader.read_event_into(&mut buffer).map_err(|e| xml_fault(name, &e))? {
            Event::Start(e) => {
                let (space, local) = reader.resolver().resolve_element(e.name());
                let space = match space {
                    ResolveResult::Bound(Namespace(space)) => space,
                    ResolveResult::Unbound => "",
                    ResolveResult::Unknown(prefix) => return Err(no_namespace(name, &prefix)),
                };
                let is_core = space == CORE;
                let parent = parser.stack.last().copied();
                let tag =
                    if is_core { tag(parent, local.as_ref()) } else { foreign_tag(space, parent, local.as_ref()) };
                has_model |= tag == Tag::Model;
                if tag == Tag::Model {
                    parser.model(&e, &|prefix| namespace(&reader, prefix))?;
                } else {
                    parser.start(tag, &e, is_core)?;
                }
                parser.stack.push(tag);
                if parser.stack.len() > MAX_DEPTH {
                    return Err(parser.fault("3mf-xml", format!("elements are nested deeper than {MAX_DEPTH}")));
                }
            }
            Event::End(_) => {
                parser.stack.pop();
                parser.setting = None;
            }
            Event::Text(text) => parser.text(&text),
            Event::Eof => break,
            event => refuse_dtd_and_encoding(&event, name)?,
        }
    }
    if !parser.stack.is_empty() || !has_model {
        let text = if has_model { "an element is not closed: the part is cut short" } else { "there is no core model" };
        return Err(parser.fault("3mf-xml", text.into()));
    }
    Ok(parser.model)
}

/// The namespace of a prefix.
fn namespace<R>(reader: &NsReader<R>, prefix: &str) -> Option<String> {
    let name = format!("{prefix}:x");
    match reader.resolver().resolve_element(quick_xml::name::QName(&name)).0 {
        ResolveResult::Bound(Namespace(space)) => Some(space.to_owned()),
        _ => None,
    }
}

/// A part as it is read.
struct Parser<'a> {
    name: &'a str,
    model: Model,
    /// The elements that are open.
    stack: Vec<Tag>,
    /// Names of metadata so far.
    metadata: BTreeSet<String>,
    /// What the setting that is open makes the object, if it is true.
    setting: Option<&'static str>,
}

impl Parser<'_> {
    fn fault(&self, code: &'static str, text: String) -> Diag {
        let object = match self.model.objects.last() {
            Some(object) if self.stack.contains(&Tag::Object) => format!(", object {}", object.id),
            _ => String::new(),
        };
        Diag::input(code, format!("{}{object}: {text}", self.name)).hint(AGAIN)
    }

    /// The root element: the unit and the extensions.
    fn model(&mut self, e: &BytesStart<'_>, namespace: &dyn Fn(&str) -> Option<String>) -> Result<(), Diag> {
        let mut unit = None;
        let mut required = None;
        attributes(e, self.name, |key, value| {
            match key {
                "unit" => unit = Some(text_of(value, self.name)?),
                "requiredextensions" => required = Some(text_of(value, self.name)?),
                _ => {}
            }
            Ok(())
        })?;
        let unit = unit.as_deref().unwrap_or("millimeter");
        self.model.unit = match unit {
            "micron" => ("micron", 1e-3),
            "millimeter" => ("millimeter", 1.0),
            "centimeter" => ("centimeter", 10.0),
            "inch" => ("inch", 25.4),
            "foot" => ("foot", 304.8),
            "meter" => ("meter", 1000.0),
            other => {
                let text = format!("unit \"{}\" is not one of 3MF", shown(other.as_bytes()));
                let d = self.fault("surface-unit", text);
                return Err(d.hint("a 3MF file is in micron, millimeter, centimeter, inch, foot or meter"));
            }
        };
        for prefix in required.iter().flat_map(|r| r.split_ascii_whitespace()) {
            let space = namespace(prefix).ok_or_else(|| no_namespace(self.name, prefix))?;
            if !EXTENSIONS.contains(&space.as_str()) {
                let text = format!("it requires the extension {}, which is not read", shown(space.as_bytes()));
                let hint =
                    "export the surface as plain triangles, without slices, lattices, displacement or encryption";
                return Err(self.fault("3mf-extension", text).hint(hint));
            }
        }
        Ok(())
    }

    /// An element that begins.
    fn start(&mut self, tag: Tag, e: &BytesStart<'_>, is_core: bool) -> Result<(), Diag> {
        match tag {
            Tag::Object => self.object(e),
            Tag::Vertex => self.vertex(e),
            Tag::Triangle => self.triangle(e),
            Tag::Metadata => self.metadata(e),
            Tag::Setting => self.setting(e),
            Tag::Volume => self.volume(e),
            Tag::Component => {
                let instance = self.instance(e)?;
                self.last().components.push(instance);
                Ok(())
            }
            Tag::Item => {
                let instance = self.instance(e)?;
                self.model.items.push(instance);
                Ok(())
            }
            Tag::Mesh | Tag::Components => {
                self.last().has_shape = true;
                attributes(e, self.name, |_, _| Ok(()))
            }
            Tag::Vertices if e.attributes().with_checks(false).next().is_some() => {
                Err(self.fault("3mf-xml", "the list of vertices has an attribute, it may have none".into()))
            }
            Tag::Other => {
                let parent = self.stack.last();
                if !is_core && matches!(parent, Some(Tag::Object | Tag::Mesh)) {
                    let element = e.local_name();
                    if element.as_ref() != "trianglesets" {
                        *self.model.foreign.entry(shown(element.as_ref().as_bytes())).or_default() += 1;
                    }
                }
                if parent.is_none() {
                    return Err(self.fault("3mf-xml", "this is not a model of the core specification".into()));
                }
                attributes(e, self.name, |_, _| Ok(()))
            }
            _ => attributes(e, self.name, |_, _| Ok(())),
        }
    }

    /// The object that is open: elements below one are read there only.
    fn last(&mut self) -> &mut Object {
        self.model.objects.last_mut().expect("an object is open")
    }

    fn object(&mut self, e: &BytesStart<'_>) -> Result<(), Diag> {
        let (mut id, mut kind) = (None, Kind::Part);
        attributes(e, self.name, |key, value| {
            match key {
                "id" => id = identifier(value),
                "type" => {
                    kind = match value {
                        "support" | "solidsupport" => Kind::Support,
                        "model" | "surface" => Kind::Part,
                        _ => Kind::Other,
                    }
                }
                _ => {}
            }
            Ok(())
        })?;
        let id = id.ok_or_else(|| self.fault("3mf-object", "an object has no id above 0".into()))?;
        let object = Object {
            id,
            kind,
            vertices: vec![],
            triangles: vec![],
            components: vec![],
            aside: None,
            volumes: vec![],
            has_shape: false,
        };
        if self.model.by_id.insert(id, self.model.objects.len()).is_some() {
            return Err(self.fault("3mf-object", format!("two objects have the id {id}")));
        }
        self.model.objects.push(object);
        Ok(())
    }

    fn vertex(&mut self, e: &BytesStart<'_>) -> Result<(), Diag> {
        let mut p = [None; 3];
        let n = self.last().vertices.len();
        attributes(e, self.name, |key, value| {
            let axis = match key {
                "x" => 0,
                "y" => 1,
                "z" => 2,
                _ => return Ok(()),
            };
            let v = number(value.trim().as_bytes()).map_err(|_| {
                self.fault(
                    "surface-number",
                    format!("vertex {n}: {key} = \"{}\" is not a number", shown(value.as_bytes())),
                )
            })?;
            p[axis] = Some(v);
            Ok(())
        })?;
        let [Some(x), Some(y), Some(z)] = p else {
            return Err(self.fault("surface-number", format!("vertex {n} has no x, y and z")));
        };
        self.last().vertices.push([x, y, z]);
        Ok(())
    }

    fn triangle(&mut self, e: &BytesStart<'_>) -> Result<(), Diag> {
        let mut corners = [None; 3];
        let object = self.last();
        let (n, vertices) = (object.triangles.len(), object.vertices.len());
        attributes(e, self.name, |key, value| {
            let corner = match key {
                "v1" => 0,
                "v2" => 1,
                "v3" => 2,
                _ => return Ok(()),
            };
            let index = value.trim().parse::<u32>().ok().filter(|&i| (i as usize) < vertices);
            corners[corner] = Some(index.ok_or_else(|| {
                let text = format!(
                    "triangle {n}: {key} = \"{}\", but the vertices before it are 0 to {}",
                    shown(value.as_bytes()),
                    vertices as i64 - 1
                );
                self.fault("3mf-index", text)
            })?);
            Ok(())
        })?;
        let [Some(a), Some(b), Some(c)] = corners else {
            return Err(self.fault("3mf-index", format!("triangle {n} has no v1, v2 and v3")));
        };
        self.last().triangles.push([a, b, c]);
        Ok(())
    }

    fn instance(&self, e: &BytesStart<'_>) -> Result<Instance, Diag> {
        let mut object = None;
        let mut path = None;
        let mut transform = Transform::IDENTITY;
        let mut is_printable = true;
        attributes(e, self.name, |key, value| {
            // The path has the prefix of the production extension; nothing else is called so.
            match key.rsplit_once(':').map_or(key, |(_, local)| local) {
                "objectid" => object = identifier(value),
                "path" => path = Some(text_of(value, self.name)?),
                "transform" => {
                    transform = Transform::parsed(value).map_err(|text| self.fault("3mf-transform", text))?
                }
                "printable" => is_printable = !["0", "false"].contains(&value.trim()),
                _ => {}
            }
            Ok(())
        })?;
        let object = object.ok_or_else(|| self.fault("3mf-object", "an item or component has no objectid".into()))?;
        Ok(Instance { object, path, transform, is_printable, aside: None })
    }

    fn metadata(&mut self, e: &BytesStart<'_>) -> Result<(), Diag> {
        let mut named = None;
        attributes(e, self.name, |key, value| {
            if key == "name" {
                named = Some(text_of(value, self.name)?);
            }
            Ok(())
        })?;
        let named = named.unwrap_or_default();
        let is_known = named.contains(':') || METADATA.iter().chain(&METADATA_OF_SLICERS).any(|name| *name == named);
        if !self.metadata.insert(named.clone()) || !is_known {
            self.model.odd_metadata.insert(shown(named.as_bytes()));
        }
        Ok(())
    }

    /// A setting of an object; its value follows as text.
    fn setting(&mut self, e: &BytesStart<'_>) -> Result<(), Diag> {
        let mut setting = None;
        attributes(e, self.name, |key, value| {
            if ["name", "key"].contains(&key) {
                let value = value.trim();
                let named = value.strip_prefix("cura:").unwrap_or(value);
                setting = HELPERS_OF_CURA.iter().find(|(name, _)| *name == named).map(|(_, helper)| *helper);
            }
            Ok(())
        })?;
        self.setting = setting;
        Ok(())
    }

    /// Text: the value of the setting that is open.
    fn text(&mut self, text: &str) {
        let Some(helper) = self.setting else { return };
        if ["true", "1"].contains(&text.trim().to_ascii_lowercase().as_str()) {
            let object = self.last();
            object.aside = Some(Aside { is_negative: false, text: format!("{helper}, object {}", object.id) });
        }
    }

    /// A volume of Slic3r: a range of triangles.
    fn volume(&mut self, e: &BytesStart<'_>) -> Result<(), Diag> {
        let mut first = None;
        let mut last = None;
        let mut is_modifier = false;
        attributes(e, self.name, |key, value| {
            match key {
                "ts" => first = value.trim().parse().ok(),
                "te" => last = value.trim().parse().ok(),
                "modifier" => is_modifier = value.trim() == "1",
                _ => {}
            }
            Ok(())
        })?;
        let (Some(first), Some(last)) = (first, last) else {
            return Err(self.fault("3mf-volumes", "a volume has no first and last triangle".into()));
        };
        self.last().volumes.push(Volume::triangles(first, last, if is_modifier { "modifier" } else { "" }));
        Ok(())
    }
}

/// An id: a whole number above 0.
fn identifier(value: &str) -> Option<u32> {
    value.trim().parse().ok().filter(|&id| id > 0)
}

fn no_namespace(name: &str, prefix: &str) -> Diag {
    let text = format!("{name}: the prefix {} has no namespace", shown(prefix.as_bytes()));
    Diag::input("3mf-xml", text).hint(AGAIN)
}
