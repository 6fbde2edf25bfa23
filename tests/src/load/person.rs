//! A participant, and their trials.

use crate::upload;
use sidestep::api::{Enrolled, TrialUpload};
use sidestep::scene::Scene;
use sidestep::vehicle::TurnInput;
use std::borrow::Cow;
use std::collections::VecDeque;

/// A withdrawal, and whether the server acknowledged it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Withdrawal {
    /// Whether the data were to be deleted.
    pub delete: bool,
    /// Whether the server acknowledged it.
    pub acknowledged: bool,
}

/// A participant.
#[derive(Debug)]
pub struct Person {
    /// Their id.
    pub id: String,
    /// Their token.
    pub token: String,
    /// Index among all people, from 0: their trials differ from those of all others.
    pub number: usize,
    /// The plan: trial and scene.
    plan: Vec<(String, Scene)>,
    /// Bodies of the next trials, prepared in advance.
    prepared: VecDeque<Vec<u8>>,
    /// Number of acknowledged trials.
    acknowledged: usize,
    /// Their withdrawal, if any.
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

    /// The id of the next trial; `None` after the last.
    #[must_use]
    pub fn next(&self) -> Option<&str> {
        self.plan.get(self.acknowledged).map(|(trial_id, _)| trial_id.as_str())
    }

    /// The trial that the server acknowledged last, and its body.
    #[must_use]
    pub fn last(&self) -> Option<(&str, Vec<u8>)> {
        let place = self.acknowledged.checked_sub(1)?;
        Some((&self.plan[place].0, self.body(place)))
    }

    /// Prepares the bodies of all remaining trials, so that only sending is left.
    pub fn prepare(&mut self) {
        let first = self.acknowledged + self.prepared.len();
        for place in first..self.plan.len() {
            let body = self.body(place);
            self.prepared.push_back(body);
        }
    }

    /// The body of the next trial; `None` after the last.
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

    /// The same person with fewer trials acknowledged, and with the deletion of their data
    /// acknowledged or not, if they had requested it.
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

    /// The trial at an index of the plan. It is unique: its start and the time of the key press
    /// identify the driver.
    #[must_use]
    pub fn trial(&self, place: usize) -> TrialUpload {
        const STEP_MS: f64 = 200.0;
        let (_, scene) = self.plan[place];
        let [begin, end] =
            [5 + (7 * self.number + 3 * place) % 15, 25 + (self.number + place) % 20];
        let mut inputs = vec![TurnInput::Straight; 50];
        inputs[begin..end].fill(TurnInput::Left);
        let mut trial = upload(&scene, inputs);
        trial.started_at_ms = 1_760_000_000_000.25 + (1_000 * self.number + place) as f64;
        let early_ms = 1.0 + (self.number % 997) as f64 / 10.0;
        for (event, step) in trial.key_events.iter_mut().zip([begin, end]) {
            event.t_ms = step as f64 * STEP_MS - early_ms;
        }
        trial
    }
}
