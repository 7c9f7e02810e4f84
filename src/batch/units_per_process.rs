//! Which units are worked on by one process.
//!
//! A process costs tens of milliseconds on every engine, so small units share one. What a unit costs is known from the
//! sizes of its files only, so groups become smaller towards the end (factoring: Hummel, Schonberg and Flynn 1992): a
//! group that takes longer than expected is made up for by those that are given out after it.

use super::unit::Unit;

/// Groups for `slots` processes at a time, in the order in which they are to be given out: the largest units first.
#[cfg(feature = "fleet")]
pub fn groups<'a>(units: &[&'a Unit], slots: usize) -> Vec<Vec<&'a Unit>> {
    let sorted = by_cost(units);
    let all: f64 = sorted.iter().map(|unit| unit.cost_s).sum();
    let slots = slots.max(1) as f64;
    // At most an eighth of what one slot has to do, at least enough that there are no more than some 64 to a slot.
    let [most, least] = [8.0, 64.0].map(|parts| all / (parts * slots));
    let mut out = Vec::new();
    let mut rest = sorted.as_slice();
    let mut left = all;
    while !rest.is_empty() {
        let wanted = (left / (2.0 * slots)).clamp(least, most);
        let mut count = 0;
        let mut cost = 0.0;
        while count < rest.len() && (count == 0 || cost + rest[count].cost_s <= wanted) {
            cost += rest[count].cost_s;
            count += 1;
        }
        let (group, others) = rest.split_at(count);
        out.push(group.to_vec());
        (rest, left) = (others, left - cost);
    }
    out
}

/// All units in `count` shares of about the same cost, for engines that are given one array of tasks; each unit goes
/// to the share that has least so far, the largest first (Graham 1969).
pub(super) fn shares(units: &[Unit], count: usize) -> Vec<Vec<&Unit>> {
    let mut out: Vec<(f64, Vec<&Unit>)> = vec![(0.0, Vec::new()); count];
    for unit in by_cost(&units.iter().collect::<Vec<_>>()) {
        let least = (0..count).min_by(|&a, &b| out[a].0.total_cmp(&out[b].0).then(a.cmp(&b)));
        let share = &mut out[least.expect("a share is one of one or more")];
        share.0 += unit.cost_s;
        share.1.push(unit);
    }
    out.into_iter().map(|(_, share)| share).collect()
}

/// The largest first; of equal ones that of the lower number.
fn by_cost<'a>(units: &[&'a Unit]) -> Vec<&'a Unit> {
    let mut sorted = units.to_vec();
    sorted.sort_by(|a, b| b.cost_s.total_cmp(&a.cost_s).then(a.id.cmp(&b.id)));
    sorted
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::super::unit::{Compile, Task};
    use super::*;
    use terrace_input::job::Overrides;
    use terrace_report::job_folder::Hashes;

    fn units(costs: &[f64]) -> Vec<Unit> {
        let of = |(id, &cost_s): (usize, &f64)| {
            let task = Task::Compile(Compile { folder: format!("{id}.job").into(), verify: false, pictures: true });
            let unit = Unit::new(id, Path::new("a.toml"), task, &Overrides::default(), None, &Hashes::default());
            Unit { cost_s, ..unit }
        };
        costs.iter().enumerate().map(of).collect()
    }

    fn cost(group: &[&Unit]) -> f64 {
        group.iter().map(|unit| unit.cost_s).sum()
    }

    #[test]
    fn small_units_share_a_process_and_groups_shrink_towards_the_end() {
        let units = units(&[0.05; 2000]);
        let groups = groups(&units.iter().collect::<Vec<_>>(), 2);
        let sizes: Vec<usize> = groups.iter().map(Vec::len).collect();
        assert_eq!(sizes.iter().sum::<usize>(), 2000);
        assert!(sizes.windows(2).all(|pair| pair[0] >= pair[1]) && sizes[0] <= 125, "{sizes:?}");
        assert!((20..=128).contains(&sizes.len()), "{sizes:?}");
        // The last groups are small: what one slot waits for the other is little.
        assert!(cost(groups.last().expect("groups")) < 1.0, "{sizes:?}");
    }

    #[test]
    fn a_large_unit_is_alone_and_comes_first() {
        let mut costs = vec![1.0; 100];
        costs[70] = 100.0;
        let units = units(&costs);
        let groups = groups(&units.iter().collect::<Vec<_>>(), 2);
        assert_eq!(groups[0].iter().map(|unit| unit.id).collect::<Vec<_>>(), [70]);
        let mut ids: Vec<usize> = groups.iter().flatten().map(|unit| unit.id).collect();
        ids.sort_unstable();
        assert_eq!(ids, (0..100).collect::<Vec<_>>());
    }

    #[test]
    fn shares_cost_about_the_same_and_hold_every_unit_once() {
        let units = units(&(0..200).map(|i| 1.0 + f64::from(i % 100)).collect::<Vec<_>>());
        let shares = shares(&units, 7);
        let all: f64 = units.iter().map(|unit| unit.cost_s).sum();
        assert!(shares.iter().all(|share| (cost(share) - all / 7.0).abs() < 0.02 * all), "{shares:?}");
        let mut ids: Vec<usize> = shares.iter().flatten().map(|unit| unit.id).collect();
        ids.sort_unstable();
        assert_eq!(ids, (0..200).collect::<Vec<_>>());
        // More shares than units: some are empty.
        assert_eq!(super::shares(&units[..2], 3).iter().filter(|share| share.is_empty()).count(), 1);
    }
}
