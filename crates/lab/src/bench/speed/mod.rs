//! Ray throughput and number of wrong hits of kiln and other libraries.
//!
//! All engines get the same mesh and rays with f32 values. They are interleaved in every round, so that other load
//! on the machine affects all of them. Rays are converted to an engine's format beforehand; only its queries are timed.
//! The hits of every engine are compared with those of kiln's tier `exact`.

mod measure;
mod rays;
mod reference;
mod scaling;
mod setting;

pub use measure::{Settings, SpeedRow, best, measure};
pub use rays::{BATCH, Kind, RaySets, ViewSetup};
pub use reference::ReferenceHits;
pub use scaling::{ScalingStep, plot as scaling_plot, scaling, sizes};
pub use setting::{Triangles, Viewpoint, scene, triangles, view_setup};

use super::{Available, Engine, Unavailable, embree, gathered, obvhs, own, tinybvh};
use kiln::bvh::Numerics;
use kiln::bvh::detail::Layout;

/// The HTML page of the results, of their JSON.
pub fn page(json: &str) -> String {
    crate::page::page(include_str!("page.js"), &[("bench", json)])
}

/// All libraries of [`engines`].
pub const NAMES: [&str; 6] = ["kiln", "obvhs", "bvh", "parry3d", "tinybvh", "embree"];

/// The available engines for a number of threads, in the order of [`NAMES`], and the unavailable libraries.
pub fn engines(threads: usize) -> (Vec<Engine>, Vec<Unavailable>) {
    let [bvh, parry] = peers();
    let (kiln, obvhs) = (Ok(own::engines()), Ok(obvhs::engines()));
    gathered([kiln, obvhs, bvh, parry, tinybvh(), embree::engines(threads)])
}

fn peers() -> [Available; 2] {
    #[cfg(feature = "peers")]
    return [Ok(super::bvh_peer::engines()), Ok(super::parry::engines())];
    #[cfg(not(feature = "peers"))]
    ["bvh", "parry3d"].map(|name| super::not_compiled(name, "build with --features peers"))
}

/// kiln in its defaults, and Embree with single rays if available.
pub fn defaults(threads: usize) -> Vec<Engine> {
    let mut defaults = vec![own::engine(Layout::default(), Numerics::default())];
    defaults.extend(embree::engines(threads).into_iter().flat_map(|engines| engines.into_iter().take(1)));
    defaults
}
