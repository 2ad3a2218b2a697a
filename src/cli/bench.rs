//! `sunfleck bench`: run time against error, of a scene or of a suite of them.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use clap::Args;
use serde_json::{Value, json};
use sunfleck::atomic_file::{check_writable, write_atomically};
use sunfleck::bench::measure::{Measurement, measure};
use sunfleck::bench::plan::{Budget, Plan, ReferenceChoice};
use sunfleck::bench::plot::{self, PlotFormat};
use sunfleck::render::{OpenDevice, Settings, open_device};
use sunfleck::scene::Scene;
use sunfleck::{Error, Result};

use super::bench_report::{heading, print_measurement};
use super::estimator_args::EstimatorArgs;
use super::given_flags::GivenFlags;
use super::progress::Progress;
use super::render::load_scene;
use super::{bench_compare, bench_suite, interrupt, parse, print_json};

const EXAMPLES: &str = "\
Errors are to the reference, in linear radiance: MSE, relMSE ((a - b)^2 / (b^2 + 0.01^2)) and FLIP. The reference's own
noise is subtracted from MSE and relMSE, not from FLIP.

Flags beside a SUITE hold for each of its benches and override what the suite says; those that name something of one
scene (--camera, --reference, --plot, --compare) are refused there.

Examples:
  sunfleck bench                                     the Cornell box
  sunfleck bench scene.gltf --spp 4..256 -o out      with DIR/scene.json, .svg and .png
  sunfleck bench scene.gltf --times 0.25s..4s --plot error.svg
  sunfleck bench scene.gltf --reference truth.exr --strict
  sunfleck bench --compare '--light-sampling bsdf'   settings against each other
  sunfleck bench --compare ../old/sunfleck           builds against each other
  sunfleck bench standard -o out/bench               benches/suites/standard.json";

/// Measure run time against error to a reference.
#[derive(Args, Clone, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct BenchArgs {
    #[command(flatten)]
    pub(super) given: GivenFlags,
    /// A scene as `render` takes it; or a suite: a .json file, or the name of one in benches/suites.
    #[arg(value_name = "SCENE|SUITE", default_value = "cornell")]
    pub(super) scene: String,
    /// Write DIR/NAME.json, .svg and .png; of a suite also DIR/README.md.
    #[arg(short, long = "output", value_name = "DIR")]
    pub(super) output: Option<PathBuf>,
    /// Draw error over time to this .svg or .png file. May be given several times.
    #[arg(long, value_name = "FILE", conflicts_with = "compare")]
    plot: Vec<PathBuf>,

    /// Samples per pixel, doubling from MIN to MAX.
    #[arg(long, value_name = "MIN..MAX", default_value = "4..64", value_parser = parse::doubling, conflicts_with = "times", help_heading = "Bench")]
    spp: parse::Doubling<u32>,
    /// Render times instead, doubling from MIN to MAX, as in 0.25s..4s.
    #[arg(long, value_name = "MIN..MAX", value_parser = parse::doubling_times, help_heading = "Bench")]
    times: Option<parse::Doubling<Duration>>,
    /// Images of each count or time, each of another seed.
    #[arg(long, value_name = "N", default_value_t = 8, value_parser = clap::value_parser!(u32).range(2..=4096), help_heading = "Bench")]
    pub(super) seeds: u32,
    /// An EXR to measure against; its `variance` channel is used [default: an own run of another estimator].
    #[arg(long, value_name = "FILE", conflicts_with = "reference_spp", help_heading = "Bench")]
    pub(super) reference: Option<PathBuf>,
    /// Samples per pixel of the own reference [default: 2 x seeds x MAX, of --spp or of --times].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1 << 30), help_heading = "Bench")]
    reference_spp: Option<u32>,
    /// Alternate with another sunfleck program, or with other flags of `render` (quoted).
    #[arg(long, value_name = "BINARY|SETTINGS", allow_hyphen_values = true, help_heading = "Bench")]
    pub(super) compare: Option<String>,

    /// Width and height of the images in pixels.
    #[arg(long, value_name = "WxH", default_value = "128x128", value_parser = parse::resolution, help_heading = "Image")]
    pub(super) resolution: (u32, u32),
    /// Camera of the scene, by name or index [default: the first].
    #[arg(long, value_name = "NAME|INDEX", help_heading = "Image")]
    pub(super) camera: Option<String>,
    #[command(flatten)]
    pub(super) estimator: EstimatorArgs,

    /// Print one JSON object on standard output, with the raw numbers of every image.
    #[arg(long, help_heading = "Reports")]
    pub(super) json: bool,
    /// No progress and no table; errors and warnings remain.
    #[arg(long, short, help_heading = "Reports")]
    pub(super) quiet: bool,
    /// Exit with 6 if the result is not trustworthy: biased, or with a NaN sample.
    #[arg(long, help_heading = "Reports")]
    pub(super) strict: bool,
}

/// Measures what the command line asks for.
pub(crate) fn run(args: BenchArgs) -> anyhow::Result<()> {
    if let Some(folder) = &args.output {
        std::fs::create_dir_all(folder).map_err(|e| Error::io(folder, "make this folder", e))?;
    }
    args.check_plots()?;
    if let Some(suite) = bench_suite::find(&args.scene) {
        return bench_suite::run(&suite, &args);
    }
    if args.compare.is_some() {
        return bench_compare::run(&args);
    }
    let name = scene_name(&args.scene);
    let report = bench(&args, &name)?;
    if args.json {
        print_json(&report.value)?;
    }
    report.verdict(args.strict).map_err(anyhow::Error::from)
}

/// One scene, measured.
pub(super) struct Report {
    /// What `--json` prints.
    pub(super) value: Value,
    /// What was measured.
    pub(super) measurement: Measurement,
}

impl Report {
    /// Whether it is complete, and whether `--strict` lets it pass.
    pub(super) fn verdict(&self, strict: bool) -> Result<()> {
        let Measurement { bias, non_finite_samples, interrupted, .. } = &self.measurement;
        if *interrupted {
            return Err(Error::Interrupted);
        }
        if strict && *non_finite_samples > 0 {
            return Err(Error::Untrustworthy(format!("--strict: {non_finite_samples} samples were NaN or infinite")));
        }
        if let Some(bias) = bias.as_ref().filter(|bias| strict && bias.biased) {
            let failures = bias.failures;
            return Err(Error::Untrustworthy(format!("--strict: biased; {failures} of {} tests fail", bias.tests)));
        }
        Ok(())
    }
}

/// Measures one scene, prints the table and writes the files.
pub(super) fn bench(args: &BenchArgs, name: &str) -> anyhow::Result<Report> {
    let ready = Ready::new(args)?;
    let mut progress = Progress::new(args.quiet);
    let measurement = measure(&ready.device, &ready.scene, &ready.settings, &ready.plan, &mut |update| {
        progress.show(update);
        if interrupt::requested() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    });
    progress.finish();
    let mut measurement = measurement?;
    measurement.seconds.load = ready.load_seconds;
    if !args.quiet {
        print_measurement(&heading(args, name), &measurement, ready.start_up_seconds);
    }
    let mut value = serde_json::to_value(&measurement)?;
    value["name"] = json!(name);
    value["scene"] = json!(args.scene);
    value["flags"] = json!(args.estimator.render_flags());
    value["seconds"]["start_up"] = json!(ready.start_up_seconds);
    let mut plots = args.plot.clone();
    if let Some(folder) = &args.output {
        write_json(&folder.join(format!("{name}.json")), &value)?;
        if plot::can_draw(&measurement) {
            plots.extend(["svg", "png"].map(|extension| folder.join(format!("{name}.{extension}"))));
        } else {
            eprintln!("warning: no plot of {name}: no MSE is above the reference's noise");
        }
    }
    plots.iter().try_for_each(|path| plot::draw(&measurement, &heading(args, name), path))?;
    Ok(Report { value, measurement })
}

/// All that a measurement needs.
pub(super) struct Ready {
    pub(super) scene: Scene,
    pub(super) device: OpenDevice,
    pub(super) settings: Settings,
    pub(super) plan: Plan,
    load_seconds: f64,
    /// Opening the device.
    start_up_seconds: f64,
}

impl Ready {
    /// Usage errors first, then the scene, then the device.
    pub(super) fn new(args: &BenchArgs) -> anyhow::Result<Self> {
        let (width, height) = args.resolution;
        let mut settings = Settings { width, height, camera: args.camera.clone(), ..Settings::default() };
        let environment = args.estimator.clone().apply(&mut settings)?;
        let plan = args.plan();
        let loading = Instant::now();
        let scene = load_scene(&args.scene, &environment, args.quiet)?;
        let load_seconds = loading.elapsed().as_secs_f64();
        let starting = Instant::now();
        let device = open_device(&settings)?;
        let start_up_seconds = starting.elapsed().as_secs_f64();
        interrupt::install();
        Ok(Self { scene, device, settings, plan, load_seconds, start_up_seconds })
    }
}

impl BenchArgs {
    /// What the images of each row may take.
    pub(super) fn rows(&self) -> Vec<Budget> {
        match &self.times {
            Some(times) => times.0.iter().copied().map(Budget::Time).collect(),
            None => self.spp.0.iter().copied().map(Budget::Samples).collect(),
        }
    }

    fn plan(&self) -> Plan {
        let rows = self.rows();
        // As much as all images together, since rows that double add up to twice the last one.
        let own = self.reference_spp.map_or(rows[rows.len() - 1].times(2 * self.seeds), Budget::Samples);
        let reference = self.reference.clone().map_or(ReferenceChoice::Own(own), ReferenceChoice::File);
        Plan { rows, seeds: self.seeds, reference }
    }

    /// Usage errors first, then what the file system says.
    fn check_plots(&self) -> Result<()> {
        for (n, path) in self.plot.iter().enumerate() {
            PlotFormat::of(path)?;
            if self.plot[..n].contains(path) {
                return Err(Error::Usage(format!("plot '{}' is given twice", path.display())));
            }
        }
        self.plot.iter().try_for_each(|path| check_writable(path))
    }
}

/// The name of a scene's file without folder and extension.
pub(super) fn scene_name(scene: &str) -> String {
    Path::new(scene).file_stem().map_or("bench".to_owned(), |stem| stem.to_string_lossy().into_owned())
}

/// Writes an object to a file.
pub(super) fn write_json(path: &Path, value: &Value) -> Result<()> {
    write_text(path, &format!("{value:#}\n"))
}

/// Writes a text file.
pub(super) fn write_text(path: &Path, text: &str) -> Result<()> {
    use std::io::Write;
    write_atomically(path, |file| file.write_all(text.as_bytes()))
}
