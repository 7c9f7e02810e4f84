//! Marks of jobs before, read from their folders and taken back to the part as designed.

use std::collections::BTreeSet;
use std::sync::Arc;

use super::geometry::{Geometry, Line, Pose, Scratch};
use super::read;
use super::rules::marked::Mark;
use super::unusable;
use terrace_core::diag::Error;
use terrace_core::geom::{FieldPoint, NM_PER_MM, P2, Turn};
use terrace_core::program::PenId;
use terrace_input::job::{Job, MarkedInput};
use terrace_input::surface::Joining;
use terrace_input::texture::marked::{Lay, Marked, MarkedStroke};

/// Marks of jobs before.
#[derive(Default)]
pub(super) struct MarkedBefore {
    /// By this crate's own geometry, which the texture that is left is held to.
    pub(super) marks: Vec<Mark>,
    /// As the compiler has them: its cuts are where they are to a nanometre.
    strokes: Vec<MarkedStroke>,
}

impl MarkedBefore {
    /// The marks of the jobs that a job names; none where it names none.
    ///
    /// # Errors
    /// Faults of their folders.
    pub(super) fn read(job: &Job, spot_mm: f64, designed: &Geometry) -> Result<Self, Error> {
        let mut all = Self::default();
        for input in &job.marked {
            all.add(job, input, spot_mm, designed)?;
        }
        Ok(all)
    }

    /// What the compiler leaves out of the texture.
    pub(super) fn left_out(&self, spot_mm: f64) -> Arc<Marked> {
        Arc::new(Marked::new(&self.strokes, spot_mm * NM_PER_MM / 2.0))
    }

    /// Adds the marks of a job before.
    fn add(&mut self, job: &Job, input: &MarkedInput, spot_mm: f64, designed: &Geometry) -> Result<(), Error> {
        let folder = job.relative(&input.folder);
        let manifest: read::manifest::Manifest = read::manifest::read(&folder, &read::leaves::STEPPED)?;
        let name = folder.join("program.txt");
        let program = read::program::read(&name).map_err(|fault| unusable("marked-folder", &fault.message, &name))?;
        let mut left = BTreeSet::new();
        if let Some(rest) = &input.left {
            let rest: read::manifest::Manifest = read::manifest::read(&job.relative(rest), &read::leaves::STEPPED)?;
            left.extend(rest.subset.into_iter().flat_map(|subset| subset.blocks));
        }
        let lay = match &manifest.placement.measured {
            Some(measured) => {
                let pose = Pose { rows: measured.rows, shift: measured.rest_nm };
                let motion = Turn::rigid(measured.rows, measured.rest_nm);
                Some((designed.moved(&pose), pose, compiled_lay(job, spot_mm, motion)?))
            }
            None => None,
        };
        let mut scratch = Scratch::default();
        for (id, block) in program.ids.iter().zip(&program.program.blocks) {
            if left.contains(id) {
                continue;
            }
            let centre = Turn::drawn(block.stop.centre);
            for stroke in program.program.strokes_of(block) {
                let name = &program.program.pens[stroke.pen.index()].name;
                let Some(pen) = job.pens.iter().position(|pen| pen.name == *name) else {
                    return Err(unusable("marked-pen", &format!("the job has no pen {name:?}"), &folder));
                };
                let pen = PenId(pen as u16);
                let at = |p: &FieldPoint| P2::new(centre.x + i64::from(p.x), centre.y + i64::from(p.y));
                let points: Vec<P2> = program.program.points_of(stroke).iter().map(at).collect();
                let [own, compiled] = match &lay {
                    Some((lay, pose, compiled)) => {
                        [taken_back(&points, lay, pose, &mut scratch), compiled.as_designed(&points)]
                    }
                    None => [(); 2].map(|()| points.iter().map(|p| [p.x as f64, p.y as f64]).collect()),
                };
                self.marks.push(Mark { pen, points: own });
                self.strokes.push(MarkedStroke { pen, points: compiled });
            }
        }
        Ok(())
    }
}

/// The part of a job as a motion takes it, by the compiler's reader.
fn compiled_lay(job: &Job, spot_mm: f64, motion: Turn) -> Result<Lay, Error> {
    let joining =
        Joining { weld_mm: job.surface.weld.mm(), narrow_mm: spot_mm, non_manifold: job.surface.non_manifold };
    let turn = job.placement.turn.as_rad();
    Lay::load(&job.surface_path(), &job.surface.options, joining, turn, motion, job.limits.max_slope())
}

/// Where a mark on a part as it lay is on the part as designed.
fn taken_back(points: &[P2], lay: &Geometry, pose: &Pose, scratch: &mut Scratch) -> Vec<[f64; 2]> {
    let xy = |p: P2| [p.x as f64, p.y as f64];
    let back = |[x, y]: [f64; 2], z: f64| {
        let [x, y, _] = pose.back([x, y, z]);
        [x, y]
    };
    if let &[dot] = points {
        let sheet = lay.around(xy(dot), scratch).into_iter().find_map(|piece| piece.sheet);
        return sheet.map(|sheet| back(xy(dot), sheet.z[0])).into_iter().collect();
    }
    let mut out = Vec::new();
    for ends in points.windows(2) {
        let line = Line::new(xy(ends[0]), xy(ends[1]));
        lay.along(&line, scratch, |piece| {
            if let Some(sheet) = piece.sheet {
                out.extend([0, 1].map(|k| back(line.at(piece.d[k]), sheet.z[k])));
            }
        });
    }
    out
}
