//! Memory that the process holds, and that its limits leave it: the machine's, its control group's, the address space's and
//! the one that [`super::set_memory_limit`] sets. Where the system tells none of them, there is none.

use std::path::Path;

use super::{RESERVE, chosen};

/// Memory that the process may still allocate.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Room {
    pub left: u64,
    pub of: u64,
    pub set_by: &'static str,
}

pub(super) const ADDRESS_SPACE: &str = "ulimit -v";
const THE_MACHINE: &str = "the machine";

/// The least that any limit of the process leaves. `None` where the system tells none.
pub(super) fn room(used: &InUse) -> Option<Room> {
    let room = |(of, set_by): (u64, &'static str), used: u64| Room {
        left: of.saturating_sub(used).saturating_sub(RESERVE),
        of,
        set_by,
    };
    let address_space = address_space().map(|of| room((of, ADDRESS_SPACE), used.virtual_size));
    let chosen = chosen().map(|of| room((of, "--memory-limit"), used.resident));
    // A limit that the user gives replaces those of the machine and of the control group.
    let machine = machine();
    let found = if chosen.is_some() {
        // Free memory may be exceeded by what can be swapped, all memory by nothing.
        [chosen, machine.map(|machine| room((machine.all, THE_MACHINE), used.resident))]
    } else {
        let group = control_group().map(|of| room((of, "the control group"), used.resident));
        let free = |machine: Machine| machine.free.saturating_sub(RESERVE);
        let machine =
            machine.map(|machine| Room { left: free(machine), of: machine.all, set_by: THE_MACHINE });
        [group, machine]
    };
    found.into_iter().chain([address_space]).flatten().min_by_key(|room| room.left)
}

/// Bytes that the process holds; 0 where the system does not tell.
#[derive(Default)]
pub(super) struct InUse {
    /// In memory.
    pub resident: u64,
    /// Of the address space.
    pub virtual_size: u64,
}

pub(super) fn in_use() -> InUse {
    let Some(text) = proc_text("/proc/self/status") else { return InUse::default() };
    let of = |name: &str| kib_after(&text, name).unwrap_or(0);
    InUse { resident: of("VmRSS:"), virtual_size: of("VmSize:") }
}

/// The bytes on the line of `text` that starts with `name`, given in kB (1024 bytes, proc_pid_status(5), proc_meminfo(5)).
fn kib_after(text: &str, name: &str) -> Option<u64> {
    let line = text.lines().find_map(|line| line.strip_prefix(name))?;
    line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok().map(|kib| kib.saturating_mul(1024))
}

/// A file of the proc or cgroup file system; `None` where there is none.
fn proc_text(file: &str) -> Option<String> {
    std::fs::read_to_string(file).ok()
}

/// Bytes of memory and swap.
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

/// The least limit of the control groups that the process is in (cgroups(7)), version 2 or 1.
fn control_group() -> Option<u64> {
    let groups = proc_text("/proc/self/cgroup")?;
    let limits = groups.lines().flat_map(|line| {
        let mut parts = line.splitn(3, ':').skip(1);
        let (controllers, path) = (parts.next().unwrap_or(""), parts.next().unwrap_or("/").to_owned());
        let (folder, file) = match controllers {
            "" => ("/sys/fs/cgroup", "memory.max"),
            names if names.split(',').any(|name| name == "memory") => {
                ("/sys/fs/cgroup/memory", "memory.limit_in_bytes")
            }
            _ => return Vec::new(),
        };
        // A group is held to the limits of all above it.
        let above = Path::new(&path).ancestors().map(Path::to_owned).collect::<Vec<_>>();
        let file_of =
            |group: &Path| format!("{folder}{}/{file}", group.display().to_string().trim_end_matches('/'));
        above.iter().filter_map(|group| proc_text(&file_of(group))?.trim().parse::<u64>().ok()).collect()
    });
    limits.min()
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
