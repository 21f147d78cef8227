//! The BSDFs of surfaces of metal and opaque dielectrics ([`OpaqueBsdf`]), as structures of arrays.

use std::ops::Range;

use glam::DVec3;

use super::continuations::Continuations;
use super::light_samples::LightSamples;
use super::numbers::GenerationNumbers;
use super::vertices::{ClassPartition, Vertices};
use crate::shading::bsdf::{
    BsdfParameters, Ggx, GgxAlbedo, OpaqueBsdf, OpaqueParameters, clamped_view, reflectances,
};
use crate::world::{PerRay, Vec3Soa, select, simd};

/// The parameters of such BSDFs.
#[derive(Default)]
pub(super) struct OpaqueBsdfs {
    pub(super) members: ClassPartition,
    base_colour: Vec3Soa,
    metallic: PerRay<f64>,
    roughness: PerRay<f64>,
    /// The reflectances of the dielectric at normal and at grazing incidence.
    f0: Vec3Soa,
    f90: Vec3Soa,
    /// Positions in the table of albedos, and its values there.
    position: [PerRay<f64>; 2],
    albedo: [PerRay<f64>; 2],
}

impl OpaqueBsdfs {
    /// Sets the BSDF of vertices.
    pub(super) fn set(&mut self, vertices: Range<usize>, parameters: &BsdfParameters) {
        let p = parameters.clamped();
        let [f0, f90] = reflectances(p.ior, p.specular, p.specular_colour);
        for i in vertices {
            self.base_colour.set(i, p.base_colour);
            self.metallic[i] = p.metallic;
            self.roughness[i] = p.roughness;
            self.f0.set(i, f0);
            self.f90.set(i, f90);
        }
    }

    /// Looks up the albedos.
    pub(super) fn find_albedos(&mut self, vertices: &Vertices) {
        simd!(self.find_positions(vertices));
        for i in self.members.range().filter(|&i| self.members.has(i)) {
            let position = [self.position[0][i], self.position[1][i]];
            let values = GgxAlbedo::values(Ggx::new(self.roughness[i]), position);
            (self.albedo[0][i], self.albedo[1][i]) = values.into();
        }
    }

    #[inline(always)]
    fn find_positions(&mut self, vertices: &Vertices) {
        for i in self.members.range() {
            let cos = clamped_view(vertices.view.get(i)).z;
            let position = GgxAlbedo::position(Ggx::new(self.roughness[i]), cos);
            (self.position[0][i], self.position[1][i]) = position.into();
        }
    }

    /// The BSDF of a vertex, and the view.
    #[inline(always)]
    fn get(&self, vertices: &Vertices, i: usize) -> (OpaqueBsdf, DVec3) {
        let view = clamped_view(vertices.view.get(i));
        let parameters = OpaqueParameters {
            base_colour: self.base_colour.get(i),
            metallic: self.metallic[i],
            ggx: Ggx::new(self.roughness[i]),
            reflectances: [self.f0.get(i), self.f90.get(i)],
        };
        let albedo = GgxAlbedo::from_values([self.albedo[0][i], self.albedo[1][i]], view.z);
        (OpaqueBsdf::new(&parameters, &albedo), view)
    }

    /// Evaluates the BSDFs for light samples.
    #[inline(always)]
    pub(super) fn eval(&self, vertices: &Vertices, samples: &mut LightSamples) {
        for i in self.members.range() {
            let is_member = self.members.has(i);
            let (bsdf, view) = self.get(vertices, i);
            let (value, pdf) = bsdf.eval_pdf(view, samples.local.get(i));
            let is_delta = is_member & bsdf.is_delta();
            samples.value.set(i, select(is_member, value, samples.value.get(i)));
            samples.bsdf_pdf[i] = if is_member { pdf } else { samples.bsdf_pdf[i] };
            samples.pdf[i] = if is_delta { 0.0 } else { samples.pdf[i] };
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
            let (bsdf, view) = self.get(vertices, i);
            let [[u, v], [lobe, _]] = [numbers.direction(i), numbers.lobe_and_roulette(i)];
            let sample = bsdf.sample(view, [lobe, u, v]);
            continuations.set_member(&self.members, vertices, i, sample, bsdf.is_delta());
        }
    }
}
