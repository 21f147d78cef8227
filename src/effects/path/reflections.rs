//! The BSDFs of surfaces without clearcoat, sheen and transmission ([`Reflection`]), as structures of arrays.

use glam::DVec3;

use super::continuations::Continuations;
use super::light_samples::LightSamples;
use super::numbers::GenerationNumbers;
use super::vertices::{Members, Vertices};
use crate::shading::bsdf::{
    BsdfParameters, Ggx, GgxAlbedo, OF_A_MIRROR, Reflection, ReflectionParameters, clamped_view,
    reflectances, to_unit,
};
use crate::world::{PerRay, Vec3Soa, select};

/// The parameters of such BSDFs.
#[derive(Default)]
pub(super) struct Reflections {
    pub(super) members: Members,
    base_colour: Vec3Soa,
    metallic: PerRay<f64>,
    roughness: PerRay<f64>,
    /// The reflectances of the dielectric at normal and at grazing incidence.
    f0: Vec3Soa,
    f90: Vec3Soa,
    /// Positions in the table of albedos, then its values.
    table: [PerRay<f64>; 2],
}

impl Reflections {
    /// Sets the BSDF of a vertex.
    #[inline(always)]
    pub(super) fn set(&mut self, i: usize, parameters: &BsdfParameters) {
        let p = parameters.clamped();
        let [f0, f90] = reflectances(p.ior, p.specular, p.specular_colour);
        self.base_colour.set(i, p.base_colour);
        self.metallic[i] = p.metallic;
        self.roughness[i] = p.roughness;
        self.f0.set(i, f0);
        self.f90.set(i, f90);
    }

    /// Computes positions in the table of albedos.
    #[inline(always)]
    pub(super) fn find_positions(&mut self, vertices: &Vertices) {
        for i in self.members.range() {
            let position = to_unit(Ggx::new(self.roughness[i]), clamped_view(vertices.view.get(i)).z);
            (self.table[0][i], self.table[1][i]) = position.into();
        }
    }

    /// Replaces positions in the table by its values.
    pub(super) fn look_up(&mut self) {
        for i in self.members.range() {
            // The table is built when it is first needed.
            let values = match Ggx::new(self.roughness[i]).is_delta() {
                true => OF_A_MIRROR,
                false => GgxAlbedo::table().at([self.table[0][i], self.table[1][i]]),
            };
            (self.table[0][i], self.table[1][i]) = values.into();
        }
    }

    /// The BSDF of a vertex, and the view.
    #[inline(always)]
    fn get(&self, vertices: &Vertices, i: usize) -> (Reflection, DVec3) {
        let view = clamped_view(vertices.view.get(i));
        let parameters = ReflectionParameters {
            base_colour: self.base_colour.get(i),
            metallic: self.metallic[i],
            ggx: Ggx::new(self.roughness[i]),
            reflectances: [self.f0.get(i), self.f90.get(i)],
        };
        let albedo = GgxAlbedo::from_values([self.table[0][i], self.table[1][i]], view.z);
        (Reflection::new(&parameters, &albedo), view)
    }

    /// Evaluates the BSDFs for light samples.
    #[inline(always)]
    pub(super) fn eval(&self, vertices: &Vertices, samples: &mut LightSamples) {
        for i in self.members.range() {
            let is_member = self.members.has(i);
            let (reflection, view) = self.get(vertices, i);
            let (value, pdf) = reflection.eval_pdf(view, samples.local.get(i));
            let is_delta = is_member & reflection.is_delta();
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
            let (reflection, view) = self.get(vertices, i);
            let [[u, v], [lobe, _]] = [numbers.direction(i), numbers.lobe_and_roulette(i)];
            let sample = reflection.sample(view, [lobe, u, v]);
            continuations.set_member(&self.members, vertices, i, sample, reflection.is_delta());
        }
    }
}
