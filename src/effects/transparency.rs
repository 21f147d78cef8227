//! Rays through surfaces of opacity below 1 in all stages that trace rays, and camera rays through culled back faces.
//!
//! The opacity of a surface depends on the point alone: textures are looked up at full size, so that camera rays and
//! shadow rays see the same holes. A ray that passes through starts anew behind the surface, as a transmitted ray does
//! ([`SurfacePoint`](crate::bvh::detail::SurfacePoint)), and keeps its direction.
//!
//! Where a pixel takes several samples, or paths are traced, a ray hits a surface of opacity α with probability α
//! (stochastic transparency; Enderton, Sintorn, Shirley and Luebke, 2010). Where it takes one, its camera ray sees all
//! layers: the stages run once a layer, nearest first, and their colours are blended (`over`; Porter and Duff,
//! Compositing Digital Images, SIGGRAPH 1984). Shadow rays always carry the product of all transmittances.

use glam::DVec3;

use super::RayKind;
use super::random::{self, Dimension};
use super::samples::{SampleIndex, list_samples};
use super::tile::{RayGeneration, RenderContext, Tile, vec_bytes};
use crate::bvh::detail::{HitBuffer, RayBuffer};
use crate::bvh::{Hit, Ray, Traversal};
use crate::scene::{PixelSampler, TextureFilter};
use crate::shading;
pub(crate) use crate::shading::VISIBLE_FROM;
use crate::world::World;

/// The kinds that continued rays are counted as.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ContinuedRays {
    /// Camera rays and secondary rays.
    pub(crate) rays: RayKind,
    /// Shadow rays.
    pub(crate) shadow_rays: RayKind,
}

/// How rays find the surfaces that they hit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Transparency {
    /// Whether camera rays see all layers, and not one by random numbers.
    pub(crate) is_layered: bool,
    /// Whether camera rays pass through back faces of single-sided materials.
    pub(crate) culls: bool,
    /// The filter of opacity textures; `None` for that of each texture's sampler.
    pub(crate) filter: Option<TextureFilter>,
    /// The random numbers of these rays.
    pub(crate) sampler: PixelSampler,
    /// The seed of the random numbers.
    pub(crate) seed: u32,
    /// The kind that continued rays are counted as.
    pub(crate) kind: RayKind,
}

impl Transparency {
    /// Transparency of camera rays that cull; all else is as in `others`.
    pub(crate) fn culling(others: Option<Transparency>) -> Self {
        let opaque = Transparency {
            is_layered: false,
            culls: true,
            filter: None,
            sampler: PixelSampler::default(),
            seed: 0,
            kind: RayKind::PRIMARY,
        };
        others.map_or(opaque, |others| Transparency { culls: true, ..others })
    }
}

/// How opacity is looked up: whether that of culled back faces is 0, and by which filter.
type Lookup = (bool, Option<TextureFilter>);

/// Opacity at a hit of a camera ray.
fn seen_opacity(world: &World, ray: &Ray, hit: &Hit, (culls, filter): Lookup) -> f64 {
    if culls && world.is_culled(ray, hit) { 0.0 } else { opacity(world, hit, filter) }
}

/// The opacity of the surface at a hit, 0 to 1.
pub(crate) fn opacity(world: &World, hit: &Hit, filter: Option<TextureFilter>) -> f64 {
    let index = world.object_of(hit.prim);
    let object = &world.objects[index as usize];
    let material = &world.materials[object.material as usize];
    let [v, w] = hit.barycentrics;
    let uv = |set| world.uv(index, hit.prim, [1.0 - v - w, v, w], set);
    shading::opacity(material, &world.images, filter, uv, || world.vertex_alpha(object, hit))
}

/// Detects a cycle of the origins of a continued ray, which would never end: in `fast` at large coordinates, rounding
/// may keep the origin from advancing. Each origin is compared with an earlier one, which is replaced after 1, 2, 4,
/// ... steps (Brent, An improved Monte Carlo factorization algorithm, BIT 20, 1980). Rays without a cycle are not
/// changed.
#[derive(Debug, Clone, Copy)]
struct OriginCycle {
    earlier: DVec3,
    /// Steps since the earlier origin, and the number after which it is replaced.
    steps: u32,
    most: u32,
}

impl OriginCycle {
    fn new(origin: DVec3) -> Self {
        OriginCycle { earlier: origin, steps: 0, most: 1 }
    }

    /// Whether the next origin equals the earlier one.
    fn repeats(&mut self, origin: DVec3) -> bool {
        self.steps += 1;
        let repeats = origin == self.earlier;
        if self.steps == self.most {
            *self = OriginCycle { earlier: origin, steps: 0, most: self.most.saturating_mul(2) };
        }
        repeats
    }
}

/// The ray that continues behind the surface at a hit.
fn behind(world: &World, ray: &Ray, hit: &Hit) -> Ray {
    let precision = world.numerics().ray_precision();
    let origin = world.origin_behind(ray.at(hit.t), ray.direction(), hit);
    precision.ray(origin, ray.direction(), 0.0, (ray.t_max() - hit.t).max(0.0))
}

/// The part of the light that a shadow ray lets through: the product of `1 - opacity` over the surfaces in its way.
/// Adds the number of continued rays to `continued`.
pub(crate) fn transmittance(
    world: &World,
    ray: &Ray,
    traversal: &mut Traversal,
    filter: Option<TextureFilter>,
    continued: &mut usize,
) -> f64 {
    let (mut ray, mut transmittance, mut cycle) = (*ray, 1.0, OriginCycle::new(ray.origin()));
    while let Some(hit) = world.accelerator.closest_hit(&ray, traversal) {
        transmittance *= 1.0 - opacity(world, &hit, filter);
        if transmittance == 0.0 {
            break;
        }
        ray = behind(world, &ray, &hit);
        if cycle.repeats(ray.origin()) {
            break;
        }
        *continued += 1;
    }
    transmittance
}

/// The closest hit with a surface that AOVs show, with its distance from the ray's origin.
pub(crate) fn closest_visible(
    world: &World,
    ray: &Ray,
    traversal: &mut Traversal,
    lookup: Lookup,
) -> Option<Hit> {
    let (mut ray, mut distance, mut cycle) = (*ray, 0.0, OriginCycle::new(ray.origin()));
    loop {
        let hit = world.accelerator.closest_hit(&ray, traversal)?;
        if seen_opacity(world, &ray, &hit, lookup) >= VISIBLE_FROM {
            return Some(Hit { t: distance + hit.t, ..hit });
        }
        distance += hit.t;
        ray = behind(world, &ray, &hit);
        if cycle.repeats(ray.origin()) {
            return None;
        }
    }
}

/// A ray of a generation on its way.
#[derive(Debug, Clone, Copy)]
struct ContinuedRay {
    /// Its index in the generation.
    index: u32,
    /// The distance from the origin of the generation's ray to that of `ray`.
    distance: f64,
    /// What is left of the ray's random number, uniform in [0, 1).
    number: f64,
    ray: Ray,
    cycle: OriginCycle,
}

/// The buffers of a tile.
#[derive(Default)]
pub(crate) struct Buffers {
    continued_rays: Vec<ContinuedRay>,
    /// The rays of `continued_rays`, and their hits.
    rays: RayBuffer,
    hits: HitBuffer,
    samples: Vec<SampleIndex>,
    layers: Layers,
}

/// The layers of a tile's pixels. One entry a pixel each.
#[derive(Default)]
struct Layers {
    /// The rays that go on after the current layer.
    next: Vec<ContinuedRay>,
    /// The opacity of the current layer; 1 where the ray hit nothing.
    opacity: Vec<f64>,
    /// What the layers before the current one let through.
    transmittance: Vec<f64>,
    /// The sum of the layers before the current one.
    colour: Vec<[f64; 3]>,
    /// The part that the surfaces of these layers cover.
    coverage: Vec<f64>,
    /// Unlit surfaces of these layers, as [`Tile::shown`].
    shown: Vec<[f64; 4]>,
}

impl Buffers {
    pub(crate) fn bytes(&self) -> usize {
        let Buffers { continued_rays, rays, hits, samples, layers } = self;
        let Layers { next, opacity, transmittance, colour, coverage, shown } = layers;
        size_of::<Buffers>()
            + vec_bytes(continued_rays)
            + rays.bytes()
            + hits.bytes()
            + vec_bytes(samples)
            + vec_bytes(next)
            + vec_bytes(opacity)
            + vec_bytes(transmittance)
            + vec_bytes(colour)
            + vec_bytes(coverage)
            + vec_bytes(shown)
    }
}

/// Finds the hits of the current generation's rays. Returns whether they are the first of these rays, not a further
/// layer.
pub(crate) fn find_hits(tile: &mut Tile, world: &World, transparency: Transparency) -> bool {
    tile.with_buffers(|buffers: &mut Buffers, tile| {
        let is_layered = transparency.is_layered && tile.depth == 0;
        let is_first = !(is_layered && tile.needs_more_samples);
        buffers.continued_rays.clear();
        if !is_first {
            std::mem::swap(&mut buffers.continued_rays, &mut buffers.layers.next);
        }
        if is_layered {
            buffers.layers.start(tile.generation().rays.len(), is_first);
        }
        if is_first {
            buffers.trace_first(tile, world, transparency, is_layered);
        } else {
            let generation = tile.generation();
            generation.hits.clear();
            generation.hits.resize(generation.rays.len());
        }
        let generation = &mut tile.generations[tile.current];
        let mut continued = 0;
        while !buffers.continued_rays.is_empty() {
            continued += buffers.continued_rays.len();
            let how = Transparency { is_layered, ..transparency };
            buffers.trace(world, &mut generation.hits, &mut tile.traversal, how);
        }
        let hit = generation.hits.iter().flatten().count();
        if continued > 0 {
            tile.count(transparency.kind, continued, if is_first { 0 } else { hit });
        }
        is_first
    })
}

impl Buffers {
    /// Traces the rays of the current generation once. Those that pass the surface go to `continued_rays`.
    fn trace_first(&mut self, tile: &mut Tile, world: &World, transparency: Transparency, is_layered: bool) {
        let Tile { generations, current, traversal, .. } = tile;
        let RayGeneration { rays, hits, .. } = &mut generations[*current];
        hits.clear();
        world.accelerator.closest_hits(rays.rays(), hits, traversal);
        self.samples.clear();
        for index in 0..tile.generation().rays.len() {
            let generation = tile.generation();
            let Some(hit) = generation.hits.get(index) else { continue };
            let ray = generation.rays.get(index);
            let lookup = (transparency.culls, transparency.filter);
            let alpha = seen_opacity(world, &ray, &hit, lookup);
            // Nearly all rays; they need no random number.
            if alpha == 1.0 {
                continue;
            }
            generation.hits.set(index, None);
            let number = f64::from(self.number(tile, index, &ray, transparency));
            let cycle = OriginCycle::new(ray.origin());
            let mut continued = ContinuedRay { index: index as u32, distance: 0.0, number, ray, cycle };
            if self.layers.pass(&mut continued, &hit, alpha, world, &mut tile.generation().hits, is_layered) {
                self.continued_rays.push(continued);
            }
        }
    }

    /// The random number of a ray of the current generation. Those of camera rays, and of rays that have theirs, are
    /// stratified over the samples of a pixel; others are independent.
    fn number(&mut self, tile: &mut Tile, index: usize, ray: &Ray, transparency: Transparency) -> f32 {
        let Transparency { sampler, seed, .. } = transparency;
        let depth = tile.depth;
        let camera_ray = match depth {
            0 => Some(index),
            _ => tile.generation().camera_rays.get(index).map(|&ray| ray as usize),
        };
        let Some(camera_ray) = camera_ray else { return random::of_ray(ray, seed) };
        if self.samples.is_empty() {
            list_samples(tile, &mut self.samples);
        }
        let dimension = Dimension::opacity(depth as u32);
        let sample = self.samples.get(camera_ray);
        sample.map_or_else(|| random::of_ray(ray, seed), |sample| sample.pair(sampler, seed, dimension)[0])
    }

    /// Traces the continued rays once. Rays that stop write their hit; the others stay, behind the surface.
    fn trace(
        &mut self,
        world: &World,
        hits: &mut HitBuffer,
        traversal: &mut Traversal,
        Transparency { is_layered, culls, filter, .. }: Transparency,
    ) {
        let Buffers { continued_rays, rays, hits: found, layers, .. } = self;
        rays.clear();
        rays.extend(continued_rays.iter().map(|continued| continued.ray));
        found.clear();
        world.accelerator.closest_hits(rays.rays(), found, traversal);
        let mut found = found.iter();
        continued_rays.retain_mut(|ray| match found.next() {
            Some(Some(hit)) => {
                let alpha = seen_opacity(world, &ray.ray, &hit, (culls, filter));
                layers.pass(ray, &hit, alpha, world, hits, is_layered)
            }
            _ => false,
        });
    }
}

impl Layers {
    /// Moves a ray behind a hit with a surface of opacity `alpha`, if it passes that. A ray that stops writes its hit,
    /// and goes on in the next layer. Returns whether it passes.
    fn pass(
        &mut self,
        ray: &mut ContinuedRay,
        hit: &Hit,
        alpha: f64,
        world: &World,
        hits: &mut HitBuffer,
        is_layered: bool,
    ) -> bool {
        let stops = if is_layered { alpha > 0.0 } else { ray.number < alpha };
        let distance = ray.distance + hit.t;
        if stops {
            hits.set(ray.index as usize, Some(&Hit { t: distance, ..*hit }));
            if !is_layered || alpha == 1.0 {
                return false;
            }
            self.opacity[ray.index as usize] = alpha;
        } else {
            // Uniform again, given that the ray passed.
            ray.number = (ray.number - alpha) / (1.0 - alpha);
        }
        (ray.ray, ray.distance) = (behind(world, &ray.ray, hit), distance);
        if ray.cycle.repeats(ray.ray.origin()) {
            return false;
        }
        if stops {
            self.next.push(*ray);
        }
        !stops
    }

    /// Begins a layer of `count` pixels.
    fn start(&mut self, count: usize, is_first: bool) {
        self.next.clear();
        self.opacity.clear();
        self.opacity.resize(count, 1.0);
        if is_first {
            self.transmittance.clear();
            self.transmittance.resize(count, 1.0);
            self.colour.clear();
            self.colour.resize(count, [0.0; 3]);
            self.coverage.clear();
            self.coverage.resize(count, 0.0);
            self.shown.clear();
            self.shown.resize(count, [0.0; 4]);
        }
    }

    /// Blends the pixels of a layer under those before it. `covered` is 1 where they show a surface, and empty without
    /// an alpha channel; `seen` is [`Tile::shown`], empty without unlit surfaces.
    fn blend(&mut self, pixels: &[[f32; 3]], covered: &[f32], seen: &[[f32; 4]]) {
        let Layers { opacity, transmittance, colour, coverage, shown, .. } = self;
        let weights = transmittance.iter().zip(&*opacity).map(|(left, alpha)| left * alpha);
        for ((sum, weight), &covered) in coverage.iter_mut().zip(weights).zip(covered) {
            *sum += weight * f64::from(covered);
        }
        let weights = transmittance.iter().zip(&*opacity).map(|(left, alpha)| left * alpha);
        for ((sum, weight), seen) in shown.iter_mut().zip(weights).zip(seen) {
            sum.iter_mut().zip(seen).for_each(|(sum, &value)| *sum += weight * f64::from(value));
        }
        for (((sum, left), alpha), pixel) in colour.iter_mut().zip(transmittance).zip(opacity).zip(pixels) {
            // Rays that ended before see the background in this layer.
            let weight = *left * *alpha;
            if weight > 0.0 {
                sum.iter_mut().zip(pixel).for_each(|(sum, &value)| *sum += weight * f64::from(value));
            }
            *left *= 1.0 - *alpha;
        }
    }
}

/// For each pixel, the opacity of the current layer; `None` where camera rays do not see layers.
pub(crate) fn layer_opacities(tile: &Tile) -> Option<&[f64]> {
    let opacities = &tile.buffers::<Buffers>()?.layers.opacity;
    (!opacities.is_empty()).then_some(&opacities[..])
}

/// The transmittance before the current layer of a pixel, and its opacity; `None` where camera rays do not see layers.
pub(super) fn layer_weight(tile: &Tile, pixel: usize) -> Option<[f64; 2]> {
    let Layers { transmittance, opacity, .. } = &tile.buffers::<Buffers>()?.layers;
    Some([*transmittance.get(pixel)?, *opacity.get(pixel)?])
}

/// Blends the layers of camera rays; asks for a further one while rays go on.
pub(crate) fn blend_layers(buffers: &mut Buffers, tile: &mut Tile, _: &RenderContext) {
    let Tile { pixels, coverage, shown, .. } = &*tile;
    let coverage = coverage.as_deref().unwrap_or_default();
    buffers.layers.blend(pixels, coverage, shown.as_deref().unwrap_or_default());
    tile.needs_more_samples = !buffers.layers.next.is_empty();
    tile.pixels.clear();
    if !tile.needs_more_samples {
        tile.pixels.extend(buffers.layers.colour.iter().map(|sum| sum.map(|c| c as f32)));
        if let Some(coverage) = &mut tile.coverage {
            coverage.clear();
            coverage.extend(buffers.layers.coverage.iter().map(|&part| part as f32));
        }
        if let Some(shown) = &mut tile.shown {
            shown.clear();
            shown.extend(buffers.layers.shown.iter().map(|sum| sum.map(|c| c as f32)));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Number of steps until a cycle is found in the origins `origins(0)`, `origins(1)`, ...; `None` after `most`.
    fn steps(most: u32, origins: impl Fn(u32) -> f64) -> Option<u32> {
        let mut cycle = OriginCycle::new(DVec3::splat(origins(0)));
        (1..=most).find(|&step| cycle.repeats(DVec3::splat(origins(step))))
    }

    #[test]
    fn origins_that_repeat_end_a_ray_and_no_others() {
        assert_eq!(steps(9, |_| 1e18), Some(1), "an origin that does not advance");
        // The earlier origin is 1 after one step, and step 3 returns to 1.
        assert_eq!(steps(9, |step| f64::from(step % 2)), Some(3));
        // A later cycle whose length is no power of two.
        assert!(steps(100, |step| f64::from(if step < 10 { step } else { 10 + (step - 10) % 7 })).is_some());
        assert_eq!(steps(1 << 16, f64::from), None);
    }
}
