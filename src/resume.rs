//! What is left of a job that was marked in part, as a job folder of its own.
//!
//! Everything comes from the folder itself, not from the job's inputs: a part that is half marked must be finished with
//! the same marks, whatever has become of the job file since. `program.txt` and the files of the blocks are copied byte
//! for byte. Stage programs, OVF, run sheets and pictures are made anew for the blocks that are left, under their own
//! names; every block that does not follow on the one before it is entered by a lift. The manifest is that of the job
//! with `subset`, by which `terrace verify` knows what to expect.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use terrace_core::diag::{self, Diag, Error, Place};
use terrace_core::format::Format;
use terrace_core::geom::Nm;
use terrace_core::program::{BlockFigures, BlockId, PenId, Program, text};
use terrace_core::progress::Task;
use terrace_input::job::Mode;
use terrace_plan::check::Checked;
use terrace_plan::emit::{Files, Stepped, TARGETS, Target, block_file};
use terrace_plan::manifest::{
    self, FileFact, Frames, Head, MANIFEST, Manifest, Registered, RegistrationEntry, SetupEntry, Subset,
};
use terrace_plan::plan;
use terrace_report::job_folder::{self, Durability, Filling, Programs};
use terrace_report::report;
use terrace_report::report::runsheet::{self, Sheet};

/// Which blocks are left; every choice takes some away.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct BlockChoice {
    /// The first of them.
    pub from: Option<BlockId>,
    /// Ranges of them, first and last.
    pub only: Vec<[BlockId; 2]>,
    /// Blocks that are marked already.
    pub done: BTreeSet<BlockId>,
    /// Blocks that runs have marked, by journal: none of them may be left.
    pub marked: Vec<MarkedBlocks>,
}

/// Blocks that runs have marked.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MarkedBlocks {
    /// The journal of the runs.
    pub journal: PathBuf,
    /// Their names.
    pub blocks: BTreeSet<String>,
}

impl BlockChoice {
    fn takes(&self, id: BlockId) -> bool {
        self.from.is_none_or(|from| id >= from)
            && (self.only.is_empty() || self.only.iter().any(|[first, last]| (*first..=*last).contains(&id)))
            && !self.done.contains(&id)
    }

    /// Every block that it names.
    fn named(&self) -> impl Iterator<Item = BlockId> + '_ {
        self.from.into_iter().chain(self.only.iter().flatten().copied()).chain(self.done.iter().copied())
    }
}

/// Largest list of finished blocks, bytes.
const MAX_LIST: u64 = 64 << 20;

/// The blocks that a file lists as finished: names apart by blanks, tabs, commas, semicolons or line breaks. `#` begins
/// a comment, which ends with its line.
///
/// # Errors
/// `resume-done` with the line.
pub fn listed(path: &Path) -> Result<BTreeSet<BlockId>, Error> {
    let bytes = diag::read_file(path, MAX_LIST)?;
    let text = diag::utf8(bytes)
        .map_err(|e| e.at(Diag::input("resume-done", format!("the list is {e}")), path.display().to_string()))?;
    let mut blocks = BTreeSet::new();
    // Windows PowerShell writes a byte order mark.
    let text = text.strip_prefix('\u{feff}').unwrap_or(&text);
    for (i, line) in text.lines().enumerate() {
        let line = line.split('#').next().unwrap_or_default();
        for word in line.split([' ', '\t', ',', ';', '\r']).filter(|w| !w.is_empty()) {
            let id = word.parse().map_err(|what: String| {
                Diag::input("resume-done", what)
                    .at(Place::line(path.display().to_string(), i + 1))
                    .hint("list the names of finished blocks, such as B0001")
            })?;
            blocks.insert(id);
        }
    }
    Ok(blocks)
}

/// A range of blocks, such as `B0200-B0210`, or one block.
///
/// # Errors
/// What is wrong with the text.
pub fn range(text: &str) -> Result<[BlockId; 2], String> {
    let (first, last) = text.split_once('-').unwrap_or((text, text));
    let range: [BlockId; 2] = [first.parse()?, last.parse()?];
    if range[0] > range[1] { Err(format!("{first} comes after {last}")) } else { Ok(range) }
}

/// How much of a job was left.
#[derive(Clone, Debug, PartialEq)]
pub struct Resumed {
    /// The blocks that are left.
    pub subset: Subset,
    /// How many blocks the whole job has.
    pub of: usize,
}

/// A job folder as it lies on the disk.
struct WholeJob<'a> {
    folder: &'a Path,
    manifest: Manifest,
    formats: Vec<&'static Target>,
}

/// Writes the folder `target` with the blocks of the folder `whole` that the choice leaves.
///
/// # Errors
/// `resume-changed` where a file of the folder is not as it was written, `resume-mode` of an on-the-fly job,
/// `resume-block` where the choice names a block that the folder does not hold, `resume-empty` where nothing is left,
/// `resume-marked` where a run has marked what is left, and those of [`job_folder::prepare`].
pub fn resume(folder: &Path, choice: &BlockChoice, target: &Path, durability: Durability) -> Result<Resumed, Error> {
    let whole = WholeJob::read(folder)?;
    if is_same(folder, target) {
        let d = Diag::input("output-is-input", "the output would replace the folder that it is made from");
        return Err(d.at(place(target)).hint("name another folder with -o").into());
    }
    job_folder::prepare(target, Mode::Stepped)?;
    let name = folder.join("program.txt");
    let (program, origins) = text::parse(&name.display().to_string(), &diag::read_file(&name, u64::MAX)?)?;
    let chosen = whole.chosen(&program, choice)?;
    for marked in &choice.marked {
        refuse_marked(chosen.iter().map(|&i| program.id(i).to_string()), marked)?;
    }
    let count = program.blocks.len();
    if whole.manifest.blocks.len() != count {
        let text = format!("the manifest lists {} blocks, program.txt has {count}", whole.manifest.blocks.len());
        let d = Diag::input("manifest", text).at(place(&folder.join(MANIFEST)));
        return Err(d.hint("restore the job folder from a copy").into());
    }
    let figures: Vec<BlockFigures> = chosen
        .iter()
        .map(|&i| BlockFigures { time_s: whole.manifest.blocks[i].time_s, ..BlockFigures::default() })
        .collect();
    let lifts = (0..count).map(|i| i == 0 || program.blocks[i].retract).collect();
    let checked = Checked::as_written(program.subset(&chosen), origins);
    let subset = whole.subset(checked.program());
    let rest = RemainingJob { whole: &whole, lifts, chosen: &chosen, figures, checked, subset };
    let job_file = job_folder::path_from(&folder.join(&whole.manifest.head.job.file), target)?;
    job_folder::replace_stepped(target, durability, &|filling| rest.write(filling, &job_file))?;
    Ok(Resumed { subset: rest.subset, of: count })
}

/// Refuses to leave blocks that runs have marked: a run of the rest has a journal of its own, and would mark them again.
fn refuse_marked(left: impl Iterator<Item = String>, marked: &MarkedBlocks) -> Result<(), Error> {
    let again: Vec<String> = left.filter(|id| marked.blocks.contains(id)).collect();
    let (Some(first), Some(last)) = (again.first(), again.last()) else { return Ok(()) };
    let text = format!("{} of these blocks, {first} to {last}, are marked already by a run of this job", again.len());
    let hint = "leave them out with --from, --only or --done; to mark them on another part add --again";
    Err(Diag::input("resume-marked", text).at(place(&marked.journal)).hint(hint).into())
}

/// Whether two paths lead to one folder that is there.
fn is_same(a: &Path, b: &Path) -> bool {
    fs::canonicalize(a).ok().zip(fs::canonicalize(b).ok()).is_some_and(|(a, b)| a == b)
}

fn place(path: &Path) -> Place {
    Place::file(path.display().to_string())
}

impl<'a> WholeJob<'a> {
    fn read(folder: &'a Path) -> Result<Self, Error> {
        let head = Head::read(folder)?;
        if head.mode == Mode::OnTheFly {
            let d = Diag::input("resume-mode", "an on-the-fly program cannot be begun in the middle").at(place(folder));
            return Err(d.hint("mark the job with mode = \"stepped\" to resume it by blocks").into());
        }
        for fact in &head.files {
            let path = folder.join(&fact.file);
            let bytes = diag::read_file(&path, u64::MAX)?;
            if blake3::hash(&bytes).to_hex().to_string() != fact.blake3 {
                let d = Diag::limit("resume-changed", "the file is not as it was written").at(place(&path));
                return Err(d.hint("restore the job folder from a copy: a changed one is not resumed").into());
            }
        }
        let manifest: Manifest = Manifest::read(folder)?;
        if manifest.setups.iter().flat_map(|s| &s.registration).any(|r| r.registered().is_none()) {
            let d =
                Diag::input("manifest", "a registration point is beyond all travel").at(place(&folder.join(MANIFEST)));
            return Err(d.hint("restore the job folder from a copy").into());
        }
        let formats = TARGETS.iter().filter(|t| match t.stepped {
            Some(Files::Whole(name, _)) => head.files.iter().any(|f| f.file == name),
            Some(Files::Blocks(..)) => manifest.blocks.iter().any(|b| b.files.contains_key(t.name())),
            None => false,
        });
        let formats = formats.collect();
        Ok(Self { folder, manifest, formats })
    }

    /// The places in the program of the blocks that are left.
    fn chosen(&self, program: &Program, choice: &BlockChoice) -> Result<Vec<usize>, Error> {
        let held: Option<BTreeSet<&str>> =
            self.manifest.subset.as_ref().map(|s| s.blocks.iter().map(String::as_str).collect());
        let ids = (0..program.blocks.len()).map(|i| program.id(i));
        let ids: Vec<BlockId> =
            ids.filter(|id| held.as_ref().is_none_or(|held| held.contains(id.to_string().as_str()))).collect();
        let whole = program.blocks.len();
        if let Some(id) = choice.named().find(|id| id.index() >= whole) {
            let d = Diag::input("resume-block", format!("the job has no block {id}")).at(place(self.folder));
            return Err(d
                .hint(format!("its blocks are {} to {}", BlockId::new(0), BlockId::new(whole.max(1) - 1)))
                .into());
        }
        // What is marked may lie outside of a rest; what is asked for may not.
        let asked = choice.from.into_iter().chain(choice.only.iter().flatten().copied());
        if let Some(id) = asked.into_iter().find(|id| ids.binary_search(id).is_err()) {
            let d = Diag::input("resume-block", format!("the folder does not hold block {id}")).at(place(self.folder));
            return Err(d.hint("name blocks of its run sheet, or resume from the folder of the whole job").into());
        }
        let chosen: Vec<usize> = ids.into_iter().filter(|&id| choice.takes(id)).map(BlockId::index).collect();
        if chosen.is_empty() {
            let d = Diag::input("resume-empty", "no block is left").at(place(self.folder));
            return Err(d.hint("check --from, --only and --done").into());
        }
        Ok(chosen)
    }

    /// What the manifest says of a program with the blocks that are left.
    fn subset(&self, program: &Program) -> Subset {
        let machine = &self.manifest.machine;
        let time_s = plan::of_program(machine, program).total;
        let blocks = program.blocks.len();
        Subset {
            blocks: (0..blocks).map(|i| program.id(i).to_string()).collect(),
            stops: program.stops(),
            mark_mm: program.blocks.iter().map(|b| program.mark_mm(b)).sum(),
            time_s,
            total_s: self.manifest.summary.loading.of_blocks(blocks, time_s).total_s,
        }
    }
}

/// What is left, and what it is written from.
struct RemainingJob<'a> {
    whole: &'a WholeJob<'a>,
    /// Whether the stage lifts on its way to each block of the whole job.
    lifts: Vec<bool>,
    chosen: &'a [usize],
    figures: Vec<BlockFigures>,
    checked: Checked,
    subset: Subset,
}

impl RemainingJob<'_> {
    /// Fills the new folder; returns its manifest.
    fn write(&self, mut filling: Filling<'_>, job_file: &str) -> Result<Vec<u8>, Error> {
        let Self { whole, checked, .. } = self;
        let copied = |name: &str| diag::read_file(&whole.folder.join(name), u64::MAX);
        filling.put("program.txt", &copied("program.txt")?)?;
        let formats: Vec<Format> = whole.formats.iter().map(|t| t.format).collect();
        let job = name_of(&whole.manifest.head.job.file);
        let part = self.surface().map_or_else(String::new, |f| name_of(&f));
        let emitted = Stepped {
            checked,
            machine: &whole.manifest.machine,
            figures: &self.figures,
            job: &job,
            part: &part,
            block_file: block_file(&formats),
            frames: None,
        };
        let points = self.registration_points();
        let frames = self.frame_pen().map(|pen| (pen, points.as_slice()));
        let programs = Programs { emitted, formats: &formats, frames, whole: Some(whole.folder) };
        programs.write(&mut filling, [Task::silent(), Task::silent()])?;
        for FileFact { file, .. } in &whole.manifest.head.files {
            let shown: fn(&Self, &str) -> String = match file.as_str() {
                VIEW => Self::view,
                REPORT => Self::report,
                picture if picture.ends_with(".svg") => Self::picture,
                _ => continue,
            };
            filling.put(file, shown(self, &String::from_utf8_lossy(&copied(file)?)).as_bytes())?;
        }
        let sheet = self.sheet(job_file);
        filling.put("runsheet.csv", &runsheet::csv(&sheet))?;
        filling.put("runsheet.txt", &runsheet::txt(&sheet))?;
        Ok(self.manifest(job_file, filling.into_files()))
    }

    /// The pen that draws the frames; None where the job has none.
    fn frame_pen(&self) -> Option<PenId> {
        let name = &self.whole.manifest.frames.as_ref()?.pen;
        let pen = self.checked.program().pens.iter().position(|pen| pen.name == *name)?;
        Some(PenId(pen as u16))
    }

    /// Commanded x and y of the registration points of every set-up.
    fn registration_points(&self) -> Vec<Vec<[Nm; 2]>> {
        let setups = self.whole.manifest.setups.iter();
        setups.map(|s| registered(s).into_iter().map(|r| r.at).collect()).collect()
    }

    /// The surface file, as the manifest names it.
    fn surface(&self) -> Option<String> {
        self.whole.manifest.head.inputs.iter().find(|i| i.role == "surface").map(|i| i.file.clone())
    }

    fn sheet<'a>(&'a self, job_file: &'a str) -> Sheet<'a> {
        let manifest = &self.whole.manifest;
        let has_setups = manifest.setups.len() > 1 || manifest.setups.iter().any(|s| !s.registration.is_empty());
        let second = manifest.passes.get(1).map_or([0.0; 2], |pass| [pass.lowered_mm, pass.turn_deg]);
        Sheet {
            job_file,
            surface: self.surface().unwrap_or_default(),
            machine: &manifest.machine,
            turn_deg: manifest.placement.turn_deg,
            laid_deg: manifest.placement.laid_deg,
            measured: manifest.placement.measured.clone(),
            fixtures: manifest.fixtures.clone(),
            per_pass: second,
            formats: self.whole.formats.iter().map(|t| t.format).collect(),
            registration: has_setups.then(|| manifest.setups.iter().map(registered).collect()),
            checked: &self.checked,
            depth_mm: manifest.focus.depth_range_mm,
            figures: self.figures.clone(),
            summary: &manifest.summary,
            frames: manifest.frames.as_ref().map(|frames| frames.pen.clone()),
            subset: Some(&self.subset),
        }
    }

    /// A picture of the whole job with the blocks that are not left in grey.
    fn picture(&self, svg: &str) -> String {
        let left: BTreeSet<usize> = self.chosen.iter().copied().collect();
        let gone = (0..self.whole.manifest.blocks.len()).filter(|i| !left.contains(i));
        let gone: Vec<String> = gone.map(|i| format!("#block-{}", BlockId::new(i))).collect();
        let style = match gone.is_empty() {
            true => String::new(),
            false => format!("<style>{}{{fill:#eee;stroke:#ccc}}</style>\n", gone.join(",")),
        };
        let sentence = self.left();
        // A picture of a rest says what was left there.
        let lines = svg.lines().filter(|line| !line.ends_with("blocks are left</text>"));
        let svg: String = lines.map(without_rest).collect();
        let drawn = svg.replacen("</title>\n", &format!(": {sentence}</title>\n{style}"), 1);
        let end = drawn.rfind("</svg>").unwrap_or(drawn.len());
        let (before, after) = drawn.split_at(end);
        format!("{before}{}{after}", caption(&svg, &sentence).unwrap_or_default())
    }

    /// The report of the whole job, which says first what is left of it.
    fn report(&self, page: &str) -> String {
        report::of_rest(page, &self.left())
    }

    /// How much is left, in words.
    fn left(&self) -> String {
        format!("{} of {} blocks are left", self.chosen.len(), self.whole.manifest.blocks.len())
    }

    /// The view of the whole job, which shows the blocks that are left.
    fn view(&self, page: &str) -> String {
        const HEAD: &str = "<script id=\"head\" type=\"application/json\">{";
        let Some((before, after)) = page.split_once(HEAD) else { return page.to_owned() };
        // That of a rest says already what was left there.
        let after = match after.strip_prefix("\"left\":[") {
            Some(rest) => rest.split_once("],").map_or(after, |(_, rest)| rest),
            None => after,
        };
        let left: Vec<String> = self.chosen.iter().map(|&i| format!("\"{}\"", BlockId::new(i))).collect();
        format!("{before}{HEAD}\"left\":[{}],{after}", left.join(","))
    }

    /// The manifest of the whole job, with the files of this folder and the blocks that it holds.
    fn manifest(&self, job_file: &str, files: Vec<FileFact>) -> Vec<u8> {
        let mut manifest = self.whole.manifest.clone();
        let program = self.checked.program();
        let machine = &self.whole.manifest.machine;
        manifest.head.job.file = job_file.into();
        manifest.head.files = files;
        let mut left = self.chosen.iter().enumerate().peekable();
        for (i, entry) in manifest.blocks.iter_mut().enumerate() {
            match left.next_if(|(_, place)| **place == i) {
                Some((at, _)) => {
                    debug_assert_eq!(entry.id, program.id(at).to_string());
                    entry.lift_z_mm = manifest::lift_mm(machine, &self.checked, at);
                }
                None => {
                    entry.files.clear();
                    entry.lift_z_mm = self.lifts[i].then(|| machine.retract_z().mm());
                }
            }
        }
        manifest.subset = Some(self.subset.clone());
        manifest.frames = manifest.frames.map(|frames| Frames::new(&frames.pen, &self.checked, machine));
        manifest.bytes()
    }
}

/// The registration points of a set-up.
fn registered(setup: &SetupEntry) -> Vec<Registered> {
    setup.registration.iter().filter_map(RegistrationEntry::registered).collect()
}

/// A line of a picture with its end; where it is the title of a rest, that of the whole job.
fn without_rest(line: &str) -> String {
    match line.strip_suffix(" blocks are left</title>").and_then(|l| l.rsplit_once(": ")) {
        Some((title, _)) => format!("{title}</title>\n"),
        None => format!("{line}\n"),
    }
}

/// The page that shows a job in three dimensions.
const VIEW: &str = "view.html";

/// The record of a job.
const REPORT: &str = "report.html";

/// Words at the lower edge of a picture.
fn caption(svg: &str, words: &str) -> Option<String> {
    let view = svg.split_once("viewBox=\"")?.1.split_once('"')?.0;
    let view: Vec<f64> = view.split_whitespace().map_while(|v| v.parse().ok()).collect();
    let &[x, y, w, h] = view.as_slice() else { return None };
    // In the rim below everything else, as high as the smallest text of the picture.
    let (x, y, size) = (x + 0.5 * w, y + h - 0.005 * w, 0.0147 * w);
    Some(format!("<text x=\"{x:.2}\" y=\"{y:.2}\" font-size=\"{size:.2}\" text-anchor=\"middle\">{words}</text>\n"))
}

fn name_of(file: &str) -> String {
    PathBuf::from(file).file_name().map_or_else(String::new, |n| n.to_string_lossy().into_owned())
}
