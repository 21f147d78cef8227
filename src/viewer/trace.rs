//! Event trace of the window as JSON lines, for scripts, and measurement of frame times.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;
use std::time::{Duration, Instant};

use serde_json::{Value, json};

use crate::error::{Error, Result};

/// Interval of the frames that are requested during a measurement.
const HEARTBEAT: Duration = Duration::from_millis(8);

/// Number of frames until the first one is presented. They are excluded from the pauses.
const OPENING: usize = 2;

/// Shortest pause that is written to the trace.
const LONG: Duration = Duration::from_millis(20);

/// Event trace.
pub(crate) struct Trace {
    file: Option<BufWriter<File>>,
    rectangles: Vec<(String, [i64; 4])>,
}

impl Trace {
    /// Opens the trace; without a file, events are discarded.
    ///
    /// # Errors
    /// [`Error::Output`] if the file cannot be written.
    pub(crate) fn new(file: Option<&Path>) -> Result<Self> {
        let open = |file| File::create(file).map(BufWriter::new).map_err(|e| Error::output(file, e));
        Ok(Trace { file: file.map(open).transpose()?, rectangles: Vec::new() })
    }

    /// Whether events are written.
    pub(crate) fn is_on(&self) -> bool {
        self.file.is_some()
    }

    /// Writes an event with the fields of `what` and the time `t`, the system's monotonic clock in seconds.
    pub(crate) fn event(&mut self, name: &str, what: Value) {
        let Some(file) = &mut self.file else { return };
        let mut line = json!({ "t": now(), "event": name });
        if let (Some(line), Value::Object(what)) = (line.as_object_mut(), what) {
            line.extend(what);
        }
        // Flushed because scripts read the file while the window is open. A full disk must not close the window.
        let _ = writeln!(file, "{line}").and_then(|()| file.flush());
    }

    /// Writes the rectangle of a control in physical pixels, if it has changed.
    pub(crate) fn place(&mut self, name: &str, rect: egui::Rect, pixels_per_point: f32) {
        if self.file.is_none() {
            return;
        }
        let [x, y] = [rect.min.x, rect.min.y].map(|v| (v * pixels_per_point).round() as i64);
        let [w, h] = [rect.width(), rect.height()].map(|v| (v * pixels_per_point).round() as i64);
        let place = [x, y, w, h];
        match self.rectangles.iter_mut().find(|(known, _)| known == name) {
            Some((_, known)) if *known == place => return,
            Some((_, known)) => *known = place,
            None => self.rectangles.push((name.to_owned(), place)),
        }
        self.event("place", json!({ "name": name, "rect": place }));
    }
}

/// The system's monotonic clock in seconds, which all processes share on Unix.
fn now() -> f64 {
    #[cfg(unix)]
    {
        let time = rustix::time::clock_gettime(rustix::time::ClockId::Monotonic);
        time.tv_sec as f64 + time.tv_nsec as f64 * 1e-9
    }
    #[cfg(not(unix))]
    {
        static START: std::sync::OnceLock<Instant> = std::sync::OnceLock::new();
        START.get_or_init(Instant::now).elapsed().as_secs_f64()
    }
}

/// Measures the times between frames of the interface.
pub(crate) struct Pauses {
    since: Instant,
    wanted: Duration,
    last: Instant,
    all: Vec<Duration>,
}

impl Pauses {
    /// Starts a measurement of the given duration.
    pub(crate) fn new(wanted: Duration) -> Self {
        Pauses { since: Instant::now(), wanted, last: Instant::now(), all: Vec::new() }
    }

    /// Records the start of a frame. Returns the report at the end of the measurement.
    pub(crate) fn frame(&mut self, context: &egui::Context, trace: &mut Trace) -> Option<String> {
        let now = Instant::now();
        let pause = now - self.last;
        self.last = now;
        self.all.push(pause);
        if pause > LONG && self.all.len() > OPENING {
            trace.event("pause", json!({ "ms": pause.as_secs_f64() * 1e3 }));
        }
        context.request_repaint_after(HEARTBEAT);
        (now - self.since >= self.wanted).then(|| self.report())
    }

    fn report(&mut self) -> String {
        let opening: Duration = self.all.iter().take(OPENING).sum();
        let rest = self.all.iter().skip(OPENING);
        let mut all: Vec<f64> = rest.map(|pause| pause.as_secs_f64() * 1e3).collect();
        all.sort_by(f64::total_cmp);
        let at = |share: f64| all.get((share * all.len() as f64) as usize).copied().unwrap_or(0.0);
        format!(
            "longest pause {:.1} ms, 99 of 100 up to {:.1} ms, median {:.1} ms; {} frames in {:.0} s, the first after {:.0} ms\n",
            all.last().copied().unwrap_or(0.0),
            at(0.99),
            at(0.5),
            all.len(),
            self.since.elapsed().as_secs_f64(),
            opening.as_secs_f64() * 1e3
        )
    }
}
