//! The name of this computer.

use std::fs;

/// The name of this computer, as it stands in names of files: letters, digits, `-` and `_`; `unknown` where it has
/// none.
pub fn name() -> String {
    let read = |path: &str| fs::read_to_string(path).ok().map(|text| text.trim().to_owned());
    let named = ["/proc/sys/kernel/hostname", "/etc/hostname"].into_iter().find_map(read);
    let named = named.or_else(|| std::env::var("COMPUTERNAME").ok()).filter(|name| !name.is_empty());
    let plain = |name: String| name.replace(|c: char| !c.is_ascii_alphanumeric() && c != '-', "_");
    named.map_or_else(|| "unknown".into(), plain)
}
