//! The rough boundary of a volume (shaders/include/bsdf_dielectric.glsl): χ² of sampling against density, the furnace,
//! and values against the model in f64. Reflections and refractions are told by the visible normal that leads
//! to them, in the coordinates in which visible normals are uniform: there every lobe is as broad as the square.

use std::f64::consts::PI;

use crate::common::bsdf::{
    Configuration, SCATTERED_DELTA, SCATTERED_THROUGH, Sample, Value, bsdf_kernel, direction, evaluate,
    evaluating_kernel, luminance, scatter,
};
use crate::common::dielectric_albedo::Table;
use crate::common::kernel::TestKernel;
use crate::common::microfacets::{fresnel, ggx_distribution, refracted_cosine, smith_lambda};
use crate::common::statistics::{chi_square_test, sidak};
use glam::DVec3;

/// Level of each test here, all of its configurations together.
const ALPHA: f64 = 0.01;
/// Samples of a configuration.
const SAMPLES: usize = 1 << 14;
/// Bins along an axis of the square, and quadrature points along an axis of a bin.
const BINS: usize = 8;
const POINTS: usize = 12;

const ROUGHNESS: [f32; 6] = [1.0 / 64.0, 0.06, 0.2, 0.45, 0.7, 1.0];
const COSINES: [f64; 4] = [1.0, 0.7, 0.25, 0.05];
/// Relative to the side of wo.
const ETAS: [f32; 8] = [1.02, 1.1, 1.5, 3.0, 1.0 / 1.02, 1.0 / 1.1, 1.0 / 1.5, 1.0 / 3.0];

fn boundary(roughness: f32, eta: f32, wo: DVec3) -> Configuration {
    let plain = Configuration::metallic_roughness(roughness, 0.0, eta, 1.0, wo);
    Configuration { solid: true, color: [1.0; 3], ..plain }
}

/// Every roughness with every index and angle where the boundary is rough to f32.
fn boundaries() -> Vec<Configuration> {
    let mut all = Vec::new();
    for (i, roughness) in ROUGHNESS.into_iter().enumerate() {
        for (j, eta) in ETAS.into_iter().enumerate() {
            for (k, cosine) in COSINES.into_iter().enumerate() {
                let c = boundary(roughness, eta, direction(cosine, 0.5 + (i + 2 * j + 3 * k) as f64));
                if rounding(&c, 1.0) < 0.02 {
                    all.push(c);
                }
            }
        }
    }
    all
}

/// How much the rounding of directions to f32 changes D(h), relatively. The half vector wo + η·wi has a length of |η − 1|
/// and more, and ln D changes with its slope by 2/α at most.
fn rounding(c: &Configuration, half_vector_length: f64) -> f64 {
    let eta = f64::from(c.eta);
    let length = half_vector_length.min((eta - 1.0).abs());
    2.0 / f64::from(c.alpha) * 2.0_f64.powi(-23) * eta.max(1.0) / length / c.wo.y.max(0.05)
}

/// The square of visible normals around wo (Dupuy and Benyoub 2023).
struct VisibleNormals {
    alpha: [f64; 2],
    wo: DVec3,
    stretched: DVec3,
}

impl VisibleNormals {
    fn new(c: &Configuration) -> Self {
        let alpha = c.alphas().map(f64::from);
        let stretched = DVec3::new(alpha[0] * c.wo.x, c.wo.y, alpha[1] * c.wo.z).normalize();
        Self { alpha, wo: c.wo, stretched }
    }

    fn normal(&self, [u, v]: [f64; 2]) -> DVec3 {
        let y = (1.0 - u) * (1.0 + self.stretched.y) - self.stretched.y;
        let radius = (1.0 - y * y).max(0.0).sqrt();
        let (sine, cosine) = (2.0 * PI * v).sin_cos();
        let h = self.stretched + DVec3::new(radius * cosine, y, radius * sine);
        DVec3::new(self.alpha[0] * h.x, h.y, self.alpha[1] * h.z).normalize()
    }

    fn coordinates(&self, h: DVec3) -> [f64; 2] {
        let h = DVec3::new(h.x / self.alpha[0], h.y, h.z / self.alpha[1]).normalize();
        let cap = h * (2.0 * h.dot(self.stretched)) - self.stretched;
        let u = 1.0 - (cap.y + self.stretched.y) / (1.0 + self.stretched.y);
        [u, (cap.z.atan2(cap.x) / (2.0 * PI)).rem_euclid(1.0)]
    }

    fn lambda(&self, w: DVec3) -> f64 {
        smith_lambda(w, self.alpha)
    }

    /// Density of visible normals, per solid angle of h.
    fn density(&self, h: DVec3) -> f64 {
        ggx_distribution(h, self.alpha) * self.wo.dot(h) / (self.wo.y * (1.0 + self.lambda(self.wo)))
    }
}

/// Where a normal leads: to its reflection, or to its refraction.
#[derive(Clone, Copy)]
struct Turn {
    wi: DVec3,
    /// dωi / dωh.
    jacobian: f64,
    /// The Fresnel share of it.
    share: f64,
}

fn turns(c: &Configuration, h: DVec3) -> [Option<Turn>; 2] {
    let eta = f64::from(c.eta);
    let near = c.wo.dot(h);
    let transmitted = refracted_cosine(near, eta);
    let total = f64::from(c.specular);
    let reflectance = transmitted.map_or(1.0, |far| fresnel(near, far, eta) * total);
    let reflected = h * (2.0 * near) - c.wo;
    let up = (reflected.y > 0.0).then_some(Turn { wi: reflected, jacobian: 4.0 * near, share: reflectance });
    let down = transmitted.and_then(|far| {
        let wi = h * (near / eta - far) - c.wo / eta;
        let jacobian = (near - eta * far).powi(2) / (eta * eta * far);
        (wi.y < 0.0).then_some(Turn { wi, jacobian, share: 1.0 - reflectance })
    });
    [up, down]
}

/// The value of the boundary in f64; `turn` leads from wo to wi by h.
fn model(c: &Configuration, h: DVec3, turn: &Turn) -> f64 {
    let normals = VisibleNormals::new(c);
    let masked = (1.0 + normals.lambda(c.wo)) / (1.0 + normals.lambda(c.wo) + normals.lambda(turn.wi));
    let flux = turn.share * normals.density(h) / turn.jacobian * masked / turn.wi.y.abs();
    let radiance = if turn.wi.y < 0.0 { flux / f64::from(c.eta).powi(2) } else { flux };
    radiance / kept(c)
}

/// What the table says that one scattering keeps.
fn kept(c: &Configuration) -> f64 {
    let wo = DVec3::new(c.wo.x.hypot(c.wo.z), c.wo.y, 0.0);
    let [all, without] = Table::stored().look_up(wo, c.alpha.into(), c.eta.into());
    without + f64::from(c.specular) * (all - without)
}

fn bin([u, v]: [f64; 2]) -> usize {
    let cell = |x: f64| ((x * BINS as f64) as usize).min(BINS - 1);
    cell(u) * BINS + cell(v)
}

/// Integrals of what the shader says: the density over each bin, reflections first, and the flux.
fn integrate(kernel: &TestKernel, configurations: &[Configuration]) -> Vec<(Vec<f64>, f64)> {
    const N: usize = BINS * POINTS;
    let mut at = Vec::new();
    let mut weights = Vec::new();
    for (i, c) in configurations.iter().enumerate() {
        let normals = VisibleNormals::new(c);
        for k in 0..N * N {
            let u = [(k / N) as f64, (k % N) as f64].map(|x| (x + 0.5) / N as f64);
            let h = normals.normal(u);
            for (side, turn) in turns(c, h).into_iter().enumerate() {
                if let Some(turn) = turn {
                    at.push((i, turn.wi));
                    weights.push((bin(u) + side * BINS * BINS, turn.jacobian / normals.density(h) / (N * N) as f64));
                }
            }
        }
    }
    let mut results = vec![(vec![0.0; 2 * BINS * BINS], 0.0); configurations.len()];
    for ((value, &(i, wi)), (bin, weight)) in evaluate(kernel, configurations, &at).iter().zip(&at).zip(weights) {
        let c = &configurations[i];
        assert!(value.pdf.is_finite() && value.f.is_finite() && value.pdf >= 0.0, "{c:?}: {value:?} at {wi}");
        let scale = if wi.y < 0.0 { f64::from(c.eta).powi(2) } else { 1.0 };
        results[i].0[bin] += value.pdf * weight;
        results[i].1 += luminance(value.f) * scale * wi.y.abs() * weight;
    }
    results
}

/// The normal by which a direction is reached, on the side of wo.
fn half_vector(c: &Configuration, wi: DVec3) -> DVec3 {
    let h = if wi.y > 0.0 { c.wo + wi } else { c.wo + wi * f64::from(c.eta) };
    h.normalize() * if h.y < 0.0 { -1.0 } else { 1.0 }
}

fn failures(sampled: &TestKernel, evaluated: &TestKernel, configurations: &[Configuration]) -> Vec<String> {
    let threshold = sidak(ALPHA, configurations.len());
    let samples = scatter(sampled, configurations, SAMPLES, 5);
    let integrals = integrate(evaluated, configurations);
    let mut failures = Vec::new();
    for ((c, (densities, _)), samples) in configurations.iter().zip(&integrals).zip(samples.chunks_exact(SAMPLES)) {
        let mut observed = vec![0; densities.len()];
        let normals = VisibleNormals::new(c);
        for s in samples.iter().filter(|s| !s.is_absorbed()) {
            assert!(s.weight.is_finite() && !s.is_delta(), "{c:?}: {s:?}");
            let side = usize::from(s.flags & SCATTERED_THROUGH != 0);
            observed[bin(normals.coordinates(half_vector(c, s.wi))) + side * BINS * BINS] += 1;
        }
        let mut expected: Vec<f64> = densities.iter().map(|d| d * SAMPLES as f64).collect();
        // What is absorbed is a bin too.
        observed.push(samples.iter().filter(|s| s.is_absorbed()).count() as u64);
        expected.push((SAMPLES as f64 - expected.iter().sum::<f64>()).max(0.0));
        if let Err(error) = pool_small(&mut observed, &mut expected) {
            failures.push(format!("{c:?}: {error}"));
        }
        let result = chi_square_test(&observed, &expected, SAMPLES as u64);
        if result.p_value < threshold {
            failures.push(format!("{c:?}: {result:?}"));
        }
    }
    failures
}

/// Joins the bins where next to nothing is expected with the fullest one. There the edges of what a facet can do run
/// between the points of the quadrature, and rounding can move a sample over them (where refraction ends the
/// refracted cosine changes by the root of what the incident one does): up to one in five hundred.
fn pool_small(observed: &mut [u64], expected: &mut [f64]) -> Result<(), String> {
    let fullest = (0..expected.len()).max_by(|a, b| expected[*a].total_cmp(&expected[*b])).expect("bins");
    let (mut found, mut awaited) = (0, 0.0);
    for bin in 0..expected.len() {
        if expected[bin] < 8.0 {
            found += std::mem::take(&mut observed[bin]);
            awaited += std::mem::take(&mut expected[bin]);
        }
    }
    observed[fullest] += found;
    expected[fullest] += awaited;
    let allowed = 2e-3 * SAMPLES as f64 + 5.0 * awaited.sqrt();
    let close = (found as f64 - awaited).abs() < allowed;
    if close { Ok(()) } else { Err(format!("{found} samples where {awaited:.1} are expected")) }
}

/// Boundaries alone and as a part of a material whose other lobes are broad.
#[test]
fn scattered_directions_follow_the_pdf() {
    let mut configurations = boundaries();
    for (i, c) in boundaries().into_iter().filter(|c| c.alpha > 0.1).enumerate().step_by(3) {
        let (transmission, metallic) = [(0.5, 0.0), (1.0, 0.4), (0.3, 0.3)][i / 3 % 3];
        configurations.push(Configuration { transmission, metallic, specular: [1.0, 0.3][i % 2], ..c });
    }
    let failures = failures(&bsdf_kernel(), &evaluating_kernel(), &configurations);
    assert!(failures.is_empty(), "{} of {} fail:\n{}", failures.len(), configurations.len(), failures.join("\n"));
}

#[test]
fn a_wrong_roughness_is_noticed() {
    let configurations: Vec<_> = boundaries().into_iter().filter(|c| c.wo.y == 1.0 && c.eta == 1.5).collect();
    let failures = failures(&bsdf_kernel().define("ALPHA_FAULT", 1.1), &evaluating_kernel(), &configurations);
    assert_eq!(failures.len(), configurations.len());
}

/// White boundaries give back what they get, at every roughness, index and angle; never more than 0.1 % too much.
#[test]
fn white_boundaries_give_back_what_they_get() {
    let mut configurations = boundaries();
    configurations.extend(boundaries().into_iter().step_by(5).map(|c| Configuration { specular: 0.4, ..c }));
    let mut worst = [(0.0, 0); 2];
    let integrals = integrate(&evaluating_kernel(), &configurations);
    for (i, (_, flux)) in integrals.iter().enumerate() {
        let slack = rounding(&configurations[i], 1.0) + 1e-3;
        let excess = flux - 1.0;
        if excess + slack < worst[0].0 {
            worst[0] = (excess + slack, i);
        }
        if excess - slack > worst[1].0 {
            worst[1] = (excess - slack, i);
        }
    }
    let [least, most] = worst.map(|(excess, i)| format!("{excess:+.2e} at {:?}", configurations[i]));
    println!("flux of white: from 1 {least} to 1 {most}");
    assert!(worst[1].0 < 1e-3 && worst[0].0 > -0.01, "from {least} to {most}");
}

/// At scattered directions, the shader's values are the model's in f64, the sample's weight and density are those of
/// evaluation.
#[test]
fn samples_agree_with_the_model() {
    const EACH: usize = 256;
    let configurations = boundaries();
    let samples = scatter(&bsdf_kernel(), &configurations, EACH, 6);
    let kernel = evaluating_kernel();
    let at: Vec<(usize, DVec3)> = samples.iter().enumerate().map(|(i, s)| (i / EACH, s.wi)).collect();
    let values = evaluate(&kernel, &configurations, &at);
    let (mut compared, mut reflected) = (0, 0);
    for ((sample, value), (i, wi)) in samples.iter().zip(&values).zip(&at) {
        if !sample.is_absorbed() {
            check(&configurations[*i], sample, value);
            compared += 1;
            reflected += usize::from(wi.y > 0.0);
        }
    }
    assert!(compared > samples.len() / 2 && reflected > compared / 20, "{reflected} of {compared}");
}

fn check(c: &Configuration, sample: &Sample, value: &Value) {
    let h = half_vector(c, sample.wi);
    let length = if sample.wi.y > 0.0 { 1.0 } else { (c.wo + sample.wi * f64::from(c.eta)).length() };
    let tolerance = 1e-4 + 8.0 * rounding(c, length);
    let close = |a: f64, b: f64| (a - b).abs() <= tolerance * a.abs().max(b.abs());
    let context = || format!("{c:?}: {sample:?}, {value:?}, tolerance {tolerance:.1e}");
    assert!(close(sample.pdf, value.pdf), "{}", context());
    assert!(close(sample.weight.x, value.f.x * sample.wi.y.abs() / value.pdf), "{}", context());
    let side = usize::from(sample.wi.y < 0.0);
    // Close to the edge of what a facet can do, rounding decides.
    let Some(turn) = turns(c, h)[side] else { return };
    let exact = model(c, h, &Turn { wi: sample.wi, ..turn });
    assert!(close(value.f.x, exact), "{} the model says {exact}", context());
}

/// Where the index of refraction or the roughness is too small for a lobe, the boundary is smooth: it reflects and
/// refracts by Fresnel's equations and Snell's law, and keeps all light.
#[test]
fn smooth_boundaries_follow_fresnel_and_snell() {
    let mut configurations = Vec::new();
    for (roughness, eta) in [(0.0, 1.5), (0.0, 1.0 / 1.5), (0.5, 1.0001), (1.0, 1.0), (0.5, 1.0 / 1.0001), (0.01, 3.0)]
    {
        for cosine in [1.0, 0.6, 0.2, 0.01] {
            configurations.push(boundary(roughness, eta, direction(cosine, 1.0)));
        }
    }
    for c in &mut configurations {
        c.alpha = if c.alpha < 2.0_f32.powi(-12) { 0.0 } else { c.alpha };
    }
    let samples = scatter(&bsdf_kernel(), &configurations, SAMPLES, 7);
    for (c, samples) in configurations.iter().zip(samples.chunks_exact(SAMPLES)) {
        let eta = f64::from(c.eta);
        let transmitted = refracted_cosine(c.wo.y, eta);
        let reflectance = transmitted.map_or(1.0, |far| fresnel(c.wo.y, far, eta));
        let mut through = 0;
        for s in samples {
            assert!(s.flags & SCATTERED_DELTA != 0 && s.pdf == 0.0, "{c:?}: {s:?}");
            let refracted = s.flags & SCATTERED_THROUGH != 0;
            let weight = if refracted { 1.0 / (eta * eta) } else { 1.0 };
            assert!((s.weight.x / weight - 1.0).abs() < 1e-6, "{c:?}: {s:?}");
            let expected = if refracted {
                DVec3::new(-c.wo.x / eta, -transmitted.expect("no total reflection"), -c.wo.z / eta)
            } else {
                DVec3::new(-c.wo.x, c.wo.y, -c.wo.z)
            };
            assert!((s.wi - expected).length() < 2e-6, "{c:?}: {s:?}");
            through += u64::from(refracted);
        }
        let sigma = (reflectance * (1.0 - reflectance) * SAMPLES as f64).sqrt();
        let difference = through as f64 - (1.0 - reflectance) * SAMPLES as f64;
        assert!(difference.abs() <= 4.5 * sigma, "{c:?}: {through} of {SAMPLES}");
    }
}
