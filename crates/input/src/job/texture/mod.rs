//! One `[[texture]]` of a job: its keys, and the request that they make.

pub(super) mod by_source;
pub mod keys;
mod mask;
mod page;
mod tone;

use std::collections::BTreeMap;
use std::path::Path;

use super::faults::Faults;
use super::file_unit::FileUnit;
use crate::texture;
use crate::texture::direction::Direction;
use keys::{AreaKeys, AreaName, CurvesKeys, DrawingKeys, OnUnsupported, PaperKeys, SourceKeys, TextureKeys};
use terrace_core::diag::Diag;
use terrace_core::geom::{BoxMm, Nm, Pose};
use terrace_core::program::{Pen, PenId};
use terrace_core::units::Length;

/// One `[[texture]]`.
pub(super) struct Texture<'a> {
    pub(super) i: usize,
    pub(super) keys: &'a TextureKeys,
    pub(super) folder: &'a Path,
    pub(super) pens: &'a [Pen],
    /// The processing depth of focus.
    pub(super) pdof: Nm,
    /// How the surface file is rotated.
    pub(super) pose: Option<Pose>,
}

impl Texture<'_> {
    /// A key of its table, as faults name it.
    fn key(&self, name: &str) -> String {
        format!("texture.{}.{name}", self.i)
    }

    /// The request that it makes.
    pub(super) fn resolve(&self, f: &mut Faults<'_>) -> texture::Request {
        let pen = self.pen(f);
        let area = self.area(f);
        let kind = self.kind(f);
        let masks = mask::resolve(self, f);
        texture::Request { kind, area, tolerance_mm: self.keys.common.tolerance.as_mm(), pen, masks }
    }

    /// The index of its pen; the first where none is named.
    fn pen(&self, f: &mut Faults<'_>) -> PenId {
        self.keys.common.pen.as_ref().map_or(PenId(0), |name| self.named_pen("pen", name, f))
    }

    /// The index of a pen that a key names.
    fn named_pen(&self, key: &str, name: &str, f: &mut Faults<'_>) -> PenId {
        match self.pens.iter().position(|p| p.name == name) {
            Some(i) => PenId(i as u16),
            None => {
                let names: Vec<_> = self.pens.iter().map(|p| p.name.as_str()).collect();
                f.push(
                    &self.key(key),
                    Diag::input("pen-unknown", format!("there is no pen named {name:?}"))
                        .hint(format!("pens of this job: {}", names.join(", "))),
                );
                PenId(0)
            }
        }
    }

    /// The area of the texture, which may be empty.
    fn area_as_given(&self) -> texture::Area {
        match &self.keys.common.area {
            Some(AreaKeys::Named(AreaName::Part)) => texture::Area::Part,
            None if matches!(self.keys.source, SourceKeys::Pattern(_)) => texture::Area::Part,
            None => texture::Area::Unlimited,
            Some(AreaKeys::Rectangle(r)) => {
                let [x0, y0, x1, y1] = r.map(Length::as_mm);
                texture::Area::Rectangle(BoxMm::rectangle(x0, y0, x1, y1))
            }
        }
    }

    /// The area of the texture.
    fn area(&self, f: &mut Faults<'_>) -> texture::Area {
        if let Some(AreaKeys::Rectangle(r)) = &self.keys.common.area {
            let [x0, y0, x1, y1] = r.map(Length::as_mm);
            if x0 >= x1 || y0 >= y1 {
                let text = format!("the area is empty: x from {x0} to {x1} mm, y from {y0} to {y1} mm");
                f.push(
                    &self.key("area"),
                    Diag::input("texture-area", text).hint("write [x0, y0, x1, y1] with the lower left corner first"),
                );
            }
        }
        self.area_as_given()
    }

    /// What it is made from.
    fn kind(&self, f: &mut Faults<'_>) -> texture::Kind {
        match &self.keys.source {
            SourceKeys::Pattern(pattern) => {
                pattern.faults().into_iter().for_each(|(key, fault)| f.push(&self.key(key), fault));
                pattern.kind(self.keys.common.seed.unwrap_or(0))
            }
            SourceKeys::File(keys) => self.drawing(keys, f),
            SourceKeys::Curves(keys) => self.curves(keys, f),
        }
    }

    /// A unit of its file, where it is stated.
    fn unit(&self) -> Option<FileUnit> {
        match &self.keys.source {
            SourceKeys::Pattern(_) => None,
            SourceKeys::File(keys) => keys.unit,
            SourceKeys::Curves(keys) => keys.unit,
        }
    }

    /// A drawing or a bitmap.
    fn drawing(&self, keys: &DrawingKeys, f: &mut Faults<'_>) -> texture::Kind {
        if keys.unit.is_some() && !is_dxf(&keys.file) {
            let fault = Diag::input("texture-key", "unit applies to DXF drawings alone");
            f.push(&self.key("unit"), fault.hint("use size for the width and height of the page"));
        }
        if keys.tile && self.keys.common.area.is_none() {
            f.push(
                &self.key("tile"),
                Diag::input("texture-tile", "tile = true needs an area to fill")
                    .hint("add area = \"part\" or area = [x0, y0, x1, y1]"),
            );
        }
        let (size, position) = page::resolve(keys.into(), &|name| self.key(name), f);
        texture::Kind::Drawing {
            path: self.folder.join(&keys.file),
            size,
            unit_mm: keys.unit.map(FileUnit::in_mm),
            position,
            turn_rad: keys.turn.as_rad(),
            tile: keys.tile,
            marking: Box::new(self.marking(keys, f)),
        }
    }

    /// Curves in space.
    fn curves(&self, keys: &CurvesKeys, f: &mut Faults<'_>) -> texture::Kind {
        if self.keys.common.area.is_some() {
            let fault = Diag::input("texture-key", "area does not apply to space curves, which stay where they are");
            f.push(
                &self.key("area"),
                fault.hint("leave out curves by only or except, or trim them in the CAD program"),
            );
        }
        let (only, except) = self.selected([&keys.only, &keys.except], f);
        let marking = texture::Marking {
            pens: self.pens_of(&keys.pens, f),
            is_lenient: keys.on_unsupported == Some(OnUnsupported::Warn),
            only,
            except,
            ..texture::Marking::default()
        };
        let half = self.pdof / 2;
        texture::Kind::Curves {
            path: self.folder.join(&keys.curves),
            unit_mm: keys.unit.map(FileUnit::in_mm),
            marking: Box::new(marking),
            pose: self.pose,
            max_distance: keys.max_distance.map_or(half, |d| f.nm(&self.key("max_distance"), d)),
            on_distance: keys.on_distance.unwrap_or_default(),
        }
    }

    /// How a drawing is marked.
    fn marking(&self, keys: &DrawingKeys, f: &mut Faults<'_>) -> texture::Marking {
        let (direction_rad, along_contours) = match keys.direction {
            Direction::Angle(angle) => (angle.as_rad(), None),
            Direction::Contour => (0.0, Some(0.0)),
        };
        let no_contours = [
            (keys.tile, "tile = true"),
            (keys.screen.is_some_and(|s| s != texture::Screen::Threshold), "a screen of lines"),
            (keys.fill.is_some_and(|fill| fill != texture::FillMode::Hatch), "areas that are not hatched"),
        ];
        if let Some((_, what)) = no_contours.iter().find(|(is_given, _)| *is_given && along_contours.is_some()) {
            let fault = Diag::input("texture-key", format!("direction = \"contour\" does not apply to {what}"));
            f.push(&self.key("direction"), fault.hint("write an angle"));
        }
        if let Some(inset) = keys.inset.filter(|inset| inset.as_mm() < 0.0) {
            let fault = Diag::input("texture-key", format!("inset {inset} lies outside the area"));
            f.push(&self.key("inset"), fault.hint("write 0 or more"));
        }
        let (only, except) = self.selected([&keys.only, &keys.except], f);
        texture::Marking {
            stroke: keys.stroke.unwrap_or_default(),
            fill: keys.fill.unwrap_or_default(),
            contour: keys.contour.unwrap_or_default(),
            pens: self.pens_of(&keys.pens, f),
            pitch_mm: keys.pitch.map(Length::as_mm),
            direction_rad,
            along_contours,
            cross: keys.cross,
            one_way: keys.one_way,
            inset_mm: keys.inset.map(Length::as_mm),
            is_lenient: keys.on_unsupported == Some(OnUnsupported::Warn),
            only,
            except,
            lists_labels: false,
            paper: self.paper(keys, f),
            mirror: keys.mirror,
            tone: tone::resolve(keys, &self.keys.common, &|name| self.key(name), f),
        }
    }

    /// What `only` and `except` choose.
    fn selected(
        &self,
        [only, except]: [&[String]; 2],
        f: &mut Faults<'_>,
    ) -> (Vec<texture::Selector>, Vec<texture::Selector>) {
        (self.selectors("only", only, f), self.selectors("except", except, f))
    }

    /// What the names of a key choose.
    fn selectors(&self, key: &str, names: &[String], f: &mut Faults<'_>) -> Vec<texture::Selector> {
        names.iter().filter_map(|name| self.selector(key, name, f)).collect()
    }

    /// The pens of colours and labels.
    fn pens_of(&self, pens: &BTreeMap<String, String>, f: &mut Faults<'_>) -> Vec<(texture::Selector, PenId)> {
        let mut selected = Vec::new();
        for (name, pen) in pens {
            let pen = self.named_pen("pens", pen, f);
            selected.extend(self.selector("pens", name, f).map(|selector| (selector, pen)));
        }
        selected
    }

    /// Which colours are the page.
    fn paper(&self, keys: &DrawingKeys, f: &mut Faults<'_>) -> texture::Paper {
        // What is darker than this is not paper, but a slip such as a share (0.98) or the colour of the marks.
        const DARKEST: f64 = 50.0;
        let (paper, lightness) = match &keys.paper {
            None => return texture::Paper::default(),
            Some(PaperKeys::Lightness(lightness)) => (texture::Paper::Lightness(*lightness), *lightness),
            Some(PaperKeys::Colour(name)) => match texture::Selector::parse(name) {
                Some(texture::Selector::Colour(colour)) => (texture::Paper::Colour(colour), texture::lightness(colour)),
                _ => {
                    let fault = Diag::input("texture-key", format!("{name:?} is not a colour"));
                    f.push(&self.key("paper"), fault.hint("write \"#fefefe\", or a lightness from 50 to 100"));
                    return texture::Paper::default();
                }
            },
        };
        if !(DARKEST..=100.0).contains(&lightness) {
            let text = format!("paper has the lightness {lightness:.1}, which is not between {DARKEST} and 100");
            let hint = "write the colour of the page, or its CIE lightness: white has 100, #fafafa 98, #808080 54";
            f.push(&self.key("paper"), Diag::input("texture-key", text).hint(hint));
        }
        paper
    }

    /// What a name chooses: shapes with a label, or of a colour.
    fn selector(&self, key: &str, name: &str, f: &mut Faults<'_>) -> Option<texture::Selector> {
        let selector = texture::Selector::parse(name);
        if selector.is_none() {
            let fault = Diag::input("texture-pens", format!("{name:?} is neither a colour nor a label"));
            f.push(&self.key(key), fault.hint("write \"#ff0000\", \"layer:NAME\", \"id:NAME\" or \"class:NAME\""));
        }
        selector
    }
}

fn is_dxf(file: &Path) -> bool {
    file.extension().is_some_and(|e| e.eq_ignore_ascii_case("dxf"))
}
