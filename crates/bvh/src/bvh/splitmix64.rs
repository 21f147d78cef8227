//! SplitMix64: pseudorandom numbers from a counter (Steele, Lea and Flood, Fast Splittable Pseudorandom Number
//! Generators, 2014). Used by the builder and by benchmarks.

/// The increment of the counter: 2^64 over the golden ratio, made odd.
pub const GOLDEN: u64 = 0x9e37_79b9_7f4a_7c15;

/// The mixing function: a change of any input bit changes each output bit with probability about one half.
pub fn splitmix64(mut bits: u64) -> u64 {
    bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    bits ^ (bits >> 31)
}
