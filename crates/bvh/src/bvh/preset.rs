//! How much work is spent on building.

use super::sah::Budget;

/// A trade-off between build time and traversal time. No image depends on it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "kebab-case"))]
#[non_exhaustive]
pub enum Preset {
    /// For scenes that change with every picture, or that few rays are cast in: obvhs's PLOC and little of its
    /// reinsertion.
    FastBuild,
    /// The default: obvhs's PLOC with a wider search, and its reinsertion.
    #[default]
    Balanced,
    /// For scenes that many rays are cast in: a top-down build with spatial splits of large triangles, and obvhs's
    /// reinsertion.
    BestTrace,
}

impl Preset {
    /// Every preset.
    pub const ALL: [Preset; 3] = [Preset::FastBuild, Preset::Balanced, Preset::BestTrace];

    /// Its name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Preset::FastBuild => "fast-build",
            Preset::Balanced => "balanced",
            Preset::BestTrace => "best-trace",
        }
    }

    /// The preset of a name.
    pub fn named(name: &str) -> Option<Self> {
        Preset::ALL.into_iter().find(|preset| preset.name() == name)
    }

    /// How the top-down builder builds; `None` for obvhs's PLOC. This decides which builder a preset uses.
    ///
    /// A reinsertion ratio of 0.03 has 5 % fewer tests than none in a kitchen, and 1 another 1 % fewer.
    pub(super) fn top_down(self) -> Option<TopDown> {
        match self {
            Preset::FastBuild | Preset::Balanced => None,
            Preset::BestTrace => Some(TopDown { budget: Budget(0.3), reinsertion_ratio: 0.03 }),
        }
    }

    /// PLOC's parameters, of `BestTrace` for the meshes of instances.
    ///
    /// As measured with trees of eight. Sorting by 128 bits changed no count of tests; searching wider than 14, a
    /// second reinsertion, or a ratio above 0.015 for the default, brought less than 3 % of them; a ratio of 0.02
    /// brings 0.5 % and takes 5 % longer to build, one of 0.01 saves 3 % and costs up to 3 %.
    pub(super) fn ploc(self) -> Ploc {
        let (search_distance, search_depth, reinsertion_ratio) = match self {
            Preset::FastBuild => (SearchDistance::Two, 0, 0.01),
            Preset::Balanced => (SearchDistance::Six, 2, 0.015),
            Preset::BestTrace => (SearchDistance::Fourteen, 1, 1.0),
        };
        Ploc { search_distance, search_depth, reinsertion_ratio }
    }
}

/// Parameters of the top-down builder.
pub(super) struct TopDown {
    /// The references that it may add by spatial splits.
    pub budget: Budget,
    /// The share of nodes that obvhs's reinsertion considers afterwards.
    pub reinsertion_ratio: f32,
}

/// The number of neighbours on each side that PLOC searches in the sorted order.
#[derive(Clone, Copy)]
pub(super) enum SearchDistance {
    Two,
    Six,
    Fourteen,
}

/// Parameters of obvhs's PLOC.
pub(super) struct Ploc {
    /// How far in the sorted order it searches for neighbours.
    pub search_distance: SearchDistance,
    /// Below this depth it searches one neighbour far.
    pub search_depth: usize,
    /// The share of nodes that obvhs's reinsertion considers afterwards.
    pub reinsertion_ratio: f32,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_find_their_presets() {
        for preset in Preset::ALL {
            assert_eq!(Preset::named(preset.name()), Some(preset));
        }
        assert_eq!(Preset::named("medium-build"), None);
    }
}
