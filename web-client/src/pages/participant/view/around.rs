//! Parts that several views of the participant's page share.

use super::Node;
use crate::pages::participant::state::Stage;
use crate::pages::participant::{Msg, Part, Participant};
use crate::pages::parts;
use crate::texts::Sentences as _;
use crate::view::el;

/// A card whose title takes the focus when the card appears.
pub(super) fn card(heading: &str) -> Node {
    el("main").class("card").key(heading).child(parts::heading(heading))
}

pub(super) fn paragraph(words: impl Into<String>) -> Node {
    el("p").text(words)
}

pub(super) fn quiet(words: impl Into<String>) -> Node {
    paragraph(words).class("quiet")
}

pub(super) use crate::pages::parts::alert;

pub(super) fn button(test_id: &str, message: Msg, words: &str) -> Node {
    parts::button(test_id, message).text(words)
}

/// The main button of a view.
pub(super) fn primary(test_id: &str, message: Msg, words: &str) -> Node {
    button(test_id, message, words).class("primary")
}

/// A sentence that names keys: `{left}`, `{right}` and `{space}` are styled as keys.
pub(super) fn keyed(page: &Participant, tag: &'static str, key: &str) -> Node {
    let sentence = page.say(key);
    let mut node = el(tag);
    let mut rest = sentence.as_str();
    while let Some((before, after)) = rest.split_once('{') {
        let (name, behind) = after.split_once('}').unwrap_or((after, ""));
        node = node.text(before);
        let printed = match name {
            "left" => page.steering.left.clone(),
            "right" => page.steering.right.clone(),
            "space" => page.say("ready.space"),
            "seconds" => {
                let seconds = page.study.as_ref().map_or(0, |study| study.trials.countdown_s);
                node = node.text(page.texts.number(f64::from(seconds)));
                rest = behind;
                continue;
            }
            other => other.to_owned(),
        };
        node = node.child(el("kbd").text(printed));
        rest = behind;
    }
    node.text(rest)
}

/// A hint about the last scene or about the last answers.
pub(super) fn hint(page: &Participant) -> Option<Node> {
    page.hint.map(|key| alert("hint", &page.say(key)))
}

/// A note that a question has not been answered.
pub(super) fn unanswered(page: &Participant) -> Node {
    el("small").class("trouble").text(page.say("page.unanswered"))
}

/// The list of languages, if there are several.
pub(super) fn languages(page: &Participant) -> Option<Node> {
    let offered = &page.texts.offered;
    if offered.len() < 2 {
        return None;
    }
    let options = offered.iter().map(|language| {
        el("option")
            .attr("value", &language.tag)
            .attr("lang", &language.tag)
            .attr_if(language.tag == page.texts.language, "selected", "")
            .text(&language.name)
    });
    let select = el("select")
        .test_id("language")
        .attr("aria-label", page.say("page.language"))
        .on_input(|value| Msg::Language(value.text().to_owned()))
        .children(options);
    Some(el("div").class("languages").child(select))
}

/// Further options for the participant: another language, full screen, another computer, and
/// withdrawal.
pub(super) fn menu(page: &Participant) -> Node {
    let mut offers = el("div").children(languages(page));
    let drives = matches!(page.stage, Stage::Ready | Stage::Rest);
    if drives {
        let (on, key) = match page.is_fullscreen {
            true => (false, "ready.leave_fullscreen"),
            false => (true, "ready.fullscreen"),
        };
        offers = offers.child(button("fullscreen", Msg::Fullscreen(on), &page.say(key)));
    }
    let may_withdraw = page.progress.as_ref().is_some_and(|progress| progress.may_withdraw);
    if let (true, Some(session)) = (may_withdraw, &page.session) {
        let link = page.link.personal(&session.token);
        let input = el("input")
            .test_id("personal-link")
            .attr("readonly", "")
            .attr("aria-label", page.say("menu.link"))
            .attr("value", link);
        let section = el("section")
            .child(el("h2").text(page.say("menu.link")))
            .child(quiet(page.say("menu.link_why")))
            .child(input);
        let stop = button("stop", Msg::Go(Part::Withdrawal), &page.say("menu.stop"));
        offers = offers.child(section).child(stop);
    } else if page.session.is_some() {
        offers = offers.child(quiet(page.say("withdraw.only_here")));
    }
    let more = el("summary").text(page.say("page.more"));
    el("details").class("menu").test_id("menu").child(more).child(offers)
}
