//! Detection of changed scene files by polling.
//!
//! A thread reads size, time and identity of each file a few times a second (about a microsecond per file) and reports
//! a change once all files are unchanged for a while. Notifications of the system are not used: they do not cover
//! network shares, and they follow the old file if an editor replaces it by renaming another.
//! [`kiln::import::load_and_list`] lists the files of a scene.

use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::time::{Duration, Instant};

use kiln::import::{FileRead, Stamp};

/// Poll interval while nothing changes.
const IDLE_INTERVAL: Duration = Duration::from_millis(200);
/// Poll interval after a change.
const SETTLING_INTERVAL: Duration = Duration::from_millis(40);
/// Time for which changed files must stay the same. Programs do not pause that long while writing.
const SETTLE_TIME: Duration = Duration::from_millis(150);
/// The same if a file has become missing or empty, which a slow program may be about to write.
const SETTLE_TIME_MISSING: Duration = Duration::from_millis(1000);
/// Polling takes at most 1 / `MAX_LOAD_DIVISOR` of the time, for any number of files and any disk.
const MAX_LOAD_DIVISOR: u32 = 50;

/// Watches files until it is dropped.
pub struct Watcher {
    lists: Sender<Vec<FileRead>>,
}

impl Watcher {
    /// Watches `files`, and calls `on_change` on a background thread, once per change, when a file differs from what
    /// was read and all have settled.
    ///
    /// # Errors
    /// The thread cannot be started.
    pub fn new(files: Vec<FileRead>, on_change: impl Fn() + Send + 'static) -> std::io::Result<Self> {
        let (lists, receiver) = channel();
        let thread = std::thread::Builder::new().name("watch".into());
        thread.spawn(move || watch(State::new(files), &receiver, &on_change))?;
        Ok(Watcher { lists })
    }

    /// Replaces the list of files. Changes since they were read are reported.
    pub fn set_files(&self, files: Vec<FileRead>) {
        // The receiver is gone if `on_change` panicked.
        let _ = self.lists.send(files);
    }
}

/// Main loop of the thread; ends when the watcher is dropped.
fn watch(mut state: State, lists: &Receiver<Vec<FileRead>>, on_change: &impl Fn()) {
    let start = Instant::now();
    let mut pause = IDLE_INTERVAL;
    loop {
        match lists.recv_timeout(pause) {
            Ok(files) => state = State::new(files),
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => return,
        }
        let before = start.elapsed();
        let stamps = state.files.iter().map(|read| Stamp::of(&read.file)).collect();
        let took = start.elapsed() - before;
        let result = state.update(before, stamps);
        if result == CheckResult::Changed {
            on_change();
        }
        let least = if result == CheckResult::Settling { SETTLING_INTERVAL } else { IDLE_INTERVAL };
        pause = least.max(took * MAX_LOAD_DIVISOR);
    }
}

/// Result of a poll.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum CheckResult {
    /// No file differs from what was read or last reported.
    Same,
    /// A file differs, and the settle time is not over.
    Settling,
    /// A file differs, and the settle time is over.
    Changed,
}

/// State of the polling, without access to files or clocks. Times are relative to the start of the thread.
struct State {
    /// Files as they were read or last reported.
    files: Vec<FileRead>,
    /// Differing stamps of the last poll, and the time since which they are the same.
    pending: Option<(Vec<Option<Stamp>>, Duration)>,
}

impl State {
    fn new(files: Vec<FileRead>) -> Self {
        State { files, pending: None }
    }

    /// Evaluates a poll at the time `now`, with one stamp per file.
    fn update(&mut self, now: Duration, stamps: Vec<Option<Stamp>>) -> CheckResult {
        let known = self.files.iter().map(|read| read.stamp);
        if known.eq(stamps.iter().copied()) {
            self.pending = None;
            return CheckResult::Same;
        }
        let since = match &self.pending {
            Some((pending, since)) if *pending == stamps => *since,
            _ => now,
        };
        let is_now_missing = |(read, stamp): (&FileRead, &Option<Stamp>)| match (read.stamp, stamp) {
            (Some(_), None) => true,
            (known, Some(stamp)) => stamp.is_empty() && !known.is_some_and(|known| known.is_empty()),
            (None, None) => false,
        };
        let is_missing = self.files.iter().zip(&stamps).any(is_now_missing);
        if now - since < if is_missing { SETTLE_TIME_MISSING } else { SETTLE_TIME } {
            self.pending = Some((stamps, since));
            return CheckResult::Settling;
        }
        self.files.iter_mut().zip(stamps).for_each(|(read, stamp)| read.stamp = stamp);
        self.pending = None;
        CheckResult::Changed
    }
}

#[cfg(test)]
mod tests;
