//! AVX2 and FMA. The only file of the room with `unsafe`: calls of instructions that the machine was asked for beforehand.

use std::arch::x86_64::*;

use super::Simd;

/// AVX2 and FMA. To be used only where [`Avx2::is_there`]: that is what makes the calls in this file safe, and why nothing
/// outside this crate can name the type.
#[derive(Clone, Copy)]
pub struct Avx2;

impl Avx2 {
    /// Whether this machine has them.
    pub fn is_there() -> bool {
        std::arch::is_x86_feature_detected!("avx2") && std::arch::is_x86_feature_detected!("fma")
    }
}

#[target_feature(enable = "avx2,fma")]
fn run<R>(f: impl FnOnce() -> R) -> R {
    f()
}

/// The order of numbers that are not negative is that of their bits; the lowest three make room for the lane. A bitonic
/// network (Batcher, Sorting Networks and their Applications, 1968) sorts without a branch to guess wrong.
#[inline]
#[target_feature(enable = "avx2,fma")]
fn sorted(enter: __m256, leave: __m256, of: [u32; 8]) -> (u32, [u32; 8], [f32; 8]) {
    let holds = _mm256_cmp_ps::<_CMP_LE_OQ>(enter, leave);
    let number = _mm256_set1_epi32(!7);
    let lanes = _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7);
    let keys = _mm256_or_si256(_mm256_and_si256(_mm256_castps_si256(enter), number), lanes);
    // The others become less than all.
    let keys = _mm256_blendv_epi8(_mm256_set1_epi32(-1), keys, _mm256_castps_si256(holds));
    let keys = exchange::<0x99>(keys, _mm256_shuffle_epi32::<0b10_11_00_01>(keys));
    let keys = exchange::<0xc3>(keys, _mm256_shuffle_epi32::<0b01_00_11_10>(keys));
    let keys = exchange::<0xa5>(keys, _mm256_shuffle_epi32::<0b10_11_00_01>(keys));
    let keys = exchange::<0x0f>(keys, _mm256_permute2x128_si256::<1>(keys, keys));
    let keys = exchange::<0x33>(keys, _mm256_shuffle_epi32::<0b01_00_11_10>(keys));
    let keys = exchange::<0x55>(keys, _mm256_shuffle_epi32::<0b10_11_00_01>(keys));
    let items = _mm256_permutevar8x32_epi32(bytemuck::cast(of), keys);
    let at = _mm256_castsi256_ps(_mm256_and_si256(keys, number));
    (_mm256_movemask_ps(holds).count_ones(), bytemuck::cast(items), bytemuck::cast(at))
}

/// The greater of two in the lanes of the mask, the less in the others.
#[inline]
#[target_feature(enable = "avx2,fma")]
fn exchange<const GREATER: i32>(a: __m256i, b: __m256i) -> __m256i {
    _mm256_blend_epi32::<GREATER>(_mm256_min_epi32(a, b), _mm256_max_epi32(a, b))
}

impl Simd for Avx2 {
    type F8 = __m256;
    type D4 = __m256d;
    const FUSED: bool = true;

    #[inline(always)]
    fn run<R>(f: impl FnOnce() -> R) -> R {
        // SAFETY: see [`Avx2`].
        unsafe { run(f) }
    }

    #[inline(always)]
    fn prefetch<T>(what: &T) {
        for line in (0..size_of::<T>()).step_by(64) {
            let at = std::ptr::from_ref(what).cast::<i8>().wrapping_add(line);
            // SAFETY: asking for memory reads nothing.
            unsafe { _mm_prefetch::<_MM_HINT_T0>(at) };
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
    fn sorted(enter: __m256, leave: __m256, of: [u32; 8]) -> (u32, [u32; 8], [f32; 8]) {
        // SAFETY: see [`Avx2`].
        unsafe { sorted(enter, leave, of) }
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
