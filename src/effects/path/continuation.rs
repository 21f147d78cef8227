//! How a path goes on: a direction sampled by the BSDF, and Russian roulette.

use glam::DVec3;

use super::Path;
use super::media::Media;
use super::vertex::Vertex;
use crate::geometry::Ray;
use crate::shading::bsdf::{Bsdf, BsdfSample};

/// The highest probability with which roulette lets a path continue.
const MAX_SURVIVAL: f64 = 0.95;

impl Vertex<'_> {
    /// The ray, the state and the media with which the path continues; `None` where it ends.
    #[inline]
    pub(super) fn continued(&self, bsdf: &Bsdf, roulette_from: u32) -> Option<(Ray, Path, Media)> {
        let numbers = &self.numbers;
        let has_roulette = numbers.sequence.depth >= roulette_from;
        let direction = numbers.direction();
        let [lobe, roulette] = match has_roulette || bsdf.has_choice() {
            true => numbers.lobe_and_roulette(),
            false => [0.0; 2],
        };
        let (sample, direction) = self.sample_direction(bsdf, lobe, direction)?;
        let throughput = self.path.throughput * sample.weight;
        let throughput = if has_roulette { survivor(throughput, roulette)? } else { throughput };
        if throughput == DVec3::ZERO {
            return None;
        }
        let pdf = if sample.is_delta { f64::INFINITY } else { sample.pdf };
        let precision = self.world.numerics().ray_precision();
        let ray = precision.ray(self.origin(direction), direction, 0.0, f64::INFINITY);
        let path = Path { throughput, pdf, from: self.surface.point.position };
        Some((ray, path, self.media_towards(direction)))
    }

    /// A sample of the BSDF, and its world direction. `None` where shading and geometric normal disagree on the side.
    fn sample_direction(&self, bsdf: &Bsdf, lobe: f64, [x, y]: [f64; 2]) -> Option<(BsdfSample, DVec3)> {
        let sample = bsdf.sample([lobe, x, y])?;
        let [tangent, bitangent, normal] = self.frame;
        let local = sample.direction;
        let direction = (tangent * local.x + bitangent * local.y + normal * local.z).normalize();
        let agree = (local.z > 0.0) == (direction.dot(self.surface.geometric_normal) > 0.0);
        agree.then_some((sample, direction))
    }
}

/// Russian roulette: the throughput of a path that survives, with the probability of its largest channel.
fn survivor(throughput: DVec3, number: f64) -> Option<DVec3> {
    let survival = throughput.max_element().min(MAX_SURVIVAL);
    (number < survival).then(|| throughput / survival)
}
