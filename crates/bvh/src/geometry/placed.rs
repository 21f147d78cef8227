//! A mesh that is placed many times: one copy of its triangles, and what was done to them for each place.
//!
//! Placing is arithmetic like any other, and rounds. So a placement keeps the steps in their order and carries points
//! through them one after the other, just as [`Mesh::transform`] does: a placed mesh has the same corners, to the bit, as
//! one that was copied and moved.

use std::sync::Arc;

use glam::{DMat3, DMat4, DVec3, DVec4};

use super::{Mesh, is_mirror, moved_tangent, normal_matrix};

/// What is done to a point on its way into the world.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub enum Step {
    /// An affine map.
    Affine(DMat4),
    /// Moved so that `middle` becomes the origin, then scaled. As a matrix it would round otherwise.
    Shift {
        /// The point that becomes the origin.
        middle: DVec3,
        /// The factor.
        scale: f64,
    },
}

/// The way from a mesh into the world.
#[derive(Debug, Clone, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct Placement {
    steps: Vec<Step>,
}

impl Placement {
    /// Nothing but this map.
    pub fn new(world_from_mesh: DMat4) -> Self {
        Placement { steps: vec![Step::Affine(world_from_mesh)] }
    }

    /// Does this after everything else.
    pub fn then(&mut self, step: Step) {
        self.steps.push(step);
    }

    /// Its size in bytes, beyond that of the type.
    pub fn bytes(&self) -> usize {
        size_of_val(self.steps.as_slice())
    }

    /// The point in the world.
    #[inline]
    pub fn point(&self, mut p: DVec3) -> DVec3 {
        for step in &self.steps {
            p = match step {
                Step::Affine(map) => map.transform_point3(p),
                Step::Shift { middle, scale } => (p - *middle) * *scale,
            };
        }
        p
    }

    /// The normal in the world, of any length; see [`normal_matrix`].
    #[inline]
    pub fn normal(&self, mut n: DVec3) -> DVec3 {
        for step in &self.steps {
            if let Step::Affine(map) = step {
                n = normal_matrix(map) * n;
            }
        }
        n
    }

    /// The tangent in the world, of any length; see [`moved_tangent`].
    #[inline]
    pub fn tangent(&self, mut tangent: DVec4) -> DVec4 {
        for step in &self.steps {
            if let Step::Affine(map) = step {
                tangent = moved_tangent(map, tangent);
            }
        }
        tangent
    }

    /// All steps as one map, `world = linear * mesh + offset`: [`Placement::point`] up to [`Placement::error`].
    pub fn as_one(&self) -> (DMat3, DVec3) {
        let identity = (DMat3::IDENTITY, DVec3::ZERO);
        self.steps.iter().fold(identity, |(linear, offset), step| match step {
            Step::Affine(map) => {
                let own = DMat3::from_mat4(*map);
                (own * linear, own * offset + map.w_axis.truncate())
            }
            Step::Shift { middle, scale } => (linear * *scale, (offset - *middle) * *scale),
        })
    }

    /// No coordinate of a placed point is larger than this, nor is any number that it is computed from, where the mesh's
    /// coordinates are no larger than `reach`: the steps with everything taken as positive.
    pub fn reach(&self, reach: DVec3) -> DVec3 {
        self.reach_and(reach, 0.0)
    }

    /// [`Placement::reach`], where every step adds `more`.
    fn reach_and(&self, reach: DVec3, more: f64) -> DVec3 {
        self.steps.iter().fold(reach, |reach, step| match step {
            Step::Affine(map) => DMat3::from_mat4(*map).abs() * reach + (map.w_axis.truncate().abs() + more),
            Step::Shift { middle, scale } => (reach + middle.abs()) * scale.abs() + more,
        })
    }

    /// How far [`Placement::point`] and [`Placement::as_one`] are from exact, together and so from each other, for points
    /// within `reach`. For any number of steps, underflow included, as long as nothing overflows.
    ///
    /// With u = 2^-53 and the least normal number m, an operation is off by a factor of 1 ± u, a product also by u m
    /// (Higham, Accuracy and Stability of Numerical Algorithms, 2nd edition, sections 2.2 and 3.1). Let M be what
    /// [`Placement::reach`] adds up in exact arithmetic if each step adds m (1 + s), where s is the sum of the mesh's
    /// coordinates.
    /// - A term of a coordinate takes at most 4 operations a step, one product and three sums, so its factors after n
    ///   steps are within (1 ± u)^4n. Three products underflow by 3 u m at most, less than the 4 u m that the step adds:
    ///   by induction [`Placement::point`] is off by e(4n) M, with e(k) = (1 + u)^k - 1.
    /// - [`Placement::as_one`] takes as many, and 4 at the point. Entries of its matrix underflow by 3 u m, which is
    ///   3 u m s at the point: it is off by e(4n + 4) M.
    /// - M itself is computed as at least (1 - u)^8n of it.
    ///
    /// Both together are below 2 e(N) / (1 - u)^2N of the computed M, with N = 4 (n + 1). With x = N u that is below
    /// 2 (e^x - 1) e^2x (1 + u), and so below 4 x (1 - 4 u) for x up to 1/5, for more steps than memory can hold. The
    /// factor below is 4 x; (1 - 4 u) is for the rounding of products with it.
    pub fn error(&self, reach: DVec3) -> DVec3 {
        let more = f64::MIN_POSITIVE * (1.0 + reach.element_sum());
        self.reach_and(reach, more) * (8.0 * (self.steps.len() + 1) as f64 * f64::EPSILON)
    }
}

/// A mesh, shared, and one of the places where it stands.
#[derive(Debug, Clone)]
pub struct Placed {
    /// The mesh in its own space.
    pub mesh: Arc<Mesh>,
    /// Where it stands.
    pub placement: Placement,
}

impl Placed {
    /// A mesh in one of its places.
    pub fn new(mesh: Arc<Mesh>, placement: Placement) -> Self {
        Placed { mesh, placement }
    }

    /// How many triangles there are.
    pub fn triangle_count(&self) -> usize {
        self.mesh.triangles.len()
    }

    /// Whether triangles are seen clockwise from the front in the world.
    pub fn is_mirrored(&self) -> bool {
        let mirrors = |step: &Step| match step {
            Step::Affine(map) => is_mirror(map),
            Step::Shift { scale, .. } => *scale < 0.0,
        };
        self.placement.steps.iter().fold(self.mesh.is_mirrored, |mirrored, step| mirrored ^ mirrors(step))
    }

    /// The corners of a triangle of the mesh in the world.
    #[inline]
    pub fn corners_of(&self, triangle: u32) -> [DVec3; 3] {
        self.mesh.triangles[triangle as usize]
            .map(|corner| self.placement.point(self.mesh.positions[corner as usize]))
    }

    /// A mesh of its own, in the world.
    pub fn bake(&self) -> Mesh {
        let mut mesh = (*self.mesh).clone();
        for step in &self.placement.steps {
            match step {
                Step::Affine(map) => mesh.transform(map),
                Step::Shift { middle, scale } => {
                    mesh.positions.iter_mut().for_each(|p| *p = (*p - *middle) * *scale);
                }
            }
        }
        mesh
    }
}

#[cfg(test)]
mod tests {
    use num_bigint::BigInt;
    use num_traits::{ToPrimitive, float::FloatCore};

    use super::*;

    fn two_steps() -> Placement {
        let turned = DMat4::from_rotation_y(0.7) * DMat4::from_scale(DVec3::new(0.1, -3.0, 1.0 / 3.0));
        let mut placement = Placement::new(turned);
        placement.then(Step::Affine(DMat4::from_translation(DVec3::new(1e5, 0.1, -7.0))));
        placement.then(Step::Shift { middle: DVec3::new(1e5, 0.0, 0.3), scale: 0.25 });
        placement
    }

    fn mesh() -> Mesh {
        let corner = |i: u32| DVec3::new(f64::from(i) / 7.0, f64::from(i * i % 5) / 3.0, 0.1 * f64::from(i));
        Mesh {
            positions: (0..9).map(corner).collect(),
            triangles: vec![[0, 1, 2], [2, 3, 4], [4, 5, 6], [6, 7, 8]],
            normals: Some(super::super::Attribute::per_position((0..9).map(corner).collect())),
            ..Mesh::default()
        }
    }

    #[test]
    fn a_placed_mesh_is_the_moved_copy_to_the_bit() {
        let placed = Placed::new(Arc::new(mesh()), two_steps());
        let baked = placed.bake();
        assert_eq!((placed.triangle_count(), baked.triangles.len()), (4, 4));
        for (index, triangle) in (0..).zip(&baked.triangles) {
            assert_eq!(placed.corners_of(index), triangle.map(|i| baked.positions[i as usize]));
        }
        let normals = &placed.mesh.normals.as_ref().unwrap().values;
        let moved: Vec<DVec3> = normals.iter().map(|&n| placed.placement.normal(n)).collect();
        assert_eq!(moved, baked.normals.unwrap().values);
        // One of the steps mirrors.
        assert!(placed.is_mirrored() && baked.is_mirrored);
    }

    /// `x` in units of 2^-`bits`, of which it must be a multiple.
    fn fixed(x: f64, bits: i32) -> BigInt {
        let (mantissa, exponent, sign) = x.integer_decode();
        let shift = i32::from(exponent) + bits;
        let shifted = if shift >= 0 {
            BigInt::from(mantissa) << shift
        } else {
            assert!(mantissa == 0 || mantissa.trailing_zeros() as i32 >= -shift, "{x} needs more bits");
            BigInt::from(mantissa.checked_shr(-shift as u32).unwrap_or(0))
        };
        shifted * sign
    }

    /// Compares [`Placement::point`] and [`Placement::as_one`] with exact arithmetic, and with each other. Numbers of the
    /// steps are multiples of 2^-`bits`. Returns the largest share of the bound that is used.
    fn check_error(placement: &Placement, p: DVec3, bits: i32) -> f64 {
        let mut exact = p.to_array().map(|x| fixed(x, bits));
        let mut unit = bits;
        for step in &placement.steps {
            let (linear, offset) = match step {
                Step::Affine(map) => (DMat3::from_mat4(*map), map.w_axis.truncate()),
                Step::Shift { scale, .. } => (DMat3::from_diagonal(DVec3::splat(*scale)), DVec3::ZERO),
            };
            if let Step::Shift { middle, .. } = step {
                for (x, middle) in exact.iter_mut().zip(middle.to_array()) {
                    *x -= fixed(middle, unit);
                }
            }
            unit += bits;
            exact = [0, 1, 2].map(|row| {
                let terms = (0..3).map(|column| &exact[column] * fixed(linear.col(column)[row], bits));
                terms.sum::<BigInt>() + fixed(offset[row], unit)
            });
        }
        let (linear, offset) = placement.as_one();
        let (error, forms) = (placement.error(p.abs()), [placement.point(p), linear * p + offset]);
        let mut share = 0.0;
        for axis in 0..3 {
            let numbers = [fixed(forms[0][axis], unit), fixed(forms[1][axis], unit), exact[axis].clone()];
            for (a, b) in [(0, 1), (0, 2), (1, 2)] {
                let (off, bound) =
                    ((&numbers[a] - &numbers[b]).magnitude().clone(), fixed(error[axis], unit));
                assert!(off <= *bound.magnitude(), "axis {axis}, forms {a} and {b}: {}", error[axis]);
                // 40 bits of the quotient.
                let quotient = (off << 40u32) / bound.magnitude().max(&1u32.into());
                share = f64::max(share, quotient.to_f64().expect("a number") / (1u64 << 40) as f64);
            }
        }
        share
    }

    /// A thousand maps, of which some cancel what others did.
    #[test]
    fn the_error_of_a_thousand_steps_is_bounded() {
        let mut placement = Placement::default();
        for i in 0..1000u32 {
            let angle = f64::from(i * i % 97) / 31.0;
            let turn = DMat4::from_axis_angle(DVec3::new(0.6, 0.0, 0.8), angle);
            let scale = DVec3::from([0.75, 1.25, 1.1].map(|x| if i.is_multiple_of(2) { x } else { 1.0 / x }));
            let moved = DVec3::new(0.1, -0.3, 0.7) * f64::from(i % 5);
            placement.then(match i % 3 {
                0 => Step::Shift { middle: moved, scale: [0.7, 1.4][i as usize % 2] },
                _ => Step::Affine(DMat4::from_translation(moved) * turn * DMat4::from_scale(scale)),
            });
        }
        check_error(&placement, DVec3::new(0.1, -7.0 / 3.0, 1e3), 200);
    }

    /// Where nothing cancels, the bound of a thousand maps, some 16,000 roundings, is as close as rounding errors that
    /// cancel allow: they add up as their number's square root, of 4,000.
    #[test]
    fn the_error_of_a_thousand_steps_is_close() {
        let mut placement = Placement::default();
        for i in 0..1000u32 {
            let scale = if i.is_multiple_of(2) { 0.7 } else { 1.0 / 0.7 };
            let map =
                DMat4::from_scale(DVec3::splat(scale)) * DMat4::from_translation(DVec3::new(0.1, 0.2, 0.3));
            placement.then(Step::Affine(map));
        }
        let share = check_error(&placement, DVec3::new(0.1, 7.0 / 3.0, 1e3), 200);
        assert!((1e-4..1.0).contains(&share), "{share}");
    }

    /// Products below the least number become 0, and a later step magnifies what was lost.
    #[test]
    fn the_error_covers_underflow() {
        let steps = |scales: &[i32]| {
            let mut placement = Placement::default();
            for &scale in scales {
                let scale = f64::from(scale).exp2();
                placement.then(Step::Affine(DMat4::from_scale(DVec3::splat(scale))));
                placement.then(Step::Shift { middle: DVec3::ZERO, scale: 0.5 });
            }
            placement
        };
        // The point underflows.
        check_error(&steps(&[-600, 600]), DVec3::splat((-600f64).exp2()), 1074);
        // Only the linear map of all steps does.
        check_error(&steps(&[-600, -600]), DVec3::splat(600f64.exp2()), 1074);
        check_error(&steps(&[-600, -600, 1000]), DVec3::splat(100f64.exp2()), 1074);
    }

    #[test]
    fn one_map_is_as_good_as_the_steps() {
        let placement = two_steps();
        let (linear, offset) = placement.as_one();
        for p in mesh().positions {
            let off = (linear * p + offset - placement.point(p)).abs();
            assert!(off.cmple(placement.error(p.abs())).all(), "{off}");
        }
    }
}
