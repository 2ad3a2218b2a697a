//! The four texels between which an environment is interpolated, in one element: a lookup then loads one where it would load
//! four. Only for images whose texels RGBE holds exactly, as those of .hdr files: nothing is rounded.

use crate::layout::Texel;

/// Most texels of an image that is stored so: with their probabilities, quads take twice the memory.
const MOST_TEXELS: usize = 1 << 22;
/// Exponents that the shader's arithmetic can take (see `rgbe_radiance` in shaders/include/environment.glsl).
const EXPONENTS: std::ops::RangeInclusive<i32> = 10..=254;

/// The texels in RGBE, or `None` if one of them is not exact in it or they are too many.
pub(super) fn rgbe_words(texels: &[[f32; 3]]) -> Option<Vec<u32>> {
    if texels.len() > MOST_TEXELS {
        return None;
    }
    texels.iter().map(|&texel| rgbe_word(texel)).collect()
}

/// Red at bit 0, green at bit 8, blue at bit 16, each times 2^(e − 136) with e at bit 24 (Ward 1991, "Real Pixels").
fn rgbe_word(texel: [f32; 3]) -> Option<u32> {
    let largest = texel.into_iter().fold(0.0, f32::max);
    if largest == 0.0 && texel == [0.0; 3] {
        return Some((*EXPONENTS.start() as u32) << 24);
    }
    // Of a float in [2^(k−1), 2^k) the biased exponent is k + 126, and e is k + 128.
    let exponent = (largest.to_bits() >> 23) as i32 + 2;
    if !EXPONENTS.contains(&exponent) {
        return None;
    }
    let step = f64::from(exponent - 136).exp2();
    let mut word = (exponent as u32) << 24;
    for (channel, value) in texel.into_iter().enumerate() {
        let mantissa = f64::from(value) / step;
        // A NaN is none either.
        if !(0.0..256.0).contains(&mantissa) || mantissa.fract() != 0.0 {
            return None;
        }
        word |= (mantissa as u32) << (8 * channel);
    }
    Some(word)
}

/// Element (y + 1)·width + x holds the texels (x, y), (x + 1, y), (x, y + 1) and (x + 1, y + 1), for y from −1: columns go
/// round, and beyond the first and the last row these are repeated.
pub(super) fn quads(width: usize, words: &[u32]) -> Vec<Texel> {
    let rows: Vec<&[u32]> = words.chunks_exact(width).collect();
    let row = |y: usize| rows[y.clamp(1, rows.len()) - 1];
    (0..=rows.len())
        .flat_map(|y| {
            let (top, bottom) = (row(y), row(y + 1));
            (0..width).map(move |x| {
                let next = (x + 1) % width;
                [top[x], top[next], bottom[x], bottom[next]]
            })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn decoded(word: u32) -> [f32; 3] {
        let scale = f64::from((word >> 24) as i32 - 136).exp2();
        [0, 8, 16].map(|shift| (f64::from(word >> shift & 255) * scale) as f32)
    }

    #[test]
    fn what_is_exact_in_rgbe_comes_back_and_nothing_else_is_taken() {
        let tiny = f32::from_bits(11 << 23);
        let exact = [[0.0; 3], [1.0, 0.5, 0.0], [255.0, 254.0, 1.0], [299_008.0, 0.0, 196_608.0], [tiny, 0.0, 0.0]];
        for texel in exact {
            assert_eq!(rgbe_word(texel).map(decoded), Some(texel), "{texel:?}");
        }
        let refused =
            [[1.0, 1.0 / 512.0, 0.0], [f32::INFINITY, 1.0, 1.0], [f32::NAN; 3], [-1.0, 1.0, 1.0], [-1.0, 0.0, 0.0]];
        assert!(refused.iter().all(|&texel| rgbe_word(texel).is_none()));
        assert!(rgbe_word([257.0 / 256.0, 1.0, 1.0]).is_none());
        assert!(rgbe_word([f32::from_bits(7 << 23), 0.0, 0.0]).is_none(), "too small for the shader");
        assert_eq!(rgbe_words(&[[1.0; 3], [0.1; 3]]), None);
    }

    #[test]
    fn quads_go_round_and_stop_at_the_poles() {
        let quads = quads(3, &[0, 1, 2, 10, 11, 12]);
        assert_eq!(quads.len(), 9);
        assert_eq!([quads[0], quads[2]], [[0, 1, 0, 1], [2, 0, 2, 0]]);
        assert_eq!([quads[3], quads[5]], [[0, 1, 10, 11], [2, 0, 12, 10]]);
        assert_eq!([quads[6], quads[8]], [[10, 11, 10, 11], [12, 10, 12, 10]]);
    }
}
