//! The best hits of a packet's rays so far, and the depths that they are known to lie between.
//!
//! A triangle that a ray surely meets ([`Edges`](super::edges::Edges)) needs no test while it is surely nearer than all others, or surely
//! farther than the best: most rays are tested against one triangle only, once the walk is over.

use super::lanes::{BLOCKS, Lanes};
use super::node::WIDTH;
use crate::geometry::bundle::RAYS;
use crate::geometry::simd::Simd;
use crate::geometry::{Hit, PrimId, SlotId};

/// What the rays of a packet have found.
pub struct Best {
    /// What is surely before this depth comes before the best hit; nothing is known where rays run the same way.
    near: [[f32; WIDTH]; BLOCKS],
    /// What is surely beyond this depth comes after it.
    pub far: [[f32; WIDTH]; BLOCKS],
    /// The slot of a triangle that is surely met, [`TESTED`] or [`NOTHING`].
    slots: [[u32; WIDTH]; BLOCKS],
    /// The hits of the rays that were tested.
    hits: Vec<Hit>,
}

/// The best is a hit that was tested.
const TESTED: u32 = NOTHING - 1;
/// There is none.
const NOTHING: u32 = u32::MAX;

/// What is the best of a ray.
#[derive(Clone, Copy)]
pub enum Found {
    /// Nothing yet.
    Nothing,
    /// A triangle that it surely meets, not yet tested.
    Surely(SlotId),
    /// A hit.
    Hit(Hit),
}

impl Default for Best {
    fn default() -> Self {
        let nothing = Hit { t: 0.0, prim: PrimId(0), slot: SlotId(0), weights: [0.0; 2] };
        Best {
            near: [[f32::NEG_INFINITY; WIDTH]; BLOCKS],
            far: [[f32::NEG_INFINITY; WIDTH]; BLOCKS],
            slots: [[NOTHING; WIDTH]; BLOCKS],
            hits: vec![nothing; WIDTH * BLOCKS],
        }
    }
}

impl Best {
    /// Of rays that have found nothing: what counts ends where they do, and their depths may be off by `spread`.
    #[inline(always)]
    pub fn begin<S: Simd>(&mut self, lanes: &Lanes, spread: f32) {
        let spread = S::f8_splat(spread);
        for block in 0..lanes.blocks {
            let [near, far] = lanes.depths::<S>(block);
            self.near[block] = S::f8_array(S::f8_sub(near, spread));
            self.far[block] = S::f8_array(S::f8_add(far, spread));
        }
        self.slots[..lanes.blocks].fill([NOTHING; WIDTH]);
    }

    /// Of those rays of a block that surely meet a triangle between two depths: the ones that do so nearer than their best,
    /// and the ones that do so farther.
    #[inline(always)]
    pub fn compare<S: Simd>(&self, block: usize, [near, far]: [S::F8; 2]) -> [u32; 2] {
        [S::f8_le(far, S::f8(self.near[block])), S::f8_le(S::f8(self.far[block]), near)]
    }

    /// The triangle in `slot` is from now on the best of some rays of a block.
    #[inline(always)]
    pub fn take<S: Simd>(&mut self, block: usize, rays: u32, slot: u32, [near, far]: [S::F8; 2]) {
        self.near[block] = S::f8_array(S::f8_select(rays, near, S::f8(self.near[block])));
        self.far[block] = S::f8_array(S::f8_select(rays, far, S::f8(self.far[block])));
        S::write(rays, slot, &mut self.slots[block]);
    }

    /// Nothing counts any more for some rays of a block.
    #[inline(always)]
    pub fn end<S: Simd>(&mut self, block: usize, rays: u32) {
        let nowhere = S::f8_splat(f32::NEG_INFINITY);
        self.far[block] = S::f8_array(S::f8_select(rays, nowhere, S::f8(self.far[block])));
    }

    /// A hit that was tested is from now on the best of its ray, where it is between two depths.
    #[inline(always)]
    pub fn set(&mut self, ray: usize, hit: &Hit, [near, far]: [f32; 2]) {
        let (block, lane) = (ray / WIDTH % BLOCKS, ray % WIDTH);
        (self.near[block][lane], self.far[block][lane]) = (near, far);
        self.keep(ray, hit);
    }

    /// What was the best of a ray was tested, and is this hit.
    #[inline(always)]
    pub fn keep(&mut self, ray: usize, hit: &Hit) {
        self.slots[ray / WIDTH % BLOCKS][ray % WIDTH] = TESTED;
        self.hits[ray] = *hit;
    }

    /// The slots of the triangles that four rays surely meet, from the one at `first` on, a multiple of 4; see [`Best::is_slot`].
    #[inline(always)]
    pub fn slots_of(&self, first: usize) -> [u32; RAYS] {
        let [low, high] = self.slots[first / WIDTH % BLOCKS].as_chunks().0 else {
            unreachable!("two halves")
        };
        if first.is_multiple_of(WIDTH) { *low } else { *high }
    }

    /// Whether that is one.
    #[inline(always)]
    pub fn is_slot(slot: u32) -> bool {
        slot < TESTED
    }

    /// The best of a ray.
    #[inline(always)]
    pub fn of(&self, ray: usize) -> Found {
        match self.slots[ray / WIDTH % BLOCKS][ray % WIDTH] {
            NOTHING => Found::Nothing,
            TESTED => Found::Hit(self.hits[ray]),
            slot => Found::Surely(SlotId(slot)),
        }
    }
}
