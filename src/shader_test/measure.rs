//! What the statistical checks of a BSDF rest on: samples of `scatter`, and integrals of `evaluate` and `pdf` over bins that
//! fit the lobe.

use glam::DVec3;

use super::bins::Bins;
use super::bsdf_kernel::{BsdfKernel, Sample, Value};
use super::chi_square::{ChiSquare, chi_square_test};
use super::configuration::Configuration;
use super::device::MOST_LANES;
use super::quadrature::{Cell, Integral, integrate};
use crate::Result;
use crate::bench::statistics::Summary;

/// The bins are made by as many samples as are tested, but others: so what the bins miss of a lobe is less than chance.
const PILOT_SEED: u32 = 0x8000;
/// A cell is refined until that changes its share of the density or of the light by less: of the some 300 bins of a
/// configuration all together by less than 3·10⁻⁴, and each by less than a hundredth of its count's deviation.
const TOLERANCE: f64 = 1e-6;

/// A configuration, measured.
#[derive(Clone, Debug)]
pub(super) struct Measurement {
    /// What was not finite, or negative; then the rest says nothing.
    pub(super) fault: Option<String>,
    /// Counts against the density.
    pub(super) chi_square: ChiSquare,
    /// The bin that contributes most, with its count and what is expected.
    pub(super) worst_bin: Option<(Cell, u64, f64)>,
    /// ∫ pdf dω, and by how much the last refinement changed it.
    pub(super) density: [f64; 2],
    /// ∫ f·|cos θi| dωi, and by how much the last refinement changed it.
    pub(super) albedo: [DVec3; 2],
    /// The mean weight of the samples.
    pub(super) mean_weight: [Summary; 3],
    /// Samples, those absorbed, those of delta lobes.
    pub(super) samples: u32,
    pub(super) absorbed: u32,
    pub(super) deltas: u32,
}

/// Measures every configuration, by as many samples.
pub(super) fn measure(
    kernel: &mut BsdfKernel,
    configurations: &[Configuration],
    samples: u32,
    seed: u32,
) -> Result<Vec<Measurement>> {
    let group = (MOST_LANES / samples as usize).clamp(1, 16);
    let mut all = Vec::with_capacity(configurations.len());
    for (index, group) in (0..).zip(configurations.chunks(group)) {
        all.extend(measure_group(kernel, group, samples, seed ^ index << 20)?);
    }
    Ok(all)
}

fn measure_group(
    kernel: &mut BsdfKernel,
    configurations: &[Configuration],
    samples: u32,
    seed: u32,
) -> Result<Vec<Measurement>> {
    let pilot = kernel.scatter(configurations, samples, seed ^ PILOT_SEED)?;
    let directions = |samples: &[Sample]| -> Vec<DVec3> {
        let continuous = samples.iter().filter(|s| !s.is_delta() && s.pdf > 0.0 && s.wi.is_finite());
        continuous.map(|sample| sample.wi).collect()
    };
    let bins: Vec<Bins> = pilot.chunks_exact(samples as usize).map(|s| Bins::new(&directions(s))).collect();
    let owner: Vec<usize> = bins.iter().enumerate().flat_map(|(i, bins)| bins.cells.iter().map(move |_| i)).collect();
    let (mut pieces, mut first) = (Vec::new(), 0);
    for bins in &bins {
        pieces.extend(bins.pieces.iter().map(|(bin, cell)| (first + bin, *cell)));
        first += bins.cells.len();
    }

    let mut faults: Vec<Option<String>> = vec![None; configurations.len()];
    let integrals = integrate(owner.len(), &pieces, TOLERANCE, |at| -> Result<Vec<[f64; 4]>> {
        // Pieces stay in the order of their configurations.
        let owned: Vec<_> = at.iter().map(|(bin, wi)| (owner[*bin], *wi)).collect();
        let values = kernel.evaluate(configurations, &owned, false)?;
        for ((owner, wi), value) in owned.iter().zip(&values) {
            faults[*owner] = faults[*owner].take().or_else(|| value.fault(*wi));
        }
        Ok(values.iter().zip(&owned).map(|(value, (_, wi))| integrand(value, *wi)).collect())
    })?;

    let samples_of_all = kernel.scatter(configurations, samples, seed)?;
    let mut measured = Vec::with_capacity(configurations.len());
    let mut integrals = integrals.as_slice();
    for ((bins, fault), samples) in bins.iter().zip(faults).zip(samples_of_all.chunks_exact(samples as usize)) {
        let (own, others) = integrals.split_at(bins.cells.len());
        integrals = others;
        let fault = fault.or_else(|| samples.iter().find_map(Sample::fault));
        measured.push(judge(bins, own, samples, fault));
    }
    Ok(measured)
}

/// The density, and the light that comes from wi.
fn integrand(value: &Value, wi: DVec3) -> [f64; 4] {
    let light = value.f * wi.y.abs();
    [value.pdf, light.x, light.y, light.z]
}

/// Holds the samples of a configuration against the integrals over its bins.
fn judge(bins: &Bins, integrals: &[Integral<4>], samples: &[Sample], fault: Option<String>) -> Measurement {
    let total = samples.len() as f64;
    let sum = |k: usize, part: fn(&Integral<4>) -> [f64; 4]| integrals.iter().map(|i| part(i)[k]).sum::<f64>();
    let light = |part: fn(&Integral<4>) -> [f64; 4]| DVec3::from([1, 2, 3].map(|k| sum(k, part)));
    let mut result = Measurement {
        chi_square: ChiSquare { statistic: f64::NAN, degrees_of_freedom: 0, p_value: 0.0 },
        worst_bin: None,
        density: [sum(0, |i| i.value), sum(0, |i| i.error)],
        albedo: [light(|i| i.value), light(|i| i.error)],
        mean_weight: [0, 1, 2].map(|k| Summary::of(&samples.iter().map(|s| s.weight[k]).collect::<Vec<_>>())),
        samples: samples.len() as u32,
        absorbed: samples.iter().filter(|sample| sample.is_absorbed()).count() as u32,
        deltas: samples.iter().filter(|sample| sample.is_delta()).count() as u32,
        fault,
    };
    if result.fault.is_some() {
        return result;
    }
    let mut observed = vec![0_u64; bins.cells.len()];
    for sample in samples.iter().filter(|sample| !sample.is_delta() && !sample.is_absorbed()) {
        observed[bins.find(sample.wi)] += 1;
    }
    let expected: Vec<f64> = integrals.iter().map(|integral| integral.value[0].max(0.0) * total).collect();
    result.chi_square = chi_square_test(&observed, &expected, samples.len() as u64);
    let excess = |i: &usize| (observed[*i] as f64 - expected[*i]).powi(2) / expected[*i].max(1.0);
    let largest = (0..observed.len()).max_by(|i, j| excess(i).total_cmp(&excess(j)));
    result.worst_bin = largest.map(|i| (bins.cells[i], observed[i], expected[i]));
    result
}
