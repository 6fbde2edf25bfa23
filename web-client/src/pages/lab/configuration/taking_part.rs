//! Whether people can take part in a study, the buttons that change this, and the links for
//! participants.

use super::{ConfigurationPage, Msg, links};
use crate::pages::lab::participants;
use crate::pages::parts::button;
use crate::view::{self, el};
use sidestep::api::{Admission, StudySummary};
use sidestep::study::Status;

type Node = view::Node<Msg>;

/// The section about who can take part.
pub(super) fn taking_part(page: &ConfigurationPage, study: &StudySummary) -> Node {
    let is_full = page.info.as_ref().is_some_and(|info| info.admission == Admission::Full);
    let words = match study.status {
        Status::Open if is_full => {
            "The quota is reached: nobody new can take part. To take more people, raise it below, \
             under Recruitment."
        }
        Status::Open if study.synthetic => {
            "Synthetic participants can take part (sidestep simulate), and no people. You can try the study in \
             a test run."
        }
        Status::Open => "Everybody with a link can take part.",
        Status::Closed => {
            "Nobody new can take part; participants who have begun can finish. Test runs and rehearsals \
             are possible: they are not part of the data."
        }
        Status::Archived => "Nothing more is stored. The study can still be viewed.",
    };
    let choice = |status: Status, words: &str| {
        // Before the first check, it is unknown whether anything is missing.
        let is_early = status == Status::Open && page.editor.checked.is_none();
        // Changing the status reloads the stored configuration, so the user's edits would be lost.
        button(&format!("set-{}", status.word()), Msg::Set(status))
            .attr_if(is_early || page.is_changed(), "disabled", "")
            .text(words)
    };
    let choices = match study.status {
        Status::Open => vec![choice(Status::Closed, "Close to new participants")],
        Status::Closed => {
            vec![choice(Status::Open, "Open to participants"), choice(Status::Archived, "Archive")]
        }
        Status::Archived => vec![choice(Status::Closed, "Take out of the archive")],
    };
    let choices = choices.into_iter().filter(|_| page.may_manage);
    let trials = (study.status == Status::Closed).then(|| participants::trials(&study.slug));
    let section = el("section").class("taking-part").child(el("h2").text("Taking part")).child(
        el("div")
            .class("actions")
            .child(el("p").test_id("status-words").text(words))
            .children(trials.into_iter().flatten())
            .children(choices),
    );
    let section = section.children(opening(page, Msg::Set(Status::Open)));
    let is_open = study.status == Status::Open;
    let links = page.info.as_ref().filter(|_| is_open);
    section.children(links.map(|info| links::links(&page.origin, info)))
}

/// The list of missing parts, while the page asks the user to confirm that the study is opened.
/// `anyway` is the message of the button that confirms.
pub(super) fn opening(page: &ConfigurationPage, anyway: Msg) -> Option<Node> {
    let missing = page.editor.warnings().iter();
    let missing = missing.map(|warning| el("li").text(&warning.message));
    page.opening.then(|| {
        el("div")
            .class("confirm")
            .attr("role", "alertdialog")
            .attr("aria-label", "Open to participants?")
            .test_id("opening")
            .child(el("p").text("Before people take part, look at what is missing:"))
            .child(el("ul").children(missing))
            .child(button("open-anyway", anyway).text("Open anyway"))
            .child(button("not-yet", Msg::GoOn).class("primary").text("Not yet").focus())
    })
}
