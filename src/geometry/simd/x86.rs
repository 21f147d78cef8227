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
