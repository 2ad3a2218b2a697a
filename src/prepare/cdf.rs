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

/// Number of counts of a bin.
pub fn count(cdf: &[u32], bin: usize) -> u32 {
    cdf[bin + 1] - cdf[bin]
}

/// Probability of a bin.
pub fn probability(cdf: &[u32], bin: usize) -> f64 {
    f64::from(count(cdf, bin)) / f64::from(CDF_TOTAL)
}
