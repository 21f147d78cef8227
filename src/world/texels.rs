//! The values of textures at surfaces.

use glam::DVec3;

use crate::scene::{TEXTURE_SLOTS, TextureSlot};

/// The values of textures at the surfaces of a ray generation, one array a slot. It is empty where no surface's
/// material has a texture in that slot, and where textures are off.
#[derive(Default)]
pub struct Texels([Vec<DVec3>; TEXTURE_SLOTS.len()]);

impl Texels {
    /// The value at a surface: the slot's default without texture.
    #[inline(always)]
    pub fn get(&self, slot: TextureSlot, i: usize) -> DVec3 {
        self.0[slot as usize].get(i).copied().unwrap_or(slot.entry().default)
    }

    /// The values of a slot at all of `count` surfaces.
    pub fn of_mut(&mut self, slot: TextureSlot, count: usize) -> &mut [DVec3] {
        let values = &mut self.0[slot as usize];
        values.resize(count, slot.entry().default);
        values
    }

    /// Whether no surface has a texture.
    pub fn is_empty(&self) -> bool {
        self.0.iter().all(Vec::is_empty)
    }

    /// Removes all values.
    pub fn clear(&mut self) {
        self.0.iter_mut().for_each(Vec::clear);
    }

    /// Bytes of memory, without the struct itself.
    pub fn bytes(&self) -> usize {
        self.0.iter().map(|values| values.capacity() * size_of::<DVec3>()).sum()
    }
}
