//! kiln's own structures. What the room uses of `bvh` and `geometry` stands here and nowhere else.

use glam::DVec3;

use super::{Built, Engine, Mesh};
use crate::bvh::{self, Accelerator, Preset, Primitive, Slot, Structure, Traversal};
use crate::error::Result;
use crate::geometry::{Numerics, PrimId, Triangle};

/// One of kiln's structures in one of its tiers.
struct Kiln {
    structure: Structure,
    numerics: Numerics,
}

/// Every structure in every tier.
pub fn engines() -> Vec<Box<dyn Engine>> {
    let structures = [
        Structure::BruteForce,
        Structure::Tree(Preset::default()),
        Structure::Wide(Preset::default()),
        Structure::Portable(Preset::default()),
    ];
    let kilns = structures.into_iter().flat_map(|structure| {
        Numerics::ALL.map(|numerics| Box::new(Kiln { structure, numerics }) as Box<dyn Engine>)
    });
    kilns.collect()
}

impl Engine for Kiln {
    fn name(&self) -> &'static str {
        "kiln"
    }

    fn layout(&self) -> &'static str {
        match self.structure {
            Structure::BruteForce => "brute-force",
            Structure::Tree(_) => "bvh2",
            Structure::Wide(_) => "bvh8",
            Structure::Portable(_) => "bvh8-portable",
        }
    }

    fn tier(&self) -> Option<&'static str> {
        Some(self.numerics.name())
    }

    fn is_exhaustive(&self) -> bool {
        self.structure == Structure::BruteForce
    }

    fn build(&self, mesh: &Mesh) -> Result<Box<dyn Built>> {
        Ok(built(mesh, self.structure, self.numerics))
    }
}

/// kiln's structure over a mesh.
pub fn accelerator(mesh: &Mesh, structure: Structure, numerics: Numerics) -> Box<dyn Accelerator> {
    let slots = (0..mesh.triangles.len() as u32).map(|id| {
        let triangle = Triangle(mesh.corners(id).map(|corner| corner.as_dvec3()));
        Slot { primitive: Primitive::Triangle(triangle), id: PrimId(id) }
    });
    bvh::build(slots, structure, numerics)
}

/// The same as an engine gives it.
pub fn built(mesh: &Mesh, structure: Structure, numerics: Numerics) -> Box<dyn Built> {
    Box::new(BuiltKiln(accelerator(mesh, structure, numerics)))
}

struct BuiltKiln(Box<dyn Accelerator>);

impl Built for BuiltKiln {
    fn crossings(&self, origin: DVec3, direction: DVec3, found: &mut Vec<u32>) {
        let ray = self.0.numerics().precision().ray(origin, direction, 0.0, f64::INFINITY);
        let (mut traversal, mut hits) = (Traversal::default(), Vec::new());
        self.0.all_hits(&ray, &mut hits, &mut traversal);
        found.extend(hits.iter().map(|hit| hit.prim.0));
    }
}
