//! The window itself: what happens in a frame of it, in order.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use egui::{CentralPanel, Context, Frame, Panel, RichText, Theme, Ui, ViewportCommand};
use serde_json::json;

use super::canvas::Canvas;
use super::controls::{Controls, next};
use super::display;
use super::false_colour::Shown;
use super::keys::{self, Action};
use super::loader::{Loaded, Loader};
use super::look::{Opened, Order};
use super::painter::{Comparison, News, Painter};
use super::panel::{self, Shows};
use super::trace::{Pauses, Trace};
use super::watch::Watcher;
use super::{Start, say};
use crate::error::Result;
use crate::import::FileRead;
use crate::scene::animation::Timeline;
use crate::world::StandardView;

/// Width of the panel in points.
const PANEL: f32 = 300.0;

/// Height of what is below the picture, in points, for the window's first size.
const BELOW: f32 = 30.0;

/// Opens the window, and returns when it is closed.
///
/// # Errors
/// [`crate::error::Error::Failed`] where there is no display or no OpenGL.
pub fn run(start: Start) -> Result<()> {
    let trace = Trace::new(start.trace.as_deref())?;
    let title = start.inputs.first().map_or("kiln".into(), |input| super::name_of(input));
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
    let report = Arc::new(std::sync::Mutex::new(None));
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
    let report = report.lock().ok().and_then(|mut report| report.take());
    if let Some(report) = report {
        print!("{report}");
    }
    Ok(())
}

/// Something that is said across the picture until it no longer holds.
struct Notice {
    text: String,
    is_error: bool,
}

struct App {
    painter: Painter,
    loader: Loader,
    /// Looks whether the files change.
    watcher: Option<Watcher>,
    /// Whether they have.
    changed: Arc<AtomicBool>,
    inputs: Vec<PathBuf>,
    opened: Option<Arc<Opened>>,
    controls: Option<Controls>,
    canvas: Canvas,
    /// The order that was given last, and its number.
    ordered: Option<(Order, u64)>,
    comparison: Option<Comparison>,
    notice: Option<Notice>,
    /// What there is to say of the files.
    warnings: Vec<String>,
    is_building: bool,
    shows_panel: bool,
    shows_keys: bool,
    trace: Trace,
    pauses: Option<Pauses>,
    report: Arc<std::sync::Mutex<Option<String>>>,
}

impl App {
    fn new(
        creation: &eframe::CreationContext,
        start: Start,
        trace: Trace,
        report: Arc<std::sync::Mutex<Option<String>>>,
    ) -> Self {
        let threads = Arc::new(start.threads);
        let wake = |context: &Context| {
            let context = context.clone();
            move || context.request_repaint()
        };
        let painter = Painter::new(Arc::clone(&threads), wake(&creation.egui_ctx));
        let mut loader = Loader::new(start.open, threads, wake(&creation.egui_ctx));
        loader.load(start.inputs.clone());
        let mut app = App {
            painter,
            loader,
            watcher: None,
            changed: Arc::default(),
            inputs: start.inputs,
            opened: None,
            controls: None,
            canvas: Canvas::default(),
            ordered: None,
            comparison: None,
            notice: None,
            warnings: Vec::new(),
            is_building: false,
            shows_panel: true,
            shows_keys: false,
            trace,
            pauses: start.pauses.map(Pauses::new),
            report,
        };
        app.trace.say("started", json!({}));
        app
    }

    /// Takes in files that were read.
    fn take(&mut self, context: &Context, loaded: Loaded) {
        let Loaded { inputs, result, files, warnings, .. } = loaded;
        let watched: Vec<String> = files.iter().map(|read| read.file.display().to_string()).collect();
        self.watch(context, files);
        let opened = match result {
            Ok(opened) => Arc::new(opened),
            Err(e) => {
                let text = say(&e);
                self.trace.say("error", json!({ "text": text }));
                self.notice = Some(Notice { text, is_error: true });
                return;
            }
        };
        let is_same = inputs == self.inputs;
        match &mut self.controls {
            Some(controls) if is_same => controls.reopened(&opened),
            controls => *controls = Some(Controls::new(&opened)),
        }
        if !is_same || self.opened.is_none() {
            let title = inputs.first().map_or("kiln".into(), |input| super::name_of(input));
            context.send_viewport_cmd(ViewportCommand::Title(format!("{title} - kiln")));
        }
        self.warnings = warnings.messages().iter().chain(warnings.notes()).cloned().collect();
        (self.inputs, self.notice) = (inputs, None);
        self.trace.say("opened", json!({ "files": watched }));
        self.opened = Some(opened);
    }

    /// Watches the files of the scene, also where they could not be used.
    fn watch(&mut self, context: &Context, files: Vec<FileRead>) {
        if let Some(watcher) = &self.watcher {
            return watcher.set_files(files);
        }
        let (changed, context) = (Arc::clone(&self.changed), context.clone());
        self.watcher = Watcher::new(files, move || {
            changed.store(true, Ordering::Relaxed);
            context.request_repaint();
        })
        .ok();
    }

    /// Takes in what the painter has made.
    fn take_news(&mut self, context: &Context) {
        let newest = self.ordered.as_ref().map_or(0, |(_, number)| *number);
        let all: Vec<News> = self.painter.news().collect();
        for news in all {
            match news {
                News::Building => self.is_building = true,
                News::Painted(painted) => {
                    self.is_building = false;
                    if painted.order == newest {
                        self.notice.take_if(|notice| notice.is_error);
                    }
                    let what = json!({
                        "order": painted.order,
                        "side": painted.side,
                        "factor": painted.factor,
                        "samples": painted.samples.0,
                        "last": painted.is_last,
                        "ms": painted.time.as_secs_f64() * 1e3,
                        "newest": painted.order == newest,
                    });
                    self.trace.say("picture", what);
                    self.canvas.take(context, painted);
                }
                News::Compared(order, comparison) if order == newest => self.comparison = Some(comparison),
                News::Compared(..) => {}
                News::Failed(order, text) => {
                    self.is_building = false;
                    self.trace.say("error", json!({ "order": order, "text": text }));
                    self.notice = Some(Notice { text, is_error: true });
                }
            }
        }
    }

    /// Does what keys ask for.
    fn keys(&mut self, context: &Context) {
        let has_focus = context.egui_wants_keyboard_input();
        let actions = context.input_mut(|input| keys::actions(input, has_focus));
        for action in actions {
            self.trace.say("key", json!({ "action": format!("{action:?}") }));
            self.act(context, action);
        }
        let (fly, orbit) = context.input(|input| keys::held(input, has_focus));
        let (seconds, fast) = context.input(|input| (f64::from(input.stable_dt), input.modifiers.shift));
        if fly != glam::DVec3::ZERO || orbit != glam::DVec2::ZERO {
            let seen = self.canvas.prepared(0).map(|prepared| prepared.camera.clone());
            if let Some(controls) = &mut self.controls {
                controls.drive(seen.as_ref(), fly, orbit, seconds, fast);
            }
            context.request_repaint();
        }
    }

    fn act(&mut self, context: &Context, action: Action) {
        match action {
            Action::Panel => self.shows_panel = !self.shows_panel,
            Action::Help => self.shows_keys = !self.shows_keys,
            Action::Reload => self.loader.load(self.inputs.clone()),
            Action::FullScreen => {
                let is_full = context.input(|input| input.viewport().fullscreen.unwrap_or(false));
                context.send_viewport_cmd(ViewportCommand::Fullscreen(!is_full));
            }
            Action::Theme => context.set_theme(match context.theme() {
                Theme::Dark => Theme::Light,
                Theme::Light => Theme::Dark,
            }),
            Action::Close => {
                self.shows_keys = false;
                self.notice = None;
            }
            _ => {}
        }
        let (Some(controls), Some(opened)) = (&mut self.controls, &self.opened) else { return };
        let seen = self.canvas.prepared(0).map(|prepared| prepared.camera.clone());
        let timeline = timeline(opened);
        match action {
            Action::Projection => controls.switch_projection(seen.as_ref()),
            Action::Reset => controls.reset_camera(),
            Action::Fit => controls.stand(StandardView::Auto),
            Action::Standard(view) => controls.stand(view),
            Action::NextCamera => controls.next_camera(opened.scene.cameras.len()),
            Action::NextShown => controls.shown = next(&Shown::ALL, controls.shown),
            Action::Compare => controls.switch_comparison(),
            Action::NextTier => controls.next_tier(),
            Action::NextShading => controls.next_shading(),
            Action::Effect(index) => {
                let decision = self.canvas.prepared(controls.side).and_then(|p| p.decisions.get(index));
                if let Some((decision, true)) = decision {
                    let (effect, on) = (decision.effect, decision.on);
                    controls.settings().switch(effect, !on);
                }
            }
            Action::Play if timeline.is_some() => controls.play(),
            Action::Step(by) => {
                if let Some(timeline) = timeline {
                    controls.playing = None;
                    controls.go_to(&timeline, controls.frame(&timeline) + by);
                }
            }
            Action::Rewind => {
                if let Some(timeline) = timeline {
                    controls.go_to(&timeline, 0);
                }
            }
            _ => {}
        }
    }

    /// Asks for the picture that the controls now mean, where that is another.
    fn order(&mut self, size: [u32; 2]) {
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
    }

    fn status(&self, ui: &mut Ui) {
        ui.horizontal(|ui| {
            let painted = self.canvas.painted(0);
            let line = match (painted, self.is_building) {
                (_, true) => "building".to_owned(),
                (Some(painted), _) => panel::work(painted),
                (None, _) => "loading".to_owned(),
            };
            ui.label(line);
            for warning in &self.warnings {
                ui.separator();
                ui.label(RichText::new(warning).weak());
            }
        });
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
        if let Some(report) = self.pauses.as_mut().and_then(|pauses| pauses.frame(&context)) {
            if let Ok(mut own) = self.report.lock() {
                *own = Some(report);
            }
            self.pauses = None;
            context.send_viewport_cmd(ViewportCommand::Close);
        }
        if self.changed.swap(false, Ordering::Relaxed) {
            self.trace.say("changed", json!({}));
            self.loader.load(self.inputs.clone());
        }
        if let Some(loaded) = self.loader.loaded() {
            self.take(&context, loaded);
        }
        self.take_news(&context);
        self.keys(&context);
        let dropped = context.input(|input| input.raw.dropped_files.clone());
        let dropped: Vec<PathBuf> = dropped.into_iter().map(|file| file.path().to_owned()).collect();
        if !dropped.is_empty() {
            self.loader.load(dropped);
        }
        Panel::bottom("status").show(ui, |ui| self.status(ui));
        if self.shows_panel {
            let App { controls, opened, canvas, comparison, trace, .. } = self;
            Panel::right("panel").exact_size(PANEL).show(ui, |ui| {
                egui::ScrollArea::vertical().show(ui, |ui| {
                    if let (Some(controls), Some(opened)) = (controls, opened) {
                        let painted = [canvas.painted(0), canvas.painted(1)];
                        panel::show(ui, &Shows { opened, painted, comparison: *comparison }, controls, trace);
                    }
                });
            });
        }
        CentralPanel::default().frame(Frame::NONE).show(ui, |ui| {
            let Some(controls) = &mut self.controls else { return };
            let (size, _done) = self.canvas.show(ui, controls);
            if let Some(rect) = self.canvas.rect() {
                self.trace.place("canvas", rect, context.pixels_per_point());
            }
            self.order(size);
        });
    }
}
