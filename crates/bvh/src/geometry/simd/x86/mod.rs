//! [`Simd`] by AVX2 and FMA, and by AVX-512. This folder has the only `unsafe` code of `geometry`: intrinsics that every
//! x86-64 has, or whose type of token ([`Avx2`], [`Avx512`]) the caller has from a value ([`super`] says how).

mod vectors;

use std::arch::x86_64::*;

use super::{Side, Simd};
use vectors::{D4, D8, F8, F16};

/// AVX2 and FMA. A value exists only if this machine supports them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Avx2(());

impl Avx2 {
    /// `Some` if this machine supports AVX2, FMA and the bit instructions that the compiler may use with them.
    pub(super) fn detect() -> Option<Self> {
        use std::arch::is_x86_feature_detected as has;
        let counts_bits = has!("popcnt") && has!("bmi1") && has!("bmi2") && has!("lzcnt");
        (counts_bits && has!("avx2") && has!("fma")).then_some(Avx2(()))
    }
}

/// AVX-512 for rays of packets and for sorting, else as [`Avx2`]. A value exists only if this machine supports both.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Avx512(Avx2);

impl Avx512 {
    /// `Some` if this machine supports the instructions of [`Avx2`] and AVX-512 F, VL, DQ and BW.
    pub(super) fn detect() -> Option<Self> {
        use std::arch::is_x86_feature_detected as has;
        let wide = has!("avx512f") && has!("avx512vl") && has!("avx512dq") && has!("avx512bw");
        Avx2::detect().filter(|_| wide).map(Avx512)
    }

    /// The token of AVX2.
    #[inline(always)]
    pub(super) fn avx2(self) -> Avx2 {
        self.0
    }
}

/// See [`super::prefetch`].
#[inline(always)]
pub(crate) fn prefetch<T>(items: &[T], index: usize) {
    let at = items.as_ptr().wrapping_add(index).cast::<i8>();
    // SAFETY: the instruction is one of SSE, which every x86-64 has, and a prefetch does not access memory.
    unsafe { _mm_prefetch::<_MM_HINT_T0>(at) };
}

#[target_feature(enable = "avx2,fma,popcnt,bmi1,bmi2,lzcnt")]
fn run_avx2<R>(f: impl FnOnce() -> R) -> R {
    f()
}

#[target_feature(enable = "avx2,fma,popcnt,bmi1,bmi2,lzcnt,avx512f,avx512vl,avx512dq,avx512bw")]
fn run_avx512<R>(f: impl FnOnce() -> R) -> R {
    f()
}

/// For every mask: the lanes in it, in order, then the other lanes.
static FRONT: [[u8; 8]; 256] = {
    let mut table = [[0; 8]; 256];
    let mut mask = 0;
    while mask < 256 {
        let (mut place, mut lane) = (0, 0);
        while lane < 16 {
            if (mask >> (lane % 8) & 1 == 1) == (lane < 8) {
                table[mask][place] = (lane % 8) as u8;
                place += 1;
            }
            lane += 1;
        }
        mask += 1;
    }
    table
};

/// See [`Simd::sort_entered`]. Numbers that are not negative are ordered as their bits; the lowest three bits hold
/// the lane. Sorted without branches by bitonic networks (Batcher, Sorting Networks and their Applications, 1968): a
/// network of four for the common case of at most four lanes, else one of eight.
#[inline]
#[target_feature(enable = "avx2,fma,popcnt,bmi1,bmi2,lzcnt")]
fn sort_entered(enter: __m256, leave: __m256, of: &[u32; 8], to: &mut [u64; 8]) -> usize {
    let entered = _mm256_cmp_ps::<_CMP_LE_OQ>(enter, leave);
    let number = _mm256_set1_epi32(!7);
    let lanes = _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7);
    let keys = _mm256_or_si256(_mm256_and_si256(_mm256_castps_si256(enter), number), lanes);
    // The other lanes become less than all of these.
    let keys = _mm256_blendv_epi8(_mm256_set1_epi32(-1), keys, _mm256_castps_si256(entered));
    let mask = _mm256_movemask_ps(entered) as u32;
    let count = mask.count_ones() as usize;
    let of: __m256i = bytemuck::cast(*of);
    if count <= 4 {
        let front = _mm256_cvtepu8_epi32(_mm_cvtsi64_si128(i64::from_le_bytes(FRONT[mask as usize % 256])));
        let keys = _mm256_castsi256_si128(_mm256_permutevar8x32_epi32(keys, front));
        let keys = exchange_four::<0b0101>(keys, _mm_shuffle_epi32::<0b10_11_00_01>(keys));
        let keys = exchange_four::<0b0011>(keys, _mm_shuffle_epi32::<0b01_00_11_10>(keys));
        let keys = exchange_four::<0b0010>(keys, _mm_shuffle_epi32::<0b11_01_10_00>(keys));
        let items = _mm256_castsi256_si128(_mm256_permutevar8x32_epi32(of, _mm256_castsi128_si256(keys)));
        let at = _mm_and_si128(keys, _mm256_castsi256_si128(number));
        to[..2].copy_from_slice(&bytemuck::cast::<_, [u64; 2]>(_mm_unpacklo_epi32(items, at)));
        to[2..4].copy_from_slice(&bytemuck::cast::<_, [u64; 2]>(_mm_unpackhi_epi32(items, at)));
        return count;
    }
    let keys = exchange::<0x99>(keys, _mm256_shuffle_epi32::<0b10_11_00_01>(keys));
    let keys = exchange::<0xc3>(keys, _mm256_shuffle_epi32::<0b01_00_11_10>(keys));
    let keys = exchange::<0xa5>(keys, _mm256_shuffle_epi32::<0b10_11_00_01>(keys));
    let keys = exchange::<0x0f>(keys, _mm256_permute2x128_si256::<1>(keys, keys));
    let keys = exchange::<0x33>(keys, _mm256_shuffle_epi32::<0b01_00_11_10>(keys));
    let keys = exchange::<0x55>(keys, _mm256_shuffle_epi32::<0b10_11_00_01>(keys));
    let items = _mm256_permutevar8x32_epi32(of, keys);
    let at = _mm256_and_si256(keys, number);
    let (low, high) = (_mm256_unpacklo_epi32(items, at), _mm256_unpackhi_epi32(items, at));
    to[..4].copy_from_slice(&bytemuck::cast::<_, [u64; 4]>(_mm256_permute2x128_si256::<0x20>(low, high)));
    to[4..].copy_from_slice(&bytemuck::cast::<_, [u64; 4]>(_mm256_permute2x128_si256::<0x31>(low, high)));
    count
}

/// The maximum in the lanes of the mask, the minimum in the others.
#[inline]
#[target_feature(enable = "avx2,fma,popcnt,bmi1,bmi2,lzcnt")]
fn exchange_four<const GREATER: i32>(a: __m128i, b: __m128i) -> __m128i {
    _mm_blend_epi32::<GREATER>(_mm_min_epi32(a, b), _mm_max_epi32(a, b))
}

/// The maximum in the lanes of the mask, the minimum in the others.
#[inline]
#[target_feature(enable = "avx2,fma,popcnt,bmi1,bmi2,lzcnt")]
fn exchange<const GREATER: i32>(a: __m256i, b: __m256i) -> __m256i {
    _mm256_blend_epi32::<GREATER>(_mm256_min_epi32(a, b), _mm256_max_epi32(a, b))
}

/// [`sort_entered`] with masks and compression.
#[inline]
#[target_feature(enable = "avx2,fma,popcnt,bmi1,bmi2,lzcnt,avx512f,avx512vl,avx512dq,avx512bw")]
fn sort_entered_512(enter: __m256, leave: __m256, of: &[u32; 8], to: &mut [u64; 8]) -> usize {
    let entered = _mm256_cmp_ps_mask::<_CMP_LE_OQ>(enter, leave);
    let count = entered.count_ones() as usize;
    let (number, lanes) = (_mm256_set1_epi32(!7), _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7));
    // `enter & number | lanes`. The other lanes become 0, which no key is below.
    let keys = _mm256_ternarylogic_epi32::<0xf8>(lanes, _mm256_castps_si256(enter), number);
    let keys = _mm256_maskz_compress_epi32(entered, keys);
    let of: __m256i = bytemuck::cast(*of);
    if count <= 4 {
        let keys = _mm256_castsi256_si128(keys);
        let keys = exchange_four_512::<0b0101>(keys, _mm_shuffle_epi32::<0b10_11_00_01>(keys));
        let keys = exchange_four_512::<0b0011>(keys, _mm_shuffle_epi32::<0b01_00_11_10>(keys));
        let keys = exchange_four_512::<0b0010>(keys, _mm_shuffle_epi32::<0b11_01_10_00>(keys));
        let items = _mm256_castsi256_si128(_mm256_permutevar8x32_epi32(of, _mm256_castsi128_si256(keys)));
        let at = _mm_and_si128(keys, _mm256_castsi256_si128(number));
        to[..2].copy_from_slice(&bytemuck::cast::<_, [u64; 2]>(_mm_unpacklo_epi32(items, at)));
        to[2..4].copy_from_slice(&bytemuck::cast::<_, [u64; 2]>(_mm_unpackhi_epi32(items, at)));
        return count;
    }
    let keys = exchange_512::<0x99>(keys, _mm256_shuffle_epi32::<0b10_11_00_01>(keys));
    let keys = exchange_512::<0xc3>(keys, _mm256_shuffle_epi32::<0b01_00_11_10>(keys));
    let keys = exchange_512::<0xa5>(keys, _mm256_shuffle_epi32::<0b10_11_00_01>(keys));
    let keys = exchange_512::<0x0f>(keys, _mm256_permute2x128_si256::<1>(keys, keys));
    let keys = exchange_512::<0x33>(keys, _mm256_shuffle_epi32::<0b01_00_11_10>(keys));
    let keys = exchange_512::<0x55>(keys, _mm256_shuffle_epi32::<0b10_11_00_01>(keys));
    let items = _mm512_cvtepu32_epi64(_mm256_permutevar8x32_epi32(of, keys));
    let at = _mm512_slli_epi64::<32>(_mm512_cvtepu32_epi64(_mm256_and_si256(keys, number)));
    // SAFETY: the array has eight numbers.
    unsafe { _mm512_storeu_si512(to.as_mut_ptr().cast(), _mm512_or_si512(items, at)) };
    count
}

/// [`exchange_four`] with a mask.
#[inline]
#[target_feature(enable = "avx2,fma,popcnt,bmi1,bmi2,lzcnt,avx512f,avx512vl,avx512dq,avx512bw")]
fn exchange_four_512<const GREATER: u8>(a: __m128i, b: __m128i) -> __m128i {
    _mm_mask_max_epi32(_mm_min_epi32(a, b), GREATER, a, b)
}

/// [`exchange`] with a mask.
#[inline]
#[target_feature(enable = "avx2,fma,popcnt,bmi1,bmi2,lzcnt,avx512f,avx512vl,avx512dq,avx512bw")]
fn exchange_512<const GREATER: u8>(a: __m256i, b: __m256i) -> __m256i {
    _mm256_mask_max_epi32(_mm256_min_epi32(a, b), GREATER, a, b)
}

impl Simd for Avx2 {
    type F8 = F8;
    type D4 = D4;
    type F = F8;
    type D = D4;

    #[inline(always)]
    fn run<R>(self, f: impl FnOnce() -> R) -> R {
        // SAFETY: `self` exists, so the machine supports the instructions.
        unsafe { run_avx2(f) }
    }

    #[inline(always)]
    fn prefetch<A, B>(a: &[A], b: &[B], of_b: bool, index: usize) {
        // Selected without a branch, and with the number of lines of the larger type.
        let first = [a.as_ptr().cast::<i8>(), b.as_ptr().cast::<i8>()][usize::from(of_b)];
        let at = first.wrapping_add(index * [size_of::<A>(), size_of::<B>()][usize::from(of_b)]);
        for line in (0..size_of::<A>().max(size_of::<B>())).step_by(64) {
            // SAFETY: a prefetch does not access memory.
            unsafe { _mm_prefetch::<_MM_HINT_T0>(at.wrapping_add(line)) };
        }
    }

    #[inline(always)]
    fn pair(low: &[f32; 4], high: &[f32; 4]) -> F8 {
        // SAFETY: see above; the arrays have four numbers.
        F8(unsafe { _mm256_set_m128(_mm_loadu_ps(high.as_ptr()), _mm_loadu_ps(low.as_ptr())) })
    }

    #[inline(always)]
    fn planes(pair: &[[f32; 8]; 2], side: Side) -> F8 {
        // SAFETY: a `Side` is the offset of one of the two arrays; its field is private to `simd`.
        F8(unsafe { _mm256_loadu_ps(pair.as_ptr().byte_add(side.0.into()).cast()) })
    }

    #[inline(always)]
    fn sort_entered(enter: F8, leave: F8, of: &[u32; 8], to: &mut [u64; 8]) -> usize {
        // SAFETY: see above.
        unsafe { sort_entered(enter.0, leave.0, of, to) }
    }
}

impl Simd for Avx512 {
    type F8 = F8;
    type D4 = D4;
    type F = F16;
    type D = D8;

    #[inline(always)]
    fn run<R>(self, f: impl FnOnce() -> R) -> R {
        // SAFETY: `self` exists, so the machine supports the instructions.
        unsafe { run_avx512(f) }
    }

    #[inline(always)]
    fn prefetch<A, B>(a: &[A], b: &[B], of_b: bool, index: usize) {
        Avx2::prefetch(a, b, of_b, index);
    }

    #[inline(always)]
    fn pair(low: &[f32; 4], high: &[f32; 4]) -> F8 {
        Avx2::pair(low, high)
    }

    #[inline(always)]
    fn eight(low: &[f32; 4], high: &[f32; 4]) -> D8 {
        D8::of_floats(Avx2::pair(low, high))
    }

    #[inline(always)]
    fn halves(low: f64, high: f64) -> D8 {
        D8::of_halves(low, high)
    }

    #[inline(always)]
    fn planes(pair: &[[f32; 8]; 2], side: Side) -> F8 {
        Avx2::planes(pair, side)
    }

    #[inline(always)]
    fn sort_entered(enter: F8, leave: F8, of: &[u32; 8], to: &mut [u64; 8]) -> usize {
        // SAFETY: see above.
        unsafe { sort_entered_512(enter.0, leave.0, of, to) }
    }
}
