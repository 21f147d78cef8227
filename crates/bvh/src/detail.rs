//! What the renderer `kiln`, its benchmarks and its tests use beside the front page: structures in other layouts, rays and
//! hits as structures of arrays, roundings, origins of secondary rays. It changes without notice.

pub use crate::bvh::splitmix64::{GOLDEN, splitmix64};
pub use crate::bvh::{
    Accelerator, Description, Instance, Layout, MeshSpace, Quality, Slot, Tests, VisitedNode, build,
    build_with_instances, can_be_instance, compiled_isa, quality,
};
pub use crate::geometry::spawn::{
    EDGE_DISTANCE, EdgeTest, ORIGIN_OFFSET, SurfacePoint, edge_distance, origin_offset, point_at, reach_of,
};
pub use crate::geometry::{
    Attribute, Bounds, HitBuffer, Precision, RayBuffer, Rays, Step, is_mirror, moved_tangent, normal_matrix,
};
