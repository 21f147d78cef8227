//! The anisotropic GGX distribution, and reflection by its microfacets (KHR_materials_anisotropy).
//!
//! The x axis of the local frame is the direction in which the surface is rougher.

use std::f64::consts::PI;
use std::sync::OnceLock;

use glam::DVec3;

use super::albedo::GgxAlbedo;
use super::fresnel::schlick_weight;
use super::ggx::{Ggx, MIN_ALPHA, half_vector, reflect};
use super::lobe::{LobeSample, Value};
use super::table::Table;
#[cfg(test)]
use super::table::lattice;

/// Nodes of the table of albedos over cosine, azimuth, roughness and strength. The greatest error is stated by the test
/// `accuracy`.
const NODES: [usize; 4] = [16, 10, 11, 11];

/// Points of the Fibonacci lattice of a node's quadrature: two successive Fibonacci numbers.
#[cfg(test)]
const POINTS: [usize; 2] = [233, 144];

/// The table: of the position of a node, [`node`]. Integrating it takes 0.36 s.
static STORED: &[u8] = include_bytes!("anisotropic_albedo.bin");

/// An anisotropic GGX distribution (Burley, Physically-Based Shading at Disney, 2012, appendix B.2; Heitz, Understanding
/// the Masking-Shadowing Function in Microfacet-Based BRDFs, JCGT 3(2), 2014, section 5.4).
#[derive(Debug, Clone, Copy)]
pub(crate) struct AnisotropicGgx {
    roughness: f64,
    strength: f64,
    /// Alpha along x and y, and 1.
    alpha: DVec3,
}

impl AnisotropicGgx {
    /// The distribution of a perceptual roughness and a strength, each 0 to 1. A smooth surface, whose isotropic lobe is
    /// a mirror, has the least alpha along y.
    pub(crate) fn new(roughness: f64, strength: f64) -> Self {
        let across = Ggx::new(roughness).alpha().max(MIN_ALPHA);
        let share = strength * strength;
        let along = across * (1.0 - share) + share;
        AnisotropicGgx { roughness, strength, alpha: DVec3::new(along, across, 1.0) }
    }

    /// The density of microfacet normals, D.
    fn density(self, normal: DVec3) -> f64 {
        let t = (normal / self.alpha).length_squared();
        1.0 / (PI * self.alpha.x * self.alpha.y * t * t)
    }

    /// cos (1 + 2 Lambda) of a direction.
    fn smith(self, direction: DVec3) -> f64 {
        (direction * self.alpha).length()
    }

    /// Smith's masking G1 of a direction, divided by its cosine.
    fn masking_over_cosine(self, view: DVec3) -> f64 {
        2.0 / (view.z + self.smith(view))
    }

    /// The height-correlated masking and shadowing G2, divided by the cosine of the view.
    fn shadowing_over_cosine(self, view: DVec3, light: DVec3) -> f64 {
        2.0 * light.z / (view.z * self.smith(light) + light.z * self.smith(view))
    }

    /// As [`Ggx::reflection`]; `None` where nothing is reflected.
    pub(crate) fn reflection(self, view: DVec3, light: DVec3) -> Option<(f64, f64, f64)> {
        let (half, v_h) = half_vector(view, light).filter(|_| light.z > 0.0)?;
        let density = 0.25 * self.density(half);
        let scattered = density * self.shadowing_over_cosine(view, light);
        Some((scattered, density * self.masking_over_cosine(view), v_h))
    }

    /// A normal with the density of those that a view sees: of alpha 1 in the space that is stretched by alpha (Heitz,
    /// Sampling the GGX Distribution of Visible Normals, JCGT 7(4), 2018).
    fn sample_visible_normal(self, view: DVec3, numbers: [f64; 2]) -> Option<DVec3> {
        let stretched = (view * self.alpha).normalize();
        let normal = Ggx::new(1.0).sample_visible_normal(stretched, numbers)?;
        (normal * self.alpha).try_normalize().filter(|normal| normal.z > 0.0)
    }

    /// The directional albedos of a view, by the table.
    pub(crate) fn albedo(self, view: DVec3) -> GgxAlbedo {
        static TABLE: OnceLock<Table<4, 2>> = OnceLock::new();
        let table = TABLE.get_or_init(|| Table::from_bytes(NODES, STORED));
        GgxAlbedo::from_values(table.at(self.to_unit(view)), view.z)
    }

    /// The position of a view in the table: of the cosine as for isotropic surfaces of the roughness that the view sees,
    /// of the azimuth |x| / (|x| + |y|), and roughness and strength.
    fn to_unit(self, view: DVec3) -> [f64; 4] {
        let (x, y) = (view.x.abs(), view.y.abs());
        let azimuth = if x + y > 0.0 { x / (x + y) } else { 0.5 };
        let alpha = self.seen_alpha(azimuth);
        let x = (view.z * (1.0 + alpha) / (view.z + alpha)).min(1.0);
        let least = MIN_ALPHA.sqrt();
        [1.0 - (1.0 - x.sqrt()).sqrt(), azimuth, (self.roughness - least) / (1.0 - least), self.strength]
    }

    /// Alpha in the direction of an azimuth, as in [`AnisotropicGgx::to_unit`].
    fn seen_alpha(self, azimuth: f64) -> f64 {
        let direction = DVec3::new(azimuth, 1.0 - azimuth, 0.0).normalize();
        (direction * self.alpha).length()
    }

    /// The albedos as means of G2 / G1 over visible normals, denser towards grazing ones.
    #[cfg(test)]
    fn integrate(self, view: DVec3, points: [usize; 2]) -> GgxAlbedo {
        let (mut all, mut schlick) = (0.0, 0.0);
        for [s, t] in lattice(points) {
            let Some(normal) = self.sample_visible_normal(view, [s, 1.0 - t * t]) else { continue };
            let light = reflect(view, normal);
            if light.z > 0.0 {
                let unmasked = self.shadowing_over_cosine(view, light) / self.masking_over_cosine(view);
                all += unmasked * 2.0 * t;
                schlick += unmasked * 2.0 * t * schlick_weight(view.dot(normal));
            }
        }
        let count = points[0] as f64;
        GgxAlbedo { all: all / count, schlick: schlick / count }
    }
}

/// The inverse of [`AnisotropicGgx::to_unit`].
#[cfg(test)]
fn from_unit(position: [f64; 4]) -> (AnisotropicGgx, DVec3) {
    let least = MIN_ALPHA.sqrt();
    let ggx = AnisotropicGgx::new((least + (1.0 - least) * position[2]).min(1.0), position[3]);
    let (alpha, root) = (ggx.seen_alpha(position[1]), position[0] * (2.0 - position[0]));
    let x = root * root;
    // Not 0, by which masking is divided.
    let cos = (x * alpha / (1.0 + alpha - x)).clamp(1e-9, 1.0);
    let across = DVec3::new(position[1], 1.0 - position[1], 0.0).normalize();
    (ggx, across * ((1.0 - cos) * (1.0 + cos)).sqrt() + DVec3::Z * cos)
}

/// The values of the table, as those of isotropic surfaces.
#[cfg(test)]
fn node(position: [f64; 4]) -> [f64; 2] {
    let (ggx, view) = from_unit(position);
    let albedo = ggx.integrate(view, POINTS);
    [albedo.all, albedo.schlick / albedo.all - schlick_weight(view.z)]
}

/// A reflection lobe with Schlick's approximation, weights and compensation in its factors.
#[derive(Debug, Clone, Copy)]
pub(crate) struct AnisotropicSpecular {
    ggx: AnisotropicGgx,
    f0: DVec3,
    f90: DVec3,
    /// The directional albedo.
    pub(crate) albedo: DVec3,
}

impl AnisotropicSpecular {
    pub(crate) fn new(ggx: AnisotropicGgx, [f0, f90]: [DVec3; 2], albedo: &GgxAlbedo) -> Self {
        AnisotropicSpecular { ggx, f0, f90, albedo: albedo.of(f0, f90) }
    }

    /// The BRDF times cosine and the density of [`AnisotropicSpecular::sample`].
    pub(crate) fn value(&self, view: DVec3, light: DVec3) -> Value {
        let Some((scattered, density, v_h)) = self.ggx.reflection(view, light) else { return Value::ZERO };
        Value { scattered: (self.f0 + (self.f90 - self.f0) * schlick_weight(v_h)) * scattered, density }
    }

    /// A direction from a visible normal. `None`: below the surface.
    pub(crate) fn sample(&self, view: DVec3, numbers: [f64; 2]) -> Option<LobeSample> {
        let light = reflect(view, self.ggx.sample_visible_normal(view, numbers)?);
        (light.z > 0.0).then_some(LobeSample::Scattered(light))
    }
}

#[cfg(test)]
mod tests {
    use super::super::chi_squared::Random;
    use super::*;

    #[test]
    fn the_stored_table_is_that_of_the_integral() {
        super::super::table::check_stored("anisotropic_albedo.bin", STORED, NODES, node);
    }

    fn direction(cos: f64, phi: f64) -> DVec3 {
        let sine = (1.0 - cos * cos).sqrt();
        DVec3::new(sine * phi.cos(), sine * phi.sin(), cos)
    }

    /// The integral of D cos is 1, and that of the visible normals' density, for every view (Heitz 2014, equations 3
    /// and 16). With slopes (x, y) = (alpha_x p, alpha_y q), D cos dm = D cos^4 dx dy; over p and q, polar with radius
    /// s / (1 - s), by the midpoint rule.
    #[test]
    fn densities_are_normalised() {
        let n = 400;
        for (roughness, strength) in [(0.1, 0.3), (0.3, 0.7), (0.5, 1.0), (1.0, 0.5)] {
            let ggx = AnisotropicGgx::new(roughness, strength);
            for (cos, phi) in [(0.05, 0.2), (0.3, 1.4), (0.7, 2.5), (1.0, 0.0)] {
                let view = direction(cos, phi);
                let (mut area, mut visible) = (0.0, 0.0);
                for i in 0..n {
                    let s = (f64::from(i) + 0.5) / f64::from(n);
                    let radius = s / (1.0 - s);
                    let polar = radius / (1.0 - s).powi(2) * 2.0 * PI / f64::from(n * n);
                    for j in 0..n {
                        let turn = (f64::from(j) + 0.5) / f64::from(n) * 2.0 * PI;
                        let slope = DVec3::new(turn.cos(), turn.sin(), 0.0) * radius * ggx.alpha;
                        let m = (slope + DVec3::Z).normalize();
                        // d(omega) = cos^3 dx dy.
                        let measure = m.z.powi(3) * polar * ggx.alpha.x * ggx.alpha.y;
                        area += ggx.density(m) * m.z * measure;
                        let seen = view.dot(m).max(0.0);
                        visible += ggx.masking_over_cosine(view) * ggx.density(m) * seen * measure;
                    }
                }
                assert!((area - 1.0).abs() < 1e-4, "{ggx:?}: {area}");
                assert!((visible - 1.0).abs() < 3e-3, "{ggx:?}, {view}: {visible}");
            }
        }
    }

    /// Strength 0 is the isotropic distribution: alpha is the same in all directions.
    #[test]
    fn without_strength_it_is_isotropic() {
        let (ggx, isotropic) = (AnisotropicGgx::new(0.6, 0.0), Ggx::new(0.6));
        let mut random = Random(2);
        for _ in 0..1000 {
            let mut direction = || direction(random.number().max(0.01), 6.0 * random.number());
            let (view, light) = (direction(), direction());
            let near = |a: f64, b: f64| (a - b).abs() < 1e-12 * b;
            assert!(near(ggx.density(light), isotropic.density(light)));
            assert!(near(ggx.masking_over_cosine(view), isotropic.masking_over_cosine(view.z)));
            let shadowing = isotropic.shadowing_over_cosine(view.z, light.z);
            assert!(near(ggx.shadowing_over_cosine(view, light), shadowing));
        }
    }

    /// Reflection is reciprocal: BRDF times both cosines is the same with the directions exchanged.
    #[test]
    fn reflection_is_reciprocal() {
        let ggx = AnisotropicGgx::new(0.3, 0.8);
        let albedo = GgxAlbedo { all: 1.0, schlick: 0.0 };
        let lobe = AnisotropicSpecular::new(ggx, [DVec3::new(0.1, 0.5, 0.9), DVec3::ONE], &albedo);
        let mut random = Random(4);
        for _ in 0..1000 {
            let mut direction = || direction(random.number().max(0.01), 6.0 * random.number());
            let (view, light) = (direction(), direction());
            let (there, back) = (lobe.value(view, light).scattered, lobe.value(light, view).scattered);
            let difference = (there * view.z - back * light.z).abs();
            assert!(difference.max_element() < 1e-12 * (there * view.z).max_element(), "{view} {light}");
        }
    }

    /// The table against a quadrature with 40 times the points, between nodes: the greatest error of either albedo.
    #[test]
    fn accuracy() {
        let (mut greatest, mut at): (f64, _) = (0.0, [0.0; 4]);
        for i in 0..7 * 6 * 6 * 6 {
            let mut rest = i;
            let mut unit = |n: i32| (f64::from(rest % n) / (f64::from(n) - 0.7), rest /= n).0;
            let position = [unit(7), unit(6), unit(6), unit(6)];
            let (ggx, view) = from_unit(position);
            let (is, expected) = (ggx.albedo(view), ggx.integrate(view, [10946, 6765]));
            let error = (is.all - expected.all).abs().max((is.schlick - expected.schlick).abs());
            if error > greatest {
                (greatest, at) = (error, position);
            }
        }
        assert!(greatest < 0.02, "{greatest} at {at:?}");
    }
}
