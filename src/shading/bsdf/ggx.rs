//! The GGX distribution of microfacet normals with Smith's masking and shadowing.
//!
//! Directions are in the local frame, z is the macroscopic normal. Masking functions are divided by the cosine that
//! the microfacet BSDF divides by, which keeps all values finite at grazing views.

use std::f64::consts::PI;

use glam::DVec3;

use crate::world::sin_cos_of_turns;

/// The least alpha (the square of the roughness) that is integrated as a distribution. Smoother surfaces, of a
/// perceptual roughness below 0.01 and a highlight of 20 arc seconds, are perfect mirrors or refract perfectly: delta
/// lobes.
pub(crate) const MIN_ALPHA: f64 = 1e-4;

/// An isotropic GGX distribution (Walter et al., Microfacet Models for Refraction through Rough Surfaces, EGSR 2007).
#[derive(Debug, Clone, Copy)]
pub(crate) struct Ggx {
    alpha: f64,
}

impl Ggx {
    /// The distribution of a perceptual roughness, 0 to 1: alpha is its square (glTF 2.0, appendix B.2.3).
    #[inline(always)]
    pub(crate) fn new(roughness: f64) -> Self {
        Ggx { alpha: roughness * roughness }
    }

    /// Alpha, 0 to 1.
    #[inline(always)]
    pub(crate) fn alpha(self) -> f64 {
        self.alpha
    }

    /// Whether the surface is smooth: its lobe is a delta function.
    #[inline(always)]
    pub(crate) fn is_delta(self) -> bool {
        self.alpha < MIN_ALPHA
    }

    /// The density of microfacet normals, D: their area per solid angle and macroscopic area.
    #[inline(always)]
    pub(crate) fn density(self, normal: DVec3) -> f64 {
        let a2 = self.alpha * self.alpha;
        let t = normal.x * normal.x + normal.y * normal.y + a2 * normal.z * normal.z;
        a2 / (PI * t * t)
    }

    /// cos (1 + 2 Lambda(cos)), where Lambda is Smith's function of GGX.
    #[inline(always)]
    fn smith(self, cos: f64) -> f64 {
        let a2 = self.alpha * self.alpha;
        (a2 + (1.0 - a2) * cos * cos).sqrt()
    }

    /// Smith's masking G1 of a direction, divided by its cosine.
    #[inline(always)]
    pub(crate) fn masking_over_cosine(self, cos: f64) -> f64 {
        2.0 / (cos + self.smith(cos))
    }

    /// The height-correlated masking and shadowing G2 (Heitz, Understanding the Masking-Shadowing Function in
    /// Microfacet-Based BRDFs, JCGT 3(2), 2014, equation 99), divided by the cosine of the view. Refraction uses it,
    /// too.
    ///
    /// `view` and `light` are absolute cosines.
    #[inline(always)]
    pub(crate) fn shadowing_over_cosine(self, view: f64, light: f64) -> f64 {
        2.0 * light / (view * self.smith(light) + light * self.smith(view))
    }

    /// The reflection between two directions, without the Fresnel factor and without branches: D G2 / (4 |n.v|), the
    /// density of [`reflect`] at [`Ggx::visible_normal`], and v.h. The first two are 0 where nothing is reflected.
    #[inline(always)]
    pub(crate) fn reflection(self, view: DVec3, light: DVec3) -> (f64, f64, f64) {
        let (half, v_h, exists) = half_vector_or_any(view, light);
        let is_reflected = exists & (light.z > 0.0) & !self.is_delta();
        let density = 0.25 * self.density(half);
        let select = |value: f64| if is_reflected { value } else { 0.0 };
        let scattered = select(density * self.shadowing_over_cosine(view.z, light.z));
        (scattered, select(density * self.masking_over_cosine(view.z)), v_h)
    }

    /// A normal with the density of those that a view sees, G1 D max(0, v.m) / v.z, by uniform points on spherical
    /// caps (Dupuy and Benyoub, Sampling Visible GGX Normals with Spherical Caps, HPG 2023). `None` where rounding
    /// leaves no normal.
    #[inline]
    pub(crate) fn sample_visible_normal(self, view: DVec3, numbers: [f64; 2]) -> Option<DVec3> {
        let (normal, exists) = self.visible_normal(view, numbers);
        exists.then_some(normal)
    }

    /// [`Ggx::sample_visible_normal`] without branches: the normal, and whether there is one.
    #[inline(always)]
    pub(crate) fn visible_normal(self, view: DVec3, numbers: [f64; 2]) -> (DVec3, bool) {
        let stretched = DVec3::new(view.x * self.alpha, view.y * self.alpha, view.z).normalize();
        // A point of the cap z > -stretched.z. 1 - z and 1 + z are products and sums of positive numbers.
        let height = 1.0 + stretched.z;
        let below_top = numbers[1] * height;
        let above_bottom = (1.0 - numbers[1]) * height + (1.0 - stretched.z);
        let sine = (below_top * above_bottom).max(0.0).sqrt();
        let (sin_phi, cos_phi) = sin_cos_of_turns(numbers[0]);
        let half = DVec3::new(
            (sine * cos_phi + stretched.x) * self.alpha,
            (sine * sin_phi + stretched.y) * self.alpha,
            (1.0 - numbers[1]) * height,
        );
        let scale = half.length_recip();
        let normal = half * scale;
        (normal, (scale > 0.0) & (scale < f64::INFINITY) & (normal.z > 0.0))
    }
}

/// The mirror direction of `view` about `normal`.
#[inline(always)]
pub(crate) fn reflect(view: DVec3, normal: DVec3) -> DVec3 {
    normal * (2.0 * view.dot(normal)) - view
}

/// The refraction of `view` at `normal`, with the relative index `eta`, v.m and the refracted cosine.
pub(crate) fn refract(view: DVec3, normal: DVec3, eta: f64, v_m: f64, refracted: f64) -> DVec3 {
    normal * (v_m / eta - refracted) - view / eta
}

/// The half vector of view and light, and its cosine to either. `None` where they are opposite.
pub(crate) fn half_vector(view: DVec3, light: DVec3) -> Option<(DVec3, f64)> {
    let (half, cos, exists) = half_vector_or_any(view, light);
    exists.then_some((half, cos))
}

/// [`half_vector`] without branches: also whether there is one.
#[inline(always)]
fn half_vector_or_any(view: DVec3, light: DVec3) -> (DVec3, f64, bool) {
    let sum = view + light;
    // v.h = |v + l| / 2, without the loss of digits of v.h.
    let length = sum.length();
    (sum / length, (0.5 * length).min(1.0), length > 1e-150)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn direction(cos: f64, phi: f64) -> DVec3 {
        let sine = (1.0 - cos * cos).sqrt();
        DVec3::new(sine * phi.cos(), sine * phi.sin(), cos)
    }

    /// The integral of D cos is 1, and that of the visible normals' density, for every view (Heitz 2014, equations 3
    /// and 16). Midpoint rule over s, where the tangent of the polar angle is alpha s / (1 - s).
    #[test]
    fn densities_are_normalised() {
        let n = 400;
        for alpha in [0.01f64, 0.2, 1.0] {
            let ggx = Ggx { alpha };
            for cos in [1e-3, 0.3, 1.0] {
                let view = direction(cos, 0.4);
                let (mut area, mut visible) = (0.0, 0.0);
                for i in 0..n {
                    let s = (f64::from(i) + 0.5) / f64::from(n);
                    let tan = alpha * s / (1.0 - s);
                    let c = 1.0 / (1.0 + tan * tan).sqrt();
                    // d(cos) = c^3 tan d(tan), d(tan) = alpha / (1 - s)^2 ds
                    let measure = c.powi(3) * tan * alpha / (1.0 - s).powi(2) * 2.0 * PI / f64::from(n * n);
                    for j in 0..n {
                        let m = direction(c, (f64::from(j) + 0.5) / f64::from(n) * 2.0 * PI);
                        area += ggx.density(m) * m.z * measure;
                        let seen = view.dot(m).max(0.0);
                        visible += ggx.masking_over_cosine(cos) * ggx.density(m) * seen * measure;
                    }
                }
                assert!((area - 1.0).abs() < 1e-4, "alpha {alpha}: {area}");
                assert!((visible - 1.0).abs() < 2e-3, "alpha {alpha}, cosine {cos}: {visible}");
            }
        }
    }

    /// Alpha 1, v.z = 1, l.z = 0.5: Lambda(v) = 0, Lambda(l) = (-1 + sqrt(1 + 3)) / 2 = 0.5, G2 = 1 / (1 + 0.5) = 2 /
    /// 3, G1(l) / l.z = (2 / 3) / 0.5 = 4 / 3. D(z) = 1 / pi.
    #[test]
    fn by_hand() {
        let ggx = Ggx::new(1.0);
        assert!((ggx.shadowing_over_cosine(1.0, 0.5) - 2.0 / 3.0).abs() < 1e-15);
        assert!((ggx.masking_over_cosine(0.5) - 4.0 / 3.0).abs() < 1e-15);
        assert!((ggx.density(DVec3::Z) - 1.0 / PI).abs() < 1e-15);
    }
}
