//! Tone curves and the sRGB transfer function: from radiance to the 8-bit numbers of a PNG.

use std::fmt;
use std::str::FromStr;

/// How radiance is brought into [0, 1] before the sRGB transfer function. All but [`ToneMap::Aces`] act on each
/// channel alone; all map 0 to 0 and rise monotonically.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ToneMap {
    /// min(L, 1). The default: below 1 the picture shows the radiance itself, so pictures can be compared by number.
    #[default]
    Clip,
    /// 1 − exp(−L), a photographic exposure.
    Exponential,
    /// L / (1 + L): Reinhard et al., "Photographic Tone Reproduction for Digital Images", 2002, equation 3.
    Reinhard,
    /// Stephen Hill's fit of the ACES RRT and sRGB ODT (BakingLab, ACES.hlsl): sRGB to a desaturated AP1, a rational
    /// curve, and back. Highlights desaturate; 0.18 maps to about 0.1.
    Aces,
}

impl ToneMap {
    /// Every curve with its name on the command line.
    pub const NAMES: [(&'static str, Self); 4] =
        [("clip", Self::Clip), ("exponential", Self::Exponential), ("reinhard", Self::Reinhard), ("aces", Self::Aces)];

    /// Display-linear Rec.709 in [0, 1] of a scene-linear radiance; negative radiance counts as 0.
    pub fn apply(self, radiance: [f32; 3]) -> [f32; 3] {
        let l = radiance.map(|c| c.max(0.0));
        match self {
            Self::Clip => l.map(|c| c.min(1.0)),
            Self::Exponential => l.map(|c| -(-c).exp_m1()),
            Self::Reinhard => l.map(|c| c / (1.0 + c)),
            Self::Aces => aces(l),
        }
    }
}

impl fmt::Display for ToneMap {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = Self::NAMES.iter().find(|(_, map)| map == self).map_or("", |(name, _)| name);
        f.write_str(name)
    }
}

impl FromStr for ToneMap {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        let known = || Self::NAMES.map(|(name, _)| name).join(", ");
        let found = Self::NAMES.iter().find(|(n, _)| *n == name);
        found.map(|(_, map)| *map).ok_or_else(|| format!("unknown tone curve '{name}'; there are {}", known()))
    }
}

/// sRGB → XYZ → D60 → AP1 → RRT saturation, by rows.
const ACES_INPUT: [[f32; 3]; 3] =
    [[0.59719, 0.35458, 0.04823], [0.07600, 0.90834, 0.01566], [0.02840, 0.13383, 0.83777]];
/// ODT saturation → XYZ → D65 → sRGB, by rows.
const ACES_OUTPUT: [[f32; 3]; 3] =
    [[1.60475, -0.53108, -0.07367], [-0.10208, 1.10813, -0.00605], [-0.00327, -0.07276, 1.07602]];

fn aces(radiance: [f32; 3]) -> [f32; 3] {
    let rows = |m: [[f32; 3]; 3], v: [f32; 3]| m.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2]);
    // Beyond 1e6 the curve is flat to the last bit, and its squares would overflow.
    let fitted = rows(ACES_INPUT, radiance.map(|c| c.min(1e6))).map(|v| {
        let a = v * (v + 0.024_578_6) - 0.000_090_537;
        let b = v * (0.983_729 * v + 0.432_951) + 0.238_081;
        a / b
    });
    rows(ACES_OUTPUT, fitted).map(|c| c.clamp(0.0, 1.0))
}

/// The sRGB transfer function (IEC 61966-2-1), from linear to encoded, both in [0, 1].
pub fn srgb_encode(linear: f32) -> f32 {
    if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}

/// Exposes, tone-maps and encodes one pixel to 8-bit sRGB, rounding to nearest. `exposure_ev` doubles the radiance
/// with each step. `None` if a channel is NaN or infinite.
pub fn to_srgb8(radiance: [f32; 3], exposure_ev: f32, tone_map: ToneMap) -> Option<[u8; 3]> {
    if !radiance.iter().all(|c| c.is_finite()) {
        return None;
    }
    let exposed = radiance.map(|c| (c * exposure_ev.exp2()).min(f32::MAX));
    Some(tone_map.apply(exposed).map(|c| (255.0 * srgb_encode(c)).round() as u8))
}
