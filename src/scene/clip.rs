//! Clips: animations that an input file brings by name.

/// A clip of an input file.
#[derive(Debug, Clone, PartialEq)]
pub struct Clip {
    /// Its name, or its index if it has none. Names may repeat.
    pub name: String,
    /// Its index in the file.
    pub index: usize,
    /// The time of its last keyframe in seconds.
    pub duration: f64,
    /// The number of properties that it animates.
    pub channels: usize,
    /// A hash of its keyframes and of what they animate.
    pub digest: String,
}

/// The choice of a clip.
#[derive(Debug, Clone, Default, PartialEq)]
pub enum ClipChoice {
    /// The first.
    #[default]
    First,
    /// By its name, or, where none has that name, by its index.
    Named(String),
    /// By its index.
    Index(usize),
}

/// The moment of a clip at which a scene is posed.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ClipTime {
    /// The clip of each file.
    pub clip: ClipChoice,
    /// Seconds from its beginning. Before the first and after the last keyframe, their values hold.
    pub time: f64,
}

impl ClipChoice {
    /// The first of `clips` that is chosen.
    pub fn find<'a>(&self, clips: &'a [Clip]) -> Option<&'a Clip> {
        let by_index = |index: usize| clips.iter().find(|clip| clip.index == index);
        match self {
            ClipChoice::First => clips.first(),
            ClipChoice::Index(index) => by_index(*index),
            ClipChoice::Named(name) => {
                let by_name = clips.iter().find(|clip| clip.name == *name);
                by_name.or_else(|| by_index(name.parse().ok()?))
            }
        }
    }
}
