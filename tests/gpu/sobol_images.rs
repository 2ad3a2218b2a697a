//! What the Sobol' sampler is worth in the Cornell box: how much less noise, how fast it falls, and where in the spectrum it
//! is. Images of several seeds are compared with each other: both samplers are unbiased (agreement.rs), so the variance over
//! seeds is the mean squared error.

use std::f64::consts::TAU;

use glam::{DVec3, Vec3};
use sunfleck::film::luminance;
use sunfleck::render::{SamplerKind, Settings};

use crate::common::brute_force::{Triangle, meet, world_triangles};
use crate::common::gpu;
use crate::common::kernel::TestKernel;
use crate::common::scenes::{scene, short_form};
use crate::common::trace::{self, Ray};

/// Luminances of images of several seeds.
struct Images(Vec<Vec<f64>>);

impl Images {
    fn render(sampler: SamplerKind, max_bounces: u32, size: u32, spp: &[u32], seeds: u32) -> Vec<Self> {
        let settings = Settings { sampler, max_bounces: Some(max_bounces), ..gpu::settings(size, size) };
        let mut tracer = gpu::path_tracer(&scene("cornell"), &settings);
        let mut image = |seed, spp| {
            let film = gpu::run(&mut tracer, seed, spp).film;
            film.pixels().iter().map(|pixel| luminance(pixel.mean())).collect()
        };
        spp.iter().map(|&spp| Self((0..seeds).map(|seed| image(seed, spp)).collect())).collect()
    }

    fn mean(&self) -> Vec<f64> {
        (0..self.0[0].len()).map(|p| self.0.iter().map(|image| image[p]).sum::<f64>() / self.0.len() as f64).collect()
    }

    /// Mean over the chosen pixels of the unbiased variance over seeds.
    fn variance(&self, pixels: impl Iterator<Item = usize> + Clone) -> f64 {
        let mean = self.mean();
        let square = |p: usize| self.0.iter().map(|image| (image[p] - mean[p]).powi(2)).sum::<f64>();
        let count = pixels.clone().count() as f64;
        pixels.map(square).sum::<f64>() / (count * (self.0.len() - 1) as f64)
    }
}

#[test]
fn sixty_four_samples_have_a_fraction_of_the_error() {
    if short_form() {
        return;
    }
    for (max_bounces, bound) in [(1, 0.05), (7, 0.15)] {
        let mse = |sampler| {
            let images = &Images::render(sampler, max_bounces, 128, &[64], 4)[0];
            images.variance(0..images.0[0].len())
        };
        let (sobol, independent) = (mse(SamplerKind::Sobol), mse(SamplerKind::Independent));
        println!("{max_bounces} bounces: {sobol:.3e} over {independent:.3e} is {:.4}", sobol / independent);
        assert!(sobol < bound * independent, "{max_bounces} bounces: {sobol} and {independent}");
    }
}

/// Pixels in which one flat surface is seen, from every point of which the whole lamp is: by rays through the corners of the
/// pixel, and from there to nine points of each of the lamp's triangles.
fn pixels_without_edges(kernel: &TestKernel, size: u32) -> Vec<usize> {
    let triangles = world_triangles(kernel);
    let is_lamp = |triangle: &Triangle| kernel.prepared.triangle(triangle.id[0]).light.is_some();
    let points: Vec<DVec3> = triangles.iter().filter(|t| is_lamp(t)).flat_map(|t| lamp_points(&t.vertices)).collect();
    let [origin, forward, right, up] = [
        kernel.constants.camera_origin,
        kernel.constants.camera_forward,
        kernel.constants.camera_right,
        kernel.constants.camera_up,
    ]
    .map(|v| Vec3::from(v).as_dvec3());
    // What is seen through a corner: the unit normal of its surface, and the point; `None` if part of the lamp is not seen.
    let corner = |x: u32, y: u32| {
        let film = |k: u32| f64::from(k) / f64::from(size) * 2.0 - 1.0;
        let direction = forward + right * film(x) - up * film(y);
        let ray = Ray::new(origin, direction);
        let hits =
            triangles.iter().filter_map(|t| Some((meet(&ray, t).filter(|m| m.margin >= 0.0 && m.t > 0.0)?.t, t)));
        let (t, surface) = hits.min_by(|a, b| a.0.total_cmp(&b.0))?;
        let point = origin + direction * t;
        let [a, b, c] = surface.vertices;
        let normal = (b - a).cross(c - a).normalize();
        let lit = points.iter().all(|lamp| {
            let to = Ray::new(point, *lamp - point);
            normal.dot(*lamp - point) > 0.0
                && !triangles
                    .iter()
                    .any(|t| meet(&to, t).is_some_and(|m| m.margin >= 0.0 && (1e-4..0.9999).contains(&m.t)))
        });
        lit.then_some((normal, point))
    };
    let corners: Vec<Option<(DVec3, DVec3)>> =
        (0..=size).flat_map(|y| (0..=size).map(move |x| (x, y))).map(|(x, y)| corner(x, y)).collect();
    let smooth = |p: &usize| {
        let (x, y, row) = (*p % size as usize, *p / size as usize, size as usize + 1);
        let Some((normal, point)) = corners[y * row + x] else { return false };
        [y * row + x + 1, (y + 1) * row + x, (y + 1) * row + x + 1].into_iter().all(|other| {
            corners[other].is_some_and(|(n, q)| n.dot(normal) > 0.999_999 && normal.dot(q - point).abs() < 1e-4)
        })
    };
    (0..(size * size) as usize).filter(smooth).collect()
}

fn lamp_points(vertices: &[DVec3; 3]) -> Vec<DVec3> {
    let [a, b, c] = *vertices;
    let grid = [0.0, 0.5, 1.0];
    grid.into_iter().flat_map(|u| grid.map(|v| a + (b - a) * (u * (1.0 - v)) + (c - a) * (u * v))).collect()
}

/// log MSE over log samples: −1 for independent samples, −2 for a net and a smooth integrand in two dimensions and more than
/// −1.5 where edges are met; with two pairs that are padded the cross term is left, −1 but small.
#[test]
fn away_from_edges_the_error_falls_faster() {
    if short_form() {
        return;
    }
    let size = 64;
    let pixels = pixels_without_edges(&trace::kernel(&scene("cornell")), size);
    assert!(pixels.len() > 500, "{} pixels are too few", pixels.len());
    let counts = [4, 8, 16, 32, 64, 128, 256];
    let slope = |sampler| {
        let images = Images::render(sampler, 1, size, &counts, 4);
        let logs: Vec<[f64; 2]> = counts
            .iter()
            .zip(&images)
            .map(|(&n, i)| [f64::from(n).ln(), i.variance(pixels.iter().copied()).ln()])
            .collect();
        let mean = |k: usize| logs.iter().map(|l| l[k]).sum::<f64>() / logs.len() as f64;
        let (x, y) = (mean(0), mean(1));
        logs.iter().map(|l| (l[0] - x) * (l[1] - y)).sum::<f64>() / logs.iter().map(|l| (l[0] - x).powi(2)).sum::<f64>()
    };
    let (sobol, independent) = (slope(SamplerKind::Sobol), slope(SamplerKind::Independent));
    println!("{} pixels: slopes {sobol:.3} and {independent:.3}", pixels.len());
    assert!(sobol <= -1.4, "{sobol}");
    assert!((independent + 1.0).abs() < 0.05, "{independent}");
}

/// Power of the frequencies (kx, ky), 0 ≤ kx, ky < size/2: |Σ e(x, y) exp(2πi (kx·x + ky·y)/size)|², columns first.
fn powers(error: &[f64], size: usize) -> Vec<f64> {
    let turn: Vec<[f64; 2]> = (0..size).map(|k| (TAU * k as f64 / size as f64).sin_cos().into()).collect();
    let transform = |values: &dyn Fn(usize) -> [f64; 2], k: usize| {
        (0..size).fold([0.0, 0.0], |[re, im], i| {
            let ([sin, cos], [a, b]) = (turn[k * i % size], values(i));
            [re + a * cos - b * sin, im + a * sin + b * cos]
        })
    };
    let columns: Vec<Vec<[f64; 2]>> =
        (0..size / 2).map(|ky| (0..size).map(|x| transform(&|y| [error[y * size + x], 0.0], ky)).collect()).collect();
    let power = |ky: usize, kx: usize| {
        let [re, im] = transform(&|x| columns[ky][x], kx);
        re * re + im * im
    };
    (0..size / 2).flat_map(|ky| (0..size / 2).map(move |kx| (ky, kx))).map(|(ky, kx)| power(ky, kx)).collect()
}

/// Mean power of the relative error at 0.02 to 0.1 cycles a pixel over that at 0.35 to 0.5: 1 for white noise. The error is
/// what two images differ by.
fn low_over_high(images: &Images, size: usize, counts: &dyn Fn(usize) -> bool) -> f64 {
    let mean = images.mean();
    let mut bands = [(0.02..0.1, 0.0, 0.0), (0.35..0.5, 0.0, 0.0)];
    for pair in images.0.chunks_exact(2) {
        let relative = |p: usize| if counts(p) { (pair[0][p] - pair[1][p]) / (mean[p] + 0.05) } else { 0.0 };
        let error: Vec<f64> = (0..size * size).map(relative).collect();
        for (k, power) in powers(&error, size).into_iter().enumerate() {
            let radius = ((k / (size / 2)) as f64).hypot((k % (size / 2)) as f64) / size as f64;
            for (range, sum, count) in &mut bands {
                if range.contains(&radius) {
                    (*sum, *count) = (*sum + power, *count + 1.0);
                }
            }
        }
    }
    let [low, high] = bands.map(|(_, sum, count)| sum / count);
    low / high
}

#[test]
fn the_error_is_blue_noise_at_powers_of_two() {
    if short_form() {
        return;
    }
    let size = 256;
    let counts = [1, 2, 4, 8, 16, 32, 64];
    let smooth = pixels_without_edges(&trace::kernel(&scene("cornell")), size);
    let mut is_smooth = vec![false; (size * size) as usize];
    smooth.iter().for_each(|p| is_smooth[*p] = true);
    for (max_bounces, bounds) in [(1, [0.85, 0.35]), (7, [0.9, 0.9])] {
        let ratios = |sampler, counts: &[u32]| -> Vec<[f64; 2]> {
            let images = Images::render(sampler, max_bounces, size, counts, 4);
            let ratios = |i: &Images| {
                [low_over_high(i, size as usize, &|_| true), low_over_high(i, size as usize, &|p| is_smooth[p])]
            };
            images.iter().map(ratios).collect()
        };
        let sobol = ratios(SamplerKind::Sobol, &counts);
        let [white] = ratios(SamplerKind::Independent, &[16])[..] else { unreachable!() };
        println!("{max_bounces} bounces, low over high at {counts:?}: {sobol:.2?}; independent {white:.2?}");
        assert!(white.iter().all(|ratio| (ratio - 1.0).abs() < 0.15), "{white:?}");
        let holds = |ratios: &[f64; 2]| ratios.iter().zip(&bounds).all(|(ratio, bound)| ratio < bound);
        assert!(sobol.iter().all(holds), "{max_bounces} bounces: {sobol:?}");
    }
}
