//! How pictures are looked up.

/// How a picture is looked up: outside 0..1, and where its texels are larger or smaller than pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Sampler {
    /// Along u.
    pub wrap_u: Wrap,
    /// Along v.
    pub wrap_v: Wrap,
    /// Where texels are larger than pixels; `None` where the file leaves it open.
    pub magnify: Option<Lookup>,
    /// Where texels are smaller than pixels; `None` where the file leaves it open.
    pub minify: Option<Minify>,
}

/// What happens to a texture coordinate outside 0..1.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Wrap {
    /// The picture repeats.
    #[default]
    Repeat,
    /// Every other repetition is mirrored.
    MirroredRepeat,
    /// The picture's edge goes on for ever.
    ClampToEdge,
}

/// How the value between texels, or between levels of a pyramid, is found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Lookup {
    /// That of the nearest.
    Nearest,
    /// Interpolated linearly.
    Linear,
}

/// How a picture is looked up where its texels are smaller than pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Minify {
    /// Between texels.
    pub within: Lookup,
    /// Between the levels of the picture's pyramid; `None` where it is looked up at full size.
    pub between: Option<Lookup>,
}

/// A user's choice of filter for all pictures, over what their samplers say.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TextureFilter {
    /// The nearest texel.
    Nearest,
    /// Between four texels at full size.
    Bilinear,
    /// Between eight texels of the two levels whose texels are about as large as the pixel (trilinear).
    Mipmap,
    /// Several lookups as of `Mipmap` along the longer axis of what the pixel sees.
    Anisotropic,
}

impl TextureFilter {
    /// Every filter.
    pub const ALL: [TextureFilter; 4] =
        [TextureFilter::Nearest, TextureFilter::Bilinear, TextureFilter::Mipmap, TextureFilter::Anisotropic];

    /// The name as typed by users.
    pub fn name(self) -> &'static str {
        match self {
            TextureFilter::Nearest => "nearest",
            TextureFilter::Bilinear => "bilinear",
            TextureFilter::Mipmap => "mipmap",
            TextureFilter::Anisotropic => "anisotropic",
        }
    }
}

/// What is done for a lookup: a sampler with nothing left open.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Filter {
    /// Where texels are larger than pixels.
    pub magnify: Lookup,
    /// Where they are smaller.
    pub minify: Minify,
    /// Whether pyramids are looked up several times along the longer axis of what the pixel sees.
    pub anisotropic: bool,
}

impl Filter {
    /// Whether the size of what a pixel sees matters.
    pub fn needs_footprint(&self) -> bool {
        self.minify != Minify { within: self.magnify, between: None }
    }

    /// Whether pyramids are looked up.
    pub fn needs_mip_map(&self) -> bool {
        self.minify.between.is_some()
    }
}

impl Sampler {
    /// The filter: the user's where there is one, else the file's, else trilinear in a pyramid and linear above it.
    pub fn filter(&self, wish: Option<TextureFilter>) -> Filter {
        use Lookup::{Linear, Nearest};
        let full = |lookup| Filter {
            magnify: lookup,
            minify: Minify { within: lookup, between: None },
            anisotropic: false,
        };
        let trilinear = Minify { within: Linear, between: Some(Linear) };
        match wish {
            Some(TextureFilter::Nearest) => full(Nearest),
            Some(TextureFilter::Bilinear) => full(Linear),
            Some(TextureFilter::Mipmap) => Filter { minify: trilinear, ..full(Linear) },
            Some(TextureFilter::Anisotropic) => {
                Filter { minify: trilinear, anisotropic: true, ..full(Linear) }
            }
            None => Filter {
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
    fn the_user_comes_before_the_file_and_the_file_before_the_default() {
        let pixels = Sampler {
            magnify: Some(Lookup::Nearest),
            minify: Some(Minify { within: Lookup::Nearest, between: None }),
            ..Sampler::default()
        };
        assert!(!pixels.filter(None).needs_footprint());
        assert_eq!(pixels.filter(None), pixels.filter(Some(TextureFilter::Nearest)));
        assert_eq!(
            pixels.filter(Some(TextureFilter::Mipmap)),
            Sampler::default().filter(Some(TextureFilter::Mipmap))
        );
        assert_eq!(Sampler::default().filter(None), Sampler::default().filter(Some(TextureFilter::Mipmap)));
        for filter in TextureFilter::ALL {
            let mips = matches!(filter, TextureFilter::Mipmap | TextureFilter::Anisotropic);
            assert_eq!(Sampler::default().filter(Some(filter)).needs_mip_map(), mips, "{}", filter.name());
        }
        // Linear above and nearest below differ only by what the pixel sees.
        let mixed = Sampler { minify: pixels.minify, ..Sampler::default() }.filter(None);
        assert!(mixed.needs_footprint() && !mixed.needs_mip_map());
    }
}
