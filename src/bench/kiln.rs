//! kiln's own structures. What the room uses of `bvh` and `geometry` stands here and nowhere else.

use glam::DVec3;

use super::{Built, Engine, Mesh};
use crate::bvh::{self, Accelerator, BruteForce, Preset, Primitive, Slot, Traversal};
use crate::error::Result;
use crate::geometry::{PrimId, Ray, Triangle};

/// One of kiln's structures.
struct Kiln {
    layout: &'static str,
}

const BRUTE_FORCE: &str = "brute-force";
const TREE: &str = "bvh2";

/// Every structure.
pub fn engines() -> Vec<Box<dyn Engine>> {
    [BRUTE_FORCE, TREE].map(|layout| Box::new(Kiln { layout }) as Box<dyn Engine>).into()
}

impl Engine for Kiln {
    fn name(&self) -> &'static str {
        "kiln"
    }

    fn layout(&self) -> &'static str {
        self.layout
    }

    fn tier(&self) -> Option<&'static str> {
        Some("watertight")
    }

    fn is_exhaustive(&self) -> bool {
        self.layout == BRUTE_FORCE
    }

    fn build(&self, mesh: &Mesh) -> Result<Box<dyn Built>> {
        let triangles = (0..mesh.triangles.len() as u32).map(|id| (id, Triangle(mesh.corners(id))));
        let slots: Vec<Slot> = triangles
            .map(|(id, triangle)| Slot { primitive: Primitive::Triangle(triangle), id: PrimId(id) })
            .collect();
        Ok(Box::new(BuiltKiln(match self.is_exhaustive() {
            true => Box::new(BruteForce::new(slots)),
            false => Box::new(bvh::build(&slots, Preset::default())),
        })))
    }
}

struct BuiltKiln(Box<dyn Accelerator>);

impl Built for BuiltKiln {
    fn crossings(&self, origin: DVec3, direction: DVec3, found: &mut Vec<u32>) {
        let mut ray = Ray::new(origin, direction, 0.0, f64::INFINITY);
        let mut traversal = Traversal::default();
        while let Some(hit) = self.0.closest_hit(&ray, &mut traversal) {
            found.push(hit.prim.0);
            ray.t_min = hit.t;
        }
    }
}
