//! Memory usage of this process, where the system provides it.

/// Resident memory in bytes.
pub fn resident() -> Option<u64> {
    of("VmRSS:")
}

/// Peak resident memory in bytes since the start or the last [`reset_peak`].
pub fn peak() -> Option<u64> {
    of("VmHWM:")
}

/// Resets [`peak`] to the resident memory, where the system supports it.
pub fn reset_peak() {
    // Linux: proc_pid_clear_refs(5). Other systems have no such file, and no peak.
    let _ = std::fs::write("/proc/self/clear_refs", "5");
}

fn of(name: &str) -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix(name))?;
    line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok().map(|kib| kib * 1024)
}
