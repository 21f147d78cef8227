//! Explanations of the panel's controls: when one wants an option, and its help text.

use std::sync::LazyLock;

use clap::{Args, Command};
use egui::Response;

use crate::job::RenderSettings;
use crate::scene::ImportOptions;

/// An option that the panel sets.
#[derive(Clone, Copy)]
pub(crate) struct PanelOption {
    /// Its name on the command line.
    pub name: &'static str,
    /// When one wants it.
    when: &'static str,
}

macro_rules! panel_options {
    ($($constant:ident = $name:literal, $when:literal;)*) => {
        $(pub(crate) const $constant: PanelOption = PanelOption { name: $name, when: $when };)*

        #[cfg(test)]
        const ALL: &[PanelOption] = &[$($constant),*];
    };
}

panel_options! {
    SHADING = "shading", "The full model is the picture. Choose another to see what a colour is made of.";
    NUMERICS = "numerics", "How rays are tested against triangles. Choose `exact` to find out whether a dot or a gap is \
        an error of rounding, and `fast` to see what speed costs.";
    COLOUR = "colour", "How colours are added up. Keep `linear` for natural light; the others give the pictures of \
        programs that add up the values of image files.";
    TONE_MAP = "tone-map", "Compresses bright light to what a screen can show. Choose one if bright places turn white.";
    EXPOSURE = "exposure", "Brightness: each EV doubles the light. Raise it for a dark interior.";
    SAMPLES = "samples", "Rays through each pixel. More give smoother edges and less noise, and take longer.";
    FILTER = "filter", "How samples become pixels. `mitchell` is sharper, `gaussian` softer, `box` a plain mean.";
    CLIP = "clip", "The animation to play, if the file has several.";
    UP = "up", "Choose another if the object lies on its side or stands on its head.";
    ROTATION = "environment-rotation", "Turns the surroundings, to let their light come from another side.";
    BACKGROUND = "background", "A colour of your own behind the scene, such as that of a page or a slide.";
    CULL = "cull", "Hides the backs of surfaces that the file makes for one side alone: walls seen from outside, outlines.";
    GROUND = "ground", "Something for objects to stand on and to cast their shadows on.";
}

/// Shows on hover when one wants an option, and what it does.
pub(crate) fn explain(control: Response, option: PanelOption) -> Response {
    control.on_hover_text(format!("{}\n\n--{}: {}", option.when, option.name, help(option.name)))
}

/// The help of an option of `kiln render`.
fn help(name: &str) -> &'static str {
    static HELP: LazyLock<Vec<(String, String)>> = LazyLock::new(|| {
        let command = ImportOptions::augment_args(RenderSettings::augment_args(Command::new("kiln")));
        let help = |arg: &clap::Arg| Some((arg.get_long()?.to_owned(), arg.get_help()?.to_string()));
        command.get_arguments().filter_map(help).collect()
    });
    HELP.iter().find(|(option, _)| option == name).map_or("", |(_, help)| help)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_of_the_panel_are_those_of_the_command() {
        for option in ALL {
            assert!(!help(option.name).is_empty(), "{}", option.name);
        }
        assert_eq!(help("none"), "");
    }
}
