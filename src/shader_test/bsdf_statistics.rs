//! The statistical checks of a BSDF: `integral`, `chi2`, `furnace`.

use glam::DVec3;
use serde_json::json;

use super::bsdf_expectations::{Albedo, Term};
use super::configuration::{Configuration, Grid};
use super::measure::Measurement;
use super::report::{CheckReport, Level, error_text, number, p_of_excess, p_text, within, worst};

/// A configuration with what was measured of it.
pub(super) type Measured<'a> = (&'a Configuration, &'a Measurement);

/// The density integrates to one, less what is absorbed and what goes to delta lobes.
pub(super) fn integral(name: &str, all: &[Measured<'_>], tolerance: f64, significance: f64) -> CheckReport {
    let level = Level::new(significance, all.len());
    let total = |m: &Measurement| {
        let elsewhere = f64::from(m.absorbed + m.deltas) / f64::from(m.samples);
        let standard_error = (elsewhere * (1.0 - elsewhere) / f64::from(m.samples)).sqrt();
        (m.density[0] + elsewhere, standard_error)
    };
    let p = |m: &Measurement| {
        let (total, standard_error) = total(m);
        if m.fault.is_some() || !within(m.density[1], tolerance) {
            0.0
        } else {
            p_of_excess(total - 1.0, tolerance, standard_error)
        }
    };
    let told = |m: &Measurement| {
        let (total, standard_error) = total(m);
        let share = |count| f64::from(count) / f64::from(m.samples);
        let parts =
            format!("∫ pdf {:.6}, absorbed {:.5}, delta lobes {:.5}", m.density[0], share(m.absorbed), share(m.deltas));
        format!("{total:.6} ± {} ({parts})", error_text(standard_error))
    };
    let failed = |(_, m): &&Measured<'_>| p(m) < level.each;
    let failure = |(c, m): &Measured<'_>| {
        let reason = if let Some(fault) = &m.fault {
            fault.clone()
        } else if !within(m.density[1], tolerance) {
            format!(
                "the density is too uneven to be integrated: {} with an error of up to {:.1e}",
                told(m),
                m.density[1]
            )
        } else {
            format!("expected 1 ± {tolerance}, got {}, {}", told(m), p_text(p(m)))
        };
        format!("{}: {reason}", c.label)
    };
    let failures = all.iter().filter(failed).map(failure).collect();
    let (c, m) = all[worst(all.iter().map(|(_, m)| -(total(m).0 - 1.0).abs()))];
    let summary = format!("expected 1 ± {tolerance}; furthest: {} at {}; {}", told(m), c.label, level.told(all.len()));
    let (total, standard_error) = total(m);
    let numbers = json!({
        "configurations": all.len(), "expected": 1.0, "tolerance": tolerance, "got": total,
        "standard_error": standard_error, "density": m.density[0], "quadrature_error": m.density[1],
        "p_value": p(m), "significance": level.all, "threshold": level.each, "at": c.label,
    });
    CheckReport::new("integral", name, summary, failures, numbers)
}

/// Samples follow the density.
pub(super) fn chi_square(name: &str, all: &[Measured<'_>], significance: f64) -> CheckReport {
    let level = Level::new(significance, all.len());
    let p = |m: &Measurement| if m.fault.is_some() { 0.0 } else { m.chi_square.p_value };
    let told = |m: &Measurement| {
        let test = &m.chi_square;
        format!("χ² = {:.1} of {} degrees of freedom, {}", test.statistic, test.degrees_of_freedom, p_text(p(m)))
    };
    let failure = |(c, m): &Measured<'_>| match (&m.fault, &m.worst_bin) {
        (Some(fault), _) => format!("{}: {fault}", c.label),
        (None, Some((cell, observed, expected))) => {
            let place = cell.center();
            let degrees = place.y.clamp(-1.0, 1.0).acos().to_degrees();
            format!(
                "{}: {}; worst bin {degrees:.1}° from the normal, around ({:.3}, {:.3}, {:.3}): {observed} samples, \
                 {expected:.1} expected",
                c.label,
                told(m),
                place.x,
                place.y,
                place.z
            )
        }
        (None, None) => format!("{}: {}", c.label, told(m)),
    };
    let failures = all.iter().filter(|(_, m)| p(m) < level.each).map(failure).collect();
    let (c, m) = all[worst(all.iter().map(|(_, m)| p(m)))];
    let summary = format!("{} samples each; lowest: {} at {}; {}", m.samples, told(m), c.label, level.told(all.len()));
    let numbers = json!({
        "configurations": all.len(), "samples": m.samples, "statistic": m.chi_square.statistic,
        "degrees_of_freedom": m.chi_square.degrees_of_freedom, "p_value": p(m), "significance": level.all,
        "threshold": level.each, "at": c.label,
    });
    CheckReport::new("chi2", name, summary, failures, numbers)
}

/// What is given back of white light: by quadrature, and by the mean weight of the samples.
pub(super) fn furnace(
    name: &str,
    grid: &Grid,
    all: &[Measured<'_>],
    albedo: &Albedo,
    tolerance: f64,
    significance: f64,
) -> CheckReport {
    // Each channel is held against what is expected, and against the integral.
    let level = Level::new(significance, 6 * all.len());
    let (terms, exact) = match albedo {
        Albedo::Equals(terms) => (terms, true),
        Albedo::AtMost(terms) => (terms, false),
    };
    let one = |(c, m): &Measured<'_>| -> Vec<Channel> {
        let channel = |k: usize| Channel {
            expected: value_of(&terms[k], grid, c),
            exact,
            samples: m.mean_weight[k].mean,
            standard_error: m.mean_weight[k].standard_error,
            integral: (m.deltas == 0).then(|| (m.albedo[0][k], m.albedo[1][k])),
            tolerance,
        };
        (0..3).map(channel).collect()
    };
    let channels: Vec<Vec<Channel>> = all.iter().map(one).collect();
    let mut failures = Vec::new();
    for ((c, m), channels) in all.iter().zip(&channels) {
        if let Some(fault) = &m.fault {
            failures.push(format!("{}: {fault}", c.label));
        } else if let Some(wrong) = channels.iter().zip(["red", "green", "blue"]).find_map(|(channel, color)| {
            channel.wrong(level.each).map(|wrong| format!("{}, {color}: {wrong}", c.label))
        }) {
            failures.push(wrong);
        }
    }
    let flat: Vec<(usize, &Channel)> =
        channels.iter().enumerate().flat_map(|(i, c)| c.iter().map(move |c| (i, c))).collect();
    let wrong = flat.iter().filter(|(_, channel)| channel.wrong(level.each).is_some());
    let most_wrong = wrong.max_by(|(_, a), (_, b)| a.offence().total_cmp(&b.offence()));
    let furthest = || flat[worst(flat.iter().map(|(_, channel)| -channel.excess()))];
    let (index, channel) = most_wrong.copied().unwrap_or_else(furthest);
    let expected = if exact {
        format!("{} ± {tolerance}", number(channel.expected))
    } else {
        format!("at most {}", number(channel.expected))
    };
    let at = &all[index].0.label;
    let summary = format!("expected {expected}; furthest: {} at {at}; {}", channel.told(), level.told(6 * all.len()));
    let numbers = json!({
        "configurations": all.len(), "expected": channel.expected, "exact": exact, "tolerance": tolerance,
        "got": channel.samples, "standard_error": channel.standard_error,
        "integral": channel.integral.map(|(value, _)| value),
        "p_value": channel.p(), "significance": level.all, "threshold": level.each, "at": at,
    });
    CheckReport::new("furnace", name, summary, failures, numbers)
}

fn value_of(term: &Term, grid: &Grid, configuration: &Configuration) -> f64 {
    match term {
        Term::Number(number) => *number,
        Term::Parameter(name) => {
            grid.index(name).and_then(|i| configuration.parameters.get(i)).map_or(f64::NAN, |value| f64::from(*value))
        }
    }
}

/// A colour channel of a furnace.
struct Channel {
    expected: f64,
    exact: bool,
    /// The mean weight, with its standard error.
    samples: f64,
    standard_error: f64,
    /// ∫ f·|cos| and its error; not where delta lobes give back light too.
    integral: Option<(f64, f64)>,
    tolerance: f64,
}

impl Channel {
    /// By how much more light comes back than may (or, where it is known, other light than should).
    fn excess(&self) -> f64 {
        let over = |got: f64| if self.exact { (got - self.expected).abs() } else { got - self.expected };
        self.integral.map_or(over(self.samples), |(value, _)| over(value).max(over(self.samples)))
    }

    /// By how much it is off, where something is wrong with it: the two ways to measure count too.
    fn offence(&self) -> f64 {
        let apart = self.integral.map_or(0.0, |(value, _)| (value - self.samples).abs());
        self.excess().max(apart)
    }

    fn p(&self) -> f64 {
        let deviation = self.samples - self.expected;
        let deviation = if self.exact { deviation } else { deviation.max(0.0) };
        p_of_excess(deviation, self.tolerance, self.standard_error)
    }

    fn told(&self) -> String {
        let samples = format!("{:.5} ± {} by samples", self.samples, error_text(self.standard_error));
        self.integral.map_or(samples.clone(), |(value, _)| format!("{value:.5} by quadrature, {samples}"))
    }

    /// What is wrong with it, in words.
    fn wrong(&self, threshold: f64) -> Option<String> {
        let expected = format!("{}{}", if self.exact { "" } else { "at most " }, number(self.expected));
        if let Some((value, error)) = self.integral {
            if !within(error, self.tolerance) {
                return Some(format!(
                    "f is too uneven to be integrated: {value:.5} with an error of up to {error:.1e}"
                ));
            }
            let p = p_of_excess(value - self.samples, self.tolerance, self.standard_error);
            if p < threshold {
                let told = self.told();
                return Some(format!("the samples and f are of two models: {told}, {} that they agree", p_text(p)));
            }
            let over = if self.exact { (value - self.expected).abs() } else { value - self.expected };
            if !within(over, self.tolerance) {
                return Some(format!("expected {expected} (tolerance {}), got {}", self.tolerance, self.told()));
            }
        }
        let p = self.p();
        (p < threshold)
            .then(|| format!("expected {expected} (tolerance {}), got {}, {}", self.tolerance, self.told(), p_text(p)))
    }
}

/// Directions of all kinds: along the normal to nearly along the surface, on both sides.
pub(super) fn fixed_directions() -> Vec<DVec3> {
    let azimuths = (0..8).map(|i| 0.3 + f64::from(i) * std::f64::consts::FRAC_PI_4);
    let up = [1.0, 0.7, 0.3, 1e-3, 1e-6].into_iter().flat_map(|cosine| {
        azimuths.clone().map(move |azimuth| super::configuration::direction_of_view(cosine, azimuth))
    });
    up.flat_map(|w| [w, DVec3::new(w.x, -w.y, w.z)]).collect()
}
