//! How much memory kiln takes, and the reading of whole files.
//!
//! A size in a file's header is a claim. Before memory is allocated for it, it goes through [`check_claim`]; the size of a picture
//! to render, and of data that is in a file, goes through [`check`]. Both compare with one limit for the whole process,
//! which [`set_memory_limit`] replaces. Called by readers, importers, films and the command line; depends on `error` alone.

use std::fmt;
use std::io;
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};

use crate::error::Error;

/// The most bytes that are allocated for the sizes in a file, unless `--memory-limit` says otherwise: 16 bytes for each of
/// 16,384 x 16,384 pixels, the largest texture that graphics processors take, in four channels of f32.
pub const MOST_CLAIMED: u64 = 16 << 28;

/// What is left free of every limit, for thread stacks, tile buffers and encoders.
const RESERVE: u64 = 64 << 20;

/// Requests up to this size are not compared with what the process may use, which takes reading several files of `/proc`.
const SMALL: u64 = 16 << 20;

const GIB: u64 = 1 << 30;

/// The limit that the user gave, in bytes; 0 where there is none. One for the process, as its memory is.
static CHOSEN: AtomicU64 = AtomicU64::new(0);

/// Replaces the limits, of claims and of the process, by `bytes`. A limit of the address space (`ulimit -v`) stays.
pub fn set_memory_limit(bytes: u64) {
    CHOSEN.store(bytes, Ordering::Relaxed);
}

/// Memory that is not there, or not granted.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Excess {
    needed: u64,
    /// Bytes in use already.
    used: u64,
    limit: Limit,
}

#[derive(Debug, Clone, PartialEq, Eq)]
enum Limit {
    /// [`MOST_CLAIMED`].
    Claim,
    /// A limit of the process: bytes left, bytes in total, and what sets it.
    Process(Room),
}

/// Memory that the process may still allocate.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Room {
    left: u64,
    of: u64,
    set_by: &'static str,
}

impl Excess {
    /// What to do about it, for a file.
    pub fn hint(&self) -> String {
        match &self.limit {
            _ if machine().is_some_and(|machine| self.needed > machine.all.saturating_mul(16)) => {
                "no machine like this one holds as much: the file is damaged, or made to use up memory".into()
            }
            Limit::Claim => format!("if the file is to be trusted, {}", self.remedy()),
            Limit::Process(_) => format!("make it smaller, or {}", self.remedy()),
        }
    }

    /// How to raise the limit.
    pub fn remedy(&self) -> String {
        let enough = self.needed.saturating_add(self.used).saturating_add(RESERVE).div_ceil(GIB) + 1;
        match &self.limit {
            _ if machine().is_some_and(|machine| enough > machine.all.div_ceil(GIB)) => {
                "use a machine with more memory".into()
            }
            Limit::Process(room) if room.set_by == ADDRESS_SPACE => {
                "raise the limit of the shell: ulimit -v unlimited".into()
            }
            _ => format!("give --memory-limit {enough}G"),
        }
    }
}

/// Such as `needs 25.8 GiB of memory; the limit for sizes in a file is 4.0 GiB`: to stand after what needs it.
impl fmt::Display for Excess {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "needs {} of memory; ", Bytes(self.needed))?;
        match &self.limit {
            Limit::Claim => write!(f, "the limit for sizes in a file is {}", Bytes(MOST_CLAIMED)),
            Limit::Process(Room { left, of, set_by }) => {
                write!(f, "{} of {} are left ({set_by})", Bytes(*left), Bytes(*of))
            }
        }
    }
}

/// A number of bytes, written in MiB up to EiB.
pub struct Bytes(pub u64);

impl fmt::Display for Bytes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.0 < GIB {
            return write!(f, "{} MiB", self.0.div_ceil(1 << 20));
        }
        let mut number = self.0 as f64 / GIB as f64;
        let mut units = ["GiB", "TiB", "PiB", "EiB"].into_iter().peekable();
        let mut unit = units.next();
        while number >= 1024.0 && units.peek().is_some() {
            (number, unit) = (number / 1024.0, units.next());
        }
        write!(f, "{number:.1} {}", unit.unwrap_or_default())
    }
}

/// Whether `bytes` may be allocated for a size that a file gives.
///
/// # Errors
/// [`Excess`] where they are more than [`MOST_CLAIMED`], or than the process may use.
pub fn check_claim(bytes: u64) -> Result<(), Excess> {
    if CHOSEN.load(Ordering::Relaxed) == 0 && bytes > MOST_CLAIMED {
        return Err(Excess { needed: bytes, used: in_use().resident, limit: Limit::Claim });
    }
    check(bytes)
}

/// Whether the process may use `bytes` more.
///
/// # Errors
/// [`Excess`] where they are more than is left of the machine's memory, the control group's or the address space.
pub fn check(bytes: u64) -> Result<(), Excess> {
    if bytes <= SMALL {
        return Ok(());
    }
    let used = in_use();
    match room(&used) {
        Some(room) if bytes > room.left => {
            Err(Excess { needed: bytes, used: used.resident, limit: Limit::Process(room) })
        }
        _ => Ok(()),
    }
}

/// The product of sizes, held at the largest number where it is beyond it.
pub fn product(sizes: &[u64]) -> u64 {
    sizes.iter().fold(1, |product: u64, &size| product.saturating_mul(size))
}

const ADDRESS_SPACE: &str = "ulimit -v";
const THE_MACHINE: &str = "the machine";

/// The least that any limit of the process leaves. `None` where the system tells none.
fn room(used: &InUse) -> Option<Room> {
    let room = |(of, set_by): (u64, &'static str), used: u64| Room {
        left: of.saturating_sub(used).saturating_sub(RESERVE),
        of,
        set_by,
    };
    let address_space = address_space().map(|of| room((of, ADDRESS_SPACE), used.virtual_size));
    let chosen = match CHOSEN.load(Ordering::Relaxed) {
        0 => None,
        bytes => Some(room((bytes, "--memory-limit"), used.resident)),
    };
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
struct InUse {
    /// In memory.
    resident: u64,
    /// Of the address space.
    virtual_size: u64,
}

fn in_use() -> InUse {
    let Some(text) = proc_text("/proc/self/status") else { return InUse::default() };
    let of = |name: &str| kib_after(&text, name).unwrap_or(0);
    InUse { resident: of("VmRSS:"), virtual_size: of("VmSize:") }
}

/// The bytes on the line of `text` that starts with `name`, given in kB (1024 bytes, proc_pid_status(5), proc_meminfo(5)).
fn kib_after(text: &str, name: &str) -> Option<u64> {
    let line = text.lines().find_map(|line| line.strip_prefix(name))?;
    line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok().map(|kib| kib.saturating_mul(1024))
}

/// Small files of the kernel: none where there is no such system.
fn proc_text(file: &str) -> Option<String> {
    std::fs::read_to_string(file).ok()
}

/// Bytes of memory and swap.
#[derive(Clone, Copy)]
struct Machine {
    /// Free, or to be freed where others want it.
    free: u64,
    all: u64,
}

fn machine() -> Option<Machine> {
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

/// The most address space that the process may have.
#[cfg(target_os = "linux")]
fn address_space() -> Option<u64> {
    rustix::process::getrlimit(rustix::process::Resource::As).current
}

#[cfg(not(target_os = "linux"))]
fn address_space() -> Option<u64> {
    None
}

/// A size as users type it: a whole number of bytes, or of KiB, MiB, GiB or TiB by the letters K, M, G and T.
///
/// # Errors
/// What to give instead.
pub fn parse_size(text: &str) -> Result<u64, String> {
    let text = text.trim();
    let digits = text.trim_end_matches(|c: char| c.is_ascii_alphabetic());
    let unit: u64 = match text[digits.len()..].to_ascii_uppercase().as_str() {
        "" | "B" => 1,
        "K" | "KB" | "KIB" => 1 << 10,
        "M" | "MB" | "MIB" => 1 << 20,
        "G" | "GB" | "GIB" => 1 << 30,
        "T" | "TB" | "TIB" => 1 << 40,
        _ => 0,
    };
    let bytes = digits.trim().parse::<u64>().ok().and_then(|number| number.checked_mul(unit));
    bytes.filter(|&bytes| bytes > 0).ok_or_else(|| "give a size above 0, such as 512M or 16G".into())
}

/// The content of a regular file. What is none (a pipe, a device, a socket) may have no end and is not opened.
///
/// # Errors
/// Those of the system, and [`Refused`] as the cause of [`io::ErrorKind::Other`].
pub fn read_file(file: &Path) -> io::Result<Vec<u8>> {
    let about = std::fs::metadata(file)?;
    if about.is_dir() {
        return Err(io::ErrorKind::IsADirectory.into());
    }
    if !about.is_file() {
        return Err(io::Error::other(Refused {
            what: format!("is {}, not a regular file", kind_of(about.file_type())),
            hint: "write what it holds to a file first; `-` reads standard input".into(),
        }));
    }
    check(about.len()).map_err(|excess| {
        io::Error::other(Refused { what: format!("reading it {excess}"), hint: excess.hint() })
    })?;
    std::fs::read(file)
}

/// All of standard input, as long as memory reaches.
///
/// # Errors
/// Those of the system, and [`Refused`] as the cause of [`io::ErrorKind::Other`].
pub fn read_standard_input() -> io::Result<Vec<u8>> {
    use io::Read;
    // What is read doubles its memory as it grows, and holds both for a moment.
    let room = room(&in_use());
    let most = room.as_ref().map_or(u64::MAX, |room| room.left / 3);
    let mut bytes = Vec::new();
    io::stdin().lock().take(most).read_to_end(&mut bytes)?;
    match room {
        Some(room) if bytes.len() as u64 == most => Err(io::Error::other(Refused {
            what: format!("is longer than {}, a third of the memory left ({})", Bytes(most), room.set_by),
            hint: "write it to a file and name that, or raise the limit".into(),
        })),
        _ => Ok(bytes),
    }
}

#[cfg(unix)]
fn kind_of(kind: std::fs::FileType) -> &'static str {
    use std::os::unix::fs::FileTypeExt;
    match () {
        () if kind.is_fifo() => "a pipe",
        () if kind.is_char_device() || kind.is_block_device() => "a device",
        () if kind.is_socket() => "a socket",
        () => "something else",
    }
}

#[cfg(not(unix))]
fn kind_of(_: std::fs::FileType) -> &'static str {
    "something else"
}

/// Why a file is not read that the system would read.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{what}")]
pub struct Refused {
    what: String,
    hint: String,
}

/// What is said of a file that cannot be read: what is wrong, and what to do.
pub fn explain(e: &io::Error) -> (String, String) {
    if let Some(refused) = e.get_ref().and_then(|cause| cause.downcast_ref::<Refused>()) {
        return (refused.what.clone(), refused.hint.clone());
    }
    let (what, hint) = match e.kind() {
        io::ErrorKind::NotFound => ("no such file", "check the name and the folder"),
        io::ErrorKind::PermissionDenied => ("permission denied", "make the file readable for this user"),
        io::ErrorKind::IsADirectory => ("is a folder", "name a file in it"),
        _ => return (format!("cannot be read: {e}"), String::new()),
    };
    (what.into(), hint.into())
}

/// An error for a file that cannot be read.
pub fn unreadable(file: &Path, e: &io::Error) -> Error {
    let (what, hint) = explain(e);
    Error::input(file, what, hint)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn claims_are_limited_and_small_ones_are_not_looked_into() {
        assert_eq!(check_claim(1 << 20), Ok(()));
        let excess = check_claim(60_000 * 60_000 * 12).unwrap_err();
        // 43.2e9 / 2^30 = 40.2.
        assert_eq!(excess.to_string(), "needs 40.2 GiB of memory; the limit for sizes in a file is 4.0 GiB");
        // Which machine can do it depends on this one.
        assert!(!excess.hint().is_empty());
        assert!(check_claim(product(&[u64::MAX, 12])).is_err());
        if cfg!(target_os = "linux") {
            // No machine has 2^62 bytes.
            let excess = check(1 << 62).unwrap_err();
            assert!(excess.to_string().starts_with("needs 4.0 EiB of memory; "), "{excess}");
            assert!(excess.hint().starts_with("no machine"), "{}", excess.hint());
        }
    }

    #[test]
    fn bytes_have_a_unit_that_fits() {
        let text = |bytes: u64| Bytes(bytes).to_string();
        assert_eq!([text(1), text((1 << 30) - 1), text(3 << 29)], ["1 MiB", "1024 MiB", "1.5 GiB"]);
        assert_eq!([text(1 << 40), text(u64::MAX)], ["1.0 TiB", "16.0 EiB"]);
    }

    #[test]
    fn sizes_as_users_type_them() {
        for (text, bytes) in
            [("1", 1), ("4096B", 4096), ("3k", 3 << 10), ("512M", 512 << 20), ("2 GiB", 2 << 30)]
        {
            assert_eq!(parse_size(text), Ok(bytes), "{text}");
        }
        for bad in ["", "0", "-1", "4X", "G", "1.5G", "99999999999T"] {
            assert!(parse_size(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn numbers_of_the_kernel() {
        let text = "MemTotal:       24117248 kB\nMemAvailable:   1 kB\nHugePages_Total:       0\n";
        assert_eq!(kib_after(text, "MemTotal:"), Some(24_117_248 * 1024));
        assert_eq!(kib_after(text, "MemAvailable:"), Some(1024));
        assert_eq!(kib_after(text, "HugePages_Total:"), None);
        assert_eq!(kib_after(text, "SwapFree:"), None);
    }

    #[cfg(unix)]
    #[test]
    fn devices_and_folders_are_not_read() {
        let said = |file: &str| read_file(Path::new(file)).map_err(|e| explain(&e).0).unwrap_err();
        assert_eq!(said("/dev/zero"), "is a device, not a regular file");
        assert_eq!(said("/"), "is a folder");
        assert_eq!(said("/no/such/file"), "no such file");
    }
}
