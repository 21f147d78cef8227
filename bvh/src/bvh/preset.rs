//! How much work is spent on building.

use obvhs::BvhBuildParams;
use obvhs::ploc::{PlocSearchDistance, SortPrecision};

use super::sah::Budget;

/// A trade-off between build time and traversal time. No image depends on it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "kebab-case"))]
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

    /// The references that the top-down builder may add by spatial splits; `None` for obvhs's PLOC. This decides which
    /// builder a preset uses.
    pub(super) fn top_down(self) -> Option<Budget> {
        match self {
            Preset::FastBuild | Preset::Balanced => None,
            Preset::BestTrace => Some(Budget(0.3)),
        }
    }

    /// As measured with trees of eight. Sorting by 128 bits changed no count of tests; searching wider than 14, a second
    /// reinsertion, or a ratio above 0.015 for the default, brought less than 3 % of them; a ratio of 0.02 brings 0.5 % and takes 5 %
    /// longer to build, one of 0.01 saves 3 % and costs up to 3 %. After a top-down build, 0.03 has 5 % fewer
    /// tests than none in a kitchen, and 1 another 1 % fewer. PLOC's parameters of `BestTrace` are for instances.
    pub(super) fn parameters(self) -> BvhBuildParams {
        let common = BvhBuildParams {
            pre_split: false,
            ploc_search_distance: PlocSearchDistance::Minimum,
            search_depth_threshold: 0,
            reinsertion_batch_ratio: 0.0,
            post_collapse_reinsertion_batch_ratio_multiplier: 0.0,
            sort_precision: SortPrecision::U64,
            max_prims_per_leaf: 8,
            collapse_traversal_cost: 3.0,
        };
        match self {
            Preset::FastBuild => BvhBuildParams {
                ploc_search_distance: PlocSearchDistance::VeryLow,
                reinsertion_batch_ratio: 0.01,
                ..common
            },
            Preset::Balanced => BvhBuildParams {
                ploc_search_distance: PlocSearchDistance::Low,
                search_depth_threshold: 2,
                reinsertion_batch_ratio: 0.015,
                post_collapse_reinsertion_batch_ratio_multiplier: 2.0,
                ..common
            },
            Preset::BestTrace => BvhBuildParams {
                ploc_search_distance: PlocSearchDistance::Medium,
                search_depth_threshold: 1,
                reinsertion_batch_ratio: 0.03,
                post_collapse_reinsertion_batch_ratio_multiplier: 1.0,
                ..common
            },
        }
    }
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
