//! How many rays slip out of the closed meshes of a scene. [`crate::bench::leaks`] does this for a sphere of its own, whose inside is
//! known; here points inside have to be found first.
//!
//! A ray that starts inside a closed mesh has to hit it, whatever it is aimed at and however its corners were rounded, as long as
//! neighbours share them. Rays are aimed where that is hardest: at corners and edges.

use std::collections::HashMap;
use std::sync::atomic::Ordering;

use glam::DVec3;
use rayon::prelude::*;

use crate::bench::Numbers;
use crate::bvh::{self, Accelerator, Layout, Primitive, Slot, Traversal};
use crate::error::{Error, Result};
use crate::geometry::{Numerics, PrimId, Ray, Triangle};
use crate::render::RenderControl;
use crate::scene::{Mesh, Scene, Shape};

/// Points inside that are looked for.
const INSIDE: usize = 32;

/// Rays that may be cast to find one of them.
const TRIES: u64 = 64;

/// Rays are handed to threads by so many.
const CHUNK: u64 = 4096;

/// A closed mesh and points inside it.
pub struct Closed {
    corners: Vec<[DVec3; 3]>,
    inside: Vec<DVec3>,
}

/// The closed meshes of a scene that have an inside. Those that stand in many places are taken where they first stand.
pub fn closed(scene: &Scene) -> Vec<Closed> {
    let meshes = scene.objects.iter().filter_map(|object| match &object.shape {
        Shape::Mesh(mesh) => Some(corners(mesh)),
        _ => None,
    });
    meshes.filter(|corners| is_closed(corners)).filter_map(Closed::new).collect()
}

/// In f32, as `fast` and `watertight` have them, so that all tiers are asked about the same mesh.
fn corners(mesh: &Mesh) -> Vec<[DVec3; 3]> {
    let rounded = |i: u32| mesh.positions[i as usize].as_vec3().as_dvec3();
    mesh.triangles.iter().map(|triangle| triangle.map(rounded)).collect()
}

/// Whether every edge, by the positions of its ends, belongs to two triangles.
fn is_closed(corners: &[[DVec3; 3]]) -> bool {
    let bits = |p: DVec3| (p + 0.0).to_array().map(f64::to_bits);
    let mut edges: HashMap<[[u64; 3]; 2], u32> = HashMap::new();
    for triangle in corners {
        for i in 0..3 {
            let mut edge = [bits(triangle[i]), bits(triangle[(i + 1) % 3])];
            edge.sort_unstable();
            *edges.entry(edge).or_default() += 1;
        }
    }
    !edges.is_empty() && edges.values().all(|&count| count == 2)
}

impl Closed {
    /// `None` where no point inside is found: the mesh is thinner than its numbers.
    fn new(corners: Vec<[DVec3; 3]>) -> Option<Self> {
        let mut closed = Closed { corners, inside: Vec::new() };
        let exact = closed.accelerator(Numerics::Exact);
        closed.inside = (0..INSIDE as u64).filter_map(|i| closed.point_inside(&*exact, i)).collect();
        (!closed.inside.is_empty()).then_some(closed)
    }

    fn accelerator(&self, numerics: Numerics) -> Box<dyn Accelerator> {
        let slots = (0..)
            .zip(&self.corners)
            .map(|(id, &corners)| Slot { primitive: Primitive::Triangle(Triangle(corners)), id: PrimId(id) });
        bvh::build(slots, Layout::default(), numerics)
    }

    /// Half-way between where a line enters and where it leaves. The line starts outside and goes through the middle of a triangle,
    /// off its edges, in a direction that is nobody's.
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
            let crossed = crossings(exact, &ray, &mut traversal)?;
            let &[enters, leaves, ..] = crossed.as_slice() else { return None };
            let middle = ray.at((enters + leaves) / 2.0).as_vec3().as_dvec3();
            // What rounding the point to f32 has moved through a wall is outside. So is what an edge, counted for both of its triangles,
            // made look like a way in and out.
            let is_inside = |direction: DVec3| {
                let ray = precision.ray(middle, direction, 0.0, f64::INFINITY);
                crossings(exact, &ray, &mut Traversal::default()).is_some_and(|t| !t.len().is_multiple_of(2))
            };
            let aside = DVec3::new(numbers.unit() - 0.5, numbers.unit() - 0.5, numbers.unit() - 0.5);
            let aside = aside.try_normalize()?;
            [towards, -towards, aside, -aside].into_iter().all(is_inside).then_some(middle)
        })
    }
}

/// Where a ray crosses a closed mesh, in order; `None` where two of these are one number: at an edge, or where it is not clear.
fn crossings(exact: &dyn Accelerator, ray: &Ray, traversal: &mut Traversal) -> Option<Vec<f64>> {
    let mut hits = Vec::new();
    exact.all_hits(ray, &mut hits, traversal);
    let mut t: Vec<f64> = hits.iter().map(|hit| hit.t).collect();
    t.sort_by(f64::total_cmp);
    t.windows(2).all(|pair| pair[0] < pair[1]).then_some(t)
}

/// How many of `rays` rays slip out in a tier, all meshes together, and how many were cast.
///
/// # Errors
/// [`Error::Interrupted`] when cancelled.
pub fn count(closed: &[Closed], numerics: Numerics, rays: u64, watch: &RenderControl) -> Result<(u64, u64)> {
    let each = rays / closed.len().max(1) as u64;
    let mut leaks = 0;
    for mesh in closed {
        let tier = mesh.accelerator(numerics);
        leaks += (0..each.div_ceil(CHUNK))
            .into_par_iter()
            .flat_map_iter(|chunk| chunk * CHUNK..each.min((chunk + 1) * CHUNK))
            .map_init(Traversal::default, |traversal, index| {
                let (origin, direction) = mesh.aimed(index);
                let ray = numerics.ray_precision().ray(origin, direction, 0.0, f64::INFINITY);
                u64::from(tier.closest_hit(&ray, traversal).is_none())
            })
            .sum::<u64>();
        if watch.cancel.load(Ordering::Relaxed) {
            return Err(Error::Interrupted);
        }
    }
    Ok((leaks, each * closed.len() as u64))
}

impl Closed {
    /// From a point inside to a corner, or to somewhere on an edge.
    fn aimed(&self, index: u64) -> (DVec3, DVec3) {
        let mut numbers = Numbers::new(77, index);
        let origin = self.inside[numbers.below(self.inside.len())];
        let corners = self.corners[numbers.below(self.corners.len())];
        let first = numbers.below(3);
        let along = if index.is_multiple_of(4) { 0.0 } else { numbers.unit() };
        let target = corners[first].lerp(corners[(first + 1) % 3], along);
        (origin, (target - origin).try_normalize().unwrap_or(DVec3::X))
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::AtomicBool;

    use super::*;

    /// The corners of a tetrahedron, by faces.
    fn tetrahedron() -> Vec<[DVec3; 3]> {
        let p = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
        [[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]].map(|face: [usize; 3]| face.map(|i| p[i])).to_vec()
    }

    fn leaks(corners: Vec<[DVec3; 3]>, missing: usize, numerics: Numerics) -> (u64, u64) {
        let mut closed = Closed::new(corners).expect("it has an inside");
        closed.corners.truncate(closed.corners.len() - missing);
        let cancel = AtomicBool::new(false);
        count(
            &[closed],
            numerics,
            20_000,
            &RenderControl { cancel: &cancel, progress: &|_, _| {}, time_stages: false },
        )
        .unwrap()
    }

    #[test]
    fn what_is_closed_is_known() {
        assert!(is_closed(&tetrahedron()));
        assert!(!is_closed(&tetrahedron()[1..]));
        assert!(!is_closed(&[]));
    }

    #[test]
    fn points_inside_are_inside() {
        // Of this tetrahedron: all coordinates above 0, their sum below 1.
        let closed = Closed::new(tetrahedron()).unwrap();
        assert_eq!(closed.inside.len(), INSIDE);
        assert!(
            closed.inside.iter().all(|p| p.min_element() > 0.0 && p.element_sum() < 1.0),
            "{:?}",
            closed.inside
        );
    }

    /// A wall of one step of f32 has no number inside, one of four has; no threshold tells them apart.
    #[test]
    fn what_is_thinner_than_its_numbers_has_no_inside() {
        let slab = |steps: f32| -> Vec<[DVec3; 3]> {
            let top = f64::from(1.0 + steps * f32::EPSILON);
            let p = |i: usize| {
                DVec3::new((i & 1) as f64, (i >> 1 & 1) as f64, if i & 4 == 0 { 1.0 } else { top })
            };
            let faces = [[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]];
            faces.iter().flat_map(|&[a, b, c, d]| [[p(a), p(b), p(c)], [p(a), p(c), p(d)]]).collect()
        };
        assert!(is_closed(&slab(4.0)));
        assert!(Closed::new(slab(1.0)).is_none());
        let inside = Closed::new(slab(4.0)).expect("three numbers inside").inside;
        let (low, high) = (1.0, f64::from(1.0 + 4.0 * f32::EPSILON));
        assert!(inside.iter().all(|p| p.z > low && p.z < high), "{inside:?}");
    }

    #[test]
    fn a_missing_face_is_noticed_and_a_closed_mesh_does_not_leak() {
        for numerics in [Numerics::Watertight, Numerics::Double, Numerics::Exact] {
            assert_eq!(leaks(tetrahedron(), 0, numerics), (0, 20_000), "{numerics:?}");
        }
        assert!(leaks(tetrahedron(), 1, Numerics::Exact).0 > 0);
    }
}
