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

use serde::Deserialize;
use serde_json::Value;

use crate::check::Checked;
use crate::diag::{self, Diag, Error, Place};
use crate::emit::{Files, Stepped, TARGETS, Target, block_file, frames};
use crate::geom::Nm;
use crate::job::Mode;
use crate::job_folder::{self, Durability};
use crate::machine::Machine;
use crate::manifest::{self, FileFact, Frames, Head, MANIFEST, Registered, Subset, Summary};
use crate::plan;
use crate::program::{BlockFigures, BlockId, PenId, Program, text};
use crate::report::runsheet::{self, Sheet};

/// Which blocks are left; every choice takes some away.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Choice {
    /// The first of them.
    pub from: Option<BlockId>,
    /// Ranges of them, first and last.
    pub only: Vec<[BlockId; 2]>,
    /// Blocks that are marked already.
    pub done: BTreeSet<BlockId>,
}

impl Choice {
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

/// The blocks that a text names: one after another, apart by white space or commas, `#` begins a comment.
///
/// # Errors
/// `resume-done` with the line.
pub fn listed(path: &Path) -> Result<BTreeSet<BlockId>, Error> {
    let bytes = diag::read_file(path, 64 << 20)?;
    let text = diag::utf8(bytes)
        .map_err(|e| e.at(Diag::input("resume-done", format!("the list is {e}")), path.display().to_string()))?;
    let mut out = BTreeSet::new();
    for (i, line) in text.lines().enumerate() {
        let line = line.split('#').next().unwrap_or_default();
        for word in line.split([' ', '\t', ',', ';', '\r']).filter(|w| !w.is_empty()) {
            let id = word.parse().map_err(|what: String| {
                Diag::input("resume-done", what)
                    .at(Place::line(path.display().to_string(), i + 1))
                    .hint("list the names of finished blocks, such as B0001")
            })?;
            out.insert(id);
        }
    }
    Ok(out)
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

/// What was written.
#[derive(Clone, Debug, PartialEq)]
pub struct Resumed {
    /// The blocks that are left.
    pub subset: Subset,
    /// How many blocks the whole job has.
    pub of: usize,
}

/// What a manifest says that the other files do not.
#[derive(Deserialize)]
struct Told {
    machine: Machine,
    placement: Placement,
    focus: Focus,
    passes: Vec<PassTold>,
    setups: Vec<SetupTold>,
    blocks: Vec<BlockTold>,
    #[serde(default)]
    subset: Option<Subset>,
    #[serde(default)]
    frames: Option<Frames>,
    summary: Summary,
}

#[derive(Deserialize)]
struct Placement {
    #[serde(default)]
    laid_deg: Option<[f64; 3]>,
    turn_deg: f64,
}

#[derive(Deserialize)]
struct Focus {
    depth_range_mm: f64,
}

#[derive(Deserialize)]
struct PassTold {
    turn_deg: f64,
    lowered_mm: f64,
}

#[derive(Deserialize)]
struct SetupTold {
    registration: Vec<RegistrationTold>,
}

#[derive(Deserialize)]
struct RegistrationTold {
    point_mm: [f64; 2],
    stage: [f64; 2],
}

#[derive(Deserialize)]
struct BlockTold {
    time_s: f64,
}

/// A job folder as it lies on the disk.
struct Whole<'a> {
    folder: &'a Path,
    head: Head,
    document: Value,
    told: Told,
    formats: Vec<&'static Target>,
}

/// Writes the folder `target` with the blocks of the folder `whole` that the choice leaves.
///
/// # Errors
/// `resume-changed` where a file of the folder is not as it was written, `resume-mode` of an on-the-fly job,
/// `resume-block` where the choice names a block that the folder does not hold, `resume-empty` where nothing is left,
/// and those of [`job_folder::prepare`].
pub fn resume(folder: &Path, choice: &Choice, target: &Path, durability: Durability) -> Result<Resumed, Error> {
    let whole = Whole::read(folder)?;
    let same = |a: &Path, b: &Path| fs::canonicalize(a).ok().zip(fs::canonicalize(b).ok()).is_some_and(|(a, b)| a == b);
    if same(folder, target) {
        let d = Diag::input("output-is-input", "the output would replace the folder that it is made from");
        return Err(d.at(place(target)).hint("name another folder with -o").into());
    }
    job_folder::prepare(target, Mode::Stepped)?;
    let name = folder.join("program.txt");
    let (program, origins) = text::parse(&name.display().to_string(), &diag::read_file(&name, u64::MAX)?)?;
    let chosen = whole.chosen(&program, choice)?;
    let of = program.blocks.len();
    if whole.told.blocks.len() != of {
        let text = format!("the manifest lists {} blocks, program.txt has {of}", whole.told.blocks.len());
        let d = Diag::input("manifest", text).at(place(&folder.join(MANIFEST)));
        return Err(d.hint("restore the job folder from a copy").into());
    }
    let figures: Vec<BlockFigures> = chosen
        .iter()
        .map(|&i| BlockFigures { time_s: whole.told.blocks[i].time_s, ..BlockFigures::default() })
        .collect();
    let lifts = (0..of).map(|i| i == 0 || program.blocks[i].retract).collect();
    let checked = Checked::as_written(program.subset(&chosen), origins);
    let subset = whole.subset(checked.program());
    let rest = Rest { whole: &whole, lifts, chosen: &chosen, figures, checked, subset };
    let job_file = job_folder::path_from(&folder.join(&whole.head.job.file), target)?;
    job_folder::replace_stepped(target, durability, &|new| rest.write(new, &job_file))?;
    Ok(Resumed { subset: rest.subset, of })
}

fn place(path: &Path) -> Place {
    Place::file(path.display().to_string())
}

fn unread(path: &Path, e: &std::io::Error) -> Error {
    Diag::input("file-unreadable", format!("cannot read the file: {e}")).at(place(path)).into()
}

impl<'a> Whole<'a> {
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
        let path = folder.join(MANIFEST);
        let bytes = diag::read_file(&path, u64::MAX)?;
        let broken = |e: serde_json::Error| {
            Diag::input("manifest", format!("this is not a manifest of this version: {e}"))
                .at(place(&path))
                .hint("resume with the version of terrace that compiled the job")
        };
        let document: Value = serde_json::from_slice(&bytes).map_err(broken)?;
        let told: Told = serde_json::from_slice(&bytes).map_err(broken)?;
        let of_block = document["blocks"][0]["files"].as_object();
        let formats = TARGETS.iter().filter(|t| match t.stepped {
            Some(Files::Whole(name, _)) => head.files.iter().any(|f| f.file == name),
            Some(Files::Blocks(..)) => match &told.subset {
                None => of_block.is_some_and(|files| files.contains_key(t.name)),
                Some(_) => head.files.iter().any(|f| f.file.starts_with("blocks/") && ends_as(&f.file, t)),
            },
            None => false,
        });
        let formats = formats.collect();
        Ok(Self { folder, head, document, told, formats })
    }

    /// The places in the program of the blocks that are left.
    fn chosen(&self, program: &Program, choice: &Choice) -> Result<Vec<usize>, Error> {
        let held: Option<BTreeSet<&str>> =
            self.told.subset.as_ref().map(|s| s.blocks.iter().map(String::as_str).collect());
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

    fn subset(&self, program: &Program) -> Subset {
        let machine = &self.told.machine;
        let time_s = plan::of_program(machine, program).total;
        let blocks = program.blocks.len();
        Subset {
            blocks: (0..blocks).map(|i| program.id(i).to_string()).collect(),
            stops: program.stops(),
            mark_mm: program.blocks.iter().map(|b| program.mark_mm(b)).sum(),
            time_s,
            total_s: self.told.summary.loading.of_blocks(blocks, time_s).total_s,
        }
    }
}

/// Whether a file has the ending of this target's files of single blocks.
fn ends_as(file: &str, target: &Target) -> bool {
    matches!(target.stepped, Some(Files::Blocks(ending, _)) if file.rsplit_once('.').is_some_and(|(_, e)| e == ending))
}

/// What is left, and what it is written from.
struct Rest<'a> {
    whole: &'a Whole<'a>,
    /// Whether the stage lifts on its way to each block of the whole job.
    lifts: Vec<bool>,
    chosen: &'a [usize],
    figures: Vec<BlockFigures>,
    checked: Checked,
    subset: Subset,
}

impl Rest<'_> {
    /// Fills the new folder.
    fn write(&self, new: &Path, job_file: &str) -> Result<(), Error> {
        let mut files = Vec::new();
        let mut put = |name: &str, bytes: &[u8]| {
            files.push(job_folder::put(new, name, bytes)?);
            Ok::<(), Error>(())
        };
        let Self { whole, checked, .. } = self;
        let copied = |name: &str| {
            let path = whole.folder.join(name);
            diag::read_file(&path, u64::MAX)
        };
        put("program.txt", &copied("program.txt")?)?;
        let formats: Vec<_> = whole.formats.iter().map(|t| t.format).collect();
        let (job, part) = (name_of(&whole.head.job.file), self.surface().map_or_else(String::new, |f| name_of(&f)));
        let Told { machine, .. } = &whole.told;
        let emitted = Stepped {
            checked,
            machine,
            figures: &self.figures,
            job: &job,
            part: &part,
            block_file: block_file(&formats),
            frames: None,
        };
        let corners = self.corners();
        let corners = corners.as_ref().map(|(checked, points)| Stepped {
            checked,
            figures: &[],
            frames: Some(points),
            ..emitted
        });
        let make_inner = |name: &str| {
            let inner = new.join(name);
            if inner.exists() { Ok(()) } else { fs::create_dir(&inner).map_err(|e| unread(&inner, &e)) }
        };
        for target in &whole.formats {
            match target.stepped {
                Some(Files::Whole(name, write)) => {
                    put(name, &write(&emitted))?;
                    if let Some(corners) = &corners {
                        make_inner("frames")?;
                        put(&frames::of_whole(name), &write(corners))?;
                    }
                }
                Some(Files::Blocks(ending, _)) => {
                    make_inner("blocks")?;
                    let ids = || (0..checked.program().blocks.len()).map(|i| checked.program().id(i));
                    for name in ids().map(|id| Program::block_file(id, ending)) {
                        put(&name, &copied(&name)?)?;
                    }
                    if corners.is_some() {
                        make_inner("frames")?;
                        for name in ids().map(|id| frames::of_block(id, ending)) {
                            put(&name, &copied(&name)?)?;
                        }
                    }
                }
                None => {}
            }
        }
        for picture in whole.head.files.iter().map(|f| &f.file).filter(|f| f.ends_with(".svg")) {
            let svg = String::from_utf8_lossy(&copied(picture)?).into_owned();
            put(picture, self.picture(&svg).as_bytes())?;
        }
        if whole.head.files.iter().any(|f| f.file == VIEW) {
            let page = String::from_utf8_lossy(&copied(VIEW)?).into_owned();
            put(VIEW, self.view(&page).as_bytes())?;
        }
        let sheet = self.sheet(job_file);
        put("runsheet.csv", &runsheet::csv(&sheet))?;
        put("runsheet.txt", &runsheet::txt(&sheet))?;
        files.sort_by(|a, b| a.file.cmp(&b.file));
        job_folder::put(new, MANIFEST, &self.manifest(job_file, &files))?;
        Ok(())
    }

    /// The frames of the outline, and the registration points; None where the job has no frames.
    fn corners(&self) -> Option<(Checked, Vec<Vec<[Nm; 2]>>)> {
        let told = &self.whole.told;
        let name = &told.frames.as_ref()?.pen;
        let pen = self.checked.program().pens.iter().position(|pen| pen.name == *name)?;
        let points = told.setups.iter().map(|s| s.registration.iter().map(|r| registered(r).at).collect());
        Some((frames::of_outline(&self.checked, PenId(pen as u16), &told.machine), points.collect()))
    }

    /// The surface file, as the manifest names it.
    fn surface(&self) -> Option<String> {
        self.whole.head.inputs.iter().find(|i| i.role == "surface").map(|i| i.file.clone())
    }

    fn sheet<'a>(&'a self, job_file: &'a str) -> Sheet<'a> {
        let told = &self.whole.told;
        let points = |s: &SetupTold| s.registration.iter().map(registered).collect();
        let has_setups = told.setups.len() > 1 || told.setups.iter().any(|s| !s.registration.is_empty());
        let second = told.passes.get(1).map_or([0.0; 2], |pass| [pass.lowered_mm, pass.turn_deg]);
        Sheet {
            job_file,
            surface: self.surface().unwrap_or_default(),
            machine: &told.machine,
            turn_deg: told.placement.turn_deg,
            laid_deg: told.placement.laid_deg,
            per_pass: second,
            formats: self.whole.formats.iter().map(|t| t.format).collect(),
            registration: has_setups.then(|| told.setups.iter().map(points).collect()),
            checked: &self.checked,
            depth_mm: told.focus.depth_range_mm,
            figures: self.figures.clone(),
            summary: &told.summary,
            frames: told.frames.as_ref().map(|frames| frames.pen.clone()),
            subset: Some(&self.subset),
        }
    }

    /// A picture of the whole job with the blocks that are not left in grey.
    fn picture(&self, svg: &str) -> String {
        let left: BTreeSet<usize> = self.chosen.iter().copied().collect();
        let gone = (0..self.whole.told.blocks.len()).filter(|i| !left.contains(i));
        let gone: Vec<String> = gone.map(|i| format!("#block-{}", BlockId::new(i))).collect();
        let style = match gone.is_empty() {
            true => String::new(),
            false => format!("<style>{}{{fill:#eee;stroke:#ccc}}</style>\n", gone.join(",")),
        };
        let told = format!("{} of {} blocks are left", left.len(), self.whole.told.blocks.len());
        // A picture of a rest says what was left there.
        let lines = svg.lines().filter(|line| !line.ends_with("blocks are left</text>"));
        let whole = |line: &str| match line.strip_suffix(" blocks are left</title>").and_then(|l| l.rsplit_once(": ")) {
            Some((title, _)) => format!("{title}</title>\n"),
            None => format!("{line}\n"),
        };
        let svg: String = lines.map(whole).collect();
        let drawn = svg.replacen("</title>\n", &format!(": {told}</title>\n{style}"), 1);
        let end = drawn.rfind("</svg>").unwrap_or(drawn.len());
        let (before, after) = drawn.split_at(end);
        format!("{before}{}{after}", caption(&svg, &told).unwrap_or_default())
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
    fn manifest(&self, job_file: &str, files: &[FileFact]) -> Vec<u8> {
        let mut document = self.whole.document.clone();
        document["job"]["file"] = job_file.into();
        document["files"] = serde_json::json!(files);
        let program = self.checked.program();
        let machine = &self.whole.told.machine;
        let mut left = self.chosen.iter().enumerate().peekable();
        for (i, entry) in document["blocks"].as_array_mut().into_iter().flatten().enumerate() {
            match left.next_if(|(_, place)| **place == i) {
                Some((at, _)) => {
                    debug_assert_eq!(entry["id"], program.id(at).to_string());
                    entry["lift_z_mm"] = manifest::lift_mm(machine, &self.checked, at).into();
                }
                None => {
                    entry["files"] = serde_json::json!({});
                    entry["lift_z_mm"] = self.lifts[i].then(|| machine.retract_z().mm()).into();
                }
            }
        }
        document["subset"] = serde_json::json!(self.subset);
        if let Some(frames) = &self.whole.told.frames {
            document["frames"] = serde_json::json!(Frames::new(&frames.pen, &self.checked, machine));
        }
        let mut out = serde_json::to_vec_pretty(&document).expect("all keys are text");
        out.push(b'\n');
        out
    }
}

fn registered(told: &RegistrationTold) -> Registered {
    Registered { point_mm: told.point_mm, at: told.stage.map(|mm| Nm::from_mm(mm).unwrap_or_default()) }
}

/// The page that shows a job in three dimensions.
const VIEW: &str = "view.html";

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
