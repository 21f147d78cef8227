//! Nodes of eight children, and what a ray needs to be tested against all of them at once.
//!
//! The distance to a plane is `plane * inverse - offset` with `offset = origin * inverse`: one fused multiply-add. Plainly
//! computed that is off by the rounding of the offset, which is measured to lose rays; here the offset is computed in f64
//! and rounded to f32 towards the side that makes the box larger, so what is left are two factors of 1 ± u, the
//! reciprocal's and the result's own, which the margin absorbs ([`MARGIN`]). A ray with a component of 0 has no
//! such offset on that axis: for those rays it is the origin that is rounded so, and distances are
//! `(plane - origin) * inverse`. That form serves every ray where there is no fused multiply-add.
//! In either form rays of f64 numbers are tested against the same f32 boxes.

use glam::Vec3;

use crate::geometry::simd::Simd;
use crate::geometry::{Bounds, PRUNE_MARGIN, Precision, Ray, round_down, round_up};

/// How many children a node has.
pub const WIDTH: usize = 8;

/// The margin by which a ray may leave a box before it enters it: that of the f32 box test, since hits are held to their
/// own boxes by it, and the two roundings on either side that may be added here.
pub const MARGIN: f32 = PRUNE_MARGIN + 4.0 * f32::EPSILON;

/// Eight boxes, and what they hold.
#[derive(Clone, Copy)]
#[repr(C, align(64))]
pub struct Node {
    /// `planes[axis][0]` are the least, `planes[axis][1]` the greatest coordinates. A box that holds nothing is inside out,
    /// and no ray enters it.
    pub planes: [[[f32; WIDTH]; 2]; 3],
    /// What the boxes hold.
    pub children: [Child; WIDTH],
}

/// What a box holds, in 32 bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Child(u32);

/// What a [`Child`] stands for.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Content {
    /// The node of that index.
    Node(u32),
    /// A range of groups of triangles.
    Groups(std::ops::Range<u32>),
    /// A range of spheres.
    Spheres(std::ops::Range<u32>),
}

impl Child {
    /// How many groups or spheres a leaf may have.
    pub const MOST: usize = 4;
    /// How many nodes, groups or spheres there may be.
    pub const MOST_INDICES: usize = 1 << 28;

    const SPHERES: u32 = 1 << 31;
    const LEAF: u32 = 1 << 30;
    const COUNT_SHIFT: u32 = 28;
    const INDEX: u32 = (1 << Self::COUNT_SHIFT) - 1;

    /// An inner node.
    pub fn node(index: usize) -> Self {
        assert!(index < Self::MOST_INDICES, "more nodes than a structure can number");
        Child(index as u32)
    }

    /// A leaf of groups of triangles, or of spheres.
    pub fn leaf(first: usize, count: usize, spheres: bool) -> Self {
        assert!(first + count <= Self::MOST_INDICES, "more primitives than a structure can number");
        debug_assert!((1..=Self::MOST).contains(&count));
        let kind = if spheres { Self::SPHERES } else { 0 };
        Child(Self::LEAF | kind | (count as u32 - 1) << Self::COUNT_SHIFT | first as u32)
    }

    /// Whether it is an inner node.
    #[inline(always)]
    pub fn is_node(self) -> bool {
        self.0 & Self::LEAF == 0
    }

    /// What it stands for.
    #[inline(always)]
    pub fn content(self) -> Content {
        let first = self.0 & Self::INDEX;
        let end = first + 1 + (self.0 >> Self::COUNT_SHIFT & (Self::MOST as u32 - 1));
        match (self.0 & Self::LEAF != 0, self.0 & Self::SPHERES != 0) {
            (false, _) => Content::Node(first),
            (true, false) => Content::Groups(first..end),
            (true, true) => Content::Spheres(first..end),
        }
    }
}

impl Node {
    /// A node of nothing.
    pub const EMPTY: Node = Node {
        planes: [[[f32::INFINITY; WIDTH], [f32::NEG_INFINITY; WIDTH]]; 3],
        children: [Child(Child::INDEX); WIDTH],
    };

    /// Puts `child` with its box into a place.
    pub fn set(&mut self, place: usize, b: Bounds, child: Child) {
        for axis in 0..3 {
            self.planes[axis][0][place] = b.min[axis];
            self.planes[axis][1][place] = b.max[axis];
        }
        self.children[place] = child;
    }

    /// The box in a place; `None` where there is none.
    pub fn bounds(&self, place: usize) -> Option<Bounds> {
        let side = |side: usize| Vec3::from_array([0, 1, 2].map(|axis: usize| self.planes[axis][side][place]));
        let b = Bounds { min: side(0), max: side(1) };
        (b.min.x <= b.max.x).then_some(b)
    }
}

/// A ray made ready for the boxes of nodes.
pub struct BoxRay {
    /// Reciprocals of the direction; infinite where it is 0.
    pub inverse: [f32; 3],
    /// For each axis which of the two planes is met first.
    pub near: [usize; 3],
    /// For each axis what belongs to the near plane and what to the far one: offsets, or origins.
    pub offsets: [[f32; 2]; 3],
    /// Boxes that end before this are not entered.
    pub t_min: f32,
}

impl BoxRay {
    /// Prepares a ray of numbers of `precision`. `fused` needs a direction without zeros.
    #[inline(always)]
    pub fn new(ray: &Ray, precision: Precision, fused: bool) -> Self {
        let reciprocal = ray.direction.recip();
        let mut prepared = BoxRay {
            inverse: [0.0; 3],
            near: [0; 3],
            offsets: [[0.0; 2]; 3],
            t_min: round_down(ray.t_min),
        };
        for axis in 0..3 {
            let inverse = reciprocal[axis] as f32;
            let downwards = inverse < 0.0;
            // To f32 towards the side where the near plane is nearer and the far plane farther.
            let origin = ray.origin[axis];
            let [least, greatest] = match (fused, precision) {
                (false, _) => [round_down(origin), round_up(origin)],
                // The product of two f32 numbers is exact in f64,
                (true, Precision::Single) => {
                    let offset = origin * f64::from(inverse);
                    [round_down(offset), round_up(offset)]
                }
                // that of others is not.
                (true, Precision::Double) => {
                    let offset = origin * f64::from(inverse);
                    [round_down(offset.next_down()), round_up(offset.next_up())]
                }
            };
            prepared.inverse[axis] = inverse;
            prepared.near[axis] = usize::from(downwards);
            prepared.offsets[axis] =
                if fused || !downwards { [greatest, least] } else { [least, greatest] };
        }
        prepared
    }
}

impl BoxRay {
    /// The places of `node` whose boxes the ray enters before `t_max`, as bits, and where it does. Never misses a box that
    /// holds a point of the exact ray between its start and `t_max`.
    #[inline(always)]
    pub fn enter<S: Simd, const FUSED: bool>(&self, node: &Node, t_max: f32) -> (u32, [f32; WIDTH]) {
        let mut enter = S::f8_splat(self.t_min);
        let mut leave = S::f8_splat(t_max);
        for axis in 0..3 {
            let (near, inverse) = (self.near[axis], S::f8_splat(self.inverse[axis]));
            let [near_offset, far_offset] = self.offsets[axis];
            // What is not a number, where a ray runs in a plane of the box, is never taken.
            enter = S::f8_max(distances::<S, FUSED>(node.planes[axis][near], inverse, near_offset), enter);
            leave = S::f8_min(distances::<S, FUSED>(node.planes[axis][1 - near], inverse, far_offset), leave);
        }
        let leave = S::f8_mul(leave, S::f8_splat(MARGIN));
        (S::f8_le(enter, leave), S::f8_array(enter))
    }
}

/// Where a ray crosses eight planes of one axis.
#[inline(always)]
fn distances<S: Simd, const FUSED: bool>(planes: [f32; WIDTH], inverse: S::F8, offset: f32) -> S::F8 {
    let (planes, offset) = (S::f8(planes), S::f8_splat(offset));
    if FUSED { S::mul_sub(planes, inverse, offset) } else { S::f8_mul(S::f8_sub(planes, offset), inverse) }
}
