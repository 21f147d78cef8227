//! The threads of queries and pictures.

use std::ops::Range;
use std::sync::Mutex;
use std::time::Instant;

use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use rayon::ThreadPool;

use crate::POLL_INTERVAL;

/// The pool, and the id of the process that made it. In a forked process, the threads of its parent's pool do not run.
static POOL: Mutex<Option<(u32, &'static ThreadPool)>> = Mutex::new(None);

/// The pool of this process, as that of the command. [`POOL`] is locked with the GIL held alone. A thread that forks holds
/// the GIL, so no other thread has the lock at that time.
pub(crate) fn pool(_py: Python) -> PyResult<&'static ThreadPool> {
    let locked = POOL.lock();
    let mut pool = locked.map_err(|_| PyRuntimeError::new_err("threads cannot be started"))?;
    let process = std::process::id();
    match *pool {
        Some((owner, pool)) if owner == process => Ok(pool),
        _ => {
            let new = kiln_cli::pool(None).map_err(|e| crate::raised(&e))?;
            // Leaked: dropping a pool would wait for threads, which a forked process does not have.
            let new: &'static ThreadPool = Box::leak(Box::new(new));
            *pool = Some((process, new));
            Ok(new)
        }
    }
}

/// Runs `work` in the pool, without the GIL.
pub(crate) fn in_threads<R: Send>(py: Python, work: impl FnOnce() -> R + Send) -> PyResult<R> {
    let pool = pool(py)?;
    Ok(py.detach(|| pool.install(work)))
}

/// The rays of a task of the library: [`in_ranges`] keeps to multiples of these for each thread.
pub(crate) const RAYS: usize = 1 << 12;

/// The points of a range at first: tasks of points are as small as it takes for each thread to have one.
pub(crate) const POINTS: usize = 1 << 8;

/// Calls `work` with consecutive ranges of `count` queries in the pool, without the GIL, and checks signals after each of
/// them. Ranges take about [`POLL_INTERVAL`], and at least `group` queries for each thread.
pub(crate) fn in_ranges(
    py: Python,
    (count, group): (usize, usize),
    mut work: impl FnMut(Range<usize>) + Send,
) -> PyResult<()> {
    let pool = pool(py)?;
    let least = group * pool.current_num_threads();
    let (mut first, mut len) = (0, 4 * least);
    while first < count {
        let range = first..count.min(first + len);
        first = range.end;
        let start = Instant::now();
        py.detach(|| pool.install(|| work(range)));
        py.check_signals()?;
        match start.elapsed() {
            time if time < POLL_INTERVAL / 8 => len *= 8,
            time if time < POLL_INTERVAL / 2 => len *= 2,
            time if time > 2 * POLL_INTERVAL => len = least.max(len / 2 / least * least),
            _ => {}
        }
    }
    Ok(())
}
