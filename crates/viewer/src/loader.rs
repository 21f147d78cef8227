//! Loading of files on a background thread.

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

/// A request to load files.
struct LoadRequest {
    number: u64,
    inputs: Vec<PathBuf>,
    options: Option<ImportOptions>,
}

/// Loads files on a background thread.
pub(crate) struct Loader {
    number: u64,
    /// Number of the last completed request.
    answered: u64,
    /// Files of the newest request, and when it was made.
    newest: (Vec<PathBuf>, Instant),
    requests: Sender<LoadRequest>,
    loaded: Receiver<Loaded>,
}

impl Loader {
    /// Starts the thread, which calls `open` on `threads`, and `wake` after each result, until the loader is dropped.
    pub(crate) fn new(
        open: Open,
        threads: Arc<rayon::ThreadPool>,
        wake: impl Fn() + Send + Sync + 'static,
    ) -> Self {
        let ((requests, receiver), (sender, loaded)) = (channel::<LoadRequest>(), channel());
        std::thread::spawn(move || {
            while let Ok(request) = receiver.recv() {
                // Of requests that have arrived in the meantime, the last replaces the others.
                let LoadRequest { number, inputs, options } = receiver.try_iter().last().unwrap_or(request);
                let mut warnings = Warnings::default();
                let (result, files) = threads.install(|| open(&inputs, options.as_ref(), &mut warnings));
                // The receiver is dropped when the window closes.
                let _ = sender.send(Loaded { number, inputs, options, result, files, warnings });
                wake();
            }
        });
        Loader { number: 0, answered: 0, newest: (Vec::new(), Instant::now()), requests, loaded }
    }

    /// Loads files. Results of earlier requests are discarded. Returns whether the thread lives: a panic ends it.
    pub(crate) fn load(&mut self, inputs: Vec<PathBuf>, options: Option<ImportOptions>) -> bool {
        self.number += 1;
        self.newest = (inputs.clone(), Instant::now());
        self.requests.send(LoadRequest { number: self.number, inputs, options }).is_ok()
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

#[cfg(test)]
mod tests {
    use std::sync::Mutex;
    use std::time::Duration;

    use super::*;
    use kiln::error::Error;

    /// While a file is read, further requests wait, and the last of them alone is read: on one thread.
    #[test]
    fn requests_in_the_meantime_are_one() {
        let (started, starts) = channel();
        let (go, gate) = channel::<()>();
        let gate = Mutex::new(gate);
        let open: Open = Box::new(move |inputs, _, _| {
            started.send((inputs[0].clone(), std::thread::current().id())).expect("the test listens");
            gate.lock().expect("one reader").recv().expect("the test goes on");
            (Err(Error::usage("not read", "")), Vec::new())
        });
        // The pool's only thread is the one that reads.
        let threads = Arc::new(rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a pool"));
        let mut loader = Loader::new(open, threads, || {});
        let minute = Duration::from_secs(60);
        assert!(loader.load(vec!["0".into()], None));
        let (first, thread) = starts.recv_timeout(minute).expect("a file is read");
        assert_eq!(first, PathBuf::from("0"));
        (1..=300).for_each(|number| assert!(loader.load(vec![number.to_string().into()], None)));
        go.send(()).expect("the loader waits");
        assert_eq!(starts.recv_timeout(minute), Ok(("300".into(), thread)));
        go.send(()).expect("the loader waits");
        while loader.loaded().is_none() {
            std::thread::yield_now();
        }
        assert!(loader.reading().is_none() && starts.try_recv().is_err());
    }
}
