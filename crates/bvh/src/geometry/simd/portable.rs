//! [`Simd`] by arrays, for every machine.

use std::ops::{Add, Div, Mul, Sub};

use super::{Doubles, Floats, Side, Simd, Vector};

/// Portable Rust, left to the compiler's vectorisation.
#[derive(Clone, Copy)]
pub(crate) struct Portable;

/// A vector as an array.
#[derive(Clone, Copy)]
pub(crate) struct Lanes<T, const N: usize>([T; N]);

impl<T: Copy, const N: usize> Lanes<T, N> {
    #[inline(always)]
    fn with(self, other: Self, f: impl Fn(T, T) -> T) -> Self {
        Lanes(std::array::from_fn(
            #[inline(always)]
            |lane| f(self.0[lane], other.0[lane]),
        ))
    }

    #[inline(always)]
    fn mask(self, other: Self, holds: impl Fn(T, T) -> bool) -> u32 {
        (0..N).fold(0, |mask, lane| mask | (u32::from(holds(self.0[lane], other.0[lane])) << lane))
    }
}

macro_rules! operator {
    ($operator:ident $function:ident) => {
        impl<T: Copy + $operator<Output = T>, const N: usize> $operator for Lanes<T, N> {
            type Output = Self;

            #[inline(always)]
            fn $function(self, other: Self) -> Self {
                self.with(other, T::$function)
            }
        }
    };
}

operator!(Add add);
operator!(Sub sub);
operator!(Mul mul);
operator!(Div div);

macro_rules! vector {
    ($scalar:ty) => {
        impl<const N: usize> Vector for Lanes<$scalar, N> {
            type Scalar = $scalar;
            type Array = [$scalar; N];

            const LANES: usize = N;
            const ZEROS: [$scalar; N] = [0.0; N];

            #[inline(always)]
            fn load(x: [$scalar; N]) -> Self {
                Lanes(x)
            }

            #[inline(always)]
            fn array(self) -> [$scalar; N] {
                self.0
            }

            #[inline(always)]
            fn load_slice(x: &[$scalar]) -> Self {
                Lanes(std::array::from_fn(|lane| x[lane]))
            }

            #[inline(always)]
            fn splat(x: $scalar) -> Self {
                Lanes([x; N])
            }

            #[inline(always)]
            fn max(self, other: Self) -> Self {
                self.with(other, |a, b| if a > b { a } else { b })
            }

            #[inline(always)]
            fn min(self, other: Self) -> Self {
                self.with(other, |a, b| if a < b { a } else { b })
            }

            #[inline(always)]
            fn le(self, other: Self) -> u32 {
                self.mask(other, |a, b| a <= b)
            }

            #[inline(always)]
            fn lt(self, other: Self) -> u32 {
                self.mask(other, |a, b| a < b)
            }

            #[inline(always)]
            fn reduce_min(self) -> $scalar {
                self.0.into_iter().fold(<$scalar>::INFINITY, |a, b| if a < b { a } else { b })
            }

            #[inline(always)]
            fn reduce_max(self) -> $scalar {
                self.0.into_iter().fold(<$scalar>::NEG_INFINITY, |a, b| if a > b { a } else { b })
            }
        }
    };
}

vector!(f32);
vector!(f64);

impl<const N: usize> Floats for Lanes<f32, N> {
    #[inline(always)]
    fn mul_add(self, b: Self, c: Self) -> Self {
        self * b + c
    }

    #[inline(always)]
    fn mul_sub(self, b: Self, c: Self) -> Self {
        self * b - c
    }

    #[inline(always)]
    fn select(mask: u32, a: Self, b: Self) -> Self {
        Lanes(std::array::from_fn(|lane| if mask >> lane & 1 != 0 { a.0[lane] } else { b.0[lane] }))
    }

    #[inline(always)]
    fn flip(self, other: Self) -> Self {
        self.with(other, |a, b| f32::from_bits(a.to_bits() ^ b.to_bits() & (1 << 31)))
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        Lanes(self.0.map(f32::sqrt))
    }
}

impl Doubles for Lanes<f64, 4> {
    type Floats = Lanes<f32, 8>;

    #[inline(always)]
    fn load_f32(x: &[f32]) -> Self {
        Self::from_f32(|lane| x[lane])
    }

    #[inline(always)]
    fn from_f32(lane: impl Fn(usize) -> f32) -> Self {
        Lanes([0, 1, 2, 3].map(|index| f64::from(lane(index))))
    }

    #[inline(always)]
    fn select(mask: u32, a: Self, b: Self) -> Self {
        Lanes(std::array::from_fn(|lane| if mask >> lane & 1 != 0 { a.0[lane] } else { b.0[lane] }))
    }

    #[inline(always)]
    fn to_floats(low: Self, high: Self) -> Lanes<f32, 8> {
        let ([a, b, c, d], [e, f, g, h]) = (low.0, high.0);
        Lanes([a, b, c, d, e, f, g, h].map(|x| x as f32))
    }

    #[inline(always)]
    fn abs(self) -> Self {
        Lanes(self.0.map(f64::abs))
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        Lanes(self.0.map(f64::sqrt))
    }

    #[inline(always)]
    fn copysign(self, other: Self) -> Self {
        self.with(other, f64::copysign)
    }
}

impl Simd for Portable {
    type F8 = Lanes<f32, 8>;
    type D4 = Lanes<f64, 4>;
    type F = Self::F8;
    type D = Self::D4;

    #[inline(always)]
    fn run<R>(self, f: impl FnOnce() -> R) -> R {
        f()
    }

    #[inline(always)]
    fn prefetch<A, B>(_: &[A], _: &[B], _: bool, _: usize) {}

    #[inline(always)]
    fn pair([a, b, c, d]: &[f32; 4], [e, f, g, h]: &[f32; 4]) -> Self::F8 {
        Lanes([*a, *b, *c, *d, *e, *f, *g, *h])
    }

    #[inline(always)]
    fn planes(pair: &[[f32; 8]; 2], side: Side) -> Self::F8 {
        Lanes(pair[usize::from(side != Side::new(false))])
    }

    #[inline(always)]
    fn sort_entered(enter: Self::F8, leave: Self::F8, of: &[u32; 8], to: &mut [u64; 8]) -> usize {
        let mut count = 0;
        for ((enter, leave), of) in enter.0.into_iter().zip(leave.0).zip(of) {
            if enter <= leave {
                let item = u64::from(enter.to_bits()) << 32 | u64::from(*of);
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
}
