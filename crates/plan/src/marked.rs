//! What jobs before have marked on a part, as they were compiled: where it lies on the part as designed.
//!
//! Consumes the folders of those jobs: their programs, which hold every mark where it lay, and how the part lay under
//! them. A part that is clamped again is measured again, and what is left is planned for how it lies now; so are several
//! set-ups of a part that are each measured.

use std::collections::BTreeSet;
use std::path::Path;
use std::sync::Arc;

use crate::manifest::Manifest;
use terrace_core::diag::{self, Diag, Error, Place};
use terrace_core::geom::{NM_PER_MM, P2, Turn};
use terrace_core::program::{Block, PenId, Program, text};
use terrace_input::job::{Job, MarkedInput};
use terrace_input::surface::{Joining, Surface};
use terrace_input::texture::Texture;
use terrace_input::texture::marked::{Lay, LeftOut, Marked, MarkedStroke};

/// Share of what was marked that has to be of the texture, or the user is told.
const MOST_OF_IT: f64 = 0.98;

/// The texture of a job without what jobs before have marked of it; as it is where the job names none.
///
/// # Errors
/// Faults of their folders; `marked-part`, `marked-pen`, `marked-tilt`, `marked-passes`, `marked-contour` and
/// `marked-changed` for jobs that cannot be gone on with; `marked-none` where nothing of the texture was marked;
/// `marked-all` where all of it was.
pub(crate) fn left(
    job: &Job,
    joining: Joining,
    surface: &Surface,
    texture: Texture,
    warnings: &mut Vec<Diag>,
) -> Result<Texture, Error> {
    if job.marked.is_empty() {
        return Ok(texture);
    }
    let place = || job.place_of("marked");
    if texture.contours().next().is_some() {
        let text = "what is filled along contours has no strokes of its own, of which some could be left";
        let fault = Diag::limit("marked-contour", text).at(place());
        return Err(fault.hint("fill the area in another direction, or mark all of it in one job").into());
    }
    let mut strokes = Vec::new();
    for (i, input) in job.marked.iter().enumerate() {
        let before = Before { job, input, key: format!("marked.{i}") };
        strokes.extend(before.marks(joining, surface, warnings)?);
    }
    let found = texture.without(&Arc::new(Marked::new(&strokes, joining.narrow_mm * NM_PER_MM / 2.0)))?;
    let LeftOut { nm, dots } = found.left_out;
    if nm == 0 && dots == 0 {
        let text = "nothing of the texture was marked by the jobs of [[marked]]";
        let hint = "the texture, its area and the datum of the surface have to be those of the job before";
        return Err(Diag::input("marked-none", text).at(place()).hint(hint).into());
    }
    if found.texture.is_empty() {
        let text = "all of the texture is marked already";
        return Err(Diag::input("marked-all", text).at(place()).hint("there is nothing left to mark").into());
    }
    let marked: f64 = strokes.iter().flat_map(|stroke| stroke.points.windows(2)).map(|w| length(w[0], w[1])).sum();
    if (nm as f64) < MOST_OF_IT * marked {
        let [found, marked] = [nm as f64, marked].map(|nm| nm / 1e6);
        let text = format!("of {marked:.3} mm that jobs before have marked, {found:.3} mm are of this texture");
        let hint = "what is not will lie beside it: check texture, area and pens against the job before";
        warnings.push(Diag::warning("marked-other", text).at(place()).hint(hint));
    }
    Ok(found.texture)
}

fn length([ax, ay]: [f64; 2], [bx, by]: [f64; 2]) -> f64 {
    terrace_core::math::hypot(bx - ax, by - ay)
}

/// A job before.
struct Before<'a> {
    job: &'a Job,
    input: &'a MarkedInput,
    /// Its key in the job file.
    key: String,
}

impl Before<'_> {
    /// A fault of its folder.
    fn refused(&self, fault: Diag, hint: &str) -> Error {
        fault.at(self.job.place_of(&format!("{}.folder", self.key))).hint(hint).into()
    }

    /// Its marks, on the part as designed.
    fn marks(&self, joining: Joining, surface: &Surface, warnings: &mut Vec<Diag>) -> Result<Vec<MarkedStroke>, Error> {
        let folder = self.job.relative(&self.input.folder);
        let manifest: Manifest = Manifest::read(&folder)?;
        self.same_part(&manifest, surface)?;
        warnings.extend(self.same_table(&manifest)?);
        if manifest.passes.len() > 1 {
            let text = "the job before has several passes, of which one cannot be gone on with";
            return Err(self.refused(Diag::input("marked-passes", text), "mark what is left pass by pass"));
        }
        let name = folder.join("program.txt");
        let bytes = diag::read_file(&name, u64::MAX)?;
        let hash = blake3::hash(&bytes).to_hex().to_string();
        self.unchanged(&manifest, &hash, &name)?;
        let (program, _) = text::parse(&name.display().to_string(), &bytes)?;
        let pens = self.pens(&program)?;
        let left = self.left(&hash)?;
        let lay = match &manifest.placement.measured {
            None => None,
            Some(measured) => {
                let motion = Turn::rigid(measured.rows, measured.rest_nm);
                Some(Lay::new(surface, motion, joining, self.job.limits.max_slope())?)
            }
        };
        let mut strokes = Vec::new();
        for (i, block) in program.blocks.iter().enumerate() {
            if left.contains(&program.id(i).to_string()) {
                continue;
            }
            if !block.stop.tilt.is_upright() {
                let fault = Diag::input("marked-tilt", "the job before has tilted the part");
                return Err(self.refused(fault, "what is left of such a job is resumed as it lies"));
            }
            strokes.extend(self.of_block(&program, block, lay.as_ref(), &pens));
        }
        Ok(strokes)
    }

    /// The marks of a block.
    fn of_block(&self, program: &Program, block: &Block, lay: Option<&Lay>, pens: &[PenId]) -> Vec<MarkedStroke> {
        let centre = Turn::drawn(block.stop.centre);
        let strokes = program.strokes_of(block).iter().map(|stroke| {
            let at = |p: &terrace_core::geom::FieldPoint| P2::new(centre.x + i64::from(p.x), centre.y + i64::from(p.y));
            let points: Vec<P2> = program.points_of(stroke).iter().map(at).collect();
            let points = match lay {
                None => points.iter().map(|p| [p.x as f64, p.y as f64]).collect(),
                Some(lay) => lay.as_designed(&points),
            };
            MarkedStroke { pen: pens[stroke.pen.index()], points }
        });
        strokes.collect()
    }

    /// Holds it to the part of this job: the same file, laid and turned as it is now.
    fn same_part(&self, manifest: &Manifest, surface: &Surface) -> Result<(), Error> {
        let stated = manifest.head.inputs.iter().find(|input| input.role == "surface").map(|input| &input.blake3);
        let bytes = diag::read_file(&self.job.surface_path(), u64::MAX)?;
        let own = blake3::hash(&bytes).to_hex().to_string();
        let placement = &self.job.placement;
        let size = surface.size_mm();
        let is_same_size = manifest.summary.part_mm.iter().zip(size).all(|(a, b)| (a - b).abs() < 1e-3);
        let differs = if stated != Some(&own) {
            "its surface file is another, or has changed since"
        } else if manifest.placement.laid_deg != placement.laid_deg() {
            "its part is laid otherwise"
        } else if (manifest.placement.turn_deg - placement.turn.as_deg()).abs() > 1e-9 {
            "its part is turned otherwise"
        } else if !is_same_size {
            "its part has another size"
        } else {
            return Ok(());
        };
        let text = format!("{} is a job on another part: {differs}", self.input.folder.display());
        let hint = "what is left has to be marked with the surface of the job before";
        Err(self.refused(Diag::input("marked-part", text), hint))
    }

    /// Whether both lie by the same measurement: then the part was not moved since, or not measured again.
    fn same_table(&self, manifest: &Manifest) -> Result<Option<Diag>, Error> {
        let Some(measured) = &self.job.placement.measured else { return Ok(None) };
        let stated = manifest.head.inputs.iter().find(|input| input.role == "measured").map(|input| &input.blake3);
        let bytes = diag::read_file(&self.job.relative(&measured.file), u64::MAX)?;
        let own = blake3::hash(&bytes).to_hex().to_string();
        Ok((stated == Some(&own)).then(|| {
            let text = format!("the part lies by the same points as {} has it", self.input.folder.display());
            let hint = "right if it was not moved since; if it was clamped again, measure it, into a table of its own";
            Diag::warning("marked-same-table", text).at(self.job.place_of("placement.measured.file")).hint(hint)
        }))
    }

    /// Holds its program to its manifest.
    fn unchanged(&self, manifest: &Manifest, hash: &str, program: &Path) -> Result<(), Error> {
        if manifest.head.files.iter().any(|file| file.file == "program.txt" && file.blake3 == hash) {
            return Ok(());
        }
        let fault = Diag::limit("marked-changed", "the program is not as it was written");
        let fault = fault.at(Place::file(program.display().to_string()));
        Err(fault.hint("restore the job folder from a copy: what was marked cannot be told from a changed one").into())
    }

    /// The pens of its program among those of this job.
    fn pens(&self, program: &Program) -> Result<Vec<PenId>, Error> {
        let of = |pen: &terrace_core::program::Pen| {
            let own = self.job.pens.iter().position(|own| own.name == pen.name);
            own.map(|i| PenId(i as u16)).ok_or_else(|| {
                let text = format!("the job before marks with a pen {:?} that this one does not have", pen.name);
                let hint = "name pens as they were named: what was marked is found by its pen";
                self.refused(Diag::input("marked-pen", text), hint)
            })
        };
        program.pens.iter().map(of).collect()
    }

    /// The names of its blocks that are not marked.
    fn left(&self, hash: &str) -> Result<BTreeSet<String>, Error> {
        let Some(left) = &self.input.left else { return Ok(BTreeSet::new()) };
        let folder = self.job.relative(left);
        let manifest: Manifest = Manifest::read(&folder)?;
        let is_of_it = manifest.head.files.iter().any(|file| file.file == "program.txt" && file.blake3 == hash);
        let place = self.job.place_of(&format!("{}.left", self.key));
        let fault = |text: &str| {
            let hint = "name the folder that `terrace resume` has written for the job before";
            Error::from(Diag::input("marked-folder", text).at(place.clone()).hint(hint))
        };
        if !is_of_it {
            return Err(fault("the folder is not what is left of the job before"));
        }
        let Some(subset) = manifest.subset else { return Err(fault("the folder holds a whole job, not what is left")) };
        Ok(subset.blocks.into_iter().collect())
    }
}
