//! The links for participants. Each recruiting service has its own link.

use super::Msg;
use crate::view::{self, el};
use sidestep::api::StudyInfo;

/// For each service: the parameter that contains a person's id, the name of the service, and the
/// query of its links.
const SERVICES: [(&str, &str, &str); 3] = [
    (
        "PROLIFIC_PID",
        "Prolific",
        "PROLIFIC_PID={{%PROLIFIC_PID%}}&STUDY_ID={{%STUDY_ID%}}&SESSION_ID={{%SESSION_ID%}}",
    ),
    ("survey_code", "SONA", "survey_code=%SURVEY_CODE%"),
    ("workerId", "MTurk: the worker’s id at the end", "workerId="),
];

/// The links for participants: one for everybody if the study does not require an id, and one for
/// each id parameter that the study accepts.
pub(super) fn links(origin: &str, study: &StudyInfo) -> view::Node<Msg> {
    let address = format!("{origin}/s/{}", study.slug);
    let everybody =
        (!study.requires_external_id).then(|| ("Everybody".to_owned(), address.clone()));
    let services = study.external_id_parameters.iter().map(|parameter| {
        let known = SERVICES.iter().find(|(name, ..)| name == parameter);
        match known {
            Some((_, service, query)) => ((*service).to_owned(), format!("{address}?{query}")),
            None => (
                format!("Your own: the person’s id as {parameter}"),
                format!("{address}?{parameter}="),
            ),
        }
    });
    let row = |(name, link): (String, String)| {
        el("div").child(el("dt").text(name)).child(el("dd").child(el("code").text(link)))
    };
    el("dl")
        .class("links")
        .test_id("links")
        .children(everybody.into_iter().chain(services).map(row))
}
