//! Preparation of render jobs from a scene and settings, for commands, the window, studies and library users.
//!
//! [`prepare`] turns a [`Scene`] and [`RenderSettings`] into a [`RenderJob`], and [`RenderJob::render`] renders it to a
//! film. `prepare` consists of [`resolve`], which determines the fingerprint, and [`ResolvedJob::build`], which builds
//! the acceleration structure. Independent of command lines, animations and windows.
//!
//! ```
//! use kiln::error::Warnings;
//! use kiln::film::write::{Format, OutputImage, write_picture};
//! use kiln::job::{RenderControl, RenderSettings, prepare};
//! use kiln::scene::PictureSettings;
//!
//! let mut warnings = Warnings::default();
//! let scene = kiln::import::load(&["scenes/assignment.toml".into()], &mut warnings)?;
//! let settings = RenderSettings::from(PictureSettings::of_size([64, 64]));
//! let job = prepare(scene, &settings, &mut warnings)?;
//! let (film, statistics) = job.render(&RenderControl::default())?;
//! assert_eq!(statistics.non_finite, []);
//! let file = std::env::temp_dir().join("kiln-library-example.png");
//! write_picture(&OutputImage::Rgb8(film, job.pipeline()), &job.metadata, Format::from_path(&file)?, &file)?;
//! # std::fs::remove_file(&file).unwrap();
//! # Ok::<(), kiln::error::Error>(())
//! ```

mod back_faces;
pub mod camera;
mod default_look;
mod lens;
mod memory;
pub mod metadata;
mod metering;
mod outside;
mod path_calls;
mod settings;

pub use crate::effects::Choices;
pub use crate::render::{RenderControl, Statistics};
pub use crate::shading::ShadingMode;
#[cfg(feature = "viewer")]
pub(crate) use default_look::default_look;
pub use memory::check_memory;
pub use metadata::Metadata;
pub(crate) use metering::leave_to_metering;
#[cfg(feature = "viewer")]
pub(crate) use settings::is_fitted;
pub use settings::{CameraChoice, EnvironmentSettings, RenderSettings, check_display};

use std::borrow::Cow;
use std::sync::{Arc, OnceLock};

use glam::DVec3;

use crate::bvh::Layout;
use crate::effects::tile::RenderContext;
use crate::effects::{PathSettings, Plan, RayKind, check_names, check_scene, id, named};
use crate::error::{Error, Result, Warnings};
use crate::farm::Shard;
use crate::film::{ColourPipeline, DisplaySettings, Film, Pixel, Window};
use crate::import::check_drawable;
use crate::render::aov::AovSource;
use crate::render::render_displayed;
use crate::scene::{
    AddedLight, Camera, Clamp, DefaultLook, EffectsSection, Light, Material, MetallicRoughness, Numerics,
    PictureSettings, Projection, Sampling, Scene,
};
use crate::world::{
    PreparedMaterial, Recentering, StandardView, View, World, has_radiance, headlight, key_light, opening,
    recenter,
};
use camera::Viewpoint;

/// A picture that is ready to be rendered.
pub struct RenderJob {
    /// The prepared scene.
    pub world: Arc<World>,
    /// Transform applied to the scene before preparation, if any.
    pub recentering: Option<Recentering>,
    /// Camera in world coordinates, with the projection used.
    pub camera: Camera,
    /// Camera ray generator for the picture size.
    pub view: View,
    /// Region of the picture that is rendered.
    pub window: Window,
    /// The settings: those that were given, and those of the scene.
    pub settings: RenderSettings,
    /// Shading mode, sampling and effect settings.
    pub choices: Choices,
    /// Stages for the world and the choices.
    pub plan: Plan,
    /// Metadata of the picture.
    pub metadata: Metadata,
    /// Automatic exposure in EV, once metered.
    pub(crate) auto_exposure: OnceLock<f64>,
}

impl RenderJob {
    /// A job for the whole picture of a world.
    ///
    /// # Errors
    /// As [`View::new`] and [`Plan::new`].
    pub fn new(
        world: Arc<World>,
        recentering: Option<Recentering>,
        camera: Camera,
        size: [u32; 2],
        mut choices: Choices,
    ) -> Result<Self> {
        let mut view = View::new(&camera, camera.projection, size)?;
        lens::set(&mut view, &mut choices, &camera, &world, recentering.as_ref())?;
        let plan = Plan::new(&world, &choices)?;
        memory::check_lights(&world, &plan)?;
        let window = Window { x: 0, y: 0, width: size[0], height: size[1] };
        Ok(RenderJob {
            world,
            recentering,
            camera,
            view,
            window,
            settings: RenderSettings::default(),
            choices,
            plan,
            metadata: Metadata::new(),
            auto_exposure: OnceLock::new(),
        })
    }

    /// The same picture with other choices; the world and the lens are shared.
    ///
    /// # Errors
    /// As [`Plan::new`].
    pub fn with_choices(&self, choices: Choices) -> Result<Self> {
        let choices = Choices { lens: self.choices.lens.clone(), ..choices };
        let plan = Plan::new(&self.world, &choices)?;
        let RenderJob { world, recentering, camera, view, window, settings, metadata, .. } = self;
        Ok(RenderJob {
            world: Arc::clone(world),
            recentering: *recentering,
            camera: camera.clone(),
            view: view.clone(),
            window: *window,
            settings: settings.clone(),
            choices,
            plan,
            metadata: metadata.clone(),
            auto_exposure: OnceLock::new(),
        })
    }

    /// The whole picture in another size; the world is shared.
    ///
    /// # Errors
    /// As [`RenderJob::new`].
    pub fn with_size(&self, size: [u32; 2]) -> Result<Self> {
        let RenderJob { world, recentering, camera, choices, .. } = self;
        let job = RenderJob::new(Arc::clone(world), *recentering, camera.clone(), size, choices.clone())?;
        let settings = RenderSettings { shard: Shard::ALL, ..self.settings.clone() };
        Ok(RenderJob { settings, ..job })
    }

    /// Replaces the sampling settings and updates the plan.
    ///
    /// # Errors
    /// As [`Plan::new`].
    pub fn set_sampling(&mut self, sampling: Sampling) -> Result<()> {
        self.choices.sampling = sampling;
        self.plan = Plan::new(&self.world, &self.choices)?;
        Ok(())
    }

    /// The colour pipeline.
    pub fn pipeline(&self) -> ColourPipeline {
        self.world.pipeline
    }

    /// Exposure and tone map of pictures of display values.
    pub fn display(&self) -> DisplaySettings {
        self.settings.picture.display().in_pipeline(self.pipeline())
    }

    /// Whether the picture has an alpha channel: that of [`RenderJob::render`] in pixels of four `f32`.
    pub fn is_transparent(&self) -> bool {
        self.settings.picture.is_transparent()
    }

    /// Renders the picture, on the current rayon pool.
    ///
    /// # Errors
    /// [`Error::Interrupted`] if cancelled, [`Error::Memory`] if there is not enough memory for the picture.
    pub fn render<P: Pixel>(&self, control: &RenderControl) -> Result<(Film<P>, Statistics)> {
        self.render_selected(|place, _| self.settings.shard.has(place), control)
    }

    /// Renders the tiles that `is_selected` accepts, by tile index and region. An automatic exposure is metered first
    /// ([`RenderJob::display_transform`]) if display values are stored or tested by adaptive sampling.
    ///
    /// # Errors
    /// As [`RenderJob::render`].
    pub fn render_selected<P: Pixel>(
        &self,
        is_selected: impl Fn(usize, Window) -> bool,
        control: &RenderControl,
    ) -> Result<(Film<P>, Statistics)> {
        self.render_as(P::IS_DISPLAYED, is_selected, control)
    }

    /// As [`RenderJob::render_selected`], with `f32` pixels to be developed by [`RenderJob::display`]. Colours that
    /// bypass it are stored as [`crate::film::DisplayTransform::keep`].
    ///
    /// # Errors
    /// As [`RenderJob::render`].
    pub fn render_to_develop<P: Pixel>(
        &self,
        is_selected: impl Fn(usize, Window) -> bool,
        control: &RenderControl,
    ) -> Result<(Film<P>, Statistics)> {
        self.render_as(true, is_selected, control)
    }

    fn render_as<P: Pixel>(
        &self,
        is_displayed: bool,
        is_selected: impl Fn(usize, Window) -> bool,
        control: &RenderControl,
    ) -> Result<(Film<P>, Statistics)> {
        let display = match is_displayed || self.plan.is_adaptive() {
            true => self.display_transform(control)?,
            false => self.display().known(),
        };
        let context = RenderContext { world: &self.world, view: &self.view, display, is_displayed };
        let (film, mut statistics) =
            render_displayed(&context, &self.plan, self.window, is_selected, control)?;
        statistics.auto_exposure = (is_displayed && self.display().is_auto()).then_some(display.ev());
        Ok((film, statistics))
    }

    /// Source of the AOVs of the picture.
    pub fn aov_source<'a>(&'a self, film: Option<&'a Film>) -> AovSource<'a> {
        let RenderJob { world, recentering, view, plan, window, settings, .. } = self;
        // The transform of adaptive sampling. An automatic exposure is metered once the picture is rendered.
        let display = self.display().transform(self.auto_exposure.get().copied().unwrap_or(0.0));
        AovSource {
            world,
            recentering: *recentering,
            view,
            plan,
            window: *window,
            shard: settings.shard,
            film,
            display,
        }
    }
}

/// A scene with all settings resolved, before the acceleration structure is built.
pub struct ResolvedJob {
    /// The scene, recentered, with the light that is added.
    pub scene: Scene,
    /// Its look, recentered.
    pub look: DefaultLook,
    /// Transform applied to the scene, if any.
    pub recentering: Option<Recentering>,
    /// Camera with the projection used.
    pub camera: Camera,
    /// Region of the picture that is rendered.
    pub window: Window,
    /// The settings: those that were given, and those of the scene. Size, pipeline and tier of the picture are set.
    pub settings: RenderSettings,
    /// Shading mode, sampling and effect settings.
    pub choices: Choices,
    /// Metadata of the picture.
    pub metadata: Metadata,
    /// Whether lights are in physical units.
    pub has_physical_lights: bool,
    /// Whether [`ResolvedJob::build`] meters the exposure, as the default look says.
    pub meters: bool,
}

/// Prepares a scene for rendering.
///
/// # Errors
/// [`Error::Usage`] for invalid settings, [`Error::Input`] for a scene that cannot be rendered.
pub fn prepare(scene: Scene, settings: &RenderSettings, warnings: &mut Warnings) -> Result<RenderJob> {
    resolve(scene, settings, warnings)?.build(warnings)
}

/// Resolves scene and settings as far as possible without an acceleration structure.
///
/// # Errors
/// As [`prepare`].
pub fn resolve(mut scene: Scene, settings: &RenderSettings, warnings: &mut Warnings) -> Result<ResolvedJob> {
    check_names(&settings.with, &settings.without)?;
    check_scene(&scene.effects)?;
    check_drawable(&scene)?;
    let look = settings.default_look(&scene, warnings)?;
    let recentering = recenter(&mut scene);
    let look = look.recentered(recentering.as_ref());
    warn_of_recentering(recentering.as_ref(), warnings);
    let viewpoint = Viewpoint::of(&settings.camera, &scene, recentering.as_ref())?;
    viewpoint.report(settings, &scene, warnings);
    let is_of_mesh_file = !scene.has_settings && matches!(viewpoint, Viewpoint::Camera(Cow::Borrowed(_)));
    if matches!(viewpoint, Viewpoint::Fitted(StandardView::Auto))
        && settings.projection != Some(Projection::Panoramic)
        && opening(&scene).is_some_and(|opening| !opening.is_flat)
    {
        warnings.note("the surface is open to one side; the camera looks in from there");
    }
    let size = viewpoint.size(settings, &scene);
    let camera = viewpoint.camera(settings, &scene, size)?;
    // Files place their objects for their cameras; a scene file is written by hand.
    if scene.has_settings || is_of_mesh_file {
        let projection = settings.projection.unwrap_or(camera.projection);
        let view = View::new(&camera, projection, size)?;
        match is_of_mesh_file {
            true if projection == Projection::Panoramic => {}
            true => outside::note_framing(&scene, &camera, &view, warnings),
            false => outside::warn(&scene, &view, recentering.as_ref(), warnings),
        }
    }
    if let Some(light) = look.light {
        scene.lights.extend(light.at(&camera));
        light.note(warnings);
    }
    resolve_for(scene, look, recentering, camera, size, settings)
}

/// Warns of lights that have an area and no radiance, because their extent is too small or too large.
fn warn_of_dark_lights(scene: &Scene, warnings: &mut Warnings) {
    for light in scene.lights.iter().filter(|light| !has_radiance(light)) {
        warnings.left_out(format!(
            "light `{}` is too small, too large or turned to no side; left out",
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

/// Shading mode, sampling and effect settings of a picture by a camera. A picture with a lens gets the samples that it needs.
///
/// # Errors
/// [`Error::Usage`] for a lens of an orthographic camera.
pub(crate) fn choices(
    picture: &mut PictureSettings,
    scene: EffectsSection,
    camera: &Camera,
    settings: &RenderSettings,
) -> Result<Choices> {
    let mut choices = Choices {
        shading: picture.shading.unwrap_or_default(),
        sampling: picture.sampling(),
        scene,
        transport: picture.transport,
        clamp: picture.clamp.map(Clamp::get),
        cull: picture.cull == Some(true),
        with: settings.with.clone(),
        without: settings.without.clone(),
        stand_in: settings.depth.map(|depth| (id::PATH.with_value(depth), format!("--depth {depth}"))),
        ..Choices::default()
    };
    lens::complete(picture, &mut choices, camera)?;
    Ok(choices)
}

/// [`resolve`] for a scene with its look and a given camera. The ground of the look is left out if the camera is not above it;
/// a ground requested by the settings stays.
///
/// # Errors
/// [`Error::Usage`] for invalid settings.
pub fn resolve_for(
    scene: Scene,
    mut look: DefaultLook,
    recentering: Option<Recentering>,
    mut camera: Camera,
    size: [u32; 2],
    settings: &RenderSettings,
) -> Result<ResolvedJob> {
    look.hide_ground(&camera);
    let meters = leave_to_metering(&mut look, &scene, settings, &camera);
    let sampling = look.picture.sampling();
    let most = sampling.max_samples();
    if let Some(least) = sampling.min_samples.filter(|&least| sampling.noise.is_some() && least > most) {
        let what = format!("the minimum of {least} samples per pixel is above the maximum of {most}");
        return Err(Error::usage(what, "give a lower --min-samples or a higher --samples"));
    }
    camera.projection = settings.projection.unwrap_or(camera.projection);
    View::new(&camera, camera.projection, size)?;
    let window = camera::window(settings.crop, size)?;
    let (pipeline, display) = (look.picture.pipeline(), look.picture.display());
    check_display(display, pipeline)?;
    look.picture = PictureSettings {
        colour: Some(pipeline),
        numerics: Some(look.picture.numerics.unwrap_or_default()),
        ground: look.ground.map(|_| true),
        ..PictureSettings::of_size(size)
    }
    .or(look.picture);
    let choices = choices(&mut look.picture, scene.effects.clone(), &camera, settings)?;
    let mut metadata = metadata::metadata((&scene, &look), recentering.as_ref(), &camera, window, settings);
    let settings = RenderSettings { picture: look.picture, ..settings.clone() };
    if meters {
        metadata::add_to_fingerprint(&mut metadata, "metered", &true);
    }
    let has_physical_lights = scene.has_physical_lights;
    Ok(ResolvedJob {
        scene,
        look,
        recentering,
        camera,
        window,
        settings,
        choices,
        metadata,
        has_physical_lights,
        meters,
    })
}

impl ResolvedJob {
    /// Width and height of the whole picture in pixels.
    pub fn size(&self) -> [u32; 2] {
        let Window { width, height, .. } = self.window;
        self.settings.picture.size().unwrap_or([width, height])
    }

    /// Arithmetic tier.
    pub fn numerics(&self) -> Numerics {
        self.settings.picture.numerics.unwrap_or_default()
    }

    /// Layout and build preset of the acceleration structure.
    pub fn structure(&self) -> Layout {
        Layout::Wide(self.settings.preset)
    }

    /// Builds the acceleration structure and the plan.
    ///
    /// # Errors
    /// As [`check_memory`] and [`RenderJob::new`].
    pub fn build(self, warnings: &mut Warnings) -> Result<RenderJob> {
        let (size, numerics, structure) = (self.size(), self.numerics(), self.structure());
        let ResolvedJob {
            scene, look, recentering, camera, window, settings, choices, metadata, meters, ..
        } = self;
        check_memory(&scene, &choices, numerics)?;
        let world = World::prepare_look(scene, &look, settings.picture.pipeline(), structure, numerics);
        let job = RenderJob::new(Arc::new(world), recentering, camera, size, choices)?;
        let mut job = RenderJob { window, settings, metadata, ..job };
        if meters {
            let ev = job.meter(&RenderControl::default())?;
            warnings.note(format!("the exposure is {ev} EV, metered; --exposure 0 turns this off"));
        }
        warn_of_job(&job, warnings);
        Ok(job)
    }
}

/// Note for a scene without lights.
pub const HEADLIGHT: &str = "no light in the scene; added a headlight";

/// Adds a note on the recentering of a scene.
pub fn warn_of_recentering(recentering: Option<&Recentering>, warnings: &mut Warnings) {
    if let Some(recentering) = recentering {
        warnings.note(match recentering.scale {
            1.0 => "the scene is far from the origin; moved to it for precision",
            _ => "the scene is too large or too small for f32; scaled by a power of two",
        });
    }
}

/// Minimum percentage of paths that end in glass for a note.
const LEAST_ENDED: f64 = 1.0;

/// Note about paths that the depth limit ended at transmissive surfaces, which are too dark there.
pub fn note_of_depth(plan: &Plan, statistics: &Statistics) -> Option<String> {
    let paths = statistics.rays(RayKind::PRIMARY).cast;
    let percent = 100.0 * statistics.ended_in_glass as f64 / paths.max(1) as f64;
    if percent < LEAST_ENDED {
        return None;
    }
    let value = plan.decisions.iter().find(|decision| decision.effect == id::PATH)?.value.as_deref();
    let depth = value.and_then(|value| value.parse().ok()).unwrap_or(PathSettings::DEFAULT_DEPTH);
    Some(format!(
        "{percent:.0} % of the paths end in glass at the depth limit of {depth} and are too dark there; try --depth {}",
        2 * depth
    ))
}

/// Whether a material has layers that local shading leaves out.
fn needs_path(material: &PreparedMaterial) -> bool {
    match material {
        Material::Phong(m) => m.refraction.is_some(),
        Material::MetallicRoughness(m) if m.unlit => false,
        Material::MetallicRoughness(MetallicRoughness { layers, .. }) => {
            layers.transmission > 0.0 || layers.clearcoat > 0.0 || layers.sheen_colour != DVec3::ZERO
        }
    }
}

/// Whether a material has a glaze that adds light.
fn has_glaze(material: &PreparedMaterial) -> bool {
    matches!(material, Material::Phong(m) if m.glaze.as_ref().is_some_and(|glaze| glaze.weight > 0.0))
}

/// Warns of omitted spheres, of area lights and a clamp without path tracing, and of requested effects that change
/// nothing.
pub fn warn_of_job(job: &RenderJob, warnings: &mut Warnings) {
    let RenderJob { world, plan, choices, .. } = job;
    if world.too_small > 0 {
        warnings.left_out(format!(
            "{} sphere(s) have a radius that rounds to 0 in the tier `{}`; left out",
            world.too_small,
            world.numerics().name()
        ));
    }
    back_faces::report(job, warnings);
    let traces_paths = plan.transport.traces_paths();
    if traces_paths && !choices.sampling.is_wanted() {
        warnings.note("path tracing with one sample per pixel is noisy; try --samples 64");
    }
    if let (false, Some(clamp)) = (traces_paths, choices.clamp) {
        warnings.push(format!("a clamp of {clamp} changes nothing without path tracing"));
    }
    if let (false, true, Some(name)) =
        (traces_paths, choices.shading == ShadingMode::Full, world.area_lights.names.first())
    {
        warnings.left_out(format!("area lights such as `{name}` give no light without path tracing"));
    }
    if !traces_paths {
        let layered = world.materials_in_use().filter(|material| needs_path(material));
        if let Some(names) = named("material", layered.map(|material| material.name())) {
            warnings.note_left_out(format!(
                "glass, clear coat or sheen of {names} is drawn by --transport path alone"
            ));
        }
    }
    if traces_paths && choices.shading == ShadingMode::Full {
        let glazed = world.materials_in_use().filter(|material| has_glaze(material));
        if let Some(names) = named("material", glazed.map(|material| material.name())) {
            warnings.left_out(format!(
                "the glaze of {names} is left out by path tracing; --transport whitted draws it"
            ));
        }
        if choices.transport.is_some() && world.ambient > 0.0 {
            warnings.note_left_out(format!(
                "the ambient light of {} is left out by path tracing; use an environment instead",
                world.ambient
            ));
        }
    }
    for decision in plan.decisions.iter().filter(|decision| !decision.on) {
        if let Some(option) = choices.option_of(decision.effect) {
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
        let lights = vec![light("lamp", 1.0, 1.0), light("speck", 1e-200, 1.0), light("off", 1e-200, 0.0)];
        let mut warnings = Warnings::default();
        warn_of_dark_lights(&Scene { lights, ..Scene::default() }, &mut warnings);
        let [warning] = warnings.messages() else { panic!("{:?}", warnings.messages()) };
        assert!(warning.contains("`speck`"), "{warning}");
    }
}
