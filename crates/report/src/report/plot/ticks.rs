//! Axes: which range they show, and where which labels stand.
//!
//! Steps are 1, 2 or 5 times a power of ten; of the steps whose labels have room the finest is taken. Labels
//! are made from whole multiples of the step, so none ends in digits that mean nothing. Very large and very
//! small numbers are divided by a power of a thousand that the title of the axis names.

use super::{Axis, Limit, words};
use crate::report::plain;
use terrace_core::math;

/// A place on an axis; the finer ones of a logarithmic axis have no label.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Tick {
    pub value: f64,
    pub label: String,
}

/// Where the labels of an axis stand.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TickSpace {
    /// Length of the axis.
    pub length: f64,
    /// How far labels may reach beyond its two ends.
    pub beyond: [f64; 2],
    /// Whether labels stand side by side, not above each other.
    pub is_level: bool,
    /// Size of their font.
    pub font: f64,
}

impl TickSpace {
    /// Half of what a label takes along the axis, air included.
    fn half(&self, label: &str) -> f64 {
        if self.is_level { words::width(label, self.font) / 2.0 + 5.0 } else { 0.75 * self.font }
    }
}

/// Whether an axis ends at ticks or where the values end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AxisEnds {
    /// At ticks, next beyond the values.
    AtTicks,
    /// Where the values end.
    AtValues,
}

/// An axis with its labels.
#[derive(Clone, Debug)]
pub(crate) struct Ruler {
    pub lo: f64,
    pub hi: f64,
    pub is_log: bool,
    pub ticks: Vec<Tick>,
    /// Name and unit.
    pub title: String,
}

/// Air at an end of an axis, as a share of its length.
const AIR: f64 = 0.04;

/// Whether a value can be shown on an axis.
pub fn is_shown(v: f64, is_log: bool) -> bool {
    v.abs() <= 1e100 && (!is_log || v >= 1e-100)
}

/// Least and largest of the values that can be shown.
pub fn range(values: impl Iterator<Item = f64>, is_log: bool) -> Option<[f64; 2]> {
    values.filter(|&v| is_shown(v, is_log)).fold(None, |range, v| match range {
        None => Some([v, v]),
        Some([lo, hi]) => Some([v.min(lo), v.max(hi)]),
    })
}

/// A range that ends a little beyond limits, so that none lies on the frame; not below 0 where it was not.
pub(crate) fn with_air([lo, hi]: [f64; 2], limits: &[Limit], is_log: bool) -> [f64; 2] {
    let by = if is_log { math::pow(hi / lo, AIR) } else { AIR * (hi - lo) };
    let least = if lo >= 0.0 { 0.0 } else { f64::NEG_INFINITY };
    let around = |v: f64| if is_log { [v / by, v * by] } else { [(v - by).max(least), v + by] };
    let shown = limits.iter().map(|l| l.value).filter(|&v| is_shown(v, is_log));
    shown.map(around).fold([lo, hi], |a, b| [a[0].min(b[0]), a[1].max(b[1])])
}

/// A range that is not a single point.
fn widened([lo, hi]: [f64; 2], is_log: bool) -> [f64; 2] {
    if is_log {
        return if hi / lo < 1.001 { [lo / 2.0, hi * 2.0] } else { [lo, hi] };
    }
    let size = lo.abs().max(hi.abs());
    match hi - lo {
        // Nothing but zeros, or so near to them that powers of ten end.
        _ if size < 1e-100 => [0.0, 1.0],
        d if d > 1e-9 * size => [lo, hi],
        _ => {
            let by = 0.1 * size;
            [lo - by, hi + by]
        }
    }
}

impl Ruler {
    /// An axis over a range; without one over 0 to 1, or 1 to 10.
    pub fn new(axis: &Axis, range: Option<[f64; 2]>, ends: AxisEnds, space: TickSpace) -> Self {
        let empty = if axis.is_log { [1.0, 10.0] } else { [0.0, 1.0] };
        let [lo, hi] = widened(range.unwrap_or(empty), axis.is_log);
        if axis.is_log { Self::log(axis, [lo, hi], ends, space) } else { Self::linear(axis, [lo, hi], ends, space) }
    }

    /// An axis of even steps: the finest whose labels have room, or the coarsest without those that do not.
    fn linear(axis: &Axis, range: [f64; 2], ends: AxisEnds, space: TickSpace) -> Self {
        let most = if space.is_level { 10 } else { 6 };
        let mut finer_first = (2..=most).rev().map(|count| Self::of_steps(axis, range, count, ends).inside(space));
        let with_room = finer_first.find(|ruler| ruler.has_room(space));
        with_room.unwrap_or_else(|| Self::of_steps(axis, range, 2, ends).thinned(space))
    }

    /// An axis of at most `most` even steps over a range, rounded outwards where it ends at ticks.
    fn of_steps(axis: &Axis, [lo, hi]: [f64; 2], most: u32, ends: AxisEnds) -> Self {
        let exponent = thousands(lo.abs().max(hi.abs()));
        let step = Step::of((hi - lo) / f64::from(most));
        let outer = [step.below(lo), step.above(hi)];
        let [lo, hi] = match ends {
            AxisEnds::AtTicks => outer.map(|k| step.at(k)),
            AxisEnds::AtValues => [lo, hi],
        };
        let ticks = (outer[0]..=outer[1])
            .map(|k| Tick { value: step.at(k), label: step.label(k, exponent) })
            .filter(|t| (lo..=hi).contains(&t.value))
            .collect();
        Self { lo, hi, is_log: false, ticks, title: title(axis, exponent) }
    }

    /// A logarithmic axis: as many labels as have room.
    fn log(axis: &Axis, [lo, hi]: [f64; 2], ends: AxisEnds, space: TickSpace) -> Self {
        // A logarithmic axis is not rounded outwards to ticks, but gets air instead.
        let air = if ends == AxisEnds::AtTicks { math::pow(hi / lo, AIR) } else { 1.0 };
        let range = [lo / air, hi * air];
        let [fine, middle, coarse] = [&[1, 2, 5][..], &[1, 3], &[1]];
        let labellings = [(fine, 1), (middle, 1), (coarse, 1), (coarse, 2), (coarse, 5), (coarse, 10), (coarse, 25)];
        let mut finer_first = labellings.into_iter().map(|(multiples, every)| {
            let labelled = PowerLabels { multiples, every };
            Self::of_powers(axis, range, labelled).inside(space)
        });
        // Within less than a decade the ticks are those of an even axis.
        finer_first.find(|ruler| ruler.has_room(space)).unwrap_or_else(|| {
            let mut even = Self::linear(axis, range, AxisEnds::AtValues, space);
            even.is_log = true;
            even.thinned(space)
        })
    }

    /// A logarithmic axis over a range with these labels.
    fn of_powers(axis: &Axis, [lo, hi]: [f64; 2], labelled: PowerLabels<'_>) -> Self {
        let [first, last] = [math::log10(lo).floor() as i32, math::log10(hi).ceil() as i32];
        let has_multiples = last - first <= 8;
        let ticks = (first..=last)
            .flat_map(|e| (1..10).map(move |m| (m, e)))
            .filter(|&(m, _)| m == 1 || has_multiples)
            .map(|(m, e)| {
                let label = if labelled.has(m, e) { power(m, e) } else { String::new() };
                Tick { value: f64::from(m) * ten(e), label }
            })
            .filter(|t| (lo..=hi).contains(&t.value))
            .collect();
        Self { lo, hi, is_log: true, ticks, title: title(axis, 0) }
    }

    /// The ticks that have a label.
    fn labels(&self) -> impl Iterator<Item = &Tick> {
        self.ticks.iter().filter(|t| !t.label.is_empty())
    }

    /// How far along the axis a value lies, from 0 to 1.
    pub fn share(&self, v: f64) -> f64 {
        if self.is_log {
            math::ln(v / self.lo) / math::ln(self.hi / self.lo)
        } else {
            (v - self.lo) / (self.hi - self.lo)
        }
    }

    /// From and to where on the axis a label reaches.
    fn reach(&self, tick: &Tick, space: TickSpace) -> [f64; 2] {
        let middle = self.share(tick.value) * space.length;
        let half = space.half(&tick.label);
        [middle - half, middle + half]
    }

    /// Without the labels that reach too far beyond the ends.
    fn inside(mut self, space: TickSpace) -> Self {
        for k in 0..self.ticks.len() {
            let [from, to] = self.reach(&self.ticks[k], space);
            if from < -space.beyond[0] || to > space.length + space.beyond[1] {
                self.ticks[k].label.clear();
            }
        }
        self
    }

    /// Whether there are labels enough to read the axis by, and none meets the next.
    fn has_room(&self, space: TickSpace) -> bool {
        let reaches: Vec<[f64; 2]> = self.labels().map(|tick| self.reach(tick, space)).collect();
        reaches.len() >= 2 && reaches.windows(2).all(|pair| pair[0][1] <= pair[1][0])
    }

    /// Without the labels that have no room next to those before them.
    fn thinned(self, space: TickSpace) -> Self {
        let mut thin = self.inside(space);
        // Where the last label that stays ends.
        let mut end = f64::NEG_INFINITY;
        for k in 0..thin.ticks.len() {
            let [from, to] = thin.reach(&thin.ticks[k], space);
            if from < end {
                thin.ticks[k].label.clear();
            } else if !thin.ticks[k].label.is_empty() {
                end = to;
            }
        }
        thin
    }

    /// Width of the widest label.
    pub fn widest(&self, font: f64) -> f64 {
        self.ticks.iter().map(|t| words::width(&t.label, font)).fold(0.0, f64::max)
    }
}

/// Which ticks of a logarithmic axis have labels.
#[derive(Clone, Copy)]
struct PowerLabels<'a> {
    /// These multiples of a power of ten ...
    multiples: &'a [i32],
    /// ... of every so many decades.
    every: i32,
}

impl PowerLabels<'_> {
    /// Whether `m` times ten to the power of `e` has one.
    fn has(self, m: i32, e: i32) -> bool {
        self.multiples.contains(&m) && e.rem_euclid(self.every) == 0
    }
}

/// A step of 1, 2 or 5 times a power of ten.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Step {
    factor: i64,
    exponent: i32,
}

impl Step {
    /// The least that is not below `v`, which is above 0.
    fn of(v: f64) -> Self {
        let mut exponent = math::log10(v).floor() as i32;
        let mut factor = 1;
        // A hair more is the rounding of the division that made v.
        while factor as f64 * ten(exponent) < v * (1.0 - 1e-9) {
            (factor, exponent) = match factor {
                1 => (2, exponent),
                2 => (5, exponent),
                _ => (1, exponent + 1),
            };
        }
        Self { factor, exponent }
    }

    fn size(self) -> f64 {
        self.factor as f64 * ten(self.exponent)
    }

    /// Multiple `k`. A power of ten is exact and a fraction of it is not: it is divided by.
    fn at(self, k: i64) -> f64 {
        let n = (k * self.factor) as f64;
        if self.exponent < 0 { n / ten(-self.exponent) } else { n * ten(self.exponent) }
    }

    /// Number of the greatest multiple up to `v`; one that exceeds it by the rounding of a division counts.
    fn below(self, v: f64) -> i64 {
        (v / self.size() + 1e-9).floor() as i64
    }

    /// Number of the least multiple from `v` on; one that falls short of it by the rounding of a division counts.
    fn above(self, v: f64) -> i64 {
        (v / self.size() - 1e-9).ceil() as i64
    }

    /// Multiple `k` divided by a power of ten.
    fn label(self, k: i64, by: i32) -> String {
        let e = self.exponent - by;
        let n = (k * self.factor) as f64;
        if e < 0 { plain(n / ten(-e), e.unsigned_abs() as usize) } else { plain(n * ten(e), 0) }
    }
}

/// The power of a thousand that values up to `most` are divided by.
fn thousands(most: f64) -> i32 {
    if most == 0.0 || (1e-3..1e6).contains(&most) { 0 } else { 3 * (math::log10(most) / 3.0).floor() as i32 }
}

fn ten(exponent: i32) -> f64 {
    10f64.powi(exponent)
}

/// Name and unit of an axis whose values are divided by a power of ten.
fn title(axis: &Axis, exponent: i32) -> String {
    let by = if exponent == 0 { String::new() } else { format!("10{}", raised(exponent)) };
    let unit = [by, axis.unit.clone()].join(" ");
    [axis.name.as_str(), unit.trim()].into_iter().filter(|w| !w.is_empty()).collect::<Vec<_>>().join(", ")
}

/// A number as an exponent.
fn raised(exponent: i32) -> String {
    const DIGITS: [char; 10] = ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'];
    let sign = if exponent < 0 { "⁻" } else { "" };
    let digits = exponent.unsigned_abs().to_string();
    sign.to_owned() + &digits.bytes().map(|b| DIGITS[usize::from(b - b'0')]).collect::<String>()
}

/// `m` times a power of ten.
fn power(m: i32, exponent: i32) -> String {
    match exponent {
        -4..=5 => plain(f64::from(m) * ten(exponent), (-exponent).max(0) as usize),
        _ if m == 1 => format!("10{}", raised(exponent)),
        _ => format!("{m}×10{}", raised(exponent)),
    }
}

/// A value in six digits at most, without zeros at its end.
pub(crate) fn brief(v: f64) -> String {
    if v == 0.0 || !(1e-4..1e7).contains(&v.abs()) {
        return if v == 0.0 { "0".into() } else { format!("{v:.3e}") };
    }
    let decimals = (5 - math::log10(v.abs()).floor() as i32).max(0) as usize;
    let text = plain(v, decimals);
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(axis: &Axis, range: [f64; 2], ends: AxisEnds) -> Vec<String> {
        let space = TickSpace { length: 800.0, beyond: [40.0; 2], is_level: true, font: 12.0 };
        Ruler::new(axis, Some(range), ends, space)
            .ticks
            .into_iter()
            .map(|t| t.label)
            .filter(|l| !l.is_empty())
            .collect()
    }

    #[test]
    fn steps_are_one_two_or_five() {
        for (v, size) in [(0.9, 1.0), (1.0, 1.0), (1.1, 2.0), (2.4, 5.0), (5.1, 10.0), (0.03, 0.05), (700.0, 1000.0)] {
            assert_eq!(Step::of(v).size(), size, "{v}");
        }
        let plain = Axis::new("x", "mm");
        assert_eq!(labels(&plain, [0.0, 1.0], AxisEnds::AtTicks).first().map(String::as_str), Some("0.0"));
        assert_eq!(
            labels(&plain, [0.0, 0.3], AxisEnds::AtTicks),
            ["0.00", "0.05", "0.10", "0.15", "0.20", "0.25", "0.30"]
        );
        assert_eq!(
            labels(&plain, [-7.0, 12.0], AxisEnds::AtTicks),
            ["-8", "-6", "-4", "-2", "0", "2", "4", "6", "8", "10", "12"]
        );
        assert_eq!(
            labels(&plain, [-7.0, 12.0], AxisEnds::AtValues),
            ["-6", "-4", "-2", "0", "2", "4", "6", "8", "10", "12"]
        );
    }

    #[test]
    fn long_labels_stand_further_apart() {
        let some = labels(&Axis::new("sigma", ""), [13_203.8, 13_203.801], AxisEnds::AtValues);
        assert!((2..=6).contains(&some.len()) && some.iter().all(|l| l.len() >= 10), "{some:?}");
    }

    #[test]
    fn scale_factors_of_large_values_go_to_the_title() {
        let space = TickSpace { length: 200.0, beyond: [12.0; 2], is_level: false, font: 12.0 };
        let ruler = |lo, hi| Ruler::new(&Axis::new("jerk", "mm/s³"), Some([lo, hi]), AxisEnds::AtTicks, space);
        let large = ruler(0.0, 4.2e7);
        assert_eq!((large.title.as_str(), large.ticks[1].label.as_str()), ("jerk, 10⁶ mm/s³", "10"));
        let small = ruler(-3e-5, 1e-5);
        assert_eq!((small.title.as_str(), small.ticks[0].label.as_str()), ("jerk, 10⁻⁶ mm/s³", "-30"));
        assert_eq!(ruler(0.0, 0.0).ticks.last().map(|t| t.value), Some(1.0));
    }

    #[test]
    fn a_logarithmic_axis_has_powers_or_their_twos_and_fives() {
        let axis = Axis::new("t", "s").log();
        assert_eq!(labels(&axis, [0.5, 40.0], AxisEnds::AtValues), ["0.5", "1", "2", "5", "10", "20"]);
        let wide = labels(&axis, [1e-12, 1e12], AxisEnds::AtValues);
        assert!(wide.contains(&"10⁻¹⁰".to_owned()) && wide.contains(&"1".to_owned()), "{wide:?}");
        let narrow = labels(&axis, [52.0, 58.0], AxisEnds::AtValues);
        assert!(narrow.len() >= 3 && narrow.contains(&"55".to_owned()), "{narrow:?}");
        let gap = Ruler::new(
            &axis,
            range([0.0, -1.0, f64::NAN].into_iter(), true),
            AxisEnds::AtValues,
            TickSpace { length: 100.0, beyond: [20.0; 2], is_level: true, font: 12.0 },
        );
        assert_eq!([gap.lo, gap.hi], [1.0, 10.0]);
    }

    #[test]
    fn tick_labels_are_short() {
        let said = [0.0, 100.0, 1837.25, 13_203.8, 0.1 + 0.2, -2.5e-7, 1e9].map(brief);
        assert_eq!(said, ["0", "100", "1837.25", "13203.8", "0.3", "-2.500e-7", "1.000e9"]);
    }
}
