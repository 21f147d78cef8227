//! Resolves a scene and settings: camera, look, plan settings and metadata, before the acceleration structure is built.

use std::borrow::Cow;

use glam::DVec3;

use super::camera::{self, Viewpoint};
use super::metadata::{self, Metadata};
use super::{
    CameraChoice, PlanSettings, PreparedScene, RenderControl, RenderJob, RenderSettings, check_display,
    check_memory, lens, metering, notes, outside,
};
use crate::bvh::Layout;
use crate::effects::{PathSettings, check_names, check_scene, id};
use crate::error::{Error, Result, Warnings};
use crate::film::Window;
use crate::import::check_drawable;
use crate::scene::animation::Moment;
use crate::scene::{
    Bounces, Camera, Clamp, DefaultLook, EffectsSection, Light, Numerics, PictureSettings, Projection, Scene,
};
use crate::world::{Recentering, StandardView, View, opening, recenter};

/// The camera, region, settings and metadata of a picture, without its scene.
#[derive(Clone)]
pub struct ResolvedPicture {
    /// Camera with the projection used.
    pub camera: Camera,
    /// Region of the picture that is rendered.
    pub window: Window,
    /// The settings: those that were given, and those of the scene. Size, pipeline and tier of the picture are set.
    pub settings: RenderSettings,
    /// Shading mode, sampling and effect settings.
    pub plan_settings: PlanSettings,
    /// Metadata of the picture.
    pub metadata: Metadata,
    /// Whether the exposure is metered before the picture is rendered, as the default look says.
    pub meters: bool,
}

/// A scene with all settings resolved, before the acceleration structure is built.
pub struct ResolvedJob {
    /// The scene, recentered, with the light that is added.
    pub scene: Scene,
    /// Its look, recentered.
    pub look: DefaultLook,
    /// Transform applied to the scene, if any.
    pub recentering: Option<Recentering>,
    /// Camera, settings and metadata.
    pub picture: ResolvedPicture,
}

/// Resolves scene and settings as far as possible without an acceleration structure.
///
/// # Errors
/// As [`super::prepare`].
pub fn resolve(mut scene: Scene, settings: &RenderSettings, warnings: &mut Warnings) -> Result<ResolvedJob> {
    check_names(&settings.with, &settings.without)?;
    check_scene(&scene.effects)?;
    check_drawable(&scene)?;
    let look = settings.default_look(&scene, warnings)?;
    let recentering = recenter(&mut scene);
    let look = look.recentered(recentering.as_ref());
    notes::warn_of_recentering(recentering.as_ref(), warnings);
    let (camera, size) = camera_of(&scene, recentering.as_ref(), settings, warnings)?;
    if let Some(light) = look.light {
        scene.lights.extend(light.at(&camera));
        light.note(warnings);
    }
    resolve_for(scene, look, recentering, camera, size, settings)
}

/// The camera and the size of a picture of a recentered scene, in its coordinates. Notes what it does not show.
///
/// # Errors
/// As those of [`Viewpoint::camera`] and [`View::new`].
pub(super) fn camera_of(
    scene: &Scene,
    recentering: Option<&Recentering>,
    settings: &RenderSettings,
    warnings: &mut Warnings,
) -> Result<(Camera, [u32; 2])> {
    let viewpoint = Viewpoint::of(&settings.camera, scene, recentering)?;
    viewpoint.report(settings, scene, warnings);
    let is_of_mesh_file = !scene.has_settings && matches!(viewpoint, Viewpoint::Camera(Cow::Borrowed(_)));
    if matches!(viewpoint, Viewpoint::Fitted(StandardView::Auto))
        && !settings.projection.is_some_and(Projection::shows_all_directions)
    {
        let has_default_view = settings.camera == CameraChoice::Default && settings.picture.azimuth.is_none();
        match opening(&*settings.looked_at(scene)?) {
            Some(opening) if !opening.is_flat => {
                warnings.note("the surface is open to one side; the camera looks in from there");
            }
            None if has_default_view && !scene.has_settings => {
                warnings.note("the camera looks from +z; --azimuth 180 shows the back");
            }
            _ => {}
        }
    }
    let is_from_side = matches!(viewpoint, Viewpoint::Fitted(view) if view != StandardView::Auto);
    let size = viewpoint.size(settings, scene);
    let camera = viewpoint.camera(settings, scene, size)?;
    let projection = settings.projection.unwrap_or(camera.projection);
    // Files place their objects for their cameras; a scene file is written by hand. A view from a side may see an edge.
    if settings.look_at.is_none() && (scene.has_settings || is_of_mesh_file || is_from_side) {
        let view = View::new(&camera, projection, size)?;
        if scene.has_settings {
            outside::warn(scene, &view, recentering, warnings);
        }
        if !projection.shows_all_directions() {
            outside::note_framing(scene, &camera, &view, is_of_mesh_file, warnings);
        }
    }
    Ok((camera, size))
}

/// The picture of a scene with its look by a camera, without metadata. `bounds` are those of the scene, if they are
/// needed. The ground of the look is left out if the camera is not above it; a ground requested by the settings stays.
/// The camera, the scene and the look have the same coordinates.
///
/// # Errors
/// [`Error::Usage`] for invalid settings.
pub(crate) fn resolve_picture(
    (scene, bounds): (&Scene, &dyn Fn() -> Option<(DVec3, DVec3)>),
    look: &mut DefaultLook,
    mut camera: Camera,
    size: [u32; 2],
    settings: &RenderSettings,
) -> Result<ResolvedPicture> {
    look.hide_ground(&camera);
    let meters = metering::leave_to_metering(look, scene, bounds, settings, &camera);
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
        numerics: Some(look.picture.numerics()),
        ground: look.ground.map(|_| true),
        ..PictureSettings::of_size(size)
    }
    .or(look.picture);
    let plan_settings = plan_settings(&mut look.picture, scene.effects.clone(), &camera, settings)?;
    let settings = RenderSettings { picture: look.picture, ..settings.clone() };
    Ok(ResolvedPicture { camera, window, settings, plan_settings, metadata: Metadata::new(), meters })
}

/// [`resolve`] for a scene with its look and a given camera.
///
/// # Errors
/// [`Error::Usage`] for invalid settings.
pub fn resolve_for(
    scene: Scene,
    mut look: DefaultLook,
    recentering: Option<Recentering>,
    camera: Camera,
    size: [u32; 2],
    settings: &RenderSettings,
) -> Result<ResolvedJob> {
    let picture = resolve_picture((&scene, &|| scene.bounds()), &mut look, camera, size, settings)?;
    let picture = picture.with_metadata((&scene, None, &look), recentering.as_ref(), settings);
    Ok(ResolvedJob { scene, look, recentering, picture })
}

/// Shading mode, sampling and effect settings of a picture by a camera. A picture with a lens gets the samples that it
/// needs.
///
/// # Errors
/// [`Error::Usage`] for a lens of an orthographic camera.
fn plan_settings(
    picture: &mut PictureSettings,
    scene: EffectsSection,
    camera: &Camera,
    settings: &RenderSettings,
) -> Result<PlanSettings> {
    let mut plan_settings = PlanSettings {
        shading: picture.shading(),
        sampling: picture.sampling(),
        scene,
        transport: picture.transport,
        clamp: picture.clamp.map(Clamp::get),
        path: PathSettings {
            depth_specular: picture.depth_specular.map(Bounces::get),
            ..PathSettings::default()
        },
        cull: picture.cull == Some(true),
        with: settings.with.clone(),
        without: settings.without.clone(),
        stand_in: settings.depth.map(|depth| (id::PATH.with_value(depth), format!("--depth {depth}"))),
        ..PlanSettings::default()
    };
    lens::complete(picture, &mut plan_settings, camera)?;
    Ok(plan_settings)
}

impl ResolvedPicture {
    /// The picture with its metadata: of the scene, the light that is added to it, its look, and the settings that were
    /// given.
    pub(super) fn with_metadata(
        mut self,
        scene: (&Scene, Option<&Light>, &DefaultLook),
        recentering: Option<&Recentering>,
        settings: &RenderSettings,
    ) -> Self {
        self.metadata = metadata::metadata(scene, recentering, &self.camera, self.window, settings);
        if self.meters {
            metadata::add_to_fingerprint(&mut self.metadata, "metered", &true);
        }
        self
    }

    /// Width and height of the whole picture in pixels.
    pub fn size(&self) -> [u32; 2] {
        let Window { width, height, .. } = self.window;
        self.settings.picture.size().unwrap_or([width, height])
    }

    /// Arithmetic tier.
    pub fn numerics(&self) -> Numerics {
        self.settings.picture.numerics()
    }

    /// Layout and build preset of the acceleration structure.
    pub fn structure(&self) -> Layout {
        Layout::Wide(self.settings.preset)
    }
}

impl ResolvedJob {
    /// Builds the acceleration structure and the plan.
    ///
    /// # Errors
    /// As [`check_memory`] and [`RenderJob::new`].
    pub fn build(self, warnings: &mut Warnings) -> Result<RenderJob> {
        let ResolvedJob { scene, look, recentering, picture } = self;
        let (structure, numerics, meters) = (picture.structure(), picture.numerics(), picture.meters);
        check_memory(&scene, &picture.plan_settings, numerics)?;
        let pipeline = picture.settings.picture.pipeline();
        let moment = Moment::of_still(&scene);
        let scene = PreparedScene::at_rest(scene, &look, recentering, pipeline, structure, numerics);
        let job = scene.at(moment)?.job_for(picture)?;
        metered(job, meters, warnings)
    }
}

/// A job whose exposure is metered if `meters`, with the notes of both.
pub(super) fn metered(mut job: RenderJob, meters: bool, warnings: &mut Warnings) -> Result<RenderJob> {
    if meters {
        let ev = job.meter(&RenderControl::default())?;
        warnings.note(format!("the exposure is {ev} EV, metered; --exposure 0 turns this off"));
        notes::note_dark_environment(&job, ev, warnings);
    }
    notes::warn_of_job(&job, warnings);
    Ok(job)
}
