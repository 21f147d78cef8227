//! What a bare mesh is given: a camera that fits it, and a light.

use glam::{DVec2, DVec3};

use super::view::basis;
use crate::film::Colour;
use crate::scene::{Camera, Light, LightKind, Projection, Scene, Shape};

/// What is behind a bare mesh.
pub const BACKGROUND: Colour = Colour::Display(DVec3::new(32.0 / 255.0, 34.0 / 255.0, 38.0 / 255.0));

const FIELD_OF_VIEW: f64 = 40.0;
const MARGIN: f64 = 0.05;

/// Views that every scene has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StandardView {
    /// From 35 degrees to the right of the front and 20 degrees up: what a bare mesh is shown from.
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
    /// From 45 degrees to the right and 35.264 degrees up: all three axes alike.
    Iso,
}

impl StandardView {
    /// Every view.
    pub const ALL: [StandardView; 8] = [
        StandardView::Auto,
        StandardView::Front,
        StandardView::Back,
        StandardView::Left,
        StandardView::Right,
        StandardView::Top,
        StandardView::Bottom,
        StandardView::Iso,
    ];

    /// The name as typed by users.
    pub fn name(self) -> &'static str {
        match self {
            StandardView::Auto => "auto",
            StandardView::Front => "front",
            StandardView::Back => "back",
            StandardView::Left => "left",
            StandardView::Right => "right",
            StandardView::Top => "top",
            StandardView::Bottom => "bottom",
            StandardView::Iso => "iso",
        }
    }

    /// The unit vector from the scene towards the camera.
    fn backwards(self) -> DVec3 {
        let from = |azimuth: f64, elevation: f64| {
            let ((sa, ca), (se, ce)) = (azimuth.sin_cos(), elevation.sin_cos());
            DVec3::new(sa * ce, se, ca * ce)
        };
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

/// A camera that looks at the whole scene from a standard view, with 5 % of the picture free on the tightest sides.
/// `aspect` is the picture's width divided by its height. `None` for a scene without extent.
///
/// Exact rather than by a bounding sphere: in camera axes a point (x, y, z) is within the margin of a camera at
/// (ex, ey, ez) when `|x - ex| <= kx (ez - z)`, and likewise in y. So `ez >= (max(x + kx z) + max(-x + kx z)) / (2 kx)`,
/// and `ex` is half the difference of the two maxima.
pub fn fitted_camera(scene: &Scene, view: StandardView, aspect: f64) -> Option<Camera> {
    let backwards = view.backwards();
    let [u, v, w] = basis(backwards, DVec3::ZERO, DVec3::Y)?;
    let (min, max) = scene.bounds()?;
    // Work around the middle of the scene, so that a far-away scene keeps its digits.
    let middle = min / 2.0 + max / 2.0;
    let half_height = (FIELD_OF_VIEW.to_radians() / 2.0).tan();
    let k = (1.0 - 2.0 * MARGIN) * DVec2::new(half_height * aspect, half_height);
    let k_length = DVec2::new(1.0f64.hypot(k.x), 1.0f64.hypot(k.y));
    let (mut plus, mut minus) = (DVec2::NEG_INFINITY, DVec2::NEG_INFINITY);
    let mut nearest = f64::NEG_INFINITY;
    let mut include = |centre: DVec3, radius: f64| {
        let p = centre - middle;
        let (across, depth) = (DVec2::new(p.dot(u), p.dot(v)), p.dot(w));
        plus = plus.max(across + k * depth + radius * k_length);
        minus = minus.max(-across + k * depth + radius * k_length);
        nearest = nearest.max(depth + radius);
    };
    for object in &scene.objects {
        match &object.shape {
            Shape::Sphere { centre, radius } => include(*centre, *radius),
            Shape::Mesh(mesh) => mesh.corners().for_each(|p| include(p, 0.0)),
        }
    }
    let distances = (plus + minus) / (2.0 * k);
    let distance = distances.max_element();
    let sideways = (plus - minus) / 2.0;
    let position = middle + sideways.x * u + sideways.y * v + distance * w;
    // A single point, or a line along the view, has no size to fit; step back by what it has.
    let step = (distance - nearest).max((max - min).length() / 2.0).max(f64::MIN_POSITIVE);
    let target = position - w * step;
    if target == position || !position.is_finite() {
        return None;
    }
    let up = v;
    let fov = FIELD_OF_VIEW.to_radians();
    let mut camera = Camera::from_field_of_view(view.name().into(), position, target, up, fov);
    // The rectangle of the orthographic projection lies where the scene is.
    let depth = (position - middle).dot(w).max(step);
    let factor = depth / camera.viewpoint_distance;
    camera.view_height *= factor;
    camera.viewpoint_distance = depth;
    camera.projection = Projection::Perspective;
    Some(camera)
}

/// The light of scenes that have none: directional, from 20 degrees right of the view and 30 degrees above it.
pub fn headlight(camera: &Camera) -> Option<Light> {
    let [u, v, w] = basis(camera.position, camera.target, camera.up)?;
    let ((sr, cr), (sa, ca)) = (20f64.to_radians().sin_cos(), 30f64.to_radians().sin_cos());
    let towards = sr * ca * u + sa * v + cr * ca * w;
    Some(Light {
        name: "headlight".into(),
        colour: Colour::Display(DVec3::ONE),
        intensity: 1.0,
        kind: LightKind::Directional { direction: -towards },
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{MaterialId, Mesh, Object};
    use crate::world::View;

    fn scene_of(shape: Shape) -> Scene {
        let object = Object { name: "o".into(), input: 0, material: MaterialId(0), shape };
        Scene { objects: vec![object], ..Scene::default() }
    }

    fn block(size: DVec3, centre: DVec3) -> Scene {
        let corner = |i: usize| {
            let bit = |k: usize| if i >> k & 1 == 1 { 0.5 } else { -0.5 };
            centre + DVec3::new(bit(0), bit(1), bit(2)) * size
        };
        let positions = (0..8).map(corner).collect();
        scene_of(Shape::Mesh(Mesh {
            positions,
            triangles: vec![[0, 1, 2], [3, 4, 5], [6, 7, 0]],
            ..Mesh::default()
        }))
    }

    /// At every scale, place, view and shape of picture: all corners within the margin, and one of them on it.
    #[test]
    fn everything_is_in_the_picture_and_the_margin_is_used() {
        for scale in [1e-6, 1.0, 1e8] {
            for offset in [0.0, 1e3] {
                for view in StandardView::ALL {
                    for [width, height] in [[1000, 1000], [1600, 900], [500, 1000]] {
                        let centre = DVec3::splat(offset * scale);
                        let scene = block(DVec3::new(3.0, 1.0, 2.0) * scale, centre);
                        let size = [width, height];
                        let aspect = f64::from(width) / f64::from(height);
                        let camera = fitted_camera(&scene, view, aspect).unwrap();
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

    #[test]
    fn a_sphere_touches_the_margin() {
        let scene = scene_of(Shape::Sphere { centre: DVec3::new(3.0, 2.0, 1.0), radius: 2.0 });
        let camera = fitted_camera(&scene, StandardView::Front, 1.0).unwrap();
        // Seen from a distance D the sphere's silhouette is a circle of tangent r / sqrt(D^2 - r^2).
        let distance = camera.position.distance(DVec3::new(3.0, 2.0, 1.0));
        let tangent = 2.0 / (distance * distance - 4.0).sqrt();
        assert!((tangent - 0.9 * 20f64.to_radians().tan()).abs() < 1e-12);
    }

    #[test]
    fn nothing_to_fit_is_no_camera() {
        assert!(fitted_camera(&Scene::default(), StandardView::Auto, 1.0).is_none());
    }

    #[test]
    fn the_headlight_comes_from_above_right() {
        let camera = fitted_camera(&block(DVec3::ONE, DVec3::ZERO), StandardView::Front, 1.0).unwrap();
        let LightKind::Directional { direction } = headlight(&camera).unwrap().kind else { panic!() };
        assert!((direction.length() - 1.0).abs() < 1e-15);
        // Elevation 30 degrees: y = -sin 30. Azimuth 20 degrees to the right: x / z = tan 20.
        assert!((direction.y + 0.5).abs() < 1e-15);
        assert!((direction.x / direction.z - 20f64.to_radians().tan()).abs() < 1e-15 && direction.x < 0.0);
    }
}
