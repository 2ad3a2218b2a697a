//! `sunfleck shader-test`: the project's own expectations hold on the device, those of a new lobe hold at once, and each
//! kind of check notices the fault that it is there for, by a lobe or a function with that fault.

use std::collections::BTreeMap;
use std::rc::Rc;
use std::sync::OnceLock;

use crate::common::gpu;
use crate::common::scenes::short_form;
use crate::common::statistics::{binomial_two_sided, chi_square_test};
use sunfleck::gpu::shader_compiler::Sources;
use sunfleck::render::DeviceChoice;
use sunfleck::shader_test::expectations::Expectations;
use sunfleck::shader_test::targets::Target;
use sunfleck::shader_test::template::new_bsdf;
use sunfleck::shader_test::{CheckReport, FileReport, TestDevice, run};

fn test(sources: Sources, file: &str, seed: u32) -> FileReport {
    static DEVICE: OnceLock<TestDevice> = OnceLock::new();
    let device = DEVICE.get_or_init(|| TestDevice::open(DeviceChoice::Auto).expect("a Vulkan device"));
    let expectations = Expectations::parse(&sources[file]).unwrap_or_else(|error| panic!("{file}: {error}"));
    let kernel = file.replace(".toml", ".comp");
    let target = Target { sources: Rc::new(sources), file: file.to_owned(), kernel, expectations };
    let report = run(device, &target, seed).expect("the kernel runs");
    gpu::assert_no_validation_messages();
    report
}

fn failing(report: &FileReport) -> Vec<&CheckReport> {
    report.checks.iter().filter(|check| !check.passed).collect()
}

#[test]
fn the_projects_own_expectations_hold() {
    let files: Vec<_> = gpu::sources().keys().filter(|name| name.ends_with(".toml")).collect();
    assert!(files.len() >= 4, "{files:?}");
    for file in files {
        let report = test(gpu::sources().clone(), file, 0);
        for check in &report.checks {
            println!("{file}: {} {}: {}", check.check, check.name, check.summary);
        }
        assert!(report.passed, "{file}: {:#?}", failing(&report));
    }
}

const LOBE: &str = "include/bsdf_velvet.glsl";
const EXPECTED: &str = "test/bsdf_velvet.toml";

/// The shaders with a new lobe in which `original` is replaced.
fn lobe_with(original: &str, replaced: &str) -> Sources {
    let mut sources = gpu::sources().clone();
    sources.extend(new_bsdf("velvet", &sources).expect("the name is free"));
    let text = &sources[LOBE];
    assert_eq!(text.matches(original).count(), 1, "`{original}` occurs once in the lobe");
    let text = text.replace(original, replaced);
    sources.insert(LOBE.to_owned(), text);
    sources
}

/// Which checks fail of the lobe with a fault, by the expectations as they are written for it.
fn faulty_checks(original: &str, replaced: &str) -> BTreeMap<String, String> {
    let report = test(lobe_with(original, replaced), EXPECTED, 0);
    let failed = failing(&report);
    failed.iter().for_each(|check| println!("{}: {}", check.check, check.failures[0]));
    failed.iter().map(|check| (format!("{} {}", check.check, check.name), check.failures.join("\n"))).collect()
}

fn assert_fails(faults: &BTreeMap<String, String>, check: &str, words: &[&str]) {
    let told = faults.get(check).unwrap_or_else(|| panic!("'{check}' passes; these fail: {faults:#?}"));
    for word in words {
        assert!(told.contains(word), "{check} does not say '{word}': {told}");
    }
}

#[test]
fn a_new_lobe_is_as_expected_at_once() {
    let report = test(lobe_with("(wi.y / pdf)", "(wi.y / pdf)"), EXPECTED, 0);
    assert!(report.passed, "{:#?}", failing(&report));
    let kinds: Vec<_> = report.checks.iter().map(|check| check.check).collect();
    assert_eq!(kinds, ["integral", "chi2", "weights", "furnace", "furnace", "reciprocity", "finite"]);
    // The albedo that its comment states, color·(1 − ⅔·s·cos θo), is found: at full strength along the normal a third.
    let white = |strength: f64, cosine: f64| {
        let text = format!(
            "parameters = ['red', 'green', 'blue', 'strength']\n\
             grid = {{ red = 1, green = 1, blue = 1, strength = {strength}, cosine = {cosine} }}\n\
             [[test]]\ncheck = 'furnace'\nequals = {}\ntolerance = 1e-5\n",
            1.0 - strength * cosine / 1.5
        );
        let mut sources = lobe_with("(wi.y / pdf)", "(wi.y / pdf)");
        sources.insert(EXPECTED.to_owned(), text);
        test(sources, EXPECTED, 0)
    };
    for (strength, cosine) in [(1.0, 1.0), (0.5, 0.8), (1.0, 0.1)] {
        let report = white(strength, cosine);
        assert!(report.passed, "{:#?}", report.checks);
    }
}

/// Directions that are not those of the density.
#[test]
fn chi2_notices_another_distribution() {
    let faults = faulty_checks("sample_cosine_hemisphere(u.yz)", "sample_cosine_hemisphere(vec2(u.y * u.y, u.z))");
    assert_fails(&faults, "chi2 ", &["χ² = ", "255 degrees of freedom", "p = ", "worst bin", "expected", "cosine"]);
    // The furnace sees that the samples and f do not go together.
    assert_fails(&faults, "furnace white", &["two models", "by quadrature", "± ", "by samples"]);
    assert!(!faults.contains_key("integral ") && !faults.contains_key("weights "), "{faults:#?}");
}

/// Azimuths that are left out: the mean of everything is as it was.
#[test]
fn chi2_notices_a_missing_sector() {
    let faults = faulty_checks("sample_cosine_hemisphere(u.yz)", "sample_cosine_hemisphere(vec2(u.y, 0.97 * u.z))");
    assert_fails(&faults, "chi2 ", &["worst bin"]);
}

/// A GGX lobe whose sampled α is 4 % off, from 0.004 to 0.5, also at grazing angles: of each roughness at some angle.
#[test]
fn chi2_notices_a_roughness_that_is_off() {
    const FILE: &str = "test/bsdf_metallic_roughness.toml";
    let mut sources = gpu::sources().clone();
    let kernel = FILE.replace(".toml", ".comp");
    let sampled = "return bsdf_scatter(parameters(configuration, wo), wo, u);";
    let off =
        "BsdfParameters p = parameters(configuration, wo);\n    p.alpha *= 1.04;\n    return bsdf_scatter(p, wo, u);";
    assert!(sources[&kernel].contains(sampled));
    let text = sources[&kernel].replace(sampled, off);
    sources.insert(kernel, text);
    for roughness in [0.06, 0.3, 0.7] {
        let text = format!(
            "parameters = ['color', 'metallic', 'roughness', 'ior', 'transmission', 'solid']\n\
             grid = {{ color = 0.8, metallic = 1, roughness = {roughness}, ior = 1.5, transmission = 0, solid = 0, \
             cosine = [1, 0.6, 0.1] }}\n[[test]]\ncheck = 'chi2'\n"
        );
        sources.insert(FILE.to_owned(), text);
        let report = test(sources.clone(), FILE, 0);
        println!("roughness {roughness}: {}", report.checks[0].summary);
        assert!(!report.passed, "{:?}", report.checks[0]);
    }
}

/// A density 2 % too large.
#[test]
fn integral_notices_a_wrong_normalisation() {
    let faults = faulty_checks("return max(wi.y, 0.0) * INV_PI;", "return max(wi.y, 0.0) * (1.02 * INV_PI);");
    assert_fails(&faults, "integral ", &["expected 1 ± 0.001, got 1.02", "∫ pdf 1.02", "absorbed 0"]);
    assert_fails(&faults, "furnace white", &["two models", "0.98"]);
}

/// A weight without its cosine.
#[test]
fn weights_notice_a_missing_cosine() {
    let faults = faulty_checks("* (wi.y / pdf)", "/ pdf");
    assert_fails(&faults, "weights ", &["has weight (", "f·|cos|/pdf is ("]);
    assert_fails(&faults, "furnace white", &["two models"]);
    assert!(!faults.contains_key("chi2 "), "{faults:#?}");
}

/// A surface that gives back 5 % more than it gets.
#[test]
fn furnace_notices_light_from_nowhere() {
    let faults = faulty_checks("(INV_PI * (1.0 -", "(1.05 * INV_PI * (1.0 -");
    assert_fails(&faults, "furnace white", &["expected at most 1 (tolerance 0.001), got 1.05", "by quadrature"]);
    assert_fails(&faults, "furnace Lambertian", &["red: expected 0.9", "got 0.945"]);
    assert!(!faults.contains_key("weights ") && !faults.contains_key("chi2 "), "{faults:#?}");
}

/// A value that goes by one direction alone.
#[test]
fn reciprocity_notices_a_preferred_direction() {
    let faults = faulty_checks("* wo.y * wi.y", "* wo.y * wo.y");
    assert_fails(&faults, "reciprocity ", &["f(wo, wi) is (", "f(wi, wo) (", "for wo ("]);
    assert_eq!(faults.len(), 1, "{faults:#?}");
}

/// 0/0 along the normal, a negative value at grazing angles, a direction on the wrong side.
#[test]
fn finite_notices_nan_and_negative_values() {
    let faults = faulty_checks("* wo.y * wi.y));", "* wo.y * wi.y) * ((1.0 - wo.y) / (1.0 - wo.y)));");
    assert_fails(&faults, "finite ", &["cosine 1: ", "NaN", "negative or not finite"]);
    assert_fails(&faults, "chi2 ", &["NaN"]);
    let faults = faulty_checks("- velvet_strength(p)", "- (wo.y < 0.01 ? 1e9 : 0.5)");
    assert_fails(&faults, "finite ", &["negative or not finite"]);
    // A weight above its bound.
    let faults = faulty_checks("(wi.y / pdf)", "(8.0 * wi.y / pdf)");
    assert_fails(&faults, "finite ", &["has the weight ("]);
    let faults = faulty_checks("pdf, 0u);", "pdf, SCATTERED_THROUGH);");
    assert_fails(&faults, "weights ", &["is above the surface, and its flags has SCATTERED_THROUGH"]);
}

/// A fault in a delta lobe's probability: what goes there is not what the density leaves.
#[test]
fn integral_notices_a_share_that_is_counted_twice() {
    let mirror =
        "if (u.x < 0.1) return BsdfSample(vec3(-wo.x, wo.y, -wo.z), p.color, 0.0, SCATTERED_DELTA);\n    vec3 wi = ";
    let faults = faulty_checks("vec3 wi = sample", &format!("{mirror}sample"));
    assert_fails(&faults, "integral ", &["got 1.", "delta lobes 0.1", "p = "]);
    assert_fails(&faults, "chi2 ", &["p = "]);
}

/// A lobe that is right fails as often as its level says: the p-values of many seeds are uniform.
#[test]
fn the_level_is_kept() {
    if short_form() {
        return;
    }
    let mut sources = lobe_with("(wi.y / pdf)", "(wi.y / pdf)");
    let seeds = 64;
    let text = "parameters = ['red', 'green', 'blue', 'strength']\nsamples = 16384\nsignificance = 0.1\n\
                grid = { red = 0.9, green = 0.5, blue = 0.1, strength = 0.5, cosine = 0.5 }\n\
                [[test]]\ncheck = 'chi2'\n";
    sources.insert(EXPECTED.to_owned(), text.to_owned());
    let reports: Vec<_> = (0..seeds).map(|seed| test(sources.clone(), EXPECTED, seed).checks[0].clone()).collect();
    let mut observed = [0_u64; 4];
    for report in &reports {
        let p = report.numbers["p_value"].as_f64().expect("a p-value");
        observed[((4.0 * p) as usize).min(3)] += 1;
    }
    let uniform = chi_square_test(&observed, &[f64::from(seeds) / 4.0; 4], seeds.into());
    assert!(uniform.p_value > 1e-3, "{observed:?}: {uniform:?}");
    let failed = reports.iter().filter(|report| !report.passed).count() as u64;
    assert!(binomial_two_sided(failed, seeds.into(), 0.1) > 1e-3, "{failed} of {seeds} fail at level 0.1");
}

/// Of a function: shaders/test/fresnel.comp and sampler.comp with a fault.
fn function_faults(file: &str, kernel: (&str, &str), expectations: &str) -> String {
    let mut sources = gpu::sources().clone();
    let comp = file.replace(".toml", ".comp");
    let text = sources[&comp].replace(kernel.0, kernel.1);
    sources.insert(comp, text);
    let head: String =
        sources[file].lines().take_while(|line| !line.starts_with("[[test]]")).fold(String::new(), |a, b| a + b + "\n");
    sources.insert(file.to_owned(), head + expectations);
    let report = test(sources, file, 0);
    let failed = failing(&report);
    assert_eq!(failed.len(), 1, "{report:#?}");
    println!("{}: {}\n{}", failed[0].check, failed[0].summary, failed[0].failures.join("\n"));
    failed[0].failures.join("\n")
}

#[test]
fn functions_are_held_against_values_ranges_means_and_uniformity() {
    let none = ("", "");
    let told = function_faults(
        "test/fresnel.toml",
        none,
        "[[test]]\ncheck = 'values'\nrows = [[1, 1.5, 1, 0.04, 0.04], [1, 3, 1, 0.3, 'any']]\nrelative = 1e-5\n",
    );
    assert!(told.contains("cosine 1, eta 3: exact is 0.25, expected 0.3"), "{told}");

    let within = "[[test]]\ncheck = 'range'\nover = { cosine = [0.5, 1], eta = 1.5 }\nwithin = { exact = [0, 0.05] }\n";
    let told = function_faults("test/fresnel.toml", none, within);
    assert!(told.contains("cosine 0.5, eta 1.5: exact is 0.0") && told.contains("expected 0 to 0.05"), "{told}");
    let nan = ("fresnel_dielectric(x.x, transmitted, x.y)", "sqrt(x.x - 2.0)");
    let told = function_faults("test/fresnel.toml", nan, &within.replace("within = { exact = [0, 0.05] }\n", ""));
    assert!(told.contains("exact is NaN, expected a finite number"), "{told}");

    let bent = ("floatBitsToUint(to_unit(bits))", "floatBitsToUint(pow(to_unit(bits), vec4(1.02)))");
    let draw = "draw = { pixel = 0, index = [0, 4294967296], seed = 0, bounce = 0, group = 2 }\n";
    let told = function_faults(
        "test/sampler.toml",
        bent,
        &format!("[[test]]\ncheck = 'uniform'\n{draw}outputs = ['a', 'c']\n"),
    );
    assert!(told.contains("χ² = ") && told.contains("63 degrees of freedom, p = "), "{told}");
    let told = function_faults(
        "test/sampler.toml",
        bent,
        &format!("[[test]]\ncheck = 'mean'\n{draw}expect = {{ b = 0.5 }}\n"),
    );
    assert!(told.contains("b 0.49") && told.contains("± ") && told.contains("expected 0.5, p = "), "{told}");
}
