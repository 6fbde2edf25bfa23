//! A synthetic participant who takes part through the HTTP interface, like a real participant.

use crate::client::{Client, ClientError, Participation};
use crate::support::clock::now_ms;
use serde_json::{Value, json};
use sidestep::api::{
    Answers, ComprehensionResult, Enrolment, KeyEvent, Object, Plan, PlannedScene, QuestionForm,
    StudyInfo, Texts, TrialUpload,
};
use sidestep::scene::{Scene, SceneParameters};
use sidestep::study::QuestionKind;
use sidestep::synthetic::{KeyChange, Keys, SyntheticDrive, SyntheticParticipant};
use sidestep::trial::Phase;
use sidestep::vehicle::TurnInput;
use std::collections::HashSet;

/// A synthetic participant of a study on a server.
#[derive(Clone, Copy)]
pub(in crate::commands) struct Volunteer<'a> {
    pub(in crate::commands) server: &'a Client,
    pub(in crate::commands) study: &'a StudyInfo,
    pub(in crate::commands) participant: SyntheticParticipant,
    /// Upper bound on the number of tasks they drive. A participant who does not drive all tasks
    /// does not complete the study.
    pub(in crate::commands) tasks: u64,
    /// Number of attempts at the comprehension check. The last attempt is correct.
    pub(in crate::commands) attempts: usize,
    /// Selects their answers. 0 selects the first option of a choice and the middle of a scale. Any
    /// other number is an offset from these answers.
    pub(in crate::commands) opinion: usize,
    /// Changes a trial before it is sent.
    pub(in crate::commands) mishap: Mishap,
}

/// A function that changes the trial of a scene, in a study with these parameters.
pub(in crate::commands) type Mishap = fn(&SceneParameters, Phase, &PlannedScene, &mut TrialUpload);

/// A scene of the plan.
pub(in crate::commands) enum Seen<'a> {
    /// The server has already stored its trial.
    Stored,
    /// The participant drives it now.
    Drives {
        /// The scene.
        scene: &'a Scene,
        /// The drive.
        drive: &'a SyntheticDrive,
    },
}

impl<'a> Volunteer<'a> {
    /// A participant who drives everything, understands at the first attempt, and has no mishap.
    pub(in crate::commands) fn new(
        server: &'a Client,
        study: &'a StudyInfo,
        participant: SyntheticParticipant,
    ) -> Self {
        let (tasks, attempts, opinion) = (u64::MAX, 1, 0);
        Self { server, study, participant, tasks, attempts, opinion, mishap: |_, _, _, _| () }
    }

    /// Enrols with this external id, or resumes the participation with this id.
    ///
    /// # Errors
    /// [`ClientError`]; `withdrawn` or `screened_out` if the participation has ended.
    pub(in crate::commands) async fn enrol(
        &self,
        name: String,
    ) -> Result<Participation, ClientError> {
        let body = Enrolment {
            consent: true,
            external_id: Some(name),
            parameters: Object::default(),
            pilot: false,
            request_id: None,
            locale: Some("en".to_owned()),
            screen: Some(synthetic()),
        };
        self.server.enrol(&self.study.slug, &body).await
    }

    /// Takes part from enrolment to completion, or until the limit on tasks is reached. Skips trials
    /// that are already on the server.
    ///
    /// # Errors
    /// The errors of [`Self::enrol`].
    pub(in crate::commands) async fn take_part(
        &self,
        name: String,
        mut see: impl FnMut(Seen<'_>),
    ) -> Result<Participation, ClientError> {
        let me = self.enrol(name).await?;
        let mut known = me.progress().await?;
        if !known.understood {
            let result = ComprehensionResult { attempts: self.attempts, passed: true };
            me.check_understanding(&result).await?;
        }
        let mut seen = HashSet::new();
        let all = loop {
            let wanted = self.wanted(&known.plan);
            let before = seen.len();
            for &(number, phase, planned) in &wanted {
                if !seen.insert(planned.trial_id.clone()) {
                    continue;
                }
                if known.stored.contains(&planned.trial_id) {
                    see(Seen::Stored);
                    continue;
                }
                let (parameters, scene) = (&self.study.parameters, planned.scene());
                let drive = self.participant.drive(number, parameters, &scene, Keys::Clock);
                see(Seen::Drives { scene: &scene, drive: &drive });
                let mut trial = upload(parameters, drive);
                (self.mishap)(parameters, phase, planned, &mut trial);
                me.store(&planned.trial_id, &trial).await?;
            }
            if seen.len() == before {
                break wanted.len() == known.plan.scenes().count();
            }
            // The server might have planned a second attempt at an interrupted task.
            known = me.progress().await?;
        };
        if all && !known.answered {
            me.answer(&self.answers(&self.server.texts(&self.study.slug, "en").await?)).await?;
        }
        if all && !known.complete {
            me.complete().await?;
        }
        Ok(me)
    }

    /// The scenes to drive, each with its number in the plan. The numbers count all phases and
    /// include skipped scenes.
    fn wanted<'p>(&self, plan: &'p Plan) -> Vec<(u64, Phase, &'p PlannedScene)> {
        let mut tasks = 0;
        let scenes = (0..).zip(plan.scenes()).filter(|(_, (phase, _))| {
            tasks += u64::from(phase.phase == Phase::Task);
            phase.phase != Phase::Task || tasks <= self.tasks
        });
        scenes.map(|(number, (phase, planned))| (number, phase.phase, planned)).collect()
    }

    /// Valid answers to all questions.
    fn answers(&self, texts: &Texts) -> Answers {
        let answer = |question: &QuestionForm| match question.kind {
            QuestionKind::Text => {
                Value::from("synthetic".chars().take(question.max_chars).collect::<String>())
            }
            QuestionKind::Choice => {
                let options = question.options.iter().cycle().skip(self.opinion);
                options.take(1).map(|o| Value::from(o.0.clone())).next().unwrap_or_default()
            }
            QuestionKind::Scale => {
                let (from, to) = question.range;
                let above = i64::midpoint(from, to) - from + self.opinion as i64;
                Value::from(from + above % (to - from + 1).max(1))
            }
        };
        let questions = texts.questions.iter();
        Answers { answers: questions.map(|q| (q.name.clone(), answer(q))).collect() }
    }
}

/// The record of screen and display. It contains only the mark of a synthetic participant.
fn synthetic() -> Object<Value> {
    Object::from_iter([("synthetic".to_owned(), json!(true))])
}

fn upload(parameters: &SceneParameters, drive: SyntheticDrive) -> TrialUpload {
    // The trial took no real time. Pretend that it started one trial duration ago.
    let started_at_ms = now_ms() as f64 - 1000.0 * parameters.duration_s();
    TrialUpload {
        started_at_ms: started_at_ms.max(0.0),
        key_events: key_events(&drive.key_changes),
        inputs: drive.inputs,
        states: drive.states,
        sampled_at_ms: drive.sampled_at_ms,
        page_events: Vec::new(),
        exposures: 1,
        display: synthetic(),
    }
}

/// The key events of a person who steers with one finger, so each key is released before the next key
/// is pressed.
fn key_events(changes: &[KeyChange]) -> Vec<KeyEvent> {
    let name = |input| match input {
        TurnInput::Left => Some("ArrowLeft"),
        TurnInput::Right => Some("ArrowRight"),
        TurnInput::Straight => None,
    };
    let mut events = Vec::new();
    let mut held = None;
    for change in changes {
        let mut event = |key: Option<&str>, down| {
            events.extend(key.map(|key| KeyEvent {
                t_ms: change.at_ms,
                key: key.to_owned(),
                down,
            }));
        };
        event(held, false);
        held = name(change.input);
        event(held, true);
    }
    events
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_go_up_before_others_go_down() {
        use TurnInput::{Left, Right, Straight};
        let change = |at_ms, input| KeyChange { at_ms, input };
        let changes = [change(50.0, Left), change(400.0, Right), change(950.0, Straight)];
        let events: Vec<_> =
            key_events(&changes).into_iter().map(|e| (e.t_ms, e.key, e.down)).collect();
        let expected = [
            (50.0, "ArrowLeft", true),
            (400.0, "ArrowLeft", false),
            (400.0, "ArrowRight", true),
            (950.0, "ArrowRight", false),
        ];
        assert_eq!(events, expected.map(|(t_ms, key, down)| (t_ms, key.to_owned(), down)));
    }
}
