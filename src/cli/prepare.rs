//! From arguments to a scene that is ready for its picture: the one way there, for every command that makes pictures.

use std::path::Path;
use std::time::Instant;

use super::arguments::Arguments;
use super::picture;
use super::statistics::Seconds;
use crate::bvh::Layout;
use crate::effects::{Choices, Plan, check_scene};
use crate::error::{Error, Result, Warnings};
use crate::film::write::FINGERPRINT;
use crate::film::{ColourPipeline, Share, Window};
use crate::import;
use crate::limits;
use crate::scene::{Camera, Fingerprint, Numerics, Projection, Scene, TextureImage};
use crate::world::{Range, View, World, bring_into_range, headlight};

/// A scene that is ready for its picture.
pub struct Ready {
    pub world: World,
    /// How the scene was moved before it was prepared.
    pub range: Option<Range>,
    pub view: View,
    pub window: Window,
    pub plan: Plan,
    pub choices: Choices,
    pub pipeline: ColourPipeline,
    /// The tiles that are rendered.
    pub share: Share,
    /// What made the picture.
    pub settings: Vec<(String, String)>,
}

/// A scene with all that was said of its picture, before anything is prepared.
pub struct Described {
    pub scene: Scene,
    /// How the scene was moved.
    pub range: Option<Range>,
    pub camera: Camera,
    pub projection: Projection,
    pub size: [u32; 2],
    pub view: View,
    pub window: Window,
    pub choices: Choices,
    pub pipeline: ColourPipeline,
    pub numerics: Numerics,
    pub structure: Layout,
    /// What makes the picture.
    pub settings: Vec<(String, String)>,
}

/// Reads the inputs and finds out which picture of them is wanted; `show` is called with what is done next, and with what
/// there is to say of what was done. `longest` limits the picture's sides, in pixels, where no size is given.
pub fn take_in(
    arguments: &Arguments,
    longest: Option<u32>,
    seconds: &mut Seconds,
    warnings: &mut Warnings,
    show: &mut dyn FnMut(&str, &Warnings),
) -> Result<Described> {
    show("loading", warnings);
    let scene = timed(&mut seconds.load, || import::load(&arguments.inputs, warnings))?;
    show("preparing", warnings);
    describe(arguments, scene, longest, warnings)
}

/// Finds out which picture of a scene is wanted.
pub fn describe(
    arguments: &Arguments,
    mut scene: Scene,
    longest: Option<u32>,
    warnings: &mut Warnings,
) -> Result<Described> {
    check_scene(&scene.effects)?;
    let range = bring_into_range(&mut scene);
    note_range(range.as_ref(), warnings);
    let (camera, mut size) = picture::choose(arguments, &scene, range.as_ref())?;
    if let Some(longest) = longest.filter(|_| arguments.size.is_none() && arguments.crop.is_none()) {
        size = picture::no_longer_than(longest, size);
    }
    if scene.lights.is_empty() && arguments.shading().uses_lights() {
        scene.lights.extend(headlight(&camera));
        warnings.note(HEADLIGHT);
    }
    settle(arguments, scene, range, camera, size)
}

/// What is said where a scene has no light.
pub const HEADLIGHT: &str = "no light in the scene; added a headlight";

/// Says how a scene was moved.
pub fn note_range(range: Option<&Range>, warnings: &mut Warnings) {
    if let Some(range) = range {
        warnings.note(match range.scale {
            1.0 => "the scene lies far from the origin; moved to it, to keep its digits",
            _ => "the scene's size is beyond what f32 holds well; scaled by a power of two",
        });
    }
}

/// Puts together what the arguments and the scene say of a picture, once it is known what it is seen by.
pub fn settle(
    arguments: &Arguments,
    mut scene: Scene,
    range: Option<Range>,
    camera: Camera,
    size: [u32; 2],
) -> Result<Described> {
    scene.sampling = arguments.sampling.said().or(scene.sampling);
    let most = scene.sampling.most_samples();
    if let Some(least) =
        scene.sampling.min_samples.filter(|&least| scene.sampling.noise.is_some() && least > most)
    {
        let what = format!("at least {least} samples a pixel were asked for, and at most {most}");
        return Err(Error::usage(what, "give a lower --min-samples or a higher --samples"));
    }
    // Everything from here on follows from the description and what is said of it, or makes no difference to the picture.
    let mut fingerprint = Fingerprint::default();
    fingerprint.scene(&scene);
    let pipeline = arguments.colour().or(scene.colour).unwrap_or_default();
    let numerics = arguments.numerics().or(scene.numerics).unwrap_or_default();
    let choices = Choices {
        shading: arguments.shading(),
        scene: std::mem::take(&mut scene.effects),
        with: arguments.with.clone(),
        without: arguments.without.clone(),
        even_idle: false,
    };
    let projection = arguments.projection().unwrap_or(camera.projection);
    let view = View::new(&camera, projection, size)?;
    let window = picture::window(arguments.crop, size)?;
    let mut settings = arguments.settings(&camera, projection, size, pipeline, numerics);
    settings.extend(scene.sampling.settings());
    let Choices { shading, scene: _, with, without, even_idle: _ } = &choices;
    fingerprint.value("range", &range.as_ref().map(|range| (range.middle, range.scale)));
    fingerprint
        .value("camera", &(&camera, projection, size, (window.x, window.y, window.width, window.height)));
    fingerprint.value("choices", &(shading.name(), with, without, pipeline.name(), numerics.name()));
    settings.push((FINGERPRINT.to_owned(), fingerprint.finish()));
    let structure = Layout::Wide(arguments.preset());
    Ok(Described {
        scene,
        range,
        camera,
        projection,
        size,
        view,
        window,
        choices,
        pipeline,
        numerics,
        structure,
        settings,
    })
}

/// The fingerprint among settings.
pub fn fingerprint_of(settings: &[(String, String)]) -> &str {
    settings.iter().find(|(key, _)| key == FINGERPRINT).map_or("", |(_, value)| value)
}

/// Lets the fingerprint depend on something more.
pub fn fingerprint_also(settings: &mut [(String, String)], name: &str, more: &impl std::fmt::Debug) {
    for (_, value) in settings.iter_mut().filter(|(key, _)| key == FINGERPRINT) {
        let mut fingerprint = Fingerprint::default();
        fingerprint.value("picture", value);
        fingerprint.value(name, more);
        *value = fingerprint.finish();
    }
}

/// Lets the fingerprint depend on layers, where there are any.
pub fn fingerprint_layers(settings: &mut [(String, String)], layers: &[String]) {
    if !layers.is_empty() {
        fingerprint_also(settings, "layers", &layers);
    }
}

/// Reads the inputs and prepares all that a picture of them takes; `show` is called with what is done next, and with what
/// there is to say of what was done.
pub fn make_ready(
    arguments: &Arguments,
    seconds: &mut Seconds,
    warnings: &mut Warnings,
    show: &mut dyn FnMut(&str, &Warnings),
) -> Result<Ready> {
    let described = take_in(arguments, None, seconds, warnings, show)?;
    show("building", warnings);
    build(described, seconds, warnings)
}

/// Prepares what was described.
pub fn build(described: Described, seconds: &mut Seconds, warnings: &mut Warnings) -> Result<Ready> {
    let Described { scene, range, view, window, choices, pipeline, numerics, structure, settings, .. } =
        described;
    check_mip_maps(&scene, &choices)?;
    let world = timed(&mut seconds.build, || World::prepare(scene, pipeline, structure, numerics));
    let plan = Plan::new(&world, &choices)?;
    warn_of_the_world(&world, &plan, &choices, warnings);
    Ok(Ready { world, range, view, window, plan, choices, pipeline, share: Share::ALL, settings })
}

/// Checks that there is memory for the mip maps of a scene's textures, which lookups but `nearest` and `bilinear` use.
///
/// # Errors
/// [`Error::Input`] for the largest texture.
pub fn check_mip_maps(scene: &Scene, choices: &Choices) -> Result<()> {
    let without = ["textures=nearest", "textures=bilinear"];
    if choices.with.iter().any(|name| without.contains(&name.as_str())) {
        return Ok(());
    }
    let area = |image: &TextureImage| limits::product(&[image.width.into(), image.height.into()]);
    let Some(largest) = scene.images.iter().max_by_key(|image| area(image)) else { return Ok(()) };
    // A third of the texels, of 6 bytes; while they are made, levels of a quarter and a sixteenth, of 12 bytes.
    let kept = scene.images.iter().map(|image| limits::product(&[area(image), 2]));
    let needed = kept.fold(limits::product(&[area(largest), 4]), u64::saturating_add);
    limits::check(needed).map_err(|excess| {
        let TextureImage { name, width, height, .. } = largest;
        let what =
            format!("making mip maps of this texture of {width} x {height} pixels and all others {excess}");
        let hint = format!(
            "make it smaller, render --with textures=bilinear, which uses none, or {}",
            excess.remedy()
        );
        Error::input(Path::new(name), what, hint)
    })
}

/// Does the work and says how many seconds it took.
pub fn timed<T>(seconds: &mut f64, work: impl FnOnce() -> T) -> T {
    let start = Instant::now();
    let result = work();
    *seconds = start.elapsed().as_secs_f64();
    result
}

/// Nothing that was asked for is left out in silence.
pub fn warn_of_the_world(world: &World, plan: &Plan, choices: &Choices, warnings: &mut Warnings) {
    if world.too_small > 0 {
        warnings.push(format!(
            "{} sphere(s) have a radius that is 0 in the numbers of `--numerics {}`; left out",
            world.too_small,
            world.numerics().name()
        ));
    }
    for decision in
        plan.decisions.iter().filter(|d| !d.on && choices.with.iter().any(|name| name == d.effect))
    {
        warnings.push(format!("--with {} changes nothing: {}", decision.effect, decision.why));
    }
}
