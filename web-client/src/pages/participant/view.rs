//! The participant's view around the canvas.

mod around;
mod before;
mod driving;
mod after;

use self::around::{alert, card};
use super::state::Stage;
use super::{Msg, Participant};
use crate::runtime::NotKept;
use crate::view::{self, el};

type Node = view::Node<Msg>;

pub(super) fn page(page: &Participant) -> Node {
    let content = match &page.stage {
        Stage::Loading => loading(page),
        Stage::Stuck(heading, why) => stuck(page, heading, why),
        Stage::Ended(heading, why, url) => after::ended(page, heading, why, url.as_deref()),
        Stage::Done(code, url) => after::done(page, code.as_deref(), url.as_deref()),
        Stage::Elsewhere => after::elsewhere(page),
        _ if page.is_withdrawing => after::withdrawal(page),
        Stage::Touch => before::touch(page),
        Stage::Welcome => before::welcome(page),
        Stage::Equipment(found) => before::equipment(page, found),
        Stage::Instructions(_) => before::instructions(page),
        Stage::Comprehension(quiz) => before::comprehension(page, quiz),
        Stage::Ready => driving::ready(page),
        Stage::Rest => driving::rest(page),
        Stage::Countdown(trial, _, left_s) => driving::scene(page, trial, Some(*left_s), None),
        Stage::Driving(trial, _) => driving::scene(page, trial, None, None),
        Stage::Over(trial, _, _, outcome) => driving::scene(page, trial, None, Some(outcome)),
        Stage::Questions(missing) => after::questions(page, missing),
        Stage::Finishing => after::finishing(page),
    };
    let is_over = matches!(page.stage, Stage::Done(..) | Stage::Ended(..));
    let not_kept = page.not_kept.filter(|_| !is_over).map(|reason| {
        let key = match reason {
            NotKept::Full => "trouble.storage_full",
            NotKept::Denied => "trouble.storage_denied",
        };
        alert("not-kept", &page.say(key))
    });
    let trouble = page.trouble.as_deref().map(|why| alert("trouble", why));
    let pilot = page
        .link
        .is_pilot()
        .then(|| el("aside").class("pilot").test_id("pilot").text(page.say("page.pilot")));
    el("div")
        .class("participant")
        .children(pilot)
        .child(content)
        .children(trouble)
        .children(not_kept)
}

/// Shows an ellipsis until the texts have arrived.
fn loading(page: &Participant) -> Node {
    let words = if page.has_texts() { page.say("page.loading") } else { "…".to_owned() };
    el("main")
        .class("card")
        .key("loading")
        .child(el("p").class("quiet").attr("role", "status").text(words))
}

fn stuck(page: &Participant, heading: &str, why: &str) -> Node {
    let (heading, why) = match page.has_texts() {
        true => (page.say(heading), why.to_owned()),
        // The server has not sent the sentences.
        false => ("Sidestep".to_owned(), "Study not found. Please check the link.".to_owned()),
    };
    card(&heading).test_id("stuck").child(el("p").text(why))
}
