//! tinybvh by its Rust wrapper, with its fastest CPU layout.

use glam::{Vec3, Vec4};
use tinybvh_rs::{Intersection, Intersector, Ray, bvh, bvh8_cpu, mbvh};

use super::speed::Kind;
use super::{Built, Engine, Label, Mesh, RayQueue, singly};
use kiln::bvh;
use kiln::error::{Error, Result};

/// BVH8_CPU: eight boxes per node, four triangles per leaf, AVX2. Its rays have no t_min, so that they cannot be
/// continued behind a crossing.
pub(crate) fn engines() -> Vec<Engine> {
    let label = Label { engine: "tinybvh", layout: "bvh8-cpu", tier: None, preset: None, isa: "avx2" };
    vec![Engine::new(label, |mesh| Ok(Box::new(BuiltTinybvh::new(mesh)?)))]
}

struct BuiltTinybvh(bvh8_cpu::BVH);

impl BuiltTinybvh {
    fn new(mesh: &Mesh) -> Result<Self> {
        let failed = |e| Error::Failed { what: format!("tinybvh: {e}"), hint: String::new() };
        let triangles = 0..mesh.triangles.len() as u32;
        // With the alignment of tinybvh's vectors.
        let corners: Vec<Vec4> =
            triangles.flat_map(|id| mesh.corners(id).map(|corner| corner.extend(0.0))).collect();
        let corners: &[[f32; 4]] = bytemuck::cast_slice(&corners);
        let mut binary = bvh::BVH::new(corners.into()).map_err(failed)?;
        binary.split_leaves(4);
        let wide = mbvh::BVH::new(&binary);
        let tree = bvh8_cpu::BVH::new(&wide).map_err(failed)?;
        Ok(BuiltTinybvh(tree))
    }
}

// SAFETY: `BVH8_CPU::Intersect` is a const method that reads the tree and writes the ray; the tree has copies of the
// triangles.
unsafe impl Sync for BuiltTinybvh {}

/// Rays have an alignment of 64 in C++, on which compiled code may rely, but of 16 in the Rust wrapper.
#[repr(align(64))]
struct Aligned(Ray);

impl Aligned {
    fn new(origin: Vec3, direction: Vec3, t_max: f32) -> Self {
        // Like tinybvh's constructor, without normalising the direction again.
        let reciprocal = |x: f32| match x.abs() > 1e-12 {
            true => 1.0 / x,
            false if x >= 0.0 => tinybvh_rs::INFINITE,
            false => -tinybvh_rs::INFINITE,
        };
        let dir = direction.to_array();
        Aligned(Ray {
            origin: origin.to_array(),
            // Instance mask: all.
            padding_0: 0xffff,
            dir,
            r_d: dir.map(reciprocal),
            hit: Intersection { t: t_max.min(tinybvh_rs::INFINITE), ..Intersection::new() },
            ..Ray::default()
        })
    }
}

// SAFETY: the tree is not bound to a thread; see above.
unsafe impl Send for BuiltTinybvh {}

impl Built for BuiltTinybvh {
    /// The wrapper has no occlusion query: a hit before t_max is occlusion.
    fn queue<'a>(&'a self, _: Kind, rays: &'a [bvh::Ray]) -> Box<dyn RayQueue + 'a> {
        let own = |ray: &bvh::Ray| {
            let t_max = (ray.t_max() as f32).min(tinybvh_rs::INFINITE);
            (Aligned::new(ray.origin().as_vec3(), ray.direction().as_vec3(), t_max), t_max)
        };
        singly(rays.iter().map(own), |(ray, t_max)| {
            let mut ray = Aligned(ray.0);
            self.0.intersect(&mut ray.0);
            (ray.0.hit.t < *t_max).then_some(ray.0.hit.prim)
        })
    }
}
