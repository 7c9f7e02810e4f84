//! The wish of the user to end: Ctrl-C, a request of the system to end, a terminal that is gone.

use std::io;

/// Calls `handler` each time that the user or the system asks the program to end.
///
/// A terminal that goes away (SIGHUP) is such a request too, unless the program was started to outlive it, as by
/// `nohup`: then the signal stays ignored.
///
/// # Errors
/// Where the system takes no handler.
#[cfg(unix)]
pub(super) fn on_request(mut handler: impl FnMut() + Send + 'static) -> io::Result<()> {
    use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
    let signals = [SIGINT, SIGTERM].into_iter().chain((!is_ignored(SIGHUP)).then_some(SIGHUP));
    let mut requests = signal_hook::iterator::Signals::new(signals)?;
    std::thread::Builder::new().name("signals".into()).spawn(move || requests.forever().for_each(|_| handler()))?;
    Ok(())
}

#[cfg(not(unix))]
pub(super) fn on_request(handler: impl FnMut() + Send + 'static) -> io::Result<()> {
    ctrlc::set_handler(handler).map_err(io::Error::other)
}

/// Whether the program was started with this signal ignored; false where the system does not say.
#[cfg(unix)]
fn is_ignored(signal: i32) -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    is_in_mask(&status, signal)
}

/// Whether a signal is among those that a process ignores, by its status file: `SigIgn:` and a bit for each.
#[cfg(unix)]
fn is_in_mask(status: &str, signal: i32) -> bool {
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let mask = mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).unwrap_or(0);
    // Signals are counted from 1.
    mask >> (signal - 1) & 1 == 1
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    #[test]
    fn ignored_signals_are_the_bits_of_the_status_file() {
        let status = "Name:\tterrace\nSigBlk:\t0000000000000001\nSigIgn:\t0000000000001001\n";
        let ignored: Vec<i32> = (1..32).filter(|&signal| is_in_mask(status, signal)).collect();
        assert_eq!(ignored, [1, 13]);
        assert!(!is_in_mask("", 1) && !is_in_mask("SigIgn:\tnone\n", 1));
    }
}
