//! The side panel: camera, render settings, and the cost of each effect.

use std::path::Path;

use egui::{CollapsingHeader, ComboBox, DragValue, Grid, RichText, Slider, Ui};

use super::controls::Controls;
use super::false_colour::DisplayMode;
use super::help::{self, PanelOption, explain};
use super::keys::Action;
use super::painter::{Comparison, RenderedImage};
use super::request::{CameraSource, Opened};
use super::{elided, name_of, navigate};
use crate::bench::errors::of_rendered;
use crate::effects::{Decision, EFFECTS, RayKind, id};
use crate::error::printable;
use crate::film::tone::{Exposure, MAX_EXPOSURE, ToneMap};
use crate::film::{ColourPipeline, FilterShape};
use crate::job::{EnvironmentSettings, RenderSettings};
use crate::render::grouped;
use crate::scene::{
    Background, Camera, ClipChoice, ColourValue, Headlight, ImportOptions, Look, Numerics, OptionValue,
    PictureSettings, Projection, Rotation, Samples, Sampling, Scene, ShadingMode, UpAxis,
};
use crate::world::StandardView;

/// Characters of a name that a closed list shows.
const LIST_LENGTH: usize = 13;

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
    /// Samples per pixel of the left side, at most.
    fn samples_taken(&self) -> u32 {
        self.rendered[0].map_or(1, |rendered| rendered.prepared.job.plan_settings.sampling.samples_taken())
    }

    fn displayed_camera(&self) -> Option<&Camera> {
        self.rendered[0].map(|rendered| &rendered.prepared.camera)
    }
}

/// Shows the panel. Returns the action that was chosen.
pub(crate) fn show(ui: &mut Ui, contents: &PanelContents, controls: &mut Controls) -> Option<Action> {
    ui.add_space(8.0);
    camera(ui, contents, controls);
    ui.separator();
    comparison(ui, contents, controls);
    let rendered = contents.rendered[controls.side];
    let action = light(ui, contents, controls);
    ground_and_background(ui, contents, controls);
    reading(ui, contents.opened, controls);
    ui.separator();
    render_settings(ui, rendered, controls);
    ui.separator();
    if let Some(rendered) = rendered {
        effects(ui, rendered, controls.settings());
    }
    action
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

fn camera(ui: &mut Ui, contents: &PanelContents, controls: &mut Controls) {
    let cameras = &contents.opened.scene.cameras;
    ui.horizontal(|ui| {
        let name = match &controls.camera_source {
            CameraSource::Scene(index) => {
                cameras.get(*index).map_or("".into(), |camera| printable(&camera.name)).into_owned()
            }
            CameraSource::Fitted(view) => view.name().to_owned(),
            CameraSource::Free(_) => "free".to_owned(),
        };
        let list = ComboBox::from_id_salt("camera").selected_text(elided(&name, LIST_LENGTH));
        let list = list.show_ui(ui, |ui| {
            for (index, camera) in cameras.iter().enumerate() {
                if ui
                    .selectable_label(
                        controls.camera_source == CameraSource::Scene(index),
                        printable(&camera.name),
                    )
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
        list.response.on_hover_text(format!("the camera: {name}"));
        let reset = ui.button("Reset").on_hover_text("back to where it was first seen from (R)");
        if reset.clicked() {
            controls.reset_camera();
        }
    });
    let Some(seen) = contents.displayed_camera() else { return };
    ui.horizontal(|ui| {
        for projection in Projection::ALL {
            let button = ui.selectable_label(seen.projection == projection, projection.name());
            let key = if projection.is_switched() { " (Enter)" } else { "" };
            let meaning = format!("{}{key}", projection.meaning());
            if button.on_hover_text(meaning).clicked() {
                controls.project(projection, Some(seen));
            }
        }
    });
    // A panorama shows all directions.
    if seen.projection.aspect().is_none() {
        extent(ui, controls, seen);
    }
    let list = ComboBox::from_label("shown").selected_text(controls.display_mode.name()).show_ui(ui, |ui| {
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

fn comparison(ui: &mut Ui, contents: &PanelContents, controls: &mut Controls) {
    ui.horizontal(|ui| {
        let mut compares = controls.sides.len() > 1;
        let check =
            ui.checkbox(&mut compares, "Compare").on_hover_text("beside a second setting (X); drag the line");
        if check.changed() {
            controls.switch_comparison(contents.samples_taken());
        }
        if controls.sides.len() > 1 {
            for (side, name) in ["left", "right"].into_iter().enumerate() {
                let button = ui.selectable_label(controls.side == side, name);
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
            let label = ui.label(format!("apart: FLIP {flip:.4}, RMSE {rmse:.2e}, max {max:.2e}"));
            label.on_hover_text(
                "FLIP: how different the pictures look, from 0, the same, to 1\nRMSE: root of the mean squared \
                 difference of the values; white is 1\nmax: the largest difference of a value",
            );
        }
        None => {
            ui.label(RichText::new("apart: …").weak());
        }
    }
}

/// The light and its environment, as the options of `kiln render` choose them. Returns an action if a file is to be
/// chosen.
fn light(ui: &mut Ui, contents: &PanelContents, controls: &mut Controls) -> Option<Action> {
    let scene = &contents.opened.scene;
    let settings = controls.settings();
    let own = if scene.has_settings || !scene.lights.is_empty() { "the file's" } else { "studio" };
    let own = if settings.look(scene) == Look::Draft && own == "studio" { "draft" } else { own };
    let (before, typed) = (LightChoice::of(settings), settings.environment.environment.clone());
    let mut light = before;
    let file = typed.as_deref().filter(|_| before == LightChoice::Environment).map(Path::new);
    let text = file.map_or(before.name(own).to_owned(), name_of);
    let mut asks_for_file = false;
    let list = ComboBox::from_label("light").selected_text(elided(&text, LIST_LENGTH));
    let list = list.show_ui(ui, |ui| {
        for choice in LightChoice::ALL {
            let entry = ui.selectable_value(&mut light, choice, choice.name(own));
            let entry = entry.on_hover_text(choice.meaning());
            asks_for_file |= entry.clicked() && choice == LightChoice::Environment;
        }
    });
    list.response.on_hover_text(typed.as_deref().unwrap_or(before.meaning()));
    if asks_for_file {
        return Some(Action::Open);
    }
    let has_environment = scene.environment.is_some();
    if light != before {
        light.apply(settings);
        if !has_environment && settings.environment.environment.is_none() {
            settings.environment = EnvironmentSettings::default();
        }
    }
    if has_environment || settings.environment.environment.is_some() {
        let rotation = &mut settings.environment.environment_rotation;
        let own = scene.environment.as_ref().filter(|_| typed.is_none());
        let own = own.map_or(0.0, |environment| environment.rotation.to_degrees());
        let mut degrees = rotation.map_or(own, Rotation::get);
        let slider = ui.add(Slider::new(&mut degrees, -180.0..=180.0).text("rotation").suffix("°"));
        if explain(slider, help::ROTATION).changed() {
            *rotation = Some(Rotation::clamped(degrees));
        }
    }
    None
}

/// Boxes that show what the picture has, and change that alone.
fn ground_and_background(ui: &mut Ui, contents: &PanelContents, controls: &mut Controls) {
    let scene = &contents.opened.scene;
    let shown = contents.rendered[controls.side].map(|rendered| rendered.prepared.shown_settings());
    let settings = controls.settings();
    let mut is_draft = settings.look(scene) == Look::Draft;
    let of_files = RenderSettings { picture: PictureSettings::default(), ..settings.clone() };
    let can_be_studio = of_files.look(scene) == Look::Studio;
    ui.horizontal(|ui| {
        let picture = &mut settings.picture;
        let background = picture.background.or(scene.picture.background);
        let mut has_colour = background.is_some();
        let check = explain(ui.checkbox(&mut has_colour, "background"), help::BACKGROUND);
        let mut colour = match background {
            Some(Background::Colour(colour)) => colour.0,
            Some(Background::Transparent) => [0; 3],
            None => DEFAULT_BACKGROUND,
        };
        if check.changed() {
            picture.background = has_colour.then_some(Background::Colour(ColourValue(colour)));
        }
        if has_colour && ui.color_edit_button_srgb(&mut colour).changed() {
            picture.background = Some(Background::Colour(ColourValue(colour)));
        }
        let mut has_ground = picture.or(shown.unwrap_or_default()).ground == Some(true);
        let check = explain(ui.checkbox(&mut has_ground, "ground"), help::GROUND);
        if check.changed() {
            picture.ground = Some(has_ground);
        }
        let mut culls = picture.cull.or(scene.picture.cull) == Some(true);
        if explain(ui.checkbox(&mut culls, "cull"), help::CULL).changed() {
            picture.cull = Some(culls);
        }
        let meaning = "a fast preview: one sample a pixel, a headlight and a dark background (--draft)";
        if can_be_studio && ui.checkbox(&mut is_draft, "draft").on_hover_text(meaning).changed() {
            picture.look = is_draft.then_some(Look::Draft);
        }
    });
}

/// The clips that are played and the axis that points up. A change reads the files again.
fn reading(ui: &mut Ui, opened: &Opened, controls: &mut Controls) {
    let Scene { clips, animation, has_settings, .. } = &opened.scene;
    let own = opened.scene.import_options.clone();
    let (mut reading, mut chosen) = (own.reading.clone(), own.clips.clone());
    let plays_tracks = animation.as_ref().is_some_and(|animation| animation.clips.is_empty());
    let played = own.clip().find(clips);
    if !played.is_empty() && !plays_tracks {
        let names: Vec<&str> = played.iter().map(|clip| clip.name.as_str()).collect();
        let list =
            ComboBox::from_label("clip").selected_text(elided(&printable(&names.join(", ")), LIST_LENGTH));
        let list = list.show_ui(ui, |ui| {
            let are_all = clips.len() > 1 && played.len() == clips.len();
            if clips.len() > 1 && ui.selectable_label(are_all, ClipChoice::ALL).clicked() {
                (chosen, reading.time) = (vec![ClipChoice::Named(ClipChoice::ALL.to_owned())], None);
                controls.restart();
            }
            for clip in clips {
                let is_played = !are_all && played.iter().any(|played| std::ptr::eq(*played, clip));
                let entry = ui.selectable_label(is_played, printable(&clip.name));
                if entry.on_hover_text(format!("{:.2} s", clip.duration)).clicked() {
                    (chosen, reading.time) = (vec![ClipChoice::Index(clip.index)], None);
                    controls.restart();
                }
            }
        });
        explain(list.response, help::CLIP);
    }
    if !has_settings {
        let before = reading.up.unwrap_or_default();
        let mut up = before;
        choice(ui, help::UP, &mut up, &UpAxis::ALL, UpAxis::name);
        if up != before {
            reading.up = Some(up);
            controls.reset_camera();
        }
    }
    if reading != own.reading || chosen != own.clips {
        controls.reading = Some(ImportOptions { reading, clips: chosen, ..own });
    }
}

/// The colour that the control of the background begins with, sRGB.
const DEFAULT_BACKGROUND: [u8; 3] = [255; 3];

/// What lights a scene.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum LightChoice {
    /// The lights of the file, or those of the default look.
    Own,
    Headlight,
    Sky,
    /// An image of the surroundings, or a colour that the command line named.
    Environment,
    None,
}

impl LightChoice {
    const ALL: [LightChoice; 5] = [
        LightChoice::Own,
        LightChoice::Headlight,
        LightChoice::Sky,
        LightChoice::Environment,
        LightChoice::None,
    ];

    fn of(settings: &RenderSettings) -> Self {
        match (settings.environment.environment.as_deref(), settings.picture.light) {
            (Some("sky"), _) => LightChoice::Sky,
            (Some(_), _) => LightChoice::Environment,
            (None, Some(Headlight::Head)) => LightChoice::Headlight,
            (None, Some(Headlight::None)) => LightChoice::None,
            (None, None) => LightChoice::Own,
        }
    }

    fn name(self, own: &'static str) -> &'static str {
        match self {
            LightChoice::Own => own,
            LightChoice::Headlight => "headlight",
            LightChoice::Sky => "sky",
            LightChoice::Environment => "environment",
            LightChoice::None => "none",
        }
    }

    fn meaning(self) -> &'static str {
        match self {
            LightChoice::Own => {
                "the lights of the file; without any, a key light and fill light, with draft a headlight"
            }
            LightChoice::Headlight => "a light at the camera, where the file has none (--light head)",
            LightChoice::Sky => "a clear sky with the sun (--environment sky)",
            LightChoice::Environment => {
                "an image of the surroundings, .hdr or .exr, as light and background (--environment FILE); such a \
                 file can be dropped onto the window, too"
            }
            LightChoice::None => "no light but the file's (--light none)",
        }
    }

    fn apply(self, settings: &mut RenderSettings) {
        let RenderSettings { picture, environment, .. } = settings;
        (picture.light, environment.environment) = (None, None);
        match self {
            LightChoice::Own | LightChoice::Environment => {}
            LightChoice::Headlight => picture.light = Some(Headlight::Head),
            LightChoice::Sky => environment.environment = Some("sky".to_owned()),
            LightChoice::None => picture.light = Some(Headlight::None),
        }
    }
}

fn render_settings(ui: &mut Ui, rendered: Option<&RenderedImage>, controls: &mut Controls) {
    let picture = &mut controls.settings().picture;
    // What the file or the look says, where nothing else was chosen.
    let own = rendered.map(|rendered| rendered.prepared.shown_settings()).unwrap_or_default();
    let shown = picture.or(own);
    let mut shading = shown.shading();
    choice(ui, help::SHADING, &mut shading, &ShadingMode::ALL, ShadingMode::name);
    if shown.shading() != shading {
        picture.shading = Some(shading);
    }
    let mut numerics = picture.numerics();
    choice(ui, help::NUMERICS, &mut numerics, &Numerics::ALL, Numerics::name);
    let mut pipeline = picture.pipeline();
    choice(ui, help::COLOUR, &mut pipeline, &ColourPipeline::ALL, ColourPipeline::name);
    (picture.numerics, picture.colour) = (Some(numerics), Some(pipeline));
    if pipeline == ColourPipeline::Linear {
        let mut map = shown.tone_map.unwrap_or_default();
        choice(ui, help::TONE_MAP, &mut map, &ToneMap::ALL, ToneMap::name);
        if shown.tone_map.unwrap_or_default() != map {
            picture.tone_map = Some(map);
        }
        let mut ev = shown.exposure;
        exposure(ui, &mut ev);
        if ev != shown.exposure {
            picture.exposure = ev;
        }
    }
    let taken = || own.sampling().samples_taken();
    let mut samples = picture.samples.map_or_else(taken, Samples::get);
    ui.horizontal(|ui| {
        let drag = ui.add(DragValue::new(&mut samples).range(1..=crate::scene::MAX_SAMPLES).speed(0.2));
        if explain(drag, help::SAMPLES).changed() {
            let most = Samples::clamped(samples);
            picture.samples = Some(most);
            // A minimum above it is an error.
            picture.min_samples =
                shown.min_samples.filter(|least| *least > most).map(|_| most).or(picture.min_samples);
        }
        ui.label(if own.noise.is_some() && samples > 1 {
            "samples a pixel at most"
        } else {
            "samples a pixel"
        });
    });
    if samples > 1 {
        let shape = shown.filter.unwrap_or_default();
        let mut chosen = shape;
        choice(ui, help::FILTER, &mut chosen, &FilterShape::ALL, FilterShape::name);
        if chosen != shape {
            (picture.filter, picture.filter_radius) = (Some(chosen), None);
        }
    }
}

/// A slider for a fixed exposure, and a checkbox for the automatic one.
fn exposure(ui: &mut Ui, exposure: &mut Option<Exposure>) {
    ui.horizontal(|ui| {
        let mut is_auto = *exposure == Some(Exposure::Auto);
        let mut ev = if let Some(Exposure::Ev(ev)) = exposure { *ev } else { 0.0 };
        let range = -MAX_EXPOSURE..=MAX_EXPOSURE;
        let drag = ui.add_enabled(!is_auto, DragValue::new(&mut ev).range(range).speed(0.02).max_decimals(2));
        if drag.changed() {
            *exposure = Some(Exposure::Ev(ev));
        }
        explain(drag, help::EXPOSURE);
        ui.label("EV");
        let check = explain(ui.checkbox(&mut is_auto, "auto exposure"), help::EXPOSURE);
        if check.changed() {
            *exposure = Some(if is_auto { Exposure::Auto } else { Exposure::Ev(0.0) });
        }
    });
}

/// A list of the values of an option.
fn choice<T: PartialEq + Copy>(
    ui: &mut Ui,
    option: PanelOption,
    value: &mut T,
    all: &[T],
    name: impl Fn(T) -> &'static str,
) {
    let label = option.name.replace('-', " ");
    let list = ComboBox::from_label(label).selected_text(name(*value)).show_ui(ui, |ui| {
        for &other in all {
            ui.selectable_value(value, other, name(other));
        }
    });
    explain(list.response, option);
}

fn effects(ui: &mut Ui, rendered: &RenderedImage, settings: &mut RenderSettings) {
    let (statistics, decisions) = (&rendered.statistics, &rendered.prepared.decisions);
    Grid::new("effects").num_columns(3).spacing([14.0, 4.0]).striped(true).show(ui, |ui| {
        ui.label(RichText::new("effect").weak());
        ui.label(RichText::new("rays").weak()).on_hover_text("rays that the effect casts for the picture");
        ui.label(RichText::new("CPU ms").weak()).on_hover_text("processor time of all threads together");
        ui.end_row();
        ui.label("every picture");
        ui.label(count(statistics.rays(RayKind::PRIMARY).cast));
        let base = statistics.stages.iter().filter(|stage| stage.effect.is_none()).map(|stage| stage.time);
        ui.label(milliseconds(base.sum()));
        ui.end_row();
        for (decision, _) in decisions.iter().filter(|(_, can)| *can) {
            effect(ui, decision, true, settings);
            let cost =
                statistics.effect_costs.iter().find(|cost| cost.effect == decision.effect && decision.on);
            ui.label(cost.filter(|cost| cost.rays > 0).map_or(String::new(), |cost| count(cost.rays)));
            ui.label(cost.and_then(|cost| cost.time).map_or(String::new(), milliseconds));
            ui.end_row();
        }
    });
    let errors = if rendered.is_last { of_rendered(&rendered.prepared.job, statistics) } else { Vec::new() };
    for error in errors {
        let option = format!(
            "{}: {}\n`kiln explain --measure` also measures noise and tier",
            error.cause, error.option
        );
        ui.label(RichText::new(error.text).weak()).on_hover_text(option);
    }
    CollapsingHeader::new("not called for by the scene").show(ui, |ui| {
        for (decision, _) in decisions.iter().filter(|(_, can)| !can) {
            effect(ui, decision, false, settings);
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
            if drag.changed() {
                let value = (bounces > 0).then(|| bounces.to_string());
                settings.set(id::GLAZE, value.as_deref());
            }
            ui.label("bounces at most").on_hover_text("mirror images within mirror images; more take longer");
        });
    }
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

/// Names of the settings of a side, one entry each. `sampling` is that of its picture.
pub(crate) fn setting_names(settings: &RenderSettings, sampling: &Sampling) -> Vec<String> {
    let RenderSettings { picture, with, without, .. } = settings;
    let samples = picture.samples.map_or_else(|| sampling.samples_taken(), Samples::get);
    let mut words = vec![
        picture.shading().name().to_owned(),
        picture.numerics().name().into(),
        picture.pipeline().name().into(),
        if samples == 1 { "1 sample".into() } else { format!("{samples} samples") },
    ];
    if samples > 1 {
        words.push(picture.filter.or(sampling.filter).unwrap_or_default().name().into());
    }
    let display = picture.display().in_pipeline(picture.pipeline());
    words.extend(display.exposure().map(|exposure| format!("exposure {exposure}")));
    words.extend(display.tone_map().map(|map| map.name().to_owned()));
    match (LightChoice::of(settings), &settings.environment.environment) {
        (LightChoice::Own, _) => {}
        (LightChoice::Environment, Some(file)) => words.push(format!("light: {}", name_of(Path::new(file)))),
        (light, _) => words.push(format!("light: {}", light.name(""))),
    }
    if let Some(background @ Background::Colour(_)) = picture.background {
        words.push(format!("background {}", background.text()));
    }
    if picture.ground == Some(true) {
        words.push("ground".to_owned());
    }
    words.extend(with.iter().map(|effect| format!("with {effect}")));
    words.extend(without.iter().map(|effect| format!("without {effect}")));
    words
}

/// Size, samples and render time of an image, in one line.
pub(crate) fn progress_text(rendered: &RenderedImage) -> String {
    let [width, height] = rendered.image.size;
    let time = milliseconds(rendered.time);
    match (rendered.samples, rendered.factor) {
        ((taken, most), 1) if most > 1 => {
            let samples = match rendered.prepared.job.plan.is_adaptive() {
                true => format!("about {taken} of at most {most} samples a pixel"),
                false => format!("{taken} of {most} samples"),
            };
            format!("{width} x {height}, {samples}, {time} ms")
        }
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

#[cfg(test)]
mod tests {
    use super::*;

    /// A light leaves look, ground and background as they are.
    #[test]
    fn a_light_changes_nothing_else() {
        let picture = PictureSettings {
            look: Some(Look::Draft),
            ground: Some(true),
            background: Some(Background::Transparent),
            ..PictureSettings::default()
        };
        let before = RenderSettings::from(picture);
        for light in LightChoice::ALL.into_iter().filter(|light| *light != LightChoice::Environment) {
            let mut settings = before.clone();
            settings.environment.environment = Some("garden.hdr".into());
            assert_eq!(LightChoice::of(&settings), LightChoice::Environment);
            light.apply(&mut settings);
            assert_eq!(LightChoice::of(&settings), light);
            (settings.picture.light, settings.environment) = (None, EnvironmentSettings::default());
            assert_eq!(settings, before);
        }
    }
}
