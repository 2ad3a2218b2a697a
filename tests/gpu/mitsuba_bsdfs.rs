//! The shaders' BSDFs against values of Mitsuba's (tests/reference/mitsuba_bsdfs.json), number by number. Where the models
//! differ on purpose (docs/accuracy/mitsuba-bsdfs.md), what differs is a known factor, and it is computed here in f64:
//!
//! - Smith's function: correlated heights here, separate ones there;
//! - the light of multiple scattering, which is given back here and lost there;
//! - the Fresnel term of dielectric lobes: Schlick's here, the exact one there;
//! - visible normals: the bounded ones here, all there.

use crate::common::bsdf::{Configuration, MetallicRoughness, Value, evaluate, evaluating_kernel};
use crate::common::dielectric_albedo::Table;
use crate::common::gpu;
use crate::common::kernel::{floats, texel};
use crate::common::microfacets::{fresnel, refracted_cosine, smith_lambda};
use crate::common::mitsuba_bsdfs::{Case, Continuous, Smooth, table};
use glam::DVec3;
use sunfleck::layout::{BSDF_LAMBERTIAN, BSDF_METALLIC_ROUGHNESS};

/// Relative error of one rounding to f32.
const ROUNDING: f64 = 1.0 / 16_777_216.0;
/// Roundings on the way to a value, of both renderers together: D squares a sum of three (12 each), Smith's function and
/// the cosines take 10, Fresnel's term 12, the albedo's table 12, products 4.
const OPERATIONS: f64 = 100.0;

/// Sunfleck's material for a case, seen from wo.
fn configuration(case: &Case<Continuous>, wo: DVec3) -> Configuration {
    let [x, z] = case.alpha;
    let alpha =
        Configuration { alpha: (x * z).sqrt(), stretch: (x / z).sqrt(), ior: case.eta, eta: case.eta, ..new(case, wo) };
    match case.plugin.as_str() {
        "diffuse" => Configuration { kind: BSDF_LAMBERTIAN, ..alpha },
        "roughconductor" => Configuration { metallic: 1.0, ..alpha },
        "principled" => Configuration { metallic: case.metallic, ..alpha },
        "principledthin" => Configuration { transmission: 1.0, ..alpha },
        "roughdielectric" => Configuration { transmission: 1.0, solid: true, ..alpha },
        other => panic!("no counterpart of {other}"),
    }
}

fn new(case: &Case<Continuous>, wo: DVec3) -> Configuration {
    Configuration::new(BSDF_METALLIC_ROUGHNESS, case.color, wo)
}

/// The known factors by which Mitsuba's f is the shader's f, and the same of the pdf; and what each difference is.
struct Factors {
    /// Separate over correlated heights.
    smith: f64,
    /// What Mitsuba leaves out of multiple scattering, or of the energy that a base gets.
    energy: DVec3,
    /// The exact Fresnel term over Schlick's, or of what it lets through over what the base gets.
    fresnel: f64,
    /// All visible normals over the bounded ones; `None` where lobes are chosen by other probabilities.
    pdf: Option<f64>,
}

fn factors(c: &Configuration, plugin: &str, row: &Continuous) -> Factors {
    if plugin == "diffuse" {
        return Factors { smith: 1.0, energy: DVec3::ONE, fresnel: 1.0, pdf: Some(1.0) };
    }
    let alpha = c.alphas().map(f64::from);
    let up = DVec3::new(row.wi.x, row.wi.y.abs(), row.wi.z);
    let (o, i) = (smith_lambda(row.wo, alpha), smith_lambda(up, alpha));
    let smith = (1.0 + o + i) / ((1.0 + o) * (1.0 + i));
    let model = MetallicRoughness::new(c, row.wo);
    let cosine = row.wo.dot((row.wo + up).normalize());
    let color = DVec3::from(c.color.map(f64::from));
    let ior = f64::from(c.ior);
    let exact = refracted_cosine(cosine, ior).map_or(1.0, |transmitted| fresnel(cosine, transmitted, ior));
    let f0 = ((f64::from(c.ior) - 1.0) / (f64::from(c.ior) + 1.0)).powi(2);
    let (energy, fresnel) = match plugin {
        "roughdielectric" => {
            let seen = DVec3::new(row.wo.x.hypot(row.wo.z), row.wo.y, 0.0);
            (DVec3::splat(Table::stored().look_up(seen, alpha[0], c.eta.into())[0]), 1.0)
        }
        "principledthin" => {
            let albedo = crate::common::ggx_albedo::stored(row.wo, alpha).white;
            (color / model.base_albedo() * albedo, 1.0 - exact)
        }
        _ if c.metallic == 1.0 => (1.0 / model.multiple_scattering(color), 1.0),
        _ => (1.0 / model.multiple_scattering(DVec3::splat(f0)), exact / (f0 + (1.0 - f0) * (1.0 - cosine).powi(5))),
    };
    // Density of reflections: D/(2(b·cos θo + l)), with b = 1 for all visible normals.
    let length = row.wo.y * (1.0 + 2.0 * o);
    let smallest = alpha[0].min(alpha[1]).min(1.0);
    let s = 1.0 + row.wo.x.hypot(row.wo.z);
    let bound = (1.0 - smallest * smallest) * s * s / (s * s + smallest * smallest * row.wo.y * row.wo.y);
    let pdf = match plugin {
        "roughdielectric" => Some(1.0),
        _ => (c.metallic == 1.0).then_some((bound * row.wo.y + length) / (row.wo.y + length)),
    };
    Factors { smith, energy, fresnel, pdf }
}

/// The largest and the smallest number seen.
struct Range(f64, f64);

impl Range {
    fn new() -> Self {
        Self(f64::INFINITY, f64::NEG_INFINITY)
    }

    fn add(&mut self, x: f64) {
        *self = Self(self.0.min(x), self.1.max(x));
    }
}

impl std::fmt::Display for Range {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{:.4} to {:.4}", self.0, self.1)
    }
}

/// What a case comes to: the largest errors as parts of the tolerance, and as numbers.
#[derive(Debug, Default)]
struct Outcome {
    worst_f: f64,
    worst_pdf: f64,
    /// The largest error over its tolerance.
    worst: f64,
}

/// The shader's values for all rows of all cases, by one call; `wrong` multiplies the roughness, for a test to fail with.
fn shader_values(cases: &[Case<Continuous>], wrong: f32) -> Vec<Value> {
    let rows = || cases.iter().flat_map(|case| case.rows.iter().map(move |row| (case, row)));
    let configurations: Vec<Configuration> = rows()
        .map(|(case, row)| configuration(case, row.wo))
        .map(|c| Configuration { alpha: c.alpha * wrong, ..c })
        .collect();
    let at: Vec<(usize, DVec3)> = rows().enumerate().map(|(index, (_, row))| (index, row.wi)).collect();
    evaluate(&evaluating_kernel(), &configurations, &at)
}

/// How much the rounding of the half vector changes a value, relatively. That of a refraction is shorter than two directions'
/// sum, so its slope is less well known, and so are its cosines with both directions where they are small.
fn half_vector_rounding(c: &Configuration, row: &Continuous) -> f64 {
    if !c.solid || row.wi.y > 0.0 {
        return c.rounding(row.wi);
    }
    let eta = f64::from(c.eta);
    let h = row.wo + row.wi * eta;
    let shorter = eta.max(1.0) / h.length();
    let cosine = row.wo.dot(h).abs().min(row.wi.dot(h).abs()) / h.length();
    c.rounding(row.wi) * (shorter * (row.wo.y - row.wi.y)).max(1.0) + 4.0 * ROUNDING * shorter / cosine
}

/// Compares the shader's values of a case with Mitsuba's, row by row.
fn compare(case: &Case<Continuous>, values: &[Value]) -> Outcome {
    let mut outcome = Outcome::default();
    let (mut smith, mut energy, mut fresnel, mut pdf) = (Range::new(), Range::new(), Range::new(), Range::new());
    for (row, value) in case.rows.iter().zip(values) {
        let c = configuration(case, row.wo);
        // Mitsuba's thin sheet mirrors its lobe, yet lets the mirrored direction keep to the other side of the unmirrored
        // half vector: steep parts of a rough lobe are cut off.
        if !c.solid && row.wi.y < 0.0 && row.wi.dot(row.wo + DVec3::new(row.wi.x, -row.wi.y, row.wi.z)) >= 0.0 {
            assert_eq!(row.f, DVec3::ZERO, "{}: {row:?}", case.name);
            continue;
        }
        let known = factors(&c, &case.plugin, row);
        smith.add(known.smith);
        energy.add(known.energy.x);
        fresnel.add(known.fresnel);
        // Each renderer rounds the half vector for itself.
        let tolerance = 2.0 * half_vector_rounding(&c, row) + OPERATIONS * ROUNDING;
        let expected = value.f * known.energy * (known.smith * known.fresnel);
        let error = ((expected - row.f) / row.f).abs().max_element();
        outcome.worst_f = outcome.worst_f.max(error);
        outcome.worst = outcome.worst.max(error / tolerance);
        if let Some(factor) = known.pdf {
            pdf.add(factor);
            let error = (value.pdf * factor / row.pdf - 1.0).abs();
            outcome.worst_pdf = outcome.worst_pdf.max(error);
            outcome.worst = outcome.worst.max(error / tolerance);
        }
    }
    println!(
        "{}: {} rows, f within {:.1e}, pdf within {:.1e}, {:.2} of the tolerance; Mitsuba's over ours: Smith {smith}, energy (red) {energy}, Fresnel {fresnel}, pdf {pdf}",
        case.name,
        case.rows.len(),
        outcome.worst_f,
        outcome.worst_pdf,
        outcome.worst
    );
    outcome
}

/// All cases, with how they compare.
fn compare_all(wrong: f32) -> Vec<(Case<Continuous>, Outcome)> {
    let cases = table().0;
    let values = shader_values(&cases, wrong);
    let mut rest = values.as_slice();
    let mut take = |case: &Case<Continuous>| {
        let (first, others) = rest.split_at(case.rows.len());
        rest = others;
        compare(case, first)
    };
    let outcomes: Vec<Outcome> = cases.iter().map(&mut take).collect();
    cases.into_iter().zip(outcomes).collect()
}

#[test]
fn lobes_have_mitsubas_values() {
    let outcomes = compare_all(1.0);
    for (case, outcome) in &outcomes {
        assert!(outcome.worst < 1.0, "{}: {outcome:?}", case.name);
    }
    assert!(outcomes.iter().map(|(case, _)| case.rows.len()).sum::<usize>() > 700, "the table is not whole");
}

/// A roughness that is off by one part in a thousand is noticed in every case that has one.
#[test]
fn a_roughness_slightly_off_is_noticed() {
    for (case, outcome) in compare_all(1.001).iter().filter(|(case, _)| case.plugin != "diffuse") {
        assert!(outcome.worst > 1.0, "{}: {outcome:?}", case.name);
    }
}

/// What fresnel.glsl gives for a smooth case: the transmitted cosine, the exact reflectance and Schlick's, a row.
fn shader_fresnel(case: &Case<Smooth>) -> Vec<[f64; 3]> {
    let inputs: Vec<[u32; 4]> = case.rows.iter().map(|row| texel(row.wo.y as f32, case.eta, 0.0, 0.0)).collect();
    let values = gpu::call("fresnel.comp", &inputs, inputs.len() as u32, 1).into_iter().map(floats);
    values.map(|v| [v[0].into(), v[1].into(), v[2].into()]).collect()
}

/// Roundings in a reflectance: of a coefficient's numerator relative to its denominator, which is at most 1, so absolute.
const REFLECTANCE_TOLERANCE: f64 = 24.0 * ROUNDING;

#[test]
fn smooth_boundaries_are_mitsubas() {
    for case in table().1.iter().filter(|case| case.plugin == "dielectric") {
        let eta = f64::from(case.eta);
        for (row, [transmitted, exact, _]) in case.rows.iter().zip(shader_fresnel(case)) {
            // cos² is eta² − 1 + cos² over eta²: its rounding counts by what cancels in it.
            let cancelled = (1.0 + eta * eta) / (eta * eta * transmitted.abs());
            let tolerance = REFLECTANCE_TOLERANCE * (1.0 + cancelled);
            assert!((exact - row.reflectance).abs() < tolerance, "{}: {exact} against {row:?}", case.name);
            assert_eq!(transmitted < 0.0, row.weight == 0.0, "{}: {row:?}", case.name);
            if transmitted >= 0.0 {
                let through = DVec3::new(-row.wo.x / eta, -transmitted, -row.wo.z / eta);
                assert!((through - row.through).abs().max_element() < tolerance, "{}: {through} {row:?}", case.name);
                assert!((row.weight * eta * eta - 1.0).abs() < 8.0 * ROUNDING, "{}: {row:?}", case.name);
            }
        }
    }
}

/// A thin sheet: Mitsuba adds up the reflections between its two sides, R′ = 2R/(1 + R); Sunfleck's sheet, as glTF's, reflects once, by
/// Schlick's term. From R′ follows Mitsuba's R, which is the shader's exact one.
#[test]
fn a_thin_sheet_differs_by_its_inner_reflections() {
    for case in table().1.iter().filter(|case| case.plugin == "thindielectric") {
        for (row, [_, exact, schlick]) in case.rows.iter().zip(shader_fresnel(case)) {
            let once = row.reflectance / (2.0 - row.reflectance);
            println!(
                "cos {:.3}: Mitsuba's sheet {:.5}, of one side {once:.5}, Schlick {schlick:.5}",
                row.wo.y, row.reflectance
            );
            assert!((once - exact).abs() < 2.0 * REFLECTANCE_TOLERANCE, "{once} against {exact}: {row:?}");
            assert!((row.weight - 1.0).abs() < 8.0 * ROUNDING && (row.through + row.wo).length() < 8.0 * ROUNDING);
        }
    }
}
