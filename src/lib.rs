//! kiln: a BVH-accelerated mesh ray tracer.
//!
//! The way of the data, top to bottom; every arrow is one function:
//!
//! ```text
//! scene.toml ─┐
//! mesh.obj   ─┼─ import::load ─> Scene ─ job::prepare ─> RenderJob ─ render ─> Film ─ film::write ─> PNG, JPEG, EXR
//! mesh.glb   ─┘                  (what)                     (how)              (pixels)
//! ```
//!
//! Conventions: right-handed, +y up, no physical unit; column vectors, transforms named `b_from_a`; row 0 of a picture
//! is its top row; directions have length 1, so t is a distance.
//!
//! # A picture in memory
//! By a camera of an intrinsic matrix and a pose:
//!
//! ```
//! use kiln::job::{CameraChoice, RenderControl, RenderSettings, prepare};
//! use kiln::scene::PictureSettings;
//!
//! let (mut warnings, control) = (kiln::error::Warnings::default(), RenderControl::default());
//! let scene = kiln::import::load(&["scenes/assignment.toml".into()], &mut warnings)?;
//! let camera = "{ K = [[64, 0, 32], [0, 64, 24], [0, 0, 1]], axes = 'opencv',
//!     pose = [[-1, 0, 0, 0], [0, -1, 0, -200], [0, 0, 1, 500], [0, 0, 0, 1]] }";
//! let camera = CameraChoice::Given(kiln::import::inline_camera(camera, Some([64, 48]))?);
//! let settings = RenderSettings { camera, ..PictureSettings::of_size([64, 48]).into() };
//!
//! let job = prepare(scene, &settings, &mut warnings)?;
//! let (film, _) = job.render::<[f32; 3]>(&control)?;
//! let channels = job.aovs(&["depth", "primitive", "normal"], &control)?;
//! let [r, g, b] = film.pixel(32, 24);
//! let of_pixel = channels.iter().map(|channel| (channel.name.as_str(), channel.values[24 * 64 + 32]));
//! println!("{r} {g} {b}: {:?}", of_pixel.collect::<Vec<_>>());
//! # assert_eq!((channels.len(), channels[0].values.len()), (5, 64 * 48));
//! # Ok::<(), kiln::error::Error>(())
//! ```
//!
//! Many pictures of one scene: [`job::Session`].
//!
//! # As a library
//! Rays against triangles, spheres and disks of your own, by the code that pictures are made with, and without scenes,
//! files or shading ([`bvh::Bvh`]):
//!
//! ```
//! use kiln::bvh::{Bvh, Primitive, Traversal};
//!
//! let ball = Primitive::from(([0.0, 0.0, 5.0], 1.0));
//! let floor = Primitive::from([[-9.0, -1.0, 0.0], [9.0, -1.0, 0.0], [0.0, -1.0, 9.0]]);
//! let mut bvh = Bvh::new([ball, floor])?;
//! let ray = bvh.ray([0.0; 3], [0.0, 0.0, 1.0])?;
//! let mut traversal = Traversal::default(); // one a thread; its memory is used again
//! assert_eq!(bvh.closest_hit(&ray, &mut traversal).map(|hit| (hit.prim.0, hit.t)), Some((0, 4.0)));
//! assert!(bvh.occluded(&ray, &mut traversal));
//! assert_eq!(bvh.par_closest_hits(&vec![ray; 64]).len(), 64); // on all threads
//! bvh.update([Primitive::from(([0.0, 3.0, 5.0], 1.0)), floor])?;
//! assert!(!bvh.occluded(&ray, &mut traversal));
//! # Ok::<(), kiln::bvh::NotFinite>(())
//! ```
//!
//! Meshes that are placed and moved:
//!
//! ```
//! use std::sync::Arc;
//! use kiln::bvh::{Bvh, Mesh, Numerics, Placed, Placement, Preset, Traversal};
//! use kiln::glam::{DMat4, DVec3};
//!
//! let (positions, triangles) = (vec![DVec3::ZERO, DVec3::X, DVec3::Y], vec![[0, 1, 2]]);
//! let mesh = Arc::new(Mesh { positions, triangles, ..Mesh::default() });
//! let at = |z: f64| Placement::new(DMat4::from_translation(DVec3::Z * z));
//! let mut parts = [1.0, 2.0, 3.0].map(|z| Placed::new(mesh.clone(), at(z)));
//! let mut bvh = Bvh::from_instances(&parts, Preset::default(), Numerics::Double)?;
//! let ray = bvh.ray([0.2, 0.2, 0.0], [0.0, 0.0, 1.0])?;
//! let traversal = &mut Traversal::default();
//! assert_eq!(bvh.closest_hit(&ray, traversal).map(|hit| bvh.instance_of(hit.prim)), Some((0, 0)));
//! parts[0].placement = at(9.0);
//! bvh.set_instances(&parts)?;
//! assert_eq!(bvh.closest_hit(&ray, traversal).map(|hit| bvh.instance_of(hit.prim)), Some((1, 0)));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Crossings of closed surfaces, containment and distances; `docs/library.md` has their guarantees:
//!
//! ```
//! use kiln::bvh::{Bvh, Side, Traversal};
//!
//! let [o, x, y, z] = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
//! let tetrahedron = [[o, y, x], [o, x, z], [o, z, y], [x, y, z]].map(Into::into);
//! let bvh = Bvh::new(tetrahedron)?;
//! let traversal = &mut Traversal::default();
//! assert!(bvh.closedness().is_closed());
//! assert!(bvh.contains([0.2; 3], traversal).is_inside);
//! // Along an edge: in at one vertex and out at another, once each.
//! let ray = bvh.ray([-1.0, 0.0, 0.0], [1.0, 0.0, 0.0])?;
//! let sides = bvh.crossings(&ray, traversal).into_iter().map(|crossing| crossing.side);
//! assert!(sides.eq([Side::Entering, Side::Leaving]));
//! assert!((bvh.signed_distance([0.1; 3], traversal).unwrap() + 0.1).abs() < 1e-12);
//! # Ok::<(), kiln::bvh::NotFinite>(())
//! ```

#![warn(unreachable_pub)]
// Documentation of modules links to what they are made of.
#![allow(rustdoc::private_intra_doc_links)]

pub use kiln_bvh as bvh;
pub use kiln_bvh::glam;

/// Lists the values of an enumeration as `ALL`, and their names for users.
#[macro_export]
macro_rules! names {
    ($type:ty { $($value:ident = $name:literal),* $(,)? }) => {
        impl $type {
            /// All values.
            pub const ALL: [Self; [$($name),*].len()] = [$(Self::$value),*];

            /// The name for users.
            pub fn name(self) -> &'static str {
                match self {
                    $(Self::$value => $name),*
                }
            }
        }
    };
}

pub mod animation;
pub mod effects;
pub mod error;
pub mod farm;
pub mod film;
pub mod import;
pub mod job;
pub mod limits;
pub mod metrics;
pub mod render;
pub mod scene;
pub mod world;

// What these are made of, visible to the command and the tests; it changes without notice.
#[doc(hidden)]
pub mod files;
#[doc(hidden)]
pub mod shading;
