//! `sunfleck bench --compare`: two builds or two settings in alternation, each image by a process of its own, so that
//! both sides are treated alike and start-up counts too.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Instant;

use serde_json::{Value, json};
use sunfleck::bench::bias::{BiasVerdict, find_bias};
use sunfleck::bench::mean_image::ImageAccumulator;
use sunfleck::bench::measure::{keep_common_seeds, processor_name, reference_of};
use sunfleck::bench::pairs::{Comparison, Pair, Sample, a_first};
use sunfleck::bench::plan::Budget;
use sunfleck::bench::reference::Reference;
use sunfleck::bench::too_short;
use sunfleck::film::exr::{ChannelValues, ExrImage, SAMPLES_CHANNEL, read_exr};
use sunfleck::{Error, Result};

use super::bench::{BenchArgs, Ready, scene_name, write_json};
use super::bench_compare_report::print;
use super::progress::Progress;
use super::{interrupt, print_json};

/// One side.
struct Side {
    label: &'static str,
    program: PathBuf,
    flags: Vec<String>,
    mean: ImageAccumulator,
    /// What its last process reported.
    report: Value,
}

/// Runs the comparison.
pub(super) fn run(args: &BenchArgs) -> anyhow::Result<()> {
    let mut sides = sides(args)?;
    let ready = Ready::new(args)?;
    let folder = tempfile::tempdir()?;
    // A first image of each side warms the caches of files and drivers, finds wrong flags, and is not measured.
    for side in &mut sides {
        side.render(args, args.estimator.seed, ready.plan.rows[0], folder.path())?;
    }
    let reference = reference(args, &ready)?;
    let mut rows: Vec<Vec<Pair>> = ready.plan.rows.iter().map(|_| Vec::new()).collect();
    let interrupted = match render_pairs(args, &ready.plan.rows, &mut sides, folder.path(), &reference, &mut rows) {
        Err(Error::Interrupted) => true,
        result => result.map(|()| false)?,
    };
    keep_common_seeds(&mut rows);
    if rows.first().is_none_or(|pairs| pairs.len() < 2) {
        return Err(Error::Interrupted.into());
    }
    finish(args, &reference, sides, &rows, interrupted)
}

/// All rows of one seed after the other; in each of them A and B go first in turns.
fn render_pairs(
    args: &BenchArgs,
    budgets: &[Budget],
    sides: &mut [Side; 2],
    folder: &Path,
    reference: &Reference,
    rows: &mut [Vec<Pair>],
) -> Result<()> {
    for n in 0..args.seeds {
        let seed = args.estimator.seed.wrapping_add(n);
        for (row, &budget) in budgets.iter().enumerate() {
            let last = row + 1 == budgets.len();
            let [a, b] = &mut *sides;
            let sample = |side: &mut Side| side.sample(args, seed, budget, folder, reference, last);
            let (a, b) = if a_first(n as usize + row) {
                let a = sample(a)?;
                (a, sample(b)?)
            } else {
                let b = sample(b)?;
                (sample(a)?, b)
            };
            rows[row].push(Pair { seed, a, b });
            if !args.quiet {
                let (n, seeds) = (n + 1, args.seeds);
                eprintln!(
                    "{budget}, pair {n} of {seeds}: render {:.3} s and {:.3} s",
                    a.render_seconds, b.render_seconds
                );
            }
        }
    }
    Ok(())
}

fn reference(args: &BenchArgs, ready: &Ready) -> Result<Reference> {
    let mut progress = Progress::new(args.quiet);
    let reference = reference_of(&ready.device, &ready.scene, &ready.settings, &ready.plan, &mut |update| {
        progress.show(update);
        if interrupt::requested() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    });
    progress.finish();
    reference
}

/// A is this program with the flags given; B another program with the same, or this one with the flags changed.
fn sides(args: &BenchArgs) -> Result<[Side; 2]> {
    let program = std::env::current_exe().map_err(|e| Error::io(Path::new("sunfleck"), "find this program", e))?;
    let flags = args.estimator.render_flags();
    let other = args.compare.as_deref().unwrap_or_default();
    let side = |label, program, flags| Side {
        label,
        program,
        flags,
        mean: ImageAccumulator::new(args.resolution),
        report: Value::Null,
    };
    let b = if other.trim_start().starts_with('-') {
        let words =
            shlex::split(other).ok_or_else(|| Error::Usage(format!("--compare: a quote is open in '{other}'")))?;
        side("B", program.clone(), overridden(&flags, words))
    } else if Path::new(other).is_file() {
        side("B", PathBuf::from(other), flags.clone())
    } else {
        let message =
            format!("--compare: '{other}' is neither a program nor flags, as in --compare '--light-sampling bsdf'");
        return Err(Error::Usage(message));
    };
    Ok([side("A", program, flags), b])
}

/// The flags without those that `changes` sets anew, and the changes.
fn overridden(flags: &[String], changes: Vec<String>) -> Vec<String> {
    let name = |word: &str| word.split('=').next().unwrap_or_default().to_owned();
    let changed: Vec<_> = changes.iter().map(|word| name(word)).collect();
    flags.iter().filter(|flag| !changed.contains(&name(flag))).cloned().chain(changes).collect()
}

impl Side {
    /// Renders one image; returns its file and the seconds of the process.
    fn render(&mut self, args: &BenchArgs, seed: u32, budget: Budget, folder: &Path) -> Result<(PathBuf, f64)> {
        let image = folder.join(format!("{}.exr", self.label));
        let (width, height) = args.resolution;
        let mut command = Command::new(&self.program);
        command.args(["render", &args.scene, "--json", "--quiet", "-o"]).arg(&image);
        command.arg(format!("--resolution={width}x{height}"));
        let limit = match budget {
            Budget::Samples(spp) => format!("--spp={spp}"),
            Budget::Time(time) => format!("--time={}s", time.as_secs_f64()),
        };
        command.args([limit, format!("--seed={seed}")]);
        command.args(args.camera.iter().map(|camera| format!("--camera={camera}"))).args(&self.flags);
        let start = Instant::now();
        let output = command.stdin(Stdio::null()).output();
        let seconds = start.elapsed().as_secs_f64();
        let output = output.map_err(|e| Error::io(&self.program, "run this program", e))?;
        if interrupt::requested() {
            return Err(Error::Interrupted);
        }
        if !output.status.success() {
            return Err(self.failure(output.status.code(), &String::from_utf8_lossy(&output.stderr)));
        }
        self.report = serde_json::from_slice(&output.stdout)
            .map_err(|e| Error::input(&self.program, format!("side {}: its report is no JSON: {e}", self.label)))?;
        Ok((image, seconds))
    }

    /// The error of a process, of the kind that its exit code stands for.
    fn failure(&self, code: Option<i32>, stderr: &str) -> Error {
        let message = format!("side {} failed: {}", self.label, stderr.trim().trim_start_matches("error: "));
        match code {
            Some(2) => Error::Usage(message),
            Some(4) => Error::Device(message),
            Some(5) => Error::DeviceLost(message),
            Some(6) => Error::Untrustworthy(message),
            Some(130) => Error::Interrupted,
            _ => Error::input(&self.program, message),
        }
    }

    /// Renders one image and measures it; takes it into the mean if it is of the last row.
    fn sample(
        &mut self,
        args: &BenchArgs,
        seed: u32,
        budget: Budget,
        folder: &Path,
        reference: &Reference,
        last: bool,
    ) -> Result<Sample> {
        let (path, process_seconds) = self.render(args, seed, budget, folder)?;
        let image = read_exr(&path)?;
        let radiance = image.rgb().ok_or_else(|| Error::input(&path, "has no channels R, G, B"))?;
        if (image.width, image.height) != args.resolution {
            return Err(Error::Usage(format!("side {} renders {}x{}", self.label, image.width, image.height)));
        }
        if has_pixel_without_sample(&image) {
            return Err(too_short(budget));
        }
        let (spp, render_seconds) = (self.number("/spp")?, self.number("/seconds/render")?);
        if last {
            self.mean.add(&radiance, spp);
        }
        Ok(Sample { spp, render_seconds, process_seconds, mse: reference.errors_of(&radiance).mse })
    }

    /// A number of the last report.
    fn number(&self, pointer: &str) -> Result<f64> {
        self.report.pointer(pointer).and_then(Value::as_f64).ok_or_else(|| {
            Error::input(&self.program, format!("side {}: its report lacks the number {pointer}", self.label))
        })
    }
}

fn has_pixel_without_sample(image: &ExrImage) -> bool {
    matches!(image.values(SAMPLES_CHANNEL), Some(ChannelValues::U32(counts)) if counts.contains(&0))
}

fn finish(
    args: &BenchArgs,
    reference: &Reference,
    sides: [Side; 2],
    rows: &[Vec<Pair>],
    interrupted: bool,
) -> anyhow::Result<()> {
    let comparison = Comparison::of(rows, reference.about.common_error());
    let described: Vec<(Value, BiasVerdict)> = sides
        .into_iter()
        .map(|side| {
            let verdict = find_bias(&side.mean.finish(), &reference.image);
            let value = json!({
                "program": side.program.display().to_string(),
                "flags": side.flags,
                "device": side.report["device"],
                "driver": side.report["driver"],
                "kernel_key": side.report["kernel_key"],
                "bias": verdict,
            });
            (value, verdict)
        })
        .collect();
    let [(a, a_bias), (b, b_bias)] = [&described[0], &described[1]];
    let of_rows = args
        .rows()
        .into_iter()
        .zip(rows)
        .zip(&comparison.rows)
        .map(|((budget, pairs), ratios)| json!({ "budget": budget.to_string(), "pairs": pairs, "ratios": ratios }));
    let value = json!({
        "scene": args.scene,
        "resolution": [args.resolution.0, args.resolution.1],
        "processor": processor_name(),
        "reference": reference.about,
        "interrupted": interrupted,
        "a": a,
        "b": b,
        "rows": of_rows.collect::<Vec<_>>(),
        "ratios": comparison.overall,
        "verdict": comparison.overall.verdict(),
    });
    if !args.quiet {
        print(args, &value, &comparison, [a_bias, b_bias]);
    }
    if let Some(folder) = &args.output {
        write_json(&folder.join(format!("{}-compare.json", scene_name(&args.scene))), &value)?;
    }
    if args.json {
        print_json(&value)?;
    }
    if interrupted {
        return Err(Error::Interrupted.into());
    }
    if args.strict && (a_bias.biased || b_bias.biased) {
        return Err(Error::Untrustworthy("--strict: a side is biased".to_owned()).into());
    }
    Ok(())
}
