//! Colours in scene files.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A colour as typed: `[r, g, b]` with integers from 0 to 255, or `"#rrggbb"`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct ColourValue(pub [u8; 3]);

impl ColourValue {
    /// The colour of six hexadecimal digits, after `#` or alone.
    pub fn of_digits(text: &str) -> Option<Self> {
        let digits = text.strip_prefix('#').unwrap_or(text);
        parse_hex(&format!("#{digits}")).map(ColourValue)
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
                parse_hex(&text).map(ColourValue).ok_or_else(|| serde::de::Error::custom("expected a colour"))
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
            "description": "A colour: [r, g, b] with integers from 0 to 255, or \"#rrggbb\".",
            "oneOf": [
                { "type": "array", "items": { "type": "integer", "minimum": 0, "maximum": 255 },
                  "minItems": 3, "maxItems": 3 },
                { "type": "string", "pattern": "^#[0-9a-fA-F]{6}$" }
            ]
        })
    }
}

fn parse_hex(text: &str) -> Option<[u8; 3]> {
    let digits =
        text.strip_prefix('#').filter(|d| d.len() == 6 && d.bytes().all(|b| b.is_ascii_hexdigit()))?;
    let value = u32::from_str_radix(digits, 16).ok()?;
    let [_, r, g, b] = value.to_be_bytes();
    Some([r, g, b])
}
