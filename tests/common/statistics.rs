//! Statistics for tests: tail probabilities, goodness of fit, and the comparison of images by mean and variance.
//!
//! A test here answers with a p-value or a [`Comparison`]; the caller chooses the significance level α. Where many
//! tests are made at once, Šidák's correction keeps the level of the whole at α: see [`sidak`].
//!
//! The special functions follow Press et al., *Numerical Recipes*, 3rd edition, §6.1 (ln Γ), §6.2 (incomplete gamma)
//! and §6.4 (incomplete beta); `tests/statistics.rs` holds them against values of SciPy.

use std::f64::consts::{PI, SQRT_2};
use std::fmt;

pub use sunfleck::bench::statistics::sidak;
pub use sunfleck::shader_test::chi_square::{ChiSquare, chi_square_test};

/// Rounding of radiance that is summed and stored in 32-bit floats, relative to the value. Keeps two constant tiles (a
/// lamp that fills the tile) equal although their variance is zero.
const ROUNDING: f64 = 1e-6;

/// Σ over pixels and images of the squared distance of red from its mean over the images.
pub fn squared_deviations(images: &[Vec<[f32; 3]>]) -> f64 {
    let pixel = |p: usize| {
        let values: Vec<f64> = images.iter().map(|image| f64::from(image[p][0])).collect();
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        values.iter().map(|value| (value - mean).powi(2)).sum::<f64>()
    };
    (0..images[0].len()).map(pixel).sum()
}

/// ln Γ(x) for x > 0, by Lanczos' approximation (g = 7, 9 terms); relative error about 1e-15.
pub fn ln_gamma(x: f64) -> f64 {
    const COEFFICIENTS: [f64; 9] = [
        0.999_999_999_999_809_9,
        676.520_368_121_885_1,
        -1_259.139_216_722_402_8,
        771.323_428_777_653_1,
        -176.615_029_162_140_6,
        12.507_343_278_686_905,
        -0.138_571_095_265_720_12,
        9.984_369_578_019_572e-6,
        1.505_632_735_149_311_6e-7,
    ];
    assert!(x > 0.0, "ln_gamma({x})");
    let x = x - 1.0;
    let t = x + 7.5;
    let terms = COEFFICIENTS[1..].iter().enumerate().map(|(i, c)| c / (x + (i + 1) as f64));
    let sum = COEFFICIENTS[0] + terms.sum::<f64>();
    0.5 * (2.0 * PI).ln() + (x + 0.5) * t.ln() - t + sum.ln()
}

/// The regularised upper incomplete gamma function Q(a, x), for a > 0 and x ≥ 0.
pub fn gamma_upper(a: f64, x: f64) -> f64 {
    assert!(a > 0.0 && x >= 0.0, "gamma_upper({a}, {x})");
    if x == 0.0 {
        return 1.0;
    }
    let front = (a * x.ln() - x - ln_gamma(a)).exp();
    if x < a + 1.0 {
        let (mut term, mut sum, mut n) = (1.0 / a, 1.0 / a, a);
        while term > sum * f64::EPSILON {
            n += 1.0;
            term *= x / n;
            sum += term;
        }
        1.0 - front * sum
    } else {
        front * continued_fraction(x + 1.0 - a, |i| (i * (a - i), x + 2.0 * i + 1.0 - a))
    }
}

/// 1/(b₀ + a₁/(b₁ + a₂/(b₂ + …))) by Lentz' method, where `terms(i)` is (aᵢ, bᵢ).
fn continued_fraction(b0: f64, terms: impl Fn(f64) -> (f64, f64)) -> f64 {
    let away_from_zero = |x: f64| if x.abs() < 1e-300 { 1e-300 } else { x };
    let mut c = 1e300;
    let mut d = 1.0 / away_from_zero(b0);
    let mut value = d;
    for i in 1..10_000 {
        let (a, b) = terms(f64::from(i));
        d = 1.0 / away_from_zero(a * d + b);
        c = away_from_zero(b + a / c);
        let factor = c * d;
        value *= factor;
        if (factor - 1.0).abs() < 1e-15 {
            break;
        }
    }
    value
}

/// The regularised incomplete beta function I_x(a, b), for a, b > 0 and x in [0, 1].
pub fn beta_regularised(x: f64, a: f64, b: f64) -> f64 {
    assert!(a > 0.0 && b > 0.0 && (0.0..=1.0).contains(&x), "beta_regularised({x}, {a}, {b})");
    if x == 0.0 || x == 1.0 {
        return x;
    }
    if x > (a + 1.0) / (a + b + 2.0) {
        return 1.0 - beta_regularised(1.0 - x, b, a);
    }
    let front = (ln_gamma(a + b) - ln_gamma(a) - ln_gamma(b) + a * x.ln() + b * (-x).ln_1p()).exp();
    let fraction = continued_fraction(1.0, |i| {
        let m = (i / 2.0).floor();
        let numerator = if i % 2.0 == 0.0 {
            m * (b - m) * x / ((a + 2.0 * m - 1.0) * (a + 2.0 * m))
        } else {
            -(a + m) * (a + b + m) * x / ((a + 2.0 * m) * (a + 2.0 * m + 1.0))
        };
        (numerator, 1.0)
    });
    front * fraction / a
}

/// P(Z ≥ z) of the standard normal distribution, accurate in the far tail.
pub fn normal_upper_tail(z: f64) -> f64 {
    let tail = 0.5 * gamma_upper(0.5, 0.5 * z * z);
    if z >= 0.0 { tail } else { 1.0 - tail }
}

/// P(Z ≤ z) of the standard normal distribution.
pub fn normal_cdf(z: f64) -> f64 {
    normal_upper_tail(-z)
}

/// The z at which [`normal_cdf`] is `p`, for p in (0, 1): Newton's steps from Winitzki's erf⁻¹.
pub fn normal_quantile(p: f64) -> f64 {
    assert!(p > 0.0 && p < 1.0, "normal_quantile({p})");
    if p > 0.5 {
        return -normal_quantile(1.0 - p);
    }
    // Winitzki 2008, "A handy approximation for the error function and its inverse", with a = 0.147.
    const A: f64 = 0.147;
    let log = (4.0 * p * (1.0 - p)).ln();
    let half = 2.0 / (PI * A) + 0.5 * log;
    let mut z = -SQRT_2 * ((half * half - log / A).sqrt() - half).sqrt();
    for _ in 0..8 {
        // In the logarithm, so that the step does not overshoot in the tail.
        let cdf = normal_cdf(z);
        let density = (-0.5 * z * z).exp() / (2.0 * PI).sqrt();
        z -= (cdf / p).ln() * cdf / density;
    }
    z
}

/// The two-sided p-value of a Student t statistic; infinite degrees of freedom are the normal distribution.
pub fn student_two_sided(t: f64, degrees_of_freedom: f64) -> f64 {
    if degrees_of_freedom > 1e7 {
        return 2.0 * normal_upper_tail(t.abs());
    }
    beta_regularised(degrees_of_freedom / (degrees_of_freedom + t * t), 0.5 * degrees_of_freedom, 0.5)
}

/// P(X ≥ statistic) of the χ² distribution.
pub fn chi_square_upper_tail(statistic: f64, degrees_of_freedom: f64) -> f64 {
    gamma_upper(0.5 * degrees_of_freedom, 0.5 * statistic)
}

/// The two-sided p-value of `successes` in `trials` of the given probability: twice the smaller exact tail.
pub fn binomial_two_sided(successes: u64, trials: u64, probability: f64) -> f64 {
    assert!(successes <= trials && (0.0..=1.0).contains(&probability), "{successes} of {trials} at {probability}");
    let (k, n) = (successes as f64, trials as f64);
    // P(X ≤ k) = I_{1−p}(n − k, k + 1).
    let at_most = if successes == trials { 1.0 } else { beta_regularised(1.0 - probability, n - k, k + 1.0) };
    let at_least = binomial_at_least(successes, trials, probability);
    (2.0 * at_most.min(at_least)).min(1.0)
}

/// P(X ≥ successes) of `trials` of the given probability: I_p(k, n − k + 1).
pub fn binomial_at_least(successes: u64, trials: u64, probability: f64) -> f64 {
    match successes {
        0 => 1.0,
        k if k > trials => 0.0,
        k => beta_regularised(probability, k as f64, (trials - k + 1) as f64),
    }
}

/// A mean estimated from independent repetitions (seeds).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// The mean of the repetitions.
    pub mean: f64,
    /// The variance of this mean: the sample variance of the repetitions divided by their number.
    pub variance: f64,
    /// The number of repetitions, at least 2; infinite for a number that is known exactly.
    pub count: f64,
}

impl Estimate {
    /// A number that is known, such as the analytic radiance of a furnace.
    pub fn exact(mean: f64) -> Self {
        Self { mean, variance: 0.0, count: f64::INFINITY }
    }

    /// The estimate from the values of at least two repetitions.
    pub fn from_values(values: &[f64]) -> Self {
        let mut accumulator = Accumulator::default();
        values.iter().for_each(|value| accumulator.add(*value));
        accumulator.estimate()
    }

    /// The mean over independent estimates, such as the tiles of an image whose pixels share no random number.
    pub fn mean_of_independent(estimates: impl IntoIterator<Item = Self>) -> Self {
        let all: Vec<Self> = estimates.into_iter().collect();
        let n = all.len() as f64;
        Self {
            mean: all.iter().map(|e| e.mean).sum::<f64>() / n,
            variance: all.iter().map(|e| e.variance).sum::<f64>() / (n * n),
            // Fewer degrees of freedom than the sum really has: a larger p-value, on the safe side.
            count: all.iter().map(|e| e.count).fold(f64::INFINITY, f64::min),
        }
    }

    /// The standard error of the mean.
    pub fn standard_error(&self) -> f64 {
        self.variance.sqrt()
    }

    /// The standard error as a part of the mean.
    pub fn relative_error(&self) -> f64 {
        self.standard_error() / self.mean.abs()
    }

    /// The difference to `other` in combined standard errors; zero for two equal numbers without variance.
    pub fn deviation(&self, other: &Self) -> f64 {
        let difference = (self.mean - other.mean).abs();
        let rounding = ROUNDING * self.mean.abs().max(other.mean.abs());
        let error = (self.variance + other.variance + rounding * rounding).sqrt();
        if difference == 0.0 { 0.0 } else { difference / error }
    }

    /// The two-sided p-value of Welch's t-test that both have the same expectation (Welch 1947).
    pub fn welch(&self, other: &Self) -> f64 {
        let part = |e: &Self| if e.variance == 0.0 { 0.0 } else { e.variance * e.variance / (e.count - 1.0) };
        let parts = part(self) + part(other);
        let degrees_of_freedom =
            if parts == 0.0 { f64::INFINITY } else { (self.variance + other.variance).powi(2) / parts };
        let deviation = self.deviation(other);
        if deviation.is_finite() { student_two_sided(deviation, degrees_of_freedom) } else { 0.0 }
    }
}

/// Prints two estimates of each channel of an image, and fails where they are four standard errors apart.
pub fn assert_agree(what: &str, a: [Estimate; 3], b: [Estimate; 3]) {
    for (channel, (a, b)) in a.iter().zip(&b).enumerate() {
        println!(
            "{what}, channel {channel}: {:.5} ± {:.1e}, {:.5} ± {:.1e}",
            a.mean,
            a.standard_error(),
            b.mean,
            b.standard_error()
        );
        assert!(
            a.deviation(b) < 4.0,
            "{what}, channel {channel}: {} standard errors apart: {a:?} {b:?}",
            a.deviation(b)
        );
    }
}

/// The mean and the variance of numbers that come one after another (Welford 1962).
#[derive(Clone, Copy, Debug, Default)]
pub struct Accumulator {
    count: f64,
    mean: f64,
    squares: f64,
}

impl Accumulator {
    /// Takes in one number.
    pub fn add(&mut self, value: f64) {
        self.count += 1.0;
        let delta = value - self.mean;
        self.mean += delta / self.count;
        self.squares += delta * (value - self.mean);
    }

    /// The estimate from at least two numbers.
    pub fn estimate(&self) -> Estimate {
        assert!(self.count >= 2.0, "a variance needs two values, there are {}", self.count);
        Estimate { mean: self.mean, variance: self.squares / (self.count - 1.0) / self.count, count: self.count }
    }
}

/// Means of square tiles of an image over independent seeds.
///
/// A tile's mean over its pixels is nearly normal where a single pixel is not, and a fault of a few pixels still shows.
#[derive(Clone, Debug)]
pub struct TileStatistics {
    width: usize,
    tile: usize,
    columns: usize,
    tiles: Vec<Accumulator>,
    image: [Accumulator; 3],
}

impl TileStatistics {
    /// For images of `width` × `height` pixels; tiles of `tile` × `tile`, smaller ones at the right and lower edge.
    pub fn new(width: usize, height: usize, tile: usize) -> Self {
        let columns = width.div_ceil(tile);
        let tiles = vec![Accumulator::default(); 3 * columns * height.div_ceil(tile)];
        Self { width, tile, columns, tiles, image: Default::default() }
    }

    /// Takes in the image of one seed: linear RGB, row by row from the top.
    pub fn add(&mut self, pixels: &[[f32; 3]]) {
        let mut sums = vec![(0.0, 0.0); self.tiles.len()];
        let mut image = [0.0; 3];
        for (index, pixel) in pixels.iter().enumerate() {
            let (x, y) = (index % self.width, index / self.width);
            let tile = 3 * (y / self.tile * self.columns + x / self.tile);
            for channel in 0..3 {
                let value = f64::from(pixel[channel]);
                sums[tile + channel].0 += value;
                sums[tile + channel].1 += 1.0;
                image[channel] += value;
            }
        }
        for (accumulator, (sum, count)) in self.tiles.iter_mut().zip(sums) {
            accumulator.add(sum / count);
        }
        for (accumulator, sum) in self.image.iter_mut().zip(image) {
            accumulator.add(sum / pixels.len() as f64);
        }
    }

    /// Three estimates (R, G, B) a tile, row by row from the top: the order of [`super::reference::Reference`].
    pub fn tiles(&self) -> Vec<Estimate> {
        self.tiles.iter().map(Accumulator::estimate).collect()
    }

    /// The means of the whole image, their variance taken between seeds.
    pub fn image(&self) -> [Estimate; 3] {
        self.image.map(|channel| channel.estimate())
    }
}

/// The comparison of two lists of estimates, test by test, with Šidák's correction.
#[derive(Clone, Copy, Debug)]
pub struct Comparison {
    /// How many pairs were compared.
    pub tests: usize,
    /// The index of the pair with the smallest p-value.
    pub worst: usize,
    /// That pair.
    pub pair: (Estimate, Estimate),
    /// Its p-value, of a single test.
    pub p_value: f64,
    /// Below this p-value a single test fails: [`sidak`] of the level of the whole.
    pub threshold: f64,
    /// How many pairs failed.
    pub failures: usize,
}

impl Comparison {
    /// Welch's t-test of every pair; all together have the level `alpha`.
    pub fn new(a: &[Estimate], b: &[Estimate], alpha: f64) -> Self {
        assert_eq!(a.len(), b.len(), "as many estimates on both sides");
        assert!(!a.is_empty(), "nothing to compare");
        let threshold = sidak(alpha, a.len());
        let p_values: Vec<f64> = a.iter().zip(b).map(|(a, b)| a.welch(b)).collect();
        let worst = (0..a.len()).min_by(|i, j| p_values[*i].total_cmp(&p_values[*j])).unwrap_or(0);
        Self {
            tests: a.len(),
            worst,
            pair: (a[worst], b[worst]),
            p_value: p_values[worst],
            threshold,
            failures: p_values.iter().filter(|p| **p < threshold).count(),
        }
    }

    /// True if no pair differs significantly.
    pub fn passed(&self) -> bool {
        self.failures == 0
    }
}

impl fmt::Display for Comparison {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (a, b) = self.pair;
        write!(
            f,
            "{} of {} tests fail (p < {:.2e}); the worst, number {}, has p = {:.2e}: {:.6e} ± {:.1e} against {:.6e} ± {:.1e}",
            self.failures,
            self.tests,
            self.threshold,
            self.worst,
            self.p_value,
            a.mean,
            a.standard_error(),
            b.mean,
            b.standard_error()
        )
    }
}
