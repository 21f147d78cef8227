//! Reading files beside the interface.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender, channel};

use super::Open;
use super::request::Opened;
use crate::error::{Result, Warnings};
use crate::import::FileRead;

/// Files that were read, or could not be.
pub struct Loaded {
    /// Which request this answers.
    pub number: u64,
    /// The files that were asked for.
    pub inputs: Vec<PathBuf>,
    /// What they hold.
    pub result: Result<Opened>,
    /// Every file that was read or looked for.
    pub files: Vec<FileRead>,
    /// What there is to say of them.
    pub warnings: Warnings,
}

/// Reads files on threads of its own.
pub struct Loader {
    open: Arc<Open>,
    threads: Arc<rayon::ThreadPool>,
    wake: Arc<dyn Fn() + Send + Sync>,
    number: u64,
    /// The last request that was answered.
    answered: u64,
    sender: Sender<Loaded>,
    loaded: Receiver<Loaded>,
}

impl Loader {
    /// Has files opened by `open` on `threads`, and calls `wake` when some are.
    pub fn new(open: Open, threads: Arc<rayon::ThreadPool>, wake: impl Fn() + Send + Sync + 'static) -> Self {
        let (sender, loaded) = channel();
        Loader { open: Arc::new(open), threads, wake: Arc::new(wake), number: 0, answered: 0, sender, loaded }
    }

    /// Reads files; what was asked for before is no longer wanted.
    pub fn load(&mut self, inputs: Vec<PathBuf>) {
        self.number += 1;
        let number = self.number;
        let (open, threads) = (Arc::clone(&self.open), Arc::clone(&self.threads));
        let (sender, wake) = (self.sender.clone(), Arc::clone(&self.wake));
        std::thread::spawn(move || {
            let mut warnings = Warnings::default();
            let (result, files) = threads.install(|| open(&inputs, &mut warnings));
            // Nobody listens to a window that closes.
            let _ = sender.send(Loaded { number, inputs, result, files, warnings });
            wake();
        });
    }

    /// What was asked for last, once it is there.
    pub fn loaded(&mut self) -> Option<Loaded> {
        let loaded = self.loaded.try_iter().filter(|loaded| loaded.number == self.number).last()?;
        self.answered = loaded.number;
        Some(loaded)
    }

    /// Whether files are being read.
    pub fn is_reading(&self) -> bool {
        self.answered < self.number
    }
}
