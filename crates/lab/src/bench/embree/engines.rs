//! Embree's engines: single rays and packets, build qualities, robust mode.

use std::ptr;

use glam::DVec3;

use super::super::speed::Kind;
use super::super::{Available, Built, Engine, Facts, Label, RayQueue};
use super::records::{Arguments, NOTHING, RayHit, RayHits, RayOnly, Rays, Valid};
use super::{Device, NATIVE_RAY8, NATIVE_RAY16, Quality, Scene};
use kiln::bvh::Ray;

/// Maximum number of crossings of a ray.
const MAX_CROSSINGS: usize = 64;

/// Query functions.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Calls {
    Single,
    Eight,
    Sixteen,
}

/// Engines of the leak test, if the library is available: both modes.
pub(crate) fn leak_engines() -> Available {
    let device = Device::find("")?;
    let label = |layout| Label { engine: "embree", layout, tier: None, preset: None, isa: isa(device) };
    Ok(["default", "robust"]
        .map(|layout| {
            engine(device, label(layout), (Quality::Medium, layout == "robust"), Calls::Single, false)
        })
        .into())
}

/// Engines of the speed test, if the library is available: with the machine's instruction set, and with AVX2 on machines
/// with AVX-512. `threads` is the number of build threads.
pub(crate) fn engines(threads: usize) -> Available {
    let widest = Device::find(&format!("threads={threads}"))?;
    let mut engines = engines_of(widest, ["single", "packets-8", "packets-8-coherent"]);
    if isa(widest) == "avx512" {
        let avx2 = Device::find(&format!("threads={threads},isa=avx2"))?;
        engines.extend(engines_of(avx2, ["single-avx2", "packets-8-avx2", "packets-8-coherent-avx2"]));
    }
    Ok(engines)
}

fn engines_of(device: &'static Device, [single, packets, coherent]: [&'static str; 3]) -> Vec<Engine> {
    let mut calls =
        vec![(single, Calls::Single, false), (packets, Calls::Eight, false), (coherent, Calls::Eight, true)];
    if device.property(NATIVE_RAY16) != 0 {
        calls.extend([("packets-16", Calls::Sixteen, false), ("packets-16-coherent", Calls::Sixteen, true)]);
    }
    // Robust mode builds the same tree in both qualities.
    let modes = [(Quality::Medium, false), (Quality::High, false), (Quality::Medium, true)];
    let of_calls = |(layout, calls, is_coherent)| {
        modes.map(|(quality, is_robust)| {
            let preset = if quality == Quality::High { "high" } else { "medium" };
            let tier = is_robust.then_some("robust");
            let label = Label { engine: "embree", layout, tier, preset: Some(preset), isa: isa(device) };
            engine(device, label, (quality, is_robust), calls, is_coherent)
        })
    };
    calls.into_iter().flat_map(of_calls).collect()
}

fn isa(device: &Device) -> &'static str {
    match () {
        () if device.property(NATIVE_RAY16) != 0 => "avx512",
        () if device.property(NATIVE_RAY8) != 0 => "avx2",
        () => "sse",
    }
}

/// `is_coherent`: whether coherent rays are flagged as coherent.
fn engine(
    device: &'static Device,
    label: Label,
    (quality, is_robust): (Quality, bool),
    calls: Calls,
    is_coherent: bool,
) -> Engine {
    Engine::new(label, move |mesh| {
        let scene = Scene::new(device, quality, is_robust, mesh)?;
        Ok(Box::new(BuiltEmbree { scene, calls, is_coherent }))
    })
}

struct BuiltEmbree {
    scene: Scene,
    calls: Calls,
    is_coherent: bool,
}

impl BuiltEmbree {
    fn queued<'a, R: Record + 'a>(
        &'a self,
        kind: Kind,
        rays: &[Ray],
        record: impl Fn(&[Ray]) -> R,
    ) -> Box<dyn RayQueue + 'a> {
        let is_coherent = self.is_coherent && kind.is_coherent();
        let records = rays.chunks(R::WIDTH).map(record).collect();
        Box::new(QueuedRays { scene: &self.scene, is_coherent, count: rays.len(), records })
    }
}

impl Built for BuiltEmbree {
    fn facts(&self) -> Facts {
        Facts { bytes: u64::try_from(self.scene.bytes).ok(), ..Facts::default() }
    }

    fn queue<'a>(&'a self, kind: Kind, rays: &'a [Ray]) -> Box<dyn RayQueue + 'a> {
        match (kind.is_any_hit(), self.calls) {
            (false, Calls::Single) => self.queued(kind, rays, |rays| RayHit::from(&rays[0])),
            (true, Calls::Single) => self.queued(kind, rays, |rays| RayOnly::from(&rays[0])),
            (false, Calls::Eight) => self.queued(kind, rays, RayHits::<8>::new),
            (true, Calls::Eight) => self.queued(kind, rays, Rays::<8>::new),
            (false, Calls::Sixteen) => self.queued(kind, rays, RayHits::<16>::new),
            (true, Calls::Sixteen) => self.queued(kind, rays, Rays::<16>::new),
        }
    }

    fn crossings(&self, origin: DVec3, direction: DVec3, found: &mut Vec<u32>) {
        let Scene { device, handle, .. } = &self.scene;
        let mut ray = Ray::unchecked(origin, direction, 0.0, f64::INFINITY);
        for _ in 0..MAX_CROSSINGS {
            let mut query = RayHit::from(&ray);
            // SAFETY: `handle` is a committed scene, and `query` has the layout and alignment of `RTCRayHit`; null
            // arguments are the defaults.
            unsafe { (device.functions.intersect)(*handle, &raw mut query, ptr::null_mut()) };
            if query.geometry == NOTHING {
                return;
            }
            found.push(query.primitive);
            ray = Ray::unchecked(origin, direction, query.ray.t_far.next_up().into(), f64::INFINITY);
        }
    }

    fn finds_all_crossings(&self) -> bool {
        true
    }
}

/// A ray record of Embree's queries.
trait Record: Send {
    /// Number of rays.
    const WIDTH: usize;

    /// Traces the first `count` rays.
    fn trace(&mut self, scene: &Scene, count: usize, arguments: &mut Arguments);

    /// Hit primitive of a ray.
    fn hit(&self, lane: usize) -> Option<u32>;

    /// Distance of a closest hit; `None` in a query for any hit.
    fn distance(&self, _: usize) -> Option<f32> {
        None
    }
}

struct QueuedRays<'a, R> {
    scene: &'a Scene,
    is_coherent: bool,
    count: usize,
    records: Vec<R>,
}

impl<R: Record> RayQueue for QueuedRays<'_, R> {
    fn run(&mut self) {
        let mut arguments = Arguments::new(self.is_coherent);
        let mut left = self.count;
        for record in &mut self.records {
            record.trace(self.scene, left.min(R::WIDTH), &mut arguments);
            left -= left.min(R::WIDTH);
        }
    }

    fn hits(&self) -> Vec<Option<u32>> {
        let answer = |index: usize| self.records[index / R::WIDTH].hit(index % R::WIDTH);
        (0..self.count).map(answer).collect()
    }

    fn distances(&self) -> Option<Vec<f64>> {
        let distance = |index: usize| self.records[index / R::WIDTH].distance(index % R::WIDTH);
        (0..self.count).map(|index| distance(index).map(f64::from)).collect()
    }
}

// In all calls below the scene is committed, and records and arguments have the layout and alignment of Embree's types.

impl Record for RayHit {
    const WIDTH: usize = 1;

    #[inline]
    fn trace(&mut self, scene: &Scene, _: usize, arguments: &mut Arguments) {
        // SAFETY: see above.
        unsafe { (scene.device.functions.intersect)(scene.handle, self, arguments) }
    }

    fn hit(&self, _: usize) -> Option<u32> {
        (self.geometry != NOTHING).then_some(self.primitive)
    }

    fn distance(&self, _: usize) -> Option<f32> {
        Some(self.ray.t_far)
    }
}

impl Record for RayOnly {
    const WIDTH: usize = 1;

    #[inline]
    fn trace(&mut self, scene: &Scene, _: usize, arguments: &mut Arguments) {
        // SAFETY: see above.
        unsafe { (scene.device.functions.occluded)(scene.handle, self, arguments) }
    }

    fn hit(&self, _: usize) -> Option<u32> {
        is_occluded(self.t_far)
    }
}

/// Embree sets `tfar` to minus infinity for an occluded ray.
fn is_occluded(t_far: f32) -> Option<u32> {
    (t_far == f32::NEG_INFINITY).then_some(0)
}

macro_rules! packets {
    ($width:literal, $intersect:ident, $occluded:ident) => {
        impl Record for RayHits<$width> {
            const WIDTH: usize = $width;

            #[inline]
            fn trace(&mut self, scene: &Scene, count: usize, arguments: &mut Arguments) {
                let valid = Valid::<$width>::first(count);
                // SAFETY: see above.
                unsafe {
                    (scene.device.functions.$intersect)(valid.0.as_ptr(), scene.handle, self, arguments)
                }
            }

            fn hit(&self, lane: usize) -> Option<u32> {
                (self.geometry[lane] != NOTHING).then_some(self.primitive[lane])
            }

            fn distance(&self, lane: usize) -> Option<f32> {
                Some(self.rays.t_far[lane])
            }
        }

        impl Record for Rays<$width> {
            const WIDTH: usize = $width;

            #[inline]
            fn trace(&mut self, scene: &Scene, count: usize, arguments: &mut Arguments) {
                let valid = Valid::<$width>::first(count);
                // SAFETY: see above.
                unsafe { (scene.device.functions.$occluded)(valid.0.as_ptr(), scene.handle, self, arguments) }
            }

            fn hit(&self, lane: usize) -> Option<u32> {
                is_occluded(self.t_far[lane])
            }
        }
    };
}

packets!(8, intersect8, occluded8);
packets!(16, intersect16, occluded16);
