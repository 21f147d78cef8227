//! Crossings, winding numbers and containment against rational arithmetic and cells of a grid.

use crate::common::oracle::moved;
use crate::common::{Numbers, models};
use kiln::bvh::detail::RayBuffer;
use kiln::bvh::{
    Bvh, Closedness, Containment, Disk, InsideRule, NotClosed, Numerics, Preset, PrimId, Primitive, Ray,
    Side, Traversal, Triangle,
};
use kiln::glam::DVec3;

type Corners = [DVec3; 3];

fn built(triangles: &[Corners], numerics: Numerics, preset: Preset) -> Bvh {
    Bvh::with(triangles.iter().map(|&corners| Primitive::Triangle(Triangle(corners))), preset, numerics)
        .expect("finite")
}

fn crossings(bvh: &Bvh, ray: &Ray) -> Vec<moved::SignedCrossing> {
    let crossings = bvh.crossings(ray, &mut Traversal::default());
    crossings.into_iter().map(|c| (c.prim.0, c.side == Side::Leaving)).collect()
}

/// Whether all tiers and presets have the crossings of the moved ray, and their number.
fn check(triangles: &[Corners], rays: &[Ray], bits: u32) -> usize {
    let mut count = 0;
    for numerics in Numerics::ALL {
        let round = |x: f64| numerics.precision().round(x);
        let stored: Vec<Corners> =
            triangles.iter().map(|corners| corners.map(|corner| corner.map(round))).collect();
        let expected: Vec<_> = rays.iter().map(|ray| moved::crossings(ray, &stored, bits)).collect();
        for preset in Preset::ALL {
            let bvh = built(triangles, numerics, preset);
            for (ray, expected) in rays.iter().zip(&expected) {
                assert_eq!(&crossings(&bvh, ray), expected, "{}, {preset:?}, {ray:?}", numerics.name());
                count += expected.len();
            }
        }
    }
    count
}

/// Corner i of a cell has the bits of i as x, y and z.
fn cell_corner(i: u32) -> DVec3 {
    DVec3::from([i & 1, i >> 1 & 1, i >> 2].map(f64::from))
}

/// The surfaces of cells of a grid, some inside out. Cells share vertices, edges and faces, or coincide.
struct Cells(Vec<(DVec3, i32)>);

impl Cells {
    fn new(numbers: &mut Numbers) -> Self {
        let mut cell = || {
            let place = [numbers.below(3), numbers.below(3), numbers.below(3)].map(|x| x as f64);
            (DVec3::from(place), if numbers.below(3) == 0 { -1 } else { 1 })
        };
        Cells((0..7).map(|_| cell()).collect())
    }

    fn triangles(&self) -> Vec<Corners> {
        // Faces are counter-clockwise from outside.
        const FACES: [[u32; 4]; 6] =
            [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
        let of_cell = |(place, sign): &(DVec3, i32)| {
            let (place, sign) = (*place, *sign);
            let corner = move |i: u32| place + cell_corner(i);
            FACES.into_iter().flat_map(move |face| {
                let [a, b, c, d] = face.map(corner);
                [[a, b, c], [a, c, d]].map(|[a, b, c]| if sign > 0 { [a, b, c] } else { [a, c, b] })
            })
        };
        self.0.iter().flat_map(of_cell).collect()
    }

    /// A point on a face is moved along +x, +y and +z: a cell has its lower faces and not its upper ones.
    fn winding_number(&self, point: DVec3) -> i32 {
        let holds = |place: DVec3| point.cmpge(place).all() && point.cmplt(place + 1.0).all();
        self.0.iter().filter(|(place, _)| holds(*place)).map(|(_, sign)| sign).sum()
    }
}

/// A multiple of a half, from -1 to 4: on vertices, edges and faces, and beside them.
fn grid_point(numbers: &mut Numbers) -> DVec3 {
    DVec3::from([numbers.below(11), numbers.below(11), numbers.below(11)].map(|x| x as f64 / 2.0 - 1.0))
}

/// Coordinates are multiples of 2^-1, directions of 2^-63, so that e = 2^-100 is small enough.
#[test]
fn cells_of_a_grid_are_crossed_as_by_a_moved_ray() {
    let numbers = &mut Numbers::new(1);
    let mut count = 0;
    for _ in 0..12 {
        let triangles = Cells::new(numbers).triangles();
        let ray = |_| {
            let steps = [0, 0, 1, -1, 2].map(f64::from);
            let small = DVec3::from([(); 3].map(|()| numbers.one_of(&steps)));
            let direction =
                if small == DVec3::ZERO || numbers.below(5) == 0 { numbers.direction() } else { small };
            let t_max = numbers.one_of(&[f64::INFINITY, f64::INFINITY, 0.5, 1.0, 2.0]);
            Ray::unchecked(grid_point(numbers), direction, 0.0, t_max)
        };
        count += check(&triangles, &(0..160).map(ray).collect::<Vec<_>>(), 100);
    }
    assert!(count > 4_000, "{count} crossings");
}

/// Tetrahedra that intersect each other, of every size and winding, with a T-vertex on an edge, closed by a triangle
/// without area.
fn tetrahedra(numbers: &mut Numbers, mut corner: impl FnMut(&mut Numbers) -> DVec3) -> Vec<Corners> {
    let mut triangles = Vec::new();
    for _ in 0..6 {
        let [a, b, c, d] = [(); 4].map(|()| corner(numbers));
        let m = (a + b) / 2.0;
        triangles.extend([[m, b, c], [a, m, c], [a, b, m], [a, d, b], [b, d, c], [c, d, a]]);
    }
    triangles
}

/// Rays at corners, at edges, along edges, in planes and anywhere, not normalised where that would round.
fn aimed(triangles: &[Corners], numbers: &mut Numbers, is_exact: bool) -> Vec<Ray> {
    let ray = |index: usize| {
        let [a, b, c] = triangles[numbers.below(triangles.len())];
        let target = [a, (a + b) / 2.0, c, b][index % 4];
        let origin = match index % 5 {
            0 => a + b - c,
            1 => a,
            2 => (b + c) / 2.0,
            _ => (numbers.vector() * 256.0).round() / 64.0,
        };
        let direction = if target == origin { DVec3::new(0.0, -1.0, 0.5) } else { target - origin };
        let direction = if is_exact { direction } else { direction.normalize() };
        Ray::unchecked(origin, direction, 0.0, f64::INFINITY)
    };
    (0..60).map(ray).collect()
}

/// Coordinates have few digits, so that rays meet edges and corners exactly: multiples of 2^-7, of up to 2^3. Orders of
/// distances are signs of multiples of 2^-56, less than 2^50.
#[test]
fn rays_through_corners_and_edges_are_moved_off_them() {
    let numbers = &mut Numbers::new(2);
    let mut count = 0;
    for _ in 0..12 {
        let triangles = tetrahedra(numbers, |numbers| (numbers.vector() * 128.0).round() / 64.0);
        let rays = aimed(&triangles, numbers, true);
        count += check(&triangles, &rays, 200);
    }
    assert!(count > 5_000, "{count} crossings");
}

/// Coordinates have all digits, so that rays pass edges and corners at a distance of their rounding. All numbers are
/// multiples of 2^-200, and so small an e is below all sums of products of seven of them.
#[test]
fn rays_beside_corners_and_edges_are_decided_exactly() {
    let numbers = &mut Numbers::new(3);
    let mut count = 0;
    for _ in 0..4 {
        let triangles = tetrahedra(numbers, Numbers::fine_vector);
        let rays = aimed(&triangles, numbers, false);
        count += check(&triangles, &rays, 1500);
    }
    assert!(count > 1_500, "{count} crossings");
}

/// A ray from a corner, nearly in the plane of a face: whatever the first corner of its triangles, t is 0 and not behind.
#[test]
fn a_ray_that_starts_at_a_corner_crosses_what_the_moved_one_does() {
    let [a, b, c, d] =
        [[11, -7, -12], [3, 12, -1], [-10, 6, 3], [7, 3, -8]].map(|p| DVec3::from(p.map(f64::from)));
    let faces = [[a, b, c], [a, d, b], [b, d, c], [c, d, a]];
    let directions = (-4..=4).flat_map(|x| (-4..=4).flat_map(move |y| (-4..=4).map(move |z| [x, y, z])));
    let directions =
        directions.filter(|&direction| direction != [0; 3]).map(|v| DVec3::from(v.map(f64::from)));
    let ray = |direction| Ray::unchecked(d, direction, 0.0, f64::INFINITY);
    let rays: Vec<Ray> = directions.map(ray).collect();
    for turn in 0..3 {
        let turned = faces.map(|mut face| {
            face.rotate_left(turn);
            face
        });
        assert!(check(&turned, &rays, 200) > 100);
    }
}

#[test]
fn winding_numbers_of_cells_are_those_of_their_lower_faces() {
    let numbers = &mut Numbers::new(4);
    let traversal = &mut Traversal::default();
    let mut kinds = [0; 3];
    for _ in 0..12 {
        let cells = Cells::new(numbers);
        for numerics in Numerics::ALL {
            let bvh = built(&cells.triangles(), numerics, Preset::BestTrace);
            assert!(bvh.closedness().is_closed());
            for _ in 0..300 {
                let point = grid_point(numbers);
                let expected = cells.winding_number(point);
                assert_eq!(bvh.winding_number(point, traversal), expected, "{} {point}", numerics.name());
                assert_eq!(bvh.contains(point, traversal).is_inside, expected != 0);
                assert_eq!(bvh.contains_if_closed(point, traversal), Ok(expected != 0));
                kinds[(expected.signum() + 1) as usize] += 1;
            }
        }
    }
    assert!(kinds.iter().all(|&count| count > 100), "{kinds:?}");
}

/// A ball of radius 1 around the origin has its poles at -x, -y and -z, and the points that a move along +x, +y, +z
/// takes into it.
#[test]
fn spheres_are_entered_and_left() {
    let traversal = &mut Traversal::default();
    for numerics in Numerics::ALL {
        let ball = Primitive::from(([0.0; 3], 1.0));
        let bvh = Bvh::with([ball], Preset::default(), numerics).expect("finite");
        let passed = |origin: [f64; 3], direction: [f64; 3], t_max: f64| {
            let ray = bvh.ray_within(origin, direction, t_max).expect("finite");
            let crossings = bvh.crossings(&ray, &mut Traversal::default());
            crossings.into_iter().map(|c| (c.t, c.side)).collect::<Vec<_>>()
        };
        let (enter, leave) = (Side::Entering, Side::Leaving);
        let up = [0.0, 0.0, 1.0];
        assert_eq!(passed([0.0, 0.0, -5.0], up, f64::INFINITY), [(4.0, enter), (6.0, leave)]);
        assert_eq!(passed([0.0, 0.0, -5.0], up, 5.0), [(4.0, enter)]);
        assert_eq!(passed([0.0; 3], up, f64::INFINITY), [(1.0, leave)]);
        // Touched, and started from where a ray along z touches the ball: (-1, 0, 0) is inside, (1, 0, 0) is not.
        assert_eq!(passed([1.0, 0.0, -5.0], up, f64::INFINITY), []);
        assert_eq!(passed([-1.0, 0.0, 0.0], up, f64::INFINITY), [(0.0, leave)]);
        assert_eq!(passed([1.0, 0.0, 0.0], up, f64::INFINITY), []);
        // From one pole to the other: (0, 0, -1) is inside, (0, 0, 1) is not.
        assert_eq!(passed([0.0, 0.0, -1.0], up, 2.0), [(2.0, leave)]);
        assert_eq!(passed([0.0, 0.0, 1.0], [0.0, 0.0, -1.0], 2.0), [(0.0, enter)]);
        for axis in 0..3 {
            let pole = DVec3::AXES[axis];
            assert_eq!(bvh.winding_number(-pole, traversal), 1, "{}", numerics.name());
            assert_eq!(bvh.winding_number(pole, traversal), 0, "{}", numerics.name());
        }
        // Two balls that intersect: in both, and across 1.5 of a plane through the first one's centre, whose crossing
        // is between those of the ball.
        let [a, b, c] = [[-9.0, -9.0, 0.0], [9.0, -9.0, 0.0], [0.0, 9.0, 0.0]];
        let primitives = [ball, Primitive::from(([0.0, 0.0, 1.5], 1.0)), Primitive::from([a, b, c])];
        let bvh = Bvh::with(primitives, Preset::default(), numerics).expect("finite");
        assert_eq!(bvh.winding_number([0.0, 0.0, 0.75], traversal), 2);
        let ray = bvh.ray([0.0, 0.0, -5.0], up).expect("finite");
        let expected = [(0, false), (2, true), (1, false), (0, true), (1, true)];
        assert_eq!(crossings(&bvh, &ray), expected);
    }
}

/// A disk is crossed once, from its front or its back. Of its rim, the half is inside that the move along +x, +y, +z
/// takes into it: all points before the first of these directions in which the rim turns.
#[test]
fn disks_are_crossed_once() {
    for numerics in Numerics::ALL {
        let disk = Disk { centre: DVec3::ZERO, normal: DVec3::Z, radius: 1.0 };
        let bvh = Bvh::with([Primitive::from(disk)], Preset::default(), numerics).expect("finite");
        let passed = |origin: [f64; 3], direction: [f64; 3], t_max: f64| {
            let ray = bvh.ray_within(origin, direction, t_max).expect("finite");
            let crossings = bvh.crossings(&ray, &mut Traversal::default());
            crossings.into_iter().map(|c| (c.t, c.side)).collect::<Vec<_>>()
        };
        let (enter, leave) = (Side::Entering, Side::Leaving);
        let (up, down) = ([0.0, 0.0, 1.0], [0.0, 0.0, -1.0]);
        assert_eq!(passed([0.5, 0.5, 3.0], down, f64::INFINITY), [(3.0, enter)]);
        assert_eq!(passed([0.5, 0.5, -3.0], up, f64::INFINITY), [(3.0, leave)]);
        assert_eq!(passed([0.5, 0.5, 3.0], up, f64::INFINITY), []);
        assert_eq!(passed([0.8, 0.7, 3.0], down, f64::INFINITY), []);
        // In the plane, and parallel to it.
        assert_eq!(passed([-3.0, 0.0, 0.0], [1.0, 0.0, 0.0], f64::INFINITY), []);
        // The rim: (-1, 0) moves inwards along +x, (1, 0) outwards; (0, -1) inwards along +y.
        for (x, y, is_inside) in [(-1.0, 0.0, true), (1.0, 0.0, false), (0.0, -1.0, true), (0.0, 1.0, false)]
        {
            let expected: &[_] = if is_inside { &[(2.0, leave)] } else { &[] };
            assert_eq!(passed([x, y, -2.0], up, f64::INFINITY), expected, "{x} {y}");
        }
        // From and to the plane: the moved origin is before it along +z.
        assert_eq!(passed([0.0; 3], up, f64::INFINITY), []);
        assert_eq!(passed([0.0; 3], down, f64::INFINITY), [(0.0, enter)]);
        assert_eq!(passed([0.0, 0.0, -2.0], up, 2.0), [(2.0, leave)]);
        assert_eq!(passed([0.0, 0.0, 2.0], down, 2.0), []);
        // Its rim is the one edge of the surface; with a triangle's there are four.
        let open = Closedness { boundary_edges: 1, unbalanced_edges: 1, ..Closedness::default() };
        assert_eq!(bvh.closedness(), open);
        assert!(bvh.contains_if_closed([0.0, 0.0, -1.0], &mut Traversal::default()).is_err());
        let nearest = |p: [f64; 3]| bvh.closest_point(p, &mut Traversal::default()).map(|c| c.point);
        assert_eq!(nearest([0.25, 0.5, 3.0]), Some(DVec3::new(0.25, 0.5, 0.0)));
        assert_eq!(nearest([0.0, -4.0, 3.0]), Some(DVec3::NEG_Y));
    }
}

/// What is inside of a surface that is not closed is decided by another rule; the strict form is an error.
#[test]
fn the_mesh_chooses_the_rule() {
    let traversal = &mut Traversal::default();
    let cell = Cells(vec![(DVec3::ZERO, 1)]).triangles();
    for numerics in Numerics::ALL {
        // Without the two triangles of its upper face at z = 1, which the ray of winding numbers meets: it has nothing
        // to leave through. From the middle, five of six faces are 5/6, which is 1/3 above 1/2.
        let open: Vec<_> = cell[..10].to_vec();
        let mut bvh = built(&open, numerics, Preset::default());
        let expected = Closedness { boundary_edges: 4, unbalanced_edges: 4, ..Closedness::default() };
        assert_eq!((bvh.closedness(), bvh.winding_number([0.5; 3], traversal)), (expected, 0));
        let Containment { is_inside, margin, rule, .. } = bvh.contains([0.5; 3], traversal);
        assert!(is_inside && (margin - 1.0 / 3.0).abs() < 1e-9, "{margin}");
        assert_eq!((rule, expected.rule()), (InsideRule::GeneralisedWindingNumber, rule));
        assert_eq!(bvh.signed_distance([0.5; 3], traversal), Some(-0.5));
        let error = bvh.contains_if_closed([0.5; 3], traversal);
        assert_eq!(error, Err(NotClosed(expected)));
        assert!(error.expect_err("open").to_string().contains("4 edges have one triangle only, 0 are"));
        // From below it enters through the lower face, and does not leave.
        assert_eq!(bvh.winding_number([0.5, 0.5, -0.5], traversal), -1);
        // Closed by an update.
        bvh.update(cell.iter().map(|&corners| Primitive::Triangle(Triangle(corners)))).expect("finite");
        assert_eq!(bvh.contains_if_closed([0.5; 3], traversal), Ok(true));
        // One triangle turned over: its three edges have both triangles on one side.
        let mut turned = cell.clone();
        turned[3].swap(0, 1);
        let bvh = built(&turned, numerics, Preset::default());
        let expected = Closedness { unbalanced_edges: 3, inconsistent_edges: 3, ..Closedness::default() };
        assert_eq!((bvh.closedness(), expected.rule()), (expected, InsideRule::Vote));
        // A diagonal wall within a cell; the edges of its border have three triangles each.
        let wall = [[0, 1, 7], [0, 7, 6]].map(|face| face.map(cell_corner));
        let open = [&cell[..], &wall].concat();
        let closedness = built(&open, numerics, Preset::default()).closedness();
        assert_eq!(
            (closedness.inconsistent_edges, closedness.rule()),
            (0, InsideRule::GeneralisedWindingNumber)
        );
        // Two cells that share an edge are closed, with an edge of four triangles.
        let two = Cells(vec![(DVec3::ZERO, 1), (DVec3::new(1.0, 1.0, 0.0), 1)]).triangles();
        let closedness = built(&two, numerics, Preset::BestTrace).closedness();
        let expected = Closedness { non_manifold_edges: 1, ..Closedness::default() };
        assert!(closedness.is_closed() && closedness == expected);
        // What no bounds hold is outside.
        for x in [f64::NAN, f64::INFINITY, -1e300] {
            assert_eq!(bvh.winding_number([0.5, x, 0.5], traversal), 0);
        }
    }
}

/// Signed distances of a cell by their closed form: the distance to the box outside, to the nearest face inside.
#[test]
fn distances_of_a_cell_are_those_of_a_box() {
    let numbers = &mut Numbers::new(5);
    for numerics in Numerics::ALL {
        let bvh = built(&Cells(vec![(DVec3::ZERO, 1)]).triangles(), numerics, Preset::BestTrace);
        for index in 0..2000 {
            let point = if index % 2 == 0 { grid_point(numbers) } else { numbers.vector() * 2.0 + 0.5 };
            let beyond = (point - 0.5).abs() - 0.5;
            let expected = beyond.max(DVec3::ZERO).length() + beyond.max_element().min(0.0);
            let closest = bvh.closest_point(point, &mut Traversal::default()).expect("triangles");
            assert!((closest.distance - expected.abs()).abs() < 1e-14, "{point}: {closest:?}");
            assert!((closest.point.distance(point) - closest.distance).abs() < 1e-14);
            let found = bvh.signed_distance(point, &mut Traversal::default()).expect("triangles");
            assert!((found - expected).abs() < 1e-14, "{point}: {found}, not {expected}");
        }
    }
}

/// No point of any triangle or ball is nearer than the closest one, which is on its primitive. Slivers and triangles
/// without area are among them.
#[test]
fn no_point_is_nearer_than_the_closest() {
    let numbers = &mut Numbers::new(6);
    let mut triangles = tetrahedra(numbers, Numbers::fine_vector);
    triangles.extend([(); 4].map(|()| {
        let [a, b] = [numbers.fine_vector(), numbers.fine_vector()];
        [a, b, (a + b) / 2.0 + numbers.fine_vector() * 1e-17]
    }));
    let ball = DVec3::new(2.0, 0.0, 0.0);
    let with_ball = triangles.iter().map(|&corners| Primitive::Triangle(Triangle(corners)));
    let with_ball = with_ball.chain([Primitive::from((ball.to_array(), 0.5))]);
    let bvh = Bvh::with(with_ball, Preset::default(), Numerics::Double).expect("finite");
    for _ in 0..400 {
        let point = numbers.fine_vector() * 2.0 + DVec3::X;
        let closest = bvh.closest_point(point, &mut Traversal::default()).expect("triangles");
        for index in 0..2000 {
            let [v, w] = [numbers.fine_unit(), numbers.fine_unit()];
            let [v, w] = if v + w > 1.0 { [1.0 - v, 1.0 - w] } else { [v, w] };
            let [a, b, c] = triangles[index % triangles.len()];
            let other = a + (b - a) * v + (c - a) * w;
            assert!(other.distance(point) >= closest.distance - 1e-14, "{point}, {closest:?}, {other}");
        }
        let to_ball = (point.distance(ball) - 0.5).abs();
        assert!(to_ball >= closest.distance - 1e-14);
        if let Some([a, b, c]) = triangles.get(closest.prim.0 as usize) {
            let area = |p: DVec3, q: DVec3, r: DVec3| (q - p).cross(r - p).length();
            let [u, v, w] =
                [area(closest.point, *b, *c), area(*a, closest.point, *c), area(*a, *b, closest.point)];
            // The areas of the parts add up only for a point of the triangle; for a sliver they are all small.
            assert!((u + v + w - area(*a, *b, *c)).abs() < 1e-13, "{closest:?}");
        } else {
            assert!((closest.distance - to_ball).abs() < 1e-14);
        }
    }
}

/// Batches in any order have the results of single queries, in that order.
#[test]
fn batches_are_answered_in_their_order() {
    let numbers = &mut Numbers::new(7);
    let triangles = [Cells::new(numbers).triangles(), tetrahedra(numbers, Numbers::fine_vector)].concat();
    let traversal = &mut Traversal::default();
    for numerics in Numerics::ALL {
        let bvh = built(&triangles, numerics, Preset::default());
        let rays: RayBuffer = (0..9000)
            .map(|index| {
                let origin = if index % 3 == 0 { DVec3::splat(5.0) } else { numbers.vector() * 3.0 };
                bvh.ray(origin, numbers.direction()).expect("finite")
            })
            .collect();
        let rays = rays.rays();
        let mut points: Vec<DVec3> = (0..9000).map(|_| numbers.vector() * 4.0).collect();
        points[17].y = f64::NAN;
        let hits = bvh.par_closest_hits(rays);
        let occluded = bvh.par_are_occluded(rays);
        let (all, crossed) = (bvh.par_all_hits(rays), bvh.par_crossings(rays));
        assert!([hits.len(), occluded.len(), all.len(), crossed.len()].iter().all(|&len| len == rays.len()));
        for (index, ray) in rays.iter().enumerate() {
            assert_eq!(crossed[index], bvh.crossings(&ray, traversal));
            // In `fast`, packets and streams have hits of their own.
            if numerics != Numerics::Fast {
                assert_eq!(all[index], bvh.all_hits(&ray, traversal));
                assert_eq!(hits[index], bvh.closest_hit(&ray, traversal));
                assert_eq!(occluded[index], hits[index].is_some());
            }
            // Any hit but those on even triangles.
            let is_odd = |prim: PrimId| prim.0 % 2 == 1;
            let expected = bvh.all_hits(&ray, traversal).iter().any(|hit| is_odd(hit.prim));
            assert_eq!(bvh.occluded_by(&ray, is_odd, traversal), expected);
        }
        let (winding_numbers, inside) = (bvh.par_winding_numbers(&points), bvh.par_contains(&points));
        let (closest, distances) = (bvh.par_closest_points(&points), bvh.par_signed_distances(&points));
        for (index, &point) in points.iter().enumerate() {
            assert_eq!(winding_numbers[index], bvh.winding_number(point, traversal));
            assert_eq!(inside[index], bvh.contains(point, traversal));
            assert_eq!(closest[index], bvh.closest_point(point, traversal));
            assert_eq!(distances[index], bvh.signed_distance(point, traversal));
        }
        assert!(inside.iter().any(|of| of.is_inside) && closest[17].is_none());
        assert!(bvh.par_closest_points(&[[0.0; 3]; 0]).is_empty());
    }
}

/// Threads that ask for the first time at once, while others of their pool do, too, all get the answer.
#[test]
fn threads_may_ask_for_closedness_at_once() {
    let (sender, receiver) = std::sync::mpsc::channel();
    std::thread::spawn(move || {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build().expect("threads");
        let numbers = &mut Numbers::new(11);
        let triangles: Vec<_> = (0..20_000).map(|_| [0; 3].map(|_| numbers.vector())).collect();
        for _ in 0..30 {
            let bvh = &built(&triangles, Numerics::Watertight, Preset::FastBuild);
            std::thread::scope(|scope| {
                for _ in 0..4 {
                    scope.spawn(|| pool.install(|| assert_eq!(bvh.closedness().boundary_edges, 60_000)));
                }
            });
        }
        sender.send(()).expect("the test waits");
    });
    let is_done = receiver.recv_timeout(std::time::Duration::from_secs(120));
    assert!(is_done.is_ok(), "threads wait for each other");
}

/// Rays along all axes, exactly through all vertices and edge midpoints of a closed mesh, from far outside.
#[test]
#[ignore = "needs KILN_MODELS"]
fn with_models_spot_is_left_as_often_as_entered() {
    let mut warnings = kiln::error::Warnings::default();
    let scene = kiln::import::load(&[models().join("spot.obj")], &mut warnings).expect("it loads");
    let primitives: Vec<_> = scene.primitives().collect();
    for numerics in Numerics::ALL {
        let bvh = Bvh::with(primitives.iter().copied(), Preset::default(), numerics).expect("finite");
        assert!(bvh.closedness().is_closed());
        let traversal = &mut Traversal::default();
        let mut targets: Vec<DVec3> = Vec::new();
        bvh.accelerator().each_primitive(&mut |_, primitive| {
            let Primitive::Triangle(Triangle([a, b, c])) = primitive else { return };
            targets.extend([a, b, c, (a + b) / 2.0, (b + c) / 2.0, (c + a) / 2.0]);
        });
        let mut count = 0;
        for target in targets {
            for axis in 0..3 {
                let mut origin = target;
                origin[axis] = -100.0;
                let ray = bvh.ray(origin, DVec3::AXES[axis]).expect("finite");
                let crossings = crossings(&bvh, &ray);
                // In turns: spot does not intersect itself.
                let is_leaving = crossings.iter().map(|(_, is_leaving)| *is_leaving);
                let in_turns = is_leaving.zip([false, true].into_iter().cycle()).all(|(a, b)| a == b);
                assert!(
                    crossings.len().is_multiple_of(2) && in_turns,
                    "{} {ray:?} {crossings:?}",
                    numerics.name()
                );
                assert_eq!(bvh.winding_number(origin, traversal), 0);
                count += crossings.len();
            }
        }
        assert!(count > 100_000, "{count}");
    }
}
