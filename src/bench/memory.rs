//! How much memory this process holds, where the system tells.

/// Bytes held now.
pub fn resident() -> Option<u64> {
    of("VmRSS:")
}

/// The most bytes held at once, since the start or since [`forget_peak`].
pub fn peak() -> Option<u64> {
    of("VmHWM:")
}

/// Makes [`peak`] start from what is held now, where the system lets it.
pub fn forget_peak() {
    // Linux: proc_pid_clear_refs(5). Elsewhere there is no such file, and no peak either.
    let _ = std::fs::write("/proc/self/clear_refs", "5");
}

fn of(name: &str) -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix(name))?;
    line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok().map(|kib| kib * 1024)
}
