//! The fill light of a world, prepared for local shading.

use crate::scene::Fill;

/// Intervals of the table of diffuse light. Its interpolation is off by less than 1/1000 of the radiance.
const INTERVALS: usize = 256;

/// A [`Fill`] whose diffuse light is tabulated.
#[derive(Debug, Clone)]
pub(crate) struct PreparedFill {
    /// [`Fill::diffuse`] at equal distances of the normal's y, -1 to 1.
    diffuse: Vec<f64>,
    /// The lower ends of the zones.
    edges: Vec<Edge>,
    /// [`Fill::is_exposed`].
    is_exposed: bool,
    /// Factor of the radiance.
    scale: f64,
}

/// A circle of constant height at which radiance changes.
#[derive(Debug, Clone)]
struct Edge {
    /// Whether it is below the horizon: then the cap below it is taken, otherwise that above.
    is_low: bool,
    /// Sine and cosine of half the angle between the axis of the cap and the circle.
    half: [f64; 2],
    /// Radiance above the circle minus radiance below it.
    step: f64,
}

impl PreparedFill {
    pub(super) fn new(fill: &Fill) -> Self {
        let node = |i| 2.0 * i as f64 / INTERVALS as f64 - 1.0;
        PreparedFill {
            diffuse: (0..=INTERVALS).map(|i| fill.diffuse(node(i))).collect(),
            edges: fill
                .steps()
                .map(|(from, step)| Edge { is_low: from < 0.0, half: half_angle(from.abs()), step })
                .collect(),
            is_exposed: fill.is_exposed,
            scale: if fill.is_exposed { 0.0 } else { 1.0 },
        }
    }

    /// The fill light for an exposure in EV, if it depends on it: none where that is not known yet.
    pub(super) fn exposed(&self, ev: Option<f64>) -> Option<Self> {
        let scale = ev.map_or(0.0, |ev| libm::exp2(-ev));
        (self.is_exposed && scale != self.scale).then(|| PreparedFill { scale, ..self.clone() })
    }

    /// The irradiance over pi of a surface whose unit normal has this y: what a white diffuse surface reflects.
    #[inline]
    pub(crate) fn diffuse(&self, normal_y: f64) -> f64 {
        let position = (0.5 * (normal_y + 1.0)).clamp(0.0, 1.0) * INTERVALS as f64;
        let interval = (position as usize).min(INTERVALS - 1);
        let [low, high] = [self.diffuse[interval], self.diffuse[interval + 1]];
        self.scale * (low + (high - low) * (position - interval as f64))
    }

    /// The mean radiance that a GGX lobe of width `alpha` around a unit direction with this y reflects.
    ///
    /// Normals of microfacets have slopes whose density is `alpha^2 / (pi (alpha^2 + m^2)^2)`, and a normal with the slope m
    /// turns the reflection by an angle of 2 atan(m). So the part of a lobe on one side of a straight edge, at the angle s from
    /// its centre, is (1 + t / sqrt(t^2 + alpha^2)) / 2 with t = tan(s / 2), and the part in a cap around its centre t^2 /
    /// (t^2 + alpha^2). Of a cap off the centre it is taken to be the part between its two edges, times the part across:
    /// that is exact at the centre of the cap and for narrow lobes.
    pub(crate) fn reflected(&self, y: f64, alpha: f64) -> f64 {
        let [sin, cos] = half_angle(y);
        let sum: f64 = self
            .edges
            .iter()
            .map(|&Edge { is_low, half, step }| {
                let (sin, cos) = if is_low { (cos, sin) } else { (sin, cos) };
                let part = part_in_cap(half, [sin, cos], alpha);
                step * if is_low { 1.0 - part } else { part }
            })
            .sum();
        self.scale * sum
    }
}

/// The fraction of a GGX lobe inside a spherical cap, see [`PreparedFill::reflected`]: sine and cosine of half the angle between the axis of the cap
/// and its edge, up to 45 degrees, and between the axis and the centre of the lobe, up to 90 degrees.
#[inline]
fn part_in_cap([edge_sin, edge_cos]: [f64; 2], [sin, cos]: [f64; 2], alpha: f64) -> f64 {
    // For the tangent t = sine / cosine, t / sqrt(t^2 + alpha^2).
    let inside = |sine: f64, cosine: f64| {
        let width = alpha * cosine;
        sine / (sine * sine + width * width).sqrt()
    };
    let near = inside(edge_sin * cos - edge_cos * sin, edge_cos * cos + edge_sin * sin);
    let far_cosine = edge_cos * cos - edge_sin * sin;
    // More than half a turn away.
    let far = if far_cosine > 0.0 { inside(edge_sin * cos + edge_cos * sin, far_cosine) } else { 1.0 };
    0.5 * (near + far) * inside(edge_sin, edge_cos)
}

/// Sine and cosine of half the angle between +y and a unit direction with this y.
#[inline]
fn half_angle(y: f64) -> [f64; 2] {
    [1.0 - y, 1.0 + y].map(|square| (0.5 * square).max(0.0).sqrt())
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use glam::DVec3;

    use super::*;
    use crate::scene::FillZone;

    const FILL: Fill = {
        const fn zone(from: f64, radiance: f64) -> FillZone {
            FillZone { from, radiance }
        }
        Fill {
            zones: [zone(-1.0, 0.3), zone(-0.1, 0.1), zone(0.2, 0.8), zone(0.4, 0.2), zone(0.8, 1.0)],
            is_exposed: false,
        }
    };

    #[test]
    fn the_table_interpolates_diffuse_light() {
        let prepared = PreparedFill::new(&FILL);
        for i in 0..=10_000 {
            let y = f64::from(i) / 5000.0 - 1.0;
            assert!((prepared.diffuse(y) - FILL.diffuse(y)).abs() < 1e-3, "{y}");
        }
    }

    /// Against quadrature, within bounds for a radiance of up to 1: slopes by the inverse of their distribution, m = alpha sqrt(u / (1 - u)), and azimuths.
    #[test]
    fn lobes_reflect_the_mean_radiance_within_them() {
        let prepared = PreparedFill::new(&FILL);
        let steps = 300;
        for (alpha, bound) in [(0.002, 1e-3), (0.05, 0.02), (0.2, 0.03), (0.5, 0.06)] {
            for y in [-1.0f64, -0.6, 0.0, 0.3, 0.75, 0.99, 1.0] {
                let centre = DVec3::new((1.0 - y * y).sqrt(), y, 0.0);
                let (tangent, bitangent) = centre.any_orthonormal_pair();
                let mut sum = 0.0;
                for i in 0..steps {
                    let u = (f64::from(i) + 0.5) / f64::from(steps);
                    let angle = 2.0 * (alpha * (u / (1.0 - u)).sqrt()).atan();
                    for j in 0..steps {
                        let (sin, cos) = (TAU * (f64::from(j) + 0.5) / f64::from(steps)).sin_cos();
                        let direction =
                            centre * angle.cos() + (tangent * cos + bitangent * sin) * angle.sin();
                        sum += FILL
                            .steps()
                            .filter(|(from, _)| direction.y >= *from)
                            .map(|(_, step)| step)
                            .sum::<f64>();
                    }
                }
                let mean = sum / f64::from(steps * steps);
                let error = (prepared.reflected(y, alpha) - mean).abs();
                assert!(error < bound, "{alpha} {y}: {error}");
            }
        }
    }
}
