//! Participants, and the trials that they drive.

use serde_json::{Map, json};
use sidestep::api::{Enrolled, KeyEvent, PlannedScene, TrialUpload};
use sidestep::math::SeededRng;
use sidestep::scene::{Scene, SceneParameters};
use sidestep::trial::simulate;
use sidestep::vehicle::TurnInput;

/// Somebody who takes part.
pub(crate) struct Participant {
    pub(crate) token: String,
    /// What is to be driven: trial and scene.
    plan: Vec<(String, Scene)>,
    /// How many trials the server has acknowledged.
    acknowledged: usize,
}

impl Participant {
    pub(crate) fn new(enrolled: &Enrolled) -> Self {
        let trial = |scene: &PlannedScene| (scene.trial_id.clone(), scene.scene());
        let plan = enrolled.plan.scenes().map(|(_, scene)| trial(scene)).collect();
        Self { token: enrolled.token.clone(), plan, acknowledged: 0 }
    }

    /// The trial that comes next; none after the last.
    pub(crate) fn next(&self) -> Option<&(String, Scene)> {
        self.plan.get(self.acknowledged)
    }

    /// The server has stored the trial that came next.
    pub(crate) fn acknowledge(&mut self) {
        self.acknowledged += 1;
    }

    pub(crate) fn acknowledged(&self) -> &[(String, Scene)] {
        &self.plan[..self.acknowledged]
    }
}

/// The trial that is driven in a scene: always the same, so that what was sent can be told
/// from its id. A turn to either side, at some time.
pub(crate) fn drive(trial_id: &str, scene: &Scene) -> TrialUpload {
    let parameters = SceneParameters::default();
    let id = trial_id.bytes().fold(0u64, |id, byte| id.wrapping_mul(31) ^ u64::from(byte));
    let mut rng = SeededRng::new(id);
    let (begin, steps) = (5 + rng.below(15), 3 + rng.below(20));
    let (side, key) =
        [(TurnInput::Left, "ArrowLeft"), (TurnInput::Right, "ArrowRight")][rng.below(2)];
    let mut inputs = vec![TurnInput::Straight; parameters.steps];
    inputs[begin..begin + steps].fill(side);
    let states = simulate(&parameters, scene.start(), &inputs);
    let step_ms = 1000.0 * parameters.step_s;
    let mut event = |step: usize, down| KeyEvent {
        t_ms: step as f64 * step_ms - rng.uniform(0.0, step_ms),
        key: key.to_owned(),
        down,
    };
    let key_events = vec![event(begin, true), event(begin + steps, false)];
    let late = |step: usize| step as f64 * step_ms + rng.uniform(0.0, 16.7);
    TrialUpload {
        started_at_ms: 1_760_000_000_000.0 + (id % 1_000_000_000) as f64,
        inputs,
        states,
        sampled_at_ms: (0..parameters.steps).map(late).collect(),
        key_events,
        display: Map::from_iter([
            ("refresh_hz".to_owned(), json!(60.0)),
            ("frames".to_owned(), json!(612)),
            ("longest_frame_ms".to_owned(), json!(18.4)),
        ]),
    }
}
