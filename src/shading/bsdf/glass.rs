//! Reflection and refraction at the surface of a transparent volume, smooth or rough.
//!
//! Walter et al., Microfacet Models for Refraction through Rough Surfaces, EGSR 2007, with the exact Fresnel
//! reflectance. What microfacets lose, light that meets the surface again, is returned by a division by the
//! directional albedo: glass loses nothing to the accuracy of its table (1.3 % from cosine 0.03 and index 1.1; 3 % at
//! index 1.02).
//!
//! The quantity transported is basic radiance, L / n^2, which refraction does not change. So the factor (n_t / n_i)^2
//! of radiance is left out. It cancels on paths that begin and end in the same medium.

use glam::DVec3;

use super::DirectionSample;
use super::albedo::GgxAlbedo;
use super::fresnel::{Interface, refracted_cosine, refraction};
use super::ggx::{Ggx, half_vector, reflect, refract};
use super::glass_albedo::GlassAlbedo;
use super::lobe::{LobeSample, Value};
use crate::world::select;

/// The least cosine between a light and the surface, far below the rounding of unit vectors.
pub(crate) const LEAST_COSINE: f64 = 1e-200;

/// The interface of a transparent volume for one view.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Glass {
    ggx: Ggx,
    interface: Interface,
    tint: DVec3,
    /// Weight of the lobe and compensation.
    scale: f64,
    /// The directional albedo.
    pub(crate) albedo: DVec3,
}

/// The parts of light that a microfacet reflects and transmits, and the probability of choosing reflection.
struct Split {
    reflected: DVec3,
    transmitted: DVec3,
    probability: f64,
}

impl Glass {
    /// The lobe of an interface whose transmitted light is multiplied by `tint`, for a view with the cosine `cos`.
    pub(crate) fn new(ggx: Ggx, interface: Interface, tint: DVec3, weight: f64, cos: f64) -> Self {
        let (reflected, transmitted) = albedos(ggx, &interface, cos);
        // Of a white tint and the channel that reflects most; the others reflect less and transmit the same.
        let all = if interface.eta == f64::INFINITY { interface.offset.max_element() } else { 1.0 };
        let scale = weight * all / (reflected.max_element() + transmitted).max(f64::MIN_POSITIVE);
        let albedo = (reflected + tint * transmitted) * scale;
        Glass { ggx, interface, tint, scale, albedo }
    }

    /// The lobe without compensation.
    #[cfg(test)]
    pub(crate) fn uncompensated(self) -> Self {
        Glass { scale: 1.0, ..self }
    }

    /// Whether the interface is smooth or none.
    pub(crate) fn is_delta(&self) -> bool {
        self.ggx.is_delta() || self.interface.eta == 1.0
    }

    fn split(&self, cos: f64) -> Split {
        let reflected = self.interface.reflectance(cos);
        let transmitted = self.tint * self.interface.transmittance(reflected);
        let (r, t) = (reflected.element_sum(), transmitted.element_sum());
        let probability = if r + t > 0.0 { r / (r + t) } else { 0.0 };
        Split { reflected: reflected * self.scale, transmitted: transmitted * self.scale, probability }
    }

    /// The BSDF times cosine and the density of [`Glass::sample`].
    pub(crate) fn value(&self, view: DVec3, light: DVec3) -> Value {
        if self.is_delta() || light.z.abs() < LEAST_COSINE {
            return Value::ZERO;
        }
        let shadowing = self.ggx.shadowing_over_cosine(view.z, light.z.abs());
        let masking = self.ggx.masking_over_cosine(view.z);
        if light.z > 0.0 {
            let Some((half, v_h)) = half_vector(view, light) else { return Value::ZERO };
            let (split, density) = (self.split(v_h), 0.25 * self.ggx.density(half));
            return Value {
                scattered: split.reflected * (density * shadowing),
                density: split.probability * density * masking,
            };
        }
        let eta = self.interface.eta;
        if eta == 0.0 || eta.is_infinite() {
            return Value::ZERO;
        }
        // The half vector of refraction (equation 16), on the side of the view.
        let sum = view + light * eta;
        let length = sum.length();
        let half = sum / if sum.z < 0.0 { -length } else { length };
        let (v_h, l_h) = (view.dot(half), light.dot(half));
        // Negated, so that NaN of a zero sum is caught.
        if !(v_h > 0.0 && l_h < 0.0) {
            return Value::ZERO;
        }
        // Solid angle of normals per solid angle of lights (equation 17), v.h of the visible normals contained.
        let density = self.ggx.density(half) * v_h * -l_h * (eta / length).powi(2);
        let split = self.split(v_h.min(1.0));
        Value {
            scattered: split.transmitted * (density * shadowing),
            density: (1.0 - split.probability) * density * masking,
        }
    }

    /// A direction: reflection or refraction by `choice`, at a visible normal. `None`: masked or absorbed.
    pub(crate) fn sample(&self, view: DVec3, choice: f64, numbers: [f64; 2]) -> Option<LobeSample> {
        if self.is_delta() {
            let smooth = SmoothGlass { interface: self.interface, tint: self.tint };
            let DirectionSample { direction, weight, pdf } = smooth.sample(view, choice);
            return (pdf > 0.0).then_some(LobeSample::Delta(direction, weight * self.scale));
        }
        let normal = self.ggx.sample_visible_normal(view, numbers)?;
        let v_m = view.dot(normal).clamp(0.0, 1.0);
        let split = self.split(v_m);
        if choice < split.probability {
            let light = reflect(view, normal);
            return (light.z > 0.0).then_some(LobeSample::Scattered(light));
        }
        if split.transmitted == DVec3::ZERO {
            return None;
        }
        let eta = self.interface.eta;
        let light = refract(view, normal, eta, v_m, refracted_cosine(eta, v_m)?).normalize();
        (light.z < 0.0).then_some(LobeSample::Scattered(light))
    }
}

/// A smooth interface, or none, of a transparent volume, without branches.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SmoothGlass {
    pub(crate) interface: Interface,
    /// Factor of the transmitted light.
    pub(crate) tint: DVec3,
}

impl SmoothGlass {
    /// The reflected or refracted direction, by `choice`.
    #[inline(always)]
    pub(crate) fn sample(&self, view: DVec3, choice: f64) -> DirectionSample {
        let eta = self.interface.eta;
        let reflected = self.interface.reflectance(view.z);
        let transmitted = self.tint * self.interface.transmittance(reflected);
        let (r, t) = (reflected.element_sum(), transmitted.element_sum());
        let probability = if r + t > 0.0 { r / (r + t) } else { 0.0 };
        let is_reflected = choice < probability;
        let (refracted, is_total) = refraction(eta, view.z);
        let through = DVec3::new(-view.x / eta, -view.y / eta, -refracted).normalize();
        let through = select(eta == 1.0, -view, through);
        let direction = select(is_reflected, DVec3::new(-view.x, -view.y, view.z), through);
        let is_possible = (is_reflected | ((t > 0.0) & !is_total)) & (direction.z != 0.0);
        DirectionSample {
            direction,
            weight: select(is_reflected, reflected / probability, transmitted / (1.0 - probability)),
            pdf: if is_possible { f64::INFINITY } else { 0.0 },
        }
    }
}

/// The directional albedos before compensation: reflected by channel, and transmitted without tint.
pub(crate) fn albedos(ggx: Ggx, interface: &Interface, cos: f64) -> (DVec3, f64) {
    let Interface { eta, offset, slope } = *interface;
    let all = GgxAlbedo::new(ggx, cos).all;
    if eta == 1.0 {
        return (DVec3::ZERO, 1.0);
    }
    if eta == 0.0 || eta.is_infinite() {
        let reflectance = if eta == 0.0 { DVec3::ONE } else { offset };
        return (reflectance * all, 0.0);
    }
    let glass = GlassAlbedo::new(ggx, eta, cos, all);
    // The reflectance is `offset + slope F`, and 1 in total internal reflection. The channel that reflects most is
    // that of the greatest offset, as all have the same reflectance at grazing incidence.
    let reflected = offset * (all - glass.total) + slope * (glass.reflected - glass.total) + glass.total;
    let reflected = reflected.clamp(DVec3::ZERO, DVec3::ONE);
    let (a, b) = (offset.max_element(), slope.min_element());
    let scattered = a * all + b * glass.scattered + (1.0 - a - b) * glass.without_partial;
    (reflected, (scattered - reflected.max_element()).clamp(0.0, 1.0))
}

#[cfg(test)]
mod tests {
    use super::super::chi_squared::Random;
    use super::super::{Bsdf, BsdfParameters};
    use super::*;

    /// Reflection and refraction by the laws of Snell and Fresnel, written with sines, from both sides: lobes are chosen by what
    /// they carry, and weights are that over the probability.
    #[test]
    fn smooth_glass_by_snell_and_fresnel() {
        let mut random = Random(5);
        let (tint, mut seen) = (DVec3::new(0.9, 0.0, 0.3), [0; 3]);
        for _ in 0..10_000 {
            let mut number = || random.number();
            let (eta, z, x) = ((2.0 * number() - 1.0).exp2(), number().max(1e-3), number());
            let sine = (1.0 - z * z).sqrt();
            let view = DVec3::new(sine * x, sine * (1.0 - x * x).sqrt(), z);
            let interface = Interface::new(eta, 1.0, DVec3::ONE);
            let choice = number();
            let sample = SmoothGlass { interface, tint }.sample(view, choice);
            assert_eq!(sample.pdf, f64::INFINITY);
            let refracted = sine / eta;
            let cos = (1.0 - refracted * refracted).max(0.0).sqrt();
            let fresnel = if refracted >= 1.0 {
                1.0
            } else {
                // sin(a - b) / sin(a + b) and tan(a - b) / tan(a + b), with the sines of both angles.
                let (difference, sum) = (sine * cos - z * refracted, sine * cos + z * refracted);
                let parallel =
                    difference * (z * cos - sine * refracted) / (sum * (z * cos + sine * refracted));
                0.5 * ((difference / sum).powi(2) + parallel * parallel)
            };
            let (r, t) = (3.0 * fresnel, tint.element_sum() * (1.0 - fresnel));
            let probability = r / (r + t);
            let (direction, weight) = if choice < probability {
                (DVec3::new(-view.x, -view.y, z), DVec3::splat(fresnel / probability))
            } else {
                let along = -view.truncate() / eta;
                (along.extend(-cos), tint * (1.0 - fresnel) / (1.0 - probability))
            };
            seen[if refracted >= 1.0 { 2 } else { usize::from(choice >= probability) }] += 1;
            // The formulas above lose digits near the critical angle, at normal incidence, and where little is refracted.
            if (refracted - 1.0).abs() > 1e-3 && sine > 1e-3 && (eta - 1.0).abs() > 1e-3 {
                assert!((sample.direction - direction).abs().max_element() < 1e-9, "{eta} {view}");
                let difference = (sample.weight - weight).abs().max_element();
                assert!(difference < 1e-7 * weight.max_element(), "{eta} {view} {difference}");
            }
        }
        assert!(seen.iter().all(|&count| count > 300), "{seen:?}");
    }

    /// Without interface light goes straight through; an infinite index reflects what the factors leave.
    #[test]
    fn smooth_glass_at_the_limits() {
        let view = DVec3::new(0.6, 0.0, 0.8);
        let bsdf = |ior, specular| {
            let p = BsdfParameters {
                base_colour: DVec3::new(0.2, 0.5, 1.0),
                metallic: 0.0,
                roughness: 0.0,
                ior,
                specular,
                transmission: 1.0,
                ..BsdfParameters::default()
            };
            Bsdf::new(&p, view)
        };
        let through = bsdf(1.0, 1.0).sample([0.5; 3]).expect("a sample");
        assert_eq!((through.direction, through.weight), (-view, DVec3::new(0.2, 0.5, 1.0)));
        for specular in [1.0, 0.25] {
            let mirrored = bsdf(0.0, specular).sample([0.5; 3]).expect("a sample");
            assert_eq!(mirrored.direction, DVec3::new(-0.6, 0.0, 0.8));
            assert_eq!(mirrored.weight, DVec3::splat(specular));
        }
        assert!(bsdf(0.0, 0.0).sample([0.5; 3]).is_none());
    }
}
