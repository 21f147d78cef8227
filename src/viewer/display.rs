//! Detection of a display, and error messages for windows that cannot be opened.
//!
//! The messages of the windowing libraries contain source lines and type names. Some errors are panics: winit panics if
//! libxkbcommon-x11 or an extension of the X server is missing. This module translates them. A missing display or
//! library is a failure (exit code 1), not a wrong input.

use std::any::Any;
use std::ffi::OsString;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind, set_hook, take_hook};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::error::{Error, Result};

/// Hint if no window can be opened.
const WITHOUT: &str =
    "`kiln render` makes pictures without a window; `xvfb-run kiln view` opens one on no display";
/// Hint if the display server does not answer.
const SERVER: &str = "start it and let this user in (xauth); `kiln render` makes pictures without a window";
/// Hint if a library is missing.
const LIBRARIES: &str = "install them (Debian: libx11-xcb1 libxcursor1 libxi6 libxkbcommon-x11-0, on Wayland libwayland-client0 \
                         libwayland-egl1 libxkbcommon0); `kiln render` makes pictures without a window";
/// Hint if the display has no OpenGL.
const OPENGL: &str = "install Mesa, which has one in software (Debian: libgl1 libegl1 libgl1-mesa-dri); \
                      `kiln render` makes pictures without a window";

/// Checks for a display before files are loaded.
///
/// # Errors
/// [`Error::Failed`] on Unix systems other than macOS if no environment variable names a display.
pub fn check() -> Result<()> {
    if cfg!(all(unix, not(target_os = "macos"))) {
        check_names(&["WAYLAND_DISPLAY", "WAYLAND_SOCKET", "DISPLAY"].map(std::env::var_os))
    } else {
        Ok(())
    }
}

fn check_names(names: &[Option<OsString>]) -> Result<()> {
    // winit also treats an empty value as unset.
    if names.iter().flatten().any(|name| !name.is_empty()) {
        return Ok(());
    }
    Err(failed(
        "there is no display to open a window on: neither DISPLAY nor WAYLAND_DISPLAY is set",
        WITHOUT,
    ))
}

/// Opens a window by `run`, and returns when it was closed; `run` sets the flag when the window is open. An error or a
/// panic before that is returned as an error with a translated message. A later panic is a bug of kiln and is resumed.
///
/// # Errors
/// [`Error::Failed`] if the window cannot be opened.
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

/// Translates an error of opening a window.
pub fn explain(e: &eframe::Error) -> Error {
    match e {
        eframe::Error::AppCreation(e) => failed(&format!("the window cannot be set up: {e}"), ""),
        eframe::Error::Winit(e) => explain_window(&e.to_string()),
        eframe::Error::WinitEventLoop(e) => explain_window(&e.to_string()),
        eframe::Error::Glutin(e) => no_opengl(&e.to_string()),
        eframe::Error::NoGlutinConfigs(_, e) => no_opengl(&e.to_string()),
        eframe::Error::OpenGL(e) => no_opengl(&e.to_string()),
    }
}

fn explain_panic(panic: &(dyn Any + Send)) -> Error {
    let text = panic.downcast_ref::<String>().map(String::as_str);
    let text = text.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or_default();
    if text.contains("glutin") { no_opengl(text) } else { explain_window(text) }
}

fn no_opengl(cause: &str) -> Error {
    // A prefix in brackets is glutin's error code.
    let cause =
        cause.strip_prefix('[').and_then(|rest| rest.split_once("] ")).map_or(cause, |(_, cause)| cause);
    failed(&format!("the display has no OpenGL to draw with: {}", line(cause)), OPENGL)
}

/// Recognises messages of winit 0.30, xkbcommon-dl 0.4 and wayland-client 0.31; other messages are passed on.
fn explain_window(cause: &str) -> Error {
    let says = |sign: &str| cause.contains(sign);
    if says("Failed to open connection to X server") {
        return failed(&format!("no X server answers at {}", named(&["DISPLAY"])), SERVER);
    }
    if says("wayland compositor") || says("WAYLAND_SOCKET") {
        let what =
            format!("no Wayland compositor answers at {}", named(&["WAYLAND_DISPLAY", "WAYLAND_SOCKET"]));
        return failed(
            &what,
            "unset the name to use an X server; `kiln render` makes pictures without a window",
        );
    }
    if says("xlib's shared libraries") || says("XKBNotFound") || says("could not be loaded") {
        let library = cause.split_whitespace().find(|word| word.starts_with("lib") && word.contains(".so"));
        let what = match library {
            Some(library) => format!("a library that windows take is missing: {library}"),
            None if says("wayland library") => {
                "a library that windows take is missing: libwayland-client".into()
            }
            None if says("XKBNotFound") => "a library that windows take is missing: libxkbcommon".into(),
            None => "one of X's libraries is missing: libX11, libX11-xcb, libXcursor, libXi, libxcb".into(),
        };
        return failed(&what, LIBRARIES);
    }
    failed(&format!("no window can be opened: {}", line(cause)), WITHOUT)
}

/// `VARIABLE=value` of the first of these variables that is set.
fn named(variables: &[&str]) -> String {
    let named = |variable: &&str| {
        let value = std::env::var(variable).ok().filter(|value| !value.is_empty())?;
        Some(format!("{variable}={value}"))
    };
    variables.iter().find_map(named).unwrap_or_else(|| variables[0].to_owned())
}

/// The first line of a library's message, without its source location.
fn line(cause: &str) -> &str {
    let cause = match cause.strip_prefix("os error at ") {
        Some(rest) => rest.split_once(": ").map_or(rest, |(_, cause)| cause),
        None => cause,
    };
    match cause.lines().next().unwrap_or_default().trim().trim_end_matches('.') {
        "" => "no reason was given",
        line => line,
    }
}

fn failed(what: &str, hint: &str) -> Error {
    Error::Failed { what: what.into(), hint: hint.into() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_display_has_a_name() {
        let name = |text: &str| Some(OsString::from(text));
        assert!(check_names(&[None, None, name(":0")]).is_ok());
        assert!(check_names(&[name("wayland-0"), None, name("")]).is_ok());
        let Err(e) = check_names(&[None, name(""), None]) else { panic!("there is no display") };
        assert!(e.to_string().contains("there is no display"), "{e}");
        assert!(e.hint().contains("kiln render"));
    }

    /// Messages recorded from the libraries with missing displays and hidden libraries.
    #[test]
    fn what_libraries_say_becomes_a_line() {
        let message = |cause: &str| explain_window(cause).to_string();
        let at = "os error at /registry/winit-0.30.13/src/platform_impl/linux/mod.rs:788: ";
        assert!(
            message(&format!("{at}Failed to open connection to X server"))
                .starts_with("no X server answers at DISPLAY")
        );
        assert!(
            message("os error at /w/mod.rs:89: Could not find wayland compositor")
                .starts_with("no Wayland compositor answers at WAYLAND_DISPLAY")
        );
        assert_eq!(
            message(&format!("{at}Failed to load one of xlib's shared libraries")),
            "one of X's libraries is missing: libX11, libX11-xcb, libXcursor, libXi, libxcb"
        );
        assert_eq!(
            message("Library libxkbcommon-x11.so could not be loaded."),
            "a library that windows take is missing: libxkbcommon-x11.so"
        );
        assert_eq!(
            message("called `Result::unwrap()` on an `Err` value: XKBNotFound"),
            "a library that windows take is missing: libxkbcommon"
        );
        assert_eq!(
            message("failed to request XRandR version: UnsupportedExtension"),
            "no window can be opened: failed to request XRandR version: UnsupportedExtension"
        );
        assert_eq!(
            message("os error at /w/mod.rs:89: The wayland library could not be loaded"),
            "a library that windows take is missing: libwayland-client"
        );
        assert_eq!(message(""), "no window can be opened: no reason was given");
        let gl = |cause: &str| no_opengl(cause).to_string();
        assert_eq!(gl("[a7] GLXBadFBConfig"), "the display has no OpenGL to draw with: GLXBadFBConfig");
        assert_eq!(gl("not found"), "the display has no OpenGL to draw with: not found");
    }

    /// The only test that changes the process's panic hook. The hook forwards panics of other threads.
    #[test]
    fn a_panic_is_explained_until_the_window_is_open() {
        let e =
            open(|_| panic!("Library libxkbcommon-x11.so could not be loaded.")).expect_err("it panicked");
        assert_eq!(e.to_string(), "a library that windows take is missing: libxkbcommon-x11.so");
        let later = catch_unwind(|| {
            open(|is_open| {
                is_open.store(true, Ordering::Relaxed);
                resume_unwind(Box::new("a fault"));
            })
        });
        assert_eq!(later.expect_err("it panicked").downcast_ref(), Some(&"a fault"));
        assert_eq!(open(|_| Ok(())), Ok(()));
    }
}
