//! Which atom is rendered when: block by block, each over all pixels, in the order in which blocks are joined.

use crate::layout::{BLOCK_SAMPLES, RenderConstants, SliceConstants};

/// Hands out the atoms of a run: block by block, each over all pixels.
pub(super) struct Schedule {
    pixels: u64,
    first_block: u32,
    next_atom: u64,
    atoms: u64,
}

impl Schedule {
    pub(super) fn new(constants: &RenderConstants) -> Self {
        let pixels = padded_pixels(constants);
        let first_block = constants.first_sample / BLOCK_SAMPLES;
        let blocks = constants.end_sample.div_ceil(BLOCK_SAMPLES) - first_block;
        Self { pixels, first_block, next_atom: 0, atoms: pixels * u64::from(blocks) }
    }

    pub(super) fn is_done(&self) -> bool {
        self.next_atom >= self.atoms
    }

    /// The next slice, of at most so many atoms and lanes.
    pub(super) fn next(&mut self, atoms: u32, lanes: u32, ray_budget: u32) -> SliceConstants {
        let atoms = atoms.min(u32::try_from(self.atoms - self.next_atom).unwrap_or(u32::MAX));
        let constants = SliceConstants {
            first_atom: (self.next_atom % self.pixels) as u32,
            lanes: lanes.min(atoms),
            atoms,
            first_block: self.first_block + (self.next_atom / self.pixels) as u32,
            ray_budget,
            ..SliceConstants::default()
        };
        self.next_atom += u64::from(atoms);
        constants
    }
}

/// Pixels of the film rounded up to whole 8×8 tiles.
pub(super) fn padded_pixels(constants: &RenderConstants) -> u64 {
    u64::from(constants.width.div_ceil(8)) * u64::from(constants.height.div_ceil(8)) * 64
}

/// The pixel of an index, as `pixel_of_index` in shaders/include/lane.glsl.
pub(super) fn pixel_of_index(constants: &RenderConstants, index: u64) -> (u32, u32) {
    let tiles_across = u64::from(constants.width.div_ceil(8));
    let (tile, inside) = (index / 64, index % 64);
    let x = tile % tiles_across * 8 + inside % 8;
    let y = tile / tiles_across * 8 + inside / 8;
    (u32::try_from(x).unwrap_or(u32::MAX), u32::try_from(y).unwrap_or(u32::MAX))
}

/// The index of a pixel.
pub(super) fn index_of_pixel(constants: &RenderConstants, x: u32, y: u32) -> u32 {
    let tile = y / 8 * constants.width.div_ceil(8) + x / 8;
    tile * 64 + y % 8 * 8 + x % 8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pixel_has_the_index_that_it_is_found_by() {
        let constants = RenderConstants { width: 21, height: 9, ..RenderConstants::default() };
        for (x, y) in [(0, 0), (7, 7), (8, 0), (20, 8), (3, 8)] {
            assert_eq!(pixel_of_index(&constants, u64::from(index_of_pixel(&constants, x, y))), (x, y));
        }
    }
}
