//! The threads of queries and pictures.

use std::sync::Mutex;

use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use rayon::ThreadPool;

/// The pool of the process with this id. A process that was forked has no threads of its parent's pool.
static POOL: Mutex<Option<(u32, &'static ThreadPool)>> = Mutex::new(None);

/// The pool of this process, as that of the command. It is locked with the GIL held, which a thread that forks holds, too.
pub(crate) fn pool(_py: Python) -> PyResult<&'static ThreadPool> {
    let locked = POOL.lock();
    let mut pool = locked.map_err(|_| PyRuntimeError::new_err("threads cannot be started"))?;
    let process = std::process::id();
    match *pool {
        Some((owner, pool)) if owner == process => Ok(pool),
        _ => {
            let new = kiln::cli::pool(None).map_err(|e| crate::raised(&e))?;
            // That of a parent process is never dropped: its threads are not here to end.
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
