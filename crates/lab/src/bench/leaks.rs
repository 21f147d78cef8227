//! Counts rays that leak through a closed mesh.
//!
//! A ray from inside must cross a back face; a ray from outside that is aimed at the mesh must cross a front face and a
//! back face. Otherwise it leaked between two triangles or past a bounding box. The rays are aimed at vertices and
//! edges, where that is most likely, or leave the surface there; others go anywhere ([`LeakRayKind`]). Crossings are classified by side and not
//! counted, as a ray through an edge crosses both of its triangles.

use std::sync::atomic::{AtomicU64, Ordering};

use rayon::prelude::*;

use super::tetrahedron::Tetrahedron;
use super::{
    Built, Engine, Icosphere, LEVEL, LeakRayKind, Mesh, PLACEMENTS, Unavailable, embree, gathered, obvhs,
    own, ray, tinybvh,
};
use kiln::error::{Error, Result};
use kiln::render::RenderControl;

/// Subdivision level for engines that test every triangle: 320 triangles.
const EXHAUSTIVE_LEVEL: u32 = 2;

/// Subdivision levels of the tetrahedron for secondary rays: 65,536 triangles; 256 for engines that test every
/// triangle.
const TETRAHEDRON_LEVELS: [u32; 2] = [7, 3];

/// Rays per parallel task and progress step.
const CHUNK: u64 = 4096;

/// All libraries of [`engines`].
pub const NAMES: [&str; 4] = ["kiln", "obvhs", "embree", "tinybvh"];

/// The available engines in the order of [`NAMES`], and the unavailable libraries.
pub fn engines() -> (Vec<Engine>, Vec<Unavailable>) {
    gathered([Ok(own::leak_engines()), Ok(obvhs::engines()), embree::leak_engines(), tinybvh()])
}

/// Result of an engine at a placement.
#[derive(Debug, Clone, PartialEq)]
pub struct LeakRow {
    /// The library.
    pub engine: &'static str,
    /// Layout or mode.
    pub layout: &'static str,
    /// Numerics tier, if the library has several.
    pub tier: Option<&'static str>,
    /// Name of one of [`PLACEMENTS`].
    pub placement: &'static str,
    /// Number of triangles.
    pub triangles: usize,
    /// Whether rays from outside must cross a back face, too.
    pub followed_through: bool,
    /// Rays cast.
    pub rays: Counts,
    /// Rays that leaked.
    pub leaks: Counts,
}

/// A number of rays of each [`LeakRayKind`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Counts {
    /// From inside, aimed.
    pub aimed: u64,
    /// From inside, along an axis.
    pub axis_aligned: u64,
    /// From outside, aimed.
    pub outside: u64,
    /// Secondary rays, from the edges of a tetrahedron inwards.
    pub secondary: u64,
    /// From inside, in random directions: the rate of leaks that pictures have.
    pub random: u64,
}

impl Counts {
    /// Numbers of rays of a test with `rays` aimed rays from each side: 6 axis-aligned rays per 100 from inside, and
    /// `rays` secondary and random rays each.
    pub fn of_rays(rays: u64) -> Self {
        let axis_aligned = (u128::from(rays) * 6 / 100) as u64;
        Counts { aimed: rays, axis_aligned, outside: rays, secondary: rays, random: rays }
    }

    /// Aimed and axis-aligned rays from inside.
    pub fn inside(&self) -> u64 {
        self.aimed + self.axis_aligned
    }

    /// Rays without secondary and random rays.
    pub fn primary(&self) -> u64 {
        self.inside() + self.outside
    }

    /// All rays.
    pub fn total(&self) -> u64 {
        self.primary() + self.secondary + self.random
    }

    pub(super) fn of(&mut self, kind: LeakRayKind) -> &mut u64 {
        match kind {
            LeakRayKind::Inside => &mut self.aimed,
            LeakRayKind::AxisAligned => &mut self.axis_aligned,
            LeakRayKind::Outside => &mut self.outside,
            LeakRayKind::Random => &mut self.random,
        }
    }
}

/// Casts [`Counts::of_rays`] at each of [`PLACEMENTS`] with each of `engines`, on the current rayon pool. The result
/// does not depend on the number of threads.
///
/// # Errors
/// [`Error::Interrupted`] when cancelled, [`Error::Failed`] if an engine cannot build its structure.
pub fn measure(engines: &[Engine], rays: u64, control: &RenderControl) -> Result<Vec<LeakRow>> {
    let rays = Counts::of_rays(rays);
    let spheres = PLACEMENTS.map(|placement| Icosphere::new(LEVEL, placement));
    let coarse = PLACEMENTS.map(|placement| Icosphere::new(EXHAUSTIVE_LEVEL, placement));
    let steps = engines.len() as u64 * PLACEMENTS.len() as u64 * rays.total();
    let done = AtomicU64::new(0);
    let step = |count: u64| {
        let done = count + done.fetch_add(count, Ordering::Relaxed);
        (control.progress)(done as usize, steps as usize);
    };
    let tetrahedra =
        TETRAHEDRON_LEVELS.map(|level| PLACEMENTS.map(|placement| Tetrahedron::new(level, placement)));
    let [fine_tetrahedra, coarse_tetrahedra] = &tetrahedra;
    let mut rows = Vec::new();
    for engine in engines {
        let (spheres, tetrahedra) = match engine.label.layout {
            own::BRUTE_FORCE => (&coarse, coarse_tetrahedra),
            _ => (&spheres, fine_tetrahedra),
        };
        for (sphere, tetrahedron) in spheres.iter().zip(tetrahedra) {
            let built = engine.build(&sphere.mesh)?;
            let followed_through = built.finds_all_crossings();
            let mut leaks = primary_leaks(&*built, sphere, rays, control, &step)?;
            let built = engine.build(&tetrahedron.mesh)?;
            let origins = built.origins();
            leaks.secondary = count(rays.secondary, control, &step, |index, found: &mut Vec<u32>| {
                found.clear();
                let (origin, direction) = tetrahedron.secondary_ray(index, origins);
                built.crossings(origin, direction, found);
                !Crossings::new(&tetrahedron.mesh, direction, found).leaving
            })?;
            rows.push(LeakRow {
                engine: engine.label.engine,
                layout: engine.label.layout,
                tier: engine.label.tier,
                placement: sphere.placement.name,
                triangles: sphere.mesh.triangles.len(),
                followed_through,
                rays,
                leaks,
            });
        }
    }
    Ok(rows)
}

fn primary_leaks(
    built: &dyn Built,
    sphere: &Icosphere,
    rays: Counts,
    control: &RenderControl,
    step: &(dyn Fn(u64) + Sync),
) -> Result<Counts> {
    let mut leaks = Counts::default();
    for kind in LeakRayKind::ALL {
        *leaks.of(kind) = count(*{ rays }.of(kind), control, step, |index, found: &mut Vec<u32>| {
            found.clear();
            let (origin, direction) = ray(sphere, kind, index);
            built.crossings(origin, direction, found);
            let crossings = Crossings::new(&sphere.mesh, direction, found);
            !match kind {
                LeakRayKind::Inside | LeakRayKind::AxisAligned | LeakRayKind::Random => crossings.leaving,
                LeakRayKind::Outside => {
                    crossings.entering && (crossings.leaving || !built.finds_all_crossings())
                }
            }
        })?;
    }
    Ok(leaks)
}

/// Number of indices below `rays` for which `is_leak` returns `true`. It gets a value that may have been used before.
pub(crate) fn count<T: Default>(
    rays: u64,
    control: &RenderControl,
    step: &(dyn Fn(u64) + Sync),
    is_leak: impl Fn(u64, &mut T) -> bool + Sync,
) -> Result<u64> {
    let leaks = (0..rays.div_ceil(CHUNK)).into_par_iter().map(|chunk| {
        if control.cancel.load(Ordering::Relaxed) {
            return 0;
        }
        let indices = chunk * CHUNK..rays.min((chunk + 1) * CHUNK);
        let mut value = T::default();
        let leaks = indices.clone().filter(|&index| is_leak(index, &mut value)).count() as u64;
        step(indices.end - indices.start);
        leaks
    });
    let leaks = leaks.sum();
    if control.cancel.load(Ordering::Relaxed) {
        return Err(Error::Interrupted);
    }
    Ok(leaks)
}

/// Sides of the triangles that a ray crosses.
struct Crossings {
    /// At least one front face.
    entering: bool,
    /// At least one back face.
    leaving: bool,
}

impl Crossings {
    fn new(mesh: &Mesh, direction: glam::DVec3, found: &[u32]) -> Self {
        let (mut entering, mut leaving) = (false, false);
        for &triangle in found {
            let along = mesh.normal(triangle).dot(direction);
            entering |= along < 0.0;
            leaving |= along > 0.0;
        }
        Crossings { entering, leaving }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::AtomicBool;

    use super::*;

    /// Numbers of rays that leak through `built`, which may lack triangles of `sphere`.
    fn through(built: &dyn Built, sphere: &Icosphere, rays: u64) -> Counts {
        let cancel = AtomicBool::new(false);
        let control = RenderControl { cancel: &cancel, progress: &|_, _| {}, time_stages: false };
        primary_leaks(built, sphere, Counts::of_rays(rays), &control, &|_| {}).expect("nothing cancels it")
    }

    #[test]
    fn every_engine_leaks_through_a_missing_triangle_from_both_sides() {
        for engine in engines().0 {
            let sphere = Icosphere::new(1, PLACEMENTS[0]);
            let mut open = sphere.mesh.clone();
            open.triangles.pop();
            let closed = through(&*engine.build(&sphere.mesh).expect("a structure"), &sphere, 5000);
            let open = through(&*engine.build(&open).expect("a structure"), &sphere, 5000);
            // One of 80 triangles: of the rays along the axes, of which half are aimed at nothing in particular, some
            // 1 in 160 find it; of those at vertices and edges, those that the neighbours do not catch.
            let what = &engine.label;
            assert!(open.aimed > closed.aimed, "{what:?}: {open:?} {closed:?}");
            assert!(open.outside > closed.outside, "{what:?}: {open:?} {closed:?}");
        }
    }

    #[test]
    fn leaks_do_not_depend_on_the_number_of_threads() {
        // A sphere without its last triangle.
        let sphere = Icosphere::new(2, PLACEMENTS[1]);
        let mut open = sphere.mesh.clone();
        open.triangles.pop();
        let built = own::leak_engines()[0].build(&open).expect("a structure");
        let on = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
            pool.install(|| through(&*built, &sphere, 10_000))
        };
        let one = on(1);
        assert!(one.aimed > 0 && one.outside > 0, "{one:?}");
        // The hole is one of 320 triangles: 31 of 10,000 random rays from near the centre are expected, and fewer
        // than half or more than twice as many are beyond three standard deviations (of 5.6).
        assert!((15..=62).contains(&one.random), "{one:?}");
        assert_eq!(one, on(3));
    }

    #[test]
    fn six_rays_in_a_hundred_are_axis_aligned() {
        let counts = |rays| {
            let counts = Counts::of_rays(rays);
            (counts.axis_aligned, counts.inside(), counts.total())
        };
        assert_eq!(counts(1_000_000), (60_000, 1_060_000, 4_060_000));
        assert_eq!(counts(99), (5, 104, 401));
    }

    #[test]
    fn it_can_be_cancelled() {
        let cancel = AtomicBool::new(true);
        let control = RenderControl { cancel: &cancel, progress: &|_, _| {}, time_stages: false };
        let outcome = measure(&own::leak_engines(), 1_000_000, &control);
        assert!(matches!(outcome, Err(Error::Interrupted)));
    }
}
