//! Prepared thin lenses: camera rays from points of an aperture through the plane of focus (pbrt, 4th edition, section
//! 5.2.3).
//!
//! The differential of a ray through a fixed point of the lens is that of [`View::differential`] for its direction: the point
//! in focus moves with the pixel, and the ray origin does not. Footprints of textures are not widened by the blur, which is
//! the mean over the points of the lens.

use glam::{DVec2, DVec3};

use super::simd;
use super::soa::{PerRay, Vec3Soa};
use super::turns::sin_cos_of_turns;
use super::view::FARTHEST;
use super::{View, World};
use crate::bvh::detail::{Precision, RayBuffer};
use crate::bvh::{Ray, Traversal};
use crate::error::{Error, Result};
use crate::scene::{Camera, Focus, Lens};

/// The lens of a [`View`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ThinLens {
    /// Radius of the aperture; of a polygon, the distance of its corners from the centre.
    pub radius: f64,
    /// Distance of the plane of focus from the camera.
    pub focus: f64,
    /// Corners of the aperture; 0 for a circle.
    blades: f64,
    /// Rotation of the corners in turns.
    rotation: f64,
    /// Distance of an edge from the centre, and half its length, in radii.
    edge: DVec2,
}

impl ThinLens {
    fn new(radius: f64, focus: f64, lens: &Lens) -> Self {
        let (blades, rotation) = (f64::from(lens.blades), lens.blade_rotation.rem_euclid(360.0) / 360.0);
        let (half, distance) = if lens.blades == 0 { (0.0, 1.0) } else { sin_cos_of_turns(0.5 / blades) };
        ThinLens { radius, focus, blades, rotation, edge: DVec2::new(distance, half) }
    }

    /// A point of the aperture, to the right and up, in units of its radius. Uniform in area for uniform `numbers`: the second
    /// is the place on the edge, and the square root of the first the distance from the centre.
    #[inline(always)]
    fn point(&self, [distance, place]: [f64; 2], is_circle: bool) -> DVec2 {
        let unit = |turns: f64| {
            let (sin, cos) = sin_cos_of_turns(turns + self.rotation);
            DVec2::new(cos, sin)
        };
        let place_on_edge = if is_circle {
            unit(place)
        } else {
            let along = place * self.blades;
            let corner = along.floor();
            let outwards = unit((corner + 0.5) / self.blades);
            self.edge.x * outwards + (2.0 * (along - corner) - 1.0) * self.edge.y * outwards.perp()
        };
        distance.sqrt() * place_on_edge
    }
}

impl View {
    /// The lens; `None` for a pinhole.
    pub fn lens(&self) -> Option<ThinLens> {
        self.lens
    }

    /// Gives the view of `camera`, in a perspective projection, a lens, focused in `world`. With `blur`, the radius is half of
    /// that part of the height of the plane of focus: points infinitely far away are blurred to that part of the picture's
    /// height.
    ///
    /// # Errors
    /// [`Error::Usage`] where the lens focuses behind the camera, or is too large.
    pub fn set_lens(&mut self, camera: &Camera, lens: Lens, blur: Option<f64>, world: &World) -> Result<()> {
        let along = |point: DVec3| (self.position - point).dot(self.w);
        let focus = match lens.focus {
            Focus::Distance(distance) => distance,
            Focus::Point(point) => along(point),
            Focus::Auto => {
                let ray = world.numerics().ray_precision().ray(self.position, -self.w, 0.0, f64::INFINITY);
                let hit = world.accelerator.closest_hit(&ray, &mut Traversal::default());
                hit.map_or_else(|| along(camera.target), |hit| hit.t)
            }
        };
        let radius = blur.map_or(lens.radius, |blur| blur * focus * self.rectangle.y / self.distance / 2.0);
        let unusable =
            |what: &str, hint: &str| Err(Error::usage(format!("camera `{}` {what}", camera.name), hint));
        if !(focus > 0.0 && focus.is_finite()) {
            return unusable(
                "focuses behind itself",
                "move `focus_at` in front of it, or give `focus_distance`",
            );
        }
        if !(radius / focus <= FARTHEST && self.position.abs().max_element() + radius <= FARTHEST) {
            return unusable("has an aperture beyond kiln's numbers", "give it a smaller one");
        }
        self.lens = Some(ThinLens::new(radius, focus, &lens));
        Ok(())
    }

    /// Replaces camera rays by those through points of the lens, by two numbers from 0 to below 1 for each, and through their
    /// points in the plane of focus. `backwards` are the opposite directions of the rays.
    pub fn put_on_lens(
        &self,
        rays: &mut RayBuffer,
        backwards: &Vec3Soa,
        numbers: &PerRay<[f64; 2]>,
        precision: Precision,
    ) {
        // Shape and precision are passed as constants, so that the loops have no branch on them.
        use Precision::{Double, Single};
        let Some(lens) = self.lens else { return };
        match (lens.blades == 0.0, precision) {
            (true, Single) => simd!(self.fill_lens((lens, true), rays, backwards, numbers, Single)),
            (true, Double) => simd!(self.fill_lens((lens, true), rays, backwards, numbers, Double)),
            (false, Single) => simd!(self.fill_lens((lens, false), rays, backwards, numbers, Single)),
            (false, Double) => simd!(self.fill_lens((lens, false), rays, backwards, numbers, Double)),
        }
    }

    #[inline(always)]
    fn fill_lens(
        &self,
        (lens, is_circle): (ThinLens, bool),
        rays: &mut RayBuffer,
        backwards: &Vec3Soa,
        numbers: &PerRay<[f64; 2]>,
        precision: Precision,
    ) {
        rays.write(
            0..rays.len(),
            #[inline(always)]
            |i| self.lens_ray(lens, backwards.get(i), lens.point(numbers[i], is_circle), precision),
        );
    }

    /// The ray through a point of the lens that meets the camera ray of direction `-backwards` in the plane of focus.
    #[inline(always)]
    fn lens_ray(&self, lens: ThinLens, backwards: DVec3, point: DVec2, precision: Precision) -> Ray {
        let offset = point.x * self.u + point.y * self.v;
        // In units of the distance of the plane of focus.
        let direction = -backwards / backwards.dot(self.w) - lens.radius / lens.focus * offset;
        precision.ray(self.position + lens.radius * offset, direction.normalize(), 0.0, f64::INFINITY)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn second_moment(blades: u32) -> (f64, DVec2) {
        let lens = ThinLens::new(1.0, 1.0, &Lens { blades, blade_rotation: 40.0, ..Lens::default() });
        // The centres of a grid of equal squares, a whole number of them on each side of the aperture.
        let centre = |i: u32| (f64::from(i) + 0.5) / 720.0;
        let points = (0..720 * 720).map(|i| lens.point([centre(i % 720), centre(i / 720)], blades == 0));
        let (mut moment, mut mean) = (0.0, DVec2::ZERO);
        for point in points {
            moment += point.length_squared() / (720.0 * 720.0);
            mean += point / (720.0 * 720.0);
        }
        (moment, mean)
    }

    /// A disc of radius 1 has a mean square distance of 1 / 2. A regular polygon consists of triangles with the centre, whose
    /// points are `s (a + t (b - a))` with `E s^2 = 1 / 2`, and `E |a + t (b - a)|^2 = (2 + cos angle) / 3` between the corners.
    #[test]
    fn apertures_have_their_second_moments() {
        for blades in [0, 3, 5, 6, 9] {
            let cos = if blades == 0 { 1.0 } else { (std::f64::consts::TAU / f64::from(blades)).cos() };
            let (moment, mean) = second_moment(blades);
            assert!((moment / ((2.0 + cos) / 6.0) - 1.0).abs() < 1e-4, "{blades} blades: {moment}");
            assert!(mean.length() < 1e-12, "{blades} blades: {mean}");
        }
    }
}
