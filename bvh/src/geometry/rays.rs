//! Rays as structures of arrays, which queries of many rays take: [`Rays`] borrows the arrays, [`RayBuffer`] owns
//! them.

use glam::DVec3;

use super::Ray;
use super::lanes::{MAX_FLOATS, RayN};
use super::simd::{Doubles, prefetch};

/// The most rays that are traced together: those of a tile.
pub(crate) const PACKET: usize = 256;

/// Borrowed rays. All slices have one number for each ray; those of [`Rays::padded`] rays may be longer.
#[derive(Debug, Clone, Copy, Default)]
pub struct Rays<'a> {
    len: usize,
    origin: [&'a [f64]; 3],
    direction: [&'a [f64]; 3],
    t_min: &'a [f64],
    t_max: &'a [f64],
}

impl<'a> Rays<'a> {
    /// Rays from the coordinates of [`Ray::origin`] and [`Ray::direction`], [`Ray::t_min`] and [`Ray::t_max`], which
    /// must be as those of [`super::Precision::ray`].
    ///
    /// # Panics
    /// If the slices have different lengths.
    #[inline]
    pub fn new(
        origin: [&'a [f64]; 3],
        direction: [&'a [f64]; 3],
        t_min: &'a [f64],
        t_max: &'a [f64],
    ) -> Self {
        let same = origin.iter().chain(&direction).all(|coordinate| coordinate.len() == t_max.len());
        assert!(same && t_min.len() == t_max.len(), "slices of different lengths");
        Rays { len: t_max.len(), origin, direction, t_min, t_max }
    }

    /// The number of rays.
    #[inline(always)]
    pub fn len(&self) -> usize {
        self.len
    }

    /// Whether there are none.
    #[inline(always)]
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// The ray at `i`.
    ///
    /// # Panics
    /// If there is none.
    #[inline(always)]
    pub fn get(&self, i: usize) -> Ray {
        Ray {
            origin: self.origin(i),
            direction: self.direction(i),
            t_min: self.t_min[i],
            t_max: self.t_max[i],
        }
    }

    /// The origin of the ray at `i`.
    #[inline(always)]
    pub(crate) fn origin(&self, i: usize) -> DVec3 {
        let [x, y, z] = self.origin;
        DVec3::new(x[i], y[i], z[i])
    }

    /// The direction of the ray at `i`.
    #[inline(always)]
    pub(crate) fn direction(&self, i: usize) -> DVec3 {
        let [x, y, z] = self.direction;
        DVec3::new(x[i], y[i], z[i])
    }

    /// `t_max` of the ray at `i`.
    #[inline(always)]
    pub(crate) fn t_max(&self, i: usize) -> f64 {
        self.t_max[i]
    }

    /// The rays.
    pub fn iter(self) -> impl ExactSizeIterator<Item = Ray> + Clone + 'a {
        (0..self.len()).map(move |i| self.get(i))
    }

    /// At most `count` rays from index `first` on.
    #[inline(always)]
    pub fn slice(&self, first: usize, count: usize) -> Self {
        let (first, end) = (first.min(self.len), first.saturating_add(count).min(self.len));
        let part = |x: &'a [f64]| &x[first..end];
        let [ox, oy, oz] = self.origin;
        let [dx, dy, dz] = self.direction;
        Rays {
            len: end - first,
            origin: [part(ox), part(oy), part(oz)],
            direction: [part(dx), part(dy), part(dz)],
            t_min: part(self.t_min),
            t_max: part(self.t_max),
        }
    }

    /// Slices of `count` rays each; the last may have fewer.
    ///
    /// # Panics
    /// If `count` is 0.
    pub fn chunks(self, count: usize) -> impl ExactSizeIterator<Item = Rays<'a>> + Clone {
        (0..self.len().div_ceil(count)).map(move |index| self.slice(index * count, count))
    }

    /// The same rays with slices whose length is a multiple of every vector's lanes: the last ray is repeated, in a copy
    /// in `buffer` if there are numbers to add.
    #[inline(always)]
    pub(crate) fn padded(self, buffer: &'a mut RayBuffer) -> Self {
        if self.len.is_multiple_of(MAX_FLOATS) { self } else { self.copied_to(buffer) }
    }

    #[cold]
    fn copied_to(self, buffer: &'a mut RayBuffer) -> Self {
        buffer.clear();
        buffer.extend(self.iter());
        let last = self.get(self.len - 1);
        buffer.extend(std::iter::repeat_n(last, self.len.next_multiple_of(MAX_FLOATS) - self.len));
        Rays { len: self.len, ..buffer.rays() }
    }

    /// A ray for each lane, from index `first` on.
    ///
    /// # Panics
    /// If fewer rays follow, counting those that [`Rays::padded`] repeats.
    #[inline(always)]
    pub(crate) fn lanes<D: Doubles>(&self, first: usize) -> RayN<D> {
        RayN {
            origin: self.origin_lanes(first),
            direction: self.direction_lanes(first),
            t_min: load(self.t_min, first),
            t_max: load(self.t_max, first),
        }
    }

    /// The origins of [`Rays::lanes`].
    #[inline(always)]
    pub(crate) fn origin_lanes<D: Doubles>(&self, first: usize) -> [D; 3] {
        let [x, y, z] = self.origin;
        [load(x, first), load(y, first), load(z, first)]
    }

    /// `t_max` of [`Rays::lanes`].
    #[inline(always)]
    pub(crate) fn t_max_lanes<D: Doubles>(&self, first: usize) -> D {
        load(self.t_max, first)
    }

    /// The directions of [`Rays::lanes`].
    #[inline(always)]
    pub(crate) fn direction_lanes<D: Doubles>(&self, first: usize) -> [D; 3] {
        let [x, y, z] = self.direction;
        [load(x, first), load(y, first), load(z, first)]
    }

    /// `t_min` in f32 of twice as many rays as [`Rays::lanes`].
    #[inline(always)]
    pub(crate) fn t_min_floats<D: Doubles>(&self, first: usize) -> D::Floats {
        D::to_floats(load(self.t_min, first), load(self.t_min, first + D::LANES))
    }

    /// The coordinates of the origins on an axis, in f32, of twice as many rays as [`Rays::lanes`].
    #[inline(always)]
    pub(crate) fn origin_floats<D: Doubles>(&self, axis: usize, first: usize) -> D::Floats {
        D::to_floats(load(self.origin[axis], first), load(self.origin[axis], first + D::LANES))
    }

    /// The components of the directions on an axis, in f32, of twice as many rays as [`Rays::lanes`].
    #[inline(always)]
    pub(crate) fn direction_floats<D: Doubles>(&self, axis: usize, first: usize) -> D::Floats {
        D::to_floats(load(self.direction[axis], first), load(self.direction[axis], first + D::LANES))
    }

    /// Prefetches a cache line of each coordinate, at the ray `i`.
    #[inline(always)]
    pub(crate) fn prefetch(&self, i: usize) {
        for x in self.origin.into_iter().chain(self.direction).chain([self.t_min, self.t_max]) {
            prefetch(x, i);
        }
    }
}

/// Numbers from index `first` on.
#[inline(always)]
fn load<D: Doubles>(x: &[f64], first: usize) -> D {
    D::load_slice(&x[first..first + D::LANES])
}

/// Rays in arrays of their own, of any number.
#[derive(Debug, Clone, Default)]
pub struct RayBuffer {
    len: usize,
    /// The distance between two coordinates of a ray: an odd number of cache lines, because the lines that are read
    /// together would otherwise compete for the same cache set.
    stride: usize,
    numbers: Vec<f64>,
}

/// Numbers (f64) of a ray.
const NUMBERS: usize = 8;

impl RayBuffer {
    /// The rays.
    #[inline]
    pub fn rays(&self) -> Rays<'_> {
        let number = |k: usize| &self.numbers[k * self.stride..k * self.stride + self.len];
        Rays {
            len: self.len,
            origin: [number(0), number(1), number(2)],
            direction: [number(3), number(4), number(5)],
            t_min: number(6),
            t_max: number(7),
        }
    }

    /// Appends a ray.
    #[inline]
    pub fn push(&mut self, ray: &Ray) {
        if self.len == self.stride {
            self.grow();
        }
        let numbers: &[f64; NUMBERS] = bytemuck::cast_ref(ray);
        for (k, &number) in numbers.iter().enumerate() {
            self.numbers[k * self.stride + self.len] = number;
        }
        self.len += 1;
    }

    /// Makes room for more than twice as many rays.
    #[cold]
    fn grow(&mut self) {
        let stride = 2 * self.stride + PER_LINE;
        let mut numbers = vec![0.0; NUMBERS * stride];
        for (to, from) in numbers.chunks_exact_mut(stride).zip(self.numbers.chunks_exact(self.stride.max(1)))
        {
            to[..self.len].copy_from_slice(&from[..self.len]);
        }
        (self.stride, self.numbers) = (stride, numbers);
    }

    /// Removes all rays; memory is kept.
    pub fn clear(&mut self) {
        self.len = 0;
    }

    /// The number of rays.
    pub fn len(&self) -> usize {
        self.len
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Bytes of memory of the arrays.
    pub fn bytes(&self) -> usize {
        self.numbers.capacity() * size_of::<f64>()
    }
}

/// Numbers (f64) of a cache line.
pub(crate) const PER_LINE: usize = 64 / size_of::<f64>();

impl Extend<Ray> for RayBuffer {
    fn extend<I: IntoIterator<Item = Ray>>(&mut self, rays: I) {
        rays.into_iter().for_each(|ray| self.push(&ray));
    }
}

impl FromIterator<Ray> for RayBuffer {
    fn from_iter<I: IntoIterator<Item = Ray>>(rays: I) -> Self {
        let mut buffer = RayBuffer::default();
        buffer.extend(rays);
        buffer
    }
}

impl<R: AsRef<[Ray]> + ?Sized> From<&R> for RayBuffer {
    fn from(rays: &R) -> Self {
        rays.as_ref().iter().copied().collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::simd::{Portable, Simd, Vector};

    fn ray(i: usize) -> Ray {
        let x = i as f64;
        Ray {
            origin: DVec3::new(x, x + 0.1, x + 0.2),
            direction: DVec3::new(1.0, x, -x),
            t_min: x / 8.0,
            t_max: x + 9.0,
        }
    }

    #[test]
    fn rays_come_back() {
        let buffer: RayBuffer = (0..11).map(ray).collect();
        let rays = buffer.rays();
        assert!((0..11).all(|i| rays.get(i) == ray(i)));
        assert_eq!(rays.slice(3, 100).iter().collect::<Vec<_>>(), (3..11).map(ray).collect::<Vec<_>>());
        assert_eq!(rays.slice(12, 4).len(), 0);
        let chunks: Vec<usize> = rays.chunks(4).map(|chunk| chunk.len()).collect();
        assert_eq!(chunks, [4, 4, 3]);
    }

    #[test]
    fn lanes_beyond_the_end_repeat_the_last_ray() {
        let (buffer, mut padded): (RayBuffer, _) = ((0..6).map(ray).collect(), RayBuffer::default());
        let rays = buffer.rays().padded(&mut padded);
        assert_eq!(rays.iter().collect::<Vec<_>>(), (0..6).map(ray).collect::<Vec<_>>());
        let lanes = rays.lanes::<<Portable as Simd>::D>(4);
        let expected = [4, 5, 5, 5].map(ray);
        for axis in 0..3 {
            assert_eq!(lanes.origin[axis].array(), expected.map(|ray| ray.origin[axis]));
            assert_eq!(lanes.direction[axis].array(), expected.map(|ray| ray.direction[axis]));
        }
        assert_eq!(lanes.t_min.array(), expected.map(|ray| ray.t_min));
        assert_eq!(lanes.t_max.array(), expected.map(|ray| ray.t_max));
    }
}
