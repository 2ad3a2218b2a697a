//! Furnaces: scenes whose every pixel has a known radiance.

use crate::common::scenes::{scene, short_form};
use crate::common::statistics::{Comparison, Estimate};
use crate::common::{gpu, scenes};
use sunfleck::render::{LightSampling, Settings};

fn settings(size: u32, light_sampling: LightSampling) -> Settings {
    Settings { light_sampling, ..gpu::settings(size, size) }
}

/// The mean over the image is within 0.1 % of `radiance`, and known well enough to say so; no tile stands out.
fn assert_radiance(name: &str, light_sampling: LightSampling, radiance: f64, spp: u32) {
    let settings = settings(64, light_sampling);
    let mut tracer = gpu::path_tracer(&scene(name), &settings);
    let statistics = scenes::seeds(&mut tracer, &settings, 16, if short_form() { spp / 2 } else { spp });
    for mean in statistics.image() {
        let error = 100.0 * mean.standard_error() / radiance;
        println!("{name}, {light_sampling}: {:.5} ± {error:.3} % (exact: {radiance})", mean.mean);
        assert!(error < 0.1, "{name}: a standard error of {error} % cannot show 0.1 %");
        assert!((mean.mean - radiance).abs() <= 1e-3 * radiance, "{name}, {light_sampling}: {}", mean.mean);
    }
    let tiles = statistics.tiles();
    let exact = vec![Estimate::exact(radiance); tiles.len()];
    let comparison = Comparison::new(&tiles, &exact, 0.01);
    assert!(comparison.passed(), "{name}, {light_sampling}: {comparison}");
}

/// The modes under test; their agreement has a test of its own.
fn modes() -> &'static [LightSampling] {
    let all = &[LightSampling::Mis, LightSampling::Mixture, LightSampling::Bsdf];
    if short_form() { &all[..1] } else { all }
}

#[test]
fn closed_box_of_albedo_one_half_has_radiance_two() {
    for mode in modes().iter().copied() {
        assert_radiance("furnace_box", mode, 2.0, 16);
    }
}

#[test]
fn closed_box_of_albedo_four_fifths_has_radiance_five() {
    for mode in modes().iter().copied() {
        assert_radiance("furnace_box_08", mode, 5.0, 32);
    }
}

#[test]
fn white_spheres_vanish_before_a_white_environment() {
    for name in ["lambertian", "mirror", "refract", "glass"] {
        for mode in modes().iter().copied() {
            assert_radiance(&format!("furnace_sphere_{name}"), mode, 1.0, 16);
        }
    }
}

/// By BSDF sampling alone every single path has the weight 1: nothing is lost and nothing is noise.
#[test]
fn white_mirror_and_diffuse_paths_have_weight_one() {
    for name in ["furnace_sphere_mirror", "furnace_sphere_lambertian"] {
        let settings = settings(64, LightSampling::Bsdf);
        let run = gpu::run(&mut gpu::path_tracer(&scene(name), &settings), 1, 16);
        for (index, pixel) in run.film.radiance().iter().enumerate() {
            assert!(pixel.iter().all(|c| (c - 1.0).abs() < 1e-5), "{name}, pixel {index}: {pixel:?}");
        }
    }
}
