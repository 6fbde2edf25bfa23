//! Studies as data: the phases and parameters of an experiment.

mod localised;
mod protocol;
mod question;
mod recruitment;
mod warnings;

pub use localised::{Fact, Localised, closest_language, is_language};
pub use protocol::{AfterWrong, CheckQuestion, Closing, Comprehension, Consent, TrialSettings};
pub use question::{Choice, Question, QuestionKind};
pub use recruitment::{Recruitment, is_id, normalised_id};

use crate::invalid::Invalid;
use crate::scene::{
    Coordinate, EncounterRange, RobotPolicy, RobotsVary, Scene, SceneParameters, StratifiedScene,
    counterbalanced, generate,
};
use crate::trial::Phase;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// The configuration of a study. Study files are TOML; missing tables and fields default to the
/// paper's values.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct StudyConfig {
    /// Name in URLs: 1 to 64 lower-case letters, digits and hyphens.
    pub slug: String,
    /// Name shown to people, 1 to 200 characters.
    pub title: String,
    /// The researcher's label of this version of the study, at most 40 characters. Default: `1`.
    pub version: String,
    /// Whether people can take part. Default: open.
    pub status: Status,
    /// Whether the participants are synthetic. Such a study admits no people and is marked on every
    /// page and in every export. Default: false.
    pub synthetic: bool,
    /// The languages that participants can choose from; the first is the fallback. Default: every
    /// language that the server offers and in which all texts of the study are available, English
    /// first.
    pub languages: Vec<String>,
    /// Vehicles, danger radius and clock.
    pub parameters: SceneParameters,
    /// The encounters from which scenes are drawn.
    pub encounters: EncounterRange,
    /// The robots that participants meet, at most 8. Default: none, which is one robot that drives
    /// straight to its goal.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub robots: Vec<RobotPolicy>,
    /// How the robots are divided among participants and scenes. Default: `within`.
    #[serde(skip_serializing_if = "is_default")]
    pub robots_vary: RobotsVary,
    /// Seed of the scenes, 0 to 4 294 967 295. With another seed, the participants of the same
    /// study get other scenes. Default: 0.
    pub seed: u32,
    /// The phases that a participant drives, in order.
    pub phases: Vec<PhaseConfig>,
    /// The course of every trial.
    pub trials: TrialSettings,
    /// Responsible people and the consent text.
    pub consent: Consent,
    /// The check that participants have understood the instructions.
    pub comprehension: Comprehension,
    /// Questions after the last scene, in order; at most 100.
    pub questions: Vec<Question>,
    /// The last page.
    pub closing: Closing,
    /// Recruiting service: links to the study and return URLs.
    pub recruitment: Recruitment,
    /// Sentences of the participant's page that override the language files. The first key is the
    /// language, and the second key is the sentence's key, as in `[texts.en] "welcome.lead" = "…"`.
    pub texts: BTreeMap<String, BTreeMap<String, String>>,
}

/// Whether people can take part in a study.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum Status {
    /// Everyone with the link can take part.
    #[default]
    Open,
    /// New participants are refused; participants who have begun can finish.
    Closed,
    /// Nobody can take part.
    Archived,
}

impl Status {
    /// All statuses.
    pub const ALL: [Self; 3] = [Self::Open, Self::Closed, Self::Archived];

    /// The word in study files and in JSON.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Open => "open",
            Self::Closed => "closed",
            Self::Archived => "archived",
        }
    }
}

/// One phase of a study.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct PhaseConfig {
    /// The phase.
    pub phase: Phase,
    /// Number of scenes, 1 to 1000.
    pub scenes: usize,
    /// Whether the danger zone is drawn around the robot. Default: false.
    #[serde(default)]
    pub show_danger_zone: bool,
    /// Whether the page tells the participant after each scene whether they stayed out of the
    /// danger zone. Default: false.
    #[serde(default)]
    pub feedback: bool,
}

impl Default for StudyConfig {
    /// The paper's protocol. Its minute of familiarisation is six scenes of ten
    /// seconds, with the danger zone drawn.
    fn default() -> Self {
        let phase = |phase, scenes, show_danger_zone| PhaseConfig {
            phase,
            scenes,
            show_danger_zone,
            feedback: false,
        };
        Self {
            slug: "default".to_owned(),
            title: "Avoid the robot".to_owned(),
            version: "1".to_owned(),
            status: Status::Open,
            synthetic: false,
            languages: Vec::new(),
            parameters: SceneParameters::default(),
            encounters: EncounterRange::default(),
            robots: Vec::new(),
            robots_vary: RobotsVary::default(),
            seed: 0,
            phases: vec![
                phase(Phase::Familiarisation, 6, true),
                phase(Phase::Practice, 3, false),
                phase(Phase::Task, 50, false),
            ],
            trials: TrialSettings::default(),
            consent: Consent::default(),
            comprehension: Comprehension::default(),
            questions: Vec::new(),
            closing: Closing::default(),
            recruitment: Recruitment::default(),
            texts: BTreeMap::new(),
        }
    }
}

/// Whether a setting has its default value, so that yesterday's configurations keep their hashes.
fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

/// Maximum number of robots in a study.
const MAX_ROBOTS: usize = 8;

/// Maximum number of scenes in one phase. An hour of driving is 360 scenes.
const MAX_SCENES: usize = 1000;

impl StudyConfig {
    /// Checks the whole configuration.
    ///
    /// # Errors
    /// [`Invalid`] naming the field.
    pub fn check(&self) -> Result<(), Invalid> {
        let slug_ok = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-';
        if !(1..=64).contains(&self.slug.len())
            || !self.slug.chars().all(slug_ok)
            || self.slug.starts_with('-')
            || self.slug.ends_with('-')
        {
            let expected = "1 to 64 lower-case letters, digits and hyphens, with a letter or digit \
                            at both ends";
            return Err(Invalid::new("slug", expected, format!("{:?}", self.slug)));
        }
        if self.title.trim().is_empty() || self.title.chars().count() > 200 {
            return Err(Invalid::new("title", "1 to 200 characters", format!("{:?}", self.title)));
        }
        for (field, text) in [("title", &self.title), ("version", &self.version)] {
            localised::check_visible(field, text)?;
            if text.contains(['\n', '\r', '\t']) {
                return Err(Invalid::new(field, "a text on one line", "a line break or tab"));
            }
        }
        self.parameters.check().map_err(|e| e.within("parameters"))?;
        self.encounters.check().map_err(|e| e.within("encounters"))?;
        self.check_robots()?;
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
        self.check_protocol()
    }

    fn check_robots(&self) -> Result<(), Invalid> {
        if self.robots.len() > MAX_ROBOTS {
            let expected = format!("at most {MAX_ROBOTS} robots");
            return Err(Invalid::new("robots", expected, self.robots.len()));
        }
        for (i, robot) in self.robots.iter().enumerate() {
            let within = |error: Invalid| error.within(&format!("robots[{i}]"));
            robot.check(&self.parameters).map_err(within)?;
            if self.robots[..i].iter().any(|other| other.name == robot.name) {
                return Err(within(Invalid::new("name", "each name once", &robot.name)));
            }
        }
        Ok(())
    }

    /// Whether a robot of the study can leave the straight line to its goal.
    #[must_use]
    pub fn robots_turn(&self) -> bool {
        self.robots.iter().any(RobotPolicy::may_turn)
    }

    /// The robot in a scene with this approach stratum of the participant at `place`. `None` if the
    /// study names no robots.
    fn robot_at(&self, place: u64, approach_stratum: usize) -> Option<Box<RobotPolicy>> {
        let robot = self.robots_vary.robot(self.robots.len(), place, approach_stratum);
        self.robots.get(robot).cloned().map(Box::new)
    }

    fn check_protocol(&self) -> Result<(), Invalid> {
        let count = self.version.chars().count();
        if !(1..=40).contains(&count) {
            return Err(Invalid::new("version", "1 to 40 characters", format!("{count}")));
        }
        for (i, language) in self.languages.iter().enumerate() {
            let field = || format!("languages[{i}]");
            if !is_language(language) {
                return Err(Invalid::new(field(), "a language tag such as en or zh-CN", language));
            }
            if self.languages[..i].contains(language) {
                return Err(Invalid::new(field(), "each language once", language));
            }
        }
        self.trials.check()?;
        self.consent.check()?;
        self.comprehension.check()?;
        if self.questions.len() > 100 {
            return Err(Invalid::new("questions", "at most 100", self.questions.len()));
        }
        for (i, question) in self.questions.iter().enumerate() {
            let within = |error: Invalid| error.within(&format!("questions[{i}]"));
            question.check().map_err(within)?;
            if self.questions[..i].iter().any(|other| other.name == question.name) {
                return Err(within(Invalid::new("name", "each name once", &question.name)));
            }
        }
        self.closing.check()?;
        self.recruitment.check().map_err(|e| e.within("recruitment"))?;
        self.check_places()?;
        for (language, sentences) in &self.texts {
            if !is_language(language) {
                let expected = "a language tag such as en or zh-CN";
                return Err(Invalid::new(format!("texts.{language}"), expected, language));
            }
            if !self.languages.is_empty() && !self.languages.contains(language) {
                let expected = format!("one of languages ({})", self.languages.join(", "));
                return Err(Invalid::new(format!("texts.{language}"), expected, language));
            }
            for (key, text) in sentences {
                localised::check_length(
                    &format!("texts.{language}.{key}"),
                    text,
                    protocol::MAX_SENTENCE,
                )?;
            }
        }
        Ok(())
    }

    /// Checks that no text contains a placeholder. The only exception is `{radius}` in the check of
    /// understanding.
    fn check_places(&self) -> Result<(), Invalid> {
        for (field, texts) in self.localised() {
            for (language, text) in &texts.0 {
                let (text, expected) = if field.starts_with("comprehension") {
                    (text.replace("{radius}", ""), "no place to fill but {radius}")
                } else {
                    (text.clone(), "no place to fill")
                };
                if let Some(place) = localised::first_place(&text) {
                    let field = format!("{field}.{language}");
                    return Err(Invalid::new(field, expected, format!("{{{place}}}")));
                }
            }
        }
        Ok(())
    }

    /// Every localised text with the path of its field, in the order of the page.
    #[must_use]
    pub fn localised(&self) -> Vec<(String, &Localised)> {
        let mut texts = vec![("consent.text".to_owned(), &self.consent.text)];
        let facts = self.consent.facts().into_iter();
        texts.extend(
            facts.filter_map(|(field, fact)| {
                Some((format!("consent.{field}"), fact.by_language()?))
            }),
        );
        for (i, question) in self.comprehension.questions.iter().enumerate() {
            let field = format!("comprehension.questions[{i}]");
            texts.push((format!("{field}.text"), &question.text));
            let options = question.options.iter().enumerate();
            texts.extend(options.map(|(k, text)| (format!("{field}.options[{k}]"), text)));
        }
        for (i, question) in self.questions.iter().enumerate() {
            let field = format!("questions[{i}]");
            texts.push((format!("{field}.text"), &question.text));
            let options = question.options.iter().enumerate();
            texts.extend(options.map(|(k, o)| (format!("{field}.options[{k}].text"), &o.text)));
            texts.push((format!("{field}.low"), &question.low));
            texts.push((format!("{field}.high"), &question.high));
        }
        texts.push(("closing.debrief".to_owned(), &self.closing.debrief));
        texts
    }

    /// Whether a new participant, synthetic or a person, can take part. A study marked as synthetic
    /// does not admit people.
    #[must_use]
    pub fn admits(&self, synthetic: bool) -> bool {
        self.status == Status::Open && (synthetic || !self.synthetic)
    }

    /// Checks that `new` can replace this configuration in a study with `participants`
    /// participants.
    ///
    /// # Errors
    /// [`Invalid`] if people and synthetic participants would be mixed.
    pub fn check_successor(&self, new: &Self, participants: u64) -> Result<(), Invalid> {
        if self.synthetic == new.synthetic || participants == 0 {
            return Ok(());
        }
        let those = if self.synthetic { "synthetic participants" } else { "participants" };
        let expected = format!(
            "{}, since {participants} {those} took part and data of people and programs stay apart",
            self.synthetic
        );
        Err(Invalid::new("synthetic", expected, new.synthetic))
    }

    /// The fallback language.
    #[must_use]
    pub fn first_language(&self) -> &str {
        self.languages.first().map_or("en", String::as_str)
    }

    /// The scenes of one participant, phase by phase. The same seed gives the same scenes on every
    /// platform.
    ///
    /// # Errors
    /// [`Invalid`] if these parameters allow no scene in which the human can escape.
    pub fn plan(&self, seed: u64) -> Result<Vec<(PhaseConfig, Vec<Scene>)>, Invalid> {
        self.each_phase(seed, |phase, seed| {
            let scenes = generate(&self.parameters, &self.encounters, phase.scenes, seed)?;
            let with_robot = |(i, (scene, _)): (usize, (Scene, _))| Scene {
                policy: self.robot_at(0, i),
                ..scene
            };
            Ok(scenes.into_iter().enumerate().map(with_robot).collect())
        })
    }

    /// The scenes of the participant at `place` (0, 1, 2, …), phase by phase, counterbalanced across
    /// participants. The same study and place give the same scenes on every platform.
    ///
    /// # Errors
    /// The errors of [`Self::plan`].
    pub fn stratified(
        &self,
        place: u64,
    ) -> Result<Vec<(PhaseConfig, Vec<StratifiedScene>)>, Invalid> {
        self.each_phase(u64::from(self.seed), |phase, seed| {
            let (parameters, range) = (&self.parameters, &self.encounters);
            let mut scenes = counterbalanced(parameters, range, phase.scenes, seed, place)?;
            for planned in &mut scenes {
                let stratum = planned.planned[Coordinate::Approach as usize];
                planned.scene.policy = self.robot_at(place, stratum);
            }
            Ok(scenes)
        })
    }

    /// The scenes of every phase, each with its own seed.
    fn each_phase<S>(
        &self,
        seed: u64,
        scenes: impl Fn(&PhaseConfig, u64) -> Result<Vec<S>, Invalid>,
    ) -> Result<Vec<(PhaseConfig, Vec<S>)>, Invalid> {
        (0u64..)
            .zip(&self.phases)
            .map(|(i, phase)| {
                // An odd multiplier gives each phase its own random stream.
                let seed = seed.wrapping_add((i + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15));
                Ok((*phase, scenes(phase, seed)?))
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
        let stratified = study.stratified(0).unwrap();
        let counts: Vec<_> = stratified.iter().map(|(_, scenes)| scenes.len()).collect();
        assert_eq!(counts, [6, 3, 50]);
        let other = StudyConfig { seed: 1, ..study };
        assert_ne!(other.stratified(0).unwrap(), stratified);
    }

    #[test]
    fn people_take_no_part_among_synthetic_participants() {
        let admits = |status, synthetic| {
            let study = StudyConfig { status, synthetic, ..StudyConfig::default() };
            [study.admits(false), study.admits(true)]
        };
        assert_eq!(admits(Status::Open, false), [true, true]);
        assert_eq!(admits(Status::Open, true), [false, true]);
        assert_eq!(admits(Status::Closed, true), [false, false]);
        assert_eq!(admits(Status::Archived, false), [false, false]);
        let of = |synthetic| StudyConfig { synthetic, ..StudyConfig::default() };
        assert_eq!(of(true).check_successor(&of(true), 3), Ok(()));
        assert_eq!(of(false).check_successor(&of(true), 0), Ok(()));
        assert_eq!(of(true).check_successor(&of(false), 3).unwrap_err().field, "synthetic");
        assert_eq!(of(false).check_successor(&of(true), 1).unwrap_err().field, "synthetic");
    }

    #[test]
    fn complaints_name_the_field() {
        let complain = |change: fn(&mut StudyConfig)| {
            let mut study = StudyConfig::default();
            change(&mut study);
            study.check().unwrap_err().field
        };
        assert_eq!(complain(|s| s.slug = "Pilot 2".into()), "slug");
        for slug in ["-", "-a", "a-"] {
            let study = StudyConfig { slug: slug.into(), ..StudyConfig::default() };
            assert_eq!(study.check().unwrap_err().field, "slug", "{slug}");
        }
        for title in ["a\0", "a\u{202e}b", "two\nlines"] {
            let study = StudyConfig { title: title.into(), ..StudyConfig::default() };
            assert_eq!(study.check().unwrap_err().field, "title", "{title:?}");
        }
        assert_eq!(
            complain(|s| {
                s.recruitment.require_external_id = true;
                s.recruitment.external_id.clear();
            }),
            "recruitment.external_id"
        );
        assert_eq!(
            complain(|s| {
                s.comprehension.standard = false;
                s.comprehension.attempts = 1;
            }),
            "comprehension.attempts"
        );
        // There are six standard questions to draw from.
        let draw = |draw| {
            let mut study = StudyConfig::default();
            study.comprehension.draw = draw;
            study.check().map_err(|error| error.field)
        };
        assert_eq!((draw(6), draw(7)), (Ok(()), Err("comprehension.draw".to_owned())));
        assert_eq!(complain(|s| s.trials.feedback_s = 1.4), "trials.feedback_s");
        assert_eq!(
            complain(|s| s.recruitment.full_url = "https://a.example/{code}".into()),
            "recruitment.full_url"
        );
        assert_eq!(
            complain(|s| {
                s.languages = vec!["de".into()];
                s.texts.insert("en".into(), BTreeMap::new());
            }),
            "texts.en"
        );
        assert_eq!(complain(|s| s.phases[1].scenes = 0), "phases[1].scenes");
        assert_eq!(complain(|s| s.phases.reverse()), "phases[1].phase");
        assert_eq!(complain(|s| s.parameters.human.speed_mps = -2.0), "parameters.human.speed_mps");
        assert_eq!(complain(|s| s.encounters.max_entry_s = 1.0), "encounters.max_entry_s");
    }
}
