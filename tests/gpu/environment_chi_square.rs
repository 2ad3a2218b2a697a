//! `environment_sample` draws from the density that `environment_pdf` states, for images of awkward sizes and brightness,
//! rotated, and for uniform sampling; and it returns the radiance that `environment_radiance` has there.

use std::f64::consts::{PI, TAU};
use std::sync::Arc;

use crate::common::gpu::settings;
use crate::common::kernel::{Random, TestKernel, empty_scene, floats, vector, vector_texel};
use crate::common::statistics::{ChiSquare, chi_square_test, sidak};
use glam::DVec3;
use sunfleck::prepare::EnvironmentSampling;
use sunfleck::prepare::environment::{PreparedEnvironment, prepare, tent_sine};
use sunfleck::render::Settings;
use sunfleck::scene::{Environment, Scene};

/// Level of each test here, all of its images together.
const ALPHA: f64 = 0.01;
const SAMPLES: usize = 1 << 16;
/// Bins of a texel along each axis. Even: the density has its kinks at the texels' centres.
const SPLIT: usize = 4;
/// The specialisation constant of features.glsl that chooses uniform sampling when it is 1.
const ENVIRONMENT_SAMPLING: u32 = 8;
/// The one with the features, and their bits without an image.
const FEATURES: (u32, u32) = (4, !16);

/// An image with its place in the world.
#[derive(Clone)]
struct Image {
    width: usize,
    height: usize,
    texels: Vec<[f32; 3]>,
    rotation: f64,
}

const STRENGTH: f32 = 2.5;

impl Image {
    fn random(width: usize, height: usize, rotation: f64) -> Self {
        let mut random = Random((width * 1000 + height) as u64);
        let texels = (0..width * height).map(|_| [0; 3].map(|_| random.unit().powi(4) as f32)).collect();
        Self { width, height, texels, rotation }
    }

    /// The same, rounded to what RGBE holds exactly, so that it is stored as quads.
    fn rgbe(width: usize, height: usize, rotation: f64) -> Self {
        let mut image = Self::random(width, height, rotation);
        for texel in &mut image.texels {
            let step = (texel.iter().fold(0.0_f32, |a, &b| a.max(b)).log2().floor() - 7.0).exp2();
            *texel = texel.map(|x| (x / step).floor() * step);
        }
        assert!(image.prepared().rgbe);
        image
    }

    /// Black but for one texel.
    fn lamp(width: usize, height: usize, at: usize, radiance: f32) -> Self {
        let mut image = Self { texels: vec![[0.0; 3]; width * height], ..Self::random(width, height, 1.0) };
        image.texels[at] = [radiance; 3];
        image
    }

    fn environment(&self) -> Environment {
        Environment::Image {
            name: String::from("test"),
            width: self.width as u32,
            height: self.height as u32,
            texels: Arc::new(self.texels.clone()),
            strength: STRENGTH,
            rotation_radians: self.rotation,
        }
    }

    fn prepared(&self) -> PreparedEnvironment {
        prepare(&self.environment(), EnvironmentSampling::default()).expect("it fits")
    }

    fn texel(&self, x: i64, y: i64) -> DVec3 {
        let x = x.rem_euclid(self.width as i64) as usize;
        let y = y.clamp(0, self.height as i64 - 1) as usize;
        DVec3::from(self.texels[y * self.width + x].map(f64::from))
    }

    /// Bilinear lookup in f64, and the largest difference between the texels it is made of.
    fn lookup(&self, u: f64, v: f64) -> (DVec3, f64) {
        let (px, py) = (u * self.width as f64 - 0.5, v * self.height as f64 - 0.5);
        let (x, y) = (px.floor() as i64, py.floor() as i64);
        let (fx, fy) = (px - px.floor(), py - py.floor());
        let [a, b, c, d] = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(i, j)| self.texel(x + i, y + j));
        let value = a.lerp(b, fx).lerp(c.lerp(d, fx), fy) * f64::from(STRENGTH);
        // The rounding of u and v may take it to a neighbouring texel.
        let around = (-1..=2).flat_map(|j| (-1..=2).map(move |i| (i, j))).map(|(i, j)| self.texel(x + i, y + j));
        let (low, high) = around.fold((DVec3::INFINITY, DVec3::ZERO), |(l, h), t| (l.min(t), h.max(t)));
        (value, (high - low).max_element() * f64::from(STRENGTH))
    }

    /// The unit direction of (u, v): the image is turned counter-clockwise seen from above.
    fn direction(&self, u: f64, v: f64) -> DVec3 {
        let (theta, phi) = (v * PI, u * TAU);
        let local = DVec3::new(phi.cos() * theta.sin(), theta.cos(), phi.sin() * theta.sin());
        glam::DQuat::from_rotation_y(self.rotation) * local
    }

    fn uv(&self, direction: DVec3) -> (f64, f64) {
        let local = glam::DQuat::from_rotation_y(-self.rotation) * direction;
        ((local.z.atan2(local.x) / TAU).rem_euclid(1.0), local.x.hypot(local.z).atan2(local.y) / PI)
    }
}

fn images() -> Vec<Image> {
    vec![
        Image::random(16, 8, 0.0),
        Image::random(7, 5, 2.0),
        Image::random(1, 9, -1.0),
        Image::random(13, 1, 4.0),
        Image::random(1, 1, 0.5),
        Image::random(64, 33, 0.7),
        Image::rgbe(16, 8, 2.0),
        Image::rgbe(1, 3, 1.0),
        Image::rgbe(5, 1, 0.1),
        Image::lamp(16, 8, 37, 1e9),
        Image::lamp(8, 8, 3, 1e-9),
    ]
}

fn kernel_for(image: &Image, env_sampling: EnvironmentSampling) -> TestKernel {
    let scene = Scene { environment: image.environment(), ..empty_scene() };
    TestKernel::with_settings(
        "environment.comp",
        &scene,
        &Settings { env_sampling: Some(env_sampling), ..settings(64, 64) },
    )
}

fn kernel(image: &Image) -> TestKernel {
    kernel_for(image, EnvironmentSampling::default())
}

/// Radiance and density of directions, as the shader has them.
fn evaluate(kernel: TestKernel, directions: impl Iterator<Item = DVec3>) -> Vec<(DVec3, f64)> {
    let inputs: Vec<[u32; 4]> = directions.map(|direction| vector_texel(direction, 0)).collect();
    let outputs = kernel.define("EVALUATE", 1).run(&inputs, inputs.len(), 1);
    outputs.into_iter().map(|t| (vector(t), floats(t)[3].into())).collect()
}

/// What a sample came with.
struct Sample {
    direction: DVec3,
    pdf: f64,
    radiance: DVec3,
    /// By the functions of the direction.
    pdf_again: f64,
    radiance_again: DVec3,
}

fn sample_with(kernel: &TestKernel, bits: &[[u32; 4]]) -> Vec<Sample> {
    let outputs = kernel.run(bits, bits.len(), 3);
    let sample = |t: &[[u32; 4]]| Sample {
        direction: vector(t[0]),
        pdf: floats(t[0])[3].into(),
        radiance: vector(t[1]),
        pdf_again: floats(t[1])[3].into(),
        radiance_again: vector(t[2]),
    };
    outputs.chunks_exact(3).map(sample).collect()
}

fn sample(kernel: &TestKernel) -> Vec<Sample> {
    let mut random = Random(11);
    let bits: Vec<[u32; 4]> = (0..SAMPLES).map(|_| [0; 4].map(|_| (random.bits() >> 32) as u32)).collect();
    sample_with(kernel, &bits)
}

/// The density integrated over the parts of every texel: but for 1/sin θ, which the solid angle of du dv, 2π² sin θ,
/// cancels, it is bilinear in each, so that the middle is the mean.
fn expected(kernel: TestKernel, image: &Image) -> Vec<f64> {
    let (columns, rows) = (image.width * SPLIT, image.height * SPLIT);
    let centre = |i: usize, n: usize| (i as f64 + 0.5) / n as f64;
    let centres = (0..rows * columns).map(|i| (centre(i % columns, columns), centre(i / columns, rows)));
    let values = evaluate(kernel, centres.clone().map(|(u, v)| image.direction(u, v)));
    let mass = |((_, v), (_, pdf)): ((f64, f64), &(DVec3, f64))| {
        pdf * 2.0 * PI * PI * (v * PI).sin() / (rows * columns) as f64
    };
    centres.zip(&values).map(mass).collect()
}

/// The same for 1/4π, exactly.
fn expected_uniform(image: &Image) -> Vec<f64> {
    let (columns, rows) = (image.width * SPLIT, image.height * SPLIT);
    let cosine = |row: usize| (row as f64 / rows as f64 * PI).cos();
    (0..rows * columns).map(|i| (cosine(i / columns) - cosine(i / columns + 1)) / 2.0 / columns as f64).collect()
}

fn chi_square(image: &Image, samples: &[Sample], expected: &[f64]) -> ChiSquare {
    let (columns, rows) = (image.width * SPLIT, image.height * SPLIT);
    let mut observed = vec![0; rows * columns];
    for sample in samples {
        assert!((sample.direction.length() - 1.0).abs() < 1e-6, "{}", sample.direction);
        let (u, v) = image.uv(sample.direction);
        let column = ((u * columns as f64) as usize).min(columns - 1);
        let row = ((v * rows as f64) as usize).min(rows - 1);
        observed[row * columns + column] += 1;
    }
    // Directions on a border of cells may be rounded over it, where the other side may have no probability at all.
    let counts: Vec<f64> = expected.iter().map(|p| (p * SAMPLES as f64).max(1e-9)).collect();
    chi_square_test(&observed, &counts, SAMPLES as u64)
}

#[test]
fn importance_sampling_follows_the_pdf() {
    let images = images();
    let samplings = [EnvironmentSampling::Compensated, EnvironmentSampling::Importance];
    for (image, sampling) in images.iter().flat_map(|image| samplings.map(|sampling| (image, sampling))) {
        let name = format!("{}×{}, {sampling}", image.width, image.height);
        let expected = expected(kernel_for(image, sampling), image);
        let total: f64 = expected.iter().sum();
        assert!((total - 1.0).abs() < 1e-5, "{name}: the density sums up to {total}");
        let result = chi_square(image, &sample(&kernel_for(image, sampling)), &expected);
        assert!(result.p_value > sidak(ALPHA, 2 * images.len()), "{name}: {result:?}");
    }
}

#[test]
fn uniform_sampling_is_uniform() {
    let image = Image::random(16, 8, 2.0);
    let constant = Scene { environment: Environment::Constant([1.0, 2.0, 3.0]), ..empty_scene() };
    let constant = TestKernel::with_scene("environment.comp", &constant).specialize(FEATURES.0, FEATURES.1);
    for kernel in [kernel(&image).specialize(ENVIRONMENT_SAMPLING, 1), constant] {
        let samples = sample(&kernel);
        let result = chi_square(&image, &samples, &expected_uniform(&image));
        assert!(result.p_value > sidak(ALPHA, 2), "{result:?}");
        for s in &samples {
            assert!((s.pdf - 1.0 / (4.0 * PI)).abs() < 1e-8 && s.pdf == s.pdf_again && s.radiance == s.radiance_again);
        }
    }
}

/// An image turned by half a texel too much, or one that is sampled uniformly, does not pass for the right one.
#[test]
fn wrong_densities_are_noticed() {
    let image = Image::random(16, 8, 0.3);
    let right = expected(kernel(&image), &image);
    let turned = Image { rotation: image.rotation + 0.5 * TAU / 16.0, ..image.clone() };
    assert!(chi_square(&image, &sample(&kernel(&turned)), &right).p_value < ALPHA);
    let uniform = kernel(&image).specialize(ENVIRONMENT_SAMPLING, 1);
    assert!(chi_square(&image, &sample(&uniform), &right).p_value < ALPHA);
}

/// The density and the radiance that come with a sample are those of its direction, and what they should be in f64.
#[test]
fn samples_agree_with_lookups() {
    for image in images() {
        let prepared = image.prepared();
        let largest = largest_density(&image, &prepared);
        for s in sample(&kernel(&image)) {
            let (u, v) = image.uv(s.direction);
            let (radiance, contrast) = image.lookup(u, v);
            // u and v carry some roundings of 2^-24, and a texel is 1/width wide.
            let error = 8.0 * 2.0_f64.powi(-24) * image.width.max(image.height) as f64;
            let tolerance = error * contrast + 1e-6 * radiance.max_element();
            assert!((s.radiance - radiance).abs().max_element() <= tolerance, "{} and {radiance}", s.radiance);
            assert!((s.radiance_again - radiance).abs().max_element() <= tolerance, "{} {radiance}", s.radiance_again);
            let pdf = prepared.pdf_solid_angle(s.direction);
            let sine = (v * PI).sin();
            let tolerance = error * largest / sine + 1e-5 * pdf + pdf * 4.0 * 2.0_f64.powi(-24) / sine;
            assert!((s.pdf - pdf).abs() < tolerance, "{} instead of {pdf} at {}", s.pdf, s.direction);
            assert!((s.pdf_again - s.pdf).abs() < tolerance, "{} and {} at {}", s.pdf_again, s.pdf, s.direction);
        }
    }
}

/// The largest that the density times sin θ is anywhere: an upper bound on its change from texel to texel.
fn largest_density(image: &Image, prepared: &PreparedEnvironment) -> f64 {
    let texels = (0..image.height).flat_map(|y| (0..image.width).map(move |x| (x, y)));
    let largest = texels.map(|(x, y)| prepared.texel_probability(x, y)).fold(0.0, f64::max);
    largest * (image.width * image.height) as f64 / (2.0 * PI * PI)
}

/// Luminance over density: in grey images, where luminance is radiance, it changes by what sin θ does within a row and
/// nothing else, at the foot of a texel of 10⁹ or beside a sun too. See `the_density_follows_the_interpolated_image` of the host's tests.
#[test]
fn nothing_of_the_image_is_left_in_the_weight() {
    let mut noise = Image::random(64, 33, 0.7);
    noise.texels.iter_mut().for_each(|texel| *texel = [0.1 + texel[0]; 3]);
    noise.texels[17 * 64 + 40] = [1e5; 3];
    for image in [noise, Image::lamp(16, 8, 37, 1e9), Image::lamp(8, 8, 3, 1e-9)] {
        let height = image.height;
        let sine = |row: i64| tent_sine(row.clamp(0, height as i64 - 1) as usize, height);
        let total: f64 = (0..height).map(|y| sine(y as i64) * row_sum(&image, y)).sum();
        let mean = total * f64::from(STRENGTH) * 2.0 * PI * PI / (image.width * height) as f64;
        for s in sample(&kernel_for(&image, EnvironmentSampling::Importance)) {
            let (_, v) = image.uv(s.direction);
            let row = (v * height as f64 - 0.5).floor() as i64;
            let ratios = [row - 1, row, row + 1, row + 2].map(|row| (v * PI).sin() / sine(row));
            // At a texel's centre rounding may lead to the rows beside. A texel of 0.1 in the row of the sun has 2000 counts,
            // and two of them may be missing.
            let (low, high) = ratios.iter().fold((f64::INFINITY, 0.0_f64), |(l, h), r| (l.min(*r), h.max(*r)));
            let weight = s.radiance.y / s.pdf / mean;
            assert!((0.998 * low..1.002 * high).contains(&weight), "{weight}, not {low} to {high}");
        }
    }
}

fn row_sum(image: &Image, row: usize) -> f64 {
    image.texels[row * image.width..][..image.width].iter().map(|t| f64::from(t[1])).sum()
}

/// Every bright texel has its first and last number, and both lead under its tent, to its very foot and its centre.
#[test]
fn every_bright_texel_can_be_picked() {
    for image in images() {
        let prepared = image.prepared();
        let marginal = prepared.marginal();
        let mut bits = Vec::new();
        let mut texels = Vec::new();
        for (y, x) in (0..image.height).flat_map(|y| (0..image.width).map(move |x| (y, x))) {
            let bright = image.texel(x as i64, y as i64).max_element() > 0.0;
            assert_eq!(prepared.texel_probability(x, y) > 0.0, bright, "texel {x}, {y}");
            if bright {
                let conditional = prepared.conditional(y);
                bits.push([2 * marginal[y], 2 * conditional[x], 0, 0]);
                // Twice the total is 2^32.
                let last = |end: u32| end.wrapping_mul(2).wrapping_sub(1);
                bits.push([last(marginal[y + 1]), last(conditional[x + 1]), u32::MAX, u32::MAX]);
                let middle = |cdf: &[u32], bin: usize| 2 * (cdf[bin] + (cdf[bin + 1] - cdf[bin]) / 2);
                bits.push([middle(marginal, y), middle(conditional, x), 1 << 31, 1 << 31]);
                texels.extend([(x, y); 3]);
            }
        }
        for (s, (x, y)) in sample_with(&kernel(&image), &bits).iter().zip(texels) {
            let (u, v) = image.uv(s.direction);
            let (du, dv) = (u * image.width as f64 - x as f64, v * image.height as f64 - y as f64);
            // Under the tent, up to the rounding of the direction; u may wrap around at its zero.
            let inside = |d: f64, n: usize| [d, d + n as f64, d - n as f64].iter().any(|d| *d > -0.5001 && *d < 1.5001);
            let weight = s.radiance / s.pdf;
            assert!(
                inside(du, image.width) && inside(dv, 2 * image.height) && s.pdf > 0.0 && weight.is_finite(),
                "{x}, {y}: {du}, {dv}, {}",
                s.pdf
            );
        }
    }
}
