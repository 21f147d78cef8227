//! The lights of the files: `--edit-light NAME={...}`.

use egui::{Button, CollapsingHeader, DragValue, Grid, RichText, Ui};

use crate::error::printable;
use crate::scene::{ImportOptions, LightChange, Scene};
use crate::viewer::elided;

/// Lights that are listed; the others can be changed on the command line.
const MOST: usize = 32;

/// Characters of a name.
const NAME_LENGTH: usize = 26;

/// Shows the lights of a scene. Returns the options of a scene with other lights, if these were chosen.
pub(super) fn show(ui: &mut Ui, scene: &Scene) -> Option<ImportOptions> {
    if scene.lights.is_empty() {
        return None;
    }
    ui.separator();
    let title = RichText::new("Lights of the files").strong();
    let header = CollapsingHeader::new(title).id_salt("lights").default_open(false);
    let lights = header.show_unindented(ui, |ui| contents(ui, scene)).body_returned.flatten()?;
    Some(ImportOptions { lights, ..scene.import_options.clone() })
}

/// Shows the controls. Returns the changes of the lights, if they change.
fn contents(ui: &mut Ui, scene: &Scene) -> Option<Vec<LightChange>> {
    let changes = &scene.import_options.lights;
    let mut edited = None;
    Grid::new("lights").num_columns(4).spacing([6.0, 4.0]).show(ui, |ui| {
        for light in scene.lights.iter().take(MOST) {
            let mut change = LightChange { name: light.name.clone(), position: None, intensity: None };
            let meaning = format!("{}\n--edit-light '{}={{ ... }}'", light.kind.noun(), light.name);
            let name = RichText::new(elided(&light.name, NAME_LENGTH)).weak();
            ui.label(name).on_hover_text(printable(&meaning));
            change.intensity = number(ui, light.intensity, 0.0, light.intensity, "intensity");
            let is_changed = changes.iter().any(|other| other.name == light.name);
            // There in any case, so that a control that is dragged keeps its place and its identity.
            let reset = ui.add_visible(is_changed, Button::new("Reset").small());
            if reset.on_hover_text("the light of the file").clicked() {
                edited = Some(changes.iter().filter(|other| other.name != light.name).cloned().collect());
            }
            ui.end_row();
            if let Some(position) = light.kind.position() {
                let mut to = position.to_array();
                let scale = position.abs().max_element();
                for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
                    if let Some(value) = number(ui, to[axis], f64::MIN, scale, name) {
                        to[axis] = value;
                        change.position = Some(to);
                    }
                }
                ui.end_row();
            }
            if change.position.is_some() || change.intensity.is_some() {
                edited = Some(with_change(changes, change));
            }
        }
    });
    edited
}

/// A number that is dragged, a point by a hundredth of `scale`. Returns its value if the displayed one changes.
fn number(ui: &mut Ui, before: f64, least: f64, scale: f64, name: &str) -> Option<f64> {
    let mut value = before;
    let speed = if scale > 0.0 { 0.01 * scale } else { 0.01 };
    let drag = DragValue::new(&mut value).range(least..=1e100).speed(speed);
    let drag = ui.add(drag.custom_formatter(|value, _| text(value))).on_hover_text(name);
    // A control that gets the focus parses its displayed text, which is rounded, and reports a change.
    (drag.changed() && text(value) != text(before)).then_some(value)
}

/// A number in seven significant digits.
fn text(value: f64) -> String {
    format!("{value:.6e}").parse::<f64>().map_or_else(|_| value.to_string(), |rounded| format!("{rounded:?}"))
}

/// The changes with a further one, which takes in that of the same lights.
fn with_change(changes: &[LightChange], change: LightChange) -> Vec<LightChange> {
    let (same, mut others): (Vec<_>, Vec<_>) =
        changes.iter().cloned().partition(|other| other.name == change.name);
    let before = same.into_iter().next_back();
    let (position, intensity) = before.map_or((None, None), |before| (before.position, before.intensity));
    others.push(LightChange {
        position: change.position.or(position),
        intensity: change.intensity.or(intensity),
        ..change
    });
    others
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What is displayed is parsed to a number that is displayed alike, small ones, too.
    #[test]
    fn displayed_numbers_are_those_that_are_parsed() {
        for (value, shown) in [(2174.0566, "2174.057"), (0.1 + 0.2, "0.3"), (1.5e-9, "1.5e-9"), (0.0, "0.0")]
        {
            assert_eq!(text(value), shown);
            assert_eq!(text(shown.parse().expect("a number")), shown);
        }
    }
}
