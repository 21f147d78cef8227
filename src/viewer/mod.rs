//! The window: a scene that one can walk around in, and see what each effect does and costs.
//!
//! Two threads beside the interface's own. The *loader* reads files; the *painter* renders, coarse to fine, what it was asked for
//! last (`painter`). The interface never waits for either: it says what it wants to see (`look::Order`), and shows what it was
//! given last. What a picture follows from is plain data (`look`); two orders that are equal have equal pictures.

mod app;
mod canvas;
mod controls;
pub mod display;
pub mod false_colour;
pub mod inspect;
mod keys;
mod loader;
mod request;
pub mod navigate;
mod overlay;
mod painter;
mod panel;
mod refine;
mod save;
mod timeline;
mod trace;
pub mod watch;
pub mod command_line;

pub use app::run;
pub use request::{CameraSource, Opened, Settings};

use std::path::{Path, PathBuf};
use std::time::Duration;

use crate::error::{Result, Warnings};
use crate::import::FileRead;

/// Reads files and finds out how they are first looked at, and lists all that were read or looked for. The second is told what there
/// is to say of them.
pub type Open = Box<dyn Fn(&[PathBuf], &mut Warnings) -> (Result<Opened>, Vec<FileRead>) + Send + Sync>;

/// What a window is started with.
pub struct Start {
    /// The files to open.
    pub inputs: Vec<PathBuf>,
    /// Opens them, and others that are dropped onto the window.
    pub open: Open,
    /// Width and height of the picture at first, in pixels; as the scene says where it is not given.
    pub size: Option<[u32; 2]>,
    /// Threads that render.
    pub threads: rayon::ThreadPool,
    /// A file for what happens in the window, and when: a line of JSON each.
    pub trace: Option<PathBuf>,
    /// How long to measure the pauses of the interface before the window closes.
    pub pauses: Option<Duration>,
    /// Whether size and settings of the window are remembered.
    pub remembers: bool,
}

/// The file's own name, for titles.
fn name_of(file: &Path) -> String {
    file.file_name().unwrap_or(file.as_os_str()).to_string_lossy().into_owned()
}

/// What went wrong, and what to do about it.
fn message_with_hint(e: &crate::error::Error) -> String {
    match e.hint() {
        "" => e.to_string(),
        hint => format!("{e}\n{hint}"),
    }
}
