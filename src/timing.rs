//! Timing: clocks of processor time, and quartiles of repeated measurements.

use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};

/// A running clock.
///
/// For one thread it measures the processor time of the process, which other load on the machine changes little. For
/// several threads, and where processor time is not available, it measures wall time.
pub struct Clock {
    start: f64,
    outside: Option<Instant>,
}

impl Clock {
    /// Starts a clock.
    pub fn start(threads: usize) -> Self {
        match processor_time() {
            Some(start) if threads == 1 => Clock { start, outside: None },
            _ => Clock { start: 0.0, outside: Some(Instant::now()) },
        }
    }

    /// Seconds since the start.
    pub fn seconds(&self) -> f64 {
        match self.outside {
            Some(outside) => outside.elapsed().as_secs_f64(),
            None => processor_time().unwrap_or(self.start) - self.start,
        }
    }

    /// Name of the clock for a number of threads: `processor` or `wall`.
    pub fn name(threads: usize) -> &'static str {
        if threads == 1 && processor_time().is_some() { "processor" } else { "wall" }
    }
}

/// Processor time of this process in seconds.
#[cfg(unix)]
fn processor_time() -> Option<f64> {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ProcessCPUTime);
    Some(time.tv_sec as f64 + time.tv_nsec as f64 * 1e-9)
}

/// Whether [`ThreadClock`] measures processor time. The times of threads of Windows advance in steps of 1/64 s, more than
/// a stage of a tile takes.
pub const HAS_THREAD_TIME: bool = cfg!(unix);

/// Processor time of the calling thread, from any start; wall time without [`HAS_THREAD_TIME`].
#[cfg(unix)]
fn thread_time() -> Duration {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
    // Only negative times fail.
    Duration::try_from(time).unwrap_or_default()
}

#[cfg(not(unix))]
fn thread_time() -> Duration {
    static START: std::sync::LazyLock<Instant> = std::sync::LazyLock::new(Instant::now);
    START.elapsed()
}

/// A clock of the processor time of a thread; of wall time without [`HAS_THREAD_TIME`].
pub struct ThreadClock(Duration);

impl ThreadClock {
    /// Starts a clock of the calling thread.
    pub fn start() -> Self {
        ThreadClock(thread_time())
    }

    /// Time since the start or the last call, on the same thread.
    pub fn lap(&mut self) -> Duration {
        let now = thread_time();
        now.saturating_sub(std::mem::replace(&mut self.0, now))
    }
}

#[cfg(not(unix))]
fn processor_time() -> Option<f64> {
    None
}

/// Quartiles of repeated measurements.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Quartiles {
    /// 25 % quantile.
    pub lower: f64,
    /// 50 % quantile.
    pub median: f64,
    /// 75 % quantile.
    pub upper: f64,
}

impl Quartiles {
    /// Quartiles of measurements in any order; `None` if there are none.
    pub fn of(measurements: &[f64]) -> Option<Self> {
        let mut sorted = measurements.to_vec();
        sorted.sort_by(f64::total_cmp);
        let at = |quarter: usize| sorted.get(sorted.len() * quarter / 4).copied();
        Some(Quartiles { lower: at(1)?, median: at(2)?, upper: at(3)? })
    }

    /// A value without spread.
    pub fn exact(value: f64) -> Self {
        Quartiles { lower: value, median: value, upper: value }
    }

    /// Whether the quartile ranges are disjoint.
    pub fn is_apart_from(&self, other: &Self) -> bool {
        self.lower > other.upper || other.lower > self.upper
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A thread that sleeps takes no processor time; one that waits in a loop takes what has passed, but for other
    /// programs.
    #[test]
    #[cfg(unix)]
    fn a_sleeping_thread_has_no_processor_time() {
        let mut clock = ThreadClock::start();
        std::thread::sleep(Duration::from_millis(50));
        let start = Instant::now();
        assert!(clock.lap() < Duration::from_millis(25));
        let mut worked = Duration::ZERO;
        while worked < Duration::from_millis(20) && start.elapsed() < Duration::from_secs(20) {
            worked += clock.lap();
        }
        // The clocks may run at rates that differ a little.
        assert!(worked >= Duration::from_millis(20) && 2 * start.elapsed() >= worked, "{worked:?}");
    }

    #[test]
    fn several_threads_have_wall_time() {
        let several = Clock::start(2);
        std::thread::sleep(Duration::from_millis(50));
        assert!(several.seconds() >= 0.05);
        assert_eq!(Clock::name(2), "wall");
        assert_eq!(Clock::name(1), if cfg!(unix) { "processor" } else { "wall" });
    }

    #[test]
    fn quartiles_by_hand() {
        let spread = |numbers: &[f64]| Quartiles::of(numbers).map(|s| [s.lower, s.median, s.upper]);
        assert_eq!(spread(&[5.0, 1.0, 4.0, 2.0, 3.0]), Some([2.0, 3.0, 4.0]));
        assert_eq!(spread(&[2.0]), Some([2.0; 3]));
        assert_eq!(spread(&[]), None);
    }
}
