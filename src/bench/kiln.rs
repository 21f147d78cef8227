//! kiln's own acceleration structures.

use glam::DVec3;

use super::speed::{self, BuiltContender, Contender, Facts, Label, RayQueue};
use super::{Built, Engine, Mesh};
use crate::bvh::{self, Accelerator, Layout, Preset, Primitive, Slot, Tests, Traversal};
use crate::error::Result;
use crate::geometry::{HitBuffer, Numerics, PrimId, Ray, RayBuffer, Triangle};

/// A structure of kiln in a tier.
struct Kiln {
    structure: Layout,
    numerics: Numerics,
}

/// All structures in all tiers.
pub(crate) fn engines() -> Vec<Box<dyn Engine>> {
    let structures = [
        Layout::BruteForce,
        Layout::Bvh2(Preset::default()),
        Layout::Wide(Preset::default()),
        Layout::Portable(Preset::default()),
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
            Layout::BruteForce => "brute-force",
            Layout::Bvh2(_) => "bvh2",
            Layout::Wide(_) => "bvh8",
            Layout::Avx2(_) => "bvh8-avx2",
            Layout::Portable(_) => "bvh8-portable",
        }
    }

    fn tier(&self) -> Option<&'static str> {
        Some(self.numerics.name())
    }

    fn origins(&self) -> Option<Numerics> {
        Some(self.numerics)
    }

    fn is_exhaustive(&self) -> bool {
        self.structure == Layout::BruteForce
    }

    fn build(&self, mesh: &Mesh) -> Result<Box<dyn Built>> {
        Ok(built(mesh, self.structure, self.numerics))
    }
}

/// Builds a structure of kiln over a mesh.
pub(crate) fn accelerator(mesh: &Mesh, structure: Layout, numerics: Numerics) -> Box<dyn Accelerator> {
    let slots = (0..mesh.triangles.len() as u32).map(|id| {
        let triangle = Triangle(mesh.corners(id).map(|corner| corner.as_dvec3()));
        Slot { primitive: Primitive::Triangle(triangle), id: PrimId(id) }
    });
    bvh::build(slots, structure, numerics)
}

/// Like [`accelerator`], as a structure of the leak test.
pub(crate) fn built(mesh: &Mesh, structure: Layout, numerics: Numerics) -> Box<dyn Built> {
    Box::new(BuiltKiln(accelerator(mesh, structure, numerics)))
}

struct BuiltKiln(Box<dyn Accelerator>);

impl Built for BuiltKiln {
    fn crossings(&self, origin: DVec3, direction: DVec3, found: &mut Vec<u32>) {
        let ray = self.0.numerics().ray_precision().ray(origin, direction, 0.0, f64::INFINITY);
        let (mut traversal, mut hits) = (Traversal::default(), Vec::new());
        self.0.all_hits(&ray, &mut hits, &mut traversal);
        found.extend(hits.iter().map(|hit| hit.prim.0));
    }
}

/// Contenders of `kiln bench`: every layout in every tier with the default preset, and all presets in the default tier.
pub(crate) fn contenders() -> Vec<Box<dyn Contender>> {
    let numerics = Numerics::default();
    let presets = [
        Layout::Bvh2(Preset::default()),
        Layout::Avx2(Preset::default()),
        Layout::Portable(Preset::default()),
        Layout::Wide(Preset::FastBuild),
        Layout::Wide(Preset::BestTrace),
    ]
    .map(|structure| Kiln { structure, numerics });
    let tiers = Numerics::ALL.map(|numerics| Kiln { structure: Layout::default(), numerics });
    tiers.into_iter().chain(presets).map(|kiln| Box::new(kiln) as Box<dyn Contender>).collect()
}

/// The default layout, tier and preset.
pub(crate) fn default_contender() -> Box<dyn Contender> {
    Box::new(Kiln { structure: Layout::default(), numerics: Numerics::default() })
}

/// The widest instruction set of a structure's traversal.
fn isa(structure: Layout) -> &'static str {
    let nothing = bvh::build([], structure, Numerics::default());
    nothing.describe().isa
}

impl Contender for Kiln {
    fn label(&self) -> Label {
        let preset = match self.structure {
            Layout::BruteForce => None,
            Layout::Bvh2(preset) | Layout::Wide(preset) | Layout::Avx2(preset) | Layout::Portable(preset) => {
                Some(preset.name())
            }
        };
        Label {
            engine: self.name(),
            layout: self.layout(),
            tier: self.tier(),
            preset,
            isa: isa(self.structure),
        }
    }

    fn build(&self, mesh: &Mesh) -> Result<Box<dyn BuiltContender>> {
        Ok(Box::new(BuiltKiln(accelerator(mesh, self.structure, self.numerics))))
    }
}

impl BuiltContender for BuiltKiln {
    fn facts(&self) -> Facts {
        let (description, quality) = (self.0.describe(), self.0.quality());
        Facts {
            nodes: Some(description.nodes as u64),
            depth: quality.map(|quality| quality.depth),
            sah_cost: quality.map(|quality| quality.sah_cost),
            bytes: Some(description.bytes as u64),
        }
    }

    fn queue<'a>(&'a self, kind: speed::Kind, rays: &'a [Ray]) -> Box<dyn RayQueue + 'a> {
        let (accelerator, traversal) = (&*self.0, Traversal::default());
        let rays = RayBuffer::from(rays);
        if kind.is_any_hit() {
            // Filled once, so that its memory pages are mapped.
            let mut occluded = vec![true; rays.len()];
            occluded.clear();
            return Box::new(Shadows { accelerator, rays, occluded, traversal });
        }
        let mut hits = HitBuffer::default();
        hits.resize(rays.len());
        hits.clear();
        Box::new(Closest { accelerator, rays, hits, traversal })
    }
}

/// Closest-hit queries.
struct Closest<'a> {
    accelerator: &'a dyn Accelerator,
    rays: RayBuffer,
    hits: HitBuffer,
    traversal: Traversal,
}

impl RayQueue for Closest<'_> {
    fn run(&mut self) {
        self.accelerator.closest_hits(self.rays.rays(), &mut self.hits, &mut self.traversal);
    }

    fn hits(&self) -> Vec<Option<u32>> {
        self.hits.iter().map(|hit| hit.map(|hit| hit.prim.0)).collect()
    }

    fn tests(&self) -> Option<Tests> {
        Some(self.traversal.tests)
    }
}

/// Any-hit queries.
struct Shadows<'a> {
    accelerator: &'a dyn Accelerator,
    rays: RayBuffer,
    occluded: Vec<bool>,
    traversal: Traversal,
}

impl RayQueue for Shadows<'_> {
    fn run(&mut self) {
        self.accelerator.are_occluded(self.rays.rays(), &mut self.occluded, &mut self.traversal);
    }

    fn hits(&self) -> Vec<Option<u32>> {
        self.occluded.iter().map(|&occluded| occluded.then_some(0)).collect()
    }

    fn tests(&self) -> Option<Tests> {
        Some(self.traversal.tests)
    }
}
