//! The window itself: what happens in a frame of it, in order.

mod act;
mod frame;
mod inspector;
mod news;

use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use egui::{CentralPanel, Context, Frame, Ui, ViewportCommand, vec2};
use serde_json::json;

use super::canvas::Canvas;
use super::controls::Controls;
use super::inspect::Inspection;
use super::keys::Held;
use super::loader::Loader;
use super::look::{Opened, Order};
use super::overlay::{self, Notice};
use super::painter::{Comparison, News, Painter, Prepared};
use super::trace::{Pauses, Trace};
use super::watch::Watcher;
use super::{Start, display, name_of};
use crate::error::{Error, Result};
use crate::scene::animation::Timeline;
use frame::PANEL;

/// Height of what is below the picture, in points, for the window's first size.
const BELOW: f32 = 30.0;

/// How many frames the window has to take its first size.
const FITTINGS: u32 = 6;

/// How long a frame waits for a picture that was ordered in it. With the time that painting the window takes, on a machine without
/// graphics hardware about as much, this is a frame at 30 a second and more.
const AT_ONCE: Duration = Duration::from_millis(12);

/// Opens the window, and returns when it is closed.
///
/// # Errors
/// [`crate::error::Error::Failed`] where there is no display or no OpenGL.
pub fn run(start: Start) -> Result<()> {
    let trace = Trace::new(start.trace.as_deref())?;
    let title = start.inputs.first().map_or("kiln".into(), |input| name_of(input));
    let mut viewport = egui::ViewportBuilder::default()
        .with_title(format!("{title} - kiln"))
        .with_app_id("kiln")
        .with_drag_and_drop(true);
    if let Some([width, height]) = start.size {
        viewport = viewport.with_inner_size([width as f32 + PANEL, height as f32 + BELOW]);
    }
    let options = eframe::NativeOptions {
        viewport,
        dithering: false,
        persist_window: start.remembers && start.size.is_none(),
        ..eframe::NativeOptions::default()
    };
    let report = Report::default();
    let printed = Arc::clone(&report);
    display::open(|is_open| {
        eframe::run_native(
            "kiln",
            options,
            Box::new(move |creation| {
                is_open.store(true, Ordering::Relaxed);
                Ok(Box::new(App::new(creation, start, trace, printed)))
            }),
        )
    })?;
    let Outcome { printed, error } =
        report.lock().map(|mut report| std::mem::take(&mut *report)).unwrap_or_default();
    if let Some(printed) = printed {
        print!("{printed}");
    }
    error.map_or(Ok(()), Err)
}

/// What is shown besides the picture. Remembered.
#[derive(Debug, Clone, Copy, serde::Serialize, serde::Deserialize)]
struct Parts {
    panel: bool,
    keys: bool,
}

struct App {
    threads: Arc<rayon::ThreadPool>,
    painter: Painter,
    loader: Loader,
    /// Looks whether the files change.
    watcher: Option<Watcher>,
    /// Whether they have.
    changed: Arc<AtomicBool>,
    /// Files that were saved, or what went wrong.
    saved: (Sender<Saved>, Receiver<Saved>),
    /// Files that are being saved.
    saving: Vec<PathBuf>,
    inputs: Vec<PathBuf>,
    opened: Option<Arc<Opened>>,
    controls: Option<Controls>,
    canvas: Canvas,
    /// Keys that are held down.
    held: Held,
    /// The order that was given last, and its number.
    ordered: Option<(Order, u64)>,
    /// One that could not be carried out, which the notice is about.
    failed_order: Option<u64>,
    /// Orders of pictures that came since the last frame.
    unseen: Vec<u64>,
    comparison: Option<Comparison>,
    /// What is in a pixel, and what it was looked at in.
    inspection: Option<(Arc<Prepared>, Inspection)>,
    notice: Option<Notice>,
    /// What there is to say of the files.
    warnings: Vec<String>,
    is_building: bool,
    shows: Parts,
    /// The size that the picture is to have at first, until the window has it.
    first_size: FirstSize,
    /// How often that was tried.
    fittings: u32,
    trace: Trace,
    pauses: Option<Pauses>,
    report: Report,
}

/// A file that was saved, or what went wrong.
type Saved = (PathBuf, Result<()>);

/// Which size the picture has at first.
enum FirstSize {
    /// The user's.
    Given([u32; 2]),
    /// The scene's.
    Scenes,
    /// That of the window, which is remembered or was changed.
    Windows,
}

/// What is said when the window is closed.
#[derive(Default)]
struct Outcome {
    /// What is printed.
    printed: Option<String>,
    /// Why it was closed, where that was not the user's wish.
    error: Option<Error>,
}

type Report = Arc<Mutex<Outcome>>;

impl App {
    fn new(creation: &eframe::CreationContext, start: Start, trace: Trace, report: Report) -> Self {
        let threads = Arc::new(start.threads);
        let wake = |context: &Context| {
            let context = context.clone();
            move || context.request_repaint()
        };
        let painter = Painter::new(Arc::clone(&threads), wake(&creation.egui_ctx));
        let mut loader = Loader::new(start.open, Arc::clone(&threads), wake(&creation.egui_ctx));
        loader.load(start.inputs.clone());
        let remembered: Option<Parts> =
            creation.storage.and_then(|storage| eframe::get_value(storage, eframe::APP_KEY));
        let first_size = match (start.size, remembered.is_some() && start.remembers) {
            (Some(size), _) => FirstSize::Given(size),
            (None, false) => FirstSize::Scenes,
            (None, true) => FirstSize::Windows,
        };
        let mut app = App {
            threads,
            painter,
            loader,
            watcher: None,
            changed: Arc::default(),
            saved: channel(),
            saving: Vec::new(),
            inputs: start.inputs,
            opened: None,
            controls: None,
            canvas: Canvas::default(),
            held: Held::default(),
            ordered: None,
            failed_order: None,
            unseen: Vec::new(),
            comparison: None,
            inspection: None,
            notice: None,
            warnings: Vec::new(),
            is_building: false,
            shows: remembered.unwrap_or(Parts { panel: true, keys: false }),
            first_size,
            fittings: 0,
            trace,
            pauses: start.pauses.map(Pauses::new),
            report,
        };
        app.trace.say("started", json!({}));
        app
    }

    /// Makes the window so large that the picture has its first size. That takes a few frames: panels find their sizes, and not every
    /// window may be as large. Whether it is still to change.
    fn fit_window(&mut self, context: &Context, size: [u32; 2]) -> bool {
        let wanted = match (&self.first_size, &self.opened) {
            (FirstSize::Given(size), _) => *size,
            (FirstSize::Scenes, Some(opened)) => opened.size,
            _ => return false,
        };
        self.fittings += 1;
        if wanted == size || self.fittings > FITTINGS {
            self.first_size = FirstSize::Windows;
            return false;
        }
        let scale = context.pixels_per_point();
        let more = |axis: usize| (wanted[axis] as f32 - size[axis] as f32) / scale;
        let window = context.viewport_rect().size() + vec2(more(0), more(1));
        context.send_viewport_cmd(ViewportCommand::InnerSize(window));
        context.request_repaint();
        true
    }

    /// Asks for the picture that the controls now mean, where that is another.
    fn order(&mut self, context: &Context, size: [u32; 2]) {
        let (Some(controls), Some(opened)) = (&self.controls, &self.opened) else { return };
        let order = controls.order(opened, size);
        if self.ordered.as_ref().is_some_and(|(last, _)| *last == order) {
            return;
        }
        let number = self.painter.order(order.clone());
        self.trace.say("order", json!({ "order": number, "size": size, "time": order.time }));
        if order.sides.len() < 2 {
            self.canvas.forget(1);
        }
        self.comparison = None;
        self.ordered = Some((order, number));
        self.wait_for_the_first(context, number);
    }

    /// Waits a moment for the first picture of an order, so that this frame shows it already: what is drawn of a picture is looked
    /// up when the frame ends.
    fn wait_for_the_first(&mut self, context: &Context, number: u64) {
        let until = Instant::now() + AT_ONCE;
        while let Some(news) = self.painter.wait(until) {
            let is_it = match &news {
                News::Painted(painted) => painted.order == number,
                News::Building | News::Failed(..) => true,
                News::Compared(..) => false,
            };
            self.take_news(context, news);
            if is_it {
                return;
            }
        }
    }
}

/// The frames of the scene's animation, where it has one.
fn timeline(opened: &Opened) -> Option<Timeline> {
    let animation = opened.scene.animation.as_ref()?;
    Timeline::new(animation.fps, animation.duration, animation.repeat).ok()
}

impl eframe::App for App {
    fn ui(&mut self, ui: &mut Ui, _frame: &mut eframe::Frame) {
        let context = ui.ctx().clone();
        for order in self.unseen.drain(..) {
            self.trace.say("shown", json!({ "order": order }));
        }
        self.measure(&context);
        self.take_all(&context);
        self.keys(&context);
        let dropped = context.input(|input| input.raw.dropped_files.clone());
        if !dropped.is_empty() {
            self.loader.load(dropped.into_iter().map(|file| file.path().to_owned()).collect());
        }
        self.play(&context);
        self.panels(ui);
        CentralPanel::default().frame(Frame::NONE).show(ui, |ui| self.picture(ui));
        let mut open = self.shows.keys;
        overlay::keys(&context, &mut open);
        self.shows.keys = open;
    }

    fn save(&mut self, storage: &mut dyn eframe::Storage) {
        eframe::set_value(storage, eframe::APP_KEY, &self.shows);
    }
}
