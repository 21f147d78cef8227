//! Controls of options: a table over the options of `kiln render`. Names, texts, values and ranges are those of the
//! command, so the copied command and the saved picture agree with the panel without further code.

use std::sync::LazyLock;

use egui::{ComboBox, DragValue, Response, Ui, vec2};

use crate::elided;
use crate::painter::RenderedImage;
use kiln::effects::{EFFECTS, Effect, EffectId, id};
use kiln::film::ColourPipeline;
use kiln::job::{EnvironmentSettings, PictureOptions, RenderSettings};
use kiln::scene::{
    ImportOptions, Intensity, OptionSpec, Options, PictureSettings, Rotation, Samples, Scene, ShadingMode,
    ValueKind,
};

/// Width in points of a list or a number.
pub(super) const WIDTH: f32 = 110.0;

/// Characters of a name that a closed list shows.
pub(super) const LIST_LENGTH: usize = 13;

/// An option with a control.
#[derive(Clone, Copy)]
pub(crate) struct OptionControl {
    /// Its name on the command line; the name of an effect for the value of that.
    name: &'static str,
    label: &'static str,
    /// When one wants it.
    when: &'static str,
    /// What is shown where the option is not set, and the number that a change of it begins with.
    unset: (&'static str, f64),
    /// Whether it changes the picture. Otherwise there is no control.
    is_used: fn(&Shown) -> bool,
}

/// A table of controls: constant, option, label, text and number without a value, whether it changes the picture, when
/// one wants it.
macro_rules! controls {
    ($($constant:ident = $name:expr, $label:literal, $unset:expr, $is_used:expr, $when:literal;)*) => {
        $(pub(super) const $constant: &OptionControl =
            &OptionControl { name: $name, label: $label, when: $when, unset: $unset, is_used: $is_used };)*

        #[cfg(test)]
        const ALL: &[&OptionControl] = &[$($constant),*];
    };
}

controls! {
    UP = "up", "up axis", ("y", 0.0), always, "Choose another if the object lies on its side or stands on its head.";
    SMOOTH = "smooth", "crease angle", ("default", 30.0), always, "Smooths meshes without normals. Lower it if edges look \
        rounded, raise it if a curved surface shows its triangles.";
    VARIANT = "variant", "variant", ("file's materials", 0.0), always, "The materials to show, if the file has several sets.";
    CLIP = "clip", "clip", ("", 0.0), always, "The animation to play, if the file has several.";
    APERTURE = id::DEPTH_OF_FIELD.name(), "aperture blur", ("camera's", 0.02), with_lens, "Blurs what is out of focus. A click in \
        the picture sets the focus.";
    ROTATION = "environment-rotation", "rotation", ("0", 0.0), with_environment, "Turns the environment, to let its light \
        come from another side.";
    HIDE_ENVIRONMENT = "hide-environment", "hide environment", ("", 0.0), with_environment, "Lights the scene by the \
        environment in front of a plain background.";
    OCCLUSION = id::AMBIENT_OCCLUSION.name(), "occlusion radius", ("0.1", 0.1), with_occlusion, "The distance within which \
        surfaces darken each other, in diagonals of the scene. Lower it for dark lines in corners alone.";
    BACKGROUND = "background", "background", ("", 0.0), always, "A colour of your own behind the scene, such as that of a page \
        or a slide, or an alpha channel in .png and .exr.";
    GROUND = "ground", "ground", ("", 0.0), always, "Something for objects to stand on and to cast their shadows on.";
    CULL = "cull", "cull back faces", ("", 0.0), single_sided, "Hides the backs of surfaces that the file makes for one side alone: \
        walls seen from outside, outlines.";
    SHADING = "shading", "shading", ("phong", 0.0), always, "The full model is the picture. Choose another to see what a \
        colour is made of.";
    TONE_MAP = "tone-map", "tone map", ("none", 0.0), linear, "Compresses bright light to what a screen can show. Choose \
        one if bright places turn white.";
    EXPOSURE = "exposure", "EV", ("0", 0.0), linear, "Brightness: each EV doubles the light. Raise it for a dark \
        interior.";
    TRANSPORT = "transport", "light transport", ("whitted", 0.0), shaded, "Choose `path` for indirect light, soft \
        shadows and glass, `whitted` for speed.";
    BOUNCES = id::PATH.name(), "bounces", ("8", 8.0), with_paths, "Raise it if interiors or glass look too dark.";
    SAMPLES = "samples", "samples per pixel", ("1", 1.0), always, "Rays through each pixel. More give smoother edges and less \
        noise, and take longer.";
    NOISE = "noise", "noise threshold", ("none", 0.025), always, "Samples each pixel until its noise is below this: lower is \
        cleaner and takes longer. `samples per pixel` is then the maximum.";
    FILTER = "filter", "filter", ("gaussian", 0.0), filtered, "How samples become pixels. `mitchell` is sharper, `gaussian` \
        softer, `box` a plain mean.";
}

/// What the picture has, with the settings that are chosen in the panel.
pub(super) struct Shown<'a> {
    /// The settings: those chosen, then those of the last picture.
    pub picture: PictureSettings,
    /// Those of the environment.
    environment: EnvironmentSettings,
    /// Whether there is an environment.
    has_environment: bool,
    /// The last picture.
    pub rendered: Option<&'a RenderedImage>,
}

impl<'a> Shown<'a> {
    pub(super) fn new(settings: &RenderSettings, rendered: Option<&'a RenderedImage>, scene: &Scene) -> Self {
        let mut own = rendered.map(|rendered| rendered.prepared.shown_settings()).unwrap_or_default();
        if let Some(rendered) = rendered {
            let job = &rendered.prepared.job();
            own.transport = own.transport.or(Some(job.plan.transport));
            own.samples = Some(Samples::clamped(job.plan_settings.sampling.samples_taken()));
        }
        let (chosen, of_scene) = (settings.environment.clone(), scene.environment.as_ref());
        let has_environment = chosen.environment.is_some() || of_scene.is_some();
        let of_scene = of_scene.filter(|_| chosen.environment.is_none());
        let of_scene = of_scene.map_or_else(EnvironmentSettings::default, |own| EnvironmentSettings {
            environment: None,
            environment_rotation: Some(Rotation::clamped(own.rotation.to_degrees())),
            environment_intensity: Some(Intensity::clamped(own.intensity)),
            hide_environment: Some(own.is_hidden),
        });
        let (picture, environment) = (settings.picture.or(own), chosen.or(of_scene));
        Shown { picture, environment, has_environment, rendered }
    }

    /// The text of the value that the picture has.
    fn text(&self, name: &str, settings: &RenderSettings) -> Option<String> {
        let effect = || self.decision(effect_named(name)?.id)?.value.clone();
        let own = chosen(name, settings).or_else(|| self.picture.text(name));
        own.or_else(|| self.environment.text(name)).or_else(effect)
    }

    fn decision(&self, effect: EffectId) -> Option<&kiln::effects::Decision> {
        self.rendered?.prepared.job().plan.decisions.iter().find(|decision| decision.effect == effect)
    }
}

fn always(_: &Shown) -> bool {
    true
}

fn with_paths(shown: &Shown) -> bool {
    shown.picture.transport.is_some_and(|transport| transport.traces_paths())
}

fn with_environment(shown: &Shown) -> bool {
    shown.has_environment
}

fn with_occlusion(shown: &Shown) -> bool {
    shown.decision(id::AMBIENT_OCCLUSION).is_some_and(|decision| decision.on)
}

fn with_lens(shown: &Shown) -> bool {
    shown.rendered.is_none_or(|rendered| rendered.prepared.camera.projection.has_lens())
}

fn single_sided(shown: &Shown) -> bool {
    shown.rendered.is_none_or(|rendered| rendered.prepared.job().world.has_single_sided())
}

fn linear(shown: &Shown) -> bool {
    shown.picture.pipeline() == ColourPipeline::Linear
}

fn shaded(shown: &Shown) -> bool {
    shown.picture.shading() == ShadingMode::Full
}

fn filtered(shown: &Shown) -> bool {
    shown.picture.samples.is_some_and(|samples| samples.get() > 1) || shown.picture.noise.is_some()
}

fn effect_named(name: &str) -> Option<&'static Effect> {
    EFFECTS.iter().find(|effect| effect.id.name() == name)
}

/// The value that settings give an option.
fn chosen(name: &str, settings: &RenderSettings) -> Option<String> {
    let RenderSettings { picture, environment, .. } = settings;
    let of_effect = || settings.value(effect_named(name)?.id).map(str::to_owned);
    picture.text(name).or_else(|| environment.text(name)).or_else(of_effect)
}

/// Sets an option, or leaves it to the files and the default look. Invalid values, which numbers that are being typed can
/// be, change nothing. `shown` are the settings that the picture has.
fn set(name: &str, text: Option<&str>, settings: &mut RenderSettings, shown: &PictureSettings) {
    if let Some(Effect { id, value: Some(value), .. }) = effect_named(name) {
        match text {
            Some(text) if (value.check)(text).is_ok() => settings.set(*id, Some(text)),
            Some(_) => {}
            None => settings.leave(*id),
        }
        return;
    }
    // Invalid values leave what was there, and names of the other struct do nothing.
    let _ = settings.picture.set(name, text).and_then(|()| settings.environment.set(name, text));
    let picture = &mut settings.picture;
    match name {
        // The effect says it, too.
        "transport" => settings.leave(id::PATH),
        // A minimum above the maximum is an error.
        "samples" => {
            let most = picture.samples;
            let least = picture.min_samples.or(shown.min_samples);
            if least.zip(most).is_some_and(|(least, most)| least > most) {
                picture.min_samples = most;
            }
        }
        _ => {}
    }
}

/// What the values of an option are.
fn kind(name: &str) -> ValueKind {
    let of_effect = || Some((effect_named(name)?.value.as_ref()?.kind)());
    of_effect().or_else(|| PictureOptions::kind(name)).unwrap_or(ValueKind::Text)
}

impl OptionControl {
    /// Shows the control for settings of a picture. `start` is what its button goes back to.
    pub(super) fn show(
        &self,
        ui: &mut Ui,
        shown: &Shown,
        start: &RenderSettings,
        settings: &mut RenderSettings,
    ) {
        if !self.is_used(shown) {
            return;
        }
        let (now, first) = (chosen(self.name, settings), chosen(self.name, start));
        let text = shown.text(self.name, settings);
        let changed = self.widget(ui, &kind(self.name), text.as_deref(), now != first);
        if let Some(text) = changed {
            set(self.name, text.or(first).as_deref(), settings, &shown.picture);
        }
    }

    /// The control of an option whose value is that of the files where it is not set.
    pub(super) fn of_files(&self) -> Self {
        OptionControl { unset: ("from file", self.unset.1), ..*self }
    }

    /// Shows the control for an option of reading files; `names` are the values of one that is a text.
    pub(super) fn show_reading(
        &self,
        ui: &mut Ui,
        names: &[String],
        start: &ImportOptions,
        reading: &mut ImportOptions,
    ) {
        let (now, first) = (reading.text(self.name), start.text(self.name));
        let kind = match kind(self.name) {
            ValueKind::Text => ValueKind::Names(names.to_vec()),
            kind => kind,
        };
        let is_changed = now != first;
        if let Some(text) = self.widget(ui, &kind, now.as_deref(), is_changed) {
            // Invalid values leave what was there.
            let _ = reading.set(self.name, text.or(first).as_deref());
        }
    }

    /// Shows a control with the text of its value. Returns the changed text; `None` within for the button that goes back,
    /// which `is_changed` shows.
    fn widget(
        &self,
        ui: &mut Ui,
        kind: &ValueKind,
        text: Option<&str>,
        is_changed: bool,
    ) -> Option<Option<String>> {
        let mut changed = None;
        ui.horizontal(|ui| {
            let control = match kind {
                ValueKind::Names(names) if names == &["true", "false"] => {
                    let mut is_on = text == Some("true");
                    let check = ui.checkbox(&mut is_on, self.label);
                    changed = check.changed().then(|| Some(is_on.to_string()));
                    check
                }
                ValueKind::Names(names) => {
                    let shown = value_label(self.name, text.unwrap_or(self.unset.0));
                    let list = ComboBox::from_id_salt(self.name)
                        .width(WIDTH)
                        .selected_text(elided(shown, LIST_LENGTH));
                    let list = list.show_ui(ui, |ui| {
                        for name in names {
                            if ui
                                .selectable_label(text == Some(name.as_str()), value_label(self.name, name))
                                .clicked()
                            {
                                changed = Some(Some(name.clone()));
                            }
                        }
                    });
                    list.response | ui.label(self.label)
                }
                ValueKind::Number { range, is_whole } => {
                    let (drag, number) = self.number(ui, text, *range, *is_whole);
                    changed = number.map(Some);
                    drag | ui.label(self.label)
                }
                ValueKind::Text => ui.label(self.label),
            };
            self.explain(control);
            let back = "the setting with which the file was opened";
            if is_changed && ui.small_button("reset").on_hover_text(back).clicked() {
                changed = Some(None);
            }
        });
        changed
    }

    /// A number that is dragged or typed. Returns its text if it was changed.
    fn number(
        &self,
        ui: &mut Ui,
        text: Option<&str>,
        [least, most]: [f64; 2],
        is_whole: bool,
    ) -> (Response, Option<String>) {
        let (without, first) = self.unset;
        let before = text.and_then(|text| text.parse().ok());
        let mut number: f64 = before.unwrap_or(first);
        let speed = if is_whole { 0.2 } else { (first.abs() * 0.02).max(number.abs() * 0.01).max(1e-3) };
        // A control that gets the focus parses the text that it displays: all digits.
        let drag = DragValue::new(&mut number)
            .range(least..=most)
            .speed(speed)
            .max_decimals(if is_whole { 0 } else { 16 })
            .custom_formatter(|number, _| before.map_or_else(|| without.to_owned(), |_| number.to_string()));
        let drag = ui.add_sized(vec2(WIDTH, ui.spacing().interact_size.y), drag);
        let is_changed = drag.changed() && before != Some(number);
        (drag, is_changed.then(|| number.to_string()))
    }

    /// Whether the option changes the picture.
    pub(super) fn is_used(&self, shown: &Shown) -> bool {
        (self.is_used)(shown)
    }

    /// Shows on hover when one wants the option, and what it does.
    pub(super) fn explain(&self, control: Response) -> Response {
        let (option, help) =
            match effect_named(self.name).and_then(|effect| Some((effect, effect.value.as_ref()?))) {
                Some((effect, value)) => {
                    let option = format!("with {}={}", effect.id, value.placeholder);
                    (option, format!("{}; {}", value.meaning, effect.summary))
                }
                None => (self.name.to_owned(), help(self.name).to_owned()),
            };
        control.on_hover_text(format!("{}\n\n--{option}: {help}", self.when))
    }
}

/// The text of a value in a list. The full model is that of the material, which `phong` is one of.
fn value_label<'a>(name: &str, value: &'a str) -> &'a str {
    if (name, value) == ("shading", ShadingMode::Full.name()) { "full" } else { value }
}

/// The help of an option of `kiln render`.
fn help(name: &str) -> &'static str {
    static SPECS: LazyLock<Vec<OptionSpec>> = LazyLock::new(PictureOptions::specs);
    SPECS.iter().find(|option| option.name == name).map_or("", |option| &option.help)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A control of an option that the command does not have would set nothing.
    #[test]
    fn options_of_the_panel_are_those_of_the_command() {
        for control in ALL {
            let is_effect = effect_named(control.name).is_some_and(|effect| effect.value.is_some());
            assert!(is_effect || !help(control.name).is_empty(), "{}", control.name);
        }
        assert_eq!(help("none"), "");
    }

    /// What a control sets is what it shows next, and leaving it to the files gives the settings of before.
    #[test]
    fn a_control_shows_what_it_has_set() {
        let before = RenderSettings::default();
        for control in ALL {
            let text = match kind(control.name) {
                ValueKind::Names(names) => names[names.len() - 1].clone(),
                ValueKind::Number { is_whole: true, .. } => "3".to_owned(),
                ValueKind::Number { .. } => "0.25".to_owned(),
                ValueKind::Text => continue,
            };
            let mut reading = ImportOptions::default();
            if ImportOptions::kind(control.name).is_some() {
                assert_eq!(reading.set(control.name, Some(&*text)), Ok(()));
                assert_eq!(reading.text(control.name).as_deref(), Some(&*text), "{}", control.name);
                continue;
            }
            let mut settings = before.clone();
            set(control.name, Some(&text), &mut settings, &before.picture);
            assert_eq!(chosen(control.name, &settings).as_deref(), Some(&*text), "{}", control.name);
            set(control.name, None, &mut settings, &before.picture);
            assert_eq!(settings, before, "{}", control.name);
        }
    }

    /// A transport replaces what the effect of the same name says, a maximum of samples limits their minimum, and an
    /// invalid value is not taken.
    #[test]
    fn settings_do_not_contradict_each_other() {
        let mut settings = RenderSettings::default();
        let shown = PictureSettings { min_samples: Some(Samples::clamped(8)), ..PictureSettings::default() };
        settings.switch(id::PATH, false);
        set("transport", Some(id::PATH.name()), &mut settings, &shown);
        assert_eq!((settings.with.len(), settings.without.len()), (0, 0));
        set("samples", Some("4"), &mut settings, &shown);
        assert_eq!(chosen("min-samples", &settings).as_deref(), Some("4"));
        set("samples", Some("0"), &mut settings, &shown);
        set(OCCLUSION.name, Some("0"), &mut settings, &shown);
        assert_eq!(chosen("samples", &settings).as_deref(), Some("4"));
        assert_eq!(chosen(OCCLUSION.name, &settings), None);
    }
}
