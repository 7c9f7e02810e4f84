//! What a verification found: one entry per rule, and the figures as re-read from the files.

use std::fmt::Write;
use std::path::Path;

use serde_json::{Value, json};

/// How many violations of one rule are kept in full; the rest is counted. docs/explanation/verify.md promises the first
/// 20.
const KEPT: usize = 20;

/// One place where a rule is broken.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Violation {
    /// Name of the block; empty where no block is concerned.
    pub block: String,
    /// Where: a point on the part in mm, or a file and its line.
    pub place: String,
    /// One sentence, numbers with units.
    pub message: String,
}

/// One rule: how much was checked against it and what broke it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Rule {
    /// Stable short name.
    pub code: &'static str,
    /// The demand of the rule, in one sentence.
    pub what: &'static str,
    /// Whether it could be checked: an input that is missing or changed proves nothing.
    pub ran: bool,
    /// How many things were checked against it.
    pub checked: u64,
    /// How many of them broke it.
    pub violated: u64,
    /// The first of them, at most 20.
    pub violations: Vec<Violation>,
    /// Files that it could not be checked for, each with the reason.
    pub left_out: Vec<String>,
}

impl Rule {
    pub(super) fn new(code: &'static str, what: &'static str) -> Self {
        Self { code, what, ran: false, checked: 0, violated: 0, violations: Vec::new(), left_out: Vec::new() }
    }

    /// Notes that the file of a texture, counted from 0, is not checked.
    pub(super) fn leaves_out(&mut self, path: &Path, texture: usize, why: &str) {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let text = format!("texture {}, {name}: {why}", texture + 1);
        if !self.left_out.contains(&text) {
            self.left_out.push(text);
        }
    }

    /// Adds what was found of the same rule after this.
    pub(super) fn add(&mut self, after: Self) {
        self.ran |= after.ran;
        self.checked += after.checked;
        self.violated += after.violated;
        self.violations.extend(after.violations);
        self.violations.truncate(KEPT);
        self.left_out
            .extend(after.left_out.into_iter().filter(|text| !self.left_out.contains(text)).collect::<Vec<_>>());
    }

    /// Counts one check, and notes a violation at `place` where it failed.
    pub(super) fn require(&mut self, place: &str, is_met: bool, message: &str) {
        self.checked += 1;
        if !is_met {
            self.broken("", place, message);
        }
    }

    /// Counts one figure of the manifest, and notes a violation where it is farther than `tolerance` from what was
    /// found. A NaN on either side is a violation.
    pub(super) fn require_figure(&mut self, block: &str, name: &str, stated: f64, found: f64, tolerance: f64) {
        self.checked += 1;
        let is_near = (stated - found).abs() <= tolerance; // never of a NaN
        if !is_near {
            self.broken(block, "manifest.json", format!("{name} is given as {stated}, but is {found}"));
        }
    }

    /// Notes a violation; beyond the first ones only their number is kept.
    pub(super) fn broken(&mut self, block: &str, place: impl Into<String>, message: impl Into<String>) {
        self.violated += 1;
        if self.violations.len() < KEPT {
            let violation = Violation { block: block.into(), place: place.into(), message: message.into() };
            self.violations.push(violation);
        }
    }
}

/// Lengths in mm as re-read from the files, every pass counted.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Lengths {
    /// The texture as placed on the part.
    pub texture_mm: f64,
    /// All marks.
    pub mark_mm: f64,
    /// Length that is marked again in the same pass.
    pub overlap_mm: f64,
    /// Length that is not marked: the sum of the next three.
    pub skipped_mm: f64,
    /// Off the part.
    pub skipped_off_part_mm: f64,
    /// On slopes beyond the limit.
    pub skipped_steep_mm: f64,
    /// On the part and gentle, yet not marked.
    pub skipped_small_mm: f64,
}

/// A file that a folder was held against.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Input {
    /// `job`, `surface`, `texture` or `machine`.
    pub role: &'static str,
    /// The absolute path of the file, or the built-in profile.
    pub place: String,
    /// Whether it lies somewhere else than beside the job folder, or below where that lies.
    pub is_elsewhere: bool,
}

/// A part of a folder that is not proved.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NotProved {
    /// A file of the folder.
    pub file: String,
    /// Which part of it, as a sentence or as keys.
    pub what: String,
}

/// The answer of a verification.
#[derive(Clone, Debug, PartialEq)]
pub struct Proof {
    /// Whether every rule could be checked and none is broken.
    pub ok: bool,
    /// All rules, in a fixed order.
    pub rules: Vec<Rule>,
    /// Blocks of the program.
    pub stops: usize,
    /// Strokes of the program.
    pub fragments: usize,
    /// Lengths as re-read.
    pub lengths: Lengths,
    /// Largest distance of a mark from its focal plane, um, on the file's own facets.
    pub worst_defocus_um: f64,
    /// Steepest facet under a mark, degrees.
    pub worst_incidence_deg: f64,
    /// The files that the folder was held against, each with its role.
    pub against: Vec<Input>,
    /// Files and keys that people or scripts read, and that no rule holds.
    pub not_proved: Vec<NotProved>,
    /// Largest distance of an on-the-fly mark from the texture, um; None of stepped jobs, whose marks are the
    /// texture's to the nanometre.
    pub worst_position_um: Option<f64>,
}

impl Proof {
    /// The rule of that code.
    pub fn rule(&self, code: &str) -> Option<&Rule> {
        self.rules.iter().find(|r| r.code == code)
    }

    /// The proof as the JSON object that `verify --json` prints.
    pub fn to_json(&self) -> Value {
        let l = &self.lengths;
        let mut proof = json!({
            "ok": self.ok,
            "rules": self.rules.iter().map(rule_json).collect::<Vec<_>>(),
            "stops": self.stops,
            "fragments": self.fragments,
            "texture_mm": l.texture_mm,
            "mark_mm": l.mark_mm,
            "overlap_mm": l.overlap_mm,
            "skipped_mm": l.skipped_mm,
            "skipped_off_part_mm": l.skipped_off_part_mm,
            "skipped_steep_mm": l.skipped_steep_mm,
            "skipped_small_mm": l.skipped_small_mm,
            "worst_defocus_um": self.worst_defocus_um,
            "worst_incidence_deg": self.worst_incidence_deg,
        });
        if let Some(position) = self.worst_position_um {
            proof["worst_position_um"] = position.into();
        }
        let against =
            self.against.iter().map(|i| json!({"role": i.role, "place": i.place, "elsewhere": i.is_elsewhere}));
        proof["against"] = against.collect();
        proof["not_proved"] = self.not_proved.iter().map(|n| json!({"file": n.file, "what": n.what})).collect();
        proof
    }

    /// The proof as text for people.
    pub fn to_text(&self) -> String {
        let mut out = String::new();
        for rule in &self.rules {
            let verdict = match (rule.ran, rule.violated) {
                (false, 0) => "not checked".to_owned(),
                (_, 0) => format!("ok, {} checked", rule.checked),
                (_, n) => format!("BROKEN, {n} of {} checked", rule.checked.max(n)),
            };
            writeln!(out, "{:<10} {verdict}: {}", rule.code, rule.what).expect("text grows");
            for v in &rule.violations {
                let block = if v.block.is_empty() { String::new() } else { format!("block {}, ", v.block) };
                writeln!(out, "           {block}{}: {}", v.place, v.message).expect("text grows");
            }
            for text in &rule.left_out {
                writeln!(out, "           not checked: {text}").expect("text grows");
            }
            let more = rule.violated - rule.violations.len() as u64;
            if more > 0 {
                writeln!(out, "           and {more} more").expect("text grows");
            }
        }
        let l = &self.lengths;
        writeln!(
            out,
            "stops {}, fragments {}, texture {:.6} mm, marked {:.6} mm, overlap {:.6} mm, skipped {:.6} mm \
             (off the part {:.6}, steep {:.6}, small {:.6}), worst defocus {:.4} um, worst incidence {:.3} deg",
            self.stops,
            self.fragments,
            l.texture_mm,
            l.mark_mm,
            l.overlap_mm,
            l.skipped_mm,
            l.skipped_off_part_mm,
            l.skipped_steep_mm,
            l.skipped_small_mm,
            self.worst_defocus_um,
            self.worst_incidence_deg,
        )
        .expect("text grows");
        if let Some(position) = self.worst_position_um {
            writeln!(out, "worst position {position:.4} um").expect("text grows");
        }
        for input in &self.against {
            let note = if input.is_elsewhere { ", which does not lie beside the job folder" } else { "" };
            writeln!(out, "{:<10} {}{note}", input.role, input.place).expect("text grows");
        }
        for part in &self.not_proved {
            writeln!(out, "not proved {}: {}", part.file, part.what).expect("text grows");
        }
        out.push_str(if self.ok { "verified\n" } else { "NOT verified\n" });
        out
    }
}

fn rule_json(rule: &Rule) -> Value {
    let violations: Vec<Value> =
        rule.violations.iter().map(|v| json!({ "block": v.block, "place": v.place, "message": v.message })).collect();
    json!({
        "code": rule.code, "what": rule.what, "ran": rule.ran, "checked": rule.checked,
        "violated": rule.violated, "violations": violations, "left_out": rule.left_out,
    })
}
