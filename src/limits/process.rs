//! Memory used by the process and available to it under the limits of the machine, its control group, the address space
//! and [`super::set_memory_limit`]. Limits that the system does not report do not apply.

use std::path::Path;

use super::{RESERVE, user_limit};

/// Memory that the process may still allocate, in bytes, of a limit's total, and the origin of the limit.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Available {
    pub left: u64,
    pub of: u64,
    pub set_by: &'static str,
}

pub(super) const ADDRESS_SPACE: &str = "ulimit -v";
const THE_MACHINE: &str = "the machine";

/// The available memory under the strictest limit; `None` if the system reports none.
pub(crate) fn available(used: &InUse) -> Option<Available> {
    let available = |(of, set_by): (u64, &'static str), used: u64| Available {
        left: of.saturating_sub(used).saturating_sub(RESERVE),
        of,
        set_by,
    };
    let address_space = address_space().map(|of| available((of, ADDRESS_SPACE), used.virtual_size));
    let chosen = user_limit().map(|of| available((of, "--memory-limit"), used.resident));
    // The user's limit replaces those of the machine and of the control group.
    let machine = machine();
    let found = if chosen.is_some() {
        // A user's limit may exceed the free memory, but not the total memory.
        [chosen, machine.map(|machine| available((machine.all, THE_MACHINE), used.resident))]
    } else {
        let group = control_group().map(|of| available((of, "the control group"), used.resident));
        let free = |machine: Machine| machine.free.saturating_sub(RESERVE);
        let machine =
            machine.map(|machine| Available { left: free(machine), of: machine.all, set_by: THE_MACHINE });
        [group, machine]
    };
    found.into_iter().chain([address_space]).flatten().min_by_key(|available| available.left)
}

/// Bytes used by the process; 0 if the system does not report them.
pub(crate) struct InUse {
    /// Resident memory.
    pub resident: u64,
    /// Address space.
    pub virtual_size: u64,
}

pub(crate) fn in_use() -> InUse {
    InUse { resident: resident_memory().unwrap_or(0), virtual_size: status("VmSize:").unwrap_or(0) }
}

/// Resident memory in bytes, where the system reports it.
pub fn resident_memory() -> Option<u64> {
    status("VmRSS:")
}

/// Peak resident memory in bytes since the start or the last [`reset_peak_memory`], where the system reports it.
pub fn peak_memory() -> Option<u64> {
    status("VmHWM:")
}

/// Resets [`peak_memory`] to the resident memory, where the system supports it.
pub fn reset_peak_memory() {
    // Linux: proc_pid_clear_refs(5). Other systems have no such file, and no peak.
    let _ = std::fs::write("/proc/self/clear_refs", "5");
}

fn status(name: &str) -> Option<u64> {
    kib_after(&proc_text("/proc/self/status")?, name)
}

/// The value in bytes of the line of `text` that starts with `name`, given in kB (1024 bytes, proc_pid_status(5),
/// proc_meminfo(5)).
fn kib_after(text: &str, name: &str) -> Option<u64> {
    let line = text.lines().find_map(|line| line.strip_prefix(name))?;
    line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok().map(|kib| kib.saturating_mul(1024))
}

/// A file of the proc or cgroup file system, if it exists.
fn proc_text(file: &str) -> Option<String> {
    std::fs::read_to_string(file).ok()
}

/// Memory and swap of the machine, in bytes.
#[derive(Clone, Copy)]
pub(super) struct Machine {
    /// Free, or reclaimable.
    pub free: u64,
    pub all: u64,
}

pub(super) fn machine() -> Option<Machine> {
    let text = proc_text("/proc/meminfo")?;
    let sum = |memory: &str, swap: &str| {
        Some(kib_after(&text, memory)?.saturating_add(kib_after(&text, swap).unwrap_or(0)))
    };
    Some(Machine { free: sum("MemAvailable:", "SwapFree:")?, all: sum("MemTotal:", "SwapTotal:")? })
}

/// The strictest limit of the control group of the process and of its ancestors (cgroups(7), version 2).
fn control_group() -> Option<u64> {
    let groups = proc_text("/proc/self/cgroup")?;
    let group = groups.lines().find_map(|line| line.strip_prefix("0::"))?;
    let limit = |group: &Path| {
        proc_text(&format!("/sys/fs/cgroup{}/memory.max", group.display()))?.trim().parse::<u64>().ok()
    };
    Path::new(group).ancestors().filter_map(limit).min()
}

/// The limit of the address space (RLIMIT_AS).
#[cfg(target_os = "linux")]
fn address_space() -> Option<u64> {
    rustix::process::getrlimit(rustix::process::Resource::As).current
}

#[cfg(not(target_os = "linux"))]
fn address_space() -> Option<u64> {
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_of_the_kernel() {
        let text = "MemTotal:       24117248 kB\nMemAvailable:   1 kB\nHugePages_Total:       0\n";
        assert_eq!(kib_after(text, "MemTotal:"), Some(24_117_248 * 1024));
        assert_eq!(kib_after(text, "MemAvailable:"), Some(1024));
        assert_eq!(kib_after(text, "HugePages_Total:"), None);
        assert_eq!(kib_after(text, "SwapFree:"), None);
    }
}
