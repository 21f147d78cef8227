//! Preparation of render jobs from a scene and settings, for commands, the window, studies and library users.
//!
//! [`prepare`] turns a [`Scene`] and [`RenderSettings`] into a [`RenderJob`], and [`RenderJob::render`] renders it to a
//! film. For several pictures, moments and cameras, and for the fingerprint before anything is built, there is [`Session`].
//! Independent of command lines, animations and windows.
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

pub mod camera;
mod look;
mod messages;
pub mod metadata;
pub mod pixel;
mod session;
mod settings;

pub use crate::effects::PlanSettings;
pub use crate::render::{RenderControl, Statistics};
pub use crate::shading::ShadingMode;
pub use messages::findings::{Findings, warn_of_indices};
pub use messages::notes::{HEADLIGHT, notes_of_result};
pub use messages::unused::{PictureUse, warn_of_unused};
pub use metadata::Metadata;
pub use session::memory::check_memory;
pub use session::prepared::scene_at;
pub use session::prepared::{PreparedScene, SceneAtTime};
pub use session::resolved::ResolvedPicture;
pub use session::{Picture, Session};
pub use settings::options::{PictureOptions, Threads};
pub use settings::{CameraChoice, EnvironmentSettings, RenderSettings, check_display};

use camera::lens;
use messages::findings;
use session::memory;

use std::sync::{Arc, OnceLock};

use crate::effects::Plan;
use crate::effects::tile::RenderContext;
use crate::error::{Result, Warnings};
use crate::farm::Shard;
use crate::film::write::{ALPHA, Channel, OutputImage};
use crate::film::{ColourPipeline, DisplaySettings, Film, Pixel, Window};
use crate::render::aov::{self, AovSource};
use crate::render::render_displayed;
use crate::scene::{BitDepth, Camera, Sampling, Scene};
use crate::world::{Recentering, View, World};

/// The error by rounding display values to 8 bits.
pub struct RoundingError {
    /// The largest, in steps of 255; `None` without a bound.
    pub largest: Option<f64>,
    /// What it is.
    pub text: &'static str,
    /// The options that avoid it.
    pub option: &'static str,
}

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
    pub plan_settings: PlanSettings,
    /// Stages for the world and the plan settings.
    pub plan: Plan,
    /// Metadata of the picture.
    pub metadata: Metadata,
    /// Automatic exposure in EV, once metered.
    pub(crate) auto_exposure: OnceLock<f64>,
    /// What the picture is made of, for messages.
    pub(crate) source: Arc<findings::Source>,
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
        mut plan_settings: PlanSettings,
    ) -> Result<Self> {
        let mut view = View::new(&camera, camera.projection, size)?;
        lens::set(&mut view, &mut plan_settings, &camera, &world, recentering.as_ref())?;
        let plan = Plan::new(&world, &plan_settings)?;
        memory::check_lights(&world, &plan)?;
        let window = Window { x: 0, y: 0, width: size[0], height: size[1] };
        Ok(RenderJob {
            world,
            recentering,
            camera,
            view,
            window,
            settings: RenderSettings::default(),
            plan_settings,
            plan,
            metadata: Metadata::new(),
            auto_exposure: OnceLock::new(),
            source: Arc::default(),
        })
    }

    /// The same picture with other plan settings; the world and the lens are shared.
    ///
    /// # Errors
    /// As [`Plan::new`].
    pub fn with_plan_settings(&self, plan_settings: PlanSettings) -> Result<Self> {
        let plan_settings = PlanSettings { lens: self.plan_settings.lens.clone(), ..plan_settings };
        let plan = Plan::new(&self.world, &plan_settings)?;
        let RenderJob { world, recentering, camera, view, window, settings, metadata, source, .. } = self;
        Ok(RenderJob {
            world: Arc::clone(world),
            recentering: *recentering,
            camera: camera.clone(),
            view: view.clone(),
            window: *window,
            settings: settings.clone(),
            plan_settings,
            plan,
            metadata: metadata.clone(),
            auto_exposure: OnceLock::new(),
            source: Arc::clone(source),
        })
    }

    /// The whole picture in another size; the world is shared.
    ///
    /// # Errors
    /// As [`RenderJob::new`].
    pub fn with_size(&self, size: [u32; 2]) -> Result<Self> {
        let RenderJob { world, recentering, camera, plan_settings, .. } = self;
        let job =
            RenderJob::new(Arc::clone(world), *recentering, camera.clone(), size, plan_settings.clone())?;
        let settings = RenderSettings { shard: Shard::ALL, ..self.settings.clone() };
        Ok(RenderJob { settings, ..job })
    }

    /// Replaces the sampling settings and updates the plan.
    ///
    /// # Errors
    /// As [`Plan::new`].
    pub fn set_sampling(&mut self, sampling: Sampling) -> Result<()> {
        self.plan_settings.sampling = sampling;
        self.plan = Plan::new(&self.world, &self.plan_settings)?;
        Ok(())
    }

    /// Adapts fill light that depends on the exposure ([`crate::scene::Fill::is_exposed`]).
    pub fn expose_fill(&mut self, ev: Option<f64>) {
        if let Some(world) = self.world.with_exposed_fill(ev) {
            self.world = Arc::new(world);
        }
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
    /// [`crate::error::Error::Interrupted`] if cancelled, [`crate::error::Error::Memory`] if there is not enough memory for
    /// the picture.
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

    /// Renders the picture in display values, as image files of integers hold it: of 8 or 16 bits, with or without alpha.
    ///
    /// # Errors
    /// As [`RenderJob::render`].
    pub fn render_image(&self, control: &RenderControl) -> Result<(OutputImage, Statistics)> {
        let (pipeline, is_selected) =
            (self.pipeline(), |place: usize, _: Window| self.settings.shard.has(place));
        if self.is_transparent() {
            let (film, statistics) = self.render_to_develop::<[f32; 4]>(is_selected, control)?;
            let (film, alpha) = film.split_alpha()?;
            let display = self.display_transform(control)?;
            return Ok((OutputImage::displayed(&film, Some(&alpha), pipeline, display)?, statistics));
        }
        if self.display().rounding.is_16_bit {
            let (film, statistics) = self.render_to_develop(is_selected, control)?;
            let display = self.display_transform(control)?;
            return Ok((OutputImage::displayed(&film, None, pipeline, display)?, statistics));
        }
        let (film, statistics) = self.render(control)?;
        Ok((OutputImage::Rgb8(film, pipeline), statistics))
    }

    /// The automatic exposure in EV, if it has been metered.
    pub fn metered_exposure(&self) -> Option<f64> {
        self.auto_exposure.get().copied()
    }

    /// Takes over the automatic exposure that another job of the picture has metered.
    pub fn expose_as(&self, other: &RenderJob) {
        if let Some(ev) = other.metered_exposure() {
            self.auto_exposure.get_or_init(|| ev);
        }
    }

    /// The error by rounding display values to 8 bits; `None` where values have more bits.
    pub fn rounding_error(&self) -> Option<RoundingError> {
        let picture = &self.settings.picture;
        if picture.bits.is_some_and(|bits| bits != BitDepth::Eight) {
            return None;
        }
        // Noise of a triangular distribution two levels wide has a variance of 1/6, rounding after it one of 1/12.
        let (largest, text, option) = match (self.pipeline(), picture.dither) {
            (ColourPipeline::U8, _) => (None, "rounded after each step: no bound", "--colour display"),
            (_, Some(true)) => (Some(1.5), "dithered: up to 1.5 of 255, RMS 0.5", "--bits 16, .exr"),
            _ => (Some(0.5), "up to 0.5 of 255, RMS 0.29", "--bits 16, .exr"),
        };
        Some(RoundingError { largest, text, option })
    }

    /// Renders the picture in `f32`, with a channel of alpha if it is transparent; to be developed by
    /// [`RenderJob::display`] if `is_displayed`.
    ///
    /// # Errors
    /// As [`RenderJob::render`].
    pub fn render_float(
        &self,
        is_displayed: bool,
        control: &RenderControl,
    ) -> Result<(Film, Option<Channel>, Statistics)> {
        let is_selected = |place: usize, _: Window| self.settings.shard.has(place);
        if !self.is_transparent() {
            let (film, statistics) = self.render_as(is_displayed, is_selected, control)?;
            return Ok((film, None, statistics));
        }
        let (film, statistics) = self.render_as::<[f32; 4]>(is_displayed, is_selected, control)?;
        let (film, values) = film.split_alpha()?;
        Ok((film, Some(Channel { name: ALPHA.into(), values }), statistics))
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
        render_displayed(&context, &self.plan, self.window, is_selected, control)
    }

    /// The channels of AOVs of these names ([`aov::AOVS`]), row by row from the top.
    ///
    /// # Errors
    /// As [`aov::AovSelection::new`] and [`aov::channels`].
    pub fn aovs(&self, names: &[&str], control: &RenderControl) -> Result<Vec<Channel>> {
        let names: Vec<String> = names.iter().copied().map(str::to_owned).collect();
        aov::channels(&self.aov_source(None), &aov::AovSelection::new(&names)?, control)
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

/// Prepares a scene for rendering.
///
/// # Errors
/// [`crate::error::Error::Usage`] for invalid settings, [`crate::error::Error::Input`] for a scene that cannot be
/// rendered.
pub fn prepare(scene: Scene, settings: &RenderSettings, warnings: &mut Warnings) -> Result<RenderJob> {
    let session = Session::still(scene)?;
    let resolved = session.resolve(settings, warnings)?;
    session.into_job(&resolved, false, &RenderControl::default(), warnings)
}
