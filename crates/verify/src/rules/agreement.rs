//! `agreement`: the manifest, the drawings and the OVF say what `program.txt` says. (The stage
//! programs are compared in `stage`.) Numbers are compared as whole nanometres, those of OVF to one
//! step of f32. One violation per file or block: the first difference.

use std::collections::BTreeSet;
use std::path::Path;

use super::hash::is_inside;
use super::{planes, poses, setups};
use crate::job_facts::JobFacts;
use crate::proof::Rule;
use crate::read::BlockOf;
use crate::read::formats::{self, BlockFiles, Stepped};
use crate::read::manifest::{BlockEntry, Manifest, PenEntry};
use crate::read::number::nm_from_mm;
use crate::read::ovf::OvfFile;
use crate::read::program::ProgramFile;
use terrace_core::geom::{NM_PER_MM, Nm, P2};
use terrace_core::machine::Machine;
use terrace_core::parallel;
use terrace_core::program::{Block, BlockId, PassId, Pen, Program, Stroke};
use terrace_core::units::Power;

/// Relative difference at which two stated lengths or angles are still the same number: of 4 m it is 0.004 nm.
const SAME: f64 = 1e-12;

const PLACE: &str = "manifest.json";

/// Holds the manifest against the program; the folder has files of the `chosen` blocks.
pub(crate) fn check(manifest: &Manifest, file: &ProgramFile, chosen: &[usize], facts: &JobFacts, rule: &mut Rule) {
    rule.ran = true;
    let program = &file.program;
    if manifest.placement.origin_mm.map(nm_from_mm) != file.origins[0].0.map(Some) {
        rule.broken("", "manifest.json", "its placement is not the origin of program.txt");
    }
    if !manifest.setups.iter().map(|s| s.origin_mm.map(nm_from_mm)).eq(file.origins.iter().map(|o| o.0.map(Some))) {
        rule.broken("", "manifest.json", "its set-ups differ from those of program.txt");
    }
    let pens = manifest.pens.iter().zip(&program.pens);
    if manifest.pens.len() != program.pens.len() || !pens.into_iter().all(|(e, pen)| is_pen(e, pen, &facts.machine)) {
        rule.broken("", "manifest.json", "its pens differ from those of program.txt");
    }
    if manifest.blocks.len() != program.blocks.len() {
        let text = format!("lists {} blocks, program.txt has {}", manifest.blocks.len(), program.blocks.len());
        rule.broken("", "manifest.json", text);
    }
    // The passes and set-ups that have begun: none of them begins a second time.
    let mut begun = BTreeSet::new();
    for (i, (id, block)) in file.ids.iter().zip(&program.blocks).enumerate() {
        rule.checked += 1;
        if *id != BlockId::new(i).to_string() {
            rule.broken(id, "program.txt", format!("block {} of the order is named {id}", i + 1));
        }
        if i > 0 && block.pass < program.blocks[i - 1].pass {
            rule.broken(id, "program.txt", "a block of an earlier pass stands after a later one");
        }
        let pass_and_setup = |b: &Block| (b.pass, b.setup);
        let begins = i == 0 || pass_and_setup(block) != pass_and_setup(&program.blocks[i - 1]);
        if begins && !begun.insert(pass_and_setup(block)) {
            rule.broken(id, "program.txt", "the blocks of its set-up are not consecutive");
        }
        let entry = manifest.blocks.get(i);
        let place = chosen.binary_search(&i).ok();
        // A block that does not follow on the one before it is entered by a lift, whether it asks for one or not.
        let follows = i > 0 && place.is_none_or(|k| k > 0 && chosen[k - 1] + 1 == i);
        let lift = (!follows || block.retract).then(|| facts.machine.retract_z());
        if entry.is_some_and(|e| place.is_none() && !e.files.is_empty()) {
            rule.broken(id, "manifest.json", "it is not of the subset, but has files");
        }
        let difference = entry.and_then(|e| differs(e, id, block, lift).or_else(|| has_other_pens(e, program, block)));
        if let Some(difference) = difference {
            rule.broken(id, "manifest.json", format!("its {difference} differs from program.txt"));
        }
    }
}

/// Holds drawings, OVF and poses against the blocks of which the folder has files; `places` are the numbers of these
/// blocks in the whole program.
pub(crate) fn files(
    folder: &Path,
    manifest: &Manifest,
    file: &ProgramFile,
    places: &[usize],
    facts: &JobFacts,
    rule: &mut Rule,
) {
    let program = &file.program;
    for (row, files) in formats::expected(&facts.formats, &manifest.files, &manifest.blocks) {
        match files {
            Stepped::Blocks(files) => {
                let drawings = Drawings { folder, files, program, machine: &facts.machine };
                let rules = parallel::map(program.blocks.len().min(places.len()), |k| {
                    let (id, mut rule) = (&file.ids[k], Rule::new(rule.code, rule.what));
                    let named = manifest.blocks.get(places[k]).and_then(|e| e.files.get(row.name));
                    let name = named.cloned().unwrap_or_else(|| formats::of_block(id, files.ending));
                    drawings.check(&name, id, &program.blocks[k], &mut rule);
                    rule
                });
                rules.into_iter().for_each(|of_block| rule.add(of_block));
            }
            Stepped::Planes { file: name, open } => whole(folder, name, open, file, &facts.machine, rule),
            Stepped::Poses { file: name, read } => poses::check(folder, name, read, file, &facts.machine, rule),
            // The rules of `stage` hold these.
            Stepped::Stage { .. } => {}
        }
    }
}

/// The files of every stepped job, besides those of its formats and frames.
const OF_EVERY_JOB: [&str; 8] = [
    "program.txt",
    "runsheet.csv",
    "runsheet.txt",
    "layout.svg",
    "slope.svg",
    "energy.svg",
    "report.html",
    "view.html",
];

/// Holds that every listed file is one of the job's: whoever loads another marks what nobody has compared.
pub(crate) fn all_are_known(manifest: &Manifest, chosen: &[usize], facts: &JobFacts, rule: &mut Rule) {
    let mut known: BTreeSet<String> = OF_EVERY_JOB.map(str::to_owned).into();
    if manifest.placement.measured.is_some() {
        known.insert("measured.svg".to_owned());
    }
    known.extend((2..=manifest.passes.len()).map(|pass| format!("layout-pass{pass}.svg")));
    let has_frames = manifest.frames.is_some();
    // Where the job file cannot be had, those that are there count.
    let is_asked = |row: &formats::Row| facts.pens.is_none() || facts.formats.contains(&row.format);
    let expected = formats::expected(&facts.formats, &manifest.files, &manifest.blocks);
    let mut drawings = BTreeSet::new();
    for (row, files) in expected.filter(|(row, _)| is_asked(row)) {
        match files {
            Stepped::Blocks(files) => {
                drawings.insert(row.name);
                for entry in chosen.iter().filter_map(|&i| manifest.blocks.get(i)) {
                    let name = formats::of_block(&entry.id, files.ending);
                    if entry.files.get(row.name) != Some(&name) {
                        rule.broken(&entry.id, "manifest.json", format!("its {} file is not {name}", row.name));
                    }
                    known.insert(name);
                    known.extend(has_frames.then(|| formats::of_frame(&entry.id, files.ending)));
                }
            }
            Stepped::Stage { file, .. } | Stepped::Planes { file, .. } | Stepped::Poses { file, .. } => {
                known.insert(file.to_owned());
                known.extend(has_frames.then(|| formats::of_frames(file)));
            }
        }
    }
    for entry in chosen.iter().filter_map(|&i| manifest.blocks.get(i)) {
        rule.checked += 1;
        if let Some(format) = entry.files.keys().find(|format| !drawings.contains(format.as_str())) {
            rule.broken(
                &entry.id,
                "manifest.json",
                format!("it names a file of {format:?}, which is not a format of its drawings"),
            );
        }
    }
    for entry in &manifest.files {
        rule.checked += 1;
        // What leads out of the folder is reported by `hash`.
        if is_inside(&entry.file) && !known.contains(&entry.file) {
            rule.broken(
                "",
                &entry.file,
                "is listed, but is not a file of this job: whoever loads it marks what is not proved",
            );
        }
    }
}

/// An opener of a file that holds the whole job.
pub(super) type Open = for<'a> fn(&'a [u8]) -> Result<OvfFile<'a>, String>;

/// Holds a file of the whole job against the program.
pub(super) fn whole(folder: &Path, name: &str, open: Open, file: &ProgramFile, machine: &Machine, rule: &mut Rule) {
    let bytes = formats::bytes(folder, name);
    match bytes.as_ref().map_err(Clone::clone).and_then(|bytes| open(bytes)) {
        Ok(planes) => planes::check(&planes, name, file, machine, rule),
        Err(fault) => rule.broken("", name, fault),
    }
}

/// Holds manifest and program against the job file.
pub(crate) fn with_job(manifest: &Manifest, file: &ProgramFile, facts: &JobFacts, rule: &mut Rule) {
    let is_near = |a: f64, b: f64| (a - b).abs() <= SAME * b.abs().max(1.0);
    let f = &manifest.focus;
    rule.require(PLACE, manifest.machine == facts.machine, "its machine differs from the job file");
    let inputs = manifest.inputs.iter().map(|i| (i.role.as_str(), i.file.as_str()));
    let asked = facts.inputs.as_deref().unwrap_or_default().iter().map(|(role, file)| (*role, file.as_str()));
    rule.require(PLACE, facts.inputs.is_none() || inputs.eq(asked), "its inputs are not those of the job file");
    rule.require(PLACE, is_near(f.pdof_mm, facts.pdof.mm()), "its pdof differs from the job file");
    rule.require(PLACE, is_near(f.reserve_mm, facts.reserve.mm()), "its focus reserve differs from the job file");
    // The depth range is used rounded down to an even number of increments.
    let lost = Nm::from_mm(f.depth_range_mm).map_or(Nm(-1), |used| facts.depth_range - used);
    let grain = facts.machine.increment_nm() * 2;
    rule.require(PLACE, (Nm(0)..grain).contains(&lost), "its depth range differs from the job file");
    rule.require(
        PLACE,
        f.level == facts.level && f.rule == facts.rule,
        "its focus level or rule differs from the job file",
    );
    rule.require(
        PLACE,
        is_near(manifest.seams.overlap_mm, facts.overlap_nm / NM_PER_MM),
        "its overlap differs from the job file",
    );
    rule.require(
        PLACE,
        is_near(manifest.seams.zone_mm, facts.zone_nm / NM_PER_MM),
        "its zone of seams differs from the job file",
    );
    let passes = &facts.passes;
    let declared = manifest.passes.iter().zip(0..).map(|(p, k)| {
        let turn = f64::from(k) * passes.rotate.as_deg();
        is_near(p.turn_deg, turn) && Nm::from_mm(p.lowered_mm) == Some(passes.lowered(PassId(k)))
    });
    let is_complete = manifest.passes.len() == passes.count as usize;
    rule.require(
        PLACE,
        is_complete && declared.into_iter().all(|same| same),
        "its passes differ from those of the job file",
    );
    rule.require(PLACE, setups::are_the_jobs(manifest, file, facts), "its set-ups are not those that the job asks for");
    rule.require(PLACE, is_near(manifest.placement.turn_deg, facts.turn_deg), "its turn differs from the job file");
    rule.require(
        PLACE,
        manifest.placement.laid_deg == facts.laid_deg,
        "its part is laid otherwise than the job file says",
    );
    rule.require(PLACE, facts.origin.is_none_or(|o| o == file.origins[0]), "its origin differs from the job file");
    let pens = &file.program.pens;
    let is_made = (0..pens.len()).all(|pen| super::dose::is_made(pens, pen, facts));
    let own = facts.pens.as_ref();
    rule.require(
        PLACE,
        own.is_none_or(|p| pens.starts_with(p) && is_made),
        "its pens differ from those of the job file",
    );
    let drawn_with = manifest.frames.as_ref().map(|frames| &frames.pen);
    let asked = facts.frames.as_ref().is_none_or(|asked| asked.as_ref() == drawn_with);
    rule.require(PLACE, asked, "its frames differ from those of the job file");
}

/// The first thing that differs between a block of the manifest and of the program.
fn differs(e: &BlockEntry, id: &str, b: &Block, lift: Option<Nm>) -> Option<&'static str> {
    let nm = nm_from_mm;
    let P2 { x, y, .. } = b.stop.centre;
    [
        ("id", e.id == id),
        ("pass", e.pass.checked_sub(1) == Some(b.pass.0)),
        ("set-up", e.setup.checked_sub(1) == Some(b.setup.0)),
        ("section", e.section == b.stop.section.0),
        ("level", e.level == b.stop.level),
        ("centre", e.centre_mm.map(nm) == [Some(x), Some(y)]),
        ("focus (lpfl)", Nm::from_mm(e.lpfl_mm) == Some(b.stop.lpfl)),
        ("focus shift", Nm::from_mm(e.focus_shift_mm) == Some(b.focus_shift)),
        ("tilt", e.tilt_deg.map(nm) == b.stop.tilt.0.map(Some)),
        ("lift", e.lift_z_mm.map(Nm::from_mm) == lift.map(Some)),
        ("stage target", e.stage.map(nm) == b.stage.0.map(Some)),
        ("depth interval", [e.z_lo_mm, e.z_hi_mm].map(Nm::from_mm) == [Some(b.z_lo), Some(b.z_hi)]),
        ("number of strokes", e.strokes == b.strokes.len()),
    ]
    .into_iter()
    .find_map(|(name, same)| (!same).then_some(name))
}

/// Whether an entry of the manifest is this pen.
fn is_pen(e: &PenEntry, pen: &Pen, machine: &Machine) -> bool {
    let is_near = |stated: f64, found: f64| (stated - found).abs() <= SAME * found.abs();
    let dwell = match (e.dwell_us, pen.dwell) {
        (Some(stated), Some(dwell)) => is_near(stated, dwell.as_us()),
        (stated, dwell) => stated.is_none() && dwell.is_none(),
    };
    e.name == pen.name
        && e.passes == pen.passes
        && dwell
        && is_near(e.speed_mm_s, pen.speed.as_mm_s())
        && is_near(e.frequency_khz, pen.frequency.as_khz())
        && is_near(e.power_w, pen.power.as_w(machine.laser.max_power))
        && e.power.parse::<Power>().is_ok_and(|power| power == pen.power)
}

/// Whether the pens that an entry names are other than those of the block's marks.
fn has_other_pens(e: &BlockEntry, program: &Program, b: &Block) -> Option<&'static str> {
    let mut marked: Vec<usize> = program.strokes_of(b).iter().map(|s| s.pen.index()).collect();
    marked.sort_unstable();
    marked.dedup();
    let names = marked.into_iter().map(|pen| program.pens[pen].name.as_str());
    (!e.pens.iter().map(String::as_str).eq(names)).then_some("list of pens")
}

/// The files of single blocks in one format.
pub(super) struct Drawings<'a> {
    pub(super) folder: &'a Path,
    pub(super) files: BlockFiles,
    pub(super) program: &'a Program,
    pub(super) machine: &'a Machine,
}

impl Drawings<'_> {
    /// Compares the file `name` with its block.
    pub(super) fn check(&self, name: &str, id: &str, block: &Block, rule: &mut Rule) {
        if !is_inside(name) {
            return rule.broken(id, "manifest.json", format!("{name:?} is not a path inside the job folder"));
        }
        let bytes = match formats::bytes(self.folder, name) {
            Ok(bytes) => bytes,
            Err(unread) => return rule.broken(id, name, unread),
        };
        let Self { program, machine, files, .. } = *self;
        let of = BlockOf { id, block, machine };
        let times = |stroke: &Stroke| if files.repeats { program.pens[stroke.pen.index()].passes as usize } else { 1 };
        let all = program.strokes_of(block).iter().flat_map(|stroke| std::iter::repeat_n(stroke, times(stroke)));
        let total: usize = program.strokes_of(block).iter().map(times).sum();
        let (mut strokes, mut count, mut first) = (all, 0, None);
        let mut wanted = Vec::new();
        let read = (files.read)(&bytes, &of, &mut |found| {
            if let Some(stroke) = strokes.next() {
                let points = program.points_of(stroke).iter().map(|&p| machine.scanner.controller_from_field(p));
                wanted.clear();
                wanted.extend(points.map(|p| (files.units)(machine, p)));
                // Points that are one in coarse units are marked once.
                wanted.dedup();
                let pen = &program.pens[stroke.pen.index()];
                let mut settings = (files.settings)(&of, pen);
                settings.extend((files.dwell)(pen).filter(|_| stroke.is_dot()));
                if files.names_pens && found.pen != Some(stroke.pen.index() + 1) {
                    first.get_or_insert((count, "has another pen"));
                } else if wanted != found.points {
                    first.get_or_insert((count, "has other points"));
                } else if settings != found.settings {
                    first.get_or_insert((count, "has other settings"));
                }
            }
            count += 1;
        });
        rule.checked += count as u64;
        if let Err(fault) = read {
            rule.broken(id, format!("{name}:{}", fault.line), fault.message);
        } else if let Some((stroke, what)) = first {
            rule.broken(id, name, format!("stroke {} {what} than in program.txt", stroke + 1));
        } else if count != total {
            rule.broken(id, name, format!("holds {count} strokes, program.txt has {total}"));
        }
    }
}
