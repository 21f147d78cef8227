//! Pixel inspector: its part of the panel, and the pixel's rays drawn over the picture.

use egui::{Color32, Label, Painter, Pos2, Rect, RichText, ScrollArea, Stroke, TextWrapMode, Ui, vec2};
use glam::DVec2;

use crate::elided;
use crate::inspect::{Inspection, RaySegment};
use crate::painter::Prepared;
use kiln::import::FileNames;

/// Characters of a name in a line of the panel.
const NAME_LENGTH: usize = 28;

/// Height in points of the report's characters: its usual lines fit the panel.
const TEXT_SIZE: f32 = 10.0;

/// Part of the panel's height that the inspection may take; it scrolls within.
const HEIGHT_SHARE: f32 = 0.5;

/// Shows the inspection at the top of the panel, which `is_of_before` the last change. Returns `false` when the user closed it.
pub(crate) fn show(ui: &mut Ui, inspection: &Inspection, names: &FileNames, is_of_before: bool) -> bool {
    let report = &inspection.report;
    let (mut is_open, [x, y], [r, g, b]) = (true, report.pixel, report.displayed);
    ui.add_space(8.0);
    ui.horizontal(|ui| {
        let (swatch, _) = ui.allocate_exact_size(vec2(28.0, 14.0), egui::Sense::hover());
        ui.painter().rect_filled(swatch, 2.0, Color32::from_rgb(r, g, b));
        ui.label(RichText::new(format!("Pixel {x}, {y}")).strong());
        if is_of_before {
            ui.label("before the change");
        }
        ui.label(format!("#{r:02x}{g:02x}{b:02x}")).on_hover_text(format!("{r} {g} {b}"));
        is_open = !ui.small_button("x").on_hover_text("Esc").clicked();
    });
    ui.horizontal_wrapped(|ui| kinds(ui, &inspection.rays));
    let height = ui.available_height() * HEIGHT_SHARE;
    ScrollArea::both().id_salt("inspection").max_height(height).show(ui, |ui| {
        let text = report.text(&|name| elided(&names.shorten(name), NAME_LENGTH));
        let text = RichText::new(text.trim_end()).monospace().size(TEXT_SIZE);
        ui.add(Label::new(text).wrap_mode(TextWrapMode::Extend));
    });
    ui.separator();
    is_open
}

/// The kinds of the rays that are drawn, with their colours.
fn kinds(ui: &mut Ui, rays: &[RaySegment]) {
    for (i, ray) in rays.iter().enumerate() {
        if rays[..i].iter().all(|other| other.kind != ray.kind) {
            let (swatch, _) = ui.allocate_exact_size(vec2(10.0, 10.0), egui::Sense::hover());
            let [r, g, b] = ray.kind.colour;
            ui.painter().rect_filled(swatch, 2.0, Color32::from_rgb(r, g, b));
            ui.label(RichText::new(ray.kind.name).small());
        }
    }
}

/// The colour of a ray's kind, darker for an occluded shadow ray.
fn colour(ray: &RaySegment) -> Color32 {
    let [r, g, b] = ray.kind.colour;
    let own = Color32::from_rgb(r, g, b);
    if ray.kind.is_shadow && ray.hit { own.gamma_multiply(0.55) } else { own }
}

/// Draws the rays over the picture of `prepared` in `rect`; `of` is the prepared render in which they were traced.
pub(crate) fn draw(
    painter: &Painter,
    rect: Rect,
    prepared: &Prepared,
    of: &Prepared,
    inspection: &Inspection,
) {
    let size = prepared.job().view.size();
    let place = |p: DVec2| -> Pos2 {
        let share = vec2((p.x / f64::from(size[0])) as f32, (p.y / f64::from(size[1])) as f32);
        rect.min + share * rect.size()
    };
    // At another time or in another tier the recentering may differ.
    if prepared.job().recentering != of.job().recentering {
        return;
    }
    for ray in &inspection.rays {
        let Some([from, to]) = prepared.job().view.project_segment(ray.from, ray.to) else { continue };
        let ends = [place(from), place(to)];
        painter.line_segment(ends, Stroke::new(3.0, Color32::from_black_alpha(140)));
        painter.line_segment(ends, Stroke::new(1.5, colour(ray)));
        if ray.hit {
            painter.circle_filled(ends[1], 3.0, colour(ray));
        }
    }
}
