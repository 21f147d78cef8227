//! [`Simd`] by AVX2 and FMA. The only file of `geometry` with `unsafe`: intrinsics that were detected beforehand or
//! that every x86-64 has.

use std::arch::x86_64::*;

use super::{Side, Simd};

/// AVX2 and FMA. To be used only if [`Avx2::is_supported`]: the safety of the intrinsics in this file depends on it,
/// so the type is private to the crate.
#[derive(Clone, Copy)]
pub(crate) struct Avx2;

impl Avx2 {
    /// Whether this machine supports AVX2, FMA and the bit instructions that the compiler may use with them.
    pub(crate) fn is_supported() -> bool {
        use std::arch::is_x86_feature_detected as has;
        let counts_bits = has!("popcnt") && has!("bmi1") && has!("bmi2") && has!("lzcnt");
        counts_bits && has!("avx2") && has!("fma")
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
fn run<R>(f: impl FnOnce() -> R) -> R {
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

/// All bits of the lanes whose bit in `mask` is set.
#[inline]
#[target_feature(enable = "avx2,fma,popcnt,bmi1,bmi2,lzcnt")]
fn lanes_of(mask: u32) -> __m256i {
    let bits = _mm256_setr_epi32(1, 2, 4, 8, 16, 32, 64, 128);
    _mm256_cmpeq_epi32(_mm256_and_si256(_mm256_set1_epi32(mask as i32), bits), bits)
}

impl Simd for Avx2 {
    type F8 = __m256;
    type D4 = __m256d;

    #[inline(always)]
    fn run<R>(f: impl FnOnce() -> R) -> R {
        // SAFETY: see [`Avx2`].
        unsafe { run(f) }
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
    fn f8(x: [f32; 8]) -> __m256 {
        bytemuck::cast(x)
    }

    #[inline(always)]
    fn f8_array(x: __m256) -> [f32; 8] {
        bytemuck::cast(x)
    }

    #[inline(always)]
    fn f8_load(pair: &[[f32; 8]; 2], side: Side) -> __m256 {
        // SAFETY: a `Side` is the offset of one of the two arrays; its field is private to `simd`.
        unsafe { _mm256_loadu_ps(pair.as_ptr().byte_add(side.0).cast()) }
    }

    #[inline(always)]
    fn sort_entered(enter: __m256, leave: __m256, of: &[u32; 8], to: &mut [u64; 8]) -> usize {
        // SAFETY: see [`Avx2`].
        unsafe { sort_entered(enter, leave, of, to) }
    }

    #[inline(always)]
    fn d4(x: [f64; 4]) -> __m256d {
        bytemuck::cast(x)
    }

    #[inline(always)]
    fn d4_array(x: __m256d) -> [f64; 4] {
        bytemuck::cast(x)
    }

    #[inline(always)]
    fn f8_splat(x: f32) -> __m256 {
        // SAFETY: see [`Avx2`].
        unsafe { _mm256_set1_ps(x) }
    }

    #[inline(always)]
    fn f8_add(a: __m256, b: __m256) -> __m256 {
        // SAFETY: see [`Avx2`].
        unsafe { _mm256_add_ps(a, b) }
    }

    #[inline(always)]
    fn f8_sub(a: __m256, b: __m256) -> __m256 {
        // SAFETY: see [`Avx2`].
        unsafe { _mm256_sub_ps(a, b) }
    }

    #[inline(always)]
    fn f8_mul(a: __m256, b: __m256) -> __m256 {
        // SAFETY: see [`Avx2`].
        unsafe { _mm256_mul_ps(a, b) }
    }

    #[inline(always)]
    fn f8_div(a: __m256, b: __m256) -> __m256 {
        // SAFETY: see [`Avx2`].
        unsafe { _mm256_div_ps(a, b) }
    }

    #[inline(always)]
    fn mul_add(a: __m256, b: __m256, c: __m256) -> __m256 {
        // SAFETY: see [`Avx2`].
        unsafe { _mm256_fmadd_ps(a, b, c) }
    }

    #[inline(always)]
    fn mul_sub(a: __m256, b: __m256, c: __m256) -> __m256 {
        // SAFETY: see [`Avx2`].
        unsafe { _mm256_fmsub_ps(a, b, c) }
    }

    #[inline(always)]
    fn f8_max(a: __m256, b: __m256) -> __m256 {
        // SAFETY: see [`Avx2`].
        unsafe { _mm256_max_ps(a, b) }
    }

    #[inline(always)]
    fn f8_min(a: __m256, b: __m256) -> __m256 {
        // SAFETY: see [`Avx2`].
        unsafe { _mm256_min_ps(a, b) }
    }

    #[inline(always)]
    fn f8_le(a: __m256, b: __m256) -> u32 {
        // SAFETY: see [`Avx2`].
        unsafe { _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LE_OQ>(a, b)) as u32 }
    }

    #[inline(always)]
    fn f8_select(mask: u32, a: __m256, b: __m256) -> __m256 {
        // SAFETY: see [`Avx2`].
        unsafe { _mm256_blendv_ps(b, a, _mm256_castsi256_ps(lanes_of(mask))) }
    }

    #[inline(always)]
    fn masked_store(mask: u32, x: u32, to: &mut [u32; 8]) {
        // As a whole: masked stores are slow on some processors.
        // SAFETY: see [`Avx2`].
        unsafe {
            let now: __m256i = bytemuck::cast(*to);
            *to = bytemuck::cast(_mm256_blendv_epi8(now, _mm256_set1_epi32(x as i32), lanes_of(mask)));
        }
    }

    #[inline(always)]
    fn f8_reduce_min(x: __m256) -> f32 {
        // SAFETY: see [`Avx2`].
        unsafe {
            let x = _mm_min_ps(_mm256_castps256_ps128(x), _mm256_extractf128_ps::<1>(x));
            let x = _mm_min_ps(x, _mm_movehl_ps(x, x));
            _mm_cvtss_f32(_mm_min_ss(x, _mm_movehdup_ps(x)))
        }
    }

    #[inline(always)]
    fn f8_reduce_max(x: __m256) -> f32 {
        // SAFETY: see [`Avx2`].
        unsafe {
            let x = _mm_max_ps(_mm256_castps256_ps128(x), _mm256_extractf128_ps::<1>(x));
            let x = _mm_max_ps(x, _mm_movehl_ps(x, x));
            _mm_cvtss_f32(_mm_max_ss(x, _mm_movehdup_ps(x)))
        }
    }

    #[inline(always)]
    fn f8_from_d4(low: __m256d, high: __m256d) -> __m256 {
        // SAFETY: see [`Avx2`].
        unsafe { _mm256_set_m128(_mm256_cvtpd_ps(high), _mm256_cvtpd_ps(low)) }
    }

    #[inline(always)]
    fn d4_transposed([a, b, c, d]: [__m256d; 4]) -> [__m256d; 4] {
        // SAFETY: see [`Avx2`].
        unsafe {
            let (ab_even, ab_odd) = (_mm256_unpacklo_pd(a, b), _mm256_unpackhi_pd(a, b));
            let (cd_even, cd_odd) = (_mm256_unpacklo_pd(c, d), _mm256_unpackhi_pd(c, d));
            [
                _mm256_permute2f128_pd::<0x20>(ab_even, cd_even),
                _mm256_permute2f128_pd::<0x20>(ab_odd, cd_odd),
                _mm256_permute2f128_pd::<0x31>(ab_even, cd_even),
                _mm256_permute2f128_pd::<0x31>(ab_odd, cd_odd),
            ]
        }
    }

    #[inline(always)]
    fn d4_from_f32(x: [f32; 4]) -> __m256d {
        // SAFETY: see [`Avx2`].
        unsafe { _mm256_cvtps_pd(bytemuck::cast(x)) }
    }

    #[inline(always)]
    fn d4_splat(x: f64) -> __m256d {
        // SAFETY: see [`Avx2`].
        unsafe { _mm256_set1_pd(x) }
    }

    #[inline(always)]
    fn d4_add(a: __m256d, b: __m256d) -> __m256d {
        // SAFETY: see [`Avx2`].
        unsafe { _mm256_add_pd(a, b) }
    }

    #[inline(always)]
    fn d4_sub(a: __m256d, b: __m256d) -> __m256d {
        // SAFETY: see [`Avx2`].
        unsafe { _mm256_sub_pd(a, b) }
    }

    #[inline(always)]
    fn d4_mul(a: __m256d, b: __m256d) -> __m256d {
        // SAFETY: see [`Avx2`].
        unsafe { _mm256_mul_pd(a, b) }
    }

    #[inline(always)]
    fn d4_div(a: __m256d, b: __m256d) -> __m256d {
        // SAFETY: see [`Avx2`].
        unsafe { _mm256_div_pd(a, b) }
    }

    #[inline(always)]
    fn d4_max(a: __m256d, b: __m256d) -> __m256d {
        // SAFETY: see [`Avx2`].
        unsafe { _mm256_max_pd(a, b) }
    }

    #[inline(always)]
    fn d4_min(a: __m256d, b: __m256d) -> __m256d {
        // SAFETY: see [`Avx2`].
        unsafe { _mm256_min_pd(a, b) }
    }

    #[inline(always)]
    fn d4_abs(a: __m256d) -> __m256d {
        // SAFETY: see [`Avx2`].
        unsafe { _mm256_andnot_pd(_mm256_set1_pd(-0.0), a) }
    }

    #[inline(always)]
    fn d4_sqrt(a: __m256d) -> __m256d {
        // SAFETY: see [`Avx2`].
        unsafe { _mm256_sqrt_pd(a) }
    }

    #[inline(always)]
    fn d4_copysign(a: __m256d, b: __m256d) -> __m256d {
        // SAFETY: see [`Avx2`].
        unsafe {
            let sign = _mm256_set1_pd(-0.0);
            _mm256_or_pd(_mm256_andnot_pd(sign, a), _mm256_and_pd(sign, b))
        }
    }

    #[inline(always)]
    fn d4_le(a: __m256d, b: __m256d) -> u32 {
        // SAFETY: see [`Avx2`].
        unsafe { _mm256_movemask_pd(_mm256_cmp_pd::<_CMP_LE_OQ>(a, b)) as u32 }
    }

    #[inline(always)]
    fn d4_lt(a: __m256d, b: __m256d) -> u32 {
        // SAFETY: see [`Avx2`].
        unsafe { _mm256_movemask_pd(_mm256_cmp_pd::<_CMP_LT_OQ>(a, b)) as u32 }
    }
}
