//! The environment's CDFs: normalised, no positive lookup without a positive density, which follows the interpolated image.

use std::f64::consts::{PI, TAU};
use std::sync::Arc;

use crate::common::random::Random;
use glam::DVec3;
use sunfleck::layout::CDF_TOTAL;
use sunfleck::prepare::EnvironmentSampling::{self, Compensated, Importance, Uniform};
use sunfleck::prepare::environment::{EnvironmentKind, PreparedEnvironment, direction_to_uv, prepare, tent_sine};
use sunfleck::scene::Environment;

fn image(width: u32, height: u32, rotation_radians: f64, texel: impl Fn(u32, u32) -> [f32; 3]) -> Environment {
    let texels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).map(|(x, y)| texel(x, y)).collect();
    Environment::Image { name: "test".into(), width, height, texels: Arc::new(texels), strength: 2.0, rotation_radians }
}

fn luminance([r, g, b]: [f32; 3]) -> f64 {
    0.2126 * f64::from(r) + 0.7152 * f64::from(g) + 0.0722 * f64::from(b)
}

/// The lookup of the shader: bilinear, u wraps, v clamps, texel centres at (i + ½)/n.
fn lookup(environment: &PreparedEnvironment, u: f64, v: f64) -> f64 {
    let (width, height) = (environment.width as i64, environment.height as i64);
    let (x, y) = (u * width as f64 - 0.5, v * height as f64 - 0.5);
    let (x0, y0) = (x.floor(), y.floor());
    let (fx, fy) = (x - x0, y - y0);
    let texel = |x: i64, y: i64| {
        let (x, y) = (x.rem_euclid(width), y.clamp(0, height - 1));
        if environment.rgbe {
            // The first word of the quad below and right of it.
            let word = environment.array[((y + 1) * width + x) as usize][0];
            let scale = f64::from((word >> 24) as i32 - 136).exp2();
            return luminance([0, 8, 16].map(|shift| (f64::from(word >> shift & 255) * scale) as f32));
        }
        let texel = environment.array[(y * width + x) as usize];
        luminance([texel[0], texel[1], texel[2]].map(f32::from_bits))
    };
    let (x0, y0) = (x0 as i64, y0 as i64);
    let row = |y: i64| texel(x0, y) * (1.0 - fx) + texel(x0 + 1, y) * fx;
    row(y0) * (1.0 - fy) + row(y0 + 1) * fy
}

fn direction(u: f64, v: f64) -> DVec3 {
    let (sin_theta, cos_theta) = (v * PI).sin_cos();
    let (sin_phi, cos_phi) = (u * TAU).sin_cos();
    DVec3::new(sin_theta * cos_phi, cos_theta, sin_theta * sin_phi)
}

/// ∫ f dω over the sphere by midpoints, with `per_texel`² points a texel.
fn integrate(environment: &PreparedEnvironment, per_texel: u32, f: impl Fn(DVec3, f64, f64) -> f64) -> f64 {
    let (columns, rows) = (environment.width * per_texel, environment.height * per_texel);
    let mut sum = 0.0;
    for j in 0..rows {
        let v = (f64::from(j) + 0.5) / f64::from(rows);
        for i in 0..columns {
            let u = (f64::from(i) + 0.5) / f64::from(columns);
            sum += f(direction(u, v), u, v) * (v * PI).sin();
        }
    }
    sum * 2.0 * PI * PI / (f64::from(columns) * f64::from(rows))
}

fn check(environment: &Environment) -> PreparedEnvironment {
    check_sampling(environment, Compensated);
    check_sampling(environment, Importance)
}

fn check_sampling(environment: &Environment, sampling: EnvironmentSampling) -> PreparedEnvironment {
    let prepared = prepare(environment, sampling).unwrap();
    assert_eq!(prepared.kind, EnvironmentKind::Image);
    let (width, height) = (prepared.width as usize, prepared.height as usize);
    let marginal = prepared.marginal();
    assert_eq!((marginal[0], marginal[height]), (0, CDF_TOTAL));
    for y in 0..height {
        let row = prepared.conditional(y);
        let picked = marginal[y + 1] > marginal[y];
        assert_eq!((row[0], row[width]), (0, if picked { CDF_TOTAL } else { 0 }));
        assert!(row.is_sorted());
    }
    // The density integrates to 1: sin θ cancels and what is left is bilinear between centres, so that the midpoint rule is
    // exact in quarters of a texel.
    let total = integrate(&prepared, 2, |direction, _, _| prepared.pdf_solid_angle(direction));
    assert!((total - 1.0).abs() < 1e-9, "{total}");
    // No direction that is bright is impossible.
    let mut random = Random(9);
    for _ in 0..20_000 {
        let (u, v) = (random.unit(), random.unit());
        let at = direction(u, v);
        assert!(lookup(&prepared, u, v) == 0.0 || prepared.pdf_solid_angle(at) > 0.0, "({u}, {v})");
    }
    prepared
}

#[test]
fn random_images_of_all_shapes() {
    let mut random = Random(1);
    for (width, height) in [(1, 1), (1, 7), (9, 1), (2, 2), (16, 8), (33, 17)] {
        let values: Vec<f32> = (0..width * height).map(|_| random.unit().powi(4) as f32).collect();
        check(&image(width, height, 0.0, |x, y| [values[(y * width + x) as usize], 0.5, 0.0]));
        check(&image(width, height, 0.0, |x, y| [values[(y * width + x) as usize]; 3]));
    }
}

#[test]
fn mean_luminance_is_the_integral() {
    let environment = image(16, 8, 0.0, |x, y| [(x * 3 + y * y) as f32; 3]);
    let prepared = check(&environment);
    let flux = 2.0 * integrate(&prepared, 32, |_, u, v| lookup(&prepared, u, v));
    // What is left is the error of midpoints for sin θ, (π/(8·32))²/24.
    assert!((flux / (4.0 * PI) / prepared.mean_luminance - 1.0).abs() < 1e-5);
}

#[test]
fn a_dim_texel_beside_a_blinding_one_is_not_lost() {
    let prepared = check(&image(32, 16, 0.0, |x, y| match (x, y) {
        (5, 6) => [1e9; 3],
        (20, 10) => [1e-9; 3],
        _ => [0.0; 3],
    }));
    assert!(prepared.texel_probability(20, 10) > 0.0);
    assert_eq!(prepared.texel_probability(19, 10), 0.0, "black texels are never picked");
    let pdf = |x: f64, y: f64| prepared.pdf_solid_angle(direction(x / 32.0, y / 16.0));
    assert!(pdf(19.6, 9.6) > 0.0 && pdf(21.4, 11.4) > 0.0, "bilinear lookups there are positive");
    assert_eq!((pdf(19.4, 10.5), pdf(20.5, 14.5)), (0.0, 0.0));
}

#[test]
fn the_edge_column_leaks_around_u() {
    let prepared = check(&image(8, 4, 0.0, |x, y| if (x, y) == (0, 0) { [1.0; 3] } else { [0.0; 3] }));
    assert!(prepared.pdf_solid_angle(direction(7.8 / 8.0, 0.1)) > 0.0, "u wraps");
    assert_eq!(prepared.pdf_solid_angle(direction(0.01, 0.9)), 0.0, "v does not");
}

#[test]
fn density_follows_brightness() {
    let prepared = check(&image(64, 32, 0.0, |x, _| if x < 32 { [3.0; 3] } else { [1.0; 3] }));
    let [bright, dim] = [0.25, 0.75].map(|u| prepared.pdf_solid_angle(direction(u, 0.4)));
    assert!((bright / dim - 3.0).abs() < 1e-6);
}

/// max(Y − mean, Y/16), whatever the strength; and a white image is sampled like any other.
#[test]
fn compensation_takes_the_mean_away() {
    let sky = image(64, 32, 0.0, |x, y| match (x, y) {
        (7, 9) => [3000.0; 3],
        _ if y < 16 => [2.0; 3],
        _ => [0.5; 3],
    });
    let prepared = check_sampling(&sky, Compensated);
    let mean = prepared.mean_luminance / 2.0;
    assert!(mean > 2.0, "{mean}");
    let per_light = |x: usize, y: usize, weight: f64| prepared.texel_probability(x, y) / (weight * tent_sine(y, 32));
    let sun = per_light(7, 9, 3000.0 - mean);
    for (x, y, light) in [(7, 8, 2.0), (40, 3, 2.0), (30, 20, 0.5)] {
        assert!((per_light(x, y, light / 16.0) / sun - 1.0).abs() < 1e-4, "({x}, {y})");
    }
    assert!(prepared.texel_probability(7, 9) > 0.9 && check_sampling(&sky, Importance).texel_probability(7, 9) < 0.7);
    let white = |sampling| check_sampling(&image(8, 4, 0.0, |_, _| [1.0; 3]), sampling).texel_probability(3, 1);
    assert!((white(Compensated) / white(Importance) - 1.0).abs() < 1e-6);
}

#[test]
fn rotation_is_counter_clockwise_from_above() {
    // The image's +X (u = 0) comes to stand at −Z when the environment turns by 90° counter-clockwise seen from above.
    let (u, v) = direction_to_uv(DVec3::NEG_Z, PI / 2.0);
    assert!((u.min(1.0 - u)).abs() < 1e-12 && (v - 0.5).abs() < 1e-12, "{u} {v}");
    assert_eq!(direction_to_uv(DVec3::Z, 0.0).0, 0.25);
    let turned = check(&image(8, 4, 0.0, |x, _| [x as f32; 3]));
    let mut random = Random(4);
    for _ in 0..100 {
        let at = random.direction();
        let (u, v) = direction_to_uv(at, 0.0);
        assert!((direction(u, v) - at).length() < 1e-12);
        assert!(turned.pdf_solid_angle(at).is_finite());
    }
}

#[test]
fn black_images_are_no_environment_and_constants_need_no_tables() {
    let black = prepare(&image(4, 2, 0.0, |_, _| [0.0; 3]), Importance).unwrap();
    assert_eq!((black.kind, black.array.len()), (EnvironmentKind::None, 0));
    let white = prepare(&Environment::Constant([1.0; 3]), Importance).unwrap();
    assert_eq!((white.kind, white.array.len()), (EnvironmentKind::Constant, 0));
    assert!((white.pdf_solid_angle(DVec3::Y) - 0.25 / PI).abs() < 1e-15);
    let uniform = prepare(&image(4, 2, 0.0, |_, _| [0.1; 3]), Uniform).unwrap();
    assert_eq!((uniform.array.len(), uniform.conditional_word, uniform.rgbe), (8, 0, false));
    let quads = prepare(&image(4, 2, 0.0, |_, _| [1.0; 3]), Uniform).unwrap();
    assert_eq!((quads.array.len(), quads.conditional_word, quads.rgbe), (12, 0, true));
}

/// ∫ tent·sin θ of a row with the shader's clamping, by midpoints.
fn tent_sine_by_midpoints(row: usize, height: usize) -> f64 {
    const STEPS: usize = 1 << 16;
    let angle = |x: f64| (row as f64 + 0.5 + x) * PI / height as f64;
    let at = |i: usize| (2.0 * i as f64 + 1.0) / STEPS as f64 - 1.0;
    // Beyond a pole the sine is negative: it is the mirrored point that is there.
    (0..STEPS).map(|i| (1.0 - at(i).abs()) * angle(at(i)).sin().abs()).sum::<f64>() * 2.0 / STEPS as f64
}

#[test]
fn tents_hold_their_share_of_the_sphere() {
    for height in [1, 2, 3, 16, 4096] {
        for row in [0, 1, height / 2, height - 1].into_iter().filter(|row| *row < height) {
            let (closed, summed) = (tent_sine(row, height), tent_sine_by_midpoints(row, height));
            assert!((closed / summed - 1.0).abs() < 1e-6, "{row} of {height}: {closed} and {summed}");
        }
        // A white image: the whole sphere, 4π.
        let total: f64 = (0..height).map(|row| tent_sine(row, height)).sum();
        assert!((total * 2.0 * PI * PI / height as f64 / (4.0 * PI) - 1.0).abs() < 1e-9, "{height}: {total}");
    }
}

/// Mean square of luminance/pdf over its squared mean, less 1, of what is drawn by the density: by midpoints in (u, v).
fn relative_variance(environment: &PreparedEnvironment) -> f64 {
    let square = |direction, u, v| {
        let light = lookup(environment, u, v);
        if light > 0.0 { light * light / environment.pdf_solid_angle(direction) } else { 0.0 }
    };
    let mean = integrate(environment, 16, |_, u, v| lookup(environment, u, v));
    integrate(environment, 16, square) / (mean * mean) - 1.0
}

/// With A the interpolated luminance and s the interpolated product of luminance and [`tent_sine`], luminance/pdf is
/// proportional to A·sin θ/s, and s/A a mean of the sines of the two rows around θ. So it is off its mean by at most
/// b = max |sin θ/sine − 1| over both, relatively, and its variance at most ∫ b² over the density. The pole's rows, where
/// sin θ goes to 0, are most of that.
fn variance_bound(environment: &PreparedEnvironment) -> f64 {
    let height = environment.height as usize;
    integrate(environment, 16, |direction, _, v| {
        let y = v * height as f64 - 0.5;
        let off = |row: f64| (v * PI).sin() / tent_sine((row.max(0.0) as usize).min(height - 1), height) - 1.0;
        let b = off(y.floor()).abs().max(off(y.floor() + 1.0).abs());
        environment.pdf_solid_angle(direction) * b * b
    })
}

/// Nothing of the image is left in luminance/pdf, whatever its contrast: only what sin θ changes within a row.
#[test]
fn the_density_follows_the_interpolated_image() {
    let mut random = Random(3);
    let noise: Vec<f32> = (0..64 * 32).map(|_| random.unit().powi(4) as f32).collect();
    let sun = |x: u32, y: u32| if (x, y) == (11, 9) { 1e5 } else { noise[(y * 64 + x) as usize] };
    let at = |x: u32, y: u32| noise[(y * 64 + x) as usize];
    for (name, environment) in [
        ("noise", image(64, 32, 0.0, |x, y| [at(x, y); 3])),
        ("sun", image(64, 32, 0.0, |x, y| [sun(x, y); 3])),
        ("smooth", image(64, 32, 0.0, |x, y| [2.0 + (x as f32 * 0.1).sin() + (y as f32 * 0.2).cos(); 3])),
    ] {
        let prepared = prepare(&environment, Importance).unwrap();
        let (variance, bound) = (relative_variance(&prepared), variance_bound(&prepared));
        println!("{name}: relative variance {variance:.3e}, bound {bound:.3e}");
        assert!(variance <= bound, "{name}: {variance} above {bound}");
        assert!(bound < 0.05, "{name}: the bound says something: {bound}");
    }
}
