//! Ctrl-C, SIGTERM and a terminal that is gone: the work stops within a second and leaves nothing half-written.

use std::sync::atomic::{AtomicBool, AtomicU8, Ordering};
use std::time::Duration;

use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};

static INTERRUPTED: AtomicBool = AtomicBool::new(false);
static SIGNAL: AtomicU8 = AtomicU8::new(SIGINT as u8);

/// How long the work has to notice before the process ends without it.
const PATIENCE: Duration = Duration::from_millis(700);

/// Starts listening. The flag returned is set once a signal has come.
pub fn install() -> &'static AtomicBool {
    let mut stops = vec![SIGINT, SIGTERM];
    if !is_hangup_ignored() {
        stops.push(SIGHUP);
    }
    // Without a listener the system's own handling stands, which also ends the process.
    if let Ok(mut signals) = signal_hook::iterator::Signals::new(stops) {
        std::thread::spawn(move || {
            if let Some(signal) = signals.forever().next() {
                SIGNAL.store(signal as u8, Ordering::Relaxed);
                INTERRUPTED.store(true, Ordering::Relaxed);
                // Loading and building do not look at the flag.
                std::thread::sleep(PATIENCE);
                crate::film::output::discard_unfinished();
                std::process::exit(i32::from(exit_code()));
            }
        });
    }
    &INTERRUPTED
}

/// Whether this was started to outlive its terminal, as by `nohup`. Known where the system tells, in a mask of signals.
fn is_hangup_ignored() -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let mask = mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok());
    mask.is_some_and(|mask| mask >> (SIGHUP - 1) & 1 == 1)
}

/// The exit code of a process ended by the signal that came.
pub fn exit_code() -> u8 {
    128 + SIGNAL.load(Ordering::Relaxed)
}
