//! The journal of an armed run: JSON lines, each on the disk before the next thing happens.
//!
//! Its first line names the manifest, so it counts for one compiled job only, wherever the folder lies
//! (`super::elsewhere`). A series of parts has one journal: another part begins with a line of its own. A block that
//! has a `begin` and no `end` is in doubt: the user settles it with `redo` or `skip`, which are lines as well. A last
//! line without its line feed was not written when its writer was killed, and nothing that follows it has happened: it
//! is removed.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::{File, TryLockError};
use std::io::{BufRead, BufReader, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::folder::Folder;
use super::log::{now_s, unwritable};
use super::{Order, in_doubt};
use terrace_core::diag::{Diag, Error, Place};
use terrace_report::job_folder::Durability;

/// Largest journal: a line for each begin and end of a million blocks.
const MAX_FILE: u64 = 256 << 20;

/// Longest first line, bytes.
const MAX_HEAD: u64 = 4096;

/// What is to become of the blocks that a journal holds, as the user says.
#[derive(Clone, Copy, Debug, Default)]
pub struct JournalChoice<'a> {
    /// To continue after those that have ended.
    pub go_on: bool,
    /// The block in doubt is to be marked again.
    pub redo: Option<&'a str>,
    /// The block in doubt is to be taken as marked.
    pub skip: Option<&'a str>,
    /// Another part of the series is to be marked.
    pub again: bool,
}

#[derive(Debug, Serialize, Deserialize)]
#[serde(tag = "event", rename_all = "lowercase")]
enum Event {
    /// The first line: what the journal is of; `program` is BLAKE3 of program.txt, which what is left of a job shares with
    /// it (none in journals of 0.1.0).
    Run {
        terrace: String,
        manifest: String,
        #[serde(default)]
        program: Option<String>,
        machine: String,
        armed: bool,
    },
    /// Another part of the series begins; its number, from 2.
    Part { number: u32 },
    /// A block is about to be marked.
    Begin { block: String },
    /// The block is marked.
    End { block: String },
    /// The block that ended last is in doubt again: something was being marked after it.
    Doubt { block: String },
    /// The block in doubt is to be marked again.
    Redo { block: String },
    /// The block in doubt counts as marked.
    Skip { block: String },
    /// A run has ended with its outputs off; why.
    Stop { why: String },
}

#[derive(Debug, Serialize, Deserialize)]
struct Line {
    time_s: f64,
    #[serde(flatten)]
    event: Event,
}

/// A journal that is being written; locked against other runs.
#[derive(Debug)]
pub struct Journal {
    file: File,
    path: PathBuf,
    part: u32,
}

/// What the lines of a journal say together.
#[derive(Debug, Default)]
pub(super) struct Record {
    /// The part of the series, from 1.
    part: u32,
    /// When that part was begun, s since 1970.
    pub since_s: f64,
    /// The manifest that the first line names; None without one.
    pub manifest: Option<String>,
    /// The program that the first line names.
    program: Option<String>,
    /// The blocks that are done, in the order of their ends.
    done: Vec<String>,
    /// When the blocks ended that are done.
    ended_s: BTreeMap<String, f64>,
    in_doubt: Option<String>,
    /// When the last line was written, s since 1970.
    last_s: f64,
}

/// The usual place: beside the folder, `hood.run.jsonl` for `hood.job`.
pub fn beside(folder: &Path) -> PathBuf {
    // By whatever link or path the folder is named.
    let whole = dunce::canonicalize(folder).or_else(|_| std::path::absolute(folder));
    whole.unwrap_or_else(|_| folder.to_owned()).with_extension("run.jsonl")
}

impl Journal {
    /// Opens and locks a journal, or begins one; returns the numbers of the blocks that are left.
    ///
    /// # Errors
    /// Where another run holds it, it is of another job, or what it holds is not settled.
    pub(super) fn open(path: PathBuf, order: &Order<'_>, folder: &Folder) -> Result<(Self, Vec<usize>), Error> {
        let mut journal = Self::open_locked(path)?;
        let mut record = journal.read()?;
        match &record.manifest {
            None => journal.start(folder)?,
            Some(manifest) if *manifest != folder.manifest => return Err(journal.of_other_job().into()),
            Some(_) if order.journal_choice.again => {
                let number = record.part + 1;
                journal.write(Event::Part { number })?;
                record.take(now_s(), Event::Part { number });
            }
            Some(_) => {}
        }
        journal.part = record.part.max(1);
        if folder.blocks.iter().all(|b| record.is_done(&b.id)) {
            let d = Diag::input("run-finished", format!("all {} blocks of this job are done", folder.blocks.len()));
            return Err(journal.at(d).hint(format!("to mark another part: {}", order.command("--arm --again"))).into());
        }
        let done: BTreeSet<String> = journal.settle(&record, order)?.into_iter().collect();
        let left = (0..folder.blocks.len()).filter(|&i| !done.contains(&folder.blocks[i].id)).collect();
        Ok((journal, left))
    }

    /// Opens and locks the file, and makes it where it is not there.
    fn open_locked(path: PathBuf) -> Result<Self, Diag> {
        // Whatever is not a file, or larger than any journal, is not read.
        if let Ok(metadata) = path.metadata()
            && !(metadata.is_file() && metadata.len() <= MAX_FILE)
        {
            let text = "this is not a journal: a regular file of at most 256 MB is wanted";
            let d = Diag::input("run-journal", text).at(Place::file(path.display().to_string()));
            return Err(d.hint("name another file with --journal"));
        }
        // Not to append: on Windows a file that is open for that alone cannot be cut back.
        let opened = File::options().create(true).read(true).write(true).truncate(false).open(&path);
        let journal = Self { file: opened.map_err(|e| unwritable(&path, &e))?, path, part: 1 };
        match journal.file.try_lock() {
            Ok(()) => Ok(journal),
            Err(TryLockError::WouldBlock) => {
                let d = Diag::input("run-journal-locked", "another run of this job is in progress");
                Err(journal.at(d).hint("wait for its end"))
            }
            Err(TryLockError::Error(e)) => {
                let text = format!("the journal cannot be locked against a second run: {e}");
                let hint = "name one on a disk of this computer with --journal";
                Err(journal.at(Diag::input("run-lock", text)).hint(hint))
            }
        }
    }

    /// Writes the first line.
    fn start(&mut self, folder: &Folder) -> Result<(), Diag> {
        // A new name is on the disk when its folder is.
        let whole = std::path::absolute(&self.path).unwrap_or_else(|_| self.path.clone());
        let flushed = whole.parent().map_or(Ok(()), |folder| Durability::Synced.flush()(folder));
        flushed.map_err(|e| unwritable(&self.path, &e))?;
        self.write(Event::Run {
            terrace: env!("CARGO_PKG_VERSION").into(),
            manifest: folder.manifest.clone(),
            program: folder.program().map(str::to_owned),
            machine: folder.machine.name.clone(),
            armed: true,
        })
    }

    /// The fault of a journal that names another manifest.
    fn of_other_job(&self) -> Diag {
        let text = "this journal belongs to another job, or to an earlier compilation of this one";
        let shown = self.path.display();
        let hint = format!("delete {shown} if that part is finished, or name another with --journal");
        self.at(Diag::input("run-journal-other", text)).hint(hint)
    }

    /// The block is about to be marked.
    pub(super) fn begin(&mut self, block: &str) -> Result<(), Diag> {
        self.write(Event::Begin { block: block.into() })
    }
    /// The block is marked.
    pub(super) fn end(&mut self, block: &str) -> Result<(), Diag> {
        self.write(Event::End { block: block.into() })
    }
    /// The block that ended last is in doubt again.
    pub(super) fn doubt(&mut self, block: &str) -> Result<(), Diag> {
        self.write(Event::Doubt { block: block.into() })
    }
    /// The part of the series that is being marked, from 1.
    pub(super) fn part(&self) -> u32 {
        self.part
    }
    /// The run has ended.
    pub(super) fn stop(&mut self, why: &str) -> Result<(), Diag> {
        self.write(Event::Stop { why: why.into() })
    }

    /// Writes a line, and returns when it is on the disk.
    fn write(&mut self, event: Event) -> Result<(), Diag> {
        let mut line = serde_json::to_vec(&Line { time_s: now_s(), event }).expect("plain JSON");
        line.push(b'\n');
        let before = self.file.seek(SeekFrom::End(0)).map_err(|e| unwritable(&self.path, &e))?;
        let written = self.file.write_all(&line).and_then(|()| self.file.sync_data());
        written.map_err(|e| {
            // Half a line would make the next one unreadable. Where even this fails, the file is read up to it.
            let _ = self.file.set_len(before);
            unwritable(&self.path, &e)
        })
    }

    /// Reads the lines, and removes a last one that was not completed.
    fn read(&mut self) -> Result<Record, Diag> {
        let mut bytes = Vec::new();
        self.file.read_to_end(&mut bytes).map_err(|e| unwritable(&self.path, &e))?;
        // How many bytes the completed lines take. The last line may end within a character.
        let complete = bytes.iter().rposition(|&byte| byte == b'\n').map_or(0, |end| end + 1);
        if complete < bytes.len() {
            self.file.set_len(complete as u64).map_err(|e| unwritable(&self.path, &e))?;
        }
        let mut record = Record::default();
        for (i, line) in bytes[..complete].split_inclusive(|&byte| byte == b'\n').enumerate() {
            let Line { time_s, event } = serde_json::from_slice(line).map_err(|_| self.line_fault(i + 1))?;
            // The first line, and no other, is a `run`.
            if record.manifest.is_none() != matches!(event, Event::Run { .. }) || !record.take(time_s, event) {
                return Err(self.line_fault(i + 1));
            }
        }
        Ok(record)
    }

    /// The fault of a line that no run has written, or not after those before it.
    fn line_fault(&self, number: usize) -> Diag {
        Diag::input("run-journal", "this is not a line of a journal")
            .at(Place::line(self.path.display().to_string(), number))
            .hint("name another file with --journal")
    }

    /// Which blocks are done, after what the user says of the block in doubt; that is written as well.
    fn settle(&mut self, record: &Record, order: &Order<'_>) -> Result<Vec<String>, Diag> {
        let choice = &order.journal_choice;
        let mut done = record.done.clone();
        let count = done.len();
        let named = choice.redo.or(choice.skip);
        match &record.in_doubt {
            None if named.is_some() => {
                let block = named.unwrap_or_default();
                let d = Diag::input("run-settled", format!("block {block} is not in doubt: no block is"));
                return Err(self.at(d).hint("leave out --redo and --skip"));
            }
            None if done.is_empty() || choice.go_on => {}
            None => {
                let text = format!("{} by an earlier run, the last is {}", blocks_are_done(count), done[count - 1]);
                let hint = format!(
                    "no other block was begun: to continue with that part: {}; to mark another part: {}",
                    order.command("--arm --go-on"),
                    order.command("--arm --again")
                );
                return Err(self.at(Diag::input("run-go-on", text)).hint(hint));
            }
            Some(block) if !choice.go_on || named != Some(block) => {
                let text = format!(
                    "{} by an earlier run; block {block} was begun, and may be marked not at all, in part or completely",
                    blocks_are_done(count)
                );
                let hint =
                    format!("{}; to mark another part: {}", in_doubt(order, block), order.command("--arm --again"));
                return Err(self.at(Diag::input("run-in-doubt", text)).hint(hint));
            }
            Some(block) if choice.redo.is_some() => self.write(Event::Redo { block: block.clone() })?,
            Some(block) => {
                self.write(Event::Skip { block: block.clone() })?;
                done.push(block.clone());
            }
        }
        Ok(done)
    }

    /// A diagnostic with the journal as its place.
    fn at(&self, d: Diag) -> Diag {
        d.at(Place::file(self.path.display().to_string()))
    }
}

fn blocks_are_done(count: usize) -> String {
    if count == 1 { "1 block is done".into() } else { format!("{count} blocks are done") }
}

/// How many blocks a journal has as begun on its last part; None where it is not of this manifest or nothing was begun.
pub(super) fn begun(path: &Path, manifest: &str) -> Option<usize> {
    let record = record_of(path, manifest)?;
    let count = record.done.len() + usize::from(record.in_doubt.is_some());
    (count > 0 || record.part > 1).then_some(count)
}

/// The blocks that a journal has as done on its last part; none where it is not of this manifest.
pub(super) fn done(path: &Path, manifest: &str) -> Vec<String> {
    record_of(path, manifest).map(|record| record.done).unwrap_or_default()
}

/// What a journal says; None where it is not of this manifest.
pub(super) fn record_of(path: &Path, manifest: &str) -> Option<Record> {
    record_with(path, |record| record.manifest.as_deref() == Some(manifest))
}

/// What a journal says; None where it is not of this program.
pub(super) fn record_of_program(path: &Path, program: &str) -> Option<Record> {
    record_with(path, |record| record.program.as_deref() == Some(program))
}

/// What a journal says whose first line is wanted.
fn record_with(path: &Path, is_wanted: impl Fn(&Record) -> bool) -> Option<Record> {
    path.metadata().ok().filter(|metadata| metadata.is_file() && metadata.len() <= MAX_FILE)?;
    let mut lines = BufReader::new(File::open(path).ok()?);
    let parsed = |line: &[u8]| serde_json::from_slice(line).ok().map(|Line { time_s, event }| (time_s, event));
    let mut head = Vec::new();
    // Whatever else ends like a journal is not read whole.
    lines.by_ref().take(MAX_HEAD).read_until(b'\n', &mut head).ok()?;
    let mut record = Record::default();
    let (time_s, event) = parsed(&head)?;
    record.take(time_s, event);
    if !is_wanted(&record) {
        return None;
    }
    lines.split(b'\n').map_while(|line| parsed(&line.ok()?)).for_each(|(time_s, event)| {
        record.take(time_s, event);
    });
    Some(record)
}

impl Record {
    pub(super) fn is_done(&self, block: &str) -> bool {
        self.ended_s.contains_key(block)
    }

    /// The blocks of the last part that were marked from a time on, or may have been.
    pub(super) fn marked_since(&self, time_s: f64) -> impl Iterator<Item = &str> {
        let done = self.done.iter().filter(move |block| self.ended_s.get(*block).is_some_and(|&s| s >= time_s));
        done.chain(self.in_doubt.iter().filter(move |_| self.last_s >= time_s)).map(String::as_str)
    }

    /// Takes one more line; false where it cannot follow those before.
    fn take(&mut self, time_s: f64, event: Event) -> bool {
        self.last_s = time_s;
        match event {
            Event::Run { manifest, program, .. } => {
                *self = Self { part: 1, since_s: time_s, manifest: Some(manifest), program, ..Self::default() };
            }
            Event::Part { number } => {
                if number != self.part + 1 {
                    return false;
                }
                let (manifest, program) = (self.manifest.take(), self.program.take());
                *self = Self { part: number, since_s: time_s, manifest, program, ..Self::default() };
            }
            Event::Begin { block } => {
                if self.in_doubt.is_some() || self.is_done(&block) {
                    return false;
                }
                self.in_doubt = Some(block);
            }
            Event::End { block } | Event::Skip { block } => {
                if self.in_doubt.take().as_ref() != Some(&block) {
                    return false;
                }
                self.ended_s.insert(block.clone(), time_s);
                self.done.push(block);
            }
            Event::Doubt { block } => {
                if self.in_doubt.is_some() || self.done.pop_if(|last| *last == block).is_none() {
                    return false;
                }
                self.ended_s.remove(&block);
                self.in_doubt = Some(block);
            }
            Event::Redo { block } => return self.in_doubt.take() == Some(block),
            Event::Stop { .. } => {}
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What lines say together; None where one cannot follow.
    fn found(lines: &[&str]) -> Option<Record> {
        let mut record = Record::default();
        let head = r#"{"time_s":1,"event":"run","terrace":"0","manifest":"ab","machine":"m","armed":true}"#;
        let all = std::iter::once(head.to_owned()).chain(lines.iter().map(|line| {
            let (event, value) = line.split_once(' ').expect("an event and its value");
            match value.parse::<u32>() {
                Ok(number) => format!(r#"{{"time_s":1,"event":"{event}","number":{number}}}"#),
                Err(_) => format!(r#"{{"time_s":1,"event":"{event}","block":"{value}","why":"{value}"}}"#),
            }
        }));
        let mut lines = all.map(|line| serde_json::from_str::<Line>(&line).expect("a line"));
        lines.all(|line| record.take(line.time_s, line.event)).then_some(record)
    }

    #[test]
    fn a_last_line_that_ends_within_a_character_is_cut_off_and_written_over() {
        let dir = tempfile::tempdir().expect("a folder");
        let path = dir.path().join("part.run.jsonl");
        let run = |machine: &str| {
            let line = r#"{"time_s":1,"event":"run","terrace":"0","manifest":"ab","machine":"M","armed":true}"#;
            line.replace('M', machine) + "\n"
        };
        let stop = "{\"time_s\":2,\"event\":\"stop\",\"why\":\"Störung".as_bytes();
        let whole = [run("Gerät").as_bytes(), &stop[..stop.len() - "rung".len() - 1]].concat();
        assert!(std::str::from_utf8(&whole).is_err());
        std::fs::write(&path, &whole).expect("written");
        let mut journal = Journal::open_locked(path.clone()).expect("opened");
        assert_eq!(journal.read().expect("read").manifest.as_deref(), Some("ab"));
        journal.begin("B0001").expect("written");
        let text = std::fs::read_to_string(&path).expect("UTF-8");
        let lines: Vec<&str> = text.lines().collect();
        assert!(lines.len() == 2 && lines[0] == run("Gerät").trim_end() && lines[1].contains("B0001"), "{text}");
    }

    #[test]
    fn a_block_is_in_doubt_from_its_begin_and_again_where_something_was_marked_after_it() {
        let of = |lines: &[&str]| found(lines).map(|f| (f.done, f.in_doubt));
        let names = |all: &[&str]| all.iter().map(|b| (*b).to_owned()).collect::<Vec<_>>();
        assert_eq!(of(&["begin B1"]), Some((vec![], Some("B1".into()))));
        assert_eq!(of(&["begin B1", "end B1", "begin B2", "end B2"]), Some((names(&["B1", "B2"]), None)));
        let doubted = ["begin B1", "end B1", "begin B2", "end B2", "doubt B2", "stop x"];
        assert_eq!(of(&doubted), Some((names(&["B1"]), Some("B2".into()))));
        assert_eq!(of(&[&doubted[..], &["redo B2", "begin B2"]].concat()), Some((names(&["B1"]), Some("B2".into()))));
        assert_eq!(of(&[&doubted[..], &["skip B2"]].concat()), Some((names(&["B1", "B2"]), None)));
        // Only the one that ended last, and only while none is in doubt.
        for wrong in [&["doubt B1"][..], &["begin B1", "doubt B1"], &["begin B1", "end B1", "begin B2", "doubt B1"]] {
            assert_eq!(of(wrong), None, "{wrong:?}");
        }
        assert_eq!(of(&["begin B1", "end B1", "begin B2", "end B2", "doubt B1"]), None);
        assert_eq!(of(&["begin B1", "end B1", "begin B1"]), None, "twice on one part");
    }

    #[test]
    fn another_part_begins_with_nothing_done_and_is_counted() {
        let series =
            found(&["begin B1", "end B1", "part 2", "begin B1", "end B1", "begin B2", "part 3"]).expect("parts");
        assert_eq!(
            (series.part, series.done.len(), series.in_doubt, series.manifest.as_deref()),
            (3, 0, None, Some("ab"))
        );
        for wrong in [&["part 1"][..], &["part 3"], &["part 2", "part 2"]] {
            assert!(found(wrong).is_none(), "{wrong:?}");
        }
    }

    #[test]
    fn begun_journals_are_recognised_by_their_manifest() {
        let dir = tempfile::tempdir().expect("a folder");
        let path = dir.path().join("a.run.jsonl");
        let head = r#"{"time_s":1,"event":"run","terrace":"0","manifest":"ab","machine":"m","armed":true}"#;
        let (begin, end) =
            (r#"{"time_s":1,"event":"begin","block":"B1"}"#, r#"{"time_s":1,"event":"end","block":"B1"}"#);
        for (lines, count) in [
            (vec![], None),
            (vec!["no journal"], None),
            (vec![head], None),
            (vec![head, begin], Some(1)),
            (vec![head, begin, end], Some(1)),
            // The end of a line that was not completed.
            (vec![head, begin, end, r#"{"time_s":1,"ev"#], Some(1)),
            (vec![head, r#"{"time_s":1,"event":"part","number":2}"#], Some(0)),
        ] {
            std::fs::write(&path, lines.join("\n")).expect("written");
            assert_eq!(begun(&path, "ab"), count, "{lines:?}");
            let is_done = lines.len() >= 3 && lines[2].contains("end");
            assert_eq!(done(&path, "ab"), if is_done { vec!["B1"] } else { vec![] }, "{lines:?}");
            assert_eq!(begun(&path, "cd"), None, "{lines:?}");
        }
        assert_eq!(begun(dir.path(), "ab"), None);
        assert_eq!(begun(&dir.path().join("none"), "ab"), None);
    }
}
