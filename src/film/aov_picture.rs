//! AOVs as pictures to look at: 8-bit sRGB, one a layer.

use std::path::{Path, PathBuf};

use super::Film;
use super::aov::{Aov, AovFilm};
use super::metrics::magma;
use super::png::tone_map_srgb8;
use super::tonemap::ToneMap;

/// A picture of an AOV.
#[derive(Clone, Debug, PartialEq)]
pub struct AovPicture {
    /// 8-bit sRGB, row by row from the top left.
    pub pixels: Vec<[u8; 3]>,
    /// What the picture's scale spans, where it depends on the image.
    pub scale: Option<String>,
}

/// Where the picture of an AOV lies that belongs to the picture at `path`: `a.png` has `a.normal.png` beside it.
pub fn picture_path(path: &Path, aov: Aov) -> PathBuf {
    path.with_extension(format!("{aov}.png"))
}

/// Draws an AOV. `None` if the film does not have it.
///
/// Albedo is encoded as sRGB; of a normal n, (n + 1)/2 is stored as it is; depth goes from white at the nearest to dark
/// grey at the farthest, and positions fill the colours' range from their least to their greatest, both of what is seen
/// of surfaces alone, on black; cost is matplotlib's magma from 0 to what all but one pixel in a hundred stay below.
pub fn aov_picture(aovs: &AovFilm, film: &Film, aov: Aov) -> Option<AovPicture> {
    let means = match aov {
        Aov::Depth | Aov::Position => aovs.means_of_hits(aov)?,
        _ => aovs.means(aov, film)?,
    };
    let pixels = film.pixels().len();
    let plain = |pixels| Some(AovPicture { pixels, scale: None });
    match (aov, means.as_slice()) {
        (Aov::Albedo, [r, g, b]) => {
            let colours: Vec<_> = (0..pixels).map(|i| [r[i] as f32, g[i] as f32, b[i] as f32]).collect();
            plain(tone_map_srgb8(&colours, 0.0, ToneMap::Clip).0)
        }
        (Aov::Normal, [x, y, z]) => {
            plain((0..pixels).map(|i| [x[i], y[i], z[i]].map(|n| byte(0.5 * n + 0.5))).collect())
        }
        (Aov::Coverage, [share]) => plain(share.iter().map(|&share| [byte(share); 3]).collect()),
        (Aov::Depth, [z]) => {
            let (near, far) = range(aovs, z);
            let shade = |i: usize| [byte(1.0 - 0.9 * place(z[i], near, far)); 3];
            let pixels = (0..pixels).map(|i| if aovs.is_hit(i) { shade(i) } else { [0; 3] }).collect();
            Some(AovPicture { pixels, scale: Some(format!("white {near:.4} m, dark grey {far:.4} m")) })
        }
        (Aov::Position, [x, y, z]) => {
            let ranges = [x, y, z].map(|axis| range(aovs, axis));
            let colour =
                |i: usize| [0, 1, 2].map(|axis| byte(place([x, y, z][axis][i], ranges[axis].0, ranges[axis].1)));
            let pixels = (0..pixels).map(|i| if aovs.is_hit(i) { colour(i) } else { [0; 3] }).collect();
            let spans: Vec<_> = ranges.iter().map(|(low, high)| format!("{low:.4} to {high:.4} m")).collect();
            Some(AovPicture { pixels, scale: Some(format!("x {}, y {}, z {}", spans[0], spans[1], spans[2])) })
        }
        (Aov::Cost, [visits]) => {
            let mut ordered = visits.clone();
            ordered.sort_by(f64::total_cmp);
            let most = ordered[ordered.len() * 99 / 100];
            let shares: Vec<f32> = visits.iter().map(|&n| place(n, 0.0, most).min(1.0) as f32).collect();
            let pixels = magma(film.width(), film.height(), &shares);
            Some(AovPicture {
                pixels,
                scale: Some(format!("black 0, yellowish white {most:.1} visits a sample and more")),
            })
        }
        _ => None,
    }
}

/// A share as a byte; what is no number is 0.
fn byte(share: f64) -> u8 {
    (share.clamp(0.0, 1.0) * 255.0).round() as u8
}

/// Where a number lies between two others; 0 where they are equal.
fn place(x: f64, low: f64, high: f64) -> f64 {
    if high > low { (x - low) / (high - low) } else { 0.0 }
}

/// The least and the greatest value where anything is seen; zeros where nothing is.
fn range(aovs: &AovFilm, values: &[f64]) -> (f64, f64) {
    let seen = || values.iter().enumerate().filter(|(i, _)| aovs.is_hit(*i)).map(|(_, &value)| value);
    let low = seen().fold(f64::INFINITY, f64::min);
    if low == f64::INFINITY { (0.0, 0.0) } else { (low, seen().fold(f64::NEG_INFINITY, f64::max)) }
}
