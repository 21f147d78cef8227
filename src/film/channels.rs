//! Reading of all channels and text attributes of an OpenEXR image, as `kiln render --aov` writes them.

use std::io::Cursor;
use std::path::Path;

use exr::prelude::{AttributeValue, ReadChannels, ReadLayers, Text, read};

use super::read::{Read, ReadError, contained, exr_reader};
use crate::error::Result;
use crate::files;

/// The channels and text attributes of an OpenEXR file.
#[derive(Debug, Clone, PartialEq)]
pub struct ExrChannels {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Names, `LAYER.CHANNEL`, and values, row by row from the top.
    pub channels: Vec<(String, Vec<f32>)>,
    /// Names and values of the attributes that are text, such as the settings of kiln.
    pub settings: Vec<(String, String)>,
}

impl ExrChannels {
    /// Reads an OpenEXR file.
    ///
    /// # Errors
    /// [`crate::error::Error::Input`] if the file is missing, damaged, too large, or of another format.
    pub fn open(file: &Path) -> Result<Self> {
        let bytes = files::read_file(file).map_err(|e| files::unreadable(file, &e))?;
        decode(&bytes).map_err(|e| e.into_error(file))
    }

    /// The values of a channel.
    pub fn channel(&self, name: &str) -> Option<&[f32]> {
        self.channels.iter().find(|(known, _)| known == name).map(|(_, values)| &values[..])
    }

    /// The value of a setting.
    pub fn setting(&self, name: &str) -> Option<&str> {
        self.settings.iter().find(|(known, _)| known == name).map(|(_, value)| &value[..])
    }
}

fn decode(bytes: &[u8]) -> Read<ExrChannels> {
    if !bytes.starts_with(&[0x76, 0x2f, 0x31, 0x01]) {
        return Err(ReadError::Damaged("not an EXR picture, so it has no channels".into()));
    }
    // As stored, and converted to `f32`.
    exr_reader(bytes, |header| header.channels.list.len() * 2 * size_of::<f32>())?;
    let parse = || {
        read()
            .no_deep_data()
            .largest_resolution_level()
            .all_channels()
            .first_valid_layer()
            .all_attributes()
            .from_buffered(Cursor::new(bytes))
            .map_err(|e| format!("damaged: {e}"))
    };
    let picture = contained(parse)?;
    let layer = picture.layer_data;
    let text = |(name, value): (&Text, &AttributeValue)| match value {
        AttributeValue::Text(text) => Some((name.to_string(), text.to_string())),
        _ => None,
    };
    // The decoder's map has no order.
    let mut settings: Vec<_> = layer.attributes.other.iter().filter_map(text).collect();
    settings.sort_unstable();
    let channel = |channel: exr::prelude::AnyChannel<exr::prelude::FlatSamples>| {
        (channel.name.to_string(), channel.sample_data.values_as_f32().collect())
    };
    Ok(ExrChannels {
        width: layer.size.width() as u32,
        height: layer.size.height() as u32,
        channels: layer.channel_data.list.into_iter().map(channel).collect(),
        settings,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::write::{Channel, Format, OutputImage, encode};
    use crate::film::{ExrAttributes, Film, Window};

    #[test]
    fn what_is_written_is_read_and_beginnings_of_it_are_not() {
        let window = Window { x: 3, y: 0, width: 2, height: 2 };
        let rows = [[0.0, 1.0, 2.0], [3.0, 4.0, 5.0], [6.0, 7.0, 8.0], [9.0, 10.0, 11.0]];
        let more = Channel { name: "Variance.R".into(), values: vec![0.5, f32::INFINITY, 0.25, 1.0] };
        let picture = OutputImage::Float(
            Film::from_rows(window, &rows).unwrap(),
            vec![more],
            ExrAttributes::of_size([5, 2]),
        );
        let mut bytes = Vec::new();
        let metadata = [("kiln:samples".to_owned(), "16".to_owned())];
        encode(&picture, &metadata, Format::Exr, &mut bytes).unwrap();
        let image = decode(&bytes).unwrap();
        assert_eq!((image.width, image.height, image.channels.len()), (2, 2, 4));
        assert_eq!(image.channel("G"), Some(&[1.0, 4.0, 7.0, 10.0][..]));
        assert_eq!(image.channel("Variance.R"), Some(&[0.5, f32::INFINITY, 0.25, 1.0][..]));
        assert_eq!((image.setting("kiln:samples"), image.setting("kiln:seed")), (Some("16"), None));
        for length in 0..bytes.len() {
            assert!(decode(&bytes[..length]).is_err(), "{length} bytes");
        }
    }
}
