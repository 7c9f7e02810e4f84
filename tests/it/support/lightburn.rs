//! A stand-in for LightBurn that answers over UDP, with up to three datagrams per block that are surplus, doubled, late
//! or another program's.

use std::collections::VecDeque;
use std::net::{SocketAddr, UdpSocket};
use std::sync::{Arc, Mutex};
use std::time::{Duration, SystemTime};

use super::card::until;
use super::surfaces::Random;

/// Most faults of a block.
const MOST_FAULTS: usize = 3;

pub struct LightBurn {
    pub port: u16,
    /// The port for answers that a run file names: 0, since it answers to where a command comes from.
    pub answers: u16,
    state: Arc<Mutex<State>>,
}

/// What goes wrong at a time.
#[derive(Clone, Copy, Debug)]
enum Fault {
    /// The last answer is sent once more.
    Doubled,
    /// An answer that nobody asked for, from its own port or another of the same computer.
    Surplus { is_idle: bool, is_foreign: bool },
    /// The next answer comes so many s late.
    Late(f64),
}

struct State {
    random: Random,
    /// How long every answer takes, s.
    latency: f64,
    file: String,
    /// Busy since START; the laser is on for a part of that.
    busy: [f64; 2],
    marks: Vec<(Option<String>, [f64; 2])>,
    faults: Vec<(f64, Fault)>,
    answers: VecDeque<(f64, &'static str, SocketAddr)>,
    most_faults: usize,
    late: f64,
    last: &'static str,
    client: Option<SocketAddr>,
}

/// s since 1970.
fn now() -> f64 {
    SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).expect("after 1970").as_secs_f64()
}

impl LightBurn {
    pub fn new() -> Self {
        let [own, foreign] = [(); 2].map(|()| UdpSocket::bind("127.0.0.1:0").expect("a port"));
        let port = own.local_addr().expect("bound").port();
        let state = State {
            random: Random::new(1),
            latency: 0.0,
            file: String::new(),
            busy: [0.0; 2],
            marks: Vec::new(),
            faults: Vec::new(),
            answers: VecDeque::new(),
            most_faults: MOST_FAULTS,
            late: 0.0,
            last: "OK",
            client: None,
        };
        let state = Arc::new(Mutex::new(state));
        let shared = Arc::clone(&state);
        std::thread::spawn(move || serve(&own, &foreign, &shared));
        Self { port, answers: 0, state }
    }

    /// One that does nothing wrong.
    pub fn faultless() -> Self {
        let new = Self::new();
        new.state.lock().expect("no test has failed inside").most_faults = 0;
        new
    }

    /// Draws faults anew from this seed.
    pub fn begin(&self, seed: u64) {
        let mut state = self.state.lock().expect("no test has failed inside");
        state.random = Random::new(seed);
        state.latency = [0.0, 0.005, 0.02, 0.02][seed as usize % 4];
        state.marks.clear();
        state.faults.clear();
        state.file.clear();
    }

    /// Waits until it is idle: the blocks that it marked, and when.
    pub fn marks(&self) -> Vec<(Option<String>, [f64; 2])> {
        let state = || self.state.lock().expect("no test has failed inside");
        until("LightBurn is not idle", Duration::from_secs(10), || state().busy[1] < now());
        state().marks.clone()
    }
}

fn serve(own: &UdpSocket, foreign: &UdpSocket, state: &Mutex<State>) {
    own.set_read_timeout(Some(Duration::from_millis(1))).expect("set");
    let mut buffer = [0; 600];
    loop {
        let received = own.recv_from(&mut buffer);
        let mut state = state.lock().expect("no test has failed inside");
        if let Ok((count, from)) = received {
            let command = String::from_utf8_lossy(&buffer[..count]).into_owned();
            let answer = state.command(&command);
            // Whoever else starts it is answered too.
            if command != "START" {
                state.client = Some(from);
            }
            let at = now() + state.latency + std::mem::take(&mut state.late);
            state.answers.push_back((at, answer, from));
        }
        state.send(own, foreign);
    }
}

impl State {
    fn command(&mut self, command: &str) -> &'static str {
        let is_busy = now() < self.busy[1];
        match command.split(':').next().unwrap_or_default() {
            "STATUS" if is_busy => "!",
            "PING" | "STATUS" => "OK",
            "FORCELOAD" | "START" if is_busy => "!",
            "FORCELOAD" => {
                let name = command.rsplit(['/', '\\']).next().unwrap_or_default().to_owned();
                if name != self.file {
                    self.file = name;
                    self.draw();
                }
                "OK"
            }
            "START" => {
                let begin = now() + self.random.below(30) as f64 / 1e3;
                let end = begin + (150 + self.random.below(250)) as f64 / 1e3;
                self.busy = [now(), end];
                // Half of what has not happened yet happens while it marks.
                for i in 0..self.faults.len() {
                    if self.random.below(2) == 0 {
                        self.faults[i].0 = now() + self.random.below(400) as f64 / 1e3;
                    }
                }
                let block = self.file.split('.').next().unwrap_or_default().to_owned();
                self.marks.push((Some(block), [begin, end]));
                "OK"
            }
            _ => "?",
        }
    }

    /// Draws what goes wrong with a block, from its load to some time after it.
    fn draw(&mut self) {
        self.faults.clear();
        for _ in 0..self.random.below(self.most_faults + 1) {
            let at = now() + self.random.below(2500) as f64 / 1e3;
            let fault = match self.random.below(3) {
                0 => Fault::Doubled,
                1 => Fault::Surplus { is_idle: self.random.below(3) > 0, is_foreign: self.random.below(2) == 0 },
                _ => Fault::Late(self.random.below(600) as f64 / 1e3),
            };
            self.faults.push((at, fault));
        }
    }

    /// Sends what is due.
    fn send(&mut self, own: &UdpSocket, foreign: &UdpSocket) {
        let (now, Some(client)) = (now(), self.client) else { return };
        let due: Vec<Fault> = self.faults.iter().filter(|(at, _)| *at <= now).map(|(_, fault)| *fault).collect();
        self.faults.retain(|(at, _)| *at > now);
        for fault in due {
            let (from, text) = match fault {
                Fault::Doubled => (own, self.last),
                Fault::Surplus { is_idle, is_foreign } => {
                    (if is_foreign { foreign } else { own }, if is_idle { "OK" } else { "!" })
                }
                Fault::Late(s) => {
                    self.late = s;
                    continue;
                }
            };
            let _ = from.send_to(text.as_bytes(), client);
        }
        // One that is late is overtaken.
        let (due, later): (VecDeque<_>, VecDeque<_>) = self.answers.drain(..).partition(|(at, ..)| *at <= now);
        self.answers = later;
        for (_, text, to) in due {
            self.last = text;
            let _ = own.send_to(text.as_bytes(), to);
        }
    }
}
