//! What `sunfleck bench` says to people: the table and the lines around it.

use std::fmt::Write;

use sunfleck::bench::bias::BiasVerdict;
use sunfleck::bench::measure::Measurement;
use sunfleck::bench::point::Point;
use sunfleck::bench::power_law::PowerLaw;
use sunfleck::bench::statistics::Summary;

use super::bench::BenchArgs;
use super::progress::time;

/// Scene, resolution and flags in one line.
pub(super) fn heading(args: &BenchArgs, name: &str) -> String {
    let (width, height) = args.resolution;
    let flags = args.estimator.render_flags().join(" ");
    format!("{name}, {width}x{height}{}{flags}", if flags.is_empty() { "" } else { ", " })
}

/// Prints a measurement on standard error.
pub(super) fn print_measurement(heading: &str, measurement: &Measurement, start_up_seconds: f64) {
    eprint!("{}", text(heading, measurement, start_up_seconds));
}

/// A measurement as text.
pub(super) fn text(heading: &str, m: &Measurement, start_up_seconds: f64) -> String {
    let mut out = String::new();
    let reference = &m.reference;
    let _ = writeln!(out, "{heading}");
    let _ = writeln!(out, "  device     {}; {}", m.device_reason, m.driver);
    let _ = writeln!(out, "  processor  {}", m.processor.as_deref().unwrap_or("its name is not known here"));
    let _ = writeln!(out, "  kernel     {}", m.kernel_key);
    let _ = writeln!(out, "  reference  {}", reference.description);
    let _ = writeln!(out, "             {}; MSE of its noise {:.3e}", reference.noise, reference.noise_mse);
    if let Some(error) = reference.mse_standard_error {
        let _ = writeln!(out, "             which shifts all MSEs below alike, by a standard error of {error:.1e}");
    }
    let s = &m.seconds;
    let _ = writeln!(
        out,
        "  seconds    start-up {start_up_seconds:.3}, load {:.3}, prepare {:.3}, compile {:.3}, upload {:.3}, render {:.3}",
        s.load, s.prepare, s.compile, s.upload, s.render
    );
    let _ = writeln!(out);
    let _ = writeln!(out, "{}", header());
    for point in &m.points {
        let _ = writeln!(out, "{}", row(point));
    }
    if m.points.iter().any(is_at_noise) {
        let _ = writeln!(out, "  * the mean MSE is not safely above the reference's noise: left out of the slopes");
    }
    if m.interrupted {
        let seeds = m.points.first().map_or(0, |point| point.runs.len());
        let _ = writeln!(out, "  interrupted: of {seeds} seed{}", if seeds == 1 { "" } else { "s" });
    }
    let _ = writeln!(out);
    let _ = writeln!(out, "  MSE over spp   {}", slope(m.mse_over_spp.as_ref()));
    let _ = writeln!(out, "  MSE over time  {}", slope(m.mse_over_seconds.as_ref()));
    let _ = writeln!(out, "  bias           {}", bias(m.bias.as_ref()));
    if reference_is_short(m) {
        let _ = writeln!(
            out,
            "note: the reference has fewer samples than the last row's images together: rare paths that it lacks look like bias"
        );
    }
    if m.non_finite_samples > 0 {
        let _ = writeln!(out, "warning: {} samples were NaN or infinite; each is a bug", m.non_finite_samples);
    }
    out
}

/// The bias test takes means as normal, and the mean of fewer samples is further from that.
fn reference_is_short(m: &Measurement) -> bool {
    m.points.last().is_some_and(|last| m.reference.spp.is_some_and(|spp| spp < last.spp * last.runs.len() as f64))
}

fn header() -> String {
    format!("{:>8} {:>18} {:>23} {:>23} {:>19} {:>21}", "spp", "seconds", "MSE", "relMSE", "FLIP", "1/(MSE s)")
}

fn row(point: &Point) -> String {
    format!(
        "{:>8} {:>18} {:>23} {:>23} {:>19} {:>21}{}",
        point.spp_label(),
        plain(&point.seconds),
        scientific(&point.mse),
        scientific(&point.rel_mse),
        point.flip.as_ref().map_or("too large".to_owned(), plain),
        efficiency(point),
        if is_at_noise(point) { " *" } else { "" },
    )
}

/// A single seed does not tell.
fn is_at_noise(point: &Point) -> bool {
    !point.in_fit && point.runs.len() > 1
}

fn plain(summary: &Summary) -> String {
    with_error(summary, |value| format!("{value:.4}"), |error| format!("{error:.4}"))
}

fn scientific(summary: &Summary) -> String {
    with_error(summary, |value| format!("{value:.3e}"), |error| format!("{error:.1e}"))
}

/// A single seed has no standard error.
fn with_error(summary: &Summary, value: fn(f64) -> String, error: fn(f64) -> String) -> String {
    let value = value(summary.mean);
    if summary.standard_error.is_nan() { value } else { format!("{value} ± {}", error(summary.standard_error)) }
}

/// Efficiency with its standard error, if there is one.
pub(super) fn efficiency(point: &Point) -> String {
    point.efficiency.map_or("–".to_owned(), |e| format!("{:.3e} ± {:.1e}", e.estimate, e.standard_error))
}

fn slope(law: Option<&PowerLaw>) -> String {
    law.map_or(
        "no power law: fewer than two rows, or two seeds, with an MSE above the reference's noise".to_owned(),
        |law| {
            let slope = law.slope;
            format!("slope {:.4}, 95 % interval {:.4} to {:.4}", slope.estimate, slope.low, slope.high)
        },
    )
}

/// The verdict in words.
pub(super) fn bias(bias: Option<&BiasVerdict>) -> String {
    let Some(bias) = bias else { return "not known: that takes two seeds".to_owned() };
    let skipped = match bias.skipped_pixels {
        0 => String::new(),
        count => format!("; {count} pixels that are not finite are left out"),
    };
    let region = bias.worst;
    let channel = ["red", "green", "blue"][region.channel];
    if bias.biased {
        let place = region.tile.map_or("the whole image".to_owned(), |[x, y]| format!("tile at ({x}, {y})"));
        return format!(
            "biased, {place}: {channel} {:.5} against {:.5}, p = {:.1e}; {} of {} tests fail{skipped}",
            region.mean, region.reference, region.p_value, bias.failures, bias.tests
        );
    }
    format!(
        "no bias seen; one above {:.3} % of the mean would have been ({:.2} % in a tile of 8x8){skipped}",
        100.0 * bias.detectable_image,
        100.0 * bias.detectable_tile
    )
}

/// Seconds for people.
pub(super) fn seconds(summary: &Summary) -> String {
    time(summary.mean)
}
