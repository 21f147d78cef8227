//! Exact and watertight ray and point queries of triangle meshes, spheres, disks and surfaces of your own.
//!
//! - [`Bvh`] has all queries. Those of one ray or point take a [`Traversal`], one a thread; those whose names begin with
//!   `par_` take a batch, and use all threads (feature `rayon`, a default).
//! - Points and directions are `DVec3`, `Vec3`, `[f64; 3]` or `[f32; 3]` ([`Point`]). Directions are normalised, so t is a
//!   distance.
//! - [`Numerics`] chooses between speed and exactness. In all tiers but `fast` no ray passes between triangles that share
//!   vertices, and results do not depend on threads, machine or [`Preset`].
//! - [`detail`] is what the renderer `kiln` needs beside this page; `kiln` exports this crate as `kiln::bvh`.
//!
//! # A mesh
//! ```
//! use kiln_bvh::{Bvh, Traversal};
//!
//! let vertices = [[0.0_f32, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
//! let mut mesh = Bvh::from_mesh(&vertices, &[[0, 1, 2]])?;
//! let traversal = &mut Traversal::default();
//! let ray = mesh.ray([0.25, 0.5, 3.0], [0.0, 0.0, -1.0])?;
//! let hit = mesh.closest_hit(&ray, traversal).expect("the triangle");
//! assert_eq!((hit.prim.0, hit.t, hit.barycentrics), (0, 3.0, [0.25, 0.5]));
//! assert_eq!(mesh.geometric_normal(&ray, &hit).map(|n| n.z), Some(1.0));
//! mesh.update_mesh(&vertices.map(|[x, y, _]| [x, y, 9.0]), &[[0, 1, 2]])?;
//! assert!(!mesh.occluded(&ray, traversal));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # A million rays
//! ```
//! # use kiln_bvh::Bvh;
//! let scene = Bvh::new([([0.0, 0.0, 5.0], 1.0).into()])?; // a sphere
//! let direction = |i: u32| [f64::from(i % 1000) / 1e3 - 0.5, f64::from(i / 1000) / 1e3 - 0.5, 1.0];
//! let directions: Vec<[f64; 3]> = (0..1_000_000).map(direction).collect();
//! let origins = vec![[0.0; 3]; directions.len()];
//! let rays = scene.rays(&origins, &directions, None)?;
//! let hits = scene.par_closest_hits(rays);
//! // The sphere fills a circle of the tangent of asin(1 / 5): pi / 24 of the square.
//! let share = hits.iter().flatten().count() as f64 / 1e6;
//! assert!((share - std::f64::consts::PI / 24.0).abs() < 1e-3);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//! A `Vec` of [`Ray`]s is a batch, too. Rays from one point, in tiles of a picture, are fastest.
//!
//! # Closest points, inside and outside
//! ```
//! # use kiln_bvh::{Bvh, Traversal};
//! let [o, x, y, z] = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
//! let tetrahedron = Bvh::from_mesh(&[o, x, y, z], &[[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])?;
//! let traversal = &mut Traversal::default();
//! let closest = tetrahedron.closest_point([0.2, 0.2, -1.0], traversal).expect("a triangle");
//! assert_eq!((closest.prim.0, closest.distance), (0, 1.0));
//! assert!(tetrahedron.contains([0.1; 3], traversal).is_inside); // also with holes, by a margin
//! assert_eq!(tetrahedron.signed_distance([0.25, 0.25, 0.125], traversal), Some(-0.125));
//! assert_eq!(tetrahedron.par_contains(&[o, [2.0; 3]]).len(), 2);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # A custom shape
//! ```
//! # use std::sync::Arc;
//! # use kiln_bvh::{Bvh, Ray, Side, Traversal, UserGeometry, glam::DVec3};
//! struct Wave; // z = sin(x) / 8 for 0 < x < 1, seen along z
//! impl UserGeometry for Wave {
//!     fn bounds(&self) -> [DVec3; 2] {
//!         [DVec3::new(0.0, 0.0, 0.0), DVec3::new(1.0, 1.0, 0.125)]
//!     }
//!     fn intersect(&self, ray: &Ray, found: &mut dyn FnMut(f64, Side)) {
//!         let t = (ray.origin().x.sin() / 8.0 - ray.origin().z) / ray.direction().z;
//!         found(t, if ray.direction().z < 0.0 { Side::Entering } else { Side::Leaving });
//!     }
//! }
//! let mut scene = Bvh::new([])?;
//! scene.set_user_geometry([Arc::new(Wave) as Arc<dyn UserGeometry>])?;
//! # let ray = scene.ray([0.5, 0.5, 2.0], [0.0, 0.0, -1.0])?;
//! # let hit = scene.closest_hit(&ray, &mut Traversal::default()).expect("the wave");
//! # assert_eq!(hit.t, 2.0 - 0.5f64.sin() / 8.0);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Moving instances
//! ```
//! # use std::sync::Arc;
//! # use kiln_bvh::{Bvh, Mesh, Numerics, Placed, Placement, Preset, Traversal};
//! use kiln_bvh::glam::{DMat4, DVec3};
//!
//! let (positions, triangles) = (vec![DVec3::ZERO, DVec3::X, DVec3::Y], vec![[0, 1, 2]]);
//! let mesh = Arc::new(Mesh { positions, triangles, ..Mesh::default() });
//! let at = |z: f64| Placement::new(DMat4::from_translation(DVec3::Z * z));
//! let mut parts = [1.0, 2.0].map(|z| Placed::new(mesh.clone(), at(z)));
//! let mut scene = Bvh::from_instances(&parts, Preset::default(), Numerics::Double)?;
//! let ray = scene.ray([0.2, 0.2, 0.0], [0.0, 0.0, 1.0])?;
//! let first = |scene: &Bvh| scene.closest_hit(&ray, &mut Traversal::default()).map(|hit| scene.instance_of(hit.prim));
//! assert_eq!(first(&scene), Some((0, 0)));
//! parts[0].placement = at(9.0);
//! scene.set_instances(&parts)?; // the tree of the mesh stays
//! assert_eq!(first(&scene), Some((1, 0)));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

#![warn(unreachable_pub)]
// Documentation of modules links to what they are made of.
#![allow(rustdoc::private_intra_doc_links)]

mod bvh;
pub mod detail;
mod geometry;
mod threads;

pub use bvh::{
    Bvh, CONTAINS_DIRECTION, Closedness, ClosestPoint, CoarseRounding, Containment, InsideRule, InvalidMesh,
    InvalidRays, Lists, NotClosed, NotFinite, Preset, Primitive, RayArrays, RayList, SignedHit, Traversal,
    Update, WindingNumber,
};
pub use geometry::{
    AnalyticShape, Disk, Hit, Mesh, Numerics, Placed, Placement, Point, PrimId, Ray, Side, SlotId, Sphere,
    Triangle, UserGeometry,
};

/// The vectors of the interface; with this export, users need no dependency of the same version.
pub use glam;
