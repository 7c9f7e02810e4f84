//! Many jobs: each compiled on its own, unchanged ones skipped, a failing one harming no other.
//!
//! Consumes the arguments of the command; promises job folders and a [`Report`], which is JSON, text and a page. Three
//! steps, on one machine or on many:
//!
//! 1. [`plan`] makes a [`Unit`] of every job: what to compile, the hash of its inputs, the expected cost.
//! 2. [`work()`] brings the folder of one unit up to date and says what became of it. It may be done twice, on several
//!    machines at once, in any order: a folder is held while it is in work, and one that is up to date is left alone.
//! 3. [`collect`] makes one report of what became of all units.
//!
//! [`run`] does the second on the threads of this process. [`engine`] has it done by other machines, which share the
//! folders: units are a file of JSON lines ([`units`]), and every unit leaves a report of its own ([`fragment`]).
//!
//! A job is unchanged when its folder's manifest names the same version, mode, seed, objective, job file and inputs by
//! hash, and every file it lists is there with its size. Outcomes are in the order of the list.

pub mod collect;
#[cfg(feature = "fleet")]
pub mod engine;
pub mod fragment;
mod index;
pub mod isolated;
mod list;
#[cfg(feature = "fleet")]
pub mod of_sweep;
mod outcome;
mod report;
mod unit;
pub mod units;
mod units_per_process;
pub mod work;

use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

pub use index::index_html;
pub use list::plan;
pub use outcome::{Outcome, State};
pub use report::Report;
pub use unit::Unit;
pub use work::{Settings, work};

use work::End;

/// Brings the folders of all units up to date, as many at a time as there are threads. `on_outcome` is called for
/// every unit as it ends.
///
/// # Panics
/// On units of a sweep.
pub fn run(units: &[Unit], settings: &Settings<'_>, on_outcome: &mut (dyn FnMut(&Outcome) + Send)) -> Report {
    let queue = Queue { units, next: AtomicUsize::new(0), on_outcome: Mutex::new(on_outcome) };
    // Units that no thread has begun when `settings.stop` is set stay `Left`.
    let mut outcomes: Vec<Outcome> = units.iter().map(|unit| Outcome::of(unit, State::Left)).collect();
    // Plain threads, not tasks of the pool: a thread of the pool that waits for the parts of one job
    // would begin another one meanwhile, and the jobs in memory at a time would have no bound.
    std::thread::scope(|scope| {
        // As many as the pool has: each job that is worked on uses the pool too.
        let threads = rayon::current_num_threads().min(units.len());
        let workers: Vec<_> = (0..threads).map(|_| scope.spawn(|| queue.work_through(settings))).collect();
        for (i, outcome) in workers.into_iter().flat_map(|w| w.join().expect("panics of a job are caught")) {
            outcomes[i] = outcome;
        }
    });
    Report(outcomes)
}

/// Units that several threads work on.
struct Queue<'a> {
    units: &'a [Unit],
    /// Number of the next unit.
    next: AtomicUsize,
    on_outcome: Mutex<&'a mut (dyn FnMut(&Outcome) + Send)>,
}

impl Queue<'_> {
    /// Works on one unit after another until there is none left or all are to stop; returns what became of each, by
    /// number.
    fn work_through(&self, settings: &Settings<'_>) -> Vec<(usize, Outcome)> {
        let mut outcomes = Vec::new();
        while !settings.stop.load(Ordering::Relaxed) {
            // Only a counter: nothing is published through it.
            let i = self.next.fetch_add(1, Ordering::Relaxed);
            let Some(unit) = self.units.get(i) else { break };
            let End::Job(outcome) = work(unit, settings).end else { unreachable!("units of a batch are jobs") };
            self.on_outcome.lock().expect("on_outcome does not panic")(&outcome);
            outcomes.push((i, outcome));
        }
        outcomes
    }
}
