//! The list of the objects: their visibility and the selected one.
//!
//! What is chosen here are options of reading files (`--hide`, `--isolate`), so copied commands and saved pictures have
//! it.

mod outline;
mod rows;

use std::collections::HashSet;
use std::sync::Arc;

use egui::{Align, Button, Checkbox, Color32, Layout, RichText, ScrollArea, TextEdit, TextStyle, Ui};

use super::elided;
use super::request::Opened;
use kiln::error::printable;
use kiln::render::grouped;
use kiln::scene::ImportOptions;
pub(crate) use outline::Outline;
use rows::{Row, isolated, rows, toggled};

/// Least height of the list in rows; it takes the rest of the panel.
const HEIGHT: usize = 8;

/// Number of rows from which groups are closed at first, and a field searches the list.
const MANY: usize = 16;

/// Points by which parts are indented.
const INDENT: f32 = 12.0;

/// The list's state.
#[derive(Default)]
pub(crate) struct Outliner {
    /// The rows, and the scene that they are of.
    rows: Vec<Row>,
    of: Option<Arc<Opened>>,
    /// Names of groups that the user opened or closed.
    switched: HashSet<String>,
    /// What the names of objects or materials contain.
    filter: String,
    /// Name of the selected object or group.
    selected: Option<String>,
    /// Whether the selected row is to be scrolled into view.
    scrolls: bool,
}

impl Outliner {
    /// Selects the object of a name, or nothing.
    pub(crate) fn select(&mut self, name: Option<&str>) {
        self.selected = name.map(str::to_owned);
        self.scrolls = true;
    }

    /// The name of the selected object or group.
    pub(crate) fn selected(&self) -> Option<&str> {
        self.selected.as_deref()
    }

    /// Shows the list. Returns the names that are isolated and hidden, if they change.
    pub(crate) fn show(&mut self, ui: &mut Ui, opened: &Arc<Opened>) -> Option<[Vec<String>; 2]> {
        if !self.of.as_ref().is_some_and(|of| Arc::ptr_eq(of, opened)) {
            (self.rows, self.of) = (rows(opened.scene()), Some(Arc::clone(opened)));
            self.selected.take_if(|name| !self.rows.iter().any(|row| row.name == *name));
        }
        ui.separator();
        let options = &opened.scene().import_options;
        let ImportOptions { isolate, hide, .. } = options;
        let mut changed = None;
        let selected = self.rows.iter().find(|row| Some(&row.name) == self.selected.as_ref());
        ui.horizontal(|ui| {
            ui.label(RichText::new("Objects").strong());
            if let Some(Row { name, .. }) = selected {
                let isolates = ui.small_button("Isolate").on_hover_text("hide all other objects (--isolate)");
                if isolates.clicked() {
                    changed = Some(isolated(hide, name));
                }
            }
            if !isolate.is_empty() || !hide.is_empty() {
                let shows = ui.small_button("Show all").on_hover_text("as the files say");
                if shows.clicked() {
                    changed = Some(Default::default());
                }
            }
        });
        if self.rows.len() >= MANY || !self.filter.is_empty() {
            let field = TextEdit::singleline(&mut self.filter).hint_text("find objects or materials");
            ui.add(field.desired_width(f32::INFINITY));
        }
        self.list(ui, options).or(changed)
    }

    /// Shows the rows that are open or found. Returns the names that are isolated and hidden, if they change.
    fn list(&mut self, ui: &mut Ui, options: &ImportOptions) -> Option<[Vec<String>; 2]> {
        let listed = self.listed();
        let spacing = ui.spacing().item_spacing.y;
        let height = ui.spacing().interact_size.y;
        let most = ui.available_height().max(HEIGHT as f32 * (height + spacing));
        let mut area = ScrollArea::vertical().id_salt("objects").max_height(most);
        if std::mem::take(&mut self.scrolls)
            && let Some(place) =
                listed.iter().position(|&i| Some(&self.rows[i].name) == self.selected.as_ref())
        {
            let before = place as f32 * (height + spacing) - most / 2.0;
            area = area.vertical_scroll_offset(before.max(0.0));
        }
        let all: usize = self.rows.iter().filter(|row| row.parent.is_none()).map(|row| row.shown).sum();
        let mut changed = None;
        area.show_rows(ui, height, listed.len(), |ui, range| {
            for &index in &listed[range] {
                ui.horizontal(|ui| {
                    if let Some(is_visible) = self.row(ui, index, all) {
                        changed = Some(toggled(&self.rows, options, index, is_visible));
                    }
                });
            }
        });
        changed
    }

    /// The indices of the rows that are open or found.
    fn listed(&self) -> Vec<usize> {
        let wanted = self.filter.trim().to_lowercase();
        let has = |text: &String| text.to_lowercase().contains(&wanted);
        let is_found = |row: &Row| !row.is_group && (has(&row.name) || row.materials.iter().any(has));
        let is_listed = |index: &usize| match wanted.is_empty() {
            true => self.ancestors(*index).all(|group| self.is_open(group)),
            false => is_found(&self.rows[*index]),
        };
        (0..self.rows.len()).filter(is_listed).collect()
    }

    fn ancestors(&self, index: usize) -> impl Iterator<Item = usize> {
        std::iter::successors(self.rows[index].parent, |&group| self.rows[group].parent)
    }

    /// Whether a group shows its parts. One with the selected object does.
    fn is_open(&self, group: usize) -> bool {
        let Row { name, end, .. } = &self.rows[group];
        let is_switched = self.switched.contains(name);
        let has_selected =
            || self.rows[group + 1..*end].iter().any(|row| Some(&row.name) == self.selected.as_ref());
        (self.rows.len() < MANY || has_selected()) != is_switched
    }

    /// Shows a row. Returns whether its objects are to be visible, if that changes. `all` is the number of visible
    /// objects.
    fn row(&mut self, ui: &mut Ui, index: usize, all: usize) -> Option<bool> {
        let is_searched = !self.filter.trim().is_empty();
        let is_open = self.is_open(index);
        let Row { name, label, is_group, depth, parts, shown, triangles, materials, .. } = &self.rows[index];
        if !is_searched {
            ui.add_space(*depth as f32 * INDENT);
            if *is_group
                && ui.small_button(if is_open { "-" } else { "+" }).clicked()
                && !self.switched.remove(name)
            {
                self.switched.insert(name.clone());
            }
        }
        let mut is_visible = *shown > 0;
        let is_last = *shown > 0 && *shown == all && shown == parts;
        let check = Checkbox::without_text(&mut is_visible).indeterminate(*shown > 0 && shown < parts);
        let check = ui.add_enabled(!is_last, check);
        let check = check.on_hover_text("visible (--hide)").on_disabled_hover_text("the last visible object");
        let is_selected = self.selected.as_ref() == Some(name);
        let details = format!(
            "{}\n{parts} {}, {} {}\nmaterial: {}",
            printable(name),
            if *parts == 1 { "part" } else { "parts" },
            grouped(*triangles as u64, ' '),
            if *triangles == 1 { "primitive" } else { "triangles" },
            printable(&materials.join(", "))
        );
        let text = printable(if is_searched { name } else { &name[*label..] }).into_owned();
        let clicked = ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
            ui.label(RichText::new(grouped(*triangles as u64, ' ')).weak());
            ui.with_layout(Layout::top_down_justified(Align::LEFT), |ui| {
                let text = RichText::new(fitted(ui, text));
                let text = if is_visible { text } else { text.weak() };
                ui.add(Button::selectable(is_selected, text).truncate()).on_hover_text(details).clicked()
            })
            .inner
        });
        let (name, changed) = (name.clone(), check.changed().then_some(*shown == 0 || shown < parts));
        if clicked.inner {
            self.selected = (!is_selected).then_some(name);
        }
        changed
    }
}

/// The name, without its middle if a button of the available width has no room for it.
fn fitted(ui: &Ui, name: String) -> String {
    let font = TextStyle::Button.resolve(ui.style());
    let width = ui.painter().layout_no_wrap(name.clone(), font, Color32::WHITE).size().x;
    let part = (ui.available_width() - 2.0 * ui.spacing().button_padding.x) / width;
    // Characters differ in width.
    let length = (name.chars().count() as f32 * part * 0.92) as usize;
    if part < 1.0 { elided(&name, length.max(3)) } else { name }
}
