//! Layout of an interface frame.

use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Duration;

use egui::{Align, Context, Label, Layout, Panel, RichText, ScrollArea, Ui};

use super::{App, inspector, timeline};
use crate::panel;
use crate::save::Saving;
use crate::{elided, name_of, overlay, pixels, timeline as bar};

/// Width of the panel, in points.
pub(super) const PANEL_WIDTH: f32 = 300.0;

/// Width of the status bar below which it has no warnings, in points.
const LEAST_WIDTH: f32 = 40.0;

impl App {
    /// Advances a playing animation once its newest frame was rendered.
    pub(super) fn play(&mut self, context: &Context) {
        let (Some(controls), Some(opened)) = (&mut self.controls, &self.opened) else { return };
        let (Some(_), Some(timeline), Some(animation)) =
            (controls.playing, timeline(opened), &opened.scene().animation)
        else {
            return;
        };
        let newest = self.requested.as_ref().map_or(0, |(_, number)| *number);
        if self.canvas.rendered().is_some_and(|rendered| rendered.request == newest) {
            controls.advance(&timeline, animation.duration);
        }
        context.request_repaint_after(Duration::from_millis(5));
    }

    pub(super) fn panels(&mut self, ui: &mut Ui) {
        Panel::bottom("status").show(ui, |ui| self.status(ui));
        let App { controls, opened, canvas, visible, inspection, names, outliner, .. } = self;
        let (Some(controls), Some(opened)) = (controls, opened) else { return };
        let (mut clicked, mut is_inspecting, mut visible_objects) = (None, true, None);
        if visible.panel {
            Panel::right("panel").exact_size(PANEL_WIDTH).show(ui, |ui| {
                Panel::bottom("buttons").show(ui, |ui| clicked = panel::buttons(ui));
                if let Some((of, found)) = inspection {
                    let is_of_before = !canvas.prepared().is_some_and(|now| Arc::ptr_eq(now, of));
                    is_inspecting = inspector::show(ui, found, names, is_of_before);
                }
                ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
                    clicked = clicked.or(panel::show(ui, opened, canvas.rendered(), controls));
                    visible_objects = outliner.show(ui, opened);
                });
            });
        }
        if !is_inspecting {
            *inspection = None;
        }
        let reading = controls.reading.take();
        if let (Some(timeline), Some(animation)) = (timeline(opened), &opened.scene().animation) {
            Panel::bottom("timeline").show(ui, |ui| {
                bar::show(ui, &timeline, animation.duration, controls);
            });
        }
        if let Some(options) = reading {
            self.load(self.inputs.clone(), Some(options));
        } else if let Some([isolate, hide]) = visible_objects {
            self.show_objects(isolate, hide);
        }
        if let Some(action) = clicked {
            self.act(&ui.ctx().clone(), action);
        }
    }

    /// The picture and its overlays.
    pub(super) fn picture(&mut self, ui: &mut Ui) {
        let context = ui.ctx().clone();
        let rect = ui.available_rect_before_wrap();
        self.notice.take_if(|notice| notice.is_over(&context) || overlay::notice(&context, rect, notice));
        if let Some((what, since)) = self.progress() {
            overlay::progress(&context, rect, &what, since);
        }
        let Some(controls) = &mut self.controls else { return self.empty(ui) };
        let (size, mouse) = self.canvas.show(ui, controls);
        let rect = self.canvas.rect().unwrap_or(rect);
        self.click(&mouse);
        if let Some(legend) = self.canvas.rendered().and_then(|rendered| rendered.legend.as_ref()) {
            overlay::legend(&context, rect, legend);
        }
        let whole = self.canvas.whole().unwrap_or(rect);
        // Coarse images are those of a camera that moves.
        if let (Some(selected), Some(rendered)) = (self.outliner.selected(), self.canvas.rendered())
            && rendered.factor == 1
        {
            let (prepared, painter) = (&rendered.prepared, ui.painter_at(rect));
            self.outline.draw(&painter, whole, prepared, selected, &self.threads);
        }
        if let (Some((of, found)), Some(prepared)) = (&self.inspection, self.canvas.prepared()) {
            inspector::draw(&ui.painter_at(rect), whole, prepared, of, found);
        }
        if !self.fit_window(&context, size) {
            self.request(&context, size);
        }
    }

    /// The status bar: render progress, the pixel under the mouse, and warnings about the image and the files.
    fn status(&self, ui: &mut Ui) {
        let pixel = self.canvas.hovered().zip(self.canvas.rendered());
        let pixel = pixel.map(|(pixel, rendered)| pixels::values(rendered, pixel));
        ui.horizontal(|ui| {
            ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
                pixel.into_iter().for_each(|text| {
                    ui.label(RichText::new(text).monospace().small());
                });
                ui.with_layout(Layout::left_to_right(Align::Center), |ui| self.progress_and_warnings(ui));
            });
        });
    }

    /// The left part of the status bar.
    fn progress_and_warnings(&self, ui: &mut Ui) {
        let rendered = self.canvas.rendered();
        let progress = match (rendered, self.progress()) {
            (Some(rendered), None) => panel::progress_text(rendered),
            (_, Some((what, _))) => what,
            (None, None) => "no file is open".to_owned(),
        };
        ui.add(Label::new(progress).truncate());
        for Saving { file, percent } in &self.saving {
            ui.separator();
            let percent = percent.load(Ordering::Relaxed);
            ui.label(format!("saving {}, {percent} %", elided(&name_of(file), 24)));
        }
        let of_picture = self.of_picture.iter().flat_map(|(_, texts)| texts).chain(&self.warnings);
        let of_image =
            rendered.iter().flat_map(|image| image.of_image.messages().iter().chain(image.of_image.notes()));
        let warnings: Vec<String> = of_image.chain(of_picture).cloned().collect();
        if !warnings.is_empty() && ui.available_width() > LEAST_WIDTH {
            ui.separator();
            let line = RichText::new(warnings.join("; ")).weak();
            // Its own tooltip would be a second one.
            let line = Label::new(line).truncate().show_tooltip_when_elided(false);
            ui.add(line).on_hover_text(warnings.join("\n"));
        }
    }
}
