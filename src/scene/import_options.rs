//! What is asked of the files of a scene when they are read.

#[cfg(feature = "cli")]
use super::option::parser;
use super::option::{OptionValue, options, ranged};
use super::{ClipChoice, ClipTime, UpAxis};
use crate::limits::Limits;

/// Choices that importers take.
#[derive(Debug, Clone, Default, PartialEq)]
#[cfg_attr(feature = "cli", derive(clap::Args))]
pub struct ImportOptions {
    /// Options with a value.
    #[cfg_attr(feature = "cli", command(flatten))]
    pub reading: ReadingOptions,
    /// Read glTF files that require extensions which kiln does not read; what depends on them is missing or wrong
    #[cfg_attr(feature = "cli", arg(long))]
    pub ignore_required_extensions: bool,
    /// Read files that meshes reference outside of their folder, such as `../wood.png` of a material: for meshes that
    /// are trusted. Scene files may name any file
    #[cfg_attr(feature = "cli", arg(long))]
    pub allow_outside_references: bool,
    /// The most that the files may hold: `--limit`, an option of all commands.
    #[cfg_attr(feature = "cli", arg(skip))]
    pub limits: Limits,
}

options! {
    /// Choices that importers take, by value.
    #[derive(Debug, Clone, Default, PartialEq)]
    pub struct ReadingOptions {
        /// Pose what the clips of the input files animate at this time, in seconds; before the first and after the last
        /// keyframe, their values hold [default: at rest]
        [long, allow_hyphen_values = true, value_name = "SECONDS", value_parser = parser::<Seconds>()] time: Seconds,
        /// The clip, by its name or its number from 0 [default: the first]
        [long, value_name = "NAME|INDEX", value_parser = parser::<ClipChoice>()] clip: ClipChoice,
        /// The variant of the materials of glTF files, by its name (KHR_materials_variants) [default: the file's materials]
        [long, value_name = "NAME", value_parser = parser::<String>()] variant: String,
        /// The axis that points up in the files, but scene files [default: y]
        [long, allow_hyphen_values = true, value_name = "AXIS", value_parser = parser::<UpAxis>()] up: UpAxis,
        /// Shade meshes without normals smoothly, but for edges where triangles turn by more than this many degrees; in
        /// files that are no scene files [default without a number: 30]
        [long, value_name = "DEG", num_args = 0..=1, default_missing_value = "30", value_parser = parser::<Degrees>()]
        smooth: Degrees,
    }
}

ranged! {
    /// A time in seconds.
    Seconds(f64, "f64") in f64::MIN..=f64::MAX, "give seconds, such as 1.5";
    /// An angle between triangles in degrees.
    Degrees(f64, "f64") in 0.0..=180.0, "give degrees from 0 to 180";
}

impl OptionValue for ClipChoice {
    fn parse(text: &str) -> Result<Self, String> {
        Ok(ClipChoice::Named(text.to_owned()))
    }

    fn text(&self) -> String {
        match self {
            ClipChoice::First => "0".to_owned(),
            ClipChoice::Named(name) => name.clone(),
            ClipChoice::Index(index) => index.to_string(),
        }
    }
}

impl ImportOptions {
    /// Options that pose the scene.
    pub fn posed(mut self, ClipTime { clip, time }: ClipTime) -> Self {
        (self.reading.clip, self.reading.time) = (Some(clip), Some(Seconds::clamped(time)));
        self
    }

    /// The moment of a clip at which the scene is posed; at rest if `None`.
    pub fn pose(&self) -> Option<ClipTime> {
        let ReadingOptions { time, clip, .. } = &self.reading;
        let time_or_start = time.map_or(0.0, Seconds::get);
        (time.is_some() || clip.is_some())
            .then(|| ClipTime { clip: clip.clone().unwrap_or_default(), time: time_or_start })
    }

    /// Name and value of each option that is set, as on the command line. Flags have no value.
    pub fn entries(&self) -> Vec<(String, Option<String>)> {
        let ImportOptions { reading, ignore_required_extensions, allow_outside_references, limits } = self;
        let mut entries: Vec<_> =
            reading.entries().into_iter().map(|(name, value)| (name, Some(value))).collect();
        entries.extend(
            limits
                .changed()
                .map(|(kind, most)| ("limit".to_owned(), Some(format!("{}={most}", kind.name())))),
        );
        let flags = [
            ("ignore-required-extensions", ignore_required_extensions),
            ("allow-outside-references", allow_outside_references),
        ];
        entries
            .extend(flags.into_iter().filter(|(_, is_on)| **is_on).map(|(name, _)| (name.to_owned(), None)));
        entries
    }
}
