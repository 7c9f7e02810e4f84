//! A stand-in for linuxcncrsh in this process: the lines, line ends and refusals of the one of LinuxCNC 2.9, with a
//! stage that moves at once and a scan card.

use std::collections::VecDeque;
use std::io::{BufRead, BufReader, Write};
use std::net::{TcpListener, TcpStream};
use std::sync::{Arc, Mutex};

/// How the scan card answers to START.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Card {
    /// BUSY rises and falls.
    Works,
    /// BUSY never rises.
    Dead,
    /// BUSY rises and never falls.
    Stuck,
    /// BUSY is on before START.
    Busy,
}

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
    pub card: Card,
    /// The move, from 1, at which it trips.
    pub trip: Option<(usize, Trip)>,
    /// Every MDI line in its order.
    pub mdi: Vec<String>,
    /// Digital output 0.
    pub start: bool,
    enabled: bool,
    position: [f64; 6],
    moves: usize,
    input: f64,
    parameter: f64,
    f: f64,
    errors: VecDeque<String>,
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
            trip: None,
            mdi: Vec::new(),
            start: false,
            enabled: false,
            position: [0.0; 6],
            moves: 0,
            input: 0.0,
            parameter: 0.0,
            f: 0.0,
            errors: VecDeque::new(),
        };
        let control = Arc::new(Mutex::new(control));
        let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
        let address = listener.local_addr().expect("bound").to_string();
        let shared = Arc::clone(&control);
        std::thread::spawn(move || {
            for stream in listener.incoming().flatten() {
                let control = Arc::clone(&shared);
                std::thread::spawn(move || serve(stream, &control));
            }
        });
        Self { address, control }
    }

    /// The control, to look at or to change.
    pub fn control(&self) -> std::sync::MutexGuard<'_, Control> {
        self.control.lock().expect("no test has failed inside")
    }
}

/// Answers a client line by line until one of both closes.
fn serve(mut stream: TcpStream, control: &Mutex<Control>) {
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
                if control.trip == Some((control.moves, Trip::Close)) {
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
            "abort" => self.enabled && self.machine_on,
            "mode" => self.enabled && self.machine_on && value == "mdi",
            "mdi" if self.enabled && self.machine_on => {
                self.mdi.push(value.to_owned());
                self.run(value);
                true
            }
            _ => false,
        }
    }

    /// What a line of MDI does.
    fn run(&mut self, code: &str) {
        if let Some(words) = code.strip_prefix("G21 G90 G53 G0 ") {
            self.moves += 1;
            match self.trip.filter(|(at, _)| *at == self.moves) {
                Some((_, Trip::EmergencyStop)) => self.machine_on = false,
                Some((_, Trip::Error)) => self.errors.push_back("joint 1 following error".into()),
                Some(_) => {}
                None => {
                    for word in words.split(' ') {
                        let axis = "XYZABC".find(&word[..1]).expect("an axis");
                        self.position[axis] = word[1..].parse().expect("a number");
                    }
                }
            }
            return;
        }
        match code {
            "M64 P0" => self.start = true,
            "M65 P0" => self.start = false,
            "M66 P0 L0" => self.input = f64::from(u8::from(self.card == Card::Busy)),
            "M66 P0 L3 Q5" => self.input = if self.start && self.card != Card::Dead { 1.0 } else { -1.0 },
            "#<_terrace>=[#5399+1]" => self.parameter = self.input + 1.0,
            _ if code.starts_with("M66 P0 L4 Q") => self.input = if self.card == Card::Stuck { -1.0 } else { 0.0 },
            _ if code.starts_with("F[") => self.f = self.sum(code),
            _ => {}
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
                "#<_terrace>*10+[#5399+1]" => self.parameter * 10.0 + self.input + 1.0,
                other => panic!("{other}"),
            }
    }
}
