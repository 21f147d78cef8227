//! Eight f32 numbers, or four f64 numbers, at once.
//!
//! What is written over [`Simd`] is compiled for the instructions of the machine and for none in particular, and gives the
//! same bits either way: every operation is one operation of IEEE 754 on each lane, but for [`Simd::mul_sub`] and
//! [`Simd::mul_add`] on f32, which round once or twice. So those serve bounds, never answers.

mod portable;
#[cfg(target_arch = "x86_64")]
#[allow(unsafe_code)]
mod x86;

pub use portable::Portable;
#[cfg(target_arch = "x86_64")]
pub(crate) use x86::Avx2;

/// Asks for the memory at the beginning of an item that will be read soon, if there is one. It changes nothing but time.
#[inline(always)]
pub(crate) fn prefetch<T>(items: &[T], index: usize) {
    #[cfg(target_arch = "x86_64")]
    x86::prefetch(items, index);
    #[cfg(not(target_arch = "x86_64"))]
    let _ = (items, index);
}

/// One of two arrays of eight f32 numbers, as far from the first as it lies in bytes, so that choosing takes one addition.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Side(usize);

impl Side {
    const BYTES: usize = size_of::<[f32; 8]>();

    /// The second, or the first.
    #[inline(always)]
    pub fn new(second: bool) -> Self {
        Side(usize::from(second) * Self::BYTES)
    }

    /// The other.
    #[inline(always)]
    pub fn other(self) -> Self {
        Side(self.0 ^ Self::BYTES)
    }
}

/// Instructions, and the vectors they work on. Masks are bits, the lowest for the first lane.
pub trait Simd: Copy + Send + Sync + 'static {
    /// Eight f32 numbers.
    type F8: Copy;
    /// Four f64 numbers.
    type D4: Copy;
    /// Whether [`Simd::mul_sub`] rounds once.
    const FUSED: bool;

    /// Calls `f`, compiled for these instructions if it is inlined.
    fn run<R>(f: impl FnOnce() -> R) -> R;
    /// Asks for the memory of an item of `a`, or of `b`, that will be read; one that does not exist is of no harm.
    fn prefetch<A, B>(a: &[A], b: &[B], of_b: bool, index: usize);

    /// From an array.
    fn f8(x: [f32; 8]) -> Self::F8;
    /// One of two arrays.
    fn f8_of(pair: &[[f32; 8]; 2], side: Side) -> Self::F8;
    /// To an array.
    fn f8_array(x: Self::F8) -> [f32; 8];
    /// The same number eight times.
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
    /// a where it is greater, else b: also where one is not a number.
    fn f8_max(a: Self::F8, b: Self::F8) -> Self::F8;
    /// a where it is less, else b: also where one is not a number.
    fn f8_min(a: Self::F8, b: Self::F8) -> Self::F8;
    /// Where a is at most b.
    fn f8_le(a: Self::F8, b: Self::F8) -> u32;
    /// a in the lanes of a mask, b in the others.
    fn f8_select(mask: u32, a: Self::F8, b: Self::F8) -> Self::F8;
    /// Writes `x` to the lanes of a mask.
    fn write(mask: u32, x: u32, to: &mut [u32; 8]);
    /// The least of eight, if all are numbers.
    fn f8_least(x: Self::F8) -> f32;
    /// The greatest of eight, if all are numbers.
    fn f8_most(x: Self::F8) -> f32;
    /// From f64 numbers, rounded to the nearest.
    fn f8_from_d4(low: Self::D4, high: Self::D4) -> Self::F8;

    /// How many lanes have `enter` at most `leave`; and of those first in `to`, by `enter` from the greatest to the least: in
    /// the upper half the bits of a number that is at most `enter` and nearly as much, in the lower half what `of` has in the
    /// lane. `enter` is not negative. The rest of `to` is of no meaning.
    fn sort(enter: Self::F8, leave: Self::F8, of: &[u32; 8], to: &mut [u64; 8]) -> usize;

    /// From an array.
    fn d4(x: [f64; 4]) -> Self::D4;
    /// Rows to columns.
    fn d4_transposed(rows: [Self::D4; 4]) -> [Self::D4; 4];
    /// From f32 numbers.
    fn d4_from_f32(x: [f32; 4]) -> Self::D4;
    /// To an array.
    fn d4_array(x: Self::D4) -> [f64; 4];
    /// The same number four times.
    fn d4_splat(x: f64) -> Self::D4;
    /// a + b
    fn d4_add(a: Self::D4, b: Self::D4) -> Self::D4;
    /// a - b
    fn d4_sub(a: Self::D4, b: Self::D4) -> Self::D4;
    /// a b
    fn d4_mul(a: Self::D4, b: Self::D4) -> Self::D4;
    /// a / b
    fn d4_div(a: Self::D4, b: Self::D4) -> Self::D4;
    /// a where it is greater, else b: also where one is not a number.
    fn d4_max(a: Self::D4, b: Self::D4) -> Self::D4;
    /// a where it is less, else b: also where one is not a number.
    fn d4_min(a: Self::D4, b: Self::D4) -> Self::D4;
    /// |a|
    fn d4_abs(a: Self::D4) -> Self::D4;
    /// The root, rounded to the nearest as division is.
    fn d4_sqrt(a: Self::D4) -> Self::D4;
    /// |a| with the sign of b.
    fn d4_copysign(a: Self::D4, b: Self::D4) -> Self::D4;
    /// Where a is at most b.
    fn d4_le(a: Self::D4, b: Self::D4) -> u32;
    /// Where a is less than b.
    fn d4_lt(a: Self::D4, b: Self::D4) -> u32;
}
