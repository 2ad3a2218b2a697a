//! The parameters and directions that a BSDF is tested at.

use std::collections::BTreeMap;

use glam::DVec3;

use super::expectations::{Axis, combinations};
use super::report::number;

/// Axes of the direction of view, besides the parameters.
const DIRECTION_AXES: [&str; 2] = ["cosine", "azimuth"];
/// Most configurations of a check.
const MOST: usize = 4096;

/// Values for every parameter, and for the direction of view: `cosine` with the normal, in (0, 1], and `azimuth` in radians
/// from +X towards +Z.
#[derive(Clone, Debug, PartialEq)]
pub struct Grid {
    /// In the order of the parameters, then the direction.
    axes: Vec<(String, Axis)>,
}

/// One combination.
#[derive(Clone, Debug, PartialEq)]
pub struct Configuration {
    /// The parameters' values, as the kernel gets them.
    pub parameters: Vec<f32>,
    /// The direction of view, each component rounded to an f32.
    pub wo: DVec3,
    /// What it is called in reports: the axes that have several values.
    pub label: String,
}

impl Grid {
    pub(super) fn new(parameters: &[String], given: &BTreeMap<String, Axis>) -> Result<Self, String> {
        for (index, name) in parameters.iter().enumerate() {
            if name.is_empty() || DIRECTION_AXES.contains(&name.as_str()) || parameters[..index].contains(name) {
                return Err(format!("\"{name}\" cannot be a parameter: expected a name of its own"));
            }
            if !given.contains_key(name) {
                return Err(format!("grid says nothing of the parameter {name}"));
            }
        }
        let default = |name: &str| Axis::Value(if name == "cosine" { 0.7 } else { 0.6 });
        let names = parameters.iter().map(String::as_str).chain(DIRECTION_AXES);
        let axes = names.map(|name| (name.to_owned(), given.get(name).cloned().unwrap_or_else(|| default(name))));
        let grid = Self { axes: axes.collect() };
        grid.known(given)?;
        grid.configurations()?;
        Ok(grid)
    }

    /// The same with some axes replaced.
    pub(super) fn with(&self, over: &BTreeMap<String, Axis>) -> Result<Self, String> {
        self.known(over)?;
        let axis = |(name, axis): &(String, Axis)| (name.clone(), over.get(name).unwrap_or(axis).clone());
        let grid = Self { axes: self.axes.iter().map(axis).collect() };
        grid.configurations()?;
        Ok(grid)
    }

    fn known(&self, given: &BTreeMap<String, Axis>) -> Result<(), String> {
        match given.keys().find(|name| !self.axes.iter().any(|(axis, _)| axis == *name)) {
            None => Ok(()),
            Some(name) => {
                let known: Vec<_> = self.axes.iter().map(|(name, _)| name.as_str()).collect();
                Err(format!("{name} is no parameter; there are {}", known.join(", ")))
            }
        }
    }

    /// Every combination.
    ///
    /// # Errors
    /// No values, too many of them, or a cosine that is none.
    pub(super) fn configurations(&self) -> Result<Vec<Configuration>, String> {
        let axes: Vec<_> = self.axes.iter().map(|(name, axis)| (name.as_str(), axis.values())).collect();
        let several: Vec<bool> = axes.iter().map(|(_, values)| values.len() > 1).collect();
        let configuration = |values: &Vec<f64>| {
            let (parameters, direction) = values.split_at(values.len() - 2);
            let named = axes.iter().zip(values).zip(&several).filter(|(_, several)| **several);
            let label: Vec<_> = named.map(|(((name, _), value), _)| format!("{name} {}", number(*value))).collect();
            if !(direction[0] > 0.0 && direction[0] <= 1.0) {
                return Err(format!("cosine {}: expected a number above 0 and up to 1", direction[0]));
            }
            Ok(Configuration {
                parameters: parameters.iter().map(|value| *value as f32).collect(),
                wo: direction_of_view(direction[0], direction[1]),
                label: if label.is_empty() { "the one configuration".to_owned() } else { label.join(", ") },
            })
        };
        combinations(&axes, MOST)?.iter().map(configuration).collect()
    }

    /// The index of a parameter.
    pub(super) fn index(&self, name: &str) -> Option<usize> {
        self.axes.iter().position(|(axis, _)| axis == name)
    }
}

/// The direction at an angle of the given cosine to +Y.
pub(super) fn direction_of_view(cosine: f64, azimuth: f64) -> DVec3 {
    let sine = ((1.0 - cosine) * (1.0 + cosine)).sqrt();
    DVec3::new(sine * azimuth.cos(), cosine, sine * azimuth.sin()).as_vec3().as_dvec3()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_combination_is_a_configuration_and_is_called_by_what_varies() {
        let given = BTreeMap::from([
            ("roughness".to_owned(), Axis::List(vec![0.1, 1.0])),
            ("metallic".to_owned(), Axis::Value(1.0)),
            ("cosine".to_owned(), Axis::List(vec![1.0, 0.5, 0.01])),
        ]);
        let grid = Grid::new(&["metallic".to_owned(), "roughness".to_owned()], &given).unwrap();
        let all = grid.configurations().unwrap();
        assert_eq!(all.len(), 6);
        assert_eq!(
            (all[1].parameters.as_slice(), all[1].label.as_str()),
            (&[1.0, 0.1][..], "roughness 0.1, cosine 0.5")
        );
        assert!((all[1].wo.length() - 1.0).abs() < 1e-7 && all[1].wo.y == 0.5, "{}", all[1].wo);
        let over = BTreeMap::from([("cosine".to_owned(), Axis::Value(0.2))]);
        assert_eq!(grid.with(&over).unwrap().configurations().unwrap().len(), 2);
        let over = BTreeMap::from([("cosine".to_owned(), Axis::Value(0.0))]);
        assert!(grid.with(&over).unwrap_err().contains("above 0"));
    }
}
