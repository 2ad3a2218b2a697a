//! What the page can choose from: the names of the code's own enums, so that it shows what they have.

use serde::Serialize;

use super::estimator::AUTO;
use crate::film::tonemap::ToneMap;
use crate::render::{EnvironmentSampling, Integrator, LightChoice, LightSampling, MisHeuristic, SamplerKind};

/// A field of the view whose value is one of several names.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Choice {
    /// The field of [`super::messages::View`]; with hyphens, the flag of `render` and the control's id.
    field: &'static str,
    names: Vec<&'static str>,
    /// What `render` does without the flag.
    default: String,
}

/// All of them.
pub(super) fn choices() -> Vec<Choice> {
    fn choice<T: Default + ToString>(field: &'static str, names: &[&'static str]) -> Choice {
        Choice { field, names: names.to_vec(), default: T::default().to_string() }
    }
    vec![
        choice::<Integrator>("integrator", Integrator::NAMES),
        choice::<LightSampling>("light_sampling", LightSampling::NAMES),
        choice::<MisHeuristic>("mis", MisHeuristic::NAMES),
        choice::<LightChoice>("light_choice", LightChoice::NAMES),
        Choice {
            field: "env_sampling",
            names: [&[AUTO], EnvironmentSampling::NAMES].concat(),
            default: AUTO.to_owned(),
        },
        choice::<SamplerKind>("sampler", SamplerKind::NAMES),
        choice::<ToneMap>("tonemap", &ToneMap::NAMES.map(|(name, _)| name)),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::watch::messages::{Estimator, View};

    #[test]
    fn the_page_has_a_control_for_every_choice_and_no_name_by_hand() {
        let view = View { estimator: Estimator::default(), ..View::default() };
        let fields = serde_json::to_value(view).unwrap();
        for Choice { field, names, default } in choices() {
            assert!(fields[field].is_string(), "{field} is a field of the view");
            assert!(names.contains(&default.as_str()), "{field}: {default}");
            let select = format!("<select id=\"{}\"", field.replace('_', "-"));
            let page = include_str!("../../assets/watch/index.html");
            let control = page.split_once(&select).unwrap_or_else(|| panic!("{select}")).1;
            let inside = control.split_once('>').unwrap().1;
            assert!(inside.starts_with("</select>"), "{field}: its names come from the server");
        }
    }
}
