//! The client for experimenters and their programs.

use super::{Client, ClientError};
use reqwest::{Method, RequestBuilder};
use serde::Serialize;
use serde::de::DeserializeOwned;
use sidestep::api::{
    AnalysisDetail, AnalysisPage, AnalysisSummary, AuditPage, Configuration, Draft, DraftChecked,
    FormDraft, KeyMade, KeySummary, NewExclusion, NewKey, NewNote, NewStatus, Note,
    ParticipantDetail, ParticipantPage, PilotsDeleted, PredictorPage, SelfCheck, Session,
    StudySummary, TrainedPredictor, TrialDetail, TrialPage, routes,
};
use sidestep::comparison::Request;
use sidestep::study::Status;

/// A client for the laboratory that sends an experimenter's key.
#[derive(Clone, Debug)]
pub struct Laboratory {
    client: Client,
    key: String,
}

/// Appends a query, such as `limit=500&offset=500`, to a route. The server's OpenAPI document lists
/// the parameters of each route.
fn with(route: &str, query: &str) -> String {
    if query.is_empty() { route.to_owned() } else { format!("{route}?{query}") }
}

/// Defines a method for each route. The name of the requested item appears in errors.
macro_rules! routes {
    ($($(#[$doc:meta])+ $name:ident($($argument:ident: $kind:ty),*) -> $answer:ty = $method:ident $what:literal $route:expr;)+) => {
        $($(#[$doc])+
        ///
        /// # Errors
        /// [`ClientError`].
        pub async fn $name(&self, $($argument: $kind),*) -> Result<$answer, ClientError> {
            self.ask($what, Method::$method, $route.as_ref()).await
        })+
    };
}

impl Laboratory {
    pub(super) fn new(client: Client, key: String) -> Self {
        Self { client, key }
    }

    routes! {
        /// The name and the access level of the key.
        session() -> Session = GET "the session" routes::SESSION;
        /// All keys.
        keys() -> Vec<KeySummary> = GET "the keys" routes::ADMIN_KEYS;
        /// A page of the audit trail. An empty query gives the newest page.
        audit(query: &str) -> AuditPage = GET "the audit trail" with(routes::AUDIT, query);
        /// All studies.
        studies() -> Vec<StudySummary> = GET "the studies" routes::ADMIN_STUDIES;
        /// One study.
        study(slug: &str) -> StudySummary = GET "the study" routes::admin_study(slug);
        /// A study's configuration.
        configuration(slug: &str) -> Configuration = GET "the configuration" routes::admin_configuration(slug);
        /// A page of a study's participants, filtered and sorted by the query. An empty query gives
        /// the first page.
        participants(slug: &str, query: &str) -> ParticipantPage = GET "the participants" with(&routes::admin_participants(slug), query);
        /// A participant's complete record.
        participant(id: &str) -> ParticipantDetail = GET "the participant" routes::admin_participant(id);
        /// A page of a study's trials. An empty query gives the newest page.
        trials(slug: &str, query: &str) -> TrialPage = GET "the trials" with(&routes::admin_trials(slug), query);
        /// A trial with its content.
        trial(id: &str) -> TrialDetail = GET "the trial" routes::admin_trial(id);
        /// The predictor trained on the participant's earlier trials.
        predictor(trial: &str) -> TrainedPredictor = GET "the predictor" routes::admin_predictor(trial);
        /// The fingerprint of the server's simulation.
        self_check() -> SelfCheck = GET "the self-check" routes::SELF_CHECK;
        /// A page of a study's analyses. An empty query gives the newest page.
        analyses(slug: &str, query: &str) -> AnalysisPage = GET "the analyses" with(&routes::admin_analyses(slug), query);
        /// An analysis, with the names of its files.
        analysis(id: &str) -> AnalysisDetail = GET "the analysis" routes::admin_analysis(id);
        /// A page of an analysis's models, filtered by the query, such as `participant=3&experiment=1`.
        predictors(id: &str, query: &str) -> PredictorPage = GET "the models" with(&routes::analysis_predictors(id), query);
        /// A model of an analysis, to be applied to a trial.
        predictor_of(trial: &str, analysis: &str, file: &str) -> TrainedPredictor = GET "the model" format!("{}?analysis={analysis}&file={file}", routes::admin_predictor(trial));
        /// Cancels an analysis.
        cancel_analysis(id: &str) -> AnalysisSummary = POST "the cancellation" routes::cancel_analysis(id);
        /// Deletes all pilot participants of a study.
        delete_pilots(slug: &str) -> PilotsDeleted = DELETE "the deletion of pilots" routes::admin_pilots(slug);
    }

    /// Creates a further key.
    ///
    /// # Errors
    /// [`ClientError`]; `taken` if another key has the name.
    pub async fn make_key(&self, new: &NewKey) -> Result<KeyMade, ClientError> {
        self.send("the new key", Method::POST, routes::ADMIN_KEYS, new).await
    }

    /// Revokes a key.
    ///
    /// # Errors
    /// [`ClientError`].
    pub async fn revoke_key(&self, id: i64) -> Result<(), ClientError> {
        let route = routes::admin_key(&id.to_string());
        self.accepted("the revocation", self.request(Method::DELETE, &route)).await
    }

    /// Checks a draft of a study file.
    ///
    /// # Errors
    /// [`ClientError`].
    pub async fn check_draft(&self, draft: &Draft) -> Result<DraftChecked, ClientError> {
        self.send("the draft", Method::POST, routes::ADMIN_DRAFTS, draft).await
    }

    /// Checks a study that was entered in a form, and writes it as a study file.
    ///
    /// # Errors
    /// [`ClientError`].
    pub async fn check_form(&self, draft: &FormDraft) -> Result<DraftChecked, ClientError> {
        self.send("the draft", Method::POST, routes::ADMIN_FORM_DRAFTS, draft).await
    }

    /// Creates a study.
    ///
    /// # Errors
    /// [`ClientError`]; `taken` if the name is taken.
    pub async fn make_study(&self, draft: &Draft) -> Result<Configuration, ClientError> {
        self.send("the new study", Method::POST, routes::ADMIN_STUDIES, draft).await
    }

    /// Changes the configuration for new participants.
    ///
    /// # Errors
    /// [`ClientError`]; `changed` if the study no longer has the configuration that the draft is based on.
    pub async fn change_study(
        &self,
        slug: &str,
        draft: &Draft,
    ) -> Result<Configuration, ClientError> {
        self.send("the change", Method::PUT, &routes::admin_configuration(slug), draft).await
    }

    /// Opens, closes or archives a study.
    ///
    /// # Errors
    /// [`ClientError`].
    pub async fn set_status(
        &self,
        slug: &str,
        status: Status,
    ) -> Result<Configuration, ClientError> {
        let new = NewStatus { status };
        self.send("the status", Method::PUT, &routes::admin_status(slug), &new).await
    }

    /// Adds a note about a participant.
    ///
    /// # Errors
    /// [`ClientError`].
    pub async fn add_note(&self, participant: &str, text: &str) -> Result<Note, ClientError> {
        let new = NewNote { text: text.to_owned() };
        self.send("the note", Method::POST, &routes::admin_notes(participant), &new).await
    }

    /// Deletes a note.
    ///
    /// # Errors
    /// [`ClientError`].
    pub async fn delete_note(&self, participant: &str, note: i64) -> Result<(), ClientError> {
        let route = routes::admin_note(participant, &note.to_string());
        self.accepted("the deletion of a note", self.request(Method::DELETE, &route)).await
    }

    /// Excludes a participant from analyses for a reason. Without a reason, includes them again.
    ///
    /// # Errors
    /// [`ClientError`].
    pub async fn exclude(
        &self,
        participant: &str,
        reason: Option<&str>,
    ) -> Result<(), ClientError> {
        let route = routes::admin_exclusion(participant);
        let request = match reason {
            Some(reason) => {
                let new = NewExclusion { reason: reason.to_owned() };
                self.request(Method::PUT, &route).json(&new)
            }
            None => self.request(Method::DELETE, &route),
        };
        self.accepted("the exclusion", request).await
    }

    /// Deletes a participant's data.
    ///
    /// # Errors
    /// [`ClientError`].
    pub async fn delete_participant(&self, id: &str) -> Result<(), ClientError> {
        let request = self.request(Method::DELETE, &routes::admin_participant(id));
        self.accepted("the deletion of a participant", request).await
    }

    /// A study's data, as an archive in the format and with the filters of the query, such as
    /// `format=parquet&phase=task`. An empty query gives the steps as a CSV file. The whole body is
    /// held in memory.
    ///
    /// # Errors
    /// [`ClientError`].
    pub async fn export(&self, slug: &str, query: &str) -> Result<Vec<u8>, ClientError> {
        let request = self.request(Method::GET, &with(&routes::exports(slug), query));
        self.client.bytes("the export", request).await
    }

    /// Requests an analysis.
    ///
    /// # Errors
    /// [`ClientError`]; `queue_full` if too many analyses are waiting.
    pub async fn ask_analysis(
        &self,
        slug: &str,
        request: &Request,
    ) -> Result<AnalysisSummary, ClientError> {
        self.send("the analysis", Method::POST, &routes::admin_analyses(slug), request).await
    }

    /// A file of an analysis.
    ///
    /// # Errors
    /// [`ClientError`].
    pub async fn analysis_file(&self, id: &str, name: &str) -> Result<Vec<u8>, ClientError> {
        let request = self.request(Method::GET, &routes::analysis_file(id, name));
        self.client.bytes("the file", request).await
    }

    /// Deletes an analysis with its files.
    ///
    /// # Errors
    /// [`ClientError`].
    pub async fn delete_analysis(&self, id: &str) -> Result<(), ClientError> {
        let request = self.request(Method::DELETE, &routes::admin_analysis(id));
        self.accepted("the deletion of an analysis", request).await
    }

    fn request(&self, method: Method, route: &str) -> RequestBuilder {
        self.client.request(method, route).bearer_auth(&self.key)
    }

    async fn ask<T: DeserializeOwned>(
        &self,
        what: &'static str,
        method: Method,
        route: &str,
    ) -> Result<T, ClientError> {
        self.client.ask(what, self.request(method, route)).await
    }

    async fn send<T: DeserializeOwned>(
        &self,
        what: &'static str,
        method: Method,
        route: &str,
        body: &impl Serialize,
    ) -> Result<T, ClientError> {
        self.client.ask(what, self.request(method, route).json(body)).await
    }

    async fn accepted(
        &self,
        what: &'static str,
        request: RequestBuilder,
    ) -> Result<(), ClientError> {
        self.client.bytes(what, request).await.map(drop)
    }
}
