//! Colours of the interface: those of egui, with text that has a contrast of at least 4.5 : 1 (WCAG 2.2, 1.4.3).

use egui::style::ScrollStyle;
use egui::{Color32, Context, Theme, Visuals};

/// Sets the colours of both themes, and visible scroll bars.
pub(crate) fn set(context: &Context) {
    for theme in [Theme::Dark, Theme::Light] {
        context.set_visuals_of(theme, visuals(theme));
    }
    // Bars that show where lists go on, and room for the lists of the panel.
    context.all_styles_mut(|style| {
        (style.spacing.scroll, style.spacing.combo_height) = (ScrollStyle::thin(), 320.0);
    });
}

fn visuals(theme: Theme) -> Visuals {
    let mut visuals = theme.default_visuals();
    let (text, weak, error) = match theme {
        Theme::Dark => (205, 165, Color32::from_rgb(255, 125, 115)),
        Theme::Light => (40, 90, Color32::from_rgb(185, 0, 0)),
    };
    visuals.widgets.noninteractive.fg_stroke.color = Color32::from_gray(text);
    visuals.weak_text_color = Some(Color32::from_gray(weak));
    visuals.error_fg_color = error;
    visuals.disabled_alpha = 0.75;
    visuals
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;
    use kiln::film::colour::{luminance, srgb_decode};

    /// Contrast ratio of WCAG 2.2: (lighter + 0.05) / (darker + 0.05), of relative luminances.
    fn contrast(a: Color32, b: Color32) -> f64 {
        let of = |colour: Color32| {
            let [r, g, b, _] = colour.to_array().map(|c| srgb_decode(f64::from(c) / 255.0));
            luminance(DVec3::new(r, g, b)) + 0.05
        };
        let (a, b) = (of(a), of(b));
        a.max(b) / a.min(b)
    }

    #[test]
    fn contrasts_are_those_of_wcag() {
        assert!((contrast(Color32::WHITE, Color32::BLACK) - 21.0).abs() < 1e-9);
        // #767676 is the lightest grey with 4.5 : 1 on white.
        assert!(contrast(Color32::from_gray(0x76), Color32::WHITE) >= 4.5);
        assert!(contrast(Color32::from_gray(0x77), Color32::WHITE) < 4.5);
    }

    #[test]
    fn every_label_has_enough_contrast() {
        for theme in [Theme::Dark, Theme::Light] {
            let visuals = visuals(theme);
            let widgets = &visuals.widgets;
            let striped = visuals.panel_fill.blend(visuals.faint_bg_color);
            let mut pairs = Vec::new();
            for background in [visuals.panel_fill, visuals.window_fill, striped] {
                let labels = [
                    visuals.text_color(),
                    visuals.strong_text_color(),
                    visuals.weak_text_color(),
                    visuals.error_fg_color,
                    widgets.inactive.fg_stroke.color,
                ];
                pairs.extend(labels.map(|label| (label, background)));
                // Only labels of check boxes are disabled.
                let disabled = visuals.disable(widgets.noninteractive.fg_stroke.color);
                pairs.push((background.blend(disabled), background));
            }
            for state in [&widgets.inactive, &widgets.hovered, &widgets.active, &widgets.open] {
                pairs.push((state.fg_stroke.color, state.weak_bg_fill));
            }
            pairs.push((visuals.selection.stroke.color, visuals.selection.bg_fill));
            pairs.push((visuals.weak_text_color(), visuals.extreme_bg_color));
            for (text, background) in pairs {
                let ratio = contrast(text, background);
                assert!(ratio >= 4.5, "{theme:?}: {text:?} on {background:?} has {ratio:.2}");
            }
        }
    }
}
