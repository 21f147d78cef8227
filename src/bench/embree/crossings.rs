//! Embree in the leak test: all crossings of a ray, one after the other.

use std::ptr;

use glam::DVec3;

use super::super::{Built, Engine, Mesh, Unavailable};
use super::records::{NOTHING, RayHit};
use super::{Device, Quality, Scene};
use crate::error::Result;

/// Maximum number of crossings of a ray.
const MAX_CROSSINGS: usize = 64;

/// Both modes, if the library is available.
pub(crate) fn engines() -> std::result::Result<Vec<Box<dyn Engine>>, Unavailable> {
    let device = Device::find("")?;
    Ok(vec![Box::new(Embree { device, robust: false }), Box::new(Embree { device, robust: true })])
}

/// Embree with its default layout, in one of its modes.
struct Embree {
    device: &'static Device,
    robust: bool,
}

impl Engine for Embree {
    fn name(&self) -> &'static str {
        "embree"
    }

    fn layout(&self) -> &'static str {
        if self.robust { "robust" } else { "default" }
    }

    fn build(&self, mesh: &Mesh) -> Result<Box<dyn Built>> {
        Ok(Box::new(Scene::new(self.device, Quality::Medium, self.robust, mesh)?))
    }
}

impl Built for Scene {
    fn crossings(&self, origin: DVec3, direction: DVec3, found: &mut Vec<u32>) {
        let mut t_near = 0.0f32;
        for _ in 0..MAX_CROSSINGS {
            let mut query = RayHit::new(origin.as_vec3(), direction.as_vec3(), t_near, f32::INFINITY);
            // SAFETY: `handle` is a committed scene, and `query` has the layout and alignment of `RTCRayHit`; null
            // arguments are the defaults.
            unsafe { (self.device.functions.intersect)(self.handle, &raw mut query, ptr::null_mut()) };
            if query.geometry == NOTHING {
                return;
            }
            found.push(query.primitive);
            t_near = query.ray.t_far.next_up();
        }
    }
}
