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
    /// Number of its file among the files with clips, in the order of reading.
    pub file: usize,
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

    /// Chosen clips of each file, in the order of the choice. `clips` are ordered by file.
    pub fn find<'a>(&self, clips: &'a [Clip]) -> Vec<&'a Clip> {
        let files = clips.chunk_by(|a, b| a.file == b.file);
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Scene;

    /// Clips are found in each file by themselves, also where files were read as parts of one input.
    #[test]
    fn clips_are_chosen_in_each_file() {
        let clip = |name: &str, index| Clip {
            name: name.into(),
            index,
            duration: 1.0,
            channels: 1,
            digest: String::new(),
            file: 0,
        };
        let mut scene = Scene::default();
        for clips in [vec![clip("walk", 0), clip("run", 1)], vec![clip("run", 0)], vec![clip("jump", 0)]] {
            scene.append(Scene { clips, ..Scene::default() });
        }
        let found = |choice: ClipChoice| {
            choice.find(&scene.clips).iter().map(|clip| (clip.file, clip.index)).collect::<Vec<_>>()
        };
        assert_eq!(found(ClipChoice::First), [(0, 0), (1, 0), (2, 0)]);
        assert_eq!(found(ClipChoice::Named("run".into())), [(0, 1), (1, 0)]);
        assert_eq!(found(ClipChoice::Named("all".into())), [(0, 0), (0, 1), (1, 0), (2, 0)]);
    }
}
