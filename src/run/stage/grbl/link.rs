//! The serial line to GRBL: lines and single bytes out, lines in.

use std::collections::VecDeque;
use std::io::{ErrorKind, Read, Write};
use std::time::{Duration, Instant};

use serialport::{ClearBuffer, SerialPort};

use super::reply::Reply;
use terrace_core::diag::Diag;

/// Bytes that GRBL's receive buffer holds.
const RECEIVE_BUFFER: usize = 127;

/// Longest line that GRBL takes, without its end.
pub(super) const LONGEST_LINE: usize = 79;

/// The longest that one read waits.
const READ: Duration = Duration::from_millis(10);

pub(super) struct Link {
    port: Box<dyn SerialPort>,
    /// Bytes of a line that has not ended.
    rest: Vec<u8>,
    replies: VecDeque<Reply>,
    /// Bytes of the lines that GRBL has not answered, oldest first: they may all be in its receive buffer.
    unanswered: VecDeque<usize>,
}

/// Names of the serial ports of this computer.
///
/// # Errors
/// Why the system does not say.
pub(super) fn ports() -> Result<Vec<String>, String> {
    let mut ports: Vec<String> =
        serialport::available_ports().map_err(|e| e.to_string())?.into_iter().map(|port| port.port_name).collect();
    ports.sort();
    Ok(ports)
}

impl Link {
    /// Opens the port for this process alone.
    pub(super) fn open(name: &str, baud: u32) -> Result<Self, Diag> {
        let port = serialport::new(name, baud).timeout(READ).open().and_then(|port| {
            port.clear(ClearBuffer::Input)?;
            Ok(port)
        });
        let port = port.map_err(|e| {
            Diag::input("grbl-port", format!("the serial port {name} cannot be opened: {e}"))
                .hint("check stage.port of the run file, the cable, and that no other program holds the port")
        })?;
        Ok(Self { port, rest: Vec::new(), replies: VecDeque::new(), unanswered: VecDeque::new() })
    }

    /// Sends a line. Refuses what could overrun GRBL's buffers.
    pub(super) fn send(&mut self, line: &str) -> Result<(), Diag> {
        let size = line.len() + 1;
        if line.len() > LONGEST_LINE || self.unanswered.iter().sum::<usize>() + size > RECEIVE_BUFFER {
            return Err(Diag::bug("grbl-buffer", format!("the line {line:?} does not fit into GRBL's buffers")));
        }
        self.unanswered.push_back(size);
        self.write(format!("{line}\n").as_bytes())
    }

    /// Sends a real-time command, which does not enter the receive buffer.
    pub(super) fn real_time(&mut self, command: u8) -> Result<(), Diag> {
        self.write(&[command])
    }

    /// Whether GRBL has answered all lines.
    pub(super) fn is_answered(&self) -> bool {
        self.unanswered.is_empty()
    }

    /// Forgets unanswered lines: a reset clears them.
    pub(super) fn forget(&mut self) {
        self.unanswered.clear();
    }

    /// The next line of GRBL; None where there is none until then, though bytes without an end may come.
    pub(super) fn next(&mut self, until: Instant) -> Result<Option<Reply>, Diag> {
        loop {
            if let Some(reply) = self.replies.pop_front() {
                match reply {
                    Reply::Ok | Reply::Error(_) => drop(self.unanswered.pop_front()),
                    Reply::Banner => self.forget(),
                    _ => {}
                }
                return Ok(Some(reply));
            }
            self.read()?;
            if self.replies.is_empty() && Instant::now() >= until {
                return Ok(None);
            }
        }
    }

    /// Takes in what has come.
    fn read(&mut self) -> Result<(), Diag> {
        let mut buffer = [0; 256];
        let count = match self.port.read(&mut buffer) {
            Ok(0) => return Err(broken("the port was closed")),
            Ok(count) => count,
            Err(e) if matches!(e.kind(), ErrorKind::TimedOut | ErrorKind::Interrupted) => return Ok(()),
            Err(e) => return Err(broken(&e.to_string())),
        };
        for byte in &buffer[..count] {
            if *byte == b'\n' {
                let line = String::from_utf8_lossy(&self.rest).trim().to_owned();
                if !line.is_empty() {
                    self.replies.push_back(Reply::parse(&line));
                }
                self.rest.clear();
            } else if self.rest.len() < 4096 {
                self.rest.push(*byte);
            }
        }
        Ok(())
    }

    fn write(&mut self, bytes: &[u8]) -> Result<(), Diag> {
        self.port.write_all(bytes).and_then(|()| self.port.flush()).map_err(|e| broken(&e.to_string()))
    }
}

fn broken(why: &str) -> Diag {
    Diag::limit("grbl-link", format!("the serial line to GRBL broke: {why}"))
        .hint("check the cable and the supply of the board; home the stage, then start the run again")
}
