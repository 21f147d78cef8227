//! [`DefaultLook`]: light, ground, background and settings of a picture of a scene.

use super::{Background, Camera, Environment, Fill, Ground, PictureSettings, Scene, Transport};
use crate::film::Colour;

/// Resolved look of a picture: settings, light, ground and background of the files and options, completed by the default
/// look. In scene coordinates.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct DefaultLook {
    /// Settings of the picture: those of options, of the scene, then of the look.
    pub picture: PictureSettings,
    /// Names of the materials that need path tracing. `None` if none does or if the transport is set.
    pub path_tracing_reason: Option<String>,
    /// Intensity of the ambient light, per unit of a material's ambient coefficient.
    pub ambient: Option<f64>,
    /// Fill light of local shading.
    pub fill: Option<Fill>,
    /// Light from infinitely far away.
    pub environment: Option<Environment>,
    /// The light that is added, and follows the camera.
    pub light: Option<AddedLight>,
    /// The ground under the scene, as it is under the objects before anything moves.
    pub ground: Option<Ground>,
    /// Colour of rays that hit nothing, where the settings give no background.
    pub background: Option<Colour>,
    /// Whether the background is a backdrop: put behind the picture after exposure and tone map, in the colour that it
    /// has without them.
    pub has_backdrop: bool,
    /// Notes on what was decided, and why.
    pub notes: Vec<String>,
    /// Note on what is added to every picture of files without lights.
    pub usual_note: Option<String>,
}

impl DefaultLook {
    /// What the files of a scene say, with these settings; nothing is added.
    pub fn of_files(scene: &Scene, picture: PictureSettings) -> Self {
        DefaultLook {
            picture,
            ambient: scene.ambient,
            environment: scene.environment.clone(),
            background: scene.background,
            ..DefaultLook::default()
        }
    }

    /// The background of the settings, or that of the scene or the look.
    pub fn background(&self) -> Option<Colour> {
        self.picture.background.map(Background::colour).or(self.background)
    }

    /// Leaves the ground out if the camera is not above it, and returns whether it did. A ground requested by the
    /// settings stays.
    pub fn hide_ground(&mut self, camera: &Camera) -> bool {
        let is_hidden = self.ground.is_some_and(|ground| ground.is_hidden_from(camera));
        if is_hidden {
            self.ground = None;
            self.picture.ground = Some(false);
        }
        is_hidden
    }

    /// Whether camera rays see the environment, which then is the background.
    pub fn shows_environment(&self) -> bool {
        self.environment.as_ref().is_some_and(|environment| !environment.is_hidden)
    }

    /// The transport that is chosen, or that the scene calls for: [`Transport::called_for`].
    pub fn transport(&self, scene: &Scene) -> Transport {
        let has_area_light = scene.lights.iter().any(|light| light.kind.is_area());
        let (has_environment, has_reason) = (self.environment.is_some(), self.path_tracing_reason.is_some());
        Transport::called_for(self.picture.transport, has_environment, has_area_light, has_reason).0
    }
}

/// The light that is added to a scene, and follows the camera.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AddedLight {
    /// Headlight of a scene without lights.
    Headlight,
    /// Key light of the default look.
    Key,
}
