//! Closed meshes: a subdivided icosahedron in several sizes and positions.

use std::collections::HashMap;

use glam::{DVec3, Vec3};

/// Indexed triangle mesh.
#[derive(Debug, Clone, Default)]
pub struct Mesh {
    /// The vertices.
    pub positions: Vec<Vec3>,
    /// Vertex indices of every triangle, counter-clockwise from outside.
    pub triangles: Vec<[u32; 3]>,
}

impl Mesh {
    /// Vertices of a triangle.
    pub fn corners(&self, triangle: u32) -> [Vec3; 3] {
        self.triangles[triangle as usize].map(|index| self.positions[index as usize])
    }

    /// Whether every edge has its opposite, exactly once.
    #[cfg(test)]
    pub(crate) fn is_closed(&self) -> bool {
        let edges = || self.triangles.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]);
        let distinct: std::collections::HashSet<[u32; 2]> = edges().collect();
        distinct.len() == edges().count() && edges().all(|[a, b]| distinct.contains(&[b, a]))
    }

    /// Outward normal of a triangle, computed in f64; its length is twice the area.
    pub fn normal(&self, triangle: u32) -> DVec3 {
        let [a, b, c] = self.corners(triangle).map(|corner| corner.as_dvec3());
        (b - a).cross(c - a)
    }
}

/// Position and size of a sphere.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Placement {
    /// Name of the placement.
    pub name: &'static str,
    /// Centre.
    pub centre: DVec3,
    /// Radius.
    pub radius: f64,
}

/// At the origin, far from it for the size, very small, and very large.
pub const PLACEMENTS: [Placement; 4] = [
    Placement { name: "unit", centre: DVec3::ZERO, radius: 1.0 },
    Placement { name: "moved", centre: DVec3::new(1000.0, -500.0, 2000.0), radius: 1.0 },
    Placement { name: "size 1e-5", centre: DVec3::ZERO, radius: 1e-5 },
    Placement { name: "size 1e5", centre: DVec3::ZERO, radius: 1e5 },
];

/// A closed mesh of 20 * 4^level triangles over a sphere.
#[derive(Debug, Clone)]
pub struct Icosphere {
    /// The triangles.
    pub mesh: Mesh,
    /// Position and size.
    pub placement: Placement,
    /// Longest edge of a triangle relative to the radius.
    pub longest_edge: f64,
}

impl Icosphere {
    /// Subdivides in f64 on the unit sphere, then scales, translates and rounds to f32.
    pub fn new(level: u32, placement: Placement) -> Self {
        let (mut points, mut triangles) = icosahedron();
        for _ in 0..level {
            triangles = subdivide(&mut points, &triangles);
        }
        let edges = triangles.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]);
        let lengths = edges.map(|ends| {
            let [from, to] = ends.map(|end| points[end as usize]);
            from.distance(to)
        });
        let longest_edge = lengths.fold(0.0, f64::max);
        let placed = |point: &DVec3| (placement.centre + placement.radius * point).as_vec3();
        let positions = points.iter().map(placed).collect();
        Icosphere { mesh: Mesh { positions, triangles }, placement, longest_edge }
    }
}

/// The twelve vertices (0, ±1, ±φ), (±1, ±φ, 0), (±φ, 0, ±1), normalised, and the triangles between adjacent ones.
fn icosahedron() -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let golden = (1.0 + 5.0f64.sqrt()) / 2.0;
    let mut points = Vec::new();
    for one in [-1.0, 1.0] {
        for long in [-golden, golden] {
            points.push(DVec3::new(0.0, one, long));
            points.push(DVec3::new(one, long, 0.0));
            points.push(DVec3::new(long, 0.0, one));
        }
    }
    // Edges have length 2 here; the next larger distance between vertices is 2φ.
    let near = |a: usize, b: usize| points[a].distance(points[b]) < 1.0 + golden;
    let mut triangles = Vec::new();
    for a in 0..points.len() {
        for b in a + 1..points.len() {
            for c in b + 1..points.len() {
                if near(a, b) && near(b, c) && near(c, a) {
                    let outwards = points[a].cross(points[b]).dot(points[c]) > 0.0;
                    triangles.push(if outwards { [a, b, c] } else { [a, c, b] }.map(|i| i as u32));
                }
            }
        }
    }
    for point in &mut points {
        *point = point.normalize();
    }
    (points, triangles)
}

/// Splits each triangle into four, with a new vertex on the sphere for every edge, shared by both triangles.
fn subdivide(points: &mut Vec<DVec3>, triangles: &[[u32; 3]]) -> Vec<[u32; 3]> {
    let mut middles = HashMap::new();
    let mut middle = |a: u32, b: u32| {
        *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
            points.push((points[a as usize] + points[b as usize]).normalize());
            points.len() as u32 - 1
        })
    };
    triangles
        .iter()
        .flat_map(|&[a, b, c]| {
            let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
            [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use std::collections::HashSet;

    use super::*;

    #[test]
    fn spheres_are_closed() {
        for placement in PLACEMENTS {
            let mesh = Icosphere::new(4, placement).mesh;
            assert_eq!(mesh.triangles.len(), 20 * 4usize.pow(4));
            // Euler's formula for a closed surface without holes: V - E + F = 2, with 3/2 F edges.
            assert_eq!(mesh.positions.len(), 2 + mesh.triangles.len() / 2);
            assert!(mesh.is_closed(), "{}", placement.name);
        }
    }

    #[test]
    fn a_missing_or_repeated_triangle_is_noticed() {
        let Mesh { positions, triangles } = Icosphere::new(0, PLACEMENTS[0]).mesh;
        let mesh =
            |triangles: &[[u32; 3]]| Mesh { positions: positions.clone(), triangles: triangles.to_vec() };
        assert!(!mesh(&triangles[1..]).is_closed());
        assert!(!mesh(&[&triangles[..], &triangles[..1]].concat()).is_closed());
    }

    #[test]
    fn vertices_stay_apart_and_triangles_face_outwards() {
        for placement in PLACEMENTS {
            let mesh = Icosphere::new(6, placement).mesh;
            assert_eq!(mesh.triangles.len(), 81_920);
            let distinct: HashSet<[u32; 3]> =
                mesh.positions.iter().map(|p| p.to_array().map(f32::to_bits)).collect();
            assert_eq!(distinct.len(), mesh.positions.len(), "{}", placement.name);
            for triangle in 0..mesh.triangles.len() as u32 {
                let outwards = mesh.corners(triangle)[0].as_dvec3() - placement.centre;
                let cosine = mesh.normal(triangle).normalize().dot(outwards.normalize());
                assert!(cosine > 0.99, "{}: triangle {triangle}: {cosine}", placement.name);
            }
        }
    }

    #[test]
    fn the_longest_edge_is_that_of_the_icosahedron_at_first() {
        // 1 / sin(2π/5) of the radius.
        let edge = Icosphere::new(0, PLACEMENTS[0]).longest_edge;
        assert!((edge - 1.0 / (0.4 * std::f64::consts::PI).sin()).abs() < 1e-15);
    }
}
