//! Which picture the user asks for: its size, its camera, and the part of it.

use std::borrow::Cow;
use std::path::{Path, PathBuf};

use super::arguments::Arguments;
use crate::animation::turntable;
use crate::error::{Error, Result};
use crate::film::Window;
use crate::import::inline_camera;
use crate::scene::file::nearest_name;
use crate::scene::{Camera, Projection, Scene, usual_size};
use crate::world::{Range, StandardView, fitted_camera};

/// Where the picture is seen from.
pub enum Choice<'a> {
    Camera(Cow<'a, Camera>),
    Fitted(StandardView),
}

/// The camera and the size of the picture. `range` is how the scene was moved, and a camera in braces is not yet.
pub fn choose(arguments: &Arguments, scene: &Scene, range: Option<&Range>) -> Result<(Camera, [u32; 2])> {
    let choice = choice(arguments, scene, range)?;
    let shown = if let Choice::Camera(camera) = &choice { Some(&**camera) } else { None };
    let size = arguments.size.unwrap_or_else(|| usual_size(scene.size, shown));
    let camera = match choice {
        Choice::Camera(camera) => camera.into_owned(),
        Choice::Fitted(view) => {
            let aspect = f64::from(size[0]) / f64::from(size[1]);
            let projection = arguments.projection().unwrap_or(Projection::Perspective);
            fitted_camera(scene, view, aspect, projection).ok_or_else(|| {
                let file = arguments.inputs.first().map_or(Path::new("-"), PathBuf::as_path);
                Error::input(
                    file,
                    "there is nothing in it to look at",
                    "`kiln info` says what the file holds",
                )
            })?
        }
    };
    Ok((camera, size))
}

/// The camera and the size of an animation's frames. One that says nothing of what moves becomes a turntable.
pub fn choose_for_frames(arguments: &Arguments, scene: &mut Scene) -> Result<(Camera, [u32; 2])> {
    if scene.animation.is_some() {
        return choose(arguments, scene, None);
    }
    let (camera, view) = match choice(arguments, scene, None)? {
        Choice::Camera(camera) => (Some(camera.into_owned()), StandardView::Auto),
        Choice::Fitted(view) => (None, view),
    };
    let size = arguments.size.unwrap_or_else(|| usual_size(scene.size, camera.as_ref()));
    let aspect = f64::from(size[0]) / f64::from(size[1]);
    let projection = arguments.projection().unwrap_or(Projection::Perspective);
    let camera = turntable(scene, camera, view, aspect, projection).map_err(|e| match e {
        Error::Failed { what, hint } => {
            Error::input(arguments.inputs.first().map_or(Path::new("-"), PathBuf::as_path), what, hint)
        }
        other => other,
    })?;
    Ok((camera, size))
}

/// The size of the picture for a choice of where it is seen from.
#[cfg(feature = "viewer")]
pub fn size(arguments: &Arguments, scene: &Scene, choice: &Choice) -> [u32; 2] {
    let shown = if let Choice::Camera(camera) = choice { Some(&**camera) } else { None };
    arguments.size.unwrap_or_else(|| usual_size(scene.size, shown))
}

/// Whether what is typed as a camera is one in braces rather than the name of one.
pub fn is_inline(typed: &str) -> bool {
    typed.trim_start().starts_with('{')
}

/// Where the user wants the picture to be seen from.
///
/// # Errors
/// [`Error::Usage`] where there is no such camera.
pub fn choice<'a>(arguments: &Arguments, scene: &'a Scene, range: Option<&Range>) -> Result<Choice<'a>> {
    if let Some(name) = &arguments.view {
        let view = StandardView::ALL.into_iter().find(|view| view.name() == name);
        return Ok(Choice::Fitted(view.unwrap_or(StandardView::Auto)));
    }
    match arguments.camera.as_deref() {
        Some("auto") => Ok(Choice::Fitted(StandardView::Auto)),
        Some(text) if is_inline(text) => {
            let camera = inline_camera(text)?;
            Ok(Choice::Camera(Cow::Owned(range.map_or(camera.clone(), |range| range.moved(&camera)))))
        }
        Some(name) => {
            let by_name = || scene.cameras.iter().find(|camera| camera.name == name);
            let by_index = || scene.cameras.get(name.parse::<usize>().ok()?);
            let own = |camera| Choice::Camera(Cow::Borrowed(camera));
            by_name().or_else(by_index).map(own).ok_or_else(|| {
                let known: Vec<&str> = scene.cameras.iter().map(|camera| camera.name.as_str()).collect();
                let hint = match known.as_slice() {
                    [] => "the scene has none; leave --camera out, or use --view".into(),
                    known => nearest_name(name, known),
                };
                Error::usage(format!("there is no camera `{name}`"), hint)
            })
        }
        None => Ok(scene
            .cameras
            .first()
            .map_or(Choice::Fitted(StandardView::Auto), |camera| Choice::Camera(Cow::Borrowed(camera)))),
    }
}

/// The same shape with no side longer than so many pixels.
pub fn no_longer_than(longest: u32, [width, height]: [u32; 2]) -> [u32; 2] {
    let scale = f64::from(longest) / f64::from(width.max(height).max(longest));
    [width, height].map(|side| ((f64::from(side) * scale).round() as u32).max(1))
}

/// The part of the picture to render.
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
