//! The checks of a function.

use serde_json::json;
use toml::Value;

use super::chi_square::{ChiSquare, chi_square_test};
use super::device::MOST_LANES;
use super::expectations::combinations;
use super::function_expectations::{
    Draw, FunctionCheck, FunctionExpectations, FunctionTest, Mean, Number, Range, Uniform, Values, number_of,
};
use super::report::{CheckReport, Level, error_text, number, p_text, within, worst};
use crate::Result;
use crate::bench::statistics::{Summary, t_two_sided};
use crate::layout::Texel;
use crate::random::SplitMix;
use crate::render::FunctionKernel;

/// A kernel that maps numbers to numbers, its expectations and the level of its statistical checks.
pub(super) struct Function<'a> {
    pub(super) kernel: FunctionKernel,
    pub(super) expectations: &'a FunctionExpectations,
    pub(super) significance: f64,
    pub(super) seed: u32,
}

impl Function<'_> {
    /// Makes a check.
    pub(super) fn check(&mut self, test: &FunctionTest) -> Result<CheckReport> {
        match &test.check {
            FunctionCheck::Values(values) => self.values(&test.name, values),
            FunctionCheck::Range(range) => self.range(&test.name, range),
            FunctionCheck::Mean(mean) => self.mean(&test.name, mean),
            FunctionCheck::Uniform(uniform) => self.uniform(&test.name, uniform),
        }
    }

    fn values(&mut self, name: &str, values: &Values) -> Result<CheckReport> {
        let expectations = self.expectations;
        let split = expectations.inputs.len();
        let numbers = |row: &[Value]| row.iter().map(|v| number_of(v).unwrap_or(0.0)).collect::<Vec<_>>();
        let lanes: Vec<Vec<f64>> = values.rows.iter().map(|row| numbers(&row[..split])).collect();
        let (mut failures, mut largest) = (Vec::new(), 0.0_f64);
        for (row, (input, got)) in values.rows.iter().zip(lanes.iter().zip(self.call(&lanes)?)) {
            for ((number, expected), got) in expectations.outputs.iter().zip(&row[split..]).zip(got) {
                let Some(expected) = number_of(expected) else { continue };
                // What the device can hold of it.
                let expected = if number.integer { expected } else { f64::from(expected as f32) };
                let error =
                    if got == expected || got.is_nan() && expected.is_nan() { 0.0 } else { (got - expected).abs() };
                let allowed = values.absolute + values.relative * expected.abs();
                largest = if error.is_nan() { f64::INFINITY } else { largest.max(error) };
                if !within(error, allowed) {
                    let at = told(&expectations.inputs, input);
                    let name = &number.name;
                    failures
                        .push(format!("{at}: {name} is {got:?}, expected {expected:?} ± {}", self::number(allowed)));
                }
            }
        }
        let (absolute, relative) = (values.absolute, values.relative);
        let allowed = match (absolute, relative) {
            (0.0, 0.0) => String::from("none"),
            (absolute, 0.0) => number(absolute),
            (0.0, relative) => format!("{} of the value", number(relative)),
            (absolute, relative) => format!("{} + {} of the value", number(absolute), number(relative)),
        };
        let summary = format!("{} rows; largest error {}; {allowed} allowed", values.rows.len(), error_text(largest));
        let numbers = json!({
            "rows": values.rows.len(), "largest_error": largest, "absolute": absolute, "relative": relative,
        });
        Ok(CheckReport::new("values", name, summary, failures, numbers))
    }

    fn range(&mut self, name: &str, range: &Range) -> Result<CheckReport> {
        let expectations = self.expectations;
        let inputs = &expectations.inputs;
        let axes: Vec<_> = inputs.iter().map(|n| (n.name.as_str(), range.over[&n.name].values())).collect();
        let lanes = combinations(&axes, MOST_LANES).map_err(crate::Error::Usage)?;
        let (mut failures, mut limits) =
            (Vec::new(), vec![[f64::INFINITY, f64::NEG_INFINITY]; expectations.outputs.len()]);
        for (input, got) in lanes.iter().zip(self.call(&lanes)?) {
            for ((number, got), [least, greatest]) in expectations.outputs.iter().zip(got).zip(&mut limits) {
                (*least, *greatest) = (least.min(got), greatest.max(got));
                let [low, high] = range.within.get(&number.name).copied().unwrap_or([f64::MIN, f64::MAX]);
                if !(low..=high).contains(&got) {
                    let wanted = if range.within.contains_key(&number.name) {
                        format!("expected {low} to {high}")
                    } else {
                        "expected a finite number".to_owned()
                    };
                    failures.push(format!("{}: {} is {got:?}, {wanted}", told(inputs, input), number.name));
                }
            }
        }
        let found: Vec<_> = expectations
            .outputs
            .iter()
            .zip(&limits)
            .map(|(output, [least, greatest])| format!("{} {} to {}", output.name, number(*least), number(*greatest)))
            .collect();
        let summary = format!("{} inputs; {}", lanes.len(), found.join(", "));
        let numbers = json!({ "inputs": lanes.len() });
        Ok(CheckReport::new("range", name, summary, failures, numbers))
    }

    fn mean(&mut self, name: &str, mean: &Mean) -> Result<CheckReport> {
        let outputs = self.draw(&mean.draw, mean.samples)?;
        let level = Level::new(self.significance, mean.expect.len());
        let test = |(name, expected): (&String, &f64)| {
            let values: Vec<f64> = outputs.iter().map(|row| row[self.output(name)]).collect();
            let got = Summary::of(&values);
            let p = p_of_mean(got, *expected, values.len());
            (name.clone(), *expected, got, p)
        };
        let tests: Vec<_> = mean.expect.iter().map(test).collect();
        let text = |(name, expected, got, p): &(String, f64, Summary, f64)| {
            let Summary { mean, standard_error } = got;
            format!("{name} {mean:.6} ± {}, expected {expected}, {}", error_text(*standard_error), p_text(*p))
        };
        let failures = tests.iter().filter(|(.., p)| !within(level.each, *p)).map(text).collect();
        let lowest = &tests[worst(tests.iter().map(|(.., p)| *p))];
        let summary = format!("{} samples; {}; {}", mean.samples, text(lowest), level.told(tests.len()));
        let (name_of, expected, got, p) = lowest;
        let numbers = json!({
            "samples": mean.samples, "output": name_of, "expected": expected, "got": got.mean,
            "standard_error": got.standard_error, "p_value": p, "significance": level.all, "threshold": level.each,
        });
        Ok(CheckReport::new("mean", name, summary, failures, numbers))
    }

    fn uniform(&mut self, name: &str, uniform: &Uniform) -> Result<CheckReport> {
        let outputs = self.draw(&uniform.draw, uniform.samples)?;
        let level = Level::new(self.significance, uniform.outputs.len());
        let bins = uniform.bins as usize;
        let expected = vec![f64::from(uniform.samples) / bins as f64; bins];
        let (mut failures, mut tests) = (Vec::new(), Vec::new());
        for output in &uniform.outputs {
            let index = self.output(output);
            let mut observed = vec![0_u64; bins];
            let outside = outputs.iter().find(|row| !(0.0..1.0).contains(&row[index]));
            outputs.iter().filter(|row| (0.0..1.0).contains(&row[index])).for_each(|row| {
                observed[((row[index] * bins as f64) as usize).min(bins - 1)] += 1;
            });
            let test = chi_square_test(&observed, &expected, u64::from(uniform.samples));
            if let Some(row) = outside {
                failures.push(format!("{output} is {}, expected a number in [0, 1)", row[index]));
            } else if test.p_value < level.each {
                failures.push(format!("{output}: {}", chi_text(&test)));
            }
            tests.push((output, test));
        }
        let (output, test) = &tests[worst(tests.iter().map(|(_, test)| test.p_value))];
        let summary = format!(
            "{} samples in {bins} bins; lowest: {output}, {}; {}",
            uniform.samples,
            chi_text(test),
            level.told(tests.len())
        );
        let numbers = json!({
            "samples": uniform.samples, "bins": bins, "output": output, "statistic": test.statistic,
            "degrees_of_freedom": test.degrees_of_freedom, "p_value": test.p_value, "significance": level.all,
            "threshold": level.each,
        });
        Ok(CheckReport::new("uniform", name, summary, failures, numbers))
    }

    fn output(&self, name: &str) -> usize {
        self.expectations.outputs.iter().position(|number| number.name == name).unwrap_or(0)
    }

    /// Outputs at drawn inputs.
    fn draw(&mut self, draws: &std::collections::BTreeMap<String, Draw>, samples: u32) -> Result<Vec<Vec<f64>>> {
        let mut random = SplitMix(self.seed.into());
        let mut draw = |number: &Number| match draws[&number.name] {
            Draw::Fixed(value) => value,
            Draw::Uniform([low, high]) => {
                let value = low + (high - low) * random.unit();
                if number.integer { value.floor() } else { value }
            }
        };
        let inputs = &self.expectations.inputs;
        let lanes: Vec<Vec<f64>> = (0..samples).map(|_| inputs.iter().map(&mut draw).collect()).collect();
        self.call(&lanes)
    }

    /// Calls the kernel: a lane for each list of inputs.
    fn call(&mut self, lanes: &[Vec<f64>]) -> Result<Vec<Vec<f64>>> {
        let Self { kernel, expectations, .. } = self;
        let texels_in = expectations.inputs.len().div_ceil(4);
        let texels_out = expectations.outputs.len().div_ceil(4);
        let mut result = Vec::with_capacity(lanes.len());
        for lanes in lanes.chunks(MOST_LANES / texels_in.max(texels_out)) {
            let inputs: Vec<Texel> = lanes.iter().flat_map(|lane| pack(&expectations.inputs, lane)).collect();
            let outputs = kernel.run(&inputs, lanes.len() as u32, texels_out as u32)?;
            result.extend(outputs.chunks_exact(texels_out).map(|texels| unpack(&expectations.outputs, texels)));
        }
        Ok(result)
    }
}

/// Of Student's t; without a spread, equal or not (to the rounding of the outputs).
fn p_of_mean(got: Summary, expected: f64, count: usize) -> f64 {
    let deviation = (got.mean - expected).abs();
    if got.standard_error == 0.0 {
        return if deviation <= f64::from(f32::EPSILON) * expected.abs() { 1.0 } else { 0.0 };
    }
    if deviation.is_finite() { t_two_sided(deviation / got.standard_error, count as f64 - 1.0) } else { 0.0 }
}

fn chi_text(test: &ChiSquare) -> String {
    format!("χ² = {:.1} of {} degrees of freedom, {}", test.statistic, test.degrees_of_freedom, p_text(test.p_value))
}

/// Inputs by their names.
fn told(numbers: &[Number], values: &[f64]) -> String {
    numbers.iter().zip(values).map(|(number, value)| format!("{} {value}", number.name)).collect::<Vec<_>>().join(", ")
}

fn pack(numbers: &[Number], values: &[f64]) -> Vec<Texel> {
    let word =
        |(number, value): (&Number, &f64)| if number.integer { *value as u32 } else { (*value as f32).to_bits() };
    let words: Vec<u32> = numbers.iter().zip(values).map(word).collect();
    words.chunks(4).map(|four| std::array::from_fn(|i| four.get(i).copied().unwrap_or(0))).collect()
}

fn unpack(numbers: &[Number], texels: &[Texel]) -> Vec<f64> {
    let value = |(number, bits): (&Number, &u32)| {
        if number.integer { f64::from(*bits) } else { f64::from(f32::from_bits(*bits)) }
    };
    numbers.iter().zip(texels.as_flattened()).map(value).collect()
}
