//! What import options make of the files that were read: poses, normals and the up axis.

use std::path::Path;

use super::Source;
use crate::error::{Error, Result, Warnings};
use crate::import::meshes::up::{self, Guess};
use crate::scene::{ClipChoice, Degrees, ImportOptions, Scene, UpAxis};

/// The up axis of a mesh file: with `--up auto` (`turns`) that of the format's specification; in a format without one, z if
/// the mesh seems to stand upright in z, else y. Of several inputs none is turned, since they may be parts of one object.
/// Without `--up`, y. Notes say in which other axis a mesh seems to stand upright. Measurements: docs/decisions.md.
pub(super) fn up_axis(
    scene: &Scene,
    file: &Path,
    format: &str,
    turns: bool,
    is_alone: bool,
    warnings: &mut Warnings,
) -> UpAxis {
    let file_name = file.display();
    if format == "glTF" || !scene.cameras.is_empty() {
        return UpAxis::Y;
    }
    if format == "3MF" && turns {
        return UpAxis::Z;
    }
    match up::guess(scene) {
        Some(Guess { up: UpAxis::Z, is_sure: true }) if turns && is_alone => {
            warnings
                .note(format!("{file_name}: stands upright with z up, so it is turned; --up y keeps y up"));
            return UpAxis::Z;
        }
        Some(Guess { up: UpAxis::Y, .. }) => {}
        Some(Guess { up, is_sure }) => {
            let is_automatic = up == UpAxis::Z && is_sure && !turns;
            let (name, auto) = (up.name(), if is_automatic { ", --up auto all such files" } else { "" });
            warnings.note(format!(
                "{file_name}: seems to stand upright with {name} up; --up {name} turns it{auto}"
            ));
        }
        None if ["STL", "3MF"].contains(&format) => {
            warnings.note(format!("{file_name}: most {format} files have z up; --up z turns it"));
        }
        None => {}
    }
    UpAxis::Y
}

/// The crease angle in radians of the normals that a mesh file without normals gets, if any: the option's, else `own`, else
/// [`ImportOptions::CREASE`] if files are smoothed that are not flat by their format.
pub(super) fn crease(source: &Source, own: Option<Degrees>, smooths: bool) -> Option<f64> {
    let by_default = smooths && !source.importer.is_flat;
    let chosen = source.options.smooth.or(own).map(Degrees::get);
    let crease = chosen.or(by_default.then_some(ImportOptions::CREASE));
    crease.filter(|&degrees| degrees > 0.0).map(f64::to_radians)
}

/// Checks that an input has the requested clip and the requested variant.
pub(super) fn check_names(scene: &Scene, options: &ImportOptions) -> Result<()> {
    let list = |names: Vec<&str>| names.iter().map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ");
    let unknown = |kind: &str, name: &str, known: String| {
        Error::usage(format!("no input has a {kind} `{name}`"), format!("their {kind}s: {known}"))
    };
    // Tracks are posed by `pose_tracks`.
    let pose = options.pose().filter(|_| !has_tracks_alone(scene, options));
    let mut choices = pose.iter().flat_map(|asked| asked.clip.choices());
    if let Some(missing) = choices.find(|choice| choice.find(&scene.clips).is_empty()) {
        let names: Vec<&str> = scene.clips.iter().map(|clip| clip.name.as_str()).collect();
        return Err(match missing {
            ClipChoice::Named(clip) if !names.is_empty() => unknown("clip", clip, list(names)),
            _ => {
                let hint = "leave out --time and --clip, which choose a moment of a clip";
                Error::usage("no input has clips", hint)
            }
        });
    }
    match &options.variant {
        Some(_) if scene.variants.is_empty() => {
            Err(Error::usage("no input has variants of its materials", "leave out --variant"))
        }
        Some(name) if !scene.variants.contains(name) => {
            Err(unknown("variant", name, list(scene.variants.iter().map(String::as_str).collect())))
        }
        _ => Ok(()),
    }
}

/// Whether a moment of a scene is one of its tracks, not of clips.
fn has_tracks_alone(scene: &Scene, options: &ImportOptions) -> bool {
    scene.animation.is_some() && scene.clips.is_empty() && options.clips.is_empty()
}

/// Poses a scene with tracks at the time of the options, after which nothing moves.
///
/// # Errors
/// [`Error::Usage`] for a time that is not in its animation.
pub(super) fn pose_tracks(scene: &mut Scene, options: &ImportOptions) -> Result<()> {
    let (Some(time), Some(animation)) = (options.time, &scene.animation) else { return Ok(()) };
    if !has_tracks_alone(scene, options) {
        return Ok(());
    }
    let (time, duration) = (time.get(), animation.duration);
    if !(0.0..=duration).contains(&time) {
        let what = format!("--time {time}: the animation lasts from 0 to {duration} seconds");
        return Err(Error::usage(what, "give a time in it"));
    }
    *scene = Scene { animation: None, ..scene.at(time / duration)? };
    Ok(())
}
