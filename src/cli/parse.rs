//! Parsers of option values.

use std::ops::Range;
use std::str::FromStr;
use std::time::Duration;

use clap::builder::{PossibleValuesParser, TypedValueParser};
use sunfleck::watch::messages::Pose;

/// Film sums are 40 bytes a pixel on the host; 2²⁸ pixels are 10 GiB of them.
const MAX_PIXELS: u64 = 1 << 28;

/// A parser for an enum with names: help and errors list them.
pub(crate) fn named<T>(names: &'static [&'static str]) -> impl TypedValueParser<Value = T>
where
    T: FromStr<Err = String> + Clone + Send + Sync + 'static,
{
    PossibleValuesParser::new(names).try_map(|name| name.parse::<T>())
}

/// `X,Y`: a column and a row.
pub(crate) fn pixel(text: &str) -> Result<[u32; 2], String> {
    let read = |(x, y): (&str, &str)| Some([x.trim().parse().ok()?, y.trim().parse().ok()?]);
    text.split_once(',').and_then(read).ok_or_else(|| "a pixel is X,Y in whole numbers, as 256,128".to_owned())
}

/// `EYE:TARGET` or `EYE:TARGET:UP`, each `X,Y,Z`.
pub(crate) fn look_at(text: &str) -> Result<Pose, String> {
    let point = |text: &str| {
        let numbers: Option<Vec<f64>> = text.split(',').map(|number| number.trim().parse().ok()).collect();
        <[f64; 3]>::try_from(numbers?).ok()
    };
    let points: Option<Vec<[f64; 3]>> = text.split(':').map(point).collect();
    let (eye, target, up) = match points.as_deref() {
        Some(&[eye, target]) => (eye, target, [0.0, 1.0, 0.0]),
        Some(&[eye, target, up]) => (eye, target, up),
        _ => return Err("expected EYE:TARGET or EYE:TARGET:UP, each X,Y,Z, as in 0,1,4:0,1,0".to_owned()),
    };
    let pose = Pose { eye, target, up };
    let is_frame = pose.camera_to_world().is_some();
    is_frame
        .then_some(pose)
        .ok_or_else(|| "eye, target and up make no camera: two are at one place or in line".to_owned())
}

/// `1280x720`.
pub(crate) fn resolution(text: &str) -> Result<(u32, u32), String> {
    let sides = text.split_once(['x', 'X']).and_then(|(w, h)| Some((w.parse().ok()?, h.parse().ok()?)));
    let (width, height): (u32, u32) = sides.ok_or("expected WIDTHxHEIGHT in pixels, as in 1280x720")?;
    if width == 0 || height == 0 {
        return Err("an image has at least 1x1 pixels".to_owned());
    }
    if u64::from(width) * u64::from(height) > MAX_PIXELS {
        return Err(format!("more than {MAX_PIXELS} pixels (2^28); render it in parts"));
    }
    Ok((width, height))
}

/// `30s`, `2m`, `500ms`, `1.5h`; a bare number is seconds.
pub(crate) fn duration(text: &str) -> Result<Duration, String> {
    let split = text.find(|c: char| c.is_ascii_alphabetic()).unwrap_or(text.len());
    let (number, unit) = text.split_at(split);
    let factor = match unit {
        "ms" => 1e-3,
        "s" | "" => 1.0,
        "m" | "min" => 60.0,
        "h" => 3600.0,
        _ => return Err(format!("unknown unit '{unit}'; use ms, s, m or h, as in 30s")),
    };
    let seconds = number.trim().parse::<f64>().map_err(|_| "expected a time such as 500ms, 30s, 2m or 1h")? * factor;
    match Duration::try_from_secs_f64(seconds) {
        Ok(duration) if !duration.is_zero() => Ok(duration),
        _ => Err("expected a time above 0".to_owned()),
    }
}

/// `A..B`, the sample indices from A up to but without B.
pub(crate) fn sample_range(text: &str) -> Result<Range<u32>, String> {
    let ends = text.split_once("..").and_then(|(a, b)| Some((a.parse().ok()?, b.parse().ok()?)));
    let (start, end): (u32, u32) = ends.ok_or("expected A..B, the sample indices from A up to but without B")?;
    if start >= end { Err("the range is empty: expected A..B with A below B".to_owned()) } else { Ok(start..end) }
}

/// A finite number.
pub(crate) fn finite(text: &str) -> Result<f64, String> {
    text.parse().ok().filter(|x: &f64| x.is_finite()).ok_or_else(|| "expected a finite number".to_owned())
}

/// A finite number that is not negative and fits an f32.
pub(crate) fn not_negative(text: &str) -> Result<f32, String> {
    let number = finite(text)? as f32;
    if number >= 0.0 && number.is_finite() {
        Ok(number)
    } else {
        Err("expected a number that is not negative".to_owned())
    }
}

/// A finite number above 0.
pub(crate) fn positive(text: &str) -> Result<f64, String> {
    finite(text).ok().filter(|&x| x > 0.0).ok_or_else(|| "expected a number above 0".to_owned())
}

/// The same as an f32, which must not round to 0 or to infinity.
pub(crate) fn positive_f32(text: &str) -> Result<f32, String> {
    let x = positive(text)? as f32;
    if x > 0.0 && x.is_finite() { Ok(x) } else { Err("expected a number above 0 that an f32 can hold".to_owned()) }
}

/// Exposure steps; ±60 is beyond every radiance that occurs and still multiplies without overflow of an f32's factor.
pub(crate) fn exposure_ev(text: &str) -> Result<f32, String> {
    let ev = finite(text)?;
    if ev.abs() <= 60.0 { Ok(ev as f32) } else { Err("expected exposure steps between -60 and 60".to_owned()) }
}

/// `MIN..MAX`, sample counts that double from MIN while they are not above MAX.
pub(crate) fn doubling(text: &str) -> Result<Doubling<u32>, String> {
    let ends = text.split_once("..").and_then(|(a, b)| Some((a.parse().ok()?, b.parse().ok()?)));
    let (min, max): (u32, u32) = ends.ok_or("expected MIN..MAX, sample counts that double, as in 4..64")?;
    if min == 0 || min > max {
        return Err("expected MIN..MAX with MIN at least 1 and not above MAX".to_owned());
    }
    Ok(Doubling(std::iter::successors(Some(min), |spp| spp.checked_mul(2)).take_while(|spp| *spp <= max).collect()))
}

/// `MIN..MAX`, times that double from MIN while they are not above MAX.
pub(crate) fn doubling_times(text: &str) -> Result<Doubling<Duration>, String> {
    let (min, max) = text.split_once("..").ok_or("expected MIN..MAX, times that double, as in 0.25s..4s")?;
    let (min, max) = (duration(min)?, duration(max)?);
    if min > max {
        return Err("expected MIN..MAX with MIN not above MAX".to_owned());
    }
    Ok(Doubling(std::iter::successors(Some(min), |time| time.checked_mul(2)).take_while(|time| *time <= max).collect()))
}

/// Values that double, ascending; at least one.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Doubling<T>(pub(crate) Vec<T>);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_double_up_to_their_end() {
        assert_eq!(doubling("4..40"), Ok(Doubling(vec![4, 8, 16, 32])));
        let milliseconds = |times: &[u64]| Ok(Doubling(times.iter().map(|&t| Duration::from_millis(t)).collect()));
        assert_eq!(doubling_times("0.25s..1s"), milliseconds(&[250, 500, 1000]));
        assert_eq!(doubling_times("250ms..0.3"), milliseconds(&[250]));
        for (text, word) in [("1s", "MIN..MAX"), ("2s..1s", "not above"), ("0s..1s", "above 0"), ("1x..2s", "unit 'x'")]
        {
            let error = doubling_times(text).unwrap_err();
            assert!(error.contains(word), "{text}: {error}");
        }
    }
}
