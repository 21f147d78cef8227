//! tinybvh by its Rust wrapper, in its fastest layout for CPUs.

use glam::{DVec3, Vec4};
use tinybvh_rs::{Intersection, Intersector, Ray, bvh, bvh8_cpu, mbvh};

use super::{Built, Engine, Mesh};
use crate::error::{Error, Result};

/// BVH8_CPU: eight boxes a node, four triangles a leaf, by AVX2.
struct Bvh8Cpu;

/// Every layout.
pub fn engines() -> Vec<Box<dyn Engine>> {
    vec![Box::new(Bvh8Cpu)]
}

impl Engine for Bvh8Cpu {
    fn name(&self) -> &'static str {
        "tinybvh"
    }

    fn layout(&self) -> &'static str {
        "bvh8-cpu"
    }

    /// Its rays have no near end, so that they cannot go on behind a crossing.
    fn sees_beyond_the_first(&self) -> bool {
        false
    }

    fn build(&self, mesh: &Mesh) -> Result<Box<dyn Built>> {
        let failed = |e| Error::Failed { what: format!("tinybvh: {e}"), hint: String::new() };
        let triangles = 0..mesh.triangles.len() as u32;
        // Of the alignment that its own vectors have.
        let corners: Vec<Vec4> =
            triangles.flat_map(|id| mesh.corners(id).map(|corner| corner.extend(0.0))).collect();
        let corners: &[[f32; 4]] = bytemuck::cast_slice(&corners);
        let mut binary = bvh::BVH::new(corners.into()).map_err(failed)?;
        binary.split_leaves(4);
        let wide = mbvh::BVH::new(&binary);
        let tree = bvh8_cpu::BVH::new(&wide).map_err(failed)?;
        Ok(Box::new(BuiltTinybvh(tree)))
    }
}

struct BuiltTinybvh(bvh8_cpu::BVH);

// SAFETY: `BVH8_CPU::Intersect` is a const method that reads the tree and writes the ray; the tree has copies of the
// triangles.
unsafe impl Sync for BuiltTinybvh {}

/// C++ gives its rays an alignment of 64 and Rust's counterpart has 16; compiled code may rely on the former.
#[repr(align(64))]
struct Aligned(Ray);

impl Built for BuiltTinybvh {
    fn crossings(&self, origin: DVec3, direction: DVec3, found: &mut Vec<u32>) {
        // As tinybvh's own constructor does it, except that it would normalise the direction once more.
        let reciprocal = |x: f32| match x.abs() > 1e-12 {
            true => 1.0 / x,
            false if x >= 0.0 => tinybvh_rs::INFINITE,
            false => -tinybvh_rs::INFINITE,
        };
        let dir = direction.as_vec3().to_array();
        let mut ray = Aligned(Ray {
            origin: origin.as_vec3().to_array(),
            // Its mask of instances: all.
            padding_0: 0xffff,
            dir,
            r_d: dir.map(reciprocal),
            hit: Intersection::new(),
            ..Ray::default()
        });
        self.0.intersect(&mut ray.0);
        if ray.0.hit.t < tinybvh_rs::INFINITE {
            found.push(ray.0.hit.prim);
        }
    }
}
