//! A job: its file as it was read, and what follows from it.

use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use toml::Spanned;

use super::{
    AreaName, AreaSpec, DepthRule, Direction, FileUnit, JobFile, MAX_FILE, Method, PartitionSpec, PassesSpec, Pattern,
    TextureSpec, faults,
};
use crate::diag::{self, Diag, Error, Place};
use crate::machine::Machine;
use crate::units::{Angle, Length};
use crate::{surface, texture};

/// A job file that was read and checked, with its text kept for messages.
#[derive(Clone, Debug)]
pub struct Job {
    /// The file, as named by the user.
    pub path: PathBuf,
    /// Its text.
    pub source: Arc<str>,
    /// What it says.
    pub file: JobFile,
    /// Seed of everything that is random; not in the file.
    pub seed: u64,
}

/// Where all keys of a job file are listed.
const KEYS: &str =
    "`terrace init` writes a commented job file; `terrace init --schema` lists every key with its values";

impl Job {
    /// Reads and checks a job file.
    ///
    /// # Errors
    /// Every fault of the file, each with its place.
    pub fn load(path: &Path) -> Result<Self, Error> {
        let bytes = diag::read_file(path, MAX_FILE)?;
        let text = String::from_utf8(bytes).map_err(|_| {
            Diag::input("job-utf8", "the job file is not UTF-8 text").at(Place::file(path.display().to_string()))
        })?;
        Self::parse(path, &text)
    }

    /// Checks the text of a job file that lies, or would lie, at `path`.
    ///
    /// # Errors
    /// As [`Job::load`].
    pub fn parse(path: &Path, text: &str) -> Result<Self, Error> {
        let source: Arc<str> = text.into();
        let file: JobFile = diag::from_toml(&path.display().to_string(), &source, KEYS)?;
        let job = Self { path: path.to_owned(), source, file, seed: 0 };
        let faults = faults::of(&job);
        if faults.is_empty() { Ok(job) } else { Err(Error::many(faults)) }
    }

    /// The place of a value in the job file.
    pub fn place(&self, span: Range<usize>) -> Place {
        Place::Text { path: self.path.display().to_string(), source: self.source.clone(), span }
    }

    /// A path of the job file, relative to the job file's folder.
    pub fn resolve(&self, path: &Path) -> PathBuf {
        self.path.parent().unwrap_or(Path::new("")).join(path)
    }

    /// Processing depth of focus.
    pub fn pdof(&self) -> Length {
        let f = &self.file.focus;
        match (&f.pdof, &f.dof) {
            (Some(p), _) => *p.get_ref(),
            (None, Some(d)) => Length::mm(d.get_ref().as_mm() * f.factor.unwrap_or(1.0)),
            (None, None) => Length::mm(0.0),
        }
    }

    /// Largest depth range of a block: PDOF, or twice PDOF under `rule = "half"`.
    pub fn depth_range(&self) -> Length {
        match self.file.focus.rule {
            DepthRule::Range => self.pdof(),
            DepthRule::Half => Length::mm(2.0 * self.pdof().as_mm()),
        }
    }

    /// The same job with this method, in one pass and one set-up, without dose compensation; with a depth range of
    /// its own where one is given. For comparing ways of marking.
    pub fn plain(&self, method: Method, depth: Option<Length>) -> Self {
        let mut job = self.clone();
        job.file.partition.method = method;
        job.file.passes = PassesSpec::default();
        job.file.setups = None;
        job.file.dose = None;
        if let Some(depth) = depth {
            job.file.focus.rule = DepthRule::Range;
            job.file.focus.pdof = Some(Spanned::new(0..0, depth));
            job.file.partition = PartitionSpec { method, ..PartitionSpec::default() };
        }
        job
    }

    /// Index of the pen of texture `i`.
    pub fn pen_of(&self, i: usize) -> usize {
        let named = self.file.texture[i].pen.as_ref();
        named.and_then(|n| self.file.pen.iter().position(|p| p.name == *n.get_ref())).unwrap_or(0)
    }

    /// How the surface file is to be read.
    pub fn surface_options(&self) -> surface::Options {
        let s = &self.file.surface;
        surface::Options {
            unit_mm: s.unit.map(FileUnit::in_mm),
            heightmap: s.heightmap.as_ref().map(|h| surface::Scale {
                pixel_mm: h.pixel.as_mm(),
                z_mm: h.z.map(Length::as_mm),
                values: h.values.as_ref().map(|v| *v.get_ref()),
                nodata: h.nodata,
                origin_mm: h.origin.map(Length::as_mm),
            }),
            max_edge_mm: s.max_edge.map(Length::as_mm),
        }
    }

    /// Distance of squares or circles, with whose rows sections keep step where they are to stay whole, nm.
    pub fn figure_pitch_nm(&self) -> Option<i64> {
        let figures = |t: &&TextureSpec| {
            matches!(t.pattern.as_ref().map(|p| p.get_ref()), Some(Pattern::Squares | Pattern::Circles))
        };
        let keeps = self.file.partition.keep_whole.as_mm() > 0.0;
        let own = || self.file.texture.iter().find(figures).and_then(|t| t.pitch?.as_nm());
        keeps.then(own).flatten()
    }

    /// What is to be marked in pass `k`, from 0. Straight hatches turn, lines along contours move by a part of
    /// their pitch; all else stays.
    pub fn texture_requests(&self, k: u32) -> Vec<texture::Request> {
        let turned = f64::from(k) * self.file.passes.rotate.as_rad();
        let mm = |l: &Option<Length>| l.map_or(0.0, Length::as_mm);
        let request = |(i, t): (usize, &TextureSpec)| {
            let kind = match t.pattern.as_ref().map(|p| *p.get_ref()) {
                Some(Pattern::Hatch) => match t.direction.unwrap_or(Direction::Angle(Angle::default())) {
                    Direction::Angle(a) => {
                        texture::Kind::Hatch { pitch_mm: mm(&t.pitch), direction_rad: a.as_rad() + turned }
                    }
                    Direction::Contour => {
                        texture::Kind::Contour { pitch_mm: mm(&t.pitch), phase: PassesSpec::share(k) }
                    }
                },
                Some(Pattern::Hilbert) => {
                    texture::Kind::Hilbert { order: t.order.as_ref().map_or(0, |o| *o.get_ref()) }
                }
                Some(Pattern::Squares) => texture::Kind::Squares { cell_mm: mm(&t.cell), pitch_mm: mm(&t.pitch) },
                Some(Pattern::Circles) => texture::Kind::Circles { cell_mm: mm(&t.cell), pitch_mm: mm(&t.pitch) },
                None => texture::Kind::Drawing {
                    path: t.file.as_ref().map_or_else(PathBuf::new, |f| self.resolve(f.get_ref())),
                    size_mm: t.size.map(|s| s.map(Length::as_mm)),
                    origin_mm: t.origin.map(|o| o.map(Length::as_mm)),
                    turn_rad: t.turn.as_rad(),
                    tile: t.tile,
                },
            };
            let area = match t.area.as_ref().map(Spanned::get_ref) {
                Some(AreaSpec::Rectangle(r)) => texture::Area::Rectangle(r.map(Length::as_mm)),
                Some(AreaSpec::Named(AreaName::Part)) => texture::Area::Part,
                None if t.file.is_some() => texture::Area::Unlimited,
                None => texture::Area::Part,
            };
            texture::Request { kind, area, tolerance_mm: t.tolerance.as_mm(), pen: self.pen_of(i) as u16 }
        };
        self.file.texture.iter().enumerate().map(request).collect()
    }

    /// The machine that the job names.
    ///
    /// # Errors
    /// Faults of the machine file; `machine-unknown`, pointing at the name.
    pub fn machine(&self) -> Result<Machine, Error> {
        match (&self.file.machine.profile, &self.file.machine.file) {
            (Some(name), _) => Machine::built_in(name.get_ref()).map_err(|e| {
                let at = |d: &Diag| {
                    if d.code == "machine-unknown" { d.clone().at(self.place(name.span())) } else { d.clone() }
                };
                Error::many(e.diags().iter().map(at).collect())
            }),
            (None, Some(path)) => Machine::load(&self.resolve(path.get_ref())),
            (None, None) => Err(Diag::bug("machine-missing", "a checked job names no machine").into()),
        }
    }
}
