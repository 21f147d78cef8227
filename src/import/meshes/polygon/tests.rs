//! Tests of `polygon`.

use crate::import::meshes::polygon::*;

fn area_of(corners: &[DVec3]) -> (f64, usize, Cut) {
    let (mut area, mut count) = (0.0, 0);
    let cut = Triangulator::new().triangulate(corners, |[a, b, c]| {
        area += (corners[b] - corners[a]).cross(corners[c] - corners[a]).length() / 2.0;
        count += 1;
    });
    (area, count, cut)
}

/// Tilted out of every axis plane, so that the projection is exercised.
fn tilted(flat: &[[f64; 2]]) -> Vec<DVec3> {
    let (u, v) = (DVec3::new(2.0, 1.0, 2.0) / 3.0, DVec3::new(-2.0, 2.0, 1.0) / 3.0);
    flat.iter().map(|[x, y]| *x * u + *y * v + DVec3::new(5.0, -3.0, 1.0)).collect()
}

#[test]
fn a_convex_quad_is_cut_from_its_first_corner() {
    let mut triangles = Vec::new();
    let quad = tilted(&[[0., 0.], [1., 0.], [1., 1.], [0., 1.]]);
    assert_eq!(Triangulator::new().triangulate(&quad, |t| triangles.push(t)), Cut::Whole);
    assert_eq!(triangles, [[0, 1, 2], [0, 2, 3]]);
}

/// Corners on a circle, every other one at `inner` of its radius.
fn star(corners: usize, inner: f64) -> Vec<[f64; 2]> {
    let corner = |i: usize| {
        let (angle, radius) = (
            i as f64 / corners as f64 * std::f64::consts::TAU,
            if i.is_multiple_of(2) { inner } else { 1.0 },
        );
        [radius * angle.cos(), radius * angle.sin()]
    };
    (0..corners).map(corner).collect()
}

#[test]
fn polygons_of_many_corners_keep_their_area() {
    // Between two neighbours the triangle from the centre has the area inner * sin(2 pi / n) / 2.
    let n = 20_000;
    for inner in [1.0, 0.5] {
        let expected = n as f64 * inner * (std::f64::consts::TAU / n as f64).sin() / 2.0;
        let (area, count, cut) = area_of(&tilted(&star(n, inner)));
        assert!((area - expected).abs() < 1e-9 * expected, "{area} is not {expected}");
        assert_eq!((count, cut), (n - 2, Cut::Whole));
    }
    // A comb of 10,001 teeth, 2 wide at the foot, on a back of height 1, at any angle: a tooth of height h and its
    // back have area 2 + h. Long teeth at an angle overlap along x as well as along y.
    let teeth = 10_001;
    for (height, angle) in [(9.0, 0.0), (9.0, 1.6), (1e5, 0.6)] {
        let mut comb: Vec<[f64; 2]> =
            (0..=2 * teeth).map(|i| [f64::from(i), if i % 2 == 0 { 1.0 } else { 1.0 + height }]).collect();
        comb.extend([[2.0 * f64::from(teeth), 0.0], [0.0, 0.0]]);
        let turn = |p: [f64; 2]| DVec2::from_angle(angle).rotate(p.into()).to_array();
        let (area, _, cut) = area_of(&tilted(&comb.into_iter().map(turn).collect::<Vec<_>>()));
        let expected = f64::from(teeth) * (2.0 + height);
        assert!((area - expected).abs() < 1e-9 * expected, "{area} is not {expected}");
        assert_eq!(cut, Cut::Whole, "{height}, {angle}");
    }
}

#[test]
fn polygons_with_non_finite_corners_are_not_reported_as_crossing() {
    for n in [4, 5, 100] {
        let mut corners: Vec<DVec3> =
            (0..n).map(|i| DVec3::new(f64::from(i), f64::from(i * i), 0.0)).collect();
        corners[2].x = f64::NAN;
        let mut count = 0;
        assert_eq!(Triangulator::new().triangulate(&corners, |_| count += 1), Cut::Whole);
        assert_eq!(count, n - 2);
    }
}

/// A square of side 99 with 32 x 32 square holes of side 1. Each is connected by a bridge from the previous hole,
/// passed once in each direction, so that bridges follow each other along a row.
#[test]
fn bridges_to_holes_are_no_crossings() {
    let mut corners = vec![[0.0, 0.0]];
    for row in 0..32 {
        let y = f64::from(row) * 3.0 + 1.0;
        corners.push([0.0, y]);
        let hole = |column: i32| f64::from(column) * 3.0 + 1.0;
        for x in (0..32).map(hole) {
            corners.extend([[x, y], [x, y + 1.0], [x + 1.0, y + 1.0], [x + 1.0, y]]);
        }
        for x in (0..32).map(hole).rev() {
            corners.extend([[x + 1.0, y], [x, y]]);
        }
        corners.push([0.0, y]);
    }
    corners.extend([[0.0, 99.0], [99.0, 99.0], [99.0, 0.0]]);
    assert_eq!(find_crossing(&corners), Cut::Whole);
}

#[test]
fn what_would_take_cubic_time_is_cut_into_a_fan_at_once() {
    // Round one triangle 20,000 times; the same with corners that differ in their last digits; random corners.
    let triangle = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]];
    let mut state = 1u64;
    let mut next = || {
        // Steele and Vigna's multiplier for 64 bits (2021); the upper bits are the random ones.
        state = state.wrapping_mul(0xd134_2543_de82_ef95).wrapping_add(1);
        (state >> 11) as f64 / (1u64 << 53) as f64
    };
    let round: Vec<_> = (0..60_000).map(|i| triangle[i % 3]).collect();
    let near: Vec<_> = round.iter().map(|p| p.map(|c| c + 1e-13 * next())).collect();
    let anywhere: Vec<_> = (0..9000).map(|_| [next(), next()]).collect();
    let start = std::time::Instant::now();
    for corners in [round, near, anywhere, vec![[0.5, 0.5]; 9000]] {
        let (_, count, cut) = area_of(&tilted(&corners));
        assert_eq!((count, cut), (corners.len() - 2, Cut::SelfIntersecting));
    }
    assert!(start.elapsed().as_secs() < 20, "{:?}", start.elapsed());
}
