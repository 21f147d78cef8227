//! Progress on standard error: a bar, or messages.

use std::io::IsTerminal;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, OnceLock};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};

use super::message::{Message, duration_text};

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
    /// Time of the first completed steps, and their number.
    first: OnceLock<(Instant, usize)>,
    /// Whether the time of frames was estimated.
    is_estimated: AtomicBool,
    /// Time of the last line, and its number of completed steps.
    last: Mutex<(Instant, usize)>,
    /// What is rendered as one of several pictures.
    part: Option<Part>,
}

/// Steps after the first from which the time that is left is estimated.
const LEAST_STEPS: usize = 16;

/// The least estimated time of frames, in seconds, that a note states.
const LONG: f64 = 60.0;

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
        Progress {
            mode,
            bar,
            first: OnceLock::new(),
            is_estimated: AtomicBool::new(false),
            last: Mutex::new((now, 0)),
            part: None,
        }
    }

    /// A bar on a terminal, nothing elsewhere.
    pub(crate) fn on_terminal() -> Self {
        Progress::new(if std::io::stderr().is_terminal() { Mode::Bar } else { Mode::None })
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
        let &(start, at_first) = self.first.get_or_init(|| (Instant::now(), done));
        self.note_long_films(done - at_first.min(done), total, start, unit);
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
        let Ok(mut last) = self.last.try_lock() else { return };
        if last.0.elapsed() < INTERVAL || done <= last.1 {
            return;
        }
        *last = (Instant::now(), done);
        // The estimate starts at the first step, so that it excludes loading, and takes some steps.
        let since = done.saturating_sub(at_first);
        let elapsed = start.elapsed().as_secs_f64();
        let eta = (since >= LEAST_STEPS).then(|| elapsed * (total - done) as f64 / since as f64);
        let percent = done * 100 / total;
        let (done, total) = (done / steps, total / steps);
        Message::Progress { done, total, unit, percent, elapsed, eta }.print();
    }

    /// Notes once how long frames take, if that is long.
    fn note_long_films(&self, since: usize, total: usize, start: Instant, unit: &str) {
        if unit != "frames" || since < LEAST_STEPS || start.elapsed() < INTERVAL || self.mode == Mode::None {
            return;
        }
        let seconds = start.elapsed().as_secs_f64() * total as f64 / since as f64;
        if !self.is_estimated.swap(true, Ordering::Relaxed) && seconds >= LONG {
            let text =
                format!("this takes about {}; smaller --size and --fps take less", duration_text(seconds));
            self.pause(|| Message::Note(&text).print());
        }
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
