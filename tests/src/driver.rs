//! A simulated participant, who enrols, drives and uploads trials.

use crate::{Address, Answer};
use reqwest::{Method, RequestBuilder};
use serde_json::json;
use sidestep::api::{Enrolled, KeyEvent, Object, TrialUpload, routes};
use sidestep::scene::{Scene, SceneParameters};
use sidestep::trial::simulate;
use sidestep::vehicle::TurnInput;

/// An honest upload of a scene, driven by the paper's vehicles with these inputs.
#[must_use]
pub fn upload(scene: &Scene, inputs: Vec<TurnInput>) -> TrialUpload {
    upload_with(&SceneParameters::default(), scene, inputs)
}

/// Like [`upload`], but with the vehicles of `parameters`.
#[must_use]
pub fn upload_with(
    parameters: &SceneParameters,
    scene: &Scene,
    inputs: Vec<TurnInput>,
) -> TrialUpload {
    let states = simulate(parameters, scene, &inputs);
    let key = |t_ms, down| KeyEvent { t_ms, key: "ArrowLeft".to_owned(), down };
    TrialUpload {
        started_at_ms: 1_760_000_000_123.25,
        inputs,
        states,
        sampled_at_ms: on_time(),
        key_events: vec![key(1990.5, true), key(5012.0, false)],
        page_events: Vec::new(),
        exposures: 1,
        display: Object::from_iter([("refresh_hz".to_owned(), json!(60.0))]),
    }
}

/// An upload of the scene, driven straight except for a left turn from 2 s to 5 s.
#[must_use]
pub fn driven(scene: &Scene) -> TrialUpload {
    driven_with(&SceneParameters::default(), scene)
}

/// Like [`driven`], but with the vehicles of `parameters`.
#[must_use]
pub fn driven_with(parameters: &SceneParameters, scene: &Scene) -> TrialUpload {
    let mut inputs = vec![TurnInput::Straight; 50];
    inputs[10..25].fill(TurnInput::Left);
    upload_with(parameters, scene, inputs)
}

/// Sampling times (ms) of a fast machine: a few milliseconds after the start of each step.
#[must_use]
pub fn on_time() -> Vec<f64> {
    (0..50).map(|step| f64::from(step) * 200.0 + 3.7).collect()
}

/// A participant.
#[derive(Clone, Debug)]
pub struct Driver {
    /// The server's response to the enrolment.
    pub enrolled: Enrolled,
}

impl Driver {
    /// Enrols a new participant in the study `default`.
    pub async fn enrol(server: &Address) -> Self {
        let answer = Self::ask(server, json!({ "consent": true })).await;
        Self { enrolled: answer.into(201) }
    }

    /// Asks for an enrolment in the study `default` with this body, and returns the answer.
    pub async fn ask(server: &Address, body: serde_json::Value) -> Answer {
        Self::ask_in(server, "default", body).await
    }

    /// Asks for an enrolment in this study, and returns the answer.
    pub async fn ask_in(server: &Address, study: &str, body: serde_json::Value) -> Answer {
        let request = server.request(Method::POST, &routes::participants(study));
        Answer::of(request.json(&body)).await
    }

    /// A request with the participant's token.
    pub fn request(&self, server: &Address, method: Method, route: &str) -> RequestBuilder {
        server.request(method, route).bearer_auth(&self.enrolled.token)
    }

    /// All scenes of the plan in order, each with the id of its trial.
    #[must_use]
    pub fn scenes(&self) -> Vec<(String, Scene)> {
        let pair = |scene: &sidestep::api::PlannedScene| (scene.trial_id.clone(), scene.scene());
        self.enrolled.plan.scenes().map(|(_, s)| pair(s)).collect()
    }

    /// Uploads a trial, and returns the answer.
    pub async fn send(&self, server: &Address, trial_id: &str, trial: &TrialUpload) -> Answer {
        let request = self.request(server, Method::PUT, &routes::my_trial(trial_id));
        Answer::of(request.json(trial)).await
    }

    /// Sends a `PUT` request with this body and the participant's token, and returns the answer.
    pub async fn put(&self, server: &Address, route: &str, body: &serde_json::Value) -> Answer {
        Answer::of(self.request(server, Method::PUT, route).json(body)).await
    }

    /// Drives the first `count` scenes and returns the uploaded trials.
    ///
    /// # Panics
    /// If an upload is not stored.
    pub async fn drive(&self, server: &Address, count: usize) -> Vec<(String, TrialUpload)> {
        let mut sent = Vec::new();
        for (trial_id, scene) in self.scenes().into_iter().take(count) {
            let trial = driven(&scene);
            let answer = self.send(server, &trial_id, &trial).await;
            assert_eq!(answer.status, 201, "{}", answer.body);
            sent.push((trial_id, trial));
        }
        sent
    }

    /// Drives all scenes with random inputs, each held for up to 1.2 s. The seed `who` determines
    /// the inputs.
    ///
    /// # Panics
    /// If a trial is not stored.
    pub async fn drive_restlessly(&self, server: &Address, parameters: &SceneParameters, who: u64) {
        let mut state = who.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1;
        for (id, scene) in self.scenes() {
            let mut inputs = Vec::new();
            while inputs.len() < parameters.steps {
                state ^= state << 13;
                state ^= state >> 7;
                state ^= state << 17;
                let input = TurnInput::ALL[(state % 3) as usize];
                inputs.extend(std::iter::repeat_n(input, 1 + (state >> 8) as usize % 6));
            }
            inputs.truncate(parameters.steps);
            let trial = upload_with(parameters, &scene, inputs);
            let answer = self.send(server, &id, &trial).await;
            assert_eq!(answer.status, 201, "{}", answer.body);
        }
    }

    /// Completes the participation, and returns the answer.
    pub async fn complete(&self, server: &Address) -> Answer {
        Answer::of(self.request(server, Method::POST, routes::COMPLETE)).await
    }

    /// Requests the participant's progress, and returns the answer.
    pub async fn me(&self, server: &Address) -> Answer {
        self.get(server, routes::ME).await
    }

    /// Sends a `GET` request with the participant's token, and returns the answer.
    pub async fn get(&self, server: &Address, route: &str) -> Answer {
        Answer::of(self.request(server, Method::GET, route)).await
    }

    /// Withdraws the participant, and returns the answer.
    pub async fn withdraw(&self, server: &Address, data: &str) -> Answer {
        let route = format!("{}?data={data}", routes::ME);
        Answer::of(self.request(server, Method::DELETE, &route)).await
    }
}
