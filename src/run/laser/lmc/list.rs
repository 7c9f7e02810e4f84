//! Lists of commands, as they are sent to the card in packets.

use std::path::Path;
use std::time::Duration;

use terrace_core::diag::{Diag, Place};

const JUMP_TO: u16 = 0x8001;
const END_OF_LIST: u16 = 0x8002;
const DELAY_TIME: u16 = 0x8004;
const MARK_TO: u16 = 0x8005;
const JUMP_SPEED: u16 = 0x8006;
const MARK_SPEED: u16 = 0x800C;
const JUMP_DELAY: u16 = 0x800D;
const WRITE_PORT: u16 = 0x8011;
const READY_MARK: u16 = 0x8051;

/// Commands of motion and of the list itself.
const OF_MOTION: [u16; 8] = [JUMP_TO, END_OF_LIST, DELAY_TIME, MARK_TO, JUMP_SPEED, MARK_SPEED, JUMP_DELAY, READY_MARK];

/// Other commands that set something of the laser: delays of laser and polygon, periods and power.
const OF_THE_LASER: [u16; 7] = [0x8007, 0x8008, 0x800A, 0x800B, 0x800F, 0x8012, 0x801B];

/// Bytes of a packet and commands in it.
pub(super) const PACKET: usize = 3072;
const COMMANDS: usize = 256;

/// A command and its five values.
type Words = [u16; 6];

/// A list whose commands are all known; a whole number of packets.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct List(Vec<u8>);

impl List {
    /// The list of a block, as terrace writes it.
    pub(super) fn read(bytes: &[u8], file: &Path) -> Result<Self, Diag> {
        if bytes.is_empty() || !bytes.len().is_multiple_of(PACKET) {
            return Err(fault(file, "the list is not a whole number of packets of 3072 bytes"));
        }
        let list = Self(bytes.to_vec());
        if list.commands().next().map(|words| words[0]) != Some(READY_MARK) {
            return Err(fault(file, "the list does not begin with ReadyMark (8051)"));
        }
        if list.commands().last().map(|words| words[0]) != Some(END_OF_LIST) {
            return Err(fault(file, "the list has no end (8002)"));
        }
        if let Some([command, value, ..]) = list.commands().find(|words| !is_written(words)) {
            let text = format!("the list holds {command:04x} {value:04x}, which terrace does not write");
            return Err(fault(file, &text));
        }
        Ok(list)
    }

    /// The commands with ends behind them, up to a whole number of packets.
    fn from_commands(commands: &[Words]) -> Self {
        let mut bytes: Vec<u8> = commands.iter().flatten().flat_map(|word| word.to_le_bytes()).collect();
        let end = [END_OF_LIST, 0, 0, 0, 0, 0].iter().flat_map(|word| word.to_le_bytes()).collect::<Vec<_>>();
        let count = commands.len() / COMMANDS + 1;
        while bytes.len() < count * PACKET {
            bytes.extend_from_slice(&end);
        }
        Self(bytes)
    }

    /// A packet that holds nothing but ends.
    pub(super) fn empty() -> Self {
        Self::from_commands(&[])
    }

    pub(super) fn packets(&self) -> impl Iterator<Item = &[u8]> {
        self.0.chunks_exact(PACKET)
    }

    fn commands(&self) -> impl Iterator<Item = Words> {
        self.0
            .chunks_exact(12)
            .map(|bytes| [0, 1, 2, 3, 4, 5].map(|k| u16::from_le_bytes([bytes[2 * k], bytes[2 * k + 1]])))
    }

    /// The list with the pilot laser, and the longest time to wait for its end: the same points, all jumps at the speed
    /// of the marks. Nothing of the laser is in it.
    pub(super) fn pilot(&self) -> (Self, Duration) {
        let mut commands = Vec::new();
        // On the optical axis.
        let mut at = [0x8000; 2];
        let mut units_ms = 1.0;
        let mut ms = 0.0;
        for words in self.commands() {
            match words[0] {
                READY_MARK | JUMP_DELAY => commands.push(words),
                WRITE_PORT => commands.push([WRITE_PORT, super::PILOT, 0, 0, 0, 0]),
                MARK_SPEED => {
                    units_ms = f64::from(words[1]).max(1.0);
                    commands.push([JUMP_SPEED, words[1], 0, 0, 0, 0]);
                }
                JUMP_TO | MARK_TO if [words[1], words[2]] != at => {
                    at = [words[1], words[2]];
                    // Beside the way, each jump has a delay of at most 65.5 ms.
                    ms += f64::from(words[4]) / units_ms + 65.5;
                    commands.push([JUMP_TO, words[1], words[2], words[3], words[4], 0]);
                }
                _ => {}
            }
        }
        // Twice the time and 10 s more, as for blocks.
        let longest = Duration::from_secs_f64(2e-3 * ms) + Duration::from_secs(10);
        (Self::from_commands(&commands), longest)
    }
}

/// Whether terrace writes such a command.
fn is_written(words: &Words) -> bool {
    match words[0] {
        WRITE_PORT => words[1] == super::ENABLE,
        command => OF_MOTION.contains(&command) || OF_THE_LASER.contains(&command),
    }
}

/// What is wrong with the list of a block.
fn fault(file: &Path, text: &str) -> Diag {
    let place = Place::file(file.display().to_string());
    Diag::input("lmc-list", text).at(place).hint("compile the job again; do not change its files")
}
