//! Sheen of cloth: KHR_materials_sheen, the Charlie distribution of Estevez and Kulla, Production Friendly Microfacet
//! Sheen BRDF, SIGGRAPH 2017.
//!
//! The fitted masking function leaves some lobes of a sheen roughness below 0.25 with an albedo above 1 at grazing
//! views. They are scaled by the inverse of it, so that no energy is gained.

use std::f64::consts::PI;
use std::sync::OnceLock;

use glam::DVec3;

use super::albedo::view_at;
use super::ggx::half_vector;
use super::lobe::Value;
use super::table::{Table, lattice, tent};
use crate::world::sin_cos_of_turns;

/// The least alpha, of a sheen roughness of 0.1. Below it the lobe is a spike at grazing half vectors.
const MIN_ALPHA: f64 = 0.01;

/// The least cosine for which masking and visibility are evaluated. The fitted masking ends at a finite value, so
/// that the visibility term, divided by the cosines, would grow without bound at grazing directions, and the albedo
/// with it.
const MIN_COSINE: f64 = 0.01;

/// Nodes over the root of the cosine, one of them at that of [`MIN_COSINE`], and over roughness. Accuracy: test
/// `accuracy`.
const NODES: [usize; 2] = [31, 40];

/// Points of the Fibonacci lattice of a node's quadrature: two successive Fibonacci numbers.
const POINTS: [usize; 2] = [377, 233];

/// The Charlie sheen distribution.
#[derive(Debug, Clone, Copy)]
struct Charlie {
    alpha: f64,
}

impl Charlie {
    /// The distribution of a perceptual roughness, 0 to 1: alpha is its square.
    fn new(roughness: f64) -> Self {
        Charlie { alpha: (roughness * roughness).max(MIN_ALPHA) }
    }

    /// The density of microfacet normals, (2 + 1 / alpha) sin^(1 / alpha) / 2 pi (equation 2).
    fn density(self, normal: DVec3) -> f64 {
        let inverse = 1.0 / self.alpha;
        let sine2 = (normal.x * normal.x + normal.y * normal.y).min(1.0);
        (2.0 + inverse) * libm::pow(sine2, 0.5 * inverse) / (2.0 * PI)
    }

    /// The masking function Lambda as fitted in section 2.
    fn lambda(self, cos: f64) -> f64 {
        let t = (1.0 - self.alpha) * (1.0 - self.alpha);
        let mix = |rough: f64, smooth: f64| rough + (smooth - rough) * t;
        let (a, b, c) = (mix(21.5473, 25.3245), mix(3.82987, 3.32435), mix(0.19823, 0.16801));
        let (d, e) = (mix(-1.97760, -1.27393), mix(-4.32054, -4.85967));
        let l = |x: f64| a / (1.0 + b * libm::pow(x, c)) + d * x + e;
        libm::exp(if cos < 0.5 { l(cos) } else { 2.0 * l(0.5) - l((1.0 - cos).max(0.0)) })
    }

    /// Lambda at a cosine of at least [`MIN_COSINE`].
    fn masking(self, cos: f64) -> f64 {
        self.lambda(cos.max(MIN_COSINE))
    }

    /// The BRDF times the cosine of `light`. Both directions are above the surface; `masking` is that of the view.
    fn scattered(self, view: DVec3, masking: f64, light: DVec3) -> f64 {
        let Some((half, _)) = half_vector(view, light) else { return 0.0 };
        let shadowing = 1.0 + masking + self.masking(light.z);
        self.density(half) * (light.z / light.z.max(MIN_COSINE)) / (4.0 * shadowing * view.z.max(MIN_COSINE))
    }

    /// The directional albedo before scaling, which may exceed 1.
    fn albedo(self, cos: f64) -> f64 {
        static TABLE: OnceLock<Table<2, 1>> = OnceLock::new();
        let least = MIN_ALPHA.sqrt();
        let table = TABLE.get_or_init(|| {
            Table::new(NODES, |[x, y]| [Charlie::new(least + (1.0 - least) * y).integrate(x * x, POINTS)])
        });
        table.at([cos.sqrt(), (self.alpha.sqrt() - least) / (1.0 - least)])[0]
    }

    /// The directional albedo of a view with the cosine `cos` by quadrature.
    fn integrate(self, cos: f64, points: [usize; 2]) -> f64 {
        let (view, masking) = (view_at(cos), self.masking(cos));
        let mut sum = 0.0;
        for point in lattice(points) {
            let [phi, t] = [PI * tent(point[0]), tent(point[1])];
            // z = t^2, denser towards the horizon, over half a turn.
            let z = t * t;
            let sine = ((1.0 - z) * (1.0 + z)).sqrt();
            let light = DVec3::new(sine * phi.cos(), sine * phi.sin(), z);
            sum += self.scattered(view, masking, light) * 2.0 * t;
        }
        sum * 2.0 * PI / points[0] as f64
    }
}

/// The sheen lobe for one view. It is sampled uniformly over the hemisphere: the distribution is broad.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Sheen {
    distribution: Charlie,
    /// Lambda of the view.
    masking: f64,
    /// Colour and scale that keeps the albedo at most 1.
    weight: DVec3,
    /// The directional albedo.
    pub(crate) albedo: DVec3,
}

impl Sheen {
    /// The lobe of a colour, each channel 0 to 1, for a view with the cosine `cos`.
    pub(crate) fn new(colour: DVec3, roughness: f64, cos: f64) -> Self {
        let distribution = Charlie::new(roughness);
        let albedo = distribution.albedo(cos);
        let masking = distribution.masking(cos);
        Sheen { distribution, masking, weight: colour / albedo.max(1.0), albedo: colour * albedo.min(1.0) }
    }

    /// The lobe of another view, without its scale.
    #[cfg(test)]
    pub(crate) fn seen_from(&self, cos: f64) -> Self {
        Sheen { masking: self.distribution.masking(cos), ..*self }
    }

    /// The lobe times a number.
    pub(crate) fn scaled(self, factor: f64) -> Self {
        Sheen { weight: self.weight * factor, albedo: self.albedo * factor, ..self }
    }

    /// The BRDF times cosine and the density of [`Sheen::sample`].
    pub(crate) fn value(&self, view: DVec3, light: DVec3) -> Value {
        if light.z <= 0.0 {
            return Value::ZERO;
        }
        let scattered = self.weight * self.distribution.scattered(view, self.masking, light);
        Value { scattered, density: 0.5 / PI }
    }

    /// A direction with uniform density over the hemisphere.
    pub(crate) fn sample(numbers: [f64; 2]) -> DVec3 {
        let z = 1.0 - numbers[0];
        let sine = (numbers[0] * (1.0 + z)).sqrt();
        let (sin, cos) = sin_cos_of_turns(numbers[1]);
        DVec3::new(sine * cos, sine * sin, z)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The table against a quadrature with 50 times the points, between nodes.
    #[test]
    fn accuracy() {
        let (mut smooth, mut rough): (f64, f64) = (0.0, 0.0);
        for i in 0..20 {
            for j in 0..15 {
                let (cos, roughness) = ((f64::from(i) / 19.3).powi(2), 0.1 + f64::from(j) / 14.0 * 0.9);
                let charlie = Charlie::new(roughness);
                let error = (charlie.albedo(cos) - charlie.integrate(cos, [28657, 17711])).abs();
                let greatest = if roughness < 0.25 { &mut smooth } else { &mut rough };
                *greatest = greatest.max(error);
            }
        }
        assert!(smooth < 4e-3 && rough < 2e-3, "{smooth}, {rough}");
    }

    /// The integral of D cos is 1 (Estevez and Kulla, equation 2): with s = sin, D cos dm = (2 + 1 / a) s^(1 / a) s
    /// ds.
    #[test]
    fn density_is_normalised() {
        for roughness in [0.1, 0.5, 1.0] {
            let (charlie, n) = (Charlie::new(roughness), 10_000);
            let area = |i: i32| {
                let s = (f64::from(i) + 0.5) / f64::from(n);
                charlie.density(DVec3::new(s, 0.0, (1.0 - s * s).sqrt())) * 2.0 * PI * s / f64::from(n)
            };
            let sum: f64 = (0..n).map(area).sum();
            assert!((sum - 1.0).abs() < 1e-3, "roughness {roughness}: {sum}");
        }
    }
}
