//! Knowing when the files of a scene have changed.
//!
//! A thread asks the system for size, time and identity of each file a few times a second, and says so once all of them have held
//! still. Asking is cheap, a microsecond a file. Being told by the system is not what it seems: it does not speak of network shares,
//! and a file that an editor replaces by renaming another is no longer the one that was watched.
//!
//! The loader's reading of a scene says which files there are ([`crate::import::load_and_list`]); this knows nothing of
//! scenes, nor what is done about a change.

use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::time::{Duration, Instant};

use crate::import::{FileRead, Stamp};

/// From one look to the next while nothing happens.
const IDLE_INTERVAL: Duration = Duration::from_millis(200);
/// From one look to the next once something has.
const SETTLING_INTERVAL: Duration = Duration::from_millis(40);
/// How long files must have held still. Programs write without such pauses.
const SETTLE_TIME: Duration = Duration::from_millis(150);
/// How long where a file is gone that was there, or empty: it is about to be written, by a program that takes its time.
const SETTLE_TIME_MISSING: Duration = Duration::from_millis(1000);
/// Looking takes at most this share of the time, however many files there are and however slow their disk is.
const MAX_LOAD_DIVISOR: u32 = 50;

/// Watches files, until it is dropped.
pub struct Watcher {
    requests: Sender<Vec<FileRead>>,
}

impl Watcher {
    /// Watches `files`, and calls `on_change` from a thread of its own when one of them is no longer what was read, and all hold
    /// still: once for each change.
    ///
    /// # Errors
    /// The system has no thread to give.
    pub fn new(files: Vec<FileRead>, on_change: impl Fn() + Send + 'static) -> std::io::Result<Self> {
        let (requests, to_do) = channel();
        let thread = std::thread::Builder::new().name("watch".into());
        thread.spawn(move || watch(State::new(files), &to_do, &on_change))?;
        Ok(Watcher { requests })
    }

    /// Watches these files from now on, the list of the last reading. What changed since they were read is a change.
    pub fn set_files(&self, files: Vec<FileRead>) {
        // Nobody listens where `on_change` panicked.
        let _ = self.requests.send(files);
    }
}

/// Looks until nobody gives orders any more.
fn watch(mut state: State, requests: &Receiver<Vec<FileRead>>, on_change: &impl Fn()) {
    let start = Instant::now();
    let mut pause = IDLE_INTERVAL;
    loop {
        match requests.recv_timeout(pause) {
            Ok(files) => state = State::new(files),
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => return,
        }
        let before = start.elapsed();
        let stamps = state.files.iter().map(|read| Stamp::of(&read.file)).collect();
        let took = start.elapsed() - before;
        let said = state.update(before, stamps);
        if said == CheckResult::Changed {
            on_change();
        }
        let least = if said == CheckResult::Settling { SETTLING_INTERVAL } else { IDLE_INTERVAL };
        pause = least.max(took * MAX_LOAD_DIVISOR);
    }
}

/// What a look has shown.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum CheckResult {
    /// Everything is as it was read, or as was said before.
    Same,
    /// Something is different, and may become more so.
    Settling,
    /// Something is different, and stays so.
    Changed,
}

/// What is known of the files, and since when. Times are those since the start; nothing here waits or reads.
struct State {
    /// As they were read, or as they were when a change was last said.
    files: Vec<FileRead>,
    /// As they were last seen, and since when.
    seen: Option<(Vec<Option<Stamp>>, Duration)>,
}

impl State {
    fn new(files: Vec<FileRead>) -> Self {
        State { files, seen: None }
    }

    /// Takes in how the files are at the time `now`, one stamp for each.
    fn update(&mut self, now: Duration, stamps: Vec<Option<Stamp>>) -> CheckResult {
        let known = self.files.iter().map(|read| read.stamp);
        if known.eq(stamps.iter().copied()) {
            self.seen = None;
            return CheckResult::Same;
        }
        let since = match &self.seen {
            Some((seen, since)) if *seen == stamps => *since,
            _ => now,
        };
        let is_now_missing = |(read, stamp): (&FileRead, &Option<Stamp>)| match (read.stamp, stamp) {
            (Some(_), None) => true,
            (known, Some(stamp)) => stamp.is_empty() && !known.is_some_and(|known| known.is_empty()),
            (None, None) => false,
        };
        let is_missing = self.files.iter().zip(&stamps).any(is_now_missing);
        if now - since < if is_missing { SETTLE_TIME_MISSING } else { SETTLE_TIME } {
            self.seen = Some((stamps, since));
            return CheckResult::Settling;
        }
        self.files.iter_mut().zip(stamps).for_each(|(read, stamp)| read.stamp = stamp);
        self.seen = None;
        CheckResult::Changed
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::CheckResult::{Changed, Settling, Same};
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

    /// Looks at a single file at the times and in the states given, and holds what is said to what is expected.
    fn expect(known: Option<Stamp>, looks: &[(u64, Option<Stamp>, CheckResult)]) {
        let mut state = State::new(vec![read("a", known)]);
        for &(at, stamp, said) in looks {
            assert_eq!(state.update(ms(at), vec![stamp]), said, "at {at} ms");
        }
    }

    #[test]
    fn a_change_is_said_once_and_when_it_has_held_still() {
        let folder = tempfile::tempdir().expect("a folder");
        let [one, two, three] = [1, 2, 3].map(|number| stamp(&folder, number, 5));
        expect(one, &[(0, one, Same), (200, one, Same)]);
        expect(one, &[(0, two, Settling), (149, two, Settling), (150, two, Changed), (350, two, Same)]);
        // While it is being written, nothing is said, for however long.
        let writing = (0..100).map(|i| (100 * i, stamp(&folder, 9, 1 + i as usize), Settling));
        let mut looks: Vec<_> = writing.collect();
        looks.extend([(10_000, three, Settling), (10_149, three, Settling), (10_150, three, Changed)]);
        expect(one, &looks);
        // What comes back as it was, was never different.
        expect(one, &[(0, two, Settling), (100, one, Same), (300, two, Settling), (449, two, Settling)]);
        // Each change is one.
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
        // An editor that puts another in its place.
        expect(one, &[(0, None, Settling), (200, None, Settling), (240, two, Settling), (390, two, Changed)]);
        // One that empties it first.
        expect(
            one,
            &[(0, empty, Settling), (900, empty, Settling), (950, two, Settling), (1100, two, Changed)],
        );
        // One that is deleted and stays so.
        expect(one, &[(0, None, Settling), (999, None, Settling), (1000, None, Changed), (2000, None, Same)]);
        // One that was looked for and comes at last, and one that is empty as it was.
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

    /// A real disk and the real thread; it waits for what is said, and for nothing else.
    #[test]
    fn files_on_disk_are_watched() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = |name: &str| folder.path().join(name);
        let as_read = |file: &Path| FileRead { file: file.to_owned(), stamp: Stamp::of(file) };
        let write = |name: &str, text: &str| std::fs::write(path(name), text).expect("it can be written");
        let (heard, said) = channel();
        let long = Duration::from_secs(60);

        write("a", "as it was read");
        let files = vec![as_read(&path("a"))];
        // Between reading and watching.
        write("a", "written to meanwhile");
        let watcher =
            Watcher::new(files, move || heard.send(()).expect("the test listens")).expect("a thread");
        said.recv_timeout(long).expect("a change before watching is a change");

        // Replaced by renaming, as many editors write.
        write("a~", "of another place on disk");
        std::fs::rename(path("a~"), path("a")).expect("files can be renamed");
        said.recv_timeout(long).expect("another file under its name is a change");

        // One that was missing.
        watcher.set_files(vec![as_read(&path("a")), as_read(&path("b"))]);
        write("b", "at last");
        said.recv_timeout(long).expect("a file that comes is a change");

        // Dropping it ends the thread, and with it the sender.
        drop(watcher);
        assert_eq!(said.recv_timeout(long), Err(RecvTimeoutError::Disconnected));
    }
}
