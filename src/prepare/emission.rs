//! How bright an emission texture is over a triangle, for the power by which its light is picked.

use super::luminance;
use super::textures::srgb_to_linear;
use crate::scene::{Image, Scene, Texels, Texture, TextureBinding, TextureTransform, Wrap};

/// Share of the mean over the triangle's texture box in the estimate; the rest is the mean over points. The box misses no
/// bright texel, so a triangle that emits at all has a positive estimate.
const BOX_SHARE: f64 = 0.25;
const MOST_POINTS: f64 = 256.0;
const LEAST_POINTS: f64 = 16.0;

/// Luminance of `emission ⊙ texture`, with sums over texel boxes in constant time (Crow, "Summed-area tables for texture
/// mapping", SIGGRAPH 1984).
#[derive(Debug)]
pub(super) struct EmissionMap {
    width: usize,
    height: usize,
    texture: Texture,
    /// The set of texture coordinates that is looked up.
    pub(super) set: usize,
    transform: TextureTransform,
    luminance: Vec<f32>,
    /// Row-major, one row and one column more than the image: sums of luminance above and to the left.
    sums: Vec<f64>,
    /// The same for the number of texels that are not black; exact, unlike differences of `sums`.
    counts: Vec<u32>,
}

impl EmissionMap {
    /// The map of a texture times a factor.
    pub(super) fn new(scene: &Scene, binding: TextureBinding, emission: [f32; 3]) -> Self {
        let texture = scene.textures[binding.texture];
        let image = &scene.images[texture.image];
        let luminance = texel_luminance(image, emission);
        let (width, height) = (image.width as usize, image.height as usize);
        let stride = width + 1;
        let mut sums = vec![0.0; stride * (height + 1)];
        let mut counts = vec![0; stride * (height + 1)];
        for y in 0..height {
            let (mut row_sum, mut row_count) = (0.0, 0);
            for x in 0..width {
                let value = luminance[y * width + x];
                row_sum += f64::from(value);
                row_count += u32::from(value > 0.0);
                sums[(y + 1) * stride + x + 1] = sums[y * stride + x + 1] + row_sum;
                counts[(y + 1) * stride + x + 1] = counts[y * stride + x + 1] + row_count;
            }
        }
        Self { width, height, texture, set: binding.set, transform: binding.transform, luminance, sums, counts }
    }

    /// Whether every texel is black.
    pub(super) fn is_black(&self) -> bool {
        self.counts.last() == Some(&0)
    }

    /// An estimate of the mean luminance over a triangle with these texture coordinates of its set: zero only if no lookup
    /// on it can be positive.
    pub(super) fn mean(&self, texcoords: [[f32; 2]; 3]) -> f64 {
        let texcoords = texcoords.map(|uv| self.transform.apply(uv.map(f64::from)));
        let (box_mean, any) = self.box_mean(texcoords);
        if any { BOX_SHARE * box_mean + (1.0 - BOX_SHARE) * self.point_mean(texcoords) } else { 0.0 }
    }

    /// Mean over the texels that lookups in the triangle's box of texture coordinates can touch, and whether any of them
    /// is not black. One more texel on each side allows for the rounding of interpolated coordinates.
    fn box_mean(&self, texcoords: [[f64; 2]; 3]) -> (f64, bool) {
        let columns = touched(texcoords.map(|t| t[0]), self.width, self.texture.wrap_u);
        let rows = touched(texcoords.map(|t| t[1]), self.height, self.texture.wrap_v);
        let (mut sum, mut area, mut count) = (0.0, 0.0, 0u32);
        for &(x0, x1) in columns.iter().filter(|r| r.0 < r.1) {
            for &(y0, y1) in rows.iter().filter(|r| r.0 < r.1) {
                let corner = |x: usize, y: usize| y * (self.width + 1) + x;
                let [a, b, c, d] = [corner(x1, y1), corner(x0, y0), corner(x0, y1), corner(x1, y0)];
                sum += (self.sums[a] + self.sums[b] - self.sums[c] - self.sums[d]).max(0.0);
                count += self.counts[a] + self.counts[b] - self.counts[c] - self.counts[d];
                area += ((x1 - x0) * (y1 - y0)) as f64;
            }
        }
        // Where the difference of sums rounds to zero, a bright texel still is no less than the least positive float.
        ((sum / area).max(f64::from(f32::MIN_POSITIVE)), count > 0)
    }

    /// Mean over a fixed pattern of points, about one a texel.
    fn point_mean(&self, [a, b, c]: [[f64; 2]; 3]) -> f64 {
        let area = 0.5 * ((b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1])).abs();
        let points = (area * (self.width * self.height) as f64).clamp(LEAST_POINTS, MOST_POINTS) as usize;
        let mut sum = 0.0;
        for index in 0..points {
            let (u, v) = triangle_point(index);
            let at = |k: usize| a[k] + u * (b[k] - a[k]) + v * (c[k] - a[k]);
            sum += self.nearest(at(0), at(1));
        }
        sum / points as f64
    }

    fn nearest(&self, u: f64, v: f64) -> f64 {
        let x = wrap_texel((u * self.width as f64).floor(), self.width, self.texture.wrap_u);
        let y = wrap_texel((v * self.height as f64).floor(), self.height, self.texture.wrap_v);
        f64::from(self.luminance[y * self.width + x])
    }
}

/// Point `index` of the R₂ sequence (Roberts 2018: multiples of the inverse plastic number and its square), folded into
/// the triangle u, v ≥ 0, u + v ≤ 1.
fn triangle_point(index: usize) -> (f64, f64) {
    const PLASTIC: f64 = 1.324_717_957_244_746;
    let n = index as f64 + 0.5;
    let (u, v) = ((n / PLASTIC).fract(), (n / (PLASTIC * PLASTIC)).fract());
    if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) }
}

fn wrap_texel(index: f64, size: usize, wrap: Wrap) -> usize {
    let size_f = size as f64;
    let wrapped = match wrap {
        Wrap::Repeat => index.rem_euclid(size_f),
        Wrap::MirroredRepeat => {
            let index = index.rem_euclid(2.0 * size_f);
            if index < size_f { index } else { 2.0 * size_f - 1.0 - index }
        }
        Wrap::ClampToEdge => index,
    };
    (wrapped.max(0.0) as usize).min(size - 1)
}

/// Up to two half-open ranges of texels along one axis that lookups between the least and the largest coordinate touch.
fn touched(coordinates: [f64; 3], size: usize, wrap: Wrap) -> [(usize, usize); 2] {
    let scaled = coordinates.map(|c| c * size as f64);
    let least = scaled.iter().copied().fold(f64::INFINITY, f64::min);
    let largest = scaled.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    // Bilinear lookups touch ⌊c − ½⌋ and the next; one more on each side for rounding.
    let (first, last) = ((least - 0.5).floor() - 1.0, (largest - 0.5).floor() + 2.0);
    if wrap == Wrap::ClampToEdge {
        return [(wrap_texel(first, size, wrap), wrap_texel(last, size, wrap) + 1), (0, 0)];
    }
    let all = [(0, size), (0, 0)];
    // Written so that a huge or non-finite coordinate means all of them.
    let fits = last - first + 1.0 < size as f64 && first.abs() < 1e9;
    if !fits {
        return all;
    }
    let (a, b) = (wrap_texel(first, size, wrap), wrap_texel(last, size, wrap));
    match wrap {
        Wrap::Repeat if a <= b => [(a, b + 1), (0, 0)],
        Wrap::Repeat => [(a, size), (0, b + 1)],
        // Within one period the mirrored axis runs one way; a range that turns around an edge is taken as a whole.
        _ if (first / size as f64).floor() == (last / size as f64).floor() => [(a.min(b), a.max(b) + 1), (0, 0)],
        _ => all,
    }
}

fn texel_luminance(image: &Image, emission: [f32; 3]) -> Vec<f32> {
    fn map<T: Copy + Into<u32>>(texels: &[[T; 4]], most: u32, emission: [f32; 3]) -> Vec<f32> {
        let table: Vec<f64> = (0..=most).map(|c| srgb_to_linear(f64::from(c) / f64::from(most))).collect();
        let linear = |channel: T, factor: f32| (table[channel.into() as usize] * f64::from(factor)) as f32;
        texels
            .iter()
            .map(|t| [linear(t[0], emission[0]), linear(t[1], emission[1]), linear(t[2], emission[2])])
            .map(|rgb| if rgb == [0.0; 3] { 0.0 } else { (luminance(rgb) as f32).max(f32::MIN_POSITIVE) })
            .collect()
    }
    match &image.texels {
        Texels::Rgba8(texels) => map(texels, 255, emission),
        Texels::Rgba16(texels) => map(texels, 65535, emission),
    }
}
