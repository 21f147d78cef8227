//! Progress on standard error: a bar, or messages.

use std::io::IsTerminal;
use std::sync::{Mutex, OnceLock};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};

use super::message::Message;

/// How progress is shown.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum Mode {
    /// A bar on a terminal, plain lines elsewhere
    Auto,
    /// A bar
    Bar,
    /// At most a line a second
    Plain,
    /// A JSON object a line, also for warnings and errors
    Json,
    /// The messages of Open Job Description, also for errors: openjd_progress, openjd_status, openjd_fail
    Openjd,
    /// Nothing
    None,
}

/// Minimum interval between lines.
const INTERVAL: Duration = Duration::from_secs(1);

/// Progress display.
pub(crate) struct Progress {
    mode: Mode,
    bar: Option<ProgressBar>,
    /// Time of the first completed tile.
    first_tile: OnceLock<Instant>,
    /// Time of the last line, and its number of completed steps.
    last: Mutex<(Instant, usize)>,
    /// What is rendered as one of several pictures.
    part: Option<Part>,
}

/// A picture of several.
struct Part {
    /// Text before the names of phases.
    label: String,
    /// Its place, and the number of pictures.
    place: usize,
    count: usize,
}

/// Steps of progress of a picture of several.
const STEPS: usize = 1000;

impl Progress {
    /// Creates a progress display without a phase.
    pub(crate) fn new(mode: Mode) -> Self {
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
        Progress { mode, bar, first_tile: OnceLock::new(), last: Mutex::new((now, 0)), part: None }
    }

    /// Shows the name of a phase without measurable progress.
    pub(crate) fn phase(&self, what: &str) {
        if let Some(bar) = &self.bar {
            let label = self.part.as_ref().map_or("", |part| &part.label);
            bar.set_message(format!("{label}{what}"));
        }
    }

    /// Begins a picture of several, which share one display.
    pub(crate) fn begin_part(&mut self, label: String, place: usize, count: usize) {
        self.part = Some(Part { label, place, count });
        self.tiles(0, 1);
    }

    /// Ends the last picture of several.
    pub(crate) fn end_parts(&mut self) {
        self.part = None;
        self.clear();
    }

    /// Shows the number of completed tiles.
    pub(crate) fn tiles(&self, done: usize, total: usize) {
        match &self.part {
            None => self.steps(done, total, ("tiles", 1)),
            Some(Part { place, count, .. }) => {
                self.steps(STEPS * place + STEPS * done / total, STEPS * count, ("pictures", STEPS));
            }
        }
    }

    /// Shows the number of completed steps. Lines count in `unit`, each of `steps` steps.
    pub(crate) fn steps(&self, done: usize, total: usize, (unit, steps): (&str, usize)) {
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
        // The estimate starts at the first tile, so that it excludes loading.
        let elapsed = self.first_tile.get_or_init(Instant::now).elapsed().as_secs_f64();
        let eta = elapsed * (total - done) as f64 / done as f64;
        let percent = done * 100 / total;
        let (done, total) = (done / steps, total / steps);
        Message::Progress { done, total, unit, percent, elapsed, eta }.print();
    }

    /// Calls `print` while the bar is hidden.
    pub(crate) fn pause(&self, print: impl FnOnce()) {
        match &self.bar {
            Some(bar) => bar.suspend(print),
            None => print(),
        }
    }

    /// Removes the bar, so that other lines can be printed; not between pictures of several.
    pub(crate) fn clear(&self) {
        if let (Some(bar), None) = (&self.bar, &self.part) {
            bar.finish_and_clear();
        }
    }

    /// Removes the bar and prints a final line.
    pub(crate) fn finish(&self, line: &str) {
        self.clear();
        match &self.part {
            Some(_) => Message::Picture(line).print(),
            None if self.mode != Mode::None => Message::Done(line).print(),
            None => {}
        }
    }
}
