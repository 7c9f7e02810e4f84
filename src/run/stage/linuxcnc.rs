//! LinuxCNC through its network shell, linuxcncrsh: lines of text over TCP.
//!
//! Moves are `G21 G90 G53 G0` in MDI, so they are positions of the machine; work offsets, which the stage programs
//! would follow, must be zero. A move has ended when the commanded position is the target and the actual one is near
//! it.
//!
//! START is digital output 0, BUSY digital input 0. The control runs the whole exchange from its own queue, so START is
//! cleared even where this program ends after it has filled the queue. An MDI command takes 0.1 s to be received: a
//! dwell holds the queue until it is filled. A BUSY of 20 ms is missed at times all the same, one of 50 ms was not. A
//! block has ended when BUSY is low once more after a time in which no contact bounces any more. What
//! the exchange found is read from the F word, which no rapid uses: messages of the control are given to one of its
//! user interfaces only, and that may be another.
//!
//! Found with LinuxCNC 2.9: `get ini` does not answer, so the server's name tells machines apart; digital outputs keep
//! their state in an emergency stop.

use std::io::{BufRead, BufReader, ErrorKind, Write};
use std::net::{TcpStream, ToSocketAddrs};
use std::time::{Duration, Instant};

use super::{Move, Stage};
use crate::run::Interrupt;
use crate::run::settings::LinuxCncKeys;
use terrace_core::diag::Diag;

/// Longest wait for a connection and for the answer to a line.
const ANSWER: Duration = Duration::from_secs(5);

/// Longest line of an answer, bytes, and most lines before it.
const LONGEST_LINE: usize = 4096;
const MOST_LINES: usize = 100;

/// The longest time until an abort is seen.
const SLICE: Duration = Duration::from_millis(100);

/// How long BUSY must stay low where a block has ended: a contact bounces for less.
const BOUNCE: Duration = Duration::from_millis(50);

/// How often the control is asked while it works.
const EVERY: Duration = Duration::from_millis(10);

/// How long the position may stay the same before the target is reached.
const STALLED: Duration = Duration::from_secs(10);

/// How much nearer to its target an axis must come to count as moving, millionths of mm or degrees.
const NEARER: i64 = 1_000;

/// How long BUSY may take to rise after START, as in the stage program.
const RISE: Duration = Duration::from_secs(5);

/// How far an axis may stand from its target where the run file does not say, nm or millionths of a degree.
const TOLERANCE: i64 = 10_000;

/// Axes in the order in which the control lists positions.
const AXES: [char; 6] = ['X', 'Y', 'Z', 'A', 'B', 'C'];

/// The connection to LinuxCNC.
pub struct LinuxCnc {
    keys: LinuxCncKeys,
    tolerance: i64,
    link: Option<Link>,
    /// Whether it was ready once: then it has to be halted at the end.
    was_open: bool,
    /// Whether START may be on.
    is_started: bool,
    /// Number of the last answer through the F word.
    token: u32,
    /// What ends the waits for answers.
    interrupt: Interrupt,
}

impl LinuxCnc {
    /// The driver as the run file describes it; it connects later.
    pub fn new(keys: &LinuxCncKeys) -> Self {
        let tolerance = keys.tolerance.and_then(|t| t.as_nm()).map_or(TOLERANCE, |nm| nm.0);
        let interrupt = Interrupt::default();
        Self { keys: keys.clone(), tolerance, link: None, was_open: false, is_started: false, token: 0, interrupt }
    }

    /// The connection.
    fn link(&mut self) -> Result<&mut Link, Diag> {
        let address = &self.keys.address;
        self.link.as_mut().ok_or_else(|| lost(address, "it is closed"))
    }

    fn get(&mut self, what: &str) -> Result<String, Diag> {
        let interrupt = self.interrupt.clone();
        let found = self.link()?.get(what, &interrupt);
        self.kept(found)
    }

    fn set(&mut self, what: &str) -> Result<(), Diag> {
        let interrupt = self.interrupt.clone();
        let found = self.link()?.set(what, &interrupt);
        let is_taken = self.kept(found)?;
        if is_taken {
            return Ok(());
        }
        // It says why when it is off or has an error; otherwise another client has taken control.
        self.watch()?;
        Err(alarm(format!("LinuxCNC refuses {what:?}: another client of linuxcncrsh may have taken control")))
    }

    /// Gives a line of G-code.
    fn mdi(&mut self, code: &str) -> Result<(), Diag> {
        self.set(&format!("mdi {code}"))
    }

    /// Gives up a link that has failed, or whose answer was not awaited.
    fn kept<T>(&mut self, found: Result<T, String>) -> Result<T, Diag> {
        found.map_err(|why| {
            self.link = None;
            self.interrupt.check().err().unwrap_or_else(|| lost(&self.keys.address, &why))
        })
    }

    /// Connects and takes control; returns the server's name.
    fn connect(&mut self) -> Result<String, Diag> {
        let address = self.keys.address.clone();
        let opened = self.interrupt.wait_for(move || Link::open(&address))?;
        let mut link = self.kept(opened)?;
        let enable = self.keys.enable.as_deref().unwrap_or("EMCTOO");
        let taken = link.take_control(self.keys.password.as_deref().unwrap_or("EMC"), enable, &self.interrupt);
        let name = self.kept(taken)?.map_err(|what| {
            Diag::limit("run-linuxcnc-password", format!("linuxcncrsh refuses the {what} password"))
                .hint("set stage.password and stage.enable to those that it was started with (-w, -e)")
        })?;
        self.link = Some(link);
        Ok(name)
    }

    /// The next message of the control's that is an error.
    fn error(&mut self) -> Option<String> {
        self.get("error").ok().filter(|text| text != "OK")
    }

    /// Reads the messages of before; those of a control that has no end of them are for [`Self::watch`].
    fn forget_errors(&mut self) {
        for _ in 0..MOST_LINES {
            if self.error().is_none() {
                return;
            }
        }
    }

    /// Reads whether the control is on and without an error.
    fn watch(&mut self) -> Result<(), Diag> {
        if self.get("machine")? != "ON" {
            let is_stopped = self.get("estop")? == "ON";
            let why = self.error().map_or(String::new(), |text| format!(": {text}"));
            let what = if is_stopped { "is in emergency stop" } else { "is switched off" };
            return Err(alarm(format!("LinuxCNC {what}{why}")));
        }
        let error = self.get("error")?;
        if error == "OK" { Ok(()) } else { Err(alarm(format!("LinuxCNC reports: {error}"))) }
    }

    /// Positions of all axes in millionths of mm or degrees; `kind` is which of them to get, such as `abs_act_pos`.
    fn position(&mut self, kind: &str) -> Result<[i64; 6], Diag> {
        let text = self.get(kind)?;
        // NaN and infinity do not pass either; below 1e9, whole millionths are exact in f64.
        let mut numbers = text.split(' ').map(|w| w.parse::<f64>().ok().filter(|v| v.abs() < 1e9));
        let values = AXES.map(|_| numbers.next().flatten());
        if values.contains(&None) {
            return Err(lost(&self.keys.address, &format!("{kind} is {text:?}")));
        }
        Ok(values.map(|v| (v.unwrap_or_default() * 1e6).round() as i64))
    }

    /// Waits until the moves that were sent have ended at the target.
    fn arrive(&mut self, target: &[(usize, i64)], interrupt: &Interrupt) -> Result<(), Diag> {
        let mut least = i64::MAX;
        let mut moved = Instant::now();
        let mut arrived = 0;
        loop {
            interrupt.wait(EVERY)?;
            self.watch()?;
            let commanded = self.position("abs_cmd_pos")?;
            let actual = self.position("abs_act_pos")?;
            let is_within =
                |position: &[i64; 6], by: i64| target.iter().all(|&(axis, to)| (position[axis] - to).abs() <= by);
            // The control prints millionths of what it has in f64.
            arrived = if is_within(&commanded, 1) && is_within(&actual, self.tolerance) { arrived + 1 } else { 0 };
            if arrived == 2 {
                return Ok(());
            }
            // An axis that only trembles comes no nearer.
            let left: i64 = target.iter().map(|&(axis, to)| (actual[axis] - to).abs()).sum();
            if left < least.saturating_sub(NEARER) {
                (least, moved) = (left, Instant::now());
            }
            if moved.elapsed() > STALLED {
                let text = "the stage has come no nearer to its target for 10 s";
                return Err(alarm(text.into()).hint("check feed override, feed hold and stage.tolerance"));
            }
        }
    }

    /// Sends what makes the control answer with `value`, 0 to 99, through the F word when it gets there.
    fn request_answer(&mut self, value: &str) -> Result<(), Diag> {
        self.token = self.token % 9999 + 1;
        self.mdi(&format!("F[{}+{value}]", self.token * 100))
    }

    /// Waits for the answer that was requested last.
    fn wait_for_answer(&mut self, longest: Duration, interrupt: &Interrupt) -> Result<u32, Diag> {
        let end = Instant::now() + longest;
        loop {
            self.watch()?;
            let codes = self.get("program_codes")?;
            let word = codes.split(' ').find_map(|w| w.strip_prefix('F')?.parse::<u32>().ok());
            match word {
                Some(f) if f / 100 == self.token => return Ok(f % 100),
                _ if Instant::now() > end => {
                    return Err(alarm("LinuxCNC has taken a command and does not come to its end".into()));
                }
                _ => interrupt.wait(EVERY)?,
            }
        }
    }

    /// Ends motion, clears START, and makes sure that this is done.
    fn stop(&mut self) -> Result<(), Diag> {
        // A run that was aborted has to be stopped all the same; each answer has its deadline.
        self.interrupt = Interrupt::default();
        if self.link.is_none() {
            self.connect()?;
        }
        if self.get("machine")? != "ON" {
            if !self.is_started {
                return Ok(());
            }
            return Err(alarm("LinuxCNC is off and keeps its outputs: START may be on".into()));
        }
        self.set("abort")?;
        self.forget_errors();
        self.set("mode mdi")?;
        self.mdi("M65 P0")?;
        self.request_answer("0")?;
        self.wait_for_answer(ANSWER, &Interrupt::default())?;
        self.is_started = false;
        Ok(())
    }

    /// Sets START, and waits for BUSY to rise and to fall.
    fn exchange(&mut self, longest: Duration, interrupt: &Interrupt) -> Result<(), Diag> {
        if self.input(interrupt)? != 0 {
            return Err(busy("BUSY of the scan card is on before START"));
        }
        let queue = ["G4 P0.6", "M64 P0", "M66 P0 L3 Q5", "#<_terrace>=[#5399+1]", "M65 P0"];
        self.is_started = true;
        for code in queue {
            self.mdi(code)?;
        }
        self.mdi(&format!("M66 P0 L4 Q{}", longest.as_secs_f64().ceil()))?;
        // #5399 is -1 after a wait that timed out. After one that ended it is the input when the control reads it, some
        // ms later: a contact that bounces, or a short BUSY, is low by then.
        self.request_answer("#<_terrace>*10+[#5399+1]")?;
        let waits = self.wait_for_answer(longest + RISE + ANSWER, interrupt)?;
        self.is_started = false;
        // How the wait for BUSY to rise ended, and that for it to fall.
        match [waits / 10, waits % 10] {
            [0, _] => Err(busy("BUSY of the scan card has not risen within 5 s of START")),
            [_, 0] => Err(not_fallen(longest)),
            _ => self.stays_low(longest, interrupt),
        }
    }

    /// Waits until BUSY is low and was so some time before: a contact that bounces while it closes is low for a moment.
    fn stays_low(&mut self, longest: Duration, interrupt: &Interrupt) -> Result<(), Diag> {
        let end = Instant::now() + longest;
        loop {
            interrupt.wait(BOUNCE)?;
            if self.input(interrupt)? == 0 {
                return Ok(());
            }
            let left = end.saturating_duration_since(Instant::now()).as_secs_f64().ceil();
            if left == 0.0 {
                return Err(not_fallen(longest));
            }
            self.mdi(&format!("M66 P0 L4 Q{left}"))?;
            self.request_answer("#5399+1")?;
            if self.wait_for_answer(Duration::from_secs_f64(left) + ANSWER, interrupt)? == 0 {
                return Err(not_fallen(longest));
            }
        }
    }

    /// BUSY of the scan card as it is now, 0 or 1.
    fn input(&mut self, interrupt: &Interrupt) -> Result<u32, Diag> {
        self.mdi("M66 P0 L0")?;
        self.request_answer("#5399")?;
        self.wait_for_answer(ANSWER, interrupt)
    }
}

fn lost(address: &str, why: &str) -> Diag {
    Diag::limit("run-linuxcnc-link", format!("no connection to linuxcncrsh at {address}: {why}"))
        .hint("check that LinuxCNC runs with linuxcncrsh, its address, and the network")
}

fn alarm(text: String) -> Diag {
    Diag::limit("run-linuxcnc", text).hint("clear the cause in LinuxCNC: out of emergency stop, on, homed, no error")
}

fn not_fallen(longest: Duration) -> Diag {
    busy(&format!("BUSY of the scan card has not fallen within {} s", longest.as_secs()))
}

fn busy(text: &str) -> Diag {
    Diag::limit("run-busy", text).hint("make sure that the laser is off; check the card and its wires")
}

impl Stage for LinuxCnc {
    fn open(&mut self, interrupt: &Interrupt) -> Result<String, Diag> {
        self.interrupt = interrupt.clone();
        let name = self.connect()?;
        if self.keys.identity.as_ref().is_some_and(|wanted| *wanted != name) {
            let wanted = self.keys.identity.as_deref().unwrap_or_default();
            let text = format!("linuxcncrsh says that it is {name:?}, and stage.identity is {wanted:?}");
            self.link = None;
            return Err(Diag::limit("run-identity", text).hint("check stage.address; linuxcncrsh -n sets its name"));
        }
        self.forget_errors();
        self.watch()?;
        let homed = self.get("joint_homed")?;
        // Joints that are not there are listed as not homed; the control itself refuses MDI where one that is there is.
        if homed.split(' ').take(3).any(|word| word != "YES") {
            return Err(alarm("LinuxCNC is not homed".into()));
        }
        if self.get("user_linear_units")? != "MM" {
            return Err(alarm("LinuxCNC does not count in mm".into()).hint("[TRAJ]LINEAR_UNITS must be mm"));
        }
        self.was_open = true;
        // Whatever another program has left: a queue, a motion.
        self.set("abort")?;
        self.set("mode mdi")?;
        self.mdi("G21 G90 G94 G17 G40 G49 G80 G61.1")?;
        self.mdi("M65 P0")?;
        self.request_answer("0")?;
        self.wait_for_answer(ANSWER, interrupt)?;
        let offset = self.position("pos_offset")?;
        if offset != [0; 6] {
            let text = format!("LinuxCNC has a work offset of {:?} mm", offset.map(|v| v as f64 / 1e6));
            return Err(Diag::limit("run-offset", text)
                .hint("positions of a job are those of the machine: G10 L2 P1 X0 Y0 Z0 and G92.1 in MDI"));
        }
        Ok(format!("LinuxCNC, linuxcncrsh {name}, {}", self.get("inifile")?))
    }

    fn go(&mut self, to: &Move, interrupt: &Interrupt) -> Result<(), Diag> {
        self.interrupt = interrupt.clone();
        let axis = |letter| AXES.iter().position(|&a| a == letter);
        let target: Option<Vec<(usize, i64)>> = to.0.iter().map(|&(l, v)| Some((axis(l)?, v))).collect();
        let target = target.ok_or_else(|| alarm(format!("linuxcncrsh has no axis for {to}")))?;
        let moved = self.mdi(&format!("G21 G90 G53 G0 {to}")).and_then(|()| self.arrive(&target, interrupt));
        if moved.is_err() {
            // What matters is the fault; the end of the run halts again and says so.
            let _ = self.halt();
        }
        moved
    }

    fn card_is_idle(&mut self, interrupt: &Interrupt) -> Result<(), Diag> {
        self.interrupt = interrupt.clone();
        self.mdi(&format!("M66 P0 L3 Q{}", RISE.as_secs()))?;
        self.request_answer("#5399+1")?;
        match self.wait_for_answer(RISE + ANSWER, interrupt)? {
            0 => Ok(()),
            _ => Err(busy("BUSY of the scan card is on before START")),
        }
    }

    fn hand_over(&mut self, longest: Duration, interrupt: &Interrupt) -> Result<(), Diag> {
        self.interrupt = interrupt.clone();
        let done = self.exchange(longest, interrupt);
        if done.is_err() {
            let _ = self.halt();
        }
        done
    }

    fn halt(&mut self) -> Result<(), Diag> {
        if !self.was_open {
            return Ok(());
        }
        // A link that failed, or has lost control to another client, is made anew once.
        let stopped = self.stop().or_else(|_| {
            self.link = None;
            self.stop()
        });
        stopped.map_err(|d| {
            let start = if self.is_started { "START is off" } else { "the stage stands still" };
            Diag::limit("run-stage-halt", format!("it is not certain that {start}: {}", d.message))
                .hint("press the emergency stop, and make sure that the laser is off")
        })
    }
}

/// A connection, line by line; what fails says why.
struct Link {
    stream: TcpStream,
    lines: BufReader<TcpStream>,
}

impl Link {
    fn open(address: &str) -> Result<Self, String> {
        let said = |e: std::io::Error| e.to_string();
        let mut last = "there is no such address".to_owned();
        for address in address.to_socket_addrs().map_err(said)? {
            match TcpStream::connect_timeout(&address, ANSWER) {
                Ok(stream) => {
                    stream.set_write_timeout(Some(ANSWER)).map_err(said)?;
                    stream.set_nodelay(true).map_err(said)?;
                    let lines = BufReader::new(stream.try_clone().map_err(said)?);
                    return Ok(Self { stream, lines });
                }
                Err(e) => last = e.to_string(),
            }
        }
        Err(last)
    }

    /// Names itself and takes control: the server's name, or which password it refuses.
    fn take_control(
        &mut self,
        password: &str,
        enable: &str,
        interrupt: &Interrupt,
    ) -> Result<Result<String, &'static str>, String> {
        let hello = self.ask(&format!("hello {password} terrace 1.0"), "HELLO", interrupt)?;
        let Some(server) = hello.strip_prefix("ACK ") else { return Ok(Err("connection")) };
        self.send("set echo off")?;
        self.set("verbose on", interrupt)?;
        if !self.set(&format!("enable {enable}"), interrupt)? {
            return Ok(Err("enable"));
        }
        self.set("set_wait received", interrupt)?;
        Ok(Ok(server.split(' ').next().unwrap_or_default().to_owned()))
    }

    fn send(&mut self, line: &str) -> Result<(), String> {
        self.stream.write_all(format!("{line}\n").as_bytes()).map_err(|e| e.to_string())
    }

    /// The answer that begins with the word; what precedes it is an echo or the rest of a longer message. All of it has
    /// come within [`ANSWER`].
    fn ask(&mut self, line: &str, word: &str, interrupt: &Interrupt) -> Result<String, String> {
        self.send(line)?;
        let until = Instant::now() + ANSWER;
        for _ in 0..MOST_LINES {
            let answer = self.line(until, interrupt)?;
            let answer = answer.ok_or_else(|| format!("no answer to {line:?} within {} s", ANSWER.as_secs()))?;
            if let Some(rest) = answer.trim().strip_prefix(word) {
                return Ok(rest.trim().to_owned());
            }
        }
        Err(format!("no answer to {line:?} among {MOST_LINES} lines"))
    }

    /// The next line; None where it has not ended by then.
    fn line(&mut self, until: Instant, interrupt: &Interrupt) -> Result<Option<String>, String> {
        let mut bytes = Vec::new();
        loop {
            interrupt.check().map_err(|d| d.message)?;
            let left = until.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return Ok(None);
            }
            self.stream.set_read_timeout(Some(left.min(SLICE))).map_err(|e| e.to_string())?;
            let found = match self.lines.fill_buf() {
                Ok([]) => return Err("the other side has closed it".into()),
                Ok(found) => found,
                Err(e) if matches!(e.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut | ErrorKind::Interrupted) => {
                    continue;
                }
                Err(e) => return Err(e.to_string()),
            };
            // Lines end with CR LF or LF CR.
            let end = found.iter().position(|&c| c == b'\n').map(|at| at + 1);
            let count = end.unwrap_or(found.len());
            bytes.extend_from_slice(&found[..count]);
            self.lines.consume(count);
            if bytes.len() > LONGEST_LINE {
                return Err(format!("it sends a line of more than {LONGEST_LINE} bytes"));
            }
            if end.is_some() {
                return Ok(Some(String::from_utf8_lossy(&bytes).into_owned()));
            }
        }
    }

    fn get(&mut self, what: &str, interrupt: &Interrupt) -> Result<String, String> {
        self.ask(&format!("get {what}"), &what.to_uppercase(), interrupt)
    }

    /// Whether it was taken.
    fn set(&mut self, what: &str, interrupt: &Interrupt) -> Result<bool, String> {
        let word = what.split(' ').next().unwrap_or_default().to_uppercase();
        let answer = self.ask(&format!("set {what}"), &format!("SET {word} "), interrupt)?;
        Ok(answer == "ACK")
    }
}
