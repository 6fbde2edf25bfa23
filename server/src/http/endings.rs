//! Return links for participants whose participation has ended, from the study's configuration.

use crate::http::error::ApiError;
use crate::store::participants::Participant;
use sidestep::api::Admission;
use sidestep::study::{Recruitment, StudyConfig};

/// The return link for a participant who gets the completion code.
#[must_use]
pub fn completed_url(config: &StudyConfig, me: &Participant, code: &str) -> Option<String> {
    filled(&config.recruitment.completed_url, Some(code), me)
}

/// The return link for a participant whom the comprehension check screened out.
#[must_use]
pub fn screened_out_url(config: &StudyConfig, me: &Participant) -> Option<String> {
    filled(&config.recruitment.screened_out_url, None, me)
}

/// The return link for a participant who has withdrawn.
#[must_use]
pub fn withdrawn_url(config: &StudyConfig, me: &Participant) -> Option<String> {
    filled(&config.recruitment.withdrawn_url, None, me)
}

/// The return link for a participant who has finished. It does not contain the completion code,
/// because the holders of some tokens are not allowed to see the code.
#[must_use]
pub fn finished_url(config: &StudyConfig, me: &Participant) -> Option<String> {
    filled(&config.recruitment.finished_url, None, me)
}

/// The return link for a newcomer whom the study does not admit.
#[must_use]
pub fn newcomers_url(
    config: &StudyConfig,
    admission: Admission,
    external_id: Option<&str>,
) -> Option<String> {
    let url = match admission {
        Admission::Full => &config.recruitment.full_url,
        Admission::Closed | Admission::Archived => &config.recruitment.closed_url,
        _ => return None,
    };
    Recruitment::filled(url, None, external_id.map(str::trim))
}

/// Whether a participant can continue, and the return link if they cannot.
#[must_use]
pub fn standing(config: &StudyConfig, me: &Participant) -> (Admission, Option<String>) {
    if me.withdrawn_at_ms.is_some() {
        (Admission::Withdrawn, withdrawn_url(config, me))
    } else if me.screened_out {
        (Admission::ScreenedOut, screened_out_url(config, me))
    } else if me.completion_code.is_some() {
        (Admission::Finished, finished_url(config, me))
    } else {
        (Admission::Open, None)
    }
}

/// Refuses participants who have withdrawn or were screened out.
///
/// # Errors
/// The error of [`over`].
pub fn check_going_on(config: &StudyConfig, me: &Participant) -> Result<(), ApiError> {
    let is_over = me.withdrawn_at_ms.is_some() || me.screened_out;
    if is_over { Err(over(config, me)) } else { Ok(()) }
}

/// 410 with the return link, for a participant who has withdrawn or was screened out.
#[must_use]
pub fn over(config: &StudyConfig, me: &Participant) -> ApiError {
    match me.withdrawn_at_ms {
        Some(_) => ApiError::withdrawn(withdrawn_url(config, me)),
        None => ApiError::screened_out(screened_out_url(config, me)),
    }
}

/// The link with its placeholders filled in. Pilot participants get no link.
fn filled(url: &str, code: Option<&str>, me: &Participant) -> Option<String> {
    let external_id = me.external_id.as_deref().map(str::trim);
    if me.pilot { None } else { Recruitment::filled(url, code, external_id) }
}
