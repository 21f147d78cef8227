//! The vertex of a path: a surface interaction with its BSDF, its frame and the media on both sides.

use glam::DVec3;

use super::Path;
use super::bsdf::{diffuse_albedo, parameters};
use super::media::{Crossing, Media};
use super::numbers::Numbers;
use crate::shading::base_colour;
use crate::shading::bsdf::Bsdf;
use crate::world::{SurfaceInteraction, World};

/// A surface interaction of a path.
pub(super) struct Vertex<'a> {
    pub(super) world: &'a World,
    pub(super) surface: SurfaceInteraction,
    pub(super) camera_ray: u32,
    pub(super) numbers: Numbers<'a>,
    /// The path, with the transmittance up to the surface.
    pub(super) path: Path,
    /// The media in front of the surface and behind it.
    sides: [Media; 2],
    /// Tangent, bitangent and shading normal.
    pub(super) frame: [DVec3; 3],
    /// `None` where the surface scatters nothing, or without storage for one.
    pub(super) bsdf: Option<&'a Bsdf>,
}

impl<'a> Vertex<'a> {
    /// The vertex at which a path through `media` arrives. `bsdf` is the storage of its BSDF; `None` leaves that out.
    #[inline]
    pub(super) fn new(
        world: &'a World,
        surface: SurfaceInteraction,
        (camera_ray, path, media): (u32, Path, Media),
        numbers: Numbers<'a>,
        bsdf: Option<&'a mut Bsdf>,
    ) -> Self {
        let material = &world.materials[surface.material as usize];
        // A bent normal that is turned away from the view has no local frame.
        let cosine = surface.shading_normal.dot(surface.view);
        let normal = if cosine > 0.0 { surface.shading_normal } else { surface.geometric_normal };
        let (tangent, bitangent) = normal.any_orthonormal_pair();
        let frame = [tangent, bitangent, normal];
        let crossing = Crossing::new(world, media, &surface);
        let throughput = path.throughput * crossing.transmittance(world, surface.hit.t);
        let path = Path { throughput, ..path };
        let view = to_local(&frame, surface.view);
        let bsdf = bsdf.filter(|_| view.z > 0.0).and_then(|bsdf| {
            match diffuse_albedo(material, &surface, &crossing) {
                Some(albedo) => bsdf.set_diffuse(albedo, view),
                None => bsdf.set(&parameters(material, &surface, &crossing)?, view),
            }
            Some(&*bsdf)
        });
        Vertex { world, surface, camera_ray, numbers, path, sides: crossing.sides, frame, bsdf }
    }

    /// The albedo and the shading normal, for denoisers.
    #[inline]
    pub(super) fn albedo_and_normal(&self) -> [[f32; 3]; 2] {
        let albedo = base_colour(self.world, &self.surface);
        [albedo, self.surface.shading_normal].map(|value| value.as_vec3().to_array())
    }

    /// The origin of a ray that leaves the surface in a direction.
    #[inline]
    pub(super) fn origin(&self, direction: DVec3) -> DVec3 {
        let (point, normal) = (self.surface.point, self.surface.geometric_normal);
        if direction.dot(normal) > 0.0 {
            point.origin_towards(normal, self.world.numerics())
        } else {
            self.world.origin_below(&self.surface, direction)
        }
    }

    /// The media on the side of a direction.
    #[inline]
    pub(super) fn media_towards(&self, direction: DVec3) -> Media {
        self.sides[usize::from(direction.dot(self.surface.geometric_normal) <= 0.0)]
    }
}

/// A world direction in a frame.
#[inline]
pub(super) fn to_local([tangent, bitangent, normal]: &[DVec3; 3], v: DVec3) -> DVec3 {
    DVec3::new(v.dot(*tangent), v.dot(*bitangent), v.dot(*normal))
}
