//! The application: its state, and the steps of an interface frame.

mod act;
mod empty;
mod frame;
mod inspector;
mod messages;

use std::path::PathBuf;
use std::sync::atomic::AtomicBool;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use egui::{CentralPanel, Context, Frame, Ui, ViewportCommand, vec2};

use super::canvas::Canvas;
use super::controls::{Controls, UndoState};
use super::history::History;
use super::inspect::Inspection;
use super::keys::HeldKeys;
use super::loader::Loader;
use super::open_dialog::OpenDialog;
use super::outliner::{Outline, Outliner};
use super::overlay::{self, Notice};
use super::painter::{Message, Painter, Prepared};
use super::request::{Opened, RenderRequest};
use super::save::{SaveDialog, Saving};
use super::watch::Watcher;
use super::{Start, display, name_of, theme};
use frame::PANEL_WIDTH;
use kiln::error::{Error, Result};
use kiln::import::FileNames;
use kiln::scene::ImportOptions;
use kiln::scene::animation::Timeline;

/// Width and height of the first window in points, without a size of the picture.
const DEFAULT_SIZE: [f32; 2] = [1280.0, 800.0];

/// Height of the status bar in points, for the initial window size.
const FOOTER_HEIGHT: f32 = 30.0;

/// Maximum number of frames in which the window is resized to its initial size.
const MAX_FIT_ATTEMPTS: u32 = 6;

/// Maximum time for which a frame waits for the first image of a request that it posted. Drawing the window takes about
/// as long in software OpenGL; both together stay within a frame at 30 Hz.
const FIRST_IMAGE_WAIT: Duration = Duration::from_millis(12);

/// Opens the window, and returns when it is closed.
///
/// # Errors
/// [`kiln::error::Error::Failed`] without a display or OpenGL.
pub fn run(start: Start) -> Result<()> {
    let title = start.inputs.first().map(|input| format!("{} - ", name_of(input))).unwrap_or_default();
    let size = start
        .size
        .map_or(DEFAULT_SIZE, |[width, height]| [width as f32 + PANEL_WIDTH, height as f32 + FOOTER_HEIGHT]);
    let viewport = egui::ViewportBuilder::default()
        .with_title(format!("{title}kiln"))
        .with_app_id("kiln")
        .with_drag_and_drop(true)
        .with_inner_size(size);
    let options = eframe::NativeOptions {
        viewport,
        dithering: false,
        persist_window: start.size.is_none(),
        ..eframe::NativeOptions::default()
    };
    let report = Report::default();
    let own = Arc::clone(&report);
    let app: eframe::AppCreator = Box::new(move |creation| Ok(Box::new(App::new(creation, start, own))));
    eframe::run_native("kiln", options, app).map_err(|e| display::explain(&e))?;
    let error = report.lock().map(|mut report| report.take()).unwrap_or_default();
    error.map_or(Ok(()), Err)
}

/// Visible parts of the window besides the picture. Stored between runs.
#[derive(Debug, Clone, Copy, serde::Serialize, serde::Deserialize)]
struct VisibleParts {
    panel: bool,
    keys: bool,
}

struct App {
    threads: Arc<rayon::ThreadPool>,
    painter: Painter,
    loader: Loader,
    /// Watches the input files for changes.
    watcher: Option<Watcher>,
    /// Set by the watcher when a file has changed.
    changed: Arc<AtomicBool>,
    /// Results of saving threads.
    saved: (Sender<Saved>, Receiver<Saved>),
    /// Files that are being written.
    saving: Vec<Saving>,
    /// Whether the window closes once they are written.
    closes_when_saved: bool,
    /// The dialog for a picture's name, if shown.
    save_dialog: Option<SaveDialog>,
    inputs: Vec<PathBuf>,
    /// Options of reading the inputs that were chosen in the window.
    import_options: Option<ImportOptions>,
    /// The environment of files that are being opened.
    opened_environment: Option<PathBuf>,
    /// Shortens paths in texts.
    names: FileNames,
    /// The list of files to open, if shown.
    open_dialog: Option<OpenDialog>,
    opened: Option<Arc<Opened>>,
    controls: Option<Controls>,
    history: History<UndoState>,
    canvas: Canvas,
    /// Movement keys that are held down.
    held: HeldKeys,
    /// The newest request and its number.
    requested: Option<(RenderRequest, u64)>,
    /// Number of the failed request that the notice reports.
    failed_request: Option<u64>,
    /// Inspected pixel, and the prepared render that it belongs to.
    inspection: Option<(Arc<Prepared>, Inspection)>,
    /// The list of the objects, and the outline of the selected one.
    outliner: Outliner,
    outline: Outline,
    notice: Option<Notice>,
    /// Warnings and notes of the input files.
    warnings: Vec<String>,
    /// Those of the last picture of full size, with what it was rendered from.
    of_picture: Option<(Arc<Prepared>, Vec<String>)>,
    /// Since when the acceleration structure is being built.
    building: Option<Instant>,
    visible: VisibleParts,
    /// Size of the picture by the user, that the window is still resized to.
    first_size: Option<[u32; 2]>,
    /// Number of resize attempts.
    fit_attempts: u32,
    report: Report,
}

/// A saved file, or the error.
type Saved = (PathBuf, Result<()>);

/// The error that closed the window, for the command line.
type Report = Arc<Mutex<Option<Error>>>;

impl App {
    fn new(creation: &eframe::CreationContext, start: Start, report: Report) -> Self {
        let threads = Arc::new(start.threads);
        let wake = |context: &Context| {
            let context = context.clone();
            move || context.request_repaint()
        };
        theme::set(&creation.egui_ctx);
        let painter = Painter::new(Arc::clone(&threads), wake(&creation.egui_ctx));
        let mut loader = Loader::new(start.open, Arc::clone(&threads), wake(&creation.egui_ctx));
        if !start.inputs.is_empty() {
            loader.load(start.inputs.clone(), None);
        }
        let remembered: Option<VisibleParts> =
            creation.storage.and_then(|storage| eframe::get_value(storage, eframe::APP_KEY));
        App {
            threads,
            painter,
            loader,
            watcher: None,
            changed: Arc::default(),
            saved: channel(),
            saving: Vec::new(),
            closes_when_saved: false,
            save_dialog: None,
            names: FileNames::of(&start.inputs),
            open_dialog: None,
            inputs: start.inputs,
            import_options: None,
            opened_environment: None,
            opened: None,
            controls: None,
            history: History::default(),
            canvas: Canvas::default(),
            held: HeldKeys::default(),
            requested: None,
            failed_request: None,
            inspection: None,
            outliner: Outliner::default(),
            outline: Outline::default(),
            notice: None,
            warnings: Vec::new(),
            of_picture: None,
            building: None,
            visible: remembered.unwrap_or(VisibleParts { panel: true, keys: false }),
            first_size: start.size,
            fit_attempts: 0,
            report,
        }
    }

    /// Resizes the window so that the picture has its initial size. This takes several frames, because panels change
    /// their size, and may fail, because the display limits window sizes. Returns whether another resize was requested.
    fn fit_window(&mut self, context: &Context, size: [u32; 2]) -> bool {
        let Some(wanted) = self.first_size else { return false };
        self.fit_attempts += 1;
        if wanted == size || self.fit_attempts > MAX_FIT_ATTEMPTS {
            self.first_size = None;
            return false;
        }
        let scale = context.pixels_per_point();
        let more = |axis: usize| (wanted[axis] as f32 - size[axis] as f32) / scale;
        let window = context.viewport_rect().size() + vec2(more(0), more(1));
        context.send_viewport_cmd(ViewportCommand::InnerSize(window));
        context.request_repaint();
        true
    }

    /// Posts a render request if the controls have changed.
    fn request(&mut self, context: &Context, size: [u32; 2]) {
        let (Some(controls), Some(opened)) = (&self.controls, &self.opened) else { return };
        let request = controls.request(opened, size);
        if self.requested.as_ref().is_some_and(|(last, _)| *last == request) {
            return;
        }
        let number = self.painter.request(request.clone());
        self.requested = Some((request, number));
        self.wait_for_first_image(context, number);
    }

    /// Waits at most [`FIRST_IMAGE_WAIT`] for the first image of a request, so that the current frame shows it: texture
    /// contents are read at the end of a frame.
    fn wait_for_first_image(&mut self, context: &Context, number: u64) {
        let until = Instant::now() + FIRST_IMAGE_WAIT;
        while let Some(message) = self.painter.wait(until) {
            let is_it = match &message {
                Message::Image(rendered) => rendered.request == number,
                Message::Building | Message::Failed(..) => true,
            };
            self.handle_message(context, message);
            if is_it {
                return;
            }
        }
    }
}

/// The frames of the scene's animation; `None` without one.
fn timeline(opened: &Opened) -> Option<Timeline> {
    let animation = opened.scene().animation.as_ref()?;
    Timeline::new(animation.fps, animation.duration, animation.repeat).ok()
}

impl eframe::App for App {
    fn ui(&mut self, ui: &mut Ui, _frame: &mut eframe::Frame) {
        let context = ui.ctx().clone();
        self.handle_messages(&context);
        self.keys(&context);
        let dropped = context.input(|input| input.raw.dropped_files.clone());
        if !dropped.is_empty() {
            self.open_files(dropped.into_iter().map(|file| file.path().to_owned()).collect());
        }
        self.play(&context);
        self.panels(ui);
        CentralPanel::default().frame(Frame::NONE).show(ui, |ui| self.picture(ui));
        self.record(&context);
        self.choose_file(&context);
        self.choose_name(&context);
        self.keep_open(&context);
        let mut open = self.visible.keys;
        overlay::keys(&context, &mut open);
        self.visible.keys = open;
    }

    fn save(&mut self, storage: &mut dyn eframe::Storage) {
        eframe::set_value(storage, eframe::APP_KEY, &self.visible);
    }
}
