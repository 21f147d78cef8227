//! Progress: a bar on a terminal, plain or JSON lines elsewhere, on standard error.

use std::io::IsTerminal;
use std::sync::{Mutex, OnceLock};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};

use super::say;
use crate::error::Error;

/// How progress is shown.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub enum Mode {
    /// A bar on a terminal, plain lines elsewhere
    Auto,
    /// A bar
    Bar,
    /// At most a line a second
    Plain,
    /// At most a line a second, each a JSON object
    Json,
    /// Lines that workers of Open Job Description read: openjd_progress, openjd_status, openjd_fail
    Openjd,
    /// Nothing
    None,
}

/// Lines come no closer than this.
const INTERVAL: Duration = Duration::from_secs(1);

/// Shows how far the work is.
pub struct Progress {
    mode: Mode,
    bar: Option<ProgressBar>,
    /// When the first tile was done.
    first_tile: OnceLock<Instant>,
    /// When the last line was printed, and what it said was done.
    last: Mutex<(Instant, usize)>,
}

impl Progress {
    /// Starts with nothing to show.
    pub fn new(mode: Mode) -> Self {
        let mode = match mode {
            Mode::Auto if std::io::stderr().is_terminal() => Mode::Bar,
            Mode::Auto => Mode::Plain,
            other => other,
        };
        let bar = (mode == Mode::Bar).then(|| {
            let bar = ProgressBar::new_spinner();
            bar.enable_steady_tick(Duration::from_millis(100));
            bar
        });
        let now = Instant::now();
        Progress { mode, bar, first_tile: OnceLock::new(), last: Mutex::new((now, 0)) }
    }

    /// What is being done, where that cannot be measured.
    pub fn phase(&self, what: &str) {
        if let Some(bar) = &self.bar {
            bar.set_message(what.to_owned());
        }
    }

    /// Tiles done of all tiles.
    pub fn tiles(&self, done: usize, total: usize) {
        self.steps(done, total, ("tiles", 1));
    }

    /// Steps done of all steps; what they are called where they are counted in lines, and how many go into one of that.
    pub fn steps(&self, done: usize, total: usize, (unit, steps): (&str, usize)) {
        if let Some(bar) = &self.bar {
            if bar.length() != Some(total as u64) {
                bar.set_length(total as u64);
                let template = "{msg} {wide_bar} {percent:>3} %  {elapsed} of {duration}";
                bar.reset();
                if let Ok(style) = ProgressStyle::with_template(template) {
                    bar.set_style(style);
                }
            }
            bar.set_position(done as u64);
            return;
        }
        if !matches!(self.mode, Mode::Plain | Mode::Json | Mode::Openjd) {
            return;
        }
        self.first_tile.get_or_init(Instant::now);
        let Ok(mut last) = self.last.try_lock() else { return };
        if last.0.elapsed() < INTERVAL || done <= last.1 {
            return;
        }
        *last = (Instant::now(), done);
        // The clock of the tiles starts with the first of them: loading says nothing about rendering.
        let elapsed = self.first_tile.get_or_init(Instant::now).elapsed().as_secs_f64();
        let left = elapsed * (total - done) as f64 / done as f64;
        let percent = done * 100 / total;
        let (done, total) = (done / steps, total / steps);
        match self.mode {
            Mode::Json => say(format_args!(
                "{{\"event\":\"progress\",\"done\":{done},\"total\":{total},\"unit\":\"{unit}\",\"elapsed\":{elapsed:.1},\"eta\":{left:.1}}}"
            )),
            // Open Job Description, How Jobs Are Run, Stdout/Stderr Messages.
            Mode::Openjd => say(format_args!("openjd_progress: {percent}")),
            _ => say(format_args!("kiln: {percent} % ({done} of {total} {unit}), {left:.0} s left")),
        }
    }

    /// What failed, for who reads lines instead of exit codes.
    pub fn fail(mode: Mode, e: &Error) {
        if mode == Mode::Openjd && *e != Error::Interrupted {
            say(format_args!("openjd_fail: {e}"));
        }
    }

    /// Lets `print` print lines, with the bar out of the way.
    pub fn pause(&self, print: impl FnOnce()) {
        match &self.bar {
            Some(bar) => bar.suspend(print),
            None => print(),
        }
    }

    /// Takes the bar away for good, so that other lines can be printed.
    pub fn clear(&self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }

    /// A closing line.
    pub fn finish(&self, line: &str) {
        self.clear();
        match self.mode {
            Mode::None => {}
            Mode::Json => say(format_args!("{}", serde_json::json!({ "event": "done", "message": line }))),
            Mode::Openjd => say(format_args!("openjd_progress: 100\nopenjd_status: {line}")),
            _ => say(format_args!("kiln: {line}")),
        }
    }
}
