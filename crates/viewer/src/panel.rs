//! The side panel: camera, options of the picture, and the cost of each effect.

mod light;
mod look;
mod options;

use egui::{Align, CollapsingHeader, ComboBox, DragValue, Grid, Layout, RichText, Slider, Ui};

use super::controls::Controls;
use super::false_colour::DisplayMode;
use super::keys::Action;
use super::painter::RenderedImage;
use super::request::{CameraSource, Opened};
use super::{elided, navigate};
use kiln::effects::{Decision, EFFECTS, RayKind};
use kiln::error::printable;
use kiln::job::{RenderSettings, RoundingError};
use kiln::render::HAS_THREAD_TIME;
use kiln::render::grouped;
use kiln::scene::{Camera, ClipChoice, Projection, Scene, Shape};
use kiln::world::StandardView;
use options::{
    APERTURE, BOUNCES, CLIP, CULL, FILTER, GROUND, LIST_LENGTH, NOISE, OptionControl, SAMPLES, SHADING,
    SMOOTH, Shown, TONE_MAP, TRANSPORT, UP, VARIANT, WIDTH,
};

/// Shows the panel of the opened files and the last image. Returns the action that was chosen.
pub(crate) fn show(
    ui: &mut Ui,
    opened: &Opened,
    rendered: Option<&RenderedImage>,
    controls: &mut Controls,
) -> Option<Action> {
    ui.add_space(8.0);
    camera(ui, opened, rendered, controls);
    reading(ui, opened, controls);
    let scene = opened.scene();
    let (start, mut settings) = (controls.start_settings().clone(), controls.settings.clone());
    let shown = Shown::new(&settings, rendered, scene);
    let rows = |ui: &mut Ui, settings: &mut RenderSettings, rows: &[&OptionControl]| {
        rows.iter().for_each(|row| row.show(ui, &shown, &start, settings));
    };
    let light = section(ui, "Light", |ui| light::show(ui, scene, &shown, &start, &mut settings));
    section(ui, "Look", |ui| {
        look::background(ui, scene, &mut settings.picture);
        look::draft(ui, scene, &mut settings);
        rows(ui, &mut settings, &[GROUND, CULL, SHADING, TONE_MAP]);
        look::exposure(ui, &shown, &mut settings.picture);
        rows(ui, &mut settings, &[APERTURE]);
    });
    section(ui, "Quality", |ui| {
        rows(ui, &mut settings, &[SAMPLES, NOISE, FILTER, TRANSPORT, BOUNCES]);
    });
    section(ui, "Effects", |ui| {
        if let Some(rendered) = rendered {
            effects(ui, rendered, &mut settings);
        }
    });
    controls.settings = settings;
    light.flatten()
}

/// A part of the panel that can be closed. Returns what `contents` returns while it is open.
fn section<T>(ui: &mut Ui, title: &str, contents: impl FnOnce(&mut Ui) -> T) -> Option<T> {
    ui.separator();
    CollapsingHeader::new(RichText::new(title).strong())
        .default_open(true)
        .show_unindented(ui, contents)
        .body_returned
}

/// Shows the buttons. Returns the action of a clicked button.
pub(crate) fn buttons(ui: &mut Ui) -> Option<Action> {
    let all = [
        (
            "Open file",
            "a scene, a mesh, a glTF file, or an .hdr or .exr environment (Ctrl + O); files can be dropped, too",
            Action::Open,
        ),
        ("Save picture", "as a PNG in this folder (Ctrl + S)", Action::SavePicture),
        ("Save camera", "as TOML, for a scene file (Ctrl + K)", Action::SaveCamera),
        ("Copy command", "the command line that renders this (Ctrl + L)", Action::CopyCommand),
        ("Keys", "what keys and mouse do (?)", Action::Help),
    ];
    let mut clicked = None;
    ui.horizontal_wrapped(|ui| {
        for (name, meaning, action) in all {
            let button = ui.button(name).on_hover_text(meaning);
            if button.clicked() {
                clicked = Some(action);
            }
        }
    });
    clicked
}

fn camera(ui: &mut Ui, opened: &Opened, rendered: Option<&RenderedImage>, controls: &mut Controls) {
    let cameras = &opened.scene().cameras;
    ui.horizontal(|ui| {
        let name = match &controls.camera_source {
            CameraSource::Scene(index) => {
                cameras.get(*index).map_or("".into(), |camera| printable(&camera.name)).into_owned()
            }
            CameraSource::Fitted(view) | CameraSource::FittedAt(view, _) => view.name().to_owned(),
            CameraSource::Free(_) => "free".to_owned(),
        };
        let list = ComboBox::from_id_salt("camera").width(WIDTH).selected_text(elided(&name, LIST_LENGTH));
        let list = list.show_ui(ui, |ui| {
            for (index, camera) in cameras.iter().enumerate() {
                if ui
                    .selectable_label(
                        controls.camera_source == CameraSource::Scene(index),
                        printable(&camera.name),
                    )
                    .clicked()
                {
                    controls.set_camera(CameraSource::Scene(index));
                    controls.projection = None;
                }
            }
            if !cameras.is_empty() {
                ui.separator();
            }
            for view in StandardView::ALL {
                if ui.selectable_label(name == view.name(), view.name()).clicked() {
                    controls.fit_standard_view(view);
                }
            }
        });
        list.response.on_hover_text(format!("the camera: {name}"));
        let reset = ui.button("Reset").on_hover_text("back to where it was first seen from (R)");
        if reset.clicked() {
            controls.reset_camera();
        }
    });
    let Some(seen) = rendered.map(|rendered| &rendered.prepared.camera) else { return };
    ui.horizontal(|ui| {
        for projection in [Projection::Perspective, Projection::Orthographic] {
            let button = ui.selectable_label(seen.projection == projection, projection.name());
            let meaning = format!("{} (Enter)", projection.meaning());
            if button.on_hover_text(meaning).clicked() {
                controls.project(projection, Some(seen));
            }
        }
    });
    // A panorama shows all directions.
    if seen.projection.aspect().is_none() {
        extent(ui, controls, seen);
    }
    let list = ComboBox::from_label("display").width(WIDTH).selected_text(controls.display_mode.name());
    let list = list.show_ui(ui, |ui| {
        for shown in DisplayMode::ALL {
            let entry = ui.selectable_value(&mut controls.display_mode, shown, shown.name());
            entry.on_hover_text(shown.meaning());
        }
    });
    list.response.on_hover_text("the picture, or what is known of each pixel as colours with a legend (V)");
}

/// The field of view of a perspective camera, the height that an orthographic one sees.
fn extent(ui: &mut Ui, controls: &mut Controls, seen: &Camera) {
    let is_central = seen.projection.is_central();
    let (before, meaning) = match is_central {
        true => (
            navigate::field_of_view(seen).to_degrees(),
            "the vertical angle that is seen: small as through a telephoto lens, large to show a whole room",
        ),
        false => (seen.view_height, "the height that is seen, in units of the scene"),
    };
    let mut value = before;
    let control = ui.horizontal(|ui| {
        if is_central {
            ui.add(Slider::new(&mut value, 1.0..=150.0).text("field of view").suffix("°").logarithmic(true))
        } else {
            let range = f64::MIN_POSITIVE..=f64::MAX;
            let drag = ui.add(DragValue::new(&mut value).range(range).speed(before * 0.01));
            drag | ui.label("height")
        }
    });
    let control = control.inner.on_hover_text(meaning);
    // A control that gets the focus parses its displayed text, which is rounded, and reports a change.
    if control.changed() && (value - before).abs() > 1e-3 * before {
        controls.navigate(Some(seen), |camera| match is_central {
            true => navigate::set_field_of_view(camera, value.to_radians()),
            false => navigate::zoom(camera, before / value),
        });
    }
}

/// The clips that are played, and options of reading files. A change reads the files again.
fn reading(ui: &mut Ui, opened: &Opened, controls: &mut Controls) {
    let Scene { clips, animation, has_settings, variants, objects, .. } = opened.scene();
    let own = &opened.scene().import_options;
    let mut reading = own.clone();
    let plays_tracks = animation.as_ref().is_some_and(|animation| animation.clips.is_empty());
    let played = own.clip().find(clips);
    if !played.is_empty() && !plays_tracks {
        let names: Vec<&str> = played.iter().map(|clip| clip.name.as_str()).collect();
        let text = elided(&printable(&names.join(", ")), LIST_LENGTH);
        let list = ComboBox::from_label("clip").width(WIDTH).selected_text(text);
        let list = list.show_ui(ui, |ui| {
            let are_all = clips.len() > 1 && played.len() == clips.len();
            if clips.len() > 1 && ui.selectable_label(are_all, ClipChoice::ALL).clicked() {
                (reading.clips, reading.time) = (vec![ClipChoice::Named(ClipChoice::ALL.to_owned())], None);
                controls.restart();
            }
            for clip in clips {
                let is_played = !are_all && played.iter().any(|played| std::ptr::eq(*played, clip));
                let entry = ui.selectable_label(is_played, printable(&clip.name));
                if entry.on_hover_text(format!("{:.2} s", clip.duration)).clicked() {
                    (reading.clips, reading.time) = (vec![ClipChoice::Index(clip.index)], None);
                    controls.restart();
                }
            }
        });
        CLIP.explain(list.response, None);
    }
    let start = controls.start_reading().clone();
    let up = reading.up;
    // A scene file has values for each mesh.
    let of_files = |control: &OptionControl| if *has_settings { control.of_files() } else { *control };
    let has_meshes = objects.iter().any(|object| !matches!(object.shape, Shape::Analytic(_)));
    let idle = (!has_meshes).then_some("Only meshes are turned and smoothed.");
    of_files(UP).show_reading(ui, &[], &start, &mut reading, idle);
    if reading.up != up {
        controls.reset_camera();
    }
    of_files(SMOOTH).show_reading(ui, &[], &start, &mut reading, idle);
    if !variants.is_empty() {
        VARIANT.show_reading(ui, variants, &start, &mut reading, None);
    }
    if reading != *own {
        controls.reading = Some(reading);
    }
}

fn effects(ui: &mut Ui, rendered: &RenderedImage, settings: &mut RenderSettings) {
    let (spent, decisions) = (&rendered.spent, &rendered.prepared.decisions);
    Grid::new("effects").num_columns(3).spacing([14.0, 4.0]).striped(true).show(ui, |ui| {
        ui.label(RichText::new("effect").weak());
        let rays = "rays that the effect has cast in all passes of this picture";
        right(ui, RichText::new("rays").weak()).on_hover_text(rays);
        let (name, meaning) = match HAS_THREAD_TIME {
            true => ("CPU time", "processor time of all threads together"),
            false => ("time", "time of all threads together, with that of other programs"),
        };
        let meaning = format!(
            "{meaning}, in all passes of this picture; that of rays behind transparent surfaces is \
             estimated from their number"
        );
        right(ui, RichText::new(name).weak()).on_hover_text(meaning);
        ui.end_row();
        ui.label("base")
            .on_hover_text("camera rays, their closest hits and shading, which every picture has");
        right(ui, count(spent.rays(RayKind::PRIMARY).cast));
        let base = spent.stages.iter().filter(|stage| stage.effect.is_none()).map(|stage| stage.time);
        right(ui, duration(base.sum()));
        ui.end_row();
        for (decision, _) in decisions.iter().filter(|(_, can)| *can) {
            effect(ui, decision, true, settings);
            let cost = spent.effect_costs.iter().find(|cost| cost.effect == decision.effect && decision.on);
            right(ui, cost.filter(|cost| cost.rays > 0).map_or(String::new(), |cost| count(cost.rays)));
            right(ui, cost.and_then(|cost| cost.time).map_or(String::new(), duration));
            ui.end_row();
        }
    });
    if let Some(RoundingError { text, option, .. }) =
        rendered.prepared.job().rounding_error().filter(|_| rendered.is_last)
    {
        let option = format!(
            "8 bits: {option}\n`kiln explain --measure` also measures noise, light left out and tier"
        );
        ui.label(RichText::new(text).weak()).on_hover_text(option);
    }
    CollapsingHeader::new("effects without use in this scene").show(ui, |ui| {
        for (decision, _) in decisions.iter().filter(|(_, can)| !can) {
            effect(ui, decision, false, settings);
        }
    });
}

/// Shows an effect's checkbox. `can` is whether the scene uses the effect; otherwise the checkbox is disabled.
fn effect(ui: &mut Ui, decision: &Decision, can: bool, settings: &mut RenderSettings) {
    // A change that is not rendered yet is already displayed.
    let is_without = settings.without.iter().any(|name| *name == decision.effect.name());
    let has = settings.with.iter().any(|typed| typed.split('=').next() == Some(decision.effect.name()));
    let mut on = can && (has || decision.on && !is_without);
    let check = ui.add_enabled(can, egui::Checkbox::new(&mut on, decision.effect.name()));
    let meaning =
        EFFECTS.iter().find(|effect| effect.id == decision.effect).map_or("", |effect| effect.summary);
    let text = format!("{meaning}\n{}", decision.why);
    let check = check.on_hover_text(&text).on_disabled_hover_text(&text);
    if check.changed() {
        settings.switch(decision.effect, on);
    }
}

/// Size, samples and time of an image, in one line.
pub(crate) fn progress_text(rendered: &RenderedImage) -> String {
    let [width, height] = rendered.image.size;
    let time = duration(rendered.time);
    match (rendered.samples, rendered.factor) {
        ((taken, most), 1) if most > 1 => {
            let samples = match rendered.prepared.job().plan.is_adaptive() {
                true => format!("about {taken} of at most {most} samples a pixel"),
                false => format!("{taken} of {most} samples"),
            };
            format!("{width} x {height}, {samples}, {time}")
        }
        _ => format!("{width} x {height}, {time}"),
    }
}

/// A time with its unit: below a second in milliseconds.
fn duration(time: std::time::Duration) -> String {
    let seconds = time.as_secs_f64();
    if seconds < 0.99995 { format!("{:.1} ms", seconds * 1e3) } else { format!("{seconds:.1} s") }
}

/// A label at the right of a grid's column.
fn right(ui: &mut Ui, text: impl Into<egui::WidgetText>) -> egui::Response {
    ui.with_layout(Layout::right_to_left(Align::Center), |ui| ui.label(text)).inner
}

/// The number with groups of thousands separated by spaces.
fn count(number: u64) -> String {
    grouped(number, ' ')
}

#[cfg(test)]
mod tests {
    use super::duration;
    use std::time::Duration;

    #[test]
    fn times_have_units() {
        let texts = [400, 12_345_678, 999_940_000, 999_960_000, 74_500_000_000];
        let texts = texts.map(|nanoseconds| duration(Duration::from_nanos(nanoseconds)));
        assert_eq!(texts, ["0.0 ms", "12.3 ms", "999.9 ms", "1.0 s", "74.5 s"]);
    }
}
