//! One `[[texture]]` of a job: its keys, and the request that they make.

pub mod keys;
mod mask;
mod page;
mod tone;

use std::path::Path;

use super::direction::Direction;
use super::faults::Faults;
use super::file_unit::FileUnit;
use crate::texture;
use keys::{AreaKeys, AreaName, OnUnsupported, PaperKeys, TextureKeys};
use terrace_core::diag::Diag;
use terrace_core::geom::{BoxMm, Nm, Pose};
use terrace_core::program::{Pen, PenId};
use terrace_core::units::{Angle, Length};

/// Keys that every texture takes.
const EVERY: [&str; 9] = ["pattern", "file", "curves", "area", "inside", "outside", "soft", "tolerance", "pen"];

/// Keys of drawings.
const DRAWING: [&str; 29] = [
    "size",
    "scale",
    "fit",
    "align",
    "unit",
    "origin",
    "turn",
    "tile",
    "stroke",
    "fill",
    "pitch",
    "direction",
    "cross",
    "one_way",
    "inset",
    "contour",
    "on_unsupported",
    "pens",
    "only",
    "except",
    "paper",
    "mirror",
    "dpi",
    "gamma",
    "invert",
    "screen",
    "threshold",
    "period",
    "seed",
];

/// Keys of space curves.
const CURVES: [&str; 7] = ["unit", "on_unsupported", "pens", "only", "except", "max_distance", "on_distance"];

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
    fn key(&self, name: &str) -> String {
        format!("texture.{}.{name}", self.i)
    }

    /// The request that it makes.
    pub(super) fn resolve(&self, f: &mut Faults<'_>) -> Option<texture::Request> {
        let pen = self.pen(f);
        let area = self.area(f);
        let kind = self.kind(f)?;
        let masks = mask::resolve(self, f);
        Some(texture::Request { kind, area, tolerance_mm: self.keys.tolerance.as_mm(), pen, masks })
    }

    /// The index of its pen; the first where none is named.
    fn pen(&self, f: &mut Faults<'_>) -> PenId {
        self.keys.pen.as_ref().map_or(PenId(0), |name| self.named_pen("pen", name, f))
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

    /// Its area, which may be empty.
    fn area_as_given(&self) -> texture::Area {
        match &self.keys.area {
            Some(AreaKeys::Named(AreaName::Part)) => texture::Area::Part,
            None if self.keys.file.is_some() || self.keys.curves.is_some() => texture::Area::Unlimited,
            None => texture::Area::Part,
            Some(AreaKeys::Rectangle(r)) => {
                let [x0, y0, x1, y1] = r.map(Length::as_mm);
                texture::Area::Rectangle(BoxMm::rectangle(x0, y0, x1, y1))
            }
        }
    }

    fn area(&self, f: &mut Faults<'_>) -> texture::Area {
        if let Some(AreaKeys::Rectangle(r)) = &self.keys.area {
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

    fn kind(&self, f: &mut Faults<'_>) -> Option<texture::Kind> {
        if let Some(fault) = self.keys.file.as_deref().and_then(texture::foreign_drawing) {
            // What other keys mean for it is not the first thing to know.
            f.push(&self.key("file"), fault);
            return None;
        }
        match (self.keys.pattern, &self.keys.file, &self.keys.curves) {
            (None, None, Some(curves)) => {
                self.only("space curves", &[], &CURVES, f);
                Some(self.curves(curves, f))
            }
            (Some(_), Some(_), _) | (Some(_), _, Some(_)) | (_, Some(_), Some(_)) => {
                let given = [
                    ("pattern", self.keys.pattern.is_some()),
                    ("file", self.keys.file.is_some()),
                    ("curves", self.keys.curves.is_some()),
                ];
                let given: Vec<&str> = given.into_iter().filter(|(_, is)| *is).map(|(key, _)| key).collect();
                let fault = Diag::input("texture-both", format!("the texture has both {}", given.join(" and ")));
                f.push(&self.key(given[0]), fault.hint("keep one"));
                None
            }
            (None, None, None) => {
                f.push(
                    &format!("texture.{}", self.i),
                    Diag::input("texture-empty", "a texture has neither pattern nor file nor curves")
                        .hint("add pattern = \"hatch\" and pitch = \"0.1 mm\", or file = \"drawing.svg\""),
                );
                None
            }
            (Some(pattern), None, None) => {
                let row = texture::pattern::row(pattern);
                self.only(row.name, row.needs, row.takes, f);
                if self.keys.direction == Some(Direction::Contour)
                    && pattern != texture::pattern::Pattern::Hatch
                    && row.takes.contains(&"direction")
                {
                    let text = format!("direction = \"contour\" does not apply to {}", row.name);
                    f.push(&self.key("direction"), Diag::input("texture-key", text).hint("write an angle"));
                }
                (row.kind)(&self.values(row.needs, f))
            }
            (None, Some(file), None) => {
                self.only("a drawing", &[], &DRAWING, f);
                Some(self.drawing(file, f))
            }
        }
    }

    fn drawing(&self, file: &Path, f: &mut Faults<'_>) -> texture::Kind {
        let keys = self.keys;
        if keys.unit.is_some() && !is_dxf(file) {
            let fault = Diag::input("texture-key", "unit applies to DXF drawings alone");
            f.push(&self.key("unit"), fault.hint("use size for the width and height of the page"));
        }
        if keys.tile && keys.area.is_none() {
            f.push(
                &self.key("tile"),
                Diag::input("texture-tile", "tile = true needs an area to fill")
                    .hint("add area = \"part\" or area = [x0, y0, x1, y1]"),
            );
        }
        let (size, position) = page::resolve(keys.into(), &|name| self.key(name), f);
        texture::Kind::Drawing {
            path: self.folder.join(file),
            size,
            unit_mm: keys.unit.map(FileUnit::in_mm),
            position,
            turn_rad: keys.turn.as_rad(),
            tile: keys.tile,
            marking: Box::new(self.marking(f)),
        }
    }

    fn curves(&self, file: &Path, f: &mut Faults<'_>) -> texture::Kind {
        let keys = self.keys;
        if keys.area.is_some() {
            let fault = Diag::input("texture-key", "area does not apply to space curves, which stay where they are");
            f.push(
                &self.key("area"),
                fault.hint("leave out curves by only or except, or trim them in the CAD program"),
            );
        }
        let half = self.pdof / 2;
        texture::Kind::Curves {
            path: self.folder.join(file),
            unit_mm: keys.unit.map(FileUnit::in_mm),
            marking: Box::new(self.marking(f)),
            pose: self.pose,
            max_distance: keys.max_distance.map_or(half, |d| f.nm(&self.key("max_distance"), d)),
            on_distance: keys.on_distance.unwrap_or_default(),
        }
    }

    /// How a drawing is marked.
    fn marking(&self, f: &mut Faults<'_>) -> texture::Marking {
        let keys = self.keys;
        let (direction_rad, along_contours) = match keys.direction.unwrap_or(Direction::Angle(Angle::default())) {
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
        let mut selectors = |key: &str, names: &[String]| -> Vec<texture::Selector> {
            names.iter().filter_map(|name| self.selector(key, name, f)).collect()
        };
        let (only, except) = (selectors("only", &keys.only), selectors("except", &keys.except));
        let mut pens = Vec::new();
        for (name, pen) in &keys.pens {
            let pen = self.named_pen("pens", pen, f);
            pens.extend(self.selector("pens", name, f).map(|selector| (selector, pen)));
        }
        texture::Marking {
            stroke: keys.stroke.unwrap_or_default(),
            fill: keys.fill.unwrap_or_default(),
            contour: keys.contour.unwrap_or_default(),
            pens,
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
            paper: self.paper(f),
            mirror: keys.mirror,
            tone: tone::resolve(keys, &|name| self.key(name), f),
        }
    }

    /// Which colours are the page.
    fn paper(&self, f: &mut Faults<'_>) -> texture::Paper {
        // What is darker than this is no paper, but a slip such as a share (0.98) or the colour of the marks.
        const DARKEST: f64 = 50.0;
        let (paper, lightness) = match &self.keys.paper {
            None => return texture::Paper::default(),
            Some(PaperKeys::Lightness(lightness)) => (texture::Paper::Lightness(*lightness), *lightness),
            Some(PaperKeys::Colour(name)) => match texture::Selector::parse(name) {
                Some(texture::Selector::Colour(colour)) => (texture::Paper::Colour(colour), texture::lightness(colour)),
                _ => {
                    let fault = Diag::input("texture-key", format!("{name:?} is no colour"));
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

    /// The values of a pattern.
    fn values(&self, needs: &[&str], f: &mut Faults<'_>) -> texture::pattern::Values {
        let keys = self.keys;
        if let Some(order) = keys.order.filter(|order| !(1..=13).contains(order)) {
            let text = format!("Hilbert order {order} is not between 1 and 13");
            f.push(&self.key("order"), Diag::input("texture-order", text));
        }
        if let (Some(cell), Some(pitch)) = (keys.cell, keys.pitch)
            && needs.contains(&"cell")
            && cell > pitch
        {
            let text = format!("cell {cell} is larger than pitch {pitch}, so figures would overlap");
            f.push(&self.key("cell"), Diag::input("texture-cell", text));
        }
        if let Some(jitter) = keys.jitter.filter(|j| !(0.0..=100.0).contains(&j.as_percent())) {
            let fault = Diag::input("texture-key", format!("jitter {jitter} is not between 0 % and 100 %"));
            f.push(&self.key("jitter"), fault);
        }
        texture::pattern::Values {
            pitch_mm: keys.pitch.map(Length::as_mm),
            cell_mm: keys.cell.map(Length::as_mm),
            order: keys.order,
            direction_rad: match keys.direction.unwrap_or(Direction::Angle(Angle::default())) {
                Direction::Angle(angle) => Some(angle.as_rad()),
                Direction::Contour => None,
            },
            lattice: keys.lattice,
            width_mm: keys.width.map(Length::as_mm),
            bar_mm: keys.bar.map(Length::as_mm),
            inner_mm: keys.inner.map(Length::as_mm),
            line_mm: keys.line.map(Length::as_mm),
            centre_mm: keys.centre.map(|c| c.map(Length::as_mm)),
            jitter: keys.jitter.map(|jitter| jitter.as_percent() / 100.0),
            seed: keys.seed,
        }
    }

    /// Holds the keys that are given to those that `what` needs and can take.
    fn only(&self, what: &str, needs: &[&str], takes: &[&str], f: &mut Faults<'_>) {
        let given = f.keys_given(&format!("texture.{}", self.i));
        let is_given = |key: &&&str| given.iter().any(|given| given == **key);
        let missing = needs.iter().filter(|key| !is_given(key)).map(|key| ("pattern", format!("{what} needs {key}")));
        let of_soft: &[&str] = if self.keys.soft.is_some() { &["seed"] } else { &[] };
        let allowed = [needs, takes, &EVERY, of_soft].concat();
        let strange = given.iter().filter(|key| !allowed.contains(&key.as_str()));
        let strange = strange.map(|key| (key.as_str(), format!("{key} does not apply to {what}")));
        let all = [needs, takes].concat().join(", ");
        for (key, fault) in missing.chain(strange) {
            let fault = Diag::input("texture-key", fault).hint(format!("keys specific to {what}: {all}"));
            f.push(&self.key(key), fault);
        }
    }
}

fn is_dxf(file: &Path) -> bool {
    file.extension().is_some_and(|e| e.eq_ignore_ascii_case("dxf"))
}
