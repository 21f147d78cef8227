//! Metadata of a picture: the settings that made it, and the fingerprint of everything that determines its pixels.

use crate::effects::Choices;
use crate::film::write::FINGERPRINT;
use crate::film::{ColourPipeline, DisplaySettings, Window};
use crate::scene::{Camera, Fingerprint, INLINE_NAME, Numerics, Scene};
use crate::world::Recentering;

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

/// Settings that determine a picture of a scene.
pub struct Origin<'a> {
    /// Transform applied to the scene, if any.
    pub recentering: Option<&'a Recentering>,
    /// Camera with the projection used.
    pub camera: &'a Camera,
    /// Width and height of the whole picture in pixels.
    pub size: [u32; 2],
    /// Region of the picture that is rendered.
    pub window: Window,
    /// Shading mode, sampling and effect settings.
    pub choices: &'a Choices,
    /// The colour pipeline.
    pub pipeline: ColourPipeline,
    /// Arithmetic tier.
    pub numerics: Numerics,
    /// Names of AOVs.
    pub aovs: &'a [String],
    /// Exposure and tone map.
    pub display: DisplaySettings,
    /// Whether a scene without lights gets a headlight.
    pub headlight: bool,
}

/// The metadata of a picture.
pub fn metadata(scene: &Scene, origin: &Origin) -> Metadata {
    let &Origin { recentering, camera, size, window, choices, pipeline, numerics, aovs, display, headlight } =
        origin;
    // The technique and the settings of paths do not change the expected picture, and no option sets them.
    let Choices {
        shading,
        sampling,
        scene: _,
        transport,
        clamp,
        with,
        without,
        even_idle: _,
        light_technique: _,
        path: _,
    } = choices;
    // Folders are omitted, so that metadata does not depend on where files lie.
    let name = |input: &std::path::PathBuf| {
        input.file_name().unwrap_or(input.as_os_str()).to_string_lossy().into_owned()
    };
    let inputs: Vec<String> = scene.inputs.iter().map(name).collect();
    let camera_name = if camera.name == INLINE_NAME {
        let moved_back =
            recentering.map_or_else(|| camera.clone(), |recentering| recentering.moved_back(camera));
        moved_back.to_inline()
    } else {
        camera.name.clone()
    };
    let mut metadata = vec![
        ("Software".to_owned(), format!("kiln {}", env!("CARGO_PKG_VERSION"))),
        ("kiln:inputs".into(), inputs.join(" ")),
        ("kiln:camera".into(), camera_name),
        ("kiln:projection".into(), camera.projection.name().into()),
        ("kiln:size".into(), format!("{}x{}", size[0], size[1])),
        ("kiln:colour".into(), pipeline.name().into()),
        ("kiln:numerics".into(), numerics.name().into()),
        ("kiln:shading".into(), shading.name().into()),
    ];
    let Window { x, y, width, height } = window;
    if [width, height] != size {
        metadata.push(("kiln:crop".into(), format!("{x},{y},{width},{height}")));
    }
    if let Some(transport) = transport {
        metadata.push(("kiln:transport".into(), transport.name().into()));
    }
    metadata.extend(clamp.map(|clamp| ("kiln:clamp".to_owned(), clamp.to_string())));
    for (key, names) in [("kiln:with", with), ("kiln:without", without)] {
        if !names.is_empty() {
            metadata.push((key.into(), names.join(" ")));
        }
    }
    metadata.extend(sampling.settings());
    metadata.extend(display.exposure().map(|exposure| (EXPOSURE.to_owned(), exposure.to_string())));
    metadata.extend(display.tone_map().map(|map| ("kiln:tone-map".to_owned(), map.name().to_owned())));
    if !headlight {
        metadata.push(("kiln:light".to_owned(), "none".to_owned()));
    }
    if scene.ground.is_some() {
        metadata.push(("kiln:ground".to_owned(), "true".to_owned()));
    }
    let mut fingerprint = Fingerprint::default();
    fingerprint.scene(scene);
    fingerprint.value("sampling", sampling);
    fingerprint.value("range", &recentering.map(|recentering| (recentering.middle, recentering.scale)));
    fingerprint.value("camera", &(camera, size, (x, y, width, height)));
    fingerprint.value("choices", &(shading.name(), with, without, pipeline.name(), numerics.name()));
    if let Some(transport) = transport {
        fingerprint.value("transport", &transport.name());
    }
    metadata.push((FINGERPRINT.to_owned(), fingerprint.finish()));
    if !aovs.is_empty() {
        // Their order does not change the file.
        let mut names = aovs.to_vec();
        names.sort_unstable();
        names.dedup();
        // The key is part of the hash: renaming it would change the fingerprint of every picture.
        add_to_fingerprint(&mut metadata, "layers", &names);
    }
    // Only what is set, so that fingerprints of other pictures do not depend on these settings.
    if !display.is_identity() {
        add_to_fingerprint(&mut metadata, "display", &(display.exposure(), display.tone_map()));
    }
    if let Some(clamp) = clamp {
        add_to_fingerprint(&mut metadata, "clamp", clamp);
    }
    if !headlight {
        add_to_fingerprint(&mut metadata, "headlight", &headlight);
    }
    metadata
}

/// The fingerprint in metadata; empty if there is none.
pub fn fingerprint_of(metadata: &[(String, String)]) -> &str {
    metadata.iter().find(|(key, _)| key == FINGERPRINT).map_or("", |(_, value)| value)
}

/// Mixes a further value into the fingerprint.
pub fn add_to_fingerprint(metadata: &mut Metadata, name: &str, more: &impl std::fmt::Debug) {
    for (_, value) in metadata.iter_mut().filter(|(key, _)| key == FINGERPRINT) {
        let mut fingerprint = Fingerprint::default();
        fingerprint.value("picture", value);
        fingerprint.value(name, more);
        *value = fingerprint.finish();
    }
}
