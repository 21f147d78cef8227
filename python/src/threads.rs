//! The threads of queries and pictures.

use std::sync::Mutex;

use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use rayon::ThreadPool;

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
            let new = kiln::cli::pool(None).map_err(|e| crate::raised(&e))?;
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
