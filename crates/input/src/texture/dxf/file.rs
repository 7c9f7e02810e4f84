//! The sections of a file: header, tables, blocks and entities of model space, as far as a drawing needs them.
//!
//! Files whose order is damaged are read as far as their sections can be told apart: blocks and layers are known by
//! their names, whatever comes first.

use std::collections::HashMap;

use super::colour::{BLACK, EntityPaint};
use super::entity::{Entity, EntityKind, LineType, VertexDefaults, extrusion, kind, vertex};
use super::record::Record;
use super::tags::{EXPORT, Fault, Tag, TagPlace, Tags};
use super::tally::{Issue, Tally};
use super::text::is_blank;
use terrace_core::diag::Diag;
use terrace_core::geom::SpacePoint;

/// The number of layer `0`.
pub(super) const LAYER_0: u32 = 0;

/// Most names of each kind: layers, blocks, line types.
const MAX_NAMES: usize = 1_000_000;

/// Group codes from this on hold data of other programs.
const FOREIGN: i32 = 999;

#[derive(Debug)]
pub(super) struct DxfLayer {
    pub(super) name: String,
    pub(super) is_frozen: bool,
    pub(super) is_off: bool,
    pub(super) is_plotted: bool,
    pub(super) paint: EntityPaint,
    pub(super) line_type: u32,
}

#[derive(Debug, Default)]
pub(super) struct DxfBlock {
    pub(super) name: String,
    /// Whether the file defines it, itself.
    pub(super) is_here: bool,
    pub(super) base: SpacePoint,
    pub(super) entities: Vec<Entity>,
}

#[derive(Debug)]
struct LineTypeRow {
    name: String,
    /// Whether it needs a row of the table, and the file has none.
    is_undefined: bool,
    is_dashed: bool,
}

/// A list of things that are known by names; case does not matter.
#[derive(Debug)]
pub(super) struct NamedList<T> {
    pub(super) list: Vec<T>,
    numbers: HashMap<String, u32>,
}

impl<T> NamedList<T> {
    /// The number of a name; the first use makes its thing.
    fn number(&mut self, name: &str, make: impl FnOnce() -> T) -> u32 {
        if let Some(&number) = self.numbers.get(&name.to_uppercase()) {
            return number;
        }
        // Beyond any real drawing: the rest is taken as one.
        if self.list.len() >= MAX_NAMES {
            return u32::try_from(self.list.len() - 1).expect("fewer than 2^32");
        }
        let next = u32::try_from(self.list.len()).expect("fewer than 2^32");
        self.list.push(make());
        self.numbers.insert(name.to_uppercase(), next);
        next
    }
}

impl<T> Default for NamedList<T> {
    fn default() -> Self {
        Self { list: Vec::new(), numbers: HashMap::new() }
    }
}

/// A drawing file.
#[derive(Debug, Default)]
pub(super) struct File {
    /// $INSUNITS.
    pub(super) unit: Option<i64>,
    pub(super) layers: NamedList<DxfLayer>,
    line_types: NamedList<LineTypeRow>,
    pub(super) blocks: NamedList<DxfBlock>,
    pub(super) entities: Vec<Entity>,
    /// Names of types of entities.
    types: NamedList<String>,
    pub(super) has_end: bool,
    /// What is known to be left out before blocks are inserted.
    pub(super) tally: Tally,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Section {
    Outside,
    Header,
    Tables,
    Blocks,
    Entities,
    Objects,
    Other,
}

/// Reads a file.
///
/// # Errors
/// `dxf-format`, `dxf-syntax`, `dxf-number`.
pub(super) fn read(bytes: &[u8]) -> Result<File, Fault> {
    let mut parser = Parser::default();
    parser.file.layer("0");
    let mut tags = Tags::new(bytes);
    let mut next = tags.next()?;
    // Comments may come first.
    while next.is_some_and(|t| t.code == FOREIGN) {
        next = tags.next()?;
    }
    match next {
        Some(tag) if tag.code == 0 && tag.bytes() == b"SECTION" => {}
        other => return Err(foreign(other)),
    }
    let mut list: Vec<Tag<'_>> = Vec::new();
    while let Some(head) = next {
        list.clear();
        if head.bytes() == b"EOF" {
            // What comes after it is not a drawing.
            parser.file.has_end = true;
            break;
        }
        next = loop {
            match tags.next()? {
                Some(tag) if tag.code == 0 => break Some(tag),
                Some(tag) if tag.code < FOREIGN => list.push(tag),
                Some(_) => {}
                None => break None,
            }
        };
        parser.record(&Record { kind: head.bytes(), at: head.at, tags: &list })?;
    }
    parser.end_polyline();
    Ok(parser.file)
}

fn foreign(found: Option<Tag<'_>>) -> Fault {
    let text = "this is not a DXF drawing: it does not begin with a section";
    let d = match found {
        Some(tag) => tag.at.fault("dxf-format", text),
        None => Diag::input("dxf-format", text),
    };
    d.hint(EXPORT).into()
}

struct Parser {
    file: File,
    section: Section,
    /// The block that is being defined.
    block: Option<u32>,
    /// A polyline whose vertices follow.
    polyline: Option<OpenPolyline>,
}

/// A polyline whose vertices are records of their own.
struct OpenPolyline {
    entity: Entity,
    defaults: VertexDefaults,
    place: EntityPlace,
}

/// Where an entity belongs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum EntityPlace {
    Model,
    Block(u32),
    Paper,
}

impl Default for Parser {
    fn default() -> Self {
        Self { file: File::default(), section: Section::Outside, block: None, polyline: None }
    }
}

impl Parser {
    fn record(&mut self, r: &Record<'_, '_>) -> Result<(), Fault> {
        match r.kind {
            b"SECTION" => {
                self.end_polyline();
                self.block = None;
                self.section = match r.tag(2).map(Tag::bytes) {
                    Some(b"HEADER") => Section::Header,
                    Some(b"TABLES") => Section::Tables,
                    Some(b"BLOCKS") => Section::Blocks,
                    Some(b"ENTITIES") => Section::Entities,
                    Some(b"OBJECTS") => Section::Objects,
                    _ => Section::Other,
                };
                if self.section == Section::Header {
                    self.header(r.tags)?;
                }
                return Ok(());
            }
            b"ENDSEC" => {
                self.end_polyline();
                self.section = Section::Outside;
                return Ok(());
            }
            _ => {}
        }
        match (self.section, r.kind) {
            (Section::Tables, b"LAYER") => return self.layer_row(r),
            (Section::Tables, b"LTYPE") => {
                let name = r.tag(2).map(Tag::text).unwrap_or_default();
                let number = self.file.line_type(&name);
                let row = &mut self.file.line_types.list[number as usize];
                row.is_undefined = false;
                row.is_dashed = r.whole(73)?.unwrap_or(0) > 0;
            }
            (Section::Blocks, b"BLOCK") => return self.begin_block(r),
            (Section::Blocks, b"ENDBLK") => {
                self.end_polyline();
                self.block = None;
            }
            (Section::Blocks, _) => match self.block {
                Some(block) => return self.entity(r, EntityPlace::Block(block)),
                None => self.outside(r),
            },
            (Section::Entities, _) => return self.entity(r, EntityPlace::Model),
            // Clips of blocks hang on inserts by way of dictionaries; that there are any is all that can be said.
            (Section::Objects, b"SPATIAL_FILTER") => self.count(Issue::Clip, r),
            (Section::Outside, _) => self.outside(r),
            _ => {}
        }
        Ok(())
    }

    fn header(&mut self, tags: &[Tag<'_>]) -> Result<(), Fault> {
        let mut tags = tags.iter();
        while let Some(tag) = tags.next() {
            if tag.code == 9 && tag.bytes() == b"$INSUNITS" {
                self.file.unit = tags.next().map(Tag::whole).transpose()?;
            }
        }
        Ok(())
    }

    /// A row of the LAYER table.
    fn layer_row(&mut self, r: &Record<'_, '_>) -> Result<(), Fault> {
        const FROZEN: i64 = 1;
        /// Black or white, against the background.
        const DEFAULT_COLOUR: i64 = 7;
        let number = self.file.layer(&r.tag(2).map(Tag::text).unwrap_or_default());
        let index = r.whole(62)?.unwrap_or(DEFAULT_COLOUR);
        let line_type = r.tag(6).map(|t| self.file.line_type(&t.text()));
        let layer = &mut self.file.layers.list[number as usize];
        layer.is_frozen = r.has(70, FROZEN)?;
        // A negative number of its colour switches a layer off.
        layer.is_off = index < 0;
        layer.is_plotted = r.whole(290)? != Some(0);
        // A true colour goes before the colour of a number.
        layer.paint = match r.whole(420)? {
            Some(rgb) => EntityPaint::of_rgb(rgb),
            None => EntityPaint::of_index(index.saturating_abs()),
        };
        layer.line_type = line_type.unwrap_or(layer.line_type);
        Ok(())
    }

    fn begin_block(&mut self, r: &Record<'_, '_>) -> Result<(), Fault> {
        const EXTERNAL: i64 = 4 | 8;
        self.end_polyline();
        let number = self.file.block(&r.tag(2).map(Tag::text).unwrap_or_default());
        let block = &mut self.file.blocks.list[number as usize];
        block.is_here = !r.has(70, EXTERNAL)?;
        block.base = r.point(10)?.unwrap_or_default();
        self.block = Some(number);
        Ok(())
    }

    fn entity(&mut self, r: &Record<'_, '_>, place: EntityPlace) -> Result<(), Fault> {
        match (r.kind, &mut self.polyline) {
            (b"VERTEX", Some(open)) => {
                if let EntityKind::Polyline(line) = &mut open.entity.kind {
                    line.vertices.extend(vertex(r, &open.defaults)?);
                }
                return Ok(());
            }
            (b"SEQEND", _) => {
                self.end_polyline();
                return Ok(());
            }
            _ => self.end_polyline(),
        }
        if r.kind == b"VERTEX" {
            self.outside(r);
            return Ok(());
        }
        let place = if r.has(67, 1)? || self.is_paper(place) { EntityPlace::Paper } else { place };
        if place == EntityPlace::Paper && r.kind != b"POLYLINE" {
            self.count(Issue::Paper, r);
            return Ok(());
        }
        let entity = self.defined(r, place)?;
        match entity {
            Entity { kind: EntityKind::Polyline(_), .. } if r.kind == b"POLYLINE" => {
                self.polyline = Some(OpenPolyline { entity, defaults: VertexDefaults::of(r)?, place });
            }
            Entity { kind: EntityKind::Unread(_), .. } if r.kind == b"POLYLINE" => {
                // Its vertices are read and dropped.
                self.polyline = Some(OpenPolyline { entity, defaults: VertexDefaults::default(), place });
            }
            _ => self.put(entity, place),
        }
        Ok(())
    }

    /// Whether it is the block of a paper space.
    fn is_paper(&self, place: EntityPlace) -> bool {
        let EntityPlace::Block(block) = place else { return false };
        let name = self.file.blocks.list[block as usize].name.to_uppercase();
        name.starts_with("*PAPER_SPACE") || name.starts_with("$PAPER_SPACE")
    }

    /// The entity that a record describes.
    fn defined(&mut self, r: &Record<'_, '_>, place: EntityPlace) -> Result<Entity, Fault> {
        let file = &mut self.file;
        let mut kind = kind(r, |name| file.block(name))?;
        // An attribute's definition shows its text only where it is constant, or in no block.
        if r.kind == b"ATTDEF" && place != EntityPlace::Model && !r.has(70, 2)? {
            kind = EntityKind::Unread(Issue::Ignored);
        }
        if matches!(kind, EntityKind::Unread(Issue::Text)) && is_blank(r) {
            kind = EntityKind::Unread(Issue::Ignored);
        }
        let is_hidden = r.has(60, 1)? || (r.kind.starts_with(b"ATT") && r.has(70, 1)?);
        let line_type = match r.tag(6).map(Tag::text) {
            None => LineType::Layer,
            Some(name) if name.eq_ignore_ascii_case("BYLAYER") => LineType::Layer,
            Some(name) if name.eq_ignore_ascii_case("BYBLOCK") => LineType::Block,
            Some(name) => LineType::Own(file.line_type(&name)),
        };
        let paint = match (r.whole(420)?, r.whole(62)?) {
            (Some(rgb), _) => EntityPaint::of_rgb(rgb),
            (None, index) => EntityPaint::of_index(index.unwrap_or(256)),
        };
        Ok(Entity {
            kind,
            what: file.what(r.kind),
            handle: handle(r),
            at: r.at,
            layer: match r.tag(8) {
                Some(tag) => file.layer(&tag.text()),
                None => LAYER_0,
            },
            paint,
            line_type,
            is_hidden,
            extrusion: extrusion(r)?,
        })
    }

    fn end_polyline(&mut self) {
        if let Some(OpenPolyline { entity, place, .. }) = self.polyline.take() {
            self.put(entity, place);
        }
    }

    /// Puts an entity where it belongs; those of paper space are counted alone.
    fn put(&mut self, entity: Entity, place: EntityPlace) {
        match place {
            EntityPlace::Model => self.file.entities.push(entity),
            EntityPlace::Block(block) => self.file.blocks.list[block as usize].entities.push(entity),
            EntityPlace::Paper => {
                let name = self.file.name(&entity);
                self.file.tally.add(Issue::Paper, "POLYLINE", || name);
            }
        }
    }

    /// Counts a record that belongs to no section or block.
    fn outside(&mut self, r: &Record<'_, '_>) {
        self.count(Issue::Outside, r);
    }

    fn count(&mut self, issue: Issue, r: &Record<'_, '_>) {
        let what = shown(r.kind);
        self.file.tally.add(issue, &what, || name(&what, handle(r), r.at));
    }
}

fn handle(r: &Record<'_, '_>) -> Option<u64> {
    let text = std::str::from_utf8(r.tag(5)?.bytes()).ok()?;
    u64::from_str_radix(text, 16).ok().filter(|&h| h != 0)
}

/// The name of a type as messages show it.
fn shown(kind: &[u8]) -> String {
    kind.iter().take(40).map(|&b| char::from(b)).filter(|c| !c.is_control()).collect()
}

fn name(what: &str, handle: Option<u64>, at: TagPlace) -> String {
    match handle {
        Some(handle) => format!("{what} {handle:X}"),
        None => format!("{what} at {at}"),
    }
}

impl File {
    fn layer(&mut self, name: &str) -> u32 {
        self.layers.number(name, || DxfLayer {
            name: name.to_owned(),
            is_frozen: false,
            is_off: false,
            is_plotted: true,
            paint: EntityPaint::Colour(BLACK),
            line_type: u32::MAX,
        })
    }

    fn line_type(&mut self, name: &str) -> u32 {
        // Of names that stand for a solid line, or for the type of the layer or block, there may be no row.
        let is_undefined = || !["", "CONTINUOUS", "BYLAYER", "BYBLOCK"].iter().any(|n| name.eq_ignore_ascii_case(n));
        self.line_types.number(name, || LineTypeRow {
            name: name.to_owned(),
            is_undefined: is_undefined(),
            is_dashed: false,
        })
    }

    fn block(&mut self, name: &str) -> u32 {
        self.blocks.number(name, || DxfBlock { name: name.to_owned(), ..DxfBlock::default() })
    }

    fn what(&mut self, kind: &[u8]) -> u16 {
        let name = shown(kind);
        let number = self.types.number(&name, || name.clone());
        // Types beyond the last number share it.
        u16::try_from(number).unwrap_or(u16::MAX)
    }

    /// The type of an entity, such as `LINE`.
    pub(super) fn type_of(&self, entity: &Entity) -> &str {
        &self.types.list[usize::from(entity.what)]
    }

    /// What an entity is called in messages: type and handle, or type and place where it has none.
    pub(super) fn name(&self, entity: &Entity) -> String {
        name(self.type_of(entity), entity.handle, entity.at)
    }

    /// The name of a line type that the file does not define.
    pub(super) fn undefined_line_type(&self, line_type: u32) -> Option<&str> {
        self.line_types.list.get(line_type as usize).filter(|row| row.is_undefined).map(|row| &*row.name)
    }

    pub(super) fn is_dashed(&self, line_type: u32) -> bool {
        self.line_types.list.get(line_type as usize).is_some_and(|row| row.is_dashed)
    }
}
