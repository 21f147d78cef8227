//! Tests of `up`.

use crate::import::meshes::up::*;
use crate::scene::{Mesh, Shape};

fn axis(scene: &Scene) -> Option<UpAxis> {
    guess(scene).map(|guess| guess.up)
}

/// A pyramid with its tip along an axis.
fn pyramid(up: UpAxis) -> Scene {
    let corners = [[1.0, 0.0, 1.0], [1.0, 0.0, -1.0], [-1.0, 0.0, -1.0], [-1.0, 0.0, 1.0], [0.0, 3.0, 0.0]];
    let file_from_world = up.world_from_file().transpose();
    let positions = corners.map(|c| file_from_world.transform_point3(c.into())).into();
    let triangles = vec![[0, 1, 2], [0, 2, 3], [0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]];
    Scene::from_iter([Shape::Mesh(Mesh { positions, triangles, ..Mesh::default() })])
}

#[test]
fn a_base_says_where_up_is() {
    for up in CANDIDATES {
        assert_eq!(axis(&pyramid(up)), Some(up), "{}", up.name());
    }
    assert_eq!(axis(&Scene::default()), None);
}

/// The sides of a pyramid 0.3 high without its base, which slope by at most 17 degrees, face up.
#[test]
fn a_height_field_faces_up() {
    for up in CANDIDATES {
        let mut scene = pyramid(up);
        let Shape::Mesh(mesh) = &mut scene.objects[0].shape else { unreachable!() };
        mesh.triangles = vec![[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]];
        mesh.positions[4] *= 0.1;
        assert_eq!(guess(&scene), Some(Guess { up, is_sure: false }), "{}", up.name());
    }
}

/// A mesh with y up, of boxes, discs and balls.
#[derive(Clone, Default)]
struct Model(Mesh);

impl Model {
    /// A surface over a grid of two parameters from 0 to 1.
    fn add(mut self, grid: [u32; 2], at: impl Fn(f64, f64) -> DVec3) -> Self {
        let (Mesh { positions, triangles, .. }, [m, n]) = (&mut self.0, grid);
        let first = positions.len() as u32;
        for i in 0..=m {
            positions.extend((0..=n).map(|k| at(f64::from(i) / f64::from(m), f64::from(k) / f64::from(n))));
        }
        for (i, k) in (0..m).flat_map(|i| (0..n).map(move |k| (i, k))) {
            let [a, b] = [first + i * (n + 1) + k, first + (i + 1) * (n + 1) + k];
            triangles.extend([[a, a + 1, b], [b, a + 1, b + 1]]);
        }
        self
    }

    /// A box.
    fn block(self, centre: [f64; 3], size: [f64; 3]) -> Self {
        let (c, half) = (DVec3::from(centre), DVec3::from(size) / 2.0);
        [DVec3::X, DVec3::Y, DVec3::Z].into_iter().flat_map(|w| [w, -w]).fold(self, |model, w| {
            let (u, v) = (w.zxy(), w.cross(w.zxy()));
            model.add([1, 1], |s, t| c + half * (w + (2.0 * s - 1.0) * u + (2.0 * t - 1.0) * v))
        })
    }

    /// A cone frustum along an axis, with its ends.
    fn disc(self, centre: [f64; 3], axis: DVec3, [from, to]: [f64; 2], height: f64) -> Self {
        let (u, v) = (axis.zxy(), axis.cross(axis.zxy()));
        self.add([3, 24], |s, t| {
            let (sin, cos) = (std::f64::consts::TAU * t).sin_cos();
            let radius = [0.0, from, to, 0.0][(3.0 * s).round() as usize];
            let along = if s < 0.5 { -0.5 } else { 0.5 };
            DVec3::from(centre) + radius * (cos * u + sin * v) + along * height * axis
        })
    }

    fn ball(self, centre: [f64; 3], radii: [f64; 3]) -> Self {
        self.add([16, 32], |s, t| {
            let (sin, cos) = (std::f64::consts::PI * s).sin_cos();
            let (sin_t, cos_t) = (std::f64::consts::TAU * t).sin_cos();
            DVec3::from(centre) + DVec3::from(radii) * DVec3::new(sin * cos_t, cos, sin * sin_t)
        })
    }

    /// Four legs of a thickness below a rectangle of a width and a depth.
    fn legs(self, [width, height, depth]: [f64; 3], thick: f64) -> Self {
        corners().fold(self, |model, [x, z]| {
            let at = [x * (width - thick) / 2.0, height / 2.0, z * (depth - thick) / 2.0];
            model.block(at, [thick, height, thick])
        })
    }

    /// Pairs of wheels along z.
    fn wheels(self, along: &[f64], width: f64, radius: f64, thick: f64) -> Self {
        along
            .iter()
            .flat_map(|&z| [[-0.5, z], [0.5, z]])
            .fold(self, |model, [x, z]| model.disc([x * width, radius, z], DVec3::X, [radius; 2], thick))
    }

    /// The scene of the mesh in a file whose up axis is `up`.
    fn scene(&self, up: UpAxis) -> Scene {
        let mut mesh = self.0.clone();
        mesh.transform(&up.world_from_file().transpose());
        Scene::from_iter([Shape::Mesh(mesh)])
    }
}

fn corners() -> impl Iterator<Item = [f64; 2]> {
    [-1.0, 1.0].into_iter().flat_map(|x| [-1.0, 1.0].map(|z| [x, z]))
}

/// Furniture, vehicles, vessels, buildings and animals. The shapes of a few say little: a shelf and a mug with a lid
/// are nearly the same upside down, a boat does not stand on its keel.
fn models() -> Vec<(&'static str, Model)> {
    let new = Model::default;
    let (y, sides) = (DVec3::Y, [-1.0, 1.0]);
    let shelf = (0..5).fold(new(), |m, i| m.block([0.0, 0.02 + 0.4 * f64::from(i), 0.0], [0.8, 0.03, 0.3]));
    let stool = (0..3)
        .map(|i| (2.1 * f64::from(i)).sin_cos())
        .fold(new(), |m, (sin, cos)| m.disc([0.12 * cos, 0.3, 0.12 * sin], y, [0.02; 2], 0.6));
    let dog = corners().fold(new(), |m, [x, z]| m.disc([0.1 * x, 0.22, 0.28 * z], y, [0.04, 0.05], 0.45));
    let robot = sides.into_iter().fold(new(), |m, x| {
        let m =
            m.block([0.15 * x, 0.42, 0.0], [0.18, 0.84, 0.2]).block([0.4 * x, 1.15, 0.0], [0.14, 0.7, 0.16]);
        m.block([0.15 * x, 0.04, 0.06], [0.2, 0.08, 0.34])
    });
    let boat_side = |x: f64| {
        move |s: f64, t: f64| DVec3::new(x * (1.0 + 0.3 * t) * (1.0 - s), t + 0.2 * s, 7.0 * s - 3.0)
    };
    let boat = sides.into_iter().fold(new(), |m, x| m.add([1, 1], boat_side(x)));
    vec![
        ("table", new().block([0.0, 0.73, 0.0], [1.6, 0.04, 0.8]).legs([1.5, 0.71, 0.7], 0.06)),
        (
            "table with flush legs",
            new().block([0.0, 0.73, 0.0], [1.6, 0.04, 0.8]).legs([1.6, 0.71, 0.8], 0.06),
        ),
        (
            "chair",
            new()
                .block([0.0, 0.45, 0.0], [0.45, 0.04, 0.45])
                .block([0.0, 0.7, -0.2], [0.45, 0.46, 0.04])
                .legs([0.45, 0.43, 0.45], 0.04),
        ),
        ("stool", stool.disc([0.0, 0.6, 0.0], y, [0.18; 2], 0.04)),
        (
            "round table",
            new().disc([0.0, 0.72, 0.0], y, [0.5; 2], 0.04).disc([0.0, 0.35, 0.0], y, [0.04; 2], 0.7).disc(
                [0.0, 0.015, 0.0],
                y,
                [0.25; 2],
                0.03,
            ),
        ),
        (
            "sofa",
            new()
                .block([0.0, 0.2, 0.0], [2.0, 0.4, 0.9])
                .block([0.0, 0.6, -0.35], [2.0, 0.4, 0.2])
                .block([-0.9, 0.5, 0.1], [0.2, 0.2, 0.7])
                .block([0.9, 0.5, 0.1], [0.2, 0.2, 0.7]),
        ),
        (
            "bed",
            new()
                .block([0.0, 0.25, 0.0], [1.6, 0.3, 2.0])
                .block([0.0, 0.5, -1.0], [1.6, 1.0, 0.06])
                .legs([1.6, 0.1, 2.0], 0.08),
        ),
        ("shelf", shelf.block([-0.4, 0.8, 0.0], [0.03, 1.65, 0.3]).block([0.4, 0.8, 0.0], [0.03, 1.65, 0.3])),
        (
            "desk",
            new()
                .block([0.0, 0.73, 0.0], [1.4, 0.03, 0.7])
                .block([0.5, 0.36, 0.0], [0.35, 0.7, 0.65])
                .block([-0.68, 0.36, 0.0], [0.04, 0.7, 0.65]),
        ),
        (
            "lamp",
            new().disc([0.0, 0.02, 0.0], y, [0.15; 2], 0.04).disc([0.0, 0.4, 0.0], y, [0.015; 2], 0.75).disc(
                [0.0, 0.85, 0.0],
                y,
                [0.22, 0.12],
                0.25,
            ),
        ),
        (
            "bottle",
            new()
                .disc([0.0, 0.12, 0.0], y, [0.04; 2], 0.24)
                .disc([0.0, 0.26, 0.0], y, [0.04, 0.015], 0.04)
                .disc([0.0, 0.31, 0.0], y, [0.015; 2], 0.06),
        ),
        (
            "mug",
            new().disc([0.0, 0.05, 0.0], y, [0.04, 0.042], 0.1).block([0.06, 0.05, 0.0], [0.03, 0.06, 0.01]),
        ),
        ("tower", new().block([0.0, 10.0, 0.0], [8.0, 20.0, 6.0]).disc([0.0, 22.0, 0.0], y, [4.0, 0.1], 4.0)),
        ("tree", new().disc([0.0, 0.5, 0.0], y, [0.1; 2], 1.0).disc([0.0, 2.0, 0.0], y, [1.0, 0.05], 2.0)),
        (
            "car",
            new().block([0.0, 0.55, 0.0], [1.7, 0.5, 4.2]).block([0.0, 1.05, -0.2], [1.5, 0.5, 2.0]).wheels(
                &[-1.3, 1.3],
                1.6,
                0.33,
                0.2,
            ),
        ),
        (
            "truck",
            new().block([0.0, 1.2, 2.2], [2.2, 2.0, 1.6]).block([0.0, 1.6, -1.2], [2.4, 2.4, 5.0]).wheels(
                &[-3.0, -2.0, 2.2],
                2.2,
                0.5,
                0.3,
            ),
        ),
        ("bus", new().block([0.0, 1.7, 0.0], [2.5, 2.6, 11.0]).wheels(&[-3.5, 3.5], 2.3, 0.5, 0.3)),
        (
            "bicycle",
            new()
                .wheels(&[-0.5, 0.5], 0.0, 0.35, 0.04)
                .block([0.0, 0.6, 0.0], [0.04, 0.05, 0.9])
                .block([0.0, 0.95, 0.4], [0.5, 0.03, 0.03])
                .block([0.0, 0.9, -0.2], [0.15, 0.05, 0.25]),
        ),
        (
            "plane",
            new()
                .disc([0.0, 1.2, 0.0], DVec3::Z, [0.5; 2], 8.0)
                .block([0.0, 1.1, 0.5], [9.0, 0.12, 1.4])
                .block([0.0, 2.2, -3.7], [0.1, 1.6, 0.8])
                .block([0.0, 1.5, -3.7], [3.0, 0.1, 0.7])
                .wheels(&[0.2], 2.4, 0.3, 0.2)
                .wheels(&[3.0], 0.0, 0.25, 0.15),
        ),
        (
            "tractor",
            new()
                .block([0.0, 1.0, 0.6], [0.7, 0.7, 1.8])
                .block([0.0, 1.5, -0.7], [1.2, 1.5, 1.1])
                .wheels(&[-0.8], 1.8, 0.8, 0.4)
                .wheels(&[1.1], 1.4, 0.45, 0.25),
        ),
        ("boat", boat.block([0.0, 1.6, -1.0], [1.4, 1.2, 2.0]).block([0.0, 0.5, -2.95], [2.6, 1.0, 0.1])),
        ("robot", robot.block([0.0, 1.2, 0.0], [0.6, 0.7, 0.3]).ball([0.0, 1.75, 0.0], [0.2; 3])),
        (
            "dog",
            dog.ball([0.0, 0.55, 0.0], [0.16, 0.17, 0.4]).ball([0.0, 0.8, 0.42], [0.12, 0.13, 0.17]).disc(
                [0.0, 0.68, -0.45],
                y,
                [0.02, 0.03],
                0.25,
            ),
        ),
    ]
}

/// The guess finds the axis of at least two thirds of the models in files with another axis than y, and finds another
/// axis in one at most of those with y up.
#[test]
fn models_stand_upright() {
    let models = models();
    let found = |up: UpAxis| models.iter().map(move |(name, model)| (*name, axis(&model.scene(up))));
    let turned = CANDIDATES.into_iter().filter(|&up| up != UpAxis::Y);
    let missed: Vec<_> = turned
        .flat_map(|up| found(up).filter(move |(_, guess)| *guess != Some(up)).map(move |m| (up.name(), m)))
        .collect();
    assert!(missed.len() <= models.len(), "{} of {}: {missed:?}", missed.len(), 3 * models.len());
    let wrong: Vec<_> = found(UpAxis::Y).filter(|(_, up)| up.is_some_and(|up| up != UpAxis::Y)).collect();
    assert!(20 * wrong.len() <= models.len(), "{wrong:?}");
}

/// A box stands on any side.
#[test]
fn a_box_says_nothing() {
    let mut scene = pyramid(UpAxis::Z);
    scene.objects.extend(pyramid(UpAxis::Y).objects);
    assert_eq!(axis(&scene), None);
}
