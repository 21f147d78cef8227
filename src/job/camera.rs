//! Camera and picture size from settings and scene.

use std::borrow::Cow;
use std::path::{Path, PathBuf};

use super::{CameraChoice, RenderSettings};
use crate::error::{Error, Result, nearest_name};
use crate::film::Window;
use crate::scene::{Camera, Scene, default_size};
use crate::world::{Recentering, StandardView, fitted_camera};

/// A camera, given or to be fitted.
pub enum Viewpoint<'a> {
    /// A camera in the current coordinates of the scene.
    Camera(Cow<'a, Camera>),
    /// A camera to be fitted to the scene, from this side.
    Fitted(StandardView),
}

impl Viewpoint<'_> {
    /// The viewpoint for `choice`. `recentering` is the transform that was applied to the scene; it is applied to a
    /// given camera too.
    ///
    /// # Errors
    /// [`Error::Usage`] if there is no such camera.
    pub fn of<'a>(
        choice: &CameraChoice,
        scene: &'a Scene,
        recentering: Option<&Recentering>,
    ) -> Result<Viewpoint<'a>> {
        match choice {
            CameraChoice::Fitted(view) => Ok(Viewpoint::Fitted(*view)),
            CameraChoice::Given(camera) => {
                let moved =
                    recentering.map_or_else(|| camera.clone(), |recentering| recentering.moved(camera));
                Ok(Viewpoint::Camera(Cow::Owned(moved)))
            }
            CameraChoice::Named(name) => {
                let by_name = || scene.cameras.iter().find(|camera| camera.name == *name);
                let by_index = || scene.cameras.get(name.parse::<usize>().ok()?);
                let own = |camera| Viewpoint::Camera(Cow::Borrowed(camera));
                by_name().or_else(by_index).map(own).ok_or_else(|| {
                    let known: Vec<&str> = scene.cameras.iter().map(|camera| camera.name.as_str()).collect();
                    let hint = match known.as_slice() {
                        [] => "the scene has none; leave --camera out, or use --view".into(),
                        known => nearest_name(name, known),
                    };
                    Error::usage(format!("there is no camera `{name}`"), hint)
                })
            }
            CameraChoice::Default => Ok(match scene.cameras.first() {
                Some(camera) => Viewpoint::Camera(Cow::Borrowed(camera)),
                None => Viewpoint::Fitted(StandardView::Auto),
            }),
        }
    }

    /// Size of the picture in pixels.
    pub fn size(&self, settings: &RenderSettings, scene: &Scene) -> [u32; 2] {
        let camera = if let Viewpoint::Camera(camera) = self { Some(&**camera) } else { None };
        let size = settings.picture.size().unwrap_or_else(|| default_size(scene.picture.size(), camera));
        match settings.longest_side {
            Some(longest) if settings.picture.size().is_none() && settings.crop.is_none() => {
                no_longer_than(longest, size)
            }
            _ => size,
        }
    }

    /// Camera for a picture of `size`.
    ///
    /// # Errors
    /// [`Error::Input`] if the scene has no objects to fit a camera to.
    pub fn camera(self, settings: &RenderSettings, scene: &Scene, size: [u32; 2]) -> Result<Camera> {
        match self {
            Viewpoint::Camera(camera) => Ok(camera.into_owned()),
            Viewpoint::Fitted(view) => {
                let aspect = f64::from(size[0]) / f64::from(size[1]);
                let projection = settings.projection.unwrap_or_default();
                fitted_camera(scene, view, aspect, projection).ok_or_else(|| nothing_to_look_at(scene))
            }
        }
    }
}

/// The error for a scene without objects, to which no camera can be fitted.
pub fn nothing_to_look_at(scene: &Scene) -> Error {
    let file = scene.inputs.first().map_or(Path::new("-"), PathBuf::as_path);
    Error::input(file, "there is nothing in it to look at", "`kiln info` says what the file holds")
}

/// Scales a size down so that no side exceeds `longest` pixels, keeping the aspect ratio.
fn no_longer_than(longest: u32, [width, height]: [u32; 2]) -> [u32; 2] {
    let scale = f64::from(longest) / f64::from(width.max(height).max(longest));
    [width, height].map(|side| ((f64::from(side) * scale).round() as u32).max(1))
}

/// The region to render: `crop`, or the whole picture.
///
/// # Errors
/// [`Error::Usage`] if the crop extends outside the picture.
pub fn window(crop: Option<Window>, [width, height]: [u32; 2]) -> Result<Window> {
    let Some(crop) = crop else { return Ok(Window { x: 0, y: 0, width, height }) };
    let inside = |start: u32, size: u32, limit: u32| start.checked_add(size).is_some_and(|end| end <= limit);
    if inside(crop.x, crop.width, width) && inside(crop.y, crop.height, height) {
        return Ok(crop);
    }
    Err(Error::usage(
        format!("the crop reaches outside the picture of {width} x {height} pixels"),
        "make it smaller, or give a larger --size",
    ))
}
