//! The assignment's shading.
//!
//! `L_a = k_a I_a`, `L_d = k_d I (N.L)`, `L_s = k_s I (R.V)^n` with `R = 2 N (N.L) - L`, and the object's own colour
//! times their sum. A light with N.L <= 0 adds nothing, its highlight included.

use glam::DVec3;

use super::texture::colour_at;
use super::{LightSample, ShadingMode};
use crate::world::{PhongValues, Surface, World};

/// The object's colour times the light that it returns.
#[inline]
pub fn shade(
    world: &World,
    material: &PhongValues,
    mode: ShadingMode,
    surface: &Surface,
    lights: &[LightSample],
) -> DVec3 {
    let mut colour = material.colour * surface.tint;
    if let Some(texture) = &material.texture {
        colour *= colour_at(world, texture, surface.uv);
    }
    if mode == ShadingMode::Flat {
        return world.pipeline.hold(colour);
    }
    let mut light = DVec3::splat(material.ambient * world.ambient);
    for sample in lights {
        let mut returned = material.diffuse * sample.cosine;
        if mode == ShadingMode::Phong && material.specular > 0.0 {
            let mirrored = 2.0 * sample.cosine * surface.shading_normal - sample.direction;
            // Rounded, it may be above 1, and a sharp highlight would raise that to more light than there is.
            let cosine = mirrored.dot(surface.view).clamp(0.0, 1.0);
            returned += material.specular * power(cosine, material.shininess);
        }
        light += sample.radiance * returned;
    }
    world.pipeline.mix_light(colour, light)
}

/// `base^exponent`; whole exponents by squaring, the same on every machine.
#[inline]
fn power(base: f64, exponent: f64) -> f64 {
    if exponent.fract() != 0.0 || exponent > f64::from(u32::MAX) {
        return base.powf(exponent);
    }
    let (mut result, mut square, mut rest) = (1.0, base, exponent as u32);
    while rest > 0 {
        if rest & 1 == 1 {
            result *= square;
        }
        square *= square;
        rest >>= 1;
    }
    result
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whole_powers() {
        assert_eq!(power(2.0, 16.0), 65536.0);
        assert_eq!(power(0.5, 5.0), 1.0 / 32.0);
        assert_eq!(power(0.0, 0.0), 1.0);
        assert_eq!(power(0.0, 16.0), 0.0);
        assert_eq!(power(4.0, 0.5), 2.0);
    }
}
