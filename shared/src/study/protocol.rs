//! The protocol around the scenes: consent, the check of understanding, the course of a trial, and
//! the closing page.

use super::localised::{Fact, Localised};
use crate::invalid::Invalid;
use serde::{Deserialize, Serialize};

/// Maximum length of a text in Markdown (characters).
const MAX_MARKDOWN: usize = 20_000;

/// Maximum length of a sentence (characters).
pub(super) const MAX_SENTENCE: usize = 500;

/// Responsible people and the consent text. The page shows the parts that are given. If `text` is
/// missing, the page shows Sidestep's own text.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Consent {
    /// Name of the investigator.
    pub investigator: Fact,
    /// University or company.
    pub institution: Fact,
    /// Contact of the investigator: an e-mail address or a telephone number.
    pub contact: Fact,
    /// Number of the ethics approval.
    pub ethics: Fact,
    /// Retention period and storage location of the data.
    pub retention: Fact,
    /// The researcher's own text in Markdown, by language.
    pub text: Localised,
}

impl Consent {
    /// The facts by field name, without the text.
    #[must_use]
    pub fn facts(&self) -> [(&'static str, &Fact); 5] {
        [
            ("investigator", &self.investigator),
            ("institution", &self.institution),
            ("contact", &self.contact),
            ("ethics", &self.ethics),
            ("retention", &self.retention),
        ]
    }

    pub(super) fn check(&self) -> Result<(), Invalid> {
        for (field, fact) in self.facts() {
            fact.check(&format!("consent.{field}"), MAX_SENTENCE)?;
        }
        self.text.check("consent.text", MAX_MARKDOWN)
    }
}

/// The check that participants have understood the instructions.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Comprehension {
    /// Whether to ask Sidestep's own questions (about the robot, the keys and the danger zone).
    /// Default: true.
    pub standard: bool,
    /// Further questions.
    pub questions: Vec<CheckQuestion>,
    /// Number of questions drawn at random for each participant, 0 to 26; Sidestep contributes six.
    /// Default: 0, which asks all further questions and Sidestep's first three.
    pub draw: usize,
    /// Consequence of an attempt with a wrong answer. Default: `mark`.
    pub after_wrong: AfterWrong,
    /// Number of attempts with a wrong answer after which the participation ends and counts as
    /// screened out, 0 to 20. Default: 0, which allows unlimited attempts.
    pub attempts: usize,
}

impl Default for Comprehension {
    fn default() -> Self {
        Self {
            standard: true,
            questions: Vec::new(),
            draw: 0,
            after_wrong: AfterWrong::Mark,
            attempts: 0,
        }
    }
}

/// Consequence of an attempt at the check of understanding with a wrong answer.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum AfterWrong {
    /// Each answer is marked as right or wrong, and the participant changes the wrong answers.
    #[default]
    Mark,
    /// The page does not reveal the wrong answer, and the participant starts again: questions are
    /// redrawn, and options are in another order.
    Renew,
    /// Like [`Self::Renew`], but the participant first reads the instructions again.
    Reread,
}

impl AfterWrong {
    /// All consequences.
    pub const ALL: [Self; 3] = [Self::Mark, Self::Renew, Self::Reread];

    /// The word in study files and in JSON.
    #[must_use]
    pub fn word(self) -> &'static str {
        match self {
            Self::Mark => "mark",
            Self::Renew => "renew",
            Self::Reread => "reread",
        }
    }
}

/// Number of Sidestep's own questions. If no questions are drawn, the first three are asked.
const STANDARD_QUESTIONS: usize = 6;

/// A question with one right answer.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CheckQuestion {
    /// The question, by language.
    pub text: Localised,
    /// The 2 to 8 answers, by language.
    pub options: Vec<Localised>,
    /// Index of the right answer, from 0.
    pub answer: usize,
}

impl Comprehension {
    /// Whether questions or the order of options differ between participants.
    #[must_use]
    pub fn is_drawn(&self) -> bool {
        self.draw > 0 || self.after_wrong != AfterWrong::Mark
    }

    pub(super) fn check(&self) -> Result<(), Invalid> {
        if self.attempts > 20 {
            let expected = "a whole number from 0 to 20";
            return Err(Invalid::new("comprehension.attempts", expected, self.attempts));
        }
        if self.questions.len() > 20 {
            let found = self.questions.len();
            return Err(Invalid::new("comprehension.questions", "at most 20 questions", found));
        }
        if self.attempts > 0 && !self.standard && self.questions.is_empty() {
            let expected = "0, or a check: standard = true or questions";
            return Err(Invalid::new("comprehension.attempts", expected, self.attempts));
        }
        let all = self.questions.len() + if self.standard { STANDARD_QUESTIONS } else { 0 };
        if self.draw > all {
            let expected =
                format!("a whole number from 0 to {all}, the number of available questions");
            return Err(Invalid::new("comprehension.draw", expected, self.draw));
        }
        for (i, question) in self.questions.iter().enumerate() {
            let field = format!("comprehension.questions[{i}]");
            question.text.check_given(&format!("{field}.text"), MAX_SENTENCE)?;
            if !(2..=8).contains(&question.options.len()) {
                let field = format!("{field}.options");
                return Err(Invalid::new(field, "2 to 8 answers", question.options.len()));
            }
            for (k, option) in question.options.iter().enumerate() {
                let field = format!("{field}.options[{k}]");
                option.check_given(&field, MAX_SENTENCE)?;
                option.check_new(&field, &question.options[..k])?;
            }
            if question.answer >= question.options.len() {
                let expected = format!("a place from 0 to {}", question.options.len() - 1);
                return Err(Invalid::new(format!("{field}.answer"), expected, question.answer));
            }
        }
        Ok(())
    }
}

/// The course of every trial.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct TrialSettings {
    /// Countdown before a scene starts, shown over the still scene: a whole number of seconds from
    /// 1 to 10. Default: 3.
    pub countdown_s: u32,
    /// Time for which the last picture of a scene stays visible (s), 0 to 5. Default: 0.6.
    pub end_s: f64,
    /// Minimum time for which the last picture stays visible in phases with feedback (s), counted
    /// from when it is shown, 1.5 to 10. Default: 1.5.
    pub feedback_s: f64,
    /// Whether the participant drives an interrupted trial again, after all other trials, as a
    /// further attempt. The first attempt is kept. Default: false.
    pub repeat_interrupted: bool,
    /// Number of tasks after which the page offers a rest; 0 means never. Default: 10.
    pub rest_after: usize,
    /// Whether the scenes ask for the full screen. Default: true. A participant may decline.
    pub fullscreen: bool,
}

impl Default for TrialSettings {
    fn default() -> Self {
        Self {
            countdown_s: 3,
            end_s: 0.6,
            feedback_s: 1.5,
            repeat_interrupted: false,
            rest_after: 10,
            fullscreen: true,
        }
    }
}

impl TrialSettings {
    /// Time for which the last picture of a scene stays visible (s), with or without feedback.
    #[must_use]
    pub fn stays_s(&self, feedback: bool) -> f64 {
        if feedback { self.end_s.max(self.feedback_s) } else { self.end_s }
    }

    pub(super) fn check(&self) -> Result<(), Invalid> {
        if !(1..=10).contains(&self.countdown_s) {
            let expected = "a whole number of seconds from 1 to 10";
            return Err(Invalid::new("trials.countdown_s", expected, self.countdown_s));
        }
        if !(0.0..=5.0).contains(&self.end_s) {
            return Err(Invalid::new("trials.end_s", "seconds from 0 to 5", self.end_s));
        }
        if !(1.5..=10.0).contains(&self.feedback_s) {
            let expected = "seconds from 1.5 to 10, long enough to read";
            return Err(Invalid::new("trials.feedback_s", expected, self.feedback_s));
        }
        if self.rest_after > super::MAX_SCENES {
            let expected = format!("a whole number from 0 to {}", super::MAX_SCENES);
            return Err(Invalid::new("trials.rest_after", expected, self.rest_after));
        }
        Ok(())
    }
}

/// The last page.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Closing {
    /// What the study was about, in Markdown, by language. Shown after the last scene.
    pub debrief: Localised,
}

impl Closing {
    pub(super) fn check(&self) -> Result<(), Invalid> {
        self.debrief.check("closing.debrief", MAX_MARKDOWN)
    }
}
