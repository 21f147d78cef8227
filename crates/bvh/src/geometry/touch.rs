//! Whether triangles, or a triangle and a box, have a point in common: exactly, borders included.
//!
//! All decisions are signs of determinants of coordinates, in f64 with an error bound, then by expansions
//! ([`super::expansion`]). The triangles must have an area.

use glam::{DVec3, Vec3Swizzles};

use super::expansion::Expansion;

/// On which side of the plane of a triangle a point is: 1 in front, from where the corners are counter-clockwise, -1
/// behind, 0 in the plane.
fn side_of_plane([a, b, c]: [DVec3; 3], d: DVec3) -> i32 {
    let [p, q, r] = [a - d, b - d, c - d];
    let volume = p.dot(q.cross(r));
    // u for each difference, for each product and for each sum: less than 10u of the sum of the products, u = 2^-53.
    let permanent = p.abs().dot(q.abs().yzx() * r.abs().zxy() + q.abs().zxy() * r.abs().yzx());
    if volume.abs() > 5.0 * f64::EPSILON * permanent {
        return if volume < 0.0 { 1 } else { -1 };
    }
    let from = |point: DVec3, k: usize| Expansion::difference(point[k], d[k]);
    let minor = |i: usize, j: usize| from(b, i) * from(c, j) - from(b, j) * from(c, i);
    -(from(a, 0) * minor(1, 2) + from(a, 1) * minor(2, 0) + from(a, 2) * minor(0, 1)).sign()
}

/// On which side of the line from a to b the point c is, seen along an axis: 1 if they are counter-clockwise where the
/// axis points to the eye, 0 on the line or for equal a and b.
fn side_of_line(axis: usize, a: DVec3, b: DVec3, c: DVec3) -> i32 {
    let (i, j) = ((axis + 1) % 3, (axis + 2) % 3);
    let (left, right) = ((b[i] - a[i]) * (c[j] - a[j]), (b[j] - a[j]) * (c[i] - a[i]));
    let area = left - right;
    // u for each difference, product and the sum: less than 5u of both products.
    if area.abs() > 3.0 * f64::EPSILON * (left.abs() + right.abs()) {
        return if area > 0.0 { 1 } else { -1 };
    }
    let from = |point: DVec3, k: usize| Expansion::difference(point[k], a[k]);
    (from(b, i) * from(c, j) - from(b, j) * from(c, i)).sign()
}

/// Whether some signs are positive and others negative.
fn differ(signs: [i32; 3]) -> bool {
    signs.contains(&1) && signs.contains(&-1)
}

/// Whether bounds overlap.
fn overlap(a: [DVec3; 2], b: [DVec3; 2]) -> bool {
    a[0].cmple(b[1]).all() && b[0].cmple(a[1]).all()
}

fn bounds(points: &[DVec3]) -> [DVec3; 2] {
    let none = [DVec3::INFINITY, DVec3::NEG_INFINITY];
    points.iter().fold(none, |[min, max], p| [min.min(*p), max.max(*p)])
}

/// The edges of a triangle.
fn edges([a, b, c]: [DVec3; 3]) -> [[DVec3; 2]; 3] {
    [[a, b], [b, c], [c, a]]
}

/// Whether two triangles have a common point: whether an edge of one meets the other.
pub(crate) fn triangles_meet(a: &[DVec3; 3], b: &[DVec3; 3]) -> bool {
    if !overlap(bounds(a), bounds(b)) {
        return false;
    }
    // Most pairs are apart because one is on one side of the plane of the other.
    let is_beside = |of: [DVec3; 3], other: &[DVec3; 3]| {
        let [p, q, r] = other.map(|corner| side_of_plane(of, corner));
        p != 0 && p == q && q == r
    };
    !is_beside(*a, b)
        && !is_beside(*b, a)
        && (edges(*a).into_iter().any(|edge| edge_meets(edge, *b))
            || edges(*b).into_iter().any(|edge| edge_meets(edge, *a)))
}

/// Whether a segment has a point in common with a triangle.
fn edge_meets([p, q]: [DVec3; 2], triangle: [DVec3; 3]) -> bool {
    match [p, q].map(|end| side_of_plane(triangle, end)) {
        [0, 0] => edge_in_plane_meets([p, q], triangle),
        [a, b] if a == b => false,
        // The line passes the plane once, within the segment, and the triangle if that is on one side of all edges.
        _ => !differ(edges(triangle).map(|[a, b]| side_of_plane([p, q, a], b))),
    }
}

/// The same for a segment in the plane of the triangle.
fn edge_in_plane_meets([p, q]: [DVec3; 2], triangle: [DVec3; 3]) -> bool {
    let [a, b, c] = triangle;
    // Seen along this axis, the triangle has an area.
    let Some(axis) = (0..3).find(|&axis| side_of_line(axis, a, b, c) != 0) else { return false };
    let is_inside = |point: DVec3| !differ(edges(triangle).map(|[a, b]| side_of_line(axis, a, b, point)));
    let crosses = |[a, b]: [DVec3; 2]| {
        let apart = |from, to, a, b| side_of_line(axis, from, to, a) * side_of_line(axis, from, to, b) > 0;
        // The bounds decide for segments of one line.
        !apart(p, q, a, b) && !apart(a, b, p, q) && overlap(bounds(&[p, q]), bounds(&[a, b]))
    };
    is_inside(p) || is_inside(q) || edges(triangle).into_iter().any(crosses)
}

/// Whether a triangle has a point in common with the box from `min` to `max`: whether no axis separates them of the
/// normals of both and the products of their edges (Gottschalk, Lin and Manocha, OBBTree, SIGGRAPH 1996).
pub(crate) fn triangle_meets_box(triangle: &[DVec3; 3], [min, max]: [DVec3; 2]) -> bool {
    if !overlap(bounds(triangle), [min, max]) {
        return false;
    }
    let corner = |i: usize| DVec3::select(glam::BVec3::new(i & 1 != 0, i & 2 != 0, i & 4 != 0), max, min);
    let side = side_of_plane(*triangle, corner(0));
    if side != 0 && (1..8).all(|i| side_of_plane(*triangle, corner(i)) == side) {
        return false;
    }
    let [a, b, c] = *triangle;
    for axis in 0..3 {
        let (i, j) = (1 << ((axis + 1) % 3), 1 << ((axis + 2) % 3));
        let of_box = [0, i, j, i + j].map(corner);
        for [from, to, third] in [[a, b, c], [b, c, a], [c, a, b]] {
            let [p, q, r, s] = of_box.map(|corner| side_of_line(axis, from, to, corner));
            // All of the box is strictly beyond the edge, and the triangle is not.
            if p != 0 && p == q && q == r && r == s && side_of_line(axis, from, to, third) != p {
                return false;
            }
        }
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A pseudorandom integer from 0 to 3: in so small a grid, most triangles touch, overlap or share planes.
    fn integer(seed: u64) -> i64 {
        let bits = (seed + 1).wrapping_mul(6_364_136_223_846_793_005);
        let bits = (bits ^ (bits >> 29)).wrapping_mul(1_442_695_040_888_963_407);
        ((bits ^ (bits >> 32)).wrapping_mul(6_364_136_223_846_793_005) >> 62) as i64
    }

    fn grid_triangle(seed: u64) -> [[i64; 3]; 3] {
        [0, 1, 2].map(|corner| [0, 1, 2].map(|axis| integer(9 * seed + 3 * corner + axis)))
    }

    /// Whether a plane separates the convex hulls of points strictly: one whose normal is the product of two
    /// differences of points, or in a common plane, one perpendicular to that and to a difference.
    fn apart(a: &[[i64; 3]], b: &[[i64; 3]]) -> bool {
        let minus = |p: [i64; 3], q: [i64; 3]| [p[0] - q[0], p[1] - q[1], p[2] - q[2]];
        let cross = |p: [i64; 3], q: [i64; 3]| {
            [p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]]
        };
        let dot = |p: [i64; 3], q: [i64; 3]| p[0] * q[0] + p[1] * q[1] + p[2] * q[2];
        let directions = |points: &[[i64; 3]]| -> Vec<[i64; 3]> {
            points
                .iter()
                .flat_map(|p| points.iter().map(move |q| (*p, *q)))
                .map(|(p, q)| minus(p, q))
                .collect()
        };
        let all: Vec<[i64; 3]> = [directions(a), directions(b)].concat();
        let mut axes = Vec::new();
        for p in &all {
            for q in &all {
                let axis = cross(*p, *q);
                axes.push(axis);
                axes.push(cross(axis, *p));
            }
        }
        axes.into_iter().any(|axis| {
            let range = |points: &[[i64; 3]]| {
                let along = points.iter().map(|p| dot(axis, *p));
                (along.clone().min(), along.max())
            };
            let ((least_a, most_a), (least_b, most_b)) = (range(a), range(b));
            most_a < least_b || most_b < least_a
        })
    }

    fn real(corners: &[[i64; 3]; 3]) -> [DVec3; 3] {
        corners.map(|corner| DVec3::from(corner.map(|x| x as f64)))
    }

    fn has_area(corners: &[[i64; 3]; 3]) -> bool {
        !crate::geometry::Triangle(real(corners)).is_degenerate()
    }

    /// Triangles of a small grid against separating planes in integers.
    #[test]
    fn triangles_meet_as_in_integers() {
        let (mut met, mut tested) = (0, 0);
        for seed in 0..4000 {
            // Half of them in the plane z = 0.
            let [a, b] = [2 * seed, 2 * seed + 1].map(|seed| {
                let mut corners = grid_triangle(seed);
                if seed % 4 < 2 {
                    corners.iter_mut().for_each(|corner| corner[2] = 0);
                }
                corners
            });
            if !has_area(&a) || !has_area(&b) {
                continue;
            }
            let expected = !apart(&a, &b);
            assert_eq!(triangles_meet(&real(&a), &real(&b)), expected, "{a:?} {b:?}");
            assert_eq!(triangles_meet(&real(&b), &real(&a)), expected, "{b:?} {a:?}");
            met += usize::from(expected);
            tested += 1;
        }
        assert!(met > 500 && tested - met > 500, "{met} of {tested}");
    }

    #[test]
    fn triangles_meet_boxes_as_in_integers() {
        let (mut met, mut tested) = (0, 0);
        for seed in 0..3000 {
            let triangle = grid_triangle(seed);
            if !has_area(&triangle) {
                continue;
            }
            let [min, size] = [1, 2].map(|k| [0, 1, 2].map(|axis| integer(90_000 * k + 3 * seed + axis)));
            let max = [0, 1, 2].map(|axis| min[axis] + size[axis] / 2);
            let corners: Vec<[i64; 3]> = (0..8)
                .map(|i| [0, 1, 2].map(|axis| if i >> axis & 1 != 0 { max[axis] } else { min[axis] }))
                .collect();
            let ends = [min, max].map(|p| DVec3::from(p.map(|x| x as f64)));
            let expected = !apart(&triangle, &corners);
            assert_eq!(triangle_meets_box(&real(&triangle), ends), expected, "{triangle:?} {ends:?}");
            met += usize::from(expected);
            tested += 1;
        }
        assert!(met > 300 && tested - met > 300, "{met} of {tested}");
    }

    /// One ulp decides where f64 rounds it away.
    #[test]
    fn the_last_bit_decides() {
        let far = 2f64.powi(40);
        let floor = [DVec3::new(far, far, 1.0), DVec3::new(-far, far, 1.0), DVec3::new(0.0, -far, 1.0)];
        let at = |z: f64| [DVec3::new(0.1, 0.2, z), DVec3::new(0.3, 0.1, 5.0), DVec3::new(-0.1, 0.4, 7.0)];
        assert!(triangles_meet(&floor, &at(1.0)) && triangles_meet(&floor, &at(1f64.next_down())));
        assert!(!triangles_meet(&floor, &at(1f64.next_up())));
        let slope = [DVec3::new(0.0, 0.0, 0.0), DVec3::new(3e10, 1e10, 1e10), DVec3::new(1e10, 3e10, 1e10)];
        // In its plane, since x + y = 4 z: at 0.4, 0.4 and 0.2 up to the rounding of these.
        let [x, z] = [0.4, 0.2];
        let on = |z: f64| [DVec3::new(x, x, z), DVec3::new(x, x, 1.0), DVec3::new(x + 0.1, x, 1.0)];
        assert!(triangles_meet(&slope, &on(z)) && !triangles_meet(&slope, &on(z.next_up())));
        assert!(triangle_meets_box(&slope, [DVec3::new(x, x, z), DVec3::splat(x)]));
        assert!(!triangle_meets_box(&slope, [DVec3::new(x, x, z.next_up()), DVec3::splat(x)]));
    }
}
