//! Counts rays that leak out of the closed meshes of a scene. Points inside the meshes are searched for first;
//! [`crate::bench::leaks`] tests a sphere instead, whose inside is known.
//!
//! A ray from inside a closed mesh must hit it, however the vertices were rounded, as long as adjacent triangles share
//! them. Rays are aimed at vertices and edges, the most difficult targets.

use glam::DVec3;

use crate::bench::Numbers;
use crate::bench::leaks::count;
use kiln::bvh::detail::{Accelerator, Layout, Slot};
use kiln::bvh::{self, Numerics, PrimId, Primitive, Ray, Traversal, Triangle};
use kiln::error::Result;
use kiln::render::RenderControl;
use kiln::scene::mesh::topology::Topology;
use kiln::scene::{Scene, Shape};

/// Number of interior points per mesh.
const INTERIOR_POINTS: usize = 32;

/// Maximum number of rays to find an interior point.
const TRIES: u64 = 64;

/// A closed mesh with interior points.
pub(crate) struct ClosedMesh {
    corners: Vec<[DVec3; 3]>,
    inside: Vec<DVec3>,
}

/// Closed meshes of a scene with interior points. Of instanced meshes, the first instance is used.
pub(crate) fn closed_meshes(scene: &Scene) -> Vec<ClosedMesh> {
    let meshes = scene.objects.iter().filter_map(|object| match &object.shape {
        // Vertices rounded to f32, so that all tiers test the same mesh.
        Shape::Mesh(mesh) => {
            let rounded: Vec<DVec3> = mesh.positions.iter().map(|p| p.as_vec3().as_dvec3()).collect();
            let topology = Topology::of_triangles(&rounded, &mesh.triangles);
            let corners = || mesh.triangles.iter().map(|triangle| triangle.map(|i| rounded[i as usize]));
            // Every edge belongs to two triangles.
            let is_closed = topology.boundary_edges.count + topology.non_manifold_edges.count == 0;
            (is_closed && topology.edges > 0).then(|| corners().collect())
        }
        _ => None,
    });
    meshes.filter_map(ClosedMesh::new).collect()
}

impl ClosedMesh {
    /// `None` if no interior point is found: the mesh is thinner than the resolution of f32.
    fn new(corners: Vec<[DVec3; 3]>) -> Option<Self> {
        let mut closed = ClosedMesh { corners, inside: Vec::new() };
        let exact = closed.accelerator(Numerics::Exact);
        closed.inside = (0..INTERIOR_POINTS as u64).filter_map(|i| closed.point_inside(&*exact, i)).collect();
        (!closed.inside.is_empty()).then_some(closed)
    }

    fn accelerator(&self, numerics: Numerics) -> Box<dyn Accelerator> {
        let slots = (0..)
            .zip(&self.corners)
            .map(|(id, &corners)| Slot { primitive: Primitive::Triangle(Triangle(corners)), id: PrimId(id) });
        bvh::detail::build(slots, Layout::default(), numerics)
    }

    /// An interior point: the middle between the first two intersections of a line with the mesh. The line starts
    /// outside and goes through the centroid of a random triangle in a random direction.
    fn point_inside(&self, exact: &dyn Accelerator, index: u64) -> Option<DVec3> {
        let reach = self.corners.iter().flatten().map(|p| p.abs().max_element()).fold(0.0, f64::max);
        let mut traversal = Traversal::default();
        (0..TRIES).find_map(|attempt| {
            let mut numbers = Numbers::new(index, attempt);
            let target = self.corners[numbers.below(self.corners.len())].into_iter().sum::<DVec3>() / 3.0;
            let towards = DVec3::new(numbers.unit() - 0.5, numbers.unit() - 0.5, numbers.unit() - 0.5)
                .try_normalize()?;
            let origin = (target - 4.0 * reach * towards).as_vec3().as_dvec3();
            let precision = Numerics::Exact.ray_precision();
            let ray = precision.ray(origin, (target - origin).try_normalize()?, 0.0, f64::INFINITY);
            let distances = crossings(exact, &ray, &mut traversal)?;
            let &[enters, leaves, ..] = distances.as_slice() else { return None };
            let middle = ray.at((enters + leaves) / 2.0).as_vec3().as_dvec3();
            // Rounding to f32 may move the point outside, and an edge may be counted as two intersections. So the
            // number of intersections must be odd in several directions.
            let is_inside = |direction: DVec3| {
                let ray = precision.ray(middle, direction, 0.0, f64::INFINITY);
                crossings(exact, &ray, &mut Traversal::default()).is_some_and(|t| !t.len().is_multiple_of(2))
            };
            let aside = DVec3::new(numbers.unit() - 0.5, numbers.unit() - 0.5, numbers.unit() - 0.5);
            let aside = aside.try_normalize()?;
            [towards, -towards, aside, -aside].into_iter().all(is_inside).then_some(middle)
        })
    }

    /// Origin and direction of a ray from an interior point to a vertex or to a point on an edge.
    fn leak_ray(&self, index: u64) -> (DVec3, DVec3) {
        let mut numbers = Numbers::new(77, index);
        let origin = self.inside[numbers.below(self.inside.len())];
        let corners = self.corners[numbers.below(self.corners.len())];
        let first = numbers.below(3);
        let along = if index.is_multiple_of(4) { 0.0 } else { numbers.unit() };
        let target = corners[first].lerp(corners[(first + 1) % 3], along);
        (origin, (target - origin).try_normalize().unwrap_or(DVec3::X))
    }
}

/// Ascending distances of all hits of a ray with a mesh; `None` if two are equal, as at an edge.
fn crossings(exact: &dyn Accelerator, ray: &Ray, traversal: &mut Traversal) -> Option<Vec<f64>> {
    let mut hits = Vec::new();
    exact.all_hits(ray, &mut hits, traversal);
    let mut t: Vec<f64> = hits.iter().map(|hit| hit.t).collect();
    t.sort_by(f64::total_cmp);
    t.windows(2).all(|pair| pair[0] < pair[1]).then_some(t)
}

/// Numbers of leaking rays and of rays cast in a tier, over all meshes; casts at most `rays`.
///
/// # Errors
/// [`Error::Interrupted`] when cancelled.
pub(crate) fn count_leaks(
    closed: &[ClosedMesh],
    numerics: Numerics,
    rays: u64,
    control: &RenderControl,
) -> Result<(u64, u64)> {
    let each = rays / closed.len().max(1) as u64;
    let mut leaks = 0;
    for mesh in closed {
        let tier = mesh.accelerator(numerics);
        leaks += count(each, control, &|_| (), |index, traversal| {
            let (origin, direction) = mesh.leak_ray(index);
            let ray = numerics.ray_precision().ray(origin, direction, 0.0, f64::INFINITY);
            tier.closest_hit(&ray, traversal).is_none()
        })?;
    }
    Ok((leaks, each * closed.len() as u64))
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::AtomicBool;

    use super::*;

    /// The faces of a tetrahedron.
    fn tetrahedron() -> Vec<[DVec3; 3]> {
        let p = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
        [[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]].map(|face: [usize; 3]| face.map(|i| p[i])).to_vec()
    }

    fn leaks(corners: Vec<[DVec3; 3]>, missing: usize, numerics: Numerics) -> (u64, u64) {
        let mut closed = ClosedMesh::new(corners).expect("interior points");
        closed.corners.truncate(closed.corners.len() - missing);
        let cancel = AtomicBool::new(false);
        count_leaks(
            &[closed],
            numerics,
            20_000,
            &RenderControl { cancel: &cancel, progress: &|_, _| {}, time_stages: false },
        )
        .unwrap()
    }

    #[test]
    fn interior_points_are_inside() {
        // Inside this tetrahedron all coordinates are above 0, and their sum is below 1.
        let closed = ClosedMesh::new(tetrahedron()).unwrap();
        assert_eq!(closed.inside.len(), INTERIOR_POINTS);
        assert!(
            closed.inside.iter().all(|p| p.min_element() > 0.0 && p.element_sum() < 1.0),
            "{:?}",
            closed.inside
        );
    }

    /// A slab of 1 ulp has no f32 value inside, one of 4 ulp has.
    #[test]
    fn a_slab_of_one_ulp_has_no_interior_points() {
        let slab = |steps: f32| -> Vec<[DVec3; 3]> {
            let top = f64::from(1.0 + steps * f32::EPSILON);
            let p = |i: usize| {
                DVec3::new((i & 1) as f64, (i >> 1 & 1) as f64, if i & 4 == 0 { 1.0 } else { top })
            };
            let faces = [[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]];
            faces.iter().flat_map(|&[a, b, c, d]| [[p(a), p(b), p(c)], [p(a), p(c), p(d)]]).collect()
        };
        assert!(ClosedMesh::new(slab(1.0)).is_none());
        let inside = ClosedMesh::new(slab(4.0)).expect("three f32 values inside").inside;
        let (low, high) = (1.0, f64::from(1.0 + 4.0 * f32::EPSILON));
        assert!(inside.iter().all(|p| p.z > low && p.z < high), "{inside:?}");
    }

    #[test]
    fn only_a_mesh_with_a_missing_face_leaks() {
        for numerics in [Numerics::Watertight, Numerics::Double, Numerics::Exact] {
            assert_eq!(leaks(tetrahedron(), 0, numerics), (0, 20_000), "{numerics:?}");
        }
        assert!(leaks(tetrahedron(), 1, Numerics::Exact).0 > 0);
    }
}
