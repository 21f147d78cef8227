//! Handling of interrupts (SIGINT, SIGTERM and, on Unix, SIGHUP): the process ends within a second, without partially
//! written files.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU8, AtomicUsize, Ordering};
use std::sync::mpsc::channel;
use std::time::Duration;

use signal_hook::consts::{SIGINT, SIGTERM};

use super::message::Message;

static INTERRUPTED: AtomicBool = AtomicBool::new(false);
static SIGNAL: AtomicU8 = AtomicU8::new(SIGINT as u8);

/// Interval at which received signals are looked for. Windows has no way to wait for one.
const POLL_INTERVAL: Duration = Duration::from_millis(20);

/// Time for the work to react to the flag before the process exits.
const GRACE_PERIOD: Duration = Duration::from_millis(700);

/// Time for the last message. With the times above it is less than a second.
const LAST_MESSAGE: Duration = Duration::from_millis(200);

/// Installs the signal handlers. The returned flag is set by the first signal.
pub(crate) fn install() -> &'static AtomicBool {
    let received = Arc::new(AtomicUsize::new(0));
    // Without handlers the default action of the signals ends the process.
    let handled =
        |signal: i32| signal_hook::flag::register_usize(signal, Arc::clone(&received), signal as usize);
    if terminating_signals().into_iter().all(|signal| handled(signal).is_ok()) {
        std::thread::spawn(move || wait_and_exit(&received));
    }
    &INTERRUPTED
}

#[cfg(unix)]
fn terminating_signals() -> Vec<i32> {
    use signal_hook::consts::SIGHUP;
    let hangup = (!is_ignored(SIGHUP)).then_some(SIGHUP);
    [SIGINT, SIGTERM].into_iter().chain(hangup).collect()
}

#[cfg(not(unix))]
fn terminating_signals() -> Vec<i32> {
    vec![SIGINT, SIGTERM]
}

/// Waits for a signal, gives the work time to end, and exits.
fn wait_and_exit(received: &AtomicUsize) {
    while received.load(Ordering::Relaxed) == 0 {
        std::thread::sleep(POLL_INTERVAL);
    }
    SIGNAL.store(received.load(Ordering::Relaxed) as u8, Ordering::Relaxed);
    INTERRUPTED.store(true, Ordering::Relaxed);
    // Loading and tree building do not check the flag.
    std::thread::sleep(GRACE_PERIOD);
    kiln::files::discard_unfinished();
    report();
    std::process::exit(i32::from(exit_code()));
}

/// Prints the message, unless standard error takes none: its reader may have stopped reading.
fn report() {
    let (printed, waiting) = channel();
    let print = move || {
        Message::Interrupted { exit_code: exit_code() }.print();
        let _ = printed.send(());
    };
    if std::thread::Builder::new().spawn(print).is_ok() {
        let _ = waiting.recv_timeout(LAST_MESSAGE);
    }
}

/// Whether a signal is ignored, as SIGHUP by `nohup`, according to the signal mask in `/proc`; `false` without `/proc`.
#[cfg(unix)]
fn is_ignored(signal: i32) -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let mask = mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok());
    mask.is_some_and(|mask| mask >> (signal - 1) & 1 == 1)
}

/// 128 + number of the received signal.
pub(crate) fn exit_code() -> u8 {
    128 + SIGNAL.load(Ordering::Relaxed)
}
