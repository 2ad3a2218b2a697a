//! Mip chains: each level is the mean, in linear light, of the texels of the level above that it covers.

use rayon::prelude::*;

use super::textures::{ColorSpace, srgb_to_linear};
use crate::scene::{Image, Texels};

/// Linear RGBA of one level, row by row.
struct Level {
    width: u32,
    height: u32,
    texels: Vec<[f32; 4]>,
}

/// The levels 1, 2, … of an image's chain, down to a single texel, of 16 bits a channel: 8 bits of a linear number would be
/// too few in the dark, and sRGB would be decoded for each of four texels of a lookup. Empty for an image of one texel.
pub(super) fn mip_chain(image: &Image, space: ColorSpace) -> Vec<Vec<[u16; 4]>> {
    let linear = LinearTexels::new(image, space);
    let mut levels = Vec::new();
    let mut above: Option<Level> = None;
    loop {
        let (width, height) = above.as_ref().map_or((image.width, image.height), |level| (level.width, level.height));
        if width == 1 && height == 1 {
            return levels;
        }
        let level = match &above {
            None => half_size(width, height, |index| linear.at(index)),
            Some(above) => half_size(width, height, |index| above.texels[index]),
        };
        // Within [0, 1], as means are.
        let quantise = |value: f32| (value * 65535.0).round() as u16;
        levels.push(level.texels.par_iter().map(|texel| texel.map(quantise)).collect());
        above = Some(level);
    }
}

/// The level below one of the given size. Where a side is odd, a texel of it covers parts of three of the level above.
fn half_size(width: u32, height: u32, texel: impl Fn(usize) -> [f32; 4] + Sync) -> Level {
    let (columns, rows) = (taps(width), taps(height));
    let row = |weights: &[(usize, f32)]| {
        let mean = |across: &Vec<(usize, f32)>| {
            let mut sum = [0.0; 4];
            for &(y, weight_y) in weights {
                for &(x, weight_x) in across {
                    let value = texel(y * width as usize + x);
                    sum = [0, 1, 2, 3].map(|c: usize| sum[c] + weight_x * weight_y * value[c]);
                }
            }
            sum
        };
        columns.iter().map(mean).collect::<Vec<_>>()
    };
    let texels = rows.par_iter().flat_map_iter(|weights| row(weights)).collect();
    Level { width: columns.len() as u32, height: rows.len() as u32, texels }
}

/// For each texel of a side of max(1, ⌊n/2⌋): the texels of a side of n that it covers, and the share of each.
fn taps(n: u32) -> Vec<Vec<(usize, f32)>> {
    let half = (n / 2).max(1);
    let scale = f64::from(n) / f64::from(half);
    (0..half)
        .map(|i| {
            let (start, end) = (f64::from(i) * scale, f64::from(i + 1) * scale);
            let covered = start.floor() as u32..(end.ceil() as u32).min(n);
            let share = |j: u32| (f64::from(j + 1).min(end) - f64::from(j).max(start)) / scale;
            covered.map(|j| (j as usize, share(j) as f32)).collect()
        })
        .collect()
}

/// An image's texels as linear numbers in [0, 1].
struct LinearTexels<'a> {
    texels: &'a Texels,
    /// Of RGB by code, for 8 bits; without sRGB, and of 16 bits, they are the code over its maximum.
    decoded: Vec<f32>,
    srgb: bool,
}

impl<'a> LinearTexels<'a> {
    fn new(image: &'a Image, space: ColorSpace) -> Self {
        let srgb = space == ColorSpace::Srgb;
        let decode = |code: u32| {
            let encoded = f64::from(code) / 255.0;
            (if srgb { srgb_to_linear(encoded) } else { encoded }) as f32
        };
        Self { texels: &image.texels, decoded: (0..256).map(decode).collect(), srgb }
    }

    fn at(&self, index: usize) -> [f32; 4] {
        match self.texels {
            Texels::Rgba8(texels) => {
                let [r, g, b, a] = texels[index];
                let color = [r, g, b].map(|code| self.decoded[usize::from(code)]);
                [color[0], color[1], color[2], f32::from(a) / 255.0]
            }
            Texels::Rgba16(texels) => {
                let [r, g, b, a] = texels[index].map(|code| f64::from(code) / 65535.0);
                let color = [r, g, b].map(|encoded| if self.srgb { srgb_to_linear(encoded) } else { encoded } as f32);
                [color[0], color[1], color[2], a as f32]
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(width: u32, height: u32, texels: Vec<[u8; 4]>) -> Image {
        Image { name: String::new(), width, height, texels: Texels::Rgba8(texels) }
    }

    #[test]
    fn shares_of_an_odd_side_are_those_of_the_lengths() {
        assert_eq!(taps(4), [vec![(0, 0.5), (1, 0.5)], vec![(2, 0.5), (3, 0.5)]]);
        let fifths = [vec![(0, 0.4), (1, 0.4), (2, 0.2)], vec![(2, 0.2), (3, 0.4), (4, 0.4)]];
        for (got, expected) in taps(5).iter().zip(&fifths) {
            for (&(j, share), &(expected_j, expected_share)) in got.iter().zip(expected) {
                assert!(j == expected_j && (share - expected_share).abs() < 1e-7, "{got:?}");
            }
        }
        assert_eq!(taps(1), [vec![(0, 1.0)]]);
        for n in 1..300 {
            let mut of_each = vec![0.0_f64; n as usize];
            taps(n).iter().flatten().for_each(|&(j, share)| of_each[j] += f64::from(share));
            let fair = f64::from((n / 2).max(1)) / f64::from(n);
            assert!(of_each.iter().all(|share| (share - fair).abs() < 1e-6), "texels of {n} count alike");
        }
    }

    #[test]
    fn every_level_has_the_mean_in_linear_light() {
        for (width, height) in [(1, 1), (2, 1), (1, 7), (8, 8), (13, 5), (100, 37)] {
            let codes = |i: u32| [(i * 37 % 256) as u8, (i * 101 % 256) as u8, (i % 3) as u8, (i * 5 % 256) as u8];
            let image = image(width, height, (0..width * height).map(codes).collect());
            for space in [ColorSpace::Srgb, ColorSpace::Linear] {
                let Texels::Rgba8(texels) = &image.texels else { unreachable!() };
                let decode = |texel: &[u8; 4], c: usize| {
                    let encoded = f64::from(texel[c]) / 255.0;
                    if c < 3 && space == ColorSpace::Srgb { srgb_to_linear(encoded) } else { encoded }
                };
                let mean = |c: usize| texels.iter().map(|texel| decode(texel, c)).sum::<f64>() / texels.len() as f64;
                let chain = mip_chain(&image, space);
                assert_eq!(chain.len() as u32, width.max(height).ilog2());
                for (level, l) in chain.iter().zip(1..) {
                    assert_eq!(level.len() as u32, (width >> l).max(1) * (height >> l).max(1));
                    for c in 0..4 {
                        let sum: f64 = level.iter().map(|texel| f64::from(texel[c]) / 65535.0).sum();
                        // Half a step of 16 bits at most, and sums in f32.
                        let error = (sum / level.len() as f64 - mean(c)).abs();
                        assert!(error < 0.5 / 65535.0 + 1e-6, "{width}x{height} level {l} channel {c}: {error:e}");
                    }
                }
            }
        }
    }

    #[test]
    fn black_beside_white_is_half_of_the_light() {
        let chain = mip_chain(&image(2, 1, vec![[0, 0, 0, 0], [255; 4]]), ColorSpace::Srgb);
        assert_eq!(chain, [[[32768; 4]]]);
    }
}
