//! What a benchmark has taken of the processor.

/// Seconds that this process has computed so far. What the kernel does for it (pages, writes to the disk) is left out:
/// it varies by half from run to run.
pub fn user_s() -> f64 {
    let stat = std::fs::read_to_string("/proc/self/stat").expect("Linux");
    let mut fields = stat.rsplit(')').next().expect("fields").split_whitespace();
    // utime, in ticks of 10 ms.
    fields.nth(11).expect("a field").parse::<f64>().expect("ticks") / 100.0
}
