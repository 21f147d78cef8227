//! The tiers of numerics by name; [`super::Tier`] has what they do.

/// How exactly it is decided what a ray hits, from the least to the most.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize, schemars::JsonSchema))]
#[cfg_attr(feature = "serde", serde(rename_all = "lowercase"))]
pub enum Numerics {
    /// f32 throughout, without error bounds. Rays may slip between triangles. Formerly `fast`.
    #[cfg_attr(feature = "serde", serde(alias = "fast"))]
    Naive,
    /// Corners in f32, rays and decisions in f64. Closed meshes stay closed: docs/closed-meshes.md.
    #[default]
    Watertight,
    /// Rays, corners and boxes in f64.
    Double,
    /// As `double`, and every decision is that of exact arithmetic.
    Exact,
}

impl Numerics {
    /// Every tier.
    pub const ALL: [Numerics; 4] = [Numerics::Naive, Numerics::Watertight, Numerics::Double, Numerics::Exact];

    /// The name as typed by users.
    pub fn name(self) -> &'static str {
        match self {
            Numerics::Naive => "naive",
            Numerics::Watertight => "watertight",
            Numerics::Double => "double",
            Numerics::Exact => "exact",
        }
    }

    /// The tier of this name, also of its former one.
    pub fn named(name: &str) -> Option<Self> {
        let name = if name == "fast" { "naive" } else { name };
        Self::ALL.into_iter().find(|tier| tier.name() == name)
    }
}
