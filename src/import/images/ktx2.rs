//! KTX2 images of Basis Universal (KHR_texture_basisu), decoded by `basisu`.

use basisu::{DecodeFlags, TargetFormat, Transcoder};
use image::{DynamicImage, RgbaImage};

use crate::error::contain;
use crate::film::read::{Read, ReadError};
use crate::limits;

/// The first bytes of a KTX2 file (KTX File Format Specification 2.0, section 3.1).
const IDENTIFIER: [u8; 12] = [0xAB, b'K', b'T', b'X', b' ', b'2', b'0', 0xBB, b'\r', b'\n', 0x1A, b'\n'];

/// Texels of an image of any content: 8192 x 8192.
const ALWAYS: u64 = 1 << 26;

/// The most texels for each compressed byte of larger images; photographs have about 8.
const TEXELS_A_BYTE: u64 = 256;

/// Whether bytes are a KTX2 file.
pub(crate) fn is_ktx2(bytes: &[u8]) -> bool {
    bytes.starts_with(&IDENTIFIER)
}

/// Decodes the full-size image to 8 bits. `bytes_each`: bytes per pixel that the caller will allocate in addition.
pub(crate) fn decode(bytes: &[u8], bytes_each: u64) -> Read<DynamicImage> {
    let damaged = || ReadError::Damaged("not a KTX2 picture of Basis Universal, or damaged".to_owned());
    let number = |at: usize| Some(u32::from_le_bytes(bytes.get(at..at + 4)?.try_into().ok()?));
    let (width, height) = number(20).zip(number(24)).ok_or_else(damaged)?;
    // Decoded texels, and 16 bytes for 16 of them where the level is compressed once more.
    let needed = limits::product(&[width.into(), height.into(), 4 + 1 + bytes_each]);
    limits::check_claim(needed)
        .map_err(|excess| ReadError::too_large(width.into(), height.into(), &excess))?;
    // A few bytes may stand for any number of equal texels.
    let long = |at: usize| Some(u64::from_le_bytes(bytes.get(at..at + 8)?.try_into().ok()?));
    let (offset, length) = long(80).zip(long(88)).ok_or_else(damaged)?;
    if offset.checked_add(length).is_none_or(|end| end > bytes.len() as u64) {
        return Err(damaged());
    }
    if limits::product(&[width.into(), height.into()]) > length.saturating_mul(TEXELS_A_BYTE).max(ALWAYS) {
        return Err(damaged());
    }
    // The length of the first level before that compression (section 3.9.6) is at most its blocks and their alpha.
    let most = limits::product(&[u64::from(width).div_ceil(4), u64::from(height).div_ceil(4), 32]);
    if long(96).is_none_or(|length| length > most) {
        return Err(damaged());
    }
    let transcode = || {
        let texture = Transcoder::new(bytes).ok()?;
        texture.transcode(0, TargetFormat::Rgba32, DecodeFlags::NONE).ok()
    };
    let texels = contain(transcode).flatten().ok_or_else(damaged)?;
    RgbaImage::from_raw(width, height, texels).map(DynamicImage::ImageRgba8).ok_or_else(damaged)
}
