//! Tests of `watch`.

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
    expect(one, &[(0, two, Settling), (200, two, Changed), (400, three, Settling), (600, three, Changed)]);
}

#[test]
fn a_file_that_is_gone_or_empty_is_waited_for() {
    let folder = tempfile::tempdir().expect("a folder");
    let [one, two] = [1, 2].map(|number| stamp(&folder, number, 5));
    let empty = stamp(&folder, 3, 0);
    // An editor that replaces the file.
    expect(one, &[(0, None, Settling), (200, None, Settling), (240, two, Settling), (390, two, Changed)]);
    // An editor that truncates it first.
    expect(one, &[(0, empty, Settling), (900, empty, Settling), (950, two, Settling), (1100, two, Changed)]);
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
    let watcher = Watcher::new(files, move || sender.send(()).expect("the test listens")).expect("a thread");
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
