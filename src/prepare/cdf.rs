//! Discrete distributions as cumulative 32-bit integers. The probability of a bin is what is stored, so choosing by the
//! table and dividing by its probability is unbiased whatever the rounding.

use crate::layout::CDF_TOTAL;

/// Counts from 0 to [`CDF_TOTAL`], one more than there are weights: bin i has `cdf[i+1] − cdf[i]` of them. All zero if no
/// weight is positive.
///
/// Every positive weight is given one count, so that it can be picked however small it is beside the others. The rest R
/// is dealt out by rounding the cumulative weights: bin i gets ⌊R·Sᵢ₊₁/S⌋ − ⌊R·Sᵢ/S⌋ more. This sums to R exactly, gives
/// nothing to a zero weight, and a bin's count is within m + 2 of its exact share, for m positive weights.
///
/// # Panics
/// If a weight is negative or not finite, or if more than [`CDF_TOTAL`] weights are positive.
pub fn build(weights: &[f64]) -> Vec<u32> {
    assert!(weights.iter().all(|w| w.is_finite() && *w >= 0.0), "a weight is negative or not finite");
    let positive = weights.iter().filter(|&&w| w > 0.0).count();
    assert!(positive as u64 <= u64::from(CDF_TOTAL), "more positive weights than counts");
    let mut cdf = Vec::with_capacity(weights.len() + 1);
    cdf.push(0);
    if positive == 0 {
        cdf.resize(weights.len() + 1, 0);
        return cdf;
    }
    // Relative to the largest, the sum cannot overflow.
    let largest = weights.iter().copied().fold(0.0, f64::max);
    let total: f64 = weights.iter().map(|w| w / largest).sum();
    let rest = f64::from(CDF_TOTAL) - positive as f64;
    let (mut sum, mut given) = (0.0, 0u32);
    for weight in weights {
        sum += weight / largest;
        given += u32::from(*weight > 0.0);
        // The same additions as for `total`, so that the last quotient is 1 and the sums never exceed it.
        cdf.push(given + (rest * (sum / total)).floor() as u32);
    }
    cdf
}

/// log2 of the buckets of a guide for so many bins: two to four bins a bucket, were they alike.
fn guide_bits(bins: usize) -> u32 {
    bins.max(1).ilog2().saturating_sub(1)
}

/// Words of [`guide`] for so many bins.
pub fn guide_words(bins: usize) -> usize {
    (1 << guide_bits(bins)) + 1
}

/// The bin of the first count of each of 2ᵇ equal buckets of the counts, and the last bin: where the search for a count in
/// bucket g begins and, by the next entry, ends (Chen and Asau 1974, "On generating random variates from an empirical
/// distribution"). The bin that is found is that of a search through all.
pub fn guide(cdf: &[u32]) -> Vec<u32> {
    let bins = cdf.len() - 1;
    let bits = guide_bits(bins);
    let mut bin = 0;
    (0..=1_u64 << bits)
        .map(|bucket| {
            let first = (bucket << (CDF_TOTAL.ilog2() - bits)).min(u64::from(CDF_TOTAL) - 1);
            while bin + 1 < bins && u64::from(cdf[bin + 1]) <= first {
                bin += 1;
            }
            bin as u32
        })
        .collect()
}

/// Number of counts of a bin.
pub fn count(cdf: &[u32], bin: usize) -> u32 {
    cdf[bin + 1] - cdf[bin]
}

/// Probability of a bin.
pub fn probability(cdf: &[u32], bin: usize) -> f64 {
    f64::from(count(cdf, bin)) / f64::from(CDF_TOTAL)
}
