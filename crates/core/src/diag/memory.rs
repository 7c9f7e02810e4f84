//! How much memory this process may still take, asked before a large buffer is filled.
//!
//! Where an allocation fails the program aborts. So readers and the driver say beforehand what a mesh, a height map,
//! a drawing or the sections take, and are refused where a limit is known and leaves less: the limit of address
//! space (`ulimit -v`), and those of the control groups (versions 1 and 2). Linux alone; elsewhere nothing is known.
//! What is asked for are estimates for the large buffers, not for every list: a limit just above them can still be hit.

use std::path::Path;

use super::Diag;

/// Refuses `bytes` for `what` where that is more than the process may still take.
///
/// # Errors
/// `memory`, with both figures.
pub fn ask(what: &str, bytes: u64) -> Result<(), Diag> {
    // So little is granted unchecked: the limits are files that would have to be read.
    const LITTLE: u64 = 16 << 20;
    if bytes <= LITTLE {
        return Ok(());
    }
    match tightest().filter(|limit| bytes > limit.left) {
        None => Ok(()),
        Some(limit) => {
            let text = format!(
                "{what} needs about {} of memory, but only {} of the {} allowed by {} is left",
                size(bytes),
                size(limit.left),
                size(limit.total),
                limit.by
            );
            Err(Diag::limit("memory", text).hint("raise the limit, or use a smaller or coarser input"))
        }
    }
}

fn size(bytes: u64) -> String {
    format!("{} MB", bytes.div_ceil(1 << 20))
}

/// A limit and what is left of it, bytes.
#[derive(Debug, PartialEq)]
struct MemoryLimit {
    total: u64,
    left: u64,
    by: &'static str,
}

/// The limit that leaves least.
fn tightest() -> Option<MemoryLimit> {
    let read = |path: &Path| std::fs::read_to_string(path).ok();
    let status = read(Path::new("/proc/self/status"))?;
    let addresses = read(Path::new("/proc/self/limits")).as_deref().and_then(address_space);
    let groups = read(Path::new("/proc/self/cgroup")).and_then(|text| group_limit(&text, &read));
    let limits = [
        MemoryLimit::of(addresses, field(&status, "VmSize:"), "the limit of address space (ulimit -v)"),
        MemoryLimit::of(groups, field(&status, "VmRSS:"), "its control group"),
    ];
    limits.into_iter().flatten().min_by_key(|limit| limit.left)
}

impl MemoryLimit {
    /// A limit of which so much is used; None where either is not known.
    fn of(limit: Option<u64>, used: Option<u64>, by: &'static str) -> Option<Self> {
        let (total, used) = (limit?, used?);
        Some(Self { total, left: total.saturating_sub(used), by })
    }
}

/// A field of /proc/self/status, which counts in kB.
fn field(status: &str, name: &str) -> Option<u64> {
    let rest = status.lines().find_map(|l| l.strip_prefix(name))?;
    Some(rest.split_whitespace().next()?.parse::<u64>().ok()? << 10)
}

/// The soft limit of address space, as /proc/self/limits has it; None where it is unlimited.
fn address_space(limits: &str) -> Option<u64> {
    let rest = limits.lines().find_map(|l| l.strip_prefix("Max address space"))?;
    rest.split_whitespace().next()?.parse().ok()
}

/// The least memory limit of the control groups named in /proc/self/cgroup and of those around them.
fn group_limit(groups: &str, read: &dyn Fn(&Path) -> Option<String>) -> Option<u64> {
    let mut least = None;
    for line in groups.lines() {
        let mut parts = line.splitn(3, ':').skip(1);
        let (Some(controllers), Some(path)) = (parts.next(), parts.next()) else { continue };
        let (root, file) = match controllers {
            "" => ("/sys/fs/cgroup", "memory.max"),
            "memory" => ("/sys/fs/cgroup/memory", "memory.limit_in_bytes"),
            _ => continue,
        };
        for group in Path::new(path.trim_start_matches('/')).ancestors() {
            let text = read(&Path::new(root).join(group).join(file));
            // "max" where there is none; version 1 writes the largest number instead.
            let limit = text.and_then(|t| t.trim().parse::<u64>().ok()).filter(|&bytes| bytes < 1 << 60);
            least = [least, limit].into_iter().flatten().min();
        }
    }
    least
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_are_read_as_the_system_writes_them() {
        let limits = "Limit                     Soft Limit           Hard Limit           Units     \n\
                      Max address space         536870912            unlimited            bytes     \n";
        assert_eq!(address_space(limits), Some(512 << 20));
        assert_eq!(address_space(&limits.replace("536870912", "unlimited")), None);
        assert_eq!(field("VmPeak:\t  10 kB\nVmSize:\t    2936 kB\nVmRSS:\t 1 kB\n", "VmSize:"), Some(2936 << 10));
        let files = |path: &Path| match path.to_str()? {
            "/sys/fs/cgroup/a/memory.max" => Some("1000000\n".to_owned()),
            "/sys/fs/cgroup/a/b/memory.max" => Some("max\n".into()),
            "/sys/fs/cgroup/memory/c/memory.limit_in_bytes" => Some("2000000".into()),
            "/sys/fs/cgroup/memory/memory.limit_in_bytes" => Some("9223372036854771712".into()),
            _ => None,
        };
        assert_eq!(group_limit("0::/a/b\n", &files), Some(1_000_000));
        assert_eq!(group_limit("9:name=systemd:/a\n4:memory:/c\n0::/\n", &files), Some(2_000_000));
        assert_eq!(group_limit("4:memory:/\n0::/x\n", &files), None);
    }

    #[test]
    fn small_allocations_are_granted_and_all_of_memory_is_refused() {
        assert_eq!(ask("a list", 1000), Ok(()));
        if let Some(limit) = tightest() {
            let d = ask("the mesh", u64::MAX).expect_err("too much");
            assert!(d.message.contains("the mesh needs about ") && d.message.contains(limit.by), "{}", d.message);
        }
    }
}
