//! Scenes with extreme or invalid input, rendered in every tier, and the properties that every picture must have.

use std::path::PathBuf;

use glam::DVec3;
use kiln::error::{Error, Warnings};
use kiln::film::Film;
use kiln::scene::{Camera, Numerics, Projection, Scene, Sensor};

use super::Numbers;
use super::picture::{Prepared, equip, prepare};

/// The tiers through whose closed meshes no ray slips.
pub const TIGHT: [Numerics; 3] = [Numerics::Watertight, Numerics::Double, Numerics::Exact];

/// A folder of input files that goes when the test ends.
pub struct Folder(pub tempfile::TempDir);

impl Folder {
    pub fn new() -> Self {
        Folder(tempfile::tempdir().expect("a temporary folder can be made"))
    }

    pub fn write(&self, name: &str, bytes: impl AsRef<[u8]>) -> PathBuf {
        let file = self.0.path().join(name);
        std::fs::write(&file, bytes).expect("the temporary folder can be written to");
        file
    }

    /// What a file becomes, and the warnings without the folder before their files.
    pub fn load(&self, name: &str, bytes: impl AsRef<[u8]>) -> (Scene, Vec<String>) {
        let (result, warnings) = self.read(name, bytes);
        (result.unwrap_or_else(|e| panic!("{name}: {e}")), warnings)
    }

    /// The error of a file that cannot be used.
    #[track_caller]
    pub fn fails(&self, name: &str, bytes: impl AsRef<[u8]>) -> Error {
        let e = self.read(name, bytes).0.err();
        let e = e.unwrap_or_else(|| panic!("{name} was read, though it is broken"));
        assert!(matches!(e, Error::Input { .. }), "{e:?}");
        e
    }

    fn read(&self, name: &str, bytes: impl AsRef<[u8]>) -> (Result<Scene, Error>, Vec<String>) {
        let mut warnings = Warnings::default();
        let result = kiln::import::load(&[self.write(name, bytes)], &mut warnings);
        let folder = format!("{}/", self.0.path().display());
        (result, warnings.messages().iter().map(|m| m.replace(&folder, "")).collect())
    }
}

/// A scene in the form of a scene file.
pub fn scene(toml: &str) -> Scene {
    let (scene, warnings) = Folder::new().load("scene.toml", toml);
    assert_eq!(warnings, [""; 0], "{toml}");
    scene
}

/// A camera with a square viewing rectangle of the given side.
pub fn camera(position: DVec3, target: DVec3, projection: Projection, side: f64, distance: f64) -> Camera {
    Camera {
        name: "test".into(),
        position,
        target,
        up: DVec3::Y,
        projection,
        view_height: side,
        view_width: Some(side),
        viewpoint_distance: distance,
        lens: None,
        sensor: Sensor::default(),
        fitted: false,
    }
}

/// The film of a scene, held to what every picture owes: numbers, none of them infinite or below 0.
#[track_caller]
pub fn sound(prepared: &Prepared) -> Film {
    let (film, _) = prepared.render(Default::default());
    assert_sound(&film, prepared.world.numerics());
    film
}

#[track_caller]
pub fn assert_sound(film: &Film, numerics: Numerics) {
    let bad = film.rows().enumerate().find(|(_, pixel)| !pixel.iter().all(|c| c.is_finite() && *c >= 0.0));
    if let Some((index, pixel)) = bad {
        let width = film.window().width as usize;
        panic!("{}: pixel ({}, {}) is {pixel:?}", numerics.name(), index % width, index / width);
    }
}

/// A scene made ready in every tier, from the least to the most, with a camera and a light where it has none.
pub fn tiers(scene: &Scene, size: [u32; 2]) -> [Prepared; 4] {
    let mut scene = scene.clone();
    equip(&mut scene);
    Numerics::ALL.map(|numerics| prepare(scene.clone(), size, numerics))
}

/// The sound films of a scene in every tier, from the least to the most.
#[track_caller]
pub fn films(scene: &Scene, size: [u32; 2]) -> [Film; 4] {
    tiers(scene, size).map(|prepared| sound(&prepared))
}

/// The unit cube, two triangles a side, as in a scene file.
pub const CUBE: &str = "[[triangles]]\n\
    vertices = [[0,0,0], [1,0,0], [0,1,0], [1,1,0], [0,0,1], [1,0,1], [0,1,1], [1,1,1]]\n\
    indices = [[0,1,3], [0,3,2], [4,5,7], [4,7,6], [0,1,5], [0,5,4], [2,3,7], [2,7,6], [0,2,6], [0,6,4], [1,3,7], [1,7,5]]\n";

/// Heights of a field of 8 x 8 cells of side 8, whole and at most 8.
fn heights() -> Vec<Vec<i64>> {
    let mut numbers = Numbers::new(5);
    (0..9).map(|_| (0..9).map(|_| numbers.below(9) as i64).collect()).collect()
}

/// The field's triangles: two a cell, in one diagonal or the other.
pub fn field() -> Vec<[[i64; 3]; 3]> {
    let heights = heights();
    let corner = |x: usize, y: usize| [8 * x as i64, 8 * y as i64, heights[y][x]];
    let cell = |(x, y): (usize, usize)| {
        let [a, b, c, d] = [corner(x, y), corner(x + 1, y), corner(x + 1, y + 1), corner(x, y + 1)];
        if (x + y) % 2 == 0 { [[a, b, c], [a, c, d]] } else { [[a, b, d], [b, c, d]] }
    };
    (0..64).map(|i| (i % 8, i / 8)).flat_map(cell).collect()
}

/// The triangle under a point of the field given in halves, and twice the depth of the field below 16 there times its
/// divisor: least depth, then lowest number, in whole numbers throughout.
pub fn under(field: &[[[i64; 3]; 3]], x: i64, y: i64) -> Option<(u32, f64)> {
    let mut best: Option<(u32, i64, i64)> = None;
    for (id, corners) in (0..).zip(field) {
        let doubled = corners.map(|[cx, cy, cz]| [2 * cx - x, 2 * cy - y, 2 * (16 - cz)]);
        let [a, b, c] = doubled;
        let edge = |p: [i64; 3], q: [i64; 3]| p[0] * q[1] - p[1] * q[0];
        let weights = [edge(b, c), edge(c, a), edge(a, b)];
        // Wound counter-clockwise as seen from above, so no weight is below 0 inside.
        let sum: i64 = weights.iter().sum();
        if weights.iter().all(|w| *w >= 0) && sum > 0 {
            let depth = weights[0] * a[2] + weights[1] * b[2] + weights[2] * c[2];
            if best.is_none_or(|(_, d, s)| depth * s < d * sum) {
                best = Some((id, depth, sum));
            }
        }
    }
    best.map(|(id, depth, sum)| (id, depth as f64 / (2 * sum) as f64))
}
