//! The limits on the bounces of paths, as options and scene files give them.

use std::fmt;

use super::PathSettings;

/// The limits on the bounces of paths.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BounceLimits {
    /// The most bounces that count.
    pub depth: u32,
    /// The most perfectly specular bounces; `None` where these count as all others.
    pub specular: Option<u32>,
}

impl Default for BounceLimits {
    fn default() -> Self {
        BounceLimits::new(None, None)
    }
}

impl BounceLimits {
    /// `depth` and `specular` are those asked for: a limit of all bounces alone limits all, otherwise perfectly
    /// specular ones have a limit of their own.
    pub(super) fn new(depth: Option<u32>, specular: Option<u32>) -> Self {
        let default_specular = depth.is_none().then_some(PathSettings::DEFAULT_DEPTH_SPECULAR);
        let depth = depth.unwrap_or(PathSettings::DEFAULT_DEPTH);
        BounceLimits { depth, specular: specular.or(default_specular) }
    }

    /// The first generation with vertices that a limit may end paths at. Russian roulette starts there or before.
    pub fn first(&self) -> u32 {
        self.depth.min(self.specular.unwrap_or(u32::MAX))
    }

    /// Whether a bounce counts towards `depth`.
    #[inline]
    pub(super) fn counts(&self, is_delta: bool) -> bool {
        !is_delta || self.specular.is_none()
    }

    /// Twice these limits.
    pub fn doubled(&self) -> Self {
        let twice = |limit: u32| (2 * limit.max(1)).min(PathSettings::MAX_DEPTH);
        BounceLimits { depth: twice(self.depth), specular: self.specular.map(twice) }
    }

    /// The options that set these limits.
    pub fn options(&self) -> String {
        let specular = self.specular.map(|limit| format!(" --depth-specular {limit}"));
        format!("--depth {}{}", self.depth, specular.unwrap_or_default())
    }
}

impl fmt::Display for BounceLimits {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let plural = if self.depth == 1 { "" } else { "s" };
        write!(f, "{} bounce{plural}", self.depth)?;
        self.specular.map_or(Ok(()), |specular| write!(f, " and {specular} specular ones"))
    }
}
