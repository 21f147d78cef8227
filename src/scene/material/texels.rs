//! Texels of images in the bit depth of their files.

use std::sync::Arc;

/// Red, green and blue per texel, row by row from the top, in 8 bits, or in 16 for files of more. Clones share the
/// values.
#[derive(Debug, Clone, PartialEq)]
pub enum TexelValues {
    /// Values from 0 to 255.
    U8(Arc<[[u8; 3]]>),
    /// Values from 0 to 65535.
    U16(Arc<[[u16; 3]]>),
}

impl TexelValues {
    /// The number of texels.
    pub fn len(&self) -> usize {
        match self {
            TexelValues::U8(texels) => texels.len(),
            TexelValues::U16(texels) => texels.len(),
        }
    }

    /// Whether there are no texels.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Stored value of 1: 255 or 65535.
    #[inline]
    pub fn largest(&self) -> u16 {
        match self {
            TexelValues::U8(_) => u8::MAX.into(),
            TexelValues::U16(_) => u16::MAX,
        }
    }

    /// The values of the texel at `index`, 0 to [`TexelValues::largest`].
    #[inline]
    pub fn get(&self, index: usize) -> [u16; 3] {
        match self {
            TexelValues::U8(texels) => texels[index].map(u16::from),
            TexelValues::U16(texels) => texels[index],
        }
    }

    /// The values of each texel.
    pub fn iter(&self) -> impl Iterator<Item = [u16; 3]> {
        (0..self.len()).map(|index| self.get(index))
    }

    /// Values as bytes.
    pub fn as_bytes(&self) -> &[u8] {
        match self {
            TexelValues::U8(texels) => texels.as_flattened(),
            TexelValues::U16(texels) => bytemuck::cast_slice(texels),
        }
    }

    /// Collects `count` texels `texel(index)`. `largest` selects the bit depth.
    pub(crate) fn collect(largest: u16, count: usize, texel: impl Fn(usize) -> [u16; 3]) -> Self {
        let texels = (0..count).map(texel);
        if largest > u8::MAX.into() {
            texels.collect()
        } else {
            texels.map(|values| values.map(|value| value as u8)).collect()
        }
    }
}

impl From<Arc<[[u8; 3]]>> for TexelValues {
    fn from(texels: Arc<[[u8; 3]]>) -> Self {
        TexelValues::U8(texels)
    }
}

impl From<Arc<[[u16; 3]]>> for TexelValues {
    fn from(texels: Arc<[[u16; 3]]>) -> Self {
        TexelValues::U16(texels)
    }
}

impl<T> FromIterator<[T; 3]> for TexelValues
where
    TexelValues: From<Arc<[[T; 3]]>>,
{
    fn from_iter<I: IntoIterator<Item = [T; 3]>>(texels: I) -> Self {
        texels.into_iter().collect::<Arc<[_]>>().into()
    }
}
