//! Bits as good as random from numbers in order (SplitMix64; Steele, Lea and Flood, Fast Splittable Pseudorandom Number
//! Generators, 2014).

/// The step between numbers that are to be mixed: 2^64 over the golden ratio, made odd.
pub const GOLDEN: u64 = 0x9e37_79b9_7f4a_7c15;

/// Spreads a difference in any bit over all of them.
pub fn mix(mut bits: u64) -> u64 {
    bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    bits ^ (bits >> 31)
}
