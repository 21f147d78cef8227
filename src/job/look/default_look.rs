//! The default look: light, ground, background and sampling for files without them.
//!
//! A key light with soft shadows comes from the left of the camera ([`crate::world::key_light`]). Fill light, brighter
//! from above, has no shadows but ambient occlusion. Under a camera that is not the file's there is a ground, and a
//! background in the colour of the ground where nothing shades it, so that no horizon is seen.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::DVec3;

use crate::effects::{id, named};
use crate::error::{Error, Result};
use crate::film::colour::srgb_encode;
use crate::film::tone::{DisplayTransform, Exposure, ToneMap};
use crate::film::{Colour, ColourPipeline};
use crate::job::RenderSettings;
use crate::job::look::path_calls;
use crate::scene::{
    AddedLight, Background, Clamp, DefaultLook, Environment, EnvironmentImage, EnvironmentSource, Fill,
    FillZone, Ground, Headlight, Look, Noise, OptionValue, PictureSettings, Samples, Scene, Transport,
};
use crate::world::KEY_IRRADIANCE;

/// The fill light: a floor, a dark wall with a ring of lights, and a softbox overhead, so that metals have edges to reflect. A
/// white surface that faces up reflects 0.38 of it, one that faces sideways 0.37.
const FILL: Fill = {
    const fn zone(from: f64, radiance: f64) -> FillZone {
        FillZone { from, radiance }
    }
    Fill {
        zones: [zone(-1.0, 0.45), zone(-0.05, 0.1), zone(0.2, 0.6), zone(0.45, 0.1), zone(0.75, 0.55)],
        is_exposed: false,
    }
};

/// The fill light beside lights of the files, in times of [`FILL`]: the metered exposure shows objects darker than the key
/// light does. White in the shade is displayed as 0.5.
const FILL_OF_LIGHTS: f64 = 0.7;

/// The vertical field of view of automatic cameras, in degrees.
pub(crate) const FIELD_OF_VIEW: f64 = 30.0;

/// The albedo of the ground.
const GROUND_ALBEDO: f64 = 0.86;

/// Linear light that the tone map displays as the dark background of other scenes, #202226: the smallest channel x
/// is displayed as x^2 / 0.16, the others by as much less as it.
const DARK_BACKGROUND: DVec3 = DVec3::new(0.048_072, 0.049_622, 0.053_014);

/// Standard error of displayed values at which pixels are sampled no further, and the most samples.
const NOISE: f64 = 0.025;
const SAMPLES: u32 = 16;

/// Those of paths. Where materials turn path tracing on, indirect light is clamped to white, and the noise threshold is
/// higher.
const CALLED_NOISE: f64 = 0.055;
pub(crate) const PATH_SAMPLES: u32 = 64;

/// Rows of the fill light as an image for path tracing.
const ROWS: u32 = 512;

/// Look of a scene in its own coordinates, at rest: settings of files and options, completed by defaults. `environment` is
/// that of the settings or of the scene.
///
/// # Errors
/// [`Error::Input`] for a ground that is asked for under a scene without objects.
pub(crate) fn default_look(
    scene: &Scene,
    settings: &RenderSettings,
    environment: Option<Environment>,
) -> Result<DefaultLook> {
    let picture = settings.picture.or(scene.picture);
    let given = DefaultLook { environment, ..DefaultLook::of_files(scene, picture) };
    let mut look = match settings.look(scene) {
        Look::Draft => DefaultLook { has_backdrop: keeps_background(&given), ..given },
        Look::Studio => studio(scene, settings, given),
    };
    look.light = look.light.or_else(|| needs_headlight(scene, &look).then_some(AddedLight::Headlight));
    if let Some(light) = settings.picture.light.filter(|_| !scene.lights.is_empty()) {
        let has_fill = settings.look(scene) == Look::Studio && is_lit_by_files(scene, &look);
        if light == Headlight::Head || !has_fill {
            look.notes.push(format!("--light {} changes nothing: the files have lights", light.name()));
        }
    }
    if look.picture.ground == Some(true) && look.ground.is_none() {
        look.ground = Some(asked_ground(scene)?);
    }
    Ok(look)
}

/// What the parts of the look depend on.
struct LookContext {
    pipeline: ColourPipeline,
    traces_paths: bool,
    /// Whether the materials call for path tracing.
    has_path_tracing_reason: bool,
    /// Whether the files have no lights, and the shading uses lights.
    lacks_lights: bool,
    /// [`is_lit_by_files`].
    is_lit_by_files: bool,
    /// Whether the exposure is metered: lights are lamps, a sky, or in physical units.
    is_bright: bool,
    /// Whether the camera was made for the files.
    is_of_file: bool,
    /// Whether camera rays see no environment.
    is_open: bool,
    /// Whether the scene gets the ground and the background of the look, unless settings say otherwise.
    adds_ground_and_background: bool,
}

/// The default look, each part on its own: transport, sampling, light, tone map, ground and background.
fn studio(scene: &Scene, settings: &RenderSettings, given: DefaultLook) -> DefaultLook {
    let (path_tracing_reason, has_lamps) = path_tracing(scene, settings, &given.picture);
    let mut look = DefaultLook { path_tracing_reason, ..given };
    let mut notes = Vec::new();
    if let Some(reason) = &look.path_tracing_reason {
        notes.push(format!("{reason}: path tracing is on; --transport whitted turns it off"));
    }
    let lacks_lights = scene.lights.is_empty() && look.picture.shading().uses_lights();
    let (is_of_file, is_open) = (settings.camera.is_of_file(scene), !look.shows_environment());
    let (pipeline, traces_paths) = (look.picture.pipeline(), look.transport(scene).traces_paths());
    let is_lit_by_files = is_lit_by_files(scene, &look);
    let has_sky = look.environment.as_ref().is_some_and(|own| own.source == EnvironmentSource::Sky);
    let is_added = (lacks_lights || is_lit_by_files) && !has_lamps && !is_of_file && is_open;
    let context = LookContext {
        pipeline,
        traces_paths,
        has_path_tracing_reason: look.path_tracing_reason.is_some(),
        lacks_lights,
        is_lit_by_files,
        is_bright: has_lamps || scene.has_physical_lights || has_sky && traces_paths,
        is_of_file,
        is_open,
        // A shape that stands and is flat has a dark background instead: lit from the front, it is as light as the ground.
        adds_ground_and_background: is_added && !scene.bounds().is_some_and(stands_flat),
    };
    let given = look.picture;
    look.picture = sampling(given, &context);
    look.picture = tone(look.picture, &context, &mut notes);
    if context.lacks_lights || is_lit_by_files {
        look.ambient = look.ambient.or(Some(0.0));
    }
    if is_lit_by_files && given.light.is_none() {
        look.fill = Some(Fill { is_exposed: true, ..FILL.scaled(FILL_OF_LIGHTS) });
    }
    if lacks_lights && !has_lamps && given.light.is_none() && look.environment.is_none() {
        look.light = Some(AddedLight::Key);
        match context.traces_paths {
            true => look.environment = Some(environment_of(FILL)),
            false => look.fill = Some(FILL),
        }
    }
    look.ground = ground(scene, given.ground, &context);
    if look.ground.is_some() {
        look.picture.ground = Some(true);
    }
    let (added, has_backdrop) = background(given.background, look.ground.is_some(), &context);
    look.background = added.or(look.background);
    look.has_backdrop = has_backdrop;
    match note_of_parts(&look, &given, &context) {
        Some(note) if is_lit_by_files => notes.push(note),
        note => look.usual_note = note,
    }
    DefaultLook { notes, ..look }
}

/// The depth of a flat shape in sizes of its bounds, at most: rounding of f32 coordinates.
const FLAT: f64 = 1e-6;

/// Whether bounds are those of a flat shape that stands.
fn stands_flat((min, max): (DVec3, DVec3)) -> bool {
    let size = max - min;
    size.x.min(size.z) <= FLAT * size.max_element() && size.y > FLAT * size.max_element()
}

/// Whether local shading is lit by lights of the files in physical units, whose exposure is metered.
fn is_lit_by_files(scene: &Scene, look: &DefaultLook) -> bool {
    scene.has_physical_lights
        && !scene.lights.is_empty()
        && look.picture.shading().uses_lights()
        && look.picture.pipeline() == ColourPipeline::Linear
        && !look.transport(scene).traces_paths()
}

/// The sampling of a picture whose settings say nothing of it.
fn sampling(picture: PictureSettings, context: &LookContext) -> PictureSettings {
    let (noise, most) = match (context.traces_paths, context.has_path_tracing_reason) {
        (true, true) => (CALLED_NOISE, PATH_SAMPLES),
        (true, false) => (NOISE, PATH_SAMPLES),
        (false, _) => (NOISE, SAMPLES),
    };
    picture.or_look(PictureSettings {
        noise: Some(Noise::clamped(noise)),
        samples: Some(Samples::clamped(most)),
        ..PictureSettings::default()
    })
}

/// Tone map, exposure and clamp.
fn tone(picture: PictureSettings, context: &LookContext, notes: &mut Vec<String>) -> PictureSettings {
    let PictureSettings { mut tone_map, mut exposure, mut clamp, .. } = picture;
    if context.pipeline != ColourPipeline::Linear {
        return picture;
    }
    if context.lacks_lights || context.is_bright {
        tone_map = tone_map.or_else(|| Some(tone_map_before(picture.background, notes)));
    }
    if context.is_bright {
        exposure = exposure.or(Some(Exposure::Auto));
    }
    if context.has_path_tracing_reason {
        clamp = clamp.or(match exposure {
            Some(Exposure::Ev(ev)) => Some(white_clamp(ev)),
            // Unknown before metering.
            Some(Exposure::Auto) => None,
            None => Some(white_clamp(0.0)),
        });
    }
    PictureSettings { tone_map, exposure, clamp, ..picture }
}

/// The ground of the look; `chosen` is the setting.
fn ground(scene: &Scene, chosen: Option<bool>, context: &LookContext) -> Option<Ground> {
    if !chosen.unwrap_or(context.adds_ground_and_background) {
        return None;
    }
    let look = Ground {
        albedo: GROUND_ALBEDO,
        is_hidden_from_below: chosen.is_none(),
        catches_shadows: true,
        ..Ground::default()
    };
    look.under(scene.bounds()?)
}

/// The colour that rays which hit nothing see in place of the scene's, if any, and whether the background is a backdrop.
fn background(chosen: Option<Background>, has_ground: bool, context: &LookContext) -> (Option<Colour>, bool) {
    let LookContext { pipeline, lacks_lights, is_bright, is_open, adds_ground_and_background, .. } = *context;
    if adds_ground_and_background || lacks_lights && has_ground {
        match is_bright && pipeline == ColourPipeline::Linear {
            // A backdrop, so that it is the same for any exposure.
            true => (Some(displayed_background()), true),
            false => (Some(background_colour(pipeline)), chosen.is_some()),
        }
    } else if chosen.is_none() && is_bright && is_open && !has_ground {
        // A backdrop, so that exposure does not change it.
        (None, true)
    } else if lacks_lights && pipeline == ColourPipeline::Linear {
        (Some(Colour::Linear(DARK_BACKGROUND)), chosen.is_some())
    } else {
        (None, chosen.is_some())
    }
}

/// The note on light, ground and background that are added.
fn note_of_parts(look: &DefaultLook, given: &PictureSettings, context: &LookContext) -> Option<String> {
    let added = [
        (look.light == Some(AddedLight::Key), "light"),
        (context.is_lit_by_files && look.fill.is_some(), "fill light"),
        (given.ground.is_none() && look.ground.is_some(), "ground"),
        (context.adds_ground_and_background && given.background.is_none(), "background"),
    ];
    let added: Vec<&str> = added.iter().filter(|(is_added, _)| *is_added).map(|(_, name)| *name).collect();
    let (last, before) = added.split_last()?;
    let camera = if context.is_of_file { "" } else { " and no camera" };
    let (before, verb) = match before {
        [] => (String::new(), "is"),
        _ => (format!("{} and ", before.join(", ")), "are"),
    };
    if context.is_lit_by_files {
        let without = if look.fill.is_some() {
            "--light none leaves out the fill light, --draft all"
        } else {
            "--draft leaves them out"
        };
        return Some(format!("{before}{last} {verb} added to the lights of the files; {without}"));
    }
    Some(format!(
        "no light{camera} in the files: {before}{last} {verb} added; --draft uses a headlight instead"
    ))
}

/// Ground requested by the settings.
///
/// # Errors
/// [`Error::Input`] for a scene without objects.
fn asked_ground(scene: &Scene) -> Result<Ground> {
    scene.bounds().and_then(|bounds| Ground::default().under(bounds)).ok_or_else(|| {
        let file = scene.inputs.first().map_or(Path::new("-"), PathBuf::as_path);
        let hint = "leave --ground (`ground` of [image]) out, or add something that has a size";
        Error::input(file, "no object in it to put a ground under", hint)
    })
}

/// Whether, without the default look, the background is a backdrop, which bypasses exposure and tone map.
fn keeps_background(look: &DefaultLook) -> bool {
    let picture = &look.picture;
    let is_changed = picture.pipeline() == ColourPipeline::Linear && !picture.display().is_identity();
    // Black is unchanged by exposure.
    let is_black =
        look.background().is_some_and(|colour| colour.to_pipeline(ColourPipeline::Linear) == DVec3::ZERO);
    is_changed && !look.shows_environment() && !is_black && !picture.is_transparent()
}

/// Whether a headlight is added: the scene has no lights, and the settings request one or nothing else lights it.
fn needs_headlight(scene: &Scene, look: &DefaultLook) -> bool {
    // In path tracing, an environment and surfaces that emit light it.
    let is_lit = || look.transport(scene).traces_paths() && (look.environment.is_some() || scene.emits());
    look.picture.shading().uses_lights()
        && scene.lights.is_empty()
        && look.picture.light.map_or_else(|| !is_lit(), bool::from)
}

/// Which materials of a scene call for path tracing, unless a transport is chosen, and whether emissive surfaces light it.
fn path_tracing(
    scene: &Scene,
    settings: &RenderSettings,
    picture: &PictureSettings,
) -> (Option<String>, bool) {
    let can_trace = picture.transport.is_none_or(Transport::traces_paths);
    let is_off = settings.without.iter().any(|name| name == id::PATH.name())
        || scene.effects.get(id::PATH.name()).is_some_and(|switch| !switch.is_on());
    if !can_trace || is_off || !picture.shading().uses_lights() {
        return (None, false);
    }
    let lamps = path_calls::lighting(scene);
    let has_lamps = !lamps.is_empty();
    let emitting = named("emission of material", lamps);
    let transmitting = named("transmission of material", path_calls::transmitting(scene));
    let reason = if picture.transport.is_none() { emitting.or(transmitting) } else { None };
    (reason, has_lamps)
}

/// The clamp of paths that the materials call for: the light that an exposure shows as white, to 1/1000.
pub(crate) fn white_clamp(ev: f64) -> Clamp {
    Clamp::clamped(1e-3 * (1e3 * (-ev).exp2()).round().max(1.0))
}

/// The tone map before a background: none where it cannot display that.
fn tone_map_before(background: Option<Background>, notes: &mut Vec<String>) -> ToneMap {
    let shown = DisplayTransform::new(0.0, ToneMap::PbrNeutral);
    if let Some(background @ Background::Colour(colour)) = background {
        let light =
            shown.light_of(background.colour().to_pipeline(ColourPipeline::Linear)).unwrap_or_default();
        if shown.encode(ColourPipeline::Linear, light.as_vec3().to_array()) != colour.0 {
            notes.push(format!(
                "the default tone map displays no colour as saturated as the background {}; left out",
                background.text()
            ));
            return ToneMap::None;
        }
    }
    ToneMap::PbrNeutral
}

/// What a white surface that faces up reflects of key and fill light.
pub(crate) const LIGHT_FROM_ABOVE: f64 = KEY_IRRADIANCE + FILL.diffuse_up();

/// The colour of the ground where nothing shades it.
fn background_colour(pipeline: ColourPipeline) -> Colour {
    let light = LIGHT_FROM_ABOVE;
    match pipeline {
        ColourPipeline::Linear => Colour::Linear(DVec3::splat(GROUND_ALBEDO * light)),
        _ => Colour::Display(DVec3::splat(srgb_encode(GROUND_ALBEDO) * light)),
    }
}

/// The background of the look as its tone map displays it.
fn displayed_background() -> Colour {
    let light = background_colour(ColourPipeline::Linear).to_pipeline(ColourPipeline::Linear);
    let shown = DisplayTransform::new(0.0, ToneMap::PbrNeutral)
        .encode(ColourPipeline::Linear, light.as_vec3().to_array());
    Colour::from_u8(shown)
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
    use super::*;
    use crate::bvh::Sphere;
    use crate::job::CameraChoice;
    use crate::job::EnvironmentSettings;
    use crate::scene::{Camera, ColourValue, Intensity, Light, MaterialId, Object, Shape};
    use crate::world::headlight;

    fn ball() -> Scene {
        let shape = Shape::Analytic(Sphere { centre: DVec3::ZERO, radius: 1.0 }.into());
        let object = Object { name: "ball".into(), input: 0, material: MaterialId(0), shape };
        Scene { objects: vec![object], ..Scene::default() }
    }

    fn camera() -> Camera {
        Camera::from_field_of_view("c".into(), DVec3::Z * 5.0, DVec3::ZERO, DVec3::Y, 1.0)
    }

    fn look_of(scene: &Scene, settings: &RenderSettings) -> DefaultLook {
        let settings = RenderSettings { mesh_look: Look::Studio, ..settings.clone() };
        crate::job::Session::still(scene.clone())
            .and_then(|session| session.look(&settings))
            .expect("a look")
            .0
    }

    /// Whether a look has fill and key light, a ground, a background, and antialiasing.
    fn parts(look: &DefaultLook) -> [bool; 4] {
        let light = look.fill.is_some() && look.light == Some(AddedLight::Key);
        [light, look.ground.is_some(), look.background.is_some(), look.picture.noise.is_some()]
    }

    #[test]
    fn files_get_what_they_do_not_have() {
        let none = RenderSettings::default();
        let light: Vec<Light> = headlight(&camera()).into_iter().collect();
        assert_eq!(parts(&look_of(&ball(), &none)), [true; 4]);
        // A file with a camera keeps the dark background.
        let with_camera = look_of(&Scene { cameras: vec![camera()], ..ball() }, &none);
        assert_eq!(parts(&with_camera), [true, false, true, true]);
        assert_eq!(with_camera.background, Some(Colour::Linear(DARK_BACKGROUND)));
        let fitted = RenderSettings {
            camera: CameraChoice::Fitted(crate::world::StandardView::Front),
            ..none.clone()
        };
        assert_eq!(parts(&look_of(&Scene { cameras: vec![camera()], ..ball() }, &fitted)), [true; 4]);
        assert_eq!(parts(&look_of(&Scene { lights: light, ..ball() }, &none)), [false, false, false, true]);
        assert_eq!(parts(&look_of(&Scene { has_settings: true, ..ball() }, &none)), [false; 4]);
    }

    /// Lights of files in physical units get fill light in proportion to the exposure, ground and backdrop.
    #[test]
    fn files_with_lights_look_like_others() {
        let none = PictureSettings::default;
        let lights: Vec<Light> = headlight(&camera()).into_iter().collect();
        let lit = Scene { lights, has_physical_lights: true, ..ball() };
        let of = |scene: &Scene, picture: PictureSettings| {
            let look = look_of(scene, &picture.into());
            let fill = look.fill.map(|fill| fill.is_exposed);
            let changes_nothing = look.notes.iter().any(|note| note.contains("changes nothing"));
            (fill, look.ground.is_some() && look.has_backdrop, look.ambient, changes_nothing)
        };
        assert_eq!(of(&lit, none()), (Some(true), true, Some(0.0), false));
        let light = |light| PictureSettings { light: Some(light), ..none() };
        assert_eq!(of(&lit, light(Headlight::None)), (None, true, Some(0.0), false));
        assert!(of(&lit, light(Headlight::Head)).3);
        assert!(of(&Scene { has_physical_lights: false, ..lit.clone() }, light(Headlight::None)).3);
        // Under their own camera they keep its view; paths have indirect light.
        assert_eq!(
            of(&Scene { cameras: vec![camera()], ..lit.clone() }, none()),
            (Some(true), false, Some(0.0), false)
        );
        let path = PictureSettings { transport: Some(Transport::Path), ..none() };
        assert_eq!(of(&lit, path).0, None);
    }

    #[test]
    fn the_intensity_of_an_environment_is_that_of_the_settings() {
        let environment = EnvironmentSettings {
            environment: Some("#ffffff".into()),
            environment_intensity: Some(Intensity::clamped(3.0)),
            ..EnvironmentSettings::default()
        };
        let settings = RenderSettings { environment, ..RenderSettings::default() };
        assert_eq!(look_of(&ball(), &settings).environment.map(|own| own.intensity), Some(3.0));
    }

    /// Each of the settings that choose a part changes that part alone.
    #[test]
    fn parts_are_independent() {
        let none = PictureSettings::default;
        let parts_of = |settings: &RenderSettings| {
            let look = look_of(&ball(), settings);
            assert_eq!((look.ambient, look.picture.tone_map), (Some(0.0), Some(ToneMap::PbrNeutral)));
            parts(&look)
        };
        let environment = |hide: bool| EnvironmentSettings {
            environment: Some("sky".into()),
            hide_environment: Some(hide),
            ..EnvironmentSettings::default()
        };
        let lit_by =
            |hide: bool| RenderSettings { environment: environment(hide), ..RenderSettings::default() };
        // An environment that is seen is the background.
        assert_eq!(parts(&look_of(&ball(), &lit_by(false)))[..2], [false; 2]);
        assert_eq!(parts(&look_of(&ball(), &lit_by(true))), [false, true, true, true]);
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
        let with_camera = look_of(&Scene { cameras: vec![camera()], ..ball() }, &ground.into());
        assert_eq!(with_camera.background, Some(background_colour(ColourPipeline::Linear)));
    }

    /// A scene file has the look if it says so, a mesh unless `--draft` says otherwise.
    #[test]
    fn the_look_is_chosen() {
        let of = |has_settings, look: Option<Look>| {
            let picture = PictureSettings { look, ..PictureSettings::default() };
            let scene = Scene { has_settings, background: Some(Colour::from_u8([0; 3])), ..ball() };
            parts(&look_of(&scene, &picture.into()))[0]
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
        let of = |colour| tone_map_before(Some(Background::Colour(ColourValue(colour))), &mut Vec::new());
        assert_eq!([[255; 3], [0; 3], [32, 34, 38], [70, 130, 180]].map(of), [ToneMap::PbrNeutral; 4]);
        assert_eq!([[255, 0, 0], [255, 128, 0]].map(of), [ToneMap::None; 2]);
    }

    /// Paths have the same fill light, as an environment: the irradiance of a surface that faces up, over pi.
    #[test]
    fn paths_have_the_fill_light() {
        let settings = PictureSettings { transport: Some(Transport::Path), ..Default::default() }.into();
        let look = look_of(&ball(), &settings);
        assert!(
            look.fill.is_none()
                && look.light == Some(AddedLight::Key)
                && look.picture.sampling().samples == Some(PATH_SAMPLES)
        );
        let EnvironmentSource::Image(image) = look.environment.unwrap().source else { panic!("an image") };
        let weight = |row: usize| {
            let [from, to] =
                [row, row + 1].map(|r| (std::f64::consts::PI * r as f64 / f64::from(ROWS)).sin());
            to * to - from * from
        };
        let upper = image.pixels.iter().enumerate().take(ROWS as usize / 2);
        let irradiance: f64 = upper.map(|(row, pixel)| weight(row) * f64::from(pixel[0])).sum();
        assert!((irradiance - FILL.diffuse_up()).abs() < 1e-3, "{irradiance}");
    }

    /// An environment is light in path tracing, its default, and no headlight is added; local shading does not see it.
    #[test]
    fn a_headlight_is_added_where_nothing_else_is_light() {
        let wanted = |scene: &Scene, light: Option<bool>, transport| {
            let own = PictureSettings { light: light.map(Into::into), transport, ..Default::default() };
            needs_headlight(scene, &DefaultLook::of_files(scene, own.or(scene.picture)))
        };
        let (path, whitted) = (Some(Transport::Path), Some(Transport::Whitted));
        let mut scene = Scene::default();
        assert!(
            wanted(&scene, None, None) && wanted(&scene, None, path) && !wanted(&scene, Some(false), None)
        );
        let source = EnvironmentSource::Sky;
        scene.environment = Some(Environment { source, rotation: 0.0, intensity: 1.0, is_hidden: false });
        assert!(!wanted(&scene, None, None) && !wanted(&scene, None, path) && wanted(&scene, None, whitted));
        assert!(wanted(&scene, Some(true), None));
        scene.picture.light = Some(false.into());
        assert!(!wanted(&scene, None, whitted));
    }
}
