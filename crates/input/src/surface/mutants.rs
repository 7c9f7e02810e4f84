//! Damaged copies of good files, for tests of readers: the same ones in every run.
//!
//! `TERRACE_MUTANTS_SECONDS` makes each test continue for so long, on damage that the usual run does not reach.

use std::time::{Duration, Instant};

use terrace_core::random::Random;

/// Copies of each file in a usual run.
const USUAL: usize = 300;

/// Longest computing time for one file: small ones take milliseconds.
const LONGEST: Duration = Duration::from_secs(5);

/// Most memory that the whole test may take, kB.
const MOST_KB: u64 = 1 << 20;

/// A stretch of `bytes`, short as a rule.
fn stretch(bytes: &[u8], random: &mut Random) -> std::ops::Range<usize> {
    let at = random.below(bytes.len() + 1);
    let most = if random.below(8) == 0 { bytes.len() } else { 24 };
    at..(at + random.below(most)).min(bytes.len())
}

/// Damages a file once; `words` are those of its format.
fn damage(bytes: &mut Vec<u8>, words: &[&str], random: &mut Random) {
    const NUMBERS: &[&str] =
        &["0", "-1", "1", "4294967295", "4294967296", "18446744073709551615", "1e999", "-1e300", "nan", "1e-320", ""];
    let range = stretch(bytes, random);
    match random.below(8) {
        0 if !bytes.is_empty() => {
            let at = random.below(bytes.len());
            bytes[at] = random.below(256) as u8;
        }
        1 if !bytes.is_empty() => {
            let at = random.below(bytes.len());
            bytes[at] ^= 1 << random.below(8);
        }
        2 => bytes.truncate(range.start),
        3 => {
            let word = words[random.below(words.len())];
            bytes.splice(range.start..range.start, word.bytes());
        }
        4 => drop(bytes.drain(range)),
        5 => {
            let copy = bytes[range.clone()].to_vec();
            let at = random.below(bytes.len() + 1);
            bytes.splice(at..at, copy);
        }
        6 => {
            let (from, to) = (range.start, random.below(bytes.len() + 1));
            if from < bytes.len() && to < bytes.len() {
                bytes.swap(from, to);
            }
        }
        // A number becomes another one.
        _ => {
            let Some(first) = bytes[range.start..].iter().position(u8::is_ascii_digit) else { return };
            let first = range.start + first;
            let end = bytes[first..].iter().position(|b| !b.is_ascii_digit()).map_or(bytes.len(), |n| first + n);
            bytes.splice(first..end, NUMBERS[random.below(NUMBERS.len())].bytes());
        }
    }
}

/// Memory that the process took at most, kB; 0 where it is not known.
fn peak_kb() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let peak = status.lines().find_map(|line| line.strip_prefix("VmHWM:")?.trim().strip_suffix(" kB")?.parse().ok());
    peak.unwrap_or(0)
}

/// Computing time of this thread: a machine that is busy makes none of it. Where the system does not say, the time.
fn computed(begun: Instant) -> Duration {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap_or_default();
    let nanoseconds = text.split(' ').next().and_then(|word| word.parse().ok());
    nanoseconds.map_or_else(|| begun.elapsed(), Duration::from_nanos)
}

/// Hands damaged copies of `files` to `read`, which must end soon, without a panic and without much memory.
pub(crate) fn each(files: &[Vec<u8>], words: &[&str], mut read: impl FnMut(&[u8])) {
    let longer = std::env::var("TERRACE_MUTANTS_SECONDS").ok().and_then(|text| text.parse().ok());
    let begun = Instant::now();
    let before = peak_kb();
    let mut n = 0;
    while n < USUAL || longer.is_some_and(|seconds| begun.elapsed() < Duration::from_secs(seconds)) {
        for (i, file) in files.iter().enumerate() {
            let mut random = Random::case((n * files.len() + i) as u64);
            let mut bytes = file.clone();
            for _ in 0..1 + random.below(4) {
                damage(&mut bytes, words, &mut random);
            }
            let start = computed(begun);
            read(&bytes);
            let time = computed(begun) - start;
            assert!(time < LONGEST, "copy {n} of file {i} took {time:?}");
        }
        n += 1;
    }
    // The system counts pages by processor and sums up now and then, so a peak can be a little lower than one before.
    let more = peak_kb().saturating_sub(before);
    assert!(more < MOST_KB, "{more} kB");
}
