//! Who loads and starts the blocks of a stepped job, and the time that this takes.

use crate::emit::Target;
use serde::{Deserialize, Serialize};

use crate::emit::Files;
use terrace_core::format::Format;
use terrace_core::machine::{LoadingWay, Machine};
use terrace_input::job::{Job, MachineInput};

/// Time in which a person loads and starts one block where the machine file does not state it, s.
const ASSUMED_LOAD_S: f64 = 15.0;

/// Who loads and starts the blocks of a stepped job, and the time of the job with it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Loading {
    /// The way.
    pub way: LoadingWay,
    /// Whether no machine file states it. A built-in machine assumes one; where that does not either, the most cautious
    /// is taken: a person, who takes longest and sees every block.
    pub assumed: bool,
    /// Time for one block, s; 0 where nobody loads, or where it is not known.
    pub load_s: f64,
    /// Whether no machine file states a time that counts.
    pub load_assumed: bool,
    /// Time of the machine and of loading, one after the other, s.
    pub total_s: f64,
}

impl Loading {
    /// For so many blocks of a job that takes the machine `machine_s`.
    pub fn new(job: &Job, machine: &Machine, blocks: usize, machine_s: f64) -> Self {
        let operator = machine.operator;
        let way = operator.way.unwrap_or_else(|| most_cautious(&job.formats));
        let is_built_in = matches!(job.machine, MachineInput::Profile(_));
        let stated_s = operator.load.map(|load| load.as_s());
        let load_s = match way {
            LoadingWay::Person => stated_s.unwrap_or(ASSUMED_LOAD_S),
            LoadingWay::Run => stated_s.unwrap_or(0.0),
            LoadingWay::Card | LoadingWay::Ovf => 0.0,
        };
        Self {
            way,
            assumed: operator.way.is_none() || is_built_in,
            load_s,
            load_assumed: way == LoadingWay::Person && stated_s.is_none(),
            total_s: machine_s + load_s * blocks as f64,
        }
    }

    /// How some blocks of the job are loaded, which take the machine `machine_s`.
    #[must_use]
    pub fn of_blocks(&self, blocks: usize, machine_s: f64) -> Self {
        Self { total_s: machine_s + self.load_s * blocks as f64, ..*self }
    }

    /// Whether [`Loading::total_s`] leaves out a time that is not known: what `terrace run` takes to load a block.
    pub fn is_least(&self) -> bool {
        self.way == LoadingWay::Run && self.load_s == 0.0
    }

    /// Who loads and starts `blocks`, as a sentence without its end.
    fn who(&self, blocks: &str) -> String {
        match self.way {
            LoadingWay::Person => format!("a person loads and starts {blocks}, {} s each", self.load_s),
            LoadingWay::Run if self.is_least() => format!("terrace run loads and starts {blocks}, which comes on top"),
            LoadingWay::Run => format!("terrace run loads and starts {blocks}, {} s each", self.load_s),
            LoadingWay::Card => format!("the scan card has {blocks} stored, the handshake of stage.ngc starts each"),
            LoadingWay::Ovf => format!("a controller reads job.ovf and marks {blocks} of it"),
        }
    }

    /// What of it is assumed, and which key of the machine file states it; empty where all is stated.
    pub fn assumption(&self) -> &'static str {
        match (self.assumed, self.load_assumed) {
            (true, true) => "assumed: state operator.way and operator.load in the machine file",
            (true, false) => "assumed: state operator.way in the machine file",
            (false, true) => "the time is assumed: state operator.load in the machine file",
            (false, false) => "",
        }
    }

    /// Who loads and starts so many blocks, with what of it is assumed in parentheses.
    pub fn sentence(&self, blocks: usize) -> String {
        self.with_assumption(&if blocks == 1 { "1 block".to_owned() } else { format!("{blocks} blocks") })
    }

    /// Who loads and starts every block of a job, with what of it is assumed in parentheses.
    pub fn sentence_per_block(&self) -> String {
        self.with_assumption("every block")
    }

    fn with_assumption(&self, blocks: &str) -> String {
        match self.assumption() {
            "" => self.who(blocks),
            assumption => format!("{} ({assumption})", self.who(blocks)),
        }
    }
}

/// The way that is taken where no machine file states one: of those that formats can serve, the one that takes longest
/// and warns of most. That is a person, except where a controller that reads `job.ovf` alone can mark the job.
fn most_cautious(formats: &[Format]) -> LoadingWay {
    let targets = || formats.iter().map(|&format| Target::of(format));
    let is_of_blocks = targets().any(|t| matches!(t.stepped, Some(Files::Blocks(..))) || t.moves_stage);
    if !is_of_blocks && targets().any(|t| t.ways.contains(&LoadingWay::Ovf)) {
        LoadingWay::Ovf
    } else {
        LoadingWay::Person
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn loading(way: LoadingWay, load_s: f64, [assumed, load_assumed]: [bool; 2]) -> Loading {
        Loading { way, assumed, load_s, load_assumed, total_s: 0.0 }
    }

    #[test]
    fn the_most_cautious_way_is_a_person_but_where_one_file_holds_all() {
        for (formats, way) in [
            (&[Format::Dxf, Format::Linuxcnc, Format::Ovf][..], LoadingWay::Person),
            (&[Format::Linuxcnc, Format::Ovf], LoadingWay::Person),
            (&[Format::Lightburn], LoadingWay::Person),
            (&[Format::Gcode], LoadingWay::Person),
            (&[Format::Ovf, Format::Poses], LoadingWay::Ovf),
            (&[], LoadingWay::Person),
        ] {
            assert_eq!(most_cautious(formats), way, "{formats:?}");
        }
    }

    #[test]
    fn what_is_assumed_is_reported_with_its_key() {
        let person = loading(LoadingWay::Person, 15.0, [true, true]);
        let wanted = "a person loads and starts 29 blocks, 15 s each (assumed: state operator.way and operator.load in the \
                    machine file)";
        assert_eq!(person.sentence(29), wanted);
        let run = loading(LoadingWay::Run, 0.0, [true, false]);
        assert!(
            run.is_least()
                && run
                    .sentence(1)
                    .ends_with("1 block, which comes on top (assumed: state operator.way in the machine file)")
        );
        let stated = loading(LoadingWay::Run, 2.5, [false, false]);
        assert!(!stated.is_least());
        assert_eq!(stated.sentence(3), "terrace run loads and starts 3 blocks, 2.5 s each");
        assert_eq!(stated.sentence_per_block(), "terrace run loads and starts every block, 2.5 s each");
        assert_eq!(stated.of_blocks(3, 10.0).total_s, 17.5);
    }
}
