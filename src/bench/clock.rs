//! Clock for benchmarks.

use std::time::Instant;

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

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    #[test]
    fn several_threads_have_wall_time() {
        let several = Clock::start(2);
        std::thread::sleep(Duration::from_millis(50));
        assert!(several.seconds() >= 0.05);
        assert_eq!(Clock::name(2), "wall");
        assert_eq!(Clock::name(1), if cfg!(unix) { "processor" } else { "wall" });
    }
}
