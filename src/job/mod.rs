//! From a scene and settings to a picture: the one way there, for commands, the window, the study and library users.
//!
//! [`prepare`] turns a [`Scene`] and [`RenderSettings`] into a [`RenderJob`], and [`RenderJob::render`] that into a film. Where the
//! fingerprint of a picture is wanted before the acceleration structure is built, the two halves of `prepare` are [`resolve`] and
//! [`ResolvedJob::build`]. Uses everything below; knows nothing of command lines, animations and windows.
//!
//! ```
//! use kiln::error::Warnings;
//! use kiln::film::Film;
//! use kiln::job::{RenderSettings, prepare};
//! use kiln::render::RenderControl;
//!
//! let mut warnings = Warnings::default();
//! let scene = kiln::import::load(&["scenes/assignment.toml".into()], &mut warnings)?;
//! let settings = RenderSettings { size: Some([64, 64]), ..RenderSettings::default() };
//! let job = prepare(scene, &settings, &mut warnings)?;
//! let (film, statistics): (Film, _) = job.render(&RenderControl::default())?;
//! assert_eq!((film.window().width, statistics.non_finite.0), (64, 0));
//! # Ok::<(), kiln::error::Error>(())
//! ```

pub mod camera;
mod memory;
pub mod metadata;
mod settings;

pub use memory::check_memory;
pub use metadata::Metadata;
pub use settings::{CameraChoice, RenderSettings};

use std::sync::Arc;

use crate::bvh::Layout;
use crate::effects::{Choices, Plan, check_names, check_scene};
use crate::error::{Error, Result, Warnings};
use crate::film::{ColourPipeline, Film, Pixel, Share, Window};
use crate::import::check_drawable;
use crate::render::aov::AovSource;
use crate::render::{RenderControl, Statistics, render};
use crate::scene::{Camera, Numerics, Sampling, Scene};
use crate::world::{Recentering, View, World, headlight, recenter};
use camera::Viewpoint;

/// Everything that a picture takes, ready to be rendered.
pub struct RenderJob {
    /// The prepared scene.
    pub world: Arc<World>,
    /// How the scene was moved before it was prepared.
    pub recentering: Option<Recentering>,
    /// The camera in the world's coordinates, with the projection that is used.
    pub camera: Camera,
    /// The camera's rays for a picture of its size.
    pub view: View,
    /// The part of the picture that is rendered.
    pub window: Window,
    /// The share of its tiles that is rendered.
    pub share: Share,
    /// How far shading goes, sampling, and what is asked of effects.
    pub choices: Choices,
    /// The stages that follow from the world and the choices.
    pub plan: Plan,
    /// What makes the picture.
    pub metadata: Metadata,
}

impl RenderJob {
    /// A whole picture of a world.
    ///
    /// # Errors
    /// Those of [`View::new`] and [`Plan::new`].
    pub fn new(
        world: Arc<World>,
        recentering: Option<Recentering>,
        camera: Camera,
        size: [u32; 2],
        choices: Choices,
    ) -> Result<Self> {
        let view = View::new(&camera, camera.projection, size)?;
        let plan = Plan::new(&world, &choices)?;
        let window = Window { x: 0, y: 0, width: size[0], height: size[1] };
        let (share, metadata) = (Share::ALL, Metadata::new());
        Ok(RenderJob { world, recentering, camera, view, window, share, choices, plan, metadata })
    }

    /// The same picture with other choices. The world is shared.
    ///
    /// # Errors
    /// Those of [`Plan::new`].
    pub fn with_choices(&self, choices: Choices) -> Result<Self> {
        let plan = Plan::new(&self.world, &choices)?;
        let RenderJob { world, recentering, camera, view, window, share, metadata, .. } = self;
        Ok(RenderJob {
            world: Arc::clone(world),
            recentering: *recentering,
            camera: camera.clone(),
            view: view.clone(),
            window: *window,
            share: *share,
            choices,
            plan,
            metadata: metadata.clone(),
        })
    }

    /// The same picture, whole, in another size. The world is shared.
    ///
    /// # Errors
    /// Those of [`RenderJob::new`].
    pub fn with_size(&self, size: [u32; 2]) -> Result<Self> {
        let RenderJob { world, recentering, camera, choices, .. } = self;
        RenderJob::new(Arc::clone(world), *recentering, camera.clone(), size, choices.clone())
    }

    /// Replaces the sampling; the plan follows.
    ///
    /// # Errors
    /// Those of [`Plan::new`].
    pub fn set_sampling(&mut self, sampling: Sampling) -> Result<()> {
        self.choices.sampling = sampling;
        self.plan = Plan::new(&self.world, &self.choices)?;
        Ok(())
    }

    /// The colour pipeline.
    pub fn pipeline(&self) -> ColourPipeline {
        self.world.pipeline
    }

    /// Renders the picture, on the current rayon pool.
    ///
    /// # Errors
    /// [`Error::Interrupted`] when cancelled, [`Error::Failed`] where there is not enough memory for the picture.
    pub fn render<P: Pixel>(&self, control: &RenderControl) -> Result<(Film<P>, Statistics)> {
        self.render_selected(|place, _| self.share.has(place), control)
    }

    /// Renders the tiles that `is_selected` accepts, by their place in the order of tiles and by the pixels they cover.
    ///
    /// # Errors
    /// Those of [`RenderJob::render`].
    pub fn render_selected<P: Pixel>(
        &self,
        is_selected: impl Fn(usize, Window) -> bool,
        control: &RenderControl,
    ) -> Result<(Film<P>, Statistics)> {
        render(&self.world, &self.view, &self.plan, self.window, is_selected, control)
    }

    /// What the layers of the picture are made of.
    pub fn subject<'a>(&'a self, film: Option<&'a Film>) -> AovSource<'a> {
        let RenderJob { world, recentering, view, plan, window, share, .. } = self;
        AovSource { world, recentering: *recentering, view, plan, window: *window, share: *share, film }
    }
}

/// A scene and all that decides its picture, before the acceleration structure is built.
pub struct ResolvedJob {
    /// The scene, recentered and with a light.
    pub scene: Scene,
    /// How it was moved.
    pub recentering: Option<Recentering>,
    /// The camera, with the projection that is used.
    pub camera: Camera,
    /// Width and height of the whole picture in pixels.
    pub size: [u32; 2],
    /// The part of it that is rendered.
    pub window: Window,
    /// The share of its tiles that is rendered.
    pub share: Share,
    /// How far shading goes, sampling, and what is asked of effects.
    pub choices: Choices,
    /// The colour pipeline.
    pub pipeline: ColourPipeline,
    /// The tier of numerics.
    pub numerics: Numerics,
    /// The layout of the acceleration structure, and how it is built.
    pub structure: Layout,
    /// What makes the picture.
    pub metadata: Metadata,
}

/// Prepares a picture of a scene.
///
/// # Errors
/// [`Error::Usage`] for settings that cannot be met, [`Error::Input`] for a scene that cannot be rendered.
pub fn prepare(scene: Scene, settings: &RenderSettings, warnings: &mut Warnings) -> Result<RenderJob> {
    resolve(scene, settings, warnings)?.build(warnings)
}

/// Decides everything about a picture that can be decided without an acceleration structure.
///
/// # Errors
/// Those of [`prepare`].
pub fn resolve(mut scene: Scene, settings: &RenderSettings, warnings: &mut Warnings) -> Result<ResolvedJob> {
    check_names(&settings.with, &settings.without)?;
    check_scene(&scene.effects)?;
    check_drawable(&scene)?;
    let recentering = recenter(&mut scene);
    warn_of_recentering(recentering.as_ref(), warnings);
    let viewpoint = Viewpoint::of(&settings.camera, &scene, recentering.as_ref())?;
    let size = viewpoint.size(settings, &scene);
    let camera = viewpoint.camera(settings, &scene, size)?;
    if scene.lights.is_empty() && settings.shading.uses_lights() {
        scene.lights.extend(headlight(&camera));
        warnings.note(HEADLIGHT);
    }
    resolve_for(scene, recentering, camera, size, settings)
}

/// [`resolve`] for a scene that is recentered and lit, seen by a camera of its own.
///
/// # Errors
/// [`Error::Usage`] for settings that cannot be met.
pub fn resolve_for(
    mut scene: Scene,
    recentering: Option<Recentering>,
    mut camera: Camera,
    size: [u32; 2],
    settings: &RenderSettings,
) -> Result<ResolvedJob> {
    let sampling = settings.sampling.or(scene.sampling);
    let most = sampling.most_samples();
    if let Some(least) = sampling.min_samples.filter(|&least| sampling.noise.is_some() && least > most) {
        let what = format!("at least {least} samples a pixel were asked for, and at most {most}");
        return Err(Error::usage(what, "give a lower --min-samples or a higher --samples"));
    }
    camera.projection = settings.projection.unwrap_or(camera.projection);
    View::new(&camera, camera.projection, size)?;
    let window = camera::window(settings.crop, size)?;
    let pipeline = settings.colour.or(scene.colour).unwrap_or_default();
    let numerics = settings.numerics.or(scene.numerics).unwrap_or_default();
    let mut choices = Choices {
        shading: settings.shading,
        sampling,
        scene: Default::default(),
        with: settings.with.clone(),
        without: settings.without.clone(),
        even_idle: false,
    };
    let layers = &settings.layers;
    let origin = metadata::Origin {
        recentering: recentering.as_ref(),
        camera: &camera,
        size,
        window,
        choices: &choices,
        pipeline,
        numerics,
        layers,
    };
    let metadata = metadata::metadata(&scene, &origin);
    choices.scene = std::mem::take(&mut scene.effects);
    let (share, structure) = (settings.share, Layout::Wide(settings.preset));
    Ok(ResolvedJob {
        scene,
        recentering,
        camera,
        size,
        window,
        share,
        choices,
        pipeline,
        numerics,
        structure,
        metadata,
    })
}

impl ResolvedJob {
    /// Builds the acceleration structure and the plan.
    ///
    /// # Errors
    /// Those of [`check_memory`] and [`RenderJob::new`].
    pub fn build(self, warnings: &mut Warnings) -> Result<RenderJob> {
        let ResolvedJob { scene, recentering, camera, size, window, share, choices, metadata, .. } = self;
        check_memory(&scene, &choices, self.numerics)?;
        let world = World::prepare(scene, self.pipeline, self.structure, self.numerics);
        let job = RenderJob::new(Arc::new(world), recentering, camera, size, choices)?;
        let job = RenderJob { window, share, metadata, ..job };
        warn_of_job(&job, warnings);
        Ok(job)
    }
}

/// The note where a scene has no light.
pub const HEADLIGHT: &str = "no light in the scene; added a headlight";

/// Notes how a scene was moved.
pub fn warn_of_recentering(recentering: Option<&Recentering>, warnings: &mut Warnings) {
    if let Some(recentering) = recentering {
        warnings.note(match recentering.scale {
            1.0 => "the scene lies far from the origin; moved to it, to keep its digits",
            _ => "the scene's size is beyond what f32 holds well; scaled by a power of two",
        });
    }
}

/// Warns of spheres that are left out and of effects that were asked for and change nothing.
pub fn warn_of_job(job: &RenderJob, warnings: &mut Warnings) {
    let RenderJob { world, plan, choices, .. } = job;
    if world.too_small > 0 {
        warnings.push(format!(
            "{} sphere(s) have a radius that is 0 in the numbers of `--numerics {}`; left out",
            world.too_small,
            world.numerics().name()
        ));
    }
    for decision in
        plan.decisions.iter().filter(|d| !d.on && choices.with.iter().any(|name| *name == d.effect.name()))
    {
        warnings.push(format!("--with {} changes nothing: {}", decision.effect, decision.why));
    }
}
