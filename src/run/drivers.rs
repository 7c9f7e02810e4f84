//! The drivers that a run file names.

use std::rc::Rc;

use super::Console;
use super::folder::Folder;
use super::laser::{self, Laser};
use super::settings::{LaserKeys, RunFile, StageKeys};
use super::stage::{self, Stage};
use crate::diag::Diag;

/// The driver of the stage.
pub(super) fn stage(keys: &StageKeys, console: &Rc<dyn Console>) -> Result<Box<dyn Stage>, Diag> {
    Ok(match keys {
        StageKeys::Linuxcnc(keys) => Box::new(stage::linuxcnc::LinuxCnc::new(keys)),
        StageKeys::Grbl { .. } => return Err(missing("grbl")),
        StageKeys::Manual {} => Box::new(stage::manual::Manual::new(console)),
    })
}

/// The driver of the laser.
pub(super) fn laser(keys: &RunFile, folder: &Folder, console: &Rc<dyn Console>) -> Result<Box<dyn Laser>, Diag> {
    let shifts = folder.blocks.iter().find(|b| b.focus_shift != 0);
    let driver: Box<dyn Laser> = match &keys.laser {
        LaserKeys::Lightburn { .. } => return Err(missing("lightburn")),
        LaserKeys::Lmc { .. } => return Err(missing("lmc")),
        LaserKeys::Command(keys) => Box::new(laser::command::Command::new(keys, folder.formats())?),
        LaserKeys::Handshake {} => {
            if !matches!(keys.stage, StageKeys::Linuxcnc(_)) {
                return Err(stage::no_handshake());
            }
            Box::new(laser::handshake::Handshake)
        }
        LaserKeys::Manual {} => Box::new(laser::manual::Manual::new(console)),
    };
    match shifts {
        Some(block) if !driver.sets_focus_shift() => {
            let text = format!("block {} needs a focus shift, which this laser driver cannot set", block.id);
            Err(Diag::limit("run-focus-shift", text)
                .hint("use laser.driver = \"command\" with {shift} in laser.mark, or compile without the zoom optic"))
        }
        _ => Ok(driver),
    }
}

fn missing(driver: &str) -> Diag {
    Diag::input("run-driver", format!("the driver {driver} is not part of this build"))
}
