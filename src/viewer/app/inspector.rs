//! Pixel inspector: its part of the panel, and the pixel's rays drawn over the picture.

use egui::{Color32, Grid, Painter, Pos2, Rect, RichText, ScrollArea, Stroke, Ui, vec2};
use glam::DVec2;

use crate::effects::EFFECTS;
use crate::import::FileNames;
use crate::viewer::elided;
use crate::viewer::inspect::{Inspection, RaySegment};
use crate::viewer::painter::Prepared;

/// Width of the values in points, so that they fit the panel.
const VALUE_WIDTH: f32 = 172.0;

/// What values of the inspection mean.
const MEANINGS: &[(&str, &str)] = &[
    ("t", "distance along the camera's ray, in units of the scene"),
    ("geometric normal", "the direction that the triangle or shape faces, of length 1"),
    (
        "shading normal",
        "the direction that light is computed with: interpolated between corners, with normal maps",
    ),
    ("barycentrics", "weights of the three corners at this point of the triangle; their sum is 1"),
    ("texture", "coordinates in the image of the texture: 0 to 1 is the whole image"),
    ("tests", "what the ray was tested against in the tree of boxes; many tests take long"),
];

/// Characters of a name in a line of the panel.
const NAME_LENGTH: usize = 28;

/// Characters of the label of a value.
const LABEL_LENGTH: usize = 16;

/// Number of bounces up to which rays are indented.
const MAX_INDENT: usize = 4;

/// Part of the panel's height that the inspection may take; it scrolls within.
const HEIGHT_SHARE: f32 = 0.5;

/// Shows the inspection at the top of the panel. Returns `false` when the user closed it.
pub(crate) fn show(ui: &mut Ui, inspection: &Inspection, names: &FileNames) -> bool {
    let (mut is_open, [x, y], [r, g, b]) = (true, inspection.pixel, inspection.displayed);
    ui.add_space(8.0);
    ui.horizontal(|ui| {
        let (swatch, _) = ui.allocate_exact_size(vec2(28.0, 14.0), egui::Sense::hover());
        ui.painter().rect_filled(swatch, 2.0, Color32::from_rgb(r, g, b));
        ui.label(RichText::new(format!("Pixel {x}, {y}")).strong());
        ui.label(format!("#{r:02x}{g:02x}{b:02x}")).on_hover_text(format!("{r} {g} {b}"));
        is_open = !ui.small_button("x").on_hover_text("Esc").clicked();
    });
    let height = ui.available_height() * HEIGHT_SHARE;
    ScrollArea::vertical().id_salt("inspection").max_height(height).show(ui, |ui| {
        rays(ui, &inspection.rays, names);
        surface(ui, inspection, names);
    });
    ui.separator();
    is_open
}

fn surface(ui: &mut Ui, inspection: &Inspection, names: &FileNames) {
    let Some(surface_info) = &inspection.surface else {
        ui.label("the background");
        return;
    };
    let vector = |v: glam::DVec3| v.to_array().map(digits).join(" ");
    Grid::new("seen").num_columns(2).max_col_width(VALUE_WIDTH).spacing([8.0, 4.0]).striped(true).show(
        ui,
        |ui| {
            let mut row = |name: &str, value: String| {
                let label = ui.label(RichText::new(elided(name, LABEL_LENGTH)).weak());
                let meaning = MEANINGS.iter().find(|(other, _)| *other == name);
                label.on_hover_text(meaning.map_or(name, |(_, meaning)| meaning));
                value_label(ui, &value);
                ui.end_row();
            };
            row("object", names.shorten(&surface_info.object_name));
            row(
                surface_info.kind,
                format!("{} ({} of the object)", surface_info.primitive, surface_info.primitive_of_object),
            );
            row("t", format!("{:.9}", surface_info.distance));
            row("position", vector(surface_info.position));
            row("geometric normal", vector(surface_info.geometric_normal));
            row("shading normal", vector(surface_info.shading_normal));
            if let Some([u, v, w]) = surface_info.barycentrics {
                row("barycentrics", [u, v, w].map(digits).join(" "));
            }
            if let Some(uv) = surface_info.uv {
                row("texture", uv.to_array().map(digits).join(" "));
            }
            row("material", names.shorten(&surface_info.material));
            for (name, value) in &surface_info.material_values {
                row(name, value.clone());
            }
            row(
                "tests",
                format!("{} boxes, {} primitives", inspection.tests.nodes, inspection.tests.primitives),
            );
        },
    );
}

/// The number with six significant digits, at most six of them after the point.
fn digits(x: f64) -> String {
    let before = if x.abs() >= 1.0 && x.is_finite() { x.abs().log10() as usize + 1 } else { 0 };
    format!("{x:.*}", 6usize.saturating_sub(before.max(1)))
}

/// A value with files by their names, long words without their middle; the whole value on hover.
fn value_label(ui: &mut Ui, value: &str) {
    let name = |word: &str| elided(word.rsplit(['/', '\\']).next().unwrap_or(word), NAME_LENGTH);
    let words: Vec<String> = value.split(' ').map(name).collect();
    let shown = words.join(" ");
    let is_whole = shown == value;
    let label = ui.label(shown);
    if !is_whole {
        label.on_hover_text(value);
    }
}

fn rays(ui: &mut Ui, rays: &[RaySegment], names: &FileNames) {
    for ray in rays {
        let object = ray.object.as_ref().map(|object| names.shorten(object));
        let result = |length: usize| match (&object, &ray.light) {
            (Some(object), Some(light)) => {
                format!("towards {}, blocked by {}", elided(light, length), elided(object, length))
            }
            (None, Some(light)) => format!("reaches {}", elided(light, length)),
            (Some(object), None) => format!("hits {}", elided(object, length)),
            (None, None) if ray.hit => "blocked".into(),
            (None, None) => "hits nothing".into(),
        };
        ui.horizontal_wrapped(|ui| {
            ui.add_space(10.0 * ray.depth.min(MAX_INDENT) as f32);
            let (swatch, _) = ui.allocate_exact_size(vec2(10.0, 10.0), egui::Sense::hover());
            ui.painter().rect_filled(swatch, 2.0, colour(ray));
            let (shown, whole) = (result(NAME_LENGTH), result(usize::MAX));
            let effect = EFFECTS.iter().find(|effect| Some(effect.id) == ray.effect);
            let meaning = effect.map_or("the ray from the camera through the pixel", |effect| effect.summary);
            ui.label(format!("{}: {shown}", ray.kind.name)).on_hover_text(format!("{whole}\n{meaning}"));
        });
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
    let size = prepared.job.view.size();
    let place = |p: DVec2| -> Pos2 {
        let share = vec2((p.x / f64::from(size[0])) as f32, (p.y / f64::from(size[1])) as f32);
        rect.min + share * rect.size()
    };
    // At another time or in another tier the recentering may differ.
    if prepared.job.recentering != of.job.recentering {
        return;
    }
    for ray in &inspection.rays {
        let Some([from, to]) = prepared.job.view.project_segment(ray.from, ray.to) else { continue };
        let ends = [place(from), place(to)];
        painter.line_segment(ends, Stroke::new(3.0, Color32::from_black_alpha(140)));
        painter.line_segment(ends, Stroke::new(1.5, colour(ray)));
        if ray.hit {
            painter.circle_filled(ends[1], 3.0, colour(ray));
        }
    }
}
