//! The interactive viewer: camera navigation, and the result and cost of each effect.
//!
//! Two threads run beside the interface's thread. The *loader* reads files; the *painter* renders the newest
//! `RenderRequest` from coarse to fine. The interface posts requests and shows the last result; it waits for
//! a result only as long as a frame may take. A request is plain data; equal requests have equal pictures.

mod app;
mod canvas;
pub mod command_line;
mod controls;
pub mod display;
pub mod false_colour;
mod history;
pub mod inspect;
mod keys;
mod loader;
pub mod navigate;
mod open_dialog;
mod outliner;
mod overlay;
mod painter;
mod panel;
mod pixels;
mod refine;
mod request;
mod save;
mod theme;
mod timeline;
pub mod watch;

pub use app::run;
pub use painter::final_picture;
pub use request::{CameraSource, Opened};
pub use save::saved_picture;

use std::path::{Path, PathBuf};

use kiln::error::{Result, Warnings, printable};
use kiln::import::FileRead;
use kiln::scene::ImportOptions;

/// Reads input files with the options that were chosen in the window; `None` for those of the command line. Returns the
/// scene with its initial camera and settings, and every file that was read or looked for. Adds warnings.
pub type Open = Box<
    dyn Fn(&[PathBuf], Option<&ImportOptions>, &mut Warnings) -> (Result<Opened>, Vec<FileRead>)
        + Send
        + Sync,
>;

/// Start parameters of the viewer.
pub struct Start {
    /// The files to open.
    pub inputs: Vec<PathBuf>,
    /// Opens the inputs, and files that are dropped onto the window.
    pub open: Open,
    /// Initial width and height of the picture in pixels; `None` for the scene's size.
    pub size: Option<[u32; 2]>,
    /// Rendering threads.
    pub threads: rayon::ThreadPool,
}

/// The file name without its folder, for window titles.
fn name_of(file: &Path) -> String {
    printable(&file.file_name().unwrap_or(file.as_os_str()).to_string_lossy()).into_owned()
}

/// At most `length` characters of a name: all, or its start and its end.
fn elided(name: &str, length: usize) -> String {
    let name = &*printable(name);
    let count = name.chars().count();
    if count <= length {
        return name.to_owned();
    }
    let end = (length - 1) / 2;
    let start = name.chars().take(length - 1 - end);
    start.chain(['…']).chain(name.chars().skip(count - end)).collect()
}

/// The error's message, followed by its hint on a line of its own.
fn message_with_hint(e: &kiln::error::Error) -> String {
    match e.hint() {
        "" => printable(&e.to_string()).into_owned(),
        hint => format!("{}\n{}", printable(&e.to_string()), printable(hint)),
    }
}

#[cfg(test)]
mod tests {
    use super::elided;

    #[test]
    fn long_names_lose_their_middle() {
        assert_eq!(elided("short.obj", 9), "short.obj");
        // Four characters of each end and the ellipsis; of eight characters four of the start and three of the end.
        assert_eq!(elided("a-long-name.obj", 9), "a-lo….obj");
        assert_eq!(elided("größer-äöüß.obj", 8), "größ…obj");
    }
}
