//! The picture in the window: the last rendered image, and mouse input.

use std::sync::Arc;

use egui::{
    Color32, PointerButton, Pos2, Rect, Response, Sense, TextureHandle, TextureOptions, Ui, pos2, vec2,
};
use glam::{DVec2, DVec3};

use super::controls::Controls;
use super::navigate;
use super::painter::{Prepared, RenderedImage};
use super::pixels::Magnifier;
use kiln::bvh::Traversal;

/// Camera rotation in radians for a drag across the picture's height.
const TURN: f64 = std::f64::consts::PI;

/// Wheel movement in points for a zoom by a factor of e.
const WHEEL: f64 = 400.0;

/// The picture's area in the window.
#[derive(Default)]
pub(crate) struct Canvas {
    /// The last image, with its texture.
    shown: Option<(TextureHandle, Box<RenderedImage>)>,
    /// Rectangle in points.
    rect: Option<Rect>,
    magnifier: Magnifier,
    /// The pixel under the mouse.
    hovered: Option<[u32; 2]>,
}

/// Clicks of a frame.
#[derive(Default)]
pub(crate) struct MouseResult {
    /// Pixel that was clicked.
    pub clicked: Option<[u32; 2]>,
    /// Pixel that was double-clicked.
    pub focused: Option<[u32; 2]>,
}

impl Canvas {
    /// Uploads an image.
    pub(crate) fn take(&mut self, context: &egui::Context, rendered: Box<RenderedImage>) {
        let options = if rendered.factor == 1 { TextureOptions::NEAREST } else { TextureOptions::LINEAR };
        let image = Arc::clone(&rendered.image);
        match &mut self.shown {
            Some((texture, shown)) => {
                texture.set(image, options);
                *shown = rendered;
            }
            shown => *shown = Some((context.load_texture("picture", image, options), rendered)),
        }
    }

    /// The last image.
    pub(crate) fn rendered(&self) -> Option<&RenderedImage> {
        self.shown.as_ref().map(|(_, rendered)| &**rendered)
    }

    /// The prepared scene of the last image.
    pub(crate) fn prepared(&self) -> Option<&Arc<Prepared>> {
        self.rendered().map(|rendered| &rendered.prepared)
    }

    /// The picture's rectangle in points.
    pub(crate) fn rect(&self) -> Option<Rect> {
        self.rect
    }

    /// The rectangle of the whole picture in points: larger than its area if it is magnified.
    pub(crate) fn whole(&self) -> Option<Rect> {
        self.rect.map(|rect| self.magnifier.whole(rect))
    }

    /// Magnifies what is under the mouse, or shows the whole picture again.
    pub(crate) fn magnify(&mut self, context: &egui::Context) {
        if let Some(rect) = self.rect {
            let mouse = context.pointer_hover_pos().filter(|place| rect.contains(*place));
            self.magnifier.switch(mouse.unwrap_or(rect.center()), rect);
        }
    }

    /// Whether the picture is magnified, which ends.
    pub(crate) fn end_magnifying(&mut self) -> bool {
        std::mem::take(&mut self.magnifier).is_on()
    }

    /// The pixel under the mouse.
    pub(crate) fn hovered(&self) -> Option<[u32; 2]> {
        self.hovered
    }

    /// Shows the image in the available area, and moves the camera with the mouse. Returns the size of the
    /// picture for that room in pixels of the screen, and what else was done.
    pub(crate) fn show(&mut self, ui: &mut Ui, controls: &mut Controls) -> ([u32; 2], MouseResult) {
        let scale = ui.ctx().pixels_per_point();
        let available = ui.available_rect_before_wrap();
        // Aligned to physical pixels, so that images are not resampled.
        let min = pos2((available.min.x * scale).ceil(), (available.min.y * scale).ceil());
        let size = vec2((available.max.x * scale).floor() - min.x, (available.max.y * scale).floor() - min.y);
        let size = size.max(vec2(1.0, 1.0));
        let rect = Rect::from_min_size(pos2(min.x / scale, min.y / scale), size / scale);
        self.rect = Some(rect);
        let response = ui.interact(rect, ui.scope_id().with("canvas"), Sense::click_and_drag());
        let done = self.mouse(ui, &response, controls);
        if let Some((texture, _)) = &self.shown {
            let all = Rect::from_min_max(pos2(0.0, 0.0), pos2(1.0, 1.0));
            ui.painter_at(rect).image(texture.id(), self.magnifier.whole(rect), all, Color32::WHITE);
        }
        ([size.x as u32, size.y as u32], done)
    }

    /// The pixel of the picture at a position in the window.
    fn pixel(&self, place: Pos2) -> Option<[u32; 2]> {
        let (rect, whole) = (self.rect?, self.whole()?);
        let size = self.prepared()?.job().view.size();
        let share = (place - whole.min) / whole.size();
        let inside = (0.0..1.0).contains(&share.x) && (0.0..1.0).contains(&share.y);
        (inside && rect.contains(place))
            .then(|| [(share.x * size[0] as f32) as u32, (share.y * size[1] as f32) as u32])
    }

    /// The scene point that a pixel of the picture shows.
    pub(crate) fn surface(&self, [x, y]: [u32; 2]) -> Option<DVec3> {
        let job = self.prepared()?.job();
        let ray = job.view.ray(x, y, job.world.numerics().ray_precision());
        let hit = job.plan.visible_hit(&job.world, &ray, &mut Traversal::default())?;
        let point = ray.at(hit.t);
        Some(job.recentering.map_or(point, |recentering| recentering.point_back(point)))
    }

    /// The scene point in the middle of the picture.
    pub(crate) fn middle(&self) -> Option<DVec3> {
        self.surface(self.prepared()?.job().view.size().map(|side| side / 2))
    }

    fn mouse(&mut self, ui: &Ui, response: &Response, controls: &mut Controls) -> MouseResult {
        let Some(rect) = self.rect else { return MouseResult::default() };
        let camera_shown = self.prepared().map(|prepared| prepared.camera.clone());
        let camera_shown = camera_shown.as_ref();
        let delta = response.drag_delta();
        let by = DVec2::new(f64::from(delta.x), f64::from(delta.y)) / f64::from(rect.height());
        let modifiers = ui.input(|input| input.modifiers);
        if response.dragged() && self.magnifier.is_on() {
            self.magnifier.pan(delta, rect);
        } else if response.dragged() && by != DVec2::ZERO {
            let up = DVec2::new(by.x, -by.y);
            let pans = modifiers.shift || !response.dragged_by(PointerButton::Primary);
            let aspect = f64::from(rect.aspect_ratio());
            match (pans, modifiers.command) {
                (true, _) => controls.navigate(camera_shown, |camera| navigate::pan(camera, up, aspect)),
                (false, true) => {
                    controls.navigate(camera_shown, |camera| navigate::look_around(camera, up * TURN / 2.0));
                }
                (false, false) => controls.orbit(camera_shown, -up * TURN),
            }
        }
        if response.hovered() {
            let (wheel, pinch) = ui.input(|input| (input.smooth_scroll_delta().y, input.zoom_delta()));
            if let (true, Some(place)) = (self.magnifier.is_on(), response.hover_pos()) {
                self.magnifier.zoom(pinch * (wheel / WHEEL as f32).exp(), place, rect);
            } else if wheel != 0.0 || pinch != 1.0 {
                let factor = f64::from(pinch) * (f64::from(wheel) / WHEEL).exp();
                let from_middle = response.hover_pos().map_or(vec2(0.0, 0.0), |place| place - rect.center());
                let at = DVec2::new(f64::from(from_middle.x), f64::from(-from_middle.y))
                    / f64::from(rect.height());
                let aspect = f64::from(rect.aspect_ratio());
                let pixel = response.hover_pos().and_then(|place| self.pixel(place));
                let surface = pixel.and_then(|pixel| self.surface(pixel));
                controls.zoom(camera_shown, factor, surface, (at, aspect));
            }
        }
        self.hovered = response.hover_pos().and_then(|place| self.pixel(place));
        let pixel = response.interact_pointer_pos().and_then(|place| self.pixel(place));
        MouseResult {
            clicked: pixel.filter(|_| response.clicked()),
            focused: pixel.filter(|_| response.double_clicked()),
        }
    }
}
