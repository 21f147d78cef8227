//! Clips: animations that an input file brings by name.

/// A clip of an input file.
#[derive(Debug, Clone, PartialEq)]
pub struct Clip {
    /// Its name, or its index if it has none.
    pub name: String,
    /// The time of its last keyframe in seconds.
    pub duration: f64,
    /// The number of properties that it animates.
    pub channels: usize,
    /// A hash of its keyframes and of what they animate.
    pub digest: String,
}

/// The moment of a clip at which a scene is posed.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ClipTime {
    /// Name or index of the clip; the first if `None`.
    pub clip: Option<String>,
    /// Seconds from its beginning. Before the first and after the last keyframe, their values hold.
    pub time: f64,
}

impl Clip {
    /// The index of a clip by its name, or else by its index; the first for `None`.
    pub fn find(clips: &[Clip], wanted: Option<&str>) -> Option<usize> {
        let Some(wanted) = wanted else { return (!clips.is_empty()).then_some(0) };
        let by_name = clips.iter().position(|clip| clip.name == wanted);
        by_name.or_else(|| wanted.parse().ok().filter(|&index: &usize| index < clips.len()))
    }
}
