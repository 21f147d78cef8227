use std::f64::consts::TAU;

use glam::DMat4;

use super::*;
use crate::bvh::splitmix64::splitmix64;
use crate::bvh::{InsideRule, Preset, Primitive};
use crate::geometry::{Disk, Mesh, Numerics, Placed, Placement, Step, Triangle};

/// A number in [-1, 1).
fn number(seed: u64) -> f64 {
    splitmix64(seed) as f64 / 2f64.powi(63) - 1.0
}

fn point(seed: u64) -> DVec3 {
    DVec3::from([3 * seed, 3 * seed + 1, 3 * seed + 2].map(number))
}

/// Grids of squares of two triangles over faces of the cube from -1 to 1, with outward normals.
fn faces(of: impl IntoIterator<Item = usize>, squares: u32) -> Vec<Primitive> {
    let mut triangles = Vec::new();
    for face in of {
        let (axis, side) = (face / 2, if face % 2 == 0 { -1.0 } else { 1.0 });
        let corner = |i: u32, j: u32| {
            let [u, v] = [i, j].map(|k| f64::from(2 * k) / f64::from(squares) - 1.0);
            let mut at = DVec3::ZERO;
            (at[axis], at[(axis + 1) % 3], at[(axis + 2) % 3]) = (side, u * side, v);
            at
        };
        for (i, j) in (0..squares).flat_map(|i| (0..squares).map(move |j| (i, j))) {
            let [a, b, c, d] = [corner(i, j), corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)];
            triangles.extend([[a, b, c], [a, c, d]].map(|corners| Primitive::Triangle(Triangle(corners))));
        }
    }
    triangles
}

fn build(primitives: &[Primitive]) -> Bvh {
    Bvh::with(primitives.iter().copied(), Preset::default(), Numerics::Double).expect("finite")
}

fn by_expansions(bvh: &Bvh, points: &[DVec3], beta: f64, instructions: InstructionSet) -> Vec<WindingNumber> {
    let mut found = vec![WindingNumber { value: f64::NAN, error: f64::NAN }; points.len()];
    let set = &mut |index: usize, number| found[index] = number;
    bvh.expansions().evaluate(points, beta, instructions, &mut Vec::new(), set);
    found
}

/// The sum of the solid angles of triangles over 4 pi, each by one arcus tangent.
fn sum(primitives: &[Primitive], q: DVec3) -> f64 {
    let of_triangle = |primitive: &Primitive| match primitive {
        Primitive::Triangle(Triangle(corners)) => {
            let [a, b, c] = corners.map(|corner| corner - q);
            let [of_a, of_b, of_c] = [a, b, c].map(DVec3::length);
            let re = of_a * of_b * of_c + a.dot(b) * of_c + b.dot(c) * of_a + c.dot(a) * of_b;
            a.dot(b.cross(c)).atan2(re) / TAU
        }
        Primitive::Analytic(_) => 0.0,
    };
    primitives.iter().map(of_triangle).sum()
}

/// From the centre of a cube each face has a sixth of all directions. From outside, as far from a face as the centre,
/// it has as much, from its front: where that face is missing, the others have the negative of what it would take to
/// 0.
#[test]
fn faces_of_a_cube_have_a_sixth_each() {
    for squares in [1, 32] {
        for missing in 1..6 {
            let bvh = build(&faces(missing..6, squares));
            let traversal = &mut Traversal::default();
            for beta in [1.0, 2.0, f64::INFINITY] {
                let at_centre = bvh.generalised_winding_number(DVec3::ZERO, beta, traversal);
                let expected = (6 - missing) as f64 / 6.0;
                assert!((at_centre.value - expected).abs() <= at_centre.error, "{missing}: {at_centre:?}");
                // Without the face at x = -1 alone.
                if missing == 1 {
                    let outside = bvh.generalised_winding_number([-2.0, 0.0, 0.0], beta, traversal);
                    assert!((outside.value - 1.0 / 6.0).abs() <= outside.error, "{outside:?}");
                    assert!(at_centre.is_inside() && !outside.is_inside());
                    // 5/6 and 1/6 are both 1/3 from 1/2.
                    let margins = [at_centre, outside].map(|number| (number.margin() - 1.0 / 3.0).abs());
                    assert!(margins[0] <= 2.0 * at_centre.error && margins[1] <= 2.0 * outside.error);
                }
            }
        }
    }
}

/// The errors that are stated hold, are those of rounding for the exact sum, and fall with the third power of `beta`.
#[test]
fn values_differ_from_the_sum_of_solid_angles_by_less_than_their_errors() {
    // A cube with a missing face, a bump and unrelated triangles beside it.
    let mut primitives = faces(1..6, 32);
    for primitive in &mut primitives {
        if let Primitive::Triangle(Triangle(corners)) = primitive {
            *corners = corners.map(|p| p * (1.0 + 0.2 * (3.0 * p.x).sin() * (2.0 * p.y + p.z).cos()));
        }
    }
    for seed in 0..500 {
        let at = point(seed) * 2.0;
        let corners = [1, 2, 3].map(|k| at + point(1000 * k + seed) * 0.1);
        primitives.push(Primitive::Triangle(Triangle(corners)));
    }
    let bvh = build(&primitives);
    let points: Vec<DVec3> = (0..3000u64)
        .map(|seed| match &primitives[seed as usize % primitives.len()] {
            // A third of them next to the surface, a third far away.
            Primitive::Triangle(Triangle([a, ..])) if seed % 3 == 0 => *a + point(seed + 9000) * 0.01,
            _ if seed % 3 == 1 => point(seed + 9000) * 30.0,
            _ => point(seed + 9000) * 1.5,
        })
        .collect();
    let expected: Vec<f64> = points.iter().map(|q| sum(&primitives, *q)).collect();
    let mut means = Vec::new();
    for beta in [1.0, 2.0, 4.0, f64::INFINITY] {
        let found = by_expansions(&bvh, &points, beta, InstructionSet::widest());
        let mut total = 0.0;
        for ((number, expected), q) in found.iter().zip(&expected).zip(&points) {
            // 1e-11: the rounding of the sum of 10,740 angles.
            let off = (number.value - expected).abs();
            assert!(off <= number.error + 1e-11, "{q}: {number:?}, not {expected}");
            total += number.error;
        }
        means.push(total / points.len() as f64);
    }
    println!("mean errors: {means:?}");
    assert!(means[0] < 0.1 && means[1] < means[0] / 8.0 && means[2] < means[1] / 8.0, "{means:?}");
    assert!(means[3] < 1e-8, "{means:?}");
}

/// Of a closed surface, expansions decide as exact crossings do.
#[test]
fn closed_surfaces_have_their_winding_numbers() {
    // In the cube, a smaller one that is turned inside out.
    let mut primitives = faces(0..6, 32);
    for primitive in faces(0..6, 32) {
        if let Primitive::Triangle(Triangle([a, b, c])) = primitive {
            primitives.push(Primitive::Triangle(Triangle([a * 0.5, c * 0.5, b * 0.5])));
        }
    }
    let bvh = build(&primitives);
    assert!(bvh.closedness().is_closed());
    let points: Vec<DVec3> = (0..100_000).map(|seed| point(seed) * 1.5).collect();
    let exact = bvh.par_winding_numbers(&points);
    let found = by_expansions(&bvh, &points, 1.0, InstructionSet::widest());
    let mut least = f64::INFINITY;
    for ((number, exact), q) in found.iter().zip(&exact).zip(&points) {
        assert!((number.value - f64::from(*exact)).abs() <= number.error, "{q}: {number:?}, not {exact}");
        assert!(number.margin() <= 0.0 || number.is_inside() == (*exact != 0), "{q}: {number:?}");
        least = least.min(number.margin());
    }
    println!("least margin: {least}");
    assert!(least > 0.3, "{least}");
    // The interface takes the exact numbers.
    let traversal = &mut Traversal::default();
    for ((number, exact), q) in
        bvh.par_generalised_winding_numbers(&points, 1.0).iter().zip(exact).zip(&points)
    {
        assert_eq!(*number, WindingNumber { value: exact.into(), error: 0.0 });
        assert_eq!(*number, bvh.generalised_winding_number(*q, 1.0, traversal));
        assert_eq!(number.margin(), 0.5);
    }
}

/// A closed surface without intersections, seen counterclockwise from outside: a sphere with bumps.
fn lumpy(level: u32) -> Vec<[DVec3; 3]> {
    let octant = |i: usize| {
        let corner = |k: usize| DVec3::AXES[k] * if i >> k & 1 == 0 { 1.0 } else { -1.0 };
        if i.count_ones().is_multiple_of(2) { [0, 1, 2].map(corner) } else { [0, 2, 1].map(corner) }
    };
    let mut triangles: Vec<[DVec3; 3]> = (0..8).map(octant).collect();
    for _ in 0..level {
        let quarters = |&[a, b, c]: &[DVec3; 3]| {
            let [d, e, f] = [(a + b) / 2.0, (b + c) / 2.0, (c + a) / 2.0];
            [[a, d, f], [d, b, e], [f, e, c], [d, e, f]]
        };
        triangles = triangles.iter().flat_map(quarters).collect();
    }
    let bump = |p: DVec3| p.normalize() * (1.0 + 0.3 * (5.0 * p.x).sin() * (4.0 * p.y + p.z).cos());
    triangles.iter().map(|corners| corners.map(bump)).collect()
}

/// Against the sum of solid angles, in parts that are alone, overlap, are in each other and turned inside out,
/// mirrored, of any size and place; with all triangles, with holes, with triangles that are turned over, and with both. Answers
/// are certain where the margin is above 0, that of closed surfaces everywhere; single queries, batches and signed
/// distances agree. Turned triangles have no part in an odd number of crossings.
#[test]
fn margins_are_promises() {
    let mut seed = 0;
    let mut next = || {
        seed += 1;
        seed
    };
    let mut counts = [[0; 2]; 3];
    let shape = lumpy(3);
    for (numerics, size, far) in [
        (Numerics::Watertight, 1.0, 0.0),
        (Numerics::Watertight, 1e-9, 0.0),
        (Numerics::Fast, 1e6, 1e6),
        (Numerics::Double, 1e9, 0.0),
        (Numerics::Double, 1.0, 1e6),
        (Numerics::Exact, 1e-3, 1.0),
    ] {
        for kind in 0..20 {
            let (has_holes, is_turned) = (kind % 2 == 1, kind / 2 % 2 == 1);
            let mut part = |scale: f64, is_inverted: bool, shift: f64| {
                let kept = shape.iter().filter(|_| !has_holes || !splitmix64(next()).is_multiple_of(20));
                let positions = kept.flat_map(|&[a, b, c]| if is_inverted { [a, c, b] } else { [a, b, c] });
                let positions: Vec<DVec3> = positions.map(|p| p * scale).collect();
                let triangles =
                    (0..positions.len() as u32 / 3).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
                let mesh = Mesh { positions, triangles, ..Mesh::default() };
                // Mirrored once, twice or not at all.
                let axes = DVec3::new(number(next()).signum(), 1.0, 1.0);
                let turn =
                    DMat4::from_axis_angle(point(next()).normalize(), 1.0) * DMat4::from_scale(axes * size);
                let mut placement = Placement::new(turn);
                let scale = number(next()).signum();
                let middle = DVec3::new(shift * size + far, far, 0.0) * -scale;
                placement.then(Step::Shift { middle, scale });
                Placed::new(Arc::new(mesh), placement)
            };
            let parts = match kind / 4 {
                0 => vec![part(1.0, false, 0.0)],
                1 => vec![part(1.0, false, 0.0), part(0.8, false, 0.7)],
                2 => vec![part(1.0, false, 0.0), part(0.4, false, 0.0)],
                3 => vec![part(1.0, false, 0.0), part(0.4, true, 0.0)],
                _ => vec![part(1.0, true, 0.0), part(1.0, false, 9.0)],
            };
            let round = |p: DVec3| p.map(|x| numerics.precision().round(x));
            let corners = |placed: &Placed| -> Vec<Primitive> {
                let of = |index| {
                    let [a, b, c] = placed.corners_of(index).map(round);
                    Primitive::from(if placed.is_mirrored() { [a, c, b] } else { [a, b, c] })
                };
                (0..placed.triangle_count() as u32).map(of).collect()
            };
            let stored: Vec<Primitive> = parts.iter().flat_map(corners).collect();
            let mut turned = parts.clone();
            if is_turned {
                for placed in &mut turned {
                    let mesh = Arc::make_mut(&mut placed.mesh);
                    mesh.triangles.iter_mut().step_by(2).for_each(|corners| corners.swap(0, 1));
                }
            }
            let bvh = Bvh::from_instances(&turned, Preset::default(), numerics).expect("finite");
            let rule = match (has_holes, is_turned) {
                (_, true) => InsideRule::Vote,
                (true, false) => InsideRule::GeneralisedWindingNumber,
                (false, false) => InsideRule::Crossings,
            };
            let near = |index: usize| {
                let Primitive::Triangle(Triangle([a, b, c])) =
                    stored[splitmix64(next()) as usize % stored.len()]
                else {
                    unreachable!("all are triangles")
                };
                // Three quarters of them next to the surface.
                (a + b + c) / 3.0 + point(next()) * size * [0.001, 0.03, 0.3, 3.0][index % 4]
            };
            let points: Vec<DVec3> = (0..200).map(near).collect();
            let (found, distances) = (bvh.par_contains(&points), bvh.par_signed_distances(&points));
            for ((&q, found), distance) in points.iter().zip(found).zip(distances) {
                let single = bvh.contains(q, &mut Traversal::default());
                let sign = distance.expect("triangles").is_sign_negative();
                assert_eq!((single, found.rule, sign), (found, rule, found.is_inside));
                let expected = sum(&stored, q);
                let context = format!("{numerics:?} {size:e} {far:e} {kind}: {q}, {expected}, {found:?}");
                let is_right = match rule {
                    InsideRule::Vote => found.is_inside == (expected.round() % 2.0 != 0.0),
                    _ => found.is_inside == (expected.abs() > 0.5),
                };
                match rule {
                    InsideRule::Vote => assert!(found.margin == 0.0 && (is_right || has_holes), "{context}"),
                    InsideRule::Crossings => assert!(found.margin >= 0.5 && is_right, "{context}"),
                    // 1e-9 is more than the rounding of the sum of solid angles.
                    _ => assert!(found.margin < 1e-9 || is_right, "{context}"),
                }
                counts[rule as usize][usize::from(is_right)] += 1;
            }
        }
    }
    println!("wrong and right: {counts:?}");
    let [_, [wrong, right], _] = counts;
    assert!(wrong * 100 < right, "{counts:?}");
}

/// The bits do not depend on the instruction set, on other points, or on the unit of length.
#[test]
fn numbers_are_the_same_in_every_lane_and_unit() {
    let primitives = faces(1..6, 16);
    let bvh = build(&primitives);
    let points: Vec<DVec3> = (0..501).map(|seed| point(seed) * 1.5).collect();
    let expected = by_expansions(&bvh, &points, 1.0, InstructionSet::Portable);
    for instructions in InstructionSet::supported() {
        assert_eq!(by_expansions(&bvh, &points, 1.0, instructions), expected, "{instructions:?}");
    }
    assert_eq!(bvh.par_generalised_winding_numbers(&points, 1.0), expected);
    let traversal = &mut Traversal::default();
    for (q, number) in points.iter().zip(&expected) {
        assert_eq!(bvh.generalised_winding_number(*q, 1.0, traversal), *number);
    }
    for scale in [2f64.powi(-200), 2f64.powi(100)] {
        let scaled = primitives.iter().map(|primitive| match primitive {
            Primitive::Triangle(Triangle(corners)) => {
                Primitive::Triangle(Triangle(corners.map(|p| p * scale)))
            }
            shape => *shape,
        });
        let scaled: Vec<Primitive> = scaled.collect();
        let points: Vec<DVec3> = points.iter().map(|p| *p * scale).collect();
        assert_eq!(build(&scaled).par_generalised_winding_numbers(&points, 1.0), expected, "{scale:e}");
    }
}

/// Full turns of the summed angles are counted: as many as surfaces are wound around.
#[test]
fn turns_are_counted() {
    let mut primitives = Vec::new();
    for copy in 0..40 {
        let scale = 1.0 + 0.01 * f64::from(copy);
        for primitive in faces(0..6, 3) {
            if let Primitive::Triangle(Triangle(corners)) = primitive {
                primitives.push(Primitive::Triangle(Triangle(corners.map(|p| p * scale))));
            }
        }
    }
    // Not closed: a quarter of a face has 1/24 of all directions.
    primitives.extend(faces([0], 2).into_iter().take(2));
    let bvh = build(&primitives);
    let numbers =
        by_expansions(&bvh, &[DVec3::ZERO, DVec3::X * 9.0], f64::INFINITY, InstructionSet::widest());
    assert!((numbers[0].value - 40.0 - 1.0 / 24.0).abs() < 1e-12, "{numbers:?}");
    assert!(numbers[1].value.abs() < 0.01 && numbers.iter().all(|number| number.error < 1e-10));
}

/// On the surface the value has no meaning, which the margin says, and nothing is NaN.
#[test]
fn points_on_the_surface_are_not_decided() {
    let primitives = faces(1..6, 4);
    let bvh = build(&primitives);
    for primitive in &primitives {
        let Primitive::Triangle(Triangle([a, b, c])) = *primitive else { continue };
        for q in [a, b, c, (a + b) / 2.0, (a + c) / 2.0, (2.0 * a + b + c) / 4.0] {
            for beta in [1.0, f64::INFINITY] {
                let number = by_expansions(&bvh, &[q], beta, InstructionSet::widest())[0];
                assert!(number.value.is_finite() && number.margin() <= 0.0, "{q}: {number:?}");
            }
        }
    }
    let traversal = &mut Traversal::default();
    for q in [f64::NAN, f64::INFINITY, 1e39] {
        let number = bvh.generalised_winding_number([0.0, q, 0.0], 1.0, traversal);
        assert!(number.value == 0.0 && number.margin() < 0.0, "{number:?}");
    }
    assert_eq!(bvh.par_generalised_winding_numbers(&[DVec3::ZERO; 0], 1.0), []);
    // NaN is as 1.
    let q = DVec3::splat(0.3);
    let numbers = [f64::NAN, -1.0, 0.0, 1.0].map(|beta| bvh.generalised_winding_number(q, beta, traversal));
    assert!(numbers.iter().all(|number| *number == numbers[3]));
}

/// A disk of radius r has the solid angle 2 pi (1 - h / sqrt(h² + r²)) from a point of its axis at height h; a ball
/// that is inside of a node has one from within alone.
#[test]
fn shapes_have_theirs() {
    let disk = Disk { centre: DVec3::ZERO, normal: DVec3::Z, radius: 0.5 };
    let ball = Primitive::from(([20.0, 0.0, 0.0], 1.0));
    let bvh = build(&[disk.into(), ball]);
    let traversal = &mut Traversal::default();
    for (h, decided) in [(-4.0f64, true), (4.0, true), (0.25, false), (30.0, true)] {
        let number = bvh.generalised_winding_number([0.0, 0.0, h], 1.0, traversal);
        // From its front the disk is seen with the normal against the direction.
        let expected = -h.signum() * (1.0 - h.abs() / h.hypot(0.5)) / 2.0;
        assert!((number.value - expected).abs() <= number.error, "{h}: {number:?}, not {expected}");
        assert_eq!(number.error < 0.01, decided, "{h}: {number:?}");
    }
    let inside = bvh.generalised_winding_number([20.0, 0.5, 0.0], 1.0, traversal);
    assert!((inside.value - 1.0).abs() < 1e-3 && inside.margin() > 0.4, "{inside:?}");
}

/// Triangles that are split, moved or of another tier have one number; an update is seen.
#[test]
fn trees_do_not_change_numbers() {
    let mut primitives = faces(1..6, 8);
    // A large triangle, which presets split.
    primitives.push(Primitive::from([[-9.0, -3.0, -8.0], [9.0, -3.1, -8.5], [0.0, -2.5, 9.0]]));
    let points: Vec<DVec3> = (0..200).map(|seed| point(seed) * 1.5).collect();
    let expected = build(&primitives).par_generalised_winding_numbers(&points, 1.0);
    let moved: Vec<DVec3> = points.iter().map(|p| *p + DVec3::X * 4.0).collect();
    for preset in Preset::ALL {
        let mut bvh = Bvh::with(primitives.iter().copied(), preset, Numerics::Double).expect("finite");
        assert_eq!(bvh.par_generalised_winding_numbers(&points, 1.0), expected, "{preset:?}");
        let to = primitives.iter().map(|primitive| match primitive {
            Primitive::Triangle(Triangle(corners)) => {
                Primitive::Triangle(Triangle(corners.map(|p| p + DVec3::X * 4.0)))
            }
            shape => *shape,
        });
        bvh.update(to).expect("finite");
        let found = bvh.par_generalised_winding_numbers(&moved, 1.0);
        for (number, expected) in found.iter().zip(&expected) {
            // The move rounds corners, and centres that were equal are divided otherwise.
            let off = (number.value - expected.value).abs();
            assert!(off <= number.error + expected.error && off < 0.01, "{number:?}, not {expected:?}");
        }
    }
}

/// Vertices and triangles of an OBJ file of triangles.
fn read(name: &str) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let folder = std::env::var("KILN_MODELS").expect("KILN_MODELS names the folder of the models");
    let text = std::fs::read_to_string(std::path::Path::new(&folder).join(name)).expect("the model");
    let (mut vertices, mut triangles) = (Vec::new(), Vec::new());
    for line in text.lines() {
        let mut words = line.split_whitespace();
        match words.next() {
            Some("v") => {
                let at: Vec<f64> = words.take(3).map(|word| word.parse().expect("a number")).collect();
                vertices.push(DVec3::from_slice(&at));
            }
            Some("f") => {
                let index = |word: &str| -> u32 {
                    word.split('/').next().and_then(|word| word.parse().ok()).expect("an index")
                };
                let face: Vec<u32> = words.map(|word| index(word) - 1).collect();
                triangles.push(face.try_into().expect("a triangle"));
            }
            _ => {}
        }
    }
    (vertices, triangles)
}

/// The triangles that close the holes: each is a fan around the mean of its rim.
fn fans(vertices: &[DVec3], triangles: &[[u32; 3]]) -> Vec<Primitive> {
    use std::collections::HashMap;
    let edges = || triangles.iter().flat_map(|[a, b, c]| [[*a, *b], [*b, *c], [*c, *a]]);
    let all: std::collections::HashSet<[u32; 2]> = edges().collect();
    // From vertex to vertex against the direction of the triangles.
    let mut next: HashMap<u32, u32> =
        edges().filter(|[a, b]| !all.contains(&[*b, *a])).map(|[a, b]| (b, a)).collect();
    let mut fans = Vec::new();
    while let Some(start) = next.keys().min().copied() {
        let mut rim = vec![start];
        while let Some(to) = next.remove(&rim[rim.len() - 1]) {
            rim.push(to);
        }
        let corners: Vec<DVec3> = rim.iter().map(|index| vertices[*index as usize]).collect();
        let middle = corners[1..].iter().sum::<DVec3>() / (corners.len() - 1) as f64;
        fans.extend(corners.windows(2).map(|edge| Primitive::from([edge[0], edge[1], middle])));
    }
    fans
}

/// The bunny has five holes in its bottom. What is inside is defined by what closes them, here fans: a point between
/// a fan and another cap is inside by one of them alone. The rims are not flat, and such points have margins up to
/// 0.11. Of 100,000 points none is wrong by a margin of 0.15 or more.
#[test]
#[ignore = "needs KILN_MODELS"]
fn with_models_the_open_bunny_contains_what_the_closed_one_does() {
    let (vertices, triangles) = read("stanford-bunny.obj");
    let corners = triangles.iter().map(|triangle| Primitive::from(triangle.map(|i| vertices[i as usize])));
    let mut primitives: Vec<Primitive> = corners.collect();
    let open = build(&primitives);
    primitives.extend(fans(&vertices, &triangles));
    let closed = build(&primitives);
    assert!(!open.closedness().is_closed() && closed.closedness().is_closed());
    let [min, max] = vertices
        .iter()
        .fold([DVec3::INFINITY, DVec3::NEG_INFINITY], |[min, max], p| [min.min(*p), max.max(*p)]);
    let points: Vec<DVec3> = (0..100_000).map(|seed| min + (max - min) * (point(seed) + 1.0) / 2.0).collect();
    let expected = closed.par_winding_numbers(&points);
    let by_ray = open.par_winding_numbers(&points);
    let found = open.par_generalised_winding_numbers(&points, 1.0);
    let wrong: Vec<f64> = found
        .iter()
        .zip(&expected)
        .filter(|(number, expected)| number.is_inside() != (**expected != 0))
        .map(|(number, _)| number.margin())
        .collect();
    let of_rays = by_ray.iter().zip(&expected).filter(|(a, b)| (**a != 0) != (**b != 0)).count();
    let undecided = found.iter().filter(|number| number.margin() < 0.01).count();
    let most = wrong.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    println!(
        "wrong: {} by expansions, {of_rays} by rays; margins up to {most}; {undecided} below 0.01",
        wrong.len()
    );
    assert!(expected.iter().filter(|number| **number != 0).count() > 10_000);
    assert!(most < 0.15, "{wrong:?}");
    assert!(wrong.len() < of_rays && undecided < 1000);
}
