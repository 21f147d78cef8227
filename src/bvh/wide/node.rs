//! Nodes of eight children, and what a ray needs to be tested against all of them at once.
//!
//! The distance to a plane is `plane * inverse - offset` with `offset = origin * inverse`: one fused multiply-add. Plainly
//! computed that is off by the rounding of the offset, which is measured to lose rays; here the offset is moved by more
//! than that towards the side that makes the box larger ([`WIDENING`]), so what is left are factors of 1 ± u, two for the
//! reciprocal and one for the result, which the margin absorbs ([`MARGIN`]). A ray with a component of 0 has no
//! such offset on that axis: for those rays it is the origin that is moved so, and distances are
//! `(plane - origin) * inverse`. That form serves every ray where there is no fused multiply-add.
//! In either form rays of f64 numbers are tested against the same f32 boxes.

use crate::geometry::simd::{Side, Simd};
use crate::geometry::{Bounds, PRUNE_MARGIN, Ray, round_down};
use bytemuck::{Pod, Zeroable};
use glam::Vec3;

/// How many children a node has.
pub const WIDTH: usize = 8;

/// The margin by which a ray may leave a box before it enters it: that of the f32 box test, since the tier `fast` holds hits
/// to their own boxes by it, and 8 u for what is computed in another way here.
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
    /// The places that hold something, as bits. Rays know by the boxes; those that are no rays do not.
    pub present: u32,
}

/// What a box holds, in 32 bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Pod, Zeroable)]
#[repr(transparent)]
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

    /// What is none of these, where there has to be something.
    pub const NOTHING: Child = Child(Self::SPHERES);

    /// How many kinds there are, and which.
    pub const KINDS: usize = 4;
    /// An inner node.
    pub const KIND_NODE: usize = 0;
    /// A leaf of triangles.
    pub const KIND_GROUPS: usize = 1;
    /// Of [`Child::NOTHING`].
    pub const KIND_NOTHING: usize = 2;
    /// A leaf of spheres.
    pub const KIND_SPHERES: usize = 3;

    /// Which kind it is of.
    #[inline(always)]
    pub fn kind(self) -> usize {
        (self.0 >> Self::LEAF.trailing_zeros()) as usize
    }

    /// Whether it is a leaf.
    #[inline(always)]
    pub fn is_leaf(self) -> bool {
        self.0 & Self::LEAF != 0
    }

    /// The index of the node, or of the first group or sphere.
    #[inline(always)]
    pub fn index(self) -> usize {
        (self.0 & Self::INDEX) as usize
    }

    /// As a number.
    #[inline(always)]
    pub fn as_bits(self) -> u32 {
        self.0
    }

    /// As numbers.
    #[inline(always)]
    pub fn bits(children: &[Child; WIDTH]) -> &[u32; WIDTH] {
        bytemuck::cast_ref(children)
    }

    /// From a number.
    #[inline(always)]
    pub fn of_bits(bits: u32) -> Child {
        Child(bits)
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
        present: 0,
    };

    /// Puts `child` with its box into a place.
    pub fn set(&mut self, place: usize, b: Bounds, child: Child) {
        for axis in 0..3 {
            self.planes[axis][0][place] = b.min[axis];
            self.planes[axis][1][place] = b.max[axis];
        }
        self.children[place] = child;
        self.present |= 1 << place;
    }
}

impl Node {
    /// The box in a place.
    pub fn bounds(&self, place: usize) -> Bounds {
        let side =
            |side: usize| Vec3::from_array([0, 1, 2].map(|axis: usize| self.planes[axis][side][place]));
        Bounds { min: side(0), max: side(1) }
    }
}

/// A ray made ready for the boxes of nodes.
#[derive(Clone, Copy)]
pub struct BoxRay {
    /// Reciprocals of the direction; infinite where it is 0.
    pub inverse: [f32; 3],
    /// For each axis which of the two planes is met first.
    pub near: [Side; 3],
    /// For each axis what belongs to the near plane and what to the far one: offsets, or origins.
    pub offsets: [[f32; 2]; 3],
    /// Boxes that end before this are not entered.
    pub t_min: f32,
    /// What distances are to be multiplied by to be those of boxes.
    scale: f64,
}

/// Lengths of directions with which distances to planes are far from the ends of f32's range.
pub const LENGTHS: std::ops::RangeInclusive<f64> = 1.0 / 1024.0..=1024.0;

/// The greatest power of two that is not above a positive number; the least normal number for those below it.
#[cold]
fn power_of_two_below(x: f64) -> f64 {
    f64::from_bits(x.max(f64::MIN_POSITIVE).to_bits() & 0x7ff0_0000_0000_0000)
}

impl BoxRay {
    /// Prepares a ray. `fused` needs a direction without zeros.
    #[inline(always)]
    pub fn new(ray: &Ray, fused: bool) -> Self {
        let longest = ray.direction.abs().max_element();
        // Directions of length 1 are as they should be. Others are brought near it by a power of two, which rounds nothing.
        let (scale, direction) = if LENGTHS.contains(&longest) {
            (1.0, ray.direction)
        } else {
            let scale = power_of_two_below(longest);
            (scale, ray.direction / scale)
        };
        let (direction, origin) = (direction.as_vec3(), ray.origin.as_vec3());
        let inverse = direction.recip();
        let offset = if fused { origin * inverse } else { origin };
        // An origin so small that f32 has few places for it is off by half of the last one, as many times as it is multiplied. The
        // least normal number stands for that: processors are slow at smaller ones.
        let few_places = if fused { inverse.abs() } else { Vec3::ZERO };
        let widening = offset.abs() * WIDENING + (few_places + 1.0) * f32::MIN_POSITIVE;
        let (greatest, least) = (offset + widening, offset - widening);
        let mut prepared = BoxRay {
            inverse: inverse.to_array(),
            near: [Side::new(false); 3],
            offsets: [[0.0; 2]; 3],
            t_min: round_down(ray.t_min * scale),
            scale,
        };
        for axis in 0..3 {
            let downwards = inverse[axis] < 0.0;
            prepared.near[axis] = Side::new(downwards);
            // Towards the side where the near plane is nearer and the far plane farther.
            let turned = downwards && !fused;
            prepared.offsets[axis] =
                if turned { [least[axis], greatest[axis]] } else { [greatest[axis], least[axis]] };
        }
        prepared
    }
}

/// The share of itself by which an offset is moved: it is off by 2 u where the origin is no f32 number (rounded, then
/// multiplied), by less elsewhere. This is 4 u; the least normal number stands for what underflows.
const WIDENING: f32 = 2.0 * f32::EPSILON;

impl BoxRay {
    /// The distance beyond which no box around a hit at `t` is entered. Computed entries are at most 4 u too far, and rounding
    /// `t` takes u.
    #[inline(always)]
    pub fn prune_distance(&self, t: f64) -> f32 {
        ((t * self.scale) as f32).max(f32::MIN_POSITIVE) * MARGIN
    }

    /// Where the ray enters and leaves the boxes of `node`, not before its start and not beyond `t_max`; it may enter those
    /// that it leaves no earlier. Never misses a box that holds a point of the exact ray between its start and `t_max`.
    #[inline(always)]
    pub fn span<S: Simd, const FUSED: bool>(&self, node: &Node, t_max: f32) -> (S::F8, S::F8) {
        let mut enter = S::f8_splat(self.t_min);
        let mut leave = S::f8_splat(t_max);
        for axis in 0..3 {
            let (near, inverse) = (self.near[axis], S::f8_splat(self.inverse[axis]));
            let [near_offset, far_offset] = self.offsets[axis];
            // What is not a number, where a ray runs in a plane of the box, is never taken.
            let planes = &node.planes[axis];
            let at_near = distances::<S, FUSED>(S::f8_of(planes, near), inverse, near_offset);
            let at_far = distances::<S, FUSED>(S::f8_of(planes, near.other()), inverse, far_offset);
            enter = S::f8_max(at_near, enter);
            leave = S::f8_min(at_far, leave);
        }
        (enter, S::f8_mul(leave, S::f8_splat(MARGIN)))
    }

    /// The places of `node` whose boxes the ray enters, as bits, and where it does.
    #[inline(always)]
    pub fn enter<S: Simd, const FUSED: bool>(&self, node: &Node, t_max: f32) -> (u32, [f32; WIDTH]) {
        let (enter, leave) = self.span::<S, FUSED>(node, t_max);
        (S::f8_le(enter, leave) & node.present, S::f8_array(enter))
    }
}

/// Where a ray crosses eight planes of one axis.
#[inline(always)]
fn distances<S: Simd, const FUSED: bool>(planes: S::F8, inverse: S::F8, offset: f32) -> S::F8 {
    let offset = S::f8_splat(offset);
    if FUSED { S::mul_sub(planes, inverse, offset) } else { S::f8_mul(S::f8_sub(planes, offset), inverse) }
}
