//! What drawings, bitmaps and space curves hold, in the words that `pens`, `only` and `except` use.

use std::path::Path;

use serde_json::{Value, json};

use super::{Inspection, plural, triple};
use terrace_core::diag::{Diag, Error, Kind, Message};
use terrace_input::job::FileUnit;
use terrace_input::texture::contents::{Contents, InSpace, Pixels, Shapes};
use terrace_input::texture::{Paper, Selector};

/// Most names that are listed as text.
const MAX_LISTED: usize = 40;

/// A file that only a texture can name.
pub(super) fn drawing(path: &Path, unit: Option<FileUnit>) -> Result<Inspection, Error> {
    let mut warnings = Vec::new();
    let unit_mm = unit.map(FileUnit::in_mm);
    match Contents::read(path, unit_mm, &mut warnings)? {
        Contents::Bitmap(pixels) => Ok(bitmap(&pixels, warnings)),
        Contents::Drawing(found) => {
            let mut shown = shapes(&found);
            if warnings.iter().any(|w| w.code == "dxf-space") {
                warnings.retain(|w| w.code != "dxf-space");
                add(&mut shown, &in_space(path, unit), "curves");
            }
            shown.warnings.extend(warnings);
            Ok(shown)
        }
    }
}

/// A height map's file as a bitmap, or a file of points as curves in space: what it is besides a surface.
pub(super) fn besides(
    path: &Path,
    unit: Option<FileUnit>,
    extension: &str,
) -> Option<(Result<Inspection, Error>, &'static str)> {
    match extension {
        "png" | "tif" | "tiff" => Some((drawing(path, None), "bitmap")),
        "csv" | "txt" | "xyz" => Some((in_space(path, unit), "curves")),
        _ => None,
    }
}

/// Appends what a file is besides, if it can be that; `kind` is the key for it.
pub(super) fn add(shown: &mut Inspection, other: &Result<Inspection, Error>, kind: &str) {
    if let Ok(other) = other {
        shown.text += &format!("as a texture: {}", other.text);
        shown.json[kind] = other.json.clone();
    }
}

fn shapes(found: &Shapes) -> Inspection {
    let o = &found.outlines;
    let mut text = format!("drawing, {} stroke{} ({} closed)", o.count, plural(o.count), o.closed);
    let mut json = json!({"kind": "drawing", "strokes": o.count, "closed": o.closed, "physical_size": found.is_sized});
    if found.is_sized {
        text += &format!(", {} point{}, {:.3} mm\n", o.points, plural(o.points), o.length_mm);
        json["points"] = json!(o.points);
        json["length_mm"] = json!(o.length_mm);
        if let Some(b) = o.bounds {
            let ([x0, y0], [x1, y1]) = (b.lo, b.hi);
            text += &format!("from ({x0:.4}, {y0:.4}) to ({x1:.4}, {y1:.4}) mm\n");
            json["lo_mm"] = json!(b.lo);
            json["hi_mm"] = json!(b.hi);
        }
    } else {
        text += "\nno physical size in the file: write width and height in mm into it, or state size = [...] with the texture\n";
    }
    text += &names(&found.selectors, Some(Paper::default()), &mut json);
    json["refused"] = found.refused.iter().map(|d| json!(Message::from(d))).collect();
    if !found.refused.is_empty() {
        text += "a job with it is refused, as the warnings say; on_unsupported = \"warn\" leaves out what they name\n";
    }
    let warnings = found.refused.iter().map(|d| Diag { kind: Kind::Warning, ..d.clone() }).collect();
    Inspection { text, json, warnings }
}

/// Sets `selectors` in `json` to the names that choose shapes, and returns them as text. `paper` says which of the
/// colours are the page; None of space curves, which have no page.
fn names(selectors: &[(Selector, usize)], paper: Option<Paper>, json: &mut Value) -> String {
    let is_page = |selector: &Selector| match selector {
        Selector::Colour(colour) => paper.is_some_and(|paper| paper.holds(*colour)),
        Selector::Label(_) => false,
    };
    json["selectors"] = selectors
        .iter()
        .map(|(selector, shapes)| json!({"name": selector.to_string(), "shapes": shapes, "page": is_page(selector)}))
        .collect();
    match selectors {
        [] => return String::new(),
        [(one, _)] => return format!("pens, only and except can name {one} alone\n"),
        _ => {}
    }
    let listed = &selectors[..selectors.len().min(MAX_LISTED)];
    let width = listed.iter().map(|(selector, _)| selector.to_string().chars().count()).max().unwrap_or(0);
    let mut text = "pens, only and except can name\n".to_owned();
    for (selector, shapes) in listed {
        let page = if is_page(selector) { ", the page" } else { "" };
        text += &format!("  {:<width$}  {shapes} shape{}{page}\n", selector.to_string(), plural(*shapes));
    }
    if selectors.len() > listed.len() {
        text += &format!("  and {} more, which --json lists\n", selectors.len() - listed.len());
    }
    text
}

fn bitmap(pixels: &Pixels, warnings: Vec<Diag>) -> Inspection {
    let &Pixels { columns, rows, per_mm, darkest, lightest, mean } = pixels;
    let mut text = format!("bitmap, {columns} x {rows} pixels, ");
    text += &match darkest == lightest {
        true => format!("all of grey {:.1} %\n", 100.0 * mean),
        false => format!(
            "grey {:.1} % to {:.1} %, mean {:.1} % (0 % is black)\n",
            100.0 * darkest,
            100.0 * lightest,
            100.0 * mean
        ),
    };
    let mut json = json!({"kind": "bitmap", "columns": columns, "rows": rows, "darkest": darkest, "lightest": lightest,
        "mean": mean, "dpi": Value::Null, "size_mm": Value::Null});
    text += &match per_mm {
        Some(per_mm) => {
            let dpi = per_mm.map(|n| n * 25.4);
            let size = [columns as f64 / per_mm[0], rows as f64 / per_mm[1]];
            (json["dpi"], json["size_mm"]) = (json!(dpi), json!(size));
            let stated =
                if dpi[0] == dpi[1] { format!("{:.2}", dpi[0]) } else { format!("{:.2} x {:.2}", dpi[0], dpi[1]) };
            format!(
                "it states {stated} dpi, {:.3} mm x {:.3} mm: dpi = \"file\" takes them, dpi = N or size = [...] others\n",
                size[0], size[1]
            )
        }
        None => "it states no resolution: a texture needs dpi = N or size = [...]\n".to_owned(),
    };
    Inspection { text, json, warnings }
}

/// A file as curves in space, in mm where its unit is known.
fn in_space(path: &Path, unit: Option<FileUnit>) -> Result<Inspection, Error> {
    let mut warnings = Vec::new();
    let is_dxf = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("dxf"));
    let is_known = is_dxf || unit.is_some();
    let unit_mm = unit.map(FileUnit::in_mm).or((!is_dxf).then_some(1.0));
    let InSpace { count, points, length, lo, hi, selectors } = InSpace::read(path, unit_mm, &mut warnings)?;
    let [unit, key] = if is_known { ["mm", "_mm"] } else { ["units of the file", ""] };
    let mut json = json!({"kind": "curves", "count": count, "points": points});
    let curves = if count == 1 { "one space curve".to_owned() } else { format!("{count} space curves") };
    let mut text = format!("{curves}, {points} points, {length:.3} {unit} along the curve{}\n", plural(count));
    json[format!("length{key}")] = json!(length);
    if count > 0 {
        text += &format!("from  ({}) {unit}\nto    ({}) {unit}\n", triple(lo, ", "), triple(hi, ", "));
        json[format!("lo{key}")] = json!(lo);
        json[format!("hi{key}")] = json!(hi);
    }
    text += &names(&selectors, None, &mut json);
    Ok(Inspection { text, json, warnings })
}
