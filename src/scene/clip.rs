//! Clips: animations that an input file brings by name.

/// A clip of an input file.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
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
    /// Index of its file in [`super::Scene::inputs`].
    pub input: usize,
}

/// The choice of clips.
#[derive(Debug, Clone, Default, PartialEq)]
pub enum ClipChoice {
    /// The first.
    #[default]
    First,
    /// By its name, or by its index if no clip has that name; all for [`ClipChoice::ALL`].
    Named(String),
    /// By its index.
    Index(usize),
    /// Several together, in this order.
    Several(Vec<ClipChoice>),
}

/// The moment of a clip at which a scene is posed.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ClipTime {
    /// The clips of each file.
    pub clip: ClipChoice,
    /// Seconds from its beginning. Before the first and after the last keyframe, their values hold.
    pub time: f64,
}

impl ClipChoice {
    /// Name that chooses all clips, unless a clip has this name.
    pub const ALL: &str = "all";

    /// Combined choices; `None` without any.
    pub fn together(mut choices: Vec<ClipChoice>) -> Option<ClipChoice> {
        if choices.len() < 2 { choices.pop() } else { Some(ClipChoice::Several(choices)) }
    }

    /// Choice of clips by index; [`ClipChoice::First`] without any.
    pub fn of(clips: &[Clip]) -> ClipChoice {
        let mut choices: Vec<ClipChoice> = Vec::new();
        for choice in clips.iter().map(|clip| ClipChoice::Index(clip.index)) {
            if !choices.contains(&choice) {
                choices.push(choice);
            }
        }
        ClipChoice::together(choices).unwrap_or_default()
    }

    /// Chosen clips of each file, in the order of the choice. `clips` are ordered by file.
    pub fn find<'a>(&self, clips: &'a [Clip]) -> Vec<&'a Clip> {
        let files = clips.chunk_by(|a, b| a.input == b.input);
        files.flat_map(|clips| self.find_in_file(clips)).collect()
    }

    /// Chosen clips of a file; the first of equal names.
    fn find_in_file<'a>(&self, clips: &'a [Clip]) -> Vec<&'a Clip> {
        let by_index = |index: usize| clips.iter().find(|clip| clip.index == index);
        let found = match self {
            ClipChoice::First => clips.first(),
            ClipChoice::Index(index) => by_index(*index),
            ClipChoice::Named(name) => {
                let by_name = clips.iter().find(|clip| clip.name == *name);
                if by_name.is_none() && name == ClipChoice::ALL {
                    return clips.iter().collect();
                }
                by_name.or_else(|| by_index(name.parse().ok()?))
            }
            ClipChoice::Several(choices) => {
                return choices.iter().flat_map(|choice| choice.find_in_file(clips)).collect();
            }
        };
        found.into_iter().collect()
    }

    /// Individual choices.
    pub fn choices(&self) -> &[ClipChoice] {
        match self {
            ClipChoice::Several(choices) => choices,
            one => std::slice::from_ref(one),
        }
    }
}
