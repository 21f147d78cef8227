//! The controls of the light: what lights the scene, and its environment.

use std::path::Path;

use egui::{ComboBox, Ui};

use super::options::{HIDE_ENVIRONMENT, LIST_LENGTH, ROTATION, Shown, WIDTH};
use crate::keys::Action;
use crate::{elided, name_of};
use kiln::job::{EnvironmentSettings, RenderSettings};
use kiln::scene::{Headlight, Look, Scene};

/// Shows the controls. Returns an action if a file is to be chosen.
pub(super) fn show(
    ui: &mut Ui,
    scene: &Scene,
    shown: &Shown,
    start: &RenderSettings,
    settings: &mut RenderSettings,
) -> Option<Action> {
    let own = match settings.look(scene) {
        _ if scene.has_settings || !scene.lights.is_empty() => "from file",
        Look::Draft => "added headlight",
        Look::Studio => LightChoice::Own.name(),
    };
    let (before, typed) = (LightChoice::of(settings), settings.environment.environment.clone());
    let mut light = before;
    let file = typed.as_deref().filter(|_| before == LightChoice::Environment).map(Path::new);
    let name = |light: LightChoice| if light == LightChoice::Own { own } else { light.name() };
    let text = file.map_or(name(before).to_owned(), name_of);
    let mut asks_for_file = false;
    ui.horizontal(|ui| {
        let list = ComboBox::from_id_salt("light").width(WIDTH).selected_text(elided(&text, LIST_LENGTH));
        let list = list.show_ui(ui, |ui| {
            for choice in LightChoice::ALL {
                let entry = ui.selectable_value(&mut light, choice, name(choice));
                let entry = entry.on_hover_text(choice.meaning());
                asks_for_file |= entry.clicked() && choice == LightChoice::Environment;
            }
        });
        let list = list.response | ui.label("light");
        list.on_hover_text(typed.as_deref().unwrap_or(before.meaning()));
    });
    if asks_for_file {
        return Some(Action::Open);
    }
    if light != before {
        light.apply(settings);
        if scene.environment.is_none() && settings.environment.environment.is_none() {
            settings.environment = EnvironmentSettings::default();
        }
    }
    for control in [ROTATION, HIDE_ENVIRONMENT] {
        control.show(ui, shown, start, settings);
    }
    None
}

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

// `Own` is named by what the light is then.
kiln::names!(LightChoice {
    Own = "default",
    Headlight = "headlight",
    Sky = "sky",
    Environment = "environment",
    None = "none",
});

impl LightChoice {
    fn of(settings: &RenderSettings) -> Self {
        match (settings.environment.environment.as_deref(), settings.picture.light) {
            (Some("sky"), _) => LightChoice::Sky,
            (Some(_), _) => LightChoice::Environment,
            (None, Some(Headlight::Head)) => LightChoice::Headlight,
            (None, Some(Headlight::None)) => LightChoice::None,
            (None, None) => LightChoice::Own,
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

#[cfg(test)]
mod tests {
    use super::*;
    use kiln::scene::{Background, PictureSettings};

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
