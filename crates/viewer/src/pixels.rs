//! Single pixels of the displayed picture: the magnifier, and values under the mouse.

use egui::{Pos2, Rect, Vec2};
use glam::DVec3;

use super::painter::RenderedImage;
use kiln::film::DisplayTransform;

/// Magnification that the key switches on, and the largest.
const FIRST: f32 = 8.0;
const MOST: f32 = 64.0;

/// Magnification of the displayed picture, whose pixels become squares. The camera stays.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Magnifier {
    /// Magnification, 1 for none.
    factor: f32,
    /// Place of the picture's corner from that of its area, in points; not above 0.
    offset: Vec2,
}

impl Default for Magnifier {
    fn default() -> Self {
        Magnifier { factor: 1.0, offset: Vec2::ZERO }
    }
}

impl Magnifier {
    /// Whether the picture is magnified.
    pub(crate) fn is_on(&self) -> bool {
        self.factor > 1.0
    }

    /// The rectangle of the whole picture, of which `area` is seen.
    pub(crate) fn whole(&self, area: Rect) -> Rect {
        let size = area.size() * self.factor;
        Rect::from_min_size(area.min + self.offset.clamp(area.size() - size, Vec2::ZERO), size)
    }

    /// Magnifies further by `factor`; what is at `place` stays there.
    pub(crate) fn zoom(&mut self, factor: f32, place: Pos2, area: Rect) {
        let (before, whole) = (self.factor, self.whole(area));
        self.factor = (before * factor).clamp(1.0, MOST);
        self.offset = place - area.min - (place - whole.min) * (self.factor / before);
        self.offset = self.whole(area).min - area.min;
    }

    /// Moves the magnified picture.
    pub(crate) fn pan(&mut self, by: Vec2, area: Rect) {
        self.offset += by;
        self.offset = self.whole(area).min - area.min;
    }

    /// Switches it on at a place, or off.
    pub(crate) fn switch(&mut self, place: Pos2, area: Rect) {
        match self.is_on() {
            true => *self = Magnifier::default(),
            false => self.zoom(FIRST, place, area),
        }
    }
}

/// Values of a pixel of the picture: of the film, before exposure and tone map, once that is finished, and as displayed.
pub(crate) fn values(rendered: &RenderedImage, [x, y]: [u32; 2]) -> String {
    let factor = rendered.factor.max(1);
    let [width, height] = rendered.image.size;
    let [column, row] = [(x / factor) as usize, (y / factor) as usize];
    let colour = rendered.image.pixels[row.min(height - 1) * width + column.min(width - 1)];
    let [r, g, b, _] = colour.to_array();
    let film = rendered.film.as_ref().map_or(String::new(), |film| {
        let [r, g, b] = linear(film.pixel(x, y), rendered.display);
        format!("{r:.4} {g:.4} {b:.4}  ")
    });
    format!("{x}, {y}  {film}#{r:02x}{g:02x}{b:02x}")
}

/// The value of a film's pixel; as displayed for colours that bypass the exposure.
fn linear(pixel: [f32; 3], display: DisplayTransform) -> [f32; 3] {
    match DisplayTransform::is_kept(pixel) {
        true => display.apply(DVec3::from(pixel.map(f64::from))).as_vec3().to_array(),
        false => pixel,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use egui::{pos2, vec2};

    /// Magnified 8 times about a place, the place stays, and the picture covers its area.
    #[test]
    fn the_place_under_the_mouse_stays_and_the_picture_covers_its_area() {
        let area = Rect::from_min_size(pos2(10.0, 20.0), vec2(200.0, 100.0));
        let mut magnifier = Magnifier::default();
        assert_eq!(magnifier.whole(area), area);
        let place = pos2(60.0, 45.0);
        magnifier.switch(place, area);
        // A quarter of the width and of the height of the picture: 400 and 200 of 1600 and 800 points.
        assert_eq!(magnifier.whole(area), Rect::from_min_size(pos2(-340.0, -155.0), vec2(1600.0, 800.0)));
        magnifier.pan(vec2(1e6, -1e6), area);
        assert_eq!(magnifier.whole(area).min, pos2(10.0, 120.0 - 800.0));
        magnifier.zoom(1e-3, place, area);
        assert!(!magnifier.is_on() && magnifier.whole(area) == area);
    }

    /// Colours that bypass the exposure have the values that are displayed.
    #[test]
    fn values_are_those_of_the_film() {
        let display = DisplayTransform::new(1.0, kiln::film::tone::ToneMap::None);
        assert_eq!(linear([0.5, 4.0, 0.0], display), [0.5, 4.0, 0.0]);
        let kept = DVec3::new(0.25, 0.5, 1.0);
        assert_eq!(linear(DisplayTransform::keep(kept), display), [0.25, 0.5, 1.0]);
    }
}
