//! The full account of a hit, computed once, for the hit that counts.

use glam::{DVec2, DVec3};

use super::World;
use super::lower::vertex_colour;
use crate::bvh::Primitive;
use crate::geometry::spawn::SurfacePoint;
use crate::geometry::{Hit, PrimId, Ray};

/// A point of a surface, seen along a ray.
#[derive(Debug, Clone, Copy)]
pub struct Surface {
    /// Where it is, and the sizes that its error is relative to.
    pub point: SurfacePoint,
    /// Unit vector towards where the ray came from.
    pub view: DVec3,
    /// Unit normal of the geometry, on the side the ray came from.
    pub geometric_normal: DVec3,
    /// Unit normal for shading, on the same side.
    pub shading_normal: DVec3,
    /// Texture coordinates; zero where the object has none or its material reads none.
    pub uv: DVec2,
    /// The object's own tint at this point; white where it has none.
    pub tint: DVec3,
    /// Which primitive.
    pub prim: PrimId,
    /// Index of its object.
    pub object: u32,
    /// Index of its material.
    pub material: u32,
}

impl World {
    /// Everything that is to be known of `hit`, which must be a hit of `ray` with this world.
    #[inline(always)]
    pub fn surface(&self, ray: &Ray, hit: &Hit) -> Surface {
        let object_index = self.object_of(hit.prim);
        let object = &self.objects[object_index as usize];
        // Of length 1 up to the rounding of the ray, 2^-24 and less.
        let view = -ray.direction;
        let mut surface = Surface {
            point: SurfacePoint { position: DVec3::ZERO, reach: DVec3::ZERO },
            view,
            geometric_normal: view,
            shading_normal: view,
            uv: DVec2::ZERO,
            tint: DVec3::ONE,
            prim: hit.prim,
            object: object_index,
            material: object.material,
        };
        let facing = |n: DVec3| if n.dot(ray.direction) > 0.0 { -n } else { n };
        match self.accelerator.primitive(hit.slot) {
            Primitive::Sphere(sphere) => {
                let (_, normal) = sphere.surface(ray.at(hit.t));
                surface.point = SurfacePoint::on_sphere(sphere.centre, sphere.radius, normal);
                surface.geometric_normal = facing(normal);
                surface.shading_normal = surface.geometric_normal;
            }
            Primitive::Triangle(triangle) => {
                let [v, w] = hit.weights;
                let weights = [1.0 - v - w, v, w];
                surface.point = SurfacePoint::on_triangle(triangle.0, weights);
                // Needles whose f64 normal is lost to rounding show their side to the viewer.
                let normal = triangle.normal().try_normalize().map_or(view, facing);
                surface.geometric_normal = normal;
                surface.shading_normal = normal;
                let local = hit.prim.0 - object.first.0;
                if let Some(normals) = object.attributes.normals(local) {
                    let smooth = blend(normals, weights);
                    // Where the corners' normals are missing or cancel, the triangle's own stands.
                    if let Some(smooth) = smooth.try_normalize() {
                        surface.shading_normal = if smooth.dot(normal) < 0.0 { -smooth } else { smooth };
                    }
                }
                if self.materials[object.material as usize].is_textured()
                    && let Some(uvs) = object.attributes.uvs(local)
                {
                    let [a, b, c] = uvs.map(|uv| uv.as_dvec2());
                    surface.uv = a * weights[0] + b * weights[1] + c * weights[2];
                }
                if let Some(colours) = object.attributes.colours(local) {
                    let linear = blend(colours.map(|c| c.as_dvec3()), weights);
                    surface.tint = vertex_colour(linear, self.pipeline);
                }
            }
        }
        surface
    }
}

impl World {
    /// The point of the smooth surface over `surface`, at `hit`: lifted above the tangent planes of the corners (Hanika,
    /// Ray Tracing Gems II, chapter 4, 2021). The point itself where there is none.
    pub fn smooth_point(&self, surface: &Surface, hit: &Hit) -> SurfacePoint {
        let object = &self.objects[surface.object as usize];
        let Some(normals) = object.attributes.normals(hit.prim.0 - object.first.0) else {
            return surface.point;
        };
        let Primitive::Triangle(triangle) = self.accelerator.primitive(hit.slot) else {
            return surface.point;
        };
        let [v, w] = hit.weights;
        let weights = [1.0 - v - w, v, w];
        // On the side that the surface is seen from.
        let side = blend(normals, weights).dot(surface.shading_normal).signum();
        let mut point = surface.point;
        for ((corner, normal), weight) in triangle.0.iter().zip(normals).zip(weights) {
            let normal = normal * side;
            let below = (surface.point.position - corner).dot(normal).min(0.0);
            point.position -= weight * below * normal;
        }
        point
    }
}

fn blend([a, b, c]: [DVec3; 3], weights: [f64; 3]) -> DVec3 {
    a * weights[0] + b * weights[1] + c * weights[2]
}
