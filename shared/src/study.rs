//! Studies as data: the phases and parameters of an experiment.

use crate::invalid::Invalid;
use crate::scene::{EncounterRange, Scene, SceneParameters, generate};
use crate::trial::Phase;
use serde::{Deserialize, Serialize};

/// The configuration of a study. Study files are TOML; a missing table or field takes the paper's
/// value.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct StudyConfig {
    /// Name in addresses: lower-case letters, digits and hyphens.
    pub slug: String,
    /// Name shown to people.
    pub title: String,
    /// Vehicles, danger radius and clock.
    pub parameters: SceneParameters,
    /// The phases that a participant drives, in order.
    pub phases: Vec<PhaseConfig>,
}

/// One phase of a study.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PhaseConfig {
    /// Its name.
    pub phase: Phase,
    /// Number of scenes.
    pub scenes: usize,
    /// Whether the danger zone is drawn around the robot.
    #[serde(default)]
    pub show_danger_zone: bool,
}

impl Default for StudyConfig {
    /// The paper's protocol. Its minute of familiarisation is six scenes of ten
    /// seconds, with the danger zone drawn.
    fn default() -> Self {
        let phase =
            |phase, scenes, show_danger_zone| PhaseConfig { phase, scenes, show_danger_zone };
        Self {
            slug: "default".to_owned(),
            title: "Avoid the robot".to_owned(),
            parameters: SceneParameters::default(),
            phases: vec![
                phase(Phase::Familiarisation, 6, true),
                phase(Phase::Practice, 3, false),
                phase(Phase::Task, 50, false),
            ],
        }
    }
}

/// Most scenes in one phase; an hour of driving is 360.
const MAX_SCENES: usize = 1000;

impl StudyConfig {
    /// Accepts a configuration that is valid.
    ///
    /// # Errors
    /// [`Invalid`] naming the field.
    pub fn check(&self) -> Result<(), Invalid> {
        let slug_ok = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-';
        if !(1..=64).contains(&self.slug.len()) || !self.slug.chars().all(slug_ok) {
            let expected = "1 to 64 lower-case letters, digits and hyphens";
            return Err(Invalid::new("slug", expected, format!("{:?}", self.slug)));
        }
        if self.title.trim().is_empty() || self.title.chars().count() > 200 {
            return Err(Invalid::new("title", "1 to 200 characters", format!("{:?}", self.title)));
        }
        self.parameters.check().map_err(|e| e.within("parameters"))?;
        if self.phases.is_empty() {
            return Err(Invalid::new("phases", "at least one phase", "none"));
        }
        for (i, phase) in self.phases.iter().enumerate() {
            if !(1..=MAX_SCENES).contains(&phase.scenes) {
                let expected = format!("a whole number from 1 to {MAX_SCENES}");
                return Err(Invalid::new(format!("phases[{i}].scenes"), expected, phase.scenes));
            }
            if i > 0 && self.phases[i - 1].phase >= phase.phase {
                let expected = "each phase once, in the order familiarisation, practice, task";
                return Err(Invalid::new(
                    format!("phases[{i}].phase"),
                    expected,
                    phase.phase.word(),
                ));
            }
        }
        Ok(())
    }

    /// The scenes of one participant, phase by phase. The same seed gives the same scenes on every
    /// platform.
    ///
    /// # Errors
    /// [`Invalid`] if no scene is found with these parameters in which the human can escape.
    pub fn plan(&self, seed: u64) -> Result<Vec<(PhaseConfig, Vec<Scene>)>, Invalid> {
        let range = EncounterRange::default();
        (0u64..)
            .zip(&self.phases)
            .map(|(i, phase)| {
                // An odd multiplier gives each phase its own random stream.
                let seed = seed.wrapping_add((i + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15));
                let scenes = generate(&self.parameters, &range, phase.scenes, seed)?;
                Ok((*phase, scenes.into_iter().map(|(scene, _)| scene).collect()))
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_default_study_is_the_papers() {
        let study = StudyConfig::default();
        study.check().unwrap();
        let plan = study.plan(1).unwrap();
        let counts: Vec<_> = plan.iter().map(|(p, scenes)| (p.phase, scenes.len())).collect();
        assert_eq!(counts, [(Phase::Familiarisation, 6), (Phase::Practice, 3), (Phase::Task, 50)]);
        assert_eq!(study.plan(1).unwrap(), plan);
        assert_ne!(study.plan(2).unwrap(), plan);
    }

    #[test]
    fn complaints_name_the_field() {
        let complain = |change: fn(&mut StudyConfig)| {
            let mut study = StudyConfig::default();
            change(&mut study);
            study.check().unwrap_err().field
        };
        assert_eq!(complain(|s| s.slug = "Pilot 2".into()), "slug");
        assert_eq!(complain(|s| s.phases[1].scenes = 0), "phases[1].scenes");
        assert_eq!(complain(|s| s.phases.reverse()), "phases[1].phase");
        assert_eq!(complain(|s| s.parameters.human.speed_mps = -2.0), "parameters.human.speed_mps");
    }
}
