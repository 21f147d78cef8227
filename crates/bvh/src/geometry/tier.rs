//! The tiers of numerics by name; [`super::Tier`] has what they do.

/// How exactly it is decided what a ray hits, from the least to the most.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize, schemars::JsonSchema))]
#[cfg_attr(feature = "serde", serde(rename_all = "lowercase"))]
#[non_exhaustive]
pub enum Numerics {
    /// f32 throughout, as fast as possible, without any guarantee:
    /// - Rays pass between triangles, and slip past boxes that they touch: neither has error bounds.
    /// - t, barycentrics and the closest of several hits are as good as f32. Of hits at equal t, any is the closest.
    /// - The structure, the instruction set, and whether rays are traced alone, as streams or as packets change hits, and so
    ///   do splits of triangles, refitting and crops. For one structure, instruction set and order of rays, equal input has
    ///   equal results; threads do not matter.
    /// - Secondary rays are offset along the normal by the error of f32 (pbrt, 4th edition, section 6.8). They may
    ///   start behind neighbouring surfaces, or hit the surface that they leave.
    /// - Products of up to four lengths leave the range of f32 at extreme scales.
    Fast,
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
    pub const ALL: [Numerics; 4] = [Numerics::Fast, Numerics::Watertight, Numerics::Double, Numerics::Exact];

    /// The tiers with guarantees: all but `fast`.
    pub const STRICT: [Numerics; 3] = [Numerics::Watertight, Numerics::Double, Numerics::Exact];

    /// The name as typed by users.
    pub fn name(self) -> &'static str {
        match self {
            Numerics::Fast => "fast",
            Numerics::Watertight => "watertight",
            Numerics::Double => "double",
            Numerics::Exact => "exact",
        }
    }

    /// The tier of this name.
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|tier| tier.name() == name)
    }
}
