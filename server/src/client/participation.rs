//! The client for participants.

use super::{Client, ClientError};
use reqwest::{Method, RequestBuilder};
use serde::Serialize;
use sidestep::api::{
    Answers, Completed, ComprehensionResult, ComprehensionStored, Enrolled, Plan, Progress,
    TrialStored, TrialUpload, Withdrawn, routes,
};

/// An enrolled participant.
#[derive(Clone, Debug)]
pub struct Participation {
    client: Client,
    enrolled: Enrolled,
}

impl Participation {
    pub(super) fn new(client: Client, enrolled: Enrolled) -> Self {
        Self { client, enrolled }
    }

    /// The participant's id on the server.
    #[must_use]
    pub fn participant_id(&self) -> &str {
        &self.enrolled.participant_id
    }

    /// The participant's plan.
    #[must_use]
    pub fn plan(&self) -> &Plan {
        &self.enrolled.plan
    }

    /// The participant's progress.
    ///
    /// # Errors
    /// [`ClientError`].
    pub async fn progress(&self) -> Result<Progress, ClientError> {
        let get = self.request(Method::GET, routes::ME);
        self.client.ask("the state of a participation", get).await
    }

    /// Stores the result of the comprehension check.
    ///
    /// # Errors
    /// [`ClientError`].
    pub async fn check_understanding(
        &self,
        result: &ComprehensionResult,
    ) -> Result<ComprehensionStored, ClientError> {
        let put = self.request(Method::PUT, routes::COMPREHENSION).json(result);
        self.client.ask("the check of understanding", put).await
    }

    /// Stores a trial. The request is idempotent.
    ///
    /// # Errors
    /// [`ClientError`]; `different_content` or `out_of_order` if the trial cannot be stored now.
    pub async fn store<V: Serialize>(
        &self,
        trial_id: &str,
        trial: &TrialUpload<V>,
    ) -> Result<TrialStored, ClientError> {
        let put = self.request(Method::PUT, &routes::my_trial(trial_id)).json(trial);
        self.client.ask("a trial", put).await
    }

    /// Stores the answers to the questions after the last scene.
    ///
    /// # Errors
    /// [`ClientError`].
    pub async fn answer<V: Serialize>(&self, answers: &Answers<V>) -> Result<(), ClientError> {
        let put = self.request(Method::PUT, routes::ANSWERS).json(answers);
        self.client.bytes("the answers", put).await.map(drop)
    }

    /// Completes the participation.
    ///
    /// # Errors
    /// [`ClientError`]; `incomplete` or `unanswered` while something is missing.
    pub async fn complete(&self) -> Result<Completed, ClientError> {
        let post = self.request(Method::POST, routes::COMPLETE);
        self.client.ask("the completion", post).await
    }

    /// Withdraws the participant. If `delete` is true, the server deletes all their data.
    ///
    /// # Errors
    /// [`ClientError`].
    pub async fn withdraw(&self, delete: bool) -> Result<Withdrawn, ClientError> {
        let fate = if delete { "delete" } else { "keep" };
        let delete = self.request(Method::DELETE, &format!("{}?data={fate}", routes::ME));
        self.client.ask("the withdrawal", delete).await
    }

    fn request(&self, method: Method, route: &str) -> RequestBuilder {
        self.client.request(method, route).bearer_auth(&self.enrolled.token)
    }
}
