//! Whether there is a display to open a window on, and what is said where there is none.
//!
//! The libraries below say it in errors with the lines of their own sources, and some of it in panics; here it becomes a line for
//! people. What is missing on a machine is a failure (exit code 1), not a wrong input.

use std::any::Any;
use std::ffi::OsString;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind, set_hook, take_hook};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::error::{Error, Result};

/// What to do where no window can be opened.
const WITHOUT: &str = "`kiln render` makes pictures without a window; on a machine without a display, `xvfb-run kiln view …` has one";
/// What to do where there is a display, but no OpenGL on it.
const OPENGL: &str = "install Mesa, which has one in software (Debian: libgl1 libegl1 libgl1-mesa-dri); \
                      `kiln render` makes pictures without a window";
/// What to do where a library is missing.
const LIBRARIES: &str = "install what windows take (Debian: libx11-6 libx11-xcb1 libxcursor1 libxi6 libxkbcommon-x11-0 \
                         libwayland-client0 libegl1 libgl1); `kiln render` makes pictures without a window";

/// The names of a display, wherever such names are used.
const NAMES: [&str; 3] = ["WAYLAND_DISPLAY", "WAYLAND_SOCKET", "DISPLAY"];

/// Fails where there is certainly no display, before anything is loaded or opened.
///
/// # Errors
/// [`Error::Failed`], where the environment names no display and it would have to.
pub fn check() -> Result<()> {
    if cfg!(all(unix, not(target_os = "macos"))) { check_named(&NAMES.map(std::env::var_os)) } else { Ok(()) }
}

fn check_named(values: &[Option<OsString>]) -> Result<()> {
    if values.iter().flatten().any(|value| !value.is_empty()) {
        return Ok(());
    }
    Err(failed(
        "there is no display to open a window on: neither DISPLAY nor WAYLAND_DISPLAY is set",
        WITHOUT,
    ))
}

/// Opens a window by `run`, and returns when it was closed; `run` is to set the flag once the window is open. What fails before, be
/// it by an error or a panic, is a failure with a line for people. A panic later is a fault of kiln's and goes on.
///
/// # Errors
/// [`Error::Failed`], where the window cannot be opened.
pub fn open(run: impl FnOnce(Arc<AtomicBool>) -> eframe::Result) -> Result<()> {
    let is_open = Arc::new(AtomicBool::new(false));
    let before = Arc::new(take_hook());
    let (here, open, hook) = (std::thread::current().id(), is_open.clone(), before.clone());
    set_hook(Box::new(move |panic| {
        if open.load(Ordering::Relaxed) || std::thread::current().id() != here {
            hook(panic);
        }
    }));
    let done = catch_unwind(AssertUnwindSafe(|| run(is_open.clone())));
    set_hook(Box::new(move |panic| before(panic)));
    match done {
        Ok(done) => done.map_err(|e| explain(&e)),
        Err(panic) if is_open.load(Ordering::Relaxed) => resume_unwind(panic),
        Err(panic) => Err(explain_panic(panic.as_ref())),
    }
}

/// What it means that a window could not be opened, or kept.
pub fn explain(e: &eframe::Error) -> Error {
    match e {
        eframe::Error::AppCreation(e) => failed(&format!("the window cannot be set up: {e}"), ""),
        eframe::Error::Glutin(_) | eframe::Error::NoGlutinConfigs(..) | eframe::Error::OpenGL(_) => {
            no_opengl(&match e {
                eframe::Error::Glutin(e) => e.to_string(),
                eframe::Error::NoGlutinConfigs(_, e) => e.to_string(),
                other => other.to_string(),
            })
        }
        eframe::Error::Winit(e) => explain_window(&e.to_string()),
        eframe::Error::WinitEventLoop(e) => explain_window(&e.to_string()),
    }
}

/// The libraries' panics while the window was being opened.
fn explain_panic(panic: &(dyn Any + Send)) -> Error {
    let text =
        panic.downcast_ref::<String>().map(String::as_str).or_else(|| panic.downcast_ref::<&str>().copied());
    let text = text.unwrap_or_default();
    if text.contains("glutin") || text.contains("OpenGL") { no_opengl(text) } else { explain_window(text) }
}

fn no_opengl(cause: &str) -> Error {
    failed(&format!("the display has no OpenGL to draw with: {}", in_words(cause)), OPENGL)
}

fn explain_window(cause: &str) -> Error {
    let display = |names: &[&str]| {
        let named = |name: &&str| {
            let value = std::env::var(name).ok().filter(|value| !value.is_empty())?;
            Some(format!("{name}={value}"))
        };
        names.iter().find_map(named).unwrap_or_else(|| "DISPLAY".into())
    };
    if cause.contains("Failed to open connection to X server") {
        let what = format!("no X server answers at {}", display(&["DISPLAY"]));
        return failed(
            &what,
            "check that it runs and lets this user in (xauth); `kiln render` makes pictures without a window",
        );
    }
    if cause.contains("wayland") || cause.contains("Wayland") && !cause.contains("not set") {
        let what =
            format!("no Wayland compositor answers at {}", display(&["WAYLAND_DISPLAY", "WAYLAND_SOCKET"]));
        return failed(
            &what,
            "unset WAYLAND_DISPLAY to use the X server of DISPLAY; `kiln render` makes pictures without a window",
        );
    }
    let lacks_library = ["XKBNotFound", "Failed to load one of xlib", "Library", "libwayland", ".so"];
    if lacks_library.iter().any(|sign| cause.contains(sign)) {
        return failed(&format!("a library that windows take is missing: {}", in_words(cause)), LIBRARIES);
    }
    failed(&format!("no window can be opened: {}", in_words(cause)), WITHOUT)
}

/// A cause as libraries give it, in a line, without the places in their sources.
fn in_words(cause: &str) -> String {
    let cause = match cause.strip_prefix("os error at ") {
        Some(rest) => rest.split_once(": ").map_or(rest, |(_, cause)| cause),
        None => cause,
    };
    let cause = if cause.contains("XKBNotFound") { "libxkbcommon" } else { cause };
    let line = cause.lines().next().unwrap_or_default().trim().trim_end_matches('.');
    if line.is_empty() { "no reason was given".into() } else { line.into() }
}

fn failed(what: &str, hint: &str) -> Error {
    Error::Failed { what: what.into(), hint: hint.into() }
}
