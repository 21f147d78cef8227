//! The side panel: camera and look, further options of the picture, and the cost of each effect.

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
use kiln::effects::{Decision, EFFECTS, RayKind, id};
use kiln::error::printable;
use kiln::job::RenderSettings;
use kiln::render::{HAS_THREAD_TIME, grouped};
use kiln::scene::{Camera, ClipChoice, ImportOptions, Projection, Scene, Shape};
use kiln::world::StandardView;
use options::{
    APERTURE, BOUNCES, CLIP, CULL, FILTER, GROUND, LIST_LENGTH, NOISE, OCCLUSION, OptionControl, SAMPLES,
    SHADING, SMOOTH, Shown, TONE_MAP, TRANSPORT, UP, VARIANT, WIDTH,
};

/// Shows the panel of the opened files and the last image. Returns the action that was chosen.
pub(crate) fn show(
    ui: &mut Ui,
    opened: &Opened,
    rendered: Option<&RenderedImage>,
    controls: &mut Controls,
) -> Option<Action> {
    ui.add_space(8.0);
    let (scene, own) = (opened.scene(), &opened.scene().import_options);
    let (start, mut settings) = (controls.start_settings().clone(), controls.settings.clone());
    let (shown, mut reading) = (Shown::new(&settings, rendered, scene), own.clone());
    camera(ui, scene, rendered, controls);
    clips(ui, scene, &mut reading, controls);
    ui.separator();
    let action = light::show(ui, scene, &shown, &start, &mut settings);
    look::exposure(ui, &shown, &mut settings.picture);
    look::background(ui, scene, &mut settings.picture);
    GROUND.show(ui, &shown, &start, &mut settings);
    section(ui, "More", |ui| {
        if let Some(rendered) = rendered.filter(|one| one.prepared.camera.projection.aspect().is_none()) {
            extent(ui, controls, &rendered.prepared.camera);
        }
        files(ui, scene, &mut reading, controls);
        look::draft(ui, scene, &mut settings);
        for row in [CULL, OCCLUSION, TONE_MAP, APERTURE, SAMPLES, NOISE, FILTER, SHADING, TRANSPORT, BOUNCES]
        {
            row.show(ui, &shown, &start, &mut settings);
        }
    });
    section(ui, "Cost", |ui| rendered.into_iter().for_each(|rendered| cost(ui, rendered, &mut settings)));
    controls.settings = settings;
    if reading != *own {
        controls.reading = Some(reading);
    }
    action
}

/// A part of the panel that is closed at first.
fn section(ui: &mut Ui, title: &str, contents: impl FnOnce(&mut Ui)) {
    ui.separator();
    CollapsingHeader::new(RichText::new(title).strong()).show_unindented(ui, contents);
}

/// Shows the buttons. Returns the action of a clicked button.
pub(crate) fn buttons(ui: &mut Ui) -> Option<Action> {
    let all = [
        (
            "Open file",
            "a scene, a mesh, a glTF file, or an .hdr or .exr environment (Ctrl + O); files can be dropped, too",
            Action::Open,
        ),
        ("Save picture", "under a name of your choice (Ctrl + S)", Action::SavePicture),
        ("Copy command", "the command line that renders this (Ctrl + L)", Action::CopyCommand),
        ("Keys", "what keys and mouse do (?)", Action::Help),
    ];
    let mut clicked = None;
    ui.horizontal_wrapped(|ui| {
        for (name, meaning, action) in all {
            if ui.button(name).on_hover_text(meaning).clicked() {
                clicked = Some(action);
            }
        }
    });
    clicked
}

fn camera(ui: &mut Ui, scene: &Scene, rendered: Option<&RenderedImage>, controls: &mut Controls) {
    let cameras = &scene.cameras;
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
                let source = CameraSource::Scene(index);
                let entry = ui.selectable_label(controls.camera_source == source, printable(&camera.name));
                if entry.clicked() {
                    controls.set_camera(source);
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
        if ui.button("Fit").on_hover_text("all of the scene in the picture (F)").clicked() {
            controls.fit_standard_view(StandardView::Auto);
        }
        if ui.button("Reset").on_hover_text("back to where it was first seen from (R)").clicked() {
            controls.reset_camera();
        }
    });
    ui.horizontal(|ui| {
        let seen = rendered.map(|rendered| &rendered.prepared.camera);
        for projection in [Projection::Perspective, Projection::Orthographic] {
            let is_seen = seen.is_some_and(|camera| camera.projection == projection);
            let button = ui.selectable_label(is_seen, projection.name());
            if button.on_hover_text(format!("{} (Enter)", projection.meaning())).clicked() {
                controls.project(projection, seen);
            }
        }
    });
    let list = ComboBox::from_label("display").width(WIDTH).selected_text(controls.display_mode.name());
    let list = list.show_ui(ui, |ui| {
        for mode in DisplayMode::ALL {
            let entry = ui.selectable_value(&mut controls.display_mode, mode, mode.name());
            entry.on_hover_text(mode.meaning());
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

/// The clips that are played, if the files have any. A change reads the files again.
fn clips(ui: &mut Ui, scene: &Scene, reading: &mut ImportOptions, controls: &mut Controls) {
    let clips = &scene.clips;
    let plays_tracks = scene.animation.as_ref().is_some_and(|animation| animation.clips.is_empty());
    let played = scene.import_options.clip().find(clips);
    if played.is_empty() || plays_tracks {
        return;
    }
    let names: Vec<&str> = played.iter().map(|clip| clip.name.as_str()).collect();
    let text = elided(&printable(&names.join(", ")), LIST_LENGTH);
    let mut chosen = None;
    let list = ComboBox::from_label("clip").width(WIDTH).selected_text(text).show_ui(ui, |ui| {
        let are_all = clips.len() > 1 && played.len() == clips.len();
        if clips.len() > 1 && ui.selectable_label(are_all, ClipChoice::ALL).clicked() {
            chosen = Some(ClipChoice::Named(ClipChoice::ALL.to_owned()));
        }
        for clip in clips {
            let is_played = !are_all && played.iter().any(|played| std::ptr::eq(*played, clip));
            let entry = ui.selectable_label(is_played, printable(&clip.name));
            if entry.on_hover_text(format!("{:.2} s", clip.duration)).clicked() {
                chosen = Some(ClipChoice::Index(clip.index));
            }
        }
    });
    CLIP.explain(list.response);
    if let Some(clip) = chosen {
        (reading.clips, reading.time) = (vec![clip], None);
        controls.restart();
    }
}

/// Options of reading files.
fn files(ui: &mut Ui, scene: &Scene, reading: &mut ImportOptions, controls: &mut Controls) {
    let (start, up) = (controls.start_reading().clone(), reading.up);
    // A scene file has values for each mesh.
    let of_files = |control: &OptionControl| if scene.has_settings { control.of_files() } else { *control };
    if scene.objects.iter().any(|object| !matches!(object.shape, Shape::Analytic(_))) {
        of_files(UP).show_reading(ui, &[], &start, reading);
        of_files(SMOOTH).show_reading(ui, &[], &start, reading);
    }
    if reading.up != up {
        controls.reset_camera();
    }
    if !scene.variants.is_empty() {
        VARIANT.show_reading(ui, &scene.variants, &start, reading);
    }
}

/// Rays and time of the effects that the scene uses, each with its switch unless another control has it.
fn cost(ui: &mut Ui, rendered: &RenderedImage, settings: &mut RenderSettings) {
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
        right(ui, grouped(spent.rays(RayKind::PRIMARY).cast, ' '));
        let base = spent.stages.iter().filter(|stage| stage.effect.is_none()).map(|stage| stage.time);
        right(ui, duration(base.sum()));
        ui.end_row();
        for decision in decisions {
            effect(ui, decision, settings);
            let cost = spent.effect_costs.iter().find(|cost| cost.effect == decision.effect && decision.on);
            let rays = cost.filter(|cost| cost.rays > 0);
            right(ui, rays.map_or(String::new(), |cost| grouped(cost.rays, ' ')));
            right(ui, cost.and_then(|cost| cost.time).map_or(String::new(), duration));
            ui.end_row();
        }
    });
}

/// Shows an effect, with a check box unless controls of samples, light transport or lens switch it.
fn effect(ui: &mut Ui, decision: &Decision, settings: &mut RenderSettings) {
    let meaning =
        EFFECTS.iter().find(|effect| effect.id == decision.effect).map_or("", |effect| effect.summary);
    let text = format!("{meaning}\n{}", decision.why);
    let name = decision.effect.name();
    if [id::ANTIALIASING, id::ADAPTIVE, id::PATH, id::DEPTH_OF_FIELD].contains(&decision.effect) {
        ui.label(name).on_hover_text(text);
        return;
    }
    // A change that is not rendered yet is already displayed.
    let is_without = settings.without.iter().any(|typed| *typed == name);
    let has = settings.with.iter().any(|typed| typed.split('=').next() == Some(name));
    let mut on = has || decision.on && !is_without;
    if ui.checkbox(&mut on, name).on_hover_text(text).changed() {
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
