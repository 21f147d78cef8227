//! The BSDFs of smooth surfaces of transparent volumes ([`SmoothGlass`]), as structures of arrays.

use std::ops::Range;

use super::continuations::Continuations;
use super::light_samples::LightSamples;
use super::numbers::GenerationNumbers;
use super::vertices::{ClassPartition, Vertices};
use crate::shading::bsdf::{BsdfParameters, Interface, SmoothGlass, clamped_view, relative_index};
use crate::world::{PerRay, Vec3Soa};

/// The parameters of such BSDFs.
#[derive(Default)]
pub(super) struct SmoothGlasses {
    pub(super) members: ClassPartition,
    /// The relative index of refraction.
    eta: PerRay<f64>,
    specular: PerRay<f64>,
    specular_colour: Vec3Soa,
    tint: Vec3Soa,
}

impl SmoothGlasses {
    /// Sets the BSDF of vertices.
    pub(super) fn set(&mut self, vertices: Range<usize>, parameters: &BsdfParameters) {
        let p = parameters.clamped();
        let eta = relative_index(p.ior, p.from_inside);
        for i in vertices {
            self.eta[i] = eta;
            self.specular[i] = p.specular;
            self.specular_colour.set(i, p.specular_colour);
            self.tint.set(i, p.base_colour);
        }
    }

    /// Removes the light samples of these vertices, which cannot contribute.
    #[inline(always)]
    pub(super) fn drop_light_samples(&self, samples: &mut LightSamples) {
        for i in self.members.range() {
            samples.pdf[i] = if self.members.has(i) { 0.0 } else { samples.pdf[i] };
        }
    }

    /// Samples a direction at each vertex.
    #[inline(always)]
    pub(super) fn sample(
        &self,
        vertices: &Vertices,
        numbers: &GenerationNumbers,
        continuations: &mut Continuations,
    ) {
        for i in self.members.range() {
            let interface = Interface::new(self.eta[i], self.specular[i], self.specular_colour.get(i));
            let glass = SmoothGlass { interface, tint: self.tint.get(i) };
            let [lobe, _] = numbers.lobe_and_roulette(i);
            let sample = glass.sample(clamped_view(vertices.view.get(i)), lobe);
            continuations.set_member(&self.members, vertices, i, sample, true);
        }
    }
}
