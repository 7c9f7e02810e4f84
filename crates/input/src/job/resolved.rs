//! The resolved job.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use terrace_core::math;

use serde::{Deserialize, Serialize};

use super::file::{Dose, Implausible, Level, Mode, Steep, StopOrder, StrokeOrder};
use super::fixtures::FixtureInput;
use super::marked::MarkedInput;
use super::partition::{Method, Objective, Partition};
use super::passes::Passes;
use crate::surface;
use crate::texture;
use terrace_core::diag::{self, Diag, Error, Place};
use terrace_core::format::Format;
use terrace_core::geom::{NM_PER_MM, Nm, P2, Pose};
use terrace_core::machine::{Machine, Origin};
use terrace_core::program::{PassId, Pen, PenId};
use terrace_core::units::{Angle, Length, Share};

/// What the command line sets, over the job file's own keys.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Overrides {
    /// Over `mode`.
    pub mode: Option<Mode>,
    /// Over `partition.objective`.
    pub objective: Option<Objective>,
    /// Random seed for cuts in a seam zone; not in the file.
    pub seed: u64,
}

/// A job whose values were all checked, with the text of its file kept for messages.
#[derive(Clone, Debug)]
pub struct Job {
    /// The file, as named by the user.
    pub path: PathBuf,
    /// The text of the job file.
    pub source: Arc<str>,
    /// Random seed for cuts in a seam zone.
    pub seed: u64,
    /// How the part is marked.
    pub mode: Mode,
    /// What the job file says of that, whatever overrides it.
    pub mode_of_file: Mode,
    /// The part's surface.
    pub surface: SurfaceInput,
    /// Where the part lies on the stage.
    pub placement: Placement,
    /// What holds the part.
    pub fixtures: Vec<FixtureInput>,
    /// Jobs that have marked some of the texture before.
    pub marked: Vec<MarkedInput>,
    /// What is marked in the first pass, at least one.
    pub textures: Vec<texture::Request>,
    /// The drawings and space curves among them as named in the job file, relative to it.
    pub drawings: Vec<PathBuf>,
    /// Depth of focus.
    pub focus: Focus,
    /// How the surface is divided.
    pub partition: Partition,
    /// In which order stops and strokes are marked.
    pub order: Order,
    /// How often the part is gone over.
    pub passes: Passes,
    /// Set-ups of a part beyond the stage travel.
    pub setups: Option<Setups>,
    /// What is skipped, and what causes a warning.
    pub limits: Limits,
    /// How pens compensate the slope, if they do.
    pub dose: Option<Dose>,
    /// Where the machine is described.
    pub machine: MachineInput,
    /// Laser settings, at least one; names differ.
    pub pens: Vec<Pen>,
    /// Whether the pens ask for skywriting, in their order.
    pub skywriting: Vec<bool>,
    /// What is written, at least one.
    pub formats: Vec<Format>,
    /// Whether the job file names these formats; they are the default of its mode otherwise.
    pub names_formats: bool,
    /// The pen of frames, if they are asked for.
    pub frames: Option<PenId>,
    /// Whether the power of marks on the fly follows the speed of the spot.
    pub power_by_speed: bool,
    /// What the user should know of the file.
    pub warnings: Vec<Diag>,
}

/// The surface file and how it is read.
#[derive(Clone, Debug, PartialEq)]
pub struct SurfaceInput {
    /// The file as named in the job file, relative to it.
    pub file: PathBuf,
    /// Unit and scale.
    pub options: surface::Options,
    /// Vertices nearer to each other than this become one.
    pub weld: Nm,
    /// What is done about edges on which a sheet hangs.
    pub non_manifold: surface::NonManifold,
    /// How far the file's facets, samples or points lie from the part, where the job states it.
    pub tessellation: Option<Length>,
}

/// How the part lies on the table.
#[derive(Clone, Debug)]
pub struct Placement {
    /// Table-frame position of the turned part's origin, nm; None: the centre of the texture lies at the
    /// centre of travel.
    pub origin: Option<Origin>,
    /// How the surface file is rotated before all else; None: it lies as it is.
    pub laid: Option<Attitude>,
    /// Turn of the part about its z axis, counter-clockwise.
    pub turn: Angle,
    /// How far points of the registered part lie from where they should in x and y, and in z, where the job states it.
    pub residual: [Option<Length>; 2],
    /// The points that were measured on the part.
    pub measured: Option<MeasuredInput>,
}

/// Where the points that were measured on the part stand.
#[derive(Clone, Debug, PartialEq)]
pub struct MeasuredInput {
    /// Their table, as named in the job file, relative to it.
    pub file: PathBuf,
    /// Standard deviations of the part's height that stops keep free.
    pub sigmas: f64,
    /// The part may be warped by up to this much; None: it is rigid.
    pub warp: Option<Length>,
    /// What is done where so many deviations do not fit into the depth range.
    pub unsure: super::Unsure,
}

/// How the job says that a part is laid under the lens.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Attitude {
    /// Rotated about x, y and z of the surface file, in this order.
    Rotated([Angle; 3]),
    /// This direction of the surface file looks at the lens.
    Up([f64; 3]),
    /// The plane through these points of the surface file is level; the lens sees them counter-clockwise.
    Level([[f64; 3]; 3]),
}

impl Placement {
    /// By how much the surface file is rotated about x, y and z, deg, to a thousandth; None where it is not.
    pub fn laid_deg(&self) -> Option<[f64; 3]> {
        let pose = self.laid?.pose()?;
        Some(pose.angles().map(|rad| (rad.to_degrees() * 1e3).round() / 1e3 + 0.0))
    }
}

impl Attitude {
    /// The rotation; None without one.
    pub fn pose(&self) -> Option<Pose> {
        match *self {
            Self::Rotated(angles) => Some(Pose::from_angles(angles.map(Angle::as_rad))),
            Self::Up(direction) => Pose::from_up(direction),
            Self::Level(points) => Pose::from_plane(points),
        }
    }
}

/// Depth of focus.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Focus {
    /// Processing depth of focus.
    pub pdof: Nm,
    /// What is taken off PDOF for errors.
    pub reserve: Nm,
    /// Largest depth range of a block: PDOF less the reserve, or twice that under `rule = "half"`.
    pub depth: Nm,
    /// What PDOF bounds.
    pub rule: super::DepthRule,
    /// Position of the focal plane of a block.
    pub level: Level,
    /// Whether it stays there wherever the stop stands.
    pub is_kept: bool,
}

impl Focus {
    /// How far marks may lie from their focal plane, mm: half the depth range.
    pub fn half_depth_mm(&self) -> f64 {
        self.depth.mm() / 2.0
    }
}

impl super::DepthRule {
    /// The height range that a depth of focus allows.
    pub fn range(self, pdof: Nm) -> Nm {
        match self {
            Self::Range => pdof,
            Self::Half => pdof * 2,
        }
    }
}

/// Order of stops and strokes.
#[derive(Clone, Copy, Debug, Default)]
pub struct Order {
    /// Of the stops.
    pub stops: StopOrder,
    /// Of the strokes within a block.
    pub strokes: StrokeOrder,
}

/// Set-ups of a part beyond the stage travel.
#[derive(Clone, Debug, PartialEq)]
pub struct Setups {
    /// How many columns along x and rows along y the stops are divided into; None: the fewest that the travel allows.
    pub count: [Option<u32>; 2],
    /// Points of the part's own frame, nm; at least two, all different.
    pub registration: Vec<P2>,
}

/// What is skipped, and what causes a warning.
#[derive(Clone, Copy, Debug)]
pub struct Limits {
    /// Beam incidence above which a warning says so.
    pub warn_incidence: Angle,
    /// Beam incidence above which nothing is marked; below 90 deg.
    pub max_incidence: Angle,
    /// What happens to texture beyond it.
    pub steep: Steep,
    /// Share of the length of a texture that the job places that may lie off the part.
    pub max_off_part: Share,
    /// What happens to values that the machine's optics make implausible.
    pub implausible: Implausible,
}

impl Limits {
    /// Tangent of the steepest slope that is marked.
    pub fn max_slope(&self) -> f64 {
        math::tan(self.max_incidence.as_rad())
    }
}

/// Where the machine is described.
#[derive(Clone, Debug)]
pub enum MachineInput {
    /// A built-in profile.
    Profile(String),
    /// A file, relative to the job file.
    File(PathBuf),
}

/// The fault of a path that separates folders by backslashes; None where it does not. Elsewhere than on Windows a
/// backslash may stand in the name of a file: one that is there, as it can be opened at `full`.
pub fn backslash(path: &Path, full: &Path) -> Option<Diag> {
    let shown = path.to_string_lossy();
    if !shown.contains('\\') || cfg!(not(windows)) && full.exists() {
        return None;
    }
    let text = format!("the path {shown} has a backslash, which separates folders on Windows alone");
    Some(Diag::input("path-backslash", text).hint(format!("write {}", shown.replace('\\', "/"))))
}

impl Job {
    /// The job file as a place.
    pub fn place(&self) -> Place {
        Place::file(self.path.display().to_string())
    }

    /// A path of the job file, relative to the job file's folder.
    pub fn relative(&self, path: &Path) -> PathBuf {
        self.path.parent().unwrap_or(Path::new("")).join(path)
    }

    /// The surface file, as it can be opened.
    pub fn surface_path(&self) -> PathBuf {
        self.relative(&self.surface.file)
    }

    /// The files that the job file names, as named there, each with what it is for. The same file may be named twice.
    pub fn input_files(&self) -> Vec<(&'static str, &Path)> {
        let drawings = self.drawings.iter().map(|file| ("texture", file.as_path()));
        let machine = match &self.machine {
            MachineInput::File(file) => Some(("machine", file.as_path())),
            MachineInput::Profile(_) => None,
        };
        let measured = self.placement.measured.as_ref().map(|measured| ("measured", measured.file.as_path()));
        std::iter::once(("surface", self.surface.file.as_path()))
            .chain(drawings)
            .chain(machine)
            .chain(measured)
            .chain(self.marked.iter().flat_map(|marked| marked.files()).map(|file| ("marked", file.as_path())))
            .chain(self.fixtures.iter().filter_map(|fixture| Some(("fixture", fixture.file()?.as_path()))))
            .collect()
    }

    /// The job planned by this method, in one pass and one set-up, without dose compensation and fixtures, which are there
    /// in some set-ups. For comparing ways of marking.
    pub fn plain(&self, method: Method) -> Self {
        let mut job = self.clone();
        job.partition.method = method;
        job.passes = Passes::default();
        job.setups = None;
        job.fixtures.clear();
        job.dose = None;
        // Nothing is written, so nothing has to be carried by the formats of the job.
        job.formats.clear();
        job.frames = None;
        job
    }

    /// Distance of cells on a square lattice, with whose rows sections keep step where they are to stay whole.
    pub fn figure_pitch(&self) -> Option<Nm> {
        let pitch = |t: &texture::Request| t.kind.figure_pitch_mm().map(|p| Nm::round(p * NM_PER_MM));
        if self.partition.keep_whole > Nm(0) { self.textures.iter().find_map(pitch) } else { None }
    }

    /// What is to be marked in pass `k`, from 0. Straight hatches turn, lines along contours move by a part of
    /// their pitch; all else stays.
    pub fn textures_of_pass(&self, PassId(k): PassId) -> Vec<texture::Request> {
        let turned = f64::from(k) * self.passes.rotate.as_rad();
        let mut textures = self.textures.clone();
        for texture in &mut textures {
            texture.kind = texture.kind.clone().of_pass(turned, Passes::share(k));
        }
        textures
    }

    /// The error with the key that names a file as its place, where it says that the file cannot be read.
    #[must_use]
    pub fn at_keys(&self, e: &Error) -> Error {
        let named_files = self.named_files();
        Error::many(e.diags().iter().map(|d| self.at_key(d, &named_files)).collect())
    }

    /// The files that the job file names, as they can be opened, each with its key.
    fn named_files(&self) -> Vec<(String, PathBuf)> {
        let machine = match &self.machine {
            MachineInput::File(file) => Some(("machine.file".to_owned(), self.relative(file))),
            MachineInput::Profile(_) => None,
        };
        let surface = Some(("surface.file".to_owned(), self.surface_path()));
        let measured = self.placement.measured.as_ref();
        let measured = measured.map(|m| ("placement.measured.file".to_owned(), self.relative(&m.file)));
        let mut files: Vec<(String, PathBuf)> = surface.into_iter().chain(machine).chain(measured).collect();
        for (i, marked) in self.marked.iter().enumerate() {
            let key = |file: &PathBuf| {
                let is_left = marked.left.as_ref().is_some_and(|left| file.starts_with(left));
                if is_left { format!("marked.{i}.left") } else { format!("marked.{i}.folder") }
            };
            files.extend(marked.files().iter().map(|file| (key(file), self.relative(file))));
        }
        for (i, fixture) in self.fixtures.iter().enumerate() {
            files.extend(fixture.file().map(|file| (format!("fixture.{i}.file"), self.relative(file))));
        }
        for (i, texture) in self.textures.iter().enumerate() {
            let masks = texture.masks.list().map(|(key, mask)| (key, &mask.drawing));
            for (key, kind) in std::iter::once(("file", &texture.kind)).chain(masks) {
                match kind {
                    texture::Kind::Drawing { path, .. } => files.push((format!("texture.{i}.{key}"), path.clone())),
                    texture::Kind::Curves { path, .. } => files.push((format!("texture.{i}.curves"), path.clone())),
                    _ => {}
                }
            }
        }
        files
    }

    /// Paths that lead to a file on Windows alone, where `\\` separates folders: a folder that was made of them could be
    /// proved on no other system.
    pub(super) fn backslashes(&self) -> Vec<Diag> {
        let named_files = self.named_files();
        let mut faults = Vec::new();
        for (_, file) in self.input_files() {
            let full = self.relative(file);
            let Some(fault) = backslash(file, &full) else { continue };
            let key = named_files.iter().find(|(_, named)| *named == full);
            faults.push(fault.at(key.map_or_else(|| self.place(), |(key, _)| self.place_of(key))));
        }
        faults
    }

    /// A diagnostic with its key as its place, where it is about one of these files that cannot be read.
    fn at_key(&self, d: &Diag, named_files: &[(String, PathBuf)]) -> Diag {
        let Place::File { path, line: None } = &d.place else { return d.clone() };
        let is_of = |file: &Path| d.code == "file-unreadable" && file.display().to_string() == *path;
        let Some((key, _)) = named_files.iter().find(|(_, file)| is_of(file)) else { return d.clone() };
        let hint = format!("{}; paths in a job file are relative to the job file", d.hint);
        d.clone().at(self.place_of(key)).hint(hint)
    }

    /// The place of a key of the machine file, such as `delays.jump`; of a built-in machine its name in the job file.
    pub fn place_in_machine(&self, key: &str) -> Place {
        let MachineInput::File(file) = &self.machine else { return self.place_of("machine.profile") };
        let path = self.relative(file);
        let shown = path.display().to_string();
        match std::fs::read_to_string(&path) {
            Ok(text) => diag::place_of(&shown, &text.into(), key),
            Err(_) => Place::file(shown),
        }
    }

    /// The machine that the job names.
    ///
    /// # Errors
    /// Faults of the machine file; `machine-unknown`, pointing at the name.
    pub fn machine(&self) -> Result<Machine, Error> {
        match &self.machine {
            MachineInput::File(file) => Machine::load(&self.relative(file)),
            MachineInput::Profile(name) => Machine::built_in(name).map_err(|e| {
                let place = self.place_of("machine.profile");
                let at = |d: &Diag| if d.code == "machine-unknown" { d.clone().at(place.clone()) } else { d.clone() };
                Error::many(e.diags().iter().map(at).collect())
            }),
        }
    }
}
