//! The outline of the selected object over the picture: the border of its pixels.

use std::sync::Arc;
use std::sync::mpsc::{Receiver, TryRecvError, channel};

use egui::{Color32, ColorImage, Context, Painter, Rect, TextureHandle, TextureOptions, pos2};

use crate::painter::Prepared;
use kiln::error::Result;
use kiln::render::RenderControl;
use kiln::render::aov::{self, AovSelection};
use kiln::scene::{Sampling, is_named};

/// Colour of the outline.
const COLOUR: Color32 = Color32::from_rgb(255, 150, 30);

/// Width of the outline in pixels.
const WIDTH: usize = 2;

/// Index of the object that each pixel shows at its centre, negative for none.
type Objects = Vec<f32>;

/// The outline of the selected object, for the last picture.
#[derive(Default)]
pub(crate) struct Outline {
    /// The objects of a picture, and their computation.
    objects: Option<(Arc<Prepared>, Objects)>,
    pending: Option<(Arc<Prepared>, Receiver<Result<Objects>>)>,
    /// The outline of a name in the picture of `objects`, and whether it has any pixel.
    drawn: Option<(String, TextureHandle, bool)>,
}

impl Outline {
    /// Draws the outline of the selected object over its picture, if that is known by now; otherwise its computation
    /// begins. Returns `false` if no pixel of the picture shows the object.
    pub(crate) fn draw(
        &mut self,
        painter: &Painter,
        rect: Rect,
        prepared: &Arc<Prepared>,
        selected: &str,
        threads: &Arc<rayon::ThreadPool>,
    ) -> bool {
        self.receive();
        let is_known = self.objects.as_ref().is_some_and(|(of, _)| Arc::ptr_eq(of, prepared));
        if !is_known {
            self.compute(painter.ctx(), prepared, threads);
            return true;
        }
        let Some((_, objects)) = &self.objects else { return true };
        if self.drawn.as_ref().is_none_or(|(name, ..)| name != selected) {
            let world = &prepared.job().world;
            let is_selected: Vec<bool> = objects
                .iter()
                .map(|&id| id >= 0.0 && is_named(&world.objects[id as usize].name, selected))
                .collect();
            let image = border(&is_selected, prepared.job().view.size().map(|side| side as usize));
            let texture = painter.ctx().load_texture("outline", image, TextureOptions::NEAREST);
            self.drawn = Some((selected.to_owned(), texture, is_selected.contains(&true)));
        }
        let Some((_, texture, has_pixels)) = &self.drawn else { return true };
        let whole = Rect::from_min_max(pos2(0.0, 0.0), pos2(1.0, 1.0));
        painter.image(texture.id(), rect, whole, Color32::WHITE);
        *has_pixels
    }

    fn receive(&mut self) {
        let Some((_, receiver)) = &self.pending else { return };
        match receiver.try_recv() {
            Err(TryRecvError::Empty) => {}
            Ok(Ok(objects)) => {
                self.objects = self.pending.take().map(|(prepared, _)| (prepared, objects));
                self.drawn = None;
            }
            Ok(Err(_)) | Err(TryRecvError::Disconnected) => self.pending = None,
        }
    }

    /// Computes the objects of a picture on a thread, one picture at a time.
    fn compute(&mut self, context: &Context, prepared: &Arc<Prepared>, threads: &Arc<rayon::ThreadPool>) {
        if self.pending.is_some() {
            return;
        }
        let (sender, receiver) = channel();
        self.pending = Some((Arc::clone(prepared), receiver));
        let (prepared, threads, context) = (Arc::clone(prepared), Arc::clone(threads), context.clone());
        std::thread::spawn(move || {
            // The receiver is dropped when the window closes.
            let _ = sender.send(threads.install(|| objects(&prepared)));
            context.request_repaint();
        });
    }
}

/// The objects that the pixels of a picture show.
fn objects(prepared: &Prepared) -> Result<Objects> {
    let mut job = prepared.job().with_size(prepared.job().view.size())?;
    job.set_sampling(Sampling::default())?;
    let selection = AovSelection::new(&["object".to_owned()])?;
    let channels = aov::channels(&job.aov_source(None), &selection, &RenderControl::default())?;
    Ok(channels.into_iter().next().map(|channel| channel.values).unwrap_or_default())
}

/// An image of the selected pixels that are not more than [`WIDTH`] from others, transparent elsewhere. The border of
/// the image counts as others.
fn border(is_selected: &[bool], [width, height]: [usize; 2]) -> ColorImage {
    let others = |x: usize, y: usize| {
        let rows = y.checked_sub(WIDTH).zip((y + WIDTH < height).then_some(y + WIDTH));
        let columns = x.checked_sub(WIDTH).zip((x + WIDTH < width).then_some(x + WIDTH));
        let (Some((top, bottom)), Some((left, right))) = (rows, columns) else { return true };
        let at = |x: usize, y: usize| is_selected[y * width + x];
        !(top..=bottom).all(|y| at(x, y)) || !(left..=right).all(|x| at(x, y))
    };
    let colour = |i: usize| match is_selected[i] && others(i % width, i / width) {
        true => COLOUR,
        false => Color32::TRANSPARENT,
    };
    ColorImage::new([width, height], (0..width * height).map(colour).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A square of 7 x 7 pixels in a picture of 9 x 9: the middle 3 x 3 are farther than two pixels from others.
    #[test]
    fn the_outline_is_two_pixels_wide_and_within_the_object() {
        let is_selected: Vec<bool> =
            (0..81).map(|i| (1..8).contains(&(i % 9)) && (1..8).contains(&(i / 9))).collect();
        let image = border(&is_selected, [9, 9]);
        let drawn = |x: usize, y: usize| image.pixels[y * 9 + x] == COLOUR;
        for y in 0..9 {
            for x in 0..9 {
                let is_middle = (3..6).contains(&x) && (3..6).contains(&y);
                assert_eq!(drawn(x, y), is_selected[y * 9 + x] && !is_middle, "{x} {y}");
            }
        }
    }
}
