//! A participant and the trials that the participant drives.

use crate::upload;
use sidestep::api::{Enrolled, TrialUpload};
use sidestep::scene::Scene;
use sidestep::vehicle::TurnInput;
use std::borrow::Cow;
use std::collections::VecDeque;

/// A withdrawal, and whether the server acknowledged it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Withdrawal {
    /// Whether the person asked for deletion of the data.
    pub delete: bool,
    /// Whether the server acknowledged the withdrawal.
    pub acknowledged: bool,
}

/// A participant.
#[derive(Debug)]
pub struct Person {
    /// The participant's id.
    pub id: String,
    /// The participant's token.
    pub token: String,
    /// Index among all people, from 0. It makes the person's trials different from all other
    /// people's trials.
    pub number: usize,
    /// The plan: the id and the scene of each trial.
    plan: Vec<(String, Scene)>,
    /// Bodies of the next trials, if they were prepared.
    prepared: VecDeque<Vec<u8>>,
    /// Number of acknowledged trials.
    acknowledged: usize,
    /// The withdrawal, if the person has withdrawn.
    pub withdrawal: Option<Withdrawal>,
}

impl Person {
    /// A person who has just enrolled.
    #[must_use]
    pub fn new(enrolled: Enrolled, number: usize) -> Self {
        let driver = crate::Driver { enrolled };
        let plan = driver.scenes();
        let Enrolled { participant_id: id, token, .. } = driver.enrolled;
        let prepared = VecDeque::new();
        Self { id, token, number, plan, prepared, acknowledged: 0, withdrawal: None }
    }

    /// The id of the next trial. `None` if all trials are acknowledged.
    #[must_use]
    pub fn next(&self) -> Option<&str> {
        self.plan.get(self.acknowledged).map(|(trial_id, _)| trial_id.as_str())
    }

    /// The last acknowledged trial: its id and its body.
    #[must_use]
    pub fn last(&self) -> Option<(&str, Vec<u8>)> {
        let place = self.acknowledged.checked_sub(1)?;
        Some((&self.plan[place].0, self.body(place)))
    }

    /// Prepares the bodies of all remaining trials, so that an upload only has to send one.
    pub fn prepare(&mut self) {
        let first = self.acknowledged + self.prepared.len();
        for place in first..self.plan.len() {
            let body = self.body(place);
            self.prepared.push_back(body);
        }
    }

    /// The body of the next trial. `None` if all trials are acknowledged.
    #[must_use]
    pub fn next_body(&self) -> Option<Cow<'_, [u8]>> {
        self.next()?;
        let made = || Cow::Owned(self.body(self.acknowledged));
        Some(self.prepared.front().map_or_else(made, |body| Cow::Borrowed(&body[..])))
    }

    /// Records that the server has acknowledged the next trial.
    pub fn acknowledge(&mut self) {
        self.prepared.pop_front();
        self.acknowledged += 1;
    }

    /// Number of acknowledged trials.
    #[must_use]
    pub fn count(&self) -> usize {
        self.acknowledged
    }

    /// The same person at an earlier time, when this number of trials was acknowledged. `deletion`
    /// is `None` if the person had not asked for deletion by then; otherwise it states whether the
    /// deletion was acknowledged.
    #[must_use]
    pub fn as_of(&self, acknowledged: usize, deletion: Option<bool>) -> Self {
        let withdrawal = deletion.map(|acknowledged| Withdrawal { delete: true, acknowledged });
        let (plan, prepared) = (self.plan.clone(), VecDeque::new());
        let [id, token] = [&self.id, &self.token].map(String::clone);
        Self { id, token, number: self.number, plan, prepared, acknowledged, withdrawal }
    }

    /// The ids of the acknowledged trials.
    pub fn acknowledged(&self) -> impl ExactSizeIterator<Item = &str> {
        self.plan[..self.acknowledged].iter().map(|(trial_id, _)| trial_id.as_str())
    }

    fn body(&self, place: usize) -> Vec<u8> {
        serde_json::to_vec(&self.trial(place)).expect("a trial as JSON")
    }

    /// The trial at index `place` of the plan. It is unique, because its start time and its key
    /// events identify the person and the trial.
    #[must_use]
    pub fn trial(&self, place: usize) -> TrialUpload {
        const STEP_MS: f64 = 200.0;
        let (_, scene) = &self.plan[place];
        let [begin, end] =
            [5 + (7 * self.number + 3 * place) % 15, 25 + (self.number + place) % 20];
        let mut inputs = vec![TurnInput::Straight; 50];
        inputs[begin..end].fill(TurnInput::Left);
        let mut trial = upload(scene, inputs);
        trial.started_at_ms = 1_760_000_000_000.25 + (1_000 * self.number + place) as f64;
        let early_ms = 1.0 + (self.number % 997) as f64 / 10.0;
        for (event, step) in trial.key_events.iter_mut().zip([begin, end]) {
            event.t_ms = step as f64 * STEP_MS - early_ms;
        }
        trial
    }
}
