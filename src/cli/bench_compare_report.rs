//! What `sunfleck bench --compare` says to people.

use serde_json::Value;
use sunfleck::bench::bias::BiasVerdict;
use sunfleck::bench::pairs::{Comparison, Ratios};
use sunfleck::bench::statistics::Interval;

use super::bench::{BenchArgs, scene_name};
use super::bench_report::{bias, heading};

/// Prints a comparison on standard error; `value` is what `--json` prints.
pub(super) fn print(args: &BenchArgs, value: &Value, comparison: &Comparison, biases: [&BiasVerdict; 2]) {
    let text = |value: &Value| value.as_str().unwrap_or("not known").to_owned();
    let pairs = value["rows"][0]["pairs"].as_array().map_or(0, Vec::len);
    eprintln!("{}, {pairs} pairs in each row", heading(args, &scene_name(&args.scene)));
    eprintln!("  processor  {}", text(&value["processor"]));
    eprintln!("  reference  {}", text(&value["reference"]["description"]));
    for (side, verdict) in ["a", "b"].into_iter().zip(biases) {
        let flags: Vec<_> = value[side]["flags"].as_array().into_iter().flatten().map(text).collect();
        eprintln!("  {}          {} {}", side.to_uppercase(), text(&value[side]["program"]), flags.join(" "));
        eprintln!("             {}, {}", text(&value[side]["device"]), text(&value[side]["driver"]));
        eprintln!("             kernel {}", text(&value[side]["kernel_key"]));
        eprintln!("             {}", bias(Some(verdict)));
    }
    let (render, process, mse, efficiency) = ("render time", "process time", "MSE", "efficiency");
    eprintln!("\n  B over A, 95 % interval\n  {:<9}  {render:<22}  {process:<22}  {mse:<22}  {efficiency}", "");
    for (budget, ratios) in args.rows().iter().zip(&comparison.rows) {
        eprintln!("{}", row(&budget.to_string(), ratios));
    }
    if comparison.rows.len() > 1 {
        eprintln!("{}", row("overall", &comparison.overall));
    }
    eprintln!("  {}", comparison.overall.verdict());
}

fn row(name: &str, ratios: &Ratios) -> String {
    let [render, process, mse, efficiency] =
        [ratios.render_seconds, ratios.process_seconds, ratios.mse, ratios.efficiency].map(interval);
    format!("  {name:>9}  {render:<22}  {process:<22}  {mse:<22}  {efficiency}")
}

fn interval(ratio: Option<Interval>) -> String {
    ratio.map_or("not known".to_owned(), |r| format!("{:.3} ({:.3} to {:.3})", r.estimate, r.low, r.high))
}
