//! The hits that an acceleration structure returns for a ray, and their comparison.

use kiln::bvh::detail::{Accelerator, HitBuffer, RayBuffer};
use kiln::bvh::{Hit, PrimId, Ray, Traversal};

/// Rays per batch.
const BATCH: usize = 64;

/// Results of all queries of a structure for a ray; distances as bits.
#[derive(Debug, Clone, PartialEq)]
pub struct RayResults {
    pub closest: Option<(PrimId, u64)>,
    pub occluded: bool,
    /// All hits, sorted by primitive.
    pub all: Vec<(PrimId, u64)>,
}

fn bits(hit: &Hit) -> (PrimId, u64) {
    (hit.prim, hit.t.to_bits())
}

impl RayResults {
    pub fn of(accelerator: &dyn Accelerator, ray: &Ray, traversal: &mut Traversal) -> Self {
        let mut all = Vec::new();
        accelerator.all_hits(ray, &mut all, traversal);
        let mut all: Vec<_> = all.iter().map(bits).collect();
        all.sort_unstable();
        let closest = accelerator.closest_hit(ray, traversal).as_ref().map(bits);
        RayResults { closest, occluded: accelerator.is_occluded(ray, traversal), all }
    }

    /// The results for each ray.
    pub fn to_all(accelerator: &dyn Accelerator, rays: &[Ray]) -> Vec<Self> {
        let mut traversal = Traversal::default();
        rays.iter().map(|ray| RayResults::of(accelerator, ray, &mut traversal)).collect()
    }

    /// The same, but closest hits and occlusion of batches: in `fast` these may be others.
    pub fn in_batches(accelerator: &dyn Accelerator, rays: &[Ray]) -> Vec<Self> {
        let mut traversal = Traversal::default();
        let (mut closest, mut occluded) = (HitBuffer::default(), Vec::new());
        for batch in RayBuffer::from(rays).rays().chunks(BATCH) {
            accelerator.closest_hits(batch, &mut closest, &mut traversal);
            accelerator.are_occluded(batch, &mut occluded, &mut traversal);
        }
        let alone = RayResults::to_all(accelerator, rays).into_iter().enumerate();
        let in_batch = |(i, alone)| RayResults {
            closest: closest.get(i).as_ref().map(bits),
            occluded: occluded[i],
            ..alone
        };
        alone.map(in_batch).collect()
    }

    /// These results with all distances multiplied by a power of two.
    pub fn times(&self, factor: f64) -> Self {
        let times = |(id, t): &(PrimId, u64)| (*id, (f64::from_bits(*t) * factor).to_bits());
        RayResults {
            closest: self.closest.as_ref().map(times),
            occluded: self.occluded,
            all: self.all.iter().map(times).collect(),
        }
    }

    /// Describes the difference from the expected results.
    pub fn unlike(&self, expected: &RayResults) -> String {
        let only = |a: &RayResults, b: &RayResults| {
            let hits = a.all.iter().filter(|hit| !b.all.contains(hit));
            hits.map(|(id, t)| (id.0, f64::from_bits(*t))).take(3).collect::<Vec<_>>()
        };
        format!(
            "closest {:?}, expected {:?}; hits not expected {:?}, expected but missing {:?}",
            self.closest.map(|(id, t)| (id.0, f64::from_bits(t))),
            expected.closest.map(|(id, t)| (id.0, f64::from_bits(t))),
            only(self, expected),
            only(expected, self),
        )
    }
}

/// Checks that a structure returns the expected results, bit for bit, for single rays and for batches.
pub fn check_results(
    what: &str,
    accelerator: &dyn Accelerator,
    rays: &[Ray],
    expected: &[RayResults],
    faults: &mut Faults,
) {
    check_both(what, accelerator, rays, [expected, expected], faults);
}

/// [`check_results`] with results for single rays and for batches.
pub fn check_both(
    what: &str,
    accelerator: &dyn Accelerator,
    rays: &[Ray],
    [alone, in_batches]: [&[RayResults]; 2],
    faults: &mut Faults,
) {
    let found = [RayResults::to_all(accelerator, rays), RayResults::in_batches(accelerator, rays)];
    for (how, found, expected) in [("", &found[0], alone), (", in batches", &found[1], in_batches)] {
        for ((ray, found), expected) in rays.iter().zip(found).zip(expected) {
            let holds = found == expected;
            faults.check(holds, || format!("{what}{how}: {ray:?}: {}", found.unlike(expected)));
        }
    }
}

/// Counts failed checks and keeps the message of the first.
pub struct Faults {
    what: String,
    checked: usize,
    count: usize,
    first: Option<String>,
}

impl Faults {
    pub fn new(what: String) -> Self {
        Faults { what, checked: 0, count: 0, first: None }
    }

    pub fn check(&mut self, holds: bool, say: impl FnOnce() -> String) {
        self.checked += 1;
        if !holds {
            self.count += 1;
            self.first.get_or_insert_with(say);
        }
    }

    /// Panics if a check failed.
    pub fn none(&self) {
        let Faults { what, checked, count, first } = self;
        assert!(
            *count == 0,
            "{what}: {count} of {checked} checks fail; the first: {}",
            first.as_deref().unwrap_or("")
        );
    }
}
