//! The drivers that a run file names.

use std::net::ToSocketAddrs;
use std::rc::Rc;

use super::Console;
use super::folder::Folder;
use super::laser::{self, Laser};
use super::settings::{GrblKeys, LaserKeys, LightBurnKeys, LmcKeys, RunFile, StageKeys};
use super::stage::{self, Stage};
use terrace_core::diag::Diag;

/// What no two runs may drive at once: the machine, and what its stage and its laser are reached by. Looks hosts up.
pub(super) fn identities(keys: &RunFile) -> Vec<String> {
    let mut all = vec![format!("machine {}", keys.machine)];
    match &keys.stage {
        StageKeys::Linuxcnc(keys) => {
            all.extend(addresses(keys.address.as_str(), &keys.address).iter().map(|at| format!("linuxcncrsh at {at}")));
        }
        StageKeys::Grbl(GrblKeys { port, .. }) => {
            // By whatever link the port is named.
            let port = std::fs::canonicalize(port).map_or_else(|_| port.clone(), |found| found.display().to_string());
            all.push(format!("port {port}"));
        }
        StageKeys::Manual(_) => {}
    }
    match &keys.laser {
        LaserKeys::Lightburn(LightBurnKeys { address, port, .. }) => {
            let host = address.as_deref().unwrap_or("localhost");
            let port = port.unwrap_or(laser::lightburn::PORTS[0]);
            let at = addresses((host, port), &format!("{host}:{port}"));
            all.extend(at.iter().map(|at| format!("LightBurn at {at}")));
        }
        LaserKeys::Lmc(LmcKeys { serial, .. }) => {
            all.push(format!("LMC card {}", serial.as_deref().unwrap_or_default()))
        }
        LaserKeys::Command(_) | LaserKeys::Handshake(_) | LaserKeys::Manual(_) => {}
    }
    all
}

/// The addresses that a name stands for, or the name where nothing knows it.
fn addresses(named: impl ToSocketAddrs, text: &str) -> Vec<String> {
    let mut found: Vec<String> = named.to_socket_addrs().into_iter().flatten().map(|at| at.to_string()).collect();
    found.sort();
    found.dedup();
    if found.is_empty() {
        found.push(text.to_owned());
    }
    found
}

/// The driver of the stage.
pub(super) fn stage(keys: &StageKeys, console: &Rc<dyn Console>) -> Result<Box<dyn Stage>, Diag> {
    Ok(match keys {
        StageKeys::Linuxcnc(keys) => Box::new(stage::linuxcnc::LinuxCnc::new(keys)),
        StageKeys::Grbl(GrblKeys { port, baud, identity }) => {
            Box::new(stage::grbl::Grbl::new(port.clone(), *baud, identity.clone()))
        }
        StageKeys::Manual(_) => Box::new(stage::manual::Manual::new(console)),
    })
}

/// The driver of the laser.
pub(super) fn laser(keys: &RunFile, folder: &Folder, console: &Rc<dyn Console>) -> Result<Box<dyn Laser>, Diag> {
    let shifts = folder.blocks.iter().find(|b| b.focus_shift != 0);
    let driver: Box<dyn Laser> = match &keys.laser {
        LaserKeys::Lightburn(LightBurnKeys { address, folder, port, answers }) => {
            Box::new(laser::lightburn::LightBurn::new(address.clone(), folder.clone(), *port, *answers))
        }
        LaserKeys::Lmc(LmcKeys { serial, correction }) => {
            let source = folder.machine.lmc.map(|l| l.laser).unwrap_or_default();
            Box::new(laser::lmc::Lmc::new(serial.clone(), correction.as_ref().map(Into::into), source))
        }
        LaserKeys::Command(keys) => Box::new(laser::command::Command::new(keys, folder.formats())?),
        LaserKeys::Handshake(_) => {
            if !matches!(keys.stage, StageKeys::Linuxcnc(_)) {
                return Err(stage::no_handshake());
            }
            Box::new(laser::handshake::Handshake::default())
        }
        LaserKeys::Manual(_) => Box::new(laser::manual::Manual::new(console)),
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
