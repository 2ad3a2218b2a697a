//! `bsdf_scatter` draws from the density that `bsdf_pdf` states: χ² tests of the shaders' own functions over a grid of
//! parameters, with bins narrow enough for the narrowest lobe. Delta lobes and absorption are cells of their own.

use crate::common::bsdf::{
    Configuration, MetallicRoughness, SCATTERED_THROUGH, Sample, Value, bsdf_kernel, direction, evaluate,
    evaluating_kernel, luminance, scatter,
};
use crate::common::half_vector_bins::{HalfVectorBins, Node};
use crate::common::kernel::TestKernel;
use crate::common::statistics::{ChiSquare, chi_square_test, sidak};
use glam::DVec3;
use std::f64::consts::PI;
use sunfleck::layout::{BSDF_LAMBERTIAN, BSDF_METALLIC_ROUGHNESS};

/// Level of each test here, all of its configurations together.
const ALPHA: f64 = 0.01;
/// Samples of a configuration.
const SAMPLES: usize = 1 << 14;
/// Nodes along the polar angle in a bin.
const ORDER: usize = 10;

/// From the roughness at which the lobe becomes a delta (1/64: α = 2^-12) to 1.
const ROUGHNESS: [f32; 7] = [0.0, 1.0 / 64.0, 0.06, 0.2, 0.45, 0.7, 1.0];
const METALLIC: [f32; 3] = [0.0, 0.5, 1.0];
const COSINES: [f64; 5] = [1.0, 0.8, 0.3, 0.05, 1e-3];
const IORS: [f32; 4] = [1.0001, 1.5, 3.0, 0.7];

/// Every roughness with every metalness and angle; indices and transmission take turns.
fn configurations() -> Vec<Configuration> {
    let mut all = Vec::new();
    for (i, roughness) in ROUGHNESS.into_iter().enumerate() {
        for (j, metallic) in METALLIC.into_iter().enumerate() {
            for (k, cosine) in COSINES.into_iter().enumerate() {
                // At grazing angles f32 directions do not resolve the narrowest lobes (`Configuration::rounding`).
                if cosine < 0.01 && roughness > 0.0 && roughness < 0.1 {
                    continue;
                }
                let n = i + 2 * j + 3 * k;
                let transmission = if n % 3 == 0 { 0.6 } else { 0.0 };
                let wo = direction(cosine, 0.7 + n as f64);
                all.push(Configuration::metallic_roughness(roughness, metallic, IORS[n % 4], transmission, wo));
            }
        }
    }
    // Anisotropic, and with a specular reflection of its own strength and colour.
    for (i, stretch) in [0.6, 1.0, 1.7].into_iter().enumerate() {
        for (j, cosine) in COSINES.into_iter().take(4).enumerate() {
            let roughness = [0.3, 0.5, 0.8][(i + j) % 3];
            let wo = direction(cosine, 0.3 + (i + 3 * j) as f64);
            let plain = Configuration::metallic_roughness(roughness, [0.0, 1.0][j % 2], 1.5, 0.3, wo);
            all.push(Configuration {
                stretch,
                specular: [0.4, 1.0, 0.0][i],
                specular_color: [2.0, 0.3, 1.0][i],
                ..plain
            });
        }
    }
    all.extend(strongly_anisotropic());
    let lambertian = |cosine| Configuration::new(BSDF_LAMBERTIAN, [0.8, 0.5, 0.2], direction(cosine, 4.0));
    all.extend([1.0, 0.4, 1e-6].map(lambertian));
    all
}

/// Full roughness along one axis, and a sixteenth or a sixty-fourth of it along the other.
fn strongly_anisotropic() -> Vec<Configuration> {
    let mut all = Vec::new();
    for (i, stretch) in [4.0_f32, 0.25, 8.0].into_iter().enumerate() {
        for (j, cosine) in [1.0, 0.7, 0.2].into_iter().enumerate() {
            let alpha = stretch.min(1.0 / stretch);
            let wo = direction(cosine, 0.2 + (i + 2 * j) as f64);
            // In half vectors scaled by 8 a diffuse base is too uneven for the quadrature.
            let metallic = if stretch == 8.0 { 1.0 } else { [1.0, 0.0][j % 2] };
            let plain = Configuration::metallic_roughness(0.0, metallic, 1.5, 0.4, wo);
            all.push(Configuration { alpha, stretch, ..plain });
        }
    }
    all
}

fn bins(c: &Configuration) -> HalfVectorBins {
    let alpha = if c.kind == BSDF_METALLIC_ROUGHNESS { f64::from(c.alpha) } else { 0.0 };
    HalfVectorBins::new(alpha, c.stretch.into(), c.wo)
}

/// Bins above the surface, then as many below it.
fn cells(c: &Configuration) -> usize {
    2 * bins(c).len()
}

/// Those of the bins, and where the surface transmits, their mirror images.
fn nodes(c: &Configuration, order: usize) -> Vec<Node> {
    let bins = bins(c);
    let mut nodes = bins.nodes(order);
    if c.transmission > 0.0 {
        let mirrored = |n: &Node| Node { bin: n.bin + bins.len(), wi: mirrored(n.wi), weight: n.weight };
        nodes.extend(nodes.iter().map(mirrored).collect::<Vec<_>>());
    }
    nodes
}

fn mirrored(w: DVec3) -> DVec3 {
    DVec3::new(w.x, -w.y, w.z)
}

/// The integral over each bin of what the shader says at its nodes.
struct Integrals {
    pdf: Vec<f64>,
    /// ∫ f·|cos| over all bins.
    albedo: DVec3,
}

fn integrate(kernel: &TestKernel, configurations: &[Configuration]) -> Vec<Integrals> {
    let nodes: Vec<Vec<Node>> = configurations.iter().map(|c| nodes(c, ORDER)).collect();
    let at: Vec<(usize, DVec3)> =
        nodes.iter().enumerate().flat_map(|(i, nodes)| nodes.iter().map(move |node| (i, node.wi))).collect();
    let values = evaluate(kernel, configurations, &at);
    let mut rest = values.as_slice();
    let integrals = |(c, nodes): (&Configuration, &Vec<Node>)| {
        let (own, others) = rest.split_at(nodes.len());
        rest = others;
        let mut result = Integrals { pdf: vec![0.0; cells(c)], albedo: DVec3::ZERO };
        for (node, value) in nodes.iter().zip(own) {
            assert!(
                value.pdf.is_finite() && value.pdf >= 0.0 && value.f.is_finite(),
                "{c:?}: {value:?} at {}",
                node.wi
            );
            result.pdf[node.bin] += value.pdf * node.weight;
            result.albedo += value.f * (node.wi.y.abs() * node.weight);
        }
        result
    };
    configurations.iter().zip(&nodes).map(integrals).collect()
}

/// Probabilities of the delta lobes: mirrored, straight through.
fn delta_probabilities(c: &Configuration) -> [f64; 2] {
    if c.kind != BSDF_METALLIC_ROUGHNESS {
        return [0.0; 2];
    }
    let lobes = MetallicRoughness::new(c, c.wo).lobes();
    if c.alpha == 0.0 { [lobes.x, lobes.z] } else { [0.0; 2] }
}

/// Cells: the bins above and below, then the two delta lobes; what is absorbed is in none.
fn count(c: &Configuration, samples: &[Sample]) -> Vec<u64> {
    let bins = bins(c);
    let mut observed = vec![0; cells(c) + 2];
    for sample in samples {
        assert!(sample.weight.is_finite() && sample.pdf.is_finite() && sample.wi.is_finite(), "{c:?}: {sample:?}");
        if sample.is_delta() {
            observed[cells(c) + usize::from(sample.flags & SCATTERED_THROUGH != 0)] += 1;
        } else if !sample.is_absorbed() {
            let below = sample.wi.y < 0.0;
            let up = if below { mirrored(sample.wi) } else { sample.wi };
            observed[bins.bin(up) + if below { bins.len() } else { 0 }] += 1;
        }
    }
    observed
}

/// The χ² test of every configuration.
fn chi_square(sampled: &TestKernel, evaluated: &TestKernel, configurations: &[Configuration]) -> Vec<ChiSquare> {
    let integrals = integrate(evaluated, configurations);
    let samples = scatter(sampled, configurations, SAMPLES, 1);
    let test = |((c, integrals), samples): ((&Configuration, &Integrals), &[Sample])| {
        let mut probability = integrals.pdf.clone();
        probability.extend(delta_probabilities(c));
        let expected: Vec<f64> = probability.iter().map(|p| p * SAMPLES as f64).collect();
        chi_square_test(&count(c, samples), &expected, SAMPLES as u64)
    };
    configurations.iter().zip(&integrals).zip(samples.chunks_exact(SAMPLES)).map(test).collect()
}

fn failures(configurations: &[Configuration], results: &[ChiSquare]) -> Vec<String> {
    let threshold = sidak(ALPHA, results.len());
    let failed = configurations.iter().zip(results).filter(|(_, result)| result.p_value < threshold);
    failed.map(|(c, result)| format!("{c:?}: {result:?}")).collect()
}

#[test]
fn scattered_directions_follow_the_pdf() {
    let configurations = configurations();
    let failures = failures(&configurations, &chi_square(&bsdf_kernel(), &evaluating_kernel(), &configurations));
    assert!(failures.is_empty(), "{} fail:\n{}", failures.len(), failures.join("\n"));
}

/// Roughness whose α is 10 % off between sampling and density is noticed at every roughness that has a lobe.
#[test]
fn a_wrong_roughness_is_noticed() {
    let wo = direction(0.6, 1.0);
    let metal = |roughness| Configuration::metallic_roughness(roughness, 1.0, 1.5, 0.0, wo);
    let configurations: Vec<Configuration> = ROUGHNESS[2..].iter().map(|r| metal(*r)).collect();
    let faulty = bsdf_kernel().define("ALPHA_FAULT", 1.1);
    let results = chi_square(&faulty, &evaluating_kernel(), &configurations);
    assert_eq!(failures(&configurations, &results).len(), configurations.len(), "{results:?}");
}

/// A density that is too small by 3 % is noticed, since the samples that it does not account for are a cell.
#[test]
fn a_wrong_normalisation_is_noticed() {
    let configurations = [Configuration::new(BSDF_LAMBERTIAN, [1.0; 3], direction(0.6, 1.0))];
    let faulty = evaluating_kernel().define("PDF_FAULT", 0.97);
    let results = chi_square(&bsdf_kernel(), &faulty, &configurations);
    assert_eq!(failures(&configurations, &results).len(), 1, "{results:?}");
}

/// The quadrature that the expectations rest on is good to a part of a count: against one of four times the order, with
/// the model in f64.
#[test]
fn the_quadrature_has_converged() {
    for c in configurations().iter().filter(|c| c.kind == BSDF_METALLIC_ROUGHNESS) {
        let model = MetallicRoughness::new(c, c.wo);
        let integrate = |order| {
            let mut sums = vec![0.0; cells(c)];
            nodes(c, order).iter().for_each(|node| sums[node.bin] += model.pdf(c.wo, node.wi) * node.weight);
            sums
        };
        for (coarse, fine) in integrate(ORDER).into_iter().zip(integrate(4 * ORDER)) {
            // A tenth of the standard deviation of the count.
            let tolerance = 0.1 * (fine.max(1.0 / SAMPLES as f64) / SAMPLES as f64).sqrt();
            assert!((coarse - fine).abs() < tolerance, "{c:?}: {coarse} and {fine}");
        }
    }
}

/// The continuous part, the delta lobes and what is reflected below the surface are all there is.
#[test]
fn densities_integrate_to_their_share() {
    let configurations = configurations();
    for (c, integrals) in configurations.iter().zip(integrate(&evaluating_kernel(), &configurations)) {
        let continuous: f64 = integrals.pdf.iter().sum();
        let all = continuous + delta_probabilities(c).iter().sum::<f64>();
        assert!(all < 1.0 + 1e-3, "{c:?}: {all}");
        // Along the normal the bound leaves out just what is reflected below the surface, unless it is anisotropic.
        if c.wo.y == 1.0 && c.stretch == 1.0 {
            assert!((all - 1.0).abs() < 2e-4, "{c:?}: {all}");
        }
    }
}

/// A white furnace: whatever white is made of, a metal, a dielectric over a diffuse or transmitting base or a mixture, gives
/// back what it gets, at every roughness with a lobe and every angle; a Lambertian surface gives its albedo.
#[test]
fn white_lobes_give_back_what_they_get() {
    let mut configurations = Vec::new();
    for roughness in ROUGHNESS.into_iter().skip(1).chain([0.03, 0.1, 0.3, 0.55, 0.85]) {
        for cosine in [1.0, 0.9, 0.6, 0.3, 0.1, 0.03, 0.01] {
            for (i, (metallic, transmission)) in
                [(1.0, 0.0), (0.0, 0.0), (0.5, 0.0), (0.0, 0.6), (0.0, 1.0)].into_iter().enumerate()
            {
                let wo = direction(cosine, 1.0 + i as f64);
                for ior in [IORS[i % 4], 1.5] {
                    let white = Configuration::metallic_roughness(roughness, metallic, ior, transmission, wo);
                    configurations.push(Configuration { color: [1.0; 3], ..white });
                }
            }
        }
    }
    let mut worst = [0.0_f64; 2];
    for (c, integrals) in configurations.iter().zip(integrate(&evaluating_kernel(), &configurations)) {
        // The error of f32 directions where the lobe is narrow; that of the quadrature is below 1e-4.
        let slack = c.rounding(c.wo);
        let albedo = luminance(integrals.albedo) - 1.0;
        worst = [worst[0].min(albedo + slack), worst[1].max(albedo - slack)];
        assert!(albedo <= 1e-3 + slack && albedo >= -1e-2 - slack, "{c:?}: 1 + {albedo:.2e}, slack {slack:.1e}");
    }
    println!("albedo of white: 1 {:+.2e} to 1 {:+.2e}", worst[0], worst[1]);
    let lambertian =
        [0.9, 1e-3].map(|cosine| Configuration::new(BSDF_LAMBERTIAN, [0.8, 0.5, 0.2], direction(cosine, 2.0)));
    for integrals in integrate(&evaluating_kernel(), &lambertian) {
        assert!((integrals.albedo - DVec3::new(0.8, 0.5, 0.2)).abs().max_element() < 1e-4, "{}", integrals.albedo);
    }
}

/// Without energy given back, a rough white metal keeps 1 − ln 2 along its normal: the furnace would notice.
#[test]
fn a_single_scattering_loses_light() {
    let wo = DVec3::Y;
    let c = Configuration { color: [1.0; 3], ..Configuration::metallic_roughness(1.0, 1.0, 1.5, 0.0, wo) };
    let albedo = luminance(integrate(&evaluating_kernel(), &[c])[0].albedo);
    let single = albedo / luminance(MetallicRoughness::new(&c, wo).multiple_scattering(DVec3::ONE));
    assert!((single - (1.0 - 2.0_f64.ln())).abs() < 1e-3, "{single}");
}

/// A white furnace for unequal roughness, from nearly round lobes to grooves, for metals and dielectrics.
#[test]
fn anisotropic_lobes_give_back_what_they_get() {
    let mut configurations = Vec::new();
    for larger in [0.1_f32, 0.4, 1.0] {
        for ratio in [1.2_f32, 2.0, 4.0, 16.0, 64.0] {
            for (i, cosine) in [1.0, 0.6, 0.3, 0.1].into_iter().enumerate() {
                for (j, azimuth) in [0.0, 0.8, 1.57].into_iter().enumerate() {
                    let turned = (i + j) % 2 == 0;
                    let azimuth = if turned { azimuth } else { 1.57 - azimuth };
                    let stretch = if turned { ratio.sqrt() } else { 1.0 / ratio.sqrt() };
                    // In half vectors scaled by 4 and more only a plain dielectric's base can be told apart.
                    let kinds = if ratio <= 4.0 { 3 } else { 1 };
                    let other = [(0.0, 0.0), (0.5, 0.0), (0.0, 0.6)][(i + 2 * j) % kinds];
                    for (metallic, transmission) in [(1.0, 0.0), other] {
                        let white = Configuration::metallic_roughness(
                            0.0,
                            metallic,
                            1.5,
                            transmission,
                            direction(cosine, azimuth),
                        );
                        configurations.push(Configuration {
                            color: [1.0; 3],
                            alpha: larger / ratio.sqrt(),
                            stretch,
                            ..white
                        });
                    }
                }
            }
        }
    }
    let kernel = evaluating_kernel();
    let mut worst = [[0.0_f64; 2]; 2];
    for (c, albedo) in configurations.iter().zip(white_albedos(&kernel, &configurations)) {
        let slack = c.rounding(c.wo);
        let excess = albedo - 1.0;
        let [low, high] = &mut worst[usize::from(c.metallic < 1.0)];
        (*low, *high) = (low.min(excess + slack), high.max(excess - slack));
        assert!(excess <= 1e-3 + slack && excess >= -1e-2 - slack, "{:?} {c:?}: 1 {excess:+.2e}", c.alphas());
    }
    println!("albedo of white anisotropic metals: 1 {:+.2e} to 1 {:+.2e}", worst[0][0], worst[0][1]);
    println!("of white anisotropic dielectrics: 1 {:+.2e} to 1 {:+.2e}", worst[1][0], worst[1][1]);
}

/// Albedos of white surfaces. In half vectors scaled by 4 and more a diffuse base is too uneven for the quadrature: what it
/// reflects is π times what a value falls by when the base is black, which is the same in all directions.
fn white_albedos(kernel: &TestKernel, configurations: &[Configuration]) -> Vec<f64> {
    let uneven = |c: &Configuration| c.metallic == 0.0 && c.stretch.max(1.0 / c.stretch) > 2.0;
    let black = |c: &Configuration| Configuration { color: [0.0; 3], ..*c };
    let lobes: Vec<_> = configurations.iter().map(|c| if uneven(c) { black(c) } else { *c }).collect();
    let both: Vec<_> = configurations.iter().flat_map(|c| [*c, black(c)]).collect();
    let at: Vec<_> = (0..both.len()).map(|i| (i, direction(0.5, 3.0))).collect();
    let values = evaluate(kernel, &both, &at);
    let base = |i: usize| PI * luminance(values[2 * i].f - values[2 * i + 1].f);
    let albedo = |(i, integrals): (usize, Integrals)| {
        luminance(integrals.albedo) + if uneven(&configurations[i]) { base(i) } else { 0.0 }
    };
    integrate(kernel, &lobes).into_iter().enumerate().map(albedo).collect()
}

/// At directions that were scattered: the density that came with a sample is the one that is evaluated, and the weight is
/// f·cos/pdf; both agree with the model in f64; and f is the same from both sides.
#[test]
fn samples_agree_with_evaluation() {
    const EACH: usize = 512;
    let configurations = configurations();
    let samples = scatter(&bsdf_kernel(), &configurations, EACH, 2);
    let at: Vec<(usize, DVec3)> = samples.iter().enumerate().map(|(i, s)| (i / EACH, s.wi)).collect();
    let values = evaluate(&evaluating_kernel(), &configurations, &at);
    for ((sample, value), (index, _)) in samples.iter().zip(&values).zip(&at) {
        if sample.is_delta() || sample.is_absorbed() {
            assert!(sample.pdf == 0.0, "{sample:?}");
            continue;
        }
        check_sample(&configurations[*index], sample, value);
    }
}

fn check_sample(c: &Configuration, sample: &Sample, value: &Value) {
    let close = |a: f64, b: f64, tolerance: f64| (a - b).abs() <= tolerance * a.abs().max(b.abs());
    let all_close = |a: DVec3, b: DVec3, tolerance| (0..3).all(|i| close(a[i], b[i], tolerance));
    let context = || format!("{c:?}: {sample:?}, {value:?}");
    let below = sample.flags & SCATTERED_THROUGH != 0;
    assert!((sample.wi.y < 0.0) == below && (sample.wi.length() - 1.0).abs() < 1e-6, "{}", context());
    // Fused or not, D amplifies the rounding of the half vector.
    let tolerance = 2e-5 + 4.0 * c.rounding(sample.wi);
    assert!(close(sample.pdf, value.pdf, tolerance), "{}", context());
    assert!(all_close(sample.weight, value.f * (sample.wi.y.abs() / value.pdf), tolerance), "{}", context());
    if c.kind != BSDF_METALLIC_ROUGHNESS {
        assert!(all_close(value.f, value.reverse_f, tolerance), "not reciprocal: {}", context());
        return;
    }
    // The table is read between nodes: rounding of its coordinates moves what is read.
    let model = MetallicRoughness::new(c, c.wo);
    assert!(close(value.pdf, model.pdf(c.wo, sample.wi), tolerance), "{}", context());
    assert!(all_close(value.f, model.evaluate(c.wo, sample.wi), tolerance), "{}", context());
    // A metal is reciprocal but for the light of several scatterings that is given back by wo's albedo.
    if c.metallic == 1.0 {
        let reverse = MetallicRoughness::new(c, sample.wi);
        let color = DVec3::from(c.color.map(f64::from));
        let (one, other) = (model.multiple_scattering(color), reverse.multiple_scattering(color));
        let tolerance = 2.0 * tolerance;
        assert!(all_close(value.f / one, value.reverse_f / other, tolerance), "not reciprocal: {}", context());
    }
}

/// Nothing is lost to infinities at the most grazing angles and the narrowest lobes.
#[test]
fn everything_is_finite_at_grazing_angles() {
    let mut configurations = Vec::new();
    for roughness in ROUGHNESS {
        for cosine in [1e-3, 1e-5, 1e-6] {
            for metallic in METALLIC {
                let wo = direction(cosine, 2.0);
                configurations.push(Configuration::metallic_roughness(roughness, metallic, 1.5, 0.5, wo));
            }
        }
    }
    let samples = scatter(&bsdf_kernel(), &configurations, SAMPLES, 3);
    for (i, sample) in samples.iter().enumerate() {
        let c = &configurations[i / SAMPLES];
        assert!(sample.weight.is_finite() && sample.pdf.is_finite() && sample.wi.is_finite(), "{c:?}: {sample:?}");
        assert!(sample.weight.min_element() >= 0.0 && sample.pdf >= 0.0, "{c:?}: {sample:?}");
        // No lobe is chosen much too seldom: the least probable specular one has 1/21, of a sum of at most 2.
        assert!(sample.weight.max_element() < 42.0, "{c:?}: {sample:?}");
    }
}
