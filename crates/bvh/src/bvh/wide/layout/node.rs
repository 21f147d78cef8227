//! [`Node`]: the bounds of eight children as structures of arrays, and [`Child`], a reference to a node or leaf in 32
//! bits.

use std::ops::Range;

use crate::geometry::Bounds;
use bytemuck::{Pod, Zeroable};
use glam::Vec3;

/// Children per node.
pub(crate) const WIDTH: usize = 8;

/// The bounds of eight children, and references to them.
#[derive(Clone, Copy)]
#[repr(C, align(64))]
pub(crate) struct Node {
    /// `planes[axis][0]` are the lower, `planes[axis][1]` the upper coordinates. Bounds of empty places are inverted,
    /// and no ray enters them.
    pub planes: [[[f32; WIDTH]; 2]; 3],
    /// References to the children.
    pub children: [Child; WIDTH],
    /// The occupied places, as bits: for rays with a direction component of 0, and for code without a ray.
    pub present: u32,
}

/// A reference to a node or leaf, packed in 32 bits.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(transparent)]
pub(crate) struct Child(u32);

/// An unpacked [`Child`].
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Content {
    /// The inner node of that index.
    Node(u32),
    /// A leaf: a range of [`TriangleLeaf`](super::TriangleLeaf)s; in a [`Tree`](super::Tree), of boxes.
    Triangles(Range<u32>),
    /// A leaf: a range of analytic shapes.
    Analytic(Range<u32>),
}

impl Child {
    /// The most triangle leaves, analytic shapes or boxes that a reference can span.
    pub(crate) const MAX_COUNT: usize = 4;
    /// The limit of indices of nodes, triangle leaves, analytic shapes and boxes.
    pub(crate) const MAX_INDICES: usize = 1 << 28;

    const ANALYTIC: u32 = 1 << 31;
    const LEAF: u32 = 1 << 30;
    const COUNT_SHIFT: u32 = 28;
    const INDEX: u32 = (1 << Self::COUNT_SHIFT) - 1;

    /// A reference to an inner node.
    pub(crate) fn node(index: usize) -> Self {
        assert!(index < Self::MAX_INDICES, "more nodes than a structure can number");
        Child(index as u32)
    }

    /// A reference to a leaf of analytic shapes, or of triangles or boxes.
    pub(crate) fn leaf(first: usize, count: usize, shapes: bool) -> Self {
        assert!(first + count <= Self::MAX_INDICES, "more primitives than a structure can number");
        debug_assert!((1..=Self::MAX_COUNT).contains(&count));
        let kind = if shapes { Self::ANALYTIC } else { 0 };
        Child(Self::LEAF | kind | (count as u32 - 1) << Self::COUNT_SHIFT | first as u32)
    }

    /// A reference to nothing: the sentinel at the bottom of a stream's stacks.
    pub(crate) const NOTHING: Child = Child(Self::ANALYTIC);

    /// The number of values of [`Child::kind`].
    pub(crate) const KINDS: usize = 4;
    /// The kind of an inner node.
    pub(crate) const KIND_NODE: usize = 0;
    /// The kind of a leaf of triangles.
    pub(crate) const KIND_TRIANGLES: usize = 1;
    /// The kind of [`Child::NOTHING`].
    pub(crate) const KIND_NOTHING: usize = 2;
    /// The kind of a leaf of analytic shapes.
    pub(crate) const KIND_ANALYTIC: usize = 3;

    /// The kind of the reference, below [`Child::KINDS`].
    #[inline(always)]
    pub(crate) fn kind(self) -> usize {
        (self.0 >> Self::LEAF.trailing_zeros()) as usize
    }

    /// Whether it refers to a leaf.
    #[inline(always)]
    pub(crate) fn is_leaf(self) -> bool {
        self.0 & Self::LEAF != 0
    }

    /// The index of the node, or of the first triangle leaf or analytic shape.
    #[inline(always)]
    pub(crate) fn index(self) -> usize {
        (self.0 & Self::INDEX) as usize
    }

    /// The triangle leaves, analytic shapes or boxes of a leaf.
    #[inline(always)]
    pub(crate) fn range(self) -> Range<usize> {
        let more = self.0 >> Self::COUNT_SHIFT & (Self::MAX_COUNT as u32 - 1);
        self.index()..self.index() + 1 + more as usize
    }

    /// The bits of the reference.
    #[inline(always)]
    pub(crate) fn as_bits(self) -> u32 {
        self.0
    }

    /// The bits of eight references.
    #[inline(always)]
    pub(crate) fn bits(children: &[Child; WIDTH]) -> &[u32; WIDTH] {
        bytemuck::cast_ref(children)
    }

    /// The reference of given bits.
    #[inline(always)]
    pub(crate) fn of_bits(bits: u32) -> Child {
        Child(bits)
    }

    /// The reference, unpacked.
    #[inline(always)]
    pub(crate) fn content(self) -> Content {
        let (first, end) = (self.index() as u32, self.range().end as u32);
        match (self.0 & Self::LEAF != 0, self.0 & Self::ANALYTIC != 0) {
            (false, _) => Content::Node(first),
            (true, false) => Content::Triangles(first..end),
            (true, true) => Content::Analytic(first..end),
        }
    }
}

impl Node {
    /// A node without children.
    pub(crate) const EMPTY: Node = Node {
        planes: [[[f32::INFINITY; WIDTH], [f32::NEG_INFINITY; WIDTH]]; 3],
        children: [Child(Child::INDEX); WIDTH],
        present: 0,
    };

    /// Writes a child and its bounds to a place.
    pub(crate) fn set(&mut self, place: usize, b: Bounds, child: Child) {
        for axis in 0..3 {
            self.planes[axis][0][place] = b.min[axis];
            self.planes[axis][1][place] = b.max[axis];
        }
        self.children[place] = child;
        self.present |= 1 << place;
    }

    /// The bounds of a child.
    pub(crate) fn bounds(&self, place: usize) -> Bounds {
        let side =
            |side: usize| Vec3::from_array([0, 1, 2].map(|axis: usize| self.planes[axis][side][place]));
        Bounds { min: side(0), max: side(1) }
    }

    /// The bounds of all children.
    pub(crate) fn whole(&self) -> Bounds {
        let least = |axis: usize| self.planes[axis][0].into_iter().fold(f32::INFINITY, f32::min);
        let greatest = |axis: usize| self.planes[axis][1].into_iter().fold(f32::NEG_INFINITY, f32::max);
        let [min, max] = [[0, 1, 2].map(least), [0, 1, 2].map(greatest)];
        Bounds { min: min.into(), max: max.into() }
    }

    /// The occupied places.
    pub(crate) fn places(&self) -> impl Iterator<Item = usize> {
        let present = self.present;
        (0..WIDTH).filter(move |place| present >> place & 1 != 0)
    }
}
