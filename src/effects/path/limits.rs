//! Limits on the bounces of paths ([`BounceLimits`]), at the vertices of a generation.

use glam::DVec3;

use super::bsdf::{can_be_delta, can_scatter};
use super::{Buffers, Path, Scatter};
#[cfg(doc)]
use crate::effects::bounce_limits::BounceLimits;
use crate::world::{InteractionSoa, World};

impl Scatter {
    /// Whether limits let the vertex of a path scatter, by perfectly specular lobes or by others.
    pub(super) fn allows(&self, path: &Path, generation: u32, is_delta: bool) -> bool {
        let counted = u32::from(path.counted);
        match self.limits.specular {
            Some(specular) if is_delta => generation - counted < specular,
            _ => counted < self.limits.depth,
        }
    }
}

impl Buffers {
    /// Whether limits end the paths at all vertices of a generation.
    pub(super) fn are_last(
        &self,
        (world, stage): (&World, &Scatter),
        surfaces: &InteractionSoa,
        generation: u32,
    ) -> bool {
        if generation < stage.limits.first() || stage.limits.specular.is_none() {
            return generation >= stage.limits.first();
        }
        !surfaces.by_material().iter().any(|(material, range)| {
            let has_delta = can_be_delta(&world.materials[*material as usize]);
            range.clone().any(|i| {
                let allows =
                    |is_delta| stage.allows(&self.paths[surfaces.ray_of()[i] as usize], generation, is_delta);
                let is_delta = || has_delta || self.vertices.crossing(i).is_hidden;
                allows(false) || allows(true) && is_delta()
            })
        })
    }

    /// Counts the paths of a generation as cut whose surfaces may scatter light.
    pub(super) fn count_cut(&mut self, world: &World, surfaces: &InteractionSoa) {
        for (material, range) in surfaces.by_material() {
            if can_scatter(&world.materials[*material as usize]) {
                let carries_light = |&i: &usize| self.vertices.throughput.get(i) != DVec3::ZERO;
                self.cut += range.clone().filter(carries_light).count() as u64;
            }
        }
    }

    /// Removes light samples and continuations by lobes that limits leave out. Counts the paths that end so as cut.
    pub(super) fn drop_ended(&mut self, stage: &Scatter, surfaces: &InteractionSoa, generation: u32) {
        let Buffers { light_samples, continuations, paths, .. } = self;
        for (i, &ray) in surfaces.ray_of().iter().enumerate() {
            let allows = |is_delta| stage.allows(&paths[ray as usize], generation, is_delta);
            if !allows(false) {
                light_samples.iter_mut().for_each(|samples| samples.pdf[i] = 0.0);
            }
            let pdf = &mut continuations.pdf[i];
            if *pdf != 0.0 && !allows(pdf.is_infinite()) {
                *pdf = 0.0;
                self.cut += 1;
            }
        }
    }
}
