use std::sync::Arc;

use glam::{DMat4, DVec3};

use crate::scene::mesh::topology::{BoundaryEdge, Topology, Welded, t_junctions};
use crate::scene::{Attribute, Mesh, Placed, Placement, Scene, Shape, Sphere};

/// Corners at the origin and at 1 on each axis; normals point outwards.
const TETRAHEDRON: [[u32; 3]; 4] = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];

fn corners() -> Vec<DVec3> {
    vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z]
}

/// Vertices, edges, components, closed components.
fn counts(topology: &Topology) -> [usize; 4] {
    [topology.vertices, topology.edges, topology.components, topology.closed_components]
}

/// Counts of [`Topology::findings`]: boundary edges, non-manifold edges, inconsistent edges, T-junctions, duplicates,
/// inverted components, opposed triangles.
fn found(topology: &Topology) -> [usize; 7] {
    topology.findings().map(|(_, findings, _)| findings.count)
}

#[test]
fn a_tetrahedron_is_closed() {
    let topology = Topology::of_triangles(&corners(), &TETRAHEDRON);
    assert_eq!((counts(&topology), found(&topology)), ([4, 6, 1, 1], [0; 7]));
    assert_eq!(topology.holes, 0);
}

/// As STL has them: 12 vertices, of which three at a time are equal. The origin is written as -0, too.
#[test]
fn equal_positions_are_one_vertex() {
    let mut positions: Vec<DVec3> =
        TETRAHEDRON.as_flattened().iter().map(|&i| corners()[i as usize]).collect();
    positions[0] = DVec3::splat(-0.0);
    let triangles = [[0, 1, 2], [3, 4, 5], [6, 7, 8], [9, 10, 11]];
    let topology = Topology::of_triangles(&positions, &triangles);
    assert_eq!((counts(&topology), found(&topology)), ([4, 6, 1, 1], [0; 7]));
    // The next number after 0 is another vertex: the triangles at the origin come apart there. Of the three edges to
    // the origin, the two of the first triangle are doubled.
    positions[0] = DVec3::new(f64::from_bits(1), 0.0, 0.0);
    let topology = Topology::of_triangles(&positions, &triangles);
    assert_eq!(counts(&topology), [5, 8, 1, 0]);
    assert_eq!((topology.boundary_edges.count, topology.holes), (4, 1));
}

/// A cube has 12 edges and a diagonal in each of its 6 faces. Without a face it has 12 and 5, four of them around the
/// hole.
#[test]
fn a_cube_without_a_face_has_a_hole_of_four_edges() {
    let corner = |i: u32| DVec3::new(f64::from(i & 1), f64::from(i >> 1 & 1), f64::from(i >> 2));
    let positions: Vec<DVec3> = (0..8).map(corner).collect();
    let quads = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    let triangles: Vec<[u32; 3]> = quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    let whole = Topology::of_triangles(&positions, &triangles);
    assert_eq!((counts(&whole), found(&whole), whole.holes), ([8, 18, 1, 1], [0; 7], 0));
    let open = Topology::of_triangles(&positions, &triangles[..10]);
    assert_eq!((counts(&open), found(&open), open.holes), ([8, 17, 1, 0], [4, 0, 0, 0, 0, 0, 0], 1));
    // The missing face is that of z = 1: the middles of its edges are on it.
    assert_eq!(open.boundary_edges.first.map(|first| first.position.z), Some(1.0));
    // Without the opposite face of z = 0 there are two holes.
    let both = Topology::of_triangles(&positions, &triangles[..8]);
    assert_eq!((both.boundary_edges.count, both.holes), (8, 2));
}

/// Tetrahedra over the edge from 0 to x, the second the first turned by a half turn about x: 4 triangles at one edge.
#[test]
fn an_edge_of_two_tetrahedra_is_non_manifold() {
    let positions = [corners(), vec![-DVec3::Y, -DVec3::Z]].concat();
    let second = TETRAHEDRON.map(|triangle| triangle.map(|i| if i < 2 { i } else { i + 2 }));
    let triangles = [TETRAHEDRON, second].concat();
    let topology = Topology::of_triangles(&positions, &triangles);
    assert_eq!((counts(&topology), found(&topology)), ([6, 11, 1, 1], [0, 1, 0, 0, 0, 0, 0]));
    let first = topology.non_manifold_edges.first.expect("one");
    assert_eq!((first.triangle, first.position), (0, DVec3::X / 2.0));
}

/// Each edge of the flipped triangle is run along in the direction of its neighbour.
#[test]
fn a_flipped_triangle_is_inconsistent_at_its_edges() {
    let [a, b, c, [d, e, f]] = TETRAHEDRON;
    let topology = Topology::of_triangles(&corners(), &[a, b, c, [d, f, e]]);
    assert_eq!((counts(&topology), found(&topology)), ([4, 6, 1, 0], [0, 0, 3, 0, 0, 0, 0]));
}

/// With every triangle flipped the signed volume is -1/6, wherever it is.
#[test]
fn a_tetrahedron_inside_out_is_inverted() {
    let inverted = TETRAHEDRON.map(|[a, b, c]| [a, c, b]);
    for offset in [DVec3::ZERO, DVec3::new(1e9, -1e9, 1e9)] {
        let positions: Vec<DVec3> = corners().into_iter().map(|p| p + offset).collect();
        let topology = Topology::of_triangles(&positions, &inverted);
        assert_eq!((counts(&topology), found(&topology)), ([4, 6, 1, 1], [0, 0, 0, 0, 0, 1, 0]));
        assert_eq!(found(&Topology::of_triangles(&positions, &TETRAHEDRON)), [0; 7]);
    }
    // Two sides of one triangle enclose nothing.
    let flat = Topology::of_triangles(&corners(), &[[0, 1, 2], [0, 2, 1]]);
    assert_eq!((counts(&flat), found(&flat)), ([3, 3, 1, 1], [0, 0, 0, 0, 1, 0, 0]));
}

#[test]
fn a_triangle_that_is_there_again_is_a_duplicate() {
    let [a, b, c, d] = TETRAHEDRON;
    let again = [d[1], d[2], d[0]];
    let topology = Topology::of_triangles(&corners(), &[a, b, c, d, again, again]);
    assert_eq!((counts(&topology), found(&topology)), ([4, 6, 1, 0], [0, 3, 0, 0, 2, 0, 0]));
    assert_eq!(topology.duplicate_triangles.first.map(|first| first.triangle), Some(4));
    // A triangle with two equal corners is no surface.
    assert_eq!(found(&Topology::of_triangles(&corners(), &[a, b, c, d, [0, 1, 1]])), [0; 7]);
}

/// One triangle above the x axis from 0 to 2, two below it that meet at (1, 0): of 8 edges, the one between the lower
/// two is shared.
#[test]
fn a_vertex_inside_an_edge_is_a_t_junction() {
    let with_middle = |y: f64| -> Vec<DVec3> {
        [[0.0, 0.0], [2.0, 0.0], [0.0, 2.0], [0.0, -2.0], [1.0, y]].map(|[x, y]| DVec3::new(x, y, 0.0)).into()
    };
    let triangles = [[0, 1, 2], [0, 3, 4], [3, 1, 4]];
    let topology = Topology::of_triangles(&with_middle(0.0), &triangles);
    assert_eq!((counts(&topology), found(&topology)), ([5, 8, 2, 0], [7, 0, 0, 1, 0, 0, 0]));
    assert_eq!((topology.holes, topology.t_junctions.first.map(|t| t.position)), (1, Some(DVec3::X)));
    // Any distance makes it a crack, which is not found.
    assert_eq!(Topology::of_triangles(&with_middle(1e-300), &triangles).t_junctions.count, 0);
    // A triangle without area joins the three edges; four remain around all.
    let closed = [triangles.as_slice(), &[[1, 0, 4]]].concat();
    let topology = Topology::of_triangles(&with_middle(0.0), &closed);
    assert_eq!((counts(&topology), found(&topology)), ([5, 8, 1, 0], [4, 0, 0, 0, 0, 0, 0]));
}

/// The tree finds what brute force finds: points and edges on a lattice, where many are collinear.
#[test]
fn t_junctions_are_those_of_brute_force() {
    let mut state = 1_u64;
    let mut next = |below: u64| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) % below
    };
    // Not a power of two, so that the middles of boxes are rounded; collinear all the same, being along the axes and
    // diagonals of a lattice of integers.
    for side in [2, 7, 30] {
        let positions: Vec<DVec3> = (0..side * side * 3)
            .map(|i| {
                DVec3::new((i % side) as f64, (i / side % side) as f64, (i / side / side) as f64) * 1000.0
            })
            .collect();
        let count = positions.len() as u64;
        let mut boundary = Vec::new();
        for triangle in 0..400 {
            let vertices = [next(count) as u32, next(count) as u32];
            if vertices[0] != vertices[1] {
                boundary.push(BoundaryEdge { vertices, triangle });
            }
        }
        let used: std::collections::BTreeSet<u32> = boundary.iter().flat_map(|edge| edge.vertices).collect();
        let is_inside = |p: DVec3, edge: &BoundaryEdge| {
            let [a, b] = edge.vertices.map(|i| positions[i as usize]);
            // Products of integers below 2^53 are exact.
            p != a && p != b && (b - a).cross(p - a) == DVec3::ZERO && (a - p).dot(b - p) < 0.0
        };
        let expected = used.iter().filter(|&&i| boundary.iter().any(|e| is_inside(positions[i as usize], e)));
        let mesh = Welded { positions: &positions, corners: &[] };
        let expected = expected.count();
        let (findings, is_cut_off) = t_junctions::find(&mesh, &boundary);
        assert_eq!((findings.count, is_cut_off), (expected, false), "{side}");
        assert!(side > 7 || expected > 0);
    }
}

/// Edges from 0 to 299, all over each other, and those between neighbours on the way. Each of the former tests all 300
/// vertices: too many for the second batch of 1024 edges, with a budget of as many as the first batch of 1024 needs.
#[test]
fn a_search_without_end_is_cut_off() {
    let positions: Vec<DVec3> = (0..300).map(|i| DVec3::X * f64::from(i)).collect();
    let long = (0..2048).map(|triangle| BoundaryEdge { vertices: [0, 299], triangle });
    let short = (0..299).map(|i| BoundaryEdge { vertices: [i, i + 1], triangle: i });
    let boundary: Vec<BoundaryEdge> = long.chain(short).collect();
    let mesh = Welded { positions: &positions, corners: &[] };
    for (budget, expected) in [(1023 * 300, true), (usize::MAX, false)] {
        let (findings, is_cut_off) = t_junctions::find_within(&mesh, &boundary, budget);
        assert_eq!((findings.count, is_cut_off), (298, expected));
    }
}

fn tetrahedron(triangles: &[[u32; 3]]) -> Mesh {
    Mesh { positions: corners(), triangles: triangles.into(), ..Mesh::default() }
}

/// Objects split by material are welded together; the first finding names the object and its own triangle.
#[test]
fn a_scene_is_welded_across_its_objects() {
    let parts = |third: &[[u32; 3]]| {
        let meshes = [&TETRAHEDRON[..2], &[], third].map(tetrahedron);
        Topology::of_scene(&meshes.map(Shape::Mesh).into_iter().collect()).expect("it fits into memory")
    };
    let topology = parts(&TETRAHEDRON[2..]);
    assert_eq!((counts(&topology), found(&topology)), ([4, 6, 1, 1], [0; 7]));
    // Both parts are of a closed component; the empty object between them is of none.
    assert_eq!(topology.closed_objects, [Some(true), None, Some(true)]);
    assert_eq!(parts(&TETRAHEDRON[3..]).closed_objects, [Some(false), None, Some(false)]);
    // The last triangle of the third object again.
    let topology = parts(&[TETRAHEDRON[2], TETRAHEDRON[3], TETRAHEDRON[3]]);
    let first = topology.duplicate_triangles.first.expect("one");
    assert_eq!((first.object, first.triangle), (2, 2));
}

/// Three places of an open tetrahedron: three times its hole of three edges; the first lies where the first place is.
#[test]
fn a_shared_mesh_counts_for_each_place() {
    let mesh = Arc::new(tetrahedron(&TETRAHEDRON[..3]));
    let place = |x: f64| {
        let placement = Placement::new(DMat4::from_translation(DVec3::X * x));
        Shape::Placed(Placed::new(Arc::clone(&mesh), placement))
    };
    let topology = Topology::of_scene(&[10.0, 20.0, 30.0].map(place).into_iter().collect()).expect("it fits");
    assert_eq!((counts(&topology), found(&topology)), ([12, 18, 3, 0], [9, 0, 0, 0, 0, 0, 0]));
    assert_eq!((topology.holes, &topology.closed_objects[..]), (3, &[Some(false); 3][..]));
    // The missing triangle is that of x, y and z; the first triangle has the edge from x to y.
    let first = topology.boundary_edges.first.expect("one");
    assert_eq!(first.position, DVec3::new(10.5, 0.5, 0.0));
}

/// A closed and an open tetrahedron, far from each other in one object, then each in its own, a sphere between them;
/// then two places of a closed one, and triangles without three distinct vertices.
#[test]
fn an_object_is_closed_if_all_its_components_are() {
    let far = |mesh: Mesh| Mesh { positions: mesh.positions.iter().map(|p| p + 9.0).collect(), ..mesh };
    let (closed, open) = (tetrahedron(&TETRAHEDRON), far(tetrahedron(&TETRAHEDRON[1..])));
    let both = Mesh {
        positions: [&closed.positions[..], &open.positions].concat(),
        triangles: closed
            .triangles
            .iter()
            .copied()
            .chain(TETRAHEDRON[1..].iter().map(|t| t.map(|i| i + 4)))
            .collect(),
        ..Mesh::default()
    };
    let closed_objects = |shapes: Vec<Shape>| {
        Topology::of_scene(&shapes.into_iter().collect()).expect("it fits").closed_objects
    };
    assert_eq!(closed_objects(vec![Shape::Mesh(both)]), [Some(false)]);
    let ball = Sphere { centre: DVec3::ZERO, radius: 1.0 };
    let place = |x: f64| {
        let placement = Placement::new(DMat4::from_translation(DVec3::X * x));
        Shape::Placed(Placed::new(Arc::new(closed.clone()), placement))
    };
    let shapes = vec![
        Shape::Mesh(open),
        Shape::Analytic(ball.into()),
        place(20.0),
        Shape::Mesh(closed.clone()),
        Shape::Mesh(tetrahedron(&[[0, 0, 1]])),
        place(30.0),
    ];
    let expected = [Some(false), None, Some(true), Some(true), None, Some(true)];
    assert_eq!(closed_objects(shapes), expected);
}

/// All normals point to +z, as the triangle from 0 to x to y does; normals of zero say nothing.
#[test]
fn triangles_against_their_normals() {
    let mut mesh = tetrahedron(&[[0, 1, 2], [0, 2, 1], [2, 1, 0]]);
    let opposed = |mesh: &Mesh| {
        let scene = Scene::from_iter([Shape::Mesh(mesh.clone())]);
        Topology::of_scene(&scene).expect("it fits").opposed_to_normals
    };
    mesh.normals = Some(Attribute::per_position(vec![DVec3::Z; 4]));
    let findings = opposed(&mesh);
    assert_eq!((findings.count, findings.first.map(|first| first.triangle)), (2, Some(1)));
    // One corner of three is no majority.
    let own = [[1, 0, 0], [0, 0, 0], [1, 1, 0]];
    mesh.normals = Some(Attribute { values: vec![DVec3::ZERO, DVec3::Z], triangles: Some(own.into()) });
    assert_eq!(opposed(&mesh).count, 1);
    mesh.normals = None;
    assert_eq!(opposed(&mesh).count, 0);
}

/// A mirrored mesh keeps its outside, its normals too.
#[test]
fn mirrored_meshes_are_not_inside_out() {
    let mut mesh = Mesh { positions: corners(), triangles: TETRAHEDRON.to_vec(), ..Mesh::default() };
    let outward = corners().into_iter().map(|corner| corner - DVec3::splat(0.25)).collect();
    mesh.normals = Some(Attribute::per_position(outward));
    mesh.transform(&DMat4::from_scale(DVec3::new(1.0, -1.0, 1.0)));
    let topology = Topology::of_scene(&Scene::from_iter([Shape::Mesh(mesh)])).expect("it fits");
    assert_eq!(found(&topology), [0; 7]);
}
