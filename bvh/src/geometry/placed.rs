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
        self.steps.iter().fold(reach, |reach, step| match step {
            Step::Affine(map) => DMat3::from_mat4(*map).abs() * reach + map.w_axis.truncate().abs(),
            Step::Shift { middle, scale } => (reach + middle.abs()) * scale.abs(),
        })
    }

    /// How far [`Placement::point`] is from exact, and from [`Placement::as_one`], for points within `reach`.
    ///
    /// A step has at most 3 products and 3 sums on the way of any number, so it is off by γ4 of what [`Placement::reach`]
    /// adds up (Higham, Accuracy and Stability of Numerical Algorithms, 2nd edition, section 3.1), in either form; putting
    /// two maps together is off by γ4 as well. Steps multiply their shares; this is above the sum for any number of them
    /// that a file has.
    pub fn error(&self, reach: DVec3) -> DVec3 {
        self.reach(reach) * (8.0 * (self.steps.len() + 1) as f64 * f64::EPSILON)
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
