//! The requests of the participant's page to the server.

use super::{Msg, Participant};
use crate::runtime::{Answer, Command, Request};
use sidestep::api::routes;

impl Participant {
    pub(super) fn ask(
        &self,
        name: &'static str,
        method: &'static str,
        url: impl Into<String>,
        body: Option<String>,
        then: fn(Answer) -> Msg,
    ) -> Command<Msg> {
        let token = self.session.as_ref().map(|session| session.token.clone());
        Command::Send(Request { method, token, body, ..Request::get(name, url, then) })
    }

    pub(super) fn ask_study(&self) -> Command<Msg> {
        let mut url = routes::study(&self.link.slug);
        if let (true, Some(study)) = (self.is_named, &self.study)
            && let Some(id) = self.link.external_id(study)
        {
            url.push_str("?external_id=");
            for part in id.chars() {
                // Of the characters that are allowed in ids, only these two have a special meaning
                // in a query.
                match part {
                    '+' => url.push_str("%2B"),
                    ' ' => url.push_str("%20"),
                    other => url.push(other),
                }
            }
        }
        self.ask("study", "GET", url, None, Msg::Study)
    }

    /// Requests the texts in the chosen language or, if none is chosen, in a language that the
    /// browser prefers.
    pub(super) fn ask_texts(&self) -> Command<Msg> {
        let mut url = routes::texts(&self.link.slug);
        if let Some(tag) = &self.language {
            url.extend(["?language=", tag]);
        }
        self.ask("texts", "GET", url, None, Msg::Texts)
    }

    pub(super) fn ask_progress(&self) -> Command<Msg> {
        self.ask("progress", "GET", routes::ME, None, Msg::Progress)
    }

    pub(super) fn ask_code(&self) -> Command<Msg> {
        self.ask("complete", "POST", routes::COMPLETE, None, Msg::Completed)
    }
}
