//! The sampler of shaders/include/rng.glsl: every dimension is uniform, and dimensions, samples, pixels, bounces and seeds
//! are independent of each other.

use crate::common::gpu;
use crate::common::kernel::{TestKernel, floats};
use crate::common::statistics::{chi_square_test, normal_upper_tail, sidak};

/// Level of each test here, all of its comparisons together.
const ALPHA: f64 = 0.01;
/// Keys of a stream.
const LENGTH: u32 = 1 << 14;
const BINS: usize = 256;
const PAIR_BINS: usize = 16;

/// A stream of keys that differ in one coordinate alone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Along {
    Samples,
    PixelsInRow,
    PixelsInColumn,
    Bounces,
    Seeds,
}

const STREAMS: [Along; 5] = [Along::Samples, Along::PixelsInRow, Along::PixelsInColumn, Along::Bounces, Along::Seeds];

/// Groups as in rng.glsl.
const GROUPS: u32 = 8;

/// The kernel's two input texels for key `i` of a stream.
fn key(along: Along, group: u32, i: u32) -> [[u32; 4]; 2] {
    let [mut pixel, mut index, mut seed, mut bounce] = [37 | 21 << 16, 5, 9, 1];
    match along {
        Along::Samples => index = i,
        Along::PixelsInRow => pixel = i | 21 << 16,
        Along::PixelsInColumn => pixel = 37 | i << 16,
        Along::Bounces => bounce = i,
        Along::Seeds => seed = i,
    }
    [[pixel, index, seed, bounce], [group, 0, 0, 0]]
}

/// The four dimensions of each group along each stream: `result[stream][group][i]`.
fn streams(kernel: &TestKernel) -> Vec<Vec<Vec<[u32; 4]>>> {
    let keys = |along| (0..GROUPS).flat_map(move |group| (0..LENGTH).flat_map(move |i| key(along, group, i)));
    let inputs: Vec<[u32; 4]> = STREAMS.into_iter().flat_map(keys).collect();
    let outputs = kernel.run(&inputs, inputs.len() / 2, 2);
    let bits: Vec<[u32; 4]> = outputs.chunks_exact(2).map(|texels| texels[0]).collect();
    let stream = |s: &[[u32; 4]]| s.chunks_exact(LENGTH as usize).map(<[_]>::to_vec).collect();
    bits.chunks_exact((GROUPS * LENGTH) as usize).map(stream).collect()
}

fn uniform(observed: &[u64]) -> f64 {
    let total: u64 = observed.iter().sum();
    let expected = vec![total as f64 / observed.len() as f64; observed.len()];
    chi_square_test(observed, &expected, total).p_value
}

/// χ² of one dimension: of its highest byte and of the lowest byte that a number in [0, 1) still holds.
pub(crate) fn dimension_p_values(values: &[u32]) -> [f64; 2] {
    [24, 8].map(|shift| {
        let mut bins = [0; BINS];
        values.iter().for_each(|v| bins[(v >> shift) as usize % BINS] += 1);
        uniform(&bins)
    })
}

/// χ² of pairs, and the correlation's p-value: r·√n is normal for independent numbers.
pub(crate) fn pair_p_values(pairs: impl Iterator<Item = (u32, u32)>) -> [f64; 2] {
    let mut bins = [0; PAIR_BINS * PAIR_BINS];
    let (mut sum, mut n) = (0.0, 0.0_f64);
    for (a, b) in pairs {
        bins[(a >> 28) as usize * PAIR_BINS + (b >> 28) as usize] += 1;
        let centred = |x: u32| (f64::from(x) + 0.5) / 4_294_967_296.0 - 0.5;
        // The variance of a uniform number is 1/12.
        sum += 12.0 * centred(a) * centred(b);
        n += 1.0;
    }
    [uniform(&bins), 2.0 * normal_upper_tail((sum / n.sqrt()).abs())]
}

/// p-values of every dimension, of pairs of dimensions, and of neighbours along the stream.
fn p_values(kernel: &TestKernel) -> Vec<(String, f64)> {
    let mut all = Vec::new();
    for (along, groups) in STREAMS.iter().zip(streams(kernel)) {
        for (group, bits) in groups.iter().enumerate() {
            for d in 0..4 {
                let values: Vec<u32> = bits.iter().map(|b| b[d]).collect();
                all.extend(dimension_p_values(&values).map(|p| (format!("{along:?}, group {group}, {d}"), p)));
                let neighbours = values.iter().zip(&values[1..]).map(|(a, b)| (*a, *b));
                all.extend(pair_p_values(neighbours).map(|p| (format!("{along:?}, group {group}, {d}: lag 1"), p)));
                // Within the group, and against the next group's dimensions.
                for e in d + 1..4 {
                    let p = pair_p_values(bits.iter().map(|b| (b[d], b[e])));
                    all.extend(p.map(|p| (format!("{along:?}, group {group}, {d} and {e}"), p)));
                }
                let next = &groups[(group + 1) % groups.len()];
                for e in 0..4 {
                    let p = pair_p_values(bits.iter().zip(next).map(|(a, b)| (a[d], b[e])));
                    all.extend(p.map(|p| (format!("{along:?}, group {group}, {d} and next {e}"), p)));
                }
            }
        }
    }
    all
}

fn worst(p_values: &[(String, f64)]) -> &(String, f64) {
    p_values.iter().min_by(|a, b| a.1.total_cmp(&b.1)).expect("some tests")
}

#[test]
fn dimensions_are_uniform_and_independent() {
    let all = p_values(&TestKernel::new("sampler.comp"));
    let (name, p) = worst(&all);
    assert!(*p > sidak(ALPHA, all.len()), "{name}: p = {p:.2e}, the worst of {}", all.len());
}

/// A sampler that uses each pair of sample indices alike is found out.
#[test]
fn a_repeating_sampler_is_noticed() {
    let all = p_values(&TestKernel::new("sampler.comp").define("KEY_FAULT(key)", "key.index &= ~1u"));
    assert!(worst(&all).1 < sidak(ALPHA, all.len()));
}

#[test]
fn numbers_are_the_top_bits_and_below_one() {
    let mut inputs: Vec<[u32; 4]> = (0..LENGTH).flat_map(|i| key(Along::Samples, 2, i)).collect();
    inputs.extend([[u32::MAX; 4], [5, 0, 0, 0]]);
    let outputs = TestKernel::new("sampler.comp").run(&inputs, inputs.len() / 2, 2);
    for texels in outputs.chunks_exact(2) {
        for (bits, x) in texels[0].into_iter().zip(floats(texels[1])) {
            assert_eq!(f64::from(x), f64::from(bits >> 8) / 16_777_216.0);
            assert!((0.0..1.0).contains(&x));
        }
    }
}

/// The groups have numbers of their own below the stride of a bounce, and no two (bounce, group) share their bits.
#[test]
fn no_two_groups_share_numbers() {
    let text = &gpu::sources()["include/rng.glsl"];
    let constant = |line: &str| {
        let (name, value) = line.strip_prefix("const uint DIMENSION")?.split_once(" = ")?;
        Some((name.to_owned(), value.split_once('u')?.0.parse::<u32>().ok()?))
    };
    let constants: Vec<(String, u32)> = text.lines().filter_map(constant).collect();
    let stride = constants.iter().find(|(name, _)| name == "_GROUPS").expect("DIMENSION_GROUPS").1;
    let mut groups: Vec<u32> = constants.iter().filter(|(name, _)| name != "_GROUPS").map(|c| c.1).collect();
    assert_eq!(groups.len(), GROUPS as usize, "{constants:?}");
    groups.sort_unstable();
    groups.dedup();
    assert_eq!(groups.len(), GROUPS as usize, "two groups share a number: {constants:?}");
    assert!(groups.iter().all(|group| *group < stride));

    let inputs: Vec<[u32; 4]> =
        (0..LENGTH).flat_map(|bounce| (0..GROUPS).flat_map(move |group| key(Along::Bounces, group, bounce))).collect();
    let outputs = TestKernel::new("sampler.comp").run(&inputs, inputs.len() / 2, 2);
    let mut bits: Vec<[u32; 4]> = outputs.chunks_exact(2).map(|texels| texels[0]).collect();
    let count = bits.len();
    bits.sort_unstable();
    bits.dedup();
    assert_eq!(bits.len(), count, "two (bounce, group) have the same four numbers");
}
