//! The alpha channel of a picture with a transparent background.

use std::sync::Arc;

use glam::DVec3;

use super::RenderJob;
use crate::effects::Choices;
use crate::error::Result;
use crate::film::{Colour, ColourPipeline};
use crate::render::RenderControl;
use crate::scene::{Material, Phong, Transport};
use crate::shading::ShadingMode;
use crate::world::{PreparedMaterial, World};

impl RenderJob {
    /// The part of each pixel that surfaces cover, by their opacity, 0 to 1, row by row from the top: a picture of white surfaces
    /// on black, with the pixels' own samples and filter.
    ///
    /// # Errors
    /// Those of [`RenderJob::render`].
    pub fn coverage(&self, control: &RenderControl) -> Result<Vec<f32>> {
        // Emission, because vertex colours tint reflected light.
        let white = |material: &PreparedMaterial| {
            let emission = Colour::Linear(DVec3::ONE);
            let plain =
                Phong { ambient: 0.0, emission, opacity: material.opacity().cloned(), ..Phong::default() };
            Material::Phong(plain).map_colours(|colour| colour.to_pipeline(ColourPipeline::Linear))
        };
        let mut world = World::clone(&self.world);
        world.materials = self.world.materials.iter().map(white).collect();
        (world.background, world.environment, world.pipeline) = (DVec3::ZERO, None, ColourPipeline::Linear);
        let choices = Choices {
            shading: ShadingMode::Ambient,
            transport: Some(Transport::Whitted),
            with: Vec::new(),
            ..self.choices.clone()
        };
        let job = RenderJob::new(
            Arc::new(world),
            self.recentering,
            self.camera.clone(),
            self.view.size(),
            choices,
        )?;
        let job = RenderJob { window: self.window, share: self.share, ..job };
        let (film, _) = job.render::<[f32; 3]>(control)?;
        // Filters with negative lobes can leave the range.
        Ok(film.rows().map(|pixel| pixel[0].clamp(0.0, 1.0)).collect())
    }
}
