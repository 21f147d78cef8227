//! [`Fill`]: ambient light that depends on the direction.

use glam::DVec3;

/// Ambient light whose radiance is linear in the height of the direction it comes from. For local shading, which
/// evaluates it in closed form, without its shadows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fill {
    /// The radiance from straight above, of all channels. At least 0.
    pub above: f64,
    /// The radiance from straight below. At least 0.
    pub below: f64,
}

impl Fill {
    /// The radiance from a unit direction.
    pub fn radiance(&self, direction: DVec3) -> f64 {
        self.mean() + self.slope() * direction.y
    }

    /// The irradiance of a surface with this unit normal over pi: what a white diffuse surface reflects. The integral of
    /// `n.d d` over the hemisphere above `n` is 2 pi / 3 `n`.
    pub fn diffuse(&self, normal: DVec3) -> f64 {
        self.mean() + self.slope() * (2.0 / 3.0) * normal.y
    }

    /// [`Fill::diffuse`] of a surface that faces up.
    pub const fn diffuse_up(&self) -> f64 {
        self.mean() + self.slope() * (2.0 / 3.0)
    }

    const fn mean(&self) -> f64 {
        0.5 * (self.above + self.below)
    }

    const fn slope(&self) -> f64 {
        0.5 * (self.above - self.below)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The irradiance by quadrature over the hemisphere above a normal: the midpoint rule in the squared cosine and the azimuth.
    #[test]
    fn the_diffuse_term_is_the_integral() {
        let fill = Fill { above: 0.8, below: 0.1 };
        for normal in [DVec3::Y, -DVec3::Y, DVec3::X, DVec3::new(2.0, 1.0, -0.5).normalize()] {
            let (tangent, bitangent) = normal.any_orthonormal_pair();
            let (steps, mut sum) = (400, 0.0);
            for i in 0..steps {
                let square = (f64::from(i) + 0.5) / f64::from(steps);
                for j in 0..8 {
                    let (sin, cos) = (std::f64::consts::TAU * f64::from(j) / 8.0).sin_cos();
                    let sideways = tangent * cos + bitangent * sin;
                    sum += fill.radiance(normal * square.sqrt() + sideways * (1.0 - square).sqrt());
                }
            }
            assert!((sum / f64::from(8 * steps) - fill.diffuse(normal)).abs() < 1e-5, "{normal}");
        }
        assert_eq!(fill.radiance(DVec3::Y), 0.8);
        assert!((fill.radiance(-DVec3::Y) - 0.1).abs() < 1e-15);
    }
}
