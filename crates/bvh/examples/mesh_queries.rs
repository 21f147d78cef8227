//! Queries of a mesh by itself: a ray, what is inside although a side is missing, what is near, and what meets another
//! mesh.
//!
//! cargo run --release -p kiln-bvh --example mesh_queries

use std::error::Error;

use kiln_bvh::glam::DVec3;
use kiln_bvh::{Bvh, Traversal};

/// Two triangles for each side of a cube, counter-clockwise from outside; corner i has the bits of i as x, y and z.
const SIDES: [[[u32; 3]; 2]; 6] = [
    [[0, 4, 6], [0, 6, 2]],
    [[1, 3, 7], [1, 7, 5]],
    [[0, 1, 5], [0, 5, 4]],
    [[2, 6, 7], [2, 7, 3]],
    [[0, 2, 3], [0, 3, 1]],
    [[4, 5, 7], [4, 7, 6]],
];

fn main() -> Result<(), Box<dyn Error>> {
    println!("{}", describe()?);
    Ok(())
}

/// Results of the queries.
pub fn describe() -> Result<String, Box<dyn Error>> {
    let cube = |at: DVec3| (0..8).map(move |i| at + DVec3::from([i & 1, i >> 1 & 1, i >> 2].map(f64::from)));
    let vertices: Vec<DVec3> = cube(DVec3::ZERO).collect();
    // Without the side at z = 1.
    let open = Bvh::from_mesh(&vertices, SIDES[..5].as_flattened())?;
    let traversal = &mut Traversal::default();

    let ray = open.ray([0.25, 0.75, -3.0], [0.0, 0.0, 1.0])?;
    let hit = open.closest_hit(&ray, traversal).ok_or("the ray hits the bottom")?;
    // The middle sees five of six sides: 5/6, which is 1/3 more than 1/2.
    let middle = open.contains([0.5; 3], traversal);
    let nearest = open.nearest([0.5, 0.5, -0.25], 2, f64::INFINITY, traversal);

    let shifted: Vec<DVec3> = cube(DVec3::new(0.5, 0.5, 0.5)).collect();
    let other = Bvh::from_mesh(&shifted, SIDES.as_flattened())?;
    let pairs = open.par_intersecting_triangles(&other);
    Ok(format!(
        "hit at {}; inside: {}, by a margin of {:.3}; the nearest triangles: {} and {} at {}; {} triangles meet",
        hit.t,
        middle.is_inside,
        middle.margin,
        nearest[0].prim.0,
        nearest[1].prim.0,
        nearest[0].distance,
        pairs.len()
    ))
}
