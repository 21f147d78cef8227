//! Overlays of the picture: notices, the list of keys and legends.

use std::time::{Duration, Instant};

use egui::{
    Align2, Area, Color32, Context, Frame, Grid, Id, Rect, RichText, Sense, Stroke, TextStyle, Ui, Window,
    pos2, vec2,
};

use super::elided;
use super::false_colour::Legend;
use super::keys::LIST;

/// Display time of a notice that is not an error, and of each of its characters.
const NOTICE_TIME: [Duration; 2] = [Duration::from_secs(3), Duration::from_millis(60)];

/// Characters of a name in the legend.
const NAME_LENGTH: usize = 40;

/// Height of a picture in points below which a legend has its colours side by side.
const LOW: f32 = 600.0;

/// Width of most characters, in points.
const CHARACTER_WIDTH: f32 = 7.0;

/// A message over the picture.
pub(crate) struct Notice {
    /// Message; further lines are the hint.
    pub text: String,
    /// Whether the message is an error.
    pub is_error: bool,
    /// Time of creation.
    pub since: Instant,
}

impl Notice {
    pub(crate) fn new(text: String, is_error: bool) -> Self {
        Notice { text, is_error, since: Instant::now() }
    }

    /// Whether the display time is over. Errors have no time limit.
    pub(crate) fn is_over(&self, context: &Context) -> bool {
        let [least, of_character] = NOTICE_TIME;
        let time = least + of_character * self.text.len() as u32;
        let left = time.saturating_sub(self.since.elapsed());
        if !self.is_error {
            context.request_repaint_after(left);
        }
        !self.is_error && left.is_zero()
    }
}

/// Shows a notice at the top of the picture. Returns whether it was dismissed.
pub(crate) fn notice(context: &Context, rect: Rect, notice: &Notice) -> bool {
    let mut dismissed = false;
    let area = Area::new(Id::unique("notice")).fixed_pos(rect.min + vec2(12.0, 12.0)).constrain_to(rect);
    area.show(context, |ui| {
        let stroke = if notice.is_error { ui.visuals().error_fg_color } else { ui.visuals().hyperlink_color };
        Frame::popup(ui.style()).stroke(Stroke::new(1.5, stroke)).show(ui, |ui| {
            ui.set_max_width((rect.width() - 60.0).min(640.0));
            ui.horizontal_top(|ui| {
                let mut lines = notice.text.splitn(2, '\n');
                ui.vertical(|ui| {
                    let what = RichText::new(lines.next().unwrap_or_default()).strong();
                    ui.label(if notice.is_error { what.color(stroke) } else { what });
                    if let Some(hint) = lines.next() {
                        ui.label(hint);
                    }
                });
                dismissed = ui.small_button("x").on_hover_text("Esc").clicked();
            });
        });
    });
    dismissed
}

/// Time after which something that takes long is shown.
const PATIENCE: Duration = Duration::from_millis(300);

/// Shows in the middle of the picture what takes long, and the seconds since it began.
pub(crate) fn progress(context: &Context, rect: Rect, what: &str, since: Instant) {
    let passed = since.elapsed();
    if passed < PATIENCE {
        return context.request_repaint_after(PATIENCE - passed);
    }
    let area = Area::new(Id::unique("progress")).pivot(Align2::CENTER_CENTER).fixed_pos(rect.center());
    area.interactable(false).show(context, |ui| {
        Frame::popup(ui.style()).show(ui, |ui| {
            ui.horizontal(|ui| {
                ui.spinner();
                ui.label(format!("{what}, {:.0} s", passed.as_secs_f64()));
            });
        });
    });
}

/// Shows the list of keys.
pub(crate) fn keys(context: &Context, open: &mut bool) {
    let window = Window::new("Keys").open(open).resizable(false).collapsible(false);
    // It scrolls in a low window.
    let height = context.viewport_rect().height() - 100.0;
    window.default_pos(pos2(40.0, 20.0)).vscroll(true).default_height(height).show(context, |ui| {
        Grid::new("keys").num_columns(2).striped(true).show(ui, |ui| {
            for (keys, meaning) in LIST {
                ui.label(RichText::new(*keys).strong());
                ui.label(*meaning);
                ui.end_row();
            }
        });
    });
}

/// Shows the legend of false colours at the bottom of the picture.
pub(crate) fn legend(context: &Context, rect: Rect, legend: &Legend) {
    let area = Area::new(Id::unique("legend"))
        .pivot(Align2::LEFT_BOTTOM)
        .fixed_pos(rect.left_bottom() + vec2(12.0, -12.0));
    area.interactable(false).show(context, |ui| {
        Frame::popup(ui.style()).show(ui, |ui| {
            ui.set_max_width(rect.width() - 60.0);
            ui.label(&legend.text);
            if let (false, Some([low, high])) = (legend.bar.is_empty(), &legend.ends) {
                ui.horizontal(|ui| {
                    ui.label(low);
                    let (bar, _) =
                        ui.allocate_exact_size(vec2((rect.width() * 0.25).min(160.0), 10.0), Sense::hover());
                    let step = bar.width() / legend.bar.len() as f32;
                    for (i, &[r, g, b]) in legend.bar.iter().enumerate() {
                        let min = pos2(bar.left() + i as f32 * step, bar.top());
                        let part = Rect::from_min_size(min, vec2(step + 0.5, bar.height()));
                        ui.painter().rect_filled(part, 0.0, Color32::from_rgb(r, g, b));
                    }
                    ui.label(high);
                });
            }
            // In a low picture side by side, so that it stays visible.
            let (is_low, length) = match rect.height() < LOW {
                true => (true, rect.width() * 0.25 / CHARACTER_WIDTH),
                false => (false, f32::INFINITY),
            };
            let swatches = |ui: &mut Ui| {
                for (colour, name) in &legend.swatches {
                    swatch(ui, *colour, &elided(name, NAME_LENGTH.min((length as usize).max(3))));
                }
            };
            if is_low { ui.horizontal_wrapped(swatches).inner } else { swatches(ui) }
        });
    });
}

/// A colour and its meaning, as one widget.
fn swatch(ui: &mut Ui, [r, g, b]: [u8; 3], name: &str) {
    let colour = ui.visuals().text_color();
    let text = ui.painter().layout_no_wrap(name.to_owned(), TextStyle::Body.resolve(ui.style()), colour);
    let size = vec2(18.0 + text.size().x, text.size().y.max(12.0));
    let (rect, _) = ui.allocate_exact_size(size, Sense::hover());
    let square = Rect::from_center_size(rect.left_center() + vec2(6.0, 0.0), vec2(12.0, 12.0));
    ui.painter().rect_filled(square, 2.0, Color32::from_rgb(r, g, b));
    ui.painter().galley(rect.left_top() + vec2(18.0, 0.0), text, colour);
}
