//! A folder with files of some blocks alone, as `terrace resume` makes it: `program.txt` is that of the whole job, and
//! the manifest's `subset` names the blocks. The rules of geometry judge the whole program. What speaks of files,
//! stage moves and run sheets judges the subset, whose blocks are entered by a lift where they do not follow on the one
//! before.

use super::times::{self, Times};
use crate::job_facts::JobFacts;
use crate::proof::Rule;
use crate::read::manifest::Manifest;
use crate::read::program::ProgramFile;

/// The places of the blocks whose files the folder holds, rising; of a whole job all. A list that cannot be is broken,
/// and then taken for all.
pub(super) fn chosen(manifest: &Manifest, file: &ProgramFile, rule: &mut Rule) -> Vec<usize> {
    let all = (0..file.ids.len()).collect();
    let Some(subset) = &manifest.subset else { return all };
    rule.checked += 1;
    let mut places = file.ids.iter().enumerate();
    let found: Option<Vec<usize>> =
        subset.blocks.iter().map(|wanted| places.find(|(_, id)| *id == wanted).map(|(i, _)| i)).collect();
    match found {
        Some(found) if !found.is_empty() => found,
        _ => {
            rule.broken("", "manifest.json", "its subset is not a list of blocks in the order of program.txt");
            all
        }
    }
}

/// Calls `judge` with a program of the chosen blocks alone.
pub(super) fn on_chosen<R>(file: &mut ProgramFile, chosen: &[usize], judge: impl FnOnce(&ProgramFile) -> R) -> R {
    if chosen.len() == file.ids.len() {
        return judge(file);
    }
    // A block that does not follow on the one before it is entered by a lift.
    let follows = |k: usize| k > 0 && chosen[k - 1] + 1 == chosen[k];
    let blocks = chosen.iter().enumerate().map(|(k, &i)| {
        let mut block = file.program.blocks[i].clone();
        block.retract |= !follows(k);
        block
    });
    let blocks = blocks.collect();
    let ids = chosen.iter().map(|&i| file.ids[i].clone()).collect();
    let whole_blocks = std::mem::replace(&mut file.program.blocks, blocks);
    let whole_ids = std::mem::replace(&mut file.ids, ids);
    let answer = judge(file);
    file.program.blocks = whole_blocks;
    file.ids = whole_ids;
    answer
}

/// Holds the figures of a subset, given its blocks alone.
pub(super) fn figures(manifest: &Manifest, file: &ProgramFile, facts: &JobFacts, rule: &mut Rule) {
    let Some(subset) = &manifest.subset else { return };
    let mut all = times::stage(file, &facts.machine);
    let mut mark_mm = 0.0;
    for block in &file.program.blocks {
        let Times { mark, jump, delay, .. } = times::marking(&file.program, block, &facts.machine);
        all.mark += mark;
        all.jump += jump;
        all.delay += delay;
        mark_mm += file.program.strokes_of(block).iter().map(|s| times::marked_mm(&file.program, s)).sum::<f64>();
    }
    let load_s = super::summary::load_s(super::summary::way(facts), facts) * file.program.blocks.len() as f64;
    for (name, stated, found) in [
        ("stops", subset.stops as f64, super::stops(&file.program) as f64),
        ("mark_mm", subset.mark_mm, mark_mm),
        ("time_s", subset.time_s, all.total()),
        ("total_s", subset.total_s, all.total() + load_s),
    ] {
        // The same share as of the figures of a whole job.
        rule.require_figure("", &format!("subset.{name}"), stated, found, 1e-9 * found.max(1.0));
    }
}
