//! LightBurn, by the commands that it takes over UDP.
//!
//! LightBurn listens on port 19840 and answers to port 19841 of the sender: `OK`, `!` for a command that failed and for
//! a STATUS while it marks, `?` for a command that it does not know. Each block is loaded (FORCELOAD), started (START)
//! and polled (STATUS) until LightBurn is idle again. A block counts as marked where LightBurn was seen busy after
//! START and idle after that; where it was never seen busy nobody can say whether it marked anything.
//!
//! Answers do not name their command; they can come late, twice, or from somebody else. The rule, which holds for every
//! driver over a link without order or identity: no single answer ends anything. `SURPLUS` of them may be others',
//! beside those that are missing:
//!
//! - a state is believed when more answers in a row say so, and the beginning of a block when more say so in all;
//! - a load is believed when so many more commands were answered after it, all with `OK`, and then nothing else comes for
//!   `SPREAD`: LightBurn answers in its order, so the answer that another was taken for is one of these;
//! - a block has ended when LightBurn has said so `ENDED` times in a row over `SPREAD`, not before half of the estimate,
//!   and then nothing else comes for as long again.
//!
//! START is never repeated; load and START are sent when no late answer can come any more. Where the stage is to leave,
//! or a block to begin, and LightBurn is busy all the same, the block that had ended is in doubt again.
//!
//! LightBurn has no command that stops it: an abort leaves it marking, and the message says so.
//!
//! Ports: "Automation With UDP Commands" of LightBurn's documentation; commands and answers: programs for it, such as
//! ioBroker.lightburn and lightburn_udp. Not tried with LightBurn itself.

use std::collections::VecDeque;
use std::io::ErrorKind;
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr, ToSocketAddrs, UdpSocket};
use std::path::Path;
use std::time::{Duration, Instant};

use super::super::Interrupt;
use super::super::stage::Stage;
use super::{Beam, Laser, Work};
use terrace_core::diag::Diag;

/// LightBurn's port for commands, and the port that it answers to.
pub(crate) const PORTS: [u16; 2] = [19840, 19841];

/// Time between two requests for status.
const POLL: Duration = Duration::from_millis(10);

/// The longest time until an abort is seen.
const SLICE: Duration = Duration::from_millis(100);

/// So many answers may be surplus, doubled or another's where something is decided.
const SURPLUS: usize = 3;

/// How often in a row LightBurn must say that it is idle where a block has ended.
const ENDED: usize = SURPLUS + 2;

/// Most answers that are dropped before a request: more come from somebody who does not stop.
const MOST_DROPPED: usize = 1000;

/// How far answers to one command may come apart, and the least time over which it must say so.
const SPREAD: Duration = Duration::from_millis(250);

/// Requests that may be repeated are sent so often.
const TRIES: usize = 3;

/// How long the driver waits.
#[derive(Clone, Copy, Debug)]
struct Timeouts {
    /// For an answer, until the request counts as lost.
    answer: Duration,
    /// For the answer to a load, each time.
    load: Duration,
    /// Without any answer, until the link counts as broken; less than the wait for it to begin.
    silence: Duration,
    /// Until it is busy after START, as the stage programs wait for BUSY.
    begin: Duration,
    /// Until answers agree on a state.
    agree: Duration,
}

const TIMEOUTS: Timeouts = Timeouts {
    answer: Duration::from_millis(500),
    load: Duration::from_secs(20),
    silence: Duration::from_secs(3),
    begin: Duration::from_secs(5),
    agree: Duration::from_secs(10),
};

/// An answer of LightBurn.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Answer {
    /// Done, or idle.
    Ok,
    /// Failed, or busy.
    No,
    /// Anything else.
    Other(String),
}

/// The socket to LightBurn.
struct Link {
    socket: UdpSocket,
    to: SocketAddr,
    /// When requests were sent that have no answer yet: so many answers may still come late.
    unanswered: VecDeque<Instant>,
    /// After this time an answer does not come any more.
    silence: Duration,
    /// Whether an answer has come that no request explains.
    surplus: bool,
}

impl Link {
    /// Answers that may still come late.
    fn missing(&mut self) -> usize {
        self.unanswered.retain(|sent| sent.elapsed() <= self.silence);
        self.unanswered.len()
    }

    /// One answer within a time; None where none comes.
    fn receive(&mut self, longest: Duration) -> Result<Option<Answer>, Diag> {
        let until = Instant::now() + longest;
        let mut buffer = [0; 512];
        loop {
            let left = until.saturating_duration_since(Instant::now()).max(Duration::from_micros(1));
            self.socket.set_read_timeout(Some(left)).map_err(|e| broken(&e))?;
            match self.socket.recv_from(&mut buffer) {
                Ok((count, from)) if from.ip() == self.to.ip() => {
                    // Whichever request it belongs to: the younger ones stay.
                    self.surplus |= self.unanswered.pop_front().is_none();
                    let text = String::from_utf8_lossy(&buffer[..count]);
                    return Ok(Some(match text.trim_matches(|c: char| c.is_whitespace() || c == '\0') {
                        "OK" => Answer::Ok,
                        "!" => Answer::No,
                        other => Answer::Other(other.into()),
                    }));
                }
                Ok(_) => {}
                // Windows reports that nobody listens as a reset of the connection.
                Err(e) if matches!(e.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => return Ok(None),
                Err(e) if matches!(e.kind(), ErrorKind::Interrupted | ErrorKind::ConnectionReset) => {}
                Err(e) => return Err(broken(&e)),
            }
            if Instant::now() >= until {
                return Ok(None);
            }
        }
    }

    /// Waits until no late answer can come any more: it would be taken for that to the next command.
    fn quiet(&mut self, interrupt: &Interrupt) -> Result<(), Diag> {
        while self.missing() > 0 {
            if interrupt.is_abort() {
                return Err(aborted());
            }
            self.receive(SLICE)?;
        }
        Ok(())
    }

    /// Listens for so long; whether nothing came.
    fn stays_silent(&mut self, time: Duration, interrupt: &Interrupt) -> Result<bool, Diag> {
        let until = Instant::now() + time;
        let mut is_quiet = true;
        loop {
            if interrupt.is_abort() {
                return Err(aborted());
            }
            let left = until.saturating_duration_since(Instant::now());
            if left.is_zero() {
                self.surplus = false;
                return Ok(is_quiet);
            }
            is_quiet &= self.receive(left.min(SLICE))?.is_none();
        }
    }

    /// Listens until no late answer can come any more, and for [`SPREAD`] at least; whether nothing came.
    fn is_quiet(&mut self, interrupt: &Interrupt) -> Result<bool, Diag> {
        while self.missing() > 0 {
            if !self.stays_silent(SLICE, interrupt)? {
                return Ok(false);
            }
        }
        self.stays_silent(SPREAD, interrupt)
    }

    /// Sends a command once and returns the next answer, whatever request it belongs to; None where none comes within
    /// `longest`. Answers that waited already are dropped.
    fn request(&mut self, command: &str, longest: Duration, interrupt: &Interrupt) -> Result<Option<Answer>, Diag> {
        for _ in 0..MOST_DROPPED {
            if self.receive(Duration::ZERO)?.is_none() {
                break;
            }
        }
        let begin = Instant::now();
        self.unanswered.push_back(begin);
        self.socket.send_to(command.as_bytes(), self.to).map_err(|e| broken(&e))?;
        loop {
            let left = longest.saturating_sub(begin.elapsed());
            match self.receive(left.min(SLICE))? {
                None if interrupt.is_abort() => return Err(aborted()),
                None if left > SLICE => {}
                answer => return Ok(answer),
            }
        }
    }

    /// Sends a command, again where no answer comes: for commands that may be done twice.
    fn repeat(&mut self, command: &str, longest: Duration, interrupt: &Interrupt) -> Result<Option<Answer>, Diag> {
        for _ in 0..TRIES {
            if let Some(answer) = self.request(command, longest, interrupt)? {
                return Ok(Some(answer));
            }
        }
        Ok(None)
    }
}

/// LightBurn on this or another computer.
pub struct LightBurn {
    host: String,
    folder: Option<String>,
    ports: [u16; 2],
    timeouts: Timeouts,
    link: Option<Link>,
}

impl LightBurn {
    /// LightBurn at a host, localhost where it is None. `folder` is the job folder as that computer sees it, where that
    /// is another path; `port` takes the commands and `answers` receives the answers, 19840 and 19841 where they are
    /// None. [`Laser::open`] connects.
    pub fn new(host: Option<String>, folder: Option<String>, port: Option<u16>, answers: Option<u16>) -> Self {
        let ports = [port.unwrap_or(PORTS[0]), answers.unwrap_or(PORTS[1])];
        Self { host: host.unwrap_or_else(|| "localhost".into()), folder, ports, timeouts: TIMEOUTS, link: None }
    }

    fn link(&mut self) -> Result<&mut Link, Diag> {
        self.link.as_mut().ok_or_else(|| Diag::bug("lightburn-closed", "LightBurn was used before it was opened"))
    }

    /// Whether LightBurn is idle or busy now.
    fn state(&mut self, interrupt: &Interrupt) -> Result<Answer, Diag> {
        let Timeouts { answer, silence, agree, .. } = self.timeouts;
        let link = self.link()?;
        // An answer that is late or another's reports a state of the past: of so many answers one must be a new one.
        let mut needed = link.missing() + SURPLUS + 1;
        let mut seen = 0;
        let mut last = None;
        let begin = Instant::now();
        let mut heard = begin;
        loop {
            if begin.elapsed() > agree {
                let text = format!("LightBurn's answers contradict each other for {} s", agree.as_secs_f64());
                return Err(
                    Diag::limit("lightburn-answer", text).hint("does another program ask it, or answer for it?")
                );
            }
            match link.request("STATUS", answer, interrupt)? {
                Some(Answer::Other(text)) => return Err(unknown("STATUS", &text)),
                Some(state) => {
                    heard = Instant::now();
                    if last.as_ref().is_some_and(|last| *last != state) {
                        (needed, seen) = (link.missing() + SURPLUS + 1, 0);
                    }
                    seen += 1;
                    if seen >= needed {
                        return Ok(state);
                    }
                    last = Some(state);
                }
                None if heard.elapsed() > silence => return Err(silent(silence)),
                None => {}
            }
            std::thread::sleep(POLL);
        }
    }

    /// Polls until more answers than can be others' say that it is busy; whether they have in time.
    fn wait_for_begin(&mut self, interrupt: &Interrupt) -> Result<bool, Diag> {
        let Timeouts { answer, silence, begin: longest, .. } = self.timeouts;
        let link = self.link()?;
        let begin = Instant::now();
        let mut heard = Instant::now();
        let mut busy = 0;
        while begin.elapsed() <= longest {
            match link.request("STATUS", answer, interrupt)? {
                Some(Answer::Other(text)) => return Err(unknown("STATUS", &text)),
                Some(state) => {
                    heard = Instant::now();
                    busy += usize::from(state == Answer::No);
                    if busy > SURPLUS {
                        return Ok(true);
                    }
                }
                None if heard.elapsed() > silence => return Err(silent(silence)),
                None => {}
            }
            std::thread::sleep(POLL);
        }
        Ok(false)
    }

    /// Polls until a block has ended; whether it has in time.
    fn wait_for_end(&mut self, work: &Work, interrupt: &Interrupt) -> Result<bool, Diag> {
        let Timeouts { answer, silence, .. } = self.timeouts;
        let begin = Instant::now();
        let earliest = work.estimate / 2;
        let longest = work.longest();
        let mut idle = 0;
        let mut since = begin;
        let mut heard = begin;
        loop {
            if interrupt.is_abort() {
                return Err(aborted());
            }
            if begin.elapsed() > longest {
                return Ok(false);
            }
            let link = self.link()?;
            match link.request("STATUS", answer, interrupt)? {
                Some(Answer::Other(text)) => return Err(unknown("STATUS", &text)),
                Some(state) => {
                    heard = Instant::now();
                    since = if idle == 0 { heard } else { since };
                    idle = if state == Answer::Ok { idle + 1 } else { 0 };
                }
                None if heard.elapsed() > silence => return Err(silent(silence)),
                // It was lost, or is late: then it is awaited before the end.
                None => {}
            }
            if std::mem::take(&mut link.surplus) {
                // One of those that were counted may have been it.
                link.stays_silent(SPREAD, interrupt)?;
                (idle, heard) = (0, Instant::now());
            }
            if idle >= ENDED && since.elapsed() >= SPREAD && begin.elapsed() >= earliest {
                if link.is_quiet(interrupt)? {
                    return Ok(true);
                }
                (idle, heard) = (0, Instant::now());
            }
            std::thread::sleep(POLL);
        }
    }

    /// Loads the file of a block. Nothing is marked by that.
    fn load(&mut self, work: &Work, interrupt: &Interrupt) -> Result<(), Diag> {
        let file = work.file.as_deref().ok_or_else(|| {
            Diag::bug("lightburn-file", format!("block {} was handed to LightBurn without its file", work.block))
        })?;
        let path = self.path_there(file);
        let longest = self.timeouts.load;
        let mut was_answered = false;
        for _ in 0..TRIES {
            match self.is_loaded(&format!("FORCELOAD:{path}"), interrupt)? {
                Some(true) => return Ok(()),
                Some(false) => was_answered = true,
                None => {}
            }
        }
        if !was_answered {
            return Err(silent(longest * TRIES as u32));
        }
        let text = format!("LightBurn cannot load {path}; block {} is not marked", work.block);
        let hint = "does LightBurn's computer see this path? If not, state laser.folder in the run file";
        Err(Diag::limit("lightburn-load", text).hint(hint))
    }

    /// Loads once; whether that was done for certain, None where there is no answer.
    fn is_loaded(&mut self, load: &str, interrupt: &Interrupt) -> Result<Option<bool>, Diag> {
        let Timeouts { load: longest, answer, silence, .. } = self.timeouts;
        let link = self.link()?;
        link.quiet(interrupt)?;
        match link.request(load, longest, interrupt)? {
            Some(Answer::Ok) => {}
            Some(Answer::No) => return Ok(Some(false)),
            Some(Answer::Other(text)) => return Err(unknown("FORCELOAD", &text)),
            None => return Ok(None),
        }
        let mut after = 0;
        let mut heard = Instant::now();
        while after < SURPLUS {
            match link.request("STATUS", answer, interrupt)? {
                Some(Answer::Ok) => (after, heard) = (after + 1, Instant::now()),
                Some(Answer::No) => return Ok(Some(false)),
                Some(Answer::Other(text)) => return Err(unknown("STATUS", &text)),
                None if heard.elapsed() > silence => return Ok(None),
                None => {}
            }
        }
        Ok(Some(link.is_quiet(interrupt)?))
    }

    /// A file of the job folder as LightBurn's computer sees it.
    fn path_there(&self, file: &Path) -> String {
        let Some(folder) = &self.folder else {
            return std::path::absolute(file).unwrap_or_else(|_| file.to_owned()).display().to_string();
        };
        let separator = if folder.contains('\\') || folder.get(1..2) == Some(":") { '\\' } else { '/' };
        // Files of blocks lie in a folder of the job folder.
        let inner: Vec<_> = file.iter().rev().take(2).map(|part| part.to_string_lossy()).collect();
        let mut path = folder.trim_end_matches(['/', '\\']).to_owned();
        for part in inner.iter().rev() {
            path.push(separator);
            path.push_str(part);
        }
        path
    }

    /// Starts the loaded block and waits until it has ended.
    fn start(&mut self, work: &Work, interrupt: &Interrupt) -> Result<(), Diag> {
        let Timeouts { answer, begin, .. } = self.timeouts;
        let block = &work.block;
        self.link()?.quiet(interrupt)?;
        let start_answer = self.link()?.request("START", answer, interrupt)?;
        if let Some(Answer::Other(text)) = &start_answer {
            return Err(unknown("START", text));
        }
        // The answer may be lost or another's, so only the state counts. START is sent once: a second one would mark the
        // block twice.
        if !self.wait_for_begin(interrupt)? {
            if start_answer == Some(Answer::No) {
                let text = format!("LightBurn refused START: block {block} is not marked");
                return Err(Diag::limit("lightburn-start", text).hint("is the laser connected and ready in LightBurn?"));
            }
            let text = format!(
                "LightBurn was not seen marking within {} s after START: whether block {block} is marked is not certain",
                begin.as_secs_f64()
            );
            return Err(Diag::limit("lightburn-unseen", text)
                .hint("look at the part; see LightBurn in docs/how-to/operating.md"));
        }
        if !self.wait_for_end(work, interrupt)? {
            let text = format!("LightBurn still marks block {block} after {} s", work.longest().as_secs());
            return Err(Diag::limit("lightburn-time", text));
        }
        Ok(())
    }

    /// Opens the socket to LightBurn's computer.
    fn connect(&self, interrupt: &Interrupt) -> Result<Link, Diag> {
        let [port, answers] = self.ports;
        let host = self.host.clone();
        let addresses =
            interrupt.wait_for(move || (host.as_str(), port).to_socket_addrs().map(Iterator::collect::<Vec<_>>))?;
        let to = addresses.ok().and_then(|all| all.iter().find(|a| a.is_ipv4()).or(all.first()).copied());
        let to = to.ok_or_else(|| {
            Diag::input("lightburn-address", format!("there is no host {:?}", self.host))
                .hint("check laser.address of the run file")
        })?;
        let here: IpAddr = match to.ip() {
            ip if ip.is_loopback() => ip,
            IpAddr::V4(_) => Ipv4Addr::UNSPECIFIED.into(),
            IpAddr::V6(_) => Ipv6Addr::UNSPECIFIED.into(),
        };
        let socket = UdpSocket::bind((here, answers)).map_err(|e| {
            Diag::input("lightburn-port", format!("the port {answers} for LightBurn's answers cannot be used: {e}"))
                .hint("end the other program that talks to LightBurn")
        })?;
        Ok(Link { socket, to, unanswered: VecDeque::new(), silence: self.timeouts.silence, surplus: false })
    }
}

impl Laser for LightBurn {
    fn format(&self) -> Option<&'static str> {
        Some("lightburn")
    }

    fn has_pilot(&self) -> bool {
        // Its framing is started by hand.
        false
    }

    fn open(&mut self, interrupt: &Interrupt) -> Result<String, Diag> {
        let mut link = self.connect(interrupt)?;
        let to = link.to;
        match link.repeat("PING", self.timeouts.answer, interrupt)? {
            Some(Answer::Ok) => {}
            Some(Answer::No) => return Err(unknown("PING", "!")),
            Some(Answer::Other(text)) => return Err(unknown("PING", &text)),
            None => {
                return Err(Diag::input("lightburn-answer", format!("LightBurn does not answer at {to}"))
                    .hint("start LightBurn there; check laser.address, and that no firewall blocks UDP"));
            }
        }
        self.link = Some(link);
        if self.state(interrupt)? != Answer::Ok {
            return Err(Diag::input("lightburn-busy", "LightBurn is marking").hint("wait for its end or stop it there"));
        }
        Ok(format!("LightBurn at {to}, idle"))
    }

    fn is_free(&mut self, interrupt: &Interrupt) -> Result<bool, Diag> {
        Ok(self.state(interrupt)? == Answer::Ok)
    }

    fn mark(&mut self, work: &Work, beam: Beam, _stage: &mut dyn Stage, interrupt: &Interrupt) -> Result<(), Diag> {
        if beam == Beam::Pilot {
            let text = "LightBurn cannot be asked over UDP to show a block with the pilot laser";
            return Err(Diag::input("lightburn-pilot", text).hint("frame it by hand in LightBurn"));
        }
        if self.state(interrupt)? != Answer::Ok {
            let text = format!("LightBurn is marking something else; block {} is not marked", work.block);
            return Err(Diag::limit("lightburn-busy", text).hint("nothing else may start it during a run"));
        }
        self.load(work, interrupt)?;
        self.start(work, interrupt).map_err(|mut fault| {
            if ["lightburn-aborted", "lightburn-answer", "lightburn-link"].contains(&fault.code) {
                let block = &work.block;
                fault.message = format!("{}; whether block {block} is marked is not certain", fault.message);
            }
            if fault.code != "lightburn-start" && fault.code != "lightburn-unseen" {
                fault.message += "; the beam may be on: LightBurn has no command over UDP that stops it";
                fault.hint = "stop it in LightBurn or at the machine, and look at the part".into();
            }
            fault
        })
    }

    fn off(&mut self) -> Result<(), Diag> {
        if self.link.is_none() {
            return Ok(());
        }
        let why = match self.state(&Interrupt::default()) {
            Ok(Answer::Ok) => return Ok(()),
            Ok(_) => "LightBurn is still marking, and has no command over UDP that stops it".to_owned(),
            Err(e) => e.message,
        };
        let text = format!("{why}: the beam may be on");
        Err(Diag::limit("lightburn-off", text).hint("stop it in LightBurn or at the machine"))
    }
}

fn silent(longest: Duration) -> Diag {
    Diag::limit("lightburn-answer", format!("LightBurn has not answered for {} s", longest.as_secs_f64()))
        .hint("look at LightBurn: a dialog may be open; check the network")
}

fn unknown(command: &str, answer: &str) -> Diag {
    Diag::limit("lightburn-unknown", format!("LightBurn answers {answer:?} to {command}"))
        .hint("this version of LightBurn may have other commands")
}

fn aborted() -> Diag {
    Diag::limit("lightburn-aborted", "the run was aborted")
}

fn broken(e: &std::io::Error) -> Diag {
    Diag::limit("lightburn-link", format!("the network to LightBurn failed: {e}")).hint("check the network")
}

#[cfg(test)]
mod tests;
