//! Wire types of a participation, from enrolment to completion code.

#[cfg(feature = "openapi")]
use super::MAX_NAME_CHARS;
use super::{
    MAX_PARAMETERS, MIN_REQUEST_ID_BYTES, Object, check_name, check_object, first, is_first,
};
use crate::invalid::Invalid;
use crate::scene::{RobotPolicy, Scene};
use crate::study::{AfterWrong, normalised_id};
use crate::trial::Phase;
use crate::vehicle::Pose;
use serde::{Deserialize, Serialize};
use serde_json::Value;

/// Request body with the result of the check of understanding.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct ComprehensionResult {
    /// Number of times the participant answered all questions.
    #[cfg_attr(feature = "openapi", schemars(range(min = 1, max = 1_000)))]
    pub attempts: usize,
    /// Whether all answers of the last attempt were right.
    pub passed: bool,
}

/// Response to the result of the check of understanding.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
pub struct ComprehensionStored {
    /// Whether the participation has ended after too many wrong attempts.
    pub screened_out: bool,
    /// The consequence of a wrong answer, if the participation continues.
    #[serde(default)]
    pub after_wrong: AfterWrong,
    /// Return URL, if the participation has ended and the study sets one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub return_url: Option<String>,
}

/// Request body with the answers to the questions after the last scene. `V` is the type of an
/// answer. On the server, an answer can be any JSON value.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
#[cfg_attr(
    feature = "openapi",
    schemars(rename = "Answers", description = "Answers to the questions after the last scene.")
)]
pub struct Answers<V = Value> {
    /// The answers by question name. An answer is a string for a text, an option's value for a
    /// choice, and a whole number for a scale. Unanswered questions are absent.
    pub answers: Object<V>,
}

/// Response to a withdrawal.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
pub struct Withdrawn {
    /// Return URL, if the study sets one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub return_url: Option<String>,
}

/// Request body of an enrolment. `V` is the type of the facts about the screen, as in
/// [`TrialUpload`](super::TrialUpload).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
#[cfg_attr(
    feature = "openapi",
    schemars(rename = "Enrolment", description = "Body of an enrolment.")
)]
pub struct Enrolment<V = Value> {
    /// Whether the participant agreed to take part. Must be true.
    #[cfg_attr(feature = "openapi", schemars(extend("const" = true)))]
    pub consent: bool,
    /// The person's id at the recruiting service. Enrolling again with the same id resumes the
    /// participation.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[cfg_attr(
        feature = "openapi",
        schemars(
            length(max = 128),
            regex(pattern = r"^\s*[A-Za-z0-9_.@:+=/~-][A-Za-z0-9 _.@:+=/~-]*\s*$")
        )
    )]
    pub external_id: Option<String>,
    /// Secret idempotency key that the client generates for this enrolment, such as a random UUID.
    /// A retry after a lost response returns the same participant.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "openapi", schemars(length(min = 1, max = MAX_NAME_CHARS)))]
    pub request_id: Option<String>,
    /// URL parameters that the study stores, by name.
    #[serde(default, skip_serializing_if = "Object::is_empty")]
    pub parameters: Object<String>,
    /// Whether this is a pilot. A pilot is stored separately from the data, its completion code
    /// begins with `PILOT-`, and it has no return URL.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub pilot: bool,
    /// Language in which the participant read the consent text, such as `en` or `zh-CN`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "openapi", schemars(length(min = 1, max = MAX_NAME_CHARS)))]
    pub locale: Option<String>,
    /// Facts about the screen: any small object.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub screen: Option<Object<V>>,
}

impl<V: Serialize> Enrolment<V> {
    /// Checks that the participant consented and that all fields are valid.
    ///
    /// # Errors
    /// [`Invalid`] naming the field.
    pub fn check(&self) -> Result<(), Invalid> {
        if !self.consent {
            return Err(Invalid::new("consent", "true", "false"));
        }
        if let Some(id) = &self.external_id {
            normalised_id("external_id", id)?;
        }
        if let Some(locale) = &self.locale {
            check_name("locale", locale)?;
        }
        if self.parameters.len() > MAX_PARAMETERS {
            let expected = format!("at most {MAX_PARAMETERS} parameters");
            return Err(Invalid::new("parameters", expected, self.parameters.len()));
        }
        for (name, value) in self.parameters.iter() {
            check_name("parameters", name)?;
            check_name(&format!("parameters.{name}"), value)?;
        }
        if let Some(id) = &self.request_id {
            check_name("request_id", id)?;
            if id.len() < MIN_REQUEST_ID_BYTES {
                let expected = format!("at least {MIN_REQUEST_ID_BYTES} unguessable bytes");
                return Err(Invalid::new("request_id", expected, format!("{} bytes", id.len())));
            }
        }
        self.screen.as_ref().map_or(Ok(()), |screen| check_object("screen", screen))
    }
}

/// Response to an enrolment. `P` is the type of a robot's rule. The participant's page leaves it
/// unread if it has no code for rules, because most participants meet only straight robots.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
#[cfg_attr(
    feature = "openapi",
    schemars(rename = "Enrolled", description = "Response to an enrolment.")
)]
pub struct Enrolled<P = Box<RobotPolicy>> {
    /// Id of the participant.
    pub participant_id: String,
    /// Bearer token for all further requests.
    pub token: String,
    /// The scenes to drive.
    pub plan: Plan<P>,
}

/// The scenes of a participant.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
#[cfg_attr(
    feature = "openapi",
    schemars(rename = "Plan", description = "The scenes of a participant.")
)]
pub struct Plan<P = Box<RobotPolicy>> {
    /// The phases, in order.
    pub phases: Vec<PlannedPhase<P>>,
}

impl<P> Plan<P> {
    /// Every scene in the order of driving, with its phase.
    pub fn scenes(&self) -> impl Iterator<Item = (&PlannedPhase<P>, &PlannedScene<P>)> {
        self.phases.iter().flat_map(|phase| phase.scenes.iter().map(move |scene| (phase, scene)))
    }
}

/// One phase of a plan.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
#[cfg_attr(
    feature = "openapi",
    schemars(rename = "PlannedPhase", description = "One phase of a plan.")
)]
pub struct PlannedPhase<P = Box<RobotPolicy>> {
    /// The phase.
    pub phase: Phase,
    /// Whether the danger zone is drawn around the robot.
    pub show_danger_zone: bool,
    /// The scenes, in order.
    pub scenes: Vec<PlannedScene<P>>,
}

/// One scene of a plan.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
#[cfg_attr(
    feature = "openapi",
    schemars(rename = "PlannedScene", description = "One scene of a plan.")
)]
pub struct PlannedScene<P = Box<RobotPolicy>> {
    /// The id under which its trial is stored.
    pub trial_id: String,
    /// Index within its phase, from 0.
    pub index: usize,
    /// Attempt number: 1, or 2 if the scene is driven again because its first trial was
    /// interrupted.
    #[serde(default = "first", skip_serializing_if = "is_first")]
    pub attempt: u32,
    /// Pose of the human's vehicle at the start.
    pub human: Pose,
    /// Pose of the robot at the start.
    pub robot: Pose,
    /// The robot's goal (m).
    pub goal: [f64; 2],
    /// The rule that moves the robot. Absent if it drives straight.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub policy: Option<P>,
}

impl<P> PlannedScene<P> {
    /// Both vehicles and the goal, with a robot that drives straight.
    #[must_use]
    pub fn straight_scene(&self) -> Scene {
        Scene { human: self.human, robot: self.robot, goal: self.goal, policy: None }
    }
}

impl PlannedScene {
    /// Both vehicles, the goal and the rule that moves the robot.
    #[must_use]
    pub fn scene(&self) -> Scene {
        Scene { policy: self.policy.clone(), ..self.straight_scene() }
    }
}

/// The progress of a participant.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
#[cfg_attr(
    feature = "openapi",
    schemars(rename = "Progress", description = "The progress of a participant.")
)]
pub struct Progress<P = Box<RobotPolicy>> {
    /// Id of the participant.
    pub participant_id: String,
    /// The study's name in URLs.
    pub study: String,
    /// The scenes to drive.
    pub plan: Plan<P>,
    /// Ids of the stored trials, in the plan's order.
    pub stored: Vec<String>,
    /// Id of the next trial. Absent when all trials are stored.
    pub next: Option<String>,
    /// The completion code, once the participation is complete.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub completion_code: Option<String>,
    /// Return URL, once the participation is complete, if the study sets one. It lacks the
    /// completion code if this token may not see the code.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub return_url: Option<String>,
    /// Whether the participation is complete. If this token was obtained with the external id
    /// alone, the completion code is absent even from a complete participation.
    #[serde(default)]
    pub complete: bool,
    /// Whether the check of understanding was passed.
    #[serde(default)]
    pub understood: bool,
    /// Number of attempts at the check of understanding.
    #[serde(default)]
    pub comprehension_attempts: usize,
    /// Whether the questions after the last scene were answered.
    #[serde(default)]
    pub answered: bool,
    /// Whether this is a pilot.
    #[serde(default)]
    pub pilot: bool,
    /// Whether this token may withdraw the participation. A token obtained with the external id
    /// alone may not.
    #[serde(default)]
    pub may_withdraw: bool,
}

/// Response to a completion.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
pub struct Completed {
    /// The completion code, which proves that every trial is stored.
    pub completion_code: String,
    /// Return URL with the code, if the study sets one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub return_url: Option<String>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_external_id_is_more_than_white_space() {
        let check = |id: &str| {
            let body = serde_json::json!({ "consent": true, "external_id": id });
            serde_json::from_value::<Enrolment>(body).unwrap().check()
        };
        for id in ["   ", "\u{a0}", "\u{3000}\u{2003}"] {
            let said = check(id).unwrap_err().to_string();
            assert!(said.starts_with("external_id: expected 1 to 128 characters"), "{said}");
        }
        assert_eq!(check(" P 17 "), Ok(()));
    }
}
