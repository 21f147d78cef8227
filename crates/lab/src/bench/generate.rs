//! Generated meshes of any size, with different difficulties for acceleration structures.

use std::f64::consts::TAU;

use glam::{DVec3, Vec3};

use super::{Mesh, Numbers};

/// Kind of mesh.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Family {
    /// Closed sphere with bumps: small triangles of similar size, as in scans.
    Sphere,
    /// Overlapping triangles in a cube, with random positions and orientations.
    Soup,
    /// Thin tube in a helix: long, thin triangles that are not axis-aligned.
    Thin,
}

kiln::names!(Family { Sphere = "sphere", Soup = "soup", Thin = "thin" });

impl Family {
    /// A mesh with the nearest possible number of triangles; within 5 % from 1000 triangles on.
    pub fn mesh(self, triangles: usize) -> Mesh {
        match self {
            Family::Sphere => sphere(triangles),
            Family::Soup => soup(triangles),
            Family::Thin => thin(triangles),
        }
    }
}

/// An octahedron whose faces are subdivided into n * n triangles each, projected to a sphere and displaced: 8 n²
/// triangles.
fn sphere(triangles: usize) -> Mesh {
    let n = ((triangles as f64 / 8.0).sqrt().round() as i64).max(1);
    // A square of 2n by 2n cells is mapped to the octahedron: its corners coincide, as do the halves of each side.
    let side = 2 * n as usize + 1;
    let place = |x: i64, y: i64| (x + n) as usize + side * (y + n) as usize;
    let same = |x: i64, y: i64| match (x.abs() == n, y.abs() == n) {
        (true, true) => (n, n),
        (true, false) => (x, y.abs()),
        (false, true) => (x.abs(), y),
        (false, false) => (x, y),
    };
    let mut number = vec![u32::MAX; side * side];
    let mut mesh = Mesh::default();
    for y in -n..=n {
        for x in -n..=n {
            if same(x, y) == (x, y) {
                number[place(x, y)] = mesh.positions.len() as u32;
                mesh.positions.push(displaced(unfold(x as f64 / n as f64, y as f64 / n as f64)));
            }
        }
    }
    let vertex = |x: i64, y: i64| {
        let (x, y) = same(x, y);
        number[place(x, y)]
    };
    for y in -n..n {
        for x in -n..n {
            let [a, b, c, d] = [vertex(x, y), vertex(x + 1, y), vertex(x + 1, y + 1), vertex(x, y + 1)];
            // The diagonal is parallel to the fold.
            let along_fold = (x >= 0) == (y >= 0);
            mesh.triangles.extend(if along_fold { [[a, b, d], [b, c, d]] } else { [[a, b, c], [a, c, d]] });
        }
    }
    mesh
}

/// Octahedral map from the square to the unit sphere (Cigolle and others, A Survey of Efficient Representations for
/// Independent Unit Vectors, 2014).
fn unfold(x: f64, y: f64) -> DVec3 {
    let z = 1.0 - x.abs() - y.abs();
    let sign = |v: f64| if v < 0.0 { -1.0 } else { 1.0 };
    let (x, y) = if z < 0.0 { ((1.0 - y.abs()) * sign(x), (1.0 - x.abs()) * sign(y)) } else { (x, y) };
    DVec3::new(x, y, z).normalize()
}

/// Radial displacement of a point of the unit sphere by up to a quarter: six octaves of waves.
fn displaced(point: DVec3) -> Vec3 {
    let mut height = 0.0;
    for octave in 0..6 {
        let p = point * 2.5 * f64::from(1 << octave) + f64::from(octave);
        height += 0.125 / f64::from(1 << octave) * (p.x.sin() * p.y.cos() + p.y.sin() * p.z.cos()) / 1.5;
    }
    (point * (1.0 + height)).as_vec3()
}

/// Triangles in the unit cube, with edges of about two thirds of the average distance between triangles.
fn soup(triangles: usize) -> Mesh {
    let triangles = triangles.max(1);
    let reach = 0.5 / (triangles as f64).cbrt();
    let mut mesh = Mesh::default();
    for index in 0..triangles {
        let mut numbers = Numbers::new(20, index as u64);
        let centre = DVec3::new(numbers.unit(), numbers.unit(), numbers.unit());
        let first = mesh.positions.len() as u32;
        mesh.positions.extend([(); 3].map(|()| (centre + reach * numbers.in_ball()).as_vec3()));
        mesh.triangles.push([first, first + 1, first + 2]);
    }
    mesh
}

/// Number of sides of the tube.
const SIDES: usize = 8;

/// An eight-sided tube in a helix of radius 1 and height 2, with a pitch of 2.5 tube diameters. The tube radius is
/// chosen such that the triangles are twenty times as long as wide for any number of triangles: with 16 triangles per
/// ring, n have the length `n / 16 * 20 * (2 * pi * radius / 8)`, which is that of `0.4 / radius` turns of length `2 *
/// pi`.
fn thin(triangles: usize) -> Mesh {
    let rings = (triangles / (2 * SIDES)).max(1);
    let radius = (0.4 * 8.0 / 20.0 / rings as f64).sqrt();
    let turns = 0.4 / radius;
    let mut mesh = Mesh::default();
    for ring in 0..=rings {
        let along = ring as f64 / rings as f64;
        let (sine, cosine) = (turns * TAU * along).sin_cos();
        let out = DVec3::new(cosine, 0.0, sine);
        let centre = out + DVec3::Y * (2.0 * along - 1.0);
        for side in 0..SIDES {
            let (across, up) = (TAU * side as f64 / SIDES as f64).sin_cos();
            mesh.positions.push((centre + radius * (up * out + across * DVec3::Y)).as_vec3());
        }
    }
    for ring in 0..rings {
        for side in 0..SIDES {
            let at = |ring: usize, side: usize| (ring * SIDES + side % SIDES) as u32;
            let [a, b] = [at(ring, side), at(ring, side + 1)];
            let [c, d] = [at(ring + 1, side + 1), at(ring + 1, side)];
            mesh.triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    mesh
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_close_to_the_requested_ones() {
        for family in Family::ALL {
            for asked in [1000usize, 10_000, 100_000] {
                let mesh = family.mesh(asked);
                let share = mesh.triangles.len() as f64 / asked as f64;
                assert!((0.95..1.05).contains(&share), "{family:?} {asked}: {share}");
                let real = (0..mesh.triangles.len() as u32).filter(|&id| mesh.normal(id).length() > 0.0);
                assert_eq!(real.count(), mesh.triangles.len(), "{family:?}: a triangle without area");
            }
        }
    }

    #[test]
    fn the_sphere_is_closed_and_displaced() {
        let mesh = Family::Sphere.mesh(3200);
        // 8 * 20², and Euler's formula for a closed surface: V = 2 + F / 2.
        assert_eq!((mesh.triangles.len(), mesh.positions.len()), (3200, 1602));
        assert!(mesh.is_closed());
        let radii = || mesh.positions.iter().map(|p| p.length());
        assert!(radii().fold(f32::INFINITY, f32::min) < 0.9 && radii().fold(0.0, f32::max) > 1.1);
    }

    #[test]
    fn triangles_of_the_tube_are_long() {
        let mesh = Family::Thin.mesh(16_000);
        let longest = |id: u32| {
            let [a, b, c] = mesh.corners(id).map(|corner| corner.as_dvec3());
            [a - b, b - c, c - a].map(DVec3::length).into_iter().fold(0.0, f64::max)
        };
        for id in 0..mesh.triangles.len() as u32 {
            let height = mesh.normal(id).length() / longest(id);
            assert!(longest(id) > 10.0 * height, "{id}: {} by {height}", longest(id));
        }
    }
}
