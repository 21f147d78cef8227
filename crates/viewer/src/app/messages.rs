//! Messages from the loader, painter, watcher and saving threads.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Instant;

use egui::{Context, ViewportCommand};

use super::App;
use crate::controls::Controls;
use crate::history::History;
use crate::loader::Loaded;
use crate::overlay::Notice;
use crate::painter::{Message, Prepared, RenderedImage};
use crate::watch::Watcher;
use crate::{message_with_hint, name_of};
use kiln::error::{Error, Warnings, printable};
use kiln::import::{FileNames, FileRead};
use kiln::scene::ImportOptions;

/// Hint of errors that are faults of kiln.
const REPORT: &str = "please report it with the input; what you see stays as it is";

impl App {
    /// Handles all pending messages.
    pub(super) fn handle_messages(&mut self, context: &Context) {
        if self.changed.swap(false, Ordering::Relaxed) {
            self.reload();
        }
        if let Some(loaded) = self.loader.loaded() {
            self.handle_loaded(context, loaded);
        }
        while let Ok((file, done)) = self.saved.1.try_recv() {
            self.saving.retain(|other| other.file != file);
            self.show_save_result(done, &file);
        }
        if self.painter.has_ended() && self.notice.is_none() {
            self.show_error(format!("a fault in kiln itself: nothing is rendered any more\n{REPORT}"));
        }
        let all: Vec<Message> = self.painter.messages().collect();
        all.into_iter().for_each(|message| self.handle_message(context, message));
    }

    /// Shows an error until its cause is gone or it is dismissed.
    pub(super) fn show_error(&mut self, text: String) {
        self.notice = Some(Notice::new(text, true));
    }

    /// Shows a notice about a completed action.
    pub(super) fn show_notice(&mut self, text: String) {
        self.notice = Some(Notice::new(text, false));
    }

    /// Handles loaded files.
    fn handle_loaded(&mut self, context: &Context, loaded: Loaded) {
        let Loaded { inputs, options, result, files, warnings, .. } = loaded;
        let (is_same, environment) = (inputs == self.inputs, self.opened_environment.take());
        if is_same || result.is_ok() {
            self.watch(context, files);
        }
        let opened = match result {
            Ok(opened) => Arc::new(opened),
            // Options do not fit the inputs: a changed file cannot correct that.
            Err(e @ Error::Usage { .. }) if self.opened.is_none() => return self.give_up(context, e),
            // The last valid scene stays.
            Err(e) => return self.show_error(message_with_hint(&e)),
        };
        match &mut self.controls {
            Some(controls) if is_same => controls.reopened(&opened),
            controls => *controls = Some(Controls::new(&opened)),
        }
        if let (Some(file), Some(controls)) = (environment, &mut self.controls) {
            controls.light_by(&file);
        }
        self.import_options = options;
        if !is_same {
            self.history = History::default();
            let title = inputs.first().map_or("kiln".into(), |input| name_of(input));
            context.send_viewport_cmd(ViewportCommand::Title(format!("{title} - kiln")));
            (self.inputs, self.inspection) = (inputs, None);
            self.names = FileNames::of(&self.inputs);
        }
        let texts = warnings.messages().iter().chain(warnings.notes());
        self.warnings = texts.map(|text| printable(&self.names.shorten(text)).into_owned()).collect();
        self.notice.take_if(|notice| notice.is_error);
        self.opened = Some(opened);
    }

    /// Reads the files again.
    pub(super) fn reload(&mut self) {
        if self.inputs.is_empty() {
            return;
        }
        self.load(self.inputs.clone(), self.import_options.clone());
    }

    /// Reads files, with options that were chosen in the window if there are any.
    pub(super) fn load(&mut self, inputs: Vec<PathBuf>, options: Option<ImportOptions>) {
        if !self.loader.load(inputs, options) {
            self.show_error(format!("a fault in kiln itself: no file is read any more\n{REPORT}"));
        }
    }

    /// Closes the window because of an error.
    fn give_up(&mut self, context: &Context, e: Error) {
        if let Ok(mut report) = self.report.lock() {
            *report = Some(e);
        }
        context.send_viewport_cmd(ViewportCommand::Close);
    }

    /// Watches the files of the scene, including those that could not be loaded.
    fn watch(&mut self, context: &Context, files: Vec<FileRead>) {
        if let Some(watcher) = &self.watcher {
            return watcher.set_files(files);
        }
        let (changed, context) = (Arc::clone(&self.changed), context.clone());
        let on_change = move || {
            changed.store(true, Ordering::Relaxed);
            context.request_repaint();
        };
        self.watcher = Watcher::new(files, on_change).ok();
    }

    /// Handles a message of the painter.
    pub(super) fn handle_message(&mut self, context: &Context, message: Message) {
        let newest = self.requested.as_ref().map_or(0, |(_, number)| *number);
        match message {
            Message::Building => self.building = Some(Instant::now()),
            Message::Image(rendered) => self.handle_image(context, rendered, newest),
            Message::Failed(request, text) => {
                self.building = None;
                if request == newest {
                    self.failed_request = Some(request);
                    self.show_error(text);
                }
            }
        }
    }

    fn handle_image(&mut self, context: &Context, rendered: Box<RenderedImage>, newest: u64) {
        self.building = None;
        // A newer request succeeded, so an error of an earlier one is obsolete.
        if rendered.request == newest && self.failed_request.take_if(|failed| *failed < newest).is_some() {
            self.notice.take_if(|notice| notice.is_error);
        }
        // Notes of other settings are not those of this picture. Another camera keeps them until it has its own.
        let has_same_settings = |(known, _): &mut (Arc<Prepared>, _)| {
            let (known, job) = (&known.job(), &rendered.prepared.job());
            Arc::ptr_eq(&known.world, &job.world) && known.plan_settings == job.plan_settings
        };
        self.of_picture.take_if(|known| !has_same_settings(known));
        let is_known = |(known, _): &(Arc<_>, _)| Arc::ptr_eq(known, &rendered.prepared);
        if rendered.factor == 1 && !self.of_picture.as_ref().is_some_and(is_known) {
            let mut warnings = Warnings::default();
            rendered.warn_of_picture(&mut warnings);
            let texts = warnings.messages().iter().chain(warnings.notes()).cloned().collect();
            self.of_picture = Some((Arc::clone(&rendered.prepared), texts));
        }
        let is_last = rendered.is_last;
        self.canvas.take(context, rendered);
        if is_last {
            self.inspect_again();
        }
    }
}
