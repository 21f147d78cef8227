//! What happens in the window, and when: a line of JSON each, for scripts that drive it; and its longest pause.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;
use std::time::{Duration, Instant};

use serde_json::{Value, json};

use crate::error::{Error, Result};

/// How often the interface is asked for a frame while its pauses are measured.
const HEARTBEAT: Duration = Duration::from_millis(8);

/// Frames from the start until the first of them is on the screen: until then there is no interface that could pause.
const OPENING: usize = 2;

/// A pause that is worth a line.
const LONG: Duration = Duration::from_millis(20);

/// Writes what happens.
pub struct Trace {
    file: Option<BufWriter<File>>,
    rectangles: Vec<(String, [i64; 4])>,
}

impl Trace {
    /// To a file, where one is named.
    ///
    /// # Errors
    /// [`Error::Output`] where it cannot be written.
    pub fn new(file: Option<&Path>) -> Result<Self> {
        let open = |file| File::create(file).map(BufWriter::new).map_err(|e| Error::output(file, e));
        Ok(Trace { file: file.map(open).transpose()?, rectangles: Vec::new() })
    }

    /// Whether anybody reads along.
    pub fn is_on(&self) -> bool {
        self.file.is_some()
    }

    /// Something happened now: `t` is the system's monotonic clock in seconds.
    pub fn event(&mut self, name: &str, what: Value) {
        let Some(file) = &mut self.file else { return };
        let mut line = json!({ "t": now(), "event": name });
        if let (Some(line), Value::Object(what)) = (line.as_object_mut(), what) {
            line.extend(what);
        }
        // Who drives the window reads along; a full disk is no reason to close it.
        let _ = writeln!(file, "{line}").and_then(|()| file.flush());
    }

    /// Something can be clicked on: where, in pixels of the window, when that has changed.
    pub fn place(&mut self, name: &str, rect: egui::Rect, pixels_per_point: f32) {
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

/// The system's monotonic clock in seconds: the same for every process.
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

/// Measures how long the interface makes one wait.
pub struct Pauses {
    since: Instant,
    wanted: Duration,
    last: Instant,
    all: Vec<Duration>,
}

impl Pauses {
    /// From now on, for so long.
    pub fn new(wanted: Duration) -> Self {
        Pauses { since: Instant::now(), wanted, last: Instant::now(), all: Vec::new() }
    }

    /// A frame begins. Returns what to print when it is enough.
    pub fn frame(&mut self, context: &egui::Context, trace: &mut Trace) -> Option<String> {
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
