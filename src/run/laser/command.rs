//! A command of the user's that marks one block.

use std::fs::File;
use std::io;
use std::path::PathBuf;
use std::process::{Child, Stdio};
use std::time::{Duration, Instant};

use super::{Beam, Laser, Work};
use crate::run::Interrupt;
use crate::run::settings::CommandKeys;
use crate::run::stage::Stage;
use terrace_core::diag::Diag;
use terrace_core::geom::Nm;
use terrace_plan::emit::TARGETS;

/// How long the command that switches the laser off may take.
const OFF: Duration = Duration::from_secs(10);

/// What stands for the focus shift in an argument.
const SHIFT: &str = "{shift}";

/// Runs a command for each block, without a shell.
pub struct Command {
    keys: CommandKeys,
    format: Option<&'static str>,
    lock: Option<File>,
    /// Whether a command for a block had to be ended, and the laser may still be on.
    is_doubtful: bool,
}

impl Command {
    /// For a job that holds files of these formats.
    ///
    /// # Errors
    /// `run-command` where a command is empty or the format is unknown or not stated among several.
    pub fn new(keys: &CommandKeys, held: Vec<&'static str>) -> Result<Self, Diag> {
        let commands = [Some(&keys.mark), keys.pilot.as_ref(), keys.off.as_ref()];
        if commands.into_iter().flatten().any(|c| c.first().is_none_or(String::is_empty)) {
            return Err(Diag::input("run-command", "a command of the laser is empty")
                .hint("write the program and its arguments as a list: [\"program\", \"{file}\"]"));
        }
        let takes_file = commands.into_iter().flatten().flatten().any(|word| word.contains("{file}"));
        let format = match (&keys.format, held.as_slice()) {
            (Some(name), _) => Some(TARGETS.iter().map(|t| t.name()).find(|n| n == name).ok_or_else(|| {
                Diag::input("run-command", format!("there is no format {name:?}"))
                    .hint(format!("laser.format is one of those in emit.formats; this job holds {}", held.join(", ")))
            })?),
            (None, _) if !takes_file => None,
            (None, &[only]) => Some(only),
            (None, _) => {
                let text = format!("laser.format must say which files the command takes: the job holds {held:?}");
                return Err(Diag::input("run-command", text).hint("such as laser.format = \"dxf\""));
            }
        };
        Ok(Self { keys: keys.clone(), format, lock: None, is_doubtful: false })
    }

    /// Starts a command. With `work`, its file, block and shift replace `{file}`, `{block}` and `{shift}` in the words.
    /// The command has `stdin` open until it ends, so `mark` gives it the lock there.
    fn start(words: &[String], work: Option<&Work>, stdin: Stdio) -> Result<Child, Diag> {
        let words: Vec<String> = match work {
            Some(work) => words.iter().map(|word| filled_for(word, work)).collect(),
            None => words.to_vec(),
        };
        // `new` refuses a command without a program.
        let mut command = std::process::Command::new(&words[0]);
        // Its output is not the result of this program.
        command.args(&words[1..]).stdin(stdin).stdout(io::stderr());
        // Ctrl-C at the terminal is not for it: the first one lets the block end. `kill` ends the whole group.
        #[cfg(unix)]
        std::os::unix::process::CommandExt::process_group(&mut command, 0);
        command.spawn().map_err(|e| {
            Diag::limit("run-laser-command", format!("cannot start {:?}: {e}", words[0]))
                .hint("check laser.mark, laser.pilot and laser.off in the run file")
        })
    }

    /// Waits for the end of a command; ends it after `longest` or when the run is aborted.
    fn wait(mut child: Child, longest: Duration, interrupt: &Interrupt) -> Result<(), Diag> {
        let begun = Instant::now();
        let failed = |text: String| Diag::limit("run-laser-command", text);
        loop {
            match child.try_wait() {
                Ok(Some(status)) if status.success() => return Ok(()),
                Ok(Some(status)) => return Err(failed(format!("the command of the laser failed with {status}"))),
                Err(e) => return Err(failed(format!("the command of the laser cannot be watched: {e}"))),
                Ok(None) if begun.elapsed() > longest => {
                    kill(&mut child);
                    let text = format!("the command of the laser had not ended after {} s", longest.as_secs());
                    return Err(failed(text).hint("the limit is twice the estimated time of the block plus 10 s"));
                }
                Ok(None) => {}
            }
            if let Err(d) = interrupt.wait(Duration::from_millis(5)) {
                kill(&mut child);
                return Err(d);
            }
        }
    }
}

/// A word of a command with what it names of a block.
fn filled_for(word: &str, work: &Work) -> String {
    // With the separators of the system: a program of Windows takes `/` for the start of an option.
    let native = |file: &PathBuf| file.components().collect::<PathBuf>().display().to_string();
    let file = work.file.as_ref().map_or(String::new(), native);
    let shift = Nm(work.focus_shift).mm().to_string();
    filled(word, &[("{file}", file.as_str()), ("{block}", work.block.as_str()), (SHIFT, shift.as_str())])
}

/// Puts values in place of their names, in one pass: a path that holds such a name stays as it is.
fn filled(word: &str, values: &[(&str, &str)]) -> String {
    let mut out = String::new();
    let mut rest = word;
    while let Some(at) = rest.find('{') {
        out += &rest[..at];
        rest = &rest[at..];
        let found = values.iter().find_map(|(name, value)| Some((value, rest.strip_prefix(name)?)));
        let (value, after) = found.map_or(("{", &rest[1..]), |(value, after)| (*value, after));
        out += value;
        rest = after;
    }
    out + rest
}

/// Ends a command and what it has started.
fn kill(child: &mut Child) {
    #[cfg(unix)]
    let _ = std::process::Command::new("kill").args(["-KILL", "--", &format!("-{}", child.id())]).status();
    let _ = child.kill();
    let _ = child.wait();
}

impl Laser for Command {
    fn format(&self) -> Option<&'static str> {
        self.format
    }

    fn has_pilot(&self) -> bool {
        self.keys.pilot.is_some()
    }

    fn sets_focus_shift(&self) -> bool {
        let has = |words: &Vec<String>| words.iter().any(|word| word.contains(SHIFT));
        let in_file = TARGETS.iter().any(|t| Some(t.name()) == self.format && t.carries_focus_shift);
        in_file || has(&self.keys.mark) && self.keys.pilot.as_ref().is_none_or(has)
    }

    fn hold(&mut self, lock: File) {
        self.lock = Some(lock);
    }

    fn open(&mut self, _: &Interrupt) -> Result<String, Diag> {
        self.off()?;
        Ok(format!("command {:?}", self.keys.mark))
    }

    fn mark(&mut self, work: &Work, beam: Beam, _: &mut dyn Stage, interrupt: &Interrupt) -> Result<(), Diag> {
        let words = match (beam, &self.keys.pilot) {
            (Beam::Pilot, Some(pilot)) => pilot,
            (Beam::Pilot, None) => return Ok(()),
            (Beam::Fire, _) => &self.keys.mark,
        };
        // At its end, so nothing can be read from it. The lock lasts as long as the command, even where this program is
        // killed.
        let held = self.lock.as_ref().map(File::try_clone).transpose();
        let stdin = held.map_err(|e| Diag::limit("run-laser-command", format!("cannot hold the lock: {e}")))?;
        let child = Self::start(words, Some(work), stdin.map_or_else(Stdio::null, Stdio::from))?;
        self.is_doubtful = true;
        Self::wait(child, work.longest(), interrupt)?;
        self.is_doubtful = false;
        Ok(())
    }

    fn off(&mut self) -> Result<(), Diag> {
        let Some(words) = &self.keys.off else {
            if !self.is_doubtful {
                return Ok(());
            }
            let text = "it is not certain that the laser is off: its command did not end well";
            return Err(Diag::limit("run-laser-off", text)
                .hint("make sure that it is; state laser.off in the run file, so that terrace can switch it off"));
        };
        // The run may be aborted already: this has to be done all the same.
        let done =
            Self::start(words, None, Stdio::null()).and_then(|child| Self::wait(child, OFF, &Interrupt::default()));
        done.map_err(|d| {
            let text = format!("it is not certain that the laser is off: {}", d.message);
            Diag::limit("run-laser-off", text).hint("switch it off by hand")
        })?;
        self.is_doubtful = false;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_in_values_are_not_replaced() {
        let values = [("{file}", "x/{block}{shift}/a.dxf"), ("{block}", "{file}"), ("{shift}", "-0.035")];
        for (word, wanted) in [
            ("{file}", "x/{block}{shift}/a.dxf"),
            ("--name={block},{shift}", "--name={file},-0.035"),
            ("{file}{file}", "x/{block}{shift}/a.dxfx/{block}{shift}/a.dxf"),
            ("{{block}}", "{{file}}"),
            ("{fil{block}", "{fil{file}"),
            ("{other} { }", "{other} { }"),
            ("a{", "a{"),
            ("", ""),
        ] {
            assert_eq!(filled(word, &values), wanted, "{word}");
        }
    }
}
