//! The checks of a BSDF at single directions: `weights`, `reciprocity`, `finite`.

use std::fmt::Write as _;

use glam::DVec3;
use serde_json::json;

use super::bsdf_kernel::{BsdfKernel, Sample};
use super::bsdf_statistics::fixed_directions;
use super::configuration::Configuration;
use super::report::{CheckReport, error_text, number, vector, within};
use crate::Result;

/// Samples of a configuration.
const SAMPLES: u32 = 1 << 10;
/// How far a direction's length may be from 1: some rounded operations.
const UNIT: f64 = 1e-5;

/// The weight of a sample is f·|cos θi|/pdf, its pdf that of its direction, and its flag says on which side it is.
pub(super) fn weights(
    kernel: &mut BsdfKernel,
    name: &str,
    configurations: &[Configuration],
    relative: f64,
    seed: u32,
) -> Result<CheckReport> {
    let samples = kernel.scatter(configurations, SAMPLES, seed)?;
    let at: Vec<(usize, DVec3)> = samples.iter().enumerate().map(|(i, s)| (i / SAMPLES as usize, s.wi)).collect();
    let values = kernel.evaluate(configurations, &at, false)?;
    let (mut failures, mut worst, mut tested) = (Failures::default(), Worst::default(), 0);
    for ((sample, value), (index, wi)) in samples.iter().zip(&values).zip(at) {
        let label = &configurations[index].label;
        let wrong = sample.fault().or_else(|| shape_fault(sample));
        if let Some(wrong) = wrong {
            failures.add(label, &wrong);
        } else if sample.pdf > 0.0 && !sample.is_delta() {
            tested += 1;
            let expected = value.f * (wi.y.abs() / value.pdf);
            let errors = [relative_error(sample.pdf, value.pdf), relative_error_of(sample.weight, expected)];
            worst.see(errors[0].max(errors[1]), label);
            if !within(errors[0], relative) {
                let [wi, got, pdf] = [vector(wi), number(sample.pdf), number(value.pdf)];
                failures.add(label, &format!("the sample towards {wi} has pdf {got}; of its direction it is {pdf}"));
            } else if !within(errors[1], relative) {
                let [wi, got, expected] = [wi, sample.weight, expected].map(vector);
                failures.add(label, &format!("the sample towards {wi} has weight {got}; f·|cos|/pdf is {expected}"));
            }
        }
    }
    let summary = format!("{tested} samples; largest relative error {worst}; {} allowed", number(relative));
    let numbers = json!({
        "configurations": configurations.len(), "samples": tested, "largest_error": worst.error, "allowed": relative,
        "at": worst.label,
    });
    Ok(CheckReport::new("weights", name, summary, failures.told(), numbers))
}

/// What does not fit together in a sample.
fn shape_fault(sample: &Sample) -> Option<String> {
    let wi = sample.wi;
    if sample.is_absorbed() {
        return (sample.weight != DVec3::ZERO)
            .then(|| format!("a sample without pdf has the weight {}", vector(sample.weight)));
    }
    if (wi.length() - 1.0).abs() > UNIT {
        return Some(format!("the direction {} of a sample has length {}", vector(wi), number(wi.length())));
    }
    if sample.is_delta() && sample.pdf != 0.0 {
        return Some(format!("a sample of a delta lobe has pdf {}; it must be 0", number(sample.pdf)));
    }
    (sample.goes_through() != (wi.y < 0.0)).then(|| {
        let (is, flag) = if wi.y < 0.0 { ("below", "lacks") } else { ("above", "has") };
        let wi = vector(wi);
        format!("the direction {wi} of a sample is {is} the surface, and its flags {flag} SCATTERED_THROUGH")
    })
}

/// f is the same with both directions exchanged, where both are above the surface.
pub(super) fn reciprocity(
    kernel: &mut BsdfKernel,
    name: &str,
    configurations: &[Configuration],
    relative: f64,
    seed: u32,
) -> Result<CheckReport> {
    let at = directions(kernel, configurations, seed)?;
    let at: Vec<_> = at.into_iter().filter(|(_, wi)| wi.y > 0.0).collect();
    let values = kernel.evaluate(configurations, &at, true)?;
    let (mut failures, mut worst) = (Failures::default(), Worst::default());
    for (value, (index, wi)) in values.iter().zip(&at) {
        let c = &configurations[*index];
        let error = relative_error_of(value.f, value.reverse_f);
        worst.see(error, &c.label);
        if let Some(fault) = value.fault(*wi) {
            failures.add(&c.label, &fault);
        } else if !within(error, relative) {
            let [f, reverse, wo, wi] = [value.f, value.reverse_f, c.wo, *wi].map(vector);
            failures.add(&c.label, &format!("f(wo, wi) is {f}, f(wi, wo) {reverse}, for wo {wo} and wi {wi}"));
        }
    }
    let summary = format!("{} pairs; largest relative difference {worst}; {} allowed", at.len(), number(relative));
    let numbers = json!({
        "configurations": configurations.len(), "pairs": at.len(), "largest_error": worst.error, "allowed": relative,
        "at": worst.label,
    });
    Ok(CheckReport::new("reciprocity", name, summary, failures.told(), numbers))
}

/// Nothing is infinite, NaN or negative, neither of samples nor at directions of all kinds.
pub(super) fn finite(
    kernel: &mut BsdfKernel,
    name: &str,
    configurations: &[Configuration],
    largest_weight: Option<f64>,
    seed: u32,
) -> Result<CheckReport> {
    let samples = kernel.scatter(configurations, SAMPLES, seed)?;
    let (mut failures, mut largest) = (Failures::default(), Worst::default());
    for (i, sample) in samples.iter().enumerate() {
        let label = &configurations[i / SAMPLES as usize].label;
        let weight = sample.weight.max_element();
        largest.see(weight, label);
        if let Some(fault) = sample.fault() {
            failures.add(label, &fault);
        } else if largest_weight.is_some_and(|limit| !within(weight, limit)) {
            failures.add(
                label,
                &format!("a sample towards {} has the weight {}", vector(sample.wi), vector(sample.weight)),
            );
        }
    }
    let at = directions(kernel, configurations, seed)?;
    for (value, (index, wi)) in kernel.evaluate(configurations, &at, true)?.iter().zip(&at) {
        if let Some(fault) = value.fault(*wi) {
            failures.add(&configurations[*index].label, &fault);
        }
    }
    let bound = largest_weight.map(|limit| format!(" ({limit} allowed)")).unwrap_or_default();
    let summary = format!("{} samples and {} values; largest weight {largest}{bound}", samples.len(), at.len());
    let numbers = json!({
        "configurations": configurations.len(), "samples": samples.len(), "values": at.len(),
        "largest_weight": largest.error, "allowed": largest_weight, "at": largest.label,
    });
    Ok(CheckReport::new("finite", name, summary, failures.told(), numbers))
}

/// For each configuration directions of all kinds, the mirrored one and what it scatters to.
fn directions(kernel: &mut BsdfKernel, configurations: &[Configuration], seed: u32) -> Result<Vec<(usize, DVec3)>> {
    let samples = kernel.scatter(configurations, SAMPLES, seed ^ 1)?;
    let fixed = fixed_directions();
    let mut at = Vec::new();
    for (index, (c, samples)) in configurations.iter().zip(samples.chunks_exact(SAMPLES as usize)).enumerate() {
        let mirrored = DVec3::new(-c.wo.x, c.wo.y, -c.wo.z);
        let drawn = samples.iter().filter(|s| s.wi.is_finite() && s.pdf > 0.0).map(|s| s.wi);
        at.extend(fixed.iter().copied().chain([mirrored]).chain(drawn).map(|wi| (index, wi)));
    }
    Ok(at)
}

/// The difference, relative to the larger; 0 of equal numbers.
fn relative_error(a: f64, b: f64) -> f64 {
    if a == b { 0.0 } else { (a - b).abs() / a.abs().max(b.abs()) }
}

fn relative_error_of(a: DVec3, b: DVec3) -> f64 {
    (0..3).map(|k| relative_error(a[k], b[k])).fold(0.0, |worst, e| if e > worst || e.is_nan() { e } else { worst })
}

/// Failures, the first of each configuration.
#[derive(Default)]
struct Failures(Vec<(String, String, usize)>);

impl Failures {
    fn add(&mut self, label: &str, what: &str) {
        match self.0.last_mut() {
            Some((last, _, count)) if last == label => *count += 1,
            _ => self.0.push((label.to_owned(), what.to_owned(), 1)),
        }
    }

    fn told(self) -> Vec<String> {
        let told = |(label, what, count): (String, String, usize)| {
            let mut text = format!("{label}: {what}");
            if count > 1 {
                let _ = write!(text, " (and {} more)", count - 1);
            }
            text
        };
        self.0.into_iter().map(told).collect()
    }
}

/// The largest number seen, and where.
#[derive(Default)]
struct Worst {
    error: f64,
    label: String,
}

impl Worst {
    fn see(&mut self, error: f64, label: &str) {
        if self.label.is_empty() || error > self.error || error.is_nan() {
            (self.error, self.label) = (error, label.to_owned());
        }
    }
}

impl std::fmt::Display for Worst {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let told = if self.error < 0.01 { error_text(self.error) } else { number(self.error) };
        write!(f, "{told} at {}", self.label)
    }
}
