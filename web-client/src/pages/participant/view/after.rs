//! Everything after the scenes: questions, uploads and the completion code, and all other ways to
//! end.

use super::Node;
use super::around::{alert, button, card, menu, paragraph, primary, quiet, unanswered};
use super::driving::saved;
use crate::pages::participant::{Msg, Part, Participant};
use crate::texts::Sentences as _;
use crate::view::el;
use sidestep::api::QuestionForm;
use sidestep::study::QuestionKind;

pub(super) fn questions(page: &Participant, missing: &[usize]) -> Node {
    let form = |(place, form)| question(page, form, missing.contains(&place));
    let forms = page.texts.questions.iter().enumerate().map(form);
    let missing = (!missing.is_empty()).then(|| alert("missing", &page.say("questions.missing")));
    let submit = el("button").class("primary").attr("type", "submit").test_id("submit");
    card(&page.say("questions.heading"))
        .child(
            el("form")
                .class("questions")
                .test_id("questions")
                .on_submit(Msg::Questions)
                .children(forms)
                .children(missing)
                .child(submit.text(page.say("questions.submit"))),
        )
        .child(saved(page))
        .child(menu(page))
}

fn question(page: &Participant, form: &QuestionForm, missing: bool) -> Node {
    let id = format!("answer-{}", form.name);
    let need = page.say(if form.required { "questions.required" } else { "questions.optional" });
    let need = || el("small").class("quiet").text(format!(" ({need})"));
    let note = || missing.then(|| unanswered(page));
    let radio = |value: &str, words: &str| {
        let input = el("input")
            .attrs(&[("type", "radio"), ("name", &form.name), ("value", value)])
            .test_id(&format!("{id}-{value}"));
        el("label").child(input).child(el("span").text(words))
    };
    let group = || {
        let legend = el("legend").text(&form.text).child(need()).children(note());
        el("fieldset")
            .key(&form.name)
            .attr("role", "radiogroup")
            .attr_if(missing, "aria-invalid", "true")
            .child(legend)
    };
    match form.kind {
        QuestionKind::Text => {
            let area = el("textarea")
                .attrs(&[("id", &id), ("name", &form.name), ("rows", "3")])
                .attr("maxlength", form.max_chars)
                .attr_if(missing, "aria-invalid", "true")
                .test_id(&id);
            el("div")
                .class("field-text")
                .key(&form.name)
                .child(el("label").attr("for", &id).text(&form.text).child(need()).children(note()))
                .child(area)
        }
        QuestionKind::Choice => {
            group().children(form.options.iter().map(|(value, words)| radio(value, words)))
        }
        QuestionKind::Scale => {
            let end = |words: &str| el("span").class("quiet").text(words);
            let (from, to) = form.range;
            let numbers = (from..=to)
                .map(|number| radio(&number.to_string(), &page.texts.number(number as f64)));
            let scale = el("div")
                .class("scale")
                .child(end(&form.ends.0))
                .children(numbers)
                .child(end(&form.ends.1));
            group().child(scale)
        }
    }
}

pub(super) fn finishing(page: &Participant) -> Node {
    let words = match page.outbox.len() {
        0 => page.say("finishing.code"),
        n => page.texts.count("finishing.waiting", n, &[]),
    };
    card(&page.say("finishing.heading")).child(paragraph(words)).child(saved(page))
}

pub(super) fn done(page: &Participant, code: Option<&str>, url: Option<&str>) -> Node {
    let is_pilot = page.progress.as_ref().is_some_and(|progress| progress.pilot);
    let words = match code {
        None => "done.earlier",
        Some(_) if is_pilot => "done.pilot",
        Some(_) => "done.code",
    };
    let code = code.map(|code| el("p").class("code").test_id("completion-code").text(code));
    let debrief = page.texts.debrief.as_deref().map(|html| {
        el("section")
            .class("about")
            .child(el("h2").text(page.say("done.debrief")))
            .child(el("div").class("prose").html(html))
    });
    card(&page.say("done.heading"))
        .child(paragraph(page.say(words)))
        .children(code)
        .child(way_back(url, &page.say("done.return"), &page.say("done.close")))
        .children(is_pilot.then(|| button("again", Msg::Afresh, &page.say("done.again"))))
        .children(debrief)
}

/// The link back to the recruiting service, or a notice that the page can be closed.
fn way_back(url: Option<&str>, words: &str, close: &str) -> Node {
    match url {
        Some(url) => el("p")
            .child(el("a").class("button primary").attr("href", url).test_id("return").text(words)),
        None => quiet(close),
    }
}

pub(super) fn ended(page: &Participant, heading: &str, why: &str, url: Option<&str>) -> Node {
    card(&page.say(heading)).test_id("ended").child(paragraph(page.say(why))).child(way_back(
        url,
        &page.say("withdraw.return"),
        &page.say("done.close"),
    ))
}

pub(super) fn elsewhere(page: &Participant) -> Node {
    card(&page.say("elsewhere.heading"))
        .test_id("elsewhere")
        .child(paragraph(page.say("elsewhere.why")))
        .child(primary("here", Msg::Here, &page.say("elsewhere.here")))
}

pub(super) fn withdrawal(page: &Participant) -> Node {
    // After a withdrawal, the server keeps only the data that it already has. So the trials in the
    // outbox are sent first.
    let keep = button("withdraw-keep", Msg::Withdraw(false), &page.say("withdraw.keep")).attr_if(
        !page.outbox.is_empty(),
        "disabled",
        "",
    );
    card(&page.say("withdraw.heading"))
        .test_id("withdrawal")
        .child(paragraph(page.say("withdraw.why")))
        .child(saved(page))
        .child(keep)
        .child(button("withdraw-delete", Msg::Withdraw(true), &page.say("withdraw.delete")))
        .child(quiet(page.say("withdraw.delete_why")))
        .child(primary("back", Msg::Go(Part::Study), &page.say("withdraw.back")))
}
