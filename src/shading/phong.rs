//! The assignment's Phong model.
//!
//! `L_a = k_a I_a`, `L_d = k_d I (N.L)`, `L_s = k_s I (R.V)^n` with `R = 2 N (N.L) - L`; the colour is the base colour times their sum.
//! A light with N.L <= 0 contributes nothing, also no highlight.

use std::ops::Range;

use glam::DVec3;

use super::{LightSample, LightSoa, ShadingMode, SurfaceTerms, Term};
use crate::film::ColourPipeline;
use crate::scene::{Phong, TextureSlot};
use crate::world::{InteractionSoa, PerRay, RAYS_PER_BATCH, Vec3Soa, World, simd};

/// Whether a light can add more than 0.
pub(crate) fn takes_light(material: &Phong<DVec3>, mode: ShadingMode) -> bool {
    material.diffuse != 0.0 || has_highlight(material, mode)
}

fn has_highlight(material: &Phong<DVec3>, mode: ShadingMode) -> bool {
    mode == ShadingMode::Full && material.specular > 0.0
}

/// `R.V`, clamped to 0..1.
#[inline(always)]
fn highlight_cosine(sample: &LightSample, normal: DVec3, view: DVec3) -> f64 {
    let mirrored = 2.0 * sample.cosine * normal - sample.direction;
    // Rounding can give more than 1, which a large exponent would amplify.
    mirrored.dot(view).clamp(0.0, 1.0)
}

/// Temporary buffers of [`super::shade_all`].
#[derive(Default)]
pub struct Scratch {
    /// `(R.V)^n`.
    power: PerRay<f64>,
    /// `R.V` and its repeated squares.
    square: PerRay<f64>,
}

/// Computes the colours of the `surfaces` in `range`, all of one material.
pub(crate) fn shade(
    world: &World,
    material: &Phong<DVec3>,
    mode: ShadingMode,
    (surfaces, range): (&InteractionSoa, Range<usize>),
    lights: &[Box<LightSoa>],
    (colours, scratch): (&mut Vec3Soa, &mut Scratch),
) {
    let pipeline = world.pipeline;
    sum_light(world, material, mode, (surfaces, range.clone()), lights, (colours, scratch));
    // The pipeline is passed as a constant, so that the loop has no branch on it.
    let emissive = range.clone();
    match pipeline {
        _ if material.textures[TextureSlot::BaseColour].is_some() => range.for_each(|i| {
            colours.set(i, pipeline.mix_light(own_colour(material, surfaces, i), colours.get(i)));
        }),
        ColourPipeline::U8 => mix(ColourPipeline::U8, material.colour, (surfaces, range), colours),
        ColourPipeline::Display => {
            simd!(mix(ColourPipeline::Display, material.colour, (surfaces, range), colours));
        }
        ColourPipeline::Linear => {
            simd!(mix(ColourPipeline::Linear, material.colour, (surfaces, range), colours));
        }
    }
    if material.emission != DVec3::ZERO {
        emissive.for_each(|i| colours.set(i, pipeline.clamp(colours.get(i) + material.emission)));
    }
}

/// The base colour of a surface.
fn own_colour(material: &Phong<DVec3>, surfaces: &InteractionSoa, i: usize) -> DVec3 {
    material.colour * surfaces.tint.get(i) * surfaces.texels.get(TextureSlot::BaseColour, i)
}

/// The terms of surface `i`, each from [`sum_light`] with the coefficients of the others at 0.
pub(crate) fn terms(
    world: &World,
    material: &Phong<DVec3>,
    mode: ShadingMode,
    (surfaces, i): (&InteractionSoa, usize),
    lights: &[Box<LightSoa>],
) -> SurfaceTerms {
    let (mut sums, mut scratch) = <(Box<Vec3Soa>, Box<Scratch>)>::default();
    let mut sum = |ambient: f64, diffuse: f64, specular: f64, lights: &[Box<LightSoa>]| {
        let material = Phong { ambient, diffuse, specular, ..material.clone() };
        sum_light(world, &material, mode, (surfaces, i..i + 1), lights, (&mut sums, &mut scratch));
        (sums.get(i), scratch.power[i])
    };
    let &Phong { ambient, diffuse, specular, shininess, emission, .. } = material;
    let light = sum(ambient, diffuse, specular, lights).0;
    let intensity = world.ambient_at(surfaces.shading_normal.get(i));
    let mut factors = vec![("k_a", ambient), ("I_a", intensity)];
    factors.extend(surfaces.ambient.get(i).map(|&part| ("unoccluded", part)));
    let mut terms = vec![Term { factors, ..Term::new(world, "L_a", None, sum(ambient, 0.0, 0.0, &[]).0) }];
    for (index, light) in lights.iter().enumerate().filter(|(_, light)| light.reaches[i]) {
        let (sample, light) = (light.get(i), std::slice::from_ref(light));
        let factors = vec![("k_d", diffuse), ("N.L", sample.cosine)];
        let value = sum(0.0, diffuse, 0.0, light).0;
        terms.push(Term { factors, ..Term::new(world, "L_d", Some(index), value) });
        if has_highlight(material, mode) {
            let (value, power) = sum(0.0, 0.0, specular, light);
            let cosine = highlight_cosine(&sample, surfaces.shading_normal.get(i), surfaces.view.get(i));
            let factors = vec![("k_s", specular), ("R.V", cosine), ("n", shininess), ("(R.V)^n", power)];
            terms.push(Term { factors, ..Term::new(world, "L_s", Some(index), value) });
        }
    }
    if emission != DVec3::ZERO {
        terms.push(Term::new(world, "L_e", None, emission));
    }
    SurfaceTerms { model: "phong", own: own_colour(material, surfaces, i), light: Some(light), terms }
}

/// Sums the light that the `surfaces` in `range` reflect, before it is multiplied by their colours.
fn sum_light(
    world: &World,
    material: &Phong<DVec3>,
    mode: ShadingMode,
    (surfaces, range): (&InteractionSoa, Range<usize>),
    lights: &[Box<LightSoa>],
    (colours, scratch): (&mut Vec3Soa, &mut Scratch),
) {
    let ambient = DVec3::splat(material.ambient * world.ambient);
    range.clone().for_each(|i| colours.set(i, ambient));
    if world.fill.is_some() {
        range.clone().for_each(|i| {
            let ambient = world.ambient_at(surfaces.shading_normal.get(i));
            colours.set(i, DVec3::splat(material.ambient * ambient));
        });
    }
    if !surfaces.ambient.is_empty() {
        range.clone().for_each(|i| colours.set(i, colours.get(i) * surfaces.ambient[i]));
    }
    for light in lights {
        if !light.reaches[range.clone()].contains(&true) {
            continue;
        }
        let range = range.clone();
        simd!(add_light(material, mode, (surfaces, range), light, (colours, scratch)));
    }
}

/// Adds the reflected light of one light to `sums`.
#[inline(always)]
fn add_light(
    material: &Phong<DVec3>,
    mode: ShadingMode,
    (surfaces, range): (&InteractionSoa, Range<usize>),
    light: &LightSoa,
    (sums, scratch): (&mut Vec3Soa, &mut Scratch),
) {
    let range = range.start..range.end.min(RAYS_PER_BATCH);
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

/// Multiplies the light in `colours` by the base colours, and rounds as the pipeline does.
#[inline(always)]
fn mix(
    pipeline: ColourPipeline,
    own: DVec3,
    (surfaces, range): (&InteractionSoa, Range<usize>),
    colours: &mut Vec3Soa,
) {
    for i in range.start..range.end.min(RAYS_PER_BATCH) {
        colours.set(i, pipeline.mix_light(own * surfaces.tint.get(i), colours.get(i)));
    }
}

/// Each value of `scratch.square` to the power of `exponent`, into `scratch.power`. Integer exponents are computed by
/// repeated squaring, which gives the same bits on every machine.
#[inline(always)]
fn powers(scratch: &mut Scratch, range: Range<usize>, exponent: f64) {
    let Scratch { power: result, square } = scratch;
    let Some(mut rest) = integer(exponent) else {
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

/// The exponent as an integer, if it is one.
fn integer(exponent: f64) -> Option<u32> {
    (exponent.fract() == 0.0 && exponent <= f64::from(u32::MAX)).then_some(exponent as u32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whole_powers() {
        let power = |base: f64, exponent: f64| {
            let mut scratch = Scratch::default();
            scratch.square[3] = base;
            powers(&mut scratch, 3..4, exponent);
            scratch.power[3]
        };
        assert_eq!(power(2.0, 16.0), 65536.0);
        assert_eq!(power(0.5, 5.0), 1.0 / 32.0);
        assert_eq!(power(0.0, 0.0), 1.0);
        assert_eq!(power(0.0, 16.0), 0.0);
        assert_eq!(power(4.0, 0.5), 2.0);
    }
}
