//! The controls of background and exposure, whose values are a colour or a number, or a word.

use egui::{ComboBox, DragValue, Ui, vec2};

use super::options::{BACKGROUND, EXPOSURE, Shown, WIDTH};
use kiln::film::tone::{Exposure, MAX_EXPOSURE};
use kiln::job::RenderSettings;
use kiln::scene::{Background, ColourValue, Look, PictureSettings, Scene};

/// The colour that the control of the background begins with, sRGB.
const DEFAULT_BACKGROUND: [u8; 3] = [255; 3];

/// The background: that of the files or the look, a colour, or an alpha channel.
pub(super) fn background(ui: &mut Ui, scene: &Scene, picture: &mut PictureSettings) {
    let before = picture.background;
    let own = if scene.picture.background.is_some() { "from file" } else { "default" };
    let name = |background: Option<Background>| match background {
        None => own,
        Some(Background::Transparent) => "transparent",
        Some(Background::Colour(_)) => "colour",
    };
    let mut colour = match before.or(scene.picture.background) {
        Some(Background::Colour(colour)) => colour.0,
        _ => DEFAULT_BACKGROUND,
    };
    ui.horizontal(|ui| {
        let list = ComboBox::from_id_salt("background").width(WIDTH).selected_text(name(before));
        let list = list.show_ui(ui, |ui| {
            let colour = Background::Colour(ColourValue(colour));
            for choice in [None, Some(colour), Some(Background::Transparent)] {
                if ui.selectable_label(name(before) == name(choice), name(choice)).clicked() {
                    picture.background = choice;
                }
            }
        });
        if matches!(before, Some(Background::Colour(_))) && ui.color_edit_button_srgb(&mut colour).changed() {
            picture.background = Some(Background::Colour(ColourValue(colour)));
        }
        BACKGROUND.explain(list.response | ui.label("background"));
    });
}

/// The switch of a fast preview, where files and options do not say more.
pub(super) fn draft(ui: &mut Ui, scene: &Scene, settings: &mut RenderSettings) {
    let of_files = RenderSettings { picture: PictureSettings::default(), ..settings.clone() };
    if of_files.look(scene) == Look::Studio {
        let mut is_draft = settings.look(scene) == Look::Draft;
        let meaning = "a fast preview: one sample per pixel, a headlight and a dark background (--draft)";
        if ui.checkbox(&mut is_draft, "draft look").on_hover_text(meaning).changed() {
            settings.picture.look = is_draft.then_some(Look::Draft);
        }
    }
}

/// A number for a fixed exposure, and a check box for the automatic one, whose value the number shows.
pub(super) fn exposure(ui: &mut Ui, shown: &Shown, picture: &mut PictureSettings) {
    if !EXPOSURE.is_used(shown) {
        return;
    }
    ui.horizontal(|ui| {
        let mut is_auto = shown.picture.exposure == Some(Exposure::Auto);
        let metered = shown.rendered.map_or(0.0, |rendered| rendered.display.ev());
        let mut ev = match shown.picture.exposure {
            Some(Exposure::Ev(ev)) => ev,
            Some(Exposure::Auto) => metered,
            None => 0.0,
        };
        let range = -MAX_EXPOSURE..=MAX_EXPOSURE;
        let drag = DragValue::new(&mut ev).range(range).speed(0.02).max_decimals(2).suffix(" EV");
        let size = vec2(WIDTH, ui.spacing().interact_size.y);
        let drag = ui.add_enabled_ui(!is_auto, |ui| ui.add_sized(size, drag)).inner;
        if drag.changed() {
            picture.exposure = Some(Exposure::Ev(ev));
        }
        EXPOSURE.explain(drag | ui.label("exposure"));
        if EXPOSURE.explain(ui.checkbox(&mut is_auto, "auto")).changed() {
            picture.exposure = Some(if is_auto { Exposure::Auto } else { Exposure::Ev(metered) });
        }
    });
}
