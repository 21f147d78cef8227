//! Metadata of a picture: the settings that made it, and the fingerprint of everything that determines its pixels.

pub(crate) mod exr_attributes;

use crate::film::Window;
use crate::film::write::{CROP, FINGERPRINT, FRAME};
use crate::scene::animation::Moment;
use crate::scene::{Camera, DefaultLook, Fingerprint, Light, OptionValue, PictureSettings, Scene};
use crate::world::Recentering;

use super::RenderSettings;

/// Names and values written into image files. Identical runs write identical metadata.
pub type Metadata = Vec<(String, String)>;

/// Metadata key of the exposure in EV; `auto (EV)` where it was computed from the picture.
const EXPOSURE: &str = "kiln:exposure";

/// Adds the exposure that `auto` came to.
pub fn set_auto_exposure(metadata: &mut Metadata, ev: f64) {
    for (_, value) in metadata.iter_mut().filter(|(key, _)| key == EXPOSURE) {
        *value = format!("auto ({ev})");
    }
}

/// Adds the number of a frame.
pub fn set_frame(metadata: &mut Metadata, frame: i32) {
    metadata.push((FRAME.to_owned(), frame.to_string()));
}

/// The metadata of a picture of a scene with the light that is added to it, and its look. `recentering` is the
/// transform that was applied to the scene, and `camera` has the projection used. The region `window` is rendered.
pub fn metadata(
    (scene, added, look): (&Scene, Option<&Light>, &DefaultLook),
    recentering: Option<&Recentering>,
    camera: &Camera,
    window: Window,
    settings: &RenderSettings,
) -> Metadata {
    let RenderSettings { with, without, aovs, .. } = settings;
    // Folders are omitted, so that metadata does not depend on where files lie.
    let name = |input: &std::path::PathBuf| {
        input.file_name().unwrap_or(input.as_os_str()).to_string_lossy().into_owned()
    };
    let inputs: Vec<String> = scene.inputs.iter().map(name).collect();
    // A name selects the first camera of that name, unless `--camera` reads it as another value. The projection is
    // recorded beside it.
    let is_name = camera.name != "auto" && !camera.name.trim_start().starts_with('{');
    let named = scene.cameras.iter().find(|own| is_name && own.name == camera.name);
    let camera_text = match named {
        Some(own) if *own == (Camera { projection: own.projection, ..camera.clone() }) => camera.name.clone(),
        _ => recentering
            .map_or_else(|| camera.clone(), |recentering| recentering.moved_back(camera))
            .to_inline(),
    };
    let mut metadata = vec![
        ("Software".to_owned(), format!("kiln {}", env!("CARGO_PKG_VERSION"))),
        ("kiln:inputs".into(), inputs.join(" ")),
        ("kiln:camera".into(), camera_text),
        ("kiln:projection".into(), camera.projection.name().into()),
    ];
    // Frames have times of their own; what files may refer to and require does not change a picture.
    let others = ["clip", "time", "ignore-required-extensions", "allow-outside-references"];
    let of_import = scene.import_options.entries().into_iter();
    let of_import = of_import.filter(|(name, _)| !others.contains(&name.as_str()));
    metadata.extend(of_import.map(|(name, text)| (format!("kiln:{name}"), text)));
    metadata.extend(entries(&look.picture));
    let Window { x, y, width, height } = window;
    if look.picture.size() != Some([width, height]) {
        metadata.push((CROP.into(), window.text()));
    }
    for (key, names) in [("kiln:with", with), ("kiln:without", without)] {
        if !names.is_empty() {
            metadata.push((key.into(), names.join(" ")));
        }
    }
    let mut fingerprint = Fingerprint::default();
    fingerprint.scene(scene, added, look);
    fingerprint.value("range", &recentering.map(|recentering| (recentering.middle, recentering.scale)));
    fingerprint.value("camera", &(camera, (x, y, width, height)));
    fingerprint.value("effects", &(with, without));
    // Frames have their number.
    let Moment { seconds, .. } = Moment::of_still(scene);
    if seconds != 0.0 {
        fingerprint.value("grain", &seconds);
    }
    metadata.push((FINGERPRINT.to_owned(), fingerprint.finish()));
    if !aovs.is_empty() {
        // Their order does not change the file.
        let mut names = aovs.to_vec();
        names.sort_unstable();
        names.dedup();
        // The key is hashed, too: another one would change the fingerprint of every picture.
        add_to_fingerprint(&mut metadata, "layers", &names);
    }
    metadata
}

/// The metadata of picture settings: an entry for each option.
fn entries(picture: &PictureSettings) -> impl Iterator<Item = (String, String)> {
    picture.described().options().into_iter().map(|(name, text)| (format!("kiln:{name}"), text))
}

/// Replaces the entries of picture settings.
pub fn replace(metadata: &mut Metadata, picture: &PictureSettings) {
    let entries: Metadata = entries(picture).collect();
    metadata.retain(|(key, _)| !entries.iter().any(|(other, _)| other == key));
    metadata.extend(entries);
}

/// The fingerprint in metadata; empty if there is none.
pub fn fingerprint_of(metadata: &[(String, String)]) -> &str {
    metadata.iter().find(|(key, _)| key == FINGERPRINT).map_or("", |(_, value)| value)
}

/// Mixes a further value into the fingerprint.
pub fn add_to_fingerprint(metadata: &mut Metadata, name: &str, more: &impl serde::Serialize) {
    for (_, value) in metadata.iter_mut().filter(|(key, _)| key == FINGERPRINT) {
        let mut fingerprint = Fingerprint::default();
        fingerprint.value("picture", value);
        fingerprint.value(name, more);
        *value = fingerprint.finish();
    }
}
