//! Pearson's χ² test of goodness of fit.

use serde::Serialize;
use statrs::distribution::{ChiSquared, ContinuousCDF};

/// Below this expectation a cell is too small for the χ² approximation and is pooled (Cochran 1954).
const SMALLEST_EXPECTATION: f64 = 5.0;

/// The outcome of a χ² goodness-of-fit test.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ChiSquare {
    /// Σ (observed − expected)² / expected over the cells after pooling.
    pub statistic: f64,
    /// Cells after pooling, less one.
    pub degrees_of_freedom: usize,
    /// The probability of a statistic at least as large, if the samples follow the expectation.
    pub p_value: f64,
}

/// Pearson's χ² test of `observed` counts against `expected` counts (probability × `total`).
///
/// Of `total` samples those in no cell (a `scatter` that failed, say) make a cell of their own, with what the
/// expectations leave. Expectations are not rescaled: a pdf that does not integrate to what it should is found. Cells
/// with an expectation below 5 are pooled. Samples where nothing is expected give p = 0.
///
/// # Panics
/// If there are not as many counts as expectations, an expectation is negative or not finite, or the counts are more than
/// `total`.
pub fn chi_square_test(observed: &[u64], expected: &[f64], total: u64) -> ChiSquare {
    assert_eq!(observed.len(), expected.len(), "a count and an expectation for every cell");
    assert!(expected.iter().all(|e| e.is_finite() && *e >= 0.0), "an expectation is negative or not finite");
    let counted: u64 = observed.iter().sum();
    assert!(counted <= total, "{counted} samples in the cells, {total} in all");
    let rest = (total as f64 - expected.iter().sum::<f64>()).max(0.0);

    let mut cells: Vec<(f64, f64)> = observed.iter().map(|o| *o as f64).zip(expected.iter().copied()).collect();
    cells.push(((total - counted) as f64, rest));
    cells.sort_by(|a, b| b.1.total_cmp(&a.1));
    let large = cells.partition_point(|cell| cell.1 >= SMALLEST_EXPECTATION);
    let pooled = cells.drain(large..).fold((0.0, 0.0), |sum, cell| (sum.0 + cell.0, sum.1 + cell.1));
    if pooled.1 >= SMALLEST_EXPECTATION || cells.is_empty() {
        cells.push(pooled);
    } else if let Some(last) = cells.last_mut() {
        // Samples in cells of no expectation must not hide in a large neighbour.
        if pooled.1 == 0.0 && pooled.0 > 0.0 {
            return ChiSquare { statistic: f64::INFINITY, degrees_of_freedom: large, p_value: 0.0 };
        }
        *last = (last.0 + pooled.0, last.1 + pooled.1);
    }

    let statistic = cells.iter().map(|(o, e)| if o == e { 0.0 } else { (o - e).powi(2) / e }).sum();
    let degrees_of_freedom = cells.len() - 1;
    ChiSquare { statistic, degrees_of_freedom, p_value: upper_tail(statistic, degrees_of_freedom) }
}

/// P(X ≥ statistic) of the χ² distribution; 1 without degrees of freedom.
fn upper_tail(statistic: f64, degrees_of_freedom: usize) -> f64 {
    match ChiSquared::new(degrees_of_freedom as f64) {
        Ok(_) if statistic == f64::INFINITY => 0.0,
        Ok(distribution) => distribution.sf(statistic),
        Err(_) => 1.0,
    }
}
