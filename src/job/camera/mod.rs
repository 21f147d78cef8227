//! Camera and picture size from settings and scene.

pub(crate) mod lens;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::{CameraChoice, RenderSettings};
use crate::error::{Error, Result, Warnings, nearest_name};
use crate::film::Window;
use crate::job::messages::outside;
use crate::scene::mesh::support::PointTrees;
use crate::scene::{Camera, Scene, bounds, default_size};
use crate::world::{Recentering, StandardView};

/// A camera, given or to be fitted.
// Few values exist at a time.
#[allow(clippy::large_enum_variant)]
pub enum Viewpoint {
    /// A camera of the scene, by its index.
    OfScene(usize),
    /// A camera in coordinates of the scene.
    Given(Camera),
    /// A camera to be fitted to the scene, from this side.
    Fitted(StandardView),
}

/// The camera of a picture, and how it moves.
#[derive(Clone)]
// Few values exist at a time.
#[allow(clippy::large_enum_variant)]
pub(crate) enum Mount {
    /// A camera of the scene, by its index. Tracks and clips may move it.
    OfScene(usize),
    /// A camera that stays, in coordinates of the scene.
    Given(Camera),
    /// A camera that stays, fitted to the recentered scene in its coordinates.
    Fitted(Camera),
    /// A scene of a camera alone, whose animation moves it.
    Orbit(Arc<Scene>),
}

impl Mount {
    /// The camera before anything moves, in coordinates of the recentered scene.
    pub(super) fn at_rest(&self, scene: &Scene, recentering: Option<&Recentering>) -> Camera {
        let own = match self {
            Mount::OfScene(index) => return scene.cameras[*index].clone(),
            Mount::Fitted(camera) => return camera.clone(),
            Mount::Given(camera) => camera,
            Mount::Orbit(orbit) => &orbit.cameras[0],
        };
        recentering.map_or_else(|| own.clone(), |recentering| recentering.moved(own))
    }
}

impl Viewpoint {
    /// The viewpoint for `choice`.
    ///
    /// # Errors
    /// [`Error::Usage`] if there is no such camera.
    pub fn of(choice: &CameraChoice, scene: &Scene) -> Result<Viewpoint> {
        let cameras = &scene.cameras;
        match choice {
            CameraChoice::Fitted(view) => Ok(Viewpoint::Fitted(*view)),
            CameraChoice::Given(camera) => Ok(Viewpoint::Given(camera.clone())),
            CameraChoice::Index(index) => Ok(Viewpoint::OfScene(*index)),
            CameraChoice::Named(name) => {
                let by_name = || cameras.iter().position(|camera| camera.name == *name);
                let by_index = || name.parse().ok().filter(|index| *index < cameras.len());
                by_name().or_else(by_index).map(Viewpoint::OfScene).ok_or_else(|| {
                    let known: Vec<&str> = cameras.iter().map(|camera| camera.name.as_str()).collect();
                    let hint = match known.as_slice() {
                        _ if name.contains('=') => {
                            "write keys in braces: '{ position = [0, 1, 6], look_at = [0, 1, 0] }'".into()
                        }
                        [] => "the scene has none; leave --camera out, or use --view".into(),
                        known => nearest_name(name, known),
                    };
                    Error::usage(format!("there is no camera `{name}`"), hint)
                })
            }
            CameraChoice::Default => Ok(match scene.default_camera() {
                Some(_) => Viewpoint::OfScene(0),
                None => Viewpoint::Fitted(StandardView::Auto),
            }),
        }
    }

    /// The camera, unless it is to be fitted.
    fn camera<'a>(&'a self, scene: &'a Scene) -> Option<&'a Camera> {
        match self {
            Viewpoint::OfScene(index) => scene.cameras.get(*index),
            Viewpoint::Given(camera) => Some(camera),
            Viewpoint::Fitted(_) => None,
        }
    }

    /// Notes why cameras of the files are not used, and warns of options of automatic cameras that change nothing.
    pub fn report(&self, settings: &RenderSettings, scene: &Scene, warnings: &mut Warnings) {
        let mut framing = settings.picture.or(scene.picture).of_automatic_camera();
        framing.extend(settings.look_at.iter().map(|_| "--look-at".to_owned()));
        match (self, self.camera(scene)) {
            (_, Some(camera)) if !framing.is_empty() => warnings.push(format!(
                "{} changes nothing: the camera is `{}`, not automatic; give --camera auto, or --view",
                framing.join(", "),
                camera.name
            )),
            (Viewpoint::Fitted(_), _)
                if settings.camera == CameraChoice::Default && !scene.cameras.is_empty() =>
            {
                warnings.note(
                    "several files: the automatic camera shows them all; --camera NAME chooses one of their own",
                );
            }
            _ => {}
        }
        if matches!(self, Viewpoint::Fitted(_)) && scene.inputs.len() > 1 && !scene.has_settings {
            note_small_inputs(scene, warnings);
        }
        if matches!(self, Viewpoint::Fitted(_)) && settings.look_at.is_none() {
            outside::note_distant(scene, warnings);
            if scene.has_settings {
                outside::warn_of_large(scene, warnings);
            }
        }
        if let Some(camera) = self.camera(scene) {
            note_other_aspect(camera, settings, self.size(settings, scene), warnings);
        }
        let projection = settings.projection.unwrap_or_default();
        let (names, hint) = projection.unused_framing();
        let unused: Vec<&str> =
            names.iter().copied().filter(|&name| framing.iter().any(|one| one == name)).collect();
        if matches!(self, Viewpoint::Fitted(_)) && !unused.is_empty() {
            let (names, projection) = (unused.join(", "), projection.name());
            warnings.push(format!("{names} has no effect with the projection {projection}{hint}"));
        }
        if matches!(self, Viewpoint::Fitted(_)) && projection.shows_all_directions() {
            warnings
                .note("the panorama is seen from the middle of the scene; --camera sets another position");
        }
    }

    /// Size of the picture in pixels.
    pub fn size(&self, settings: &RenderSettings, scene: &Scene) -> [u32; 2] {
        let camera = self.camera(scene);
        let own = camera.map(|camera| camera.projection).unwrap_or_default();
        let projection = settings.projection.unwrap_or(own);
        let size = || default_size(scene.picture.size(), camera, projection);
        let size = settings.picture.size().unwrap_or_else(size);
        match settings.longest_side {
            Some(longest) if settings.picture.size().is_none() && settings.crop.is_none() => {
                no_longer_than(longest, size)
            }
            _ => size,
        }
    }
}

/// Notes that a picture shows more than the viewing rectangle of its camera, by a pixel or more.
fn note_other_aspect(
    camera: &Camera,
    settings: &RenderSettings,
    [width, height]: [u32; 2],
    warnings: &mut Warnings,
) {
    if settings.projection.unwrap_or(camera.projection).shows_all_directions() {
        return;
    }
    let Some(view_width) = camera.view_width.filter(|_| !camera.sensor.oblong_pixels) else { return };
    let (of_camera, [x, y]) = (view_width / camera.view_height, [width, height].map(f64::from));
    if (x - y * of_camera).abs().min((y - x / of_camera).abs()) >= 1.0 {
        warnings.note(format!(
            "the picture is {:.4} times as wide as high, the viewing rectangle of camera `{}` {of_camera:.4} times: pixels \
             are square and the picture shows more; `oblong_pixels = true` in a camera of a scene file shows the rectangle alone",
            x / y,
            camera.name
        ));
    }
}

/// The size of the objects of an input, as a share of those of the largest, below which a note names it.
const SMALL: f64 = 0.02;

/// Notes the mesh files whose objects are much smaller than those of another, as files in other units are.
fn note_small_inputs(scene: &Scene, warnings: &mut Warnings) {
    let trees = PointTrees::of(&scene.objects);
    let of_inputs = scene.objects.chunk_by(|a, b| a.input == b.input);
    let sizes = of_inputs.filter_map(|objects| {
        let (min, max) = bounds(&trees, objects)?;
        Some(((max - min).length(), scene.inputs[objects[0].input].display()))
    });
    let sizes: Vec<_> = sizes.collect();
    let Some((most, largest)) = sizes.iter().max_by(|a, b| a.0.total_cmp(&b.0)) else { return };
    for (size, file) in sizes.iter().filter(|(size, _)| *size < SMALL * most) {
        let percent = (100.0 * size / most) as f32;
        warnings.note(format!(
            "{file} is {percent:.2} % as large as {largest}; a scene file places meshes with a scale"
        ));
    }
}

/// The error for a scene without objects, to which no camera can be fitted.
pub fn nothing_to_look_at(scene: &Scene, settings: &RenderSettings) -> Error {
    if let Some(name) = &settings.look_at {
        let hint = "its triangles have no area; name another object, or another --time";
        return Error::usage(format!("--look-at: nothing of `{name}` can be seen"), hint);
    }
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
