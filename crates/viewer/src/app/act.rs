//! Actions of keys, buttons and clicks.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

use egui::{Context, Theme, ViewportCommand};

use super::{App, timeline};
use crate::canvas::MouseResult;
use crate::command_line::{RenderCommand, command_line};
use crate::false_colour::DisplayMode;
use crate::history::SETTLE_TIME;
use crate::inspect::inspect;
use crate::keys::{self, Action, CameraMotion, Focus};
use crate::open_dialog::{Answer, OpenDialog};
use crate::painter::Prepared;
use crate::request::{CameraSource, Opened};
use crate::save::{Finished, SaveAnswer, SaveDialog, SavedPicture, Saving};
use crate::{message_with_hint, name_of, save};
use kiln::effects::id;
use kiln::error::Result;
use kiln::import;
use kiln::job::Session;
use kiln::render::RenderControl;
use kiln::scene::{Camera, ImportOptions};
use kiln::world::StandardView;

impl App {
    /// Performs the actions of pressed keys, and moves the camera by held keys.
    pub(super) fn keys(&mut self, context: &Context) {
        // The field of the list of files takes what is typed also before it is shown.
        let focus = if self.open_dialog.is_some() { Focus::Text } else { Focus::of(context) };
        let actions = context.input_mut(|input| keys::actions(input, focus));
        for action in actions {
            self.act(context, action);
        }
        context.input(|input| self.held.update(input, focus));
        let motion = context.input(|input| self.held.motion(input, focus));
        if motion == CameraMotion::default() {
            return;
        }
        let (seconds, fast) = context.input(|input| (f64::from(input.stable_dt), input.modifiers.shift));
        let camera = self.displayed_camera();
        if let Some(controls) = &mut self.controls {
            // A slow frame must not move the camera by a large step.
            controls.drive(camera.as_ref(), self.canvas.middle(), motion, seconds.min(0.1), fast);
        }
        context.request_repaint();
    }

    /// The camera of the displayed picture, in scene coordinates.
    pub(super) fn displayed_camera(&self) -> Option<Camera> {
        self.canvas.prepared().map(|prepared| prepared.camera.clone())
    }

    /// Performs an action.
    pub(super) fn act(&mut self, context: &Context, action: Action) {
        match action {
            Action::Panel => self.visible.panel = !self.visible.panel,
            Action::Help => self.visible.keys = !self.visible.keys,
            Action::Open => {
                let inputs = &self.inputs;
                self.open_dialog = match self.open_dialog {
                    Some(_) => None,
                    None => Some(OpenDialog::beside(inputs.first().map(PathBuf::as_path))),
                };
            }
            Action::Reload => self.reload(),
            Action::FullScreen => {
                let is_full = context.input(|input| input.viewport().fullscreen.unwrap_or(false));
                context.send_viewport_cmd(ViewportCommand::Fullscreen(!is_full));
            }
            Action::Theme => context.set_theme(match context.theme() {
                Theme::Dark => Theme::Light,
                Theme::Light => Theme::Dark,
            }),
            Action::Magnify => self.canvas.magnify(context),
            Action::Close if self.canvas.end_magnifying() => {}
            Action::Close => {
                self.visible.keys = false;
                (self.notice, self.inspection, self.open_dialog) = (None, None, None);
                self.save_dialog = None;
            }
            Action::SavePicture => self.ask_for_name(),
            Action::CopyCamera => {
                if let Some(camera) = self.displayed_camera() {
                    context.copy_text(camera.to_section());
                    self.show_notice("copied the camera, as a section of a scene file".to_owned());
                }
            }
            Action::Undo => self.undo(true),
            Action::Redo => self.undo(false),
            Action::CopyCommand => {
                if let Some(command) = self.copied_command() {
                    context.copy_text(command);
                    self.show_notice("copied the command line that renders this".to_owned());
                }
            }
            _ => self.control(action),
        }
    }

    /// Shows the list of files to open, and opens the chosen one.
    pub(super) fn choose_file(&mut self, context: &Context) {
        let Some(dialog) = &mut self.open_dialog else { return };
        match dialog.show(context) {
            Answer::Open => return,
            Answer::Picked(file) => self.open_files(vec![file]),
            Answer::Closed => {}
        }
        self.open_dialog = None;
    }

    /// Opens files together. An image of the surroundings becomes the environment, of these files if there are any.
    pub(super) fn open_files(&mut self, files: Vec<PathBuf>) {
        let is_input = |file: &PathBuf| !import::is_environment_file(file);
        let (inputs, mut environments): (Vec<_>, Vec<_>) = files.into_iter().partition(is_input);
        let environment = environments.pop();
        if !inputs.is_empty() {
            self.opened_environment = environment.or(self.opened_environment.take());
            self.load(inputs, None);
        } else if let (Some(file), Some(controls)) = (&environment, &mut self.controls) {
            controls.light_by(file);
        } else if let Some(file) = environment {
            let name = name_of(&file);
            self.opened_environment = Some(file);
            self.show_notice(format!("{name} lights the file that is opened next"));
        }
    }

    /// Performs an action that changes the render request.
    fn control(&mut self, action: Action) {
        let camera = self.displayed_camera();
        let (Some(controls), Some(opened)) = (&mut self.controls, &self.opened) else { return };
        let timeline = timeline(opened);
        match (action, timeline) {
            (Action::Projection, _) => controls.switch_projection(camera.as_ref()),
            (Action::Reset, _) => controls.reset_camera(),
            (Action::Fit, _) => controls.fit_standard_view(StandardView::Auto),
            (Action::Standard(view), _) => controls.fit_standard_view(view),
            (Action::NextCamera, _) => controls.next_camera(opened.scene().cameras.len()),
            (Action::NextShown, _) => controls.next_display_mode(),
            (Action::Play, Some(_)) => controls.play(),
            (Action::Step(by), Some(timeline)) => {
                controls.playing = None;
                controls.go_to(&timeline, controls.frame(&timeline) + by);
            }
            (Action::Rewind, Some(timeline)) => controls.go_to(&timeline, 0),
            _ => {}
        }
    }

    /// Shows other objects of the opened scene, also when its files are read again. The camera stays, also one that frames
    /// the scene.
    pub(super) fn show_objects(&mut self, isolate: Vec<String>, hide: Vec<String>) {
        let camera = self.displayed_camera();
        let (Some(opened), Some(controls)) = (&self.opened, &mut self.controls) else { return };
        let mut scene = opened.scene().clone();
        let shown = scene.set_visible(&isolate, &hide);
        (scene.import_options.isolate, scene.import_options.hide) = (isolate, hide);
        let options = scene.import_options.clone();
        let session = match shown.and_then(|()| Session::playing(scene)) {
            Ok(session) => session.into(),
            Err(e) => return self.show_error(message_with_hint(&e)),
        };
        self.import_options = Some(options);
        let changed = Opened { session, ..Opened::clone(opened) };
        controls.keep_camera(camera.as_ref());
        controls.reopened(&changed);
        self.opened = Some(Arc::new(changed));
    }

    /// Restores the state before the last change, or after the last that was undone.
    fn undo(&mut self, is_undo: bool) {
        let (Some(state), Some(opened)) = (self.history.go(is_undo), &self.opened) else { return };
        let ImportOptions { isolate, hide, .. } = &opened.scene().import_options;
        if state.visible.each_ref() != [isolate, hide] {
            let [isolate, hide] = state.visible.clone();
            self.show_objects(isolate, hide);
        }
        if let Some(controls) = &mut self.controls {
            controls.restore(state);
        }
    }

    /// Records the state of a frame, which can be undone.
    pub(super) fn record(&mut self, context: &Context) {
        let (Some(controls), Some(opened)) = (&self.controls, &self.opened) else { return };
        let state = controls.undo_state(&opened.scene().import_options);
        if self.history.record(state, Instant::now()) {
            context.request_repaint_after(SETTLE_TIME);
        }
    }

    /// Inspects a pixel of the displayed picture. Returns what it was rendered from.
    fn inspect(&mut self, pixel: [u32; 2]) -> Option<Arc<Prepared>> {
        let (rendered, opened) = (self.canvas.rendered()?, self.opened.as_ref()?);
        let (prepared, shown) = (Arc::clone(&rendered.prepared), rendered.display);
        let metered = rendered.metered.clone();
        let job = metered.as_deref().unwrap_or(prepared.job());
        let bounds = match (opened.scene().bounds(), &job.recentering) {
            (Some((min, max)), Some(recentering)) => Some((
                (min - recentering.middle) * recentering.scale,
                (max - recentering.middle) * recentering.scale,
            )),
            (bounds, _) => bounds,
        };
        match inspect(job, bounds, [job.display().known(), shown], pixel) {
            Ok(found) => self.inspection = Some((Arc::clone(&prepared), found)),
            Err(e) => {
                self.inspection = None;
                self.show_error(message_with_hint(&e));
            }
        }
        Some(prepared)
    }

    /// Inspects the pixel of a finished picture that was inspected in the last one. From another camera the rays of the last
    /// one stay, unless something else has changed, too.
    pub(super) fn inspect_again(&mut self) {
        let (Some((of, found)), Some(prepared)) = (&self.inspection, self.canvas.prepared()) else { return };
        let (before, now, pixel) = (of.job(), prepared.job(), found.report.pixel);
        if of.camera == prepared.camera && before.view.size() == now.view.size() {
            if !Arc::ptr_eq(of, prepared) {
                self.inspect(pixel);
            }
        } else if !Arc::ptr_eq(&before.world, &now.world) || before.plan_settings != now.plan_settings {
            self.inspection = None;
        }
    }

    /// Inspects a clicked pixel, and makes its surface point the focus of orbit and lens; a double click moves it to the
    /// middle of the picture.
    pub(super) fn click(&mut self, mouse: &MouseResult) {
        let Some(pixel) = mouse.clicked.or(mouse.focused) else { return };
        let (Some(prepared), Some((_, found))) = (self.inspect(pixel), &self.inspection) else { return };
        let job = prepared.job();
        if let Some(controls) = &mut self.controls {
            let point = found.surface().map(|surface| surface.position);
            let has_lens = job.plan.decisions.iter().any(|d| d.on && d.effect == id::DEPTH_OF_FIELD);
            match (mouse.focused, point) {
                (Some(_), Some(point)) => controls.centre(&prepared.camera, point),
                _ => controls.look_at(&prepared.camera, point, has_lens),
            }
        }
        self.outliner.select(found.surface().map(|surface| surface.object.as_str()));
        self.visible.panel = true;
    }

    /// File name for the next saved picture.
    fn output(&self, ending: &str) -> PathBuf {
        let stem = save::stem(&self.inputs);
        let timeline = self.opened.as_ref().and_then(|opened| timeline(opened));
        let name = match (timeline, &self.controls) {
            (Some(timeline), Some(controls)) => format!("{stem}-{:04}", controls.frame(&timeline)),
            _ => stem,
        };
        save::free_name(&name, ending, &self.saving)
    }

    /// The command line that renders the displayed picture in a size, with the AOV of a false-colour view.
    fn command(&self, output: &std::path::Path, size: [u32; 2]) -> Option<String> {
        let (controls, opened) = (self.controls.as_ref()?, self.opened.as_ref()?);
        let prepared = self.canvas.prepared()?;
        // Only the window fits a camera to a moment.
        let fitted = CameraSource::Free(prepared.camera.clone());
        let viewpoint = match &controls.camera_source {
            CameraSource::FittedAt(..) => &fitted,
            source => source,
        };
        let command = command_line(&RenderCommand {
            inputs: &self.inputs,
            scene: opened.scene(),
            viewpoint,
            projection: prepared.job().camera.projection,
            size,
            settings: &controls.settings,
            import_options: &opened.scene().import_options,
            output,
        });
        let frame = timeline(opened).map(|timeline| controls.frame(&timeline));
        let frame = frame.map_or(String::new(), |frame| format!(" --frames {frame}"));
        let aov = controls.display_mode.aov().map_or(String::new(), |aov| format!(" --aov {aov}"));
        Some(format!("{command}{frame}{aov}"))
    }

    /// The command line of what is displayed. AOVs are channels of OpenEXR.
    fn copied_command(&self) -> Option<String> {
        let controls = self.controls.as_ref()?;
        let ending = if controls.display_mode.aov().is_some() { "exr" } else { "png" };
        let size = self.canvas.prepared()?.job().view.size();
        self.command(&self.output(ending), size)
    }

    /// Opens the dialog for the name of the picture; closes it if it is open.
    fn ask_for_name(&mut self) {
        let Some(controls) = &self.controls else { return };
        let has_size = controls.display_mode == DisplayMode::Picture;
        let Some(prepared) = self.canvas.prepared() else { return };
        let size = prepared.job().view.size();
        let has_alpha = has_size && prepared.job().is_transparent();
        self.save_dialog = match self.save_dialog {
            Some(_) => None,
            None => Some(SaveDialog::new(&self.output("png"), size, [has_size, has_alpha])),
        };
    }

    /// Shows the dialog for the name of the picture, and saves it.
    pub(super) fn choose_name(&mut self, context: &Context) {
        let Some(dialog) = &mut self.save_dialog else { return };
        match dialog.show(context) {
            SaveAnswer::Open => return,
            SaveAnswer::Save(file, size) => self.save_picture(context, file, size),
            SaveAnswer::Closed => {}
        }
        self.save_dialog = None;
    }

    /// Saves the picture in a size, the same as that of `kiln render`; for other display modes, the displayed image.
    fn save_picture(&mut self, context: &Context, file: PathBuf, size: [u32; 2]) {
        let (Some(controls), Some(opened)) = (&self.controls, &self.opened) else { return };
        let mode = controls.display_mode;
        let Some(rendered) = self.canvas.rendered() else { return };
        let command = self.command(&file, size).unwrap_or_default();
        let mut request = controls.request(opened, size);
        // The displayed picture is that of the newest request, once it is finished.
        let is_newest = self.requested.as_ref().is_some_and(|(last, number)| {
            *number == rendered.request && *last == request && rendered.prepared.job().view.size() == size
        });
        let finished = rendered
            .film
            .as_ref()
            .filter(|_| is_newest)
            .map(|film| Finished { film: Arc::clone(film), display: rendered.display });
        let image = Arc::clone(&rendered.image);
        // As the command: only the window fits a camera to a moment.
        if let CameraSource::FittedAt(..) = request.camera_source {
            request.camera_source = CameraSource::Free(rendered.prepared.camera.clone());
        }
        let frame = timeline(opened).map(|timeline| controls.frame(&timeline));
        let picture = SavedPicture { request, frame, finished, command };
        let percent = Arc::new(AtomicUsize::new(0));
        self.saving.push(Saving { file: file.clone(), percent: Arc::clone(&percent) });
        let (threads, sender, context) = (Arc::clone(&self.threads), self.saved.0.clone(), context.clone());
        let (wake, woken) = (context.clone(), move || context.request_repaint());
        save::beside(file, sender, woken, move |file| match mode {
            DisplayMode::Picture => {
                let progress = |done: usize, of: usize| {
                    if percent.swap(done * 100 / of.max(1), Ordering::Relaxed) != done * 100 / of.max(1) {
                        wake.request_repaint();
                    }
                };
                let control = RenderControl { progress: &progress, ..RenderControl::default() };
                threads.install(|| picture.write(file, &control))
            }
            _ => save::colours(&image, file),
        });
    }

    /// While files are being written, the window stays open; it closes with the last of them.
    pub(super) fn keep_open(&mut self, context: &Context) {
        let is_closing = context.input(|input| input.viewport().close_requested());
        if is_closing && !self.saving.is_empty() {
            self.closes_when_saved = true;
            context.send_viewport_cmd(ViewportCommand::CancelClose);
            self.show_notice("the window closes when the picture is saved".to_owned());
        } else if self.closes_when_saved && self.saving.is_empty() && !is_closing {
            // An error stays to be read.
            self.closes_when_saved = false;
            if self.notice.as_ref().is_none_or(|notice| !notice.is_error) {
                context.send_viewport_cmd(ViewportCommand::Close);
            }
        }
    }

    /// Shows whether a file was saved.
    pub(super) fn show_save_result(&mut self, result: Result<()>, file: &std::path::Path) {
        match result {
            Ok(()) => self.show_notice(format!("saved {}", file.display())),
            Err(e) => self.show_error(message_with_hint(&e)),
        }
    }
}
