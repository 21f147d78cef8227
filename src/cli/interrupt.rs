//! Handling of SIGINT, SIGTERM and SIGHUP: the process ends within a second, without partially written files.

use std::sync::atomic::{AtomicBool, AtomicU8, Ordering};
use std::sync::mpsc::channel;
use std::time::Duration;

use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};

use super::message::Message;

static INTERRUPTED: AtomicBool = AtomicBool::new(false);
static SIGNAL: AtomicU8 = AtomicU8::new(SIGINT as u8);

/// Time for the work to react to the flag before the process exits.
const GRACE_PERIOD: Duration = Duration::from_millis(700);

/// Time for the last message. With the time above it is less than a second.
const LAST_MESSAGE: Duration = Duration::from_millis(200);

/// Installs the signal handlers. The returned flag is set by the first signal.
pub(crate) fn install() -> &'static AtomicBool {
    let mut stops = vec![SIGINT, SIGTERM];
    if !is_hangup_ignored() {
        stops.push(SIGHUP);
    }
    // Without handlers the default action of the signals ends the process.
    if let Ok(mut signals) = signal_hook::iterator::Signals::new(stops) {
        std::thread::spawn(move || {
            if let Some(signal) = signals.forever().next() {
                SIGNAL.store(signal as u8, Ordering::Relaxed);
                INTERRUPTED.store(true, Ordering::Relaxed);
                // Loading and tree building do not check the flag.
                std::thread::sleep(GRACE_PERIOD);
                crate::film::output::discard_unfinished();
                report();
                std::process::exit(i32::from(exit_code()));
            }
        });
    }
    &INTERRUPTED
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

/// Whether SIGHUP is ignored, as by `nohup`, according to the signal mask in `/proc`; `false` without `/proc`.
fn is_hangup_ignored() -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let mask = mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok());
    mask.is_some_and(|mask| mask >> (SIGHUP - 1) & 1 == 1)
}

/// 128 + number of the received signal.
pub(crate) fn exit_code() -> u8 {
    128 + SIGNAL.load(Ordering::Relaxed)
}
