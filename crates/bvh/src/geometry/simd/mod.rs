//! Vectors of f32 and f64 numbers ([`Floats`], [`Doubles`]) and the instruction sets that have them ([`Simd`]).
//!
//! | [`Simd`] | children of nodes, triangles of single rays and streams | packets |
//! | --- | --- | --- |
//! | [`Portable`] | arrays | 8 f32, 4 f64 |
//! | AVX2 | AVX2 and FMA | 8 f32, 4 f64 |
//! | AVX-512 | AVX2 and FMA, sorted by AVX-512 | 16 f32, 8 f64, by AVX-512 |
//!
//! Code generic over these gives the same bits with each: every operation is one IEEE 754 operation per lane, except
//! [`Floats::mul_sub`] and [`Floats::mul_add`], which round once or twice. Those two are used for conservative bounds
//! only, never for a decision, except in the tier `fast`.
//!
//! # Soundness
//! Instructions that the machine lacks must not be executed. A value of a type that implements [`Simd`] is a token:
//! - A token of AVX2 or AVX-512 exists only if the machine supports it. Its field is private to `x86`, and only
//!   detection there makes one. So an [`InstructionSet`] is supported, too.
//! - [`Simd::run`] takes a token, and so does every traversal that is chosen by instruction set.
//! - The vectors' operations take none: they are called for every number of a traversal. But neither the vectors nor
//!   the types of the tokens have names outside this module. All other code is generic over them, and a call for AVX2
//!   or AVX-512 compiles only where [`with_simd`] or a match of an [`InstructionSet`] gives it the type of a token.
//!
//! What the compiler does not exclude is code that takes the type of a token without the token, as from a `None` of
//! `Option<S>`. Generic code must get its `S` from a token that is passed.

mod portable;
#[cfg(target_arch = "x86_64")]
#[allow(unsafe_code)]
mod x86;

use std::ops::{Add, Div, Index, IndexMut, Mul, Sub};

use super::lanes::MAX_LANES;

pub(crate) use portable::{Lanes, Portable};

/// An instruction set that this machine supports, with its token; chosen at run time. All give the same hits.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum InstructionSet {
    /// [`Portable`].
    Portable,
    /// AVX2 and FMA.
    #[cfg(target_arch = "x86_64")]
    Avx2(x86::Avx2),
    /// AVX-512.
    #[cfg(target_arch = "x86_64")]
    Avx512(x86::Avx512),
}

impl InstructionSet {
    /// AVX2 if this machine supports it.
    pub(crate) fn avx2() -> Self {
        #[cfg(target_arch = "x86_64")]
        if let Some(avx2) = x86::Avx2::detect() {
            return InstructionSet::Avx2(avx2);
        }
        InstructionSet::Portable
    }

    /// The token of AVX2, which AVX-512 includes.
    #[cfg(target_arch = "x86_64")]
    #[inline(always)]
    pub(crate) fn as_avx2(self) -> Option<x86::Avx2> {
        match self {
            InstructionSet::Portable => None,
            InstructionSet::Avx2(avx2) => Some(avx2),
            InstructionSet::Avx512(avx512) => Some(avx512.avx2()),
        }
    }

    /// No token of AVX2: none exists on this processor.
    #[cfg(not(target_arch = "x86_64"))]
    #[inline(always)]
    pub(crate) fn as_avx2(self) -> Option<Portable> {
        None
    }

    /// Its name; `None` for what the compiler uses.
    pub(crate) fn name(self) -> Option<&'static str> {
        match self {
            InstructionSet::Portable => None,
            #[cfg(target_arch = "x86_64")]
            InstructionSet::Avx2(_) => Some("avx2"),
            #[cfg(target_arch = "x86_64")]
            InstructionSet::Avx512(_) => Some("avx512"),
        }
    }

    /// The widest that this machine supports.
    pub(crate) fn widest() -> Self {
        #[cfg(target_arch = "x86_64")]
        if let Some(avx512) = x86::Avx512::detect() {
            return InstructionSet::Avx512(avx512);
        }
        Self::avx2()
    }

    /// Portable, AVX2 and the widest; some may be equal.
    #[cfg(test)]
    pub(crate) fn supported() -> [Self; 3] {
        [InstructionSet::Portable, Self::avx2(), Self::widest()]
    }
}

/// Evaluates an expression with `$simd` as the token of an [`InstructionSet`].
macro_rules! with_simd {
    ($set:expr, $simd:ident => $value:expr) => {
        match $set {
            #[cfg(target_arch = "x86_64")]
            $crate::geometry::simd::InstructionSet::Avx512($simd) => $value,
            #[cfg(target_arch = "x86_64")]
            $crate::geometry::simd::InstructionSet::Avx2($simd) => $value,
            $crate::geometry::simd::InstructionSet::Portable => {
                let $simd = $crate::geometry::simd::Portable;
                $value
            }
        }
    };
}
pub(crate) use with_simd;

/// Prefetches the first cache line of `items[index]`; the index may be out of range.
#[inline(always)]
pub(crate) fn prefetch<T>(items: &[T], index: usize) {
    #[cfg(target_arch = "x86_64")]
    x86::prefetch(items, index);
    #[cfg(not(target_arch = "x86_64"))]
    let _ = (items, index);
}

/// The first or second of two arrays of eight f32, as a byte offset: selecting takes one addition.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) struct Side(u8);

impl Side {
    const BYTES: u8 = size_of::<[f32; 8]>() as u8;

    /// The second array if `second`, else the first.
    #[inline(always)]
    pub(crate) fn new(second: bool) -> Self {
        Side(u8::from(second) * Self::BYTES)
    }

    /// The second array if `x` is negative, else the first.
    #[inline(always)]
    pub(crate) fn of_sign(x: f32) -> Self {
        Side((x.to_bits() >> (u32::BITS - 1)) as u8 * Self::BYTES)
    }

    /// The other array.
    #[inline(always)]
    pub(crate) fn other(self) -> Self {
        Side(self.0 ^ Self::BYTES)
    }
}

/// A vector of numbers, with the operations of both types. Masks have one bit per lane, the lowest for the first lane.
pub(crate) trait Vector:
    Copy
    + Send
    + Sync
    + 'static
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
{
    /// The type of a number.
    type Scalar: Copy + 'static;
    /// An array of its numbers.
    type Array: Copy
        + Send
        + Sync
        + 'static
        + Index<usize, Output = Self::Scalar>
        + IndexMut<usize>
        + AsRef<[Self::Scalar]>
        + AsMut<[Self::Scalar]>;

    /// The number of lanes.
    const LANES: usize;
    /// All lanes, as bits.
    const ALL: u32 = u32::MAX >> (u32::BITS as usize - Self::LANES);
    /// Zeros, as an array.
    const ZEROS: Self::Array;

    /// From an array.
    fn load(x: Self::Array) -> Self;
    /// To an array.
    fn array(self) -> Self::Array;
    /// From the first numbers of a slice.
    fn load_slice(x: &[Self::Scalar]) -> Self;
    /// One number in all lanes.
    fn splat(x: Self::Scalar) -> Self;
    /// `self > other ? self : other` per lane: `other` if either is NaN.
    fn max(self, other: Self) -> Self;
    /// `self < other ? self : other` per lane: `other` if either is NaN.
    fn min(self, other: Self) -> Self;
    /// The lanes with `self <= other`.
    fn le(self, other: Self) -> u32;
    /// The lanes with `self < other`.
    fn lt(self, other: Self) -> u32;
    /// The least lane; none may be NaN.
    fn reduce_min(self) -> Self::Scalar;
    /// The greatest lane; none may be NaN.
    fn reduce_max(self) -> Self::Scalar;
}

/// A vector of f32 numbers.
pub(crate) trait Floats: Vector<Scalar = f32> {
    /// `self * b + c`, rounded once or twice.
    fn mul_add(self, b: Self, c: Self) -> Self;
    /// `self * b - c`, rounded once or twice.
    fn mul_sub(self, b: Self, c: Self) -> Self;
    /// `a` in the lanes of a mask, `b` in the others, to the bit.
    fn select(mask: u32, a: Self, b: Self) -> Self;
    /// `self`, negated where the sign bit of `other` is set.
    fn flip(self, other: Self) -> Self;
    /// The absolute value.
    #[inline(always)]
    fn abs(self) -> Self {
        self.flip(self)
    }
    /// The square root, rounded to nearest.
    fn sqrt(self) -> Self;
}

/// The entries of tables for [`Doubles::look_up`].
pub(crate) const TABLE: usize = 32;

/// A vector of f64 numbers.
pub(crate) trait Doubles: Vector<Scalar = f64> {
    /// A vector of twice as many f32 numbers.
    type Floats: Floats;

    /// From the first f32 numbers of a slice.
    fn load_f32(x: &[f32]) -> Self;
    /// From f32 numbers, one for each lane.
    fn from_f32(lane: impl Fn(usize) -> f32) -> Self;
    /// From f64 numbers, one for each lane.
    #[inline(always)]
    fn from_f64(lane: impl Fn(usize) -> f64) -> Self {
        let mut x = Self::ZEROS;
        (0..Self::LANES).for_each(|i| x[i] = lane(i));
        Self::load(x)
    }
    /// See [`Floats::select`].
    fn select(mask: u32, a: Self, b: Self) -> Self;
    /// An entry of a table for each lane, by the index of the lane; any entry for indices from [`TABLE`] on.
    #[inline(always)]
    fn look_up(table: &[f64; TABLE], indices: &[u32; MAX_LANES]) -> Self {
        Self::from_f64(
            #[inline(always)]
            |lane| table[indices[lane] as usize % TABLE],
        )
    }
    /// To f32, rounded to nearest.
    fn to_floats(low: Self, high: Self) -> Self::Floats;
    /// The absolute value.
    fn abs(self) -> Self;
    /// The square root, rounded to nearest.
    fn sqrt(self) -> Self;
    /// The absolute value of `self` with the sign of `other`.
    fn copysign(self, other: Self) -> Self;
}

/// An instruction set and its vectors. A value is a token: it exists only if the machine supports the instructions.
pub(crate) trait Simd: Copy + Send + Sync + 'static {
    /// Eight f32 numbers: the children of a node.
    type F8: Floats<Array = [f32; 8]>;
    /// Four f64 numbers: the triangles of a leaf, for one ray.
    type D4: Doubles<Array = [f64; 4], Floats = Self::F8>;
    /// f32 numbers of packets: a block of rays.
    type F: Floats;
    /// f64 numbers of packets, half as many: rays, or the triangles of one or two leaves.
    type D: Doubles<Floats = Self::F>;

    /// Calls `f`, compiled for this instruction set if it is inlined.
    fn run<R>(self, f: impl FnOnce() -> R) -> R;
    /// Prefetches `b[index]` if `of_b`, else `a[index]`; the index may be out of range.
    fn prefetch<A, B>(a: &[A], b: &[B], of_b: bool, index: usize);
    /// From two arrays.
    fn pair(low: &[f32; 4], high: &[f32; 4]) -> Self::F8;
    /// From two arrays, as f64.
    #[inline(always)]
    fn eight(low: &[f32; 4], high: &[f32; 4]) -> Self::D {
        let [low, high] = [low, high].map(|four| Self::D4::load_f32(four).array());
        Self::D::from_f64(
            #[inline(always)]
            |lane| if lane < 4 { low[lane] } else { high[lane % 4] },
        )
    }
    /// One number in the lower, one in the upper half of the lanes.
    #[inline(always)]
    fn halves(low: f64, high: f64) -> Self::D {
        let half = Self::D::LANES / 2;
        Self::D::from_f64(
            #[inline(always)]
            |lane| if lane < half { low } else { high },
        )
    }
    /// From one of two arrays.
    fn planes(pair: &[[f32; 8]; 2], side: Side) -> Self::F8;
    /// The number of lanes with `enter <= leave`, which are written to the front of `to`, sorted by descending
    /// `enter`. An element has the bits of `enter`, or of a number slightly below it, in its upper half and the lane
    /// of `of` in its lower. `enter` must not be negative. The remaining elements of `to` are unspecified.
    fn sort_entered(enter: Self::F8, leave: Self::F8, of: &[u32; 8], to: &mut [u64; 8]) -> usize;
}

#[cfg(test)]
mod tests {
    use super::*;

    const SPECIAL: [f64; 10] =
        [0.0, -0.0, 1.0, -1.5, f64::INFINITY, f64::NEG_INFINITY, f64::NAN, 1e-30, 3.0e30, -7.25];

    /// Lanes of special numbers, every pair of them in turn.
    fn pairs(lanes: usize) -> impl Iterator<Item = (Vec<f64>, Vec<f64>)> {
        let number = |index: usize| SPECIAL[index % SPECIAL.len()];
        (0..SPECIAL.len() * SPECIAL.len()).map(move |i| {
            let pair = |lane: usize| (number(i + lane), number((i + 3 * lane) / SPECIAL.len() + lane));
            (0..lanes).map(pair).unzip()
        })
    }

    fn mask<T: Copy>(a: &[T], b: &[T], holds: impl Fn(T, T) -> bool) -> u32 {
        a.iter().zip(b).enumerate().fold(0, |mask, (lane, (&a, &b))| mask | u32::from(holds(a, b)) << lane)
    }

    /// Every lane has the bits of `expected`, or both are NaN.
    fn assert_lanes<V: Vector<Scalar: Into<f64>>>(found: V, expected: impl Fn(usize) -> V::Scalar) {
        let found = found.array();
        for lane in 0..V::LANES {
            let (found, expected): (f64, f64) = (found[lane].into(), expected(lane).into());
            assert!(
                found.to_bits() == expected.to_bits() || found.is_nan() && expected.is_nan(),
                "lane {lane}: {found}, not {expected}"
            );
        }
    }

    macro_rules! check_vector {
        ($name:ident, $vector:ident, $scalar:ty) => {
            fn $name<V: $vector>() {
                for (a, b) in pairs(V::LANES) {
                    let narrow = |x: Vec<f64>| x.into_iter().map(|x| x as $scalar).collect::<Vec<_>>();
                    let (a, b) = (narrow(a), narrow(b));
                    let (x, y) = (V::load_slice(&a), V::load_slice(&b));
                    assert_lanes(V::load(x.array()), |lane| a[lane]);
                    assert_lanes(x + y, |lane| a[lane] + b[lane]);
                    assert_lanes(x - y, |lane| a[lane] - b[lane]);
                    assert_lanes(x * y, |lane| a[lane] * b[lane]);
                    assert_lanes(x / y, |lane| a[lane] / b[lane]);
                    assert_lanes(x.max(y), |lane| if a[lane] > b[lane] { a[lane] } else { b[lane] });
                    assert_lanes(x.min(y), |lane| if a[lane] < b[lane] { a[lane] } else { b[lane] });
                    assert_eq!(x.le(y), mask(&a, &b, |a, b| a <= b));
                    assert_eq!(x.lt(y), mask(&a, &b, |a, b| a < b));
                    let some: Vec<_> = a.iter().map(|x| if x.is_nan() { 2.0 } else { *x }).collect();
                    let numbers = V::load_slice(&some);
                    assert_eq!(numbers.reduce_min(), some.iter().copied().fold(some[0], <$scalar>::min));
                    assert_eq!(numbers.reduce_max(), some.iter().copied().fold(some[0], <$scalar>::max));
                    assert_lanes(V::splat(a[0]), |_| a[0]);
                }
            }
        };
    }

    check_vector!(check_numbers_f32, Floats, f32);
    check_vector!(check_numbers_f64, Doubles, f64);

    fn check_floats<F: Floats>() {
        check_numbers_f32::<F>();
        for (a, b) in pairs(F::LANES) {
            let narrow = |x: Vec<f64>| x.into_iter().map(|x| x as f32).collect::<Vec<_>>();
            let (a, b) = (narrow(a), narrow(b));
            let (x, y) = (F::load_slice(&a), F::load_slice(&b));
            assert_lanes(x.flip(y), |lane| if b[lane].is_sign_negative() { -a[lane] } else { a[lane] });
            assert_lanes(x.abs(), |lane| a[lane].abs());
            assert_lanes(x.sqrt(), |lane| a[lane].sqrt());
        }
        let a: Vec<f32> = (0..F::LANES).map(|lane| lane as f32 + 0.1).collect();
        let (x, y) = (F::load_slice(&a), F::splat(3.3));
        let every_third = 0x9249 & F::ALL;
        let is_third = |lane: usize| lane.is_multiple_of(3);
        assert_lanes(F::select(every_third, x, y), |lane| if is_third(lane) { a[lane] } else { 3.3 });
        let [nan, tiny] = [u32::MAX - 1, 5];
        let of_bits = |bits| F::splat(f32::from_bits(bits));
        let bits = F::select(every_third, of_bits(nan), of_bits(tiny)).array();
        assert!((0..F::LANES).all(|lane| bits[lane].to_bits() == if is_third(lane) { nan } else { tiny }));
        for (found, term) in [(x.mul_add(y, y).array(), 3.3f32), (x.mul_sub(y, y).array(), -3.3)] {
            for lane in 0..F::LANES {
                let once = (f64::from(a[lane]) * f64::from(3.3f32) + f64::from(term)) as f32;
                assert!(found[lane] == once || found[lane] == a[lane] * 3.3 + term, "{}", found[lane]);
            }
        }
    }

    fn check_doubles<D: Doubles>() {
        check_numbers_f64::<D>();
        assert_eq!(D::Floats::LANES, 2 * D::LANES);
        for (a, b) in pairs(D::LANES) {
            let (x, y) = (D::load_slice(&a), D::load_slice(&b));
            assert_lanes(x.abs(), |lane| a[lane].abs());
            let table: [f64; TABLE] = std::array::from_fn(|index| a[index % a.len()] + index as f64);
            let indices = std::array::from_fn(|lane| ((lane * 11 + 5) % TABLE) as u32);
            assert_lanes(D::look_up(&table, &indices), |lane| table[indices[lane] as usize]);
            assert_lanes(D::select(5, x, y), |lane| if lane == 0 || lane == 2 { a[lane] } else { b[lane] });
            assert_lanes(x.abs().sqrt(), |lane| a[lane].abs().sqrt());
            assert_lanes(x.copysign(y), |lane| a[lane].copysign(b[lane]));
            assert_lanes(D::from_f64(|lane| b[lane]), |lane| b[lane]);
            assert_lanes(D::from_f32(|lane| b[lane] as f32), |lane| f64::from(b[lane] as f32));
            let narrow: Vec<f32> = a.iter().map(|&x| x as f32).collect();
            assert_lanes(D::load_f32(&narrow), |lane| f64::from(narrow[lane]));
            let both = [a, b].concat();
            assert_lanes(D::to_floats(x, y), |lane| both[lane] as f32);
        }
    }

    fn check<S: Simd>(simd: S) {
        simd.run(|| {
            assert_lanes(S::pair(&[0.0, 1.0, 2.0, 3.0], &[4.0, 5.0, 6.0, 7.0]), |lane| lane as f32);
            check_floats::<S::F8>();
            check_floats::<S::F>();
            check_doubles::<S::D4>();
            check_doubles::<S::D>();
        });
    }

    #[test]
    fn vectors_compute_lane_by_lane() {
        InstructionSet::supported().into_iter().for_each(|set| with_simd!(set, simd => check(simd)));
    }

    /// A set is found if and only if the machine has all of its instructions, and its token takes no memory.
    #[test]
    #[cfg(target_arch = "x86_64")]
    fn a_token_exists_where_the_machine_supports_it() {
        use std::arch::is_x86_feature_detected as has;
        let avx2 = has!("avx2") && has!("fma") && has!("popcnt") && has!("lzcnt");
        let avx2 = avx2 && has!("bmi1") && has!("bmi2");
        let avx512 = has!("avx512f") && has!("avx512vl") && has!("avx512dq") && has!("avx512bw");
        let names = [None, avx2.then_some("avx2"), (avx2 && avx512).then_some("avx512")];
        let widest = if avx2 && avx512 { names[2] } else { names[1] };
        assert_eq!(InstructionSet::supported().map(InstructionSet::name), [None, names[1], widest]);
        assert_eq!(InstructionSet::supported().map(|set| set.as_avx2().is_some()), [false, avx2, avx2]);
        assert_eq!(
            (size_of::<x86::Avx2>(), size_of::<x86::Avx512>(), size_of::<InstructionSet>()),
            (0, 0, 1)
        );
    }
}
