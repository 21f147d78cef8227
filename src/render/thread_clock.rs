//! Processor time of threads.

use std::time::Duration;
#[cfg(not(unix))]
use std::time::Instant;

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
pub(super) struct ThreadClock(Duration);

impl ThreadClock {
    /// Starts a clock of the calling thread.
    pub(super) fn start() -> Self {
        ThreadClock(thread_time())
    }

    /// Time since the start or the last call, on the same thread.
    pub(super) fn lap(&mut self) -> Duration {
        let now = thread_time();
        now.saturating_sub(std::mem::replace(&mut self.0, now))
    }
}

#[cfg(test)]
mod tests {
    use std::time::Instant;

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
}
