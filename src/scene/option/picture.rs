//! [`PictureSettings`]: what a scene file and the command line can say of a picture. Each option is defined once, here:
//! the keys of `[image]`, the command's options, merging, metadata, fingerprint and the window's copied command derive
//! from it.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::film::filter::RADII;
use crate::film::rounding::Rounding;
use crate::film::tone::{Exposure, ToneMap};
use crate::film::{Colour, ColourPipeline, DisplaySettings, FilterShape};
use crate::scene::option::colour_value::ColourValue;
use crate::scene::option::group;
use crate::scene::option::sampling::Sampling;
use crate::scene::option::{OptionValue, named_values, options, ranged};
use crate::scene::{BitDepth, MAX_SAMPLES, Numerics, PixelSampler, ShadingMode, Transport};

options! {
    /// The picture.
    #[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
    #[serde(deny_unknown_fields)]
    pub struct PictureSettings {
        /// Width in pixels.
        [skip = None] width: Option<Side>,
        /// Height in pixels.
        [skip = None] height: Option<Side>,
        /// Look: `studio` adds antialiasing, light, tone map, ground and background, each where the scene has none and
        /// no option chooses it; `draft` uses a headlight where there is no light [default: studio for meshes, draft
        /// for scene files]
        [skip = None] look: Option<Look>,
        /// Orbit of the automatic camera around the vertical axis, in degrees to the right of --view [default: 0]
        [of(group::CAMERA).order(2).hyphens().value_name("DEG")] azimuth: Option<Rotation>,
        /// Orbit of the automatic camera upwards from --view, in degrees, at most to straight above or below [default:
        /// 0]
        [of(group::CAMERA).order(3).hyphens().value_name("DEG")] elevation: Option<Rotation>,
        /// Magnification of the automatic camera's picture about its centre, 0.001 to 1000; 1 frames the scene
        /// [default: 1]
        [of(group::CAMERA).order(4).hyphens().value_name("FACTOR")] zoom: Option<Zoom>,
        /// Vertical field of view of the automatic camera in degrees, 0.1 to 170 [default: 30 for meshes, 40 with
        /// --draft and for scene files]
        [of(group::CAMERA).order(5).hyphens().value_name("DEG")] fov: Option<FieldOfView>,
        /// Arithmetic of the intersection tests: `fast` (f32; rays may leak through edges), `watertight` (corners in
        /// f32, tests in f64; no ray leaks out of closed meshes), `double` (f64) or `exact` (as double, decided without
        /// rounding)
        /// [default: watertight]
        [of(group::QUALITY).order(900).hides_values().value_name("TIER")] numerics: Option<Numerics>,
        /// Shading: `phong` is the full model, `flat` the surface colour alone, `ambient` that term alone,
        /// `diffuse` ambient and diffuse light; all but `phong` without effects [default: phong]
        [of(group::LOOK).hides_values().value_name("MODE")] shading: Option<ShadingMode>,
        /// Light transport: `whitted` (local shading, shadow rays, mirror reflections) or `path` (path tracing:
        /// indirect light, soft shadows) [default: path in scenes with an environment or area lights, and for meshes
        /// with transmissive or emissive materials, else whitted]
        [of(group::QUALITY).order(3).hides_values()] transport: Option<Transport>,
        /// Clamp of indirect light: maximum radiance that a path adds at each bounce, above 0; 1 is white. Reduces
        /// fireflies and darkens indirect light [default: none; display white where materials of meshes call for path
        /// tracing]
        [of(group::QUALITY).hyphens().value_name("RADIANCE")] clamp: Option<Clamp>,
        /// Maximum perfectly specular bounces of a path (smooth mirrors and clear glass), 0 to 1000, which then do not
        /// count towards --depth [default: 64; with --depth alone, that limits all]
        [of(group::QUALITY).order(5).hyphens().value_name("N")] depth_specular: Option<Bounces>,
        /// Samples per pixel, 1 to 65536; with a noise threshold, the maximum [default: for meshes 16,
        /// with path tracing 64; for scene files 1 at the pixel's centre, 16 with a filter, 256 with a noise threshold]
        [of(group::QUALITY).order(0).hyphens().value_name("N")] samples: Option<Samples>,
        /// Pixel reconstruction filter [default: gaussian]
        [of(group::QUALITY).value_name("FILTER")] filter: Option<FilterShape>,
        /// Filter radius in pixels [default: box 0.5, tent 1, gaussian 1.5, mitchell 2]
        [of(group::QUALITY).hyphens().value_name("PIXELS")] filter_radius: Option<FilterRadius>,
        /// Noise threshold of adaptive sampling: sample each pixel until the standard error of its displayed value (1
        /// is white) is below this [default: for meshes without sampling options 0.025, 0.055 where transmissive or
        /// emissive materials call for path tracing, else none]
        [of(group::QUALITY).order(1).hyphens().value_name("LEVEL")] noise: Option<Noise>,
        /// Minimum samples per pixel of adaptive sampling [default: 4]
        [of(group::QUALITY).hyphens().value_name("N")] min_samples: Option<Samples>,
        /// Same random numbers at all times, so that the grain of frames is a fixed pattern, instead of others in each frame
        /// [default: false]
        [of(group::QUALITY)] same_grain: Option<bool>,
        /// Seed of the random numbers [default: 0]
        [of(group::QUALITY).hyphens().value_name("N")] seed: Option<u32>,
        /// Sampler: `sobol` (Owen-scrambled Sobol sequence) or `independent` (converges more slowly; for `kiln compare
        /// --t-test`) [default: sobol]
        [of(group::QUALITY).hides_values().value_name("SAMPLER")] sampler: Option<PixelSampler>,
        /// Colour arithmetic: `linear` (linear light), `display` (sRGB-encoded values) or `u8` (sRGB-encoded values,
        /// rounded to 8 bits after each step) [default: linear]
        [alias("color").of(group::LOOK).hides_values().value_name("PIPELINE")] colour: Option<ColourPipeline>,
        /// Exposure in stops (EV), -64 to 64, or `auto`, computed from the picture. For 8-bit pictures, films and the
        /// window, with linear colour arithmetic [default: automatic for meshes with emissive materials or glTF lights,
        /// or with the camera inside the scene, else 0]
        [of(group::LOOK).order(3).hyphens().value_name("EV|auto")] exposure: Option<Exposure>,
        /// Tone map of 8-bit pictures, films and the window, with linear colour arithmetic [default: pbr-neutral for
        /// meshes, else none]
        [of(group::LOOK).order(4).value_name("CURVE")] tone_map: Option<ToneMap>,
        /// Bits per channel of the file: 8 or 16 for .png, 16 (half floats) or 32 for .exr [default: 8 for .png, 32 for .exr]
        [of(group::OUTPUT).order(1).hides_values().value_name("BITS")] bits: Option<BitDepth>,
        /// Dither where display values are rounded to integers, so that dark gradients show no bands; black and white stay as
        /// they are [default: false]
        [of(group::OUTPUT).order(1)] dither: Option<bool>,
        /// Light of scenes without lights: a headlight at the camera (in scene files true) or none (false) [default:
        /// studio light for meshes, a headlight with --draft and for scene files]
        #[serde(rename = "headlight")]
        [of(group::LIGHT)] light: Option<Headlight>,
        /// Grey ground plane under the objects, ignored by automatic cameras [default: true for meshes without lights
        /// and cameras seen from above, else false]
        [of(group::LOOK).order(1)] ground: Option<bool>,
        /// Hide back faces of glTF materials with `doubleSided: false` from camera rays; shadows and indirect light are
        /// those of the whole surface [default: false]
        [of(group::LOOK)] cull: Option<bool>,
        /// Background colour (#rrggbb or a CSS name such as white), or `transparent` for an alpha channel in .png and
        /// .exr
        /// [default: light grey for meshes, dark grey for meshes with lights or cameras, black for scene files]
        [of(group::LOOK).order(0).value_name("COLOUR|transparent")] background: Option<Background>,
    }
}

ranged! {
    /// Width or height of a picture in pixels.
    Side(u32, "u32") in 1..=65_535, "give a number of pixels from 1 to 65535";
    /// A rotation in degrees.
    Rotation(f64, "f64") in f64::MIN..=f64::MAX, "give a number of degrees";
    /// A factor of radiance.
    Intensity(f64, "f64") in 0.0..=1e100, "give a factor from 0 to 1e100, such as 2";
    /// A magnification.
    Zoom(f64, "f64") in 0.001..=1000.0, "give a factor from 0.001 to 1000, such as 2";
    /// A vertical field of view in degrees.
    FieldOfView(f64, "f64") in 0.1..=170.0, "give degrees from 0.1 to 170, such as 30";
    /// A number of bounces.
    Bounces(u32, "u32") in 0..=1000, "give a number from 0 to 1000";
    /// A number of samples per pixel.
    Samples(u32, "u32") in 1..=MAX_SAMPLES, "give a number of samples from 1 to 65536";
    /// Radius of a filter in pixels.
    FilterRadius(f64, "f64") in RADII, "give a radius in pixels from 0.01 to 32";
    /// A standard error of displayed values. f32 values are not much more accurate than its minimum.
    Noise(f64, "f64") in 1e-6..=1.0, "give a standard error from 0.000001 to 1, 1 being white; one step of 8 bits is 0.004";
    /// A radiance above 0.
    Clamp(f64, "f64") in f64::MIN_POSITIVE..=f64::MAX, "give a radiance above 0, such as 10; 1 is white";
}

/// What a picture gets that neither the scene nor an option says.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Look {
    /// A headlight and ambient light, on a dark background, with one sample a pixel.
    #[default]
    Draft,
    /// Antialiasing; light and a tone map where files have no light; where they have no camera, too, a ground and a
    /// light background.
    Studio,
}

names!(Look { Draft = "draft", Studio = "studio" });
named_values!(Look);

/// The light of a scene without lights; a boolean in scene files.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(from = "bool", into = "bool")]
pub enum Headlight {
    /// A headlight.
    Head,
    /// None.
    None,
}

names!(Headlight { Head = "head", None = "none" });
named_values!(Headlight);

impl From<bool> for Headlight {
    fn from(is_on: bool) -> Self {
        if is_on { Headlight::Head } else { Headlight::None }
    }
}

impl From<Headlight> for bool {
    fn from(light: Headlight) -> bool {
        light == Headlight::Head
    }
}

/// The background of a picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase", expecting = "expected a colour")]
pub enum Background {
    /// Black, with an alpha channel in the picture.
    Transparent,
    /// A colour of 8-bit sRGB values.
    #[serde(untagged)]
    Colour(ColourValue),
}

impl OptionValue for Background {
    fn parse(text: &str) -> Result<Self, String> {
        if text == "transparent" {
            return Ok(Background::Transparent);
        }
        let colour = ColourValue::of_argument(text).map(Background::Colour);
        colour
            .ok_or_else(|| "give a colour as #rrggbb or by a CSS name, such as white, or transparent".into())
    }

    fn text(&self) -> String {
        match self {
            Background::Colour(ColourValue([r, g, b])) => format!("#{r:02x}{g:02x}{b:02x}"),
            Background::Transparent => "transparent".into(),
        }
    }
}

impl Background {
    /// The colour.
    pub fn colour(self) -> Colour {
        match self {
            Background::Colour(colour) => Colour::from_u8(colour.0),
            Background::Transparent => Colour::from_u8([0; 3]),
        }
    }
}

impl OptionValue for Exposure {
    fn parse(text: &str) -> Result<Self, String> {
        text.parse()
    }

    fn text(&self) -> String {
        self.to_string()
    }
}

/// The options that an automatic camera alone has.
const OF_AUTOMATIC_CAMERA: [&str; 4] = ["azimuth", "elevation", "zoom", "fov"];

impl PictureSettings {
    /// The options that are set and change automatic cameras alone.
    pub fn of_automatic_camera(&self) -> Vec<String> {
        let names = self.entries().into_iter().map(|(name, _)| name);
        names.filter(|name| OF_AUTOMATIC_CAMERA.contains(&&**name)).map(|name| format!("--{name}")).collect()
    }

    /// Settings of a width and a height in pixels, each limited to the range of [`Side`].
    pub fn of_size([width, height]: [u32; 2]) -> Self {
        PictureSettings {
            width: Some(Side::clamped(width)),
            height: Some(Side::clamped(height)),
            ..PictureSettings::default()
        }
    }

    /// The defaults that do not depend on the scene or on other options.
    pub fn defaults() -> Self {
        PictureSettings {
            numerics: Some(Numerics::default()),
            shading: Some(ShadingMode::default()),
            colour: Some(ColourPipeline::default()),
            exposure: Some(Exposure::Ev(0.0)),
            tone_map: Some(ToneMap::default()),
            ..PictureSettings::default()
        }
    }

    /// Width and height in pixels, if both are set.
    pub fn size(&self) -> Option<[u32; 2]> {
        Some([self.width?.get(), self.height?.get()])
    }

    /// The sampling settings.
    pub fn sampling(&self) -> Sampling {
        Sampling {
            samples: self.samples.map(Samples::get),
            filter: self.filter,
            filter_radius: self.filter_radius.map(FilterRadius::get),
            noise: self.noise.map(Noise::get),
            min_samples: self.min_samples.map(Samples::get),
            seed: self.seed.unwrap_or_default(),
            sampler: self.sampler.unwrap_or_default(),
            first: None,
            total: None,
        }
    }

    /// Exposure, tone map and rounding.
    pub fn display(&self) -> DisplaySettings {
        let is_16_bit = self.bits == Some(BitDepth::Sixteen);
        let rounding = Rounding { is_16_bit, is_dithered: self.dither == Some(true) };
        DisplaySettings { exposure: self.exposure, tone_map: self.tone_map, rounding }
    }

    /// Arithmetic tier.
    pub fn numerics(&self) -> Numerics {
        self.numerics.unwrap_or_default()
    }

    /// Which terms are shaded.
    pub fn shading(&self) -> ShadingMode {
        self.shading.unwrap_or_default()
    }

    /// The colour pipeline.
    pub fn pipeline(&self) -> ColourPipeline {
        self.colour.unwrap_or_default()
    }

    /// Whether the picture has an alpha channel.
    pub fn is_transparent(&self) -> bool {
        self.background == Some(Background::Transparent)
    }

    /// These settings, and those of the default look that these do not set. Settings that say how many samples are
    /// taken or how they are filtered exclude the look's sampling.
    pub fn or_look(self, look: Self) -> Self {
        let PictureSettings { samples, filter, filter_radius, noise, min_samples, .. } = self;
        let says_quality = samples.or(min_samples).is_some()
            || filter.is_some()
            || filter_radius.is_some()
            || noise.is_some();
        let look = if says_quality { PictureSettings { samples: None, noise: None, ..look } } else { look };
        self.or(look)
    }

    /// These settings, with exposure and tone map without effect unless the pipeline is linear.
    pub fn displayable(self) -> Self {
        let DisplaySettings { exposure, tone_map, .. } = self.display().in_pipeline(self.pipeline());
        PictureSettings { exposure, tone_map, ..self }
    }

    /// The options that a picture is described by: those that are always stated have their defaults, exposure, tone map
    /// and light are omitted where they are the defaults.
    pub fn described(&self) -> Self {
        let (sampling, display) = (self.sampling(), self.display());
        let (filter, radius) = sampling.shape_and_radius();
        let sampled = if sampling.is_wanted() {
            PictureSettings {
                samples: Some(Samples::clamped(sampling.max_samples())),
                filter: Some(filter),
                filter_radius: Some(FilterRadius::clamped(radius)),
                seed: Some(sampling.seed),
                ..*self
            }
        } else {
            *self
        };
        PictureSettings {
            exposure: display.exposure(),
            tone_map: display.tone_map(),
            light: self.light.filter(|light| *light == Headlight::None),
            ..sampled.or(PictureSettings::defaults())
        }
    }

    /// The options as on the command line: [`PictureSettings::entries`] with width and height as `size`.
    pub fn options(&self) -> Vec<(String, String)> {
        let size = self.size().map(|[width, height]| ("size".to_owned(), format!("{width}x{height}")));
        let others =
            self.entries().into_iter().filter(|(name, _)| !["width", "height"].contains(&name.as_str()));
        size.into_iter().chain(others).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{DefaultLook, Fingerprint, Scene};

    /// Two settings, which give each option another value. None of them is a default.
    fn both() -> [PictureSettings; 2] {
        let first = PictureSettings {
            width: Some(Side(640)),
            height: Some(Side(480)),
            azimuth: Some(Rotation(-30.5)),
            elevation: Some(Rotation(10.0)),
            zoom: Some(Zoom(1.5)),
            fov: Some(FieldOfView(24.0)),
            look: Some(Look::Studio),
            numerics: Some(Numerics::Double),
            shading: Some(ShadingMode::Flat),
            transport: Some(Transport::Path),
            clamp: Some(Clamp(2.5)),
            depth_specular: Some(Bounces(5)),
            samples: Some(Samples(8)),
            filter: Some(FilterShape::Tent),
            filter_radius: Some(FilterRadius(1.25)),
            noise: Some(Noise(0.01)),
            min_samples: Some(Samples(3)),
            same_grain: Some(true),
            seed: Some(7),
            sampler: Some(PixelSampler::Independent),
            colour: Some(ColourPipeline::U8),
            exposure: Some(Exposure::Ev(-1.5)),
            tone_map: Some(ToneMap::PbrNeutral),
            bits: Some(BitDepth::Sixteen),
            dither: Some(true),
            light: Some(Headlight::None),
            ground: Some(true),
            cull: Some(true),
            background: Some(Background::Transparent),
        };
        let second = PictureSettings {
            width: Some(Side(1)),
            height: Some(Side(65_535)),
            azimuth: Some(Rotation(720.0)),
            elevation: Some(Rotation(-90.0)),
            zoom: Some(Zoom(1e-3)),
            fov: Some(FieldOfView(170.0)),
            look: Some(Look::Draft),
            numerics: Some(Numerics::Exact),
            shading: Some(ShadingMode::Ambient),
            transport: Some(Transport::Whitted),
            clamp: Some(Clamp(1e-3)),
            depth_specular: Some(Bounces(1000)),
            samples: Some(Samples(65_536)),
            filter: Some(FilterShape::Mitchell),
            filter_radius: Some(FilterRadius(32.0)),
            noise: Some(Noise(1e-6)),
            min_samples: Some(Samples(1)),
            same_grain: Some(false),
            seed: Some(u32::MAX),
            sampler: Some(PixelSampler::Sobol),
            colour: Some(ColourPipeline::Display),
            exposure: Some(Exposure::Auto),
            tone_map: Some(ToneMap::Agx),
            bits: Some(BitDepth::ThirtyTwo),
            dither: Some(false),
            light: Some(Headlight::Head),
            ground: Some(false),
            cull: Some(false),
            background: Some(Background::Colour(ColourValue([255, 128, 0]))),
        };
        [first, second]
    }

    /// Settings of a single option each: its key in scene files, its value there, and the settings.
    fn single(all: &PictureSettings) -> Vec<(String, String, PictureSettings)> {
        let values = serde_json::to_value(all).expect("plain data");
        let each = values.as_object().expect("an object").iter().map(|(key, value)| {
            let text = format!("{key} = {value}\n");
            let one = toml::from_str(&text).unwrap_or_else(|e| panic!("{e}: {text}"));
            (key.clone(), value.to_string(), one)
        });
        each.collect()
    }

    #[test]
    fn every_option_is_read_written_and_merged() {
        let [first, second] = both();
        let of = |picture: PictureSettings| {
            let mut fingerprint = Fingerprint::default();
            let scene = Scene { picture, ..Scene::default() };
            fingerprint.scene(&scene, None, &DefaultLook::of_files(&scene, picture));
            fingerprint.finish()
        };
        for (own, other) in [(&first, &second), (&second, &first)] {
            let mut merged = PictureSettings::default();
            for (key, value, one) in single(own) {
                let [(name, text)] =
                    one.entries().try_into().unwrap_or_else(|e| panic!("{key} = {value}: {e:?}"));
                assert_eq!(
                    key,
                    if name == "light" { "headlight".to_owned() } else { name.replace('-', "_") }
                );
                assert_eq!(typed(&name, &text), one, "--{name}={text}");
                assert_eq!(of(one) == of(PictureSettings::default()), text == "head", "{key} = {value}");
                // The first takes precedence, and changes nothing else.
                let both = one.or(*other);
                assert!(both.entries().contains(&(name.clone(), text.clone())), "{both:?}");
                assert_eq!(
                    both.entries().iter().filter(|entry| !other.entries().contains(entry)).count(),
                    1,
                    "{name}"
                );
                merged = merged.or(one);
            }
            assert_eq!(merged, *own);
            let described = own.described().entries();
            let is_described = |entry: &&(String, String)| described.contains(entry) || entry.1 == "head";
            assert_eq!(own.entries().iter().find(|entry| !is_described(entry)), None);
        }
    }

    /// The settings of an option of the command line. Width and height are set by `--size`, the look by `--draft`.
    fn typed(name: &str, text: &str) -> PictureSettings {
        match name {
            "width" => PictureSettings { width: Side::parse(text).ok(), ..PictureSettings::default() },
            "height" => PictureSettings { height: Side::parse(text).ok(), ..PictureSettings::default() },
            "look" => PictureSettings { look: Look::parse(text).ok(), ..PictureSettings::default() },
            _ => {
                let mut settings = PictureSettings::default();
                settings.set(name, Some(text)).unwrap_or_else(|e| panic!("{e}"));
                settings
            }
        }
    }
}
