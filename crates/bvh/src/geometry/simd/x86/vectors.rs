//! The vectors of [`Avx2`](super::Avx2) and [`Avx512`](super::Avx512). The safety of the intrinsics in this file depends
//! on a token: the types have no names outside `simd`, and are reached by the type of a token only.

use std::arch::x86_64::*;
use std::ops::{Add, Div, Mul, Sub};

use crate::geometry::lanes::MAX_LANES;
use crate::geometry::simd::{Doubles, Floats, TABLE, Vector};

/// Eight f32 numbers.
#[derive(Clone, Copy)]
pub(crate) struct F8(pub __m256);

/// Four f64 numbers.
#[derive(Clone, Copy)]
pub(crate) struct D4(pub __m256d);

/// Sixteen f32 numbers.
#[derive(Clone, Copy)]
pub(crate) struct F16(__m512);

/// Eight f64 numbers.
#[derive(Clone, Copy)]
pub(crate) struct D8(__m512d);

macro_rules! operators {
    ($vector:ident $($operator:ident $function:ident $intrinsic:ident)*) => {$(
        impl $operator for $vector {
            type Output = Self;

            #[inline(always)]
            fn $function(self, other: Self) -> Self {
                // SAFETY: see above.
                $vector(unsafe { $intrinsic(self.0, other.0) })
            }
        }
    )*};
}

operators!(F8 Add add _mm256_add_ps Sub sub _mm256_sub_ps Mul mul _mm256_mul_ps Div div _mm256_div_ps);
operators!(D4 Add add _mm256_add_pd Sub sub _mm256_sub_pd Mul mul _mm256_mul_pd Div div _mm256_div_pd);
operators!(F16 Add add _mm512_add_ps Sub sub _mm512_sub_ps Mul mul _mm512_mul_ps Div div _mm512_div_ps);
operators!(D8 Add add _mm512_add_pd Sub sub _mm512_sub_pd Mul mul _mm512_mul_pd Div div _mm512_div_pd);

/// Functions whose bodies are intrinsics.
macro_rules! functions {
    ($(fn $name:ident($($arguments:tt)*) -> $result:ty { $($body:tt)* })*) => {$(
        #[inline(always)]
        fn $name($($arguments)*) -> $result {
            // SAFETY: see above; slices have a number for each lane, and any numbers make a vector.
            unsafe { $($body)* }
        }
    )*};
}

/// The operations that differ in nothing but the names of intrinsics.
macro_rules! vector {
    ($vector:ident $register:ident [$scalar:ty; $lanes:literal] $load:ident $splat:ident $max:ident $min:ident {
        le: |$a:ident, $b:ident| $le:expr,
        lt: |$c:ident, $d:ident| $lt:expr,
        reduce_min: |$x:ident| $reduce_min:expr,
        reduce_max: |$y:ident| $reduce_max:expr,
    }) => {
        impl Vector for $vector {
            type Scalar = $scalar;
            type Array = [$scalar; $lanes];

            const LANES: usize = $lanes;
            const ZEROS: [$scalar; $lanes] = [0.0; $lanes];

            functions! {
                fn load(x: [$scalar; $lanes]) -> Self {
                    $vector(std::mem::transmute::<[$scalar; $lanes], $register>(x))
                }
                fn array(self) -> [$scalar; $lanes] {
                    std::mem::transmute::<$register, [$scalar; $lanes]>(self.0)
                }
                fn load_slice(x: &[$scalar]) -> Self {
                    $vector($load(x[..$lanes].as_ptr()))
                }
                fn splat(x: $scalar) -> Self {
                    $vector($splat(x))
                }
                fn max(self, other: Self) -> Self {
                    $vector($max(self.0, other.0))
                }
                fn min(self, other: Self) -> Self {
                    $vector($min(self.0, other.0))
                }
                fn le(self, other: Self) -> u32 {
                    let ($a, $b) = (self.0, other.0);
                    $le
                }
                fn lt(self, other: Self) -> u32 {
                    let ($c, $d) = (self.0, other.0);
                    $lt
                }
                fn reduce_min(self) -> $scalar {
                    let $x = self.0;
                    $reduce_min
                }
                fn reduce_max(self) -> $scalar {
                    let $y = self.0;
                    $reduce_max
                }
            }
        }
    };
}

vector!(F8 __m256 [f32; 8] _mm256_loadu_ps _mm256_set1_ps _mm256_max_ps _mm256_min_ps {
    le: |a, b| _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LE_OQ>(a, b)) as u32,
    lt: |a, b| _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LT_OQ>(a, b)) as u32,
    reduce_min: |x| {
        let x = _mm_min_ps(_mm256_castps256_ps128(x), _mm256_extractf128_ps::<1>(x));
        let x = _mm_min_ps(x, _mm_movehl_ps(x, x));
        _mm_cvtss_f32(_mm_min_ss(x, _mm_movehdup_ps(x)))
    },
    reduce_max: |x| {
        let x = _mm_max_ps(_mm256_castps256_ps128(x), _mm256_extractf128_ps::<1>(x));
        let x = _mm_max_ps(x, _mm_movehl_ps(x, x));
        _mm_cvtss_f32(_mm_max_ss(x, _mm_movehdup_ps(x)))
    },
});

vector!(D4 __m256d [f64; 4] _mm256_loadu_pd _mm256_set1_pd _mm256_max_pd _mm256_min_pd {
    le: |a, b| _mm256_movemask_pd(_mm256_cmp_pd::<_CMP_LE_OQ>(a, b)) as u32,
    lt: |a, b| _mm256_movemask_pd(_mm256_cmp_pd::<_CMP_LT_OQ>(a, b)) as u32,
    reduce_min: |x| {
        let x = _mm_min_pd(_mm256_castpd256_pd128(x), _mm256_extractf128_pd::<1>(x));
        _mm_cvtsd_f64(_mm_min_sd(x, _mm_unpackhi_pd(x, x)))
    },
    reduce_max: |x| {
        let x = _mm_max_pd(_mm256_castpd256_pd128(x), _mm256_extractf128_pd::<1>(x));
        _mm_cvtsd_f64(_mm_max_sd(x, _mm_unpackhi_pd(x, x)))
    },
});

vector!(F16 __m512 [f32; 16] _mm512_loadu_ps _mm512_set1_ps _mm512_max_ps _mm512_min_ps {
    le: |a, b| u32::from(_mm512_cmp_ps_mask::<_CMP_LE_OQ>(a, b)),
    lt: |a, b| u32::from(_mm512_cmp_ps_mask::<_CMP_LT_OQ>(a, b)),
    reduce_min: |x| {
        F8(_mm256_min_ps(_mm512_castps512_ps256(x), _mm512_extractf32x8_ps::<1>(x))).reduce_min()
    },
    reduce_max: |x| {
        F8(_mm256_max_ps(_mm512_castps512_ps256(x), _mm512_extractf32x8_ps::<1>(x))).reduce_max()
    },
});

vector!(D8 __m512d [f64; 8] _mm512_loadu_pd _mm512_set1_pd _mm512_max_pd _mm512_min_pd {
    le: |a, b| u32::from(_mm512_cmp_pd_mask::<_CMP_LE_OQ>(a, b)),
    lt: |a, b| u32::from(_mm512_cmp_pd_mask::<_CMP_LT_OQ>(a, b)),
    reduce_min: |x| {
        D4(_mm256_min_pd(_mm512_castpd512_pd256(x), _mm512_extractf64x4_pd::<1>(x))).reduce_min()
    },
    reduce_max: |x| {
        D4(_mm256_max_pd(_mm512_castpd512_pd256(x), _mm512_extractf64x4_pd::<1>(x))).reduce_max()
    },
});

/// All bits of the lanes whose bit in `mask` is set.
#[inline]
#[target_feature(enable = "avx2,fma,popcnt,bmi1,bmi2,lzcnt")]
fn lanes_of(mask: u32) -> __m256i {
    let bits = _mm256_setr_epi32(1, 2, 4, 8, 16, 32, 64, 128);
    _mm256_cmpeq_epi32(_mm256_and_si256(_mm256_set1_epi32(mask as i32), bits), bits)
}

impl Floats for F8 {
    functions! {
        fn mul_add(self, b: Self, c: Self) -> Self {
            F8(_mm256_fmadd_ps(self.0, b.0, c.0))
        }
        fn mul_sub(self, b: Self, c: Self) -> Self {
            F8(_mm256_fmsub_ps(self.0, b.0, c.0))
        }
        fn select(mask: u32, a: Self, b: Self) -> Self {
            F8(_mm256_blendv_ps(b.0, a.0, _mm256_castsi256_ps(lanes_of(mask))))
        }
        fn flip(self, other: Self) -> Self {
            F8(_mm256_xor_ps(self.0, _mm256_and_ps(other.0, _mm256_set1_ps(-0.0))))
        }
        fn sqrt(self) -> Self {
            F8(_mm256_sqrt_ps(self.0))
        }
    }
}

impl Floats for F16 {
    functions! {
        fn mul_add(self, b: Self, c: Self) -> Self {
            F16(_mm512_fmadd_ps(self.0, b.0, c.0))
        }
        fn mul_sub(self, b: Self, c: Self) -> Self {
            F16(_mm512_fmsub_ps(self.0, b.0, c.0))
        }
        fn select(mask: u32, a: Self, b: Self) -> Self {
            F16(_mm512_mask_blend_ps(mask as __mmask16, b.0, a.0))
        }
        fn flip(self, other: Self) -> Self {
            F16(_mm512_xor_ps(self.0, _mm512_and_ps(other.0, _mm512_set1_ps(-0.0))))
        }
        fn sqrt(self) -> Self {
            F16(_mm512_sqrt_ps(self.0))
        }
    }
}

impl Doubles for D4 {
    type Floats = F8;

    functions! {
        fn load_f32(x: &[f32]) -> Self {
            D4(_mm256_cvtps_pd(_mm_loadu_ps(x[..4].as_ptr())))
        }
        fn from_f32(lane: impl Fn(usize) -> f32) -> Self {
            D4(_mm256_cvtps_pd(bytemuck::cast([lane(0), lane(1), lane(2), lane(3)])))
        }
        fn select(mask: u32, a: Self, b: Self) -> Self {
            let lanes = _mm256_cvtepi32_epi64(_mm256_castsi256_si128(lanes_of(mask)));
            D4(_mm256_blendv_pd(b.0, a.0, _mm256_castsi256_pd(lanes)))
        }
        fn to_floats(low: Self, high: Self) -> F8 {
            F8(_mm256_set_m128(_mm256_cvtpd_ps(high.0), _mm256_cvtpd_ps(low.0)))
        }
        fn abs(self) -> Self {
            D4(_mm256_andnot_pd(_mm256_set1_pd(-0.0), self.0))
        }
        fn sqrt(self) -> Self {
            D4(_mm256_sqrt_pd(self.0))
        }
        fn copysign(self, other: Self) -> Self {
            let sign = _mm256_set1_pd(-0.0);
            D4(_mm256_or_pd(_mm256_andnot_pd(sign, self.0), _mm256_and_pd(sign, other.0)))
        }
    }
}

impl Doubles for D8 {
    type Floats = F16;

    functions! {
        fn load_f32(x: &[f32]) -> Self {
            D8(_mm512_cvtps_pd(_mm256_loadu_ps(x[..8].as_ptr())))
        }
        fn from_f32(lane: impl Fn(usize) -> f32) -> Self {
            let x = [lane(0), lane(1), lane(2), lane(3), lane(4), lane(5), lane(6), lane(7)];
            D8(_mm512_cvtps_pd(bytemuck::cast(x)))
        }
        fn look_up(table: &[f64; TABLE], indices: &[u32; MAX_LANES]) -> Self {
            let indices = _mm512_cvtepu32_epi64(bytemuck::cast(*indices));
            let [a, b] = [_mm512_loadu_pd(table[..8].as_ptr()), _mm512_loadu_pd(table[8..16].as_ptr())];
            let [c, d] = [_mm512_loadu_pd(table[16..24].as_ptr()), _mm512_loadu_pd(table[24..].as_ptr())];
            let low = _mm512_permutex2var_pd(a, indices, b);
            let high = _mm512_permutex2var_pd(c, indices, d);
            let is_high = _mm512_test_epi64_mask(indices, _mm512_set1_epi64(16));
            D8(_mm512_mask_blend_pd(is_high, low, high))
        }
        fn select(mask: u32, a: Self, b: Self) -> Self {
            D8(_mm512_mask_blend_pd(mask as __mmask8, b.0, a.0))
        }
        fn to_floats(low: Self, high: Self) -> F16 {
            let low = _mm512_castps256_ps512(_mm512_cvtpd_ps(low.0));
            F16(_mm512_insertf32x8::<1>(low, _mm512_cvtpd_ps(high.0)))
        }
        fn abs(self) -> Self {
            D8(_mm512_abs_pd(self.0))
        }
        fn sqrt(self) -> Self {
            D8(_mm512_sqrt_pd(self.0))
        }
        fn copysign(self, other: Self) -> Self {
            let sign = _mm512_set1_pd(-0.0);
            D8(_mm512_or_pd(_mm512_andnot_pd(sign, self.0), _mm512_and_pd(sign, other.0)))
        }
    }
}

impl D8 {
    /// From f32.
    #[inline(always)]
    pub(super) fn of_floats(x: F8) -> Self {
        // SAFETY: see above.
        D8(unsafe { _mm512_cvtps_pd(x.0) })
    }

    /// One number in the lower, one in the upper half of the lanes.
    #[inline(always)]
    pub(super) fn of_halves(low: f64, high: f64) -> Self {
        // SAFETY: see above.
        D8(unsafe { _mm512_mask_broadcastsd_pd(_mm512_set1_pd(low), 0xf0, _mm_set_sd(high)) })
    }
}
