//! A job folder as a run reads it: from `manifest.json`, whose numbers are exact.

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;
use std::time::Duration;

use terrace_core::diag::{self, Diag, Error, Place};
use terrace_core::geom::Nm;
use terrace_core::machine::Machine;
use terrace_core::program::BlockId;
use terrace_input::job::Mode;
use terrace_plan::emit::{self, Files, TARGETS};
use terrace_plan::manifest::{
    BlockEntry, FileFact, Frames, Head, MANIFEST, Manifest, Registered, RegistrationEntry, SetupEntry,
};

/// Largest file of a block that is read.
const MAX_FILE: u64 = 1 << 32;

/// Largest manifest that is read.
pub(super) const MAX_MANIFEST: u64 = 1 << 30;

/// What is read of a job folder.
#[derive(Debug)]
pub(super) struct Folder {
    pub path: PathBuf,
    /// BLAKE3 of the manifest, hex.
    pub manifest: String,
    pub machine: Machine,
    /// Where the part's zero lies in the table frame in each set-up, mm.
    pub origins: Vec<[f64; 3]>,
    /// Registration points of each set-up.
    pub registration: Vec<Vec<Registered>>,
    /// The blocks to be marked, in machining order; of a resumed job those that are left.
    pub blocks: Vec<Block>,
    frames: Option<Frames>,
    /// Time for a block beyond its marks, s.
    between_s: f64,
    files: BTreeMap<String, FileFact>,
}

/// A block.
#[derive(Debug)]
pub(super) struct Block {
    pub id: String,
    /// From 1.
    pub setup: u32,
    /// Commanded positions of x, y and z, nm.
    pub stage: [i64; 3],
    /// Commanded angles of the tilt axes, millionths of a degree.
    pub tilt: [i64; 2],
    /// Where to lift to before the move, nm.
    pub lift: Option<i64>,
    /// nm.
    pub focus_shift: i64,
    pub estimate: Duration,
    /// The file that the laser takes, inside the folder.
    pub file: Option<String>,
    /// All its files by format.
    files: BTreeMap<String, String>,
}

impl Block {
    /// The block of an entry, without the file that the laser takes.
    ///
    /// # Errors
    /// What is wrong with it.
    fn from_entry(entry: BlockEntry) -> Result<Self, &'static str> {
        let nm = |mm: f64| Nm::from_mm(mm).map(|nm| nm.0).ok_or("a position is beyond all travel");
        let [x, y, z] = entry.stage.map(nm);
        let lift = entry.lift_z_mm.map(nm).transpose()?;
        Ok(Self {
            id: entry.id,
            setup: entry.setup,
            stage: [x?, y?, z?],
            tilt: entry.tilt_deg.map(|deg| (deg * 1e6).round() as i64),
            lift,
            focus_shift: nm(entry.focus_shift_mm)?,
            estimate: Duration::try_from_secs_f64(entry.time_s).map_err(|_| "the time of a block is not a duration")?,
            file: None,
            files: entry.files,
        })
    }
}

impl Folder {
    /// Reads the manifest of a stepped job.
    ///
    /// # Errors
    /// `run-mode` of an on-the-fly job; `manifest` and `file-…` where there is no readable manifest.
    pub fn read(path: &std::path::Path) -> Result<Self, Error> {
        let file = path.join(MANIFEST);
        let place = || Place::file(file.display().to_string());
        if Head::read(path)?.mode != Mode::Stepped {
            let d =
                Diag::input("run-mode", "this is an on-the-fly job, which its controller runs by itself").at(place());
            return Err(d.hint("run its program on the controller").into());
        }
        let bytes = diag::read_file(&file, MAX_MANIFEST)?;
        let unreadable = |why: String| {
            let d = Diag::input("run-manifest", format!("the manifest cannot be run: {why}")).at(place());
            Error::from(d.hint("compile the job again"))
        };
        let manifest: Manifest = Manifest::parse(path, &bytes)?;
        let count = manifest.blocks.len();
        let marks_s: f64 = manifest.blocks.iter().map(|b| b.time_s).sum();
        let between_s = ((manifest.summary.time_s.total - marks_s) / count.max(1) as f64).max(0.0);
        let blocks = manifest.blocks.into_iter().map(Block::from_entry).collect::<Result<Vec<Block>, _>>();
        let mut blocks = blocks.map_err(|why| unreadable(why.into()))?;
        if let Some(subset) = &manifest.subset {
            let held: BTreeSet<&String> = subset.blocks.iter().collect();
            blocks.retain(|b| held.contains(&b.id));
        }
        let points = |setup: &SetupEntry| setup.registration.iter().map(RegistrationEntry::registered).collect();
        let registration: Option<Vec<Vec<Registered>>> = manifest.setups.iter().map(points).collect();
        let setups = manifest.setups.len();
        if blocks.iter().any(|b| !(1..=setups).contains(&(b.setup as usize))) {
            return Err(unreadable("a block names a set-up that is not there".into()));
        }
        if blocks.is_empty() {
            return Err(unreadable("it has no blocks".into()));
        }
        Ok(Self {
            path: path.to_owned(),
            manifest: blake3::hash(&bytes).to_hex().to_string(),
            machine: manifest.machine,
            origins: manifest.setups.iter().map(|s| s.origin_mm).collect(),
            registration: registration.ok_or_else(|| unreadable("a registration point is beyond all travel".into()))?,
            blocks,
            frames: manifest.frames,
            between_s,
            files: manifest.head.files.into_iter().map(|f| (f.file.clone(), f)).collect(),
        })
    }

    /// BLAKE3 of program.txt, hex: that of the whole job, of what is left of one too.
    pub fn program(&self) -> Option<&str> {
        self.files.get("program.txt").map(|fact| fact.blake3.as_str())
    }

    /// Refuses a folder that was made anew since it was read.
    pub fn is_unchanged(&self) -> Result<(), Error> {
        let bytes = diag::read_file(&self.path.join(MANIFEST), MAX_MANIFEST)?;
        if blake3::hash(&bytes).to_hex().as_str() == self.manifest { Ok(()) } else { Err(changed(MANIFEST).into()) }
    }

    /// The formats of which every block has a file.
    pub fn formats(&self) -> Vec<&'static str> {
        let of_blocks = TARGETS.iter().filter(|t| matches!(t.stepped, Some(Files::Blocks(..))));
        of_blocks.map(|t| t.name()).filter(|name| self.blocks.iter().all(|b| b.files.contains_key(*name))).collect()
    }

    /// Chooses the files that the laser takes.
    ///
    /// # Errors
    /// `run-format` where the job has none of this format.
    pub fn choose_files(&mut self, format: Option<&'static str>) -> Result<(), Diag> {
        let held = self.formats();
        if let Some(format) = format
            && !held.contains(&format)
        {
            let text = format!("the laser driver takes {format} files, the job holds {}", list(&held));
            return Err(Diag::input("run-format", text)
                .at(Place::file(self.path.display().to_string()))
                .hint(format!("add \"{format}\" to emit.formats in the job file and compile again")));
        }
        // Without one that the laser takes, a file is still shown to the person.
        let shown = format.or(held.first().copied());
        for block in &mut self.blocks {
            block.file = shown.and_then(|name| block.files.get(name).cloned());
        }
        Ok(())
    }

    /// Takes the frames of some blocks in place of the blocks: those in these ranges, or of the outline where there are
    /// none. The stage lifts on its way to each.
    ///
    /// # Errors
    /// `run-frames` where the job has no frames, or not that one.
    pub fn choose_frames(&mut self, ranges: &[[BlockId; 2]]) -> Result<(), Diag> {
        let place = Place::file(self.path.display().to_string());
        let Some(frames) = &self.frames else {
            let d = Diag::input("run-frames", "the job has no frames").at(place);
            return Err(d.hint("name a pen for them as emit.frames in the job file and compile again"));
        };
        let id = |block: &Block| block.id.parse::<BlockId>().ok();
        let outline: BTreeSet<&String> = frames.outline.iter().collect();
        let is_within = |id: BlockId| ranges.iter().any(|[first, last]| (*first..=*last).contains(&id));
        for end in ranges.iter().flatten() {
            if !self.blocks.iter().any(|block| id(block) == Some(*end)) {
                let d = Diag::input("run-frames", format!("the folder holds no frame of block {end}")).at(place);
                return Err(d.hint("name blocks of the run sheet"));
            }
        }
        if ranges.is_empty() {
            self.blocks.retain(|block| outline.contains(&block.id));
        } else {
            self.blocks.retain(|block| id(block).is_some_and(is_within));
            self.registration.iter_mut().for_each(Vec::clear);
        }
        for block in &mut self.blocks {
            block.lift = Some(self.machine.retract_z().0);
            let ending = block.file.as_ref().and_then(|file| file.rsplit_once('.'));
            let name = block.id.parse::<BlockId>().ok().zip(ending);
            block.file = name.map(|(id, (_, ending))| emit::frames::of_block(id, ending));
        }
        Ok(())
    }

    /// The path of the file of a block, whose bytes are those that were verified.
    ///
    /// # Errors
    /// `run-file-changed` where they are not.
    pub fn file(&self, block: &Block) -> Result<Option<PathBuf>, Diag> {
        let Some(name) = &block.file else { return Ok(None) };
        let path = self.path.join(name);
        let bytes = diag::read_file(&path, MAX_FILE).map_err(|e| e.diags()[0].clone())?;
        let is_same = self.files.get(name).is_some_and(|f| blake3::hash(&bytes).to_hex().as_str() == f.blake3);
        if is_same { Ok(Some(path)) } else { Err(changed(name)) }
    }

    /// Estimated time of block `index` with the way to it.
    pub fn time(&self, index: usize) -> Duration {
        self.blocks[index].estimate + Duration::try_from_secs_f64(self.between_s).unwrap_or_default()
    }
}

/// Names of formats for a sentence.
pub(super) fn list(formats: &[&str]) -> String {
    if formats.is_empty() { "no files of single blocks".into() } else { formats.join(", ") }
}

fn changed(file: &str) -> Diag {
    Diag::limit("run-file-changed", format!("{file} is not what it was when the folder was verified"))
        .hint("see `terrace verify`; leave the folder alone while it is run")
}
