//! Lines and dots that the texture has more than once, and pens that give no power: a job is marked all the same, but
//! most often not as it was meant.
//!
//! Two lines are the same where their ends are, in either direction, to the nanometre: what lies on another line and
//! ends elsewhere is not found. A line is kept as a hash of its ends, 16 bytes, and textures of more than [`MOST`]
//! points are not looked at.

use std::collections::BTreeMap;

use super::off_part::lengths_and_dots;
use terrace_core::diag::Diag;
use terrace_core::geom::{Nm, P2};
use terrace_core::machine::Machine;
use terrace_core::program::Pen;
use terrace_input::job::Job;
use terrace_input::texture::Texture;

/// Most points of the textures of a job that are looked at.
const MOST: u64 = 4_000_000;

/// A straight piece of a stroke, or a dot.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct TextureLine {
    /// Hash of its ends.
    ends: u64,
    /// Which texture has it, from 0.
    texture: u32,
    /// The length of the line, nm; 0 of a dot.
    length: u32,
}

/// What is marked again.
#[derive(Clone, Copy, Default)]
struct RepeatedMarks {
    length: Nm,
    dots: u64,
}

impl RepeatedMarks {
    fn add(&mut self, line: &TextureLine) {
        self.length += Nm(line.length.into());
        self.dots += u64::from(line.length == 0);
    }

    fn text(&self) -> String {
        lengths_and_dots(self.length.mm(), self.dots)
    }
}

/// Warnings about the texture of a pass.
pub(super) fn warnings(job: &Job, texture: &Texture) -> Vec<Diag> {
    if texture.points_estimate() > MOST {
        return Vec::new();
    }
    let lines = lines(texture);
    let mut repeated: BTreeMap<[u32; 2], RepeatedMarks> = BTreeMap::new();
    for same in lines.chunk_by(|a, b| a.ends == b.ends) {
        // Each but the first is marked again: by its own texture where that has it already, else by both.
        for pair in same.windows(2) {
            let [before, by] = [pair[0].texture, pair[1].texture];
            let first = if before == by { by } else { same[0].texture };
            repeated.entry([first, by]).or_default().add(&pair[1]);
        }
    }
    repeated
        .into_iter()
        .map(|([a, b], marks)| if a == b { within(job, a, marks) } else { both(job, [a, b], marks) })
        .collect()
}

/// Marks that a texture has more than once.
fn within(job: &Job, texture: u32, marks: RepeatedMarks) -> Diag {
    let text = format!("texture {} has lines or dots more than once: {} are marked again", texture + 1, marks.text());
    Diag::warning("lines-twice", text)
        .at(job.place_of(&format!("texture.{texture}")))
        .hint("remove the copies from the drawing; to mark it more than once, use `passes` of its pen")
}

/// Marks that two textures have.
fn both(job: &Job, [a, b]: [u32; 2], marks: RepeatedMarks) -> Diag {
    let text =
        format!("textures {} and {} have the same lines or dots: {} are marked by both", a + 1, b + 1, marks.text());
    Diag::warning("texture-twice", text)
        .at(job.place_of(&format!("texture.{b}")))
        .hint("remove one of the two [[texture]] tables; to mark a texture more than once, use `passes` of its pen")
}

/// All lines and dots, the same next to each other, in the order of their textures.
fn lines(texture: &Texture) -> Vec<TextureLine> {
    let mut out = Vec::new();
    let mut points = Vec::new();
    for i in 0..texture.len() {
        texture.stroke(i, &mut points);
        let number = texture.part_of(i) as u32;
        let mut add = |a: P2, b: P2| {
            let length = a.distance(b).round().min(f64::from(u32::MAX)) as u32;
            out.push(TextureLine { ends: hash(a.min(b), a.max(b)), texture: number, length });
        };
        match points[..] {
            [dot] => add(dot, dot),
            _ => points.windows(2).for_each(|w| add(w[0], w[1])),
        }
    }
    out.sort_unstable();
    out
}

/// A hash of two points: steps of splitmix64, which spread every bit over all.
fn hash(a: P2, b: P2) -> u64 {
    [a.x, a.y, b.x, b.y].into_iter().fold(0, |hash: u64, v| {
        let mut h = (hash ^ v as u64).wrapping_add(0x9e37_79b9_7f4a_7c15);
        h = (h ^ (h >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        h = (h ^ (h >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        h ^ (h >> 31)
    })
}

/// Pens without power that a texture is marked with.
pub(super) fn without_power(job: &Job, texture: &Texture, machine: &Machine) -> Vec<Diag> {
    let is_dark = |pen: &Pen| pen.power.as_w(machine.laser.max_power) <= 0.0;
    let mut open: Vec<usize> = (0..job.pens.len()).filter(|&i| is_dark(&job.pens[i])).collect();
    // Of each pen the first texture that it marks.
    let mut uses = Vec::new();
    let mut points = Vec::new();
    for i in 0..texture.len() {
        if open.is_empty() {
            break;
        }
        let pen = texture.stroke(i, &mut points).index();
        if let Some(at) = open.iter().position(|&dark| dark == pen) {
            uses.push((open.swap_remove(at), texture.part_of(i)));
        }
    }
    uses.into_iter().map(|(pen, texture)| pen_without_power(job, pen, texture)).collect()
}

/// A texture that is marked with a pen without power.
fn pen_without_power(job: &Job, pen: usize, texture: usize) -> Diag {
    let name = &job.pens[pen].name;
    let text =
        format!("texture {} is marked with pen {name:?}, which has no power: nothing is marked by it", texture + 1);
    Diag::warning("pen-no-power", text)
        .at(job.place_of(&format!("pen.{pen}.power")))
        .hint("give the pen a power, or the texture another pen")
}
