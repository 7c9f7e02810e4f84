//! Work on all threads, a task for each index.
//!
//! Promises results in the order of the indices, whatever the number of threads. Loops go through one instance of
//! rayon's parallel iterators ([`each`]), which takes its function by reference: an instance for every caller would
//! make the program larger and slower to compile.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};
use std::sync::{Mutex, MutexGuard, PoisonError};

use rayon::prelude::*;

/// How many threads work is done on. What is computed must not depend on it.
pub fn threads() -> usize {
    rayon::current_num_threads()
}

/// What `work` makes on one of the threads that the other functions here use. Memory that a thread lets go is its own
/// to take up again: what runs on two threads in turn, here and there, holds more of it.
pub fn on_pool<T: Send>(work: impl FnOnce() -> T + Send) -> T {
    rayon::scope(|_| work())
}

/// Does `work` for 0 to `count`, in any order.
pub fn each(count: usize, work: &(dyn Fn(usize) + Sync)) {
    (0..count).into_par_iter().for_each(work);
}

/// What `of` makes of 0 to `count`, in their order.
pub fn map<T: Send>(count: usize, of: impl Fn(usize) -> T + Sync) -> Vec<T> {
    let results: Vec<Mutex<Option<T>>> = (0..count).map(|_| Mutex::new(None)).collect();
    each(count, &|i| {
        // Made before its place is locked.
        let result = of(i);
        *locked(&results[i]) = Some(result);
    });
    results.into_iter().filter_map(|result| result.into_inner().unwrap_or_else(PoisonError::into_inner)).collect()
}

/// What `of` makes of items that are its own, in their order; it is called with their indices.
pub fn map_items<I: Send, T: Send>(items: Vec<I>, of: impl Fn(usize, I) -> T + Sync) -> Vec<T> {
    let items: Vec<Mutex<Option<I>>> = items.into_iter().map(|item| Mutex::new(Some(item))).collect();
    let results = map(items.len(), |i| locked(&items[i]).take().map(|item| of(i, item)));
    results.into_iter().flatten().collect()
}

/// Hands what `of` makes of items that are its own to `take`, in their order. They are begun in order too, so that
/// little of what is made has to wait for its turn.
pub fn in_order<I: Send, T: Send>(items: Vec<I>, of: impl Fn(usize, I) -> T + Sync, take: impl FnMut(T) + Send) {
    let items: Vec<Mutex<Option<I>>> = items.into_iter().map(|item| Mutex::new(Some(item))).collect();
    let next = AtomicUsize::new(0);
    let handover = Mutex::new(Handover { taken: 0, waiting: BTreeMap::new(), take });
    each(items.len(), &|_| {
        let i = next.fetch_add(1, Relaxed);
        let Some(item) = locked(&items[i]).take() else { return };
        let result = of(i, item);
        locked(&handover).offer(i, result);
    });
}

/// Hands results over in the order of their indices.
struct Handover<T, F> {
    /// How many were taken.
    taken: usize,
    /// Results that came before their turn, by their indices.
    waiting: BTreeMap<usize, T>,
    take: F,
}

impl<T, F: FnMut(T)> Handover<T, F> {
    /// Adds the result of an index, and hands over all whose turn has come.
    fn offer(&mut self, index: usize, result: T) {
        self.waiting.insert(index, result);
        while let Some(result) = self.waiting.remove(&self.taken) {
            (self.take)(result);
            self.taken += 1;
        }
    }
}

/// What two functions make, at the same time.
pub fn both<A: Send, B: Send>(a: impl FnOnce() -> A + Send, b: impl FnOnce() -> B + Send) -> (A, B) {
    rayon::join(a, b)
}

/// What `work` makes on a thread whose stack has so many bytes, for recursion of bounded depth.
///
/// # Errors
/// Where the system has no room for one.
pub fn on_stack<T: Send>(bytes: usize, work: impl FnOnce() -> T + Send) -> std::io::Result<T> {
    std::thread::scope(|scope| {
        let thread = std::thread::Builder::new().stack_size(bytes).spawn_scoped(scope, work)?;
        Ok(thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)))
    })
}

/// What folding makes of 0 to `count`: `add` adds an index to something that begins as `none`, and `merge` joins two of
/// these. Which indices are added to which one is chance: neither order nor grouping may matter.
pub fn fold<T: Send>(
    count: usize,
    none: impl Fn() -> T + Sync,
    add: impl Fn(&mut T, usize) + Sync,
    merge: impl Fn(&mut T, T),
) -> T {
    let idle: Mutex<Vec<T>> = Mutex::new(Vec::new());
    each(count, &|i| {
        let mut mine = locked(&idle).pop().unwrap_or_else(&none);
        add(&mut mine, i);
        locked(&idle).push(mine);
    });
    let mut sums = idle.into_inner().unwrap_or_else(PoisonError::into_inner).into_iter();
    let mut out = sums.next().unwrap_or_else(none);
    sums.for_each(|sum| merge(&mut out, sum));
    out
}

/// A panic of another task ends the program's run; what it has locked is not looked at again.
fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_made_is_taken_in_the_order_of_the_items() {
        let mut taken = Vec::new();
        let slow = |k: usize, item: String| {
            std::thread::sleep(std::time::Duration::from_micros((k % 3) as u64 * 200));
            (k, item)
        };
        in_order((0..100).map(|k| k.to_string()).collect(), slow, |one| taken.push(one));
        assert_eq!(taken, (0..100).map(|k| (k, k.to_string())).collect::<Vec<_>>());
    }

    #[test]
    fn results_are_in_order_on_any_number_of_threads() {
        for threads in [1, 2, 7] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
            pool.install(|| {
                assert_eq!(map(1000, |i| i * i), (0..1000).map(|i| i * i).collect::<Vec<_>>());
                let mut rows = vec![0; 300];
                let items: Vec<&mut [i32]> = rows.chunks_mut(7).collect();
                let lengths = map_items(items, |i, row| {
                    row.fill(i as i32);
                    row.len()
                });
                assert_eq!((lengths.len(), lengths[0], lengths[42]), (43, 7, 6));
                assert!(rows.iter().enumerate().all(|(k, &v)| v == k as i32 / 7));
                assert_eq!(fold(1000, || 0, |sum, i| *sum += i, |a, b| *a += b), 499_500);
                assert_eq!(both(|| 1, || "two"), (1, "two"));
            });
        }
        assert!(map(0, |i| i).is_empty());
        assert_eq!(fold(0, || 5, |_, _| {}, |_, _| {}), 5);
    }
}
