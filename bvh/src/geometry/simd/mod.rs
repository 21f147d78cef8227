//! Vectors of eight f32 or four f64: [`Simd`], with one implementation for AVX2 and FMA and one in portable Rust.
//!
//! Kernels generic over [`Simd`] are compiled for both and give the same bits: every operation is one IEEE 754
//! operation per lane, except [`Simd::mul_sub`] and [`Simd::mul_add`] on f32, which round once or twice. Those two
//! are used for conservative bounds only, never for a decision.

mod portable;
#[cfg(target_arch = "x86_64")]
#[allow(unsafe_code)]
mod x86;

pub(crate) use portable::Portable;
#[cfg(target_arch = "x86_64")]
pub(crate) use x86::Avx2;

/// Prefetches the first cache line of `items[index]`; the index may be out of range.
#[inline(always)]
pub(crate) fn prefetch<T>(items: &[T], index: usize) {
    #[cfg(target_arch = "x86_64")]
    x86::prefetch(items, index);
    #[cfg(not(target_arch = "x86_64"))]
    let _ = (items, index);
}

/// The first or second of two arrays of eight f32, as a byte offset: selecting takes one addition.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Side(usize);

impl Side {
    const BYTES: usize = size_of::<[f32; 8]>();

    /// The second array if `second`, else the first.
    #[inline(always)]
    pub(crate) fn new(second: bool) -> Self {
        Side(usize::from(second) * Self::BYTES)
    }

    /// The other array.
    #[inline(always)]
    pub(crate) fn other(self) -> Self {
        Side(self.0 ^ Self::BYTES)
    }
}

/// An instruction set and its vectors. Masks have one bit per lane, the lowest for the first lane.
pub(crate) trait Simd: Copy + Send + Sync + 'static {
    /// Eight f32 numbers.
    type F8: Copy;
    /// Four f64 numbers.
    type D4: Copy;

    /// Calls `f`, compiled for this instruction set if it is inlined.
    fn run<R>(f: impl FnOnce() -> R) -> R;
    /// Prefetches `b[index]` if `of_b`, else `a[index]`; the index may be out of range.
    fn prefetch<A, B>(a: &[A], b: &[B], of_b: bool, index: usize);

    /// From an array.
    fn f8(x: [f32; 8]) -> Self::F8;
    /// From one of two arrays.
    fn f8_load(pair: &[[f32; 8]; 2], side: Side) -> Self::F8;
    /// To an array.
    fn f8_array(x: Self::F8) -> [f32; 8];
    /// One number in all eight lanes.
    fn f8_splat(x: f32) -> Self::F8;
    /// a + b
    fn f8_add(a: Self::F8, b: Self::F8) -> Self::F8;
    /// a - b
    fn f8_sub(a: Self::F8, b: Self::F8) -> Self::F8;
    /// a b
    fn f8_mul(a: Self::F8, b: Self::F8) -> Self::F8;
    /// a / b
    fn f8_div(a: Self::F8, b: Self::F8) -> Self::F8;
    /// a b + c, rounded once or twice.
    fn mul_add(a: Self::F8, b: Self::F8, c: Self::F8) -> Self::F8;
    /// a b - c, rounded once or twice.
    fn mul_sub(a: Self::F8, b: Self::F8, c: Self::F8) -> Self::F8;
    /// `a > b ? a : b` per lane: b if either is NaN.
    fn f8_max(a: Self::F8, b: Self::F8) -> Self::F8;
    /// `a < b ? a : b` per lane: b if either is NaN.
    fn f8_min(a: Self::F8, b: Self::F8) -> Self::F8;
    /// The lanes with a <= b.
    fn f8_le(a: Self::F8, b: Self::F8) -> u32;
    /// a in the lanes of a mask, b in the others.
    fn f8_select(mask: u32, a: Self::F8, b: Self::F8) -> Self::F8;
    /// Writes `x` to the elements of a mask.
    fn masked_store(mask: u32, x: u32, to: &mut [u32; 8]);
    /// The least lane; none may be NaN.
    fn f8_reduce_min(x: Self::F8) -> f32;
    /// The greatest lane; none may be NaN.
    fn f8_reduce_max(x: Self::F8) -> f32;
    /// From eight f64, rounded to nearest.
    fn f8_from_d4(low: Self::D4, high: Self::D4) -> Self::F8;

    /// The number of lanes with `enter <= leave`, which are written to the front of `to`, sorted by descending
    /// `enter`. An element has the bits of `enter`, or of a number slightly below it, in its upper half and the lane
    /// of `of` in its lower. `enter` must not be negative. The remaining elements of `to` are unspecified.
    fn sort_entered(enter: Self::F8, leave: Self::F8, of: &[u32; 8], to: &mut [u64; 8]) -> usize;

    /// From an array.
    fn d4(x: [f64; 4]) -> Self::D4;
    /// The transpose of a 4 x 4 matrix.
    fn d4_transposed(rows: [Self::D4; 4]) -> [Self::D4; 4];
    /// From four f32.
    fn d4_from_f32(x: [f32; 4]) -> Self::D4;
    /// To an array.
    fn d4_array(x: Self::D4) -> [f64; 4];
    /// One number in all four lanes.
    fn d4_splat(x: f64) -> Self::D4;
    /// a + b
    fn d4_add(a: Self::D4, b: Self::D4) -> Self::D4;
    /// a - b
    fn d4_sub(a: Self::D4, b: Self::D4) -> Self::D4;
    /// a b
    fn d4_mul(a: Self::D4, b: Self::D4) -> Self::D4;
    /// a / b
    fn d4_div(a: Self::D4, b: Self::D4) -> Self::D4;
    /// `a > b ? a : b` per lane: b if either is NaN.
    fn d4_max(a: Self::D4, b: Self::D4) -> Self::D4;
    /// `a < b ? a : b` per lane: b if either is NaN.
    fn d4_min(a: Self::D4, b: Self::D4) -> Self::D4;
    /// |a|
    fn d4_abs(a: Self::D4) -> Self::D4;
    /// The square root, rounded to nearest.
    fn d4_sqrt(a: Self::D4) -> Self::D4;
    /// |a| with the sign of b.
    fn d4_copysign(a: Self::D4, b: Self::D4) -> Self::D4;
    /// The lanes with a <= b.
    fn d4_le(a: Self::D4, b: Self::D4) -> u32;
    /// The lanes with a < b.
    fn d4_lt(a: Self::D4, b: Self::D4) -> u32;
}
