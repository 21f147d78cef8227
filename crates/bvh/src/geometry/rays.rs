//! Rays as structures of arrays, which queries of many rays take: [`Rays`] borrows the arrays, [`RayBuffer`] owns
//! them.

use std::ops::Range;

use glam::DVec3;

use super::Ray;
use super::lanes::{MAX_FLOATS, RayN};
use super::simd::{Doubles, prefetch};

/// The most rays of a packet.
pub(crate) const PACKET: usize = 256;

/// The most rays that [`RayBuffer::write`] sets, and that a stream traces.
pub(crate) const BATCH: usize = 512;

/// Borrowed rays of a [`RayBuffer`]. Slices are longer by [`PADDING`]: lanes of vectors beyond the last ray hold other
/// rays of the buffer.
#[derive(Debug, Clone, Copy, Default)]
pub struct Rays<'a> {
    len: usize,
    /// The numbers of a [`Ray`] in their order.
    numbers: [&'a [f64]; NUMBERS],
}

/// Numbers (f64) of a ray.
const NUMBERS: usize = 8;
/// The places of the first component of the direction and of the ends among the numbers of a ray.
const DIRECTION: usize = 3;
const T_MIN: usize = 6;
const T_MAX: usize = 7;

impl<'a> Rays<'a> {
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
            t_min: self.numbers[T_MIN][i],
            t_max: self.t_max(i),
        }
    }

    /// The origin of the ray at `i`.
    #[inline(always)]
    pub(crate) fn origin(&self, i: usize) -> DVec3 {
        DVec3::new(self.numbers[0][i], self.numbers[1][i], self.numbers[2][i])
    }

    /// The direction of the ray at `i`.
    #[inline(always)]
    pub(crate) fn direction(&self, i: usize) -> DVec3 {
        let [.., x, y, z, _, _] = self.numbers;
        DVec3::new(x[i], y[i], z[i])
    }

    /// `t_max` of the ray at `i`.
    #[inline(always)]
    pub(crate) fn t_max(&self, i: usize) -> f64 {
        self.numbers[T_MAX][i]
    }

    /// The components of the directions, an array for each axis.
    pub fn directions(&self) -> [&'a [f64]; 3] {
        [0, 1, 2].map(|axis| &self.numbers[DIRECTION + axis][..self.len])
    }

    /// The components of the origins, an array for each axis.
    pub fn origins(&self) -> [&'a [f64]; 3] {
        [0, 1, 2].map(|axis| &self.numbers[axis][..self.len])
    }

    /// The rays.
    pub fn iter(self) -> impl ExactSizeIterator<Item = Ray> + Clone + 'a {
        (0..self.len()).map(move |i| self.get(i))
    }

    /// At most `count` rays from index `first` on.
    #[inline(always)]
    pub fn slice(&self, first: usize, count: usize) -> Self {
        let (first, end) = (first.min(self.len), first.saturating_add(count).min(self.len));
        let mut numbers = self.numbers;
        for x in &mut numbers {
            *x = &x[first..x.len().min(end + PADDING)];
        }
        Rays { len: end - first, numbers }
    }

    /// Slices of `count` rays each; the last may have fewer.
    ///
    /// # Panics
    /// If `count` is 0.
    pub fn chunks(self, count: usize) -> impl ExactSizeIterator<Item = Rays<'a>> + Clone {
        (0..self.len().div_ceil(count)).map(move |index| self.slice(index * count, count))
    }

    /// A ray for each lane, from index `first` on.
    ///
    /// # Panics
    /// If there is no ray at `first`.
    #[inline(always)]
    pub(crate) fn lanes<D: Doubles>(&self, first: usize) -> RayN<D> {
        RayN {
            origin: self.origin_lanes(first),
            direction: self.direction_lanes(first),
            t_min: self.load(T_MIN, first),
            t_max: self.t_max_lanes(first),
        }
    }

    /// The origins of [`Rays::lanes`].
    #[inline(always)]
    pub(crate) fn origin_lanes<D: Doubles>(&self, first: usize) -> [D; 3] {
        [self.load(0, first), self.load(1, first), self.load(2, first)]
    }

    /// `t_max` of [`Rays::lanes`].
    #[inline(always)]
    pub(crate) fn t_max_lanes<D: Doubles>(&self, first: usize) -> D {
        self.load(T_MAX, first)
    }

    /// The directions of [`Rays::lanes`].
    #[inline(always)]
    pub(crate) fn direction_lanes<D: Doubles>(&self, first: usize) -> [D; 3] {
        [self.load(DIRECTION, first), self.load(DIRECTION + 1, first), self.load(DIRECTION + 2, first)]
    }

    /// `t_min` in f32 of twice as many rays as [`Rays::lanes`].
    #[inline(always)]
    pub(crate) fn t_min_floats<D: Doubles>(&self, first: usize) -> D::Floats {
        self.floats::<D>(T_MIN, first)
    }

    /// `t_max` in f32 of twice as many rays as [`Rays::lanes`].
    #[inline(always)]
    pub(crate) fn t_max_floats<D: Doubles>(&self, first: usize) -> D::Floats {
        self.floats::<D>(T_MAX, first)
    }

    /// The coordinates of the origins on an axis, in f32, of twice as many rays as [`Rays::lanes`].
    #[inline(always)]
    pub(crate) fn origin_floats<D: Doubles>(&self, axis: usize, first: usize) -> D::Floats {
        self.floats::<D>(axis, first)
    }

    /// The components of the directions on an axis, in f32, of twice as many rays as [`Rays::lanes`].
    #[inline(always)]
    pub(crate) fn direction_floats<D: Doubles>(&self, axis: usize, first: usize) -> D::Floats {
        self.floats::<D>(DIRECTION + axis, first)
    }

    /// The origins in f32 of twice as many rays as [`Rays::lanes`].
    #[inline(always)]
    pub(crate) fn origins_in_f32<D: Doubles>(&self, first: usize) -> [D::Floats; 3] {
        [self.floats::<D>(0, first), self.floats::<D>(1, first), self.floats::<D>(2, first)]
    }

    /// The directions in f32 of twice as many rays as [`Rays::lanes`].
    #[inline(always)]
    pub(crate) fn directions_in_f32<D: Doubles>(&self, first: usize) -> [D::Floats; 3] {
        [
            self.floats::<D>(DIRECTION, first),
            self.floats::<D>(DIRECTION + 1, first),
            self.floats::<D>(DIRECTION + 2, first),
        ]
    }

    #[inline(always)]
    fn floats<D: Doubles>(&self, number: usize, first: usize) -> D::Floats {
        D::to_floats(self.load(number, first), self.load(number, first + D::LANES))
    }

    #[inline(always)]
    fn load<D: Doubles>(&self, number: usize, first: usize) -> D {
        D::load_slice(&self.numbers[number][first..first + D::LANES])
    }

    /// Prefetches a cache line of each coordinate, at the ray `i`.
    #[inline(always)]
    pub(crate) fn prefetch(&self, i: usize) {
        for x in self.numbers {
            prefetch(x, i);
        }
    }
}

/// Rays in arrays of their own, of any number.
///
/// There are [`PADDING`] more numbers behind those of the last ray, always those of one of the rays: whole vectors can
/// be loaded, and what the rays have in common, these have too.
#[derive(Debug, Clone, Default)]
pub struct RayBuffer {
    len: usize,
    /// The distance between two coordinates of a ray: an odd number of cache lines, because the lines that are read
    /// together would otherwise compete for the same cache set.
    stride: usize,
    numbers: Vec<f64>,
}

/// The numbers of each array behind those of the last ray, as many as a vector has lanes at most.
const PADDING: usize = MAX_FLOATS;

/// The stride of buffers of up to [`BATCH`] rays.
const BATCH_STRIDE: usize = BATCH + 3 * PER_LINE;

impl RayBuffer {
    /// The rays.
    #[inline]
    pub fn rays(&self) -> Rays<'_> {
        if self.len == 0 {
            return Rays::default();
        }
        let numbers = std::array::from_fn(|k| &self.numbers[k * self.stride..][..self.len + PADDING]);
        Rays { len: self.len, numbers }
    }

    /// The ray at `i`.
    ///
    /// # Panics
    /// If there is none.
    #[inline]
    pub fn get(&self, i: usize) -> Ray {
        assert!(i < self.len, "no ray at {i}");
        let mut numbers = [0.0; NUMBERS];
        for (k, number) in numbers.iter_mut().enumerate() {
            *number = self.numbers[k * self.stride + i];
        }
        Ray::of_numbers(numbers)
    }

    /// Replaces the ray at `i`.
    ///
    /// # Panics
    /// If there is none.
    #[inline]
    pub fn set(&mut self, i: usize, ray: &Ray) {
        assert!(i < self.len, "no ray at {i}");
        for (k, number) in ray.numbers().into_iter().enumerate() {
            self.numbers[k * self.stride + i] = number;
        }
    }

    /// Writes a ray to all of a range, for which there must be room.
    #[inline(always)]
    fn fill(&mut self, range: Range<usize>, ray: &Ray) {
        for (k, number) in ray.numbers().into_iter().enumerate() {
            self.numbers[k * self.stride + range.start..k * self.stride + range.end].fill(number);
        }
    }

    /// Appends a ray.
    #[inline]
    pub fn push(&mut self, ray: &Ray) {
        let at = self.len;
        self.len += 1;
        if at.is_multiple_of(PADDING) {
            // Also the padding of this ray and the next ones.
            self.reserve(at + 2 * PADDING);
            self.fill(at..at + 2 * PADDING, ray);
        } else {
            self.set(at, ray);
        }
    }

    /// Makes room for as many numbers in each array.
    fn reserve(&mut self, count: usize) {
        if count <= self.stride {
            return;
        }
        let stride = (2 * self.stride + PER_LINE).max(BATCH_STRIDE);
        let mut numbers = vec![0.0; NUMBERS * stride];
        for (to, from) in numbers.chunks_exact_mut(stride).zip(self.numbers.chunks_exact(self.stride.max(1)))
        {
            to[..self.stride].copy_from_slice(from);
        }
        (self.stride, self.numbers) = (stride, numbers);
    }

    /// Sets the rays of a range, which ends at 512 at most, to `ray` of their index; these are the last rays then. The
    /// loop is vectorised where `ray` has no branches.
    ///
    /// # Panics
    /// If the range ends beyond that.
    #[inline(always)]
    pub fn write(&mut self, range: Range<usize>, ray: impl FnMut(usize) -> Ray) {
        assert!(range.end <= BATCH, "{range:?} is more than {BATCH}");
        if self.stride != BATCH_STRIDE {
            (self.stride, self.numbers) = (BATCH_STRIDE, vec![0.0; NUMBERS * BATCH_STRIDE]);
        }
        let Some(numbers) = self.numbers.first_chunk_mut() else { unreachable!("of this size") };
        write(numbers, range.clone(), ray);
        self.len = range.end;
        self.pad();
    }

    /// Moves the rays at `indices`, which ascend, to the front; these are the rays then.
    ///
    /// # Panics
    /// If the indices do not ascend, or there is no ray at one.
    pub fn keep(&mut self, indices: &[u32]) {
        assert!(indices.is_sorted_by(|a, b| a < b), "indices do not ascend");
        assert!(indices.last().is_none_or(|&last| (last as usize) < self.len), "no ray at an index");
        for (to, &from) in indices.iter().enumerate().skip_while(|(to, from)| *to == **from as usize) {
            self.set(to, &self.get(from as usize));
        }
        self.len = indices.len();
        self.pad();
    }

    /// Repeats the last ray, as far as [`RayBuffer::push`] does.
    fn pad(&mut self) {
        if let Some(last) = self.len.checked_sub(1) {
            self.fill(self.len..self.len.next_multiple_of(PADDING) + PADDING, &self.get(last));
        }
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

/// The loop of [`RayBuffer::write`], over an array of fixed size: the compiler can rule out that its parts overlap.
#[inline(always)]
fn write(
    numbers: &mut [f64; NUMBERS * BATCH_STRIDE],
    range: Range<usize>,
    mut ray: impl FnMut(usize) -> Ray,
) {
    for i in range.start..range.end.min(BATCH) {
        let Ray { origin, direction, t_min, t_max } = ray(i);
        let mut put = |number: usize, x: f64| numbers[number * BATCH_STRIDE + i] = x;
        for axis in 0..3 {
            put(axis, origin[axis]);
            put(DIRECTION + axis, direction[axis]);
        }
        put(T_MIN, t_min);
        put(T_MAX, t_max);
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
    #[should_panic(expected = "indices do not ascend")]
    fn kept_rays_are_in_order() {
        let mut buffer: RayBuffer = (0..4).map(ray).collect();
        buffer.keep(&[2, 1]);
    }

    #[test]
    fn lanes_beyond_the_end_are_rays_of_the_buffer() {
        let check = |rays: Rays, first: usize, expected: [usize; 4]| {
            let (lanes, expected) = (rays.lanes::<<Portable as Simd>::D>(first), expected.map(ray));
            for axis in 0..3 {
                assert_eq!(lanes.origin[axis].array(), expected.map(|ray| ray.origin[axis]));
                assert_eq!(lanes.direction[axis].array(), expected.map(|ray| ray.direction[axis]));
            }
            assert_eq!(lanes.t_min.array(), expected.map(|ray| ray.t_min));
            assert_eq!(lanes.t_max.array(), expected.map(|ray| ray.t_max));
        };
        // Pushed.
        let mut buffer: RayBuffer = (0..22).map(ray).collect();
        check(buffer.rays(), 20, [20, 21, 16, 16]);
        check(buffer.rays().slice(3, 5), 4, [7, 8, 9, 10]);
        check(buffer.rays().slice(21, 1), 0, [21, 16, 16, 16]);
        check(buffer.rays().slice(21, 1), 12, [16; 4]);
        // Selected, and written.
        buffer.keep(&[0, 1, 2, 3, 7, 20]);
        check(buffer.rays(), 4, [7, 20, 20, 20]);
        check(buffer.rays(), 12, [20; 4]);
        buffer.write(2..BATCH, ray);
        check(buffer.rays(), 0, [0, 1, 2, 3]);
        check(buffer.rays(), BATCH - 4, [508, 509, 510, 511]);
        check(buffer.rays().slice(511, 1), 12, [511; 4]);
        // Of several packets, at every end.
        let mut buffer = RayBuffer::default();
        for last in 0..3 * PACKET {
            buffer.push(&ray(last));
            check(buffer.rays().slice(last, 1), PADDING - 4, [last / PADDING * PADDING; 4]);
        }
    }
}
