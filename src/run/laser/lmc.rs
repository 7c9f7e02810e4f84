//! A BJJCZ (LMC) card over USB.
//!
//! Commands of 12 bytes (a command and five values, 16 bits each) are answered with four words, of which the last is the
//! status; packets of 3072 bytes hold 256 list commands and have no answer. For each block the list buffer is cleared,
//! laser enable and master oscillator are switched on, each packet is sent when the card is ready for it, the list is
//! started after the third packet or the last, and the status polled until the card is no longer busy. The laser is then
//! switched off. A block counts as marked where the card was seen busy after the start.
//!
//! With the pilot laser the same points are jumps at the speed of the marks, with output 8 on and laser enable and
//! oscillator off.
//!
//! The card is documented by its users alone: order and values of the commands are those of galvoplotter's controller.
//! Tried only against a stand-in for the card.

mod correction;
mod list;
mod usb;

use std::path::PathBuf;
use std::time::{Duration, Instant};

use self::list::List;
use super::super::Interrupt;
use super::super::stage::Stage;
use super::{Beam, Laser, Work};
use terrace_core::diag::{self, Diag};
use terrace_core::machine::LmcLaser;

/// The cards that are connected, by their serial numbers.
///
/// # Errors
/// Why the system does not say.
pub fn cards() -> Result<Vec<String>, String> {
    usb::cards()
}

const ENABLE_LASER: u16 = 0x04;
const EXECUTE_LIST: u16 = 0x05;
const SET_PWM_PULSE_WIDTH: u16 = 0x06;
const GET_VERSION: u16 = 0x07;
const GET_SERIAL_NUMBER: u16 = 0x09;
const WRITE_CORRECTION_LINE: u16 = 0x10;
const RESET_LIST: u16 = 0x12;
const WRITE_CORRECTION_TABLE: u16 = 0x15;
const SET_CONTROL_MODE: u16 = 0x16;
const SET_DELAY_MODE: u16 = 0x17;
const SET_END_OF_LIST: u16 = 0x19;
const SET_FIRST_PULSE_KILLER: u16 = 0x1A;
const SET_LASER_MODE: u16 = 0x1B;
const SET_TIMING: u16 = 0x1C;
const SET_STANDBY: u16 = 0x1D;
const SET_PWM_HALF_PERIOD: u16 = 0x1E;
const STOP_EXECUTE: u16 = 0x1F;
const WRITE_PORT: u16 = 0x21;
const WRITE_ANALOG_PORT_1: u16 = 0x22;
const SET_FIRST_PULSE_KILLER_2: u16 = 0x2E;
const SET_FLY_RESOLUTION: u16 = 0x32;
const SET_OSCILLATOR: u16 = 0x33;
const ENABLE_Z: u16 = 0x3A;
const RESET: u16 = 0x40;
const GET_MARK_TIME: u16 = 0x41;

/// Bits of the status.
const BUSY: u16 = 0x04;
const READY: u16 = 0x20;

/// Bits of the output port: laser enable and pilot laser.
const ENABLE: u16 = 1 << 0;
const PILOT: u16 = 1 << 8;

/// The list is started after so many packets.
const PACKETS_AHEAD: usize = 3;

/// Largest list of a block.
const MAX_LIST: u64 = 1 << 30;

/// So many requests in a row must find it idle.
const IDLE_POLLS: usize = 3;

const POLL: Duration = Duration::from_millis(2);

/// How long the driver waits.
#[derive(Clone, Copy, Debug)]
struct Timeouts {
    /// Until the card is busy after its start.
    begin: Duration,
    /// Until it is idle after an abort.
    stop: Duration,
    /// After it was set up.
    settle: Duration,
}

const TIMEOUTS: Timeouts =
    Timeouts { begin: Duration::from_secs(1), stop: Duration::from_secs(2), settle: Duration::from_millis(50) };

/// The two pipes of a card: USB, or a stand-in in tests.
trait Transport {
    /// Writes a command of 12 bytes or a packet of 3072.
    fn write(&mut self, packet: &[u8]) -> std::io::Result<()>;

    /// Reads the answer to a command.
    fn read(&mut self) -> std::io::Result<[u8; 8]>;
}

/// A BJJCZ (LMC) card.
pub struct Lmc {
    serial: Option<String>,
    correction: Option<PathBuf>,
    laser: LmcLaser,
    timeouts: Timeouts,
    transport: Option<Box<dyn Transport>>,
    /// Whether the list of the last block was started.
    was_started: bool,
}

impl Lmc {
    /// The card with this serial number of its USB device, or the only one; `correction` is the field correction that
    /// it is given (.cor), none where it is None; `laser` what it drives, as in the machine file. [`Laser::open`]
    /// connects.
    pub fn new(serial: Option<String>, correction: Option<PathBuf>, laser: LmcLaser) -> Self {
        Self { serial, correction, laser, timeouts: TIMEOUTS, transport: None, was_started: false }
    }

    fn write(&mut self, packet: &[u8]) -> Result<(), Diag> {
        let transport = self.transport.as_mut();
        let transport = transport.ok_or_else(|| Diag::bug("lmc-closed", "the card was used before it was opened"))?;
        transport.write(packet).map_err(|e| broken(&e))
    }

    /// Sends a command without an answer.
    fn send(&mut self, command: u16, values: &[u16]) -> Result<(), Diag> {
        let mut words = [0; 6];
        words[0] = command;
        words[1..=values.len()].copy_from_slice(values);
        let bytes: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
        self.write(&bytes)
    }

    /// Sends a command; the four words of its answer.
    fn command(&mut self, command: u16, values: &[u16]) -> Result<[u16; 4], Diag> {
        self.send(command, values)?;
        let transport = self.transport.as_mut().expect("it was written to");
        let answer = transport.read().map_err(|e| broken(&e))?;
        Ok([0, 1, 2, 3].map(|k| u16::from_le_bytes([answer[2 * k], answer[2 * k + 1]])))
    }

    fn status(&mut self) -> Result<u16, Diag> {
        Ok(self.command(GET_VERSION, &[])?[3])
    }

    /// The master oscillator of a fibre laser; other lasers have none.
    fn oscillator(&mut self, on: u16) -> Result<(), Diag> {
        if self.laser == LmcLaser::Fiber {
            self.command(SET_OSCILLATOR, &[on])?;
        }
        Ok(())
    }

    /// Resets the card and sets what it keeps for all lists.
    fn set_up(&mut self, interrupt: &Interrupt) -> Result<(), Diag> {
        let table = self.correction.as_deref().map(correction::read).transpose()?;
        self.command(RESET, &[])?;
        self.command(WRITE_CORRECTION_TABLE, &[table.is_some().into()])?;
        for (i, [dx, dy]) in table.iter().flatten().enumerate() {
            self.send(WRITE_CORRECTION_LINE, &[*dx, *dy, u16::from(i > 0)])?;
        }
        self.command(ENABLE_LASER, &[])?;
        self.command(SET_CONTROL_MODE, &[0])?;
        self.command(SET_LASER_MODE, &[1])?;
        self.command(SET_DELAY_MODE, &[1])?;
        self.command(SET_TIMING, &[1])?;
        self.command(SET_STANDBY, &[2000, 20])?;
        self.command(SET_FIRST_PULSE_KILLER, &[200])?;
        self.command(SET_PWM_HALF_PERIOD, &[125])?;
        self.command(SET_PWM_PULSE_WIDTH, &[125])?;
        self.oscillator(0)?;
        self.command(SET_FIRST_PULSE_KILLER_2, &[0xFFB, 1, 409, 100])?;
        self.command(SET_FLY_RESOLUTION, &[0, 99, 1000, 25])?;
        self.command(ENABLE_Z, &[])?;
        self.command(WRITE_ANALOG_PORT_1, &[0x7FF])?;
        self.command(ENABLE_Z, &[])?;
        interrupt.wait(self.timeouts.settle)
    }

    fn execute(&mut self) -> Result<(), Diag> {
        self.was_started = true;
        self.command(EXECUTE_LIST, &[]).map(|_| ())
    }

    /// Sends the packets of a list and starts it; whether the card was seen busy.
    fn send_list(&mut self, list: &List, until: Instant, interrupt: &Interrupt) -> Result<bool, Diag> {
        let mut was_busy = false;
        for (i, packet) in list.packets().enumerate() {
            loop {
                let status = self.status()?;
                was_busy |= self.was_started && status & BUSY != 0;
                if status & READY != 0 {
                    break;
                }
                pause(until, interrupt)?;
            }
            self.write(packet)?;
            self.command(SET_END_OF_LIST, &[0])?;
            if i + 1 == PACKETS_AHEAD {
                self.execute()?;
            }
        }
        if !self.was_started {
            self.execute()?;
        }
        Ok(was_busy)
    }

    /// Runs a list from beginning to end.
    fn run(&mut self, list: &List, beam: Beam, longest: Duration, interrupt: &Interrupt) -> Result<(), Diag> {
        let until = Instant::now() + longest;
        self.was_started = false;
        self.command(RESET_LIST, &[])?;
        if beam == Beam::Fire {
            self.command(WRITE_PORT, &[ENABLE])?;
            self.oscillator(1)?;
        }
        let mut was_busy = self.send_list(list, until, interrupt)?;
        let begin = Instant::now();
        let mut idle = 0;
        loop {
            if self.status()? & BUSY != 0 {
                (was_busy, idle) = (true, 0);
            } else if was_busy {
                idle += 1;
            } else if begin.elapsed() > self.timeouts.begin {
                return Err(Diag::limit("lmc-unseen", "the card was not seen busy after the start of its list"));
            }
            if idle == IDLE_POLLS {
                break;
            }
            pause(until, interrupt)?;
        }
        self.oscillator(0)?;
        self.command(WRITE_PORT, &[if beam == Beam::Pilot { PILOT } else { 0 }])?;
        self.command(GET_MARK_TIME, &[3])?;
        if beam == Beam::Pilot {
            self.command(WRITE_PORT, &[0])?;
        }
        Ok(())
    }

    /// Stops the list that the card executes, if it does, and switches laser and output port off.
    fn switch_off(&mut self) -> Result<(), Diag> {
        if self.status()? & BUSY != 0 {
            return self.abort();
        }
        self.oscillator(0)?;
        self.command(WRITE_PORT, &[0]).map(|_| ())
    }

    /// Stops a list, empties the list buffer and switches all off.
    fn abort(&mut self) -> Result<(), Diag> {
        self.command(STOP_EXECUTE, &[])?;
        self.oscillator(0)?;
        self.command(RESET_LIST, &[])?;
        let until = Instant::now() + self.timeouts.stop;
        while self.status()? & READY == 0 && Instant::now() < until {
            std::thread::sleep(POLL);
        }
        // An empty list takes the place of the one that was stopped.
        for packet in List::empty().packets() {
            self.write(packet)?;
        }
        self.command(SET_END_OF_LIST, &[0])?;
        self.command(EXECUTE_LIST, &[])?;
        self.oscillator(0)?;
        self.command(WRITE_PORT, &[0])?;
        while self.status()? & BUSY != 0 {
            if Instant::now() >= until {
                return Err(Diag::limit("lmc-off", "the card is still busy after it was stopped"));
            }
            std::thread::sleep(POLL);
        }
        Ok(())
    }

    /// A fault of a block, with what is certain after the card was stopped.
    fn stopped(&mut self, mut fault: Diag, block: &str) -> Diag {
        let end = match self.abort() {
            Ok(()) => "the card was stopped and its laser is off".to_owned(),
            Err(e) => {
                fault.hint = "switch the laser off at the machine, then look at the part".into();
                format!("the card could not be stopped ({}): the beam may be on until its list ends", e.message)
            }
        };
        fault.message = format!(
            "{}; {end}; {}",
            fault.message,
            match self.was_started {
                true => format!("whether block {block} is marked, in part or not at all, is not certain"),
                false => format!("block {block} is not marked"),
            }
        );
        if fault.hint.is_empty() {
            fault.hint = "look at the part, and decide whether the block is marked again".into();
        }
        fault
    }
}

impl Laser for Lmc {
    fn format(&self) -> Option<&'static str> {
        Some("lmc")
    }

    fn has_pilot(&self) -> bool {
        true
    }

    fn open(&mut self, interrupt: &Interrupt) -> Result<String, Diag> {
        if self.transport.is_none() {
            self.transport = Some(Box::new(usb::Usb::open(self.serial.as_deref())?));
        }
        let serial = self.command(GET_SERIAL_NUMBER, &[])?;
        let version = self.command(GET_VERSION, &[])?;
        if version[3] & BUSY != 0 {
            return Err(Diag::input("lmc-busy", "the card still executes a list")
                .hint("wait for its end, or switch the laser off; then start the run again"));
        }
        self.set_up(interrupt)?;
        let hex = |words: [u16; 4]| words.map(|word| format!("{word:04x}")).join(" ");
        Ok(format!("BJJCZ card, serial number {}, version {}", hex(serial), hex(version)))
    }

    fn mark(&mut self, work: &Work, beam: Beam, _stage: &mut dyn Stage, interrupt: &Interrupt) -> Result<(), Diag> {
        let file = work.file.as_deref().ok_or_else(|| {
            Diag::bug("lmc-file", format!("block {} was handed to the card without its list", work.block))
        })?;
        let bytes = diag::read_file(file, MAX_LIST).map_err(|e| e.diags()[0].clone())?;
        let list = List::read(&bytes, file)?;
        let (list, longest) = match beam {
            Beam::Fire => (list, work.longest()),
            Beam::Pilot => list.pilot(),
        };
        if interrupt.is_abort() {
            return Err(aborted());
        }
        self.run(&list, beam, longest, interrupt).map_err(|fault| self.stopped(fault, &work.block))
    }

    fn off(&mut self) -> Result<(), Diag> {
        if self.transport.is_none() {
            return Ok(());
        }
        self.switch_off().map_err(|e| {
            let text = format!("the card could not be switched off: {}; the beam may be on", e.message);
            Diag::limit("lmc-off", text).hint("switch the laser off at the machine")
        })
    }
}

/// Waits for the next request, until the time is over or the run is aborted.
fn pause(until: Instant, interrupt: &Interrupt) -> Result<(), Diag> {
    if interrupt.is_abort() {
        return Err(aborted());
    }
    if Instant::now() >= until {
        return Err(Diag::limit("lmc-time", "the card has not ended its list in time"));
    }
    std::thread::sleep(POLL);
    Ok(())
}

fn aborted() -> Diag {
    Diag::limit("lmc-aborted", "the run was aborted")
}

fn broken(e: &std::io::Error) -> Diag {
    Diag::limit("lmc-link", format!("the USB connection to the card failed: {e}"))
}

#[cfg(test)]
mod tests;
