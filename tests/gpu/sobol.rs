//! The Sobol' sampler of shaders/include/sobol.glsl: what a pixel and squares of pixels are promised holds exactly, and over
//! seeds every number is uniform and independent of the others.

use crate::common::gpu;
use crate::common::kernel::TestKernel;
use crate::common::statistics::sidak;

use super::sampler::{Along, dimension_p_values, pair_p_values};

/// Specialisation constant SAMPLER and its values.
const SAMPLER: u32 = 10;
const SOBOL: u32 = 1;
const REPLICATES: u32 = 2;
/// Groups of rng.glsl that are made of pairs: film, time, scatter, light, environment, emission.
const GROUPS: [u32; 6] = [0, 1, 2, 3, 4, 6];
/// Width of a tile.
const TILE: u32 = 32;

#[derive(Clone, Copy, Debug)]
struct Key {
    pixel: [u32; 2],
    index: u32,
    seed: u32,
    bounce: u32,
    group: u32,
}

fn kernel(sampler: u32) -> TestKernel {
    TestKernel::new("sampler.comp").specialize(SAMPLER, sampler)
}

fn bits(kernel: &TestKernel, keys: &[Key]) -> Vec<[u32; 4]> {
    let texels = |k: &Key| [[k.pixel[0] | k.pixel[1] << 16, k.index, k.seed, k.bounce], [k.group, 0, 0, 0]];
    let inputs: Vec<[u32; 4]> = keys.iter().flat_map(texels).collect();
    kernel.run(&inputs, keys.len(), 2).chunks_exact(2).map(|texels| texels[0]).collect()
}

/// The dimensions of a group that are a pair.
fn pairs(group: u32) -> [[usize; 2]; 2] {
    match group {
        2 => [[1, 2], [0, 3]],
        3 => [[0, 2], [1, 3]],
        _ => [[0, 1], [2, 3]],
    }
}

/// Whether each elementary interval of volume 2^-n, of every shape, holds one of the 2^n points: a (0, n, 2)-net.
fn is_net(points: &[[u32; 2]]) -> bool {
    let n = points.len().ilog2();
    assert_eq!(points.len(), 1 << n);
    (0..=n).all(|a| {
        // 64 bits, so that a shift by all 32 of them is one.
        let cell = |p: &[u32; 2]| (u64::from(p[0]) >> (32 - a) << (n - a)) | u64::from(p[1]) >> (32 - (n - a));
        let mut seen = vec![false; points.len()];
        points.iter().for_each(|p| seen[cell(p) as usize] = true);
        seen.into_iter().all(|s| s)
    })
}

/// Fails unless the numbers of the keys are a net in every pair of every group.
fn assert_nets(kernel: &TestKernel, what: &str, keys: impl Fn(u32) -> Vec<Key>) {
    for group in GROUPS {
        let numbers = bits(kernel, &keys(group));
        for pair in pairs(group) {
            let points: Vec<[u32; 2]> = numbers.iter().map(|b| pair.map(|d| b[d])).collect();
            assert!(is_net(&points), "{what}, group {group}, dimensions {pair:?}: no net of {} points", points.len());
        }
    }
}

/// Every aligned run of 2^m samples, up to the end of the 32-bit indices.
#[test]
fn powers_of_two_of_samples_are_nets() {
    let kernel = kernel(SOBOL);
    for (m, block) in (0..=10).flat_map(|m| [(m, 0), (m, 1), (m, 5), (m, (1 << 24 >> m) + 3), (m, u32::MAX >> m)]) {
        let index = |i: u32| (block << m) + i;
        assert_nets(&kernel, &format!("run {block} of 2^{m} samples"), |group| {
            (0..1 << m).map(|i| Key { pixel: [517, 90], index: index(i), seed: 3, bounce: 2, group }).collect()
        });
    }
}

/// The samples of all pixels of a square, at every power of two that begins at sample 0.
#[test]
fn squares_of_pixels_complete_each_other() {
    let kernel = kernel(SOBOL);
    for (k, m) in (1..=5).flat_map(|k| (0..=6).map(move |m| (k, m))) {
        let size = 1 << k;
        // An aligned square inside a tile that is not the first.
        let corner = [TILE * 3 + (TILE - size), TILE * 2 + ((TILE / 2) & !(size - 1))];
        assert_nets(&kernel, &format!("2^{m} samples of {size} x {size} pixels"), |group| {
            let pixel = |p: u32| [corner[0] + p % size, corner[1] + p / size];
            let keys = (0..size * size).flat_map(|p| (0..1 << m).map(move |index| (pixel(p), index)));
            keys.map(|(pixel, index)| Key { pixel, index, seed: 8, bounce: 1, group }).collect()
        });
    }
}

/// Blocks of 16 samples go to eight replicates in turn, and each is a point set of its own.
#[test]
fn replicates_are_nets_of_their_own() {
    let kernel = kernel(REPLICATES);
    for (replicate, m) in (0..8).flat_map(|r| [(r, 4), (r, 6)]) {
        assert_nets(&kernel, &format!("2^{m} samples of replicate {replicate}"), |group| {
            let index = |i: u32| (i / 16 * 8 + replicate) * 16 + i % 16;
            (0..1 << m).map(|i| Key { pixel: [40, 7], index: index(i), seed: 1, bounce: 0, group }).collect()
        });
    }
    // Were they parts of one, 2^7 samples in a row would be a net.
    let keys: Vec<Key> = (0..128).map(|index| Key { pixel: [40, 7], index, seed: 1, bounce: 0, group: 0 }).collect();
    let together: Vec<[u32; 2]> = bits(&kernel, &keys).iter().map(|b| [b[0], b[1]]).collect();
    assert!(!is_net(&together));
}

/// Pixels that know nothing of each other, and samples that are drawn twice, are found out.
#[test]
fn broken_point_sets_are_no_nets() {
    let keys = (0..4).flat_map(|p| (0..16).map(move |index| ([4 + p % 2, 8 + p / 2], index)));
    let keys: Vec<Key> = keys.map(|(pixel, index)| Key { pixel, index, seed: 1, bounce: 0, group: 0 }).collect();
    let points = bits(&kernel(SOBOL), &keys);
    assert!(is_net(&points.iter().map(|b| [b[0], b[1]]).collect::<Vec<_>>()));
    for fault in ["key.seed ^= key.pixel", "key.index &= ~1u"] {
        let points = bits(&kernel(SOBOL).define("KEY_FAULT(key)", fault), &keys);
        assert!(!is_net(&points.iter().map(|b| [b[0], b[1]]).collect::<Vec<_>>()), "{fault}");
    }
}

/// Over seeds, and over the tiles of an image, each number is uniform and independent of every other: of the same group, of
/// other groups and bounces, of the pixel's next sample and of the next pixel's. So no two decisions share a dimension, and
/// what is estimated with them is unbiased.
#[test]
fn numbers_are_uniform_and_independent_over_seeds() {
    const LENGTH: u32 = 1 << 14;
    let kernel = kernel(SOBOL);
    let key = |along: Along, i: u32| match along {
        Along::Seeds => ([37, 21], i),
        // One pixel of each tile.
        _ => ([37 + i % 1024 * TILE, 21 + i / 1024 * TILE], 9),
    };
    // Group, bounce, sample, and how far the pixel is moved. Sample 0 is alone in its octave.
    let streams: Vec<(u32, u32, u32, u32)> =
        GROUPS.iter().flat_map(|&g| [(g, 0, 0, 0), (g, 1, 5, 0), (g, 1, 6, 0), (g, 2, 5, 0), (g, 1, 5, 1)]).collect();
    let mut all = Vec::new();
    for along in [Along::Seeds, Along::PixelsInRow] {
        let numbers: Vec<Vec<[u32; 4]>> = streams
            .iter()
            .map(|&(group, bounce, index, moved)| {
                let keys: Vec<Key> = (0..LENGTH)
                    .map(|i| {
                        let (pixel, seed) = key(along, i);
                        Key { pixel: [pixel[0] ^ moved, pixel[1]], index, seed, bounce, group }
                    })
                    .collect();
                bits(&kernel, &keys)
            })
            .collect();
        for (s, a) in numbers.iter().enumerate() {
            for d in 0..4 {
                let values: Vec<u32> = a.iter().map(|b| b[d]).collect();
                all.extend(dimension_p_values(&values).map(|p| (format!("{along:?}, {:?}, {d}", streams[s]), p)));
            }
            for (t, b) in numbers.iter().enumerate().skip(s) {
                for (d, e) in (0..4).flat_map(|d| (0..4).map(move |e| (d, e))) {
                    // The same dimension of samples, or pixels, that complete each other: those must avoid each other.
                    let complete = d == e && streams[s].0 == streams[t].0 && streams[s].1 == streams[t].1;
                    if complete || (s == t && d >= e) {
                        continue;
                    }
                    let p = pair_p_values(a.iter().zip(b).map(|(a, b)| (a[d], b[e])));
                    all.extend(p.map(|p| (format!("{along:?}, {:?} {d} and {:?} {e}", streams[s], streams[t]), p)));
                }
            }
        }
    }
    let (name, p) = all.iter().min_by(|a, b| a.1.total_cmp(&b.1)).expect("some tests");
    gpu::assert_no_validation_messages();
    assert!(*p > sidak(0.01, all.len()), "{name}: p = {p:.2e}, the worst of {}", all.len());
}
