//! The input files of a job, each opened once.

use crate::diag::{Diag, Error};
use crate::geom::mm_from_nm;
use crate::job::Job;
use crate::machine::Machine;
use crate::program::PassId;
use crate::surface::Surface;
use crate::texture::Texture;

/// What a job is planned from.
#[derive(Debug)]
pub struct Inputs {
    /// The machine.
    pub machine: Machine,
    /// The part's surface, turned as the job says.
    pub surface: Surface,
    /// The texture of the first pass.
    pub texture: Texture,
    /// What the user should know of the files.
    pub warnings: Vec<Diag>,
}

impl Inputs {
    /// Reads machine, surface and drawings.
    ///
    /// # Errors
    /// Faults of the files.
    pub fn load(job: &Job) -> Result<Self, Error> {
        let machine = job.machine()?;
        let mut warnings = job.warnings.clone();
        // What was warned of before a fault often tells its cause.
        match Self::read(job, &mut warnings) {
            Ok((surface, texture)) => Ok(Self { machine, surface, texture, warnings }),
            Err(e) => Err(e.after(warnings)),
        }
    }

    fn read(job: &Job, warnings: &mut Vec<Diag>) -> Result<(Surface, Texture), Error> {
        let turn = job.placement.turn.as_rad();
        let weld = mm_from_nm(job.surface.weld_nm);
        let surface = Surface::load(&job.surface_path(), &job.surface.options, weld, turn, warnings)?;
        let texture = Texture::load(&job.textures, surface.part_box_mm(), turn, warnings)?;
        Ok((surface, texture))
    }

    /// The texture of pass `k`, from 0.
    ///
    /// # Errors
    /// Those of patterns, which the turn from pass to pass can cause.
    pub fn texture_of_pass(&self, job: &Job, pass: PassId) -> Result<Texture, Error> {
        if pass == PassId(0) {
            return Ok(self.texture.clone());
        }
        let turn = job.placement.turn.as_rad();
        self.texture.of_pass(&job.textures_of_pass(pass), self.surface.part_box_mm(), turn)
    }
}
