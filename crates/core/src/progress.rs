//! How far a long task is, in whole percent.
//!
//! A [`Task`] is divided into smaller ones before work begins, each with its share of the whole, and the smallest
//! count steps. Any thread may count: a step costs two atomic additions, so loops count chunks of work.
//! What is counted is reported to one function, from 0 to 100, rising, each percent once at most. Nothing that is
//! computed depends on it.

use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::sync::{Arc, Mutex, PoisonError};

/// What the whole is divided into: a share of it times a number of steps below 2^31 fits 64 bits.
const WHOLE: u64 = 1 << 32;

/// The whole, and to whom it is reported.
struct Whole<'a> {
    done: AtomicU64,
    /// The percent that was reported last.
    reported: Mutex<u8>,
    report: Box<dyn Fn(u8) + Send + Sync + 'a>,
}

impl Whole<'_> {
    fn add(&self, units: u64) {
        let done = self.done.fetch_add(units, Relaxed) + units;
        let percent = |units: u64| (units * 100 / WHOLE) as u8;
        if percent(done) == percent(done - units) {
            return;
        }
        // Held while it is reported: of two threads none reports less than the one before.
        let mut reported = self.reported.lock().unwrap_or_else(PoisonError::into_inner);
        if percent(done) > *reported {
            *reported = percent(done);
            (self.report)(*reported);
        }
    }
}

/// A task whose progress is reported, or a part of one. When it is dropped it is done, whatever was counted.
pub struct Task<'a> {
    /// None of a task whose progress is not reported.
    whole: Option<Arc<Whole<'a>>>,
    /// The task's share of the whole.
    units: u64,
    /// The steps that it has, and those that are done.
    steps: u64,
    done: AtomicU64,
}

impl<'a> Task<'a> {
    /// A whole task. `report` is called with 0 at once, and with 100 when all of it is done.
    pub fn new(report: impl Fn(u8) + Send + Sync + 'a) -> Self {
        report(0);
        let whole = Whole { done: AtomicU64::new(0), reported: Mutex::new(0), report: Box::new(report) };
        Self { whole: Some(Arc::new(whole)), units: WHOLE, steps: 1, done: AtomicU64::new(0) }
    }

    /// A task whose progress is not reported.
    pub fn silent() -> Self {
        Self { whole: None, units: 0, steps: 1, done: AtomicU64::new(0) }
    }

    /// The task in parts, with shares in proportion to the weights.
    pub fn split<const N: usize>(self, weights: [u64; N]) -> [Self; N] {
        let sum = weights.iter().sum();
        let mut from = 0;
        let ranges = weights.map(|weight| {
            from += weight;
            [from - weight, from]
        });
        let whole = self.divided();
        ranges.map(|range| whole.part(range, sum))
    }

    /// The task in equal parts.
    pub fn parts(self, count: usize) -> Vec<Self> {
        let (count, whole) = (count as u64, self.divided());
        (0..count).map(|i| whole.part([i, i + 1], count)).collect()
    }

    /// The task as so many equal steps.
    pub fn of_steps(mut self, steps: usize) -> Self {
        self.steps = (steps as u64).max(1);
        self
    }

    /// Counts a step.
    pub fn step(&self) {
        self.count(1);
    }

    fn count(&self, steps: u64) {
        let Some(whole) = &self.whole else { return };
        let before = self.done.fetch_add(steps, Relaxed).min(self.steps);
        let after = (before + steps).min(self.steps);
        whole.add(self.units * after / self.steps - self.units * before / self.steps);
    }

    /// What parts are made of; itself it has nothing to count any more.
    fn divided(mut self) -> Share<'a> {
        Share { whole: self.whole.clone(), units: std::mem::take(&mut self.units) }
    }
}

impl Drop for Task<'_> {
    fn drop(&mut self) {
        self.count(self.steps);
    }
}

/// A share of the whole that is divided into tasks.
struct Share<'a> {
    whole: Option<Arc<Whole<'a>>>,
    units: u64,
}

impl<'a> Share<'a> {
    /// The task from one to the other of `sum` equal marks.
    fn part(&self, [from, to]: [u64; 2], sum: u64) -> Task<'a> {
        let at = |mark: u64| self.units * mark / sum.max(1);
        Task { whole: self.whole.clone(), units: at(to) - at(from), steps: 1, done: AtomicU64::new(0) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parallel;

    /// What a task reports while `work` is done on it.
    fn reported(work: impl FnOnce(Task<'_>)) -> Vec<u8> {
        let heard = Mutex::new(Vec::new());
        work(Task::new(|percent| heard.lock().expect("one thread").push(percent)));
        heard.into_inner().expect("all have ended")
    }

    #[test]
    fn steps_are_reported_in_whole_percent() {
        let four = reported(|task| {
            let task = task.of_steps(4);
            (0..4).for_each(|_| task.step());
        });
        assert_eq!(four, [0, 25, 50, 75, 100]);
        let many = reported(|task| {
            let task = task.of_steps(100_000);
            (0..100_000).for_each(|_| task.step());
        });
        assert_eq!(many, (0..=100).collect::<Vec<u8>>());
    }

    #[test]
    fn parts_have_their_shares_whatever_their_order() {
        let found = reported(|task| {
            let [a, b, c] = task.split([1, 2, 1]);
            drop(c);
            let inner = b.parts(2);
            let counted = a.of_steps(4);
            counted.step();
            drop(inner);
        });
        // The last quarter, a quarter of the first, the two halves of the half, and what is left of the first.
        assert_eq!(found, [0, 25, 31, 56, 81, 100]);
    }

    #[test]
    fn a_task_that_ends_early_or_counts_too_much_is_done_once() {
        assert_eq!(reported(|task| drop(task)), [0, 100]);
        let over = reported(|task| {
            let [a, b] = task.split([1, 1]);
            let a = a.of_steps(2);
            (0..7).for_each(|_| a.step());
            drop(a);
            drop(b.of_steps(0));
        });
        assert_eq!(over, [0, 25, 50, 100]);
        assert_eq!(reported(|task| drop(task.parts(0))), [0], "no part is left that could be done");
        let silent = Task::silent().of_steps(3);
        silent.step();
        drop(silent.parts(3));
    }

    #[test]
    fn percents_rise_from_any_number_of_threads() {
        for threads in [1, 2, 7] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
            let found = reported(|task| {
                pool.install(|| {
                    let task = task.of_steps(5000);
                    parallel::each(5000, &|_| task.step());
                });
            });
            assert!(found.windows(2).all(|w| w[0] < w[1]), "{threads}: {found:?}");
            assert_eq!((found[0], found[found.len() - 1]), (0, 100), "{threads}");
        }
    }
}
