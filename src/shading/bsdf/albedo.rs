//! Directional albedo of the GGX reflection lobe, tabulated over cosine and roughness.
//!
//! The albedo for a Fresnel factor of 1 is E; the part by which Schlick's weight (1 - v.h)^5 contributes is B. A lobe
//! with Schlick's approximation has the albedo F0 (E - B) + F90 B. Light that leaves the single-scattering model
//! after several reflections between microfacets is 1 - E; Turquin, Practical Multiple Scattering Compensation for
//! Microfacet Models, 2019, returns it by the factor 1 + F0 (1 - E) / E.

use std::sync::OnceLock;

use glam::DVec3;

use super::fresnel::schlick_weight;
#[cfg(test)]
use super::ggx::reflect;
use super::ggx::{Ggx, MIN_ALPHA};
use super::table::Table;

/// Nodes over cosine and roughness. The greatest error of E is stated by the test `accuracy`.
const NODES: [usize; 2] = [46, 44];

/// Points of the quadrature of a node: azimuths of half a turn, and polar positions.
#[cfg(test)]
const POINTS: [usize; 2] = [24, 40];

/// The table: of the position of a node, [`node`]. Integrating it takes 70 ms.
static STORED: &[u8] = include_bytes!("ggx_albedo.bin");

/// The directional albedos of the reflection lobe of one roughness and view.
#[derive(Debug, Clone, Copy)]
pub(crate) struct GgxAlbedo {
    /// Albedo for a Fresnel factor of 1, above 0.3.
    pub(crate) all: f64,
    /// Albedo for the Fresnel factor (1 - v.h)^5.
    pub(crate) schlick: f64,
}

impl GgxAlbedo {
    /// The albedos of a view with the cosine `cos`, 0 to 1. A smooth surface is a mirror.
    pub(crate) fn new(ggx: Ggx, cos: f64) -> Self {
        Self::from_values(Self::values(ggx, Self::position(ggx, cos)), cos)
    }

    /// The position of a view with the cosine `cos` in the table.
    #[inline(always)]
    pub(crate) fn position(ggx: Ggx, cos: f64) -> [f64; 2] {
        to_unit(ggx, cos)
    }

    /// The values of the table at a position.
    #[inline]
    pub(crate) fn values(ggx: Ggx, position: [f64; 2]) -> [f64; 2] {
        if ggx.is_delta() {
            return [1.0, 0.0];
        }
        static TABLE: OnceLock<Table<2, 2>> = OnceLock::new();
        TABLE.get_or_init(|| Table::from_bytes(NODES, STORED)).at(position)
    }

    /// The albedos by the values of the table, for the cosine `cos`.
    #[inline(always)]
    pub(crate) fn from_values([all, excess]: [f64; 2], cos: f64) -> Self {
        GgxAlbedo { all, schlick: (all * (excess + schlick_weight(cos))).max(0.0).min(all) }
    }

    /// Turquin's compensation for a reflectance at normal incidence.
    #[inline(always)]
    pub(crate) fn compensation(&self, f0: DVec3) -> DVec3 {
        DVec3::ONE + f0 * ((1.0 - self.all) / self.all)
    }

    /// Fresnel factors at normal and grazing incidence with the compensation of multiple scattering.
    #[inline(always)]
    pub(crate) fn compensated(&self, [f0, f90]: [DVec3; 2]) -> [DVec3; 2] {
        let compensation = self.compensation(f0);
        [f0 * compensation, f90 * compensation]
    }

    /// The albedo for Schlick's approximation between `f0` and `f90`.
    #[inline(always)]
    pub(crate) fn of(&self, f0: DVec3, f90: DVec3) -> DVec3 {
        f0 * (self.all - self.schlick) + f90 * self.schlick
    }
}

/// The position in the table. Masking depends on cosine / alpha at grazing views and hardly on the cosine elsewhere:
/// the coordinate is 1 - sqrt(1 - sqrt(x)) of x = cos (1 + alpha) / (cos + alpha), which spreads both ends. The other
/// is the perceptual roughness.
#[inline(always)]
pub(crate) fn to_unit(ggx: Ggx, cos: f64) -> [f64; 2] {
    let alpha = ggx.alpha();
    let least = MIN_ALPHA.sqrt();
    let x = (cos * (1.0 + alpha) / (cos + alpha)).min(1.0);
    [1.0 - (1.0 - x.sqrt()).sqrt(), (alpha.sqrt() - least) / (1.0 - least)]
}

/// The inverse of [`to_unit`].
pub(crate) fn from_unit(position: [f64; 2]) -> (Ggx, f64) {
    let least = MIN_ALPHA.sqrt();
    let roughness = (least + (1.0 - least) * position[1]).min(1.0);
    let (ggx, root) = (Ggx::new(roughness), position[0] * (2.0 - position[0]));
    let x = root * root;
    (ggx, (x * ggx.alpha() / (1.0 + ggx.alpha() - x)).min(1.0))
}

/// The view with a cosine, in the plane y = 0.
pub(crate) fn view_at(cos: f64) -> DVec3 {
    DVec3::new(((1.0 - cos) * (1.0 + cos)).sqrt(), 0.0, cos)
}

/// The albedos as the mean of G2 / G1 over visible normals. For each azimuth the midpoint rule covers the normals that
/// reflect upwards, with quadratically more points towards the horizon, where G2 falls to 0.
#[cfg(test)]
fn integrate(ggx: Ggx, cos: f64, points: [usize; 2]) -> GgxAlbedo {
    let view = view_at(cos);
    let light = |azimuth: f64, polar: f64| {
        let normal = ggx.sample_visible_normal(view, [azimuth, polar])?;
        let light = reflect(view, normal);
        (light.z > 0.0).then_some((light, view.dot(normal)))
    };
    let (mut all, mut schlick) = (0.0, 0.0);
    let horizon = horizon(|polar| light(0.0, polar).is_some());
    for i in 0..points[0] {
        let s = (i as f64 + 0.5) / points[0] as f64;
        let azimuth = 0.5 * (1.0 - s * s);
        for j in 0..points[1] {
            let t = (j as f64 + 0.5) / points[1] as f64;
            let Some((light, v_h)) = light(azimuth, horizon * (1.0 - t * t)) else { continue };
            let unmasked = ggx.shadowing_over_cosine(cos, light.z) / ggx.masking_over_cosine(cos);
            let value = unmasked * 4.0 * s * t * horizon;
            all += value;
            schlick += value * schlick_weight(v_h);
        }
    }
    let count = (points[0] * points[1]) as f64;
    GgxAlbedo { all: all / count, schlick: schlick / count }
}

/// The greatest number from 0 to 1 up to which `above` holds, by bisection to 2^-20.
#[cfg(test)]
pub(crate) fn horizon(above: impl Fn(f64) -> bool) -> f64 {
    let (mut lower, mut upper) = (0.0, 1.0);
    for _ in 0..20 {
        let middle = 0.5 * (lower + upper);
        if above(middle) {
            lower = middle;
        } else {
            upper = middle;
        }
    }
    upper
}

/// The values of the table: E, and B / E without Schlick's weight at the cosine.
#[cfg(test)]
fn node(position: [f64; 2]) -> [f64; 2] {
    let (ggx, cos) = from_unit(position);
    let albedo = integrate(ggx, cos, POINTS);
    [albedo.all, albedo.schlick / albedo.all - schlick_weight(cos)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_stored_table_is_that_of_the_integral() {
        super::super::table::check_stored("ggx_albedo.bin", STORED, NODES, node);
    }

    /// The table against a quadrature with 500 times the points, between nodes: the greatest error of either albedo.
    #[test]
    fn accuracy() {
        let mut greatest: f64 = 0.0;
        for i in 0..25 {
            for j in 0..17 {
                let (ggx, cos) = from_unit([f64::from(i) / 24.3, f64::from(j) / 16.3]);
                let (is, expected) = (GgxAlbedo::new(ggx, cos), integrate(ggx, cos, [200, 400]));
                let error = (is.all - expected.all).abs().max((is.schlick - expected.schlick).abs());
                greatest = greatest.max(error);
            }
        }
        assert!(greatest < 1e-3, "{greatest}");
    }

    /// Roughness 1 at normal incidence: D = 1 / pi is constant, l = 2 theta from the normal m at theta, v.m =
    /// cos(theta), G1(v) = 1, G2 = 2 l / (1 + l) with l = cos(2 theta) (S(v) = S(l) = 1). E is the integral of D G2 /
    /// (4 l) l over l, = 2 pi int_0^1 (1 / pi) (2 l / (1 + l)) / 4 dl = int_0^1 l / (1 + l) dl = 1 - ln 2.
    #[test]
    fn normal_incidence_by_hand() {
        let albedo = GgxAlbedo::new(Ggx::new(1.0), 1.0);
        assert!((albedo.all - (1.0 - 2.0f64.ln())).abs() < 5e-4, "{}", albedo.all);
    }
}
