//! Which atom is rendered when: block by block, each over all pixels, in the order in which blocks are joined.

use super::tile_order::TileOrder;
use crate::layout::{BLOCK_SAMPLES, RenderConstants, SliceConstants};

/// Hands out the atoms of a run: block by block, each over all pixels.
pub(super) struct Schedule {
    pixels: u64,
    first_block: u32,
    next_atom: u64,
    atoms: u64,
}

impl Schedule {
    pub(super) fn new(constants: &RenderConstants, order: &TileOrder) -> Self {
        let pixels = order.pixels();
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
