//! glTF's metallic-roughness material: Lambert and GGX (glTF 2.0, appendix B), with KHR_materials_ior and
//! KHR_materials_specular, and KHR_materials_anisotropy for the reflection of lights.
//!
//! A light of intensity 1 shows a diffuse surface that faces it in its base colour, so every term is pi times the BSDF
//! of the specification. Ambient light is constant over the sphere; its reflection is approximated by the diffuse
//! colour plus the reflectance at normal incidence, and times the occlusion texture, which attenuates no other light
//! (glTF 2.0, section 3.9.3). Fill light is reflected by the albedo of the lobe.

use std::f64::consts::PI;

use glam::DVec3;

use super::bsdf::{AnisotropicGgx, Ggx, GgxAlbedo, reflectances};
use super::{LightSample, ShadingMode};
use crate::scene::{Layers, MetallicRoughness, TextureSlot};
use crate::world::{PreparedFill, SurfaceInteraction, World};

/// The lower limit of the roughness, since a perfect mirror reflects point lights in no pixel. It gives a highlight of about one
/// degree.
const MIN_ROUGHNESS: f64 = 0.045;

/// The colour of a surface with the given texels under the given lights. Calls `note` with the name, the light and the
/// value of each term.
pub(crate) fn shade(
    world: &World,
    material: &MetallicRoughness<DVec3>,
    mode: ShadingMode,
    surface: &SurfaceInteraction,
    texel: impl Fn(TextureSlot) -> DVec3,
    lights: &[LightSample],
    mut note: impl FnMut(&'static str, Option<usize>, DVec3),
) -> DVec3 {
    let base = material.base_colour * surface.tint * texel(TextureSlot::BaseColour);
    if material.unlit {
        note("L_e", None, base);
        return world.pipeline.clamp(base);
    }
    let texel_of_both = texel(TextureSlot::MetallicRoughness);
    let (metallic, roughness) = (material.metallic * texel_of_both.z, material.roughness * texel_of_both.y);
    let layers = &material.layers;
    let specular_weight = layers.specular * texel(TextureSlot::Specular).x;
    let specular_colour = layers.specular_colour * texel(TextureSlot::SpecularColour);
    let [f0, f90] = reflectances(layers.ior, specular_weight, specular_colour);
    let diffuse = base * (1.0 - metallic) * (1.0 - f0.max_element());
    let [f0, f90] = [f0.lerp(base, metallic), f90.lerp(DVec3::ONE, metallic)];
    let emission = material.emission * texel(TextureSlot::Emission);
    let unoccluded = 1.0 + material.textures.occlusion_strength * (texel(TextureSlot::Occlusion).x - 1.0);
    let mut ambient = world.ambient * (diffuse + f0);
    if let Some(fill) = &world.fill {
        ambient += diffuse * fill.diffuse(surface.shading_normal.y);
        ambient += reflected_fill(fill, surface, [f0, f90], roughness);
    }
    let ambient = surface.ambient * unoccluded * ambient;
    let mut sum = emission + ambient;
    note("L_e", None, emission);
    note("L_a", None, ambient);
    let strength = layers.anisotropy * texel(TextureSlot::Anisotropy).z;
    let along = (strength > 0.0).then(|| rougher_direction(world, layers, surface, &texel)).flatten();
    let rough = roughness.max(MIN_ROUGHNESS);
    for (index, light) in lights.iter().enumerate() {
        let mut returned = diffuse;
        note("L_d", Some(index), diffuse * light.radiance * light.cosine);
        if mode == ShadingMode::Full {
            let highlight = match along {
                None => specular(surface, light, [f0, f90], rough),
                Some(along) => {
                    let ggx = AnisotropicGgx::new(rough, strength);
                    anisotropic_specular(surface, light, [f0, f90], (ggx, along))
                }
            };
            note("L_s", Some(index), highlight * light.radiance * light.cosine);
            returned += highlight;
        }
        sum += returned * light.radiance * light.cosine;
    }
    world.pipeline.clamp(sum)
}

/// The fill light that the GGX lobe reflects: the mean radiance around the lobe's dominant direction (Lagarde and de Rousiers,
/// Moving Frostbite to Physically Based Rendering, 2014, section 4.9.3) times the lobe's directional albedo.
fn reflected_fill(
    fill: &PreparedFill,
    surface: &SurfaceInteraction,
    [f0, f90]: [DVec3; 2],
    roughness: f64,
) -> DVec3 {
    let (normal, view) = (surface.shading_normal, surface.view);
    let ggx = Ggx::new(roughness.max(MIN_ROUGHNESS));
    let cosine = normal.dot(view).clamp(0.0, 1.0);
    let smoothness = 1.0 - ggx.alpha();
    let mirrored = 2.0 * normal.dot(view) * normal - view;
    let towards = normal.lerp(mirrored, smoothness * (smoothness.sqrt() + ggx.alpha())).normalize_or(normal);
    GgxAlbedo::new(ggx, cosine).of(f0, f90) * fill.reflected(towards.y, ggx.alpha())
}

/// [`World::rougher_direction`] of a surface.
fn rougher_direction(
    world: &World,
    layers: &Layers<DVec3>,
    surface: &SurfaceInteraction,
    texel: impl Fn(TextureSlot) -> DVec3,
) -> Option<DVec3> {
    let is_back = surface.is_turned != world.objects[surface.object as usize].is_mirrored;
    let (at, texel) = ((surface.object, &surface.hit), texel(TextureSlot::Anisotropy));
    world.rougher_direction(at, is_back, surface.shading_normal, texel, layers.anisotropy_rotation)
}

/// [`specular`] of a surface that is rougher `along` a tangent (KHR_materials_anisotropy).
fn anisotropic_specular(
    surface: &SurfaceInteraction,
    light: &LightSample,
    [f0, f90]: [DVec3; 2],
    (ggx, along): (AnisotropicGgx, DVec3),
) -> DVec3 {
    let normal = surface.shading_normal;
    let local = |v: DVec3| DVec3::new(v.dot(along), v.dot(normal.cross(along)), v.dot(normal));
    let (view, to_light) = (local(surface.view), local(light.direction).with_z(light.cosine));
    let view = view.with_z(view.z.abs().max(f64::MIN_POSITIVE));
    let Some((scattered, _, v_h)) = ggx.reflection(view, to_light) else { return DVec3::ZERO };
    PI * scattered / light.cosine * (f0 + (f90 - f0) * (1.0 - v_h).powi(5))
}

/// pi times the product of the GGX distribution, Smith's height-correlated visibility (Heitz, Understanding the Masking-Shadowing
/// Function in Microfacet-Based BRDFs, JCGT 3(2), 2014) and Schlick's Fresnel approximation.
fn specular(
    surface: &SurfaceInteraction,
    light: &LightSample,
    [f0, f90]: [DVec3; 2],
    roughness: f64,
) -> DVec3 {
    let n = surface.shading_normal;
    // Where the light is exactly opposite to the view there is no half vector, and no highlight.
    let Some(half) = (light.direction + surface.view).try_normalize() else { return DVec3::ZERO };
    let n_v = n.dot(surface.view).abs().max(f64::MIN_POSITIVE);
    let (n_l, n_h) = (light.cosine, n.dot(half).clamp(0.0, 1.0));
    let v_h = surface.view.dot(half).clamp(0.0, 1.0);
    let a2 = roughness.powi(4);
    let denominator = n_h * n_h * (a2 - 1.0) + 1.0;
    let distribution = a2 / (PI * denominator * denominator);
    let smith = |x: f64, y: f64| x * (y * y * (1.0 - a2) + a2).sqrt();
    let visibility = 0.5 / (smith(n_l, n_v) + smith(n_v, n_l));
    let fresnel = f0 + (f90 - f0) * (1.0 - v_h).powi(5);
    PI * distribution * visibility * fresnel
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bvh::{Hit, PrimId, SlotId};

    fn surface(view: DVec3) -> SurfaceInteraction {
        let hit = Hit { t: 1.0, prim: PrimId(0), slot: SlotId::new(0), barycentrics: [0.0; 2] };
        let [geometric_normal, shading_normal] = [DVec3::Y; 2];
        SurfaceInteraction { geometric_normal, shading_normal, ..SurfaceInteraction::facing(view, hit, 0, 0) }
    }

    /// Normal incidence at roughness 1: D = 1 / pi, V = 0.5 / (1 + 1), F = F0, so pi D V F = F0 / 4.
    #[test]
    fn head_on_by_hand() {
        let light = LightSample { direction: DVec3::Y, distance: 1.0, radiance: DVec3::ONE, cosine: 1.0 };
        let returned = specular(&surface(DVec3::Y), &light, [DVec3::splat(0.5), DVec3::ONE], 1.0);
        assert!((returned - DVec3::splat(0.125)).abs().max_element() < 1e-15);
    }

    /// Without strength the highlight is that of isotropic surfaces, up to rounding, in any direction along the surface.
    #[test]
    fn anisotropy_without_strength_is_isotropic() {
        for (angle, roughness) in [(0.1f64, 0.2f64), (0.7, 0.5), (1.2, 1.0)] {
            let direction = DVec3::new(0.48, 0.8, -0.36);
            let light = LightSample { direction, distance: 1.0, radiance: DVec3::ONE, cosine: direction.y };
            let surface = surface(DVec3::new(angle.sin(), angle.cos(), 0.0));
            let factors = [DVec3::new(0.2, 0.5, 0.9), DVec3::ONE];
            let along = (AnisotropicGgx::new(roughness, 0.0), DVec3::new(0.6, 0.0, 0.8));
            let found = anisotropic_specular(&surface, &light, factors, along);
            let expected = specular(&surface, &light, factors, roughness);
            assert!(
                (found - expected).abs().max_element() < 1e-12 * expected.max_element(),
                "{found} {expected}"
            );
        }
    }

    /// White furnace test: a metal with F0 = 1 has an albedo of at most 1 for every roughness and view. The integral over the
    /// hemisphere is computed by the midpoint rule.
    #[test]
    fn no_light_is_made() {
        for roughness in [0.2f64, 0.5, 1.0] {
            for view_angle in [0.0f64, 0.7, 1.3] {
                let view = DVec3::new(view_angle.sin(), view_angle.cos(), 0.0);
                let (steps, mut sum) = (400, 0.0);
                for i in 0..steps {
                    for j in 0..steps {
                        let cosine: f64 = (f64::from(i) + 0.5) / f64::from(steps);
                        let phi = (f64::from(j) + 0.5) / f64::from(steps) * 2.0 * PI;
                        let sine = (1.0 - cosine * cosine).sqrt();
                        let direction = DVec3::new(sine * phi.cos(), cosine, sine * phi.sin());
                        let light = LightSample { direction, distance: 1.0, radiance: DVec3::ONE, cosine };
                        sum += specular(&surface(view), &light, [DVec3::ONE; 2], roughness).x * cosine;
                    }
                }
                // The mean over the hemisphere times 2 pi, over the pi that `specular` contains.
                let albedo = sum / f64::from(steps * steps) * 2.0;
                assert!(albedo < 1.005 && albedo > 0.3, "roughness {roughness}, view {view_angle}: {albedo}");
            }
        }
    }
}
