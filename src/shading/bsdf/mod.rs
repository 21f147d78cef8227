//! The BSDF of path transport: glTF's metallic-roughness material with its extensions, as pure functions.
//!
//! All directions are unit vectors in the local frame of the surface: z is the shading normal on the side of the
//! view, and both `view` and `light` point away from the surface. Layers, from the top:
//!
//! ```text
//! clearcoat ── sheen ──┬─ metallic: GGX conductor
//!                      └─ 1 - metallic ─┬─ 1 - transmission: GGX dielectric ── Lambert
//!                                       └─ transmission: glass, or thin wall
//! ```
//!
//! Anisotropy is that of metal and of opaque dielectrics; transmissive surfaces are isotropic.
//!
//! What lies below a layer is scaled by 1 minus the layer's directional albedo for the view. Single lobes are
//! reciprocal; their sum is not, since the scale depends on the view only. Transmitted light is basic radiance,
//! L / n^2: the factor (n_t / n_i)^2 of radiance is left out. It cancels on paths that begin and end in the same medium.
//!
//! Lobes of a roughness below 0.01 (alpha, its square, below 1e-4) are delta functions. An index of refraction within
//! 1e-4 of 1 is no interface.

mod albedo;
mod anisotropic;
mod dielectric;
pub(crate) mod diffuse;
mod fresnel;
mod ggx;
mod glass;
mod glass_albedo;
mod lobe;
mod opaque;
mod sheen;
mod specular;
mod table;

#[cfg(test)]
pub(crate) mod chi_squared;
#[cfg(test)]
pub(crate) mod quadrature;
#[cfg(test)]
mod tests;

use glam::DVec3;

pub(crate) use albedo::GgxAlbedo;
pub(crate) use anisotropic::AnisotropicGgx;
use anisotropic::AnisotropicSpecular;
pub(crate) use dielectric::reflectances;
use fresnel::Fresnel;
pub(crate) use fresnel::{Interface, relative_index};
pub(crate) use ggx::Ggx;
use glass::Glass;
pub(crate) use glass::SmoothGlass;
use lobe::{Lobe, LobeSample, Value};
pub(crate) use opaque::{OpaqueBsdf, OpaqueParameters};
use sheen::Sheen;
use specular::Specular;

/// Parameters of a surface point, textures multiplied in. Values out of range are clamped to it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BsdfParameters {
    /// Linear base colour, each channel 0 to 1.
    pub base_colour: DVec3,
    /// 0 dielectric to 1 metal.
    pub metallic: f64,
    /// Perceptual roughness, 0 to 1; alpha is its square.
    pub roughness: f64,
    /// Index of refraction (KHR_materials_ior): 1 is no interface, 0 or infinity reflects everything.
    pub ior: f64,
    /// Weight of the dielectric reflection, 0 to 1 (KHR_materials_specular).
    pub specular: f64,
    /// Factor of the dielectric reflectance at normal incidence, 0 or more.
    pub specular_colour: DVec3,
    /// Part of the light below the dielectric reflection that is transmitted, 0 to 1.
    pub transmission: f64,
    /// Without a volume (thickness 0): transmitted light is not refracted.
    pub thin_walled: bool,
    /// The ray hit the back face of a surface with a volume. Clearcoat and sheen are on the outside only.
    pub from_inside: bool,
    /// Weight of the clear coat, 0 to 1.
    pub clearcoat: f64,
    /// Perceptual roughness of the clear coat, 0 to 1.
    pub clearcoat_roughness: f64,
    /// Linear colour of the sheen, each channel 0 to 1. Black is no sheen.
    pub sheen_colour: DVec3,
    /// Perceptual roughness of the sheen, 0 to 1.
    pub sheen_roughness: f64,
    /// Strength of the anisotropy, 0 to 1: how much rougher metal and opaque dielectrics are along x than along y.
    pub anisotropy: f64,
}

impl Default for BsdfParameters {
    /// glTF's defaults.
    fn default() -> Self {
        BsdfParameters {
            base_colour: DVec3::ONE,
            metallic: 1.0,
            roughness: 1.0,
            ior: 1.5,
            specular: 1.0,
            specular_colour: DVec3::ONE,
            transmission: 0.0,
            thin_walled: false,
            from_inside: false,
            clearcoat: 0.0,
            clearcoat_roughness: 0.0,
            sheen_colour: DVec3::ZERO,
            sheen_roughness: 0.0,
            anisotropy: 0.0,
        }
    }
}

/// A view with a cosine that can be divided by.
#[inline(always)]
pub(crate) fn clamped_view(view: DVec3) -> DVec3 {
    DVec3::new(view.x, view.y, view.z.clamp(glass::LEAST_COSINE, 1.0))
}

impl BsdfParameters {
    /// The parameters with all values in range. A thin wall has no inside.
    pub(crate) fn clamped(&self) -> Self {
        let unit = |value: f64| if value > 0.0 { value.min(1.0) } else { 0.0 };
        let colour = |value: DVec3| DVec3::new(unit(value.x), unit(value.y), unit(value.z));
        let positive = |value: f64| if value > 0.0 { value.min(f64::MAX) } else { 0.0 };
        let tint = self.specular_colour;
        BsdfParameters {
            base_colour: colour(self.base_colour),
            metallic: unit(self.metallic),
            roughness: unit(self.roughness),
            ior: self.ior,
            specular: unit(self.specular),
            specular_colour: DVec3::new(positive(tint.x), positive(tint.y), positive(tint.z)),
            transmission: unit(self.transmission),
            thin_walled: self.thin_walled,
            from_inside: self.from_inside && !self.thin_walled,
            clearcoat: unit(self.clearcoat),
            clearcoat_roughness: unit(self.clearcoat_roughness),
            sheen_colour: colour(self.sheen_colour),
            sheen_roughness: unit(self.sheen_roughness),
            anisotropy: unit(self.anisotropy),
        }
    }
}

/// A sampled light direction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BsdfSample {
    /// Unit vector, away from the surface.
    pub direction: DVec3,
    /// Factor of the throughput: BSDF times absolute cosine over density.
    pub weight: DVec3,
    /// Density per solid angle, [`Bsdf::pdf`] of the direction; 0 where `is_delta`.
    pub pdf: f64,
    /// Whether the direction is the only one of its lobe.
    pub is_delta: bool,
    /// Whether the direction is on the other side of the surface than the view.
    pub is_transmission: bool,
}

/// A light direction sampled without branches.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct DirectionSample {
    /// Unit vector, away from the surface.
    pub(crate) direction: DVec3,
    /// Factor of the throughput: BSDF times absolute cosine over density.
    pub(crate) weight: DVec3,
    /// The density per solid angle; infinite for delta lobes; 0 where the light is absorbed, and the rest means nothing.
    pub(crate) pdf: f64,
}

/// The most lobes that a material has at once: clearcoat, sheen, specular, diffuse, and two of a thin wall.
const MAX_LOBES: usize = 6;

/// The BSDF of a surface point, prepared for one view.
#[derive(Debug, Clone, Copy)]
pub struct Bsdf {
    view: DVec3,
    /// Lobes with an albedo above 0, and the probability of each.
    lobes: [(Lobe, f64); MAX_LOBES],
    count: usize,
}

impl Bsdf {
    /// Without lobes: scatters nothing.
    pub const EMPTY: Bsdf =
        Bsdf { view: DVec3::Z, lobes: [(Lobe::Diffuse(DVec3::ZERO), 0.0); MAX_LOBES], count: 0 };

    /// The BSDF of `parameters` for `view`, a unit vector with `view.z > 0`.
    pub fn new(parameters: &BsdfParameters, view: DVec3) -> Self {
        let mut bsdf = Bsdf::EMPTY;
        bsdf.set(parameters, view);
        bsdf
    }

    /// Sets the lobes for `parameters` and `view`, as [`Bsdf::new`]. In place, because a `Bsdf` is large.
    pub fn set(&mut self, parameters: &BsdfParameters, view: DVec3) {
        self.set_view(view);
        self.count = 0;
        self.push_layers(&parameters.clamped());
        let total: f64 = self.lobes().map(|(_, weight)| weight).sum();
        self.lobes[..self.count].iter_mut().for_each(|(_, weight)| *weight /= total);
    }

    fn set_view(&mut self, view: DVec3) {
        self.view = clamped_view(view);
    }

    fn lobes(&self) -> impl Iterator<Item = &(Lobe, f64)> {
        self.lobes[..self.count].iter()
    }

    /// Adds a lobe with its albedo as the weight of its probability, if it scatters anything.
    fn push(&mut self, lobe: Lobe) {
        let weight = lobe.albedo().element_sum();
        if weight > 0.0 {
            self.lobes[self.count] = (lobe, weight);
            self.count += 1;
        }
    }

    /// Clearcoat and sheen, and what they leave for the base.
    fn push_layers(&mut self, p: &BsdfParameters) {
        let (cos, mut left) = (self.view.z, 1.0);
        if p.clearcoat > 0.0 && !p.from_inside {
            let coat = Specular::clearcoat(p.clearcoat, p.clearcoat_roughness, cos);
            left *= (1.0 - coat.albedo.max_element()).max(0.0);
            self.push(Lobe::Specular(coat));
        }
        if p.sheen_colour != DVec3::ZERO && !p.from_inside {
            let sheen = Sheen::new(p.sheen_colour, p.sheen_roughness, cos).scaled(left);
            left = (left - sheen.albedo.max_element()).max(0.0);
            self.push(Lobe::Sheen(sheen));
        }
        self.push_base(p, left);
    }

    /// Metal, opaque dielectric and transmission, times `weight`.
    fn push_base(&mut self, p: &BsdfParameters, weight: f64) {
        let (cos, ggx) = (self.view.z, Ggx::new(p.roughness));
        let metal = weight * p.metallic;
        let transparent = (weight - metal) * p.transmission;
        let opaque = weight - metal - transparent;
        if metal + opaque > 0.0 {
            self.push_reflection(p, ggx, [metal, opaque]);
        }
        if transparent > 0.0 {
            let eta = relative_index(p.ior, p.from_inside);
            // A thin wall reflects the same whichever medium is denser.
            let eta = if p.thin_walled && eta < 1.0 { 1.0 / eta } else { eta };
            let interface = Interface::new(eta, p.specular, p.specular_colour);
            if p.thin_walled {
                self.push_thin(p, ggx, &interface, transparent);
            } else {
                self.push(Lobe::Glass(Glass::new(ggx, interface, p.base_colour, transparent, cos)));
            }
        }
    }

    /// The reflection of metal and of opaque dielectric, which have the same distribution and are one lobe, and the diffuse
    /// reflection below the dielectric.
    fn push_reflection(&mut self, p: &BsdfParameters, ggx: Ggx, [metal, opaque]: [f64; 2]) {
        let anisotropic = (p.anisotropy > 0.0).then(|| AnisotropicGgx::new(p.roughness, p.anisotropy));
        let albedo =
            anisotropic.map_or_else(|| GgxAlbedo::new(ggx, self.view.z), |ggx| ggx.albedo(self.view));
        let reflectances = reflectances(p.ior, p.specular, p.specular_colour);
        let (factors, diffuse) = opaque::factors(p.base_colour, [metal, opaque], reflectances, &albedo);
        self.push(match anisotropic {
            Some(ggx) => Lobe::Anisotropic(AnisotropicSpecular::new(ggx, factors, &albedo)),
            None => Lobe::Specular(Specular::schlick(ggx, factors, &albedo)),
        });
        self.push(Lobe::Diffuse(diffuse));
    }

    /// The reflection of a thin wall, and what passes through it, times `weight`.
    fn push_thin(&mut self, p: &BsdfParameters, ggx: Ggx, interface: &Interface, weight: f64) {
        let cos = self.view.z;
        let reflected = glass::albedos(ggx, interface, cos).0;
        let f0 = interface.reflectance(1.0);
        let compensation = GgxAlbedo::new(ggx, cos).compensation(f0);
        let albedo = (reflected * compensation).min(DVec3::ONE);
        let fresnel = Fresnel::Exact(*interface, compensation * weight);
        self.push(Lobe::Specular(Specular { ggx, fresnel, albedo: albedo * weight }));
        let left = if interface.eta.is_infinite() { 0.0 } else { 1.0 - albedo.max_element() };
        let transmitted = p.base_colour * (left * weight);
        self.push(Lobe::ThinTransmission(Specular::thin(p.roughness, p.ior, transmitted, cos)));
    }

    /// BSDF times the absolute cosine of `light`, and the density of sampling it, both without delta lobes.
    pub fn eval_pdf(&self, light: DVec3) -> (DVec3, f64) {
        let mut sum = Value::ZERO;
        for (lobe, probability) in self.lobes() {
            let value = lobe.value(self.view, light);
            sum.scattered += value.scattered;
            sum.density += value.density * probability;
        }
        (sum.scattered, sum.density)
    }

    /// BSDF times the absolute cosine of `light`, a unit vector. Delta lobes are left out.
    pub fn eval(&self, light: DVec3) -> DVec3 {
        self.eval_pdf(light).0
    }

    /// The density per solid angle with which [`Bsdf::sample`] returns `light`. Its integral over the sphere is the
    /// probability of a sample that is neither absorbed nor of a delta lobe.
    pub fn pdf(&self, light: DVec3) -> f64 {
        self.eval_pdf(light).1
    }

    /// A light direction by three numbers, 0 to below 1. `None`: absorbed.
    pub fn sample(&self, numbers: [f64; 3]) -> Option<BsdfSample> {
        let mut choice = numbers[0];
        let last = self.count.checked_sub(1)?;
        let mut chosen = last;
        for (i, (_, probability)) in self.lobes().enumerate() {
            if choice < *probability || i == last {
                chosen = i;
                break;
            }
            choice -= probability;
        }
        let (lobe, probability) = &self.lobes[chosen];
        // The rest of the first number is uniform within the lobe.
        let rest = (choice / probability).clamp(0.0, 1.0 - f64::EPSILON);
        let (direction, weight, pdf, is_delta) =
            match lobe.sample(self.view, [rest, numbers[1], numbers[2]])? {
                LobeSample::Delta(direction, throughput) => (direction, throughput / *probability, 0.0, true),
                LobeSample::Scattered(direction) => {
                    let (scattered, pdf) = self.eval_pdf(direction);
                    (direction, scattered / pdf, pdf, false)
                }
            };
        let possible = direction.z != 0.0 && (is_delta || pdf > 0.0);
        possible.then_some(BsdfSample {
            direction,
            weight,
            pdf,
            is_delta,
            is_transmission: direction.z < 0.0,
        })
    }

    /// Whether no light sample can contribute: all lobes are delta functions, or there is none.
    pub fn is_delta(&self) -> bool {
        self.lobes().all(|(lobe, _)| lobe.is_delta())
    }

    /// The directional albedo by channel, by the tables of the lobes: the expected weight of a sample.
    pub fn albedo(&self) -> DVec3 {
        self.lobes().map(|(lobe, _)| lobe.albedo()).sum()
    }
}
