//! Time of the processor: what else runs on the machine lengthens it little, unlike that of the clock.

use std::time::{Duration, Instant};

/// How long this thread has computed; None where the system does not say.
fn of_this_thread() -> Option<Duration> {
    // proc(5), stat: utime and stime, in hundredths of a second. The name, in brackets, may hold blanks.
    let stat = std::fs::read_to_string("/proc/thread-self/stat").ok()?;
    let words = stat.rsplit_once(')')?.1.split_whitespace().skip(11).take(2);
    words.map(|word| Some(Duration::from_millis(10 * word.parse::<u64>().ok()?))).sum()
}

/// Does what a thread does by itself, in less than so many seconds of the processor, or of the clock where the system does
/// not say.
pub fn within<T>(seconds: u64, what: &str, work: impl FnOnce() -> T) -> T {
    let (begun, clock) = (of_this_thread(), Instant::now());
    let done = work();
    let took = of_this_thread().zip(begun).map_or_else(|| clock.elapsed(), |(now, begun)| now - begun);
    assert!(took < Duration::from_secs(seconds), "{what} took {took:?}");
    done
}

/// Takes from the end of what a shell said the two lines of `times` (POSIX), and answers with the seconds of what the
/// shell ran.
pub fn of_children(said: &mut Vec<u8>) -> f64 {
    let text = String::from_utf8_lossy(said).into_owned();
    let lines: Vec<&str> = text.trim_end().rsplitn(3, '\n').collect();
    let of = |word: &str| {
        let (minutes, seconds) = word.strip_suffix('s')?.split_once('m')?;
        Some(60.0 * minutes.parse::<f64>().ok()? + seconds.parse::<f64>().ok()?)
    };
    let seconds: Option<f64> = lines[0].split_whitespace().map(of).sum();
    *said = lines.get(2).map_or(String::new(), |rest| format!("{rest}\n")).into_bytes();
    seconds.unwrap_or_else(|| panic!("no times in {text}"))
}
