//! Warnings and notes about a picture, before and after it is rendered.

use crate::effects::tile::{NOISY_LEVELS, PathCount};
use crate::effects::{Plan, named};
use crate::error::Warnings;
use crate::job::RenderJob;
use crate::job::messages::back_faces;
use crate::render::Statistics;
use crate::scene::{AddedLight, Camera, Light, Material, MetallicRoughness, Scene, ShadingMode};
use crate::world::{PreparedMaterial, Recentering, has_radiance, headlight, key_light};

/// Warns of lights that have an area and no radiance, because their extent is too small or too large or they have no
/// direction.
pub(crate) fn warn_of_dark_lights(scene: &Scene, warnings: &mut Warnings) {
    for light in scene.lights.iter().filter(|light| !has_radiance(light)) {
        warnings.left_out(format!(
            "light `{}` is too small or too large, or has no direction; left out",
            light.name
        ));
    }
}

impl AddedLight {
    /// The light for a camera.
    pub(crate) fn at(self, camera: &Camera) -> Option<Light> {
        match self {
            AddedLight::Headlight => headlight(camera),
            AddedLight::Key => Some(key_light(camera)),
        }
    }

    /// Reports a headlight; the default look is reported where it is decided.
    pub(crate) fn note(self, warnings: &mut Warnings) {
        if self == AddedLight::Headlight {
            warnings.note(HEADLIGHT);
        }
    }
}

/// Note for a scene without lights.
pub const HEADLIGHT: &str = "no light in the scene; added a headlight";

/// The exposure in EV from which on an environment is noted as dark: white is then displayed as light of 1/8.
const DARK_ENVIRONMENT: f64 = -3.0;

/// Notes a chosen environment that lights of the files, in candela or lux, outshine.
pub(crate) fn note_dark_environment(job: &RenderJob, ev: f64, warnings: &mut Warnings) {
    let chosen = &job.settings.environment;
    let is_chosen = chosen.environment.is_some() && chosen.environment_intensity.is_none();
    if is_chosen && ev <= DARK_ENVIRONMENT && !job.world.lights.is_empty() {
        let factor = (-ev).exp2().round();
        warnings.note(format!(
            "the lights of the files are in candela or lux and outshine the environment; \
             --environment-intensity {factor} shows its white as white"
        ));
    }
}

/// Adds a note on the recentering of a scene.
pub(crate) fn warn_of_recentering(recentering: Option<&Recentering>, warnings: &mut Warnings) {
    if let Some(recentering) = recentering {
        warnings.note(match recentering.scale {
            1.0 => "the scene is far from the origin; moved to it for precision",
            _ => "the scene is too large or too small for f32; scaled by a power of two",
        });
    }
}

/// Notes about a rendered picture: paths that limits cut, and noise.
pub fn notes_of_result(job: &RenderJob, statistics: &Statistics) -> impl Iterator<Item = String> + use<> {
    note_of_cut_paths(&job.plan, statistics).into_iter().chain(note_of_noise(job, statistics))
}

/// The share of cut paths from which a note says so. Paths that survive Russian roulette have a throughput near 1, so the
/// light left out is about this share times the radiance that cut paths would find, mostly below that of the picture.
const NOTED_CUT_SHARE: f64 = 0.05;

/// Note about paths that a limit on bounces cut while they could still carry light.
fn note_of_cut_paths(plan: &Plan, statistics: &Statistics) -> Option<String> {
    let PathCount { traced, cut } = statistics.paths;
    let (share, limits) = (cut as f64 / traced as f64, plan.bounce_limits());
    (share > NOTED_CUT_SHARE).then(|| {
        format!(
            "the limit of {limits} cuts {:.0} % of the paths, which may carry more light; try {}; \
             `kiln explain --measure` measures the light left out",
            100.0 * share,
            limits.doubled().options()
        )
    })
}

/// The share of noisy pixels from which a note says so. Default pictures of meshes have up to 0.01, a fifth of which is
/// off by that much: the variance of single samples is above that of stratified ones at edges.
const NOTED_NOISY_SHARE: f64 = 0.05;

/// Note about pixels with far more noise than the threshold.
fn note_of_noise(job: &RenderJob, statistics: &Statistics) -> Option<String> {
    let (count, pixels) = (statistics.noisy_pixels as f64, job.window.area() as f64);
    let error = NOISY_LEVELS * job.plan.sampling.noise?;
    (count > NOTED_NOISY_SHARE * pixels).then(|| {
        format!(
            "{:.0} % of the pixels have a standard error above {error:.3}, {NOISY_LEVELS} times --noise; \
             raise --samples",
            100.0 * count / pixels
        )
    })
}

/// Whether a material has layers that local shading leaves out.
fn needs_path(material: &PreparedMaterial) -> bool {
    match material {
        Material::Phong(m) => m.refraction.is_some(),
        Material::MetallicRoughness(m) if m.unlit => false,
        Material::MetallicRoughness(MetallicRoughness { layers, .. }) => {
            layers.transmission > 0.0 || layers.has_extra_lobes()
        }
    }
}

/// Whether a material has a glaze that adds light.
fn has_glaze(material: &PreparedMaterial) -> bool {
    matches!(material, Material::Phong(m) if m.glaze.as_ref().is_some_and(|glaze| glaze.weight > 0.0))
}

/// Warns of omitted shapes, of area lights and a clamp without path tracing, and of requested effects that change
/// nothing.
pub(crate) fn warn_of_job(job: &RenderJob, warnings: &mut Warnings) {
    let RenderJob { world, plan, plan_settings, .. } = job;
    if world.too_small > 0 {
        warnings.left_out(format!(
            "{} analytic shape(s) have a radius that rounds to 0 in the tier `{}`; left out",
            world.too_small,
            world.numerics().name()
        ));
    }
    back_faces::report(job, warnings);
    let traces_paths = plan.transport.traces_paths();
    if traces_paths && !plan_settings.sampling.is_wanted() {
        warnings.note("path tracing with one sample per pixel is noisy; try --samples 64");
    }
    if let (false, Some(clamp)) = (traces_paths, plan_settings.clamp) {
        warnings.push(format!("a clamp of {clamp} changes nothing without path tracing"));
    }
    if let (false, Some(depth)) = (traces_paths, plan_settings.path.depth_specular) {
        warnings.push(format!("--depth-specular {depth} changes nothing without path tracing"));
    }
    if let (false, true, Some(name)) =
        (traces_paths, plan_settings.shading == ShadingMode::Full, world.area_lights.names.first())
    {
        warnings.left_out(format!("area lights such as `{name}` give no light without path tracing"));
    }
    if !traces_paths {
        let layered = world.materials_in_use().filter(|material| needs_path(material));
        if let Some(names) = named("material", layered.map(|material| material.name())) {
            warnings
                .note_left_out(format!("only --transport path draws glass, clear coat and sheen of {names}"));
        }
    }
    if traces_paths && plan_settings.shading == ShadingMode::Full {
        let glazed = world.materials_in_use().filter(|material| has_glaze(material));
        if let Some(names) = named("material", glazed.map(|material| material.name())) {
            warnings.left_out(format!(
                "the glaze of {names} is left out by path tracing; --transport whitted draws it"
            ));
        }
        if plan_settings.transport.is_some() && world.ambient > 0.0 {
            warnings.note_left_out(format!(
                "the ambient light of {} is left out by path tracing; use an environment instead",
                world.ambient
            ));
        }
    }
    for decision in plan.decisions.iter().filter(|decision| !decision.on) {
        if let Some(option) = plan_settings.option_of(decision.effect) {
            warnings.push(format!("{option} changes nothing: {}", decision.why));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The radiance of a rectangle is the intensity times pi over its area: beyond f64 where that underflows.
    #[test]
    fn lights_without_an_extent_are_named() {
        let light = |name: &str, size: f64, intensity: f64| crate::scene::Light {
            name: name.into(),
            colour: crate::film::Colour::Linear(glam::DVec3::ONE),
            intensity,
            kind: crate::scene::LightKind::Rectangle {
                position: glam::DVec3::ZERO,
                direction: glam::DVec3::Z,
                up: glam::DVec3::Y,
                size: [size; 2],
            },
        };
        let mut edge_on = light("edge-on", 1.0, 1.0);
        *edge_on.kind.direction_mut().expect("a rectangle has one") = glam::DVec3::ZERO;
        let lights =
            vec![light("lamp", 1.0, 1.0), light("speck", 1e-200, 1.0), light("off", 1e-200, 0.0), edge_on];
        let mut warnings = Warnings::default();
        warn_of_dark_lights(&Scene { lights, ..Scene::default() }, &mut warnings);
        let [speck, edge_on] = warnings.messages() else { panic!("{:?}", warnings.messages()) };
        assert!(speck.contains("`speck`") && edge_on.contains("`edge-on`"), "{speck}, {edge_on}");
    }
}
