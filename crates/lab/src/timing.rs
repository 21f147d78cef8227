//! Timing: clocks of processor time, and quartiles of repeated measurements.

use std::time::Instant;

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

    /// The ratio of two measurements: of the medians, from the least to the largest of the quartiles.
    pub fn over(&self, other: &Self) -> Self {
        Quartiles {
            lower: self.lower / other.upper,
            median: self.median / other.median,
            upper: self.upper / other.lower,
        }
    }

    /// Whether the quartile ranges are disjoint.
    pub fn is_apart_from(&self, other: &Self) -> bool {
        self.lower > other.upper || other.lower > self.upper
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn several_threads_have_wall_time() {
        let several = Clock::start(2);
        std::thread::sleep(std::time::Duration::from_millis(50));
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
