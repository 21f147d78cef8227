//! Embree in the speed test: single rays and packets, build qualities, robust mode.

use super::super::speed::{BuiltContender, Contender, Facts, Kind, Label, RayQueue};
use super::super::{Mesh, Unavailable};
use super::records::{Arguments, NOTHING, RayHit, RayHits, RayOnly, Rays, Valid};
use super::{Device, NATIVE_RAY8, NATIVE_RAY16, Quality, Scene};
use crate::error::Result;
use crate::geometry::Ray;

/// Query functions.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Calls {
    Single,
    Eight,
    Sixteen,
}

/// A contender of Embree.
struct Embree {
    device: &'static Device,
    quality: Quality,
    robust: bool,
    calls: Calls,
    /// Whether coherent rays are flagged as coherent.
    coherent: bool,
}

/// All contenders, if the library is available. `threads` is the number of build threads.
pub(crate) fn contenders(threads: usize) -> std::result::Result<Vec<Box<dyn Contender>>, Unavailable> {
    let device = Device::find(&format!("threads={threads}"))?;
    let single = |quality, robust| Embree { device, quality, robust, calls: Calls::Single, coherent: false };
    // Robust mode builds the same tree in both qualities.
    let all = [(Quality::Medium, false), (Quality::High, false), (Quality::Medium, true)];
    let mut ways: Vec<Embree> = all.map(|(quality, robust)| single(quality, robust)).into();
    let packets: &[Calls] = match device.property(NATIVE_RAY16) {
        0 => &[Calls::Eight],
        _ => &[Calls::Eight, Calls::Sixteen],
    };
    for &calls in packets {
        for coherent in [false, true] {
            ways.extend(all.map(|(quality, robust)| Embree { device, quality, robust, calls, coherent }));
        }
    }
    Ok(ways.into_iter().map(|way| Box::new(way) as Box<dyn Contender>).collect())
}

impl Contender for Embree {
    fn label(&self) -> Label {
        let layout = match (self.calls, self.coherent) {
            (Calls::Single, _) => "single",
            (Calls::Eight, false) => "packets-8",
            (Calls::Eight, true) => "packets-8-coherent",
            (Calls::Sixteen, false) => "packets-16",
            (Calls::Sixteen, true) => "packets-16-coherent",
        };
        let isa = match () {
            () if self.device.property(NATIVE_RAY16) != 0 => "avx512",
            () if self.device.property(NATIVE_RAY8) != 0 => "avx2",
            () => "sse",
        };
        Label {
            engine: "embree",
            layout,
            tier: self.robust.then_some("robust"),
            preset: Some(match self.quality {
                Quality::Medium => "medium",
                Quality::High => "high",
            }),
            isa,
        }
    }

    fn build(&self, mesh: &Mesh) -> Result<Box<dyn BuiltContender>> {
        let scene = Scene::new(self.device, self.quality, self.robust, mesh)?;
        Ok(Box::new(BuiltEmbree { scene, calls: self.calls, coherent: self.coherent }))
    }
}

struct BuiltEmbree {
    scene: Scene,
    calls: Calls,
    coherent: bool,
}

impl BuiltContender for BuiltEmbree {
    fn facts(&self) -> Facts {
        Facts { bytes: u64::try_from(self.scene.bytes).ok(), ..Facts::default() }
    }

    fn queue<'a>(&'a self, kind: Kind, rays: &'a [Ray]) -> Box<dyn RayQueue + 'a> {
        let (scene, count) = (&self.scene, rays.len());
        let coherent = self.coherent && kind.is_coherent();
        match (kind.is_any_hit(), self.calls) {
            (false, Calls::Single) => Box::new(QueuedRays {
                scene,
                coherent,
                count,
                records: rays.iter().map(RayHit::from).collect(),
            }),
            (true, Calls::Single) => Box::new(QueuedRays {
                scene,
                coherent,
                count,
                records: rays.iter().map(RayOnly::from).collect(),
            }),
            (false, Calls::Eight) => Box::new(QueuedRays {
                scene,
                coherent,
                count,
                records: rays.chunks(8).map(RayHits::<8>::new).collect(),
            }),
            (true, Calls::Eight) => Box::new(QueuedRays {
                scene,
                coherent,
                count,
                records: rays.chunks(8).map(Rays::<8>::new).collect(),
            }),
            (false, Calls::Sixteen) => Box::new(QueuedRays {
                scene,
                coherent,
                count,
                records: rays.chunks(16).map(RayHits::<16>::new).collect(),
            }),
            (true, Calls::Sixteen) => Box::new(QueuedRays {
                scene,
                coherent,
                count,
                records: rays.chunks(16).map(Rays::<16>::new).collect(),
            }),
        }
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
}

struct QueuedRays<'a, R> {
    scene: &'a Scene,
    coherent: bool,
    count: usize,
    records: Vec<R>,
}

impl<R: Record> RayQueue for QueuedRays<'_, R> {
    fn run(&mut self) {
        let mut arguments = Arguments::new(self.coherent);
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
