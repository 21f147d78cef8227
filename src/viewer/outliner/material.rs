//! The controls of the material of the selected objects: `--material NAME+={...}`.

use egui::{Response, Slider, Ui};

use crate::film::ColourPipeline;
use crate::film::rounding::quantise;
use crate::import::inline_change;
use crate::scene::{
    ColourValue, Material, MaterialChange, MaterialChoice, MetallicRoughness, Scene, is_named,
};

/// Shows the controls for the objects of a name. Returns the materials that options give, if they change.
pub(super) fn show(ui: &mut Ui, scene: &Scene, name: &str) -> Option<Vec<MaterialChoice>> {
    let (object, _) = scene.all_objects().find(|(object, _)| object.is_named(name))?;
    let material = &scene.materials[object.material.0 as usize];
    let own = match material.clone() {
        Material::Phong(m) => MetallicRoughness::from(m),
        Material::MetallicRoughness(m) => m,
    };
    let choices = &scene.import_options.materials;
    let textured = if material.is_textured() { "; its textures stay, and multiply it" } else { "" };
    let option = format!("\n--material '{name}+={{ ... }}'{textured}");
    let mut change = MaterialChange::default();
    let mut is_reset = false;
    ui.horizontal(|ui| {
        let mut colour = own.base_colour.to_pipeline(ColourPipeline::Display).to_array().map(quantise::<u8>);
        let button = ui.color_edit_button_srgb(&mut colour);
        if button.on_hover_text(format!("colour of the surface{option}")).changed() {
            change.colour = Some(ColourValue(colour));
        }
        ui.label("colour");
        if choices.iter().any(|choice| is_change_of(choice, name)) {
            is_reset = ui.small_button("Reset").on_hover_text("the material of the file").clicked();
        }
    });
    let meaning = "0 for stone, wood, plastic and glass, 1 for bare metal";
    change.metallic = number(ui, "metallic", own.metallic).explained(&format!("{meaning}{option}"));
    let meaning = "0 for a mirror, 1 for chalk";
    change.roughness = number(ui, "roughness", own.roughness).explained(&format!("{meaning}{option}"));
    match (is_reset, change == MaterialChange::default()) {
        (true, _) => Some(choices.iter().filter(|choice| !is_change_of(choice, name)).cloned().collect()),
        (false, false) => Some(with_change(choices, name, &change)),
        (false, true) => None,
    }
}

/// Decimals of metallic and roughness.
const DECIMALS: usize = 2;

/// A slider, and its value if it changes.
struct Number(Response, Option<f64>);

fn number(ui: &mut Ui, label: &str, before: f64) -> Number {
    let mut value = before;
    let slider = ui.add(Slider::new(&mut value, 0.0..=1.0).max_decimals(DECIMALS).text(label));
    // A control that gets the focus parses its displayed text, which is rounded, and reports a change.
    let text = |value: f64| format!("{value:.DECIMALS$}");
    let is_other = slider.changed() && text(value) != text(before);
    Number(slider, is_other.then_some(value))
}

impl Number {
    fn explained(self, text: &str) -> Option<f64> {
        self.0.on_hover_text(text);
        self.1
    }
}

/// Whether a choice changes the material of the objects of a name.
fn is_change_of(choice: &MaterialChoice, name: &str) -> bool {
    choice.changes && choice.name.as_deref() == Some(name)
}

/// The choices with a further change of the objects of a name. An earlier change of them takes it in, if those after it are
/// for other objects.
fn with_change(choices: &[MaterialChoice], name: &str, change: &MaterialChange) -> Vec<MaterialChoice> {
    let mut choices = choices.to_vec();
    let is_other = |choice: &MaterialChoice| {
        choice.name.as_deref().is_some_and(|other| !is_named(other, name) && !is_named(name, other))
    };
    let known = choices.iter().rposition(|choice| is_change_of(choice, name));
    let known = known.filter(|&at| choices[at + 1..].iter().all(is_other));
    let before = known.and_then(|at| inline_change(&choices[at].table).ok()).unwrap_or_default();
    let table = before.then(change).text();
    match known {
        Some(at) => choices[at].table = table,
        None => choices.push(MaterialChoice { name: Some(name.to_owned()), changes: true, table }),
    }
    choices
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::OptionValue;

    #[test]
    fn changes_of_an_object_are_one_option() {
        let parse = |texts: &[&str]| -> Vec<MaterialChoice> {
            texts.iter().map(|text| MaterialChoice::parse(text).expect("a choice")).collect()
        };
        let rough = MaterialChange { roughness: Some(0.25), ..MaterialChange::default() };
        for (before, after) in [
            (&[][..], &["lid+={ roughness = 0.25 }"][..]),
            (
                &["lid+={ metallic = 1 }", "pot={ colour = '#f00' }"],
                &["lid+={ metallic = 1, roughness = 0.25 }", "pot={ colour = '#f00' }"],
            ),
            // The later choice is for this object, too.
            (
                &["lid+={ roughness = 1 }", "{ colour = '#f00' }"],
                &["lid+={ roughness = 1 }", "{ colour = '#f00' }", "lid+={ roughness = 0.25 }"],
            ),
            (&["lid={ colour = '#f00' }"], &["lid={ colour = '#f00' }", "lid+={ roughness = 0.25 }"]),
        ] {
            let texts: Vec<String> =
                with_change(&parse(before), "lid", &rough).iter().map(OptionValue::text).collect();
            assert_eq!(texts, after);
        }
    }
}
