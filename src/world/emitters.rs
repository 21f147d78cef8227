//! The emissive surfaces of a world as lights: chosen by power, sampled by area (triangles) or solid angle (analytic
//! shapes and rectangles).

use glam::DVec3;

use super::rectangle::Rectangle;
use super::{PreparedMaterial, SurfaceInteraction};
use crate::bvh::Primitive;
use crate::film::colour::luminance;
use crate::geometry::spawn::SurfacePoint;
use crate::geometry::{Precision, PrimId, Triangle};
use crate::scene::{Material, Object, Shape};

/// The emissive primitives of a world. Both sides of a surface emit, but only the front of a rectangle light.
pub(crate) struct Emitters {
    emitters: Vec<Emitter>,
    /// Cumulative powers: the sum over the emitters up to and including each.
    cumulative: Vec<f64>,
    /// The rectangle lights, whose triangles are the last primitives, two each.
    rectangles: Vec<Rectangle>,
    /// The first of those primitives.
    first_rectangle: PrimId,
}

struct Emitter {
    shape: EmitterShape,
    material: u32,
}

enum EmitterShape {
    Primitive(Primitive),
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
    /// The emitted radiance.
    pub(crate) radiance: DVec3,
    /// The density per solid angle.
    pub(crate) pdf: f64,
}

/// The emitted radiance of a material, of every surface that is sampled as a light: opaque, without texture.
pub(crate) fn sampled_emission(material: &PreparedMaterial) -> Option<DVec3> {
    if material.opacity().is_some() {
        return None;
    }
    let emission = match material {
        Material::Phong(m) => m.emission,
        Material::MetallicRoughness(m) if m.unlit || m.emission_texture.is_some() => return None,
        Material::MetallicRoughness(m) => m.emission,
    };
    (luminance(emission) > 0.0 && emission.is_finite()).then_some(emission)
}

impl Emitters {
    /// Lists the emissive primitives of the objects, as rounded to the tier's precision. The last objects are
    /// `rectangles`.
    pub(super) fn new(
        objects: &[Object],
        materials: &[PreparedMaterial],
        rectangles: Vec<Rectangle>,
        precision: Precision,
    ) -> Self {
        let primitives: usize = objects.iter().map(|object| object.shape.primitive_count()).sum();
        let first_rectangle = PrimId((primitives - 2 * rectangles.len()) as u32);
        let mut list = Emitters { emitters: Vec::new(), cumulative: Vec::new(), rectangles, first_rectangle };
        let (objects, of_rectangles) = objects.split_at(objects.len() - list.rectangles.len());
        for object in objects {
            let material = object.material.0;
            let Some(emission) = sampled_emission(&materials[material as usize]) else { continue };
            let mut add = |primitive: Primitive| {
                let Some(primitive) = primitive.rounded(precision) else { return };
                let power = luminance(emission) * area(&primitive);
                list.add(Emitter { shape: EmitterShape::Primitive(primitive), material }, power);
            };
            match &object.shape {
                Shape::Analytic(shape) => add(Primitive::Analytic(*shape)),
                Shape::Mesh(mesh) => {
                    let corners = |t: &[u32; 3]| t.map(|i| mesh.positions[i as usize]);
                    mesh.triangles.iter().for_each(|t| add(Primitive::Triangle(Triangle(corners(t)))));
                }
                Shape::Placed(placed) => {
                    let triangle = |t| Primitive::Triangle(Triangle(placed.corners_of(t)));
                    (0..placed.triangle_count() as u32).for_each(|t| add(triangle(t)));
                }
            }
        }
        for (index, object) in of_rectangles.iter().enumerate() {
            let material = object.material.0;
            let Some(emission) = sampled_emission(&materials[material as usize]) else { continue };
            let corners = list.rectangles[index].corners().map(|corner| corner.map(|c| precision.round(c)));
            let halves = [[0, 1, 2], [0, 2, 3]].map(|t| Triangle(t.map(|i: usize| corners[i])));
            // Rounding may leave nothing of a small rectangle, which no ray then hits.
            if halves.iter().all(|half| half.unit_normal().is_some()) {
                let power = luminance(emission) * list.rectangles[index].area();
                list.add(Emitter { shape: EmitterShape::Rectangle(index, halves), material }, power);
            }
        }
        list
    }

    fn add(&mut self, emitter: Emitter, power: f64) {
        if power > 0.0 {
            self.cumulative.push(self.total() + power);
            self.emitters.push(emitter);
        }
    }

    /// The rectangle light that a primitive is part of.
    fn rectangle_of(&self, prim: PrimId) -> Option<&Rectangle> {
        self.rectangles.get(prim.0.checked_sub(self.first_rectangle.0)? as usize / 2)
    }

    /// Whether a primitive emits from the front alone, from which its corners are seen counterclockwise.
    pub(crate) fn is_one_sided(&self, prim: PrimId) -> bool {
        prim >= self.first_rectangle
    }

    /// Whether nothing emits.
    pub(crate) fn is_empty(&self) -> bool {
        self.emitters.is_empty()
    }

    fn total(&self) -> f64 {
        self.cumulative.last().copied().unwrap_or(0.0)
    }

    /// Samples a point of an emitter that is visible from `from` if nothing stands between; `None` where the sampled
    /// point cannot light it. `choice` and `numbers` are uniform in [0, 1).
    pub(crate) fn sample(
        &self,
        materials: &[PreparedMaterial],
        from: DVec3,
        choice: f64,
        numbers: [f64; 2],
    ) -> Option<EmitterSample> {
        let total = self.total();
        let index =
            self.cumulative.partition_point(|&sum| sum <= choice * total).min(self.emitters.len() - 1);
        let Emitter { shape, material } = &self.emitters[index];
        let radiance = sampled_emission(&materials[*material as usize])?;
        let density = luminance(radiance) / total;
        match shape {
            EmitterShape::Rectangle(index, halves) => {
                let rectangle = &self.rectangles[*index];
                let (point, normal) = in_halves(halves, rectangle.sample(from, numbers)?)?;
                let direction = (point.position - from).try_normalize()?;
                let pdf = density * rectangle.area() * rectangle.pdf(from, point.position);
                (direction.dot(normal) < 0.0 && pdf.is_finite()).then_some(EmitterSample {
                    direction,
                    point,
                    normal,
                    radiance,
                    pdf,
                })
            }
            EmitterShape::Primitive(Primitive::Triangle(triangle)) => {
                let (point, normal) = on_triangle(triangle, numbers)?;
                let to_light = point.position - from;
                let direction = to_light.try_normalize()?;
                let cosine = -direction.dot(normal);
                let normal = if cosine < 0.0 { -normal } else { normal };
                // Area density 1 / area times the choice's area * luminance / total; converted to solid angle.
                let pdf = density * to_light.length_squared() / cosine.abs();
                (pdf.is_finite() && pdf > 0.0).then_some(EmitterSample {
                    direction,
                    point,
                    normal,
                    radiance,
                    pdf,
                })
            }
            EmitterShape::Primitive(Primitive::Analytic(shape)) => {
                let (direction, distance) = shape.sample_solid_angle(from, numbers)?;
                let (point, outward) = shape.surface(from + direction * distance);
                let normal = if outward.dot(direction) > 0.0 { -outward } else { outward };
                let pdf = density * shape.area() / shape.solid_angle(from);
                Some(EmitterSample { direction, point, normal, radiance, pdf })
            }
        }
    }

    /// The density per solid angle with which [`Emitters::sample`] from `from` chooses the point of a surface that a
    /// ray hit and that emits `radiance`.
    pub(crate) fn pdf(
        &self,
        surface: &SurfaceInteraction,
        primitive: &Primitive,
        radiance: DVec3,
        from: DVec3,
    ) -> f64 {
        let density = luminance(radiance) / self.total();
        let (position, normal) = (surface.point.position, surface.geometric_normal);
        if let Some(rectangle) = self.rectangle_of(surface.prim) {
            return density * rectangle.area() * rectangle.pdf(from, position);
        }
        match primitive {
            Primitive::Triangle(_) => {
                let to_light = position - from;
                density * to_light.length_squared() / to_light.normalize().dot(normal).abs()
            }
            Primitive::Analytic(shape) => density * shape.area() / shape.solid_angle(from),
        }
    }
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
    let (triangle, weights) =
        if x >= y { (lower, [1.0 - x, x - y, y]) } else { (upper, [1.0 - y, x, y - x]) };
    Some((SurfacePoint::on_triangle(triangle.0, weights), triangle.unit_normal()?))
}

/// A uniform point of a triangle and its unit normal (Heitz, A Low-Distortion Map Between Triangle and Square, 2019).
fn on_triangle(triangle: &Triangle, [x, y]: [f64; 2]) -> Option<(SurfacePoint, DVec3)> {
    let (v, w) = if y > x { (0.5 * x, y - 0.5 * x) } else { (x - 0.5 * y, 0.5 * y) };
    let point = SurfacePoint::on_triangle(triangle.0, [1.0 - v - w, v, w]);
    Some((point, triangle.unit_normal()?))
}
