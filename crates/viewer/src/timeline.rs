//! The animation's control bar: play, pause and frame slider.

use egui::{Key, Slider, Ui};

use super::controls::Controls;
use kiln::scene::animation::Timeline;

/// Shows the bar. `duration` is in seconds.
pub(crate) fn show(ui: &mut Ui, timeline: &Timeline, duration: f64, controls: &mut Controls) {
    ui.horizontal(|ui| {
        let is_playing = controls.playing.is_some();
        let button = ui.button(if is_playing { "Pause" } else { "Play" }).on_hover_text("Space");
        if button.clicked() {
            controls.play();
        }
        let mut frame = controls.frame(timeline);
        ui.spacing_mut().slider_width = (ui.available_width() - 190.0).max(100.0);
        let slider = ui.add(Slider::new(&mut frame, 0..=timeline.last()).text("frame"));
        // A focused slider handles arrows; Space still starts playback.
        let is_typed = ui.ctx().text_edit_focused();
        if slider.has_focus() && !is_typed && ui.input(|input| input.key_pressed(Key::Space)) {
            controls.play();
        }
        if slider.changed() {
            controls.playing = None;
            controls.go_to(timeline, frame);
        }
        ui.label(format!("{:.2} of {duration:.2} s", f64::from(frame) / timeline.fps()));
    });
}
