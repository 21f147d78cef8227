//! Memory limits.
//!
//! A size in the header of a file is a claim: it is checked by [`check_claim`] before memory is allocated. Sizes of
//! pictures to render, and of data present in a file, are checked by [`check`]. Both use one limit per process, which
//! [`set_memory_limit`] replaces. Depends on `error` only.

mod counts;
mod process;

use std::fmt;
use std::sync::atomic::{AtomicU64, Ordering};

use crate::error::{Error, Place};
pub use counts::{Counted, Limits, parse_count};
use process::{ADDRESS_SPACE, Available, machine};
pub(crate) use process::{available, in_use};
pub use process::{peak_memory, reset_peak_memory, resident_memory};

/// Maximum bytes allocated for sizes claimed in a file, unless `--memory-limit` is given: 16 bytes (four channels of
/// f32) for each of 16,384 x 16,384 pixels, the largest texture that GPUs support.
pub const MAX_CLAIM: u64 = 16 << 28;

/// Bytes kept free below every limit, for thread stacks, tile buffers and encoders.
const RESERVE: u64 = 64 << 20;

/// Minimum of `--memory-limit`.
const MIN_LIMIT: u64 = 2 * RESERVE;

/// Requests up to this size in bytes are not checked, because the check reads several files of `/proc`.
const SMALL: u64 = 16 << 20;

const GIB: u64 = 1 << 30;

/// Value of `--memory-limit` in bytes; 0 if not given.
static USER_LIMIT: AtomicU64 = AtomicU64::new(0);

/// Replaces the limits of claims and of the process by `bytes`. A limit of the address space (`ulimit -v`) still
/// applies.
pub fn set_memory_limit(bytes: u64) {
    USER_LIMIT.store(bytes, Ordering::Relaxed);
}

fn user_limit() -> Option<u64> {
    Some(USER_LIMIT.load(Ordering::Relaxed)).filter(|&bytes| bytes > 0)
}

/// A request that exceeds a memory limit.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Excess {
    needed: u64,
    /// Bytes in use.
    used: u64,
    limit: Limit,
}

#[derive(Debug, Clone, PartialEq, Eq)]
enum Limit {
    /// [`MAX_CLAIM`].
    Claim,
    /// A limit of the process.
    Process(Available),
}

impl Excess {
    /// The error of an input: `what`, which needs the memory, is the subject of the message.
    pub fn at(&self, place: impl Into<Place>, what: impl fmt::Display) -> Error {
        Error::input(place, format!("{what} {self}"), self.hint())
    }

    /// Hint for a file.
    pub fn hint(&self) -> String {
        match &self.limit {
            _ if machine().is_some_and(|machine| self.needed > machine.all.saturating_mul(16)) => {
                "more than 16 times the memory of this machine: the file is probably damaged".into()
            }
            Limit::Claim => format!("if you trust the file, {}", self.remedy()),
            Limit::Process(_) => format!("make it smaller, or {}", self.remedy()),
        }
    }

    /// Advice on raising the limit.
    pub fn remedy(&self) -> String {
        let enough = self.needed.saturating_add(self.used).saturating_add(RESERVE).div_ceil(GIB) + 1;
        match &self.limit {
            _ if machine().is_some_and(|machine| enough > machine.all.div_ceil(GIB)) => {
                "use a machine with more memory".into()
            }
            Limit::Process(available) if available.set_by == ADDRESS_SPACE => {
                "raise the limit of the shell: ulimit -v unlimited".into()
            }
            _ => format!("give --memory-limit {enough}G"),
        }
    }
}

/// For example `needs 25.8 GiB of memory; the limit for sizes in a file is 4.0 GiB`, to follow its subject.
impl fmt::Display for Excess {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "needs {} of memory; ", Bytes(self.needed))?;
        match &self.limit {
            Limit::Claim => write!(f, "the limit for sizes in a file is {}", Bytes(MAX_CLAIM)),
            Limit::Process(Available { left, of, set_by }) => {
                write!(f, "{} of {} are left ({set_by})", Bytes(*left), Bytes(*of))
            }
        }
    }
}

/// A number of bytes, displayed in MiB up to EiB.
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

/// Checks an allocation for a size claimed in a file.
///
/// # Errors
/// [`Excess`] if `bytes` exceeds [`MAX_CLAIM`] or the limit of the process.
pub fn check_claim(bytes: u64) -> Result<(), Excess> {
    if user_limit().is_none() && bytes > MAX_CLAIM {
        return Err(Excess { needed: bytes, used: in_use().resident, limit: Limit::Claim });
    }
    check(bytes)
}

/// Checks an allocation of `bytes`.
///
/// # Errors
/// [`Excess`] if `bytes` exceeds the memory left of the machine, the control group or the address space.
pub fn check(bytes: u64) -> Result<(), Excess> {
    if bytes <= SMALL {
        return Ok(());
    }
    let used = in_use();
    match available(&used) {
        Some(available) if bytes > available.left => {
            Err(Excess { needed: bytes, used: used.resident, limit: Limit::Process(available) })
        }
        _ => Ok(()),
    }
}

/// Saturating product of sizes.
pub fn product(sizes: &[u64]) -> u64 {
    sizes.iter().fold(1, |product: u64, &size| product.saturating_mul(size))
}

/// Parses a memory limit: an integer in bytes, or in KiB, MiB, GiB or TiB with the suffix K, M, G or T.
///
/// # Errors
/// A message that states the valid form.
pub fn parse_limit(text: &str) -> Result<u64, String> {
    let text = text.trim();
    let digits = text.trim_end_matches(|c: char| c.is_ascii_alphabetic());
    let unit = match text[digits.len()..].to_ascii_uppercase().as_str() {
        "" | "B" => Some(1),
        "K" | "KB" | "KIB" => Some(1 << 10),
        "M" | "MB" | "MIB" => Some(1 << 20),
        "G" | "GB" | "GIB" => Some(1 << 30),
        "T" | "TB" | "TIB" => Some(1 << 40),
        _ => None,
    };
    let bytes = digits.trim().parse::<u64>().ok().and_then(|number| number.checked_mul(unit?));
    match bytes {
        Some(bytes) if bytes >= MIN_LIMIT => Ok(bytes),
        Some(_) => Err(format!(
            "{} of it are reserved for threads and encoders; give at least {}M",
            Bytes(RESERVE),
            MIN_LIMIT >> 20
        )),
        None => Err("give a whole number with K, M, G or T, such as 1536M or 16G".into()),
    }
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
        // The hint depends on the memory of this machine.
        assert!(!excess.hint().is_empty());
        assert!(check_claim(product(&[u64::MAX, 12])).is_err());
        if cfg!(target_os = "linux") {
            // No machine has 2^62 bytes.
            let excess = check(1 << 62).unwrap_err();
            assert!(excess.to_string().starts_with("needs 4.0 EiB of memory; "), "{excess}");
            assert!(excess.hint().starts_with("more than 16 times"), "{}", excess.hint());
        }
    }

    #[test]
    fn bytes_have_a_unit_that_fits() {
        let text = |bytes: u64| Bytes(bytes).to_string();
        assert_eq!([text(1), text((1 << 30) - 1), text(3 << 29)], ["1 MiB", "1024 MiB", "1.5 GiB"]);
        assert_eq!([text(1 << 40), text(u64::MAX)], ["1.0 TiB", "16.0 EiB"]);
    }

    #[test]
    fn limits_as_users_type_them() {
        for (text, bytes) in
            [("134217728", 128 << 20), ("131072k", 128 << 20), ("512M", 512 << 20), ("2 GiB", 2 << 30)]
        {
            assert_eq!(parse_limit(text), Ok(bytes), "{text}");
        }
        for bad in ["", "-1", "4X", "G", "1.5G", "99999999999T"] {
            let said = parse_limit(bad).unwrap_err();
            assert!(said.starts_with("give a whole number "), "{bad}: {said}");
        }
        // Half of the least limit is kept free.
        let said = "64 MiB of it are reserved for threads and encoders; give at least 128M";
        for small in ["0", "64M", "134217727"] {
            assert_eq!(parse_limit(small), Err(said.into()), "{small}");
        }
    }
}
