//! What a benchmark has taken of memory.

/// Peak resident memory, MB.
pub fn peak_mb() -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").expect("Linux");
    let line = status.lines().find(|l| l.starts_with("VmHWM")).expect("a peak");
    let kb: f64 = line.split_whitespace().nth(1).and_then(|w| w.parse().ok()).expect("kB");
    kb / 1024.0
}
