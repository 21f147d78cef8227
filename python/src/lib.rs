//! The native part of the Python module `kiln`: arguments and results of the library's functions, and nothing that the
//! library lacks. The Python part is `python/kiln`.

mod arrays;
mod camera;
mod hits;
mod instances;
mod mesh;
mod picture;
mod rays;
mod scene;
mod state;
mod threads;

use std::ffi::{CString, OsString};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::Duration;

use kiln::error::{Error, Warnings, printable};
use kiln_cli::picture::{by_name, error_by_name};
use pyo3::exceptions::{
    PyKeyboardInterrupt, PyMemoryError, PyOSError, PyRuntimeError, PyUserWarning, PyValueError,
};
use pyo3::prelude::*;

pyo3::create_exception!(
    kiln,
    KilnWarning,
    PyUserWarning,
    "Something that is left out, replaced or without meaning."
);

/// How often signals and progress are looked at while a thread works.
const POLL_INTERVAL: Duration = Duration::from_millis(50);

/// The exception of an error.
fn raised(error: &Error) -> PyErr {
    let text = printable(&error_by_name(error)).into_owned();
    match error {
        Error::Input { .. } => PyValueError::new_err(of_source(text)),
        Error::Usage { .. } => PyValueError::new_err(text),
        Error::Memory { .. } => PyMemoryError::new_err(text),
        Error::Output { .. } => PyOSError::new_err(text),
        Error::Failed { .. } => PyRuntimeError::new_err(text),
        Error::Interrupted => PyKeyboardInterrupt::new_err(()),
    }
}

/// A message with `source` for the name of what was read from memory.
fn of_source(text: String) -> String {
    text.strip_prefix("-:").map(|rest| format!("source:{rest}")).unwrap_or(text)
}

/// Issues a warning at the line that called the package, also by way of trimesh.
fn warn(py: Python, text: &str) -> PyResult<()> {
    let text = CString::new(printable(&of_source(by_name(text))).into_owned())?;
    let is_between = |frame: &Bound<PyAny>| {
        let module =
            frame.getattr("f_globals").and_then(|names| names.get_item("__name__")?.extract::<String>());
        module.is_ok_and(|module| matches!(module.split('.').next(), Some("kiln" | "trimesh")))
    };
    let mut level = 1;
    let mut frame = py.import("sys")?.call_method0("_getframe").ok();
    while let Some(inner) = frame.filter(is_between) {
        level += 1;
        frame = inner.getattr_opt("f_back")?.filter(|outer| !outer.is_none());
    }
    PyErr::warn(py, &py.get_type::<KilnWarning>(), &text, level)
}

fn warn_all(py: Python, warnings: &Warnings) -> PyResult<()> {
    warnings.messages().iter().try_for_each(|text| warn(py, text))
}

/// Runs `work` in the pool, and calls `report` with the GIL from time to time. When a signal handler or `report`
/// raises, `cancel` is set, the exception is returned at once, and `work` ends by itself.
fn interruptible<T: Send + 'static>(
    py: Python,
    cancel: &Arc<AtomicBool>,
    mut report: impl FnMut(Python) -> PyResult<()>,
    work: impl FnOnce() -> T + Send + 'static,
) -> PyResult<T> {
    let (done, waiting) = channel();
    let pool = threads::pool(py)?;
    let thread = std::thread::Builder::new().spawn(move || {
        // Fails after an exception, when the result is not received.
        let _ = done.send(pool.install(work));
    });
    let thread = thread.map_err(|e| PyRuntimeError::new_err(format!("a thread cannot be started: {e}")))?;
    let cancelled = |e| {
        cancel.store(true, Ordering::Relaxed);
        Err(e)
    };
    let mut waiting = waiting;
    loop {
        let received;
        (waiting, received) = py.detach(move || {
            let received = waiting.recv_timeout(POLL_INTERVAL);
            (waiting, received)
        });
        if let Err(e) = report(py).and_then(|()| py.check_signals()) {
            return cancelled(e);
        }
        match received {
            Ok(result) => return Ok(result),
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => {
                let panic = thread.join().err().and_then(|panic| panic.downcast::<String>().ok());
                let what = panic.map_or_else(|| "internal error".to_owned(), |text| *text);
                return Err(PyRuntimeError::new_err(what));
            }
        }
    }
}

/// Runs the command `kiln` with the words after its name, and returns its exit code. It is called at most
/// once per process.
#[pyfunction]
fn run_command(py: Python, words: Vec<OsString>) -> u8 {
    py.detach(|| kiln_cli::run(words))
}

/// The native part of `kiln`.
#[pymodule]
fn _kiln(module: &Bound<PyModule>) -> PyResult<()> {
    // Panics of parsers are caught and become errors.
    let hook = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        if !kiln::error::is_contained() {
            hook(panic);
        }
    }));
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add("KilnWarning", module.py().get_type::<KilnWarning>())?;
    module.add_class::<mesh::Mesh>()?;
    module.add_class::<instances::Instances>()?;
    module.add_class::<hits::Found>()?;
    module.add_class::<scene::Scene>()?;
    module.add_class::<picture::Picture>()?;
    module.add_class::<picture::Options>()?;
    module.add_class::<picture::Prepared>()?;
    module.add_function(wrap_pyfunction!(picture::render, module)?)?;
    module.add_function(wrap_pyfunction!(camera::camera_rays, module)?)?;
    module.add_function(wrap_pyfunction!(run_command, module)?)
}
