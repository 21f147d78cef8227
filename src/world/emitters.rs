//! The emissive surfaces of a world as lights: chosen by power, sampled by area (triangles) or solid angle (analytic shapes).

use glam::DVec3;

use super::PreparedMaterial;
use crate::bvh::Primitive;
use crate::film::colour::luminance;
use crate::geometry::spawn::SurfacePoint;
use crate::geometry::{Precision, Triangle};
use crate::scene::{Material, Object, Shape};

/// The emissive primitives of a world. Both sides of a surface emit.
pub(crate) struct Emitters {
    emitters: Vec<Emitter>,
    /// Cumulative powers: the sum over the emitters up to and including each.
    cumulative: Vec<f64>,
}

struct Emitter {
    primitive: Primitive,
    material: u32,
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
    /// Lists the emissive primitives of the objects, as rounded to the tier's precision.
    pub(super) fn new(objects: &[Object], materials: &[PreparedMaterial], precision: Precision) -> Self {
        let mut list = Emitters { emitters: Vec::new(), cumulative: Vec::new() };
        let mut total = 0.0;
        for object in objects {
            let material = object.material.0;
            let Some(emission) = sampled_emission(&materials[material as usize]) else { continue };
            let mut add = |primitive: Primitive| {
                let Some(primitive) = primitive.rounded(precision) else { return };
                let power = luminance(emission) * area(&primitive);
                if power > 0.0 {
                    total += power;
                    list.emitters.push(Emitter { primitive, material });
                    list.cumulative.push(total);
                }
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
        list
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
        let Emitter { primitive, material } = &self.emitters[index];
        let radiance = sampled_emission(&materials[*material as usize])?;
        let density = luminance(radiance) / total;
        match primitive {
            Primitive::Triangle(triangle) => {
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
            Primitive::Analytic(shape) => {
                let (direction, distance) = shape.sample_solid_angle(from, numbers)?;
                let (point, outward) = shape.surface(from + direction * distance);
                let normal = if outward.dot(direction) > 0.0 { -outward } else { outward };
                let pdf = density * shape.area() / shape.solid_angle(from);
                Some(EmitterSample { direction, point, normal, radiance, pdf })
            }
        }
    }

    /// The density per solid angle with which [`Emitters::sample`] from `from` chooses the point `position` of a
    /// primitive that emits `radiance`, with the unit geometric normal `normal` there.
    pub(crate) fn pdf(
        &self,
        primitive: &Primitive,
        radiance: DVec3,
        from: DVec3,
        position: DVec3,
        normal: DVec3,
    ) -> f64 {
        let density = luminance(radiance) / self.total();
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

/// A uniform point of a triangle and its unit normal (Heitz, A Low-Distortion Map Between Triangle and Square, 2019).
fn on_triangle(triangle: &Triangle, [x, y]: [f64; 2]) -> Option<(SurfacePoint, DVec3)> {
    let (v, w) = if y > x { (0.5 * x, y - 0.5 * x) } else { (x - 0.5 * y, 0.5 * y) };
    let point = SurfacePoint::on_triangle(triangle.0, [1.0 - v - w, v, w]);
    Some((point, triangle.unit_normal()?))
}
