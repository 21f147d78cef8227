//! Bits per channel of a picture's file.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Bits per channel: integers in PNG, floating-point numbers in OpenEXR.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(try_from = "u8", into = "u8")]
#[schemars(with = "u8")]
pub enum BitDepth {
    /// 8 bits.
    Eight,
    /// 16 bits.
    Sixteen,
    /// 32 bits.
    ThirtyTwo,
}

names!(BitDepth { Eight = "8", Sixteen = "16", ThirtyTwo = "32" });

impl TryFrom<u8> for BitDepth {
    type Error = &'static str;

    fn try_from(bits: u8) -> Result<Self, Self::Error> {
        BitDepth::ALL.into_iter().find(|depth| u8::from(*depth) == bits).ok_or("give 8, 16 or 32 bits")
    }
}

impl From<BitDepth> for u8 {
    fn from(depth: BitDepth) -> u8 {
        match depth {
            BitDepth::Eight => 8,
            BitDepth::Sixteen => 16,
            BitDepth::ThirtyTwo => 32,
        }
    }
}
