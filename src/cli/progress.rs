//! Progress on standard error: a bar with ETA and samples per second on a terminal, a line now and then elsewhere.

use std::io::IsTerminal;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};
use sunfleck::render::ProgressUpdate;

/// Time between two lines where there is no terminal: a log of an hour stays readable.
const LINE_INTERVAL: Duration = Duration::from_secs(15);
/// Steps of the bar.
const STEPS: u64 = 10_000;

/// Shows how a render goes on.
pub(crate) enum Progress {
    /// Nothing (`--quiet`).
    Silent,
    /// A bar.
    Bar(ProgressBar),
    /// Lines; when the last one was printed.
    Lines(Instant),
}

impl Progress {
    /// The kind that fits standard error.
    pub(crate) fn new(quiet: bool) -> Self {
        if quiet {
            return Self::Silent;
        }
        if !std::io::stderr().is_terminal() {
            return Self::Lines(Instant::now());
        }
        let bar = ProgressBar::new(STEPS);
        if let Ok(style) = ProgressStyle::with_template("{bar:32} {percent:>3} %  {msg}") {
            bar.set_style(style);
        }
        Self::Bar(bar)
    }

    /// Shows one update.
    pub(crate) fn show(&mut self, update: &ProgressUpdate) {
        match self {
            Self::Silent => {}
            Self::Bar(bar) => {
                bar.set_position((update.fraction() * STEPS as f64) as u64);
                bar.set_message(describe(update));
            }
            Self::Lines(last) if last.elapsed() >= LINE_INTERVAL => {
                *last = Instant::now();
                eprintln!("{:3.0} %  {}", 100.0 * update.fraction(), describe(update));
            }
            Self::Lines(_) => {}
        }
    }

    /// Takes the bar away.
    pub(crate) fn finish(self) {
        if let Self::Bar(bar) = self {
            bar.finish_and_clear();
        }
    }
}

fn describe(update: &ProgressUpdate) -> String {
    let eta = update.remaining().map_or("?".to_owned(), |left| time(left.as_secs_f64()));
    format!(
        "{} samples/s, {} gone, {} to go",
        with_prefix(update.samples_per_second()),
        time(update.elapsed.as_secs_f64()),
        eta
    )
}

/// Seconds as people read them: `0.42 s`, `12 s`, `3 min 20 s`, `2 h 05 min`.
pub(crate) fn time(seconds: f64) -> String {
    let whole = seconds.round() as u64;
    match whole {
        0..10 => format!("{seconds:.2} s"),
        10..60 => format!("{whole} s"),
        60..3600 => format!("{} min {:02} s", whole / 60, whole % 60),
        _ => format!("{} h {:02} min", whole / 3600, whole / 60 % 60),
    }
}

/// A number with a metric prefix and three digits: `1.23 M`.
pub(crate) fn with_prefix(number: f64) -> String {
    let prefixes = [(1e12, "T"), (1e9, "G"), (1e6, "M"), (1e3, "k")];
    match prefixes.iter().find(|(factor, _)| number >= *factor) {
        Some((factor, prefix)) => format!("{:.2} {prefix}", number / factor),
        None => format!("{number:.0} "),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_and_rates_read_well() {
        let times = [0.123, 9.4, 12.0, 59.7, 200.0, 7500.0].map(time);
        assert_eq!(times, ["0.12 s", "9.40 s", "12 s", "1 min 00 s", "3 min 20 s", "2 h 05 min"]);
        assert_eq!([12.0, 1234.0, 5.6e7].map(with_prefix), ["12 ", "1.23 k", "56.00 M"]);
    }
}
