//! Names under which other programs have an option, and what to use here: hints about unknown options.

use kiln::effects::{EFFECTS, EffectId, id};
use kiln::error::ended;

/// Keys of a camera on the command line.
macro_rules! camera {
    ($start:literal) => {
        concat!(
            $start,
            ": --camera '{ position = [0, 1, 6], look_at = [0, 1, 0], vertical_fov = 40 }', or --view iso; `kiln view` finds a camera"
        )
    };
}

/// Options of Blender, Cycles, pbrt, Mitsuba, POV-Ray and f3d, without hyphens in front, and the hint about them.
const SYNONYMS: &[(&[&str], &str)] = &[
    // Output.
    (
        &["out", "outfile", "out-file", "output-file", "outputfile", "render-output", "save"],
        "name the file by --output (-o)",
    ),
    (
        &["format", "file-format", "render-format", "type"],
        "the ending of --output (-o) chooses the format: .png, .jpg or .exr",
    ),
    (
        &["width", "height", "w", "h", "res", "resolution", "image-size", "dimensions", "x", "y"],
        "give width and height together, such as --size 1920x1080",
    ),
    (
        &["dpi", "ppi", "print", "paper"],
        "give pixels, inches times dots per inch: --size 2480x3508 is A4 at 300 dots per inch",
    ),
    (
        &["region", "border", "cropwindow", "crop-window"],
        "render a rectangle of the picture by --crop X,Y,W,H",
    ),
    (
        &["force", "overwrite"],
        "existing files are overwritten; --skip-existing keeps those of the same scene and settings",
    ),
    (&["seconds", "length"], "use --duration S for the length of an animation, --time S for a moment of one"),
    (&["quiet", "silent", "no-progress"], "use --progress none"),
    (
        &["verbose", "debug", "log-level", "log"],
        "--stats FILE.json writes times, rays and memory; `kiln explain` lists the effects",
    ),
    (&["layers", "passes", "render-pass", "gbuffer"], "write further channels to an .exr by --aov"),
    // Camera.
    (
        &["field-of-view", "vertical-fov", "camera-view-angle"],
        "use --fov DEG for the automatic camera, or vertical_fov among the keys of --camera",
    ),
    (&["focal-length", "lens"], camera!("give a camera with focal_length instead of vertical_fov")),
    (&["orbit", "yaw", "rotate", "camera-azimuth-angle"], "turn the automatic camera by --azimuth DEG"),
    (&["pitch", "camera-elevation-angle"], "raise the automatic camera by --elevation DEG"),
    (
        &["dolly", "camera-zoom-factor", "margin", "padding", "border-size"],
        "use --zoom FACTOR: below 1 it leaves more space around the scene",
    ),
    (
        &["frame-all", "fit", "zoom-extents", "reset-camera"],
        "--camera auto frames all objects, --look-at OBJECT one of them",
    ),
    (
        &[
            "camera-direction",
            "eye",
            "position",
            "camera-position",
            "lookat",
            "target",
            "camera-focal-point",
            "camera-view-up",
        ],
        camera!("give a camera with position and look_at"),
    ),
    (
        &["ortho", "orthographic", "perspective", "camera-orthographic"],
        "use --projection orthographic or --projection perspective",
    ),
    (
        &["aperture", "fstop", "f-stop", "focus", "focus-distance", "lens-radius"],
        camera!("give a camera with f_stop or aperture_radius, focus_distance or focus_at"),
    ),
    (
        &["motion-blur", "shutter", "shutter-speed"],
        "there is no motion blur; animations are rendered frame by frame: --frames, --fps",
    ),
    // Light.
    (
        &[
            "hdri",
            "hdr",
            "env",
            "envmap",
            "environment-map",
            "ibl",
            "skybox",
            "sky",
            "hdri-file",
            "hdri-ambient",
            "world",
        ],
        "light the scene by --environment with a .hdr or .exr file, `sky` or a colour",
    ),
    (&["hdri-rotation", "env-rotation", "environment-angle"], "use --environment-rotation DEG"),
    (
        &["headlight", "lights", "light-intensity", "light-type", "key-light", "fill-light", "studio"],
        "use --light head or --light none; --exposure EV changes the brightness",
    ),
    // Look.
    (
        &["bg", "bgcolor", "bg-color", "bg-colour", "background-color", "background-colour", "clear-color"],
        "use --background with #rrggbb, a CSS name or `transparent`",
    ),
    (
        &["transparent", "film-transparent", "no-background", "transparent-background"],
        "use --background transparent",
    ),
    (
        &["floor", "grid", "plane", "ground-plane", "shadow-catcher"],
        "use --ground for a ground under the objects",
    ),
    (&["brightness", "gain", "ev", "intensity", "film-exposure"], "use --exposure EV"),
    (
        &["gamma", "srgb", "linear"],
        "8-bit pictures are encoded as sRGB, .exr is linear; use --exposure or --tone-map for brightness",
    ),
    (&["tonemap", "tonemapping", "tone-mapping", "view-transform", "aces", "agx"], "use --tone-map"),
    (
        &["roughness", "metallic", "metalness", "opacity", "material-override"],
        "use --material '{ colour = \"#c33\", metallic = 1, roughness = 0.2 }', with the keys of [material] in scene files",
    ),
    (
        &["wireframe", "wire", "edges", "show-edges", "mesh-edges"],
        "there are no wireframes; --aov primitive writes the triangle of each pixel",
    ),
    // Quality.
    (
        &["spp", "sample-count", "samples-per-pixel", "n-samples", "pixelsamples", "cycles-samples"],
        "use --samples N",
    ),
    (
        &["denoise", "denoiser", "denoising", "oidn", "optix", "no-denoise"],
        "denoise with another program, such as Open Image Denoise: an .exr with --aov denoising-albedo,denoising-normal has its inputs; \
         or use --noise LEVEL for a picture with less noise",
    ),
    (&["noise-threshold", "adaptive-threshold", "threshold"], "use --noise LEVEL, such as --noise 0.01"),
    (
        &["bounces", "max-depth", "maxdepth", "max-bounces", "ray-depth", "trace-depth", "recursion"],
        "use --depth N for path tracing; mirror reflections have their limit in --with",
    ),
    (
        &["integrator", "renderer", "path-tracing", "pathtracing", "raytracing", "gi", "global-illumination"],
        "use --transport whitted or --transport path",
    ),
    (
        &["epsilon", "bias", "shadow-bias", "ray-epsilon"],
        "there is no epsilon: ray origin offsets follow from error bounds; --numerics chooses the arithmetic",
    ),
    (&["preview", "fast", "low-quality"], "use --draft, or a smaller --size"),
    (&["random-seed"], "use --seed N"),
    // Animation.
    (&["frame-rate", "framerate"], "use --fps N"),
    (
        &[
            "start",
            "end",
            "frame",
            "frame-start",
            "frame-end",
            "render-frame",
            "render-anim",
            "initial-frame",
        ],
        "use --frames, such as --frames 1-100",
    ),
    (
        &["loop", "repeat", "turntable", "spin"],
        "`kiln animate` renders one turn of the camera; .gif and animated .png files repeat",
    ),
    (
        &["animation", "anim", "animation-index", "animation-name"],
        "choose a clip of a glTF file by --clip, its time by --time",
    ),
    (&["animation-time", "timestep"], "use --time SECONDS"),
    // Input.
    (
        &["input", "scene", "file", "mesh", "model"],
        "write input files without an option: kiln render model.glb --output picture.png",
    ),
    (&["up-axis", "axis-up", "z-up", "y-up"], "use --up AXIS, such as --up z"),
    (
        &["scale", "translate", "unit", "units"],
        "a scene file places meshes: [[mesh]] with scale, rotate and translate; --view frames any size",
    ),
    (&["smoothing", "smooth-normals", "shade-smooth", "autosmooth"], "use --smooth, or --smooth DEG"),
    (&["watch", "reload", "auto-reload"], "`kiln view` shows files again as they change"),
    // Speed.
    (
        &["nthreads", "num-threads", "thread-count", "jobs", "cores", "cpus", "work-threads"],
        "use --threads N",
    ),
    (&["gpu", "cuda", "device"], "kiln renders on the processor; --threads N limits the threads"),
    (&["memory", "max-memory", "mem-limit"], "use --memory-limit SIZE"),
];

/// The same for effects, whose own names are known, too.
const EFFECT_SYNONYMS: &[(&[&str], EffectId)] = &[
    (&["ao", "ssao"], id::AMBIENT_OCCLUSION),
    (&["no-shadows", "shadow-rays"], id::SHADOWS),
    (&["dof", "blur", "bokeh"], id::DEPTH_OF_FIELD),
    (&["texture", "no-textures"], id::TEXTURES),
    (&["aa", "anti-alias", "antialias", "anti-aliasing", "msaa", "ssaa", "supersampling"], id::ANTIALIASING),
];

/// The hint about an option that there is not, as typed: `--fov` or `--fov=40`.
pub(super) fn hint(typed: &str) -> Option<String> {
    let name = typed.split('=').next()?.trim_start_matches('-').to_ascii_lowercase().replace('_', "-");
    let effect = EFFECTS.iter().map(|effect| effect.id).find(|id| id.name() == name);
    let synonym =
        || EFFECT_SYNONYMS.iter().find(|(names, _)| names.contains(&name.as_str())).map(|(_, id)| *id);
    if let Some(effect) = effect.or_else(synonym) {
        return Some(format!("use --with {effect} or --without {effect}"));
    }
    let synonym = SYNONYMS.iter().find(|(names, _)| names.contains(&name.as_str()));
    ended(&name).or(synonym.map(|(_, hint)| *hint)).map(str::to_owned)
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::super::names::error_by_name;
    use super::super::tests::{commands, options};
    use super::*;
    use kiln::error::{ENDED, Error};
    use kiln::render::aov::AOVS;

    #[test]
    fn hints_name_what_there_is() {
        let known: BTreeSet<String> =
            commands().iter().flat_map(options).filter_map(|o| o.get_long().map(str::to_owned)).collect();
        let mut seen = BTreeSet::new();
        let of_effects =
            EFFECT_SYNONYMS.iter().map(|(names, effect)| (*names, hint(effect.name()).expect("an effect")));
        let ended = ENDED.iter().map(|(name, hint)| (std::slice::from_ref(name), (*hint).to_owned()));
        let all = SYNONYMS.iter().map(|(names, hint)| (*names, (*hint).to_owned()));
        let all = all.chain(of_effects).chain(ended);
        for (names, hint) in all {
            for name in names {
                assert!(!EFFECTS.iter().any(|effect| effect.name() == *name), "--{name} is an effect");
                assert!(!known.contains(*name), "--{name} is an option");
                assert!(seen.insert(*name), "--{name} has two hints");
            }
            let mut words = hint.split([' ', '=', ',', ';', ':', '`']).peekable();
            let mut count = 0;
            while let Some(word) = words.next() {
                let Some(option) = word.strip_prefix("--") else { continue };
                assert!(known.contains(option), "{hint}");
                count += 1;
                let value = words.peek().copied().unwrap_or_default();
                let is_known = match option {
                    "with" | "without" => {
                        value.is_empty() || EFFECTS.iter().any(|effect| effect.name() == value)
                    }
                    "aov" => AOVS.iter().any(|aov| aov.name == value) || value.is_empty(),
                    _ => true,
                };
                assert!(is_known, "{hint}: {value}");
            }
            assert!(count > 0 || hint.contains("`kiln "), "{hint}");
            assert!(!hint.ends_with('.') && hint.len() < 200, "{hint}");
            let by_name = error_by_name(&Error::usage("unknown", hint));
            assert!(!by_name.contains("--") && !by_name.contains("`kiln "), "{by_name}");
        }
    }

    #[test]
    fn spelling_and_values_do_not_matter() {
        assert_eq!(hint("--FOV=40"), hint("--fov"));
        assert_eq!(hint("--max_depth"), hint("-max-depth"));
        assert!(hint("--spp").is_some_and(|hint| hint.contains("--samples")));
        assert_eq!(hint("--sise"), None);
    }
}
