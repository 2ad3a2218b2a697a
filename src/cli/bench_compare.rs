//! `sunfleck bench --compare`: two builds or two settings in alternation, each image by a process of its own, so that
//! both sides are treated alike and start-up counts too.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Instant;

use serde_json::{Value, json};
use sunfleck::bench::bias::{BiasVerdict, find_bias};
use sunfleck::bench::mean_image::ImageAccumulator;
use sunfleck::bench::measure::{processor_name, reference_of};
use sunfleck::bench::pairs::{Pair, Ratios, Sample, a_first};
use sunfleck::bench::reference::Reference;
use sunfleck::bench::statistics::Interval;
use sunfleck::film::exr::read_exr;
use sunfleck::{Error, Result};

use super::bench::{BenchArgs, Ready, scene_name, write_json};
use super::bench_report::{bias, heading};
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
        side.render(args, args.estimator.seed, folder.path())?;
    }
    let reference = reference(args, &ready)?;
    let mut pairs = Vec::new();
    for n in 0..args.seeds {
        let seed = args.estimator.seed.wrapping_add(n);
        let [a, b] = &mut sides;
        let sample = |side: &mut Side| side.sample(args, seed, folder.path(), &reference);
        let (a, b) = if a_first(n as usize) {
            let a = sample(a)?;
            (a, sample(b)?)
        } else {
            let b = sample(b)?;
            (sample(a)?, b)
        };
        pairs.push(Pair { seed, a, b });
        if !args.quiet {
            eprintln!(
                "pair {} of {}: render {:.3} s and {:.3} s",
                n + 1,
                args.seeds,
                a.render_seconds,
                b.render_seconds
            );
        }
    }
    finish(args, &reference, sides, &pairs)
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
    fn render(&mut self, args: &BenchArgs, seed: u32, folder: &Path) -> Result<(PathBuf, f64)> {
        let image = folder.join(format!("{}.exr", self.label));
        let (width, height) = args.resolution;
        let mut command = Command::new(&self.program);
        command.args(["render", &args.scene, "--json", "--quiet", "-o"]).arg(&image);
        command.arg(format!("--resolution={width}x{height}"));
        command.args([format!("--spp={}", args.max_spp()), format!("--seed={seed}")]);
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

    fn sample(&mut self, args: &BenchArgs, seed: u32, folder: &Path, reference: &Reference) -> Result<Sample> {
        let (path, process_seconds) = self.render(args, seed, folder)?;
        let image = read_exr(&path)?;
        let radiance = image.rgb().ok_or_else(|| Error::input(&path, "has no channels R, G, B"))?;
        if (image.width, image.height) != args.resolution {
            return Err(Error::Usage(format!("side {} renders {}x{}", self.label, image.width, image.height)));
        }
        self.mean.add(&radiance);
        let render_seconds = self.report["seconds"]["render"].as_f64().ok_or_else(|| {
            Error::input(&self.program, format!("side {}: its report lacks seconds.render", self.label))
        })?;
        Ok(Sample { render_seconds, process_seconds, mse: reference.errors_of(&radiance).mse })
    }
}

fn finish(args: &BenchArgs, reference: &Reference, sides: [Side; 2], pairs: &[Pair]) -> anyhow::Result<()> {
    let ratios = Ratios::of(pairs);
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
    let value = json!({
        "scene": args.scene,
        "resolution": [args.resolution.0, args.resolution.1],
        "spp": args.max_spp(),
        "processor": processor_name(),
        "reference": reference.about,
        "a": a,
        "b": b,
        "pairs": pairs,
        "ratios": ratios,
        "verdict": ratios.verdict(),
    });
    if !args.quiet {
        print(args, &value, &ratios, [a_bias, b_bias]);
    }
    if let Some(folder) = &args.output {
        write_json(&folder.join(format!("{}-compare.json", scene_name(&args.scene))), &value)?;
    }
    if args.json {
        print_json(&value)?;
    }
    if args.strict && (a_bias.biased || b_bias.biased) {
        return Err(Error::Untrustworthy("--strict: a side is biased".to_owned()).into());
    }
    Ok(())
}

fn print(args: &BenchArgs, value: &Value, ratios: &Ratios, biases: [&BiasVerdict; 2]) {
    let text = |value: &Value| value.as_str().unwrap_or("not known").to_owned();
    eprintln!("{}, {} spp, {} pairs", heading(args, &scene_name(&args.scene)), args.max_spp(), args.seeds);
    eprintln!("  processor  {}", text(&value["processor"]));
    eprintln!("  reference  {}", text(&value["reference"]["description"]));
    for (side, verdict) in ["a", "b"].into_iter().zip(biases) {
        let flags: Vec<_> = value[side]["flags"].as_array().into_iter().flatten().map(text).collect();
        eprintln!("  {}          {} {}", side.to_uppercase(), text(&value[side]["program"]), flags.join(" "));
        eprintln!("             {}, {}", text(&value[side]["device"]), text(&value[side]["driver"]));
        eprintln!("             kernel {}", text(&value[side]["kernel_key"]));
        eprintln!("             {}", bias(verdict));
    }
    eprintln!("\n  B over A, 95 % interval");
    for (name, ratio) in [
        ("render time", ratios.render_seconds),
        ("process time", ratios.process_seconds),
        ("MSE", ratios.mse),
        ("efficiency", ratios.efficiency),
    ] {
        eprintln!("  {name:<13} {}", ratio.map_or("not known".to_owned(), interval));
    }
    eprintln!("  {}", ratios.verdict());
}

fn interval(ratio: Interval) -> String {
    format!("{:.4}  ({:.4} to {:.4})", ratio.estimate, ratio.low, ratio.high)
}
