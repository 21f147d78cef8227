//! Directional albedo of a rough dielectric interface, tabulated over cosine, roughness and relative index of
//! refraction.

use std::sync::OnceLock;

use super::albedo::{from_unit, to_unit, view_at};
use super::fresnel::{dielectric, normal_reflectance, refracted_cosine};
use super::ggx::{Ggx, reflect, refract};
use super::table::{Table, lattice};

/// Nodes over cosine, roughness and index from the optically thinner side. Accuracy: test `accuracy`.
const NODES_OUTSIDE: [usize; 3] = [20, 14, 18];

/// Nodes from the denser side, where total internal reflection begins at a cosine that depends on the index.
const NODES_INSIDE: [usize; 3] = [20, 16, 26];

/// Points of the Fibonacci lattice of a node's quadrature: two successive Fibonacci numbers.
const POINTS_OUTSIDE: [usize; 2] = [377, 233];

/// From the denser side, where total internal reflection makes the integrand jump.
const POINTS_INSIDE: [usize; 2] = [610, 377];

/// The parts of light that a rough interface scatters after one meeting with a microfacet.
#[derive(Debug, Clone, Copy)]
pub(crate) struct GlassAlbedo {
    /// Reflected or transmitted, by the exact Fresnel reflectance.
    pub(crate) scattered: f64,
    /// Scattered if the interface reflected only in total internal reflection.
    pub(crate) without_partial: f64,
    /// Reflected, by the exact Fresnel reflectance. Near the critical angle of smooth interfaces it is a rough value,
    /// as the next; the sums above are smooth there.
    pub(crate) reflected: f64,
    /// Reflected in total internal reflection; contained in `reflected`.
    pub(crate) total: f64,
}

impl GlassAlbedo {
    /// The albedos of a view with the cosine `cos`, 0 to 1. `eta` is finite, above 0 and not 1; `all` is the albedo
    /// of a reflection with a Fresnel factor of 1.
    pub(crate) fn new(ggx: Ggx, eta: f64, cos: f64, all: f64) -> Self {
        let [reflectance, total] = of_a_mirror(eta, cos);
        if ggx.is_delta() {
            return GlassAlbedo { scattered: 1.0, without_partial: 1.0, reflected: reflectance, total };
        }
        static OUTSIDE: OnceLock<Table<3, 4>> = OnceLock::new();
        static INSIDE: OnceLock<Table<3, 4>> = OnceLock::new();
        let table = if eta > 1.0 {
            OUTSIDE.get_or_init(|| table(NODES_OUTSIDE, false))
        } else {
            INSIDE.get_or_init(|| table(NODES_INSIDE, true))
        };
        let [x, y] = to_unit(ggx, cos);
        let [scattered, without_partial, reflected, more_total] = table.at([x, y, index_to_unit(eta)]);
        let reflected = (reflected + reflectance * all).clamp(0.0, scattered);
        let total = (more_total + total * all).clamp(0.0, reflected);
        GlassAlbedo { scattered, without_partial, reflected, total }
    }
}

/// The reflectance of the smooth interface, and 1 in total internal reflection, else 0.
fn of_a_mirror(eta: f64, cos: f64) -> [f64; 2] {
    [dielectric(eta, cos), if refracted_cosine(eta, cos).is_none() { 1.0 } else { 0.0 }]
}

/// The position of a relative index or its inverse: the cube root of the amplitude
/// (n - 1) / (n + 1), 0.58 for n = 1.5.
fn index_to_unit(eta: f64) -> f64 {
    libm::cbrt(normal_reflectance(eta).sqrt())
}

/// The table of one side of the interface. The reflected parts are stored as differences to those of the smooth
/// interface times the albedo: with a low roughness they depend on the cosine alone, which the coordinates do not
/// resolve.
fn table(nodes: [usize; 3], inside: bool) -> Table<3, 4> {
    let eta = |k: usize| {
        let unit = k as f64 / (nodes[2] - 1) as f64;
        let amplitude = (unit * unit * unit).min(1.0 - 1e-6);
        // Not 1 itself, where refraction is no lobe: the limit.
        let index = ((1.0 + amplitude) / (1.0 - amplitude)).max(1.000_1);
        if inside { 1.0 / index } else { index }
    };
    let indices: Vec<f64> = (0..nodes[2]).map(eta).collect();
    let rows = Table::new([nodes[0], nodes[1]], |at| [at[0], at[1]]);
    let mut values = vec![[0.0; 4]; nodes.iter().product()];
    for (at, row) in rows.values().iter().zip(values.chunks_exact_mut(nodes[2])) {
        let (ggx, cos) = from_unit(*at);
        integrate(ggx, cos, if inside { POINTS_INSIDE } else { POINTS_OUTSIDE }, &indices, row);
    }
    Table::from_values(nodes, values)
}

/// The fields of [`GlassAlbedo`], the reflected ones as in the table, for several relative indices, as means of G2 /
/// G1 over visible normals. The quadrature is a Fibonacci lattice, which meets the jumps of total internal reflection
/// and shadowing evenly, denser towards grazing normals.
fn integrate(ggx: Ggx, cos: f64, points: [usize; 2], indices: &[f64], sums: &mut [[f64; 4]]) {
    let view = view_at(cos);
    let unmasked = |light: f64| ggx.shadowing_over_cosine(cos, light) / ggx.masking_over_cosine(cos);
    let mut all = 0.0;
    // The lattice gives the integral of s t, 1/4, within 0.2 %. Divided by its own value, a smooth interface loses
    // nothing.
    let total: f64 = lattice(points).map(|[s, t]| s * t).sum();
    for [s, t] in lattice(points) {
        let numbers = [0.5 * (1.0 - s * s), 1.0 - t * t];
        let Some(normal) = ggx.sample_visible_normal(view, numbers) else { continue };
        let v_m = view.dot(normal).clamp(0.0, 1.0);
        let measure = s * t / total;
        let light = reflect(view, normal).z;
        let reflection = if light > 0.0 { unmasked(light) * measure } else { 0.0 };
        all += reflection;
        for (eta, sum) in indices.iter().zip(&mut *sums) {
            let Some(refracted) = refracted_cosine(*eta, v_m) else {
                *sum = std::array::from_fn(|i| sum[i] + reflection);
                continue;
            };
            let reflectance = dielectric(*eta, v_m);
            let light = -refract(view, normal, *eta, v_m, refracted).z;
            let transmission = if light > 0.0 { unmasked(light) * measure } else { 0.0 };
            sum[0] += reflection * reflectance + transmission * (1.0 - reflectance);
            sum[1] += transmission;
            sum[2] += reflection * reflectance;
        }
    }
    for (eta, sum) in indices.iter().zip(sums) {
        let [reflectance, total] = of_a_mirror(*eta, cos);
        sum[2] -= reflectance * all;
        sum[3] -= total * all;
    }
}

#[cfg(test)]
mod tests {
    use super::super::albedo::GgxAlbedo;
    use super::*;

    /// Masking is of second order in alpha: 1 - G1 is at most (alpha tan)^2 / 4, here 1.5e-5 at alpha = 0.0025 and a
    /// cosine of 0.3. So a nearly smooth interface scatters all, from either side.
    #[test]
    fn nearly_smooth_interfaces_scatter_all() {
        for (eta, cos) in [1.1, 1.5, 2.4].into_iter().flat_map(|n| [0.3, 0.6, 1.0].map(|cos| (n, cos))) {
            for eta in [eta, 1.0 / eta] {
                let ggx = Ggx::new(0.05);
                let scattered = GlassAlbedo::new(ggx, eta, cos, GgxAlbedo::new(ggx, cos).all).scattered;
                assert!((scattered - 1.0).abs() < 2e-4, "{eta}, {cos}: {scattered}");
            }
        }
    }

    /// The scattered part against a quadrature with 76 times the points, between nodes: the greatest relative error
    /// for cosines from 0.03, from either side, by index.
    #[test]
    fn accuracy() {
        for index in [1.02, 1.1, 1.33, 1.5, 1.8, 3.0] {
            let bound = if index < 1.1 { 0.03 } else { 0.013 };
            let mut greatest: f64 = 0.0;
            for eta in [index, 1.0 / index] {
                for (i, j) in (0..12).flat_map(|i| (0..10).map(move |j| (i, j))) {
                    let (ggx, cos) = from_unit([f64::from(i) / 11.2, f64::from(j) / 9.3]);
                    if cos < 0.03 {
                        continue;
                    }
                    let is = GlassAlbedo::new(ggx, eta, cos, GgxAlbedo::new(ggx, cos).all);
                    let mut sums = [[0.0; 4]];
                    integrate(ggx, cos, [28657, 17711], &[eta], &mut sums);
                    greatest = greatest.max((is.scattered / sums[0][0] - 1.0).abs());
                }
            }
            assert!(greatest < bound, "index {index}: {greatest}");
        }
    }
}
