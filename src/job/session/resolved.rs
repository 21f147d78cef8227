//! What a picture is: its camera, look and settings, before the acceleration structure is built.

use std::sync::{Arc, OnceLock};

use glam::DVec3;

use crate::bvh::detail::Layout;
use crate::effects::{PathSettings, id};
use crate::error::{Error, Result};
use crate::film::Window;
use crate::job::camera::lens;
use crate::job::camera::{self, Mount};
use crate::job::look::metering;
use crate::job::messages::findings::Source;
use crate::job::session::Exposed;
use crate::job::{Metadata, PlanSettings, RenderSettings, SceneAtTime, check_display};
use crate::scene::animation::Moment;
use crate::scene::{Bounces, Camera, Clamp, DefaultLook, EffectsSection, Numerics, PictureSettings, Scene};
use crate::world::{Recentering, View, WorldInputs};

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
    /// The look, in coordinates of the scene.
    pub look: DefaultLook,
    /// How the scene was recentered before anything moves.
    pub recentering: Option<Recentering>,
    /// How the camera moves.
    pub(crate) mount: Mount,
    /// The exposure of pictures of all moments, once it is metered.
    pub(crate) exposure: Arc<OnceLock<Exposed>>,
    /// What it is made of, for messages.
    pub(crate) source: Arc<Source>,
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
    Ok(ResolvedPicture {
        mount: Mount::Given(camera.clone()),
        camera,
        window,
        settings,
        plan_settings,
        metadata: Metadata::new(),
        meters,
        look: DefaultLook::default(),
        recentering: None,
        exposure: Arc::default(),
        source: Arc::default(),
    })
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

    /// What its world depends on besides the scene.
    pub fn world_inputs(&self) -> WorldInputs {
        let pipeline = self.settings.picture.pipeline();
        WorldInputs::new(&self.look, pipeline, self.structure(), self.numerics())
    }

    /// The camera at a moment, in coordinates of its world.
    ///
    /// # Errors
    /// As [`Scene::at`].
    pub(crate) fn camera_at(&self, scene: &SceneAtTime, moment: Moment) -> Result<Camera> {
        let by = scene.recentering;
        let moved = |camera: &Camera| by.map_or_else(|| camera.clone(), |by| by.moved(camera));
        let camera = match &self.mount {
            Mount::OfScene(index) => scene.cameras[*index].clone(),
            Mount::Given(camera) => moved(camera),
            // Without the rounding of a conversion to coordinates of the scene and back.
            Mount::Fitted(camera) if by == self.recentering => camera.clone(),
            Mount::Fitted(camera) => match self.recentering {
                Some(before) => moved(&before.moved_back(camera)),
                None => moved(camera),
            },
            Mount::Orbit(orbit) => moved(&orbit.at(moment.part)?.cameras[0]),
        };
        Ok(Camera { projection: self.camera.projection, ..camera })
    }
}
