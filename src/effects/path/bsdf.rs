//! The BSDF of a path vertex: its parameters, and its evaluation for a world direction.

use glam::DVec3;

use super::media::Crossing;
use super::vertex::{Vertex, to_local};
use crate::scene::{Material, Phong};
use crate::shading::bsdf::{Bsdf, BsdfParameters};
use crate::world::{PreparedMaterial, SurfaceInteraction};

impl Vertex<'_> {
    /// The value of the BSDF times the cosine, and its density, for a world direction. 0 where shading and geometric
    /// normal disagree on the side.
    #[inline]
    pub(super) fn eval(&self, bsdf: &Bsdf, direction: DVec3) -> (DVec3, f64) {
        let local = to_local(&self.frame, direction);
        if (local.z > 0.0) != (direction.dot(self.surface.geometric_normal) > 0.0) {
            return (DVec3::ZERO, 0.0);
        }
        bsdf.eval_pdf(local)
    }
}

/// The albedo of a surface that is Lambert's alone, whose parameters need not be prepared; `None` for others.
#[inline]
pub(super) fn diffuse_albedo(
    material: &PreparedMaterial,
    surface: &SurfaceInteraction,
    crossing: &Crossing,
) -> Option<DVec3> {
    match material {
        Material::Phong(m) if m.specular <= 0.0 && m.refraction.is_none() && !crossing.is_hidden => {
            Some(phong_albedo(m, surface))
        }
        _ => None,
    }
}

fn phong_albedo(m: &Phong<DVec3>, surface: &SurfaceInteraction) -> DVec3 {
    unit(m.colour * surface.tint * surface.texels.colour * m.diffuse)
}

fn unit(colour: DVec3) -> DVec3 {
    colour.clamp(DVec3::ZERO, DVec3::ONE)
}

/// The parameters of the BSDF, `None` where nothing is scattered.
#[inline]
pub(super) fn parameters(
    material: &PreparedMaterial,
    surface: &SurfaceInteraction,
    crossing: &Crossing,
) -> Option<BsdfParameters> {
    if crossing.is_hidden {
        return Some(BsdfParameters {
            ior: 1.0,
            metallic: 0.0,
            transmission: 1.0,
            ..BsdfParameters::default()
        });
    }
    let texels = &surface.further_texels;
    let from_inside = crossing.from_inside;
    let parameters = match material {
        Material::MetallicRoughness(m) if m.unlit => return None,
        Material::MetallicRoughness(m) => BsdfParameters {
            base_colour: unit(m.base_colour * surface.tint * surface.texels.colour),
            metallic: (m.metallic * surface.texels.metallic).clamp(0.0, 1.0),
            roughness: (m.roughness * surface.texels.roughness).clamp(0.0, 1.0),
            ior: m.layers.ior,
            specular: m.layers.specular * texels.specular,
            specular_colour: m.layers.specular_colour * texels.specular_colour,
            transmission: m.layers.transmission * texels.transmission,
            thin_walled: m.layers.volume.is_none(),
            from_inside,
            clearcoat: m.layers.clearcoat * texels.clearcoat,
            clearcoat_roughness: m.layers.clearcoat_roughness * texels.clearcoat_roughness,
            sheen_colour: m.layers.sheen_colour * texels.sheen_colour,
            sheen_roughness: m.layers.sheen_roughness * texels.sheen_roughness,
        },
        Material::Phong(Phong { refraction: Some(glass), .. }) => BsdfParameters {
            base_colour: unit(glass.filter),
            metallic: 0.0,
            roughness: 0.0,
            ior: glass.ior,
            transmission: 1.0,
            from_inside,
            ..BsdfParameters::default()
        },
        // Blinn's exponent as a width of GGX (Walter and others, Microfacet Models for Refraction, 2007, section 5.2):
        // alpha^2 = 2 / (n + 2). Without a highlight there is no specular layer.
        Material::Phong(m) => BsdfParameters {
            base_colour: phong_albedo(m, surface),
            metallic: 0.0,
            roughness: (2.0 / (m.shininess + 2.0)).sqrt().sqrt().clamp(0.0, 1.0),
            specular: m.specular.clamp(0.0, 1.0),
            ..BsdfParameters::default()
        },
    };
    Some(BsdfParameters { ior: parameters.ior / crossing.ior_around, ..parameters })
}
