//! Loading of files on background threads.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::Instant;

use super::Open;
use super::request::Opened;
use kiln::error::{Result, Warnings};
use kiln::import::FileRead;
use kiln::scene::ImportOptions;

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
    /// Files of the newest request, and when it was made.
    newest: (Vec<PathBuf>, Instant),
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
        let (open, wake, newest) = (Arc::new(open), Arc::new(wake), (Vec::new(), Instant::now()));
        Loader { open, threads, wake, number: 0, answered: 0, newest, sender, loaded }
    }

    /// Starts loading files. Results of earlier requests are discarded.
    pub(crate) fn load(&mut self, inputs: Vec<PathBuf>, options: Option<ImportOptions>) {
        self.number += 1;
        self.newest = (inputs.clone(), Instant::now());
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

    /// The files that are being read, and since when.
    pub(crate) fn reading(&self) -> Option<(&[PathBuf], Instant)> {
        let (files, since) = &self.newest;
        (self.answered < self.number).then_some((files, *since))
    }
}
