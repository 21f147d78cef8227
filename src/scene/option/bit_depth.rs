//! Bits of a channel of a picture file.

use crate::scene::option::OptionValue;

/// Bits of each channel of a picture file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize, schemars::JsonSchema)]
#[serde(try_from = "u32", into = "u32")]
pub enum BitDepth {
    /// 8-bit integers.
    Eight = 8,
    /// 16-bit integers, or half floats.
    Sixteen = 16,
    /// 32-bit floats.
    ThirtyTwo = 32,
}

names!(BitDepth { Eight = "8", Sixteen = "16", ThirtyTwo = "32" });

impl TryFrom<u32> for BitDepth {
    type Error = String;

    fn try_from(bits: u32) -> Result<Self, String> {
        let found = BitDepth::ALL.into_iter().find(|depth| *depth as u32 == bits);
        found.ok_or_else(|| "give 8, 16 or 32 bits".into())
    }
}

impl From<BitDepth> for u32 {
    fn from(depth: BitDepth) -> u32 {
        depth as u32
    }
}

/// Numbers, unlike other named values, so that Python takes them as such.
impl OptionValue for BitDepth {
    fn parse(text: &str) -> Result<Self, String> {
        text.trim().parse().map_or_else(|_| Err("give 8, 16 or 32 bits".into()), |bits: u32| bits.try_into())
    }

    fn text(&self) -> String {
        self.name().into()
    }
}
