//! Two scenes of Benedikt Bitterli's collection, translated by tests/reference/bitterli.py, against the images that come with
//! them (docs/accuracy/bitterli.md), and veach-mis against Mitsuba's image of it with Sunfleck's metals. The scenes are part of the
//! collection of real input (tests/common/assets.rs); without it these tests say so and pass.
//!
//! The images have a tent filter and no variance of their own. A symmetric filter does not move what is linear, and in
//! the tiles that are smooth the rest is noise: a quadratic in x and y is fitted to each tile, the residuals tell
//! its noise and whether it is smooth.

use std::path::{Path, PathBuf};
use std::process::Command;

use crate::common::assets::collection;
use crate::common::gpu;
use crate::common::reference::Reference;
use crate::common::scenes::short_form;
use crate::common::statistics::{Comparison, Estimate, TileStatistics};
use sunfleck::render::Settings;
use sunfleck::scene::{Scene, load};

/// A tile is smooth if no pixel is further than this part of the tile's mean from the fit: noise, by the images' own
/// residuals of up to 4 %, stays below it, edges between materials do not.
const SMOOTH: f64 = 0.2;
/// Numbers are stored in half floats: a relative error of 2^-11 at most, which may be one for a whole flat tile.
const HALF: f64 = 1.0 / 2048.0;

/// One of the scenes, and the folder that it comes from.
struct Subject {
    folder: PathBuf,
    name: &'static str,
    /// Of our image, in pixels.
    size: [usize; 2],
    /// The edge of a tile in our pixels.
    tile: usize,
    bounces: Option<u32>,
}

impl Subject {
    /// `None` where the collection is absent, or one driver of several is under test: the driver changes nothing here.
    fn new(name: &'static str, size: [usize; 2], tile: usize, bounces: Option<u32>) -> Option<Self> {
        let folder = collection()?.join("scenes-bitterli-mitsuba").join(name);
        (!short_form()).then_some(Self { folder, name, size, tile, bounces })
    }

    fn scene(&self) -> Scene {
        let scratch = tempfile::tempdir().expect("a scratch folder");
        let file = scratch.path().join("scene.gltf");
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/reference/bitterli.py");
        let run = Command::new("python3").arg(script).arg(self.folder.join("scene.xml")).arg(&file).output();
        let output = run.expect("python3 is there: it translates the scene");
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        load::load_scene(&file).expect("the translated scene loads")
    }

    fn render(&self, scene: &Scene, seeds: u32, spp: u32) -> TileStatistics {
        let [width, height] = self.size;
        let settings = Settings { max_bounces: self.bounces, ..gpu::settings(width as u32, height as u32) };
        let mut tracer = gpu::path_tracer(scene, &settings);
        let mut statistics = TileStatistics::new(width, height, self.tile);
        for seed in 0..seeds {
            statistics.add(&gpu::run(&mut tracer, seed, spp).film.radiance());
        }
        statistics
    }

    /// Three estimates (R, G, B) a tile of the image that comes with the scene; `None` where it is not smooth.
    fn reference(&self) -> Vec<Option<Estimate>> {
        let path = self.folder.join("TungstenRender.exr");
        let image = exr::prelude::read_first_rgba_layer_from_file(
            &path,
            |size, _| (vec![[0.0_f32; 3]; size.area()], size.width()),
            |(pixels, width), at, (r, g, b, _): (f32, f32, f32, f32)| pixels[at.y() * *width + at.x()] = [r, g, b],
        );
        let (pixels, width) =
            image.unwrap_or_else(|error| panic!("{}: {error}", path.display())).layer_data.channel_data.pixels;
        let edge = self.tile * width / self.size[0];
        let (columns, rows) = (width / edge, pixels.len() / width / edge);
        let tile = |index: usize| {
            let (x, y, channel) = (index / 3 % columns * edge, index / 3 / columns * edge, index % 3);
            let value = |i: usize| f64::from(pixels[(y + i / edge) * width + x + i % edge][channel]);
            smooth_mean(&(0..edge * edge).map(value).collect::<Vec<f64>>(), edge)
        };
        (0..3 * columns * rows).map(tile).collect()
    }
}

/// The mean of a square of pixels with the variance that is left beside a quadratic; `None` if it is not smooth.
fn smooth_mean(values: &[f64], edge: usize) -> Option<Estimate> {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let mut residuals: Vec<f64> = values.iter().map(|v| v - mean).collect();
    // 1, x, y, xy, x² and y² less their means are orthogonal on a square grid.
    let coordinate = |i: usize| i as f64 - 0.5 * (edge as f64 - 1.0);
    let square = ((edge * edge) as f64 - 1.0) / 12.0;
    let terms: [fn(f64, f64, f64) -> f64; 5] =
        [|x, _, _| x, |_, y, _| y, |x, y, _| x * y, |x, _, s| x * x - s, |_, y, s| y * y - s];
    for term in terms {
        let at = |i: usize| term(coordinate(i % edge), coordinate(i / edge), square);
        let norm: f64 = (0..values.len()).map(|i| at(i).powi(2)).sum();
        let slope = (0..values.len()).map(|i| at(i) * residuals[i]).sum::<f64>() / norm;
        (0..values.len()).for_each(|i| residuals[i] -= slope * at(i));
    }
    let largest = residuals.iter().fold(0.0, |worst: f64, r| worst.max(r.abs()));
    let noise = residuals.iter().map(|r| r * r).sum::<f64>() / (n - 6.0) / n;
    let variance = noise + (HALF * mean).powi(2) / 3.0;
    (mean > 0.0 && largest < SMOOTH * mean).then_some(Estimate { mean, variance, count: n - 5.0 })
}

/// The smooth tiles of both images, of those that `keep` (given column and row as parts of the image) lets through.
fn smooth_pairs(
    subject: &Subject,
    ours: &TileStatistics,
    keep: impl Fn(f64, f64) -> bool,
) -> (Vec<Estimate>, Vec<Estimate>) {
    let columns = subject.size[0] / subject.tile;
    let rows = subject.size[1] / subject.tile;
    let place = |i: usize| ((i / 3 % columns) as f64 + 0.5, (i / 3 / columns) as f64 + 0.5);
    let kept = |i: usize| keep(place(i).0 / columns as f64, place(i).1 / rows as f64);
    let pairs = ours.tiles().into_iter().zip(subject.reference()).enumerate().filter(|(i, _)| kept(*i));
    pairs.filter_map(|(_, (a, b))| Some((a, b?))).unzip()
}

/// Whether two lists of tiles agree: one by one, and in the mean of all (with the channels mixed).
fn agree(what: &str, (ours, theirs): &(Vec<Estimate>, Vec<Estimate>)) -> bool {
    let [a, b] = [ours, theirs].map(|e| Estimate::mean_of_independent(e.iter().copied()));
    let ratio = a.mean / b.mean;
    let error = ratio * a.relative_error().hypot(b.relative_error());
    let comparison = Comparison::new(ours, theirs, 0.01);
    println!("{what}: ratio of the means {ratio:.5} ± {error:.5}; tiles: {comparison}");
    comparison.passed() && a.deviation(&b) < 4.0
}

/// Diffuse, with 64 bounces there and all here: nothing differs but the filter.
#[test]
fn cornell_box_agrees_with_its_reference() {
    let Some(subject) = Subject::new("cornell-box", [128, 128], 4, None) else { return };
    let mut scene = subject.scene();
    let pairs = smooth_pairs(&subject, &subject.render(&scene, 16, 16), |_, _| true);
    assert!(pairs.0.len() > 3 * 700, "only {} smooth tiles", pairs.0.len() / 3);
    assert!(agree(subject.name, &pairs));

    // A white that is 2 % too dark is noticed.
    scene
        .materials
        .iter_mut()
        .filter(|m| m.name != "Light")
        .for_each(|m| m.base_color = m.base_color.map(|c| 0.98 * c));
    let darker = smooth_pairs(&subject, &subject.render(&scene, 16, 4), |_, _| true);
    assert!(!agree("2 % darker", &darker));
}

/// Where the plates are (column and row as parts of the image).
fn is_plate(x: f64, y: f64) -> bool {
    (0.1..0.9).contains(&x) && y > 0.35
}

/// Where the lamps are. They are known, and so bright that they would be all of a mean.
fn is_lamp(x: f64, y: f64) -> bool {
    (0.3..0.75).contains(&x) && y < 0.35
}

/// Direct light alone. The plates have Beckmann's distribution there and GGX here: what is around them is compared with
/// the image that comes with the scene, everything with Mitsuba's image of true spheres and Sunfleck's model of the metals.
#[test]
fn veach_mis_agrees_around_its_plates_and_everywhere_with_mitsuba() {
    let Some(subject) = Subject::new("veach-mis", [160, 90], 5, Some(1)) else { return };
    let ours = subject.render(&subject.scene(), 16, 16);
    let pairs = smooth_pairs(&subject, &ours, |x, y| !is_plate(x, y) && !is_lamp(x, y));
    assert!(pairs.0.len() > 3 * 150, "only {} smooth tiles", pairs.0.len() / 3);
    assert!(agree("veach-mis, walls and floor", &pairs));

    let mitsuba = Reference::read("veach_mis_ggx.exr").tiles;
    assert!(agree("veach-mis, metals of GGX", &(ours.tiles(), mitsuba)));

    let everywhere = smooth_pairs(&subject, &ours, |_, _| true);
    assert!(!agree("veach-mis, plates of Beckmann", &everywhere), "Beckmann's plates cannot be GGX's");
}
