//! `[[fixture]]`: what holds the part, which is never marked and which the head keeps clear of.

use std::path::PathBuf;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::faults::Faults;
use super::file_unit::FileUnit;
use crate::surface;
use terrace_core::diag::Diag;
use terrace_core::geom::SpacePoint;
use terrace_core::program::SetupId;
use terrace_core::units::Length;

/// Most fixtures of a job.
const MAX_FIXTURES: usize = 100;

/// `[[fixture]]`: give `file`, or `box`.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct FixtureKeys {
    /// What messages and pictures call it.
    #[schemars(example = &"clamp", extend("x-value" = "letters, digits, - and _"))]
    pub name: String,
    /// Its shape: a mesh or CAD file, as for the surface; relative to the job file.
    #[schemars(example = &"clamp.stl", extend("x-value" = "path", "x-default" = "this or `box`"))]
    #[serde(default)]
    pub file: Option<PathBuf>,
    /// Length of one unit of the file's numbers. Not for STEP and IGES, which state theirs.
    #[schemars(example = &"mm", extend("x-default" = "required for STL, OBJ and PLY"))]
    #[serde(default)]
    pub unit: Option<FileUnit>,
    /// Instead of a file: two opposite corners of a box.
    #[schemars(example = [["-20 mm", "30 mm", "0 mm"], ["10 mm", "50 mm", "25 mm"]], extend("x-value" = "two points of three lengths", "x-default" = "this or `file`"))]
    #[serde(default, rename = "box")]
    pub corners: Option<[[Length; 3]; 2]>,
    /// Where the origin of the file, or of the box, lies in `frame`.
    #[schemars(example = ["0 mm", "0 mm", "0 mm"])]
    #[serde(default)]
    pub at: [Length; 3],
    /// What its coordinates are measured in, see below.
    #[serde(default)]
    pub frame: FixtureFrame,
    /// The set-ups in which it is there, counted from 1.
    #[schemars(example = [1], extend("x-value" = "list of numbers", "x-default" = "all"))]
    #[serde(default)]
    pub setups: Option<Vec<u32>>,
}

/// What the coordinates of a fixture are measured in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Deserialize, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum FixtureFrame {
    /// The part, laid as the job says, before `placement.turn`: it turns and moves with the part.
    #[default]
    Part,
    /// The surface file: datum, scale and rotation of the part apply to it too.
    SurfaceFile,
    /// The table.
    Table,
}

/// A fixture.
#[derive(Clone, Debug, PartialEq)]
pub struct FixtureInput {
    /// What messages call it.
    pub name: String,
    /// Its shape.
    pub shape: FixtureShape,
    /// Where its origin lies in its frame, mm.
    pub at: SpacePoint,
    /// What its coordinates are measured in.
    pub frame: FixtureFrame,
    /// The set-ups in which it is there, rising; None: all.
    pub setups: Option<Vec<SetupId>>,
}

/// The shape of a fixture.
#[derive(Clone, Debug, PartialEq)]
pub enum FixtureShape {
    /// A file, as named in the job file, relative to it, and how it is read.
    File(PathBuf, Box<surface::Options>),
    /// Two opposite corners of a box, mm.
    Box([SpacePoint; 2]),
}

impl FixtureInput {
    /// Its file, if it has one, as named in the job file.
    pub fn file(&self) -> Option<&PathBuf> {
        match &self.shape {
            FixtureShape::File(file, _) => Some(file),
            FixtureShape::Box(_) => None,
        }
    }
}

/// What of a job its fixtures have to go with.
#[derive(Clone, Copy)]
pub(super) struct Beside {
    /// Whether it has set-ups.
    pub(super) has_setups: bool,
    /// Whether it says where the part lies.
    pub(super) is_placed: bool,
}

/// Resolves the fixtures of a job.
pub(super) fn resolve(fixture: &[FixtureKeys], beside: Beside, f: &mut Faults<'_>) -> Vec<FixtureInput> {
    if fixture.len() > MAX_FIXTURES {
        let text = format!("the job has {} fixtures, more than {MAX_FIXTURES}", fixture.len());
        let hint = "what stands together may be one file";
        f.push("fixture", Diag::input("fixture-shape", text).hint(hint));
        return Vec::new();
    }
    let mut fixtures: Vec<FixtureInput> = Vec::new();
    for (i, keys) in fixture.iter().enumerate() {
        let key = |name: &str| format!("fixture.{i}.{name}");
        check_name(keys, &fixtures, &key("name"), f);
        check_frame(keys, beside, i, f);
        let mut mm = |name: &str, lengths: [Length; 3]| lengths.map(|length| f.nm(&key(name), length).mm());
        let at = mm("at", keys.at);
        let corners = keys.corners.map(|corners| corners.map(|corner| mm("box", corner)));
        let setups = keys.setups.as_ref().and_then(|numbers| set_ups(numbers, beside, &key("setups"), f));
        if let Some(shape) = shape(keys, corners, i, f) {
            fixtures.push(FixtureInput { name: keys.name.clone(), shape, at, frame: keys.frame, setups });
        }
    }
    fixtures
}

/// A name that is none, or that another fixture has.
fn check_name(keys: &FixtureKeys, others: &[FixtureInput], key: &str, f: &mut Faults<'_>) {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
    let name = &keys.name;
    if name.is_empty() || name.len() > 40 || !name.chars().all(is_plain) {
        let fault = Diag::input("fixture-name", format!("{name:?} is no name of a fixture"));
        f.push(key, fault.hint("use up to 40 letters, digits, - and _"));
    } else if others.iter().any(|other| other.name == *name) {
        let fault = Diag::input("fixture-name", format!("two fixtures are called {name:?}"));
        f.push(key, fault.hint("give each its own name: messages tell them apart by it"));
    }
}

/// A frame whose place beside the part the job does not say.
fn check_frame(keys: &FixtureKeys, beside: Beside, i: usize, f: &mut Faults<'_>) {
    if keys.frame == FixtureFrame::Table && !beside.is_placed {
        let text = format!("fixture {:?} lies on the table, but the job does not say where the part lies", keys.name);
        let hint = "state placement.origin, or give the fixture beside the part: frame = \"part\"";
        f.push(&format!("fixture.{i}.frame"), Diag::input("fixture-frame", text).hint(hint));
    }
}

/// The set-ups in which a fixture is there.
fn set_ups(numbers: &[u32], beside: Beside, key: &str, f: &mut Faults<'_>) -> Option<Vec<SetupId>> {
    let fault = match (beside.has_setups, numbers) {
        (false, _) => Some(("the job has no [setups]", "leave it out: there is one set-up")),
        (true, []) => Some(("a fixture is in no set-up", "leave the fixture out, or name a set-up")),
        (true, numbers) if numbers.contains(&0) => {
            Some(("set-ups are counted from 1", "the first set-up of the run sheet is 1"))
        }
        _ => None,
    };
    if let Some((text, hint)) = fault {
        f.push(key, Diag::input("fixture-setups", text).hint(hint));
        return None;
    }
    let mut setups: Vec<SetupId> = numbers.iter().map(|n| SetupId(n - 1)).collect();
    setups.sort_unstable();
    setups.dedup();
    Some(setups)
}

/// The shape of a fixture, if it has one.
fn shape(keys: &FixtureKeys, corners: Option<[SpacePoint; 2]>, i: usize, f: &mut Faults<'_>) -> Option<FixtureShape> {
    let mut fault = |key: &str, text: String, hint: &str| {
        f.push(&format!("fixture.{i}{key}"), Diag::input("fixture-shape", text).hint(hint));
        None
    };
    let name = &keys.name;
    match (&keys.file, corners) {
        (None, None) => fault("", format!("fixture {name:?} has neither file nor box"), "give one of them"),
        (Some(_), Some(_)) => fault(".box", format!("fixture {name:?} has both file and box"), "keep one of them"),
        (None, Some(_)) if keys.unit.is_some() => fault(
            ".unit",
            format!("fixture {name:?} has a unit, but no file"),
            "leave it out: the corners of a box are lengths",
        ),
        (None, Some([a, b])) if (0..3).any(|k| a[k] == b[k]) => {
            fault(".box", format!("the box of fixture {name:?} has no volume"), "give two opposite corners")
        }
        (None, Some(corners)) => Some(FixtureShape::Box(corners)),
        (Some(file), None) if !surface::holds_facets(file) => fault(
            ".file",
            format!("the file of fixture {name:?} does not hold facets"),
            "give a mesh (STL, OBJ, PLY, 3MF), a CAD file (STEP, IGES) or a box",
        ),
        (Some(file), None) if surface::is_cad(file) && keys.unit.is_some() => fault(
            ".unit",
            format!("fixture {name:?} has a unit, but STEP and IGES files state their own"),
            "leave it out",
        ),
        (Some(file), None) if surface::needs_unit(file) && keys.unit.is_none() => {
            fault("", format!("the file of fixture {name:?} carries no unit"), "add its unit, such as unit = \"mm\"")
        }
        (Some(file), None) => {
            let unit_mm = keys.unit.map(|unit| unit.in_mm());
            let options = surface::Options { unit_mm, ..surface::Options::default() };
            Some(FixtureShape::File(file.clone(), Box::new(options)))
        }
    }
}
