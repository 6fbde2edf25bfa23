//! Every route, relative to the server's origin.

/// The study as the participant's page needs it.
#[must_use]
pub fn study(slug: &str) -> String {
    format!("/api/v1/studies/{slug}")
}
/// The sentences of the participant's page, and the study's own texts.
#[must_use]
pub fn texts(slug: &str) -> String {
    format!("/api/v1/studies/{slug}/texts")
}
/// Enrolment.
#[must_use]
pub fn participants(slug: &str) -> String {
    format!("/api/v1/studies/{slug}/participants")
}
/// The progress of the participant.
pub const ME: &str = "/api/v1/participants/me";
/// The result of the check of understanding.
pub const COMPREHENSION: &str = "/api/v1/participants/me/comprehension";
/// The answers to the questions after the last scene.
pub const ANSWERS: &str = "/api/v1/participants/me/answers";
/// Completion of a participation.
pub const COMPLETE: &str = "/api/v1/participants/me/complete";
/// Upload of a trial.
#[must_use]
pub fn my_trial(trial_id: &str) -> String {
    format!("/api/v1/participants/me/trials/{trial_id}")
}
/// The bytes of a value function.
#[must_use]
pub fn value_function(id: &str) -> String {
    format!("/api/v1/value-functions/{id}")
}
/// Signing in and out of the laboratory.
pub const SESSION: &str = "/api/v1/admin/session";
/// The experimenters' keys; a POST creates one.
pub const ADMIN_KEYS: &str = "/api/v1/admin/keys";
/// One key; a DELETE revokes it.
#[must_use]
pub fn admin_key(id: &str) -> String {
    format!("/api/v1/admin/keys/{id}")
}
/// The audit trail, newest first.
pub const AUDIT: &str = "/api/v1/admin/audit";
/// All studies.
pub const ADMIN_STUDIES: &str = "/api/v1/admin/studies";
/// One study.
#[must_use]
pub fn admin_study(slug: &str) -> String {
    format!("/api/v1/admin/studies/{slug}")
}
/// A study's configuration as the text of a study file; a PUT replaces it for new participants.
#[must_use]
pub fn admin_configuration(slug: &str) -> String {
    format!("/api/v1/admin/studies/{slug}/configuration")
}
/// A PUT opens, closes or archives a study.
#[must_use]
pub fn admin_status(slug: &str) -> String {
    format!("/api/v1/admin/studies/{slug}/status")
}
/// A POST checks a draft of a study file.
pub const ADMIN_DRAFTS: &str = "/api/v1/admin/drafts";

/// A POST checks a draft in a form and converts it to a study file.
pub const ADMIN_FORM_DRAFTS: &str = "/api/v1/admin/drafts/form";
/// Server-sent events: one for every change of stored data.
pub const CHANGES: &str = "/api/v1/admin/changes";
/// The participants of a study (without the query string for the format).
#[must_use]
pub fn admin_participants(slug: &str) -> String {
    format!("/api/v1/admin/studies/{slug}/participants")
}
/// One participant in full; a DELETE deletes their data on their request.
#[must_use]
pub fn admin_participant(id: &str) -> String {
    format!("/api/v1/admin/participants/{id}")
}
/// The tasks of a participant in a compact form.
#[must_use]
pub fn admin_drives(id: &str) -> String {
    format!("/api/v1/admin/participants/{id}/drives")
}
/// Notes about a participant.
#[must_use]
pub fn admin_notes(id: &str) -> String {
    format!("/api/v1/admin/participants/{id}/notes")
}
/// One note; a DELETE deletes it.
#[must_use]
pub fn admin_note(id: &str, note: &str) -> String {
    format!("/api/v1/admin/participants/{id}/notes/{note}")
}
/// A PUT excludes a participant from analyses; a DELETE includes them again.
#[must_use]
pub fn admin_exclusion(id: &str) -> String {
    format!("/api/v1/admin/participants/{id}/exclusion")
}
/// The pilots of a study; a DELETE deletes them.
#[must_use]
pub fn admin_pilots(slug: &str) -> String {
    format!("/api/v1/admin/studies/{slug}/pilots")
}
/// The stored trials of a study, newest first.
#[must_use]
pub fn admin_trials(slug: &str) -> String {
    format!("/api/v1/admin/studies/{slug}/trials")
}
/// One stored trial in full.
#[must_use]
pub fn admin_trial(trial_id: &str) -> String {
    format!("/api/v1/admin/trials/{trial_id}")
}
/// The predictor trained on this participant's earlier trials; a query can select a model of an analysis instead.
#[must_use]
pub fn admin_predictor(trial_id: &str) -> String {
    format!("/api/v1/admin/trials/{trial_id}/predictor")
}
/// Sets learned from this participant's earlier trials (without the query string for the family).
#[must_use]
pub fn admin_sets(trial_id: &str) -> String {
    format!("/api/v1/admin/trials/{trial_id}/sets")
}
/// The analyses of a study, newest first; a POST requests a new one.
#[must_use]
pub fn admin_analyses(slug: &str) -> String {
    format!("/api/v1/admin/studies/{slug}/analyses")
}
/// One analysis.
#[must_use]
pub fn admin_analysis(id: &str) -> String {
    format!("/api/v1/admin/analyses/{id}")
}
/// Cancels an analysis.
#[must_use]
pub fn cancel_analysis(id: &str) -> String {
    format!("/api/v1/admin/analyses/{id}/cancel")
}
/// The models of an analysis (without the query string for filters).
#[must_use]
pub fn analysis_predictors(id: &str) -> String {
    format!("/api/v1/admin/analyses/{id}/predictors")
}
/// One file of an analysis.
#[must_use]
pub fn analysis_file(id: &str, name: &str) -> String {
    format!("/api/v1/admin/analyses/{id}/files/{name}")
}
/// The description of all routes, as OpenAPI.
pub const OPENAPI: &str = "/api/openapi.json";
/// The OpenAPI description as a page.
pub const DOCS: &str = "/api/docs";
/// The server's own simulation fingerprint.
pub const SELF_CHECK: &str = "/api/v1/admin/self-check";
/// The findings of the server's last data check, and its last backup.
pub const DATA_CHECK: &str = "/api/v1/admin/data-check";
/// A study's data (without the query string for format and filters). The default is the study's
/// steps as one CSV file.
#[must_use]
pub fn exports(slug: &str) -> String {
    format!("/api/v1/admin/studies/{slug}/export")
}
