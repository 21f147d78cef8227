//! The default look: light, ground, background and sampling for files that say nothing of them.
//!
//! A key light with soft shadows comes from the left of the camera ([`crate::world::key_light`]). Fill light, brighter
//! from above, has no shadows but ambient occlusion. Under a camera that is not the file's there is a ground, and a
//! background in the colour of the ground where nothing shades it, so that no horizon is seen.

use std::sync::Arc;

use glam::DVec3;

use super::{EnvironmentSettings, RenderSettings};
use crate::error::Warnings;
use crate::film::colour::srgb_encode;
use crate::film::tone::ToneMap;
use crate::film::{Colour, ColourPipeline};
use crate::scene::{
    Environment, EnvironmentImage, EnvironmentSource, Fill, Ground, Noise, PictureSettings, Samples, Scene,
    Transport,
};
use crate::world::KEY_IRRADIANCE;

/// The fill light. A white surface that faces up reflects 0.41 of it, one that faces sideways 0.3.
const FILL: Fill = Fill { above: 0.46, below: 0.14 };

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

/// Rows of the fill light as an image for path tracing.
const ROWS: u32 = 64;

/// Completes a scene by the default look: [`RenderSettings::look`].
pub(super) fn complete(scene: &mut Scene, settings: &RenderSettings, warnings: &mut Warnings) {
    if scene.has_settings {
        return;
    }
    let most = match scene.transport() {
        Transport::Path => PATH_SAMPLES,
        Transport::Whitted => SAMPLES,
    };
    let sampled = PictureSettings {
        noise: Some(Noise::clamped(NOISE)),
        samples: Some(Samples::clamped(most)),
        ..PictureSettings::default()
    };
    scene.picture = scene.picture.or_look(sampled);
    let PictureSettings { shading, transport, light, ground, background, .. } = scene.picture;
    let is_chosen = settings.environment != EnvironmentSettings::default()
        || light.is_some()
        || ground.is_some()
        || background.is_some();
    if is_chosen {
        scene.ambient = Some(0.0);
        return;
    }
    if !scene.lights.is_empty() || !shading.unwrap_or_default().uses_lights() {
        return;
    }
    let pipeline = scene.picture.pipeline();
    scene.ambient = Some(0.0);
    scene.has_key_light = true;
    if pipeline == ColourPipeline::Linear {
        scene.picture.tone_map = scene.picture.tone_map.or(Some(ToneMap::PbrNeutral));
    }
    if transport.is_some_and(Transport::traces_paths) {
        scene.environment = Some(environment_of(FILL));
    } else {
        scene.fill = Some(FILL);
    }
    if settings.camera.is_of_file(scene) {
        if pipeline == ColourPipeline::Linear {
            scene.background = scene.background.or(Some(Colour::Linear(DARK_BACKGROUND)));
        }
        warnings
            .note("no light in the files: a key light and fill light are added; --draft adds a headlight");
        return;
    }
    scene.ground = scene.bounds().and_then(Ground::under).map(|g| Ground { albedo: GROUND_ALBEDO, ..g });
    scene.background = Some(background_colour(pipeline));
    warnings.note("no light in the files: light, ground and background are added; --draft adds a headlight");
}

/// The colour of the ground where nothing shades it.
fn background_colour(pipeline: ColourPipeline) -> Colour {
    let light = KEY_IRRADIANCE + FILL.diffuse(DVec3::Y);
    match pipeline {
        ColourPipeline::Linear => Colour::Linear(DVec3::splat(GROUND_ALBEDO * light)),
        _ => Colour::Display(DVec3::splat(srgb_encode(GROUND_ALBEDO) * light)),
    }
}

/// Fill light as an environment that the camera does not see.
fn environment_of(fill: Fill) -> Environment {
    let height = |row: u32| (std::f64::consts::PI * (f64::from(row) + 0.5) / f64::from(ROWS)).cos();
    let pixels = (0..ROWS).map(|row| [fill.radiance(DVec3::Y * height(row)) as f32; 3]).collect();
    let image = EnvironmentImage { name: "fill light".into(), width: 1, height: ROWS, pixels };
    let source = EnvironmentSource::Image(Arc::new(image));
    Environment { source, rotation: 0.0, intensity: 1.0, is_hidden: true }
}

#[cfg(test)]
mod tests {
    use super::super::CameraChoice;
    use super::*;
    use crate::film::tone::DisplayTransform;
    use crate::geometry::Sphere;
    use crate::scene::{Background, Camera, Headlight, Light, MaterialId, Object, Shape};
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
        let settings = RenderSettings { look: super::super::Look::Studio, ..settings.clone() };
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

    /// Each of the settings that choose a part leaves out the others, and constant ambient light.
    #[test]
    fn a_choice_turns_the_rest_off() {
        let none = PictureSettings::default;
        let sky = EnvironmentSettings { environment: Some("sky".into()), ..EnvironmentSettings::default() };
        for settings in [
            RenderSettings { environment: sky, ..RenderSettings::default() },
            PictureSettings { light: Some(Headlight::Head), ..none() }.into(),
            PictureSettings { ground: Some(true), ..none() }.into(),
            PictureSettings { background: Some(Background::Transparent), ..none() }.into(),
        ] {
            let scene = completed(ball(), &settings);
            assert_eq!(
                (parts(&scene), scene.ambient),
                ([false, false, false, true], Some(0.0)),
                "{settings:?}"
            );
        }
        let sampled = PictureSettings { samples: Some(Samples::clamped(3)), ..none() };
        let scene = completed(ball(), &sampled.into());
        assert_eq!(parts(&scene), [true, true, true, false]);
    }

    /// Displayed by the tone map, the dark background is that of other scenes.
    #[test]
    fn the_dark_background_is_displayed_as_without_a_tone_map() {
        let shown = DisplayTransform::new(0.0, ToneMap::PbrNeutral);
        assert_eq!(shown.encode(ColourPipeline::Linear, DARK_BACKGROUND.as_vec3().to_array()), [32, 34, 38]);
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
        assert!((irradiance - FILL.diffuse(DVec3::Y)).abs() < 1e-3, "{irradiance}");
    }
}
