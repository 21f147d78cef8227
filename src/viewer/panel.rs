//! The side panel: camera, render settings, and the cost of each effect.

use egui::{ComboBox, DragValue, Grid, RichText, Slider, Ui};

use super::controls::Controls;
use super::false_colour::DisplayMode;
use super::keys::Action;
use super::navigate;
use super::painter::{Comparison, RenderedImage};
use super::request::{CameraSource, Opened, Settings};
use super::trace::Trace;
use crate::effects::{Decision, RayKind, id};
use crate::film::tone::{Exposure, MAX_EXPOSURE, ToneMap};
use crate::film::{ColourPipeline, FilterShape};
use crate::render::grouped;
use crate::scene::{Camera, Numerics, Projection};
use crate::shading::ShadingMode;
use crate::world::StandardView;

/// Data that the panel displays.
pub(crate) struct PanelContents<'a> {
    /// Opened files.
    pub opened: &'a Opened,
    /// Last image of each side.
    pub rendered: [Option<&'a RenderedImage>; 2],
    /// Errors between the two sides.
    pub comparison: Option<Comparison>,
}

impl PanelContents<'_> {
    fn displayed_camera(&self) -> Option<&Camera> {
        self.rendered[0].map(|rendered| &rendered.prepared.camera)
    }
}

/// Shows the panel.
pub(crate) fn show(ui: &mut Ui, contents: &PanelContents, controls: &mut Controls, trace: &mut Trace) {
    ui.add_space(8.0);
    camera(ui, contents, controls, trace);
    ui.separator();
    comparison(ui, contents, controls, trace);
    let rendered = contents.rendered[controls.side];
    render_settings(ui, controls, trace);
    ui.separator();
    if let Some(rendered) = rendered {
        effects(ui, rendered, controls.settings(), trace);
    }
}

/// Shows the buttons. Returns the action of a clicked button.
pub(crate) fn buttons(ui: &mut Ui, trace: &mut Trace) -> Option<Action> {
    let all = [
        ("Save picture", "as a PNG in this folder (Ctrl + S)", Action::SavePicture),
        ("Save camera", "as TOML, for a scene file (Ctrl + K)", Action::SaveCamera),
        ("Copy command", "the command line that renders this (Ctrl + L)", Action::CopyCommand),
        ("Keys", "what keys and mouse do (?)", Action::Help),
    ];
    let mut clicked = None;
    ui.separator();
    ui.horizontal_wrapped(|ui| {
        for (name, meaning, action) in all {
            let button = ui.button(name).on_hover_text(meaning);
            place(ui, trace, name, &button);
            if button.clicked() {
                clicked = Some(action);
            }
        }
    });
    clicked
}

fn camera(ui: &mut Ui, contents: &PanelContents, controls: &mut Controls, trace: &mut Trace) {
    let cameras = &contents.opened.scene.cameras;
    ui.horizontal(|ui| {
        let name = match &controls.camera_source {
            CameraSource::Scene(index) => cameras.get(*index).map_or("", |camera| &camera.name).to_owned(),
            CameraSource::Fitted(view) => view.name().to_owned(),
            CameraSource::Free(_) => "free".to_owned(),
        };
        let list = ComboBox::from_id_salt("camera").selected_text(name).show_ui(ui, |ui| {
            for (index, camera) in cameras.iter().enumerate() {
                if ui
                    .selectable_label(controls.camera_source == CameraSource::Scene(index), &camera.name)
                    .clicked()
                {
                    (controls.camera_source, controls.projection) = (CameraSource::Scene(index), None);
                }
            }
            if !cameras.is_empty() {
                ui.separator();
            }
            for view in StandardView::ALL {
                if ui
                    .selectable_label(controls.camera_source == CameraSource::Fitted(view), view.name())
                    .clicked()
                {
                    controls.fit_standard_view(view);
                }
            }
        });
        place(ui, trace, "camera", &list.response);
        let reset = ui.button("Reset").on_hover_text("back to where it was first seen from (R)");
        place(ui, trace, "reset", &reset);
        if reset.clicked() {
            controls.reset_camera();
        }
    });
    let Some(seen) = contents.displayed_camera() else { return };
    ui.horizontal(|ui| {
        for projection in [Projection::Perspective, Projection::Orthographic] {
            let button = ui.selectable_label(seen.projection == projection, projection.name());
            place(ui, trace, projection.name(), &button.clone().on_hover_text("Enter"));
            if button.clicked() {
                controls.project(projection, Some(seen));
            }
        }
    });
    let mut degrees = navigate::field_of_view(seen).to_degrees();
    let slider =
        ui.add(Slider::new(&mut degrees, 1.0..=150.0).text("field of view").suffix("°").logarithmic(true));
    place(ui, trace, "field of view", &slider);
    // A slider that gets the focus parses its displayed text, which is rounded, and reports a change.
    let before = navigate::field_of_view(seen).to_degrees();
    if slider.changed() && (degrees - before).abs() > 1e-3 * before {
        controls.navigate(Some(seen), |camera| navigate::set_field_of_view(camera, degrees.to_radians()));
    }
    let shown = ComboBox::from_label("shown").selected_text(controls.display_mode.name()).show_ui(ui, |ui| {
        for shown in DisplayMode::ALL {
            ui.selectable_value(&mut controls.display_mode, shown, shown.name());
        }
    });
    place(ui, trace, "shown", &shown.response);
}

/// Writes the rectangle of a control to the trace, for scripts.
fn place(ui: &Ui, trace: &mut Trace, name: &str, response: &egui::Response) {
    trace.place(name, response.rect, ui.ctx().pixels_per_point());
}

fn comparison(ui: &mut Ui, contents: &PanelContents, controls: &mut Controls, trace: &mut Trace) {
    ui.horizontal(|ui| {
        let mut compares = controls.sides.len() > 1;
        let check =
            ui.checkbox(&mut compares, "Compare").on_hover_text("beside a second setting (X); drag the line");
        place(ui, trace, "compare", &check);
        if check.changed() {
            controls.switch_comparison();
        }
        if controls.sides.len() > 1 {
            for (side, name) in ["left", "right"].into_iter().enumerate() {
                let button = ui.selectable_label(controls.side == side, name);
                place(ui, trace, name, &button);
                if button.clicked() {
                    controls.side = side;
                }
            }
        }
    });
    if controls.sides.len() < 2 {
        return;
    }
    for (rendered, name) in contents.rendered.iter().zip(["left", "right"]) {
        if let Some(rendered) = rendered {
            ui.label(format!("{name}: {}", progress_text(rendered)));
        }
    }
    match contents.comparison {
        Some(Comparison { max, rmse, flip }) => {
            ui.label(format!("apart: FLIP {flip:.4}, RMSE {rmse:.2e}, max {max:.2e}"));
        }
        None => {
            ui.label(RichText::new("apart: …").weak());
        }
    }
}

fn render_settings(ui: &mut Ui, controls: &mut Controls, trace: &mut Trace) {
    let settings = controls.settings();
    choice(ui, trace, "shading", &mut settings.choices.shading, &ShadingMode::ALL, ShadingMode::name);
    choice(ui, trace, "numerics", &mut settings.numerics, &Numerics::ALL, Numerics::name);
    let pipelines = [ColourPipeline::Display, ColourPipeline::U8, ColourPipeline::Linear];
    choice(ui, trace, "colour", &mut settings.pipeline, &pipelines, ColourPipeline::name);
    if settings.pipeline == ColourPipeline::Linear {
        let mut map = settings.display.tone_map.unwrap_or_default();
        choice(ui, trace, "tone map", &mut map, &ToneMap::ALL, ToneMap::name);
        if settings.display.tone_map.unwrap_or_default() != map {
            settings.display.tone_map = Some(map);
        }
        exposure(ui, trace, &mut settings.display.exposure);
    }
    let sampling = &mut settings.choices.sampling;
    let mut samples = if sampling.is_wanted() { sampling.max_samples() } else { 1 };
    ui.horizontal(|ui| {
        let drag = ui.add(DragValue::new(&mut samples).range(1..=crate::scene::MAX_SAMPLES).speed(0.2));
        place(ui, trace, "samples", &drag);
        if drag.changed() {
            sampling.samples = Some(samples);
        }
        ui.label("samples a pixel");
    });
    if samples > 1 {
        let shape = sampling.shape_and_radius().0;
        let mut chosen = shape;
        choice(ui, trace, "filter", &mut chosen, &FilterShape::ALL, FilterShape::name);
        if chosen != shape {
            (sampling.filter, sampling.filter_radius) = (Some(chosen), None);
        }
    }
}

/// A slider for a fixed exposure, and a checkbox for the automatic one.
fn exposure(ui: &mut Ui, trace: &mut Trace, exposure: &mut Option<Exposure>) {
    ui.horizontal(|ui| {
        let mut is_auto = *exposure == Some(Exposure::Auto);
        let mut ev = if let Some(Exposure::Ev(ev)) = exposure { *ev } else { 0.0 };
        let range = -MAX_EXPOSURE..=MAX_EXPOSURE;
        let drag = ui.add_enabled(!is_auto, DragValue::new(&mut ev).range(range).speed(0.02).max_decimals(2));
        place(ui, trace, "exposure", &drag);
        if drag.changed() {
            *exposure = Some(Exposure::Ev(ev));
        }
        ui.label("EV");
        let check = ui.checkbox(&mut is_auto, "auto exposure");
        place(ui, trace, "auto exposure", &check);
        if check.changed() {
            *exposure = Some(if is_auto { Exposure::Auto } else { Exposure::Ev(0.0) });
        }
    });
}

fn choice<T: PartialEq + Copy>(
    ui: &mut Ui,
    trace: &mut Trace,
    label: &str,
    value: &mut T,
    all: &[T],
    name: impl Fn(T) -> &'static str,
) {
    let list = ComboBox::from_label(label).selected_text(name(*value)).show_ui(ui, |ui| {
        for &other in all {
            ui.selectable_value(value, other, name(other));
        }
    });
    place(ui, trace, label, &list.response);
}

fn effects(ui: &mut Ui, rendered: &RenderedImage, settings: &mut Settings, trace: &mut Trace) {
    let statistics = &rendered.statistics;
    Grid::new("effects").num_columns(3).spacing([14.0, 4.0]).striped(true).show(ui, |ui| {
        ui.label(RichText::new("effect").weak());
        ui.label(RichText::new("rays").weak());
        ui.label(RichText::new("thread ms").weak());
        ui.end_row();
        ui.label("every picture");
        ui.label(count(statistics.rays(RayKind::PRIMARY).cast));
        let base = statistics.stages.iter().filter(|stage| stage.effect.is_none()).map(|stage| stage.time);
        ui.label(milliseconds(base.sum()));
        ui.end_row();
        for (decision, can) in &rendered.prepared.decisions {
            effect(ui, decision, *can, settings, trace);
            let cost =
                statistics.effect_costs.iter().find(|cost| cost.effect == decision.effect && decision.on);
            ui.label(cost.filter(|cost| cost.rays > 0).map_or(String::new(), |cost| count(cost.rays)));
            ui.label(cost.and_then(|cost| cost.time).map_or(String::new(), milliseconds));
            ui.end_row();
        }
    });
    if rendered.prepared.decisions.iter().any(|(decision, _)| decision.effect == id::GLAZE && decision.on) {
        let most = settings.value(id::GLAZE).and_then(|value| value.parse::<u32>().ok());
        let mut bounces = most.unwrap_or(0);
        ui.horizontal(|ui| {
            let drag =
                ui.add(DragValue::new(&mut bounces).range(0..=64).speed(0.05).custom_formatter(|n, _| {
                    if n == 0.0 { "as the materials say".into() } else { format!("{n}") }
                }));
            place(ui, trace, "bounces", &drag);
            if drag.changed() {
                let value = (bounces > 0).then(|| bounces.to_string());
                settings.set(id::GLAZE, value.as_deref());
            }
            ui.label("bounces at most");
        });
    }
}

/// Shows an effect's checkbox. `can` is whether the scene uses the effect; otherwise the checkbox is disabled.
fn effect(ui: &mut Ui, decision: &Decision, can: bool, settings: &mut Settings, trace: &mut Trace) {
    // A change that is not rendered yet is already displayed.
    let is_without = settings.choices.without.iter().any(|name| *name == decision.effect.name());
    let has =
        settings.choices.with.iter().any(|typed| typed.split('=').next() == Some(decision.effect.name()));
    let mut on = can && (has || decision.on && !is_without);
    let check = ui.add_enabled(can, egui::Checkbox::new(&mut on, decision.effect.name()));
    let check = check.on_hover_text(&decision.why).on_disabled_hover_text(&decision.why);
    place(ui, trace, &format!("effect {}", decision.effect), &check);
    if check.changed() {
        settings.switch(decision.effect, on);
    }
}

/// Names of the settings, one entry each.
pub(crate) fn setting_names(settings: &Settings) -> Vec<String> {
    let Settings { choices, numerics, pipeline, display, headlight } = settings;
    let sampling = choices.sampling;
    let samples = if sampling.is_wanted() { sampling.max_samples() } else { 1 };
    let mut words = vec![
        choices.shading.name().to_owned(),
        numerics.name().into(),
        pipeline.name().into(),
        if samples == 1 { "1 sample".into() } else { format!("{samples} samples") },
    ];
    if samples > 1 {
        words.push(sampling.shape_and_radius().0.name().into());
    }
    let display = display.in_pipeline(*pipeline);
    words.extend(display.exposure().map(|exposure| format!("exposure {exposure}")));
    words.extend(display.tone_map().map(|map| map.name().to_owned()));
    if !headlight {
        words.push("no headlight".into());
    }
    words.extend(choices.with.iter().map(|effect| format!("with {effect}")));
    words.extend(choices.without.iter().map(|effect| format!("without {effect}")));
    words
}

/// Size, samples and render time of an image, in one line.
pub(crate) fn progress_text(rendered: &RenderedImage) -> String {
    let [width, height] = rendered.image.size;
    let time = milliseconds(rendered.time);
    match (rendered.samples, rendered.factor) {
        ((taken, most), 1) if most > 1 => format!("{width} x {height}, {taken} of {most} samples, {time} ms"),
        _ => format!("{width} x {height}, {time} ms"),
    }
}

fn milliseconds(time: std::time::Duration) -> String {
    format!("{:.1}", time.as_secs_f64() * 1e3)
}

/// The number with groups of thousands separated by spaces.
fn count(number: u64) -> String {
    grouped(number, ' ')
}
