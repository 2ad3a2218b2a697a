//! The delta lobes: mirror, refract, glass with both Fresnel terms, and metallic-roughness where it is smooth or thin.
//! How often a lobe is chosen is a binomial test against Fresnel's equations in f64; where it goes is Snell's law in f64.

use crate::common::bsdf::{
    Configuration, MetallicRoughness, SCATTERED_DELTA, SCATTERED_THROUGH, Sample, bsdf_kernel, direction, scatter,
};
use crate::common::kernel::TestKernel;
use crate::common::statistics::{binomial_two_sided, sidak};
use glam::DVec3;
use sunfleck::layout::{BSDF_GLASS, BSDF_MIRROR, BSDF_REFRACT};

const ALPHA: f64 = 0.01;
const SAMPLES: usize = 1 << 12;
/// Relative error of one rounding to f32.
const ROUNDING: f64 = 1.0 / 16_777_216.0;

const ETAS: [f32; 10] = [1.0, 1.0001, 1.33, 1.5, 2.4, 1.0 / 1.0001, 1.0 / 1.33, 1.0 / 1.5, 1.0 / 2.4, 0.1];
const COSINES: [f64; 7] = [1.0, 0.97, 0.75, 0.5, 0.1, 1e-3, 1e-6];
const COLOR: [f32; 3] = [0.9, 0.6, 0.3];

fn configurations(kind: u32, schlick: bool) -> Vec<Configuration> {
    let at = |eta: f32, cosine: f64| Configuration {
        eta,
        ior: eta,
        schlick,
        ..Configuration::new(kind, COLOR, direction(cosine, 2.0 + cosine))
    };
    ETAS.into_iter().flat_map(|eta| COSINES.into_iter().map(move |cosine| at(eta, cosine))).collect()
}

/// Snell's law in f64: the cosine of the transmitted angle, `None` where reflection is total.
fn transmitted_cosine(c: &Configuration) -> Option<f64> {
    let eta = f64::from(c.eta);
    let squared = 1.0 - (1.0 - c.wo.y * c.wo.y) / (eta * eta);
    (squared > 0.0).then(|| squared.sqrt())
}

/// Unpolarised Fresnel reflectance from the reflection coefficients of both polarisations (Born and Wolf, §1.5.2), or
/// Schlick's approximation with the angle on the thinner side.
fn reflectance(c: &Configuration) -> f64 {
    let Some(transmitted) = transmitted_cosine(c) else { return 1.0 };
    let (eta, cosine) = (f64::from(c.eta), c.wo.y);
    if c.schlick {
        let r0 = ((eta - 1.0) / (eta + 1.0)).powi(2);
        return r0 + (1.0 - r0) * (1.0 - cosine.min(transmitted)).powi(5);
    }
    let s = (cosine - eta * transmitted) / (cosine + eta * transmitted);
    let p = (transmitted - eta * cosine) / (transmitted + eta * cosine);
    0.5 * (s * s + p * p)
}

fn mirrored(wo: DVec3) -> DVec3 {
    DVec3::new(-wo.x, wo.y, -wo.z)
}

/// Reflected light has the direction and the colour exactly; there is no density.
fn check_reflected(c: &Configuration, sample: &Sample) {
    assert_eq!(sample.flags, SCATTERED_DELTA, "{c:?}: {sample:?}");
    assert_eq!((sample.wi, sample.pdf), (mirrored(c.wo), 0.0), "{c:?}: {sample:?}");
    assert_eq!(sample.weight, DVec3::from(COLOR.map(f64::from)), "{c:?}: {sample:?}");
}

fn check_transmitted(c: &Configuration, sample: &Sample) {
    let cosine = transmitted_cosine(c).unwrap_or_else(|| panic!("total reflection transmits: {c:?}: {sample:?}"));
    let eta = f64::from(c.eta);
    assert_eq!(sample.flags, SCATTERED_DELTA | SCATTERED_THROUGH, "{c:?}: {sample:?}");
    assert_eq!(sample.pdf, 0.0, "{c:?}: {sample:?}");
    let expected = DVec3::new(-c.wo.x / eta, -cosine, -c.wo.z / eta);
    // A division (2.5 ulp) for x and z. For y, the square of η·cosine has a relative rounding of 5 in each of its two
    // terms, and the square root divides the error by twice itself.
    let inner = 5.0 * ROUNDING * ((eta * eta - 1.0).abs() + c.wo.y * c.wo.y);
    let tolerance = DVec3::splat(6.0 * ROUNDING) + DVec3::Y * (inner / (2.0 * eta * eta * cosine));
    let difference = (sample.wi - expected).abs();
    assert!(difference.cmple(tolerance).all(), "{c:?}: {} instead of {expected}", sample.wi);
    // Radiance is carried: it shrinks with η² into the denser medium (PBR, 4th ed., §9.5.2).
    let weight = DVec3::from(COLOR.map(f64::from)) / (eta * eta);
    assert!(((sample.weight - weight) / weight).abs().max_element() < 8.0 * ROUNDING, "{c:?}: {sample:?}");
    if c.eta == 1.0 {
        assert_eq!(sample.wi, -c.wo, "no boundary bends nothing");
    }
}

fn check(c: &Configuration, sample: &Sample) {
    if sample.flags & SCATTERED_THROUGH == 0 { check_reflected(c, sample) } else { check_transmitted(c, sample) }
}

/// The smallest p-value over the configurations of how often was reflected, with the number of tests.
fn choice_p_value(kind: u32, schlick: bool, model: impl Fn(&Configuration) -> f64) -> (f64, usize) {
    let configurations = configurations(kind, schlick);
    let samples = scatter(&TestKernel::new("bsdf.comp"), &configurations, SAMPLES, 5);
    let p_value = |(c, samples): (&Configuration, &[Sample])| {
        samples.iter().for_each(|sample| check(c, sample));
        let reflected = samples.iter().filter(|s| s.flags & SCATTERED_THROUGH == 0).count();
        binomial_two_sided(reflected as u64, SAMPLES as u64, model(c))
    };
    let worst = configurations.iter().zip(samples.chunks_exact(SAMPLES)).map(p_value).fold(1.0, f64::min);
    (worst, configurations.len())
}

#[test]
fn a_mirror_reflects_all() {
    let (p, _) = choice_p_value(BSDF_MIRROR, false, |_| 1.0);
    assert_eq!(p, 1.0);
}

/// Refract reflects only where it must.
#[test]
fn refract_reflects_totally_or_not_at_all() {
    let all_or_nothing = |c: &Configuration| if transmitted_cosine(c).is_some() { 0.0 } else { 1.0 };
    let (p, _) = choice_p_value(BSDF_REFRACT, false, all_or_nothing);
    assert_eq!(p, 1.0);
}

#[test]
fn glass_chooses_by_fresnel() {
    for schlick in [false, true] {
        let (p, tests) = choice_p_value(BSDF_GLASS, schlick, reflectance);
        assert!(p > sidak(ALPHA, tests), "Schlick {schlick}: p = {p:.2e}");
    }
}

/// The exact term does not pass for Schlick's, nor the other way round.
#[test]
fn a_wrong_fresnel_term_is_noticed() {
    for schlick in [false, true] {
        let other = |c: &Configuration| reflectance(&Configuration { schlick: !schlick, ..*c });
        let (p, tests) = choice_p_value(BSDF_GLASS, schlick, other);
        assert!(p < sidak(ALPHA, tests), "Schlick {schlick}: p = {p:.2e}");
    }
}

/// Without a boundary, glass never reflects, not even at the most grazing angle.
#[test]
fn glass_of_index_one_is_not_there() {
    let cosine = |i: usize| f64::from(((i + 1) as f32) / 1024.0);
    let configurations: Vec<Configuration> = (0..1024)
        .map(|i| Configuration {
            eta: 1.0,
            ior: 1.0,
            ..Configuration::new(BSDF_GLASS, COLOR, direction(cosine(i), 1.0))
        })
        .collect();
    for (i, sample) in scatter(&TestKernel::new("bsdf.comp"), &configurations, 64, 6).iter().enumerate() {
        check_transmitted(&configurations[i / 64], sample);
    }
}

/// Where the surface is smooth, thin-walled transmission goes straight through and the specular lobe mirrors, each as often as its probability says
/// and with the weight that makes up for it.
#[test]
fn metallic_roughness_has_delta_lobes() {
    let mut configurations = Vec::new();
    for (roughness, metallic) in [(0.0, 0.0), (0.0, 0.5), (0.0, 1.0), (0.5, 0.0), (0.5, 0.4)] {
        for (cosine, transmission) in [(1.0, 1.0), (0.6, 0.7), (0.05, 0.3), (0.3, 0.0)] {
            let wo = direction(cosine, 3.0);
            configurations.push(Configuration::metallic_roughness(roughness, metallic, 1.5, transmission, wo));
        }
    }
    let samples = scatter(&bsdf_kernel(), &configurations, SAMPLES, 7);
    let threshold = sidak(ALPHA, 2 * configurations.len());
    for (c, samples) in configurations.iter().zip(samples.chunks_exact(SAMPLES)) {
        let model = MetallicRoughness::new(c, c.wo);
        let lobes = model.lobes();
        let mut counts = [0_u64; 2];
        for sample in samples.iter().filter(|sample| sample.is_delta()) {
            let through = sample.flags & SCATTERED_THROUGH != 0;
            counts[usize::from(through)] += 1;
            let (direction, weight) = if through {
                (-c.wo, model.through() / lobes.z)
            } else {
                (mirrored(c.wo), model.specular_albedo() / lobes.x)
            };
            assert_eq!((sample.wi, sample.pdf), (direction, 0.0), "{c:?}: {sample:?}");
            assert!((sample.weight - weight).abs().max_element() < 1e-5, "{c:?}: {sample:?} instead of {weight}");
        }
        let expected = if c.alpha == 0.0 { [lobes.x.min(1.0), lobes.z] } else { [0.0; 2] };
        for (count, probability) in counts.into_iter().zip(expected) {
            let p = binomial_two_sided(count, SAMPLES as u64, probability);
            assert!(p > threshold, "{c:?}: {count} of {SAMPLES} at {probability}: p = {p:.2e}");
        }
    }
}
