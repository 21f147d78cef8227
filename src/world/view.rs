//! Prepared cameras: from pixels to rays, and from points to pixels.
//!
//! The assignment's report: `w = normalise(position - target)`, `u = normalise(up x w)`, `v = w x u`, right-handed. Pixel (i, j), j
//! counted from the bottom row, lies at `x = (i + 0.5) / I_w * V_w - V_w / 2` of the viewing rectangle, and `y` likewise.

use std::f64::consts::{PI, TAU};

use glam::{DMat3, DMat4, DVec2, DVec3, DVec4};

use super::Recentering;
use super::differential::Differential;
use super::lens::ThinLens;
use super::simd;
use super::soa::RAYS_PER_BATCH;
use crate::bvh::Ray;
use crate::bvh::detail::{Precision, RayBuffer};
use crate::error::{Error, Result};
use crate::film::{TILE, Window};
use crate::scene::{Camera, Projection};

/// The sine of the angle between up and the view direction below which another up is used. The basis loses as many decimal digits
/// as the sine has leading zeros, so at least ten of sixteen remain.
const SMALLEST_SINE: f64 = 1e-6;

/// The largest coordinate of a ray origin: f32 represents it, with a margin for sums.
pub(super) const FARTHEST: f64 = f32::MAX as f64 / 4.0;

/// A camera prepared for a picture of a given size.
#[derive(Debug, Clone, PartialEq)]
pub struct View {
    pub(super) position: DVec3,
    pub(super) u: DVec3,
    pub(super) v: DVec3,
    pub(super) w: DVec3,
    projection: Projection,
    pub(super) distance: f64,
    pub(super) rectangle: DVec2,
    /// The middle of the rectangle, right of and above the line of sight, in world units.
    shift: DVec2,
    size: DVec2,
    pub(super) lens: Option<ThinLens>,
}

/// Ratios of the sides of a pixel that OpenEXR files can state (ImfHeader.cpp, `sanityCheck`).
const ASPECTS: std::ops::RangeInclusive<f32> = 1e-6..=1e6;

impl View {
    /// Prepares `camera` for a picture of `width` by `height` pixels. Where the aspect ratio of the picture differs from that of the
    /// viewing rectangle and pixels are square, the rectangle is enlarged along one axis. A camera without a width of its own keeps
    /// its height.
    ///
    /// # Errors
    /// [`Error::Usage`] where the camera has no direction, is not finite, lies beyond the range of ray origins, or has
    /// pixels of a ratio that pictures cannot state.
    pub fn new(camera: &Camera, projection: Projection, [width, height]: [u32; 2]) -> Result<Self> {
        let unusable =
            |what: &str, hint: &str| Error::usage(format!("camera `{}` {what}", camera.name), hint);
        let [u, v, w] = basis(camera.position, camera.target, camera.up).ok_or_else(|| {
            let hint = "give it a finite position and another finite point to look at";
            unusable("has no direction to look in", hint)
        })?;
        let size = DVec2::new(f64::from(width), f64::from(height));
        let asked =
            DVec2::new(camera.view_width.unwrap_or(camera.view_height * size.x / size.y), camera.view_height);
        let pixel = (asked / size).max_element();
        // Where the aspect ratios agree, exactly the rectangle asked for.
        let keep = |asked: f64, pixels: f64| {
            let is_kept = camera.sensor.oblong_pixels || asked / pixels == pixel;
            if is_kept { asked } else { pixel * pixels }
        };
        let rectangle = DVec2::new(keep(asked.x, size.x), keep(asked.y, size.y));
        // In shares of the rectangle asked for, not of an enlarged one.
        let shift = camera.sensor.shift * asked;
        let (rectangle, shift, distance) = match projection {
            Projection::Perspective => {
                let scale = scale_to_one(rectangle.max_element().max(camera.viewpoint_distance));
                (rectangle * scale, shift * scale, camera.viewpoint_distance * scale)
            }
            Projection::Orthographic => (rectangle, shift, camera.viewpoint_distance),
            // Angles: positions in the rectangle are longitude and latitude.
            Projection::Panoramic => (DVec2::new(TAU, PI), DVec2::ZERO, 1.0),
        };
        let position = camera.position;
        let view = View { position, u, v, w, projection, distance, rectangle, shift, size, lens: None };
        let usable = (view.rectangle + view.shift).is_finite() && view.rectangle.min_element() > 0.0;
        if !(usable && view.distance > 0.0 && view.distance.is_finite()) {
            let hint = "give its rectangle and its distance finite sizes above 0";
            return Err(unusable("has an unusable viewing rectangle", hint));
        }
        if !ASPECTS.contains(&(view.pixel_aspect() as f32)) {
            let what = "has pixels more than a million times as wide as high, or as high as wide";
            return Err(unusable(what, "give `viewing_rectangle` or `image_size` the shape of the picture"));
        }
        let reach = if projection.is_central() { 0.0 } else { (rectangle + shift.abs()).max_element() };
        if camera.position.abs().max_element() + reach > FARTHEST {
            let what = "stands farther out than kiln's numbers reach";
            return Err(unusable(what, "move it towards the scene"));
        }
        Ok(view)
    }

    /// The width and the height of the picture, in pixels.
    pub fn size(&self) -> [u32; 2] {
        [self.size.x as u32, self.size.y as u32]
    }

    /// The width of a pixel divided by its height.
    pub fn pixel_aspect(&self) -> f64 {
        let DVec2 { x, y } = self.rectangle / self.size;
        x / y
    }

    /// `camera_from_scene` and `ndc_from_scene` for column vectors, as OpenEXR defines `worldToCamera` and `worldToNDC`
    /// (Standard Attributes, "Position and Orientation"): in the left-handed space of the camera, x points to the right,
    /// y up and z in the viewing direction; in NDC, (0, 0) is the upper left corner of the picture and (1, 1) the lower
    /// right one. z of NDC, which readers discard, is 1 / z of the camera in perspective. `None` for a panorama, which
    /// is no linear map.
    pub fn matrices(&self, recentering: Option<&Recentering>) -> Option<[DMat4; 2]> {
        let (position, scale) = match recentering {
            Some(recentering) => (recentering.point_back(self.position), recentering.scale),
            None => (self.position, 1.0),
        };
        let axes = DMat3::from_cols(self.u, self.v, -self.w).transpose();
        let camera_from_scene = DMat4::from_mat3(axes) * DMat4::from_translation(-position);
        // (offset - shift) / rectangle + 1/2 to the right; downwards, 1 minus that.
        let start = (0.5 - self.shift / self.rectangle) * DVec2::new(1.0, -1.0) + DVec2::Y;
        let per_unit = |scale: f64| DVec2::new(scale, -scale) / self.rectangle;
        let ndc_from_camera = match self.projection {
            Projection::Perspective => {
                let DVec2 { x, y } = per_unit(self.distance);
                DMat4::from_cols(DVec4::X * x, DVec4::Y * y, start.extend(0.0).extend(1.0), DVec4::Z)
            }
            Projection::Orthographic => {
                let DVec2 { x, y } = per_unit(scale);
                DMat4::from_cols(DVec4::X * x, DVec4::Y * y, DVec4::Z, start.extend(0.0).extend(1.0))
            }
            Projection::Panoramic => return None,
        };
        Some([camera_from_scene, ndc_from_camera * camera_from_scene])
    }

    /// The ray through the centre of the pixel in column `x`, row `y` from the top, rounded to `precision`.
    #[inline]
    pub fn ray(&self, x: u32, y: u32, precision: Precision) -> Ray {
        self.ray_at(self.across(centre(x)), self.up(centre(y)), precision)
    }

    /// The horizontal position in the plane of the viewing rectangle, from the line of sight, of a film position `i`
    /// pixels right of the picture's left edge.
    #[inline(always)]
    fn across(&self, i: f64) -> f64 {
        i / self.size.x * self.rectangle.x - self.rectangle.x / 2.0 + self.shift.x
    }

    /// The vertical position in the plane of the viewing rectangle, upwards from the line of sight, of a film position
    /// `row` pixels below the picture's top edge.
    #[inline(always)]
    fn up(&self, row: f64) -> f64 {
        let j = self.size.y - row;
        j / self.size.y * self.rectangle.y - self.rectangle.y / 2.0 + self.shift.y
    }

    /// Computes the rays through the pixel centres of `window`, row by row from the top.
    pub fn rays(&self, window: Window, precision: Precision, rays: &mut RayBuffer) {
        let Window { x, y, width, height } = window;
        if width.max(height) > TILE {
            rays.clear();
            let rows = y..y + height;
            rays.extend(rows.flat_map(|y| (x..x + width).map(move |x| self.ray(x, y, precision))));
            return;
        }
        let (mut across, mut up) = ([0.0; RAYS_PER_BATCH], [0.0; RAYS_PER_BATCH]);
        let columns: [f64; TILE as usize] = std::array::from_fn(|i| self.across(centre(x + i as u32)));
        for row in 0..height as usize {
            let part = row * width as usize..(row + 1) * width as usize;
            across[part.clone()].copy_from_slice(&columns[..width as usize]);
            up[part].fill(self.up(centre(y + row as u32)));
        }
        self.fill_all(rays, window.area(), &across, &up, precision);
    }

    /// Computes the rays through film positions, at most [`RAYS_PER_BATCH`], `x` pixels right of and `y` pixels below the picture's
    /// top left corner. Positions may lie outside the picture.
    pub fn rays_through(&self, x: &[f64], y: &[f64], precision: Precision, rays: &mut RayBuffer) {
        let (mut across, mut up) = ([0.0; RAYS_PER_BATCH], [0.0; RAYS_PER_BATCH]);
        across.iter_mut().zip(x).for_each(|(across, &x)| *across = self.across(x));
        up.iter_mut().zip(y).for_each(|(up, &y)| *up = self.up(y));
        self.fill_all(rays, x.len().min(y.len()), &across, &up, precision);
    }

    /// Computes the first `len` rays, through positions in the viewing rectangle.
    fn fill_all(
        &self,
        rays: &mut RayBuffer,
        len: usize,
        across: &[f64; RAYS_PER_BATCH],
        up: &[f64; RAYS_PER_BATCH],
        precision: Precision,
    ) {
        // Projection and precision are passed as constants, so that the loops have no branch on them.
        use Precision::{Double, Single};
        use Projection::Perspective;
        let with = |projection| View { projection, ..self.clone() };
        match (self.projection, precision) {
            (Perspective, Single) => simd!(fill(&with(Perspective), rays, len, across, up, Single)),
            (Perspective, Double) => simd!(fill(&with(Perspective), rays, len, across, up, Double)),
            (_, precision) => fill(self, rays, len, across, up, precision),
        }
    }

    /// The ray through a position in the viewing rectangle.
    #[inline(always)]
    fn ray_at(&self, across: f64, up: f64, precision: Precision) -> Ray {
        let offset = || across * self.u + up * self.v;
        let (origin, direction) = match self.projection {
            Projection::Perspective => (self.position, (offset() - self.distance * self.w).normalize()),
            Projection::Orthographic => (self.position + offset(), -self.w),
            Projection::Panoramic => (self.position, self.direction_at(across, up)),
        };
        precision.ray(origin, direction, 0.0, f64::INFINITY)
    }

    /// The direction at a longitude, 0 in the middle of a panorama and positive to the right, and a latitude.
    #[inline(always)]
    fn direction_at(&self, longitude: f64, latitude: f64) -> DVec3 {
        // The same bits on every platform.
        let ((sin, cos), (rise, reach)) = (libm::sincos(longitude), libm::sincos(latitude));
        reach * (sin * self.u - cos * self.w) + rise * self.v
    }

    /// The differential of a camera ray, from its `direction` (Igehy, Tracing Ray Differentials, SIGGRAPH 1999, section 3.1).
    pub fn differential(&self, direction: DVec3) -> Differential {
        let [right, down] =
            [self.u * (self.rectangle.x / self.size.x), -self.v * (self.rectangle.y / self.size.y)];
        match self.projection {
            Projection::Orthographic => Differential { origin: [right, down], direction: [DVec3::ZERO; 2] },
            Projection::Perspective => {
                // The direction is d / |d| with d = offset - distance w, so |d| = distance / (-direction . w).
                let length = self.distance / -direction.dot(self.w);
                let change = |step: DVec3| (step - step.dot(direction) * direction) / length;
                Differential { origin: [DVec3::ZERO; 2], direction: [change(right), change(down)] }
            }
            Projection::Panoramic => {
                // Along the circle of latitude, whose radius is the cosine of the latitude, and along that of longitude.
                let angle = self.rectangle / self.size;
                let right = direction.cross(self.v) * angle.x;
                let up = (self.v - self.v.dot(direction) * direction).normalize_or(self.w);
                Differential { origin: [DVec3::ZERO; 2], direction: [right, -up * angle.y] }
            }
        }
    }

    /// The depth of the point at distance `t` on a camera ray: its distance from the plane through the camera that is
    /// perpendicular to the line of sight. In a panorama, which has no such plane, the distance itself.
    pub fn depth(&self, ray: &Ray, t: f64) -> f64 {
        match self.projection {
            Projection::Perspective => t * -ray.direction().dot(self.w),
            Projection::Orthographic | Projection::Panoramic => t,
        }
    }

    /// The film position of a point, in pixels from the top left corner, and whether the point lies in front of the camera.
    pub fn project(&self, point: DVec3) -> (DVec2, bool) {
        let p = point - self.position;
        let (across, up, depth) = (p.dot(self.u), p.dot(self.v), -p.dot(self.w));
        let offset = DVec2::new(across, up);
        let (offset, is_in_front) = match self.projection {
            Projection::Perspective => (offset * (self.distance / depth), depth > 0.0),
            Projection::Orthographic => (offset, depth > 0.0),
            Projection::Panoramic => {
                (DVec2::new(across.atan2(depth), up.atan2(across.hypot(depth))), p != DVec3::ZERO)
            }
        };
        let shares = (offset - self.shift) / self.rectangle + 0.5;
        (DVec2::new(shares.x, 1.0 - shares.y) * self.size, is_in_front)
    }

    /// The film positions of the ends of a line segment, as in [`View::project`], clipped to the front of the camera and to the
    /// picture with a border of one picture size on each side. `None` where nothing is left, and in a panorama, where it is no
    /// straight line.
    pub fn project_segment(&self, from: DVec3, to: DVec3) -> Option<[DVec2; 2]> {
        if self.projection == Projection::Panoramic {
            return None;
        }
        // Homogeneous positions in units of the rectangle, from its centre: linear along the segment, like depths.
        let [a, b] = [from, to].map(|point| {
            let p = point - self.position;
            let depth = -p.dot(self.w);
            let divisor = if self.projection.is_central() { depth / self.distance } else { 1.0 };
            let offset = DVec2::new(p.dot(self.u), p.dot(self.v)) - self.shift * divisor;
            (offset / self.rectangle, divisor, depth)
        });
        // Camera rays begin at the eye, where the projection is undefined, or beside it by rounding.
        let near = if self.projection.is_central() { a.2.max(b.2) / 4096.0 } else { 0.0 };
        let inside = |(place, divisor, depth): (DVec2, f64, f64)| {
            let side = 1.5 * divisor;
            [depth - near, side - place.x, side + place.x, side - place.y, side + place.y]
        };
        let (mut start, mut end) = (0.0f64, 1.0f64);
        for (at_a, at_b) in inside(a).into_iter().zip(inside(b)) {
            match (at_a < 0.0, at_b < 0.0) {
                (true, true) => return None,
                (true, false) => start = start.max(at_a / (at_a - at_b)),
                (false, true) => end = end.min(at_a / (at_a - at_b)),
                (false, false) => {}
            }
        }
        let pixel = |t: f64| {
            let (place, divisor) = (a.0.lerp(b.0, t), a.1 + (b.1 - a.1) * t);
            let shares = place / divisor + 0.5;
            DVec2::new(shares.x, 1.0 - shares.y) * self.size
        };
        let ends = [pixel(start), pixel(end)];
        (start <= end && ends.iter().all(|end| end.is_finite())).then_some(ends)
    }
}

/// The film coordinate of the centre of a pixel's row or column.
#[inline(always)]
fn centre(pixel: u32) -> f64 {
    f64::from(pixel) + 0.5
}

#[inline(always)]
fn fill(
    view: &View,
    rays: &mut RayBuffer,
    len: usize,
    across: &[f64; RAYS_PER_BATCH],
    up: &[f64; RAYS_PER_BATCH],
    precision: Precision,
) {
    rays.write(
        0..len,
        #[inline(always)]
        |i| view.ray_at(across[i], up[i], precision),
    );
}

/// The camera's axes: u to the right, v up, w backwards. `None` where position and target give no direction.
///
/// For a view straight up or down, where `up` gives no direction, the axes are those of a camera tilted there from looking along -z,
/// so that the picture does not turn as the camera tilts.
pub fn basis(position: DVec3, target: DVec3, up: DVec3) -> Option<[DVec3; 3]> {
    let w = unit(position - target)?;
    let up = unit(up).unwrap_or(DVec3::Y);
    let side = up.cross(w);
    let u = if side.length() >= SMALLEST_SINE {
        unit(side)?
    } else {
        let turned = if up.y.abs() > 0.5 { -up.y * w.y.signum() * DVec3::Z } else { DVec3::Y };
        unit(turned.cross(w))?
    };
    Some([u, w.cross(u), w])
}

/// The power of two that scales a size to about 1, so that its square neither overflows nor underflows. It does not change the rays of a
/// perspective view.
fn scale_to_one(size: f64) -> f64 {
    // Clamped so that f64 represents the factor and its reciprocal.
    (-size.log2().round().clamp(-1000.0, 1000.0)).exp2()
}

/// The vector normalised without overflow or underflow; `None` for zero or non-finite vectors.
fn unit(v: DVec3) -> Option<DVec3> {
    let largest = v.abs().max_element();
    if largest > 0.0 && largest.is_finite() { (v / largest).try_normalize() } else { None }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Sensor;

    fn assert_right_handed([u, v, w]: [DVec3; 3]) {
        for axis in [u, v, w] {
            assert!((axis.length() - 1.0).abs() <= 4.0 * f64::EPSILON, "{axis}");
        }
        assert!(u.dot(v).abs() < 1e-9 && u.dot(w).abs() < 1e-9 && v.dot(w).abs() < 1e-15);
        assert!((u.cross(v) - w).length() < 1e-9);
    }

    /// The matrices are of the coordinates before recentering, and agree with [`View::project`].
    #[test]
    fn matrices_are_of_the_scene() {
        let recentering = Recentering { middle: DVec3::new(1e3, -2e3, 5e2), scale: 0.25 };
        let own = DVec3::new(1003.0, -1996.0, 507.0);
        let mut camera =
            Camera::from_field_of_view("c".into(), own, own - DVec3::new(1.0, 2.0, 4.0), DVec3::Y, 0.8);
        camera.sensor = Sensor { shift: DVec2::new(0.5, -0.25), oblong_pixels: true };
        camera.view_width = Some(3.0);
        for projection in [Projection::Perspective, Projection::Orthographic] {
            let view = View::new(&recentering.moved(&camera), projection, [60, 40]).unwrap();
            let [camera_from_scene, ndc_from_scene] = view.matrices(Some(&recentering)).unwrap();
            for ahead in [DVec3::new(1.0, 2.0, 4.0), DVec3::new(3.0, 1.0, 9.0), DVec3::new(-1.0, 4.0, 5.0)] {
                let point = own - ahead;
                let moved = (point - recentering.middle) * recentering.scale;
                let ndc = ndc_from_scene * point.extend(1.0);
                let pixel = DVec2::new(ndc.x, ndc.y) / ndc.w * view.size;
                assert!((pixel - view.project(moved).0).length() < 1e-9, "{projection:?} {pixel}");
                // The axis has the length of (1, 2, 4).
                let depth = ahead.dot(DVec3::new(1.0, 2.0, 4.0)) / 21f64.sqrt();
                assert!((camera_from_scene.transform_point3(point).z - depth).abs() < 1e-9);
            }
            // Left-handed.
            assert!(camera_from_scene.determinant() < 0.0);
        }
        let panorama = View::new(&camera, Projection::Panoramic, [4, 2]).unwrap();
        assert_eq!((panorama.matrices(None), panorama.pixel_aspect()), (None, 1.0));
    }

    #[test]
    fn looking_along_plus_z_minus_x_is_on_the_right() {
        let [u, v, w] = basis(DVec3::ZERO, DVec3::Z, DVec3::Y).unwrap();
        assert_eq!((u, v, w), (-DVec3::X, DVec3::Y, -DVec3::Z));
    }

    #[test]
    fn looking_straight_down_continues_the_tilt() {
        let tilted = basis(DVec3::new(0.0, 1.0, 1e-4), DVec3::ZERO, DVec3::Y).unwrap();
        let down = basis(DVec3::Y, DVec3::ZERO, DVec3::Y).unwrap();
        for (a, b) in tilted.iter().zip(&down) {
            assert!((*a - *b).length() < 2e-4, "{a} {b}");
        }
        let tilted = basis(DVec3::new(0.0, -1.0, 1e-4), DVec3::ZERO, DVec3::Y).unwrap();
        let up = basis(-DVec3::Y, DVec3::ZERO, DVec3::Y).unwrap();
        for (a, b) in tilted.iter().zip(&up) {
            assert!((*a - *b).length() < 2e-4, "{a} {b}");
        }
    }

    #[test]
    fn degenerate_bases_are_finite_or_refused() {
        let p = DVec3::new(1e6, 2.0, -3.0);
        for (target, up) in [
            (p + DVec3::Y, DVec3::Y),
            (p - DVec3::Y, DVec3::Y),
            (p + DVec3::X, DVec3::X),
            (p + DVec3::Z, -DVec3::Z),
            (p + DVec3::X, DVec3::ZERO),
            (DVec3::splat(1e25), DVec3::Y),
            (p + DVec3::new(1e-3, 0.0, 0.0), DVec3::Y),
            (p + DVec3::new(1e-20, 1.0, 0.0), DVec3::Y),
        ] {
            assert_right_handed(basis(p, target, up).unwrap());
        }
        assert_right_handed(basis(DVec3::ZERO, DVec3::new(1e-200, 0.0, 0.0), DVec3::Y).unwrap());
        assert!(basis(p, p, DVec3::Y).is_none());
        assert!(basis(p, DVec3::NAN, DVec3::Y).is_none());
    }

    fn camera() -> Camera {
        Camera {
            name: "c".into(),
            position: DVec3::new(0.0, 0.0, 10.0),
            target: DVec3::ZERO,
            up: DVec3::Y,
            projection: Projection::Perspective,
            view_height: 4.0,
            view_width: Some(4.0),
            viewpoint_distance: 10.0,
            lens: None,
            sensor: Sensor::default(),
            fitted: false,
        }
    }

    #[test]
    fn pixels_are_where_the_formula_puts_them() {
        // 4 x 4 pixels over 4 x 4 units: pixel (0, 0) from the top is at x = -1.5, y = +1.5.
        let view = View::new(&camera(), Projection::Orthographic, [4, 4]).unwrap();
        assert_eq!(view.ray(0, 0, Precision::Single).origin(), DVec3::new(-1.5, 1.5, 10.0));
        assert_eq!(view.ray(3, 2, Precision::Single).origin(), DVec3::new(1.5, -0.5, 10.0));
        assert_eq!(view.ray(3, 2, Precision::Single).direction(), -DVec3::Z);
        // Two pixels left of the picture and at its bottom right corner.
        let mut rays = RayBuffer::default();
        view.rays_through(&[-2.0, 4.0], &[2.0, 4.0], Precision::Single, &mut rays);
        assert_eq!(rays.get(0).origin(), DVec3::new(-4.0, 0.0, 10.0));
        assert_eq!(rays.get(1).origin(), DVec3::new(2.0, -2.0, 10.0));
        let view = View::new(&camera(), Projection::Perspective, [4, 4]).unwrap();
        let ray = view.ray(0, 0, Precision::Single);
        assert_eq!(ray.origin(), DVec3::new(0.0, 0.0, 10.0));
        let exact = DVec3::new(-1.5, 1.5, -10.0).normalize();
        assert!((ray.direction() - exact).abs().max_element() <= f64::from(f32::EPSILON) / 2.0);
    }

    #[test]
    fn lines_end_at_the_eye_and_near_the_picture() {
        // The rectangle at distance 10 is 4 wide: slopes of 0.2 end at the picture's sides, of 0.6 a picture beyond.
        let view = View::new(&camera(), Projection::Perspective, [40, 40]).unwrap();
        let (eye, middle) = (camera().position, DVec2::splat(20.0));
        // Before the camera, as the points themselves.
        let (a, b) = (DVec3::new(1.0, 0.0, 0.0), DVec3::new(0.0, -1.0, 5.0));
        let ends = view.project_segment(a, b).unwrap();
        for (end, point) in ends.into_iter().zip([a, b]) {
            assert!((end - view.project(point).0).length() < 1e-9, "{end}");
        }
        // From the eye, or as good as from it: a point.
        for beside in [DVec3::ZERO, DVec3::new(1e-9, -1e-9, 1e-9), DVec3::new(1e-9, 0.0, -1e-9)] {
            let [start, end] = view.project_segment(eye + beside, DVec3::ZERO).unwrap();
            assert!((start - middle).length() < 1e-4 && (end - middle).length() < 1e-9, "{start} {end}");
        }
        // From behind it, beside it: in from a picture's size away.
        let [start, end] =
            view.project_segment(DVec3::new(1.0, 0.0, 12.0), DVec3::new(1.0, 0.0, 0.0)).unwrap();
        assert!((start - DVec2::new(80.0, 20.0)).length() < 1e-9, "{start}");
        assert!((end - DVec2::new(30.0, 20.0)).length() < 1e-9, "{end}");
        assert!(view.project_segment(DVec3::new(1.0, 0.0, 12.0), DVec3::new(0.0, 1.0, 11.0)).is_none());
        assert!(view.project_segment(DVec3::new(9.0, 0.0, 0.0), DVec3::new(9.0, 1.0, 0.0)).is_none());
        // In parallel the line ends in the camera's plane: half-way, at z = 10.
        let view = View::new(&camera(), Projection::Orthographic, [40, 40]).unwrap();
        let [start, end] =
            view.project_segment(DVec3::new(1.0, 0.0, 20.0), DVec3::new(-1.0, 0.0, 0.0)).unwrap();
        assert!(
            (start - middle).length() < 1e-9 && (end - DVec2::new(10.0, 20.0)).length() < 1e-9,
            "{start} {end}"
        );
    }

    #[test]
    fn projecting_is_the_inverse_of_casting() {
        for projection in [Projection::Perspective, Projection::Orthographic] {
            let view = View::new(&camera(), projection, [64, 48]).unwrap();
            let (pixel, before) = view.project(view.ray(10, 20, Precision::Single).at(7.0));
            assert!(before && (pixel - DVec2::new(10.5, 20.5)).abs().max_element() < 1e-4, "{pixel}");
        }
    }

    /// Seen from (1, 2, 3) towards -z: the middle of the picture is ahead, a quarter to the right is +x, the left edge is
    /// behind, the top is up.
    #[test]
    fn a_panorama_shows_all_directions() {
        let position = DVec3::new(1.0, 2.0, 3.0);
        let camera = Camera { position, target: position - DVec3::Z, ..camera() };
        let view = View::new(&camera, Projection::Panoramic, [8, 4]).unwrap();
        let film = |p: DVec2| {
            let mut rays = RayBuffer::default();
            view.rays_through(&[p.x], &[p.y], Precision::Double, &mut rays);
            rays.get(0)
        };
        for ([x, y], direction) in [
            ([4.0, 2.0], -DVec3::Z),
            ([6.0, 2.0], DVec3::X),
            ([2.0, 2.0], -DVec3::X),
            ([8.0, 2.0], DVec3::Z),
            ([0.0, 2.0], DVec3::Z),
            ([5.0, 0.0], DVec3::Y),
            ([5.0, 4.0], -DVec3::Y),
            ([5.0, 2.0], DVec3::new(1.0, 0.0, -1.0).normalize()),
            ([4.0, 1.0], DVec3::new(0.0, 1.0, -1.0).normalize()),
        ] {
            let ray = film(DVec2::new(x, y));
            assert!((ray.direction() - direction).length() < 1e-15, "({x}, {y}): {}", ray.direction());
            assert_eq!(ray.origin(), position);
        }
        for (p, pixel) in [(DVec3::X, [6.0, 2.0]), (-DVec3::Z, [4.0, 2.0]), (DVec3::Y - DVec3::Z, [4.0, 1.0])]
        {
            let (seen, is_in_front) = view.project(position + 7.0 * p);
            assert!((seen - DVec2::from(pixel)).length() < 1e-12 && is_in_front, "{p}: {seen}");
        }
        // The differential is the difference of rays, for steps of a millionth of a pixel.
        let step = 1e-6;
        for [x, y] in [[4.3, 2.2], [1.0, 0.7], [7.9, 3.6]] {
            let direction = film(DVec2::new(x, y)).direction();
            let differential = view.differential(direction);
            let moved = [DVec2::X, DVec2::Y].map(|by| film(DVec2::new(x, y) + step * by).direction());
            for (moved, expected) in moved.iter().zip(differential.direction) {
                let change = (*moved - direction) / step;
                assert!((change - expected).length() < 1e-5, "({x}, {y}): {change} {expected}");
            }
            assert_eq!(differential.origin, [DVec3::ZERO; 2]);
        }
        assert_eq!(view.project_segment(DVec3::X, DVec3::Z), None);
    }
}
