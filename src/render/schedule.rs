//! Which atom is rendered when: block by block of the image's samples, each over all pixels, in the order in which blocks are
//! joined.

use std::ops::Range;

use super::adaptive::SampleFactors;
use crate::layout::{Atom, BLOCK_SAMPLES, RenderConstants};

/// Hands out the atoms of a range of the image's samples.
pub(super) struct Schedule {
    width: u32,
    height: u32,
    samples: Range<u32>,
    /// Where it stands: the image's samples up to the end of a block, and the pixel whose atoms of them come next.
    block: Range<u32>,
    place: TilePlace,
    /// The first sample of that pixel that is not handed out; `None` before its first.
    first: Option<u32>,
}

impl Schedule {
    pub(super) fn new(constants: &RenderConstants, samples: Range<u32>) -> Self {
        let block = block_at(samples.start, samples.end);
        let (width, height) = (constants.width, constants.height);
        Self { width, height, samples, block, place: TilePlace::default(), first: None }
    }

    pub(super) fn is_done(&self) -> bool {
        self.block.is_empty()
    }

    /// The next atoms, at most so many of them.
    pub(super) fn next(&mut self, most: u32, factors: &SampleFactors) -> Vec<Atom> {
        let mut atoms = Vec::with_capacity(most as usize);
        while !self.is_done() && self.hand_out_pixel(&mut atoms, most as usize, factors) {
            if !self.place.advance(self.width, self.height) {
                self.place = TilePlace::default();
                self.block = block_at(self.block.end, self.samples.end);
            }
        }
        atoms
    }

    /// The atoms of the pixel's samples in the block; false if not all of them have room.
    fn hand_out_pixel(&mut self, atoms: &mut Vec<Atom>, most: usize, factors: &SampleFactors) -> bool {
        let (x, y) = self.place.pixel();
        if x >= self.width || y >= self.height {
            return true;
        }
        let own = factors.own_samples(y as usize * self.width as usize + x as usize, &self.block);
        let mut first = self.first.take().unwrap_or(own.start);
        while first < own.end {
            if atoms.len() == most {
                self.first = (first > own.start).then_some(first);
                return false;
            }
            let end = block_at(first, own.end).end;
            atoms.push(Atom { pixel: x | y << 16, first_sample: first, end_sample: end });
            first = end;
        }
        true
    }

    /// One past the last of the image's samples that some pixel has been handed out.
    pub(super) fn reached(&self) -> u32 {
        let begun = self.place != TilePlace::default() || self.first.is_some();
        if begun { self.block.end } else { self.block.start }
    }
}

/// The samples from `first` to the end of its block, or to `end`.
fn block_at(first: u32, end: u32) -> Range<u32> {
    // The last block may end at sample index 2^32 − 1.
    first..first + (BLOCK_SAMPLES - first % BLOCK_SAMPLES).min(end - first)
}

/// A pixel by 8×8 tiles in rows, and row by row inside a tile, so that neighbours are traced together. The last tiles reach
/// beyond the film.
#[derive(Clone, Copy, Default, PartialEq)]
struct TilePlace {
    left: u32,
    top: u32,
    inside: u32,
}

impl TilePlace {
    fn pixel(self) -> (u32, u32) {
        (self.left + self.inside % 8, self.top + self.inside / 8)
    }

    /// To the next; false if it was the last.
    fn advance(&mut self, width: u32, height: u32) -> bool {
        self.inside += 1;
        if self.inside == 64 {
            (self.inside, self.left) = (0, self.left + 8);
        }
        if self.left >= width {
            (self.left, self.top) = (0, self.top + 8);
        }
        self.top < height
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WIDTH: u32 = 21;
    const HEIGHT: u32 = 9;
    const PIXELS: usize = (WIDTH * HEIGHT) as usize;

    /// The samples of every pixel, in the order in which they are handed out.
    fn handed_out(samples: Range<u32>, most: u32, factors: &SampleFactors) -> Vec<Vec<u32>> {
        let constants = RenderConstants { width: WIDTH, height: HEIGHT, ..RenderConstants::default() };
        let mut schedule = Schedule::new(&constants, samples);
        let mut pixels = vec![Vec::new(); PIXELS];
        while !schedule.is_done() {
            let atoms = schedule.next(most, factors);
            assert!(!atoms.is_empty() && atoms.len() <= most as usize);
            for atom in atoms {
                let (x, y) = atom.place();
                assert_eq!(atom.block(), (atom.end_sample - 1) / BLOCK_SAMPLES, "an atom is in one block");
                pixels[(y * WIDTH + x) as usize].extend(atom.first_sample..atom.end_sample);
            }
        }
        pixels
    }

    #[test]
    fn every_pixel_has_its_samples_in_order_however_slices_are_cut() {
        for most in [1, 7, 1000] {
            for samples in [0..1, 3..40, 16..32] {
                let even = handed_out(samples.clone(), most, &SampleFactors::default());
                assert!(even.iter().all(|pixel| pixel.iter().copied().eq(samples.clone())), "{samples:?}");
                let factors = SampleFactors::from_log2((0..PIXELS).map(|pixel| pixel as u8 % 5).collect());
                for (pixel, its) in handed_out(samples.clone(), most, &factors).iter().enumerate() {
                    let factor = 1 << (pixel % 5);
                    assert!(
                        its.iter().copied().eq(samples.start * factor..samples.end * factor),
                        "{samples:?} {pixel}"
                    );
                }
            }
        }
    }

    #[test]
    fn the_last_block_ends_at_the_last_index() {
        assert_eq!(handed_out(u32::MAX - 20..u32::MAX, 50, &SampleFactors::default())[5].len(), 20);
    }

    #[test]
    fn it_says_how_far_it_has_come() {
        let constants = RenderConstants { width: 8, height: 8, ..RenderConstants::default() };
        let mut schedule = Schedule::new(&constants, 10..40);
        assert_eq!(schedule.reached(), 10);
        schedule.next(1, &SampleFactors::default());
        assert_eq!(schedule.reached(), 16);
        schedule.next(63, &SampleFactors::default());
        assert_eq!(schedule.reached(), 16);
        schedule.next(65, &SampleFactors::default());
        assert_eq!((schedule.reached(), schedule.is_done()), (40, false));
        schedule.next(100, &SampleFactors::default());
        assert_eq!((schedule.reached(), schedule.is_done()), (40, true));
    }
}
