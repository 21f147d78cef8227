//! Errors between the two sides of a comparison.

use std::sync::Arc;

use glam::DVec3;
use rayon::prelude::*;

use super::pass::PipelineImage;
use super::{Message, MessageSender};
use kiln::metrics::{self, Errors, Values};

/// Errors between two images, in display values.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Comparison {
    /// Largest difference of a channel; white is 1.
    pub max: f64,
    /// Root mean square difference.
    pub rmse: f64,
    /// Mean LDR-FLIP.
    pub flip: f64,
}

/// Compares both images on `threads`, in parallel to the painter's next request, and sends the result.
pub(crate) fn compare_sides(
    request: u64,
    pictures: [PipelineImage; 2],
    threads: &Arc<rayon::ThreadPool>,
    sender: &MessageSender,
) {
    let sender = sender.clone();
    threads.spawn(move || {
        let [a, b] = pictures.each_ref().map(displayed);
        let figures = Errors::between(&a, &b).ok().and_then(|errors| errors.figures);
        if let Some(figures) = figures {
            let comparison = Comparison { max: figures.max, rmse: figures.rmse, flip: figures.flip };
            sender.send(Message::Compared(request, comparison));
        }
    });
}

fn displayed(picture: &PipelineImage) -> metrics::ComparedImage {
    let [width, height] = picture.size;
    let &PipelineImage { pipeline, display, .. } = picture;
    let shown = |pixel: &[f32; 3]| {
        display.displayed(pipeline, DVec3::from(pixel.map(f64::from))).as_vec3().to_array()
    };
    let pixels = picture.pixels.par_iter().map(shown).collect();
    metrics::ComparedImage { width, height, values: Values::Display, pixels, alpha: None }
}
