//! Detection of changed scene files by polling.
//!
//! A thread reads size, time and identity of each file a few times a second (about a microsecond per file) and reports
//! a change once all files are unchanged for a while. Notifications of the system are not used: they do not cover
//! network shares, and they follow the old file if an editor replaces it by renaming another.
//! [`crate::import::load_and_list`] lists the files of a scene.

use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::time::{Duration, Instant};

use crate::import::{FileRead, Stamp};

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
mod tests {
    use std::path::Path;

    use super::CheckResult::{Changed, Same, Settling};
    use super::*;

    /// Stamps of real files: `size` bytes, one of each number.
    fn stamp(folder: &tempfile::TempDir, number: u32, size: usize) -> Option<Stamp> {
        let file = folder.path().join(format!("{number}-{size}"));
        if !file.exists() {
            std::fs::write(&file, vec![b'x'; size]).expect("the temporary folder can be written to");
        }
        Stamp::of(&file)
    }

    fn read(name: &str, stamp: Option<Stamp>) -> FileRead {
        FileRead { file: name.into(), stamp }
    }

    fn ms(n: u64) -> Duration {
        Duration::from_millis(n)
    }

    /// Polls a single file with the given times and stamps, and compares the results.
    fn expect(known: Option<Stamp>, polls: &[(u64, Option<Stamp>, CheckResult)]) {
        let mut state = State::new(vec![read("a", known)]);
        for &(at, stamp, expected) in polls {
            assert_eq!(state.update(ms(at), vec![stamp]), expected, "at {at} ms");
        }
    }

    #[test]
    fn a_change_is_said_once_and_when_it_has_held_still() {
        let folder = tempfile::tempdir().expect("a folder");
        let [one, two, three] = [1, 2, 3].map(|number| stamp(&folder, number, 5));
        expect(one, &[(0, one, Same), (200, one, Same)]);
        expect(one, &[(0, two, Settling), (149, two, Settling), (150, two, Changed), (350, two, Same)]);
        // While the file is being written, nothing is reported.
        let writing = (0..100).map(|i| (100 * i, stamp(&folder, 9, 1 + i as usize), Settling));
        let mut polls: Vec<_> = writing.collect();
        polls.extend([(10_000, three, Settling), (10_149, three, Settling), (10_150, three, Changed)]);
        expect(one, &polls);
        // A file that returns to its state before the settle time is not reported.
        expect(one, &[(0, two, Settling), (100, one, Same), (300, two, Settling), (449, two, Settling)]);
        // Two changes are reported separately.
        expect(
            one,
            &[(0, two, Settling), (200, two, Changed), (400, three, Settling), (600, three, Changed)],
        );
    }

    #[test]
    fn a_file_that_is_gone_or_empty_is_waited_for() {
        let folder = tempfile::tempdir().expect("a folder");
        let [one, two] = [1, 2].map(|number| stamp(&folder, number, 5));
        let empty = stamp(&folder, 3, 0);
        // An editor that replaces the file.
        expect(one, &[(0, None, Settling), (200, None, Settling), (240, two, Settling), (390, two, Changed)]);
        // An editor that truncates it first.
        expect(
            one,
            &[(0, empty, Settling), (900, empty, Settling), (950, two, Settling), (1100, two, Changed)],
        );
        // A file that is deleted.
        expect(one, &[(0, None, Settling), (999, None, Settling), (1000, None, Changed), (2000, None, Same)]);
        // A missing file that is created, and an empty file that stays empty.
        expect(None, &[(0, None, Same), (200, two, Settling), (350, two, Changed)]);
        let also_empty = stamp(&folder, 4, 0);
        expect(empty, &[(0, also_empty, Settling), (150, also_empty, Changed)]);
    }

    #[test]
    fn several_files_are_waited_for_together() {
        let folder = tempfile::tempdir().expect("a folder");
        let [one, two, three] = [1, 2, 3].map(|number| stamp(&folder, number, 5));
        let mut state = State::new(vec![read("a", one), read("b", one)]);
        assert_eq!(state.update(ms(0), vec![two, one]), Settling);
        assert_eq!(state.update(ms(100), vec![two, three]), Settling);
        assert_eq!(state.update(ms(249), vec![two, three]), Settling);
        assert_eq!(state.update(ms(250), vec![two, three]), Changed);
        assert_eq!(state.update(ms(260), vec![two, three]), Same);
        assert_eq!(State::new(Vec::new()).update(ms(0), Vec::new()), Same);
    }

    /// With files on disk and the real thread; waits for reports only, not for fixed times.
    #[test]
    fn files_on_disk_are_watched() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = |name: &str| folder.path().join(name);
        let as_read = |file: &Path| FileRead { file: file.to_owned(), stamp: Stamp::of(file) };
        let write = |name: &str, text: &str| std::fs::write(path(name), text).expect("it can be written");
        let (sender, reports) = channel();
        let long = Duration::from_secs(60);

        write("a", "as it was read");
        let files = vec![as_read(&path("a"))];
        // Changed between reading and watching.
        write("a", "written to meanwhile");
        let watcher =
            Watcher::new(files, move || sender.send(()).expect("the test listens")).expect("a thread");
        reports.recv_timeout(long).expect("a change before watching is a change");

        // Replaced by renaming, as many editors write.
        write("a~", "of another place on disk");
        std::fs::rename(path("a~"), path("a")).expect("files can be renamed");
        reports.recv_timeout(long).expect("another file under its name is a change");

        // A missing file that is created.
        watcher.set_files(vec![as_read(&path("a")), as_read(&path("b"))]);
        write("b", "at last");
        reports.recv_timeout(long).expect("a file that comes is a change");

        // Dropping it ends the thread, and with it the sender.
        drop(watcher);
        assert_eq!(reports.recv_timeout(long), Err(RecvTimeoutError::Disconnected));
    }
}
