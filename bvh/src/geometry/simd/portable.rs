//! [`Simd`] by arrays, for every machine.

use super::{Side, Simd};

/// Portable Rust, left to the compiler's vectorisation.
#[derive(Clone, Copy)]
pub(crate) struct Portable;

#[inline(always)]
fn each<T: Copy, R, const N: usize>(a: [T; N], b: [T; N], f: impl Fn(T, T) -> R) -> [R; N] {
    std::array::from_fn(
        #[inline(always)]
        |lane| f(a[lane], b[lane]),
    )
}

#[inline(always)]
fn mask<T: Copy, const N: usize>(a: [T; N], b: [T; N], holds: impl Fn(T, T) -> bool) -> u32 {
    (0..N).fold(0, |mask, lane| mask | (u32::from(holds(a[lane], b[lane])) << lane))
}

impl Simd for Portable {
    type F8 = [f32; 8];
    type D4 = [f64; 4];

    #[inline(always)]
    fn run<R>(f: impl FnOnce() -> R) -> R {
        f()
    }

    #[inline(always)]
    fn prefetch<A, B>(_: &[A], _: &[B], _: bool, _: usize) {}

    #[inline(always)]
    fn f8(x: [f32; 8]) -> [f32; 8] {
        x
    }

    #[inline(always)]
    fn f8_load(pair: &[[f32; 8]; 2], side: Side) -> [f32; 8] {
        pair[usize::from(side != Side::new(false))]
    }

    #[inline(always)]
    fn f8_array(x: [f32; 8]) -> [f32; 8] {
        x
    }

    #[inline(always)]
    fn f8_splat(x: f32) -> [f32; 8] {
        [x; 8]
    }

    #[inline(always)]
    fn f8_add(a: [f32; 8], b: [f32; 8]) -> [f32; 8] {
        each(a, b, |a, b| a + b)
    }

    #[inline(always)]
    fn f8_sub(a: [f32; 8], b: [f32; 8]) -> [f32; 8] {
        each(a, b, |a, b| a - b)
    }

    #[inline(always)]
    fn f8_mul(a: [f32; 8], b: [f32; 8]) -> [f32; 8] {
        each(a, b, |a, b| a * b)
    }

    #[inline(always)]
    fn f8_div(a: [f32; 8], b: [f32; 8]) -> [f32; 8] {
        each(a, b, |a, b| a / b)
    }

    #[inline(always)]
    fn mul_add(a: [f32; 8], b: [f32; 8], c: [f32; 8]) -> [f32; 8] {
        Self::f8_add(Self::f8_mul(a, b), c)
    }

    #[inline(always)]
    fn mul_sub(a: [f32; 8], b: [f32; 8], c: [f32; 8]) -> [f32; 8] {
        Self::f8_sub(Self::f8_mul(a, b), c)
    }

    #[inline(always)]
    fn f8_max(a: [f32; 8], b: [f32; 8]) -> [f32; 8] {
        each(a, b, |a, b| if a > b { a } else { b })
    }

    #[inline(always)]
    fn f8_min(a: [f32; 8], b: [f32; 8]) -> [f32; 8] {
        each(a, b, |a, b| if a < b { a } else { b })
    }

    #[inline(always)]
    fn f8_le(a: [f32; 8], b: [f32; 8]) -> u32 {
        mask(a, b, |a, b| a <= b)
    }

    #[inline(always)]
    fn f8_select(mask: u32, a: [f32; 8], b: [f32; 8]) -> [f32; 8] {
        std::array::from_fn(|lane| if mask >> lane & 1 != 0 { a[lane] } else { b[lane] })
    }

    #[inline(always)]
    fn masked_store(mask: u32, x: u32, to: &mut [u32; 8]) {
        for (lane, to) in to.iter_mut().enumerate() {
            if mask >> lane & 1 != 0 {
                *to = x;
            }
        }
    }

    #[inline(always)]
    fn f8_reduce_min(x: [f32; 8]) -> f32 {
        x.into_iter().fold(f32::INFINITY, |a, b| if a < b { a } else { b })
    }

    #[inline(always)]
    fn f8_reduce_max(x: [f32; 8]) -> f32 {
        x.into_iter().fold(f32::NEG_INFINITY, |a, b| if a > b { a } else { b })
    }

    #[inline(always)]
    fn f8_from_d4(low: [f64; 4], high: [f64; 4]) -> [f32; 8] {
        let ([a, b, c, d], [e, f, g, h]) = (low, high);
        [a, b, c, d, e, f, g, h].map(|x| x as f32)
    }

    #[inline(always)]
    fn sort_entered(enter: [f32; 8], leave: [f32; 8], of: &[u32; 8], to: &mut [u64; 8]) -> usize {
        let mut count = 0;
        for lane in 0..8 {
            if enter[lane] <= leave[lane] {
                let item = u64::from(enter[lane].to_bits()) << 32 | u64::from(of[lane]);
                let mut place = count;
                while place > 0 && to[place - 1] < item {
                    to[place] = to[place - 1];
                    place -= 1;
                }
                to[place] = item;
                count += 1;
            }
        }
        count
    }

    #[inline(always)]
    fn d4(x: [f64; 4]) -> [f64; 4] {
        x
    }

    #[inline(always)]
    fn d4_transposed(rows: [[f64; 4]; 4]) -> [[f64; 4]; 4] {
        std::array::from_fn(|column| rows.map(|row| row[column]))
    }

    #[inline(always)]
    fn d4_from_f32(x: [f32; 4]) -> [f64; 4] {
        each(x, x, |x, _| f64::from(x))
    }

    #[inline(always)]
    fn d4_array(x: [f64; 4]) -> [f64; 4] {
        x
    }

    #[inline(always)]
    fn d4_splat(x: f64) -> [f64; 4] {
        [x; 4]
    }

    #[inline(always)]
    fn d4_add(a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
        each(a, b, |a, b| a + b)
    }

    #[inline(always)]
    fn d4_sub(a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
        each(a, b, |a, b| a - b)
    }

    #[inline(always)]
    fn d4_mul(a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
        each(a, b, |a, b| a * b)
    }

    #[inline(always)]
    fn d4_div(a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
        each(a, b, |a, b| a / b)
    }

    #[inline(always)]
    fn d4_max(a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
        each(a, b, |a, b| if a > b { a } else { b })
    }

    #[inline(always)]
    fn d4_min(a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
        each(a, b, |a, b| if a < b { a } else { b })
    }

    #[inline(always)]
    fn d4_abs(a: [f64; 4]) -> [f64; 4] {
        each(a, a, |a, _| a.abs())
    }

    #[inline(always)]
    fn d4_sqrt(a: [f64; 4]) -> [f64; 4] {
        each(a, a, |a, _| a.sqrt())
    }

    #[inline(always)]
    fn d4_copysign(a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
        each(a, b, |a, b| a.copysign(b))
    }

    #[inline(always)]
    fn d4_le(a: [f64; 4], b: [f64; 4]) -> u32 {
        mask(a, b, |a, b| a <= b)
    }

    #[inline(always)]
    fn d4_lt(a: [f64; 4], b: [f64; 4]) -> u32 {
        mask(a, b, |a, b| a < b)
    }
}
