//! A frame of the window, part by part.

use std::time::Duration;

use egui::{Context, Panel, RichText, ScrollArea, Ui, ViewportCommand};

use super::{App, inspector, timeline};
use crate::effects::RayKind;
use crate::viewer::painter::Painted;
use crate::viewer::panel::{self, Shows};
use crate::viewer::{overlay, timeline as bar};

/// Width of the panel, in points.
pub(super) const PANEL: f32 = 300.0;

impl App {
    /// Measures pauses, where that is what the window is for.
    pub(super) fn measure(&mut self, context: &Context) {
        let App { pauses, trace, .. } = self;
        let Some(report) = pauses.as_mut().and_then(|pauses| pauses.frame(context, trace)) else { return };
        if let Ok(mut own) = self.report.lock() {
            own.printed = Some(report);
        }
        self.pauses = None;
        context.send_viewport_cmd(ViewportCommand::Close);
    }

    /// Goes on with an animation that plays, once the last frame of it was painted.
    pub(super) fn play(&mut self, context: &Context) {
        let (Some(controls), Some(opened)) = (&mut self.controls, &self.opened) else { return };
        let (Some(_), Some(timeline), Some(animation)) =
            (controls.playing, timeline(opened), &opened.scene.animation)
        else {
            return;
        };
        let newest = self.ordered.as_ref().map_or(0, |(_, number)| *number);
        if self.canvas.painted(0).is_some_and(|painted| painted.order == newest) {
            controls.advance(&timeline, animation.duration);
        }
        context.request_repaint_after(Duration::from_millis(5));
    }

    pub(super) fn panels(&mut self, ui: &mut Ui) {
        Panel::bottom("status").show(ui, |ui| self.status(ui));
        let App { controls, opened, canvas, comparison, trace, shows, .. } = self;
        let (Some(controls), Some(opened)) = (controls, opened) else { return };
        let mut asked = None;
        if shows.panel {
            Panel::right("panel").exact_size(PANEL).show(ui, |ui| {
                ScrollArea::vertical().show(ui, |ui| {
                    let painted = [canvas.painted(0), canvas.painted(1)];
                    panel::show(ui, &Shows { opened, painted, comparison: *comparison }, controls, trace);
                    asked = panel::buttons(ui, trace);
                });
            });
        }
        if let (Some(timeline), Some(animation)) = (timeline(opened), &opened.scene.animation) {
            Panel::bottom("timeline").show(ui, |ui| {
                bar::show(ui, &timeline, animation.duration, controls, trace);
            });
        }
        if let Some(action) = asked {
            self.act(&ui.ctx().clone(), action);
        }
    }

    /// The picture, and what lies over it.
    pub(super) fn picture(&mut self, ui: &mut Ui) {
        let context = ui.ctx().clone();
        let rect = ui.available_rect_before_wrap();
        self.notice.take_if(|notice| notice.is_over(&context) || overlay::notice(&context, rect, notice));
        let Some(controls) = &mut self.controls else { return };
        let (size, done) = self.canvas.show(ui, controls);
        let (split, compares) = (controls.split, controls.sides.len() > 1);
        let rect = self.canvas.rect().unwrap_or(rect);
        self.trace.place("canvas", rect, context.pixels_per_point());
        self.click(&done);
        if compares {
            overlay::sides(&context, rect, split, &self.side_names());
        }
        if let Some(legend) = self.canvas.painted(0).and_then(|painted| painted.legend.as_ref()) {
            overlay::legend(&context, rect, legend);
        }
        if let Some((of, found)) = &self.inspection {
            if let Some(prepared) = self.canvas.prepared(0) {
                inspector::draw(&ui.painter_at(rect), rect, prepared, of, found);
            }
            if !inspector::window(&context, rect, found) {
                self.inspection = None;
            }
        }
        if !self.fit_window(&context, size) {
            self.order(&context, size);
        }
    }

    /// What was painted last, and what there is to say of it and of the files.
    fn status(&self, ui: &mut Ui) {
        ui.horizontal(|ui| {
            let painted = self.canvas.painted(0);
            ui.label(match (painted, self.is_building) {
                (_, true) => "building".to_owned(),
                (Some(painted), _) => panel::work(painted),
                (None, _) if self.loader.is_reading() || self.opened.is_some() => "loading".to_owned(),
                (None, _) => "nothing to show yet".to_owned(),
            });
            for what in painted.map(odd).into_iter().flatten().chain(self.warnings.iter().cloned()) {
                ui.separator();
                ui.label(RichText::new(what).weak());
            }
        });
    }

    /// What the sides of a comparison differ in.
    fn side_names(&self) -> [String; 2] {
        let Some(controls) = &self.controls else { return Default::default() };
        let [a, b] = [0, 1].map(|side| controls.sides.get(side).map(panel::in_words).unwrap_or_default());
        let only = |own: &[String], other: &[String]| {
            let mut own: Vec<String> = own.iter().filter(|word| !other.contains(word)).cloned().collect();
            let lacks = other.iter().filter_map(|word| word.strip_prefix("without "));
            own.extend(lacks.map(|effect| format!("with {effect}")));
            own.dedup();
            if own.is_empty() { "the same".to_owned() } else { own.join(", ") }
        };
        [only(&a, &b), only(&b, &a)]
    }
}

/// What is odd about a picture.
fn odd(painted: &Painted) -> Vec<String> {
    let mut odd = Vec::new();
    let world = &painted.prepared.job.world;
    if world.too_small > 0 {
        let tier = world.numerics().name();
        odd.push(format!("{} sphere(s) with a radius that is 0 in `{tier}`; left out", world.too_small));
    }
    let (count, places) = &painted.statistics.non_finite;
    if let (1.., Some((x, y))) = (*count, places.first()) {
        odd.push(format!("{count} pixel(s) are not finite numbers, the first at ({x}, {y})"));
    }
    if painted.is_last && painted.statistics.rays(RayKind::PRIMARY).hit == 0 {
        odd.push("nothing is in the picture; F shows all of the scene".into());
    }
    odd
}
