//! Whether people can take part in a study, how to change that, and the links for them.

use super::{ConfigurationPage, Msg, links};
use crate::pages::parts::button;
use crate::view::{self, el};
use sidestep::api::{Admission, StudySummary};
use sidestep::study::Status;

type Node = view::Node<Msg>;

/// The section on who can take part.
pub(super) fn taking_part(page: &ConfigurationPage, study: &StudySummary) -> Node {
    let is_full = page.info.as_ref().is_some_and(|info| info.admission == Admission::Full);
    let words = match study.status {
        Status::Open if is_full => {
            "The quota is reached: nobody new can take part. To take more people, raise it below, \
             under Recruitment."
        }
        Status::Open => "Everybody with a link can take part.",
        Status::Closed => {
            "Nobody new can take part; participants who have begun can finish. You can open it again."
        }
        Status::Archived => "Nothing more is stored. The study can still be looked at.",
    };
    let choice = |status: Status, words: &str| {
        // Afterwards the present configuration is shown, so nothing that is being written is lost.
        button(&format!("set-{}", status.word()), Msg::Set(status))
            .attr_if(page.is_changed(), "disabled", "")
            .text(words)
    };
    let choices = match study.status {
        Status::Open => vec![choice(Status::Closed, "Pause or close")],
        Status::Closed => {
            vec![choice(Status::Open, "Open again"), choice(Status::Archived, "Archive")]
        }
        Status::Archived => vec![choice(Status::Closed, "Take out of the archive")],
    };
    let choices = choices.into_iter().filter(|_| page.may_manage);
    let section = el("section").class("taking-part").child(el("h2").text("Taking part")).child(
        el("div")
            .class("actions")
            .child(el("p").test_id("status-words").text(words))
            .children(choices),
    );
    let is_open = study.status == Status::Open;
    let links = page.info.as_ref().filter(|_| is_open);
    section.children(links.map(|info| links::links(&page.origin, info)))
}
