//! What `sunfleck bench` says to people: the table and the lines around it.

use std::fmt::Write;

use sunfleck::bench::bias::BiasVerdict;
use sunfleck::bench::measure::{Measurement, Point};
use sunfleck::bench::statistics::{PowerLaw, Summary};

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
    let _ = writeln!(out);
    let _ = writeln!(out, "  MSE over spp   {}", slope(m.mse_over_spp.as_ref()));
    let _ = writeln!(out, "  MSE over time  {}", slope(m.mse_over_seconds.as_ref()));
    let _ = writeln!(out, "  bias           {}", bias(&m.bias));
    if m.non_finite_samples > 0 {
        let _ = writeln!(out, "warning: {} samples were NaN or infinite; each is a bug", m.non_finite_samples);
    }
    out
}

fn header() -> String {
    format!("{:>7} {:>18} {:>23} {:>23} {:>19} {:>11}", "spp", "seconds", "MSE", "relMSE", "FLIP", "1/(MSE s)")
}

fn row(point: &Point) -> String {
    let plain = |s: &Summary| format!("{:.4} ± {:.4}", s.mean, s.standard_error);
    let scientific = |s: &Summary| format!("{:.3e} ± {:.1e}", s.mean, s.standard_error);
    format!(
        "{:>7} {:>18} {:>23} {:>23} {:>19} {:>11.4e}",
        point.spp,
        plain(&point.seconds),
        scientific(&point.mse),
        scientific(&point.rel_mse),
        point.flip.as_ref().map_or("too large".to_owned(), plain),
        point.efficiency
    )
}

fn slope(law: Option<&PowerLaw>) -> String {
    law.map_or(
        "no power law: an MSE is not above the reference's noise, or there is one count only".to_owned(),
        |law| {
            let slope = law.slope;
            format!("slope {:.4}, 95 % interval {:.4} to {:.4}", slope.estimate, slope.low, slope.high)
        },
    )
}

/// The verdict in words.
pub(super) fn bias(bias: &BiasVerdict) -> String {
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
