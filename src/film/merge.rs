//! Merging images of disjoint samples to the image of all of them, weighted by their sample counts.

use std::ops::Range;
use std::path::{Path, PathBuf};

use super::Film;
use super::exr::{ChannelValues, ExrImage, SAMPLES_CHANNEL, VARIANCE_CHANNEL};
use super::metadata::{Metadata, software};
use crate::{Error, Result};

/// An image to merge and the file it came from.
pub type Part = (PathBuf, ExrImage);

/// The merged image, and what the user should know about it, one line each.
#[derive(Debug)]
pub struct Merged {
    /// The image of all samples.
    pub image: ExrImage,
    /// What did not fit perfectly.
    pub warnings: Vec<String>,
}

/// Merges images of the same view. Merging all parts of a run in one call equals the single run to 1 ulp; merging
/// merged images rounds once more each time.
///
/// # Errors
/// [`Error::Usage`] without parts. [`Error::Input`], naming the file, if sizes, cameras, integrators or bounds on indirect light differ, if a
/// part says nothing about its sample counts, or if two parts hold the same samples of the same seed.
pub fn merge(mut parts: Vec<Part>) -> Result<Merged> {
    // Sums are f64 and their order could show in the last bit: let it depend on the samples, not on the arguments.
    parts.sort_by_key(|(_, image)| image.metadata.sample_ranges.first().map_or(0, |r| r.start));
    check_same_view(&parts)?;
    check_disjoint(&parts)?;
    let mut films = Vec::with_capacity(parts.len());
    for (path, image) in &parts {
        films.push(image.to_film().ok_or_else(|| {
            Error::input(
                path,
                "has no R, G, B with a 'samples' channel or a 'samplesPerPixel' attribute; cannot weigh it",
            )
        })?);
    }
    check_counts(&parts, &films)?;
    let mut warnings = view_warnings(&parts);
    let (first, rest) = films.split_first().ok_or_else(|| Error::Usage("nothing to merge".to_owned()))?;
    let mut film = first.clone();
    rest.iter().for_each(|other| film.merge(other));
    let mut image = ExrImage::from_film(&film, merged_metadata(&parts));
    merge_layers(&parts, &films, &mut image, &mut warnings);
    Ok(Merged { image, warnings })
}

fn check_same_view(parts: &[Part]) -> Result<()> {
    let Some((first_path, first)) = parts.first() else { return Ok(()) };
    for (path, image) in parts {
        let differs = |what: &str, mine: &str, theirs: &str| {
            Error::input(path, format!("{what} {mine} differs from {theirs} of {}", first_path.display()))
        };
        if (image.width, image.height) != (first.width, first.height) {
            let size = |i: &ExrImage| format!("{}x{}", i.width, i.height);
            return Err(differs("resolution", &size(image), &size(first)));
        }
        let (mine, theirs) = (&image.metadata, &first.metadata);
        if mine.integrator != theirs.integrator {
            let name = |m: &Metadata| m.integrator.clone().unwrap_or_else(|| "(none)".to_owned());
            return Err(differs("integrator", &name(mine), &name(theirs)));
        }
        if mine.clamp_indirect != theirs.clamp_indirect {
            let bound = |m: &Metadata| m.clamp_indirect.map_or_else(|| "(none)".to_owned(), |most| most.to_string());
            return Err(differs("--clamp-indirect", &bound(mine), &bound(theirs)));
        }
        if mine.world_to_ndc != theirs.world_to_ndc || mine.world_to_camera != theirs.world_to_camera {
            return Err(differs("camera", "(worldToCamera, worldToNDC)", "that"));
        }
    }
    Ok(())
}

/// Counting the same samples twice would claim an error that the image does not have.
fn check_disjoint(parts: &[Part]) -> Result<()> {
    for (i, (path_a, a)) in parts.iter().enumerate() {
        for (path_b, b) in &parts[i + 1..] {
            if a.metadata.seed.is_none() || a.metadata.seed != b.metadata.seed {
                continue;
            }
            if let Some(range) = overlap(&a.metadata.sample_ranges, &b.metadata.sample_ranges) {
                return Err(Error::input(
                    path_b,
                    format!(
                        "holds samples {}..{} that {} holds too, of the same seed; merge disjoint --samples or other seeds",
                        range.start,
                        range.end,
                        path_a.display()
                    ),
                ));
            }
        }
    }
    Ok(())
}

fn overlap(a: &[Range<u32>], b: &[Range<u32>]) -> Option<Range<u32>> {
    let pairs = a.iter().flat_map(|a| b.iter().map(move |b| a.start.max(b.start)..a.end.min(b.end)));
    pairs.into_iter().find(|common| !common.is_empty())
}

fn check_counts(parts: &[Part], films: &[Film]) -> Result<()> {
    let most = |film: &Film| film.pixels().iter().map(|p| u64::from(p.count)).max().unwrap_or(0);
    if films.iter().map(most).sum::<u64>() > u64::from(u32::MAX) {
        let path = parts.first().map_or(Path::new(""), |(path, _)| path);
        return Err(Error::input(path, "the parts together have more than 2³² samples in a pixel"));
    }
    Ok(())
}

fn view_warnings(parts: &[Part]) -> Vec<String> {
    let mut warnings = Vec::new();
    let mut differ = |what: &str, consequence: &str, get: fn(&Metadata) -> &Option<String>| {
        if parts.iter().any(|(_, image)| get(&image.metadata) != get(&parts[0].1.metadata)) {
            warnings.push(format!("the parts differ in {what}: {consequence}"));
        }
    };
    differ("scene", "is it the same one?", |m| &m.scene);
    differ("kernel key", "the result equals a single run within statistics, not to the last bit", |m| &m.kernel_key);
    if parts.iter().any(|(_, image)| image.metadata.sample_ranges.is_empty()) {
        warnings
            .push("some parts do not say which samples they hold: nothing can tell whether they overlap".to_owned());
    }
    warnings
}

fn merged_metadata(parts: &[Part]) -> Metadata {
    let all: Vec<&Metadata> = parts.iter().map(|(_, image)| &image.metadata).collect();
    let mut metadata = all.first().map(|first| (*first).clone()).unwrap_or_default();
    metadata.software = Some(software());
    metadata.render_time_seconds = all.iter().map(|m| m.render_time_seconds).sum();
    let same_seed = all.iter().all(|m| m.seed == metadata.seed);
    let all_known = all.iter().all(|m| !m.sample_ranges.is_empty());
    // Ranges of different seeds are different samples under the same numbers: no list of ranges could say which.
    metadata.seed = metadata.seed.filter(|_| same_seed);
    metadata.sample_ranges = if same_seed && all_known {
        joined(all.iter().flat_map(|m| m.sample_ranges.iter().cloned()).collect())
    } else {
        Vec::new()
    };
    for (mine, get) in [
        (&mut metadata.kernel_key, (|m| &m.kernel_key) as fn(&Metadata) -> &Option<String>),
        (&mut metadata.device, |m| &m.device),
        (&mut metadata.scene, |m| &m.scene),
        (&mut metadata.sampler, |m| &m.sampler),
    ] {
        if all.iter().any(|m| get(m) != mine) {
            *mine = None;
        }
    }
    metadata
}

/// The same indices in as few ranges as possible, in order.
fn joined(mut ranges: Vec<Range<u32>>) -> Vec<Range<u32>> {
    ranges.sort_by_key(|r| (r.start, r.end));
    let mut result: Vec<Range<u32>> = Vec::new();
    for range in ranges {
        match result.last_mut() {
            Some(last) if range.start <= last.end => last.end = last.end.max(range.end),
            _ => result.push(range),
        }
    }
    result
}

/// The other layers (AOVs): means weighted by the same counts. A layer that not every part has is left out.
fn merge_layers(parts: &[Part], films: &[Film], image: &mut ExrImage, warnings: &mut Vec<String>) {
    let Some((_, first)) = parts.first() else { return };
    let is_own = |name: &str| ["R", "G", "B", SAMPLES_CHANNEL, VARIANCE_CHANNEL].contains(&name);
    for channel in first.channels.iter().filter(|c| !is_own(&c.name)) {
        let values: Vec<_> = parts
            .iter()
            .filter_map(|(_, part)| match part.values(&channel.name) {
                Some(ChannelValues::F32(values)) => Some(values),
                _ => None,
            })
            .collect();
        if values.len() < parts.len() {
            warnings.push(format!("channel {} is left out: not every part has it as floats", channel.name));
            continue;
        }
        let mean = |pixel: usize| {
            let weighted = values.iter().zip(films).map(|(v, film)| {
                let count = f64::from(film.pixels()[pixel].count);
                (count * f64::from(v[pixel]), count)
            });
            let (sum, count) = weighted.fold((0.0, 0.0), |a, b| (a.0 + b.0, a.1 + b.1));
            if count > 0.0 { (sum / count) as f32 } else { 0.0 }
        };
        image.push(&channel.name, ChannelValues::F32((0..films[0].pixels().len()).map(mean).collect()));
    }
}
