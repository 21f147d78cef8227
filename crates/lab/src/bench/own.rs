//! kiln's own acceleration structures.

use glam::DVec3;

use super::speed::Kind;
use super::{Built, Engine, Facts, Label, Mesh, RayQueue};
use kiln::bvh::detail::{Accelerator, HitBuffer, Layout, RayBuffer, Slot, Tests};
use kiln::bvh::{self, Numerics, Preset, PrimId, Primitive, Ray, Traversal, Triangle};

/// Name of the layout whose queries test every triangle, which is feasible for small meshes only.
pub(crate) const BRUTE_FORCE: &str = "brute-force";

/// A structure in a tier.
pub(crate) fn engine(structure: Layout, numerics: Numerics) -> Engine {
    let (layout, preset) = match structure {
        Layout::BruteForce => (BRUTE_FORCE, None),
        Layout::Wide(preset) => ("bvh8", Some(preset)),
        Layout::Avx2(preset) => ("bvh8-avx2", Some(preset)),
        Layout::Portable(preset) => ("bvh8-portable", Some(preset)),
    };
    let isa = bvh::detail::build([], structure, Numerics::default()).describe().isa;
    let (tier, preset) = (Some(numerics.name()), preset.map(Preset::name));
    let label = Label { engine: "kiln", layout, tier, preset, isa };
    Engine::new(label, move |mesh| Ok(Box::new(BuiltKiln(accelerator(mesh, structure, numerics)))))
}

/// Engines of the leak test: all structures in all tiers.
pub(crate) fn leak_engines() -> Vec<Engine> {
    let preset = Preset::default();
    let structures = [Layout::BruteForce, Layout::Wide(preset), Layout::Portable(preset)];
    let in_tiers = |structure| Numerics::ALL.map(|numerics| engine(structure, numerics));
    structures.into_iter().flat_map(in_tiers).collect()
}

/// Engines of the speed test: the default layout in every tier, also by AVX2 on machines with more, and other layouts and
/// presets in the default tier.
pub(crate) fn engines() -> Vec<Engine> {
    let others = [
        Layout::Portable(Preset::default()),
        Layout::Wide(Preset::FastBuild),
        Layout::Wide(Preset::BestTrace),
    ];
    let [widest, avx2] = [Layout::default(), Layout::Avx2(Preset::default())]
        .map(|structure| Numerics::ALL.map(|numerics| engine(structure, numerics)));
    let avx2 = avx2.into_iter().filter(|engine| engine.label.isa != widest[0].label.isa).collect::<Vec<_>>();
    let others = others.map(|structure| engine(structure, Numerics::default()));
    widest.into_iter().chain(avx2).chain(others).collect()
}

/// Builds a structure of kiln over a mesh.
pub(crate) fn accelerator(mesh: &Mesh, structure: Layout, numerics: Numerics) -> Box<dyn Accelerator> {
    let slots = (0..mesh.triangles.len() as u32).map(|id| {
        let triangle = Triangle(mesh.corners(id).map(|corner| corner.as_dvec3()));
        Slot { primitive: Primitive::Triangle(triangle), id: PrimId(id) }
    });
    bvh::detail::build(slots, structure, numerics)
}

struct BuiltKiln(Box<dyn Accelerator>);

impl Built for BuiltKiln {
    fn facts(&self) -> Facts {
        let (description, quality) = (self.0.describe(), self.0.quality());
        Facts {
            nodes: Some(description.nodes as u64),
            depth: quality.map(|quality| quality.depth),
            sah_cost: quality.map(|quality| quality.sah_cost),
            bytes: Some(description.bytes as u64),
        }
    }

    fn queue<'a>(&'a self, kind: Kind, rays: &'a [Ray]) -> Box<dyn RayQueue + 'a> {
        // Filled once, so that their memory pages are mapped.
        let results = if kind.is_any_hit() {
            let mut occluded = vec![true; rays.len()];
            occluded.clear();
            Results::Any(occluded)
        } else {
            let mut hits = HitBuffer::default();
            hits.resize(rays.len());
            hits.clear();
            Results::Closest(hits)
        };
        let traversal = Traversal::default();
        Box::new(Queue { accelerator: &*self.0, rays: RayBuffer::from(rays), results, traversal })
    }

    fn crossings(&self, origin: DVec3, direction: DVec3, found: &mut Vec<u32>) {
        let ray = self.0.numerics().ray_precision().ray(origin, direction, 0.0, f64::INFINITY);
        let (mut traversal, mut hits) = (Traversal::default(), Vec::new());
        self.0.all_hits(&ray, &mut hits, &mut traversal);
        found.extend(hits.iter().map(|hit| hit.prim.0));
    }

    fn finds_all_crossings(&self) -> bool {
        true
    }

    fn origins(&self) -> Option<Numerics> {
        Some(self.0.numerics())
    }
}

struct Queue<'a> {
    accelerator: &'a dyn Accelerator,
    rays: RayBuffer,
    results: Results,
    traversal: Traversal,
}

/// Results of closest-hit and of any-hit queries.
enum Results {
    Closest(HitBuffer),
    Any(Vec<bool>),
}

impl RayQueue for Queue<'_> {
    fn run(&mut self) {
        let Queue { accelerator, rays, results, traversal } = self;
        match results {
            Results::Closest(hits) => accelerator.closest_hits(rays.rays(), hits, traversal),
            Results::Any(occluded) => accelerator.are_occluded(rays.rays(), occluded, traversal),
        }
    }

    fn hits(&self) -> Vec<Option<u32>> {
        match &self.results {
            Results::Closest(hits) => hits.iter().map(|hit| hit.map(|hit| hit.prim.0)).collect(),
            Results::Any(occluded) => occluded.iter().map(|&occluded| occluded.then_some(0)).collect(),
        }
    }

    fn distances(&self) -> Option<Vec<f64>> {
        match &self.results {
            Results::Closest(hits) => {
                Some(hits.iter().map(|hit| hit.map_or(f64::INFINITY, |hit| hit.t)).collect())
            }
            Results::Any(_) => None,
        }
    }

    fn tests(&self) -> Option<Tests> {
        Some(self.traversal.tests)
    }
}
