//! Animated PNG, and uncompressed frames for pipes.

use std::io::{self, Write};

use super::{VideoSpec, yuv};
use crate::film::Film;

/// An animated PNG that loops forever (PNG, third edition). Each frame replaces the one before it, alpha included.
pub(crate) fn apng<W: Write>(out: W, spec: &VideoSpec) -> io::Result<png::Writer<W>> {
    let mut encoder = spec.form.encoder(out, spec.size);
    encoder.set_animated(spec.frames as u32, 0)?;
    let (numerator, denominator) = delay(spec.fps);
    encoder.set_frame_delay(numerator, denominator)?;
    encoder.set_blend_op(png::BlendOp::Source)?;
    encoder.set_dispose_op(png::DisposeOp::None)?;
    Ok(encoder.write_header()?)
}

/// The seconds per frame as a fraction of two 16-bit numbers: the first convergent of the continued fraction of `fps`
/// that is `fps` in f64, so exact for every rate that is such a fraction; of others the last with 16 bits.
fn delay(fps: f64) -> (u16, u16) {
    const MOST: f64 = u16::MAX as f64;
    // Convergents: those before the current one and it.
    let ([mut p0, mut q0], [mut p, mut q]) = ([0.0, 1.0], [1.0, 0.0]);
    let mut rest = fps;
    loop {
        let whole = rest.floor();
        let [next_p, next_q] = [whole * p + p0, whole * q + q0];
        if !(next_p <= MOST && next_q <= MOST) {
            break;
        }
        ([p0, q0], [p, q]) = ([p, q], [next_p, next_q]);
        if p / q == fps {
            break;
        }
        rest = (rest - whole).recip();
    }
    match (p, q) {
        // More than 65,535 frames per second, or one in more than 65,535 seconds.
        (_, 0.0) => (1, u16::MAX),
        (0.0, _) => (u16::MAX, 1),
        _ => (q as u16, p as u16),
    }
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
        for (fps, expected) in [
            (30.0, (1, 30)),
            (30000.0 / 1001.0, (1001, 30000)),
            (24000.0 / 1001.0, (1001, 24000)),
            // 12.5 = 25 / 2, 0.7 = 7 / 10.
            (12.5, (2, 25)),
            (0.7, (10, 7)),
            (0.5, (2, 1)),
            (1.0 / 3.0, (3, 1)),
            (29.97, (100, 2997)),
            (65535.0, (1, 65535)),
            (1e6, (1, 65535)),
            (1e-9, (65535, 1)),
        ] {
            assert_eq!(delay(fps), expected, "{fps}");
        }
        // Every fraction of small numbers, in lowest terms.
        for (p, q) in (1..120u16).flat_map(|p| (1..120u16).map(move |q| (p, q))) {
            let (numerator, denominator) = delay(f64::from(p) / f64::from(q));
            assert_eq!(
                u32::from(numerator) * u32::from(p),
                u32::from(denominator) * u32::from(q),
                "{p} / {q}"
            );
            assert!(numerator <= q, "{p} / {q}");
        }
        // pi: its convergents are 3, 22/7, 333/106, 355/113, 103993/33102, the last of which does not fit.
        assert_eq!(delay(std::f64::consts::PI), (113, 355));
    }
}
