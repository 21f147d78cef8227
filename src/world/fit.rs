//! Fitted cameras, and the camera and light of scenes that have none.

use std::collections::HashMap;
use std::sync::Arc;

use glam::{DMat3, DVec2, DVec3};
use rayon::prelude::*;

use super::view::basis;
use crate::film::Colour;
use crate::scene::mesh::support::{AffineFunction, PointTrees, maxima};
use crate::scene::option::named_values;
use crate::scene::{
    Camera, FieldOfView, Light, LightKind, Mesh, PictureSettings, Placed, Projection, Rotation, Scene, Shape,
    Zoom,
};

/// The background of scenes that set none.
pub(crate) const BACKGROUND: Colour = Colour::Display(DVec3::new(32.0 / 255.0, 34.0 / 255.0, 38.0 / 255.0));

/// The vertical field of view of fitted cameras by default, in degrees.
const FIELD_OF_VIEW: f64 = 40.0;

/// The share of the picture that is left free on each of the tightest sides.
const MARGIN: f64 = 0.05;

/// The directions that a scene can be seen from by a fitted camera.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum StandardView {
    /// From 35 degrees to the right of the front and 20 degrees up; into a surface that is open to one side. The default.
    Auto,
    /// Along -z, from +z.
    Front,
    /// Along +z, from -z.
    Back,
    /// From -x.
    Left,
    /// From +x.
    Right,
    /// From +y, with -z up in the picture.
    Top,
    /// From -y, with +z up in the picture.
    Bottom,
    /// From 45 degrees to the right and 35.264 degrees up: isometric.
    Iso,
}

names!(StandardView {
    Auto = "auto", Front = "front", Back = "back", Left = "left", Right = "right", Top = "top",
    Bottom = "bottom", Iso = "iso",
});

// `auto` is a camera, not a view.
named_values!(StandardView: StandardView::ALL.into_iter().skip(1));

impl StandardView {
    /// The unit vector from the scene towards the camera.
    fn backwards(self) -> DVec3 {
        match self {
            StandardView::Auto => from(35f64.to_radians(), 20f64.to_radians()),
            StandardView::Front => DVec3::Z,
            StandardView::Back => -DVec3::Z,
            StandardView::Left => -DVec3::X,
            StandardView::Right => DVec3::X,
            StandardView::Top => DVec3::Y,
            StandardView::Bottom => -DVec3::Y,
            StandardView::Iso => DVec3::ONE.normalize(),
        }
    }
}

/// How a fitted camera looks at a scene.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Framing {
    /// The side.
    pub view: StandardView,
    /// Rotation from the side about +y in degrees, counterclockwise seen from above.
    pub azimuth: f64,
    /// Rotation upwards in degrees, as far as straight above or below.
    pub elevation: f64,
    /// Magnification of the picture, about its centre.
    pub zoom: f64,
    /// Vertical field of view in degrees at a magnification of 1.
    pub field_of_view: f64,
}

impl From<StandardView> for Framing {
    fn from(view: StandardView) -> Self {
        Framing { view, azimuth: 0.0, elevation: 0.0, zoom: 1.0, field_of_view: FIELD_OF_VIEW }
    }
}

impl Framing {
    /// The framing from a side by settings; those that are not set keep their values.
    pub fn with(self, picture: &PictureSettings) -> Self {
        Framing {
            view: self.view,
            azimuth: picture.azimuth.map_or(self.azimuth, Rotation::get),
            elevation: picture.elevation.map_or(self.elevation, Rotation::get),
            zoom: picture.zoom.map_or(self.zoom, Zoom::get),
            field_of_view: picture.fov.map_or(self.field_of_view, FieldOfView::get),
        }
    }

    /// The unit vector towards the camera and an up vector, after rotation of the unit vector towards the side.
    fn turned(&self, side: DVec3) -> (DVec3, DVec3) {
        if self.azimuth == 0.0 && self.elevation == 0.0 {
            return (side, DVec3::Y);
        }
        let quarter = std::f64::consts::FRAC_PI_2;
        let azimuth = side.x.atan2(side.z) + (self.azimuth % 360.0).to_radians();
        let elevation = side.y.clamp(-1.0, 1.0).asin() + self.elevation.to_radians();
        let elevation = elevation.clamp(-quarter, quarter);
        (from(azimuth, elevation), from(azimuth, elevation + quarter))
    }

    /// The vertical field of view after magnification, in degrees with six decimals, so that it has a short text.
    fn magnified(&self) -> f64 {
        let half = (self.field_of_view.to_radians() / 2.0).tan() / self.zoom;
        ((2.0 * half.atan()).to_degrees() * 1e6).round() / 1e6
    }
}

/// The least share of its area by which a surface is open sideways, for a view into it.
const OPEN_SHARE: f64 = 0.08;

/// Minimum open share of a flat surface: 1, less the rounding of f32 coordinates, which rotate the normals of triangles
/// by about 2^-23 times their aspect ratio.
const FLAT_SHARE: f64 = 1.0 - 1e-6;

/// The view into a scene whose surface is open to one side.
pub(crate) struct Opening {
    /// The horizontal unit vector out of the opening, towards a camera that looks straight in.
    pub towards: DVec3,
    /// Whether all triangles face that side, so that the camera looks at the surface, not into it.
    pub is_flat: bool,
}

/// The view into a scene whose surface is open to one side, such as a room without a wall. `None` for other scenes.
///
/// The sum of area times normal over a closed surface is zero. That of a surface without a part is the opposite of the part's: where
/// normals point into a room, it points out of the missing wall.
pub(crate) fn opening(scene: &Scene) -> Option<Opening> {
    let mut all = Orientation::default();
    let mut shared: HashMap<*const Mesh, Orientation> = HashMap::new();
    for object in &scene.objects {
        match &object.shape {
            Shape::Mesh(mesh) => all.add(mesh),
            Shape::Placed(Placed { mesh, placement }) => {
                let own = shared.entry(Arc::as_ptr(mesh)).or_insert_with(|| {
                    let mut own = Orientation::default();
                    own.add(mesh);
                    own
                });
                all.add_placed(own, &placement.as_one().0);
            }
            Shape::Analytic(_) => {}
        }
    }
    let sideways = DVec2::new(all.sum.x, all.sum.z);
    (sideways.length() > OPEN_SHARE * all.area && all.area.is_finite()).then(|| Opening {
        towards: DVec3::new(sideways.x, 0.0, sideways.y).normalize(),
        // The length of the sum is the sum of lengths if the normals are parallel.
        is_flat: all.sum.length() >= FLAT_SHARE * all.area,
    })
}

/// Sums over triangles of the vectors `n` of length twice the area along their normals.
#[derive(Default)]
struct Orientation {
    /// Of `n`.
    sum: DVec3,
    /// Of |n|.
    area: f64,
    /// Of n n^T / |n|.
    spread: DMat3,
}

impl Orientation {
    fn add(&mut self, mesh: &Mesh) {
        for [a, b, c] in mesh.triangles.iter().map(|t| t.map(|i| mesh.positions[i as usize])) {
            let twice = (b - a).cross(c - a);
            let length = twice.length();
            self.sum += twice;
            self.area += length;
            if length > 0.0 {
                let unit = twice / length;
                self.spread += DMat3::from_cols(twice * unit.x, twice * unit.y, twice * unit.z);
            }
        }
    }

    /// Adds a mesh after a linear map, whose cofactor matrix C maps `n`. The area, the sum of |C n|, is bounded from above
    /// by Jensen's inequality: sqrt(area * sum |C n|^2 / |n|), where the sum is the trace of C spread C^T. It is exact for
    /// rotations with a uniform scale.
    fn add_placed(&mut self, mesh: &Orientation, linear: &DMat3) {
        let [x, y, z] = [linear.x_axis, linear.y_axis, linear.z_axis];
        let cofactor = DMat3::from_cols(y.cross(z), z.cross(x), x.cross(y));
        let moved = cofactor * mesh.spread * cofactor.transpose();
        self.sum += cofactor * mesh.sum;
        self.area += (mesh.area * (moved.x_axis.x + moved.y_axis.y + moved.z_axis.z)).max(0.0).sqrt();
    }
}

/// The unit vector at an azimuth, from +z towards +x, and an elevation, in radians.
fn from(azimuth: f64, elevation: f64) -> DVec3 {
    let ((sa, ca), (se, ce)) = (azimuth.sin_cos(), elevation.sin_cos());
    DVec3::new(sa * ce, se, ca * ce)
}

/// A camera that looks at the whole scene, with 5 % of the picture free on the tightest sides before magnification.
/// `aspect` is the picture's width divided by its height. A panorama is seen from the middle of the bounds, with a level
/// horizon. `None` for a scene without extent.
pub fn fitted_camera(
    scene: &Scene,
    framing: impl Into<Framing>,
    aspect: f64,
    projection: Projection,
) -> Option<Camera> {
    fitted_to_poses(scene, rayon::iter::empty(), framing, aspect, projection)
}

/// A camera as of [`fitted_camera`] that also looks at all of the same scene in other poses.
pub fn fitted_to_poses(
    scene: &Scene,
    others: impl ParallelIterator<Item = Scene> + Clone,
    framing: impl Into<Framing>,
    aspect: f64,
    projection: Projection,
) -> Option<Camera> {
    let framing = framing.into();
    let view = framing.view;
    let side = match view {
        StandardView::Auto => opening(scene).map_or(view.backwards(), |opening| opening.towards),
        _ => view.backwards(),
    };
    let is_panoramic = projection.shows_all_directions();
    let level = DVec3::new(side.x, 0.0, side.z).normalize_or(DVec3::Z);
    let (backwards, up) = framing.turned(if is_panoramic { level } else { side });
    let [u, v, w] = basis(backwards, DVec3::ZERO, up)?;
    // A clip may begin with nothing to see.
    let bounds_of = |pose: Scene| pose.bounds();
    let (min, max) = scene.bounds().or_else(|| others.clone().find_map_first(bounds_of))?;
    // Relative to the centre of the scene, to avoid cancellation for scenes far from the origin.
    let middle = min / 2.0 + max / 2.0;
    let fov = framing.magnified().to_radians();
    let from = |position: DVec3, target: DVec3| {
        let up = if w.y.abs() < STEEP { DVec3::Y } else { v };
        let camera = Camera::from_field_of_view(view.name().into(), position, target, up, fov);
        (target != position && position.is_finite()).then_some(Camera { projection, fitted: true, ..camera })
    };
    if is_panoramic {
        return from(middle, middle - w * (max - min).length());
    }
    let half_height = (framing.field_of_view.to_radians() / 2.0).tan();
    let k = (1.0 - 2.0 * MARGIN) * DVec2::new(half_height * aspect, half_height);
    let slope = if projection.is_central() { k } else { DVec2::ZERO };
    let extent_of = |scene: &Scene| extent(scene, middle, [u, v, w], slope);
    let greater = |a: [f64; 5], b: [f64; 5]| -> [f64; 5] { std::array::from_fn(|i| a[i].max(b[i])) };
    let others = others.map(|pose| extent_of(&pose)).reduce_with(greater);
    let [right, left, up, down, nearest] = others.into_iter().fold(extent_of(scene), greater);
    let (plus, minus) = (DVec2::new(right, up), DVec2::new(left, down));
    let size = (max - min).length();
    let sideways = (plus - minus) / 2.0;
    let reach = (plus + minus) / 2.0;
    // The least distance to the nearest point, for shapes that taper towards the camera.
    let clear = nearest + CLEARANCE * size;
    let is_central = projection.is_central();
    let distance = if is_central { (reach / k).max_element().max(clear) } else { clear };
    let half = (reach / DVec2::new(aspect, 1.0)).max_element() / (1.0 - 2.0 * MARGIN);
    let view_height = 2.0 * if is_central { half_height * distance } else { half };
    if !(distance > 0.0 && view_height > 0.0) {
        return None;
    }
    let position = middle + sideways.x * u + sideways.y * v + distance * w;
    let camera = from(position, position - w * distance)?;
    Some(if is_central { camera } else { Camera { view_height: view_height / framing.zoom, ..camera } })
}

/// The cosine of the angle to the vertical from which a fitted camera has an up vector other than +y.
const STEEP: f64 = 0.999;

/// The camera of a turntable and the point it turns around: it sees the whole scene from every angle about the vertical axis
/// through the scene's centre, and begins where [`fitted_camera`] would look from. `None` for a scene without extent.
///
/// The turning scene stays within a cylinder about the axis. A prism around that cylinder is fitted. Seen from above, no point lies
/// farther out than its largest extent along 64 directions divided by the cosine of half the angle between them.
pub fn turntable_camera(
    scene: &Scene,
    framing: impl Into<Framing>,
    aspect: f64,
    projection: Projection,
) -> Option<(Camera, DVec3)> {
    let framing = framing.into();
    let (min, max) = scene.bounds()?;
    let middle = min / 2.0 + max / 2.0;
    let half_angle = std::f64::consts::PI / f64::from(SIDES);
    let direction = |i: u32| {
        let (sin, cos) = (2.0 * half_angle * f64::from(i)).sin_cos();
        DVec3::new(sin, 0.0, cos)
    };
    let side = |out: DVec3| AffineFunction {
        of_sphere: Box::new(move |p, radius| (p - middle).dot(out) + radius),
        gradient: out,
        weight: out.abs(),
        offset: middle.abs(),
    };
    let functions: [_; SIDES as usize] = std::array::from_fn(|i| side(direction(i as u32)));
    let reach =
        maxima(&PointTrees::of(&scene.objects), &scene.objects, &functions).into_iter().fold(0.0, f64::max);
    // Squared: once for points between the directions, once for the prism's sides, which lie nearer than its edges.
    let radius = reach / half_angle.cos().powi(2);
    let (backwards, _) = framing.turned(framing.view.backwards());
    let start = backwards.x.atan2(backwards.z);
    let edge = |i: u32, y: f64| {
        let (sin, cos) = (start + 2.0 * half_angle * f64::from(i)).sin_cos();
        DVec3::new(middle.x + radius * sin, y, middle.z + radius * cos)
    };
    let positions: Vec<DVec3> = (0..SIDES).flat_map(|i| [edge(i, min.y), edge(i, max.y)]).collect();
    let triangles = (0..SIDES).map(|i| [2 * i, 2 * i + 1, 2 * (i + 1) % (2 * SIDES)]).collect();
    let shape = Shape::Mesh(Mesh { positions, triangles, ..Mesh::default() });
    let prism = Scene::from_iter([shape]);
    Some((fitted_camera(&prism, framing, aspect, projection)?, middle))
}

/// The sides of the prism of [`turntable_camera`], which is less than 1 % larger than the cylinder.
const SIDES: u32 = 64;

/// The least distance of a fitted camera from the nearest point, in diagonals of the scene's bounds.
const CLEARANCE: f64 = 0.1;

/// The extent of a scene, for an exact fit. In camera axes, a point (x, y, z) lies within a pyramid of the given slopes
/// with its apex at (ex, ey, ez) where `|x - ex| <= slope.x (ez - z)`, and likewise in y. So `ez >= (max(x + slope.x z)
/// + max(-x + slope.x z)) / (2 slope.x)`, and `ex` is half the difference of the two maxima. A slope of 0 gives the
/// extents for parallel rays. Returns the maxima of `x + slope.x z`, `-x + slope.x z`, the same two in y, and z.
fn extent(scene: &Scene, middle: DVec3, [u, v, w]: [DVec3; 3], slope: DVec2) -> [f64; 5] {
    let length = DVec2::new(1.0f64.hypot(slope.x), 1.0f64.hypot(slope.y));
    // The function `sign * across + slope * depth`.
    let side = |sign: f64, across: DVec3, slope: f64, length: f64| AffineFunction {
        of_sphere: Box::new(move |p, radius| {
            let p = p - middle;
            sign * p.dot(across) + slope * p.dot(w) + radius * length
        }),
        gradient: across * sign + w * slope,
        weight: across.abs() + w.abs() * slope,
        offset: middle.abs(),
    };
    let functions = [
        side(1.0, u, slope.x, length.x),
        side(-1.0, u, slope.x, length.x),
        side(1.0, v, slope.y, length.y),
        side(-1.0, v, slope.y, length.y),
        // Towards the camera.
        side(0.0, u, 1.0, 1.0),
    ];
    maxima(&PointTrees::of(&scene.objects), &scene.objects, &functions)
}

/// The light of scenes that have none: directional, from 20 degrees right of and 30 degrees above the view direction.
pub fn headlight(camera: &Camera) -> Option<Light> {
    let [u, v, w] = basis(camera.position, camera.target, camera.up)?;
    let ((sr, cr), (sa, ca)) = (20f64.to_radians().sin_cos(), 30f64.to_radians().sin_cos());
    let towards = sr * ca * u + sa * v + cr * ca * w;
    Some(Light {
        name: "headlight".into(),
        colour: Colour::Display(DVec3::ONE),
        intensity: 1.0,
        kind: LightKind::Directional { direction: -towards, angle: 0.0 },
    })
}

/// The sine of the height above the horizon of the key light: 52 degrees.
const KEY_SINE: f64 = 0.788_010_753_606_722;

/// The intensity of the key light.
const KEY_INTENSITY: f64 = 0.72;

/// What a white surface that faces up reflects of the key light.
pub(crate) const KEY_IRRADIANCE: f64 = KEY_INTENSITY * KEY_SINE;

/// The key light of the default look: a directional light of 24 degrees from 40 degrees left of the camera and 52 degrees
/// above the horizon. Its height is that above +y, so that it lights a ground alike from every side.
pub(crate) fn key_light(camera: &Camera) -> Light {
    let backwards = camera.position - camera.target;
    let horizontal = |v: DVec3| DVec3::new(v.x, 0.0, v.z).try_normalize();
    // A camera that looks straight down has its lower edge in front.
    let level = backwards.y.abs() < 0.999 * backwards.length();
    let front = if level { horizontal(backwards) } else { horizontal(-camera.up) };
    let front = front.unwrap_or(DVec3::Z);
    let (sin, cos) = 40f64.to_radians().sin_cos();
    let aside = DVec3::new(front.x * cos - front.z * sin, 0.0, front.z * cos + front.x * sin);
    let towards = aside * (1.0 - KEY_SINE * KEY_SINE).sqrt() + DVec3::Y * KEY_SINE;
    Light {
        name: "key".into(),
        colour: Colour::Display(DVec3::ONE),
        intensity: KEY_INTENSITY,
        kind: LightKind::Directional { direction: -towards.normalize(), angle: 24f64.to_radians() },
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Placement, Sphere};
    use crate::world::View;
    use glam::{DMat4, DQuat};

    fn block(size: DVec3, centre: DVec3) -> Scene {
        let corner = |i: usize| {
            let bit = |k: usize| if i >> k & 1 == 1 { 0.5 } else { -0.5 };
            centre + DVec3::new(bit(0), bit(1), bit(2)) * size
        };
        let positions = (0..8).map(corner).collect();
        let triangles = vec![[0, 1, 2], [3, 4, 5], [6, 7, 0]];
        Scene::from_iter([Shape::Mesh(Mesh { positions, triangles, ..Mesh::default() })])
    }

    fn views() -> impl Iterator<Item = (StandardView, Projection)> {
        let both = [Projection::Perspective, Projection::Orthographic];
        StandardView::ALL.into_iter().flat_map(move |view| both.map(|projection| (view, projection)))
    }

    #[test]
    fn a_tip_does_not_touch_the_camera() {
        // A pyramid narrower than the field of view, pointing at the camera: without clearance the fit would touch its tip.
        let corners = [(0.0, 0.0, 4.0), (1.0, 1.0, -4.0), (-1.0, 1.0, -4.0), (0.0, -1.0, -4.0)];
        let positions = corners.iter().map(|&(x, y, z)| DVec3::new(x, y, z)).collect();
        let triangles = vec![[0, 1, 2], [0, 2, 3], [0, 3, 1]];
        let scene = Scene::from_iter([Shape::Mesh(Mesh { positions, triangles, ..Mesh::default() })]);
        let camera = fitted_camera(&scene, StandardView::Front, 1.0, Projection::Perspective).unwrap();
        // The box is 2 x 2 x 8: a tenth of its diagonal is 0.85.
        assert!(camera.position.z >= 4.84, "{}", camera.position);
    }

    /// For every scale, position, view and aspect ratio, all corners lie within the margin, and one lies on it.
    #[test]
    fn everything_is_in_the_picture_and_the_margin_is_used() {
        for scale in [1e-6, 1.0, 1e8] {
            for offset in [0.0, 1e3] {
                for (view, projection) in views() {
                    for [width, height] in [[1000, 1000], [1600, 900], [500, 1000]] {
                        let centre = DVec3::splat(offset * scale);
                        let scene = block(DVec3::new(3.0, 1.0, 2.0) * scale, centre);
                        let size = [width, height];
                        let aspect = f64::from(width) / f64::from(height);
                        let camera = fitted_camera(&scene, view, aspect, projection).unwrap();
                        let ready = View::new(&camera, camera.projection, size).unwrap();
                        let mut closest = f64::INFINITY;
                        let Shape::Mesh(mesh) = &scene.objects[0].shape else { unreachable!() };
                        for &p in &mesh.positions {
                            let (pixel, before) = ready.project(p);
                            let share = pixel / DVec2::new(f64::from(width), f64::from(height));
                            assert!(before);
                            closest = closest.min(share.min_element()).min((1.0 - share).min_element());
                        }
                        assert!(
                            (closest - MARGIN).abs() < 1e-9,
                            "{view:?} {scale} {offset} {size:?}: {closest}"
                        );
                    }
                }
            }
        }
    }

    /// Fitted to poses on both sides of a scene, a camera has all of them within the margin, and one corner on it.
    #[test]
    fn all_poses_are_in_the_picture() {
        let poses = [0.0, 4.0, -3.0].map(|x| block(DVec3::new(3.0, 1.0, 2.0), DVec3::new(x, 0.5 * x, 0.0)));
        for (view, projection) in views() {
            let others = poses[1..].to_vec().into_par_iter();
            let camera = fitted_to_poses(&poses[0], others, view, 1.0, projection).unwrap();
            let ready = View::new(&camera, camera.projection, [1000, 1000]).unwrap();
            let meshes = poses.iter().map(|pose| match &pose.objects[0].shape {
                Shape::Mesh(mesh) => mesh,
                _ => unreachable!(),
            });
            let shares = meshes.flat_map(|mesh| &mesh.positions).map(|&p| ready.project(p).0 / 1000.0);
            let closest = shares.map(|share| share.min_element().min((1.0 - share).min_element()));
            let closest = closest.fold(f64::INFINITY, f64::min);
            assert!((closest - MARGIN).abs() < 1e-9, "{view:?} {projection:?}: {closest}");
        }
    }

    /// A clip that begins with nothing to see is fitted to what comes. Only the side of the automatic view is that of
    /// the first pose.
    #[test]
    fn poses_that_cannot_be_seen_do_not_count() {
        let [seen, flat] = [DVec3::ONE, DVec3::ZERO].map(|size| block(size, DVec3::splat(5.0)));
        for (view, projection) in views().filter(|(view, _)| *view != StandardView::Auto) {
            let poses = vec![seen.clone(), flat.clone()].into_par_iter();
            let camera = fitted_to_poses(&flat, poses, view, 1.0, projection);
            assert_eq!(camera, fitted_camera(&seen, view, 1.0, projection), "{view:?} {projection:?}");
            assert_eq!(fitted_camera(&flat, view, 1.0, projection), None);
        }
    }

    #[test]
    fn a_sphere_touches_the_margin() {
        let sphere = Sphere { centre: DVec3::new(3.0, 2.0, 1.0), radius: 2.0 };
        let scene = Scene::from_iter([Shape::Analytic(sphere.into())]);
        let camera = fitted_camera(&scene, StandardView::Front, 1.0, Projection::Perspective).unwrap();
        // Seen from a distance D the sphere's silhouette is a circle of tangent r / sqrt(D^2 - r^2).
        let distance = camera.position.distance(DVec3::new(3.0, 2.0, 1.0));
        let tangent = 2.0 / (distance * distance - 4.0).sqrt();
        assert!((tangent - 0.9 * 20f64.to_radians().tan()).abs() < 1e-12);
    }

    #[test]
    fn nothing_to_fit_is_no_camera() {
        assert!(fitted_camera(&Scene::default(), StandardView::Auto, 1.0, Projection::Perspective).is_none());
    }

    /// A room of four walls and a floor, whose normals point inwards, is open towards the wall that is missing; a closed box
    /// and the room's outer side are not.
    #[test]
    fn the_view_goes_into_a_room() {
        let corners = [
            [-1, -1, -1],
            [1, -1, -1],
            [1, 1, -1],
            [-1, 1, -1],
            [-1, -1, 1],
            [1, -1, 1],
            [1, 1, 1],
            [-1, 1, 1],
        ];
        let positions: Vec<DVec3> = corners.map(|c: [i32; 3]| DVec3::from(c.map(f64::from))).into();
        // Counterclockwise seen from inside: back, left, floor, ceiling, right; then the front.
        let quads = [[0, 1, 2, 3], [4, 0, 3, 7], [4, 5, 1, 0], [3, 2, 6, 7], [1, 5, 6, 2], [5, 4, 7, 6]];
        let room = |walls: &[usize]| {
            let quads = walls.iter().map(|&w| quads[w]);
            let triangles = quads.flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
            let mesh = Mesh { positions: positions.clone(), triangles, ..Mesh::default() };
            Scene::from_iter([Shape::Mesh(mesh)])
        };
        assert!(opening(&room(&[0, 1, 2, 3, 4, 5])).is_none());
        let towards = |walls: &[usize]| opening(&room(walls)).expect("an opening").towards;
        assert!((towards(&[0, 1, 2, 3, 4]) - DVec3::Z).length() < 1e-12);
        // Without the right wall, towards +x.
        assert!((towards(&[0, 1, 2, 3, 5]) - DVec3::X).length() < 1e-12);
        // Without a ceiling, no side is open.
        assert!(opening(&room(&[0, 1, 2, 4, 5])).is_none());
        // Less than a wall is flat.
        let is_flat = |walls: &[usize]| opening(&room(walls)).expect("an opening").is_flat;
        assert_eq!([&[0, 1, 2, 3, 4][..], &[0, 2], &[0]].map(is_flat), [false, false, true]);
        // Instances are open to the same side as copies: turned; stretched, where the area is a bound; and mirrored, which
        // turns the normals outwards.
        for scale in [DVec3::ONE, DVec3::new(1.0, 2.0, 3.0), DVec3::new(1.0, 1.0, -1.0)] {
            let turn = DQuat::from_rotation_y(0.3);
            let map = DMat4::from_scale_rotation_translation(scale, turn, DVec3::splat(9.0));
            let Shape::Mesh(mesh) = room(&[0, 1, 2, 3, 4]).objects.remove(0).shape else { panic!("a mesh") };
            let placed = Placed::new(Arc::new(mesh), Placement::new(map));
            let copy = opening(&Scene::from_iter([Shape::Mesh(placed.bake())])).expect("an opening").towards;
            let instance = opening(&Scene::from_iter([Shape::Placed(placed)])).expect("an opening").towards;
            assert!((copy - instance).length() < 1e-12, "{scale}: {copy} {instance}");
        }
    }

    /// From every camera but one that looks straight down, 40 degrees to its left and 52 above the horizon.
    #[test]
    fn the_key_light_comes_from_above_left() {
        for (position, up, azimuth) in [
            (DVec3::Z, DVec3::Y, -40.0),
            (DVec3::new(3.0, 2.0, 0.0), DVec3::Y, 50.0),
            (DVec3::Y, -DVec3::Z, -40.0f64),
        ] {
            let camera = Camera::from_field_of_view("c".into(), position * 5.0, DVec3::ZERO, up, 1.0);
            let LightKind::Directional { direction, .. } = key_light(&camera).kind else { panic!() };
            let angle = (-direction.x).atan2(-direction.z).to_degrees();
            assert!((direction.y + 52f64.to_radians().sin()).abs() < 1e-12, "{direction}");
            assert!((angle - azimuth).abs() < 1e-9, "{angle} {azimuth}");
        }
    }

    #[test]
    fn the_headlight_comes_from_above_right() {
        let camera =
            fitted_camera(&block(DVec3::ONE, DVec3::ZERO), StandardView::Front, 1.0, Projection::Perspective)
                .unwrap();
        let LightKind::Directional { direction, .. } = headlight(&camera).unwrap().kind else { panic!() };
        assert!((direction.length() - 1.0).abs() < 1e-15);
        // Elevation 30 degrees: y = -sin 30. Azimuth 20 degrees to the right: x / z = tan 20.
        assert!((direction.y + 0.5).abs() < 1e-15);
        assert!((direction.x / direction.z - 20f64.to_radians().tan()).abs() < 1e-15 && direction.x < 0.0);
    }

    /// Turned by 90 degrees to the right, the front is the right; raised beyond the pole, it is the top, with what was in
    /// front below in the picture. Magnified twice, the picture is half as high; all cameras fit what they look at.
    #[test]
    fn a_framing_starts_from_its_view() {
        let scene = block(DVec3::new(1.0, 2.0, 3.0), DVec3::new(5.0, 0.0, 0.0));
        let fit = |framing: Framing, projection| fitted_camera(&scene, framing, 1.5, projection).unwrap();
        let front = Framing::from(StandardView::Front);
        for projection in [Projection::Perspective, Projection::Orthographic] {
            let same = |framing: Framing, view: StandardView| {
                let [turned, known] = [fit(framing, projection), fit(view.into(), projection)];
                assert!(turned.position.distance(known.position) < 1e-12, "{turned:?} {known:?}");
                assert!((turned.view_height - known.view_height).abs() < 1e-12, "{turned:?} {known:?}");
                assert!(turned.up.distance(known.up) < 1e-12, "{turned:?} {known:?}");
            };
            same(Framing { azimuth: 90.0, ..front }, StandardView::Right);
            same(Framing { azimuth: -450.0, ..front }, StandardView::Left);
            same(Framing { elevation: 120.0, ..front }, StandardView::Top);
            same(
                Framing { azimuth: -45.0, elevation: -35.264_389_682_754_654, ..StandardView::Iso.into() },
                StandardView::Front,
            );
            let [once, twice] = [1.0, 2.0].map(|zoom| fit(Framing { zoom, ..front }, projection));
            assert_eq!(once.position, twice.position);
            let height = |camera: &Camera| camera.view_height / camera.viewpoint_distance;
            // The field of view has six decimals.
            assert!((height(&once) / height(&twice) - 2.0).abs() < 1e-6, "{once:?} {twice:?}");
        }
        let wide = fit(Framing { field_of_view: 90.0, ..front }, Projection::Perspective);
        assert!((wide.view_height / wide.viewpoint_distance - 2.0).abs() < 1e-12);
    }
}
