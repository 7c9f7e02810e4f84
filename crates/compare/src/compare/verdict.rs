//! Which system to use, and what the others would win or lose, in words.
//!
//! Consumes the rows of a comparison and nothing else; promises that what is recommended keeps every limit with every
//! mark, runs on the job's own machine, and is the fastest of those that `compile` makes. The time that counts is that
//! of [`Figures::counted_s`]. Of systems of one kind the sentences name the fastest; all others are in the table.

use std::fmt;

use serde::Serialize;

use super::system::Kind;
use super::{Beyond, Comparison, Figures, Hardware, KeyCost, Row, SYSTEMS};
use terrace_core::duration::duration;
use terrace_core::machine::LoadingWay;
use terrace_report::report::table::plain;

#[cfg(test)]
mod tests;

/// Times nearer to each other than this factor are as long.
const ALIKE: f64 = 1.05;
/// Factors within this of 2 are a half or a double.
const ROUND: f64 = 0.1;
/// Least difference of incidence that is mentioned, deg.
const TOLD_DEG: f64 = 0.5;

/// The limit of the job from which on `compile` marks with a warning.
const WARN_KEY: &str = "limits.warn_incidence";

/// How a system stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Standing {
    /// The one to use.
    Recommended,
    /// Runs on the job's machine within all limits.
    Usable,
    /// Keeps all limits, on a machine with more than the job's has.
    OtherHardware,
    /// Keeps all limits on the job's machine, but `compile` does not make it.
    EstimateOnly,
    /// Keeps the limits of its drive, and marks nothing: it makes the surface.
    OtherProcess,
    /// Keeps all limits but one from which `compile` warns, which the job sets.
    YoursToSet,
    /// Some marks, or the motion, do not keep the limits.
    BeyondLimits,
    /// There are no figures of it.
    DoesNotApply,
}

/// One system.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Assessed {
    /// The name of the system.
    pub system: &'static str,
    /// How it stands.
    pub standing: Standing,
    /// The time that counts, s.
    pub time_s: Option<f64>,
    /// The system's time as a multiple of the recommended system's.
    pub times_the_recommended: Option<f64>,
    /// Why it is beyond the limits or does not apply.
    pub reasons: Vec<String>,
}

/// What a comparison comes to.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Verdict {
    /// The system to use; None where none on the job's machine keeps the limits.
    pub recommended: Option<&'static str>,
    /// The key of the job file that asks for it.
    pub job_key: Option<String>,
    /// The same in words, the answer first.
    pub sentences: Vec<String>,
    /// All systems in the order of the table.
    pub systems: Vec<Assessed>,
}

impl Verdict {
    /// The verdict on a comparison.
    pub fn of(c: &Comparison) -> Self {
        let rows = Rows(c);
        let best = rows.fastest(|f| f.hardware == Hardware::Own && f.job_key.is_some());
        let systems = c.rows.iter().map(|row| rows.assessed(row, best)).collect();
        Self {
            recommended: best.map(|best| best.system),
            job_key: best.and_then(|best| best.figures.job_key.clone()),
            sentences: rows.sentences(best),
            systems,
        }
    }

    /// What a system is like in a few words, for the table.
    pub fn note(&self, system: usize) -> String {
        let Assessed { standing, times_the_recommended, reasons, .. } = &self.systems[system];
        let compared = || times_the_recommended.map_or("within the limits".to_owned(), note_of_ratio);
        match standing {
            Standing::Recommended => "recommended".to_owned(),
            Standing::Usable => compared(),
            Standing::OtherHardware => format!("{}, other hardware", compared()),
            Standing::EstimateOnly => format!("{}, estimate only", compared()),
            Standing::OtherProcess => "another process: turns the surface, marks nothing".to_owned(),
            Standing::YoursToSet => format!("yours to set: {} by {WARN_KEY}", reasons.join("; ")),
            Standing::BeyondLimits => format!("not usable: {}", reasons.join("; ")),
            Standing::DoesNotApply => format!("does not apply: {}", reasons.join("; ")),
        }
    }
}

/// A system with its figures.
#[derive(Clone, Copy)]
struct TimedSystem<'a> {
    system: &'static str,
    kind: Kind,
    figures: &'a Figures,
    time_s: f64,
}

/// The rows to judge by.
struct Rows<'a>(&'a Comparison);

impl<'a> Rows<'a> {
    /// The rows that have figures.
    fn timed(&self) -> impl Iterator<Item = TimedSystem<'a>> {
        self.0.rows.iter().filter_map(|row| {
            let figures = row.figures.as_ref().ok()?;
            Some(TimedSystem { system: row.system, kind: kind(row.system), figures, time_s: figures.counted_s() })
        })
    }

    /// The fastest of those within the limits; of some that are as fast the first.
    fn fastest(&self, also: impl Fn(&Figures) -> bool) -> Option<TimedSystem<'a>> {
        let usable = self.timed().filter(|t| t.figures.keeps_limits() && also(t.figures));
        usable.min_by(|a, b| a.time_s.total_cmp(&b.time_s))
    }

    fn assessed(&self, row: &Row, best: Option<TimedSystem<'_>>) -> Assessed {
        let (standing, reasons) = match &row.figures {
            Err(e) => {
                let why = e.diags().iter().map(|d| d.message.clone()).collect();
                (Standing::DoesNotApply, why)
            }
            Ok(_) if best.is_some_and(|best| best.system == row.system) => (Standing::Recommended, Vec::new()),
            Ok(f) if !f.keeps_limits() => {
                let standing = if f.is_yours_to_set() { Standing::YoursToSet } else { Standing::BeyondLimits };
                (standing, f.beyond.iter().map(Beyond::to_string).collect())
            }
            Ok(f) if f.tool.is_some() => (Standing::OtherProcess, Vec::new()),
            Ok(f) if f.hardware != Hardware::Own => (Standing::OtherHardware, Vec::new()),
            Ok(f) if f.job_key.is_none() => (Standing::EstimateOnly, Vec::new()),
            Ok(_) => (Standing::Usable, Vec::new()),
        };
        let time_s = row.figures.as_ref().ok().map(Figures::counted_s);
        let marks = row.figures.as_ref().is_ok_and(|f| f.tool.is_none());
        let times_the_recommended = time_s.filter(|_| marks).zip(best).map(|(time_s, best)| time_s / best.time_s);
        Assessed { system: row.system, standing, time_s, times_the_recommended, reasons }
    }

    fn sentences(&self, best: Option<TimedSystem<'_>>) -> Vec<String> {
        let mut out = match best {
            Some(best) => self.recommendation(best),
            None => self.no_recommendation(),
        };
        const GROUPS: [Kind; 7] =
            [Kind::Stepped, Kind::Zoom, Kind::Tilt, Kind::HeadTilt, Kind::OnTheFly, Kind::SevenAxes, Kind::FiveAxes];
        for group in GROUPS {
            let is_recommended = best.is_some_and(|best| best.kind == group);
            let usable = self.timed().filter(|t| t.kind == group && t.figures.keeps_limits());
            if let Some(other) = usable.min_by(|a, b| a.time_s.total_cmp(&b.time_s)).filter(|_| !is_recommended) {
                out.push(comparison_with_best(other, best));
            }
        }
        let turned = self.timed().find(|t| t.kind == Kind::ToolServo && t.figures.keeps_limits());
        out.extend(turned.map(|t| {
            let time = duration(t.time_s);
            format!("A fast tool servo turns the surface in {time}: another process, which marks no texture.")
        }));
        out.extend(self.yours_to_set());
        out.extend(self.beyond_limits());
        out.extend(self.not_applicable());
        out
    }

    /// What to use.
    fn recommendation(&self, best: TimedSystem<'_>) -> Vec<String> {
        let what = match best.kind {
            Kind::Stepped => format!("step by {}", best.system),
            Kind::Zoom => "step with the zoom optic".to_owned(),
            Kind::Tilt => "step with the part tilted at every stop".to_owned(),
            Kind::HeadTilt => "step with the head tilted at every stop".to_owned(),
            Kind::OnTheFly => "mark on the fly".to_owned(),
            Kind::SevenAxes => "mark on the fly with seven axes".to_owned(),
            Kind::FiveAxes => "mark with five axes".to_owned(),
            Kind::ToolServo => unreachable!("no job key asks for it"),
        };
        let cost = self.0.cost_of(best.figures).zip(self.0.cost);
        let cost = cost.map_or(String::new(), |(v, cost)| format!(", {} {}", plain(v, 2), cost.currency()));
        let loaded = best.figures.load_s.map_or("", |_| match self.0.loading.way {
            LoadingWay::Person => " with blocks loaded by a person",
            LoadingWay::Run if self.0.loading.is_least() => " without loading the blocks",
            LoadingWay::Run => " with blocks loaded by terrace run",
            LoadingWay::Card => " with blocks stored on the scan card",
            LoadingWay::Ovf => " by a controller that reads job.ovf",
        });
        let time = duration(best.time_s);
        let mut out = vec![format!("On {}, {what}: {time}{loaded}{cost}, all in focus.", self.0.machine)];
        out.extend(self.loading_left_out(best));
        out.extend(in_the_job_file(best));
        out.extend(self.key_costs(best));
        out
    }

    /// The keys of the job without which a system would be quicker, and by how much.
    fn key_costs(&self, t: TimedSystem<'_>) -> impl Iterator<Item = String> {
        let costs = self.0.key_costs.iter().filter(move |cost| cost.system == t.system);
        costs.filter(move |cost| t.time_s > ALIKE * cost.time_s).map(move |KeyCost { key, value, time_s, .. }| {
            format!(
                "Of this time {key} = {value:?} of the job file, not the machine, costs {}: without it {} takes {}.",
                duration(t.time_s - time_s),
                t.system,
                duration(*time_s)
            )
        })
    }

    /// The sentences that say that nothing can be recommended, and what comes nearest to it.
    fn no_recommendation(&self) -> Vec<String> {
        let is_nearly_usable = |t: &TimedSystem<'_>| {
            let is_compiled = t.figures.hardware == Hardware::Own && t.figures.job_key.is_some();
            is_compiled && t.figures.is_yours_to_set()
        };
        let Some(t) = self.timed().filter(is_nearly_usable).min_by(|a, b| a.time_s.total_cmp(&b.time_s)) else {
            return vec![format!("None of these systems keeps all limits on {}.", self.0.machine)];
        };
        let [worst, allowed] = [t.figures.incidence_deg.worst, self.0.limits.angle.to_degrees()];
        let [worst, allowed] = apart(worst, allowed);
        let answer = format!(
            "Yours to set: {} takes {}, all in focus, with beams at up to {worst} deg; {WARN_KEY} of the job file is \
             {allowed} deg, above which compile warns.",
            t.system,
            duration(t.time_s)
        );
        let left_out = self.loading_left_out(t);
        std::iter::once(answer).chain(left_out).chain(in_the_job_file(t)).chain(self.key_costs(t)).collect()
    }

    /// That the times leave out the loading of the blocks, where a system loads some and its time is not known.
    fn loading_left_out(&self, t: TimedSystem<'_>) -> Option<String> {
        let is_left_out = t.figures.load_s.is_some() && self.0.loading.is_least();
        is_left_out.then(|| {
            "No time here includes what terrace run takes to load the blocks: state operator.load in the machine file."
                .to_owned()
        })
    }

    /// Which systems are beyond nothing but a limit that the job sets as it likes.
    fn yours_to_set(&self) -> Option<String> {
        let out = self.timed().filter(|t| t.figures.is_yours_to_set()).map(|t| {
            let reasons: Vec<String> = t.figures.beyond.iter().map(Beyond::to_string).collect();
            (t.system, reasons.join("; "))
        });
        let parts: Vec<String> =
            by_reason(out).iter().map(|(names, why)| format!("{} ({why})", listed(names))).collect();
        (!parts.is_empty()).then(|| format!("Beyond {WARN_KEY} alone, which is yours to set: {}.", parts.join(", ")))
    }

    /// Which systems must not be used, those of one reason together.
    fn beyond_limits(&self) -> Option<String> {
        let is_beyond = |t: &TimedSystem<'_>| !t.figures.keeps_limits() && !t.figures.is_yours_to_set();
        let out = self.timed().filter(is_beyond).map(|t| {
            let reasons: Vec<String> = t.figures.beyond.iter().map(Beyond::to_string).collect();
            (t.system, reasons.join("; "))
        });
        let groups = by_reason(out);
        let parts: Vec<String> = groups.iter().map(|(names, why)| format!("{} ({why})", listed(names))).collect();
        (!parts.is_empty()).then(|| format!("Beyond the limits: {}.", parts.join(", ")))
    }

    /// Which systems have no figures, those of one reason together.
    fn not_applicable(&self) -> Vec<String> {
        let out = self.0.rows.iter().filter_map(|row| {
            let e = row.figures.as_ref().err()?;
            Some((row.system, e.diags().first().map_or_else(String::new, |d| d.message.clone())))
        });
        let sentence = |(names, why): &(Vec<&str>, String)| {
            let verb = if names.len() > 1 { "do" } else { "does" };
            format!("{} {verb} not apply: {why}.", listed(names))
        };
        by_reason(out).iter().map(sentence).collect()
    }
}

impl Figures {
    /// All limits are kept by all marks and by the motion.
    pub(crate) fn keeps_limits(&self) -> bool {
        self.beyond.is_empty() && self.within >= 100.0
    }

    /// Whether nothing but `limits.warn_incidence` is not kept, above which `compile` marks with a warning.
    pub(super) fn is_yours_to_set(&self) -> bool {
        matches!(self.beyond[..], [Beyond::Incidence(_)])
    }
}

fn kind(system: &str) -> Kind {
    SYSTEMS.iter().find(|s| s.name == system).map_or(Kind::Stepped, |s| s.kind)
}

/// The key of the job file that asks for a system. Without a method of the job file `compile` chooses one by itself.
fn in_the_job_file(t: TimedSystem<'_>) -> Option<String> {
    let key = t.figures.job_key.as_ref()?;
    let without = match (t.kind, t.system) {
        (Kind::Stepped, "auto") => ", or no method",
        (Kind::Stepped, _) => "; without a method compile chooses one, and merges stops where that is quicker",
        _ => "",
    };
    Some(format!("In the job file: {key}{without}."))
}

/// What a system would win or lose against the best, and why where the figures say so.
fn comparison_with_best(other: TimedSystem<'_>, best: Option<TimedSystem<'_>>) -> String {
    let TimedSystem { figures, .. } = other;
    let (what, is_many) = subject(other);
    let Some(best) = best else {
        let verb = if is_many { "take" } else { "takes" };
        return format!("{what} {verb} {}, within all limits.", duration(other.time_s));
    };
    let ratio = other.time_s / best.time_s;
    let mut out = format!("{what} {}", verb_of_ratio(ratio, is_many));
    if ratio > ALIKE && figures.is_held_by_z {
        out += ", because z must go with every line";
    }
    let [here, there] = [figures.incidence_deg.worst, best.figures.incidence_deg.worst];
    if there - here >= TOLD_DEG {
        let [here, there] = apart(here, there);
        out += &format!(", with beams at up to {here} instead of {there} deg");
    }
    out + "."
}

/// A system as the subject of a sentence, and whether that is a plural.
fn subject(t: TimedSystem<'_>) -> (String, bool) {
    let what = match (t.kind, t.figures.hardware) {
        (Kind::Stepped, _) => format!("Stepping by {}", t.system),
        (Kind::Zoom, Hardware::Own) => "The zoom optic".to_owned(),
        (Kind::Zoom, _) => "A zoom optic".to_owned(),
        (Kind::Tilt, Hardware::Own) => "The tilt table".to_owned(),
        (Kind::Tilt, _) => "A tilt table".to_owned(),
        (Kind::HeadTilt, Hardware::Own) => "The head that tilts".to_owned(),
        (Kind::HeadTilt, _) => "A head that tilts".to_owned(),
        (Kind::OnTheFly, _) if t.system == "sync-bands" => "Marking on the fly in bands of depth".to_owned(),
        (Kind::OnTheFly, _) => "Marking on the fly".to_owned(),
        (Kind::SevenAxes, _) => "Seven axes".to_owned(),
        (Kind::FiveAxes, _) => "Five axes".to_owned(),
        (Kind::ToolServo, _) => "A fast tool servo".to_owned(),
    };
    let whose = match t.figures.hardware {
        Hardware::Own => String::new(),
        Hardware::WithZoom(of) | Hardware::WithTilt(of) | Hardware::Other(of) => format!(" (that of {of})"),
        Hardware::Synchronised => " (with a controller that moves scanner and stage together)".to_owned(),
    };
    let is_many = matches!(t.kind, Kind::SevenAxes | Kind::FiveAxes);
    let whose = if is_many { whose.replace("that of", "those of") } else { whose };
    (what + &whose, is_many)
}

/// A multiple of the recommended time, for a table.
fn note_of_ratio(ratio: f64) -> String {
    match ratio {
        r if r > ALIKE => format!("{} times as long", factor(r)),
        r if r < 1.0 / ALIKE => format!("{} times as fast", factor(1.0 / r)),
        _ => "as fast".to_owned(),
    }
}

/// A multiple of the recommended time, as a verb with its object.
fn verb_of_ratio(ratio: f64, is_many: bool) -> String {
    let [be, take] = if is_many { ["are", "take"] } else { ["is", "takes"] };
    let is_two = |factor: f64| (factor - 2.0).abs() <= ROUND;
    match ratio {
        r if is_two(1.0 / r) => format!("{take} half as long"),
        r if is_two(r) => format!("{take} twice as long"),
        r if r > ALIKE => format!("{take} {}", note_of_ratio(r)),
        r if r < 1.0 / ALIKE => format!("{be} {}", note_of_ratio(r)),
        _ => format!("{take} as long"),
    }
}

/// A factor with as many digits as it is worth.
fn factor(v: f64) -> String {
    let text = plain(v, if v < 9.95 { 1 } else { 0 });
    text.strip_suffix(".0").map_or(text.clone(), str::to_owned)
}

/// A value and its limit, each with three digits or as many more as tell them apart.
fn apart(value: f64, limit: f64) -> [String; 2] {
    const MOST: usize = 4;
    let both = |more: usize| [value, limit].map(|v| three_digits(v, more));
    (0..MOST).map(both).find(|[a, b]| a != b).unwrap_or_else(|| both(MOST))
}

/// A value with three digits and `more` after the point, without zeros at its end.
fn three_digits(v: f64, more: usize) -> String {
    let digits = match v.abs() {
        ..0.1 => 3,
        ..1.0 => 2,
        ..100.0 => 1,
        _ => 0,
    };
    let text = plain(v, digits + more);
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

/// Names that share a text, in the order in which they come.
fn by_reason(all: impl Iterator<Item = (&'static str, String)>) -> Vec<(Vec<&'static str>, String)> {
    let mut out: Vec<(Vec<&'static str>, String)> = Vec::new();
    for (name, why) in all {
        match out.iter_mut().find(|(_, known)| *known == why) {
            Some((names, _)) => names.push(name),
            None => out.push((vec![name], why)),
        }
    }
    out
}

/// "a", "a and b", "a, b and c".
fn listed(names: &[&str]) -> String {
    match names {
        [first @ .., last] if !first.is_empty() => format!("{} and {last}", first.join(", ")),
        _ => names.concat(),
    }
}

impl fmt::Display for Beyond {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Focus([worst, allowed]) => {
                // Both in the unit of the worst.
                let (unit, um_per_unit) = if *worst >= 1000.0 { ("mm", 1000.0) } else { ("um", 1.0) };
                let [worst, allowed] = apart(worst / um_per_unit, allowed / um_per_unit);
                write!(f, "{worst} {unit} out of focus, {allowed} {unit} allowed")
            }
            Self::Incidence([worst, allowed]) => {
                let [worst, allowed] = apart(*worst, *allowed);
                write!(f, "beam incidence {worst} deg, {allowed} deg allowed")
            }
            Self::Displacement([worst, allowed]) => {
                let [worst, allowed] = apart(*worst, *allowed);
                write!(f, "displacement {worst} mm, {allowed} mm allowed")
            }
            Self::TooSharp => write!(f, "some marks turn or rise too sharply to be followed in focus"),
            Self::Travel(axes) => write!(f, "{axes}"),
            Self::Drive(figure, unit, [needed, limit]) => {
                let [needed, limit] = apart(*needed, *limit);
                write!(f, "{figure} of {needed} {unit}, {limit} {unit} allowed")
            }
        }
    }
}
