//! The emissive surfaces of a world as lights: chosen by power, or by a tree where many objects emit; sampled by area (triangles), by solid angle
//! (rectangles) or as analytic shapes do it. The power of a textured triangle is that of the mean of its texture. What
//! a texture emits is looked up by the caller.

use glam::DVec3;

use super::emission_texture::MeanEmission;
use super::guide::{find, guide};
use super::light_tree::{LightTree, LocalLight, MANY};
use super::rectangle::Rectangle;
use super::sampled_triangle::{SampledTriangle, TriangleSample, TwoTriangles};
use super::shape_sampling;
use super::{Image, PreparedMaterial, SurfaceInteraction};
use crate::bvh::detail::{Precision, SurfacePoint};
use crate::bvh::{AnalyticShape, Numerics, PrimId, Primitive, Triangle};
use crate::film::colour::luminance;
use crate::scene::{Attribute, Mesh, Object, Shape, TextureSlot};

/// The emissive primitives of a world. Both sides of a surface emit, except of lights with a front.
pub(crate) struct Emitters {
    emitters: Vec<Emitter>,
    /// Cumulative powers: the sum over the emitters up to and including each.
    cumulative: Vec<f64>,
    /// The guide of these.
    guide: Vec<u32>,
    /// The tree that chooses among emitters of many objects.
    tree: Option<LightTree>,
    /// For each object with an emission texture, the luminances of the mean radiance of its triangles.
    textured: Vec<Option<Box<[f32]>>>,
    /// The rectangle lights, whose triangles are the last primitives, two each.
    rectangles: Vec<Rectangle>,
    /// The first of those primitives.
    first_rectangle: PrimId,
    /// The first of the primitives that emit from the front alone, which are the last.
    first_one_sided: PrimId,
}

struct Emitter {
    shape: EmitterShape,
    /// The number of its primitive in the world, the first of a rectangle.
    id: PrimId,
    object: u32,
    material: u32,
    /// The emitted radiance without texture.
    radiance: DVec3,
    /// The luminance of its mean radiance: power by area.
    luminance: f64,
    area: f64,
}

enum EmitterShape {
    Triangle(SampledTriangle),
    Analytic(AnalyticShape),
    /// A rectangle light by its index, and its triangles as rounded to the tier's precision. Points are sampled on the
    /// exact rectangle, and moved to the same place of the triangles, which rays hit.
    Rectangle(usize, [Triangle; 2]),
}

/// A point of an emissive surface, as sampled from a point of the scene.
#[derive(Debug, Clone, Copy)]
pub(crate) struct EmitterSample {
    /// The unit vector towards the point.
    pub(crate) direction: DVec3,
    /// The point, with what ray origins are computed from.
    pub(crate) point: SurfacePoint,
    /// The unit normal there, on the side of the point that it was sampled from.
    pub(crate) normal: DVec3,
    /// The emitted radiance without texture.
    pub(crate) radiance: DVec3,
    /// The density per solid angle.
    pub(crate) pdf: f64,
    /// The primitive, its object and material.
    pub(crate) id: PrimId,
    pub(crate) object: u32,
    pub(crate) material: u32,
    /// The barycentrics u, v and w, on a triangle.
    pub(crate) barycentrics: [f64; 3],
}

/// The emitted radiance of a material, of every surface that is sampled as a light: opaque, without its texture.
pub(crate) fn sampled_emission(material: &PreparedMaterial) -> Option<DVec3> {
    let emission = *material.emission();
    let emits = material.opacity().is_none() && !material.is_unlit() && luminance(emission) > 0.0;
    (emits && emission.is_finite()).then_some(emission)
}

/// The luminances of the mean radiance of an object's triangles by its emission texture; `None` without one.
fn textured(object: &Object, material: &PreparedMaterial, images: &[Image]) -> Option<Box<[f32]>> {
    let (emission, texture) = (sampled_emission(material)?, material.textures()[TextureSlot::Emission]?);
    let mesh: &Mesh = match &object.shape {
        Shape::Mesh(mesh) => mesh,
        Shape::Placed(placed) => &placed.mesh,
        Shape::Analytic(_) => return None,
    };
    let Attribute { values, triangles } = mesh.uvs.get(usize::from(texture.coordinates))?;
    let mean = MeanEmission::new(&images[texture.image.0 as usize], texture.sampler, emission);
    let triangles = triangles.as_ref().unwrap_or(&mesh.triangles);
    Some(triangles.iter().map(|t| mean.over(t.map(|i| values[i as usize])) as f32).collect())
}

impl Emitters {
    /// Lists the emissive primitives of the objects, whose first primitives are `firsts`, as rounded to the tier's
    /// precision. The last `one_sided` objects emit from the front alone, and the last of these are `rectangles`.
    pub(super) fn new(
        objects: &[Object],
        firsts: &[PrimId],
        (materials, images): (&[PreparedMaterial], &[Image]),
        (one_sided, rectangles): (usize, Vec<Rectangle>),
        precision: Precision,
    ) -> Self {
        let count = objects.len() - rectangles.len();
        let first_of_last =
            |count: usize| firsts.get(objects.len() - count).copied().unwrap_or(PrimId(u32::MAX));
        let [first_rectangle, first_one_sided] = [rectangles.len(), one_sided].map(first_of_last);
        let mut list = Emitters {
            emitters: Vec::new(),
            cumulative: Vec::new(),
            guide: Vec::new(),
            tree: None,
            textured: Vec::new(),
            rectangles,
            first_rectangle,
            first_one_sided,
        };
        for (index, (object, first)) in objects.iter().zip(firsts).enumerate().take(count) {
            let material = object.material.0;
            let Some(emission) = sampled_emission(&materials[material as usize]) else { continue };
            let textured = textured(object, &materials[material as usize], images);
            let mut add = |local: u32, primitive: Primitive| {
                let Some(primitive) = primitive.rounded(precision) else { return };
                let of_texture = textured.as_ref().map(|textured| f64::from(textured[local as usize]));
                let luminance = of_texture.unwrap_or_else(|| luminance(emission));
                let area = area(&primitive);
                let id = PrimId(first.0 + local);
                let shape = match primitive {
                    Primitive::Triangle(triangle) => EmitterShape::Triangle(SampledTriangle::new(triangle)),
                    Primitive::Analytic(shape) => EmitterShape::Analytic(shape),
                };
                let (object, radiance) = (index as u32, emission);
                list.add(Emitter { shape, id, object, material, radiance, luminance, area });
            };
            match &object.shape {
                Shape::Analytic(shape) => add(0, Primitive::Analytic(*shape)),
                Shape::Mesh(mesh) => {
                    let corners = |t: &[u32; 3]| t.map(|i| mesh.positions[i as usize]);
                    let triangles = (0..).zip(&mesh.triangles);
                    triangles.for_each(|(i, t)| add(i, Primitive::Triangle(Triangle(corners(t)))));
                }
                Shape::Placed(placed) => {
                    let triangle = |t| Primitive::Triangle(Triangle(placed.corners_of(t)));
                    (0..placed.triangle_count() as u32).for_each(|t| add(t, triangle(t)));
                }
            }
            if textured.is_some() {
                list.textured.resize_with(objects.len(), || None);
                list.textured[index] = textured;
            }
        }
        for (index, object) in objects[count..].iter().enumerate() {
            let material = object.material.0;
            let Some(emission) = sampled_emission(&materials[material as usize]) else { continue };
            let corners = list.rectangles[index].corners().map(|corner| corner.map(|c| precision.round(c)));
            let halves = [[0, 1, 2], [0, 2, 3]].map(|t| Triangle(t.map(|i: usize| corners[i])));
            // Rounding may leave nothing of a small rectangle, which no ray then hits.
            if halves.iter().all(|half| half.unit_normal().is_some()) {
                let (shape, id) = (EmitterShape::Rectangle(index, halves), firsts[count + index]);
                let (object, luminance) = ((count + index) as u32, luminance(emission));
                let area = list.rectangles[index].area();
                list.add(Emitter { shape, id, object, material, radiance: emission, luminance, area });
            }
        }
        let parts = list.cumulative.len().next_power_of_two();
        list.guide = guide(&list.cumulative, parts).map(|entry| entry as u32).collect();
        if list.emitters.chunk_by(|a, b| a.object == b.object).count() >= MANY {
            let local: Vec<LocalLight> = list.emitters.iter().map(|emitter| list.local(emitter)).collect();
            list.tree = Some(LightTree::new(&local));
        }
        list
    }

    /// The luminance of the mean radiance of a primitive, `local` within its object, whose material emits `emission`.
    fn luminance_of(&self, object: u32, local: u32, emission: DVec3) -> f64 {
        match self.textured.get(object as usize) {
            Some(Some(textured)) => textured[local as usize].into(),
            _ => luminance(emission),
        }
    }

    /// An emitter's place and power. A convex shape shows a quarter of its area on average (Cauchy), a flat one half.
    fn local(&self, emitter: &Emitter) -> LocalLight {
        let (bounds, visible_share) = match &emitter.shape {
            EmitterShape::Triangle(triangle) => (bounds_of(&triangle.triangle.0), 0.5),
            EmitterShape::Rectangle(index, _) => (bounds_of(&self.rectangles[*index].corners()), 0.5),
            EmitterShape::Analytic(shape) => {
                let (centre, radius) = shape.bounding_sphere();
                ([centre - radius, centre + radius], 0.25)
            }
        };
        LocalLight { bounds, constant: 0.0, falling: visible_share * emitter.luminance * emitter.area }
    }

    fn add(&mut self, emitter: Emitter) {
        let power = emitter.luminance * emitter.area;
        if power > 0.0 {
            self.cumulative.push(self.total() + power);
            self.emitters.push(emitter);
        }
    }

    /// The rectangle light that a primitive is part of.
    fn rectangle_of(&self, prim: PrimId) -> Option<&Rectangle> {
        self.rectangles.get(prim.0.checked_sub(self.first_rectangle.0)? as usize / 2)
    }

    /// Whether a primitive emits from the front alone: where its normal points, or its corners are seen
    /// counterclockwise.
    pub(crate) fn is_one_sided(&self, prim: PrimId) -> bool {
        prim >= self.first_one_sided
    }

    /// Whether nothing emits.
    pub(crate) fn is_empty(&self) -> bool {
        self.emitters.is_empty()
    }

    /// Whether there are two emitters at most.
    pub(crate) fn are_two(&self) -> bool {
        self.emitters.len() <= 2
    }

    fn total(&self) -> f64 {
        self.cumulative.last().copied().unwrap_or(0.0)
    }

    /// An emitter chosen from a point, and the density of that choice over its area.
    #[inline]
    fn choose(&self, from: DVec3, choice: f64) -> (&Emitter, f64) {
        if let Some(tree) = &self.tree {
            let (index, probability) = tree.sample(from, choice);
            let emitter = &self.emitters[index];
            return (emitter, probability / emitter.area);
        }
        let (index, _) = find(&self.guide, &self.cumulative, choice);
        let emitter = &self.emitters[index];
        // The choice's area * luminance / total, over the area.
        (emitter, emitter.luminance / self.total())
    }

    /// The sample of [`Emitters::sample`] and its radiance, if it is of a triangle in a world without emission textures.
    #[inline]
    pub(crate) fn sample_triangle(
        &self,
        from: DVec3,
        choice: f64,
        numbers: [f64; 2],
    ) -> Option<(TriangleSample, DVec3)> {
        if !self.textured.is_empty() {
            return None;
        }
        let (emitter, density) = self.choose(from, choice);
        let EmitterShape::Triangle(triangle) = &emitter.shape else { return None };
        let (sample, _) = triangle.sample(density, numbers)?;
        Some((sample, emitter.radiance))
    }

    /// The emitters, if they are one or two triangles without texture.
    pub(crate) fn two_triangles(&self) -> Option<TwoTriangles<'_>> {
        let (first, last) = match &self.emitters[..] {
            [one] => (one, one),
            [first, last] => (first, last),
            _ => return None,
        };
        let (EmitterShape::Triangle(a), EmitterShape::Triangle(b)) = (&first.shape, &last.shape) else {
            return None;
        };
        let total = self.total();
        self.textured.is_empty().then_some(TwoTriangles {
            triangles: [a, b],
            normals: [a.normal?, b.normal?],
            densities: [first, last].map(|emitter| emitter.luminance / total),
            radiances: [first.radiance, last.radiance],
            second_from: self.cumulative[0],
            total,
        })
    }

    /// Samples a point of an emitter that is visible from `from` if nothing stands between; `None` where the sampled
    /// point cannot light it. `choice` and `numbers` are uniform in [0, 1).
    pub(crate) fn sample(&self, from: DVec3, choice: f64, numbers: [f64; 2]) -> Option<EmitterSample> {
        let (emitter, density) = self.choose(from, choice);
        let &Emitter { ref shape, id, object, material, radiance, .. } = emitter;
        let (direction, point, normal, barycentrics, pdf) = match shape {
            EmitterShape::Rectangle(index, halves) => {
                let rectangle = &self.rectangles[*index];
                let (point, normal) = in_halves(halves, rectangle.sample(from, numbers)?)?;
                let direction = (point.position - from).try_normalize()?;
                // Only the front emits.
                if direction.dot(normal) >= 0.0 {
                    return None;
                }
                let pdf = density * rectangle.area() * rectangle.pdf(from, point.position);
                (direction, point, normal, [0.0; 3], pdf)
            }
            EmitterShape::Triangle(triangle) => {
                let (sample, barycentrics) = triangle.sample(density, numbers)?;
                let (direction, normal, pdf) = sample.seen_from(from);
                (direction, sample.point, normal, barycentrics, pdf)
            }
            EmitterShape::Analytic(shape) => {
                let (direction, distance) = shape_sampling::sample(shape, from, numbers)?;
                let (point, outward) = shape.surface(from + direction * distance);
                let is_back = outward.dot(direction) > 0.0;
                if is_back && self.is_one_sided(id) {
                    return None;
                }
                let normal = if is_back { -outward } else { outward };
                let pdf =
                    density * shape.area() / shape_sampling::sampled_solid_angle(shape, from, point.position);
                (direction, point, normal, [1.0, 0.0, 0.0], pdf)
            }
        };
        let sample =
            EmitterSample { direction, point, normal, radiance, pdf, id, object, material, barycentrics };
        (pdf.is_finite() && pdf > 0.0).then_some(sample)
    }

    /// The density per solid angle with which [`Emitters::sample`] from `from` chooses the point of a surface that a
    /// ray hit: of a triangle or of `shape`, `local` within its object, whose material emits `emission`. 0 for a
    /// textured triangle that is not sampled.
    pub(crate) fn pdf(
        &self,
        surface: &SurfaceInteraction,
        shape: Option<AnalyticShape>,
        (local, emission): (u32, DVec3),
        from: DVec3,
    ) -> f64 {
        let luminance = self.luminance_of(surface.object, local, emission);
        if luminance == 0.0 {
            return 0.0;
        }
        let density = match &self.tree {
            Some(tree) => {
                // The triangles of a rectangle are one emitter.
                let prim = surface.hit.prim.0;
                let id = prim - (prim.saturating_sub(self.first_rectangle.0) & 1);
                let Ok(index) = self.emitters.binary_search_by_key(&id, |emitter| emitter.id.0) else {
                    return 0.0;
                };
                tree.probability(index, from) / self.emitters[index].area
            }
            None => luminance / self.total(),
        };
        let (position, normal) = (surface.point.position, surface.geometric_normal);
        if let Some(rectangle) = self.rectangle_of(surface.hit.prim) {
            return density * rectangle.area() * rectangle.pdf(from, position);
        }
        match shape {
            None => {
                let to_light = position - from;
                density * to_light.length_squared() / to_light.normalize().dot(normal).abs()
            }
            Some(shape) => {
                density * shape.area() / shape_sampling::sampled_solid_angle(&shape, from, position)
            }
        }
    }
}

fn bounds_of(points: &[DVec3]) -> [DVec3; 2] {
    let (first, rest) = (points[0], &points[1..]);
    [rest.iter().fold(first, |low, &p| low.min(p)), rest.iter().fold(first, |high, &p| high.max(p))]
}

/// The area of a primitive.
fn area(primitive: &Primitive) -> f64 {
    match primitive {
        Primitive::Triangle(triangle) => 0.5 * triangle.normal().length(),
        Primitive::Analytic(shape) => shape.area(),
    }
}

/// The point of a rectangle at coordinates along its edges, 0 to 1, on its two triangles, and their unit normal there.
fn in_halves([lower, upper]: &[Triangle; 2], [x, y]: [f64; 2]) -> Option<(SurfacePoint, DVec3)> {
    let (triangle, barycentrics) =
        if x >= y { (lower, [1.0 - x, x - y, y]) } else { (upper, [1.0 - y, x, y - x]) };
    Some((SurfacePoint::on_triangle(triangle.0, barycentrics, Numerics::Watertight), triangle.unit_normal()?))
}
