//! What the OpenEXR file of a job states of its picture.

use crate::film::{ColourPipeline, ExrAttributes, Matrix};
use crate::job::RenderJob;
use crate::render::aov::AovSelection;
use crate::scene::BitDepth;

impl RenderJob {
    /// The attributes of an OpenEXR file of the picture with these AOVs.
    pub fn exr_attributes(&self, selection: &AovSelection) -> ExrAttributes {
        // Column by column, a matrix of column vectors is that of row vectors row by row.
        let matrix = |matrix: glam::DMat4| Matrix(matrix.to_cols_array().map(|value| value as f32));
        ExrAttributes {
            size: self.view.size(),
            pixel_aspect: self.view.pixel_aspect() as f32,
            matrices: self.view.matrices(self.recentering.as_ref()).map(|both| both.map(matrix)),
            is_linear: self.pipeline() == ColourPipeline::Linear,
            has_half_floats: self.settings.picture.bits == Some(BitDepth::Sixteen),
            texts: selection.texts(&self.world),
        }
    }
}
