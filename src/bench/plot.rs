//! The log-log plot of error against time, as SVG and as PNG.

use std::io::Write;
use std::ops::Range;
use std::path::Path;
use std::sync::Once;

use plotters::coord::Shift;
use plotters::prelude::*;
use plotters::style::{FontStyle, register_font};

use super::measure::Measurement;
use crate::atomic_file::write_atomically;
use crate::film::png::write_png;
use crate::{Error, Result};

const SIZE: (u32, u32) = (960, 640);
/// Okabe and Ito's blue and vermilion, which the colour-blind can tell apart.
const POINTS: RGBColor = RGBColor(0, 114, 178);
const LINE: RGBColor = RGBColor(213, 94, 0);

/// A format that a plot can be written in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PlotFormat {
    /// Vectors.
    Svg,
    /// Pixels.
    Png,
}

impl PlotFormat {
    /// The format that a file name asks for.
    ///
    /// # Errors
    /// [`Error::Usage`] if the extension is neither `.svg` nor `.png`.
    pub fn of(path: &Path) -> Result<Self> {
        let extension = path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase());
        match extension.as_deref() {
            Some("svg") => Ok(Self::Svg),
            Some("png") => Ok(Self::Png),
            _ => Err(Error::Usage(format!(
                "plot '{}': its extension names no format of a plot; use .svg or .png",
                path.display()
            ))),
        }
    }
}

/// Draws a measurement to a file in the format of its extension.
///
/// # Errors
/// [`Error::Usage`] if that is none; [`Error::Input`] if nothing can be drawn: no MSE is above the reference's noise;
/// [`Error::Io`] if the file cannot be written.
pub fn draw(measurement: &Measurement, title: &str, path: &Path) -> Result<()> {
    register_fonts();
    let failed = |message: String| Error::input(path, message);
    match PlotFormat::of(path)? {
        PlotFormat::Svg => {
            let mut text = String::new();
            draw_on(&SVGBackend::with_string(&mut text, SIZE).into_drawing_area(), measurement, title)
                .map_err(failed)?;
            write_atomically(path, |file| file.write_all(text.as_bytes()))
        }
        PlotFormat::Png => {
            let mut bytes = vec![0; 3 * SIZE.0 as usize * SIZE.1 as usize];
            draw_on(&BitMapBackend::with_buffer(&mut bytes, SIZE).into_drawing_area(), measurement, title)
                .map_err(failed)?;
            let pixels: Vec<[u8; 3]> = bytes.chunks_exact(3).map(|rgb| [rgb[0], rgb[1], rgb[2]]).collect();
            write_png(path, SIZE.0, SIZE.1, &pixels)
        }
    }
}

/// Whether there is anything to draw.
pub fn can_draw(measurement: &Measurement) -> bool {
    !marks(measurement).is_empty()
}

/// The font is part of the binary, so that a machine without fonts draws the same.
fn register_fonts() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        if register_font("sans-serif", FontStyle::Normal, dejavu::sans::regular()).is_err() {
            tracing::warn!("the plot's font cannot be read");
        }
    });
}

/// One point with the ends of its error bar, ± 1 standard error; the lower end is `None` if it has no logarithm.
struct Mark {
    seconds: f64,
    mse: f64,
    low: Option<f64>,
    high: f64,
    spp: String,
}

fn marks(measurement: &Measurement) -> Vec<Mark> {
    let above_zero = measurement.points.iter().filter(|point| point.mse.mean > 0.0);
    above_zero
        .map(|point| Mark {
            seconds: point.seconds.mean,
            mse: point.mse.mean,
            low: Some(point.mse.mean - point.mse.standard_error).filter(|low| *low > 0.0),
            // One seed has no standard error; `max` passes over its NaN.
            high: (point.mse.mean + point.mse.standard_error).max(point.mse.mean),
            spp: point.spp_label(),
        })
        .collect()
}

fn draw_on<B: DrawingBackend>(
    area: &DrawingArea<B, Shift>,
    measurement: &Measurement,
    title: &str,
) -> std::result::Result<(), String> {
    let marks = marks(measurement);
    if marks.is_empty() {
        return Err("there is nothing to plot: no MSE is above the reference's noise".to_owned());
    }
    let x = range(marks.iter().map(|mark| mark.seconds));
    let y = range(marks.iter().flat_map(|mark| [mark.low.unwrap_or(mark.mse), mark.high]));
    draw_chart(area, measurement, title, &marks, (x, y)).map_err(|error| error.to_string())
}

fn draw_chart<B: DrawingBackend>(
    area: &DrawingArea<B, Shift>,
    measurement: &Measurement,
    title: &str,
    marks: &[Mark],
    (x, y): (Range<f64>, Range<f64>),
) -> std::result::Result<(), DrawingAreaErrorKind<B::ErrorType>> {
    area.fill(&WHITE)?;
    let mut chart = ChartBuilder::on(area)
        .caption(title, ("sans-serif", 22))
        .margin(16)
        .x_label_area_size(48)
        .y_label_area_size(84)
        .build_cartesian_2d(
            x.clone().log_scale().with_key_points(ticks(&x)),
            y.clone().log_scale().with_key_points(ticks(&y)),
        )?;
    chart
        .configure_mesh()
        .x_desc("render time in seconds")
        .y_desc("MSE without the reference's noise")
        .label_style(("sans-serif", 15))
        .bold_line_style(RGBColor(225, 225, 225))
        .x_label_formatter(&label)
        .y_label_formatter(&label)
        .draw()?;
    if let Some(law) = &measurement.mse_over_seconds {
        let (first, last) = (marks[0].seconds, marks[marks.len() - 1].seconds);
        let slope = law.slope;
        let label = format!("slope {:.3} ({:.3} to {:.3})", slope.estimate, slope.low, slope.high);
        let line = [first, last].map(|seconds| (seconds, law.at(seconds)));
        chart
            .draw_series(LineSeries::new(line, LINE.stroke_width(2)))?
            .label(label)
            .legend(|(x, y)| PathElement::new([(x, y), (x + 18, y)], LINE.stroke_width(2)));
    }
    let bars = marks.iter().map(|mark| {
        let low = mark.low.unwrap_or(mark.mse);
        ErrorBar::new_vertical(mark.seconds, low, mark.mse, mark.high, POINTS.filled(), 9)
    });
    chart
        .draw_series(bars)?
        .label(format!("mean of {} seeds ± 1 standard error", measurement.points[0].runs.len()))
        .legend(|(x, y)| Circle::new((x + 9, y), 4, POINTS.filled()));
    chart.draw_series(marks.iter().map(|mark| {
        EmptyElement::at((mark.seconds, mark.mse))
            + Text::new(format!("{} spp", mark.spp), (10, -18), ("sans-serif", 14))
    }))?;
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::UpperRight)
        .margin(14)
        .background_style(WHITE.mix(0.9))
        .border_style(RGBColor(200, 200, 200))
        .label_font(("sans-serif", 15))
        .draw()?;
    area.present()
}

/// The values with a margin of a factor, so that marks and their labels stay inside.
fn range(values: impl Iterator<Item = f64>) -> Range<f64> {
    let (low, high) = values.fold((f64::INFINITY, 0.0_f64), |(low, high), value| (low.min(value), high.max(value)));
    low / 1.4..high * 1.8
}

/// 1, 2 and 5 times the powers of ten in a range.
fn ticks(range: &Range<f64>) -> Vec<f64> {
    let decades = range.start.log10().floor() as i32..=range.end.log10().ceil() as i32;
    let values = decades.flat_map(|decade| [1.0, 2.0, 5.0].map(|digit| digit * 10_f64.powi(decade)));
    values.filter(|value| range.contains(value)).collect()
}

fn label(value: &f64) -> String {
    if (0.01..1e4).contains(value) {
        // Powers of ten carry rounding in their last digits.
        format!("{}", (value * 1e3).round() / 1e3)
    } else {
        format!("{value:.0e}")
    }
}
