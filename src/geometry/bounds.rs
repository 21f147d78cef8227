//! Boxes that hold what they should, and a box test that misses none of them.

use glam::{DVec3, Vec3};

use super::Ray;

/// An axis-aligned box of f32 numbers, both ends included.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounds {
    /// Least corner.
    pub min: Vec3,
    /// Greatest corner.
    pub max: Vec3,
}

impl Bounds {
    /// The smallest f32 box that holds the box from `min` to `max`.
    pub fn rounded_out(min: DVec3, max: DVec3) -> Self {
        Bounds { min: per_axis(min, round_down), max: per_axis(max, round_up) }
    }

    /// This box, larger by `ulps` units in the last place of its largest coordinate on every side.
    pub fn grown(self, ulps: f32) -> Self {
        let largest = self.min.abs().max(self.max.abs()).max_element();
        let by = Vec3::splat((largest.next_up() - largest) * ulps);
        Bounds { min: self.min - by, max: self.max + by }
    }

    /// Moves a distance along `ray` into the part of the ray that passes through this box.
    ///
    /// The distances of the box's planes come from one exact subtraction and one division each, so they are good to
    /// 2 ulp of f64 even where the hit's own formula cancels. A box test that contains this box then contains the hit,
    /// whatever was lost in computing it; and on an axis-aligned triangle the plane's own distance is taken.
    #[inline]
    pub fn hold(&self, ray: &Ray, t: f64) -> f64 {
        let mut t = t;
        for axis in 0..3 {
            let d = ray.direction[axis];
            if d != 0.0 {
                let to_min = (f64::from(self.min[axis]) - ray.origin[axis]) / d;
                let to_max = (f64::from(self.max[axis]) - ray.origin[axis]) / d;
                t = t.max(to_min.min(to_max)).min(to_min.max(to_max));
            }
        }
        t
    }
}

fn per_axis(v: DVec3, f: impl Fn(f64) -> f32) -> Vec3 {
    Vec3::new(f(v.x), f(v.y), f(v.z))
}

/// The largest f32 that is not above `x`.
pub fn round_down(x: f64) -> f32 {
    let y = x as f32;
    if f64::from(y) > x { y.next_down() } else { y }
}

/// The smallest f32 that is not below `x`.
pub fn round_up(x: f64) -> f32 {
    let y = x as f32;
    if f64::from(y) < x { y.next_up() } else { y }
}

/// The margin of the box test: at least (1 + 2 γ3) (1 + u) for f32 with u = 2^-24 (Ize, Robust BVH Ray Traversal, JCGT
/// 2(2) 2013).
///
/// A computed distance to a plane is the true one times at most three factors of 1 ± u (subtract, reciprocal,
/// multiply), so either end of the overlap may be off by γ3, and one end that is moved by 2 γ3 absorbs both; the last
/// factor is for the rounding of that move itself.
pub const PRUNE_MARGIN: f32 = 1.0 + 4.0 * f32::EPSILON;

/// A ray made ready for boxes, in f32.
pub struct BoxTest {
    origin: [f32; 3],
    /// Reciprocals of the direction; infinite where it is 0.
    inverse: [f32; 3],
    /// Offset of the near plane in a node's eight numbers, for each axis: 0..3 is the least corner, 4..7 the greatest.
    near: [usize; 3],
    t_min: f32,
}

impl BoxTest {
    /// Prepares `ray`, whose origin and direction must be f32 numbers.
    #[inline]
    pub fn new(ray: &Ray) -> Self {
        let inverse = ray.direction.as_vec3().to_array().map(|d| 1.0 / d);
        let near = [0, 1, 2].map(|axis| axis + 4 * usize::from(inverse[axis].is_sign_negative()));
        BoxTest { origin: ray.origin.as_vec3().to_array(), inverse, near, t_min: round_down(ray.t_min) }
    }

    /// Where the ray enters the box, or `None` if it misses it or enters it beyond `t_max`. Never misses a box that
    /// the exact ray meets before `t_max`.
    ///
    /// `planes` holds the least corner at 0..3 and the greatest at 4..7. Where the ray runs in a plane of the box
    /// (0 times infinity) the comparison ignores that plane, so such rays are inside.
    #[inline]
    pub fn enters(&self, planes: &[f32; 8], t_max: f32) -> Option<f32> {
        let mut enter = self.t_min;
        let mut leave = t_max;
        for axis in 0..3 {
            let near = (planes[self.near[axis]] - self.origin[axis]) * self.inverse[axis];
            let far = (planes[self.near[axis] ^ 4] - self.origin[axis]) * self.inverse[axis];
            // In this order a NaN is never taken.
            enter = if near > enter { near } else { enter };
            leave = if far < leave { far } else { leave };
        }
        (enter <= leave * PRUNE_MARGIN).then_some(enter)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn planes(b: Bounds) -> [f32; 8] {
        [b.min.x, b.min.y, b.min.z, 0.0, b.max.x, b.max.y, b.max.z, 0.0]
    }

    #[test]
    fn the_margin_is_what_ize_derives() {
        let u = f64::from(f32::EPSILON) / 2.0;
        let gamma3 = 3.0 * u / (1.0 - 3.0 * u);
        let least = (1.0 + 2.0 * gamma3) * (1.0 + u);
        assert!(f64::from(PRUNE_MARGIN) >= least);
        assert!(f64::from(PRUNE_MARGIN.next_down()) < least);
    }

    #[test]
    fn boxes_round_outwards() {
        let b = Bounds::rounded_out(DVec3::splat(0.1), DVec3::splat(0.1));
        assert!(f64::from(b.min.x) <= 0.1 && f64::from(b.max.x) >= 0.1);
        assert_eq!(b.min.x.next_up(), b.max.x);
        let exact = Bounds::rounded_out(DVec3::splat(0.5), DVec3::splat(0.5));
        assert_eq!((exact.min, exact.max), (Vec3::splat(0.5), Vec3::splat(0.5)));
    }

    #[test]
    fn a_ray_in_a_face_is_inside() {
        let b = planes(Bounds { min: Vec3::ZERO, max: Vec3::ONE });
        for (origin, direction) in [
            (DVec3::new(0.0, 0.5, -1.0), DVec3::Z),
            (DVec3::new(1.0, 0.5, -1.0), DVec3::Z),
            (DVec3::new(1.0, 1.0, 2.0), -DVec3::Z),
            (DVec3::new(0.0, 0.0, 2.0), -DVec3::Z),
        ] {
            let test = BoxTest::new(&Ray::new(origin, direction, 0.0, f64::INFINITY));
            assert_eq!(test.enters(&b, f32::INFINITY), Some(1.0), "{origin} {direction}");
            let outside = Ray::new(origin * DVec3::new(3.0, 1.0, 1.0) + DVec3::X * 1e-6, direction, 0.0, f64::INFINITY);
            assert_eq!(BoxTest::new(&outside).enters(&b, f32::INFINITY).is_some(), origin.x == 0.0);
        }
    }

    proptest! {
        /// Rays aimed at points of a box, corners and edges included, enter it: the exact point is in the box and on
        /// the exact ray whenever the ray is built backwards from it with numbers that need no rounding.
        #[test]
        fn no_box_is_missed(
            min in prop::array::uniform3(-1000i32..1000),
            size in prop::array::uniform3(0i32..64),
            corner in prop::array::uniform3(0i32..=2),
            step in prop::array::uniform3(-512i32..512),
            scale in -20i32..20,
        ) {
            prop_assume!(step != [0; 3]);
            let s = f64::from(scale).exp2();
            let v = |a: [i32; 3]| DVec3::from(a.map(f64::from)) * s;
            let target = v([0, 1, 2].map(|k| 2 * min[k] + corner[k] * size[k])) / 2.0;
            let direction = v(step);
            let ray = Ray { origin: target - direction, direction, t_min: 0.0, t_max: f64::INFINITY };
            // Every number is a small integer times a power of two: exact in f32.
            prop_assert_eq!(ray.origin, ray.origin.as_vec3().as_dvec3());
            let b = Bounds::rounded_out(v(min), v([0, 1, 2].map(|k| min[k] + size[k])));
            // The target is at t = 1, so the box is entered by then.
            prop_assert!(BoxTest::new(&ray).enters(&planes(b), 1.0).is_some());
            prop_assert!(BoxTest::new(&ray).enters(&planes(b), f32::INFINITY).is_some());
        }
    }
}
