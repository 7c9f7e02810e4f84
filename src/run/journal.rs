//! The journal of an armed run: JSON lines, each on the disk before the next thing happens.
//!
//! Its first line names the manifest, so it counts for one compiled job only, wherever the folder lies
//! ([`super::elsewhere`]). A series of parts has one journal: another part begins with a line of its own. A block that has a `begin` and no `end`
//! is in doubt: the user settles it with `redo` or `skip`, which are lines as well. A last line without its line feed
//! was not written when its writer was killed, and nothing that follows it has happened: it is removed.

use std::collections::BTreeSet;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::Order;
use super::elsewhere;
use super::folder::Folder;
use super::log::{now_s, unwritable};
use crate::diag::{Diag, Error, Place};
use crate::job_folder::Durability;

/// Largest journal: a line for each begin and end of a million blocks.
const MAX_FILE: u64 = 256 << 20;

/// What the user says of the blocks that a journal holds.
#[derive(Clone, Copy, Debug, Default)]
pub struct Settled<'a> {
    /// To go on after those that have ended.
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
    /// The first line: what the journal is of.
    Run { terrace: String, manifest: String, machine: String, armed: bool },
    /// Another part of the series begins; its number, from 2.
    Part { number: u32 },
    /// A block is about to be marked.
    Begin { block: String },
    /// It is marked.
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
struct Found {
    /// The part of the series, from 1.
    part: u32,
    /// The manifest and the machine of the first line.
    of: Option<String>,
    done: Vec<String>,
    /// The same, to look them up.
    known: BTreeSet<String>,
    in_doubt: Option<String>,
}

/// The usual place: beside the folder, `hood.run.jsonl` for `hood.job`.
pub fn beside(folder: &Path) -> PathBuf {
    // By whatever link or path the folder is named.
    let whole = std::fs::canonicalize(folder).or_else(|_| std::path::absolute(folder));
    whole.unwrap_or_else(|_| folder.to_owned()).with_extension("run.jsonl")
}

impl Journal {
    /// Opens and locks the journal of an order, or begins one; answers with the blocks that are left, by number.
    ///
    /// # Errors
    /// Where another run holds it, it is of another job, or what it holds is not settled.
    pub(super) fn open(order: &Order<'_>, folder: &Folder) -> Result<(Self, Vec<usize>), Error> {
        let path = order.journal.map_or_else(|| beside(order.folder), Path::to_owned);
        // Whatever is no file, or larger than any journal, is not read.
        if let Ok(found) = path.metadata()
            && !(found.is_file() && found.len() <= MAX_FILE)
        {
            let text = "this is no journal: a regular file of at most 256 MB is wanted";
            let d = Diag::input("run-journal", text).at(Place::file(path.display().to_string()));
            return Err(d.hint("name another file with --journal").into());
        }
        let opened = File::options().create(true).read(true).append(true).open(&path);
        let mut journal = Self { file: opened.map_err(|e| unwritable(&path, &e))?, path, part: 1 };
        if matches!(journal.file.try_lock(), Err(std::fs::TryLockError::WouldBlock)) {
            let d = Diag::input("run-journal-locked", "another run of this job is in progress");
            return Err(journal.at(d).hint("wait for its end").into());
        }
        let mut found = journal.read()?;
        if !order.settled.again {
            elsewhere::refuse(&journal.path, order.folder, &folder.manifest)?;
        }
        elsewhere::note(&journal.path, &folder.manifest)?;
        if found.of.is_none() {
            // A new name is on the disk when its folder is.
            let whole = std::path::absolute(&journal.path).unwrap_or_else(|_| journal.path.clone());
            let flushed = whole.parent().map_or(Ok(()), |folder| Durability::Synced.flush()(folder));
            flushed.map_err(|e| unwritable(&journal.path, &e))?;
        }
        match &found.of {
            None => journal.write(Event::Run {
                terrace: env!("CARGO_PKG_VERSION").into(),
                manifest: folder.manifest.clone(),
                machine: folder.machine.name.clone(),
                armed: true,
            })?,
            Some(manifest) if *manifest != folder.manifest => {
                let d = Diag::input(
                    "run-journal-other",
                    "this journal belongs to another job, or to an earlier compilation of this one",
                );
                return Err(journal
                    .at(d)
                    .hint(format!(
                        "delete {} if that part is finished, or name another with --journal",
                        journal.path.display()
                    ))
                    .into());
            }
            Some(_) if order.settled.again => {
                let number = found.part + 1;
                journal.write(Event::Part { number })?;
                found.take(Event::Part { number });
            }
            Some(_) => {}
        }
        journal.part = found.part.max(1);
        if folder.blocks.iter().all(|b| found.is_done(&b.id)) {
            let d = Diag::input("run-finished", format!("all {} blocks of this job are done", folder.blocks.len()));
            return Err(journal.at(d).hint("to mark another part, run with --again").into());
        }
        let done: BTreeSet<String> = journal.settle(&found, &order.settled)?.into_iter().collect();
        let left = (0..folder.blocks.len()).filter(|&i| !done.contains(&folder.blocks[i].id)).collect();
        Ok((journal, left))
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
        let before = self.file.metadata().map_err(|e| unwritable(&self.path, &e))?.len();
        let written = self.file.write_all(&line).and_then(|()| self.file.sync_data());
        written.map_err(|e| {
            // Half a line would make the next one unreadable. Where even this fails, the file is read up to it.
            let _ = self.file.set_len(before);
            unwritable(&self.path, &e)
        })
    }

    /// Reads the lines, and removes a last one that was not completed.
    fn read(&mut self) -> Result<Found, Diag> {
        let mut text = String::new();
        let unreadable = |path: &Path, e| unwritable(path, &e);
        self.file.read_to_string(&mut text).map_err(|e| unreadable(&self.path, e))?;
        let whole = text.rfind('\n').map_or(0, |at| at + 1);
        if whole < text.len() {
            self.file.set_len(whole as u64).map_err(|e| unreadable(&self.path, e))?;
        }
        self.file.seek(SeekFrom::End(0)).map_err(|e| unreadable(&self.path, e))?;
        let mut found = Found::default();
        for (i, line) in text[..whole].lines().enumerate() {
            let wrong = || {
                Diag::input("run-journal", "this is not a line of a journal")
                    .at(Place::line(self.path.display().to_string(), i + 1))
                    .hint("name another file with --journal")
            };
            let Line { event, .. } = serde_json::from_str(line).map_err(|_| wrong())?;
            if found.of.is_none() != matches!(event, Event::Run { .. }) || !found.take(event) {
                return Err(wrong());
            }
        }
        Ok(found)
    }

    /// Which blocks are done, after what the user says of the block in doubt; that is written as well.
    fn settle(&mut self, found: &Found, settled: &Settled<'_>) -> Result<Vec<String>, Diag> {
        let mut done = found.done.clone();
        let count = done.len();
        let named = settled.redo.or(settled.skip);
        match &found.in_doubt {
            None if named.is_some() => {
                let block = named.unwrap_or_default();
                let d = Diag::input("run-settled", format!("block {block} is not in doubt: no block is"));
                return Err(self.at(d).hint("leave out --redo and --skip"));
            }
            None if done.is_empty() || settled.go_on => {}
            None => {
                let text = format!("{count} blocks are done by an earlier run, the last is {}", done[count - 1]);
                let hint = "no other block was begun: continue with --go-on; to mark another part, run with --again";
                return Err(self.at(Diag::input("run-go-on", text)).hint(hint));
            }
            Some(block) if !settled.go_on || named != Some(block) => {
                let text = format!(
                    "{count} blocks are done by an earlier run; block {block} was begun, and may be marked not at all, in \
                     part or completely"
                );
                let hint = format!(
                    "look at it, then continue with --go-on --redo {block} to mark it again, or with --go-on --skip \
                     {block} to count it as marked; to mark another part, run with --again"
                );
                return Err(self.at(Diag::input("run-in-doubt", text)).hint(hint));
            }
            Some(block) if settled.redo.is_some() => self.write(Event::Redo { block: block.clone() })?,
            Some(block) => {
                self.write(Event::Skip { block: block.clone() })?;
                done.push(block.clone());
            }
        }
        Ok(done)
    }

    fn at(&self, d: Diag) -> Diag {
        d.at(Place::file(self.path.display().to_string()))
    }
}

/// How many blocks a journal has as begun, if it is one of this manifest.
pub(super) fn begun(path: &Path, manifest: &str) -> Option<usize> {
    let found = path.metadata().ok().filter(|found| found.is_file() && found.len() <= MAX_FILE)?;
    let mut journal =
        Journal { file: File::open(path).ok().filter(|_| found.len() > 0)?, path: path.to_owned(), part: 1 };
    let mut text = String::new();
    journal.file.read_to_string(&mut text).ok()?;
    let mut all = Found::default();
    for line in text.lines() {
        let Ok(Line { event, .. }) = serde_json::from_str(line) else { break };
        all.take(event);
    }
    (all.of.as_deref() == Some(manifest)).then(|| all.done.len() + usize::from(all.in_doubt.is_some()))
}

impl Found {
    fn is_done(&self, block: &str) -> bool {
        self.known.contains(block)
    }

    /// Takes one more line; false where it cannot follow those before.
    fn take(&mut self, event: Event) -> bool {
        match event {
            Event::Run { manifest, .. } => (self.of, self.part) = (Some(manifest), 1),
            Event::Part { number } => {
                if number != self.part + 1 {
                    return false;
                }
                *self = Self { part: number, of: self.of.take(), ..Self::default() };
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
                self.known.insert(block.clone());
                self.done.push(block);
            }
            Event::Doubt { block } => {
                if self.in_doubt.is_some() || self.done.pop_if(|last| *last == block).is_none() {
                    return false;
                }
                self.known.remove(&block);
                self.in_doubt = Some(block);
            }
            Event::Redo { block } => return self.in_doubt.take() == Some(block),
            Event::Stop { .. } => {}
        }
        true
    }
}
