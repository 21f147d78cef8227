//! [`Fill`]: ambient light that depends on the height of the direction it comes from.

use std::f64::consts::PI;

/// A zone of a [`Fill`]: the directions from a height up to the next zone.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct FillZone {
    /// The sine of the elevation above the horizon at which the zone begins, -1 to below 1.
    pub from: f64,
    /// The radiance of all channels. At least 0.
    pub radiance: f64,
}

/// Ambient radiance that is piecewise constant in the sine of elevation, as of the walls, lights and floor of a studio. Local
/// shading evaluates it without its shadows; path tracing uses it as an environment.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Fill {
    /// From below, the first from -1.
    pub zones: [FillZone; 5],
    /// Whether the radiance is that over 2^EV, EV being the exposure of the picture: displayed alike beside any lights.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub is_exposed: bool,
}

impl Fill {
    /// The fill light with so many times the radiance.
    pub fn scaled(self, factor: f64) -> Self {
        let zones = self.zones.map(|zone| FillZone { radiance: factor * zone.radiance, ..zone });
        Fill { zones, ..self }
    }

    /// The radiance from the zones that lie between two sines of elevation, `low` below `high`: their mean over the solid angle.
    pub fn mean_radiance(&self, low: f64, high: f64) -> f64 {
        let sum: f64 = self.bands().map(|(from, to, l)| l * (to.min(high) - from.max(low)).max(0.0)).sum();
        sum / (high - low)
    }

    /// The irradiance over pi of a surface whose unit normal has this y: what a white diffuse surface reflects.
    pub fn diffuse(&self, normal_y: f64) -> f64 {
        self.bands().map(|(from, to, l)| l * (cap_diffuse(from, normal_y) - cap_diffuse(to, normal_y))).sum()
    }

    /// [`Fill::diffuse`] of a surface that faces up: radiance times the square of the sine, from the horizon on.
    pub const fn diffuse_up(&self) -> f64 {
        let (mut sum, mut i) = (0.0, 0);
        while i < self.zones.len() {
            let from = self.zones[i].from.max(0.0);
            let to = if i + 1 < self.zones.len() { self.zones[i + 1].from.max(0.0) } else { 1.0 };
            sum += self.zones[i].radiance * (to * to - from * from);
            i += 1;
        }
        sum
    }

    /// Where the radiance changes, with what is added there: it is the sum of the `steps` below a direction.
    pub fn steps(&self) -> impl Iterator<Item = (f64, f64)> {
        let before = std::iter::once(0.0).chain(self.zones.iter().map(|zone| zone.radiance));
        self.zones.iter().zip(before).map(|(zone, before)| (zone.from, zone.radiance - before))
    }

    /// Lower end, upper end and radiance of the zones.
    fn bands(&self) -> impl Iterator<Item = (f64, f64, f64)> {
        let ends = self.zones.iter().skip(1).map(|zone| zone.from).chain(std::iter::once(1.0));
        self.zones.iter().zip(ends).map(|(zone, to)| (zone.from, to, zone.radiance))
    }
}

/// The irradiance over pi under radiance of 1 from the cap of directions above a height, of a surface whose normal is tilted
/// by `cos` from the axis of the cap (Lagarde and de Rousiers, Moving Frostbite to Physically Based Rendering, 2014, section
/// 4.7.2, from Snyder, Area Light Sources for Real-Time Graphics, 1996).
fn cap_diffuse(height: f64, cos: f64) -> f64 {
    if height < 0.0 {
        return 1.0 - cap_diffuse(-height, -cos);
    }
    let sine_squared = (1.0 - height) * (1.0 + height);
    // Whole above the horizon of the surface, or below.
    if cos * cos >= sine_squared {
        return sine_squared * cos.max(0.0);
    }
    let cotangent = height / sine_squared.sqrt();
    let sine = (1.0 - cos * cos).sqrt();
    let y = (-cotangent * cos / sine).clamp(-1.0, 1.0);
    let q = sine * (1.0 - y * y).sqrt();
    ((cos * libm::acos(y) - cotangent * q) * sine_squared + libm::atan2(q, cotangent)) / PI
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    const FILL: Fill = {
        const fn zone(from: f64, radiance: f64) -> FillZone {
            FillZone { from, radiance }
        }
        Fill {
            zones: [zone(-1.0, 0.3), zone(-0.1, 0.1), zone(0.2, 0.8), zone(0.4, 0.2), zone(0.8, 1.0)],
            is_exposed: false,
        }
    };

    /// The irradiance by quadrature over the hemisphere above a normal: the midpoint rule in the squared cosine and the azimuth.
    #[test]
    fn the_diffuse_term_is_the_integral() {
        for normal in [
            DVec3::Y,
            -DVec3::Y,
            DVec3::X,
            DVec3::new(2.0, 1.0, -0.5).normalize(),
            DVec3::new(1.0, -0.3, 0.0).normalize(),
        ] {
            let (tangent, bitangent) = normal.any_orthonormal_pair();
            let (steps, mut sum) = (1000, 0.0);
            for i in 0..steps {
                let square = (f64::from(i) + 0.5) / f64::from(steps);
                for j in 0..steps {
                    let (sin, cos) =
                        (std::f64::consts::TAU * (f64::from(j) + 0.5) / f64::from(steps)).sin_cos();
                    let sideways = tangent * cos + bitangent * sin;
                    let direction = normal * square.sqrt() + sideways * (1.0 - square).sqrt();
                    sum += FILL
                        .steps()
                        .filter(|(from, _)| direction.y >= *from)
                        .map(|(_, step)| step)
                        .sum::<f64>();
                }
            }
            let mean = sum / f64::from(steps * steps);
            assert!(
                (mean - FILL.diffuse(normal.y)).abs() < 1e-3,
                "{normal}: {mean} {}",
                FILL.diffuse(normal.y)
            );
        }
        assert!((FILL.diffuse(1.0) - FILL.diffuse_up()).abs() < 1e-15);
    }

    #[test]
    fn means_weigh_zones_by_their_solid_angle() {
        // 0.3 from -0.2 to -0.1, 0.1 from there to 0.1.
        assert!((FILL.mean_radiance(-0.2, 0.1) - (0.1 * 0.3 + 0.2 * 0.1) / 0.3).abs() < 1e-15);
        assert!((FILL.mean_radiance(0.85, 0.95) - 1.0).abs() < 1e-12);
    }
}
