//! Errors of opening the window: one line and a hint, exit code 1.

use std::ffi::OsString;

use kiln::error::{Error, Result};

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
    Err(Error::Failed {
        what: "there is no display to open a window on: neither DISPLAY nor WAYLAND_DISPLAY is set".into(),
        hint: "`kiln render` makes pictures without a window; `xvfb-run kiln view` opens one on no display"
            .into(),
    })
}

/// An error of opening a window, of which the first line is kept.
pub fn explain(e: &eframe::Error) -> Error {
    let message = e.to_string();
    let line = message.lines().next().unwrap_or_default();
    // winit names the place in its source before the cause.
    let cause = line.split_once(".rs:").and_then(|(_, rest)| rest.split_once(": "));
    let line = cause.map_or(line, |(_, cause)| cause);
    Error::Failed {
        what: format!("no window can be opened: {line}"),
        hint: "start the display server and let this user in; docs/install.md lists the libraries that windows take; \
               `kiln render` makes pictures without a window"
            .into(),
    }
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
}
