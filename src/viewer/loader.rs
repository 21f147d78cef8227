//! Loading of files on background threads.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender, channel};

use super::Open;
use super::request::Opened;
use crate::error::{Result, Warnings};
use crate::import::FileRead;
use crate::scene::ImportOptions;

/// Result of a load request.
pub(crate) struct Loaded {
    /// Number of the load request.
    pub number: u64,
    /// Requested files.
    pub inputs: Vec<PathBuf>,
    /// Requested options, if they were chosen in the window.
    pub options: Option<ImportOptions>,
    /// Scene, or the error.
    pub result: Result<Opened>,
    /// Every file that was read or looked for.
    pub files: Vec<FileRead>,
    /// Warnings and notes.
    pub warnings: Warnings,
}

/// Loads files on background threads.
pub(crate) struct Loader {
    open: Arc<Open>,
    threads: Arc<rayon::ThreadPool>,
    wake: Arc<dyn Fn() + Send + Sync>,
    number: u64,
    /// Number of the last completed request.
    answered: u64,
    sender: Sender<Loaded>,
    loaded: Receiver<Loaded>,
}

impl Loader {
    /// Creates a loader that calls `open` on `threads`, and `wake` after each result.
    pub(crate) fn new(
        open: Open,
        threads: Arc<rayon::ThreadPool>,
        wake: impl Fn() + Send + Sync + 'static,
    ) -> Self {
        let (sender, loaded) = channel();
        Loader { open: Arc::new(open), threads, wake: Arc::new(wake), number: 0, answered: 0, sender, loaded }
    }

    /// Starts loading files. Results of earlier requests are discarded.
    pub(crate) fn load(&mut self, inputs: Vec<PathBuf>, options: Option<ImportOptions>) {
        self.number += 1;
        let number = self.number;
        let (open, threads) = (Arc::clone(&self.open), Arc::clone(&self.threads));
        let (sender, wake) = (self.sender.clone(), Arc::clone(&self.wake));
        std::thread::spawn(move || {
            let mut warnings = Warnings::default();
            let (result, files) = threads.install(|| open(&inputs, options.as_ref(), &mut warnings));
            // The receiver is dropped when the window closes.
            let _ = sender.send(Loaded { number, inputs, options, result, files, warnings });
            wake();
        });
    }

    /// The result of the newest request, once, when it is available.
    pub(crate) fn loaded(&mut self) -> Option<Loaded> {
        let loaded = self.loaded.try_iter().filter(|loaded| loaded.number == self.number).last()?;
        self.answered = loaded.number;
        Some(loaded)
    }

    /// Whether a request is pending.
    pub(crate) fn is_reading(&self) -> bool {
        self.answered < self.number
    }
}
