//! The traversal for crossings: all primitives that a ray, moved by less than any number, may cross.
//!
//! Boxes are tested by [`BoxRay`], which enters every box that has a point on the ray, ends included. A moved ray that
//! crosses a triangle leaves a point of it on the unmoved ray, so no crossing is lost.

use super::layout::{Child, Content, Wide};
use super::single::box_ray::BoxRay;
use super::single::descend;
use super::stream::{self, RayMask};
use crate::bvh::{Next, Primitive, Traversal};
use crate::geometry::lanes::LANES4;
use crate::geometry::simd::Simd;
use crate::geometry::{LineTest, NO_PRIMITIVE, PrimId, Rays, Tier, Triangle};

/// Calls `visit` with the primitives of [`Nearby::each_near_ray`](crate::bvh::Nearby::each_near_ray). `FUSED`
/// requires a direction without zeros.
#[inline(always)]
pub(crate) fn visit<T: Tier, S: Simd, const FUSED: bool>(
    simd: S,
    wide: &Wide<T>,
    ray: &LineTest,
    Traversal { children: stack, tests, .. }: &mut Traversal,
    visit: &mut dyn FnMut(PrimId, Primitive),
) {
    simd.run(
        #[inline(always)]
        || {
            let boxes = BoxRay::new(&ray.ray, FUSED, false);
            descend::<S, FUSED, false>(
                (&wide.nodes, wide.depth),
                &boxes,
                ray.ray.t_max,
                false,
                stack,
                tests,
                #[inline(always)]
                |leaf, _, tests| {
                    tests.primitives += leaf.range().len() as u64;
                    visit_leaf::<T, S>(wide, ray, leaf, visit);
                    Next::Continue
                },
            );
        },
    );
}

/// [`visit`] for at most `BATCH` rays, as a stream. Returns the rays that it does not trace.
#[inline(always)]
pub(crate) fn visit_stream<T: Tier, S: Simd>(
    simd: S,
    wide: &Wide<T>,
    rays: Rays,
    Traversal { stream, tests, .. }: &mut Traversal,
    visit: &mut dyn FnMut(usize, &LineTest, PrimId, Primitive),
) -> RayMask {
    simd.run(
        #[inline(always)]
        move || {
            let prepared: Vec<LineTest> = rays.iter().map(|ray| LineTest::new(&ray)).collect();
            stream::each_leaf::<T, S>(
                wide,
                rays,
                stream,
                tests,
                #[inline(always)]
                |ray, leaf| prepared[ray].may_cross4::<T::Corner, S::D4>(&leaf.corners) != 0,
                #[inline(always)]
                |index, leaf| {
                    let test = &prepared[index];
                    let mut visit = |prim, primitive| visit(index, test, prim, primitive);
                    visit_leaf::<T, S>(wide, test, leaf, &mut visit);
                },
            )
        },
    )
}

/// The primitives of a leaf.
#[inline(always)]
fn visit_leaf<T: Tier, S: Simd>(
    wide: &Wide<T>,
    ray: &LineTest,
    leaf: Child,
    visit: &mut dyn FnMut(PrimId, Primitive),
) {
    match leaf.content() {
        Content::Node(_) => {}
        Content::Triangles(leaves) => {
            for leaf in &wide.triangles[leaves.start as usize..leaves.end as usize] {
                let mut lanes = ray.may_cross4::<T::Corner, S::D4>(&leaf.corners);
                while lanes != 0 {
                    let lane = lanes.trailing_zeros() as usize % LANES4;
                    lanes &= lanes - 1;
                    let corners = leaf.corners.corners_f64(lane).map(Into::into);
                    visit(PrimId(leaf.ids[lane]), Primitive::Triangle(Triangle(corners)));
                }
            }
        }
        Content::Analytic(shapes) => {
            for (shape, prim) in &wide.analytic[shapes.start as usize..shapes.end as usize] {
                if let Some(shape) = shape {
                    visit(*prim, Primitive::Analytic(*shape));
                }
            }
        }
    }
}

/// Calls `visit` with the primitive of every slot.
pub(crate) fn each_primitive<T: Tier>(wide: &Wide<T>, visit: &mut dyn FnMut(PrimId, Primitive)) {
    for leaf in &wide.triangles {
        for (lane, &id) in leaf.ids.iter().enumerate().filter(|(_, id)| **id != NO_PRIMITIVE) {
            let corners = leaf.corners.corners_f64(lane).map(Into::into);
            visit(PrimId(id), Primitive::Triangle(Triangle(corners)));
        }
    }
    let shapes = wide.analytic.iter().filter_map(|(shape, prim)| Some((*prim, (*shape)?)));
    shapes.for_each(|(prim, shape)| visit(prim, Primitive::Analytic(shape)));
}
