//! The default look: light, ground, background and sampling for files that say nothing of them.
//!
//! A key light with soft shadows comes from the left of the camera ([`crate::world::key_light`]). Fill light, brighter
//! from above, has no shadows but ambient occlusion. Under a camera that is not the file's there is a ground, and a
//! background in the colour of the ground where nothing shades it, so that no horizon is seen.

use std::sync::Arc;

use glam::DVec3;

use super::{RenderSettings, path_calls};
use crate::effects::{id, named};
use crate::error::Warnings;
use crate::film::colour::srgb_encode;
use crate::film::tone::{DisplayTransform, Exposure, ToneMap};
use crate::film::{Colour, ColourPipeline};
use crate::scene::{
    Background, Clamp, Environment, EnvironmentImage, EnvironmentSource, Fill, FillZone, Ground, Look, Noise,
    OptionValue, PictureSettings, Samples, Scene, Transport,
};
use crate::world::KEY_IRRADIANCE;

/// The fill light: a floor, a dark wall with a ring of lights, and a softbox overhead, so that metals have edges to reflect. A
/// white surface that faces up reflects 0.38 of it, one that faces sideways 0.37.
const FILL: Fill = {
    const fn zone(from: f64, radiance: f64) -> FillZone {
        FillZone { from, radiance }
    }
    Fill { zones: [zone(-1.0, 0.45), zone(-0.05, 0.1), zone(0.2, 0.6), zone(0.45, 0.1), zone(0.75, 0.55)] }
};

/// The vertical field of view of automatic cameras, in degrees.
pub(super) const FIELD_OF_VIEW: f64 = 30.0;

/// The albedo of the ground.
const GROUND_ALBEDO: f64 = 0.86;

/// Linear light that the tone map displays as the dark background of other scenes, #202226: the smallest channel x
/// is displayed as x^2 / 0.16, the others by as much less as it.
const DARK_BACKGROUND: DVec3 = DVec3::new(0.048_072, 0.049_622, 0.053_014);

/// Standard error of displayed values at which pixels are sampled no further; the most samples, and those of paths.
const NOISE: f64 = 0.025;
const SAMPLES: u32 = 16;
pub(super) const PATH_SAMPLES: u32 = 64;

/// The noise of paths that only the materials call for. Their indirect light is clamped to white.
const CALLED_NOISE: f64 = 0.055;

/// Rows of the fill light as an image for path tracing.
const ROWS: u32 = 512;

/// Completes a scene by the default look, each part on its own: sampling, light, tone map, ground and background.
pub(super) fn complete(scene: &mut Scene, settings: &RenderSettings, warnings: &mut Warnings) {
    if settings.look(scene) == Look::Draft {
        return;
    }
    let has_lamps = call_for_paths(scene, settings, warnings);
    let (noise, most) = match (scene.transport(), &scene.path_call) {
        (Transport::Path, Some(_)) => (CALLED_NOISE, PATH_SAMPLES),
        (Transport::Path, None) => (NOISE, PATH_SAMPLES),
        (Transport::Whitted, _) => (NOISE, SAMPLES),
    };
    let sampled = PictureSettings {
        noise: Some(Noise::clamped(noise)),
        samples: Some(Samples::clamped(most)),
        ..PictureSettings::default()
    };
    scene.picture = scene.picture.or_look(sampled);
    let PictureSettings { shading, light, ground, background, .. } = scene.picture;
    let is_lit = scene.lights.is_empty() && shading.unwrap_or_default().uses_lights();
    let pipeline = scene.picture.pipeline();
    let has_environment = scene.environment.is_some();
    scene.has_backdrop = background.is_some();
    scene.has_key_light = is_lit && !has_lamps && light.is_none() && !has_environment;
    if is_lit {
        scene.ambient = scene.ambient.or(Some(0.0));
    }
    let is_bright = has_lamps || scene.has_physical_lights;
    if pipeline == ColourPipeline::Linear && (is_lit || is_bright) {
        if scene.picture.tone_map.is_none() {
            scene.picture.tone_map = Some(tone_map(background, warnings));
        }
        if is_bright {
            scene.picture.exposure = scene.picture.exposure.or(Some(Exposure::Auto));
        }
    }
    // A metered exposure is not known yet.
    let ev = match scene.picture.exposure {
        Some(Exposure::Ev(ev)) => Some(ev),
        Some(Exposure::Auto) => None,
        None => Some(0.0),
    };
    if scene.path_call.is_some() && pipeline == ColourPipeline::Linear {
        scene.picture.clamp = scene.picture.clamp.or(ev.map(white_clamp));
    }
    if scene.has_key_light {
        if scene.transport().traces_paths() {
            scene.environment = Some(environment_of(FILL));
        } else {
            scene.fill = Some(FILL);
        }
    }
    let is_of_file = settings.camera.is_of_file(scene);
    // A visible environment has a horizon of its own.
    let is_open = scene.environment.as_ref().is_none_or(|environment| environment.is_hidden);
    let has_studio = is_lit && !has_lamps && !is_of_file && is_open;
    if ground.unwrap_or(has_studio) {
        let look =
            Ground { albedo: GROUND_ALBEDO, is_hidden_from_below: ground.is_none(), ..Ground::default() };
        scene.ground = scene.bounds().and_then(|bounds| look.under(bounds));
        scene.picture.ground = ground.or(scene.ground.map(|_| true));
    }
    if has_studio || is_lit && scene.ground.is_some() {
        scene.background = Some(background_colour(pipeline));
    } else if background.is_none() && is_bright && is_open && scene.ground.is_none() {
        // Not light, so that no exposure changes it.
        scene.has_backdrop = true;
    } else if is_lit && pipeline == ColourPipeline::Linear {
        scene.background = Some(Colour::Linear(DARK_BACKGROUND));
    }
    let added = [
        (scene.has_key_light, "light"),
        (ground.is_none() && scene.ground.is_some(), "ground"),
        (has_studio && background.is_none(), "background"),
    ];
    let added: Vec<&str> = added.iter().filter(|(is_added, _)| *is_added).map(|(_, name)| *name).collect();
    if let Some((last, before)) = added.split_last() {
        let camera = if is_of_file { "" } else { " and no camera" };
        let (before, verb) = match before {
            [] => (String::new(), "is"),
            _ => (format!("{} and ", before.join(", ")), "are"),
        };
        warnings.note(format!(
            "no light{camera} in the files: {before}{last} {verb} added; --draft adds a headlight"
        ));
    }
}

/// Without the default look: makes the background a backdrop, which bypasses exposure and tone map.
pub(super) fn keep_background(scene: &mut Scene, settings: &RenderSettings) {
    let is_changed =
        scene.picture.pipeline() == ColourPipeline::Linear && !scene.picture.display().is_identity();
    let is_seen = scene.environment.as_ref().is_none_or(|environment| environment.is_hidden);
    // Black is unchanged by exposure and tone map.
    let is_black =
        scene.background().is_some_and(|colour| colour.to_pipeline(ColourPipeline::Linear) == DVec3::ZERO);
    let is_shown = is_seen && !is_black && !scene.picture.is_transparent() && scene.ground.is_none();
    scene.has_backdrop |= settings.look(scene) == Look::Draft && is_changed && is_shown;
}

/// Finds out whether the materials of a scene call for path tracing, and notes that in the scene unless a transport is
/// chosen. Returns whether emissive surfaces light it.
fn call_for_paths(scene: &mut Scene, settings: &RenderSettings, warnings: &mut Warnings) -> bool {
    let can_trace = scene.picture.transport.is_none_or(Transport::traces_paths);
    let is_off = settings.without.iter().any(|name| name == id::PATH.name())
        || scene.effects.get(id::PATH.name()).is_some_and(|said| !said.is_on());
    if !can_trace || is_off || !scene.picture.shading.unwrap_or_default().uses_lights() {
        return false;
    }
    let lamps = path_calls::lighting(scene);
    let has_lamps = !lamps.is_empty();
    let emitting = named("emission of material", lamps);
    let transmitting = named("transmission of material", path_calls::transmitting(scene));
    if scene.picture.transport.is_none() {
        scene.path_call = emitting.or(transmitting);
    }
    if let Some(call) = &scene.path_call {
        warnings.note(format!("{call}: path tracing is on; --transport whitted turns it off"));
    }
    has_lamps
}

/// The clamp of paths that the materials call for: the light that an exposure shows as white, to 1/1000.
pub(super) fn white_clamp(ev: f64) -> Clamp {
    Clamp::clamped(1e-3 * (1e3 * (-ev).exp2()).round().max(1.0))
}

/// The tone map before a background: none where it cannot display that.
fn tone_map(background: Option<Background>, warnings: &mut Warnings) -> ToneMap {
    let shown = DisplayTransform::new(0.0, ToneMap::PbrNeutral);
    if let Some(background @ Background::Colour(colour)) = background {
        let light =
            shown.light_of(background.colour().to_pipeline(ColourPipeline::Linear)).unwrap_or_default();
        if shown.encode(ColourPipeline::Linear, light.as_vec3().to_array()) != colour.0 {
            warnings.note(format!(
                "the default tone map displays no colour as saturated as the background {}; left out",
                background.text()
            ));
            return ToneMap::None;
        }
    }
    ToneMap::PbrNeutral
}

/// What a white surface that faces up reflects of key and fill light.
pub(super) const LIGHT_FROM_ABOVE: f64 = KEY_IRRADIANCE + FILL.diffuse_up();

/// The colour of the ground where nothing shades it.
fn background_colour(pipeline: ColourPipeline) -> Colour {
    let light = LIGHT_FROM_ABOVE;
    match pipeline {
        ColourPipeline::Linear => Colour::Linear(DVec3::splat(GROUND_ALBEDO * light)),
        _ => Colour::Display(DVec3::splat(srgb_encode(GROUND_ALBEDO) * light)),
    }
}

/// Fill light as an environment that the camera does not see.
fn environment_of(fill: Fill) -> Environment {
    let height = |row: u32| (std::f64::consts::PI * f64::from(row) / f64::from(ROWS)).cos();
    let pixels = (0..ROWS).map(|row| [fill.mean_radiance(height(row + 1), height(row)) as f32; 3]).collect();
    let image = EnvironmentImage { name: "fill light".into(), width: 1, height: ROWS, pixels };
    let source = EnvironmentSource::Image(Arc::new(image));
    Environment { source, rotation: 0.0, intensity: 1.0, is_hidden: true }
}

#[cfg(test)]
mod tests {
    use super::super::CameraChoice;
    use super::*;
    use crate::geometry::Sphere;
    use crate::job::EnvironmentSettings;
    use crate::scene::{Camera, ColourValue, Headlight, Light, MaterialId, Object, Shape};
    use crate::world::headlight;

    fn ball() -> Scene {
        let shape = Shape::Analytic(Sphere { centre: DVec3::ZERO, radius: 1.0 }.into());
        let object = Object { name: "ball".into(), input: 0, material: MaterialId(0), shape };
        Scene { objects: vec![object], ..Scene::default() }
    }

    fn camera() -> Camera {
        Camera::from_field_of_view("c".into(), DVec3::Z * 5.0, DVec3::ZERO, DVec3::Y, 1.0)
    }

    fn completed(mut scene: Scene, settings: &RenderSettings) -> Scene {
        let settings = RenderSettings { mesh_look: Look::Studio, ..settings.clone() };
        scene.picture = settings.picture;
        complete(&mut scene, &settings, &mut Warnings::default());
        scene
    }

    /// Whether a scene has fill and key light, a ground, a background, and antialiasing.
    fn parts(scene: &Scene) -> [bool; 4] {
        let light = scene.fill.is_some() && scene.has_key_light;
        [light, scene.ground.is_some(), scene.background.is_some(), scene.picture.noise.is_some()]
    }

    #[test]
    fn files_get_what_they_do_not_have() {
        let none = RenderSettings::default();
        let light: Vec<Light> = headlight(&camera()).into_iter().collect();
        assert_eq!(parts(&completed(ball(), &none)), [true; 4]);
        // A file with a camera keeps the dark background.
        let with_camera = completed(Scene { cameras: vec![camera()], ..ball() }, &none);
        assert_eq!(parts(&with_camera), [true, false, true, true]);
        assert_eq!(with_camera.background, Some(Colour::Linear(DARK_BACKGROUND)));
        let fitted = RenderSettings {
            camera: CameraChoice::Fitted(crate::world::StandardView::Front),
            ..none.clone()
        };
        assert_eq!(parts(&completed(Scene { cameras: vec![camera()], ..ball() }, &fitted)), [true; 4]);
        assert_eq!(parts(&completed(Scene { lights: light, ..ball() }, &none)), [false, false, false, true]);
        assert_eq!(parts(&completed(Scene { has_settings: true, ..ball() }, &none)), [false; 4]);
    }

    /// Each of the settings that choose a part changes that part alone.
    #[test]
    fn parts_are_independent() {
        let none = PictureSettings::default;
        let parts_of = |settings: &RenderSettings| {
            let scene = completed(ball(), settings);
            assert_eq!((scene.ambient, scene.picture.tone_map), (Some(0.0), Some(ToneMap::PbrNeutral)));
            parts(&scene)
        };
        let environment = |hide: bool| EnvironmentSettings {
            environment: Some("sky".into()),
            hide_environment: Some(hide),
            ..EnvironmentSettings::default()
        };
        let lit_by =
            |hide: bool| RenderSettings { environment: environment(hide), ..RenderSettings::default() };
        // An environment that is seen is the background.
        let mut sky = ball();
        lit_by(false).environment.apply(&mut sky, &mut Warnings::default()).unwrap();
        assert_eq!(parts(&completed(sky, &lit_by(false)))[..2], [false; 2]);
        let mut hidden = ball();
        lit_by(true).environment.apply(&mut hidden, &mut Warnings::default()).unwrap();
        assert_eq!(parts(&completed(hidden, &lit_by(true))), [false, true, true, true]);
        for light in [Headlight::Head, Headlight::None] {
            let chosen = PictureSettings { light: Some(light), ..none() };
            assert_eq!(parts_of(&chosen.into()), [false, true, true, true]);
        }
        for (ground, has_ground) in [(true, true), (false, false)] {
            let chosen = PictureSettings { ground: Some(ground), ..none() };
            assert_eq!(parts_of(&chosen.into()), [true, has_ground, true, true]);
        }
        let chosen = PictureSettings { background: Some(Background::Transparent), ..none() };
        assert_eq!(parts_of(&chosen.into()), [true; 4]);
        let chosen = PictureSettings { samples: Some(Samples::clamped(3)), ..none() };
        assert_eq!(parts_of(&chosen.into()), [true, true, true, false]);
        // Under the camera of a file a ground brings its background.
        let ground = PictureSettings { ground: Some(true), ..none() };
        let with_camera = completed(Scene { cameras: vec![camera()], ..ball() }, &ground.into());
        assert_eq!(with_camera.background, Some(background_colour(ColourPipeline::Linear)));
    }

    /// A scene file has the look if it says so, a mesh unless `--draft` says otherwise.
    #[test]
    fn the_look_is_chosen() {
        let of = |has_settings, look: Option<Look>| {
            let picture = PictureSettings { look, ..PictureSettings::default() };
            let scene = Scene { has_settings, background: Some(Colour::from_u8([0; 3])), ..ball() };
            parts(&completed(scene, &picture.into()))[0]
        };
        assert_eq!(
            [None, Some(Look::Studio), Some(Look::Draft)].map(|look| of(true, look)),
            [false, true, false]
        );
        assert_eq!(
            [None, Some(Look::Studio), Some(Look::Draft)].map(|look| of(false, look)),
            [true, true, false]
        );
    }

    /// Displayed by the tone map, the dark background is that of other scenes.
    #[test]
    fn the_dark_background_is_displayed_as_without_a_tone_map() {
        let shown = DisplayTransform::new(0.0, ToneMap::PbrNeutral);
        assert_eq!(shown.encode(ColourPipeline::Linear, DARK_BACKGROUND.as_vec3().to_array()), [32, 34, 38]);
    }

    /// Greys and white are displayed as the background, as is what is not too saturated; red is not.
    #[test]
    fn a_background_that_the_tone_map_cannot_display_turns_it_off() {
        let of = |colour| tone_map(Some(Background::Colour(ColourValue(colour))), &mut Warnings::default());
        assert_eq!([[255; 3], [0; 3], [32, 34, 38], [70, 130, 180]].map(of), [ToneMap::PbrNeutral; 4]);
        assert_eq!([[255, 0, 0], [255, 128, 0]].map(of), [ToneMap::None; 2]);
    }

    /// Paths have the same fill light, as an environment: the irradiance of a surface that faces up, over pi.
    #[test]
    fn paths_have_the_fill_light() {
        let settings = PictureSettings { transport: Some(Transport::Path), ..Default::default() }.into();
        let scene = completed(ball(), &settings);
        assert!(
            scene.fill.is_none()
                && scene.has_key_light
                && scene.picture.sampling().samples == Some(PATH_SAMPLES)
        );
        let EnvironmentSource::Image(image) = scene.environment.unwrap().source else { panic!("an image") };
        let weight = |row: usize| {
            let [from, to] =
                [row, row + 1].map(|r| (std::f64::consts::PI * r as f64 / f64::from(ROWS)).sin());
            to * to - from * from
        };
        let upper = image.pixels.iter().enumerate().take(ROWS as usize / 2);
        let irradiance: f64 = upper.map(|(row, pixel)| weight(row) * f64::from(pixel[0])).sum();
        assert!((irradiance - FILL.diffuse_up()).abs() < 1e-3, "{irradiance}");
    }
}
