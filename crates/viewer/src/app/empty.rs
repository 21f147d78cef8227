//! The window without a scene, and what it waits for.

use std::time::Instant;

use egui::{Align, Layout, RichText, Ui};

use super::App;
use crate::keys::Action;
use crate::name_of;
use kiln::import::all_endings;

impl App {
    /// What keeps the window from showing the newest picture, and since when.
    pub(super) fn progress(&self) -> Option<(String, Instant)> {
        if let Some((files, since)) = self.loader.reading() {
            let first = files.first().map(|file| name_of(file)).unwrap_or_default();
            let more = files.len().saturating_sub(1);
            let more = if more > 0 { format!(" and {more} more") } else { String::new() };
            return Some((format!("reading {first}{more}"), since));
        }
        self.building.map(|since| ("building the acceleration structure".to_owned(), since))
    }

    /// Says how to open a file, with buttons.
    pub(super) fn empty(&mut self, ui: &mut Ui) {
        if self.loader.reading().is_some() {
            return;
        }
        let mut clicked = None;
        ui.with_layout(Layout::top_down(Align::Center), |ui| {
            ui.add_space((ui.available_height() * 0.4 - 40.0).max(0.0));
            ui.heading("Drop a file here");
            let endings = format!("{}; .hdr or .exr for the light", all_endings());
            ui.label(RichText::new(endings).weak());
            ui.add_space(12.0);
            let buttons = [("Open file (Ctrl + O)", Action::Open), ("Keys (?)", Action::Help)];
            let again = Some(("Read again (F5)", Action::Reload)).filter(|_| !self.inputs.is_empty());
            for (name, action) in again.into_iter().chain(buttons) {
                if ui.button(name).clicked() {
                    clicked = Some(action);
                }
            }
        });
        if let Some(action) = clicked {
            self.act(&ui.ctx().clone(), action);
        }
    }
}
