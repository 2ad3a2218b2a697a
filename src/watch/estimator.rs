//! The estimator of a view, as the page switches it.

use serde::{Deserialize, Serialize};

use crate::render::{EnvironmentSampling, Settings};

/// The choice that is left to the rest of the settings.
pub(super) const AUTO: &str = "auto";

/// The estimator that is shown: all but `max_bounces` are specialisation constants of the kernel.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct Estimator {
    /// Name of a [`crate::render::Integrator`].
    pub integrator: String,
    /// Name of a [`crate::render::LightSampling`].
    pub light_sampling: String,
    /// Name of a [`crate::render::MisHeuristic`].
    pub mis: String,
    /// Name of a [`crate::render::SamplerKind`].
    pub sampler: String,
    /// Name of a [`crate::render::LightChoice`]; the scene's tables depend on it.
    pub light_choice: String,
    /// Name of an [`EnvironmentSampling`]; likewise. `auto` leaves it to the light sampling.
    pub env_sampling: String,
    /// Scattering events a path may have; `None` is unlimited.
    pub max_bounces: Option<u32>,
}

impl Estimator {
    /// Of settings.
    pub fn of(settings: &Settings) -> Self {
        Self {
            integrator: settings.integrator.name().to_owned(),
            light_sampling: settings.light_sampling.name().to_owned(),
            mis: settings.mis_heuristic.name().to_owned(),
            sampler: settings.sampler.name().to_owned(),
            light_choice: settings.light_choice.name().to_owned(),
            env_sampling: settings.env_sampling.map_or(AUTO, EnvironmentSampling::name).to_owned(),
            max_bounces: settings.max_bounces,
        }
    }

    /// Puts it into settings. A name that means nothing changes nothing.
    pub fn apply(&self, settings: &mut Settings) {
        Self::read(&mut settings.integrator, &self.integrator);
        Self::read(&mut settings.light_sampling, &self.light_sampling);
        Self::read(&mut settings.mis_heuristic, &self.mis);
        Self::read(&mut settings.sampler, &self.sampler);
        Self::read(&mut settings.light_choice, &self.light_choice);
        match self.env_sampling.as_str() {
            AUTO => settings.env_sampling = None,
            name => settings.env_sampling = name.parse().ok().or(settings.env_sampling),
        }
        settings.max_bounces = self.max_bounces;
    }

    /// Whether the scene must be prepared anew for the other.
    pub(super) fn prepares_otherwise(&self, other: &Self) -> bool {
        let environment_sampling = |estimator: &Self| {
            let mut settings = Settings::default();
            estimator.apply(&mut settings);
            settings.environment_sampling()
        };
        self.light_choice != other.light_choice || environment_sampling(self) != environment_sampling(other)
    }

    fn read<T: std::str::FromStr>(target: &mut T, name: &str) {
        if let Ok(value) = name.parse() {
            *target = value;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Where nothing is said of the environment, the light sampling decides, and the scene is prepared for it.
    #[test]
    fn the_environment_follows_the_light_sampling() {
        let auto = Estimator::of(&Settings::default());
        let nee = Estimator { light_sampling: "nee".to_owned(), ..auto.clone() };
        let bsdf = Estimator { light_sampling: "bsdf".to_owned(), ..auto.clone() };
        assert!(auto.prepares_otherwise(&nee) && !auto.prepares_otherwise(&bsdf));
        let fixed = |estimator: &Estimator| Estimator { env_sampling: "uniform".to_owned(), ..estimator.clone() };
        assert!(!fixed(&auto).prepares_otherwise(&fixed(&nee)));
        let mut settings = Settings::default();
        fixed(&nee).apply(&mut settings);
        assert_eq!(settings.environment_sampling(), EnvironmentSampling::Uniform);
        nee.apply(&mut settings);
        assert_eq!(settings.environment_sampling(), EnvironmentSampling::Importance);
    }
}
