//! Colours in scene files and on the command line.

use color::Srgb;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A colour as typed: `[r, g, b]` with integers from 0 to 255, `"#rrggbb"`, `"#rgb"` or a CSS name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct ColourValue(pub [u8; 3]);

impl ColourValue {
    /// The colour of a text: `#rrggbb`, `#rgb`, or one of the names of CSS Color Module Level 4, in any case. `None` for
    /// other forms of CSS, and for `transparent`.
    pub fn of_text(text: &str) -> Option<Self> {
        let is_hex = text.starts_with('#') && [4, 7].contains(&text.len());
        let is_name = text.bytes().all(|b| b.is_ascii_alphabetic());
        // The crate spells grey with an a.
        let text = text.to_ascii_lowercase().replace("grey", "gray");
        let css = (is_hex || is_name).then(|| color::parse_color(&text).ok())??;
        let [r, g, b, alpha] = css.to_alpha_color::<Srgb>().to_rgba8().to_u8_array();
        (alpha == 255).then_some(ColourValue([r, g, b]))
    }

    /// As [`ColourValue::of_text`]; hexadecimal digits may stand without `#`, which begins a comment in shells.
    pub fn of_argument(text: &str) -> Option<Self> {
        Self::of_text(text).or_else(|| Self::of_text(&format!("#{text}")))
    }
}

impl<'de> Deserialize<'de> for ColourValue {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> std::result::Result<Self, D::Error> {
        #[derive(Deserialize)]
        #[serde(untagged, expecting = "expected a colour")]
        enum Form {
            Numbers([u8; 3]),
            Text(String),
        }
        match Form::deserialize(deserializer)? {
            Form::Numbers(rgb) => Ok(ColourValue(rgb)),
            Form::Text(text) => {
                ColourValue::of_text(&text).ok_or_else(|| serde::de::Error::custom("expected a colour"))
            }
        }
    }
}

impl JsonSchema for ColourValue {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "Colour".into()
    }

    fn json_schema(_: &mut schemars::SchemaGenerator) -> schemars::Schema {
        schemars::json_schema!({
            "description": "A colour: [r, g, b] with integers from 0 to 255, \"#rrggbb\", \"#rgb\" or a CSS name, such as \"white\".",
            "oneOf": [
                { "type": "array", "items": { "type": "integer", "minimum": 0, "maximum": 255 },
                  "minItems": 3, "maxItems": 3 },
                { "type": "string", "pattern": "^(#([0-9a-fA-F]{3}){1,2}|[a-zA-Z]+)$" }
            ]
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_are_hexadecimal_or_names_of_css() {
        let of = |text: &str| ColourValue::of_text(text).map(|colour| colour.0);
        assert_eq!((of("#Ff8001"), of("#f80")), (Some([255, 128, 1]), Some([255, 136, 0])));
        // CSS Color Module Level 4, section 6.1.
        for (name, rgb) in [
            ("white", [255; 3]),
            ("Grey", [128; 3]),
            ("gray", [128; 3]),
            ("darkslategrey", [47, 79, 79]),
            ("rebeccapurple", [102, 51, 153]),
        ] {
            assert_eq!(of(name), Some(rgb), "{name}");
        }
        for bad in [
            "",
            "#",
            "#ff80",
            "#ff800",
            "#ff800g",
            "#ff8001ff",
            "ff8001",
            "rgb(1,2,3)",
            " red",
            "transparent",
            "reddish",
        ] {
            assert_eq!(of(bad), None, "{bad}");
        }
        let argument = |text: &str| ColourValue::of_argument(text).map(|colour| colour.0);
        assert_eq!(
            (argument("ff8001"), argument("red"), argument("##ff8001")),
            (Some([255, 128, 1]), Some([255, 0, 0]), None)
        );
        // All 8-bit values are exact.
        assert!((0..=255u8).all(|v| of(&format!("#{v:02x}{v:02x}{v:02x}")) == Some([v; 3])));
    }
}
