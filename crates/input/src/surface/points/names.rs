//! Names of columns: which of them are x, y and z.

use std::ops::RangeInclusive;

use super::super::lines::shown;
use super::super::stated_unit::unit_mm;
use super::columns::{Separator, fields};
use terrace_core::diag::Diag;

/// Words beside the letter of an axis.
const FILLERS: [&str; 17] = [
    "coord",
    "coords",
    "coordinate",
    "coordinates",
    "pos",
    "position",
    "axis",
    "val",
    "value",
    "point",
    "pt",
    "col",
    "column",
    "koord",
    "koordinate",
    "achse",
    "wert",
];

/// Words for east, north and up, by which surveyors name what is x, y and z here.
const SURVEYED: [&[&str]; 3] = [
    &["e", "east", "easting", "ost", "ostwert", "rechtswert"],
    &["n", "north", "northing", "nord", "nordwert", "hochwert"],
    &["elev", "elevation", "height", "h", "alt", "altitude", "höhe", "hoehe", "u", "up"],
];

/// Words for what is not a coordinate in a length.
const OTHER: [&str; 20] = [
    "id",
    "ids",
    "p",
    "no",
    "nr",
    "num",
    "number",
    "nummer",
    "name",
    "label",
    "index",
    "idx",
    "i",
    "point",
    "pt",
    "code",
    "lat",
    "latitude",
    "lon",
    "longitude",
];

/// What a name says of its column.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Meaning {
    /// The column is the axis of this number.
    Axis(usize),
    /// The column is the axis of this number in the words of surveyors.
    Surveyed(usize),
    /// The column is a number of the point, or an angle.
    Other,
    Unknown,
}

/// A name, and the unit that stands with it.
struct Name {
    shown: String,
    meaning: Meaning,
    unit_mm: Option<f64>,
}

impl Name {
    fn of(text: &str) -> Self {
        let bare = text.trim().trim_matches('"').to_lowercase();
        let words: Vec<&str> = bare.split(|c: char| !c.is_alphanumeric()).filter(|w| !w.is_empty()).collect();
        let unit_mm = words.iter().skip(1).rev().find_map(|word| unit_mm(word));
        let rest = words.iter().enumerate().filter(|(i, w)| *i == 0 || super::super::stated_unit::unit_mm(w).is_none());
        let rest: Vec<&str> = rest.map(|(_, w)| *w).filter(|w| !FILLERS.contains(w)).collect();
        let meaning = match rest[..] {
            [] if words.iter().any(|w| OTHER.contains(w)) => Meaning::Other,
            [word] => meaning(word),
            _ => Meaning::Unknown,
        };
        Self { shown: shown(text.trim().trim_matches('"').as_bytes()), meaning, unit_mm }
    }
}

fn meaning(word: &str) -> Meaning {
    let around = FILLERS.iter().chain(&["mm", "cm", "um"]);
    let mut bare = around.filter_map(|filler| word.strip_prefix(filler).or_else(|| word.strip_suffix(filler)));
    let axis = |word: &str| ["x", "y", "z"].iter().position(|axis| *axis == word);
    if let Some(k) = axis(word).or_else(|| bare.find_map(axis)) {
        return Meaning::Axis(k);
    }
    match SURVEYED.iter().position(|words| words.contains(&word)) {
        Some(k) => Meaning::Surveyed(k),
        None if OTHER.contains(&word) => Meaning::Other,
        None => Meaning::Unknown,
    }
}

impl Name {
    /// Whether it says that column `i` is another than x, y and z in this order would have there.
    fn contradicts(&self, i: usize) -> bool {
        match self.meaning {
            Meaning::Axis(k) | Meaning::Surveyed(k) => k != i,
            Meaning::Other => i < 3,
            Meaning::Unknown => false,
        }
    }
}

/// The columns of x, y and z by their names.
#[derive(Debug)]
pub(super) struct NamedColumns {
    pub xyz: [usize; 3],
    /// What is to be reported of the choice.
    pub note: Option<Diag>,
    /// mm in the unit that the names state.
    pub unit_mm: Option<f64>,
}

/// The columns that a row of names gives to rows of `columns` columns; None where it has another number of columns.
///
/// # Errors
/// The names contradict each other, or the columns that would be taken.
pub(super) fn of_row(line: &[u8], separator: Separator, columns: usize) -> Result<Option<NamedColumns>, Diag> {
    if columns < 3 {
        return Ok(None);
    }
    let Some(names) = split(line, separator, columns..=columns) else { return Ok(None) };
    if let Some(named) = by_names(&names)? {
        return Ok(Some(named));
    }
    let list = listed(&names);
    if names.iter().enumerate().any(|(i, name)| name.contradicts(i)) {
        let text = format!("the columns are named {list}, which does not say which are x, y and z");
        return Err(Diag::input("points-names", text).hint(NAME_THEM));
    }
    Ok(Some(NamedColumns { xyz: [0, 1, 2], note: Some(taken(&names, [0, 1, 2])), unit_mm: None }))
}

/// The columns that a comment gives to rows of `columns` columns; None where it names none.
///
/// # Errors
/// The comment names x, y and z in another order, but not one name for each column.
pub(super) fn of_comment(line: &[u8], separator: Separator, columns: usize) -> Result<Option<NamedColumns>, Diag> {
    let text = line.trim_ascii_start();
    let marks = text.iter().take_while(|b| b"#/%!;".contains(b)).count();
    let text = &text[marks..];
    let behind = text.iter().rposition(|b| matches!(b, b':' | b'=')).map_or(text, |i| &text[i + 1..]);
    for text in [text, behind] {
        // Columns behind those that are named may have no names.
        let named = split(text, separator, 3..=columns).map(|names| by_names(&names)).transpose()?;
        if let Some(named) = named.flatten() {
            return Ok(Some(named));
        }
    }
    let all = String::from_utf8_lossy(text).to_lowercase();
    let words: Vec<&str> = all.split(|c: char| !c.is_alphanumeric()).filter(|w| !w.is_empty()).collect();
    let is_turned = |w: &[&str]| w != ["x", "y", "z"] && ["x", "y", "z"].iter().all(|axis| w.contains(axis));
    if words.windows(3).any(is_turned) {
        let text = format!("a comment has x, y and z in another order than the columns: \"{}\"", shown(line));
        return Err(Diag::input("points-names", text).hint(NAME_THEM));
    }
    Ok(None)
}

/// The remedy for names that do not say which columns are x, y and z.
const NAME_THEM: &str = "name all columns in a row before the points, three of them x, y and z";

/// The names of a line, if there is one for each of so many columns.
fn split(line: &[u8], separator: Separator, columns: RangeInclusive<usize>) -> Option<Vec<Name>> {
    [separator, Separator::of(line), Separator::Blanks].into_iter().find_map(|separator| {
        let mut names: Vec<String> = Vec::new();
        for field in fields(line, separator) {
            let field = String::from_utf8_lossy(field);
            let is_unit = field.starts_with(['[', '(']) && field.ends_with([']', ')']);
            match names.last_mut() {
                Some(last) if is_unit && separator == Separator::Blanks => *last = format!("{last} {field}"),
                _ => names.push(field.into_owned()),
            }
        }
        if names.len() == columns.end() + 1 && names.last().is_some_and(String::is_empty) {
            names.pop();
        }
        columns.contains(&names.len()).then(|| names.iter().map(|name| Name::of(name)).collect())
    })
}

/// The columns of x, y and z where each has a name; x and y are both in letters or both in the words of surveyors.
fn by_names(names: &[Name]) -> Result<Option<NamedColumns>, Diag> {
    let find = |meaning: Meaning| names.iter().position(|name| name.meaning == meaning);
    let Some(z) = find(Meaning::Axis(2)).or_else(|| find(Meaning::Surveyed(2))) else { return Ok(None) };
    let pair = |meaning: fn(usize) -> Meaning| find(meaning(0)).zip(find(meaning(1)));
    let Some((x, y)) = pair(Meaning::Axis).or_else(|| pair(Meaning::Surveyed)) else { return Ok(None) };
    let xyz = [x, y, z];
    let units: Vec<f64> = xyz.iter().filter_map(|&i| names[i].unit_mm).collect();
    if units.iter().any(|unit| *unit != units[0]) {
        let text = format!("the columns {} have different units", xyz.map(|i| names[i].shown.as_str()).join(", "));
        return Err(Diag::input("points-names", text).hint("export the cloud in one unit"));
    }
    let is_letter = |&i: &usize| matches!(names[i].meaning, Meaning::Axis(_));
    let is_twice = names.iter().filter(|name| matches!(name.meaning, Meaning::Axis(_))).count() > 3;
    let note = (!xyz.iter().all(is_letter) || is_twice).then(|| taken(names, xyz));
    Ok(Some(NamedColumns { xyz, note, unit_mm: units.first().copied() }))
}

/// Says which columns are taken.
fn taken(names: &[Name], xyz: [usize; 3]) -> Diag {
    let which = xyz.map(|i| format!("{} (column {})", names[i].shown, i + 1)).join(", ");
    let text = format!("the columns {which} are taken as x, y, z");
    Diag::warning("points-names", text).hint("name the columns x, y and z if that is wrong")
}

/// The first of some names, for a message.
fn listed(names: &[Name]) -> String {
    names.iter().take(6).map(|name| name.shown.as_str()).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_with_units_and_words_around_them_are_those_of_axes() {
        for (text, want, unit) in [
            ("x", Meaning::Axis(0), None),
            ("\"Y\"", Meaning::Axis(1), None),
            ("Z [mm]", Meaning::Axis(2), Some(1.0)),
            ("z_um", Meaning::Axis(2), Some(1e-3)),
            ("X(in)", Meaning::Axis(0), Some(25.4)),
            ("Pos X", Meaning::Axis(0), None),
            ("xCoord", Meaning::Axis(0), None),
            ("Y-Koordinate", Meaning::Axis(1), None),
            ("y/m", Meaning::Axis(1), Some(1000.0)),
            ("Northing", Meaning::Surveyed(1), None),
            ("Höhe [m]", Meaning::Surveyed(2), Some(1000.0)),
            ("Point", Meaning::Other, None),
            ("Lat", Meaning::Other, None),
            ("nx", Meaning::Unknown, None),
            ("normal x", Meaning::Unknown, None),
            ("", Meaning::Unknown, None),
        ] {
            let name = Name::of(text);
            assert_eq!((name.meaning, name.unit_mm), (want, unit), "{text}");
        }
    }

    #[test]
    fn rows_of_names_say_which_columns_are_taken_or_are_refused() {
        let blanks = Separator::Blanks;
        let comma = Separator::Byte(b',');
        for (line, separator, columns, want) in [
            ("y x z", blanks, 3, Ok(Some([1, 0, 2]))),
            ("Y [mm] X [mm] Z [mm]", blanks, 3, Ok(Some([1, 0, 2]))),
            ("North East Elev", blanks, 3, Ok(Some([1, 0, 2]))),
            ("P,N,E,Z,D", comma, 5, Ok(Some([2, 1, 3]))),
            ("n,x,y,z,e", comma, 5, Ok(Some([1, 2, 3]))),
            ("x;y;z", blanks, 3, Ok(Some([0, 1, 2]))),
            ("a b c", blanks, 3, Ok(Some([0, 1, 2]))),
            (",x,y,z", comma, 4, Ok(Some([1, 2, 3]))),
            ("a b c", blanks, 4, Ok(None)),
            ("y,x,depth", comma, 3, Err(())),
            ("Point,a,b,c", comma, 4, Err(())),
            ("x,north,z", comma, 3, Ok(Some([0, 1, 2]))),
            ("z,north,x", comma, 3, Err(())),
            ("lat,lon,height", comma, 3, Err(())),
            ("x [mm],y [mm],z [um]", comma, 3, Err(())),
        ] {
            let found = of_row(line.as_bytes(), separator, columns);
            assert_eq!(found.map(|n| n.map(|n| n.xyz)).map_err(|_| ()), want, "{line}");
        }
        for (line, columns, want) in [
            ("//Y X Z", 3, Ok(Some([1, 0, 2]))),
            ("# y x z", 4, Ok(Some([1, 0, 2]))),
            ("% columns: z x y", 3, Ok(Some([1, 2, 0]))),
            ("#X;Y;Z", 3, Ok(Some([0, 1, 2]))),
            ("# made by hand", 3, Ok(None)),
            ("# x y z of a long day", 3, Ok(None)),
            ("# the order is y, x, z here", 3, Err(())),
        ] {
            let found = of_comment(line.as_bytes(), blanks, columns);
            assert_eq!(found.map(|n| n.map(|n| n.xyz)).map_err(|_| ()), want, "{line}");
        }
    }
}
