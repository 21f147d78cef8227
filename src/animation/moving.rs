//! Animations of scenes that have none: the clips of their files, or a turntable.

use crate::error::{Error, Result};
use crate::import;
use crate::scene::{Animation, Camera, Clip, ClipChoice, Projection, Scene};
use crate::world::{Framing, turntable_camera};

/// Makes an animation of a scene without one: plays the chosen clips of its files together, for as long as the longest,
/// and poses the scene at their beginning. Without clips nothing changes.
///
/// # Errors
/// [`Error::Usage`] for a scene from standard input, which cannot be read again, and those of [`import::reload`].
pub fn play_clip(scene: &mut Scene, clip: &ClipChoice) -> Result<()> {
    let clips: Vec<Clip> = clip.find(&scene.clips).into_iter().cloned().collect();
    if clips.is_empty() || scene.animation.is_some() {
        return Ok(());
    }
    if scene.inputs.iter().any(|input| input.as_os_str() == "-") {
        let hint = "name a file, or hold one moment by --time";
        return Err(Error::usage(
            "clips of standard input cannot be played: each frame reads the file again",
            hint,
        ));
    }
    // Without --clip, the first is played.
    let choices = if *clip == ClipChoice::First { &[] } else { clip.choices() };
    scene.import_options.clips = choices.to_vec();
    // The camera and the default look are made for this pose, as for a picture at this time.
    import::pose(scene, 0.0)?;
    let fps = Animation::FPS;
    // At least one frame.
    let duration = clips.iter().map(|clip| clip.duration).fold(1.0 / fps, f64::max);
    scene.animation = Some(Animation { fps, duration, repeat: true, tracks: Vec::new(), clips });
    Ok(())
}

/// Adds an animation to the scene: `camera` orbits once around the point it looks at. Without a camera, one that sees
/// the whole scene from all sides, beginning as `framing` says. Returns the camera; `None` for a scene without extent.
pub fn turntable(
    scene: &mut Scene,
    camera: Option<Camera>,
    framing: impl Into<Framing>,
    aspect: f64,
    projection: Projection,
) -> Option<Camera> {
    let (camera, around) = match camera {
        Some(camera) => {
            let target = camera.target;
            (camera, target)
        }
        None => turntable_camera(scene, framing, aspect, projection)?,
    };
    // The tracks name the camera, and would move another of the same name, too.
    scene.cameras.retain(|other| other.name != camera.name);
    scene.cameras.push(camera.clone());
    scene.animation = Some(Animation::orbit(&camera, around));
    Some(camera)
}
