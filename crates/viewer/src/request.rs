//! Render requests of the viewer, as plain data: equal requests have equal pictures.

use std::sync::Arc;

use kiln::job::{CameraChoice, RenderSettings, Session};
use kiln::scene::animation::Moment;
use kiln::scene::{Camera, INLINE_NAME, PictureSettings, Projection, Scene};
use kiln::world::StandardView;

/// Camera of the viewer.
#[derive(Debug, Clone, PartialEq)]
// Few values exist at a time.
#[allow(clippy::large_enum_variant)]
pub enum CameraSource {
    /// A camera of the scene by its index, animated if the scene animates it.
    Scene(usize),
    /// A standard view that is fitted to the scene.
    Fitted(StandardView),
    /// A standard view that is fitted to the scene at a moment of its animation; to all of its clips without one.
    FittedAt(StandardView, Option<Moment>),
    /// A camera moved by the user, in scene coordinates.
    Free(Camera),
}

/// Opened input files.
#[derive(Clone)]
pub struct Opened {
    /// Pictures of the scene of all files.
    pub session: Arc<Session>,
    /// Initial camera.
    pub camera_source: CameraSource,
    /// Projection that overrides the camera's.
    pub projection: Option<Projection>,
    /// Initial render settings, with numerics and colour pipeline.
    pub settings: RenderSettings,
}

impl Opened {
    /// The scene of all files.
    pub fn scene(&self) -> &Scene {
        self.session.scene()
    }
}

/// Request for a picture.
#[derive(Clone)]
pub(crate) struct RenderRequest {
    /// Scene and files.
    pub opened: Arc<Opened>,
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// Camera.
    pub camera_source: CameraSource,
    /// Projection that overrides the camera's.
    pub projection: Option<Projection>,
    /// Moment of the animation.
    pub time: Moment,
    /// Displayed quantity: the picture or false colours.
    pub display_mode: super::false_colour::DisplayMode,
    /// Whether the animation plays, so that this picture has the time of one frame.
    pub is_playing: bool,
    /// Render settings but for camera, projection and size.
    pub settings: RenderSettings,
}

impl RenderRequest {
    /// The settings of `kiln render` for the picture.
    pub(crate) fn render_settings(&self) -> RenderSettings {
        let scene = self.opened.scene();
        let camera = match &self.camera_source {
            CameraSource::Scene(index) if *index < scene.cameras.len() => CameraChoice::Index(*index),
            // The files changed, and have fewer cameras.
            CameraSource::Scene(_) => CameraChoice::Default,
            CameraSource::Fitted(view) | CameraSource::FittedAt(view, _) => CameraChoice::Fitted(*view),
            CameraSource::Free(camera) => CameraChoice::Given(given(camera)),
        };
        let picture = PictureSettings::of_size(self.size).or(self.settings.picture).displayable();
        RenderSettings { camera, projection: self.projection, picture, ..self.settings.clone() }
    }
}

/// A camera moved by the user, as `kiln render` takes it: with a name only if it was fitted.
pub(super) fn given(camera: &Camera) -> Camera {
    let mut camera = camera.clone();
    if !camera.fitted {
        camera.name = INLINE_NAME.to_owned();
    }
    camera
}

impl PartialEq for RenderRequest {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.opened, &other.opened)
            && self.size == other.size
            && self.camera_source == other.camera_source
            && self.projection == other.projection
            && self.time == other.time
            && self.display_mode == other.display_mode
            && self.is_playing == other.is_playing
            && self.settings == other.settings
    }
}
