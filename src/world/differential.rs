//! Ray differentials (Igehy, Tracing Ray Differentials, SIGGRAPH 1999), which give the footprint of a pixel in a
//! texture without reading neighbouring pixels.

use glam::{DVec2, DVec3};

use super::World;
use super::interaction::SurfaceInteraction;
use crate::bvh::{Hit, PrimId, Primitive, Ray};
use crate::scene::mesh::vertex_attributes::blend;

/// A ray differential: the change of a ray from one pixel to the next, to the right and down.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Differential {
    /// The change of its origin.
    pub origin: [DVec3; 2],
    /// The change of its direction, which has length 1.
    pub direction: [DVec3; 2],
}

/// Texture coordinates of a surface interaction, with the pixel's footprint.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct TexturePoint {
    /// Texture coordinates.
    pub uv: DVec2,
    /// Their change from one pixel to the next, to the right and down; zero where no filter needs it.
    pub footprint: [DVec2; 2],
}

impl Differential {
    /// The change over `width` pixels.
    pub fn scaled(&self, width: f64) -> Self {
        Differential { origin: self.origin.map(|d| d * width), direction: self.direction.map(|d| d * width) }
    }

    /// The change of the intersection at distance `t` with a plane (Igehy, equations 10 to 12). Not finite where the
    /// ray is parallel to the plane.
    pub fn at(&self, ray: &Ray, t: f64, normal: DVec3) -> [DVec3; 2] {
        let along = ray.direction().dot(normal);
        [0, 1].map(|k| {
            let moved = self.origin[k] + t * self.direction[k];
            moved - (moved.dot(normal) / along) * ray.direction()
        })
    }

    /// The differential of the mirrored ray: `points` is the change of the intersection, `normals` that of the normal
    /// (Igehy, equations 13 to 17).
    pub fn mirrored(&self, ray: &Ray, points: [DVec3; 2], normal: DVec3, normals: [DVec3; 2]) -> Self {
        let direction = [0, 1].map(|k| {
            let along = ray.direction().dot(normal);
            let change = self.direction[k].dot(normal) + ray.direction().dot(normals[k]);
            self.direction[k] - 2.0 * (along * normals[k] + change * normal)
        });
        Differential { origin: points, direction }
    }
}

impl World {
    /// The texture coordinates of a set at a point of a triangle of an object; `None` without any.
    pub(crate) fn uv(&self, object: u32, prim: PrimId, barycentrics: [f64; 3], set: u8) -> Option<DVec2> {
        let object = &self.objects[object as usize];
        let corners = object.attributes.uvs(prim.0 - object.first.0, set)?.map(|uv| uv.as_dvec2());
        Some(blend(corners, barycentrics))
    }

    /// The texture point of a hit with an object by a set of texture coordinates; `None` without them. `normal` is the
    /// geometric normal, `differential` that of the ray; without it the footprint is zero.
    #[inline]
    pub fn texture_point(
        &self,
        (object, hit, normal): (u32, &Hit, DVec3),
        ray: &Ray,
        differential: Option<&Differential>,
        set: u8,
    ) -> Option<TexturePoint> {
        let object = &self.objects[object as usize];
        let [a, b, c] = object.attributes.uvs(hit.prim.0 - object.first.0, set)?.map(|uv| uv.as_dvec2());
        let [v, w] = hit.barycentrics;
        let uv = blend([a, b, c], [1.0 - v - w, v, w]);
        let mut point = TexturePoint { uv, ..TexturePoint::default() };
        if let Some(differential) = differential
            && let Some(changes) = self.barycentrics_change(hit, normal, ray, differential)
        {
            point.footprint = changes.map(|change| change.x * (b - a) + change.y * (c - a));
        }
        Some(point)
    }

    /// The change of the barycentrics v and w, from one pixel to the next; `None` on other
    /// shapes than triangles.
    fn barycentrics_change(
        &self,
        hit: &Hit,
        normal: DVec3,
        ray: &Ray,
        differential: &Differential,
    ) -> Option<[DVec2; 2]> {
        let Primitive::Triangle(triangle) = self.accelerator.primitive(hit.slot) else { return None };
        let [a, b, c] = triangle.0;
        let (to_b, to_c) = (b - a, c - a);
        let cross = to_b.cross(to_c);
        // p = v to_b + w to_c, so p x to_c = v cross and to_b x p = w cross.
        let scaled = cross / cross.length_squared();
        let moved = differential.at(ray, hit.t, normal);
        Some(moved.map(|p| DVec2::new(p.cross(to_c).dot(scaled), to_b.cross(p).dot(scaled))))
    }

    /// The differential of the ray mirrored at `surface`. The change of a normal map across the pixel is left out.
    pub fn mirrored_differential(
        &self,
        surface: &SurfaceInteraction,
        ray: &Ray,
        differential: &Differential,
    ) -> Differential {
        let hit = &surface.hit;
        let points = differential.at(ray, hit.t, surface.geometric_normal);
        let object = &self.objects[surface.object as usize];
        let mut normals = [DVec3::ZERO; 2];
        match self.accelerator.primitive(hit.slot) {
            // Seen from inside, the normal points inwards and changes in the opposite direction.
            Primitive::Analytic(shape) => {
                let position = surface.point.position;
                let (_, outward) = shape.surface(position);
                let side = outward.dot(surface.geometric_normal).signum();
                normals = points.map(|step| side * shape.normal_derivative(position, step));
            }
            Primitive::Triangle(_) => {
                if let Some(corners) = object.attributes.normals(hit.prim.0 - object.first.0)
                    && let Some(changes) =
                        self.barycentrics_change(hit, surface.geometric_normal, ray, differential)
                {
                    let [v, w] = hit.barycentrics;
                    let sum = blend(corners, [1.0 - v - w, v, w]);
                    let length = sum.length();
                    let (unit, [a, b, c]) = (sum / length, corners);
                    let side = unit.dot(surface.geometric_normal).signum();
                    if length > 0.0 {
                        normals = changes.map(|change| {
                            let normal = (change.x * (b - a) + change.y * (c - a)) / length;
                            side * (normal - normal.dot(unit) * unit)
                        });
                    }
                }
            }
        }
        differential.mirrored(ray, points, surface.shading_normal, normals)
    }
}
