//! Headers of Radiance HDR files (.hdr, .pic): exposure, colour correction and orientation, which the `image` crate
//! does not apply (G. Ward, Real Pixels, Graphics Gems II, 1991; Radiance's "File Formats", "Picture File Format").

use image::DynamicImage;

/// Whether bytes are a Radiance HDR file.
pub(super) fn is_radiance(bytes: &[u8]) -> bool {
    bytes.starts_with(b"#?RADIANCE") || bytes.starts_with(b"#?RGBE")
}

/// Values of a header that the decoder does not apply.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Header {
    /// Divisor of red, green and blue: the product of all EXPOSURE and COLORCORR lines.
    divisor: [f32; 3],
    /// Whether scanlines are columns.
    by_columns: bool,
    /// Whether x decreases in the file.
    flips_x: bool,
    /// Whether y, which counts from the bottom, increases in the file.
    flips_y: bool,
}

/// Parses the header. Returns it, and the file with a header of the standard orientation.
///
/// # Errors
/// A message if the header is damaged or its pixels are not RGBE.
pub(super) fn standard(bytes: &[u8]) -> Result<(Header, Vec<u8>), String> {
    let mut rest = bytes;
    let mut line = || {
        let end = rest.iter().position(|&byte| byte == b'\n').ok_or("damaged: its header does not end")?;
        let text = String::from_utf8_lossy(&rest[..end]);
        rest = &rest[end + 1..];
        Ok::<_, String>(text.trim().to_owned())
    };
    let mut divisor = [1.0f32; 3];
    loop {
        let text = line()?;
        if text.is_empty() {
            break;
        }
        let Some((key, value)) = text.split_once('=') else { continue };
        let numbers: Vec<f32> = value.split_whitespace().map_while(|word| word.parse().ok()).collect();
        let factors = match (key.trim(), numbers.as_slice()) {
            ("FORMAT", _) if value.trim() == "32-bit_rle_xyze" => {
                let what = "has XYZE colours, which are not supported; convert it";
                return Err(format!("{what} with Radiance: `ra_xyze -r in.hdr out.hdr`"));
            }
            ("FORMAT", _) if value.trim() != "32-bit_rle_rgbe" => {
                return Err("a Radiance picture of another format than 32-bit_rle_rgbe".to_owned());
            }
            ("EXPOSURE", &[all]) => [all; 3],
            ("COLORCORR", &[r, g, b]) => [r, g, b],
            _ => continue,
        };
        // Other values are invalid.
        if factors.iter().all(|factor| *factor > 0.0 && factor.is_finite()) {
            divisor = std::array::from_fn(|i| divisor[i] * factors[i]);
        }
    }
    let size = line()?;
    let words: Vec<&str> = size.split_whitespace().collect();
    let is_axis = |word: &str| matches!(word, "-X" | "+X" | "-Y" | "+Y");
    let is_size = |word: &str| word.parse::<u32>().is_ok();
    let &[first, lines, second, length] = words.as_slice() else { return Err(no_size(&size)) };
    let are_axes = is_axis(first) && is_axis(second) && first[1..] != second[1..];
    if !(are_axes && is_size(lines) && is_size(length)) {
        return Err(no_size(&size));
    }
    let has = |axis| first == axis || second == axis;
    let (by_columns, flips_x, flips_y) = (first.ends_with('X'), has("-X"), has("+Y"));
    let mut file = format!("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {lines} +X {length}\n").into_bytes();
    file.extend_from_slice(rest);
    Ok((Header { divisor, by_columns, flips_x, flips_y }, file))
}

fn no_size(line: &str) -> String {
    let line: String = line.chars().take(40).collect();
    format!("damaged: `{line}` is not a resolution line, such as -Y 512 +X 1024")
}

impl Header {
    /// Applies orientation and exposure to a picture that was decoded in the standard orientation.
    pub(super) fn apply(self, mut picture: DynamicImage) -> DynamicImage {
        if self.by_columns {
            // Both together transpose the picture.
            picture = picture.rotate90().fliph();
        }
        if self.flips_x {
            picture = picture.fliph();
        }
        if self.flips_y {
            picture = picture.flipv();
        }
        if self.divisor == [1.0; 3] {
            return picture;
        }
        let mut values = picture.into_rgb32f();
        for pixel in values.pixels_mut() {
            pixel.0 = std::array::from_fn(|i| pixel.0[i] / self.divisor[i]);
        }
        DynamicImage::ImageRgb32F(values)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(header: &str, texels: &[u8]) -> Result<Vec<f32>, String> {
        let file: Vec<u8> =
            [header.as_bytes(), &texels.iter().flat_map(|&m| [m, 0, 0, 129]).collect::<Vec<_>>()].concat();
        let (header, standard) = standard(&file)?;
        let decoded = image::load_from_memory(&standard).map_err(|e| e.to_string())?;
        let values = header.apply(decoded).into_rgb32f();
        Ok(values.pixels().map(|pixel| pixel.0[0]).collect())
    }

    /// A mantissa m with the exponent 129 is m / 128. The picture is 1 2 3 over 4 5 6, in 128ths; a file lists its
    /// scanlines by the first axis, each by the second.
    #[test]
    fn all_orientations_give_the_same_picture() {
        for (size, order) in [
            ("-Y 2 +X 3", [1, 2, 3, 4, 5, 6]),
            ("+Y 2 +X 3", [4, 5, 6, 1, 2, 3]),
            ("-Y 2 -X 3", [3, 2, 1, 6, 5, 4]),
            ("+Y 2 -X 3", [6, 5, 4, 3, 2, 1]),
            ("+X 3 -Y 2", [1, 4, 2, 5, 3, 6]),
            ("+X 3 +Y 2", [4, 1, 5, 2, 6, 3]),
            ("-X 3 -Y 2", [3, 6, 2, 5, 1, 4]),
            ("-X 3 +Y 2", [6, 3, 5, 2, 4, 1]),
        ] {
            let found = picture(&format!("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n{size}\n"), &order);
            let found = found.map(|all| all.iter().map(|value| value * 128.0).collect::<Vec<_>>());
            assert_eq!(found, Ok(vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.0]), "{size}");
        }
    }

    /// Divided by 4 x 2 and by the red of the correction, 0.5: 64 / 128 / 4. Invalid exposures are ignored.
    #[test]
    fn exposures_divide_by_their_product() {
        let lines =
            "EXPOSURE=4\nEXPOSURE= 2.0\nCOLORCORR= 0.5 1 1\nEXPOSURE=0\nEXPOSURE=bright\nVIEW= -vp 1 2 3\n";
        for magic in ["#?RADIANCE", "#?RGBE"] {
            let found = picture(&format!("{magic}\n# by hand\n{lines}\n-Y 1 +X 1\n"), &[64]);
            assert_eq!(found, Ok(vec![0.125]));
        }
    }

    #[test]
    fn headers_that_cannot_be_read() {
        for (header, expected) in [
            ("#?RADIANCE\nFORMAT=32-bit_rle_xyze\n\n-Y 1 +X 1\n", "ra_xyze -r"),
            ("#?RADIANCE\nFORMAT=ascii\n\n-Y 1 +X 1\n", "another format"),
            ("#?RADIANCE\n\n-Y 1 +Y 1\n", "`-Y 1 +Y 1` is not a resolution line"),
            ("#?RADIANCE\n\n-Y 1\n", "is not a resolution line"),
            ("#?RADIANCE\n\n-Y 99999999999 +X 1\n", "is not a resolution line"),
            ("#?RADIANCE\nEXPOSURE=1", "does not end"),
        ] {
            let found = picture(header, &[1]).expect_err("a fault");
            assert!(found.contains(expected), "{header}: {found}");
        }
    }
}
