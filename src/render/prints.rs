//! What a kernel prints by DEBUG_PRINT (shaders/include/debug.glsl).

use std::time::Instant;

use super::path_tracer::PathTracer;
use crate::Result;
use crate::layout::{Atom, BlockResult, DEBUG_RECORDS, SliceConstants};

/// A value that a sample printed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Printed {
    /// Number of the line, as `DEBUG_PRINT_AT` was given it; from 1.
    pub place: u32,
    /// The value, as text: numbers as short as tells them apart, vectors in parentheses.
    pub value: String,
}

impl PathTracer {
    /// What the kernel prints for one sample of the pixel in column `x` and row `y`: the first [`DEBUG_RECORDS`] values.
    /// Only for a kernel that was compiled with `DEBUG_PRINTS`.
    ///
    /// # Errors
    /// When the device is lost.
    pub fn prints(&mut self, seed: u32, (x, y): (u32, u32), sample: u32) -> Result<Vec<Printed>> {
        self.constants.seed = seed;
        self.view.constants.write(&[self.constants])?;
        let push = SliceConstants {
            // In one dispatch: what is printed is counted in it.
            ray_budget: u32::MAX,
            prints: 1,
            ..SliceConstants::default()
        };
        let atom = Atom { pixel: x | y << 16, first_sample: sample, end_sample: sample + 1 };
        self.slices[0].submit(&self.kernel, 0, &[atom], push)?;
        self.slices[0].finish(&self.kernel, 0, Instant::now())?;
        let records = self.slices[0].results(2 + DEBUG_RECORDS)?;
        Ok(decode(&records[1..]))
    }
}

/// The records behind a lane's result, up to the empty header.
fn decode(records: &[BlockResult]) -> Vec<Printed> {
    records.iter().take_while(|record| record.rays_and_samples != 0).map(decode_record).collect()
}

fn decode_record(record: &BlockResult) -> Printed {
    let header = record.rays_and_samples;
    let [x, y, z] = record.sum.map(f32::to_bits);
    let words = [x, y, z, record.non_finite_and_capped];
    let text = |word: &u32| match header >> 4 & 0xf {
        0 => f32::from_bits(*word).to_string(),
        1 => word.cast_signed().to_string(),
        2 => word.to_string(),
        _ => (*word != 0).to_string(),
    };
    let components: Vec<_> = words.iter().take((header & 0xf) as usize).map(text).collect();
    let value = match components.as_slice() {
        [single] => single.clone(),
        several => format!("({})", several.join(", ")),
    };
    Printed { place: header >> 8, value }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn record(header: u32, [x, y, z, w]: [u32; 4]) -> BlockResult {
        let sum = [x, y, z].map(f32::from_bits);
        BlockResult { sum, rays_and_samples: header, non_finite_and_capped: w, ..BlockResult::default() }
    }

    #[test]
    fn records_are_read_up_to_the_empty_header() {
        let [one, tenth, nan] = [1.0_f32, 0.1, f32::NAN].map(f32::to_bits);
        let records = [
            record(7 << 8 | 3, [one, tenth, nan, 5]),
            record(8 << 8 | 1 << 4 | 1, [u32::MAX, 0, 0, 0]),
            record(9 << 8 | 2 << 4 | 2, [u32::MAX, 3, 0, 0]),
            record(9 << 8 | 3 << 4 | 1, [1, 0, 0, 0]),
            record(0, [0; 4]),
            record(1 << 8 | 1, [0; 4]),
        ];
        let read: Vec<_> = decode(&records).into_iter().map(|p| (p.place, p.value)).collect();
        let expected = [(7, "(1, 0.1, NaN)"), (8, "-1"), (9, "(4294967295, 3)"), (9, "true")];
        assert_eq!(read, expected.map(|(place, value)| (place, value.to_owned())));
    }
}
