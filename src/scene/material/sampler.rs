//! Texture samplers: wrapping and filtering of texture lookups.

/// Texture sampler: wrap modes and filters, as in glTF 2.0.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize)]
pub struct TextureSampler {
    /// Wrap mode along u.
    pub wrap_u: Wrap,
    /// Wrap mode along v.
    pub wrap_v: Wrap,
    /// Magnification filter; `None` if the file does not specify it.
    pub magnify: Option<Interpolation>,
    /// Minification filter; `None` if the file does not specify it.
    pub minify: Option<Minify>,
}

/// Wrap mode of texture coordinates outside 0..1.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default, serde::Serialize)]
pub enum Wrap {
    /// The image repeats.
    #[default]
    Repeat,
    /// The image repeats, every other repetition mirrored.
    MirroredRepeat,
    /// The coordinate is clamped to the edge.
    ClampToEdge,
}

impl Wrap {
    /// The index from 0 to `size - 1` of the texel that `i` stands for.
    #[inline]
    pub fn index(self, i: i64, size: i64) -> i64 {
        // Most indices are inside, and the division would dominate the lookup.
        if (0..size).contains(&i) {
            return i;
        }
        match self {
            Wrap::Repeat => i.rem_euclid(size),
            Wrap::ClampToEdge => i.clamp(0, size - 1),
            Wrap::MirroredRepeat => {
                let i = i.rem_euclid(2 * size);
                i.min(2 * size - 1 - i)
            }
        }
    }
}

/// Interpolation between texels, or between mip levels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
pub enum Interpolation {
    /// The nearest value.
    Nearest,
    /// Linear interpolation.
    Linear,
}

/// Minification filter.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
pub struct Minify {
    /// Between the texels of a level.
    pub within: Interpolation,
    /// Between mip levels; `None` uses the full-size image only.
    pub between: Option<Interpolation>,
}

/// The user's choice of filter for all textures, which overrides their samplers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TextureFilter {
    /// The nearest texel.
    Nearest,
    /// Linear between four texels of the full-size image.
    Bilinear,
    /// Trilinear: between the eight texels of the two mip levels whose texel size is closest to the pixel footprint.
    Mipmap,
    /// Several trilinear lookups along the longer axis of the pixel footprint.
    Anisotropic,
}

names!(TextureFilter {
    Nearest = "nearest", Bilinear = "bilinear", Mipmap = "mipmap", Anisotropic = "anisotropic",
});

/// Resolved filters of a texture lookup: a sampler without unspecified parts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ResolvedTextureFilter {
    /// Magnification filter.
    pub magnify: Interpolation,
    /// Minification filter.
    pub minify: Minify,
    /// Whether mip maps are sampled several times along the longer axis of the pixel footprint.
    pub anisotropic: bool,
}

impl ResolvedTextureFilter {
    /// Whether the lookup depends on the size of the pixel footprint.
    pub fn needs_footprint(&self) -> bool {
        self.minify != Minify { within: self.magnify, between: None }
    }

    /// Whether the lookup needs a mip map.
    pub fn needs_mip_map(&self) -> bool {
        self.minify.between.is_some()
    }
}

impl TextureSampler {
    /// Resolves the filter: the user's if given, else the file's; unspecified parts are trilinear for minification and
    /// linear for magnification.
    pub fn filter(&self, wish: Option<TextureFilter>) -> ResolvedTextureFilter {
        use Interpolation::{Linear, Nearest};
        let full = |lookup| ResolvedTextureFilter {
            magnify: lookup,
            minify: Minify { within: lookup, between: None },
            anisotropic: false,
        };
        let trilinear = Minify { within: Linear, between: Some(Linear) };
        match wish {
            Some(TextureFilter::Nearest) => full(Nearest),
            Some(TextureFilter::Bilinear) => full(Linear),
            Some(TextureFilter::Mipmap) => ResolvedTextureFilter { minify: trilinear, ..full(Linear) },
            Some(TextureFilter::Anisotropic) => {
                ResolvedTextureFilter { minify: trilinear, anisotropic: true, ..full(Linear) }
            }
            None => ResolvedTextureFilter {
                magnify: self.magnify.unwrap_or(Linear),
                minify: self.minify.unwrap_or(trilinear),
                anisotropic: false,
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wrapping() {
        let row = |mode: Wrap| (-3..6).map(|i| mode.index(i, 3)).collect::<Vec<_>>();
        assert_eq!(row(Wrap::Repeat), [0, 1, 2, 0, 1, 2, 0, 1, 2]);
        assert_eq!(row(Wrap::ClampToEdge), [0, 0, 0, 0, 1, 2, 2, 2, 2]);
        assert_eq!(row(Wrap::MirroredRepeat), [2, 1, 0, 0, 1, 2, 2, 1, 0]);
        assert_eq!(Wrap::Repeat.index(i64::MAX, 3), i64::MAX % 3);
    }

    #[test]
    fn the_user_comes_before_the_file_and_the_file_before_the_default() {
        let pixels = TextureSampler {
            magnify: Some(Interpolation::Nearest),
            minify: Some(Minify { within: Interpolation::Nearest, between: None }),
            ..TextureSampler::default()
        };
        assert!(!pixels.filter(None).needs_footprint());
        assert_eq!(pixels.filter(None), pixels.filter(Some(TextureFilter::Nearest)));
        assert_eq!(
            pixels.filter(Some(TextureFilter::Mipmap)),
            TextureSampler::default().filter(Some(TextureFilter::Mipmap))
        );
        assert_eq!(
            TextureSampler::default().filter(None),
            TextureSampler::default().filter(Some(TextureFilter::Mipmap))
        );
        for filter in TextureFilter::ALL {
            let mips = matches!(filter, TextureFilter::Mipmap | TextureFilter::Anisotropic);
            assert_eq!(
                TextureSampler::default().filter(Some(filter)).needs_mip_map(),
                mips,
                "{}",
                filter.name()
            );
        }
        // Linear magnification and nearest minification without mip maps differ only in the pixel footprint.
        let mixed = TextureSampler { minify: pixels.minify, ..TextureSampler::default() }.filter(None);
        assert!(mixed.needs_footprint() && !mixed.needs_mip_map());
    }
}
