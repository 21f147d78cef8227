//! Rays for leak tests: at vertices and edges, along the axes, and at random.

use glam::DVec3;

use super::{Icosphere, Numbers};

/// Origin and target of a ray of the leak test.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LeakRayKind {
    /// From inside; one third each at vertices, edge midpoints and other points on edges.
    Inside,
    /// From inside along an axis, with zeros of both signs: half through random points, half through vertices.
    AxisAligned,
    /// From outside, at the same kinds of targets on front faces.
    Outside,
    /// From inside in a random direction, uniform on the sphere.
    Random,
}

impl LeakRayKind {
    /// All kinds.
    pub const ALL: [LeakRayKind; 4] =
        [LeakRayKind::Inside, LeakRayKind::AxisAligned, LeakRayKind::Outside, LeakRayKind::Random];
}

/// Maximum distance of ray origins inside from the centre, relative to the radius.
const MAX_INSIDE_RADIUS: f64 = 0.3;

/// Range of the distance of ray origins outside from the centre, in radii.
const OUTSIDE: [f64; 2] = [2.0, 4.0];

/// Minimum cosine of the angle of incidence of rays from outside.
const MIN_COSINE: f64 = 0.1;

/// Origin and direction of ray `index` of `kind`. The origin has f32 values, so that it is the same in all engines; the
/// direction is in f64, and rounded by the engines.
pub fn ray(sphere: &Icosphere, kind: LeakRayKind, index: u64) -> (DVec3, DVec3) {
    let mut numbers = Numbers::new(kind as u64, index);
    match kind {
        LeakRayKind::Inside => {
            let target = target(sphere, index, &mut numbers);
            aimed(inner_point(sphere, &mut numbers), target)
        }
        LeakRayKind::AxisAligned => axis_aligned(sphere, index, &mut numbers),
        LeakRayKind::Outside => from_outside(sphere, index, &mut numbers),
        LeakRayKind::Random => {
            let origin = inner_point(sphere, &mut numbers);
            // The direction of a point uniform in a ball is uniform on the sphere.
            (origin, numbers.in_ball().normalize_or(DVec3::X))
        }
    }
}

fn inner_point(sphere: &Icosphere, numbers: &mut Numbers) -> DVec3 {
    round(sphere.placement.centre + MAX_INSIDE_RADIUS * sphere.placement.radius * numbers.in_ball())
}

/// A vertex, an edge midpoint or another point on an edge, in turn.
fn target(sphere: &Icosphere, index: u64, numbers: &mut Numbers) -> DVec3 {
    let mesh = &sphere.mesh;
    if index.is_multiple_of(3) {
        return mesh.positions[numbers.below(mesh.positions.len())].as_dvec3();
    }
    let corners = mesh.corners(numbers.below(mesh.triangles.len()) as u32);
    let first = numbers.below(3);
    let [from, to] = [corners[first], corners[(first + 1) % 3]].map(|corner| corner.as_dvec3());
    from.lerp(to, if index % 3 == 1 { 0.5 } else { numbers.unit() })
}

fn axis_aligned(sphere: &Icosphere, index: u64, numbers: &mut Numbers) -> (DVec3, DVec3) {
    let mut origin = inner_point(sphere, numbers);
    let mut axis = numbers.below(3);
    if index.is_multiple_of(2) {
        // Along the axis of the vertex's largest coordinate, so that the distance of the ray from the centre is at most
        // sqrt(2/3) of the radius.
        let vertex = sphere.mesh.positions[numbers.below(sphere.mesh.positions.len())].as_dvec3();
        axis = (vertex - sphere.placement.centre).abs().max_position();
        let along = origin[axis];
        origin = vertex;
        origin[axis] = along;
    }
    let mut direction = DVec3::new(numbers.sign(), numbers.sign(), numbers.sign()) * 0.0;
    direction[axis] = numbers.sign();
    (origin, direction)
}

fn from_outside(sphere: &Icosphere, index: u64, numbers: &mut Numbers) -> (DVec3, DVec3) {
    let (centre, radius) = (sphere.placement.centre, sphere.placement.radius);
    let target = target(sphere, index, numbers);
    let outwards = (target - centre).normalize();
    // The angle between a triangle and the sphere in radians is below the longest edge.
    let least_cosine = MIN_COSINE + sphere.longest_edge;
    let start = |direction: DVec3, numbers: &mut Numbers| {
        let [near, far] = OUTSIDE;
        round(centre + radius * (near + (far - near) * numbers.unit()) * direction)
    };
    // About a third of all origins face the target, so that one is practically always found.
    for _ in 0..64 {
        let direction = numbers.direction();
        let origin = start(direction, numbers);
        if (origin - target).normalize().dot(outwards) > least_cosine {
            return aimed(origin, target);
        }
    }
    aimed(start(outwards, numbers), target)
}

fn aimed(origin: DVec3, target: DVec3) -> (DVec3, DVec3) {
    (origin, (target - origin).normalize())
}

/// Rounds to f32.
fn round(v: DVec3) -> DVec3 {
    v.as_vec3().as_dvec3()
}

#[cfg(test)]
mod tests {
    use std::collections::HashSet;

    use super::super::PLACEMENTS;
    use super::*;

    fn each_ray(mut check: impl FnMut(&Icosphere, LeakRayKind, DVec3, DVec3)) {
        for placement in PLACEMENTS {
            let sphere = Icosphere::new(2, placement);
            for kind in LeakRayKind::ALL {
                for index in 0..3000 {
                    let (origin, direction) = ray(&sphere, kind, index);
                    check(&sphere, kind, origin, direction);
                }
            }
        }
    }

    #[test]
    fn directions_have_length_one() {
        each_ray(|sphere, kind, _, direction| {
            assert!((direction.length() - 1.0).abs() < 1e-15, "{}, {kind:?}", sphere.placement.name);
        });
    }

    #[test]
    fn rays_start_on_their_side() {
        each_ray(|sphere, kind, origin, _| {
            let distance = origin.distance(sphere.placement.centre) / sphere.placement.radius;
            // The facets of 320 triangles come no nearer to the centre than 0.95 of the radius. Rounding an origin at
            // 2000 to f32 moves it by up to 1.1e-4.
            let right = match kind {
                LeakRayKind::Inside | LeakRayKind::Random => distance < 0.3002,
                LeakRayKind::AxisAligned => distance < 0.9,
                LeakRayKind::Outside => (1.9998..4.0002).contains(&distance),
            };
            assert!(right, "{}, {kind:?}: {distance}", sphere.placement.name);
        });
    }

    #[test]
    fn axis_aligned_rays_have_every_pattern_of_signs() {
        let mut patterns = HashSet::new();
        each_ray(|_, kind, _, direction| {
            if kind == LeakRayKind::AxisAligned {
                assert_eq!(direction.abs().element_sum(), 1.0);
                patterns.insert(direction.to_array().map(f64::to_bits));
            }
        });
        // Three axes, three signs.
        assert_eq!(patterns.len(), 3 * 8);
    }

    #[test]
    fn rays_from_outside_meet_no_triangle_at_a_grazing_angle() {
        let sphere = Icosphere::new(2, PLACEMENTS[0]);
        for index in 0..3000 {
            let (origin, direction) = ray(&sphere, LeakRayKind::Outside, index);
            let met = (0..sphere.mesh.triangles.len() as u32).filter(|&triangle| {
                // Those whose corners are all within an edge's length of the ray's first meeting with the unit sphere.
                let b = origin.dot(direction);
                let t = -b - (b * b - origin.length_squared() + 1.0).max(0.0).sqrt();
                let near = |corner: &glam::Vec3| {
                    corner.as_dvec3().distance(origin + t * direction) < sphere.longest_edge
                };
                sphere.mesh.corners(triangle).iter().all(near)
            });
            for triangle in met {
                let cosine = -sphere.mesh.normal(triangle).normalize().dot(direction);
                assert!(cosine > 0.0, "ray {index}, triangle {triangle}: {cosine}");
            }
        }
    }
}
