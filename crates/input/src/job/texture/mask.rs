//! The keys of a `[[texture]]` that say where in its area it is marked.

use super::Texture;
use super::keys::{MaskKeys, SourceKeys};
use super::page;
use crate::job::faults::Faults;
use crate::job::file_unit::FileUnit;
use crate::texture::pattern::PatternKeys;
use crate::texture::{self, Area, Kind, Marking, Mask, Masks, Mirror, Position, Screen, Selector, Size, StrokeMode};
use terrace_core::diag::Diag;
use terrace_core::units::{Angle, Length};

/// What can have a name in a drawing.
const KINDS: [&str; 4] = ["id", "layer", "class", "block"];

/// Where it is marked.
pub(super) fn resolve(texture: &Texture<'_>, f: &mut Faults<'_>) -> Masks {
    let keys = &texture.keys.common;
    let has_own_places = match &texture.keys.source {
        SourceKeys::Pattern(pattern) => matches!(pattern, PatternKeys::Dots(_) | PatternKeys::Poisson(_)),
        SourceKeys::File(drawing) => drawing.screen == Some(Screen::Noise),
        SourceKeys::Curves(_) => false,
    };
    let has_border = keys.inside.is_some() || keys.outside.is_some();
    for (key, is_given, needed, has_needed) in [
        ("soft", keys.soft.is_some(), "inside or outside", has_border),
        ("seed", keys.seed.is_some() && !has_own_places, "soft", keys.soft.is_some()),
    ] {
        if is_given && !has_needed {
            let fault = Diag::input("texture-key", format!("{key} has no effect without {needed}"));
            f.push(&texture.key(key), fault.hint(format!("add {needed}, or leave {key} out")));
        }
    }
    if has_border && matches!(texture.keys.source, SourceKeys::Curves(_)) {
        let key = if keys.inside.is_some() { "inside" } else { "outside" };
        let fault = Diag::input("texture-key", format!("{key} does not apply to space curves"));
        f.push(&texture.key(key), fault.hint("cut the curves in their file"));
    }
    let inside = keys.inside.as_ref().and_then(|keys| mask(texture, "inside", keys, f));
    let outside = keys.outside.as_ref().and_then(|keys| mask(texture, "outside", keys, f));
    Masks { inside, outside, soft_mm: keys.soft.map_or(0.0, Length::as_mm), seed: keys.seed.unwrap_or(0) }
}

/// The mask that the key `inside` or `outside` names; None where it names no drawing.
fn mask(texture: &Texture<'_>, key: &str, keys: &MaskKeys, f: &mut Faults<'_>) -> Option<Mask> {
    let (file, name) = keys.file();
    if file.is_empty() || name.is_some_and(str::is_empty) {
        let fault = Diag::input("texture-key", format!("{key} names no file, or nothing in it"));
        f.push(&texture.key(key), fault.hint("write \"mask.svg#outline\", or \"mask.svg\" for all of a drawing"));
        return None;
    }
    let path = texture.folder.join(file);
    if let Some(fault) = texture::foreign_drawing(&path) {
        f.push(&texture.key(key), fault);
        return None;
    }
    let MaskPlacement { size, position, turn, mirror, unit, area } = match keys {
        MaskKeys::Named(_) => placed_as_texture(texture),
        MaskKeys::Placed(own) => {
            if own.unit.is_some() && !super::is_dxf(&path) {
                let fault = Diag::input("texture-key", "unit applies to DXF drawings alone");
                f.push(
                    &texture.key(&format!("{key}.unit")),
                    fault.hint("state the size of the mask, or leave unit out"),
                );
            }
            let (size, position) = page::resolve((&**own).into(), &|name| texture.key(&format!("{key}.{name}")), f);
            MaskPlacement { size, position, turn: own.turn, mirror: own.mirror, unit: own.unit, area: Area::Unlimited }
        }
    };
    let marking = Marking {
        stroke: StrokeMode::Centre,
        only: name.map(selectors).unwrap_or_default(),
        mirror,
        ..Marking::default()
    };
    // A unit that the texture states for its own DXF file means nothing for a mask in another format.
    let unit = unit.filter(|_| super::is_dxf(&path));
    let drawing = Kind::Drawing {
        path,
        size,
        unit_mm: unit.map(FileUnit::in_mm),
        position,
        turn_rad: turn.as_rad(),
        tile: false,
        marking: Box::new(marking),
    };
    Some(Mask { drawing, area, name: name.map(str::to_owned) })
}

/// How the page of a mask lies on the part.
struct MaskPlacement {
    size: Size,
    position: Position,
    turn: Angle,
    mirror: Option<Mirror>,
    unit: Option<FileUnit>,
    area: Area,
}

/// The placement of a mask without keys of its own: that of a drawing with the keys of the texture.
fn placed_as_texture(texture: &Texture<'_>) -> MaskPlacement {
    let drawing = texture.keys.drawing();
    // Faults of the texture's own keys are reported once, by itself.
    let (size, position) = page::of_agreeing(drawing.map(page::PageKeys::from).unwrap_or_default());
    // Without the key `area` a drawing has no limit; `area_as_given` would return the part for a pattern.
    let area = if texture.keys.common.area.is_some() { texture.area_as_given() } else { Area::Unlimited };
    MaskPlacement {
        size,
        position,
        turn: drawing.map(|keys| keys.turn).unwrap_or_default(),
        mirror: drawing.and_then(|keys| keys.mirror),
        unit: texture.unit(),
        area,
    }
}

/// What a name in a drawing selects: of a name without a kind, all that may have it.
fn selectors(name: &str) -> Vec<Selector> {
    if KINDS.iter().any(|kind| name.starts_with(&format!("{kind}:"))) {
        vec![Selector::Label(name.to_owned())]
    } else {
        KINDS.iter().map(|kind| Selector::Label(format!("{kind}:{name}"))).collect()
    }
}
