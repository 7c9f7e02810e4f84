//! A stand-in for linuxcncrsh in this process: the lines, line ends and refusals of the one of LinuxCNC 2.9, with a
//! queue of commands, a stage and a scan card.

use std::collections::VecDeque;
use std::io::{BufRead, BufReader, Write};
use std::net::{TcpListener, TcpStream};
use std::sync::{Arc, Condvar, Mutex, MutexGuard};
use std::time::Duration;

use super::card::Clock;
pub use super::card::{Card, Marks};

/// What the control does instead of a move.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Trip {
    /// It goes into emergency stop.
    EmergencyStop,
    /// It reports an error and stays.
    Error,
    /// The connection closes.
    Close,
    /// It stops without a word.
    Stall,
}

/// State of the control.
pub struct Control {
    pub homed: bool,
    pub machine_on: bool,
    pub offset: f64,
    /// The scan card: when its laser was on, and what BUSY says of that.
    pub card: Card,
    pub marks: Marks,
    /// The move, from 1, at which it trips.
    pub trip: Option<(usize, Trip)>,
    /// Every MDI line in its order.
    pub mdi: Vec<String>,
    /// Digital output 0.
    pub start: bool,
    /// How long a move takes.
    pub move_time: Duration,
    /// How long after the end of a wait it reads the input, s.
    pub read_delay: f64,
    /// From when to when the stage moved, s of `clock`.
    pub moves: Vec<[f64; 2]>,
    pub clock: Clock,
    enabled: bool,
    position: [f64; 6],
    move_count: usize,
    input: f64,
    parameter: f64,
    f: f64,
    errors: VecDeque<String>,
    queue: VecDeque<String>,
    /// Raised by an abort, which ends what is at work.
    generation: usize,
    is_at_work: bool,
}

/// The shell of a control, on a port of its own.
pub struct Shell {
    pub address: String,
    pub control: Arc<Mutex<Control>>,
}

impl Shell {
    /// A control that is ready.
    pub fn new() -> Self {
        let control = Control {
            homed: true,
            machine_on: true,
            offset: 0.0,
            card: Card::Works,
            marks: Marks::default(),
            trip: None,
            mdi: Vec::new(),
            start: false,
            move_time: Duration::ZERO,
            read_delay: 0.0,
            moves: Vec::new(),
            clock: Clock::start(),
            enabled: false,
            position: [0.0; 6],
            move_count: 0,
            input: 0.0,
            parameter: 0.0,
            f: 0.0,
            errors: VecDeque::new(),
            queue: VecDeque::new(),
            generation: 0,
            is_at_work: false,
        };
        let control = Arc::new(Mutex::new(control));
        let queued = Arc::new(Condvar::new());
        let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
        let address = listener.local_addr().expect("bound").to_string();
        let (shared, printed) = (Arc::clone(&control), Arc::clone(&queued));
        std::thread::spawn(move || work(&shared, &printed));
        let shared = Arc::clone(&control);
        std::thread::spawn(move || {
            for stream in listener.incoming().flatten() {
                let (control, queued) = (Arc::clone(&shared), Arc::clone(&queued));
                std::thread::spawn(move || serve(stream, &control, &queued));
            }
        });
        Self { address, control }
    }

    /// The control, to look at or to change.
    pub fn control(&self) -> MutexGuard<'_, Control> {
        self.control.lock().expect("no test has failed inside")
    }
}

/// Executes the queue, one command after another.
fn work(control: &Mutex<Control>, queued: &Condvar) {
    let mut locked = control.lock().expect("no test has failed inside");
    loop {
        let Some(code) = locked.queue.pop_front() else {
            locked = queued.wait(locked).expect("no test has failed inside");
            continue;
        };
        locked.is_at_work = true;
        let generation = locked.generation;
        let mut pause = locked.begin(&code);
        // What takes time is ended by an abort.
        while let Some(time) = pause {
            drop(locked);
            std::thread::sleep(time.min(Duration::from_millis(2)));
            locked = control.lock().expect("no test has failed inside");
            if locked.generation != generation || !locked.machine_on {
                break;
            }
            pause = time.checked_sub(Duration::from_millis(2)).filter(|left| !left.is_zero());
        }
        locked.end(&code, generation);
        locked.is_at_work = false;
    }
}

/// Answers a client line by line until one of both closes.
fn serve(mut stream: TcpStream, control: &Mutex<Control>, queued: &Condvar) {
    let lines = BufReader::new(stream.try_clone().expect("a socket")).lines();
    let (mut linked, mut echo, mut verbose) = (false, true, false);
    for line in lines {
        let Ok(line) = line else { return };
        let mut answer = if linked && echo { format!("{line}\r\n") } else { String::new() };
        let mut control = control.lock().expect("no test has failed inside");
        let words: Vec<&str> = line.split(' ').collect();
        match words[0] {
            "hello" if words.get(1) == Some(&"EMC") => {
                linked = true;
                answer += "HELLO ACK EMCNETSVR 1.1\r\n";
            }
            "hello" => answer += "HELLO NAK\r\n",
            "get" if linked => answer += &format!("{}\r\n", control.get(words[1])),
            "set" if linked => {
                let name = words[1].to_uppercase();
                let taken = match words[1] {
                    "echo" => {
                        echo = words[2] == "on";
                        true
                    }
                    "verbose" => {
                        verbose = words[2] == "on";
                        true
                    }
                    _ => control.set(words[1], line.splitn(3, ' ').nth(2).unwrap_or_default()),
                };
                if !taken {
                    answer += &format!("SET {name} NAK\n\r");
                } else if verbose {
                    answer += &format!("SET {name} ACK\n\r");
                }
                queued.notify_one();
                if control.trip == Some((control.move_count, Trip::Close)) {
                    control.trip = None;
                    return;
                }
            }
            _ => answer += "SET NAK\r\n",
        }
        drop(control);
        if stream.write_all(answer.as_bytes()).is_err() {
            return;
        }
    }
}

impl Control {
    /// Whether the queue is empty and the laser of the card off.
    pub fn is_at_rest(&self) -> bool {
        let now = self.clock.now();
        !self.is_at_work && self.queue.is_empty() && self.marks.on.iter().all(|on| on[1] <= now)
    }

    fn get(&mut self, what: &str) -> String {
        let on = |is: bool| if is { "ON" } else { "OFF" };
        let list = |values: [f64; 6]| values.map(|v| format!("{v:.6}")).join(" ");
        let value = match what {
            "estop" => on(!self.machine_on).to_owned(),
            "machine" => on(self.machine_on).to_owned(),
            "mode" => "MDI".into(),
            "error" => self.errors.pop_front().unwrap_or_else(|| "OK".into()),
            "joint_homed" if self.homed => "YES YES YES NO NO NO".into(),
            "joint_homed" => "YES NO YES NO NO NO".into(),
            "user_linear_units" => "MM".into(),
            "inifile" => "/home/cnc/stage.ini".into(),
            "abs_cmd_pos" | "abs_act_pos" => list(self.position),
            "pos_offset" => list([self.offset, 0.0, 0.0, 0.0, 0.0, 0.0]),
            "program_codes" => format!("G0 G17 G40 G21 G90 G94 G54 G49 G99 G61.1 G97 G91.1 G8 G92.2 F{:.0} S0", self.f),
            other => return format!("GET {} NAK", other.to_uppercase()),
        };
        format!("{} {value}", what.to_uppercase())
    }

    fn set(&mut self, what: &str, value: &str) -> bool {
        match what {
            "enable" => {
                self.enabled = value == "EMCTOO";
                self.enabled
            }
            "set_wait" => self.enabled,
            "abort" if self.enabled && self.machine_on => {
                self.queue.clear();
                self.generation += 1;
                true
            }
            "mode" => self.enabled && self.machine_on && value == "mdi",
            "mdi" if self.enabled && self.machine_on => {
                self.mdi.push(value.to_owned());
                if self.is_taken(value) {
                    self.queue.push_back(value.to_owned());
                }
                true
            }
            _ => false,
        }
    }

    /// Whether a line of MDI is executed: a move may trip the control.
    fn is_taken(&mut self, code: &str) -> bool {
        if !code.starts_with(MOVE) {
            return true;
        }
        self.move_count += 1;
        match self.trip.filter(|(at, _)| *at == self.move_count) {
            Some((_, Trip::EmergencyStop)) => self.machine_on = false,
            Some((_, Trip::Error)) => self.errors.push_back("joint 1 following error".into()),
            Some(_) => {}
            None => return true,
        }
        false
    }

    /// Begins a line of MDI; how long it takes.
    fn begin(&mut self, code: &str) -> Option<Duration> {
        let now = self.clock.now();
        if code.starts_with(MOVE) {
            self.moves.push([now, now]);
            return Some(self.move_time).filter(|time| !time.is_zero());
        }
        let wait = |this: &mut Self, wanted: bool, longest: f64| {
            let found = this.card.reaches(&this.marks, wanted, now, longest);
            // Nobody has to wait for what never comes.
            let at_read = |s| f64::from(u8::from(this.card.busy(&this.marks, now + s + this.read_delay)));
            this.input = found.map_or(-1.0, at_read);
            if found.is_none() {
                this.clock.skip(longest);
            }
            found.filter(|s| *s > 0.0).map(Duration::from_secs_f64)
        };
        match code {
            "M64 P0" => {
                if !self.start {
                    self.marks.start(now);
                }
                self.start = true;
            }
            "M65 P0" => self.start = false,
            "M66 P0 L0" => self.input = f64::from(u8::from(self.card.busy(&self.marks, now))),
            "M66 P0 L3 Q5" => return wait(self, true, 5.0),
            "#<_terrace>=[#5399+1]" => self.parameter = self.input + 1.0,
            _ if code.starts_with("F[") => self.f = self.sum(code),
            _ => {
                if let Some(longest) = code.strip_prefix("M66 P0 L4 Q") {
                    return wait(self, false, longest.parse().expect("a number"));
                }
                let dwell = code.strip_prefix("G4 P")?.parse().expect("a number");
                return Some(Duration::from_secs_f64(dwell));
            }
        }
        None
    }

    /// Ends it, at its time or by an abort.
    fn end(&mut self, code: &str, generation: usize) {
        let Some(words) = code.strip_prefix(MOVE) else { return };
        let now = self.clock.now();
        self.moves.last_mut().expect("it has begun")[1] = now;
        if self.generation == generation && self.machine_on {
            for word in words.split(' ') {
                let axis = "XYZABC".find(&word[..1]).expect("an axis");
                self.position[axis] = word[1..].parse().expect("a number");
            }
        }
    }

    /// `F[100+...]`, in the forms that are used.
    fn sum(&self, code: &str) -> f64 {
        let (first, rest) = code[2..code.len() - 1].split_once('+').expect("a sum");
        let first: f64 = first.parse().expect("a number");
        first
            + match rest {
                "0" => 0.0,
                "#5399" => self.input,
                "#5399+1" => self.input + 1.0,
                "#<_terrace>*10+[#5399+1]" => self.parameter * 10.0 + self.input + 1.0,
                other => panic!("{other}"),
            }
    }
}

/// What a line of MDI that moves begins with.
const MOVE: &str = "G21 G90 G53 G0 ";
