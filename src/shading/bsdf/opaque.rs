//! The reflection of metal and of opaque dielectrics, without branches: GGX, over Lambert's diffuse reflection.

use glam::DVec3;

use super::DirectionSample;
use super::albedo::GgxAlbedo;
use super::diffuse;
use super::fresnel::schlick_weight;
use super::ggx::{Ggx, reflect};
use crate::world::select;

/// Parameters of [`OpaqueBsdf`] at a surface point, each number 0 to 1.
#[derive(Debug, Clone, Copy)]
pub(crate) struct OpaqueParameters {
    pub(crate) base_colour: DVec3,
    pub(crate) metallic: f64,
    pub(crate) ggx: Ggx,
    /// The reflectances of the dielectric at normal and grazing incidence: [`super::reflectances`].
    pub(crate) reflectances: [DVec3; 2],
}

/// A BSDF without clearcoat, sheen and transmission, for one view.
#[derive(Debug, Clone, Copy)]
pub(crate) struct OpaqueBsdf {
    ggx: Ggx,
    /// Fresnel factors at normal and grazing incidence.
    f0: DVec3,
    f90: DVec3,
    /// The albedo of the diffuse reflection.
    diffuse: DVec3,
    /// The probabilities of the reflection and of the diffuse reflection; NaN where nothing is reflected.
    probabilities: [f64; 2],
}

/// The Fresnel factors of a reflection at normal and grazing incidence, and the albedo of the diffuse reflection below it.
/// `metal` and `opaque` are the weights of metal and of dielectric.
#[inline(always)]
pub(crate) fn factors(
    base_colour: DVec3,
    [metal, opaque]: [f64; 2],
    reflectances: [DVec3; 2],
    albedo: &GgxAlbedo,
) -> ([DVec3; 2], DVec3) {
    // Metals: the base colour at normal incidence (glTF 2.0, appendix B.2.1). One of 1 reflects all light.
    let [metal_f0, metal_f90] = albedo.compensated([base_colour, DVec3::ONE]);
    let [f0, f90] = albedo.compensated(reflectances);
    let diffuse = base_colour * (opaque * (1.0 - albedo.of(f0, f90).max_element()).max(0.0));
    ([metal_f0 * metal + f0 * opaque, metal_f90 * metal + f90 * opaque], diffuse)
}

impl OpaqueBsdf {
    /// The BSDF for a view whose albedos are given.
    #[inline(always)]
    pub(crate) fn new(p: &OpaqueParameters, albedo: &GgxAlbedo) -> Self {
        let weights = [p.metallic, 1.0 - p.metallic];
        let ([f0, f90], diffuse) = factors(p.base_colour, weights, p.reflectances, albedo);
        let weights = [albedo.of(f0, f90).element_sum(), diffuse.element_sum()];
        let total = weights[0] + weights[1];
        let probabilities = [weights[0] / total, weights[1] / total];
        OpaqueBsdf { ggx: p.ggx, f0, f90, diffuse, probabilities }
    }

    /// Whether no light sample can contribute: a mirror, or black.
    #[inline(always)]
    pub(crate) fn is_delta(&self) -> bool {
        // NaN is not above 0.
        let [is_reflected, is_diffuse] = [self.probabilities[0] > 0.0, self.probabilities[1] > 0.0];
        !is_diffuse & (self.ggx.is_delta() | !is_reflected)
    }

    #[inline(always)]
    fn fresnel(&self, cos: f64) -> DVec3 {
        self.f0 + (self.f90 - self.f0) * schlick_weight(cos)
    }

    /// The BSDF times the cosine of `light`, and the density per solid angle of sampling it, both without mirrors.
    #[inline(always)]
    pub(crate) fn eval_pdf(&self, view: DVec3, light: DVec3) -> (DVec3, f64) {
        let (scattered, density, v_h) = self.ggx.reflection(view, light);
        let (diffuse, diffuse_density) = diffuse::eval_pdf(self.diffuse, light);
        let [reflection, below] = self.probabilities;
        (self.fresnel(v_h) * scattered + diffuse, density * reflection + diffuse_density * below)
    }

    /// A light direction by three numbers, 0 to below 1: the choice of the lobe, and two for the direction.
    #[inline(always)]
    pub(crate) fn sample(&self, view: DVec3, [choice, u, v]: [f64; 3]) -> DirectionSample {
        let is_reflected = choice < self.probabilities[0];
        let is_mirrored = is_reflected & self.ggx.is_delta();
        let (normal, has_normal) = self.ggx.visible_normal(view, [u, v]);
        let direction = select(is_reflected, reflect(view, normal), diffuse::sample([u, v]));
        let direction = select(is_mirrored, DVec3::new(-view.x, -view.y, view.z), direction);
        let (scattered, density) = self.eval_pdf(view, direction);
        let mirrored = self.fresnel(view.z) / self.probabilities[0];
        let is_possible = (has_normal | !is_reflected) & (direction.z > 0.0) & (density > 0.0);
        let density = if is_possible { density } else { 0.0 };
        DirectionSample {
            direction,
            weight: select(is_mirrored, mirrored, scattered / density),
            pdf: if is_mirrored { f64::INFINITY } else { density },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::chi_squared::Random;
    use super::super::{Bsdf, BsdfParameters, reflectances};
    use super::*;

    /// Values and samples are those of [`Bsdf`], bit for bit: metals, dielectrics and mixtures, mirrors, black.
    #[test]
    fn as_the_general_bsdf() {
        let mut random = Random(3);
        let mut seen = [0; 4];
        for case in 0..20_000u32 {
            let mut number = || random.number();
            let roughness = if case % 3 == 0 { 0.0 } else { number() };
            let metallic = [0.0, 1.0, number()][case as usize / 3 % 3];
            let base_colour = if case % 11 == 0 { DVec3::ZERO } else { DVec3::new(number(), number(), 1.0) };
            let specular = if case % 5 == 0 { 0.0 } else { number() };
            let p = BsdfParameters {
                base_colour,
                metallic,
                roughness,
                specular,
                specular_colour: DVec3::new(2.0, 1.0, 0.5),
                ..BsdfParameters::default()
            };
            let direction = |z: f64, turn: f64| {
                let (sine, (sin, cos)) = ((1.0 - z * z).sqrt(), crate::world::sin_cos_of_turns(turn));
                DVec3::new(sine * cos, sine * sin, z)
            };
            let view = direction(number().max(1e-3), number());
            let light = direction(2.0 * number() - 1.0, number());
            let bsdf = Bsdf::new(&p, view);
            let ggx = Ggx::new(roughness);
            let reflectances = reflectances(p.ior, specular, p.specular_colour);
            let parameters = OpaqueParameters { base_colour, metallic, ggx, reflectances };
            let opaque = OpaqueBsdf::new(&parameters, &GgxAlbedo::new(ggx, view.z));
            assert_eq!(opaque.is_delta(), bsdf.is_delta(), "{p:?}");
            if !bsdf.is_delta() {
                assert_eq!(opaque.eval_pdf(view, light), bsdf.eval_pdf(light), "{p:?}");
            }
            let numbers = [number(), number(), number()];
            let sample = opaque.sample(view, numbers);
            match bsdf.sample(numbers) {
                None => assert_eq!(sample.pdf, 0.0, "{p:?}"),
                Some(expected) => {
                    let pdf = if expected.is_delta { f64::INFINITY } else { expected.pdf };
                    assert_eq!((sample.direction, sample.pdf), (expected.direction, pdf), "{p:?}");
                    assert_eq!(sample.weight, expected.weight, "{p:?}");
                }
            }
            let kind = if sample.pdf.is_infinite() { 0 } else { 1 + usize::from(sample.pdf > 0.0) };
            seen[kind] += 1;
            seen[3] += u32::from(bsdf.is_delta());
        }
        assert!(seen.iter().all(|&count| count > 300), "{seen:?}");
    }
}
