//! The assignment's shading.
//!
//! `L_a = k_a I_a`, `L_d = k_d I (N.L)`, `L_s = k_s I (R.V)^n` with `R = 2 N (N.L) - L`, and the object's own colour
//! times their sum. A light with N.L <= 0 adds nothing, its highlight included.

use std::ops::Range;

use glam::DVec3;

use super::{LightLanes, LightSample, ShadingMode};
use crate::film::ColourPipeline;
use crate::world::{LANES, Lanes, PhongValues, Surface, Surfaces, World, widely};

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
    if material.texture.is_some() {
        colour *= surface.texels.colour;
    }
    if mode == ShadingMode::Flat {
        return world.pipeline.hold(colour);
    }
    let mut light = DVec3::splat(material.ambient * world.ambient);
    for sample in lights {
        let mut returned = material.diffuse * sample.cosine;
        if has_highlight(material, mode) {
            let cosine = highlight_cosine(sample, surface.shading_normal, surface.view);
            returned += material.specular * power(cosine, material.shininess);
        }
        light += sample.radiance * returned;
    }
    world.pipeline.mix_light(colour, light)
}

/// Whether it returns anything of a light. Where not, a light adds zero to what is never below it.
pub fn takes_light(material: &PhongValues, mode: ShadingMode) -> bool {
    material.diffuse != 0.0 || has_highlight(material, mode)
}

fn has_highlight(material: &PhongValues, mode: ShadingMode) -> bool {
    mode == ShadingMode::Phong && material.specular > 0.0
}

/// `R.V`, where it is above 0.
#[inline(always)]
fn highlight_cosine(sample: &LightSample, normal: DVec3, view: DVec3) -> f64 {
    let mirrored = 2.0 * sample.cosine * normal - sample.direction;
    // Rounded, it may be above 1, and a sharp highlight would raise that to more light than there is.
    mirrored.dot(view).clamp(0.0, 1.0)
}

/// What shading many surfaces needs in passing.
pub struct Scratch {
    /// Powers of the cosines of the highlight.
    power: [f64; LANES],
    square: [f64; LANES],
}

impl Default for Scratch {
    fn default() -> Self {
        Scratch { power: [0.0; LANES], square: [0.0; LANES] }
    }
}

/// The colours of those of `surfaces` in `range`, all of one material without a texture: [`shade`] for each.
pub fn shade_all(
    world: &World,
    material: &PhongValues,
    mode: ShadingMode,
    (surfaces, range): (&Surfaces, Range<usize>),
    lights: &[Box<LightLanes>],
    (colours, scratch): (&mut Lanes, &mut Scratch),
) {
    let pipeline = world.pipeline;
    if mode == ShadingMode::Flat {
        for i in range {
            colours.set(i, pipeline.hold(material.colour * surfaces.tint.get(i)));
        }
        return;
    }
    let ambient = DVec3::splat(material.ambient * world.ambient);
    range.clone().for_each(|i| colours.set(i, ambient));
    for light in lights {
        if !light.reaches[range.clone()].contains(&true) {
            continue;
        }
        let range = range.clone();
        widely(
            #[inline(always)]
            || add_light(material, mode, (surfaces, range), light, (colours, scratch)),
        );
    }
    // The numbers that a pipeline holds are told apart once, not for every surface.
    match pipeline {
        ColourPipeline::U8 => mix(ColourPipeline::U8, material.colour, (surfaces, range), colours),
        ColourPipeline::Display => widely(
            #[inline(always)]
            || mix(ColourPipeline::Display, material.colour, (surfaces, range), colours),
        ),
        ColourPipeline::Linear => widely(
            #[inline(always)]
            || mix(ColourPipeline::Linear, material.colour, (surfaces, range), colours),
        ),
    }
}

/// Adds what the surfaces return of a light to what `sums` holds.
#[inline(always)]
fn add_light(
    material: &PhongValues,
    mode: ShadingMode,
    (surfaces, range): (&Surfaces, Range<usize>),
    light: &LightLanes,
    (sums, scratch): (&mut Lanes, &mut Scratch),
) {
    let range = range.start..range.end.min(LANES);
    let highlight = has_highlight(material, mode);
    if highlight {
        for i in range.clone() {
            let (normal, view) = (surfaces.shading_normal.get(i), surfaces.view.get(i));
            scratch.square[i] = highlight_cosine(&light.get(i), normal, view);
        }
        powers(scratch, range.clone(), material.shininess);
    }
    for i in range {
        let sample = light.get(i);
        let mut returned = material.diffuse * sample.cosine;
        if highlight {
            returned += material.specular * scratch.power[i];
        }
        let (sum, more) = (sums.get(i), sums.get(i) + sample.radiance * returned);
        let pick = |more: f64, sum: f64| if light.reaches[i] { more } else { sum };
        sums.set(i, DVec3::new(pick(more.x, sum.x), pick(more.y, sum.y), pick(more.z, sum.z)));
    }
}

/// The surfaces' own colours in the light that `colours` holds.
#[inline(always)]
fn mix(
    pipeline: ColourPipeline,
    own: DVec3,
    (surfaces, range): (&Surfaces, Range<usize>),
    colours: &mut Lanes,
) {
    for i in range.start..range.end.min(LANES) {
        colours.set(i, pipeline.mix_light(own * surfaces.tint.get(i), colours.get(i)));
    }
}

/// [`power`] of each of `scratch.square`.
#[inline(always)]
fn powers(scratch: &mut Scratch, range: Range<usize>, exponent: f64) {
    let Scratch { power: result, square } = scratch;
    let Some(mut rest) = whole(exponent) else {
        range.for_each(|i| result[i] = square[i].powf(exponent));
        return;
    };
    result[range.clone()].fill(1.0);
    while rest > 0 {
        if rest & 1 == 1 {
            range.clone().for_each(|i| result[i] *= square[i]);
        }
        rest >>= 1;
        if rest > 0 {
            range.clone().for_each(|i| square[i] *= square[i]);
        }
    }
}

/// `base^exponent`; whole exponents by squaring, the same on every machine.
#[inline]
fn power(base: f64, exponent: f64) -> f64 {
    let Some(mut rest) = whole(exponent) else { return base.powf(exponent) };
    let (mut result, mut square) = (1.0, base);
    while rest > 0 {
        if rest & 1 == 1 {
            result *= square;
        }
        square *= square;
        rest >>= 1;
    }
    result
}

/// An exponent that is taken by squaring.
fn whole(exponent: f64) -> Option<u32> {
    (exponent.fract() == 0.0 && exponent <= f64::from(u32::MAX)).then_some(exponent as u32)
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
