//! Animated PNG, and uncompressed frames for pipes.

use std::io::{self, Write};

use super::{VideoSpec, yuv};
use crate::film::{ColourPipeline, Film};

/// An animated PNG that loops forever (PNG, third edition).
pub(crate) fn apng<W: Write>(out: W, spec: &VideoSpec) -> io::Result<png::Writer<W>> {
    let [width, height] = spec.size;
    let mut encoder = png::Encoder::new(out, width, height);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_compression(png::Compression::Fast);
    encoder.set_animated(spec.frames as u32, 0)?;
    let (numerator, denominator) = delay(spec.fps);
    encoder.set_frame_delay(numerator, denominator)?;
    if spec.pipeline == ColourPipeline::Linear {
        encoder.set_source_srgb(png::SrgbRenderingIntent::RelativeColorimetric);
    }
    Ok(encoder.write_header()?)
}

/// The seconds per frame as a fraction of two 16-bit numbers. Exact for integer frame rates and for multiples of
/// 1/1001.
fn delay(fps: f64) -> (u16, u16) {
    for numerator in [1u16, 1001, 1000, 100, 10] {
        let denominator = fps * f64::from(numerator);
        if denominator <= f64::from(u16::MAX)
            && (denominator - denominator.round()).abs() < 1e-3
            && denominator >= 1.0
        {
            return (numerator, denominator.round() as u16);
        }
    }
    ((1000.0 / fps).round().clamp(1.0, 65535.0) as u16, 1000)
}

/// Writes the header line of YUV4MPEG2.
pub(crate) fn y4m_header(spec: &VideoSpec, out: &mut dyn Write) -> io::Result<()> {
    let [width, height] = spec.size;
    let rate = (spec.fps * 1000.0).round() as u64;
    writeln!(out, "YUV4MPEG2 W{width} H{height} F{rate}:1000 Ip A1:1 C444 XCOLORRANGE=LIMITED")
}

/// A frame of YUV4MPEG2: three planes at full resolution, by ITU-R BT.709.
pub(crate) fn y4m_frame(film: &Film<[u8; 3]>) -> Vec<u8> {
    const FRAME: &[u8] = b"FRAME\n";
    let pixels = film.bytes();
    let pixels: &[[u8; 3]] = pixels.as_chunks().0;
    let area = pixels.len();
    let mut bytes = Vec::with_capacity(FRAME.len() + 3 * area);
    bytes.extend_from_slice(FRAME);
    bytes.extend(pixels.iter().map(|&rgb| yuv::luma(rgb)));
    for plane in 0..2 {
        bytes.extend(pixels.iter().map(|&rgb| yuv::chroma(rgb)[plane]));
    }
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn delays_are_fractions() {
        assert_eq!(delay(30.0), (1, 30));
        assert_eq!(delay(30000.0 / 1001.0), (1001, 30000));
        assert_eq!(delay(12.5), (1000, 12500));
        assert_eq!(delay(0.5), (1000, 500));
    }
}
